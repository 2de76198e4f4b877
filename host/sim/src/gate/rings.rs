//! Rings: cycles of agents that each wait for the end of the next agent's action before
//! their own begins, all at the same time.
//!
//! Four agents that rotate in a square form a ring, and planners such as PIBT and LaCAM
//! permit that. Whole actions have no order then; parts of them have one, as long as the
//! plan keeps the bodies apart: the agents advance a little in turn. So the actions of a
//! ring are cut into the fewest pieces that have an order. All are cut at the same moments:
//! of two pieces one ends before the other begins, or both take the same time, and an agent
//! that follows another one at its heels is never ahead of the plan.

use rayon::prelude::*;

use super::GateError;
use super::frontier::Frontier;
use super::graph::{DependencyGraph, Edge, GateOptions, Wait};
use super::meet::{Bodies, Bounds, Order, Sweep, Timed, middle, order, overlap, pair};
use super::routes::{Routes, Split};

/// Largest number of pieces between two moments of a ring at which an agent is at a knot.
const MOST_PIECES: u32 = 256;

/// Largest number of pieces of a ring.
const MOST_OF_RING: u64 = 1 << 22;

/// Actions `first..=last` of an agent.
#[derive(Debug, Clone, Copy)]
struct Part {
    agent: u32,
    first: u32,
    last: u32,
}

/// The actions of a ring, in order of agents. The actions of an agent are successive:
/// between two of them in a cycle, all are.
type Ring = Vec<Part>;

/// A ring in order: the cuts, and the edges between pieces, which are counted from 0 along
/// each agent's part.
struct Solved {
    splits: Vec<Split>,
    margin_m: f64,
    edges: Vec<Link>,
}

/// Piece `to.1` of the agent `to.0` of a ring waits for piece `from.1` of the
/// agent `from.0` of the ring.
#[derive(Debug, Clone, Copy)]
struct Link {
    to: (u32, u32),
    from: (u32, u32),
}

/// The graph itself if it has no cycle, else a graph with the actions of cycles cut into
/// pieces.
pub(super) fn resolve<R: Routes + ?Sized>(
    graph: DependencyGraph,
    routes: &R,
    bodies: &Bodies<'_>,
    options: &GateOptions,
) -> Result<DependencyGraph, GateError> {
    let mut frontier = Frontier::new(&graph);
    if frontier.run(&graph) {
        return Ok(graph);
    }
    let rings = find(&graph, &frontier);
    let refined = graph.routes(routes);
    let solved: Vec<Result<Solved, GateError>> = rings
        .par_iter()
        .map(|ring| solve(ring, &refined, bodies, options))
        .collect();
    let solved: Vec<Solved> = solved.into_iter().collect::<Result<_, _>>()?;
    let ordered = replace(&graph, &rings, &solved)?;
    // Every ring now has an order, and there never was a cycle between rings; freedom
    // from deadlock is checked all the same.
    if Frontier::new(&ordered).run(&ordered) {
        return Ok(ordered);
    }
    Err(unordered(&rings[0], &refined, options.least_margin_m))
}

