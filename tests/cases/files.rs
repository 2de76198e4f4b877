//! Maps, scenarios and plans that are wrong or not there.

use std::collections::BTreeSet;
use std::process::Command;
use std::sync::OnceLock;

use fleetyard_testkit::{Ended, INPUT, PLUGIN, SUCCESS, USAGE, Yard};
use serde_json::Value;

use crate::{Tests, says};

pub(crate) fn add(tests: &mut Tests) {
    maps(tests);
    scenarios(tests);
    missing(tests);
    pipes(tests);
    plans(tests);
    plans_in_the_plane(tests);
}

pub(crate) const MAP: &str = "type octile\nheight 4\nwidth 5\nmap\n.....\n.@@@.\n.@.@.\n.@@@.\n";

/// A scenario of agents from `(x, y)` to `(x, y)` on the map above.
fn scenario(agents: &[[u32; 4]]) -> String {
    let lines = agents
        .iter()
        .map(|[sx, sy, gx, gy]| format!("0\tgood.map\t5\t4\t{sx}\t{sy}\t{gx}\t{gy}\t1.0\n"));
    std::iter::once("version 1\n".to_owned())
        .chain(lines)
        .collect()
}

/// A folder with that map and a scenario of three agents.
pub(crate) fn good_files() -> Yard {
    let yard = Yard::new();
    yard.write("good.map", MAP);
    yard.write("good.scen", good_scenario());
    yard
}

fn good_scenario() -> String {
    scenario(&[[0, 0, 4, 0], [4, 0, 4, 3], [0, 3, 0, 0]])
}

/// Runs a planner on a map and a scenario; nothing may be written where it fails.
fn run(map: &[u8], scen: &[u8], agents: usize) -> Ended {
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
        assert_eq!(ended.stdout, "", "{ended}");
    }
    ended
}

fn maps(tests: &mut Tests) {
    let huge = "type octile\nheight 1000000\nwidth 1000000\nmap\n.....\n";
    let cases: [(&str, Vec<u8>, &[&str]); 16] = [
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
        tests.add(&format!("maps::{name}"), move || {
            says(
                &run(&map, good_scenario().as_bytes(), 3).expect(INPUT),
                texts,
            );
        });
    }
    tests.add("maps::good", || {
        run(MAP.as_bytes(), good_scenario().as_bytes(), 3).expect(SUCCESS);
    });
}

fn scenarios(tests: &mut Tests) {
    let cases: [(&str, String, usize, &[&str]); 16] = [
        (
            "empty",
            String::new(),
            1,
            &["good.scen", "the file is empty"],
        ),
        ("no entries", "version 1\n".into(), 1, &["has no entries"]),
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
        tests.add(&format!("scenarios::{name}"), move || {
            says(
                &run(MAP.as_bytes(), scen.as_bytes(), agents).expect(INPUT),
                texts,
            );
        });
    }
}

fn missing(tests: &mut Tests) {
    let on_good = |rest: &str| {
        format!("run --map good.map --scen good.scen --agents 1 --planner lacam {rest}")
    };
    let cases: [(&str, String, &[&str]); 12] = [
        (
            "a map nearly of that name",
            "run --map goud.map --scen good.scen --agents 1 --planner lacam".into(),
            &["goud.map: no such file", "did you mean", "good.map?"],
        ),
        (
            "a scenario",
            "run --map good.map --scen nothing/at/all --agents 1 --planner lacam".into(),
            &["nothing/at/all: no such file"],
        ),
        (
            "a folder for a map",
            "maps info {here}".into(),
            &["this is a folder, not a file"],
        ),
        (
            "a map to describe",
            "maps info no.map".into(),
            &["no.map: no such file"],
        ),
        (
            "a plan to validate",
            "validate --map good.map --scen good.scen --agents 1 no.json".into(),
            &["no.json: no such file"],
        ),
        (
            "a plan to simulate",
            "simulate --map good.map no.json".into(),
            &["no.json: no such file"],
        ),
        (
            "one of two scenarios",
            "compare --map good.map --scen good.scen no.scen --agents 1 --planner lacam".into(),
            &["no.scen: no such file"],
        ),
        // Before the planner has spent its budget.
        (
            "the folder of a plan",
            on_good("--plan-out no/plan.json"),
            &["no/plan.json: cannot", "folder"],
        ),
        (
            "the folder of a trace",
            on_good("--trace-out no/t.fyt"),
            &["no/t.fyt: cannot", "folder"],
        ),
        (
            "the folder of a picture",
            on_good("--picture no/p.svg"),
            &["no/p.svg: cannot", "folder"],
        ),
        (
            "a folder for a plan",
            on_good("--plan-out {here}"),
            &["cannot write: this is a folder"],
        ),
        (
            "the folder of a map",
            "maps generate empty --rows 4 --cols 4 --out no".into(),
            &["no/empty-4-4.map: cannot write", "folder"],
        ),
    ];
    for (name, line, texts) in cases {
        tests.add(&format!("missing::{name}"), move || {
            let yard = good_files();
            let ended = yard.line(&line).expect(INPUT);
            assert_eq!(ended.stdout, "");
            says(&ended, texts);
            assert_eq!(yard.files().len(), 2, "{:?}", yard.files());
        });
    }
}

