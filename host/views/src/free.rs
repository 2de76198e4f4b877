//! The free space of a disc: exact tests of places and of swept segments.
//!
//! A disc that goes straight from a free place is free all the way exactly if its segment is no
//! nearer than its radius to any edge of an obstacle or of the world. Edges are sorted into a grid
//! of tiles of which a test visits those that the swept disc covers.

use fleetyard_world::{Bounds, Lists, Tiles, Vector, Workspace, squared_distance};

/// By how much a disc may reach over an edge, in metres: rounding, a thousandth of what a contact is.
pub const FREE_SLACK_M: f64 = 1e-9;

/// The free space of discs among obstacles that stand. Movers are left out.
#[derive(Debug, Clone)]
pub struct Free {
    bounds: Bounds,
    has_boundary: bool,
    edges: Vec<Edge>,
    tiles: Tiles,
    /// Per tile its edges, row by row.
    of_tile: Lists,
    /// Per row of tiles its edges, each once.
    of_row: Lists,
}

#[derive(Debug, Clone, Copy)]
struct Edge {
    from: [f64; 2],
    to: [f64; 2],
    of_boundary: bool,
}

impl Edge {
    fn ends(self) -> [Vector; 2] {
        [self.from.into(), self.to.into()]
    }
}

/// Most rows and columns of tiles.
const MOST: f64 = 2048.0;

impl Free {
    /// The free space of a world.
    pub fn new(world: &Workspace) -> Self {
        let mut edges = Vec::new();
        let mut add = |vertices: &[[f64; 2]], of_boundary| {
            let ends = vertices.iter().cycle().skip(1);
            edges.extend(vertices.iter().zip(ends).map(|(from, to)| Edge {
                from: *from,
                to: *to,
                of_boundary,
            }));
        };
        for obstacle in &world.obstacles {
            add(obstacle.vertices(), false);
        }
        if let Some(boundary) = &world.boundary {
            add(boundary.polygon().vertices(), true);
        }
        let bounds = world.bounds;
        let [width, height] = [0, 1].map(|axis| bounds.max[axis] - bounds.min[axis]);
        let wanted = (width * height / (2 * edges.len() + 16) as f64).sqrt();
        let tiles = Tiles::new(bounds, wanted.max(width.max(height) / MOST));
        let size = tiles.size();
        let mut free = Self {
            bounds,
            has_boundary: world.boundary.is_some(),
            edges,
            tiles,
            of_tile: Lists::default(),
            of_row: Lists::default(),
        };
        let (mut of_tile, mut of_row) = (Vec::new(), Vec::new());
        for (number, edge) in free.edges.iter().enumerate() {
            free.covered(edge.from, edge.to, 0.0, |row, from, to| {
                of_row.push((row as u32, number as u32));
                let first = row * size[0];
                of_tile
                    .extend((first + from..=first + to).map(|tile| (tile as u32, number as u32)));
                false
            });
        }
        free.of_tile = Lists::new(size[0] * size[1], of_tile);
        free.of_row = Lists::new(size[1], of_row);
        free
    }

    /// The box around the world.
    pub fn bounds(&self) -> Bounds {
        self.bounds
    }

    /// Visits the tiles that a disc covers on its way, as row, first and last column, until
    /// the visitor is content.
    fn covered(
        &self,
        from: [f64; 2],
        to: [f64; 2],
        radius_m: f64,
        mut visit: impl FnMut(usize, usize, usize) -> bool,
    ) -> bool {
        let (low, high) = if from[1] <= to[1] {
            (from, to)
        } else {
            (to, from)
        };
        let reach = radius_m + FREE_SLACK_M + 1e-12 * self.tiles.side_m();
        let rise = high[1] - low[1];
        let last = self.tiles.size()[1] - 1;
        for row in self.tiles.index(1, low[1] - reach)..=self.tiles.index(1, high[1] + reach) {
            let line = |row: usize| self.tiles.begin(1, row);
            let begin = if row == 0 {
                f64::NEG_INFINITY
            } else {
                line(row) - reach
            };
            let end = if row == last {
                f64::INFINITY
            } else {
                line(row + 1) + reach
            };
            let x_at = |y: f64, flat: f64| {
                let share = if rise > 0.0 {
                    ((y - low[1]) / rise).clamp(0.0, 1.0)
                } else {
                    flat
                };
                low[0] + share * (high[0] - low[0])
            };
            let (a, b) = (x_at(begin, 0.0), x_at(end, 1.0));
            let first = self.tiles.index(0, a.min(b) - reach);
            if visit(row, first, self.tiles.index(0, a.max(b) + reach)) {
                return true;
            }
        }
        false
    }

