//! Discs and convex polygons in motion, and plans for teams of them, held against poses at many times.

use std::f64::consts::{PI, TAU};
use std::sync::atomic::Ordering;

use fleetyard_abi::sdk::{Failure, Options, Planner, Plugin};
use fleetyard_abi::{
    Budget, Environment, Footprint, Instance, Knot, Mover, Plan, Robot, State, Status,
    WorkspaceEnvironment, monotonic_ns,
};
use fleetyard_plugin_plane::Vector;
use fleetyard_plugin_plane::bins::Rectangle;
use fleetyard_plugin_plane::plugin::sssp::Sssp;
use fleetyard_plugin_plane::sssp::bodies::{Body, Leg, Pose, Space, delays, hits, near};

use fleetyard_testkit::Notes;
use proptest::prelude::*;

/// Corners of a body in a pose; a disc as a polygon inside of it.
fn corners(body: &Body, pose: &Pose) -> Vec<Vector> {
    let round = (0..64).map(|corner| {
        let angle = f64::from(corner) * TAU / 64.0;
        Vector::new(angle.cos(), angle.sin()) * body.radius
    });
    let own: Vec<Vector> = if body.is_disc() {
        round.collect()
    } else {
        body.corners.clone()
    };
    let (sin, cos) = pose.heading.sin_cos();
    own.iter()
        .map(|at| pose.at + Vector::new(at.x * cos - at.y * sin, at.x * sin + at.y * cos))
        .collect()
}

/// The depth to which two convex polygons overlap; below zero where a line is between them.
fn depth(a: &[Vector], b: &[Vector]) -> f64 {
    let least = |a: &[Vector], b: &[Vector]| {
        let edges = (0..a.len()).map(|at| (a[at], a[(at + 1) % a.len()]));
        edges
            .map(|(from, to)| {
                let normal = Vector::new((to - from).y, -(to - from).x).normalize();
                let far = b.iter().map(|corner| normal.dot(&(from - corner)));
                far.fold(f64::NEG_INFINITY, f64::max)
            })
            .fold(f64::INFINITY, f64::min)
    };
    least(a, b).min(least(b, a))
}

fn at(leg: &Leg, seconds: f64) -> Pose {
    let part = if leg.duration.is_finite() {
        (seconds / leg.duration).clamp(0.0, 1.0)
    } else {
        0.0
    };
    Pose {
        at: leg.from.at + (leg.to.at - leg.from.at) * part,
        heading: leg.from.heading + (leg.to.heading - leg.from.heading) * part,
    }
}

fn body() -> impl Strategy<Value = Body> {
    let polygon = (0.15..0.6_f64, 0.1..0.5_f64, any::<bool>()).prop_map(|(length, width, full)| {
        let all = [
            [-length, -width],
            [length, -width],
            [length, width],
            [-length, width],
        ];
        let corners: Vec<Vector> = all[..if full { 4 } else { 3 }]
            .iter()
            .map(|[x, y]| Vector::new(*x, *y))
            .collect();
        Body {
            radius: length.hypot(width),
            corners,
        }
    });
    let disc = (0.1..0.5_f64).prop_map(|radius| Body {
        radius,
        corners: Vec::new(),
    });
    prop_oneof![3 => polygon, 1 => disc]
}

fn leg() -> impl Strategy<Value = Leg> {
    let number = || -2.0..2.0_f64;
    let rest = prop_oneof![4 => Just(false), 1 => Just(true)];
    (
        [number(), number(), number(), number()],
        [-PI..PI, -PI..PI],
        0.5..3.0_f64,
        rest,
    )
        .prop_map(|(places, [from, turn], duration, rests)| {
            let [x, y, to_x, to_y] = places;
            let from = Pose {
                at: Vector::new(x, y),
                heading: from,
            };
            let to = Pose {
                at: Vector::new(to_x, to_y),
                heading: from.heading + turn,
            };
            Leg {
                from,
                to: if rests { from } else { to },
                duration,
            }
        })
}

