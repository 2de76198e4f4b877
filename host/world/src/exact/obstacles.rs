//! Obstacles: solid cells of a grid, polygons, and the bounds.

use fleetyard_core::{Grid, cell_center_m};

use super::Touched;
use crate::{
    Bounds, Footprint, Inside, Mover, Polygon, Pose, Relative, Shape, Workspace, contacts_in_span,
};

/// Everything that robots must not touch, besides each other. Borrows; cheap to make but for an
/// index over the polygons.
#[derive(Debug, Clone, Default)]
pub struct Obstacles<'a> {
    cells: Option<Cells<'a>>,
    workspace: Option<&'a Workspace>,
    bounds: Option<Bounds>,
    index: Index,
}

#[derive(Debug, Clone)]
struct Cells<'a> {
    grid: &'a Grid,
    size_m: f64,
    /// A cell around its centre.
    shape: Shape,
}

/// A uniform grid of bins over the convex parts of all polygons.
#[derive(Debug, Clone, Default)]
struct Index {
    /// Polygon and part.
    parts: Vec<(u32, u32)>,
    boxes: Vec<Bounds>,
    origin: [f64; 2],
    side: f64,
    cols: usize,
    rows: usize,
    starts: Vec<u32>,
    entries: Vec<u32>,
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
        Self {
            workspace: Some(workspace),
            bounds: Some(workspace.bounds),
            index: Index::new(workspace),
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
            self.index.near(area, &mut scratch.near);
            for part in scratch.near.drain(..) {
                let (polygon, part) = self.index.parts[part as usize];
                let (parts, touched) = match &workspace.boundary {
                    Some(boundary) if polygon == BEYOND => (boundary.outside(), Touched::Outside),
                    _ => {
                        let obstacle = &workspace.obstacles[polygon as usize];
                        (obstacle.parts(), Touched::Polygon(polygon))
                    }
                };
                let (at, solid) = &parts[part as usize];
                scratch.found.clear();
                contacts_in_span(
                    shape,
                    from,
                    to,
                    solid,
                    *at,
                    *at,
                    tolerance_m,
                    &mut scratch.found,
                );
                let hits = scratch.found.iter();
                let hits = hits.map(|inside| Hit {
                    touched,
                    inside: *inside,
                });
                scratch.hits.extend(hits);
            }
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
                let touched = Touched::Cell(cell);
                if shape.is_disc() {
                    let way = Relative {
                        x0: from.x - x,
                        y0: from.y - y,
                        x1: to.x - x,
                        y1: to.y - y,
                    };
                    let inside = way.inside_square(0.5 * self.size_m, radius);
                    let hit = inside.map(|inside| Hit { touched, inside });
                    scratch.hits.extend(hit);
                    continue;
                }
                let at = Pose::at(x, y);
                scratch.found.clear();
                contacts_in_span(
                    shape,
                    from,
                    to,
                    &self.shape,
                    at,
                    at,
                    tolerance_m,
                    &mut scratch.found,
                );
                let hits = scratch.found.iter();
                let hits = hits.map(|inside| Hit {
                    touched,
                    inside: *inside,
                });
                scratch.hits.extend(hits);
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
        scratch.found.clear();
        contacts_in_span(
            shape,
            from,
            to,
            &wall,
            at,
            at,
            tolerance_m,
            &mut scratch.found,
        );
        let touched = Touched::Outside;
        let hits = scratch.found.iter();
        let hits = hits.map(|inside| Hit {
            touched,
            inside: *inside,
        });
        scratch.hits.extend(hits);
    }
}

impl Index {
    fn new(workspace: &Workspace) -> Self {
        let mut index = Self::default();
        let obstacles = workspace.obstacles.iter().map(Polygon::parts).zip(0..);
        let beyond = workspace.boundary.iter();
        let beyond = beyond.map(|boundary| (boundary.outside(), BEYOND));
        for (parts, polygon) in obstacles.chain(beyond) {
            for (part, (at, shape)) in parts.iter().enumerate() {
                let corners = shape.vertices().iter();
                let corners: Vec<[f64; 2]> = corners.map(|vertex| at.apply(*vertex)).collect();
                index.parts.push((polygon, part as u32));
                index.boxes.push(Bounds::of(&corners));
            }
        }
        let Some(first) = index.boxes.first() else {
            return index;
        };
        let (mut whole, mut extent) = (*first, 0.0);
        for bounds in &index.boxes {
            let (width, height) = (bounds.max[0] - bounds.min[0], bounds.max[1] - bounds.min[1]);
            extent += 0.5 * (width + height);
            whole = Bounds {
                min: [
                    whole.min[0].min(bounds.min[0]),
                    whole.min[1].min(bounds.min[1]),
                ],
                max: [
                    whole.max[0].max(bounds.max[0]),
                    whole.max[1].max(bounds.max[1]),
                ],
            };
        }
        // Bins as large as the mean box, but not many more than there are boxes.
        let count = index.boxes.len() as f64;
        let (width, height) = (whole.max[0] - whole.min[0], whole.max[1] - whole.min[1]);
        let fewest = (width.max(height) / 1024.0).max((width * height / (4.0 * count)).sqrt());
        index.side = (extent / count).max(fewest);
        index.origin = whole.min;
        index.cols = (width / index.side) as usize + 1;
        index.rows = (height / index.side) as usize + 1;
        let mut lists = vec![Vec::new(); index.cols * index.rows];
        for (part, bounds) in index.boxes.iter().enumerate() {
            index.each_bin(*bounds, |bin| lists[bin].push(part as u32));
        }
        index.starts.push(0);
        for list in lists {
            index.entries.extend(list);
            index.starts.push(index.entries.len() as u32);
        }
        index
    }

    fn each_bin(&self, area: Bounds, mut visit: impl FnMut(usize)) {
        let bin = |value: f64, origin: f64, count: usize| {
            ((value - origin) / self.side).clamp(0.0, (count - 1) as f64) as usize
        };
        let columns = bin(area.min[0], self.origin[0], self.cols)
            ..=bin(area.max[0], self.origin[0], self.cols);
        let rows = bin(area.min[1], self.origin[1], self.rows)
            ..=bin(area.max[1], self.origin[1], self.rows);
        for row in rows {
            for col in columns.clone() {
                visit(row * self.cols + col);
            }
        }
    }

    /// The parts whose boxes overlap an area, each once, in order.
    fn near(&self, area: Bounds, out: &mut Vec<u32>) {
        if self.boxes.is_empty() {
            return;
        }
        self.each_bin(area, |bin| {
            let entries = self.starts[bin] as usize..self.starts[bin + 1] as usize;
            out.extend(self.entries[entries].iter().copied().filter(|part| {
                let bounds = &self.boxes[*part as usize];
                (0..2).all(|axis| {
                    area.min[axis] <= bounds.max[axis] && bounds.min[axis] <= area.max[axis]
                })
            }));
        });
        out.sort_unstable();
        out.dedup();
    }
}
