//! Things of the plane by place: square tiles, and which boxes overlap an area.
//!
//! This is for what stands. What moves is sorted anew all the time and is looked for in
//! pairs: [`exact`](crate::exact) hashes boxes that may be anywhere, and the simulator's
//! candidate pairs are points whose rows are searched by several threads.

use crate::{Bounds, Shape};

/// Square tiles over a box, in rows from the lower left corner on. What lies beyond belongs
/// to the nearest tile.
#[derive(Debug, Clone, Copy, Default)]
pub struct Tiles {
    min: [f64; 2],
    side_m: f64,
    /// Number of columns and of rows.
    size: [usize; 2],
}

impl Tiles {
    /// Tiles over a box; the side is above 0.
    pub fn new(bounds: Bounds, side_m: f64) -> Self {
        let count = |axis: usize| ((bounds.max[axis] - bounds.min[axis]) / side_m) as usize + 1;
        Self {
            min: bounds.min,
            side_m,
            size: [count(0), count(1)],
        }
    }

    /// Number of columns and of rows.
    pub fn size(&self) -> [usize; 2] {
        self.size
    }

    /// The side of a tile in metres.
    pub fn side_m(&self) -> f64 {
        self.side_m
    }

    /// The column (axis 0) or row (axis 1) of a coordinate.
    pub fn index(&self, axis: usize, value: f64) -> usize {
        // Below 0 becomes 0.
        let at = ((value - self.min[axis]) / self.side_m) as usize;
        at.min(self.size[axis] - 1)
    }

    /// The coordinate at which a column (axis 0) or a row (axis 1) begins.
    pub fn begin(&self, axis: usize, index: usize) -> f64 {
        self.min[axis] + index as f64 * self.side_m
    }

    /// The tiles that an area overlaps, by number.
    fn each(&self, area: Bounds) -> impl Iterator<Item = usize> {
        let [cols, rows] =
            [0, 1].map(|axis| self.index(axis, area.min[axis])..=self.index(axis, area.max[axis]));
        let width = self.size[0];
        rows.flat_map(move |row| cols.clone().map(move |col| row * width + col))
    }
}

/// Numbers in lists, one list after the other.
#[derive(Debug, Clone, Default)]
pub struct Lists {
    offsets: Vec<u32>,
    entries: Vec<u32>,
}

impl Lists {
    /// So many lists, from pairs of a list and a number in it. Each list ascends.
    pub fn new(count: usize, mut pairs: Vec<(u32, u32)>) -> Self {
        pairs.sort_unstable();
        let mut offsets = vec![0; count + 1];
        for (list, _) in &pairs {
            offsets[*list as usize + 1] += 1;
        }
        for at in 0..count {
            offsets[at + 1] += offsets[at];
        }
        Self {
            offsets,
            entries: pairs.into_iter().map(|(_, entry)| entry).collect(),
        }
    }

    /// One list.
    pub fn get(&self, list: usize) -> &[u32] {
        &self.entries[self.offsets[list] as usize..self.offsets[list + 1] as usize]
    }
}

/// Boxes that stay where they are, in tiles that they overlap.
#[derive(Debug, Clone, Default)]
pub struct BoxIndex {
    boxes: Vec<Bounds>,
    tiles: Tiles,
    of_tile: Lists,
}

impl BoxIndex {
    /// Sorts boxes, in time linear in their number for boxes of about one size.
    pub fn new(boxes: Vec<Bounds>) -> Self {
        let Some(whole) = boxes.iter().copied().reduce(Bounds::with) else {
            return Self::default();
        };
        // Tiles as large as the mean box, but not many more than there are boxes.
        let sides = |bounds: &Bounds| [0, 1].map(|axis| bounds.max[axis] - bounds.min[axis]);
        let extents = boxes.iter().map(|bounds| {
            let [width, height] = sides(bounds);
            0.5 * (width + height)
        });
        let count = boxes.len() as f64;
        let [width, height] = sides(&whole);
        let fewest = (width.max(height) / 1024.0).max((width * height / (4.0 * count)).sqrt());
        let mean = extents.sum::<f64>() / count;
        let tiles = Tiles::new(whole, mean.max(fewest).max(Shape::RESOLUTION_M));
        let mut pairs = Vec::new();
        for (number, bounds) in (0..).zip(&boxes) {
            pairs.extend(tiles.each(*bounds).map(|tile| (tile as u32, number)));
        }
        Self {
            of_tile: Lists::new(tiles.size[0] * tiles.size[1], pairs),
            boxes,
            tiles,
        }
    }

    /// Appends the boxes that overlap or touch an area to an empty list, each once, in order.
    pub fn near(&self, area: Bounds, found: &mut Vec<u32>) {
        if self.boxes.is_empty() {
            return;
        }
        for tile in self.tiles.each(area) {
            let boxes = self.of_tile.get(tile).iter().copied();
            found.extend(boxes.filter(|number| self.boxes[*number as usize].meets(area)));
        }
        found.sort_unstable();
        found.dedup();
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn any_box() -> impl Strategy<Value = Bounds> {
        let side = || prop_oneof![Just(0.0), 0.0..2.0f64, Just(40.0)];
        (-9.0..9.0f64, -9.0..9.0f64, side(), side()).prop_map(|(x, y, width, height)| Bounds {
            min: [x, y],
            max: [x + width, y + height],
        })
    }

    proptest! {
        /// Exactly the boxes that overlap an area are found, far away from all of them too.
        #[test]
        fn what_overlaps_is_found(
            boxes in proptest::collection::vec(any_box(), 0..40), area in any_box(), far in 0..3u8,
        ) {
            let shift = f64::from(far) * 15.0;
            let area = Bounds { min: area.min.map(|v| v + shift), max: area.max.map(|v| v + shift) };
            let mut found = Vec::new();
            BoxIndex::new(boxes.clone()).near(area, &mut found);
            let overlaps = |bounds: &Bounds| (0..2).all(|axis| {
                bounds.min[axis] <= area.max[axis] && area.min[axis] <= bounds.max[axis]
            });
            let expected = (0..).zip(&boxes).filter(|(_, bounds)| overlaps(bounds));
            prop_assert_eq!(found, expected.map(|(number, _)| number).collect::<Vec<u32>>());
        }
    }
}
