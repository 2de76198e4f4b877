//! The run in figures, while it goes on.

use std::collections::BTreeMap;

use fleetyard_core::Grid;

use crate::memory::number_of_move;
use crate::recording::{Notice, Round};
use crate::{
    By, CallTimes, Decay, EventKind, FleetConfig, FleetEvent, FleetMetrics, FleetOutcome, Late,
    Point, StepMetrics,
};

/// Everything that is counted.
#[derive(Debug)]
pub(crate) struct Tally {
    /// Ticks of a block, and in a second.
    ticks: f64,
    ticks_hz: f64,
    /// Blocks between two points of the series.
    every: u64,
    is_synchronous: bool,
    pub(crate) series: Vec<Point>,
    pub(crate) events: Vec<FleetEvent>,
    counts: BTreeMap<EventKind, u64>,
    pub(crate) goals_reached: u64,
    /// Robots that stood still in the last block, and blocks of all robots until then.
    waiting: u32,
    waited: u64,
    /// Blocks that robots stood still in a cell.
    waited_in: Vec<u64>,
    pub(crate) moves: Moves,
    calls: u64,
    fail_calls: u64,
    adg_nodes: usize,
    adg_nodes_max: usize,
    pub(crate) rings_cut: u64,
    limit_s: f64,
    planner_ms: Vec<f64>,
    planner_cpu_ms: Vec<f64>,
    /// Sum over calls, where it is known.
    planner_cpu_before_ms: Option<f64>,
    /// Sum over calls of the robots that the planner says it holds back.
    held_back: f64,
    recovery_ms: Vec<f64>,
    unplanned: u64,
}

/// Moves that robots did.
#[derive(Debug)]
pub(crate) struct Moves {
    /// By cell and direction.
    pub(crate) counts: Vec<u32>,
    /// Cells where robots were last known.
    at: Vec<u32>,
    /// Columns of the map.
    cols: u32,
}

impl Moves {
    /// A robot has done the move into a cell.
    pub(crate) fn done(&mut self, agent: usize, cell: u32) {
        let from = std::mem::replace(&mut self.at[agent], cell);
        if from != cell {
            self.counts[number_of_move(from, cell, self.cols)] += 1;
        }
    }
}

impl Tally {
    pub(crate) fn new(config: &FleetConfig, period_s: f64, grid: &Grid, starts: &[u32]) -> Self {
        let cells = grid.cell_count() as usize;
        Self {
            ticks: (period_s * f64::from(config.sim.ticks_hz)).round(),
            ticks_hz: f64::from(config.sim.ticks_hz),
            is_synchronous: config.is_synchronous(),
            every: (config.series_s / period_s).round().max(1.0) as u64,
            series: Vec::new(),
            events: Vec::new(),
            counts: BTreeMap::new(),
            goals_reached: 0,
            waiting: 0,
            waited: 0,
            waited_in: vec![0; cells],
            moves: Moves {
                counts: vec![0; 4 * cells],
                at: starts.to_vec(),
                cols: grid.cols(),
            },
            calls: 0,
            fail_calls: 0,
            adg_nodes: 0,
            adg_nodes_max: 0,
            rings_cut: 0,
            limit_s: config.limit_s,
            planner_ms: Vec::new(),
            planner_cpu_ms: Vec::new(),
            planner_cpu_before_ms: None,
            unplanned: 0,
            held_back: 0.0,
            recovery_ms: Vec::new(),
        }
    }

    /// Blocks in seconds.
    pub(crate) fn seconds(&self, blocks: u64) -> f64 {
        blocks as f64 * self.ticks / self.ticks_hz
    }

    /// An answer takes effect.
    pub(crate) fn round(&mut self, round: &Round) {
        self.calls += 1;
        self.planner_ms.extend(round.planner_ms);
        self.planner_cpu_ms.extend(round.planner_cpu_ms);
        if let Some(before_ms) = round.planner_cpu_before_ms {
            *self.planner_cpu_before_ms.get_or_insert_default() += before_ms;
        }
        self.held_back += round.held_back.unwrap_or(0.0);
        self.unplanned += u64::from(round.by != By::Planner);
        self.fail_calls += u64::from(round.recovery_ms.is_some());
        self.recovery_ms.extend(round.recovery_ms);
        for notice in &round.notices {
            // Plans in continuous time have theirs cut before they are recorded.
            self.rings_cut += u64::from(notice.kind == EventKind::RingsCut);
            let block = match notice.kind {
                EventKind::Watchdog | EventKind::InvocationFault | EventKind::MapChanged => {
                    round.block
                }
                _ => round.effect,
            };
            self.notice(block, notice);
        }
    }

