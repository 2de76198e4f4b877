//! Adapters of programs on roadmaps and in the plane, end to end: the manifests of `plugins/adapters`
//! with programs in Python that read and write the same files and do as the real ones do, good and bad.
//! The real program is asked, too, where a variable names it.

use fleetyard_testkit::{Ended, INVALID_PLAN, NO_PLAN, PLUGIN, SUCCESS, Yard, have, root, words};
use serde_json::Value;

/// The adapters by their folders, and the variables that name their programs.
pub(crate) const ADAPTERS: [(&str, &str); 3] =
    [("ccbs", "CCBS"), ("db-cbs", "DB_CBS"), ("psipp", "PSIPP")];

/// A hall with a box, and a roadmap: a lane along the bottom from 0 to 3, and a bay above its middle.
fn hall() -> Yard {
    let yard = Yard::new();
    yard.write(
        "hall.world.json",
        r#"{"format": "fleetyard.world/1", "bounds_m": [0, 0, 8, 6],
            "obstacles": [{"rectangle": {"center": [1.5, 4.5], "size": [1, 2]}}]}"#,
    );
    yard.write(
        "hall.roadmap.json",
        r#"{"format": "fleetyard.roadmap/1", "directed": false,
            "vertices": [[1, 1], [3, 1], [5, 1], [7, 1], [4, 3]],
            "edges": [[0, 1], [1, 2], [2, 3], [1, 4], [2, 4]]}"#,
    );
    yard
}

/// A task of discs of 0.5 m that do 2 m/s.
fn discs(yard: &Yard, agents: &str) {
    let task = format!(
        r#"{{"format": "fleetyard.task/1", "world": "hall.world.json",
            "robots": {{"disc": {{"footprint": {{"disc": {{"radius_m": 0.5}}}},
                                  "model": {{"single-integrator": {{"speed_m_per_s": 2}}}}}}}},
            "agents": [{agents}]}}"#
    );
    yard.write("hall.task.json", task);
}

/// Two robots that change places, and one that stays in its place.
const SWAP: &str = r#"{"start": [1, 1], "goal": [7, 1]}, {"start": [7, 1], "goal": [1, 1]}"#;

fn program(yard: &Yard, name: &str, text: &str) -> String {
    use std::os::unix::fs::PermissionsExt;
    let path = yard.write(name, text);
    std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755)).unwrap();
    path.display().to_string()
}

fn run(yard: &Yard, adapter: &str, more: &str) -> Ended {
    let mut line = words("run --task hall.task.json --budget 20s --format json --planner");
    let folder = root().join("plugins/adapters").join(adapter);
    line.push(folder.display().to_string());
    line.extend(words(more));
    yard.run(&line)
}

const ON_ROADMAP: &str = "--roadmap hall.roadmap.json --plan-out visits.json";

/// Stands in for Continuous-CBS. Vertices 1, 2 and 4 are a triangle round which everybody passes: the
/// first agent by the bay, the others by the lane.
const CCBS: &str = r#"#!/usr/bin/env python3
import math, os, sys
import xml.etree.ElementTree as xml
style = os.path.basename(sys.argv[0])
graph = xml.parse(sys.argv[1]).getroot()
tag = lambda name: "{http://graphml.graphdrawing.org/xmlns}" + name
nodes, ends = [], set()
for node in graph.iter(tag("node")):
    assert node.get("id") == f"n{len(nodes)}"
    nodes.append(tuple(map(float, node[0].text.split(","))))
for edge in graph.iter(tag("edge")):
    ends.add((int(edge.get("source")[1:]), int(edge.get("target")[1:])))
