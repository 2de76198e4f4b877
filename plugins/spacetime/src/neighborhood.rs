//! Neighbourhoods: groups of agents to replan together.
//!
//! The neighbourhoods of J. Li, Z. Chen, D. Harabor, P. J. Stuckey, S. Koenig,
//! "Anytime multi-agent path finding via large neighborhood search", IJCAI 2021, in
//! our own variants: around a delayed agent, around a place, at random; and one more
//! for agents that arrive late because others still cross their goals.

use crate::graph::{Graph, Vertex};
use crate::plan::Paths;
use crate::random::Random;

/// The rule by which a neighbourhood is chosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A delayed agent and those in the way of shorter paths.
    Delay,
    /// A delayed agent and those that visit the surroundings of its path.
    Place,
    /// A delayed agent and those that cross its goal, or park where it passes.
    Goal,
    /// Anybody.
    Random,
}

/// Costs of the paths of a team, and those that they could have.
pub trait Standing {
    /// Cost by which the path of an agent exceeds the one that it would have alone.
    fn delay(&self, agent: usize) -> usize;

    /// True if an agent could be at `v` at this time on a path that costs less than its own.
    fn gains(&self, agent: usize, v: Vertex, time: usize) -> bool;
}

/// Walks tried to find agents in the way.
const WALKS: usize = 12;
/// Agents that are delayed more are chosen no more often.
const MOST_DELAY: usize = 1 << 16;

/// Chooses neighbourhoods; keeps, for each vertex, the agents that pass.
#[derive(Debug)]
pub struct Chooser<'g> {
    graph: &'g Graph,
    goals: Vec<Vertex>,
    /// Lists of agents, once for each arrival in a vertex: the first is that of vertices where nobody
    /// has come yet.
    visits: Vec<Vec<u32>>,
    /// Per vertex the place of its list.
    list: Vec<u32>,
    /// The agent whose goal a vertex is.
    owners: Vec<u32>,
    /// Agents already spoken for.
    taken: Vec<bool>,
    members: Vec<u32>,
    seen: Vec<u32>,
    stamp: u32,
}

impl<'g> Chooser<'g> {
    /// For a team on its paths, each of which ends at the goal for good. Without goals there are no
    /// neighbourhoods around them ([`Kind::Goal`]).
    pub fn new(graph: &'g Graph, goals: &[Vertex], paths: &Paths) -> Self {
        let mut owners = vec![u32::MAX; graph.len()];
        for (agent, &goal) in goals.iter().enumerate() {
            owners[goal as usize] = agent as u32;
        }
        let mut chooser = Self {
            graph,
            goals: goals.to_vec(),
            visits: vec![Vec::new()],
            list: vec![0; graph.len()],
            owners,
            taken: vec![false; paths.len()],
            members: Vec::new(),
            seen: vec![0; graph.len()],
            stamp: 0,
        };
        for (agent, path) in paths.iter().enumerate() {
            chooser.add(agent as u32, path);
        }
        chooser
    }

    /// An agent has this path now.
    pub fn add(&mut self, agent: u32, path: &[Vertex]) {
        let mut last = Vertex::MAX;
        for &v in path {
            if v != last {
                let list = &mut self.list[v as usize];
                if *list == 0 {
                    *list = self.visits.len() as u32;
                    self.visits.push(Vec::new());
                }
                self.visits[*list as usize].push(agent);
            }
            last = v;
        }
    }

    /// An agent has this path no longer.
    pub fn remove(&mut self, agent: u32, path: &[Vertex]) {
        let mut last = Vertex::MAX;
        for &v in path {
            if v != last {
                let visits = &mut self.visits[self.list[v as usize] as usize];
                if let Some(at) = visits.iter().position(|&a| a == agent) {
                    visits.swap_remove(at);
                }
            }
            last = v;
        }
    }

    /// The agents that pass a vertex, once for each arrival there.
    fn visits(&self, v: Vertex) -> &[u32] {
        &self.visits[self.list[v as usize] as usize]
    }

    /// Makes all agents available again.
    pub fn release(&mut self) {
        self.taken.fill(false);
    }

    /// Chooses up to `size` agents that no neighbourhood has had since the last
    /// [`Chooser::release`].
    pub fn choose(
        &mut self,
        kind: Kind,
        size: usize,
        paths: &Paths,
        standing: &impl Standing,
        random: &mut Random,
    ) -> Vec<u32> {
        self.members.clear();
        if kind == Kind::Random {
            for _ in 0..4 * size {
                if self.members.len() < size {
                    let agent = random.below(paths.len()) as u32;
                    self.take(agent);
                }
            }
            return std::mem::take(&mut self.members);
        }
        let Some(seed) = self.delayed(standing, random) else {
            return Vec::new();
        };
        self.take(seed);
        match kind {
            Kind::Delay => self.in_the_way(seed, size, paths, standing, random),
            Kind::Place => self.around_path(seed, size, paths, random),
            Kind::Goal => self.around_goal(seed, size, paths, standing, random),
            Kind::Random => {}
        }
        std::mem::take(&mut self.members)
    }

