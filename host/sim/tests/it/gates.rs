//! Gated execution under adversaries: whatever the delays, nobody collides and
//! everybody arrives.

use std::collections::BTreeSet;

use crate::common::{below, random_grid, rng, starts, turning_blocks, valid_drives, valid_walks};
use fleetyard_core::{Connectivity, Grid, GridPlan, Knot, TrajectoryPlan};
use fleetyard_sim::gate::{DependencyGraph, GateError, GateOptions, Gates, GridRoutes, Routes};
use fleetyard_sim::noise::Messages;
use fleetyard_sim::{Fleet, NoTrace, Policy, Profile, SimConfig, Simulator, Tier};
use fleetyard_world::{Footprint, Pose, Shape};
use parry2d_f64::math::{Pose as Isometry, Vector};
use parry2d_f64::query;
use parry2d_f64::shape::{Ball, ConvexPolygon, Cuboid};
use rand_chacha::ChaCha8Rng;

/// Overlaps up to this are rounding, in metres.
const TOUCH_M: f64 = 1e-5;

fn unit(rng: &mut ChaCha8Rng) -> f64 {
    (below(rng, 1 << 20) as f64 + 0.5) / f64::from(1 << 20)
}

fn disc(radius_m: f64) -> Footprint {
    Footprint::Disc { radius_m }
}

fn open(rows: u32, cols: u32) -> Grid {
    let terrain = vec![b'.'; (rows * cols) as usize];
    Grid::new("open", rows, cols, terrain).expect("a valid map")
}

/// A fleet of one shape each, the oracle of overlaps, and the graph.
struct World<'a, R> {
    routes: &'a R,
    footprints: &'a [Footprint],
    shapes: Vec<Shape>,
}

impl<'a, R: Routes> World<'a, R> {
    fn new(routes: &'a R, footprints: &'a [Footprint]) -> Self {
        let shapes = footprints.iter().map(|f| f.shape().expect("a footprint"));
        Self {
            routes,
            footprints,
            shapes: shapes.collect(),
        }
    }

    fn shape(&self, agent: usize) -> &Shape {
        &self.shapes[agent % self.shapes.len()]
    }

    fn build(&self, options: &GateOptions) -> Result<DependencyGraph, GateError> {
        DependencyGraph::build(self.routes, &|agent| self.shape(agent), options)
    }

    /// parry's opinion, with bodies a little smaller than they are.
    fn overlap(&self, a: usize, at: Pose, b: usize, bt: Pose) -> bool {
        let (dx, dy) = (at.x - bt.x, at.y - bt.y);
        let reach = self.shape(a).effective_radius_m() + self.shape(b).effective_radius_m();
        if dx * dx + dy * dy >= reach * reach {
            return false;
        }
        let body = |agent: usize| -> Box<dyn parry2d_f64::shape::Shape> {
            match &self.footprints[agent % self.footprints.len()] {
                Footprint::Disc { radius_m } => Box::new(Ball::new(radius_m - TOUCH_M)),
                Footprint::Rectangle { length_m, width_m } => Box::new(Cuboid::new(Vector::new(
                    length_m / 2.0 - TOUCH_M,
                    width_m / 2.0 - TOUCH_M,
                ))),
                Footprint::Polygon { .. } => {
                    let shape = self.shape(agent);
                    let less = 1.0 - TOUCH_M / shape.effective_radius_m();
                    let corners = shape.vertices().iter();
                    let corners = corners.map(|at| Vector::new(at.x, at.y) * less).collect();
                    Box::new(ConvexPolygon::from_convex_polyline(corners).expect("convex"))
                }
            }
        };
        let place = |pose: Pose| Isometry::new(Vector::new(pose.x, pose.y), pose.heading);
        let (one, two) = (place(at), place(bt));
        let test = query::intersection_test(&one, &*body(a), &two, &*body(b));
        test.expect("supported").intersecting
    }
}

/// The rule that chooses the agent to be moved next, and the distance.
#[derive(Debug, Clone, Copy)]
enum Adversary {
    /// Anybody, anywhere.
    Random,
    /// Everybody but one, as long as that is possible at all.
    Starve(usize),
    /// The agent with the largest number that can move, as far as it can.
    Last,
    /// Anybody goes half of an action, and is left there until nobody else can move.
    StopWithin,
}

/// Per agent and action, the turns at which it began and ended.
struct Journal {
    began: Vec<Vec<usize>>,
    ended: Vec<Vec<usize>>,
}

