//! Guidance graphs from measured flows.
//!
//! Y. Zhang, H. Jiang, V. Bhatt, S. Nikolaidis, J. Li, "Guidance graph optimization for lifelong
//! multi-agent path finding", IJCAI 2024: factors of all moves are too many to be searched for on a
//! large map. Searched for are the few parameters of an *update model*, which makes the factors from
//! what was measured in a run of the fleet, move by move (PIU, section 4.2). There the model is a small
//! neural network; here it is log-linear, in features that a reader can name.

mod cmaes;

use fleetyard_abi::{Guidance, c};
use fleetyard_core::{Connectivity, Grid};

pub use cmaes::Cmaes;

/// Features of a move and of a wait.
const MOVE: usize = 12;
const WAIT: usize = 4;

/// Number of parameters of the update model.
pub const PARAMETERS: usize = MOVE + WAIT;

/// The natural logarithm of a factor is no further from 0.
const LN_MOST: f64 = 2.0;

/// Row and column of the cell to which a move leads: north, east, south, west.
const STEPS: [[i64; 2]; 4] = [[-1, 0], [0, 1], [1, 0], [0, -1]];

/// Measurements of a fleet on a map.
#[derive(Debug, Clone, PartialEq)]
pub struct Usage {
    /// Per cell and move, in the order of the letters `NESW`, how often robots did it.
    pub moves: Vec<f64>,
    /// Per cell, for how many seconds robots stood still there.
    pub waiting_s: Vec<f64>,
}

impl Usage {
    /// Nothing, on a map of so many cells.
    pub fn none(cells: usize) -> Self {
        Self {
            moves: vec![0.0; 4 * cells],
            waiting_s: vec![0.0; cells],
        }
    }

    /// Adds what was measured in a run.
    pub fn add(&mut self, moves: &[u32], waiting_s: &[f64]) {
        for (sum, count) in self.moves.iter_mut().zip(moves) {
            *sum += f64::from(*count);
        }
        for (sum, seconds) in self.waiting_s.iter_mut().zip(waiting_s) {
            *sum += seconds;
        }
    }
}

/// The update model of a map.
#[derive(Debug)]
pub struct UpdateModel<'a> {
    grid: &'a Grid,
    /// By cell the moves that there are, a bit each in the order of `NESW`.
    masks: Vec<u8>,
    /// Number of moves, and of cells where robots can be.
    moves: f64,
    cells: f64,
}

/// Measurements as shares of their means: 1 is as much as on average.
struct Shares {
    flow: Vec<f64>,
    /// Per cell the flow into it.
    into: Vec<f64>,
    waiting: Vec<f64>,
}

impl<'a> UpdateModel<'a> {
    /// The model of a map.
    pub fn new(grid: &'a Grid) -> Self {
        let masks = grid.move_masks(Connectivity::Four);
        let moves: u32 = masks.iter().map(|mask| (mask & 15).count_ones()).sum();
        Self {
            grid,
            masks,
            moves: f64::from(moves),
            cells: f64::from(grid.passable_count()),
        }
    }

    /// Factors after a fleet that was measured under those before, by [`PARAMETERS`] parameters: the
    /// factors before by those that the parameters make of the measurements.
    pub fn guidance(&self, before: &Guidance, usage: &Usage, parameters: &[f64]) -> Guidance {
        let cells = self.masks.len();
        let shares = self.shares(usage);
        let mut guidance = before.clone();
        let (of_moves, of_waits) = parameters.split_at(MOVE);
        for cell in (0..cells).filter(|cell| self.grid.is_passable(*cell as u32)) {
            for d in 0..4 {
                if let Some(features) = self.of_move(&shares, cell, d) {
                    let factor = &mut guidance.moves[4 * cell + d];
                    *factor = product(*factor, &features, of_moves);
                }
            }
            let features = self.of_wait(&shares, cell);
            let factor = &mut guidance.waits[cell];
            *factor = product(*factor, &features, of_waits);
        }
        guidance
    }

    fn shares(&self, usage: &Usage) -> Shares {
        let over_mean = |values: &[f64], count: f64| -> Vec<f64> {
            let mean = values.iter().sum::<f64>() / count.max(1.0);
            let share = |value: &f64| if mean > 0.0 { value / mean } else { 0.0 };
            values.iter().map(share).collect()
        };
        let mut into = vec![0.0; self.masks.len()];
        for (at, count) in usage.moves.iter().enumerate() {
            if let Some(to) = self.to(at / 4, at % 4) {
                into[to] += count;
            }
        }
        Shares {
            flow: over_mean(&usage.moves, self.moves),
            into: over_mean(&into, self.cells),
            waiting: over_mean(&usage.waiting_s, self.cells),
        }
    }

