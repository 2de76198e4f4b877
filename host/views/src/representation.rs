//! The kinds of views.

use fleetyard_core::words;

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
