//! The random numbers of Python's `random` module, for mazes that others drew with it.

use rand_mt::Mt;

/// What `random.Random(seed)` is in CPython: the Mersenne Twister MT19937
/// (Matsumoto and Nishimura 1998), seeded by its own key-array method with the
/// 32-bit digits of the seed, lowest first.
#[derive(Debug, Clone)]
pub struct PythonRandom(Mt);

impl PythonRandom {
    /// The generator of an integer seed. CPython takes a seed's absolute value,
    /// so that negative seeds give nothing new.
    pub fn new(seed: u64) -> Self {
        let (low, high) = (seed as u32, (seed >> 32) as u32);
        let digits = if high == 0 { 1 } else { 2 };
        Self(Mt::new_with_key([low, high].into_iter().take(digits)))
    }

    /// `getrandbits(bits)` for at most 64 bits: whole words lowest first, of the
    /// last one its high bits.
    pub fn bits(&mut self, bits: u32) -> u64 {
        let mut word = |bits: u32| u64::from(self.0.next_u32() >> (32 - bits));
        match bits {
            0 => 0,
            1..=32 => word(bits),
            _ => {
                let low = word(32);
                low | word(bits.min(64) - 32) << 32
            }
        }
    }

    /// `randrange(bound)`: numbers of as many bits as `bound` has are drawn until
    /// one is below it. 0 if `bound` is 0, where Python raises an error.
    pub fn below(&mut self, bound: usize) -> usize {
        let bound = bound as u64;
        if bound == 0 {
            return 0;
        }
        let bits = u64::BITS - bound.leading_zeros();
        loop {
            let value = self.bits(bits);
            if value < bound {
                return value as usize;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Printed by CPython 3.11: `random.seed(s)`, then
    /// `[random.randrange(n) for n in (1, 2, 3, 4, 7, 1000, 2**31, 2**33, 2**40 + 1)]`
    /// and `random.getrandbits(64)`.
    #[test]
    fn numbers_are_those_of_cpython() {
        let bounds = [1, 2, 3, 4, 7, 1000, 1 << 31, 1 << 33, (1 << 40) + 1];
        let printed = [
            (
                0,
                [0, 1, 0, 2, 4, 497, 1739178872, 7859158368, 1052128689543],
                10761499191158579119,
            ),
            (
                7,
                [0, 0, 1, 0, 0, 840, 404285457, 2179419893, 189139603672],
                7713914763314685786,
            ),
            (
                42,
                [0, 0, 2, 2, 1, 228, 599310825, 3163119785, 70531617177],
                1728372192399379054,
            ),
            (
                4294967295,
                [0, 0, 2, 2, 4, 348, 1636881668, 8113841992, 904078697522],
                4002527899418901179,
            ),
            (
                4294967296,
                [0, 1, 1, 0, 0, 626, 1423829729, 8567278949, 300707833000],
                15097901349710719040,
            ),
            (
                18446744073709551615,
                [0, 0, 1, 1, 3, 629, 408097150, 3189129643, 424072724304],
                9820843617686605218,
            ),
        ];
        for (seed, below, bits) in printed {
            let mut random = PythonRandom::new(seed);
            assert_eq!(bounds.map(|bound| random.below(bound)), below, "{seed}");
            assert_eq!(random.bits(64), bits, "{seed}");
        }
    }
}
