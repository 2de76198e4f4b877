//! World to grid: cells that hold the largest robot's disc, blocked where obstacles cover them.

use std::sync::Arc;

use fleetyard_core::json::with_hint;
use fleetyard_core::{Connectivity, Grid, GridInstance, InputError, Separation};
use fleetyard_world::{Boundary, Bounds, Polygon, Pose, Shape, Workspace};
use serde::de::Deserializer;
use serde::ser::Serializer;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use crate::frame::Frame;
use crate::origin::WORLD_TO_GRID;
use crate::{FREE_SLACK_M, Origin, Problem, Representation, State, VIEW_FORMAT};

/// Parameters of a grid view, in files by the names that the command line gives them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GridSpec {
    /// Moves: four neighbours or eight.
    #[serde(serialize_with = "degree", deserialize_with = "neighbors")]
    pub connectivity: Connectivity,
    /// The side of a cell follows from it.
    pub separation: Separation,
}

impl Default for GridSpec {
    fn default() -> Self {
        Self {
            connectivity: Connectivity::Four,
            separation: Separation::default(),
        }
    }
}

#[expect(
    clippy::trivially_copy_pass_by_ref,
    reason = "serde calls it with a reference"
)]
fn degree<S: Serializer>(connectivity: &Connectivity, serializer: S) -> Result<S::Ok, S::Error> {
    connectivity.degree().serialize(serializer)
}

/// Reads moves of a grid by their number.
pub(crate) fn neighbors<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<Connectivity, D::Error> {
    let degree = u32::deserialize(deserializer)?;
    let all = [Connectivity::Four, Connectivity::Eight];
    let found = all.into_iter().find(|moves| moves.degree() == degree);
    found.ok_or_else(|| {
        let reason = format!("a cell with {degree} neighbours");
        with_hint(&reason, Some("grids have 4 or 8 neighbours"))
    })
}

/// A task on a grid.
#[derive(Debug, Clone)]
pub struct GridView {
    /// Cells, starts and goals.
    pub instance: GridInstance,
    /// Moves and separation.
    pub spec: GridSpec,
    /// r_com: discs of this radius are planned for, in metres.
    pub radius_m: f64,
    /// The side of a cell in metres.
    pub cell_m: f64,
    /// The lower left corner of the grid in the world, in metres.
    pub corner_m: [f64; 2],
    /// Per agent, how far start and goal are from the centres of their cells, in metres.
    pub snapped_m: Vec<[f64; 2]>,
    /// Operator, parameters and sources.
    pub origin: Origin,
}

impl GridView {
    /// Origin of the view, and its starts and goals as cells.
    pub fn about(&self) -> Value {
        json!({
            "format": VIEW_FORMAT,
            "representation": Representation::Grid,
            "origin": self.origin,
            "instance_digest": self.instance.digest(),
            "cell_m": self.cell_m,
            "corner_m": self.corner_m,
            "starts": self.instance.starts(),
            "goals": self.instance.goals(),
            "snapped_m": self.snapped_m,
        })
    }
}

/// The side of a cell: 2·L·r for moves of at most L cells, and at least 2√2·r where robots keep
/// 2r from each other. With eight neighbours L = √2, and both are the same.
pub fn cell_side_m(spec: GridSpec, radius_m: f64) -> f64 {
    match (spec.connectivity, spec.separation) {
        (Connectivity::Four, Separation::Rules) => 2.0 * radius_m,
        _ => 2.0 * core::f64::consts::SQRT_2 * radius_m,
    }
}

/// The cells of a world, without starts and goals.
#[derive(Debug, Clone)]
pub struct WorldCells {
    /// The map, called as the world is.
    pub grid: Arc<Grid>,
    /// Moves and separation.
    pub spec: GridSpec,
    /// The radius of the discs that the cells are made for, in metres.
    pub radius_m: f64,
    /// The side of a cell in metres.
    pub cell_m: f64,
    /// The lower left corner of the grid in the world, in metres.
    pub corner_m: [f64; 2],
    frame: Frame,
}

