//! Grid to world: blocked cells become obstacles.

use fleetyard_core::{Grid, InputError};
use fleetyard_world::{Bounds, Polygon, Workspace};
use serde_json::{Value, json};

use crate::{Origin, Representation, VIEW_FORMAT};

/// The world of a map.
#[derive(Debug, Clone)]
pub struct WorldView {
    /// The world.
    pub world: Workspace,
    /// Operator, parameters and source.
    pub origin: Origin,
}

impl WorldView {
    /// Origin of the world.
    pub fn about(&self) -> Value {
        json!({
            "format": VIEW_FORMAT,
            "representation": Representation::Continuous,
            "origin": self.origin,
            "world_digest": self.world.digest(),
            "obstacles": self.world.obstacles.len(),
        })
    }
}

/// The world of a grid: blocked cells, merged into disjoint rectangles, are the obstacles.
/// `origin_m` is the lower left corner. Masks of moves are no obstacles and are lost: where a map
/// forbids moves, a robot in the plane is free to make them.
///
/// Rectangles grow down from the runs of blocked cells in a row as long as the rows below have
/// the same runs. Takes time linear in the number of cells.
pub fn grid_to_world(
    grid: &Grid,
    cell_m: f64,
    origin_m: [f64; 2],
) -> Result<WorldView, InputError> {
    let (rows, cols) = (grid.rows(), grid.cols());
    let column = |col: u32| origin_m[0] + f64::from(col) * cell_m;
    // The first row is the uppermost.
    let line = |row: u32| origin_m[1] + f64::from(rows - row) * cell_m;
    let bounds = Bounds {
        min: [column(0), line(rows)],
        max: [column(cols), line(0)],
    };
    let far = [bounds.min, bounds.max].into_iter().flatten();
    if !(cell_m > 0.0 && far.fold(0.0, |most: f64, x| most.max(x.abs())) <= Polygon::MOST_M) {
        let reason = format!("a map of {cols} by {rows} cells of {cell_m} m is no world");
        return Err(InputError::new(grid.name(), reason)
            .hint("give the side of a cell in metres, so that the map is at most 1000 km wide"));
    }
    let rectangle = |first: u32, last: u32, (from, to): (u32, u32)| {
        let (left, right) = (column(from), column(to));
        let (bottom, top) = (line(last), line(first));
        Polygon::new(&[[left, bottom], [right, bottom], [right, top], [left, top]]).map_err(
            |error| InputError::new(grid.name(), error.to_string()).hint("give larger cells"),
        )
    };
    let mut obstacles = Vec::new();
    // Runs of the row above with the row in which each began, in order.
    let mut open: Vec<(u32, (u32, u32))> = Vec::new();
    for row in 0..=rows {
        let runs = if row < rows {
            runs(grid, row)
        } else {
            Vec::new()
        };
        let mut next = Vec::with_capacity(runs.len());
        let mut above = open.iter().peekable();
        for run in runs {
            while let Some((begin, old)) = above.next_if(|(_, old)| *old < run) {
                obstacles.push(rectangle(*begin, row, *old)?);
            }
            let same = above.next_if(|(_, old)| *old == run);
            next.push((same.map_or(row, |(begin, _)| *begin), run));
        }
        for (begin, old) in above {
            obstacles.push(rectangle(*begin, row, *old)?);
        }
        open = next;
    }
    let parameters = json!({"cell_m": cell_m, "corner_m": origin_m});
    Ok(WorldView {
        world: Workspace {
            name: grid.name().to_owned(),
            bounds,
            boundary: None,
            obstacles,
            movers: Vec::new(),
        },
        origin: Origin::of_map(grid, "grid-to-world", parameters),
    })
}

/// The runs of blocked cells in a row: first column, and the one after the last.
fn runs(grid: &Grid, row: u32) -> Vec<(u32, u32)> {
    let cols = grid.cols() as usize;
    let letters = &grid.terrain()[row as usize * cols..][..cols];
    let is_blocked = |letter: &u8| !Grid::letter_is_passable(*letter);
    let mut col = 0;
    let runs = letters.chunk_by(|a, b| is_blocked(a) == is_blocked(b));
    runs.filter_map(|run| {
        let from = col;
        col += run.len() as u32;
        is_blocked(&run[0]).then_some((from, col))
    })
    .collect()
}
