//! Plans as sequences of knots per agent.
//!
//! A route is an agent's knots 0, 1, …, K: places, each with a planned time. Action k
//! goes from knot k − 1 to knot k; a wait is an action that stays. Times are in substeps
//! since the start of the execution.

use fleetyard_core::{Digest, Grid, GridPlan, TrajectoryPlan, cell_center_m};

use fleetyard_world::Pose;

use crate::gate::Routes;
use crate::track::{fraction, interpolate};

/// A plan to execute.
#[derive(Debug, Clone, Copy)]
pub enum Plan<'a> {
    /// Cells of a grid at whole steps.
    Grid(&'a GridPlan),
    /// Poses at arbitrary times. Plans on roadmaps become such plans with
    /// [`RoadmapPlan::to_trajectories`](fleetyard_core::RoadmapPlan::to_trajectories).
    Trajectories(&'a TrajectoryPlan),
}

impl Plan<'_> {
    /// Number of agents.
    pub fn agents(&self) -> usize {
        match self {
            Self::Grid(plan) => plan.agents(),
            Self::Trajectories(plan) => plan.agents(),
        }
    }

    /// Digest of the plan.
    pub fn digest(&self) -> fleetyard_core::Digest {
        match self {
            Self::Grid(plan) => Digest::of_plan(plan),
            Self::Trajectories(plan) => plan.digest(),
        }
    }
}

impl<'a> From<&'a GridPlan> for Plan<'a> {
    fn from(plan: &'a GridPlan) -> Self {
        Self::Grid(plan)
    }
}

impl<'a> From<&'a TrajectoryPlan> for Plan<'a> {
    fn from(plan: &'a TrajectoryPlan) -> Self {
        Self::Trajectories(plan)
    }
}

/// A planned position, with a heading where the plan gives one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Place {
    pub(crate) x: f64,
    pub(crate) y: f64,
    pub(crate) heading: Option<f64>,
}

/// The plan as the reference of bodies. Times are in substeps since the start of the
/// execution.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Reference<'a> {
    Grid {
        grid: &'a Grid,
        plan: &'a GridPlan,
        cell_size_m: f64,
        substeps_per_step: f64,
        substeps_per_s: f64,
    },
    Trajectories {
        plan: &'a TrajectoryPlan,
        substeps_per_s: f64,
    },
}

impl Reference<'_> {
    /// Index of an agent's last knot.
    pub(crate) fn last(&self, agent: usize) -> usize {
        match self {
            Self::Grid { plan, .. } => plan.path(agent).len() - 1,
            Self::Trajectories { plan, .. } => {
                plan.offsets()[agent + 1] - plan.offsets()[agent] - 1
            }
        }
    }

    /// Planned time of a knot.
    pub(crate) fn time(&self, agent: usize, knot: usize) -> f64 {
        match self {
            Self::Grid {
                substeps_per_step, ..
            } => knot as f64 * substeps_per_step,
            Self::Trajectories {
                plan,
                substeps_per_s,
            } => plan.knots(agent).time_s[knot] * substeps_per_s,
        }
    }

    /// Planned place of a knot.
    pub(crate) fn place(&self, agent: usize, knot: usize) -> Place {
        match self {
            Self::Grid {
                grid,
                plan,
                cell_size_m,
                ..
            } => {
                let (x, y) = cell_center_m(grid, *cell_size_m, plan.path(agent)[knot]);
                Place {
                    x,
                    y,
                    heading: None,
                }
            }
            Self::Trajectories { plan, .. } => {
                let knot = plan.knots(agent).get(knot);
                Place {
                    x: knot.x_m,
                    y: knot.y_m,
                    heading: knot.heading_rad,
                }
            }
        }
    }

    /// Planned place of an agent at a time between two knots.
    pub(crate) fn between(&self, agent: usize, from: usize, when: f64) -> Place {
        let here = self.place(agent, from);
        if from >= self.last(agent) {
            return here;
        }
        let there = self.place(agent, from + 1);
        let share = fraction(self.time(agent, from), self.time(agent, from + 1), when);
        if share <= 0.0 {
            return here;
        }
        Place {
            x: interpolate(here.x, there.x, share),
            y: interpolate(here.y, there.y, share),
            heading: here
                .heading
                .zip(there.heading)
                .map(|(from, to)| interpolate(from, to, share)),
        }
    }

    /// The last knot whose planned time has passed, searched from a known one.
    pub(crate) fn due(&self, agent: usize, from: usize, when: f64) -> usize {
        let last = self.last(agent);
        match self {
            Self::Grid {
                substeps_per_step, ..
            } => {
                let mut knot = ((when / substeps_per_step) as usize).min(last);
                // Division may round up.
                if knot > from && knot as f64 * substeps_per_step > when {
                    knot -= 1;
                }
                knot.max(from)
            }
            Self::Trajectories { .. } => {
                let mut knot = from;
                while knot < last && self.time(agent, knot + 1) <= when {
                    knot += 1;
                }
                knot
            }
        }
    }

    /// Planned time of the last arrival.
    pub(crate) fn horizon(&self) -> f64 {
        match self {
            Self::Grid {
                plan,
                substeps_per_step,
                ..
            } => plan.horizon() as f64 * substeps_per_step,
            Self::Trajectories {
                plan,
                substeps_per_s,
            } => plan.horizon_s() * substeps_per_s,
        }
    }
}

impl Routes for Reference<'_> {
    fn agents(&self) -> usize {
        match self {
            Self::Grid { plan, .. } => plan.agents(),
            Self::Trajectories { plan, .. } => plan.agents(),
        }
    }

    fn actions(&self, agent: usize) -> usize {
        self.last(agent)
    }

    fn pose(&self, agent: usize, knot: usize) -> Pose {
        let place = self.place(agent, knot);
        Pose::new(place.x, place.y, place.heading.unwrap_or(0.0))
    }

    fn time_s(&self, agent: usize, knot: usize) -> f64 {
        let (Self::Grid { substeps_per_s, .. } | Self::Trajectories { substeps_per_s, .. }) = self;
        self.time(agent, knot) / substeps_per_s
    }
}
