//! Bodies that follow their reference exactly: the agents of grid planning.

use serde::{Deserialize, Serialize};

use super::error::{MotionError, duration_s};
use super::{State, Target};

/// A pebble: a step to a neighbouring cell takes a fixed time, and headings do not matter
/// (standard MAPF).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Pebble {
    /// Duration of a step in seconds; by default 1.
    pub step_s: f64,
}

impl Default for Pebble {
    fn default() -> Self {
        Self { step_s: 1.0 }
    }
}

impl Pebble {
    pub(super) fn validate(self) -> Result<(), MotionError> {
        duration_s("step_s", self.step_s)
    }
}

/// A pebble with a heading: it moves forwards only, and a turn by 90° is an action of its
/// own (the League of Robot Runners).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Rotation {
    /// Duration of a step in seconds; by default 1.
    pub step_s: f64,
    /// Duration of a turn by 90° in seconds; by default 1.
    pub turn_s: f64,
}

impl Default for Rotation {
    fn default() -> Self {
        Self {
            step_s: 1.0,
            turn_s: 1.0,
        }
    }
}

impl Rotation {
    pub(super) fn validate(&self) -> Result<(), MotionError> {
        duration_s("step_s", self.step_s)?;
        duration_s("turn_s", self.turn_s)
    }
}

/// Moves uniformly so that the body is at the target after the last tick, or falls short
/// of it in proportion to the speed factor.
pub(super) fn run(
    state: &mut State,
    target: &Target,
    ticks: usize,
    dt: f64,
    factor: f64,
    visit: &mut impl FnMut(&State),
) {
    if ticks == 0 {
        return;
    }
    let (dx, dy, _) = state.way(target);
    let turn = target
        .heading
        .map_or(0.0, |heading| heading - state.heading);
    let (x, y, heading) = (state.x, state.y, state.heading);
    let share = factor / ticks as f64;
    state.vx = dx * share / dt;
    state.vy = dy * share / dt;
    state.omega = turn * share / dt;
    for tick in 1..=ticks {
        if tick == ticks && factor >= 1.0 {
            state.x = target.x;
            state.y = target.y;
            state.heading = target.heading.unwrap_or(heading);
        } else {
            let part = share * tick as f64;
            state.x = x + dx * part;
            state.y = y + dy * part;
            state.heading = heading + turn * part;
        }
        visit(state);
    }
}
