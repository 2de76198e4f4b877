//! The high level: best-first search of the constraint tree.

use std::cell::{Cell, OnceCell};
use std::rc::Rc;

use super::clash::{Clash, weighed};
use super::constraint::{Bans, Constraint, MOST_LANDMARKS, Place};
use super::cover::cover;
use super::focal::Focal;
use super::low::{Low, Query, Stopped};
use super::path::{Single, Track};
use super::queue::{Queue, Rank};
use super::{Branching, End, Settings, Team};
use crate::roadmap::Roadmap;
use fleetyard_abi::leftovers::Leftover;

/// The parent of the root.
const ROOT: u32 = u32::MAX;

/// Open nodes that are dropped at a time.
const FORGOTTEN: usize = 1 << 12;

/// Expansions after which the search for a pair ends with the bound that it has.
const PAIR_LIMIT: u64 = 64;

/// The memory that all searches share.
#[derive(Debug)]
pub(super) struct Tools {
    bans: Bans,
    pub(super) low: Low,
    pub(super) focal: Focal,
}

impl Tools {
    pub(super) fn new(roadmap: &Roadmap) -> Self {
        Self {
            bans: Bans::new(roadmap),
            low: Low::new(roadmap),
            focal: Focal::new(roadmap),
        }
    }
}

/// Two agents whose paths conflict. Nodes share it as long as both paths are the same.
#[derive(Debug)]
struct Pair {
    agents: [u32; 2],
    clashes: Vec<Clash>,
    /// The conflict to split, and how much later the first and the second agent arrive if they give way.
    split: OnceCell<(Clash, [f64; 2])>,
    /// Seconds that both arrive later together, at least.
    weight: Cell<Option<f64>>,
}

impl Pair {
    /// Seconds that both arrive later together, as far as is known.
    fn least(&self) -> f64 {
        let split = self.split.get();
        let rises = split.map_or(0.0, |(_, rises)| rises[0].min(rises[1]));
        self.weight.get().unwrap_or(rises)
    }
}

/// A node of the constraint tree.
#[derive(Debug)]
struct Node {
    parent: u32,
    constraint: Option<Constraint>,
    /// Paths that differ from the parent's.
    changed: Vec<(u32, Rc<Single>)>,
    pairs: Vec<Rc<Pair>>,
    rank: Rank,
    /// The bound has in it what pairs have to give up.
    is_weighed: bool,
}

impl Node {
    /// Bytes that it takes.
    fn bytes(&self) -> usize {
        let paths = self.changed.iter().map(|(_, path)| path.bytes() + 16);
        // About a third of the pairs are its own.
        size_of::<Self>()
            + paths.sum::<usize>()
            + self.pairs.len() * (size_of::<Pair>() / 3 + 40)
            + 100
    }
}

/// The tree of a team, or of some of its agents.
#[derive(Debug)]
pub(super) struct Tree {
    /// The agents that it is for, in order.
    members: Vec<u32>,
    /// Constraints of every node.
    base: Vec<Constraint>,
    nodes: Leftover<Vec<Node>>,
    queue: Leftover<Queue>,
    /// Paths may arrive later than the earliest ones by this factor.
    weight: f64,
    bytes: usize,
    /// Paths and tracks of the node that was loaded last, by the number of the member.
    loaded: Vec<Option<Rc<Single>>>,
    tracks: Vec<Track>,
    /// The tree of a pair.
    of_pair: Option<Box<Tree>>,
    /// The least bound of nodes that were dropped for want of memory.
    forgotten: f64,
    pub(super) expanded: u64,
    pub(super) generated: u64,
    pub(super) bypassed: u64,
}

impl Tree {
    pub(super) fn new(members: Vec<u32>, weight: f64) -> Self {
        Self {
            base: Vec::new(),
            nodes: Leftover::default(),
            queue: Leftover::new(Queue::new(weight)),
            weight,
            bytes: 0,
            loaded: vec![None; members.len()],
            tracks: members.iter().map(|_| Track::default()).collect(),
            of_pair: None,
            forgotten: f64::INFINITY,
            expanded: 0,
            generated: 0,
            bypassed: 0,
            members,
        }
    }

    /// The paths of the node that was loaded last.
    pub(super) fn paths(&self) -> impl Iterator<Item = &Single> {
        self.loaded.iter().flatten().map(|path| &**path)
    }

