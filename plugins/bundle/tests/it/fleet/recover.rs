//! Fail policies: whatever the planner leaves, what they answer can be driven.

use super::common::{BUDGET, drawn, map};
use fleetyard_abi::object::{FailPolicy, Object};
use fleetyard_abi::sdk::{self, Options, Plugin as _};
use fleetyard_abi::{Budget, Goals, GridPlan, Heading, Instance, Motion, SharedEnvironment};
use fleetyard_plugin_fleet::recover::{AllWait, GuidedPibt, Lrgw, Pibt, RuleBased};
use fleetyard_testkit::{Case, Notes};
use proptest::prelude::*;

fn made<P: sdk::FailPolicy>(options: &str) -> Box<dyn FailPolicy> {
    match Object::fail_policy(P::create(Options::new(options)).unwrap()) {
        Object::FailPolicy(policy) => policy,
        other => panic!("{other:?}"),
    }
}

fn all() -> Vec<(&'static str, Box<dyn FailPolicy>)> {
    vec![
        ("all-wait", made::<AllWait>("{}")),
        ("pibt", made::<Pibt>("{}")),
        ("guided-pibt", made::<GuidedPibt>("{}")),
        ("lrgw", made::<Lrgw>("{}")),
        ("rule-based", made::<RuleBased>("{}")),
    ]
}

fn recover(
    policy: &mut dyn FailPolicy,
    environment: &SharedEnvironment,
    instance: &Instance,
    failed: Option<&GridPlan>,
) -> GridPlan {
    let host = Notes::default();
    policy.prepare(environment, &BUDGET, &host).unwrap();
    let failed = failed.map(|plan| plan.clone().into());
    policy
        .recover(instance, failed.as_ref(), &BUDGET, &host)
        .unwrap();
    host.plans.into_inner().unwrap().pop().unwrap()
}

/// Motions, turns, collisions and rings; nobody has to arrive.
fn fault(
    environment: &SharedEnvironment,
    instance: &Instance,
    plan: &GridPlan,
) -> Result<(), String> {
    let case = Case {
        map: environment.grid().unwrap().clone(),
        instance: instance.clone(),
    };
    let paths: Vec<&[u32]> = plan.paths().collect();
    case.motions(&paths)?;
    case.collisions(&paths, 0)
}

/// Repairs paths, one per agent, with a policy.
fn repair<P: sdk::FailPolicy>(
    environment: &SharedEnvironment,
    instance: &Instance,
    failed: &[&[u32]],
) -> Vec<Vec<u32>> {
    let failed = GridPlan::from_paths(failed);
    let plan = recover(
        made::<P>("{}").as_mut(),
        environment,
        instance,
        Some(&failed),
    );
    assert_eq!(fault(environment, instance, &plan), Ok(()));
    plan.paths().map(<[u32]>::to_vec).collect()
}

fn asked(starts: &[u32], goals: &[u32], window_steps: u32) -> Instance {
    Instance {
        window_steps,
        allows_cycles: false,
        ..Instance::one_shot(starts.to_vec(), goals.to_vec())
    }
}

/// Random numbers for the tests: any will do, and it is seen where they come from.
struct Draw(u64);

impl Draw {
    fn below(&mut self, bound: u64) -> u64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % bound
    }
}

const HEADINGS: [Heading; 4] = [Heading::East, Heading::South, Heading::West, Heading::North];

