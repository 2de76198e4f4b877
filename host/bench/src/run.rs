//! Runs a schedule into a store.
//!
//! This is the coordinator: it knows what is missing, asks for it in the order of the
//! protocol, and writes each trial when it has ended. What a trial is, is its caller's.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use fleetyard_core::InputError;

use crate::error::BenchError;
use crate::estimate::{Estimate, Left};
use crate::plan::{Planned, Schedule, Shard, Step};
use crate::row::Row;
use crate::store::Store;

/// A store that may be closed from another thread, when the process is told to end.
#[derive(Clone)]
pub struct SharedStore(Arc<Mutex<Option<Store>>>);

impl SharedStore {
    /// Of a store that is open for writing.
    pub fn new(store: Store) -> Self {
        Self(Arc::new(Mutex::new(Some(store))))
    }

    fn lock(&self) -> MutexGuard<'_, Option<Store>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Works with the store; an error once it was closed.
    pub fn with<T>(
        &self,
        work: impl FnOnce(&mut Store) -> Result<T, InputError>,
    ) -> Result<T, InputError> {
        match self.lock().as_mut() {
            Some(store) => work(store),
            None => Err(InputError::new("store", "the store was closed")),
        }
    }

    /// Takes the store away from everybody else, and waits for a trial that is just being
    /// written. Nobody gets at it as long as `last` runs.
    pub fn close(&self, last: impl FnOnce(Option<Store>)) {
        let mut store = self.lock();
        last(store.take());
    }
}

/// The progress of a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress {
    /// Trials of this run's part that are in the store.
    pub done: u64,
    /// Trials of this run's part.
    pub total: u64,
    /// Trials of this run that did not succeed, or did not come out as before.
    pub failed: u64,
    /// The time that the rest will take; absent before the first trial has ended.
    pub left: Option<Left>,
}

/// The outcome of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Ran {
    /// Trials that were in the store before.
    pub before: u64,
    /// Trials that were made.
    pub made: u64,
    /// Those of them that did not succeed.
    pub failed: u64,
}

/// Makes what is missing of a part of a schedule, and writes it into the store. `trial` makes a
/// trial or a warm-up, none of which takes longer than `longest`; `watch` hears of every
/// row that was stored.
pub fn run(
    schedule: &Schedule,
    shard: Shard,
    store: &SharedStore,
    longest: Duration,
    trial: &mut dyn FnMut(&Planned) -> Result<Row, BenchError>,
    watch: &mut dyn FnMut(&Row, &Progress),
) -> Result<Ran, BenchError> {
    let there = store.with(|store| store.keys())?;
    let missing = |planned: &Planned| there.is_empty() || !there.contains(&schedule.key(planned));
    let steps = || Wanted {
        steps: schedule.order(shard),
        missing: &missing,
        instance: None,
        kept: BTreeSet::new(),
        schedule,
    };
    let mut estimate = Estimate::new(longest);
    let mut wanted = 0;
    for step in steps() {
        let (Step::WarmUp(planned) | Step::Trial(planned)) = step;
        estimate.expect(planned.planner);
        wanted += u64::from(matches!(step, Step::Trial(_)));
    }
    let total = schedule.len_of(shard);
    let mut ran = Ran {
        before: total - wanted,
        ..Ran::default()
    };
    for step in steps() {
        let (Step::WarmUp(planned) | Step::Trial(planned)) = step;
        let started = Instant::now();
        let row = trial(&planned)?;
        if matches!(step, Step::Trial(_)) {
            store.with(|store| store.insert(&row))?;
            ran.made += 1;
            ran.failed += u64::from(!row.success);
        }
        estimate.ended(planned.planner, started.elapsed());
        if matches!(step, Step::Trial(_)) {
            watch(
                &row,
                &Progress {
                    done: ran.before + ran.made,
                    total,
                    failed: ran.failed,
                    left: estimate.left(),
                },
            );
        }
    }
    Ok(ran)
}

/// The steps that are still to be made: trials that are missing, and the warm-ups of planners
/// that have one of them to make.
struct Wanted<'a, S, M> {
    steps: S,
    missing: &'a M,
    /// The instance whose planners are in `kept`.
    instance: Option<usize>,
    kept: BTreeSet<usize>,
    schedule: &'a Schedule,
}

impl<S, M> Iterator for Wanted<'_, S, M>
where
    S: Iterator<Item = Step>,
    M: Fn(&Planned) -> bool,
{
    type Item = Step;

    fn next(&mut self) -> Option<Step> {
        loop {
            let step = self.steps.next()?;
            match &step {
                Step::Trial(planned) => {
                    if (self.missing)(planned) {
                        return Some(step);
                    }
                }
                Step::WarmUp(planned) => {
                    if self.instance != Some(planned.instance) {
                        self.instance = Some(planned.instance);
                        let trials = self.schedule.of_instance(planned.instance);
                        let missing = trials.filter(|planned| (self.missing)(planned));
                        self.kept = missing.map(|planned| planned.planner).collect();
                    }
                    if self.kept.contains(&planned.planner) {
                        return Some(step);
                    }
                }
            }
        }
    }
}
