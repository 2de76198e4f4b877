//! Whatever is wrong with files, options or plugins: the exit code says whose fault it
//! is, the message names the fault and its place, no process is left running, and no
//! half-written file remains.
//!
//! Each behaviour of a plugin that a library and a program can both have is tried
//! through both, and in the host's own process where it does not take the host down.

use std::collections::BTreeSet;
use std::fs::{self, Permissions};
use std::os::unix::fs::PermissionsExt;
use std::process::Command;

use fleetyard_testkit::{
    Ended, INPUT, INVALID_PLAN, NO_PLAN, PLUGIN, SUCCESS, USAGE, Yard, build, c_library,
    faulty_library, faulty_program, have, instance, words,
};
use serde_json::Value;

/// Fails unless every text stands on standard error.
#[track_caller]
fn says(ended: &Ended, texts: &[&str]) {
    for text in texts {
        assert!(ended.stderr.contains(text), "no `{text}`: {ended}");
    }
    assert!(!ended.stderr.contains("panicked"), "{ended}");
}

// ---- Maps and scenarios ------------------------------------------------------------

const MAP: &str = "type octile\nheight 4\nwidth 5\nmap\n.....\n.@@@.\n.@.@.\n.@@@.\n";

/// A scenario of agents from `(x, y)` to `(x, y)` on the map above.
fn scenario(agents: &[[u32; 4]]) -> String {
    let lines = agents
        .iter()
        .map(|[sx, sy, gx, gy]| format!("0\tgood.map\t5\t4\t{sx}\t{sy}\t{gx}\t{gy}\t1.0\n"));
    std::iter::once("version 1\n".to_owned())
        .chain(lines)
        .collect()
}

fn good_scenario() -> String {
    scenario(&[[0, 0, 4, 0], [4, 0, 4, 3], [0, 3, 0, 0]])
}

/// Runs a planner on a map and a scenario; nothing may be written.
fn run_files(map: &[u8], scen: &[u8], agents: usize) -> Ended {
    let yard = Yard::new();
    yard.write("good.map", map);
    yard.write("good.scen", scen);
    let ended = yard.line(&format!(
        "run --map good.map --scen good.scen --agents {agents} --planner lacam --budget 10s \
         --plan-out plan.json --trace-out trace.fyt --picture picture.svg"
    ));
    if ended.code != Some(SUCCESS) {
        let files = BTreeSet::from(["good.map", "good.scen"].map(str::to_owned));
        assert_eq!(yard.files(), files, "{ended}");
    }
    ended
}

#[test]
fn bad_maps() {
    let huge = "type octile\nheight 1000000\nwidth 1000000\nmap\n.....\n";
    let cases: &[(&str, Vec<u8>, &[&str])] = &[
        (
            "empty",
            b"".to_vec(),
            &["good.map", "the file is empty", "hint: "],
        ),
        (
            "blank",
            b"\n\n  \n".to_vec(),
            &["good.map", "the file is empty"],
        ),
        (
            "cut in the map",
            MAP.as_bytes()[..MAP.len() - 6].to_vec(),
            &["good.map:8:1: ", "ends after 3 of 4 rows", "truncated"],
        ),
        (
            "cut in a row",
            MAP.as_bytes()[..MAP.len() - 3].to_vec(),
            &["good.map:8:4: ", "has 3 letters, but the width is 5"],
        ),
        (
            "cut in the header",
            MAP.as_bytes()[..20].to_vec(),
            &["good.map:", "before the line 'map'"],
        ),
        (
            "huge",
            huge.into(),
            &["1000000 rows", "too large", "at most"],
        ),
        (
            "huger",
            huge.replace("1000000", "99999999999999999999").into(),
            &["good.map:2:8: ", "too large"],
        ),
        (
            "narrow",
            MAP.replace(".....", "....").into(),
            &["good.map:5:5: ", "4 letters, but the width is 5"],
        ),
        (
            "wide",
            MAP.replace(".....", "......").into(),
            &["good.map:5:6: ", "6 letters, but the width is 5"],
        ),
        (
            "unknown letter",
            MAP.replace(".@.@.", ".@x@.").into(),
            &[
                "good.map:7:3: ",
                "unknown terrain letter 'x'",
                "terrain letters are",
            ],
        ),
        (
            "more rows",
            format!("{MAP}.....\n").into(),
            &["good.map:9:1: ", "goes on after its 4 rows"],
        ),
        (
            "no width",
            MAP.replace("width 5\n", "").into(),
            &["the header has no width", "add a line"],
        ),
        (
            "negative",
            MAP.replace("height 4", "height -4").into(),
            &["good.map:2:8: ", "'-4' is not a number"],
        ),
        (
            "another type",
            MAP.replace("octile", "hexagon").into(),
            &["good.map:1:6: ", "'hexagon' is not supported"],
        ),
        (
            "a scenario",
            good_scenario().into(),
            &["good.map:1:1: ", "expected 'type octile'"],
        ),
        (
            "bytes",
            (0..=255).cycle().take(10_000).collect(),
            &["good.map:1:1: ", "expected 'type octile'"],
        ),
    ];
    for (name, map, texts) in cases {
        let ended = run_files(map, good_scenario().as_bytes(), 3).expect(INPUT);
        assert_eq!(ended.stdout, "", "{name}");
        says(&ended, texts);
    }
    // The files without a fault are good.
    run_files(MAP.as_bytes(), good_scenario().as_bytes(), 3).expect(SUCCESS);
}

