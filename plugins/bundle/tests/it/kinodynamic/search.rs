//! Motion primitives, curves, and the searches over them.

use std::f64::consts::PI;
use std::sync::{Arc, Mutex};

use fleetyard_abi::sdk::{Failure, Options, Planner, Plugin, Rejected, Sink};
use fleetyard_abi::{
    Budget, ControlPlan, Footprint, LogLevel, Mover, PlanRef, Request, Status, monotonic_ns,
};
use fleetyard_plugin_kinodynamic::course::{Course, Segment};
use fleetyard_plugin_kinodynamic::curves::Curves;
use fleetyard_plugin_kinodynamic::plugin::Team;
use fleetyard_plugin_kinodynamic::plugin::db_astar::DbAstar;
use fleetyard_plugin_kinodynamic::plugin::db_cbs::DbCbs;
use fleetyard_plugin_kinodynamic::plugin::db_lacam::DbLacam;
use fleetyard_plugin_kinodynamic::primitives::Primitives;
use fleetyard_plugin_kinodynamic::robot::{DYNAMICS, Robot, State};
use fleetyard_plugin_kinodynamic::steer::steer;
use fleetyard_plugin_plane::Vector;
use fleetyard_plugin_plane::plugin::robots::world;
use fleetyard_plugin_plane::sssp::bodies::{Pose, wrapped};
use proptest::prelude::*;

use super::tasks::{Problem, rectangle, robot};

/// A rectangle or a disc with these dynamics.
fn vehicle(dynamics: &str, is_disc: bool) -> fleetyard_abi::Robot {
    let body = if is_disc {
        Footprint::disc(0.2)
    } else {
        rectangle(0.5, 0.25)
    };
    let axes = if dynamics.contains("unicycle") || dynamics.contains("integrator") {
        2
    } else {
        3
    };
    let second = dynamics.contains("double") || dynamics.contains("-2");
    let changes = [0.25; 3];
    robot(
        dynamics,
        body,
        &[0.5; 3][..axes],
        &changes[..if second { axes } else { 0 }],
    )
}

/// Numbers of a state at rest.
fn at_rest(robot: &fleetyard_abi::Robot, [x, y, heading]: [f64; 3]) -> Vec<f64> {
    let mut numbers = vec![x, y];
    if robot.has_heading {
        numbers.push(heading);
    }
    numbers.resize(robot.state_limits.len(), 0.0);
    numbers
}

/// Plans and figures of a planner.
#[derive(Debug, Default)]
pub(super) struct Said {
    pub(super) plans: Vec<ControlPlan>,
    figures: Vec<(String, f64)>,
}

#[derive(Default)]
struct Listener {
    said: Mutex<Said>,
    cancels: bool,
}

impl Sink for Listener {
    fn submit_plan(&self, plan: PlanRef<'_>) -> Result<(), Rejected> {
        let PlanRef::Trajectories(plan) = plan else {
            return Err(Rejected::Malformed);
        };
        let controls = plan.controls.ok_or(Rejected::Malformed)?;
        self.said.lock().unwrap().plans.push(controls.clone());
        Ok(())
    }
    fn submit_request(&self, _: &Request) -> Result<(), Rejected> {
        Err(Rejected::Malformed)
    }
    fn metric(&self, name: &str, value: f64) {
        let mut said = self.said.lock().unwrap();
        said.figures.push((name.to_owned(), value));
    }
    fn note(&self, _: &str, _: &str) {}
    fn log(&self, _: LogLevel, _: &str) {}
    fn progress(&self, _: u64, _: u64) {}
    fn cancelled(&self) -> bool {
        self.cancels
    }
}

/// Plans within so many nodes, and without a limit of time that matters.
pub(super) fn plan<P: Plugin + Planner>(
    problem: &Problem,
    options: &str,
    nodes: u64,
    cancels: bool,
) -> (Result<(), Failure>, Said) {
    let listener = Listener {
        cancels,
        ..Listener::default()
    };
    let mut budget = Budget::lasting(monotonic_ns(), 600_000_000_000);
    (budget.nodes, budget.seed) = (nodes, 7);
    let mut planner = P::create(Options::new(options)).unwrap();
    let environment = Arc::new(problem.environment());
    let mut map = planner.prepare(&environment, &budget, &listener).unwrap();
    let ended = planner.plan(&mut map, &problem.instance, &budget, &listener);
    (ended, listener.said.into_inner().unwrap())
}

