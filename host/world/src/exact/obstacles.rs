//! Obstacles: solid cells of a grid, polygons, and the bounds.

use fleetyard_core::{Grid, cell_center_m};

use super::Touched;
use crate::{
    Bounds, BoxIndex, Footprint, Inside, Mover, Polygon, Pose, Relative, Shape, Workspace,
    contacts_in_span,
};

/// Everything that robots must not touch, besides each other. Borrows; cheap to make but for an
/// index over the polygons.
#[derive(Debug, Clone, Default)]
pub struct Obstacles<'a> {
    cells: Option<Cells<'a>>,
    workspace: Option<&'a Workspace>,
    bounds: Option<Bounds>,
    /// Convex parts of all polygons, as polygon and part.
    parts: Vec<(u32, u32)>,
    index: BoxIndex,
}

#[derive(Debug, Clone)]
struct Cells<'a> {
    grid: &'a Grid,
    size_m: f64,
    /// A cell around its centre.
    shape: Shape,
}

/// Parts of what is outside of a boundary have this in place of a polygon.
const BEYOND: u32 = u32::MAX;

/// An overlap of a body with a part of what it touches.
#[derive(Debug, Clone, Copy)]
pub(super) struct Hit {
    pub(super) touched: Touched,
    pub(super) inside: Inside,
}

impl<'a> Obstacles<'a> {
    /// Nothing at all.
    pub fn none() -> Self {
        Self::default()
    }

    /// The solid cells of a map whose lower left corner is the origin, with cells
    /// of `size_m` metres. `None` if a robot could not be as small as a cell.
    pub fn cells(grid: &'a Grid, size_m: f64) -> Option<Self> {
        let (length_m, width_m) = (size_m, size_m);
        let shape = Footprint::Rectangle { length_m, width_m }.shape().ok()?;
        let cells = Some(Cells {
            grid,
            size_m,
            shape,
        });
        Some(Self {
            cells,
            ..Self::default()
        })
    }

    /// The obstacles, movers and bounds of a workspace.
    pub fn workspace(workspace: &'a Workspace) -> Self {
        Self::default().with_workspace(workspace)
    }

    /// Also the obstacles, movers and bounds of a workspace.
    #[must_use]
    pub fn with_workspace(self, workspace: &'a Workspace) -> Self {
        let obstacles = workspace.obstacles.iter().map(Polygon::parts).zip(0..);
        let beyond = workspace.boundary.iter();
        let beyond = beyond.map(|boundary| (boundary.outside(), BEYOND));
        let (mut numbers, mut boxes) = (Vec::new(), Vec::new());
        for (parts, polygon) in obstacles.chain(beyond) {
            for (part, (at, shape)) in (0..).zip(parts) {
                numbers.push((polygon, part));
                boxes.push(shape.bounds(*at));
            }
        }
        Self {
            workspace: Some(workspace),
            bounds: Some(workspace.bounds),
            parts: numbers,
            index: BoxIndex::new(boxes),
            ..self
        }
    }

    /// Also the outside of a box.
    #[must_use]
    pub fn within(self, bounds: Bounds) -> Self {
        Self {
            bounds: Some(bounds),
            ..self
        }
    }

    pub(super) fn movers(&self) -> &'a [Mover] {
        self.workspace.map_or(&[], |workspace| &workspace.movers)
    }

    /// Appends all overlaps of a body in a span, in no order.
    pub(super) fn meet(
        &self,
        shape: &Shape,
        from: Pose,
        to: Pose,
        tolerance_m: f64,
        scratch: &mut Scratch,
    ) {
        // With some slack, so that rounding loses nothing that touches.
        let reach = shape.effective_radius_m() * (1.0 + 1e-9);
        let area = Bounds {
            min: [from.x.min(to.x) - reach, from.y.min(to.y) - reach],
            max: [from.x.max(to.x) + reach, from.y.max(to.y) + reach],
        };
        if let Some(cells) = &self.cells {
            cells.meet(shape, from, to, area, tolerance_m, scratch);
        }
        if let Some(workspace) = self.workspace {
            let mut near = std::mem::take(&mut scratch.near);
            self.index.near(area, &mut near);
            for part in near.drain(..) {
                let (polygon, part) = self.parts[part as usize];
                let (parts, touched) = match &workspace.boundary {
                    Some(boundary) if polygon == BEYOND => (boundary.outside(), Touched::Outside),
                    _ => {
                        let obstacle = &workspace.obstacles[polygon as usize];
                        (obstacle.parts(), Touched::Polygon(polygon))
                    }
                };
                let (at, solid) = &parts[part as usize];
                scratch.meet(shape, [from, to], solid, *at, tolerance_m, touched);
            }
            scratch.near = near;
        }
        if let Some(bounds) = self.bounds
            && !(bounds.contains(area.min) && bounds.contains(area.max))
        {
            leave(bounds, shape, from, to, area, tolerance_m, scratch);
        }
    }
}

