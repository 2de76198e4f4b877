//! The path that meets the fewest, against one found step by step through time.

use fleetyard_plugin_neighborhood::fewest::Fewest;
use fleetyard_plugin_spacetime::conflict::{Conflicts, Rules};
use fleetyard_plugin_spacetime::distance::Distances;
use fleetyard_plugin_spacetime::graph::{Graph, Vertex};
use fleetyard_plugin_spacetime::random::Random;
use fleetyard_plugin_spacetime::sipp::Team;

/// Later than any time.
const NEVER: u32 = u32::MAX;
const SIDE: usize = 5;
const HORIZON: u32 = 60;

/// Number of agents that come to a vertex at a time.
fn coming(team: &Conflicts, v: Vertex, t: u32) -> u32 {
    team.visits(v)
        .iter()
        .filter(|visit| visit.from == t)
        .count() as u32
}

/// Number of collisions in the step from one vertex to another, or in a stay.
fn meetings(team: &Conflicts, v: Vertex, u: Vertex, t: u32) -> u32 {
    if u == v {
        return coming(team, v, t + 1);
    }
    let visits = team.visits(u).iter();
    let there = visits.filter(|visit| visit.from <= t + 1 && t < visit.until);
    let ring = team.rules().rings && team.ring(99, v, u, t).is_some();
    there.count() as u32 + u32::from(team.swaps(99, v, u, t) || ring)
}

/// The least (meetings, length) of a path, step by step through time.
fn by_steps(graph: &Graph, team: &Conflicts, start: Vertex, goal: Vertex) -> (u32, u32) {
    let mut now = vec![NEVER; graph.len()];
    now[start as usize] = 0;
    let mut best = (NEVER, NEVER);
    for t in 0..HORIZON {
        let met = now[goal as usize];
        if met != NEVER {
            let later: u32 = (t + 1..=HORIZON).map(|t| coming(team, goal, t)).sum();
            best = best.min((met + later, t));
        }
        let mut next = vec![NEVER; graph.len()];
        for v in (0..graph.len() as Vertex).filter(|&v| now[v as usize] != NEVER) {
            for u in graph.neighbors(v).chain([v]) {
                let sum = now[v as usize] + meetings(team, v, u, t);
                next[u as usize] = next[u as usize].min(sum);
            }
        }
        now = next;
    }
    best
}

#[test]
fn nobody_meets_fewer_or_is_there_earlier() {
    for seed in 0..300 {
        let mut random = Random::new(seed, 0);
        let passable: Vec<bool> = (0..SIDE * SIDE).map(|_| !random.one_in(6)).collect();
        let graph = Graph::new(SIDE, SIDE, &passable);
        let rules = Rules {
            rings: seed % 2 == 0,
            ..Rules::default()
        };
        let mut team = Conflicts::new(graph.len(), 100, rules);
        let others = 1 + random.below(8);
        for agent in 0..others {
            let mut path = vec![random.below(graph.len()) as Vertex];
            for _ in 0..random.below(20) {
                let v = path[path.len() - 1];
                let step = random.below(graph.degree(v) as usize + 1);
                path.push(graph.neighbors(v).nth(step).unwrap_or(v));
            }
            team.set(agent, &path);
        }
        let (start, goal) = (
            random.below(graph.len()) as Vertex,
            random.below(graph.len()) as Vertex,
        );
        let goals = [goal];
        let mut distances = Distances::new(&graph, &goals);
        distances.complete(&mut || false);
        let known = distances.team(&goals);
        let route = known.route(0);
        let mut search = Fewest::default();
        let found = search.plan(&graph, &team, (99, start), &route, &mut random, &mut || {
            false
        });
        let expected = by_steps(&graph, &team, start, goal);
        let Some(path) = found else {
            assert_eq!(expected, (NEVER, NEVER), "seed {seed}");
            continue;
        };
        assert_eq!((path[0], path[path.len() - 1]), (start, goal));
        let length = path.len() as u32 - 1;
        let steps = path.windows(2).zip(0..);
        let on_the_way: u32 = steps
            .map(|(step, t)| meetings(&team, step[0], step[1], t))
            .sum();
        let later: u32 = (length + 1..=HORIZON).map(|t| coming(&team, goal, t)).sum();
        assert_eq!((on_the_way + later, length), expected, "seed {seed}");
    }
}
