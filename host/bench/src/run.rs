//! Runs a schedule.
//!
//! This is the coordinator: it knows what is missing, asks for it in the order of the
//! protocol, and hands each trial on when it has ended. What a trial is and where it is kept is its
//! caller's.

use std::collections::BTreeSet;
use std::time::{Duration, Instant};

use crate::error::BenchError;
use crate::estimate::{Estimate, Left};
use crate::plan::{Planned, Schedule, Shard, Step};
use crate::row::Row;

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
    /// Attempts beyond the first of each.
    pub again: u64,
}

/// Makes of a part of a schedule what is not `there` by its key. `trial` makes a trial or a warm-up; a
/// trial that others disturbed is made again up to `retries` times, and none takes longer than `longest`
/// with that: the first that they did not counts, or else the first. `ended` keeps every trial that was made.
pub fn run(
    schedule: &Schedule,
    shard: Shard,
    there: &BTreeSet<String>,
    longest: Duration,
    retries: u32,
    trial: &mut dyn FnMut(&Planned) -> Result<Row, BenchError>,
    ended: &mut dyn FnMut(Row, &Progress) -> Result<(), BenchError>,
) -> Result<Ran, BenchError> {
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
        let mut row = trial(&planned)?;
        if matches!(step, Step::WarmUp(_)) {
            estimate.ended(planned.planner, started.elapsed());
            continue;
        }
        let mut attempts = 1;
        // Neither how long it took nor what came of it is looked at: choosing among times by
        // the times themselves would flatter who varies most. Nor is what a planner can bring
        // about: it would be made again until its dice are good. For the same reason the first
        // attempt counts where all were disturbed.
        let mut last = row.contended_by_others;
        while attempts <= retries && last == Some(true) {
            let next = trial(&planned)?;
            attempts += 1;
            last = next.contended_by_others;
            if last != Some(true) {
                row = next;
            }
        }
        row.attempts = (retries > 0).then_some(attempts);
        estimate.ended(planned.planner, started.elapsed());
        ran.again += u64::from(attempts - 1);
        ran.made += 1;
        ran.failed += u64::from(!row.success);
        let progress = Progress {
            done: ran.before + ran.made,
            total,
            failed: ran.failed,
            left: estimate.left(),
        };
        ended(row, &progress)?;
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

#[cfg(test)]
mod tests {
    use fleetyard_core::Digest;

    use super::*;

    #[test]
    fn a_trial_that_others_disturbed_is_made_again_whatever_came_of_it() {
        let digests = |count: u128| (0..count).map(Digest).collect();
        let schedule = Schedule::new(digests(2), digests(3), vec![0], 1, 1);
        // The first planner is never disturbed, the second in its first two attempts of an instance;
        // in the third instance always. Warm-ups are not looked at, and the marks that a planner can
        // bring about are no reason.
        let made = |retries: u32| {
            let mut asked = std::collections::BTreeMap::new();
            let mut rows = Vec::new();
            let ran = run(
                &schedule,
                Shard::ALL,
                &BTreeSet::new(),
                Duration::from_secs(1),
                retries,
                &mut |planned| {
                    let calls: &mut u32 = asked.entry(planned.number).or_default();
                    *calls += 1;
                    let disturbed = planned.planner == 1 && (*calls <= 3 || planned.instance == 2);
                    Ok(Row {
                        key: schedule.key(planned),
                        trial: planned.number,
                        contended: "waited".into(),
                        contended_by_others: Some(disturbed),
                        // The worse ones are those that count.
                        success: *calls == 2,
                        solve_time_ms: f64::from(*calls),
                        ..Row::default()
                    })
                },
                &mut |row, _| {
                    rows.push(row);
                    Ok(())
                },
            );
            rows.sort_by_key(|row| row.trial);
            let rows = rows.into_iter().map(|row| {
                let disturbed = row.contended_by_others == Some(true);
                (row.attempts, row.solve_time_ms as u32, disturbed)
            });
            (ran.unwrap(), rows.collect::<Vec<_>>())
        };
        let (ran, rows) = made(0);
        assert_eq!((ran.made, ran.again), (6, 0));
        let quiet = (None, 2, false);
        let disturbed = (None, 2, true);
        assert_eq!(rows, [quiet, disturbed].repeat(3));
        let (ran, rows) = made(5);
        assert_eq!((ran.made, ran.failed, ran.again), (6, 2, 2 + 2 + 5));
        let quiet = (Some(1), 2, false);
        let third = (Some(3), 4, false);
        assert_eq!(
            rows,
            [quiet, third, quiet, third, quiet, (Some(6), 2, true)]
        );
    }
}
