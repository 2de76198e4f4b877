//! Events of a fleet beside driving, in traces: goals, tasks and calls.
//!
//! The *journal* holds events in simulated time: it is the same whenever a run is
//! repeated. *Remarks* hold wall-clock times and messages of plugins, and differ from run
//! to run. Neither enters the trace digest, which identifies the motion of bodies.

use serde::{Deserialize, Serialize};

use super::{Fields, Header, NO_VALUE, put_number};

/// An event of a fleet.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Entry {
    /// Tick of the event.
    pub tick: u64,
    /// The event.
    #[serde(flatten)]
    pub what: Happening,
}

/// Kinds of events of a fleet.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Happening {
    /// A robot gets a new goal.
    Goal(Goal),
    /// A robot has reached its goal.
    Reached {
        /// The robot.
        agent: u32,
        /// The number of the goal among those of the robot, from 0.
        number: u32,
    },
    /// A call starts: planning begins.
    Asked {
        /// The number of the call, from 0.
        call: u64,
    },
    /// The answer to a call took effect.
    Answered {
        /// The number of the call.
        call: u64,
        /// Source of the plan that robots drive.
        by: By,
    },
    /// A fault; reported with the answer to the call.
    Notice {
        /// The number of the notice, from 0.
        number: u64,
        /// The number of the call.
        call: u64,
        /// Kind of the notice; at most [`Happening::MOST_NAME`] bytes.
        name: String,
        /// Faulty module: the identifier of a plugin, or `host`; at most
        /// [`Happening::MOST_NAME`] bytes.
        module: String,
    },
}

impl Happening {
    /// The longest name of a notice or a plugin, in bytes.
    pub const MOST_NAME: usize = 255;
}

/// A goal of a robot.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Goal {
    /// The robot.
    pub agent: u32,
    /// The number of the goal among those of the robot, from 0.
    pub number: u32,
    /// The cell of the map: row from the top times columns, plus column.
    pub cell: u32,
    /// The task of the goal, if there are tasks.
    #[serde(flatten)]
    pub errand: Option<Errand>,
}

/// A goal's place in a task.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Errand {
    /// The number of the task.
    pub task: u64,
    /// Index of the goal in the task, from 0.
    pub at: u32,
    /// Number of goals of the task.
    pub of: u32,
}

/// Source of the plan that robots drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum By {
    /// The planner's.
    Planner,
    /// The fail policy's.
    FailPolicy,
    /// No plan: all robots wait.
    Nobody,
}

/// Data of a run that may differ when it is repeated.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Remark {
    /// Duration of a call.
    Took {
        /// The number of the call.
        call: u64,
        /// Wall-clock time of the planner in milliseconds, if it was called.
        planner_ms: Option<f64>,
        /// Wall-clock time of the fail policy in milliseconds, if it was called.
        fail_policy_ms: Option<f64>,
    },
    /// Text of a notice.
    Said {
        /// The number of the notice.
        number: u64,
        /// Message to the user; at most [`Remark::MOST_TEXT`] bytes.
        message: String,
    },
}

impl Remark {
    /// The longest text of a remark, in bytes.
    pub const MOST_TEXT: usize = 4096;
}

/// Open entries of a journal: the goal of every robot, and the call under way.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Standing {
    goals: Vec<Option<(u64, Goal)>>,
    call: Option<(u64, u64)>,
}

impl Standing {
    /// No goals and no call, for this number of robots.
    pub fn new(agents: u32) -> Self {
        Self {
            goals: vec![None; agents as usize],
            call: None,
        }
    }

    /// Updates the open entries with the next one.
    pub fn note(&mut self, entry: &Entry) {
        let tick = entry.tick;
        match &entry.what {
            Happening::Goal(goal) => {
                if let Some(open) = self.goals.get_mut(goal.agent as usize) {
                    *open = Some((tick, *goal));
                }
            }
            Happening::Reached { agent, .. } => {
                if let Some(open) = self.goals.get_mut(*agent as usize) {
                    *open = None;
                }
            }
            Happening::Asked { call } => self.call = Some((tick, *call)),
            Happening::Answered { .. } => self.call = None,
            Happening::Notice { .. } => {}
        }
    }

