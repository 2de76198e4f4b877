//! Promises of every motion model: limits hold at every tick, targets are reached in bounded time
//! and not passed, straight legs are kept to.

use std::f64::consts::{FRAC_PI_2, PI};

use fleetyard_core::{Hasher, Knot, TrajectoryPlan};
use fleetyard_sim::motion::{
    DifferentialDrive, Model, PRESETS, State, Target, WaypointLaw, smooth, wrap,
};
use proptest::prelude::*;
use proptest::test_runner::TestCaseError;

/// Rounding of sums of some thousand terms.
const ROUNDING: f64 = 1e-7;

fn controlled() -> impl Strategy<Value = Model> {
    let models: Vec<Model> = PRESETS
        .iter()
        .map(|preset| (preset.model)())
        .filter(|model| !model.is_ideal())
        .collect();
    prop::sample::select(models)
}

fn rates() -> impl Strategy<Value = f64> {
    prop::sample::select(vec![10.0, 60.0, 240.0])
}

fn at(x: f64, y: f64) -> Target {
    Target {
        x,
        y,
        heading: None,
    }
}

/// Checks the limits of a model in a tick from `before` to `after`.
fn limits_hold(model: &Model, before: &State, after: &State, dt: f64) -> Result<(), String> {
    let most = |what: &str, value: f64, limit: f64| {
        if value.abs() <= limit * (1.0 + 1e-9) + ROUNDING {
            Ok(())
        } else {
            Err(format!(
                "{what} {value} beyond {limit}, from {before:?} to {after:?}"
            ))
        }
    };
    let (sin, cos) = libm::sincos(after.heading);
    let (sin_before, cos_before) = libm::sincos(before.heading);
    let ahead = after.vx * cos + after.vy * sin;
    let aside = after.vy * cos - after.vx * sin;
    let ahead_before = before.vx * cos_before + before.vy * sin_before;
    let aside_before = before.vy * cos_before - before.vx * sin_before;
    let change = (ahead - ahead_before) / dt;
    let turning = (after.omega - before.omega) / dt;
    most("speed", after.speed_m_per_s(), model.max_speed_m_per_s())?;
    if model.max_turn_rate_rad_per_s().is_finite() {
        most("turn rate", after.omega, model.max_turn_rate_rad_per_s())?;
    }
    // Velocities are what moved the body.
    most("gap in x", after.x - before.x - after.vx * dt, 1e-9)?;
    most("gap in y", after.y - before.y - after.vy * dt, 1e-9)?;
    most(
        "gap in heading",
        after.heading - before.heading - after.omega * dt,
        1e-9,
    )?;
    match model {
        Model::Pebble(_) | Model::Rotation(_) | Model::SingleIntegrator(_) | Model::Car(_) => {
            Ok(())
        }
        Model::DifferentialDrive(drive) => {
            most("sideways speed", aside, 0.0)?;
            let limit = if ahead.abs() > ahead_before.abs() {
                drive.max_acceleration_m_per_s2
            } else {
                drive.max_deceleration_m_per_s2
            };
            most("acceleration", change, limit)?;
            most(
                "turn acceleration",
                turning,
                drive.max_turn_acceleration_rad_per_s2,
            )?;
            if !drive.control.reverse && ahead < -ROUNDING {
                return Err(format!("reverses at {ahead}"));
            }
            Ok(())
        }
        Model::Unicycle1(_) => most("sideways speed", aside, 0.0),
        Model::Unicycle2(drive) => {
            most("sideways speed", aside, 0.0)?;
            most("acceleration", change, drive.max_acceleration_m_per_s2)?;
            most(
                "turn acceleration",
                turning,
                drive.max_turn_acceleration_rad_per_s2,
            )
        }
        Model::DoubleIntegrator(point) => {
            for (now, then) in [(after.vx, before.vx), (after.vy, before.vy)] {
                most("speed of an axis", now, point.max_speed_m_per_s)?;
                most(
                    "acceleration",
                    (now - then) / dt,
                    point.max_acceleration_m_per_s2,
                )?;
            }
            Ok(())
        }
        Model::Holonomic(body) => {
            let backward = body.max_backward_m_per_s;
            let forward = body.max_forward_m_per_s;
            most(
                "speed ahead",
                ahead,
                if ahead < 0.0 { backward } else { forward },
            )?;
            most("speed aside", aside, body.max_lateral_m_per_s)?;
            most(
                "acceleration ahead",
                change,
                body.max_forward_acceleration_m_per_s2,
            )?;
            let sideways = (aside - aside_before) / dt;
            most(
                "acceleration aside",
                sideways,
                body.max_lateral_acceleration_m_per_s2,
            )?;
            most(
                "turn acceleration",
                turning,
                body.max_turn_acceleration_rad_per_s2,
            )
        }
        Model::WaypointLaw(law) => {
            most("sideways speed", aside, 0.0)?;
            // The cap of equation 36 may take more speed than the slew limit would; it
            // never adds any.
            if ahead > ahead_before {
                most(
                    "acceleration",
                    change,
                    law.speed_up_m_per_s2.max(law.slow_down_m_per_s2),
                )?;
            }
            most(
                "turn acceleration",
                turning,
                law.turn_up_rad_per_s2.max(law.turn_down_rad_per_s2),
            )
        }
    }
}