    /// True if a point is within the world and in no obstacle.
    pub fn is_inside(&self, point: [f64; 2]) -> bool {
        if !self.bounds.contains(point) {
            return false;
        }
        let (mut solid, mut around) = (0, 0);
        for number in self.of_row.get(self.tiles.index(1, point[1])) {
            let edge = self.edges[*number as usize];
            let (below, above) = (edge.from[1] <= point[1], edge.to[1] <= point[1]);
            if below == above {
                continue;
            }
            let [ax, ay] = edge.from;
            let [bx, by] = edge.to;
            let side = (bx - ax) * (point[1] - ay) - (point[0] - ax) * (by - ay);
            let turn = match (below, side > 0.0) {
                (true, true) => 1,
                (false, false) if side < 0.0 => -1,
                _ => continue,
            };
            if edge.of_boundary {
                around += turn;
            } else {
                solid += turn;
            }
        }
        solid == 0 && (!self.has_boundary || around != 0)
    }

    /// True if a disc is free at a place.
    pub fn holds(&self, point: [f64; 2], radius_m: f64) -> bool {
        self.is_inside(point) && self.sweeps(point, point, radius_m)
    }

    /// True if a disc that is free at one place can go straight to another.
    pub fn sweeps(&self, from: [f64; 2], to: [f64; 2], radius_m: f64) -> bool {
        let radius = radius_m - FREE_SLACK_M;
        let within = |point: [f64; 2]| {
            let (min, max) = (self.bounds.min, self.bounds.max);
            (0..2)
                .all(|axis| point[axis] - radius >= min[axis] && point[axis] + radius <= max[axis])
        };
        if !(within(from) && within(to)) {
            return false;
        }
        let limit = radius.max(0.0) * radius.max(0.0);
        let way = [from, to].map(Vector::from);
        !self.covered(from, to, radius_m, |row, first, last| {
            let row = row * self.tiles.size()[0];
            (row + first..=row + last).any(|tile| {
                let mut edges = self.of_tile.get(tile).iter();
                edges.any(|number| {
                    let edge = self.edges[*number as usize];
                    squared_distance(way, edge.ends()) < limit
                })
            })
        })
    }

    /// The distance of a point from the nearest edge of an obstacle or of the world, in metres.
    pub fn clearance_m(&self, point: [f64; 2]) -> f64 {
        let (min, max) = (self.bounds.min, self.bounds.max);
        let sides = (0..2).flat_map(|axis| [point[axis] - min[axis], max[axis] - point[axis]]);
        let side = sides.fold(f64::INFINITY, |least, side| least.min(side.abs()));
        side.min(self.squared_to_edge(point, side).sqrt())
    }

    /// The squared distance of a point from the nearest edge of an obstacle or of the boundary; any
    /// larger number where that is farther than `most_m`. Tiles are searched ring by ring.
    fn squared_to_edge(&self, point: [f64; 2], most_m: f64) -> f64 {
        let at = Vector::from(point);
        let [cols, rows] = self.tiles.size();
        let [col, row] = [0, 1].map(|axis| self.tiles.index(axis, point[axis]));
        let mut least = f64::INFINITY;
        for ring in 0..cols.max(rows) {
            // Nothing in this ring and beyond is nearer, with room for the rounding of tiles.
            let nearest = (ring as f64 - 1.0 - 1e-6) * self.tiles.side_m();
            if ring > 1 && (nearest > most_m || nearest * nearest > least) {
                break;
            }
            let span = |middle: usize, count: usize| {
                middle.saturating_sub(ring)..=(middle + ring).min(count - 1)
            };
            let mut visit = |row: usize, col: usize| {
                for number in self.of_tile.get(row * cols + col) {
                    let edge = self.edges[*number as usize];
                    least = least.min(squared_distance([at, at], edge.ends()));
                }
            };
            for other in span(row, rows) {
                if other.abs_diff(row) == ring {
                    span(col, cols).for_each(|col| visit(other, col));
                } else {
                    let ends = [col.checked_sub(ring), Some(col + ring)];
                    let ends = ends.into_iter().flatten().filter(|col| *col < cols);
                    ends.for_each(|col| visit(other, col));
                }
            }
        }
        least
    }
}
