//! Motions by controls agree with an integration in small steps, chords keep to their bounds, and
//! limits and nonsense are told.

use fleetyard_core::{ControlPlan, Knot, Robot, TrajectoryPlan};
use fleetyard_world::{
    Bounded, CHORD_M, CHORD_RAD, ControlError, ControlExcess, ControlModel, Driven, Dynamics,
    Travel,
};
use proptest::prelude::*;
use serde_json::{Value, json};

/// Name, numbers of a state, numbers of a control.
const MODELS: [(&str, usize, usize); 9] = [
    ("single-integrator", 2, 2),
    ("single-integrator", 3, 3),
    ("double-integrator", 4, 2),
    ("double-integrator", 6, 3),
    ("unicycle", 3, 2),
    ("differential-drive", 3, 2),
    ("unicycle-2", 5, 2),
    ("holonomic", 3, 3),
    ("holonomic-2", 6, 3),
];

fn robot(name: &str, states: &Value, controls: &Value) -> Robot {
    let heading =
        !name.ends_with("integrator") || [3, 6].contains(&states.as_array().unwrap().len());
    let parameters = if name == "differential-drive" {
        json!([0.5, 1.0])
    } else {
        json!([])
    };
    let robot = json!({
        "footprint": {"radius_m": 0.3}, "dynamics": format!("fleetyard.{name}/1"),
        "has_heading": heading, "state_limits": states, "control_limits": controls,
        "parameters": parameters,
    });
    serde_json::from_value(robot).unwrap()
}

fn free(name: &str, states: usize, controls: usize) -> ControlModel {
    let none = |count: usize| json!(vec![[Value::Null, Value::Null]; count]);
    ControlModel::new(&robot(name, &none(states), &none(controls))).unwrap()
}

/// A unicycle of second order with limits.
fn cart() -> Robot {
    let any = json!([null, null]);
    robot(
        "unicycle-2",
        &json!([any, [-1.0, 1.0], any, [-0.25, 0.5], [-1.0, 1.0]]),
        &json!([[-1.0, 2.0], [-3.0, 3.0]]),
    )
}

fn drive(model: &ControlModel, start: &[f64], segments: &[(f64, Vec<f64>)]) -> Driven {
    try_drive(model, start, segments, 1 << 20).unwrap()
}

fn try_drive(
    model: &ControlModel,
    start: &[f64],
    segments: &[(f64, Vec<f64>)],
    most: usize,
) -> Result<Driven, ControlError> {
    let mut plan = ControlPlan::default();
    plan.push_agent(segments.iter().cloned()).unwrap();
    model.drive(start, plan.of(0), most)
}

/// Change of a state, by the table of the contract.
fn slope(name: &str, state: &[f64], control: &[f64]) -> Vec<f64> {
    let (second, body) = (
        name.starts_with("double") || name.ends_with("-2"),
        !name.ends_with("integrator"),
    );
    let pose = state.len() - if second { control.len() } else { 0 };
    let rates = if second { &state[pose..] } else { control };
    let turn = (pose == 3).then(|| rates[rates.len() - 1]);
    let ahead = rates[0];
    let aside = if name.starts_with("unicycle") || name.starts_with("differential") {
        0.0
    } else {
        rates[1]
    };
    let (sin, cos) = if body { state[2].sin_cos() } else { (0.0, 1.0) };
    let mut slope = vec![ahead * cos - aside * sin, ahead * sin + aside * cos];
    slope.extend(turn);
    if second {
        slope.extend(control);
    }
    slope
}

/// The state after a control, by the rule of Runge and Kutta in small steps.
fn stepped(name: &str, state: &[f64], control: &[f64], duration_s: f64) -> Vec<f64> {
    let steps = (duration_s / 1e-3).ceil().max(1.0);
    let step_s = duration_s / steps;
    let mut state = state.to_vec();
    let moved = |state: &[f64], slope: &[f64], by: f64| -> Vec<f64> {
        let pairs = state.iter().zip(slope);
        pairs.map(|(number, slope)| number + slope * by).collect()
    };
    for _ in 0..steps as u32 {
        let one = slope(name, &state, control);
        let two = slope(name, &moved(&state, &one, step_s / 2.0), control);
        let three = slope(name, &moved(&state, &two, step_s / 2.0), control);
        let four = slope(name, &moved(&state, &three, step_s), control);
        for (at, number) in state.iter_mut().enumerate() {
            *number += step_s / 6.0 * (one[at] + 2.0 * two[at] + 2.0 * three[at] + four[at]);
        }
    }
    state
}

