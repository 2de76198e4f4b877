//! Contact events: what begins and ends to touch, when, and in which order it
//! is told.

use std::cmp::Ordering;
use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// Whether a contact begins or ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum EventKind {
    /// Two things begin to overlap.
    Begin,
    /// They no longer overlap.
    End,
    /// An agent is at the end of its route, for good.
    Arrive,
}

/// What an agent is in contact with.
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
    /// Key that puts agents in order, then obstacles, then the goal.
    fn key(self) -> (u8, u32) {
        match self {
            Self::Agent(agent) => (0, agent),
            // Whichever cell it is, there is one such contact at a time.
            Self::Obstacle { .. } => (1, 0),
            Self::Polygon(index) => (2, index),
            Self::Mover(index) => (3, index),
            Self::Goal => (4, 0),
        }
    }
}

/// Something begins or ends to touch, or an agent arrives. Events are told in the
/// order of substep, then agent, then the other one (agents, cells, polygons,
/// moving obstacles, the goal), then time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Event {
    /// The substep that it happens in, counted from 0.
    pub substep: u64,
    /// Simulated time in seconds.
    pub time_s: f64,
    /// What happens.
    pub kind: EventKind,
    /// The agent, the lower index of two.
    pub agent: u32,
    /// What it touches.
    pub other: Other,
}

/// A contact from beginning to end.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Contact {
    /// When it begins, in simulated seconds.
    pub begin_s: f64,
    /// When it ends; `None` if it lasts to the end of the execution.
    pub end_s: Option<f64>,
    /// The agent, the lower index of two.
    pub agent: u32,
    /// What it touches.
    pub other: Other,
}

/// The contacts of an execution.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Contacts {
    /// How many contacts between agents began.
    pub agent_agent: u64,
    /// How many contacts of agents with obstacles began, standing or moving.
    pub agent_obstacle: u64,
    /// The first of them in the order of their beginnings, at most
    /// [`SimConfig::max_contacts_kept`](crate::SimConfig::max_contacts_kept).
    pub first: Vec<Contact>,
}

impl Contacts {
    /// How many contacts of either kind began.
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

/// Brings changes into order and keeps the account of contacts.
#[derive(Debug)]
pub(crate) struct Log {
    /// Changes that may still be preceded by others.
    pub(crate) pending: Vec<Change>,
    pub(crate) contacts: Contacts,
    substeps_per_s: f64,
    keep: usize,
    /// Kept contacts that have not ended.
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

    /// What the log takes in memory, in bytes.
    pub(crate) fn memory_bytes(&self) -> usize {
        self.pending.capacity() * size_of::<Change>()
            + self.contacts.first.capacity() * size_of::<Contact>()
            + self.open.len() * size_of::<((u32, (u8, u32)), usize)>()
    }

    /// Forgets what is pending.
    pub(crate) fn forget(&mut self) {
        self.pending.clear();
    }

    /// The first contact in order that is pending or known.
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

    /// Hands out, in order, the events that nothing can precede any more: those
    /// of substeps that are over when `now` is reached.
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
