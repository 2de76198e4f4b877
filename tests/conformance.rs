//! The conformance kit, `fleetyard plugins check`: the standard plugins and the examples
//! pass in every attachment that they have, and plugins that break a promise fail the
//! cases that ask for it, and no others.
//!
//! Instances follow from a seed that stays the same here, so the tables below do not
//! depend on chance; where a case is about time, the plugin misses by seconds or not at
//! all.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::sync::OnceLock;

use fleetyard_testkit::{
    Built, Ended, PLUGIN, SUCCESS, USAGE, Yard, build, c_library, faulty_library, faulty_program,
    have, root, words,
};
use serde_json::Value;

/// Runs `plugins check`.
fn run(plugin: &str, arguments: &str) -> Ended {
    let mut line = vec!["plugins", "check", plugin]
        .into_iter()
        .map(str::to_owned)
        .collect::<Vec<_>>();
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

/// A plugin with which nothing is wrong, checked in each attachment.
#[track_caller]
fn passes(plugin: &str, plugins: usize, attachments: &[&str]) {
    for attachment in attachments {
        // Too short for some answers at times, which is a warning.
        let document = check(plugin, &format!("--budget 500ms {attachment}"), SUCCESS);
        assert_eq!(bad(&document), BTreeSet::new(), "{plugin} {attachment}");
        assert_eq!(list(&document, "plugins").len(), plugins, "{plugin}");
        let passed = document["summary"]["passed"].as_u64().unwrap();
        assert!(passed >= 11, "{plugin} {attachment}: {passed} passed");
    }
}

const BOTH: &[&str] = &["--attach worker", "--attach in-process"];

#[test]
fn built_in_planners_pass() {
    passes("lacam", 1, BOTH);
    passes("pibt", 1, &["--kind planner"]);
    passes("empty", 1, &["--attach in-process"]);
}

#[test]
fn planners_that_search_conflicts_pass() {
    passes("cbs", 1, &["--attach worker"]);
    passes("ecbs", 1, &["--attach in-process"]);
}

#[test]
fn planners_by_priorities_pass() {
    passes("pp", 1, &["--attach worker"]);
    passes("pbs", 1, &["--attach in-process"]);
}

#[test]
fn planners_that_repair_pass() {
    passes("mapf-lns2", 1, &["--attach in-process"]);
    passes("mapf-lns", 1, &["--attach worker"]);
}

#[test]
fn built_in_planners_for_one_agent_pass() {
    passes("astar", 1, &["--attach in-process"]);
    passes("beam-search", 1, &["--attach in-process"]);
    passes("theta-star", 1, &["--attach worker"]);
}

#[test]
fn built_in_modules_of_fleets_pass() {
    for kind in ["fail-policy", "instance-generator", "invocation-policy"] {
        let described = run_listing();
        let ids = described.iter().filter(|of| of["kind"] == kind);
        let ids: Vec<&str> = ids.map(|of| of["id"].as_str().unwrap()).collect();
        assert!(ids.len() >= 2, "{described:?}");
        for id in &ids {
            passes(id, 1, &[&format!("--kind {kind} --attach worker")]);
        }
        // One of each kind in the host's own process as well.
        passes(ids[0], 1, &[&format!("--kind {kind} --attach in-process")]);
    }
}

/// The plugins that are linked in.
fn run_listing() -> Vec<Value> {
    let listed = Yard::new().line("plugins list --format json");
    let listed = listed.expect(SUCCESS).json();
    list(&listed[0], "plugins").clone()
}

#[test]
fn the_standard_plugins_as_a_library_and_a_program_pass() {
    let Built { library, program } = build("fleetyard-plugins");
    let library = library.unwrap();
    let all = run_listing().len();
    // All cases are asked of some of them above.
    let only = "--attach worker --only handshake --only descriptor --only default-options \
                --only invalid-options --only random-instances --only any-angle --only unreachable-goal";
    passes(&library.display().to_string(), all, &[only]);
    let program = program.unwrap().display().to_string();
    for kind in ["fail-policy", "instance-generator", "invocation-policy"] {
        let modules = run_listing().iter().filter(|of| of["kind"] == kind).count();
        passes(
            &program,
            modules,
            &[&format!("--kind {kind} --attach stdio")],
        );
    }
}

#[test]
fn the_examples_in_c_pass() {
    for (name, attachments) in [
        ("prioritized", BOTH),
        ("stop_before", BOTH),
        ("first_task", &[""]),
        ("when_idle", &[""]),
    ] {
        let library = c_library(&format!("plugins/examples/c/{name}.c"), None);
        passes(&library.display().to_string(), 1, attachments);
    }
}

#[test]
fn the_examples_in_cpp_pass() {
    if !have(&std::env::var("CXX").unwrap_or_else(|_| "c++".into())) {
        return;
    }
    for (name, attachments) in [
        ("cbs", BOTH),
        ("follow", &[""]),
        ("nearest_task", &[""]),
        ("just_in_time", &[""]),
    ] {
        let library = c_library(&format!("plugins/examples/cpp/{name}.cpp"), None);
        passes(&library.display().to_string(), 1, attachments);
    }
}

#[test]
fn the_examples_in_rust_pass() {
    let Built { library, program } = example();
    let library = library.as_ref().unwrap().display().to_string();
    passes(&library, 4, &["--attach worker"]);
    passes(&format!("{library}:all-wait"), 1, &["--attach in-process"]);
    passes(
        &program.as_ref().unwrap().display().to_string(),
        4,
        &["--attach stdio"],
    );
}

#[test]
fn the_examples_in_python_pass() {
    if !have("python3") {
        return;
    }
    let folder = root().join("plugins/examples/python");
    for script in [
        "pibt",
        "raw_protocol",
        "follow",
        "nearest_task",
        "just_in_time",
    ] {
        let script = folder.join(format!("{script}.py"));
        passes(&script.display().to_string(), 1, &[""]);
    }
    let search = folder.join("grid_search.py").display().to_string();
    passes(&format!("{search}:weighted-astar-python"), 1, &[""]);
}

#[test]
fn the_example_in_java_passes() {
    if !have("java") {
        return;
    }
    // A virtual machine takes its time to start, for every case anew.
    let only = "--only handshake --only ending --only crossing --only repeated-calls \
                --only bad-input --only deadline";
    let program = root().join("plugins/examples/java/one-by-one");
    let document = check(
        &program.display().to_string(),
        &format!("--budget 500ms {only}"),
        SUCCESS,
    );
    assert_eq!(bad(&document), BTreeSet::new(), "{document}");
    assert_eq!(document["summary"]["passed"], 6, "{document}");
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

#[test]
fn an_adapter_is_checked_like_any_other_plugin() {
    use std::os::unix::fs::PermissionsExt;
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

/// A plugin of `plugins/faulty/promises`, its mistake, and what it fails. What answers
/// at once, right or wrong, is not affected by the length of the budget.
type Promise = (&'static str, &'static str, &'static str);

const PROMISES: &[Promise] = &[
    ("promising", "none", ""),
    ("promising", "refuses-default", "default-options"),
    ("promising", "dies-of-unknown-option", "unknown-option!"),
    ("promising", "dies-of-bad-option", "invalid-options!"),
    ("promising", "made-once", "default-options made-again"),
    ("promising", "chatters", ""),
    ("promising", "no-one-cell", "one-cell"),
    (
        "promising",
        "one-agent-jumps",
        "one-agent eight-connected any-angle rotation",
    ),
    ("promising", "nothing-to-do-fails", "arrived one-cell"),
    (
        "promising",
        "follows-nobody",
        "following cycle random-instances repeated-calls other-map cancelled",
    ),
    ("promising", "through-walls", "unreachable-goal any-angle"),
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
    ("promising", "unseeded", "deterministic repeated-calls"),
    ("promising", "old-answer", "repeated-calls"),
    (
        "promising",
        "old-map",
        "other-map cancelled prepare-deadline",
    ),
    ("promising", "dies-of-bad-input", "bad-input!"),
    ("promising", "stale-cancel", "cancelled"),
    ("promising", "leaks", "memory-growth"),
    ("promising", "slow-prepare", "prepare-deadline"),
    ("promising-policy", "none", ""),
    ("promising-policy", "returns-failed-plan", "failed-plan"),
    ("promising-generator", "none", ""),
    ("promising-generator", "forgets-headings", "rotation"),
    ("promising-generator", "forgets-window", ""),
    ("promising-generator", "idle-fleet-fails", "fleet-states"),
    ("promising-invocation", "none", ""),
    ("promising-invocation", "dies-of-crowd", "fleet-statuses!"),
    ("promising-invocation", "never-calls", ""),
];

fn expected(names: &str) -> BTreeSet<String> {
    names.split_whitespace().map(str::to_owned).collect()
}

/// The library of those plugins; cargo is asked for it once.
fn promises() -> &'static str {
    static LIBRARY: OnceLock<String> = OnceLock::new();
    LIBRARY.get_or_init(|| {
        let library = build("fleetyard-faulty-promises").library.unwrap();
        library.display().to_string()
    })
}

/// The example in Rust, in the same way.
fn example() -> &'static Built {
    static BUILT: OnceLock<Built> = OnceLock::new();
    BUILT.get_or_init(|| build("fleetyard-example-rust"))
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
        "moves-fleet",
        "crossing random-instances",
    ),
    ("promising-generator", "blocked-goals", "random-instances"),
];

const SOME: &str = "--only handshake --only crossing --only passing-bay --only random-instances \
                    --only no-room --only colliding-plans";

/// Plugins that are described wrongly, with the cases that fail.
const DESCRIBED: &[(&str, &str)] = &[
    ("two-faces", "descriptor"),
    ("bad-default", "descriptor"),
    // The SDK refuses the grids that it does not claim.
    (
        "contradiction",
        "descriptor ending made-again memory-growth output repeated-calls thread-limit",
    ),
];

#[track_caller]
fn breaks(table: &[Promise], only: &str, wanted: impl Fn(&str) -> bool) {
    for (id, mistake, names) in table.iter().filter(|(id, ..)| wanted(id)) {
        let arguments = format!("--id {id} --option mistake={mistake} --budget 20s {only}");
        let code = if names.is_empty() { SUCCESS } else { PLUGIN };
        let document = check(promises(), &arguments, code);
        assert_eq!(bad(&document), expected(names), "{id} {mistake}");
    }
}

#[test]
fn a_planner_that_breaks_a_promise_fails_the_case_that_asks_for_it() {
    breaks(PROMISES, "", |id| id == "promising");
}

#[test]
fn so_does_a_plugin_of_another_kind() {
    breaks(PROMISES, "", |id| id != "promising");
    for (id, names) in DESCRIBED {
        let document = check(promises(), &format!("--id {id}"), PLUGIN);
        assert_eq!(bad(&document), expected(names), "{id}");
    }
}

#[test]
fn what_is_wrong_everywhere_is_found_everywhere() {
    breaks(EVERYWHERE, SOME, |_| true);
}

#[test]
fn every_case_is_failed_by_somebody() {
    let tables = PROMISES.iter().chain(EVERYWHERE);
    let caught: BTreeSet<String> = tables
        .flat_map(|(.., names)| expected(&names.replace('!', "")))
        .collect();
    // By plugins that are described wrongly, are none, do not end, are deaf, claim what
    // cannot be, or change the host's process.
    let elsewhere = expected("descriptor handshake ending deadline figures host-process");
    // Figures and warnings alone; what depends on the machine; what cannot be asked yet.
    let nobody = expected("scan-time output thread-limit roadmap continuous");
    let listed = Yard::new().line("plugins check --list --format json");
    for case in listed.expect(SUCCESS).json().as_array().unwrap() {
        let name = case["case"].as_str().unwrap();
        let found = [&caught, &elsewhere, &nobody]
            .into_iter()
            .any(|all| all.contains(name));
        assert!(found, "nobody fails `{name}`");
    }
}

#[test]
fn who_does_not_hear_the_clock_is_stopped_and_named() {
    let only: String = ["crossing", "colliding-plans", "deadline", "cancelled"]
        .map(|case| format!(" --only {case}"))
        .concat();
    let arguments = format!("--id promising --option mistake=deaf --budget 1s --grace 200ms{only}");
    let document = check(promises(), &arguments, PLUGIN);
    assert_eq!(
        bad(&document),
        expected("colliding-plans deadline cancelled")
    );
}

#[test]
fn odd_but_allowed_is_a_warning() {
    let library = promises();
    let warned = |id: &str, mistake: &str, case: &str, text: &str| {
        let arguments = format!("--id {id} --option mistake={mistake} --only {case}");
        let document = check(library, &arguments, SUCCESS);
        let warnings = document["plugins"][0]["cases"][0]["warnings"].to_string();
        assert!(warnings.contains(text), "{id} {mistake}: {warnings}");
    };
    warned("promising", "chatters", "output", "logged 2000 lines");
    warned("promising", "none", "passing-bay", "no answer: `gave-up`");
    warned(
        "promising-generator",
        "forgets-window",
        "windowed",
        "a window of 0 steps, asked was 5",
    );
    warned(
        "promising-invocation",
        "never-calls",
        "fleet-statuses",
        "the fleet stands for good",
    );
}

// ---- Broken protocols, crashes, hangs --------------------------------------------

/// Cases that judge plans which the faulty planners can make.
const JUDGED: &str = "one-cell one-agent arrived following crossing random-instances makespan figures \
    deterministic repeated-calls other-map made-again bad-input cancelled prepare-deadline";

/// Those, and cases that ask for a plan without looking at it.
const ANSWERED: &str = "one-cell one-agent arrived following crossing random-instances makespan figures \
    deterministic repeated-calls other-map made-again bad-input cancelled prepare-deadline \
    output ending memory-growth";

/// Every case that asks a planner anything.
const ASKED: &str = "one-cell one-agent arrived following crossing random-instances makespan figures \
    deterministic repeated-calls other-map made-again bad-input cancelled prepare-deadline \
    output ending memory-growth cycle passing-bay no-room unreachable-goal node-limit deadline \
    thread-limit";

fn crashed(names: &str) -> BTreeSet<String> {
    names
        .split_whitespace()
        .map(|name| format!("{name}!"))
        .collect()
}

#[test]
fn faulty_planners_fail_what_they_break() {
    let library = faulty_library().display().to_string();
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
    ] {
        let code = if wanted.is_empty() { SUCCESS } else { PLUGIN };
        let arguments = format!("--option fault={fault} --budget 20s");
        assert_eq!(bad(&check(&library, &arguments, code)), wanted, "{fault}");
    }
    // When its objects end, it does: objects end where a second one is made.
    let arguments = "--option fault=crash --option during=destroy --budget 20s";
    let wanted = crashed("default-options unknown-option invalid-options ending made-again");
    assert_eq!(bad(&check(&library, arguments, PLUGIN)), wanted);
    let arguments = "--option fault=never --budget 300ms --grace 100ms --only handshake \
                     --only default-options --only one-cell --only deadline --only ending";
    let wanted = expected("one-cell deadline ending");
    assert_eq!(bad(&check(&library, arguments, PLUGIN)), wanted);
}