/// A crowd on a map with walls, and walks at random, which collide.
fn crowd(seed: u64) -> (SharedEnvironment, Instance, GridPlan) {
    let mut draw = Draw(seed);
    let (rows, cols) = (2 + draw.below(7) as u32, 2 + draw.below(7) as u32);
    let density = draw.below(4);
    let walls: Vec<bool> = (0..rows * cols).map(|_| draw.below(10) < density).collect();
    let environment = map(rows, cols, |cell| !walls[cell as usize]);
    let mut free: Vec<u32> = (0..rows * cols)
        .filter(|cell| !walls[*cell as usize])
        .collect();
    if free.is_empty() {
        return crowd(seed + 1);
    }
    for last in (1..free.len()).rev() {
        free.swap(last, draw.below(last as u64 + 1) as usize);
    }
    let agents = 1 + draw.below(free.len() as u64) as usize;
    let starts = free[..agents].to_vec();
    let any = |draw: &mut Draw| free[draw.below(free.len() as u64) as usize];
    let mut goals = Goals::default();
    for _ in 0..agents {
        let many = draw.below(3);
        goals.push((0..=many).map(|_| any(&mut draw)));
    }
    let turning = draw.below(2) == 0;
    let instance = Instance {
        goals,
        headings: Some((0..agents).map(|agent| HEADINGS[agent % 4]).collect()),
        motion: if turning {
            Motion::Rotation
        } else {
            Motion::Pebble
        },
        window_steps: [0, 1, 5, 12][draw.below(4) as usize],
        allows_cycles: draw.below(3) == 0,
        ..Instance::one_shot(starts.clone(), starts.clone())
    };
    let mut paths = Vec::new();
    for start in &starts {
        let mut path = vec![*start];
        let mut here = *start;
        for _ in 0..draw.below(20) {
            let (row, col) = (here / cols, here % cols);
            let to = match draw.below(5) {
                0 if row > 0 => here - cols,
                1 if col + 1 < cols => here + 1,
                2 if row + 1 < rows => here + cols,
                3 if col > 0 => here - 1,
                _ => here,
            };
            // Now and then through a wall, or somewhere else.
            if !walls[to as usize] || draw.below(20) == 0 {
                here = to;
            }
            path.push(if draw.below(200) == 0 { u32::MAX } else { here });
        }
        if draw.below(20) == 0 {
            path.clear();
        }
        paths.push(path);
    }
    (environment, instance, GridPlan::from_paths(paths))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    /// Collision-free, without rings where they are not allowed, with the time that turns
    /// take, and the same again.
    #[test]
    fn whatever_is_left_becomes_a_plan(seed in any::<u64>()) {
        let (environment, instance, failed) = crowd(seed);
        for (name, mut policy) in all() {
            for failed in [Some(&failed), None] {
                let plan = recover(&mut *policy, &environment, &instance, failed);
                let found = fault(&environment, &instance, &plan);
                prop_assert_eq!(found, Ok(()), "{}: {:?} {:?}", name, plan, failed);
                let again = recover(&mut *policy, &environment, &instance, failed);
                prop_assert_eq!(plan, again, "{}", name);
            }
        }
    }

    /// Paths that do not collide are driven as they were, but for waits that no agent needs.
    #[test]
    fn good_paths_are_followed(seed in any::<u64>()) {
        let (environment, mut instance, _) = crowd(seed);
        instance.motion = Motion::Pebble;
        instance.allows_cycles = false;
        instance.window_steps = 12;
        let mut pibt = made::<Pibt>("{}");
        let good = recover(pibt.as_mut(), &environment, &instance, None);
        let mut lrgw = made::<Lrgw>("{}");
        let driven = recover(lrgw.as_mut(), &environment, &instance, Some(&good));
        for (good, driven) in good.paths().zip(driven.paths()) {
            prop_assert!(driven.len() <= good.len());
            let moves = |path: &[u32]| {
                let mut path = path.to_vec();
                path.dedup();
                path
            };
            prop_assert_eq!(moves(good), moves(driven));
        }
        let mut rules = made::<RuleBased>("{}");
        prop_assert_eq!(recover(rules.as_mut(), &environment, &instance, Some(&good)), good);
    }
}

#[test]
fn waits_are_few_and_orders_are_kept() {
    let cross = drawn(&["@.@", "...", "@.@"]);
    // Both would be in the middle at once: the first goes first, the second a step later.
    let instance = asked(&[3, 1], &[5, 7], 6);
    let driven = repair::<Lrgw>(&cross, &instance, &[&[3, 4, 5], &[1, 4, 7]]);
    assert_eq!(driven, [vec![3, 4, 5], vec![1, 1, 4, 7]]);
    // The planner lets the second go first, and the first has stood there for nothing.
    let driven = repair::<Lrgw>(&cross, &instance, &[&[3, 3, 3, 4, 5], &[1, 1, 4, 7]]);
    assert_eq!(driven, [vec![3, 3, 4, 5], vec![1, 4, 7]]);
    // Through each other: nobody gets anywhere, and the third behind them neither.
    let row = drawn(&["...."]);
    let instance = asked(&[0, 1, 3], &[1, 0, 2], 6);
    let driven = repair::<Lrgw>(&row, &instance, &[&[0, 1], &[1, 0], &[3, 2, 1]]);
    assert_eq!(driven, [vec![0], vec![1], vec![3, 2]]);
}

#[test]
fn who_can_never_come_is_not_waited_for() {
    // The first two want to change places, and the first is to be in cell 2 before the third.
    let place = drawn(&["....", "@@.@"]);
    let instance = asked(&[0, 1, 6], &[3, 0, 3], 8);
    let failed: &[&[u32]] = &[&[0, 1, 2, 3], &[1, 0], &[6, 6, 6, 2, 3]];
    let driven = repair::<Lrgw>(&place, &instance, failed);
    assert_eq!(driven[2], [6, 2, 3]);
    // Two that each want the other to be first: one of them is.
    let square = drawn(&["...", "...", "..."]);
    let instance = asked(&[0, 8], &[8, 0], 9);
    let failed: &[&[u32]] = &[&[0, 1, 2, 5, 8], &[8, 5, 2, 1, 0]];
    let driven = repair::<Lrgw>(&square, &instance, failed);
    assert!(driven.iter().any(|path| path.len() > 1), "{driven:?}");
}

#[test]
fn rings_turn_where_they_may() {
    let square = drawn(&["..", ".."]);
    let failed: &[&[u32]] = &[&[0, 1], &[1, 3], &[3, 2], &[2, 0]];
    let mut instance = asked(&[0, 1, 3, 2], &[1, 3, 2, 0], 4);
    assert_eq!(
        repair::<Lrgw>(&square, &instance, failed),
        [[0], [1], [3], [2]]
    );
    assert_eq!(
        repair::<RuleBased>(&square, &instance, failed),
        [[0], [1], [3], [2]]
    );
    instance.allows_cycles = true;
    assert_eq!(repair::<Lrgw>(&square, &instance, failed), failed);
    assert_eq!(repair::<RuleBased>(&square, &instance, failed), failed);
    assert_eq!(repair::<Pibt>(&square, &instance, failed).concat().len(), 8);
}

