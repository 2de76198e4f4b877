//! Mazes and path rules on the command line, and episodes of the grid-maze benchmark:
//! its mazes, planned for by three planners and driven by its waypoint law, must come
//! out as they always did: to the bit in traces, and to the pixel in pictures.
//!
//! When episodes change on purpose, run with `FLEETYARD_UPDATE_EXPECTED=1`, look at the
//! pictures in `expected/episodes/`, and commit them.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::{env, fs};

use fleetyard_testkit::{INVALID_PLAN, SUCCESS, USAGE, Yard, have, root};
use fleetyard_view::difference;
use serde_json::Value;

/// The benchmark's runs: base seed 42, mazes of 11 × 11 cells. Seeds are s₀ + 2e − 1.
const EPISODES: [(u32, u64); 3] = [(1, 43), (2, 45), (3, 47)];

/// Trace digests by episode, in the kinematic tier and in the contact tier. A perfect
/// maze has one simple way, so that they do not depend on the planner.
const DIGESTS: [[&str; 2]; 3] = [
    [
        "13951181b98ace23184618dcaa6fe47f",
        "29886887ddc5d0fc900d2f7887d843d3",
    ],
    [
        "a8201d19b9dae554f92d025836e83693",
        "48a2f4e88395872a3d254042c1a423f9",
    ],
    [
        "e0188ea32bec45545ce747223060f95d",
        "b9994f54a04bd4ee73e9723ad816e17f",
    ],
];

fn expected(name: &str) -> PathBuf {
    root().join("tests/expected/episodes").join(name)
}

/// Compares a picture with the one that is expected, and leaves what is found, and
/// where it differs, beside it.
fn compare(name: &str, found: &[u8]) -> Result<(), String> {
    let path = expected(&format!("{name}.png"));
    if env::var_os("FLEETYARD_UPDATE_EXPECTED").is_some() {
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(&path, found).unwrap();
    }
    let (actual, marked) = (
        expected(&format!("{name}.actual.png")),
        expected(&format!("{name}.difference.png")),
    );
    let wanted = fs::read(&path).map_err(|error| format!("{}: {error}", path.display()))?;
    let reason = match difference(&wanted, found) {
        Ok(difference) if difference.pixels == 0 => {
            let _ = (fs::remove_file(actual), fs::remove_file(marked));
            return Ok(());
        }
        Ok(difference) => {
            fs::write(&marked, &difference.png).unwrap();
            format!(
                "{} of {} pixels differ, see {}",
                difference.pixels,
                difference.of,
                marked.display()
            )
        }
        Err(error) => error.reason,
    };
    fs::write(&actual, found).unwrap();
    Err(format!("{name}: {reason} and {}", actual.display()))
}

/// All episodes of a planner; what is wrong with them.
fn run(planner: &str) -> Vec<String> {
    let yard = Yard::new();
    let mut wrong = Vec::new();
    for ((episode, seed), digests) in EPISODES.into_iter().zip(DIGESTS) {
        let name = format!("maze-23-23-1-backtracker-{seed}");
        let maze = "maps generate maze --width 11 --height 11 --random python --scenario";
        yard.line(&format!("{maze} --seed {seed}")).expect(SUCCESS);
        let plan = yard.line(&format!(
            "run --map {name}.map --scen {name}.scen --agents 1 --planner {planner} --budget 30s \
             --path-rule bresenham --plan-out plan.json --format json"
        ));
        let plan = plan.expect(SUCCESS).json();
        assert_eq!(plan["verdict"]["valid"], Value::Bool(true), "{plan}");
        for (tier, digest) in ["kinematic", "contact"].into_iter().zip(digests) {
            let driven = yard.line(&format!(
                "simulate --map {name}.map plan.json --path-rule bresenham --model waypoint-law \
                 --policy adg --tier {tier} --trace {tier}.fyt --format json"
            ));
            let driven = driven.expect(SUCCESS).json();
            let found = driven["trace_digest"].as_str().unwrap();
            if (&driven["arrived"], &driven["contacts"]) != (&1.into(), &0.into()) {
                wrong.push(format!("{planner}, episode {episode}, {tier}: {driven}"));
            }
            if found != digest {
                wrong.push(format!(
                    "{planner}, episode {episode}, {tier}: the digest is {found}"
                ));
            }
            yard.line(&format!(
                "trace export {tier}.fyt --png {tier}.png --width 352"
            ))
            .expect(SUCCESS);
            let picture = yard.read(&format!("{tier}.png"));
            wrong.extend(compare(&format!("episode-{episode}-{tier}"), &picture).err());
        }
    }
    wrong
}

