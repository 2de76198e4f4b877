//! Every column once more: from the rows alone, as its documentation has it, in slow and plain loops.

use std::collections::{BTreeMap, BTreeSet};

use fleetyard_world::SeededRandom;

use super::*;
use crate::statistics::{
    Clustered, Weighted, clustered_mean_interval, clustered_share_interval, median_interval,
    paired_rate_difference, quantile, sign_flip_test, sign_test, sorted, weighted_mean_interval,
    weighted_share_interval,
};
use crate::verify::comparable;
use crate::{Incumbent, Row};

const BUDGET_MS: f64 = 1000.0;

/// Four planners on nine scenarios of three maps with one to three repeats. One of them is not asked
/// everything, and much is a matter of chance.
fn suite(seed: u64) -> Vec<Row> {
    let mut random = SeededRandom::new("suite", seed);
    let mut rows = Vec::new();
    for scenario in 0..9 {
        for agents in [10, 20] {
            for planner in 0..4 {
                if planner == 3 && scenario == 8 {
                    continue;
                }
                for repeat in 0..=(scenario % 3) {
                    let number = rows.len() as u64;
                    let one = trial(&mut random, scenario, agents, planner, repeat, number);
                    rows.push(one);
                }
            }
        }
    }
    rows
}

fn trial(
    random: &mut SeededRandom,
    scenario: u32,
    agents: u64,
    planner: u32,
    repeat: u32,
    number: u64,
) -> Row {
    let mut chance = |percent: usize| random.below(100) < percent;
    // The first solves nearly all, the last a half of what is hard, and the last map is hard.
    let success = chance(98 - 10 * planner as usize * (1 + scenario as usize / 6));
    let soc = 100 + u64::from(scenario) * 10 + u64::from(chance(50)) * 5 + u64::from(planner);
    let (contended, ranked, lying) = (chance(20), chance(80), chance(15));
    let (plan, sends, wrong) = (chance(70), chance(60), chance(25));
    let time = (1 + random.below(40 + 10 * planner as usize)) as f64 * 0.5;
    let way = random.below(3);
    let mut incumbents = Vec::new();
    if planner.is_multiple_of(2) && sends {
        for (at, more) in [40, 20, 10].into_iter().enumerate() {
            incumbents.push(Incumbent {
                time_ms: time * (at + 1) as f64 * 5.0,
                soc_steps: Some(soc + more),
                valid: Some(!(wrong && at == 1)),
            });
        }
    }
    Row {
        key: format!("{number}"),
        trial: number,
        planner: format!("p{planner}"),
        planner_id: format!("org.p{planner}"),
        planner_version: if wrong { "1.1" } else { "1.0" }.into(),
        planner_digest: plan.then(|| format!("code {wrong}")),
        options: "{}".into(),
        instance_digest: format!("{scenario} with {agents}"),
        map: format!("map {}", scenario / 3),
        scenario: format!("scenario {scenario}"),
        machine: format!("machine {}", scenario % 2),
        agents,
        connectivity: Some(4),
        budget_ms: BUDGET_MS,
        repeat,
        ranked,
        built_in: Some(true),
        contended: if contended { "others" } else { "" }.into(),
        termination: if success {
            "completed"
        } else if plan {
            "timed-out"
        } else {
            "crashed"
        }
        .into(),
        claim: success.then(|| "solved".into()),
        false_claims: lying.then(|| format!("of {number}")),
        plan_digest: success.then(|| format!("plan {plan}")),
        success,
        valid: success,
        solve_time_ms: if success { time } else { BUDGET_MS },
        planning_time_ms: if success || !plan {
            10.0 * time
        } else {
            BUDGET_MS
        },
        soc_steps: success.then_some(soc),
        lower_bound_steps: Some(90 + u64::from(scenario) * 10),
        path_length_cells: success.then_some((20 + 2 * way) as f64),
        expansions: (success && way > 0).then_some((way * 100) as f64),
        incumbents,
        ..Row::default()
    }
}

/// The trials of a planner on an instance.
struct Asked<'a> {
    planner: &'a str,
    instance: &'a str,
    /// Map and scenario.
    cluster: (&'a str, &'a str),
    rows: Vec<&'a Row>,
}

impl Asked<'_> {
    fn solved(&self) -> bool {
        self.rows.iter().all(|row| row.success)
    }

    fn share(&self) -> f64 {
        self.rows.iter().filter(|row| row.success).count() as f64 / self.rows.len() as f64
    }

    /// The median of all repeats, if all have one.
    fn any(&self, of: Read) -> Option<f64> {
        let values: Option<Vec<f64>> = self.rows.iter().map(|row| of(row)).collect();
        Some(median(values?))
    }

    fn value(&self, of: Read) -> Option<f64> {
        if self.solved() { self.any(of) } else { None }
    }

    fn time(&self) -> Option<f64> {
        self.value(time)
    }

    fn penalised(&self, factor: f64) -> f64 {
        mean(self.rows.iter().map(|row| {
            if row.success {
                row.solve_time_ms
            } else {
                factor * BUDGET_MS
            }
        }))
        .unwrap()
    }
}