#[test]
fn bad_scenarios() {
    let cases: &[(&str, String, usize, &[&str])] = &[
        (
            "empty",
            String::new(),
            1,
            &["good.scen", "the file is empty"],
        ),
        ("no entries", "version 1\n".into(), 1, &["has no entries"]),
        (
            "another map",
            good_scenario().replace("good.map", "other.map"),
            3,
            &["good.scen:2: ", "other.map", "good"],
        ),
        (
            "another size",
            good_scenario().replace("\t5\t4\t", "\t4\t5\t"),
            3,
            &["good.scen:2: ", "width before the height"],
        ),
        (
            "more agents than entries",
            good_scenario(),
            9,
            &["9 agents asked for, but the scenario has 3", "at most 3"],
        ),
        (
            "no agents",
            good_scenario(),
            0,
            &["at least one agent", "1 to 3"],
        ),
        (
            "start on an obstacle",
            scenario(&[[0, 0, 4, 0], [1, 1, 4, 3]]),
            2,
            &[
                "good.scen:3: ",
                "start of agent 1 at row 1, column 1 is on an obstacle",
            ],
        ),
        (
            "goal on an obstacle",
            scenario(&[[0, 0, 3, 2]]),
            1,
            &[
                "good.scen:2: ",
                "goal of agent 0 at row 2, column 3 is on an obstacle",
            ],
        ),
        (
            "start outside the map",
            scenario(&[[5, 0, 4, 0]]),
            1,
            &[
                "good.scen:2: ",
                "start at row 0, column 5 is outside the map",
                "column",
            ],
        ),
        (
            "goal outside the map",
            scenario(&[[0, 0, 0, 4]]),
            1,
            &[
                "good.scen:2: ",
                "goal at row 4, column 0 is outside the map",
            ],
        ),
        (
            "the same start twice",
            scenario(&[[0, 0, 4, 0], [4, 0, 4, 3], [0, 0, 0, 3]]),
            3,
            &[
                "good.scen:4: ",
                "agents 0 and 2 have the same start",
                "line 2",
            ],
        ),
        (
            "the same goal twice",
            scenario(&[[0, 0, 4, 0], [0, 3, 4, 0]]),
            2,
            &["good.scen:3: ", "agents 0 and 1 have the same goal"],
        ),
        (
            "unreachable goal",
            scenario(&[[0, 0, 2, 2]]),
            1,
            &["good.scen:2: ", "agent 0 cannot reach its goal"],
        ),
        (
            "missing field",
            good_scenario().replace("\t1.0\n", "\n"),
            3,
            &["good.scen:2:", "9 fields, found 8"],
        ),
        (
            "letters for a number",
            good_scenario().replace("\t5\t4\t", "\tfive\t4\t"),
            3,
            &["good.scen:2:12: ", "map width 'five' is not a whole number"],
        ),
        (
            "a later version",
            good_scenario().replace("version 1", "version 7"),
            3,
            &["good.scen:1:1: ", "version '7' is not supported"],
        ),
        ("a map", MAP.into(), 1, &["good.scen:1:", "9 fields"]),
    ];
    for (name, scen, agents, texts) in cases {
        let ended = run_files(MAP.as_bytes(), scen.as_bytes(), *agents).expect(INPUT);
        assert_eq!(ended.stdout, "", "{name}");
        says(&ended, texts);
    }
}

#[test]
fn missing_files_and_folders() {
    let yard = Yard::new();
    yard.write("good.map", MAP);
    yard.write("good.scen", good_scenario());
    let cases: &[(&str, &[&str])] = &[
        (
            "run --map goud.map --scen good.scen --agents 1 --planner lacam",
            &["goud.map: no such file", "did you mean", "good.map?"],
        ),
        (
            "run --map good.map --scen nothing/at/all --agents 1 --planner lacam",
            &["nothing/at/all: no such file"],
        ),
        (
            "run --map {here} --scen good.scen --agents 1 --planner lacam",
            &["this is a folder, not a file"],
        ),
        ("maps info no.map", &["no.map: no such file"]),
        (
            "validate --map good.map --scen good.scen --agents 1 no.json",
            &["no.json: no such file"],
        ),
        (
            "simulate --map good.map no.json",
            &["no.json: no such file"],
        ),
        (
            "compare --map good.map --scen good.scen no.scen --agents 1 --planner lacam",
            &["no.scen: no such file"],
        ),
        // Before the planner has spent its budget.
        (
            "run --map good.map --scen good.scen --agents 1 --planner lacam --plan-out no/plan.json",
            &["no/plan.json: cannot", "folder"],
        ),
        (
            "run --map good.map --scen good.scen --agents 1 --planner lacam --trace-out no/t.fyt",
            &["no/t.fyt: cannot", "folder"],
        ),
        (
            "run --map good.map --scen good.scen --agents 1 --planner lacam --picture no/p.svg",
            &["no/p.svg: cannot", "folder"],
        ),
        (
            "run --map good.map --scen good.scen --agents 1 --planner lacam --plan-out {here}",
            &["cannot write: this is a folder"],
        ),
        (
            "maps generate empty --rows 4 --cols 4 --out no",
            &["no/empty-4-4.map: cannot write", "folder"],
        ),
    ];
    for (line, texts) in cases {
        let ended = yard.line(line).expect(INPUT);
        assert_eq!(ended.stdout, "", "{line}");
        says(&ended, texts);
    }
    assert_eq!(yard.files().len(), 2, "{:?}", yard.files());
}

#[test]
fn pipes_and_devices_are_refused_and_not_waited_for() {
    let yard = Yard::new();
    yard.write("good.map", MAP);
    yard.write("good.scen", good_scenario());
    let made = Command::new("mkfifo").arg(yard.path("pipe")).status();
    if !made.is_ok_and(|made| made.success()) {
        eprintln!("skipped: there is no mkfifo");
        return;
    }
    // For what is known by the end of its name.
    for name in [
        "p.so",
        "p.py",
        "planner.toml",
        "s.sqlite",
        "s.manifest.json",
    ] {
        std::os::unix::fs::symlink("pipe", yard.path(name)).unwrap();
    }
    for line in [
        "maps info pipe",
        "run --map pipe --scen good.scen --agents 1 --planner lacam",
        "run --map good.map --scen pipe --agents 1 --planner lacam",
        "run --map /dev/zero --scen good.scen --agents 1 --planner lacam",
        "run --map good.map --scen good.scen --agents 1 --planner ./p.py",
        "run --map good.map --scen good.scen --agents 1 --planner ./p.so",
        "run --map good.map --scen good.scen --agents 1 --planner ./planner.toml",
        "run --map good.map --scen good.scen --agents 1 --planner lacam --plan-out pipe",
        "run --map good.map --scen good.scen --agents 1 --planner lacam --trace-out pipe",
        "validate --map good.map --scen good.scen --agents 1 pipe",
        "simulate --map good.map pipe",
        "trace info pipe",
        "fleet --replay pipe",
        "bench pipe",
        "store info s.sqlite",
        "store info pipe",
        "report pipe",
        "store export pipe --csv t.csv",
    ] {
        let ended = yard.line(line);
        let refused = ended
            .code
            .is_some_and(|code| code == INPUT || code == PLUGIN || code == USAGE);
        assert!(refused, "{line}: {ended}");
    }
    for line in ["maps info pipe", "store info s.sqlite", "trace info pipe"] {
        says(&yard.line(line), &["this is a pipe, not a file"]);
    }
}

