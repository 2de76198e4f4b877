//! The one source of randomness: a ChaCha8 stream per purpose, all from one seed.

use rand_chacha::ChaCha8Rng;
use rand_core::{Rng as _, SeedableRng as _};

/// A seeded stream. Streams with different numbers are independent.
#[derive(Debug, Clone)]
pub struct Random {
    rng: ChaCha8Rng,
    /// Bits drawn and not yet handed out, for [`Random::byte`].
    pool: u64,
    bytes_left: u32,
}

impl Random {
    /// A stream at its beginning.
    pub fn new(seed: u64, stream: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(stream);
        Self {
            rng,
            pool: 0,
            bytes_left: 0,
        }
    }

    /// Eight random bits.
    #[inline]
    pub fn byte(&mut self) -> usize {
        if self.bytes_left == 0 {
            self.pool = self.rng.next_u64();
            self.bytes_left = 8;
        }
        let byte = self.pool & 0xff;
        self.pool >>= 8;
        self.bytes_left -= 1;
        byte as usize
    }

    /// A number below `bound` (zero for a bound of zero). The bias is below
    /// `bound / 2³²`, of no account for heuristics.
    #[inline]
    pub fn below(&mut self, bound: usize) -> usize {
        ((u64::from(self.rng.next_u32()) * bound as u64) >> 32) as usize
    }

    /// A number from 0 up to, but not, 1.
    pub fn share(&mut self) -> f64 {
        f64::from(self.rng.next_u32()) / (f64::from(u32::MAX) + 1.0)
    }

    /// True once in `n` draws.
    pub fn one_in(&mut self, n: usize) -> bool {
        self.below(n) == 0
    }

    /// Any order, all equally likely.
    pub fn shuffle<T>(&mut self, items: &mut [T]) {
        for last in (1..items.len()).rev() {
            items.swap(last, self.below(last + 1));
        }
    }
}
