//! The validator of plans on roadmaps.
//!
//! Feasibility is that of GRACE (section III-D): the centres of discs of radius r are 2r apart at
//! all times. That alone is the judge, decided by the exact checker of
//! [`fleetyard_world::exact`] for robots that go straight and at one speed along every edge. The
//! paper's four rules are names of what went wrong, for none of them is exact: a robot that
//! follows another one round a sharp corner keeps all of them, and comes nearer than 2r.
//!
//! A contact has the name of its deepest moment, the first among equal ones. A robot is then at a
//! vertex, where it rests, arrives or leaves, or on an edge:
//!
//! | one | other | name |
//! | --- | --- | --- |
//! | at a vertex | at the same one | [`RoadmapRule::VertexConflict`], rule (i) |
//! | on an edge | on the same one, the other way | [`RoadmapRule::HeadOn`], rule (ii) |
//! | on an edge | on the same one, the same way | [`RoadmapRule::Headway`], rule (iii) |
//! | at a vertex | on an edge from it or to it | [`RoadmapRule::Headway`] |
//! | on an edge | on one that leads on, entered less than 2r/ν after or before | [`RoadmapRule::Headway`] |
//! | on an edge | on one that crosses it | [`RoadmapRule::CrossingEdges`], rule (iv) |
//! | anything else | | [`RoadmapRule::Near`] |

use std::fmt;

use fleetyard_core::{Roadmap, RoadmapPlan, RoadmapPlanError, Visit, words};
use fleetyard_world::exact::{ContactInterval, ContactSearch, Obstacles, Touched, contacts};
use fleetyard_world::{Pose, Relative, Shape};
use serde::{Deserialize, Serialize};

use crate::verdict::{keep_first, other_counts};

/// Speeds that robots on a roadmap may have besides 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Pace {
    /// The common speed ν alone: an edge of length ℓ takes ℓ/ν (GRACE, section III-B).
    #[default]
    StopGo,
    /// Any up to ν, one for each edge.
    Slower,
}

words!(Pace {
    StopGo = "stop-go", "Every edge takes its length divided by the common speed";
    Slower = "slower", "Edges may take longer";
});

/// The data that a plan on a roadmap is judged by.
#[derive(Debug, Clone, Copy)]
pub struct RoadmapTask<'a> {
    /// Vertices and edges.
    pub roadmap: &'a Roadmap,
    /// The disc that every robot is; its effective radius is r.
    pub disc: &'a Shape,
    /// The common speed ν in m/s.
    pub speed_m_per_s: f64,
    /// Speeds that are allowed.
    pub pace: Pace,
    /// Vertex in which each agent begins, if given.
    pub starts: Option<&'a [u32]>,
    /// Vertex in which each agent comes to rest, if given.
    pub goals: Option<&'a [u32]>,
    /// Discs may overlap by this, in metres; touching is no contact.
    pub overlap_m: f64,
    /// The time that an edge takes may be missed by this, in seconds.
    pub time_s: f64,
}

impl<'a> RoadmapTask<'a> {
    /// Discs that move at one speed or rest; a micrometre and a microsecond are forgiven.
    pub fn new(roadmap: &'a Roadmap, disc: &'a Shape, speed_m_per_s: f64) -> Self {
        Self {
            roadmap,
            disc,
            speed_m_per_s,
            pace: Pace::StopGo,
            starts: None,
            goals: None,
            overlap_m: 1e-6,
            time_s: 1e-6,
        }
    }

    /// Least distance of two robots' centres, in metres.
    fn apart_m(&self) -> f64 {
        2.0 * self.disc.effective_radius_m()
    }
}

/// A rule that a plan on a roadmap can break.
///
/// The order is the order in which violations of equal time and agents are listed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum RoadmapRule {
    /// The plan has paths for more or fewer agents than there are starts or goals.
    AgentCount,
    /// A path does not begin at its agent's start.
    WrongStart,
    /// A path does not end at its agent's goal.
    WrongGoal,
    /// A vertex that the roadmap does not have.
    NoSuchVertex,
    /// A move along an edge that the roadmap does not have.
    NoSuchEdge,
    /// An edge takes less time than at the common speed.
    TooFast,
    /// An edge takes more time than at the common speed, where robots have no other.
    TooSlow,
    /// Two agents are at one vertex.
    VertexConflict,
    /// Two agents meet on an edge that they drive in opposite directions.
    HeadOn,
    /// Two agents follow each other nearer than two radii.
    Headway,
    /// Two agents meet where their edges cross.
    CrossingEdges,
    /// Two agents are nearer than two radii in another way.
    Near,
}

