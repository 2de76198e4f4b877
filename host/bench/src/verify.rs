//! Makes recorded trials once more, and says which of them come out differently.
//!
//! Same instance, options and seed should give the same plan, and the same plan the same
//! execution. Where time decides instead, nothing can be said: a trial that was stopped, or
//! that used nearly all of its budget, may have got further on another day.

use std::collections::{BTreeMap, BTreeSet};
use std::time::{Duration, Instant};

use fleetyard_abi::Status;
use fleetyard_core::words;
use serde::Serialize;

use crate::error::BenchError;
use crate::estimate::Estimate;
use crate::plan::{Planned, Schedule, Shard};
use crate::row::Row;
use crate::run::Progress;

/// A call that took this share of its budget was ended by it, whatever it claims.
const SPENT: f64 = 0.9;

/// The outcome of making trials again.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize)]
pub struct Verified {
    /// Trials with the same plan and the same trace.
    pub equal: u64,
    /// Trials whose end time decided, in the store or now.
    pub not_comparable: u64,
    /// Trials that were not made again: not in the sample.
    pub left_out: u64,
    /// Trials that are different.
    pub differ: Vec<Difference>,
    /// The planners that gave different plans for one instance and seed, now or in repeats that are
    /// recorded.
    pub nondeterministic: BTreeSet<String>,
}

/// A trial that came out differently.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Difference {
    /// The planner's label.
    pub planner: String,
    /// Name of the map.
    pub map: String,
    /// The origin of starts and goals.
    pub scenario: String,
    /// Number of agents.
    pub agents: u64,
    /// The seed that the planner was given.
    pub seed: u64,
    /// Number of the repeat.
    pub repeat: u32,
    /// The part that is different.
    pub what: What,
    /// As it is recorded.
    pub recorded: Option<String>,
    /// As it came out now.
    pub now: Option<String>,
}

/// The parts in which two trials may differ.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum What {
    /// The end of the call.
    Termination,
    /// The digest of the plan.
    Plan,
    /// The digest of the execution's trace.
    Trace,
}

words!(What {
    Termination = "termination";
    Plan = "plan";
    Trace = "trace";
});

/// Makes trials of a store again: all whose keys the schedule has, or `sample` of them, which
/// are spread evenly over planners and instances. None takes longer than `longest`; `watch` hears
/// how far it is after each.
pub fn verify(
    schedule: &Schedule,
    shard: Shard,
    rows: &[Row],
    sample: Option<u64>,
    longest: Duration,
    trial: &mut dyn FnMut(&Planned) -> Result<Row, BenchError>,
    watch: &mut dyn FnMut(&Progress),
) -> Result<Verified, BenchError> {
    let mut verified = Verified::default();
    let recorded: BTreeMap<&str, &Row> = rows.iter().map(|row| (row.key.as_str(), row)).collect();
    repeats(rows, &mut verified.nondeterministic);
    let mut again: Vec<(Planned, &Row)> = Vec::new();
    for planned in schedule.trials_of(shard) {
        match recorded.get(schedule.key(&planned).as_str()) {
            Some(row) if comparable(row) => again.push((planned, *row)),
            Some(_) => verified.not_comparable += 1,
            None => {}
        }
    }
    let chosen = chosen(&mut again, sample);
    verified.left_out = (again.len() - chosen.len()) as u64;
    let mut estimate = Estimate::new(longest);
    for (planned, _) in &chosen {
        estimate.expect(planned.planner);
    }
    for (done, (planned, row)) in chosen.iter().enumerate() {
        let started = Instant::now();
        let now = trial(planned)?;
        estimate.ended(planned.planner, started.elapsed());
        watch(&Progress {
            done: done as u64 + 1,
            total: chosen.len() as u64,
            failed: verified.differ.len() as u64,
            left: estimate.left(),
        });
        if !comparable(&now) {
            verified.not_comparable += 1;
            continue;
        }
        let Some((what, recorded, now)) = difference(row, &now) else {
            verified.equal += 1;
            continue;
        };
        verified.nondeterministic.insert(row.planner.clone());
        verified.differ.push(Difference {
            planner: row.planner.clone(),
            map: row.map.clone(),
            scenario: row.scenario.clone(),
            agents: row.agents,
            seed: row.seed,
            repeat: row.repeat,
            what,
            recorded,
            now,
        });
    }
    Ok(verified)
}

/// The trials of a sample, in the order of the suite.
fn chosen<'r>(again: &mut [(Planned, &'r Row)], sample: Option<u64>) -> Vec<(Planned, &'r Row)> {
    let all = again.len() as u64;
    let size = sample.unwrap_or(all).min(all);
    // Planner by planner, so that an even spread is one over planners as well.
    again.sort_by_key(|(planned, _)| (planned.planner, planned.number));
    let mut chosen: Vec<_> = (0..size)
        .map(|index| again[(index * all / size) as usize])
        .collect();
    chosen.sort_by_key(|(planned, _)| planned.number);
    chosen
}

