//! Verdicts against an independent look: bodies are placed at many moments, and how deep they overlap
//! there is measured by formulas of this file alone. Sampling can overlook a contact between two
//! moments, by no more than bodies move until the next one, and never sees one that is not there. So
//! where the judge finds no contact no sample may, and where it finds one samples are as near.
//!
//! Plans are those of a planner that looks at nobody: some are valid, most collide. `FLEETYARD_DATA`
//! adds roadmaps of large worlds, and `FLEETYARD_PLANS` plans of other programs: it names a file with
//! a line `TASK ROADMAP PLAN` of paths for each.

use std::collections::{BTreeMap, BinaryHeap};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use fleetyard_check::ContinuousRule;
use fleetyard_check::Pace;
use fleetyard_core::formats::read_dynobench;
use fleetyard_core::{
    Knots, Roadmap, RoadmapPlan, TrajectoryPlan, Visit, load_roadmap, load_roadmap_plan,
};
use fleetyard_views::{
    Builder, Problem, RoadmapSpec, RoadmapView, Sampling, ViewVerdict, given_roadmap, load_problem,
    world_to_roadmap,
};
use fleetyard_world::SeededRandom;

use crate::tasks::problem_in;

/// Overlaps that the judge forgives, in metres, and rounding.
const FORGIVEN_M: f64 = 1e-6 + 1e-9;

/// The poses of a path at times that ascend by `step_s`: x, y and heading.
fn poses(knots: Knots<'_>, step_s: f64, count: usize) -> Vec<[f64; 3]> {
    let mut at = 0;
    let heading = |knot: usize| knots.heading_rad.map_or(0.0, |all| all[knot]);
    let pose = |knot: usize| [knots.x_m[knot], knots.y_m[knot], heading(knot)];
    let last = knots.time_s.len() - 1;
    let moment = |number: usize| {
        let time_s = number as f64 * step_s;
        while at < last && knots.time_s[at + 1] <= time_s {
            at += 1;
        }
        if at == last {
            return pose(last);
        }
        let (from_s, to_s) = (knots.time_s[at], knots.time_s[at + 1]);
        let share = (time_s - from_s) / (to_s - from_s);
        let (from, to) = (pose(at), pose(at + 1));
        [0, 1, 2].map(|axis| from[axis] + share * (to[axis] - from[axis]))
    };
    (0..count).map(moment).collect()
}

/// Least sampled distance of the centres of each two agents.
fn nearest(plan: &TrajectoryPlan, step_s: f64) -> BTreeMap<(u32, u32), f64> {
    let count = (plan.horizon_s() / step_s).ceil() as usize + 1;
    let ways: Vec<_> = plan
        .paths()
        .map(|path| poses(path, step_s, count))
        .collect();
    let mut nearest = BTreeMap::new();
    for (a, one) in ways.iter().enumerate() {
        for (b, other) in ways.iter().enumerate().skip(a + 1) {
            let squares = one.iter().zip(other).map(|(p, q)| {
                let (x, y) = (p[0] - q[0], p[1] - q[1]);
                x * x + y * y
            });
            let least = squares.fold(f64::INFINITY, f64::min).sqrt();
            nearest.insert((a as u32, b as u32), least);
        }
    }
    nearest
}

/// Verdicts that were compared.
#[derive(Debug, Default)]
struct Tally {
    valid: usize,
    invalid: usize,
    /// Pairs of agents, and those with a contact.
    pairs: usize,
    contacts: usize,
}

