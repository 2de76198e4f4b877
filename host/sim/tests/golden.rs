//! Golden digests: the same bits in every run, build and tier-by-tier.
//!
//! A change of any of these constants means that executions of the past can no
//! longer be compared with those of today; it needs a note in the changelog and
//! a new version in the domain string of the trace digest.

mod common;

use fleetyard_core::{Grid, GridPlan};
use fleetyard_sim::{NoTrace, SimConfig, Simulator, Tier};

fn digest(grid: &Grid, plan: &GridPlan, config: &SimConfig) -> String {
    let config = &SimConfig {
        overlapping_starts: true,
        ..config.clone()
    };
    let outcome = Simulator::new(config)
        .on_grid(grid)
        .run(plan, &mut NoTrace)
        .expect("can be executed");
    outcome.trace_digest.to_string()
}

struct Case {
    name: &'static str,
    world: fn() -> (Grid, GridPlan),
    config: SimConfig,
    kinematic: &'static str,
    contact: &'static str,
}

fn cases() -> Vec<Case> {
    vec![
        Case {
            name: "valid plan, default parameters",
            world: || {
                let mut rng = common::rng(1);
                let grid = common::random_grid(&mut rng, 16, 16, 20);
                let plan = common::valid_walks(&mut rng, &grid, 60, 25);
                (grid, plan)
            },
            config: SimConfig::default(),
            kinematic: "99e96f3a5e733db6bee01da7d0a1a0be",
            contact: "1bd764278b4389e72e1d212f5c20542f",
        },
        Case {
            name: "collisions between agents, odd parameters",
            world: || {
                let mut rng = common::rng(2);
                let grid = common::random_grid(&mut rng, 11, 17, 10);
                let plan = common::wild_walks(&mut rng, &grid, 30, 25, false, 0);
                (grid, plan)
            },
            config: SimConfig {
                cell_size_m: 0.37,
                step_s: 0.731,
                radius_m: Some(0.17),
                ..SimConfig::default()
            },
            kinematic: "de81c2827fdcd6a636cc95e7ada66d55",
            contact: "364fe3aa7ce149bfa566db5b9788fcfc",
        },
        Case {
            name: "teleports through walls",
            world: || {
                let mut rng = common::rng(3);
                let grid = common::random_grid(&mut rng, 20, 9, 25);
                let plan = common::wild_walks(&mut rng, &grid, 20, 25, true, 10);
                (grid, plan)
            },
            config: SimConfig::default(),
            kinematic: "b4f8e6d55896fd4338ba6f79c8762b94",
            contact: "fb363add143078ee1cea3503ac070a15",
        },
    ]
}

#[test]
fn digests_do_not_change() {
    let mut wrong = Vec::new();
    for case in cases() {
        let (grid, plan) = (case.world)();
        for (tier, golden) in [
            (Tier::Kinematic, case.kinematic),
            (Tier::Contact, case.contact),
        ] {
            let config = SimConfig {
                tier,
                ..case.config.clone()
            };
            let digest_now = digest(&grid, &plan, &config);
            assert_eq!(digest_now, digest(&grid, &plan, &config), "two runs");
            if digest_now != golden {
                wrong.push(format!("{}, {tier}: {digest_now}", case.name));
            }
        }
    }
    assert!(wrong.is_empty(), "other digests than before: {wrong:#?}");
}

#[test]
fn everything_that_matters_changes_the_digest() {
    let mut rng = common::rng(4);
    let grid = common::random_grid(&mut rng, 10, 10, 10);
    let plan = common::wild_walks(&mut rng, &grid, 10, 10, false, 0);
    let base = SimConfig::default();
    let mut seen = std::collections::BTreeSet::new();
    let configs = [
        base.clone(),
        SimConfig {
            radius_m: Some(0.3),
            ..base.clone()
        },
        SimConfig {
            step_s: 2.0,
            ..base.clone()
        },
        SimConfig {
            substeps: 5,
            ..base.clone()
        },
        SimConfig {
            tier: Tier::Contact,
            ..base.clone()
        },
        SimConfig {
            every_substep: true,
            ..base.clone()
        },
        SimConfig {
            max_speed_cells_per_step: 2.0,
            ..base.clone()
        },
    ];
    for config in &configs {
        seen.insert(digest(&grid, &plan, config));
    }
    let other = common::wild_walks(&mut rng, &grid, 10, 10, false, 0);
    seen.insert(digest(&grid, &other, &base));
    assert_eq!(seen.len(), configs.len() + 1);
    // What is only kept, not done, changes nothing.
    let less = SimConfig {
        max_contacts_kept: 0,
        ..base.clone()
    };
    assert_eq!(digest(&grid, &plan, &less), digest(&grid, &plan, &base));
}