/// The strongly connected components with more than one action among the actions that
/// cannot be executed (Tarjan 1972, without recursion).
fn find(graph: &DependencyGraph, frontier: &Frontier) -> Vec<Ring> {
    const UNSEEN: u32 = 0;
    // Numbers of the remaining actions, agent by agent.
    let mut begins = vec![0];
    let mut owner = Vec::new();
    for agent in 0..graph.agents() {
        let left = graph.actions(agent) as u32 - frontier.reached(agent);
        owner.extend(std::iter::repeat_n(agent as u32, left as usize));
        begins.push(owner.len() as u32);
    }
    let number = |agent: u32, action: u32| {
        let reached = frontier.reached(agent as usize);
        (action > reached).then(|| begins[agent as usize] + action - reached - 1)
    };
    // Predecessors of an action, entry by entry: the action before it, then its waits.
    let first_wait: Vec<u32> = {
        let mut first = Vec::with_capacity(owner.len());
        for agent in 0..graph.agents() {
            let waits = graph.waits(agent);
            let mut at = frontier.met(agent);
            for action in frontier.reached(agent) + 1..=graph.actions(agent) as u32 {
                while waits.get(at).is_some_and(|wait| wait.action < action) {
                    at += 1;
                }
                first.push(at as u32);
            }
        }
        first
    };
    let before = |node: u32, entry: u32| -> Option<Option<u32>> {
        let agent = owner[node as usize];
        let action = frontier.reached(agent as usize) + 1 + node - begins[agent as usize];
        if entry == 0 {
            return Some(number(agent, action - 1));
        }
        let at = (first_wait[node as usize] + entry - 1) as usize;
        let wait = graph.waits(agent as usize).get(at)?;
        (wait.action == action).then(|| number(wait.other, wait.knot))
    };

    let mut index = vec![UNSEEN; owner.len()];
    let mut low = vec![0u32; owner.len()];
    let mut on_stack = vec![false; owner.len()];
    let (mut stack, mut calls) = (Vec::new(), Vec::new());
    let mut next_index = 1;
    let mut rings = Vec::new();
    for root in 0..owner.len() as u32 {
        if index[root as usize] != UNSEEN {
            continue;
        }
        calls.push((root, 0));
        while let Some((node, entry)) = calls.pop() {
            let at = node as usize;
            if entry == 0 {
                index[at] = next_index;
                low[at] = next_index;
                next_index += 1;
                stack.push(node);
                on_stack[at] = true;
            }
            if let Some(other) = before(node, entry) {
                calls.push((node, entry + 1));
                let Some(other) = other else { continue };
                let to = other as usize;
                if index[to] == UNSEEN {
                    calls.push((other, 0));
                } else if on_stack[to] {
                    low[at] = low[at].min(index[to]);
                }
                continue;
            }
            if let Some((parent, _)) = calls.last() {
                let parent = *parent as usize;
                low[parent] = low[parent].min(low[at]);
            }
            if low[at] != index[at] {
                continue;
            }
            let begin = stack.iter().rposition(|member| *member == node);
            let mut members = stack.split_off(begin.expect("it is on the stack"));
            for member in &members {
                on_stack[*member as usize] = false;
            }
            if members.len() > 1 {
                members.sort_unstable();
                rings.push(ring(&members, &owner, |agent, node| {
                    frontier.reached(agent as usize) + 1 + node - begins[agent as usize]
                }));
            }
        }
    }
    rings.sort_unstable_by_key(|ring| (ring[0].agent, ring[0].first));
    rings
}

fn ring(members: &[u32], owner: &[u32], action: impl Fn(u32, u32) -> u32) -> Ring {
    let mut ring: Ring = Vec::new();
    for member in members {
        let agent = owner[*member as usize];
        let action = action(agent, *member);
        match ring.last_mut() {
            Some(part) if part.agent == agent => part.last = action,
            _ => ring.push(Part {
                agent,
                first: action,
                last: action,
            }),
        }
    }
    ring
}

/// The moments at which an agent of a ring is at a knot of its part, in order.
fn moments<R: Routes + ?Sized>(ring: &Ring, routes: &R) -> Vec<f64> {
    let parts = ring.iter().flat_map(|part| {
        let knots = part.first as usize - 1..=part.last as usize;
        knots.map(|knot| routes.time_s(part.agent as usize, knot))
    });
    let mut moments: Vec<f64> = parts.collect();
    moments.sort_unstable_by(f64::total_cmp);
    moments.dedup();
    moments
}

/// The moments strictly between two times.
fn within(moments: &[f64], [start_s, end_s]: [f64; 2]) -> &[f64] {
    let first = moments.partition_point(|moment| *moment <= start_s);
    let last = moments.partition_point(|moment| *moment < end_s);
    &moments[first..last.max(first)]
}

/// An agent's part of a ring in pieces.
struct Pieces {
    motions: Vec<Timed>,
    /// For every piece, the end of the pieces of the same action.
    ends: Vec<usize>,
    splits: Vec<Split>,
    bounds: Bounds,
}