#[track_caller]
fn come_out(planner: &str) {
    let wrong = run(planner);
    assert!(wrong.is_empty(), "other than before:\n{}", wrong.join("\n"));
}

#[test]
fn episodes_of_astar() {
    come_out("astar");
}

#[test]
fn episodes_of_weighted_astar() {
    come_out("weighted-astar");
}

#[test]
fn episodes_of_fringe_search() {
    come_out("fringe-search");
}

#[test]
fn mazes_are_made_with_their_task() {
    let yard = Yard::new();
    let made = yard.line(
        "maps generate maze --width 15 --height 15 --random python --algorithm prim --seed 7 \
         --scenario --scenario-agents 3",
    );
    let name = "maze-31-31-1-prim-7";
    assert_eq!(
        made.expect(SUCCESS).stdout,
        format!("./{name}.map\n./{name}.scen\n./{name}-random-1.scen\n")
    );
    let scenario = String::from_utf8(yard.read(&format!("{name}.scen"))).unwrap();
    // Start and goal as x and y, in the lattice.
    let fields: Vec<&str> = scenario.lines().nth(1).unwrap().split('\t').collect();
    assert_eq!(
        fields[1..8],
        [&*format!("{name}.map"), "31", "31", "1", "1", "15", "15"]
    );
    let closed = yard.line("maps generate maze --width 4 --height 3 --corridor 2");
    assert_eq!(closed.expect(SUCCESS).stdout, "./maze-10-13-2.map\n");
    for (line, part) in [
        ("", "--cols <N>"),
        ("--rows 5", "--cols <N>"),
        ("--width 5", "--height <N>"),
        (
            "--width 5 --height 5 --rows 11 --cols 11",
            "cannot be used with",
        ),
        ("--width 0 --height 5", "'0'"),
        ("--width 5 --height 5 --random perl", "python"),
        ("--width 400000 --height 400000", "too large"),
    ] {
        let ended = yard
            .line(&format!("maps generate maze {line}"))
            .expect(USAGE);
        assert!(ended.stderr.contains(part), "{line}: {ended}");
    }
}

#[test]
fn plans_are_judged_and_driven_by_path_rules() {
    let yard = Yard::new();
    yard.write(
        "a.map",
        "type octile\nheight 3\nwidth 4\nmap\n....\n.@..\n....\n",
    );
    yard.write(
        "a.scen",
        "version 1\n0\ta.map\t4\t3\t0\t1\t3\t2\t0\n0\ta.map\t4\t3\t0\t0\t3\t0\t0\n",
    );
    let plan = |name: &str, paths: &str| {
        let head = r#"{"format": "fleetyard.plan/1", "rows": 3, "cols": 4, "paths":"#;
        yard.write(name, format!("{head} {paths}}}"));
    };
    plan("one.json", "[[[1, 0], [2, 1], [2, 3]]]");
    plan("two.json", "[[[1, 0]], [[0, 0]]]");
    let judge =
        |arguments: &str| yard.line(&format!("validate --map a.map --scen a.scen {arguments}"));
    let steps = judge("--agents 1 one.json").expect(INVALID_PLAN);
    assert!(steps.stdout.contains("not-adjacent"), "{steps}");
    let lines = judge("--agents 1 --path-rule bresenham one.json").expect(SUCCESS);
    assert_eq!(
        lines.stdout,
        "valid\npath length  3 cells\nin metres    3.41 m\n"
    );
    let strict = judge("--agents 1 --path-rule supercover one.json").expect(INVALID_PLAN);
    assert!(
        strict.stdout.contains(
            "corner-cut: agent 0 touches the corner of an obstacle at (1, 1) on its way from (1, 0) to (2, 1)"
        ),
        "{strict}"
    );
    let disc = yard
        .line("validate --map a.map --radius 0.2 --path-rule bresenham one.json")
        .expect(INVALID_PLAN);
    assert!(disc.stdout.contains("obstacle"), "{disc}");
    for line in [
        "validate --map a.map --scen a.scen --agents 2 --path-rule supercover two.json",
        "validate --map a.map --radius 0.2 --path-rule supercover two.json",
        "simulate --map a.map --path-rule supercover two.json",
    ] {
        let refused = yard.line(line).expect(USAGE);
        assert!(
            refused
                .stderr
                .contains("--path-rule supercover is for one agent, not for 2"),
            "{line}: {refused}"
        );
        assert!(refused.stderr.contains("hint: "), "{line}: {refused}");
    }
    let driven =
        yard.line("simulate --map a.map --path-rule bresenham --radius 0.2 one.json --format json");
    let driven = driven.expect(SUCCESS).json();
    let makespan = driven["makespan_s"].as_f64().unwrap();
    assert!((makespan - (2f64.sqrt() + 2.0)).abs() < 1e-9, "{driven}");
    assert_eq!(driven["contacts_agent_obstacle"], 1, "{driven}");
}

