//! Boxes of the plane in square bins: which ones are near a box.

use crate::Vector;

/// A box along the axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rectangle {
    /// Lower left corner, in metres.
    pub min: Vector,
    /// Upper right corner, in metres.
    pub max: Vector,
}

impl Rectangle {
    /// The smallest one around two places, and so much wider on each side.
    pub fn around(a: Vector, b: Vector, margin: f64) -> Self {
        let margin = Vector::repeat(margin);
        Self {
            min: a.inf(&b) - margin,
            max: a.sup(&b) + margin,
        }
    }

    /// Both have a point in common.
    pub fn meets(&self, other: &Self) -> bool {
        self.min.x <= other.max.x
            && self.min.y <= other.max.y
            && other.min.x <= self.max.x
            && other.min.y <= self.max.y
    }
}

/// Most bins along one side, so that few boxes far apart take little memory.
const MOST: f64 = 1024.0;

/// Boxes in the bins that they touch.
#[derive(Debug, Clone)]
pub struct Bins {
    boxes: Vec<Rectangle>,
    origin: Vector,
    side: f64,
    /// The reciprocal of the side.
    per_metre: f64,
    columns: usize,
    rows: usize,
    /// Index of the first member of each bin, and at last the end.
    starts: Vec<u32>,
    members: Vec<u32>,
}

impl Bins {
    /// Puts boxes into bins of about their mean size.
    pub fn new(boxes: Vec<Rectangle>) -> Self {
        let whole = boxes.iter().copied().reduce(|a, b| Rectangle {
            min: a.min.inf(&b.min),
            max: a.max.sup(&b.max),
        });
        let whole = whole.unwrap_or(Rectangle {
            min: Vector::zeros(),
            max: Vector::zeros(),
        });
        let extent = whole.max - whole.min;
        let sum: f64 = boxes.iter().map(|each| (each.max - each.min).sum()).sum();
        let mean = sum / (2 * boxes.len().max(1)) as f64;
        let side = mean.max(extent.max() / MOST).max(f64::MIN_POSITIVE);
        let count = |length: f64| (length / side) as usize + 1;
        let mut bins = Self {
            boxes,
            origin: whole.min,
            side,
            per_metre: side.recip(),
            columns: count(extent.x),
            rows: count(extent.y),
            starts: Vec::new(),
            members: Vec::new(),
        };
        let mut starts = vec![0_u32; bins.columns * bins.rows + 1];
        for each in &bins.boxes {
            bins.cover(each).for_each(|bin| starts[bin + 1] += 1);
        }
        for bin in 1..starts.len() {
            starts[bin] += starts[bin - 1];
        }
        let mut next = starts.clone();
        let mut members = vec![0; starts[starts.len() - 1] as usize];
        for (number, each) in bins.boxes.iter().enumerate() {
            bins.cover(each).for_each(|bin| {
                members[next[bin] as usize] = number as u32;
                next[bin] += 1;
            });
        }
        bins.starts = starts;
        bins.members = members;
        bins
    }

    /// The boxes, in the order in which they were given.
    pub fn boxes(&self) -> &[Rectangle] {
        &self.boxes
    }

    /// Calls `found` with the number of every box that has a point in common with `asked`, each once, bin by bin.
    pub fn meeting(&self, asked: &Rectangle, found: impl FnMut(u32)) {
        self.meeting_from(asked, 0, found);
    }

    /// The same for boxes whose number is at least `first`.
    pub fn meeting_from(&self, asked: &Rectangle, first: u32, mut found: impl FnMut(u32)) {
        for bin in self.cover(asked) {
            let members = self.starts[bin] as usize..self.starts[bin + 1] as usize;
            // Members of a bin are in ascending order.
            let members = &self.members[members];
            let begin = members.partition_point(|number| *number < first);
            for number in &members[begin..] {
                let other = &self.boxes[*number as usize];
                // Of the bins that both touch the one of the lower left corner of what is common tells of them.
                if asked.meets(other) && self.bin(asked.min.sup(&other.min)) == bin {
                    found(*number);
                }
            }
        }
    }

    /// Asks `hit` of boxes in the bins that a segment passes, of some several times, until it says yes: then the answer is
    /// yes too.
    pub fn any_along(&self, from: Vector, to: Vector, mut hit: impl FnMut(u32) -> bool) -> bool {
        let (low, high) = if from.y <= to.y {
            (from, to)
        } else {
            (to, from)
        };
        let (_, bottom) = self.column_and_row(low);
        let (_, top) = self.column_and_row(high);
        for row in bottom..=top {
            // The part of the segment in this row of bins, a little longer than it is.
            let at = |y: f64| {
                let part = (y - low.y) / (high.y - low.y);
                low + (high - low)
                    * if part.is_nan() {
                        0.0
                    } else {
                        part.clamp(0.0, 1.0)
                    }
            };
            let floor = self.origin.y + self.side * row as f64;
            let (enter, leave) = if bottom == top {
                (low, high)
            } else {
                (at(floor - 1e-9), at(floor + self.side + 1e-9))
            };
            let (one, _) = self.column_and_row(enter);
            let (other, _) = self.column_and_row(leave);
            for column in one.min(other)..=one.max(other) {
                let bin = row * self.columns + column;
                let members = self.starts[bin] as usize..self.starts[bin + 1] as usize;
                if self.members[members].iter().any(|number| hit(*number)) {
                    return true;
                }
            }
        }
        false
    }

    fn column_and_row(&self, place: Vector) -> (usize, usize) {
        let at = (place - self.origin) * self.per_metre;
        (
            (at.x as usize).min(self.columns - 1),
            (at.y as usize).min(self.rows - 1),
        )
    }

    fn bin(&self, place: Vector) -> usize {
        let (column, row) = self.column_and_row(place);
        row * self.columns + column
    }

    fn cover(&self, each: &Rectangle) -> impl Iterator<Item = usize> + use<> {
        let columns = self.columns;
        let (left, bottom) = self.column_and_row(each.min);
        let (right, top) = self.column_and_row(each.max);
        (bottom..=top).flat_map(move |row| (left..=right).map(move |column| row * columns + column))
    }
}
