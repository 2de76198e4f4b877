//! `fleetyard compare`: several planners on several maps, with options of their own, and
//! what they claim held against what was found.

use fleetyard_testkit::{INPUT, INVALID_PLAN, NO_PLAN, SUCCESS, USAGE, Yard, have, root};
use serde_json::Value;

#[test]
fn compare_in_text_and_json() {
    let scen = "{maps}/empty-16-16-random-1.scen";
    let line = format!(
        "compare --map {{maps}}/empty-16-16.map --scen {scen} --agents 5,20 --planner lacam \
         --planner pibt --budget 300ms --prepare-budget 60s"
    );
    let yard = Yard::new();
    let ended = yard.line(&format!("{line} --format json")).expect(SUCCESS);
    let report = ended.json();
    let rows = report["rows"].as_array().unwrap();
    let who: Vec<String> = rows
        .iter()
        .map(|row| format!("{} {}", row["agents"], row["planner"].as_str().unwrap()))
        .collect();
    assert_eq!(who, ["5 lacam", "5 pibt", "20 lacam", "20 pibt"]);
    for row in rows {
        assert_eq!((&row["trials"], &row["solved"]), (&1.into(), &1.into()));
        for key in [
            "soc_steps_mean",
            "suboptimality_mean",
            "rtf_median",
            "first_solution_ms_median",
        ] {
            assert!(
                row[key].as_f64().is_some_and(|number| number > 0.0),
                "{key}: {row}"
            );
        }
        assert_eq!(row["contacts"], 0);
    }
    let trials = report["trials"].as_array().unwrap();
    assert_eq!(trials.len(), 4);
    for trial in trials {
        assert_eq!(trial["verdict"]["valid"], true);
        assert!(trial["execution"]["trace_digest"].is_string());
    }
    let text = yard
        .line(&format!("{line} --no-execute"))
        .expect(SUCCESS)
        .stdout;
    // On a busy machine lines about that stand between.
    let lines: Vec<&str> = text.lines().collect();
    assert!(lines.len() >= 7, "{text}");
    assert!(lines[0].starts_with("map") && lines[0].contains("SoC/LB"));
    assert!(lines[1].contains("empty-16-16") && lines[1].contains("1/1"));
    let last = lines.last().unwrap();
    assert!(
        last.starts_with("claims: all ") && last.ends_with(" agree with what was found"),
        "{text}"
    );
}

/// The rows of a report as text, by keys.
fn rows(report: &Value, keys: &[&str]) -> Vec<String> {
    let text = |value: &Value| match value {
        Value::String(text) => text.clone(),
        other => other.to_string(),
    };
    let row = |row: &Value| {
        let values: Vec<String> = keys.iter().map(|key| text(&row[key])).collect();
        values.join(" ")
    };
    report["rows"].as_array().unwrap().iter().map(row).collect()
}

#[test]
fn scenarios_of_several_maps_find_their_maps() {
    let yard = Yard::new();
    let line = "compare --agents 3 --planner pibt --budget 60s --no-execute --format json --scen";
    let two = "{maps}/room-33-33-8-random-1.scen {maps}/empty-8-8-random-1.scen";
    let expected = ["room-33-33-8 3 1", "empty-8-8 3 1"];
    // Beside the scenarios, in a folder, and as files.
    for place in [
        "",
        "--map {maps}",
        "--map {maps}/empty-8-8.map {maps}/room-33-33-8.map",
        "--map {maps}/empty-8-8.map --map {maps}",
    ] {
        let ended = yard.line(&format!("{line} {two} {place}")).expect(SUCCESS);
        assert_eq!(rows(&ended.json(), &["map", "agents", "solved"]), expected);
    }
    let scenario = root().join("maps/empty-8-8-random-1.scen");
    yard.write("lonely.scen", std::fs::read(scenario).unwrap());
    for (place, text) in [
        ("", "there is no empty-8-8.map; --map says where it is"),
        ("--map {here}", "/empty-8-8.map; --map says where it is"),
        (
            "--map {maps}/room-33-33-8.map {maps}/empty-16-16.map",
            "name its file by --map as well",
        ),
        (
            "--map {maps}/room-33-33-8.map",
            "the scenario is for a map of 8 rows and 8 columns, but room-33-33-8 has 33 and 33",
        ),
    ] {
        let ended = yard
            .line(&format!("{line} lonely.scen {place}"))
            .expect(INPUT);
        assert!(ended.stderr.contains(text), "{text}: {ended}");
    }
}

