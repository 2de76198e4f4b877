//! Conflict-based search in continuous time: held against an exact search of walks and their times, and against published
//! costs.

use std::fs;
use std::path::Path as File;

use fleetyard_plugin_plane::Vector;
use fleetyard_plugin_plane::orders::End as Ended;
use fleetyard_plugin_roadmap::closeness::Closeness;
use fleetyard_plugin_roadmap::conflict::{Branching, End, Outcome, Settings, solve};
use fleetyard_plugin_roadmap::priority::sum_of_costs;
use fleetyard_plugin_roadmap::roadmap::{Edge, Roadmap, Vertex};
use proptest::prelude::*;

use super::support::{Case, least_distance, planned};
use super::{SEPARATION, judge_path, lattice, roadmap, tasks};

fn searched(roadmap: &Roadmap, tasks: &[(Vertex, Vertex)], settings: &Settings) -> Outcome {
    let closeness = Closeness::new(roadmap.clone());
    solve(&closeness, tasks, settings, &mut || false)
}

fn limited(nodes: u64) -> Settings {
    Settings {
        node_limit: Some(nodes),
        ..Settings::default()
    }
}

/// Both directions of edges between places, at 1 m/s.
fn undirected(places: &[(f64, f64)], edges: &[(Vertex, Vertex)], separation: f64) -> Roadmap {
    let places: Vec<Vector> = places.iter().map(|(x, y)| Vector::new(*x, *y)).collect();
    let seconds = |a: Vertex, b: Vertex| (places[a as usize] - places[b as usize]).norm();
    let both = |(a, b): &(Vertex, Vertex)| [(*a, *b, seconds(*a, *b)), (*b, *a, seconds(*a, *b))];
    let edges: Vec<_> = edges.iter().flat_map(both).collect();
    Roadmap::new(places.clone(), edges, separation).unwrap()
}

/// The counterexample of Combrink, Roselli, Fabian (arXiv 2508.16410), for which CCBS's own program finds 10.707: an agent has to
/// leave its goal for another one, and others pass where it goes.
fn counterexample() -> (Roadmap, Vec<(Vertex, Vertex)>) {
    let places = [
        (0.0, 1.0),
        (1.0, 1.0),
        (2.0, 1.0),
        (3.0, 1.0),
        (0.5, 0.0),
        (2.0, 0.0),
        (3.0, 0.0),
    ];
    let edges = [(0, 1), (1, 2), (2, 3), (2, 5), (4, 5), (5, 6)];
    let roadmap = undirected(&places, &edges, 2.0_f64.sqrt() / 2.0);
    (roadmap, vec![(4, 6), (5, 5), (1, 3), (0, 1)])
}

#[test]
fn the_published_counterexample_costs_nine() {
    let (roadmap, tasks) = counterexample();
    let sound = searched(&roadmap, &tasks, &Settings::default());
    assert_eq!(sound.end, End::Solved);
    assert!((sound.cost - 9.0).abs() < 1e-4, "{}", sound.cost);
    assert!((sound.lower_bound - sound.cost).abs() < 1e-6);
    assert!(least_distance(&roadmap, &sound.paths) > roadmap.separation(0, 0) - 1e-7);
    let original = Settings {
        branching: Branching::Original,
        ..Settings::default()
    };
    let original = searched(&roadmap, &tasks, &original);
    assert_eq!((original.end, original.lower_bound), (End::Solved, 0.0));
    assert!(original.cost > sound.cost - 1e-6);
}

