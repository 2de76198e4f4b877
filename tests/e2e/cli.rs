//! The command as its users see it: good input, real files of `maps/`, every command.
//! Bad input is in `tests/cases`.

use std::fs;
use std::io::Write;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::{Command, Stdio};

use fleetyard_testkit::{
    INPUT, INTERNAL, INVALID_PLAN, NO_PLAN, PLUGIN, SUCCESS, Started, USAGE, Yard, c_library,
    faulty_library, faulty_program, have, instance, is_ignored, map, root, until, words,
};
use serde_json::Value;

/// A run of a planner that stops by itself, so that its plan depends on no clock.
fn lacam(map: &str, agents: usize) -> Vec<String> {
    let mut line = words("run --planner lacam --option anytime=false --seed 1 --budget 60s");
    line.extend(instance(map, agents));
    line
}

fn with(mut line: Vec<String>, more: &str) -> Vec<String> {
    line.extend(words(more));
    line
}

/// The value at a path such as `metrics.soc_steps`, which must be there.
#[track_caller]
fn at<'a>(record: &'a Value, path: &str) -> &'a Value {
    path.split('.').fold(record, |value, key| {
        value
            .get(key)
            .unwrap_or_else(|| panic!("no `{path}` in {record:#}"))
    })
}

fn text_of(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).unwrap()
}

// ---- run ---------------------------------------------------------------------------

#[test]
fn a_record_has_every_key() {
    let line = with(lacam("random-32-32-20", 30), "--execute --format json");
    let record = Yard::new().run(&line).expect(SUCCESS).json();
    for (path, value) in [
        ("planner.id", "lacam"),
        ("planner.attach", "worker"),
        ("instance.map", "random-32-32-20"),
        ("instance.scenario", "random-32-32-20-random-1.scen"),
        ("termination", "completed"),
        ("claim", "solved"),
    ] {
        assert_eq!(at(&record, path), value);
    }
    for path in [
        "planner.version",
        "fleetyard",
        "instance_digest",
        "plan_digest",
    ] {
        assert!(
            at(&record, path)
                .as_str()
                .is_some_and(|text| !text.is_empty())
        );
    }
    assert_eq!(at(&record, "verdict.valid"), true);
    assert_eq!(
        at(&record, "verdict.violations").as_array().unwrap().len(),
        0
    );
    assert_eq!(at(&record, "planner.ranked"), true);
    assert_eq!(at(&record, "planner.options.anytime"), false);
    assert_eq!(at(&record, "budget.seed"), 1);
    for path in [
        "metrics.soc_steps",
        "metrics.makespan_steps",
        "metrics.lower_bound_steps",
        "metrics.suboptimality",
        "metrics.length_m",
        "metrics.agents_at_goal",
        "metrics.individual_success",
        "metrics.planning_time_ms",
        "metrics.prepare_time_ms",
        "metrics.first_solution_ms",
        "resources.max_rss_kb",
        "execution.rtf",
        "execution.simulated_s",
        "execution.nearest_approach_m",
    ] {
        assert!(
            at(&record, path)
                .as_f64()
                .is_some_and(|number| number > 0.0),
            "{path}"
        );
    }
    for path in ["metrics.waits", "metrics.late_plans", "execution.contacts"] {
        assert!(at(&record, path).is_u64(), "{path}");
    }
    assert!(at(&record, "execution.tracking_error_max_m").is_f64());
    assert_eq!(
        at(&record, "execution.trace_digest")
            .as_str()
            .unwrap()
            .len(),
        32
    );
    for path in ["fault", "message"] {
        assert!(at(&record, path).is_null(), "{path}");
    }
    let incumbents = at(&record, "metrics.incumbents").as_array().unwrap();
    let last = incumbents.last().unwrap();
    assert_eq!(at(last, "soc_steps"), at(&record, "metrics.soc_steps"));
    assert_eq!(at(last, "valid"), true);
    assert!(at(last, "time_ms").is_f64());
    assert!(
        at(&record, "metrics.soc_steps").as_u64()
            >= at(&record, "metrics.lower_bound_steps").as_u64()
    );
    // Without the simulator there is nothing to say of an execution.
    let record = Yard::new()
        .run(&with(lacam("empty-8-8", 5), "--format json"))
        .expect(SUCCESS);
    assert!(at(&record.json(), "execution").is_null());
}

#[test]
fn text_and_json_say_the_same() {
    let line = with(lacam("room-33-33-8", 20), "--execute");
    let yard = Yard::new();
    let record = yard
        .run(&with(line.clone(), "--format json"))
        .expect(SUCCESS)
        .json();
    let text = yard.run(&line).expect(SUCCESS).stdout;
    let value = |path| match at(&record, path) {
        Value::String(text) => text.clone(),
        other => other.to_string(),
    };
    for (label, path) in [
        ("instance digest", "instance_digest"),
        ("plan digest", "plan_digest"),
        ("trace digest", "execution.trace_digest"),
        ("sum of costs", "metrics.soc_steps"),
        ("makespan", "metrics.makespan_steps"),
        ("contacts", "execution.contacts"),
        ("planner", "planner.id"),
        ("termination", "termination"),
    ] {
        let line = text.lines().find(|line| line.starts_with(label));
        let line = line.unwrap_or_else(|| panic!("no `{label}` in {text}"));
        let value = value(path);
        assert!(line.contains(&value), "`{line}` lacks {value}");
    }
}

