//! The planner `si-tangent`: whoever is given a plan keeps clear of everybody and everything, and dense teams get one.

use fleetyard_plugin_plane::Vector;
use fleetyard_plugin_plane::bins::Rectangle;
use fleetyard_plugin_plane::obstacles::Obstacles;
use fleetyard_plugin_plane::orders::End;
use fleetyard_plugin_plane::prioritised::{self, Disc, World};
use fleetyard_plugin_plane::tangent::Tangents;
use fleetyard_plugin_plane::team::plan::{Effort, Figures, Outcome, plan};
use fleetyard_plugin_plane::team::search::Control;
use fleetyard_plugin_plane::timing::Stop;
use proptest::prelude::*;

use super::cases;
use super::teams::{discs, judge, mover, polygons, world};
use super::ways::Numbers;

const EFFORT: Effort = Effort {
    clearance: 0.0,
    neighborhood: 4,
    rounds: 0,
    memory: 0,
    seed: 1,
};

/// The plans that were told of, in their order, and the end.
fn planned(
    world: &World,
    discs: &[Disc],
    effort: Effort,
    nodes: u64,
) -> (Outcome, Figures, Vec<Vec<Vec<Stop>>>) {
    let mut told = Vec::new();
    let mut control = Control {
        stop: &mut || false,
        nodes,
        searches: 0,
        expanded: 0,
    };
    let (outcome, figures) = plan(world, discs, effort, &mut control, &mut |plans| {
        told.push(plans.to_vec());
    });
    assert!(control.searches <= nodes);
    (outcome, figures, told)
}

fn cost(plans: &[Vec<Stop>]) -> f64 {
    plans
        .iter()
        .map(|stops| stops[stops.len() - 1].arrival)
        .sum()
}

proptest! {
    #![proptest_config(cases(60))]

    #[test]
    fn every_plan_keeps_clear_and_is_cheaper_than_the_one_before(
        discs in discs(),
        seed in 0..3_u64,
        moved in prop::bool::ANY,
    ) {
        let world = World {
            movers: moved.then(mover).into_iter().collect(),
            ..world(polygons())
        };
        let effort = Effort {
            clearance: if seed == 2 { 0.01 } else { 0.0 },
            rounds: 70,
            seed,
            ..EFFORT
        };
        let found = planned(&world, &discs, effort, u64::MAX);
        prop_assert_eq!(&found, &planned(&world, &discs, effort, u64::MAX));
        let (outcome, _, told) = found;
        if outcome != Outcome::Solved {
            prop_assert!(moved || discs.len() > 1, "one disc alone has a way");
            let effort = prioritised::Effort { clearance: 0.0, limit: 10, seed };
            let other = prioritised::plan(&world, &discs, effort, &mut || false);
            let solved = matches!(other, prioritised::Outcome::Ordered { end: End::Solved(_), .. });
            prop_assert!(!solved, "orders of priority solve it");
        }
        for plans in &told {
            judge(&world, &discs, plans)?;
        }
        for pair in told.windows(2) {
            prop_assert!(cost(&pair[1]) < cost(&pair[0]));
        }
    }

    #[test]
    fn a_disc_alone_goes_a_shortest_way(seed in 0..1000_u64) {
        let mut numbers = Numbers(seed);
        let polygons: Vec<Vec<Vector>> = (0..4).map(|_| numbers.polygon()).collect();
        let (start, goal) = (numbers.place(), numbers.place());
        let bounds = Rectangle { min: Vector::zeros(), max: Vector::repeat(6.0) };
        let obstacles = Obstacles::new(polygons.clone(), bounds, 0.3);
        let way = Tangents::new(&obstacles).shortest(start, goal, &mut || false);
        let discs = [Disc { radius: 0.3, speed: 2.0, start, goal }];
        let world = World { polygons, bounds, movers: Vec::new() };
        let (outcome, _, told) = planned(&world, &discs, EFFORT, u64::MAX);
        match way {
            None => prop_assert_eq!(outcome, Outcome::NoWay(0)),
            Some(way) => {
                let driven = 2.0 * cost(&told[0]);
                prop_assert!(driven > way.length - 1e-6);
                // It has few places round a corner, which want a little more room.
                let roomy = Obstacles::new(world.polygons.clone(), bounds, 0.3 * 1.016);
                let way = Tangents::new(&roomy).shortest(start, goal, &mut || false);
                let most = way.map_or(f64::INFINITY, |way| way.length);
                prop_assert!(driven <= most + 1e-6, "{} m, not {} m", driven, most);
                judge(&world, &discs, &told[0])?;
            }
        }
    }
}

fn block(left: f64, bottom: f64, right: f64, top: f64) -> Vec<Vector> {
    [(left, bottom), (right, bottom), (right, top), (left, top)]
        .map(|(x, y)| Vector::new(x, y))
        .to_vec()
}

fn disc(start: [f64; 2], goal: [f64; 2]) -> Disc {
    Disc {
        radius: 0.2,
        speed: 1.0,
        start: start.into(),
        goal: goal.into(),
    }
}

/// A world of that size with these blocks.
fn room(width: f64, height: f64, polygons: Vec<Vec<Vector>>) -> World {
    World {
        polygons,
        bounds: Rectangle {
            min: Vector::zeros(),
            max: Vector::new(width, height),
        },
        movers: Vec::new(),
    }
}

