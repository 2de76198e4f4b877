//! The map under the agents.

use fleetyard_core::{Grid, Roadmap};
use fleetyard_sim::trace::{self, Header};
use fleetyard_world::{Bounds, Polygon, Workspace};

/// The solid cells of a grid whose lower left corner is the world's origin.
#[derive(Debug, Clone, PartialEq)]
pub struct Cells {
    pub(crate) rows: u32,
    pub(crate) side_m: f64,
    /// Disjoint; row and column of the upper left cell, rows and columns. The
    /// first row is the uppermost.
    pub(crate) rectangles: Vec<[u32; 4]>,
}

/// A map as far as it can be seen.
#[derive(Debug, Clone, PartialEq)]
pub struct World {
    /// Name, shown as a title.
    pub name: String,
    /// The area that a picture has to show.
    pub bounds: Bounds,
    /// The cells of a grid map.
    pub cells: Option<Cells>,
    /// Polygonal obstacles.
    pub polygons: Vec<Vec<[f64; 2]>>,
    /// The edge of the world where it is no rectangle; empty if it is one.
    pub outline: Vec<[f64; 2]>,
    /// Edges of a roadmap.
    pub roadmap: Vec<[[f64; 2]; 2]>,
}

impl World {
    /// A grid map with cells of the given side.
    pub fn of_grid(grid: &Grid, side_m: f64) -> Self {
        let rows = grid.terrain().chunks(grid.cols() as usize).zip(0..);
        let runs = rows.flat_map(|(letters, row)| {
            let mut col = 0;
            let solid = |letter: &u8| !Grid::letter_is_passable(*letter);
            let runs = letters.chunk_by(move |a, b| solid(a) == solid(b));
            runs.filter_map(move |run| {
                let (start, length) = (col, run.len() as u32);
                col += length;
                solid(&run[0]).then_some((row, start, length))
            })
        });
        let side = |cells: u32| f64::from(cells) * side_m;
        Self {
            name: grid.name().to_owned(),
            bounds: Bounds {
                min: [0.0, 0.0],
                max: [side(grid.cols()), side(grid.rows())],
            },
            cells: Some(Cells::of_runs(grid.rows(), side_m, runs)),
            polygons: Vec::new(),
            outline: Vec::new(),
            roadmap: Vec::new(),
        }
    }

    /// The map as a trace has it. Traces do not name it.
    pub fn of_trace(name: impl Into<String>, header: &Header) -> Self {
        let bounds = header.bounds_m;
        let cells = header.scene.cells.as_ref();
        Self {
            name: name.into(),
            bounds: Bounds {
                min: [bounds.min_x, bounds.min_y],
                max: [bounds.max_x, bounds.max_y],
            },
            cells: cells.map(Cells::of_trace),
            polygons: header.scene.polygons_m.clone(),
            outline: header.scene.outline_m.clone(),
            roadmap: header.scene.roadmap_m.clone(),
        }
    }

    /// A workspace; what moves in it is left to who knows the time.
    pub fn of_workspace(workspace: &Workspace) -> Self {
        let polygons = workspace.obstacles.iter().map(Polygon::vertices);
        Self {
            name: workspace.name.clone(),
            bounds: workspace.bounds,
            cells: None,
            polygons: polygons.map(<[_]>::to_vec).collect(),
            outline: workspace
                .boundary
                .as_ref()
                .map_or_else(Vec::new, |edge| edge.polygon().vertices().to_vec()),
            roadmap: Vec::new(),
        }
    }

    /// Adds the obstacles and the edge of a workspace.
    #[must_use]
    pub fn workspace(mut self, workspace: &Workspace) -> Self {
        let Self {
            bounds,
            polygons,
            outline,
            ..
        } = Self::of_workspace(workspace);
        self.bounds = Bounds::of(&[self.bounds.min, self.bounds.max, bounds.min, bounds.max]);
        (self.polygons, self.outline) = (polygons, outline);
        self
    }

