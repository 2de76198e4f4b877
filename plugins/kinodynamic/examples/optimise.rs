//! Improves motions of unicycles that set out all at once, turning at corners of shortest ways, with no regard to each other:
//! `optimise TOLERANCE TASKS...` for files of tasks in the plane, with a goal tolerance in m and rad. A line for each file has
//! the durations before and after, figures, and milliseconds.

#[path = "../../bundle/tests/it/kinodynamic/tasks.rs"]
mod tasks;

use std::error::Error;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use fleetyard_plugin_kinodynamic::course::{Course, Segment};
use fleetyard_plugin_kinodynamic::optimise::{Guess, Options, optimise};
use fleetyard_plugin_kinodynamic::plugin::{CLEARANCE_M, Member, Team};
use fleetyard_plugin_kinodynamic::robot::State;
use fleetyard_plugin_kinodynamic::steer::steer;
use fleetyard_plugin_plane::obstacles::Obstacles;
use fleetyard_plugin_plane::plugin::robots::world;
use fleetyard_plugin_plane::prioritised::World;
use fleetyard_plugin_plane::sssp::bodies::Pose;
use fleetyard_plugin_plane::tangent::Tangents;

/// Controls of a robot along the shortest way of its circle, or straight where there is none.
fn drive(world: &World, member: &Member) -> Option<Vec<Segment>> {
    let (from, to) = (member.start.pose(), member.goal.state.pose());
    let radius = member.space.body.radius;
    let obstacles = Obstacles::new(world.polygons.iter().cloned(), world.bounds, radius);
    let way = Tangents::new(&obstacles).shortest(from.at, to.at, &mut || false);
    let Some(way) = way else {
        return steer(&member.robot, &from, &to, false);
    };
    let mut pose = from;
    let mut segments = Vec::new();
    for (number, at) in way.places.iter().enumerate().skip(1) {
        let is_last = number + 1 == way.places.len();
        let next = Pose { at: *at, ..to };
        let driven = Course {
            start: State::rest(pose.at, pose.heading),
            segments: steer(&member.robot, &pose, &next, !is_last)?,
        };
        pose = driven.end(&member.robot).pose();
        segments.extend(driven.segments);
    }
    Some(segments)
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let tolerance: f64 = arguments.next().ok_or("no tolerance")?.parse()?;
    for file in arguments {
        let problem = tasks::Problem::read(Path::new(&file), usize::MAX)?.within(tolerance);
        let world = world(&Arc::new(problem.environment())).map_err(|failure| failure.message)?;
        let team =
            Team::new(&world, &problem.instance, CLEARANCE_M).map_err(|failure| failure.message)?;
        let guess = team.members.iter().map(|member| {
            let course = Course {
                start: member.start,
                segments: drive(&world, member).unwrap_or_default(),
            };
            Guess::of(&course, &member.robot)
        });
        let guess: Vec<Guess> = guess.collect();
        let before: f64 = guess.iter().map(Guess::seconds).sum();
        let begin = Instant::now();
        let (found, figures) = optimise(&team, &guess, &Options::default(), &mut || false);
        let milliseconds = begin.elapsed().as_secs_f64() * 1e3;
        let after = found.map(|courses| courses.iter().map(Course::seconds).sum::<f64>());
        let after = after.map_or("none".to_owned(), |after| format!("{after:.2}"));
        println!("{file}: {before:.2} -> {after} s, {figures:?}, {milliseconds:.1} ms");
    }
    Ok(())
}
