//! A task on a roadmap that is given: nothing is made, so that a planner is asked about vertices and
//! edges exactly as a file has them.

use fleetyard_core::{InputError, Roadmap};
use serde_json::json;

use super::{RoadmapReport, RoadmapView, common_speed};
use crate::pin::Pins;
use crate::{Free, Origin, Problem, roadmap_to_world};

/// Distance from a vertex, in metres, at which a start or a goal is at it: coordinates that were written
/// with six decimals name their vertex.
const AT_VERTEX_M: f64 = 1e-6;

impl RoadmapView {
    /// The same roadmap for another problem, whose starts and goals have to be at its vertices: by it
    /// plans are judged that were made before the problem was changed. Edges are not swept.
    pub fn of(&self, problem: &Problem) -> Result<Self, InputError> {
        let Pins { starts, goals } = Pins::new(problem, &self.roadmap, AT_VERTEX_M)?;
        Ok(Self {
            starts,
            goals,
            radius_m: problem.common_radius_m(),
            ..self.clone()
        })
    }
}

/// The view of a problem on a roadmap that is given. Robots drive at `speed_m_per_s`, by default the
/// largest that every robot has in every direction.
///
/// Refused are roadmaps with an edge along which a disc of radius r_com cannot be swept, starts and
/// goals that are not at vertices, and agents that cannot reach their goals. Movers are left out.
pub fn given_roadmap(
    problem: &Problem,
    roadmap: Roadmap,
    speed_m_per_s: Option<f64>,
) -> Result<RoadmapView, InputError> {
    let source = problem.task.source.as_str();
    let refuse = |reason: String, hint: &str| Err(InputError::new(source, reason).hint(hint));
    let speed_m_per_s = common_speed(problem, speed_m_per_s)?;
    let Pins { starts, goals } = Pins::new(problem, &roadmap, AT_VERTEX_M)?;
    let swept = roadmap_to_world(problem, &roadmap)?;
    let radius_m = problem.common_radius_m();
    // Radii ascend: what is free for the largest disc is free for all.
    let blocked = swept.edges.last().map_or(&[][..], |edges| &edges.blocked);
    if let Some([from, to]) = blocked.first() {
        let reason = format!(
            "{} edges of the roadmap are not free for discs of {radius_m} m, the first from vertex {from} to {to}",
            blocked.len()
        );
        let hint = "`fleetyard world roadmap TASK --check FILE` lists such edges; leave them out of the file";
        return refuse(reason, hint);
    }
    if let Some(agent) = swept.cut_off.first() {
        let (start, goal) = (starts[*agent], goals[*agent]);
        let reason = format!(
            "agent {agent} cannot reach its goal: no edges lead from vertex {start} to vertex {goal}"
        );
        return refuse(
            reason,
            "add edges to the roadmap, or give the agent another goal",
        );
    }
    let vertices = 0..roadmap.vertices() as u32;
    let at_m: Vec<[f64; 2]> = vertices
        .map(|vertex| roadmap.position_m(vertex).into())
        .collect();
    let edges: Vec<(u32, u32)> = roadmap
        .edges()
        .filter(|(from, to)| from < to || !roadmap.has_edge(*to, *from))
        .collect();
    let free = Free::new(&problem.world);
    let parameters = json!({"r_com_m": radius_m, "speed_m_per_s": speed_m_per_s});
    Ok(RoadmapView {
        report: RoadmapReport::new(&at_m, &edges, None, &free, radius_m),
        origin: Origin::of_roadmap(problem, &roadmap, "task-on-roadmap", parameters),
        roadmap,
        starts,
        goals,
        radius_m,
        speed_m_per_s,
    })
}
