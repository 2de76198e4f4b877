//! `fleetyard convert`, and plans of other tools in `validate` and `simulate`.

use std::fs;
use std::io::Write as _;
use std::path::Path;
use std::process::{Command, Stdio};

use fleetyard_testkit::{Ended, INPUT, INVALID_PLAN, SUCCESS, USAGE, Yard, each, fleetyard, root};

const MAP: &str = "type octile\nheight 2\nwidth 3\nmap\n...\n.@.\n";
const SCEN: &str = "version 1\n1\ta.map\t3\t2\t0\t0\t2\t1\t3\n0\ta.map\t3\t2\t0\t1\t2\t0\t3\n";
const PLAN: &str = "{\"format\": \"fleetyard.plan/1\", \"map\": \"a\", \"rows\": 2, \"cols\": 3, \
                    \"encoding\": \"cells\", \"paths\": [[0, 1, 2, 5], [3, 0, 1, 2, 2]]}\n";

/// The same plan as the solvers of the CBS family write it.
const PATHS: &str =
    "Agent 0: (0,0)->(0,1)->(0,2)->(1,2)->\nAgent 1: (1,0)->(0,0)->(0,1)->(0,2)->\n";

const PLAN_FORMATS: [&str; 6] = [
    "plan",
    "lacam",
    "paths-txt",
    "mapf-visualizer",
    "planviz",
    "libmrp-schedule",
];

fn yard() -> Yard {
    let yard = Yard::new();
    yard.write("a.map", MAP);
    yard.write("a.scen", SCEN);
    yard.write("plan.json", PLAN);
    yard.write("paths.txt", PATHS);
    yard
}

/// Two digests that `validate` prints.
#[track_caller]
fn digests(yard: &Yard, plan: &str) -> (String, String) {
    let line = format!("validate --map a.map --scen a.scen --agents 2 {plan} --format json");
    let report = yard.line(&line).expect(SUCCESS).json();
    let digest = |key: &str| report[key].as_str().unwrap().to_owned();
    (digest("instance_digest"), digest("plan_digest"))
}

#[test]
fn a_plan_keeps_its_digest_through_every_format() {
    let yard = yard();
    let expected = digests(&yard, "plan.json");
    assert_eq!(digests(&yard, "paths.txt"), expected);
    for format in PLAN_FORMATS {
        let there = format!("{format}.out");
        // PlanViz wants goals; the others do not mind.
        let ended = yard
            .line(&format!(
                "convert plan.json {there} --to {format} --map a.map --scen a.scen"
            ))
            .expect(SUCCESS);
        assert_eq!(ended.stdout.trim(), there);
        assert_eq!(digests(&yard, &there), expected, "{format}");
        yard.line(&format!("convert {there} back.json --map a.map"))
            .expect(SUCCESS);
        assert_eq!(digests(&yard, "back.json"), expected, "{format}");
        let line = format!("simulate --map a.map {there} --format json");
        let execution = yard.line(&line).expect(SUCCESS).json();
        assert_eq!(execution["contacts"], 0, "{format}");
    }
}

#[test]
fn an_instance_keeps_its_digest_through_every_format() {
    let yard = yard();
    // A plan file that is written for an instance names its digest.
    let digest = |scen: &str| {
        let line = format!("convert paths.txt - --to plan --map a.map --scen {scen}");
        let ended = yard.line(&line).expect(SUCCESS);
        ended.json()["instance_digest"].as_str().unwrap().to_owned()
    };
    let expected = digest("a.scen");
    assert_eq!(expected, digests(&yard, "plan.json").0);
    for (format, file) in [
        ("pibt2", "a.txt"),
        ("libmrp", "a.yaml"),
        ("lorr", "league.json"),
    ] {
        yard.line(&format!("convert a.scen {file} --to {format} --map a.map"))
            .expect(SUCCESS);
        let own_map = format != "pibt2";
        let map = if own_map { "" } else { "--map a.map" };
        let ended = yard
            .line(&format!("convert {file} {format}.scen {map}"))
            .expect(SUCCESS);
        // What carries a map gives it to the scenario, under its name.
        let both = format!("{format}.scen\n{format}.map\n");
        assert_eq!(ended.stdout == both, own_map, "{ended}");
        let map = if own_map { format } else { "a" };
        let line = format!("convert paths.txt - --to plan --map {map}.map --scen {format}.scen");
        let again = yard.line(&line).expect(SUCCESS).json();
        assert_eq!(again["instance_digest"], expected.as_str(), "{format}");
    }
    for name in ["league.json", "league.map", "league.agents", "league.tasks"] {
        assert!(yard.files().contains(name), "{name}");
    }
}

