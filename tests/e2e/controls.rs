//! Plans with controls, from the planner to the simulator: what they lead to is judged and executed,
//! and lies are told.

use fleetyard_testkit::{Ended, INPUT, INVALID_PLAN, PLUGIN, SUCCESS, Yard, c_library, have, root};
use serde_json::{Value, json};

/// A floor with a pillar beside the ways.
fn yard(robot: &str, agents: &str) -> Yard {
    let yard = Yard::new();
    yard.write(
        "hall.world.json",
        r#"{"format": "fleetyard.world/1", "bounds_m": [0, 0, 6, 4],
            "obstacles": [{"rectangle": {"center": [3, 2], "size": [0.4, 0.4]}}]}"#,
    );
    let task = format!(
        r#"{{"format": "fleetyard.task/1", "world": "hall.world.json", "agents": [{agents}],
            "robots": {{"robot": {{"footprint": {{"disc": {{"radius_m": 0.25}}}}, "model": {robot}}}}}}}"#
    );
    yard.write("hall.task.json", task);
    yard
}

const CART: &str = r#""unicycle-2""#;
const CARTS: &str = r#"{"start": [1, 1, 0.5], "goal": [5, 1.2, 3.14]},
                       {"start": [5, 0.5, 3], "goal": [1, 0.5]}"#;
const PUCK: &str = r#"{"single-integrator": {"speed_m_per_s": 1}}"#;
const WAY: &str = r#"{"start": [1, 1], "goal": [5, 1]}, {"start": [5, 3], "goal": [1, 3]}"#;

fn read(yard: &Yard, file: &str) -> Value {
    serde_json::from_slice(&yard.read(file)).unwrap()
}

#[test]
fn controls_alone_are_planned_judged_and_executed() {
    if !have("python3") {
        return;
    }
    let yard = yard(CART, CARTS);
    let planner = root().join("plugins/examples/python/turn_drive.py");
    let planner = planner.display();
    let ended = yard.line(&format!(
        "run --task hall.task.json -p {planner} --format json --plan-out plan.json --execute \
         --picture plan.svg"
    ));
    let record = ended.expect(SUCCESS).json();
    assert_eq!(record["verdict"]["valid"], true, "{record}");
    assert_eq!(record["execution"]["contacts"], 0, "{record}");
    // The host has made knots of it, and kept the controls.
    let plan = read(&yard, "plan.json");
    let (paths, controls) = (&plan["paths"], &plan["controls"]);
    assert_eq!(controls[0][0].as_array().unwrap().len(), 3, "{plan}");
    assert!(paths[0].as_array().unwrap().len() > 20);
    assert_eq!(plan["plan_digest"], record["plan_digest"]);
    for line in [
        "validate --task hall.task.json plan.json",
        "simulate --task hall.task.json plan.json --fail-on contacts --until-done",
        "convert plan.json again.json",
    ] {
        yard.line(line).expect(SUCCESS);
    }
    assert_eq!(read(&yard, "again.json")["controls"], *controls);
    // A file of controls alone leads to the same knots.
    let alone = json!({"format": "fleetyard.trajectories/1", "controls": controls});
    yard.write("alone.json", alone.to_string());
    yard.line("validate --task hall.task.json alone.json")
        .expect(SUCCESS);
    yard.line("convert --task hall.task.json --representation continuous alone.json led.json")
        .expect(SUCCESS);
    assert_eq!(read(&yard, "led.json")["plan_digest"], plan["plan_digest"]);
    let ended = yard
        .line("validate alone.json --world hall.world.json --radius 0.25")
        .expect(INPUT);
    assert!(ended.stderr.contains("--task FILE"), "{ended}");
    // With knots that are none of theirs, limits that are exceeded, and no rest at the end.
    let changed = |change: &dyn Fn(&mut Value)| {
        let mut plan = plan.clone();
        plan.as_object_mut().unwrap().remove("plan_digest");
        change(&mut plan);
        yard.write("changed.json", plan.to_string());
        let ended = yard.line("validate --task hall.task.json changed.json");
        ended.expect(INVALID_PLAN).stdout
    };
    let text = changed(&|plan| plan["paths"][1][1][2] = json!(0.51));
    assert!(
        text.contains("off-controls: the controls of agent 1 lead 0.0"),
        "{text}"
    );
    let text = changed(&|plan| plan["controls"][0][0][2] = json!(0.26));
    assert!(
        text.contains("turns-too-suddenly: agent 0 changes its turn rate by"),
        "{text}"
    );
    let text = changed(&|plan| {
        plan["controls"][1].as_array_mut().unwrap().pop();
    });
    assert!(text.contains("wrong-goal: agent 1 ends with"), "{text}");
}