#[test]
fn a_planner_in_the_hosts_process_is_unranked() {
    let line = with(lacam("empty-8-8", 5), "--attach in-process --format json");
    let record = Yard::new().run(&line).expect(SUCCESS).json();
    assert_eq!(at(&record, "planner.ranked"), false);
    assert_eq!(at(&record, "planner.attach"), "in-process");
    assert!(at(&record, "resources").is_null());
}

#[test]
fn anytime_planners_use_their_budget_and_get_no_worse() {
    let mut line = words("run --planner lacam --budget 500ms --prepare-budget 60s --format json");
    line.extend(instance("random-32-32-20", 40));
    let record = Yard::new().run(&line).expect(SUCCESS).json();
    let incumbents = at(&record, "metrics.incumbents").as_array().unwrap();
    let costs: Vec<u64> = incumbents
        .iter()
        .filter_map(|incumbent| at(incumbent, "soc_steps").as_u64())
        .collect();
    assert!(
        costs.is_sorted_by(|earlier, later| earlier >= later),
        "{costs:?}"
    );
    assert_eq!(
        at(&record, "metrics.soc_steps").as_u64(),
        costs.last().copied()
    );
}

// ---- Files: plans, traces, pictures -------------------------------------------------

#[test]
fn a_plan_goes_round_in_every_encoding() {
    for encoding in ["pairs", "cells", "moves"] {
        let yard = Yard::new();
        let files = "--plan-out plan.json --trace-out run.fyt --format json";
        let run = with(lacam("random-32-32-20", 30), files);
        let run = with(run, &format!("--plan-encoding {encoding}"));
        let record = yard.run(&run).expect(SUCCESS).json();
        let plan: Value = serde_json::from_slice(&yard.read("plan.json")).unwrap();
        assert_eq!(plan["encoding"], encoding);
        for key in ["plan_digest", "instance_digest"] {
            assert_eq!(plan[key], record[key]);
        }

        let mut validate = words("validate plan.json --format json");
        validate.extend(instance("random-32-32-20", 30));
        let verdict = yard.run(&validate).expect(SUCCESS).json();
        assert_eq!(at(&verdict, "verdict.valid"), true);
        for key in ["plan_digest", "instance_digest"] {
            assert_eq!(verdict[key], record[key]);
        }
        for key in ["soc_steps", "makespan_steps", "lower_bound_steps", "waits"] {
            assert_eq!(verdict["metrics"][key], record["metrics"][key]);
        }

        let simulate = "simulate --map {maps}/random-32-32-20.map plan.json --format json \
                        --trace-out again.fyt";
        let execution = yard.line(simulate).expect(SUCCESS).json();
        for key in [
            "trace_digest",
            "contacts",
            "simulated_s",
            "tracking_error_max_m",
        ] {
            assert_eq!(execution[key], record["execution"][key]);
        }
        assert_eq!(yard.read("run.fyt"), yard.read("again.fyt"));
        assert_eq!(yard.files().len(), 3, "{:?}", yard.files());
        // Whoever may read the plan may read the trace.
        let mode = |name: &str| fs::metadata(yard.path(name)).unwrap().permissions().mode();
        assert_eq!(mode("run.fyt"), mode("plan.json"));

        // A valid plan in text, and an invalid one: an agent too few.
        validate.truncate(2);
        validate.extend(instance("random-32-32-20", 30));
        assert!(
            yard.run(&validate)
                .expect(SUCCESS)
                .stdout
                .starts_with("valid\n")
        );
        let mut plan = plan;
        plan["paths"].as_array_mut().unwrap().pop();
        plan.as_object_mut().unwrap().remove("plan_digest");
        yard.write("plan.json", plan.to_string());
        let ended = yard.run(&validate).expect(INVALID_PLAN);
        assert!(ended.stdout.starts_with("INVALID: 1 violation"), "{ended}");
        assert!(ended.stdout.contains("agent-count"), "{ended}");
    }
}

#[test]
fn a_trace_file_has_the_digest_that_is_printed() {
    for tier in ["kinematic", "contact"] {
        let yard = Yard::new();
        let line = with(
            lacam("warehouse-4-6-6-2-1", 40),
            "--trace-out t.fyt --format json",
        );
        let record = yard
            .run(&with(line, &format!("--tier {tier}")))
            .expect(SUCCESS)
            .json();
        let file = fs::File::open(yard.path("t.fyt")).unwrap();
        let trace = fleetyard_sim::trace::read_trace(file, "t.fyt").unwrap();
        let summary = trace.end.expect("the trace is whole");
        let printed = at(&record, "execution.trace_digest").as_str().unwrap();
        assert_eq!(summary.trace_digest.to_string(), printed, "{tier}");
        assert_eq!(
            trace.header.digests.plan.to_string(),
            record["plan_digest"].as_str().unwrap()
        );
        assert_eq!(at(&record, "execution.contacts"), 0);
    }
}

