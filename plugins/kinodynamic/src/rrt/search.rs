//! Greedy conflict-based search (M. Barer, G. Sharon, R. Stern, A. Felner, "Suboptimal variants of the conflict-based search
//! algorithm for the multi-agent pathfinding problem", SoCS 2014): of all nodes that with the fewest conflicts comes first, then
//! that with the least sum of times, then the oldest.
//!
//! Three things may be different from the paper of quadrupeds, each by an option. A robot that is planned anew first tries to keep
//! clear of all others: the low level of Barer et al. counts conflicts, too. Constraints of two robots that meet again and again
//! last longer. And a search that is stuck begins anew with a root at which robots are planned one after the other, each clear of
//! those before it if that is found, and first those that were in conflict most.

use std::cmp::{Ordering, Reverse};
use std::collections::BinaryHeap;
use std::rc::Rc;

use fleetyard_plugin_plane::sssp::bodies::Pose;
use fleetyard_plugin_spacetime::random::Random;

use fleetyard_plugin_plane::sssp::roadmap::Sampler;

use super::Options;
use super::barred::{Barred, Constraint, Moving};
use super::edge::Walker;
use super::overlap::{common_area, common_point};
use super::tree::Tree;
use super::way::{Way, blend, shorten};
use crate::course::{Course, Track};
use crate::plugin::Team;
use crate::scene::clash;

/// Steps in which an overlap is followed to the place where it is largest, in seconds.
const LOOK: f64 = 0.05;

/// The time of a constraint is doubled so often at most.
const MOST_DOUBLINGS: u32 = 5;

/// The way of one robot.
#[derive(Debug)]
pub struct Plan {
    /// Its motions.
    pub way: Way,
    /// Its controls.
    pub course: Course,
    /// Edges of the tree that it was found by.
    pub lines: Vec<[[f64; 2]; 2]>,
    /// As the judge sees it.
    track: Track,
    /// As other robots keep clear of it.
    moving: Rc<Moving>,
}

/// Two robots that touch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Conflict {
    /// The robots, by ascending number.
    pub pair: [usize; 2],
    /// When they touch first, in seconds.
    pub time: f64,
}

/// A constraint of one robot, and those further up in the tree.
#[derive(Debug)]
struct Barrier {
    agent: usize,
    other: usize,
    constraint: Constraint,
    before: Option<Rc<Self>>,
}

struct Node {
    plans: Vec<Rc<Plan>>,
    conflicts: Vec<Conflict>,
    barriers: Option<Rc<Barrier>>,
}

/// Key of a node in the queue: conflicts, sum of times, number.
#[derive(PartialEq)]
struct Key(usize, f64, usize);

impl Eq for Key {}

impl PartialOrd for Key {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Key {
    fn cmp(&self, other: &Self) -> Ordering {
        let own = (self.0, self.2);
        own.0
            .cmp(&other.0)
            .then(self.1.total_cmp(&other.1))
            .then(own.1.cmp(&other.2))
    }
}

/// The end of a search.
#[derive(Debug)]
pub enum Outcome {
    /// With a way for every robot, and the constraints that it keeps, each with its robot.
    Solved(Vec<Rc<Plan>>, Vec<(usize, Constraint)>),
    /// Without: no tree of this robot reached its goal, not even with nobody in the way.
    NoWay(usize),
    /// It tried all that it may.
    GaveUp,
    /// It was told to stop, or spent all samples.
    Stopped,
}

/// Figures of a search.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Effort {
    /// Samples of all trees, and their roots.
    pub samples: u64,
    /// Trees.
    pub trees: u64,
    /// Nodes of conflict trees that were taken up.
    pub nodes: u64,
    /// Times that the search began anew.
    pub restarts: u64,
}

/// A search for the plan of a team.
pub struct Search<'a> {
    team: &'a Team<'a>,
    walkers: &'a [Walker],
    options: &'a Options,
    seed: u64,
    limit: u64,
    memory: u64,
    stop: &'a dyn Fn() -> bool,
    movers: Vec<Rc<Moving>>,
    /// Ways of robots that are alone.
    guides: Vec<Vec<Pose>>,
    /// Figures so far.
    pub effort: Effort,
}

impl<'a> Search<'a> {
    /// Of a team, within so many samples and bytes.
    pub fn new(
        team: &'a Team<'a>,
        walkers: &'a [Walker],
        options: &'a Options,
        (seed, limit, memory): (u64, u64, u64),
        stop: &'a dyn Fn() -> bool,
    ) -> Self {
        let movers = team.scene.movers.iter().map(|mover| {
            Rc::new(Moving {
                body: mover.body.clone(),
                track: mover.track.clone(),
            })
        });
        Self {
            movers: movers.collect(),
            guides: vec![Vec::new(); walkers.len()],
            team,
            walkers,
            options,
            seed,
            limit,
            memory,
            stop,
            effort: Effort::default(),
        }
    }

