//! Improves plans of unicycles that drive one after the other, turning at corners: `optimise FILE.tasks.json...`
//!
//! Files are those of `data/continuous/plane-tasks`. A line has the file, the durations of the plan and of what became of it, figures,
//! and milliseconds.

use std::collections::HashMap;
use std::error::Error;
use std::path::Path;
use std::time::Instant;

use fleetyard_abi::Footprint;
use fleetyard_plugin_kinodynamic::course::{Course, Segment};
use fleetyard_plugin_kinodynamic::optimise::{Guess, Options, optimise};
use fleetyard_plugin_kinodynamic::plugin::{CLEARANCE_M, Member, Team};
use fleetyard_plugin_kinodynamic::robot::{Free, Goal, Robot, State};
use fleetyard_plugin_kinodynamic::scene::Scene;
use fleetyard_plugin_kinodynamic::steer::steer;
use fleetyard_plugin_plane::Vector;
use fleetyard_plugin_plane::bins::Rectangle;
use fleetyard_plugin_plane::obstacles::{Disc, Obstacles};
use fleetyard_plugin_plane::prioritised::World;
use fleetyard_plugin_plane::sssp::bodies::Pose;
use fleetyard_plugin_plane::tangent::Tangents;
use serde_json::Value;

type Failure = Box<dyn Error>;

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or(f64::NAN)
}

fn world(path: &Path) -> Result<World, Failure> {
    let file: Value = serde_json::from_str(&std::fs::read_to_string(path)?)?;
    let place = |value: &Value| Vector::new(number(&value[0]), number(&value[1]));
    let bounds = &file["bounds_m"];
    let obstacles = file["obstacles"].as_array().into_iter().flatten();
    let polygons = obstacles.filter_map(|obstacle| obstacle["polygon"].as_array());
    Ok(World {
        polygons: polygons
            .map(|corners| corners.iter().map(place).collect())
            .collect(),
        bounds: Rectangle {
            min: place(bounds),
            max: Vector::new(number(&bounds[2]), number(&bounds[3])),
        },
        movers: Vec::new(),
    })
}

fn member(scene: &Scene<'_>, task: &Value) -> Result<Member, Failure> {
    let sides = &task["footprint"]["rectangle"];
    let (length, width) = (
        number(&sides["length_m"]) / 2.0,
        number(&sides["width_m"]) / 2.0,
    );
    let limit = |key: &str| [Some(-number(&task[key])), Some(number(&task[key]))];
    let second = std::env::var("SECOND").is_ok();
    let robot = Robot::new(&fleetyard_abi::Robot {
        name: String::new(),
        footprint: Footprint {
            radius_m: length.hypot(width),
            corners_m: vec![
                [length, width],
                [-length, width],
                [-length, -width],
                [length, -width],
            ],
        },
        dynamics: if second { "fleetyard.unicycle-2/1" } else {"fleetyard.unicycle/1"}.to_owned(),
        has_heading: true,
        polar_state: false,
        polar_control: false,
        state_limits: if second {
            vec![[None; 2], [None; 2], [None; 2], limit("speed_m_per_s"), limit("turn_rate_rad_per_s")]
        } else {
            vec![[None; 2]; 3]
        },
        control_limits: if second { vec![[Some(-0.5), Some(0.5)]; 2] } else {
            vec![limit("speed_m_per_s"), limit("turn_rate_rad_per_s")]
        },
        parameters: Vec::new(),
    })?;
    let state = |key: &str| {
        let pose = &task[key];
        State::rest(
            Vector::new(number(&pose[0]), number(&pose[1])),
            number(&pose[2]),
        )
    };
    let tolerance: f64 = std::env::var("TOLERANCE").map_or(0.05, |text| text.parse().unwrap());
    Ok(Member {
        body: robot.body.grown(CLEARANCE_M / 2.0),
        space: scene.space(&robot.body, CLEARANCE_M),
        start: state("start"),
        goal: Goal {
            state: state("goal"),
            free: Free {
                heading: false,
                rates: [false; 3],
            },
            place_m: tolerance,
            heading_rad: tolerance,
            rate: tolerance.min(1e-3),
        },
        robot,
    })
}

