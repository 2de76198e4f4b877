//! Parameters of an execution, and their validation.

use fleetyard_core::{Digest, Hasher, words};
use fleetyard_world::{Footprint, Shape};
use serde::{Deserialize, Serialize};

use crate::SimError;
use crate::noise::Disturbance;

/// Model of motion and method of contact detection.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Tier {
    /// Kinematic engine over flat arrays: bodies follow their references, and closed-form
    /// swept tests find contacts in continuous time.
    #[default]
    Kinematic,
    /// rapier2d: every agent is a body with mass, which its controller drives with
    /// bounded forces. Bodies push each other, and contacts are detected at the end of a
    /// tick.
    Contact,
}

words!(Tier {
    Kinematic = "kinematic", "Own engine: exact swept tests, scales to large fleets";
    Contact = "contact", "rapier2d";
});

/// Rule by which agents proceed along their routes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Policy {
    /// By the times of the plan, regardless of other agents.
    #[default]
    Time,
    /// By the order of the plan: an agent proceeds once every agent before it has passed
    /// (an action dependency graph, see [`gate`](crate::gate)).
    Adg,
}

words!(Policy {
    Time = "time", "When the plan says, whatever the others do";
    Adg = "adg", "In the order of the plan: who comes second waits (an action dependency graph)";
});

/// Parameters of an execution. [`SimConfig::default`] is one-metre cells, one
/// second per step, and the substeps of the GRACE benchmark.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
#[allow(
    clippy::struct_excessive_bools,
    reason = "switches that have nothing to do with each other"
)]
pub struct SimConfig {
    /// Side of a grid cell in metres.
    pub cell_size_m: f64,
    /// Duration of one step of the plan in seconds.
    pub step_s: f64,
    /// Radius of an agent's disc in metres; `None` is
    /// [`SimConfig::DEFAULT_RADIUS_CELLS`] times the cell side.
    pub radius_m: Option<f64>,
    /// Ticks per simulated second.
    pub ticks_hz: u32,
    /// Substeps per tick.
    pub substeps: u32,
    /// Model of motion and method of contact detection.
    pub tier: Tier,
    /// Largest speed of a body that follows its reference, in cells per step of the plan.
    /// The default of 1.5 is a little more than a diagonal move needs (√2), so that every
    /// move of a valid plan is followed exactly and nothing much faster is.
    pub max_speed_cells_per_step: f64,
    /// Pairs farther apart than this (between centres, in cells) do not count as
    /// an approach. Bounds the search for neighbours.
    pub approach_range_cells: f64,
    /// Number of contacts that [`Contacts::first`](crate::Contacts::first) keeps; all of
    /// them are counted, hashed and traced.
    pub max_contacts_kept: usize,
    /// Process every substep separately even where all bodies move uniformly for longer.
    /// The kinematic tier otherwise treats a uniform stretch as one, which gives the same
    /// contacts (up to rounding of their times) in less time. The contact tier always
    /// processes every substep.
    pub every_substep: bool,
    /// Largest number of candidate pairs held at a time. Executions with more crowding
    /// are refused: only plans that are far from valid come near it.
    pub max_pairs: usize,
    /// Number of threads. Results do not depend on it.
    pub threads: usize,
    /// Rule by which agents proceed along their routes.
    pub policy: Policy,
    /// Time between two exchanges of messages between the agents and the server that
    /// holds the dependency graph, and between two updates of an agent's plan time, in
    /// seconds. Rounded to whole ticks. Agents that follow the plan's reference exactly
    /// need no messages.
    pub message_period_s: f64,
    /// Distance in metres between the ways of agents, beyond what their controllers need,
    /// under [`Policy::Adg`].
    pub margin_m: f64,
    /// Round the corners of the plan by Bézier curves on which no point of a robot is farther than
    /// this, in metres, from where the plan has it at that time; see
    /// [`motion::smooth`](crate::motion::smooth). Plans need twice as much room between robots.
    pub smooth_m: f64,
    /// Execute under [`Policy::Adg`] also where a plan leaves agents less room than their
    /// controllers need: they keep the plan's order and its distance, and may touch by as much as
    /// they are off their ways.
    pub tight: bool,
    /// Delays, noise and losses.
    pub disturbance: Disturbance,
    /// Continue until all agents have arrived instead of stopping at the plan's makespan.
    /// Implied by [`Policy::Adg`].
    pub until_done: bool,
    /// Latest end of the execution, in seconds.
    pub time_limit_s: Option<f64>,
    /// Heading of agents at the start of a plan without headings, in radians: north, as
    /// in LSMART.
    pub start_heading_rad: f64,
    /// Execute plans whose agents start in obstacles or overlapping each other.
    pub overlapping_starts: bool,
    /// Refuse executions that need more memory than this, in bytes.
    pub memory_limit_bytes: Option<u64>,
}

