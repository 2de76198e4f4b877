//! From rows to what tables and plots show. Whoever shows a number of a suite (reports,
//! Markdown, `compare`, scripts) has it from here, so that all show the same.
//!
//! A *case* is a planner on an instance with a seed and a budget. Its success is the share of its
//! repeats that succeeded, and its values are their medians, if all did. Cases are in *clusters*:
//! those of one scenario, unless a suite says otherwise ([`Unit`]). Rates and means are over cases;
//! intervals and tests count clusters, because what is in one is alike.
//! Values other than the overall mean time are of cases that succeeded, and stand beside
//! the number of those that they leave out.
//!
//! Everything is sorted and depends on the rows alone, not on their order.

mod anytime;
mod censored;
mod curves;
mod groups;
mod lead;
mod metric;
mod paired;
mod quality;
mod ranking;
mod runs;
mod standing;
mod summary;
mod trials;
mod unit;

pub use anytime::{Anytime, GAPS, PARTS, Reached, targets_reached};
pub use censored::{Censored, censored};
pub use curves::{
    BoxPlot, Cactus, Curve, CurvePoint, Mark, Scatter, ScatterPoint, box_plots, cactus,
    common_levels, curves, profiles, scatter,
};
pub use groups::{Dimension, Filter, Group, Level, groups};
pub use lead::{Lead, Rival, Success};
pub use metric::{EXPANSIONS, METRICS, Metric, PATH_LENGTH, SOLVE_TIME};
pub use paired::{Comparison, EQUIVALENT, Paired, compare_with};
pub(crate) use quality::best_of;
pub use quality::{Quality, QualityPoint, Reference, log_spaced, quality_over_time};
pub use ranking::{Order, RankStability, Ranked, Ranking, rank, rank_stability};
pub use runs::{
    Digests, MetricDifference, PlannerDifference, RunComparison, SettingDifference, TrialPair,
    compare_runs,
};
pub use standing::Standing;
pub use summary::{FailureCount, MetricSummary, Overview, PlannerSummary};
pub use trials::{Case, Planner, Trials};
pub use unit::{Counts, Unit};

use serde::Serialize;

/// The findings of a suite: the tables of a report.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Evaluation {
    /// The amount of trials, and what stands in the way of comparing them.
    pub overview: Overview,
    /// Planners in the order of their ranks.
    pub ranking: Ranking,
    /// The tests of the first of them; absent with one planner, and where nothing was solved.
    pub lead: Option<Lead>,
    /// One per planner, in the order of their ranks.
    pub planners: Vec<PlannerSummary>,
    /// One per planner, in the order of their ranks.
    pub standings: Vec<Standing>,
    /// One per planner, in the suite's order; none where no planner sends plans on the way.
    pub anytime: Vec<Anytime>,
    /// Every planner's solve times against those of the best; absent with one planner.
    pub comparison: Option<Comparison>,
}

impl Evaluation {
    /// Of trials.
    pub fn of(trials: &Trials<'_>, order: Order) -> Self {
        let ranking = rank(trials, order);
        let summary = |ranked: &Ranked| {
            let planner = trials.planner(&ranked.planner)?;
            Some(PlannerSummary::of(planner))
        };
        let planners = ranking.planners.iter().filter_map(summary).collect();
        let best = ranking.planners.first();
        let comparison = best
            .filter(|_| trials.planners().len() > 1)
            .and_then(|best| compare_with(trials, &best.planner, &SOLVE_TIME));
        Self {
            overview: Overview::of(trials),
            lead: Lead::of(trials, &ranking),
            standings: Standing::all(trials, &ranking),
            anytime: Anytime::all(trials),
            ranking,
            planners,
            comparison,
        }
    }
}

#[cfg(test)]
mod tests;
