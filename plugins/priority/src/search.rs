//! Priority-based search: priorities only between agents that collide.
//!
//! H. Ma, D. Harabor, P. J. Stuckey, J. Li, S. Koenig, "Searching with consistent
//! prioritization for multi-agent path finding", AAAI 2019. A node of the search is a
//! partial order of the agents, and paths of which each keeps out of the way of all that
//! come before it in the order. Where two collide the order is decided both ways; agents
//! whose path no longer fits are planned anew. The search goes depth first.
//!
//! With a window it is the solver of rolling-horizon collision resolution (Li, Tinka,
//! Kiesel, Durham, Kumar, Koenig, "Lifelong multi-agent path finding in large-scale
//! warehouses", AAAI 2021).
//!
//! [`Prefer`] says which of two children comes first: the one of less cost, as in the paper, or the
//! one with fewer collisions (Chan, Stern, Felner, Koenig, "Greedy priority-based search for
//! suboptimal multi-agent path finding", SoCS 2023), which ends sooner.
//!
//! A ring is resolved by ordering its members, two at a time, until the last has to keep out
//! of it. After some dead ends the search begins anew, with those agents first that found no
//! path.
//!
//! Among equally long paths of an agent the one is taken that meets fewest of those that
//! it need not keep out of the way of.

use fleetyard_abi::leftovers::Leftover;
use fleetyard_plugin_spacetime::conflict::{Conflict, Conflicts, FOREVER, Kind, Rules};
use fleetyard_plugin_spacetime::graph::Vertex;
use fleetyard_plugin_spacetime::order::{Order, Prefer};
use fleetyard_plugin_spacetime::plan::Paths;
use fleetyard_plugin_spacetime::problem::Problem;
use fleetyard_plugin_spacetime::random::Random;
use fleetyard_plugin_spacetime::reservation::Imprint;
use fleetyard_plugin_spacetime::sipp::{Found, Miss};

use crate::planner::{Control, Outcome, Single};

/// Random stream of ties between paths.
const PATH_STREAM: u64 = 0;

/// The search begins anew after so many dead ends, then after half as many more, and so on.
const PATIENCE: u64 = 20;

/// A path counts for so many expanded states beside its own: in a short window few are expanded,
/// and it is the tables of the others' paths that take the time.
const PATH: u64 = 32;

/// Options of priority-based search.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Options {
    /// The child of a node that is looked at first.
    pub prefer: Prefer,
    /// Charge of a turn by 90°, in steps, where it takes none.
    pub turn_charge: u32,
}

/// Work of a run.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Effort {
    /// Nodes of the search that were made.
    pub nodes: u64,
    /// Paths that were planned.
    pub paths: u64,
    /// States expanded for them.
    pub expansions: u64,
    /// Ranks of the agents in the order at the end ([`Order::ranks`]).
    pub ranks: Vec<u32>,
}

/// Plans. Ends with the first plan without collisions, when it is stopped, or when all
/// orders that the search looks at have failed; then the paths are those of the node with
/// fewest collisions of all that led no further.
pub fn plan(
    problem: &Problem,
    options: Options,
    seed: u64,
    control: &mut Control<'_>,
) -> (Outcome, Effort) {
    let agents = problem.agents();
    let rules = Rules {
        until: if problem.window > 0 {
            problem.window
        } else {
            FOREVER
        },
        delay: 0,
        rings: !problem.cycles,
    };
    let mut run = Run {
        single: Single::new(
            problem,
            options.turn_charge,
            control.nodes,
            Random::new(seed, PATH_STREAM),
        ),
        team: Conflicts::new(problem.graph.len(), agents, rules),
        order: Order::new(agents),
        prefer: options.prefer,
        imprints: vec![Imprint::default(); agents],
        failed: vec![0; agents],
        lengths: vec![0; agents],
        cost: 0,
        best: None,
        effort: Effort::default(),
        nodes: control.nodes,
        stop: control.stop,
    };
    let end = run.search(control.memory);
    run.effort.expansions = run.single.sipp.expansions;
    run.effort.ranks = run.order.ranks();
    let outcome = match end {
        End::Solved => Outcome::Solved(run.paths()),
        End::Stopped => Outcome::Stopped(run.fallback()),
        End::Exhausted => Outcome::Exhausted(run.fallback()),
        End::Memory => Outcome::Memory(run.fallback()),
    };
    (outcome, run.effort)
}

