//! Hybrid A* from the north-west cell of a maze to the one in its middle, on cells of 1 m: `hybrid MAP [WEIGHT]`.
//!
//! The robot is a rectangle of 0.6 by 0.4 m with wheels, 1 m/s and 1.5 rad/s, of first and of second order.

use std::error::Error;
use std::time::Instant;

use fleetyard_abi::Footprint;
use fleetyard_plugin_kinodynamic::hybrid::{Effort, Outcome, Query};
use fleetyard_plugin_kinodynamic::robot::{Free, Goal, Robot, State};
use fleetyard_plugin_plane::Vector;
use fleetyard_plugin_plane::bins::Rectangle;
use fleetyard_plugin_plane::prioritised::World;
use fleetyard_plugin_plane::sssp::bodies::{Pose, Space};

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let file = arguments.next().ok_or("hybrid MAP [WEIGHT]")?;
    let weight = arguments.next().map_or(Ok(2.0), |text| text.parse())?;
    let text = std::fs::read_to_string(file)?;
    let (_, rows) = text.split_once("map\n").ok_or("this is no map")?;
    let rows: Vec<&str> = rows.lines().collect();
    let side = rows.len() as f64;
    let mut polygons = Vec::new();
    for (row, line) in rows.iter().enumerate() {
        for (column, letter) in line.chars().enumerate() {
            let at = Vector::new(column as f64, side - 1.0 - row as f64);
            let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
            if letter == '@' {
                polygons.push(corners.map(|corner| at + Vector::from(corner)).to_vec());
            }
        }
    }
    let world = World {
        polygons,
        bounds: Rectangle {
            min: Vector::zeros(),
            max: Vector::repeat(side),
        },
        movers: Vec::new(),
    };
    let middle = (side - 1.0) / 4.0;
    let at = |cell: f64| 2.0 * cell.floor() + 1.5;
    let goal = Goal {
        state: State::rest(Vector::new(at(middle), side - at(middle)), 0.0),
        free: Free {
            heading: true,
            rates: [false; 3],
            trailer: true,
        },
        place_m: 0.2,
        heading_rad: 0.0,
        rate: 0.2,
    };
    for second in [false, true] {
        let rates = vec![[Some(0.0), Some(1.0)], [Some(-1.5), Some(1.5)]];
        let changes = vec![[Some(-2.0), Some(2.0)], [Some(-6.0), Some(6.0)]];
        let mut state_limits = vec![[None; 2]; 3];
        if second {
            state_limits.extend(rates.clone());
        }
        let name = if second { "unicycle-2" } else { "unicycle" };
        let robot = Robot::new(&fleetyard_abi::Robot {
            name: String::new(),
            footprint: Footprint {
                radius_m: 0.13_f64.sqrt(),
                corners_m: vec![[0.3, 0.2], [-0.3, 0.2], [-0.3, -0.2], [0.3, -0.2]],
            },
            dynamics: format!("fleetyard.{name}/1"),
            has_heading: true,
            polar_state: false,
            polar_control: false,
            state_limits,
            control_limits: if second { changes } else { rates },
            parameters: Vec::new(),
        })?;
        let body = robot.body.grown(1.2e-3);
        let begin = Instant::now();
        let space = Space::new(body, &world.polygons, world.bounds, &[]);
        let query = Query {
            robot: &robot,
            space: &space,
            world: &world,
            goal: &goal,
        };
        let effort = Effort {
            side: robot.body.radius / 2.0,
            headings: 72,
            expansions: u64::MAX,
            poses: 10_000_000,
            weight,
            shortens: false,
        };
        let start = Pose {
            at: Vector::new(1.5, side - 1.5),
            heading: 0.0,
        };
        let told = |shortens: bool| {
            let effort = Effort { shortens, ..effort };
            let (outcome, expansions) = query.solve(start, &effort, &mut || false, &mut |_| ());
            let seconds = begin.elapsed().as_secs_f64();
            let Outcome::Found(course) = outcome else {
                return println!("{name}: {outcome:?}, {expansions} expansions, {seconds:.3} s");
            };
            println!(
                "{name}: {:.1} s on the way in {} controls, {expansions} expansions, {seconds:.3} s since the beginning",
                course.seconds(),
                course.segments.len()
            );
        };
        told(false);
        told(true);
    }
    Ok(())
}