/// The place on the chords at a time.
fn on_chord(knots: &[Knot], time_s: f64) -> Knot {
    let next = knots.partition_point(|knot| knot.time_s <= time_s);
    let (from, to) = (knots[next - 1], knots[next.min(knots.len() - 1)]);
    let share = if to.time_s > from.time_s {
        (time_s - from.time_s) / (to.time_s - from.time_s)
    } else {
        0.0
    };
    let between = |from: f64, to: f64| from + (to - from) * share;
    Knot {
        time_s,
        x_m: between(from.x_m, to.x_m),
        y_m: between(from.y_m, to.y_m),
        heading_rad: from
            .heading_rad
            .map(|heading| between(heading, to.heading_rad.unwrap())),
    }
}

proptest! {
    #[test]
    fn controls_lead_where_small_steps_do(
        model in 0..MODELS.len(),
        start in proptest::collection::vec(-2.0..2.0f64, 6),
        segments in proptest::collection::vec(
            (0.01..1.5f64, proptest::collection::vec(-3.0..3.0f64, 3), 0.0..1.0f64),
            1..6,
        ),
        straight in any::<bool>(),
    ) {
        let (name, states, controls) = MODELS[model];
        let model = free(name, states, controls);
        let given: Vec<(f64, Vec<f64>)> = segments
            .iter()
            .map(|(duration_s, numbers, _)| {
                let mut numbers = numbers[..controls].to_vec();
                // Arcs that speed up, and lines.
                if straight {
                    numbers[controls - 1] = 0.0;
                }
                (*duration_s, numbers)
            })
            .collect();
        let driven = drive(&model, &start[..states], &given);
        let mut state = start[..states].to_vec();
        let mut begin_s = 0.0;
        for ((duration_s, control), (.., share)) in given.iter().zip(&segments) {
            let middle = stepped(name, &state, control, duration_s * share);
            let chord = on_chord(&driven.knots, begin_s + duration_s * share);
            let off = (chord.x_m - middle[0]).hypot(chord.y_m - middle[1]);
            prop_assert!(off <= CHORD_M + 1e-8, "{name}: {off} m beside the chord");
            if let Some(heading) = chord.heading_rad {
                let off = (heading - middle[2]).abs();
                prop_assert!(off <= CHORD_RAD + 1e-8, "{name}: {off} rad beside the chord");
            }
            state = stepped(name, &state, control, *duration_s);
            begin_s += duration_s;
        }
        prop_assert_eq!(driven.end.len(), states);
        for (found, stepped) in driven.end.iter().zip(&state) {
            prop_assert!((found - stepped).abs() < 1e-8, "{name}: {:?} {state:?}", driven.end);
        }
        // Wheels have the only limit here.
        let is_wheel = |excess: &ControlExcess| excess.bounded == Bounded::WheelSpeed;
        prop_assert!(driven.excesses.iter().all(is_wheel));
        let last = driven.knots[driven.knots.len() - 1];
        prop_assert!((last.time_s - begin_s).abs() < 1e-12);
    }

    /// A turn that is even and one that nearly is lead to nearly the same place.
    #[test]
    fn closed_forms_and_integrals_meet(
        speed in -1.0..1.0f64,
        push in -1.0..1.0f64,
        turn in -6.0..6.0f64,
        duration_s in 0.1..5.0f64,
    ) {
        let model = free("unicycle-2", 5, 2);
        let start = [0.0, 0.0, 0.5, speed, turn];
        let even = drive(&model, &start, &[(duration_s, vec![push, 0.0])]);
        let other = drive(&model, &start, &[(duration_s, vec![push, 1e-14])]);
        for (one, two) in even.end.iter().zip(&other.end) {
            prop_assert!((one - two).abs() < 1e-11, "{:?} {:?}", even.end, other.end);
        }
    }
}

