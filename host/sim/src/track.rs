//! Tracks: the motion of bodies through a block of time.

use fleetyard_world::{Pose, Vector};

/// A stretch of time, in substeps since the start of the execution; the ends
/// need not be whole.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Span {
    pub(crate) start: f64,
    pub(crate) end: f64,
}

impl Span {
    pub(crate) fn length(self) -> f64 {
        self.end - self.start
    }

    /// The moment at a fraction of the span.
    pub(crate) fn at(self, fraction: f64) -> f64 {
        self.start + fraction * self.length()
    }
}

/// Motion of one body through a block: uniform between moments.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Track<'a> {
    /// At least two ascending moments, from the start to the end of the block.
    pub(crate) t: &'a [f64],
    pub(crate) x: &'a [f64],
    pub(crate) y: &'a [f64],
    /// Unwrapped headings; empty where headings do not matter.
    pub(crate) heading: &'a [f64],
}

impl Track<'_> {
    /// Pose of the body at one of the moments.
    pub(crate) fn pose(&self, at: usize) -> Pose {
        let heading = self.heading.get(at).copied().unwrap_or(0.0);
        Pose::new(self.x[at], self.y[at], heading)
    }

    /// Place of the body at one of the moments.
    pub(crate) fn place(&self, at: usize) -> Vector {
        Vector::new(self.x[at], self.y[at])
    }

    /// Bounding box of the body's path: left, bottom, right and top.
    pub(crate) fn bounds(&self) -> [f64; 4] {
        let range = |values: &[f64]| {
            let first = (values[0], values[0]);
            values.iter().fold(first, |(low, high), value| {
                (low.min(*value), high.max(*value))
            })
        };
        let ((left, right), (bottom, top)) = (range(self.x), range(self.y));
        [left, bottom, right, top]
    }

    /// Pose of the body within the stretch that ends at the moment `next`.
    pub(crate) fn within(&self, next: usize, when: f64) -> Pose {
        let share = fraction(self.t[next - 1], self.t[next], when);
        self.pose(next - 1).toward(self.pose(next), share)
    }
}

/// The tracks of successive bodies in one block, moments of all bodies one after another.
#[derive(Debug, Default)]
pub(crate) struct Tracks {
    /// Index of each body's first moment; one more entry than bodies.
    starts: Vec<u32>,
    pub(crate) t: Vec<f64>,
    pub(crate) x: Vec<f64>,
    pub(crate) y: Vec<f64>,
    pub(crate) heading: Vec<f64>,
    pub(crate) with_heading: bool,
}

impl Tracks {
    pub(crate) fn new(with_heading: bool) -> Self {
        Self {
            with_heading,
            ..Self::default()
        }
    }

    /// Number of tracks that were opened.
    pub(crate) fn len(&self) -> usize {
        self.starts.len()
    }

    pub(crate) fn clear(&mut self) {
        self.starts.clear();
        self.t.clear();
        self.x.clear();
        self.y.clear();
        self.heading.clear();
    }

    /// Appends a moment to the track of the last body.
    pub(crate) fn push(&mut self, t: f64, x: f64, y: f64, heading: f64) {
        self.t.push(t);
        self.x.push(x);
        self.y.push(y);
        if self.with_heading {
            self.heading.push(heading);
        }
    }

    /// Opens the track of the next body.
    pub(crate) fn open(&mut self) {
        self.starts.push(self.t.len() as u32);
    }

    pub(crate) fn get(&self, lane: usize) -> Track<'_> {
        let end = self
            .starts
            .get(lane + 1)
            .map_or(self.t.len(), |at| *at as usize);
        let range = self.starts[lane] as usize..end;
        Track {
            t: &self.t[range.clone()],
            x: &self.x[range.clone()],
            y: &self.y[range.clone()],
            heading: self.heading.get(range).unwrap_or(&[]),
        }
    }

    /// Position of a body at the start of the block.
    pub(crate) fn first(&self, lane: usize) -> (f64, f64) {
        let at = self.starts[lane] as usize;
        (self.x[at], self.y[at])
    }

    pub(crate) fn memory_bytes(&self) -> usize {
        let values = [&self.t, &self.x, &self.y, &self.heading];
        let values: usize = values.iter().map(|values| values.capacity()).sum();
        values * size_of::<f64>() + self.starts.capacity() * size_of::<u32>()
    }

    /// True if every track is one uniform stretch.
    pub(crate) fn is_simple(&self, bodies: usize) -> bool {
        self.t.len() == 2 * bodies
    }
}

/// Fraction of the time from `start` to `end` that has passed at `moment`.
pub(crate) fn fraction(start: f64, end: f64, moment: f64) -> f64 {
    if end > start {
        (moment - start) / (end - start)
    } else {
        1.0
    }
}

/// Linear interpolation; exactly the second value at the end.
pub(crate) fn interpolate(from: f64, to: f64, fraction: f64) -> f64 {
    if fraction >= 1.0 {
        to
    } else {
        from + (to - from) * fraction
    }
}
