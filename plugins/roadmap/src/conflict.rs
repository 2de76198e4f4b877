//! Conflict-based search on roadmaps in continuous time: the least sum of arrival times, or within a factor of it.
//!
//! - CCBS: A. Andreychuk, K. Yakovlev, P. Surynek, D. Atzmon, R. Stern, "Multi-agent pathfinding with continuous time", AIJ 305,
//!   2022. Each agent has the earliest path that keeps its constraints; where two paths conflict, the search tries constraints of
//!   one and of the other.
//! - Prioritised conflicts and lower bounds: the same, with E. Boyarski, "Improving continuous-time conflict based search", AAAI
//!   2021. Bounds of pairs: J. Li et al., IJCAI 2019.
//! - Bypass: T. T. Walker, N. R. Sturtevant, A. Felner, "Clique analysis and bypassing in continuous-time conflict-based search",
//!   SoCS 2024.
//! - Branching that loses no solution: A. Combrink, S. F. Roselli, M. Fabian, "Optimal multi-agent path finding in continuous
//!   time", arXiv 2508.16410.
//!
//! `tree` is the high level, `low` the low level; `clash` has conflicts and the constraints that resolve them, `constraint`
//! their meaning for one agent, `cover` the bound of pairs, `path` paths in little memory.

mod clash;
mod constraint;
mod cover;
mod focal;
mod low;
mod path;
mod queue;
mod traffic;
mod tree;

use std::cell::OnceCell;

use fleetyard_plugin_plane::motion::Span;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::closeness::Closeness;
use crate::plan::Path;
use crate::roadmap::{Edge, Vertex};
use low::Stopped;
use tree::{Tools, Tree};

/// The constraints that resolve a move past an agent at rest.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Branching {
    /// No solution is lost.
    #[default]
    Sound,
    /// As CCBS does it: a plan may cost more than the least sum, and plans may be missed.
    Original,
}

/// Settings of a search.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// The sum of costs may exceed the least one by this factor, at least 1.
    pub weight: f64,
    /// The constraints that resolve a move past an agent at rest.
    pub branching: Branching,
    /// Take over paths of children that avoid a conflict at no cost.
    pub bypass: bool,
    /// Split so that no plan is in both children.
    pub disjoint: bool,
    /// Search for pairs of agents to bound what both have to give up.
    pub pairs: bool,
    /// Most nodes to expand.
    pub node_limit: Option<u64>,
    /// Most bytes that nodes may take.
    pub memory_limit: u64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            weight: 1.0,
            branching: Branching::Sound,
            bypass: true,
            disjoint: true,
            pairs: true,
            node_limit: None,
            memory_limit: 64 << 20,
        }
    }
}

/// The end of a search.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum End {
    /// There is a plan.
    Solved,
    /// There is none, which is proven unless the branching is the original one.
    Infeasible,
    /// It was told to stop.
    Stopped,
    /// So many nodes were to be expanded.
    Nodes,
    /// The nodes took too much memory.
    Memory,
}

/// The outcome of a search.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// The end.
    pub end: End,
    /// Paths of all agents, where there is a plan.
    pub paths: Vec<Path>,
    /// The sum of the times of their last arrivals.
    pub cost: f64,
    /// No plan costs less; zero for the original branching, infinite where no way leads to a goal.
    pub lower_bound: f64,
    /// Nodes that were split.
    pub expanded: u64,
    /// Nodes that were made.
    pub generated: u64,
    /// Nodes whose conflict was avoided without splitting.
    pub bypassed: u64,
    /// States that the low level expanded.
    pub low_level: u64,
    /// Searches of the low level.
    pub searches: u64,
}

/// The agents and all that is known about the roadmap.
#[derive(Debug)]
struct Team<'a> {
    closeness: &'a Closeness,
    /// Starts and goals.
    tasks: &'a [(Vertex, Vertex)],
    /// Of each agent the seconds from every vertex to its goal.
    times: Vec<Vec<f64>>,
    /// Of each goal the vertices and edges that are close to it.
    beside: Vec<OnceCell<Beside>>,
    branching: Branching,
}

/// Vertices that are close to a goal, and edges with the part of the way along them that is.
#[derive(Debug)]
struct Beside {
    vertices: Vec<Vertex>,
    edges: Vec<(Edge, Span)>,
}

