//! Costs of moves, heuristics, and the order in which places are expanded.
//!
//! Costs are counts of moves: one number with four neighbours, straight and diagonal
//! moves apart with eight. So equal costs are equal however they came about, and the
//! order of two different ones is never a matter of rounding: a count becomes the
//! number `straight + diagonal · √2` by one fixed expression, whose error is far
//! below the least difference between two counts.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::f64::consts::SQRT_2;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::grid::{Grid, Neighbors, Place};

/// The cost of a path.
pub(crate) trait Cost:
    Copy + Default + PartialEq + std::fmt::Debug + Send + 'static
{
    /// More than any path costs.
    const FAR: Self;
    /// The cost after so many more moves in a direction.
    fn ahead(self, direction: u8, moves: u32) -> Self;
    /// The cost after one more move.
    #[inline]
    fn step(self, direction: u8) -> Self {
        self.ahead(direction, 1)
    }
    /// The cost of two paths, one after the other.
    fn join(self, other: Self) -> Self;
    /// True if it is less than another.
    fn less(self, other: Self) -> bool;
    /// In cells' sides.
    fn value(self) -> f64;
    /// The cost between two cells that are `rows` and `cols` apart, with nothing in the
    /// way.
    fn estimate(apart: (u32, u32)) -> Self;
}

/// With four neighbours: the number of moves.
impl Cost for u32 {
    const FAR: Self = Self::MAX;

    #[inline]
    fn ahead(self, _: u8, moves: u32) -> Self {
        self + moves
    }

    #[inline]
    fn join(self, other: Self) -> Self {
        self + other
    }

    #[inline]
    fn less(self, other: Self) -> bool {
        self < other
    }

    #[inline]
    fn value(self) -> f64 {
        f64::from(self)
    }

    #[inline]
    fn estimate((rows, cols): (u32, u32)) -> Self {
        rows + cols
    }
}

/// With eight neighbours: straight moves in the low half, diagonal ones in the high
/// half.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Octile(u64);

impl Octile {
    /// So many straight and diagonal moves.
    fn new(straight: u32, diagonal: u32) -> Self {
        Self(u64::from(straight) | u64::from(diagonal) << 32)
    }
}

impl Cost for Octile {
    const FAR: Self = Self(u64::MAX);

    #[inline]
    fn ahead(self, direction: u8, moves: u32) -> Self {
        Self(self.0 + (u64::from(moves) << (u32::from(direction >> 2) * 32)))
    }

    #[inline]
    fn join(self, other: Self) -> Self {
        Self(self.0 + other.0)
    }

    #[inline]
    fn less(self, other: Self) -> bool {
        self != other && self.value() < other.value()
    }

    #[inline]
    fn value(self) -> f64 {
        (self.0 as u32) as f64 + ((self.0 >> 32) as u32) as f64 * SQRT_2
    }

    #[inline]
    fn estimate((rows, cols): (u32, u32)) -> Self {
        Self::new(rows.abs_diff(cols), rows.min(cols))
    }
}

/// An estimate of the cost that is left between two cells that are `rows` and `cols`
/// apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Heuristic {
    /// `rows + cols`. Exact with four neighbours and no obstacles; with eight it
    /// overestimates, and paths need not be shortest.
    Manhattan,
    /// `√(rows² + cols²)`. Never overestimates.
    Euclidean,
    /// `max(rows, cols)`. Never overestimates.
    Chebyshev,
    /// `max − min + √2 · min`. Exact with eight neighbours and no obstacles; never
    /// overestimates.
    Octile,
}

impl Heuristic {
    /// The one that was chosen, or else the one that is exact where nothing is in the
    /// way.
    pub(crate) fn or_fitting(chosen: Option<Self>, grid: &Grid) -> Self {
        chosen.unwrap_or(match grid.neighbors() {
            Neighbors::Four => Self::Manhattan,
            Neighbors::Eight => Self::Octile,
        })
    }