    /// A plan of the team.
    pub fn solve(&mut self) -> Outcome {
        let agents = self.walkers.len();
        let mut sampler = Sampler::new(self.team.scene.world.bounds, self.seed);
        for agent in 0..agents {
            let mut found = self.low_level(agent, &[], &[], &[], self.few());
            if found.is_none() && !self.is_over() {
                let guide = self.guide(agent, &mut sampler);
                found = self.low_level(agent, &[], &[], &guide, self.options.samples);
            }
            match found {
                Some(plan) => self.guides[agent] = plan.way.poses(&self.walkers[agent]),
                None if self.is_over() => return Outcome::Stopped,
                None => return Outcome::NoWay(agent),
            }
        }
        let mut random = Random::new(self.seed, u64::MAX);
        // Who was in conflict most is planned first.
        let mut trouble = vec![0_u64; agents];
        for beginning in 0..self.options.restarts {
            let mut order: Vec<usize> = (0..agents).collect();
            random.shuffle(&mut order);
            order.sort_by_key(|agent| Reverse(trouble[*agent]));
            let apart = self.options.avoid && beginning > 0;
            if let Some(root) = self.root(&order, apart)
                && let Some(node) = self.high_level(root, &mut trouble)
            {
                let barriers = node.barriers.iter().flat_map(|last| last.all());
                let constraints = barriers.map(|barrier| (barrier.agent, barrier.constraint));
                return Outcome::Solved(node.plans, constraints.collect());
            }
            if self.is_over() {
                return Outcome::Stopped;
            }
            self.effort.restarts += 1;
        }
        Outcome::GaveUp
    }

    /// Poses that lead an agent to its goal, if there is one to go to.
    fn guide(&mut self, agent: usize, sampler: &mut Sampler) -> Vec<Pose> {
        let walker = &self.walkers[agent];
        if walker.member.goal.place_m.is_infinite() {
            return Vec::new();
        }
        let most = self.left().min(self.options.samples);
        let mut drawn = 0;
        let guide = walker.guide(sampler, &mut || {
            drawn += 1;
            drawn <= most && !(self.stop)()
        });
        self.effort.samples += drawn.min(most);
        guide
    }

    /// Samples of a tree that may fail.
    fn few(&self) -> u64 {
        (self.options.samples / 10).max(1)
    }

    /// Samples that are left.
    fn left(&self) -> u64 {
        self.limit.saturating_sub(self.effort.samples)
    }

    fn is_over(&self) -> bool {
        self.left() == 0 || (self.stop)()
    }

    /// Ways of all robots: each alone, or each clear of those before it if it finds such a way.
    fn root(&mut self, order: &[usize], apart: bool) -> Option<Node> {
        let mut plans: Vec<Option<Rc<Plan>>> = vec![None; order.len()];
        for (number, agent) in order.iter().enumerate() {
            let guide = self.guides[*agent].clone();
            let mut found = None;
            if apart {
                let planned = plans.iter().flatten().map(|plan| plan.moving.clone());
                let planned: Vec<Rc<Moving>> = planned.collect();
                let waiting = order[number + 1..].iter().map(|other| {
                    Rc::new(Moving {
                        body: self.walkers[*other].body.clone(),
                        track: Track::rest(self.walkers[*other].root.pose()),
                    })
                });
                let all: Vec<Rc<Moving>> = planned.iter().cloned().chain(waiting).collect();
                found = self.low_level(*agent, &[], &all, &guide, self.few());
                if found.is_none() && !planned.is_empty() && !self.is_over() {
                    found = self.low_level(*agent, &[], &planned, &guide, self.few());
                }
            }
            if found.is_none() && !self.is_over() {
                found = self.low_level(*agent, &[], &[], &guide, self.options.samples);
            }
            plans[*agent] = Some(found?);
        }
        let plans: Vec<Rc<Plan>> = plans.into_iter().flatten().collect();
        let pairs =
            (0..plans.len()).flat_map(|one| (one + 1..plans.len()).map(move |other| [one, other]));
        let conflicts = pairs.filter_map(|pair| self.conflict(&plans, pair));
        Some(Node {
            conflicts: conflicts.collect(),
            plans,
            barriers: None,
        })
    }

