//! Bodies in chunks: the unit of parallel work.
//!
//! Agents (and moving obstacles after them) are dealt out to chunks of
//! [`CHUNK`], in order. A chunk owns everything about its bodies, so that
//! chunks can be driven through a block of time in any order and on any thread;
//! whatever is combined afterwards is combined in the order of chunks. The size
//! is part of the trace digest and does not depend on the number of threads.

use xxhash_rust::xxh3::Xxh3;

use crate::control::Pilot;
use crate::event::Change;
use crate::noise::Slip;
use crate::track::{Span, Tracks, fraction, interpolate};

/// Bodies per chunk.
pub(crate) const CHUNK: usize = 64;

/// Tracking error of a body: the distance and the angle from where it should be.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Off {
    pub(crate) m: f64,
    pub(crate) rad: f64,
}

/// Tracking errors of bodies.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Tracking {
    pub(crate) max_m: f64,
    pub(crate) max_agent: Option<u32>,
    pub(crate) max_rad: f64,
    /// Sum over agents of metres times substeps.
    pub(crate) sum: f64,
}

impl Tracking {
    pub(crate) fn note(&mut self, agent: u32, off: Off, substeps: f64) {
        if off.m > self.max_m {
            self.max_m = off.m;
            self.max_agent = Some(agent);
        }
        self.max_rad = self.max_rad.max(off.rad);
        self.sum += off.m * substeps;
    }

    /// Merges the tracking errors of agents with higher indices.
    pub(crate) fn join(&mut self, later: Self) {
        if later.max_m > self.max_m {
            self.max_m = later.max_m;
            self.max_agent = later.max_agent;
        }
        self.max_rad = self.max_rad.max(later.max_rad);
        self.sum += later.sum;
    }
}

/// State of some successive bodies.
pub(crate) struct Chunk {
    /// Index of the first body.
    pub(crate) first: u32,
    pub(crate) x: Vec<f64>,
    pub(crate) y: Vec<f64>,
    /// Unwrapped.
    pub(crate) heading: Vec<f64>,
    /// One per driven body; empty if no body is driven.
    pub(crate) pilots: Vec<Pilot>,
    /// Speed factor of each driven body in the block.
    pub(crate) factors: Vec<f64>,
    /// Errors of velocity of each driven body in the block; empty if there are none.
    pub(crate) slips: Vec<Slip>,
    /// Tracking error of each driven body; NaN metres if it is not needed.
    pub(crate) errors: Vec<Off>,
    /// Set if no body moved in the last block and none moves before a new release.
    pub(crate) is_still: bool,
    pub(crate) tracks: Tracks,
    /// Largest distance of each body from its position at the start of the block.
    pub(crate) travel: Vec<f64>,
    /// Begins and ends of contacts with obstacles in the block.
    pub(crate) changes: Vec<Change>,
    pub(crate) tracking: Tracking,
    /// Hash of the bodies' states at ticks.
    pub(crate) states: Box<Xxh3>,
    /// States at the ticks of the block: per tick x, y and, if they matter,
    /// headings of all bodies.
    pub(crate) samples: Vec<f64>,
}

impl Chunk {
    pub(crate) fn new(first: u32, with_heading: bool) -> Self {
        Self {
            first,
            x: Vec::with_capacity(CHUNK),
            y: Vec::with_capacity(CHUNK),
            heading: Vec::with_capacity(CHUNK),
            pilots: Vec::new(),
            factors: Vec::new(),
            slips: Vec::new(),
            errors: vec![
                Off {
                    m: f64::NAN,
                    rad: 0.0
                };
                CHUNK
            ],
            is_still: false,
            tracks: Tracks::new(with_heading),
            travel: vec![0.0; CHUNK],
            changes: Vec::new(),
            tracking: Tracking::default(),
            states: Box::new(Xxh3::new()),
            samples: Vec::new(),
        }
    }

    pub(crate) fn len(&self) -> usize {
        self.x.len()
    }

    /// Memory of the chunk in bytes.
    pub(crate) fn memory_bytes(&self) -> usize {
        let values = [
            &self.x,
            &self.y,
            &self.heading,
            &self.factors,
            &self.travel,
            &self.samples,
        ];
        let values: usize = values.iter().map(|values| values.capacity()).sum();
        size_of::<Self>()
            + size_of::<Xxh3>()
            + self.pilots.capacity() * size_of::<Pilot>()
            + self.changes.capacity() * size_of::<Change>()
            + self.tracks.memory_bytes()
            + self.errors.capacity() * size_of::<Off>()
            + self.slips.capacity() * size_of::<Slip>()
            + values * size_of::<f64>()
    }

    /// Clears the tracks before a new block.
    pub(crate) fn begin_block(&mut self) {
        self.tracks.clear();
        self.changes.clear();
    }

    /// Makes the track of the next body, which does not move.
    pub(crate) fn rest(&mut self, block: Span, lane: usize) {
        let (x, y, heading) = (self.x[lane], self.y[lane], self.heading[lane]);
        self.tracks.open();
        self.tracks.push(block.start, x, y, heading);
        self.tracks.push(block.end, x, y, heading);
    }

