use std::collections::BTreeMap;

use serde::Serialize;

use super::ranking::Keys;
use super::{Case, Planner, Ranking, SOLVE_TIME, Trials};
use crate::Row;
use crate::statistics::{
    BOOTSTRAP_SEED, Clustered, Interval, bootstrap_clusters, clustered_mean_interval, mean,
    quantile, sorted,
};

/// Resamples of clusters in which planners are ranked.
const RESAMPLES: usize = 2000;

/// A planner beside all others where failures count: how sure its rank is, and success, time and
/// quality together.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Standing {
    /// Its label.
    pub planner: String,
    /// 95 % of its ranks lie from the one to the other when clusters are drawn anew; of six clusters
    /// or more.
    pub ranks: Option<[usize; 2]>,
    /// Share of those drawings in which it ranks first; equal planners both do.
    pub p_first: Option<f64>,
    /// Mean time with a failure counted as one, two and ten budgets (PAR-1, PAR-2, PAR-10).
    pub par_ms: [Option<f64>; 3],
    /// 95 % interval of PAR-1, which is the mean of min(t, budget); of six clusters or more.
    pub par_1_interval: Option<Interval>,
    /// Mean over cases of the best sum of costs of any planner over its own, zero where it failed;
    /// absent where no plan has a sum of costs.
    pub score: Option<f64>,
    /// Share of cases in which nobody was faster: how often the virtual best is this one.
    pub fastest: f64,
    /// Increase of the PAR-2 of the virtual best without it.
    pub contribution_ms: Option<f64>,
    /// Cases that it alone solved.
    pub alone: usize,
    /// No other planner is as good in success, PAR-2 and score and better in one of them.
    pub undominated: bool,
}

/// The virtual best solver: on every instance the planner that is best there.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct VirtualBest {
    /// Mean over instances of the largest share of repeats in which a planner succeeded.
    pub success_rate: f64,
    /// PAR-1, PAR-2 and PAR-10, of the planner with the least on each instance.
    pub par_ms: [Option<f64>; 3],
}

/// Times that a failure counts as, in budgets.
const PENALTIES: [f64; 3] = [1.0, 2.0, 10.0];

impl Standing {
    /// Of every planner, in the order of their ranks, and of all of them together.
    pub(super) fn all(trials: &Trials<'_>, ranking: &Ranking) -> (Vec<Self>, Option<VirtualBest>) {
        let ranks = resampled_ranks(trials, ranking);
        let best = Best::of(trials);
        let ranked = ranking.planners.iter().enumerate();
        let mut standings: Vec<Self> = ranked
            .filter_map(|(at, ranked)| {
                let planner = trials.planner(&ranked.planner)?;
                let drawn = sorted(ranks.iter().map(|ranks| ranks[at] as f64));
                Some(Self::of(planner, &drawn, &best))
            })
            .collect();
        let marks: Vec<[f64; 3]> = (standings.iter().zip(&ranking.planners))
            .map(|(standing, ranked)| {
                let slow = standing.par_ms[1].unwrap_or(f64::INFINITY);
                [ranked.success_rate, -slow, standing.score.unwrap_or(0.0)]
            })
            .collect();
        for (at, standing) in standings.iter_mut().enumerate() {
            let beats = |other: &[f64; 3]| {
                let pairs = || other.iter().zip(&marks[at]);
                pairs().all(|(other, own)| other >= own) && pairs().any(|(other, own)| other > own)
            };
            standing.undominated = !marks.iter().any(beats);
        }
        (standings, best.together())
    }

    fn of(planner: &Planner<'_>, drawn: &[f64], best: &Best) -> Self {
        let penalised = PENALTIES.map(|factor| -> Vec<Clustered> {
            let of_case = |case: &Case<'_>| (case.cluster, penalised(case, factor));
            planner.cases.iter().map(of_case).collect()
        });
        let mean_of = |values: &Vec<Clustered>| mean(&sorted(values.iter().map(|one| one.1)));
        let (mut fastest, mut alone, mut scores) = (0, 0, Vec::new());
        for case in &planner.cases {
            let best = &best.instances[case.instance];
            let is_fastest = case
                .value(&SOLVE_TIME)
                .is_some_and(|time| time <= best.time);
            fastest += usize::from(is_fastest);
            alone += usize::from(case.success() && best.solved == 1);
            if best.cost.is_finite() {
                scores.push(cost(case).map_or(0.0, |cost| ratio(best.cost, cost)));
            }
        }
        Self {
            planner: planner.label.to_string(),
            ranks: quantile(drawn, 0.025)
                .zip(quantile(drawn, 0.975))
                .map(|(low, high)| [low.floor() as usize, high.ceil() as usize]),
            p_first: (!drawn.is_empty())
                .then(|| drawn.partition_point(|rank| *rank < 1.5) as f64 / drawn.len() as f64),
            par_ms: penalised.each_ref().map(mean_of),
            par_1_interval: clustered_mean_interval(&penalised[0]).map(|found| Interval {
                // No time is negative.
                low: found.low.max(0.0),
                ..found
            }),
            score: mean(&sorted(scores)),
            fastest: fastest as f64 / planner.cases.len().max(1) as f64,
            contribution_ms: best.contribution_of(planner),
            alone,
            undominated: false,
        }
    }
}