#[test]
fn straight_motions_have_a_knot_per_segment() {
    let model = free("single-integrator", 2, 2);
    let driven = drive(
        &model,
        &[1.0, 2.0],
        &[(2.0, vec![0.5, 0.0]), (4.0, vec![0.0, -0.25])],
    );
    let places: Vec<[f64; 3]> = driven
        .knots
        .iter()
        .map(|knot| [knot.time_s, knot.x_m, knot.y_m])
        .collect();
    assert_eq!(places, [[0.0, 1.0, 2.0], [2.0, 2.0, 2.0], [6.0, 2.0, 1.0]]);
    // A turn on the spot is as straight.
    let turn = drive(&free("unicycle", 3, 2), &[0.0; 3], &[(9.0, vec![0.0, 2.0])]);
    assert_eq!(
        (turn.knots.len(), &turn.end[..]),
        (2, &[0.0, 0.0, 18.0][..])
    );
    // Nobody has to drive.
    assert_eq!(drive(&model, &[1.0, 2.0], &[]).knots.len(), 1);
}

#[test]
fn a_quarter_of_a_circle() {
    use std::f64::consts::FRAC_PI_2;
    let driven = drive(
        &free("unicycle", 3, 2),
        &[1.0, 0.0, FRAC_PI_2],
        &[(FRAC_PI_2, vec![1.0, 1.0])],
    );
    let [x, y, heading] = driven.end[..] else {
        panic!("{:?}", driven.end);
    };
    assert!(
        x.abs() < 1e-15 && (y - 1.0).abs() < 1e-15 && (heading - 2.0 * FRAC_PI_2).abs() < 1e-15
    );
    // As many chords as it takes: their sagitta is h²/8.
    let chords = FRAC_PI_2 / (8.0 * CHORD_M).sqrt();
    assert_eq!(driven.knots.len(), chords.ceil() as usize + 1);
}

fn told(excesses: &[ControlExcess]) -> Vec<(Bounded, &'static str, usize)> {
    let told = excesses.iter();
    told.map(|excess| (excess.bounded, excess.along, excess.segment))
        .collect()
}

#[test]
fn limits_are_told_with_segment_time_and_place() {
    let model = ControlModel::new(&cart()).unwrap();
    let start = [0.0; 5];
    // Half a metre per second in a quarter of a second, and to rest by braking twice as long.
    let within = [
        (0.25, vec![2.0, 0.0]),
        (1.0, vec![0.0, 0.0]),
        (0.5, vec![-1.0, 0.0]),
    ];
    let driven = drive(&model, &start, &within);
    assert_eq!(driven.excesses, []);
    assert!(driven.end[3].abs() < 1e-15);
    // Braked for too long, it reverses faster than it may.
    let mut reverses = within.clone();
    reverses[2].0 = 1.0;
    let driven = drive(&model, &start, &reverses);
    assert_eq!(told(&driven.excesses), [(Bounded::Speed, "", 2)]);
    let worst = driven.excesses[0];
    assert!(
        (worst.value + 0.5).abs() < 1e-12 && (worst.limit + 0.25).abs() < 1e-12,
        "{worst:?}"
    );
    assert!((worst.time_s - 2.25).abs() < 1e-12);
    // Everything at once: the worst place of each.
    let wild = [(0.5, vec![2.5, -3.5]), (9.0, vec![0.0, 0.0])];
    let told_of = told(&drive(&model, &start, &wild).excesses);
    assert_eq!(
        told_of,
        [
            (Bounded::Place, "y", 1),
            (Bounded::Speed, "", 0),
            (Bounded::TurnRate, "", 0),
            (Bounded::Acceleration, "", 0),
            (Bounded::TurnAcceleration, "", 0),
        ]
    );
    // By size rather than along axes.
    let mut puck = robot(
        "single-integrator",
        &json!([[null, null], [null, null]]),
        &json!([[-1.0, 1.0], [-1.0, 1.0]]),
    );
    let diagonal = [(1.0, vec![0.9, 0.9])];
    let excesses =
        |robot: &Robot| drive(&ControlModel::new(robot).unwrap(), &[0.0; 2], &diagonal).excesses;
    assert_eq!(excesses(&puck), []);
    puck.polar_control = true;
    assert_eq!(told(&excesses(&puck)), [(Bounded::Speed, "", 0)]);
}