/// Tags that are opened and closed in order, and attributes in quotes.
fn assert_well_formed(xml: &str) {
    let mut open: Vec<&str> = Vec::new();
    let mut rest = xml;
    while let Some(start) = rest.find('<') {
        assert!(
            !rest[..start].contains('>'),
            "a stray `>`: {}",
            &rest[..start]
        );
        let length = rest[start..].find('>').expect("an unfinished tag");
        let tag = &rest[start + 1..start + length];
        rest = &rest[start + length + 1..];
        assert_eq!(tag.matches('"').count() % 2, 0, "<{tag}>");
        let name = tag.trim_matches('/').split_whitespace().next().unwrap();
        if tag.starts_with('/') {
            assert_eq!(open.pop(), Some(name));
        } else if !tag.ends_with('/') && !tag.starts_with(['?', '!']) {
            open.push(name);
        }
    }
    assert!(open.is_empty() && rest.trim().is_empty(), "{open:?} {rest}");
}

#[test]
fn pictures_are_well_formed() {
    let yard = Yard::new();
    // A name that XML has to have escaped.
    let name = "a<b&c";
    fs::copy(map("maze-32-32-3.map"), yard.path(&format!("{name}.map"))).unwrap();
    let scen = fs::read_to_string(map("maze-32-32-3-random-1.scen")).unwrap();
    yard.write(
        "it.scen",
        scen.replace("maze-32-32-3.map", &format!("{name}.map")),
    );
    let line = "run --map a<b&c.map --scen it.scen --agents 10 --planner pibt --budget 60s \
                --picture run.svg --plan-out plan.json";
    yard.line(line).expect(SUCCESS);
    yard.line("simulate --map a<b&c.map plan.json --picture simulate.svg")
        .expect(SUCCESS);
    for picture in ["run.svg", "simulate.svg"] {
        let bytes = yard.read(picture);
        let svg = text_of(&bytes);
        assert!(svg.starts_with("<svg xmlns=\"http://www.w3.org/2000/svg\""));
        assert!(svg.contains("<title>a&lt;b&amp;c</title>"));
        assert!(svg.contains("viewBox=\"0 0 32 33.1"), "map and scale");
        assert_well_formed(svg);
    }
}

#[test]
fn traces_become_pictures_and_pages() {
    let yard = Yard::new();
    let scen = map("random-32-32-20-random-1.scen");
    let map = map("random-32-32-20.map");
    yard.line(&format!(
        "run --map {map} --scen {scen} --agents 10 --planner pibt --budget 60s --trace-out it.trace"
    ))
    .expect(SUCCESS);
    yard.line(
        "trace export it.trace --svg all.svg --png all.png --width 300 \
         --html it.html --rate 5 --agents 0,3-5",
    )
    .expect(SUCCESS);
    yard.line("trace export it.trace --svg moment.svg --at 5.25")
        .expect(SUCCESS);
    let (all, moment) = (yard.read("all.svg"), yard.read("moment.svg"));
    for svg in [text_of(&all), text_of(&moment)] {
        assert_well_formed(svg);
        assert!(svg.contains("<title>it</title>"));
    }
    // Starts, or bodies at a moment.
    assert_eq!(text_of(&all).matches("<circle").count(), 10);
    assert_eq!(text_of(&moment).matches("<circle").count(), 10);
    let png = yard.read("all.png");
    assert!(png.starts_with(b"\x89PNG"));
    assert_eq!(png[16..20], 300u32.to_be_bytes());
    let page = yard.read("it.html");
    let page = text_of(&page);
    assert!(page.starts_with("<!doctype html>"));
    assert!(page.contains("4 of 10 agents are shown"));
    assert!(page.contains("5 of 60 recorded states per second are kept."));
    // What cannot be made is not made.
    for (options, code, reason) in [
        ("--svg no.svg --at 1e9", INPUT, "not at 1000000000 s"),
        ("--html no.html --agents 10", INPUT, "there is no agent 10"),
        ("--html no.html --rate 0", INPUT, "out of range"),
        (
            "--html no.html --agents 5-3",
            USAGE,
            "ends before it begins",
        ),
        ("--svg no.svg --at=-1", USAGE, "not negative"),
        ("--svg no/no.svg", INPUT, "no/no.svg"),
    ] {
        let ended = yard.line(&format!("trace export it.trace {options}"));
        let ended = ended.expect(code);
        assert!(ended.stderr.contains(reason), "{options}: {ended}");
    }
    assert!(!yard.path("no.svg").exists() && !yard.path("no.html").exists());
}

// ---- maps ----------------------------------------------------------------------------

