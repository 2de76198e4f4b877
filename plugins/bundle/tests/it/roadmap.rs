//! Paths on roadmaps: judged by the least distance of centres, and held against an exhaustive search in steps of time.

// Ends of intervals are copied, not worked out anew.
#![allow(clippy::float_cmp)]

mod anytime;
mod conflict;
mod ctc;
mod growing;
mod support;

use std::collections::BTreeSet;
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

use fleetyard_abi::{Footprint, Robot};
use fleetyard_plugin_plane::Vector;
use fleetyard_plugin_plane::motion::Span;
use fleetyard_plugin_plane::orders::End;
use fleetyard_plugin_roadmap::closeness::Closeness;
use fleetyard_plugin_roadmap::drive::Limits;
use fleetyard_plugin_roadmap::plan::{Path, Visit, cost, length};
use fleetyard_plugin_roadmap::priority::{Disc, plan, sum_of_costs};
use fleetyard_plugin_roadmap::reservation::Reservations;
use fleetyard_plugin_roadmap::rest::{Known, Rest};
use fleetyard_plugin_roadmap::roadmap::{NONE, Refused, Roadmap, Vertex};
use fleetyard_plugin_roadmap::sipp::{Found, Search, Task};
use proptest::prelude::*;
use support::{Case, apart, least_distance, planned, shared};

const SEPARATION: f64 = 0.6;

/// Roadmaps with crossing, directed and parallel edges, with vertices that nothing leads to, and with vertices closer than
/// the separation.
fn roadmap() -> impl Strategy<Value = Roadmap> {
    let places = proptest::collection::hash_set((0..80_i32, 0..80_i32), 4..16);
    let places = places.prop_map(|places| {
        let mut places: Vec<(i32, i32)> = places.into_iter().collect();
        places.sort_unstable();
        places
            .into_iter()
            .map(|(x, y)| Vector::new(f64::from(x), f64::from(y)) * 0.05)
            .collect::<Vec<_>>()
    });
    let edges =
        proptest::collection::vec((0..16_u32, 0..16_u32, 0.5..2.0_f64, any::<bool>()), 6..40);
    (places, edges).prop_map(|(places, edges)| {
        let count = places.len() as u32;
        let mut list = Vec::new();
        for (a, b, speed, both) in edges {
            let (a, b) = (a % count, b % count);
            if a != b {
                let seconds = (places[a as usize] - places[b as usize]).norm() / speed;
                list.push((a, b, seconds));
                if both {
                    list.push((b, a, seconds));
                }
            }
        }
        Roadmap::new(places, list, SEPARATION).unwrap()
    })
}

/// Starts and goals that do not block each other: every one at its own vertex, all far enough apart.
fn tasks(roadmap: &Roadmap, wanted: &[(usize, usize)]) -> Vec<(Vertex, Vertex)> {
    let (mut starts, mut goals): (Vec<Vertex>, Vec<Vertex>) = (Vec::new(), Vec::new());
    let apart = |chosen: &[Vertex], vertex: Vertex| {
        let distance = |other: &Vertex| (roadmap.place(vertex) - roadmap.place(*other)).norm();
        chosen.iter().all(|other| distance(other) > SEPARATION)
    };
    for (start, goal) in wanted {
        let start = (start % roadmap.vertices()) as Vertex;
        let reachable: Vec<Vertex> = (0..roadmap.vertices() as Vertex)
            .filter(|goal| roadmap.times_to(*goal)[start as usize].is_finite())
            .collect();
        let goal = reachable[goal % reachable.len()];
        if apart(&starts, start) && apart(&goals, goal) {
            starts.push(start);
            goals.push(goal);
        }
    }
    starts.into_iter().zip(goals).collect()
}