impl Pieces {
    /// Cuts the moving actions at the moments, and between two of them into `pieces`.
    fn new<R: Routes + ?Sized>(
        part: Part,
        moments: &[f64],
        routes: &R,
        bodies: &Bodies<'_>,
        pieces: u32,
    ) -> Self {
        let (mut motions, mut ends, mut splits) = (Vec::new(), Vec::new(), Vec::new());
        let mut bounds = [
            f64::INFINITY,
            f64::INFINITY,
            f64::NEG_INFINITY,
            f64::NEG_INFINITY,
        ];
        for action in part.first as usize..=part.last as usize {
            let agent = part.agent as usize;
            let (from, to) = (routes.pose(agent, action - 1), routes.pose(agent, action));
            let whole = Sweep {
                agent: part.agent,
                from,
                to,
            };
            let [left, bottom, right, top] = bodies.bounds(whole, 0.0);
            bounds = [
                bounds[0].min(left),
                bounds[1].min(bottom),
                bounds[2].max(right),
                bounds[3].max(top),
            ];
            let times = [action - 1, action].map(|knot| routes.time_s(agent, knot));
            let (moments, pieces) = if whole.is_rest() {
                (&[][..], 1)
            } else {
                (within(moments, times), pieces)
            };
            let mut before = (from, times[0]);
            let mut begin = (0.0, times[0]);
            for moment in moments.iter().copied().chain([times[1]]) {
                let end = if moment < times[1] {
                    ((moment - times[0]) / (times[1] - times[0]), moment)
                } else {
                    (1.0, times[1])
                };
                for piece in 1..=pieces {
                    let share = f64::from(piece) / f64::from(pieces);
                    let after = if piece < pieces {
                        let fraction = begin.0 + (end.0 - begin.0) * share;
                        let time_s = begin.1 + (end.1 - begin.1) * share;
                        (from.toward(to, fraction), time_s)
                    } else if end.0 < 1.0 {
                        (from.toward(to, end.0), end.1)
                    } else {
                        (to, end.1)
                    };
                    let sweep = Sweep {
                        agent: part.agent,
                        from: before.0,
                        to: after.0,
                    };
                    motions.push(Timed {
                        sweep,
                        start_s: before.1,
                        end_s: after.1,
                    });
                    before = after;
                }
                splits.push(Split {
                    agent: part.agent,
                    action: action as u32,
                    pieces,
                    from: begin.0,
                    to: end.0,
                });
                begin = end;
            }
            ends.resize(motions.len(), motions.len());
        }
        Self {
            motions,
            ends,
            splits,
            bounds,
        }
    }

    /// The last piece of `begin..end` that meets a motion. Pieces of one action
    /// sweep together what the stretch sweeps as a whole, so that stretches that
    /// do not meet it are passed over.
    fn last_meeting(
        &self,
        begin: usize,
        end: usize,
        motion: Sweep,
        bodies: &Bodies<'_>,
        margin_m: f64,
    ) -> Option<usize> {
        let mut stretches = Vec::new();
        let mut at = begin;
        while at < end {
            let to = self.ends[at].min(end);
            stretches.push((at, to));
            at = to;
        }
        while let Some((from, to)) = stretches.pop() {
            let stretch = Sweep {
                to: self.motions[to - 1].sweep.to,
                ..self.motions[from].sweep
            };
            if !bodies.meet(stretch, motion, margin_m) {
                continue;
            }
            if to - from == 1 {
                return Some(from);
            }
            let middle = from.midpoint(to);
            stretches.push((from, middle));
            stretches.push((middle, to));
        }
        None
    }
}

/// Reason for which pieces have no order.
enum Stuck {
    /// Two agents are nearer than the margin at the same time, however small the
    /// pieces are.
    TooClose(GateError),
    /// Smaller pieces may have an order.
    Coarse,
}

/// Finds the fewest pieces with an order, at the full margin if possible, else at the
/// least one.
fn solve<R: Routes + ?Sized>(
    ring: &Ring,
    routes: &R,
    bodies: &Bodies<'_>,
    options: &GateOptions,
) -> Result<Solved, GateError> {
    let (margin_m, least_m) = (options.margin_m, options.least_margin_m);
    let margins = [margin_m, least_m];
    let margins = if margin_m > least_m {
        &margins[..]
    } else {
        &margins[..1]
    };
    let moments = moments(ring, routes);
    let stretches: u64 = ring
        .iter()
        .map(|part| {
            let knots = [part.first as usize - 1, part.last as usize];
            let ends = knots.map(|knot| routes.time_s(part.agent as usize, knot));
            within(&moments, ends).len() as u64 + 1
        })
        .sum();
    let most = MOST_PIECES.min((MOST_OF_RING / stretches) as u32);
    let in_pieces = |pieces: u32| -> Vec<Pieces> {
        let parts = ring.iter();
        let parts = parts.map(|part| Pieces::new(*part, &moments, routes, bodies, pieces));
        parts.collect()
    };
    for margin_m in margins {
        let mut pieces = 1;
        while pieces <= most {
            let all = in_pieces(pieces);
            pieces *= 2;
            match cut(&all, bodies, *margin_m) {
                Ok(edges) => {
                    return Ok(Solved {
                        splits: all.into_iter().flat_map(|part| part.splits).collect(),
                        margin_m: *margin_m,
                        edges,
                    });
                }
                Err(Stuck::Coarse) => {}
                Err(Stuck::TooClose(_)) if *margin_m > 0.0 => break,
                Err(Stuck::TooClose(collision)) => return Err(collision),
            }
        }
    }
    // Bodies that overlap need no talk of room.
    let overlap = in_pieces(1);
    match cut(&overlap, bodies, 0.0) {
        Err(Stuck::TooClose(collision)) if least_m > 0.0 => Err(collision),
        _ => Err(unordered(ring, routes, least_m)),
    }
}