/// Reason why the search ended.
enum End {
    Solved,
    Stopped,
    Exhausted,
    Memory,
}

/// The path of an agent.
type Planned = (u32, Found);

/// Bytes of paths.
fn size(paths: &[Planned]) -> u64 {
    let each = |(_, found): &Planned| size_of::<Planned>() + found.path.len() * size_of::<Vertex>();
    paths.iter().map(each).sum::<usize>() as u64
}

/// A node that has yet to be looked at: a decision, and the paths that it changes.
struct Child {
    decision: (u32, u32),
    paths: Vec<Planned>,
    cost: u64,
    collisions: usize,
}

impl Child {
    fn bytes(&self) -> u64 {
        size_of::<Self>() as u64 + size(&self.paths)
    }
}

/// A node on the way from the root to where the search is.
struct Frame {
    /// The decision that led here; none at the root.
    decision: Option<(u32, u32)>,
    /// The paths that the decision replaced.
    old: Vec<Planned>,
    /// Children not yet looked at, the next one last.
    children: Vec<Child>,
}

struct Run<'p, 's> {
    single: Single<'p>,
    team: Conflicts,
    order: Order,
    prefer: Prefer,
    /// The path of each agent as the tables have it.
    imprints: Vec<Imprint>,
    /// Number of searches of each agent that found no path.
    failed: Vec<u32>,
    /// Length of each path, and the sum.
    lengths: Vec<u32>,
    cost: u64,
    /// Collisions and paths of the best node that led no further.
    best: Option<(usize, Paths)>,
    effort: Effort,
    /// Most search nodes; 0 for no limit.
    nodes: u64,
    stop: &'s mut dyn FnMut() -> bool,
}

impl Run<'_, '_> {
    fn search(&mut self, memory: u64) -> End {
        if self.root().is_err() {
            return End::Stopped;
        }
        let mut frames = Leftover::new(vec![Frame {
            decision: None,
            old: Vec::new(),
            children: Vec::new(),
        }]);
        let (mut dead_ends, mut patience) = (0, PATIENCE);
        let mut bytes = 0;
        let mut fresh = true;
        loop {
            if self.is_spent() || (self.stop)() {
                self.remember();
                return End::Stopped;
            }
            let Some(frame) = frames.last_mut() else {
                return End::Exhausted;
            };
            if fresh {
                self.effort.nodes += 1;
                let Some(pair) = self.next_pair() else {
                    return End::Solved;
                };
                let Ok(children) = self.children(pair) else {
                    self.remember();
                    return End::Stopped;
                };
                frame.children = children;
                bytes += frame.children.iter().map(Child::bytes).sum::<u64>();
                if frame.children.is_empty() {
                    self.remember();
                    dead_ends += 1;
                    if dead_ends > patience {
                        // The search has lost its way: begin anew, and let those go first
                        // who found no path.
                        patience += patience / 2;
                        dead_ends = 0;
                        bytes = 0;
                        self.back_to_root(&mut frames);
                        continue;
                    }
                }
                if bytes > memory {
                    self.remember();
                    return End::Memory;
                }
            }
            if let Some(mut child) = frame.children.pop() {
                // What the child's paths replace takes its place, and about as much room.
                let decision = child.decision;
                self.order.decide(decision);
                self.exchange(&mut child.paths);
                frames.push(Frame {
                    decision: Some(decision),
                    old: child.paths,
                    children: Vec::new(),
                });
                fresh = true;
            } else {
                fresh = false;
                let Some(frame) = frames.pop() else {
                    return End::Exhausted;
                };
                bytes = bytes.saturating_sub(size_of::<Child>() as u64 + size(&frame.old));
                self.undo(frame);
            }
        }
    }