    /// Closes the block: every body is now at the end of its track.
    pub(crate) fn end_block(&mut self) {
        for lane in 0..self.len() {
            let track = self.tracks.get(lane);
            let (x0, y0) = (track.x[0], track.y[0]);
            let mut farthest = 0f64;
            for (x, y) in track.x[1..].iter().zip(&track.y[1..]) {
                let (dx, dy) = (x - x0, y - y0);
                farthest = farthest.max(dx * dx + dy * dy);
            }
            self.travel[lane] = farthest.sqrt();
            let last = track.x.len() - 1;
            (self.x[lane], self.y[lane]) = (track.x[last], track.y[last]);
            if let Some(heading) = track.heading.last() {
                self.heading[lane] = *heading;
            }
        }
    }

    /// True if all bodies stood through the block.
    pub(crate) fn stood(&self) -> bool {
        self.tracks.is_simple(self.len()) && (0..self.len()).all(|lane| !self.has_moved(lane))
    }

    /// A block in which no body moves, as in the last one: the combined effect of
    /// [`Chunk::rest`], [`Chunk::end_block`] and [`Chunk::sample`] for all bodies.
    pub(crate) fn stand(&mut self, block: Span, moments: &[f64], keep: bool) {
        self.changes.clear();
        for ends in self.tracks.t.as_chunks_mut::<2>().0 {
            *ends = [block.start, block.end];
        }
        for (lane, off) in self.errors.iter().enumerate() {
            if !off.m.is_nan() {
                let agent = self.first + lane as u32;
                self.tracking.note(agent, *off, block.length());
            }
        }
        let Some(first) = moments.first() else {
            return;
        };
        self.samples.clear();
        self.fill(&[*first]);
        let row = self.samples.len();
        for _ in moments {
            hash(&mut self.states, &self.samples[..row]);
        }
        if keep {
            for _ in 1..moments.len() {
                self.samples.extend_from_within(..row);
            }
        }
    }

    /// True if a body moved or turned during the block, even if it came back.
    pub(crate) fn has_moved(&self, lane: usize) -> bool {
        let turned = || {
            let track = (lane < self.tracks.len()).then(|| self.tracks.get(lane));
            track.is_some_and(|track| track.heading.first() != track.heading.last())
        };
        self.travel[lane] > 0.0 || turned()
    }

    /// Samples the states of the bodies at the given moments, all within the block, and
    /// hashes them. `keep` leaves all of them in `samples`; otherwise it holds a few at a
    /// time.
    pub(crate) fn sample(&mut self, moments: &[f64], keep: bool) {
        let batch = if keep { moments.len() } else { 8 };
        for moments in moments.chunks(batch.max(1)) {
            self.sample_batch(moments);
        }
    }

    fn sample_batch(&mut self, moments: &[f64]) {
        self.fill(moments);
        let width = if self.tracks.with_heading { 3 } else { 2 };
        for row in self.samples.chunks_exact(width * self.len()) {
            hash(&mut self.states, row);
        }
    }

    /// Fills `samples` with the states at some moments.
    fn fill(&mut self, moments: &[f64]) {
        let bodies = self.len();
        let with_heading = self.tracks.with_heading;
        let width = if with_heading { 3 } else { 2 };
        let row = width * bodies;
        self.samples.clear();
        self.samples.resize(row * moments.len(), 0.0);
        if self.tracks.is_simple(self.len()) {
            self.sample_simple(moments, bodies, row);
        } else {
            for lane in 0..bodies {
                let track = self.tracks.get(lane);
                // Bodies that are driven have a moment at every tick.
                if track.t.get(..moments.len()) == Some(moments) {
                    for (at, row) in self.samples.chunks_exact_mut(row).enumerate() {
                        row[lane] = track.x[at];
                        row[bodies + lane] = track.y[at];
                        if with_heading {
                            row[2 * bodies + lane] = track.heading[at];
                        }
                    }
                    continue;
                }
                let mut at = 0;
                for (moment, row) in moments.iter().zip(self.samples.chunks_exact_mut(row)) {
                    while at + 2 < track.t.len() && track.t[at + 1] <= *moment {
                        at += 1;
                    }
                    let fraction = fraction(track.t[at], track.t[at + 1], *moment);
                    let value = |of: &[f64]| interpolate(of[at], of[at + 1], fraction);
                    row[lane] = value(track.x);
                    row[bodies + lane] = value(track.y);
                    if with_heading {
                        row[2 * bodies + lane] = value(track.heading);
                    }
                }
            }
        }
    }

    /// [`Chunk::fill`] where every body moves uniformly through the block: straight loops
    /// over all bodies.
    fn sample_simple(&mut self, moments: &[f64], bodies: usize, row: usize) {
        let Tracks {
            t, x, y, heading, ..
        } = &self.tracks;
        let (start, end) = (t[0], t[1]);
        for (moment, row) in moments.iter().zip(self.samples.chunks_exact_mut(row)) {
            let fraction = fraction(start, end, *moment);
            for (values, out) in [x, y, heading]
                .into_iter()
                .zip(row.chunks_exact_mut(bodies))
            {
                for (ends, out) in values.as_chunks::<2>().0.iter().zip(out) {
                    *out = interpolate(ends[0], ends[1], fraction);
                }
            }
        }
    }
}

/// Hashes the states of a chunk's bodies at a tick.
fn hash(states: &mut Xxh3, row: &[f64]) {
    let mut buffer = [0u8; 3 * 8 * CHUNK];
    for (slot, value) in buffer.chunks_exact_mut(8).zip(row) {
        slot.copy_from_slice(&value.to_le_bytes());
    }
    states.update(&buffer[..8 * row.len()]);
}
