//! Results of a run.

use std::collections::BTreeMap;

use fleetyard_core::{Digest, words};
use fleetyard_runtime::Work;
use fleetyard_sim::Figures;
use serde::{Deserialize, Serialize};

use crate::closures::Closure;
use crate::{FleetConfig, ModuleInfo};

/// The end of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Ended {
    /// Its time was over.
    Duration,
    /// It was told to end.
    Interrupted,
}

/// A point of the series: figures of a moment.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum EventKind {
    /// The planner overran, crashed, broke the protocol or reported an error.
    PlannerFault,
    /// The planner ended without a plan that can be used, and said so.
    PlannerGaveUp,
    /// The planner claimed success with a plan that breaks a rule.
    InvalidBatch,
    /// The instance generator failed.
    GeneratorFault,
    /// The instance generator asked for what may not be asked for.
    InvalidInstance,
    /// The fail policy failed.
    FailPolicyFault,
    /// The fail policy's plan breaks a rule.
    InvalidRecovery,
    /// Nobody had a plan: everybody waits at the end of what was committed.
    AllWait,
    /// The invocation policy failed; the host called.
    InvocationFault,
    /// Nobody had anything left to do and the invocation policy did not call: the host did.
    Watchdog,
    /// A plugin that had died was started again.
    Restarted,
    /// A plugin that had died did not start again.
    NotRestarted,
    /// Robots that would have moved round in a ring were held before it.
    RingsCut,
    /// Cells closed or opened: the planner is called.
    MapChanged,
    /// A planner that was started anew for a run that goes on answers otherwise than it did
    /// when the run was recorded.
    ResumedOtherwise,
}

words!(EventKind {
    PlannerFault = "planner-fault";
    PlannerGaveUp = "planner-gave-up";
    InvalidBatch = "invalid-batch";
    GeneratorFault = "generator-fault";
    InvalidInstance = "invalid-instance";
    FailPolicyFault = "fail-policy-fault";
    InvalidRecovery = "invalid-recovery";
    AllWait = "all-wait";
    InvocationFault = "invocation-fault";
    Watchdog = "watchdog";
    Restarted = "restarted";
    NotRestarted = "not-restarted";
    RingsCut = "rings-cut";
    MapChanged = "map-changed";
    ResumedOtherwise = "resumed-otherwise";
});

/// Something that went otherwise than it should.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FleetEvent {
    /// Simulated time: when the answer took effect, or the host decided.
    pub time_s: f64,
    /// The kind.
    pub kind: EventKind,
    /// The culprit: the identifier of a plugin, or `host`.
    pub module: String,
    /// For people.
    pub message: String,
}

/// A point of the series. Goals and calls are counted from the start of the run.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Point {
    /// Simulated time.
    pub time_s: f64,
    /// Goals that were reached.
    pub goals_reached: u64,
    /// Robots that stand still.
    pub waiting: u32,
    /// Actions in the graph that are not done.
    pub adg_nodes: usize,
    /// Calls that were answered.
    pub planner_calls: u64,
    /// Those of them that the fail policy was asked about.
    pub fail_calls: u64,
}

/// Times of calls in milliseconds of the wall clock.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct CallTimes {
    /// Mean.
    pub mean: f64,
    /// Median.
    pub p50: f64,
    /// Of 95 % at most so much.
    pub p95: f64,
    /// Longest.
    pub max: f64,
}

impl CallTimes {
    /// Of times in any order; zeros if there are none. Percentiles are of the nearest rank.
    pub fn of(mut times_ms: Vec<f64>) -> Self {
        let count = times_ms.len();
        if count == 0 {
            return Self::default();
        }
        times_ms.sort_unstable_by(f64::total_cmp);
        let rank = |share: f64| times_ms[((share * count as f64).ceil() as usize).max(1) - 1];
        Self {
            mean: times_ms.iter().sum::<f64>() / count as f64,
            p50: rank(0.5),
            p95: rank(0.95),
            max: rank(1.0),
        }
    }
}