#[test]
fn a_search_for_a_plan_that_is_not_there_ends_at_its_limits() {
    // Two discs have to swap on a line: nobody can step aside.
    let places = [(0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (3.0, 0.0)];
    let line = undirected(&places, &[(0, 1), (1, 2), (2, 3)], SEPARATION);
    for tasks in [[(0, 3), (3, 0)], [(1, 2), (2, 1)]] {
        for branching in [Branching::Sound, Branching::Original] {
            let settings = Settings {
                branching,
                ..limited(2000)
            };
            let outcome = searched(&line, &tasks, &settings);
            assert_ne!(outcome.end, End::Solved);
            assert!(outcome.expanded <= 2000 && outcome.paths.is_empty());
        }
    }
    let small = Settings {
        memory_limit: 1 << 16,
        ..limited(100_000)
    };
    let outcome = searched(&line, &[(0, 3), (3, 0)], &small);
    assert_ne!(outcome.end, End::Solved);
    let called = std::cell::Cell::new(0);
    let closeness = Closeness::new(line.clone());
    let stopped = solve(
        &closeness,
        &[(0, 3), (3, 0)],
        &Settings::default(),
        &mut || {
            called.set(called.get() + 1);
            called.get() > 50
        },
    );
    assert_eq!(stopped.end, End::Stopped);
}

#[test]
fn what_cannot_be_is_proven() {
    let places = [(0.0, 0.0), (2.0, 0.0), (2.0, 0.2), (9.0, 9.0)];
    let roadmap = undirected(&places, &[(0, 1), (0, 2)], SEPARATION);
    let end = |tasks: &[(Vertex, Vertex)]| searched(&roadmap, tasks, &limited(1000)).end;
    // Goals, or starts, closer than two radii; a goal that no way leads to; and somebody who cannot leave.
    assert_eq!(end(&[(0, 1), (3, 2)]), End::Infeasible);
    assert_eq!(end(&[(1, 0), (2, 2)]), End::Infeasible);
    assert_eq!(end(&[(0, 3)]), End::Infeasible);
    assert_eq!(end(&[(3, 3), (0, 1)]), End::Solved);
    assert_eq!(end(&[]), End::Solved);
    // The goal of one is where the other has to stay.
    let places = [(0.0, 0.0), (1.0, 0.0), (2.0, 0.0)];
    let one_way = |from: Vertex, to: Vertex| (from, to, 1.0);
    let places = places.map(|(x, y)| Vector::new(x, y)).to_vec();
    let edges = [one_way(0, 1), one_way(1, 2)];
    let roadmap = Roadmap::new(places, edges, SEPARATION).unwrap();
    let outcome = searched(&roadmap, &[(0, 2), (1, 1)], &limited(1000));
    assert_eq!(outcome.end, End::Infeasible);
}

// ---- An exact search of walks and their times ---------------------------------------

/// Least times of walks whose starts keep differences: `later ≥ earlier + seconds`. A start that is none stands for time 0.
type Difference = (usize, Option<usize>, f64);

/// Walks of all agents, and the number of each one's first start.
struct Walks<'a> {
    roadmap: &'a Roadmap,
    chosen: Vec<(Vertex, &'a [Edge])>,
    first: Vec<usize>,
}

impl Walks<'_> {
    /// The least times of starts, or none if the differences cannot be kept.
    fn times(&self, differences: &[Difference]) -> Option<Vec<f64>> {
        let count: usize = self.chosen.iter().map(|(_, edges)| edges.len()).sum();
        let mut times = vec![0.0_f64; count];
        for _ in 0..=count {
            let mut same = true;
            for (later, earlier, seconds) in differences {
                let least = earlier.map_or(0.0, |earlier| times[earlier]) + seconds;
                if times[*later] < least - 1e-9 {
                    (times[*later], same) = (least, false);
                }
            }
            if same {
                return Some(times);
            }
        }
        None
    }

    fn cost(&self, times: &[f64]) -> f64 {
        let arrivals = self
            .chosen
            .iter()
            .zip(&self.first)
            .map(|((_, edges), first)| {
                let last = edges.last()?;
                Some(times[first + edges.len() - 1] + self.roadmap.duration(*last))
            });
        arrivals.flatten().sum()
    }

    /// The two ways out of some conflict, where there is one; each may be none.
    fn conflict(&self, times: &[f64]) -> Option<Vec<Difference>> {
        const EPSILON: f64 = 1e-7;
        let distance = self.roadmap.separation(0, 0) * (1.0 - 1e-9);
        for one in 0..self.chosen.len() {
            for other in (0..self.chosen.len()).filter(|other| *other != one) {
                let ((start, edges), (_, others)) = (self.chosen[one], self.chosen[other]);
                for (number, passing) in others.iter().enumerate() {
                    let passes = self.first[other] + number;
                    let motion = self.roadmap.motion(*passing);
                    for (hop, edge) in edges.iter().enumerate() {
                        let sets_out = self.first[one] + hop;
                        let Some(overlap) = self.roadmap.motion(*edge).overlap(&motion, distance)
                        else {
                            continue;
                        };
                        let (span, delay) = (overlap.forward, times[passes] - times[sets_out]);
                        if span.low + EPSILON < delay && delay < span.high - EPSILON {
                            return Some(vec![
                                (sets_out, Some(passes), -span.low),
                                (passes, Some(sets_out), span.high),
                            ]);
                        }
                    }
                    for stay in 0..=edges.len() {
                        let vertex = match stay {
                            0 => start,
                            _ => self.roadmap.target(edges[stay - 1]),
                        };
                        let Some(near) = motion.near(self.roadmap.place(vertex), distance) else {
                            continue;
                        };
                        let before = (stay > 0).then(|| self.first[one] + stay - 1);
                        let taken = before.map_or(0.0, |_| self.roadmap.duration(edges[stay - 1]));
                        let arrival = before.map_or(0.0, |before| times[before] + taken);
                        let after = (stay < edges.len()).then(|| self.first[one] + stay);
                        let departure = after.map_or(f64::INFINITY, |after| times[after]);
                        let (from, until) = (times[passes] + near.low, times[passes] + near.high);
                        if from.max(arrival) + EPSILON < until.min(departure) {
                            let later =
                                before.map(|before| (before, Some(passes), near.high - taken));
                            let sooner = after.map(|after| (passes, Some(after), -near.low));
                            return Some(later.into_iter().chain(sooner).collect());
                        }
                    }
                }
            }
        }
        None
    }

    /// The least cost below `best` of times without conflicts.
    fn least(&self, differences: &mut Vec<Difference>, best: &mut f64) {
        let Some(times) = self.times(differences) else {
            return;
        };
        if self.cost(&times) >= *best {
            return;
        }
        let Some(ways_out) = self.conflict(&times) else {
            *best = self.cost(&times);
            return;
        };
        for difference in ways_out {
            differences.push(difference);
            self.least(differences, best);
            differences.pop();
        }
    }
}