/// The courses of a plan.
fn courses(team: &Team<'_>, plan: &ControlPlan) -> Vec<Course> {
    let members = team.members.iter().enumerate();
    let course = |(agent, member): (usize, &fleetyard_plugin_kinodynamic::plugin::Member)| {
        let segments = plan.of(agent).map(|held| {
            let mut numbers = held.control.iter().copied();
            let control = member
                .robot
                .axes()
                .map(|there| if there { numbers.next().unwrap() } else { 0.0 });
            Segment {
                control,
                seconds: held.duration_s,
            }
        });
        Course {
            start: member.start,
            segments: segments.collect(),
        }
    };
    members.map(course).collect()
}

/// Every plan is valid and costs less than the one before; the cost of the last.
fn checked(problem: &Problem, said: &Said) -> Option<f64> {
    let world = world(&Arc::new(problem.environment())).unwrap();
    let team = Team::new(&world, &problem.instance, 0.0).unwrap();
    let mut cost = f64::INFINITY;
    for plan in &said.plans {
        let courses = courses(&team, plan);
        assert_eq!(team.fault(&courses), None, "{problem:?}");
        let own = courses.iter().map(Course::seconds).sum();
        assert!(own < cost, "{own} {cost}");
        cost = own;
    }
    cost.is_finite().then_some(cost)
}

