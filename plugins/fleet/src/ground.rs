//! The map, and searches on it.

use std::sync::Arc;

use fleetyard_abi::Environment;
use fleetyard_abi::sdk::Failure;
use fleetyard_plugin_spacetime::digraph::Digraph;
use fleetyard_plugin_spacetime::graph::{DIRECTIONS, Graph, Vertex};
use fleetyard_plugin_spacetime::plugin::grid_of;
use fleetyard_plugin_spacetime::problem::{graph_of, vertices_of};

/// A map as a plugin knows it, kept between calls.
pub trait Learn: Send + Sized {
    /// Learns a map.
    fn learn(environment: &Environment) -> Result<Self, Failure>;
}

/// Nothing has to be known of a map.
impl Learn for () {
    fn learn(_: &Environment) -> Result<(), Failure> {
        Ok(())
    }
}

/// A 4-connected grid and its connected regions: from everywhere in one there is a way to everywhere
/// else in it.
#[derive(Debug)]
pub struct Ground {
    pub(crate) graph: Arc<Graph>,
    region: Vec<u32>,
}

impl Ground {
    /// The free cells and their neighbours.
    pub fn graph(&self) -> &Graph {
        &self.graph
    }

    /// Number of the connected region that a vertex is in.
    pub(crate) fn region(&self, v: Vertex) -> u32 {
        self.region[v as usize]
    }

    /// True if there is a way from one vertex to another.
    pub(crate) fn leads(&self, from: Vertex, to: Vertex) -> bool {
        self.region(from) == self.region(to)
            || self.graph.is_directed() && Search::new(self).nearest(from, |v| v == to).is_some()
    }

    /// Vertices of the agents' cells, which have to be free and different.
    pub(crate) fn places(&self, cells: &[u32]) -> Result<Vec<Vertex>, Failure> {
        Ok(vertices_of(&self.graph, cells, "start")?)
    }
}

impl Learn for Ground {
    fn learn(environment: &Environment) -> Result<Self, Failure> {
        let graph = Arc::new(graph_of(grid_of(environment)?)?);
        if graph.is_directed() {
            let region = Digraph::new(&graph, |_, _| true).components();
            return Ok(Self { graph, region });
        }
        let mut region = vec![u32::MAX; graph.len()];
        let mut stack = Vec::new();
        for first in 0..graph.len() as Vertex {
            if region[first as usize] != u32::MAX {
                continue;
            }
            region[first as usize] = first;
            stack.push(first);
            while let Some(v) = stack.pop() {
                for near in graph.neighbors(v) {
                    if region[near as usize] == u32::MAX {
                        region[near as usize] = first;
                        stack.push(near);
                    }
                }
            }
        }
        Ok(Self { graph, region })
    }
}

/// Searches on a map, with memory that they share.
#[derive(Debug)]
pub struct Search<'g> {
    ground: &'g Ground,
    /// The search that has seen a vertex last.
    seen: Vec<u32>,
    number: u32,
    queue: Vec<Vertex>,
    near: Vec<(Vertex, u32)>,
    far: Vec<(Vertex, u32)>,
}

impl<'g> Search<'g> {
    /// A search that has seen nothing.
    pub fn new(ground: &'g Ground) -> Self {
        Self {
            ground,
            seen: vec![0; ground.graph.len()],
            number: 0,
            queue: Vec::new(),
            near: Vec::new(),
            far: Vec::new(),
        }
    }

    fn begin(&mut self) {
        if self.number == u32::MAX {
            self.seen.fill(0);
            self.number = 0;
        }
        self.number += 1;
    }

    /// The nearest vertex that is wanted, `from` included; of equals the one found first.
    pub fn nearest(&mut self, from: Vertex, wanted: impl FnMut(Vertex) -> bool) -> Option<Vertex> {
        self.first(from, Graph::around, wanted)
    }

    /// The wanted vertex from which one is the nearest to `to`.
    pub fn nearest_to(&mut self, to: Vertex, wanted: impl FnMut(Vertex) -> bool) -> Option<Vertex> {
        self.first(to, Graph::sources, wanted)
    }

    fn first(
        &mut self,
        from: Vertex,
        near: fn(&Graph, Vertex) -> &[Vertex; DIRECTIONS],
        mut wanted: impl FnMut(Vertex) -> bool,
    ) -> Option<Vertex> {
        let graph = &*self.ground.graph;
        self.begin();
        self.queue.clear();
        self.queue.push(from);
        self.seen[from as usize] = self.number;
        let mut next = 0;
        while let Some(&v) = self.queue.get(next) {
            next += 1;
            if wanted(v) {
                return Some(v);
            }
            for &near in near(graph, v) {
                if near != graph.wall() && self.seen[near as usize] != self.number {
                    self.seen[near as usize] = self.number;
                    self.queue.push(near);
                }
            }
        }
        None
    }

    /// The length of a shortest way, if it is at most `most`.
    ///
    /// A*: on a grid a move keeps the estimate of the whole way or makes it two longer, so
    /// two stacks do for a queue.
    pub fn distance(&mut self, from: Vertex, to: Vertex, most: u32) -> Option<u32> {
        let ground = self.ground;
        if !ground.leads(from, to) {
            return None;
        }
        self.begin();
        self.near.clear();
        self.far.clear();
        // A vertex is settled when it is taken, by the number of the search.
        self.near.push((from, 0));
        let mut estimate = ground.graph.manhattan(from, to);
        while estimate <= most {
            while let Some((v, steps)) = self.near.pop() {
                if self.seen[v as usize] == self.number {
                    continue;
                }
                self.seen[v as usize] = self.number;
                if v == to {
                    return Some(steps);
                }
                let towards = ground.graph.towards(v, to);
                for (&near, towards) in ground.graph.around(v).iter().zip(towards) {
                    if near == ground.graph.wall() || self.seen[near as usize] == self.number {
                        continue;
                    }
                    let stack = if towards {
                        &mut self.near
                    } else {
                        &mut self.far
                    };
                    stack.push((near, steps + 1));
                }
            }
            if self.far.is_empty() {
                return None;
            }
            std::mem::swap(&mut self.near, &mut self.far);
            estimate += 2;
        }
        None
    }
}