fn unordered<R: Routes + ?Sized>(ring: &Ring, routes: &R, room_m: f64) -> GateError {
    let starts = ring.iter().map(|part| {
        let (agent, knot) = (part.agent as usize, part.first as usize - 1);
        (routes.time_s(agent, knot), routes.pose(agent, knot))
    });
    let places = ring.len() as f64;
    let (mut time_s, mut at_m) = (f64::INFINITY, [0.0; 2]);
    for (start_s, pose) in starts {
        time_s = time_s.min(start_s);
        at_m = [at_m[0] + pose.x / places, at_m[1] + pose.y / places];
    }
    GateError::NoOrder {
        agents: ring.iter().map(|part| part.agent).collect(),
        time_s,
        at_m,
        room_m,
    }
}

/// The edges between the pieces of a ring.
fn cut(all: &[Pieces], bodies: &Bodies<'_>, margin_m: f64) -> Result<Vec<Link>, Stuck> {
    let mut edges = Vec::new();
    for (to, waiting) in all.iter().enumerate() {
        for (from, other) in all.iter().enumerate() {
            let reach = other.bounds;
            let reach = [
                reach[0] - margin_m,
                reach[1] - margin_m,
                reach[2] + margin_m,
                reach[3] + margin_m,
            ];
            if from == to || !overlap(waiting.bounds, reach) {
                continue;
            }
            // The last piece of the other agent that is already waited for.
            let mut waited = 0;
            for (piece, motion) in waiting.motions.iter().enumerate() {
                let others = &other.motions;
                let ended = others.partition_point(|other| other.end_s <= motion.start_s);
                let begun = others.partition_point(|other| other.start_s < motion.end_s);
                let mut last = None;
                for at in (ended..begun).rev() {
                    if !bodies.meet(others[at].sweep, motion.sweep, margin_m) {
                        continue;
                    }
                    match order(&others[at], motion, bodies, margin_m) {
                        Order::First => last = last.max(Some(at)),
                        Order::Second => {}
                        Order::Neither => {
                            let found = others[at].collides(motion, bodies, margin_m);
                            return Err(match found {
                                Some(time_s) => Stuck::TooClose(GateError::Collision {
                                    agents: pair(&others[at], motion),
                                    time_s,
                                    at_m: middle(&others[at], motion, time_s),
                                }),
                                None => Stuck::Coarse,
                            });
                        }
                    }
                }
                let last = last
                    .or_else(|| other.last_meeting(waited, ended, motion.sweep, bodies, margin_m));
                if let Some(last) = last.filter(|last| *last >= waited) {
                    waited = last + 1;
                    edges.push(Link {
                        to: (to as u32, piece as u32),
                        from: (from as u32, last as u32),
                    });
                }
            }
        }
    }
    let lengths: Vec<u32> = all
        .iter()
        .map(|pieces| pieces.motions.len() as u32)
        .collect();
    edges.sort_unstable_by_key(|edge| (edge.to, edge.from));
    let local = DependencyGraph::assemble(
        lengths,
        edges
            .iter()
            .map(|edge| Edge {
                agent: edge.to.0,
                wait: Wait {
                    action: edge.to.1 + 1,
                    other: edge.from.0,
                    knot: edge.from.1 + 1,
                },
            })
            .collect(),
    );
    if Frontier::new(&local).run(&local) {
        Ok(edges)
    } else {
        Err(Stuck::Coarse)
    }
}