/// The controls of a robot that drives along a shortest way of its circle past the places of others.
fn drive(world: &World, member: &Member, others: &[(Vector, f64)]) -> Option<Vec<Segment>> {
    let radius = member.body.radius + 2e-3;
    let obstacles = Obstacles::new(world.polygons.iter().cloned(), world.bounds, radius);
    let discs = others.iter().map(|(at, radius)| Disc {
        at: *at,
        radius: *radius,
    });
    let obstacles = obstacles.with_discs(discs.collect());
    let (from, to) = (member.start, member.goal.state);
    let way = Tangents::new(&obstacles).shortest(from.at, to.at, &mut || false)?;
    let mut pose = from.pose();
    let mut segments = Vec::new();
    let last = way.places.len() - 1;
    for (number, place) in way.places.iter().enumerate().skip(1) {
        let next = Pose {
            at: *place,
            heading: to.heading,
        };
        let some = steer(&member.robot, &pose, &next, number != last)?;
        let course = Course {
            start: State::rest(pose.at, pose.heading),
            segments: some.clone(),
        };
        pose = course.end(&member.robot).pose();
        segments.extend(some);
    }
    Some(segments)
}

fn main() -> Result<(), Failure> {
    for path in std::env::args().skip(1) {
        let file: Value = serde_json::from_str(&std::fs::read_to_string(&path)?)?;
        let beside = Path::new(&path).parent().unwrap_or(Path::new("."));
        let world = world(&beside.join(file["world"].as_str().unwrap_or_default()))?;
        let scene = Scene::new(&world);
        let tasks = file["robots"].as_array().into_iter().flatten();
        let members: Result<Vec<Member>, Failure> =
            tasks.map(|task| member(&scene, task)).collect();
        let team = Team {
            scene,
            members: members?,
        };
        // One after the other, or all at once where that cannot be.
        let mut at: HashMap<usize, Vector> = (0..team.len())
            .map(|agent| (agent, team.members[agent].start.at))
            .collect();
        let mut wait = 0.0;
        let mut guess = Vec::new();
        let together = std::env::var("TOGETHER").is_ok();
        for (agent, member) in team.members.iter().enumerate() {
            let others: Vec<(Vector, f64)> = (0..team.len())
                .filter(|other| *other != agent)
                .map(|other| (at[&other], team.members[other].body.radius))
                .collect();
            let alone = drive(&world, member, &others).filter(|_| !together);
            let waits = Segment {
                control: [0.0; 3],
                seconds: if alone.is_some() { wait } else { 0.0 },
            };
            let driven = alone
                .or_else(|| drive(&world, member, &[]))
                .or_else(|| steer(&member.robot, &member.start.pose(), &member.goal.state.pose(), false))
                .unwrap_or_default();
            let mut segments = vec![waits];
            segments.extend(driven);
            let course = Course {
                start: member.start,
                segments,
            };
            wait = course.seconds().max(wait);
            at.insert(agent, member.goal.state.at);
            guess.push(Guess::of(&course, &member.robot));
        }
        let before: f64 = guess.iter().map(Guess::seconds).sum();
        let begin = Instant::now();
        let (found, figures) = optimise(&team, &guess, &Options::default(), &mut || false);
        let after: Option<f64> = found
            .as_ref()
            .map(|courses| courses.iter().map(Course::seconds).sum());
        let name = Path::new(&path).file_name().unwrap_or_default();
        println!(
            "{:32} {before:8.2} -> {:8.2}  {figures:?} {:.1} ms  {:?}",
            name.to_string_lossy(),
            after.unwrap_or(f64::NAN),
            begin.elapsed().as_secs_f64() * 1e3,
            found.and_then(|courses| team.fault(&courses)),
        );
    }
    Ok(())
}
