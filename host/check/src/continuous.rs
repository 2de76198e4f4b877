//! The validator of plans in continuous space and time.
//!
//! Feasibility is that of GRACE (section III-D): at all times every footprint is
//! in the free space and disjoint from all others. It is decided by the exact
//! checker of [`fleetyard_world::exact`], not by samples. Starts, goals and what
//! bodies can do ([`Dynamics`]) are checked where they are given. After its
//! last knot an agent stays where it is, and must do no harm there.

use std::f64::consts::TAU;
use std::fmt;

use fleetyard_core::{TrajectoryPlan, words};
use fleetyard_world::exact::{ContactSearch, Obstacles, Touched, contacts};
use fleetyard_world::{Demand, Dynamics, Excess, Pose, Shape};
use serde::{Deserialize, Serialize};

use crate::controls::{self, ControlTask};
use crate::trailers::{self, TrailerTask};
use crate::verdict::{keep_first, other_counts};

/// The data that a plan in continuous space is judged by.
#[derive(Debug, Clone)]
pub struct ContinuousTask<'a> {
    /// Every agent's footprint.
    pub shapes: &'a [&'a Shape],
    /// Obstacles that stand or move.
    pub obstacles: &'a Obstacles<'a>,
    /// Pose in which each agent begins, if given.
    pub starts: Option<&'a [Pose]>,
    /// Pose in which each agent comes to rest, if given.
    pub goals: Option<&'a [Pose]>,
    /// The dynamics of every agent, if they are given.
    pub limits: Option<&'a [Dynamics]>,
    /// The data that controls are judged by, if they are given. Agents with controls are held to the
    /// limits there.
    pub controls: Option<ControlTask<'a>>,
    /// The trailer of every agent that tows one; empty where none does.
    pub trailers: &'a [Option<TrailerTask<'a>>],
    /// Deviations that are no violation.
    pub tolerance: Tolerance,
}

impl<'a> ContinuousTask<'a> {
    /// Nothing but footprints among obstacles.
    pub fn new(shapes: &'a [&'a Shape], obstacles: &'a Obstacles<'a>) -> Self {
        Self {
            shapes,
            obstacles,
            starts: None,
            goals: None,
            limits: None,
            controls: None,
            trailers: &[],
            tolerance: Tolerance::default(),
        }
    }
}

/// Rounding that is forgiven; of the dynamics of bodies,
/// [`DYNAMICS_TOLERANCE`](fleetyard_world::DYNAMICS_TOLERANCE).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tolerance {
    /// Footprints may overlap by this, in metres; touching is no contact.
    pub overlap_m: f64,
    /// Starts may be missed by this.
    pub start: Near,
    /// Goals may be missed by this.
    pub goal: Near,
}

/// A distance from a pose. Headings only count for footprints that are no discs, in plans that
/// have headings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Near {
    /// Of the place, in metres.
    pub place_m: f64,
    /// Of the heading, in radians.
    pub heading_rad: f64,
}

impl Default for Tolerance {
    fn default() -> Self {
        let near = Near {
            place_m: 1e-6,
            heading_rad: 1e-6,
        };
        Self {
            overlap_m: 1e-6,
            start: near,
            goal: near,
        }
    }
}

/// A rule that a plan in continuous space can break.
///
/// The order is the order in which violations of equal time and agents are
/// listed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum ContinuousRule {
    /// The plan has paths for more or fewer agents than there are footprints,
    /// starts, goals or limits.
    AgentCount,
    /// A path does not begin at its agent's start.
    WrongStart,
    /// A path does not end at its agent's goal.
    WrongGoal,
    /// An agent is faster than it can be.
    TooFast,
    /// An agent moves where its wheels do not lead.
    WrongCourse,
    /// An agent turns faster than it can.
    TurnsTooFast,
    /// An agent changes its velocity faster than it can.
    TooSudden,
    /// An agent changes its turn rate faster than it can.
    TurnsTooSuddenly,
    /// A car bends the joint to its trailer more than it can.
    JointLimit,
    /// An agent leaves the states that it may be in.
    OutOfLimits,
    /// The controls of an agent do not lead to its knots.
    OffControls,
    /// The controls of an agent are none of its robot.
    WrongControls,
    /// Two agents overlap.
    AgentContact,
    /// An agent overlaps an obstacle.
    ObstacleContact,
    /// An agent overlaps a moving obstacle.
    MoverContact,
    /// An agent reaches over the bounds of the world.
    OutOfBounds,
}

words!(ContinuousRule {
    AgentCount = "agent-count";
    WrongStart = "wrong-start";
    WrongGoal = "wrong-goal";
    TooFast = "too-fast";
    WrongCourse = "wrong-course";
    TurnsTooFast = "turns-too-fast";
    TooSudden = "too-sudden";
    TurnsTooSuddenly = "turns-too-suddenly";
    JointLimit = "joint-limit";
    OutOfLimits = "out-of-limits";
    OffControls = "off-controls";
    WrongControls = "wrong-controls";
    AgentContact = "agent-contact";
    ObstacleContact = "obstacle-contact";
    MoverContact = "mover-contact";
    OutOfBounds = "out-of-bounds";
});

