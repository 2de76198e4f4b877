//! Seeded random numbers: ChaCha8 with one key per purpose and seed.

use rand_chacha::ChaCha8Rng;
use rand_core::{Rng, SeedableRng};

/// A stream of random numbers that depends on a purpose and a seed alone.
#[derive(Debug, Clone)]
pub struct SeededRandom(ChaCha8Rng);

impl SeededRandom {
    /// The stream of `seed` for one purpose. Different purposes have unrelated
    /// streams, so that a map and its scenario may share a seed. At most the
    /// first 24 bytes of the purpose count.
    pub fn new(purpose: &str, seed: u64) -> Self {
        let mut key = [0u8; 32];
        key[..8].copy_from_slice(&seed.to_le_bytes());
        for (slot, byte) in key[8..].iter_mut().zip(purpose.bytes()) {
            *slot = byte;
        }
        Self(ChaCha8Rng::from_seed(key))
    }

    /// Goes to the number of that index in one of 2⁶⁴ independent streams of 64-bit
    /// numbers, so that it can be had without those before it. A new generator is
    /// at the first number of stream 0.
    pub fn go_to(&mut self, stream: u64, index: u64) {
        let to = 2 * u128::from(index);
        if self.0.get_stream() == stream {
            // Going ahead by a few numbers is cheaper than beginning there.
            let ahead = to.wrapping_sub(self.0.get_word_pos());
            if ahead <= 64 {
                for _ in 0..ahead / 2 {
                    self.0.next_u64();
                }
                return;
            }
        } else {
            self.0.set_stream(stream);
        }
        self.0.set_word_pos(to);
    }

    /// The next number of the stream, any equally likely.
    pub fn next_u64(&mut self) -> u64 {
        self.0.next_u64()
    }

    /// The next number of the stream as one between 0 and 1, neither of which it
    /// ever is.
    pub fn unit(&mut self) -> f64 {
        const SCALE: f64 = 1.0 / (1u64 << 53) as f64;
        ((self.next_u64() >> 11) as f64 + 0.5) * SCALE
    }

    /// A number below `bound`, every one equally likely; 0 if `bound` is 0.
    pub fn below(&mut self, bound: usize) -> usize {
        let bound = bound as u64;
        if bound == 0 {
            return 0;
        }
        // Values from the last, incomplete run of `bound` are drawn again.
        let excess = (u64::MAX % bound + 1) % bound;
        loop {
            let value = self.0.next_u64();
            if value <= u64::MAX - excess {
                return (value % bound) as usize;
            }
        }
    }

    /// Puts the items in a uniformly random order (Fisher and Yates).
    pub fn shuffle<T>(&mut self, items: &mut [T]) {
        for at in (1..items.len()).rev() {
            items.swap(at, self.below(at + 1));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_the_same_however_one_gets_there() {
        let mut straight = SeededRandom::new("test", 3);
        straight.go_to(5, 0);
        let all: Vec<u64> = (0..300).map(|_| straight.next_u64()).collect();
        let mut random = SeededRandom::new("test", 3);
        for index in [0, 1, 2, 10, 41, 42, 100, 299, 7, 7, 8] {
            random.go_to(5, index);
            assert_eq!(random.next_u64(), all[index as usize], "{index}");
        }
        random.go_to(6, 9);
        assert_ne!(random.next_u64(), all[9]);
        random.go_to(5, 10);
        assert_eq!(random.next_u64(), all[10]);
    }
}
