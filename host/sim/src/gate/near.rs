//! Dependencies between arbitrary routes: a spatial hash finds the candidates, and their
//! geometry decides.

use rayon::prelude::*;

use super::GateError;
use super::graph::{Edge, GateOptions, Wait};
use super::meet::{Bodies, Bounds, Order, Sweep, Timed, middle, order, overlap, pair};
use super::routes::{Cuts, Routes, Split};

/// Largest total number of actions and rests of all agents.
const MOST_MOTIONS: usize = 1 << 27;

/// A moving action, or a rest between two of them.
#[derive(Debug, Clone, Copy)]
struct Motion {
    timed: Timed,
    /// The action; for a rest, the action before it, 0 at the start.
    action: u32,
    rests: bool,
}

/// Cuts that leave no action longer than `longest_m`.
pub(super) fn cut_long<R: Routes + ?Sized>(
    routes: &R,
    bodies: &Bodies<'_>,
    longest_m: Option<f64>,
) -> Result<Cuts, GateError> {
    let agents = routes.agents();
    let widest = (0..agents as u32).map(|agent| 2.0 * bodies.radius_m(agent));
    let longest_m = longest_m.unwrap_or_else(|| widest.fold(0.0, f64::max));
    let mut splits = Vec::new();
    let mut total = 0.0;
    for agent in 0..agents {
        let radius_m = bodies.radius_m(agent as u32);
        let mut from = routes.pose(agent, 0);
        for action in 1..=routes.actions(agent) {
            let to = routes.pose(agent, action);
            let (dx, dy) = (to.x - from.x, to.y - from.y);
            let length = (dx * dx + dy * dy).sqrt() + radius_m * (to.heading - from.heading).abs();
            // Rounding is no reason for another piece.
            let pieces = (length / longest_m * (1.0 - 1e-9)).ceil().max(1.0);
            total += pieces;
            if total > MOST_MOTIONS as f64 {
                return Err(GateError::TooManyActions { most: MOST_MOTIONS });
            }
            if pieces > 1.0 {
                splits.push(Split::whole(agent as u32, action as u32, pieces as u32));
            }
            from = to;
        }
    }
    if splits.is_empty() {
        return Ok(Cuts::default());
    }
    Ok(Cuts::default().refine(agents, &splits))
}

/// The dependencies: for every action, the last conflicting action of every other agent
/// that goes first, unless an earlier action already waits for it or a later one. Returns
/// with them the distance kept from resting agents, at most the margin.
pub(super) fn edges<R: Routes + ?Sized>(
    routes: &R,
    bodies: &Bodies<'_>,
    options: &GateOptions,
) -> Result<(Vec<Edge>, f64), GateError> {
    let margin_m = options.margin_m;
    let motions = motions(routes)?;
    let plane = Plane::new(&motions, bodies, margin_m);
    let agents = routes.agents();
    let mut begins = vec![0; agents + 1];
    for (at, motion) in motions.iter().enumerate() {
        begins[motion.timed.sweep.agent as usize + 1] = at + 1;
    }
    // Deterministic under threads: every agent's edges depend on the routes alone.
    let found: Vec<Result<(Vec<Edge>, f64), GateError>> = (0..agents)
        .into_par_iter()
        .with_min_len(8)
        .map_init(
            || Scratch::new(agents, motions.len()),
            |scratch, agent| {
                let range = begins[agent]..begins[agent + 1];
                let (mut edges, mut kept_m) = (Vec::new(), margin_m);
                scratch.agent += 1;
                for at in range {
                    let kept = waits(at, &motions, &plane, bodies, options, scratch, &mut edges)?;
                    kept_m = kept_m.min(kept);
                }
                Ok((edges, kept_m))
            },
        )
        .collect();
    let (mut edges, mut kept_m) = (Vec::new(), margin_m);
    for part in found {
        let (mut part, part_m) = part?;
        edges.append(&mut part);
        kept_m = kept_m.min(part_m);
    }
    Ok((edges, kept_m))
}

