//! `fleetyard bench` and `fleetyard store`: suites that run, are interrupted, killed, split
//! and made again.

use std::collections::BTreeSet;
use std::fs;
use std::io::Read;
use std::path::Path;
use std::process::{Command, Stdio};
use std::thread;
use std::time::Instant;

use fleetyard_bench::{Row, Store};
use fleetyard_testkit::{
    INPUT, NO_PLAN, SUCCESS, USAGE, Yard, each, faulty_program, fleetyard, have, is_ignored, map,
    root, until, words,
};
use serde_json::json;

/// A suite of two planners on a small map; `more` stands before its tables.
fn suite(agents: &str, more: &str) -> String {
    let maps = root().join("maps").display().to_string();
    format!(
        r#"name = "small"

[protocol]
reuse = "planner"
{more}

[budget]
wall = "1m"

[[planner]]
plugin = "pibt"
attach = "in-process"

[[planner]]
label = "LaCAM"
plugin = "lacam"
options = {{ anytime = false }}

[[instances]]
scen = ["{maps}/empty-8-8-random-1.scen"]
agents = {agents}
"#
    )
}

fn rows(path: &Path) -> Vec<Row> {
    Store::open_read_only(path).unwrap().rows().unwrap()
}

fn lasting(rows: &[Row]) -> Vec<String> {
    rows.iter().map(crate::rows::lasting).collect()
}

