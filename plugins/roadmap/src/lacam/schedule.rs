//! Times for discs that are known to pass each other in an order.
//!
//! Steps say for every two motions that come too close which disc passes first. The difference of their starts then has a bound
//! ([`Closeness::edges_of_edge`]), and the earliest times that keep all bounds are longest paths, as in temporal plan graphs
//! (W. Hönig et al., "Multi-agent path finding with kinematic constraints", ICAPS 2016). Motions of one step may bound each other in
//! both directions, as when discs drive round in a ring; all setting out at once keeps those bounds, so that there are such times.

use std::collections::VecDeque;

use crate::closeness::Closeness;
use crate::plan::{Path, Visit};
use crate::roadmap::{Edge, NONE, Vertex};

/// Paths of discs from their starts along the edges of steps, which are as the search for steps makes them.
pub fn earliest(closeness: &Closeness, starts: &[Vertex], steps: &[Vec<Edge>]) -> Vec<Path> {
    let roadmap = closeness.roadmap();
    // The time at which an edge was set out on last with the disc that did, and the one that does in this step. Whoever was there
    // before the last one left earlier by more than anybody has to wait for.
    let mut last = vec![(f64::NEG_INFINITY, NONE); roadmap.edges()];
    let mut driver = vec![NONE; roadmap.edges()];
    let mut ready = vec![0.0_f64; starts.len()];
    let mut paths: Vec<Path> = starts.iter().map(|start| vec![rest(*start, 0.0)]).collect();
    let mut after: Vec<Vec<(u32, f64)>> = vec![Vec::new(); starts.len()];
    let mut waiting = vec![false; starts.len()];
    for step in 0..steps.iter().map(Vec::len).max().unwrap_or(0) {
        let edge = |disc: usize| steps[disc].get(step).copied().unwrap_or(NONE);
        let movers: Vec<usize> = (0..starts.len())
            .filter(|disc| edge(*disc) != NONE)
            .collect();
        for disc in &movers {
            driver[edge(*disc) as usize] = *disc as u32;
        }
        for disc in &movers {
            for (other, later) in closeness.edges_of_edge(edge(*disc)) {
                // Whoever was there before passed first: its start is earlier by at least so much.
                let (time, first) = last[other as usize];
                if first as usize != *disc {
                    ready[*disc] = ready[*disc].max(time - later.low);
                }
                let second = driver[other as usize];
                if second != NONE && second as usize != *disc && later.high <= -later.low {
                    after[*disc].push((second, later.high));
                }
            }
        }
        let mut queue: VecDeque<usize> = movers.iter().copied().collect();
        for disc in &movers {
            waiting[*disc] = true;
        }
        while let Some(disc) = queue.pop_front() {
            waiting[disc] = false;
            for (second, later) in &after[disc] {
                let (second, time) = (*second as usize, ready[disc] + later);
                if time > ready[second] {
                    ready[second] = time;
                    if !std::mem::replace(&mut waiting[second], true) {
                        queue.push_back(second);
                    }
                }
            }
        }
        for disc in movers {
            let (edge, departure) = (edge(disc), ready[disc]);
            driver[edge as usize] = NONE;
            after[disc].clear();
            last[edge as usize] = (departure, disc as u32);
            if let Some(visit) = paths[disc].last_mut() {
                (visit.departure, visit.onward) = (departure, edge);
            }
            ready[disc] = departure + roadmap.duration(edge);
            paths[disc].push(rest(roadmap.target(edge), ready[disc]));
        }
    }
    paths
}

/// A stay without an end.
fn rest(vertex: Vertex, arrival: f64) -> Visit {
    Visit {
        vertex,
        arrival,
        departure: f64::INFINITY,
        onward: NONE,
    }
}
