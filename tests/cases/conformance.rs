//! The conformance kit, `fleetyard plugins check`: the standard plugins and the examples
//! pass in every attachment that they have, and plugins that break a promise fail the
//! cases that ask for it, and no others.
//!
//! Instances follow from a seed that stays the same here, so the tables below do not
//! depend on chance; where a case is about time, the plugin misses by seconds or not at
//! all.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::sync::OnceLock;

use fleetyard_testkit::{
    Built, Ended, PLUGIN, SUCCESS, USAGE, Yard, built_package, c_library, faulty_library,
    faulty_program, have, library, root, words,
};
use serde_json::{Value, json};

use crate::{Tests, says};

pub(crate) fn add(tests: &mut Tests) {
    built_in(tests);
    examples(tests);
    kept(tests);
    promises(tests);
    faulty_libraries(tests);
    faulty_programs(tests);
    wrong_command_lines(tests);
    let singles: [(&str, fn()); 11] = [
        (
            "standard plugins as a library pass",
            standard_library_passes,
        ),
        (
            "standard plugins as a program pass",
            standard_program_passes,
        ),
        (
            "adapter is checked like any other plugin",
            adapter_is_checked,
        ),
        ("every case is failed by somebody", every_case_is_failed),
        (
            "who does not hear the clock is stopped and named",
            deaf_is_stopped,
        ),
        (
            "library that changes the host's process fails one case",
            changed_process,
        ),
        (
            "crash in the host's own process takes one case with it",
            crash_in_process,
        ),
        (
            "failure is replayed by the command that it prints",
            failure_is_replayed,
        ),
        (
            "results are lines for people and one document for programs",
            results,
        ),
        (
            "plugins are chosen by kind and identifier",
            plugins_are_chosen,
        ),
        ("every case is in the documentation", cases_are_documented),
    ];
    for (name, test) in singles {
        tests.add(&format!("conformance::{name}"), test);
    }
}

/// Runs `plugins check`.
fn run(plugin: &str, arguments: &str) -> Ended {
    let mut line = ["plugins", "check", plugin].map(str::to_owned).to_vec();
    line.extend(words(arguments));
    Yard::new().run(&line)
}

/// The document of a run that ended with a code.
#[track_caller]
fn check(plugin: &str, arguments: &str, code: i32) -> Value {
    run(plugin, &format!("--format json {arguments}"))
        .expect(code)
        .json()
}

fn list<'a>(value: &'a Value, name: &str) -> &'a Vec<Value> {
    value[name]
        .as_array()
        .unwrap_or_else(|| panic!("no {name} in {value}"))
}

/// Cases that failed, and those that crashed with a `!`.
fn bad(document: &Value) -> BTreeSet<String> {
    let mut bad = BTreeSet::new();
    for case in list(document, "plugins")
        .iter()
        .flat_map(|plugin| list(plugin, "cases"))
    {
        let name = case["case"].as_str().unwrap();
        match case["outcome"].as_str().unwrap() {
            "failed" => bad.insert(name.to_owned()),
            "crashed" => bad.insert(format!("{name}!")),
            _ => continue,
        };
    }
    bad
}

fn expected(names: &str) -> BTreeSet<String> {
    names.split_whitespace().map(str::to_owned).collect()
}

fn crashed(names: &str) -> BTreeSet<String> {
    names
        .split_whitespace()
        .map(|name| format!("{name}!"))
        .collect()
}

/// Fails unless a check ends with these cases failed, and no others.
#[track_caller]
fn fails(plugin: &str, arguments: &str, wanted: &BTreeSet<String>) -> Value {
    let code = if wanted.is_empty() { SUCCESS } else { PLUGIN };
    let document = check(plugin, arguments, code);
    assert_eq!(bad(&document), *wanted, "{document}");
    document
}

// ---- Plugins with which nothing is wrong --------------------------------------------

#[track_caller]
fn passes(plugin: &str, plugins: usize, attachment: &str) {
    // Too short for some answers at times, which is a warning.
    let arguments = format!("--budget 500ms {attachment}");
    let document = fails(plugin, &arguments, &BTreeSet::new());
    assert_eq!(list(&document, "plugins").len(), plugins, "{plugin}");
    let passed = document["summary"]["passed"].as_u64().unwrap();
    assert!(passed >= 11, "{plugin} {attachment}: {passed} passed");
}

const IN_WORKER: &str = "--attach worker";
const IN_HOST: &str = "--attach in-process";

