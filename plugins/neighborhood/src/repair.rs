//! Repair of paths that collide, a neighbourhood of agents at a time.
//!
//! MAPF-LNS2: J. Li, Z. Chen, D. Harabor, P. J. Stuckey, S. Koenig, "MAPF-LNS2: fast
//! repairing for multi-agent path finding via large neighborhood search", AAAI 2022. The
//! agents get paths one after the other, each meeting as few of the others as it can. Then
//! a few at a time are planned anew in the same way, and the outcome is kept if no more
//! pairs of agents collide than before. Which agents is chosen in three ways; ways that
//! have led further are taken more often.

use fleetyard_plugin_spacetime::conflict::{Conflict, Conflicts, Rules, Visit};
use fleetyard_plugin_spacetime::graph::Vertex;
use fleetyard_plugin_spacetime::plan::Paths;
use fleetyard_plugin_spacetime::problem::Problem;
use fleetyard_plugin_spacetime::random::Random;

use crate::fewest::Fewest;

/// Rate at which the weights of the ways to choose follow success, as in the paper.
const REACTION: f64 = 0.01;
/// Steps of a walk over the map in search of somebody.
const WALK: usize = 32;
/// Walks tried for each place that is left in a neighbourhood.
const WALKS: usize = 4;
/// Random stream of the repair.
const STREAM: u64 = 1 << 16;

/// Limits of a run.
pub struct Control<'a> {
    /// Says when to stop: a deadline has passed, or the work is cancelled. Asked often.
    pub stop: &'a mut dyn FnMut() -> bool,
    /// Searches for one agent and neighbourhoods that are left to try.
    pub nodes: u64,
}

impl Control<'_> {
    /// Takes one from what is left. True when nothing is, or it is time to stop.
    pub(crate) fn spend(&mut self) -> bool {
        if self.nodes == 0 {
            return true;
        }
        self.nodes -= 1;
        (self.stop)()
    }
}

/// Result of a repair.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Repaired {
    /// One path per agent, from its start to its goal; of those that were never planned
    /// only the start.
    pub paths: Paths,
    /// True if all agents have paths, and these do not collide.
    pub valid: bool,
    /// Pairs of agents that collided after everybody was planned once.
    pub pairs_at_first: usize,
    /// Neighbourhoods tried.
    pub neighborhoods: u64,
}

/// A way to choose a neighbourhood.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Choice {
    /// Agents that collide with one another.
    Collision,
    /// One that collides, and those that park in its way or pass where it wants to park.
    Failure,
    /// Anybody, those that collide more often.
    Random,
}

const CHOICES: [Choice; 3] = [Choice::Collision, Choice::Failure, Choice::Random];

/// Paths that do not collide, for a problem with one goal per agent, its own, to stay at.
/// `size` agents are planned anew at a time. What is found when a limit is met has fewer
/// collisions than the paths had at first.
pub fn repair(problem: &Problem, size: usize, seed: u64, control: &mut Control<'_>) -> Repaired {
    let rules = Rules {
        rings: !problem.cycles,
        ..Rules::default()
    };
    let agents = problem.agents();
    let mut work = Repair {
        problem,
        size: size.clamp(1, agents.max(1)),
        team: Conflicts::new(problem.graph.len(), agents, rules),
        search: Fewest::default(),
        random: Random::new(seed, STREAM),
        weights: [1.0; CHOICES.len()],
        members: Vec::new(),
        chosen: vec![false; agents],
    };
    let mut repaired = Repaired {
        paths: Paths::new(),
        valid: false,
        pairs_at_first: 0,
        neighborhoods: 0,
    };
    if work.begin(control) {
        repaired.pairs_at_first = pairs(work.team.all());
        while !work.team.all().is_empty() && !control.spend() {
            repaired.neighborhoods += 1;
            work.improve(control);
        }
        repaired.valid = work.team.all().is_empty();
    }
    repaired.paths = (0..agents)
        .map(|agent| match work.team.path(agent) {
            [] => vec![problem.routes[agent].start],
            path => path.to_vec(),
        })
        .collect();
    repaired
}

/// Number of pairs of agents that collide.
fn pairs(conflicts: &[Conflict]) -> usize {
    let mut pairs: Vec<[u32; 2]> = conflicts.iter().map(|conflict| conflict.agents).collect();
    pairs.sort_unstable();
    pairs.dedup();
    pairs.len()
}

/// A repair under way.
struct Repair<'p> {
    problem: &'p Problem,
    size: usize,
    team: Conflicts,
    search: Fewest,
    random: Random,
    weights: [f64; CHOICES.len()],
    /// The neighbourhood, and per agent whether it is in it.
    members: Vec<u32>,
    chosen: Vec<bool>,
}

