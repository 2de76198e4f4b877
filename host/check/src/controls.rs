//! Controls of plans in the plane, judged by the motion that they lead to.
//!
//! The host propagates them from the state at the start ([`ControlModel::drive`]). Held against
//! limits are the controls themselves and the states on the way, and the rates at the end against
//! those of the goal. Knots beside controls are where the agent is: the controls have to lead there,
//! within a tolerance, at all times. Both motions are linear between samples, so that their distance
//! is largest at one of either.

use std::f64::consts::TAU;

use fleetyard_core::{Knot, Knots, TrajectoryPlan};
use fleetyard_world::{Bounded, CHORD_M, CHORD_RAD, ControlExcess, ControlModel, Shape};

use crate::continuous::{BeyondLimit, ContinuousRule, ContinuousTask, ContinuousViolation};

/// Most knots of the motion of one agent that controls lead to.
pub const MOST_DRIVEN_KNOTS: usize = 1 << 22;

/// The data that controls are judged by.
#[derive(Debug, Clone, Copy)]
pub struct ControlTask<'a> {
    /// Every agent's robot; none where the host does not know its dynamics.
    pub models: &'a [Option<&'a ControlModel>],
    /// State in which each agent begins, as its robot says.
    pub starts: &'a [Vec<f64>],
    /// State in which each agent comes to rest, NaN where any will do; a shorter one asks for less.
    pub goals: &'a [Vec<f64>],
    /// Distance by which controls may lead beside knots, in metres and in radians.
    pub tolerance: f64,
    /// Difference that rates may have from those of the goal.
    pub goal_rate: f64,
}

/// True if an agent of a plan has controls.
pub(crate) fn has(plan: &TrajectoryPlan, agent: usize) -> bool {
    plan.controls()
        .is_some_and(|controls| controls.of(agent).len() > 0)
}

/// Overlap of two footprints that chords of their motions explain, in metres.
pub(crate) fn slack_m(plan: &TrajectoryPlan, shapes: &[&Shape]) -> f64 {
    if plan.controls().is_none() {
        return 0.0;
    }
    let radii = shapes.iter().map(|shape| shape.effective_radius_m());
    2.0 * (CHORD_M + CHORD_RAD * radii.fold(0.0, f64::max))
}

/// Judges the controls of all agents that have some.
pub(crate) fn check(
    plan: &TrajectoryPlan,
    task: &ContinuousTask<'_>,
    violations: &mut Vec<ContinuousViolation>,
) {
    let (Some(controls), Some(task)) = (plan.controls(), task.controls) else {
        return;
    };
    for agent in (0..plan.agents()).filter(|agent| has(plan, *agent)) {
        let knots = plan.knots(agent);
        let at = |time_s: f64, rule, sentence| ContinuousViolation {
            rule,
            agents: vec![agent as u32],
            time_s,
            end_s: None,
            excess: None,
            sentence,
        };
        let Some(model) = task.models[agent] else {
            let sentence = format!("agent {agent} has controls, but its dynamics are unknown");
            violations.push(at(0.0, ContinuousRule::WrongControls, sentence));
            continue;
        };
        let driven = model.drive(&task.starts[agent], controls.of(agent), MOST_DRIVEN_KNOTS);
        let driven = match driven {
            Ok(driven) => driven,
            Err(error) => {
                let sentence = format!("agent {agent} cannot be driven: {error}");
                violations.push(at(0.0, ContinuousRule::WrongControls, sentence));
                continue;
            }
        };
        violations.extend(driven.excesses.iter().map(|excess| beyond(agent, excess)));
        let mut led = TrajectoryPlan::default();
        if let Err(error) = led.push_path(driven.knots.iter().copied()) {
            let sentence = format!("the controls of agent {agent} lead nowhere: {error}");
            violations.push(at(0.0, ContinuousRule::WrongControls, sentence));
            continue;
        }
        violations.extend(beside(agent, knots, led.knots(0), task.tolerance));
        let end_s = led.horizon_s();
        let wanted = task.goals.get(agent).map(|goal| model.rates(goal));
        let rates = model.rates(&driven.end).zip(wanted.into_iter().flatten());
        // NaN is any.
        let missed = rates.filter(|((_, rate), (_, goal))| (rate - goal).abs() > task.goal_rate);
        violations.extend(missed.map(|((name, rate), (_, goal))| {
            let sentence = format!("agent {agent} ends with {name} {rate}, not {goal}");
            at(end_s, ContinuousRule::WrongGoal, sentence)
        }));
    }
}