impl Default for SimConfig {
    fn default() -> Self {
        Self {
            cell_size_m: 1.0,
            step_s: 1.0,
            radius_m: None,
            ticks_hz: 60,
            substeps: 4,
            tier: Tier::Kinematic,
            max_speed_cells_per_step: 1.5,
            approach_range_cells: 2.0,
            max_contacts_kept: 1000,
            every_substep: false,
            max_pairs: 1 << 24,
            threads: 1,
            policy: Policy::Time,
            message_period_s: 0.1,
            margin_m: 0.0,
            smooth_m: 0.0,
            tight: false,
            disturbance: Disturbance::default(),
            until_done: false,
            time_limit_s: None,
            start_heading_rad: std::f64::consts::FRAC_PI_2,
            overlapping_starts: false,
            memory_limit_bytes: None,
        }
    }
}

impl SimConfig {
    /// The default radius in cell sides, 0.35.
    ///
    /// Standard four-connected rules let an agent enter a cell while another
    /// leaves it around a corner. Half-way through that move the centres are
    /// a/√2 apart, the least distance that a valid plan can produce, so
    /// discs stay apart exactly if r < a/(2√2) ≈ 0.3536 a. 0.35 keeps
    /// 0.7 % of a cell between the discs at that moment. The
    /// cell side a = 2r that GRACE names for four-connected grids lets such
    /// discs overlap; it needs a planner that also forbids corner-meets.
    pub const DEFAULT_RADIUS_CELLS: f64 = 0.35;

    /// Centres closer than the sum of the radii by more than this many cell
    /// sides are in contact. Touching is not contact: with a = 2r two agents in
    /// neighbouring cells touch all the time.
    pub const TOUCH_TOLERANCE_CELLS: f64 = 1e-6;

    /// The radius in metres.
    pub fn radius_m(&self) -> f64 {
        self.radius_m
            .unwrap_or(Self::DEFAULT_RADIUS_CELLS * self.cell_size_m)
    }

    /// Footprint of agents without a fleet: a disc.
    pub(crate) fn footprint(&self) -> Result<Shape, SimError> {
        let radius_m = self.radius_m();
        Footprint::Disc { radius_m }
            .shape()
            .map_err(|error| SimError::Config {
                field: "radius_m",
                value: radius_m.to_string(),
                reason: "is no radius",
                hint: error.hint(),
            })
    }

    /// The tolerance for touching in metres.
    pub fn touch_tolerance_m(&self) -> f64 {
        Self::TOUCH_TOLERANCE_CELLS * self.cell_size_m
    }