/// Most walks of an agent, and combinations of walks, that are looked at.
const WALKS: usize = 1000;

/// All walks from a start to a goal that take no longer than a time; none if they are too many.
fn walks(roadmap: &Roadmap, (start, goal): (Vertex, Vertex), most: f64) -> Option<Vec<Vec<Edge>>> {
    let rest = roadmap.times_to(goal);
    let (mut found, mut open) = (Vec::new(), vec![(start, 0.0, Vec::new())]);
    while let Some((vertex, time, edges)) = open.pop() {
        if time + rest[vertex as usize] > most {
            continue;
        }
        for edge in roadmap.leaving(vertex) {
            let mut more = edges.clone();
            more.push(edge);
            open.push((roadmap.target(edge), time + roadmap.duration(edge), more));
        }
        if vertex == goal {
            found.push(edges);
        }
        if found.len().max(open.len()) > WALKS {
            return None;
        }
    }
    Some(found)
}

/// The least cost of a plan below `most`, by all walks and all orders at their conflicts; none if there are too many walks.
fn exact(roadmap: &Roadmap, tasks: &[(Vertex, Vertex)], most: f64) -> Option<f64> {
    let alone = |task: &(Vertex, Vertex)| roadmap.times_to(task.1)[task.0 as usize];
    let sum: f64 = tasks.iter().map(alone).sum();
    let all = tasks
        .iter()
        .map(|task| walks(roadmap, *task, most - sum + alone(task)));
    let all: Vec<Vec<Vec<Edge>>> = all.collect::<Option<_>>()?;
    let combinations: usize = all.iter().map(Vec::len).product();
    if combinations > WALKS {
        return None;
    }
    let mut best = most;
    for mut number in 0..combinations {
        let mut chosen = Vec::new();
        for (walks, (start, _)) in all.iter().zip(tasks) {
            chosen.push((*start, walks[number % walks.len()].as_slice()));
            number /= walks.len();
        }
        let (mut first, mut count, mut differences) = (Vec::new(), 0, Vec::new());
        for (_, edges) in &chosen {
            first.push(count);
            for (hop, pair) in edges.windows(2).enumerate() {
                let earlier = Some(count + hop);
                differences.push((count + hop + 1, earlier, roadmap.duration(pair[0])));
            }
            count += edges.len();
        }
        let team = Walks {
            roadmap,
            chosen,
            first,
        };
        team.least(&mut differences, &mut best);
    }
    Some(best)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(100))]

    #[test]
    fn no_plan_costs_less_than_the_optimal_one(
        roadmap in roadmap(), wanted in proptest::collection::vec((0..16_usize, 0..16_usize), 2..4),
    ) {
        let tasks = tasks(&roadmap, &wanted);
        let outcome = searched(&roadmap, &tasks, &limited(500));
        match outcome.end {
            End::Solved => {
                for (path, task) in outcome.paths.iter().zip(&tasks) {
                    judge_path(&roadmap, path, *task)?;
                }
                let apart = least_distance(&roadmap, &outcome.paths);
                prop_assert!(apart > SEPARATION - 1e-7, "{apart} m apart");
                prop_assert!((sum_of_costs(&outcome.paths) - outcome.cost).abs() < 1e-9);
                prop_assert!((outcome.lower_bound - outcome.cost).abs() < 1e-6);
                if let Some(best) = exact(&roadmap, &tasks, outcome.cost + 1e-6) {
                    prop_assert!(best > outcome.cost - 1e-5, "{best} instead of {}", outcome.cost);
                }
            }
            End::Infeasible => {
                let other = planned(&Closeness::new(roadmap.clone()), &tasks, 20, 1).end;
                prop_assert!(!matches!(other, Ended::Solved(_)), "there is a plan");
            }
            other => prop_assert_eq!(other, End::Nodes),
        }
        prop_assert_eq!(&searched(&roadmap, &tasks, &limited(500)), &outcome);
    }

    #[test]
    fn every_way_to_search_costs_the_same(
        diagonals in proptest::collection::vec(any::<bool>(), 9),
        wanted in proptest::collection::vec((0..16_usize, 0..16_usize), 2..6),
        weight in 1.0..2.0_f64,
    ) {
        let roadmap = lattice(&diagonals);
        let tasks = tasks(&roadmap, &wanted);
        let best = searched(&roadmap, &tasks, &limited(2000));
        prop_assume!(best.end == End::Solved);
        let settings = limited(2000);
        for settings in [
            Settings { pairs: false, ..settings },
            Settings { bypass: false, ..settings },
            Settings { disjoint: false, ..settings },
            Settings { memory_limit: 1 << 15, ..settings },
        ] {
            let other = searched(&roadmap, &tasks, &settings);
            if other.end == End::Solved {
                let proven = other.lower_bound > other.cost - 1e-6;
                prop_assert!(other.cost > best.cost - 1e-6);
                prop_assert!(!proven || other.cost < best.cost + 1e-6, "{} for {}", other.cost, best.cost);
            }
            prop_assert!(other.lower_bound < best.cost + 1e-6);
        }
        let bounded = searched(&roadmap, &tasks, &Settings { weight, ..settings });
        prop_assert!(bounded.lower_bound < best.cost + 1e-6);
        if bounded.end == End::Solved {
            prop_assert!(bounded.cost < best.cost * weight + 1e-6, "{} for {}", bounded.cost, best.cost);
            prop_assert!(bounded.cost < bounded.lower_bound * weight + 1e-6);
            prop_assert!(least_distance(&roadmap, &bounded.paths) > SEPARATION - 1e-7);
        }
        let original = searched(&roadmap, &tasks, &Settings { branching: Branching::Original, ..settings });
        if original.end == End::Solved {
            prop_assert!(original.cost > best.cost - 1e-6);
            prop_assert!(least_distance(&roadmap, &original.paths) > SEPARATION - 1e-7);
        }
    }
}