#[test]
fn wheels_have_limits_of_their_own() {
    let any = json!([null, null]);
    let robot = robot(
        "differential-drive",
        &json!([any, any, any]),
        &json!([[-1.0, 1.0], [-4.0, 4.0]]),
    );
    let model = ControlModel::new(&robot).unwrap();
    let at = |ahead: f64, turn: f64| {
        told(&drive(&model, &[0.0; 3], &[(1.0, vec![ahead, turn])]).excesses)
    };
    assert_eq!(at(1.0, 0.0), []);
    assert_eq!(at(0.0, 4.0), []);
    assert_eq!(at(0.75, 1.0), []);
    assert_eq!(at(0.75, 2.0), [(Bounded::WheelSpeed, "right", 0)]);
    assert_eq!(at(-0.75, 2.0), [(Bounded::WheelSpeed, "left", 0)]);
}

#[test]
fn nonsense_is_refused_with_the_segment() {
    let model = ControlModel::new(&cart()).unwrap();
    let start = [0.0; 5];
    let refused = |segments: &[(f64, Vec<f64>)], most: usize| {
        try_drive(&model, &start, segments, most)
            .unwrap_err()
            .to_string()
    };
    assert_eq!(
        refused(&[(1.0, vec![0.0; 3])], 9),
        "segment 0 has a control of 3 numbers, but the robot takes 2"
    );
    assert_eq!(
        try_drive(&model, &[0.0; 3], &[], 9)
            .unwrap_err()
            .to_string(),
        "the state at the start has 3 numbers, but the robot has 5"
    );
    let fine = (0.5, vec![0.0, 0.0]);
    for absurd in [
        (1e9, vec![1e9, 1e9]),
        (1e9, vec![1e-3, 1.0]),
        (1e3, vec![1e9, 0.0]),
    ] {
        let told = refused(&[fine.clone(), absurd], 1 << 12);
        assert_eq!(told, "segment 1 makes the motion longer than 4096 knots");
    }
    let roll = free("single-integrator", 2, 2);
    let far = try_drive(&roll, &[0.0; 2], &[(1e9, vec![2.0, 0.0])], 9);
    assert_eq!(far, Err(ControlError::Far { segment: 0 }));
    // So short that time does not pass.
    let mut blinks = vec![(1e6, vec![0.0, 0.0])];
    blinks.extend(vec![(1e-300, vec![1.0, 0.0]); 5]);
    assert_eq!(drive(&roll, &[0.0; 2], &blinks).knots.len(), 2);
}

#[test]
fn dynamics_are_those_that_are_declared() {
    let wrong = |change: fn(&mut Robot), reason: &str| {
        let mut robot = cart();
        change(&mut robot);
        let error = ControlModel::new(&robot).unwrap_err().to_string();
        assert!(error.contains(reason), "{error}");
    };
    wrong(
        |robot| robot.dynamics = "org.example.boat/1".into(),
        "`org.example.boat/1`",
    );
    wrong(|robot| robot.has_heading = false, "no heading");
    wrong(|robot| robot.parameters.push(1.0), "parameters");
    wrong(|robot| robot.control_limits.truncate(1), "control limits");
    wrong(|robot| robot.state_limits.truncate(3), "state limits");
    wrong(
        |robot| robot.dynamics = "fleetyard.differential-drive/1".into(),
        "track_m and wheel_speed_max",
    );
    let dynamics = ControlModel::new(&cart()).unwrap().dynamics();
    let expected = Dynamics {
        travel: Travel::Wheels {
            forward: 0.5,
            backward: 0.25,
            acceleration: 2.0,
            deceleration: 1.0,
        },
        turn_rad_per_s: 1.0,
        turn_acceleration_rad_per_s2: 3.0,
        curvature_rad_per_m: f64::INFINITY,
    };
    assert_eq!(dynamics, expected);
}