/// Standard planners of every crate, and how each is attached: one of each view in both ways.
const BUILT_IN: [(&str, &str); 33] = [
    ("lacam", IN_WORKER),
    ("lacam", IN_HOST),
    ("pibt", "--kind planner"),
    ("epibt", IN_HOST),
    ("wppl", IN_WORKER),
    ("empty", IN_HOST),
    ("cbs", IN_WORKER),
    ("ecbs", IN_HOST),
    ("pp", IN_WORKER),
    ("pbs", IN_HOST),
    ("mapf-lns2", IN_HOST),
    ("mapf-lns", IN_WORKER),
    ("astar", IN_HOST),
    ("beam-search", IN_HOST),
    ("theta-star", IN_WORKER),
    ("roadmap-pp", IN_WORKER),
    ("roadmap-pp", IN_HOST),
    ("ctc", IN_WORKER),
    ("ccbs", IN_WORKER),
    ("eccbs", IN_HOST),
    ("roadmap-lns", IN_HOST),
    ("roadmap-lacam", IN_WORKER),
    ("plane-pp", IN_WORKER),
    ("plane-pp", IN_HOST),
    ("tangent", IN_WORKER),
    ("si-tangent", IN_HOST),
    ("sssp", IN_WORKER),
    ("cbs-mp", IN_HOST),
    ("cbs-rrt", IN_WORKER),
    ("db-astar", IN_WORKER),
    ("db-astar", IN_HOST),
    ("db-cbs", IN_HOST),
    ("db-lacam", IN_WORKER),
];

const MODULES: [&str; 3] = ["fail-policy", "instance-generator", "invocation-policy"];

/// The plugins that are linked in.
fn listing() -> Vec<Value> {
    let listed = Yard::new().line("plugins list --format json");
    let listed = listed.expect(SUCCESS).json();
    list(&listed[0], "plugins").clone()
}

fn built_in(tests: &mut Tests) {
    for (planner, attachment) in BUILT_IN {
        let name = format!("conformance::built in::{planner} {attachment}");
        tests.add(&name, move || passes(planner, 1, attachment));
    }
    for kind in MODULES {
        tests.add(&format!("conformance::built in::{kind}"), move || {
            let listing = listing();
            let ids = listing.iter().filter(|of| of["kind"] == kind);
            let ids: Vec<&str> = ids.map(|of| of["id"].as_str().unwrap()).collect();
            assert!(ids.len() >= 2, "{listing:?}");
            for id in &ids {
                passes(id, 1, &format!("--kind {kind} {IN_WORKER}"));
            }
            // One of each kind in the host's own process as well.
            passes(ids[0], 1, &format!("--kind {kind} {IN_HOST}"));
        });
    }
}

/// The standard plugins, built apart from the command.
fn standard() -> &'static Built {
    static BUILT: OnceLock<Built> = OnceLock::new();
    BUILT.get_or_init(|| built_package("fleetyard-plugins"))
}

fn standard_library_passes() {
    let library = standard().library.as_ref().unwrap().display().to_string();
    // All cases are asked of some of them above.
    let only = "--attach worker --only handshake --only descriptor --only default-options \
                --only invalid-options --only random-instances --only any-angle --only unreachable-goal";
    passes(&library, listing().len(), only);
}

fn standard_program_passes() {
    let program = standard().program.as_ref().unwrap().display().to_string();
    for planner in ["roadmap-pp", "plane-pp"] {
        passes(&format!("{program}:{planner}"), 1, "--attach stdio");
    }
    let listing = listing();
    for kind in MODULES {
        let modules = listing.iter().filter(|of| of["kind"] == kind).count();
        passes(&program, modules, &format!("--kind {kind} --attach stdio"));
    }
}

/// The example in Rust.
fn example() -> &'static Built {
    static BUILT: OnceLock<Built> = OnceLock::new();
    BUILT.get_or_init(|| built_package("fleetyard-example-rust"))
}

fn example_library() -> String {
    example().library.as_ref().unwrap().display().to_string()
}