// ---- Plan files --------------------------------------------------------------------

#[test]
fn bad_plan_files() {
    let yard = Yard::new();
    yard.write("good.map", MAP);
    yard.write("good.scen", good_scenario());
    let lines = [
        "run --map good.map --scen good.scen --agents 3 --planner lacam --plan-out good.json",
        "maps generate empty --rows 4 --cols 4 --out {here}",
    ];
    for line in lines {
        yard.line(line).expect(SUCCESS);
    }
    let good = String::from_utf8(yard.read("good.json")).unwrap();
    let plan: Value = serde_json::from_str(&good).unwrap();
    let digest = plan["plan_digest"].as_str().unwrap();
    let other = format!("{:032x}", 7);
    let cases: &[(&str, String, &[&str])] = &[
        ("empty", String::new(), &["bad.json", "empty"]),
        ("cut", good[..good.len() / 2].into(), &["bad.json:"]),
        ("text", "a plan\n".into(), &["bad.json:1:1: "]),
        ("list", "[]".into(), &["bad.json:1:"]),
        (
            "another format",
            good.replace("fleetyard.plan/1", "fleetyard.plan/9"),
            &["bad.json:", "fleetyard.plan/9"],
        ),
        (
            "no paths",
            good.replace("\"paths\"", "\"trails\""),
            &["bad.json:", "trails"],
        ),
        (
            "another digest",
            good.replace(digest, &other),
            &["bad.json", digest],
        ),
        (
            "deep",
            format!("{}\n", "[".repeat(1_000_000)),
            &["bad.json:1:"],
        ),
    ];
    for (name, plan, texts) in cases {
        yard.write("bad.json", plan);
        for command in ["validate --scen good.scen --agents 3", "simulate"] {
            let ended = yard
                .line(&format!("{command} --map good.map bad.json"))
                .expect(INPUT);
            assert_eq!(ended.stdout, "", "{name}: {command}");
            says(&ended, texts);
        }
    }
    // Good files that do not belong together.
    let lines = [
        ("simulate --map empty-4-4.map good.json", "columns"),
        (
            "validate --map good.map --scen good.scen --agents 2 good.json",
            "instance",
        ),
    ];
    for (line, text) in lines {
        says(
            &yard.line(line).expect(INPUT),
            &["good.json: ", text, "hint: "],
        );
    }
}

#[test]
fn bad_plans_in_the_plane() {
    let yard = Yard::new();
    yard.write(
        "good.json",
        r#"{"format": "fleetyard.trajectories/1", "paths": [[[0,1,1],[1,2,1]],[[0,5,5]]]}"#,
    );
    let trajectories = |paths: &str| {
        format!("{{\"format\": \"fleetyard.trajectories/1\", \"paths\":\n{paths}}}\n")
    };
    let on_roadmap = |rest: &str| format!("{{\"format\": \"fleetyard.roadmap-plan/1\", {rest}}}\n");
    let cases: &[(&str, String, &[&str])] = &[
        (
            "going back in time",
            trajectories("[[[0,0,0],[2,1,0],[1,0,0]]]"),
            &["bad.json:2:25: ", "back in time, from 2 s to 1 s"],
        ),
        (
            "a gap",
            trajectories("[[[0,0,0],[2,1,0],[2,9,0]]]"),
            &["bad.json:2:25: ", "there is a gap", "hint: "],
        ),
        (
            "not a number",
            trajectories("[[[0,0,NaN]]]"),
            &["bad.json:2:", "hint: "],
        ),
        (
            "infinite",
            trajectories("[[[0,0,1e999]]]"),
            &["bad.json:2:", "out of range"],
        ),
        (
            "far away",
            trajectories("[[[0,0,1e12]]]"),
            &["bad.json:2:", "beyond"],
        ),
        (
            "no knots",
            trajectories("[[]]"),
            &["agent 0 has no knots", "hint: "],
        ),
        (
            "another version",
            trajectories("[]").replace("/1", "/2"),
            &["bad.json:1:", "fleetyard.trajectories/2"],
        ),
        (
            "deep",
            trajectories(&"[".repeat(1_000_000)),
            &["bad.json:2:"],
        ),
        (
            "truncated",
            trajectories("[[[0,0,").replace("}\n", ""),
            &["bad.json:"],
        ),
        (
            "no roadmap",
            on_roadmap("\"paths\": [[[0,0]]]"),
            &["bad.json: ", "does not name its roadmap", "hint: "],
        ),
        (
            "a roadmap that is not there",
            on_roadmap("\"roadmap\": \"gone.json\", \"paths\": [[[0,0]]]"),
            &["gone.json: no such file"],
        ),
        (
            "a roadmap that is none",
            on_roadmap("\"roadmap\": \"good.json\", \"paths\": [[[0,0]]]"),
            &["good.json:1:", "expected \"fleetyard.roadmap/1\""],
        ),
        (
            "XML that is not closed",
            "<graphml><graph>\n<node".to_owned(),
            &["bad.json:", "this is not XML"],
        ),
    ];
    for (name, content, texts) in cases {
        yard.write("bad.json", content);
        for line in [
            "convert bad.json out.json",
            "validate bad.json --world w.json --radius 1",
        ] {
            let ended = yard.line(line).expect(INPUT);
            assert_eq!(ended.stdout, "", "{name}: {line}");
            says(&ended, texts);
        }
    }
    // What the plan is held against.
    for (option, content, texts) in [
        (
            "--radius 1 --world",
            r#"{"format": "fleetyard.world/1", "bounds_m": [0,0,9,9], "obstacles": [{"polygon": [[0,0],[1,1],[1,0],[0,1]]}]}"#,
            ["bad.json:1:", "intersects itself"],
        ),
        (
            "--fleet",
            r#"{"format": "fleetyard.fleet/1", "profiles": {"a": {"footprint": {"disc": {"radius_m": 0}}, "model": "agv"}}, "agents": {"all": "a"}}"#,
            ["bad.json:1:", "radius_m is 0"],
        ),
        (
            "--fleet",
            r#"{"format": "fleetyard.fleet/1", "profiles": {"a": "go2"}, "agents": ["a"]}"#,
            ["bad.json: ", "lists 1 agents, but there are 2"],
        ),
    ] {
        yard.write("bad.json", content);
        let line = format!("validate good.json {option} bad.json --map good.map");
        yard.write("good.map", MAP);
        let ended = yard.line(&line).expect(INPUT);
        assert_eq!(ended.stdout, "", "{line}");
        says(&ended, &texts);
    }
    assert!(!yard.path("out.json").exists());
}