    /// The cell to which a move leads, if there is one.
    fn to(&self, cell: usize, d: usize) -> Option<usize> {
        (self.masks[cell] >> d & 1 == 1).then(|| {
            let cols = self.grid.cols() as usize;
            [
                cell.wrapping_sub(cols),
                cell + 1,
                cell + cols,
                cell.wrapping_sub(1),
            ][d]
        })
    }

    /// Features of a move, if there is one.
    fn of_move(&self, shares: &Shares, cell: usize, d: usize) -> Option<[f64; MOVE]> {
        let to = self.to(cell, d)?;
        let back = (d + 2) % 4;
        let (flow, contraflow) = (shares.flow[4 * cell + d], shares.flow[4 * to + back]);
        let place = |cell: usize| {
            let (row, col) = self.grid.row_col(cell as u32);
            [f64::from(row), f64::from(col)]
        };
        let middle = [self.grid.rows(), self.grid.cols()].map(|size| f64::from(size - 1) / 2.0);
        let ([row, col], [to_row, to_col]) = (place(cell), place(to));
        let [step_row, step_col] = STEPS[d].map(|step| step as f64);
        let from_middle = |row: f64, col: f64| {
            [
                (row - middle[0]) / (middle[0] + 1.0),
                (col - middle[1]) / (middle[1] + 1.0),
            ]
        };
        let [y, x] = from_middle(row, col);
        let clockwise = x * step_row - y * step_col;
        let [to_y, to_x] = from_middle(to_row, to_col);
        let outward = to_y.abs().max(to_x.abs());
        // East and west in turn, south and north.
        let line = if d % 2 == 1 { row } else { col } as u32;
        let along = usize::from(line.is_multiple_of(2)) == usize::from(d == 1 || d == 2);
        let wall = |d: usize| f64::from(u8::from(self.masks[to] >> (d % 4) & 1 == 0));
        let narrow = f64::from(u8::from((self.masks[to] & 15).count_ones() <= 2));
        Some([
            1.0,
            libm::log1p(flow),
            libm::log1p(contraflow),
            (flow - contraflow) / (flow + contraflow + 0.2),
            libm::log1p(shares.into[to]),
            libm::log1p(shares.waiting[to]),
            libm::log1p(shares.waiting[cell]),
            narrow,
            if along { 1.0 } else { -1.0 },
            wall(d + 1) - wall(d + 3),
            clockwise,
            outward,
        ])
    }

    fn of_wait(&self, shares: &Shares, cell: usize) -> [f64; WAIT] {
        let narrow = (self.masks[cell] & 15).count_ones() <= 2;
        [
            1.0,
            libm::log1p(shares.waiting[cell]),
            libm::log1p(shares.into[cell]),
            f64::from(u8::from(narrow)),
        ]
    }
}

/// A factor by that of a log-linear model.
fn product(before: u16, features: &[f64], parameters: &[f64]) -> u16 {
    let pairs = features.iter().zip(parameters);
    let sum: f64 = pairs.map(|(feature, parameter)| feature * parameter).sum();
    let factor = libm::exp(sum.clamp(-LN_MOST, LN_MOST)) * f64::from(before);
    (factor.round() as u16).clamp(c::GUIDANCE_LEAST, c::GUIDANCE_MOST)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid() -> Grid {
        Grid::new("a", 2, 3, b"....@.".to_vec()).unwrap()
    }

    #[test]
    fn parameters_of_nothing_change_nothing() {
        let grid = grid();
        let model = UpdateModel::new(&grid);
        let mut usage = Usage::none(6);
        usage.add(&[3; 24], &[1.5; 6]);
        let before = Guidance {
            moves: (100..124).collect(),
            ..Guidance::neutral(24, 6)
        };
        assert_eq!(model.guidance(&before, &usage, &[0.0; PARAMETERS]), before);
    }

    #[test]
    fn a_parameter_makes_what_has_its_feature_dear() {
        let grid = grid();
        let model = UpdateModel::new(&grid);
        let mut usage = Usage::none(6);
        // From the first cell to the east, and never back.
        let mut moves = [0; 24];
        moves[1] = 7;
        usage.add(&moves, &[0.0; 6]);
        let before = Guidance::neutral(24, 6);
        let mut parameters = [0.0; PARAMETERS];
        parameters[3] = 1.0;
        let guidance = model.guidance(&before, &usage, &parameters);
        assert!(
            guidance.moves[1] > 200 && guidance.moves[4 + 3] < 50,
            "{guidance:?}"
        );
        let others = (0..24).filter(|at| ![1, 7].contains(at));
        assert!(
            others
                .map(|at| guidance.moves[at])
                .all(|factor| factor == 100)
        );
        assert_eq!(guidance.check(), Ok(()));
        // However large parameters are, factors are within their bounds.
        let huge = model.guidance(&before, &usage, &[f64::MAX; PARAMETERS]);
        assert_eq!((huge.check(), huge.moves[1]), (Ok(()), 739));
    }
}