#[test]
fn the_documented_commands_make_the_maps() {
    let sources = fs::read_to_string(root().join("maps/SOURCES.md")).unwrap();
    let yard = Yard::new();
    let mut made = 0;
    for row in sources.lines().filter(|line| line.starts_with("| `")) {
        let cells: Vec<&str> = row.split('`').collect();
        let (map, command) = (cells[1], cells[3]);
        let arguments = command.strip_prefix("fleetyard ").unwrap();
        let ended = yard
            .line(&format!("{arguments} --out {{here}}"))
            .expect(SUCCESS);
        let scen = format!("{}-random-1.scen", map.strip_suffix(".map").unwrap());
        for name in [map, &scen] {
            let committed = fs::read(root().join("maps").join(name)).unwrap();
            assert_eq!(text_of(&yard.read(name)), text_of(&committed), "{name}");
            assert!(ended.stdout.contains(name), "{ended}");
        }
        made += 2;
    }
    let committed = fs::read_dir(root().join("maps")).unwrap();
    let names = committed.map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let (others, generated): (Vec<String>, Vec<String>) =
        names.partition(|name| name.contains(".json") || name == "SOURCES.md");
    assert_eq!(
        made,
        generated.len(),
        "a file of maps/ has no command in SOURCES.md"
    );
    let examples = others.iter().filter(|name| *name != "SOURCES.md");
    for name in examples {
        assert!(sources.contains(&format!("- `{name}`:")), "{name}");
    }
}

#[test]
fn maps_are_described() {
    let yard = Yard::new();
    let info = yard
        .line("maps info {maps}/random-32-32-20.map --format json")
        .expect(SUCCESS)
        .json();
    assert_eq!((&info["rows"], &info["cols"]), (&32.into(), &32.into()));
    assert_eq!(info["components"], 1);
    assert_eq!(info["passable"], info["largest_component"]);
    let blocked = info["cells"].as_u64().unwrap() - info["passable"].as_u64().unwrap();
    assert_eq!(info["terrain"]["@"], blocked);
    let text = yard
        .line("maps info {maps}/random-32-32-20.map")
        .expect(SUCCESS)
        .stdout;
    assert!(text.contains("32 rows, 32 columns"), "{text}");
    assert!(text.contains(info["digest"].as_str().unwrap()), "{text}");
}

// ---- plugins, completions, help --------------------------------------------------------

#[test]
fn plugins_are_listed_and_described() {
    let yard = Yard::new();
    let listed = yard
        .line("plugins list --format json")
        .expect(SUCCESS)
        .json();
    let plugins = listed[0]["plugins"].as_array().unwrap();
    let ids: Vec<&str> = plugins
        .iter()
        .map(|plugin| plugin["id"].as_str().unwrap())
        .collect();
    assert_eq!(
        ids,
        [
            "lacam",
            "pibt",
            "epibt",
            "wppl",
            "pp",
            "pbs",
            "mapf-lns2",
            "mapf-lns",
            "cbs",
            "ecbs",
            "roadmap-pp",
            "ctc",
            "ccbs",
            "eccbs",
            "roadmap-lns",
            "roadmap-lacam",
            "plane-pp",
            "tangent",
            "si-tangent",
            "sssp",
            "cbs-mp",
            "cbs-rrt",
            "hybrid-astar",
            "rrt-star",
            "sst",
            "db-astar",
            "db-cbs",
            "db-lacam",
            "k-cbs",
            "empty",
            "astar",
            "dijkstra",
            "greedy-best-first",
            "weighted-astar",
            "bidirectional-astar",
            "theta-star",
            "idastar",
            "jump-point-search",
            "lpa-star",
            "beam-search",
            "fringe-search",
            "bidirectional-bfs",
            "bfs",
            "d-star-lite",
            "lazy-theta-star",
            "pibt",
            "guided-pibt",
            "lrgw",
            "rule-based",
            "all-wait",
            "distinct-one-goal",
            "one-goal",
            "windowed-multi-goals",
            "periodic",
            "event-based",
        ]
    );
    let text = yard.line("plugins list").expect(SUCCESS).stdout;
    for (id, plugin) in ids.into_iter().zip(plugins) {
        let kind = plugin["kind"].as_str().unwrap();
        let listed = |line: &str| line.starts_with(id) && line.contains(kind);
        assert!(text.lines().any(listed), "{text}");
        let info = format!("plugins info {id}");
        let described = yard.line(&format!("{info} --format json"));
        let described = described.expect(SUCCESS).json();
        // Identifiers are those of one kind: `pibt` is a planner and a fail policy.
        let mut of_kind = described.as_array().unwrap().iter();
        let described = of_kind.find(|of| of["kind"] == kind).unwrap();
        assert_eq!(described["id"], id);
        let schema = &described["options_schema"];
        assert!(schema.is_object(), "{described}");
        let text = yard.line(&info).expect(SUCCESS).stdout;
        assert!(text.contains(&format!("{id} ({kind})")), "{text}");
    }
    // A file, and an identifier found in a folder of the plugin path.
    let library = c_library("plugins/examples/c/prioritized.c", None);
    let path = library.display().to_string();
    let of_file = yard
        .run(&["plugins", "info", &path, "--format", "json"])
        .expect(SUCCESS)
        .json();
    let folder = yard.path("plugins");
    fs::create_dir(&folder).unwrap();
    fs::copy(&library, folder.join("mine.so")).unwrap();
    let yard = yard.set("FLEETYARD_PLUGIN_PATH", &folder.display().to_string());
    let id = of_file[0]["id"].as_str().unwrap();
    let mut by_id = yard
        .run(&["plugins", "info", id, "--format", "json"])
        .expect(SUCCESS)
        .json();
    let place = Value::from(folder.join("mine.so").display().to_string());
    assert_eq!(by_id[0]["path"], place);
    // The same but for the place.
    by_id[0]["path"] = of_file[0]["path"].clone();
    by_id[0]["code"][0]["path"] = of_file[0]["code"][0]["path"].clone();
    // It is alone in its folder, and the other in a build folder has none of its own.
    assert_eq!(of_file[0]["reads"], serde_json::json!([path]));
    assert_eq!(by_id[0]["reads"], serde_json::json!([folder]));
    by_id[0]["reads"] = of_file[0]["reads"].clone();
    assert_eq!(of_file, by_id);
}