/// The place where controls lead farthest beside the knots, if it is beyond the tolerance.
fn beside(
    agent: usize,
    knots: Knots<'_>,
    led: Knots<'_>,
    tolerance: f64,
) -> Option<ContinuousViolation> {
    let mut worst: Option<(f64, bool, Knot)> = None;
    let mut over = 0.0;
    let mut see = |planned: Knot, led: Knot| {
        let (x, y) = (led.x_m - planned.x_m, led.y_m - planned.y_m);
        let turn = match (led.heading_rad, planned.heading_rad) {
            (Some(led), Some(planned)) => led - planned,
            _ => 0.0,
        };
        let turn = (turn - TAU * (turn / TAU).round()).abs();
        let offs = [
            ((x * x + y * y).sqrt(), CHORD_M, true),
            (turn, CHORD_RAD, false),
        ];
        for (off, chord, is_place) in offs {
            if off - tolerance - chord > over {
                over = off - tolerance - chord;
                worst = Some((off, is_place, led));
            }
        }
    };
    for knot in knots.iter() {
        see(knot, led.at(knot.time_s));
    }
    for knot in led.iter() {
        see(knots.at(knot.time_s), knot);
    }
    let (off, is_place, led) = worst?;
    let unit = if is_place { "m" } else { "rad" };
    let (time_s, place_m) = (led.time_s, [led.x_m, led.y_m]);
    let [x, y] = place_m;
    Some(ContinuousViolation {
        rule: ContinuousRule::OffControls,
        agents: vec![agent as u32],
        time_s,
        end_s: None,
        excess: Some(BeyondLimit {
            place_m,
            value: off,
            limit: tolerance,
        }),
        sentence: format!(
            "the controls of agent {agent} lead {} {unit} beside its knots, more than {tolerance} \
             {unit}, at {time_s} s, to [{x}, {y}]",
            rounded(off)
        ),
    })
}

/// Beyond a millionth it is rounding.
pub(crate) fn rounded(value: f64) -> f64 {
    (value * 1e6).round() / 1e6
}

fn beyond(agent: usize, excess: &ControlExcess) -> ContinuousViolation {
    let ControlExcess {
        bounded,
        along,
        segment,
        time_s,
        place_m,
        value,
        limit,
    } = *excess;
    let gap = if along.is_empty() { "" } else { " " };
    let number = rounded(value);
    let (rule, what) = match bounded {
        Bounded::Place => (
            ContinuousRule::OutOfLimits,
            format!("has {along} at {number} m, beyond its limit of {limit} m,"),
        ),
        Bounded::Heading => (
            ContinuousRule::OutOfLimits,
            format!("has a heading{gap}{along} of {number} rad, beyond its limit of {limit} rad,"),
        ),
        Bounded::Speed => (
            ContinuousRule::TooFast,
            format!("moves{gap}{along} at {number} m/s, beyond its limit of {limit} m/s,"),
        ),
        Bounded::WheelSpeed => (
            ContinuousRule::TooFast,
            format!("drives its {along} wheel at {number} m/s, beyond its limit of {limit} m/s,"),
        ),
        Bounded::TurnRate => (
            ContinuousRule::TurnsTooFast,
            format!("turns at {number} rad/s, beyond its limit of {limit} rad/s,"),
        ),
        Bounded::Steering => (
            ContinuousRule::OutOfLimits,
            format!("steers by {number} rad, beyond its limit of {limit} rad,"),
        ),
        Bounded::Acceleration => (
            ContinuousRule::TooSudden,
            format!(
                "changes its speed{gap}{along} by {number} m/s², beyond its limit of {limit} m/s²,"
            ),
        ),
        Bounded::TurnAcceleration => (
            ContinuousRule::TurnsTooSuddenly,
            format!(
                "changes its turn rate by {number} rad/s², beyond its limit of {limit} rad/s²,"
            ),
        ),
    };
    let [x, y] = place_m;
    ContinuousViolation {
        rule,
        agents: vec![agent as u32],
        time_s,
        end_s: None,
        excess: Some(BeyondLimit {
            place_m,
            value,
            limit,
        }),
        sentence: format!("agent {agent} {what} in segment {segment} at {time_s} s, in [{x}, {y}]"),
    }
}
