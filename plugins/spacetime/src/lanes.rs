//! Lanes: preferred directions along the rows and columns of a map.
//!
//! Without lanes, agents that go to and fro meet head on, and those that come after
//! them wait for both. L. Cohen, T. Uras, S. Koenig, "Feasibility study: using highways for
//! bounded-suboptimal multi-agent path finding", SoCS 2015, have searches prefer highways
//! that the user draws; Y. Zhang, H. Jiang, V. Bhatt, S. Nikolaidis, J. Li, "Guidance graph
//! optimization for lifelong multi-agent path finding", IJCAI 2024, compare optimized costs
//! of edges with such drawings, among them the *crisscross*, in which neighbouring rows and
//! columns have opposite directions. This is a crisscross for any map: of its *streets*.
//!
//! A move against a lane takes no longer. It is charged, in searches and in the distances
//! that lead them, so that agents go round by another street if that is hardly further.
//!
//! Moves against lanes can be done without where lanes alone lead from everywhere to everywhere
//! else: [`Lanes::is_barred`] makes one-way streets of such parts of the map. A charge alone does
//! not stop agents from meeting head on in an aisle, which robots that do not move in chains at once
//! never get out of.

use crate::digraph::Digraph;
use crate::graph::{DIRECTIONS, Graph, Vertex};

/// A line is a street when it has at least so many quarters of the moves of the one that has
/// most: of the columns of a warehouse the aisles, and not those through the shelves.
const QUARTERS: usize = 3;

/// Cells of a straight way on which a cell lies on average where streets are long. Measured with EPIBT
/// and WPPL: lanes cost goals up to 17 (rooms of 16 cells, a tenth of the cells blocked), and make
/// goals from 23 on (warehouses, towns, caves).
const LONG: u64 = 20;

/// The lanes of a map, and what moves against them are charged.
#[derive(Debug, Clone)]
pub struct Lanes {
    /// Per vertex the directions that are against its lanes, a bit each.
    against: Box<[u8]>,
    /// Of these, those within a part of the map that lanes connect.
    barred: Box<[u8]>,
    charge: u32,
}

impl Lanes {
    /// The lanes of a map: streets lead east and west in turn, and south and north. A move
    /// against one is charged so many steps.
    pub fn new(graph: &Graph, charge: u32) -> Self {
        let places = || (0..graph.len() as Vertex).map(|v| graph.place(v));
        let mut against = vec![0; graph.len()].into_boxed_slice();
        // The axis of a line's number, and the direction of the first of these streets.
        for (axis, first) in [(0, 1), (1, 2)] {
            let lines = places().map(|place| place[axis] as usize + 1).max();
            let mut moves = vec![0_usize; lines.unwrap_or(0)];
            for (v, place) in (0..).zip(places()) {
                let leads_on = graph.around(v)[first] != graph.wall();
                moves[place[axis] as usize] += usize::from(leads_on);
            }
            let most = moves.iter().copied().max().unwrap_or(0);
            let mut back = (first + 2) % DIRECTIONS;
            let directions: Vec<u8> = moves
                .iter()
                .map(|&moves| {
                    if moves == 0 || moves * 4 < most * QUARTERS {
                        return 0;
                    }
                    let against = 1 << back;
                    back = (back + 2) % DIRECTIONS;
                    against
                })
                .collect();
            for (against, place) in against.iter_mut().zip(places()) {
                *against |= directions[place[axis] as usize];
            }
        }
        let one_way = Digraph::new(graph, |v, d| against[v as usize] >> d & 1 == 0);
        let part = one_way.components();
        let barred = (0..graph.len() as Vertex)
            .map(|v| {
                let bit = |(d, &u): (usize, &Vertex)| {
                    let within = u != graph.wall() && part[v as usize] == part[u as usize];
                    u8::from(within) << d
                };
                let within = graph.around(v).iter().enumerate().map(bit);
                against[v as usize] & within.fold(0, |bits, bit| bits | bit)
            })
            .collect();
        Self {
            against,
            barred,
            charge,
        }
    }

    /// True for maps with long streets, on which lanes are worth their detours: a cell lies on a straight way
    /// of 20 cells and more on average, along rows or along columns. Between scattered obstacles agents
    /// get round one another, and lanes are in their way.
    pub fn are_worth(graph: &Graph) -> bool {
        [1, 2].into_iter().any(|d| {
            let back = (d + 2) % DIRECTIONS;
            let first =
                (0..graph.len() as Vertex).filter(|v| graph.around(*v)[back] == graph.wall());
            let squares = first.map(|v| {
                let mut cells: u64 = 1;
                let mut at = graph.around(v)[d];
                while at != graph.wall() {
                    cells += 1;
                    at = graph.around(at)[d];
                }
                cells * cells
            });
            squares.sum::<u64>() >= LONG * graph.len() as u64
        })
    }

    /// True if the move from `v` in direction `d` is against a lane within a part of the map where
    /// lanes alone lead from everywhere to everywhere else: a strongly connected component of the map
    /// without moves against lanes.
    #[inline]
    pub fn is_barred(&self, v: Vertex, d: usize) -> bool {
        self.barred[v as usize] >> d & 1 == 1
    }

    /// Charge of the move from `v` in direction `d`, in steps.
    #[inline]
    pub fn charge(&self, v: Vertex, d: usize) -> u32 {
        u32::from(self.against[v as usize] >> d & 1) * self.charge
    }

    /// Charge of a move against a lane, in steps.
    pub fn most(&self) -> u32 {
        self.charge
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Per cell the directions that are free of charge.
    fn free_moves(map: &[&str]) -> Vec<String> {
        let cols = map[0].len();
        let passable: Vec<bool> = map.concat().bytes().map(|cell| cell == b'.').collect();
        let graph = Graph::new(map.len(), cols, &passable);
        let lanes = Lanes::new(&graph, 3);
        assert_eq!(lanes.most(), 3);
        let free = |v: Vertex| {
            let moves = (0..DIRECTIONS).filter(|&d| graph.around(v)[d] != graph.wall());
            let free = moves.filter(|&d| match lanes.charge(v, d) {
                0 => true,
                charge => {
                    assert_eq!(charge, 3);
                    false
                }
            });
            free.map(|d| char::from(b"NESW"[d])).collect()
        };
        (0..graph.len() as Vertex).map(free).collect()
    }

    #[test]
    fn neighbouring_streets_lead_opposite_ways() {
        assert_eq!(
            free_moves(&["...", "...", "..."]),
            [
                "ES", "E", "S", // row 0 leads east
                "S", "NW", "SW", // row 1 leads west, column 1 north
                "E", "NE", "",
            ]
        );
    }

    #[test]
    fn lines_through_shelves_are_no_streets() {
        let moves = free_moves(&["......", ".@@@@.", "......", "......", ".@@@@.", "......"]);
        // The outer columns lead south and north; those between have neither.
        assert_eq!(moves[0], "ES");
        assert_eq!(moves[5], "");
        let second_aisle = &moves[8..20];
        assert_eq!(second_aisle[1], "SW");
        assert_eq!(second_aisle[7], "NE");
    }

    #[test]
    fn a_map_without_moves_has_no_lanes() {
        assert_eq!(free_moves(&[".@", "@."]), ["", ""]);
        Lanes::new(&Graph::new(1, 1, &[false]), 1);
    }
}