/// A plan, which has to be there.
fn solved<P: Plugin + Planner>(problem: &Problem) -> f64 {
    let (ended, said) = plan::<P>(problem, "{}", 30_000, false);
    ended.unwrap();
    assert!(said.figures.iter().any(|(name, _)| name == "nodes"));
    checked(problem, &said).expect("a plan")
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    #[test]
    fn curves_lead_to_their_ends_and_are_no_slower_than_turning_driving_and_turning(
        x in -4.0..4.0_f64, y in -4.0..4.0_f64, heading in -PI..PI, back in 0.0..1.0_f64, turn in 0.2..3.0_f64,
    ) {
        let mut told = vehicle("fleetyard.unicycle/1", false);
        told.control_limits = vec![[Some(-back), Some(0.5)], [Some(-turn), Some(turn)]];
        let robot = Robot::new(&told).unwrap();
        let pose = |x, y, heading| Pose { at: Vector::new(x, y), heading };
        let (from, to) = (pose(1.0, 2.0, 0.7), pose(1.0 + x, 2.0 + y, heading));
        let (seconds, segments) = Curves::new(&robot).unwrap().quickest(&from, &to).unwrap();
        let course = Course { start: State::rest(from.at, from.heading), segments };
        prop_assert!(course.is_allowed(&robot), "{course:?}");
        prop_assert!((course.seconds() - seconds).abs() < 1e-9);
        let end = course.end(&robot);
        prop_assert!((end.at - to.at).norm() < 1e-6, "{end:?} {to:?}");
        prop_assert!(wrapped(end.heading - to.heading).abs() < 1e-6, "{end:?} {to:?}");
        // With one speed both ways curves are the quickest motions that there are.
        told.control_limits[0][0] = Some(-0.5);
        let even = Robot::new(&told).unwrap();
        let (seconds, _) = Curves::new(&even).unwrap().quickest(&from, &to).unwrap();
        let other: f64 = steer(&even, &from, &to, false).unwrap().iter().map(|segment| segment.seconds).sum();
        prop_assert!(seconds <= other + 1e-9, "{seconds} {other}");
    }

    #[test]
    fn primitives_join_exactly_and_keep_their_limits(
        kind in 0..DYNAMICS.len(), picks in prop::collection::vec(any::<prop::sample::Index>(), 1..40), step in 0.1..1.0_f64,
        polar in any::<bool>(), slow in 0.05..2.0_f64,
    ) {
        let mut told = vehicle(DYNAMICS[kind], false);
        (told.polar_state, told.polar_control) = (polar, polar);
        told.control_limits[0] = [Some(-slow), Some(0.5)];
        let robot = Robot::new(&told).unwrap();
        let mut primitives = Primitives::new(&robot, step);
        let start = State::rest(Vector::new(3.0, -1.0), 0.4);
        let (mut level, mut course) = ([0; 3], Course::stay(start));
        for pick in picks {
            let set = primitives.from(level);
            prop_assert!(!set.is_empty());
            let primitive = pick.get(&set);
            prop_assert!((primitive.seconds - step).abs() < 1e-9);
            course.segments.extend(&primitive.segments);
            level = primitive.to;
        }
        prop_assert!(course.is_allowed(&robot), "{course:?}");
        let rates = primitives.rates(level);
        let end = course.end(&robot);
        for axis in 0..3 {
            prop_assert!((end.rates[axis] - rates[axis]).abs() < 1e-12, "{end:?} {rates:?}");
        }
        prop_assert_eq!(primitives.level(&end.rates), level);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn one_robot_finds_valid_plans_among_boxes_and_movers(
        kind in 0..DYNAMICS.len(), is_disc in any::<bool>(), start in (0.4..1.2_f64, 0.4..4.6_f64, -PI..PI),
        goal in (3.8..4.6_f64, 0.4..4.6_f64, -PI..PI), low in 0.6..3.0_f64, moves in any::<bool>(),
    ) {
        let robot = vehicle(DYNAMICS[kind], is_disc);
        let wall = [[2.0, low], [2.5, low], [2.5, low + 1.5], [2.0, low + 1.5]];
        let (start, goal) = (
            at_rest(&robot, [start.0, start.1, start.2]),
            at_rest(&robot, [goal.0, goal.1, goal.2]),
        );
        let mut problem = Problem::new(5.0, &[&wall]).with(robot, &start, &goal);
        if moves {
            problem.environment.movers = vec![Mover {
                footprint: Footprint::disc(0.3),
                knots: vec![[0.0, 3.1, 6.0, 0.0], [8.0, 3.1, -1.0, 0.0]],
            }];
        }
        let (ended, said) = plan::<DbAstar>(&problem, "{\"refinements\": 1}", 20_000, false);
        let cost = checked(&problem, &said);
        prop_assert_eq!(cost.is_some(), ended.is_ok());
        prop_assert!(cost.is_some(), "{:?}", ended);
        let again = plan::<DbAstar>(&problem, "{\"refinements\": 1}", 20_000, false).1;
        prop_assert_eq!(again.plans, said.plans);
    }
}

#[test]
fn db_astar_squeezes_through_a_narrow_door_and_parks_backwards() {
    let unicycle = vehicle("fleetyard.unicycle/1", false);
    let walls: [&[[f64; 2]]; 2] = [
        &[[2.0, 0.0], [2.2, 0.0], [2.2, 2.32], [2.0, 2.32]],
        &[[2.0, 2.68], [2.2, 2.68], [2.2, 5.0], [2.0, 5.0]],
    ];
    // A door of 36 cm for a body of 25 cm.
    let problem = Problem::new(5.0, &walls).with(unicycle, &[1.0, 1.0, 0.0], &[3.0, 4.0, 1.0]);
    let cost = solved::<DbAstar>(&problem);
    assert!(cost < 14.0, "{cost}");
    // A slot that is as wide.
    let unicycle = vehicle("fleetyard.unicycle/1", false);
    let slot: [&[[f64; 2]]; 2] = [
        &[[2.0, 0.0], [2.33, 0.0], [2.33, 0.7], [2.0, 0.7]],
        &[[2.67, 0.0], [3.0, 0.0], [3.0, 0.7], [2.67, 0.7]],
    ];
    let problem = Problem::new(5.0, &slot).with(unicycle, &[1.0, 4.0, 0.0], &[2.5, 0.3, PI / 2.0]);
    solved::<DbAstar>(&problem);
}

#[test]
fn db_astar_takes_what_is_awkward() {
    let place = [1.0, 1.0, 0.3];
    for dynamics in DYNAMICS {
        let own = vehicle(dynamics, false);
        // It is there.
        let there = at_rest(&own, place);
        let problem = Problem::new(5.0, &[]).with(own.clone(), &there, &there);
        assert!(
            plan::<DbAstar>(&problem, "{}", 0, false).0.is_ok(),
            "{dynamics}"
        );
        // It touches the wall, but may leave.
        let wall: &[[f64; 2]] = &[[0.0, 0.0], [3.0, 0.0], [3.0, 0.8], [0.0, 0.8]];
        let (start, goal) = (
            at_rest(&own, [1.0, 0.925, 0.0]),
            at_rest(&own, [3.0, 3.0, 1.0]),
        );
        let problem = Problem::new(5.0, &[wall]).with(own.clone(), &start, &goal);
        solved::<DbAstar>(&problem);
        // It has no goal, no limits.
        let mut free = own.clone();
        free.control_limits.clear();
        let problem = Problem::new(5.0, &[]).with(free, &start, &goal);
        solved::<DbAstar>(&problem);
        // The heading at the goal does not matter.
        let mut open = goal.clone();
        if own.has_heading {
            open[2] = f64::NAN;
        }
        let problem = Problem::new(5.0, &[wall]).with(own.clone(), &start, &open);
        solved::<DbAstar>(&problem);
        // It starts inside of the wall.
        let inside = at_rest(&own, [1.0, 0.4, 0.0]);
        let problem = Problem::new(5.0, &[wall]).with(own.clone(), &inside, &goal);
        let (ended, said) = plan::<DbAstar>(&problem, "{}", 0, false);
        assert_eq!(ended.unwrap_err().status, Status::GaveUp);
        assert!(said.plans.is_empty());
        // It is told to stop at once.
        let problem = Problem::new(5.0, &[wall]).with(own.clone(), &start, &goal);
        let (ended, said) = plan::<DbAstar>(&problem, "{}", 0, true);
        assert_eq!(ended.unwrap_err().status, Status::TimedOut);
        assert!(said.plans.is_empty());
        // A team is for others.
        let team = problem.with(own.clone(), &at_rest(&own, [4.0, 1.5, 0.0]), &inside);
        let failure = plan::<DbAstar>(&team, "{}", 0, false).0.unwrap_err();
        assert_eq!(failure.status, Status::Unsupported);
        assert!(
            failure.message.contains("hint: db-cbs"),
            "{}",
            failure.message
        );
    }
}

#[test]
fn db_astar_stops_at_its_nodes_and_starts_in_motion() {
    let own = vehicle("fleetyard.unicycle-2/1", false);
    let goal = at_rest(&own, [4.0, 4.0, -2.0]);
    let moving = [1.0, 1.0, 0.3, 0.33, -0.21];
    let problem = Problem::new(5.0, &[]).with(own.clone(), &moving, &goal);
    solved::<DbAstar>(&problem);
    let wall: &[[f64; 2]] = &[[2.0, 0.0], [2.2, 0.0], [2.2, 4.0], [2.0, 4.0]];
    let problem = Problem::new(5.0, &[wall]).with(own, &moving, &goal);
    let (ended, said) = plan::<DbAstar>(&problem, "{}", 3, false);
    assert_eq!(ended.unwrap_err().status, Status::GaveUp);
    let nodes = said.figures.iter().find(|(name, _)| name == "nodes");
    assert!(nodes.is_some_and(|(_, nodes)| *nodes <= 3.0), "{nodes:?}");
}

#[test]
fn db_astar_is_as_quick_as_curves_where_nothing_is_in_the_way() {
    let own = vehicle("fleetyard.unicycle/1", false);
    let problem = Problem::new(20.0, &[]).with(own.clone(), &[10.0, 10.0, 0.0], &[11.0, 11.5, 2.0]);
    let cost = solved::<DbAstar>(&problem);
    let pose = |x, y, heading| Pose {
        at: Vector::new(x, y),
        heading,
    };
    let curves = Curves::new(&Robot::new(&own).unwrap()).unwrap();
    let least = curves.seconds(&pose(10.0, 10.0, 0.0), &pose(11.0, 11.5, 2.0));
    assert!((cost - least).abs() < 1e-6, "{cost} {least}");
}

/// The planner's plans for a problem that need not be solvable; the same twice.
fn tried<P: Plugin + Planner>(problem: &Problem, nodes: u64) -> Option<f64> {
    let (ended, said) = plan::<P>(problem, "{}", nodes, false);
    let cost = checked(problem, &said);
    assert_eq!(cost.is_some(), ended.is_ok(), "{ended:?}");
    assert_eq!(plan::<P>(problem, "{}", nodes, false).1.plans, said.plans);
    cost
}

/// Robots of these kinds on a ring, each with its goal on the other side.
fn ring(kinds: &[&str], bodies: u32, turn: f64) -> Problem {
    let count = kinds.len() as f64;
    let mut problem = Problem::new(6.0, &[]);
    for (number, kind) in kinds.iter().enumerate() {
        let own = vehicle(kind, bodies >> number & 1 == 1);
        let angle = turn + 2.0 * PI * number as f64 / count;
        let place =
            |angle: f64, heading| [3.0 + 2.2 * angle.cos(), 3.0 + 2.2 * angle.sin(), heading];
        let (start, goal) = (
            at_rest(&own, place(angle, angle + PI)),
            at_rest(&own, place(angle + PI + 0.1, angle + PI)),
        );
        problem = problem.with(own, &start, &goal);
    }
    problem
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 6, max_shrink_iters: 4, ..ProptestConfig::default() })]

    #[test]
    fn teams_of_all_kinds_change_sides(
        kinds in prop::collection::vec(0..DYNAMICS.len(), 2..5), bodies in any::<u32>(), turn in 0.0..1.0_f64, moves in any::<bool>(),
    ) {
        let kinds: Vec<&str> = kinds.into_iter().map(|kind| DYNAMICS[kind]).collect();
        let mut problem = ring(&kinds, bodies, turn);
        if moves {
            problem.environment.movers = vec![Mover {
                footprint: Footprint::disc(0.3),
                knots: vec![[3.0, 3.0, 8.0, 0.0], [12.0, 3.0, -2.0, 0.0]],
            }];
        }
        let costs = [tried::<DbCbs>(&problem, 60_000), tried::<DbLacam>(&problem, 4_000)];
        // An obstacle that drives over starts and goals may take more nodes, and so may four robots one of
        // the two.
        let solved = costs.iter().flatten().count();
        prop_assert!(moves || solved == 2 || kinds.len() == 4 && solved == 1, "{:?}", costs);
    }
}

