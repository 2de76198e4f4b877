//! Digests of states and events, in pieces that can be computed in parallel.

use fleetyard_core::Digest;
use xxhash_rust::xxh3::Xxh3;

use super::{States, event_bytes};
use crate::event::Event;

/// Number of bodies whose states are hashed together.
pub const CHUNK: usize = 64;

/// The digest of the states of [`CHUNK`] neighbouring bodies, the last of them
/// perhaps fewer: XXH3-128 of, tick by tick, all x, all y and all headings (if
/// there are any) as little-endian `f64`.
#[derive(Clone, Default)]
pub struct ChunkDigest(Xxh3);

impl ChunkDigest {
    /// Adds the states of the chunk's bodies at the next tick.
    pub fn update(&mut self, x_m: &[f64], y_m: &[f64], heading_rad: Option<&[f64]>) {
        for values in [Some(x_m), Some(y_m), heading_rad].into_iter().flatten() {
            for values in values.chunks(CHUNK) {
                let mut buffer = [0u8; 8 * CHUNK];
                for (slot, value) in buffer.chunks_exact_mut(8).zip(values) {
                    slot.copy_from_slice(&value.to_le_bytes());
                }
                self.0.update(&buffer[..8 * values.len()]);
            }
        }
    }
}

/// The digest of the states at all ticks: XXH3-128 of the digests of the chunks
/// in order, each as 16 little-endian bytes. Chunk i is the bodies from
/// `i * CHUNK`; agents come first, then moving obstacles.
#[derive(Clone)]
pub struct StatesDigest {
    chunks: Vec<ChunkDigest>,
}

impl StatesDigest {
    /// A digest for this number of bodies: agents and moving obstacles.
    pub fn new(bodies: usize) -> Self {
        Self {
            chunks: vec![ChunkDigest::default(); bodies.div_ceil(CHUNK)],
        }
    }

    /// The chunks, each of which can be fed on its own.
    pub fn chunks_mut(&mut self) -> &mut [ChunkDigest] {
        &mut self.chunks
    }

    /// Adds the states of all bodies at the next tick.
    pub fn update(&mut self, states: &States<'_>) {
        for (at, chunk) in self.chunks.iter_mut().enumerate() {
            let from = at * CHUNK;
            let to = (from + CHUNK).min(states.x_m.len());
            let headings = states.heading_rad.map(|headings| &headings[from..to]);
            chunk.update(&states.x_m[from..to], &states.y_m[from..to], headings);
        }
    }

    /// The digest of everything so far.
    pub fn finish(&self) -> Digest {
        let mut hash = Xxh3::new();
        for chunk in &self.chunks {
            hash.update(&chunk.0.digest128().to_le_bytes());
        }
        Digest(hash.digest128())
    }
}

/// The digest of all events: XXH3-128 of the 26 bytes that each has in a file.
#[derive(Clone, Default)]
pub struct EventsDigest(Xxh3);

impl EventsDigest {
    /// Adds the next events.
    pub fn update(&mut self, events: &[Event]) {
        for event in events {
            self.0.update(&event_bytes(event));
        }
    }

    /// The digest of everything so far.
    pub fn finish(&self) -> Digest {
        Digest(self.0.digest128())
    }
}
