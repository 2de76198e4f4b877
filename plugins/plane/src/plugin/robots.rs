//! Robots, movers and the plane of the contract, as discs.

use std::f64::consts::PI;

use fleetyard_abi::sdk::{Annotations, Failure};
use fleetyard_abi::{
    Annotation, Environment, Instance, Knot, Robot, SharedEnvironment, State, Status,
    WorkspaceEnvironment,
};

use crate::Vector;
use crate::bins::Rectangle;
use crate::obstacles::Obstacles;
use crate::prioritised::{Disc, Mover, World};
use crate::sssp::bodies::wrapped;
use crate::tangent::Tangents;
use crate::timing::Stop;

/// Hands over ways and waits, in layers of these names.
pub(super) fn show(stops: &[Vec<Stop>], to: &dyn Annotations) {
    let about = |agent: usize, annotation: Annotation| Annotation {
        agent: Some(agent as u32),
        ..annotation
    };
    for (agent, stops) in stops.iter().enumerate() {
        let way = stops.iter().map(|stop| [stop.at.x, stop.at.y]);
        let mut shown = vec![about(agent, Annotation::lines("ways", [way]))];
        let waits = stops
            .iter()
            .filter(|stop| stop.departure.is_finite() && stop.departure > stop.arrival);
        shown.extend(waits.map(|stop| {
            let wait_s = stop.departure - stop.arrival;
            let wait = Annotation {
                from_s: stop.arrival,
                to_s: Some(stop.departure),
                text: format!("waits for {wait_s:.2} s"),
                values: vec![wait_s],
                ..Annotation::points("waits", [[stop.at.x, stop.at.y]])
            };
            about(agent, wait)
        }));
        for annotation in shown {
            // What is not kept the host counts.
            let _ = to.annotate(&annotation);
        }
    }
}

/// The world of an environment, with movers as the discs that enclose them.
pub fn world(environment: &SharedEnvironment) -> Result<World, Failure> {
    let no_plane = || Failure::new(Status::Unsupported, "this planner knows the plane only");
    Ok(world_of(
        Environment::workspace(environment).ok_or_else(no_plane)?,
    ))
}

fn world_of(workspace: &WorkspaceEnvironment) -> World {
    let vector = |[x, y]: [f64; 2]| Vector::new(x, y);
    let movers = workspace.movers.iter().map(|mover| {
        let last = mover.knots.len() - 1;
        let stops = mover.knots.iter().enumerate();
        let stops = stops.map(|(number, [time, x, y, _])| Stop {
            at: Vector::new(*x, *y),
            // It rests before its first knot and after its last.
            arrival: if number == 0 { 0.0 } else { *time },
            departure: if number == last { f64::INFINITY } else { *time },
        });
        Mover {
            radius: mover.footprint.radius_m,
            stops: stops.collect(),
        }
    });
    World {
        polygons: workspace
            .obstacles
            .iter()
            .map(|corners| corners.iter().copied().map(vector).collect())
            .collect(),
        bounds: Rectangle {
            min: vector(workspace.min_m),
            max: vector(workspace.max_m),
        },
        movers: movers.collect(),
    }
}

/// A robot as the disc that encloses it, and its headings.
#[derive(Debug)]
pub struct Agent {
    /// The disc.
    pub disc: Disc,
    /// The heading at the start, and the turn to that at the goal, if it has headings.
    pub turn: Option<Turn>,
}

/// A turn at the goal.
#[derive(Debug)]
pub struct Turn {
    /// The heading at the start.
    pub from_rad: f64,
    /// The turn, positive to the left.
    pub by_rad: f64,
    /// Radians per second.
    pub rate: f64,
}

/// Speed of robots without a limit, in metres per second.
const UNLIMITED: f64 = 1.0;

/// The agents of an instance.
pub(super) fn agents(instance: &Instance) -> Result<Vec<Agent>, Failure> {
    (0..instance.agents())
        .map(|agent| Agent::new(instance, agent))
        .collect()
}

/// Longest turn of an arc that is driven as one corner where arcs have to be fine, in radians: two degrees, which makes them
/// longer by a ten-thousandth.
pub(super) const FINE: f64 = PI / 90.0;

