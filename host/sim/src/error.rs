//! Errors of executions.

use std::io;

use fleetyard_core::TrajectoryError;

use crate::contact::ContactError;
use crate::event::Other;
use crate::gate::GateError;

/// Reason for which an execution was refused or aborted. Agents and times are counted
/// from 0.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages document the fields")]
#[non_exhaustive]
pub enum SimError {
    #[error("{field} = {value} {reason}")]
    Config {
        field: &'static str,
        value: String,
        reason: &'static str,
        hint: &'static str,
    },
    #[error("the plan has no agents")]
    NoAgents,
    #[error("the plan has {agents} agents, more than the {most} that can be simulated")]
    TooManyAgents { agents: usize, most: usize },
    #[error("the path of agent {agent} is empty")]
    EmptyPath { agent: usize },
    #[error("agent {agent} is outside the map at time {time}")]
    OffMap { agent: usize, time: usize },
    #[error("the execution would take {ticks:e} ticks, more than the {most:e} that can be counted")]
    TooLong { ticks: f64, most: f64 },
    #[error("more than {most} pairs of agents are near each other at {time_s} s")]
    TooDense { most: usize, time_s: f64 },
    #[error("a plan on a grid needs the map that it is for")]
    NoMap,
    #[error("the plan has {agents} agents, the fleet {fleet}")]
    OtherFleet { agents: usize, fleet: usize },
    #[error("agent {agent} begins in {}", place(*other))]
    StartOverlap { agent: u32, other: Other },
    #[error(
        "agent {agent} {what} {value:.3} /s before knot {knot}, but its model {model} has a limit of {most:.3}"
    )]
    TooFast {
        agent: usize,
        knot: usize,
        what: &'static str,
        value: f64,
        most: f64,
        model: &'static str,
    },
    #[error(
        "the corners of the plan cannot be rounded: the model of agent {agent}, {model}, turns in \
         place at every knot of a curve that it drives by order"
    )]
    Corners { agent: usize, model: &'static str },
    #[error(
        "agent {agent} cannot have errors of velocity: its model {model} follows its reference exactly"
    )]
    NoSlip { agent: usize, model: &'static str },
    #[error("agent {agent} is a car, which does not go with {reason}")]
    Car { agent: usize, reason: &'static str },
    #[error("the way of the trailer of agent {agent} is too long to be followed")]
    LongTow { agent: usize },
    #[error("the corners of the plan cannot be rounded: {0}")]
    Smooth(#[from] TrajectoryError),
    #[error("there is no agent {agent}: there are {agents}")]
    NoSuchAgent { agent: usize, agents: usize },
    #[error("order {number} of agent {agent} {reason}")]
    Order {
        agent: usize,
        number: usize,
        reason: String,
        hint: &'static str,
    },
    #[error("{agents} agents need about {} MiB, more than the {} MiB that may be used", needed >> 20, limit >> 20)]
    TooLarge {
        agents: usize,
        needed: u64,
        limit: u64,
    },
    #[error(transparent)]
    Gate(#[from] GateError),
    #[error(transparent)]
    Contact(#[from] ContactError),
    #[error("{threads} threads could not be started: {reason}")]
    Threads { threads: usize, reason: String },
    #[error("the trace could not be written: {0}")]
    Trace(#[from] io::Error),
}

impl SimError {
    /// Remedy for the user.
    pub fn hint(&self) -> Option<&'static str> {
        match self {
            Self::Config { hint, .. } | Self::Order { hint, .. } => Some(hint),
            Self::NoSuchAgent { .. } => Some("agents are counted from 0"),
            Self::NoAgents => Some("an instance has at least one agent"),
            Self::TooManyAgents { .. } => Some("split the plan"),
            Self::EmptyPath { .. } => {
                Some("an agent that never moves has a path of one cell: its start")
            }
            Self::OffMap { .. } => {
                Some("validate the plan against its instance first; cells are row * width + column")
            }
            Self::TooLong { .. } => Some("shorten the plan, or lower step_s or ticks_hz"),
            Self::TooDense { .. } => Some(
                "validate the plan first; if it is meant, raise max_pairs or lower approach_range_cells",
            ),
            Self::NoMap => Some("name the map"),
            Self::OtherFleet { .. } => {
                Some("give a fleet of as many agents, or one that is `all` alike")
            }
            Self::StartOverlap { .. } => Some("move a start, or make footprints smaller"),
            Self::TooFast { .. } => {
                Some("slow the plan down, or execute it by order, in which its times do not count")
            }
            Self::Corners { .. } => Some(
                "leave the plan as it is, execute it by time, or give robots that move in any direction",
            ),
            Self::NoSlip { .. } => Some(
                "give robots with a controller, such as holonomic or agv, or leave out the errors",
            ),
            Self::Car { .. } => Some(
                "cars follow plans in the plane, with headings, exactly and by time: leave out what disturbs them",
            ),
            Self::LongTow { .. } => Some("give shorter legs, or validate the plan first"),
            Self::Smooth(error) => error.hint(),
            Self::TooLarge { .. } => {
                Some("execute fewer agents, or use a machine with more memory")
            }
            Self::Gate(error) => error.hint(),
            Self::Contact(_) => None,
            Self::Threads { .. } => Some("use fewer threads"),
            Self::Trace(_) => {
                Some("check the free space and the permissions of the trace file's folder")
            }
        }
    }
}

fn place(other: Other) -> String {
    match other {
        Other::Agent(agent) => format!("agent {agent}"),
        Other::Obstacle { cell } => format!("the solid cell {cell}"),
        Other::Polygon(index) => format!("obstacle {index} or beyond the bounds"),
        Other::Mover(index) => format!("the moving obstacle {index}"),
        Other::Goal => "its goal".to_owned(),
    }
}
