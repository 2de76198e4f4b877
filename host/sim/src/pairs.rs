//! Candidate pairs: agents that can come near each other for a while.
//!
//! A Verlet list over a uniform grid of bins: all pairs within a reach, which is the
//! distance of interest plus the distance that agents can move until the list is rebuilt.
//! The order of the list carries no meaning; consumers reduce it in ways that do not
//! depend on order.

use rayon::prelude::*;

use crate::workers::Workers;

/// The pairs `(i, j)`, i < j, that can come within `range` of each other.
#[derive(Debug, Default)]
pub(crate) struct Pairs {
    list: Vec<(u32, u32)>,
    /// Distance of interest, in metres.
    range: f64,
    /// Remaining travel of every agent before a rebuild.
    allowance: f64,
    built: bool,
    most: usize,
    /// Positions at the last rebuild.
    x: Vec<f64>,
    y: Vec<f64>,
    starts: Vec<u32>,
    order: Vec<u32>,
    bin: Vec<u32>,
}

/// More than the allowed number of pairs.
#[derive(Debug)]
pub(crate) struct TooManyPairs;

impl Pairs {
    pub(crate) fn new(range: f64, most: usize) -> Self {
        Self {
            range,
            most,
            ..Self::default()
        }
    }

    pub(crate) fn list(&self) -> &[(u32, u32)] {
        &self.list
    }

    /// Memory of the list in bytes.
    pub(crate) fn memory_bytes(&self) -> usize {
        let places = self.x.capacity() + self.y.capacity();
        let bins = self.starts.capacity() + self.order.capacity() + self.bin.capacity();
        self.list.capacity() * size_of::<(u32, u32)>()
            + places * size_of::<f64>()
            + bins * size_of::<u32>()
    }

    /// Makes the list valid for a block in which no body moves farther than `travel`,
    /// rebuilding it if necessary. A new list lasts at least until bodies have moved
    /// `horizon`. `places` writes the positions at the start of the block into the two
    /// lists.
    pub(crate) fn cover(
        &mut self,
        workers: Workers,
        places: impl FnOnce(&mut Vec<f64>, &mut Vec<f64>),
        travel: f64,
        horizon: f64,
    ) -> Result<(), TooManyPairs> {
        if !self.built || travel > self.allowance {
            self.x.clear();
            self.y.clear();
            places(&mut self.x, &mut self.y);
            // The slack absorbs the rounding of distances.
            let allowance = travel.max(horizon) * (1.0 + 1e-9);
            self.build(workers, self.range + 2.0 * allowance)?;
            self.allowance = allowance;
            self.built = true;
        }
        self.allowance -= travel;
        Ok(())
    }

    fn build(&mut self, workers: Workers, reach: f64) -> Result<(), TooManyPairs> {
        let reach = reach * (1.0 + 1e-9);
        let (x, y) = (&self.x, &self.y);
        let bounds = |values: &[f64]| {
            values
                .iter()
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| {
                    (low.min(*v), high.max(*v))
                })
        };
        let ((left, right), (bottom, top)) = (bounds(x), bounds(y));
        // Bins no smaller than the reach, and not many more bins than agents.
        let most_bins = (4 * x.len() + 64) as f64;
        let mut side = reach;
        let count = |low: f64, high: f64, side: f64| ((high - low) / side).floor() + 1.0;
        while count(left, right, side) * count(bottom, top, side) > most_bins {
            side *= 2.0;
        }
        let cols = count(left, right, side) as usize;
        let rows = count(bottom, top, side) as usize;

        self.bin.clear();
        self.bin.extend(x.iter().zip(y).map(|(x, y)| {
            let col = (((x - left) / side) as usize).min(cols - 1);
            let row = (((y - bottom) / side) as usize).min(rows - 1);
            (row * cols + col) as u32
        }));
        self.starts.clear();
        self.starts.resize(rows * cols + 1, 0);
        for bin in &self.bin {
            self.starts[*bin as usize + 1] += 1;
        }
        for at in 1..self.starts.len() {
            self.starts[at] += self.starts[at - 1];
        }
        self.order.resize(x.len(), 0);
        let mut next = self.starts.clone();
        for (agent, bin) in self.bin.iter().enumerate() {
            let slot = &mut next[*bin as usize];
            self.order[*slot as usize] = agent as u32;
            *slot += 1;
        }