/// The failure of a team of which this agent's disc was not found to have a way, not even alone.
pub(super) fn no_way(
    world: &World,
    instance: &Instance,
    (agent, disc): (usize, &Disc),
    stop: &mut dyn FnMut() -> bool,
) -> Failure {
    let robot = instance.robot(agent);
    let is_disc = robot.is_some_and(|robot| robot.footprint.corners_m.is_empty());
    // Corners of arcs stick out a little, so that they may be in the way where the disc just fits: the arcs of this one do
    // not stick out of those of the disc.
    let smaller = disc.radius * libm::cos(FINE / 2.0) * (1.0 - 1e-6);
    let obstacles = Obstacles::new(world.polygons.clone(), world.bounds, smaller);
    let way = Tangents::with_step(&obstacles, FINE).shortest(disc.start, disc.goal, stop);
    // Nearly at its goal it may have arrived, and lengthwise a body may pass where its disc does not.
    let proven = way.is_none() && !stop() && is_disc && instance.goal_tolerance_m == 0.0;
    let status = if proven {
        Status::Infeasible
    } else {
        Status::GaveUp
    };
    let reason = format!("no way leads agent {agent} to its goal, not even alone");
    Failure::new(status, reason)
}

impl Agent {
    fn new(instance: &Instance, number: usize) -> Result<Self, Failure> {
        let invalid = |reason: String| Failure::new(Status::InvalidInput, reason);
        let lacking = || invalid(format!("agent {number} has no robot, start or goal"));
        let robot = instance.robot(number).ok_or_else(lacking)?;
        let State(start) = instance.start_states.get(number).ok_or_else(lacking)?;
        let goals = instance.goal_states.get(number).ok_or_else(lacking)?;
        let State(goal) = goals.last().ok_or_else(lacking)?;
        let place = |state: &[f64]| match state {
            [x, y, ..] if x.is_finite() && y.is_finite() => Ok(Vector::new(*x, *y)),
            _ => Err(invalid(format!(
                "agent {number} has a state without a place"
            ))),
        };
        let heading = |state: &[f64]| state.get(2).copied().filter(|_| robot.has_heading);
        let turn = heading(start).map(|from_rad| {
            let to_rad = heading(goal).filter(|heading| heading.is_finite());
            let by_rad = to_rad.map_or(0.0, |to_rad| wrapped(to_rad - from_rad));
            let rate = limit(robot, 2).unwrap_or(UNLIMITED);
            Turn {
                from_rad,
                by_rad,
                rate,
            }
        });
        Ok(Self {
            disc: Disc {
                radius: robot.footprint.radius_m,
                speed: speed(robot),
                start: place(start)?,
                goal: place(goal)?,
            },
            turn,
        })
    }

    /// The knots of a robot that makes these stops, and turns at the last.
    pub fn knots(&self, stops: &[Stop]) -> Vec<Knot> {
        let mut knots = Vec::with_capacity(2 * stops.len());
        let from_rad = self.turn.as_ref().map_or(f64::NAN, |turn| turn.from_rad);
        let mut push = |time_s: f64, at: Vector, heading_rad: f64| {
            knots.push(Knot {
                time_s,
                x_m: at.x,
                y_m: at.y,
                heading_rad,
            });
        };
        for stop in stops {
            push(stop.arrival, stop.at, from_rad);
            if stop.departure.is_finite() && stop.departure > stop.arrival {
                push(stop.departure, stop.at, from_rad);
            }
        }
        if let (Some(turn), Some(last)) = (&self.turn, stops.last())
            && turn.by_rad != 0.0
        {
            push(
                last.arrival + turn.by_rad.abs() / turn.rate,
                last.at,
                turn.from_rad + turn.by_rad,
            );
        }
        knots
    }
}

/// The limit of a control in either direction, if it has one.
fn limit(robot: &Robot, control: usize) -> Option<f64> {
    let [least, most] = *robot.control_limits.get(control)?;
    let either = [least.map(|least| -least), most];
    let least = either.into_iter().flatten().min_by(f64::total_cmp)?;
    (least > 0.0).then_some(least)
}

/// The speed that a robot may have in any direction.
fn speed(robot: &Robot) -> f64 {
    let axes = [limit(robot, 0), limit(robot, 1)];
    let least = axes.into_iter().flatten().min_by(f64::total_cmp);
    least.unwrap_or(UNLIMITED)
}
