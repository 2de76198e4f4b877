//! The problem of a planner, over vertices and with the tables that searches need; and the reasons
//! why there is none.

use std::sync::Arc;

use fleetyard_abi::sdk::Failure;
use fleetyard_abi::{Goals, GridEnvironment, GridPlan, Instance, Lists, Motion, Status};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::distance::{MAX_DISTANCE, NoTable, Table, Tables};
use crate::graph::{DIRECTIONS, Graph, Vertex, direction};
use crate::lanes::Lanes;
use crate::plan::plan_of;
use crate::sipp::{Guidance, Team};

/// The reason why there is nothing to plan for.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum ProblemError {
    /// A motion or an instance that the planners here do not know.
    #[error("{what} not supported")]
    Unsupported {
        /// "any-angle motion is", …
        what: &'static str,
    },
    /// Lists of different lengths, an agent without goal, a cell that is off the map.
    #[error("{reason}")]
    Malformed {
        /// The reason, in words.
        reason: String,
    },
    /// A start or goal on an obstacle.
    #[error("agent {agent}: {what} cell {cell} is not a passable cell of the map")]
    Blocked {
        /// Agent index.
        agent: usize,
        /// "start" or "goal".
        what: &'static str,
        /// The cell.
        cell: u32,
    },
    /// Two agents share a start, or a goal where that is not allowed.
    #[error("agents {first} and {second} have the same {what} cell {cell}")]
    Duplicate {
        /// The agent with the lower index.
        first: usize,
        /// The other one.
        second: usize,
        /// "start" or "goal".
        what: &'static str,
        /// The cell.
        cell: u32,
    },
    /// No path leads from a start or goal to the next goal, or only one longer than
    /// supported.
    #[error("agent {agent}: no path of at most {limit} steps from cell {from} to cell {goal}")]
    Unreachable {
        /// Agent index.
        agent: usize,
        /// The cell where the path would begin.
        from: u32,
        /// Goal cell.
        goal: u32,
        /// Longest supported path.
        limit: u32,
    },
    /// The tables of all goals exceed what they may take.
    #[error("the distance tables of {goals} goals exceed the limit of {limit} bytes")]
    Memory {
        /// Goals whose table was wanted so far.
        goals: usize,
        /// The limit.
        limit: u64,
    },
    /// Time was up before all tables were made.
    #[error("the budget ended before the distances to all goals were known")]
    Stopped,
}

impl ProblemError {
    /// Advice to the user.
    pub fn hint(&self) -> &'static str {
        match self {
            Self::Unsupported { .. } => "take a planner that claims this capability",
            Self::Malformed { .. } => "give one start and at least one goal per agent",
            Self::Blocked { .. } => {
                "check that coordinates are not swapped: cell = row · cols + col"
            }
            Self::Duplicate { .. } => "give every agent a cell of its own",
            Self::Unreachable { .. } => {
                "start and goals must lie in the same connected part of the map"
            }
            Self::Memory { .. } => "give a larger limit of memory, or fewer goals at a time",
            Self::Stopped => "give more time",
        }
    }

    /// The claim that goes with it.
    pub fn status(&self) -> Status {
        match self {
            Self::Unsupported { .. } => Status::Unsupported,
            Self::Memory { .. } => Status::GaveUp,
            Self::Stopped => Status::TimedOut,
            _ => Status::InvalidInput,
        }
    }
}

impl From<ProblemError> for Failure {
    fn from(error: ProblemError) -> Self {
        Failure::new(error.status(), format!("{error}; hint: {}", error.hint()))
    }
}

/// Behaviour of an agent after its last goal.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
#[schemars(rename = "Goals")]
pub enum GoalRule {
    /// It stays there; where several agents share it a visit is enough.
    // Standard MAPF: Stern et al., SoCS 2019.
    #[default]
    Stay,
    /// A visit is enough: it may go on to where it is in nobody's way (MAPF4L).
    // Morag, Felner, Stern, Atzmon, Boyarski 2025.
    Transient,
}