#[test]
fn standard_input_and_output() {
    let yard = yard();
    let mut child = Command::new(fleetyard())
        .args("convert - - --to lacam --map a.map".split(' '))
        .current_dir(yard.path(""))
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut stdin = child.stdin.take().unwrap();
    stdin.write_all(PATHS.as_bytes()).unwrap();
    drop(stdin);
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success());
    assert_eq!(
        String::from_utf8(output.stdout).unwrap(),
        "agents=2\nmap_file=a.map\nsolved=1\nsolution=\n\
         0:(0,0),(0,1),\n1:(1,0),(0,0),\n2:(2,0),(1,0),\n3:(2,1),(2,0),\n"
    );
}

#[test]
fn what_is_missing_or_wrong_is_said_with_a_way_out() {
    let yard = yard();
    yard.write("cut.txt", "Agent 0: (0,0)->(0,\n");
    yard.write("what.txt", "hello\n");
    yard.write("empty.txt", "\n");
    yard.write("bad.yaml", "map: {dimensions: [1, x]}\n");
    let before = yard.files();
    let rows = [
        (
            "convert paths.txt x.json",
            INPUT,
            &[
                "paths.txt: a file in the format paths-txt does not say how large",
                "hint: name the map with --map",
            ][..],
        ),
        (
            "convert plan.json x.json --to planviz",
            INPUT,
            &[
                "planviz: needs a map, starts and goals",
                "hint: name them with --map FILE and --scen FILE",
            ],
        ),
        (
            "convert plan.json x.json --to planviz --map a.map",
            INPUT,
            &["planviz: needs starts and goals", "--scen FILE"],
        ),
        (
            "convert a.scen x.txt --to pibt2",
            INPUT,
            &["pibt2: needs a map, starts and goals"],
        ),
        (
            "convert a.map x.json --to plan",
            INPUT,
            &["plan: needs a plan"],
        ),
        (
            "convert a.map x.scen",
            INPUT,
            &["scen: needs starts and goals"],
        ),
        (
            "convert plan.json x.txt",
            USAGE,
            &[
                "x.txt does not say which format",
                "hint: say it with --to FORMAT, one of plan, lacam",
            ],
        ),
        (
            "convert a.scen x.foo",
            USAGE,
            &["one of map, grid, lsmart, scen, pibt2, lorr, libmrp"],
        ),
        (
            "convert plan.json x --to svg",
            USAGE,
            &["formats are plan, map, grid, lsmart, rhcr"],
        ),
        ("convert plan.json", USAGE, &["TO"]),
        ("convert", USAGE, &["FROM"]),
        (
            "convert cut.txt x.json --map a.map",
            INPUT,
            &["cut.txt:1:20: expected a column, found the end of the line"],
        ),
        (
            "convert cut.txt x.json --map a.map --from lacam",
            INPUT,
            &["cut.txt: there is no line 'solution='"],
        ),
        (
            "convert what.txt x.json",
            INPUT,
            &[
                "what.txt: this is in no format that is known",
                "hint: formats are",
            ],
        ),
        (
            "convert empty.txt x.json",
            INPUT,
            &["empty.txt: the file is empty"],
        ),
        (
            "convert bad.yaml x.scen",
            INPUT,
            &["bad.yaml:1:23: expected a coordinate, found 'x'"],
        ),
        (
            "convert gone.txt x.json",
            INPUT,
            &["gone.txt: no such file"],
        ),
        (
            "convert plan.json plan.json",
            INPUT,
            &[
                "plan.json: this is one of the files that are read",
                "hint: ",
            ],
        ),
        (
            "convert a.map ./a.map",
            INPUT,
            &["one of the files that are read"],
        ),
        (
            "convert a.scen a.json --to lorr --map a.map",
            INPUT,
            &["a.map: this is one of the files that are read"],
        ),
        (
            "convert a.map x.map --map a.map",
            USAGE,
            &["map has a map, so --map is one too many"],
        ),
        (
            "convert a.scen x.yaml --map a.map --scen a.scen",
            USAGE,
            &["--scen is one too many"],
        ),
        (
            "convert paths.txt x.json --map a.map --agents 2",
            USAGE,
            &["no starts and goals to count"],
        ),
        (
            "convert a.scen x.yaml --map a.map --agents 3",
            INPUT,
            &["3 agents asked for, but the scenario has 2"],
        ),
        (
            "convert a.scen - --to lorr --map a.map",
            USAGE,
            &["several files"],
        ),
        (
            "convert plan.json gone/x.txt --to lacam",
            INPUT,
            &[
                "gone/x.txt: cannot write",
                "hint: the folder does not exist",
            ],
        ),
        (
            "validate --map a.map --scen a.scen --agents 2 a.scen",
            INPUT,
            &["a.scen: this is no plan but scen"],
        ),
        (
            "simulate --map a.map what.txt",
            INPUT,
            &["what.txt: this is in no format that is known"],
        ),
    ];
    each(rows, |(line, code, texts)| {
        let ended = yard.line(line).expect(code);
        for text in texts {
            assert!(ended.stderr.contains(text), "{line}: no `{text}`: {ended}");
        }
        assert_eq!(yard.files(), before, "{line}");
    });
}