tree = xml.parse(sys.argv[2])
tasks = [(int(one.get("start_id")), int(one.get("goal_id"))) for one in tree.getroot()]
settings = {one.tag: one.text for one in xml.parse(sys.argv[3]).getroot()[0]}
assert settings["use_disjoint_splitting"] == "true" and settings["hlh_type"] == "2"
assert 0 < float(settings["timelimit"]) < 20 and float(settings["precision"]) == 1e-7
# A metre is so long that 0.5 m are the radius that is compiled in.
unit = math.sqrt(2) / 4 / 0.5
assert abs(nodes[1][0] - 3 * unit) < 1e-12 and len(nodes) == 5 and len(ends) == 10
ways = {(0, 3): [0, 1, 4, 2, 3], (3, 0): [3, 2, 1, 0]}
if style == "timeout":
    ways[0, 3] = [0, 1, 2, 3]
log = xml.SubElement(tree.getroot(), "log")
xml.SubElement(log, "summary", time="0.1", flowtime="1", makespan="1")
for number, (start, goal) in enumerate(tasks):
    if style == "unreachable":
        break
    agent = xml.SubElement(log, "agent", number=str(number))
    path = xml.SubElement(agent, "path", duration="1")
    way = ways.get((start, goal), [start])
    legs = list(zip(way, way[1:]))
    if style == "jump":
        legs = [(way[0], way[-1])]
    for a, b in legs:
        assert (a, b) in ends or style == "jump"
        (x, y), (u, v) = nodes[a], nodes[b]
        section = dict(start_i=x, start_j=y, goal_i=u, goal_j=v, duration=math.hypot(u - x, v - y))
        xml.SubElement(path, "section", {k: f"{value:.17g}" for k, value in section.items()}, number="0")
    if style == "fewer":
        break
