//! The nearest of many points that come and go one by one.
//!
//! Points lie in bins along their first three axes, of which the third is a circle. When there are twice as many, bins are made
//! anew, so small that a point shares its own with few others, however uneven they lie.

use std::f64::consts::TAU;

use fleetyard_plugin_plane::bins::Rectangle;

/// Points that a point finds in its bin, itself among them.
const SHARED: f64 = 6.0;

/// Most bins for each point.
const SPARSE: f64 = 4.0;

/// Fewest points for which bins are made.
const FEWEST: usize = 64;

/// Points of D axes, at least three.
#[derive(Debug)]
pub struct Near<const D: usize> {
    bounds: Rectangle,
    /// Length of the circle that is the third axis; zero where it is of no account.
    round: f64,
    side: f64,
    /// Bins along x, y and the circle.
    counts: [usize; 3],
    bins: Vec<Vec<Entry<D>>>,
    points: usize,
    /// So many points make bins anew.
    full: usize,
}

#[derive(Debug, Clone, Copy)]
struct Entry<const D: usize> {
    point: [f64; D],
    number: u32,
}

/// A point that was found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Found {
    /// The square of its distance.
    pub square: f64,
    /// Its number.
    pub number: u32,
}

impl<const D: usize> Near<D> {
    /// No points; most will lie in these bounds. The third axis is a circle of that length, or of no account.
    pub fn new(bounds: Rectangle, round: f64) -> Self {
        let mut near = Self {
            bounds,
            round,
            side: 0.0,
            counts: [1; 3],
            bins: Vec::new(),
            points: 0,
            full: FEWEST,
        };
        near.cut((bounds.max - bounds.min).max());
        near
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.points
    }

    /// There is no point.
    pub fn is_empty(&self) -> bool {
        self.points == 0
    }

    /// Adds a point; the third axis begins at zero and is below the length of the circle.
    pub fn insert(&mut self, point: [f64; D], number: u32) {
        let bin = self.bin(&point);
        self.bins[bin].push(Entry { point, number });
        self.points += 1;
        if self.points >= self.full {
            self.rebuild();
        }
    }

    /// Takes a point out.
    pub fn remove(&mut self, point: &[f64; D], number: u32) {
        let bin = self.bin(point);
        if let Some(at) = self.bins[bin]
            .iter()
            .position(|entry| entry.number == number)
        {
            self.bins[bin].remove(at);
            self.points -= 1;
        }
    }

    /// Puts the `count` nearest points into `found`, in no order.
    pub fn nearest(&self, point: &[f64; D], count: usize, found: &mut Vec<Found>) {
        found.clear();
        let home = self.cell(point);
        for ring in 0.. {
            self.ring(point, home, ring, found);
            let covered = self.covered(point, home, ring);
            let all = covered.is_infinite();
            if found.len() < count && !all {
                continue;
            }
            let covered = covered * covered;
            if all || found.iter().filter(|one| one.square <= covered).count() >= count {
                break;
            }
        }
        if found.len() > count {
            found.select_nth_unstable_by(count, |one, other| {
                let squares = one.square.total_cmp(&other.square);
                squares.then(one.number.cmp(&other.number))
            });
            found.truncate(count);
        }
    }

    /// Puts the points that are at most so far away into `found`, in no order.
    pub fn within(&self, point: &[f64; D], distance: f64, found: &mut Vec<Found>) {
        found.clear();
        let home = self.cell(point);
        for ring in 0.. {
            self.ring(point, home, ring, found);
            if self.covered(point, home, ring) >= distance {
                break;
            }
        }
        found.retain(|one| one.square <= distance * distance);
    }

    /// The square of the distance of two points.
    pub fn square(&self, one: &[f64; D], other: &[f64; D]) -> f64 {
        let mut sum = 0.0;
        for axis in 0..D {
            let mut difference = one[axis] - other[axis];
            if axis == 2 {
                let there = difference.abs();
                difference = there.min(self.round - there);
            }
            sum += difference * difference;
        }
        sum
    }