/// Discs may touch: centres that are nearer by no more than this share of the separation do.
const TOUCH: f64 = 1e-9;

/// Searches for agents with starts and goals.
pub fn solve(
    closeness: &Closeness,
    tasks: &[(Vertex, Vertex)],
    settings: &Settings,
    stop: &mut dyn FnMut() -> bool,
) -> Outcome {
    let roadmap = closeness.roadmap();
    let mut team = Team {
        closeness,
        tasks,
        times: Vec::with_capacity(tasks.len()),
        beside: tasks.iter().map(|_| OnceCell::new()).collect(),
        branching: settings.branching,
    };
    let mut tree = Tree::new((0..tasks.len() as u32).collect(), settings.weight);
    let mut tools = Tools::new(roadmap);
    let mut lower_bound = 0.0;
    for (start, goal) in tasks {
        if stop() {
            return outcome(End::Stopped, &tree, &tools, lower_bound, closeness);
        }
        let times = roadmap.times_to(*goal);
        lower_bound += times[*start as usize];
        team.times.push(times);
    }
    let end = if lower_bound == f64::INFINITY || team.is_crowded() {
        End::Infeasible
    } else {
        match tree.root(&team, &mut tools, stop) {
            Ok(true) => tree.run(&team, &mut tools, settings, stop),
            Ok(false) => End::Infeasible,
            Err(Stopped) => End::Stopped,
        }
    };
    let lower_bound = match settings.branching {
        Branching::Sound if tree.bound().is_finite() => lower_bound.max(tree.bound()),
        Branching::Sound => lower_bound,
        Branching::Original => 0.0,
    };
    outcome(end, &tree, &tools, lower_bound, closeness)
}

fn outcome(
    end: End,
    tree: &Tree,
    tools: &Tools,
    lower_bound: f64,
    closeness: &Closeness,
) -> Outcome {
    let solved = end == End::Solved;
    let paths = tree.paths().filter(|_| solved);
    let paths: Vec<Path> = paths.map(|path| path.visits(closeness.roadmap())).collect();
    Outcome {
        end,
        cost: if solved {
            tree.paths().map(|path| path.cost).sum()
        } else {
            0.0
        },
        paths,
        lower_bound,
        expanded: tree.expanded,
        generated: tree.generated,
        bypassed: tree.bypassed,
        low_level: tools.low.expanded + tools.focal.expanded,
        searches: tools.low.searches(),
    }
}

impl Team<'_> {
    /// The vertices and edges that are close to an agent's goal.
    fn beside(&self, agent: u32) -> &Beside {
        self.beside[agent as usize].get_or_init(|| {
            let (roadmap, goal) = (self.closeness.roadmap(), self.tasks[agent as usize].1);
            let place = roadmap.place(goal);
            let vertices = self.closeness.vertices_of_vertex(goal).iter().copied();
            let is_close = |vertex: &Vertex| {
                (roadmap.place(*vertex) - place).norm() < self.distance(goal, *vertex)
            };
            let edges = self.closeness.edges_of_vertex(goal).iter();
            let near = |edge: Edge| {
                let distance = self.distance(goal, roadmap.source(edge));
                roadmap.motion(edge).near(place, distance)
            };
            Beside {
                vertices: vertices.filter(is_close).collect(),
                edges: edges
                    .filter_map(|(edge, _)| Some((*edge, near(*edge)?)))
                    .collect(),
            }
        })
    }

    /// Centres of discs at two vertices, or on edges that leave them, are never closer than this, in metres.
    fn distance(&self, one: Vertex, other: Vertex) -> f64 {
        self.closeness.roadmap().separation(one, other) * (1.0 - TOUCH)
    }

    /// True if two agents start, or end, too close to each other.
    fn is_crowded(&self) -> bool {
        let place = |vertex| self.closeness.roadmap().place(vertex);
        let close = |a: Vertex, b: Vertex| (place(a) - place(b)).norm() < self.distance(a, b);
        let pairs = (0..self.tasks.len()).flat_map(|i| (0..i).map(move |j| (i, j)));
        let tasks = |(i, j): (usize, usize)| (self.tasks[i], self.tasks[j]);
        let mut pairs = pairs.map(tasks);
        pairs.any(|(one, other)| close(one.0, other.0) || close(one.1, other.1))
    }
}