impl WorldCells {
    /// The cells of a world for discs of a radius, which [`world_to_grid`] describes. `source` is named
    /// in errors.
    pub fn new(
        world: &Workspace,
        radius_m: f64,
        spec: GridSpec,
        source: &str,
    ) -> Result<Self, InputError> {
        let cell_m = cell_side_m(spec, radius_m);
        let Workspace {
            bounds, boundary, ..
        } = world;
        let frame = Frame::over(bounds, cell_m, source)?;
        let mut raster = Raster {
            frame,
            letters: vec![b'.'; frame.cells()],
        };
        raster.overhang(bounds, radius_m);
        let solid = world.obstacles.iter().flat_map(Polygon::parts);
        let outside = boundary.iter().flat_map(Boundary::outside);
        for (pose, shape) in solid {
            raster.block(*pose, shape, None);
        }
        for (pose, shape) in outside {
            raster.block(*pose, shape, Some(*bounds));
        }
        let grid = Grid::new(world.name.as_str(), frame.rows, frame.cols, raster.letters)?;
        Ok(Self {
            grid: Arc::new(grid),
            spec,
            radius_m,
            cell_m,
            corner_m: bounds.min,
            frame,
        })
    }

    /// The grid view of a problem in this world, with its starts and goals in the cells that contain
    /// them. The cells have to be made for discs of the problem's r_com.
    pub fn view(&self, problem: &Problem) -> Result<GridView, InputError> {
        let Self {
            grid,
            spec,
            radius_m,
            cell_m,
            corner_m,
            frame,
        } = self;
        let source = problem.task.source.as_str();
        let agents = &problem.task.agents;
        let mut snapped_m = vec![[0.0; 2]; agents.len()];
        let mut cells = [Vec::new(), Vec::new()];
        for (side, what) in ["start", "goal"].into_iter().enumerate() {
            let mut owner = std::collections::BTreeMap::new();
            for (number, agent) in agents.iter().enumerate() {
                let state = [agent.start, agent.goal][side];
                let (cell, distance) = frame.snap(state.at_m());
                snapped_m[number][side] = distance;
                let fault = |reason: String| Err(InputError::new(source, reason));
                let (row, col) = grid.row_col(cell);
                if !grid.is_passable(cell) {
                    return fault(format!(
                        "the {what} of agent {number} snaps {distance:.3} m to the cell at row {row}, \
                         column {col}, which is blocked"
                    ))
                    .map_err(|error| error.hint(self.way_out(state)));
                }
                if let Some(first) = owner.insert(cell, number) {
                    let other: f64 = snapped_m[first][side];
                    return fault(format!(
                        "the {what}s of agents {first} and {number} snap {other:.3} m and \
                         {distance:.3} m to one cell, at row {row}, column {col}"
                    ))
                    .map_err(|error| {
                        error.hint(format!(
                            "move one of them by up to {cell_m:.3} m, a cell's side"
                        ))
                    });
                }
                cells[side].push(cell);
            }
        }
        let [starts, goals] = cells;
        let instance = GridInstance::new(Arc::clone(grid), spec.connectivity, starts, goals);
        let instance = instance.map_err(|error| {
            InputError::new(source, error.to_string()).hint(
                "on this grid the way is closed: passages narrower than two cells may hold no free \
                 cell; use a roadmap, smaller robots or wider passages",
            )
        })?;
        let parameters = json!({
            "neighbors": spec.connectivity.degree(),
            "separation": spec.separation,
            "cell_m": cell_m,
            "r_com_m": radius_m,
        });
        let origin = Origin::of(problem, WORLD_TO_GRID, parameters, None);
        Ok(GridView {
            instance,
            spec: *spec,
            radius_m: *radius_m,
            cell_m: *cell_m,
            corner_m: *corner_m,
            snapped_m,
            origin,
        })
    }

    /// A hint that names the nearest free cell.
    fn way_out(&self, state: State) -> String {
        let free = (0..self.grid.cell_count()).filter(|cell| self.grid.is_passable(*cell));
        let far = |cell: &u32| {
            let [x, y] = self.frame.center_m(*cell);
            let (x, y) = (x - state.x_m, y - state.y_m);
            x * x + y * y
        };
        match free.min_by(|a, b| far(a).total_cmp(&far(b))) {
            Some(cell) => {
                let ([x, y], distance) = (self.frame.center_m(cell), far(&cell).sqrt());
                format!("the nearest free cell is {distance:.3} m away, around ({x:.3}, {y:.3})")
            }
            None => "no cell is free: the robots are too large for this world on a grid".to_owned(),
        }
    }
}

