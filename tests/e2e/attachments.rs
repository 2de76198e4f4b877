//! The same plugin gives the same plan, whichever way it is attached: linked in, as a
//! shared library in a worker or in the host's own process, as a program. And the
//! example plugins in C, C++, Rust, Python and Java solve real instances.
//!
//! Digests are compared with each other and never with numbers written down here:
//! planners get better, and then their plans are others.

use std::process::Command;

use fleetyard_testkit::{SUCCESS, Yard, built_package, c_library, have, instance, root, words};
use serde_json::Value;

/// Runs a planner on an instance; the record of a valid plan.
#[track_caller]
fn solve(planner: &str, map: &str, agents: usize, arguments: &str) -> Value {
    let mut line = words("run --budget 60s --seed 1 --format json --planner");
    line.push(planner.to_owned());
    line.extend(instance(map, agents));
    line.extend(words(arguments));
    let ended = Yard::new().run(&line).expect(SUCCESS);
    let record = ended.json();
    assert_eq!(record["verdict"]["valid"], true, "{ended}");
    assert_eq!(record["claim"], "solved", "{ended}");
    record
}

/// Runs a planner in several ways, `(planner, arguments)`, twice each; all plans have
/// to be the same.
#[track_caller]
fn same_plan(ways: &[(&str, &str)], map: &str, agents: usize, options: &str) {
    let mut first: Option<Value> = None;
    for (planner, arguments) in ways {
        for turn in 1..=2 {
            let record = solve(planner, map, agents, &format!("{arguments} {options}"));
            let first = first.get_or_insert_with(|| record.clone());
            for key in ["plan_digest", "instance_digest"] {
                assert_eq!(
                    record[key], first[key],
                    "{key} of {planner} {arguments}, turn {turn}"
                );
            }
            let (costs, bound) = (&record["metrics"], &first["metrics"]);
            assert_eq!(costs["soc_steps"], bound["soc_steps"]);
            assert_eq!(costs["makespan_steps"], bound["makespan_steps"]);
        }
    }
}

#[test]
fn built_in_planners_by_every_way() {
    let library = built_package("fleetyard-plugins").library.unwrap();
    let library = library.display().to_string();
    // Options under which the planner stops by itself: with a wall-clock budget a
    // faster attachment may find a better plan.
    for (id, map, agents, options) in [
        ("lacam", "random-32-32-20", 60, "--option anytime=false"),
        ("lacam", "room-33-33-8", 25, "--option anytime=false"),
        ("lacam", "warehouse-4-6-6-2-1", 50, "--option anytime=false"),
        ("pibt", "empty-16-16", 40, ""),
    ] {
        let path = format!("{library}:{id}");
        let ways = [
            (id, "--attach worker"),
            (id, "--attach in-process"),
            (path.as_str(), "--attach worker"),
            (path.as_str(), "--attach in-process"),
        ];
        same_plan(&ways, map, agents, options);
    }
}

#[test]
fn another_seed_is_another_run_of_the_same_instance() {
    let one = solve("lacam", "random-32-32-20", 60, "--option anytime=false");
    let mut line = words("run --planner lacam --option anytime=false --seed 2 --format json");
    line.extend(instance("random-32-32-20", 60));
    let two = Yard::new().run(&line).expect(SUCCESS).json();
    assert_eq!(one["instance_digest"], two["instance_digest"]);
    assert_eq!(one["budget"]["seed"], 1);
    assert_eq!(two["budget"]["seed"], 2);
    assert_eq!(two["verdict"]["valid"], true);
}

#[test]
fn the_c_example() {
    let library = c_library("plugins/examples/c/prioritized.c", None);
    let library = library.display().to_string();
    let ways = [
        (library.as_str(), "--attach worker"),
        (library.as_str(), "--attach in-process"),
    ];
    same_plan(&ways, "random-32-32-20", 20, "");
    let record = solve(&library, "warehouse-4-6-6-2-1", 20, "--execute");
    assert_eq!(record["planner"]["attach"], "worker");
    assert_eq!(record["planner"]["ranked"], true);
    assert_eq!(record["execution"]["contacts"], 0);
}

