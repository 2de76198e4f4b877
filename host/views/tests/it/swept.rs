//! Roadmaps in a world: which robots can drive which edges.

use fleetyard_core::Roadmap;
use fleetyard_views::{Builder, RoadmapSpec, load_problem, roadmap_to_world, world_to_roadmap};

use crate::tasks::{TASKS, maps, problem_in};

/// A wall with a gap of 1 m at the top, and two ways: through the gap, and through the wall.
#[test]
fn an_edge_is_as_wide_as_the_robot() {
    let wall = r#"{"rectangle": {"center": [2, 1.5], "size": [0.2, 3]}}"#;
    let agents = r#"{"start": [1, 3.5], "goal": [3, 3.5]}, {"start": [1, 1], "goal": [3, 1]}"#;
    let problem = problem_in(wall, agents).unwrap();
    let (x, y) = (vec![1.0, 3.0, 1.0, 3.0], vec![3.5, 3.5, 1.0, 1.0]);
    let both = |edges: &[(u32, u32)]| {
        let ways = edges.iter().flat_map(|(a, b)| [(*a, *b), (*b, *a)]);
        Roadmap::new(x.clone(), y.clone(), ways).unwrap()
    };
    let all = both(&[(0, 1), (2, 3), (0, 2), (1, 3)]);
    let view = roadmap_to_world(&problem, &all).unwrap();
    assert_eq!(view.edges.len(), 1);
    assert_eq!((view.edges[0].free, view.edges[0].agents), (3, 2));
    assert_eq!(view.edges[0].blocked, [[2, 3]]);
    assert!(view.cut_off.is_empty());
    let about = view.about();
    assert_eq!(about["origin"]["operator"], "roadmap-to-world");
    assert_eq!(about["origin"]["roadmap_digest"], all.digest().to_string());
    assert_eq!(
        about["origin"]["world_digest"],
        problem.world.digest().to_string()
    );
    // Without the way up the second agent is cut off, and lower the gap is too narrow for everybody.
    let view = roadmap_to_world(&problem, &both(&[(0, 1), (2, 3), (1, 3)])).unwrap();
    assert_eq!(view.cut_off, [1]);
    let low = problem_in(wall, r#"{"start": [1, 3.2], "goal": [3, 3.2]}"#).unwrap();
    let row = Roadmap::new(vec![1.0, 3.0], vec![3.2, 3.2], [(0, 1)]).unwrap();
    let view = roadmap_to_world(&low, &row).unwrap();
    assert_eq!((view.edges[0].free, view.cut_off), (0, vec![0]));
    let error = roadmap_to_world(&low, &all).unwrap_err();
    assert!(
        error
            .reason
            .contains("the start of agent 0 is 0.300 m from"),
        "{error}"
    );
}

/// The edges of a roadmap that was made for the largest robot are free for every robot.
#[test]
fn made_for_the_largest_is_free_for_all() {
    for name in TASKS {
        let problem = load_problem(maps(name)).unwrap();
        let spec = RoadmapSpec::new(Builder::Tangent { sides: 16 });
        let roadmap = world_to_roadmap(&problem, spec).unwrap().roadmap;
        let view = roadmap_to_world(&problem, &roadmap).unwrap();
        assert!(view.cut_off.is_empty(), "{name}");
        for edges in &view.edges {
            assert!(edges.blocked.is_empty(), "{name}");
            assert_eq!(2 * edges.free, roadmap.edge_count());
        }
        let agents: usize = view.edges.iter().map(|edges| edges.agents).sum();
        assert_eq!(agents, problem.task.agents.len());
        assert!(view.edges.is_sorted_by(|a, b| a.radius_m < b.radius_m));
    }
}
