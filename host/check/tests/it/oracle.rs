//! The validator against a slow one that compares every pair of agents at every
//! time step, and against plans of any content.

use std::collections::BTreeSet;
use std::sync::Arc;

use fleetyard_check::{Rule, Terms, metrics, validate, validate_terms};
use fleetyard_core::{Connectivity, Grid, GridInstance, GridPlan, Heading, OFF_MAP, Separation};
use proptest::prelude::*;

/// Time, agents and rule of every violation, written from the rules' words.
fn slow(
    instance: &GridInstance,
    plan: &GridPlan,
    separation: Separation,
) -> BTreeSet<(u32, Vec<u32>, Rule)> {
    let grid = instance.grid();
    let eight = instance.connectivity() == Connectivity::Eight;
    let plan = plan.trimmed();
    let mut found = BTreeSet::new();
    let place = |agent: usize, time: usize| {
        let cell = plan.at(agent, time);
        (cell < grid.cell_count()).then(|| {
            let (row, col) = grid.row_col(cell);
            (i64::from(row), i64::from(col))
        })
    };
    let free =
        |(row, col): (i64, i64)| grid.is_passable((row * i64::from(grid.cols()) + col) as u32);
    let end = |agent: usize| plan.path(agent).len().saturating_sub(1);
    let unit = |agent: usize, time: usize| {
        let (from, to) = (place(agent, time - 1)?, place(agent, time)?);
        let step = (to.0 - from.0, to.1 - from.1);
        let length = step.0 * step.0 + step.1 * step.1;
        (length == 1 || (eight && length == 2)).then_some((from, to))
    };
    for agent in 0..plan.agents() {
        let path = plan.path(agent);
        let one = vec![agent as u32];
        if path.is_empty() {
            found.insert((0, one, Rule::EmptyPath));
            continue;
        }
        if path[0] != instance.starts()[agent] {
            found.insert((0, one.clone(), Rule::WrongStart));
        }
        if path[path.len() - 1] != instance.goals()[agent] {
            found.insert((end(agent) as u32, one.clone(), Rule::WrongGoal));
        }
        for time in 0..path.len() {
            let entered = time == 0 || path[time] != path[time - 1];
            let mut add = |rule| found.insert((time as u32, one.clone(), rule));
            match place(agent, time) {
                None if entered => drop(add(Rule::OutOfBounds)),
                Some(at) if entered && !free(at) => drop(add(Rule::Obstacle)),
                _ => {}
            }
            if time == 0 || !entered {
                continue;
            }
            let (Some(from), Some(to)) = (place(agent, time - 1), place(agent, time)) else {
                continue;
            };
            if unit(agent, time).is_none() {
                add(Rule::NotAdjacent);
            } else if !(free((from.0, to.1)) && free((to.0, from.1)))
                && from.0 != to.0
                && from.1 != to.1
            {
                add(Rule::CornerCut);
            } else if let (Some(&last), Some(&next)) = (path.get(time - 1), path.get(time))
                && grid.is_passable(last)
                && grid.is_passable(next)
                && grid
                    .neighbors(last, Connectivity::Eight)
                    .all(|to| to != next)
            {
                add(Rule::MoveNotAllowed);
            }
        }
    }
    for a in 0..plan.agents() {
        for b in a + 1..plan.agents() {
            if plan.path(a).is_empty() || plan.path(b).is_empty() {
                continue;
            }
            let both = || vec![a as u32, b as u32];
            for time in 0..=end(a).max(end(b)) {
                let parked = time > end(a) || time > end(b);
                if place(a, time).is_some() && place(a, time) == place(b, time) {
                    let rule = if parked {
                        Rule::ParkedConflict
                    } else {
                        Rule::VertexConflict
                    };
                    found.insert((time as u32, both(), rule));
                }
                if time == 0 || parked {
                    continue;
                }
                let (Some(one), Some(other)) = (unit(a, time), unit(b, time)) else {
                    continue;
                };
                if one.0 == other.0 || one.1 == other.1 {
                    continue;
                }
                let middle = |(from, to): ((i64, i64), (i64, i64))| (from.0 + to.0, from.1 + to.1);
                let diagonal =
                    |(from, to): ((i64, i64), (i64, i64))| from.0 != to.0 && from.1 != to.1;
                let gap = (middle(one).0 - middle(other).0).pow(2)
                    + (middle(one).1 - middle(other).1).pow(2);
                let way = |(from, to): ((i64, i64), (i64, i64))| (to.0 - from.0, to.1 - from.1);
                let across = way(one).0 * way(other).0 + way(one).1 * way(other).1 == 0;
                let rule = match (gap, diagonal(one), diagonal(other)) {
                    _ if separation == Separation::Strict
                        && !eight
                        && across
                        && (one.1 == other.0 || other.1 == one.0) =>
                    {
                        Rule::CornerFollow
                    }
                    (0, ..) if one.0 == other.1 => Rule::SwapConflict,
                    (0, true, true) => Rule::DiagonalCrossing,
                    // Half a cell between a corner and the middle of its edge.
                    (1, true, false) | (1, false, true) => Rule::CornerMeet,
                    _ => continue,
                };
                found.insert((time as u32, both(), rule));
            }
        }
    }
    found
}