/// Runs block by block of a tenth of a second until it has arrived and rests.
fn arrive(
    model: &Model,
    state: &mut State,
    target: &Target,
    hz: f64,
    factors: &[f64],
    mut see: impl FnMut(&State) -> Result<(), TestCaseError>,
) -> Result<f64, TestCaseError> {
    let (dt, block) = (1.0 / hz, (hz / 10.0) as usize);
    let mut time = 0.0;
    for round in 0..200_000 {
        if model.has_arrived(state, target) {
            return Ok(time);
        }
        let factor = factors[round % factors.len()];
        let mut last = *state;
        let mut seen = 0;
        let mut result = Ok(());
        model.run(state, target, block, dt, factor, &mut |now| {
            if result.is_ok() {
                result = limits_hold(model, &last, now, dt)
                    .map_err(TestCaseError::fail)
                    .and_then(|()| see(now));
            }
            last = *now;
            seen += 1;
        });
        result?;
        prop_assert_eq!(seen, block);
        prop_assert_eq!(
            (last.x, last.y, last.heading),
            (state.x, state.y, state.heading)
        );
        time += 0.1;
    }
    Err(TestCaseError::fail(format!(
        "never arrives: {state:?}, {target:?}"
    )))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 256, ..ProptestConfig::default() })]

    /// From rest, along a straight leg, whatever the noise.
    #[test]
    fn straight_legs_are_kept_to(
        model in controlled(), hz in rates(),
        start in (-5.0..5.0, -5.0..5.0, -PI..PI),
        leg in (0.2..12.0, -PI..PI), off in (0.0..1.0, -PI..PI),
        heading in prop::option::of(-PI..PI),
        factors in prop::collection::vec(prop_oneof![Just(1.0), 0.0..1.0], 1..8),
    ) {
        let arrival = model.arrival_tolerance_m();
        let (length, direction) = leg;
        let (sin, cos) = libm::sincos(direction);
        // It starts as far from its knot as it may.
        let (x, y) = (start.0 + off.0 * arrival * libm::cos(off.1),
                      start.1 + off.0 * arrival * libm::sin(off.1));
        let mut state = State::at_rest(x, y, start.2);
        let target = Target { heading, ..at(start.0 + length * cos, start.1 + length * sin) };
        let mut factors = factors;
        factors.push(1.0);
        let time = arrive(&model, &mut state, &target, hz, &factors, |now| {
            let (dx, dy) = (now.x - start.0, now.y - start.1);
            let (along, across): (f64, f64) = (dx * cos + dy * sin, dy * cos - dx * sin);
            prop_assert!(across.abs() <= model.lateral_tolerance_m() + ROUNDING,
                "{} leaves its leg by {across} at {along}", model.name());
            prop_assert!(along <= length + arrival + ROUNDING, "passes its target: {along}");
            prop_assert!(along >= -arrival - ROUNDING, "goes back: {along}");
            Ok(())
        })?;
        prop_assert!(time < 3000.0, "{time} s");
    }

    /// Targets that change while it moves, at any place: limits hold, and the last one is
    /// reached.
    #[test]
    fn limits_hold_for_any_targets(
        model in controlled(), hz in rates(),
        targets in prop::collection::vec(((-4.0..4.0, -4.0..4.0), prop::option::of(-PI..PI), 1usize..40, 0.0..1.0), 1..6),
    ) {
        let (dt, block) = (1.0 / hz, (hz / 10.0) as usize);
        let mut state = State::at_rest(0.0, 0.0, 0.3);
        for (place, heading, blocks, factor) in &targets {
            let target = Target { heading: *heading, ..at(place.0, place.1) };
            for _ in 0..*blocks {
                let mut last = state;
                let mut result = Ok(());
                model.run(&mut state, &target, block, dt, *factor, &mut |now| {
                    if result.is_ok() {
                        result = limits_hold(&model, &last, now, dt);
                    }
                    last = *now;
                });
                prop_assert!(result.is_ok(), "{}: {}", model.name(), result.unwrap_err());
            }
        }
        let (place, heading, ..) = targets[targets.len() - 1];
        let target = Target { heading, ..at(place.0, place.1) };
        let time = arrive(&model, &mut state, &target, hz, &[1.0], |_| Ok(()))?;
        prop_assert!(time < 200.0, "{} takes {time} s", model.name());
    }
}

