//! The planner `tangent`: its paths beside a search over many places, and what it refuses.

use std::sync::Arc;

use fleetyard_abi::sdk::{Failure, Options, Planner, Plugin};
use fleetyard_abi::{
    Budget, Environment, Footprint, Instance, Plan, Robot, State, Status, WorkspaceEnvironment,
    monotonic_ns,
};
use fleetyard_plugin_plane::Vector;
use fleetyard_plugin_plane::bins::Rectangle;
use fleetyard_plugin_plane::obstacles::Obstacles;
use fleetyard_plugin_plane::plugin::shortest::ShortestTangents;
use fleetyard_plugin_plane::tangent::Tangents;
use fleetyard_testkit::Notes;

use super::ways::{Numbers, RADIUS, SIDE, clear, sampled};

fn bounds() -> Rectangle {
    Rectangle {
        min: Vector::zeros(),
        max: Vector::repeat(SIDE),
    }
}

/// More and smaller polygons than elsewhere, most of which overlap, and ends that touch one of them or the border.
#[test]
fn ways_from_where_a_disc_touches_are_as_short_as_those_over_many_places() {
    let (mut numbers, mut found, mut blocked) = (Numbers(11), 0, 0);
    for _ in 0..60 {
        let polygons: Vec<Vec<Vector>> = (0..6).map(|_| numbers.polygon()).collect();
        let end = |numbers: &mut Numbers| {
            let polygon = &polygons[(numbers.next() * 6.0) as usize];
            let obstacles = Obstacles::new(polygons.clone(), bounds(), RADIUS);
            // Beside the middle of an edge, or at the border.
            let beside = (0..polygon.len()).map(|at| {
                let (a, b) = (polygon[at], polygon[(at + 1) % polygon.len()]);
                let along = (b - a).normalize();
                (a + b) / 2.0 + Vector::new(-along.y, along.x) * (RADIUS + 1e-9)
            });
            let border = [Vector::new(RADIUS, numbers.place().y)];
            beside.chain(border).find(|at| obstacles.free(*at))
        };
        let (Some(start), Some(goal)) = (end(&mut numbers), end(&mut numbers)) else {
            continue;
        };
        if start == goal {
            continue;
        }
        let obstacles = Obstacles::new(polygons.clone(), bounds(), RADIUS);
        let mut tangents = Tangents::with_step(&obstacles, 0.035);
        let way = tangents.shortest(start, goal, &mut || false);
        let over_places = sampled(&polygons, start, goal);
        let Some(way) = way else {
            assert!(
                over_places.is_infinite(),
                "a way of {over_places} m was not found"
            );
            blocked += 1;
            continue;
        };
        found += 1;
        let driven = way.places.windows(2);
        assert!(driven.clone().all(|leg| clear(&polygons, leg[0], leg[1])));
        let driven: f64 = driven.map(|leg| (leg[1] - leg[0]).norm()).sum();
        assert!(way.length <= driven + 1e-9 && driven <= way.length * 1.0002);
        assert!(
            way.length < over_places + 1e-4,
            "{way:?}, but {over_places} m would do"
        );
        assert!(
            way.length > over_places * 0.99,
            "{way:?}, but {over_places} m over places"
        );
    }
    assert!(found > 15 && blocked > 2, "{found} ways, {blocked} without");
}