/// Four files are written, of which the second cannot be.
#[test]
fn several_files_are_written_or_none() {
    let yard = yard();
    fs::create_dir(yard.path("league.map")).unwrap();
    let before = yard.files();
    let line = "convert a.scen league.json --map a.map";
    let ended = yard.line(line);
    assert_eq!(ended.code, Some(INPUT), "{ended}");
    assert!(ended.stderr.contains("league.map"), "{ended}");
    assert_eq!(yard.files(), before, "{ended}");
}

#[test]
fn swapped_rows_and_columns_are_noticed() {
    let yard = yard();
    // (x,y) where (row,column) is expected; 2,1 is not on the map that way.
    let swapped = "Agent 0: (0,0)->(1,0)->(2,0)->(2,1)->\nAgent 1: (0,1)->(0,0)->(1,0)->(2,0)->\n";
    yard.write("swapped.txt", swapped);
    let line = "validate --map a.map --scen a.scen --agents 2 swapped.txt";
    let ended = yard.line(line).expect(INVALID_PLAN);
    assert!(
        ended.stderr.contains("hint: rows and columns look swapped"),
        "{ended}"
    );
    let line = "convert swapped.txt x.json --map a.map --scen a.scen";
    let ended = yard.line(line).expect(SUCCESS);
    assert!(
        ended.stderr.contains("rows and columns look swapped"),
        "{ended}"
    );
    // Wrong in another way is not swapped.
    yard.write("late.txt", "Agent 0: (0,1)\nAgent 1: (1,0)\n");
    let line = "validate --map a.map --scen a.scen --agents 2 late.txt";
    let ended = yard.line(line).expect(INVALID_PLAN);
    assert!(!ended.stderr.contains("swapped"), "{ended}");
}

#[test]
fn every_format_is_listed_and_described() {
    let list = Yard::new().line("convert --list").expect(SUCCESS);
    let guide = fs::read_to_string(root().join("docs/formats.md")).unwrap();
    let names = list.stdout.lines().skip(1);
    let names: Vec<&str> = names.filter_map(|line| line.split(' ').next()).collect();
    assert_eq!(names.len(), 25);
    for name in names {
        assert!(guide.contains(&format!("| `{name}`")), "{name}");
    }
}