/// One broken rule.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ContinuousViolation {
    /// The rule.
    pub rule: ContinuousRule,
    /// The agents at fault, counted from 0, in increasing order.
    pub agents: Vec<u32>,
    /// Time of its begin, in seconds.
    pub time_s: f64,
    /// Time of its end, for contacts that end.
    pub end_s: Option<f64>,
    /// The excess over what the agent can do, where that is the rule.
    #[serde(flatten, skip_serializing_if = "Option::is_none")]
    pub excess: Option<BeyondLimit>,
    /// All of it as a sentence.
    pub sentence: String,
}

/// A demand on an agent, and the most that it can do.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct BeyondLimit {
    /// The place of the agent then, in metres.
    pub place_m: [f64; 2],
    /// The demand of the plan, in the unit of the rule: m/s, m/s², rad/s, rad/s²; of a
    /// course, radians from the nearest possible one; of controls beside knots, metres or radians.
    pub value: f64,
    /// The most that it can, in the same unit.
    pub limit: f64,
}

impl fmt::Display for ContinuousViolation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.sentence)
    }
}

/// The validator's verdict on a plan in continuous space.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ContinuousVerdict {
    /// True if the plan breaks no rule.
    pub valid: bool,
    /// The first violations by time, then agents, at most as many as were asked
    /// for.
    pub violations: Vec<ContinuousViolation>,
    /// Up to when contacts were looked for, in seconds: the end of the plan,
    /// unless there were more than were asked for.
    pub checked_until_s: f64,
}

/// Judges a plan; at most `limit` violations are described, and at least one if
/// there is one.
///
/// Takes about the time of [`contacts`], which stops where the limit is reached.
pub fn validate_trajectories(
    plan: &TrajectoryPlan,
    task: &ContinuousTask<'_>,
    limit: usize,
) -> ContinuousVerdict {
    let limit = limit.max(1);
    let mut violations = Vec::new();
    check_counts(plan, task, &mut violations);
    if !violations.is_empty() {
        // Nobody knows who is who.
        return ContinuousVerdict {
            valid: false,
            violations,
            checked_until_s: 0.0,
        };
    }
    check_places(plan, task, &mut violations);
    check_dynamics(plan, task, &mut violations);
    controls::check(plan, task, &mut violations);
    let bodies = trailers::check(plan, task, &mut violations);
    let slack_m = controls::slack_m(plan, task.shapes).max(bodies.slack_m(plan.agents()));
    let search = ContactSearch {
        tolerance_m: task.tolerance.overlap_m + slack_m,
        limit,
        approach_range_m: None,
    };
    let found = contacts(&bodies.trains, &bodies.shapes, task.obstacles, &search);
    violations.extend(found.contacts.iter().map(|contact| {
        let agent = bodies.trains.agent_of(contact.agent);
        let who = || bodies.name(contact.agent);
        let (rule, agents, what) = match contact.other {
            Touched::Agent(other) => {
                let what = format!("{} overlap", bodies.names(contact.agent, other));
                let mut both = vec![agent, bodies.trains.agent_of(other)];
                both.sort_unstable();
                (ContinuousRule::AgentContact, both, what)
            }
            Touched::Cell(cell) => {
                let what = format!("{} overlaps the obstacle in cell {cell}", who());
                (ContinuousRule::ObstacleContact, vec![agent], what)
            }
            Touched::Polygon(polygon) => {
                let what = format!("{} overlaps obstacle {polygon}", who());
                (ContinuousRule::ObstacleContact, vec![agent], what)
            }
            Touched::Mover(mover) => {
                let what = format!("{} overlaps moving obstacle {mover}", who());
                (ContinuousRule::MoverContact, vec![agent], what)
            }
            Touched::Outside => {
                let what = format!("{} reaches over the bounds", who());
                (ContinuousRule::OutOfBounds, vec![agent], what)
            }
        };
        let begin_s = contact.begin_s;
        let sentence = match contact.end_s {
            Some(end_s) => format!("{what} from {begin_s} s to {end_s} s"),
            None => format!("{what} from {begin_s} s on"),
        };
        ContinuousViolation {
            rule,
            agents,
            time_s: begin_s,
            end_s: contact.end_s,
            excess: None,
            sentence,
        }
    }));
    keep_first(&mut violations, limit, |violation| {
        (violation.time_s, &violation.agents, violation.rule)
    });
    ContinuousVerdict {
        valid: violations.is_empty(),
        violations,
        checked_until_s: found.until_s,
    }
}

