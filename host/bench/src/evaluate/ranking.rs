use std::cmp::Ordering;
use std::collections::BTreeMap;

use fleetyard_core::words;
use serde::Serialize;

use super::summary::rate;
use super::{
    Case, Dimension, EXPANSIONS, Level, Metric, PATH_LENGTH, Planner, SOLVE_TIME, Trials, groups,
    metric::UNCERTAINTY,
};
use crate::Row;
use crate::statistics::{kendall_tau_b, mean, sorted};

/// The order of planners in a ranking: figures that count one after the other. The maze paper gives
/// two that are not the same.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Order {
    /// As its text: success rate, comparable time, expansions, overall time, name. Length is
    /// reported and does not rank.
    #[default]
    Text,
    /// As its equation 23: success rate, comparable time, comparable length, expansions,
    /// overall time, name.
    Appendix,
}

words!(Order {
    Text = "text", "Success rate, comparable time, expansions, overall time: the paper's text";
    Appendix = "appendix", "With comparable length after the time: the paper's equation 23";
});

impl Order {
    /// For people, with expansions or without.
    pub fn description(self, by_expansions: bool) -> String {
        let length = match self {
            Self::Text => "",
            Self::Appendix => "comparable mean length, ",
        };
        let expansions = if by_expansions {
            "mean expansions, "
        } else {
            ""
        };
        format!(
            "success rate (descending), then comparable mean time, {length}{expansions}overall mean \
             time, name"
        )
    }
}

/// A planner's rank, and what it is ranked by.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Ranked {
    /// From 1; planners that are equal in all of it have the same.
    pub rank: usize,
    /// Its label.
    pub planner: String,
    /// Cases of which every repeat succeeded.
    pub successes: usize,
    /// Cases.
    pub cases: usize,
    /// Equation 18; of repeats, the mean over cases of their share.
    pub success_rate: f64,
    /// Equation 20: mean time over shared successes; over all its cases if there are none.
    pub comparable_time_ms: Option<f64>,
    /// Uncertainty of that time: the mean uncertainty of the empty calls that are subtracted.
    pub uncertainty_ms: Option<f64>,
    /// True if that time is no farther from that of the planner before than both uncertainties.
    pub near: bool,
    /// Equation 21: mean length over shared successes; over its own if there are none.
    pub comparable_length_cells: Option<f64>,
    /// Equation 22: mean expansions over its successes.
    pub expansions: Option<f64>,
    /// Equation 22: mean time over all its cases.
    pub mean_time_ms: Option<f64>,
}

/// Planners in the order of their ranks.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Ranking {
    /// The order of the ranking.
    pub order: Order,
    /// Instances that every planner solved.
    pub shared: usize,
    /// All instances.
    pub instances: usize,
    /// True if comparable means are over shared successes; else there were none.
    pub over_shared: bool,
    /// True if expansions rank: only if every planner is a part of the host. Those of others are
    /// their claim.
    pub by_expansions: bool,
    /// Best first.
    pub planners: Vec<Ranked>,
}

/// Ranks planners by the equations 18 to 23 of the maze paper. Whoever lacks a value comes after
/// those that have one.
pub fn rank(trials: &Trials<'_>, order: Order) -> Ranking {
    let shared = trials.shared();
    let by_expansions = trials.rows().all(|row| row.built_in == Some(true));
    let planners = trials.planners().iter();
    let mut ranked: Vec<Ranked> = planners.map(|planner| ranked(planner, &shared)).collect();
    ranked.sort_by(|a, b| {
        let by_keys = by(order, by_expansions, &a.keys(), &b.keys());
        by_keys.then_with(|| a.planner.cmp(&b.planner))
    });
    let (mut before, mut equal) = (None, (0, KeyValues::default()));
    for (at, planner) in ranked.iter_mut().enumerate() {
        let keys = planner.keys();
        if equal.0 == 0 || by(order, by_expansions, &equal.1, &keys).is_ne() {
            equal = (at + 1, keys);
        }
        planner.rank = equal.0;
        let here = planner.comparable_time_ms.zip(planner.uncertainty_ms);
        planner.near = before
            .zip(here)
            .is_some_and(|(before, here)| within(before, here));
        before = here;
    }
    Ranking {
        order,
        shared: shared.len(),
        instances: trials.instances().len(),
        over_shared: !shared.is_empty(),
        by_expansions,
        planners: ranked,
    }
}