type Read = fn(&Row) -> Option<f64>;

fn time(row: &Row) -> Option<f64> {
    Some(row.solve_time_ms).filter(|time| time.is_finite())
}

fn cost(row: &Row) -> Option<f64> {
    row.soc_steps.map(|steps| steps as f64)
}

fn length(row: &Row) -> Option<f64> {
    row.path_length_cells
}

fn expansions(row: &Row) -> Option<f64> {
    row.expansions
}

fn mean(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    let values: Vec<f64> = values.into_iter().collect();
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let (low, high) = (values[(values.len() - 1) / 2], values[values.len() / 2]);
    f64::midpoint(low, high)
}

fn cases(rows: &[Row]) -> Vec<Asked<'_>> {
    let mut cases: Vec<Asked<'_>> = Vec::new();
    for row in rows {
        let same = |case: &&mut Asked<'_>| {
            case.planner == row.planner && case.instance == row.instance_digest
        };
        match cases.iter_mut().find(same) {
            Some(case) => case.rows.push(row),
            None => cases.push(Asked {
                planner: &row.planner,
                instance: &row.instance_digest,
                cluster: (&row.map, &row.scenario),
                rows: vec![row],
            }),
        }
    }
    cases
}

/// Values with the numbers of their clusters.
fn numbered<'a>(values: impl IntoIterator<Item = ((&'a str, &'a str), f64)>) -> Vec<Clustered> {
    let mut numbers = BTreeMap::new();
    let values = values.into_iter().map(|(cluster, value)| {
        let next = numbers.len();
        (*numbers.entry(cluster).or_insert(next), value)
    });
    values.collect()
}

/// Means of values by cluster.
fn by_cluster<'a>(values: impl IntoIterator<Item = ((&'a str, &'a str), f64)>) -> Vec<f64> {
    let mut clusters: BTreeMap<(&str, &str), Vec<f64>> = BTreeMap::new();
    for (cluster, value) in values {
        clusters.entry(cluster).or_default().push(value);
    }
    clusters.into_values().filter_map(mean).collect()
}

#[track_caller]
fn near(found: impl Into<Option<f64>>, wanted: impl Into<Option<f64>>) {
    let (found, wanted) = (found.into(), wanted.into());
    let is_near = match (found, wanted) {
        (Some(found), Some(wanted)) => (found - wanted).abs() <= 1e-9 * wanted.abs().max(1.0),
        (found, wanted) => found == wanted,
    };
    assert!(is_near, "{found:?} is not {wanted:?}");
}

/// p-values after Holm: each of m times as many as are not smaller, and none before a smaller one.
fn holm(p: &[f64]) -> Vec<f64> {
    let corrected = |own: f64| {
        let of = |one: &f64| one * p.iter().filter(|other| *other >= one).count() as f64;
        let smaller = p.iter().filter(|one| **one <= own).map(of);
        smaller.fold(0.0, f64::max).min(1.0)
    };
    p.iter().map(|own| corrected(*own)).collect()
}

/// The figures of a suite's rows, in the order of its planners.
struct Told<'a> {
    cases: Vec<Asked<'a>>,
    planners: Vec<&'a str>,
    instances: Vec<&'a str>,
    shared: BTreeSet<&'a str>,
}

impl<'a> Told<'a> {
    fn of(rows: &'a [Row]) -> Self {
        let cases = cases(rows);
        let distinct = |of: fn(&Asked<'a>) -> &'a str| {
            let mut found = Vec::new();
            for case in &cases {
                if !found.contains(&of(case)) {
                    found.push(of(case));
                }
            }
            found
        };
        let (planners, instances) = (
            distinct(|case| case.planner),
            distinct(|case| case.instance),
        );
        let by_all = |instance: &&&str| {
            let solve = |planner: &&str| {
                let mut asked = cases.iter();
                asked.any(|case| {
                    case.planner == *planner && case.instance == **instance && case.solved()
                })
            };
            planners.iter().all(solve)
        };
        let shared = instances.iter().filter(by_all).copied().collect();
        Self {
            cases,
            planners,
            instances,
            shared,
        }
    }

    fn of_planner(&self, planner: &str) -> Vec<&Asked<'a>> {
        let cases = self.cases.iter();
        cases.filter(|case| case.planner == planner).collect()
    }