/// Headings of discs are of no account, and planners leave them out.
fn flat(body: &Body, mut leg: Leg) -> Leg {
    if body.is_disc() {
        (leg.from.heading, leg.to.heading) = (0.0, 0.0);
    }
    leg
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn motions_that_touch_are_known(
        (body, other) in (body(), body()),
        (leg, other_leg) in (leg(), leg()),
        shifts in proptest::collection::vec(0.0..1.0_f64, 12),
    ) {
        let (leg, other_leg) = (flat(&body, leg), flat(&other, other_leg));
        // One moves while the other rests.
        let still = other_leg.from;
        let placed = corners(&other, &still);
        let samples = (0..=400).map(|sample| leg.duration * f64::from(sample) / 400.0);
        let depths: Vec<(f64, f64)> = samples
            .map(|seconds| (seconds, depth(&corners(&body, &at(&leg, seconds)), &placed)))
            .collect();
        let deepest = depths.iter().map(|(_, depth)| *depth).fold(f64::NEG_INFINITY, f64::max);
        let touches = hits(&body, &leg, &other, &still);
        prop_assert!(touches || deepest < 1e-6, "{deepest} m deep");
        // Nor are motions refused that leave room; a disc is a little larger than its corners.
        prop_assert!(!touches || deepest > -0.03, "apart by {} m", -deepest);
        let span = near(&body, &leg, &other, &still);
        prop_assert!(span.is_some() || !touches);
        for (seconds, depth) in &depths {
            let inside = span.is_some_and(|span| span.low <= seconds + 1e-9 && seconds - 1e-9 <= span.high);
            prop_assert!(inside || *depth < 1e-6, "{depth} m at {seconds} s, {span:?}");
        }
        // Both move.
        let span = delays(&body, &leg, &other, &other_leg);
        for shift in shifts {
            let later = -other_leg.duration + shift * (leg.duration + other_leg.duration);
            if span.is_some_and(|span| span.low < later && later < span.high) {
                continue;
            }
            let (begin, end) = (later.max(0.0), leg.duration.min(later + other_leg.duration));
            for sample in 0..=100 {
                let seconds = begin + (end - begin) * f64::from(sample) / 100.0;
                let poses = (at(&leg, seconds), at(&other_leg, seconds - later));
                let deep = depth(&corners(&body, &poses.0), &corners(&other, &poses.1));
                prop_assert!(deep < 1e-6, "{deep} m at {seconds} s after {later} s, {span:?}");
            }
        }
    }

    #[test]
    fn bodies_keep_clear_of_obstacles(body in body(), leg in leg()) {
        let block = [[-0.2, -0.7], [0.6, 0.3], [0.1, 0.8]].map(|[x, y]| Vector::new(x, y)).to_vec();
        let bounds = Rectangle { min: Vector::repeat(-2.5), max: Vector::repeat(2.5) };
        let leg = flat(&body, leg);
        let space = Space::new(body.clone(), std::slice::from_ref(&block), bounds, &[]);
        if !space.is_free(&leg.from) {
            let placed = corners(&body, &leg.from);
            let outside = placed.iter().map(|at| 2.5 - at.abs().max()).fold(f64::INFINITY, f64::min);
            prop_assert!(depth(&placed, &block) > -0.03 || outside < 0.03);
            return Ok(());
        }
        let clear = space.is_clear(&leg);
        let mut deepest = f64::NEG_INFINITY;
        for sample in 0..=400 {
            let placed = corners(&body, &at(&leg, leg.duration * f64::from(sample) / 400.0));
            let outside = placed.iter().map(|at| at.abs().max() - 2.5).fold(f64::NEG_INFINITY, f64::max);
            deepest = deepest.max(depth(&placed, &block)).max(outside);
        }
        prop_assert!(!clear || deepest < 1e-6, "{deepest} m deep");
        prop_assert!(clear || deepest > -0.03, "apart by {} m", -deepest);
    }
}

const SIDE: f64 = 8.0;

