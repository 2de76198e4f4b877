//! The kinds of views.

use fleetyard_abi::{Capabilities, Capability};
use fleetyard_core::{Words, words};

/// The kind of a view.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Representation {
    /// Cells, and moves in whole steps.
    Grid,
    /// Vertices in the plane, and straight edges between them.
    Roadmap,
    /// The world as it is.
    Continuous,
}

words!(Representation {
    Grid = "grid", "Cells, and moves in whole steps";
    Roadmap = "roadmap", "Vertices in the plane, and straight edges between them";
    Continuous = "continuous", "The plane as it is";
});

impl Representation {
    /// Those in which a planner claims to plan.
    pub fn claimed_in(capabilities: Capabilities) -> impl Iterator<Item = Self> {
        let claims = move |representation: &Self| {
            capabilities.has(match representation {
                Self::Grid => Capability::Grid,
                Self::Roadmap => Capability::Roadmap,
                Self::Continuous => Capability::Continuous,
            })
        };
        Self::ALL.iter().copied().filter(claims)
    }
}
