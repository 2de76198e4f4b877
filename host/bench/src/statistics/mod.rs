//! Statistics of trials: pure functions over slices, each with its formula and source.
//!
//! Values are finite; a function of values that do not determine its result (none, or
//! one where two are needed) returns `None`. Nothing here knows what a trial is:
//! `evaluate` asks, this answers. `docs/statistics.md` says when each is used.

mod bayes;
mod bootstrap;
mod cluster;
mod describe;
mod interval;
mod paired;
mod rank;
mod survival;

pub use bayes::{Posterior, bayesian_signed_rank};
pub use bootstrap::{BOOTSTRAP_SEED, RESAMPLES};
pub use cluster::{
    Clustered, MIN_CLUSTERS, Weighted, bootstrap_clusters, cluster_means, clustered_mean_interval,
    clustered_share_interval, sign_flip_test, weighted_mean, weighted_mean_interval,
    weighted_share_interval,
};
pub use describe::{Summary, mean, median, quantile, sorted, standard_deviation};
pub use interval::{
    CONFIDENCE, Interval, mean_interval, median_interval, paired_rate_difference, wilson,
};
pub use paired::{holm, sign_test};
pub use rank::kendall_tau_b;
pub use survival::{Survival, SurvivalStep, Time, log_rank_test};