/// Compares the verdict on a plan on a roadmap with samples.
#[track_caller]
fn compare(
    name: &str,
    problem: &Problem,
    view: &RoadmapView,
    plan: &RoadmapPlan,
    tally: &mut Tally,
) {
    const STEP_S: f64 = 2e-3;
    let judged = view.judge(problem, plan, Pace::StopGo, usize::MAX).unwrap();
    let Some(ViewVerdict::Roadmap(rules)) = &judged.view else {
        panic!("a roadmap has rules");
    };
    let lifted = judged.lifted.as_ref().unwrap();
    // Edges are free: all that can be wrong is how near robots are.
    let mut least: BTreeMap<(u32, u32), f64> = BTreeMap::new();
    for found in &rules.violations {
        let least_m = found.least_m.unwrap_or_else(|| panic!("{name}: {found}"));
        let pair = (found.agents[0], found.agents[1]);
        let known = least.entry(pair).or_insert(f64::INFINITY);
        *known = known.min(least_m);
    }
    assert_eq!(rules.valid, least.is_empty(), "{name}");
    let world = judged.world.as_ref().unwrap();
    assert_eq!(
        rules.valid,
        world.valid,
        "{name}: {:?}",
        world.violations.first()
    );
    let apart_m = 2.0 * view.radius_m;
    // Two robots come nearer by at most twice their speed.
    let overlooked_m = view.speed_m_per_s * STEP_S;
    for (pair, sampled_m) in nearest(lifted, STEP_S) {
        match least.get(&pair) {
            None => assert!(
                sampled_m >= apart_m - FORGIVEN_M,
                "{name}: {pair:?} are {sampled_m} m apart, and the judge finds nothing"
            ),
            Some(least_m) => {
                assert!(*least_m < apart_m, "{name}: {pair:?} {least_m}");
                assert!(
                    sampled_m >= least_m - 1e-9 && sampled_m <= least_m + overlooked_m,
                    "{name}: {pair:?} are {sampled_m} m apart, and by the judge {least_m} m"
                );
                tally.contacts += 1;
            }
        }
        tally.pairs += 1;
    }
    *if rules.valid {
        &mut tally.valid
    } else {
        &mut tally.invalid
    } += 1;
}

/// Visits along a shortest way, after a delay.
fn alone(view: &RoadmapView, agent: usize, delay_s: f64) -> Vec<Visit> {
    let roadmap = &view.roadmap;
    let length = |from: u32, to: u32| {
        let ((x, y), (u, v)) = (roadmap.position_m(from), roadmap.position_m(to));
        ((u - x) * (u - x) + (v - y) * (v - y)).sqrt()
    };
    let (start, goal) = (view.starts[agent], view.goals[agent]);
    let mut before = vec![(f64::INFINITY, start); roadmap.vertices()];
    before[start as usize].0 = 0.0;
    // Lengths are above 0, so that their bits are in their order.
    let mut open = BinaryHeap::from([(std::cmp::Reverse(0), start)]);
    while let Some((std::cmp::Reverse(bits), vertex)) = open.pop() {
        let far = f64::from_bits(bits);
        if far > before[vertex as usize].0 {
            continue;
        }
        for next in roadmap.neighbors(vertex) {
            let way = far + length(vertex, *next);
            if way < before[*next as usize].0 {
                before[*next as usize] = (way, vertex);
                open.push((std::cmp::Reverse(way.to_bits()), *next));
            }
        }
    }
    let mut way = vec![goal];
    while let Some(last) = way.last().copied().filter(|last| *last != start) {
        way.push(before[last as usize].1);
    }
    way.reverse();
    let (mut visits, mut time_s) = (Vec::new(), 0.0);
    for (number, vertex) in way.iter().enumerate() {
        let leaves_s = if number == 0 { delay_s } else { time_s };
        visits.push(Visit {
            vertex: *vertex,
            arrival_s: time_s,
            departure_s: leaves_s,
        });
        if let Some(next) = way.get(number + 1) {
            time_s = leaves_s + length(*vertex, *next) / view.speed_m_per_s;
        }
    }
    visits
}

/// Everybody takes its shortest way after a random delay of so many seconds at most.
fn careless(view: &RoadmapView, most_s: f64, random: &mut SeededRandom) -> RoadmapPlan {
    let mut plan = RoadmapPlan::default();
    for agent in 0..view.starts.len() {
        let delay_s = most_s * random.unit();
        plan.push_path(alone(view, agent, delay_s)).unwrap();
    }
    plan
}