/// Executes a graph, one agent at a time, and looks at every place where an agent
/// comes to be.
fn execute<R: Routes>(
    world: &World<'_, R>,
    graph: &DependencyGraph,
    adversary: Adversary,
    messages: &Messages,
    rng: &mut ChaCha8Rng,
) -> Journal {
    let routes = graph.routes(world.routes);
    let agents = graph.agents();
    let mut gates = Gates::with_messages(graph.clone(), messages, 5, 0.1);
    let mut progress = vec![0.0; agents];
    let mut poses: Vec<Pose> = (0..agents).map(|agent| routes.pose(agent, 0)).collect();
    let mut stopped = vec![false; agents];
    let (mut block, mut idle) = (0, 0);
    let never = |agent| vec![usize::MAX; graph.actions(agent) + 1];
    let mut journal = Journal {
        began: (0..agents).map(never).collect(),
        ended: (0..agents).map(never).collect(),
    };
    let mut turn = 0;
    while !gates.is_finished() {
        gates.exchange(block);
        block += 1;
        let may: Vec<usize> = (0..agents)
            .filter(|agent| gates.reached()[*agent] < gates.released()[*agent])
            .collect();
        if may.is_empty() {
            // Messages may be under way, and some are lost.
            idle += 1;
            let patience = if messages.is_none() { 0 } else { 200 };
            assert!(idle <= patience, "deadlock at {:?}", gates.reached());
            continue;
        }
        idle = 0;
        let (agent, share) = match adversary {
            Adversary::Random => {
                let share = if below(rng, 3) == 0 { 1.0 } else { unit(rng) };
                (may[below(rng, may.len())], share)
            }
            Adversary::Starve(one) => {
                let others: Vec<usize> = may.iter().copied().filter(|a| *a != one).collect();
                match others.get(below(rng, others.len().max(1))) {
                    Some(agent) => (*agent, 1.0),
                    // It is let go as little as it can be.
                    None => (one, if progress[one] > 0.9 { 1.0 } else { 0.4 }),
                }
            }
            Adversary::Last => (may[may.len() - 1], 1.0),
            Adversary::StopWithin => {
                let free: Vec<usize> = may.iter().copied().filter(|a| !stopped[*a]).collect();
                if let Some(agent) = free.get(below(rng, free.len().max(1))) {
                    stopped[*agent] = true;
                    (*agent, 0.5)
                } else {
                    let agent = may[below(rng, may.len())];
                    stopped[agent] = below(rng, 2) == 0;
                    (agent, 1.0)
                }
            }
        };
        let reached = gates.reached()[agent] as usize;
        turn += 1;
        let began = &mut journal.began[agent][reached + 1];
        *began = turn.min(*began);
        let to = (progress[agent] + share * (1.0 - progress[agent])).min(1.0);
        let (from, end) = (routes.pose(agent, reached), routes.pose(agent, reached + 1));
        // Places on the way, so that nobody jumps over anybody.
        for step in 1..=4 {
            let at = progress[agent] + (to - progress[agent]) * f64::from(step) / 4.0;
            let pose = from.toward(end, at);
            for (other, there) in poses.iter().enumerate() {
                assert!(
                    other == agent || !world.overlap(agent, pose, other, *there),
                    "agents {agent} at {pose:?} and {other} at {there:?} overlap in {adversary:?}"
                );
            }
            poses[agent] = pose;
        }
        progress[agent] = to;
        if to >= 1.0 {
            progress[agent] = 0.0;
            journal.ended[agent][reached + 1] = turn;
            gates.done(agent, reached + 1);
        }
    }
    for (agent, pose) in poses.iter().enumerate() {
        let last = world.routes.actions(agent);
        assert_eq!(*pose, world.routes.pose(agent, last), "agent {agent}");
    }
    journal
}

/// An agent and one of its actions.
type Action = (usize, usize);

/// Actions of two agents that pass one place, the one that the plan has first before the other.
fn passes<R: Routes>(world: &World<'_, R>, graph: &DependencyGraph) -> Vec<(Action, Action)> {
    let routes = graph.routes(world.routes);
    let mut all = Vec::new();
    for agent in 0..graph.agents() {
        for action in 1..=graph.actions(agent) {
            let ends = [action - 1, action].map(|knot| routes.pose(agent, knot));
            let times = [action - 1, action].map(|knot| routes.time_s(agent, knot));
            let [from, to] = ends.map(|pose| [pose.x, pose.y]);
            let reach = apart(from, to) + world.shape(agent).effective_radius_m();
            all.push(((agent, action), ends, times, reach));
        }
    }
    let mut found = Vec::new();
    for (one, [from, to], [_, end_s], reach) in &all {
        for (two, [begin, end], [start_s, _], other) in &all {
            let far = apart([from.x, from.y], [begin.x, begin.y]) > reach + other;
            if far || one.0 == two.0 || end_s > start_s {
                continue;
            }
            let meet = (0..=6).any(|s| {
                let pose = from.toward(*to, f64::from(s) / 6.0);
                (0..=6).any(|t| {
                    let there = begin.toward(*end, f64::from(t) / 6.0);
                    world.overlap(one.0, pose, two.0, there)
                })
            });
            if meet {
                found.push((*one, *two));
            }
        }
    }
    found
}

fn execute_all<R: Routes>(world: &World<'_, R>, options: &GateOptions, rng: &mut ChaCha8Rng) {
    let graph = world.build(options).expect("a graph");
    let starved = below(rng, graph.agents());
    let late: Messages = "0s,1s,0.3".parse().expect("messages");
    let passes = passes(world, &graph);
    for adversary in [
        Adversary::Random,
        Adversary::Starve(starved),
        Adversary::Last,
        Adversary::StopWithin,
    ] {
        for messages in [Messages::default(), late] {
            let journal = execute(world, &graph, adversary, &messages, rng);
            for ((a, i), (b, j)) in &passes {
                let (ended, began) = (journal.ended[*a][*i], journal.began[*b][*j]);
                assert!(
                    ended < began,
                    "action {j} of {b} before {i} of {a} in {adversary:?}"
                );
            }
        }
    }
}

/// A meeting of two actions leaves one of them waiting for the other one, by way
/// of any others.
fn every_meeting_is_ordered<R: Routes>(world: &World<'_, R>, graph: &DependencyGraph) {
    let routes = graph.routes(world.routes);
    let mut nodes = Vec::new();
    let mut begins = vec![0];
    for agent in 0..graph.agents() {
        nodes.extend((1..=graph.actions(agent)).map(|action| (agent, action)));
        begins.push(nodes.len());
    }
    let node = |agent: usize, action: usize| begins[agent] + action - 1;
    // Everything that an action waits for, by growing sets.
    let mut before = vec![vec![false; nodes.len()]; nodes.len()];
    let mut changed = true;
    while changed {
        changed = false;
        for agent in 0..graph.agents() {
            for action in 1..=graph.actions(agent) {
                let mut direct = BTreeSet::new();
                if action > 1 {
                    direct.insert(node(agent, action - 1));
                }
                let waits = graph.waits(agent).iter();
                let here = waits.filter(|wait| wait.action as usize == action);
                direct.extend(here.map(|wait| node(wait.other as usize, wait.knot as usize)));
                let to = node(agent, action);
                for from in direct {
                    let known = before[from].clone();
                    for (at, is_before) in known.into_iter().enumerate() {
                        if (is_before || at == from) && !before[to][at] {
                            before[to][at] = true;
                            changed = true;
                        }
                    }
                }
            }
        }
    }
    for (one, (a, i)) in nodes.iter().enumerate() {
        assert!(!before[one][one], "action {i} of {a} waits for itself");
        for (two, (b, j)) in nodes.iter().enumerate().skip(one + 1) {
            if a == b || before[one][two] || before[two][one] {
                continue;
            }
            // Not ordered: no two places that they pass overlap.
            for s in 0..=6 {
                for t in 0..=6 {
                    let at = |agent: usize, action: usize, share: i32| {
                        let from = routes.pose(agent, action - 1);
                        from.toward(routes.pose(agent, action), f64::from(share) / 6.0)
                    };
                    assert!(
                        !world.overlap(*a, at(*a, *i, s), *b, at(*b, *j, t)),
                        "action {i} of {a} and action {j} of {b}"
                    );
                }
            }
        }
    }
}