/// The values that planners are ranked by, without their names; planners that lack a value come
/// last.
type KeyValues = [Option<f64>; 5];

fn by(order: Order, by_expansions: bool, a: &KeyValues, b: &KeyValues) -> Ordering {
    let [success, time, length, expansions, overall] = [0, 1, 2, 3, 4].map(|at| {
        let value = |keys: &KeyValues| keys[at].unwrap_or(f64::INFINITY);
        value(a).total_cmp(&value(b))
    });
    let length = match order {
        Order::Text => Ordering::Equal,
        Order::Appendix => length,
    };
    let expansions = if by_expansions {
        expansions
    } else {
        Ordering::Equal
    };
    // A higher success rate comes first.
    let success = success.reverse();
    success
        .then(time)
        .then(length)
        .then(expansions)
        .then(overall)
}

impl Ranked {
    fn keys(&self) -> KeyValues {
        [
            Some(self.success_rate),
            self.comparable_time_ms,
            self.comparable_length_cells,
            self.expansions,
            self.mean_time_ms,
        ]
    }
}

/// Sums and counts of what planners are ranked by, of the cases of a cluster or of some.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Keys {
    success: (f64, f64),
    shared_time: (f64, f64),
    shared_length: (f64, f64),
    own_length: (f64, f64),
    expansions: (f64, f64),
    time: (f64, f64),
}

impl Keys {
    /// Of cases; `shared` are the instances that every planner solved, ascending.
    pub(super) fn sums(cases: &[&Case<'_>], shared: &[usize]) -> Self {
        let mut sums = Self::default();
        let add = |to: &mut (f64, f64), value: Option<f64>| {
            to.0 += value.unwrap_or(0.0);
            to.1 += f64::from(u8::from(value.is_some()));
        };
        for case in cases {
            add(&mut sums.success, Some(case.share()));
            if shared.binary_search(&case.instance).is_ok() {
                add(&mut sums.shared_time, case.value(&SOLVE_TIME));
                add(&mut sums.shared_length, case.value(&PATH_LENGTH));
            }
            add(&mut sums.own_length, case.value(&PATH_LENGTH));
            add(&mut sums.expansions, case.value(&EXPANSIONS));
            add(&mut sums.time, case.any_value(&SOLVE_TIME));
        }
        sums
    }

    /// Adds those of a cluster, as often as it was drawn.
    pub(super) fn add(&mut self, other: &Self, times: f64) {
        let add = |to: &mut (f64, f64), from: (f64, f64)| {
            to.0 += times * from.0;
            to.1 += times * from.1;
        };
        add(&mut self.success, other.success);
        add(&mut self.shared_time, other.shared_time);
        add(&mut self.shared_length, other.shared_length);
        add(&mut self.own_length, other.own_length);
        add(&mut self.expansions, other.expansions);
        add(&mut self.time, other.time);
    }

    /// Some of them are of an instance that every planner solved.
    pub(super) fn has_shared(&self) -> bool {
        self.shared_time.1 > 0.0
    }

    /// The order of two planners, as in a ranking.
    pub(super) fn order(&self, other: &Self, ranking: &Ranking, over_shared: bool) -> Ordering {
        let keys = |of: &Self| {
            let mean = |(sum, count): (f64, f64)| (count > 0.0).then(|| sum / count);
            let (time, length) = if over_shared {
                (of.shared_time, of.shared_length)
            } else {
                (of.time, of.own_length)
            };
            [of.success, time, length, of.expansions, of.time].map(mean)
        };
        by(
            ranking.order,
            ranking.by_expansions,
            &keys(self),
            &keys(other),
        )
    }
}

/// True if two times are no farther from each other than both uncertainties.
fn within((a, by_a): (f64, f64), (b, by_b): (f64, f64)) -> bool {
    (a - b).abs() <= by_a + by_b
}

/// Everything but the rank.
fn ranked(planner: &Planner<'_>, shared: &[usize]) -> Ranked {
    // Of sorted values, so that a sum does not depend on the order of instances.
    let mean = |values: Vec<f64>| mean(&sorted(values));
    let over_shared = |metric: &Metric| -> Option<f64> {
        let cases = planner.of_instances(shared);
        mean(cases.filter_map(|case| case.value(metric)).collect())
    };
    let cases = planner.cases.iter();
    let mean_time_ms = mean(
        cases
            .filter_map(|case| case.any_value(&SOLVE_TIME))
            .collect(),
    );
    let own = |metric: &Metric| {
        mean(
            planner
                .values(metric)
                .into_iter()
                .map(|one| one.1)
                .collect(),
        )
    };
    let over = |metric: &Metric| {
        if shared.is_empty() {
            own(metric)
        } else {
            over_shared(metric)
        }
    };
    let (comparable_time_ms, comparable_length_cells) = if shared.is_empty() {
        (mean_time_ms, over(&PATH_LENGTH))
    } else {
        (over(&SOLVE_TIME), over(&PATH_LENGTH))
    };
    let (successes, cases) = (planner.successes().count(), planner.cases.len());
    Ranked {
        rank: 0,
        planner: planner.label.to_string(),
        successes,
        cases,
        success_rate: rate(&planner.shares()),
        comparable_time_ms,
        uncertainty_ms: over(&UNCERTAINTY),
        near: false,
        comparable_length_cells,
        expansions: own(&EXPANSIONS),
        mean_time_ms,
    }
}

/// Agreement of rankings where instances differ.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RankStability {
    /// The dimensions by which the regimes differ.
    pub by: Vec<Dimension>,
    /// The order of every ranking.
    pub order: Order,
    /// Planners that took part in every regime, by label.
    pub planners: Vec<String>,
    /// The regimes.
    pub regimes: Vec<Vec<Option<Level>>>,
    /// By regime, the rank of every planner among `planners`, from 1.
    pub ranks: Vec<Vec<usize>>,
    /// Kendall's τ-b of every regime with every other; `None` with fewer than two planners.
    pub tau: Vec<Vec<Option<f64>>>,
    /// Mean of τ over all pairs of regimes.
    pub mean_tau: Option<f64>,
    /// Smallest τ of all pairs of regimes.
    pub min_tau: Option<f64>,
}

