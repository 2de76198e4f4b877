//! Controls beside knots and alone.

use std::f64::consts::TAU;

use fleetyard_check::{
    ContinuousRule, ContinuousTask, ContinuousVerdict, ContinuousViolation, ControlTask,
};
use fleetyard_core::{ControlPlan, Knot, Robot, TrajectoryPlan};
use fleetyard_world::exact::Obstacles;
use fleetyard_world::{ControlModel, Dynamics, Footprint, Shape};
use serde_json::json;

use crate::validated;

type Segments = Vec<(f64, [f64; 2])>;

fn disc() -> Shape {
    Footprint::Disc { radius_m: 0.25 }.shape().unwrap()
}

/// A double integrator with 0.5 m/s and 2 m/s² along each axis.
fn puck() -> ControlModel {
    let robot: Robot = serde_json::from_value(json!({
        "footprint": {"radius_m": 0.25}, "dynamics": "fleetyard.double-integrator/1",
        "state_limits": [[null, null], [null, null], [-0.5, 0.5], [-0.5, 0.5]],
        "control_limits": [[-2.0, 2.0], [-2.0, 2.0]],
    }))
    .unwrap();
    ControlModel::new(&robot).unwrap()
}

/// Speeds up within a quarter of a second, rolls, and stops: (`roll_s` + 0.25) / 2 metres.
fn along_x(roll_s: f64) -> Segments {
    vec![
        (0.25, [2.0, 0.0]),
        (roll_s, [0.0, 0.0]),
        (0.25, [-2.0, 0.0]),
    ]
}

fn knot(time_s: f64, x_m: f64, y_m: f64) -> Knot {
    Knot {
        time_s,
        x_m,
        y_m,
        heading_rad: None,
    }
}

/// A plan with the knots of each agent, or those to which its controls lead.
fn plan(agents: &[(Option<Vec<Knot>>, Segments)], starts: &[Vec<f64>]) -> TrajectoryPlan {
    let mut plan = TrajectoryPlan::default();
    let mut controls = ControlPlan::default();
    for ((knots, segments), start) in agents.iter().zip(starts) {
        let agent = controls.agents();
        controls.push_agent(segments.clone()).unwrap();
        let driven = || {
            puck()
                .drive(start, controls.of(agent), 1 << 12)
                .unwrap()
                .knots
        };
        plan.push_path(knots.clone().unwrap_or_else(driven))
            .unwrap();
    }
    plan.with_controls(controls).unwrap()
}

