//! Problems and results of db-CBS, <https://github.com/IMRCLab/db-CBS>, and other planners of
//! its family, in the YAML of dynobench, <https://github.com/quimortiz/dynobench>.
//!
//! A problem has bounds, boxes along the axes, and robots of types that the program knows:
//!
//! ```yaml
//! environment:
//!   min: [0, 0]
//!   max: [5, 5]
//!   obstacles:
//!     - type: box
//!       center: [2.5, 3.9]
//!       size: [0.2, 2.2]
//! robots:
//!   - type: unicycle_first_order_0
//!     start: [1, 2.5, 0]
//!     goal: [4, 2.5, 0]
//! ```
//!
//! A result:
//!
//! ```yaml
//! cost: 4.6
//! result:
//!   - states:
//!       - [1, 2.5, 0]
//!       - [1.05, 2.5, 0]
//!     actions:
//!       - [0.5, 0]
//! ```
//!
//! `result` has an entry per robot with its states, one each 0.1 s, and the actions between them,
//! which become controls. They may be missing. A result does not say what robots they are of; the number of their coordinates does, for those that move in
//! the plane:
//!
//! | numbers | a state is | of |
//! | --- | --- | --- |
//! | 2 | x, y | single integrator |
//! | 3 | x, y, heading | unicycle of first order |
//! | 4 | x, y, and two velocities | double integrator |
//! | 4 | x, y, heading, trailer heading | car with a trailer |
//! | 5 | x, y, heading, speed, turn rate | unicycle of second order |
//!
//! Which of the two that have four numbers a robot is, its motion says: a double integrator goes by its
//! velocities from state to state, a car where it heads; one that never moves is taken for a double
//! integrator. A trailer follows from its heading at the start and from the motion of its car, so that
//! the heading of a trailer is no part of a plan. Headings are unwrapped: each is the nearest to the one before
//! that means the same direction. Where only some robots have headings, the others get 0.

use std::f64::consts::TAU;

use saphyr_parser::Marker;

use super::libmrp::text;
use super::yaml::Yaml;
use crate::json::push_number;
use crate::path_list::PLAN_MAX_AGENTS;
use crate::{ControlPlan, InputError, Knot, TrajectoryPlan};

/// States in a second.
pub const DYNOBENCH_STATES_PER_S: f64 = 10.0;

/// Most numbers of a state that is read at all.
const LONGEST: usize = 64;

/// One robot's states: position, heading if it has one, and the place in the text.
type States = Vec<((f64, f64), Option<f64>, Marker)>;

/// A state of four numbers.
type Four = [f64; 4];

/// One robot's states, and its actions in between or none.
type Motion = (States, Vec<Vec<f64>>);

/// A problem in the plane, as its file says it.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct DynobenchProblem<'a> {
    /// The lower left corner in metres.
    pub min_m: [f64; 2],
    /// The upper right corner in metres.
    pub max_m: [f64; 2],
    /// The boxes, each by its lower left and its upper right corner in metres.
    pub boxes_m: Vec<[[f64; 2]; 2]>,
    /// Type, start and goal of every robot.
    pub robots: Vec<(&'a str, &'a [f64], &'a [f64])>,
}

/// The content of a problem. Types are words. A box covers its corners: where the middle of a side
/// is rounded, the box is larger by the rounding.
pub fn write_dynobench_problem(problem: &DynobenchProblem<'_>) -> Vec<u8> {
    let mut text = String::from("environment:\n  min: ");
    let row = |text: &mut String, numbers: &[f64]| {
        for (at, number) in numbers.iter().enumerate() {
            text.push_str(if at == 0 { "[" } else { ", " });
            push_number(text, *number);
        }
        text.push_str("]\n");
    };
    row(&mut text, &problem.min_m);
    text.push_str("  max: ");
    row(&mut text, &problem.max_m);
    text.push_str(if problem.boxes_m.is_empty() {
        "  obstacles: []\n"
    } else {
        "  obstacles:\n"
    });
    for [low, high] in &problem.boxes_m {
        let [(x, width), (y, height)] = [0, 1].map(|axis| covering(low[axis], high[axis]));
        text.push_str("    - type: box\n      center: ");
        row(&mut text, &[x, y]);
        text.push_str("      size: ");
        row(&mut text, &[width, height]);
    }
    text.push_str("robots:\n");
    for (name, start, goal) in &problem.robots {
        text.push_str("  - type: ");
        text.push_str(name);
        text.push_str("\n    start: ");
        row(&mut text, start);
        text.push_str("    goal: ");
        row(&mut text, goal);
    }
    text.into_bytes()
}

