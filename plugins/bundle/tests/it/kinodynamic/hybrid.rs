//! The planner `hybrid-astar`: its controls lead to the goal and touch nothing, whatever the robot, and what it refuses.

use std::f64::consts::{FRAC_PI_2, PI};
use std::sync::Arc;

use fleetyard_abi::sdk::{Failure, Options, Planner, Plugin};
use fleetyard_abi::{
    Budget, Environment, Footprint, Instance, Mover, Plan, State as Numbers, Status,
    WorkspaceEnvironment, monotonic_ns,
};
use fleetyard_plugin_kinodynamic::course::{Course, Segment};
use fleetyard_plugin_kinodynamic::hybrid::Ahead;
use fleetyard_plugin_kinodynamic::plugin::hybrid_astar::HybridAstar;
use fleetyard_plugin_kinodynamic::robot::{DYNAMICS, Robot, State};
use fleetyard_plugin_plane::Vector;
use fleetyard_testkit::Notes;
use proptest::prelude::*;

/// A box by its lower left and its upper right corner.
type Block = [f64; 4];

/// The side of the world, in metres.
const SIDE: f64 = 6.0;

/// A robot's body and dynamics.
#[derive(Debug, Clone, Copy)]
struct Kind {
    dynamics: &'static str,
    is_disc: bool,
    back: f64,
}

impl Kind {
    fn robot(self) -> fleetyard_abi::Robot {
        let second = self.dynamics.contains("double") || self.dynamics.contains("-2");
        let axes = if self.dynamics.contains("unicycle") {
            1
        } else {
            2
        };
        let has_heading = !self.is_disc || !self.dynamics.contains("integrator");
        let mut rates = vec![[Some(-0.8), Some(0.8)]; axes];
        rates[0][0] = Some(-self.back);
        let mut changes = vec![[Some(-1.0), Some(0.5)]; axes];
        if has_heading {
            rates.push([Some(-1.5), Some(1.5)]);
            changes.push([Some(-3.0), Some(3.0)]);
        }
        let mut state_limits = vec![[None; 2]; if has_heading { 3 } else { 2 }];
        if second {
            state_limits.extend(rates.clone());
        }
        let footprint = if self.is_disc {
            Footprint::disc(0.3)
        } else {
            Footprint {
                radius_m: 0.5,
                corners_m: CORNERS.map(|at| [at.x, at.y]).to_vec(),
            }
        };
        fleetyard_abi::Robot {
            name: "robot".into(),
            footprint,
            dynamics: self.dynamics.into(),
            has_heading,
            polar_state: false,
            polar_control: false,
            state_limits,
            control_limits: if second { changes } else { rates },
            parameters: Vec::new(),
        }
    }
}

const CORNERS: [Vector; 4] = [
    Vector::new(0.4, 0.3),
    Vector::new(-0.4, 0.3),
    Vector::new(-0.4, -0.3),
    Vector::new(0.4, -0.3),
];

/// A problem of one robot.
#[derive(Debug, Clone)]
struct Problem {
    kind: Kind,
    blocks: Vec<Block>,
    /// x, y and heading.
    start: [f64; 3],
    /// Not a number where any heading will do.
    goal: [f64; 3],
    tolerance: f64,
    movers: Vec<Mover>,
    robots: usize,
    nodes: u64,
}

impl Problem {
    fn new(kind: Kind, blocks: &[Block], start: [f64; 3], goal: [f64; 3]) -> Self {
        Self {
            kind,
            blocks: blocks.to_vec(),
            start,
            goal,
            tolerance: 1e-6,
            movers: Vec::new(),
            robots: 1,
            nodes: 0,
        }
    }