fn by_cell() -> GateOptions {
    GateOptions {
        cell_size_m: Some(1.0),
        ..GateOptions::default()
    }
}

fn routes<'a>(grid: &'a Grid, plan: &'a GridPlan) -> GridRoutes<'a> {
    GridRoutes {
        grid,
        plan,
        cell_size_m: 1.0,
        step_s: 1.0,
    }
}

#[test]
fn walks_on_grids() {
    for seed in 0..60 {
        let mut rng = rng(seed);
        let (rows, cols) = (3 + below(&mut rng, 6) as u32, 3 + below(&mut rng, 6) as u32);
        let grid = random_grid(&mut rng, rows, cols, 15);
        let agents = 2 + below(&mut rng, 20);
        let plan = valid_walks(&mut rng, &grid, agents, 25);
        if plan.agents() == 0 {
            continue;
        }
        let routes = routes(&grid, &plan);
        // By cell, and by distance, with bodies as wide as cells and smaller ones.
        for radius_m in [0.5, 0.35, 0.2] {
            let footprints = [disc(radius_m)];
            let world = World::new(&routes, &footprints);
            execute_all(&world, &by_cell(), &mut rng);
            execute_all(&world, &GateOptions::default(), &mut rng);
        }
        // As wide as the margin allows.
        let footprints = [disc(0.3)];
        let world = World::new(&routes, &footprints);
        let options = GateOptions {
            margin_m: 0.4,
            ..by_cell()
        };
        execute_all(&world, &options, &mut rng);
    }
}

#[test]
fn meetings_have_an_order() {
    for seed in 0..12 {
        let mut rng = rng(1000 + seed);
        let grid = open(4, 4);
        let plan = if seed % 2 == 0 {
            valid_walks(&mut rng, &grid, 7, 8)
        } else {
            turning_blocks(&mut rng, &grid, 7, 4)
        };
        let routes = routes(&grid, &plan);
        let footprints = [disc(0.33)];
        let world = World::new(&routes, &footprints);
        for options in [by_cell(), GateOptions::default()] {
            let graph = world.build(&options).expect("a graph");
            every_meeting_is_ordered(&world, &graph);
        }
    }
}

#[test]
fn rings_turn() {
    let mut rings = 0;
    for seed in 0..6 {
        let mut rng = rng(2000 + seed);
        let grid = open(4 + seed as u32 % 3, 5);
        let agents = 17 + below(&mut rng, 4);
        let plan = turning_blocks(&mut rng, &grid, agents, 6);
        let routes = routes(&grid, &plan);
        for (radius_m, margin_m) in [(0.2, 0.05), (0.3, 0.05), (0.35, 0.0), (0.35, 0.05)] {
            let footprints = [disc(radius_m)];
            let world = World::new(&routes, &footprints);
            let options = GateOptions {
                margin_m,
                ..by_cell()
            };
            execute_all(&world, &options, &mut rng);
            // Half-way round, discs of 0.35 m are 7 mm apart.
            let graph = world.build(&options).expect("a graph");
            let has_rings = (0..agents).any(|agent| graph.actions(agent) > 6);
            let kept_m = graph.margin_m();
            let is_tight = has_rings && radius_m >= 0.35;
            let expected_m = if is_tight { 0.0 } else { margin_m };
            rings += usize::from(has_rings);
            assert!((kept_m - expected_m).abs() < 1e-12, "{kept_m}");
        }
    }
    assert!(rings >= 4 * 4, "{rings} of 6 × 4 graphs have rings");
}

#[test]
fn a_large_ring_turns_in_large_pieces() {
    // Round a square of five by five cells, every cell of it taken.
    let grid = open(5, 5);
    let mut ring = Vec::new();
    ring.extend((0..4).map(|col| (0, col)));
    ring.extend((0..4).map(|row| (row, 4)));
    ring.extend((1..5).rev().map(|col| (4, col)));
    ring.extend((1..5).rev().map(|row| (row, 0)));
    let cells: Vec<u32> = ring.iter().map(|(row, col)| row * 5 + col).collect();
    let plan = GridPlan::from_paths((0..cells.len()).map(|at| {
        let path = (0..=20).map(|step| cells[(at + step) % cells.len()]);
        path.collect::<Vec<u32>>()
    }));
    let routes = routes(&grid, &plan);
    let footprints = [disc(0.2)];
    let world = World::new(&routes, &footprints);
    let graph = world.build(&by_cell()).expect("a graph");
    assert!(graph.actions(0) > 20 && graph.actions(0) <= 20 * 8);
    let refined = graph.routes(&routes);
    let wholes = (0..=graph.actions(0)).map(|knot| refined.whole_knot(0, knot));
    let wholes: Vec<usize> = wholes.collect();
    assert!(wholes.is_sorted() && wholes.last() == Some(&20));
    let mut rng = rng(1);
    execute_all(&world, &by_cell(), &mut rng);
}

