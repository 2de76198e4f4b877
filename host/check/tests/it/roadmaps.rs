//! Plans on roadmaps: every rule by its name, and the judge against dense sampling.

use fleetyard_check::{
    Pace, RoadmapRule, RoadmapTask, RoadmapVerdict, RoadmapViolation, validate_roadmap,
};
use fleetyard_core::{Roadmap, RoadmapPlan, Visit};
use fleetyard_world::{Footprint, Shape};
use proptest::prelude::*;

fn disc(radius_m: f64) -> Shape {
    Footprint::Disc { radius_m }.shape().unwrap()
}

/// A roadmap whose edges go both ways.
fn roadmap(vertices: &[(f64, f64)], edges: &[(u32, u32)]) -> Roadmap {
    let (x_m, y_m) = vertices.iter().copied().unzip();
    let both = edges
        .iter()
        .flat_map(|&(from, to)| [(from, to), (to, from)]);
    Roadmap::new(x_m, y_m, both).unwrap()
}

fn plan(paths: &[&[(u32, f64, f64)]]) -> RoadmapPlan {
    let mut plan = RoadmapPlan::default();
    for path in paths {
        let visits = path.iter().map(|&(vertex, arrival_s, departure_s)| Visit {
            vertex,
            arrival_s,
            departure_s,
        });
        plan.push_path(visits).unwrap();
    }
    plan
}

/// A crossing of four arms of 2 m about vertex 0, of which the western one goes on to 7, and a way
/// that crosses the eastern one, from 5 to 6.
fn crossing() -> Roadmap {
    roadmap(
        &[
            (0.0, 0.0),
            (2.0, 0.0),
            (0.0, 2.0),
            (-2.0, 0.0),
            (0.0, -2.0),
            (1.0, 1.0),
            (1.0, -1.0),
            (-4.0, 0.0),
        ],
        &[(0, 1), (0, 2), (0, 3), (0, 4), (5, 6), (3, 7)],
    )
}

/// Judges a plan in as much time as it takes at that speed, instead of at 1 m/s.
fn judge_at(
    speed: f64,
    roadmap: &Roadmap,
    radius_m: f64,
    paths: &[&[(u32, f64, f64)]],
) -> RoadmapVerdict {
    let at_speed = |path: &&[(u32, f64, f64)]| -> Vec<(u32, f64, f64)> {
        let visit = |visit: &(u32, f64, f64)| (visit.0, visit.1 / speed, visit.2 / speed);
        path.iter().map(visit).collect()
    };
    let paths: Vec<Vec<(u32, f64, f64)>> = paths.iter().map(at_speed).collect();
    let paths: Vec<&[(u32, f64, f64)]> = paths.iter().map(Vec::as_slice).collect();
    let disc = disc(radius_m);
    let task = RoadmapTask::new(roadmap, &disc, speed);
    let verdict = validate_roadmap(&plan(&paths), &task, 100);
    assert_eq!(verdict.valid, verdict.violations.is_empty());
    verdict
}

fn judge(radius_m: f64, paths: &[&[(u32, f64, f64)]]) -> RoadmapVerdict {
    judge_at(1.0, &crossing(), radius_m, paths)
}

type Told = (RoadmapRule, Vec<u32>, Option<u32>);

/// Rule, vertices and least distance, in thousandths, of every violation of robots that are 0.5 m
/// across: at 1 m/s, and at half and twice that in twice and half of the time.
fn found_on(roadmap: &Roadmap, paths: &[&[(u32, f64, f64)]]) -> Vec<Told> {
    let at = |speed: f64| -> Vec<Told> {
        let verdict = judge_at(speed, roadmap, 0.25, paths);
        let told = |found: RoadmapViolation| {
            let least = found.least_m.map(|least| (least * 1e3).round() as u32);
            (found.rule, found.vertices, least)
        };
        verdict.violations.into_iter().map(told).collect()
    };
    let found = at(1.0);
    assert_eq!(at(0.5), found);
    assert_eq!(at(2.0), found);
    found
}

fn found(paths: &[&[(u32, f64, f64)]]) -> Vec<Told> {
    found_on(&crossing(), paths)
}