/// Calls of the planner that took longer than its limit: the fail policy answered, or an earlier plan of
/// the same call.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Late {
    /// The number of calls.
    pub calls: u64,
    /// Wall-clock times of these calls in milliseconds; of one that was killed the time until then.
    pub time_ms: CallTimes,
    /// A limit, in seconds, that would have sufficed for 95 % of them.
    pub limit_s: f64,
}

impl Late {
    /// Of the wall-clock times of all calls; `None` if none was late.
    pub fn of(times_ms: &[f64], limit_s: f64) -> Option<Self> {
        let late = times_ms.iter().copied();
        let late: Vec<f64> = late.filter(|ms| *ms > limit_s * 1e3).collect();
        let calls = late.len() as u64;
        let time_ms = CallTimes::of(late);
        (calls > 0).then(|| Self {
            calls,
            time_ms,
            limit_s: round_up(time_ms.p95 / 1e3),
        })
    }
}

/// The next of 1, 1.5, 2, 3, 5, 7 and 10 times a power of ten.
fn round_up(value: f64) -> f64 {
    let power = 10.0_f64.powf(value.log10().floor());
    let steps = [1.0, 1.5, 2.0, 3.0, 5.0, 7.0];
    let next = steps.into_iter().find(|step| step * power >= value);
    next.unwrap_or(10.0) * power
}

/// Figures of a run by synchronous rules, as the League of Robot Runners has them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct StepMetrics {
    /// Steps that were done.
    pub steps: u64,
    /// Tasks done per step, where there are tasks.
    pub tasks_per_step: Option<f64>,
    /// Goals reached per step; of tasks these are their errands.
    pub goals_per_step: f64,
    /// Calls without a plan of the planner that was in time and might be driven.
    pub unplanned: u64,
}

/// A fall of throughput in the course of a run that is not chance: robots stand in each other's way.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Decay {
    /// Goals per simulated second in the best fifth of the run, the last one left out.
    pub best_per_s: f64,
    /// Goals per simulated second in the last fifth.
    pub last_per_s: f64,
    /// Share of robots and moments standing still in the last fifth.
    pub still_share: f64,
}

/// True if two numbers of goals differ by more than chance: by more than four standard deviations, of
/// numbers that are a Poisson process's.
pub fn differ(goals: f64, others: f64) -> bool {
    const DEVIATIONS: f64 = 4.0;
    (goals - others).abs() >= DEVIATIONS * (goals + others).sqrt()
}

impl Decay {
    /// Least time of a run, in seconds; those before it begin from places without any crowd.
    const LEAST_S: f64 = 300.0;
    /// Parts that a run is compared by.
    const PARTS: usize = 5;
    /// No decay: the last part has so much of the best.
    const KEPT: f64 = 0.8;

    /// Of a series; none of a short one, or where throughput holds.
    pub fn of(series: &[Point], agents: u32) -> Option<Self> {
        let end_s = series.last()?.time_s;
        if end_s < Self::LEAST_S {
            return None;
        }
        let until = |part: usize| {
            let time_s = end_s * part as f64 / Self::PARTS as f64;
            series.partition_point(|point| point.time_s <= time_s)
        };
        let goals = |part: usize| {
            let count = |at: usize| at.checked_sub(1).map_or(0, |at| series[at].goals_reached);
            count(until(part)).saturating_sub(count(until(part - 1))) as f64
        };
        let best = (1..Self::PARTS).map(goals).fold(0.0, f64::max);
        let last = goals(Self::PARTS);
        if last > Self::KEPT * best || !differ(best, last) {
            return None;
        }
        let points = &series[until(Self::PARTS - 1)..];
        let still: u64 = points.iter().map(|point| u64::from(point.waiting)).sum();
        let part_s = end_s / Self::PARTS as f64;
        Some(Self {
            best_per_s: best / part_s,
            last_per_s: last / part_s,
            still_share: still as f64 / (points.len() as f64 * f64::from(agents)).max(1.0),
        })
    }
}

