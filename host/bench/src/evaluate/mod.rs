//! From rows to what tables and plots show. Whoever shows a number of a suite (reports,
//! Markdown, `compare`, scripts) has it from here, so that all show the same.
//!
//! A *case* is a planner on an instance with a seed and a budget. A task is one instance, whichever view of
//! it planners are given, and a planner on another view is another planner. Its success is the share of its
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
mod views;

pub use anytime::{Anytime, GAPS, PARTS, Reached, targets_reached};
pub use censored::{Censored, censored};
pub use curves::{
    BoxPlot, Cactus, Curve, CurvePoint, Mark, Scatter, ScatterPoint, box_plots, cactus,
    common_levels, curves, profiles, scatter,
};
pub use groups::{Dimension, Filter, Group, Level, groups};
pub use lead::{Lead, Rival, Success};
pub(crate) use metric::COMPARED;
pub use metric::{EXPANSIONS, METRICS, Metric, PATH_LENGTH, SOLVE_TIME};
pub use paired::{Against, Comparison, EQUIVALENT, Paired, compare_with};
pub(crate) use quality::best_of;
pub use quality::{Quality, QualityPoint, Reference, log_spaced, quality_over_time};
pub use ranking::{Order, RankStability, Ranked, Ranking, rank, rank_stability};
pub use runs::{
    Digests, MetricDifference, PlannerDifference, RunComparison, SettingDifference, TrialPair,
    compare_runs,
};
pub use standing::{Standing, VirtualBest};
pub use summary::{FailureCount, MetricSummary, Overview, PlannerSummary};
pub use trials::{Case, Planner, Trials};
pub use unit::{Counts, Unit};
pub use views::{ViewLine, WorldCosts};

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
    /// All of them together; absent without trials.
    pub virtual_best: Option<VirtualBest>,
    /// One per planner, in the suite's order; none where no planner sends plans on the way.
    pub anytime: Vec<Anytime>,
    /// Every planner's solve times against those of the best; absent with one planner.
    pub comparison: Option<Comparison>,
    /// The same of sums of costs; absent where nobody has one of an instance of which the
    /// first has one.
    pub costs: Option<Comparison>,
    /// Planners on views of tasks; none where no trial is of one.
    pub views: Vec<ViewLine>,
}

impl Evaluation {
    /// Of trials.
    pub fn of(trials: &Trials<'_>, order: Order) -> Self {
        let ranking = rank(trials, order);
        let shared = trials.shared();
        let summary = |ranked: &Ranked| {
            let planner = trials.planner(&ranked.planner)?;
            Some(PlannerSummary::of(planner, &shared))
        };
        let planners = ranking.planners.iter().filter_map(summary).collect();
        let best = (ranking.planners.first()).filter(|_| trials.planners().len() > 1);
        let compared = |metric| compare_with(trials, &best?.planner, metric);
        let of_tasks = trials.rows().any(|row| row.view.is_some());
        let cost = if of_tasks { "soc_s" } else { "soc_steps" };
        let costs = Metric::named(cost).and_then(compared);
        let some = |costs: &Comparison| costs.planners.iter().any(|one| one.paired.pairs > 0);
        let (standings, virtual_best) = Standing::all(trials, &ranking);
        Self {
            overview: Overview::of(trials),
            lead: Lead::of(trials, &ranking),
            standings,
            virtual_best,
            anytime: Anytime::all(trials),
            comparison: compared(&SOLVE_TIME),
            costs: costs.filter(some),
            views: ViewLine::all(trials),
            ranking,
            planners,
        }
    }
}

#[cfg(test)]
mod oracle;
#[cfg(test)]
mod tests;