/// A footprint with everything nearer to it than a distance.
fn grown(footprint: &Footprint, by_m: f64) -> Footprint {
    match footprint {
        Footprint::Disc { radius_m } => disc(radius_m + by_m),
        Footprint::Rectangle { length_m, width_m } => Footprint::Rectangle {
            length_m: length_m + 2.0 * by_m,
            width_m: width_m + 2.0 * by_m,
        },
        Footprint::Polygon { .. } => {
            let shape = footprint.shape().expect("a footprint");
            let more = 1.0 + by_m / shape.inner_radius_m();
            let corners = shape.vertices().iter();
            let vertices_m = corners.map(|at| [at.x * more, at.y * more]).collect();
            Footprint::Polygon { vertices_m }
        }
    }
}

/// A space in which agents begin and go.
trait Ways {
    fn start(&mut self, rng: &mut ChaCha8Rng) -> Knot;
    fn next(&mut self, rng: &mut ChaCha8Rng, last: &Knot) -> Knot;
}

/// Random poses in a square, at random speeds, now and then a turn in place.
struct Square {
    side_m: f64,
}

impl Square {
    fn knot(&self, rng: &mut ChaCha8Rng, time_s: f64) -> Knot {
        Knot {
            time_s,
            x_m: unit(rng) * self.side_m,
            y_m: unit(rng) * self.side_m,
            heading_rad: Some((unit(rng) - 0.5) * 6.0),
        }
    }
}

impl Ways for Square {
    fn start(&mut self, rng: &mut ChaCha8Rng) -> Knot {
        self.knot(rng, 0.0)
    }

    fn next(&mut self, rng: &mut ChaCha8Rng, last: &Knot) -> Knot {
        let end_s = last.time_s + 1.0 + 3.0 * unit(rng);
        let mut next = self.knot(rng, end_s);
        if below(rng, 3) == 0 {
            (next.x_m, next.y_m) = (last.x_m, last.y_m);
        } else {
            // Not too far, so that some legs are possible.
            let reach = 0.2 + unit(rng);
            next.x_m = last.x_m + (next.x_m - last.x_m) * reach.min(1.0);
            next.y_m = last.y_m + (next.y_m - last.y_m) * reach.min(1.0);
        }
        next
    }
}

/// The same with less than a turn of 0.8 rad per metre where agents do not turn in place.
struct Calm(Square);

impl Ways for Calm {
    fn start(&mut self, rng: &mut ChaCha8Rng) -> Knot {
        self.0.start(rng)
    }

    fn next(&mut self, rng: &mut ChaCha8Rng, last: &Knot) -> Knot {
        let next = self.0.next(rng, last);
        let length = apart([last.x_m, last.y_m], [next.x_m, next.y_m]);
        let most = if length > 0.0 { 0.8 * length } else { 2.0 };
        let turn = next
            .heading_rad
            .zip(last.heading_rad)
            .map(|(to, from)| to - from);
        let heading_rad = last
            .heading_rad
            .zip(turn)
            .map(|(from, turn)| from + turn.clamp(-most, most));
        Knot {
            heading_rad,
            ..next
        }
    }
}

/// Edges of a roadmap at one speed, each agent with one heading for ever.
struct Roads {
    at_m: Vec<[f64; 2]>,
    reach_m: f64,
    speed_m_per_s: f64,
}

impl Roads {
    /// Random vertices of a square, each joined with all that are near.
    fn random(rng: &mut ChaCha8Rng, side_m: f64, vertices: usize, speed_m_per_s: f64) -> Self {
        let at_m = (0..vertices).map(|_| [unit(rng) * side_m, unit(rng) * side_m]);
        Self {
            at_m: at_m.collect(),
            reach_m: 2.0 * side_m / (vertices as f64).sqrt(),
            speed_m_per_s,
        }
    }
}

fn apart(a: [f64; 2], b: [f64; 2]) -> f64 {
    let (dx, dy) = (a[0] - b[0], a[1] - b[1]);
    (dx * dx + dy * dy).sqrt()
}

impl Ways for Roads {
    fn start(&mut self, rng: &mut ChaCha8Rng) -> Knot {
        let [x_m, y_m] = self.at_m[below(rng, self.at_m.len())];
        Knot {
            time_s: 0.0,
            x_m,
            y_m,
            heading_rad: Some((unit(rng) - 0.5) * 6.0),
        }
    }

    fn next(&mut self, rng: &mut ChaCha8Rng, last: &Knot) -> Knot {
        let here = [last.x_m, last.y_m];
        let joined = |to: &[f64; 2]| (1e-9..=self.reach_m).contains(&apart(here, *to));
        let ends: Vec<[f64; 2]> = self.at_m.iter().copied().filter(joined).collect();
        let [x_m, y_m] = match ends.len() {
            0 => here,
            choices => ends[below(rng, choices)],
        };
        let takes_s = apart(here, [x_m, y_m]) / self.speed_m_per_s;
        Knot {
            time_s: last.time_s + takes_s.max(0.5),
            x_m,
            y_m,
            ..*last
        }
    }
}

