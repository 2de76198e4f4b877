//! Agents that collide with nobody go; agents that would collide wait, and make way if they can.
//!
//! J. Morag, R. Stern, A. Felner, "Adapting to planning failures in lifelong multi-agent path
//! finding", SoCS 2023. Agents whose paths meet no other path follow them. The others stay at
//! their starts. Where a path leads through a start where somebody stays, that agent makes one
//! move to a cell beside it where nobody comes by; if there is none, the other one has to stay
//! as well, which may be in somebody else's way, and so on.

use std::collections::VecDeque;

use fleetyard_abi::sdk::Failure;
use fleetyard_abi::{GridPlan, Instance};
use fleetyard_plugin_spacetime::graph::{DIRECTIONS, Vertex};
use fleetyard_plugin_spacetime::plugin::Call;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Policy, Problem, Recovery};
use crate::ground::Ground;

/// Lets those go who are in nobody's way.
pub type RuleBased = Policy<RuleBasedOptions>;

/// Options of `rule-based`: none.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RuleBasedOptions {}

impl Recovery for RuleBasedOptions {
    const NAMES: (&'static str, &'static str) = ("rule-based", "Rule-based");
    const ABOUT: &'static str = "Agents whose paths meet no other path follow them; the others wait \
         at their starts, and make one move out of somebody's way if they can; if not, that one \
         waits too (Morag, Stern, Felner, SoCS 2023).";
    type Map = Ground;

    fn recover(
        &self,
        ground: &mut Ground,
        instance: &Instance,
        failed: Option<&GridPlan>,
        call: &Call<'_>,
    ) -> Result<(), Failure> {
        let problem = Problem::new(ground, instance)?;
        let mut paths = problem.paths(failed);
        cut_turns(&problem, &mut paths);
        let waits = meet(&problem, &paths);
        apply(&problem, &mut paths, waits);
        problem.submit(&paths, call);
        Ok(())
    }
}

/// A turn takes steps: a path that has not left time for it ends before.
fn cut_turns(problem: &Problem<'_>, paths: &mut [Vec<Vertex>]) {
    let Some(headings) = &problem.headings else {
        return;
    };
    for (path, heading) in paths.iter_mut().zip(headings) {
        let mut heading = *heading;
        let mut waited = 0;
        let mut good = path.len();
        for (at, step) in path.windows(2).enumerate() {
            if step[0] == step[1] {
                waited += 1;
                continue;
            }
            let towards = direction(problem.ground, step[0], step[1]);
            if waited < quarters(heading, towards) {
                good = at + 1;
                break;
            }
            heading = towards;
            waited = 0;
        }
        path.truncate(good);
    }
}

fn direction(ground: &Ground, from: Vertex, to: Vertex) -> u8 {
    let around = ground.graph.around(from);
    around.iter().position(|v| *v == to).unwrap_or(0) as u8
}

/// Turns by 90° from one direction to another.
fn quarters(from: u8, to: u8) -> u32 {
    let all = DIRECTIONS as u8;
    let apart = (to + all - from) % all;
    u32::from(apart.min(all - apart))
}

fn at(path: &[Vertex], time: usize) -> Vertex {
    path[time.min(path.len() - 1)]
}