/// Plans for discs from `[x, y]` to `[x, y]` in a world of 6 by 4 m with these obstacles.
fn planned(
    obstacles: &[[[f64; 2]; 4]],
    discs: &[[[f64; 2]; 2]],
    options: &str,
    nodes: u64,
) -> (Result<(), Failure>, Notes) {
    let environment = Environment::from(WorkspaceEnvironment {
        min_m: [0.0, 0.0],
        max_m: [6.0, 4.0],
        obstacles: obstacles.iter().copied().collect(),
        movers: Vec::new(),
    });
    let robot = Robot {
        name: "disc".into(),
        footprint: Footprint::disc(0.3),
        dynamics: "fleetyard.single-integrator/1".into(),
        has_heading: false,
        polar_state: false,
        polar_control: true,
        state_limits: vec![[None; 2]; 2],
        control_limits: vec![[Some(-2.0), Some(2.0)]; 2],
        parameters: Vec::new(),
    };
    let instance = Instance {
        start_states: discs
            .iter()
            .map(|[start, _]| State(start.to_vec()))
            .collect(),
        goal_states: discs
            .iter()
            .map(|[_, goal]| [State(goal.to_vec())])
            .collect(),
        robots: vec![robot],
        ..Instance::default()
    };
    let mut budget = Budget::lasting(monotonic_ns(), 60_000_000_000);
    budget.nodes = nodes;
    let notes = Notes::default();
    let mut planner = ShortestTangents::create(Options::new(options)).unwrap();
    let mut world = planner
        .prepare(&Arc::new(environment), &budget, &notes)
        .unwrap();
    let end = planner.plan(&mut world, &instance, &budget, &notes);
    (end, notes)
}

const BLOCK: [[f64; 2]; 4] = [[2.5, 1.0], [3.5, 1.0], [3.5, 3.0], [2.5, 3.0]];
const ACROSS: [[f64; 2]; 2] = [[1.0, 2.0], [5.0, 2.0]];

fn figure(notes: &Notes, name: &str) -> f64 {
    let figures = notes.figures.lock().unwrap();
    let found = figures.iter().find(|(known, _)| known == name);
    found.unwrap().1
}

#[test]
fn a_path_takes_its_length_at_full_speed_and_says_how_long_it_is_with_true_arcs() {
    let (end, notes) = planned(&[BLOCK], &[ACROSS], "{}", 0);
    end.unwrap();
    let plans = notes.others.lock().unwrap();
    let [Plan::Trajectories(plan)] = plans.as_slice() else {
        panic!("{plans:?}");
    };
    let knots = &plan.knots()[0];
    let arrival = knots[knots.len() - 1].time_s;
    // Two tangents from 1.5 m beside and 1 m below a corner, two arcs that end on the top edge, and that edge.
    let (square, radius): (f64, f64) = (1.5 * 1.5 + 1.0, 0.3);
    let tangent = (square - radius * radius).sqrt();
    let rise = 1.0_f64.atan2(1.5) + radius.atan2(tangent);
    let wanted = 2.0 * (tangent + radius * rise) + 1.0;
    let length = figure(&notes, "length_m");
    assert!((length - wanted).abs() < 1e-5, "{length} m, not {wanted} m");
    assert!(arrival * 2.0 >= length - 1e-9 && arrival * 2.0 < length * 1.0002);
}

#[test]
fn clearance_is_kept_where_there_is_room() {
    let length = |options: &str| {
        let (end, notes) = planned(&[BLOCK], &[ACROSS], options, 0);
        end.unwrap();
        figure(&notes, "length_m")
    };
    let touching = length("{}");
    assert!(length(r#"{"clearance_m": 0.1}"#) > touching + 0.05);
    // There is a metre between block and border, and 0.5 m of clearance want 1.6 m.
    assert!((length(r#"{"clearance_m": 0.5}"#) - touching).abs() < 1e-12);
}

#[test]
fn teams_and_closed_rooms_are_told_apart() {
    let wall = [[2.9, 0.0], [3.1, 0.0], [3.1, 4.0], [2.9, 4.0]];
    let failure =
        |obstacles: &[_], discs: &[_], nodes| planned(obstacles, discs, "{}", nodes).0.unwrap_err();
    assert_eq!(failure(&[wall], &[ACROSS], 0).status, Status::Infeasible);
    assert_eq!(failure(&[BLOCK], &[ACROSS], 2).status, Status::GaveUp);
    let team = failure(&[], &[ACROSS, [[1.0, 1.0], [5.0, 1.0]]], 0);
    assert_eq!(team.status, Status::Unsupported);
    assert!(team.message.contains("si-tangent"), "{}", team.message);
}