/// Buffers.
#[derive(Debug, Default)]
pub(super) struct Scratch {
    pub(super) hits: Vec<Hit>,
    near: Vec<u32>,
    pub(super) found: Vec<Inside>,
}

impl Scratch {
    /// Appends the overlaps of a body in a span with something that stands.
    fn meet(
        &mut self,
        shape: &Shape,
        [from, to]: [Pose; 2],
        solid: &Shape,
        at: Pose,
        tolerance_m: f64,
        touched: Touched,
    ) {
        let Self { hits, found, .. } = self;
        found.clear();
        contacts_in_span(shape, from, to, solid, at, at, tolerance_m, found);
        hits.extend(found.drain(..).map(|inside| Hit { touched, inside }));
    }
}

impl Cells<'_> {
    fn meet(
        &self,
        shape: &Shape,
        from: Pose,
        to: Pose,
        area: Bounds,
        tolerance_m: f64,
        scratch: &mut Scratch,
    ) {
        let (rows, cols) = (self.grid.rows(), self.grid.cols());
        let index = |value: f64, count: u32| {
            (value / self.size_m)
                .floor()
                .clamp(0.0, f64::from(count - 1)) as u32
        };
        let (left, right) = (index(area.min[0], cols), index(area.max[0], cols));
        let (low, high) = (index(area.min[1], rows), index(area.max[1], rows));
        let radius = (shape.effective_radius_m() - tolerance_m).max(0.0);
        for row in rows - 1 - high..=rows - 1 - low {
            for cell in row * cols + left..=row * cols + right {
                if self.grid.is_passable(cell) {
                    continue;
                }
                let (x, y) = cell_center_m(self.grid, self.size_m, cell);
                let (at, touched) = (Pose::at(x, y), Touched::Cell(cell));
                if shape.is_disc() {
                    let way = Relative::between([at, at], [from, to]);
                    let inside = way.inside_square(0.5 * self.size_m, radius);
                    let hit = inside.map(|inside| Hit { touched, inside });
                    scratch.hits.extend(hit);
                    continue;
                }
                scratch.meet(shape, [from, to], &self.shape, at, tolerance_m, touched);
            }
        }
    }
}

/// When a body reaches over the bounds: into one of four walls, thick enough
/// for the whole span.
fn leave(
    bounds: Bounds,
    shape: &Shape,
    from: Pose,
    to: Pose,
    area: Bounds,
    tolerance_m: f64,
    scratch: &mut Scratch,
) {
    let far = 4.0 * shape.effective_radius_m() + 1.0;
    let left = area.min[0].min(bounds.min[0]) - far;
    let bottom = area.min[1].min(bounds.min[1]) - far;
    let right = area.max[0].max(bounds.max[0]) + far;
    let top = area.max[1].max(bounds.max[1]) + far;
    let walls = [
        (
            area.min[0] < bounds.min[0],
            [left, bottom],
            [bounds.min[0], top],
        ),
        (
            area.min[1] < bounds.min[1],
            [left, bottom],
            [right, bounds.min[1]],
        ),
        (
            area.max[0] > bounds.max[0],
            [bounds.max[0], bottom],
            [right, top],
        ),
        (
            area.max[1] > bounds.max[1],
            [left, bounds.max[1]],
            [right, top],
        ),
    ];
    for (is_near, min, max) in walls {
        if !is_near {
            continue;
        }
        let at = Pose::at(0.5 * (min[0] + max[0]), 0.5 * (min[1] + max[1]));
        let (x, y) = (max[0] - at.x, max[1] - at.y);
        let corners = [[x, y], [-x, y], [-x, -y], [x, -y]];
        let Some(wall) = Shape::around(&corners, [0.0, 0.0]) else {
            continue;
        };
        scratch.meet(shape, [from, to], &wall, at, tolerance_m, Touched::Outside);
    }
}