#[test]
fn libraries_that_are_faulty_before_there_is_a_planner() {
    for variant in [
        "WRONG_MAJOR",
        "NO_SYMBOL",
        "CONSTRUCTOR_CRASH",
        "BAD_SCHEMA",
    ] {
        let library = c_library("plugins/faulty/faulty.c", Some(variant));
        let document = check(&library.display().to_string(), "", PLUGIN);
        assert_eq!(bad(&document), expected("handshake"), "{variant}");
        assert_eq!(document["plugins"][0]["id"], Value::Null, "{variant}");
    }
    let library = c_library("plugins/faulty/faulty.c", Some("LYING_CAPABILITIES"));
    let document = check(&library.display().to_string(), "--budget 20s", PLUGIN);
    let wanted = expected("descriptor eight-connected rotation k-robust");
    assert_eq!(bad(&document), wanted);
}

#[test]
fn faulty_programs_fail_what_they_break() {
    if !have("python3") {
        return;
    }
    let program = faulty_program().display().to_string();
    let some = "--only handshake --only descriptor --only default-options --only output \
                --only ending --only one-cell --only made-again";
    for (arguments, wanted) in [
        ("--option fault=none", expected("")),
        ("--option fault=two-results", expected("ending made-again")),
        (
            "--option fault=answers-early",
            expected("output ending one-cell made-again"),
        ),
        (
            "--option fault=nan",
            expected("output ending one-cell made-again"),
        ),
        (
            "--option fault=crash --option during=shutdown",
            crashed("ending"),
        ),
        ("--option fault=exit-3 --option during=create", {
            crashed("default-options output ending one-cell made-again")
        }),
        ("--option fault=fails --option during=prepare", {
            expected("output ending one-cell made-again")
        }),
    ] {
        let code = if wanted.is_empty() { SUCCESS } else { PLUGIN };
        let document = check(&program, &format!("{arguments} {some}"), code);
        assert_eq!(bad(&document), wanted, "{arguments}");
    }
    let document = check(&program, "--option fault=garbage --only output", SUCCESS);
    let warnings = document["plugins"][0]["cases"][0]["warnings"].to_string();
    assert!(
        warnings.contains("standard output that are no messages"),
        "{warnings}"
    );
}