    /// The goal of a robot.
    pub fn goal(&self, agent: u32) -> Option<Goal> {
        let open = self.goals.get(agent as usize).copied().flatten();
        open.map(|(_, goal)| goal)
    }

    /// The open entries, in order.
    pub(super) fn recap(&self) -> Vec<Entry> {
        let goals = self.goals.iter().flatten().map(|(tick, goal)| Entry {
            tick: *tick,
            what: Happening::Goal(*goal),
        });
        let call = self.call.iter().map(|(tick, call)| Entry {
            tick: *tick,
            what: Happening::Asked { call: *call },
        });
        let mut entries: Vec<_> = goals.chain(call).collect();
        entries.sort_by_key(|entry| entry.tick);
        entries
    }
}

/// Most entries or remarks in a frame.
pub(super) const ROWS_PER_FRAME: usize = 4096;
/// Most bytes of them before compression.
pub(super) const ROWS_BYTES: usize = 1 << 16;

/// A row of a frame of the journal or of remarks.
pub(super) trait Row: Sized {
    /// True if its numbers and texts are valid in a trace.
    fn fits(&self, limits: Limits) -> bool;

    /// The tick of the row; rows come in the order of their ticks. 0 for rows without one.
    fn tick(&self) -> u64 {
        0
    }

    /// Appends the row, after a row of the tick `last`.
    fn put(&self, out: &mut Vec<u8>, last: &mut u64);

    /// Reads the next row, after a row of the tick `last`.
    fn take(fields: &mut Fields<'_>, last: &mut u64) -> Option<Self>;
}

/// Ranges of the numbers in rows.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Limits {
    pub(super) agents: u32,
    cells: u64,
}

impl Limits {
    pub(super) fn new(header: &Header) -> Self {
        let cells = header.scene.cells.as_ref();
        Self {
            agents: header.agents,
            cells: cells.map_or(0, |cells| u64::from(cells.rows()) * u64::from(cells.cols())),
        }
    }
}

impl Row for Entry {
    fn fits(&self, limits: Limits) -> bool {
        match &self.what {
            Happening::Goal(goal) => {
                goal.agent < limits.agents
                    && u64::from(goal.cell) < limits.cells
                    && goal.errand.is_none_or(|errand| errand.at < errand.of)
            }
            Happening::Reached { agent, .. } => *agent < limits.agents,
            Happening::Notice { name, module, .. } => {
                name.len().max(module.len()) <= Happening::MOST_NAME
            }
            Happening::Asked { .. } | Happening::Answered { .. } => true,
        }
    }

    fn tick(&self) -> u64 {
        self.tick
    }

    fn put(&self, out: &mut Vec<u8>, last: &mut u64) {
        put_number(out, self.tick - *last);
        *last = self.tick;
        match &self.what {
            Happening::Goal(goal) => {
                out.push(0);
                for number in [goal.agent, goal.number, goal.cell] {
                    put_number(out, number.into());
                }
                match goal.errand {
                    None => put_number(out, 0),
                    Some(Errand { task, at, of }) => {
                        put_number(out, of.into());
                        put_number(out, at.into());
                        put_number(out, task);
                    }
                }
            }
            Happening::Reached { agent, number } => {
                out.push(1);
                put_number(out, (*agent).into());
                put_number(out, (*number).into());
            }
            Happening::Asked { call } => {
                out.push(2);
                put_number(out, *call);
            }
            Happening::Answered { call, by } => {
                out.push(3);
                put_number(out, *call);
                out.push(match by {
                    By::Planner => 0,
                    By::FailPolicy => 1,
                    By::Nobody => 2,
                });
            }
            Happening::Notice {
                number,
                call,
                name,
                module,
            } => {
                out.push(4);
                put_number(out, *number);
                put_number(out, *call);
                put_text(out, name);
                put_text(out, module);
            }
        }
    }

