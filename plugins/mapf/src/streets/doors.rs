//! One-way doors: passages between rooms that lanes leave open in both directions.
//!
//! Two crowds that meet at a door hold each other up, so a door had better lead one way where others
//! lead back. H. E. Robbins, "A theorem on graphs, with an application to a problem of traffic
//! control", American Mathematical Monthly 46 (1939): the streets of a town can all be made one-way
//! exactly if no single one of them holds it together; F. Boesch and R. Tindell, "Robbins's theorem
//! for mixed multigraphs", ibid. 87 (1980): also where some are one-way already, and whichever of the
//! others comes first. Among the choices the one is taken that makes ways between doors shortest, by
//! giving doors their directions one after the other, and turning single ones round as long as that
//! helps.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use fleetyard_plugin_spacetime::digraph::Digraph;
use fleetyard_plugin_spacetime::graph::{Graph, Vertex};

use super::passages::Passage;

/// Ends of doors that a search may look at, all searches together; doors for which it does not
/// suffice stay open in both directions.
const WORK: u64 = 100_000_000;
/// Cells of a way that there is not.
const NO_WAY: u64 = 1 << 32;

/// The directions of doors.
#[derive(Debug, Default)]
pub(super) struct Doors {
    /// Per vertex the directions of moves that are against a door, a bit each.
    against: Box<[u8]>,
    /// Per vertex the directions of moves along one.
    along: Box<[u8]>,
}

impl Doors {
    /// Gives directions to passages between parts of a map, of whose moves `may` says if they are
    /// allowed as it is.
    pub(super) fn new(
        graph: &Graph,
        passages: &[Passage],
        may: impl Fn(Vertex, usize) -> bool,
    ) -> Self {
        let mut doors = Self {
            against: vec![0; graph.len()].into(),
            along: vec![0; graph.len()].into(),
        };
        let mut town = Town::new(graph, passages, may);
        for (number, end) in town.direct() {
            let passage = &passages[number];
            for (v, d) in passage.through(graph, end) {
                doors.along[v as usize] |= 1 << d;
            }
            for (v, d) in passage.through(graph, 1 - end) {
                doors.against[v as usize] |= 1 << d;
            }
        }
        doors
    }

    /// True if the move from `v` in direction `d` is against a door.
    #[inline]
    pub(super) fn is_barred(&self, v: Vertex, d: usize) -> bool {
        has(&self.against, v, d)
    }

    /// True if the move from `v` in direction `d` is along a door.
    #[inline]
    pub(super) fn leads(&self, v: Vertex, d: usize) -> bool {
        has(&self.along, v, d)
    }
}

fn has(directions: &[u8], v: Vertex, d: usize) -> bool {
    directions
        .get(v as usize)
        .is_some_and(|bits| bits >> d & 1 == 1)
}

/// A way between two regions: a passage, or moves that lead one way.
#[derive(Debug)]
struct Link {
    /// The cells before its ends, and the regions that they are in.
    mouths: [Vertex; 2],
    regions: [u32; 2],
    moves: u64,
    /// The ends at which agents may enter.
    open: [bool; 2],
    /// The passage, unless its direction is given.
    passage: Option<usize>,
}

/// Regions, from everywhere in which one gets everywhere else without a passage, and what leads
/// between them.
#[derive(Debug)]
struct Town<'g> {
    graph: &'g Graph,
    links: Vec<Link>,
    /// Per region the ends of links there: those of link `i` are `2 i` and `2 i + 1`.
    ends: Vec<Vec<u32>>,
    work: u64,
}

