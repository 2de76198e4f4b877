use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;

use super::paired::{Pair, correct};
use super::{Case, METRICS, Metric, Paired, Planner, Success, Trials, Unit};
use crate::Row;

/// Two runs of one suite beside each other.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RunComparison {
    /// Trials that both have.
    pub pairs: usize,
    /// Trials that only the first has.
    pub only_in_a: usize,
    /// Trials that only the second has.
    pub only_in_b: usize,
    /// True if they ran on machines of the same description: otherwise their times can be compared
    /// only with care.
    pub same_machines: bool,
    /// Settings of the trials that differ between the runs.
    pub settings: Vec<SettingDifference>,
    /// Time for which threads of the calls waited for a processor, as a share of the calls, in
    /// either run; absent where one does not tell.
    pub run_delay: Option<[f64; 2]>,
    /// The unit that intervals and tests count, and the number of such units.
    pub unit: Unit,
    /// See `unit`.
    pub clusters: usize,
    /// Planners of both, by label.
    pub planners: Vec<PlannerDifference>,
}

/// A setting that is not the same in both runs.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct SettingDifference {
    /// The column that has it.
    pub name: &'static str,
    /// Values that only the first run has; all of its values, if the second has these too.
    pub a: Vec<String>,
    /// The same the other way round.
    pub b: Vec<String>,
}

/// A setting on which times depend: its column, and its value in a row.
type Setting = (&'static str, fn(&Row) -> Option<String>);
const SETTINGS: [Setting; 7] = [
    ("clock", |row| row.clock.clone()),
    ("threads", |row| {
        row.threads.map(|threads| threads.to_string())
    }),
    ("reuse", |row| row.reuse.clone()),
    ("attach", |row| Some(row.attach.clone())),
    ("options", |row| {
        Some(format!("{} {}", row.planner, row.options))
    }),
    ("fleet", |row| {
        let fleet = row.fleet.as_ref()?;
        Some(format!("{} {fleet}", row.planner))
    }),
    // Which processors is chance; having some is not.
    ("cpus", |row| {
        let own = row.clock.is_some().then_some(row.cpus.is_some())?;
        Some(if own { "of its own" } else { "shared" }.to_owned())
    }),
];

/// A planner in both runs, over the trials that both have.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PlannerDifference {
    /// Its label.
    pub planner: String,
    /// Trials that both runs have.
    pub pairs: usize,
    /// True if its code is the same; absent where a digest is.
    pub same_code: Option<bool>,
    /// Of those, successes in the first run.
    pub successes_a: usize,
    /// Of those, successes in the second run.
    pub successes_b: usize,
    /// Succeeded in the first run and failed in the second.
    pub lost: Vec<TrialPair>,
    /// Failed in the first run and succeeded in the second.
    pub won: Vec<TrialPair>,
    /// Successes of both runs, case by case; p is corrected for all planners.
    pub solved: Success,
    /// Its plans.
    pub plans: Digests,
    /// Traces of their executions.
    pub traces: Digests,
    /// Of every metric that both runs have; differences are second − first.
    pub metrics: Vec<MetricDifference>,
}

/// A metric in both runs.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MetricDifference {
    /// The column.
    pub metric: Metric,
    /// Over cases that both runs solved; corrected for all planners.
    #[serde(flatten)]
    pub paired: Paired,
}

/// Agreement of digests.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub struct Digests {
    /// Pairs with equal digests.
    pub same: usize,
    /// Pairs of which one side or both have none.
    pub absent: usize,
    /// Pairs with different digests.
    pub different: Vec<TrialPair>,
}

/// One trial in both runs.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct TrialPair {
    /// Its place in the first suite's order.
    pub a: u64,
    /// Its place in the second suite's order.
    pub b: u64,
}

/// The same question to the same planner, whatever its code is.
type Identity<'a> = (&'a str, &'a str, u64, u64, u32);

fn identity(row: &Row) -> Identity<'_> {
    let budget = row.budget_ms.to_bits();
    (
        &row.planner,
        &row.instance_digest,
        row.seed,
        budget,
        row.repeat,
    )
}