    fn take(fields: &mut Fields<'_>, last: &mut u64) -> Option<Self> {
        let tick = last.checked_add(fields.number()?)?;
        *last = tick;
        let what = match fields.u8()? {
            0 => Happening::Goal(Goal {
                agent: fields.number32()?,
                number: fields.number32()?,
                cell: fields.number32()?,
                errand: match fields.number32()? {
                    0 => None,
                    of => Some(Errand {
                        of,
                        at: fields.number32()?,
                        task: fields.number()?,
                    }),
                },
            }),
            1 => Happening::Reached {
                agent: fields.number32()?,
                number: fields.number32()?,
            },
            2 => Happening::Asked {
                call: fields.number()?,
            },
            3 => Happening::Answered {
                call: fields.number()?,
                by: match fields.u8()? {
                    0 => By::Planner,
                    1 => By::FailPolicy,
                    2 => By::Nobody,
                    _ => return None,
                },
            },
            4 => Happening::Notice {
                number: fields.number()?,
                call: fields.number()?,
                name: take_text(fields)?,
                module: take_text(fields)?,
            },
            _ => return None,
        };
        Some(Self { tick, what })
    }
}

impl Row for Remark {
    fn fits(&self, _: Limits) -> bool {
        match self {
            Self::Took {
                planner_ms,
                fail_policy_ms,
                ..
            } => [planner_ms, fail_policy_ms]
                .into_iter()
                .flatten()
                .all(|time_ms| time_ms.is_finite()),
            Self::Said { message, .. } => message.len() <= Self::MOST_TEXT,
        }
    }

    fn put(&self, out: &mut Vec<u8>, _: &mut u64) {
        match self {
            Self::Took {
                call,
                planner_ms,
                fail_policy_ms,
            } => {
                out.push(0);
                put_number(out, *call);
                for time_ms in [planner_ms, fail_policy_ms] {
                    let bits = time_ms.map_or(NO_VALUE, f64::to_bits);
                    out.extend(bits.to_le_bytes());
                }
            }
            Self::Said { number, message } => {
                out.push(1);
                put_number(out, *number);
                put_text(out, message);
            }
        }
    }

    fn take(fields: &mut Fields<'_>, _: &mut u64) -> Option<Self> {
        let time_ms = |fields: &mut Fields<'_>| {
            let time_ms = fields.f64()?;
            Some((!time_ms.is_nan()).then_some(time_ms))
        };
        Some(match fields.u8()? {
            0 => Self::Took {
                call: fields.number()?,
                planner_ms: time_ms(fields)?,
                fail_policy_ms: time_ms(fields)?,
            },
            1 => Self::Said {
                number: fields.number()?,
                message: take_text(fields)?,
            },
            _ => return None,
        })
    }
}

/// Divides rows into frames: number of rows and bytes of each. Ticks begin from 0 in each
/// frame, so that it can be read by itself.
pub(super) fn pack<T: Row>(rows: &[T]) -> Vec<(u32, Vec<u8>)> {
    let mut frames: Vec<(u32, Vec<u8>)> = Vec::new();
    let mut last = 0;
    for row in rows {
        if let Some((count, bytes)) = frames.last_mut() {
            let length = bytes.len();
            row.put(bytes, &mut last);
            if bytes.len() <= ROWS_BYTES && (*count as usize) < ROWS_PER_FRAME {
                *count += 1;
                continue;
            }
            bytes.truncate(length);
        }
        let mut bytes = Vec::new();
        last = 0;
        row.put(&mut bytes, &mut last);
        frames.push((1, bytes));
    }
    frames
}

/// The rows of a frame.
pub(super) fn unpack<T: Row>(count: usize, bytes: &[u8], limits: Limits) -> Option<Vec<T>> {
    let (mut fields, mut last) = (Fields(bytes), 0);
    let mut rows = Vec::new();
    for _ in 0..count {
        rows.push(T::take(&mut fields, &mut last).filter(|row| row.fits(limits))?);
    }
    fields.0.is_empty().then_some(rows)
}

fn put_text(out: &mut Vec<u8>, text: &str) {
    put_number(out, text.len() as u64);
    out.extend(text.as_bytes());
}

fn take_text(fields: &mut Fields<'_>) -> Option<String> {
    let length = fields.number32()? as usize;
    let (text, rest) = fields.0.split_at_checked(length)?;
    fields.0 = rest;
    Some(str::from_utf8(text).ok()?.to_owned())
}