impl<'g> Town<'g> {
    fn new(graph: &'g Graph, passages: &[Passage], may: impl Fn(Vertex, usize) -> bool) -> Self {
        let mut inside = vec![false; graph.len()];
        let through = passages.iter().filter(|passage| !passage.is_dead_end());
        for cell in through.flat_map(|passage| &passage.cells) {
            inside[*cell as usize] = true;
        }
        let regions = Digraph::new(graph, |v, d| {
            let u = graph.around(v)[d];
            !inside[v as usize] && !inside[u as usize] && may(v, d)
        });
        let region = regions.components();
        let mut links: Vec<Link> = Vec::new();
        for (number, passage) in passages.iter().enumerate() {
            if passage.is_dead_end() {
                continue;
            }
            let open = [0, 1].map(|end| {
                let way = passage.through(graph, end);
                way.iter().all(|(v, d)| may(*v, *d))
            });
            let regions = passage.mouths.map(|mouth| region[mouth as usize]);
            links.push(Link {
                mouths: passage.mouths,
                regions,
                moves: passage.cells.len() as u64 + 1,
                open,
                passage: Some(number).filter(|_| open == [true; 2] && regions[0] != regions[1]),
            });
        }
        for v in 0..graph.len() as Vertex {
            for (d, &u) in graph.around(v).iter().enumerate() {
                let leads = u != graph.wall() && !inside[v as usize] && !inside[u as usize];
                if leads && may(v, d) && region[v as usize] != region[u as usize] {
                    links.push(Link {
                        mouths: [v, u],
                        regions: [v, u].map(|v| region[v as usize]),
                        moves: 1,
                        open: [true, false],
                        passage: None,
                    });
                }
            }
        }
        let count = region.iter().max().map_or(0, |most| *most as usize + 1);
        let mut ends = vec![Vec::new(); count];
        for (number, link) in (0_u32..).zip(&links) {
            for end in [0, 1] {
                ends[link.regions[end] as usize].push(2 * number + end as u32);
            }
        }
        Self {
            graph,
            links,
            ends,
            work: WORK,
        }
    }

    /// Gives doors their directions; gives the passages that have one, with the end at which agents
    /// enter.
    fn direct(&mut self) -> Vec<(usize, usize)> {
        let doors: Vec<usize> = (0..self.links.len())
            .filter(|link| self.links[*link].passage.is_some())
            .collect();
        if doors.is_empty() {
            return Vec::new();
        }
        let Some((missing, _)) = self.ways() else {
            return Vec::new();
        };
        let mut best = (missing, u64::MAX);
        loop {
            let mut changed = false;
            for &door in &doors {
                let before = self.links[door].open;
                let mut chosen = before;
                for open in [[true, false], [false, true]] {
                    if open == before {
                        continue;
                    }
                    self.links[door].open = open;
                    let Some(ways) = self.ways() else {
                        break;
                    };
                    // Whatever it costs, a door gets a direction if all can still be reached.
                    let first = chosen == [true; 2] && ways.0 == best.0;
                    if first || ways < best {
                        best = ways;
                        chosen = open;
                        changed = true;
                    }
                }
                self.links[door].open = chosen;
            }
            if !changed || self.work == 0 {
                break;
            }
        }
        let directed = doors.iter().filter_map(|door| {
            let Link { passage, open, .. } = &self.links[*door];
            let end = match open {
                [true, false] => 0,
                [false, true] => 1,
                _ => return None,
            };
            Some(((*passage)?, end))
        });
        directed.collect()
    }

    /// Pairs of ends between which there is no way, and the sum of the moves between the others;
    /// `None` once too much work is done.
    fn ways(&mut self) -> Option<(u64, u64)> {
        let (mut missing, mut sum) = (0, 0);
        for end in 0..2 * self.links.len() as u32 {
            for moves in self.from(end)? {
                if moves == NO_WAY {
                    missing += 1;
                } else {
                    sum += moves;
                }
            }
        }
        Some((missing, sum))
    }

    /// Moves from an end of a link to all ends (E. W. Dijkstra, 1959).
    fn from(&mut self, end: u32) -> Option<Vec<u64>> {
        let mut moves = vec![NO_WAY; 2 * self.links.len()];
        moves[end as usize] = 0;
        let mut queue = BinaryHeap::from([Reverse((0, end))]);
        while let Some(Reverse((far, at))) = queue.pop() {
            if far > moves[at as usize] {
                continue;
            }
            let (link, side) = (&self.links[at as usize / 2], at as usize % 2);
            let mut reach = |to: u32, far: u64| {
                if far < moves[to as usize] {
                    moves[to as usize] = far;
                    queue.push(Reverse((far, to)));
                }
            };
            if link.open[side] {
                reach(at ^ 1, far + link.moves);
            }
            let beside = &self.ends[link.regions[side] as usize];
            for &to in beside {
                let mouth = self.links[to as usize / 2].mouths[to as usize % 2];
                let way = self.graph.manhattan(link.mouths[side], mouth);
                reach(to, far + u64::from(way));
            }
            self.work = self.work.saturating_sub(beside.len() as u64 + 1);
            if self.work == 0 {
                return None;
            }
        }
        Some(moves)
    }
}
