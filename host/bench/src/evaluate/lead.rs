use serde::Serialize;

use super::{Ranking, SOLVE_TIME, Trials};
use crate::statistics::{holm, sign_test};

/// A difference is told from chance below this.
const LEVEL: f64 = 0.05;

/// The planner that ranks first, and the tests that put it before every other, or do not.
///
/// They do where it solved more instances than the other, or was faster on those that both
/// solved and solved no fewer. Both are exact two-sided sign tests on paired instances; all of
/// them, two for each of the others, are corrected after Holm together.
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
    /// Instances that the first solved and this one did not.
    pub lost: usize,
    /// Instances that this one solved and the first did not.
    pub won: usize,
    /// Of these two, corrected.
    pub p_solved: f64,
    /// Instances that both solved, this one in more time.
    pub slower: usize,
    /// Instances that both solved, this one in less time.
    pub faster: usize,
    /// Of these two, corrected.
    pub p_time: f64,
    /// Tests put the first before it.
    pub behind: bool,
}

impl Lead {
    /// Absent with fewer than two planners, and where nothing was solved.
    pub(super) fn of(trials: &Trials<'_>, ranking: &Ranking) -> Option<Self> {
        let [first, rest @ ..] = &ranking.planners[..] else {
            return None;
        };
        if rest.is_empty() || first.successes == 0 {
            return None;
        }
        let leader = trials.planner(&first.planner)?;
        let mut rivals = Vec::new();
        for ranked in rest {
            let mut rival = Rival {
                planner: ranked.planner.clone(),
                lost: 0,
                won: 0,
                p_solved: 1.0,
                slower: 0,
                faster: 0,
                p_time: 1.0,
                behind: false,
            };
            for case in &trials.planner(&ranked.planner)?.cases {
                let Some(ours) = leader.case(case.instance) else {
                    continue;
                };
                rival.lost += usize::from(ours.success() && !case.success());
                rival.won += usize::from(case.success() && !ours.success());
                let times = ours.value(&SOLVE_TIME).zip(case.value(&SOLVE_TIME));
                if let Some((ours, theirs)) = times {
                    rival.slower += usize::from(theirs > ours);
                    rival.faster += usize::from(theirs < ours);
                }
            }
            rivals.push(rival);
        }
        let tests = rivals.iter().flat_map(|rival| {
            let test = |one: usize, other: usize| sign_test(one as u64, other as u64);
            [
                test(rival.lost, rival.won),
                test(rival.slower, rival.faster),
            ]
        });
        let corrected = holm(&tests.collect::<Vec<f64>>());
        for (rival, p) in rivals.iter_mut().zip(corrected.chunks_exact(2)) {
            (rival.p_solved, rival.p_time) = (p[0], p[1]);
            let solves_more = rival.p_solved < LEVEL && rival.lost > rival.won;
            let is_faster = rival.p_time < LEVEL && rival.slower > rival.faster;
            rival.behind = solves_more || (is_faster && rival.lost >= rival.won);
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
