//! What the caller decides about an execution, and the check of it.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::SimError;

/// How bodies move and how contacts are found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Tier {
    /// Our own engine over flat arrays: bodies go where the reference takes
    /// them, contacts come from closed-form swept tests in continuous time.
    #[default]
    Kinematic,
    /// rapier2d: every agent is a kinematic body in a physics world, contacts
    /// come from its collision events and are known at the end of a substep.
    Contact,
}

impl Tier {
    /// The name used in configuration and output.
    pub fn name(self) -> &'static str {
        match self {
            Self::Kinematic => "kinematic",
            Self::Contact => "contact",
        }
    }
}

impl fmt::Display for Tier {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Tier {
    type Err = SimError;

    fn from_str(text: &str) -> Result<Self, SimError> {
        match text {
            "kinematic" => Ok(Self::Kinematic),
            "contact" => Ok(Self::Contact),
            _ => Err(SimError::Config {
                field: "tier",
                value: text.to_owned(),
                reason: "is not a tier",
                hint: "use kinematic or contact",
            }),
        }
    }
}

/// Parameters of an execution. [`SimConfig::default`] is one-metre cells, one
/// second per step, and the substeps of the GRACE benchmark.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
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
    /// How bodies move and how contacts are found.
    pub tier: Tier,
    /// The speed at which a body can follow its reference, in cells per step of
    /// the plan. The default of 1.5 is a little more than a diagonal move needs
    /// (√2), so that every move of a valid plan is followed exactly and nothing
    /// much faster is.
    pub max_speed_cells_per_step: f64,
    /// Pairs farther apart than this (between centres, in cells) do not count as
    /// an approach. Bounds the search for neighbours.
    pub approach_range_cells: f64,
    /// How many contacts [`Contacts::first`](crate::Contacts::first) keeps; all
    /// of them are counted, hashed and traced.
    pub max_contacts_kept: usize,
    /// Take every substep apart even where all bodies move uniformly for longer.
    /// The kinematic tier otherwise treats a uniform stretch as one, which gives
    /// the same contacts (up to rounding of their times) in less time. The
    /// contact tier always takes every substep.
    pub every_substep: bool,
    /// The most candidate pairs held at a time; an execution with more crowding
    /// is refused, since only plans that are far from valid come near it.
    pub max_pairs: usize,
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

    /// The tolerance for touching in metres.
    pub fn touch_tolerance_m(&self) -> f64 {
        Self::TOUCH_TOLERANCE_CELLS * self.cell_size_m
    }

    /// Whether an execution can be run with these parameters.
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
            "an agent must fit its cell: give metres between a thousandth and half of cell_size_m",
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