#[test]
fn what_is_in_the_plane_goes_from_file_to_file() {
    let yard = Yard::new();
    let maps = root().join("maps");
    let from = |name: &str| maps.join(name).display().to_string();
    // A plan on a roadmap: alone, and with its roadmap beside it.
    let plan = from("two-rooms.roadmap-plan.json");
    yard.line(&format!("convert {plan} t.json --to trajectories"))
        .expect(SUCCESS);
    yard.line(&format!("convert {plan} copy.json"))
        .expect(SUCCESS);
    yard.line("convert copy.json again.json --to trajectories")
        .expect(SUCCESS);
    assert_eq!(yard.read("again.json"), yard.read("t.json"));
    let roadmap = fs::read(from("two-rooms.roadmap.json")).unwrap();
    assert_eq!(yard.read("copy.roadmap.json"), roadmap);
    // A roadmap to GraphML and back.
    let line = format!("convert {} r.xml", from("two-rooms.roadmap.json"));
    yard.line(&line).expect(SUCCESS);
    yard.line("convert r.xml r.json").expect(SUCCESS);
    assert_eq!(yard.read("r.json"), roadmap);
    // What db-CBS writes.
    yard.write(
        "r.yaml",
        "result:\n  - states:\n    - [0, 0, 3]\n    - [0.1, 0, -3]\n",
    );
    let ended = yard.line("convert r.yaml u.json").expect(SUCCESS);
    assert!(ended.stderr.contains("0.1 s apart"), "{ended}");
    let file: serde_json::Value = serde_json::from_slice(&yard.read("u.json")).unwrap();
    let heading = file["paths"][0][1][3].as_f64().unwrap();
    assert!((heading - (std::f64::consts::TAU - 3.0)).abs() < 1e-12);
}

#[test]
fn a_plan_on_a_grid_becomes_trajectories() {
    let yard = yard();
    yard.line("convert paths.txt t.json --to trajectories --map a.map --cell-size 2 --step 0.5")
        .expect(SUCCESS);
    let file: serde_json::Value = serde_json::from_slice(&yard.read("t.json")).unwrap();
    assert_eq!(
        file["paths"],
        serde_json::json!([
            [[0, 1, 3], [0.5, 3, 3], [1, 5, 3], [1.5, 5, 1]],
            [[0, 1, 1], [0.5, 1, 3], [1, 3, 3], [1.5, 5, 3]],
        ])
    );
    for (line, reason, hint) in [
        (
            "convert plan.json u.json --to trajectories",
            "trajectories: needs a map",
            "--map FILE",
        ),
        (
            "convert plan.json u.json --to trajectories --map a.map --step 0",
            "the time of a step is 0",
            "",
        ),
        (
            "convert t.json u.txt --to lacam",
            "lacam: needs a plan",
            "convert a file with paths",
        ),
        (
            "convert t.json u.yaml --to dynobench",
            "dynobench: files of this format are read and not written",
            "--to trajectories",
        ),
        (
            "validate --map a.map --scen a.scen --agents 2 t.json",
            "t.json: this is a plan in the plane, and nothing says what the robots are",
            "--radius METRES or --fleet FILE",
        ),
    ] {
        let ended = yard.line(line).expect(INPUT);
        assert!(ended.stderr.contains(reason), "{ended}");
        assert!(ended.stderr.contains(hint), "{ended}");
        assert!(!yard.path("u.json").exists() && !yard.path("u.yaml").exists());
    }
    let ended = yard.line("convert t.json u.txt").expect(USAGE);
    assert!(ended.stderr.contains("one of trajectories\n"), "{ended}");
}