/// Middle and length of an interval that contains all from `low` to `high`.
fn covering(low: f64, high: f64) -> (f64, f64) {
    let middle = low + (high - low) / 2.0;
    let half = (middle - low).max(high - middle);
    let mut length = 2.0 * half;
    while middle - length / 2.0 > low || middle + length / 2.0 < high {
        length = length.next_up();
    }
    (middle, length)
}

/// Parses a result. `source` is named in errors.
pub fn read_dynobench(source: &str, bytes: &[u8]) -> Result<TrajectoryPlan, InputError> {
    let mut yaml = Yaml::new(source, text(source, bytes)?)?;
    let mut robots: Option<Vec<Motion>> = None;
    let whole = yaml.mapping("a result with the key `result`", |yaml, key, _| {
        if key != "result" {
            return yaml.skip();
        }
        let mut all = Vec::new();
        yaml.list("a list with an entry per robot", |yaml| {
            let (mut states, mut actions) = (None, Vec::new());
            let begin = yaml.mapping("an entry with states", |yaml, key, place| {
                match key {
                    "states" => states = Some(read_states(yaml, place)?),
                    "actions" => actions = read_actions(yaml)?,
                    _ => yaml.skip()?,
                }
                Ok(())
            })?;
            if all.len() == PLAN_MAX_AGENTS {
                return Err(yaml.error(begin, format!("more than {PLAN_MAX_AGENTS} robots")));
            }
            let states = states.ok_or_else(|| yaml.error(begin, "the entry has no states"))?;
            if !actions.is_empty() && actions.len() + 1 != states.len() {
                let (actions, states) = (actions.len(), states.len());
                let reason = format!("{actions} actions do not lead through {states} states");
                return Err(yaml
                    .error(begin, reason)
                    .hint("there is an action from each state to the next, or none at all"));
            }
            all.push((states, actions));
            Ok(())
        })?;
        robots = Some(all);
        Ok(())
    })?;
    let robots = robots.ok_or_else(|| yaml.error(whole, "there is no key `result`"))?;
    if robots.is_empty() {
        return Err(yaml
            .error(whole, "there are no robots in the result")
            .hint("the planner found no plan"));
    }
    let plan = into_plan(&yaml, whole, &robots)?;
    yaml.finish()?;
    Ok(plan)
}

fn read_states(yaml: &mut Yaml<'_>, place: Marker) -> Result<States, InputError> {
    let mut states = States::new();
    let mut dimension = 0;
    let mut fours: Vec<Four> = Vec::new();
    yaml.list("a list of states", |yaml| {
        let mut state = Vec::with_capacity(5);
        let place = yaml.list("a state [x, y, …]", |yaml| {
            let (value, place) = yaml.number("a coordinate")?;
            if state.len() == LONGEST {
                return Err(yaml.error(place, "the state has too many numbers"));
            }
            state.push(value);
            Ok(())
        })?;
        let numbers = state.len();
        if !states.is_empty() && numbers != dimension {
            let reason = format!("the state has {numbers} numbers, unlike the {dimension} before");
            return Err(yaml.error(place, reason));
        }
        dimension = numbers;
        if let Ok(four) = Four::try_from(&state[..]) {
            fours.push(four);
        }
        let heading = match state[..] {
            [_, _] | [_, _, _, _] => None,
            [_, _, heading] | [_, _, heading, _, _] => Some(heading),
            _ => {
                let reason = format!("no robot in the plane has a state of {numbers} numbers");
                return Err(yaml
                    .error(place, reason)
                    .hint("states of 2 to 5 numbers are read: x, y, and then by model"));
            }
        };
        states.push(((state[0], state[1]), heading, place));
        Ok(())
    })?;
    if states.is_empty() {
        return Err(yaml
            .error(place, "the robot has no states")
            .hint("the planner found no plan"));
    }
    if is_car(&fours) {
        for ((_, heading, _), four) in states.iter_mut().zip(&fours) {
            *heading = Some(four[2]);
        }
    }
    Ok(states)
}