    fn plan(&self, options: &str) -> (Result<(), Failure>, Notes) {
        let corners = |[left, bottom, right, top]: Block| {
            vec![[left, bottom], [right, bottom], [right, top], [left, top]]
        };
        let environment = Environment::from(WorkspaceEnvironment {
            min_m: [0.0; 2],
            max_m: [SIDE; 2],
            obstacles: self.blocks.iter().copied().map(corners).collect(),
            movers: self.movers.clone(),
        });
        let robot = self.kind.robot();
        let state = |pose: [f64; 3]| {
            let mut numbers = vec![0.0; robot.state_limits.len()];
            let known = if robot.has_heading { 3 } else { 2 };
            numbers[..known].copy_from_slice(&pose[..known]);
            Numbers(numbers)
        };
        let instance = Instance {
            start_states: vec![state(self.start); self.robots],
            goal_states: (0..self.robots).map(|_| [state(self.goal)]).collect(),
            goal_tolerance_m: self.tolerance,
            goal_tolerance_rad: self.tolerance,
            goal_tolerance_rate: self.tolerance,
            robots: vec![robot],
            ..Instance::default()
        };
        let mut budget = Budget::lasting(monotonic_ns(), 120_000_000_000);
        budget.nodes = self.nodes;
        let notes = Notes::default();
        let mut planner = HybridAstar::create(Options::new(options)).unwrap();
        let mut world = planner
            .prepare(&Arc::new(environment), &budget, &notes)
            .unwrap();
        let end = planner.plan(&mut world, &instance, &budget, &notes);
        (end, notes)
    }

    /// The controls of the only plan, which are held against limits, walls and goal by poses every few millimetres.
    fn driven(&self, options: &str) -> Course {
        let (end, notes) = self.plan(options);
        end.unwrap_or_else(|failure| panic!("{failure}: {self:?}"));
        let plans = notes.others.lock().unwrap();
        let [Plan::Trajectories(plan)] = plans.as_slice() else {
            panic!("{plans:?}");
        };
        let robot = Robot::new(&self.kind.robot()).unwrap();
        let axes = robot.axes();
        let segments = plan.controls().unwrap().of(0).map(|segment| {
            let mut numbers = segment.control.iter();
            let control = axes.map(|there| if there { *numbers.next().unwrap() } else { 0.0 });
            Segment {
                control,
                seconds: segment.duration_s,
            }
        });
        let course = Course {
            start: State::rest(
                Vector::new(self.start[0], self.start[1]),
                if robot.has_heading {
                    self.start[2]
                } else {
                    0.0
                },
            ),
            segments: segments.collect(),
        };
        assert!(course.is_allowed(&robot), "{course:?}");
        let mut state = course.start;
        for segment in &course.segments {
            let parts = (segment.seconds * 200.0).ceil();
            for part in 0..=parts as u32 {
                let after = segment.seconds * f64::from(part) / parts;
                let at = robot.after(&state, &segment.control, after);
                assert!(self.is_free(&at, 1e-4), "{at:?}: {self:?}");
            }
            state = robot.after(&state, &segment.control, segment.seconds);
        }
        let off = (state.at - Vector::new(self.goal[0], self.goal[1])).norm();
        assert!(off <= self.tolerance + 1e-9, "{off} m from the goal");
        assert!(
            state
                .rates
                .iter()
                .all(|rate| rate.abs() <= self.tolerance + 1e-9),
            "{state:?}"
        );
        if robot.has_heading && !self.goal[2].is_nan() {
            let turn = (state.heading - self.goal[2]) / (2.0 * PI);
            assert!((turn - turn.round()).abs() < 1e-6, "{state:?}");
        }
        course
    }

    /// By separating axes; of a disc by the nearest point of a block. Overlaps up to `slack` metres are none.
    fn is_free(&self, state: &State, slack: f64) -> bool {
        if self.kind.is_disc {
            let reach = 0.3 - slack;
            let inside = state
                .at
                .iter()
                .all(|at| *at >= reach && *at <= SIDE - reach);
            return inside
                && self.blocks.iter().all(|[left, bottom, right, top]| {
                    let near = Vector::new(
                        state.at.x.clamp(*left, *right),
                        state.at.y.clamp(*bottom, *top),
                    );
                    (near - state.at).norm() >= reach
                });
        }
        let (sin, cos) = state.heading.sin_cos();
        let corners = CORNERS
            .map(|at| state.at + Vector::new(cos * at.x - sin * at.y, sin * at.x + cos * at.y));
        let inside = corners
            .iter()
            .flat_map(|at| at.iter())
            .all(|at| *at >= -slack && *at <= SIDE + slack);
        let past = |[left, bottom, right, top]: &Block| {
            let block = [
                [*left, *bottom],
                [*right, *bottom],
                [*right, *top],
                [*left, *top],
            ]
            .map(Vector::from);
            [
                Vector::x(),
                Vector::y(),
                Vector::new(cos, sin),
                Vector::new(-sin, cos),
            ]
            .iter()
            .any(|axis| {
                let span = |places: &[Vector]| {
                    let along = places.iter().map(|at| at.dot(axis));
                    along.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
                        (low.min(value), high.max(value))
                    })
                };
                let (own, other) = (span(&corners), span(&block));
                own.0 >= other.1 - slack || other.0 >= own.1 - slack
            })
        };
        inside && self.blocks.iter().all(past)
    }
}