    /// Something went otherwise than it should.
    pub(crate) fn notice(&mut self, block: u64, notice: &Notice) {
        *self.counts.entry(notice.kind).or_default() += 1;
        if self.events.len() < FleetOutcome::EVENTS {
            let time_s = self.seconds(block);
            self.events.push(FleetEvent {
                time_s,
                kind: notice.kind,
                module: notice.module.clone(),
                message: notice.message.clone(),
            });
        }
    }

    /// A block begins.
    pub(crate) fn adg_nodes(&mut self, nodes: usize) {
        self.adg_nodes = nodes;
        self.adg_nodes_max = self.adg_nodes_max.max(nodes);
    }

    /// A block is over, in which robots stood still in these cells.
    pub(crate) fn block(&mut self, still: impl Iterator<Item = Option<u32>>) {
        self.waiting = 0;
        for cell in still {
            self.waiting += 1;
            if let Some(cell) = cell {
                self.waited_in[cell as usize] += 1;
            }
        }
        self.waited += u64::from(self.waiting);
    }

    /// A point of the series, if it is time for one.
    pub(crate) fn point(&mut self, blocks: u64, last: bool) -> Option<Point> {
        if !last && !blocks.is_multiple_of(self.every) {
            return None;
        }
        let point = Point {
            time_s: self.seconds(blocks),
            goals_reached: self.goals_reached,
            waiting: self.waiting,
            adg_nodes: self.adg_nodes,
            planner_calls: self.calls,
            fail_calls: self.fail_calls,
        };
        if self.series.last().map(|last| last.time_s) == Some(point.time_s) {
            self.series.pop();
        }
        self.series.push(point);
        Some(point)
    }

    /// Seconds that robots stood still, per cell.
    pub(crate) fn waiting_s_per_cell(&self) -> Vec<f64> {
        self.waited_in
            .iter()
            .map(|blocks| self.seconds(*blocks))
            .collect()
    }

    pub(crate) fn metrics(
        &self,
        agents: usize,
        blocks: u64,
        goals_committed: u64,
        tasks: Option<u64>,
    ) -> FleetMetrics {
        let count = |kind| self.counts.get(&kind).copied().unwrap_or(0);
        let share = |part: u64, whole: u64| {
            if whole == 0 {
                0.0
            } else {
                part as f64 / whole as f64
            }
        };
        let simulated_s = self.seconds(blocks);
        FleetMetrics {
            throughput_per_s: if blocks == 0 {
                0.0
            } else {
                self.goals_reached as f64 / simulated_s
            },
            goals_reached: self.goals_reached,
            goals_committed,
            fail_policy_ratio: share(self.fail_calls, self.calls),
            planner_calls: self.calls,
            fail_calls: self.fail_calls,
            all_waits: count(EventKind::AllWait),
            planner_time_ms: CallTimes::of(self.planner_ms.clone()),
            late: Late::of(&self.planner_ms, self.limit_s),
            planner_cpu_ms: (self.planner_cpu_ms.len() == self.planner_ms.len())
                .then(|| CallTimes::of(self.planner_cpu_ms.clone())),
            planner_cpu_between_calls_ms: self.planner_cpu_before_ms,
            fail_policy_time_ms: CallTimes::of(self.recovery_ms.clone()),
            waiting_share: share(self.waited, blocks * agents as u64),
            held_back: (self.held_back > 0.0).then(|| self.held_back / self.calls as f64),
            decay: Decay::of(&self.series, agents as u32),
            adg_nodes_max: self.adg_nodes_max,
            invalid_batches: count(EventKind::InvalidBatch) + count(EventKind::InvalidRecovery),
            rings_cut: self.rings_cut,
            restarts: count(EventKind::Restarted),
            tasks_done: tasks,
            // A block is a step.
            synchronous: self.is_synchronous.then(|| StepMetrics {
                steps: blocks,
                tasks_per_step: tasks.map(|tasks| share(tasks, blocks)),
                goals_per_step: share(self.goals_reached, blocks),
                unplanned: self.unplanned,
            }),
            event_counts: self.counts.clone(),
        }
    }
}