/// Unit moves of agents that look to the north at first, without the time to turn.
fn unturned(instance: &GridInstance, plan: &GridPlan) -> BTreeSet<(u32, Vec<u32>, Rule)> {
    let grid = instance.grid();
    let mut found = BTreeSet::new();
    for (agent, path) in plan.trimmed().paths().enumerate() {
        let (mut looks, mut since) = ((-1, 0), 0);
        for time in 1..path.len() {
            let (from, to) = (path[time - 1], path[time]);
            if from.max(to) >= grid.cell_count() {
                continue;
            }
            let (from, to) = (grid.row_col(from), grid.row_col(to));
            let step = (
                i64::from(to.0) - i64::from(from.0),
                i64::from(to.1) - i64::from(from.1),
            );
            if step.0 * step.0 + step.1 * step.1 != 1 {
                continue;
            }
            // The scalar product: ahead, to a side, back.
            let quarters = 1 - (looks.0 * step.0 + looks.1 * step.1);
            if ((time - 1 - since) as i64) < quarters {
                found.insert((time as u32, vec![agent as u32], Rule::Turn));
            }
            (looks, since) = (step, time);
        }
    }
    found
}

/// True if agents share a cell, where not all pairs of them are reported.
fn is_crowded(found: &BTreeSet<(u32, Vec<u32>, Rule)>) -> bool {
    let shares = |rule| matches!(rule, Rule::VertexConflict | Rule::ParkedConflict);
    found.iter().any(|(_, _, rule)| shares(*rule))
}

#[derive(Debug, Clone)]
struct Case {
    instance: GridInstance,
    plan: GridPlan,
}