#[test]
fn completions_for_shells() {
    let yard = Yard::new();
    for shell in ["bash", "zsh", "fish"] {
        let script = yard
            .line(&format!("completions {shell}"))
            .expect(SUCCESS)
            .stdout;
        for word in ["fleetyard", "simulate", "plan-out"] {
            assert!(script.contains(word), "{shell}: no {word}");
        }
        if have(shell) {
            let mut parser = Command::new(shell)
                .arg("-n")
                .stdin(Stdio::piped())
                .spawn()
                .unwrap();
            parser
                .stdin
                .take()
                .unwrap()
                .write_all(script.as_bytes())
                .unwrap();
            assert!(
                parser.wait().unwrap().success(),
                "{shell} refuses the script"
            );
        }
    }
}

#[test]
fn every_command_has_a_page_of_the_manual() {
    let yard = Yard::new();
    yard.line("man {here}/man").expect(SUCCESS);
    let page = |command: &str| {
        let name = format!("man/fleetyard{command}.1");
        String::from_utf8(yard.read(&name)).unwrap()
    };
    for text in ["Exit codes:", "NO_COLOR", "fleetyard\\-simulate(1)"] {
        assert!(page("").contains(text), "no {text}: {}", page(""));
    }
    for (command, option) in [
        ("-run", "planner"),
        ("-plugins-check", "reproduce"),
        ("-maps-generate-maze", "algorithm"),
    ] {
        let page = page(command);
        assert!(page.starts_with(".ie"), "{page}");
        assert!(page.contains(&format!("\\-\\-{option}")), "{page}");
    }
    assert!(!yard.path("man/fleetyard-man.1").exists());
    yard.write("file", "");
    let ended = yard.line("man {here}/file").expect(INPUT);
    assert!(ended.stderr.contains("hint:"), "{ended}");
}

#[test]
fn help_says_what_there_is() {
    let yard = Yard::new();
    let help = yard.line("--help").expect(SUCCESS).stdout;
    for text in ["Exit codes:", "FLEETYARD_PLUGIN_PATH", "NO_COLOR"] {
        assert!(help.contains(text), "{help}");
    }
    for command in [
        "run",
        "compare",
        "validate",
        "simulate",
        "plugins",
        "maps",
        "completions",
    ] {
        assert!(help.contains(command), "{help}");
        let help = yard
            .line(&format!("{command} --help"))
            .expect(SUCCESS)
            .stdout;
        assert!(
            help.contains(&format!("Usage: fleetyard {command}")),
            "{help}"
        );
    }
    let version = yard.line("--version").expect(SUCCESS).stdout;
    assert_eq!(
        version.trim(),
        format!("fleetyard {}", env!("CARGO_PKG_VERSION"))
    );
}

#[test]
fn a_reader_that_goes_away_is_no_error() {
    for line in [
        "maps info {maps}/empty-8-8.map",
        "plugins list",
        "completions bash",
        "--help",
    ] {
        let line = line.replace("{maps}", &root().join("maps").display().to_string());
        let yard = Yard::new();
        let mut started = yard.start(&words(&line));
        // Closed before the command has had time to write, or after; both are fine.
        drop(started.child.stdout.replace(closed()));
        let ended = started.wait().expect(SUCCESS);
        assert!(!ended.stderr.contains("panicked"), "{ended}");
    }
}

/// An output that has ended.
fn closed() -> std::process::ChildStdout {
    let mut child = Command::new("true").stdout(Stdio::piped()).spawn().unwrap();
    let stdout = child.stdout.take().unwrap();
    child.wait().unwrap();
    stdout
}

// ---- Real benchmark files ----------------------------------------------------------