/// Pipes and devices are refused, and nobody waits for them.
fn pipes(tests: &mut Tests) {
    let on_good =
        |rest: &str| format!("run --map good.map --scen good.scen --agents 1 --planner {rest}");
    for (name, line) in [
        ("map to describe", "maps info pipe".into()),
        (
            "map",
            "run --map pipe --scen good.scen --agents 1 --planner lacam".into(),
        ),
        (
            "scenario",
            "run --map good.map --scen pipe --agents 1 --planner lacam".into(),
        ),
        (
            "device for a map",
            "run --map /dev/zero --scen good.scen --agents 1 --planner lacam".into(),
        ),
        ("program", on_good("./p.py")),
        ("library", on_good("./p.so")),
        ("manifest", on_good("./planner.toml")),
        ("plan to write", on_good("lacam --plan-out pipe")),
        ("trace to write", on_good("lacam --trace-out pipe")),
        (
            "plan to validate",
            "validate --map good.map --scen good.scen --agents 1 pipe".into(),
        ),
        ("plan to simulate", "simulate --map good.map pipe".into()),
        ("trace", "trace info pipe".into()),
        ("recording", "fleet --replay pipe".into()),
        ("suite", "bench pipe".into()),
        ("store by its name", "store info s.sqlite".into()),
        ("store", "store info pipe".into()),
        ("store to report", "report pipe".into()),
        ("store to export", "store export pipe --csv t.csv".into()),
    ] {
        tests.add(&format!("pipes::{name}"), move || {
            let yard = good_files();
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
            let ended = yard.line(&line);
            let refused = [INPUT, PLUGIN, USAGE].map(Some).contains(&ended.code);
            assert!(refused, "{ended}");
            if ["map to describe", "store by its name", "trace"].contains(&name) {
                says(&ended, &["this is a pipe, not a file"]);
            }
        });
    }
}

/// A plan for the three agents.
fn good_plan() -> &'static str {
    static PLAN: OnceLock<String> = OnceLock::new();
    PLAN.get_or_init(|| {
        let yard = good_files();
        let line =
            "run --map good.map --scen good.scen --agents 3 --planner lacam --plan-out good.json";
        yard.line(line).expect(SUCCESS);
        String::from_utf8(yard.read("good.json")).unwrap()
    })
}

/// A plan that is made wrong.
type Spoil = fn(&str) -> String;

