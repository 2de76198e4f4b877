//! Ways to choose a neighbourhood, drawn the more often the more they have led to (adaptive large neighbourhood search).

use fleetyard_plugin_spacetime::random::Random;

/// Weights of so many ways.
#[derive(Debug)]
pub(super) struct Weights<const N: usize> {
    weights: [f64; N],
    reaction: f64,
}

impl<const N: usize> Weights<N> {
    /// All alike. They follow success at this rate.
    pub(super) fn new(reaction: f64) -> Self {
        Self {
            weights: [1.0; N],
            reaction,
        }
    }

    /// A way, with a probability in proportion to its weight.
    pub(super) fn draw(&self, random: &mut Random) -> usize {
        let total: f64 = self.weights.iter().sum();
        let mut left = total * random.below(1 << 24) as f64 / f64::from(1 << 24);
        let found = self.weights.iter().position(|weight| {
            left -= weight;
            left < 0.0
        });
        found.unwrap_or(0)
    }

    /// Takes note of the gain of a way.
    pub(super) fn learn(&mut self, way: usize, gain: f64) {
        let weight = &mut self.weights[way];
        *weight = self.reaction * gain + (1.0 - self.reaction) * *weight;
    }
}
