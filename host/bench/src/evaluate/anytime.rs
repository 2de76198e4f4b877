use serde::Serialize;

use super::quality::valid_plans;
use super::{Case, Planner, Trials};
use crate::Row;
use crate::statistics::{Clustered, Interval, clustered_mean_interval, mean, sorted};
use crate::verify::comparable;

/// Gaps to the best known plan that count as targets.
pub const GAPS: [f64; 4] = [0.01, 0.02, 0.05, 0.10];

/// Parts of the budget at which targets are counted.
pub const PARTS: [f64; 3] = [0.01, 0.1, 1.0];

/// Quality of a planner's plans over time, against the best valid plan that any planner found of
/// the instance.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Anytime {
    /// Its label.
    pub planner: String,
    /// Mean over cases of the primal integral over the budget, as a share of it: the mean gap 1 − C\*/C
    /// in that time, 1 as long as there is no plan.
    ///
    /// Berthold, "Measuring the impact of primal heuristics", Operations Research Letters 41 (2013).
    pub primal_integral: f64,
    /// Its 95 % interval, of six clusters or more.
    pub interval: Option<Interval>,
    /// Share of targets, one for each case and each of [`GAPS`], that were reached within each of
    /// [`PARTS`] of the budget.
    ///
    /// Hansen, Auger, Ros, Mersmann, Tušar and Brockhoff, "COCO: a platform for comparing continuous
    /// optimizers in a black-box setting", Optimization Methods and Software 36 (2021).
    pub targets: [f64; PARTS.len()],
    /// Share of cases whose last plan is within each of [`GAPS`].
    pub within: [f64; GAPS.len()],
    /// Mean gap when the first planner of the instance had ended by itself with a valid plan, and
    /// at the budget; of instances that a planner ended so.
    pub equal_time: Option<[f64; 2]>,
}

/// Share of targets, one for each case and each of [`GAPS`], that a planner has reached over time.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Reached {
    /// Its label.
    pub planner: String,
    /// By moment.
    pub shares: Vec<f64>,
}

/// Of every planner, in the suite's order, the share of targets that it has reached by each moment,
/// against the best plans that came by the last of these.
pub fn targets_reached(trials: &Trials<'_>, times_ms: &[f64]) -> Vec<Reached> {
    let best = best_known(trials, times_ms.last().copied().unwrap_or(0.0));
    let planners = trials.planners().iter();
    let of = |planner: &Planner<'_>| {
        let solvable = || (planner.cases.iter()).filter(|case| best[case.instance].is_finite());
        let cases = solvable().count();
        if cases == 0 {
            return None;
        }
        let shares = times_ms.iter().map(|time_ms| {
            let of_case = |case: &Case<'_>| {
                let reached = |row: &&Row| hit(gap_by(row, best[case.instance], *time_ms));
                case.repeats.iter().map(reached).sum::<f64>() / case.repeats.len() as f64
            };
            solvable().map(of_case).sum::<f64>() / cases as f64
        });
        Some(Reached {
            planner: planner.label.to_string(),
            shares: shares.collect(),
        })
    };
    planners.filter_map(of).collect()
}

/// Share of targets that a gap is within.
fn hit(gap: f64) -> f64 {
    GAPS.iter().filter(|target| gap <= **target).count() as f64 / GAPS.len() as f64
}

/// By instance, the smallest sum of costs of any planner's valid plan that came by then; infinite
/// where there is none.
fn best_known(trials: &Trials<'_>, time_ms: f64) -> Vec<f64> {
    let mut best = vec![f64::INFINITY; trials.instances().len()];
    for case in trials.planners().iter().flat_map(|planner| &planner.cases) {
        for row in &case.repeats {
            let known = &mut best[case.instance];
            *known = valid_plans(row)
                .filter(|(time, _)| *time <= time_ms)
                .map(|(_, cost)| cost)
                .fold(*known, f64::min);
        }
    }
    best
}

/// By instance, the time that the first planner had used that ended by itself with a valid plan;
/// infinite where none did.
fn first_ends(trials: &Trials<'_>) -> Vec<f64> {
    let mut ends = vec![f64::INFINITY; trials.instances().len()];
    for case in trials.planners().iter().flat_map(|planner| &planner.cases) {
        let ended = (case.repeats.iter()).filter(|row| row.success && comparable(row));
        for row in ended {
            let known = &mut ends[case.instance];
            *known = known.min(row.planning_time_ms);
        }
    }
    ends
}

