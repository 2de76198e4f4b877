//! The dependency graph between agents.

use std::cmp::Reverse;

use serde::{Deserialize, Serialize};

use super::routes::{Cuts, Refined, Routes};

/// Distances and resolution of a dependency graph.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GateOptions {
    /// Actions whose swept footprints come nearer than this, in metres, are never under
    /// way at the same time. It must cover the deviation of both bodies from their ways,
    /// to the side and beyond the knots where they stop.
    pub margin_m: f64,
    /// Least distance that is kept where the plan has agents pass nearer than the margin, in
    /// metres, at most the margin; a plan that leaves less is refused. With 0 the plan's own
    /// distance suffices, which is enough for robots without tracking error.
    pub least_margin_m: f64,
    /// Longer actions are cut into equal pieces, in metres of any point of the body: an
    /// agent then waits for a piece of another agent's action instead of the whole.
    /// `None` is twice the largest effective radius. Moves between neighbouring cells are
    /// not cut.
    pub longest_action_m: Option<f64>,
    /// Side of a grid cell in metres, for routes along the cells of a grid. Where
    /// the bodies fit their cells, dependencies are then found by cell.
    pub cell_size_m: Option<f64>,
}

impl Default for GateOptions {
    fn default() -> Self {
        Self {
            margin_m: 0.0,
            least_margin_m: 0.0,
            longest_action_m: None,
            cell_size_m: None,
        }
    }
}

/// A dependency between agents (a type-2 edge): before an action may begin,
/// another agent must have reached one of its knots.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Wait {
    /// The action that waits.
    pub action: u32,
    /// The agent that it waits for.
    pub other: u32,
    /// The knot that the other agent must have reached.
    pub knot: u32,
}

/// A [`Wait`] with the waiting agent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Edge {
    pub(super) agent: u32,
    pub(super) wait: Wait,
}

/// Temporal plan graph of routes: the dependencies between actions.
///
/// Actions follow each other along a route (type-1 edges, not stored). Wherever two
/// agents sweep the same place, the agent that has it first in the plan leaves before the
/// other one comes (type-2 edges, stored at the waiting agent in order of its actions).
/// The graph has no cycle.
#[derive(Debug, Clone, PartialEq)]
pub struct DependencyGraph {
    actions: Vec<u32>,
    offsets: Vec<u32>,
    waits: Vec<Wait>,
    cuts: Cuts,
    margin_m: f64,
}

impl DependencyGraph {
    /// Sorts edges to their agents, without those implied by earlier edges of the same
    /// two agents.
    pub(super) fn assemble(actions: Vec<u32>, mut edges: Vec<Edge>) -> Self {
        edges.sort_unstable_by_key(|edge| {
            let wait = edge.wait;
            (edge.agent, wait.action, wait.other, Reverse(wait.knot))
        });
        let agents = actions.len();
        // Per agent, the last knot waited for, and the waiting agent.
        let mut waited = vec![(u32::MAX, 0); agents];
        edges.retain(|edge| {
            let (by, knot) = &mut waited[edge.wait.other as usize];
            let follows = *by == edge.agent && *knot >= edge.wait.knot;
            if !follows {
                (*by, *knot) = (edge.agent, edge.wait.knot);
            }
            !follows
        });
        let mut offsets = vec![0; agents + 1];
        for edge in &edges {
            offsets[edge.agent as usize + 1] += 1;
        }
        for agent in 0..agents {
            offsets[agent + 1] += offsets[agent];
        }
        Self {
            actions,
            offsets,
            waits: edges.iter().map(|edge| edge.wait).collect(),
            cuts: Cuts::default(),
            margin_m: 0.0,
        }
    }

    pub(super) fn with(self, cuts: Cuts, margin_m: f64) -> Self {
        Self {
            cuts,
            margin_m,
            ..self
        }
    }

    pub(super) fn cuts(&self) -> &Cuts {
        &self.cuts
    }

    /// Number of agents.
    pub fn agents(&self) -> usize {
        self.actions.len()
    }

    /// Number of actions of an agent, counting pieces.
    pub fn actions(&self, agent: usize) -> usize {
        self.actions[agent] as usize
    }

    /// Dependencies of an agent, in order of its actions.
    pub fn waits(&self, agent: usize) -> &[Wait] {
        &self.waits[self.offsets[agent] as usize..self.offsets[agent + 1] as usize]
    }

    /// Number of dependencies between agents.
    pub fn edges(&self) -> usize {
        self.waits.len()
    }

    /// The distance in metres that is kept everywhere: the requested margin, or the least
    /// one if the plan itself has two agents pass nearer than the margin.
    pub fn margin_m(&self) -> f64 {
        self.margin_m
    }

    /// Bytes on the heap.
    pub fn memory_bytes(&self) -> usize {
        let numbers = self.actions.capacity() + self.offsets.capacity();
        numbers * size_of::<u32>()
            + self.waits.capacity() * size_of::<Wait>()
            + self.cuts.memory_bytes()
    }

    /// The routes to which this graph's actions and knots refer, from the routes it was
    /// built from: where agents pass each other closely, actions are cut into pieces.
    pub fn routes<'a, R: Routes + ?Sized>(&'a self, routes: &'a R) -> Refined<'a, R> {
        let cuts = &self.cuts;
        Refined { routes, cuts }
    }
}
