//! Static obstacles: solid cells, polygons, and the edge of the workspace.

use fleetyard_core::Grid;
use fleetyard_world::{
    Bounds, BoxIndex, Inside, Polygon, Pose, Shape, Workspace, contacts_in_span,
};

use crate::event::{Change, Other};
use crate::statics::{Statics, report_union};
use crate::track::{Span, Track};

/// All static obstacles.
#[derive(Debug)]
pub(crate) struct Obstacles {
    cells: Option<Cells>,
    parts: Vec<Part>,
    index: BoxIndex,
}

/// Solid cells, and one of them as a shape.
#[derive(Debug)]
struct Cells {
    statics: Statics,
    square: Shape,
}

/// A convex part of a polygon.
#[derive(Debug)]
struct Part {
    polygon: u32,
    pose: Pose,
    shape: Shape,
}

impl Obstacles {
    pub(crate) fn new(
        grid: Option<&Grid>,
        cell_size_m: f64,
        workspace: Option<&Workspace>,
    ) -> Self {
        let cells = grid.and_then(|grid| {
            let polygon = Polygon::rectangle([0.0, 0.0], [cell_size_m, cell_size_m], 0.0).ok()?;
            let (_, square) = polygon.parts().first()?.clone();
            let statics = Statics::new(grid, cell_size_m);
            Some(Cells { statics, square })
        });
        let mut parts = Vec::new();
        if let Some(workspace) = workspace {
            let walls = walls(workspace.bounds);
            for (index, polygon) in workspace.obstacles.iter().enumerate() {
                parts.extend(parts_of(index, polygon.parts()));
            }
            let edge = workspace.obstacles.len();
            for wall in &walls {
                parts.extend(parts_of(edge, wall.parts()));
            }
            if let Some(boundary) = &workspace.boundary {
                parts.extend(parts_of(edge, boundary.outside()));
            }
        }
        let boxes = parts.iter().map(|part| part.shape.bounds(part.pose));
        let index = BoxIndex::new(boxes.collect());
        Self {
            cells,
            parts,
            index,
        }
    }

    /// Finds the begins and ends of a body's overlaps with obstacles, beyond the
    /// tolerance, on its track through a block.
    pub(crate) fn sweep_track(
        &self,
        agent: u32,
        shape: &Shape,
        track: Track<'_>,
        first: bool,
        tolerance_m: f64,
        changes: &mut Vec<Change>,
    ) {
        let radius = shape.effective_radius_m() - tolerance_m;
        let [left, bottom, right, top] = track.bounds();
        if let Some(cells) = &self.cells {
            let (left, right) = (left - radius, right + radius);
            if !cells
                .statics
                .box_is_clear(left, bottom - radius, right, top + radius)
            {
                if shape.is_disc() {
                    cells
                        .statics
                        .sweep_track(agent, track, first, radius, changes);
                } else {
                    cells.sweep(agent, shape, track, first, tolerance_m, changes);
                }
            }
        }
        if self.parts.is_empty() {
            return;
        }
        // With some slack, so that rounding loses nothing that touches.
        let reach = shape.effective_radius_m() * (1.0 + 1e-9);
        let area = Bounds {
            min: [left - reach, bottom - reach],
            max: [right + reach, top + reach],
        };
        let mut near = Vec::new();
        self.index.near(area, &mut near);
        for of_polygon in near.chunk_by(|a, b| self.part(*a).polygon == self.part(*b).polygon) {
            let polygon = self.part(of_polygon[0]).polygon;
            each_span(track, first, |span, from, to, first| {
                let mut met = Vec::new();
                let mut inside = Vec::new();
                for part in of_polygon {
                    let Part {
                        pose, shape: of, ..
                    } = self.part(*part);
                    inside.clear();
                    contacts_in_span(shape, from, to, of, *pose, *pose, tolerance_m, &mut inside);
                    met.extend(inside.iter().map(|inside| (*inside, *part)));
                }
                let other = |_| Other::Polygon(polygon);
                report_union(&mut met, agent, span, first, other, changes);
            });
        }
    }

    fn part(&self, index: u32) -> &Part {
        &self.parts[index as usize]
    }
}

impl Cells {
    /// [`Statics::sweep_track`] for shapes other than discs.
    fn sweep(
        &self,
        agent: u32,
        shape: &Shape,
        track: Track<'_>,
        first: bool,
        tolerance_m: f64,
        changes: &mut Vec<Change>,
    ) {
        let radius = shape.effective_radius_m();
        each_span(track, first, |span, from, to, first| {
            let mut met: Vec<(Inside, u32)> = Vec::new();
            let mut inside = Vec::new();
            let (left, right) = (from.x.min(to.x) - radius, from.x.max(to.x) + radius);
            let (bottom, top) = (from.y.min(to.y) - radius, from.y.max(to.y) + radius);
            self.statics
                .each_solid([left, bottom, right, top], |cell, (x, y)| {
                    inside.clear();
                    let at = Pose::at(x, y);
                    contacts_in_span(
                        shape,
                        from,
                        to,
                        &self.square,
                        at,
                        at,
                        tolerance_m,
                        &mut inside,
                    );
                    met.extend(inside.iter().map(|inside| (*inside, cell)));
                });
            let other = |cell| Other::Obstacle { cell };
            report_union(&mut met, agent, span, first, other, changes);
        });
    }
}

fn parts_of(index: usize, parts: &[(Pose, Shape)]) -> impl Iterator<Item = Part> {
    parts.iter().map(move |(pose, shape)| Part {
        polygon: index as u32,
        pose: *pose,
        shape: shape.clone(),
    })
}

/// Rectangles around a workspace, as thick as it is wide.
fn walls(bounds: Bounds) -> Vec<Polygon> {
    let (width, height) = (bounds.max[0] - bounds.min[0], bounds.max[1] - bounds.min[1]);
    let thick = width.max(height);
    let (x, y) = (
        0.5 * (bounds.min[0] + bounds.max[0]),
        0.5 * (bounds.min[1] + bounds.max[1]),
    );
    let (long, high) = (width + 2.0 * thick, height + 2.0 * thick);
    let (half, rise) = (0.5 * (width + thick), 0.5 * (height + thick));
    [
        ([x - half, y], [thick, high]),
        ([x + half, y], [thick, high]),
        ([x, y - rise], [long, thick]),
        ([x, y + rise], [long, thick]),
    ]
    .into_iter()
    .filter_map(|(center, size)| Polygon::rectangle(center, size, 0.0).ok())
    .collect()
}

fn each_span(track: Track<'_>, first: bool, mut visit: impl FnMut(Span, Pose, Pose, bool)) {
    for at in 1..track.t.len() {
        let span = Span {
            start: track.t[at - 1],
            end: track.t[at],
        };
        visit(span, track.pose(at - 1), track.pose(at), first && at == 1);
    }
}