impl Anytime {
    /// Of every planner, in the suite's order, that was asked an instance for which some plan's cost in steps is known;
    /// nothing where nobody has sent a better plan on the way.
    pub(super) fn all(trials: &Trials<'_>) -> Vec<Self> {
        if !trials.rows().any(|row| row.incumbents.len() > 1) {
            return Vec::new();
        }
        let (best, ends) = (best_known(trials, f64::INFINITY), first_ends(trials));
        let planners = trials.planners().iter();
        planners
            .filter_map(|planner| Self::of(planner, &best, &ends))
            .collect()
    }

    fn of(planner: &Planner<'_>, best: &[f64], ends: &[f64]) -> Option<Self> {
        // An instance without any plan says nothing of who was asked.
        let solvable = || {
            planner
                .cases
                .iter()
                .filter(|case| best[case.instance].is_finite())
        };
        solvable().next()?;
        let over = |value: &dyn Fn(&Row, f64) -> f64| -> Vec<Clustered> {
            let of_case = |case: &Case<'_>| {
                let best = best[case.instance];
                let values = case.repeats.iter().map(|row| value(row, best));
                Some((case.cluster, mean(&sorted(values))?))
            };
            solvable().filter_map(of_case).collect()
        };
        let mean_of =
            |values: &[Clustered]| mean(&sorted(values.iter().map(|value| value.1))).unwrap_or(0.0);
        let share = |value: &dyn Fn(&Row, f64) -> f64| mean_of(&over(value));
        let integrals = over(&primal_integral);
        Some(Self {
            planner: planner.label.to_string(),
            primal_integral: mean_of(&integrals),
            interval: clustered_mean_interval(&integrals),
            targets: PARTS
                .map(|part| share(&|row, best| hit(gap_by(row, best, part * row.budget_ms)))),
            within: GAPS.map(|target| {
                share(&|row, best| f64::from(u8::from(gap_by(row, best, f64::INFINITY) <= target)))
            }),
            equal_time: equal_time(planner, best, ends),
        })
    }
}

/// Mean gap of a planner when the first of all had ended, and at the end.
fn equal_time(planner: &Planner<'_>, best: &[f64], ends: &[f64]) -> Option<[f64; 2]> {
    let ended = || {
        let cases = planner.cases.iter();
        cases.filter(|case| best[case.instance].is_finite() && ends[case.instance].is_finite())
    };
    let of = |until: &dyn Fn(&Case<'_>) -> f64| {
        let gaps = ended().filter_map(|case| {
            let gaps =
                (case.repeats.iter()).map(|row| gap_by(row, best[case.instance], until(case)));
            mean(&sorted(gaps))
        });
        mean(&sorted(gaps))
    };
    Some([of(&|case| ends[case.instance])?, of(&|_| f64::INFINITY)?])
}

/// 1 − C\*/C; everybody at the goal from the beginning is as good as can be.
fn gap(cost: f64, best: f64) -> f64 {
    // Of whole costs whose gap is a target it is that number: one less a share would be rounded beyond it.
    if cost > 0.0 {
        (cost - best) / cost
    } else {
        0.0
    }
}

/// The smallest gap of a trial's plans until then; 1 without any.
fn gap_by(row: &Row, best: f64, time_ms: f64) -> f64 {
    let plans = valid_plans(row).filter(|plan| plan.0 <= time_ms);
    plans.map(|plan| gap(plan.1, best)).fold(1.0, f64::min)
}

fn primal_integral(row: &Row, best: f64) -> f64 {
    let mut plans: Vec<(f64, f64)> = valid_plans(row).collect();
    plans.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (mut sum, mut from, mut now) = (0.0, 0.0, 1.0f64);
    for (time, cost) in plans {
        // A plan counts that came in time; the clock of its arrival may say a little more.
        let time = time.clamp(from, row.budget_ms.max(from));
        sum += now * (time - from);
        from = time;
        now = now.min(gap(cost, best));
    }
    sum += now * (row.budget_ms - from).max(0.0);
    if row.budget_ms > 0.0 {
        sum / row.budget_ms
    } else {
        now
    }
}