/// From the west to the east in passing the crossing at 2 s.
const EASTWARD: &[(u32, f64, f64)] = &[(3, 0.0, 0.0), (0, 2.0, 2.0), (1, 4.0, 4.0)];

#[test]
fn contacts_have_the_names_of_the_rules() {
    use RoadmapRule::{CrossingEdges, HeadOn, Headway, Near, VertexConflict};
    let with_eastward = |other: &[(u32, f64, f64)]| found(&[EASTWARD, other]);
    // (i): at the crossing together, and where one rests.
    let northward = &[(4, 0.0, 0.0), (0, 2.0, 2.0), (2, 4.0, 4.0)];
    assert_eq!(
        with_eastward(northward),
        [(VertexConflict, vec![0, 0], Some(0))]
    );
    assert_eq!(
        with_eastward(&[(0, 0.0, 0.0)]),
        [(VertexConflict, vec![0, 0], Some(0))]
    );
    // (ii): on one edge, each the other way.
    let westward = &[(0, 0.0, 1.0), (3, 3.0, 3.0)];
    assert_eq!(
        with_eastward(westward),
        [(HeadOn, vec![3, 0, 0, 3], Some(0))]
    );
    // (iii): on one edge, and through a vertex; 2r/ν is half a second.
    let close = &[(0, 0.0, 1.75), (1, 3.75, 3.75)];
    let behind = [EASTWARD, close].map(|path| &path[..2]);
    assert_eq!(found(&behind), [(Headway, vec![3, 0, 0], Some(250))]);
    let leads = &[(3, 0.0, 2.0), (0, 4.0, 4.0), (2, 6.0, 6.0)];
    let follows = &[(7, 0.0, 0.3), (3, 2.3, 2.3), (0, 4.3, 9.0)];
    assert_eq!(
        found(&[leads, follows]),
        [(Headway, vec![0, 2, 3, 0], Some(212))]
    );
    assert_eq!(
        found(&[follows, leads]),
        [(Headway, vec![3, 0, 0, 2], Some(212))]
    );
    // (iv): where two edges cross without a vertex.
    let over = &[(5, 0.0, 2.0), (6, 4.0, 4.0)];
    assert_eq!(
        with_eastward(over),
        [(CrossingEdges, vec![0, 1, 5, 6], Some(0))]
    );
    // None of the four: a headway of half a second and more, but round a corner.
    let exactly = &[(4, 0.0, 0.5), (0, 2.5, 2.5), (3, 4.5, 4.5)];
    assert_eq!(
        with_eastward(exactly),
        [(Near, vec![0, 1, 4, 0], Some(354))]
    );
    let later = &[(4, 0.0, 0.55), (0, 2.55, 2.55), (3, 4.55, 4.55)];
    assert_eq!(with_eastward(later), [(Near, vec![0, 1, 4, 0], Some(389))]);
    let later = &[(4, 0.0, 0.8), (0, 2.8, 2.8), (3, 4.8, 4.8)];
    assert_eq!(with_eastward(later), []);
}

#[test]
fn robots_of_a_smaller_radius_are_held_to_it() {
    let paths: [&[(u32, f64, f64)]; 2] = [EASTWARD, &[(4, 0.0, 0.55), (0, 2.55, 2.55)]];
    let least = judge(0.25, &paths).violations[0].least_m.unwrap();
    assert!(!judge(0.5 * least + 1e-5, &paths).valid);
    assert!(judge(0.5 * least - 1e-5, &paths).valid);
}