/// States of four numbers that go where the third one heads rather than by the third and the fourth.
fn is_car(states: &[Four]) -> bool {
    let (mut by_velocity, mut by_heading) = (0.0, 0.0);
    for pair in states.windows(2) {
        let [from, to] = [pair[0], pair[1]];
        let (x, y) = (to[0] - from[0], to[1] - from[1]);
        // By the velocity before, after, or between, as a program integrates.
        let off = |share: f64| {
            let part =
                |at: usize| (from[at] + (to[at] - from[at]) * share) / DYNOBENCH_STATES_PER_S;
            let (x, y) = (x - part(2), y - part(3));
            x * x + y * y
        };
        by_velocity += off(0.0).min(off(0.5)).min(off(1.0));
        let (sin, cos) = libm::sincos(f64::midpoint(from[2], to[2]));
        let aside = y * cos - x * sin;
        by_heading += aside * aside;
    }
    by_heading < by_velocity
}

fn read_actions(yaml: &mut Yaml<'_>) -> Result<Vec<Vec<f64>>, InputError> {
    let mut actions = Vec::new();
    yaml.list("a list of actions", |yaml| {
        let mut action = Vec::with_capacity(2);
        yaml.list("an action [a, b, …]", |yaml| {
            let (value, place) = yaml.number("a number")?;
            if action.len() == LONGEST {
                return Err(yaml.error(place, "the action has too many numbers"));
            }
            action.push(value);
            Ok(())
        })?;
        actions.push(action);
        Ok(())
    })?;
    Ok(actions)
}

fn into_plan(
    yaml: &Yaml<'_>,
    whole: Marker,
    robots: &[Motion],
) -> Result<TrajectoryPlan, InputError> {
    let turns = robots.iter().any(|(states, _)| states[0].1.is_some());
    let knots = robots.iter().map(|(states, _)| states.len()).sum();
    let mut plan = TrajectoryPlan::with_capacity(robots.len(), knots);
    let mut controls = ControlPlan::default();
    for (states, actions) in robots {
        let segments = actions
            .iter()
            .map(|action| (1.0 / DYNOBENCH_STATES_PER_S, action));
        controls
            .push_agent(segments)
            .map_err(|reason| yaml.error(states[0].2, reason))?;
        let mut before = 0.0;
        let path = states
            .iter()
            .enumerate()
            .map(|(step, (position, heading, _))| {
                let heading = heading.map(|heading| match step {
                    0 => heading,
                    _ => heading - TAU * ((heading - before) / TAU).round(),
                });
                before = heading.unwrap_or(0.0);
                Knot {
                    time_s: step as f64 / DYNOBENCH_STATES_PER_S,
                    x_m: position.0,
                    y_m: position.1,
                    heading_rad: turns.then_some(before),
                }
            });
        plan.push_path(path).map_err(|error| {
            let knot = error.place().map_or(0, |(_, knot)| knot);
            let place = states.get(knot).unwrap_or(&states[0]).2;
            yaml.error(place, error.to_string())
        })?;
    }
    let plan = plan.with_controls(controls);
    plan.map_err(|error| yaml.error(whole, error.to_string()))
}