/// Legs each of which keeps away from everybody else's legs so far and from where everybody
/// else rests.
fn random_trajectories(
    rng: &mut ChaCha8Rng,
    footprints: &[Footprint],
    (agents, legs): (usize, usize),
    ways: &mut dyn Ways,
    clearance_m: f64,
) -> TrajectoryPlan {
    let none = TrajectoryPlan::default();
    let grown: Vec<Footprint> = footprints
        .iter()
        .map(|footprint| grown(footprint, clearance_m))
        .collect();
    let oracle = World::new(&none, &grown);
    let pose_at = |path: &[Knot], time_s: f64| {
        let next = path.partition_point(|knot| knot.time_s <= time_s);
        let pose = |knot: &Knot| Pose::new(knot.x_m, knot.y_m, knot.heading_rad.unwrap_or(0.0));
        let from = &path[next - 1];
        match path.get(next) {
            Some(to) => {
                let share = (time_s - from.time_s) / (to.time_s - from.time_s);
                pose(from).toward(pose(to), share)
            }
            None => pose(from),
        }
    };
    let mut paths: Vec<Vec<Knot>> = Vec::new();
    while paths.len() < agents {
        let path = vec![ways.start(rng)];
        let agent = paths.len();
        let is_free = |other: usize| {
            !oracle.overlap(
                agent,
                pose_at(&path, 0.0),
                other,
                pose_at(&paths[other], 0.0),
            )
        };
        if (0..agent).all(is_free) {
            paths.push(path);
        }
    }
    for _ in 0..agents * legs {
        let agent = (0..agents)
            .min_by(|a, b| {
                let end = |agent: usize| paths[agent].last().expect("a start").time_s;
                end(*a).total_cmp(&end(*b))
            })
            .expect("agents");
        let last = *paths[agent].last().expect("a start");
        let next = ways.next(rng, &last);
        let leg = [last, next];
        let end_s = paths.iter().map(|path| path[path.len() - 1].time_s);
        let end_s = end_s.fold(next.time_s, f64::max);
        let steps = ((end_s - last.time_s) * 40.0) as usize;
        let is_free = (0..=steps).all(|step| {
            let time_s = last.time_s + (end_s - last.time_s) * step as f64 / steps as f64;
            let pose = pose_at(&leg, time_s);
            (0..agents).all(|other| {
                other == agent
                    || !oracle.overlap(agent, pose, other, pose_at(&paths[other], time_s))
            })
        });
        let knot = if is_free {
            next
        } else {
            Knot {
                time_s: last.time_s + 0.5,
                ..last
            }
        };
        paths[agent].push(knot);
    }
    let mut plan = TrajectoryPlan::default();
    for path in paths {
        plan.push_path(path).expect("a trajectory");
    }
    plan
}

#[test]
fn trajectories_of_discs() {
    let footprints = [disc(0.3), disc(0.2)];
    for seed in 0..25 {
        let mut rng = rng(3000 + seed);
        let plan = random_trajectories(
            &mut rng,
            &footprints,
            (9, 25),
            &mut Square { side_m: 4.0 },
            0.05,
        );
        let world = World::new(&plan, &footprints);
        for margin_m in [0.0, 0.04, 0.2] {
            let options = GateOptions {
                margin_m,
                ..GateOptions::default()
            };
            execute_all(&world, &options, &mut rng);
        }
    }
}

#[test]
fn trajectories_of_rectangles_and_polygons() {
    let rectangle = |length_m, width_m| Footprint::Rectangle { length_m, width_m };
    let hexagon = Footprint::Polygon {
        vertices_m: vec![
            [0.4, 0.0],
            [0.2, 0.25],
            [-0.2, 0.25],
            [-0.3, 0.0],
            [-0.2, -0.2],
            [0.2, -0.2],
        ],
    };
    let footprints = [
        rectangle(0.7, 0.31),
        disc(0.2),
        rectangle(0.9, 0.5),
        hexagon,
    ];
    for seed in 0..12 {
        let mut rng = rng(4000 + seed);
        let plan = random_trajectories(
            &mut rng,
            &footprints,
            (8, 20),
            &mut Square { side_m: 5.0 },
            0.1,
        );
        let world = World::new(&plan, &footprints);
        execute_all(&world, &GateOptions::default(), &mut rng);
        let graph = world.build(&GateOptions::default()).expect("a graph");
        if seed < 3 {
            every_meeting_is_ordered(&world, &graph);
        }
    }
}

/// A quadruped, a disc and a wedge.
fn mixed() -> [Footprint; 3] {
    [
        Footprint::Rectangle {
            length_m: 0.7,
            width_m: 0.31,
        },
        disc(0.2),
        Footprint::Polygon {
            vertices_m: vec![[0.4, 0.0], [-0.25, 0.2], [-0.25, -0.2]],
        },
    ]
}

#[test]
fn trajectories_on_roadmaps() {
    let footprints = mixed();
    let mut waits = 0;
    for seed in 0..12 {
        let mut rng = rng(4500 + seed);
        let mut roads = Roads::random(&mut rng, 6.0, 40, 1.0);
        let plan = random_trajectories(&mut rng, &footprints, (8, 20), &mut roads, 0.05);
        let world = World::new(&plan, &footprints);
        execute_all(&world, &GateOptions::default(), &mut rng);
        let options = GateOptions {
            margin_m: 0.04,
            least_margin_m: 0.04,
            ..GateOptions::default()
        };
        execute_all(&world, &options, &mut rng);
        waits += world.build(&options).expect("a graph").edges();
    }
    assert!(waits > 12 * 8, "{waits} dependencies");
}

/// A plan without its headings, and those of the starts.
fn without_headings(plan: &TrajectoryPlan) -> (TrajectoryPlan, Vec<Option<f64>>) {
    let mut bare = TrajectoryPlan::default();
    for knots in plan.paths() {
        let places = knots.iter().map(|knot| Knot {
            heading_rad: None,
            ..knot
        });
        bare.push_path(places).expect("a trajectory");
    }
    let starts = plan.paths().map(|knots| knots.get(0).heading_rad);
    (bare, starts.collect())
}

