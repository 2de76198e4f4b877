//! Pairs of boxes that overlap: bins over the plane, kept in a hash table of fixed layout, so that
//! neither the size of the world nor a body far away matters.

use crate::Bounds;

/// Finds the pairs of overlapping boxes. Buffers are kept between calls.
#[derive(Debug, Default)]
pub(super) struct Near {
    /// The bins of the lower left and upper right corner of every box.
    bins: Vec<[i64; 4]>,
    starts: Vec<u32>,
    entries: Vec<Entry>,
}

#[derive(Debug, Clone, Copy, Default)]
struct Entry {
    x: i64,
    y: i64,
    body: u32,
}

impl Near {
    /// Calls `visit` once for every pair of boxes that overlap or touch, the
    /// lower index first, in an order that depends on nothing but the boxes.
    ///
    /// Takes time linear in the number of boxes and of pairs that share a bin,
    /// the bins being about twice as wide as the mean box.
    pub(super) fn pairs(&mut self, boxes: &[Bounds], mut visit: impl FnMut(usize, usize)) {
        if boxes.len() < 2 {
            return;
        }
        let extent = |bounds: &Bounds| {
            0.5 * ((bounds.max[0] - bounds.min[0]) + (bounds.max[1] - bounds.min[1]))
        };
        let mean = boxes.iter().map(extent).sum::<f64>() / boxes.len() as f64;
        let mut side = (2.0 * mean).max(f64::MIN_POSITIVE);
        // A few boxes may be much larger than the others.
        let most = 16 * boxes.len() as u64;
        while self.assign(boxes, side) > most {
            side *= 2.0;
        }
        self.sort();
        for bucket in self.starts.windows(2) {
            let entries = &self.entries[bucket[0] as usize..bucket[1] as usize];
            for (at, one) in entries.iter().enumerate() {
                for two in &entries[at + 1..] {
                    if (one.x, one.y) != (two.x, two.y) {
                        continue;
                    }
                    let (i, j) = (one.body as usize, two.body as usize);
                    let (p, q) = (&boxes[i], &boxes[j]);
                    let overlap = p.min[0] <= q.max[0]
                        && q.min[0] <= p.max[0]
                        && p.min[1] <= q.max[1]
                        && q.min[1] <= p.max[1];
                    // Of the bins that two boxes share, the lowest counts.
                    let (p, q) = (&self.bins[i], &self.bins[j]);
                    if overlap && (p[0].max(q[0]), p[1].max(q[1])) == (one.x, one.y) {
                        visit(i.min(j), i.max(j));
                    }
                }
            }
        }
    }

    /// Finds the bins of every box and how many there are in all.
    fn assign(&mut self, boxes: &[Bounds], side: f64) -> u64 {
        let bin = |value: f64| (value / side).floor() as i64;
        self.bins.clear();
        let bins = boxes.iter().map(|bounds| {
            let ([left, bottom], [right, top]) = (bounds.min, bounds.max);
            [bin(left), bin(bottom), bin(right), bin(top)]
        });
        self.bins.extend(bins);
        let count = |bins: &[i64; 4]| {
            let (x, y) = (bins[2].abs_diff(bins[0]), bins[3].abs_diff(bins[1]));
            x.saturating_add(1).saturating_mul(y.saturating_add(1))
        };
        self.bins.iter().map(count).fold(0, u64::saturating_add)
    }

    /// Puts the boxes into the buckets of their bins, by counting.
    fn sort(&mut self) {
        let buckets = (2 * self.bins.len()).next_power_of_two();
        let bucket = |x: i64, y: i64| {
            let mixed = (x as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15)
                ^ (y as u64).wrapping_mul(0xc2b2_ae3d_27d4_eb4f);
            (mixed ^ (mixed >> 29)) as usize & (buckets - 1)
        };
        self.starts.clear();
        self.starts.resize(buckets + 1, 0);
        for bins in &self.bins {
            for y in bins[1]..=bins[3] {
                for x in bins[0]..=bins[2] {
                    self.starts[bucket(x, y) + 1] += 1;
                }
            }
        }
        for at in 1..self.starts.len() {
            self.starts[at] += self.starts[at - 1];
        }
        let count = self.starts[buckets] as usize;
        self.entries.clear();
        self.entries.resize(count, Entry::default());
        // Filling a bucket moves its start to its end, which is where the next
        // one begins.
        for (body, bins) in self.bins.iter().enumerate() {
            for y in bins[1]..=bins[3] {
                for x in bins[0]..=bins[2] {
                    let slot = &mut self.starts[bucket(x, y)];
                    let body = body as u32;
                    self.entries[*slot as usize] = Entry { x, y, body };
                    *slot += 1;
                }
            }
        }
        self.starts.rotate_right(1);
        self.starts[0] = 0;
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// Every overlapping pair, and each once, whatever the sizes.
        #[test]
        fn pairs_are_complete(
            boxes in proptest::collection::vec(
                (-9.0..9.0f64, -9.0..9.0f64, 0.0..1.0f64, 0.0..1.0f64, 0..20u8), 0..60,
            ),
        ) {
            let boxes: Vec<Bounds> = boxes
                .iter()
                .map(|(x, y, width, height, kind)| {
                    let (scale, shift) = match kind {
                        0 => (100.0, 0.0),
                        1 => (1.0, 1e9),
                        2 => (0.0, 0.0),
                        _ => (1.0, 0.0),
                    };
                    let min = [x + shift, y + shift];
                    Bounds { min, max: [min[0] + scale * width, min[1] + scale * height] }
                })
                .collect();
            let mut found = Vec::new();
            Near::default().pairs(&boxes, |i, j| found.push((i, j)));
            let set: BTreeSet<(usize, usize)> = found.iter().copied().collect();
            prop_assert_eq!(set.len(), found.len());
            for (j, q) in boxes.iter().enumerate() {
                for (i, p) in boxes[..j].iter().enumerate() {
                    let overlap = (0..2).all(|axis| {
                        p.min[axis] <= q.max[axis] && q.min[axis] <= p.max[axis]
                    });
                    prop_assert_eq!(overlap, set.contains(&(i, j)));
                }
            }
        }
    }
}