#[test]
fn plans_are_judged_in_the_plane() {
    let yard = yard();
    let maps = root().join("maps");
    let from = |name: &str| maps.join(name).display().to_string();
    let world = from("two-rooms.world.json");
    let robots = r#"{"format": "fleetyard.fleet/1", "profiles": {"a":
        {"footprint": {"rectangle": {"length_m": 0.8, "width_m": 0.4}}, "model": "single-integrator"}},
        "agents": {"all": "a"}}"#;
    yard.write("fleet.json", robots);
    yard.write("dogs.json", robots.replace("single-integrator", "go2"));
    yard.write(
        "slow.json",
        robots.replace(
            "\"single-integrator\"",
            r#"{"unicycle-1": {"max_speed_m_per_s": 0.5, "max_turn_rate_rad_per_s": 1}}"#,
        ),
    );
    let discs = from("two-rooms.roadmap-plan.json");
    let turning = from("turning.trajectories.json");
    yard.line("convert paths.txt t.json --to trajectories --map a.map")
        .expect(SUCCESS);
    for valid in [
        format!("validate {discs} --world {world} --radius 0.3"),
        format!("validate {turning} --world {world} --fleet fleet.json"),
        "validate paths.txt --map a.map --radius 0.35".to_owned(),
        "validate t.json --map a.map --scen a.scen --radius 0.35".to_owned(),
    ] {
        let ended = yard.line(&valid).expect(SUCCESS);
        assert!(ended.stdout.starts_with("valid\n"), "{ended}");
    }
    let line = format!("validate {discs} --world {world} --radius 0.3 --format json");
    let report = yard.line(&line).expect(SUCCESS).json();
    assert_eq!(report["metrics"]["makespan_s"], 16.0);
    assert_eq!(report["metrics"]["sum_of_costs_s"], 29.0);
    for (line, rule) in [
        // Where two move at right angles their discs meet, which grids do not mind.
        (
            "validate paths.txt --map a.map --radius 0.4",
            "agent-contact: agents 0 and 1",
        ),
        (
            "validate t.json --map a.map --scen a.scen --radius 0.35 --cell-size 2",
            "wrong-start: agent 0",
        ),
        (
            &format!("validate {discs} --world {world} --radius 0.7"),
            "obstacle-contact: agent 0",
        ),
        (
            &format!("validate {turning} --world {world} --fleet slow.json"),
            "too-fast: agent 0",
        ),
        // Straight legs at one speed begin and end at once.
        (
            &format!("validate {turning} --world {world} --fleet dogs.json"),
            "too-sudden: agent 0",
        ),
    ] {
        let ended = yard.line(line).expect(INVALID_PLAN);
        assert!(ended.stdout.starts_with("INVALID: "), "{ended}");
        assert!(ended.stdout.contains(rule), "{ended}");
    }
    for (line, reason) in [
        (
            format!("validate {discs} --world {world} --fleet fleet.json"),
            "the plan has no headings, but agent 0 is no disc",
        ),
        (
            format!("validate {discs} --world {world} --radius 0"),
            "--radius: radius_m is 0",
        ),
        (
            format!("validate plan.json --world {world} --radius 0.3"),
            "plan.json: this is a plan on a grid",
        ),
        (
            format!("validate {discs} --world a.map --radius 0.3"),
            "a.map:1:1: this is not a JSON object",
        ),
        (
            "validate t.json --map a.map --radius 0.3 --cell-size 1e300".to_owned(),
            "--cell-size: cells of",
        ),
    ] {
        let ended = yard.line(&line).expect(INPUT);
        assert!(ended.stderr.contains(reason), "{ended}");
        assert!(ended.stderr.contains("hint: "), "{ended}");
    }
    // What is meant by who has a plan in the plane, and never a map that it does not need.
    for (line, text) in [
        (
            "validate t.json",
            "and what stands in their way with --world FILE",
        ),
        (
            "validate t.json --map a.map",
            "--radius METRES or --fleet FILE",
        ),
        (
            "validate t.json --radius 0.3",
            "hint: name the world with --world FILE",
        ),
    ] {
        let ended = yard.line(line).expect(INPUT);
        assert!(ended.stderr.contains(text), "{ended}");
    }
    for line in [
        "validate t.json --world w --scen s",
        "validate plan.json",
        "validate plan.json --map a.map --scen a.scen",
    ] {
        yard.line(line).expect(USAGE);
    }
}