    /// No plan costs less.
    pub(super) fn bound(&self) -> f64 {
        self.queue
            .bound()
            .unwrap_or(f64::INFINITY)
            .min(self.forgotten)
    }

    fn local(&self, agent: u32) -> usize {
        let found = self.members.binary_search(&agent);
        found.unwrap_or_else(|_| unreachable!("the tree is for the agents of its conflicts"))
    }

    /// Begins with the earliest paths; false if there is none for one.
    pub(super) fn root(
        &mut self,
        team: &Team<'_>,
        tools: &mut Tools,
        stop: &mut dyn FnMut() -> bool,
    ) -> Result<bool, Stopped> {
        let mut paths = Vec::with_capacity(self.members.len());
        for agent in self.members.clone() {
            if stop() {
                return Err(Stopped);
            }
            let Some(path) = self.plan(team, tools, agent, ROOT, None, stop)? else {
                return Ok(false);
            };
            let path = Rc::new(path);
            self.place(team, self.local(agent), Rc::clone(&path));
            paths.push(path);
        }
        self.begin(team, paths);
        Ok(true)
    }

    /// Begins with paths that keep the constraints of every node.
    fn begin(&mut self, team: &Team<'_>, paths: Vec<Rc<Single>>) {
        let cost = paths.iter().map(|path| path.cost).sum();
        let bound = paths.iter().map(|path| path.bound).sum();
        let changed: Vec<(u32, Rc<Single>)> = self.members.iter().copied().zip(paths).collect();
        for (local, (_, path)) in changed.iter().enumerate() {
            self.place(team, local, Rc::clone(path));
        }
        let mut pairs = Vec::new();
        for (second, other) in self.members.iter().enumerate() {
            for (first, one) in self.members[..second].iter().enumerate() {
                let tracks = [&self.tracks[first], &self.tracks[second]];
                pairs.extend(pair(team, [*one, *other], tracks));
            }
        }
        let conflicts = pairs.len() as u32;
        self.add(Node {
            parent: ROOT,
            constraint: None,
            changed,
            pairs,
            rank: Rank {
                bound,
                cost,
                conflicts,
            },
            is_weighed: false,
        });
    }

    /// Expands nodes until there is a plan or a reason to stop; the paths are those that are loaded then.
    pub(super) fn run(
        &mut self,
        team: &Team<'_>,
        tools: &mut Tools,
        settings: &Settings,
        stop: &mut dyn FnMut() -> bool,
    ) -> End {
        let before = self.expanded;
        loop {
            if stop() {
                return End::Stopped;
            }
            while self.bytes as u64 > settings.memory_limit {
                if !self.forget() {
                    return End::Memory;
                }
                if stop() {
                    return End::Stopped;
                }
            }
            let nodes = &self.nodes;
            let Some(id) = self.queue.pop(|id| nodes[id as usize].rank) else {
                return if self.forgotten.is_finite() {
                    End::Memory
                } else {
                    End::Infeasible
                };
            };
            self.load(team, id);
            let node = &self.nodes[id as usize];
            let rank = node.rank;
            if rank.conflicts == 0 {
                // Its bound is one of those that the sum of costs is compared with.
                self.queue.push(id, rank);
                return End::Solved;
            }
            if settings.weight <= 1.0 && !node.is_weighed {
                match self.weigh(team, tools, settings, id, stop) {
                    Err(Stopped) => {
                        self.queue.push(id, rank);
                        return End::Stopped;
                    }
                    Ok((f64::INFINITY, _)) => continue,
                    Ok((bound, is_weighed)) => {
                        let node = &mut self.nodes[id as usize];
                        node.is_weighed = is_weighed;
                        if bound > rank.bound {
                            node.rank.bound = bound;
                            self.queue.push(id, node.rank);
                            continue;
                        }
                    }
                }
            }
            let spent = self.expanded - before;
            if settings.node_limit.is_some_and(|limit| spent >= limit) {
                self.queue.push(id, rank);
                return End::Nodes;
            }
            self.expanded += 1;
            if self.expand(team, tools, settings, id, stop).is_err() {
                self.queue.push(id, self.nodes[id as usize].rank);
                return End::Stopped;
            }
        }
    }