fn examples(tests: &mut Tests) {
    // The planners in the host's own process as well.
    for (language, name, attachment) in [
        ("c", "prioritized", IN_WORKER),
        ("c", "prioritized", IN_HOST),
        ("c", "roadmap_sipp", IN_WORKER),
        ("c", "roadmap_sipp", IN_HOST),
        ("c", "stop_before", IN_WORKER),
        ("c", "stop_before", IN_HOST),
        ("c", "first_task", ""),
        ("c", "when_idle", ""),
        ("cpp", "cbs", IN_WORKER),
        ("cpp", "cbs", IN_HOST),
        ("cpp", "follow", ""),
        ("cpp", "nearest_task", ""),
        ("cpp", "just_in_time", ""),
        ("cpp", "set_out", IN_WORKER),
        ("cpp", "set_out", IN_HOST),
    ] {
        let test = format!("conformance::examples::{language}::{name} {attachment}");
        tests.add(test.trim_end(), move || {
            if language == "cpp" && !have(&std::env::var("CXX").unwrap_or_else(|_| "c++".into())) {
                return;
            }
            let source = format!("plugins/examples/{language}/{name}.{language}");
            let library = c_library(&source, None).display().to_string();
            passes(&library, 1, attachment);
        });
    }
    tests.add("conformance::examples::rust::library", || {
        passes(&example_library(), 4, IN_WORKER);
    });
    tests.add("conformance::examples::rust::one in the host", || {
        passes(&format!("{}:all-wait", example_library()), 1, IN_HOST);
    });
    tests.add("conformance::examples::rust::program", || {
        let program = example().program.as_ref().unwrap().display().to_string();
        passes(&program, 4, "--attach stdio");
    });
    for script in [
        "pibt.py",
        "raw_protocol.py",
        "follow.py",
        "nearest_task.py",
        "just_in_time.py",
        "grid_search.py:weighted-astar-python",
        "turn_drive.py",
    ] {
        let name = format!("conformance::examples::python::{script}");
        tests.add(&name, move || {
            if have("python3") {
                let script = root().join("plugins/examples/python").join(script);
                passes(&script.display().to_string(), 1, "");
            }
        });
    }
    tests.add("conformance::examples::java", || {
        if !have("java") {
            return;
        }
        // A virtual machine takes its time to start, for every case anew.
        let only = "--only handshake --only ending --only crossing --only repeated-calls \
                    --only bad-input --only deadline";
        let program = root().join("plugins/examples/java/one-by-one");
        let document = fails(
            &program.display().to_string(),
            &format!("--budget 500ms {only}"),
            &BTreeSet::new(),
        );
        assert_eq!(document["summary"]["passed"], 6, "{document}");
    });
}

/// The library that was written for contract 1.0, on the header of that time.
fn kept(tests: &mut Tests) {
    for (kind, plugins) in [("planner", 3)]
        .into_iter()
        .chain(MODULES.map(|kind| (kind, 1)))
    {
        for attachment in [IN_WORKER, IN_HOST] {
            let name = format!("conformance::contract 1.0::{kind} {attachment}");
            tests.add(&name, move || {
                let library = c_library("abi/tests/kept/1.0/kept.c", None);
                let arguments = format!("--kind {kind} {attachment}");
                passes(&library.display().to_string(), plugins, &arguments);
            });
        }
    }
}

/// A solver for the command line that stays at home, and exits with 3 when it should not.
const SOLVER: &str = r#"#!/usr/bin/env python3
import sys
if "--version" in sys.argv:
    sys.exit(print("stays 1"))
_, scenario, output = sys.argv[1:]
paths = []
for line in open(scenario).read().splitlines()[1:]:
    x, y, goal_x, goal_y = map(int, line.split("\t")[4:8])
    if (x, y) != (goal_x, goal_y):
        sys.exit(3)
    paths.append(f"Agent {len(paths)}: ({y},{x})->\n")
open(output, "w").write("".join(paths))
"#;

const MANIFEST: &str = r#"manifest = 1
id = "stays"
description = "Stays at home."

[version]
args = ["--version"]
pattern = 'stays (\S+)'

[program]
command = "./solver.py"
args = ["{map}", "{scen}", "{output}"]

[output]
format = "paths-txt"
"#;

fn adapter_is_checked() {
    if !have("python3") {
        return;
    }
    let yard = Yard::new();
    let solver = yard.write("solver.py", SOLVER);
    fs::set_permissions(solver, fs::Permissions::from_mode(0o755)).unwrap();
    let some = "--format json --only handshake --only descriptor --only default-options \
                --only ending --only arrived --only crossing --only deadline";
    let line = format!("plugins check ./planner.toml {some}");
    yard.write("planner.toml", MANIFEST);
    let document = yard.line(&line).expect(PLUGIN).json();
    // What its exit code means nobody has said.
    assert_eq!(bad(&document), expected("crossing deadline"), "{document}");
    assert_eq!(document["attach"], "command");
    yard.write(
        "planner.toml",
        format!("{MANIFEST}\n[exit]\ncodes = {{ 3 = \"gave-up\" }}\n"),
    );
    let document = yard.line(&line).expect(SUCCESS).json();
    assert_eq!(bad(&document), expected(""), "{document}");
}

// ---- One broken promise each -----------------------------------------------------

