//! Places drawn in free space, apart from each other.

use fleetyard_world::SeededRandom;
use rstar::RTree;

use super::builder::Sampling;
use crate::Free;

/// Candidates in a row that are too near to others before the distance shrinks.
const PATIENCE: u32 = 300;

/// By how much it shrinks.
const SHRINK: f64 = 0.9;

/// Candidates in a row that are not free before the space counts as full of obstacles.
const HOPELESS: u32 = 1 << 20;

/// The free space of a disc, and the seed of what is drawn in it.
pub(super) struct Space<'a> {
    pub(super) free: &'a Free,
    pub(super) radius_m: f64,
    pub(super) seed: u64,
}

impl Space<'_> {
    /// Appends `count` places to `at_m`, each at least `spacing_m` from all others. Where that finds no
    /// room the distance shrinks; the least that was asked for is returned.
    pub(super) fn draw(
        &self,
        sampling: Sampling,
        count: usize,
        mut spacing_m: f64,
        at_m: &mut Vec<[f64; 2]>,
    ) -> Result<f64, String> {
        let bounds = self.free.bounds();
        let mut candidates = Candidates::new(sampling, self.seed);
        let mut near = RTree::bulk_load(at_m.clone());
        let (mut blocked, mut crowded) = (0, 0);
        let end = at_m.len() + count;
        while at_m.len() < end {
            let share = candidates.next();
            let at = [0, 1].map(|axis| {
                let low = bounds.min[axis] + self.radius_m;
                let room = bounds.max[axis] - self.radius_m - low;
                low + share[axis] * room
            });
            if !self.free.holds(at, self.radius_m) {
                blocked += 1;
                if blocked == HOPELESS {
                    return Err(format!(
                        "of {HOPELESS} places in a row none has room for a disc of {} m",
                        self.radius_m
                    ));
                }
                continue;
            }
            blocked = 0;
            let square = spacing_m * spacing_m;
            let nearest = near.nearest_neighbor(&at);
            let is_crowded = nearest.is_some_and(|[x, y]| {
                let (x, y) = (x - at[0], y - at[1]);
                let square_to = x * x + y * y;
                // Never two vertices at one place.
                square_to < square || square_to == 0.0
            });
            if is_crowded {
                crowded += 1;
                if crowded == PATIENCE {
                    spacing_m *= SHRINK;
                    crowded = 0;
                }
                continue;
            }
            crowded = 0;
            near.insert(at);
            at_m.push(at);
        }
        Ok(spacing_m)
    }
}

/// Places in the unit square.
enum Candidates {
    Uniform(Box<SeededRandom>),
    Halton { number: u64, shift: [f64; 2] },
}

impl Candidates {
    fn new(sampling: Sampling, seed: u64) -> Self {
        let mut random = SeededRandom::new("roadmap", seed);
        match sampling {
            Sampling::Uniform => Self::Uniform(Box::new(random)),
            Sampling::Halton => Self::Halton {
                number: 0,
                shift: [random.unit(), random.unit()],
            },
        }
    }

    fn next(&mut self) -> [f64; 2] {
        match self {
            Self::Uniform(random) => [random.unit(), random.unit()],
            Self::Halton { number, shift } => {
                *number += 1;
                let place = halton(*number);
                [0, 1].map(|axis| (place[axis] + shift[axis]).fract())
            }
        }
    }
}

/// Number `number` of the Halton sequence of bases 2 and 3.
pub(super) fn halton(number: u64) -> [f64; 2] {
    [2, 3].map(|base| {
        let (mut rest, mut share, mut value) = (number, 1.0, 0.0);
        while rest > 0 {
            share /= base as f64;
            value += (rest % base) as f64 * share;
            rest /= base;
        }
        value
    })
}
