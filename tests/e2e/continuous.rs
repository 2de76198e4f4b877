//! All planners of roadmaps, and of the plane, on instances with everything that is awkward: each ends, with a plan that the judge
//! accepts or a claim that is true.

use fleetyard_testkit::{INPUT, NO_PLAN, SUCCESS, Yard, root};
use serde_json::{Value, json};

/// Planners that are linked in and claim a representation.
fn planners(representation: &str) -> Vec<String> {
    let listing = Yard::new().line("plugins list --format json");
    let listing = listing.expect(SUCCESS).json();
    let plugins = listing[0]["plugins"].as_array().unwrap().iter();
    let of_kind = plugins.filter(|plugin| {
        let claims = plugin["capabilities"].as_array().unwrap();
        plugin["kind"] == "planner" && claims.contains(&json!(representation))
    });
    of_kind
        .map(|plugin| plugin["id"].as_str().unwrap().to_owned())
        .filter(|id| id != "empty")
        .collect()
}

/// True if a planner is for one robot alone.
fn is_of_one(planner: &str) -> bool {
    ["tangent", "db-astar", "hybrid-astar", "rrt-star", "sst"].contains(&planner)
}

/// Planners that find every plan, given time.
const SEARCH: [&str; 3] = ["ccbs", "eccbs", "roadmap-lacam"];

/// Discs with a radius of 0.5 m that do 1 m/s.
fn task(agents: &[[[f64; 2]; 2]]) -> Value {
    let agents = agents.iter();
    let agents: Vec<Value> = agents
        .map(|[start, goal]| json!({"start": start, "goal": goal}))
        .collect();
    json!({"format": "fleetyard.task/1", "world": "w.world.json", "agents": agents, "robots": {"disc": {
        "footprint": {"disc": {"radius_m": 0.5}}, "model": {"single-integrator": {"speed_m_per_s": 1}}}}})
}

/// A world of 20 by 20 m with obstacles, and a task in it.
fn yard(obstacles: &Value, agents: &[[[f64; 2]; 2]]) -> Yard {
    let yard = Yard::new();
    let world =
        json!({"format": "fleetyard.world/1", "bounds_m": [0, 0, 20, 20], "obstacles": obstacles});
    yard.write("w.world.json", world.to_string());
    yard.write("t.task.json", task(agents).to_string());
    yard
}

/// An answer of a planner.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Answer {
    /// A valid plan.
    Plan,
    /// A valid plan of planners that consider all orders at every place, which no order of priority gives.
    Searched,
    /// No plan: there is none.
    None,
}

/// Asks a planner, whose budget is in nodes too, so that no answer depends on the machine.
fn ask(yard: &Yard, arguments: &str, planner: &str, answer: Answer) {
    let ended = yard.line(&format!(
        "run {arguments} --planner {planner} --budget 2m --format json"
    ));
    if answer == Answer::None && ended.code == Some(INPUT) {
        // What nobody can do is not asked of a planner.
        assert!(ended.stderr.contains("cannot reach its goal"), "{ended}");
        return;
    }
    let record = ended.json();
    let claim = record["claim"].as_str().unwrap_or("none").to_owned();
    let valid = record["verdict"]["valid"] == true && record["judged"]["world"]["valid"] == true;
    match answer {
        Answer::Searched if !SEARCH.contains(&planner) => {
            let gives_up = ["gave-up", "timed-out"].contains(&claim.as_str());
            assert!(valid || gives_up, "{planner}: {ended}");
        }
        Answer::Plan | Answer::Searched => {
            assert!(ended.code == Some(SUCCESS) && valid, "{planner}: {ended}");
            assert_ne!(claim, "infeasible", "{planner}");
        }
        Answer::None => {
            assert_eq!(ended.code, Some(NO_PLAN), "{planner}: {ended}");
            assert!(!valid, "{planner}: {ended}");
        }
    }
}

/// Asks all planners of roadmaps.
fn on_roadmap(
    vertices: &[[f64; 2]],
    edges: &[[usize; 2]],
    directed: bool,
    agents: &[[usize; 2]],
    answer: Answer,
) {
    let ends = agents
        .iter()
        .map(|agent| agent.map(|vertex| vertices[vertex]));
    let yard = yard(&json!([]), &ends.collect::<Vec<_>>());
    let roadmap = json!({"format": "fleetyard.roadmap/1", "directed": directed, "vertices": vertices, "edges": edges});
    yard.write("r.roadmap.json", roadmap.to_string());
    for planner in planners("roadmap") {
        ask(
            &yard,
            "--task t.task.json --roadmap r.roadmap.json --nodes 3000",
            &planner,
            answer,
        );
    }
}

