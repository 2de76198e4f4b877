//! `fleetyard world`: views of a task's world, and how they came about.

use fleetyard_testkit::{INPUT, INVALID_PLAN, NO_PLAN, SUCCESS, USAGE, Yard, root};
use serde_json::Value;

fn task(name: &str) -> String {
    root().join("maps").join(name).display().to_string()
}

fn json(yard: &Yard, file: &str) -> Value {
    serde_json::from_slice(&yard.read(file)).unwrap()
}

#[test]
fn a_task_is_described() {
    let yard = Yard::new();
    let window = task("window.task.json");
    let ended = yard
        .line(&format!("world info {window} --format json"))
        .expect(SUCCESS);
    let info = ended.json();
    assert_eq!(info["agents"], 8);
    assert_eq!(info["robots"], 3);
    assert_eq!(info["r_com_m"], 0.08);
    let text = yard
        .line(&format!("world info {window}"))
        .expect(SUCCESS)
        .stdout;
    assert!(text.contains("size              5 × 5 m"), "{text}");
}

#[test]
fn the_grid_of_a_task_can_be_planned_on() {
    let yard = Yard::new();
    let rooms = task("two-rooms.task.json");
    let ended = yard
        .line(&format!("world grid {rooms} --picture g.svg"))
        .expect(SUCCESS);
    assert!(
        ended
            .stdout
            .ends_with("written           ./two-rooms.grid.json\n"),
        "{}",
        ended.stdout
    );
    let about = json(&yard, "two-rooms.grid.json");
    assert_eq!(about["format"], "fleetyard.view/1");
    assert_eq!(about["origin"]["operator"], "world-to-grid");
    assert_eq!(about["origin"]["parameters"]["separation"], "rules");
    let plan = "run -m two-rooms.map -s two-rooms.scen -n 3 -p pp --format json";
    let record = yard.line(plan).expect(SUCCESS).json();
    assert_eq!(record["instance_digest"], about["instance_digest"]);
    assert!(yard.read("g.svg").starts_with(b"<svg"));
    // Robots that always stay 2r apart need wider cells.
    yard.line(&format!(
        "world grid {rooms} --name s --separation strict --connectivity 8"
    ))
    .expect(SUCCESS);
    let strict = json(&yard, "s.grid.json");
    assert!(strict["cell_m"].as_f64() > about["cell_m"].as_f64());
}

#[test]
fn roadmaps_of_a_task_name_what_made_them() {
    let yard = Yard::new();
    let rooms = task("two-rooms.task.json");
    for (flags, vertices) in [
        ("", 906),
        ("--density S", 166),
        ("--builder prm-star --sampling halton --vertices 100", 106),
        ("--builder delaunay --vertices 100 --seed 7", 106),
        ("--builder tangent", 59),
    ] {
        let line = format!("world roadmap {rooms} {flags} --name r --picture r.png --format json");
        let about = yard.line(&line).expect(SUCCESS).json();
        assert_eq!(about["report"]["vertices"], vertices, "{flags}");
        assert_eq!(json(&yard, "r.view.json"), about, "{flags}");
        let roadmap = json(&yard, "r.roadmap.json");
        assert_eq!(roadmap["roadmap_digest"], about["roadmap_digest"]);
        assert!(yard.read("r.png").starts_with(b"\x89PNG"));
        let again = yard.line(&line).expect(SUCCESS).json();
        assert_eq!(again, about, "{flags}");
    }
}

#[test]
fn a_map_becomes_a_world_or_a_roadmap() {
    let yard = Yard::new();
    let map = task("empty-8-8.map");
    let made = yard
        .line(&format!("world convert {map} w.world.json --cell-size 0.5"))
        .expect(SUCCESS);
    assert_eq!(made.stdout, "w.world.json\nw.world.view.json\n");
    assert_eq!(json(&yard, "w.world.json")["bounds_m"][2], 4.0);
    let about = json(&yard, "w.world.view.json");
    assert_eq!(about["origin"]["operator"], "grid-to-world");
    assert_eq!(about["origin"]["parameters"]["cell_m"], 0.5);
    yard.line(&format!(
        "world convert {map} r.json --to roadmap --connectivity 8 --cell-size 0.5"
    ))
    .expect(SUCCESS);
    let about = json(&yard, "r.view.json");
    assert_eq!(about["format"], "fleetyard.view/1");
    assert_eq!(about["origin"]["operator"], "grid-to-roadmap");
    assert_eq!(
        (&about["vertices"], &about["edges"]),
        (&64.into(), &420.into())
    );
    let roadmap = json(&yard, "r.json");
    assert_eq!(roadmap["roadmap_digest"], about["roadmap_digest"]);
    assert_eq!(roadmap["vertices"][0], serde_json::json!([0.25, 3.75]));
}