// ---- The command line --------------------------------------------------------------

#[test]
fn bad_command_lines() {
    let yard = Yard::new();
    yard.write("good.map", MAP);
    yard.write("good.scen", good_scenario());
    let run = "run --map good.map --scen good.scen --agents 2 --planner lacam";
    let cases: &[(&str, &[&str])] = &[
        ("", &["Usage: fleetyard"]),
        ("walk", &["walk"]),
        ("run --map good.map", &["--scen", "--agents", "--planner"]),
        (&format!("{run} --budget 10"), &["with its unit"]),
        (&format!("{run} --budget=-1s"), &["'-1s'", "with its unit"]),
        (&format!("{run} --budget -1s"), &["unexpected argument"]),
        (&format!("{run} --budget 0s"), &["longer than nothing"]),
        (&format!("{run} --budget 10years"), &["shorter than a year"]),
        (
            &format!("{run} --budget soon"),
            &["'soon'", "with its unit"],
        ),
        (
            &format!("{run} --prepare-budget 5"),
            &["--prepare-budget", "with its unit"],
        ),
        (&format!("{run} --threads 0"), &["--threads", "0"]),
        (&format!("{run} --seed -1"), &["-1"]),
        (&format!("{run} --connectivity 6"), &["4 or 8 neighbours"]),
        (
            &format!("{run} --attach telepathy"),
            &["telepathy", "worker"],
        ),
        (&format!("{run} --format xml"), &["xml", "json"]),
        (
            &format!("{run} --picture plan.jpg"),
            &["plan.jpg", ".svg or .png"],
        ),
        (
            "fleet --map good.map --agents 2 --planner pibt --delay bernoulli:0.1",
            &["bernoulli:0.1", "for example bernoulli:0.1,2s"],
        ),
        (
            &format!("{run} anytime"),
            &["`anytime` after the plugin `lacam` is no option NAME=VALUE"],
        ),
        // Options of a planner.
        (
            &format!("{run} anytme=true"),
            &["anytme", "did you mean `anytime`?"],
        ),
        (
            &format!("{run} --option anytme=true"),
            &["anytme", "did you mean `anytime`?"],
        ),
        (
            &format!("{run} --option zzzzzzzz=1"),
            &["zzzzzzzz", "hint: "],
        ),
        (
            &format!("{run} --option anytime=maybe"),
            &["option `anytime`", "maybe"],
        ),
        (
            &format!("{run} --option anytime=3"),
            &["option `anytime`", "boolean"],
        ),
        (
            &format!("{run} --option anytime"),
            &["`anytime` has no value", "hint: "],
        ),
        (&format!("{run} --option =true"), &["hint: "]),
        // Planners that do not exist.
        (
            "run --map good.map --scen good.scen --agents 2 --planner lacan",
            &["there is no planner `lacan`", "hint: did you mean `lacam`?"],
        ),
        (
            "run --map good.map --scen good.scen --agents 2 --planner simulated-annealing",
            &[
                "there is no planner `simulated-annealing`",
                "known: ",
                "lacam",
            ],
        ),
        (
            "compare --map good.map --scen good.scen --agents 2 --planner lacam --planner pibtt",
            &["there is no planner `pibtt`", "did you mean `pibt`?"],
        ),
        (
            "plugins info lacan",
            &["there is no plugin `lacan`", "lacam"],
        ),
        // Generators.
        ("maps generate empty --rows 0 --cols 4", &["--rows"]),
        (
            "maps generate random --rows 4 --cols 4 --obstacle-density 2",
            &["--obstacle-density"],
        ),
        (
            "maps generate empty --rows 2 --cols 2 --scenario-agents 5",
            &["--scenario-agents"],
        ),
        (
            "maps generate empty --rows 4000000000 --cols 4000000000",
            &["--rows"],
        ),
        ("completions powder", &["powder"]),
    ];
    for (line, texts) in cases {
        let ended = yard.line(line).expect(USAGE);
        assert_eq!(ended.stdout, "", "{line}");
        says(&ended, texts);
    }
    assert_eq!(yard.files().len(), 2, "{:?}", yard.files());
}

#[test]
fn bad_worlds() {
    let yard = Yard::new();
    yard.write("good.map", MAP);
    yard.write("good.scen", good_scenario());
    let run = "run --map good.map --scen good.scen --agents 2 --planner lacam --execute";
    for world in [
        "--cell-size 0",
        "--cell-size NaN",
        "--step -1",
        "--step inf",
        "--radius 0.6",
        "--radius -1",
        "--ticks-hz 0",
        "--substeps 0",
    ] {
        // Before the planner has spent its budget, and whichever place finds it.
        let line = format!("{run} {world}").replace(" -1", "=-1");
        let ended = yard.line(&line);
        let code = ended.code;
        assert!(
            code == Some(INPUT) || code == Some(USAGE),
            "{world}: {ended}"
        );
        assert!(ended.stdout.is_empty(), "{world}: {ended}");
        says(&ended, &["error: "]);
    }
}

// ---- Files that are no plugins ------------------------------------------------------