#[test]
fn verdicts_on_roadmaps_are_those_of_samples() {
    let mut tally = Tally::default();
    for seed in 0..60 {
        let mut random = SeededRandom::new("sampled", seed);
        let agents = 2 + random.below(3);
        let mut place = || [0.3 + 3.4 * random.unit(), 0.3 + 3.4 * random.unit()];
        let ends: Vec<String> = (0..agents)
            .map(|_| format!(r#"{{"start": {:?}, "goal": {:?}}}"#, place(), place()))
            .collect();
        let pillar = r#"{"rectangle": {"center": [2, 2], "size": [0.4, 0.4]}}"#;
        // Some places are in the pillar, or too near to each other.
        let Ok(problem) = problem_in(pillar, &ends.join(", ")) else {
            continue;
        };
        let builder = Builder::Prm {
            sampling: Sampling::Uniform,
            vertices: 40,
            neighbors: 6,
        };
        let Ok(view) = world_to_roadmap(&problem, RoadmapSpec::new(builder)) else {
            continue;
        };
        for most_s in [0.0, 4.0, 12.0] {
            let plan = careless(&view, most_s, &mut random);
            compare(&format!("seed {seed}"), &problem, &view, &plan, &mut tally);
        }
    }
    assert!(tally.valid > 10 && tally.invalid > 10, "{tally:?}");
}

/// The first robots of a task of the benchmark, on its roadmap.
fn benchmark(file: &Path, agents: usize) -> (Problem, Roadmap) {
    let text = std::fs::read(file).unwrap();
    let tasks: serde_json::Value = serde_json::from_slice(&text).unwrap();
    let named = tasks["roadmap"].as_str().unwrap();
    let roadmap = load_roadmap(file.parent().unwrap().join(named)).unwrap();
    let (world, _) = Path::new(named)
        .file_name()
        .unwrap()
        .to_str()
        .unwrap()
        .rsplit_once('-')
        .unwrap();
    let world = file
        .parent()
        .unwrap()
        .join(format!("../worlds/{world}.world.json"));
    let place = |key: &str, agent: usize| {
        let vertex = tasks[key][agent].as_u64().unwrap() as u32;
        let (x, y) = roadmap.position_m(vertex);
        [x, y]
    };
    let ends: Vec<String> = (0..agents)
        .map(|agent| {
            let (start, goal) = (place("starts", agent), place("goals", agent));
            format!(r#"{{"start": {start:?}, "goal": {goal:?}}}"#)
        })
        .collect();
    let task = format!(
        r#"{{"format": "fleetyard.task/1", "world": {}, "robots": {{"disc": {{
            "footprint": {{"disc": {{"radius_m": {}}}}}, "model": {{"single-integrator": {{"speed_m_per_s": {}}}}}}}}},
            "agents": [{}]}}"#,
        serde_json::json!(std::fs::canonicalize(world).unwrap()),
        tasks["radius_m"],
        tasks["speed_m_per_s"],
        ends.join(", ")
    );
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("t.task.json");
    std::fs::write(&file, task).unwrap();
    (load_problem(&file).unwrap(), roadmap)
}

