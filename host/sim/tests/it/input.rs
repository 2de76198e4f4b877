//! Bad input is refused with an error that says what and why; whatever can be
//! executed is executed; nothing panics.

use crate::common;
use fleetyard_core::{Grid, GridPlan, OFF_MAP, Words as _};
use fleetyard_sim::{NoTrace, Other, Outcome, SimConfig, SimError, Simulator, Tier};
use proptest::prelude::*;

fn open(rows: u32, cols: u32) -> Grid {
    Grid::new("open", rows, cols, vec![b'.'; (rows * cols) as usize]).expect("a valid map")
}

fn run(grid: &Grid, plan: &GridPlan, config: &SimConfig) -> Result<Outcome, SimError> {
    Simulator::new(config).on_grid(grid).run(plan, &mut NoTrace)
}

#[track_caller]
fn refused(plan: &GridPlan, config: &SimConfig, message: &str) {
    let error = run(&open(3, 3), plan, config).expect_err("must be refused");
    assert!(error.to_string().contains(message), "{error}");
    assert!(error.hint().is_some(), "{error}");
}

#[test]
fn bad_plans() {
    let config = SimConfig::default();
    refused(&GridPlan::default(), &config, "no agents");
    refused(
        &GridPlan::from_paths([vec![0], vec![]]),
        &config,
        "path of agent 1 is empty",
    );
    for cell in [9, OFF_MAP] {
        refused(
            &GridPlan::from_paths([vec![0, 1], vec![4, cell]]),
            &config,
            "agent 1 is outside the map at time 1",
        );
    }
    let dense = SimConfig {
        max_pairs: 10,
        ..SimConfig::default()
    };
    refused(
        &GridPlan::from_paths(vec![vec![0]; 9]),
        &dense,
        "more than 10 pairs",
    );
}

#[test]
fn bad_parameters() {
    let plan = GridPlan::from_paths([vec![0, 1]]);
    let bad = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 0.0, -1.0, 1e300];
    for value in bad {
        let base = SimConfig::default();
        for (field, config) in [
            (
                "cell_size_m",
                SimConfig {
                    cell_size_m: value,
                    ..base.clone()
                },
            ),
            (
                "step_s",
                SimConfig {
                    step_s: value,
                    ..base.clone()
                },
            ),
            (
                "radius_m",
                SimConfig {
                    radius_m: Some(value),
                    ..base.clone()
                },
            ),
            (
                "max_speed",
                SimConfig {
                    max_speed_cells_per_step: value,
                    ..base.clone()
                },
            ),
        ] {
            refused(&plan, &config, field);
        }
        if value != 0.0 {
            let config = SimConfig {
                approach_range_cells: value,
                ..base.clone()
            };
            refused(&plan, &config, "approach_range_cells");
        }
    }
    for count in [0, u32::MAX] {
        let config = SimConfig {
            ticks_hz: count,
            ..SimConfig::default()
        };
        refused(&plan, &config, "ticks_hz");
        let config = SimConfig {
            substeps: count,
            ..SimConfig::default()
        };
        refused(&plan, &config, "substeps");
    }
    refused(
        &plan,
        &SimConfig {
            radius_m: Some(0.51),
            ..SimConfig::default()
        },
        "radius_m = 0.51",
    );
    let long = SimConfig {
        step_s: 1e6,
        ticks_hz: 100_000,
        ..SimConfig::default()
    };
    let plan = GridPlan::from_paths([[0, 1].repeat(500)]);
    refused(&plan, &long, "ticks");
    let wrong = serde_json::from_str::<Tier>("\"physics\"").unwrap_err();
    assert!(
        wrong.to_string().contains("`kinematic` or `contact`"),
        "{wrong}"
    );
    assert_eq!(Tier::from_name("contact"), Some(Tier::Contact));
}