fn room(obstacles: &[Vec<[f64; 2]>]) -> WorkspaceEnvironment {
    WorkspaceEnvironment {
        min_m: [0.0, 0.0],
        max_m: [SIDE, SIDE],
        obstacles: obstacles.iter().cloned().collect(),
        movers: Vec::new(),
    }
}

/// A wall with a door, and a block.
fn walls() -> Vec<Vec<[f64; 2]>> {
    let block = |left: f64, bottom: f64, right: f64, top: f64| {
        vec![[left, bottom], [right, bottom], [right, top], [left, top]]
    };
    vec![
        block(3.9, 0.0, 4.1, 3.0),
        block(3.9, 5.0, 4.1, SIDE),
        block(1.5, 1.0, 2.5, 2.0),
    ]
}

fn robot(body: &Body) -> Robot {
    let has_heading = !body.is_disc();
    let speed = [Some(-1.0), Some(1.0)];
    let numbers = if has_heading { 3 } else { 2 };
    Robot {
        name: String::new(),
        footprint: Footprint {
            radius_m: body.radius,
            corners_m: body.corners.iter().map(|at| [at.x, at.y]).collect(),
        },
        dynamics: "fleetyard.single-integrator/1".into(),
        has_heading,
        polar_state: false,
        polar_control: true,
        state_limits: vec![[None, None]; numbers],
        control_limits: vec![speed; numbers],
        parameters: Vec::new(),
    }
}

fn state(body: &Body, pose: &Pose) -> State {
    let place = [pose.at.x, pose.at.y];
    State(if body.is_disc() {
        place.to_vec()
    } else {
        [place[0], place[1], pose.heading].to_vec()
    })
}

/// Bodies with a start and a goal.
fn instance(team: &[(Body, Pose, Pose)]) -> Instance {
    Instance {
        robots: team.iter().map(|(body, ..)| robot(body)).collect(),
        robot_of: (0..team.len() as u32).collect(),
        start_states: team.iter().map(|(body, at, _)| state(body, at)).collect(),
        goal_states: team
            .iter()
            .map(|(body, _, at)| vec![state(body, at)])
            .collect(),
        motion: fleetyard_abi::Motion::Dynamics,
        radius_m: team
            .iter()
            .map(|(body, ..)| body.radius)
            .fold(0.0, f64::max),
        ..Instance::default()
    }
}

fn budget(nodes: u64) -> Budget {
    Budget {
        nodes,
        seed: 3,
        ..Budget::lasting(monotonic_ns(), 60_000_000_000)
    }
}

/// Asks for plans, and gives the knots of each, in the order in which they came.
fn ask(
    world: WorkspaceEnvironment,
    instance: &Instance,
    (options, nodes): (&str, u64),
    notes: &Notes,
) -> (Result<(), Failure>, Vec<Vec<Vec<Knot>>>) {
    let environment = Environment::from(world).into();
    let mut planner = Sssp::create(Options::new(options)).unwrap();
    let mut map = planner
        .prepare(&environment, &budget(nodes), notes)
        .unwrap();
    let said = planner.plan(&mut map, instance, &budget(nodes), notes);
    let plans = std::mem::take(&mut *notes.others.lock().unwrap());
    let knots = |plan: Plan| match plan {
        Plan::Trajectories(plan) => plan.knots().iter().map(<[Knot]>::to_vec).collect(),
        other => panic!("{other:?}"),
    };
    (said, plans.into_iter().map(knots).collect())
}

fn position(knots: &[Knot], seconds: f64) -> Pose {
    let pose = |knot: &Knot| Pose {
        at: Vector::new(knot.x_m, knot.y_m),
        heading: if knot.heading_rad.is_nan() {
            0.0
        } else {
            knot.heading_rad
        },
    };
    let next = knots.partition_point(|knot| knot.time_s <= seconds);
    if next == 0 || next == knots.len() {
        return pose(&knots[next.saturating_sub(1)]);
    }
    let (from, to) = (&knots[next - 1], &knots[next]);
    let leg = Leg {
        from: pose(from),
        to: pose(to),
        duration: to.time_s - from.time_s,
    };
    at(&leg, seconds - from.time_s)
}