/// The grid of a problem's world, with its starts and goals in the cells that contain them.
///
/// A cell is blocked if an obstacle, or what is outside of the world's boundary, reaches into it
/// by more than a nanometre. Cells that overhang the box around the world are free where that
/// box contains the disc in their middle. Movers are left out.
pub fn world_to_grid(problem: &Problem, spec: GridSpec) -> Result<GridView, InputError> {
    let (world, source) = (&problem.world, problem.task.source.as_str());
    let cells = WorldCells::new(world, problem.common_radius_m(), spec, source)?;
    cells.view(problem)
}

struct Raster {
    frame: Frame,
    /// Row by row from the uppermost.
    letters: Vec<u8>,
}

impl Raster {
    fn letter(&mut self, up: u32, col: u32) -> &mut u8 {
        &mut self.letters[self.frame.cell(up, col) as usize]
    }

    /// Blocks the cells beyond the bounds whose disc is not within them.
    fn overhang(&mut self, bounds: &Bounds, radius_m: f64) {
        let Frame {
            corner_m,
            cell_m,
            cols,
            rows,
        } = self.frame;
        let beyond = |axis: usize, number: u32| {
            let middle = corner_m[axis] + (f64::from(number) + 0.5) * cell_m;
            middle + radius_m > bounds.max[axis] + FREE_SLACK_M
        };
        let (last_col, last_up) = (cols - 1, rows - 1);
        let (right, top) = (beyond(0, last_col), beyond(1, last_up));
        for up in 0..rows {
            for col in 0..cols {
                if (right && col == last_col) || (top && up == last_up) {
                    *self.letter(up, col) = b'@';
                }
            }
        }
    }

    /// Blocks the cells into which a convex shape reaches, row by row: what of the shape is in a
    /// row is convex too, so that it reaches into all cells between its ends and no other.
    fn block(&mut self, pose: Pose, shape: &Shape, within: Option<Bounds>) {
        let mut outline: Vec<[f64; 2]> = shape.corners(pose).collect();
        if let Some(Bounds { min, max }) = within {
            for axis in 0..2 {
                outline = clip(&outline, axis, min[axis], 1.0);
                outline = clip(&outline, axis, max[axis], -1.0);
            }
        }
        let Some((low, high)) = extent(&outline, 1) else {
            return;
        };
        let Frame {
            corner_m: corner,
            cell_m: side,
            cols,
            rows,
        } = self.frame;
        let slack = FREE_SLACK_M;
        let at = |axis: usize, value: f64| (value - corner[axis]) / side;
        let most = [cols, rows];
        let range = |axis: usize, low: f64, high: f64| {
            let first = at(axis, low + slack).floor().max(0.0) as u32;
            let last = at(axis, high - slack).floor();
            let reaches = high - low > 2.0 * slack && last >= 0.0;
            first..if reaches {
                (last as u32 + 1).min(most[axis])
            } else {
                0
            }
        };
        for up in range(1, low, high) {
            let bottom = corner[1] + f64::from(up) * side;
            let strip = clip(&outline, 1, bottom + slack, 1.0);
            let strip = clip(&strip, 1, bottom + side - slack, -1.0);
            if let Some((left, right)) = extent(&strip, 0) {
                for col in range(0, left, right) {
                    *self.letter(up, col) = b'@';
                }
            }
        }
    }
}

/// The part of a convex outline on one side of a line along an axis: above it for a sign of 1.
fn clip(outline: &[[f64; 2]], axis: usize, at: f64, sign: f64) -> Vec<[f64; 2]> {
    let above = |point: [f64; 2]| sign * (point[axis] - at);
    let mut kept = Vec::with_capacity(outline.len() + 1);
    let ends = outline.iter().cycle().skip(1);
    for (from, to) in outline.iter().zip(ends) {
        let (a, b) = (above(*from), above(*to));
        if a >= 0.0 {
            kept.push(*from);
        }
        if (a > 0.0 && b < 0.0) || (a < 0.0 && b > 0.0) {
            let share = a / (a - b);
            let other = 1 - axis;
            let mut point = [at; 2];
            point[other] = from[other] + share * (to[other] - from[other]);
            kept.push(point);
        }
    }
    kept
}

/// The least and the largest coordinate, if there are any.
fn extent(outline: &[[f64; 2]], axis: usize) -> Option<(f64, f64)> {
    let mut numbers = outline.iter().map(|point| point[axis]);
    let first = numbers.next()?;
    Some(numbers.fold((first, first), |(low, high), number| {
        (low.min(number), high.max(number))
    }))
}
