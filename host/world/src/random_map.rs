//! Obstacles strewn at random, with the free cells in one piece.

use fleetyard_core::{Connectivity, Grid, InputError};
use serde::{Deserialize, Serialize};

use crate::SeededRandom;
use crate::canvas::{Canvas, cells};

/// A map with single-cell obstacles at random places, like MovingAI's
/// `random-*` but with all free cells connected.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RandomSpec {
    /// Rows of the map.
    #[serde(deserialize_with = "cells")]
    pub rows: u32,
    /// Columns of the map.
    #[serde(deserialize_with = "cells")]
    pub cols: u32,
    /// Share of blocked cells, from 0 to below 1.
    pub obstacle_density: f64,
    /// Chooses the map.
    #[serde(skip_deserializing)]
    pub seed: u64,
}

impl RandomSpec {
    /// `random-ROWS-COLS-PERCENT`.
    pub fn name(&self) -> String {
        let percent = (self.obstacle_density * 100.0).round();
        format!("random-{}-{}-{percent}", self.rows, self.cols)
    }

    /// The map: the number of obstacles is the density times the number of
    /// cells, rounded.
    ///
    /// Obstacles are drawn uniformly. Free cells cut off from the largest piece
    /// are then filled, and for each of them an obstacle at the piece's edge,
    /// drawn uniformly, is removed.
    pub fn generate(&self) -> Result<Grid, InputError> {
        let mut canvas = Canvas::new(self.rows, self.cols, b'.')?;
        let density = self.obstacle_density;
        if !(0.0..1.0).contains(&density) {
            return Err(InputError::new(
                "obstacle-density",
                format!("the obstacle density is {density}"),
            )
            .hint("the obstacle density is from 0 to below 1, such as 0.2"));
        }
        let cells = self.rows * self.cols;
        let obstacles = ((density * f64::from(cells)).round() as u32).min(cells - 1);
        let mut random = SeededRandom::new("map random", self.seed);
        let mut order: Vec<u32> = (0..cells).collect();
        random.shuffle(&mut order);
        for cell in &order[..obstacles as usize] {
            canvas.set_cell(*cell, b'@');
        }
        let grid = canvas.grid(self.name())?;
        connect(&grid, &mut random)
    }
}

fn connect(grid: &Grid, random: &mut SeededRandom) -> Result<Grid, InputError> {
    let component = grid.components(Connectivity::Four);
    let pieces = component.iter().copied().max().unwrap_or(0) as usize;
    let mut sizes = vec![0u32; pieces + 1];
    for label in component.iter().filter(|label| **label > 0) {
        sizes[*label as usize] += 1;
    }
    let largest = sizes.iter().copied().max().unwrap_or(0);
    let main = sizes.iter().position(|size| *size == largest).unwrap_or(0) as u32;

    let mut inside: Vec<bool> = component.iter().map(|label| *label == main).collect();
    let mut missing = sizes.iter().sum::<u32>() - largest;
    // Blocked cells that touch the main piece, each once.
    let mut edge = Vec::new();
    let mut listed = inside.clone();
    for cell in 0..grid.cell_count() {
        if inside[cell as usize] {
            list_neighbors(grid, cell, &mut listed, &mut edge);
        }
    }
    while missing > 0 && !edge.is_empty() {
        let cell = edge.swap_remove(random.below(edge.len()));
        inside[cell as usize] = true;
        missing -= 1;
        list_neighbors(grid, cell, &mut listed, &mut edge);
    }
    let letter = |free: bool| if free { b'.' } else { b'@' };
    let terrain = inside.into_iter().map(letter).collect();
    Grid::new(grid.name(), grid.rows(), grid.cols(), terrain)
}

fn list_neighbors(grid: &Grid, cell: u32, listed: &mut [bool], edge: &mut Vec<u32>) {
    for to in around(grid, cell) {
        if !std::mem::replace(&mut listed[to as usize], true) {
            edge.push(to);
        }
    }
}

/// The cells beside a cell, free or not.
fn around(grid: &Grid, cell: u32) -> impl Iterator<Item = u32> {
    let (row, col) = grid.row_col(cell);
    let at = |row: Option<u32>, col: Option<u32>| grid.cell(row?, col?);
    [
        at(row.checked_sub(1), Some(col)),
        at(Some(row), Some(col + 1)),
        at(Some(row + 1), Some(col)),
        at(Some(row), col.checked_sub(1)),
    ]
    .into_iter()
    .flatten()
}