fn kinds() -> impl Iterator<Item = Kind> {
    let bodies = [false, true].into_iter();
    bodies.flat_map(|is_disc| {
        DYNAMICS.map(|dynamics| Kind {
            dynamics,
            is_disc,
            back: 0.8,
        })
    })
}

/// Two rooms, and a door in the wall between them.
fn rooms(door: f64) -> [Block; 2] {
    let (low, high) = (f64::midpoint(SIDE, -door), f64::midpoint(SIDE, door));
    [[2.9, 0.0, 3.1, low], [2.9, high, 3.1, SIDE]]
}

#[test]
fn robots_of_all_dynamics_go_through_a_door() {
    for kind in kinds() {
        let heading = if kind.is_disc { f64::NAN } else { FRAC_PI_2 };
        let problem = Problem::new(kind, &rooms(0.8), [1.0, 1.0, 0.0], [5.0, 5.0, heading]);
        let course = problem.driven("{}");
        assert!(course.seconds() > 5.0, "{kind:?}: {course:?}");
        // A way that is left as it was found takes no less.
        let long = problem.driven(r#"{"shorten": false}"#);
        assert!(long.seconds() >= course.seconds() - 1e-9, "{kind:?}");
        assert_eq!(problem.driven("{}"), course);
    }
}

/// Lengthwise there are 5 cm on either side; across it does not fit.
#[test]
fn a_rectangle_passes_a_door_that_its_disc_does_not() {
    for dynamics in DYNAMICS {
        let kind = Kind {
            dynamics,
            is_disc: false,
            back: 0.0,
        };
        if dynamics.contains("integrator") || dynamics.contains("holonomic") {
            continue;
        }
        let problem = Problem::new(kind, &rooms(0.7), [1.0, 1.0, PI], [5.0, 1.0, f64::NAN]);
        problem.driven("{}");
    }
    let wide = Kind {
        dynamics: DYNAMICS[2],
        is_disc: false,
        back: 0.0,
    };
    let narrow = Problem::new(wide, &rooms(0.55), [1.0, 1.0, 0.0], [5.0, 1.0, f64::NAN]);
    let failure = narrow.plan("{}").0.unwrap_err();
    assert_eq!(failure.status, Status::GaveUp);
    assert!(failure.message.contains("bin_m"), "{failure}");
}

/// Forward alone it has to turn round; with a reverse it may back out.
#[test]
fn a_pocket_is_left_backwards_where_there_is_no_room_to_turn() {
    // Too narrow to turn: 0.7 m beside a diagonal of 1 m.
    let pocket = [
        [2.0, 2.65, 4.0, 2.75],
        [2.0, 3.45, 4.0, 3.55],
        [3.9, 2.75, 4.0, 3.45],
    ];
    let problem = |back| {
        Problem::new(
            Kind {
                dynamics: DYNAMICS[2],
                is_disc: false,
                back,
            },
            &pocket,
            [3.4, 3.1, 0.0],
            [0.7, 3.1, f64::NAN],
        )
    };
    problem(0.4).driven("{}");
    assert_eq!(
        problem(0.0).plan("{}").0.unwrap_err().status,
        Status::GaveUp
    );
}

#[test]
fn who_is_there_stays_and_who_touches_a_wall_leaves_it() {
    for kind in kinds() {
        let there = Problem::new(kind, &[], [3.0, 3.0, 0.5], [3.0, 3.0, 0.5]);
        assert_eq!(there.driven("{}").segments, []);
        let reach = if kind.is_disc { 0.3 } else { 0.4 };
        let touching = Problem::new(kind, &[], [reach, 3.0, 0.0], [5.0, 3.0, f64::NAN]);
        // A robot that may not back out cannot turn at a wall, but goes straight on.
        touching.driven("{}");
    }
}

#[test]
fn teams_movers_and_closed_rooms_are_refused() {
    let kind = Kind {
        dynamics: DYNAMICS[2],
        is_disc: true,
        back: 0.0,
    };
    let problem =
        |blocks: &[Block]| Problem::new(kind, blocks, [1.0, 1.0, 0.0], [5.0, 1.0, f64::NAN]);
    let status = |problem: &Problem| problem.plan("{}").0.unwrap_err().status;
    assert_eq!(
        status(&Problem {
            robots: 2,
            ..problem(&[])
        }),
        Status::Unsupported
    );
    let mover = Mover {
        footprint: Footprint::disc(0.2),
        knots: vec![[0.0, 3.0, 5.0, 0.0]],
    };
    assert_eq!(
        status(&Problem {
            movers: vec![mover],
            ..problem(&[])
        }),
        Status::Unsupported
    );
    assert_eq!(status(&problem(&[[2.9, 0.0, 3.1, SIDE]])), Status::GaveUp);
    assert_eq!(
        status(&Problem {
            nodes: 3,
            ..problem(&rooms(0.8))
        }),
        Status::GaveUp
    );
    for options in [
        r#"{"bin_m": 0}"#,
        r#"{"headings": 3}"#,
        r#"{"clearance_m": -1}"#,
    ] {
        let refused = HybridAstar::create(Options::new(options)).unwrap_err();
        assert_eq!(refused.status, Status::InvalidInput, "{options}");
    }
}

/// Wheels that turn and drive as fast as they can at once are never faster than the estimate says.
#[test]
fn the_estimate_without_obstacles_is_a_bound() {
    let ahead = Ahead {
        speed: 0.8,
        back: 0.0,
        turn_rate: 1.5,
    };
    for step in 0..=24 {
        let off = PI * f64::from(step) / 24.0;
        let (mut at, mut turned, mut seconds) = (0.0_f64, off, 0.0_f64);
        let small = 1e-4;
        while at < 2.0 {
            at += 0.8 * turned.cos().max(0.0) * small;
            turned = (turned - 1.5 * small).max(0.0);
            seconds += small;
        }
        let bound = ahead.seconds(2.0, off);
        assert!(
            (bound - seconds).abs() < 2e-3,
            "{off} rad: {bound} s, but {seconds} s"
        );
        assert!(Ahead { back: 0.8, ..ahead }.seconds(2.0, off) <= bound + 1e-12);
    }
    assert!((ahead.seconds(0.01, 0.3) - 0.01 / 0.8 / 0.3_f64.cos()).abs() < 1e-3);
}

fn any_block() -> impl Strategy<Value = Block> {
    (0.0..SIDE, 0.0..SIDE, 0.2..1.5_f64, 0.2..1.5_f64)
        .prop_map(|(x, y, width, height)| [x, y, (x + width).min(SIDE), (y + height).min(SIDE)])
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// Among random blocks; who has no way gives up, and all else is held against walls and limits.
    #[test]
    fn plans_touch_nothing_and_are_the_same_again(
        number in 0..2 * DYNAMICS.len(), blocks in prop::collection::vec(any_block(), 0..6),
        start in prop::array::uniform3(0.5..5.5_f64), goal in prop::array::uniform3(0.5..5.5_f64),
        any_heading in any::<bool>(), backs in any::<bool>(),
    ) {
        let kind = Kind { back: if backs { 0.4 } else { 0.0 }, ..kinds().nth(number).unwrap() };
        let goal = [goal[0], goal[1], if any_heading { f64::NAN } else { goal[2] }];
        let problem = Problem { nodes: 4000, ..Problem::new(kind, &blocks, start, goal) };
        let ends = [start, [goal[0], goal[1], if any_heading { 0.0 } else { goal[2] }]];
        let free = |[x, y, heading]: [f64; 3]| problem.is_free(&State::rest(Vector::new(x, y), heading), 0.0);
        prop_assume!(ends.into_iter().all(free));
        match problem.plan("{}").0 {
            Ok(()) => {
                let course = problem.driven("{}");
                prop_assert_eq!(problem.driven("{}"), course);
            }
            Err(failure) => prop_assert!(matches!(failure.status, Status::GaveUp | Status::TimedOut), "{}", failure),
        }
    }
}
