//! The work of a fleet, as a replay page has it: goals, calls and faults.

use std::collections::BTreeMap;

use fleetyard_sim::trace::{By, Entry, Errand, Happening, Remark};
use serde::Serialize;

/// The most notices that a page has.
const MAX_NOTICES: usize = 10_000;

/// Totals of the entries of a journal and of remarks. Times are ticks.
#[derive(Debug, Default)]
pub(crate) struct Work {
    /// Per agent that is shown, by its place among them.
    goals: Vec<Vec<GoalMeta>>,
    /// Ticks at which goals were reached, those of agents that are not shown too.
    reached: Vec<u64>,
    calls: BTreeMap<u64, CallMeta>,
    notices: BTreeMap<u64, NoticeMeta>,
    notices_total: u64,
}

/// Begin, end if it was reached, cell, number, and place in a task, which is missing where there
/// are no tasks.
#[derive(Debug, Clone, Serialize)]
struct GoalMeta(u64, Option<u64>, u32, u32, Option<(u64, u32, u32)>);

/// Ticks of the call and of its answer, if there was one; author of the answer; milliseconds of
/// planner and fail policy.
#[derive(Debug, Default, Clone, Serialize)]
struct CallMeta(u64, Option<u64>, Option<By>, Option<f64>, Option<f64>);

/// The call, what it is, who is to blame, and what is said of it.
#[derive(Debug, Clone, Serialize)]
struct NoticeMeta(u64, String, String, String);

/// The same for the page.
#[derive(Debug, Serialize)]
pub(crate) struct WorkMeta<'a> {
    tick_s: f64,
    cols: u32,
    goals: &'a [Vec<GoalMeta>],
    /// Each as ticks since the one before.
    reached: Vec<u64>,
    /// By number.
    calls: Vec<(&'a u64, &'a CallMeta)>,
    notices: Vec<&'a NoticeMeta>,
}

impl Work {
    /// Takes entries; `ids` are the agents that are shown, ascending.
    pub(crate) fn journal(&mut self, ids: &[u32], entries: &[Entry]) {
        self.goals.resize(ids.len(), Vec::new());
        for Entry { tick, what } in entries {
            let own = |agent: &u32| ids.binary_search(agent).ok();
            match what {
                Happening::Goal(goal) => {
                    if let Some(at) = own(&goal.agent) {
                        let errand = goal.errand.map(|Errand { task, at, of }| (task, at, of));
                        let goal = GoalMeta(*tick, None, goal.cell, goal.number, errand);
                        self.goals[at].push(goal);
                    }
                }
                Happening::Reached { agent, .. } => {
                    self.reached.push(*tick);
                    if let Some(goal) = own(agent).and_then(|at| self.goals[at].last_mut()) {
                        goal.1 = Some(*tick);
                    }
                }
                Happening::Asked { call } => {
                    self.calls
                        .insert(*call, CallMeta(*tick, None, None, None, None));
                }
                Happening::Answered { call, by } => {
                    if let Some(call) = self.calls.get_mut(call) {
                        (call.1, call.2) = (Some(*tick), Some(*by));
                    }
                }
                Happening::Notice {
                    number,
                    call,
                    name,
                    module,
                } => {
                    self.notices_total += 1;
                    if self.notices.len() < MAX_NOTICES {
                        let (name, module) = (name.clone(), module.clone());
                        let notice = NoticeMeta(*call, name, module, String::new());
                        self.notices.insert(*number, notice);
                    }
                }
            }
        }
    }

    pub(crate) fn remarks(&mut self, remarks: &[Remark]) {
        let rounded = |time_ms: f64| (time_ms * 100.0).round() / 100.0;
        for remark in remarks {
            match remark {
                Remark::Took {
                    call,
                    planner_ms,
                    fail_policy_ms,
                } => {
                    if let Some(call) = self.calls.get_mut(call) {
                        call.3 = planner_ms.map(rounded);
                        call.4 = fail_policy_ms.map(rounded);
                    }
                }
                Remark::Said { number, message } => {
                    if let Some(notice) = self.notices.get_mut(number) {
                        notice.3.clone_from(message);
                    }
                }
            }
        }
    }

    /// Nothing if no entry came. `cols` is the width of the map.
    pub(crate) fn meta(&self, tick_s: f64, cols: u32) -> Option<WorkMeta<'_>> {
        if self.goals.is_empty() && self.calls.is_empty() {
            return None;
        }
        let before = std::iter::once(&0).chain(&self.reached);
        Some(WorkMeta {
            tick_s,
            cols,
            goals: &self.goals,
            reached: self
                .reached
                .iter()
                .zip(before)
                .map(|(tick, before)| tick.saturating_sub(*before))
                .collect(),
            calls: self.calls.iter().collect(),
            notices: self.notices.values().collect(),
        })
    }

    /// A remark for the reader about what was left out.
    pub(crate) fn note(&self) -> Option<String> {
        let listed = self.notices.len() as u64;
        (listed < self.notices_total).then(|| {
            format!(
                "The first {listed} of {} notices are told.",
                self.notices_total
            )
        })
    }
}