/// True if something else than time decided how the trial ended, by the planner's own word too: a solver
/// that is given less than the budget stops before it.
pub(crate) fn comparable(row: &Row) -> bool {
    if let (Some(longest), Some(limit)) = (row.planner_call_max_ms, row.planner_limit_ms) {
        // A fleet drives as long as it is told to, but each call of its planner has a deadline.
        return row.termination == "completed" && longest < SPENT * limit;
    }
    let by_its_own_clock = row.claim.as_deref() == Some(&*Status::TimedOut.to_string());
    !matches!(row.termination.as_str(), "timed-out" | "over-limit")
        && !by_its_own_clock
        && row.planning_time_ms < SPENT * row.budget_ms
}

fn difference(row: &Row, now: &Row) -> Option<(What, Option<String>, Option<String>)> {
    let ended = |row: &Row| Some(row.termination.clone());
    [
        (What::Plan, row.plan_digest.clone(), now.plan_digest.clone()),
        (
            What::Trace,
            row.trace_digest.clone(),
            now.trace_digest.clone(),
        ),
        (What::Termination, ended(row), ended(now)),
    ]
    .into_iter()
    .find(|(_, recorded, now)| recorded != now)
}

/// Finds the planners whose recorded repeats differ already.
fn repeats(rows: &[Row], found: &mut BTreeSet<String>) {
    let mut plans: BTreeMap<(&str, &str, u64), &Option<String>> = BTreeMap::new();
    for row in rows.iter().filter(|row| comparable(row)) {
        let asked = (row.planner.as_str(), row.instance_digest.as_str(), row.seed);
        let first = plans.entry(asked).or_insert(&row.plan_digest);
        if *first != &row.plan_digest {
            found.insert(row.planner.clone());
        }
    }
}

#[cfg(test)]
mod tests {
    use fleetyard_core::Digest;

    use super::*;

    fn schedule() -> Schedule {
        let digests = |from: u128| (from..from + 4).map(Digest).collect();
        Schedule::new(digests(0), digests(10), vec![5], 2, 0)
    }

    /// Planners 0 and 1 keep to their seed, 2 does not, 3 ends when its time does.
    fn made(planned: &Planned, schedule: &Schedule, day: &str) -> Row {
        let plan = match planned.planner {
            2 => format!("plan {} of {day}", planned.repeat),
            _ => format!("plan of {}", planned.instance),
        };
        Row {
            key: schedule.key(planned),
            planner: format!("P{}", planned.planner),
            instance_digest: planned.instance.to_string(),
            seed: planned.seed,
            repeat: planned.repeat,
            termination: if planned.planner == 3 {
                "timed-out"
            } else {
                "completed"
            }
            .into(),
            plan_digest: Some(plan),
            budget_ms: 10.0,
            planning_time_ms: 1.0,
            ..Row::default()
        }
    }

    #[test]
    fn who_is_nondeterministic_is_named() {
        let schedule = schedule();
        let rows: Vec<Row> = schedule
            .trials()
            .map(|planned| made(&planned, &schedule, "monday"))
            .collect();
        let run = |sample, day: &str| {
            let mut asked = Vec::new();
            let verified = verify(
                &schedule,
                Shard::ALL,
                &rows,
                sample,
                Duration::from_mins(1),
                &mut |planned| {
                    asked.push(*planned);
                    Ok(made(planned, &schedule, day))
                },
                &mut |_| {},
            );
            (verified.unwrap(), asked)
        };
        let (verified, asked) = run(None, "tuesday");
        assert_eq!(asked.len(), 24);
        assert_eq!((verified.equal, verified.not_comparable), (16, 8));
        assert_eq!(verified.differ.len(), 8);
        assert!(verified.differ.iter().all(|found| found.planner == "P2"));
        assert_eq!(verified.differ[0].what, What::Plan);
        assert_eq!(verified.differ[0].now.as_deref(), Some("plan 0 of tuesday"));
        // The same day's repeats differ among themselves.
        let (verified, asked) = run(Some(6), "monday");
        let planners: Vec<usize> = asked.iter().map(|planned| planned.planner).collect();
        assert_eq!(asked.len(), 6);
        for planner in 0..3 {
            let count = planners.iter().filter(|asked| **asked == planner).count();
            assert_eq!(count, 2, "{planners:?}");
        }
        assert_eq!((verified.equal, verified.left_out), (6, 18));
        assert_eq!(verified.nondeterministic, BTreeSet::from(["P2".into()]));
    }
}