    /// Digest of all parameters that affect an execution.
    pub(crate) fn digest(&self) -> Digest {
        let Self {
            cell_size_m,
            step_s,
            radius_m: _,
            ticks_hz,
            substeps,
            tier,
            max_speed_cells_per_step,
            approach_range_cells,
            max_contacts_kept: _,
            every_substep,
            max_pairs: _,
            threads: _,
            policy,
            message_period_s,
            margin_m,
            smooth_m,
            tight,
            disturbance,
            until_done,
            time_limit_s,
            start_heading_rad,
            overlapping_starts: _,
            memory_limit_bytes: _,
        } = self;
        let mut hasher = Hasher::new("fleetyard.simulation/2");
        for value in [
            *cell_size_m,
            *step_s,
            self.radius_m(),
            *max_speed_cells_per_step,
            *approach_range_cells,
            *message_period_s,
            *margin_m,
            time_limit_s.unwrap_or(-1.0),
            *start_heading_rad,
        ] {
            hasher.f64(value);
        }
        for value in [
            *ticks_hz,
            *substeps,
            u32::from(*every_substep),
            u32::from(*until_done),
        ] {
            hasher.u64(u64::from(value));
        }
        hasher.bytes(tier.name().as_bytes());
        hasher.bytes(policy.name().as_bytes());
        hasher.value(disturbance);
        // Executions that never had the choice keep their digests.
        if *tight {
            hasher.bytes(b"tight");
        }
        if *smooth_m > 0.0 {
            hasher.bytes(b"smooth");
            hasher.f64(*smooth_m);
        }
        hasher.finish()
    }

    /// Checks that all parameters are in their ranges.
    pub fn validate(&self) -> Result<(), SimError> {
        let range = |field, value: f64, low: f64, high: f64, hint| {
            // Written so that NaN is out of range.
            if value >= low && value <= high {
                Ok(())
            } else {
                let value = value.to_string();
                let reason = "is out of range";
                Err(SimError::Config {
                    field,
                    value,
                    reason,
                    hint,
                })
            }
        };
        range(
            "cell_size_m",
            self.cell_size_m,
            1e-6,
            1e6,
            "give metres between 1e-6 and 1e6",
        )?;
        range(
            "step_s",
            self.step_s,
            1e-6,
            1e6,
            "give seconds between 1e-6 and 1e6",
        )?;
        range(
            "radius_m",
            self.radius_m(),
            1e-3 * self.cell_size_m,
            0.5 * self.cell_size_m,
            "an agent must fit its cell: give metres between a thousandth and half of cell_size_m, \
             or describe a fleet",
        )?;
        range(
            "ticks_hz",
            f64::from(self.ticks_hz),
            1.0,
            1e5,
            "give 1 to 100000 ticks per second",
        )?;
        range(
            "substeps",
            f64::from(self.substeps),
            1.0,
            1e3,
            "give 1 to 1000 substeps per tick",
        )?;
        range(
            "threads",
            self.threads as f64,
            1.0,
            1024.0,
            "give 1 to 1024 threads",
        )?;
        range(
            "message_period_s",
            self.message_period_s,
            1e-6,
            1e6,
            "give seconds between 1e-6 and 1e6; a tenth of a second is usual",
        )?;
        range(
            "margin_m",
            self.margin_m,
            0.0,
            1e6,
            "give metres, 0 or more",
        )?;
        range(
            "smooth_m",
            self.smooth_m,
            0.0,
            1e6,
            "give metres, 0 or more",
        )?;
        range(
            "time_limit_s",
            self.time_limit_s.unwrap_or(1.0),
            1e-6,
            1e9,
            "give seconds between 1e-6 and 1e9",
        )?;
        range(
            "start_heading_rad",
            self.start_heading_rad,
            -1e3,
            1e3,
            "give radians, counter-clockwise from the x axis; north is 1.5708",
        )?;
        range(
            "max_speed_cells_per_step",
            self.max_speed_cells_per_step,
            1e-3,
            1e3,
            "give cells per step between 0.001 and 1000; a diagonal move needs 1.42",
        )?;
        range(
            "approach_range_cells",
            self.approach_range_cells,
            0.0,
            1e3,
            "give cells between 0 and 1000; each cell of range costs time",
        )
    }
}