    /// A node without conflicts.
    fn high_level(&mut self, root: Node, trouble: &mut [u64]) -> Option<Node> {
        let mut nodes: Vec<Option<Node>> = Vec::new();
        let mut queue: BinaryHeap<Reverse<Key>> = BinaryHeap::new();
        let mut bytes = 0;
        let push =
            |nodes: &mut Vec<Option<Node>>, queue: &mut BinaryHeap<Reverse<Key>>, node: Node| {
                let sum = node.plans.iter().map(|plan| plan.way.arrival()).sum();
                queue.push(Reverse(Key(node.conflicts.len(), sum, nodes.len())));
                nodes.push(Some(node));
            };
        push(&mut nodes, &mut queue, root);
        let mut taken = 0;
        while let Some(Reverse(Key(_, _, number))) = queue.pop() {
            let node = nodes[number].take()?;
            if node.conflicts.is_empty() {
                return Some(node);
            }
            if taken >= self.options.restart_nodes || bytes > self.memory || self.is_over() {
                return None;
            }
            taken += 1;
            self.effort.nodes += 1;
            let first = node.conflicts.iter().min_by(|one, other| {
                one.time
                    .total_cmp(&other.time)
                    .then(one.pair.cmp(&other.pair))
            })?;
            for agent in first.pair {
                trouble[agent] += 1;
                if let Some(child) = self.child(&node, first, agent) {
                    bytes += child.plans[agent].bytes();
                    push(&mut nodes, &mut queue, child);
                }
            }
        }
        None
    }

    /// The node in which one of two robots that touch gives way.
    fn child(&mut self, node: &Node, conflict: &Conflict, agent: usize) -> Option<Node> {
        let [one, other] = conflict.pair;
        let other = if agent == one { other } else { one };
        let barriers = || node.barriers.iter().flat_map(|last| last.all());
        let met = barriers().filter(|known| {
            [known.agent, known.other] == [agent, other]
                || [known.agent, known.other] == [other, agent]
        });
        let doublings = (met.count() as u32).min(if self.options.widen {
            MOST_DOUBLINGS
        } else {
            0
        });
        let delta = self.options.delta_s * f64::from(1_u32 << doublings);
        let (point, time) = self.deepest(&node.plans, conflict);
        let barrier = Rc::new(Barrier {
            agent,
            other,
            constraint: Constraint {
                point,
                from: time - delta,
                to: time + delta,
            },
            before: node.barriers.clone(),
        });
        let constraints: Vec<Constraint> = barrier
            .all()
            .filter(|known| known.agent == agent)
            .map(|known| known.constraint)
            .collect();
        let guide = node.plans[agent].way.poses(&self.walkers[agent]);
        let mut found = None;
        if self.options.avoid {
            let others = node
                .plans
                .iter()
                .enumerate()
                .filter(|(number, _)| *number != agent);
            let others: Vec<Rc<Moving>> = others.map(|(_, plan)| plan.moving.clone()).collect();
            found = self.low_level(agent, &constraints, &others, &guide, self.few());
        }
        if found.is_none() && !self.is_over() {
            found = self.low_level(agent, &constraints, &[], &guide, self.options.samples);
        }
        let mut plans = node.plans.clone();
        plans[agent] = found?;
        let kept = node
            .conflicts
            .iter()
            .filter(|known| !known.pair.contains(&agent))
            .copied();
        let others = (0..plans.len()).filter(|other| *other != agent);
        let new =
            others.filter_map(|other| self.conflict(&plans, [agent.min(other), agent.max(other)]));
        Some(Node {
            conflicts: kept.chain(new).collect(),
            plans,
            barriers: Some(barrier),
        })
    }