/// A plugin of `plugins/faulty/promises`, its mistake, and what it fails of `USUAL` and of the cases
/// that are named; who makes no mistake is asked everything. What answers at once, right or wrong,
/// is not affected by the length of the budget.
type Promise = (&'static str, &'static str, &'static str);

const PROMISES: &[Promise] = &[
    ("promising", "none", ""),
    ("promising", "dies-of-unknown-option", "unknown-option!"),
    ("promising", "dies-of-bad-option", "invalid-options!"),
    ("promising", "made-once", "default-options made-again"),
    ("promising", "no-one-cell", "one-cell"),
    (
        "promising",
        "one-agent-jumps",
        "one-agent eight-connected any-angle rotation move-mask",
    ),
    ("promising", "nothing-to-do-fails", "arrived one-cell"),
    (
        "promising",
        "follows-nobody",
        "following cycle random-instances repeated-calls other-map cancelled",
    ),
    (
        "promising",
        "through-walls",
        "unreachable-goal any-angle move-mask",
    ),
    ("promising", "no-makespan", "makespan"),
    ("promising", "limited-by-nodes-lies", "node-limit"),
    ("promising", "cuts-corners", "eight-connected"),
    ("promising", "sees-through-walls", "any-angle"),
    ("promising", "turns-in-no-time", "rotation"),
    ("promising", "window-blind", "windowed duplicate-goals"),
    ("promising", "parks-together", "duplicate-goals"),
    ("promising", "worse-later", "anytime"),
    ("promising", "too-tight", "k-robust"),
    ("promising", "one-thread-only", "threads"),
    (
        "promising",
        "unseeded",
        "deterministic repeated-calls unknown-part memory-replayed annotations-off",
    ),
    ("promising", "old-answer", "repeated-calls memory-replayed"),
    (
        "promising",
        "old-map",
        "other-map cancelled prepare-deadline",
    ),
    ("promising", "dies-of-bad-input", "bad-input!"),
    ("promising", "stale-cancel", "cancelled"),
    ("promising", "leaks", "memory-growth"),
    ("promising", "slow-prepare", "prepare-deadline"),
    ("promising", "ignores-arrows", "move-mask"),
    ("promising", "idle-agent-blocks", "idle-agents"),
    ("promising", "refuses-parts", "unknown-part"),
    ("promising", "remembers-calls", "memory-replayed"),
    ("promising", "dies-of-bytes", "kept-bytes!"),
    ("promising", "plans-for-the-gallery", "annotations-off"),
    ("promising", "short-seeds", "seed-53"),
    ("promising-roads", "none", ""),
    ("promising-plane", "none", ""),
    ("promising-policy", "none", ""),
    ("promising-policy", "returns-failed-plan", "failed-plan"),
    ("promising-generator", "none", ""),
    ("promising-generator", "longer-window", "windowed"),
    ("promising-generator", "forgets-window", ""),
    ("promising-generator", "idle-fleet-fails", "fleet-states"),
    ("promising-invocation", "none", ""),
    ("promising-invocation", "dies-of-crowd", "fleet-statuses!"),
    ("promising-invocation", "never-calls", ""),
];

/// Cases that a plugin passes which breaks one promise, unless they are about that one.
const USUAL: &str = "handshake default-options random-instances repeated-calls";

/// The arguments that ask for cases of these lists.
fn only(lists: &[&str]) -> String {
    let cases: BTreeSet<&str> = lists
        .iter()
        .flat_map(|list| list.split_whitespace())
        .collect();
    let asked = cases
        .iter()
        .map(|case| format!(" --only {}", case.trim_end_matches('!')));
    asked.collect::<Vec<_>>().concat()
}

/// The library of those plugins; cargo is asked for it once.
pub(crate) fn promising() -> &'static str {
    static LIBRARY: OnceLock<String> = OnceLock::new();
    LIBRARY.get_or_init(|| {
        let library = library("fleetyard-faulty-promises");
        library.display().to_string()
    })
}

/// The same for mistakes that show nearly everywhere; asked are `SOME`.
const EVERYWHERE: &[Promise] = &[
    (
        "promising",
        "ignores-others",
        "crossing passing-bay random-instances no-room colliding-plans",
    ),
    (
        "promising",
        "swaps-places",
        "passing-bay random-instances no-room colliding-plans",
    ),
    (
        "promising",
        "leaves-nonsense",
        "passing-bay random-instances colliding-plans",
    ),
    (
        "promising-policy",
        "needs-failed-plan",
        "crossing passing-bay random-instances no-room",
    ),
    (
        "promising-policy",
        "stands-elsewhere",
        "crossing passing-bay random-instances no-room",
    ),
    (
        "promising-generator",
        "loses-agents",
        "crossing random-instances",
    ),
    ("promising-generator", "blocked-goals", "random-instances"),
];

const SOME: &str = "handshake crossing passing-bay random-instances no-room colliding-plans";