proptest! {
    /// Every tick a knot: what models do themselves, plans may ask of them.
    #[test]
    fn what_models_do_is_within_their_dynamics(
        model in controlled(), hz in rates(),
        targets in prop::collection::vec(((-4.0..4.0, -4.0..4.0), prop::option::of(-PI..PI), 0.0..1.0), 1..4),
    ) {
        let dt = 1.0 / hz;
        let mut state = State::at_rest(0.0, 0.0, 0.3);
        let knot = |time_s: f64, state: &State| Knot {
            time_s,
            x_m: state.x,
            y_m: state.y,
            heading_rad: Some(state.heading),
        };
        let mut knots = vec![knot(0.0, &state)];
        for ((x, y), heading, factor) in &targets {
            let target = Target { heading: *heading, ..at(*x, *y) };
            for round in 0..20_000 {
                let factor = if round < 10 { *factor } else { 1.0 };
                let rests = state.speed_m_per_s() == 0.0 && state.omega == 0.0;
                if rests && model.has_arrived(&state, &target) {
                    break;
                }
                model.run(&mut state, &target, 6, dt, factor, &mut |now| {
                    knots.push(knot(knots.len() as f64 * dt, now));
                });
            }
        }
        let mut plan = TrajectoryPlan::default();
        plan.push_path(knots).unwrap();
        let excesses = model.dynamics().excesses(plan.knots(0));
        prop_assert!(excesses.is_empty(), "{}: {excesses:?}", model.name());
    }
}

#[test]
fn angles_are_wrapped_exactly() {
    for angle in [0.0, 1.0, PI, -PI + 1e-12, 3.0, -3.0] {
        assert_eq!(wrap(angle).to_bits(), f64::to_bits(angle));
    }
    assert_eq!(wrap(-PI).to_bits(), PI.to_bits());
    assert!((wrap(3.0 * PI) - PI).abs() < 1e-15);
    assert!((wrap(-5.0 * FRAC_PI_2) + FRAC_PI_2).abs() < 1e-15);
    assert!((wrap(1000.0 * std::f64::consts::TAU + 0.25) - 0.25).abs() < 1e-12);
}

