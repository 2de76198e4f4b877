//! Conflict-based search over motion primitives (db-CBS: Moldagalieva, Ortiz-Haro, Toussaint, Hönig, "db-CBS: Discontinuity-bounded
//! conflict-based search for multi-robot kinodynamic motion planning", ICRA 2024).
//!
//! Every robot goes a way of [`Pathfinder`]; where two touch first, one of both has to keep clear of the other. In the paper it keeps
//! clear of the other's state at one time; that rules out little, and the search goes on a hair's breadth beside. Here it keeps clear of
//! the other's motion for some time before and after, which doubles with each constraint of the same two robots. A robot that rests at
//! its goal is kept clear of for ever. A window forbids more than has to be, so that no claim of the least cost is made.
//!
//! The node that is expanded is the one with the fewest pairs that touch among those whose cost is at most `w` times the least one, and
//! a way that touches others costs a little more (as in db-ECBS, Moldagalieva et al., T-RO 2025; there with a bound). At last
//! robots are planned anew, each among the ways of all others, as long as one of them gets shorter.

use std::rc::Rc;

use fleetyard_abi::leftovers::Leftover;

use super::astar::{Avoid, Limits, Outcome, Pathfinder, Way};
use crate::course::Course;
use crate::plugin::Team;
use crate::robot::State;
use crate::scene::clash;

/// Choices of the search.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Effort {
    /// The factor of the least cost within which a node may be expanded.
    pub w: f64,
    /// Seconds before and after a contact in which one robot keeps clear of the other.
    pub window_s: f64,
    /// Seconds that a motion which touches another robot costs more.
    pub penalty_s: f64,
    /// Most nodes of one search for a robot.
    pub nodes: u64,
}

/// Two robots touch.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Contact {
    pair: [usize; 2],
    time: f64,
}

/// A constraint, and those before it.
#[derive(Debug)]
struct Link {
    robot: usize,
    other: usize,
    avoid: Avoid,
    before: Option<Rc<Link>>,
}

#[derive(Debug, Clone)]
struct Node {
    ways: Vec<Rc<Way>>,
    constraints: Option<Rc<Link>>,
    contacts: Vec<Contact>,
    cost: f64,
}

/// Result of a search of teams.
#[derive(Debug)]
pub enum Ended {
    /// Ways that touch nobody.
    Found(Vec<Rc<Way>>),
    /// There are none with these primitives and windows.
    Exhausted,
    /// This robot has no way with these primitives, not even alone.
    NoWay(usize),
    /// A limit was met.
    Stopped,
}

/// Conflict-based search of a team.
pub struct Search<'s, 'a> {
    team: &'a Team<'a>,
    pathfinders: &'s mut [Pathfinder<'a>],
    effort: Effort,
    /// Nodes that were expanded.
    pub expanded: u64,
}

fn constraints(mut link: Option<&Rc<Link>>) -> impl Iterator<Item = &Link> {
    std::iter::from_fn(move || {
        let own = link?;
        link = own.before.as_ref();
        Some(&**own)
    })
}