    /// A free agent, with probability in proportion to its delay.
    fn delayed(&self, standing: &impl Standing, random: &mut Random) -> Option<u32> {
        let delay = |agent: usize| {
            if self.taken[agent] {
                0
            } else {
                standing.delay(agent).min(MOST_DELAY)
            }
        };
        let agents = self.taken.len();
        let total: usize = (0..agents).map(delay).sum();
        if total == 0 {
            return None;
        }
        let mut left = random.below(total);
        (0..agents)
            .find(|&agent| {
                let delay = delay(agent);
                if left < delay {
                    return true;
                }
                left -= delay;
                false
            })
            .map(|agent| agent as u32)
    }

    /// Walks of the agent towards an earlier arrival; whoever blocks them is a member.
    fn in_the_way(
        &mut self,
        seed: u32,
        size: usize,
        paths: &Paths,
        standing: &impl Standing,
        random: &mut Random,
    ) {
        let path = &paths[seed as usize];
        let steps = path.len() - 1;
        for walk in 0..WALKS {
            if self.members.len() >= size {
                return;
            }
            let mut t = if walk == 0 {
                0
            } else {
                random.below(steps.max(1))
            };
            let mut v = path[t];
            while self.members.len() < size {
                let mut choices = [v; 5];
                let mut count = 0;
                for u in self.graph.neighbors(v).chain([v]) {
                    if standing.gains(seed as usize, u, t + 1) {
                        choices[count] = u;
                        count += 1;
                    }
                }
                if count == 0 {
                    break;
                }
                let next = choices[random.below(count)];
                self.take_occupant(next, t + 1, paths);
                if next != v {
                    // The one that comes the other way, if there is one.
                    for k in 0..self.visits(v).len() {
                        let other = self.visits(v)[k];
                        let path = &paths[other as usize];
                        if path.get(t) == Some(&next) && path.get(t + 1) == Some(&v) {
                            self.take(other);
                            break;
                        }
                    }
                }
                v = next;
                t += 1;
            }
        }
    }

    /// Visitors of a random vertex on the agent's path, then of its surroundings.
    fn around_path(&mut self, seed: u32, size: usize, paths: &Paths, random: &mut Random) {
        let path = &paths[seed as usize];
        let center = path[random.below(path.len())];
        self.stamp += 1;
        let stamp = self.stamp;
        self.seen[center as usize] = stamp;
        let mut queue = vec![center];
        let mut next = 0;
        while self.members.len() < size && next < queue.len() {
            let v = queue[next];
            next += 1;
            let count = self.visits(v).len();
            let first = random.below(count);
            for k in 0..count {
                if self.members.len() < size {
                    let agent = self.visits(v)[(first + k) % count];
                    self.take(agent);
                }
            }
            let around = *self.graph.around(v);
            let turn = random.below(around.len());
            for k in 0..around.len() {
                let u = around[(k + turn) % around.len()];
                if u != self.graph.wall() && self.seen[u as usize] != stamp {
                    self.seen[u as usize] = stamp;
                    queue.push(u);
                }
            }
        }
    }

    /// Those that cross the agent's goal after it could have come, latest first, and
    /// those that park on its path.
    fn around_goal(
        &mut self,
        seed: u32,
        size: usize,
        paths: &Paths,
        standing: &impl Standing,
        random: &mut Random,
    ) {
        let path = &paths[seed as usize];
        let Some(&goal) = self.goals.get(seed as usize) else {
            return;
        };
        let earliest = (path.len() - 1).saturating_sub(standing.delay(seed as usize));
        let mut crossing: Vec<(usize, u32)> = self
            .visits(goal)
            .iter()
            .filter(|&&agent| agent != seed)
            .filter_map(|&agent| {
                let last = paths[agent as usize].iter().rposition(|&v| v == goal)?;
                (last >= earliest).then_some((last, agent))
            })
            .collect();
        crossing.sort_unstable();
        while let Some((_, agent)) = crossing.pop() {
            if self.members.len() < size {
                self.take(agent);
            }
        }
        let first = random.below(path.len());
        for k in 0..path.len() {
            let v = path[(first + k) % path.len()];
            let owner = self.owners[v as usize];
            if owner != u32::MAX && self.members.len() < size {
                self.take(owner);
            }
        }
    }

    fn take_occupant(&mut self, v: Vertex, t: usize, paths: &Paths) {
        let stands = |agent: u32| {
            let path = &paths[agent as usize];
            path.get(t).or(path.last()) == Some(&v)
        };
        let found = self.visits(v).iter().copied().find(|&agent| stands(agent));
        if let Some(agent) = found {
            self.take(agent);
        }
    }

    fn take(&mut self, agent: u32) {
        if !self.taken[agent as usize] {
            self.taken[agent as usize] = true;
            self.members.push(agent);
        }
    }
}
