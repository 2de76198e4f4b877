//! Errors of building a dependency graph.

use std::fmt::Write as _;

/// Reason for which a plan has no dependency graph. Agents, knots and times in seconds
/// are those of the plan; agents and knots are counted from 0.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages document the fields")]
#[non_exhaustive]
pub enum GateError {
    #[error("{field} = {value} is out of range")]
    Option { field: &'static str, value: f64 },
    #[error("there are more than {most} agents")]
    TooManyAgents { most: usize },
    #[error("the routes have more than {most} actions, pieces of long ones included")]
    TooManyActions { most: usize },
    #[error("knot {knot} of agent {agent} is not finite")]
    NotFinite { agent: usize, knot: usize },
    #[error("knot {knot} of agent {agent} is at {time_s} s, not later than the one before")]
    BackInTime {
        agent: usize,
        knot: usize,
        time_s: f64,
    },
    #[error(
        "agents {} and {} collide at {time_s} s of the plan, near {}",
        agents[0], agents[1], place(at_m)
    )]
    Collision {
        agents: [u32; 2],
        time_s: f64,
        /// Between the two agents.
        at_m: [f64; 2],
    },
    #[error(
        "agents {} pass each other at {time_s} s of the plan, near {}, with too little room for any \
         order{}",
        list(agents), place(at_m), room(*room_m)
    )]
    NoOrder {
        agents: Vec<u32>,
        time_s: f64,
        /// Between the agents.
        at_m: [f64; 2],
        /// Distance between footprints that the order needs at least; 0 if any will do.
        room_m: f64,
    },
}

fn place([x, y]: &[f64; 2]) -> String {
    format!("({x:.3}, {y:.3}) m")
}

fn room(room_m: f64) -> String {
    if room_m > 0.0 {
        // Rounding is no reason for another one.
        let millimetres = (room_m * 1e3 * (1.0 - 1e-9)).ceil();
        format!(": their controllers need {millimetres} mm between footprints")
    } else {
        String::new()
    }
}

/// The first few agents of a ring, and the number of the others.
fn list(agents: &[u32]) -> String {
    const SHOWN: usize = 8;
    let mut text = String::new();
    for (at, agent) in agents.iter().take(SHOWN).enumerate() {
        let separator = if at == 0 { "" } else { ", " };
        let _ = write!(text, "{separator}{agent}");
    }
    if agents.len() > SHOWN {
        let _ = write!(text, " and {} more", agents.len() - SHOWN);
    }
    text
}

impl GateError {
    /// Advice to the user.
    pub fn hint(&self) -> Option<&'static str> {
        match self {
            Self::Option { field, .. } => Some(match *field {
                "margin_m" => "give metres, 0 or more",
                "least_margin_m" => "give metres from 0 to margin_m",
                _ => "give metres above 0",
            }),
            Self::TooManyAgents { .. } => Some("split the plan"),
            Self::TooManyActions { .. } => Some("raise longest_action_m, or split the plan"),
            Self::NotFinite { .. } => None,
            Self::BackInTime { .. } => Some("times ascend strictly along a route"),
            Self::Collision { .. } => Some(
                "validate the plan first; execute it by time to see what happens, \
                 or make the footprints smaller if only they are too large for it",
            ),
            Self::NoOrder { room_m, .. } if *room_m > 0.0 => Some(
                "plan with that much more room: for wider footprints, or on wider cells; a tight \
                 execution (--tight) does without, and robots may touch",
            ),
            Self::NoOrder { .. } => Some(
                "execute the plan by time, or use a planner that leaves a gap between agents that \
                 follow each other round",
            ),
        }
    }
}