    /// Drops open nodes that are the least promising, so few that it takes no time; false if there are
    /// none to spare.
    fn forget(&mut self) -> bool {
        let nodes = &self.nodes;
        let gone = self.queue.forget(FORGOTTEN, |id| nodes[id as usize].rank);
        let any = !gone.is_empty();
        for id in gone {
            let node = &mut self.nodes[id as usize];
            self.bytes -= node.bytes();
            self.forgotten = self.forgotten.min(node.rank.bound);
            (node.changed, node.pairs) = (Vec::new(), Vec::new());
            self.bytes += node.bytes();
        }
        any
    }

    /// A lower bound of what plans below a node cost, from what pairs of agents have to give up; infinite if there is none. It
    /// is as good as it can be only where that does not put off the node for others: then it is true.
    fn weigh(
        &mut self,
        team: &Team<'_>,
        tools: &mut Tools,
        settings: &Settings,
        id: u32,
        stop: &mut dyn FnMut() -> bool,
    ) -> Result<(f64, bool), Stopped> {
        let node = &self.nodes[id as usize];
        let (cost, pairs) = (node.rank.cost, node.pairs.clone());
        let others = self.queue.bound().unwrap_or(f64::INFINITY);
        let enough = node.rank.bound.max(others);
        let mut weights: Vec<f64> = pairs.iter().map(|pair| pair.least()).collect();
        let bound = |weights: &[f64]| {
            let edges = pairs.iter().zip(weights);
            let edges = edges.map(|(pair, weight)| (pair.agents[0], pair.agents[1], *weight));
            cost + cover(&edges.filter(|edge| edge.2 > 0.0).collect::<Vec<_>>())
        };
        if weights.contains(&f64::INFINITY) {
            return Ok((f64::INFINITY, true));
        }
        let mut known = bound(&weights);
        if known > enough {
            return Ok((known, false));
        }
        let searches = settings.pairs && self.members.len() > 2;
        for is_searched in [false, true] {
            if is_searched && !searches {
                break;
            }
            for (number, pair) in pairs.iter().enumerate() {
                let more = if is_searched {
                    self.weight(team, tools, settings, id, pair, stop)?
                } else {
                    self.split(team, tools, settings, id, pair, stop)?;
                    pair.least()
                };
                if more == f64::INFINITY {
                    return Ok((more, true));
                }
                if more > weights[number] {
                    weights[number] = more;
                    known = bound(&weights);
                    if known > enough {
                        return Ok((known, false));
                    }
                }
            }
        }
        Ok((known, true))
    }

    /// Seconds that two agents arrive later together, at least, by a search for both alone.
    fn weight(
        &mut self,
        team: &Team<'_>,
        tools: &mut Tools,
        settings: &Settings,
        id: u32,
        pair: &Rc<Pair>,
        stop: &mut dyn FnMut() -> bool,
    ) -> Result<f64, Stopped> {
        if let Some(known) = pair.weight.get() {
            return Ok(known);
        }
        let mut tree = self
            .of_pair
            .take()
            .unwrap_or_else(|| Box::new(Self::new(pair.agents.to_vec(), 1.0)));
        tree.members.copy_from_slice(&pair.agents);
        tree.nodes.clear();
        tree.queue.clear();
        (tree.bytes, tree.forgotten) = (0, f64::INFINITY);
        tree.base.clear();
        let relevant = self
            .constraints(id)
            .filter(|constraint| pair.agents.iter().any(|agent| constraint.binds(*agent)));
        tree.base.extend(relevant);
        let paths = pair
            .agents
            .iter()
            .filter_map(|agent| self.loaded[self.local(*agent)].clone());
        let paths: Vec<Rc<Single>> = paths.collect();
        let alone: f64 = paths.iter().map(|path| path.cost).sum();
        tree.begin(team, paths);
        let limited = Settings {
            node_limit: Some(PAIR_LIMIT),
            ..*settings
        };
        let end = tree.run(team, tools, &limited, stop);
        let bound = tree.bound();
        self.of_pair = Some(tree);
        let weight = match end {
            End::Stopped => return Err(Stopped),
            End::Infeasible => f64::INFINITY,
            _ => (bound - alone).max(pair.least()),
        };
        pair.weight.set(Some(weight));
        Ok(weight)
    }

