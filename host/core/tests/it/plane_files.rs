//! Files of plans in the plane and on roadmaps: round trips, what readers say of bad
//! files, and files as other programs write them.

#![allow(clippy::float_cmp, reason = "the values are exact")]

use std::fs;
use std::path::{Path, PathBuf};

use fleetyard_core::formats::{
    AnyPlan, CcbsPlaces, Contents, Format, Known, MapSize, Parts, load_any_plan, read_ccbs_log,
    read_ccbs_roadmap, read_dynobench, write_ccbs_roadmap,
};
use fleetyard_core::{
    InputError, Knot, Roadmap, RoadmapPlan, RoadmapPlanFile, TrajectoryFile, TrajectoryPlan, Visit,
    read_roadmap, read_roadmap_plan, read_trajectories, save_roadmap, save_roadmap_plan,
    write_roadmap, write_roadmap_plan, write_trajectories,
};
use proptest::prelude::*;

/// The error as the command line prints it.
fn text(error: &InputError) -> String {
    match &error.hint {
        Some(hint) => format!("{error}\nhint: {hint}"),
        None => error.to_string(),
    }
}

#[track_caller]
fn fails<T: std::fmt::Debug>(result: Result<T, InputError>, expected: &str) {
    assert_eq!(text(&result.expect_err("the file is bad")), expected);
}

/// Numbers of every magnitude that a plan may have, and some that are hard to write.
fn numbers() -> impl Strategy<Value = f64> {
    prop_oneof![
        -1e9..1e9,
        -10.0..10.0,
        Just(0.1 + 0.2),
        Just(-0.0),
        Just(5e-324),
        Just(1e-7),
        Just(1e9),
    ]
}

fn plans() -> impl Strategy<Value = TrajectoryPlan> {
    let knot = (1e-9..1e3, numbers(), numbers(), numbers());
    let paths = proptest::collection::vec(proptest::collection::vec(knot, 1..6), 0..4);
    (any::<bool>(), paths).prop_map(|(headings, paths)| {
        let mut plan = TrajectoryPlan::default();
        for path in paths {
            let mut time_s = 0.0;
            let knots = path
                .into_iter()
                .enumerate()
                .map(|(at, (step, x_m, y_m, heading))| {
                    time_s += if at == 0 { 0.0 } else { step };
                    Knot {
                        time_s,
                        x_m,
                        y_m,
                        heading_rad: headings.then_some(heading),
                    }
                });
            plan.push_path(knots).unwrap();
        }
        plan
    })
}

fn roadmaps() -> impl Strategy<Value = Roadmap> {
    (1usize..8, any::<bool>()).prop_flat_map(|(vertices, symmetric)| {
        let coordinates = || proptest::collection::vec(numbers(), vertices);
        let vertex = 0..vertices as u32;
        let edges = proptest::collection::vec((vertex.clone(), vertex), 0..20);
        (coordinates(), coordinates(), edges).prop_map(move |(x, y, edges)| {
            let edges = edges.into_iter().filter(|(from, to)| from != to);
            let back = |(from, to)| {
                [(from, to), (to, from)]
                    .into_iter()
                    .take(1 + usize::from(symmetric))
            };
            Roadmap::new(x, y, edges.flat_map(back)).unwrap()
        })
    })
}

