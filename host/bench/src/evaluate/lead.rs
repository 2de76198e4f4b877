use serde::Serialize;

use super::paired::{correct, pairs};
use super::{Case, Paired, Planner, Ranking, SOLVE_TIME, Trials};
use crate::statistics::{
    BOOTSTRAP_SEED, Clustered, Interval, cluster_means, clustered_mean_interval, mean,
    paired_rate_difference, sign_flip_test, sorted,
};

/// A difference is told from chance below this.
const LEVEL: f64 = 0.05;

/// The planner that ranks first, and the tests that put it before every other, or do not.
///
/// They do where it solved more than the other, or was faster on what both solved and solved no
/// less. Both count clusters; all tests, two for each of the others, are corrected after Holm
/// together. Under six clusters there is no test.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Lead {
    /// Its label.
    pub planner: String,
    /// The others, in the order of their ranks.
    pub rivals: Vec<Rival>,
}

/// A planner against the one that ranks first.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Rival {
    /// Its label.
    pub planner: String,
    /// Successes of both.
    pub solved: Success,
    /// Clusters that this one takes more time for than the first, on what both solved.
    pub slower: usize,
    /// Clusters that this one takes less time for.
    pub faster: usize,
    /// The sign test of these two, corrected.
    pub p_time: Option<f64>,
    /// Tests put the first before it.
    pub behind: bool,
}

/// The successes of two planners on the instances that both were asked.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Success {
    /// Instances, by seed and budget, of which both solved every repeat.
    pub both: usize,
    /// Instances that the first alone solved.
    pub first: usize,
    /// Instances that the second alone solved.
    pub second: usize,
    /// Instances that neither solved.
    pub neither: usize,
    /// Success rate of the first less that of the second.
    pub difference: Option<f64>,
    /// Its 95 % interval, of six clusters or more: Newcombe's, where each cluster is one trial of
    /// either, and else that of a mean in clusters.
    pub interval: Option<Interval>,
    /// Sign flips of the clusters' differences, which is McNemar's exact test where each cluster is one
    /// trial of either; corrected for all tests of a [`Lead`], or all comparisons of a table.
    pub p: Option<f64>,
}

impl Success {
    /// Of two planners of the same trials.
    pub(crate) fn between(first: &Planner<'_>, second: &Planner<'_>) -> Self {
        let theirs = second.cases.iter();
        Self::of(theirs.filter_map(|theirs| Some((first.case(theirs.instance)?, theirs))))
    }

    /// Of cases of the same questions; clusters are those of the first.
    pub(super) fn of<'a>(pairs: impl Iterator<Item = (&'a Case<'a>, &'a Case<'a>)>) -> Self {
        let mut counts = [0; 4];
        let mut differences: Vec<Clustered> = Vec::new();
        let mut single = true;
        for (ours, theirs) in pairs {
            let at = match (ours.success(), theirs.success()) {
                (true, true) => 0,
                (true, false) => 1,
                (false, true) => 2,
                (false, false) => 3,
            };
            counts[at] += 1;
            differences.push((ours.cluster, ours.share() - theirs.share()));
            single &= ours.repeats.len() == 1 && theirs.repeats.len() == 1;
        }
        let [both, first, second, neither] = counts;
        let by_cluster = cluster_means(&differences);
        let interval = clustered_mean_interval(&differences).and_then(|interval| {
            if !(single && by_cluster.len() == differences.len()) {
                // A difference of rates lies between −1 and 1.
                let (low, high) = (interval.low.max(-1.0), interval.high.min(1.0));
                return Some(Interval { low, high });
            }
            let [both, first, second, neither] = counts.map(|count| count as u64);
            Some(paired_rate_difference(both, first, second, neither)?.1)
        });
        Self {
            both,
            first,
            second,
            neither,
            difference: mean(&sorted(differences.iter().map(|one| one.1))),
            interval,
            p: sign_flip_test(&by_cluster, BOOTSTRAP_SEED),
        }
    }
}

impl Lead {
    /// Absent with fewer than two planners, and where nothing was solved.
    pub(super) fn of(trials: &Trials<'_>, ranking: &Ranking) -> Option<Self> {
        let [first, others @ ..] = &ranking.planners[..] else {
            return None;
        };
        if others.is_empty() || first.success_rate <= 0.0 {
            return None;
        }
        let leader = trials.planner(&first.planner)?;
        let mut rivals = Vec::new();
        for ranked in others {
            let label = &ranked.planner;
            let times = pairs(trials, &first.planner, label, &SOLVE_TIME)?;
            let times = Paired::of(&times, 0, &SOLVE_TIME);
            rivals.push(Rival {
                planner: label.clone(),
                solved: Success::between(leader, trials.planner(label)?),
                slower: times.greater,
                faster: times.smaller,
                p_time: times.p,
                behind: false,
            });
        }
        correct(rivals.iter_mut().flat_map(|rival| {
            let tests = [rival.solved.p.as_mut(), rival.p_time.as_mut()];
            tests.into_iter().flatten()
        }));
        for rival in &mut rivals {
            let is_sure = |p: Option<f64>| p.is_some_and(|p| p < LEVEL);
            let difference = rival.solved.difference.unwrap_or(0.0);
            let solves_more = is_sure(rival.solved.p) && difference > 0.0;
            let is_faster = is_sure(rival.p_time) && rival.slower > rival.faster;
            rival.behind = solves_more || (is_faster && difference >= 0.0);
        }
        Some(Self {
            planner: first.planner.clone(),
            rivals,
        })
    }

    /// True where tests put it before every other planner.
    pub fn is_shown(&self) -> bool {
        self.rivals.iter().all(|rival| rival.behind)
    }
}
