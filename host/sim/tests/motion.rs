//! What every motion model promises: limits hold at every tick, targets are reached in
//! bounded time and not passed, straight legs are kept to.

use std::f64::consts::{FRAC_PI_2, PI};

use fleetyard_sim::motion::{Model, PRESETS, State, Target, wrap};
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

/// What a model must keep: in a tick from `before` to `after`.
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
        Model::Pebble(_) | Model::Rotation(_) | Model::SingleIntegrator(_) => Ok(()),
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