/// The graph with the actions of rings cut into pieces.
///
/// Edges within a ring become edges between its pieces. An old edge also stood for
/// dependencies of earlier actions of the one agent and of later actions of the other
/// one: actions before or after the ring keep their order. All of that followed from the
/// old edges, so no new cycle can go through more than one ring.
fn replace(
    graph: &DependencyGraph,
    rings: &[Ring],
    solved: &[Solved],
) -> Result<DependencyGraph, GateError> {
    // For every action of a ring: its agent, the action, its ring, and the agent's index
    // in the ring.
    let mut members: Vec<(u32, u32, u32, u32)> = Vec::new();
    let mut splits = Vec::new();
    for (number, (ring, solved)) in rings.iter().zip(solved).enumerate() {
        for (place, part) in ring.iter().enumerate() {
            for action in part.first..=part.last {
                members.push((part.agent, action, number as u32, place as u32));
            }
        }
        splits.extend_from_slice(&solved.splits);
    }
    members.sort_unstable();
    splits.sort_by_key(|split| (split.agent, split.action));
    let membership = |agent: u32, action: u32| {
        let at = members.binary_search_by_key(&(agent, action), |member| (member.0, member.1));
        at.ok().map(|at| (members[at].2, members[at].3))
    };
    // Cumulative number of actions added by an agent's splits, in their order.
    let mut added = Vec::with_capacity(splits.len());
    let mut total = (u32::MAX, 0u64);
    for split in &splits {
        if total.0 != split.agent {
            total = (split.agent, 0);
        }
        total.1 += u64::from(split.added());
        added.push(total.1);
    }
    // Numbers of the last and of the first piece of an action.
    let last_piece = |agent: u32, action: u32| {
        let after = splits.partition_point(|split| (split.agent, split.action) <= (agent, action));
        let more = match after.checked_sub(1) {
            Some(at) if splits[at].agent == agent => added[at],
            _ => 0,
        };
        u64::from(action) + more
    };
    let first_piece = |agent: u32, action: u32| last_piece(agent, action - 1) + 1;

    let agents = graph.agents();
    let mut actions = Vec::with_capacity(agents);
    for agent in 0..agents {
        let last = last_piece(agent as u32, graph.actions(agent) as u32);
        let most = u32::MAX as usize - 1;
        let last = u32::try_from(last).ok().filter(|last| *last < u32::MAX);
        actions.push(last.ok_or(GateError::TooManyActions { most })?);
    }
    let edge = |(agent, action): (u32, u64), (other, knot): (u32, u64)| Edge {
        agent,
        wait: Wait {
            action: action as u32,
            other,
            knot: knot as u32,
        },
    };
    let mut edges = Vec::with_capacity(graph.edges());
    let mut around = Vec::new();
    for agent in 0..agents as u32 {
        for wait in graph.waits(agent as usize) {
            let to = membership(agent, wait.action);
            let from = membership(wait.other, wait.knot);
            match (to, from) {
                (Some(to), Some(from)) if to.0 == from.0 => around.push((to.0, to.1, from.1)),
                _ => edges.push(edge(
                    (agent, first_piece(agent, wait.action)),
                    (wait.other, last_piece(wait.other, wait.knot)),
                )),
            }
        }
    }
    around.sort_unstable();
    around.dedup();
    for (number, to, from) in around {
        let ring = &rings[number as usize];
        let (to, from) = (ring[to as usize], ring[from as usize]);
        if from.first > 1 {
            edges.push(edge(
                (to.agent, first_piece(to.agent, to.first)),
                (from.agent, last_piece(from.agent, from.first - 1)),
            ));
        }
        if (to.last as usize) < graph.actions(to.agent as usize) {
            edges.push(edge(
                (to.agent, first_piece(to.agent, to.last + 1)),
                (from.agent, last_piece(from.agent, from.last)),
            ));
        }
    }
    for (ring, solved) in rings.iter().zip(solved) {
        let begins: Vec<u64> = ring
            .iter()
            .map(|part| first_piece(part.agent, part.first))
            .collect();
        for link in &solved.edges {
            let place = |(place, piece): (u32, u32)| {
                let at = place as usize;
                (ring[at].agent, begins[at] + u64::from(piece))
            };
            edges.push(edge(place(link.to), place(link.from)));
        }
    }
    let margins = solved.iter().map(|solved| solved.margin_m);
    let margin_m = margins.fold(graph.margin_m(), f64::min);
    let cuts = graph.cuts().refine(agents, &splits);
    Ok(DependencyGraph::assemble(actions, edges).with(cuts, margin_m))
}
