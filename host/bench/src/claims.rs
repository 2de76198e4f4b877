//! Claims of a planner, compared with the findings of the host.
//!
//! A planner claims by its status, and by figures that are named as ours are: every
//! `claimed_sum_of_costs` and `claimed_makespan` is compared with the cost of the plan
//! that it handed over. How long it says that it worked is held against the host's clock and
//! the processor time of the call, and its `lower_bound` against the cost of every valid plan of
//! the instance that is known; these are listed only where they cannot be true, for nothing shows
//! that they are. Nothing is believed, and nothing is corrected: claims stand in
//! the record beside the verdict, and where they differ it says so.

use std::collections::BTreeMap;
use std::fmt;

use fleetyard_abi::Status;
use fleetyard_views::ViewVerdict;
use serde::Serialize;

use crate::follow::LOWER_BOUND;
use crate::record::{Metrics, Record, number};

/// A claim that can be checked in principle.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Claim {
    /// The subject of the claim.
    pub what: Subject,
    /// The planner's figure.
    pub claimed: Figure,
    /// The host's figure; absent when the host found nothing to compare the claim with.
    pub found: Option<Figure>,
    /// Absent when the claim could not be checked.
    pub agrees: Option<bool>,
}

/// The subject of a claim.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Subject {
    /// The result of the call.
    Status,
    /// In steps.
    SumOfCosts,
    /// In steps.
    Makespan,
    /// Time that the planner worked.
    CallTime,
    /// The sum of costs that no plan is below: in steps on a grid, else a time.
    LowerBound,
}

impl fmt::Display for Subject {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Status => "status",
            Self::SumOfCosts => "sum of costs",
            Self::Makespan => "makespan",
            Self::CallTime => "time of work",
            Self::LowerBound => "lower bound",
        })
    }
}

/// A number of steps, a time, or words.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Figure {
    /// A number of steps.
    Steps(f64),
    /// Milliseconds.
    Time {
        /// Number of milliseconds.
        ms: f64,
    },
    /// Words.
    Words(String),
}

impl fmt::Display for Figure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Steps(steps) => write!(f, "{steps}"),
            Self::Time { ms } => write!(f, "{} ms", time(*ms)),
            Self::Words(words) => f.write_str(words),
        }
    }
}

impl Claim {
    /// Steps by which the claim exceeds the host's figure.
    pub fn difference(&self) -> Option<f64> {
        match (&self.claimed, &self.found) {
            (Figure::Steps(claimed), Some(Figure::Steps(found))) => Some(claimed - found),
            _ => None,
        }
    }
}

impl fmt::Display for Claim {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { what, claimed, .. } = self;
        write!(f, "{what}: {claimed} claimed")?;
        match &self.found {
            Some(found) => write!(f, ", {found} found")?,
            None => return Ok(()),
        }
        match self.difference() {
            Some(difference) if difference != 0.0 => write!(f, " ({})", signed(difference)),
            _ => Ok(()),
        }
    }
}

/// A time in milliseconds, down to nanoseconds.
fn time(ms: f64) -> String {
    if ms > 0.0 && ms < 0.001 {
        return format!("{ms:.6}");
    }
    number(ms)
}

/// A difference with its sign.
pub fn signed(difference: f64) -> String {
    let sign = if difference > 0.0 { "+" } else { "" };
    if difference.fract() == 0.0 {
        format!("{sign}{difference}")
    } else {
        format!("{sign}{}", number(difference))
    }
}