fn judged(
    plan: &TrajectoryPlan,
    starts: &[Vec<f64>],
    goals: &[Vec<f64>],
    change: impl Fn(&mut ControlTask<'_>),
) -> ContinuousVerdict {
    let (disc, puck) = (disc(), puck());
    let shapes: Vec<&Shape> = starts.iter().map(|_| &disc).collect();
    let models: Vec<Option<&ControlModel>> = starts.iter().map(|_| Some(&puck)).collect();
    let limits: Vec<Dynamics> = starts.iter().map(|_| puck.dynamics()).collect();
    let mut controls = ControlTask {
        models: &models,
        starts,
        goals,
        tolerance: 1e-3,
        goal_rate: 1e-6,
    };
    change(&mut controls);
    let obstacles = Obstacles::none();
    let task = ContinuousTask {
        controls: Some(controls),
        limits: Some(&limits),
        ..ContinuousTask::new(&shapes, &obstacles)
    };
    validated(plan, &task, 20)
}

fn at(x: f64) -> Vec<f64> {
    vec![x, 0.0, 0.0, 0.0]
}

#[test]
fn controls_alone_are_a_motion() {
    let (starts, goals) = ([at(0.0)], [at(1.0)]);
    let alone = plan(&[(None, along_x(1.75))], &starts);
    let verdict = judged(&alone, &starts, &goals, |_| {});
    assert!(verdict.valid, "{:?}", verdict.violations);
    assert!((alone.horizon_s() - 2.25).abs() < 1e-12);
    // It does not stop in time, and says so by its rates.
    let mut rolls = along_x(1.75);
    rolls[2].0 = 0.2;
    let verdict = judged(&plan(&[(None, rolls)], &starts), &starts, &goals, |_| {});
    assert_eq!(verdict.violations.len(), 1);
    let found = &verdict.violations[0];
    assert_eq!((found.rule, found.time_s), (ContinuousRule::WrongGoal, 2.2));
    assert!(
        found
            .sentence
            .starts_with("agent 0 ends with speed along x 0.0999"),
        "{found}"
    );
    // Too long a stop leads backwards, and a goal may ask for a speed.
    for (stop_s, goal, told) in [
        (0.3, 0.0, "-0.0999"),
        (0.25, 0.1, "0, not 0.1"),
        (0.25, -0.1, "0, not -0.1"),
    ] {
        let mut stops = along_x(1.75);
        stops[2].0 = stop_s;
        let goals = [vec![1.0, 0.0, goal, 0.0]];
        let verdict = judged(&plan(&[(None, stops)], &starts), &starts, &goals, |_| {});
        let [found] = &verdict.violations[..] else {
            panic!("{:?}", verdict.violations);
        };
        assert_eq!(found.rule, ContinuousRule::WrongGoal);
        let sentence = format!("agent 0 ends with speed along x {told}");
        assert!(found.sentence.starts_with(&sentence), "{found}");
    }
    // Any rate will do, and nobody says which.
    for goals in [&[][..], &[vec![1.0, 0.0, f64::NAN, f64::NAN]]] {
        let mut rolls = along_x(1.75);
        rolls[2].0 = 0.2;
        assert!(judged(&plan(&[(None, rolls)], &starts), &starts, goals, |_| {}).valid);
    }
}

#[test]
fn limits_are_those_of_controls_not_of_differences_of_knots() {
    let starts = [at(0.0)];
    // A leg at full speed is too sudden for knots alone, and what controls do is not.
    let mut sudden = along_x(1.75);
    sudden[0].1[0] = 3.0;
    let verdict = judged(&plan(&[(None, sudden)], &starts), &starts, &[], |_| {});
    let rules: Vec<ContinuousRule> = verdict.violations.iter().map(|one| one.rule).collect();
    assert_eq!(rules, [ContinuousRule::TooSudden, ContinuousRule::TooFast]);
    assert_eq!(
        verdict.violations[0].sentence,
        "agent 0 changes its speed along x by 3 m/s², beyond its limit of 2 m/s², in segment 0 at 0 s, \
         in [0, 0]"
    );
    let excess = verdict.violations[1].excess.unwrap();
    assert_eq!((excess.value, excess.limit), (0.75, 0.5));
}

#[test]
fn controls_lead_to_the_knots() {
    let starts = [at(0.0)];
    let exact = [0.0, 0.125, 0.25, 2.0, 2.125, 2.25];
    let x = [0.0, 1.0 / 64.0, 0.0625, 0.9375, 1.0 - 1.0 / 64.0, 1.0];
    let knots = |off: f64| -> Vec<Knot> {
        let pairs = exact.iter().zip(x);
        pairs
            .map(|(time_s, x)| knot(*time_s, x, if x > 0.5 { off } else { 0.0 }))
            .collect()
    };
    // Chords of an eighth of a second are 4 mm beside a parabola.
    let verdict = |off: f64, tolerance: f64| {
        let plan = plan(&[(Some(knots(off)), along_x(1.75))], &starts);
        judged(&plan, &starts, &[], |task| task.tolerance = tolerance)
    };
    assert!(verdict(0.0, 5e-3).valid);
    assert!(verdict(2e-3, 5e-3).valid);
    let found = verdict(0.01, 5e-3).violations;
    assert_eq!(found.len(), 1);
    assert_eq!(found[0].rule, ContinuousRule::OffControls);
    let excess = found[0].excess.unwrap();
    assert!(
        (0.01..0.011).contains(&excess.value) && (excess.limit - 5e-3).abs() < 1e-12,
        "{excess:?}"
    );
    assert!(found[0].time_s >= 2.0 && excess.place_m[0] > 0.9);
    let told = "the controls of agent 0 lead 0.01";
    assert!(found[0].sentence.starts_with(told), "{}", found[0]);
    let limit = " m beside its knots, more than 0.005 m, at ";
    assert!(found[0].sentence.contains(limit), "{}", found[0]);
    // A swerve where the controls lead straight on, between two samples of theirs.
    let mut swerves = knots(0.0);
    swerves.insert(3, knot(1.0, 0.4375, 0.05));
    let swerves = plan(&[(Some(swerves), along_x(1.75))], &starts);
    let found = judged(&swerves, &starts, &[], |_| {}).violations;
    let [found] = &found[..] else {
        panic!("{found:?}");
    };
    assert_eq!(
        (found.rule, found.time_s),
        (ContinuousRule::OffControls, 1.0)
    );
    assert!((found.excess.unwrap().value - 0.05).abs() < 1e-9, "{found}");
    // Few knots hide a detour from nobody.
    let detour = vec![
        (0.25, [0.0, 2.0]),
        (1.0, [0.0, 0.0]),
        (0.5, [0.0, -2.0]),
        (1.0, [0.0, 0.0]),
        (0.25, [0.0, 2.0]),
    ];
    let rest = vec![knot(0.0, 0.0, 0.0), knot(3.0, 0.0, 0.0)];
    let found = judged(
        &plan(&[(Some(rest), detour)], &starts),
        &starts,
        &[at(0.0)],
        |_| {},
    );
    assert_eq!(found.violations.len(), 1);
    assert_eq!(found.violations[0].rule, ContinuousRule::OffControls);
    assert!((found.violations[0].excess.unwrap().value - 0.625).abs() < 1e-3);
}

#[test]
fn one_has_controls_and_another_knots() {
    let starts = [at(0.0), vec![0.0, 2.0, 0.0, 0.0]];
    let stays = vec![knot(0.0, 0.0, 2.0)];
    let leaps = vec![knot(0.0, 0.0, 2.0), knot(2.0, 0.9, 2.0)];
    let both = |knots: &[Knot]| {
        let agents = [(None, along_x(1.75)), (Some(knots.to_vec()), Vec::new())];
        judged(&plan(&agents, &starts), &starts, &[], |_| {})
    };
    assert!(both(&stays).valid);
    let found = both(&leaps).violations;
    assert_eq!(found.len(), 1);
    // By its knots, which nothing that has a mass follows.
    assert_eq!(
        (found[0].rule, &found[0].agents[..]),
        (ContinuousRule::TooSudden, &[1][..])
    );
}

#[test]
fn robots_that_touch_may_be_off_by_what_chords_are() {
    let starts = [at(0.0), at(1.5)];
    let mut comes = along_x(1.75);
    // Ends where the discs touch, but for rounding and a chord: 0.25 mm of both, of place and heading.
    comes[1].0 += 2.0 * 2.4e-4;
    let stands = vec![knot(0.0, 1.5, 0.0)];
    let agents = [(None, comes.clone()), (Some(stands.clone()), Vec::new())];
    assert!(judged(&plan(&agents, &starts), &starts, &[], |_| {}).valid);
    comes[1].0 += 2.0 * 2e-5;
    let agents = [(None, comes), (Some(stands), Vec::new())];
    let found = judged(&plan(&agents, &starts), &starts, &[], |_| {}).violations;
    assert_eq!(found[0].rule, ContinuousRule::AgentContact);
}

#[test]
fn controls_of_another_robot_are_none() {
    let starts = [at(0.0)];
    let alone = plan(&[(None, along_x(1.75))], &starts);
    let verdict = judged(&alone, &starts, &[], |task| task.models = &[None]);
    assert_eq!(verdict.violations[0].rule, ContinuousRule::WrongControls);
    assert_eq!(
        verdict.violations[0].sentence,
        "agent 0 has controls, but its dynamics are unknown"
    );
    let mut controls = ControlPlan::default();
    controls.push_agent([(1.0, [0.0; 3])]).unwrap();
    let odd = alone.with_controls(controls).unwrap();
    let found = judged(&odd, &starts, &[], |_| {}).violations;
    assert_eq!(
        found[0].sentence,
        "agent 0 cannot be driven: segment 0 has a control of 3 numbers, but the robot takes 2"
    );
}

#[test]
fn headings_of_knots_are_held_against_the_controls_up_to_whole_turns() {
    let any = json!([null, null]);
    let robot: Robot = serde_json::from_value(json!({
        "footprint": {"radius_m": 0.25}, "dynamics": "fleetyard.unicycle/1", "has_heading": true,
        "state_limits": [any, any, any], "control_limits": [[-1.0, 1.0], [-2.0, 2.0]],
    }))
    .unwrap();
    let (model, disc, none) = (
        ControlModel::new(&robot).unwrap(),
        disc(),
        Obstacles::none(),
    );
    let mut round = ControlPlan::default();
    round.push_agent([(2.0, [0.5, 1.0])]).unwrap();
    let starts = [vec![0.0, 0.0, 0.0]];
    let driven = model.drive(&starts[0], round.of(0), 1 << 12).unwrap();
    let shapes = [&disc];
    let turned = |by: f64| {
        let mut plan = TrajectoryPlan::default();
        let turned = driven.knots.iter().map(|knot| Knot {
            heading_rad: knot.heading_rad.map(|heading| heading + by),
            ..*knot
        });
        plan.push_path(turned).unwrap();
        let plan = plan.with_controls(round.clone()).unwrap();
        let task = ContinuousTask {
            controls: Some(ControlTask {
                models: &[Some(&model)],
                starts: &starts,
                goals: &[],
                tolerance: 0.01,
                goal_rate: 1e-6,
            }),
            ..ContinuousTask::new(&shapes, &none)
        };
        let verdict = validated(&plan, &task, 10);
        let told = |found: &ContinuousViolation| (found.rule, found.sentence.clone());
        verdict.violations.first().map(told)
    };
    for turns in [-3.0, -1.0, 0.0, 1.0, 2.0] {
        assert_eq!(turned(turns * TAU), None);
        assert_eq!(turned(turns * TAU + 0.01), None);
        for by in [0.25, -0.25] {
            let (rule, sentence) = turned(turns * TAU + by).unwrap();
            assert_eq!(rule, ContinuousRule::OffControls);
            let told =
                "the controls of agent 0 lead 0.25 rad beside its knots, more than 0.01 rad, at";
            assert!(sentence.starts_with(told), "{sentence}");
        }
    }
}