/// The same for planners of roadmaps and of the plane, whose mistakes show nearly everywhere;
/// asked are `PLACES`.
const ON_PLACES: &[Promise] = &[
    (
        "promising-roads",
        "ignores-others",
        "idle-agents heterogeneous roadmap-crossing roadmap-near stop-go slower",
    ),
    (
        "promising-roads",
        "too-fast",
        "idle-agents heterogeneous roadmap-one roadmap-crossing roadmap-near stop-go slower",
    ),
    (
        "promising-roads",
        "jumps-edges",
        "idle-agents heterogeneous roadmap-one roadmap-near stop-go slower",
    ),
    ("promising-roads", "ignores-arrows", "roadmap-one"),
    (
        "promising-roads",
        "other-form",
        "idle-agents heterogeneous roadmap-one roadmap-crossing roadmap-near stop-go slower",
    ),
    (
        "promising-roads",
        "nan-times",
        "idle-agents heterogeneous roadmap-one roadmap-crossing roadmap-near stop-go slower",
    ),
    ("promising-roads", "idle-agent-blocks", "idle-agents"),
    (
        "promising-plane",
        "ignores-others",
        "idle-agents heterogeneous limits",
    ),
    (
        "promising-plane",
        "too-fast",
        "heterogeneous workspace-one workspace-gap workspace-mover limits controls",
    ),
    (
        "promising-plane",
        "off-controls",
        "heterogeneous workspace-one workspace-gap workspace-mover limits controls",
    ),
    ("promising-plane", "ignores-movers", "workspace-mover"),
    (
        "promising-plane",
        "other-form",
        "idle-agents heterogeneous workspace-one workspace-gap workspace-mover limits controls",
    ),
    (
        "promising-plane",
        "nan-times",
        "heterogeneous workspace-one workspace-gap workspace-mover limits controls",
    ),
    ("promising-plane", "idle-agent-blocks", "idle-agents"),
];

const PLACES: &str = "idle-agents heterogeneous roadmap-one roadmap-crossing roadmap-near stop-go \
                      slower workspace-one workspace-gap workspace-mover limits controls";

/// Plugins that are described wrongly, with the cases that fail.
const DESCRIBED: &[(&str, &str)] = &[
    ("two-faces", "descriptor"),
    ("bad-default", "descriptor"),
    ("all-knowing", "critical-part other-representation"),
    // The SDK refuses the grids that it does not claim.
    (
        "contradiction",
        "descriptor ending made-again memory-growth output repeated-calls thread-limit \
         unknown-part critical-part annotations-off seed-53",
    ),
];

fn promises(tests: &mut Tests) {
    for (table, base) in [(PROMISES, USUAL), (EVERYWHERE, SOME), (ON_PLACES, PLACES)] {
        for (id, mistake, names) in table {
            let asked = if *mistake == "none" {
                String::new()
            } else {
                only(&[base, names])
            };
            tests.add(
                &format!("conformance::promises::{id}::{mistake}"),
                move || {
                    let arguments =
                        format!("--id {id} --option mistake={mistake} --budget 20s {asked}");
                    fails(promising(), &arguments, &expected(names));
                },
            );
        }
    }
    for (id, names) in DESCRIBED {
        tests.add(&format!("conformance::promises::{id}"), move || {
            // A large map takes seconds, and no mistake here is about one.
            let arguments = format!("--id {id} --skip large-case");
            fails(promising(), &arguments, &expected(names));
        });
    }
    // Odd, but allowed.
    for (id, mistake, case, text) in [
        ("promising", "chatters", "output", "logged 2000 lines"),
        (
            "promising-generator",
            "forgets-window",
            "windowed",
            "a window of 0 steps, asked was 5",
        ),
        (
            "promising-invocation",
            "never-calls",
            "fleet-statuses",
            "the fleet stands for good",
        ),
    ] {
        tests.add(
            &format!("conformance::warnings::{id}::{mistake}"),
            move || {
                let arguments = format!("--id {id} --option mistake={mistake} --only {case}");
                let document = check(promising(), &arguments, SUCCESS);
                let warnings = document["plugins"][0]["cases"][0]["warnings"].to_string();
                assert!(warnings.contains(text), "{warnings}");
            },
        );
    }
    // Allowed, and worth knowing.
    tests.add("conformance::notes::promising::none", || {
        let arguments = "--id promising --option mistake=none --only passing-bay";
        let document = check(promising(), arguments, SUCCESS);
        let case = &document["plugins"][0]["cases"][0];
        let notes = case["notes"].to_string();
        assert!(notes.contains("no answer: `gave-up`"), "{case}");
        assert_eq!(case["warnings"], json!([]), "{case}");
        assert_eq!(document["plugins"][0]["given_up"], 1, "{document}");
    });
}