    /// The conflict of a pair that is to be split, and how much later each agent arrives if it gives way: conflicts in which both
    /// have to come first (prioritised conflicts: Andreychuk et al., AAAI 2021).
    fn split(
        &self,
        team: &Team<'_>,
        tools: &mut Tools,
        settings: &Settings,
        id: u32,
        pair: &Pair,
        stop: &mut dyn FnMut() -> bool,
    ) -> Result<(Clash, [f64; 2]), Stopped> {
        if let Some(known) = pair.split.get() {
            return Ok(*known);
        }
        let mut best: Option<(Clash, [f64; 2])> = None;
        for clash in &pair.clashes {
            let mut rises = [0.0; 2];
            for constraint in clash.split(pair.agents, settings.branching) {
                // The agent that has to give way.
                let number = match constraint {
                    Constraint::ArriveBefore { agent, .. } => usize::from(agent == pair.agents[0]),
                    _ => usize::from(constraint.agent() == pair.agents[1]),
                };
                let agent = pair.agents[number];
                let found = self.plan(team, tools, agent, id, Some(&constraint), stop)?;
                let now = self.loaded[self.local(agent)]
                    .as_ref()
                    .map_or(0.0, |path| path.bound);
                rises[number] = found.map_or(f64::INFINITY, |path| (path.bound - now).max(0.0));
            }
            let worth = |rises: &[f64; 2]| [rises[0].min(rises[1]), rises[0].max(rises[1])];
            if best.is_none_or(|(_, known)| worth(&rises) > worth(&known)) {
                best = Some((*clash, rises));
            }
        }
        let best = best.unwrap_or_else(|| unreachable!("a pair has a conflict"));
        Ok(*pair.split.get_or_init(|| best))
    }

    /// Splits a node, or takes over a path that makes that unnecessary.
    fn expand(
        &mut self,
        team: &Team<'_>,
        tools: &mut Tools,
        settings: &Settings,
        id: u32,
        stop: &mut dyn FnMut() -> bool,
    ) -> Result<(), Stopped> {
        loop {
            let mut best: Option<(Rc<Pair>, Clash, [f64; 2])> = None;
            if settings.weight > 1.0 {
                let pairs = self.nodes[id as usize].pairs.iter();
                let first = pairs.map(|pair| (pair, pair.clashes[0]));
                let first = first.min_by(|one, other| one.1.time().total_cmp(&other.1.time()));
                best = first.map(|(pair, clash)| (Rc::clone(pair), clash, [f64::INFINITY; 2]));
            }
            let weighed = if settings.weight > 1.0 {
                0
            } else {
                self.nodes[id as usize].pairs.len()
            };
            for at in 0..weighed {
                let pair = Rc::clone(&self.nodes[id as usize].pairs[at]);
                let (clash, rises) = self.split(team, tools, settings, id, &pair, stop)?;
                let worth = [rises[0].min(rises[1]), rises[0].max(rises[1])];
                if best.as_ref().is_none_or(|(.., known)| worth > *known) {
                    best = Some((pair, clash, worth));
                }
            }
            let (pair, clash, _) = best.unwrap_or_else(|| unreachable!("the node has a conflict"));
            let mut children = Vec::with_capacity(2);
            let split = clash.split(pair.agents, settings.branching);
            for constraint in self.disjoint(id, split, settings) {
                let child = self.child(team, tools, id, &pair, constraint, stop)?;
                children.extend(child);
            }
            let better = children.iter().position(|child| self.bypasses(id, child));
            let Some(better) = better.filter(|_| settings.bypass) else {
                for child in children {
                    self.add(child);
                }
                // Its children have what is left of them.
                let node = &mut self.nodes[id as usize];
                self.bytes -= node.bytes();
                node.pairs = Vec::new();
                self.bytes += node.bytes();
                return Ok(());
            };
            self.bypassed += 1;
            let child = children.swap_remove(better);
            self.bytes -= self.nodes[id as usize].bytes();
            for (agent, single) in child.changed {
                let local = self.local(agent);
                // What the constraint cost is no bound here, where it does not hold.
                let bound = self.loaded[local].as_ref().map_or(0.0, |now| now.bound);
                let mut single = (*single).clone();
                single.bound = bound;
                let single = Rc::new(single);
                self.place(team, local, Rc::clone(&single));
                let changed = &mut self.nodes[id as usize].changed;
                match changed.iter_mut().find(|(other, _)| *other == agent) {
                    Some((_, old)) => *old = single,
                    None => changed.push((agent, single)),
                }
            }
            let node = &mut self.nodes[id as usize];
            node.pairs = child.pairs;
            node.rank.conflicts = child.rank.conflicts;
            node.rank.cost = child.rank.cost;
            self.bytes += node.bytes();
            if node.rank.conflicts == 0 {
                self.queue.push(id, node.rank);
                return Ok(());
            }
        }
    }