#[test]
fn a_plan_that_stands_still_has_no_ticks() {
    for tier in [Tier::Kinematic, Tier::Contact] {
        let config = SimConfig {
            tier,
            overlapping_starts: true,
            ..SimConfig::default()
        };
        let outcome = run(
            &open(3, 3),
            &GridPlan::from_paths([vec![0], vec![1]]),
            &config,
        )
        .unwrap();
        assert_eq!((outcome.ticks, outcome.contacts.total()), (0, 0));
        assert_eq!(outcome.nearest_approach_m, Some(1.0));
        // Two agents in one cell touch from the start and for good.
        let outcome = run(
            &open(3, 3),
            &GridPlan::from_paths([vec![4], vec![4]]),
            &config,
        )
        .unwrap();
        let contact = outcome.contacts.first[0];
        assert_eq!((contact.begin_s, contact.end_s), (0.0, None), "{tier}");
        assert_eq!(outcome.contacts.total(), 1);
        assert_eq!(outcome.nearest_approach_m, Some(0.0));
    }
}

#[test]
fn touching_is_not_contact() {
    // With a = 2r agents in neighbouring cells touch all the time.
    let grid = open(2, 5);
    let plan = GridPlan::from_paths([vec![0, 1, 2, 3], vec![5, 6, 7, 8], vec![4, 4, 4, 4]]);
    for cell_size_m in [1.0, 0.1, 0.7, 3.3] {
        let config = SimConfig {
            cell_size_m,
            radius_m: Some(0.5 * cell_size_m),
            ..SimConfig::default()
        };
        let outcome = run(&grid, &plan, &config).unwrap();
        assert_eq!(outcome.contacts.total(), 0, "cells of {cell_size_m} m");
    }
}

/// The classic conflicts, with times that follow from geometry.
#[test]
fn conflicts_are_contacts() {
    let grid = open(3, 3);
    let config = SimConfig::default();
    let first = |paths: [Vec<u32>; 2]| {
        let outcome = run(&grid, &GridPlan::from_paths(paths), &config).unwrap();
        assert_eq!(outcome.contacts.agent_agent, 1);
        outcome.contacts.first[0]
    };
    let near = |a: f64, b: f64| (a - b).abs() < 1e-5;
    // Head on in one cell: centres are 2 - 2t apart, in contact below 0.7.
    let vertex = first([vec![0, 1], vec![2, 1]]);
    assert!(near(vertex.begin_s, 0.65) && vertex.end_s.is_none());
    // A swap: centres are |1 - 2t| apart.
    let swap = first([vec![0, 1], vec![1, 0]]);
    assert!(near(swap.begin_s, 0.15) && near(swap.end_s.unwrap(), 0.85));
    // Crossing diagonals: |2t - 1| again.
    let cross = first([vec![0, 4], vec![1, 3]]);
    assert!(near(cross.begin_s, 0.15) && near(cross.end_s.unwrap(), 0.85));
    assert_eq!((cross.agent, cross.other), (0, Other::Agent(1)));
}

#[test]
fn corner_following_is_safe_up_to_the_documented_radius() {
    let grid = open(2, 2);
    let plan = GridPlan::from_paths([vec![0, 1], vec![2, 0]]);
    let at = |radius: f64| {
        let config = SimConfig {
            radius_m: Some(radius),
            ..SimConfig::default()
        };
        run(&grid, &plan, &config).unwrap()
    };
    assert_eq!(at(0.3535).contacts.total(), 0);
    assert_eq!(at(0.3536).contacts.total(), 1);
    let nearest = at(0.35).nearest_approach.unwrap();
    assert!((nearest.distance_m - 0.5f64.sqrt()).abs() < 1e-12);
    assert!((nearest.time_s - 0.5).abs() < 1e-12);
}

