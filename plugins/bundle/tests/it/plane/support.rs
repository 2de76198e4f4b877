//! Problems from files, and the clearance between discs by the times of their stops alone.

#![allow(dead_code)]

use std::error::Error;
use std::fs;
use std::path::Path;

use fleetyard_plugin_plane::Vector;
use fleetyard_plugin_plane::bins::Rectangle;
use fleetyard_plugin_plane::prioritised::Disc;
use fleetyard_plugin_plane::timing::Stop;
use serde::Deserialize;

#[derive(Deserialize)]
struct Tasks {
    world: String,
    robots: Vec<Robot>,
}

#[derive(Deserialize)]
struct Robot {
    footprint: Footprint,
    speed_m_per_s: f64,
    start: [f64; 2],
    goal: [f64; 2],
}

#[derive(Deserialize)]
struct Footprint {
    disc: Radius,
}

#[derive(Deserialize)]
struct Radius {
    radius_m: f64,
}

#[derive(Deserialize)]
struct World {
    bounds_m: [f64; 4],
    obstacles: Vec<Obstacle>,
}

#[derive(Deserialize)]
struct Obstacle {
    polygon: Vec<[f64; 2]>,
}

/// A world and the discs in it.
pub(crate) struct Case {
    pub(crate) polygons: Vec<Vec<Vector>>,
    pub(crate) bounds: Rectangle,
    pub(crate) discs: Vec<Disc>,
}

impl Case {
    /// The first `count` robots of a file.
    pub(crate) fn read(file: &Path, count: usize) -> Result<Self, Box<dyn Error>> {
        let tasks: Tasks = serde_json::from_str(&fs::read_to_string(file)?)?;
        let world = file.parent().unwrap_or(Path::new(".")).join(&tasks.world);
        let world: World = serde_json::from_str(&fs::read_to_string(world)?)?;
        let place = |[x, y]: [f64; 2]| Vector::new(x, y);
        let [left, bottom, right, top] = world.bounds_m;
        let obstacles = world.obstacles.into_iter();
        let discs = tasks.robots.into_iter().take(count).map(|robot| Disc {
            radius: robot.footprint.disc.radius_m,
            speed: robot.speed_m_per_s,
            start: place(robot.start),
            goal: place(robot.goal),
        });
        Ok(Self {
            polygons: obstacles
                .map(|obstacle| obstacle.polygon.into_iter().map(place).collect())
                .collect(),
            bounds: Rectangle {
                min: Vector::new(left, bottom),
                max: Vector::new(right, top),
            },
            discs: discs.collect(),
        })
    }
}

/// Position of a disc at a time.
fn position(stops: &[Stop], time: f64) -> Vector {
    let at = stops.partition_point(|stop| stop.arrival <= time).max(1) - 1;
    let stop = stops[at];
    let Some(next) = stops.get(at + 1).filter(|_| time > stop.departure) else {
        return stop.at;
    };
    stop.at + (next.at - stop.at) * ((time - stop.departure) / (next.arrival - stop.departure))
}

/// The least distance between the borders of two discs at any time; below zero where they overlap.
pub(crate) fn least_clearance(discs: &[Disc], plans: &[Vec<Stop>]) -> f64 {
    let mut least = f64::INFINITY;
    for (a, one) in plans.iter().enumerate() {
        for (b, other) in plans.iter().enumerate().take(a) {
            let stops = one.iter().chain(other);
            let mut times: Vec<f64> = stops
                .flat_map(|stop| [stop.arrival, stop.departure])
                .collect();
            times.retain(|time| time.is_finite());
            times.sort_by(f64::total_cmp);
            for pair in times.windows(2) {
                // Between two such times the displacement is linear in time.
                let offset = |time| position(one, time) - position(other, time);
                let (from, drift) = (offset(pair[0]), offset(pair[1]) - offset(pair[0]));
                let square = drift.norm_squared();
                let part = if square > 0.0 {
                    (-from.dot(&drift) / square).clamp(0.0, 1.0)
                } else {
                    0.0
                };
                least = least.min((from + drift * part).norm() - discs[a].radius - discs[b].radius);
            }
        }
    }
    least
}