#[test]
fn verdicts_on_roadmaps_of_large_worlds_are_those_of_samples() {
    let Some(data) = std::env::var_os("FLEETYARD_DATA") else {
        eprintln!("skipped: FLEETYARD_DATA names no folder");
        return;
    };
    let folder = PathBuf::from(data).join("continuous/roadmap-tasks");
    if !folder.exists() {
        eprintln!("skipped: there is no {}", folder.display());
        return;
    }
    let mut tally = Tally::default();
    for world in ["empty-32", "boxes-32", "rooms-32", "aisles-32"] {
        for density in ["sparse", "dense"] {
            let file = folder.join(format!("{world}-{density}-1.tasks.json"));
            for agents in [5, 20] {
                let (problem, roadmap) = benchmark(&file, agents);
                let view = given_roadmap(&problem, roadmap, None).unwrap();
                let mut random = SeededRandom::new("sampled", agents as u64);
                for most_s in [0.0, 20.0] {
                    let plan = careless(&view, most_s, &mut random);
                    let name = format!("{} {agents}", file.display());
                    compare(&name, &problem, &view, &plan, &mut tally);
                }
            }
        }
    }
    assert!(tally.valid > 0 && tally.invalid > 10, "{tally:?}");
}

#[test]
fn verdicts_on_plans_of_other_programs_are_those_of_samples() {
    let Some(list) = std::env::var_os("FLEETYARD_PLANS") else {
        eprintln!("skipped: FLEETYARD_PLANS names no list of plans");
        return;
    };
    let mut tally = Tally::default();
    for line in std::fs::read_to_string(list).unwrap().lines() {
        let [task, roadmap, plan] = line.split(' ').collect::<Vec<_>>()[..] else {
            panic!("{line}: not a task, a roadmap and a plan");
        };
        let problem = load_problem(Path::new(task)).unwrap();
        let view = given_roadmap(&problem, load_roadmap(roadmap).unwrap(), None).unwrap();
        let file = load_roadmap_plan(plan).unwrap();
        compare(plan, &problem, &view, &file.plan, &mut tally);
    }
    eprintln!("{tally:?}");
}

/// The corners of a rectangle, counter-clockwise.
fn corners([x, y, heading]: [f64; 3], [length, width]: [f64; 2]) -> [[f64; 2]; 4] {
    let (sin, cos) = heading.sin_cos();
    [[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]].map(|[along, across]| {
        let (u, v) = (along * length / 2.0, across * width / 2.0);
        [x + u * cos - v * sin, y + u * sin + v * cos]
    })
}

/// The depth of an overlap of two rectangles: the shortest way along a normal of a side that parts them;
/// below 0 where a side parts them.
fn depth(one: &[[f64; 2]; 4], other: &[[f64; 2]; 4]) -> f64 {
    let beyond = |of: &[[f64; 2]; 4], from: &[[f64; 2]; 4]| {
        let sides = (0..4).map(|side| {
            let ([x, y], [u, v]) = (of[side], of[(side + 1) % 4]);
            let length = ((u - x) * (u - x) + (v - y) * (v - y)).sqrt();
            let normal = [(v - y) / length, (x - u) / length];
            let out = from
                .iter()
                .map(|[p, q]| (p - x) * normal[0] + (q - y) * normal[1]);
            out.fold(f64::INFINITY, f64::min)
        });
        sides.fold(f64::NEG_INFINITY, f64::max)
    };
    -beyond(one, other).max(beyond(other, one))
}

/// States of first-order unicycles that drive about at random, as programs of dynobench write them.
fn result(starts: &[[f64; 3]], random: &mut SeededRandom) -> String {
    let mut text = String::from("cost: 1\nresult:\n");
    for start in starts {
        text.push_str("  - states:\n");
        let [mut x, mut y, mut heading] = *start;
        let mut control = [0.0; 2];
        for step in 0..60 {
            // Writing to a string cannot fail.
            let _ = writeln!(text, "      - [{x}, {y}, {heading}]");
            if step % 15 == 0 {
                control = [random.unit() - 0.2, random.unit() - 0.5].map(|one| one.min(0.5));
            }
            let (sin, cos) = heading.sin_cos();
            x += 0.1 * control[0] * cos;
            y += 0.1 * control[0] * sin;
            heading += 0.1 * control[1];
        }
        text.push_str("    actions: []\n");
    }
    text
}

