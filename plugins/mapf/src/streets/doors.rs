//! One-way doors: passages between rooms that lanes leave open in both directions.
//!
//! Two crowds that meet at a door hold each other up, so a door had better lead one way where others
//! lead back. H. E. Robbins, "A theorem on graphs, with an application to a problem of traffic
//! control", American Mathematical Monthly 46 (1939): the streets of a town can all be made one-way
//! exactly if no single one of them holds it together; F. Boesch and R. Tindell, "Robbins's theorem
//! for mixed multigraphs", ibid. 87 (1980): also where some are one-way already, and whichever of the
//! others comes first. So each door in turn gets the direction from whose end the way back is shorter, if there
//! is one: everywhere stays in reach, and doors side by side lead opposite ways. A search ends where
//! the way back does, which is near, so that a town takes about as long as it has doors.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use fleetyard_plugin_spacetime::digraph::Digraph;
use fleetyard_plugin_spacetime::graph::{Graph, Vertex};

use super::passages::Passage;

/// Ends of doors that searches may look at for every cell of the map; doors for which that does not
/// suffice stay open in both directions.
const WORK_PER_CELL: u64 = 16;

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

/// Ends to go on from: moves up to there and, at least, on to the target; moves up to there; the end;
/// and true if the way has come into its region there.
type Queue = BinaryHeap<Reverse<(u64, u64, u32, bool)>>;

/// Regions, from everywhere in which one gets everywhere else without a passage, and what leads
/// between them.
#[derive(Debug)]
struct Town<'g> {
    graph: &'g Graph,
    links: Vec<Link>,
    /// Per region the ends of links there: those of link `i` are `2 i` and `2 i + 1`.
    ends: Vec<Vec<u32>>,
    /// Per end the last search that found a way there, and its moves.
    seen: Vec<u32>,
    moves: Vec<u64>,
    search: u32,
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
            let regions = passage.mouths.map(|mouth| region[mouth as usize]);
            // Within a region the way beside it is no longer.
            if regions[0] == regions[1] {
                continue;
            }
            let open = [0, 1].map(|end| {
                let way = passage.through(graph, end);
                way.iter().all(|(v, d)| may(*v, *d))
            });
            links.push(Link {
                mouths: passage.mouths,
                regions,
                moves: passage.cells.len() as u64 + 1,
                open,
                passage: Some(number).filter(|_| open == [true; 2]),
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
            seen: vec![0; 2 * links.len()],
            moves: vec![0; 2 * links.len()],
            search: 0,
            links,
            ends,
            work: WORK_PER_CELL * graph.len() as u64,
        }
    }

    /// Gives doors their directions; gives the passages that have one, with the end at which agents
    /// enter.
    fn direct(&mut self) -> Vec<(usize, usize)> {
        let mut directed = Vec::new();
        for link in 0..self.links.len() {
            if self.work == 0 {
                break;
            }
            let Some(passage) = self.links[link].passage else {
                continue;
            };
            self.links[link].open = [false; 2];
            let [first, second] = [0, 1].map(|end| 2 * link as u32 + end);
            // Who enters at an end comes back from the other one.
            let back = [self.way(second, first), self.way(first, second)];
            let enter = match back {
                [Some(way), Some(other)] => usize::from(other < way),
                [Some(_), None] => 0,
                [None, Some(_)] => 1,
                [None, None] => {
                    self.links[link].open = [true; 2];
                    continue;
                }
            };
            self.links[link].open[enter] = true;
            directed.push((passage, enter));
        }
        directed
    }

    /// Moves from an end of a link to another end; `None` if there is no way, or once too much work is
    /// done. A* (P. Hart, N. Nilsson, B. Raphael, 1968) by Manhattan distances. Within a region these
    /// are the ways, so that only ends where a search has entered a region lead on to the others there.
    fn way(&mut self, from: u32, to: u32) -> Option<u64> {
        let target = self.mouth(to);
        self.search += 1;
        let mut queue = BinaryHeap::new();
        self.reach(from, 0, target, true, &mut queue);
        while let Some(Reverse((_, far, at, enters))) = queue.pop() {
            if at == to {
                return Some(far);
            }
            if far > self.moves[at as usize] {
                continue;
            }
            let (link, side) = (&self.links[at as usize / 2], at as usize % 2);
            let (region, moves, open) = (link.regions[side], link.moves, link.open[side]);
            if open {
                self.reach(at ^ 1, far + moves, target, true, &mut queue);
            }
            let beside = if enters {
                self.ends[region as usize].len()
            } else {
                0
            };
            for number in 0..beside {
                let end = self.ends[region as usize][number];
                let way = self.graph.manhattan(self.mouth(at), self.mouth(end));
                self.reach(end, far + u64::from(way), target, false, &mut queue);
            }
            self.work = self.work.saturating_sub(beside as u64 + 1);
            if self.work == 0 {
                return None;
            }
        }
        None
    }

    /// The cell before an end.
    fn mouth(&self, end: u32) -> Vertex {
        self.links[end as usize / 2].mouths[end as usize % 2]
    }

    /// The search has found a way to an end.
    fn reach(&mut self, end: u32, far: u64, target: Vertex, enters: bool, queue: &mut Queue) {
        let at = end as usize;
        if self.seen[at] != self.search || far < self.moves[at] {
            self.seen[at] = self.search;
            self.moves[at] = far;
            let left = self.graph.manhattan(self.mouth(end), target);
            queue.push(Reverse((far + u64::from(left), far, end, enters)));
        }
    }
}
