//! The parts of a map within which one gets from everywhere to everywhere else, where not all moves
//! are allowed.

use crate::graph::{DIRECTIONS, Graph, Vertex};

/// A map, and the moves that are allowed on it.
#[derive(Debug)]
pub struct Digraph<'g> {
    graph: &'g Graph,
    /// Per vertex the directions of its moves, a bit each.
    moves: Vec<u8>,
}

impl<'g> Digraph<'g> {
    /// `may` says if the move from a vertex in a direction to its neighbour there is allowed.
    pub fn new(graph: &'g Graph, may: impl Fn(Vertex, usize) -> bool) -> Self {
        let moves = (0..graph.len() as Vertex)
            .map(|v| {
                let bit = |(d, &u): (usize, &Vertex)| u8::from(u != graph.wall() && may(v, d)) << d;
                let bits = graph.around(v).iter().enumerate().map(bit);
                bits.fold(0, |bits, bit| bits | bit)
            })
            .collect();
        Self { graph, moves }
    }

    /// The next vertex of `v` after direction `from`, forwards or backwards, and its direction.
    fn next(&self, v: Vertex, from: usize, backwards: bool) -> Option<(usize, Vertex)> {
        (from..DIRECTIONS).find_map(|d| {
            let u = if backwards {
                self.graph.sources(v)[d]
            } else {
                self.graph.around(v)[d]
            };
            let leads = u != self.graph.wall()
                && if backwards {
                    self.moves[u as usize] >> ((d + 2) % DIRECTIONS) & 1 == 1
                } else {
                    self.moves[v as usize] >> d & 1 == 1
                };
            leads.then_some((d, u))
        })
    }

    /// Visits what can be reached from `root` and is not `seen`, and gives each vertex when it is
    /// left.
    fn search(
        &self,
        root: Vertex,
        backwards: bool,
        seen: &mut [bool],
        mut left: impl FnMut(Vertex),
    ) {
        if std::mem::replace(&mut seen[root as usize], true) {
            return;
        }
        let mut stack = vec![(root, 0)];
        while let Some((v, from)) = stack.last_mut() {
            if let Some((d, u)) = self.next(*v, *from, backwards) {
                *from = d + 1;
                if !std::mem::replace(&mut seen[u as usize], true) {
                    stack.push((u, 0));
                }
            } else {
                left(*v);
                stack.pop();
            }
        }
    }

    /// Per vertex the number of its strongly connected component. By two depth-first searches (S. R.
    /// Kosaraju, 1978).
    pub fn components(&self) -> Vec<u32> {
        let count = self.moves.len();
        let (mut seen, mut order) = (vec![false; count], Vec::with_capacity(count));
        for v in 0..count as Vertex {
            self.search(v, false, &mut seen, |v| order.push(v));
        }
        seen.fill(false);
        let (mut component, mut number) = (vec![0; count], 0);
        for v in order.into_iter().rev() {
            if !seen[v as usize] {
                self.search(v, true, &mut seen, |v| component[v as usize] = number);
                number += 1;
            }
        }
        component
    }
}