/// Mean time of the repeats of a case, a failure counting as so many budgets.
fn penalised(case: &Case<'_>, factor: f64) -> f64 {
    let time = |row: &&Row| match (row.success, SOLVE_TIME.of(row)) {
        // Who is stopped at the budget with a plan takes a little longer than it.
        (true, Some(time)) => time.min(row.budget_ms),
        _ => factor * row.budget_ms,
    };
    mean(&sorted(case.repeats.iter().map(time))).unwrap_or(f64::INFINITY)
}

/// C*/C; everybody at the goal from the beginning is as good as can be.
fn ratio(best: f64, cost: f64) -> f64 {
    if cost > 0.0 { best / cost } else { 1.0 }
}

/// The sum of costs of a case that succeeded: the median over its repeats. Steps of a grid are no seconds in
/// the world of a task.
fn cost(case: &Case<'_>) -> Option<f64> {
    let mut costs = ["soc_s", "soc_steps"].into_iter();
    costs.find_map(|column| case.value(super::Metric::named(column)?))
}

/// The virtual best of all planners on an instance.
#[derive(Clone)]
struct BestOf {
    time: f64,
    cost: f64,
    solved: usize,
    share: f64,
    /// By penalty, the least of any planner.
    penalised: [f64; 3],
    /// The second least by the second penalty: the least without the best planner.
    others: f64,
    budget_ms: f64,
}

struct Best {
    instances: Vec<BestOf>,
}

impl Best {
    fn of(trials: &Trials<'_>) -> Self {
        let none = BestOf {
            time: f64::INFINITY,
            cost: f64::INFINITY,
            solved: 0,
            share: 0.0,
            penalised: [f64::INFINITY; 3],
            others: f64::INFINITY,
            budget_ms: 0.0,
        };
        let mut instances = vec![none; trials.instances().len()];
        for (best, row) in instances.iter_mut().zip(trials.instances()) {
            best.budget_ms = row.budget_ms;
        }
        for case in trials.planners().iter().flat_map(|planner| &planner.cases) {
            let best = &mut instances[case.instance];
            best.time = best
                .time
                .min(case.value(&SOLVE_TIME).unwrap_or(f64::INFINITY));
            best.cost = best.cost.min(cost(case).unwrap_or(f64::INFINITY));
            best.solved += usize::from(case.success());
            best.share = best.share.max(case.share());
            let own = PENALTIES.map(|factor| penalised(case, factor));
            // The second of all, also where two are equal.
            best.others = best.others.min(best.penalised[1].max(own[1]));
            for (least, own) in best.penalised.iter_mut().zip(own) {
                *least = least.min(own);
            }
        }
        Self { instances }
    }

    fn together(&self) -> Option<VirtualBest> {
        let mean_of = |of: &dyn Fn(&BestOf) -> f64| mean(&sorted(self.instances.iter().map(of)));
        Some(VirtualBest {
            success_rate: mean_of(&|best| best.share)?,
            par_ms: [0, 1, 2].map(|at| mean_of(&|best| best.penalised[at])),
        })
    }

    /// Time lost without the planner on the instances where it alone is the best: there the next
    /// one takes its place, or none. A mean over instances, in milliseconds.
    fn contribution_of(&self, planner: &Planner<'_>) -> Option<f64> {
        let lost = planner.cases.iter().map(|case| {
            let best = &self.instances[case.instance];
            let is_best = penalised(case, PENALTIES[1]) <= best.penalised[1];
            let without = best.others.min(PENALTIES[1] * best.budget_ms);
            if is_best {
                (without - best.penalised[1]).max(0.0)
            } else {
                0.0
            }
        });
        let lost: f64 = sorted(lost).iter().sum();
        (!self.instances.is_empty()).then(|| lost / self.instances.len() as f64)
    }
}

/// By resample of clusters, the rank of every planner; equal ones have the same. None under six
/// clusters.
fn resampled_ranks(trials: &Trials<'_>, ranking: &Ranking) -> Vec<Vec<usize>> {
    let shared = trials.shared();
    let planners = ranking.planners.iter();
    let planners: Vec<Vec<(usize, Keys)>> = planners
        .filter_map(|ranked| trials.planner(&ranked.planner))
        .map(|planner| {
            let mut clusters: BTreeMap<usize, Vec<&Case<'_>>> = BTreeMap::new();
            for case in &planner.cases {
                clusters.entry(case.cluster).or_default().push(case);
            }
            let keys = clusters.into_iter();
            keys.map(|(cluster, cases)| (cluster, Keys::sums(&cases, &shared)))
                .collect()
        })
        .collect();
    let mut resamples = Vec::new();
    let rank = |drawn: &[u32]| -> Vec<usize> {
        let means: Vec<Keys> = planners
            .iter()
            .map(|clusters| {
                let mut sums = Keys::default();
                for (cluster, keys) in clusters {
                    sums.add(keys, f64::from(drawn[*cluster]));
                }
                sums
            })
            .collect();
        let over_shared = means.iter().any(Keys::has_shared);
        let is_before = |a: &Keys, b: &Keys| a.order(b, ranking, over_shared).is_lt();
        means
            .iter()
            .map(|own| 1 + means.iter().filter(|other| is_before(other, own)).count())
            .collect()
    };
    // The interval is of no use here: the ranks of all planners are of the same draws.
    bootstrap_clusters(trials.clusters(), RESAMPLES, BOOTSTRAP_SEED, |drawn| {
        resamples.push(rank(drawn));
        Some(0.0)
    });
    resamples
}