    /// Two bans of a conflict so that no plan keeps both: of one agent that sets out in the time of its ban the other child
    /// says so.
    fn disjoint(&self, id: u32, split: [Constraint; 2], settings: &Settings) -> [Constraint; 2] {
        let [Constraint::Ban(one), Constraint::Ban(other)] = split else {
            return split;
        };
        if !settings.disjoint || settings.branching == Branching::Original {
            return split;
        }
        let landmarks = |agent: u32| {
            let all = self.constraints(id);
            let own = all.filter(|constraint| {
                matches!(constraint, Constraint::Pass([start, _]) if start.agent == agent)
            });
            own.count()
        };
        let both = [(one, other), (other, one)].map(|(positive, negative)| {
            let drives = matches!(positive.place, Place::Edge(_)) && positive.until.is_finite();
            let known = landmarks(positive.agent);
            (drives && known < MOST_LANDMARKS).then_some((known, positive, negative))
        });
        let best = both.into_iter().flatten().min_by_key(|(known, ..)| *known);
        best.map_or(split, |(_, positive, negative)| {
            [
                Constraint::Ban(positive),
                Constraint::Pass([positive, negative]),
            ]
        })
    }

    /// True if the paths of a child can replace those of its parent: one path, no dearer, and with fewer conflicts.
    fn bypasses(&self, id: u32, child: &Node) -> bool {
        let rank = self.nodes[id as usize].rank;
        let fits = |(agent, path): &(u32, Rc<Single>)| {
            let now = self.loaded[self.local(*agent)].as_ref();
            now.is_some_and(|now| path.cost <= now.bound * self.weight * (1.0 + 1e-9))
        };
        child.rank.conflicts < rank.conflicts
            && child.changed.len() == 1
            && child.changed.iter().all(fits)
    }

    /// The child of the loaded node that one more constraint makes; none if nothing keeps it.
    fn child(
        &self,
        team: &Team<'_>,
        tools: &mut Tools,
        id: u32,
        pair: &Pair,
        constraint: Constraint,
        stop: &mut dyn FnMut() -> bool,
    ) -> Result<Option<Node>, Stopped> {
        let node = &self.nodes[id as usize];
        let affected: Vec<u32> = if let Constraint::ArriveBefore { agent, time } = constraint {
            let goal = team.tasks[agent as usize].1;
            let others = self.members.iter().copied().filter(|other| *other != agent);
            let is_near = |other: &u32| {
                pair.agents.contains(other)
                    || team.comes_near(&self.tracks[self.local(*other)], goal, time)
            };
            others.filter(is_near).collect()
        } else {
            vec![constraint.agent()]
        };
        let (mut rank, mut changed) = (node.rank, Vec::with_capacity(affected.len()));
        let mut bound = rank.bound;
        for agent in &affected {
            let Some(path) = self.plan(team, tools, *agent, id, Some(&constraint), stop)? else {
                return Ok(None);
            };
            if let Some(old) = &self.loaded[self.local(*agent)] {
                rank.cost += path.cost - old.cost;
                bound += path.bound - old.bound;
            }
            changed.push((*agent, Rc::new(path)));
        }
        let tracks: Vec<Track> = changed
            .iter()
            .map(|(_, path)| {
                let mut track = Track::default();
                track.fill(team.closeness.roadmap(), path);
                track
            })
            .collect();
        let track_of = |agent: u32| match affected.iter().position(|other| *other == agent) {
            Some(at) => &tracks[at],
            None => &self.tracks[self.local(agent)],
        };
        let kept = node
            .pairs
            .iter()
            .filter(|pair| !pair.agents.iter().any(|agent| affected.contains(agent)));
        let mut pairs: Vec<Rc<Pair>> = kept.cloned().collect();
        for agent in &affected {
            for other in &self.members {
                if other == agent || other < agent && affected.contains(other) {
                    continue;
                }
                let agents = [*agent.min(other), *agent.max(other)];
                pairs.extend(self::pair(team, agents, agents.map(track_of)));
            }
        }
        rank.conflicts = pairs.len() as u32;
        rank.bound = rank
            .bound
            .max(self.sum_of_bounds() + (bound - node.rank.bound));
        Ok(Some(Node {
            parent: id,
            constraint: Some(constraint),
            changed,
            pairs,
            rank,
            is_weighed: false,
        }))
    }