/// Thousands of searches take a while, and nobody but readers of scenarios' last column needs them.
#[test]
fn lengths_are_searched_for_on_request() {
    let yard = yard();
    let lengths = |scen: &str| -> Vec<String> {
        let text = String::from_utf8(yard.read(scen)).unwrap();
        let last = |line: &str| line.rsplit('\t').next().unwrap().to_owned();
        text.lines().skip(1).map(last).collect()
    };
    yard.line("convert a.scen a.yaml --to libmrp --map a.map")
        .expect(SUCCESS);
    yard.line("convert a.yaml plain.scen").expect(SUCCESS);
    assert_eq!(lengths("plain.scen"), ["0.00000000", "0.00000000"]);
    yard.line("convert a.yaml long.scen --lengths")
        .expect(SUCCESS);
    assert_eq!(lengths("long.scen"), ["3.00000000", "3.00000000"]);
    // Those of a scenario stay.
    yard.line("convert long.scen again.scen --map long.map")
        .expect(SUCCESS);
    assert_eq!(lengths("again.scen"), lengths("long.scen"));
}

#[test]
fn paths_alone_are_a_plan_where_the_map_is_named() {
    let yard = yard();
    yard.write(
        "alone.json",
        r#"{"paths": [[[0,0],[0,1],[0,2],[1,2]],[[1,0],[0,0],[0,1],[0,2]]]}"#,
    );
    assert_eq!(digests(&yard, "alone.json"), digests(&yard, "plan.json"));
    yard.line("simulate --map a.map alone.json").expect(SUCCESS);
    let ended = yard
        .line("convert alone.json x.txt --to lacam")
        .expect(INPUT);
    assert!(
        ended
            .stderr
            .contains("how large its map is\nhint: name the map with --map FILE"),
        "{ended}"
    );
}

/// Cells of another side than those that the map was made of.
#[test]
fn a_hall_does_not_grow_in_silence() {
    let yard = yard();
    let task = root().join("maps/two-rooms.task.json");
    yard.line(&format!("world grid {} --name hall", task.display()))
        .expect(SUCCESS);
    let fleet = "fleet --map hall.map --agents 2 --planner pibt --duration 5s --cell-size";
    let ended = yard.line(&format!("{fleet} 1.4")).expect(SUCCESS);
    for text in [
        "hall.map: with cells of 1.40 m this is a map of 28.0 by 16.8 m; it was made of cells of \
         0.50 m, and 10.0 by 6.00 m",
        "hall.grid.json says so; --cell-size 0.5 keeps the world's size",
    ] {
        assert!(ended.stderr.contains(text), "no `{text}`: {ended}");
    }
    let ended = yard.line(&format!("{fleet} 0.5")).expect(SUCCESS);
    assert!(!ended.stderr.contains("warning"), "{ended}");
}

#[test]
fn a_league_instance_becomes_a_scenario() {
    let Some(folder) = std::env::var_os("FLEETYARD_DATA") else {
        eprintln!("skipped: FLEETYARD_DATA is not set");
        return;
    };
    let league = Path::new(&folder).join("lorr/random.domain/random-example_400.json");
    if !league.is_file() {
        eprintln!("skipped: {} is not there", league.display());
        return;
    }
    let yard = Yard::new();
    let ended = yard
        .line(&format!("convert {} r.scen --agents 10", league.display()))
        .expect(SUCCESS);
    assert!(
        ended
            .stderr
            .contains("note: of 3200 tasks with 9577 errands"),
        "{ended}"
    );
    yard.line("run --map r.map --scen r.scen --agents 10 --planner pibt --budget 60s")
        .expect(SUCCESS);
}