/// The graph of a grid, one-way streets and all. The host has checked that there is one entry for each
/// cell.
pub fn graph_of(grid: &GridEnvironment) -> Result<Graph, ProblemError> {
    let (rows, cols) = (grid.rows as usize, grid.cols as usize);
    if rows.checked_mul(cols) != Some(grid.passable.len())
        || grid.passable.len() >= u32::MAX as usize / DIRECTIONS
    {
        let reason = format!("a map of {rows} × {cols} cells cannot be searched");
        return Err(ProblemError::Malformed { reason });
    }
    let passable: Vec<bool> = grid.passable.iter().map(|free| *free != 0).collect();
    Ok(if grid.is_plain() {
        Graph::new(rows, cols, &passable)
    } else {
        Graph::with_moves(rows, cols, &passable, &grid.moves)
    })
}

/// The vertex of a cell that an agent begins or ends at.
pub fn vertex_of(
    graph: &Graph,
    agent: usize,
    what: &'static str,
    cell: u32,
) -> Result<Vertex, ProblemError> {
    let blocked = ProblemError::Blocked { agent, what, cell };
    graph.vertex(cell).ok_or(blocked)
}

/// The vertices of the goals of all agents.
pub fn goals_of(graph: &Graph, goals: &Goals) -> Result<Lists<Vertex>, ProblemError> {
    let mut vertices = Lists::with_capacity(goals.len(), goals.items().len());
    for (agent, cells) in goals.iter().enumerate() {
        for &cell in cells {
            vertices.push_item(vertex_of(graph, agent, "goal", cell)?);
        }
        vertices.end_list();
    }
    Ok(vertices)
}

/// The vertices of cells that no two agents may share: starts, or goals.
pub fn vertices_of(
    graph: &Graph,
    cells: &[u32],
    what: &'static str,
) -> Result<Vec<Vertex>, ProblemError> {
    let mut owner = vec![None; graph.len()];
    let mut vertices = Vec::with_capacity(cells.len());
    for (second, &cell) in cells.iter().enumerate() {
        let vertex = vertex_of(graph, second, what, cell)?;
        if let Some(first) = owner[vertex as usize].replace(second) {
            return Err(ProblemError::Duplicate {
                first,
                second,
                what,
                cell,
            });
        }
        vertices.push(vertex);
    }
    Ok(vertices)
}

/// Data that stay between calls: the map as a graph, and tables of distances.
#[derive(Debug)]
pub struct Ground {
    graph: Arc<Graph>,
    /// By goal, way of moving, and whether lanes count.
    tables: Tables<(Vertex, bool, bool), Table>,
    lanes: Option<Arc<Lanes>>,
}

impl Ground {
    /// A map, and how many bytes the tables that are kept between calls may take.
    pub fn new(grid: &GridEnvironment, limit: u64) -> Result<Self, ProblemError> {
        Ok(Self {
            graph: Arc::new(graph_of(grid)?),
            tables: Tables::new(limit),
            lanes: None,
        })
    }

    /// Charges moves against the [lanes](Lanes) of the map so many steps, in windows: where
    /// plans end somewhere, the shortest are asked for.
    #[must_use]
    pub fn with_lanes(mut self, charge: u32) -> Self {
        self.lanes = (charge > 0).then(|| Arc::new(Lanes::new(&self.graph, charge)));
        self
    }

    /// The graph.
    pub fn graph(&self) -> &Arc<Graph> {
        &self.graph
    }

