//! Distances between any two places of a map, with no search per goal.
//!
//! The map is cut in two along a row or a column of cells, both parts again, and so on down
//! to parts of a few cells. The label of a place lists, for every part that it lies in, from
//! the map to the smallest, its distance to each cell of that part's cut on ways within the
//! part. Two places share the parts from the map down to one whose cut is between them; a
//! shortest way between them lies within one of these parts and crosses its cut, so the
//! distance is the least sum of an entry of one label and the same entry of the other.
//!
//! C. Gavoille, D. Peleg, S. Pérennes, R. Raz, "Distance labeling in graphs", Journal of
//! Algorithms 53 (2004): on maps of n cells labels have O(√n) entries. In a warehouse, where
//! shelves make most of a cut, they are short: 170 entries on one of 38,643 cells.

use std::ops::Range;

use crate::graph::{DIRECTIONS, Graph, Vertex};

/// Entry of a cell that cannot be reached within the part.
const FAR: u16 = u16::MAX;
/// The largest distance of an entry, so that no sum of two is taken for [`FAR`].
const LONGEST: u16 = FAR / 2;
/// Parts of so many cells are not cut: all their cells count as the cut.
const SMALL: usize = 16;
/// The map, as a part. The halves of part `p` are `2 * p` and `2 * p + 1`.
const MAP: u32 = 1;

/// A way is longer than labels can say.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TooFar;

/// The labels of a map.
#[derive(Debug)]
pub struct Labels {
    /// The part whose cut a vertex is on.
    part: Vec<u32>,
    /// Per part, where its entries end in the labels of those on its cut and beyond.
    ends: Vec<u32>,
    /// Index of the first entry of a vertex's label.
    starts: Vec<usize>,
    /// Number of entries when complete.
    length: usize,
    entries: Vec<u16>,
    /// Vertices by part: the cut first, then the halves.
    order: Vec<Vertex>,
    /// Parts whose entries are still to be made.
    todo: Vec<Part>,
}

#[derive(Debug)]
struct Part {
    number: u32,
    /// Its place in [`Labels::order`].
    place: Range<usize>,
    /// Number of its vertices that are in the cut, and of those whose entries are made.
    cut: usize,
    made: usize,
}

impl Labels {
    /// Cuts the map. Entries are made by [`complete`](Self::complete).
    pub fn new(graph: &Graph) -> Self {
        let mut cutter = Cutter::new(graph);
        let mut order: Vec<Vertex> = (0..graph.len() as Vertex).collect();
        let mut part = vec![0; graph.len()];
        let (mut ends, mut todo) = (Vec::new(), Vec::new());
        let mut stack = vec![(MAP, 0..graph.len(), 0)];
        while let Some((number, place, above)) = stack.pop() {
            let (cut, half) = cutter.cut(&mut order[place.clone()]);
            let end = above + cut as u32;
            if ends.len() <= number as usize {
                ends.resize(number as usize + 1, 0);
            }
            ends[number as usize] = end;
            let (first, second) = (place.start + cut, place.start + cut + half);
            for &v in &order[place.start..first] {
                part[v as usize] = number;
            }
            for (number, half) in [
                (2 * number + 1, second..place.end),
                (2 * number, first..second),
            ] {
                if !half.is_empty() {
                    stack.push((number, half, end));
                }
            }
            let made = 0;
            todo.push(Part {
                number,
                place,
                cut,
                made,
            });
        }
        // Parts are taken from the end.
        todo.reverse();
        // Neighbours lie beside each other in memory.
        let mut starts = vec![0; graph.len()];
        let mut length = 0;
        for &v in &order {
            starts[v as usize] = length;
            length += ends[part[v as usize] as usize] as usize;
        }
        Self {
            part,
            ends,
            starts,
            length,
            entries: Vec::new(),
            order,
            todo,
        }
    }

    /// Bytes that the labels take when they are complete.
    pub fn bytes(&self) -> u64 {
        let entries = self.length * size_of::<u16>();
        let vertices = self.part.len() * (size_of::<u32>() + size_of::<usize>());
        (entries + vertices + self.ends.len() * size_of::<u32>()) as u64
    }