impl RoadmapRule {
    /// True for rules about two agents, which meet or come too near.
    pub fn is_contact(self) -> bool {
        matches!(
            self,
            Self::VertexConflict | Self::HeadOn | Self::Headway | Self::CrossingEdges | Self::Near
        )
    }
}

words!(RoadmapRule {
    AgentCount = "agent-count";
    WrongStart = "wrong-start";
    WrongGoal = "wrong-goal";
    NoSuchVertex = "no-such-vertex";
    NoSuchEdge = "no-such-edge";
    TooFast = "too-fast";
    TooSlow = "too-slow";
    VertexConflict = "vertex-conflict";
    HeadOn = "head-on";
    Headway = "headway";
    CrossingEdges = "crossing-edges";
    Near = "near";
});

/// One broken rule.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RoadmapViolation {
    /// The rule.
    pub rule: RoadmapRule,
    /// The agents at fault, counted from 0, in increasing order.
    pub agents: Vec<u32>,
    /// Time of its begin, in seconds.
    pub time_s: f64,
    /// Time of its end, for contacts that end.
    pub end_s: Option<f64>,
    /// Least distance of two agents' centres, in metres.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub least_m: Option<f64>,
    /// The vertices in question: where the agents are, or for moves of the first agent and then
    /// of the second, from and to.
    pub vertices: Vec<u32>,
    /// All of it as a sentence.
    pub sentence: String,
}

impl fmt::Display for RoadmapViolation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.sentence)
    }
}

/// The validator's verdict on a plan on a roadmap.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RoadmapVerdict {
    /// True if the plan breaks no rule.
    pub valid: bool,
    /// The first violations by time, then agents, at most as many as were asked for.
    pub violations: Vec<RoadmapViolation>,
    /// Up to when contacts were looked for, in seconds: the end of the plan, unless there were
    /// more than were asked for, or a vertex or an edge is not there.
    pub checked_until_s: f64,
}

/// Judges a plan; at most `limit` violations are described, and at least one if there is one.
///
/// Takes about the time of [`contacts`], which stops where the limit is reached. A plan with
/// agents, vertices or edges that are not there is not searched for contacts.
pub fn validate_roadmap(
    plan: &RoadmapPlan,
    task: &RoadmapTask<'_>,
    limit: usize,
) -> RoadmapVerdict {
    let limit = limit.max(1);
    let mut violations = Vec::new();
    check_counts(plan, task, &mut violations);
    if violations.is_empty() {
        check_places(plan, task, &mut violations);
        check_moves(plan, task, limit, &mut violations);
    }
    let mut checked_until_s = 0.0;
    let is_there = |violation: &RoadmapViolation| {
        !matches!(
            violation.rule,
            RoadmapRule::AgentCount | RoadmapRule::NoSuchVertex | RoadmapRule::NoSuchEdge
        )
    };
    if violations.iter().all(is_there)
        && let Ok(motions) = plan.to_trajectories(task.roadmap)
    {
        let shapes = vec![task.disc; plan.agents()];
        let search = ContactSearch {
            tolerance_m: task.overlap_m,
            limit,
            approach_range_m: None,
        };
        let found = contacts(&motions, &shapes, &Obstacles::none(), &search);
        let named = found.contacts.iter().filter_map(|found| {
            let Touched::Agent(other) = found.other else {
                return None;
            };
            Some(describe(plan, task, found, other))
        });
        violations.extend(named);
        checked_until_s = found.until_s;
    }
    keep_first(&mut violations, limit, |violation| {
        (violation.time_s, &violation.agents, violation.rule)
    });
    RoadmapVerdict {
        valid: violations.is_empty(),
        violations,
        checked_until_s,
    }
}

/// A violation of one agent, or of the whole plan, at a moment.
fn violation(
    rule: RoadmapRule,
    agent: Option<usize>,
    time_s: f64,
    vertices: Vec<u32>,
    sentence: String,
) -> RoadmapViolation {
    RoadmapViolation {
        rule,
        agents: agent.map(|agent| agent as u32).into_iter().collect(),
        time_s,
        end_s: None,
        least_m: None,
        vertices,
        sentence,
    }
}