found = "false" if style == "timeout" else "true"
print(f"Soulution found: {found}\nRuntime: 0.125\nMakespan: 1\nFlowtime: 1\nInitial Cost: 1")
print("Collision Checking Time: 0.0625\nHL expanded: 7\nLL searches: 3\nLL expanded(avg): 1")
out = sys.argv[2][:-4] + "_log.xml"
if style == "cut":
    whole = xml.tostring(tree.getroot())
    open(out, "wb").write(whole[: len(whole) * 2 // 3])
else:
    tree.write(out)
"#;

fn ccbs(style: &str, agents: &str) -> (Yard, Ended) {
    let yard = hall();
    discs(&yard, agents);
    let named = program(&yard, style, CCBS);
    let yard = yard.set("CCBS", &named);
    let ended = run(&yard, "ccbs", ON_ROADMAP);
    (yard, ended)
}

#[test]
fn ccbs_is_told_and_read_in_its_own_unit() {
    if !have("python3") {
        return;
    }
    let (yard, ended) = ccbs("solves", SWAP);
    let record = ended.expect(SUCCESS).json();
    assert_eq!(record["verdict"]["valid"], true, "{record}");
    assert_eq!(record["judged"]["view"]["valid"], true, "{record}");
    // 2 + √5 + √5 + 2 m and 6 m at 2 m/s.
    let soc = record["metrics"]["soc_s"].as_f64().unwrap();
    assert!((soc - (5.0 + 5_f64.sqrt())).abs() < 1e-9, "{soc}");
    assert_eq!(record["claimed_metrics"]["runtime_s"], 0.125);
    assert_eq!(record["claimed_metrics"]["expanded"], 7.0);
    let note = record["notes"]["units"].as_str();
    let note = note.unwrap_or_else(|| panic!("{record}"));
    assert!(
        note.starts_with(
            "coordinates are multiplied by 0.7071067811865476, so that the radius of 0.5 m"
        ),
        "{note}"
    );
    // The plan that was written is valid on the same roadmap.
    yard.line("validate --task hall.task.json --roadmap hall.roadmap.json visits.json")
        .expect(SUCCESS);
    // An agent that is at its goal has no sections.
    let (_, ended) = ccbs("rests", r#"{"start": [4, 3], "goal": [4, 3]}"#);
    assert_eq!(ended.expect(SUCCESS).json()["metrics"]["soc_s"], 0.0);
}

#[test]
fn ccbs_is_not_believed() {
    if !have("python3") {
        return;
    }
    let claim = |record: &Value| record["claim"].as_str().unwrap_or_default().to_owned();
    // It ends well with paths that collide.
    let (_, ended) = ccbs("timeout", SWAP);
    let record = ended.expect(NO_PLAN).json();
    assert_eq!(claim(&record), "timed-out");
    assert_eq!(record["verdict"]["valid"], false);
    // It says that it found paths, and writes none.
    let (_, ended) = ccbs("unreachable", SWAP);
    let record = ended.expect(NO_PLAN).json();
    assert_eq!(claim(&record), "gave-up");
    let refused = [
        (
            "fewer",
            "there are paths for 1 of 2 agents; the program found no plan",
        ),
        ("jump", "agent 0 is at (4.9497"),
        ("cut", "task_log.xml:"),
    ];
    for (style, reason) in refused {
        let (_, ended) = ccbs(style, SWAP);
        let ended = ended.expect(PLUGIN);
        assert!(ended.stderr.contains(reason), "{style}: {ended}");
    }
}

/// Stands in for PSIPP/CTC: the second agent waits for the first.
const PSIPP: &str = r#"#!/usr/bin/env python3
import math, os, re, sys
config = open(sys.argv[1]).read()
assert "type: Explicit" in config and "type: PSIPP" in config
assert 0 < float(re.search(r"time_limit: (\S+)", config)[1]) < 20
text = open(re.search(r'file: "(.*)"', config)[1]).read().split()
numbers = iter(text)
count = [int(next(numbers)) for _ in range(3)]
nodes = [(float(next(numbers)), float(next(numbers))) for _ in range(count[0])]
ends = {(int(next(numbers)), int(next(numbers))) for _ in range(count[1])}
tasks = [(int(next(numbers)), int(next(numbers))) for _ in range(count[2])]
radius = float(next(numbers))
assert radius == 512 and nodes[1] == (3072, 1024) and count == [5, 10, 2] and not list(numbers)
solved = os.path.basename(sys.argv[0]) != "fails"
print("   problem   time(ms)\n   problem         25", file=sys.stderr)
if solved:
    out = open(re.search(r"Output: (\S+)", config)[1], "a")
    out.write("%d %f\n" % (len(tasks), radius))
    for way, wait in (([0, 1, 4, 2, 3], 0), ([3, 2, 1, 0], 700.1)):
        points, time = [(0, way[0])], 0
        if wait:
            points.append((wait, way[0]))
            time = wait
        for a, b in zip(way, way[1:]):
            assert (a, b) in ends
            time += math.dist(nodes[a], nodes[b])
            points.append((time, b))
        out.write("%d\n" % len(points))
        for time, node in points:
            out.write("%f\n%f %f\n" % (time, *nodes[node]))
print("   planner    problem    success   makespan", file=sys.stderr)
print("     PSIPP    problem   %f" % solved, "0.0 0.0", file=sys.stderr)
"#;

#[test]
fn psipp_is_told_and_read_in_its_own_unit() {
    if !have("python3") {
        return;
    }
    let ask = |style: &str| {
        let yard = hall();
        discs(&yard, SWAP);
        let named = program(&yard, style, PSIPP);
        run(&yard.set("PSIPP", &named), "psipp", ON_ROADMAP)
    };
    let record = ask("solves").expect(SUCCESS).json();
    assert_eq!(record["verdict"]["valid"], true, "{record}");
    let soc = record["metrics"]["soc_s"].as_f64().unwrap();
    let exact = 5.0 + 5_f64.sqrt() + 700.1 / 2048.0;
    // Six decimals of a unit are two nanoseconds.
    assert!((soc - exact).abs() < 1e-8, "{soc} {exact}");
    assert_eq!(record["claimed_metrics"]["annotation_ms"], 25.0);
    let ended = ask("fails").expect(NO_PLAN);
    let told = "gave up: no plan with these priorities";
    assert!(ended.stderr.contains(told), "{ended}");
}

/// Stands in for db-CBS: one robot drives straight to its goal at its largest speed, which its actions
/// say. It is killed at its end as the program is.
const DB_CBS: &str = r#"#!/usr/bin/env python3
import os, re, sys
given = dict(zip(sys.argv[1::2], sys.argv[2::2]))
text = open(given["-i"]).read()
box = r"type: box\n      center: \[1.5, 4.5\]\n      size: \[1, 2\]"
assert "min: [0, 0]\n  max: [8, 6]" in text and re.search(box, text), text
assert text.count("type: box") == 5 and "center: [-0.5, 3]\n      size: [1, 8]" in text, text
assert "delta_0: 0.5" in open(given["-c"]).read()
ends = re.findall(r"type: (\w+)\n    start: \[(.*)\]\n    goal: \[(.*)\]", text)
assert [one[0] for one in ends] == ["unicycle_first_order_0"], ends
x, y, heading = map(float, ends[0][1].split(", "))
goal = list(map(float, ends[0][2].split(", ")))
assert [y, heading] == goal[1:] == [1, 0], goal
step = 0.06 if os.path.basename(sys.argv[0]) == "hurries" else 0.05
out = "cost: 1\nresult:\n  - states:\n"
count = round((goal[0] - x) / step)
for number in range(count + 1):
    out += f"      - [{x + (goal[0] - x) * number / count}, {y}, {heading}]\n"
print("time_ddp_total: 1.25e+01")
if os.path.basename(sys.argv[0]) != "dies":
    print("optimization done!", flush=True)
    turn = 0.02 if os.path.basename(sys.argv[0]) == "swerves" else 0
    actions = f"      - [{step / 0.1}, {turn}]\n" * count
    open(given["--optimization"], "w").write(out + "    actions:\n" + actions)
os.abort()
"#;

fn unicycle(yard: &Yard, robot: &str, goal: &str) {
    let task = format!(
        r#"{{"format": "fleetyard.task/1", "world": "hall.world.json", "robots": {{"cart": {robot}}},
            "agents": [{{"start": [1, 1, 0], "goal": {goal}}}]}}"#
    );
    yard.write("hall.task.json", task);
}

const CART: &str = "\"dynobench-unicycle-1\"";

#[test]
fn db_cbs_is_asked_about_robots_that_it_knows() {
    if !have("python3") {
        return;
    }
    let ask = |style: &str, robot: &str, goal: &str, world: Option<(&str, &str)>| {
        let yard = hall();
        unicycle(&yard, robot, goal);
        if let Some((old, new)) = world {
            let text = String::from_utf8(yard.read("hall.world.json")).unwrap();
            assert!(text.contains(old));
            yard.write("hall.world.json", text.replace(old, new));
        }
        let named = program(&yard, style, DB_CBS);
        run(&yard.set("DB_CBS", &named), "db-cbs", "")
    };
    let record = ask("solves", CART, "[7, 1, 0]", None)
        .expect(SUCCESS)
        .json();
    assert_eq!(record["verdict"]["valid"], true, "{record}");
    let soc = record["metrics"]["soc_s"].as_f64().unwrap();
    assert!((soc - 12.0).abs() < 1e-9, "{soc}");
    assert_eq!(record["claimed_metrics"]["optimization_ms"], 12.5);
    // Killed before there is a plan.
    let ended = ask("dies", CART, "[7, 1, 0]", None).expect(PLUGIN);
    assert!(ended.stderr.contains("SIGABRT"), "{ended}");
    // Faster than the robot is, or with actions that lead elsewhere: the judge says so.
    for (style, rule) in [("hurries", "too-fast"), ("swerves", "off-controls")] {
        let record = ask(style, CART, "[7, 1, 0]", None)
            .expect(INVALID_PLAN)
            .json();
        assert_eq!(record["claim"], "solved");
        let violations = record["judged"]["world"]["violations"].as_array().unwrap();
        assert!(
            violations.iter().any(|found| found["rule"] == rule),
            "{record}"
        );
    }
    let turned = ("\"size\": [1, 2]", "\"size\": [1, 2], \"angle_rad\": 0.3");
    let faster = r#"{"footprint": {"rectangle": {"length_m": 0.5, "width_m": 0.25}},
                     "model": {"unicycle-1": {"max_speed_m_per_s": 0.6}}}"#;
    let refused = [
        (
            CART,
            "[7, 1, 0]",
            Some(turned),
            "knows boxes along the axes as obstacles, and obstacle 0 is none",
        ),
        (
            CART,
            "[7, 1]",
            None,
            "takes goals with a heading, which agent 0 has not",
        ),
        (
            faster,
            "[7, 1, 0]",
            None,
            "plans for robots with exactly the footprint and the limits of",
        ),
    ];
    for (robot, goal, world, reason) in refused {
        let ended = ask("solves", robot, goal, world);
        assert_ne!(ended.code, Some(SUCCESS), "{ended}");
        assert!(ended.stderr.contains(reason), "{reason}: {ended}");
    }
}