    /// Adds the edges of a roadmap.
    #[must_use]
    pub fn roadmap(mut self, roadmap: &Roadmap) -> Self {
        self.roadmap = roadmap.lines().collect();
        self
    }

    /// Width and height.
    pub(crate) fn size_m(&self) -> [f64; 2] {
        let Bounds { min, max } = self.bounds;
        [max[0] - min[0], max[1] - min[1]]
    }
}

impl Cells {
    /// The same cells as a trace has them.
    pub fn of_trace(cells: &trace::Cells) -> Self {
        Self::of_runs(cells.rows(), cells.cell_size_m(), cells.in_rows())
    }

    /// Solid cells from the runs of them within rows: row, first column and
    /// length, ordered by row and column and not touching each other.
    pub fn of_runs(
        rows: u32,
        side_m: f64,
        runs: impl IntoIterator<Item = (u32, u32, u32)>,
    ) -> Self {
        let mut rectangles: Vec<[u32; 4]> = Vec::new();
        // A run grows a rectangle that ends above it with the same columns. Those
        // of the row above and of this row, in order, and how many of the former
        // are to the left of the run.
        let (mut above, mut here, mut passed) = (Vec::<usize>::new(), Vec::<usize>::new(), 0);
        let mut current = 0;
        for (row, start, length) in runs {
            if row != current {
                above.clear();
                if row == current + 1 {
                    std::mem::swap(&mut above, &mut here);
                }
                here.clear();
                (current, passed) = (row, 0);
            }
            while above
                .get(passed)
                .is_some_and(|at| rectangles[*at][1] < start)
            {
                passed += 1;
            }
            let same = |at: &usize| rectangles[*at][1] == start && rectangles[*at][3] == length;
            if let Some(at) = above.get(passed).copied().filter(same) {
                rectangles[at][2] += 1;
                here.push(at);
            } else {
                here.push(rectangles.len());
                rectangles.push([row, start, 1, length]);
            }
        }
        Self {
            rows,
            side_m,
            rectangles,
        }
    }
}

/// The exponent of the largest power of ten that is not above a value, between
/// -12 and 12.
pub(crate) fn floor_exponent(value: f64) -> i32 {
    let fits = |exponent: &i32| 10f64.powi(*exponent) <= value;
    (-12..=12).rev().find(fits).unwrap_or(-12)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rectangles_cover_the_solid_cells_once() {
        let maps: [&[&str]; 6] = [
            &["@@.", "@@.", "..@"],
            &["@@@", "@.@", "@@@"],
            &["@.@.@", "@@@.@", "@.@.@", "@.@.@"],
            &["...", "..."],
            &[".@@.", "@@@.", ".@@.", ".@@@"],
            &["@@", "..", "@@"],
        ];
        for map in maps {
            let (rows, cols) = (map.len() as u32, map[0].len() as u32);
            let grid = Grid::new("map", rows, cols, map.concat().into_bytes()).unwrap();
            let mut covered = vec![0; grid.cell_count() as usize];
            for [row, col, down, across] in rectangles(&grid) {
                for cell in
                    (row..row + down).flat_map(|r| (col..col + across).map(move |c| r * cols + c))
                {
                    covered[cell as usize] += 1;
                }
            }
            let passable = (0..grid.cell_count()).map(|cell| grid.is_passable(cell));
            let expected: Vec<i32> = passable.map(|passable| i32::from(!passable)).collect();
            assert_eq!(covered, expected, "{map:?}");
        }
        let grid = Grid::new("map", 3, 3, maps[0].concat().into_bytes()).unwrap();
        assert_eq!(rectangles(&grid), [[0, 0, 2, 2], [2, 2, 1, 1]]);
    }

    fn rectangles(grid: &Grid) -> Vec<[u32; 4]> {
        World::of_grid(grid, 1.0).cells.unwrap().rectangles
    }
}
