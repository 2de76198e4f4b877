use std::cmp::Ordering;

use serde::{Deserialize, Serialize};

use super::{
    Dimension, EXPANSIONS, Level, Metric, PATH_LENGTH, Planner, SOLVE_TIME, Trials, groups,
    metric::UNCERTAINTY,
};
use crate::Row;
use crate::statistics::{kendall_tau_b, mean, sorted};

/// By what planners are ranked, one after the other. The maze paper says it twice, and not
/// the same.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Order {
    /// As its text: success rate, comparable time, expansions, overall time, name. Length is
    /// reported and does not rank.
    #[default]
    Text,
    /// As its equation 23: success rate, comparable time, comparable length, expansions,
    /// overall time, name.
    Appendix,
}

impl Order {
    /// As suites name it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Text => "text",
            Self::Appendix => "appendix",
        }
    }

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
    /// From 1; no two planners have the same.
    pub rank: usize,
    /// Its label.
    pub planner: String,
    /// Cases that succeeded.
    pub successes: usize,
    /// Cases.
    pub cases: usize,
    /// Equation 18.
    pub success_rate: f64,
    /// Equation 20: mean time over shared successes; over all its cases if there are none.
    pub comparable_time_ms: Option<f64>,
    /// How far off that may be: the mean uncertainty of the empty calls that are subtracted.
    pub uncertainty_ms: Option<f64>,
    /// Whether that time is no farther from that of the planner before than both uncertainties.
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
    /// By what they are ranked.
    pub order: Order,
    /// Instances that every planner solved.
    pub shared: usize,
    /// All instances.
    pub instances: usize,
    /// Whether comparable means are over shared successes; else there were none.
    pub over_shared: bool,
    /// Whether expansions rank: only if every planner is a part of the host. Those of others
    /// are their claim.
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
        let ascending = |of: fn(&Ranked) -> Option<f64>| {
            let (a, b) = (
                of(a).unwrap_or(f64::INFINITY),
                of(b).unwrap_or(f64::INFINITY),
            );
            a.total_cmp(&b)
        };
        let length = match order {
            Order::Text => Ordering::Equal,
            Order::Appendix => ascending(|planner| planner.comparable_length_cells),
        };
        let expansions = if by_expansions {
            ascending(|planner| planner.expansions)
        } else {
            Ordering::Equal
        };
        b.success_rate
            .total_cmp(&a.success_rate)
            .then(ascending(|planner| planner.comparable_time_ms))
            .then(length)
            .then(expansions)
            .then(ascending(|planner| planner.mean_time_ms))
            .then_with(|| a.planner.cmp(&b.planner))
    });
    let mut before = None;
    for (at, planner) in ranked.iter_mut().enumerate() {
        planner.rank = at + 1;
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

/// Whether two times are no farther from each other than both uncertainties.
fn within((a, by_a): (f64, f64), (b, by_b): (f64, f64)) -> bool {
    (a - b).abs() <= by_a + by_b
}

/// Everything but the rank.
fn ranked(planner: &Planner<'_>, shared: &[usize]) -> Ranked {
    // Of sorted values, so that a sum does not depend on the order of instances.
    let mean = |values: Vec<f64>| mean(&sorted(values));
    let over_shared = |metric: &Metric| -> Option<f64> {
        let cases = shared.iter().filter_map(|instance| planner.case(*instance));
        mean(cases.filter_map(|case| case.value(metric)).collect())
    };
    let cases = planner.cases.iter();
    let mean_time_ms = mean(
        cases
            .filter_map(|case| case.any_value(&SOLVE_TIME))
            .collect(),
    );
    let over = |metric: &Metric| {
        if shared.is_empty() {
            mean(planner.values(metric))
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
        planner: planner.label.into(),
        successes,
        cases,
        success_rate: successes as f64 / cases.max(1) as f64,
        comparable_time_ms,
        uncertainty_ms: over(&UNCERTAINTY),
        near: false,
        comparable_length_cells,
        expansions: mean(planner.values(&EXPANSIONS)),
        mean_time_ms,
    }
}

/// Whether rankings agree where instances differ.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RankStability {
    /// What the regimes differ by.
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
    let rankings: Vec<Vec<String>> = groups
        .iter()
        .map(|group| {
            let ranking = rank(&Trials::new(group.rows.iter().copied()), order);
            ranking
                .planners
                .into_iter()
                .map(|ranked| ranked.planner)
                .collect()
        })
        .collect();
    let mut planners = rankings.first().cloned().unwrap_or_default();
    planners.retain(|planner| rankings.iter().all(|ranking| ranking.contains(planner)));
    planners.sort();
    let ranks: Vec<Vec<usize>> = rankings
        .iter()
        .map(|ranking| {
            let common: Vec<&String> = ranking
                .iter()
                .filter(|planner| planners.contains(planner))
                .collect();
            let rank = |planner| common.iter().position(|other| *other == planner);
            planners.iter().filter_map(rank).map(|at| at + 1).collect()
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
