//! Judging what planners and fail policies return.

use fleetyard_abi::{Heading, Instance, Motion};
use fleetyard_check::Rule;
use fleetyard_core::{Grid, GridPlan};
use fleetyard_fleet::batch::{Refused, judge, judge_first};

fn open() -> Grid {
    Grid::new("open", 2, 4, b".......@".to_vec()).unwrap()
}

fn refused(instance: &Instance, paths: &[&[u32]]) -> Refused {
    *judge(&open(), instance, GridPlan::from_paths(paths)).unwrap_err()
}

#[test]
fn a_batch_ends_with_its_window_and_needs_no_goals() {
    let mut instance = Instance::one_shot(vec![0, 3], vec![3, 0]);
    let paths: [&[u32]; 2] = [&[0, 1, 2, 3], &[3, 3]];
    let plan = GridPlan::from_paths(paths);
    instance.window_steps = 2;
    let batch = judge(&open(), &instance, plan.clone()).unwrap();
    assert_eq!(
        (batch.agents(), batch.path(0), batch.path(1)),
        (2, &[0, 1, 2][..], &[3, 3][..])
    );
    assert_eq!(batch.plan(), &plan);
    // Without a window, or within it, agents collide with those who stay.
    for window in [0, 3] {
        instance.window_steps = window;
        let refused = refused(&instance, &paths);
        assert_eq!(refused.plan, plan);
        let found = &refused.verdict.violations[0];
        assert_eq!((found.rule, found.time), (Rule::ParkedConflict, 3));
        assert_eq!(found.agents, [0, 1]);
    }
}

#[test]
fn refusals_say_who_when_where_and_why() {
    let instance = Instance::one_shot(vec![0, 3], vec![3, 0]);
    let text = |paths: &[&[u32]]| refused(&instance, paths).to_string();
    assert_eq!(
        text(&[&[0]]),
        "the plan has 1 paths, the instance 2 agents (agent-count)"
    );
    assert_eq!(
        text(&[&[1], &[3]]),
        "agent 0 begins at (0, 1), its start is (0, 0) (wrong-start)"
    );
    assert_eq!(
        text(&[&[0, 2], &[3, 7]]),
        "agent 0 jumps from (0, 0) to (0, 2) between times 0 and 1 (not-adjacent), and 1 more"
    );
    assert_eq!(
        text(&[&[0, 1, 2], &[3, 2, 1]]),
        "agents 0 and 1 exchange (0, 1) and (0, 2) between times 1 and 2 (swap-conflict)"
    );
    assert_eq!(
        text(&[&[0, u32::MAX], &[3]]),
        "agent 0 is outside the map at time 1 (out-of-bounds)"
    );
    // Starts are the host's, but nothing read from outside may panic.
    let outside = Instance::one_shot(vec![99, 3], vec![3, 0]);
    assert_eq!(
        refused(&outside, &[&[0], &[3]]).to_string(),
        "agent 0 begins at (0, 0), its start is outside the map (wrong-start)"
    );
}

#[test]
fn turning_takes_steps_where_robots_turn() {
    let mut instance = Instance::one_shot(vec![0], vec![5]);
    instance.headings = Some(vec![Heading::North]);
    let straight: &[&[u32]] = &[&[0, 1, 5]];
    let turning: &[&[u32]] = &[&[0, 0, 1, 1, 5]];
    let judged = |instance: &Instance, paths| judge(&open(), instance, GridPlan::from_paths(paths));
    assert!(judged(&instance, straight).is_ok());
    instance.motion = Motion::Rotation;
    assert!(judged(&instance, turning).is_ok());
    assert_eq!(
        judged(&instance, straight).unwrap_err().to_string(),
        "agent 0 looks north and moves from (0, 0) to (0, 1) between times 0 and 1: it needs 1 \
         step to turn and had 0 (turn), and 1 more"
    );
}

#[test]
fn a_plan_of_which_a_step_is_executed_may_collide_later() {
    let mut instance = Instance::one_shot(vec![0, 3], vec![3, 0]);
    let paths: [&[u32]; 2] = [&[0, 1, 2, 3], &[3, 3]];
    let first = |instance: &Instance, paths: &[&[u32]]| {
        judge_first(&open(), instance, GridPlan::from_paths(paths))
    };
    for (window, cells) in [(0, 2), (1, 2), (2, 3), (3, 2)] {
        instance.window_steps = window;
        let batch = first(&instance, &paths).unwrap();
        assert_eq!(batch.path(0), &paths[0][..cells], "window {window}");
        assert_eq!(batch.plan(), &GridPlan::from_paths(paths));
    }
    instance.window_steps = 3;
    // Rings and robots at each other's heels are no collisions; the same cell is one, and so is a
    // step that is none, whenever it is.
    let refused = first(&instance, &[&[0, 1], &[3, 3, 1]]).unwrap_err();
    assert_eq!(refused.verdict.violations[0].rule, Rule::NotAdjacent);
    instance.starts = vec![0, 1, 5, 4];
    let ring: [&[u32]; 4] = [&[0, 1], &[1, 5], &[5, 4], &[4, 0]];
    assert_eq!(first(&instance, &ring).unwrap().path(3), [4, 0]);
    let refused = first(&instance, &[&[0, 1], &[1, 1], &[5], &[4]]).unwrap_err();
    assert_eq!(refused.verdict.violations[0].time, 1);
}
