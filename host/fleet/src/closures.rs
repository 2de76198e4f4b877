//! Cells that close and open again while robots drive: something was put down there, or somebody stands there.
//!
//! Closures come at random, one after the other, each of one free cell for the same time. Where a robot is, or is on its way by
//! what it is committed to, nothing is put down: the closure waits until the robot has left. What is planned and not sent yet is
//! dropped where it leads through a closed cell.

use std::collections::BTreeMap;
use std::sync::Arc;

use fleetyard_core::{Connectivity, Grid, InputError};
use fleetyard_world::SeededRandom;
use serde::{Deserialize, Serialize};

/// The rate and length of closures.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClosureRate {
    /// Closures per second, on average (a Poisson process).
    pub per_s: f64,
    /// The time for which a cell is closed, in seconds.
    pub for_s: f64,
}

/// A cell that was closed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Closure {
    /// The cell.
    pub cell: u32,
    /// When it closed, in simulated seconds.
    pub from_s: f64,
    /// When it opens.
    pub until_s: f64,
}

/// The closures of a run up to a moment.
#[derive(Debug)]
pub(crate) struct Closures {
    closing: ClosureRate,
    random: SeededRandom,
    /// Free cells of the map.
    cells: Vec<u32>,
    /// When the next one is drawn.
    next_s: f64,
    /// Cells that are to close as soon as nobody is there, and for so long.
    waiting: Vec<(u32, f64)>,
    /// Closed cells, and when they open.
    closed: BTreeMap<u32, f64>,
    /// All that there were.
    pub(crate) past: Vec<Closure>,
}

impl Closures {
    /// Before the first one.
    pub(crate) fn new(closing: ClosureRate, grid: &Grid, seed: u64) -> Self {
        let cells = (0..grid.cell_count()).filter(|cell| grid.is_passable(*cell));
        let mut made = Self {
            closing,
            random: SeededRandom::new("fleet closures", seed),
            cells: cells.collect(),
            next_s: 0.0,
            waiting: Vec::new(),
            closed: BTreeMap::new(),
            past: Vec::new(),
        };
        made.next_s = made.pause_s();
        made
    }

    /// With none that are drawn: somebody closes cells by hand.
    pub(crate) fn by_hand(grid: &Grid) -> Self {
        let never = ClosureRate {
            per_s: 0.0,
            for_s: 0.0,
        };
        Self::new(never, grid, 0)
    }

    /// A cell is to close for so long.
    pub(crate) fn close(&mut self, cell: u32, for_s: f64) {
        self.waiting.push((cell, for_s));
    }

    /// A cell is to open, or not to close.
    pub(crate) fn open(&mut self, cell: u32, now_s: f64) {
        self.waiting.retain(|(waiting, _)| *waiting != cell);
        if let Some(until_s) = self.closed.get_mut(&cell) {
            *until_s = now_s;
            let mut past = self.past.iter_mut().rev();
            if let Some(last) = past.find(|closure| closure.cell == cell) {
                last.until_s = now_s;
            }
        }
    }

    /// The time between two closures.
    fn pause_s(&mut self) -> f64 {
        -libm::log(self.random.unit()) / self.closing.per_s
    }

    /// Goes on to a moment, where `is_held` says of a cell that a robot is there or on its way. Returns how many cells closed
    /// and opened.
    pub(crate) fn go_on(
        &mut self,
        now_s: f64,
        is_held: &mut dyn FnMut(u32) -> bool,
    ) -> (usize, usize) {
        while self.next_s <= now_s {
            let cell = self.cells[self.random.below(self.cells.len())];
            self.waiting.push((cell, self.closing.for_s));
            self.next_s += self.pause_s();
        }
        let before = self.closed.len();
        self.closed.retain(|_, until_s| *until_s > now_s);
        let opened = before - self.closed.len();
        let mut closed = 0;
        let (known, past) = (&mut self.closed, &mut self.past);
        self.waiting.retain(|(cell, for_s)| {
            // A closed cell stays as it is until it has opened.
            if known.contains_key(cell) || is_held(*cell) {
                return true;
            }
            let until_s = now_s + for_s;
            known.insert(*cell, until_s);
            past.push(Closure {
                cell: *cell,
                from_s: now_s,
                until_s,
            });
            closed += 1;
            false
        });
        (closed, opened)
    }

    /// True of a cell that is closed now.
    pub(crate) fn is_closed(&self, cell: u32) -> bool {
        self.closed.contains_key(&cell)
    }

    /// The map as it is now, without the cells that are closed. It allows the moves that are left.
    pub(crate) fn map(&self, grid: &Grid) -> Result<Arc<Grid>, InputError> {
        let mut terrain = grid.terrain().to_vec();
        for cell in self.closed.keys() {
            terrain[*cell as usize] = b'@';
        }
        let map = Grid::new(grid.name(), grid.rows(), grid.cols(), terrain)?;
        if !grid.has_move_masks() {
            return Ok(Arc::new(map));
        }
        let of = |grid: &Grid, cell| grid.move_mask(cell, Connectivity::Eight);
        let cells = 0..grid.cell_count();
        let moves = cells.map(|cell| of(grid, cell) & of(&map, cell)).collect();
        let map = map.with_moves(moves);
        let map = map.map_err(|error| InputError::new(grid.name(), error.to_string()))?;
        Ok(Arc::new(map))
    }
}