    fn sum_of_bounds(&self) -> f64 {
        self.loaded.iter().flatten().map(|path| path.bound).sum()
    }

    /// The earliest path of an agent in a node with one constraint more.
    fn plan(
        &self,
        team: &Team<'_>,
        tools: &mut Tools,
        agent: u32,
        id: u32,
        more: Option<&Constraint>,
        stop: &mut dyn FnMut() -> bool,
    ) -> Result<Option<Single>, Stopped> {
        tools.bans.clear();
        for constraint in self.constraints(id).chain(more.copied()) {
            tools.bans.add(team, agent, &constraint);
        }
        let (start, goal) = team.tasks[agent as usize];
        let query = Query {
            start,
            goal,
            times: &team.times[agent as usize],
        };
        let roadmap = team.closeness.roadmap();
        let earliest = tools.low.find(roadmap, &tools.bans, &query, stop)?;
        let Some(earliest) = earliest else {
            return Ok(None);
        };
        if self.weight <= 1.0 {
            return Ok(Some(earliest));
        }
        let others = (0..).zip(&self.tracks);
        let own = self.local(agent);
        let others = others
            .filter(|(other, _)| *other != own)
            .map(|(_, track)| track);
        tools.focal.traffic.fill(others);
        let most = (earliest.cost * self.weight).min(tools.bans.most.next_down());
        let found = tools.focal.find(team, &tools.bans, &query, most, stop)?;
        Ok(Some(match found {
            Some(mut path) => {
                path.bound = earliest.cost;
                path
            }
            None => earliest,
        }))
    }

    /// The constraints of a node.
    fn constraints(&self, id: u32) -> impl Iterator<Item = Constraint> + '_ {
        let mut at = id;
        let above = std::iter::from_fn(move || {
            let node = self.nodes.get(at as usize)?;
            at = node.parent;
            Some(node.constraint)
        });
        self.base.iter().copied().chain(above.flatten())
    }

    /// Adds a node to the tree and opens it.
    fn add(&mut self, node: Node) {
        self.bytes += node.bytes();
        self.queue.push(self.nodes.len() as u32, node.rank);
        self.nodes.push(node);
        self.generated += 1;
    }

    /// Makes a path the one that is loaded.
    fn place(&mut self, team: &Team<'_>, local: usize, path: Rc<Single>) {
        self.tracks[local].fill(team.closeness.roadmap(), &path);
        self.loaded[local] = Some(path);
    }

    /// Loads the paths of a node.
    fn load(&mut self, team: &Team<'_>, id: u32) {
        let mut wanted: Vec<Option<Rc<Single>>> = vec![None; self.members.len()];
        let (mut at, mut missing) = (id, wanted.len());
        while at != ROOT && missing > 0 {
            let node = &self.nodes[at as usize];
            for (agent, path) in &node.changed {
                let slot = &mut wanted[self.local(*agent)];
                if slot.is_none() {
                    *slot = Some(Rc::clone(path));
                    missing -= 1;
                }
            }
            at = node.parent;
        }
        for (local, path) in wanted.into_iter().enumerate() {
            let Some(path) = path else { continue };
            let same = self.loaded[local]
                .as_ref()
                .is_some_and(|now| Rc::ptr_eq(now, &path));
            if !same {
                self.place(team, local, path);
            }
        }
    }
}

/// The conflicts of two agents, if they have any.
fn pair(team: &Team<'_>, agents: [u32; 2], tracks: [&Track; 2]) -> Option<Rc<Pair>> {
    let clashes = weighed(team, tracks, team.branching);
    (!clashes.is_empty()).then(|| {
        Rc::new(Pair {
            agents,
            clashes,
            split: OnceCell::new(),
            weight: Cell::new(None),
        })
    })
}