    fn of_instance(&self, instance: &str) -> Vec<&Asked<'a>> {
        let cases = self.cases.iter();
        cases.filter(|case| case.instance == instance).collect()
    }

    /// Pairs of cases of two planners on the same instances.
    fn pairs(&self, first: &str, second: &str) -> Vec<(&Asked<'a>, &Asked<'a>)> {
        let mut pairs = Vec::new();
        for one in self.of_planner(first) {
            for other in self.of_planner(second) {
                if one.instance == other.instance {
                    pairs.push((one, other));
                }
            }
        }
        pairs
    }

    /// Mean of values over the instances that all solved.
    fn over_shared(&self, planner: &str, of: Read) -> Option<f64> {
        let cases = self.of_planner(planner).into_iter();
        let shared = cases.filter(|case| self.shared.contains(case.instance));
        mean(shared.filter_map(|case| case.value(of)))
    }

    fn success_rate(&self, planner: &str) -> f64 {
        mean(self.of_planner(planner).iter().map(|case| case.share())).unwrap()
    }

    /// The best plan of anybody on an instance, and who came first to an end by itself.
    fn best_plan(&self, instance: &str) -> (f64, f64) {
        let (mut best, mut end) = (f64::INFINITY, f64::INFINITY);
        for row in self
            .of_instance(instance)
            .iter()
            .flat_map(|case| &case.rows)
        {
            for (_, cost) in plans(row) {
                best = best.min(cost);
            }
            if row.success && comparable(row) {
                end = end.min(row.planning_time_ms);
            }
        }
        (best, end)
    }
}

/// Times and costs of all valid plans of a trial.
fn plans(row: &Row) -> Vec<(f64, f64)> {
    let mut plans = Vec::new();
    for plan in &row.incumbents {
        if plan.valid == Some(true) {
            plans.push((plan.time_ms, plan.soc_steps.unwrap() as f64));
        }
    }
    if let Some(cost) = row.soc_steps.filter(|_| row.valid) {
        let last = row.incumbents.last();
        plans.push((
            last.map_or(row.planning_time_ms, |plan| plan.time_ms),
            cost as f64,
        ));
    }
    plans
}

fn gap_at(row: &Row, best: f64, time_ms: f64) -> f64 {
    let in_time = plans(row).into_iter().filter(|plan| plan.0 <= time_ms);
    in_time.map(|plan| 1.0 - best / plan.1).fold(1.0, f64::min)
}

fn seeds() -> impl Iterator<Item = Vec<Row>> {
    (0..6).map(suite)
}

#[test]
fn overviews_and_summaries_are_what_rows_say() {
    for rows in seeds() {
        let told = Told::of(&rows);
        let found = Evaluation::of(&Trials::new(&rows), Order::Text);
        let count = |what: &dyn Fn(&Row) -> bool| rows.iter().filter(|row| what(row)).count();
        let wanted = Overview {
            trials: rows.len(),
            failures: count(&|row| !row.success),
            planners: 4,
            instances: told.instances.len(),
            counts: Counts {
                instances: 18,
                scenarios: 9,
                maps: 3,
            },
            unit: Unit::Scenarios,
            clusters: 9,
            shared: told.shared.len(),
            repeats_min: 1,
            repeats_max: 3,
            descriptive: true,
            contended: count(&|row| row.contended == "others"),
            unranked: count(&|row| !row.ranked),
            machines: vec!["machine 0".into(), "machine 1".into()],
        };
        assert_eq!(found.overview, wanted);
        assert!(!told.shared.is_empty() && told.shared.len() < told.instances.len());
        for summary in &found.planners {
            let own = told.of_planner(&summary.planner);
            let trials: Vec<&Row> = own.iter().flat_map(|case| case.rows.clone()).collect();
            let count = |what: &dyn Fn(&Row) -> bool| trials.iter().filter(|row| what(row)).count();
            let distinct = |of: &dyn Fn(&Row) -> Option<String>| -> Vec<String> {
                let texts: BTreeSet<String> = trials.iter().filter_map(|row| of(row)).collect();
                texts.into_iter().collect()
            };
            let solved = own.iter().filter(|case| case.solved()).count();
            assert_eq!((summary.trials, summary.cases), (trials.len(), own.len()));
            assert_eq!(summary.planner_id, format!("org.{}", summary.planner));
            assert_eq!(summary.options, "{}");
            assert_eq!(
                summary.versions,
                distinct(&|row| Some(row.planner_version.clone()))
            );
            assert_eq!(summary.digests, distinct(&|row| row.planner_digest.clone()));
            assert_eq!(
                (summary.successes, summary.failures),
                (solved, own.len() - solved)
            );
            near(summary.success_rate, told.success_rate(&summary.planner));
            let shares = numbered(own.iter().map(|case| (case.cluster, case.share())));
            assert_eq!(summary.success_interval, clustered_share_interval(&shares));
            let mut reasons = Vec::new();
            for reason in ["crashed", "timed-out"] {
                match count(&|row| row.termination == reason) {
                    0 => {}
                    trials => reasons.push((trials, reason)),
                }
            }
            // The most frequent one first, and else by its name.
            reasons.sort_by_key(|reason| std::cmp::Reverse(reason.0));
            let found: Vec<(usize, &str)> = (summary.reasons.iter())
                .map(|reason| (reason.trials, reason.reason.as_str()))
                .collect();
            assert_eq!(found, reasons);
            let unsteady = own
                .iter()
                .filter(|case| case.share() > 0.0 && case.share() < 1.0);
            assert_eq!(summary.unsteady, unsteady.count());
            let differ = own.iter().filter(|case| {
                let plans: BTreeSet<&String> = (case.rows.iter())
                    .filter(|row| comparable(row))
                    .filter_map(|row| row.plan_digest.as_ref())
                    .collect();
                plans.len() > 1
            });
            assert_eq!(summary.different_plans, differ.count());
            assert_eq!(
                summary.false_claims,
                count(&|row| row.false_claims.is_some())
            );
            let first = trials.iter().find_map(|row| row.false_claims.clone());
            assert_eq!(summary.false_claim, first);
            assert_eq!(summary.contended, count(&|row| row.contended == "others"));
            assert_eq!(summary.unranked, count(&|row| !row.ranked));
            near(
                summary.mean_time_of_all_ms,
                mean(own.iter().filter_map(|case| case.any(time))),
            );
            let columns: [(&str, Read); 4] = [
                ("solve_time_ms", time),
                ("soc_steps", cost),
                ("path_length_cells", length),
                ("expansions", expansions),
            ];
            for (column, of) in columns {
                let values: Vec<_> = (own.iter())
                    .filter_map(|case| Some((case.cluster, case.value(of)?)))
                    .collect();
                let found = summary.metric(Metric::named(column).unwrap()).unwrap();
                assert_eq!(summary.column(column), Some(&found.summary));
                assert_eq!(found.summary.count, values.len());
                assert_eq!(found.left_out, own.len() - values.len());
                near(found.summary.mean, mean(values.iter().map(|value| value.1)));
                near(
                    found.summary.median,
                    median(values.iter().map(|one| one.1).collect()),
                );
                near(found.shared_mean, told.over_shared(&summary.planner, of));
                let interval = clustered_mean_interval(&numbered(values));
                let ends = [found.summary.mean_interval, interval];
                let [found, wanted] = ends.map(|ends| ends.map(|ends| (ends.low, ends.high)));
                near(found.map(|ends| ends.0), wanted.map(|ends| ends.0));
                near(found.map(|ends| ends.1), wanted.map(|ends| ends.1));
            }
            assert_eq!(summary.column("rtf"), None);
        }
    }
}