#[test]
fn the_cpp_example() {
    if !have(&std::env::var("CXX").unwrap_or_else(|_| "c++".into())) {
        return;
    }
    let library = c_library("plugins/examples/cpp/cbs.cpp", None);
    let library = library.display().to_string();
    let ways = [
        (library.as_str(), "--attach worker"),
        (library.as_str(), "--attach in-process"),
    ];
    same_plan(&ways, "random-32-32-20", 20, "");
    // What it searches for is the optimum, or something near it; nothing is cheaper.
    let optimal = solve(&library, "random-32-32-20", 30, "--execute");
    assert_eq!(optimal["execution"]["contacts"], 0);
    let near = solve(
        &library,
        "random-32-32-20",
        30,
        "--option suboptimality=1.1",
    );
    let other = solve("lacam", "random-32-32-20", 30, "--option anytime=false");
    let cost = |record: &Value| record["metrics"]["soc_steps"].as_u64().unwrap();
    assert!(cost(&optimal) <= cost(&near) && cost(&optimal) <= cost(&other));
    assert!(cost(&near) * 10 <= cost(&optimal) * 11);
}

#[test]
fn the_rust_example() {
    let built = built_package("fleetyard-example-rust");
    let library = built.library.unwrap().display().to_string();
    let program = built.program.unwrap().display().to_string();
    let ways = [
        (library.as_str(), "--attach worker"),
        (library.as_str(), "--attach in-process"),
        (program.as_str(), "--attach stdio"),
    ];
    same_plan(&ways, "empty-8-8", 6, "");
    // All of its kinds are listed by both.
    let yard = Yard::new();
    let described = |path: &str| {
        let line = ["plugins", "info", path, "--format", "json"];
        let plugins = yard.run(&line).expect(SUCCESS).json();
        let mut names: Vec<String> = plugins
            .as_array()
            .unwrap()
            .iter()
            .map(|plugin| format!("{} {}", plugin["kind"], plugin["id"]))
            .collect();
        names.sort();
        names
    };
    assert_eq!(described(&library), described(&program));
    assert_eq!(described(&library).len(), 4);
}

#[test]
fn the_python_examples() {
    if !have("python3") {
        return;
    }
    let folder = root().join("plugins/examples/python");
    let pibt = folder.join("pibt.py").display().to_string();
    let raw = folder.join("raw_protocol.py").display().to_string();
    same_plan(
        &[(&pibt, ""), (&pibt, "--attach stdio")],
        "empty-16-16",
        20,
        "",
    );
    let record = solve(&pibt, "random-32-32-20", 10, "--execute");
    assert_eq!(record["planner"]["id"], "pibt-python");
    assert_eq!(record["planner"]["attach"], "stdio");
    assert_eq!(record["execution"]["contacts"], 0);
    solve(&raw, "random-32-32-20", 5, "--execute");
}

#[test]
fn the_java_example() {
    if !have("java") {
        return;
    }
    let program = root().join("plugins/examples/java/one-by-one");
    let program = program.display().to_string();
    same_plan(&[(&program, "--attach stdio")], "random-32-32-20", 20, "");
}

#[test]
fn the_python_package_passes_its_own_tests() {
    if !have("python3") {
        return;
    }
    let folder = root().join("abi/python");
    let output = Command::new("python3")
        .args(["-m", "unittest", "discover", "--start-directory", "tests"])
        .env("PYTHONPATH", &folder)
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .current_dir(&folder)
        .output()
        .unwrap();
    let messages = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{messages}");
    // A discovery that finds nothing is no success.
    assert!(!messages.contains("Ran 0 tests"), "{messages}");
}
