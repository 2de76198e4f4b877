//! Discs on their ways, in bins of the plane: who is near a place or a straight motion, and when.

use crate::Vector;
use crate::bins::Rectangle;
use crate::motion::{Motion, Span};
use crate::spans::Spans;
use crate::timing::{Obstruction, Stop, obstructions};

/// Most bins along one side.
const MOST: f64 = 256.0;

/// A motion of a disc.
#[derive(Debug, Clone, Copy)]
struct Piece {
    disc: u32,
    start: f64,
    end: f64,
    motion: Motion,
    /// The end of the motion.
    to: Vector,
}

/// Discs on their ways. They are numbered; each has its radius.
///
/// Questions come with the distances of centres that the one who asks has to keep from each disc, in metres; zero for those
/// that it need not keep clear of.
#[derive(Debug)]
pub struct Traffic {
    radii: Vec<f64>,
    margin: f64,
    pieces: Vec<Piece>,
    unused: Vec<u32>,
    /// Pieces of each disc.
    of: Vec<Vec<u32>>,
    origin: Vector,
    per_metre: f64,
    columns: usize,
    rows: usize,
    bins: Vec<Vec<u32>>,
    /// The number of the question in which a piece was seen last.
    seen: Vec<u32>,
    question: u32,
}

impl Traffic {
    /// No disc on its way yet; `radii` are those of the discs and `margin` is what they keep between them at most, beyond touching.
    pub fn new(bounds: Rectangle, radii: Vec<f64>, margin: f64) -> Self {
        let largest = radii.iter().copied().fold(0.0, f64::max) + margin;
        let extent = bounds.max - bounds.min;
        let side = (4.0 * largest)
            .max(extent.max() / MOST)
            .max(f64::MIN_POSITIVE);
        let count = |length: f64| ((length / side) as usize + 1).min(MOST as usize + 1);
        let (columns, rows) = (count(extent.x), count(extent.y));
        Self {
            of: vec![Vec::new(); radii.len()],
            radii,
            margin: margin + 1e-6,
            pieces: Vec::new(),
            unused: Vec::new(),
            origin: bounds.min,
            per_metre: side.recip(),
            columns,
            rows,
            bins: vec![Vec::new(); columns * rows],
            seen: Vec::new(),
            question: 0,
        }
    }

    /// Puts a disc on its way, in place of the one it had.
    pub fn set(&mut self, disc: u32, stops: &[Stop]) {
        self.remove(disc);
        for Obstruction { start, motion, .. } in obstructions(stops, 0.0) {
            let end = start + motion.duration;
            if end <= start {
                continue;
            }
            let (from, to) = ends(&motion);
            let piece = Piece {
                disc,
                start,
                end,
                motion,
                to,
            };
            let number = self.unused.pop().unwrap_or_else(|| {
                self.pieces.push(piece);
                self.seen.push(0);
                self.pieces.len() as u32 - 1
            });
            self.pieces[number as usize] = piece;
            self.of[disc as usize].push(number);
            for bin in self.along(from, to, self.radii[disc as usize]) {
                self.bins[bin].push(number);
            }
        }
    }

    /// Takes a disc out.
    pub fn remove(&mut self, disc: u32) {
        for number in std::mem::take(&mut self.of[disc as usize]) {
            let Piece { motion, to, .. } = self.pieces[number as usize];
            for bin in self.along(motion.from, to, self.radii[disc as usize]) {
                let members = &mut self.bins[bin];
                if let Some(at) = members.iter().position(|member| *member == number) {
                    members.swap_remove(at);
                }
            }
            self.unused.push(number);
        }
    }

    /// Adds the times at which `disc` may not be at a place.
    pub fn taken(&mut self, disc: u32, at: Vector, apart: &[f64], taken: &mut Spans) {
        self.near(disc, (at, at), |piece| {
            let distance = apart[piece.disc as usize];
            if let Some(near) = piece.motion.near(at, distance) {
                taken.insert(near.after(piece.start));
            }
        });
    }

    /// Adds the times from `within.low` to `within.high` at which `disc` may not set out on a motion.
    pub fn forbidden(
        &mut self,
        disc: u32,
        motion: &Motion,
        within: Span,
        apart: &[f64],
        forbidden: &mut Spans,
    ) {
        let last = within.high + motion.duration;
        let line = Strip::along(motion);
        self.near(disc, ends(motion), |piece| {
            let distance = apart[piece.disc as usize];
            if piece.end <= within.low || piece.start >= last || line.misses(piece, distance) {
                return;
            }
            // Of one at rest it is enough to know when the motion is near.
            if piece.motion.velocity == Vector::zeros() {
                if let Some(near) = motion.near(piece.motion.from, distance) {
                    forbidden.insert(Span {
                        low: piece.start - near.high,
                        high: piece.end - near.low,
                    });
                }
            } else if let Some(overlap) = piece.motion.overlap(motion, distance) {
                forbidden.insert(overlap.forward.after(piece.start));
            }
        });
    }

