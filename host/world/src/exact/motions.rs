//! Motions from knot to knot: what the checker reads, from wherever it is kept.

use fleetyard_core::{Grid, GridPlan, TrajectoryError, TrajectoryPlan, cell_center_m};

use crate::{Mover, Pose};

/// Motions of agents that are uniform between knots, in x, y and heading.
///
/// Every agent has a knot; its first is at time 0 or later, times ascend
/// strictly. Before the first and after the last it rests.
pub trait Motions {
    /// Number of agents.
    fn agents(&self) -> usize;

    /// Number of knots of an agent.
    fn knots(&self, agent: usize) -> usize;

    /// The time of a knot in seconds.
    fn time_s(&self, agent: usize, knot: usize) -> f64;

    /// The pose at a knot.
    fn pose(&self, agent: usize, knot: usize) -> Pose;

    /// True if two agents are parts of one robot, which may touch.
    fn are_joined(&self, _: usize, _: usize) -> bool {
        false
    }

    /// The time between knots, if there is one for all: it spares the checker to
    /// look into parts of a step.
    fn step_s(&self) -> Option<f64> {
        None
    }

    /// Time at which the last agent comes to rest.
    fn horizon_s(&self) -> f64 {
        (0..self.agents())
            .map(|agent| self.time_s(agent, self.knots(agent) - 1))
            .fold(0.0, f64::max)
    }
}

impl Motions for TrajectoryPlan {
    fn agents(&self) -> usize {
        self.agents()
    }

    fn knots(&self, agent: usize) -> usize {
        self.offsets()[agent + 1] - self.offsets()[agent]
    }

    fn time_s(&self, agent: usize, knot: usize) -> f64 {
        self.knots(agent).time_s[knot]
    }

    fn pose(&self, agent: usize, knot: usize) -> Pose {
        let knots = self.knots(agent);
        let heading = knots.heading_rad.map_or(0.0, |all| all[knot]);
        Pose::new(knots.x_m[knot], knots.y_m[knot], heading)
    }
}

/// A grid plan as motions from cell centre to cell centre, one step after the
/// other, without a copy of it.
#[derive(Debug, Clone, Copy)]
pub struct GridMotions<'a> {
    plan: &'a GridPlan,
    grid: &'a Grid,
    cell_size_m: f64,
    step_s: f64,
}

impl<'a> GridMotions<'a> {
    /// Refuses empty paths and paths that leave the map.
    pub fn new(
        plan: &'a GridPlan,
        grid: &'a Grid,
        cell_size_m: f64,
        step_s: f64,
    ) -> Result<Self, TrajectoryError> {
        for (what, value) in [("cell size", cell_size_m), ("time of a step", step_s)] {
            if !(value > 0.0 && value.is_finite()) {
                return Err(TrajectoryError::Scale { what, value });
            }
        }
        for (agent, path) in plan.paths().enumerate() {
            if path.is_empty() {
                return Err(TrajectoryError::NoKnots { agent });
            }
            if let Some(time) = path.iter().position(|cell| *cell >= grid.cell_count()) {
                return Err(TrajectoryError::OffMap { agent, time });
            }
        }
        Ok(Self {
            plan,
            grid,
            cell_size_m,
            step_s,
        })
    }
}

impl Motions for GridMotions<'_> {
    fn agents(&self) -> usize {
        self.plan.agents()
    }

    fn knots(&self, agent: usize) -> usize {
        self.plan.path(agent).len()
    }

    fn time_s(&self, _: usize, knot: usize) -> f64 {
        knot as f64 * self.step_s
    }

    fn pose(&self, agent: usize, knot: usize) -> Pose {
        let cell = self.plan.path(agent)[knot];
        let (x, y) = cell_center_m(self.grid, self.cell_size_m, cell);
        Pose::at(x, y)
    }

    fn step_s(&self) -> Option<f64> {
        Some(self.step_s)
    }
}

/// Agents and, numbered after them, moving obstacles.
pub(super) struct Bodies<'a, M> {
    pub(super) motions: &'a M,
    pub(super) movers: &'a [Mover],
}

impl<M: Motions> Bodies<'_, M> {
    pub(super) fn count(&self) -> usize {
        self.motions.agents() + self.movers.len()
    }

    fn knots(&self, body: usize) -> usize {
        match body.checked_sub(self.motions.agents()) {
            None => self.motions.knots(body),
            Some(mover) => self.movers[mover].times_s().len(),
        }
    }

    fn knot(&self, body: usize, knot: usize) -> (f64, Pose) {
        match body.checked_sub(self.motions.agents()) {
            None => (
                self.motions.time_s(body, knot),
                self.motions.pose(body, knot),
            ),
            Some(mover) => {
                let mover = &self.movers[mover];
                (mover.times_s()[knot], mover.poses()[knot])
            }
        }
    }

    /// A body at the beginning of its motion.
    pub(super) fn begin(&self, body: usize) -> Leg {
        let (time_s, pose) = self.knot(body, 0);
        let first = Leg {
            next: 0,
            begin_s: 0.0,
            end_s: time_s,
            from: pose,
            to: pose,
        };
        if time_s > 0.0 {
            first
        } else {
            self.after(body, &first)
        }
    }

    /// The motion after this one, which has an end.
    pub(super) fn after(&self, body: usize, leg: &Leg) -> Leg {
        let next = leg.next + 1;
        let (end_s, to) = if (next as usize) < self.knots(body) {
            self.knot(body, next as usize)
        } else {
            (f64::INFINITY, leg.to)
        };
        Leg {
            next,
            begin_s: leg.end_s,
            end_s,
            from: leg.to,
            to,
        }
    }
}

/// A uniform motion from one knot to the next, or rest without end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Leg {
    /// The knot at its end.
    next: u32,
    pub(super) begin_s: f64,
    pub(super) end_s: f64,
    pub(super) from: Pose,
    pub(super) to: Pose,
}

impl Leg {
    /// Pose of the body at a time within the motion: always the same, whoever asks.
    pub(super) fn at(&self, time_s: f64) -> Pose {
        if time_s <= self.begin_s || self.end_s == f64::INFINITY {
            return self.from;
        }
        let fraction = (time_s - self.begin_s) / (self.end_s - self.begin_s);
        self.from.toward(self.to, fraction)
    }

    pub(super) fn moves(&self) -> bool {
        self.from != self.to
    }
}
