//! Trajectory optimisation: of guesses that are plans, and of guesses that are none.

use std::f64::consts::PI;
use std::path::Path;
use std::sync::Arc;

use fleetyard_abi::{Footprint, Mover};
use fleetyard_plugin_kinodynamic::course::{Course, Segment};
use fleetyard_plugin_kinodynamic::optimise::gap::Shape;
use fleetyard_plugin_kinodynamic::optimise::linear::{Step, axes};
use fleetyard_plugin_kinodynamic::optimise::{Figures, Guess, Options, optimise};
use fleetyard_plugin_kinodynamic::plugin::{CLEARANCE_M, Fault, Member, Team};
use fleetyard_plugin_kinodynamic::robot::{DYNAMICS, Robot, State};
use fleetyard_plugin_kinodynamic::steer::{brake, steer};
use fleetyard_plugin_plane::Vector;
use fleetyard_plugin_plane::plugin::robots::world;
use fleetyard_plugin_plane::sssp::bodies::{Body, Pose};
use proptest::prelude::*;

use super::tasks::{Problem, rectangle, robot};

/// The number of models: dynamics with a heading, integrators without one, and one whose rates and changes are bounded in length.
const MODELS: usize = DYNAMICS.len() + 3;

fn model(number: usize, is_disc: bool) -> fleetyard_abi::Robot {
    let footprint = if is_disc {
        Footprint::disc(0.2)
    } else {
        rectangle(0.5, 0.25)
    };
    let dynamics = DYNAMICS[if number == MODELS - 1 {
        DYNAMICS.len() - 1
    } else {
        number % DYNAMICS.len()
    }];
    let second = dynamics.contains("double") || dynamics.contains("-2");
    let axes = if dynamics.contains("unicycle")
        || (DYNAMICS.len()..DYNAMICS.len() + 2).contains(&number)
    {
        2
    } else {
        3
    };
    let (rates, changes) = ([0.5, 0.4, 0.6], [0.4, 0.5, 0.5]);
    let changes = if second { &changes[..axes] } else { &[] };
    let mut robot = robot(dynamics, footprint, &rates[..axes], changes);
    robot.polar_control = number == MODELS - 1 || dynamics.contains("single");
    robot.polar_state = number == MODELS - 1;
    robot
}