    /// True if nothing is left to be done.
    pub fn is_complete(&self) -> bool {
        self.todo.is_empty()
    }

    /// Makes the entries, or goes on with them; false when `stop`, which is asked between searches
    /// through a part, has prevented it.
    pub fn complete(
        &mut self,
        graph: &Graph,
        stop: &mut dyn FnMut() -> bool,
    ) -> Result<bool, TooFar> {
        self.entries.resize(self.length, FAR);
        // Zero for vertices of other parts, and the sentinel: as if they had been visited.
        let mut distance = vec![0; graph.len() + 1];
        let mut queue = Vec::new();
        while let Some(part) = self.todo.last_mut() {
            let inside = &self.order[part.place.clone()];
            let first = self.ends[part.number as usize] as usize - part.cut;
            for (entry, &from) in (first..).zip(&inside[..part.cut]).skip(part.made) {
                if stop() {
                    return Ok(false);
                }
                part.made += 1;
                for &v in inside {
                    distance[v as usize] = FAR;
                }
                search(graph, from, &mut distance, &mut queue)?;
                for &v in inside {
                    self.entries[self.starts[v as usize] + entry] = distance[v as usize];
                }
            }
            for &v in inside {
                distance[v as usize] = 0;
            }
            self.todo.pop();
        }
        self.order = Vec::new();
        Ok(true)
    }

    /// The distance between two vertices; `None` when there is no way. For
    /// [complete](Self::complete) labels.
    #[inline]
    pub fn distance(&self, a: Vertex, b: Vertex) -> Option<u32> {
        let common = common(self.part[a as usize], self.part[b as usize]);
        let length = self.ends[common as usize] as usize;
        let label = |v: Vertex| &self.entries[self.starts[v as usize]..][..length];
        let sums = label(a).iter().zip(label(b));
        let least = sums.fold(FAR, |least, (&a, &b)| least.min(a.saturating_add(b)));
        (least != FAR).then_some(u32::from(least))
    }

    /// The directions from `v`, which is `distance` away from a goal, that lead nearer to
    /// it, a bit each.
    #[inline]
    pub fn directions(&self, graph: &Graph, goal: Vertex, v: Vertex, distance: u32) -> u8 {
        let (around, towards) = (graph.around(v), graph.towards(v, goal));
        // Where the way is as short as can be, it does not become shorter by going away.
        let detour = distance > graph.manhattan(v, goal);
        let possible = |d: usize| around[d] != graph.wall() && (detour || towards[d]);
        let mut left = (0..DIRECTIONS).filter(|d| possible(*d)).count();
        let mut nearer = 0;
        for d in (0..DIRECTIONS).filter(|d| possible(*d)) {
            left -= 1;
            // If no other is nearer, the last has to be.
            let only = nearer == 0 && left == 0 && distance > 0;
            if only
                || self
                    .distance(goal, around[d])
                    .is_some_and(|steps| steps < distance)
            {
                nearer |= 1 << d;
            }
        }
        nearer
    }
}

/// The smallest part that holds two.
#[inline]
fn common(a: u32, b: u32) -> u32 {
    let deeper = a.leading_zeros().abs_diff(b.leading_zeros());
    let (low, high) = (a.min(b), a.max(b) >> deeper);
    low >> (u32::BITS - (low ^ high).leading_zeros())
}

/// Distances from a vertex to all whose distance is [`FAR`] so far.
fn search(
    graph: &Graph,
    from: Vertex,
    distance: &mut [u16],
    queue: &mut Vec<Vertex>,
) -> Result<(), TooFar> {
    queue.clear();
    queue.push(from);
    distance[from as usize] = 0;
    let mut next = 0;
    while let Some(&v) = queue.get(next) {
        next += 1;
        let further = distance[v as usize] + 1;
        for &u in graph.around(v) {
            if distance[u as usize] == FAR {
                if further > LONGEST {
                    return Err(TooFar);
                }
                distance[u as usize] = further;
                queue.push(u);
            }
        }
    }
    Ok(())
}