/// By order: on roadmaps, where robots keep the headings of their starts, and in the plane,
/// where plans say them.
#[test]
fn robots_of_any_shape_keep_the_order() {
    let footprints = mixed();
    let models = [
        "single-integrator",
        "double-integrator",
        "holonomic",
        "pebble",
    ];
    for seed in 0..6 {
        let mut rng = rng(4700 + seed);
        let mut roads = Roads::random(&mut rng, 8.0, 60, 0.5);
        let on_roads = random_trajectories(&mut rng, &footprints, (9, 12), &mut roads, 0.06);
        let (bare, headings) = without_headings(&on_roads);
        let mut square = Square { side_m: 6.0 };
        let in_plane = random_trajectories(&mut rng, &footprints, (9, 12), &mut square, 0.06);
        for (plan, headings) in [(&bare, &headings[..]), (&in_plane, &[])] {
            for (number, model) in models.into_iter().enumerate() {
                let profiles = footprints.iter().map(|footprint| Profile {
                    footprint: footprint.clone(),
                    model: model.parse().expect("a model"),
                });
                let of_agent = (0..9).map(|agent| agent % 3).collect();
                let fleet = Fleet::new(profiles.collect(), of_agent).expect("a fleet");
                let mut config = SimConfig {
                    policy: Policy::Adg,
                    ..SimConfig::default()
                };
                let run = |config: &SimConfig| {
                    Simulator::new(config)
                        .with_fleet(&fleet)
                        .facing(headings)
                        .run(plan, &mut NoTrace)
                        .unwrap_or_else(|error| panic!("{model}, seed {seed}: {error}"))
                };
                let prompt = run(&config);
                config.tier = [Tier::Kinematic, Tier::Contact][(seed as usize + number) % 2];
                config.disturbance.seed = seed;
                config.disturbance.delay = "bernoulli:0.3,3s".parse().expect("a delay");
                config.disturbance.velocity = "0.3,0.1".parse().expect("a noise");
                config.disturbance.messages = "0s,0.5s,0.2".parse().expect("messages");
                let late = run(&config);
                for outcome in [&prompt, &late] {
                    let contact = outcome.contacts.first.first();
                    assert_eq!(contact, None, "{model}, seed {seed}");
                    assert_eq!(outcome.arrived, 9, "{model}, seed {seed}");
                }
                assert!(prompt.makespan_s < late.makespan_s, "{model}, seed {seed}");
                config.threads = 3;
                assert_eq!(run(&config), late, "{model}, seed {seed}");
            }
        }
    }
}

/// Quadrupeds on smoothed plans, whose velocities have errors, with as much room as both take: nobody
/// touches anybody by order, whatever is late. By time of the plan they would.
#[test]
fn quadrupeds_that_slip_keep_the_order_of_smooth_plans() {
    // What rectangles are wider by in the plan is for curves, tolerances and errors of both robots.
    let (smooth_m, off_m) = (0.04, 0.12);
    let presets = ["go2", "spot", "anymal-c"];
    let profiles = presets.map(|name| Profile::preset(name).expect("a preset with a body"));
    let footprints = profiles.clone().map(|profile| profile.footprint);
    let mut by_time = 0;
    for seed in 0..6 {
        let mut rng = rng(5100 + seed);
        let mut ways = Calm(Square { side_m: 8.0 });
        let clearance_m = smooth_m + off_m;
        let plan = random_trajectories(&mut rng, &footprints, (7, 10), &mut ways, clearance_m);
        let of_agent = (0..7).map(|agent| agent % 3).collect();
        let fleet = Fleet::new(profiles.to_vec(), of_agent).expect("a fleet");
        let run = |config: &SimConfig| {
            Simulator::new(config)
                .with_fleet(&fleet)
                .run(&plan, &mut NoTrace)
                .unwrap_or_else(|error| panic!("seed {seed}: {error}"))
        };
        let mut config = SimConfig {
            policy: Policy::Adg,
            ..SimConfig::default()
        };
        for deviation_m in [0.0, smooth_m] {
            config.smooth_m = deviation_m;
            for tier in [Tier::Kinematic, Tier::Contact] {
                config.tier = tier;
                let outcome = run(&config);
                assert_eq!(outcome.contacts.total(), 0, "seed {seed}, {tier}");
                // Neither off its way nor farther on it than it is released.
                let off = outcome.tracking_error_max_m;
                assert!(off < 0.03, "seed {seed}, {tier}: {off}");
            }
        }
        // Beyond the models' own tolerances.
        config.margin_m = 0.1;
        config.disturbance.seed = seed;
        config.disturbance.twist = "0.05,0.02".parse().expect("errors");
        config.disturbance.delay = "bernoulli:0.2,2s".parse().expect("a delay");
        config.disturbance.messages = "0s,0.5s,0.2".parse().expect("messages");
        for tier in [Tier::Kinematic, Tier::Contact] {
            config.tier = tier;
            let outcome = run(&config);
            let contact = outcome.contacts.first.first();
            assert_eq!(contact, None, "seed {seed}, {tier}");
            assert_eq!(outcome.arrived, 7, "seed {seed}, {tier}");
            let off = outcome.tracking_error_max_m;
            assert!((0.01..off_m).contains(&off), "seed {seed}, {tier}: {off}");
            let turned = outcome
                .tracking_error_max_rad
                .expect("the plan has headings");
            assert!(turned < 0.15, "seed {seed}, {tier}: {turned}");
            assert_eq!(run(&config).trace_digest, outcome.trace_digest);
        }
        let late = SimConfig {
            policy: Policy::Time,
            tier: Tier::Kinematic,
            until_done: true,
            ..config
        };
        let outcome = Simulator::new(&late)
            .with_fleet(&fleet)
            .run(&plan, &mut NoTrace);
        by_time += outcome.map_or(1, |outcome| outcome.contacts.agent_agent);
    }
    assert!(by_time > 0);
}

