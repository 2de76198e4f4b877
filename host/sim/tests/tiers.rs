//! The tiers and the two ways of the kinematic tier see the same contacts.

mod common;

use std::collections::{BTreeMap, BTreeSet};

use fleetyard_core::{Grid, GridPlan};
use fleetyard_sim::{Contact, Execution, NoTrace, Other, Outcome, SimConfig, Tier};

fn run(grid: &Grid, plan: &GridPlan, config: &SimConfig) -> Outcome {
    Execution::run(grid, plan, config, &mut NoTrace).expect("the plan can be executed")
}

fn keep_all() -> SimConfig {
    SimConfig {
        max_contacts_kept: usize::MAX,
        ..SimConfig::default()
    }
}

/// Pairs in contact at any time; obstacles are `u32::MAX`.
fn pairs(outcome: &Outcome) -> BTreeSet<(u32, u32)> {
    outcome.contacts.first.iter().map(key).collect()
}

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
        for tier in [Tier::Kinematic, Tier::Contact] {
            let config = SimConfig { tier, ..keep_all() };
            let outcome = run(&grid, &plan, &config);
            assert_eq!(outcome.contacts.total(), 0, "seed {seed}, {tier}");
            assert_eq!(outcome.tracking_error_max_m.to_bits(), 0, "seed {seed}");
            let nearest = outcome.nearest_approach_m.expect("a crowded map");
            // Corner following at its closest, and nothing nearer.
            assert!(nearest >= 0.5f64.sqrt() - 1e-12, "seed {seed}: {nearest}");
        }
    }
}

/// The contact tier samples at substeps, so it misses contacts that are shorter
/// than a substep. Their depth is at most that of a chord of 2 · 1.5 cells per
/// step for 1/240 of a step on a circle of twice the radius: below 3e-5 cells.
/// The pairs that only one tier reports must be such grazes.
#[test]
fn tiers_agree_on_who_touches_whom() {
    for seed in 100..130 {
        let mut rng = common::rng(seed);
        let grid = common::random_grid(&mut rng, 14, 14, 15);
        let teleports = if seed % 3 == 0 { 5 } else { 0 };
        let plan = common::wild_walks(&mut rng, &grid, 25, 20, seed % 2 == 0, teleports);
        let exact = run(&grid, &plan, &keep_all());
        let physics = SimConfig {
            tier: Tier::Contact,
            ..keep_all()
        };
        let physics = run(&grid, &plan, &physics);
        assert!(exact.contacts.total() > 10, "the plan must collide");
        let (a, b) = (pairs(&exact), pairs(&physics));
        for pair in a.symmetric_difference(&b) {
            let spans = by_pair(if a.contains(pair) { &exact } else { &physics });
            let longest = spans[pair]
                .iter()
                .map(|(begin, end)| end - begin)
                .fold(0.0, f64::max);
            assert!(
                longest <= 1.0 / 240.0 + 1e-9,
                "seed {seed}: only one tier sees {pair:?} for {longest} s"
            );
        }
        assert_eq!(
            exact.nearest_approach_m.map(|d| (d * 1e9).round()),
            physics.nearest_approach_m.map(|d| (d * 1e9).round())
        );
        let difference = (exact.tracking_error_max_m - physics.tracking_error_max_m).abs();
        assert!(difference < 1e-9, "seed {seed}");
    }
}

/// Each contact that lasts begins in the contact tier at the end of the substep
/// in which it begins in the kinematic tier.
#[test]
fn tiers_agree_on_when() {
    for seed in 200..210 {
        let mut rng = common::rng(seed);
        let grid = common::random_grid(&mut rng, 14, 14, 15);
        let plan = common::wild_walks(&mut rng, &grid, 20, 20, false, 0);
        let exact = by_pair(&run(&grid, &plan, &keep_all()));
        let physics = SimConfig {
            tier: Tier::Contact,
            ..keep_all()
        };
        let physics = by_pair(&run(&grid, &plan, &physics));
        let substep = 1.0 / 240.0;
        for (pair, spans) in &exact {
            let seen = physics.get(pair).map_or(&[][..], Vec::as_slice);
            for (begin, end) in spans.iter().filter(|(b, e)| e - b > 2.0 * substep) {
                let near = |a: f64, b: f64| b - a > -1e-9 && b - a < substep + 1e-9;
                assert!(
                    seen.iter().any(|(b, e)| near(*begin, *b) && near(*end, *e)),
                    "seed {seed}: {pair:?} from {begin} to {end}, seen {seen:?}"
                );
            }
        }
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