/// Every claim of a trial, from its record as far as it is written.
pub fn of(record: &Record) -> Vec<Claim> {
    // A planner knows its view of a world alone.
    let view = record
        .judged
        .as_ref()
        .and_then(|judged| judged.view.as_ref());
    let valid = view.map_or(record.verdict.valid, ViewVerdict::is_valid);
    let valid = record.plan_digest.map(|_| valid);
    let mut claims: Vec<Claim> = status(record.claim, valid).into_iter().collect();
    let metrics = &record.metrics;
    for (what, name, ours) in [
        (
            Subject::SumOfCosts,
            "claimed_sum_of_costs",
            metrics.soc_steps,
        ),
        (
            Subject::Makespan,
            "claimed_makespan",
            metrics.makespan_steps,
        ),
    ] {
        let Some(claimed) = record.claimed_metrics.get(name).copied() else {
            continue;
        };
        let ours = ours.map(|steps| steps as f64);
        claims.push(Claim {
            what,
            claimed: Figure::Steps(claimed),
            found: ours.map(Figure::Steps),
            // Both are whole numbers of steps, unless the planner counts otherwise.
            agrees: ours.map(|ours| (claimed - ours).abs() < 1e-6),
        });
    }
    claims.extend(call_time(record));
    if valid == Some(true) {
        claims.extend(lower_bound(&record.claimed_metrics, metrics));
    }
    claims
}

/// A lower bound above the cost of a valid plan, which has these metrics.
fn lower_bound(claims: &BTreeMap<String, f64>, plan: &Metrics) -> Option<Claim> {
    let claimed = claims.get(LOWER_BOUND).copied()?;
    let steps = plan.soc_steps.map(|steps| steps as f64);
    let cost = steps.or(plan.soc_s)?;
    let figure = |cost: f64| match steps {
        Some(_) => Figure::Steps(cost),
        None => Figure::Time { ms: 1000.0 * cost },
    };
    // Times of a plan are rounded on their way.
    (claimed > cost * (1.0 + 1e-9) + 1e-6).then(|| Claim {
        what: Subject::LowerBound,
        claimed: figure(claimed),
        found: Some(figure(cost)),
        agrees: Some(false),
    })
}

/// A time of work that is too short to be true: more of the round trip was the planner's than
/// transport, the host and others can have taken, or its processes computed for longer.
fn call_time(record: &Record) -> Option<Claim> {
    let metrics = &record.metrics;
    let (claimed, round_trip) = (metrics.call_time_ms?, metrics.round_trip_ms?);
    let (empty, uncertainty) = metrics
        .correction
        .map_or((0.0, 0.0), |empty| (empty.ms, empty.uncertainty_ms));
    let found = (round_trip - empty).max(0.0);
    let measurement = &record.measurement;
    let others = measurement.plan.run_delay_ms.zip(metrics.held_up_ms);
    let others_ms = others.map_or(0.0, |(planner, host)| planner + host);
    // Where somebody else was busy, less can be told from the clock.
    let slack = if others.is_some() && measurement.contended.is_empty() {
        1.0 + 0.01 * round_trip
    } else {
        20.0 + 0.25 * round_trip
    };
    let by_clock = found - uncertainty - others_ms - slack;
    // Processor time comes in ticks, and reading and writing messages is in it.
    let processors = match &measurement.cpus {
        Some(cpus) => cpus.len(),
        None => measurement.machine.logical_cpus.unwrap_or(1) as usize,
    };
    let cpu = measurement.plan.cpu_ms.unwrap_or(0.0);
    let by_cpu = (0.9 * cpu - 20.0) / processors.max(1) as f64;
    (claimed < by_clock.max(by_cpu)).then_some(Claim {
        what: Subject::CallTime,
        claimed: Figure::Time { ms: claimed },
        found: Some(Figure::Time { ms: found }),
        agrees: Some(false),
    })
}

/// The claim of a status; most claim nothing. `valid` is the verdict on the plan, if there is one.
fn status(claim: Option<Status>, valid: Option<bool>) -> Option<Claim> {
    let found = valid.map(|valid| {
        if valid {
            "a valid plan"
        } else {
            "an invalid plan"
        }
    });
    let agrees = match claim? {
        Status::Solved => valid,
        // That there is no plan cannot be checked; that there is one can.
        Status::Infeasible => valid.filter(|valid| *valid).map(|_| false),
        _ => return None,
    };
    Some(Claim {
        what: Subject::Status,
        claimed: Figure::Words(claim?.to_string()),
        found: found.map(|found| Figure::Words(found.into())),
        agrees,
    })
}