#[test]
fn four_hundred_agents_on_a_public_map() {
    let Some(data) = std::env::var_os("FLEETYARD_DATA") else {
        eprintln!("skipped: FLEETYARD_DATA is not set");
        return;
    };
    let name = "random-64-64-10";
    let folder = Path::new(&data).join("movingai").join(name);
    if !folder.is_dir() {
        eprintln!("skipped: {} is missing", folder.display());
        return;
    }
    let here = folder.display();
    let ended = Yard::new()
        .line(&format!(
            "run --map {here}/{name}.map --scen {here}/{name}-random-1.scen --agents 400 \
             --planner lacam --option anytime=false --budget 60s --execute --format json"
        ))
        .expect(SUCCESS);
    let record = ended.json();
    assert_eq!(at(&record, "verdict.valid"), true);
    assert_eq!(at(&record, "execution.contacts"), 0);
}

// ---- Ending in the middle of it ------------------------------------------------------

/// Starts a run of the faulty planner that hangs in `plan`, and waits until it does.
fn hanging(yard: &Yard, planner: &Path, fault: &str) -> Started {
    let mut line = words("run --budget 10m --trace-out trace.fyt --plan-out plan.json --planner");
    line.push(planner.display().to_string());
    line.extend(words(&format!("--option fault={fault}")));
    line.extend(instance("empty-8-8", 2));
    let started = yard.start(&line);
    // Host, supervisor, the sandbox's first process, and the plugin, in this order. Until the plugin runs its
    // process has the host's command line.
    assert!(until(|| {
        let processes = started.processes();
        processes.len() >= 4 && !processes[processes.len() - 1].command.contains("--budget")
    }));
    started
}

#[test]
fn nothing_outlives_a_host_that_is_killed() {
    let mut planners = vec![faulty_library()];
    if have("python3") {
        planners.push(faulty_program());
    }
    for planner in &planners {
        for signal in ["KILL", "TERM", "INT"] {
            if is_ignored(signal) {
                continue;
            }
            for fault in ["never", "ignore-sigterm", "spin"] {
                let yard = Yard::new();
                let mut started = hanging(&yard, planner, fault);
                let host = started.child.id();
                let processes = started.processes();
                let host = processes.iter().find(|process| process.id == host).unwrap();
                host.signal(signal);
                started.child.wait().unwrap();
                let gone = until(|| started.processes().is_empty());
                assert!(gone, "{signal}, {fault}: {:?}", started.processes());
                assert!(yard.files().is_empty(), "{:?}", yard.files());
            }
        }
    }
}

#[test]
fn nothing_outlives_a_process_group_that_is_told_to_end() {
    if !have("python3") {
        return;
    }
    for signal in ["INT", "TERM", "HUP", "QUIT", "KILL"] {
        if is_ignored(signal) {
            continue;
        }
        // A daemon of the plugin that is in no group of ours; then the plugin hangs.
        let yard = Yard::new()
            .set("FLEETYARD_FAULT", "grandchild")
            .in_own_group();
        let mut started = hanging(&yard, &faulty_program(), "never");
        let host = started.child.id();
        let has_daemon = || started.processes().iter().any(|p| p.name == "fy-orphan");
        assert!(until(has_daemon));
        let processes = started.processes();
        let host = processes.iter().find(|process| process.id == host).unwrap();
        host.signal_group(signal);
        started.child.wait().unwrap();
        // Nobody can outwit a kill that hits the supervisor as well.
        let may_stay = |name: &str| signal == "KILL" && name == "fy-orphan";
        let gone = until(|| started.processes().iter().all(|p| may_stay(&p.name)));
        assert!(gone, "{signal}: {:?}", started.processes());
        for process in started.processes() {
            process.signal("KILL");
        }
    }
}

/// Starts a run of a planner that hangs once the host has read its plan, and waits until then.
/// Nothing keeps the planner from its file there.
fn hanging_with_a_plan(yard: &Yard) -> Started {
    let read = yard.path("read");
    let mut line = words("run --budget 10m --sandbox none --plan-out plan.json --format json");
    line.extend(["--planner".into(), faulty_program().display().to_string()]);
    line.extend(["fault=hangs-after-plan".into()]);
    line.extend([format!("target={}", read.display())]);
    line.extend(instance("empty-8-8", 2));
    let started = yard.start(&line);
    assert!(until(|| read.exists()));
    started
}

#[test]
fn an_interrupt_keeps_the_best_plan_until_then() {
    if !have("python3") {
        return;
    }
    for (signal, number) in [("INT", 2), ("TERM", 15)] {
        if is_ignored(signal) {
            continue;
        }
        let yard = Yard::new().in_own_group();
        let started = hanging_with_a_plan(&yard);
        let host = started.child.id();
        let processes = started.processes();
        let host = processes.iter().find(|process| process.id == host).unwrap();
        host.signal_group(signal);
        let ended = started.wait().expect(128 + number);
        let record = ended.json();
        assert_eq!(at(&record, "termination"), "interrupted");
        assert_eq!(at(&record, "verdict.valid"), true);
        assert_eq!(at(&record, "ended_by_clock"), true);
        let said = "note: interrupted; this is the best plan until then";
        assert!(ended.stderr.contains(said), "{ended}");
        assert!(!ended.stderr.contains("error:"), "{ended}");
        let mut line = words("validate plan.json");
        line.extend(instance("empty-8-8", 2));
        yard.run(&line).expect(SUCCESS);
    }
}

