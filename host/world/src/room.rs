//! Rooms in rows and columns with doors between them.

use fleetyard_core::{Grid, InputError};
use serde::{Deserialize, Serialize};

use crate::SeededRandom;
use crate::canvas::{Canvas, at_least, cells, one};

/// Square rooms behind one-cell walls, like MovingAI's `room-*`: walls are the
/// rows and columns whose number is a multiple of the room size. Every wall
/// between two rooms has doors of one cell, so all rooms are connected; the
/// outer walls have none.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RoomSpec {
    /// Rows of the map.
    #[serde(deserialize_with = "cells")]
    pub rows: u32,
    /// Columns of the map.
    #[serde(deserialize_with = "cells")]
    pub cols: u32,
    /// Distance from wall to wall: a room has one row and column less.
    #[serde(deserialize_with = "cells")]
    pub room_size: u32,
    /// Doors per wall between two rooms; a short wall may have fewer.
    #[serde(default = "one", deserialize_with = "cells")]
    pub doors: u32,
    /// Chooses the doors.
    #[serde(skip_deserializing)]
    pub seed: u64,
}

impl RoomSpec {
    /// `room-ROWS-COLS-SIZE`.
    pub fn name(&self) -> String {
        format!("room-{}-{}-{}", self.rows, self.cols, self.room_size)
    }

    /// The map.
    pub fn generate(&self) -> Result<Grid, InputError> {
        let size = self.room_size;
        at_least("rows", self.rows, 2)?;
        at_least("cols", self.cols, 2)?;
        at_least("room-size", size, 2)?;
        at_least("doors", self.doors, 1)?;
        let mut canvas = Canvas::new(self.rows, self.cols, b'.')?;
        for row in (0..self.rows).step_by(size as usize) {
            canvas.fill(row, 0, 1, self.cols, b'@');
        }
        for col in (0..self.cols).step_by(size as usize) {
            canvas.fill(0, col, self.rows, 1, b'@');
        }
        let mut random = SeededRandom::new("map room", self.seed);
        // Row by row of rooms: first the wall to the east, then to the south.
        for top in (0..self.rows).step_by(size as usize) {
            for left in (0..self.cols).step_by(size as usize) {
                let (east, south) = (left.saturating_add(size), top.saturating_add(size));
                let inner_rows = (top + 1)..south.min(self.rows);
                let inner_cols = (left + 1)..east.min(self.cols);
                if inner_rows.is_empty() || inner_cols.is_empty() {
                    continue;
                }
                // A wall on the map's last row or column has no room behind it.
                if east.saturating_add(1) < self.cols {
                    for row in self.door_places(inner_rows.collect(), &mut random) {
                        canvas.set(row, east, b'.');
                    }
                }
                if south.saturating_add(1) < self.rows {
                    for col in self.door_places(inner_cols.collect(), &mut random) {
                        canvas.set(south, col, b'.');
                    }
                }
            }
        }
        canvas.grid(self.name())
    }

    fn door_places(&self, mut places: Vec<u32>, random: &mut SeededRandom) -> Vec<u32> {
        random.shuffle(&mut places);
        places.truncate(self.doors as usize);
        places
    }
}