/// Asks PlanViz's own loader, without its window, where everybody is at every time.
#[test]
fn planviz_shows_the_plan() {
    const PROGRAM: &str = r#"
import json, math, sys
from unittest import mock
sys.path.insert(0, sys.argv[1] + "/script")
import plan_config
plan_config.tk = mock.MagicMock()
screen = plan_config.tk.Tk.return_value
screen.winfo_screenwidth.return_value = 1920
screen.winfo_screenheight.return_value = 1080
loader = plan_config.PlanConfig2024
loader.render_env = loader.render_agents = lambda self: None
version = json.load(open(sys.argv[3]))["version"]
plan = loader(sys.argv[2], sys.argv[3], math.inf, 0, math.inf, 50000, None, None, None, version)
paths = [[[int(r), int(c)] for r, c, _ in plan.exec_paths[a]] for a in range(plan.team_size)]
goals = [plan.seq_tasks[a].tasks[0].loc for a in range(plan.team_size)]
finished = sum(len(agents) for agents in plan.events["finished"].values())
print(json.dumps({"paths": paths, "goals": goals, "finished": finished}))
"#;
    let Some(folder) = std::env::var_os("FLEETYARD_PLANVIZ") else {
        eprintln!("skipped: FLEETYARD_PLANVIZ names no checkout of PlanViz");
        return;
    };
    let python = std::env::var_os("FLEETYARD_PLANVIZ_PYTHON").unwrap_or("python3".into());
    let yard = yard();
    yard.line("convert plan.json shown.json --to planviz --map a.map --scen a.scen")
        .expect(SUCCESS);
    let output = Command::new(python)
        .args(["-c", PROGRAM])
        .args([
            Path::new(&folder),
            &yard.path("a.map"),
            &yard.path("shown.json"),
        ])
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&output.stdout);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{text}{errors}");
    // It prints what it does before.
    let found = text.lines().last().unwrap_or_default();
    let found = &found[found.find("{\"paths\"").unwrap_or(0)..];
    let found: serde_json::Value = serde_json::from_str(found).expect(found);
    assert_eq!(
        found,
        serde_json::json!({
            "paths": [
                [[0, 0], [0, 1], [0, 2], [1, 2]],
                [[1, 0], [0, 0], [0, 1], [0, 2]],
            ],
            "goals": [[1, 2], [0, 2]],
            "finished": 2,
        })
    );
}

const HALL: &str = r#"{
    "name": "hall",
    "weight": false,
    "n_row": 2,
    "n_col": 4,
    "n_endpoint": 1,
    "n_agent_loc": 0,
    "maxtime": 2000,
    "layout": [
        "w.e.",
        "..@T"
    ]
}
"#;

#[test]
fn maps_with_roles_go_from_json_to_text_and_back() {
    let yard = yard();
    yard.write("hall.json", HALL);
    yard.line("convert hall.json hall.map").expect(SUCCESS);
    let text = yard.read("hall.map");
    assert_eq!(text, b"type octile\nheight 2\nwidth 4\nmap\nw.e.\n..@T\n");
    yard.line("convert hall.map again.json").expect(SUCCESS);
    let again = String::from_utf8(yard.read("again.json")).unwrap();
    assert_eq!(again.replace("again", "hall"), HALL);
    // Every command that takes a map takes either.
    let info = |map: &str| {
        yard.line(&format!("maps info {map} --format json"))
            .expect(SUCCESS)
    };
    assert_eq!(info("hall.json").json(), info("hall.map").json());
    assert_eq!(info("hall.json").json()["terrain"]["w"], 1);
    yard.write("hall.scen", "version 1\n0\thall.map\t4\t2\t0\t0\t3\t0\t3\n");
    for map in ["hall.json", "hall.map"] {
        let line = format!("run --map {map} --scen hall.scen --agents 1 --planner pibt");
        yard.line(&line).expect(SUCCESS);
    }
    yard.write(
        "weighty.json",
        HALL.replace(
            "\"weight\"",
            &format!("\"weights_matrix\": {:?}, \"weight\"", [1; 40]),
        ),
    );
    let ended = yard.line("convert weighty.json w.map").expect(SUCCESS);
    assert!(ended.stderr.contains("weights_matrix"), "{}", ended.stderr);
    yard.write("bad.json", HALL.replace("w.e.", "w.q."));
    let ended = yard.line("maps info bad.json").expect(INPUT);
    assert!(
        ended
            .stderr
            .contains("bad.json:10:12: unknown terrain letter 'q'"),
        "{}",
        ended.stderr
    );
    assert!(ended.stderr.contains("hint:"), "{}", ended.stderr);
}

