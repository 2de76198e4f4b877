//! `--annotations` of `run` and `trace export`: what planners want to show, and that their plans do
//! not depend on it.

use std::fs;

use fleetyard_testkit::{Ended, INPUT, SUCCESS, Yard, have, root};
use serde_json::Value;

/// A run of the first agents of a map of the repository, with what it records.
fn run(yard: &Yard, planner: &str, more: &str) -> Ended {
    let maps = root().join("maps").display().to_string();
    yard.line(&format!(
        "run --map {maps}/empty-8-8.map --scen {maps}/empty-8-8-random-1.scen \
         --planner {planner} --budget 20s --format json {more}"
    ))
    .expect(SUCCESS)
}

fn shown(yard: &Yard, file: &str) -> Value {
    serde_json::from_slice(&yard.read(file)).unwrap()
}

fn layers(shown: &Value) -> Vec<&str> {
    let annotations = shown["annotations"].as_array().unwrap();
    let mut layers: Vec<&str> = annotations
        .iter()
        .map(|annotation| annotation["layer"].as_str().unwrap())
        .collect();
    layers.dedup();
    layers
}

#[test]
fn constraints_of_cbs_are_shown_and_its_plan_is_the_same_without() {
    let yard = Yard::new();
    let agents = "--agents 16";
    let without = run(&yard, "cbs", agents).json();
    assert_eq!(yard.files().len(), 0);
    for attach in ["worker", "in-process"] {
        let more = format!("{agents} --attach {attach} --annotations {attach}.json");
        let with = run(&yard, "cbs", &more).json();
        assert_eq!(with["plan_digest"], without["plan_digest"]);
        let shown = shown(&yard, &format!("{attach}.json"));
        assert_eq!(shown["format"], "fleetyard.annotations/1");
        assert_eq!(shown["plan_digest"], without["plan_digest"]);
        assert_eq!(
            (&shown["agents"], &shown["left_out"]),
            (&16.into(), &0.into())
        );
        assert_eq!(layers(&shown), ["constraints"]);
        assert!(shown["annotations"][0]["text"].is_string());
    }
    let same = yard.read("worker.json") == yard.read("in-process.json");
    assert!(same, "attachments differ");
}

/// The tree begins at the start, and the plan is the same without it.
#[test]
fn planners_for_dynamics_show_their_trees() {
    let yard = Yard::new();
    let task = root().join("maps/rover.task.json").display().to_string();
    for (planner, nodes) in [
        ("hybrid-astar", 100_000),
        ("rrt-star", 400),
        ("sst", 10_000),
        ("db-astar", 100_000),
    ] {
        let asked = format!(
            "run --task {task} --planner {planner} --representation continuous --nodes {nodes} --budget 1m --format json"
        );
        let without = yard.line(&asked).expect(SUCCESS).json();
        let with = yard.line(&format!("{asked} --annotations shown.json"));
        assert_eq!(
            with.expect(SUCCESS).json()["plan_digest"],
            without["plan_digest"],
            "{planner}"
        );
        let shown = shown(&yard, "shown.json");
        assert_eq!(layers(&shown), ["trees"], "{planner}");
        let lines = shown["annotations"][0]["xy_m"].as_array().unwrap();
        assert!(lines.len() > 50, "{planner}: {} lines", lines.len());
        let from_start = lines
            .iter()
            .any(|line| line[0] == serde_json::json!([1.4, 2.0]));
        assert!(from_start, "{planner}");
    }
}

#[test]
fn pictures_and_replays_have_the_layers() {
    let yard = Yard::new();
    let more = "--agents 16 --annotations shown.json --trace-out run.trace --picture plan.svg";
    run(&yard, "cbs", more);
    let count = shown(&yard, "shown.json")["annotations"]
        .as_array()
        .unwrap()
        .len();
    let legend = format!("<title>{count} constraints</title>");
    let picture = String::from_utf8(yard.read("plan.svg")).unwrap();
    assert!(picture.contains(&legend) && picture.contains("<g class=\"layer\""));
    yard.line(
        "trace export run.trace --annotations shown.json --svg all.svg --html run.html \
         --png all.png",
    )
    .expect(SUCCESS);
    assert!(
        String::from_utf8(yard.read("all.svg"))
            .unwrap()
            .contains(&legend)
    );
    let page = String::from_utf8(yard.read("run.html")).unwrap();
    assert!(page.contains(r#""layers":[{"name":"constraints""#));
    // At a moment those that hold then.
    yard.line("trace export run.trace --annotations shown.json --svg end.svg --at 1e6")
        .expect(INPUT);
    yard.line("trace export run.trace --annotations shown.json --svg begin.svg --at 0")
        .expect(SUCCESS);
    let begin = String::from_utf8(yard.read("begin.svg")).unwrap();
    assert!(begin.contains(" constraints</title>") && !begin.contains(&legend));
    // The same trace without them has no legend.
    yard.line("trace export run.trace --svg plain.svg")
        .expect(SUCCESS);
    let plain = String::from_utf8(yard.read("plain.svg")).unwrap();
    assert!(!plain.contains("layer"));
}

#[test]
fn annotations_of_another_plan_are_refused() {
    let yard = Yard::new();
    run(&yard, "cbs", "--agents 16 --annotations shown.json");
    run(&yard, "cbs", "--agents 4 --trace-out run.trace");
    let other = yard.line("trace export run.trace --annotations shown.json --html run.html");
    let other = other.expect(INPUT);
    assert!(
        other
            .stderr
            .contains("shown.json: these annotations are of plan"),
        "{other}"
    );
    assert!(other.stderr.contains("hint: name the file"), "{other}");
    yard.write("shown.json", "{\"format\": \"fleetyard.annotations/1\"}");
    let broken = yard.line("trace export run.trace --annotations shown.json --html run.html");
    let broken = broken.expect(INPUT);
    assert!(broken.stderr.contains("missing field `agents`"), "{broken}");
    // It is read, and so is not written over.
    fs::rename(yard.path("shown.json"), yard.path("shown")).unwrap();
    let over = "trace export run.trace --annotations shown --svg shown";
    yard.line(over).expect(INPUT);
    assert_eq!(yard.files().len(), 2);
}

#[test]
fn ways_and_waits_of_the_plane_are_shown() {
    let yard = Yard::new();
    let task = root()
        .join("maps/two-rooms.task.json")
        .display()
        .to_string();
    let line = format!(
        "run --task {task} --planner plane-pp --annotations shown.json --picture plan.svg \
         --trace-out run.trace --format json"
    );
    yard.line(&line).expect(SUCCESS);
    let shown = shown(&yard, "shown.json");
    assert!(layers(&shown).contains(&"ways"), "{shown}");
    yard.line("trace export run.trace --annotations shown.json --html run.html")
        .expect(SUCCESS);
}

#[test]
fn the_tree_of_a_search_in_python_is_shown() {
    if !have("python3") {
        return;
    }
    let yard = Yard::new();
    let planner = root().join("plugins/examples/python/grid_search.py");
    let planner = format!("{}:astar-python", planner.display());
    let without = run(&yard, &planner, "--agents 1").json();
    let with = run(&yard, &planner, "--agents 1 --annotations shown.json").json();
    assert_eq!(with["plan_digest"], without["plan_digest"]);
    let shown = shown(&yard, "shown.json");
    assert_eq!(layers(&shown), ["tree"]);
    let edge = &shown["annotations"][0]["xy_m"][0];
    assert_eq!(edge.as_array().map(Vec::len), Some(2), "{edge}");
}