/// True if a variable names the program of an adapter.
fn is_named(adapter: &str, variable: &str) -> bool {
    let is_named = std::env::var_os(variable).is_some_and(|named| !named.is_empty());
    if !is_named {
        println!("{adapter} is skipped: {variable} does not name the program");
    }
    is_named
}

/// db-CBS itself, where its variable names it: two robots swap along the edge of the world.
#[test]
fn real_db_cbs_in_the_plane() {
    if !is_named("db-cbs", "DB_CBS") {
        return;
    }
    let yard = hall();
    let task = format!(
        r#"{{"format": "fleetyard.task/1", "world": "hall.world.json", "robots": {{"cart": {CART}}},
            "goal_tolerance_m": 0.01, "goal_tolerance_rad": 0.02, "dynamics_tolerance": 0.03,
            "agents": [{{"start": [1, 0.3, 0], "goal": [4, 0.3, 0]}},
                       {{"start": [4, 0.3, 3.14], "goal": [1, 0.3, 3.14]}}]}}"#
    );
    yard.write("hall.task.json", task);
    let record = run(&yard, "db-cbs", "").expect(SUCCESS).json();
    assert_eq!(record["verdict"]["valid"], true, "{record}");
    assert_eq!(record["claim"], "solved");
    // Two ways of three metres at half a metre per second.
    let soc = record["metrics"]["soc_s"].as_f64().unwrap();
    assert!(soc > 11.9, "{soc}");
}

/// The programs themselves, where their variables name them.
#[test]
fn real_programs_on_a_roadmap() {
    for (adapter, variable) in [("ccbs", "CCBS"), ("psipp", "PSIPP")] {
        if !is_named(adapter, variable) {
            continue;
        }
        let yard = hall();
        discs(&yard, SWAP);
        let record = run(&yard, adapter, ON_ROADMAP).expect(SUCCESS).json();
        assert_eq!(record["verdict"]["valid"], true, "{record}");
        assert_eq!(record["claim"], "solved");
        // Nobody is taken for smaller than it is: in the lane they cannot pass.
        discs(
            &yard,
            r#"{"start": [1, 1], "goal": [3, 1]}, {"start": [3, 1], "goal": [1, 1]}"#,
        );
        let ended = run(&yard, adapter, ON_ROADMAP);
        let valid = ended.json()["verdict"]["valid"].clone();
        let passed = ended.code == Some(SUCCESS);
        assert_eq!(valid == true, passed, "{ended}");
        let folder = root().join("plugins/adapters").join(adapter);
        let check = ["plugins", "check", &folder.display().to_string()];
        Yard::new().run(&check).expect(SUCCESS);
    }
}
