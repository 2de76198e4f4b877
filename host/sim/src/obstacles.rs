//! Static obstacles: solid cells, polygons, and the edge of the workspace.

use fleetyard_core::Grid;
use fleetyard_world::{Bounds, Inside, Polygon, Pose, Shape, Workspace, contacts_in_span};

use crate::chunk::{Span, Track};
use crate::event::{Change, Other};
use crate::statics::{Statics, report_union};

/// All static obstacles.
#[derive(Debug)]
pub(crate) struct Obstacles {
    cells: Option<Cells>,
    parts: Vec<Part>,
    bins: Bins,
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
        let bins = Bins::new(&parts);
        Self { cells, parts, bins }
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
        let around = [left - radius, bottom - radius, right + radius, top + radius];
        if let Some(cells) = &self.cells {
            let [left, bottom, right, top] = around;
            if !cells.statics.box_is_clear(left, bottom, right, top) {
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
        let near = self.bins.find(around);
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

/// Parts by place: a uniform grid over their bounding boxes.
#[derive(Debug, Default)]
struct Bins {
    left: f64,
    bottom: f64,
    side: f64,
    cols: usize,
    rows: usize,
    starts: Vec<u32>,
    parts: Vec<u32>,
}

impl Bins {
    fn new(parts: &[Part]) -> Self {
        let boxes: Vec<[f64; 4]> = parts
            .iter()
            .map(|part| {
                let corners = part.shape.vertices().iter().map(|v| part.pose.apply(*v));
                corners.fold(
                    [
                        f64::INFINITY,
                        f64::INFINITY,
                        f64::NEG_INFINITY,
                        f64::NEG_INFINITY,
                    ],
                    |[left, bottom, right, top], [x, y]| {
                        [left.min(x), bottom.min(y), right.max(x), top.max(y)]
                    },
                )
            })
            .collect();
        let Some(whole) = boxes.iter().copied().reduce(|a, b| {
            [
                a[0].min(b[0]),
                a[1].min(b[1]),
                a[2].max(b[2]),
                a[3].max(b[3]),
            ]
        }) else {
            return Self::default();
        };
        // About two bins per part, in a square grid.
        let (width, height) = (whole[2] - whole[0], whole[3] - whole[1]);
        let side = (width * height / (2 * parts.len()) as f64).sqrt();
        let mut bins = Self {
            left: whole[0],
            bottom: whole[1],
            side,
            cols: ((width / side) as usize + 1).min(1 << 12),
            rows: ((height / side) as usize + 1).min(1 << 12),
            ..Self::default()
        };
        let mut entries: Vec<(u32, u32)> = Vec::new();
        for (part, bounds) in boxes.iter().enumerate() {
            bins.each(*bounds, |bin| entries.push((bin as u32, part as u32)));
        }
        entries.sort_unstable();
        bins.starts = vec![0; bins.rows * bins.cols + 1];
        for (bin, _) in &entries {
            bins.starts[*bin as usize + 1] += 1;
        }
        for at in 1..bins.starts.len() {
            bins.starts[at] += bins.starts[at - 1];
        }
        bins.parts = entries.into_iter().map(|(_, part)| part).collect();
        bins
    }

    fn each(&self, [left, bottom, right, top]: [f64; 4], mut visit: impl FnMut(usize)) {
        let index = |value: f64, origin: f64, count: usize| {
            ((value - origin) / self.side).clamp(0.0, (count - 1) as f64) as usize
        };
        let cols = index(left, self.left, self.cols)..=index(right, self.left, self.cols);
        for row in index(bottom, self.bottom, self.rows)..=index(top, self.bottom, self.rows) {
            for col in cols.clone() {
                visit(row * self.cols + col);
            }
        }
    }

    /// Parts that may intersect a box, in ascending order.
    fn find(&self, bounds: [f64; 4]) -> Vec<u32> {
        let mut found = Vec::new();
        self.each(bounds, |bin| {
            let range = self.starts[bin] as usize..self.starts[bin + 1] as usize;
            found.extend_from_slice(&self.parts[range]);
        });
        found.sort_unstable();
        found.dedup();
        found
    }
}
