//! What an execution came to.

use fleetyard_core::Digest;
use serde::Serialize;

use crate::config::{Policy, Tier};
use crate::event::Contacts;

/// How near an agent came to another one, between centres.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Approach {
    /// Least distance between the centres, in metres.
    pub distance_m: f64,
    /// When it was reached first, in simulated seconds.
    pub time_s: f64,
    /// The two agents; the one that was asked about comes first.
    pub agents: [u32; 2],
}

/// What an execution came to.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Outcome {
    /// The tier that executed it.
    pub tier: Tier,
    /// What decided when an agent might go on.
    pub policy: Policy,
    /// Number of agents.
    pub agents: u32,
    /// The largest effective radius of an agent in metres: that of the smallest
    /// disc which covers any agent's footprint (r_com of GRACE, section III-B).
    pub radius_m: f64,
    /// How many agents got to the ends of their routes.
    pub arrived: u32,
    /// When the last of them did, in seconds, if all did.
    pub makespan_s: Option<f64>,
    /// Sum of their times of arrival in seconds, if all arrived.
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
    /// The same with time and pair.
    pub nearest_approach: Option<Approach>,
    /// The same for every agent. Not serialised: it is as long as the fleet.
    #[serde(skip)]
    pub nearest_approach_by_agent: Vec<Option<Approach>>,
    /// Largest distance between a body and its reference in metres, at the ends of
    /// substeps for bodies that follow their reference exactly where they can, at
    /// the ends of message periods for bodies that are driven. The reference is
    /// where the plan has the agent at that time; if agents go by order, it is
    /// the line to the end of the present leg.
    pub tracking_error_max_m: f64,
    /// The agent that it belongs to, the lowest index in ties; `None` if every
    /// body followed its reference exactly.
    pub tracking_error_max_agent: Option<u32>,
    /// Mean over agents and time of the distance between body and reference.
    pub tracking_error_mean_m: f64,
    /// Digest of everything: parameters, map, plan, all states, all events and
    /// the figures above. Equal executions have equal digests, on every machine.
    pub trace_digest: Digest,
}