/// A task's roadmap becomes a grid whose moves are its edges, and is checked in the world.
#[test]
fn a_roadmap_becomes_a_grid_and_fits_its_world() {
    let yard = Yard::new();
    let rooms = task("two-rooms.task.json");
    yard.line(&format!(
        "world roadmap {rooms} --builder delaunay --vertices 60"
    ))
    .expect(SUCCESS);
    let roadmap = json(&yard, "two-rooms.roadmap.json");
    let line = "--roadmap two-rooms.roadmap.json --connectivity 8 --cell-size 0.1 --picture g.svg";
    let text = yard
        .line(&format!("world grid {rooms} {line}"))
        .expect(SUCCESS)
        .stdout;
    assert!(text.contains("\nstretch           1."), "{text}");
    let about = json(&yard, "two-rooms.grid.json");
    assert_eq!(about["origin"]["operator"], "roadmap-to-grid");
    assert_eq!(about["origin"]["roadmap_digest"], roadmap["roadmap_digest"]);
    assert_eq!(json(&yard, "two-rooms.map")["format"], "fleetyard.grid/1");
    let info = yard
        .line("maps info two-rooms.map --format json")
        .expect(SUCCESS)
        .json();
    assert_eq!((&info["rows"], &info["cols"]), (&60.into(), &100.into()));
    let checked = yard
        .line(&format!(
            "world roadmap {rooms} --check two-rooms.roadmap.json --name c"
        ))
        .expect(SUCCESS);
    let told = "goals             every agent reaches its goal\n";
    assert!(checked.stdout.contains(told), "{checked}");
    let about = json(&yard, "c.view.json");
    assert_eq!(about["origin"]["operator"], "roadmap-to-world");
    assert_eq!(about["edges"][0]["blocked"], serde_json::json!([]));
    // Through the wall, and cells that are too large.
    let through = r#"{"format": "fleetyard.roadmap/1", "directed": false, "vertices": VERTICES, "edges": EDGES}"#;
    let ends: Vec<String> = (0..6)
        .map(|number| roadmap["vertices"][number].to_string())
        .collect();
    let through = through
        .replace("VERTICES", &format!("[{}]", ends.join(",")))
        .replace("EDGES", "[[0, 1], [2, 3], [4, 5]]");
    yard.write("through.json", through);
    for (line, told) in [
        (
            format!("world roadmap {rooms} --check through.json"),
            "cannot reach its goal along edges that are free for it (radius 0.25 m: ",
        ),
        (
            format!("world grid {rooms} --roadmap two-rooms.roadmap.json --cell-size 6 --name x"),
            "hint: use smaller cells",
        ),
    ] {
        let before = yard.files();
        let ended = yard.line(&line).expect(INPUT);
        assert!(ended.stderr.contains(told), "{line}: {}", ended.stderr);
        assert_eq!(yard.files(), before, "{line}");
    }
}

