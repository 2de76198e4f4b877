//! `--task` of `run`, `compare`, `validate` and `simulate`: plans of every view, judged twice and
//! executed in the world.

use fleetyard_testkit::{Ended, INPUT, INVALID_PLAN, NO_PLAN, SUCCESS, USAGE, Yard, each, root};
use serde_json::{Value, json};

/// A world with a pillar, and a task in it.
fn yard(agents: &str) -> Yard {
    let yard = Yard::new();
    yard.write(
        "hall.world.json",
        r#"{"format": "fleetyard.world/1", "bounds_m": [0, 0, 4, 4],
            "obstacles": [{"rectangle": {"center": [2, 2], "size": [0.4, 0.4]}}]}"#,
    );
    task(&yard, "hall.task.json", agents);
    yard
}

/// Writes a task of robots that are discs with a radius of 0.25 m and do 1 m/s.
fn task(yard: &Yard, name: &str, agents: &str) {
    let task = format!(
        r#"{{"format": "fleetyard.task/1", "world": "hall.world.json",
            "robots": {{"disc": {{"footprint": {{"disc": {{"radius_m": 0.25}}}},
                                  "model": {{"single-integrator": {{"speed_m_per_s": 1}}}}}}}},
            "agents": [{agents}]}}"#
    );
    yard.write(name, task);
}

/// The first follows the second round a corner, in cells of 0.5 m.
fn round_a_corner() -> Yard {
    let yard = yard(
        r#"{"start": [0.25, 0.25], "goal": [1.25, 0.25]}, {"start": [0.75, 0.25], "goal": [0.75, 1.25]}"#,
    );
    yard.write(
        "cells.json",
        r#"{"format": "fleetyard.plan/1", "rows": 8, "cols": 8, "paths": [
            [[7, 0], [7, 1], [7, 2]], [[7, 1], [6, 1], [5, 1]]]}"#,
    );
    yard
}