/// A plan that enters only cells that were free in the step before.
fn loose_walks(rng: &mut ChaCha8Rng, grid: &Grid, agents: usize, steps: usize) -> GridPlan {
    let mut now = starts(rng, grid, agents);
    let mut paths: Vec<Vec<u32>> = now.iter().map(|cell| vec![*cell]).collect();
    for _ in 0..steps {
        let mut taken: BTreeSet<u32> = now.iter().copied().collect();
        for (cell, path) in now.iter_mut().zip(&mut paths) {
            let options: Vec<u32> = grid.neighbors(*cell, Connectivity::Four).collect();
            let wish = options[below(rng, options.len())];
            if taken.insert(wish) {
                *cell = wish;
            }
            path.push(*cell);
        }
    }
    GridPlan::from_paths(paths)
}

#[test]
fn without_delays_a_plan_takes_as_long_as_planned() {
    for seed in 0..10 {
        let mut rng = rng(5000 + seed);
        let grid = open(8, 8);
        let plan = loose_walks(&mut rng, &grid, 20, 40);
        let routes = routes(&grid, &plan);
        let footprints = [disc(0.35)];
        let world = World::new(&routes, &footprints);
        let by_distance = GateOptions {
            longest_action_m: Some(1.0),
            ..GateOptions::default()
        };
        for options in [by_cell(), by_distance] {
            let mut gates = Gates::new(world.build(&options).expect("a graph"));
            let mut steps = 0;
            while !gates.is_finished() {
                gates.exchange(steps);
                for agent in 0..20 {
                    let reached = gates.reached()[agent];
                    if reached < gates.released()[agent] {
                        gates.done(agent, reached as usize + 1);
                    }
                }
                steps += 1;
            }
            assert_eq!(steps, 40);
        }
    }
}

#[test]
fn messages_late_and_lost_only_delay() {
    let grid = open(6, 6);
    let mut rng = rng(6);
    let plan = valid_walks(&mut rng, &grid, 14, 30);
    let routes = routes(&grid, &plan);
    let footprints = [disc(0.35)];
    let world = World::new(&routes, &footprints);
    let graph = world.build(&by_cell()).expect("a graph");
    let blocks = |messages: &str, seed: u64, reversed: bool| {
        let messages: Messages = messages.parse().expect("messages");
        let mut gates = Gates::with_messages(graph.clone(), &messages, seed, 0.1);
        let mut prompt = Gates::new(graph.clone());
        let mut block = 0;
        let mut history = Vec::new();
        while !gates.is_finished() {
            let before = gates.released().to_vec();
            gates.exchange(block);
            prompt.exchange(block);
            let released = gates.released();
            let both = before.iter().zip(released);
            assert!(
                both.clone().all(|(old, new)| old <= new),
                "releases only grow"
            );
            let both = released.iter().zip(prompt.released());
            assert!(
                both.clone().all(|(late, prompt)| late <= prompt),
                "none too early"
            );
            let order: Vec<usize> = if reversed {
                (0..14).rev().collect()
            } else {
                (0..14).collect()
            };
            for agent in order {
                let reached = gates.reached()[agent];
                if reached < gates.released()[agent] {
                    gates.done(agent, reached as usize + 1);
                    prompt.done(agent, reached as usize + 1);
                }
            }
            history.push(gates.released().to_vec());
            block += 1;
            assert!(block < 100_000, "everybody arrives");
        }
        (block, history)
    };
    let prompt = blocks("0,0,0", 1, false).0;
    let late = blocks("0.05s,0.35s,0", 1, false);
    let lossy = blocks("50ms,350ms,0.5", 1, false);
    assert!(prompt < late.0 && late.0 < lossy.0);
    assert_eq!(lossy, blocks("50ms,350ms,0.5", 1, true), "order of reports");
    assert_ne!(lossy, blocks("50ms,350ms,0.5", 2, false), "another seed");
}

/// Paths on a grid say nothing about headings. A robot that turns into its
/// direction sweeps more than its footprint as it lies in the plan.
#[test]
fn long_robots_that_turn_do_not_touch() {
    let profile = Profile {
        footprint: Footprint::Rectangle {
            length_m: 0.85,
            width_m: 0.2,
        },
        model: "agv".parse().expect("a model"),
    };
    for seed in 0..4 {
        let mut rng = rng(9000 + seed);
        let grid = random_grid(&mut rng, 8, 8, 10);
        let plan = valid_drives(&mut rng, &grid, 20, 25);
        let fleet = Fleet::uniform(profile.clone(), plan.agents()).expect("a fleet");
        let config = SimConfig {
            policy: Policy::Adg,
            start_heading_rad: 1.5,
            ..SimConfig::default()
        };
        let simulator = Simulator::new(&config).on_grid(&grid).with_fleet(&fleet);
        let outcome = simulator.run(&plan, &mut NoTrace).expect("an execution");
        assert_eq!(outcome.contacts.agent_agent, 0, "seed {seed}");
        assert_eq!(outcome.arrived as usize, plan.agents(), "seed {seed}");
    }
}

/// Rings of robots with controllers turn if there is room for what those are off
/// their ways; half-way round, discs of 0.35 m have 7 mm.
#[test]
fn robots_turn_in_rings_with_room() {
    for radius_m in [0.25, 0.3, 0.33, 0.35] {
        let profile = Profile {
            footprint: disc(radius_m),
            model: "agv".parse().expect("a model"),
        };
        let grid = open(5, 5);
        let plan = turning_blocks(&mut rng(10), &grid, 22, 6);
        let fleet = Fleet::uniform(profile, plan.agents()).expect("a fleet");
        let config = SimConfig {
            policy: Policy::Adg,
            ..SimConfig::default()
        };
        let simulator = Simulator::new(&config).on_grid(&grid).with_fleet(&fleet);
        let outcome = simulator.run(&plan, &mut NoTrace);
        if radius_m >= 0.35 {
            let error = outcome.expect_err("too little room").to_string();
            assert!(error.contains("too little room"), "{error}");
            continue;
        }
        let outcome = outcome.expect("an execution");
        assert_eq!(outcome.contacts.agent_agent, 0, "{radius_m} m");
        assert_eq!(outcome.arrived, 22, "{radius_m} m");
    }
}