/// A ring that is driven one way: a plan against it is no plan, and no other format has its moves.
#[test]
fn maps_have_allowed_moves() {
    let yard = Yard::new();
    let ring = r#"{"format": "fleetyard.grid/1", "terrain": ["...", ".@.", "..."], "moves": ["224", "104", "188"]}"#;
    yard.write("ring.map", ring);
    yard.write("ring.scen", "version 1\n0\tring.map\t3\t3\t0\t0\t0\t1\t7\n");
    let paths = |cells: &str| format!("Agent 0: {cells}\n");
    yard.write(
        "with.txt",
        paths("(0,0)->(0,1)->(0,2)->(1,2)->(2,2)->(2,1)->(2,0)->(1,0)->"),
    );
    yard.write("against.txt", paths("(0,0)->(1,0)->"));
    let validate = |plan: &str| {
        yard.line(&format!(
            "validate --map ring.map --scen ring.scen --agents 1 {plan}"
        ))
    };
    validate("with.txt").expect(SUCCESS);
    let against = validate("against.txt").expect(INVALID_PLAN).stdout;
    let told = "move-not-allowed: agent 0 moves from (0, 0) to (1, 0)";
    assert!(against.contains(told), "{against}");
    let about = yard
        .line("maps info ring.map --format json")
        .expect(SUCCESS)
        .json();
    assert_eq!(about["components"], 1);
    yard.line("convert ring.map copy.json").expect(SUCCESS);
    let copy = yard
        .line("maps info copy.json --format json")
        .expect(SUCCESS)
        .json();
    assert_eq!(copy["digest"], about["digest"]);
    let lost = yard
        .line("convert ring.map other.json --to lsmart")
        .expect(INPUT);
    assert!(
        lost.stderr.contains("write --to grid instead"),
        "{}",
        lost.stderr
    );
    // Round the ring, and not against it.
    let run = |planner: &str| {
        let asked = "run --map ring.map --scen ring.scen --agents 1 --format json --budget 5s";
        yard.line(&format!("{asked} --planner {planner}"))
    };
    for planner in [
        "lacam",
        "pibt",
        "epibt",
        "wppl",
        "pp",
        "pbs",
        "cbs",
        "ecbs",
        "mapf-lns2",
        "astar",
        "bidirectional-astar",
        "d-star-lite",
    ] {
        let record = run(planner).expect(SUCCESS).json();
        assert_eq!(record["metrics"]["soc_steps"], 7, "{planner}: {record}");
    }
    let refused = run("jump-point-search").expect(NO_PLAN).stderr;
    assert!(
        refused.contains("does not support `move-mask`")
            && refused.contains("planners that do: lacam, pibt, "),
        "{refused}"
    );
}

#[test]
fn the_map_of_a_task_is_not_replaced() {
    let yard = Yard::new();
    let map = "type octile\nheight 2\nwidth 3\nmap\n...\n...\n";
    let robots = r#"{"cart": {"footprint": {"disc": {"radius_m": 0.5}}, "model": {"single-integrator": {"speed_m_per_s": 1.0}}}}"#;
    let task = format!(
        r#"{{"format": "fleetyard.task/1", "map": "hall.map", "cell_size_m": 1.0, "robots": {robots},
            "agents": [{{"robot": "cart", "start": [0.5, 0.5], "goal": [2.5, 0.5]}}]}}"#
    );
    std::fs::write(yard.path("hall.map"), map).unwrap();
    std::fs::write(yard.path("hall.task.json"), task).unwrap();
    let ended = yard.line("world grid hall.task.json").expect(INPUT);
    assert!(ended.stderr.contains("another name"), "{ended}");
    assert_eq!(std::fs::read_to_string(yard.path("hall.map")).unwrap(), map);
    yard.line("world grid hall.task.json --name other")
        .expect(SUCCESS);
}

#[test]
fn what_cannot_be_derived_ends_with_a_reason_and_a_way_out() {
    let yard = Yard::new();
    let rooms = task("two-rooms.task.json");
    for (line, exit, told) in [
        (
            format!("world roadmap {rooms} --density L"),
            USAGE,
            "[possible values: S, D, SD]",
        ),
        (
            format!("world roadmap {rooms} --builder lattice"),
            USAGE,
            "--side",
        ),
        (
            format!("world roadmap {rooms} --vertices 0 --neighbors 1"),
            INPUT,
            "cannot reach its goal",
        ),
        (
            format!("world roadmap {rooms} --name ../x"),
            USAGE,
            "hint: files are named after it",
        ),
        (
            format!("world grid {rooms} --cell-size 0.1"),
            USAGE,
            "--roadmap",
        ),
        (
            format!("world roadmap {rooms} --check r.json --seed 1"),
            USAGE,
            "cannot be used with",
        ),
        (
            format!("world convert {rooms} w.json"),
            INPUT,
            "two-rooms.task.json:1",
        ),
        (
            "world info absent.task.json".to_owned(),
            INPUT,
            "absent.task.json",
        ),
    ] {
        let ended = yard.line(&line).expect(exit);
        assert!(ended.stderr.contains(told), "{line}: {}", ended.stderr);
        assert!(yard.files().is_empty(), "{line} left {:?}", yard.files());
    }
}