#[track_caller]
fn solves(world: &World, discs: &[Disc]) -> f64 {
    let (outcome, figures, told) = planned(world, discs, EFFORT, u64::MAX);
    assert_eq!(outcome, Outcome::Solved, "{figures:?}");
    judge(world, discs, &told[0]).unwrap();
    cost(&told[0])
}

#[test]
fn discs_that_meet_in_a_corridor_use_the_bay_beside_it() {
    // A corridor of 0.5 m, with a bay of 0.6 m to one side.
    let walls = vec![block(0.0, 0.5, 3.7, 2.0), block(4.3, 0.5, 8.0, 2.0)];
    let world = room(8.0, 2.0, walls);
    let pair = [
        disc([0.5, 0.25], [7.5, 0.25]),
        disc([7.5, 0.25], [0.5, 0.25]),
    ];
    let cost = solves(&world, &pair);
    assert!(cost < 24.0, "{cost}");
}

#[test]
fn who_stands_in_a_doorway_makes_room() {
    let walls = vec![block(2.9, 0.0, 3.1, 1.7), block(2.9, 2.3, 3.1, 4.0)];
    let world = room(6.0, 4.0, walls);
    // One begins in the door, and its goal is behind the one that wants to pass it.
    let discs = [
        disc([3.0, 2.0], [1.0, 2.0]),
        disc([2.0, 2.0], [5.0, 2.0]),
        disc([4.0, 2.0], [3.0, 2.0]),
    ];
    solves(&world, &discs);
}

#[test]
fn each_disc_squeezes_through_the_gap_that_is_on_its_way() {
    // Three rooms, and between them gaps from tip to tip that are wider than the discs by a two-hundredth. The tips are of 45
    // degrees, so that a place of the ground would be right between them.
    let tip = |x: f64, from: f64, to: f64| {
        let half = (to - from).abs() * 22.5_f64.to_radians().tan();
        [(x - half, from), (x + half, from), (x, to)]
            .map(|(x, y)| Vector::new(x, y))
            .to_vec()
    };
    let (low, high) = (2.0 - 0.201, 2.0 + 0.201);
    let walls = vec![
        tip(2.0, 0.0, low),
        tip(2.0, 4.0, high),
        tip(4.0, 0.0, low),
        tip(4.0, 4.0, high),
    ];
    let world = room(6.0, 4.0, walls);
    let discs = [
        disc([1.0, 1.0], [3.0, 1.0]),
        disc([3.0, 3.0], [5.0, 3.0]),
        disc([5.0, 1.0], [1.0, 3.0]),
    ];
    solves(&world, &discs[..2]);
    solves(&world, &discs);
}

#[test]
fn discs_that_touch_in_a_block_change_places() {
    // Nine discs that touch each other, everybody to the opposite place.
    let at = |number: usize| {
        let (row, column) = (number / 3, number % 3);
        [1.6 + 0.4 * column as f64, 1.6 + 0.4 * row as f64]
    };
    let discs: Vec<Disc> = (0..9)
        .map(|number| disc(at(number), at(8 - number)))
        .collect();
    solves(&room(4.0, 4.0, Vec::new()), &discs);
}

/// Discs at places of a lattice, in another order at their goals.
fn crowd(count: usize, columns: usize, apart: f64) -> Vec<Disc> {
    let mut numbers = Numbers(5);
    let mut goals: Vec<usize> = (0..count).collect();
    for last in (1..count).rev() {
        goals.swap(last, (numbers.next() * (last + 1) as f64) as usize);
    }
    let at =
        |place: usize| [place % columns, place / columns].map(|each| (each as f64 + 0.5) * apart);
    (0..count)
        .map(|number| disc(at(number), at(goals[number])))
        .collect()
}

#[test]
fn two_hundred_discs_find_their_ways() {
    let discs = crowd(200, 20, 1.0);
    let world = room(20.0, 10.0, Vec::new());
    let cost = solves(&world, &discs);
    let least: f64 = discs
        .iter()
        .map(|disc| (disc.goal - disc.start).norm())
        .sum();
    assert!(cost < 1.5 * least, "{cost} s, alone {least} s");
}

#[test]
fn limits_end_a_run() {
    let (world, discs) = (room(5.0, 5.0, Vec::new()), crowd(25, 5, 1.0));
    let (outcome, _, told) = planned(&world, &discs, EFFORT, 30);
    assert_eq!((outcome, told.len()), (Outcome::Stopped, 0));
    let effort = Effort {
        rounds: u64::MAX,
        ..EFFORT
    };
    let (outcome, _, told) = planned(&world, &discs, effort, 2000);
    assert_eq!(outcome, Outcome::Solved);
    assert!(told.len() > 1);
    // With little memory there are few places to wait at.
    let effort = Effort {
        memory: 1 << 20,
        ..EFFORT
    };
    let (outcome, _, told) = planned(&world, &discs, effort, u64::MAX);
    if outcome == Outcome::Solved {
        judge(&world, &discs, &told[0]).unwrap();
    }
}

#[test]
fn who_cannot_get_out_of_its_room_is_named() {
    let world = room(6.0, 4.0, vec![block(2.9, 0.0, 3.1, 4.0)]);
    let discs = [disc([1.0, 1.0], [2.0, 1.0]), disc([1.0, 3.0], [5.0, 3.0])];
    let (outcome, _, told) = planned(&world, &discs, EFFORT, u64::MAX);
    assert_eq!((outcome, told.len()), (Outcome::NoWay(1), 0));
}