/// Problems of the shared data, where they are at hand: forty discs within a fifth of the least cost.
#[test]
fn teams_of_forty_are_planned_within_a_factor() {
    let Some(data) = std::env::var_os("FLEETYARD_DATA") else {
        eprintln!("skipped: FLEETYARD_DATA is not set");
        return;
    };
    for name in ["boxes-32-dense-1", "rooms-32-dense-2", "empty-32-dense-3"] {
        let tasks = format!("continuous/roadmap-tasks/{name}.tasks.json");
        let file = File::new(&data).join(tasks);
        if !file.exists() {
            eprintln!("skipped: {} is not there", file.display());
            return;
        }
        let case = Case::read(&file, 40).unwrap();
        let settings = Settings {
            weight: 1.2,
            ..limited(300)
        };
        let outcome = searched(&case.roadmap, &case.tasks, &settings);
        assert_eq!(outcome.end, End::Solved, "{name}");
        assert!(outcome.cost < outcome.lower_bound * 1.2 + 1e-6, "{name}");
        let apart = least_distance(&case.roadmap, &outcome.paths);
        assert!(apart > case.roadmap.separation(0, 0) - 1e-7, "{apart}");
    }
}

/// Problems of the shared data, where they are at hand: the costs of CCBS's own program.
#[test]
fn costs_are_those_of_the_published_program() {
    let Some(data) = std::env::var_os("FLEETYARD_DATA") else {
        eprintln!("skipped: FLEETYARD_DATA is not set");
        return;
    };
    let data = File::new(&data);
    let Ok(known) = fs::read_to_string(data.join("peers/continuous.csv")) else {
        eprintln!("skipped: {} has no figures of others", data.display());
        return;
    };
    let mut compared = 0;
    for line in known.lines() {
        let [solver, problem, agents, _, _, success, _, cost, ..] =
            line.split(',').collect::<Vec<_>>()[..]
        else {
            continue;
        };
        let tasks = format!("continuous/roadmap-tasks/{problem}.tasks.json");
        let file = data.join(tasks);
        if solver != "CCBS" || success != "1" || agents.len() > 2 || !file.exists() {
            continue;
        }
        let agents: usize = agents.parse().unwrap();
        if agents > 10 {
            continue;
        }
        let case = Case::read(&file, agents).unwrap();
        let outcome = searched(&case.roadmap, &case.tasks, &limited(1000));
        let expected: f64 = cost.parse().unwrap();
        assert_eq!(outcome.end, End::Solved, "{problem} {agents}");
        assert!(
            (outcome.cost - expected).abs() < 1e-3,
            "{problem} {agents}: {} for {expected}",
            outcome.cost
        );
        compared += 1;
    }
    assert!(compared > 10, "{compared} problems");
}