    fn barred(
        &self,
        agent: usize,
        constraints: &[Constraint],
        others: &[Rc<Moving>],
    ) -> Barred<'a> {
        let walkers: &'a [Walker] = self.walkers;
        Barred {
            body: &walkers[agent].body,
            constraints: constraints.to_vec(),
            moving: self.movers.iter().chain(others).cloned().collect(),
        }
    }

    fn shorten(
        &self,
        agent: usize,
        barred: &Barred<'_>,
        way: &mut Way,
        free: f64,
        random: &mut Random,
    ) {
        let walker = &self.walkers[agent];
        shorten(walker, barred, way, free, self.options.shortcuts, random);
        if self.options.blend {
            blend(walker, barred, way, free);
        }
    }

    /// The same way made shorter among bodies.
    fn shortened(&self, agent: usize, plan: &Plan, others: &[Rc<Moving>]) -> Option<Rc<Plan>> {
        let walker = &self.walkers[agent];
        let barred = self.barred(agent, &[], others);
        let goal = &walker.member.goal;
        let free = if goal.place_m.is_infinite() {
            0.0
        } else {
            barred.free_from(&goal.state.pose())?
        };
        let mut way = plan.way.again(walker, &barred, free)?;
        let mut random = Random::new(self.seed, self.effort.trees);
        self.shorten(agent, &barred, &mut way, free, &mut random);
        Some(Rc::new(self.plan(agent, way, plan.lines.clone())))
    }

    /// A way of one robot that keeps its constraints and clear of bodies.
    fn low_level(
        &mut self,
        agent: usize,
        constraints: &[Constraint],
        others: &[Rc<Moving>],
        guide: &[Pose],
        samples: u64,
    ) -> Option<Rc<Plan>> {
        let walker = &self.walkers[agent];
        let barred = self.barred(agent, constraints, others);
        let mut random = Random::new(self.seed, self.effort.trees);
        self.effort.trees += 1;
        if self.left() == 0 {
            return None;
        }
        // The root is a vertex, too.
        self.effort.samples += 1;
        let left = self.left().min(samples);
        let bounds = self.team.scene.world.bounds;
        let tree = Tree::new(walker, &barred, self.options, bounds, guide);
        let grown = tree.grow(left, &mut random, &mut || !(self.stop)());
        self.effort.samples += grown.samples;
        let mut way = grown.way?;
        self.shorten(agent, &barred, &mut way, grown.free, &mut random);
        Some(Rc::new(self.plan(agent, way, grown.lines)))
    }

    fn plan(&self, agent: usize, way: Way, lines: Vec<[[f64; 2]; 2]>) -> Plan {
        let walker = &self.walkers[agent];
        let course = way.course(walker);
        Plan {
            track: course.track(&walker.member.robot),
            moving: Rc::new(Moving {
                body: walker.body.clone(),
                track: walker.track(&course),
            }),
            lines,
            course,
            way,
        }
    }

    fn conflict(&self, plans: &[Rc<Plan>], pair: [usize; 2]) -> Option<Conflict> {
        let [one, other] = pair.map(|agent| (&self.team.members[agent].body, &plans[agent].track));
        let time = clash(one, other, 0.0, f64::INFINITY)?;
        Some(Conflict { pair, time })
    }

    /// A point that two robots have in common, and when: where their overlap grows no more.
    fn deepest(
        &self,
        plans: &[Rc<Plan>],
        conflict: &Conflict,
    ) -> (fleetyard_plugin_plane::Vector, f64) {
        let [one, other] = conflict.pair;
        let bodies = [one, other].map(|agent| &self.team.members[agent].body);
        let poses = |time: f64| [one, other].map(|agent| plans[agent].track.at(time));
        let area = |time: f64| {
            let [a, b] = poses(time);
            common_area((bodies[0], &a), (bodies[1], &b))
        };
        let (mut time, mut largest) = (conflict.time, area(conflict.time));
        loop {
            let next = area(time + LOOK);
            if next <= largest {
                break;
            }
            (time, largest) = (time + LOOK, next);
        }
        let [a, b] = poses(time);
        (common_point((bodies[0], &a), (bodies[1], &b)), time)
    }

    /// Plans robots anew, one after the other, each clear of all others; keeps what is shorter. True if something is.
    pub fn improve(&mut self, plans: &mut [Rc<Plan>]) -> bool {
        let mut order: Vec<usize> = (0..plans.len()).collect();
        order.sort_by(|one, other| {
            plans[*other]
                .way
                .arrival()
                .total_cmp(&plans[*one].way.arrival())
        });
        let mut improved = false;
        for agent in order {
            if self.is_over() {
                break;
            }
            let others = plans
                .iter()
                .enumerate()
                .filter(|(other, _)| *other != agent);
            let others: Vec<Rc<Moving>> = others.map(|(_, plan)| plan.moving.clone()).collect();
            let guide = self.guides[agent].clone();
            let again = self.shortened(agent, &plans[agent], &others);
            let fresh = self.low_level(agent, &[], &others, &guide, self.few());
            let found = again.into_iter().chain(fresh);
            let sooner = |one: &Rc<Plan>, other: &Rc<Plan>| {
                one.way.arrival().total_cmp(&other.way.arrival())
            };
            let Some(plan) = found.min_by(sooner) else {
                continue;
            };
            if plan.way.arrival() >= plans[agent].way.arrival() - 1e-6 {
                continue;
            }
            let before = std::mem::replace(&mut plans[agent], plan);
            let pairs = (0..plans.len()).filter(|other| *other != agent);
            let mut pairs = pairs.map(|other| [agent.min(other), agent.max(other)]);
            if pairs.any(|pair| self.conflict(plans, pair).is_some()) {
                plans[agent] = before;
            } else {
                improved = true;
            }
        }
        improved
    }
}

impl Barrier {
    /// This one and all before it.
    fn all(&self) -> impl Iterator<Item = &Self> {
        std::iter::successors(Some(self), |barrier| barrier.before.as_deref())
    }
}

impl Plan {
    /// About the memory that it takes.
    fn bytes(&self) -> u64 {
        let knots = self.track.knots.len() + self.moving.track.knots.len();
        let edges: usize = self
            .way
            .edges
            .iter()
            .map(|edge| edge.track.knots.len() + 8)
            .sum();
        ((knots + edges) * 64 + self.lines.len() * 32) as u64
    }
}