fn roadmap_plans() -> impl Strategy<Value = RoadmapPlan> {
    let visit = (0u32..9, 1e-6..1e3, prop_oneof![Just(0.0), 0.0..10.0]);
    let paths = proptest::collection::vec(proptest::collection::vec(visit, 1..6), 0..4);
    paths.prop_map(|paths| {
        let mut plan = RoadmapPlan::default();
        for path in paths {
            let mut time_s = 0.0;
            let visits = path
                .into_iter()
                .enumerate()
                .map(|(at, (vertex, drives, stays))| {
                    let arrival_s = time_s + if at == 0 { 0.0 } else { drives };
                    time_s = arrival_s + stays;
                    Visit {
                        vertex,
                        arrival_s,
                        departure_s: time_s,
                    }
                });
            plan.push_path(visits).unwrap();
        }
        plan
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn trajectories_survive_their_file(
        plan in plans(), planner in proptest::option::of("\\PC{0,8}"), with_digest: bool,
    ) {
        let file = TrajectoryFile {
            source: "a.json".into(),
            planner,
            plan_digest: with_digest.then(|| plan.digest()),
            plan,
        };
        prop_assert_eq!(read_trajectories("a.json", &write_trajectories(&file)), Ok(file));
    }

    #[test]
    fn roadmaps_survive_their_files(roadmap in roadmaps()) {
        let read = read_roadmap("a", &write_roadmap(&roadmap));
        prop_assert_eq!(read.as_ref(), Ok(&roadmap));
        prop_assert_eq!(read_ccbs_roadmap("a", &write_ccbs_roadmap(&roadmap)), Ok(roadmap));
    }

    #[test]
    fn plans_on_roadmaps_survive_their_file(
        plan in roadmap_plans(), roadmap in proptest::option::of("\\PC{1,8}"), with_digest: bool,
    ) {
        let file = RoadmapPlanFile {
            source: "a.json".into(),
            planner: roadmap.clone(),
            roadmap,
            roadmap_digest: None,
            plan_digest: with_digest.then(|| plan.digest()),
            plan,
        };
        prop_assert_eq!(read_roadmap_plan("a.json", &write_roadmap_plan(&file)), Ok(file));
    }
}

#[test]
fn bad_trajectory_files() {
    let read = |text: &str| read_trajectories("a.json", text.as_bytes());
    let what = "hint: a trajectory file is a JSON object with format and paths";
    fails(read(""), &format!("a.json: the file is empty\n{what}"));
    fails(
        read("\n [[[0,0,0]]]"),
        &format!("a.json:2:2: this is not a JSON object\n{what}"),
    );
    fails(
        read(r#"{"format": "fleetyard.plan/1"}"#),
        "a.json:1:30: format is \"fleetyard.plan/1\", expected \"fleetyard.trajectories/1\"",
    );
    let with = |paths: &str| {
        read(&format!(
            "{{\"format\": \"fleetyard.trajectories/1\",\n\"paths\": [\n{paths}\n]}}"
        ))
    };
    fails(
        read(r#"{"format": "fleetyard.trajectories/1"}"#),
        "a.json:1:38: missing field `paths`",
    );
    fails(
        with("[[0,0,0]], []"),
        "a.json:3:13: agent 1 has no knots\nhint: an agent that rests has one knot, at time 0",
    );
    fails(
        with("[[0,0]]"),
        "a.json:3:6: invalid length 2, expected a knot [t, x, y] or [t, x, y, heading]",
    );
    fails(
        with("[[0,0,0,0,0]]"),
        "a.json:3:12: invalid length 5, expected a knot [t, x, y] or [t, x, y, heading]",
    );
    fails(
        with("[[0,0,null]]"),
        "a.json:3:10: invalid type: null, expected f64",
    );
    fails(
        with("[[0,0,NaN]]"),
        "a.json:3:7: expected value\nhint: the file is not valid JSON",
    );
    fails(
        with("[[0,0,1e999]]"),
        "a.json:3:11: number out of range\nhint: the file is not valid JSON",
    );
    fails(
        with("[[0,0,1e10]]"),
        "a.json:3:11: knot 0 of agent 0 has y 1e10, beyond ±1e9",
    );
    fails(
        with("[[0,0,0],\n [1,0,0],\n [0.5,0,0],\n [2,0,0]]"),
        "a.json:5:10: knot 2 of agent 0 goes back in time, from 1 s to 0.5 s",
    );
    fails(
        with("[[0,0,0],[1,0,0],[1,0,2]]"),
        "a.json:3:24: there is a gap at knot 2 of agent 0: at time 1 s it is in two places, \
         2 m apart and turned by 0 rad\nhint: give the move the time that it takes",
    );
    fails(
        with("[[0,0,0],[1,0,0,0.5]]"),
        "a.json:3:20: knot 1 of agent 0 has a heading, unlike the first of the plan\n\
         hint: give every knot of every agent a heading, or none; a disc's may be 0",
    );
    fails(
        with("[[1,0,0]]"),
        "a.json:3:8: agent 0 begins at time 1 s, not at 0\n\
         hint: begin with a knot at time 0; an agent that waits has two knots in one place",
    );
    fails(
        with("[[0,0,0]"),
        "a.json:4:2: expected `,` or `]`\nhint: the file is not valid JSON",
    );
    fails(
        read(
            "{\"format\": \"fleetyard.trajectories/1\", \"paths\": [[[0,0,0]]],\n \
             \"plan_digest\": \"00000000000000000000000000000000\"}",
        ),
        "a.json: plan_digest is 00000000000000000000000000000000, but the paths have \
         d85bfd9d56865809ad7b6a346b39d9fb\nhint: the file was changed after it was written; \
         remove plan_digest if that was on purpose",
    );
}

#[test]
fn bad_roadmap_files() {
    let with = |rest: &str| {
        let text = format!("{{\"format\": \"fleetyard.roadmap/1\",\n{rest}}}");
        read_roadmap("a.json", text.as_bytes())
    };
    fails(
        with("\"vertices\": [[0,0,0]], \"edges\": []"),
        "a.json:2:20: invalid length 3, expected a vertex [x, y]",
    );
    fails(
        with("\"vertices\": [[0,0]], \"edges\": [[0]]"),
        "a.json:2:34: invalid length 1, expected an edge [from, to]",
    );
    fails(
        with("\"vertices\": [[0,0]], \"edges\": [[0,-1]]"),
        "a.json:2:36: invalid value: integer `-1`, expected u32",
    );
    fails(
        with("\"vertices\": [[0,0]], \"edges\": [[0,1]]"),
        "a.json: edge 0 goes from 0 to 1, but there are 1 vertices",
    );
    fails(
        with("\"vertices\": [], \"edges\": []"),
        "a.json: there are no vertices",
    );
    fails(
        with("\"vertices\": 3, \"edges\": []"),
        "a.json:2:13: invalid type: integer `3`, expected a list of vertices",
    );
    let plan = |paths: &str| {
        let text = format!("{{\"format\": \"fleetyard.roadmap-plan/1\",\n\"paths\": {paths}}}");
        read_roadmap_plan("a.json", text.as_bytes())
    };
    fails(
        plan("[[[0]]]"),
        "a.json:2:14: invalid length 1, expected a visit [vertex, arrival, departure] or \
         [vertex, arrival]",
    );
    fails(
        plan("[[[0,0],[1,0]]]"),
        "a.json:2:22: visit 1 of agent 0 begins at 0 s, but the one before ends at 0 s\n\
         hint: give the edge the time that it takes",
    );
    fails(
        plan("[[[0,0,2],[1,3,2.5]]]"),
        "a.json:2:28: visit 1 of agent 0 ends at 2.5 s, before it begins at 3 s",
    );
}

/// A roadmap and a plan on it, in a folder.
fn on_roadmap() -> (tempfile::TempDir, PathBuf, Roadmap) {
    let folder = tempfile::tempdir().unwrap();
    let roadmap = Roadmap::new(vec![0.0, 3.0], vec![0.0, 4.0], [(0, 1)]).unwrap();
    save_roadmap(&roadmap, folder.path().join("a.roadmap.json")).unwrap();
    let mut plan = RoadmapPlan::default();
    let visit = |vertex, arrival_s| Visit {
        vertex,
        arrival_s,
        departure_s: arrival_s,
    };
    plan.push_path([visit(0, 0.0), visit(1, 2.5)]).unwrap();
    let file = RoadmapPlanFile::new(&roadmap, Some("a.roadmap.json".into()), plan);
    let path = folder.path().join("a.json");
    save_roadmap_plan(&file, &path).unwrap();
    (folder, path, roadmap)
}

#[test]
fn plans_on_roadmaps_bring_their_roadmap() {
    let (folder, path, roadmap) = on_roadmap();
    let contents = Contents::load(&path, None, Known::default()).unwrap();
    assert_eq!(contents.format, Format::RoadmapPlan);
    assert_eq!(contents.roadmap.as_deref(), Some(&roadmap));
    assert_eq!(contents.files, [folder.path().join("a.roadmap.json")]);
    let AnyPlan::Trajectories(file) = load_any_plan(&path, None, Known::default()).unwrap() else {
        panic!("a plan in the plane");
    };
    assert_eq!(file.plan.knots(0).fastest().speed_m_per_s, 2.0);
    // Written again: two files, of which one names the other.
    let parts = Parts {
        roadmap: contents.roadmap,
        roadmap_plan: contents.roadmap_plan,
        ..Parts::default()
    };
    let written = parts.write(Format::RoadmapPlan, "a").unwrap();
    assert_eq!(written.bytes, fs::read(&path).unwrap());
    let [(name, bytes)] = &written.others[..] else {
        panic!("one other file");
    };
    assert_eq!(*bytes, fs::read(folder.path().join(name)).unwrap());
}

#[test]
fn plans_on_other_roadmaps_are_refused() {
    let (folder, path, roadmap) = on_roadmap();
    let shown = path.display().to_string();
    let other = Roadmap::new(vec![0.0, 3.0], vec![0.0, 4.0], [(1, 0)]).unwrap();
    save_roadmap(&other, folder.path().join("a.roadmap.json")).unwrap();
    fails(
        Contents::load(&path, None, Known::default()),
        &format!(
            "{shown}: the plan is for roadmap {}, but this roadmap is {}\nhint: is it the right \
             roadmap? to use it all the same, remove roadmap_digest from the file",
            roadmap.digest(),
            other.digest()
        ),
    );
    let text = fs::read_to_string(&path).unwrap();
    let without_lines = |text: &str, word: &str| -> String {
        let lines = text.split_inclusive('\n');
        lines.filter(|line| !line.contains(word)).collect()
    };
    let without = without_lines(&text, "digest");
    fs::write(&path, &without).unwrap();
    fails(
        Contents::load(&path, None, Known::default()),
        &format!(
            "{shown}: visit 1 of agent 0: the roadmap has no edge from 0 to 1\n\
             hint: edges are directed: the other way is another edge"
        ),
    );
    let nameless = without_lines(&without, "\"roadmap\"");
    fs::write(&path, nameless).unwrap();
    fails(
        Contents::load(&path, None, Known::default()),
        &format!(
            "{shown}: the plan does not name its roadmap\n\
             hint: add \"roadmap\" with the name of the roadmap's file"
        ),
    );
}

const GRAPH: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<graphml xmlns="http://graphml.graphdrawing.org/xmlns">
  <key id="key0" for="node" attr.name="coords" attr.type="string" />
  <graph id="G" edgedefault="directed">
    <node id="n0">
      <data key="key0">70,182.5</data>
    </node>
    <node id="n7"><data key="key0">68,55</data></node>
    <edge id="e0" source="n0" target="n7">
      <data key="key1">1</data>
    </edge>
  </graph>
</graphml>
"#;

#[test]
fn roadmaps_of_ccbs() {
    let roadmap = read_ccbs_roadmap("a.xml", GRAPH.as_bytes()).unwrap();
    assert_eq!((roadmap.vertices(), roadmap.edge_count()), (2, 1));
    assert_eq!(roadmap.position_m(0), (70.0, 182.5));
    assert_eq!(roadmap.neighbors(0), [1]);
    let undirected = GRAPH.replace("\"directed\"", "\"undirected\"");
    let roadmap = read_ccbs_roadmap("a.xml", undirected.as_bytes()).unwrap();
    assert_eq!(roadmap.edge_count(), 2);
    let with = |old: &str, new: &str| {
        assert!(GRAPH.contains(old));
        read_ccbs_roadmap("a.xml", GRAPH.replacen(old, new, 1).as_bytes())
    };
    fails(
        with("70,182.5", "70;182.5"),
        "a.xml:6:24: the node has no position but '70;182.5'\n\
         hint: a node's first data is its position, written x,y",
    );
    fails(with("70,", "x,"), "a.xml:6:24: x is 'x', not a number");
    fails(
        with("70,", "inf,"),
        "a.xml:6:24: x is 'inf', not finite or beyond ±1e9",
    );
    fails(
        with("target=\"n7\"", "target=\"n1\""),
        "a.xml:9:5: the target 'n1' is no node",
    );
    fails(
        with("target=\"n7\"", "target=\"n0\""),
        "a.xml:9:5: the edge goes from a node to itself",
    );
    fails(
        with("id=\"n7\"", "id=\"n0\""),
        "a.xml:8:5: there is another node 'n0'",
    );
    fails(
        with("<node id=\"n7\"", "<node"),
        "a.xml:8:5: the node has no id",
    );
    fails(
        with("  </graph>", ""),
        "a.xml:13:1: this is not XML: expected 'graph' tag, not 'graphml'",
    );
    fails(
        read_ccbs_roadmap("a.xml", b"<root/>"),
        "a.xml:1:1: expected the element 'graphml', found 'root'",
    );
    fails(
        read_ccbs_roadmap("a.xml", b"\n<graphml a=\"\xff\"/>"),
        "a.xml:2: the file is not UTF-8 text",
    );
    // A hundred characters that would become a gigabyte.
    let bomb = "<!DOCTYPE a [<!ENTITY a \"ha\"><!ENTITY b \"&a;&a;&a;\">]><graphml>&b;</graphml>";
    let error = read_ccbs_roadmap("a.xml", bomb.as_bytes()).unwrap_err();
    assert!(error.reason.contains("DTD"), "{error}");
}

const LOG: &str = r#"<?xml version="1.0" ?>
<root>
    <agent start_id="3" goal_id="5"/>
    <agent start_id="4" goal_id="6"/>
    <log>
        <summary time="0.01" flowtime="5" makespan="3"/>
        <agent number="0">
            <path duration="3.5">
                <section number="0" start_i="0" start_j="1" goal_i="2" goal_j="1" duration="2"/>
                <section number="1" start_i="2" start_j="1" goal_i="2" goal_j="1" duration="0.5"/>
                <section number="2" start_i="2" start_j="1" goal_i="2" goal_j="2" duration="1"/>
            </path>
        </agent>
        <agent number="1">
            <path duration="2">
                <section number="0" start_i="9" start_j="9" goal_i="9" goal_j="7" duration="2"/>
            </path>
        </agent>
    </log>
</root>
"#;

#[test]
fn results_of_ccbs() {
    let read = |text: &str, places| read_ccbs_log("a.xml", text.as_bytes(), places);
    let plan = read(LOG, CcbsPlaces::Unknown).unwrap();
    let knots: Vec<(f64, f64, f64)> = plan
        .knots(0)
        .iter()
        .map(|knot| (knot.time_s, knot.x_m, knot.y_m))
        .collect();
    assert_eq!(
        knots,
        [
            (0.0, 0.0, 1.0),
            (2.0, 2.0, 1.0),
            (2.5, 2.0, 1.0),
            (3.5, 2.0, 2.0)
        ]
    );
    assert!(plan.fastest().all(|fastest| fastest.speed_m_per_s == 1.0));
    // On a grid, i and j are row and column, and the rows grow down.
    let on_grid = LOG.replace(
        "start_id=\"3\" goal_id",
        "start_i=\"0\" start_j=\"1\" goal_id",
    );
    let size = MapSize { rows: 10, cols: 12 };
    let first = read(&on_grid, CcbsPlaces::Grid(size))
        .unwrap()
        .knots(0)
        .get(0);
    assert_eq!((first.x_m, first.y_m), (1.5, 9.5));
    fails(
        read(&on_grid, CcbsPlaces::Unknown),
        "a.xml:3:5: a result on a grid does not say how large the map is\n\
         hint: name the map with --map FILE",
    );
    let with = |old: &str, new: &str| {
        assert!(LOG.contains(old));
        read(&LOG.replacen(old, new, 1), CcbsPlaces::Unknown)
    };
    fails(
        with(
            "start_i=\"2\" start_j=\"1\" goal_i=\"2\" goal_j=\"2\"",
            "start_i=\"2\" start_j=\"1.5\" goal_i=\"2\" goal_j=\"2\"",
        ),
        "a.xml:11:17: there is a gap at knot 4 of agent 0: at time 2.5 s it is in two places, \
         0.5 m apart and turned by 0 rad",
    );
    fails(
        with("duration=\"0.5\"", "duration=\"-0.5\""),
        "a.xml:10:17: knot 3 of agent 0 goes back in time, from 2 s to 1.5 s",
    );
    fails(
        with("duration=\"0.5\"", "duration=\"long\""),
        "a.xml:10:93: duration is 'long', not a number",
    );
    fails(
        with("<agent number=\"1\">", "<agent number=\"2\">"),
        "a.xml:14:9: this is agent '2', not 1",
    );
    fails(
        with("    <agent start_id=\"4\" goal_id=\"6\"/>\n", ""),
        "a.xml:4:5: there are paths for 2 of 1 agents\nhint: the program found no plan",
    );
    let section = "<section number=\"0\" start_i=\"9\" start_j=\"9\" goal_i=\"9\" goal_j=\"7\" duration=\"2\"/>";
    fails(
        with(section, ""),
        "a.xml:15:13: the agent rests at its start, and the result does not say where that is\n\
         hint: leave out agents that need not move",
    );
    // The roadmap says it.
    let roadmap = Roadmap::new(vec![0.0, 7.0], vec![0.0, 5.0], [(0, 1)]).unwrap();
    let resting = |start: &str| {
        let text = LOG.replace(section, "").replace("start_id=\"4\"", start);
        read(&text, CcbsPlaces::Roadmap(&roadmap))
    };
    let last = resting("start_id=\"1\"").unwrap().knots(1).get(0);
    assert_eq!((last.time_s, last.x_m, last.y_m), (0.0, 7.0, 5.0));
    fails(
        resting("start_id=\"2\""),
        "a.xml:4:5: the start 2 is none of 2 vertices",
    );
    fails(
        read(
            "<root><agent start_id=\"1\" goal_id=\"2\"/></root>",
            CcbsPlaces::Unknown,
        ),
        "a.xml:1:1: there is no element 'log'\n\
         hint: this is a task; the program writes its result to NAME_log.xml",
    );
}

const RESULT: &str = "\
delta: 0.3
cost: 0.4
result:
  - states:
      - [1, 2.5, 3.1]
      - [1.05, 2.5, -3.1]
      - [1.1, 2.5, -3.0]
    actions:
      - [0.5, 0]
      - [0.5, 0]
  - num_states: 1
    states:
      # a double integrator
      - [4, 2, 0, 0]
";

#[test]
fn results_of_dynobench() {
    let read = |text: &str| read_dynobench("a.yaml", text.as_bytes());
    let plan = read(RESULT).unwrap();
    assert_eq!((plan.agents(), plan.knot_count()), (2, 4));
    let heading = |knot| plan.knots(0).get(knot).heading_rad.unwrap();
    // Across the seam at π, and not once around.
    assert!((heading(1) - (std::f64::consts::TAU - 3.1)).abs() < 1e-12);
    assert!((heading(2) - heading(1) - 0.1).abs() < 1e-12);
    assert_eq!(plan.knots(0).time_s, [0.0, 0.1, 0.2]);
    assert_eq!(plan.knots(1).get(0).heading_rad, Some(0.0));
    let with = |old: &str, new: &str| {
        assert!(RESULT.contains(old));
        read(&RESULT.replacen(old, new, 1))
    };
    fails(
        with("[1.05, 2.5, -3.1]", "[1.05, 2.5]"),
        "a.yaml:6:9: the state has 2 numbers, unlike the 3 before",
    );
    fails(
        with("[4, 2, 0, 0]", "[4, 2, 0, 0, 0, 0]"),
        "a.yaml:14:9: no robot in the plane has a state of 6 numbers\n\
         hint: states of 2 to 5 numbers are read: x, y, and then by model",
    );
    fails(
        with("2.5, -3.1", "nan, -3.1"),
        "a.yaml:6:9: knot 1 of agent 0 has y NaN, which is not finite",
    );
    fails(
        with("2.5, -3.1", "fast, -3.1"),
        "a.yaml:6:16: expected a coordinate, found 'fast'",
    );
    fails(
        read("cost: 1\nresult: []\n"),
        "a.yaml:1:1: there are no robots in the result\nhint: the planner found no plan",
    );
    fails(
        read("result:\n  - states: []\n"),
        "a.yaml:2:5: the robot has no states\nhint: the planner found no plan",
    );
    fails(read("cost: 1\n"), "a.yaml:1:1: there is no key `result`");
}

/// States of four numbers are of a car with a trailer or of a double integrator, as they move.
#[test]
fn cars_with_trailers_of_dynobench_are_told_from_double_integrators() {
    let text = |states: &[[f64; 4]], actions: &[[f64; 2]]| {
        format!("result:\n  - states: {states:?}\n    actions: {actions:?}\n")
    };
    let read = |text: &str| read_dynobench("a.yaml", text.as_bytes()).unwrap();
    // By steps of Euler, as the program makes them.
    let actions: [[f64; 2]; 5] = [
        [0.5, 0.6],
        [0.5, 0.6],
        [0.3, -1.0],
        [-0.1, 0.2],
        [-0.1, 0.0],
    ];
    for heading in [0.0, 0.1, 2.0, -3.1] {
        let mut states: Vec<[f64; 4]> = vec![[1.0, 2.0, heading, heading - 0.2]];
        for [speed, steering] in actions {
            let [x, y, own, behind] = states[states.len() - 1];
            states.push([
                x + 0.1 * speed * own.cos(),
                y + 0.1 * speed * own.sin(),
                own + 0.1 * speed / 0.25 * steering.tan(),
                behind + 0.1 * speed / 0.5 * (own - behind).sin(),
            ]);
        }
        let plan = read(&text(&states, &actions));
        assert!(plan.has_headings());
        for (knot, state) in plan.knots(0).iter().zip(&states) {
            assert!((knot.heading_rad.unwrap() - state[2]).abs() < 1e-12);
        }
        let controls = plan.controls().unwrap();
        let told: Vec<&[f64]> = controls.of(0).map(|segment| segment.control).collect();
        assert_eq!(told, actions);
    }
    let pushes = [
        [2.0, 0.0],
        [2.0, -2.0],
        [-2.0, -2.0],
        [0.0, 2.0],
        [-2.0, 2.0],
    ];
    for [vx, vy] in [[0.0, 0.0], [0.4, 0.0], [0.1, -0.3]] {
        let mut states = vec![[1.0, 2.0, vx, vy]];
        for [ax, ay] in pushes {
            let [x, y, vx, vy] = states[states.len() - 1];
            states.push([x + 0.1 * vx, y + 0.1 * vy, vx + 0.1 * ax, vy + 0.1 * ay]);
        }
        assert!(!read(&text(&states, &pushes)).has_headings());
    }
    assert!(!read(&text(&[[1.0, 2.0, 0.0, 0.0]], &[])).has_headings());
}

#[test]
fn every_kind_of_file_is_recognised() {
    let guess = |text: &str| Format::guess(Path::new("a"), text.as_bytes());
    let own =
        |name: &str| format!("{{\n  \"planner\": \"x\", \"format\" : \"fleetyard.{name}/1\"}}");
    assert_eq!(guess(&own("trajectories")), Some(Format::Trajectories));
    assert_eq!(guess(&own("roadmap")), Some(Format::Roadmap));
    assert_eq!(guess(&own("roadmap-plan")), Some(Format::RoadmapPlan));
    assert_eq!(guess(&own("plan")), Some(Format::Plan));
    assert_eq!(
        guess("{\"name\": \"a\", \"n_row\": 1"),
        Some(Format::Lsmart)
    );
    assert_eq!(guess("{\"layout\": [\"..\"]}"), Some(Format::Lsmart));
    assert_eq!(guess(GRAPH), Some(Format::CcbsRoadmap));
    assert_eq!(guess(LOG), Some(Format::CcbsLog));
    assert_eq!(guess(RESULT), Some(Format::Dynobench));
}

/// Files that the programs themselves wrote, where `FLEETYARD_CCBS` names a checkout of
/// Continuous-CBS.
#[test]
fn examples_of_ccbs() {
    let Some(folder) = std::env::var_os("FLEETYARD_CCBS") else {
        eprintln!("skipped: FLEETYARD_CCBS names no checkout of Continuous-CBS");
        return;
    };
    let examples = Path::new(&folder).join("Examples");
    let roadmap = Contents::load(&examples.join("roadmap.xml"), None, Known::default()).unwrap();
    let roadmap = roadmap.roadmap.unwrap();
    assert_eq!((roadmap.vertices(), roadmap.edge_count()), (170, 698));
    let log = load_any_plan(
        &examples.join("roadmap_task_log.xml"),
        None,
        Known::default(),
    )
    .unwrap();
    let AnyPlan::Trajectories(file) = log else {
        panic!("a plan in the plane");
    };
    assert_eq!(file.plan.agents(), 10);
    for fastest in file.plan.fastest() {
        assert!((fastest.speed_m_per_s - 1.0).abs() < 1e-6, "{fastest:?}");
    }
    // Every place is a vertex, and every move an edge.
    let vertex = |x: f64, y: f64| {
        (0..roadmap.vertices() as u32)
            .find(|vertex| roadmap.position_m(*vertex) == (x, y))
            .unwrap()
    };
    for knots in file.plan.paths() {
        let vertices: Vec<u32> = knots
            .iter()
            .map(|knot| vertex(knot.x_m, knot.y_m))
            .collect();
        for pair in vertices.windows(2) {
            assert!(pair[0] == pair[1] || roadmap.has_edge(pair[0], pair[1]));
        }
    }
    let size = Some(MapSize { rows: 10, cols: 10 });
    let log = load_any_plan(&examples.join("grid_task_log.xml"), None, Known::size(size)).unwrap();
    assert!(matches!(log, AnyPlan::Trajectories(file) if file.plan.agents() > 10));
}

#[test]
fn actions_of_dynobench_become_controls() {
    let result = |actions: &str| {
        let text = format!(
            "result:\n  - states:\n      - [1, 2, 0]\n      - [1.05, 2, 0]\n      - [1.1, 2, 0.05]\n\
             {actions}  - states:\n      - [5, 5, 0]\n"
        );
        read_dynobench("r.yaml", text.as_bytes())
    };
    let plan = result("    actions:\n      - [0.5, 0]\n      - [0.5, 0.5]\n").unwrap();
    let controls = plan.controls().unwrap();
    let own: Vec<(f64, &[f64])> = controls
        .of(0)
        .map(|segment| (segment.duration_s, segment.control))
        .collect();
    assert_eq!(own, [(0.1, &[0.5, 0.0][..]), (0.1, &[0.5, 0.5][..])]);
    assert_eq!(controls.of(1).len(), 0);
    // They count for the digest, and come back from a file.
    let without = result("    actions: []\n").unwrap();
    assert!(without.controls().is_none() && without.digest() != plan.digest());
    let file = TrajectoryFile {
        source: "a.json".to_owned(),
        ..TrajectoryFile::new(plan)
    };
    let again = read_trajectories("a.json", &write_trajectories(&file));
    assert_eq!(again.as_ref(), Ok(&file));
    let told = |actions: &str| result(actions).unwrap_err().to_string();
    let few = told("    actions:\n      - [0.5, 0]\n");
    assert!(
        few.contains("1 actions do not lead through 3 states"),
        "{few}"
    );
    let uneven = told("    actions:\n      - [0.5, 0]\n      - [0.5]\n");
    assert!(
        uneven.contains("segment 1 of agent 0 has a control of 1 numbers"),
        "{uneven}"
    );
}
