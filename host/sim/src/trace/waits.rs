//! Waits of agents for each other, in traces of executions by order.
//!
//! They follow from the plan and the execution, and do not enter the trace digest.

use std::collections::BTreeMap;

use serde::Serialize;
use serde_json::Value;

use super::journal::{Limits, Row};
use super::{Fields, put_number};

/// The reason why an agent stands at the end of its released actions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Awaited {
    /// It does not wait.
    Nothing,
    /// The others are where they should be; the message that says so is under way.
    Message,
    /// Another agent has to go on first.
    Agent(u32),
}

impl Awaited {
    /// The number of the agent, `"message"`, or null for nothing.
    pub fn brief(self) -> Value {
        match self {
            Self::Nothing => Value::Null,
            Self::Message => "message".into(),
            Self::Agent(other) => other.into(),
        }
    }
}

/// A change of what an agent waits for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Waiting {
    /// The tick since which it is so.
    pub tick: u64,
    /// The agent.
    pub agent: u32,
    /// The reason of its wait.
    #[serde(rename = "for")]
    pub awaited: Awaited,
}

/// Waits of agents, as far as they were recorded.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct WaitLog(Vec<Awaited>);

impl WaitLog {
    /// Records what so many agents wait for since a tick. Returns what is not as it was before.
    pub fn changes(
        &mut self,
        tick: u64,
        agents: usize,
        awaited: impl Fn(usize) -> Awaited,
    ) -> Vec<Waiting> {
        self.0.resize(agents, Awaited::Nothing);
        let all = self.0.iter_mut().enumerate();
        let changes = all.filter_map(|(agent, known)| {
            let awaited = awaited(agent);
            (std::mem::replace(known, awaited) != awaited).then_some(Waiting {
                tick,
                agent: agent as u32,
                awaited,
            })
        });
        changes.collect()
    }
}

/// The agents that wait at a moment, ascending.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Waits(BTreeMap<u32, Waiting>);

impl Waits {
    /// Updates the waits with the next change.
    pub fn note(&mut self, change: &Waiting) {
        match change.awaited {
            Awaited::Nothing => self.0.remove(&change.agent),
            _ => self.0.insert(change.agent, *change),
        };
    }

    /// The waits in the order of their agents, each with the tick since which it is so.
    pub fn iter(&self) -> impl Iterator<Item = &Waiting> {
        self.0.values()
    }

    /// The waits in the order of their ticks.
    pub(super) fn recap(&self) -> Vec<Waiting> {
        let mut waits: Vec<Waiting> = self.0.values().copied().collect();
        waits.sort_by_key(|wait| wait.tick);
        waits
    }
}

impl Row for Waiting {
    fn fits(&self, limits: Limits) -> bool {
        let known = |agent: u32| agent < limits.agents;
        known(self.agent)
            && match self.awaited {
                Awaited::Agent(other) => known(other) && other != self.agent,
                Awaited::Nothing | Awaited::Message => true,
            }
    }

    fn tick(&self) -> u64 {
        self.tick
    }

    fn put(&self, out: &mut Vec<u8>, last: &mut u64) {
        put_number(out, self.tick - *last);
        *last = self.tick;
        put_number(out, self.agent.into());
        put_number(
            out,
            match self.awaited {
                Awaited::Nothing => 0,
                Awaited::Message => 1,
                Awaited::Agent(other) => u64::from(other) + 2,
            },
        );
    }

    fn take(fields: &mut Fields<'_>, last: &mut u64) -> Option<Self> {
        let tick = last.checked_add(fields.number()?)?;
        *last = tick;
        Some(Self {
            tick,
            agent: fields.number32()?,
            awaited: match fields.number()? {
                0 => Awaited::Nothing,
                1 => Awaited::Message,
                other => Awaited::Agent(u32::try_from(other - 2).ok()?),
            },
        })
    }
}