#[test]
fn rankings_and_standings_are_what_rows_say() {
    for (seed, rows) in seeds().enumerate() {
        let told = Told::of(&rows);
        let order = if seed % 2 == 0 {
            Order::Text
        } else {
            Order::Appendix
        };
        let found = Evaluation::of(&Trials::new(&rows), order);
        let ranking = &found.ranking;
        assert_eq!((ranking.order, ranking.by_expansions), (order, true));
        assert_eq!((ranking.shared, ranking.instances), (told.shared.len(), 18));
        let mut marks = Vec::new();
        for (at, ranked) in ranking.planners.iter().enumerate() {
            let own = told.of_planner(&ranked.planner);
            let solved = own.iter().filter(|case| case.solved()).count();
            assert_eq!(
                (ranked.rank, ranked.cases, ranked.successes),
                (at + 1, own.len(), solved)
            );
            near(ranked.success_rate, told.success_rate(&ranked.planner));
            near(
                ranked.comparable_time_ms,
                told.over_shared(&ranked.planner, time),
            );
            near(
                ranked.comparable_length_cells,
                told.over_shared(&ranked.planner, length),
            );
            near(
                ranked.expansions,
                mean(own.iter().filter_map(|case| case.value(expansions))),
            );
            near(
                ranked.mean_time_ms,
                mean(own.iter().filter_map(|case| case.any(time))),
            );
            assert_eq!((ranked.uncertainty_ms, ranked.near), (None, false));
        }
        let worse = ranking.planners.windows(2).filter(|two| {
            (two[0].success_rate, two[1].comparable_time_ms)
                < (two[1].success_rate, two[0].comparable_time_ms)
        });
        assert_eq!(worse.count(), 0);
        for standing in &found.standings {
            let own = told.of_planner(&standing.planner);
            for (found, factor) in standing.par_ms.iter().zip([1.0, 2.0, 10.0]) {
                near(*found, mean(own.iter().map(|case| case.penalised(factor))));
            }
            let par = numbered(own.iter().map(|case| (case.cluster, case.penalised(1.0))));
            let (interval, own_interval) = (clustered_mean_interval(&par), standing.par_1_interval);
            near(own_interval.unwrap().low, interval.unwrap().low.max(0.0));
            near(own_interval.unwrap().high, interval.unwrap().high);
            let (mut scores, mut fastest, mut alone, mut lost) = (Vec::new(), 0, 0, 0.0);
            for case in &own {
                let others: Vec<&Asked<'_>> = (told.of_instance(case.instance).into_iter())
                    .filter(|other| other.planner != case.planner)
                    .collect();
                let least = |of: &dyn Fn(&Asked<'_>) -> Option<f64>| {
                    let values = others.iter().filter_map(|other| of(other));
                    values.fold(f64::INFINITY, f64::min)
                };
                let best = least(&|other| other.value(cost))
                    .min(case.value(cost).unwrap_or(f64::INFINITY));
                if best.is_finite() {
                    scores.push(case.value(cost).map_or(0.0, |cost| best / cost));
                }
                let time = case.time();
                fastest +=
                    usize::from(time.is_some_and(|time| time <= least(&|other| other.time())));
                alone += usize::from(case.solved() && others.iter().all(|other| !other.solved()));
                let without = least(&|other| Some(other.penalised(2.0))).min(2.0 * BUDGET_MS);
                lost += (without - case.penalised(2.0)).max(0.0);
            }
            near(standing.score, mean(scores));
            near(standing.fastest, fastest as f64 / own.len() as f64);
            assert_eq!(standing.alone, alone);
            near(standing.contribution_ms, lost / told.instances.len() as f64);
            let rate = told.success_rate(&standing.planner);
            marks.push((rate, -standing.par_ms[1].unwrap(), standing.score.unwrap()));
        }
        for (standing, own) in found.standings.iter().zip(&marks) {
            let beaten = marks.iter().any(|other| {
                other != own && other.0 >= own.0 && other.1 >= own.1 && other.2 >= own.2
            });
            assert_eq!(standing.undominated, !beaten);
        }
        let best = found.virtual_best.unwrap();
        let of_all = |of: &dyn Fn(&Asked<'_>) -> f64, fold: fn(f64, f64) -> f64, none: f64| {
            let instances = told.instances.iter();
            mean(instances.map(|one| told.of_instance(one).into_iter().map(of).fold(none, fold)))
        };
        near(
            best.success_rate,
            of_all(&|case| case.share(), f64::max, 0.0),
        );
        for (found, factor) in best.par_ms.iter().zip([1.0, 2.0, 10.0]) {
            let least = of_all(&|case| case.penalised(factor), f64::min, f64::INFINITY);
            near(*found, least);
        }
    }
}