#[test]
fn rules_make_way_or_stop() {
    // The first two are in each other's way further down, so they wait where they are; the
    // third comes by, and both make way.
    let place = drawn(&[".....", "@..@@"]);
    let instance = asked(&[1, 2, 0], &[7, 6, 3], 6);
    let failed: &[&[u32]] = &[&[1, 6, 7], &[2, 7, 6], &[0, 0, 1, 2, 3]];
    let plan = repair::<RuleBased>(&place, &instance, failed);
    assert_eq!(plan, [vec![1, 6], vec![2, 7], vec![0, 0, 1, 2, 3]]);
    // The first cannot make way, since the second is there: so the third has to stop.
    let place = drawn(&[".....", "@@.@@", "@@.@@"]);
    let instance = asked(&[2, 7, 0], &[7, 7, 3], 6);
    let failed: &[&[u32]] = &[&[2, 7], &[7, 12, 7], &[0, 1, 2, 3]];
    let plan = repair::<RuleBased>(&place, &instance, failed);
    assert_eq!(plan, [[2], [7], [0]]);
}

#[test]
fn guides_are_preferred_to_shortest_ways() {
    // The planner sends the agent round the block.
    let block = drawn(&["....", ".@@.", "...."]);
    let instance = asked(&[0], &[3], 8);
    let round: &[u32] = &[0, 4, 8, 9, 10, 11, 7, 3];
    assert_eq!(repair::<GuidedPibt>(&block, &instance, &[round]), [round]);
    assert_eq!(repair::<Pibt>(&block, &instance, &[round]), [[0, 1, 2, 3]]);
    // Without a path, and where it ends, the shortest way it is.
    assert_eq!(
        repair::<GuidedPibt>(&block, &instance, &[&[0]]),
        [[0, 1, 2, 3]]
    );
    assert_eq!(
        repair::<GuidedPibt>(&block, &instance, &[&[0, 4, 8, 9]])[0][..4],
        [0, 4, 8, 9]
    );
    // Past the first goal and back, though the way to the second begins here.
    let row = drawn(&["....."]);
    let goals = [vec![4, 1]].into_iter().collect();
    let instance = Instance {
        goals,
        ..asked(&[2], &[0], 9)
    };
    let there_and_back: &[u32] = &[2, 3, 4, 3, 2, 1];
    assert_eq!(
        repair::<GuidedPibt>(&row, &instance, &[there_and_back]),
        [there_and_back]
    );
}

#[test]
fn steps_are_the_windows_or_the_options() {
    let row = drawn(&["............"]);
    let instance = asked(&[0], &[11], 5);
    assert_eq!(repair::<Pibt>(&row, &instance, &[&[0]])[0].len(), 6);
    let mut short = made::<Pibt>(r#"{"steps":2}"#);
    let plan = recover(short.as_mut(), &row, &instance, None);
    assert_eq!(plan.cells().len(), 3);
    let forever = Instance {
        window_steps: 0,
        ..instance.clone()
    };
    assert_eq!(repair::<Pibt>(&row, &forever, &[&[0]])[0].len(), 12);
    assert!(Pibt::create(Options::new(r#"{"steps":0}"#)).is_err());
    assert!(Lrgw::create(Options::new(r#"{"steps":1}"#)).is_err());
}

#[test]
fn wrong_instances_are_refused() {
    let row = drawn(&["..@."]);
    for (name, mut policy) in all() {
        if name == "all-wait" {
            continue;
        }
        let host = Notes::default();
        let mut ask = |instance: &Instance, budget: &Budget| {
            policy
                .recover(instance, None, budget, &host)
                .map_err(|failure| failure.message)
        };
        let unprepared = ask(&asked(&[0], &[1], 3), &BUDGET).unwrap_err();
        assert!(unprepared.contains("prepare"), "{name}: {unprepared}");
        policy.prepare(&row, &BUDGET, &host).unwrap();
        let mut ask = |instance: &Instance| {
            let answer = policy.recover(instance, None, &BUDGET, &host);
            answer.map_err(|failure| failure.message)
        };
        assert!(
            ask(&asked(&[2], &[1], 3))
                .unwrap_err()
                .contains("agent 0: start cell 2")
        );
        assert!(
            ask(&asked(&[0, 0], &[1, 1], 3))
                .unwrap_err()
                .contains("agents 0 and 1")
        );
        let turning = Instance {
            motion: Motion::Rotation,
            ..asked(&[0], &[1], 3)
        };
        assert!(ask(&turning).unwrap_err().contains("headings"), "{name}");
        // A goal behind a wall is no reason to stand still for ever.
        assert_eq!(ask(&asked(&[0], &[3], 3)), Ok(()), "{name}");
    }
}