/// A leg that is prolonged while the body is on it, as dependencies on others fall away.
/// The body began as far off as it may.
fn prolonged(
    model: &Model,
    hz: f64,
    off: (f64, f64),
    cells: &[usize],
) -> Result<f64, TestCaseError> {
    let (dt, block) = (1.0 / hz, (hz / 10.0) as usize);
    let arrival = model.arrival_tolerance_m();
    let (x, y) = (
        off.0 * arrival * libm::cos(off.1),
        off.0 * arrival * libm::sin(off.1),
    );
    let mut state = State::at_rest(x, y, 0.0);
    let mut end = 0.0;
    let mut stops = 0;
    for (index, more) in cells.iter().enumerate() {
        end += *more as f64;
        let last = index + 1 == cells.len();
        // Until it is about to arrive, or at the last target.
        for round in 0.. {
            prop_assert!(round < 20_000, "stuck at {state:?}");
            let target = at(end, 0.0);
            let braking = end - state.x < 0.6;
            if model.has_arrived(&state, &target) || (braking && !last) {
                break;
            }
            let mut before = state.speed_m_per_s();
            let mut result = Ok(());
            model.run(&mut state, &target, block, dt, 1.0, &mut |now| {
                let speed = now.speed_m_per_s();
                stops += usize::from(speed == 0.0 && before > 0.0);
                before = speed;
                if now.y.abs() > model.lateral_tolerance_m() + ROUNDING || now.x > end + arrival {
                    result = Err(format!("{} at {now:?}", model.name()));
                }
            });
            prop_assert!(result.is_ok(), "{}", result.unwrap_err());
        }
    }
    prop_assert!(stops <= 1, "{} stops {stops} times", model.name());
    Ok(end)
}

proptest! {
    #[test]
    fn prolonged_legs_are_kept_to_without_a_stop(
        model in controlled(), hz in rates(), off in (0.0..1.0, -PI..PI),
        cells in prop::collection::vec(1usize..5, 1..5),
    ) {
        prolonged(&model, hz, off, &cells)?;
    }
}

/// Time until a body stands at its target, tick by tick.
fn time_to_rest(model: &Model, target: &Target, hz: f64) -> f64 {
    let mut state = State::at_rest(0.0, 0.0, 0.0);
    let mut ticks = 0;
    let off = |state: &State| match target.heading {
        Some(heading) => (heading - state.heading).abs(),
        None => (target.x - state.x).abs(),
    };
    while off(&state) > 1e-6 || state.speed_m_per_s() > 0.0 || state.omega != 0.0 {
        model.run(&mut state, target, 1, 1.0 / hz, 1.0, &mut |_| ());
        ticks += 1;
        assert!(ticks < 100_000, "{state:?}");
    }
    f64::from(ticks) / hz
}

/// From rest to rest under limits of speed and acceleration.
fn trapezoid(distance: f64, speed: f64, acceleration: f64) -> f64 {
    if distance * acceleration >= speed * speed {
        distance / speed + speed / acceleration
    } else {
        2.0 * (distance / acceleration).sqrt()
    }
}

#[test]
fn driving_and_turning_take_what_the_trapezoid_says() {
    let cases = [
        ("agv", 2.0, 2.0, 0.25 * PI, PI),
        ("unicycle-2", 0.5, 0.25, 0.5, 0.25),
    ];
    for (name, speed, acceleration, rate, turn) in cases {
        let model: Model = name.parse().unwrap();
        for hz in [10.0, 60.0, 240.0] {
            let turned = Target {
                heading: Some(FRAC_PI_2),
                ..at(0.0, 0.0)
            };
            let legs = [
                (at(1.0, 0.0), trapezoid(1.0, speed, acceleration)),
                (at(4.0, 0.0), trapezoid(4.0, speed, acceleration)),
                (turned, trapezoid(FRAC_PI_2, rate, turn)),
            ];
            for (target, expected) in legs {
                let time = time_to_rest(&model, &target, hz);
                assert!(
                    time >= expected - 1e-9 && time <= expected + 3.0 / hz,
                    "{name} at {hz} Hz: {time} s, trapezoid {expected} s to {target:?}"
                );
            }
        }
    }
    // Without acceleration limits a leg takes its length over the speed.
    let model: Model = "unicycle-1".parse().unwrap();
    assert!((time_to_rest(&model, &at(4.0, 0.0), 60.0) - 8.0).abs() < 0.04);
    let model: Model = "single-integrator".parse().unwrap();
    assert!((time_to_rest(&model, &at(4.0, 0.0), 60.0) - 4.0).abs() < 0.04);
}

