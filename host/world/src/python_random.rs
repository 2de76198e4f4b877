//! The random numbers of Python's `random` module, for mazes that others drew with it.

use rand_mt::Mt;

/// The random numbers of `random.Random(seed)` of CPython: the Mersenne Twister MT19937 (Matsumoto
/// and Nishimura 1998), seeded by its own key-array method with the 32-bit digits of the seed,
/// lowest first.
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
                [
                    0,
                    1,
                    0,
                    2,
                    4,
                    497,
                    1_739_178_872,
                    7_859_158_368,
                    1_052_128_689_543,
                ],
                10_761_499_191_158_579_119,
            ),
            (
                7,
                [
                    0,
                    0,
                    1,
                    0,
                    0,
                    840,
                    404_285_457,
                    2_179_419_893,
                    189_139_603_672,
                ],
                7_713_914_763_314_685_786,
            ),
            (
                42,
                [
                    0,
                    0,
                    2,
                    2,
                    1,
                    228,
                    599_310_825,
                    3_163_119_785,
                    70_531_617_177,
                ],
                1_728_372_192_399_379_054,
            ),
            (
                4_294_967_295,
                [
                    0,
                    0,
                    2,
                    2,
                    4,
                    348,
                    1_636_881_668,
                    8_113_841_992,
                    904_078_697_522,
                ],
                4_002_527_899_418_901_179,
            ),
            (
                4_294_967_296,
                [
                    0,
                    1,
                    1,
                    0,
                    0,
                    626,
                    1_423_829_729,
                    8_567_278_949,
                    300_707_833_000,
                ],
                15_097_901_349_710_719_040,
            ),
            (
                18_446_744_073_709_551_615,
                [
                    0,
                    0,
                    1,
                    1,
                    3,
                    629,
                    408_097_150,
                    3_189_129_643,
                    424_072_724_304,
                ],
                9_820_843_617_686_605_218,
            ),
        ];
        for (seed, below, bits) in printed {
            let mut random = PythonRandom::new(seed);
            assert_eq!(bounds.map(|bound| random.below(bound)), below, "{seed}");
            assert_eq!(random.bits(64), bits, "{seed}");
        }
    }
}