/// Ranks planners in every regime, and compares the rankings.
pub fn rank_stability<'a>(
    rows: impl IntoIterator<Item = &'a Row>,
    by: &[Dimension],
    order: Order,
) -> RankStability {
    let groups = groups(rows, by);
    let rankings: Vec<BTreeMap<String, usize>> = groups
        .iter()
        .map(|group| {
            let ranking = rank(&Trials::new(group.rows.iter().copied()), order);
            let ranked = ranking.planners.into_iter();
            ranked.map(|ranked| (ranked.planner, ranked.rank)).collect()
        })
        .collect();
    let first = rankings.first().into_iter().flat_map(BTreeMap::keys);
    let in_all = |planner: &&String| rankings.iter().all(|found| found.contains_key(*planner));
    let planners: Vec<String> = first.filter(in_all).cloned().collect();
    let ranks: Vec<Vec<usize>> = rankings
        .iter()
        .map(|ranking| {
            let common: Vec<usize> = planners.iter().map(|planner| ranking[planner]).collect();
            let rank = |own: &usize| 1 + common.iter().filter(|other| *other < own).count();
            common.iter().map(rank).collect()
        })
        .collect();
    let number = |ranks: &[usize]| -> Vec<f64> { ranks.iter().map(|rank| *rank as f64).collect() };
    let tau = |a: &[usize], b: &[usize]| kendall_tau_b(&number(a), &number(b));
    let all: Vec<Vec<Option<f64>>> = ranks
        .iter()
        .map(|a| ranks.iter().map(|b| tau(a, b)).collect())
        .collect();
    let pairs = (0..all.len()).flat_map(|i| (0..i).map(move |j| (i, j)));
    let of_pairs = sorted(pairs.filter_map(|(i, j)| all[i][j]));
    RankStability {
        by: by.to_vec(),
        order,
        planners,
        regimes: groups.into_iter().map(|group| group.levels).collect(),
        ranks,
        mean_tau: mean(&of_pairs),
        min_tau: of_pairs.first().copied(),
        tau: all,
    }
}