/// Measured on the program itself: one cell 2.6 s, four 6.2 to 6.5 s, eighteen 22.7 s, 90°
/// in 0.9 s. Its robots fetch actions once a second, so a fifth of a second is not known.
#[test]
fn the_preset_of_lsmart_takes_as_long_as_lsmart() {
    let model: Model = "lsmart-effective".parse().unwrap();
    let turned = Target {
        heading: Some(FRAC_PI_2),
        ..at(0.0, 0.0)
    };
    let cases = [
        (at(1.0, 0.0), 2.6),
        (at(4.0, 0.0), 6.35),
        (at(18.0, 0.0), 22.7),
        (turned, 0.9),
    ];
    for (target, measured) in cases {
        let mut state = State::at_rest(0.0, 0.0, 0.0);
        let mut time = 0.0;
        while !model.has_arrived(&state, &target) {
            model.run(&mut state, &target, 1, 1.0 / 60.0, 1.0, &mut |_| ());
            time += 1.0 / 60.0;
        }
        let error: f64 = time - measured;
        assert!(
            error.abs() <= 0.1 * measured,
            "{time} s instead of {measured} s to {target:?}"
        );
    }
}

/// The same bits in every build. A change of these constants means that executions of the
/// past cannot be compared with those of today.
#[test]
fn motions_are_the_same_to_the_bit() {
    let golden = [
        ("pebble", "b30eeded564ff04120d69f3e6f6b0458"),
        ("single-integrator", "da830da3f1ec2438746b046d5059b280"),
        ("agv", "2cacbe26994980031d458cd6f90ebcca"),
        ("lsmart-effective", "037bacb837bfcfd15345bdc1f521f0a3"),
        ("unicycle-1", "df9c56c1ea95f166faed4686e34f8565"),
        ("unicycle-2", "6dc7a9148947a5dcffa90958c09c9c75"),
        ("double-integrator", "1ba596b718d938c7f6ac86d6c1667d5f"),
        ("go2", "c09fdb94dfede21904e70af8f6f0c871"),
        ("waypoint-law", "7a2e9dd53c23ed65a37f1eed1cf73293"),
    ];
    let mut wrong = Vec::new();
    for (name, expected) in golden {
        let model: Model = name.parse().unwrap();
        let mut hasher = Hasher::new("motion");
        let mut state = State::at_rest(0.3, -0.2, 0.1);
        let stops: [(f64, f64, Option<f64>, f64); 6] = [
            (2.3, -0.2, None, 1.0),
            (2.3, 1.8, Some(FRAC_PI_2), 0.9),
            (2.3, 1.8, Some(0.3), 1.0),
            (-1.1, 0.4, None, 0.6),
            (-1.0, 0.5, None, 0.0),
            (0.7, 0.9, Some(-2.0), 1.0),
        ];
        for (x, y, heading, factor) in stops {
            for _ in 0..40 {
                model.run(
                    &mut state,
                    &Target { x, y, heading },
                    6,
                    1.0 / 60.0,
                    factor,
                    &mut |now| {
                        for value in [now.x, now.y, now.heading, now.vx, now.vy, now.omega] {
                            hasher.bytes(&value.to_bits().to_le_bytes());
                        }
                    },
                );
            }
        }
        let digest = hasher.finish().to_string();
        if digest != expected {
            wrong.push((name, digest));
        }
    }
    assert!(wrong.is_empty(), "other bits than before: {wrong:#?}");
}

