//! `roadmap-lns` and `roadmap-lacam`: first plans, and shorter ones.

use fleetyard_plugin_roadmap::anytime::{Begin, Control, End, Outcome, Settings, plan};
use fleetyard_plugin_roadmap::closeness::Closeness;
use fleetyard_plugin_roadmap::crowd::Crowd;
use fleetyard_plugin_roadmap::lacam::{self, schedule};
use fleetyard_plugin_roadmap::lns::fewest::Fewest;
use fleetyard_plugin_roadmap::plan::{Path, cost};
use fleetyard_plugin_roadmap::priority::sum_of_costs;
use fleetyard_plugin_roadmap::rest::{Known, Rest};
use fleetyard_plugin_roadmap::roadmap::{NONE, Roadmap, Vertex};
use fleetyard_plugin_roadmap::sipp::{Found, Search, Task};
use proptest::prelude::*;

use super::support::{Case, apart, discs, least_distance, shared};
use super::{SEPARATION, Vector, judge_path, lattice, roadmap, tasks, walk};

/// All plans that are told.
fn plans(
    closeness: &Closeness,
    tasks: &[(Vertex, Vertex)],
    begin: Begin,
    nodes: u64,
) -> (Outcome, Vec<Vec<Path>>) {
    let settings = Settings {
        begin,
        neighborhood: 3,
        anytime: true,
        seed: 1,
    };
    let mut control = Control {
        stop: &mut || false,
        nodes,
        memory: 1 << 28,
    };
    let mut told = Vec::new();
    let outcome = plan(
        closeness,
        &mut Known::default(),
        &discs(tasks),
        settings,
        &mut control,
        &mut |paths| told.push(paths.to_vec()),
    );
    (outcome, told)
}

/// Goals of discs, and the questions for their paths.
fn rests(roadmap: &Roadmap, tasks: &[(Vertex, Vertex)]) -> Vec<Rest> {
    let mut known = Known::default();
    let each = tasks.iter();
    each.map(|(_, goal)| Rest::to(roadmap, &[*goal], true, &mut known))
        .collect()
}