/// Ranks in resamples against such as are drawn here: by the same rules, and by other draws.
#[test]
fn ranks_are_as_sure_as_resamples_say() {
    for rows in seeds().take(3) {
        let told = Told::of(&rows);
        let found = Evaluation::of(&Trials::new(&rows), Order::Text);
        let clusters: Vec<(&str, &str)> = (told.cases.iter().map(|case| case.cluster))
            .collect::<BTreeSet<_>>()
            .into_iter()
            .collect();
        let mut random = SeededRandom::new("resamples", 7);
        let mut ranks: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
        for _ in 0..1000 {
            let drawn: Vec<_> = clusters.iter().map(|_| clusters[random.below(9)]).collect();
            let keys = |planner: &str| -> [f64; 4] {
                let own = told.of_planner(planner);
                let over = |of: &dyn Fn(&Asked<'_>) -> Option<f64>| {
                    let cases = drawn.iter().flat_map(|cluster| {
                        own.iter().filter(move |case| case.cluster == *cluster)
                    });
                    mean(cases.filter_map(|case| of(case))).unwrap_or(f64::INFINITY)
                };
                let shared = |case: &Asked<'_>| {
                    let is_shared = told.shared.contains(case.instance);
                    case.time().filter(|_| is_shared)
                };
                [
                    -over(&|case| Some(case.share())),
                    over(&shared),
                    over(&|case| case.value(expansions)),
                    over(&|case| case.any(time)),
                ]
            };
            let keys: Vec<[f64; 4]> = told.planners.iter().map(|planner| keys(planner)).collect();
            for (planner, own) in told.planners.iter().zip(&keys) {
                let before = keys.iter().filter(|other| *other < own).count();
                ranks.entry(planner).or_default().push(1.0 + before as f64);
            }
        }
        for standing in &found.standings {
            let ranks = sorted(ranks[standing.planner.as_str()].iter().copied());
            let first = ranks.iter().filter(|rank| **rank < 1.5).count() as f64 / 1000.0;
            assert!(
                (standing.p_first.unwrap() - first).abs() < 0.06,
                "{standing:?} {first}"
            );
            // Ends may be one off where a rank is had in 2.5 % of draws.
            let wanted = [0.01, 0.04, 0.96, 0.99].map(|level| quantile(&ranks, level).unwrap());
            let [low, high] = standing.ranks.unwrap().map(|rank| rank as f64);
            assert!(
                low >= wanted[0].floor() && low <= wanted[1],
                "{standing:?} {wanted:?}"
            );
            assert!(
                high >= wanted[2] && high <= wanted[3].ceil(),
                "{standing:?} {wanted:?}"
            );
        }
    }
}

/// Rows with one repeat of each, and one scenario for each instance.
fn single(rows: Vec<Row>) -> Vec<Row> {
    let kept = rows
        .into_iter()
        .filter(|row| row.repeat == 0 && row.agents == 10);
    kept.collect()
}