#[test]
fn a_second_interrupt_ends_a_run_whose_planner_hears_nothing() {
    if is_ignored("INT") {
        return;
    }
    let yard = Yard::new();
    let mut line = words("run --budget 10m --attach in-process --option fault=never --planner");
    line.push(faulty_library().display().to_string());
    line.extend(instance("empty-8-8", 2));
    let mut started = yard.start(&line);
    let ended = until(|| {
        let host = started.child.id();
        let processes = started.processes();
        if let Some(host) = processes.iter().find(|process| process.id == host) {
            host.signal("INT");
        }
        started.child.try_wait().unwrap().is_some()
    });
    assert!(ended, "{:?}", started.processes());
}

#[test]
fn an_interrupt_before_there_is_a_plan_ends_the_run_without_one() {
    if is_ignored("INT") {
        return;
    }
    let yard = Yard::new().in_own_group();
    let mut started = hanging(&yard, &faulty_library(), "never");
    let host = started.child.id();
    let processes = started.processes();
    let host = processes.iter().find(|process| process.id == host).unwrap();
    host.signal_group("INT");
    // Before the call there is nobody to end but the command itself.
    assert_eq!(started.child.wait().unwrap().code(), Some(130));
    assert!(until(|| started.processes().is_empty()));
    assert!(yard.files().is_empty(), "{:?}", yard.files());
}

#[test]
fn the_command_draws_nothing_where_there_is_no_terminal() {
    let yard = Yard::new();
    let mut line = words("run --planner lacam anytime=false --trace-out t.fyt");
    line.extend(instance("empty-8-8", 2));
    let run = yard.run(&line).expect(SUCCESS);
    assert_eq!(run.stderr, "", "{run}");
    for line in [
        "trace info t.fyt",
        "trace diff t.fyt t.fyt",
        "trace export t.fyt --html t.html",
    ] {
        let ended = yard.line(line).expect(SUCCESS);
        assert_eq!(ended.stderr, "", "{ended}");
    }
}

#[test]
fn long_work_on_a_terminal_says_what_is_going_on() {
    if !have("script") {
        return;
    }
    let yard = Yard::new();
    let on_a_terminal = |line: &str| {
        let line = format!("script --quiet --return --command '{line}' typescript");
        yard.shell(&line).expect(SUCCESS).stdout
    };
    let instance = instance("empty-8-8", 2).join(" ");
    let run = format!("fleetyard run --planner lacam anytime=false --trace-out t.fyt {instance}");
    let shown = on_a_terminal(&run);
    let what = "lacam on empty-8-8-random-1.scen, 2 agents, ";
    assert!(
        shown.contains(what) && shown.contains("s elapsed"),
        "{shown}"
    );
    for line in [
        "trace info t.fyt",
        "trace diff t.fyt t.fyt",
        "trace export t.fyt --html t.html",
    ] {
        let shown = on_a_terminal(&format!("fleetyard {line}"));
        assert!(
            shown.contains(" read, ") && shown.contains("s elapsed"),
            "{shown}"
        );
    }
}

#[test]
fn nothing_outlives_a_host_that_is_killed_while_a_plugin_starts() {
    let library = c_library("plugins/faulty/faulty.c", Some("CONSTRUCTOR_HANG"));
    let yard = Yard::new();
    let mut started = hanging(&yard, &library, "none");
    started.child.kill().unwrap();
    started.child.wait().unwrap();
    let gone = until(|| started.processes().is_empty());
    assert!(gone, "{:?}", started.processes());
}

#[test]
fn a_supervisor_that_is_killed_takes_the_plugin_with_it() {
    let yard = Yard::new();
    let started = hanging(&yard, &faulty_library(), "never");
    let host = started.child.id();
    let mut others = started.processes();
    others.retain(|process| process.id != host);
    // The supervisor was there before its plugin.
    others[0].signal("KILL");
    // No plugin can do that.
    let ended = started.wait().expect(INTERNAL);
    assert!(
        ended
            .stderr
            .contains("the host failed: its supervisor was ended by SIGKILL (signal 9)"),
        "{ended}"
    );
}

#[test]
fn a_plugin_that_is_killed_from_outside_has_crashed() {
    let yard = Yard::new();
    let started = hanging(&yard, &faulty_library(), "never");
    started.processes().last().unwrap().signal("KILL");
    let ended = started.wait().expect(PLUGIN);
    assert!(
        ended.stderr.contains("crashed with SIGKILL (signal 9)"),
        "{ended}"
    );
}