fn question(start: Vertex, rest: &Rest) -> Task<'_> {
    Task {
        start,
        direction: None,
        rest,
        until: f64::INFINITY,
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn every_plan_keeps_discs_apart_and_is_better_than_the_last(
        roadmap in roadmap(), wanted in proptest::collection::vec((0..16_usize, 0..16_usize), 1..7), steps in any::<bool>(),
    ) {
        let tasks = tasks(&roadmap, &wanted);
        let closeness = Closeness::new(roadmap.clone());
        let begin = if steps { Begin::Steps } else { Begin::Repair };
        let (outcome, told) = plans(&closeness, &tasks, begin, 200);
        prop_assert_eq!(&(outcome, told.clone()), &plans(&Closeness::new(roadmap.clone()), &tasks, begin, 200));
        prop_assert!(outcome.work.nodes <= 200);
        prop_assert_eq!(outcome.end == End::Solved, !told.is_empty());
        prop_assert!(tasks.len() > 1 || outcome.end == End::Solved);
        let mut last = f64::INFINITY;
        for paths in told {
            for (path, task) in paths.iter().zip(&tasks) {
                judge_path(&roadmap, path, *task)?;
            }
            let apart = least_distance(&roadmap, &paths);
            prop_assert!(apart > SEPARATION - 1e-7, "{apart} m apart");
            let cost = sum_of_costs(&paths);
            prop_assert!(cost < last && cost > outcome.work.lower_bound - 1e-6);
            last = cost;
        }
    }

    #[test]
    fn steps_are_compressed_to_times_that_keep_discs_apart(
        diagonals in proptest::collection::vec(any::<bool>(), 9),
        starts in proptest::collection::hash_set(0..16_u32, 2..9), goals in proptest::collection::hash_set(0..16_u32, 9), seed in 0..8_u64,
    ) {
        let roadmap = lattice(&diagonals);
        let closeness = Closeness::new(roadmap.clone());
        let [starts, mut goals] = [starts, goals].map(|set| {
            let mut list: Vec<Vertex> = set.into_iter().collect();
            list.sort_unstable();
            list
        });
        goals.rotate_left(seed as usize);
        let tasks: Vec<(Vertex, Vertex)> = starts.into_iter().zip(goals).collect();
        let rests = rests(&roadmap, &tasks);
        let questions: Vec<Task<'_>> = tasks.iter().zip(&rests).map(|((start, _), rest)| question(*start, rest)).collect();
        let mut control = lacam::Control { stop: &mut || false, nodes: 500, memory: 1 << 28 };
        let (end, made) = lacam::search(&closeness, &questions, seed, &mut control);
        prop_assert!(made <= 500);
        if let lacam::End::Solved(steps) = end {
            let starts: Vec<Vertex> = tasks.iter().map(|(start, _)| *start).collect();
            let paths = schedule::earliest(&closeness, &starts, &steps);
            for (path, task) in paths.iter().zip(&tasks) {
                judge_path(&roadmap, path, *task)?;
            }
            let apart = least_distance(&roadmap, &paths);
            prop_assert!(apart > SEPARATION - 1e-7, "{apart} m apart");
            // Nobody is later than with steps that begin when all have arrived.
            let longest = |step: usize| {
                let edges = steps.iter().map(|list| list[step]).filter(|edge| *edge != NONE);
                edges.map(|edge| roadmap.duration(edge)).fold(0.0, f64::max)
            };
            let whole: f64 = (0..steps[0].len()).map(longest).sum();
            prop_assert!(paths.iter().all(|path| cost(path) < whole + 1e-9));
        }
    }

    #[test]
    fn the_path_that_meets_the_fewest_is_the_earliest_that_meets_nobody_where_there_is_one(
        diagonals in proptest::collection::vec(any::<bool>(), 9),
        walks in proptest::collection::vec((0..16_u32, proptest::collection::vec((0..8_u32, 0..6_u8), 1..6)), 0..5),
        task in (0..16_u32, 0..16_u32),
    ) {
        let roadmap = lattice(&diagonals);
        let closeness = Closeness::new(roadmap.clone());
        let mut crowd = Crowd::new(&closeness, walks.len() + 1, f64::INFINITY);
        for (disc, (start, choices)) in walks.iter().enumerate() {
            crowd.exchange(disc as u32, walk(&roadmap, *start, choices));
        }
        let rest = Rest::to(&roadmap, &[task.1], true, &mut Known::default());
        let asked = question(task.0, &rest);
        let Found::Path(path) = Fewest::new(&roadmap).find(&roadmap, &crowd, &asked, &mut || false) else {
            panic!("some path always meets others or none")
        };
        judge_path(&roadmap, &path, task)?;
        let least = (0..walks.len() as u32).map(|other| apart(&roadmap, &path, crowd.path(other), 0.0, 100.0));
        let least = least.fold(f64::INFINITY, f64::min);
        if let Found::Path(earliest) = Search::new(&roadmap).find(&roadmap, &crowd, &asked, &mut || false) {
            prop_assert!(least > SEPARATION - 1e-6, "{least}");
            prop_assert!((cost(&path) - cost(&earliest)).abs() < 1e-6, "{} {}", cost(&path), cost(&earliest));
        } else {
            prop_assert!(least < SEPARATION);
        }
    }
}