/// Edges that neither join nor cross were taken for some that do.
#[test]
fn contacts_beside_edges_have_no_rule() {
    use RoadmapRule::Near;
    let mut vertices: Vec<(f64, f64)> = (0..8).map(|at| crossing().position_m(at)).collect();
    // Beside the east end of the arm, upwards and downwards; and on the arm itself, from below.
    vertices.extend([(2.2, 0.3), (2.2, 2.3), (2.2, -1.7), (1.0, -1.0), (1.0, 0.0)]);
    let roadmap = roadmap(&vertices, &[(0, 1), (3, 0), (8, 9), (8, 10), (11, 12)]);
    let of_both =
        |other: &[(u32, f64, f64)], one_first: &[u32], other_first: &[u32], least: u32| {
            let near = |vertices: &[u32]| [(Near, vertices.to_vec(), Some(least))];
            assert_eq!(found_on(&roadmap, &[EASTWARD, other]), near(one_first));
            assert_eq!(found_on(&roadmap, &[other, EASTWARD]), near(other_first));
        };
    // It begins less than half a second before the other arrives, elsewhere.
    let upward = &[(8, 0.0, 3.8), (9, 5.8, 5.8)];
    of_both(upward, &[0, 1, 8, 9], &[8, 9, 0, 1], 495);
    // It crosses the line of the arm, beyond its end.
    let downward = &[(8, 0.0, 3.4), (10, 5.4, 5.4)];
    of_both(downward, &[0, 1, 8, 10], &[8, 10, 0, 1], 354);
    // It ends on the arm, or begins there.
    let onto = &[(11, 0.0, 2.4), (12, 3.4, 3.4), (11, 4.4, 4.4)];
    of_both(onto, &[0, 1, 11, 12], &[11, 12, 0, 1], 283);
    let from = &[(12, 0.0, 2.6), (11, 3.6, 3.6)];
    of_both(from, &[0, 1, 12, 11], &[12, 11, 0, 1], 283);
    // One stands, where the other passes or arrives.
    of_both(&[(12, 0.0, 0.0)], &[0, 1, 12], &[12, 0, 1], 0);
    of_both(&[(8, 0.0, 0.0)], &[1, 8], &[8, 1], 361);
}

#[test]
fn sentences_round_to_a_millionth() {
    let verdict = judge(0.25, &[EASTWARD, &[(4, 0.0, 0.55), (0, 2.55, 2.55)]]);
    let sentence = &verdict.violations[0].sentence;
    let (what, nearest) = sentence.split_once(": nearer than 0.5 m from ").unwrap();
    assert_eq!(what, "agents 0 and 1 drive between 0 and 1, 4 and 0");
    assert!(nearest.ends_with(" s, 0.388909 m at 2.275 s"), "{nearest}");
    // A contact that never ends is at its end.
    let verdict = judge(0.25, &[EASTWARD, &[(1, 0.0, 0.0)]]);
    let sentence = &verdict.violations[0].sentence;
    assert!(
        sentence.ends_with(" s on, 0 m at 4 s") && verdict.violations[0].end_s.is_none(),
        "{sentence}"
    );
}

/// At 1 m/s a length is a time.
#[test]
fn the_time_of_an_edge_is_its_length_by_the_speed() {
    use RoadmapRule::{TooFast, TooSlow};
    let (roadmap, disc) = (crossing(), disc(0.25));
    for (speed, needs_s) in [(0.5, 4.0), (2.0, 1.0)] {
        let judged = |pace, time_s: f64, takes_s: f64| {
            let task = RoadmapTask {
                pace,
                time_s,
                ..RoadmapTask::new(&roadmap, &disc, speed)
            };
            let path: &[(u32, f64, f64)] = &[(3, 0.0, 0.5), (0, 0.5 + takes_s, 99.0)];
            let verdict = validate_roadmap(&plan(&[path]), &task, 10);
            assert_eq!(verdict.valid, verdict.violations.is_empty());
            let told =
                |found: &RoadmapViolation| (found.rule, found.time_s, found.vertices.clone());
            verdict.violations.first().map(told)
        };
        for pace in [Pace::StopGo, Pace::Slower] {
            assert_eq!(judged(pace, 1e-6, needs_s), None);
            let fast = Some((TooFast, 0.5, vec![3, 0]));
            assert_eq!(judged(pace, 1e-6, needs_s - 1e-3), fast);
            // What is forgiven is, to the end.
            assert_eq!(judged(pace, 0.25, needs_s - 0.25), None);
            assert_eq!(judged(pace, 0.25, needs_s - 0.375), fast);
        }
        let slow = Some((TooSlow, 0.5, vec![3, 0]));
        assert_eq!(judged(Pace::StopGo, 1e-6, needs_s + 1e-3), slow);
        assert_eq!(judged(Pace::StopGo, 0.25, needs_s + 0.25), None);
        assert_eq!(judged(Pace::StopGo, 0.25, needs_s + 0.375), slow);
        assert_eq!(judged(Pace::Slower, 1e-6, 3.0 * needs_s), None);
    }
}