impl Repair<'_> {
    /// Plans everybody once. False when a limit was met.
    fn begin(&mut self, control: &mut Control<'_>) -> bool {
        let mut order: Vec<u32> = (0..self.problem.agents() as u32).collect();
        self.random.shuffle(&mut order);
        order
            .into_iter()
            .all(|agent| !control.spend() && self.plan(agent, control))
    }

    /// Gives an agent that is nowhere the path that meets the fewest others.
    fn plan(&mut self, agent: u32, control: &mut Control<'_>) -> bool {
        let route = &self.problem.routes[agent as usize];
        let (graph, random) = (&self.problem.graph, &mut self.random);
        let found = self.search.plan(
            graph,
            &self.team,
            (agent, route.start),
            route,
            random,
            control.stop,
        );
        if let Some(path) = &found {
            self.team.set(agent as usize, path);
        }
        found.is_some()
    }

    /// Plans a neighbourhood anew, and keeps that unless more pairs collide than before.
    fn improve(&mut self, control: &mut Control<'_>) {
        let way = self.draw();
        let mut members = self.choose(CHOICES[way]);
        let of_members: Vec<Conflict> = {
            let conflicts = self.team.all().iter();
            let involved = conflicts.filter(|c| members.iter().any(|&m| c.involves(m)));
            involved.cloned().collect()
        };
        let before = pairs(&of_members);
        let old: Vec<Vec<Vertex>> = members
            .iter()
            .map(|&member| self.team.path(member as usize).to_vec())
            .collect();
        let restored: Vec<(u32, Vec<Vertex>)> = members.iter().copied().zip(old).collect();
        for &member in &members {
            self.team.clear(member as usize);
        }
        // What is found from here on stands at the end of the list.
        let others = self.team.all().len();
        self.random.shuffle(&mut members);
        let mut after = 0;
        let better = members.iter().all(|&member| {
            let planned = self.plan(member, control);
            after = pairs(&self.team.all()[others..]);
            planned && after <= before
        });
        if !better {
            for (member, path) in &restored {
                self.team.set(*member as usize, path);
            }
            after = before;
        }
        let gain = (before - after) as f64;
        self.weights[way] = REACTION * gain + (1.0 - REACTION) * self.weights[way];
    }

    /// A way to choose, with a probability in proportion to its weight.
    fn draw(&mut self) -> usize {
        let total: f64 = self.weights.iter().sum();
        let mut left = total * self.random.below(1 << 24) as f64 / f64::from(1 << 24);
        let found = self.weights.iter().position(|weight| {
            left -= weight;
            left < 0.0
        });
        found.unwrap_or(0)
    }

    /// A neighbourhood.
    fn choose(&mut self, choice: Choice) -> Vec<u32> {
        self.members.clear();
        let agents = self.problem.agents();
        let mut degrees = vec![0_usize; agents];
        for conflict in self.team.all() {
            for agent in conflict.agents {
                degrees[agent as usize] += 1;
            }
        }
        match choice {
            Choice::Random => {
                for degree in &mut degrees {
                    *degree += 1;
                }
                while self.members.len() < self.size {
                    let Some(agent) = self.by_weight(&degrees) else {
                        break;
                    };
                    degrees[agent as usize] = 0;
                    self.take(agent);
                }
            }
            Choice::Collision => {
                for degree in &mut degrees {
                    *degree = (*degree).min(1);
                }
                if let Some(agent) = self.by_weight(&degrees) {
                    self.take(agent);
                    self.colliding();
                    self.passing();
                }
            }
            Choice::Failure => {
                if let Some(agent) = self.by_weight(&degrees) {
                    self.take(agent);
                    self.parking(agent);
                    self.passing();
                }
            }
        }
        let members = std::mem::take(&mut self.members);
        for &member in &members {
            self.chosen[member as usize] = false;
        }
        members
    }

    fn by_weight(&mut self, weights: &[usize]) -> Option<u32> {
        let total: usize = weights.iter().sum();
        let mut left = self.random.below(total);
        let found = weights.iter().position(|&weight| {
            let here = left < weight;
            left = left.wrapping_sub(weight);
            here
        });
        found.map(|agent| agent as u32)
    }

    /// Those that collide with members, and so on, in random order.
    fn colliding(&mut self) {
        let mut next = 0;
        while next < self.members.len() && self.members.len() < self.size {
            let member = self.members[next];
            next += 1;
            let others: Vec<u32> = self
                .team
                .all()
                .iter()
                .filter(|conflict| conflict.involves(member))
                .flat_map(|conflict| conflict.agents)
                .collect();
            self.take_all(others);
        }
    }

    /// Those whose goals lie on the path of an agent, and those that pass its goal.
    fn parking(&mut self, agent: u32) {
        let path = self.team.path(agent as usize).to_vec();
        let Some(&goal) = path.last() else { return };
        let others: Vec<u32> = path
            .iter()
            .flat_map(|&v| self.team.visits(v).iter().map(move |visit| (v, visit)))
            .filter(|(v, visit)| visit.next == *v || *v == goal)
            .map(|(_, visit)| visit.agent)
            .collect();
        self.take_all(others);
    }

    /// Takes agents, who may come more than once, in random order.
    fn take_all(&mut self, mut others: Vec<u32>) {
        others.sort_unstable();
        others.dedup();
        self.random.shuffle(&mut others);
        for other in others {
            self.take(other);
        }
    }

    /// Takes the agents that are met on walks which begin on the path of a member.
    fn passing(&mut self) {
        for _ in 0..WALKS * self.size {
            if self.members.len() >= self.size {
                return;
            }
            let member = self.members[self.random.below(self.members.len())];
            let path = self.team.path(member as usize);
            let begin = self.random.below(path.len());
            let Some(&from) = path.get(begin) else { return };
            let mut v = from;
            for time in begin + 1..=begin + WALK {
                let graph = &self.problem.graph;
                let step = self.random.below(graph.degree(v) as usize + 1);
                v = graph.neighbors(v).nth(step).unwrap_or(v);
                let there =
                    |visit: &&Visit| visit.from as usize <= time && time <= visit.until as usize;
                let met = self.team.visits(v).iter().filter(there);
                let met = met
                    .map(|visit| visit.agent)
                    .find(|&a| !self.chosen[a as usize]);
                if let Some(other) = met {
                    self.take(other);
                    break;
                }
            }
        }
    }

    /// Makes an agent a member, if there is room.
    fn take(&mut self, agent: u32) {
        if self.members.len() < self.size && !self.chosen[agent as usize] {
            self.chosen[agent as usize] = true;
            self.members.push(agent);
        }
    }
}
