//! One type for every generator, for callers that let users choose.

use fleetyard_core::{Grid, InputError};
use serde::{Deserialize, Serialize};

use crate::canvas::{Canvas, cells};
use crate::{MazeSpec, RandomSpec, RoomSpec, WarehouseSpec};

/// A map without obstacles.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EmptySpec {
    /// Rows of the map.
    #[serde(deserialize_with = "cells")]
    pub rows: u32,
    /// Columns of the map.
    #[serde(deserialize_with = "cells")]
    pub cols: u32,
}

impl EmptySpec {
    /// `empty-ROWS-COLS`.
    pub fn name(&self) -> String {
        format!("empty-{}-{}", self.rows, self.cols)
    }

    /// The map.
    pub fn generate(&self) -> Result<Grid, InputError> {
        Canvas::new(self.rows, self.cols, b'.')?.grid(self.name())
    }
}

/// Any generator with its parameters.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum MapSpec {
    /// No obstacles.
    Empty(EmptySpec),
    /// Obstacles strewn at random.
    Random(RandomSpec),
    /// Rooms with doors.
    Room(RoomSpec),
    /// A maze.
    Maze(MazeSpec),
    /// Shelves and aisles.
    Warehouse(WarehouseSpec),
}

impl MapSpec {
    /// The map's name by convention; a caller may save it under another.
    pub fn name(&self) -> String {
        match self {
            Self::Empty(spec) => spec.name(),
            Self::Random(spec) => spec.name(),
            Self::Room(spec) => spec.name(),
            Self::Maze(spec) => spec.name(),
            Self::Warehouse(spec) => spec.name(),
        }
    }

    /// The map.
    pub fn generate(&self) -> Result<Grid, InputError> {
        match self {
            Self::Empty(spec) => spec.generate(),
            Self::Random(spec) => spec.generate(),
            Self::Room(spec) => spec.generate(),
            Self::Maze(spec) => spec.generate(),
            Self::Warehouse(spec) => spec.generate(),
        }
    }
}