    /// Calls `met` with every disc that `disc` comes too close to when it sets out on a motion at a time, of some several times.
    pub fn meeting(
        &mut self,
        disc: u32,
        (start, motion): (f64, &Motion),
        apart: &[f64],
        mut met: impl FnMut(u32),
    ) {
        let end = start + motion.duration;
        let line = Strip::along(motion);
        self.near(disc, ends(motion), |piece| {
            let distance = apart[piece.disc as usize];
            if piece.end <= start || piece.start >= end || line.misses(piece, distance) {
                return;
            }
            let meets = if motion.velocity == Vector::zeros() {
                let near = piece.motion.near(motion.from, distance);
                near.is_some_and(|near| {
                    piece.start + near.low < end && start < piece.start + near.high
                })
            } else {
                let overlap = piece.motion.overlap(motion, distance);
                overlap.is_some_and(|overlap| {
                    let Span { low, high } = overlap.forward.after(piece.start);
                    low < start && start < high
                })
            };
            if meets {
                met(piece.disc);
            }
        });
    }

    /// Calls `found` with every piece of others that may be near a line, each once.
    fn near(&mut self, disc: u32, (from, to): (Vector, Vector), mut found: impl FnMut(&Piece)) {
        self.question = self.question.wrapping_add(1);
        if self.question == 0 {
            self.seen.fill(0);
            self.question = 1;
        }
        let margin = self.radii[disc as usize] + self.margin;
        for bin in self.along(from, to, margin) {
            for number in &self.bins[bin] {
                let piece = &self.pieces[*number as usize];
                if piece.disc != disc
                    && std::mem::replace(&mut self.seen[*number as usize], self.question)
                        != self.question
                {
                    found(piece);
                }
            }
        }
    }

    /// The bins that a line with a margin round it touches.
    fn along(&self, from: Vector, to: Vector, margin: f64) -> impl Iterator<Item = usize> + use<> {
        let (low, high) = if from.y <= to.y {
            (from, to)
        } else {
            (to, from)
        };
        let (origin, per_metre, columns) = (self.origin, self.per_metre, self.columns);
        let index = move |metres: f64, count: usize| ((metres * per_metre) as usize).min(count - 1);
        let bottom = index(low.y - margin - origin.y, self.rows);
        let top = index(high.y + margin - origin.y, self.rows);
        let slope = if high.y > low.y {
            (high.x - low.x) / (high.y - low.y)
        } else {
            0.0
        };
        let last = self.rows - 1;
        (bottom..=top).flat_map(move |row| {
            let (mut left, mut right) = (low.x.min(high.x), low.x.max(high.x));
            if slope != 0.0 {
                // The part of the line from which this row is within the margin; border rows hold all that is beyond.
                let floor = if row == 0 {
                    f64::NEG_INFINITY
                } else {
                    origin.y + row as f64 / per_metre - margin - 1e-9
                };
                let ceiling = if row == last {
                    f64::INFINITY
                } else {
                    origin.y + (row + 1) as f64 / per_metre + margin + 1e-9
                };
                let at = |y: f64| low.x + slope * (y.clamp(low.y, high.y) - low.y);
                let (enter, leave) = (at(floor), at(ceiling));
                left = left.max(enter.min(leave));
                right = right.min(enter.max(leave));
            }
            let first = index(left - margin - origin.x, columns);
            let end = index(right + margin - origin.x, columns);
            (first..=end).map(move |column| row * columns + column)
        })
    }
}

/// The line of a motion, to tell soon of most pieces that they are nowhere near it.
struct Strip {
    from: Vector,
    along: Vector,
    length: f64,
}

impl Strip {
    fn along(motion: &Motion) -> Self {
        let (from, to) = ends(motion);
        let length = (to - from).norm();
        Self {
            from,
            along: if length > 0.0 {
                (to - from) / length
            } else {
                Vector::zeros()
            },
            length,
        }
    }

    /// The piece is farther than a distance on one side of the line, or beyond an end.
    fn misses(&self, piece: &Piece, distance: f64) -> bool {
        let (from, to) = (piece.motion.from - self.from, piece.to - self.from);
        let sides = [from, to].map(|at| self.along.x * at.y - self.along.y * at.x);
        let ahead = [from, to].map(|at| self.along.dot(&at));
        sides[0].min(sides[1]) > distance
            || sides[0].max(sides[1]) < -distance
            || ahead[0].min(ahead[1]) > self.length + distance
            || ahead[0].max(ahead[1]) < -distance
    }
}

/// Both ends of a motion; one at rest may last for ever.
fn ends(motion: &Motion) -> (Vector, Vector) {
    if motion.velocity == Vector::zeros() {
        (motion.from, motion.from)
    } else {
        (motion.from, motion.at(motion.duration))
    }
}
