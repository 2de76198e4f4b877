//! Long and short spans of the kinematic tier see the same contacts.

use crate::common;
use std::collections::BTreeMap;

use fleetyard_core::{Grid, GridPlan};
use fleetyard_sim::{Contact, NoTrace, Other, Outcome, SimConfig, Simulator};

fn run(grid: &Grid, plan: &GridPlan, config: &SimConfig) -> Outcome {
    Simulator::new(config)
        .on_grid(grid)
        .run(plan, &mut NoTrace)
        .expect("the plan can be executed")
}

fn keep_all() -> SimConfig {
    SimConfig {
        max_contacts_kept: usize::MAX,
        overlapping_starts: true,
        ..SimConfig::default()
    }
}

/// The two parties of a contact; obstacles are `u32::MAX`.
fn key(contact: &Contact) -> (u32, u32) {
    match contact.other {
        Other::Agent(other) => (contact.agent, other),
        _ => (contact.agent, u32::MAX),
    }
}

/// Stands for the end of a contact that does not end.
const NEVER: f64 = 1e12;

/// Contacts per pair, in order of time.
fn by_pair(outcome: &Outcome) -> BTreeMap<(u32, u32), Vec<(f64, f64)>> {
    let mut map: BTreeMap<_, Vec<_>> = BTreeMap::new();
    for contact in &outcome.contacts.first {
        let span = (contact.begin_s, contact.end_s.unwrap_or(NEVER));
        map.entry(key(contact)).or_default().push(span);
    }
    map
}

#[test]
fn valid_plans_have_no_contact_and_are_tracked_exactly() {
    for seed in 0..20 {
        let mut rng = common::rng(seed);
        let grid = common::random_grid(&mut rng, 12, 15, 15);
        let plan = common::valid_walks(&mut rng, &grid, 60, 30);
        let outcome = run(&grid, &plan, &keep_all());
        assert_eq!(outcome.contacts.total(), 0, "seed {seed}");
        assert_eq!(outcome.tracking_error_max_m.to_bits(), 0, "seed {seed}");
        let nearest = outcome.nearest_approach_m.expect("a crowded map");
        // Corner following at its closest, and nothing nearer.
        assert!(nearest >= 0.5f64.sqrt() - 1e-12, "seed {seed}: {nearest}");
    }
}

/// Treating a uniform stretch as one is not an approximation.
#[test]
fn long_spans_see_what_substeps_see() {
    for seed in 300..330 {
        let mut rng = common::rng(seed);
        let grid = common::random_grid(&mut rng, 14, 14, 10);
        let plan = common::wild_walks(&mut rng, &grid, 25, 20, seed % 2 == 0, 0);
        // Also steps that are no whole number of substeps or of ticks.
        let step_s = [1.0, 0.7, 0.3333, 0.01, 0.003][(seed % 5) as usize];
        let long = SimConfig {
            step_s,
            ..keep_all()
        };
        let short = SimConfig {
            every_substep: true,
            ..long.clone()
        };
        let (long, short) = (run(&grid, &plan, &long), run(&grid, &plan, &short));
        let (a, b) = (by_pair(&long), by_pair(&short));
        let grazing = |(begin, end): &(f64, f64)| end - begin < 1e-5 * step_s;
        for (pair, spans) in a.iter().chain(&b) {
            let one = a.get(pair).map_or(&[][..], Vec::as_slice);
            let two = b.get(pair).map_or(&[][..], Vec::as_slice);
            if spans.iter().any(grazing) {
                continue;
            }
            assert_eq!(
                one.len(),
                two.len(),
                "seed {seed}: {pair:?} {one:?} {two:?}"
            );
            for (one, two) in one.iter().zip(two) {
                assert!((one.0 - two.0).abs() < 1e-9, "seed {seed}: {pair:?}");
                assert!((one.1 - two.1).abs() < 1e-9);
            }
        }
        let nearest = |o: &Outcome| o.nearest_approach_m.map(|d| (d * 1e9).round());
        assert_eq!(nearest(&long), nearest(&short), "seed {seed}");
        for (one, two) in long
            .nearest_approach_by_agent
            .iter()
            .zip(&short.nearest_approach_by_agent)
        {
            let (one, two) = (one.map(|a| a.distance_m), two.map(|a| a.distance_m));
            match (one, two) {
                (Some(one), Some(two)) => assert!((one - two).abs() < 1e-9, "seed {seed}"),
                (one, two) => assert_eq!(one, two, "seed {seed}"),
            }
        }
    }
}

/// Brute force over all pairs, sampled finely, never finds anyone nearer.
#[test]
fn nearest_approach_matches_dense_sampling() {
    for seed in 400..410 {
        let mut rng = common::rng(seed);
        let grid = common::random_grid(&mut rng, 9, 9, 10);
        let plan = common::wild_walks(&mut rng, &grid, 12, 12, false, 0);
        let config = SimConfig {
            approach_range_cells: 100.0,
            ..keep_all()
        };
        let outcome = run(&grid, &plan, &config);
        let place = |agent: usize, time: f64| {
            let step = time.floor();
            let (from, to) = (
                plan.at(agent, step as usize),
                plan.at(agent, step as usize + 1),
            );
            let (ax, ay) = fleetyard_sim::cell_center_m(&grid, 1.0, from);
            let (bx, by) = fleetyard_sim::cell_center_m(&grid, 1.0, to);
            let f = time - step;
            (ax + (bx - ax) * f, ay + (by - ay) * f)
        };
        for agent in 0..plan.agents() {
            let mut least = f64::INFINITY;
            let samples = 200;
            for sample in 0..=plan.horizon() * samples {
                let time = sample as f64 / samples as f64;
                let (x, y) = place(agent, time);
                for other in (0..plan.agents()).filter(|other| *other != agent) {
                    let (u, v) = place(other, time);
                    least = least.min(((x - u) * (x - u) + (y - v) * (y - v)).sqrt());
                }
            }
            let found = outcome.nearest_approach_by_agent[agent].expect("in range");
            assert!(found.distance_m <= least + 1e-12, "seed {seed}");
            assert!(found.distance_m >= least - 0.015, "seed {seed}");
            assert_eq!(found.agents[0], agent as u32);
            let (x, y) = place(agent, found.time_s);
            let (u, v) = place(found.agents[1] as usize, found.time_s);
            let there = ((x - u) * (x - u) + (y - v) * (y - v)).sqrt();
            assert!((there - found.distance_m).abs() < 1e-9, "seed {seed}");
        }
    }
}