#[test]
fn every_preset_is_a_model_and_a_word_of_files() {
    for preset in PRESETS {
        let model = (preset.model)();
        model.validate().unwrap();
        assert_eq!(preset.name.parse::<Model>().unwrap(), model);
        let named: Model = serde_json::from_str(&format!("{:?}", preset.name)).unwrap();
        assert_eq!(named, model);
        let written = serde_json::to_string(&model).unwrap();
        assert!(
            written.starts_with(&format!("{{\"{}\":", model.name())),
            "{written}"
        );
        assert_eq!(serde_json::from_str::<Model>(&written).unwrap(), model);
        let named = PRESETS.iter().filter(|other| other.name == preset.name);
        assert_eq!(named.count(), 1, "{}", preset.name);
    }
    let error = "forklift".parse::<Model>().unwrap_err();
    assert!(error.to_string().contains("forklift") && error.hint.contains("agv"));
}

#[test]
fn parameters_that_no_body_has_are_refused() {
    let cases = [
        (r#"{"pebble": {"step_s": 0}}"#, "step_s = 0 is out of range"),
        (r#"{"rotation": {"turn_s": -1}}"#, "turn_s = -1"),
        (
            r#"{"car": {"max_steering_rad": 1.6}}"#,
            "max_steering_rad = 1.6 is out of range",
        ),
        (
            r#"{"car": {"trailer": {"hitch_m": 0}}}"#,
            "trailer.hitch_m = 0",
        ),
        (
            r#"{"single-integrator": {"speed_m_per_s": 0}}"#,
            "speed_m_per_s = 0",
        ),
        (
            r#"{"differential-drive": {"max_speed_m_per_s": -2}}"#,
            "max_speed_m_per_s = -2",
        ),
        (
            r#"{"differential-drive": {"braking_m_per_s2": 3}}"#,
            "braking_m_per_s2 = 3",
        ),
        (
            r#"{"differential-drive": {"control": {"distance": {"p": 0}}}}"#,
            "control.distance.p = 0",
        ),
        (
            r#"{"differential-drive": {"control": {"steer_within_rad": 9}}}"#,
            "steer_within_rad = 9",
        ),
        (
            r#"{"differential-drive": {"wheels": 3}}"#,
            "unknown field `wheels`",
        ),
        (
            r#"{"unicycle-1": {"max_turn_rate_rad_per_s": 0}}"#,
            "max_turn_rate_rad_per_s = 0",
        ),
        (
            r#"{"unicycle-2": {"max_acceleration_m_per_s2": 1e9}}"#,
            "max_acceleration_m_per_s2",
        ),
        (
            r#"{"double-integrator": {"arrival_tolerance_m": 0}}"#,
            "arrival_tolerance_m = 0",
        ),
        (
            r#"{"holonomic": {"max_lateral_m_per_s": 0}}"#,
            "max_lateral_m_per_s = 0",
        ),
        (
            r#"{"waypoint-law": {"drive_within_rad": 0.7}}"#,
            "drive_within_rad = 0.7",
        ),
        (r#"{"hovercraft": {}}"#, "unknown variant `hovercraft`"),
        (r#""hovercraft""#, "is not a model or a preset"),
        (r#"{"pebble": {}, "rotation": {}}"#, ""),
        ("{}", ""),
        ("3", "the name of a preset"),
    ];
    for (text, expected) in cases {
        let error = serde_json::from_str::<Model>(text)
            .expect_err(text)
            .to_string();
        assert!(error.contains(expected), "{text}: {error}");
    }
    for value in [f64::NAN, f64::INFINITY, -0.0] {
        let drive = DifferentialDrive {
            max_speed_m_per_s: value,
            ..DifferentialDrive::default()
        };
        let error = Model::DifferentialDrive(drive).validate().unwrap_err();
        assert_eq!(error.field, "max_speed_m_per_s");
    }
}

#[test]
fn wheels_turn_as_the_body_moves() {
    let law = WaypointLaw::default();
    let mut state = State::at_rest(0.0, 0.0, 0.0);
    (state.vx, state.omega) = (0.5, 1.0);
    let wheels = law.wheel_speeds(&state);
    assert!((wheels.left_m_per_s - (0.5 - 0.2775)).abs() < 1e-12);
    assert!((wheels.right_m_per_s - (0.5 + 0.2775)).abs() < 1e-12);
    assert!((wheels.left_rad_per_s * law.wheel_radius_m - wheels.left_m_per_s).abs() < 1e-12);
    assert!((wheels.right_rad_per_s * law.wheel_radius_m - wheels.right_m_per_s).abs() < 1e-12);
}

/// The tolerance of the maze benchmark is larger at the last waypoint.
#[test]
fn the_last_waypoint_may_have_a_tolerance_of_its_own() {
    let model: Model = serde_json::from_str(
        r#"{"waypoint-law": {"arrival_tolerance_m": 0.1, "final_tolerance_m": 0.4}}"#,
    )
    .unwrap();
    let target = Target {
        x: 0.3,
        y: 0.0,
        heading: None,
    };
    let state = State::at_rest(0.0, 0.0, 0.0);
    assert!(model.has_finished(&state, &target) && !model.has_arrived(&state, &target));
    assert!((model.arrival_tolerance_m() - 0.4).abs() < 1e-12);
    let usual = Model::WaypointLaw(WaypointLaw::default());
    assert!(!usual.has_finished(&state, &target));
    let error = serde_json::from_str::<Model>(
        r#"{"waypoint-law": {"arrival_tolerance_m": 0.1, "final_tolerance_m": 0.05}}"#,
    )
    .unwrap_err();
    assert!(error.to_string().contains("final_tolerance_m"), "{error}");
}

fn plan_of(path: &[(f64, [f64; 3])]) -> TrajectoryPlan {
    let mut plan = TrajectoryPlan::default();
    let knots = path.iter().map(|(time_s, [x_m, y_m, heading])| Knot {
        time_s: *time_s,
        x_m: *x_m,
        y_m: *y_m,
        heading_rad: Some(*heading),
    });
    plan.push_path(knots).expect("a path");
    plan
}

/// Places of a plan with the moments at which it is there.
fn knots_of(plan: &TrajectoryPlan) -> Vec<(f64, [f64; 3])> {
    let knots = plan.knots(0).iter();
    knots
        .map(|knot| {
            (
                knot.time_s,
                [knot.x_m, knot.y_m, knot.heading_rad.unwrap_or(0.0)],
            )
        })
        .collect()
}

/// Bound of the distance of any point of a body, no farther than the radius from its origin, between
/// two poses.
fn apart(a: Knot, b: Knot, radius_m: f64) -> f64 {
    let (x, y) = (a.x_m - b.x_m, a.y_m - b.y_m);
    let turn = a.heading_rad.unwrap_or(0.0) - b.heading_rad.unwrap_or(0.0);
    (x * x + y * y).sqrt() + radius_m * turn.abs()
}

proptest! {
    /// At every moment no point of the body is farther from where the plan has it than allowed; it is
    /// never faster, and begins and ends where and when the plan does.
    #[test]
    fn smooth_plans_stay_near_the_plan(
        path in prop::collection::vec((0.01..2.0, -5.0..5.0, -5.0..5.0, -PI..PI, 0..4), 1..8),
        deviation in 0.001..0.5, radius_m in 0.0..1.0,
    ) {
        let (mut time_s, mut here) = (0.0, [0.0; 3]);
        let mut knots = vec![(time_s, here)];
        for (duration_s, x, y, heading, kind) in path {
            time_s += duration_s;
            // Waits, turns in place and ways without a turn are actions, too.
            here = match kind {
                0 => here,
                1 => [here[0], here[1], heading],
                2 => [x, y, here[2]],
                _ => [x, y, heading],
            };
            knots.push((time_s, here));
        }
        let plan = plan_of(&knots);
        let smoothed = smooth(&plan, deviation, &|_| radius_m).unwrap();
        let (before, after) = (plan.knots(0), smoothed.knots(0));
        prop_assert_eq!(after.get(0), before.get(0));
        prop_assert_eq!(after.get(after.len() - 1), before.get(before.len() - 1));
        let mut moments: Vec<f64> = after.time_s.to_vec();
        moments.extend(before.time_s);
        moments.sort_by(f64::total_cmp);
        for pair in moments.windows(2) {
            for part in 0..4 {
                let when = pair[0] + (pair[1] - pair[0]) * f64::from(part) / 4.0;
                let off = apart(before.at(when), after.at(when), radius_m);
                prop_assert!(off <= deviation * (1.0 + 1e-9) + 1e-9, "{off} at {when}");
            }
        }
        let (was, is) = (before.fastest(), after.fastest());
        prop_assert!(is.speed_m_per_s <= was.speed_m_per_s * (1.0 + 1e-6) + 1e-6);
    }
}

#[test]
fn smooth_corners_are_rounded_and_others_kept() {
    let corner = [
        (0.0, [0.0, 0.0, 0.0]),
        (2.0, [2.0, 0.0, 0.0]),
        (4.0, [2.0, 2.0, 0.0]),
    ];
    let smoothed = knots_of(&smooth(&plan_of(&corner), 0.1, &|_| 0.5).unwrap());
    // Eight pieces between two straight ends.
    assert_eq!(smoothed.len(), 11);
    // When it passes the corner it is as far from it as allowed, half-way round.
    let (when, [x, y, _]) = smoothed[5];
    assert!((when - 2.0).abs() < 1e-12);
    assert!(
        (x + y - 2.0).abs() < 1e-12 && (libm::hypot(x - 2.0, y) - 0.1).abs() < 1e-12,
        "{x} {y}"
    );
    // Speeds change uniformly on the curve.
    let [one, two] = [(2, 3), (7, 8)].map(|(from, to): (usize, usize)| {
        let ((start, [ax, ay, _]), (end, [bx, by, _])) = (smoothed[from], smoothed[to]);
        [(bx - ax) / (end - start), (by - ay) / (end - start)]
    });
    assert!((one[0] + one[1] - 1.0).abs() < 1e-9 && (one[0] - two[1]).abs() < 1e-9);
    // Straight on nothing is to be done, and with no room either.
    let straight = [
        (0.0, [0.0; 3]),
        (1.0, [1.0, 0.0, 0.0]),
        (2.0, [2.0, 0.0, 0.0]),
    ];
    assert_eq!(
        knots_of(&smooth(&plan_of(&straight), 0.1, &|_| 0.5).unwrap()),
        straight
    );
    assert_eq!(
        knots_of(&smooth(&plan_of(&corner), 0.0, &|_| 0.5).unwrap()),
        corner
    );
    // A wait remains one, half as long as planned, and the robot comes to rest in it.
    let wait = [
        (0.0, [0.0; 3]),
        (1.0, [1.0, 0.0, 0.0]),
        (2.0, [1.0, 0.0, 0.0]),
        (3.0, [1.0, 1.0, 0.0]),
    ];
    let smoothed = smooth(&plan_of(&wait), 10.0, &|_| 0.5).unwrap();
    let at = smoothed.knots(0).at(1.5);
    assert!(
        (at.x_m - 1.0).abs() < 1e-12 && at.y_m.abs() < 1e-12,
        "{at:?}"
    );
    // What turns only changes nothing of a body that is round.
    let turn = [
        (0.0, [0.0; 3]),
        (1.0, [0.0, 0.0, 1.0]),
        (2.0, [0.0, 0.0, -1.0]),
    ];
    assert_eq!(
        knots_of(&smooth(&plan_of(&turn), 0.1, &|_| 0.0).unwrap()),
        turn
    );
}

/// Plans are checked before they are driven; what slips through ends all the same.
#[test]
fn targets_that_are_no_places_neither_hang_nor_panic() {
    for preset in PRESETS {
        let model = (preset.model)();
        for far in [f64::NAN, f64::INFINITY, -1e300, 1e300] {
            let mut state = State::at_rest(0.0, 0.0, 0.0);
            let mut ticks = 0;
            for heading in [None, Some(far), Some(1.0)] {
                for (x, y) in [(far, 0.0), (0.0, far), (1.0, 1.0)] {
                    let target = Target { x, y, heading };
                    model.run(&mut state, &target, 6, 1.0 / 60.0, 1.0, &mut |_| ticks += 1);
                }
            }
            assert_eq!(ticks, 54, "{} to {far}", preset.name);
        }
    }
}