#[test]
fn comparisons_are_what_rows_say() {
    for (seed, rows) in seeds().enumerate() {
        let rows = if seed % 2 == 0 { rows } else { single(rows) };
        let told = Told::of(&rows);
        let trials = Trials::new(&rows);
        for metric in [&SOLVE_TIME, Metric::named("soc_steps").unwrap()] {
            let of = if *metric == SOLVE_TIME { time } else { cost };
            let found = compare_with(&trials, "p1", metric).unwrap();
            assert_eq!((found.baseline.as_str(), found.descriptive), ("p1", true));
            assert_eq!((found.metric, found.unit), (*metric, Unit::Scenarios));
            let (mut p, mut p_solved, mut order) = (Vec::new(), Vec::new(), Vec::new());
            for against in &found.planners {
                let pairs = told.pairs("p1", &against.planner);
                let values: Vec<_> = (pairs.iter())
                    .filter_map(|(one, other)| {
                        Some((one.cluster, one.value(of)?, other.value(of)?))
                    })
                    .collect();
                let paired = &against.paired;
                assert_eq!(paired.pairs, values.len());
                assert_eq!(paired.left_out, told.instances.len() - values.len());
                near(paired.mean_first, mean(values.iter().map(|one| one.1)));
                near(paired.mean_second, mean(values.iter().map(|one| one.2)));
                let deltas = by_cluster(values.iter().map(|one| (one.0, one.2 - one.1)));
                let logs = by_cluster(values.iter().map(|one| (one.0, (one.2 / one.1).ln())));
                assert_eq!(paired.clusters, deltas.len());
                near(paired.median_delta, median(deltas.clone()));
                let ratios: Vec<f64> = logs.iter().map(|log| log.exp()).collect();
                near(paired.median_ratio, median(ratios.clone()));
                let greater = logs.iter().filter(|log| **log > 0.0).count();
                let smaller = logs.iter().filter(|log| **log < 0.0).count();
                assert_eq!((paired.greater, paired.smaller), (greater, smaller));
                assert_eq!(paired.tied, logs.len() - greater - smaller);
                let interval = |values: Vec<f64>| Some(median_interval(&sorted(values))?.0);
                for (found, wanted) in [
                    (paired.delta_interval, interval(deltas.clone())),
                    (paired.ratio_interval, interval(ratios)),
                ] {
                    near(
                        found.map(|found| found.low),
                        wanted.map(|wanted| wanted.low),
                    );
                    near(
                        found.map(|found| found.high),
                        wanted.map(|wanted| wanted.high),
                    );
                }
                let enough = deltas.len() >= 6;
                let sign = enough.then(|| sign_test(greater as u64, smaller as u64));
                assert_eq!(paired.p, sign);
                assert_eq!(paired.posterior.is_some(), enough && *metric == SOLVE_TIME);
                p.extend(paired.p);
                order.push((median(deltas), against.planner.clone()));
                p_solved.push(solved_is(&pairs, &against.solved, seed % 2 == 1));
            }
            let mut ascending = order.clone();
            ascending.sort_by(|a, b| a.0.total_cmp(&b.0).then_with(|| a.1.cmp(&b.1)));
            assert_eq!(order, ascending);
            let corrected: Vec<f64> = found
                .planners
                .iter()
                .filter_map(|one| one.paired.p_holm)
                .collect();
            for (found, wanted) in corrected.iter().zip(holm(&p)) {
                near(*found, wanted);
            }
            assert_eq!(corrected.len(), p.len());
            let of_solved = found
                .planners
                .iter()
                .map(|against| against.solved.p.unwrap());
            for (found, wanted) in of_solved.zip(holm(&p_solved)) {
                near(found, wanted);
            }
        }
    }
}

/// Checks all but p, which is given as it is before it is corrected.
fn solved_is(pairs: &[(&Asked<'_>, &Asked<'_>)], found: &Success, single: bool) -> f64 {
    let count = |one: bool, other: bool| {
        let same = pairs
            .iter()
            .filter(|pair| (pair.0.solved(), pair.1.solved()) == (one, other));
        same.count()
    };
    let counts = [(true, true), (true, false), (false, true), (false, false)];
    let counts = counts.map(|(one, other)| count(one, other));
    assert_eq!(
        [found.both, found.first, found.second, found.neither],
        counts
    );
    let differences = || {
        pairs
            .iter()
            .map(|(one, other)| (one.cluster, one.share() - other.share()))
    };
    near(found.difference, mean(differences().map(|one| one.1)));
    let interval = if single {
        let [both, first, second, neither] = counts.map(|count| count as u64);
        paired_rate_difference(both, first, second, neither)
            .unwrap()
            .1
    } else {
        clustered_mean_interval(&numbered(differences())).unwrap()
    };
    near(found.interval.unwrap().low, interval.low.max(-1.0));
    near(found.interval.unwrap().high, interval.high.min(1.0));
    sign_flip_test(
        &by_cluster(differences()),
        crate::statistics::BOOTSTRAP_SEED,
    )
    .unwrap()
}

