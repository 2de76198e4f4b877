//! Contact events and their order.

use std::cmp::Ordering;
use std::collections::BTreeMap;
use std::fmt;

use serde::{Deserialize, Serialize};

/// Kind of an event.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum EventKind {
    /// Two bodies begin to overlap.
    Begin,
    /// Two bodies no longer overlap.
    End,
    /// An agent reaches the end of its route for good.
    Arrive,
}

/// The other party of an agent's contact.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Other {
    /// Another agent, always of a higher index.
    Agent(u32),
    /// The static world. An agent has at most one such contact at a time,
    /// however many solid cells it overlaps.
    Obstacle {
        /// One of the solid cells: at a beginning the first one met, at an end
        /// the last one left.
        cell: u32,
    },
    /// A polygon of the workspace, by its index; the index after the last is the
    /// outside of the workspace.
    Polygon(u32),
    /// A moving obstacle, by its index.
    Mover(u32),
    /// Nothing: the event is an arrival at the goal.
    Goal,
}

impl Other {
    /// Sort key: agents first, then obstacles, then the goal.
    fn key(self) -> (u8, u32) {
        match self {
            Self::Agent(agent) => (0, agent),
            // An agent has one such contact at a time, whatever its cell.
            Self::Obstacle { .. } => (1, 0),
            Self::Polygon(index) => (2, index),
            Self::Mover(index) => (3, index),
            Self::Goal => (4, 0),
        }
    }
}

/// The begin or end of a contact, or an arrival. Events are ordered by substep, agent,
/// other party (agents, cells, polygons, moving obstacles, the goal) and time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Event {
    /// Substep of the event, counted from 0.
    pub substep: u64,
    /// Simulated time in seconds.
    pub time_s: f64,
    /// Kind of the event.
    pub kind: EventKind,
    /// The agent, the lower index of two.
    pub agent: u32,
    /// The other party.
    pub other: Other,
}

impl fmt::Display for Other {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Agent(agent) => write!(f, "agent {agent}"),
            Self::Obstacle { cell } => write!(f, "cell {cell}"),
            Self::Polygon(index) => write!(f, "polygon {index}"),
            Self::Mover(index) => write!(f, "moving obstacle {index}"),
            Self::Goal => f.write_str("its goal"),
        }
    }
}

impl fmt::Display for Event {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let did = match self.kind {
            EventKind::Begin => "begins to touch",
            EventKind::End => "no longer touches",
            EventKind::Arrive => "arrives at",
        };
        write!(f, "agent {} {did} {}", self.agent, self.other)
    }
}

/// A contact from beginning to end.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Contact {
    /// Begin, in simulated seconds.
    pub begin_s: f64,
    /// End, in simulated seconds; `None` if it lasts to the end of the execution.
    pub end_s: Option<f64>,
    /// The agent, the lower index of two.
    pub agent: u32,
    /// The other party.
    pub other: Other,
}

/// The contacts of an execution.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Contacts {
    /// Number of contacts between agents.
    pub agent_agent: u64,
    /// Number of contacts of agents with standing or moving obstacles.
    pub agent_obstacle: u64,
    /// The first contacts in the order of their beginnings, at most
    /// [`SimConfig::max_contacts_kept`](crate::SimConfig::max_contacts_kept).
    pub first: Vec<Contact>,
}

impl Contacts {
    /// Number of contacts of either kind.
    pub fn total(&self) -> u64 {
        self.agent_agent + self.agent_obstacle
    }
}

/// An event as engines report it: in any order, with its time in substeps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Change {
    when: f64,
    kind: EventKind,
    agent: u32,
    other: Other,
}

impl Change {
    pub(crate) fn new(when: f64, kind: EventKind, agent: u32, other: Other) -> Self {
        Self {
            when,
            kind,
            agent,
            other,
        }
    }

    fn substep(&self) -> u64 {
        self.when as u64
    }

    fn order(&self, other: &Self) -> Ordering {
        let key = |change: &Self| (change.substep(), change.agent, change.other.key());
        key(self)
            .cmp(&key(other))
            .then(self.when.total_cmp(&other.when))
            .then(self.kind.cmp(&other.kind))
    }
}

/// Sorts changes into events and keeps the list of contacts.
#[derive(Debug)]
pub(crate) struct Log {
    /// Changes that later ones can still precede.
    pub(crate) pending: Vec<Change>,
    pub(crate) contacts: Contacts,
    substeps_per_s: f64,
    keep: usize,
    /// Indices of the kept contacts that have not ended.
    open: BTreeMap<(u32, (u8, u32)), usize>,
}

impl Log {
    pub(crate) fn new(substeps_per_s: f64, keep: usize) -> Self {
        Self {
            pending: Vec::new(),
            contacts: Contacts::default(),
            substeps_per_s,
            keep,
            open: BTreeMap::new(),
        }
    }

    /// Memory of the log in bytes.
    pub(crate) fn memory_bytes(&self) -> usize {
        self.pending.capacity() * size_of::<Change>()
            + self.contacts.first.capacity() * size_of::<Contact>()
            + self.open.len() * size_of::<((u32, (u8, u32)), usize)>()
    }

    /// Drops the pending changes.
    pub(crate) fn forget(&mut self) {
        self.pending.clear();
    }

    /// The first contact in order, pending or settled.
    pub(crate) fn first_contact(&self) -> Option<(u32, Other)> {
        let kept = self.contacts.first.first();
        kept.map(|contact| (contact.agent, contact.other))
            .or_else(|| {
                let begins = |change: &&Change| change.kind == EventKind::Begin;
                let first = self
                    .pending
                    .iter()
                    .filter(begins)
                    .min_by(|a, b| a.order(b))?;
                Some((first.agent, first.other))
            })
    }

    /// Moves to `settled`, in order, the events that no later one can precede: those of
    /// substeps that end by `now`.
    pub(crate) fn settle(&mut self, now: f64, settled: &mut Vec<Event>) {
        settled.clear();
        if self.pending.is_empty() {
            return;
        }
        self.pending.sort_unstable_by(Change::order);
        let over = self
            .pending
            .partition_point(|change| (change.substep() + 1) as f64 <= now);
        for change in self.pending.drain(..over) {
            let event = Event {
                substep: change.substep(),
                time_s: change.when / self.substeps_per_s,
                kind: change.kind,
                agent: change.agent,
                other: change.other,
            };
            settled.push(event);
            let key = (event.agent, event.other.key());
            match event.kind {
                EventKind::Begin => {
                    match event.other {
                        Other::Agent(_) => self.contacts.agent_agent += 1,
                        _ => self.contacts.agent_obstacle += 1,
                    }
                    if self.contacts.first.len() < self.keep {
                        self.open.insert(key, self.contacts.first.len());
                        self.contacts.first.push(Contact {
                            begin_s: event.time_s,
                            end_s: None,
                            agent: event.agent,
                            other: event.other,
                        });
                    }
                }
                EventKind::End => {
                    if let Some(at) = self.open.remove(&key) {
                        self.contacts.first[at].end_s = Some(event.time_s);
                    }
                }
                EventKind::Arrive => {}
            }
        }
    }
}