/// The sum of arrivals.
fn cost(plan: &[Vec<Knot>]) -> f64 {
    plan.iter().map(|knots| knots[knots.len() - 1].time_s).sum()
}

/// Fails where bodies overlap, leave the room, are too fast, or begin or end elsewhere.
fn judge(
    team: &[(Body, Pose, Pose)],
    obstacles: &[Vec<[f64; 2]>],
    plan: &[Vec<Knot>],
) -> Result<(), TestCaseError> {
    prop_assert_eq!(plan.len(), team.len());
    let last = plan.iter().map(|knots| knots[knots.len() - 1].time_s);
    let last = last.fold(0.0, f64::max);
    for ((body, start, goal), knots) in team.iter().zip(plan) {
        let (from, to) = (position(knots, 0.0), position(knots, last));
        prop_assert!((from.at - start.at).norm() < 1e-9 && (to.at - goal.at).norm() < 1e-9);
        if !body.is_disc() {
            let turned = (to.heading - goal.heading) / TAU;
            prop_assert!((turned - turned.round()).abs() < 1e-9 && from.heading == start.heading);
        }
        for pair in knots.windows(2) {
            let seconds = pair[1].time_s - pair[0].time_s;
            let (x, y) = (pair[1].x_m - pair[0].x_m, pair[1].y_m - pair[0].y_m);
            prop_assert!(
                seconds > 0.0 && x.hypot(y) <= seconds * (1.0 + 1e-7),
                "{pair:?}"
            );
            let turn = (pair[1].heading_rad - pair[0].heading_rad).abs();
            prop_assert!(body.is_disc() || turn <= seconds * (1.0 + 1e-7));
        }
    }
    let blocks: Vec<Vec<Vector>> = obstacles
        .iter()
        .map(|block| block.iter().map(|[x, y]| Vector::new(*x, *y)).collect())
        .collect();
    let samples = (last / 0.02).ceil().max(1.0) as u32;
    for sample in 0..=samples {
        let seconds = last * f64::from(sample) / f64::from(samples);
        let placed = team.iter().zip(plan);
        let placed: Vec<Vec<Vector>> = placed
            .map(|((body, ..), knots)| corners(body, &position(knots, seconds)))
            .collect();
        for (number, one) in placed.iter().enumerate() {
            for at in one {
                let inside = at.min() > -1e-6 && at.max() < SIDE + 1e-6;
                prop_assert!(inside, "robot {number} at {seconds} s");
            }
            for other in placed[..number].iter().chain(&blocks) {
                let deep = depth(one, other);
                prop_assert!(deep < 1e-6, "robot {number}: {deep} m at {seconds} s");
            }
        }
    }
    Ok(())
}

/// Bodies at poses where they touch nothing.
fn team() -> impl Strategy<Value = Vec<(Body, Pose, Pose)>> {
    let pose = || {
        (0.5..SIDE - 0.5, 0.5..SIDE - 0.5, -PI..PI).prop_map(|(x, y, heading)| Pose {
            at: Vector::new(x, y),
            heading,
        })
    };
    proptest::collection::vec((body(), pose(), pose()), 1..9).prop_map(|wanted| {
        let blocks: Vec<Vec<Vector>> = walls()
            .iter()
            .map(|block| block.iter().map(|[x, y]| Vector::new(*x, *y)).collect())
            .collect();
        let mut team: Vec<(Body, Pose, Pose)> = Vec::new();
        for (body, start, goal) in wanted {
            let free = |pose: &Pose, of: &dyn Fn(&(Body, Pose, Pose)) -> Pose| {
                let own = corners(&body, pose);
                let others = team.iter().map(|other| corners(&other.0, &of(other)));
                own.iter()
                    .all(|at| at.min() > 0.01 && at.max() < SIDE - 0.01)
                    && others
                        .chain(blocks.iter().cloned())
                        .all(|other| depth(&own, &other) < -0.02)
            };
            if free(&start, &|other| other.1) && free(&goal, &|other| other.2) {
                team.push((body, start, goal));
            }
        }
        team
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(20))]

    /// Every plan is valid and better than the one before, and the same again.
    #[test]
    fn teams_keep_clear_of_each_other_and_of_walls(team in team(), pushes: bool) {
        let instance = instance(&team);
        let options = format!("{{\"pushes\": {pushes}}}");
        let run = || ask(room(&walls()), &instance, (&options, 500), &Notes::default());
        let (said, plans) = run();
        // Headings of discs are no numbers, and equal nothing.
        prop_assert_eq!(format!("{plans:?}"), format!("{:?}", run().1));
        match said {
            Ok(()) => prop_assert!(!plans.is_empty()),
            Err(failure) => prop_assert_eq!(failure.status, Status::GaveUp, "{:?}", failure),
        }
        for plan in &plans {
            judge(&team, &walls(), plan)?;
        }
        let costs: Vec<f64> = plans.iter().map(|plan| cost(plan)).collect();
        prop_assert!(costs.is_sorted_by(|a, b| b <= a), "{costs:?}");
    }
}

