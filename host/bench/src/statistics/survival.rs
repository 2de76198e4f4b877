//! Times of which some are known to be longer than what was waited for: a planner that was stopped
//! at its budget would have taken longer.

use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF, Normal};

use super::{CONFIDENCE, Interval};

/// A time that is known, or known to be longer.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Time {
    /// Time of the end, or of the last look.
    pub value: f64,
    /// It ended then; else it was still going on.
    pub ended: bool,
}

/// The share that is still going on after a time: S(t) = Π_{tᵢ ≤ t} (1 − dᵢ/nᵢ), with dᵢ that end at tᵢ of
/// nᵢ that were watched until then.
///
/// Kaplan and Meier, "Nonparametric estimation from incomplete observations", Journal of the
/// American Statistical Association 53 (1958).
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Survival {
    /// By ascending time.
    pub steps: Vec<SurvivalStep>,
}

/// A time at which something ended.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SurvivalStep {
    /// The time.
    pub time: f64,
    /// Watched until then.
    pub at_risk: usize,
    /// Ended then.
    pub ended: usize,
    /// Share that goes on afterwards.
    pub survival: f64,
}

impl Survival {
    /// Of times in any order.
    pub fn of(times: &[Time]) -> Self {
        let mut survival = 1.0;
        let ascending = ascending(times);
        let steps = ends(&ascending).into_iter().map(|time| {
            let (at_risk, ended) = at(&ascending, time);
            survival *= (at_risk - ended) as f64 / at_risk as f64;
            SurvivalStep {
                time,
                at_risk,
                ended,
                survival,
            }
        });
        Self {
            steps: steps.collect(),
        }
    }

    /// The mean of min(t, `until`), which is the area below the curve, with its 95 % interval by the
    /// normal approximation with Greenwood's variance: Σ Aᵢ²·dᵢ/(nᵢ(nᵢ − dᵢ)), Aᵢ the area from tᵢ on.
    ///
    /// Royston and Parmar, "Restricted mean survival time", BMC Medical Research Methodology 13
    /// (2013).
    pub fn restricted_mean(&self, until: f64) -> (f64, Interval) {
        let within = self.steps.iter().filter(|step| step.time < until);
        let (mut area, mut variance) = (0.0, 0.0);
        let mut to = until;
        // From the last end backwards, so that the area from each one on is known.
        for step in within.rev() {
            area += (to - step.time) * step.survival;
            to = step.time;
            let left = step.at_risk - step.ended;
            if left > 0 {
                let (ended, at_risk) = (step.ended as f64, step.at_risk as f64);
                variance += area * area * ended / (at_risk * left as f64);
            }
        }
        let mean = area + to;
        let z = Normal::standard().inverse_cdf(f64::midpoint(1.0, CONFIDENCE));
        let half = z * variance.sqrt();
        let (low, high) = (mean - half, mean + half);
        (mean, Interval { low, high })
    }
}

/// Two-sided log-rank test that both go on as long: χ² = (Σ(d₁ᵢ − eᵢ))²/Σvᵢ with one degree of freedom,
/// eᵢ = dᵢ·n₁ᵢ/nᵢ and vᵢ = dᵢ(n₁ᵢ/nᵢ)(1 − n₁ᵢ/nᵢ)(nᵢ − dᵢ)/(nᵢ − 1). Without an end where both are watched it
/// is 1.
///
/// Mantel, "Evaluation of survival data and two new rank order statistics arising in its
/// consideration", Cancer Chemotherapy Reports 50 (1966). It assumes that times are independent,
/// and has little power where curves cross.
pub fn log_rank_test(first: &[Time], second: &[Time]) -> f64 {
    let both: Vec<Time> = first.iter().chain(second).copied().collect();
    let (both, first) = (ascending(&both), ascending(first));
    let (mut difference, mut variance) = (0.0, 0.0);
    for time in ends(&both) {
        let ((n, d), (n1, d1)) = (at(&both, time), at(&first, time));
        let (n, d, share) = (n as f64, d as f64, n1 as f64 / n as f64);
        difference += d1 as f64 - d * share;
        if n > 1.0 {
            variance += d * share * (1.0 - share) * (n - d) / (n - 1.0);
        }
    }
    if variance <= 0.0 {
        return 1.0;
    }
    ChiSquared::new(1.0).map_or(1.0, |chi| chi.sf(difference * difference / variance))
}

fn ascending(times: &[Time]) -> Vec<Time> {
    let mut times = times.to_vec();
    times.sort_by(|a, b| a.value.total_cmp(&b.value));
    times
}

/// Times of ends, ascending and each once.
fn ends(ascending: &[Time]) -> Vec<f64> {
    let ended = ascending.iter().filter(|time| time.ended);
    let mut ends: Vec<f64> = ended.map(|time| time.value).collect();
    ends.dedup();
    ends
}

/// Counts who is watched until a time, and who of them ends then.
fn at(ascending: &[Time], time: f64) -> (usize, usize) {
    let from = ascending.partition_point(|one| one.value < time);
    let then = ascending[from..].iter().take_while(|one| one.value <= time);
    (ascending.len() - from, then.filter(|one| one.ended).count())
}
