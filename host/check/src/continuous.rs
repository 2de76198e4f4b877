//! The validator of plans in continuous space and time.
//!
//! Feasibility is that of GRACE (section III-D): at all times every footprint is
//! in the free space and disjoint from all others. It is decided by the exact
//! checker of [`fleetyard_world::exact`], not by samples. Starts, goals and what
//! bodies can do ([`Dynamics`]) are checked where they are given. After its
//! last knot an agent stays where it is, and must do no harm there.

use std::f64::consts::TAU;
use std::fmt;

use fleetyard_core::TrajectoryPlan;
use fleetyard_world::exact::{ContactSearch, Obstacles, Touched, contacts};
use fleetyard_world::{Demand, Dynamics, Excess, Pose, Shape};
use serde::{Deserialize, Serialize};

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
    /// Starts and goals may be missed by this, in metres.
    pub place_m: f64,
    /// Their headings may be missed by this, in radians. They only count for
    /// footprints that are no discs, in plans that have headings.
    pub heading_rad: f64,
}

impl Default for Tolerance {
    fn default() -> Self {
        Self {
            overlap_m: 1e-6,
            place_m: 1e-6,
            heading_rad: 1e-6,
        }
    }
}

/// A rule that a plan in continuous space can break.
///
/// The order is the order in which violations of equal time and agents are
/// listed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
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
    /// Two agents overlap.
    AgentContact,
    /// An agent overlaps an obstacle.
    ObstacleContact,
    /// An agent overlaps a moving obstacle.
    MoverContact,
    /// An agent reaches over the bounds of the world.
    OutOfBounds,
}

impl ContinuousRule {
    /// Every rule, in order.
    pub const ALL: [Self; 12] = [
        Self::AgentCount,
        Self::WrongStart,
        Self::WrongGoal,
        Self::TooFast,
        Self::WrongCourse,
        Self::TurnsTooFast,
        Self::TooSudden,
        Self::TurnsTooSuddenly,
        Self::AgentContact,
        Self::ObstacleContact,
        Self::MoverContact,
        Self::OutOfBounds,
    ];

    /// The name in JSON output.
    pub fn name(self) -> &'static str {
        match self {
            Self::AgentCount => "agent-count",
            Self::WrongStart => "wrong-start",
            Self::WrongGoal => "wrong-goal",
            Self::TooFast => "too-fast",
            Self::WrongCourse => "wrong-course",
            Self::TurnsTooFast => "turns-too-fast",
            Self::TooSudden => "too-sudden",
            Self::TurnsTooSuddenly => "turns-too-suddenly",
            Self::AgentContact => "agent-contact",
            Self::ObstacleContact => "obstacle-contact",
            Self::MoverContact => "mover-contact",
            Self::OutOfBounds => "out-of-bounds",
        }
    }
}