    /// The problem of an instance, which fits the map ([`Instance::check`]). `stop`, asked often, ends
    /// the work early.
    pub fn problem(
        &mut self,
        instance: &Instance,
        rule: GoalRule,
        stop: &mut dyn FnMut() -> bool,
    ) -> Result<Problem, ProblemError> {
        let turning = match instance.motion {
            Motion::Pebble => false,
            Motion::Rotation => true,
            Motion::AnyAngle | Motion::StopGo | Motion::Slower | Motion::Dynamics => {
                let what = "motion other than pebbles' and with turns is";
                return Err(ProblemError::Unsupported { what });
            }
        };
        let graph = Arc::clone(&self.graph);
        let starts = vertices_of(&graph, &instance.starts, "start")?;
        let mut last_goals = vec![0_u32; graph.len()];
        for (agent, goals) in instance.goals.iter().enumerate() {
            if let Some(&last) = goals.last() {
                last_goals[vertex_of(&graph, agent, "goal", last)? as usize] += 1;
            }
        }
        let in_window = |_: &Arc<Lanes>| instance.window_steps > 0;
        let lanes = self.lanes.clone().filter(in_window);
        self.tables.begin();
        let mut routes = Vec::with_capacity(starts.len());
        let mut wanted = 0;
        for (agent, &start) in starts.iter().enumerate() {
            let heading = instance
                .headings
                .as_ref()
                .map_or(1, |all| direction(all[agent]));
            let mut route = Route {
                start,
                heading,
                goals: Vec::new(),
                stays: false,
                tables: Vec::new(),
                after: Vec::new(),
            };
            for &cell in &instance.goals[agent] {
                let goal = vertex_of(&graph, agent, "goal", cell)?;
                wanted += 1;
                let memory = ProblemError::Memory {
                    goals: wanted,
                    limit: self.tables.limit(),
                };
                let key = (goal, turning, lanes.is_some());
                let bytes = Table::bytes(&graph, turning);
                let make = || Table::within(&graph, goal, turning, lanes.as_deref(), &mut *stop);
                let table = self.tables.try_get(key, bytes, make);
                let table = table.map_err(|reason| match reason {
                    NoTable::Full => memory,
                    NoTable::Stopped => ProblemError::Stopped,
                })?;
                route.goals.push(goal);
                route.tables.push(table);
                if stop() {
                    return Err(ProblemError::Stopped);
                }
            }
            route
                .connect()
                .map_err(|(from, goal)| ProblemError::Unreachable {
                    agent,
                    from: graph.cell(from),
                    goal: graph.cell(goal),
                    limit: MAX_DISTANCE,
                })?;
            let shared = route
                .goals
                .last()
                .is_some_and(|&v| last_goals[v as usize] > 1);
            route.stays = rule == GoalRule::Stay && instance.window_steps == 0 && !shared;
            routes.push(route);
        }
        Ok(Problem {
            graph,
            routes,
            turning,
            window: instance.window_steps,
            faces: instance.headings.is_some(),
            cycles: instance.allows_cycles,
            lanes,
        })
    }
}

/// A team with its goals, ready to be searched for.
#[derive(Debug, Clone)]
pub struct Problem {
    /// The map.
    pub graph: Arc<Graph>,
    /// One per agent.
    pub routes: Vec<Route>,
    /// True if the headings of agents are known: robots take time to turn, even where plans do not
    /// say so.
    pub faces: bool,
    /// True if turning by 90° takes a step.
    pub turning: bool,
    /// Collisions after this many steps do not matter; 0: all do. In a window an agent that
    /// has visited all its goals goes out of the way of others.
    pub window: u32,
    /// True if agents may move round in a ring in one step.
    pub cycles: bool,
    /// Along which moves had better go; what they charge is part of all distances.
    pub lanes: Option<Arc<Lanes>>,
}

impl Problem {
    /// Number of agents.
    pub fn agents(&self) -> usize {
        self.routes.len()
    }

    /// The sum of the shortest ways through all goals, which no plan can beat (and what lanes
    /// charge on these ways).
    pub fn lower_bound(&self) -> u64 {
        self.routes
            .iter()
            .map(|route| u64::from(route.length()))
            .sum()
    }