    /// True once the limit of search nodes is reached.
    fn is_spent(&self) -> bool {
        let spent = self.single.sipp.expansions + self.effort.paths * PATH;
        self.nodes > 0 && spent >= self.nodes
    }

    fn undo(&mut self, mut frame: Frame) {
        self.exchange(&mut frame.old);
        if let Some(decision) = frame.decision {
            self.order.forget(decision);
        }
    }

    /// Forgets all decisions.
    fn back_to_root(&mut self, frames: &mut Vec<Frame>) {
        while frames.len() > 1 {
            if let Some(frame) = frames.pop() {
                self.undo(frame);
            }
        }
        if let Some(root) = frames.first_mut() {
            root.children.clear();
        }
    }

    /// Everybody on a best path, one after the other, with no priorities.
    fn root(&mut self) -> Result<(), Stopped> {
        self.single.soft.reset(0);
        for agent in 0..self.single.problem.agents() {
            self.make_room();
            self.single.hard.reset(0);
            self.single.hold_others(agent);
            // Alone in the world everybody finds a path.
            let Ok(found) = self.single.path(agent, true, self.stop) else {
                return Err(Stopped);
            };
            self.effort.paths += 1;
            self.set(agent, &found);
            self.single.soft.stamp(&self.imprints[agent]);
            if (self.stop)() {
                return Err(Stopped);
            }
        }
        Ok(())
    }

    /// Gives an agent a path, and takes the one that it had.
    fn set(&mut self, agent: usize, found: &Found) -> Found {
        let path = self.team.path(agent).to_vec();
        let length = std::mem::replace(&mut self.lengths[agent], found.length);
        self.cost = self.cost + u64::from(found.length) - u64::from(length);
        self.team.set(agent, &found.path);
        self.imprint(agent);
        Found { path, length }
    }

    /// Sees to it that the path of an agent can be entered into the tables.
    fn imprint(&mut self, agent: usize) {
        let Single { problem, soft, .. } = &self.single;
        let path = self.team.path(agent);
        // Longer paths come when there is room for them.
        if problem.window > 0 || path.len() < soft.horizon() as usize {
            self.imprints[agent] = soft.imprint(&problem.graph, path, 0);
        }
    }

    /// Exchanges paths of the team with others.
    fn exchange(&mut self, paths: &mut [Planned]) {
        for (agent, found) in paths {
            *found = self.set(*agent as usize, found);
        }
    }

    /// The two agents to decide about: of the earliest collision, two that are not ordered.
    fn next_pair(&mut self) -> Option<(u32, u32)> {
        let first = self.team.all().iter().min()?.clone();
        let Kind::Ring(members) = &first.kind else {
            return Some((first.agents[0], first.agents[1]));
        };
        // In a ring some may be ordered already. If all were, the last would have kept out.
        for (at, (a, _)) in members.iter().enumerate() {
            for (b, _) in &members[at + 1..] {
                if !self.order.are_ordered((*a, *b)) {
                    return Some((*a, *b));
                }
            }
        }
        Some((first.agents[0], first.agents[1]))
    }

    /// Both decisions about a pair, as far as there are paths; the better one last.
    fn children(&mut self, (a, b): (u32, u32)) -> Result<Vec<Child>, Stopped> {
        let mut children = Vec::with_capacity(2);
        for decision in [(a, b), (b, a)] {
            children.extend(self.child(decision)?);
        }
        children.sort_by_key(|child| {
            let (cost, collisions) = (child.cost, child.collisions as u64);
            let (good, better) = match self.prefer {
                Prefer::Cost => (cost, collisions),
                Prefer::Collisions => (collisions, cost),
            };
            // The last is taken first.
            let failed = self.failed[child.decision.0 as usize];
            (failed, std::cmp::Reverse((good, better)))
        });
        Ok(children)
    }