#[test]
fn files_that_are_no_plugins() {
    let yard = Yard::new();
    yard.write("good.map", MAP);
    yard.write("good.scen", good_scenario());
    yard.write("text.so", "This is no library.\n");
    yard.write("short.so", "\x7fELF");
    yard.write("notes.txt", "This is no program.\n");
    for (name, script) in [
        ("no-interpreter", "#!/no/such/interpreter\n"),
        ("silent", "#!/bin/sh\nexit 0\n"),
        ("loud", "#!/bin/sh\necho 'no licence found' >&2\nexit 3\n"),
        ("echo", "#!/bin/sh\nexec cat\n"),
        ("dies", "#!/bin/sh\nkill -9 $$\n"),
    ] {
        fs::set_permissions(yard.write(name, script), Permissions::from_mode(0o755)).unwrap();
    }
    let cases: &[(&str, &[&str])] = &[
        (
            "./text.so",
            &[
                "text.so is no shared library that can be loaded",
                "hint: a plugin is an ELF",
            ],
        ),
        (
            "./short.so",
            &["short.so is no shared library that can be loaded"],
        ),
        // A name without a slash is a path where there is such a file.
        (
            "text.so",
            &["text.so is no shared library that can be loaded"],
        ),
        (
            "{here}",
            &["has several plugins", "short.so", "name the file of one"],
        ),
        (
            "./notes.txt",
            &[
                "notes.txt is neither a shared library (.so) nor executable",
                "chmod +x",
            ],
        ),
        (
            "./no-interpreter",
            &[
                "cannot start",
                "no-interpreter",
                "is its interpreter installed?",
            ],
        ),
        (
            "./silent",
            &[
                "silent is no plugin that speaks the protocol",
                "exited with code 0",
            ],
        ),
        (
            "./loud",
            &[
                "exited with code 3",
                "its last words were: no licence found",
            ],
        ),
        (
            "./echo",
            &[
                "broke the protocol during `initialize`",
                "only the host asks",
            ],
        ),
        ("./dies", &["crashed with SIGKILL (signal 9)"]),
    ];
    let before = yard.files();
    for (planner, texts) in cases {
        let ended = yard
            .line(&format!(
                "run --map good.map --scen good.scen --agents 2 --planner {planner} \
                 --plan-out plan.json --trace-out trace.fyt --picture picture.svg"
            ))
            .expect(PLUGIN);
        assert_eq!(ended.stdout, "", "{planner}");
        says(&ended, texts);
        says(
            &yard.line(&format!("plugins info {planner}")).expect(PLUGIN),
            texts,
        );
    }
    assert_eq!(yard.files(), before);
}

/// A script has to tell who is to mend it: the one who typed, the one who put files there, or
/// the plugin's author.
#[test]
fn exit_codes_tell_a_missing_plugin_a_broken_manifest_and_an_unknown_name_apart() {
    let yard = Yard::new();
    yard.write("good.map", MAP);
    yard.write("good.scen", good_scenario());
    yard.write("bad.planner.toml", "format = [");
    yard.write("text.so", "This is no library.\n");
    let suite = "name = \"s\"\n[budget]\nwall = \"1s\"\n[[planner]]\nplugin = \"PLANNER\"\n\
                 [[instances]]\nscen = [\"good.scen\"]\nmap = \"good.map\"\nagents = [2]\n";
    let library = faulty_library().display().to_string();
    for (planner, code) in [
        ("./nothing.so", INPUT),
        ("nothing/", INPUT),
        ("./bad.planner.toml", INPUT),
        ("no-such-planner", USAGE),
        (&format!("{library}:nobody"), USAGE),
        ("./text.so", PLUGIN),
    ] {
        let instance = "--map good.map --scen good.scen --agents 2";
        for line in [
            format!("run {instance} --planner {planner}"),
            format!("compare {instance} --planner {planner} --planner lacam"),
            format!("fleet --map good.map --agents 2 --duration 1s --planner {planner}"),
        ] {
            let ended = yard.line(&line).expect(code);
            says(&ended, &["error: "]);
        }
        let named = yard.line(&format!("plugins info {planner}"));
        assert_eq!(named.code, Some(code), "{planner}: {named}");
        // Here the suite's line is wrong.
        yard.write("s.toml", suite.replace("PLANNER", planner));
        says(&yard.line("bench s.toml").expect(INPUT), &["s.toml"]);
    }
}

/// Libraries that are faulty before there is a planner.
#[test]
fn libraries_that_break_the_contract() {
    let library = "fleetyard_plugin_entry_v1";
    let cases: &[(&str, &[&str])] = &[
        (
            "NO_SYMBOL",
            &["no_symbol.so is no Fleetyard plugin", library, "hint: "],
        ),
        (
            "WRONG_MAJOR",
            &[
                "built for version 2.0 of the plugin ABI; this host has 1.",
                "hint: build it",
            ],
        ),
        (
            "SHORT_ENTRY",
            &[library, "struct_size is 16, but the structure has"],
        ),
        (
            "SHORT_FACTORY",
            &["factory.struct_size is 8, but the structure has"],
        ),
        (
            "SHORT_DESCRIPTOR",
            &["descriptor.struct_size is 8, but the structure has"],
        ),
        ("NULL_DESCRIPTOR", &["descriptor is null"]),
        ("NULL_GET_FACTORY", &["get_factory is null"]),
        ("INIT_FAILS", &["init failed with code -1"]),
        ("MANY_PLUGINS", &["claims to have 4000000000 plugins"]),
        ("BAD_ID", &["`Not an identifier` is no identifier"]),
        ("BAD_SCHEMA", &["options schema of `faulty` is not JSON"]),
        (
            "SHORT_PLANNER",
            &["`create` left a structure of the wrong size"],
        ),
        (
            "NULL_PLAN",
            &["`create` left a structure of the wrong size or without functions"],
        ),
    ];
    let yard = Yard::new();
    for (variant, texts) in cases {
        let path = c_library("plugins/faulty/faulty.c", Some(variant));
        for attach in ["worker", "in-process"] {
            let ended = yard.run(&planner(&path.display().to_string(), &["--attach", attach]));
            let ended = ended.expect(PLUGIN);
            says(&ended, texts);
            assert!(ended.stderr.lines().count() <= 10, "{variant}: {ended}");
        }
    }
    // Odd, but no fault.
    for variant in ["NEWER_MINOR", "CHATTY_LOAD", "LYING_CAPABILITIES"] {
        let path = c_library("plugins/faulty/faulty.c", Some(variant));
        yard.run(&planner(&path.display().to_string(), &[]))
            .expect(SUCCESS);
    }
    let path = c_library("plugins/faulty/faulty.c", Some("CONSTRUCTOR_CRASH"));
    let ended = yard
        .run(&planner(&path.display().to_string(), &[]))
        .expect(PLUGIN);
    says(
        &ended,
        &["constructor_crash.so is no plugin", "crashed with SIG"],
    );
    assert!(yard.files().is_empty(), "{:?}", yard.files());
}