fn check_counts(
    plan: &RoadmapPlan,
    task: &RoadmapTask<'_>,
    violations: &mut Vec<RoadmapViolation>,
) {
    let agents = plan.agents();
    let counts = [("starts", task.starts), ("goals", task.goals)];
    let counts = counts.map(|(what, given)| (what, given.map(<[_]>::len)));
    violations.extend(
        other_counts(agents, counts)
            .map(|sentence| violation(RoadmapRule::AgentCount, None, 0.0, Vec::new(), sentence)),
    );
}

fn check_places(
    plan: &RoadmapPlan,
    task: &RoadmapTask<'_>,
    violations: &mut Vec<RoadmapViolation>,
) {
    for (agent, path) in plan.paths().enumerate() {
        let last = path.len() - 1;
        let ends = [
            (task.starts, 0, RoadmapRule::WrongStart, "begins", "start"),
            (task.goals, last, RoadmapRule::WrongGoal, "ends", "goal"),
        ];
        for (given, visit, rule, does, what) in ends {
            let Some(wanted) = given.map(|all| all[agent]) else {
                continue;
            };
            let Visit {
                vertex, arrival_s, ..
            } = path[visit];
            if vertex != wanted {
                let sentence =
                    format!("agent {agent} {does} at vertex {vertex}, its {what} is {wanted}");
                let vertices = vec![vertex, wanted];
                violations.push(violation(rule, Some(agent), arrival_s, vertices, sentence));
            }
        }
    }
}

/// Vertices, edges and speeds; at most `limit` of what is not there is kept.
fn check_moves(
    plan: &RoadmapPlan,
    task: &RoadmapTask<'_>,
    limit: usize,
    violations: &mut Vec<RoadmapViolation>,
) {
    let roadmap = task.roadmap;
    for fault in plan.faults(roadmap).take(limit) {
        let (rule, vertices) = match fault {
            RoadmapPlanError::NoSuchEdge { from, to, .. } => {
                (RoadmapRule::NoSuchEdge, vec![from, to])
            }
            _ => (RoadmapRule::NoSuchVertex, Vec::new()),
        };
        let Some((agent, visit)) = fault.place() else {
            continue;
        };
        let time_s = plan.path(agent)[visit].arrival_s;
        let sentence = fault.to_string();
        violations.push(violation(rule, Some(agent), time_s, vertices, sentence));
    }
    let is_there = |vertex: u32| (vertex as usize) < roadmap.vertices();
    for (agent, path) in plan.paths().enumerate() {
        for leg in path.windows(2) {
            let (from, to) = (leg[0].vertex, leg[1].vertex);
            if !(is_there(from) && is_there(to)) {
                continue;
            }
            let [start, end] = [from, to].map(|vertex| place(roadmap, vertex).position());
            let length_m = (end - start).norm();
            let (begin_s, takes_s) = (leg[0].departure_s, leg[1].arrival_s - leg[0].departure_s);
            let needs_s = length_m / task.speed_m_per_s;
            let rule = if takes_s < needs_s - task.time_s {
                RoadmapRule::TooFast
            } else if task.pace == Pace::StopGo && takes_s > needs_s + task.time_s {
                RoadmapRule::TooSlow
            } else {
                continue;
            };
            let sentence = format!(
                "agent {agent} takes {takes_s} s from vertex {from} to {to} from {begin_s} s on, \
                 which at {} m/s takes {needs_s} s",
                task.speed_m_per_s
            );
            let vertices = vec![from, to];
            violations.push(violation(rule, Some(agent), begin_s, vertices, sentence));
        }
    }
}

fn place(roadmap: &Roadmap, vertex: u32) -> Pose {
    let (x, y) = roadmap.position_m(vertex);
    Pose::at(x, y)
}

/// A stay at a vertex, from and to which it goes then, or a drive along an edge.
#[derive(Debug, Clone, Copy)]
struct Leg {
    visit: usize,
    from: u32,
    to: u32,
    begin_s: f64,
    end_s: f64,
}

