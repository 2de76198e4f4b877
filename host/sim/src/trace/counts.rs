//! Numbers of events in a trace.

use std::collections::{BTreeMap, BTreeSet};
use std::io;

use serde::Serialize;

use super::{By, Entry, Happening, TraceSink};
use crate::event::{Event, EventKind, Other};

/// A sink that counts events.
#[derive(Debug, Default, Serialize)]
pub struct Counts {
    /// Contacts between agents.
    pub contacts_agent_agent: u64,
    /// Contacts of agents with obstacles that stand.
    pub contacts_agent_obstacle: u64,
    /// Contacts of agents with obstacles that move.
    pub contacts_agent_mover: u64,
    /// Arrivals at goals.
    pub arrivals: u64,
    /// The first contacts to begin, at most [`Counts::FIRST`].
    pub first: Vec<Event>,
    /// Events of a fleet; all zero where there is none.
    pub fleet: FleetCounts,
}

/// Numbers of events of a fleet.
#[derive(Debug, Default, Serialize)]
pub struct FleetCounts {
    /// Goals that robots were given.
    pub goals: u64,
    /// Goals that robots reached.
    pub goals_reached: u64,
    /// Tasks whose last goal was reached.
    pub tasks_done: u64,
    /// Calls of the planner.
    pub calls: u64,
    /// Answers of the planner.
    pub answered_by_planner: u64,
    /// Answers of the fail policy.
    pub answered_by_fail_policy: u64,
    /// Calls after which all robots waited.
    pub answered_by_nobody: u64,
    /// Notices by name.
    pub notices: BTreeMap<String, u64>,
    /// Robots on the way to the last goal of a task.
    #[serde(skip)]
    last_of_task: BTreeSet<u32>,
}

impl Counts {
    /// Most contacts in [`Counts::first`].
    pub const FIRST: usize = 10;
}

impl FleetCounts {
    fn count(&mut self, what: &Happening) {
        *match what {
            Happening::Goal(goal) => {
                if goal.errand.is_some_and(|errand| errand.at + 1 == errand.of) {
                    self.last_of_task.insert(goal.agent);
                }
                &mut self.goals
            }
            Happening::Reached { agent, .. } => {
                self.tasks_done += u64::from(self.last_of_task.remove(agent));
                &mut self.goals_reached
            }
            Happening::Asked { .. } => &mut self.calls,
            Happening::Answered { by, .. } => match by {
                By::Planner => &mut self.answered_by_planner,
                By::FailPolicy => &mut self.answered_by_fail_policy,
                By::Nobody => &mut self.answered_by_nobody,
            },
            Happening::Notice { name, .. } => self.notices.entry(name.clone()).or_default(),
        } += 1;
    }
}

impl TraceSink for Counts {
    fn events(&mut self, events: &[Event]) -> io::Result<()> {
        for event in events {
            match (event.kind, event.other) {
                (EventKind::Arrive, _) => self.arrivals += 1,
                (EventKind::End, _) => {}
                (EventKind::Begin, other) => {
                    *match other {
                        Other::Agent(_) => &mut self.contacts_agent_agent,
                        Other::Mover(_) => &mut self.contacts_agent_mover,
                        _ => &mut self.contacts_agent_obstacle,
                    } += 1;
                    if self.first.len() < Self::FIRST {
                        self.first.push(*event);
                    }
                }
            }
        }
        Ok(())
    }

    fn journal(&mut self, entries: &[Entry]) -> io::Result<()> {
        for entry in entries {
            self.fleet.count(&entry.what);
        }
        Ok(())
    }
}