/// Moving actions and rests of all agents, agent by agent.
fn motions<R: Routes + ?Sized>(routes: &R) -> Result<Vec<Motion>, GateError> {
    let mut motions = Vec::new();
    for agent in 0..routes.agents() {
        let motion = |sweep: Sweep, start_s: f64, end_s: f64, action: usize| Motion {
            rests: sweep.is_rest(),
            action: action as u32,
            timed: Timed {
                sweep,
                start_s,
                end_s,
            },
        };
        let id = agent as u32;
        let mut here = routes.pose(agent, 0);
        // Start of the agent's current rest, and the action before it.
        let (mut since_s, mut arrived) = (0.0, 0);
        for action in 1..=routes.actions(agent) {
            let there = routes.pose(agent, action);
            if there == here {
                continue;
            }
            let start_s = routes.time_s(agent, action - 1);
            if arrived == 0 || since_s < start_s {
                motions.push(motion(Sweep::rest(id, here), since_s, start_s, arrived));
            }
            since_s = routes.time_s(agent, action);
            let sweep = Sweep {
                agent: id,
                from: here,
                to: there,
            };
            motions.push(motion(sweep, start_s, since_s, action));
            (here, arrived) = (there, action);
        }
        let rest = Sweep::rest(id, here);
        motions.push(motion(rest, since_s, f64::INFINITY, arrived));
        if motions.len() > MOST_MOTIONS {
            return Err(GateError::TooManyActions { most: MOST_MOTIONS });
        }
    }
    Ok(motions)
}

/// Index of motions by the squares of the plane that they come near.
struct Plane {
    bounds: Vec<Bounds>,
    side_m: f64,
    /// Squares in order, and the motions of square i, in order, in
    /// `near[offsets[i]..offsets[i + 1]]`.
    squares: Vec<(i32, i32)>,
    offsets: Vec<u32>,
    near: Vec<u32>,
}

impl Plane {
    fn new(motions: &[Motion], bodies: &Bodies<'_>, margin_m: f64) -> Self {
        let bounds: Vec<Bounds> = motions
            .iter()
            .map(|motion| bodies.bounds(motion.timed.sweep, margin_m))
            .collect();
        // As large as the largest box, so that no box covers more than four.
        let side_m = bounds
            .iter()
            .map(|b| (b[2] - b[0]).max(b[3] - b[1]))
            .fold(f64::MIN_POSITIVE, f64::max);
        let mut entries: Vec<((i32, i32), u32)> = Vec::with_capacity(2 * motions.len());
        for (at, bounds) in bounds.iter().enumerate() {
            entries.extend(squares(*bounds, side_m).map(|square| (square, at as u32)));
        }
        entries.sort_unstable();
        let (mut squares, mut offsets) = (Vec::new(), Vec::new());
        for (at, (square, _)) in entries.iter().enumerate() {
            if squares.last() != Some(square) {
                squares.push(*square);
                offsets.push(at as u32);
            }
        }
        offsets.push(entries.len() as u32);
        let near = entries.into_iter().map(|(_, motion)| motion).collect();
        Self {
            bounds,
            side_m,
            squares,
            offsets,
            near,
        }
    }

    /// Motions near another one, later ones of an agent before earlier ones; motions in
    /// several squares occur several times.
    fn near(&self, motion: usize) -> impl Iterator<Item = usize> {
        squares(self.bounds[motion], self.side_m).flat_map(|square| {
            let range = match self.squares.binary_search(&square) {
                Ok(at) => self.offsets[at] as usize..self.offsets[at + 1] as usize,
                Err(_) => 0..0,
            };
            self.near[range].iter().rev().map(|motion| *motion as usize)
        })
    }
}

/// The squares that a box covers. Far from the origin squares merge, which only costs
/// time.
fn squares(bounds: Bounds, side_m: f64) -> impl Iterator<Item = (i32, i32)> {
    let [left, bottom, right, top] = bounds.map(|metres| (metres / side_m).floor() as i32);
    (left..=right).flat_map(move |x| (bottom..=top).map(move |y| (x, y)))
}

/// Working memory of one agent's search.
struct Scratch {
    /// Counters of agents and motions, to tell old entries from new ones.
    agent: u32,
    motion: u32,
    /// Per motion, the motion for which it was last examined.
    seen: Vec<u32>,
    /// Per agent, its last action that this agent already waits for, and the agent of
    /// that entry.
    waited: Vec<(u32, u32)>,
    /// Per agent, its last action that goes before this motion, and the motion of that
    /// entry.
    last: Vec<(u32, u32)>,
    /// Agents with an action that goes before this motion.
    others: Vec<u32>,
}