/// Calls with the team of a problem.
fn with_team<T>(problem: &Problem, call: impl FnOnce(&Team<'_>) -> T) -> T {
    let world = world(&Arc::new(problem.environment())).unwrap();
    let team = Team::new(&world, &problem.instance, CLEARANCE_M).unwrap();
    call(&team)
}

/// A robot that comes to rest, and goes from there to its goal as if it were alone.
fn straight(member: &Member) -> Course {
    let (robot, start) = (&member.robot, member.start);
    let mut course = Course {
        start,
        segments: brake(robot, &start).into_iter().collect(),
    };
    let rest = course.end(robot).pose();
    let free = member.goal.free.heading;
    let rest_of_it = steer(robot, &rest, &member.goal.state.pose(), free).unwrap();
    course.segments.extend(rest_of_it);
    course
}

/// A guess whose states are where they should not be.
fn shaken(guess: &Guess, by: f64, noise: &[f64]) -> Guess {
    let mut noise = noise.iter().cycle().map(|number| number * by);
    let mut next = || noise.next().unwrap();
    let mut guess = guess.clone();
    for state in &mut guess.states[1..] {
        state.at += Vector::new(next(), next());
        state.heading += next();
    }
    guess
}

fn seconds(courses: &[Course]) -> f64 {
    courses.iter().map(Course::seconds).sum()
}

fn improved(team: &Team<'_>, guess: &[Guess]) -> (Option<Vec<Course>>, Figures) {
    let (courses, figures) = optimise(team, guess, &Options::default(), &mut || false);
    if let Some(courses) = &courses {
        assert_eq!(team.fault(courses), None);
    }
    (courses, figures)
}

fn any_pose() -> impl Strategy<Value = [f64; 3]> {
    (1.0..5.0, 1.0..5.0, -PI..PI).prop_map(|(x, y, heading)| [x, y, heading])
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    #[test]
    fn plans_of_one_robot_become_no_longer(
        number in 0..MODELS, is_disc in any::<bool>(), start in any_pose(), goal in any_pose(),
        rates in prop::array::uniform3(-0.3..0.3_f64), tight in any::<bool>(),
    ) {
        let robot = model(number, is_disc);
        let pose = if robot.has_heading { 3 } else { 2 };
        let mut from = start[..pose].to_vec();
        from.extend(rates.iter().take(robot.state_limits.len() - pose));
        let problem = Problem::new(6.0, &[]).with(robot, &from, &goal[..pose]).within(if tight { 1e-6 } else { 0.05 });
        with_team(&problem, |team| {
            let course = straight(&team.members[0]);
            let guess = Guess::of(&course, &team.members[0].robot);
            let is_plan = team.fault(std::slice::from_ref(&course)).is_none();
            let (courses, _) = improved(team, &[guess]);
            if is_plan {
                let after = seconds(&courses.expect("the guess is a plan"));
                assert!(after <= course.seconds() + 1e-9, "{after} {}", course.seconds());
            }
        });
    }

    #[test]
    fn guesses_of_one_robot_that_are_no_plans_become_plans(
        number in 0..MODELS, is_disc in any::<bool>(), start in any_pose(), goal in any_pose(),
        noise in prop::collection::vec(-1.0..1.0_f64, 40), missed in prop::array::uniform3(-0.3..0.3_f64),
    ) {
        let robot = model(number, is_disc);
        let pose = if robot.has_heading { 3 } else { 2 };
        let problem = Problem::new(6.0, &[]).with(robot, &start[..pose], &goal[..pose]);
        with_team(&problem, |team| {
            let mut aside = team.members[0].clone();
            aside.goal.state.at += Vector::new(missed[0], missed[1]);
            if aside.robot.has_heading {
                aside.goal.state.heading += missed[2];
            }
            let course = straight(&aside);
            let guess = shaken(&Guess::of(&course, &aside.robot), 0.05, &noise);
            let (courses, _) = improved(team, &[guess]);
            assert!(courses.is_some(), "{:?}", team.members[0]);
        });
    }

    /// Beside differences.
    #[test]
    fn derivatives_of_steps_are_theirs(
        number in 0..MODELS, start in any_pose(), rates in prop::array::uniform3(-0.5..0.5_f64),
        control in prop::array::uniform3(-0.5..0.5_f64), seconds in 0.05..1.0_f64,
    ) {
        let robot = Robot::new(&model(number, false)).unwrap();
        match (robot.is_second, axes(&robot).len()) {
            (false, 2) => derivatives::<4, 3>(&robot, start, rates, control, seconds),
            (false, _) => derivatives::<4, 4>(&robot, start, rates, control, seconds),
            (true, 2) => derivatives::<6, 3>(&robot, start, rates, control, seconds),
            (true, _) => derivatives::<7, 4>(&robot, start, rates, control, seconds),
        }
    }

    /// Beside differences, and the same from both sides.
    #[test]
    fn gaps_grow_as_they_say(
        at in (-1.0..1.0_f64, -1.0..1.0_f64, -PI..PI), other in (-1.0..1.0_f64, -1.0..1.0_f64, -PI..PI), discs in any::<[bool; 2]>(),
    ) {
        let long = Body { radius: 0.6, corners: [[0.55, 0.2], [-0.55, 0.2], [-0.55, -0.2], [0.55, -0.2]].map(|[x, y]| Vector::new(x, y)).to_vec() };
        let disc = Body { radius: 0.3, corners: Vec::new() };
        let shapes = discs.map(|is_disc| Shape::new(if is_disc { &disc } else { &long }));
        let pose = |(x, y, heading): (f64, f64, f64)| Pose { at: Vector::new(x, y), heading };
        let (own, others) = (pose(at), pose(other));
        let gap = |own: &Pose| {
            let mut placed = shapes.clone();
            shapes[0].place(own, &mut placed[0]);
            shapes[1].place(&others, &mut placed[1]);
            let [one, two] = &placed;
            let back = two.gap(one);
            let gap = one.gap(two);
            assert!((gap.distance - back.distance).abs() < 1e-9);
            gap
        };
        let here = gap(&own);
        let growth = here.growth(own.at);
        let step = 1e-6;
        let moved = [
            Pose { at: own.at + Vector::new(step, 0.0), ..own },
            Pose { at: own.at + Vector::new(0.0, step), ..own },
            Pose { heading: own.heading + step, ..own },
        ];
        // Where two pairs of places are equally near there is no derivative: it is one of two.
        let ahead = moved.map(|pose| (gap(&pose).distance - here.distance) / step);
        let same = ahead.iter().zip(growth).filter(|(ahead, growth)| (*ahead - growth).abs() < 1e-3).count();
        prop_assert!(same == 3 || ahead.iter().zip(growth).all(|(ahead, growth)| ahead - growth < 2.0), "{ahead:?} {growth:?}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(10))]

    /// Robots of several models that set out all at once among boxes, some of them from where they touch something.
    #[test]
    fn what_is_made_of_any_motions_of_a_team_is_a_plan(
        numbers in prop::collection::vec((0..MODELS, any::<bool>(), any_pose(), any_pose()), 1..5),
        boxes in prop::collection::vec((0.5..5.0, 0.5..5.0, 0.1..0.8, 0.1..0.8), 0..4), moves in any::<bool>(),
    ) {
        let boxes: Vec<[[f64; 2]; 4]> = boxes.into_iter().map(|(x, y, wide, high)| [[x, y], [x + wide, y], [x + wide, y + high], [x, y + high]]).collect();
        let obstacles: Vec<&[[f64; 2]]> = boxes.iter().map(<[_; 4]>::as_slice).collect();
        let mut problem = Problem::new(6.0, &obstacles).within(0.02);
        if moves {
            problem.environment.movers = vec![Mover {
                footprint: Footprint::disc(0.3),
                knots: vec![[0.0, 0.5, 3.0, 0.0], [10.0, 5.5, 3.0, 0.0]],
            }];
        }
        for (number, is_disc, start, goal) in numbers {
            let robot = model(number, is_disc);
            let pose = if robot.has_heading { 3 } else { 2 };
            problem = problem.with(robot, &start[..pose], &goal[..pose]);
        }
        with_team(&problem, |team| {
            let courses: Vec<Course> = team.members.iter().map(straight).collect();
            let is_plan = team.fault(&courses).is_none();
            let guess: Vec<Guess> = courses.iter().zip(&team.members).map(|(course, member)| Guess::of(course, &member.robot)).collect();
            let options = Options { rounds: 4, ..Options::default() };
            let (found, _) = optimise(team, &guess, &options, &mut || false);
            if let Some(found) = &found {
                assert_eq!(team.fault(found), None);
            }
            if is_plan {
                assert!(seconds(&found.unwrap()) <= seconds(&courses) + 1e-9);
            }
        });
    }
}

fn derivatives<const N: usize, const M: usize>(
    robot: &Robot,
    [x, y, heading]: [f64; 3],
    rates: [f64; 3],
    control: [f64; 3],
    seconds: f64,
) {
    let axes = axes(robot);
    let there = |numbers: [f64; 3]| {
        let mut kept = [0.0; 3];
        for axis in &axes {
            kept[*axis] = numbers[*axis];
        }
        kept
    };
    let state = State {
        at: Vector::new(x, y),
        heading: if robot.has_heading { heading } else { 0.0 },
        rates: if robot.is_second {
            there(rates)
        } else {
            [0.0; 3]
        },
        behind: 0.0,
    };
    let control = there(control);
    let step: Step<N, M> = Step::new(robot, &axes, &state, &control, seconds);
    let numbers = |state: &State| {
        let mut all = [0.0; N];
        (all[0], all[1], all[2]) = (state.at.x, state.at.y, state.heading);
        if robot.is_second {
            for (number, axis) in axes.iter().enumerate() {
                all[4 + number] = state.rates[*axis];
            }
        }
        all
    };
    let end = numbers(&robot.after(&state, &control, seconds));
    let small = 1e-6;
    let check = |what: &str, later: &State, by: &dyn Fn(usize) -> f64| {
        for (number, later) in numbers(later).iter().enumerate() {
            let ahead = (later - end[number]) / small;
            let told = by(number);
            assert!(
                number == 3 || (ahead - told).abs() < 1e-4,
                "{what} {number}: {ahead} {told}"
            );
        }
    };
    for number in (0..N).filter(|number| *number != 3) {
        let mut moved = state;
        match number {
            0 => moved.at.x += small,
            1 => moved.at.y += small,
            2 if robot.has_heading => moved.heading += small,
            2 => continue,
            _ => moved.rates[axes[number - 4]] += small,
        }
        let later = robot.after(&moved, &control, seconds);
        check("state", &later, &|row| step.by_state[row][number]);
    }
    for (number, axis) in axes.iter().enumerate() {
        let mut moved = control;
        moved[*axis] += small;
        let later = robot.after(&state, &moved, seconds);
        check("control", &later, &|row| step.by_control[row][number]);
    }
    let later = robot.after(&state, &control, seconds + small);
    check("time", &later, &|row| step.by_control[row][M - 1]);
}

fn unicycle() -> fleetyard_abi::Robot {
    model(2, false)
}

#[test]
fn robots_that_overlap_a_little_are_pushed_apart() {
    let problem = Problem::new(6.0, &[])
        .with(unicycle(), &[1.0, 3.0, 0.0], &[5.0, 3.0, 0.0])
        .with(model(4, true), &[3.0, 1.25, 0.0], &[3.0, 4.6, 0.0]);
    with_team(&problem, |team| {
        let courses: Vec<Course> = team.members.iter().map(straight).collect();
        assert!(matches!(team.fault(&courses), Some(Fault::Pair([0, 1], _))));
        let guess: Vec<Guess> = courses
            .iter()
            .zip(&team.members)
            .map(|(course, member)| Guess::of(course, &member.robot))
            .collect();
        let (found, figures) = improved(team, &guess);
        let found = found.expect("courses");
        // Little time is lost, and the same guess gives the same courses.
        assert!(seconds(&found) < seconds(&courses) + 1.0);
        assert!(figures.programs > 0 && figures.iterations > figures.programs);
        assert_eq!(improved(team, &guess), (Some(found), figures));
    });
}

#[test]
fn a_robot_that_waits_for_another_one_waits_no_longer_than_it_has_to() {
    let problem = Problem::new(6.0, &[])
        .with(unicycle(), &[1.0, 3.0, 0.0], &[5.0, 3.0, 0.0])
        .with(unicycle(), &[3.0, 1.0, PI / 2.0], &[3.0, 5.0, PI / 2.0]);
    with_team(&problem, |team| {
        let mut courses: Vec<Course> = team.members.iter().map(straight).collect();
        let rest = Segment {
            control: [0.0; 3],
            seconds: 8.0,
        };
        courses[1].segments.insert(0, rest);
        assert_eq!(team.fault(&courses), None);
        let guess: Vec<Guess> = courses
            .iter()
            .zip(&team.members)
            .map(|(course, member)| Guess::of(course, &member.robot))
            .collect();
        let (found, _) = improved(team, &guess);
        let after = seconds(&found.expect("the guess is a plan"));
        // Alone they need 16 s.
        assert!((16.0..17.5).contains(&after), "{after}");
    });
}

#[test]
fn movers_are_waited_for_and_driven_round() {
    let mut problem = Problem::new(6.0, &[&[[2.4, 0.0], [3.6, 0.0], [3.6, 2.4], [2.4, 2.4]]]).with(
        unicycle(),
        &[1.0, 3.0, 0.0],
        &[5.0, 3.0, 0.0],
    );
    problem.environment.movers = vec![Mover {
        footprint: Footprint::disc(0.3),
        knots: vec![
            [0.0, 3.0, 4.0, 0.0],
            [2.0, 3.0, 2.8, 0.0],
            [8.0, 3.0, 4.6, 0.0],
        ],
    }];
    with_team(&problem, |team| {
        let guess = Guess::of(&straight(&team.members[0]), &team.members[0].robot);
        assert_eq!(team.fault(&[guess.course()]), Some(Fault::Mover(0)));
        let (found, _) = improved(team, &[guess]);
        let after = seconds(&found.expect("a way"));
        assert!((8.0..14.0).contains(&after), "{after}");
    });
}

#[test]
fn a_corner_in_the_way_is_driven_round() {
    // Of the second one, which is not convex, only the tip is in the way.
    let convex: &[[f64; 2]] = &[[2.5, 0.5], [3.5, 0.5], [3.5, 2.95], [2.5, 2.95]];
    let bent: &[[f64; 2]] = &[
        [2.0, 0.5],
        [4.0, 0.5],
        [3.2, 1.0],
        [3.1, 2.95],
        [2.9, 2.95],
        [2.8, 1.0],
    ];
    for obstacle in [convex, bent] {
        for number in 0..MODELS {
            let robot = model(number, false);
            let pose = if robot.has_heading { 3 } else { 2 };
            let problem = Problem::new(6.0, &[obstacle]).with(
                robot,
                &[1.0, 3.0, 0.0][..pose],
                &[5.0, 3.0, 0.0][..pose],
            );
            with_team(&problem, |team| {
                let guess = Guess::of(&straight(&team.members[0]), &team.members[0].robot);
                assert_eq!(team.fault(&[guess.course()]), Some(Fault::Wall(0)));
                let (found, _) = improved(team, &[guess]);
                assert!(found.is_some(), "{:?} {obstacle:?}", team.members[0].robot);
            });
        }
    }
}

/// The door has a centimetre to each side.
#[test]
fn a_way_through_a_narrow_door_becomes_shorter() {
    let below: &[[f64; 2]] = &[[2.9, 0.0], [3.1, 0.0], [3.1, 2.865], [2.9, 2.865]];
    let above: &[[f64; 2]] = &[[2.9, 3.135], [3.1, 3.135], [3.1, 6.0], [2.9, 6.0]];
    for number in [2, 3, 4, 5, 8] {
        let robot = model(number, false);
        let problem =
            Problem::new(6.0, &[below, above]).with(robot, &[1.0, 2.6, 0.4], &[5.0, 3.3, 0.5]);
        with_team(&problem, |team| {
            let robot = &team.members[0].robot;
            let pose = |x: f64, y: f64, heading: f64| Pose {
                at: Vector::new(x, y),
                heading,
            };
            let poses = [
                pose(1.0, 2.6, 0.4),
                pose(2.2, 3.0, 0.0),
                pose(3.8, 3.0, 0.0),
                pose(5.0, 3.3, 0.5),
            ];
            let segments = poses
                .windows(2)
                .flat_map(|pair| steer(robot, &pair[0], &pair[1], false).unwrap());
            let course = Course {
                start: team.members[0].start,
                segments: segments.collect(),
            };
            assert_eq!(team.fault(std::slice::from_ref(&course)), None);
            let (found, _) = improved(team, &[Guess::of(&course, robot)]);
            let after = seconds(&found.expect("the guess is a plan"));
            assert!(
                after < 0.95 * course.seconds(),
                "{number}: {after} {}",
                course.seconds()
            );
        });
    }
}

#[test]
fn a_team_that_is_told_to_stop_keeps_what_it_has() {
    let problem = Problem::new(6.0, &[]).with(unicycle(), &[1.0, 3.0, 0.5], &[5.0, 3.0, -0.5]);
    with_team(&problem, |team| {
        let course = straight(&team.members[0]);
        let guess = Guess::of(&course, &team.members[0].robot);
        let stopped = |guess: &[Guess]| optimise(team, guess, &Options::default(), &mut || true).0;
        assert_eq!(stopped(std::slice::from_ref(&guess)), Some(vec![course]));
        let mut short = guess.clone();
        short.segments.pop();
        short.states.pop();
        assert_eq!(stopped(&[short]), None);
        let mut asked = 0;
        let mut few = || {
            asked += 1;
            asked > 5
        };
        let (found, _) = optimise(team, &[guess], &Options::default(), &mut few);
        assert_eq!(team.fault(&found.expect("a plan")), None);
    });
}

#[test]
fn guesses_that_are_none_are_refused() {
    let problem = Problem::new(6.0, &[]).with(unicycle(), &[1.0, 3.0, 0.5], &[5.0, 3.0, -0.5]);
    with_team(&problem, |team| {
        let guess = Guess::of(&straight(&team.members[0]), &team.members[0].robot);
        let mut short = guess.clone();
        short.states.pop();
        let mut far = guess.clone();
        far.states[1].at.x = f64::NAN;
        let mut back = guess.clone();
        back.segments[0].seconds = -1.0;
        let mut elsewhere = guess.clone();
        elsewhere.states[0].at.x += 0.1;
        for guess in [
            vec![],
            vec![short],
            vec![far],
            vec![back],
            vec![elsewhere],
            vec![guess.clone(), guess],
        ] {
            assert_eq!(improved(team, &guess), (None, Figures::default()));
        }
    });
}

#[test]
fn robots_that_are_there_stay_and_others_find_their_way_from_nothing() {
    let problem = Problem::new(6.0, &[])
        .with(unicycle(), &[1.0, 3.0, 0.5], &[1.0, 3.0, 0.5])
        .with(unicycle(), &[2.0, 3.0, 0.0], &[3.0, 3.5, 0.5]);
    with_team(&problem, |team| {
        let stay: Vec<Guess> = team
            .members
            .iter()
            .map(|member| Guess::of(&Course::stay(member.start), &member.robot))
            .collect();
        let (found, _) = improved(team, &stay);
        let found = found.expect("courses");
        assert!(found[0].seconds() < 1e-6 && found[1].seconds() > 1.0);
    });
}

/// Two that meet head-on, and four that meet in the middle.
#[test]
fn robots_that_stand_in_each_others_way_get_past() {
    let places = [[1.0, 3.0], [5.0, 3.0], [3.0, 1.0], [3.0, 5.0]];
    for count in [2, 4] {
        for number in 0..MODELS {
            let mut problem = Problem::new(6.0, &[]).within(0.01);
            for agent in 0..count {
                let robot = model(number, agent % 2 == 0);
                problem = problem.with(robot, &places[agent], &places[agent ^ 1]);
            }
            with_team(&problem, |team| {
                let guess: Vec<Guess> = team
                    .members
                    .iter()
                    .map(|member| Guess::of(&straight(member), &member.robot))
                    .collect();
                let (found, _) = improved(team, &guess);
                assert!(found.is_some(), "{count} {number}");
            });
        }
    }
}

/// Rectangles that set out all at once, straight to their goals, through obstacles and each other.
#[test]
fn unicycles_of_the_data_find_plans_from_straight_motions() {
    let Some(data) = std::env::var_os("FLEETYARD_DATA") else {
        return;
    };
    let folder = Path::new(&data).join("continuous/plane-tasks");
    for (name, most) in [
        ("random-2-1", 11.0),
        ("swap-2-1", 15.5),
        ("swap-4-1", 32.0),
        ("swap-8-1", 79.0),
    ] {
        let file = folder.join(format!("unicycle-{name}.tasks.json"));
        if !file.exists() {
            continue;
        }
        let problem = Problem::read(&file, 8).unwrap().within(0.1);
        with_team(&problem, |team| {
            let guess: Vec<Guess> = team
                .members
                .iter()
                .map(|member| Guess::of(&straight(member), &member.robot))
                .collect();
            let (found, _) = improved(team, &guess);
            let after = seconds(&found.unwrap_or_else(|| panic!("{name}")));
            assert!(after < most, "{name} {after}");
        });
    }
}