#[test]
fn a_rust_plugin_of_another_layout_is_refused_in_a_few_lines() {
    let library = build("fleetyard-faulty-changed-layout").library.unwrap();
    let yard = Yard::new();
    for attach in ["worker", "in-process"] {
        let ended = yard.run(&planner(
            &library.display().to_string(),
            &["--attach", attach],
        ));
        let ended = ended.expect(PLUGIN);
        says(
            &ended,
            &["another layout of the contract", "hint: rebuild it"],
        );
        assert!(ended.stderr.lines().count() <= 10, "{ended}");
    }
}

#[test]
fn attachments_that_do_not_fit() {
    let library = faulty_library().display().to_string();
    let program = faulty_program().display().to_string();
    let nobody = format!("{library}:nobody");
    let yard = Yard::new();
    let cases: &[(&str, &[&str], &[&str])] = &[
        (
            &library,
            &["--attach", "stdio"],
            &["does not speak JSON", "--attach worker"],
        ),
        (
            &program,
            &["--attach", "worker"],
            &["cannot be loaded", "--attach stdio"],
        ),
        (
            &program,
            &["--attach", "in-process"],
            &["cannot be loaded", "--attach stdio"],
        ),
    ];
    let ended = yard.run(&planner(&nobody, &[])).expect(USAGE);
    says(&ended, &["has no planner `nobody`", "it has faulty"]);
    for (name, arguments, texts) in cases {
        says(&yard.run(&planner(name, arguments)).expect(PLUGIN), texts);
    }
    // What a planner does not claim to support is not asked of it.
    let ended = yard
        .run(&planner(&library, &["--connectivity", "8"]))
        .expect(NO_PLAN);
    says(&ended, &["eight-connected"]);
}

// ---- Planners that misbehave ----------------------------------------------------------