    /// A shortest path of an agent through all its goals, or to the end of the window,
    /// whoever is in the way.
    pub fn shortest(&self, agent: usize) -> Vec<Vertex> {
        let route = &self.routes[agent];
        let (mut v, mut heading) = (route.start, route.heading);
        let mut path = vec![v];
        for (&goal, table) in route.goals.iter().zip(&route.tables) {
            while v != goal {
                if self.window > 0 && path.len() > self.window as usize {
                    return path;
                }
                let rest = table.get(v, heading);
                let ahead = |d: u8| self.graph.around(v)[usize::from(d)];
                let nearer = |u: Vertex, d: u8| table.get(u, d) < rest;
                if self.turning {
                    if nearer(ahead(heading), heading) {
                        v = ahead(heading);
                    } else {
                        let turns = [(heading + 1) % 4, (heading + 3) % 4];
                        let Some(&turn) = turns.iter().find(|&&d| nearer(v, d)) else {
                            return path;
                        };
                        heading = turn;
                    }
                } else {
                    let Some(d) = (0..DIRECTIONS as u8).find(|&d| nearer(ahead(d), d)) else {
                        return path;
                    };
                    v = ahead(d);
                }
                path.push(v);
            }
        }
        path
    }

    /// The paths as cells of the grid, one per agent.
    pub fn plan<P: AsRef<[Vertex]>>(&self, paths: impl IntoIterator<Item = P>) -> GridPlan {
        plan_of(paths, &self.graph)
    }
}

/// The start of an agent and the goals that it has to visit, in order.
#[derive(Debug, Clone)]
pub struct Route {
    /// The start.
    pub start: Vertex,
    /// The heading at the start: a direction of [`Graph::around`].
    pub heading: u8,
    /// Goals, in the order in which they are to be visited; at least one.
    pub goals: Vec<Vertex>,
    /// True if the agent has to stay at the last goal.
    pub stays: bool,
    tables: Vec<Arc<Table>>,
    /// Per goal, least steps from there through all later ones.
    after: Vec<u32>,
}

impl Route {
    /// A way to one goal where the agent need not stay.
    pub fn to(start: Vertex, heading: u8, goal: Vertex, table: Arc<Table>) -> Self {
        Self {
            start,
            heading,
            goals: vec![goal],
            stays: false,
            tables: vec![table],
            after: vec![0],
        }
    }

    /// Adds up the way through the goals, or says which part does not exist.
    fn connect(&mut self) -> Result<(), (Vertex, Vertex)> {
        let first = self
            .tables
            .first()
            .map(|table| table.get(self.start, self.heading));
        if first.is_none_or(|steps| steps > MAX_DISTANCE) {
            return Err((
                self.start,
                self.goals.first().copied().unwrap_or(self.start),
            ));
        }
        self.after = vec![0; self.goals.len()];
        for next in (1..self.goals.len()).rev() {
            let (from, goal) = (self.goals[next - 1], self.goals[next]);
            let steps = self.tables[next].least(from);
            if steps > MAX_DISTANCE {
                return Err((from, goal));
            }
            self.after[next - 1] = self.after[next].saturating_add(steps);
        }
        Ok(())
    }

    /// Least steps from the start through all goals.
    pub fn length(&self) -> u32 {
        self.rest(self.reached(0, self.start), self.start, self.heading)
    }

    /// The table of goal number `label`.
    pub fn table(&self, label: usize) -> &Arc<Table> {
        &self.tables[label]
    }
}

impl Guidance for Route {
    fn goals(&self) -> &[Vertex] {
        &self.goals
    }

    fn stays(&self) -> bool {
        self.stays
    }

    #[inline]
    fn rest(&self, label: u32, v: Vertex, heading: u8) -> u32 {
        match self.tables.get(label as usize) {
            Some(table) => table
                .get(v, heading)
                .saturating_add(self.after[label as usize]),
            None => 0,
        }
    }
}

impl Team for [Route] {
    #[inline]
    fn route(&self, agent: usize) -> impl Guidance {
        &self[agent]
    }
}