    fn child(&mut self, decision: (u32, u32)) -> Result<Option<Child>, Stopped> {
        self.order.decide(decision);
        let mut old: Vec<Planned> = Vec::new();
        let planned = self.settle(decision.1, &mut old);
        let (cost, collisions) = (self.cost, self.team.all().len());
        self.exchange(&mut old);
        self.order.forget(decision);
        Ok(planned?.then_some(Child {
            decision,
            paths: old,
            cost,
            collisions,
        }))
    }

    /// Plans anew whoever, from an agent on, does not keep out of the way of those before
    /// it; false if somebody cannot. What paths were goes into `old`.
    fn settle(&mut self, agent: u32, old: &mut Vec<Planned>) -> Result<bool, Stopped> {
        for agent in self.order.from(agent) {
            self.order.mark_before(agent);
            let order = &self.order;
            let to_blame = |other: &u32| *other == agent || order.is_before(*other);
            let in_the_way = |conflict: &Conflict| {
                conflict.involves(agent)
                    && match &conflict.kind {
                        Kind::Ring(members) => members.iter().all(|(member, _)| to_blame(member)),
                        _ => conflict.agents.iter().all(to_blame),
                    }
            };
            if !self.team.all().iter().any(in_the_way) {
                continue;
            }
            match self.replan(agent as usize) {
                Ok(found) => old.push((agent, self.set(agent as usize, &found))),
                Err(Miss::NoPath) => {
                    self.failed[agent as usize] += 1;
                    return Ok(false);
                }
                Err(Miss::Stopped) => return Err(Stopped),
            }
        }
        Ok(true)
    }

    /// The path of an agent that keeps out of the way of those marked to be before it.
    fn replan(&mut self, agent: usize) -> Result<Found, Miss> {
        self.make_room();
        self.effort.paths += 1;
        let Single {
            problem,
            hard,
            soft,
            ..
        } = &mut self.single;
        hard.reset(0);
        soft.reset(0);
        for other in (0..problem.agents()).filter(|&other| other != agent) {
            let table = if self.order.is_before(other as u32) {
                &mut *hard
            } else {
                &mut *soft
            };
            table.stamp(&self.imprints[other]);
        }
        // Whoever comes later has to get away from its start as well.
        self.single.hold_others(agent);
        self.single.path(agent, true, self.stop)
    }

    /// Sees to it that all paths fit into the tables.
    fn make_room(&mut self) {
        let Single {
            problem,
            hard,
            soft,
            ..
        } = &mut self.single;
        if problem.window > 0 {
            return;
        }
        let longest = (0..problem.agents()).map(|agent| self.team.path(agent).len());
        let needed = longest.max().unwrap_or(0) + 1;
        if needed > hard.horizon() as usize {
            hard.reset(needed);
            soft.reset(needed);
            for agent in 0..self.imprints.len() {
                self.imprint(agent);
                self.single.soft.stamp(&self.imprints[agent]);
            }
        }
    }

    fn paths(&self) -> Paths {
        let agents = 0..self.single.problem.agents();
        agents.map(|agent| self.team.path(agent).to_vec()).collect()
    }

    /// Keeps the paths of this node if they are the best so far.
    fn remember(&mut self) {
        let collisions = self.team.all().len();
        if self
            .best
            .as_ref()
            .is_none_or(|(least, _)| collisions < *least)
        {
            self.best = Some((collisions, self.paths()));
        }
    }

    /// The best paths where there is no plan. Stopped at the root, some agents have none yet and
    /// get their shortest.
    fn fallback(&mut self) -> Paths {
        let mut paths = match self.best.take() {
            Some((_, paths)) => paths,
            None => self.paths(),
        };
        for (agent, path) in paths.iter_mut().enumerate() {
            if path.is_empty() {
                *path = self.single.problem.shortest(agent);
            }
        }
        paths
    }
}

/// The run was stopped.
struct Stopped;