/// Cuts sets of vertices in two.
struct Cutter {
    /// Row and column of each vertex.
    lines: Vec<[u32; 2]>,
    /// Number of vertices of the set on each line.
    counts: Vec<usize>,
    spare: Vec<Vertex>,
}

impl Cutter {
    fn new(graph: &Graph) -> Self {
        let lines = (0..graph.len() as Vertex).map(|v| graph.place(v));
        Self {
            lines: lines.collect(),
            counts: Vec::new(),
            spare: Vec::new(),
        }
    }

    /// Puts the cut first, then those before it and those after it; gives how many the first
    /// two are. The cut is the row or column that has the fewest cells of those that leave
    /// at most nine in sixteen on either side; there always is one, for one leaves half.
    fn cut(&mut self, set: &mut [Vertex]) -> (usize, usize) {
        if set.len() <= SMALL {
            return (set.len(), 0);
        }
        let most = set.len() * 9 / 16;
        // Cells, larger part, and which line.
        let mut best = (usize::MAX, 0, 0, 0);
        for axis in 0..2 {
            let line = |v: &Vertex| self.lines[*v as usize][axis] as usize;
            let first = set.iter().map(line).min().unwrap_or(0);
            self.counts.clear();
            for line in set.iter().map(line) {
                let line = line - first;
                if self.counts.len() <= line {
                    self.counts.resize(line + 1, 0);
                }
                self.counts[line] += 1;
            }
            let mut before = 0;
            for (line, &cells) in (first..).zip(&self.counts) {
                let larger = before.max(set.len() - before - cells);
                if larger <= most {
                    best = best.min((cells, larger, axis, line));
                }
                before += cells;
            }
        }
        let (cells, _, axis, cut) = best;
        let line = |v: Vertex| self.lines[v as usize][axis] as usize;
        self.spare.clear();
        let vertices = || set.iter().copied();
        self.spare.extend(vertices().filter(|&v| line(v) == cut));
        self.spare.extend(vertices().filter(|&v| line(v) < cut));
        let half = self.spare.len() - cells;
        self.spare.extend(vertices().filter(|&v| line(v) > cut));
        set.copy_from_slice(&self.spare);
        (cells, half)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_distance_is_right() {
        // A spiral, rooms that are cut off, a line, and nothing at all.
        let maps: [&[&str]; 4] = [
            &[
                ".........",
                "########.",
                ".......#.",
                ".#####.#.",
                ".#...#.#.",
                ".#.###.#.",
                ".#.....#.",
                ".#######.",
                ".........",
            ],
            &[
                "...#.....",
                "...#.....",
                "...#.....",
                "####.....",
                "....#....",
            ],
            &["........................................"],
            &["###"],
        ];
        for map in maps {
            let letters = map.iter().flat_map(|row| row.bytes());
            let passable: Vec<bool> = letters.map(|letter| letter == b'.').collect();
            let graph = Graph::new(map.len(), map[0].len(), &passable);
            let mut labels = Labels::new(&graph);
            assert_eq!(labels.complete(&graph, &mut || false), Ok(true));
            for from in 0..graph.len() as Vertex {
                let mut distance = vec![FAR; graph.len()];
                distance.push(0);
                assert_eq!(search(&graph, from, &mut distance, &mut Vec::new()), Ok(()));
                for to in 0..graph.len() as Vertex {
                    let truth = Some(distance[to as usize]).filter(|steps| *steps != FAR);
                    assert_eq!(labels.distance(from, to), truth.map(u32::from));
                }
            }
        }
    }

    #[test]
    fn labels_of_an_open_map_have_entries_for_a_few_of_its_rows() {
        let graph = Graph::new(64, 64, &[true; 64 * 64]);
        let labels = Labels::new(&graph);
        let mean = labels.length / graph.len();
        assert!((64..=256).contains(&mean), "{mean}");
    }
}
