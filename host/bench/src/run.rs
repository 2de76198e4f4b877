//! Runs a schedule into a store.
//!
//! This is the coordinator: it knows what is missing, asks for it in the order of the
//! protocol, and writes each trial when it has ended. What a trial is, is its caller's.

use std::collections::BTreeSet;
use std::fmt;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use fleetyard_core::InputError;

use crate::error::BenchError;
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

/// How far a run is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress {
    /// Trials of this run's part that are in the store.
    pub done: u64,
    /// Trials of this run's part.
    pub total: u64,
    /// Trials of this run that did not succeed.
    pub failed: u64,
    /// How long the rest will take.
    pub left: Left,
}

/// How long something will take.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Left {
    /// Between what and what, from the trials so far; absent until every planner that is
    /// still to be asked has ended two trials.
    pub expected: Option<(Duration, Duration)>,
    /// What budgets allow.
    pub at_most: Duration,
}

/// What came of a run.
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

/// Says how long a rest will take, from what it took so far.
///
/// Planners differ by orders of magnitude, and so each is extrapolated by itself: the rest
/// of a planner takes as many times its mean, with the standard error of that sum. The
/// range is two of these errors wide to either side. It knows nothing of instances that are
/// harder than those before.
#[derive(Debug, Default)]
struct Estimate {
    longest: Duration,
    planners: Vec<Pace>,
}

/// Of one planner, in seconds.
#[derive(Debug, Clone, Copy, Default)]
struct Pace {
    left: u64,
    ended: u64,
    mean: f64,
    /// Sum of squared deviations (Welford 1962).
    squares: f64,
}

impl Estimate {
    fn new(longest: Duration) -> Self {
        Self {
            longest,
            planners: Vec::new(),
        }
    }

    fn pace(&mut self, planner: usize) -> &mut Pace {
        if planner >= self.planners.len() {
            self.planners.resize(planner + 1, Pace::default());
        }
        &mut self.planners[planner]
    }

    fn expect(&mut self, planner: usize) {
        self.pace(planner).left += 1;
    }

    fn ended(&mut self, planner: usize, took: Duration) {
        let pace = self.pace(planner);
        pace.left = pace.left.saturating_sub(1);
        pace.ended += 1;
        let deviation = took.as_secs_f64() - pace.mean;
        pace.mean += deviation / pace.ended as f64;
        pace.squares += deviation * (took.as_secs_f64() - pace.mean);
    }

    fn left(&self) -> Left {
        let trials: u64 = self.planners.iter().map(|pace| pace.left).sum();
        let at_most = self
            .longest
            .saturating_mul(u32::try_from(trials).unwrap_or(u32::MAX));
        let mut sum = 0.0;
        let mut variance = 0.0;
        for pace in self.planners.iter().filter(|pace| pace.left > 0) {
            if pace.ended < 2 {
                return Left {
                    expected: None,
                    at_most,
                };
            }
            let (left, ended) = (pace.left as f64, pace.ended as f64);
            sum += left * pace.mean;
            // Of the trials themselves, and of the mean that stands for them.
            let each = pace.squares / (ended - 1.0);
            variance += each * left + each / ended * left * left;
        }
        let error = 2.0 * variance.sqrt();
        let duration = |seconds: f64| {
            Duration::try_from_secs_f64(seconds.max(0.0)).map_or(at_most, |d| d.min(at_most))
        };
        Left {
            expected: Some((duration(sum - error), duration(sum + error))),
            at_most,
        }
    }
}

impl fmt::Display for Left {
    /// Such as `about 3m to 5m left`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.expected {
            None => write!(f, "at most {} left", rough(self.at_most)),
            Some((low, high)) => {
                let (low, high) = (rough(low), rough(high));
                if low == high {
                    write!(f, "about {high} left")
                } else {
                    write!(f, "about {low} to {high} left")
                }
            }
        }
    }
}

/// A duration in two of its units at most, and no finer than seconds.
pub fn rough(duration: Duration) -> String {
    let seconds = duration.as_secs() + u64::from(duration.subsec_millis() >= 500);
    let unit = match seconds {
        0..3600 => 1,
        3600..86_400 => 60,
        _ => 3600,
    };
    let rounded = Duration::from_secs(seconds / unit * unit);
    humantime::format_duration(rounded).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    const LONGEST: Duration = Duration::from_mins(1);

    #[test]
    fn until_there_is_data_budgets_alone_say_how_long_it_may_take() {
        let mut estimate = Estimate::new(LONGEST);
        for planner in [0, 1, 0, 1, 0, 1] {
            estimate.expect(planner);
        }
        assert_eq!(estimate.left().to_string(), "at most 6m left");
        for _ in 0..2 {
            estimate.ended(0, Duration::from_secs(1));
        }
        estimate.ended(1, Duration::from_secs(10));
        assert_eq!(estimate.left().to_string(), "at most 3m left");
        estimate.ended(1, Duration::from_secs(10));
        assert_eq!(estimate.left().to_string(), "about 11s left");
        estimate.ended(1, Duration::from_secs(10));
        assert_eq!(estimate.left().to_string(), "about 1s left");
    }

    #[test]
    fn a_range_is_wider_when_trials_differ_and_never_beyond_the_budgets() {
        let mut estimate = Estimate::new(LONGEST);
        (0..14).for_each(|_| estimate.expect(0));
        for seconds in [1, 3, 1, 3] {
            estimate.ended(0, Duration::from_secs(seconds));
        }
        // Mean 2 s, variance 4/3: 20 s ± 2 √(10 · 4/3 + 100 · 4/3 / 4).
        let (low, high) = estimate.left().expected.unwrap();
        let error = 2.0 * (40.0_f64 / 3.0 + 100.0 / 3.0).sqrt();
        assert!((low.as_secs_f64() - (20.0 - error)).abs() < 1e-6, "{low:?}");
        assert!(
            (high.as_secs_f64() - (20.0 + error)).abs() < 1e-6,
            "{high:?}"
        );
        let mut short = Estimate::new(Duration::from_secs(3));
        (0..14).for_each(|_| short.expect(0));
        for seconds in [1, 3, 1, 3] {
            short.ended(0, Duration::from_secs(seconds));
        }
        assert_eq!(short.left().expected.unwrap().1, Duration::from_secs(30));
    }

    #[test]
    fn durations_are_no_finer_than_they_are_known() {
        for (seconds, text) in [
            (0.2, "0s"),
            (59.6, "1m"),
            (3599.0, "59m 59s"),
            (3725.0, "1h 2m"),
            (200_000.0, "2days 7h"),
        ] {
            assert_eq!(rough(Duration::from_secs_f64(seconds)), text);
        }
    }
}