/// Asks all planners of the plane.
fn in_plane(obstacles: &Value, agents: &[[[f64; 2]; 2]], answer: Answer) {
    let yard = yard(obstacles, agents);
    for planner in planners("continuous") {
        if agents.len() == 1 || !is_of_one(&planner) {
            // Controls that are drawn at random lead astray more often than not.
            let is_led_by_chance = ["sst", "k-cbs"].contains(&planner.as_str());
            let nodes = if is_led_by_chance { 30_000 } else { 3000 };
            let task = format!("--task t.task.json --representation continuous --nodes {nodes}");
            ask(&yard, &task, &planner, answer);
        }
    }
}

#[test]
fn one_disc_goes_its_shortest_way_or_stays_where_it_is() {
    let square = [[2.0, 2.0], [8.0, 2.0], [8.0, 8.0], [2.0, 8.0]];
    let edges = [[0, 1], [1, 2], [2, 3], [3, 0], [0, 2]];
    on_roadmap(&square, &edges, false, &[[0, 2]], Answer::Plan);
    on_roadmap(&square, &edges, false, &[[1, 1]], Answer::Plan);
    in_plane(&json!([]), &[[square[0], square[2]]], Answer::Plan);
    in_plane(&json!([]), &[[square[1], square[1]]], Answer::Plan);
}

/// A disc at rest at one of the middle vertices is in the way at all three.
#[test]
fn vertices_nearer_than_two_radii_are_blocked_together() {
    let vertices = [
        [2.0, 5.0],
        [5.0, 5.0],
        [5.6, 5.0],
        [6.2, 5.0],
        [9.0, 5.0],
        [5.6, 7.0],
    ];
    let edges = [[0, 1], [1, 2], [2, 3], [3, 4], [2, 5]];
    on_roadmap(
        &vertices,
        &edges,
        false,
        &[[0, 4], [4, 0]],
        Answer::Searched,
    );
    // One that stays in the middle is passed before it comes.
    on_roadmap(&vertices, &edges, false, &[[5, 2], [0, 4]], Answer::Plan);
}

/// Discs that start in front have to leave first, to whatever is their goal.
#[test]
fn starts_that_block_each_other_are_left_in_turn() {
    let vertices = [
        [2.0, 5.0],
        [4.0, 5.0],
        [6.0, 5.0],
        [8.0, 5.0],
        [10.0, 5.0],
        [10.0, 8.0],
    ];
    let edges = [[0, 1], [1, 2], [2, 3], [3, 4], [4, 5]];
    on_roadmap(
        &vertices,
        &edges,
        false,
        &[[0, 3], [1, 4], [2, 5]],
        Answer::Plan,
    );
    on_roadmap(
        &vertices,
        &edges,
        false,
        &[[2, 5], [1, 4], [0, 3]],
        Answer::Plan,
    );
}

#[test]
fn edges_that_cross_at_an_acute_angle_are_not_used_at_once() {
    let vertices = [[1.0, 5.0], [17.0, 6.2], [1.0, 6.2], [17.0, 5.0]];
    on_roadmap(
        &vertices,
        &[[0, 1], [2, 3]],
        false,
        &[[0, 1], [2, 3]],
        Answer::Plan,
    );
    // Head-on.
    on_roadmap(
        &vertices,
        &[[0, 1], [2, 3]],
        false,
        &[[0, 1], [3, 2]],
        Answer::Plan,
    );
}

#[test]
fn parallel_edges_and_edges_that_are_there_twice_are_fine() {
    let vertices = [
        [2.0, 2.0],
        [10.0, 2.0],
        [2.0, 4.0],
        [10.0, 4.0],
        [5.0, 2.6],
        [14.0, 2.6],
    ];
    let edges = [[0, 1], [2, 3], [0, 1], [4, 5], [0, 2], [1, 3]];
    on_roadmap(&vertices, &edges, false, &[[0, 1], [3, 2]], Answer::Plan);
    // The lane beside is too near for both, one way or the other.
    on_roadmap(&vertices, &edges, false, &[[0, 1], [4, 5]], Answer::Plan);
    on_roadmap(&vertices, &edges, false, &[[1, 0], [4, 5]], Answer::Plan);
}

/// A ring that is driven in one direction.
#[test]
fn directed_edges_are_driven_in_their_direction_alone() {
    let vertices = [[2.0, 2.0], [8.0, 2.0], [8.0, 8.0], [2.0, 8.0], [15.0, 8.0]];
    let ring = [[0, 1], [1, 2], [2, 3], [3, 0]];
    on_roadmap(
        &vertices,
        &ring,
        true,
        &[[0, 3], [1, 0], [2, 1]],
        Answer::Plan,
    );
    // Nothing leads back from the vertex beside the ring.
    let edges = [[0, 1], [1, 2], [2, 3], [3, 0], [2, 4]];
    on_roadmap(&vertices, &edges, true, &[[0, 4], [1, 3]], Answer::Plan);
    on_roadmap(&vertices, &edges, true, &[[4, 0]], Answer::None);
}