/// A line with a place to step aside in the middle, and two discs head on: no order of priority leads to a plan.
#[test]
fn steps_lead_where_no_order_of_priority_does() {
    let places = [(0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (1.0, 1.0)];
    let places = places.map(|(x, y)| Vector::new(x, y)).to_vec();
    let edges = [(0, 1), (1, 2), (1, 3)]
        .into_iter()
        .flat_map(|(a, b)| [(a, b, 1.0), (b, a, 1.0)]);
    let closeness = Closeness::new(Roadmap::new(places, edges, SEPARATION).unwrap());
    for tasks in [[(0, 2), (2, 0)], [(2, 0), (0, 2)]] {
        let (outcome, told) = plans(&closeness, &tasks, Begin::Steps, 1000);
        assert_eq!(outcome.end, End::Solved);
        assert!(least_distance(closeness.roadmap(), &told[0]) > SEPARATION - 1e-9);
    }
}

/// Two discs on a line of two vertices: there is no plan, and nobody says that there is one.
#[test]
fn nothing_is_found_where_there_is_nothing() {
    let places = vec![
        Vector::zeros(),
        Vector::new(1.0, 0.0),
        Vector::new(5.0, 0.0),
    ];
    let edges = [(0, 1, 1.0), (1, 0, 1.0)];
    let closeness = Closeness::new(Roadmap::new(places, edges, SEPARATION).unwrap());
    for begin in [Begin::Repair, Begin::Steps] {
        let (outcome, told) = plans(&closeness, &[(0, 1), (1, 0)], begin, 100);
        assert_eq!((outcome.end, told.len()), (End::Stopped, 0));
        let (outcome, _) = plans(&closeness, &[(0, 1), (2, 0)], begin, 100);
        assert_eq!(outcome.end, End::NoWay(1));
        // Who is at its goal stays there, and nobody at all has a plan at once.
        let (outcome, told) = plans(&closeness, &[(0, 0), (2, 2)], begin, 100);
        assert_eq!((outcome.end, sum_of_costs(&told[0])), (End::Solved, 0.0));
        let (outcome, told) = plans(&closeness, &[], begin, 100);
        assert_eq!((outcome.end, told), (End::Solved, vec![Vec::new()]));
    }
}

/// Two hundred discs on a lattice of 400 vertices, where a disc in the middle of a square is in nobody's way.
#[test]
fn two_hundred_discs_fill_half_a_lattice() {
    let place = |vertex: u32| Vector::new(f64::from(vertex % 20), f64::from(vertex / 20));
    let near = |vertex: u32| {
        let right = (vertex % 20 < 19).then_some(vertex + 1);
        let up = (vertex < 380).then_some(vertex + 20);
        right.into_iter().chain(up)
    };
    let edges = (0..400_u32).flat_map(|a| near(a).flat_map(move |b| [(a, b, 1.0), (b, a, 1.0)]));
    let roadmap = Roadmap::new((0..400).map(place).collect(), edges, SEPARATION).unwrap();
    let closeness = Closeness::new(roadmap);
    let tasks: Vec<(Vertex, Vertex)> = (0..200)
        .map(|disc| (disc * 2, (disc * 173 % 200) * 2 + 1))
        .collect();
    let (outcome, told) = plans(&closeness, &tasks, Begin::Steps, 1000);
    assert_eq!(outcome.end, End::Solved);
    let costs: Vec<f64> = told.iter().map(|paths| sum_of_costs(paths)).collect();
    assert!(costs[costs.len() - 1] < costs[0], "{costs:?}");
    for paths in [&told[0], &told[told.len() - 1]] {
        assert!(least_distance(closeness.roadmap(), paths) > SEPARATION - 1e-7);
    }
}

#[test]
fn limits_of_memory_and_of_plans_are_kept() {
    let closeness = Closeness::new(lattice(&[true; 9]));
    let ask = |begin, anytime, memory| {
        let settings = Settings {
            begin,
            neighborhood: 8,
            anytime,
            seed: 3,
        };
        let mut control = Control {
            stop: &mut || false,
            nodes: 100,
            memory,
        };
        let mut told = 0;
        let team = discs(&[(0, 15), (15, 0), (3, 12)]);
        let outcome = plan(
            &closeness,
            &mut Known::default(),
            &team,
            settings,
            &mut control,
            &mut |_| told += 1,
        );
        (outcome.end, told)
    };
    for begin in [Begin::Repair, Begin::Steps] {
        assert_eq!(ask(begin, true, 0), (End::Memory, 0));
        assert_eq!(ask(begin, false, 1 << 20), (End::Solved, 1));
    }
}

/// Problems of the shared data, where they are at hand: sixty discs, repaired and in steps.
#[test]
fn sixty_discs_have_plans_that_get_shorter() {
    for name in ["rooms-32-sparse-2", "rooms-32-dense-1"] {
        let Some(file) = shared(name) else { return };
        let case = Case::read(&file, 60).unwrap();
        let closeness = Closeness::new(case.roadmap.clone());
        for begin in [Begin::Repair, Begin::Steps] {
            let (outcome, told) = plans(&closeness, &case.tasks, begin, 500);
            assert_eq!(outcome.end, End::Solved);
            assert!(told.len() > 1);
            for paths in told {
                let apart = least_distance(&case.roadmap, &paths);
                assert!(apart > case.roadmap.separation(0, 0) - 1e-7, "{apart}");
            }
        }
    }
}