#[test]
fn no_plan_within_the_budget_is_not_the_plugins_fault() {
    // Everybody but the empty planner's agents would have moved; it says that it gave up.
    let mut line = words("run --planner empty --format json");
    line.extend(instance("empty-8-8", 2));
    let ended = Yard::new().run(&line).expect(NO_PLAN);
    assert_eq!(ended.json()["ended_by_clock"], false, "{ended}");
    let mut line = words("run --budget 300ms --prepare-budget 60s --option fault=never --planner");
    line.push(faulty_library().display().to_string());
    line.extend(instance("empty-8-8", 2));
    let ended = Yard::new().run(&line).expect(NO_PLAN);
    assert!(ended.stdout.contains("timed-out"), "{ended}");
    let told = "another run may end with another plan";
    assert!(ended.stdout.contains(told), "{ended}");
}

#[test]
fn who_refuses_a_planner_names_those_that_can() {
    let line = with(
        words("run --planner astar"),
        &instance("empty-8-8", 3).join(" "),
    );
    let refused = Yard::new().run(&line).expect(NO_PLAN).stderr;
    for words in [
        "planner `astar` plans for one agent, not for 3",
        "hint: planners that do: lacam, pibt, ",
    ] {
        assert!(refused.contains(words), "{refused}");
    }
    let hint = refused.lines().find(|line| line.starts_with("hint: "));
    for other in ["empty", "dijkstra", "roadmap-pp"] {
        assert!(hint.is_some_and(|hint| !hint.contains(other)), "{refused}");
    }
}

#[test]
fn a_scenario_finds_its_map_in_every_command() {
    let yard = Yard::new();
    for name in ["empty-8-8.map", "empty-8-8-random-1.scen"] {
        fs::copy(map(name), yard.path(name)).unwrap();
    }
    let short = "-s empty-8-8-random-1.scen -n 3";
    yard.line(&format!(
        "run {short} -p lacam anytime=false --plan-out p.json"
    ))
    .expect(SUCCESS);
    yard.line(&format!("validate {short} p.json"))
        .expect(SUCCESS);
    yard.line(&format!("validate -m . {short} p.json"))
        .expect(SUCCESS);
    yard.line("simulate -m empty-8-8.map p.json")
        .expect(SUCCESS);
    fs::remove_file(yard.path("empty-8-8.map")).unwrap();
    let lost = yard.line(&format!("run {short} -p lacam")).expect(INPUT);
    assert!(
        lost.stderr
            .contains("there is no empty-8-8.map; --map says where it is"),
        "{lost}"
    );
}

#[test]
fn a_policy_that_fails_leaves_its_rollout() {
    if !have("python3") {
        return;
    }
    let yard = Yard::new();
    // The host has the SDK, and no other is beside the policy.
    fs::create_dir(yard.path("policy")).unwrap();
    yard.line("plugins sdk policy").expect(SUCCESS);
    yard.write(
        "policy/first.py",
        "import fleetyard\n\n\nclass First(fleetyard.StepPolicy):\n    \"\"\"Moves the first agent alone.\"\"\"\n\n    \
         capabilities = (\"grid\", \"pebble\", \"deterministic\")\n    most_steps = 30\n\n    \
         def act(self, observations):\n        first = observations[0]\n        \
         far = self.grid.distances(first.goal)\n        \
         near = min(first.cell, *self.grid.neighbors(first.cell), key=far.__getitem__)\n        \
         return [self.grid.move(first.cell, near)] + [\".\"] * (len(observations) - 1)\n\n\n\
         if __name__ == \"__main__\":\n    fleetyard.run(First)\n",
    );
    let line = with(
        instance("empty-8-8", 4),
        "--planner policy/first.py --execute --plan-out left.json --picture left.svg --trace-out left.trace",
    );
    let run: Vec<String> = words("run").into_iter().chain(line.clone()).collect();
    let failed = yard.run(&run).expect(NO_PLAN);
    for (words, said) in [
        ("at goals          1 of 4 agents (25.0 %)", &failed.stdout),
        (
            "no plan; what the planner left has 3 violations",
            &failed.stdout,
        ),
        (
            "the plan in left.json is not a solution: no plan: gave-up, 1 of 4 agents at their goals",
            &failed.stderr,
        ),
    ] {
        assert!(said.contains(words), "no `{words}`: {failed}");
    }
    let left: Value = serde_json::from_slice(&yard.read("left.json")).unwrap();
    let author = left["planner"].as_str().unwrap();
    assert!(author.contains("not a solution"), "{author}");
    assert_eq!(left["paths"].as_array().unwrap().len(), 4);
    assert!(text_of(&yard.read("left.svg")).contains("<path"));
    yard.line("trace export left.trace --html left.html")
        .expect(SUCCESS);
    let run = words("run --format json").into_iter().chain(line);
    let record = yard.run(&run.collect::<Vec<_>>()).expect(NO_PLAN).json();
    assert_eq!(at(&record, "metrics.agents_at_goal"), 1);
    assert_eq!(at(&record, "metrics.individual_success"), 0.25);
    assert_eq!(at(&record, "claim"), "gave-up");
}