    /// Adds the points in bins that are so many bins away along the farthest axis.
    fn ring(&self, point: &[f64; D], home: [usize; 3], ring: usize, found: &mut Vec<Found>) {
        let [columns, rows, layers] = self.counts;
        let span = |at: usize, count: usize| (at.saturating_sub(ring), (at + ring).min(count - 1));
        let (left, right) = span(home[0], columns);
        let (bottom, top) = span(home[1], rows);
        for layer in 0..layers {
            let ahead = layer.abs_diff(home[2]);
            let away = ahead.min(layers - ahead);
            if away > ring {
                continue;
            }
            for row in bottom..=top {
                let is_edge = away == ring || row.abs_diff(home[1]) == ring;
                let first = (layer * rows + row) * columns;
                let mut visit = |column: usize| {
                    for entry in &self.bins[first + column] {
                        found.push(Found {
                            square: self.square(point, &entry.point),
                            number: entry.number,
                        });
                    }
                };
                if is_edge {
                    (left..=right).for_each(visit);
                } else {
                    if home[0] >= ring {
                        visit(left);
                    }
                    if home[0] + ring < columns {
                        visit(right);
                    }
                }
            }
        }
    }

    /// All points that are nearer are in the bins up to this ring.
    fn covered(&self, point: &[f64; D], home: [usize; 3], ring: usize) -> f64 {
        let mut least = f64::INFINITY;
        let begin = [self.bounds.min.x, self.bounds.min.y];
        for axis in 0..2 {
            let within = point[axis] - begin[axis];
            if home[axis] > ring {
                least = least.min(within - (home[axis] - ring) as f64 * self.side);
            }
            if home[axis] + ring + 1 < self.counts[axis] {
                least = least.min((home[axis] + ring + 1) as f64 * self.side - within);
            }
        }
        if 2 * ring + 1 < self.counts[2] {
            let deep = self.round / self.counts[2] as f64;
            let within = point[2] - home[2] as f64 * deep;
            least = least.min(within.min(deep - within) + ring as f64 * deep);
        }
        least.max(0.0)
    }

    fn cell(&self, point: &[f64; D]) -> [usize; 3] {
        let index = |along: f64, count: usize| (along as usize).min(count - 1);
        let deep = if self.round > 0.0 {
            point[2] / self.round * self.counts[2] as f64
        } else {
            0.0
        };
        [
            index((point[0] - self.bounds.min.x) / self.side, self.counts[0]),
            index((point[1] - self.bounds.min.y) / self.side, self.counts[1]),
            index(deep, self.counts[2]),
        ]
    }

    fn bin(&self, point: &[f64; D]) -> usize {
        let [column, row, layer] = self.cell(point);
        (layer * self.counts[1] + row) * self.counts[0] + column
    }

    /// Empty bins of about this side.
    fn cut(&mut self, side: f64) {
        let extent = self.bounds.max - self.bounds.min;
        let side = side.max(f64::MIN_POSITIVE);
        self.side = side;
        let count = |length: f64| ((length / side).ceil() as usize).max(1);
        self.counts = [count(extent.x), count(extent.y), count(self.round)];
        self.bins.clear();
        self.bins
            .resize_with(self.counts.iter().product(), Vec::new);
    }

    fn rebuild(&mut self) {
        self.full = self.points * 2;
        let entries: Vec<Entry<D>> = self.bins.iter().flatten().copied().collect();
        let axes = if self.round > 0.0 { 3 } else { 2 };
        let most = SPARSE * entries.len() as f64;
        self.cut(self.side);
        loop {
            for entry in &entries {
                let bin = self.bin(&entry.point);
                self.bins[bin].push(*entry);
            }
            let squares: usize = self.bins.iter().map(|bin| bin.len() * bin.len()).sum();
            let crowd = squares as f64 / entries.len() as f64 / SHARED;
            let finer = if axes == 3 {
                libm::cbrt(crowd)
            } else {
                crowd.sqrt()
            };
            // So many more bins are there in turn.
            let more = self.bins.len() as f64 * crowd;
            if crowd < 1.5 || more > most {
                return;
            }
            self.cut(self.side / finer);
        }
    }
}

/// An angle as a point of the circle on which a radian is so long.
pub fn lifted(heading: f64, lever: f64) -> f64 {
    let part = heading / TAU;
    let part = part - libm::floor(part);
    if part < 1.0 { part * TAU * lever } else { 0.0 }
}