#[test]
fn what_is_wrong_with_one_path_is_named() {
    use Pace::{Slower, StopGo};

    let roadmap = crossing();
    let disc = disc(0.25);
    let told = |pace, paths: &[&[(u32, f64, f64)]], starts: &[u32], goals: &[u32]| {
        let task = RoadmapTask {
            pace,
            starts: Some(starts),
            goals: Some(goals),
            ..RoadmapTask::new(&roadmap, &disc, 1.0)
        };
        let verdict = validate_roadmap(&plan(paths), &task, 100);
        assert_eq!(verdict.valid, verdict.violations.is_empty());
        let is_whole = |found: &RoadmapViolation| {
            let rule = found.rule.name();
            !rule.starts_with("no-such") && rule != "agent-count"
        };
        if !verdict.violations.iter().all(is_whole) {
            // Nobody looked for contacts.
            assert!(verdict.checked_until_s <= 0.0);
        }
        let told = |found: RoadmapViolation| format!("{}: {}", found.rule, found.sentence);
        verdict.violations.into_iter().map(told).collect::<Vec<_>>()
    };
    assert_eq!(told(StopGo, &[EASTWARD], &[3], &[1]), [""; 0]);
    assert_eq!(
        told(StopGo, &[EASTWARD], &[4], &[2]),
        [
            "wrong-start: agent 0 begins at vertex 3, its start is 4",
            "wrong-goal: agent 0 ends at vertex 1, its goal is 2",
        ]
    );
    assert_eq!(
        told(StopGo, &[EASTWARD], &[3], &[1, 2]),
        ["agent-count: the plan has 1 agents, but there are 2 goals"]
    );
    assert_eq!(
        told(StopGo, &[EASTWARD], &[3, 4], &[1]),
        ["agent-count: the plan has 1 agents, but there are 2 starts"]
    );
    assert_eq!(
        told(
            StopGo,
            &[&[(3, 0.0, 0.0), (1, 4.0, 4.0), (8, 5.0, 5.0)]],
            &[3],
            &[8]
        ),
        [
            "no-such-edge: visit 1 of agent 0: the roadmap has no edge from 3 to 1",
            "no-such-vertex: visit 2 of agent 0 is to vertex 8, but the roadmap has 8",
        ]
    );
    let slow: &[(u32, f64, f64)] = &[(3, 0.0, 0.0), (0, 2.5, 2.5)];
    assert_eq!(told(Slower, &[slow], &[3], &[0]), [""; 0]);
    assert_eq!(
        told(StopGo, &[slow], &[3], &[0]),
        ["too-slow: agent 0 takes 2.5 s from vertex 3 to 0 from 0 s on, which at 1 m/s takes 2 s"]
    );
    for pace in [StopGo, Slower] {
        assert_eq!(
            told(pace, &[&[(3, 0.0, 0.0), (0, 1.5, 1.5)]], &[3], &[0]),
            [
                "too-fast: agent 0 takes 1.5 s from vertex 3 to 0 from 0 s on, which at 1 m/s takes 2 s"
            ]
        );
    }
}

#[test]
fn rules_have_their_words() {
    for rule in <RoadmapRule as fleetyard_core::Words>::ALL {
        assert_eq!(serde_json::to_value(rule).unwrap(), rule.name());
    }
}

/// A random roadmap and random walks on it.
#[derive(Debug, Clone)]
struct Case {
    roadmap: Roadmap,
    plan: RoadmapPlan,
    pace: Pace,
    radius_m: f64,
}

const SPEED: f64 = 1.0;