/// A car with a trailer and a car, from the task to the trace.
#[test]
fn a_truck_and_a_car_share_a_yard() {
    let yard = Yard::new();
    for file in ["yard.world.json", "yard.task.json"] {
        yard.write(file, std::fs::read(root().join("maps").join(file)).unwrap());
    }
    let run = "run --task yard.task.json -p db-cbs --nodes 30000 --budget 60s --format json \
               --plan-out plan.json --execute --picture plan.svg";
    let record = yard.line(run).expect(SUCCESS).json();
    assert_eq!(record["verdict"]["valid"], true, "{record}");
    let execution = &record["execution"];
    assert_eq!(
        (&execution["agents"], &execution["contacts"]),
        (&json!(2), &json!(0)),
        "{record}"
    );
    let again = yard.line(run).expect(SUCCESS).json();
    assert_eq!(again["plan_digest"], record["plan_digest"]);
    assert_eq!(
        again["execution"]["trace_digest"],
        execution["trace_digest"]
    );
    for line in [
        "validate --task yard.task.json plan.json",
        "simulate --task yard.task.json plan.json --fail-on contacts --until-done --trace yard.trace",
    ] {
        yard.line(line).expect(SUCCESS);
    }
    // The trailer is the last body.
    let info = yard.line("trace info yard.trace").expect(SUCCESS).stdout;
    assert!(info.contains("trailer 2, towed"), "{info}");
    yard.line("trace export yard.trace --html yard.html")
        .expect(SUCCESS);
    let page = String::from_utf8(yard.read("yard.html")).unwrap();
    assert!(page.contains("\"agents\":2,") && page.contains("\"cars\":[[2,0]]"));
    let refused = yard
        .line("simulate --task yard.task.json plan.json --policy adg")
        .expect(INPUT);
    assert!(refused.stderr.contains("agent 0 is a car"), "{refused}");
    let task = read(&yard, "yard.task.json");
    let with = |place: &str, numbers: Value| {
        let mut task = task.clone();
        task["agents"][0][place] = numbers;
        yard.write("other.task.json", task.to_string());
        yard.line("validate --task other.task.json plan.json")
    };
    let ended = with("start", json!([0.9, 0.7, 0.0, 1.0])).expect(INPUT);
    assert!(
        ended
            .stderr
            .contains("bends the joint to its trailer by 1.0000 rad"),
        "{ended}"
    );
    let ended = with("goal", json!([5.2, 0.7, 0.0, 0.5])).expect(INVALID_PLAN);
    assert!(
        ended
            .stdout
            .contains("the trailer of agent 0 ends turned by"),
        "{ended}"
    );
    let ended = with("start", json!([0.5, 0.7, 0.0, 0.0])).expect(INPUT);
    assert!(ended.stderr.contains("has its trailer"), "{ended}");
}

#[test]
fn files_with_odd_controls_are_refused() {
    let yard = yard(PUCK, r#"{"start": [1, 1], "goal": [1, 1]}"#);
    for (controls, reason) in [
        (json!([[[1, 0, 0], [1, 0]]]), "unlike the 2 before it"),
        (
            json!([[[0, 0, 0]]]),
            "segment 0 of agent 0 has the duration 0.0, which is not above 0",
        ),
        (json!([[[1e10, 0, 0]]]), "beyond 1e9 s"),
        (json!([[[1, 0, 1e300]]]), "beyond ±1e9"),
        (json!([[], []]), "controls of 2 agents, but paths of 1"),
        (
            json!([[[]]]),
            "a segment [duration_s, number, …] of agent 0",
        ),
    ] {
        let plan = json!({"format": "fleetyard.trajectories/1", "paths": [[[0, 1, 1]]],
                          "controls": controls});
        yard.write("odd.json", plan.to_string());
        let ended = yard.line("validate --task hall.task.json odd.json");
        let told = ended.expect(INPUT).stderr;
        assert!(told.contains(reason), "{told}");
    }
}

fn ask(planner: &str, more: &str) -> Ended {
    let line = format!("run --task hall.task.json -p {planner} --format json {more}");
    yard(PUCK, WAY).line(&line)
}

/// Lies are found by the judge, and what is malformed by the host, however the planner is attached.
#[test]
fn lies_with_controls_are_found_by_every_attachment() {
    let library = c_library("plugins/faulty/controls.c", None);
    let library = library.display().to_string();
    let program = root().join("plugins/faulty/controls.py");
    let program = program.display().to_string();
    let mut planners = vec![
        (&library, "--attach worker"),
        (&library, "--attach in-process"),
    ];
    if have("python3") {
        planners.push((&program, "--attach stdio"));
    }
    for (planner, attach) in planners {
        let fault = |name: &str| ask(planner, &format!("{attach} --option fault={name}"));
        let record = fault("none").expect(SUCCESS).json();
        assert_eq!(record["verdict"]["valid"], true, "{record}");
        for (name, rule) in [
            ("off-controls", "off-controls"),
            ("too-fast", "too-fast"),
            ("lengths", "wrong-controls"),
        ] {
            let record = fault(name).expect(INVALID_PLAN).json();
            let found = record["judged"]["world"]["violations"].as_array().unwrap();
            assert!(
                found.iter().any(|one| one["rule"] == rule),
                "{attach} {name}: {record}"
            );
        }
        // Numbers that no control has.
        for (name, reason) in [("negative", "not above 0"), ("endless", "beyond 1e9 s")] {
            let ended = fault(name).expect(INVALID_PLAN);
            assert!(ended.stderr.contains(reason), "{attach} {name}: {ended}");
        }
        // Columns that are none.
        for name in ["ragged", "huge", "null", "nan"] {
            let ended = fault(name).expect(PLUGIN);
            assert!(ended.stderr.contains("plan"), "{attach} {name}: {ended}");
        }
    }
    if !have("python3") {
        return;
    }
    for name in ["no-list", "neither", "twice"] {
        let ended = ask(&program, &format!("--option fault={name}")).expect(PLUGIN);
        assert!(ended.stderr.contains("agent 0"), "{name}: {ended}");
    }
}