/// Holds planners against each other: who claims that no plan exists is wrong when another one
/// found a valid plan of the same instance, and who claims that none costs less when that one does.
/// Records come with the names that their planners have in the comparison.
pub fn confront(records: &mut [(&str, &mut Record)]) {
    for index in 0..records.len() {
        let mine = &records[index].1;
        let others = records.iter().filter(|(_, other)| {
            let same = other.instance_digest == mine.instance_digest;
            same && other.instance.representation == mine.instance.representation
                && other.succeeded()
        });
        let solver = others
            .clone()
            .next()
            .map(|(name, _)| format!("a valid plan by {name}"));
        let known = mine
            .claims
            .iter()
            .any(|claim| claim.what == Subject::LowerBound);
        let mut bounds =
            others.filter_map(|(_, other)| lower_bound(&mine.claimed_metrics, &other.metrics));
        let bound = bounds.next().filter(|_| !known);
        let infeasible = mine.claim == Some(Status::Infeasible);
        let claims = &mut records[index].1.claims;
        for claim in claims.iter_mut() {
            let open = claim.what == Subject::Status && claim.agrees.is_none();
            if let (true, Some(solver)) = (open && infeasible, &solver) {
                claim.agrees = Some(false);
                claim.found = Some(Figure::Words(solver.clone()));
            }
        }
        claims.extend(bound);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_status_is_held_against_the_plan() {
        for (claim, valid, expected) in [
            (Status::Solved, Some(true), Some(Some(true))),
            (Status::Solved, Some(false), Some(Some(false))),
            (Status::Solved, None, Some(None)),
            (Status::Infeasible, None, Some(None)),
            (Status::Infeasible, Some(false), Some(None)),
            (Status::Infeasible, Some(true), Some(Some(false))),
            (Status::GaveUp, Some(false), None),
            (Status::TimedOut, None, None),
        ] {
            let found = status(Some(claim), valid).map(|claim| claim.agrees);
            assert_eq!(found, expected, "{claim} {valid:?}");
        }
        assert_eq!(status(None, Some(true)), None);
    }

    #[test]
    fn a_lower_bound_is_held_against_a_plan() {
        let found = |bound: f64, soc_steps: Option<u64>, soc_s: Option<f64>| {
            let claims = BTreeMap::from([(LOWER_BOUND.to_owned(), bound)]);
            let plan = Metrics {
                soc_steps,
                soc_s,
                ..Metrics::default()
            };
            lower_bound(&claims, &plan).map(|claim| claim.to_string())
        };
        for (bound, steps, seconds, told) in [
            (10.0, Some(10), None, None),
            (f64::NAN, Some(10), None, None),
            (1e9, None, None, None),
            (
                11.0,
                Some(10),
                None,
                Some("lower bound: 11 claimed, 10 found (+1)"),
            ),
            (2.5, None, Some(2.5), None),
            (
                2.5,
                None,
                Some(2.0),
                Some("lower bound: 2500 ms claimed, 2000 ms found"),
            ),
        ] {
            assert_eq!(found(bound, steps, seconds).as_deref(), told, "{bound}");
        }
    }

    #[test]
    fn a_difference_has_a_sign() {
        let claim = |claimed: f64, found: f64| Claim {
            what: Subject::SumOfCosts,
            claimed: Figure::Steps(claimed),
            found: Some(Figure::Steps(found)),
            agrees: Some(false),
        };
        for (claim, text) in [
            (claim(12.0, 10.0), "sum of costs: 12 claimed, 10 found (+2)"),
            (
                claim(9.5, 10.0),
                "sum of costs: 9.5 claimed, 10 found (-0.50)",
            ),
            (claim(10.0, 10.0), "sum of costs: 10 claimed, 10 found"),
        ] {
            assert_eq!(claim.to_string(), text);
        }
    }
}