/// Random walks on a small map, mostly legal by themselves, with some noise.
fn case() -> impl Strategy<Value = Case> {
    let shape = (1u32..6, 1u32..6, any::<bool>(), 1usize..7, 0usize..8);
    (shape, proptest::collection::vec(any::<u32>(), 120)).prop_map(
        |((rows, cols, eight, agents, horizon), noise)| {
            let mut noise = noise.into_iter().cycle();
            let mut next = move |bound: u32| noise.next().unwrap_or(0) % bound.max(1);
            let cells = rows * cols;
            let terrain = (0..cells).map(|_| if next(8) == 0 { b'@' } else { b'.' });
            let mut terrain: Vec<u8> = terrain.collect();
            terrain[0] = b'.';
            let mut grid = Grid::new("random", rows, cols, terrain).unwrap();
            if next(3) == 0 {
                let masks = grid.move_masks(Connectivity::Eight).into_iter();
                let masks = masks.map(|mask| mask & !(1u8 << next(12).min(7)));
                grid = grid.clone().with_moves(masks.collect()).unwrap();
            }
            let component = grid.components(Connectivity::Four);
            let open: Vec<u32> = (0..cells)
                .filter(|cell| component[*cell as usize] == component[0])
                .collect();
            let agents = agents.min(open.len());
            let connectivity = if eight {
                Connectivity::Eight
            } else {
                Connectivity::Four
            };
            let shuffled = |turn: u32| {
                let mut list = open.clone();
                list.rotate_left(turn as usize % open.len());
                list[..agents].to_vec()
            };
            let (starts, goals) = (shuffled(next(97)), shuffled(next(89)));
            let paths: Vec<Vec<u32>> = (0..agents)
                .map(|agent| {
                    let mut at = starts[agent];
                    let mut path = vec![at];
                    for _ in 0..horizon {
                        let ways: Vec<u32> = grid.neighbors(at, connectivity).chain([at]).collect();
                        at = match next(60) {
                            0 => OFF_MAP,
                            1 => cells + 3,
                            2..5 => next(cells),
                            _ => ways[next(ways.len() as u32) as usize],
                        };
                        path.push(at);
                        if at >= cells {
                            at = starts[agent];
                        }
                    }
                    if next(40) == 0 {
                        path.clear();
                    }
                    path
                })
                .collect();
            let instance = GridInstance::new(Arc::new(grid), connectivity, starts, goals).unwrap();
            Case {
                instance,
                plan: GridPlan::from_paths(paths),
            }
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 2000,
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn agrees_with_the_slow_validator(Case { instance, plan } in case()) {
        let expected = slow(&instance, &plan, Separation::Rules);
        let verdict = validate(&instance, &plan, usize::MAX);
        prop_assert_eq!(verdict.valid, expected.is_empty());
        prop_assert_eq!(verdict.violations.len() as u64, verdict.violation_count);
        let found: Vec<_> = verdict.violations.iter()
            .map(|found| (found.time, found.agents.clone(), found.rule))
            .collect();
        prop_assert!(found.is_sorted());
        let unique: BTreeSet<_> = found.iter().cloned().collect();
        prop_assert_eq!(unique.len(), found.len());
        prop_assert!(unique.is_subset(&expected));
        if !is_crowded(&expected) {
            prop_assert_eq!(&unique, &expected);
        }
        // Which rules are broken does not depend on how conflicts are paired.
        let rules = |all: &BTreeSet<(u32, Vec<u32>, Rule)>| -> BTreeSet<(u32, Rule)> {
            all.iter().map(|(time, _, rule)| (*time, *rule)).collect()
        };
        prop_assert_eq!(rules(&unique), rules(&expected));
        // Waits at the end change nothing, and a limit only cuts.
        prop_assert_eq!(&validate(&instance, &plan.trimmed(), usize::MAX), &verdict);
        let cut = validate(&instance, &plan, 3);
        prop_assert_eq!(&cut.violations[..], &verdict.violations[..verdict.violations.len().min(3)]);
        prop_assert_eq!(cut.violation_count, verdict.violation_count);
    }

    #[test]
    fn no_valid_plan_beats_the_lower_bounds(Case { instance, plan } in case()) {
        let found = metrics(&instance, &plan, 1.0);
        prop_assert_eq!(found.moves + found.waits, found.sum_of_costs);
        if validate(&instance, &plan, 0).valid {
            prop_assert!(found.lower_bound_steps <= found.sum_of_costs);
            prop_assert!(found.lower_bound_makespan <= found.makespan);
            prop_assert!(found.lower_bound_m <= found.length_m + 1e-9);
        }
    }

    #[test]
    fn terms_are_those_of_the_slow_validator(
        Case { instance, plan } in case(),
        window in 0..8u32,
        strict in any::<bool>(),
    ) {
        let separation = if strict { Separation::Strict } else { Separation::Rules };
        let turns = instance.connectivity() == Connectivity::Four;
        let headings = vec![Heading::North; instance.agents()];
        let terms = Terms {
            goals: None,
            headings: turns.then_some(&headings[..]),
            window_steps: window,
            separation,
            ..(&instance).into()
        };
        let verdict = validate_terms(&terms, &plan, usize::MAX);
        let found: BTreeSet<_> = verdict.violations.iter()
            .map(|found| (found.time, found.agents.clone(), found.rule))
            .collect();
        let mut expected = slow(&instance, &plan, separation);
        expected.retain(|(time, agents, rule)| {
            *rule != Rule::WrongGoal && (agents.len() < 2 || window == 0 || *time <= window)
        });
        if turns {
            expected.extend(unturned(&instance, &plan));
        }
        // In a cell with several agents each is reported against the first one alone.
        if is_crowded(&expected) {
            prop_assert!(found.is_subset(&expected));
            expected.retain(|(_, agents, _)| agents.len() < 2);
            prop_assert!(expected.is_subset(&found));
        } else {
            prop_assert_eq!(found, expected);
        }
        for turn in verdict.violations.iter().filter(|found| found.rule == Rule::Turn) {
            let needs_none = turn.sentence.contains("needs 0");
            prop_assert!(!needs_none, "{}", turn.sentence);
        }
    }
}