impl FleetMetrics {
    /// Processor time of the planner's calls and between them, as far as it is known.
    pub fn planner_work(&self) -> Work {
        let us = |ms: f64| (ms * 1e3) as u64;
        let calls = self.planner_cpu_ms.as_ref();
        Work {
            calls_us: calls.map_or(0, |times| us(times.mean * self.planner_calls as f64)),
            between_us: us(self.planner_cpu_between_calls_ms.unwrap_or(0.0)),
        }
    }
}

/// The figures that runs are compared by.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FleetMetrics {
    /// Goals reached per simulated second.
    pub throughput_per_s: f64,
    /// Goals that robots reached.
    pub goals_reached: u64,
    /// Goals on the ways to which robots are committed, reached or not: what LSMART counts.
    pub goals_committed: u64,
    /// Calls in which the fail policy was asked, as a share of all calls.
    pub fail_policy_ratio: f64,
    /// Calls that were answered.
    pub planner_calls: u64,
    /// Calls in which the fail policy was asked.
    pub fail_calls: u64,
    /// Calls after which everybody waited.
    pub all_waits: u64,
    /// Wall-clock times of the planner's calls.
    pub planner_time_ms: CallTimes,
    /// The planner's calls that took longer than its limit, if there are some.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub late: Option<Late>,
    /// Processor times of the planner's calls, where they are known of all.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub planner_cpu_ms: Option<CallTimes>,
    /// Processor time of the planner between its calls, where it is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub planner_cpu_between_calls_ms: Option<f64>,
    /// Wall-clock times of the fail policy's calls.
    pub fail_policy_time_ms: CallTimes,
    /// Share of robots and time spent standing still, be it to wait or at a goal.
    pub waiting_share: f64,
    /// Mean over calls of the robots that the planner says it holds back, since the map has no way for
    /// more of them at a time. A claim; absent if there are none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub held_back: Option<f64>,
    /// The fall of throughput, if there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub decay: Option<Decay>,
    /// Most actions that were in the graph at a time.
    pub adg_nodes_max: usize,
    /// Plans that were claimed to be right and refused.
    pub invalid_batches: u64,
    /// Rings that were cut out of plans.
    pub rings_cut: u64,
    /// The number of times that a plugin was started again.
    pub restarts: u64,
    /// Tasks of which every goal was reached, where there are tasks.
    pub tasks_done: Option<u64>,
    /// Figures per step, by synchronous rules.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub synchronous: Option<StepMetrics>,
    /// The number of events of each kind, also of those that are not listed.
    pub event_counts: BTreeMap<EventKind, u64>,
}

/// The simulator's figures.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FleetExecution {
    /// The figures of every execution.
    #[serde(flatten)]
    pub figures: Figures,
    /// Wall-clock seconds from the first block to the last one, without the start of
    /// plugins.
    pub wall_s: f64,
}

/// All there is to say of a run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FleetOutcome {
    /// Version of this program.
    pub fleetyard: &'static str,
    /// Name of the map.
    pub map: String,
    /// Digest of the map.
    pub map_digest: Digest,
    /// Digest of the guidance graph, if there was one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub guidance_digest: Option<Digest>,
    /// The plugins.
    pub modules: Vec<ModuleInfo>,
    /// The configuration.
    pub config: FleetConfig,
    /// The end.
    pub ended: Ended,
    /// The figures that runs are compared by.
    pub metrics: FleetMetrics,
    /// The simulator's figures.
    pub execution: FleetExecution,
    /// The run over time, its end included.
    pub series: Vec<Point>,
    /// Things that went otherwise than they should, in order; at most [`FleetOutcome::EVENTS`].
    pub events: Vec<FleetEvent>,
    /// Cells that closed, in order.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub closures: Vec<Closure>,
    /// Per cell, row by row, for how many seconds robots stood still there.
    pub waiting_s_per_cell: Vec<f64>,
    /// Per cell and move, in the order of the letters `NESW`, how often robots did it. Files have none
    /// of it.
    #[serde(skip)]
    pub moves: Vec<u32>,
}

impl FleetOutcome {
    /// Most events that are listed; all are counted.
    pub const EVENTS: usize = 1000;
}