fn check_counts(
    plan: &TrajectoryPlan,
    task: &ContinuousTask<'_>,
    violations: &mut Vec<ContinuousViolation>,
) {
    let agents = plan.agents();
    let counts = [
        ("footprints", Some(task.shapes.len())),
        ("starts", task.starts.map(<[_]>::len)),
        ("goals", task.goals.map(<[_]>::len)),
        ("limits", task.limits.map(<[_]>::len)),
        (
            "models",
            task.controls.map(|controls| controls.models.len()),
        ),
        (
            "trailers",
            (!task.trailers.is_empty()).then_some(task.trailers.len()),
        ),
    ];
    violations.extend(
        other_counts(agents, counts).map(|sentence| ContinuousViolation {
            rule: ContinuousRule::AgentCount,
            agents: Vec::new(),
            time_s: 0.0,
            end_s: None,
            excess: None,
            sentence,
        }),
    );
}

fn check_places(
    plan: &TrajectoryPlan,
    task: &ContinuousTask<'_>,
    violations: &mut Vec<ContinuousViolation>,
) {
    let Tolerance { start, goal, .. } = task.tolerance;
    let places = [
        (task.starts, start, ContinuousRule::WrongStart),
        (task.goals, goal, ContinuousRule::WrongGoal),
    ];
    for (poses, near, rule) in places {
        for (agent, wanted) in poses.unwrap_or_default().iter().enumerate() {
            let knots = plan.knots(agent);
            let (at, does, place) = match rule {
                ContinuousRule::WrongStart => (0, "begins", "start"),
                _ => (knots.time_s.len() - 1, "ends", "goal"),
            };
            let (x, y) = (knots.x_m[at] - wanted.x, knots.y_m[at] - wanted.y);
            let missed_m = (x * x + y * y).sqrt();
            let turn = knots
                .heading_rad
                .filter(|_| !task.shapes[agent].is_disc())
                .map_or(0.0, |all| all[at] - wanted.heading);
            let missed_rad = (turn - TAU * (turn / TAU).round()).abs();
            let sentence = if missed_m > near.place_m {
                format!("agent {agent} {does} {missed_m} m from its {place}")
            } else if missed_rad > near.heading_rad {
                format!("agent {agent} {does} at its {place}, but turned by {missed_rad} rad")
            } else {
                continue;
            };
            violations.push(ContinuousViolation {
                rule,
                agents: vec![agent as u32],
                time_s: knots.time_s[at],
                end_s: None,
                excess: None,
                sentence,
            });
        }
    }
}

fn check_dynamics(
    plan: &TrajectoryPlan,
    task: &ContinuousTask<'_>,
    violations: &mut Vec<ContinuousViolation>,
) {
    for (agent, limits) in task.limits.unwrap_or_default().iter().enumerate() {
        if task.controls.is_some() && controls::has(plan, agent) {
            continue;
        }
        let excesses = limits.excesses(plan.knots(agent));
        violations.extend(excesses.iter().map(|excess| {
            let (rule, what) = beyond(excess);
            let (time_s, [x, y]) = (excess.time_s, excess.place_m);
            let when = match excess.demand {
                Demand::Acceleration | Demand::TurnAcceleration => format!("at {time_s} s"),
                _ => format!("from {time_s} s on"),
            };
            ContinuousViolation {
                rule,
                agents: vec![agent as u32],
                time_s,
                end_s: None,
                excess: Some(BeyondLimit {
                    place_m: excess.place_m,
                    value: excess.value,
                    limit: excess.limit,
                }),
                sentence: format!("agent {agent} {what} {when}, in [{x}, {y}]"),
            }
        }));
    }
}

/// The rule that is broken, and how.
fn beyond(excess: &Excess) -> (ContinuousRule, String) {
    let Excess { along, limit, .. } = excess;
    // Beyond a millionth it is rounding, which the limit forgives.
    let value = (excess.value * 1e6).round() / 1e6;
    let gap = if along.is_empty() { "" } else { " " };
    match excess.demand {
        Demand::Speed => (
            ContinuousRule::TooFast,
            format!("moves{gap}{along} at {value} m/s, faster than {limit} m/s,"),
        ),
        Demand::Course => (
            ContinuousRule::WrongCourse,
            format!("moves {value} rad beside where its wheels lead,"),
        ),
        Demand::TurnRate => (
            ContinuousRule::TurnsTooFast,
            format!("turns at {value} rad/s, faster than {limit} rad/s,"),
        ),
        Demand::Steering => (
            ContinuousRule::TurnsTooFast,
            format!("turns at {value} rad/s, where its steering allows {limit} rad/s,"),
        ),
        Demand::Acceleration => (
            ContinuousRule::TooSudden,
            format!("changes its speed{gap}{along} by {value} m/s², more than {limit} m/s²,"),
        ),
        Demand::TurnAcceleration => (
            ContinuousRule::TurnsTooSuddenly,
            format!("changes its turn rate by {value} rad/s², more than {limit} rad/s²,"),
        ),
    }
}