fn disc(radius: f64, from: [f64; 2], to: [f64; 2]) -> (Body, Pose, Pose) {
    let pose = |[x, y]: [f64; 2]| Pose {
        at: Vector::new(x, y),
        heading: 0.0,
    };
    let body = Body {
        radius,
        corners: Vec::new(),
    };
    (body, pose(from), pose(to))
}

/// Two discs change places in an aisle where they do not pass each other, but for a bay.
#[test]
fn who_is_in_the_way_goes_into_a_bay() {
    let aisle = vec![
        vec![[0.0, 0.0], [SIDE, 0.0], [SIDE, 3.5], [0.0, 3.5]],
        vec![[0.0, 4.5], [3.0, 4.5], [3.0, SIDE], [0.0, SIDE]],
        vec![[4.5, 4.5], [SIDE, 4.5], [SIDE, SIDE], [4.5, SIDE]],
    ];
    let team = [
        disc(0.4, [1.0, 4.0], [7.0, 4.0]),
        disc(0.4, [7.0, 4.0], [1.0, 4.0]),
    ];
    for options in ["{}", "{\"pushes\": false}"] {
        let (said, plans) = ask(
            room(&aisle),
            &instance(&team),
            (options, 30_000),
            &Notes::default(),
        );
        assert_eq!(said, Ok(()));
        judge(&team, &aisle, &plans[plans.len() - 1]).unwrap();
    }
}

/// Two rows of discs that touch their neighbours change sides.
#[test]
fn discs_that_touch_set_out() {
    let team: Vec<(Body, Pose, Pose)> = (0..10)
        .flat_map(|row| {
            let y = 0.5 + 0.6 * f64::from(row);
            [disc(0.3, [0.5, y], [7.5, y]), disc(0.3, [7.5, y], [0.5, y])]
        })
        .collect();
    let notes = Notes::default();
    let (said, plans) = ask(room(&[]), &instance(&team), ("{}", 4000), &notes);
    assert_eq!(said, Ok(()));
    let (first, last) = (&plans[0], &plans[plans.len() - 1]);
    judge(&team, &[], first).unwrap();
    judge(&team, &[], last).unwrap();
    assert!(cost(last) < cost(first));
    let figures = notes.figures.lock().unwrap();
    let figure = |name: &str| figures.iter().find(|(known, _)| known == name).unwrap().1;
    assert!(figure("lower_bound") >= 140.0 - 1e-6 && figure("lower_bound") <= cost(last));
    assert!(figure("nodes") <= 4000.0 && figure("expansions") > 0.0);
}