#[test]
fn leads_are_what_rows_say() {
    for rows in seeds() {
        let told = Told::of(&rows);
        let found = Evaluation::of(&Trials::new(&rows), Order::Text);
        let (lead, ranking) = (found.lead.unwrap(), &found.ranking.planners);
        assert_eq!(lead.planner, ranking[0].planner);
        let rivals: Vec<&String> = lead.rivals.iter().map(|rival| &rival.planner).collect();
        let others: Vec<&String> = ranking[1..].iter().map(|ranked| &ranked.planner).collect();
        assert_eq!(rivals, others);
        // Two tests of each: of successes and, of six clusters or more, of times.
        let mut p = Vec::new();
        for rival in &lead.rivals {
            let pairs = told.pairs(&lead.planner, &rival.planner);
            p.push(Some(solved_is(&pairs, &rival.solved, false)));
            let both = pairs
                .iter()
                .filter_map(|(one, other)| Some((one.cluster, (other.time()? / one.time()?).ln())));
            let logs = by_cluster(both);
            let count = |what: fn(f64) -> bool| logs.iter().filter(|log| what(**log)).count();
            let (slower, faster) = (count(|log| log > 0.0), count(|log| log < 0.0));
            assert_eq!((rival.slower, rival.faster), (slower, faster));
            p.push((logs.len() >= 6).then(|| sign_test(slower as u64, faster as u64)));
        }
        let known: Vec<f64> = p.iter().copied().flatten().collect();
        let mut corrected = holm(&known).into_iter();
        let p: Vec<Option<f64>> = (p.iter())
            .map(|p| p.and_then(|_| corrected.next()))
            .collect();
        for (rival, p) in lead.rivals.iter().zip(p.chunks(2)) {
            near(rival.solved.p, p[0]);
            near(rival.p_time, p[1]);
            let difference = rival.solved.difference.unwrap();
            let is_sure = |p: Option<f64>| p.is_some_and(|p| p < 0.05);
            let by_success = is_sure(p[0]) && difference > 0.0;
            let by_time = is_sure(p[1]) && rival.slower > rival.faster && difference >= 0.0;
            assert_eq!(rival.behind, by_success || by_time);
        }
        assert_eq!(
            lead.is_shown(),
            lead.rivals.iter().all(|rival| rival.behind)
        );
    }
}

#[test]
fn plans_over_time_are_what_rows_say() {
    let times = [5.0, 20.0, 45.0, 100.0, 400.0, 1000.0];
    for rows in seeds() {
        let told = Told::of(&rows);
        let trials = Trials::new(&rows);
        let found = Evaluation::of(&trials, Order::Text);
        assert_eq!(found.anytime.len(), 4);
        let reached = targets_reached(&trials, &times);
        for ((anytime, reached), planner) in found.anytime.iter().zip(&reached).zip(&told.planners)
        {
            assert_eq!(
                (anytime.planner.as_str(), reached.planner.as_str()),
                (*planner, *planner)
            );
            let own = told.of_planner(planner);
            let solvable: Vec<&&Asked<'_>> = (own.iter())
                .filter(|case| told.best_plan(case.instance).0.is_finite())
                .collect();
            // Means over repeats, and then over cases.
            let of_case = |case: &Asked<'_>, of: &dyn Fn(&Row) -> f64| {
                mean(case.rows.iter().map(|row| of(row))).unwrap()
            };
            let over = |of: &dyn Fn(&Row, f64) -> f64| {
                let value = |case: &&&Asked<'_>| {
                    let best = told.best_plan(case.instance).0;
                    of_case(case, &|row| of(row, best))
                };
                mean(solvable.iter().map(value)).unwrap()
            };
            let area = |row: &Row, best: f64| {
                let steps = 4_000;
                let step = BUDGET_MS / f64::from(steps);
                let gap = |at: u32| gap_at(row, best, (f64::from(at) + 0.5) * step);
                (0..steps).map(gap).sum::<f64>() / f64::from(steps)
            };
            assert!((anytime.primal_integral - over(&area)).abs() < 1e-3);
            let integrals = solvable.iter().map(|case| {
                let best = told.best_plan(case.instance).0;
                (case.cluster, of_case(case, &|row| area(row, best)))
            });
            let interval = clustered_mean_interval(&numbered(integrals)).unwrap();
            assert!((anytime.interval.unwrap().low - interval.low).abs() < 1e-3);
            assert!((anytime.interval.unwrap().high - interval.high).abs() < 1e-3);
            let hit = |gap: f64| GAPS.iter().filter(|target| gap <= **target).count() as f64 / 4.0;
            for (found, part) in anytime.targets.iter().zip(PARTS) {
                near(
                    *found,
                    over(&|row, best| hit(gap_at(row, best, part * BUDGET_MS))),
                );
            }
            for (found, target) in anytime.within.iter().zip(GAPS) {
                let is_within = |row: &Row, best: f64| gap_at(row, best, f64::INFINITY) <= target;
                near(
                    *found,
                    over(&|row, best| f64::from(u8::from(is_within(row, best)))),
                );
            }
            let ended = || (own.iter()).filter(|case| told.best_plan(case.instance).1.is_finite());
            for (at, found) in anytime.equal_time.unwrap().into_iter().enumerate() {
                let gaps = ended().map(|case| {
                    let (best, end) = told.best_plan(case.instance);
                    let until = if at == 0 { end } else { f64::INFINITY };
                    of_case(case, &|row| gap_at(row, best, until))
                });
                near(found, mean(gaps));
            }
            for (time_ms, share) in times.iter().zip(&reached.shares) {
                near(*share, over(&|row, best| hit(gap_at(row, best, *time_ms))));
            }
        }
        for reference in [Reference::LowerBound, Reference::Best] {
            for quality in quality_over_time(&trials, reference, &times) {
                let own = told.of_planner(&quality.planner);
                assert_eq!((quality.cases, quality.reference), (own.len(), reference));
                for (point, time_ms) in quality.points.iter().zip(times) {
                    let ratios: Vec<_> = own
                        .iter()
                        .filter_map(|case| {
                            let best = |row: &&Row| {
                                let in_time =
                                    plans(row).into_iter().filter(|plan| plan.0 <= time_ms);
                                in_time.map(|plan| plan.1).reduce(f64::min)
                            };
                            let costs: Option<Vec<f64>> = case.rows.iter().map(best).collect();
                            let divisor = match reference {
                                Reference::LowerBound => {
                                    case.rows[0].lower_bound_steps.unwrap() as f64
                                }
                                Reference::Best => told.best_plan(case.instance).0,
                            };
                            Some((case.cluster, median(costs?) / divisor))
                        })
                        .collect();
                    assert_eq!((point.with_plan, point.time_ms), (ratios.len(), time_ms));
                    near(point.mean_ratio, mean(ratios.iter().map(|ratio| ratio.1)));
                    let interval = clustered_mean_interval(&numbered(ratios));
                    near(
                        point.interval.map(|one| one.high),
                        interval.map(|one| one.high),
                    );
                }
                assert_eq!(quality.points.len(), times.len());
            }
        }
    }
}