fn plans(tests: &mut Tests) {
    let cases: [(&str, Spoil, &[&str]); 7] = [
        ("empty", |_| String::new(), &["bad.json", "empty"]),
        ("cut", |good| good[..good.len() / 2].into(), &["bad.json:"]),
        ("text", |_| "a plan\n".into(), &["bad.json:1:1: "]),
        ("list", |_| "[]".into(), &["bad.json:1:"]),
        (
            "another format",
            |good| good.replace("fleetyard.plan/1", "fleetyard.plan/9"),
            &["bad.json:", "fleetyard.plan/9"],
        ),
        (
            "no paths",
            |good| good.replace("\"paths\"", "\"trails\""),
            &["bad.json:", "trails"],
        ),
        (
            "deep",
            |_| format!("{}\n", "[".repeat(1_000_000)),
            &["bad.json:1:"],
        ),
    ];
    let refused = |plan: &str, texts: &[&str]| {
        let yard = good_files();
        yard.write("bad.json", plan);
        for command in ["validate --scen good.scen --agents 3", "simulate"] {
            let ended = yard.line(&format!("{command} --map good.map bad.json"));
            let ended = ended.expect(INPUT);
            assert_eq!(ended.stdout, "", "{command}");
            says(&ended, texts);
        }
    };
    for (name, spoil, texts) in cases {
        tests.add(&format!("plans::{name}"), move || {
            refused(&spoil(good_plan()), texts);
        });
    }
    tests.add("plans::another digest", move || {
        let plan: Value = serde_json::from_str(good_plan()).unwrap();
        let digest = plan["plan_digest"].as_str().unwrap();
        let other = good_plan().replace(digest, &format!("{:032x}", 7));
        refused(&other, &["bad.json", digest]);
    });
    // Good files that do not belong together.
    for (name, line, text) in [
        (
            "of another map",
            "simulate --map empty-4-4.map good.json",
            "columns",
        ),
        (
            "of more agents",
            "validate --map good.map --scen good.scen --agents 2 good.json",
            "instance",
        ),
    ] {
        tests.add(&format!("plans::{name}"), move || {
            let yard = good_files();
            yard.write("good.json", good_plan());
            yard.line("maps generate empty --rows 4 --cols 4 --out {here}")
                .expect(SUCCESS);
            says(
                &yard.line(line).expect(INPUT),
                &["good.json: ", text, "hint: "],
            );
        });
    }
}

/// A plan of two robots in the plane.
const TRAJECTORIES: &str =
    r#"{"format": "fleetyard.trajectories/1", "paths": [[[0,1,1],[1,2,1]],[[0,5,5]]]}"#;

fn plans_in_the_plane(tests: &mut Tests) {
    let trajectories = |paths: &str| {
        format!("{{\"format\": \"fleetyard.trajectories/1\", \"paths\":\n{paths}}}\n")
    };
    let on_roadmap = |rest: &str| format!("{{\"format\": \"fleetyard.roadmap-plan/1\", {rest}}}\n");
    let cases: [(&str, String, &[&str]); 13] = [
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
        tests.add(&format!("plane::{name}"), move || {
            let yard = Yard::new();
            yard.write("good.json", TRAJECTORIES);
            yard.write("bad.json", content);
            for line in [
                "convert bad.json out.json",
                "validate bad.json --world w.json --radius 1",
            ] {
                let ended = yard.line(line).expect(INPUT);
                assert_eq!(ended.stdout, "", "{line}");
                says(&ended, texts);
            }
            assert!(!yard.path("out.json").exists());
        });
    }
    // What the plan is held against.
    for (name, option, content, texts) in [
        (
            "an obstacle that crosses itself",
            "--radius 1 --world",
            r#"{"format": "fleetyard.world/1", "bounds_m": [0,0,9,9], "obstacles": [{"polygon": [[0,0],[1,1],[1,0],[0,1]]}]}"#,
            ["bad.json:1:", "intersects itself"],
        ),
        (
            "a robot without extent",
            "--fleet",
            r#"{"format": "fleetyard.fleet/1", "profiles": {"a": {"footprint": {"disc": {"radius_m": 0}}, "model": "agv"}}, "agents": {"all": "a"}}"#,
            ["bad.json:1:", "radius_m is 0"],
        ),
        (
            "a fleet of one",
            "--fleet",
            r#"{"format": "fleetyard.fleet/1", "profiles": {"a": "go2"}, "agents": ["a"]}"#,
            ["bad.json: ", "lists 1 agents, but there are 2"],
        ),
    ] {
        tests.add(&format!("plane::{name}"), move || {
            let yard = good_files();
            yard.write("good.json", TRAJECTORIES);
            yard.write("bad.json", content);
            let line = format!("validate good.json {option} bad.json --map good.map");
            let ended = yard.line(&line).expect(INPUT);
            assert_eq!(ended.stdout, "", "{line}");
            says(&ended, &texts);
        });
    }
}