#[test]
fn driving_into_a_wall_is_a_contact_with_it() {
    let grid = Grid::new("wall", 1, 4, b"..@.".to_vec()).unwrap();
    let plan = GridPlan::from_paths([vec![0, 1, 2, 3]]);
    let outcome = run(&grid, &plan, &SimConfig::default()).unwrap();
    assert_eq!(outcome.contacts.agent_obstacle, 1);
    let contact = outcome.contacts.first[0];
    assert_eq!(contact.other, Other::Obstacle { cell: 2 });
    assert!((contact.begin_s - 1.15).abs() < 1e-5);
    assert!((contact.end_s.unwrap() - 2.85).abs() < 1e-5);
    // Cutting the corner of a solid cell.
    let grid = Grid::new("corner", 2, 2, b"..@.".to_vec()).unwrap();
    let outcome = run(
        &grid,
        &GridPlan::from_paths([vec![0, 3]]),
        &SimConfig::default(),
    )
    .unwrap();
    assert_eq!(outcome.contacts.agent_obstacle, 1);
}

#[test]
fn a_teleport_is_tracking_error() {
    let grid = open(1, 10);
    let plan = GridPlan::from_paths([vec![0, 9, 9, 9, 9, 9, 9, 9]]);
    let outcome = run(&grid, &plan, &SimConfig::default()).unwrap();
    // After the first step the body has come 1.5 of 9 cells.
    assert!((outcome.tracking_error_max_m - 7.5).abs() < 1e-9);
    assert_eq!(outcome.tracking_error_max_agent, Some(0));
    assert!(outcome.tracking_error_mean_m > 0.0);
    let valid = GridPlan::from_paths([vec![0, 1, 2]]);
    let outcome = run(&grid, &valid, &SimConfig::default()).unwrap();
    assert_eq!(outcome.tracking_error_max_agent, None);
}

#[test]
fn an_outcome_is_json() {
    let outcome = run(
        &open(2, 2),
        &GridPlan::from_paths([vec![0, 1], vec![1, 0]]),
        &SimConfig::default(),
    );
    let json = serde_json::to_value(outcome.unwrap()).unwrap();
    assert_eq!(json["tier"], "kinematic");
    assert_eq!(json["contacts"]["agent_agent"], 1);
    assert_eq!(json["contacts"]["first"][0]["other"]["agent"], 1);
    assert_eq!(json["trace_digest"].as_str().map(str::len), Some(32));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn nothing_panics(
        seed in any::<u64>(),
        paths in proptest::collection::vec(
            proptest::collection::vec(prop_oneof![200 => 0u32..36, 1 => any::<u32>()], 1..8),
            1..8,
        ),
        cell in prop_oneof![9 => Just(1.0), 3 => 1e-6..1e6f64, 1 => any::<f64>()],
        step in prop_oneof![9 => Just(1.0), 3 => 1e-6..0.1f64, 1 => any::<f64>()],
        radius in prop_oneof![9 => Just(None), 3 => (0.001..0.5f64).prop_map(Some), 1 => any::<f64>().prop_map(Some)],
        speed in prop_oneof![9 => Just(1.5), 3 => 1e-3..1e3f64, 1 => any::<f64>()],
        range in prop_oneof![Just(2.0), 0.0..1e3f64],
        every_substep in any::<bool>(),
        contact in any::<bool>(),
    ) {
        let mut rng = common::rng(seed);
        let grid = common::random_grid(&mut rng, 6, 6, 30);
        let config = SimConfig {
            cell_size_m: cell,
            // Long steps are only slow.
            step_s: if step > 10.0 { step.max(1e7) } else { step },
            radius_m: radius.map(|radius| radius * cell),
            max_speed_cells_per_step: speed,
            approach_range_cells: range,
            every_substep,
            tier: if contact { Tier::Contact } else { Tier::Kinematic },
            ticks_hz: 10,
            ..SimConfig::default()
        };
        if let Ok(outcome) = run(&grid, &GridPlan::from_paths(paths), &config) {
            prop_assert!(outcome.tracking_error_max_m.is_finite());
            prop_assert!(outcome.tracking_error_mean_m <= outcome.tracking_error_max_m * (1.0 + 1e-9));
            prop_assert!(outcome.simulated_s.is_finite());
            for contact in &outcome.contacts.first {
                prop_assert!(contact.end_s.is_none_or(|end| end >= contact.begin_s));
                prop_assert!((0.0..=outcome.simulated_s).contains(&contact.begin_s));
            }
        }
    }
}