fn every_case_is_failed() {
    let tables = PROMISES.iter().chain(EVERYWHERE).chain(ON_PLACES);
    let caught: BTreeSet<String> = tables
        .flat_map(|(.., names)| expected(&names.replace('!', "")))
        .collect();
    // By plugins that are described wrongly, are none, do not end, are deaf, claim what
    // cannot be, or change the host's process.
    let elsewhere = expected(
        "descriptor handshake ending deadline figures host-process critical-part \
         other-representation",
    );
    // Figures and warnings alone; what depends on the machine.
    let nobody = expected("scan-time output thread-limit large-case");
    let listed = Yard::new().line("plugins check --list --format json");
    for case in listed.expect(SUCCESS).json().as_array().unwrap() {
        let name = case["case"].as_str().unwrap();
        let found = [&caught, &elsewhere, &nobody]
            .into_iter()
            .any(|all| all.contains(name));
        assert!(found, "nobody fails `{name}`");
    }
}

fn deaf_is_stopped() {
    let only: String = ["crossing", "colliding-plans", "deadline", "cancelled"]
        .map(|case| format!(" --only {case}"))
        .concat();
    let arguments = format!("--id promising --option mistake=deaf --budget 1s --grace 200ms{only}");
    let document = check(promising(), &arguments, PLUGIN);
    assert_eq!(
        bad(&document),
        expected("colliding-plans deadline cancelled")
    );
}

// ---- Broken protocols, crashes, hangs --------------------------------------------

/// Cases that judge plans which the faulty planners can make.
const JUDGED: &str = "one-cell one-agent arrived following crossing random-instances makespan figures \
    deterministic unknown-part critical-part annotations-off seed-53 repeated-calls other-map made-again bad-input cancelled prepare-deadline";

/// Those, and cases that ask for a plan without looking at it.
const ANSWERED: &str = "one-cell one-agent arrived following crossing random-instances makespan figures \
    deterministic unknown-part critical-part annotations-off seed-53 repeated-calls other-map made-again bad-input cancelled prepare-deadline \
    output ending memory-growth";

/// Every case that asks a planner anything.
const ASKED: &str = "one-cell one-agent arrived following crossing random-instances makespan figures \
    deterministic unknown-part critical-part annotations-off seed-53 repeated-calls other-map made-again bad-input cancelled prepare-deadline \
    output ending memory-growth cycle passing-bay no-room unreachable-goal node-limit deadline \
    thread-limit";

fn faulty_libraries(tests: &mut Tests) {
    for (fault, wanted) in [
        ("none", expected("")),
        ("garbage", expected("")),
        ("nan", expected("")),
        ("too-few-agents", expected(ANSWERED)),
        ("not-at-goal", expected(JUDGED)),
        ("teleport", expected(JUDGED)),
        ("collide", expected(JUDGED)),
        ("bad-status", expected(ANSWERED)),
        ("claims-solved-without-plan", expected(ASKED)),
        ("negative-expansions", expected(ASKED)),
        ("crash", crashed(ASKED)),
        // When its objects end, it does: objects end where a second one is made.
        (
            "crash --option during=destroy",
            crashed("default-options unknown-option invalid-options ending made-again"),
        ),
        (
            "never --budget 300ms --grace 100ms --only handshake --only default-options \
             --only one-cell --only deadline --only ending",
            expected("one-cell deadline ending"),
        ),
    ] {
        let short = fault.split(" --budget").next().unwrap();
        tests.add(
            &format!("conformance::faulty library::{short}"),
            move || {
                let library = faulty_library().display().to_string();
                let budget = if fault.contains("--budget") {
                    ""
                } else {
                    "--budget 20s --skip large-case"
                };
                fails(
                    &library,
                    &format!("--option fault={fault} {budget}"),
                    &wanted,
                );
            },
        );
    }
    for variant in [
        "WRONG_MAJOR",
        "NO_SYMBOL",
        "CONSTRUCTOR_CRASH",
        "BAD_SCHEMA",
    ] {
        tests.add(
            &format!("conformance::faulty library::{variant}"),
            move || {
                let library = c_library("plugins/faulty/faulty.c", Some(variant));
                let document = fails(&library.display().to_string(), "", &expected("handshake"));
                assert_eq!(document["plugins"][0]["id"], Value::Null);
            },
        );
    }
    tests.add("conformance::faulty library::LYING_CAPABILITIES", || {
        let library = c_library("plugins/faulty/faulty.c", Some("LYING_CAPABILITIES"));
        let wanted = expected("descriptor eight-connected rotation k-robust move-mask");
        fails(&library.display().to_string(), "--budget 20s", &wanted);
    });
}