#[test]
fn threads_make_no_difference() {
    let grid = open(8, 8);
    let mut rng = rng(8);
    let plan = turning_blocks(&mut rng, &grid, 50, 8);
    let routes = routes(&grid, &plan);
    let footprints = [disc(0.3)];
    let world = World::new(&routes, &footprints);
    for options in [by_cell(), GateOptions::default()] {
        let graphs = [1, 2, 5].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            let pool = pool.expect("threads");
            pool.install(|| world.build(&options)).expect("a graph")
        });
        assert_eq!(graphs[0], graphs[1]);
        assert_eq!(graphs[0], graphs[2]);
        assert!(graphs[0].memory_bytes() > 0 && graphs[0].edges() > 0);
    }
}

fn error(grid: &Grid, paths: &[&[u32]], radius_m: f64) -> GateError {
    let plan = GridPlan::from_paths(paths);
    let routes = routes(grid, &plan);
    let footprints = [disc(radius_m)];
    let world = World::new(&routes, &footprints);
    let by_distance = world.build(&GateOptions::default());
    let error = world.build(&by_cell()).expect_err("a plan that collides");
    // They look for the time in different parts of the way.
    let subject = |error: &GateError| match error {
        GateError::Collision { agents, .. } => agents.to_vec(),
        GateError::NoOrder { agents, .. } => agents.clone(),
        other => panic!("{other}"),
    };
    let same = subject(&by_distance.expect_err("a plan that collides"));
    assert_eq!(same, subject(&error));
    assert!(error.hint().is_some());
    error
}

#[test]
fn plans_that_collide_are_refused() {
    let grid = open(3, 3);
    let text = |paths: &[&[u32]], radius_m| error(&grid, paths, radius_m).to_string();
    let swap = text(&[&[0, 1], &[1, 0]], 0.3);
    assert!(swap.contains("agents 0 and 1 collide at 0."), "{swap}");
    let meet = text(&[&[0, 1, 1, 2], &[4, 4, 1]], 0.3);
    assert!(!meet.contains("collide at 0"), "{meet}");
    let parked = text(&[&[0, 1, 2], &[4, 1]], 0.3);
    assert!(parked.contains("collide"), "{parked}");
    let asleep = text(&[&[0, 1, 2], &[1]], 0.3);
    assert!(asleep.contains("agents 0 and 1 collide at 0."), "{asleep}");
    let together = text(&[&[0, 1], &[0, 3]], 0.3);
    assert!(together.contains("collide at 0 s"), "{together}");
    // A plan that goes well for a while collides when it does: discs are 0.6 m apart a fifth of a
    // second after they begin to exchange cells.
    let late = text(&[&[0, 3, 0, 1], &[1, 2, 1, 0]], 0.3);
    assert!(late.contains("agents 0 and 1 collide at 2.2"), "{late}");
    // Discs of this size touch half-way round a corner.
    let ring: [&[u32]; 4] = [&[0, 1], &[1, 4], &[4, 3], &[3, 0]];
    let tight = text(&ring, 0.36);
    assert!(tight.contains("collide at 0."), "{tight}");
    let barely = text(&ring, 0.3535);
    assert!(
        barely.contains("agents 0, 1, 3, 4") || barely.contains("0, 1, 2, 3"),
        "{barely}"
    );
}

/// Wherever the small one is on the way of the large one, it was not seen where all of its own way is
/// inside of what the large one sweeps.
#[test]
fn a_small_robot_inside_what_a_large_one_sweeps_goes_first() {
    let knot = |time_s: f64, x_m: f64, y_m: f64| Knot {
        time_s,
        x_m,
        y_m,
        heading_rad: Some(0.0),
    };
    let mut plan = TrajectoryPlan::default();
    // A beam of ten metres across its way; a small one leaves what it sweeps in time.
    plan.push_path([
        knot(0.0, 0.0, 0.0),
        knot(20.0, 0.0, 0.0),
        knot(30.0, 0.0, 20.0),
    ])
    .unwrap();
    plan.push_path([
        knot(0.0, 4.0, 10.0),
        knot(1.0, 4.2, 10.0),
        knot(9.0, 9.0, 10.0),
    ])
    .unwrap();
    let beam = Footprint::Rectangle {
        length_m: 10.0,
        width_m: 1.0,
    };
    let footprints = [beam, disc(0.1)];
    let world = World::new(&plan, &footprints);
    let graph = world.build(&GateOptions::default()).expect("an order");
    every_meeting_is_ordered(&world, &graph);
    execute_all(&world, &GateOptions::default(), &mut rng(1));
    // Who stays there is driven over.
    let mut stays = TrajectoryPlan::default();
    for agent in 0..2 {
        let knots = plan.knots(agent).iter().take(3 - agent);
        stays.push_path(knots).unwrap();
    }
    let refused = World::new(&stays, &footprints).build(&GateOptions::default());
    let text = refused.expect_err("a collision").to_string();
    assert!(text.contains("agents 0 and 1"), "{text}");
}

#[test]
fn options_out_of_range_are_refused() {
    let grid = open(2, 2);
    let plan = GridPlan::from_paths([[0, 1]]);
    let routes = routes(&grid, &plan);
    let footprints = [disc(0.3)];
    let world = World::new(&routes, &footprints);
    for bad in [f64::NAN, -1.0, f64::INFINITY] {
        let options = [
            GateOptions {
                margin_m: bad,
                ..by_cell()
            },
            GateOptions {
                longest_action_m: Some(bad),
                ..by_cell()
            },
            GateOptions {
                cell_size_m: Some(bad),
                ..by_cell()
            },
        ];
        for options in options {
            let error = world.build(&options).expect_err("out of range");
            assert!(matches!(error, GateError::Option { .. }), "{error}");
            assert!(error.hint().is_some());
        }
    }
}