#[test]
fn a_suite_runs_goes_on_and_says_what_changed() {
    let yard = Yard::new();
    yard.write("s.toml", suite("[1, 3, 5]", "seeds = [0, 1]"));
    let ended = yard.line("bench s.toml --format json").expect(SUCCESS);
    let report = ended.json();
    assert_eq!(report["made"], 12, "{ended}");
    assert_eq!(report["failed"], 0, "{ended}");
    assert_eq!(
        report["evaluation"]["planners"].as_array().unwrap().len(),
        2
    );
    assert_eq!(
        yard.files(),
        ["s.toml", "small.manifest.json", "small.sqlite"]
            .map(str::to_owned)
            .into()
    );
    let manifest: serde_json::Value =
        serde_json::from_slice(&yard.read("small.manifest.json")).unwrap();
    assert_eq!(manifest["trials"]["stored"], 12);
    assert!(manifest["ended_unix_ms"].is_u64());
    assert_eq!(manifest["planners"][1]["label"], "LaCAM");
    assert!(manifest["planners"][1]["sandbox"]["layers"].is_array());
    let first = rows(&yard.path("small.sqlite"));
    assert_eq!(first.len(), 12);
    let numbers: Vec<u64> = first.iter().map(|row| row.trial).collect();
    assert_eq!(numbers, (0..12).collect::<Vec<_>>());
    // Neither planner is always first; trials may begin within the same millisecond.
    let rounds = || {
        first
            .chunks(2)
            .map(|round| (round[0].started_unix_ms, round[1].started_unix_ms))
    };
    assert!(!rounds().all(|(pibt, lacam)| lacam < pibt));
    assert!(!rounds().all(|(pibt, lacam)| pibt < lacam));
    let row = &first[1];
    assert_eq!(
        (row.planner.as_str(), row.attach.as_str()),
        ("LaCAM", "worker")
    );
    assert_eq!(row.options, r#"{"anytime":false}"#);
    assert!(row.success && row.solve_time_ms > 0.0 && row.plan_digest.is_some());
    assert!(!first[0].ranked, "in the host's process");
    // Nothing is missing.
    let refused = yard.line("bench s.toml").expect(INPUT);
    assert!(refused.stderr.contains("12 trials already"), "{refused}");
    assert!(
        refused.stderr.contains("hint: go on with it by --resume"),
        "{refused}"
    );
    let again = yard
        .line("bench s.toml --resume --format json")
        .expect(SUCCESS);
    assert_eq!(again.json()["made"], 0);
    assert_eq!(rows(&yard.path("small.sqlite")), first);
    // Another budget is another trial: what there was is kept, apart.
    let ended = yard
        .line("bench s.toml --resume --set budget.wall=30s --format json")
        .expect(SUCCESS);
    assert!(
        ended
            .stderr
            .contains(r#"`budget.wall` was "1m" and is "30s""#),
        "{ended}"
    );
    assert_eq!(ended.json()["made"], 12);
    assert_eq!(ended.json()["superseded"], 12);
    let info = yard
        .line("store info small.sqlite --format json")
        .expect(SUCCESS);
    assert_eq!(info.json()["trials"], 12);
    assert_eq!(info.json()["superseded"], 12);
    let ended = yard
        .line("bench s.toml --resume --format json")
        .expect(SUCCESS);
    assert_eq!(
        (&ended.json()["made"], &ended.json()["superseded"]),
        (&0.into(), &12.into())
    );
    assert_eq!(rows(&yard.path("small.sqlite")), first);
    // What was made says how long more of it would take: of seconds, where budgets allow hours.
    let more = yard.line("bench s.toml --dry-run --format json --set protocol.repeats=50");
    let more = more.expect(SUCCESS).json();
    let [least, most] = [0, 1].map(|end| more["about_s"][end].as_f64().unwrap());
    assert!(least <= most && most < 0.1 * more["plans_s"].as_f64().unwrap());
    let other = yard.line("bench s.toml --resume --store small.sqlite --set name=big");
    let other = other.expect(INPUT);
    assert!(
        other.stderr.contains("belongs to the suite `small`"),
        "{other}"
    );
}

#[test]
fn a_dry_run_shows_the_plan_and_writes_nothing() {
    let yard = Yard::new();
    yard.write("s.toml", suite("[1, 3, 5]", "repeats = 2\nwarm_ups = 1"));
    let plan = yard
        .line("bench s.toml --dry-run --format json")
        .expect(SUCCESS)
        .json();
    assert_eq!(
        (&plan["trials"], &plan["warm_ups"]),
        (&12.into(), &6.into())
    );
    assert_eq!(plan["first"][0]["warm_up"], true);
    // Startup, learning the map, planning and ending: two budgets of a minute each, and a minute
    // and two seconds.
    assert_eq!(plan["at_most_s"], 18.0 * 182.0);
    let text = yard
        .line("bench s.toml --dry-run --shard 1/3")
        .expect(SUCCESS)
        .stdout;
    assert!(text.contains("trials     4 in shard 1/3"), "{text}");
    // It has tried nothing, and so it knows no better.
    let budgets = "if every plan takes its whole budget, most end before; at most ";
    assert!(text.contains(budgets), "{text}");
    assert_eq!(plan["plans_s"], 18.0 * 60.0);
    assert!(plan["about_s"].is_null());
    assert!(text.contains("warm-up  pibt"), "{text}");
    assert_eq!(yard.files(), BTreeSet::from(["s.toml".into()]));
}

/// A report's advice on making a trial again names the files.
#[test]
fn a_store_knows_where_its_files_were() {
    let yard = Yard::new();
    let maps = root().join("maps");
    for name in ["empty-8-8.map", "empty-8-8-random-1.scen"] {
        fs::create_dir_all(yard.path("far away")).unwrap();
        fs::copy(maps.join(name), yard.path("far away").join(name)).unwrap();
    }
    let suite = suite("[2]", "").replace(&maps.display().to_string(), "far away");
    yard.write("s.toml", suite);
    yard.line("bench s.toml").expect(SUCCESS);
    let meta = Store::open_read_only(&yard.path("small.sqlite")).unwrap();
    let places = meta.meta().unwrap().places;
    let [place] = &places.scenarios[..] else {
        panic!("{places:?}");
    };
    assert_eq!(
        (place.map.as_str(), place.scenario.as_str()),
        ("empty-8-8", "empty-8-8-random-1.scen")
    );
    let folder = fs::canonicalize(yard.path("far away")).unwrap();
    for (file, name) in [
        (&place.map_file, "empty-8-8.map"),
        (&place.scenario_file, "empty-8-8-random-1.scen"),
    ] {
        assert!(file.is_absolute(), "{}", file.display());
        assert_eq!(fs::canonicalize(file).unwrap(), folder.join(name));
    }
    // Built-in planners are known by their names.
    assert!(places.planners.is_empty(), "{places:?}");
    yard.line("report small.sqlite --html r.html")
        .expect(SUCCESS);
    let page = String::from_utf8(yard.read("r.html")).unwrap();
    assert!(page.contains("far away/empty-8-8-random-1.scen"));
}

#[test]
fn bad_input_is_said_before_anything_runs() {
    let yard = Yard::new();
    let good = suite("[1]", "");
    let cases = [
        (
            "planner",
            good.replace("\"pibt\"", "\"pibd\""),
            "no planner",
            11,
        ),
        ("option", good.replace("anytime", "anytim"), "anytim", 17),
        ("key", good.replace("attach", "atach"), "`atach`", 12),
        ("budget", good.replace("\"1m\"", "\"0s\""), "`wall`", 8),
        (
            "scenario",
            good.replace("random-1", "random-9"),
            "random-9",
            20,
        ),
        ("empty", good.replace("[1]", "[]"), "nothing to run", 21),
        ("agents", good.replace("[1]", "[9999]"), "9999 agents", 21),
        (
            "twice",
            good.replace("lacam", "pibt")
                .replace("{ anytime = false }", "{}")
                .replace(
                    "label = \"LaCAM\"",
                    "label = \"B\"\nattach = \"in-process\"",
                ),
            "the same as",
            17,
        ),
    ];
    each(cases, |(name, text, reason, line)| {
        let file = format!("{name}.toml");
        yard.write(&file, text);
        let ended = yard.line(&format!("bench {file}")).expect(INPUT);
        let place = format!("{file}:{line}:");
        assert!(ended.stderr.contains(reason), "{name}: {ended}");
        assert!(
            ended.stderr.contains(&place),
            "{name} is not at line {line}: {ended}"
        );
    });
    let missing = yard.line("bench nowhere.toml").expect(INPUT);
    assert!(missing.stderr.contains("no such file"), "{missing}");
    yard.write("s.toml", good);
    yard.write(
        "text.sqlite",
        "this is no store, whatever its name says".repeat(9),
    );
    let rows = [
        (
            "bench s.toml --store text.sqlite --resume",
            INPUT,
            "no SQLite database",
        ),
        ("bench s.toml --verify", INPUT, "there is no such store"),
        (
            "bench s.toml --store nowhere/s.sqlite",
            INPUT,
            "cannot be locked",
        ),
        ("store info text.sqlite", INPUT, "no SQLite database"),
        (
            "store merge out.sqlite text.sqlite",
            INPUT,
            "no SQLite database",
        ),
        ("bench s.toml --shard 3/2", USAGE, "write I/N"),
        ("bench s.toml --set wall=1s", INPUT, "wall"),
        ("bench s.toml --verify-sample 3", USAGE, "--verify"),
    ];
    each(rows, |(line, code, reason)| {
        let ended = yard.line(line).expect(code);
        assert!(ended.stderr.contains(reason), "{line}: {ended}");
    });
    let stores = yard
        .files()
        .into_iter()
        .filter(|name| name.contains(".sqlite"));
    assert_eq!(stores.collect::<Vec<_>>(), ["text.sqlite"]);
}

#[test]
fn a_store_of_a_newer_version_is_refused() {
    let yard = Yard::new();
    yard.write("s.toml", suite("[1]", ""));
    yard.line("bench s.toml").expect(SUCCESS);
    let mut store = yard.read("small.sqlite");
    store[63] += 1;
    yard.write("small.sqlite", &store);
    for line in ["bench s.toml --resume", "store info small.sqlite"] {
        let ended = yard.line(line).expect(INPUT);
        assert!(ended.stderr.contains("a store of version 2"), "{ended}");
        assert!(ended.stderr.contains("hint: "), "{ended}");
    }
    assert!(yard.read("small.sqlite") == store);
}

#[test]
fn whatever_kills_it_no_trial_is_lost_or_doubled() {
    let yard = Yard::new();
    yard.write("s.toml", suite("{ from = 1, to = 15 }", "repeats = 4"));
    let started = Instant::now();
    yard.line("bench s.toml --store whole.sqlite")
        .expect(SUCCESS);
    let took = started.elapsed();
    let whole = rows(&yard.path("whole.sqlite"));
    assert_eq!(whole.len(), 120);
    // A linear congruential generator (Knuth's MMIX): the points look random, and are the
    // same every time.
    let mut state: u64 = 20_240_601;
    let mut seen = 0;
    let path = yard.path("killed.sqlite");
    for _ in 0..50 {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        let point = took.mul_f64((state >> 33) as f64 / f64::from(1u32 << 31) * 0.7);
        let mut run = yard.start(&["bench", "s.toml", "--store", "killed.sqlite", "--resume"]);
        thread::sleep(point);
        run.child.kill().unwrap();
        let _ = run.child.wait();
        if let Ok(store) = Store::open_read_only(&path) {
            let keys = store.keys().unwrap();
            assert!(
                keys.len() >= seen,
                "trials were lost: {} of {seen}",
                keys.len()
            );
            seen = keys.len();
        }
    }
    let last = yard
        .line("bench s.toml --store killed.sqlite --resume --format json")
        .expect(SUCCESS);
    assert_eq!(last.json()["before"], seen);
    assert_eq!(lasting(&rows(&path)), lasting(&whole));
    // A file that did not have its name yet may be left of a process that was killed.
    let left: Vec<String> = yard
        .files()
        .into_iter()
        .filter(|name| name.starts_with("killed"))
        .collect();
    assert_eq!(left, ["killed.manifest.json", "killed.sqlite"]);
}

#[test]
fn an_interrupt_keeps_what_there_is_and_says_how_to_go_on() {
    for (signal, number) in [("INT", 2), ("TERM", 15)] {
        if is_ignored(signal) {
            continue;
        }
        let yard = Yard::new().in_own_group();
        yard.write("s.toml", suite("{ from = 1, to = 15 }", "repeats = 500"));
        let run = yard.start(&["bench", "s.toml"]);
        let path = yard.path("small.sqlite");
        let stored = || Store::open_read_only(&path).and_then(|store| store.counts());
        assert!(until(|| stored().is_ok_and(|(count, _)| count > 3)));
        let host = run
            .processes()
            .into_iter()
            .find(|process| process.id == run.child.id());
        host.unwrap().signal_group(signal);
        let mut ended = run.wait();
        // Planners end with their supervisors, which notice it a moment later.
        ended.left.clear();
        let ended = ended.expect(128 + number);
        let count = rows(&path).len();
        let said = format!("interrupted; {count} of 15000 trials are stored");
        assert!(ended.stderr.contains(&said), "{ended}");
        assert!(
            ended
                .stderr
                .contains("hint: go on with `fleetyard bench s.toml --resume`"),
            "{ended}"
        );
        assert!(!yard.files().contains("small.sqlite.lock"));
        let manifest: serde_json::Value =
            serde_json::from_slice(&yard.read("small.manifest.json")).unwrap();
        assert_eq!(manifest["trials"]["stored"], count);
    }
}

#[test]
fn a_store_has_one_writer() {
    let yard = Yard::new();
    yard.write("s.toml", suite("{ from = 1, to = 15 }", "repeats = 500"));
    let mut first = yard.start(&["bench", "s.toml"]);
    let path = yard.path("small.sqlite");
    assert!(until(|| path.exists()));
    let second = yard.line("bench s.toml --resume").expect(INPUT);
    let said = format!("process {} is writing this store", first.child.id());
    assert!(second.stderr.contains(&said), "{second}");
    // Reading is for everybody.
    yard.line("store info small.sqlite").expect(SUCCESS);
    first.child.kill().unwrap();
    first.child.wait().unwrap();
    yard.line("bench s.toml --resume --set protocol.repeats=1")
        .expect(SUCCESS);
}

#[test]
fn shards_together_are_the_whole() {
    let yard = Yard::new();
    yard.write("s.toml", suite("[1, 2, 3, 4, 5]", "seeds = [3, 4]"));
    yard.line("bench s.toml --store whole.sqlite")
        .expect(SUCCESS);
    for shard in 1..=3 {
        let line = format!("bench s.toml --shard {shard}/3 --store {shard}.sqlite --format json");
        let ended = yard.line(&line).expect(SUCCESS);
        let expected = if shard == 3 { 4 } else { 8 };
        assert_eq!(ended.json()["made"], expected);
    }
    // A part had a full ranking without a word.
    let part = "12 of 20 trials were not run, and count for nobody. ";
    let told = yard.line("report 1.sqlite").expect(SUCCESS);
    assert!(told.stdout.contains(part), "{told}");
    let told = yard
        .line("report 1.sqlite 2.sqlite 3.sqlite")
        .expect(SUCCESS);
    assert!(!told.stdout.contains("were not run"), "{told}");
    let merged = yard
        .line("store merge all.sqlite 1.sqlite 2.sqlite 3.sqlite")
        .expect(SUCCESS);
    assert_eq!(merged.stdout.trim(), "all.sqlite has 20 trials");
    assert_eq!(
        lasting(&rows(&yard.path("all.sqlite"))),
        lasting(&rows(&yard.path("whole.sqlite")))
    );
    let ended = yard
        .line("bench s.toml --store all.sqlite --resume --format json")
        .expect(SUCCESS);
    assert_eq!(ended.json()["made"], 0);
    let told = yard.line("report all.sqlite").expect(SUCCESS);
    assert!(!told.stdout.contains("were not run"), "{told}");
    // The same trials, made twice, took different times.
    let conflict = yard
        .line("store merge x.sqlite whole.sqlite 1.sqlite")
        .expect(INPUT);
    assert!(
        conflict.stderr.contains("8 trials have two results each"),
        "{conflict}"
    );
    assert!(!yard.path("x.sqlite").exists());
    yard.line("bench s.toml --set protocol.seeds=[9] --store other.sqlite")
        .expect(SUCCESS);
    let other = yard
        .line("store merge x.sqlite 1.sqlite other.sqlite")
        .expect(INPUT);
    assert!(
        other.stderr.contains("another state of the suite"),
        "{other}"
    );
}

/// A planner that goes nowhere, or when it is told so wherever it likes, and aborts when it is
/// asked for two agents.
const MOODY: &str = r#"#!/usr/bin/env python3
import os
import sys
sys.path.insert(0, "{sdk}")
import fleetyard

class Moody(fleetyard.Planner):
    id = "moody"
    capabilities = ("grid", "pebble")
    options_schema = {"type": "object", "properties": {"fickle": {"type": "boolean"}}}

    def plan(self, instance, budget, context):
        if len(instance.starts) == 2:
            os.abort()
        paths = [[start] for start in instance.starts]
        for step in os.urandom(30) if self.options.get("fickle") else b"":
            for path in paths:
                ways = list(self.grid.neighbors(path[-1]))
                path.append(ways[step % len(ways)])
        return paths

fleetyard.run(Moody)
"#;

fn moody(yard: &Yard, planners: &str, more: &str) -> String {
    use std::os::unix::fs::PermissionsExt;
    let sdk = root().join("abi/python").display().to_string();
    let path = yard.write("moody.py", MOODY.replace("{sdk}", &sdk));
    fs::set_permissions(path, fs::Permissions::from_mode(0o755)).unwrap();
    let text = suite("[1, 2, 3]", more);
    let (before, rest) = text.split_once("[[planner]]").unwrap();
    let (_, after) = rest.split_once("[[instances]]").unwrap();
    let sandbox = format!("[sandbox]\nread = [\"{sdk}\"]\n");
    format!("{before}{sandbox}\n{planners}\n[[instances]]{after}")
}

#[test]
fn a_crash_does_not_reach_the_next_trial() {
    let yard = Yard::new();
    let planner = "[[planner]]\nlabel = \"moody\"\nplugin = \"./moody.py\"\n";
    yard.write("s.toml", moody(&yard, planner, "repeats = 2"));
    let ended = yard.line("bench s.toml").expect(SUCCESS);
    let found: Vec<(u64, u32, String, bool)> = rows(&yard.path("small.sqlite"))
        .iter()
        .map(|row| {
            let new = row.startup_time_ms.is_some();
            (row.agents, row.repeat, row.termination.clone(), new)
        })
        .collect();
    let row = |agents, repeat, termination: &str, new| (agents, repeat, termination.into(), new);
    // A process is kept until it crashes, and then there is another one.
    assert_eq!(
        found,
        [
            row(1, 0, "completed", true),
            row(1, 1, "completed", false),
            row(2, 0, "crashed", false),
            row(2, 1, "crashed", true),
            row(3, 0, "completed", true),
            row(3, 1, "completed", false),
        ],
        "{ended}"
    );
    assert!(
        ended.stderr.contains("warning: moody on empty-8-8"),
        "{ended}"
    );
}

#[test]
fn who_does_not_keep_to_a_seed_is_named() {
    let yard = Yard::new();
    let planners = "[[planner]]\nlabel = \"calm\"\nplugin = \"./moody.py\"\n\
                    [[planner]]\nlabel = \"fickle\"\nplugin = \"./moody.py\"\n\
                    options = { fickle = true }\n";
    let text = moody(&yard, planners, "").replace("[1, 2, 3]", "[1, 3]");
    yard.write("s.toml", text);
    yard.line("bench s.toml").expect(SUCCESS);
    let verified = yard
        .line("bench s.toml --verify --format json")
        .expect(NO_PLAN);
    let json = verified.json();
    assert_eq!(json["equal"], 2, "{verified}");
    assert_eq!(json["nondeterministic"], json!(["fickle"]));
    assert_eq!(json["differ"].as_array().unwrap().len(), 2);
    assert_eq!(json["differ"][0]["what"], "plan");
    let text = yard
        .line("bench s.toml --verify --verify-sample 2")
        .expect(NO_PLAN)
        .stdout;
    assert!(
        text.contains("`fickle` gives different results for the same seed"),
        "{text}"
    );
    assert!(text.contains("2 trials not in the sample"), "{text}");
    // The code is another one: nothing can be said of what it did before.
    let mut code = yard.read("moody.py");
    code.extend(b"# changed\n");
    yard.write("moody.py", code);
    let none = yard.line("bench s.toml --verify").expect(INPUT);
    assert!(none.stderr.contains("moody.py is another one"), "{none}");
    assert!(none.stderr.contains("no trial of this state"), "{none}");
}

/// A planner is known by all that it may read, so far as it is not the system's.
#[test]
fn a_planner_is_all_that_is_in_its_folder() {
    let yard = Yard::new();
    let text = moody(&yard, "[[planner]]\nplugin = \"./moody.py\"\n", "");
    let lib = yard.path("lib");
    for folder in [&lib, &yard.path("own")] {
        fs::create_dir(folder).unwrap();
    }
    yard.write("lib/elsewhere.txt", "1");
    fs::rename(yard.path("moody.py"), yard.path("own/moody.py")).unwrap();
    let read = format!("read = [\"{}\", ", lib.display());
    yard.write(
        "own/s.toml",
        text.replace("[1, 2, 3]", "[1]").replace("read = [", &read),
    );
    let code = String::from_utf8(yard.read("own/moody.py")).unwrap();
    yard.write(
        "own/moody.py",
        code.replace("import fleetyard\n", "import fleetyard, helper\n"),
    );
    yard.write("own/helper.py", "STEPS = 1\n");
    let bench = |more: &str| {
        let line = format!("bench own/s.toml --store own/s.sqlite --format json {more}");
        yard.line(&line).expect(SUCCESS).json()
    };
    assert_eq!(bench("")["made"], 1);
    assert_eq!(bench("--resume")["made"], 0);
    // What a run itself leaves, and what Python does, is no part of a planner.
    fs::create_dir(yard.path("own/__pycache__")).unwrap();
    yard.write("own/__pycache__/helper.cpython-311.pyc", "compiled");
    fs::copy(yard.path("own/s.sqlite"), yard.path("own/other.sqlite")).unwrap();
    fs::copy(yard.path("own/s.toml"), yard.path("own/other.toml")).unwrap();
    assert_eq!(bench("--resume")["made"], 0);
    fs::create_dir(yard.path("own/data")).unwrap();
    for changed in ["own/data/weights.bin", "lib/elsewhere.txt"] {
        yard.write(changed, "STEPS = 2\n");
        let verified = yard.line("bench own/s.toml --store own/s.sqlite --verify");
        let name = if changed.starts_with("lib") {
            "lib is"
        } else {
            changed
        };
        let verified = verified.expect(INPUT);
        assert!(verified.stderr.contains(name), "{changed}: {verified}");
        assert_eq!(bench("--resume")["made"], 1, "{changed}");
    }
    assert_eq!(bench("--resume")["made"], 0);
    let info = yard
        .line("plugins info ./own/moody.py")
        .expect(SUCCESS)
        .stdout;
    for name in ["own/moody.py", "own/helper.py", "own/data/weights.bin"] {
        assert!(
            info.lines()
                .any(|line| line.starts_with("code: ") && line.ends_with(name)),
            "{info}"
        );
    }
    for line in info.lines().filter(|line| line.starts_with("code: ")) {
        let is_no_part = |name| line.contains(name);
        assert!(
            !["sqlite", "toml", "pycache"].iter().any(is_no_part),
            "{info}"
        );
    }
}

/// A device is of use to those alone to whom it was granted, and the record says so.
#[test]
fn a_device_is_used_by_those_who_were_granted_it() {
    let yard = Yard::new();
    let line = "plugins check pibt --only one-cell --allow-device nope";
    let none = yard.line(line).expect(INPUT);
    assert!(none.stderr.contains("or the path of a device"), "{none}");
    let folder = yard.path("own");
    fs::create_dir(&folder).unwrap();
    let node = folder.join("node");
    // The same numbers as /dev/zero, under a name of which nobody knows.
    let made = Command::new("mknod")
        .args(["-m", "666"])
        .arg(&node)
        .args(["c", "1", "5"])
        .output();
    let works = || fs::File::open(&node).and_then(|mut file| file.read(&mut [1]));
    if !made.is_ok_and(|made| made.status.success()) || !works().is_ok_and(|read| read == 1) {
        eprintln!("skipped: this user can make no device that works");
        return;
    }
    let text = moody(&yard, "[[planner]]\nplugin = \"./own/moody.py\"\n", "");
    let code = String::from_utf8(yard.read("moody.py")).unwrap();
    let uses = format!(
        "    def plan(self, instance, budget, context):\n        \
         device = os.open(\"{}\", os.O_RDWR)\n        \
         assert os.read(device, 2) == bytes(2) and os.write(device, b\"x\") == 1\n",
        node.display()
    );
    let code = code.replace("    def plan(self, instance, budget, context):\n", &uses);
    yard.write("own/moody.py", code);
    yard.write("s.toml", text.replace("[1, 2, 3]", "[1]"));
    yard.line("bench s.toml").expect(SUCCESS);
    let row = rows(&yard.path("small.sqlite")).remove(0);
    assert!(
        row.fault.is_some() && row.devices.is_none(),
        "{:?}",
        row.fault
    );
    for (store, level) in [
        ("auto.sqlite", ""),
        ("strict.sqlite", "level = \"strict\"\n"),
    ] {
        let granted = format!("[sandbox]\ndevices = [\"{}\"]\n{level}", node.display());
        let text = String::from_utf8(yard.read("s.toml")).unwrap();
        yard.write("g.toml", text.replace("[sandbox]\n", &granted));
        let ended = yard.line(&format!("bench g.toml --store {store}"));
        if ended.code != Some(SUCCESS) {
            // Not every machine grants all layers.
            assert!(
                !level.is_empty() && ended.stderr.contains("strict"),
                "{ended}"
            );
            continue;
        }
        let row = rows(&yard.path(store)).remove(0);
        assert_eq!(row.fault.as_deref(), None, "{level}");
        assert_eq!(row.devices.as_deref(), node.to_str());
        let report = yard.line(&format!("report {store}")).expect(SUCCESS).stdout;
        assert!(report.contains("planners were granted devices"), "{report}");
    }
}

/// Runs a script as root of a mount namespace of its own; what stands in the way, if it cannot be.
fn with_mounts(yard: &Yard, script: &str) -> Result<(i32, String), String> {
    let probe = Command::new("unshare")
        .args([
            "--mount",
            "--map-root-user",
            "mount",
            "-t",
            "tmpfs",
            "none",
            "/mnt",
        ])
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn();
    let mut probe = probe.map_err(|error| format!("unshare: {error}"))?;
    if !probe.wait().unwrap().success() {
        let mut why = String::new();
        let _ = probe.stderr.take().unwrap().read_to_string(&mut why);
        return Err(why.trim().to_owned());
    }
    let ended = Command::new("unshare")
        .args(["--mount", "--map-root-user", "sh", "-c", script])
        .current_dir(yard.path(""))
        .env("FLEETYARD", fleetyard())
        .env("HOME", yard.path(""))
        .env_remove("FLEETYARD_PLUGIN_PATH")
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&ended.stdout).into_owned()
        + &String::from_utf8_lossy(&ended.stderr);
    Ok((ended.status.code().unwrap_or(-1), text))
}

#[test]
fn a_full_disk_costs_no_trial_that_was_stored() {
    let yard = Yard::new();
    yard.write("s.toml", suite("{ from = 1, to = 15 }", "repeats = 40"));
    fs::create_dir(yard.path("small")).unwrap();
    let script = r#"
        mount -t tmpfs -o size=1m none small || exit 99
        "$FLEETYARD" bench s.toml --store small/s.sqlite > out 2> err
        echo "full: $?" >> out
        mount -o remount,size=64m small || exit 99
        "$FLEETYARD" store info small/s.sqlite --format json > info.json || exit 98
        "$FLEETYARD" bench s.toml --store small/s.sqlite --resume --format json > more.json || exit 97
        cp small/s.sqlite whole.sqlite
    "#;
    let (code, text) = match with_mounts(&yard, script) {
        Ok(ended) => ended,
        Err(why) => {
            eprintln!("skipped: no mount namespace here: {why}");
            return;
        }
    };
    assert_eq!(code, 0, "{text}");
    let read = |name: &str| String::from_utf8_lossy(&yard.read(name)).into_owned();
    let err = read("err");
    assert!(read("out").contains("full: 3"), "{} {err}", read("out"));
    assert!(err.contains("no space is left on the disk"), "{err}");
    assert!(
        err.contains("hint: what was stored before is kept"),
        "{err}"
    );
    let json = |name: &str| serde_json::from_str::<serde_json::Value>(&read(name)).unwrap();
    let stored = json("info.json")["trials"].as_u64().unwrap();
    assert!((1..1200).contains(&stored), "{stored} trials were stored");
    assert_eq!(json("more.json")["before"], stored);
    let rows = rows(&yard.path("whole.sqlite"));
    assert_eq!(rows.len(), 1200);
    assert!(rows.iter().all(|row| row.success));
}

#[test]
fn without_a_terminal_progress_is_lines_and_a_file() {
    let yard = Yard::new();
    yard.write("s.toml", suite("[1, 2]", ""));
    let ended = yard
        .line("bench s.toml --progress-file p.json")
        .expect(SUCCESS);
    assert!(ended.stdout.starts_with("planner"), "{ended}");
    assert!(ended.stdout.contains("4 trials made in "), "{ended}");
    let told: serde_json::Value = serde_json::from_slice(&yard.read("p.json")).unwrap();
    assert_eq!(told, json!({"done": 4, "trials": 4}));
    // Quick ones say nothing in between.
    assert!(!ended.stderr.contains("left"), "{ended}");
}

#[test]
fn a_suite_of_fleets_runs_goes_on_and_comes_out_the_same() {
    let yard = Yard::new();
    let hall = root().join("maps/warehouse-3-4-5-1-1-m2-a2-open-e-w3.map");
    yard.write(
        "f.toml",
        format!(
            r#"name = "fleets"
[protocol]
seeds = [1, 2]
[sandbox]
pin = false
[fleet]
duration = "20s"
window = "3s"
[[planner]]
label = "each second"
plugin = "pibt"
fleet = {{ period = "1s" }}
[[planner]]
label = "when idle"
plugin = "pibt"
fleet = {{ invocation = "event-based", fail_policy = "all-wait" }}
[[instances]]
map = "{}"
agents = [4, 8]
"#,
            hall.display()
        ),
    );
    let report = yard.line("bench f.toml --shard 1/2 --store a.sqlite --format json");
    assert_eq!(report.expect(SUCCESS).json()["made"], 4);
    yard.line("bench f.toml --shard 2/2 --store b.sqlite")
        .expect(SUCCESS);
    yard.line("store merge fleets.sqlite a.sqlite b.sqlite")
        .expect(SUCCESS);
    let rows = rows(&yard.path("fleets.sqlite"));
    assert_eq!(rows.len(), 8);
    for row in &rows {
        assert!(row.success, "{row:?}");
        assert_eq!((row.contacts, row.scenario.as_str()), (Some(0), "lifelong"));
        assert_eq!(row.budget_ms.to_bits(), 20_000f64.to_bits());
        assert_eq!(row.generator.as_deref(), Some("windowed-multi-goals"));
        let goals = row.goals_reached.unwrap();
        assert!(
            goals > 0 && goals <= row.goals_committed.unwrap(),
            "{row:?}"
        );
        let throughput = row.throughput_per_s.unwrap();
        assert!((throughput - goals as f64 / 20.0).abs() < 1e-9, "{row:?}");
        assert!(row.planner_calls.unwrap() > 0);
        let asked: serde_json::Value = serde_json::from_str(row.fleet.as_ref().unwrap()).unwrap();
        assert_eq!(asked["window_s"], 3.0);
        assert_eq!(asked["robots"], "agv");
    }
    let policies: BTreeSet<_> = rows.iter().map(|row| row.fail_policy.clone()).collect();
    assert_eq!(policies.len(), 2);
    let traces: BTreeSet<_> = rows.iter().map(|row| row.trace_digest.clone()).collect();
    assert!(traces.len() > 4, "{traces:?}");
    // Nothing is left to do, and made again it is the same.
    let again = yard.line("bench f.toml --store fleets.sqlite --resume --format json");
    assert_eq!(again.expect(SUCCESS).json()["made"], 0);
    let verified =
        yard.line("bench f.toml --store fleets.sqlite --verify --verify-sample 2 --format json");
    let verified = verified.expect(SUCCESS);
    assert!(
        verified.json()["differ"]
            .as_array()
            .is_none_or(Vec::is_empty),
        "{verified}"
    );
    let report = yard
        .line("report fleets.sqlite --markdown r.md --svg figures")
        .expect(SUCCESS);
    assert!(report.stdout.contains("each second"), "{report}");
    let figures = fs::read_dir(yard.path("figures")).unwrap();
    let figures: BTreeSet<String> = figures
        .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
        .collect();
    for figure in ["size-throughput_per_s.svg", "size-fail_policy_ratio.svg"] {
        assert!(figures.contains(figure), "{figures:?}");
    }
    // A plugin of another kind is refused at its place, before anything is run.
    let text = String::from_utf8(yard.read("f.toml")).unwrap();
    yard.write("g.toml", text.replace("\"all-wait\"", "\"event-based\""));
    let refused = yard.line("bench g.toml --store g.sqlite").expect(INPUT);
    assert!(refused.stderr.contains("g.toml:16:"), "{refused}");
    assert!(refused.stderr.contains("hint:"), "{refused}");
}

/// By the host's clock a planner looked slow whose core others burnt.
#[test]
fn by_processor_time_a_trial_is_ranked_where_all_of_it_is_known() {
    let yard = Yard::new();
    let text = suite("[1, 3]", "clock = \"cpu\"").replace("attach = \"in-process\"\n", "");
    yard.write("s.toml", text);
    yard.line("bench s.toml").expect(SUCCESS);
    for row in rows(&yard.path("small.sqlite")) {
        assert_eq!(row.clock.as_deref(), Some("cpu"));
        assert_eq!(
            (row.threads, row.reuse.as_deref()),
            (Some(1), Some("planner"))
        );
        let total = row.total_time_ms.unwrap();
        let parts = row.planning_time_ms
            + row.startup_time_ms.unwrap_or_default()
            + row.prepare_time_ms.unwrap_or_default();
        assert!((total - parts).abs() < 1e-9, "{row:?}");
        let counted = !row
            .limits_watched
            .iter()
            .any(|limits| limits.contains("cpu"));
        let known = row.cpu_time_ms.filter(|_| counted);
        assert_eq!(row.ranked, known.is_some(), "{row:?}");
        match known {
            Some(cpu_ms) => assert_eq!(row.solve_time_ms.to_bits(), cpu_ms.to_bits()),
            None => assert!(row.unranked.unwrap().contains("not known in full")),
        }
    }
}

/// Nothing here can disturb a trial for certain, so that what holds for all of them is tested.
#[test]
fn a_disturbed_trial_has_as_many_attempts_as_it_is_given() {
    let yard = Yard::new();
    yard.write("s.toml", suite("[1, 3]", "retry_contended = 5"));
    let dry = |options: &str| {
        let line = format!("bench s.toml --dry-run --format json {options}");
        yard.line(&line).expect(SUCCESS).json()
    };
    let (once, thrice) = (dry("--retry-contended 0"), dry("--retry-contended 2"));
    assert_eq!(once["retry_contended"], 0);
    let [once, thrice] = [once, thrice].map(|plan| plan["at_most_s"].as_f64().unwrap());
    assert!((thrice / once - 3.0).abs() < 1e-9, "{thrice} {once}");
    let made = yard
        .line("bench s.toml --retry-contended 2 --format json")
        .expect(SUCCESS)
        .json();
    let rows = rows(&yard.path("small.sqlite"));
    let attempts = |row: &Row| row.attempts.unwrap();
    let again: u32 = rows.iter().map(|row| attempts(row) - 1).sum();
    assert_eq!(made["again"], again);
    for row in &rows {
        assert!((1..=3).contains(&attempts(row)), "{row:?}");
        let disturbed = row.contended_by_others.unwrap();
        assert!(!disturbed || !row.contended.is_empty(), "{row:?}");
        assert!(!disturbed || attempts(row) == 3, "{row:?}");
    }
    // Another number of attempts is no other trial.
    let resumed = yard
        .line("bench s.toml --resume --format json")
        .expect(SUCCESS);
    assert!(
        resumed
            .stderr
            .contains("`protocol.retry_contended` was 2 and is 5"),
        "{resumed}"
    );
    let resumed = resumed.json();
    assert_eq!(
        (&resumed["made"], &resumed["superseded"]),
        (&0.into(), &0.into())
    );
    yard.line("bench s.toml --verify").expect(SUCCESS);
}

#[test]
fn who_forges_its_time_does_not_rank_first_and_is_named() {
    if !have("python3") {
        eprintln!("skipped: there is no python3");
        return;
    }
    let yard = Yard::new();
    let text = suite("[1, 3]", "clock = \"call\"").replace("attach = \"in-process\"\n", "");
    let forger = format!(
        "[[planner]]\nlabel = \"forger\"\nplugin = \"{}\"\noptions = {{ fault = \"forged-time\" }}\n\n\
         [[instances]]",
        faulty_program().display()
    );
    yard.write("s.toml", text.replace("[[instances]]", &forger));
    let report = yard
        .line("bench s.toml --format json")
        .expect(SUCCESS)
        .json();
    assert_eq!(report["failed"], 0, "{report:#}");
    let ranking = &report["evaluation"]["ranking"];
    assert_eq!(ranking["planners"][2]["planner"], "forger", "{ranking:#}");
    assert_eq!(ranking["by_expansions"], false);
    for row in rows(&yard.path("small.sqlite")) {
        let (empty, by) = (
            row.correction_ms.unwrap(),
            row.correction_uncertainty_ms.unwrap(),
        );
        let round_trip = row.round_trip_ms.unwrap();
        assert!(empty > 0.0 && by >= 0.0 && row.solve_time_ms >= 0.0);
        assert!(round_trip <= row.planning_time_ms);
        let net = (round_trip - empty).max(0.0);
        assert!((row.solve_time_ms - net).abs() < 1e-9, "{row:?}");
        assert_eq!(row.built_in, Some(row.planner != "forger"));
        if row.planner == "forger" {
            assert!(row.call_time_ms.is_some_and(|ms| ms < 2e-6), "{row:?}");
            let claims = row.false_claims.unwrap();
            assert!(
                claims.starts_with("time of work: 0.000001 ms claimed"),
                "{claims}"
            );
        }
    }
    let told = yard.line("report small.sqlite").expect(SUCCESS);
    for part in [
        "forger claims in 2 trials what the host found to be otherwise (time of work: 0.000001 ms",
        "Expansions are left out",
    ] {
        assert!(told.stdout.contains(part), "no `{part}`: {told}");
    }
    // By the host's clock, a claim is not in the time at all.
    yard.line("bench s.toml --set protocol.clock=host --store host.sqlite")
        .expect(SUCCESS);
    for row in rows(&yard.path("host.sqlite")) {
        assert_eq!(row.solve_time_ms.to_bits(), row.planning_time_ms.to_bits());
    }
    // A comparison lists it as well.
    let mut line = words("compare --no-execute --agents 1 --planner lacam --scen");
    line.push(map("empty-8-8-random-1.scen"));
    line.push("--planner".into());
    line.push(faulty_program().display().to_string());
    line.push("fault=forged-time".into());
    let told = yard.run(&line).expect(SUCCESS);
    assert!(told.stdout.contains("time of work"), "{told}");
}

/// Children of a planner that want its only core keep each other waiting; it was made again for that
/// until its dice were good.
#[test]
fn who_waits_for_its_own_children_is_not_asked_again() {
    if !have("python3") {
        eprintln!("skipped: there is no python3");
        return;
    }
    let yard = Yard::new();
    let roller = format!(
        "label = \"roller\"\nplugin = \"{}\"\noptions = {{ fault = \"re-rolls\" }}",
        faulty_program().display()
    );
    let text = suite("[3]", "retry_contended = 2\nrepeats = 4")
        .replace("plugin = \"pibt\"\nattach = \"in-process\"", &roller);
    yard.write("s.toml", text);
    // Where it has no core of its own, nobody can tell whose doing it is.
    for (pin, store) in [(true, "pinned.sqlite"), (false, "anywhere.sqlite")] {
        let line = format!("bench s.toml --set sandbox.pin={pin} --store {store} --format json");
        yard.line(&line).expect(SUCCESS);
        let rows = rows(&yard.path(store));
        let rolled = || rows.iter().filter(|row| row.planner == "roller");
        assert_eq!(rolled().count(), 4);
        for row in rolled() {
            // What others did meanwhile may be there as well.
            let own = row.contended_by_others == Some(false);
            assert!(own || row.contended.contains("by others"), "{row:?}");
            assert!(own || row.attempts == Some(3), "{row:?}");
            assert!(row.run_delay_ms.is_none_or(|delay| delay > 20.0), "{row:?}");
        }
        if !pin {
            let stolen = |row: &&Row| row.contended.contains("steal");
            let once = rolled().filter(|row| row.attempts == Some(1)).count();
            assert!(once == 4 || rolled().any(|row| stolen(&row)), "{rows:?}");
        }
    }
}

/// A kept process that computed while others were asked had the figures of its calls alone.
#[test]
fn who_works_between_its_calls_is_unranked() {
    if !have("python3") {
        eprintln!("skipped: there is no python3");
        return;
    }
    let yard = Yard::new();
    let planner = |label: &str, options: &str| {
        let plugin = faulty_program();
        let plugin = plugin.display();
        format!("label = \"{label}\"\nplugin = \"{plugin}\"\noptions = {{ {options} }}")
    };
    let worker = planner(
        "worker",
        "fault = \"works-between-calls\", during = \"create\"",
    );
    // It takes a while, in which the other has nothing to do.
    let sleeper = planner("sleeper", "fault = \"forged-time\"");
    let text = suite("[3]", "repeats = 4")
        .replace("plugin = \"pibt\"\nattach = \"in-process\"", &worker)
        .replace(
            "label = \"LaCAM\"\nplugin = \"lacam\"\noptions = { anytime = false }",
            &sleeper,
        );
    yard.write("s.toml", text);
    yard.line("bench s.toml").expect(SUCCESS);
    let rows = rows(&yard.path("small.sqlite"));
    let of = |planner: &'static str| rows.iter().filter(move |row| row.planner == planner);
    let why = |row: &Row| row.unranked.clone().unwrap_or_default();
    let told = of("worker").filter(|row| why(row).contains("between calls"));
    assert!(told.count() >= 1, "{rows:#?}");
    let between: f64 = of("worker")
        .filter_map(|row| row.cpu_between_calls_ms)
        .sum();
    assert!(between > 100.0, "{between}");
    assert!(of("sleeper").all(|row| row.ranked), "{rows:#?}");
}

#[test]
fn a_first_plan_that_breaks_a_rule_is_no_first_solution() {
    if !have("python3") {
        return;
    }
    let forger = faulty_program().display().to_string();
    let mut line = words("run --format json --agents 3 --option fault=first-plan-forged --scen");
    line.extend([map("empty-8-8-random-1.scen"), "--planner".into(), forger]);
    let record = Yard::new().run(&line).expect(SUCCESS).json();
    let metrics = &record["metrics"];
    let valid = |at: usize| &metrics["incumbents"][at]["valid"];
    assert_eq!(
        (valid(0), valid(1)),
        (&json!(false), &json!(true)),
        "{metrics:#}"
    );
    let solution = &metrics["incumbents"][1]["time_ms"];
    assert_eq!(&metrics["first_solution_ms"], solution, "{metrics:#}");
}

/// Copies the task with two rooms, and writes a suite of it next to it.
fn rooms(yard: &Yard, planners: &[&str], instances: &str) {
    for file in ["two-rooms.task.json", "two-rooms.world.json"] {
        yard.write(file, fs::read(root().join("maps").join(file)).unwrap());
    }
    let planners: Vec<String> = planners
        .iter()
        .map(|planner| format!("[[planner]]\nplugin = \"{planner}\"\n"))
        .collect();
    let planners = planners.concat();
    yard.write(
        "s.toml",
        format!(
            "name = \"rooms\"\nprotocol.keep_plans = true\nbudget.wall = \"1m\"\n[execution]\n{planners}\
             [[instances]]\ntask = \"*.task.json\"\n{instances}\n"
        ),
    );
}

#[test]
fn a_suite_asks_every_planner_about_the_views_that_it_claims() {
    let yard = Yard::new();
    let suite = root().join("scripts/suites/views.toml");
    let suite = suite.display().to_string();
    let bench = ["bench", suite.as_str(), "--store", "v.sqlite"];
    let more = ["--set", "protocol.repeats=1", "--format", "json"];
    let run = |last: &[&str]| yard.run(&[&bench[..], &more[..], last].concat());
    let report = run(&[]).expect(SUCCESS).json();
    // Two planners on two grids, one on four roadmaps, one in the plane, each with 1 to 3 robots.
    assert_eq!(report["made"], 3 * (2 * 2 + 4 + 1));
    assert_eq!(run(&["--resume"]).expect(SUCCESS).json()["made"], 0);
    let rows = rows(&yard.path("v.sqlite"));
    let of = |planner: &str, view: &str, agents: u64| -> &Row {
        let mut found = rows.iter().filter(|row| {
            row.planner == planner && row.view.as_deref() == Some(view) && row.agents == agents
        });
        let row = found.next().unwrap();
        assert!(found.next().is_none());
        row
    };
    for row in &rows {
        let text = format!("{row:?}");
        assert_eq!(row.map, "two-rooms", "{text}");
        assert_eq!(row.scenario, "two-rooms.task.json", "{text}");
        let on_grid = row.representation.as_deref() == Some("grid");
        assert_eq!(row.connectivity.is_some(), on_grid, "{text}");
        assert_eq!(row.map_rows.is_some(), on_grid, "{text}");
        assert_eq!(row.soc_steps.is_some(), on_grid, "{text}");
        assert_eq!(row.lower_bound_steps, None, "{text}");
        let in_plane = row.representation.as_deref() == Some("continuous");
        assert_eq!(row.valid_in_view, (!in_plane).then_some(true), "{text}");
        // Costs have one currency, whatever the view.
        let (length, soc, makespan) = (row.path_length_m, row.soc_s, row.makespan_s);
        let (length, soc, makespan) = (length.unwrap(), soc.unwrap(), makespan.unwrap());
        assert!(length <= soc + 1e-6 && makespan <= soc + 1e-6, "{text}");
        assert!(row.execution_makespan_s.is_some() && row.view_digest.is_some());
        let task = of("plane-pp", "continuous", row.agents);
        assert_eq!(row.task_digest, task.task_digest, "{text}");
        // Solved is what is valid on the view and in the world.
        assert_eq!(row.success, row.valid_in_world == Some(true), "{text}");
    }
    let dense = of("roadmap-pp", "D", 3);
    assert_eq!(
        dense.view_parameters.as_deref(),
        Some(
            r#"{"builder":"prm","neighbors":9,"pace":"stop-go","representation":"roadmap","roadmap_seed":1,"sampling":"uniform","spacing":0.5,"speed":1.0,"vertices":900}"#
        )
    );
    // Fewer robots are another task, and so another roadmap.
    let two = of("roadmap-pp", "D", 2);
    assert!(two.task_digest != dense.task_digest && two.view_digest != dense.view_digest);
    // In cells of 2r one robot follows the other round a corner, and touches it.
    let grid = of("lacam", "grid", 3);
    assert_eq!(grid.failure().as_deref(), Some("invalid in the world"));
    assert!(
        grid.first_violation
            .as_ref()
            .is_some_and(|first| first.starts_with("in the world: agents 1 and 2 overlap")),
        "{grid:?}"
    );
    assert!(of("lacam", "strict grid", 3).success);
    let told = yard.run(&[&bench[..], &more[..2], &["--resume"]].concat());
    assert!(told.expect(SUCCESS).stdout.contains("SoC s"));
    let ended = yard.line("report v.sqlite --csv v.csv --html v.html --markdown v.md");
    let text = ended.expect(SUCCESS).stdout;
    let line = |agents: &str, view: &str, planner: &str| -> Vec<String> {
        let mut found = text.lines().filter(|line| {
            let rest = line.trim_start().strip_prefix(agents).map(str::trim_start);
            let rest = rest.and_then(|rest| rest.strip_prefix(view));
            rest.is_some_and(|rest| rest.trim_start().starts_with(planner))
        });
        let line = found.next().unwrap_or_else(|| panic!("no {view}: {text}"));
        line.split("  ")
            .map(|cell| cell.trim().to_owned())
            .filter(|cell| !cell.is_empty())
            .collect()
    };
    let plane = line("3", "continuous", "plane-pp");
    assert_eq!(plane[3], "1/1", "{text}");
    assert_eq!(
        plane[plane.len() - 4..],
        ["100.0 %", "100.0 %", "100.0 %", "1"],
        "{text}"
    );
    let strict = line("3", "strict grid", "lacam");
    let way: f64 = strict[strict.len() - 4]
        .trim_end_matches(" %")
        .parse()
        .unwrap();
    assert!(way > 100.0, "{text}");
    assert_eq!(line("3", "grid", "lacam")[3..5], ["0/1", "1"], "{text}");
    // A planner is another one on each view, and a task is one instance.
    assert!(text.contains("lacam on strict grid"), "{text}");
    let read = fleetyard_bench::export::read_csv;
    let csv = yard.line("store export v.sqlite --csv - ").expect(SUCCESS);
    let back = read("v.csv", csv.stdout.as_bytes()).unwrap();
    assert_eq!(back, rows);
    let page = String::from_utf8(yard.read("v.html")).unwrap();
    assert!(page.contains("<section id=\"views\""));
    // One trial of it by itself.
    let task = root()
        .join("maps/two-rooms.task.json")
        .display()
        .to_string();
    let again = format!(
        "run --task {task} --agents 2 --representation roadmap --density D -p roadmap-pp --format json"
    );
    let again = yard.line(&again).expect(SUCCESS).json();
    assert_eq!(again["plan_digest"].as_str(), two.plan_digest.as_deref());
    let many = yard.line(&format!("run --task {task} --agents 4 -p lacam"));
    let many = many.expect(INPUT);
    assert!(
        many.stderr
            .contains("4 agents asked for, but the task has 3"),
        "{many}"
    );
}

#[test]
fn a_suite_of_tasks_goes_into_a_bundle_and_comes_out_the_same() {
    let yard = Yard::new();
    let views = "views = [\"grid\", { label = \"lines\", representation = \"roadmap\", builder = \"tangent\" }, \
                 \"continuous\"]";
    rooms(&yard, &["cbs", "roadmap-pp", "plane-pp"], views);
    let report = yard.line("bench s.toml --format json").expect(SUCCESS);
    assert_eq!(report.json()["made"], 3);
    let same = yard
        .line("bench s.toml --verify --format json")
        .expect(SUCCESS);
    assert_eq!(same.json()["equal"], 3, "{same}");
    yard.line("store bundle rooms.sqlite").expect(SUCCESS);
    let repeated = yard.line("store repeat rooms.bundle.tar.gz --into out --format json");
    let repeated = repeated.expect(SUCCESS);
    assert_eq!(repeated.json()["equal"], 3, "{repeated}");
    let inputs = fs::read_dir(yard.path("out/inputs")).unwrap();
    let mut names: Vec<_> = inputs.map(|file| file.unwrap().file_name()).collect();
    names.sort();
    assert_eq!(names, ["two-rooms.task.json", "two-rooms.world.json"]);
    // Plans of every form are kept, each once.
    let manifest = yard.read("out/manifest.json");
    let manifest: serde_json::Value = serde_json::from_slice(&manifest).unwrap();
    assert_eq!(manifest["plans"], json!({"kept": 3, "not_kept": 0}));
    // Another world is another task: what was asked of it is asked anew, and no bundle has the old trials.
    let world = String::from_utf8(yard.read("two-rooms.world.json")).unwrap();
    yard.write(
        "two-rooms.world.json",
        world.replace("10.0,6.0]", "10.5,6.0]"),
    );
    let changed = yard
        .line("store bundle rooms.sqlite --out b.tar.gz")
        .expect(INPUT);
    assert!(
        changed
            .stderr
            .contains("changed since the trials were made"),
        "{changed}"
    );
    let resumed = yard
        .line("bench s.toml --resume --format json")
        .expect(SUCCESS)
        .json();
    assert_eq!(
        (&resumed["made"], &resumed["superseded"]),
        (&3.into(), &3.into())
    );
    // A view that has another label is the same view.
    let text = String::from_utf8(yard.read("s.toml")).unwrap();
    yard.write("s.toml", text.replace("\"lines\"", "\"tangents\""));
    let renamed = yard
        .line("bench s.toml --resume --format json")
        .expect(SUCCESS)
        .json();
    assert_eq!(renamed["made"], 0);
    let views = rows(&yard.path("rooms.sqlite"));
    let views: Vec<&str> = views.iter().filter_map(|row| row.view.as_deref()).collect();
    assert_eq!(views, ["grid", "tangents", "continuous"]);
}

#[test]
fn views_that_nobody_plans_on_are_refused_and_those_that_are_none_fail() {
    let yard = Yard::new();
    rooms(&yard, &["cbs", "roadmap-pp"], "views = [\"grid\"]");
    let lonely = yard.line("bench s.toml").expect(INPUT);
    assert!(
        lonely
            .stderr
            .contains("s.toml:8:10: planner `roadmap-pp` plans on none of the views"),
        "{lonely}"
    );
    rooms(&yard, &["cbs"], "views = [\"grid\", \"continuous\"]");
    let empty = yard.line("bench s.toml").expect(INPUT);
    assert!(
        empty
            .stderr
            .contains("s.toml:9:18: no planner plans on the view `continuous`")
            && empty.stderr.contains("planners that do: plane-pp, "),
        "{empty}"
    );
    // Two starts in one cell.
    rooms(
        &yard,
        &["cbs", "plane-pp"],
        "views = [\"grid\", \"continuous\"]",
    );
    let task = String::from_utf8(yard.read("two-rooms.task.json")).unwrap();
    let near = task.replace("[9.0,1.0], \"goal\"", "[9.1,1.0], \"goal\"");
    let near = near.replace("[3.8,5.0], \"goal\"", "[9.45,1.38], \"goal\"");
    yard.write("two-rooms.task.json", near);
    let refused = yard.line("bench s.toml").expect(INPUT);
    assert!(refused.stderr.contains("snap"), "{refused}");
    let text = String::from_utf8(yard.read("s.toml")).unwrap();
    yard.write("s.toml", format!("{text}no_view = \"fail\"\n"));
    let report = yard
        .line("bench s.toml --format json")
        .expect(SUCCESS)
        .json();
    assert_eq!((&report["made"], &report["failed"]), (&2.into(), &1.into()));
    let rows = rows(&yard.path("rooms.sqlite"));
    assert_eq!(rows[0].failure().as_deref(), Some("unsupported"));
    assert!(
        rows[0]
            .fault
            .as_ref()
            .is_some_and(|fault| fault.contains("snap"))
    );
    assert!(rows[1].success);
    assert_eq!(rows[0].task_digest, rows[1].task_digest);
}
