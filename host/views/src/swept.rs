//! Roadmap to world: which edges each robot can drive.
//!
//! GRACE (section IV-B) embeds a roadmap in the plane by a condition and not by a construction: the
//! segment of an edge, widened by B(r_eff) of the robot, has to lie in the free space. So the
//! world of a roadmap is the world that it was made for, and the operator finds for every robot the
//! edges that keep the condition. A world made of the swept edges alone would have walls that
//! nobody built, and a planner in the plane could then do no better than one on the roadmap. The paper
//! widens both obstacles and segments; here a robot is as wide as it is, once.

use std::collections::BTreeMap;

use fleetyard_core::{InputError, Roadmap};
use serde::Serialize;
use serde_json::{Value, json};

use crate::pin::Pins;
use crate::{Free, Origin, Problem, Representation, VIEW_FORMAT};

/// The edges of a roadmap that robots of one radius can drive.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SweptEdges {
    /// r_eff in metres.
    pub radius_m: f64,
    /// Agents with this radius.
    pub agents: usize,
    /// Number of edges, however they are driven, along which the disc can be swept.
    pub free: usize,
    /// The others, as vertices from and to.
    pub blocked: Vec<[u32; 2]>,
}

/// A roadmap in a task's world.
#[derive(Debug, Clone)]
pub struct SweptView {
    /// By radius, ascending.
    pub edges: Vec<SweptEdges>,
    /// Start of every agent, the vertex nearest to it.
    pub starts: Vec<u32>,
    /// Goal of every agent, likewise.
    pub goals: Vec<u32>,
    /// Agents that cannot reach their goals along edges that are free for them.
    pub cut_off: Vec<usize>,
    /// Operator, parameters and sources.
    pub origin: Origin,
}

impl SweptView {
    /// Origin of the view, and what is free for whom.
    pub fn about(&self) -> Value {
        json!({
            "format": VIEW_FORMAT,
            "representation": Representation::Continuous,
            "origin": self.origin,
            "starts": self.starts,
            "goals": self.goals,
            "edges": self.edges,
            "cut_off": self.cut_off,
        })
    }
}

/// Sweeps every robot along every edge of a roadmap. Starts and goals farther than a robot's radius
/// r_com from any vertex are refused. Movers are left out.
pub fn roadmap_to_world(problem: &Problem, roadmap: &Roadmap) -> Result<SweptView, InputError> {
    let radius_m = problem.common_radius_m();
    let Pins { starts, goals } = Pins::new(problem, roadmap, radius_m)?;
    let free = Free::new(&problem.world);
    let mut of_radius: BTreeMap<u64, Vec<usize>> = BTreeMap::new();
    for agent in 0..problem.task.agents.len() {
        // Radii are above 0, so that their bits are in their order.
        let radius = problem.shape(agent).effective_radius_m().to_bits();
        of_radius.entry(radius).or_default().push(agent);
    }
    let place = |vertex: u32| <[f64; 2]>::from(roadmap.position_m(vertex));
    let (mut edges, mut cut_off) = (Vec::new(), Vec::new());
    for (bits, agents) in of_radius {
        let radius_m = f64::from_bits(bits);
        let vertices = 0..roadmap.vertices() as u32;
        let holds: Vec<bool> = vertices
            .map(|vertex| free.holds(place(vertex), radius_m))
            .collect();
        let is_free = |from: u32, to: u32| {
            holds[from as usize] && free.sweeps(place(from), place(to), radius_m)
        };
        let (mut count, mut blocked, mut ways) = (0, Vec::new(), vec![Vec::new(); holds.len()]);
        for (from, to) in roadmap.edges() {
            let is_two_way = roadmap.has_edge(to, from);
            if is_two_way && from > to {
                continue;
            }
            if !is_free(from, to) {
                blocked.push([from, to]);
                continue;
            }
            count += 1;
            ways[from as usize].push(to);
            if is_two_way {
                ways[to as usize].push(from);
            }
        }
        for agent in &agents {
            let ends = problem.task.agents[*agent];
            let (start, goal) = (starts[*agent], goals[*agent]);
            let is_joined = holds[start as usize]
                && holds[goal as usize]
                && free.sweeps(ends.start.at_m(), place(start), radius_m)
                && free.sweeps(place(goal), ends.goal.at_m(), radius_m);
            if !(is_joined && reaches(&ways, start, goal)) {
                cut_off.push(*agent);
            }
        }
        edges.push(SweptEdges {
            radius_m,
            agents: agents.len(),
            free: count,
            blocked,
        });
    }
    cut_off.sort_unstable();
    let parameters = json!({"r_com_m": radius_m});
    Ok(SweptView {
        edges,
        starts,
        goals,
        cut_off,
        origin: Origin::of_roadmap(problem, roadmap, "roadmap-to-world", parameters),
    })
}

fn reaches(ways: &[Vec<u32>], from: u32, to: u32) -> bool {
    let mut is_seen = vec![false; ways.len()];
    is_seen[from as usize] = true;
    let mut open = vec![from];
    while let Some(vertex) = open.pop() {
        if vertex == to {
            return true;
        }
        for next in &ways[vertex as usize] {
            if !std::mem::replace(&mut is_seen[*next as usize], true) {
                open.push(*next);
            }
        }
    }
    false
}