impl Leg {
    fn stay(path: &[Visit], visit: usize) -> Self {
        let Visit {
            vertex,
            arrival_s,
            departure_s,
        } = path[visit];
        let is_last = visit + 1 == path.len();
        Self {
            visit,
            from: vertex,
            to: vertex,
            begin_s: arrival_s,
            end_s: if is_last { f64::INFINITY } else { departure_s },
        }
    }

    fn drive(path: &[Visit], visit: usize) -> Self {
        Self {
            visit,
            from: path[visit].vertex,
            to: path[visit + 1].vertex,
            begin_s: path[visit].departure_s,
            end_s: path[visit + 1].arrival_s,
        }
    }

    /// The leg of an agent at a time; where two meet, the first.
    fn at(path: &[Visit], time_s: f64) -> Self {
        let arrived = path.partition_point(|visit| visit.arrival_s < time_s);
        let stay = Self::stay(path, arrived.saturating_sub(1));
        if time_s <= stay.end_s {
            stay
        } else {
            stay.next(path)
        }
    }

    /// The leg that comes after; the last one has no end.
    fn next(self, path: &[Visit]) -> Self {
        if self.from == self.to {
            Self::drive(path, self.visit)
        } else {
            Self::stay(path, self.visit + 1)
        }
    }

    fn pose(self, roadmap: &Roadmap, time_s: f64) -> Pose {
        let ends = [self.from, self.to].map(|vertex| place(roadmap, vertex));
        let share = (time_s - self.begin_s) / (self.end_s - self.begin_s);
        // A stay at the end takes for ever, one in passing no time.
        if self.from == self.to || !share.is_finite() {
            return ends[0];
        }
        ends[0].toward(ends[1], share.clamp(0.0, 1.0))
    }

    /// The position at a time of the leg. At the ends of a drive it is at a vertex.
    fn spot(self, time_s: f64) -> Spot {
        if time_s <= self.begin_s || self.from == self.to {
            Spot::At(self.from)
        } else if time_s >= self.end_s {
            Spot::At(self.to)
        } else {
            Spot::On(self)
        }
    }
}

/// A position of an agent in terms of the roadmap.
#[derive(Debug, Clone, Copy)]
enum Spot {
    At(u32),
    On(Leg),
}

/// The deepest moment of a contact.
struct Deepest {
    squared_m2: f64,
    time_s: f64,
    spots: [Spot; 2],
}

/// The deepest moment of a contact, the first among equal ones.
fn deepest(
    plan: &RoadmapPlan,
    roadmap: &Roadmap,
    agents: [u32; 2],
    contact: &ContactInterval,
) -> Deepest {
    let paths = agents.map(|agent| plan.path(agent as usize));
    let mut legs = paths.map(|path| Leg::at(path, contact.begin_s));
    let mut begin_s = contact.begin_s;
    let mut least: Option<Deepest> = None;
    loop {
        let leg_end_s = legs[0].end_s.min(legs[1].end_s);
        let end_s = leg_end_s.min(contact.end_s.unwrap_or(f64::INFINITY));
        // After their last knots both rest.
        let until_s = if end_s.is_finite() { end_s } else { begin_s };
        let [one, two] = legs.map(|leg| [begin_s, until_s].map(|time_s| leg.pose(roadmap, time_s)));
        let (squared_m2, share) = Relative::between(one, two).closest();
        if least.as_ref().is_none_or(|old| squared_m2 < old.squared_m2) {
            let time_s = match share {
                share if share >= 1.0 => until_s,
                share => begin_s + share * (until_s - begin_s),
            };
            least = Some(Deepest {
                squared_m2,
                time_s,
                spots: legs.map(|leg| leg.spot(time_s)),
            });
        }
        if end_s < leg_end_s || !leg_end_s.is_finite() {
            break;
        }
        begin_s = end_s;
        for (leg, path) in legs.iter_mut().zip(paths) {
            if leg.end_s <= end_s {
                *leg = leg.next(path);
            }
        }
    }
    least.unwrap_or(Deepest {
        squared_m2: 0.0,
        time_s: begin_s,
        spots: legs.map(|leg| leg.spot(begin_s)),
    })
}