#[test]
fn who_is_at_its_goal_stays() {
    let team = [disc(0.3, [2.0, 6.0], [2.0, 6.0])];
    let (said, plans) = ask(
        room(&walls()),
        &instance(&team),
        ("{}", 0),
        &Notes::default(),
    );
    assert_eq!(said, Ok(()));
    assert!(
        plans[0][0]
            .iter()
            .all(|knot| (knot.x_m, knot.y_m) == (2.0, 6.0))
    );
    assert!(cost(&plans[0]) == 0.0);
    let (said, plans) = ask(room(&[]), &instance(&[]), ("{}", 0), &Notes::default());
    assert_eq!((said, plans), (Ok(()), vec![vec![]]));
}

#[test]
fn failures_say_why() {
    let status = |team: &[(Body, Pose, Pose)], obstacles: &[Vec<[f64; 2]>], nodes| {
        let world = room(obstacles);
        let (said, plans) = ask(world, &instance(team), ("{}", nodes), &Notes::default());
        assert!(plans.is_empty());
        let failure = said.unwrap_err();
        (failure.status, failure.message)
    };
    let through = [disc(0.3, [1.0, 6.0], [7.0, 6.0])];
    let wall = vec![vec![[3.9, 0.0], [4.1, 0.0], [4.1, SIDE], [3.9, SIDE]]];
    let (found, message) = status(&through, &wall, 0);
    assert_eq!(found, Status::Infeasible);
    assert!(message.contains("agent 0"), "{message}");
    let (found, _) = status(&[disc(0.3, [1.0, 1.0], [2.0, 1.5])], &walls(), 0);
    assert_eq!(found, Status::GaveUp);
    let touching = [
        disc(0.3, [1.0, 6.0], [6.0, 6.0]),
        disc(0.3, [1.0, 4.0], [6.0, 5.5]),
    ];
    let (found, message) = status(&touching, &[], 0);
    assert_eq!(found, Status::GaveUp);
    assert!(message.contains("agents 0 and 1"), "{message}");
    // A rectangle has no proof.
    let long = Body {
        radius: 0.5,
        corners: [[-0.4, -0.3], [0.4, -0.3], [0.4, 0.3], [-0.4, 0.3]]
            .map(|[x, y]| Vector::new(x, y))
            .to_vec(),
    };
    let pose = |x: f64| Pose {
        at: Vector::new(x, 6.0),
        heading: 1.0,
    };
    let (found, _) = status(&[(long, pose(1.0), pose(7.0))], &wall, 2000);
    assert_eq!(found, Status::GaveUp);
    // Told to stop before it began.
    let notes = Notes::default();
    notes.cancelled.store(true, Ordering::Relaxed);
    let swap = [
        disc(0.3, [1.0, 6.0], [7.0, 6.0]),
        disc(0.3, [7.0, 6.0], [1.0, 6.0]),
    ];
    let (said, _) = ask(room(&walls()), &instance(&swap), ("{}", 0), &notes);
    assert_eq!(said.unwrap_err().status, Status::TimedOut);
}

#[test]
fn obstacles_that_move_are_given_way() {
    let team = [
        disc(0.3, [1.0, 4.0], [7.0, 4.0]),
        disc(0.3, [7.0, 5.0], [1.0, 5.0]),
    ];
    let knots = vec![[0.0, 4.0, 7.5, 0.0], [8.0, 4.0, 0.5, 0.0]];
    let world = WorkspaceEnvironment {
        movers: vec![Mover {
            footprint: Footprint::disc(0.4),
            knots: knots.clone(),
        }],
        ..room(&[])
    };
    let (said, plans) = ask(world, &instance(&team), ("{}", 500), &Notes::default());
    assert_eq!(said, Ok(()));
    let with_mover: Vec<(Body, Pose, Pose)> = team
        .iter()
        .cloned()
        .chain([disc(0.4, [4.0, 7.5], [4.0, 0.5])])
        .collect();
    for mut plan in plans {
        let moved = knots.iter().map(|[time_s, x_m, y_m, _]| Knot {
            time_s: *time_s,
            x_m: *x_m,
            y_m: *y_m,
            heading_rad: f64::NAN,
        });
        plan.push(moved.collect());
        judge(&with_mover, &[], &plan).unwrap();
    }
}