/// A car of dynobench with its trailer.
fn truck() -> Robot {
    serde_json::from_value(json!({
        "footprint": {"radius_m": 0.28}, "dynamics": "fleetyard.car-trailer/1", "has_heading": true,
        "state_limits": [[null, null], [null, null], [null, null], [null, null]],
        "control_limits": [[-0.1, 0.5], [-1.05, 1.05]],
        "parameters": [0.25, 0.5, 0.3, 0.25, 0.79],
    }))
    .unwrap()
}

#[test]
fn cars_and_trailers_agree_with_fine_integration() {
    let segments: [(f64, [f64; 2]); 5] = [
        (1.3, [0.5, 0.4]),
        (0.7, [0.3, -0.9]),
        (2.0, [-0.1, 0.3]),
        (1.0, [0.0, 0.5]),
        (1.5, [0.5, 0.0]),
    ];
    let start = [1.0, -2.0, 0.5, 0.2];
    // Steps of Runge and Kutta.
    let rates = |[_, _, heading, behind]: [f64; 4], [speed, steering]: [f64; 2]| {
        [
            speed * heading.cos(),
            speed * heading.sin(),
            speed / 0.25 * steering.tan(),
            speed / 0.5 * (heading - behind).sin(),
        ]
    };
    let mut state = start;
    for (seconds, control) in segments {
        let steps = 2000;
        let h = seconds / f64::from(steps);
        for _ in 0..steps {
            let on =
                |rate: [f64; 4], by: f64| [0, 1, 2, 3].map(|at: usize| state[at] + rate[at] * by);
            let one = rates(state, control);
            let two = rates(on(one, h / 2.0), control);
            let three = rates(on(two, h / 2.0), control);
            let four = rates(on(three, h), control);
            let mean = [0, 1, 2, 3]
                .map(|at: usize| (one[at] + 2.0 * (two[at] + three[at]) + four[at]) / 6.0);
            state = on(mean, h);
        }
    }
    let mut controls = ControlPlan::default();
    controls.push_agent(segments).unwrap();
    let model = ControlModel::new(&truck()).unwrap();
    let driven = model.drive(&start, controls.of(0), 1 << 12).unwrap();
    for (own, fine) in driven.end.iter().zip(state) {
        assert!((own - fine).abs() < 1e-9, "{:?} and {state:?}", driven.end);
    }
    assert_eq!(driven.excesses, []);
    // The trailer that follows the knots ends there too.
    let mut plan = TrajectoryPlan::default();
    plan.push_path(driven.knots).unwrap();
    let trailer = model.trailer().unwrap();
    let towed = trailer.follow(plan.knots(0), start[3], 1 << 12).unwrap();
    let end = towed.knots[towed.knots.len() - 1];
    assert!((end.heading_rad.unwrap() - state[3]).abs() < 1e-9);

    // Limits of both numbers of a control.
    let mut steep = ControlPlan::default();
    steep.push_agent([(1.0, [-0.2, 1.1])]).unwrap();
    let driven = model.drive(&start, steep.of(0), 1 << 12).unwrap();
    let found: Vec<(Bounded, f64)> = driven
        .excesses
        .iter()
        .map(|at| (at.bounded, at.limit))
        .collect();
    assert_eq!(found, [(Bounded::Speed, -0.1), (Bounded::Steering, 1.05)]);
    let dynamics = model.dynamics();
    assert!((dynamics.curvature_rad_per_m - 1.05f64.tan() / 0.25).abs() < 1e-9);

    let wrong = |parameters: &[f64], reason: &str| {
        let robot = Robot {
            parameters: parameters.to_vec(),
            ..truck()
        };
        let error = ControlModel::new(&robot).unwrap_err().to_string();
        assert!(error.contains(reason), "{error}");
    };
    wrong(&[0.25], "joint_max_rad");
    wrong(&[0.25, 0.5, 0.0, 0.25, 0.7], "not above 0");
    let bare = |parameters: &[f64]| Robot {
        dynamics: "fleetyard.car/1".into(),
        state_limits: vec![[None; 2]; 3],
        parameters: parameters.to_vec(),
        ..truck()
    };
    assert!(ControlModel::new(&bare(&[0.25])).is_ok_and(|car| car.trailer().is_none()));
    assert!(ControlModel::new(&bare(&[])).is_err());
}