impl<'s, 'a> Search<'s, 'a> {
    /// With a pathfinder for every robot.
    pub fn new(team: &'a Team<'a>, pathfinders: &'s mut [Pathfinder<'a>], effort: Effort) -> Self {
        Self {
            team,
            pathfinders,
            effort,
            expanded: 0,
        }
    }

    /// Searches ways that touch nobody.
    pub fn run(&mut self, limits: &mut Limits<'_>) -> Ended {
        let mut ways: Vec<Rc<Way>> = Vec::with_capacity(self.team.len());
        for robot in 0..self.team.len() {
            match self.way(robot, None, &ways, limits) {
                Outcome::Found(way) => ways.push(Rc::new(way)),
                Outcome::Exhausted => return Ended::NoWay(robot),
                Outcome::Stopped => return Ended::Stopped,
            }
        }
        let mut root = Node {
            cost: cost(&ways),
            ways,
            constraints: None,
            contacts: Vec::new(),
        };
        for robot in 1..self.team.len() {
            self.meet(&mut root, robot, robot);
        }
        let mut open = Leftover::new(vec![root]);
        let mut is_whole = true;
        while let Some(number) = self.choose(&open) {
            let node = open.swap_remove(number);
            let first = node
                .contacts
                .iter()
                .min_by(|one, other| one.time.total_cmp(&other.time));
            let Some(contact) = first.copied() else {
                return Ended::Found(node.ways);
            };
            self.expanded += 1;
            for turn in [0, 1] {
                if limits.nodes == 0 || (limits.stop)() {
                    return Ended::Stopped;
                }
                let (robot, other) = (contact.pair[turn], contact.pair[1 - turn]);
                let others: Vec<Rc<Way>> = others(&node.ways, robot);
                let mut child = node.clone();
                let mut links = vec![self.constraint(&node, robot, other, contact.time)];
                links.extend(self.at_the_start(&node, robot, other, contact.time));
                let mut found = None;
                for link in links {
                    let link = Some(Rc::new(link));
                    match self.way(robot, link.as_ref(), &others, limits) {
                        Outcome::Found(way) => {
                            found = Some(way);
                            child.constraints = link;
                            break;
                        }
                        Outcome::Exhausted => {}
                        Outcome::Stopped => is_whole = false,
                    }
                }
                let Some(way) = found else { continue };
                child.ways[robot] = Rc::new(way);
                child.cost = cost(&child.ways);
                child
                    .contacts
                    .retain(|contact| !contact.pair.contains(&robot));
                self.meet(&mut child, robot, self.team.len());
                open.push(child);
            }
        }
        if is_whole {
            Ended::Exhausted
        } else {
            Ended::Stopped
        }
    }

    /// The node that is expanded next.
    fn choose(&self, open: &[Node]) -> Option<usize> {
        let least = open.iter().map(|node| node.cost).reduce(f64::min)?;
        let near = |node: &Node| node.cost <= least * self.effort.w + 1e-9;
        let focal = open.iter().enumerate().filter(|(_, node)| near(node));
        let by_contacts = |(_, one): &(usize, &Node), (_, other): &(usize, &Node)| {
            let count = one.contacts.len().cmp(&other.contacts.len());
            count.then(one.cost.total_cmp(&other.cost))
        };
        focal.min_by(by_contacts).map(|(number, _)| number)
    }

    /// A way for one robot.
    fn way(
        &mut self,
        robot: usize,
        link: Option<&Rc<Link>>,
        others: &[Rc<Way>],
        limits: &mut Limits<'_>,
    ) -> Outcome {
        let own = constraints(link).filter(|link| link.robot == robot);
        let avoid: Vec<Avoid> = own.map(|link| link.avoid.clone()).collect();
        let dodge: Vec<Avoid> = others.iter().map(|way| way.avoid.clone()).collect();
        let mut part = Limits {
            nodes: self.effort.nodes.min(limits.nodes),
            memory: limits.memory,
            stop: &mut *limits.stop,
        };
        let given = part.nodes;
        let outcome = self.pathfinders[robot].find(
            &avoid,
            (&dodge, self.effort.penalty_s),
            f64::INFINITY,
            &mut part,
        );
        limits.nodes -= given - part.nodes;
        outcome
    }

    /// Contacts of a robot with those before `until`.
    fn meet(&self, node: &mut Node, robot: usize, until: usize) {
        for other in (0..until).filter(|other| *other != robot) {
            let body = |robot: usize| &self.team.members[robot].body;
            let moving = |robot: usize| (body(robot), &*node.ways[robot].track);
            let pair = [robot.min(other), robot.max(other)];
            if let Some(time) = clash(moving(pair[0]), moving(pair[1]), 0.0, f64::INFINITY) {
                node.contacts.push(Contact { pair, time });
            }
        }
    }

    /// A robot keeps clear of another one round a contact.
    fn constraint(&self, node: &Node, robot: usize, other: usize, time: f64) -> Link {
        let same = |link: &&Link| {
            [link.robot, link.other] == [robot, other] || [link.other, link.robot] == [robot, other]
        };
        let before = constraints(node.constraints.as_ref()).filter(same).count();
        let window = self.effort.window_s * f64::from(1_u32 << before.min(16));
        let way = &node.ways[other];
        let rests = |robot: usize| time >= node.ways[robot].track.seconds() - 1e-9;
        let until = if rests(robot) || rests(other) {
            f64::INFINITY
        } else {
            time + window
        };
        Link {
            robot,
            other,
            avoid: way.avoid.during(time - window, until),
            before: node.constraints.clone(),
        }
    }

    /// In place of a constraint that leaves no way: where the other robot drives into the start of this one nothing helps but that
    /// the other one drives elsewhere. Until then this one keeps clear of where the other one stands.
    fn at_the_start(&self, node: &Node, robot: usize, other: usize, time: f64) -> Option<Link> {
        let window = self.effort.window_s;
        let rest = Course::stay(State {
            rates: [0.0; 3],
            ..self.team.members[other].start
        });
        let stays = Way::new(&self.team.members[other], rest);
        (time < window).then(|| Link {
            robot,
            other,
            avoid: stays.avoid.during(0.0, time + window),
            before: node.constraints.clone(),
        })
    }

    /// Plans robots anew, each among all others, as long as that makes one of them sooner; `better` hears of each that does.
    pub fn improve(
        &mut self,
        ways: &mut [Rc<Way>],
        limits: &mut Limits<'_>,
        mut better: impl FnMut(&[Rc<Way>]),
    ) {
        // Those that lose most go first.
        let mut order: Vec<usize> = (0..ways.len()).collect();
        let (mut unchanged, mut turn) = (0, 0);
        while unchanged < ways.len() && limits.nodes > 0 && !(limits.stop)() {
            if turn % ways.len() == 0 {
                let loss = |robot: usize| {
                    ways[robot].course.seconds() - self.pathfinders[robot].least_seconds()
                };
                order.sort_by(|one, other| loss(*other).total_cmp(&loss(*one)));
            }
            let robot = order[turn % ways.len()];
            let others: Vec<Avoid> = others(ways, robot)
                .iter()
                .map(|way| way.avoid.clone())
                .collect();
            let mut part = Limits {
                nodes: self.effort.nodes.min(limits.nodes),
                memory: limits.memory,
                stop: &mut *limits.stop,
            };
            let given = part.nodes;
            let bound = ways[robot].course.seconds();
            let outcome = self.pathfinders[robot].find(&others, (&[], 0.0), bound, &mut part);
            limits.nodes -= given - part.nodes;
            unchanged += 1;
            if let Outcome::Found(way) = outcome {
                ways[robot] = Rc::new(way);
                better(ways);
                unchanged = 1;
            }
            turn += 1;
        }
    }
}

fn others(ways: &[Rc<Way>], robot: usize) -> Vec<Rc<Way>> {
    let others = ways.iter().enumerate().filter(|(other, _)| *other != robot);
    others.map(|(_, way)| Rc::clone(way)).collect()
}

fn cost(ways: &[Rc<Way>]) -> f64 {
    ways.iter().map(|way| way.course.seconds()).sum()
}