#[test]
fn warehouses_are_made_under_the_name_that_is_asked_for() {
    let yard = yard();
    let line = "maps generate warehouse --blocks-across 3 --blocks-down 8 --block-cols 10 --block-rows 1 \
                --aisle 1 --margin 2 --aisle-rows 3 --edge-rows 2 --open --endpoints --workstations 3 \
                --name warehouse-33-36";
    yard.line(line).expect(SUCCESS);
    let info = yard
        .line("maps info warehouse-33-36.map --format json")
        .expect(SUCCESS)
        .json();
    assert_eq!(info["name"], "warehouse-33-36");
    assert_eq!((&info["rows"], &info["cols"]), (&33.into(), &36.into()));
    assert_eq!(
        (&info["terrain"]["e"], &info["terrain"]["w"]),
        (&480.into(), &22.into())
    );
    let ended = yard
        .line(&line.replace("--name warehouse-33-36", "--name a/b"))
        .expect(USAGE);
    assert!(ended.stderr.contains("--name"), "{}", ended.stderr);
    let ended = yard
        .line(&line.replace("--edge-rows 2", "--edge-rows 0"))
        .expect(USAGE);
    assert!(ended.stderr.contains("--edge-rows"), "{}", ended.stderr);
}

/// A double integrator has 0.5 m/s and 2 m/s² along each axis.
#[test]
fn a_plan_beyond_the_dynamics_of_its_robots_is_refused() {
    let yard = yard();
    yard.write(
        "points.json",
        r#"{"format": "fleetyard.fleet/1", "profiles": {"a":
            {"footprint": {"disc": {"radius_m": 0.1}}, "model": "double-integrator"}},
            "agents": {"all": "a"}}"#,
    );
    yard.write(
        "world.json",
        r#"{"format": "fleetyard.world/1", "bounds_m": [-5, -5, 5, 5]}"#,
    );
    // Speeds along x and y in steps of a tenth of a second, as db-CBS writes states.
    let write = |name: &str, speeds: &[[f64; 2]]| {
        let mut knots = vec!["[0, 0, 0]".to_owned()];
        let (mut x, mut y) = (0.0, 0.0);
        for (step, [vx, vy]) in speeds.iter().enumerate() {
            (x, y) = (x + 0.1 * vx, y + 0.1 * vy);
            knots.push(format!("[{}, {x:.6}, {y:.6}]", (step + 1) as f64 / 10.0));
        }
        let knots = knots.join(", ");
        let text = format!("{{\"format\": \"fleetyard.trajectories/1\", \"paths\": [[{knots}]]}}");
        yard.write(name, text);
        yard.line(&format!(
            "validate {name} --world world.json --fleet points.json --format json"
        ))
    };
    let ramp = |most: f64| [0.2, 0.4, most, most, 0.4, 0.2].map(|v| [v, v]);
    write("good.json", &ramp(0.5)).expect(SUCCESS);
    let first =
        |ended: Ended| ended.expect(INVALID_PLAN).json()["verdict"]["violations"][0].clone();
    let fast = first(write("fast.json", &ramp(0.6)));
    assert_eq!(
        (&fast["rule"], &fast["limit"]),
        (&"too-fast".into(), &0.5.into())
    );
    assert!(
        (fast["value"].as_f64().unwrap() - 0.6).abs() < 1e-5,
        "{fast}"
    );
    let mut reversal = ramp(0.5);
    for speed in &mut reversal[3..] {
        *speed = speed.map(|v| -v);
    }
    let sudden = first(write("sudden.json", &reversal));
    assert_eq!(
        (&sudden["rule"], &sudden["limit"]),
        (&"too-sudden".into(), &2.0.into())
    );
    assert!(
        (sudden["value"].as_f64().unwrap() - 10.0).abs() < 1e-3,
        "{sudden}"
    );
    assert_eq!(sudden["time_s"], 0.3);
    assert_eq!(sudden["place_m"], serde_json::json!([0.11, 0.11]));
}