/// Rows of a table that a script of the benchmark wrote, by column.
fn rows(script: &str, arguments: &str) -> Vec<BTreeMap<String, String>> {
    let yard = Yard::new();
    let script = root().join("scripts").join(script);
    yard.shell(&format!(
        "FLEETYARD=fleetyard python3 '{}' {arguments} --out out --rows rows.csv",
        script.display()
    ))
    .expect(SUCCESS);
    let text = String::from_utf8(yard.read("rows.csv")).unwrap();
    let mut lines = text.lines().map(|line| line.split(',').map(str::to_owned));
    let heads: Vec<String> = lines.next().unwrap().collect();
    lines
        .map(|line| heads.iter().cloned().zip(line).collect())
        .collect()
}

#[test]
fn plans_are_driven_by_a_robot_with_a_body() {
    if !have("python3") {
        return;
    }
    let planners = "--planner astar --planner theta-star --planner tangent --planner hybrid-astar";
    let rows = rows("maze_drive.py", &format!("--sizes 3 --seeds 2 {planners}"));
    let number = |row: &BTreeMap<String, String>, name: &str| row[name].parse::<f64>().unwrap();
    // hybrid-astar is asked for robots of first and of second order.
    assert_eq!(rows.len(), 2 * 5);
    for row in &rows {
        let planner = row["planner"].as_str();
        assert_eq!(
            [&row["solved"], &row["law_arrived"], &row["program_arrived"]],
            ["1"; 3],
            "{row:?}"
        );
        assert_eq!(row["controls"] == "1", planner == "hybrid-astar", "{row:?}");
        assert!(number(row, "law_off_max_m") < 0.06, "{row:?}");
        // On the middle of lanes of a metre, and on the ways of its disc, a body of 0.6 by 0.4 m has room to turn; lines past
        // corners have none. The law turns where a plan of controls may not.
        if planner != "hybrid-astar" {
            let is_clear = row["law_contacts"] == "0";
            assert_eq!(is_clear, planner != "theta-star", "{row:?}");
        }
        assert_eq!(
            number(row, "plan_margin_m") > 0.0,
            planner != "theta-star",
            "{row:?}"
        );
    }
    let length = |planner: &str| {
        let of = rows.iter().filter(|row| row["planner"] == planner);
        of.map(|row| number(row, "length_m")).sum::<f64>()
    };
    assert!(length("tangent") < length("astar"));
}

#[test]
fn cells_that_close_delay_a_robot_that_does_not_know_of_them() {
    if !have("python3") {
        return;
    }
    let planners = "--planner astar --planner 'd-star-lite keep_tree=true'";
    let rows = rows(
        "maze_closures.py",
        &format!("--sizes 9 --seeds 1 {planners}"),
    );
    let of = |column: &str| {
        let column = rows.iter().map(|row| row[column].parse::<f64>().unwrap());
        column.collect::<Vec<_>>()
    };
    assert_eq!(rows.len(), 2);
    assert!(of("goals").iter().all(|goals| *goals > 10.0));
    assert!(of("replans").iter().all(|replans| *replans > 20.0));
    let [anew, kept] = of("expansions_replan")[..] else {
        panic!("{rows:?}");
    };
    assert!(
        kept < anew / 2.0,
        "{kept} expansions with the tree, {anew} without"
    );
    // Who knows everything in advance is never later.
    for (took, informed) in of("goal_s").iter().zip(of("informed_s")) {
        assert!(*took >= informed && *took < informed * 1.5, "{rows:?}");
    }
}