fn describe(
    plan: &RoadmapPlan,
    task: &RoadmapTask<'_>,
    contact: &ContactInterval,
    other: u32,
) -> RoadmapViolation {
    let agents = [contact.agent, other];
    let found = deepest(plan, task.roadmap, agents, contact);
    let (rule, what) = name(task, agents, found.spots);
    let least_m = found.squared_m2.sqrt();
    let begin_s = contact.begin_s;
    let when = match contact.end_s {
        Some(end_s) => format!("from {begin_s} s to {end_s} s"),
        None => format!("from {begin_s} s on"),
    };
    // Beyond a millionth it is rounding.
    let [nearest_m, nearest_s] = [least_m, found.time_s].map(|value| (value * 1e6).round() / 1e6);
    let vertices = found.spots.iter().flat_map(|spot| match spot {
        Spot::At(vertex) => vec![*vertex],
        Spot::On(leg) => vec![leg.from, leg.to],
    });
    RoadmapViolation {
        rule,
        agents: agents.to_vec(),
        time_s: begin_s,
        end_s: contact.end_s,
        least_m: Some(least_m),
        vertices: vertices.collect(),
        sentence: format!(
            "{what}: nearer than {} m {when}, {nearest_m} m at {nearest_s} s",
            task.apart_m()
        ),
    }
}

/// The name of a contact by the positions of its deepest moment.
fn name(task: &RoadmapTask<'_>, agents: [u32; 2], spots: [Spot; 2]) -> (RoadmapRule, String) {
    let [one, two] = agents;
    let both = format!("agents {one} and {two}");
    let near = |where_they_are: String| (RoadmapRule::Near, format!("{both} {where_they_are}"));
    match spots {
        [Spot::At(v), Spot::At(w)] if v == w => (
            RoadmapRule::VertexConflict,
            format!("{both} are both at vertex {v}"),
        ),
        [Spot::At(v), Spot::At(w)] => near(format!("are at vertices {v} and {w}")),
        [Spot::At(v), Spot::On(leg)] => at_and_on([one, two], v, leg),
        [Spot::On(leg), Spot::At(v)] => at_and_on([two, one], v, leg),
        [Spot::On(a), Spot::On(b)] => {
            let edges = format!("between {} and {}, {} and {}", a.from, a.to, b.from, b.to);
            let gap_s = task.apart_m() / task.speed_m_per_s - task.time_s;
            if (a.from, a.to) == (b.from, b.to) {
                let what = format!(
                    "{both} follow each other from vertex {} to {}",
                    a.from, a.to
                );
                (RoadmapRule::Headway, what)
            } else if (a.from, a.to) == (b.to, b.from) {
                let what = format!("{both} meet head-on between {} and {}", a.from, a.to);
                (RoadmapRule::HeadOn, what)
            } else if a.to == b.from && a.end_s - b.begin_s < gap_s {
                follow(one, two, b.from)
            } else if b.to == a.from && b.end_s - a.begin_s < gap_s {
                follow(two, one, a.from)
            } else if cross(task.roadmap, a, b) {
                (RoadmapRule::CrossingEdges, format!("{both} cross {edges}"))
            } else {
                near(format!("drive {edges}"))
            }
        }
    }
}

/// One agent follows another through a vertex too early.
fn follow(follower: u32, leader: u32, vertex: u32) -> (RoadmapRule, String) {
    let what = format!("agent {follower} follows agent {leader} through vertex {vertex}");
    (RoadmapRule::Headway, what)
}

/// The name of a contact of an agent at a vertex with one on an edge.
fn at_and_on([stays, drives]: [u32; 2], vertex: u32, leg: Leg) -> (RoadmapRule, String) {
    let Leg { from, to, .. } = leg;
    let what =
        format!("agent {drives} drives from vertex {from} to {to} with agent {stays} at {vertex}");
    if vertex == from || vertex == to {
        (RoadmapRule::Headway, what)
    } else {
        (RoadmapRule::Near, what)
    }
}

/// True if two edges without a common vertex cross in one point within both.
fn cross(roadmap: &Roadmap, a: Leg, b: Leg) -> bool {
    let [p, q, r, s] = [a.from, a.to, b.from, b.to].map(|vertex| place(roadmap, vertex).position());
    let sides = |from, to, one, two| {
        let side = |point| {
            let (way, seen): (fleetyard_world::Vector, fleetyard_world::Vector) =
                (to - from, point - from);
            way.perp(&seen)
        };
        side(one) * side(two) < 0.0
    };
    sides(p, q, r, s) && sides(r, s, p, q)
}