/// A path begins and ends where it should, drives edges of the roadmap, each as long as it takes.
fn judge_path(roadmap: &Roadmap, path: &Path, task: (Vertex, Vertex)) -> Result<(), TestCaseError> {
    prop_assert_eq!((path[0].vertex, path[path.len() - 1].vertex), task);
    prop_assert_eq!(path[0].arrival, 0.0);
    prop_assert_eq!(path[path.len() - 1].departure, f64::INFINITY);
    for hop in path.windows(2) {
        let edge = roadmap
            .edge(hop[0].vertex, hop[1].vertex)
            .expect("an edge of the roadmap");
        prop_assert!(hop[0].departure >= hop[0].arrival);
        let late = hop[1].arrival - hop[0].departure - roadmap.duration(edge);
        prop_assert!(late.abs() < 1e-9, "{late} s beyond the time of the edge");
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn teams_keep_their_distance_in_continuous_time(
        roadmap in roadmap(), wanted in proptest::collection::vec((0..16_usize, 0..16_usize), 1..6), seed in 0..4_u64,
    ) {
        let tasks = tasks(&roadmap, &wanted);
        let closeness = Closeness::new(roadmap.clone());
        let outcome = planned(&closeness, &tasks, 20, seed);
        prop_assert_eq!(&outcome, &planned(&Closeness::new(roadmap.clone()), &tasks, 20, seed));
        if let End::Solved(paths) = outcome.end {
            for (path, task) in paths.iter().zip(&tasks) {
                judge_path(&roadmap, path, *task)?;
            }
            let apart = least_distance(&roadmap, &paths);
            prop_assert!(apart > SEPARATION - 1e-7, "{apart} m apart");
        } else {
            prop_assert!(tasks.len() > 1, "one disc alone has a path");
        }
    }
}

/// Spans of both agree, but for the rounding of stored ones.
fn agree(found: &[(u32, Span)], expected: &[(u32, Span)]) -> Result<(), TestCaseError> {
    let names = |list: &[(u32, Span)]| list.iter().map(|(name, _)| *name).collect::<Vec<_>>();
    prop_assert_eq!(names(found), names(expected));
    for ((_, found), (_, expected)) in found.iter().zip(expected) {
        prop_assert!(
            (found.low - expected.low).abs() < 1e-5 && (found.high - expected.high).abs() < 1e-5
        );
        // Motions that are nearly parallel cost digits. Judges allow a micrometre.
        prop_assert!(
            found.low <= expected.low + 1e-6 && found.high >= expected.high - 1e-6,
            "{found:?} for {expected:?}"
        );
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn what_is_close_is_the_same_asked_for_or_worked_out_at_once_or_by_hand(roadmap in roadmap()) {
        let (lazy, whole) = (Closeness::new(roadmap.clone()), Closeness::new(roadmap.clone()));
        whole.annotate();
        let edges = 0..roadmap.edges() as u32;
        // Pairs that touch may have a span of a rounding error's length on one way and none on the other.
        let long = |list: Vec<(u32, Span)>| list.into_iter().filter(|(_, span)| span.high - span.low > 1e-5).collect::<Vec<_>>();
        let sorted = |list: Vec<(u32, Span)>| {
            let mut list = long(list);
            list.sort_by_key(|(name, _)| *name);
            list
        };
        for edge in edges.clone() {
            let motion = roadmap.motion(edge);
            let by_hand = edges.clone().filter_map(|other| {
                let overlap = motion.overlap(&roadmap.motion(other), SEPARATION * (1.0 + 1e-9))?;
                Some((other, overlap.forward))
            });
            let by_hand = long(by_hand.collect());
            agree(&sorted(lazy.edges_of_edge(edge).collect()), &by_hand)?;
            agree(&sorted(whole.edges_of_edge(edge).collect()), &by_hand)?;
            let vertices = (0..roadmap.vertices() as u32)
                .filter_map(|vertex| Some((vertex, motion.near(roadmap.place(vertex), SEPARATION * (1.0 + 1e-9))?)));
            agree(&sorted(lazy.vertices_of_edge(edge).collect()), &long(vertices.collect()))?;
        }
        for vertex in 0..roadmap.vertices() as u32 {
            let place = roadmap.place(vertex);
            let by_hand = edges.clone()
                .filter_map(|edge| Some((edge, roadmap.motion(edge).near(place, SEPARATION * (1.0 + 1e-9))?)));
            agree(&sorted(lazy.edges_of_vertex(vertex).to_vec()), &long(by_hand.collect()))?;
        }
    }
}

/// A 4 × 4 lattice of edges of a metre, driven at 1 m/s, with the diagonals of some squares.
fn lattice(diagonals: &[bool]) -> Roadmap {
    let place = |vertex: u32| Vector::new(f64::from(vertex % 4), f64::from(vertex / 4));
    let mut edges = Vec::new();
    for a in 0..16_u32 {
        for b in 0..16_u32 {
            let apart = (place(a) - place(b)).norm();
            let diagonal = apart > 1.1 && diagonals[(a.min(b) % 9) as usize];
            if a != b && apart < if diagonal { 1.5 } else { 1.1 } {
                edges.push((a, b, apart));
            }
        }
    }
    Roadmap::new((0..16).map(place).collect(), edges, SEPARATION).unwrap()
}

/// A path along edges that are chosen by numbers, with waits between them.
fn walk(roadmap: &Roadmap, start: Vertex, choices: &[(u32, u8)]) -> Path {
    let (mut vertex, mut time, mut path) = (start, 0.0, Path::new());
    for (choice, wait) in choices {
        let leaving = roadmap.leaving(vertex);
        let edge = leaving.start + choice % leaving.len() as u32;
        let departure = time + f64::from(*wait) * 0.3;
        path.push(Visit {
            vertex,
            arrival: time,
            departure,
            onward: edge,
        });
        (vertex, time) = (roadmap.target(edge), departure + roadmap.duration(edge));
    }
    path.push(Visit {
        vertex,
        arrival: time,
        departure: f64::INFINITY,
        onward: NONE,
    });
    path
}

/// The earliest arrival of a disc that sets out at multiples of a fifth of a second only, among paths of others, by trying
/// everything.
fn exhaustive(roadmap: &Roadmap, others: &[Path], (start, goal): (Vertex, Vertex)) -> Option<f64> {
    const STEP: f64 = 0.2;
    const HORIZON: u32 = 90;
    let clear = |path: &Path, from: f64, to: f64| {
        others
            .iter()
            .all(|other| apart(roadmap, path, other, from, to) > SEPARATION + 1e-7)
    };
    let mut reached = vec![BTreeSet::from([start])];
    for step in 0..HORIZON {
        let time = f64::from(step) * STEP;
        for vertex in reached.get(step as usize).cloned().unwrap_or_default() {
            let stay = vec![Visit {
                vertex,
                arrival: 0.0,
                departure: f64::INFINITY,
                onward: NONE,
            }];
            if vertex == goal && clear(&stay, time, 100.0) {
                return Some(time);
            }
            let mut go = |to: Vertex, seconds: f64| {
                let steps = (seconds / STEP).ceil() as usize;
                let arrival = time + seconds;
                let drive = vec![
                    Visit {
                        vertex,
                        arrival: 0.0,
                        departure: time,
                        onward: NONE,
                    },
                    Visit {
                        vertex: to,
                        arrival,
                        departure: f64::INFINITY,
                        onward: NONE,
                    },
                ];
                // Who arrives between two steps waits for the next.
                let until = time + steps as f64 * STEP;
                if clear(if to == vertex { &stay } else { &drive }, time, until) {
                    let at = step as usize + steps;
                    reached.resize_with(reached.len().max(at + 1), BTreeSet::new);
                    reached[at].insert(to);
                }
            };
            go(vertex, STEP);
            roadmap
                .leaving(vertex)
                .for_each(|edge| go(roadmap.target(edge), roadmap.duration(edge)));
        }
    }
    None
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn no_search_in_steps_of_time_arrives_earlier(
        diagonals in proptest::collection::vec(any::<bool>(), 9),
        walks in proptest::collection::vec((0..16_u32, proptest::collection::vec((0..8_u32, 0..6_u8), 1..6)), 1..4),
        task in (0..16_u32, 0..16_u32),
    ) {
        let roadmap = lattice(&diagonals);
        let others: Vec<Path> = walks.iter().map(|(start, choices)| walk(&roadmap, *start, choices)).collect();
        let closeness = Closeness::new(roadmap.clone());
        let mut taken = Reservations::new(&closeness);
        for other in &others {
            taken.reserve(&closeness, other, f64::INFINITY);
        }
        let asked = Task {
            start: task.0,
            direction: None,
            rest: &Rest::to(&roadmap, &[task.1], true, &mut Known::default()),
            until: f64::INFINITY,
        };
        let found = Search::new(&roadmap).find(&roadmap, &taken, &asked, &mut || false);
        let tried = exhaustive(&roadmap, &others, task);
        match found {
            Found::Path(path) => {
                judge_path(&roadmap, &path, task)?;
                for other in &others {
                    let least = apart(&roadmap, &path, other, 0.0, 100.0);
                    prop_assert!(least > SEPARATION - 1e-7, "{least} m apart");
                }
                if let Some(tried) = tried {
                    prop_assert!(cost(&path) < tried + 1e-9, "{} s, but {tried} s would do", cost(&path));
                }
            }
            other => prop_assert_eq!((other, tried), (Found::None, None)),
        }
    }
}

/// LSMART's robots: 2 m/s, 2 m/s², 45°/s, which they reach in a quarter of a second.
const AGV: Limits = Limits {
    speed: 2.0,
    acceleration: 2.0,
    deceleration: 2.0,
    turn_rate: FRAC_PI_4,
    turn_acceleration: PI,
};

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn in_a_window_goals_are_met_in_order_and_nobody_is_near_another(
        diagonals in proptest::collection::vec(any::<bool>(), 9),
        starts in proptest::collection::hash_set(0..16_u32, 2..6),
        goals in proptest::collection::vec(proptest::collection::vec(0..16_u32, 0..4), 6),
        driven in any::<bool>(),
    ) {
        const UNTIL: f64 = 5.0;
        let roadmap = lattice(&diagonals);
        let roadmap = if driven { roadmap.driven(AGV) } else { roadmap };
        let mut starts: Vec<Vertex> = starts.into_iter().collect();
        starts.sort_unstable();
        let discs: Vec<Disc> = starts.iter().zip(&goals).map(|(start, goals)| Disc {
            start: *start,
            direction: driven.then_some(0.0),
            goals: goals.clone(),
        }).collect();
        let closeness = Closeness::new(roadmap.clone());
        let outcome = plan(&closeness, &mut Known::default(), (&discs, UNTIL), 50, 1, &mut || false);
        if let End::Solved(paths) = outcome.end {
            for (path, disc) in paths.iter().zip(&discs) {
                let mut left = disc.goals.iter().peekable();
                for visit in path {
                    while left.next_if_eq(&&visit.vertex).is_some() {}
                }
                prop_assert!(left.next().is_none() || path[path.len() - 1].arrival >= UNTIL);
                for hop in path.windows(2) {
                    prop_assert_eq!(roadmap.source(hop[0].onward), hop[0].vertex);
                    prop_assert_eq!(roadmap.target(hop[0].onward), hop[1].vertex);
                    let late = hop[1].arrival - hop[0].departure - roadmap.duration(hop[0].onward);
                    prop_assert!(late.abs() < 1e-9, "{late}");
                }
            }
            for (one, other) in (0..paths.len()).flat_map(|one| (0..one).map(move |other| (one, other))) {
                let least = apart(&roadmap, &paths[one], &paths[other], 0.0, UNTIL - 1e-6);
                prop_assert!(least > SEPARATION - 1e-7, "{least} m apart");
            }
        }
    }
}

/// A robot turns in place, speeds up over the first metre, goes on evenly, and brakes over the last.
#[test]
fn turns_and_drives_take_their_time() {
    let places = [(0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (3.0, 0.0), (3.0, 1.0)];
    let places = places.map(|(x, y)| Vector::new(x, y)).to_vec();
    let edges = (0..4_u32).flat_map(|a| [(a, a + 1, 0.5), (a + 1, a, 0.5)]);
    let roadmap = Roadmap::new(places, edges, SEPARATION).unwrap().driven(AGV);
    let turn = 2.25;
    assert!((AGV.turn(0.0, FRAC_PI_2) - turn).abs() < 1e-12);
    assert!((AGV.turn(PI, -FRAC_PI_2) - turn).abs() < 1e-12);
    let disc = |start, direction, goals: &[Vertex]| Disc {
        start,
        direction: Some(direction),
        goals: goals.to_vec(),
    };
    let closeness = Closeness::new(roadmap.clone());
    let times = |disc: Disc| {
        let team = (&[disc][..], f64::INFINITY);
        let outcome = plan(&closeness, &mut Known::default(), team, 1, 1, &mut || false);
        let End::Solved(paths) = outcome.end else {
            panic!("{outcome:?}")
        };
        let arrivals = paths[0].iter().map(|visit| visit.arrival);
        arrivals
            .map(|arrival| (arrival * 1e9).round() / 1e9)
            .collect::<Vec<f64>>()
    };
    // Three metres and a corner: 1 + 0.5 + 1 s, the turn, and one metre from rest to rest.
    let alone = (2.0_f64).sqrt();
    let end = ((2.5 + turn + alone) * 1e9).round() / 1e9;
    assert_eq!(times(disc(0, 0.0, &[4])), [0.0, 1.0, 1.5, 2.5, end]);
    // Who looks another way turns first; a goal on the way needs no stop.
    assert_eq!(times(disc(0, FRAC_PI_2, &[1, 3])), [0.0, 3.25, 3.75, 4.75]);
    let limits = |dynamics: &str| {
        let both = |most: f64| [Some(-most), Some(most)];
        Limits::of(&Robot {
            name: String::new(),
            footprint: Footprint {
                radius_m: 0.3,
                corners_m: Vec::new(),
            },
            dynamics: dynamics.into(),
            has_heading: true,
            polar_state: false,
            polar_control: false,
            state_limits: vec![
                [None, None],
                [None, None],
                [None, None],
                [Some(0.0), Some(2.0)],
                both(FRAC_PI_4),
            ],
            control_limits: vec![both(2.0), both(PI)],
            parameters: Vec::new(),
        })
    };
    assert_eq!(limits("fleetyard.unicycle-2/1"), Some(AGV));
    assert_eq!(limits("fleetyard.holonomic/1"), None);
    let at_once = limits("fleetyard.unicycle/1").unwrap();
    assert_eq!(
        (at_once.stop_to_stop(3.0), at_once.turn(0.0, PI)),
        (1.5, 1.0)
    );
}

/// The longer way goes first, and leads through a place where somebody has to turn before it can leave.
#[test]
fn who_has_to_turn_is_waited_for() {
    let places = [(0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (3.0, 0.0), (2.0, 1.0)];
    let places = places.map(|(x, y)| Vector::new(x, y)).to_vec();
    let edges = [(0, 1), (1, 2), (2, 3), (2, 4)]
        .into_iter()
        .flat_map(|(a, b)| [(a, b, 0.5), (b, a, 0.5)]);
    let roadmap = Roadmap::new(places, edges, SEPARATION).unwrap().driven(AGV);
    let disc = |start, goal| Disc {
        start,
        direction: Some(0.0),
        goals: vec![goal],
    };
    let discs = [disc(0, 3), disc(2, 4)];
    let closeness = Closeness::new(roadmap);
    let team = (&discs[..], f64::INFINITY);
    let outcome = plan(&closeness, &mut Known::default(), team, 1, 1, &mut || false);
    let End::Solved(paths) = outcome.end else {
        panic!("{outcome:?}")
    };
    assert_eq!(cost(&paths[1]), 2.25 + 2.0_f64.sqrt());
    assert!(least_distance(closeness.roadmap(), &paths) > SEPARATION - 1e-9);
}

#[test]
fn a_roadmap_that_is_none_is_refused() {
    let places = vec![Vector::zeros(), Vector::new(1.0, 0.0)];
    let of = |edges: Vec<(Vertex, Vertex, f64)>| {
        Roadmap::new(places.clone(), edges, 0.5).map(|roadmap| roadmap.edges())
    };
    assert_eq!(of(vec![(0, 2, 1.0)]), Err(Refused::NoVertex { edge: 0 }));
    assert_eq!(
        of(vec![(0, 1, 1.0), (1, 0, 0.0)]),
        Err(Refused::NoDuration { edge: 1 })
    );
    assert_eq!(
        of(vec![(0, 1, f64::INFINITY)]),
        Err(Refused::NoDuration { edge: 0 })
    );
    let nowhere = vec![Vector::new(f64::NAN, 0.0)];
    assert_eq!(
        Roadmap::new(nowhere, [], 0.5).err(),
        Some(Refused::NoPlace { vertex: 0 })
    );
    // An edge to where one is leads nowhere, and of parallel ones the fastest counts.
    assert_eq!(of(vec![(0, 0, 1.0), (0, 1, 2.0), (0, 1, 1.0)]), Ok(1));
    let both = Roadmap::new(places.clone(), [(0, 1, 1.0), (1, 0, 2.0)], 0.5).unwrap();
    assert_eq!((both.twin(0), both.duration(1)), (NONE, 2.0));
}

/// Two discs that have to pass each other on a line with one place to step aside.
#[test]
fn who_finds_no_path_goes_first_in_the_next_order() {
    let places = [(0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (1.0, 1.0)];
    let places = places.map(|(x, y)| Vector::new(x, y)).to_vec();
    let edges = [(0, 1), (1, 2), (1, 3)]
        .into_iter()
        .flat_map(|(a, b)| [(a, b, 1.0), (b, a, 1.0)]);
    let roadmap = Roadmap::new(places, edges, SEPARATION).unwrap();
    let closeness = Closeness::new(roadmap.clone());
    // The first one parks in the middle, where the second has to pass: that one has to go first.
    let outcome = planned(&closeness, &[(3, 1), (0, 2)], 10, 1);
    let End::Solved(paths) = outcome.end else {
        panic!("{outcome:?}")
    };
    assert!(least_distance(&roadmap, &paths) > SEPARATION - 1e-9);
    assert_eq!(cost(&paths[1]), 2.0);
    assert_eq!(length(&roadmap, &paths[0]), 1.0);
    // Head on both would have to give way to each other in turn, which no order does.
    let stuck = planned(&closeness, &[(0, 2), (2, 0)], 10, 1);
    assert_eq!((stuck.end, stuck.orders), (End::GaveUp, 2));
}

/// Problems of the shared data, where they are at hand: rooms with doors, sixty discs.
#[test]
fn sixty_discs_pass_the_doors_of_rooms() {
    for number in 1..=3 {
        let Some(file) = shared(&format!("rooms-32-sparse-{number}")) else {
            return;
        };
        let case = Case::read(&file, 60).unwrap();
        let closeness = Closeness::new(case.roadmap.clone());
        let outcome = planned(&closeness, &case.tasks, 100, 1);
        let End::Solved(paths) = outcome.end else {
            panic!("{}: {:?}", file.display(), outcome.end)
        };
        let apart = least_distance(&case.roadmap, &paths);
        assert!(apart > case.roadmap.separation(0, 0) - 1e-7, "{apart}");
        assert!(sum_of_costs(&paths) > 0.0);
    }
}