#[test]
fn every_planner_has_options_of_its_own() {
    let yard = Yard::new();
    let line = "compare --agents 3 --scen {maps}/empty-8-8-random-1.scen --budget 60s \
                --no-execute --format json --planner pibt --planner lacam anytime=false";
    let ended = yard
        .line(&format!(
            "{line} --planner lacam anytime=false seed-paths=1"
        ))
        .expect(USAGE);
    assert!(ended.stderr.contains("`seed-paths`"), "{ended}");
    let ended = yard.line(&format!("{line} pibt")).expect(USAGE);
    let told = "every planner has a --planner of its own";
    assert!(ended.stderr.contains(told), "{ended}");
    let report = yard.line(line).expect(SUCCESS).json();
    assert_eq!(rows(&report, &["planner"]), ["pibt", "lacam anytime=false"]);
    let trials = report["trials"].as_array().unwrap();
    for trial in trials {
        let expected = match trial["planner"]["id"].as_str() {
            Some("lacam") => serde_json::json!({"anytime": false}),
            _ => serde_json::json!({}),
        };
        assert_eq!(trial["planner"]["options"], expected);
    }
}

/// A planner for one agent where nothing is in its way, and what it claims by option.
const CLAIMER: &str = r#"#!/usr/bin/env python3
import json, sys

def plan(instance):
    (start,), ((goal,),) = instance["starts"], instance["goals"]
    path = [start]
    while path[-1] % cols != goal % cols:
        path.append(path[-1] + (1 if goal % cols > path[-1] % cols else -1))
    while path[-1] != goal:
        path.append(path[-1] + (cols if goal > path[-1] else -cols))
    honest = len(path) - 1
    claimed = {"honest": honest, "cheap": honest - 2, "nothing": None}.get(claim, honest)
    if claimed is not None:
        for name in ("claimed_sum_of_costs", "claimed_makespan"):
            params = {"name": name, "value": claimed}
            print(json.dumps({"jsonrpc": "2.0", "method": "metric", "params": params}))
    if claim == "infeasible":
        return {"status": "infeasible"}
    status = "timed-out" if claim == "late" else "solved"
    return {"status": status, "paths": [path[:1] if claim in ("arrived", "late") else path]}

for line in sys.stdin:
    message = json.loads(line)
    method, params = message["method"], message.get("params")
    result = {"status": "solved"}
    if method == "initialize":
        about = {"id": "claimer", "kind": "planner", "version": "1"}
        about["capabilities"] = ["grid", "pebble"]
        about["options_schema"] = {"properties": {"claim": {"type": "string"}}}
        result = {"protocol_version": 1, "plugins": [about]}
    elif method == "create":
        claim = params["options"]["claim"]
    elif method == "prepare":
        cols = params["environment"]["grid"]["cols"]
    elif method == "plan":
        result = plan(params["instance"])
    elif method == "exit":
        break
    if "id" in message:
        print(json.dumps({"jsonrpc": "2.0", "id": message["id"], "result": result}), flush=True)
"#;