/// True for the agents whose paths collide: in a cell, between two cells, or in a ring where that
/// is not allowed.
fn meet(problem: &Problem<'_>, paths: &[Vec<Vertex>]) -> Vec<bool> {
    const NOBODY: u32 = u32::MAX;
    let mut waits = vec![false; paths.len()];
    // Who is in a cell at a time, and the one before.
    let mut before = vec![NOBODY; problem.ground.graph.len()];
    let mut now = before.clone();
    let longest = paths.iter().map(Vec::len).max().unwrap_or(0);
    // In which round a ring was looked for at an agent.
    let mut asked = vec![0_usize; paths.len()];
    let mut round = 0;
    for time in 0..longest {
        for (agent, path) in paths.iter().enumerate() {
            let v = at(path, time) as usize;
            if now[v] == NOBODY {
                now[v] = agent as u32;
            } else {
                // Those in the cell may be more than two: each meets the first.
                waits[agent] = true;
                waits[now[v] as usize] = true;
            }
        }
        let follows = |agent: usize| {
            let (from, to) = (
                at(&paths[agent], time.saturating_sub(1)),
                at(&paths[agent], time),
            );
            let ahead = before[to as usize];
            (from != to && ahead != NOBODY).then_some(ahead as usize)
        };
        let base = round;
        for agent in 0..paths.len() {
            round += 1;
            let mut length = 0;
            let mut next = Some(agent);
            // Along those who follow one another, until nobody is ahead or it has been here.
            let ring = loop {
                match next {
                    None => break false,
                    Some(one) if asked[one] == round => break one == agent,
                    // What leads on from here has been looked at.
                    Some(one) if asked[one] > base && one != agent => break false,
                    Some(one) => {
                        asked[one] = round;
                        length += 1;
                        next = follows(one);
                    }
                }
            };
            if ring && (length == 2 || !problem.rings) {
                let mut one = agent;
                for _ in 0..length {
                    waits[one] = true;
                    one = follows(one).unwrap_or(agent);
                }
            }
        }
        for path in paths {
            before[at(path, time.saturating_sub(1)) as usize] = NOBODY;
        }
        for path in paths {
            now[at(path, time) as usize] = NOBODY;
        }
        for (agent, path) in paths.iter().enumerate() {
            before[at(path, time) as usize] = agent as u32;
        }
    }
    waits
}

/// Lets those wait who have to, and those make way who can.
fn apply(problem: &Problem<'_>, paths: &mut [Vec<Vertex>], mut waits: Vec<bool>) {
    let graph = &problem.ground.graph;
    // Who comes to a cell, and when first. Those who wait are taken out as they are found.
    let mut visits: Vec<Vec<(u32, u32)>> = vec![Vec::new(); graph.len()];
    for (agent, path) in paths.iter().enumerate().filter(|(agent, _)| !waits[*agent]) {
        for (time, v) in path.iter().enumerate().skip(1) {
            let known = visits[*v as usize].last();
            if known.is_none_or(|(last, _)| *last != agent as u32) {
                visits[*v as usize].push((agent as u32, time as u32));
            }
        }
    }
    let mut starts = vec![false; graph.len()];
    for start in &problem.starts {
        starts[*start as usize] = true;
    }
    let mut open: VecDeque<usize> = (0..paths.len()).filter(|agent| waits[*agent]).collect();
    while let Some(agent) = open.pop_front() {
        let start = problem.starts[agent];
        paths[agent] = vec![start];
        let come = |v: Vertex| {
            let coming = visits[v as usize].iter();
            coming.filter(|(other, _)| !waits[*other as usize] && *other as usize != agent)
        };
        let Some(first) = come(start).map(|(_, time)| *time).min() else {
            continue;
        };
        // A cell where nobody begins, comes by or has made way to.
        let way = (0..)
            .zip(graph.around(start))
            .filter(|(_, v)| {
                **v != graph.wall() && !starts[**v as usize] && come(**v).next().is_none()
            })
            .map(|(towards, v)| {
                let headings = problem.headings.as_ref();
                (headings.map_or(0, |all| quarters(all[agent], towards)), *v)
            })
            .min()
            .filter(|(turns, _)| turns < &first);
        if let Some((turns, v)) = way {
            paths[agent].extend(std::iter::repeat_n(start, turns as usize));
            paths[agent].push(v);
            starts[v as usize] = true;
            continue;
        }
        let stopped: Vec<usize> = come(start).map(|(other, _)| *other as usize).collect();
        for other in stopped {
            waits[other] = true;
            open.push_back(other);
        }
    }
}