fn case() -> impl Strategy<Value = Case> {
    let places = proptest::collection::vec((0.0..6.0f64, 0.0..6.0f64), 4..10);
    let noise = proptest::collection::vec(0.0..1.0f64, 100);
    (places, noise, 2usize..5, any::<bool>(), 0.05..0.4f64).prop_map(
        |(places, noise, agents, stop_go, radius_m)| {
            let mut noise = noise.into_iter().cycle();
            let mut draw = move || noise.next().unwrap();
            let count = places.len() as u32;
            let ring = (0..count).map(|vertex| (vertex, (vertex + 1) % count));
            let chords = (0..count).map(|vertex| (vertex, (vertex + 2) % count));
            let kept = chords.filter(|(from, to)| from != to && (from + to) % 3 != 0);
            let edges: Vec<(u32, u32)> = ring.chain(kept).collect();
            let roadmap = roadmap(&places, &edges);
            let mut plan = RoadmapPlan::default();
            for _ in 0..agents {
                let mut vertex = (draw() * f64::from(count)) as u32;
                let mut time = 0.0;
                let mut visits = Vec::new();
                for _ in 0..=(draw() * 5.0) as usize {
                    let arrival_s = time;
                    // Half of them go on at once.
                    time += (2.0 * draw() - 1.0).max(0.0);
                    visits.push(Visit {
                        vertex,
                        arrival_s,
                        departure_s: time,
                    });
                    let ways = roadmap.neighbors(vertex);
                    let next = ways[(draw() * ways.len() as f64) as usize];
                    let ((ax, ay), (bx, by)) =
                        (roadmap.position_m(vertex), roadmap.position_m(next));
                    let slower = if stop_go { 1.0 } else { 1.0 + draw() };
                    time += (ax - bx).hypot(ay - by) / SPEED * slower + 1e-12;
                    vertex = next;
                }
                visits.push(Visit {
                    vertex,
                    arrival_s: time,
                    departure_s: time,
                });
                plan.push_path(visits).unwrap();
            }
            let pace = if stop_go { Pace::StopGo } else { Pace::Slower };
            Case {
                roadmap,
                plan,
                pace,
                radius_m,
            }
        },
    )
}

/// The place of an agent at a time, from the visits themselves.
fn sampled(roadmap: &Roadmap, path: &[Visit], time_s: f64) -> (f64, f64) {
    for (before, after) in path.iter().zip(&path[1..]) {
        if time_s <= before.departure_s {
            return roadmap.position_m(before.vertex);
        }
        if time_s < after.arrival_s {
            let share = (time_s - before.departure_s) / (after.arrival_s - before.departure_s);
            let (a, b) = (
                roadmap.position_m(before.vertex),
                roadmap.position_m(after.vertex),
            );
            return (a.0 + (b.0 - a.0) * share, a.1 + (b.1 - a.1) * share);
        }
    }
    roadmap.position_m(path[path.len() - 1].vertex)
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 400,
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn dense_sampling_agrees(Case { roadmap, plan, pace, radius_m } in case()) {
        let disc = disc(radius_m);
        let task = RoadmapTask { pace, ..RoadmapTask::new(&roadmap, &disc, SPEED) };
        let verdict = validate_roadmap(&plan, &task, usize::MAX);
        let step_s = 1.0 / 512.0;
        let steps = (plan.horizon_s() / step_s).ceil() as u32 + 1;
        for one in 0..plan.agents() {
            for two in one + 1..plan.agents() {
                let least = (0..=steps).map(|step| {
                    let time_s = f64::from(step) * step_s;
                    let [a, b] = [one, two].map(|agent| sampled(&roadmap, plan.path(agent), time_s));
                    (a.0 - b.0).hypot(a.1 - b.1)
                }).fold(f64::INFINITY, f64::min);
                let pair = [one as u32, two as u32];
                let of_pair = verdict.violations.iter().filter(|found| found.agents == pair);
                let judged = of_pair.filter_map(|found| found.least_m).fold(f64::INFINITY, f64::min);
                // Both of a pair move towards each other in half of a step at most.
                let off = SPEED * step_s;
                if judged.is_finite() {
                    prop_assert!(judged < 2.0 * radius_m - task.overlap_m + 1e-9);
                    prop_assert!(least >= judged - 1e-9, "{least} {judged}");
                    prop_assert!(least <= judged + off + 1e-9, "{least} {judged}");
                } else {
                    prop_assert!(least >= 2.0 * radius_m - task.overlap_m - 1e-9, "{least} {radius_m}");
                }
            }
        }
        // Nothing but contacts is wrong with these plans.
        prop_assert!(verdict.violations.iter().all(|found| found.agents.len() == 2));
        prop_assert_eq!(verdict.valid, verdict.violations.is_empty());
        prop_assert!((verdict.checked_until_s - plan.horizon_s()).abs() < 1e-9);
    }
}