#[test]
fn claims_are_held_against_what_was_found() {
    if !have("python3") {
        return;
    }
    let yard = Yard::new();
    yard.write("claimer.py", CLAIMER);
    let scenario = "version 1\n0\tempty-8-8.map\t8\t8\t1\t1\t4\t3\t5\n";
    yard.write("one.scen", scenario);
    let line = |claims: &[&str]| {
        let planners: Vec<String> = claims
            .iter()
            .map(|claim| format!("--planner ./claimer.py claim={claim}"))
            .collect();
        format!(
            "compare --agents 1 --scen one.scen --map {{maps}} --budget 60s --no-execute {}",
            planners.join(" ")
        )
    };
    let all = ["infeasible", "honest", "nothing", "cheap", "arrived"];
    let ended = yard.line(&line(&all)).expect(NO_PLAN);
    let text: Vec<&str> = ended.stdout.lines().collect();
    assert_eq!(
        text[7],
        "claims: 6 of 11 disagree with what was found; 2 could not be checked"
    );
    let told: Vec<String> = text[9..]
        .iter()
        .map(|line| line.split_whitespace().collect::<Vec<_>>().join(" "))
        .collect();
    assert_eq!(
        told,
        [
            "claimer claim=infeasible one.scen 1 status infeasible a valid plan by claimer \
             claim=honest",
            "claimer claim=cheap one.scen 1 sum of costs 3 5 -2",
            "claimer claim=cheap one.scen 1 makespan 3 5 -2",
            "claimer claim=arrived one.scen 1 status solved an invalid plan",
            "claimer claim=arrived one.scen 1 sum of costs 5 0 +5",
            "claimer claim=arrived one.scen 1 makespan 5 0 +5",
        ]
    );
    let json = yard
        .line(&format!("{} --format json", line(&all)))
        .expect(NO_PLAN)
        .json();
    let failures = rows(&json, &["failures"]);
    assert_eq!(failures[..2], [r#"["no plan: infeasible"]"#, "[]"]);
    assert_eq!(failures[4], r#"["invalid plan"]"#);
    let claims = &json["claims"];
    assert_eq!(
        (&claims["agree"], &claims["unchecked"]),
        (&5.into(), &2.into())
    );
    let first = &claims["disagree"][1];
    assert_eq!(first["what"], "sum_of_costs");
    assert_eq!(first["claimed"].as_f64(), Some(3.0));
    assert_eq!(first["found"].as_f64(), Some(5.0));
    assert_eq!(first["difference"].as_f64(), Some(-2.0));
    let cheap = &json["trials"][3]["claims"];
    assert_eq!(cheap.as_array().unwrap().len(), 3, "{cheap}");
    assert_eq!(cheap[1]["agrees"], false, "{cheap}");

    // Who was late and leaves its best effort claims no plan that could be invalid.
    let run = |claim: &str| {
        let line = line(&[claim]).replace("compare", "run");
        yard.line(
            &line
                .replace("--no-execute", "")
                .replace("{maps}", "{maps}/empty-8-8.map"),
        )
    };
    run("arrived").expect(INVALID_PLAN);
    let ended = run("late").expect(NO_PLAN);
    assert!(
        ended.stderr.contains("no plan within the budget"),
        "{ended}"
    );
    assert!(
        ended.stdout.contains("no plan; what the planner left"),
        "{ended}"
    );
    let ended = yard.line(&format!("{} --format json", line(&["late"])));
    let json = ended.expect(NO_PLAN).json();
    assert_eq!(rows(&json, &["failures"]), [r#"["timed-out"]"#]);

    // Nobody contradicts it.
    let ended = yard.line(&line(&["infeasible"])).expect(NO_PLAN);
    let told = "claims: none of 3 could be checked";
    assert!(ended.stdout.contains(told), "{ended}");

    // One run says so too.
    let run = "run --agents 1 --scen one.scen --map {maps}/empty-8-8.map --budget 60s --planner";
    let ended = yard
        .line(&format!("{run} ./claimer.py --option claim=cheap"))
        .expect(SUCCESS);
    let told = "false claim       sum of costs: 3 claimed, 5 found (-2)";
    assert!(ended.stdout.contains(told), "{ended}");
    let ended = yard
        .line(&format!("{run} ./claimer.py --option claim=honest"))
        .expect(SUCCESS);
    assert!(!ended.stdout.contains("false claim"), "{ended}");
}