#[test]
fn verdicts_in_the_plane_are_those_of_samples() {
    const STEP_S: f64 = 1e-3;
    const SIZE_M: [f64; 2] = [0.5, 0.25];
    // The most that a corner moves until the next moment, of both bodies.
    const OVERLOOKED_M: f64 = 2.0 * STEP_S * (0.5 + 0.5 * 0.28);
    let (low, high) = ([0.8, 0.9], [1.4, 1.3]);
    let pillar = [
        [high[0], high[1]],
        [low[0], high[1]],
        low,
        [high[0], low[1]],
    ];
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(
        folder.path().join("w.json"),
        r#"{"format": "fleetyard.world/1", "bounds_m": [0, 0, 2.4, 2.4],
            "obstacles": [{"polygon": [[0.8, 0.9], [1.4, 0.9], [1.4, 1.3], [0.8, 1.3]]}]}"#,
    )
    .unwrap();
    let starts = [[0.5, 0.5, 0.0], [1.9, 0.5, 2.0], [0.5, 1.9, -1.0]];
    let ends = starts.map(|start| format!(r#"{{"start": {start:?}, "goal": {start:?}}}"#));
    let task = format!(
        r#"{{"format": "fleetyard.task/1", "world": "w.json", "robots": {{"cart": "dynobench-unicycle-1"}},
            "agents": [{}]}}"#,
        ends.join(", ")
    );
    let file = folder.path().join("t.task.json");
    std::fs::write(&file, task).unwrap();
    let problem = load_problem(&file).unwrap();
    let (mut clear, mut met) = (0, 0);
    for seed in 0..60 {
        let mut random = SeededRandom::new("unicycles", seed);
        let text = result(&starts, &mut random);
        let plan = read_dynobench("result.yaml", text.as_bytes()).unwrap();
        let judged = problem.judge(&plan, usize::MAX);
        let world = judged.world.unwrap();
        let found = |rule: ContinuousRule, agents: &[u32]| {
            let mut found = world.violations.iter();
            found.any(|found| found.rule == rule && found.agents == agents)
        };
        let count = (plan.horizon_s() / STEP_S).ceil() as usize + 1;
        let bodies: Vec<Vec<[[f64; 2]; 4]>> = plan
            .paths()
            .map(|path| {
                let poses = poses(path, STEP_S, count);
                poses
                    .into_iter()
                    .map(|pose| corners(pose, SIZE_M))
                    .collect()
            })
            .collect();
        let mut check = |what: String, is_found: bool, deepest: f64| {
            if is_found {
                assert!(deepest > -OVERLOOKED_M, "seed {seed}, {what}: {deepest} m");
                met += 1;
            } else {
                // Of bodies that turn a micrometre more may be overlooked.
                assert!(
                    deepest <= FORGIVEN_M + 1e-6,
                    "seed {seed}, {what}: {deepest} m"
                );
                clear += 1;
            }
        };
        for (a, one) in bodies.iter().enumerate() {
            let number = a as u32;
            for (b, other) in bodies.iter().enumerate().skip(a + 1) {
                let depths = one.iter().zip(other).map(|(p, q)| depth(p, q));
                let deepest = depths.fold(f64::NEG_INFINITY, f64::max);
                let is_found = found(ContinuousRule::AgentContact, &[number, b as u32]);
                check(format!("{a} and {b}"), is_found, deepest);
            }
            let depths = one.iter().map(|body| depth(body, &pillar));
            let deepest = depths.fold(f64::NEG_INFINITY, f64::max);
            let is_found = found(ContinuousRule::ObstacleContact, &[number]);
            check(format!("{a} and the pillar"), is_found, deepest);
            let over = one.iter().flatten().flatten().map(|at| (-at).max(at - 2.4));
            let deepest = over.fold(f64::NEG_INFINITY, f64::max);
            let is_found = found(ContinuousRule::OutOfBounds, &[number]);
            check(format!("{a} and the bounds"), is_found, deepest);
        }
    }
    assert!(clear > 100 && met > 30, "{clear} {met}");
}