        let (starts, order) = (&self.starts, &self.order);
        let members = |row: usize, col: usize| {
            let bin = row * cols + col;
            &order[starts[bin] as usize..starts[bin + 1] as usize]
        };
        let limit = reach * reach;
        let most = self.most;
        // Each unordered pair of bins once: the bin itself, east, and the three to the
        // north. Rows are searched separately and their pairs joined in order.
        let search = |row: usize, list: &mut Vec<(u32, u32)>| {
            let mut pair_up = |i: u32, others: &[u32]| {
                let (xi, yi) = (x[i as usize], y[i as usize]);
                for j in others.iter().copied() {
                    let (dx, dy) = (x[j as usize] - xi, y[j as usize] - yi);
                    if dx * dx + dy * dy <= limit {
                        list.push((i.min(j), i.max(j)));
                    }
                }
                list.len() <= most
            };
            for col in 0..cols {
                let own = members(row, col);
                for (at, i) in own.iter().copied().enumerate() {
                    let mut fits = pair_up(i, &own[at + 1..]);
                    if col + 1 < cols {
                        fits &= pair_up(i, members(row, col + 1));
                    }
                    if row + 1 < rows {
                        for near in col.saturating_sub(1)..=(col + 1).min(cols - 1) {
                            fits &= pair_up(i, members(row + 1, near));
                        }
                    }
                    if !fits {
                        return;
                    }
                }
            }
        };
        self.list.clear();
        if workers.are_many() {
            // A few rows per task, to amortise its list.
            let step = rows.div_ceil(8 * workers.count()).max(1);
            let parts: Vec<Vec<(u32, u32)>> = (0..rows.div_ceil(step))
                .into_par_iter()
                .map(|part| {
                    let mut list = Vec::new();
                    for row in part * step..((part + 1) * step).min(rows) {
                        search(row, &mut list);
                    }
                    list
                })
                .collect();
            for part in &parts {
                self.list.extend_from_slice(part);
            }
        } else {
            for row in 0..rows {
                search(row, &mut self.list);
                if self.list.len() > most {
                    break;
                }
            }
        }
        if self.list.len() > most {
            return Err(TooManyPairs);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// Compared with all pairs: none is missing while agents move less than the list
        /// allows, and none occurs twice.
        #[test]
        fn the_list_is_complete(
            places in proptest::collection::vec((0.0..30.0f64, 0.0..3.0f64), 1..60),
            moves in proptest::collection::vec((-0.7..0.7f64, -0.7..0.7f64), 60),
            range in 0.0..5.0f64,
        ) {
            let places = std::cell::RefCell::new(places);
            let workers = Workers::new(1 + usize::from(range > 2.0));
            let gather = |x: &mut Vec<f64>, y: &mut Vec<f64>| {
                for (px, py) in places.borrow().iter() {
                    x.push(*px);
                    y.push(*py);
                }
            };
            let bodies = places.borrow().len();
            let mut pairs = Pairs::new(range, usize::MAX);
            pairs.cover(workers, gather, 0.5, 1.0).unwrap();
            let built = pairs.list().to_vec();
            for (place, (dx, dy)) in places.borrow_mut().iter_mut().zip(&moves) {
                place.0 += dx;
                place.1 += dy;
            }
            // Half of the allowance of 1 m is left and suffices.
            pairs.cover(workers, gather, 0.4, 1.0).unwrap();
            prop_assert_eq!(&built, pairs.list());
            let set: BTreeSet<(u32, u32)> = built.iter().copied().collect();
            prop_assert_eq!(set.len(), built.len());
            for i in 0..bodies {
                for j in i + 1..bodies {
                    let (one, two) = (places.borrow()[i], places.borrow()[j]);
                    let (dx, dy) = (two.0 - one.0, two.1 - one.1);
                    if dx * dx + dy * dy <= range * range {
                        prop_assert!(set.contains(&(i as u32, j as u32)));
                    }
                }
            }
            // Now it does not.
            pairs.cover(workers, gather, 0.4, 1.0).unwrap();
            let mut few = Pairs::new(100.0, 3);
            prop_assert_eq!(few.cover(workers, gather, 0.0, 0.0).is_err(), bodies > 3);
        }
    }
}