/// Compares two runs of one suite. Trials belong together that are of the same planner's
/// label, instance, seed, budget and repeat.
pub fn compare_runs<'a>(
    unit: Unit,
    a: impl IntoIterator<Item = &'a Row>,
    b: impl IntoIterator<Item = &'a Row>,
) -> RunComparison {
    let by_identity = |rows: &mut dyn Iterator<Item = &'a Row>| -> BTreeMap<Identity<'a>, &'a Row> {
        rows.map(|row| (identity(row), row)).collect()
    };
    let a = by_identity(&mut a.into_iter());
    let b = by_identity(&mut b.into_iter());
    let mut pairs: BTreeMap<&str, Vec<(&Row, &Row)>> = BTreeMap::new();
    for (identity, in_a) in &a {
        if let Some(in_b) = b.get(identity) {
            pairs.entry(identity.0).or_default().push((in_a, in_b));
        }
    }
    let count = pairs.values().map(Vec::len).sum();
    let machines = |rows: &BTreeMap<Identity<'_>, &'a Row>| -> Vec<&'a str> {
        let mut machines: Vec<&str> = rows.values().map(|row| row.machine.as_str()).collect();
        machines.sort_unstable();
        machines.dedup();
        machines
    };
    let settings = SETTINGS.iter().filter_map(|(name, of)| {
        let values = |which: fn(&(&'a Row, &'a Row)) -> &'a Row| -> BTreeSet<String> {
            let rows = pairs.values().flatten().map(which);
            rows.filter_map(of).collect()
        };
        let (a, b) = (values(|pair| pair.0), values(|pair| pair.1));
        let only = |own: &BTreeSet<String>, other: &BTreeSet<String>| -> Vec<String> {
            let only = own - other;
            let said = if only.is_empty() { own } else { &only };
            said.iter().cloned().collect()
        };
        // Rows of an earlier version do not say.
        let differs = !a.is_empty() && !b.is_empty() && a != b;
        differs.then(|| SettingDifference {
            name,
            a: only(&a, &b),
            b: only(&b, &a),
        })
    });
    let settings = settings.collect();
    let waited = |rows: &mut dyn Iterator<Item = &'a Row>| {
        let (mut delays, mut calls) = (0.0, 0.0);
        for row in rows {
            delays += row.run_delay_ms?;
            calls += row.planning_time_ms;
        }
        (calls > 0.0).then(|| delays / calls)
    };
    let run_delay = waited(&mut pairs.values().flatten().map(|pair| pair.0))
        .zip(waited(&mut pairs.values().flatten().map(|pair| pair.1)))
        .map(<[f64; 2]>::from);
    let clusters =
        Trials::speaking_for(unit, pairs.values().flatten().map(|pair| pair.0)).clusters();
    let mut planners: Vec<PlannerDifference> = pairs
        .into_iter()
        .map(|(planner, mut pairs)| {
            pairs.sort_by_key(|(in_a, in_b)| (in_a.trial, in_b.trial));
            difference(unit, planner, &pairs)
        })
        .collect();
    for metric in METRICS {
        let differences = planners.iter_mut().flat_map(|planner| &mut planner.metrics);
        let of_metric = differences.filter(|difference| difference.metric == *metric);
        Paired::correct(of_metric.map(|difference| &mut difference.paired));
    }
    let solved = planners.iter_mut().map(|planner| &mut planner.solved);
    correct(solved.filter_map(|solved| solved.p.as_mut()));
    RunComparison {
        pairs: count,
        only_in_a: a.len() - count,
        only_in_b: b.len() - count,
        same_machines: machines(&a) == machines(&b),
        settings,
        run_delay,
        unit,
        clusters,
        planners,
    }
}

fn difference(unit: Unit, planner: &str, pairs: &[(&Row, &Row)]) -> PlannerDifference {
    let which = |what: &dyn Fn(&Row, &Row) -> bool| -> Vec<TrialPair> {
        let found = pairs.iter().filter(|(a, b)| what(a, b));
        let pair = |(a, b): &(&Row, &Row)| TrialPair {
            a: a.trial,
            b: b.trial,
        };
        found.map(pair).collect()
    };
    let digests = |of: fn(&Row) -> Option<&String>| Digests {
        same: which(&|a, b| of(a).is_some() && of(a) == of(b)).len(),
        absent: which(&|a, b| of(a).is_none() || of(b).is_none()).len(),
        different: which(&|a, b| of(a).zip(of(b)).is_some_and(|(a, b)| a != b)),
    };
    let code = digests(|row| row.planner_digest.as_ref());
    let in_a = Trials::speaking_for(unit, pairs.iter().map(|pair| pair.0));
    let in_b = Trials::speaking_for(unit, pairs.iter().map(|pair| pair.1));
    let cases = match (in_a.planner(planner), in_b.planner(planner)) {
        (Some(a), Some(b)) => cases_of_both((&in_a, a), (&in_b, b)),
        _ => Vec::new(),
    };
    PlannerDifference {
        planner: planner.to_owned(),
        pairs: pairs.len(),
        same_code: (code.absent == 0).then_some(code.different.is_empty()),
        successes_a: which(&|a, _| a.success).len(),
        successes_b: which(&|_, b| b.success).len(),
        lost: which(&|a, b| a.success && !b.success),
        won: which(&|a, b| !a.success && b.success),
        plans: digests(|row| row.plan_digest.as_ref()),
        traces: digests(|row| row.trace_digest.as_ref()),
        solved: Success::of(cases.iter().copied()),
        metrics: metric_differences(&cases),
    }
}

/// Cases of the same questions.
fn cases_of_both<'a>(
    (in_a, a): (&Trials<'_>, &'a Planner<'a>),
    (in_b, b): (&Trials<'_>, &'a Planner<'a>),
) -> Vec<(&'a Case<'a>, &'a Case<'a>)> {
    // Instances are numbered in each run's own order.
    let question = |row: &Row| {
        (
            row.instance_digest.clone(),
            row.seed,
            row.budget_ms.to_bits(),
        )
    };
    let numbers: BTreeMap<_, usize> = (in_b.instances().iter().enumerate())
        .map(|(number, row)| (question(row), number))
        .collect();
    let of_both = |of_a: &'a Case<'a>| {
        let number = numbers.get(&question(in_a.instances()[of_a.instance]))?;
        Some((of_a, b.case(*number)?))
    };
    a.cases.iter().filter_map(of_both).collect()
}

fn metric_differences(cases: &[(&Case<'_>, &Case<'_>)]) -> Vec<MetricDifference> {
    let difference = |metric: &Metric| {
        let pair = |(of_a, of_b): &(&Case<'_>, &Case<'_>)| {
            Some(Pair {
                cluster: of_a.cluster,
                first: of_a.value(metric)?,
                second: of_b.value(metric)?,
            })
        };
        let pairs: Vec<Pair> = cases.iter().filter_map(pair).collect();
        (!pairs.is_empty()).then(|| MetricDifference {
            metric: *metric,
            paired: Paired::of(&pairs, cases.len() - pairs.len(), metric),
        })
    };
    METRICS.iter().filter_map(difference).collect()
}
