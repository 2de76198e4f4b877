//! Ways whose turns cost, against a search that is obviously right.

use std::sync::Arc;

use fleetyard_plugin_mapf::streets::Survey;
use fleetyard_plugin_mapf::streets::ways::{FAR, Moves, Ways, quarters};
use fleetyard_plugin_spacetime::graph::{DIRECTIONS, Graph, Vertex};
use fleetyard_plugin_spacetime::lanes::Lanes;
use fleetyard_plugin_spacetime::random::Random;

/// Relaxes cells and headings until nothing changes.
fn by_relaxing(
    graph: &Graph,
    goal: Vertex,
    toll: impl Fn(Vertex, usize) -> Option<u32>,
    turn: u32,
) -> Vec<[u32; DIRECTIONS]> {
    let mut rest = vec![[FAR; DIRECTIONS]; graph.len()];
    rest[goal as usize] = [0; DIRECTIONS];
    loop {
        let mut changed = false;
        for v in 0..graph.len() as Vertex {
            for h in 0..DIRECTIONS {
                for d in 0..DIRECTIONS {
                    let u = graph.around(v)[d];
                    let Some(toll) = toll(v, d).filter(|_| u != graph.wall()) else {
                        continue;
                    };
                    let way = turn * quarters(h as u8, d) + toll + rest[u as usize][d];
                    if way < rest[v as usize][h] {
                        rest[v as usize][h] = way;
                        changed = true;
                    }
                }
            }
        }
        if !changed {
            return rest;
        }
    }
}

#[test]
fn ways_are_those_of_relaxing_cells_and_headings() {
    for seed in 0..120 {
        let mut random = Random::new(seed, 0);
        let side = if seed < 60 { 7 } else { 40 };
        let (rows, cols) = (1 + random.below(side), 1 + random.below(side));
        let passable: Vec<bool> = (0..rows * cols).map(|_| !random.one_in(4)).collect();
        let graph = Graph::new(rows, cols, &passable);
        if graph.is_empty() {
            continue;
        }
        let turn = random.below(30) as u32;
        // Costs between which the bound of the search tells, and such between which it does not.
        let spread = if random.one_in(2) { 50 } else { 15 };
        let table: Vec<[u32; DIRECTIONS]> = (0..graph.len())
            .map(|_| [(); DIRECTIONS].map(|()| random.below(spread) as u32))
            .collect();
        // A fifth of the moves are barred.
        let toll = |v: Vertex, d: usize| match table[v as usize][d] {
            0..10 => None,
            toll => Some(toll),
        };
        let mut any = || random.below(graph.len()) as Vertex;
        let (goal, towards) = (any(), any());
        let moves = Moves::new(&graph, |v, d| toll(v, d).is_some());
        let tolls = moves.tolls(turn, |v, d| toll(v, d).unwrap_or(0));
        let ways = Ways::new(&graph, &moves, goal, towards, &tolls);
        let known = by_relaxing(&graph, goal, toll, turn);
        // The answers are the same whatever was asked before.
        let mut order: Vec<Vertex> = (0..graph.len() as Vertex).collect();
        random.shuffle(&mut order);
        for (number, v) in [towards].into_iter().chain(order).enumerate() {
            let known = known[v as usize];
            let rest = |heading| ways.from(&moves, v, heading, &tolls).min(FAR);
            if number % 3 > 0 {
                assert_eq!(Some(&rest(None)), known.iter().min(), "seed {seed}");
            }
            if number % 3 > 1 {
                continue;
            }
            let by_heading = [0, 1, 2, 3].map(|heading| rest(Some(heading)));
            assert_eq!(by_heading, known, "seed {seed}");
            for (heading, &rest) in (0..).zip(&known) {
                let best = ways.best(&moves, v, Some(heading), &tolls);
                assert_eq!(best.is_some(), v != goal && rest < FAR);
                let along = |d: usize| {
                    let number = moves.away(v, d).unwrap();
                    ways.along(&moves, number, d, Some(heading), &tolls)
                };
                assert!(best.is_none_or(|d| along(d) == rest), "seed {seed}");
            }
        }
    }
}