#[test]
fn a_library_that_changes_the_hosts_process_fails_one_case() {
    let library = faulty_library().display().to_string();
    let some = "--attach in-process --only host-process --only one-cell --option";
    for fault in ["leaves-umask", "leaves-signals"] {
        let document = check(&library, &format!("{some} fault={fault}"), PLUGIN);
        assert_eq!(bad(&document), expected("host-process"), "{fault}");
    }
    let document = check(&library, &format!("{some} fault=none"), SUCCESS);
    assert_eq!(bad(&document), BTreeSet::new());
}

#[test]
fn a_crash_in_the_hosts_own_process_takes_one_case_with_it() {
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

#[test]
fn a_failure_is_replayed_by_the_command_that_it_prints() {
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

#[test]
fn results_are_lines_for_people_and_one_document_for_programs() {
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
        "2 passed, 0 failed, 0 crashed, 2 skipped, 0 warnings"
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

#[test]
fn plugins_are_chosen_by_kind_and_identifier() {
    let library = example().library.as_ref().unwrap();
    let library = library.display().to_string();
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

#[test]
fn wrong_command_lines_are_refused_before_anything_is_started() {
    let program = root().join("plugins/examples/python/raw_protocol.py");
    let program = program.display().to_string();
    let example = example().library.as_ref().unwrap();
    let example = example.display().to_string();
    for (plugin, arguments, texts) in [
        (
            "pibt",
            "--only dedline",
            ["no case `dedline`", "did you mean `deadline`?"],
        ),
        (
            "pibt",
            "--only xyzzy",
            ["no case `xyzzy`", "--list` shows them all"],
        ),
        (
            "pibt",
            "--reproduce 3",
            ["the seed of one case", "name the case"],
        ),
        ("pibt", "--kind robot", ["robot", "instance-generator"]),
        (
            "pibt",
            "--kind planner --option swapp=true",
            ["unknown option `swapp`", "did you mean `swap`?"],
        ),
        (
            "pibt",
            "--attach stdio",
            ["a shared library does not speak", "--attach worker"],
        ),
        ("pibt", "--id lacamm", ["no such plugin", "pibt (planner)"]),
        (
            "pibtt",
            "",
            ["there is no plugin `pibtt`", "did you mean `pibt`?"],
        ),
        (
            &program,
            "--attach in-process",
            ["a program cannot be loaded", "leave out"],
        ),
        (
            &example,
            "--option attempts=3",
            ["fail-policy `all-wait`", "--kind and --id"],
        ),
        ("", "", ["required", "<PLUGIN>"]),
    ] {
        let mut line = words("plugins check");
        line.extend((!plugin.is_empty()).then(|| plugin.to_owned()));
        line.extend(words(arguments));
        let ended = Yard::new().run(&line).expect(USAGE);
        for text in texts {
            assert!(ended.stderr.contains(text), "no `{text}`: {ended}");
        }
        assert_eq!(ended.stdout, "", "{ended}");
    }
}

#[test]
fn every_case_is_in_the_documentation() {
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
