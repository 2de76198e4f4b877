//! Dependencies between any routes: whatever is swept near each other is found by
//! a hash of the plane and judged by its geometry.

use rayon::prelude::*;

use super::GateError;
use super::graph::{Edge, GateOptions, Wait};
use super::meet::{Bodies, Bounds, Order, Sweep, Timed, order, overlap, pair};
use super::routes::{Cuts, Routes, Split};

/// The most actions and rests of all agents together.
const MOST_MOTIONS: usize = 1 << 27;

/// An action that moves, or a rest between two of them.
#[derive(Debug, Clone, Copy)]
struct Motion {
    timed: Timed,
    /// The action; of a rest, the one after which it begins, 0 at the start.
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
                splits.push(Split {
                    agent: agent as u32,
                    action: action as u32,
                    pieces: pieces as u32,
                });
            }
            from = to;
        }
    }
    if splits.is_empty() {
        return Ok(Cuts::default());
    }
    Ok(Cuts::default().refine(agents, &splits))
}

/// The dependencies: for every action, the last action of every other agent that
/// meets it and goes first, unless an earlier action waits for it or a later one.
/// With them, the distance that agents keep from those who rest, at most the margin.
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
    // Threads make no difference: every agent's edges depend on the routes alone.
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

/// Actions that move and rests of all agents, one after the other.
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
        // Since when the agent rests here, and after which action.
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

/// Which motions come near which squares of the plane.
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
        // As large as the largest box, so that none covers more than four.
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

    /// Motions near another one, later ones of an agent before earlier ones; those
    /// in several squares several times.
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

/// The squares that a box covers. Far from the origin squares become one, which
/// costs time alone.
fn squares(bounds: Bounds, side_m: f64) -> impl Iterator<Item = (i32, i32)> {
    let [left, bottom, right, top] = bounds.map(|metres| (metres / side_m).floor() as i32);
    (left..=right).flat_map(move |x| (bottom..=top).map(move |y| (x, y)))
}

/// What one agent's search remembers.
struct Scratch {
    /// Counts agents and motions, to tell old entries from new ones.
    agent: u32,
    motion: u32,
    /// Per motion, for which one it was looked at last.
    seen: Vec<u32>,
    /// Per agent, up to which of its actions this agent waits already, and for
    /// which agent that was found.
    waited: Vec<(u32, u32)>,
    /// Per agent, the last of its actions that goes before this motion, and for
    /// which motion that was found.
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

/// What one motion waits for. Returns the distance that is kept from rests.
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
            // Both rest at the start, one of them for no time at all.
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
        // Where neither may go first, both edges are there, for the search for
        // rings to find.
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

/// A plan that has an agent in another one's way while it rests collides. Passing
/// nearer than the margin is the plan's own affair, since no order would change it.
/// Returns the distance that is kept: the margin, or the least one.
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
    // Of a motion, only the part that falls into the rest counts; since one of the
    // two stands still, sweeping the same place is being there at the same time.
    let (one, two) = (a.part(begin_s, end_s), b.part(begin_s, end_s));
    if bodies.meet(one, two, 0.0) {
        return Err(GateError::Collision {
            agents: pair(a, b),
            time_s: a.collides(b, bodies, 0.0).unwrap_or(begin_s),
        });
    }
    if least_m > 0.0 && bodies.meet(one, two, least_m) {
        return Err(GateError::NoOrder {
            agents: pair(a, b).to_vec(),
            time_s: a.collides(b, bodies, least_m).unwrap_or(begin_s),
        });
    }
    let is_tight = margin_m > least_m && bodies.meet(one, two, margin_m);
    Ok(if is_tight { least_m } else { margin_m })
}