/// Cells that can be reached from one, along the moves that `may` lets pass.
fn reached(graph: &Graph, from: Vertex, may: impl Fn(Vertex, usize) -> bool) -> Vec<bool> {
    let mut seen = vec![false; graph.len()];
    let mut stack = vec![from];
    while let Some(v) = stack.pop() {
        if std::mem::replace(&mut seen[v as usize], true) {
            continue;
        }
        for (d, &u) in graph.around(v).iter().enumerate() {
            if u != graph.wall() && may(v, d) {
                stack.push(u);
            }
        }
    }
    seen
}

#[test]
fn without_barred_moves_every_cell_is_still_reached_from_every_other() {
    let (mut by_lanes, mut by_doors) = (0, 0);
    for seed in 0..120 {
        let mut random = Random::new(seed, 1);
        let (rows, cols) = (1 + random.below(12), 1 + random.below(12));
        let blocked = random.below(5);
        let passable: Vec<bool> = (0..rows * cols)
            .map(|_| random.below(10) >= blocked)
            .collect();
        let graph = Arc::new(Graph::new(rows, cols, &passable));
        let lanes = Lanes::new(&graph, 4);
        let streets = Survey::new(&graph, 4, 1.0, 1 << 20).finish();
        for v in 0..graph.len() as Vertex {
            for d in (0..DIRECTIONS).filter(|d| graph.around(v)[*d] != graph.wall()) {
                by_lanes += usize::from(lanes.is_barred(v, d));
                by_doors += usize::from(!lanes.is_barred(v, d) && !streets.may(v, d));
            }
            assert_eq!(
                reached(&graph, v, |v, d| streets.may(v, d)),
                reached(&graph, v, |_, _| true),
                "seed {seed}, from {v}"
            );
        }
    }
    assert!(by_lanes > 1000 && by_doors > 50, "{by_lanes}, {by_doors}");
}

/// Costs are what they are at least where there is no time for a search; and what they are once there is.
#[test]
fn without_time_costs_are_what_they_are_at_least() {
    let mut random = Random::new(9, 0);
    let passable: Vec<bool> = (0..900).map(|_| !random.one_in(5)).collect();
    let graph = Graph::new(30, 30, &passable);
    let moves = Moves::new(&graph, |_, _| true);
    let tolls = moves.tolls(7, |v, _| 4 + v % 3);
    let (goal, far) = (5, graph.len() as Vertex - 9);
    let exact = Ways::new(&graph, &moves, goal, far, &tolls);
    let hasty = Ways::new(&graph, &moves, goal, far, &tolls);
    let (mut less, mut same) = (0, 0);
    // From the goal on: what is near is known first.
    for v in 0..graph.len() as Vertex {
        tolls.search_until(u64::MAX);
        let cost = exact.from(&moves, v, Some(1), &tolls);
        tolls.search_until(if v % 97 == 0 { u64::MAX } else { 0 });
        let least = hasty.from(&moves, v, Some(1), &tolls);
        assert!(least <= cost, "{v}: {least} > {cost}");
        assert!(v % 97 > 0 || least == cost, "{v}: {least} != {cost}");
        less += u32::from(least < cost);
        same += u32::from(least == cost);
    }
    assert!(less > 50 && same > 50, "{less}, {same}");
}

/// The directions in which one may go from each cell of a map.
fn ways_out(map: &[&str]) -> Vec<String> {
    let passable: Vec<bool> = map.concat().bytes().map(|cell| cell == b'.').collect();
    let graph = Arc::new(Graph::new(map.len(), map[0].len(), &passable));
    let streets = Survey::new(&graph, 4, 1.0, 1 << 20).finish();
    let from = |cell| {
        let v = graph.vertex(cell as u32)?;
        let may = (0..DIRECTIONS).filter(|d| streets.may(v, *d));
        Some(may.map(|d| char::from(b"NESW"[d])).collect())
    };
    (0..passable.len())
        .map(|cell| from(cell).unwrap_or_default())
        .collect()
}

#[test]
fn of_two_doors_one_leads_back() {
    let rooms = ["..@..", ".....", "..@..", "..@..", ".....", "..@.."];
    let ways = ways_out(&rooms);
    let doors = [&ways[7], &ways[22]].map(String::as_str);
    assert!(matches!(doors, ["E", "W"] | ["W", "E"]), "{doors:?}");
    // A single one has to be driven both ways.
    let ways = ways_out(&rooms[..3]);
    assert_eq!(ways[7], "EW");
}