fn faulty_programs(tests: &mut Tests) {
    const SOME: &str = "--only handshake --only descriptor --only default-options --only output \
                        --only ending --only one-cell --only made-again";
    for (fault, wanted) in [
        ("none", expected("")),
        ("two-results", expected("ending made-again")),
        (
            "answers-early",
            expected("output ending one-cell made-again"),
        ),
        ("nan", expected("output ending one-cell made-again")),
        ("crash --option during=shutdown", crashed("ending")),
        (
            "exit-3 --option during=create",
            crashed("default-options output ending one-cell made-again"),
        ),
        (
            "fails --option during=prepare",
            expected("output ending one-cell made-again"),
        ),
    ] {
        tests.add(
            &format!("conformance::faulty program::{fault}"),
            move || {
                if have("python3") {
                    let program = faulty_program().display().to_string();
                    fails(&program, &format!("--option fault={fault} {SOME}"), &wanted);
                }
            },
        );
    }
    tests.add("conformance::faulty program::garbage", || {
        if have("python3") {
            let program = faulty_program().display().to_string();
            let document = check(&program, "--option fault=garbage --only output", SUCCESS);
            let warnings = document["plugins"][0]["cases"][0]["warnings"].to_string();
            assert!(
                warnings.contains("standard output that are no messages"),
                "{warnings}"
            );
        }
    });
}

fn changed_process() {
    let library = faulty_library().display().to_string();
    let some = "--attach in-process --only host-process --only one-cell --option";
    for fault in ["leaves-umask", "leaves-signals"] {
        let document = check(&library, &format!("{some} fault={fault}"), PLUGIN);
        assert_eq!(bad(&document), expected("host-process"), "{fault}");
    }
    let document = check(&library, &format!("{some} fault=none"), SUCCESS);
    assert_eq!(bad(&document), BTreeSet::new());
}

fn crash_in_process() {
    let library = faulty_library().display().to_string();
    let arguments = "--attach in-process --option fault=crash --only handshake --only one-cell \
                     --only ending";
    let document = check(&library, arguments, PLUGIN);
    assert_eq!(bad(&document), crashed("one-cell ending"));
    // Nobody can stop a call there, but the host that makes it can be stopped.
    let arguments = "--attach in-process --option fault=never --budget 50ms --grace 50ms \
                     --startup 500ms --only handshake --only one-cell";
    let document = check(&library, arguments, PLUGIN);
    assert_eq!(bad(&document), expected("one-cell"));
}

// ---- The command -----------------------------------------------------------------

fn failure_is_replayed() {
    let library = faulty_library().display().to_string();
    let text = run(
        &library,
        "--option fault=collide --only random-instances --seed 7",
    );
    let text = text.expect(PLUGIN).stdout;
    let replay = text
        .lines()
        .find_map(|line| line.trim().strip_prefix("replay: fleetyard "))
        .unwrap_or_else(|| panic!("no replay in {text}"));
    let again = Yard::new().run(&words(replay)).expect(PLUGIN).stdout;
    let reason = |text: &str| {
        let lines = text.lines().skip_while(|line| !line.contains("failed"));
        let lines = lines.skip(1).take_while(|line| !line.contains("replay:"));
        lines.map(str::to_owned).collect::<Vec<_>>()
    };
    assert!(!reason(&text).is_empty(), "{text}");
    assert_eq!(reason(&text), reason(&again));
    // Another seed asks something else.
    let other = run(
        &library,
        "--option fault=collide --only random-instances --seed 8",
    );
    assert_ne!(reason(&text), reason(&other.expect(PLUGIN).stdout));
}

fn results() {
    let arguments = "--only handshake --only ending --only windowed --only fleet-states";
    let text = run("bfs", arguments).expect(SUCCESS).stdout;
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(
        lines[0],
        concat!(
            "bfs ",
            env!("CARGO_PKG_VERSION"),
            " (planner, worker process)"
        )
    );
    let start = |line: &str| {
        line.split_whitespace()
            .take(2)
            .collect::<Vec<_>>()
            .join(" ")
    };
    assert_eq!(
        lines[1..5]
            .iter()
            .map(|line| start(line))
            .collect::<Vec<_>>(),
        [
            "passed handshake",
            "passed ending",
            "skipped fleet-states",
            "skipped windowed"
        ]
    );
    assert!(
        lines[4].ends_with("the plugin does not claim `windowed`"),
        "{text}"
    );
    assert_eq!(
        lines[6],
        "2 passed, 0 failed, 0 crashed, 2 skipped, 0 warnings, 0 notes"
    );

    let document = check("bfs", arguments, SUCCESS);
    assert_eq!(document["plugin"], "bfs");
    assert_eq!(document["attach"], "worker");
    assert_eq!(document["seed"], 1);
    let plugin = &document["plugins"][0];
    assert_eq!(
        (&plugin["kind"], &plugin["id"]),
        (&"planner".into(), &"bfs".into())
    );
    let case = &plugin["cases"][0];
    assert_eq!(case["case"], "handshake");
    assert_eq!(case["reason"], Value::Null);
    assert!(case["seed"].is_u64() && case["time_ms"].is_f64(), "{case}");
    assert_eq!(document["summary"]["skipped"], 2);
}