#[test]
fn curves_and_box_plots_are_what_rows_say() {
    for rows in seeds() {
        let told = Told::of(&rows);
        let trials = Trials::new(&rows);
        let levels: Vec<String> = (common_levels(&trials, Dimension::Agents).into_iter())
            .map(|level| level.text)
            .collect();
        assert_eq!(levels, ["10", "20"]);
        for curve in curves(&trials, Dimension::Agents, &SOLVE_TIME) {
            assert_eq!(curve.points.len(), 2);
            for point in &curve.points {
                let own: Vec<&Asked<'_>> = (told.of_planner(&curve.planner).into_iter())
                    .filter(|case| case.rows[0].agents.to_string() == point.level.text)
                    .collect();
                let solved = own.iter().filter(|case| case.solved());
                assert_eq!((point.cases, point.successes), (own.len(), solved.count()));
                // Each map counts as much as any other.
                let weighted = |of: &dyn Fn(&Asked<'_>) -> Option<f64>| -> Vec<Weighted> {
                    let mut all = Vec::new();
                    for map in ["map 0", "map 1", "map 2"] {
                        let with = own.iter().filter(|case| case.cluster.0 == map);
                        let values: Vec<_> = with
                            .filter_map(|case| Some((case.cluster.1, of(case)?)))
                            .collect();
                        all.extend(values.iter().map(|(scenario, value)| Weighted {
                            cluster: scenario[9..].parse().unwrap(),
                            value: *value,
                            weight: 1.0 / values.len() as f64,
                        }));
                    }
                    all
                };
                let mean = |values: &[Weighted]| {
                    let weight: f64 = values.iter().map(|one| one.weight).sum();
                    values.iter().map(|one| one.value * one.weight).sum::<f64>() / weight
                };
                let shares = weighted(&|case| Some(case.share()));
                near(point.success_rate, mean(&shares));
                let wanted = weighted_share_interval(&shares).unwrap();
                near(point.success_interval.unwrap().low, wanted.low);
                near(point.success_interval.unwrap().high, wanted.high);
                let values = weighted(&|case| case.time());
                assert_eq!(point.left_out, own.len() - values.len());
                let summary = point.values.unwrap();
                near(summary.mean, mean(&values));
                let most = values.iter().map(|one| one.value);
                near(summary.max, most.fold(0.0, f64::max));
                let wanted = weighted_mean_interval(&values);
                near(
                    summary.mean_interval.map(|found| found.low),
                    wanted.map(|wanted| wanted.low),
                );
            }
        }
        let solved = cactus(&trials, &SOLVE_TIME);
        for (plot, solved) in box_plots(&trials, &SOLVE_TIME).iter().zip(&solved) {
            let own = told.of_planner(&plot.planner);
            let values = sorted(own.iter().filter_map(|case| case.time()));
            let marks: Vec<f64> = solved.marks.iter().map(|mark| mark.value).collect();
            assert_eq!((solved.cases, &marks), (own.len(), &values));
            assert_eq!(
                (plot.left_out, plot.not_positive),
                (own.len() - values.len(), 0)
            );
            let (q1, q3) = (plot.summary.q1.ln(), plot.summary.q3.ln());
            let reach = 1.5 * (q3 - q1) + 1e-9;
            let is_inner = |value: &&f64| (q1 - reach..=q3 + reach).contains(&value.ln());
            let inner: Vec<f64> = values.iter().filter(is_inner).copied().collect();
            near(plot.whisker_low, inner[0].min(plot.summary.q1));
            near(
                plot.whisker_high,
                inner[inner.len() - 1].max(plot.summary.q3),
            );
            assert_eq!(plot.outliers.len(), values.len() - inner.len());
        }
    }
}
