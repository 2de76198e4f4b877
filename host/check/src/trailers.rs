//! Trailers of cars: where they are follows from the plan, and nobody is asked.
//!
//! Held against limits is the angle of the joint, and against the goal the heading at the end. Bodies
//! of trailers are swept as those of agents are; a car and its own trailer do not touch.

use std::f64::consts::TAU;

use fleetyard_core::TrajectoryPlan;
use fleetyard_world::{CHORD_M, CHORD_RAD, Shape, Trailer, Trains};

use crate::continuous::{BeyondLimit, ContinuousRule, ContinuousTask, ContinuousViolation};
use crate::controls::{MOST_DRIVEN_KNOTS, rounded};

/// The data that a trailer is judged by.
#[derive(Debug, Clone, Copy)]
pub struct TrailerTask<'a> {
    /// The trailer.
    pub trailer: Trailer,
    /// Its body.
    pub shape: &'a Shape,
    /// Its heading at the start, in radians.
    pub start_rad: f64,
    /// Its heading at the goal, in radians; NaN where any will do.
    pub goal_rad: f64,
}

/// The bodies of all agents and, after them, of their trailers.
pub(crate) struct Bodies<'a> {
    pub(crate) trains: Trains<'a>,
    pub(crate) shapes: Vec<&'a Shape>,
}

impl Bodies<'_> {
    /// Overlap that chords of the motions of trailers explain, in metres; 0 without trailers. The place
    /// of a trailer is that of its car and its own.
    pub(crate) fn slack_m(&self, agents: usize) -> f64 {
        if self.shapes.len() == agents {
            return 0.0;
        }
        let radii = self.shapes.iter().map(|shape| shape.effective_radius_m());
        4.0 * (CHORD_M + CHORD_RAD * radii.fold(0.0, f64::max))
    }

    /// A body in words.
    pub(crate) fn name(&self, body: u32) -> String {
        match self.trains.agent_of(body) {
            agent if agent == body => format!("agent {agent}"),
            agent => format!("the trailer of agent {agent}"),
        }
    }

    /// Two bodies in words.
    pub(crate) fn names(&self, one: u32, other: u32) -> String {
        let agents = [one, other].map(|body| self.trains.agent_of(body));
        if agents == [one, other] {
            format!("agents {one} and {other}")
        } else {
            format!("{} and {}", self.name(one), self.name(other))
        }
    }
}

/// Follows the trailers of all agents, and judges their joints and their ends.
pub(crate) fn check<'a>(
    plan: &'a TrajectoryPlan,
    task: &ContinuousTask<'a>,
    violations: &mut Vec<ContinuousViolation>,
) -> Bodies<'a> {
    let mut bodies = Bodies {
        trains: Trains::new(plan),
        shapes: task.shapes.to_vec(),
    };
    let mut room = MOST_DRIVEN_KNOTS;
    for (agent, own) in task.trailers.iter().enumerate() {
        let Some(own) = own else { continue };
        let mut add = |time_s: f64, rule, excess, sentence| {
            violations.push(ContinuousViolation {
                rule,
                agents: vec![agent as u32],
                time_s,
                end_s: None,
                excess,
                sentence,
            });
        };
        let towed = own.trailer.follow(plan.knots(agent), own.start_rad, room);
        let Some(towed) = towed else {
            let sentence = format!(
                "the way of the trailer of agent {agent} is too long: it has more than {room} knots"
            );
            add(0.0, ContinuousRule::OutOfLimits, None, sentence);
            continue;
        };
        room -= towed.knots.len().min(room);
        let bend = towed.bend;
        if own.trailer.is_beyond(&bend) {
            let (value, limit) = (bend.joint_rad.abs(), own.trailer.max_joint_rad);
            let (time_s, [x, y]) = (bend.time_s, bend.place_m);
            let beyond = BeyondLimit {
                place_m: bend.place_m,
                value,
                limit,
            };
            let sentence = format!(
                "agent {agent} bends the joint to its trailer by {} rad, beyond its limit of {limit} rad, \
                 at {time_s} s, in [{x}, {y}]",
                rounded(value)
            );
            add(time_s, ContinuousRule::JointLimit, Some(beyond), sentence);
        }
        let end = &towed.knots[towed.knots.len() - 1];
        let turn = end.heading_rad.unwrap_or(0.0) - own.goal_rad;
        let missed = (turn - TAU * (turn / TAU).round()).abs();
        // NaN is any.
        if missed > task.tolerance.goal.heading_rad {
            let sentence = format!("the trailer of agent {agent} ends turned by {missed} rad");
            add(end.time_s, ContinuousRule::WrongGoal, None, sentence);
        }
        if let Err(error) = bodies.trains.push(agent as u32, towed.knots) {
            let sentence = format!("the trailer of agent {agent} goes nowhere: {error}");
            add(0.0, ContinuousRule::OutOfLimits, None, sentence);
            continue;
        }
        bodies.shapes.push(own.shape);
    }
    bodies
}