    /// The estimate as a number.
    #[inline]
    pub(crate) fn value(self, (rows, cols): (u32, u32)) -> f64 {
        let (rows, cols) = (f64::from(rows), f64::from(cols));
        match self {
            Self::Manhattan => rows + cols,
            Self::Euclidean => (rows * rows + cols * cols).sqrt(),
            Self::Chebyshev => rows.max(cols),
            Self::Octile => (rows - cols).abs() + rows.min(cols) * SQRT_2,
        }
    }

    /// The estimate where it is a whole number.
    #[inline]
    fn whole(self, (rows, cols): (u32, u32)) -> u32 {
        match self {
            Self::Manhattan => rows + cols,
            _ => rows.max(cols),
        }
    }

    fn is_whole(self) -> bool {
        matches!(self, Self::Manhattan | Self::Chebyshev)
    }
}

/// Tie-breaking: the place that is expanded first among several with the same priority. Ties that
/// remain are expanded in the order in which they were found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum TieBreaking {
    /// The one with the lower estimate.
    LowH,
    /// The one with the higher cost so far.
    HighG,
    /// The one with the lower cost so far.
    LowG,
    /// The one that was found first.
    Fifo,
}

/// An entry of the open list: the least is expanded first.
pub(crate) trait Rank: Copy + Ord + std::fmt::Debug + Send + 'static {
    fn place(self) -> Place;
    /// The priority alone, in an order of its own.
    fn priority(self) -> u64;
}

/// Whole numbers below 2³²: priority, tie, insertion and place side by side, so that
/// one comparison of 128 bits orders two entries.
impl Rank for u128 {
    #[inline]
    fn place(self) -> Place {
        self as u32
    }

    #[inline]
    fn priority(self) -> u64 {
        (self >> 96) as u64
    }
}

/// Any numbers: the bits of non-negative floating-point numbers are ordered as they
/// are. Insertion and place are side by side.
pub(crate) type Exact = (u64, u64, u64);

impl Rank for Exact {
    #[inline]
    fn place(self) -> Place {
        self.2 as u32
    }

    #[inline]
    fn priority(self) -> u64 {
        self.0
    }
}

/// The open list.
pub(crate) type Open<R> = BinaryHeap<Reverse<R>>;

/// Ranks places by `cost · s + estimate · w`.
pub(crate) trait Guide<C> {
    type Rank: Rank;
    fn rank(&self, grid: &Grid, place: Place, cost: C, insertion: u32) -> Self::Rank;
    /// True if a priority is less than that of an end that is reached at a cost.
    fn before(&self, rank: Self::Rank, cost: C) -> bool;
}

/// The parts of the priority of a place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Priority {
    pub(crate) heuristic: Heuristic,
    /// The cost so far is a part of the priority.
    pub(crate) cost: bool,
    /// Factor of the estimate.
    pub(crate) weight: f64,
    pub(crate) ties: TieBreaking,
}

/// Numbers below which sums of two do not overflow.
const HALF: f64 = (1_u32 << 31) as f64;

impl Priority {
    /// In whole numbers, if it can be done exactly: on a map with four neighbours, by
    /// a whole heuristic, with a weight that is a whole number of 256ths.
    pub(crate) fn whole(self, grid: &Grid, goal: Place) -> Option<WholeGuide> {
        let scale = (0..=8).map(|power| 1_u32 << power).find(|scale| {
            let weight = self.weight * f64::from(*scale);
            weight.fract() == 0.0
        })?;
        let weight = self.weight * f64::from(scale);
        let most_cost = f64::from(scale) * grid.places() as f64;
        let most_left = weight * f64::from(grid.rows() + grid.cols());
        let fits = most_cost < HALF && most_left < HALF;
        (fits && (self.heuristic.is_whole() || self.weight == 0.0)).then_some(WholeGuide {
            goal,
            heuristic: self.heuristic,
            cost: if self.cost { scale } else { 0 },
            weight: weight as u32,
            ties: self.ties,
        })
    }

    /// In floating-point numbers.
    pub(crate) fn exact(self, goal: Place) -> ExactGuide {
        ExactGuide {
            goal,
            priority: self,
        }
    }
}