fn planner(name: &str, arguments: &[&str]) -> Vec<String> {
    let mut line = words("run --budget 60s --planner");
    line.push(name.to_owned());
    // Obstacles to run into, and room to move.
    line.extend(instance("random-32-32-20", 4));
    line.extend(arguments.iter().map(ToString::to_string));
    line
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum By {
    Worker,
    InProcess,
    Stdio,
}
use By::{InProcess, Stdio, Worker};

/// A library or a program; for what would take the host down in its own process.
const APART: &[By] = &[Worker, Stdio];
const ALL: &[By] = &[Worker, InProcess, Stdio];
const LIBRARY: &[By] = &[Worker, InProcess];

/// Lets the faulty planner do `fault`, with further arguments, and checks the files
/// that it leaves against what the record says.
fn misbehave(fault: &str, by: By, arguments: &str) -> Ended {
    let path = match by {
        Worker | InProcess => faulty_library(),
        Stdio => faulty_program(),
    };
    let attach = match by {
        Worker => "worker",
        InProcess => "in-process",
        Stdio => "stdio",
    };
    let yard = Yard::new();
    let fault = format!("fault={fault}");
    let mut line = planner(
        &path.display().to_string(),
        &["--attach", attach, "--option", &fault, "--format", "json"],
    );
    line.extend(words(
        "--plan-out plan.json --trace-out trace.fyt --picture picture.svg",
    ));
    // The last of a repeated argument would be refused: the budget is replaced.
    let more = words(arguments);
    if more.iter().any(|word| word == "--budget") {
        let at = line.iter().position(|word| word == "--budget").unwrap();
        line.drain(at..at + 2);
    }
    line.extend(more);
    let ended = yard.run(&line);
    let record = ended.json();
    let mut files = BTreeSet::from(["picture.svg".to_owned()]);
    if !record["plan_digest"].is_null() {
        let plan: Value = serde_json::from_slice(&yard.read("plan.json")).unwrap();
        assert_eq!(plan["plan_digest"], record["plan_digest"]);
        files.insert("plan.json".into());
    }
    if !record["execution"].is_null() {
        files.insert("trace.fyt".into());
    }
    assert_eq!(yard.files(), files, "{ended}");
    let picture = yard.read("picture.svg");
    assert!(picture.trim_ascii_end().ends_with(b"</svg>"), "{ended}");
    ended
}

/// A fault, who can have it, and what the host says of it.
type Case<'a> = (&'a str, &'a [By], &'a [&'a str]);

fn check(cases: &[Case<'_>], arguments: &str, code: i32, termination: &str) {
    for (fault, ways, texts) in cases {
        for by in *ways {
            if *by == Stdio && !have("python3") {
                continue;
            }
            let ended = misbehave(fault, *by, arguments).expect(code);
            let record = ended.json();
            assert_eq!(record["termination"], termination, "{fault} {by:?} {ended}");
            says(&ended, texts);
        }
    }
}

#[test]
fn plans_that_break_a_rule() {
    let cases = [
        ("empty-path", "empty-path"),
        ("wrong-start", "wrong-start"),
        ("not-at-goal", "wrong-goal"),
        ("teleport", "not-adjacent"),
        ("collide", "vertex-conflict"),
        ("collide-parked", "parked-conflict"),
        ("swap", "swap-conflict"),
        ("leave-map", "out-of-bounds"),
        ("through-obstacle", "obstacle"),
    ];
    for (fault, rule) in cases {
        let mut digests = BTreeSet::new();
        for by in ALL {
            if *by == Stdio && !have("python3") {
                continue;
            }
            let ended = misbehave(fault, *by, "").expect(INVALID_PLAN);
            let record = ended.json();
            assert_eq!(record["claim"], "solved", "{ended}");
            assert_eq!(record["verdict"]["valid"], false, "{ended}");
            let violations = record["verdict"]["violations"].as_array().unwrap();
            assert!(!violations.is_empty(), "{ended}");
            for violation in violations {
                assert_eq!(violation["rule"], rule, "{fault} {by:?} {ended}");
            }
            digests.insert(record["plan_digest"].to_string());
        }
        assert_eq!(digests.len(), 1, "{fault}: another plan by another way");
    }
}

#[test]
fn answers_that_break_the_protocol() {
    let few = "the plan has 3 paths, but the instance has 4 agents";
    let many = "the plan has 5 paths, but the instance has 4 agents";
    let none = "it claims `solved` but submitted no plan";
    let cases: &[Case<'_>] = &[
        (
            "too-few-agents",
            ALL,
            &["broke the protocol during `plan`", few],
        ),
        (
            "too-many-agents",
            ALL,
            &["broke the protocol during `plan`", many],
        ),
        ("claims-solved-without-plan", ALL, &[none]),
        ("null-plan", &[Stdio], &[none]),
        ("null-plan", LIBRARY, &["plan is null"]),
        ("null-offsets", LIBRARY, &["plan.offsets is null"]),
        ("null-cells", LIBRARY, &["plan.cells is null"]),
        ("bad-plan-size", LIBRARY, &["plan.struct_size is 8"]),
        ("unordered-offsets", LIBRARY, &["out of order"]),
        (
            "bad-status",
            LIBRARY,
            &["it returned 99, which is no status"],
        ),
        ("bad-status", &[Stdio], &["unknown variant `brilliant`"]),
        ("two-results", &[Stdio], &["a second time"]),
        (
            "answers-early",
            &[Stdio],
            &["during `plan`", "before it was asked"],
        ),
        ("malformed", &[Stdio], &["a message is not JSON", "near"]),
        ("nan", &[Stdio], &["a message is not JSON", "NaN"]),
        (
            "negative-expansions",
            ALL,
            &["the figure `expansions` must be a whole number from 0, not -5"],
        ),
        (
            "half-node",
            ALL,
            &["the figure `nodes` must be a whole number from 0, not 0.5"],
        ),
        (
            "nan-bound",
            LIBRARY,
            &["the figure `lower_bound` must be a number from 0, not NaN"],
        ),
        (
            "endless-call",
            &[Stdio],
            &["it claims to have worked for 1000000000s on a call of"],
        ),
        ("deep", &[Stdio], &["broke the protocol during `plan`"]),
        ("no-version", &[Stdio], &["no \"jsonrpc\":\"2.0\""]),
        ("batch", &[Stdio], &["batches are not supported"]),
        ("not-utf8", &[Stdio], &["not UTF-8"]),
        (
            "wrong-id",
            &[Stdio],
            &["it answered request", "but was asked"],
        ),
        (
            "request",
            &[Stdio],
            &["it sent a request, `plan`, but only the host asks"],
        ),
        ("no-message", &[Stdio], &["neither a method nor an id"]),
        (
            "closes-stdout",
            &[Stdio],
            &["closed its standard output and went on running"],
        ),
        (
            "bad-cells",
            &[Stdio],
            &["the paths are malformed", "expected a cell index"],
        ),
        (
            "bad-moves",
            &[Stdio],
            &["the paths are malformed", "unknown move 'O'"],
        ),
    ];
    check(cases, "", PLUGIN, "protocol-error");
}

#[test]
fn too_much_of_it() {
    // A gigabyte of lines that are no messages; a library's go to standard error.
    let flood: &[Case<'_>] = &[("flood", &[Stdio, Worker], &["output limit of 64.0 MiB"])];
    // Far more than it takes, and far less than it took when the time to cut the
    // flood into lines grew with its square.
    check(flood, "--budget 20s", NO_PLAN, "over-limit");
    let texts = &[
        "the plan is longer than",
        "the most for 4 agents on this map",
    ];
    let huge: &[Case<'_>] = &[("huge-plan", &[Stdio], texts)];
    check(huge, "--option size=300000000", PLUGIN, "protocol-error");
    let huge: &[Case<'_>] = &[("huge-plan", LIBRARY, &["cells, more than the limit of"])];
    check(huge, "", PLUGIN, "protocol-error");
}

/// The host keeps little of the output of a planner.
#[test]
fn a_talkative_planner_does_not_fill_the_hosts_memory() {
    if !have("python3") {
        return;
    }
    let script = r#"
import json, sys
def send(**message):
    print(json.dumps({"jsonrpc": "2.0", **message}), flush=True)
about = {"id": "talker", "kind": "planner", "capabilities": ["grid", "pebble"]}
for line in sys.stdin:
    message = json.loads(line)
    answer = {"status": "solved"}
    if message["method"] == "initialize":
        answer = {"protocol_version": 1, "plugins": [about]}
    elif message["method"] == "plan":
        text = "x" * (1 << 20)
        for number in range(400):
            send(method="log", params={"level": "info", "text": text})
            send(method="metric", params={"name": text + str(number), "value": 1})
        starts = message["params"]["instance"]["starts"]
        answer["paths"] = [[start] for start in starts]
    elif message["method"] == "exit":
        break
    if "id" in message:
        send(id=message["id"], result=answer)
"#;
    let yard = Yard::new();
    yard.write("talker.py", script);
    let ended = yard.run(&planner("./talker.py", &["--execute", "--format", "json"]));
    let record = ended.expect(INVALID_PLAN).json();
    let peak_kb = &record["execution"]["host_peak_memory_kb"];
    assert!(peak_kb.as_u64().unwrap() < 200 << 10, "{peak_kb} kB");
}

#[test]
fn planners_that_report_failure() {
    let cases: &[Case<'_>] = &[
        (
            "fails",
            ALL,
            &["reported `internal-error` from `plan`: failed as asked"],
        ),
        ("rpc-error", &[Stdio], &["failed as asked"]),
    ];
    check(cases, "", PLUGIN, "failed");
    // A claim is passed on as a claim.
    let claim: &[Case<'_>] = &[(
        "claims-infeasible",
        ALL,
        &["claims that no plan exists", "believe me"],
    )];
    check(claim, "", NO_PLAN, "completed");
}

#[test]
fn planners_that_die() {
    for (fault, termination, text) in [
        ("crash", "crashed", "crashed with SIGSEGV (signal 11)"),
        ("abort", "crashed", "crashed with SIGABRT (signal 6)"),
        ("exit-0", "exited", "exited with code 0 without a result"),
        ("exit-3", "exited", "exited with code 3 without a result"),
    ] {
        for during in ["create", "prepare", "plan"] {
            for by in APART {
                if *by == Stdio && !have("python3") {
                    continue;
                }
                let during_option = format!("--option during={during}");
                let ended = misbehave(fault, *by, &during_option).expect(PLUGIN);
                assert_eq!(ended.json()["termination"], termination, "{ended}");
                says(&ended, &[text, &format!("during `{during}`")]);
            }
        }
    }
}

#[test]
fn programs_that_fail_at_the_start_and_at_the_end() {
    if !have("python3") {
        return;
    }
    let program = faulty_program().display().to_string();
    for (fault, texts) in [
        (
            "crash",
            ["is no plugin that speaks the protocol", "SIGSEGV"],
        ),
        (
            "exit-0",
            [
                "is no plugin that speaks the protocol",
                "exited with code 0",
            ],
        ),
        (
            "malformed",
            ["broke the protocol during `initialize`", "not JSON"],
        ),
        (
            "no-version",
            ["broke the protocol during `initialize`", "jsonrpc"],
        ),
        (
            "long-line",
            [
                "broke the protocol during `initialize`",
                "a message is longer than 4 MiB",
            ],
        ),
    ] {
        let yard = Yard::new().set("FLEETYARD_FAULT", fault);
        says(&yard.run(&planner(&program, &[])).expect(PLUGIN), &texts);
    }
    // After the answer only a breach of the protocol counts.
    for (fault, text) in [
        ("crash", "crashed with SIGSEGV"),
        ("exit-3", "exited with code 3"),
        ("never", "did not answer `shutdown`"),
    ] {
        let ended = misbehave(fault, Stdio, "--option during=shutdown").expect(SUCCESS);
        says(&ended, &["warning: after its answer the planner", text]);
    }
    misbehave("closes-stdin", Stdio, "").expect(SUCCESS);
}

#[test]
fn planners_that_do_not_answer_in_time() {
    let killed = "did not answer `plan` within 300 ms and was killed";
    let cases: &[Case<'_>] = &[
        ("never", APART, &[killed]),
        ("spin", APART, &[killed]),
        ("ignore-sigterm", APART, &[killed]),
        ("late", APART, &[killed]),
        ("partial", &[Stdio], &[killed]),
    ];
    check(
        cases,
        "--budget 300ms --prepare-budget 60s",
        NO_PLAN,
        "timed-out",
    );
    let killed = "did not answer `prepare` within 300 ms and was killed";
    let cases: &[Case<'_>] = &[("never", APART, &[killed])];
    check(
        cases,
        "--prepare-budget 300ms --option during=prepare",
        NO_PLAN,
        "timed-out",
    );
}

#[test]
fn plans_in_the_grace_period_do_not_count() {
    let text = "no plan within the budget of 300ms";
    let line = "--budget 300ms --prepare-budget 60s --grace 60s";
    check(&[("late", APART, &[text])], line, NO_PLAN, "timed-out");
    // Nobody can be killed in the host's own process.
    let line = "--budget 300ms --prepare-budget 60s";
    check(
        &[("late", &[InProcess], &[text])],
        line,
        NO_PLAN,
        "timed-out",
    );
}

#[test]
fn oddities_that_are_no_fault() {
    let cases: &[Case<'_>] = &[
        ("none", ALL, &[]),
        ("twice", ALL, &[]),
        // Started by the planner, in another session, deaf to polite signals.
        ("grandchild", APART, &[]),
        ("nan", LIBRARY, &[]),
        ("bad-instance", LIBRARY, &[]),
        ("garbage", &[Worker], &[]),
        (
            "garbage",
            &[Stdio],
            &["lines to standard output that are no messages"],
        ),
    ];
    check(cases, "", SUCCESS, "completed");
}

#[test]
fn a_fault_does_not_spoil_a_comparison() {
    let library = faulty_library().display().to_string();
    let yard = Yard::new();
    let mut line = words("compare --budget 2s --planner pibt --format json --planner");
    line.push(library);
    line.extend(instance("empty-8-8", 3));
    let record = yard.run(&line).expect(SUCCESS).json();
    assert_eq!(record["rows"].as_array().unwrap().len(), 2);

    // Everybody stays, which the planner does not call a plan.
    line.extend(words("--planner empty"));
    let ended = yard.run(&line).expect(NO_PLAN);
    let record = ended.json();
    let failures: Vec<&Value> = record["rows"]
        .as_array()
        .unwrap()
        .iter()
        .map(|row| &row["failures"])
        .collect();
    assert_eq!(failures[0].as_array().unwrap().len(), 0, "{ended}");
    assert_eq!(failures[2][0], "no plan: gave-up", "{ended}");
}

#[test]
fn a_bad_file_on_the_plugin_path_hides_no_other() {
    let yard = Yard::new();
    let folder = yard.path("plugins");
    fs::create_dir(&folder).unwrap();
    fs::write(folder.join("a-text.so"), "no library").unwrap();
    fs::write(folder.join("b-notes.txt"), "no program").unwrap();
    fs::copy(
        c_library("plugins/faulty/faulty.c", Some("WRONG_MAJOR")),
        folder.join("c-major.so"),
    )
    .unwrap();
    fs::copy(faulty_library(), folder.join("d-faulty.so")).unwrap();
    let yard = yard.set("FLEETYARD_PLUGIN_PATH", &folder.display().to_string());
    let ended = yard.line("plugins list --format json").expect(SUCCESS);
    let listed = ended.json();
    let place = |name: &str| {
        let named = |file: &&Value| {
            file["path"]
                .as_str()
                .is_some_and(|path| path.ends_with(name))
        };
        listed.as_array().unwrap().iter().find(named).cloned()
    };
    let refused = |name: &str| place(name).unwrap()["refused"].as_str().unwrap().to_owned();
    assert!(
        refused("a-text.so").contains("no shared library"),
        "{ended}"
    );
    assert!(refused("c-major.so").contains("version 2.0"), "{ended}");
    assert!(place("b-notes.txt").is_none(), "{ended}");
    assert_eq!(place("d-faulty.so").unwrap()["plugins"][0]["id"], "faulty");
    let ended = yard.line("plugins list").expect(SUCCESS);
    says(&ended, &["warning: ", "version 2.0", "no shared library"]);
    assert!(
        ended.stdout.contains("(refused)") && ended.stdout.contains("lacam"),
        "{ended}"
    );
    // By identifier, from the plugin path.
    let mut line = words("run --planner faulty --budget 60s");
    line.extend(instance("empty-8-8", 2));
    yard.run(&line).expect(SUCCESS);
}