#[test]
fn isolated_vertices_are_no_places_to_go_to() {
    let vertices = [[2.0, 2.0], [8.0, 2.0], [8.0, 8.0]];
    on_roadmap(&vertices, &[[0, 1]], false, &[[0, 1]], Answer::Plan);
    on_roadmap(&vertices, &[[0, 1]], false, &[[0, 1], [2, 2]], Answer::Plan);
    on_roadmap(&vertices, &[[0, 1]], false, &[[0, 2]], Answer::None);
}

/// Two that want to change places where nobody can step aside: there is no plan, and no planner looks for it without end.
#[test]
fn who_can_never_pass_each_other_get_no_plan() {
    let vertices = [[2.0, 5.0], [5.0, 5.0], [8.0, 5.0]];
    on_roadmap(
        &vertices,
        &[[0, 1], [1, 2]],
        false,
        &[[0, 2], [2, 0]],
        Answer::None,
    );
    let walls = json!([{"polygon": [[0, 4.3], [20, 4.3], [20, 0], [0, 0]]}, {"polygon": [[0, 5.7], [20, 5.7], [20, 20], [0, 20]]}]);
    in_plane(
        &walls,
        &[[[2.0, 5.0], [18.0, 5.0]], [[18.0, 5.0], [2.0, 5.0]]],
        Answer::None,
    );
}

/// Two vertices at one place are joined by an edge that takes no time.
#[test]
fn edges_may_have_no_length() {
    let vertices = [[2.0, 2.0], [8.0, 2.0], [8.0, 2.0], [8.0, 8.0], [14.0, 2.0]];
    let edges = [[0, 1], [1, 2], [2, 3], [1, 4]];
    on_roadmap(&vertices, &edges, false, &[[0, 3], [4, 0]], Answer::Plan);
    on_roadmap(&vertices, &edges, false, &[[1, 2]], Answer::Plan);
}

/// A door that is hardly wider than a disc, and starts and goals that touch walls and each other.
#[test]
fn discs_pass_narrow_doors_and_touch_what_they_may() {
    let door = json!([{"polygon": [[9, 0], [11, 0], [11, 9.4], [9, 9.4]]}, {"polygon": [[9, 10.6], [11, 10.6], [11, 20], [9, 20]]}]);
    let one = [[3.0, 3.0], [17.0, 3.0]];
    in_plane(&door, &[one], Answer::Plan);
    in_plane(&door, &[one, [[17.0, 17.0], [3.0, 17.0]]], Answer::Searched);
    // From one side of the wall to the other, where the disc touches it.
    in_plane(&door, &[[[8.5, 3.0], [11.5, 3.0]]], Answer::Plan);
    // Two discs with a millimetre between them, and two that touch.
    for (apart, answer) in [(1.001, Answer::Plan), (1.0, Answer::Searched)] {
        let ends = [
            [[3.0, 3.0], [17.0, 3.0]],
            [[3.0 + apart, 3.0], [17.0, 3.0 + apart]],
        ];
        in_plane(&json!([]), &ends, answer);
    }
}

/// Obstacles that overlap are one, and a pocket without a way out has no plan.
#[test]
fn obstacles_overlap_and_enclose() {
    let cross = json!([{"polygon": [[5, 9], [15, 9], [15, 11], [5, 11]]}, {"polygon": [[9, 5], [11, 5], [11, 15], [9, 15]]}]);
    in_plane(&cross, &[[[7.0, 7.0], [13.0, 13.0]]], Answer::Plan);
    in_plane(
        &cross,
        &[[[7.0, 7.0], [13.0, 13.0]], [[13.0, 7.0], [7.0, 13.0]]],
        Answer::Plan,
    );
    let pocket = json!([{"polygon": [[0, 6], [6, 6], [6, 7], [0, 7]]}, {"polygon": [[6, 0], [7, 0], [7, 7], [6, 7]]}]);
    in_plane(&pocket, &[[[3.0, 3.0], [15.0, 15.0]]], Answer::None);
}

/// All of the hall's discs, on a lattice and in the plane.
#[test]
fn two_hundred_discs_cross_a_hall() {
    let hall = root().join("maps/hall.task.json");
    let yard = Yard::new();
    let few = [
        "ccbs",
        "eccbs",
        "cbs-mp",
        "cbs-rrt",
        "db-astar",
        "db-cbs",
        "db-lacam",
        "k-cbs",
        "sssp",
        "tangent",
        "hybrid-astar",
        "rrt-star",
        "sst",
    ];
    for (representation, view) in [
        (
            "roadmap",
            "--representation roadmap --builder lattice --side 1 --sampling uniform",
        ),
        ("continuous", "--representation continuous"),
    ] {
        for planner in planners(representation) {
            if !few.contains(&planner.as_str()) {
                let task = format!("--task {} {view} --nodes 1000", hall.display());
                ask(&yard, &task, &planner, Answer::Plan);
            }
        }
    }
}
