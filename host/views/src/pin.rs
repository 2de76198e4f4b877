//! Starts and goals at the nearest vertices of a roadmap that is given.

use fleetyard_core::{InputError, Roadmap};

use crate::Problem;

/// Starts and goals of a task as vertices of a roadmap.
pub(crate) struct Pins {
    pub(crate) starts: Vec<u32>,
    pub(crate) goals: Vec<u32>,
}

impl Pins {
    /// The nearest vertices, the first among equals. One that is farther than `most_m` is refused.
    pub(crate) fn new(
        problem: &Problem,
        roadmap: &Roadmap,
        most_m: f64,
    ) -> Result<Self, InputError> {
        let mut pins = Self {
            starts: Vec::new(),
            goals: Vec::new(),
        };
        let nearest = |place: [f64; 2]| {
            let vertices = 0..roadmap.vertices() as u32;
            let far = vertices
                .map(|vertex| (distance_m(place, roadmap.position_m(vertex).into()), vertex));
            far.min_by(|a, b| a.0.total_cmp(&b.0))
                .unwrap_or((f64::INFINITY, 0))
        };
        for (number, agent) in problem.task.agents.iter().enumerate() {
            for (what, state, pinned) in [
                ("start", agent.start, &mut pins.starts),
                ("goal", agent.goal, &mut pins.goals),
            ] {
                let (far_m, vertex) = nearest(state.at_m());
                if far_m > most_m {
                    let reason = format!(
                        "the {what} of agent {number} is {far_m:.3} m from the nearest vertex of the roadmap, more than \
                         {most_m} m"
                    );
                    let hint = "starts and goals are vertices of the roadmaps that `fleetyard world roadmap` makes";
                    return Err(InputError::new(problem.task.source.as_str(), reason).hint(hint));
                }
                pinned.push(vertex);
            }
        }
        Ok(pins)
    }
}

/// The distance of two places.
pub(crate) fn distance_m(a: [f64; 2], b: [f64; 2]) -> f64 {
    let (x, y) = (a[0] - b[0], a[1] - b[1]);
    (x * x + y * y).sqrt()
}