impl fmt::Display for ContinuousRule {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

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
    /// course, radians from the nearest possible one.
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
    let search = ContactSearch {
        tolerance_m: task.tolerance.overlap_m,
        limit,
        approach_range_m: None,
    };
    let found = contacts(plan, task.shapes, task.obstacles, &search);
    violations.extend(found.contacts.iter().map(|contact| {
        let agent = contact.agent;
        let (rule, agents, what) = match contact.other {
            Touched::Agent(other) => {
                let what = format!("agents {agent} and {other} overlap");
                (ContinuousRule::AgentContact, vec![agent, other], what)
            }
            Touched::Cell(cell) => {
                let what = format!("agent {agent} overlaps the obstacle in cell {cell}");
                (ContinuousRule::ObstacleContact, vec![agent], what)
            }
            Touched::Polygon(polygon) => {
                let what = format!("agent {agent} overlaps obstacle {polygon}");
                (ContinuousRule::ObstacleContact, vec![agent], what)
            }
            Touched::Mover(mover) => {
                let what = format!("agent {agent} overlaps moving obstacle {mover}");
                (ContinuousRule::MoverContact, vec![agent], what)
            }
            Touched::Outside => {
                let what = format!("agent {agent} reaches over the bounds");
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
    violations.sort_by(|one, two| {
        one.time_s
            .total_cmp(&two.time_s)
            .then_with(|| one.agents.cmp(&two.agents))
            .then(one.rule.cmp(&two.rule))
    });
    violations.truncate(limit);
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
    ];
    for (what, count) in counts {
        if let Some(count) = count.filter(|count| *count != agents) {
            violations.push(ContinuousViolation {
                rule: ContinuousRule::AgentCount,
                agents: Vec::new(),
                time_s: 0.0,
                end_s: None,
                excess: None,
                sentence: format!("the plan has {agents} agents, but there are {count} {what}"),
            });
        }
    }
}

fn check_places(
    plan: &TrajectoryPlan,
    task: &ContinuousTask<'_>,
    violations: &mut Vec<ContinuousViolation>,
) {
    let places = [
        (task.starts, ContinuousRule::WrongStart, "begins", "start"),
        (task.goals, ContinuousRule::WrongGoal, "ends", "goal"),
    ];
    for (poses, rule, does, place) in places {
        for (agent, wanted) in poses.unwrap_or_default().iter().enumerate() {
            let knots = plan.knots(agent);
            let at = match rule {
                ContinuousRule::WrongStart => 0,
                _ => knots.time_s.len() - 1,
            };
            let (x, y) = (knots.x_m[at] - wanted.x, knots.y_m[at] - wanted.y);
            let missed_m = (x * x + y * y).sqrt();
            let turn = knots
                .heading_rad
                .filter(|_| !task.shapes[agent].is_disc())
                .map_or(0.0, |all| all[at] - wanted.heading);
            let missed_rad = (turn - TAU * (turn / TAU).round()).abs();
            let sentence = if missed_m > task.tolerance.place_m {
                format!("agent {agent} {does} {missed_m} m from its {place}")
            } else if missed_rad > task.tolerance.heading_rad {
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

#[cfg(test)]
mod tests {
    use fleetyard_core::{Grid, GridInstance, GridPlan, Knot};
    use fleetyard_world::{Boundary, Bounds, Footprint, Polygon, Travel, Workspace};
    use proptest::prelude::*;

    use super::*;

    fn disc(radius_m: f64) -> Shape {
        Footprint::Disc { radius_m }.shape().unwrap()
    }

    fn plan(paths: &[&[(f64, f64, f64, f64)]]) -> TrajectoryPlan {
        let mut plan = TrajectoryPlan::default();
        for path in paths {
            let knots = path.iter().map(|(time_s, x_m, y_m, heading)| Knot {
                time_s: *time_s,
                x_m: *x_m,
                y_m: *y_m,
                heading_rad: Some(*heading),
            });
            plan.push_path(knots).unwrap();
        }
        plan
    }

    fn sentences(verdict: &ContinuousVerdict) -> Vec<&str> {
        let all = verdict.violations.iter();
        all.map(|violation| violation.sentence.as_str()).collect()
    }

    #[test]
    fn every_rule() {
        let footprint = Footprint::Rectangle {
            length_m: 1.0,
            width_m: 0.5,
        };
        let rectangle = footprint.shape().unwrap();
        let shapes = [&rectangle, &rectangle];
        let workspace = Workspace {
            name: String::new(),
            bounds: Bounds {
                min: [0.0, 0.0],
                max: [10.0, 10.0],
            },
            boundary: None,
            obstacles: vec![Polygon::rectangle([5.0, 5.0], [1.0, 1.0], 0.0).unwrap()],
            movers: Vec::new(),
        };
        let obstacles = Obstacles::workspace(&workspace);
        let good = plan(&[
            &[(0.0, 1.0, 1.0, 0.0), (4.0, 9.0, 1.0, 0.0)],
            &[
                (0.0, 1.0, 2.0, 0.0),
                (4.0, 9.0, 2.0, 0.0),
                (4.2, 9.0, 2.0, 0.15),
                (5.1, 9.0, 2.0, 1.5),
                (6.1, 9.0, 2.0, 1.5),
            ],
        ]);
        let starts = [Pose::at(1.0, 1.0), Pose::at(1.0, 2.0)];
        let goals = [Pose::new(9.0, 1.0, TAU), Pose::new(9.0, 2.0, 1.5)];
        let limits = [Dynamics {
            travel: Travel::Polar {
                speed: 2.0,
                acceleration: f64::INFINITY,
            },
            turn_rad_per_s: 1.5,
            turn_acceleration_rad_per_s2: 15.0,
        }; 2];
        let task = ContinuousTask {
            starts: Some(&starts),
            goals: Some(&goals),
            limits: Some(&limits),
            ..ContinuousTask::new(&shapes, &obstacles)
        };
        let verdict = validate_trajectories(&good, &task, 10);
        assert_eq!(sentences(&verdict), [""; 0]);
        assert!(verdict.valid);
        assert!((verdict.checked_until_s - 6.1).abs() < 1e-12);

        let bad = plan(&[
            &[(0.0, 1.0, 1.5, 0.0), (4.0, 5.0, 5.0, 0.0)],
            &[
                (0.0, 1.0, 2.0, 0.0),
                (2.0, 9.0, 2.0, 0.0),
                (3.0, 9.75, 2.0, 3.0),
            ],
        ]);
        let verdict = validate_trajectories(&bad, &task, 10);
        assert!(!verdict.valid);
        assert_eq!(
            sentences(&verdict),
            [
                "agent 0 begins 0.5 m from its start",
                "agent 1 moves at 4 m/s, faster than 2 m/s, from 0 s on, in [1, 2]",
                "agents 0 and 1 overlap from 0.0000011428571428571428 s to 0.333333 s",
                "agent 1 turns at 3 rad/s, faster than 1.5 rad/s, from 2 s on, in [9, 2]",
                "agent 1 changes its turn rate by 30 rad/s², more than 15 rad/s², at 2 s, in [9, 2]",
                "agent 1 reaches over the bounds from 2.704087739031907 s on",
                "agent 1 ends 0.75 m from its goal",
                "agent 0 overlaps obstacle 0 from 3.1428582857142855 s on",
                "agent 0 ends 5.656854249492381 m from its goal",
            ]
        );
    }

    /// The double integrator has 0.5 m/s and 2 m/s² along each axis.
    #[test]
    fn an_instant_reversal_and_too_fast_an_axis_are_refused() {
        let disc = disc(0.1);
        let none = Obstacles::none();
        let limits = [Dynamics {
            travel: Travel::Axes {
                speed: 0.5,
                acceleration: 2.0,
            },
            turn_rad_per_s: f64::INFINITY,
            turn_acceleration_rad_per_s2: f64::INFINITY,
        }];
        let shapes = [&disc];
        let task = ContinuousTask {
            limits: Some(&limits),
            ..ContinuousTask::new(&shapes, &none)
        };
        // Speeds along x in steps of a tenth of a second, from rest to rest.
        let driven = |speeds: &[f64]| {
            let mut path = vec![(0.0, 0.0, 0.0, 0.0)];
            for (at, speed) in speeds.iter().enumerate() {
                let x = path[at].1 + 0.1 * speed;
                path.push((0.1 * (at + 1) as f64, x, 0.0, 0.0));
            }
            validate_trajectories(&plan(&[&path]), &task, 10)
        };
        assert!(driven(&[0.2, 0.4, 0.5, 0.5, 0.4, 0.2]).valid);
        let reversal = driven(&[0.2, 0.4, 0.5, -0.5, -0.4, -0.2]);
        let found = &reversal.violations[..];
        assert_eq!(found.len(), 1, "{found:?}");
        assert_eq!(found[0].rule, ContinuousRule::TooSudden);
        let excess = found[0].excess.expect("a limit");
        assert!((excess.value - 10.0).abs() < 1e-9 && (excess.limit - 2.0).abs() < 1e-12);
        assert!((excess.place_m[0] - 0.11).abs() < 1e-12 && (found[0].time_s - 0.3).abs() < 1e-12);
        let fast = driven(&[0.2, 0.4, 0.6, 0.6, 0.4, 0.2]);
        assert_eq!(fast.violations.len(), 1, "{:?}", fast.violations);
        assert_eq!(fast.violations[0].rule, ContinuousRule::TooFast);
        let json = serde_json::to_value(&fast.violations[0]).unwrap();
        assert_eq!(json["rule"], "too-fast");
        assert_eq!(json["limit"], 0.5);
        assert_eq!(
            serde_json::from_value::<ContinuousViolation>(json).unwrap(),
            fast.violations[0]
        );
    }

    /// Ω of GRACE: an L whose notch no box tells.
    #[test]
    fn the_edge_of_a_world_is_kept_at_all_times() {
        let corners = [
            [0.0, 0.0],
            [6.0, 0.0],
            [6.0, 2.0],
            [2.0, 2.0],
            [2.0, 6.0],
            [0.0, 6.0],
        ];
        let boundary = Boundary::new(&corners).unwrap();
        let workspace = Workspace {
            name: String::new(),
            bounds: boundary.polygon().bounds(),
            boundary: Some(boundary),
            obstacles: Vec::new(),
            movers: Vec::new(),
        };
        let obstacles = Obstacles::workspace(&workspace);
        let disc = disc(0.5);
        let shapes = [&disc];
        let task = ContinuousTask::new(&shapes, &obstacles);
        let around = plan(&[&[
            (0.0, 5.0, 1.0, 0.0),
            (4.0, 1.0, 1.0, 0.0),
            (8.0, 1.0, 5.0, 0.0),
        ]]);
        assert!(validate_trajectories(&around, &task, 10).valid);
        // Straight through the notch, in and out again.
        let across = plan(&[&[(0.0, 5.0, 1.0, 0.0), (4.0, 1.0, 5.0, 0.0)]]);
        let verdict = validate_trajectories(&across, &task, 10);
        assert_eq!(verdict.violations.len(), 1, "{:?}", verdict.violations);
        let found = &verdict.violations[0];
        assert_eq!(found.rule, ContinuousRule::OutOfBounds);
        // It touches y = 2 with its upper side at y = 1.5, and x = 2 likewise.
        assert!((found.time_s - 0.5).abs() < 1e-5, "{found:?}");
        assert!(
            found.end_s.is_some_and(|end| (end - 3.5).abs() < 1e-5),
            "{found:?}"
        );
        // Far beyond, in the notch and out of the box.
        let away = plan(&[&[(0.0, 5.0, 1.0, 0.0), (1.0, 500.0, 100.0, 0.0)]]);
        let verdict = validate_trajectories(&away, &task, 10);
        assert_eq!(verdict.violations.len(), 1);
        assert_eq!(verdict.violations[0].end_s, None);
    }

    #[test]
    fn the_first_conflict_comes_first() {
        let disc = disc(0.5);
        // Agents 1 and 2 meet at 1 s, agents 0 and 1 at 9 s.
        let plan = plan(&[
            &[(0.0, 0.0, 0.0, 0.0)],
            &[(0.0, 10.0, 0.0, 0.0), (10.0, 0.0, 0.0, 0.0)],
            &[
                (0.0, 8.0, 0.0, 0.0),
                (0.5, 8.0, 0.0, 0.0),
                (0.9, 8.0, -4.0, 0.0),
            ],
            &[
                (0.0, 8.0, 9.0, 0.0),
                (1.0, 8.0, 0.0, 0.0),
                (1.1, 8.0, 9.0, 0.0),
            ],
        ]);
        let shapes = [&disc; 4];
        let none = Obstacles::none();
        let task = ContinuousTask::new(&shapes, &none);
        let first = validate_trajectories(&plan, &task, 1);
        assert_eq!(first.violations.len(), 1);
        assert_eq!(first.violations[0].rule, ContinuousRule::AgentContact);
        assert_eq!(first.violations[0].agents, [1, 3]);
        assert!(first.checked_until_s < 10.0);
        let all = validate_trajectories(&plan, &task, 100);
        assert_eq!(all.violations[0], first.violations[0]);
        assert_eq!(all.violations.last().unwrap().agents, [0, 1]);
        // Nobody knows who is who if the numbers differ.
        let task = ContinuousTask::new(&shapes[..3], &none);
        let verdict = validate_trajectories(&plan, &task, 0);
        assert_eq!(
            sentences(&verdict),
            ["the plan has 4 agents, but there are 3 footprints"]
        );
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(500))]

        /// With cells of side 2√2·r, the rules of eight-connected grids say what
        /// continuous space and time say, step by step.
        #[test]
        fn rules_of_grids_are_feasibility(
            walks in proptest::collection::vec(
                (0..36u32, proptest::collection::vec(0..9u8, 0..8)), 2..7,
            ),
        ) {
            let grid = std::sync::Arc::new(Grid::new("open", 6, 6, vec![b'.'; 36]).unwrap());
            let paths: Vec<Vec<u32>> = walks
                .iter()
                .map(|(start, turns)| {
                    let mut path = vec![*start];
                    for turn in turns {
                        let here = path[path.len() - 1];
                        let near = grid.neighbors(here, fleetyard_core::Connectivity::Eight);
                        let near: Vec<u32> = near.chain([here]).collect();
                        path.push(near[usize::from(*turn) % near.len()]);
                    }
                    path
                })
                .collect();
            let plan = GridPlan::from_paths(&paths);
            let starts = paths.iter().map(|path| path[0]).collect();
            let goals = paths.iter().map(|path| path[path.len() - 1]).collect();
            let eight = fleetyard_core::Connectivity::Eight;
            let instance = GridInstance::new(grid.clone(), eight, starts, goals);
            prop_assume!(instance.is_ok());
            let discrete = crate::validate(&instance.unwrap(), &plan, 100);

            let radius_m = 0.5;
            let side_m = 8f64.sqrt() * radius_m;
            let disc = disc(radius_m);
            let shapes = vec![&disc; paths.len()];
            let obstacles = Obstacles::cells(&grid, side_m).unwrap();
            let trajectories = TrajectoryPlan::from_grid(&plan, &grid, side_m, 1.0).unwrap();
            let task = ContinuousTask::new(&shapes, &obstacles);
            let continuous = validate_trajectories(&trajectories, &task, 100);
            prop_assert_eq!(discrete.valid, continuous.valid, "{:?}", discrete.violations);
            if let (Some(one), Some(two)) = (discrete.violations.first(), continuous.violations.first()) {
                // A contact begins in the step before the time of the violation.
                prop_assert_eq!(one.time, two.time_s.ceil() as u32);
            }
        }
    }
}