impl Scratch {
    fn new(agents: usize, motions: usize) -> Self {
        Self {
            agent: 0,
            motion: 0,
            seen: vec![0; motions],
            waited: vec![(0, 0); agents],
            last: vec![(0, 0); agents],
            others: Vec::new(),
        }
    }
}

/// Dependencies of one motion. Returns the distance kept from rests.
fn waits(
    at: usize,
    motions: &[Motion],
    plane: &Plane,
    bodies: &Bodies<'_>,
    options: &GateOptions,
    scratch: &mut Scratch,
    edges: &mut Vec<Edge>,
) -> Result<f64, GateError> {
    let margin_m = options.margin_m;
    let mut kept_m = margin_m;
    let motion = motions[at];
    let (timed, bounds) = (motion.timed, plane.bounds[at]);
    scratch.motion += 1;
    scratch.others.clear();
    for near in plane.near(at) {
        let other = motions[near];
        let agent = other.timed.sweep.agent;
        if agent == timed.sweep.agent || other.timed.start_s >= timed.end_s {
            // Both agents rest at the start, one of them with zero duration.
            let both_start = motion.rests && other.rests && motion.action + other.action == 0;
            if agent == timed.sweep.agent || !both_start {
                continue;
            }
        }
        if std::mem::replace(&mut scratch.seen[near], scratch.motion) == scratch.motion
            || !overlap(bounds, plane.bounds[near])
        {
            continue;
        }
        if motion.rests || other.rests {
            kept_m = kept_m.min(check_rest(&motion, &other, bodies, options)?);
            continue;
        }
        let known = |(when, action): (u32, u32), now: u32| when == now && action >= other.action;
        if known(scratch.waited[agent as usize], scratch.agent)
            || known(scratch.last[agent as usize], scratch.motion)
            || !bodies.meet(timed.sweep, other.timed.sweep, margin_m)
        {
            continue;
        }
        // Where neither may go first, both edges exist, and the search for rings finds
        // them.
        if order(&other.timed, &timed, bodies, margin_m) == Order::Second {
            continue;
        }
        let last = &mut scratch.last[agent as usize];
        if last.0 != scratch.motion {
            scratch.others.push(agent);
        }
        *last = (scratch.motion, other.action);
    }
    scratch.others.sort_unstable();
    for other in &scratch.others {
        let knot = scratch.last[*other as usize].1;
        scratch.waited[*other as usize] = (scratch.agent, knot);
        edges.push(Edge {
            agent: timed.sweep.agent,
            wait: Wait {
                action: motion.action,
                other: *other,
                knot,
            },
        });
    }
    Ok(kept_m)
}

/// Refuses a plan in which an agent runs into a resting one. A pass nearer than the
/// margin is accepted, since no order would change it. Returns the distance kept: the
/// margin, or the least one.
fn check_rest(
    motion: &Motion,
    other: &Motion,
    bodies: &Bodies<'_>,
    options: &GateOptions,
) -> Result<f64, GateError> {
    let (margin_m, least_m) = (options.margin_m, options.least_margin_m);
    let both_start = motion.rests && other.rests && motion.action + other.action == 0;
    let (a, b) = (&motion.timed, &other.timed);
    let begin_s = a.start_s.max(b.start_s);
    let end_s = a.end_s.min(b.end_s);
    if !both_start && begin_s >= end_s {
        return Ok(margin_m);
    }
    // Only the part of a motion during the rest counts; since one of the two stands
    // still, sweeping the same place is a collision.
    let (one, two) = (a.part(begin_s, end_s), b.part(begin_s, end_s));
    if bodies.meet(one, two, 0.0) {
        let time_s = a.collides(b, bodies, 0.0).unwrap_or(begin_s);
        return Err(GateError::Collision {
            agents: pair(a, b),
            time_s,
            at_m: middle(a, b, time_s),
        });
    }
    if least_m > 0.0 && bodies.meet(one, two, least_m) {
        let time_s = a.collides(b, bodies, least_m).unwrap_or(begin_s);
        return Err(GateError::NoOrder {
            agents: pair(a, b).to_vec(),
            time_s,
            at_m: middle(a, b, time_s),
            room_m: least_m,
        });
    }
    let is_tight = margin_m > least_m && bodies.meet(one, two, margin_m);
    Ok(if is_tight { least_m } else { margin_m })
}