/// Two robots with parallel ways of 3 m.
fn side_by_side() -> Yard {
    yard(r#"{"start": [0.5, 0.5], "goal": [3.5, 0.5]}, {"start": [0.5, 3.5], "goal": [3.5, 3.5]}"#)
}

fn read(yard: &Yard, file: &str) -> Value {
    serde_json::from_slice(&yard.read(file)).unwrap()
}

/// Writes a plan on the derived roadmap in which every robot goes straight to its goal, in so many
/// seconds; `swapped` exchanges starts and goals of the second.
fn drive(yard: &Yard, seconds: [f64; 2]) {
    yard.line("world roadmap hall.task.json --builder tangent --name r")
        .expect(SUCCESS);
    let view = read(yard, "r.view.json");
    let paths: Vec<Value> = (0..2)
        .map(|agent| {
            json!([
                [view["starts"][agent], 0],
                [view["goals"][agent], seconds[agent]]
            ])
        })
        .collect();
    let plan = json!({"format": "fleetyard.roadmap-plan/1",
        "roadmap_digest": view["roadmap_digest"], "paths": paths});
    yard.write("visits.json", plan.to_string());
}

const ROADMAP: &str = "--task hall.task.json --view r.view.json visits.json";

fn text(ended: &Ended) -> Vec<&str> {
    ended.stdout.lines().collect()
}

#[test]
fn a_plan_on_a_grid_is_judged_by_rules_and_by_footprints() {
    let yard = round_a_corner();
    yard.line("world grid hall.task.json").expect(SUCCESS);
    let ended = yard
        .line("validate --task hall.task.json --representation grid cells.json")
        .expect(INVALID_PLAN);
    assert_eq!(
        text(&ended)[..2],
        ["on the grid: valid", "in the world: INVALID: 1 violations"]
    );
    let overlap = "  agent-contact: agents 0 and 1 overlap from 0.000001";
    assert!(text(&ended)[2].starts_with(overlap), "{ended}");
    assert_eq!(
        text(&ended)[3..],
        [
            "sum of costs 2.00 s",
            "makespan     1.00 s",
            "path length  2.00 m",
            "in steps     4, the last at 2",
        ]
    );
    // A step is as long as a robot needs for a cell, if nobody says otherwise.
    let slow = yard
        .line("validate --task hall.task.json --representation grid --step 1 cells.json")
        .expect(INVALID_PLAN);
    assert_eq!(
        text(&slow)[3..5],
        ["sum of costs 4.00 s", "makespan     2.00 s"]
    );
    // On the same cells the strict rule names it; wider cells are another instance.
    let strict = "validate --task hall.task.json --separation strict cells.json";
    let named = yard
        .line(&format!("{strict} --view hall.grid.json"))
        .expect(INVALID_PLAN);
    assert!(
        text(&named)[1]
            .starts_with("  corner-follow: agent 0 follows agent 1 round a corner at (7, 1)"),
        "{named}"
    );
    let other = yard.line(strict).expect(INPUT);
    assert!(
        other.stderr.contains("but hall.world has 6 and 6")
            || other.stderr.contains("8 rows and 8 columns"),
        "{other}"
    );
    assert!(other.stderr.contains("--view"), "{other}");
    // The same rule without a task.
    yard.line("validate --map hall.map --scen hall.scen --agents 2 cells.json")
        .expect(SUCCESS);
    let bare = "validate --map hall.map --scen hall.scen --agents 2 --separation strict cells.json";
    let bare = yard.line(bare).expect(INVALID_PLAN);
    assert!(bare.stdout.contains("corner-follow"), "{bare}");
}

#[test]
fn planned_cells_are_valid_in_the_world_where_cells_are_wide() {
    let yard = side_by_side();
    yard.line("world grid hall.task.json --separation strict")
        .expect(SUCCESS);
    yard.line("run -m hall.map -s hall.scen -n 2 -p cbs --plan-out p.json")
        .expect(SUCCESS);
    let task = "--task hall.task.json --separation strict p.json";
    let judged = yard
        .line(&format!("validate {task} --format json"))
        .expect(SUCCESS)
        .json();
    assert_eq!(judged["representation"], "grid");
    assert_eq!(judged["view"]["valid"], true);
    assert_eq!(judged["world"]["valid"], true);
    let about = read(&yard, "hall.grid.json");
    assert_eq!(judged["view_digest"], about["instance_digest"]);
    let length = judged["costs"]["length_m"].as_f64().unwrap();
    let steps = judged["steps"]["sum_of_costs"].as_f64().unwrap();
    assert!(length > 0.0 && length <= steps * about["cell_m"].as_f64().unwrap() + 1e-9);
    for conduct in [
        "",
        "--policy adg",
        "--tier contact",
        "--tier contact --policy adg",
    ] {
        let line = format!("simulate {task} --until-done {conduct} --format json");
        let executed = yard.line(&line).expect(SUCCESS).json();
        assert_eq!(executed["arrived"], 2, "{conduct}: {executed}");
        assert_eq!(executed["contacts"], 0, "{conduct}: {executed}");
        assert_eq!(executed["judged"]["plan_digest"], judged["plan_digest"]);
    }
}

#[test]
fn a_plan_on_a_roadmap_is_judged_by_distances_and_by_footprints() {
    let yard = side_by_side();
    drive(&yard, [3.0, 3.0]);
    let ended = yard.line(&format!("validate {ROADMAP}")).expect(SUCCESS);
    assert_eq!(
        text(&ended),
        [
            "on the roadmap: valid",
            "in the world: valid",
            "sum of costs 6.00 s",
            "makespan     3.00 s",
            "path length  6.00 m",
        ]
    );
    // The parameters derive the same view.
    let again =
        "validate --task hall.task.json --representation roadmap --builder tangent visits.json";
    assert_eq!(yard.line(again).expect(SUCCESS).stdout, ended.stdout);
    for conduct in [
        "",
        "--policy adg",
        "--tier contact",
        "--tier contact --policy adg",
    ] {
        let line =
            format!("simulate {ROADMAP} --until-done {conduct} --trace t.fyt --picture p.svg");
        let executed = yard.line(&line).expect(SUCCESS);
        assert_eq!(
            text(&executed)[0],
            "plan              valid on a roadmap, valid in the world"
        );
        assert!(executed.stdout.contains("all 2"), "{conduct}: {executed}");
    }
    yard.line("trace info t.fyt").expect(SUCCESS);
    // Slower than the common speed is no stop-go, and faster is nothing.
    drive(&yard, [3.0, 4.0]);
    let slow = yard
        .line(&format!("validate {ROADMAP}"))
        .expect(INVALID_PLAN);
    assert!(
        slow.stdout.contains("too-slow: agent 1 takes 4 s"),
        "{slow}"
    );
    yard.line(&format!("validate {ROADMAP} --pace slower"))
        .expect(SUCCESS);
    drive(&yard, [3.0, 2.0]);
    let fast = yard
        .line(&format!("validate {ROADMAP} --pace slower"))
        .expect(INVALID_PLAN);
    assert!(
        fast.stdout.contains("too-fast: agent 1 takes 2 s"),
        "{fast}"
    );
}

#[test]
fn robots_that_meet_head_on_are_named() {
    let yard = yard(
        r#"{"start": [0.5, 0.5], "goal": [3.5, 0.5]}, {"start": [3.5, 0.5], "goal": [0.5, 0.5]}"#,
    );
    drive(&yard, [3.0, 3.0]);
    let ended = yard
        .line(&format!("validate {ROADMAP}"))
        .expect(INVALID_PLAN);
    assert!(
        text(&ended)[1].starts_with("  head-on: agents 0 and 1 meet head-on"),
        "{ended}"
    );
    assert!(
        ended
            .stdout
            .contains("agent-contact: agents 0 and 1 overlap"),
        "{ended}"
    );
    // It is executed all the same, as far as it can be.
    let executed = yard
        .line(&format!("simulate {ROADMAP} --format json"))
        .expect(SUCCESS)
        .json();
    assert_eq!(executed["contacts_agent_agent"], 1);
    assert_eq!(executed["judged"]["view"]["valid"], false);
}

#[test]
fn a_plan_in_the_plane_is_judged_by_the_whole_task() {
    let yard = side_by_side();
    let plan = |seconds: f64| {
        let paths = json!([
            [[0, 0.5, 0.5], [seconds, 3.5, 0.5]],
            [[0, 0.5, 3.5], [3, 3.5, 3.5]]
        ]);
        let plan = json!({"format": "fleetyard.trajectories/1", "paths": paths});
        yard.write("knots.json", plan.to_string());
    };
    plan(3.0);
    let line = "validate --task hall.task.json knots.json";
    let ended = yard.line(line).expect(SUCCESS);
    assert_eq!(text(&ended)[..2], ["valid", "sum of costs 6.00 s"]);
    let json = yard
        .line(&format!("{line} --format json"))
        .expect(SUCCESS)
        .json();
    assert_eq!(json["representation"], "continuous");
    assert_eq!(
        (&json["view"], &json["steps"]),
        (&Value::Null, &Value::Null)
    );
    yard.line(
        "simulate --task hall.task.json knots.json --fail-on contacts,unfinished --until-done",
    )
    .expect(SUCCESS);
    plan(2.0);
    let fast = yard.line(line).expect(INVALID_PLAN);
    assert!(
        fast.stdout.contains("too-fast: agent 0 moves at 1.5 m/s"),
        "{fast}"
    );
}

/// The digest that a plan file has of its paths.
fn plan_digest(yard: &Yard, file: &str) -> String {
    let digest = &read(yard, file)["plan_digest"];
    digest.as_str().unwrap().to_owned()
}

#[test]
fn plans_of_views_become_trajectories_and_come_back() {
    let yard = side_by_side();
    let task = "--task hall.task.json --separation strict";
    yard.line(&format!("run {task} -p cbs --plan-out cells.json"))
        .expect(SUCCESS);
    let ended = yard
        .line(&format!("convert {task} cells.json knots.json"))
        .expect(SUCCESS);
    assert_eq!(ended.stdout, "knots.json\n");
    let knots = read(&yard, "knots.json");
    assert_eq!(knots["format"], "fleetyard.trajectories/1");
    // Who made the plan is kept.
    assert_eq!(knots["planner"], read(&yard, "cells.json")["planner"]);
    yard.line(&format!(
        "convert {task} --representation grid knots.json back.json"
    ))
    .expect(SUCCESS);
    assert_eq!(
        plan_digest(&yard, "back.json"),
        plan_digest(&yard, "cells.json")
    );
    assert_eq!(
        read(&yard, "back.json")["planner"],
        read(&yard, "cells.json")["planner"]
    );
    yard.line(&format!("validate {task} back.json"))
        .expect(SUCCESS);
    // Of other tools' formats, too.
    yard.line(&format!(
        "convert {task} knots.json paths.txt --to paths-txt"
    ))
    .expect(SUCCESS);
    yard.line(&format!("convert {task} paths.txt again.json"))
        .expect(SUCCESS);
    assert_eq!(
        plan_digest(&yard, "again.json"),
        plan_digest(&yard, "knots.json")
    );
    // A step of another length is another way.
    yard.line(&format!("convert {task} --step 2 cells.json slow.json"))
        .expect(SUCCESS);
    let slow = yard
        .line(&format!("convert {task} slow.json no.json --to plan"))
        .expect(INPUT);
    assert!(slow.stderr.contains("agent 0 "), "{slow}");
    drive(&yard, [3.0, 3.0]);
    let view = "--task hall.task.json --view r.view.json";
    yard.line(&format!("convert {view} visits.json way.json"))
        .expect(SUCCESS);
    let ended = yard
        .line(&format!("convert {view} way.json stops.json"))
        .expect(SUCCESS);
    assert_eq!(ended.stdout, "stops.json\nstops.roadmap.json\n");
    yard.line(&format!("validate {view} stops.json"))
        .expect(SUCCESS);
    yard.line(&format!("convert {view} stops.json twice.json"))
        .expect(SUCCESS);
    assert_eq!(
        plan_digest(&yard, "twice.json"),
        plan_digest(&yard, "way.json")
    );
    task_of_one(&yard);
    let rows = [
        (
            format!("convert {view} knots.json no.json"),
            INPUT,
            "which is neither vertex",
        ),
        (
            format!("convert {task} --representation grid way.json no.json"),
            INPUT,
            "which is not at the end of a step",
        ),
        (
            format!("convert {task} --step 3 --representation grid way.json no.json"),
            INPUT,
            "from the middle of a cell",
        ),
        (
            format!("convert {task} way.json no.json"),
            USAGE,
            "--representation grid, --representation roadmap or --view FILE",
        ),
        (
            format!("convert {task} cells.json no.json --to roadmap-plan"),
            INPUT,
            "this is a plan on a grid, and roadmap-plan is one on a roadmap",
        ),
        (
            format!("convert {task} cells.json no.txt --to paths-txt"),
            INPUT,
            "leave out --task",
        ),
        (
            format!("convert {view} cells.json no.json"),
            INPUT,
            "one of the plans is on a grid, and --view asks for one on a roadmap",
        ),
        (
            format!("convert {task} cells.json no.scen --to scen"),
            USAGE,
            "with --task plans are converted",
        ),
        (
            format!("convert {task} cells.json no.yaml"),
            USAGE,
            "does not say which format to write",
        ),
        (
            "convert --task one.task.json --representation grid knots.json no.json".to_owned(),
            INPUT,
            "the plan has 2 paths, and the task 1 agents",
        ),
        (
            "convert cells.json no.json --separation strict".to_owned(),
            USAGE,
            "name the task with --task FILE",
        ),
        (
            format!("convert {task} cells.json cells.json"),
            INPUT,
            "one of the files that are read",
        ),
    ];
    each(rows, |(line, exit, part)| {
        let ended = yard.line(&line).expect(exit);
        assert!(ended.stderr.contains(part), "{line}: {ended}");
        assert_eq!(ended.stdout, "", "{line}");
        assert!(!yard.path("no.json").exists(), "{line}");
    });
}

/// Writes a task with the first robot alone.
fn task_of_one(yard: &Yard) {
    task(
        yard,
        "one.task.json",
        r#"{"start": [0.5, 0.5], "goal": [3.5, 0.5]}"#,
    );
}

#[test]
fn what_is_wrong_is_said_with_a_way_out() {
    let yard = round_a_corner();
    yard.line("world grid hall.task.json").expect(SUCCESS);
    yard.line("world grid hall.task.json --connectivity 8 --name eight")
        .expect(SUCCESS);
    yard.write(
        "outside.json",
        r#"{"format": "fleetyard.plan/1", "rows": 8, "cols": 8, "paths": [[[7, 0], [8, 0]], [[7, 1]]]}"#,
    );
    yard.write(
        "knots.json",
        r#"{"format": "fleetyard.trajectories/1", "paths": [[[0, 0.25, 0.25]]]}"#,
    );
    task(
        &yard,
        "crowded.task.json",
        r#"{"start": [0.52, 0.52], "goal": [3, 3]}, {"start": [0.98, 0.98], "goal": [3, 1]}"#,
    );
    task(
        &yard,
        "pillar.task.json",
        r#"{"start": [0.5, 0.5], "goal": [1.9, 2]}"#,
    );
    let rows = [
        (
            "validate --task hall.task.json --representation roadmap cells.json",
            INPUT,
            "this is a plan on a grid, and --representation asks for one on a roadmap",
        ),
        (
            "validate --task hall.task.json --view hall.grid.json knots.json",
            INPUT,
            "this is a plan in the plane, and --view asks for one on a grid",
        ),
        (
            "validate --task hall.task.json --view hall.world.json cells.json",
            INPUT,
            "hint: a view file is written by `fleetyard world grid`",
        ),
        (
            "validate --task hall.task.json --view eight.grid.json cells.json",
            INPUT,
            "8 rows and 8 columns",
        ),
        (
            "validate --task hall.task.json hall.map",
            INPUT,
            "this is no plan but map",
        ),
        (
            "validate --task crowded.task.json cells.json",
            INPUT,
            "the starts of agents 0 and 1 snap",
        ),
        (
            "validate --task pillar.task.json cells.json",
            INPUT,
            "the goal of agent 0 at (1.9, 2) is outside of the free space",
        ),
        (
            "validate --task crowded.task.json --view hall.grid.json cells.json",
            INPUT,
            "make it again with `fleetyard world grid crowded.task.json`",
        ),
        (
            "validate --task hall.task.json --map hall.map cells.json",
            USAGE,
            "cannot be used with",
        ),
        (
            "validate --task hall.task.json --view hall.grid.json --vertices 5 cells.json",
            USAGE,
            "cannot be used with",
        ),
        ("validate --representation grid cells.json", USAGE, "--task"),
        (
            "simulate cells.json --map hall.map --vertices 5",
            USAGE,
            "--task",
        ),
        (
            "simulate cells.json --task hall.task.json --model agv",
            USAGE,
            "cannot be used with",
        ),
        (
            "simulate --task hall.task.json outside.json",
            INPUT,
            "agent 0 is not on the map at time 1",
        ),
    ];
    each(rows, |(line, exit, part)| {
        let ended = yard.line(line).expect(exit);
        assert!(ended.stderr.contains(part), "{line}: {ended}");
        assert_eq!(ended.stdout, "", "{line}");
    });
    let outside = yard
        .line("validate --task hall.task.json outside.json")
        .expect(INVALID_PLAN);
    assert!(
        outside
            .stdout
            .contains("out-of-bounds: agent 0 is outside the map"),
        "{outside}"
    );
    assert!(
        outside
            .stdout
            .contains("in the world: not judged, agent 0 is not on the map"),
        "{outside}"
    );
}

#[test]
fn planners_of_every_representation_plan_for_a_task() {
    // Robots that leave each other alone, so that every planner succeeds in the world.
    let yard = yard(
        r#"{"start": [0.25, 0.25], "goal": [3.75, 0.75]}, {"start": [0.25, 3.75], "goal": [3.25, 3.75]}"#,
    );
    for (planner, representation) in [
        ("lacam", "grid"),
        ("roadmap-pp", "roadmap"),
        ("plane-pp", "continuous"),
    ] {
        // The view is the one that the planner claims.
        let command = format!(
            "run --task hall.task.json -p {planner} --budget 60s --format json \
             --plan-out {planner}.json --trace-out {planner}.trace --picture {planner}.svg"
        );
        let record = yard.line(&command).expect(SUCCESS).json();
        assert_eq!(record["instance"]["representation"], representation);
        assert_eq!(record["judged"]["world"]["valid"], true, "{planner}");
        assert_eq!(record["execution"]["contacts"], 0, "{planner}");
        let digest = &record["execution"]["trace_digest"];
        assert_eq!(
            yard.line(&command).expect(SUCCESS).json()["execution"]["trace_digest"],
            *digest
        );
        assert!(yard.read(&format!("{planner}.svg")).starts_with(b"<svg"));
        // The other commands say the same of the plan that was written.
        let judge = format!("--task hall.task.json --representation {representation}");
        let judged = yard
            .line(&format!("validate {judge} {planner}.json --format json"))
            .expect(SUCCESS)
            .json();
        assert_eq!(judged["view_digest"], record["instance_digest"]);
        assert_eq!(judged["plan_digest"], record["plan_digest"]);
        assert_eq!(judged["costs"], record["judged"]["costs"]);
        let driven = yard
            .line(&format!("simulate {judge} {planner}.json --format json"))
            .expect(SUCCESS)
            .json();
        assert_eq!(driven["trace_digest"], *digest, "{driven}");
    }
    let refused = yard.line("run --task hall.task.json -p lacam --representation roadmap");
    let refused = refused.expect(NO_PLAN).stderr;
    assert!(
        refused.contains("planner `lacam` does not support `roadmap`"),
        "{refused}"
    );
    assert!(
        refused.contains("hint: planners that do: roadmap-pp, "),
        "{refused}"
    );
}

/// Discs that planners let touch: by order they need no room if they are driven exactly.
#[test]
fn plans_of_every_view_are_executed_by_time_and_by_order() {
    let yard = yard(
        r#"{"start": [0.75, 0.75], "goal": [3.25, 3.25]}, {"start": [3.25, 0.75], "goal": [0.75, 3.25]},
           {"start": [0.75, 2], "goal": [3.25, 2]}"#,
    );
    for (planner, view) in [
        ("lacam", "grid"),
        ("roadmap-pp", "roadmap"),
        ("plane-pp", "continuous"),
    ] {
        let plan =
            format!("run --task hall.task.json -p {planner} --budget 60s --plan-out {view}.json");
        yard.line(&plan);
        let line = format!("simulate --task hall.task.json {view}.json --until-done --format json");
        let planned = yard.line(&line).expect(SUCCESS).json();
        let planned_s = planned["judged"]["costs"]["makespan_s"].as_f64().unwrap();
        for tier in ["kinematic", "contact"] {
            let by_order = format!("{line} --policy adg --tier {tier}");
            let executed = yard.line(&by_order).expect(SUCCESS).json();
            assert_eq!(executed["arrived"], 3, "{view}, {tier}: {executed}");
            if tier == "kinematic" {
                assert_eq!(executed["contacts"], 0, "{view}: {executed}");
                let took_s = executed["makespan_s"].as_f64().unwrap();
                assert!(
                    took_s < 1.3 * planned_s + 1.0,
                    "{view}: {took_s} s of {planned_s} s"
                );
            }
            let late =
                format!("{by_order} --delay bernoulli:0.3,2s --messages 0s,0.5s,0.2 --seed 4");
            let late = yard.line(&late).expect(SUCCESS).json();
            assert_eq!(late["arrived"], 3, "{view}, {tier}: {late}");
            if tier == "kinematic" {
                assert_eq!(late["contacts"], 0, "{view}: {late}");
            }
        }
    }
    // Robots with tolerances need room, which the error tells.
    yard.write(
        "slow.task.json",
        String::from_utf8(yard.read("hall.task.json"))
            .unwrap()
            .replace(
                r#"{"single-integrator": {"speed_m_per_s": 1}}"#,
                r#""double-integrator""#,
            ),
    );
    let cells = json!({"format": "fleetyard.plan/1", "rows": 8, "cols": 8, "paths": [
        [[6, 1], [6, 2], [6, 3]], [[6, 6]], [[7, 2]]]});
    yard.write("near.json", cells.to_string());
    let line = "simulate --task slow.task.json near.json --policy adg";
    let refused = yard.line(line).expect(INPUT);
    assert!(
        refused.stderr.contains(
            "with too little room for any order: their controllers need 11 mm between footprints"
        ),
        "{refused}"
    );
    assert!(
        refused
            .stderr
            .contains("near.json: agents 0, 2 pass each other"),
        "{refused}"
    );
    assert!(
        refused
            .stderr
            .contains("hint: plan with that much more room"),
        "{refused}"
    );
    let tight = yard.line(&format!("{line} --tight --format json"));
    assert_eq!(tight.expect(SUCCESS).json()["arrived"], 3);
}

/// On a roadmap quadrupeds keep the headings that the task has at their starts.
#[test]
fn quadrupeds_pass_each_other_as_the_rectangles_that_they_are() {
    let lanes = |first: f64, second: f64| {
        let yard = side_by_side();
        let task = json!({"format": "fleetyard.task/1", "world": "hall.world.json",
            "robots": {"dog": "go2"},
            "agents": [{"start": [0.5, 0.5, first], "goal": [3.5, 0.5]},
                       {"start": [3.5, 1.0, second], "goal": [0.5, 1.0]}]});
        yard.write("hall.task.json", task.to_string());
        drive(&yard, [3.0, 3.0]);
        yard
    };
    let yard = lanes(0.0, std::f64::consts::PI);
    for conduct in [
        "",
        "--policy adg",
        "--tier contact",
        "--tier contact --policy adg",
    ] {
        let line = format!("simulate {ROADMAP} --until-done {conduct} --format json");
        let executed = yard.line(&line).expect(SUCCESS).json();
        assert_eq!(executed["arrived"], 2, "{conduct}: {executed}");
        assert_eq!(executed["contacts"], 0, "{conduct}: {executed}");
    }
    let knots = json!({"format": "fleetyard.trajectories/1", "paths": [
        [[0, 0.5, 0.5, 0], [3, 3.5, 0.5, 0]],
        [[0, 3.5, 1.0, std::f64::consts::PI], [3, 0.5, 1.0, std::f64::consts::PI]]]});
    yard.write("knots.json", knots.to_string());
    let line = "simulate --task hall.task.json knots.json --policy adg --format json";
    assert_eq!(yard.line(line).expect(SUCCESS).json()["contacts"], 0);
    let across = lanes(1.57, 1.57).line(&format!("simulate {ROADMAP} --policy adg"));
    let across = across.expect(INPUT).stderr;
    assert!(across.contains("agents 0 and 1 collide at 1."), "{across}");
    assert!(
        across.contains("of the plan, near (2.000, 0.750) m"),
        "{across}"
    );
}

#[test]
fn a_table_compares_the_views_of_a_task() {
    let yard = Yard::new();
    let rooms = root()
        .join("maps/two-rooms.task.json")
        .display()
        .to_string();
    let command =
        &format!("compare --task {rooms} -p lacam -p roadmap-pp -p plane-pp --budget 60s");
    let ended = yard.line(&format!("{command} --format json"));
    let report = ended.json();
    assert_eq!(report["agents"], 3);
    let rows = report["rows"].as_array().unwrap();
    let row = |number: usize, key: &str| rows[number][key].clone();
    let asked: Vec<_> = (0..rows.len())
        .map(|number| (row(number, "view"), row(number, "planner")))
        .collect();
    let wanted = [
        ("grid", "lacam"),
        ("S", "roadmap-pp"),
        ("D", "roadmap-pp"),
        ("SD", "roadmap-pp"),
        ("continuous", "plane-pp"),
    ];
    assert_eq!(
        asked,
        wanted.map(|(view, planner)| (json!(view), json!(planner)))
    );
    // On the grid one follows the other round a corner: by the rules it may, in the world they touch.
    assert_eq!(row(0, "valid_in_view"), true);
    assert_eq!(row(0, "valid_in_world"), false);
    ended.expect(NO_PLAN);
    for other in &rows[1..] {
        assert_eq!(other["failure"], Value::Null, "{other}");
        assert_eq!(other["valid_in_world"], true, "{other}");
        assert_eq!(other["contacts"], 0, "{other}");
        assert!(other["length_m"].as_f64() < row(0, "length_m").as_f64());
    }
    // A planner is not to blame for what its view does not show.
    assert_eq!(report["trials"][0]["claims"][0]["agrees"], true);
    // In text: the same rows.
    let text = yard.line(command).stdout;
    for (view, planner) in wanted {
        let is_row = |line: &str| line.starts_with(view) && line.contains(planner);
        assert!(text.lines().any(is_row), "{text}");
    }
    // Views that no planner plans on, and robots that it does not know.
    let none = yard
        .line(&format!(
            "compare --task {rooms} -p plane-pp --views grid,S"
        ))
        .expect(NO_PLAN);
    assert!(
        none.stderr.contains("plans on none of the views"),
        "{}",
        none.stderr
    );
    let window = root().join("maps/window.task.json").display().to_string();
    let unknown = yard.run(&["compare", "--task", &window, "-p", "plane-pp"]);
    assert!(
        unknown
            .stdout
            .contains("`dynamics:fleetyard.double-integrator/1`"),
        "{}",
        unknown.stdout
    );
}

/// A roadmap file is one view of its task, beside others.
#[test]
fn a_table_compares_planners_on_a_roadmap_that_is_given() {
    let yard = side_by_side();
    let roadmap = json!({"format": "fleetyard.roadmap/1", "directed": false,
        "vertices": [[0.5, 0.5], [3.5, 0.5], [0.5, 3.5], [3.5, 3.5]], "edges": [[0, 1], [2, 3], [0, 2]]});
    yard.write("lanes.roadmap.json", roadmap.to_string());
    let compare = "compare --task hall.task.json --roadmap lanes.roadmap.json";
    let line = format!("{compare} -p roadmap-pp -p plane-pp --format json");
    let report = yard.line(&line).expect(SUCCESS).json();
    let rows = report["rows"].as_array().unwrap().iter();
    let rows: Vec<Value> = rows
        .map(|row| {
            json!([
                row["view"],
                row["planner"],
                row["soc_s"],
                row["valid_in_world"]
            ])
        })
        .collect();
    let wanted = json!([
        ["continuous", "plane-pp", 6.0, true],
        ["lanes.roadmap.json", "roadmap-pp", 6.0, true]
    ]);
    assert_eq!(Value::from(rows), wanted);
    // Who also says that it is one says nothing else.
    let run = "run --task hall.task.json --roadmap lanes.roadmap.json -p roadmap-pp";
    yard.line(&format!("{run} --representation roadmap"))
        .expect(SUCCESS);
    let other = yard.line(&format!("{run} --representation grid"));
    let other = other.expect(USAGE).stderr;
    assert!(
        other.contains(
            "--representation grid asks for another view than --roadmap, which is on a roadmap"
        ),
        "{other}"
    );
    let off = json!({"format": "fleetyard.roadmap/1", "directed": false, "vertices": [[0.5, 0.5], [3, 0.5]], "edges": [[0, 1]]});
    yard.write("lanes.roadmap.json", off.to_string());
    let refused = yard.line(&format!("{compare} -p roadmap-pp")).expect(INPUT);
    assert!(refused.stderr.contains("agent"), "{refused}");
}
