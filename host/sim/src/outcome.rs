//! Outcomes of executions.

use fleetyard_core::Digest;
use serde::Serialize;

use crate::config::{Policy, Tier};
use crate::event::Contacts;

/// Nearest approach of an agent to another one, between centres.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Approach {
    /// Least distance between the centres, in metres.
    pub distance_m: f64,
    /// Time at which it was first reached, in simulated seconds.
    pub time_s: f64,
    /// The two agents; in a query for one agent, that agent comes first.
    pub agents: [u32; 2],
}

/// Outcome of an execution.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Outcome {
    /// Tier of the execution.
    pub tier: Tier,
    /// Rule by which agents proceeded.
    pub policy: Policy,
    /// Number of agents, without the trailers of cars.
    pub agents: u32,
    /// The largest effective radius of an agent in metres: that of the smallest
    /// disc which covers any agent's footprint (r_com of GRACE, section III-B).
    pub radius_m: f64,
    /// Number of agents that reached the ends of their routes.
    pub arrived: u32,
    /// Time of the last arrival in seconds, if all agents arrived.
    pub makespan_s: Option<f64>,
    /// Sum of the times of arrival in seconds, if all agents arrived.
    pub sum_of_costs_s: Option<f64>,
    /// Simulated time in seconds, a whole number of ticks.
    pub simulated_s: f64,
    /// Number of ticks.
    pub ticks: u64,
    /// Contacts.
    pub contacts: Contacts,
    /// Least distance between the centres of any two agents in metres, over
    /// all time and not only at ticks; `None` if no two came within
    /// [`SimConfig::approach_range_cells`](crate::SimConfig::approach_range_cells).
    pub nearest_approach_m: Option<f64>,
    /// The nearest approach with its time and pair.
    pub nearest_approach: Option<Approach>,
    /// Nearest approach of every agent. Not serialised: it is as long as the fleet.
    #[serde(skip)]
    pub nearest_approach_by_agent: Vec<Option<Approach>>,
    /// Largest distance between a body and its reference in metres, at the ends of
    /// substeps for bodies that follow their reference exactly where they can, at
    /// the ends of message periods for bodies that are driven. The reference is
    /// where the plan has the agent at that time; if agents go by order, it is
    /// the line to the end of the present leg.
    pub tracking_error_max_m: f64,
    /// Largest angle in radians between a body's heading and that of the reference, at the same
    /// moments; `None` if the plan gives no headings.
    pub tracking_error_max_rad: Option<f64>,
    /// Agent with that error, the lowest index in ties; `None` if every body followed its
    /// reference exactly.
    pub tracking_error_max_agent: Option<u32>,
    /// Mean over agents and time of the distance between body and reference.
    pub tracking_error_mean_m: f64,
    /// Digest of the parameters, map, plan, all states, all events and the figures above.
    /// Equal executions have equal digests, on every machine.
    pub trace_digest: Digest,
}

/// Figures that every report of an execution has, with what it took.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Figures {
    /// Simulated time over wall time.
    pub rtf: f64,
    /// Simulated time in seconds.
    pub simulated_s: f64,
    /// Number of ticks.
    pub ticks: u64,
    /// Number of contacts.
    pub contacts: u64,
    /// Number of contacts between agents.
    pub contacts_agent_agent: u64,
    /// Number of contacts with obstacles.
    pub contacts_agent_obstacle: u64,
    /// Least distance between the centres of any two agents in metres.
    pub nearest_approach_m: Option<f64>,
    /// The largest effective radius of an agent in metres.
    pub radius_m: f64,
    /// Digest of the execution.
    pub trace_digest: Digest,
}

impl Outcome {
    /// The figures of an execution that took this wall time in seconds.
    pub fn figures(&self, wall_s: f64) -> Figures {
        Figures {
            rtf: self.simulated_s / wall_s.max(1e-9),
            simulated_s: self.simulated_s,
            ticks: self.ticks,
            contacts: self.contacts.total(),
            contacts_agent_agent: self.contacts.agent_agent,
            contacts_agent_obstacle: self.contacts.agent_obstacle,
            nearest_approach_m: self.nearest_approach_m,
            radius_m: self.radius_m,
            trace_digest: self.trace_digest,
        }
    }
}