/// Things that a planner of teams has to take.
fn awkward<P: Plugin + Planner>(nodes: u64) {
    for dynamics in DYNAMICS {
        let own = vehicle(dynamics, false);
        let at = |x, y, heading| at_rest(&own, [x, y, heading]);
        // Robots that touch at their starts part, and one is where it wants to be.
        let problem = Problem::new(5.0, &[])
            .with(own.clone(), &at(1.0, 1.0, 0.0), &at(3.0, 4.0, 1.0))
            .with(own.clone(), &at(1.0, 1.25, 0.0), &at(1.0, 3.0, 0.0))
            .with(own.clone(), &at(4.0, 1.0, 2.0), &at(4.0, 1.0, 2.0));
        assert!(tried::<P>(&problem, nodes).is_some(), "{dynamics}");
        // A goal behind a robot that stays.
        let walls: [&[[f64; 2]]; 2] = [
            &[[2.0, 0.0], [2.2, 0.0], [2.2, 1.9], [2.0, 1.9]],
            &[[2.0, 3.1], [2.2, 3.1], [2.2, 5.0], [2.0, 5.0]],
        ];
        let problem = Problem::new(5.0, &walls)
            .with(own.clone(), &at(2.6, 2.7, 0.0), &at(3.8, 2.7, 0.0))
            .with(own.clone(), &at(1.2, 2.5, 0.0), &at(3.5, 1.5, 0.5));
        assert!(tried::<P>(&problem, nodes).is_some(), "{dynamics}");
        // One robot, and none.
        let problem =
            Problem::new(5.0, &walls).with(own.clone(), &at(1.2, 2.5, 0.0), &at(3.5, 1.5, 0.5));
        assert!(tried::<P>(&problem, nodes).is_some(), "{dynamics}");
        let (ended, said) = plan::<P>(&problem, "{}", 0, true);
        assert_eq!(ended.unwrap_err().status, Status::TimedOut);
        assert!(said.plans.is_empty());
        // Both goals are the same place.
        let problem = Problem::new(5.0, &[])
            .with(own.clone(), &at(1.0, 1.0, 0.0), &at(3.0, 4.0, 1.0))
            .with(own.clone(), &at(4.0, 1.0, 0.0), &at(3.0, 4.0, 1.0));
        assert_eq!(tried::<P>(&problem, 200), None);
    }
}

#[test]
fn db_cbs_takes_what_is_awkward() {
    awkward::<DbCbs>(60_000);
}

#[test]
fn db_lacam_takes_what_is_awkward() {
    awkward::<DbLacam>(4_000);
}

/// Rectangles side by side in rows, each with its goal in another row.
#[test]
fn db_lacam_moves_a_crowd() {
    let mut problem = Problem::new(10.0, &[]);
    for number in 0..30_u32 {
        let own = vehicle("fleetyard.unicycle/1", number % 3 == 0);
        let place = |number: u32| {
            [
                1.0 + 1.6 * f64::from(number % 6),
                1.0 + 1.6 * f64::from(number / 6),
            ]
        };
        let (from, to) = (place(number), place(number * 7 % 30));
        let (start, goal) = ([from[0], from[1], 0.3], [to[0], to[1], -1.0]);
        problem = problem.with(own, &start, &goal);
    }
    let (ended, said) = plan::<DbLacam>(&problem, "{\"improve\": false}", 4_000, false);
    ended.unwrap();
    assert!(checked(&problem, &said).is_some());
}