fn plugins_are_chosen() {
    let library = example_library();
    let chosen = |plugin: &str, arguments: &str| {
        let document = check(plugin, &format!("--only handshake {arguments}"), SUCCESS);
        let ids = list(&document, "plugins")
            .iter()
            .map(|plugin| plugin["id"].as_str().unwrap());
        ids.map(str::to_owned).collect::<Vec<_>>()
    };
    let all = ["layered", "all-wait", "random-goals", "periodic"];
    assert_eq!(chosen(&library, ""), all);
    assert_eq!(chosen(&library, "--kind fail-policy"), ["all-wait"]);
    assert_eq!(chosen(&library, "--id periodic"), ["periodic"]);
    assert_eq!(
        chosen(&format!("{library}:random-goals"), ""),
        ["random-goals"]
    );
}

/// Command lines are refused before anything is started.
fn wrong_command_lines(tests: &mut Tests) {
    let raw = root().join("plugins/examples/python/raw_protocol.py");
    let raw = raw.display().to_string();
    for (name, plugin, arguments, texts) in [
        (
            "case nearly of that name",
            "pibt",
            "--only dedline",
            ["no case `dedline`", "did you mean `deadline`?"],
        ),
        (
            "unknown case",
            "pibt",
            "--only xyzzy",
            ["no case `xyzzy`", "--list` shows them all"],
        ),
        (
            "seed without case",
            "pibt",
            "--reproduce 3",
            ["the seed of one case", "name the case"],
        ),
        (
            "unknown kind",
            "pibt",
            "--kind robot",
            ["robot", "instance-generator"],
        ),
        (
            "unknown option",
            "pibt",
            "--kind planner --option swapp=true",
            ["unknown option `swapp`", "did you mean `swap`?"],
        ),
        (
            "library as a program",
            "pibt",
            "--attach stdio",
            ["a shared library does not speak", "--attach worker"],
        ),
        (
            "unknown identifier",
            "pibt",
            "--id lacamm",
            ["no such plugin", "pibt (planner)"],
        ),
        (
            "plugin nearly of that name",
            "pibtt",
            "",
            ["there is no plugin `pibtt`", "did you mean `pibt`?"],
        ),
        (
            "program in the host",
            "RAW",
            "--attach in-process",
            ["a program cannot be loaded", "leave out"],
        ),
        (
            "option of one plugin of several",
            "EXAMPLE",
            "--option attempts=3",
            ["fail-policy `all-wait`", "--kind and --id"],
        ),
        ("nothing", "", "", ["required", "<PLUGIN>"]),
    ] {
        let raw = raw.clone();
        tests.add(&format!("conformance::command line::{name}"), move || {
            let mut line = words("plugins check");
            match plugin {
                "" => {}
                "RAW" => line.push(raw),
                "EXAMPLE" => line.push(example_library()),
                _ => line.push(plugin.to_owned()),
            }
            line.extend(words(arguments));
            let ended = Yard::new().run(&line).expect(USAGE);
            says(&ended, &texts);
            assert_eq!(ended.stdout, "", "{ended}");
        });
    }
}

fn cases_are_documented() {
    let page = fs::read_to_string(root().join("docs/conformance.md")).unwrap();
    let mut rows = BTreeMap::new();
    for line in page.lines() {
        if let Some((name, rest)) = line
            .strip_prefix("| `")
            .and_then(|row| row.split_once("` | "))
        {
            assert!(rows.insert(name, rest).is_none(), "`{name}` is there twice");
        }
    }
    let listed = Yard::new()
        .line("plugins check --list --format json")
        .expect(SUCCESS)
        .json();
    for case in listed.as_array().unwrap() {
        let name = case["case"].as_str().unwrap();
        let row = rows
            .remove(name)
            .unwrap_or_else(|| panic!("`{name}` is not in the page"));
        let about = case["about"].as_str().unwrap();
        assert!(
            row.starts_with(about),
            "{name}: the page says `{row}`, the table `{about}`"
        );
    }
    assert_eq!(
        rows,
        BTreeMap::new(),
        "the page has cases that there are not"
    );
}