pub(crate) struct WholeGuide {
    goal: Place,
    heuristic: Heuristic,
    cost: u32,
    weight: u32,
    ties: TieBreaking,
}

impl Guide<u32> for WholeGuide {
    type Rank = u128;

    #[inline]
    fn rank(&self, grid: &Grid, place: Place, cost: u32, insertion: u32) -> u128 {
        let left = self.heuristic.whole(grid.apart(place, self.goal));
        let priority = cost * self.cost + left * self.weight;
        let tie = match self.ties {
            TieBreaking::LowH => left,
            TieBreaking::HighG => !cost,
            TieBreaking::LowG => cost,
            TieBreaking::Fifo => 0,
        };
        let high = u64::from(priority) << 32 | u64::from(tie);
        let low = u64::from(insertion) << 32 | u64::from(place);
        u128::from(high) << 64 | u128::from(low)
    }

    #[inline]
    fn before(&self, rank: u128, cost: u32) -> bool {
        rank.priority() < u64::from(cost * self.cost)
    }
}

pub(crate) struct ExactGuide {
    goal: Place,
    priority: Priority,
}

impl<C: Cost> Guide<C> for ExactGuide {
    type Rank = Exact;

    #[inline]
    fn rank(&self, grid: &Grid, place: Place, cost: C, insertion: u32) -> Exact {
        let Priority {
            heuristic,
            cost: counts,
            weight,
            ties,
        } = self.priority;
        let left = heuristic.value(grid.apart(place, self.goal));
        let cost = cost.value();
        let so_far = if counts { cost } else { 0.0 };
        let priority = so_far + weight * left;
        let tie = match ties {
            TieBreaking::LowH => left.to_bits(),
            TieBreaking::HighG => !cost.to_bits(),
            TieBreaking::LowG => cost.to_bits(),
            TieBreaking::Fifo => 0,
        };
        let last = u64::from(insertion) << 32 | u64::from(place);
        (priority.to_bits(), tie, last)
    }

    #[inline]
    fn before(&self, rank: Exact, cost: C) -> bool {
        f64::from_bits(rank.0) < cost.value()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn octile_costs_are_counts() {
        let one = Octile::default().step(0).step(4).step(7);
        assert_eq!(one, Octile::new(1, 2));
        assert_eq!(one.join(one), Octile::new(2, 4));
        // 7 − 5√2 is about −0.071: close, and far from the rounding.
        assert!(Octile::new(7, 0).less(Octile::new(0, 5)));
        // 1393 / 985 is a convergent of √2 from below.
        assert!(Octile::new(1393, 0).less(Octile::new(0, 985)));
        assert!(!one.less(one));
    }

    #[test]
    fn heuristics_are_in_order() {
        for rows in 0..9 {
            for cols in 0..9 {
                let [chebyshev, euclidean, octile, manhattan] = [
                    Heuristic::Chebyshev,
                    Heuristic::Euclidean,
                    Heuristic::Octile,
                    Heuristic::Manhattan,
                ]
                .map(|heuristic| heuristic.value((rows, cols)));
                assert!(chebyshev <= euclidean && octile <= manhattan + 1e-12);
                assert!(euclidean <= octile + 1e-12);
            }
        }
    }

    #[test]
    fn weights_become_whole_where_they_are() {
        let grid = Grid::new(2, 2, &[true; 4], Neighbors::Four).expect("a grid");
        let priority = |heuristic, weight| Priority {
            heuristic,
            cost: true,
            weight,
            ties: TieBreaking::Fifo,
        };
        let whole = |heuristic, weight| priority(heuristic, weight).whole(&grid, grid.place(0));
        let found = whole(Heuristic::Manhattan, 1.5).map(|guide| (guide.cost, guide.weight));
        assert_eq!(found, Some((2, 3)));
        assert!(whole(Heuristic::Manhattan, 1.1).is_none());
        assert!(whole(Heuristic::Manhattan, 1e30).is_none());
        assert!(whole(Heuristic::Euclidean, 1.0).is_none());
        assert!(whole(Heuristic::Euclidean, 0.0).is_some());
    }
}
