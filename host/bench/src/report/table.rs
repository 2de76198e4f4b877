//! The tables of a report, as text cells that terminals, Markdown and the page share.

use super::format::{NONE, capital, digits, fixed, grouped, percent, probability};
use crate::evaluate::{
    Against, COMPARED, Comparison, EXPANSIONS, Evaluation, GAPS, METRICS, Metric, PARTS,
    PATH_LENGTH, PlannerSummary, RankStability, Ranked, RunComparison, SOLVE_TIME, Standing,
    Success, Trials, ViewLine, censored, compare_with,
};
use crate::statistics::{Interval, Posterior};

/// A table.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Table {
    /// Its content, in a few words.
    pub title: String,
    /// Explanation for readers.
    pub note: String,
    /// Names of columns.
    pub head: Vec<String>,
    /// True for columns of words, false for those of numbers.
    pub words: Vec<bool>,
    /// Cells, by row.
    pub rows: Vec<Vec<String>>,
}

impl Table {
    fn new(title: &str, note: String, head: &[(&str, bool)]) -> Self {
        Self {
            title: title.to_owned(),
            note,
            head: head.iter().map(|(name, _)| (*name).to_owned()).collect(),
            words: head.iter().map(|(_, words)| *words).collect(),
            rows: Vec::new(),
        }
    }

    /// Without the columns that have no value at all.
    fn without_empty(mut self) -> Self {
        for column in (0..self.head.len()).rev() {
            if !self.rows.is_empty() && self.rows.iter().all(|row| row[column] == NONE) {
                self.head.remove(column);
                self.words.remove(column);
                for row in &mut self.rows {
                    row.remove(column);
                }
            }
        }
        self
    }
}

fn interval(interval: Option<&Interval>, text: impl Fn(f64) -> String) -> String {
    match interval {
        Some(Interval { low, high }) => format!("[{}, {}]", text(*low), text(*high)),
        None => NONE.to_owned(),
    }
}

fn three(value: f64) -> String {
    digits(Some(value))
}

/// A count and what is counted.
pub(super) fn plural(count: usize, word: &str) -> String {
    let end = if count == 1 { "" } else { "s" };
    format!("{} {word}{end}", grouped(count as u64))
}

/// Planners on views beside the best plans in the plane; nothing where no trial is of a view.
pub(super) fn views(evaluation: &Evaluation) -> Option<Table> {
    let compared = evaluation.views.iter().any(|line| line.compared > 0);
    let reference = if compared {
        " 100 % is the plan in the plane with the least sum of arrivals; ratios are means over the cases that \
         the planner and one in the plane solved, of which the last column has the number."
    } else {
        " No planner in the plane solved a case that another one solved: there is no 100 %."
    };
    let note = format!(
        "Solved: the plan keeps the rules of its view and is valid by footprints in the world of the task. Only \
         by rules: trials whose plan is valid on the view alone. Costs are means over the solved cases, times \
         are medians.{reference}"
    );
    let head = [
        ("Agents", false),
        ("View", true),
        ("Planner", true),
        ("Solved", false),
        ("Only by rules", false),
        ("Length, m", false),
        ("SoC, s", false),
        ("Makespan, s", false),
        ("Time, ms", false),
        ("Length", false),
        ("SoC", false),
        ("Makespan", false),
        ("Compared", false),
    ];
    let mut table = Table::new("Views", note, &head);
    for line in &evaluation.views {
        let ViewLine { means, ratios, .. } = line;
        table.rows.push(vec![
            line.agents.to_string(),
            line.view.clone(),
            line.planner.clone(),
            format!("{}/{}", line.solved, line.cases),
            line.invalid_in_world.to_string(),
            digits(means.length_m),
            digits(means.soc_s),
            digits(means.makespan_s),
            digits(line.solve_time_ms),
            percent(ratios.length_m),
            percent(ratios.soc_s),
            percent(ratios.makespan_s),
            line.compared.to_string(),
        ]);
    }
    (!table.rows.is_empty()).then(|| table.without_empty())
}

/// Table III of the maze paper.
pub(super) fn ranking(evaluation: &Evaluation) -> Table {
    let ranking = &evaluation.ranking;
    let shared = plural(ranking.shared, "case");
    let instances = grouped(ranking.instances as u64);
    let comparable = if ranking.over_shared {
        format!(
            "Every planner solved {shared} of {instances}: comparable times, lengths and SoC/LB are \
             means over them."
        )
    } else {
        "No case was solved by every planner: comparable times are means over all cases of each \
         planner, and lengths and costs are not comparable."
            .to_owned()
    };
    let near = if ranking.planners.iter().any(|ranked| ranked.near) {
        " ≈ marks a comparable time that is no farther from the one before than the uncertainties \
         of both."
    } else {
        ""
    };
    let sure = if evaluation.standings.iter().any(|one| one.ranks.is_some()) {
        format!(
            " Beside ranks, where 95 % of them lie when {} are drawn anew.",
            evaluation.overview.unit.name()
        )
    } else {
        String::new()
    };
    let note = format!(
        "{comparable} Other times and expansions are of the cases that succeeded; those that failed \
         stand beside them.{near}{sure}"
    );
    let head = [
        ("Rank", false),
        ("Planner", true),
        ("Success", false),
        ("Every repeat", false),
        ("Comparable, ms", false),
        ("Time, ms", false),
        ("Median [IQR], ms", false),
        ("p95, ms", false),
        ("Length", false),
        ("SoC/LB", false),
        ("Expansions", false),
        ("Failed", false),
    ];
    let mut table = Table::new("Ranking", note, &head);
    let planners = ranking.planners.iter().zip(&evaluation.planners);
    for ((ranked, summary), standing) in planners.zip(&evaluation.standings) {
        table.rows.push(ranking_row(ranked, summary, standing));
    }
    table.without_empty()
}

/// With its uncertainty, where it has one.
fn comparable(ranked: &Ranked) -> String {
    let near = if ranked.near { "≈ " } else { "" };
    match ranked.uncertainty_ms {
        Some(by) => format!(
            "{near}{} ± {}",
            digits(ranked.comparable_time_ms),
            three(by)
        ),
        None => digits(ranked.comparable_time_ms),
    }
}

fn ranking_row(ranked: &Ranked, summary: &PlannerSummary, standing: &Standing) -> Vec<String> {
    let of = |metric: &Metric| summary.metric(metric).map(|found| found.summary);
    let mean = |metric: &Metric| of(metric).map(|found| found.mean);
    let shared = |metric: &Metric| summary.metric(metric)?.shared_mean;
    let ratio = Metric::named("suboptimality").and_then(shared);
    let time = of(&SOLVE_TIME);
    let per_cent = |share: f64| fixed(Some(100.0 * share), 1);
    vec![
        match standing.ranks {
            Some([low, high]) => format!("{} [{low}, {high}]", ranked.rank),
            None => ranked.rank.to_string(),
        },
        ranked.planner.clone(),
        match &summary.success_interval {
            Some(found) => format!(
                "{} {}",
                percent(Some(summary.success_rate)),
                interval(Some(found), per_cent)
            ),
            None => percent(Some(summary.success_rate)),
        },
        format!("{}/{}", ranked.successes, ranked.cases),
        comparable(ranked),
        time.map_or(NONE.to_owned(), |time| {
            format!("{} ± {}", three(time.mean), digits(time.standard_deviation))
        }),
        time.map_or(NONE.to_owned(), |time| {
            let [median, q1, q3] = [time.median, time.q1, time.q3].map(three);
            format!("{median} [{q1}, {q3}]")
        }),
        digits(time.map(|time| time.p95)),
        fixed(shared(&PATH_LENGTH), 2),
        fixed(ratio, 3),
        fixed(mean(&EXPANSIONS), 2),
        summary.failures.to_string(),
    ]
}

/// Certainty of ranks, and success, time and quality together; nothing of one planner.
pub(super) fn standings(evaluation: &Evaluation) -> Option<Table> {
    let overview = &evaluation.overview;
    let note = format!(
        "Failures count here. P(first): how often the planner ranks first when {} are drawn anew. PAR-2 \
         and PAR-10: mean time, a failure counting as two and ten budgets. min(t, budget): PAR-1, with its \
         95 % interval. Score: mean of the best sum of costs of all planners over its own, 0 for a \
         failure. Pareto: no planner is as good in success, PAR-2 and score and better in one. Fastest: \
         share of cases in which nobody was faster. Alone: cases that nobody else solved. The virtual \
         best takes of each case the planner that is best there; contribution: how much longer its PAR-2 \
         is without the planner.",
        overview.unit.name()
    );
    let head = [
        ("Planner", true),
        ("Success", false),
        ("P(first)", false),
        ("min(t, budget), ms", false),
        ("PAR-2, ms", false),
        ("PAR-10, ms", false),
        ("Score", false),
        ("Pareto", true),
        ("Fastest", false),
        ("Alone", false),
        ("Contribution, ms", false),
    ];
    let mut table = Table::new("Success, time and quality", note, &head);
    for (standing, summary) in evaluation.standings.iter().zip(&evaluation.planners) {
        let [once, twice, ten] = standing.par_ms;
        let within = match &standing.par_1_interval {
            Some(found) => format!("{} {}", digits(once), interval(Some(found), three)),
            None => digits(once),
        };
        table.rows.push(vec![
            standing.planner.clone(),
            percent(Some(summary.success_rate)),
            fixed(standing.p_first, 2),
            within,
            digits(twice),
            digits(ten),
            fixed(standing.score, 3),
            if standing.undominated { "yes" } else { NONE }.to_owned(),
            percent(Some(standing.fastest)),
            standing.alone.to_string(),
            digits(standing.contribution_ms),
        ]);
    }
    if table.rows.len() < 2 {
        return None;
    }
    if let Some(best) = &evaluation.virtual_best {
        let [once, twice, ten] = best.par_ms.map(digits);
        let none = || NONE.to_owned();
        let name = "virtual best".to_owned();
        let success = percent(Some(best.success_rate));
        let row = [name, success, none(), once, twice, ten].into_iter();
        table
            .rows
            .push(row.chain([(); 5].map(|()| none())).collect());
    }
    Some(table.without_empty())
}

/// Means over the cases that every planner solved; nothing of one planner, and where there are none.
pub(super) fn shared(evaluation: &Evaluation) -> Option<Table> {
    let metrics: Vec<&Metric> = (COMPARED.iter().chain(&["suboptimality", "expansions"]))
        .filter_map(|column| Metric::named(column))
        .collect();
    let note = format!(
        "Means over the {} that every planner solved: of the same cases, for all. Which these are \
         depends on the weakest planner; the paired comparisons do without it.",
        plural(evaluation.overview.shared, "case")
    );
    let names: Vec<String> = metrics
        .iter()
        .map(|metric| capital(&named(metric)))
        .collect();
    let mut head = vec![("Planner", true)];
    head.extend(names.iter().map(|name| (name.as_str(), false)));
    let mut table = Table::new("On what all solved", note, &head);
    for summary in &evaluation.planners {
        let mean =
            |metric: &&Metric| digits(summary.metric(metric).and_then(|one| one.shared_mean));
        let means = metrics.iter().map(mean);
        table.rows.push(
            std::iter::once(summary.planner.clone())
                .chain(means)
                .collect(),
        );
    }
    let some = evaluation.overview.shared > 0 && table.rows.len() > 1;
    some.then(|| table.without_empty())
}

/// Quality of plans over time; nothing where no planner sends plans on the way.
pub(super) fn anytime(evaluation: &Evaluation) -> Option<Table> {
    let per_cent = |parts: &[f64]| -> Vec<String> {
        let parts = parts.iter().map(|part| format!("{:.0} %", 100.0 * part));
        parts.collect()
    };
    let (parts, gaps) = (per_cent(&PARTS), per_cent(&GAPS));
    let note = format!(
        "Against the best plan that any planner found of the instance. Primal integral: the mean gap over \
         the budget, 1 as long as there is no plan, with its 95 % interval. Targets: share of cases and \
         gaps of {} that were reached within a part of the budget. Gap at equal time: when the first \
         planner of the instance had ended by itself with a valid plan, beside the gap at the budget, of \
         instances that one ended so.",
        gaps.join(", ")
    );
    let targets = parts.iter().map(|part| format!("Targets by {part}"));
    let within = gaps.iter().map(|gap| format!("Within {gap}"));
    let names: Vec<String> = targets.chain(within).collect();
    let mut head = vec![("Planner", true), ("Primal integral", false)];
    head.extend(names.iter().map(|name| (name.as_str(), false)));
    head.extend([("Gap at equal time", false), ("Gap at the budget", false)]);
    let mut table = Table::new("Plans on the way", note, &head);
    for ranked in &evaluation.ranking.planners {
        let mut found = evaluation.anytime.iter();
        let Some(found) = found.find(|found| found.planner == ranked.planner) else {
            continue;
        };
        let three = |value: f64| fixed(Some(value), 3);
        let integral = match &found.interval {
            Some(around) => format!(
                "{} {}",
                three(found.primal_integral),
                interval(Some(around), three)
            ),
            None => three(found.primal_integral),
        };
        let mut row = vec![found.planner.clone(), integral];
        let shares = found.targets.iter().chain(&found.within);
        row.extend(shares.map(|share| percent(Some(*share))));
        let [equal, budget] = found.equal_time.map_or([None; 2], |gaps| gaps.map(Some));
        row.extend([percent(equal), percent(budget)]);
        table.rows.push(row);
    }
    (!table.rows.is_empty()).then_some(table)
}

/// Ranks by regime.
pub(super) fn stability(found: &RankStability) -> Table {
    let names = found.regimes.iter().map(|levels| {
        let texts = levels.iter().flatten().map(|level| level.text.as_str());
        texts.collect::<Vec<_>>().join(", ")
    });
    let names: Vec<String> = names.collect();
    let note = format!(
        "The rank of each planner where instances are alike. Between the rankings of two such \
         groups Kendall's τ-b is {} on average and {} at the least: 1 is the same order, −1 the \
         opposite one.",
        fixed(found.mean_tau, 2),
        fixed(found.min_tau, 2)
    );
    let mut head = vec![("Instances", true)];
    head.extend(
        found
            .planners
            .iter()
            .map(|planner| (planner.as_str(), false)),
    );
    let mut table = Table::new("Stability of the ranking", note, &head);
    for (name, ranks) in names.into_iter().zip(&found.ranks) {
        let ranks = ranks.iter().map(ToString::to_string);
        table
            .rows
            .push(std::iter::once(name).chain(ranks).collect());
    }
    table
}

/// Table IV of the maze paper, of any metric; with solve times, successes too.
pub(super) fn paired(comparison: &Comparison) -> Table {
    let (metric, unit) = (&comparison.metric, comparison.unit.name());
    let of_times = *metric == SOLVE_TIME;
    let (title, more) = if of_times {
        (
            "Paired comparison".to_owned(),
            format!(
                " 5 % more or less is as fast. Success: its rate less that of {} with its 95 % interval, \
                 over what both were asked; p by sign flips of {unit}, which is McNemar's exact test \
                 where each is one trial.",
                comparison.baseline
            ),
        )
    } else {
        (
            format!("Paired comparison: {}", metric.title),
            String::new(),
        )
    };
    let note = format!(
        "Differences of {} from {}, on the instances that both solved: positive where the planner {}. \
         Medians, their exact 95 % intervals and two-sided sign tests are over {unit}, with Holm's \
         correction for all tests of a column.{more}",
        metric.title,
        comparison.baseline,
        if of_times { "is slower" } else { "has more" },
    );
    let delta = match metric.unit {
        "" => "Median Δ".to_owned(),
        unit => format!("Median Δ, {unit}"),
    };
    let head = [
        ("Planner", true),
        ("Pairs", false),
        (delta.as_str(), false),
        ("95 % interval", false),
        ("Ratio", false),
        (
            if of_times {
                "Slower/faster"
            } else {
                "More/less"
            },
            false,
        ),
        ("p, Holm", false),
        ("P(faster)", false),
        ("P(as fast)", false),
        ("P(slower)", false),
        ("Success", false),
        ("p of success", false),
    ];
    let mut table = Table::new(&title, note, &head);
    for against in &comparison.planners {
        let (planner, paired) = (&against.planner, &against.paired);
        let solved = Some(&against.solved).filter(|_| of_times);
        let posterior = |of: fn(&Posterior) -> f64| fixed(paired.posterior.as_ref().map(of), 2);
        table.rows.push(vec![
            planner.clone(),
            paired.pairs.to_string(),
            digits(paired.median_delta),
            interval(paired.delta_interval.as_ref(), three),
            fixed(paired.median_ratio, 3),
            format!("{}/{}", paired.greater, paired.smaller),
            p_value(paired.p_holm),
            posterior(|found| found.below),
            posterior(|found| found.equivalent),
            posterior(|found| found.above),
            solved.map_or(NONE.to_owned(), success_of_second),
            p_value(solved.and_then(|solved| solved.p)),
        ]);
    }
    table.without_empty()
}

/// Success rate of the second less that of the first, with its interval.
fn success_of_second(solved: &Success) -> String {
    let Some(difference) = solved.difference else {
        return NONE.to_owned();
    };
    // No difference has no sign.
    let turned = |value: f64| 0.0 - value;
    let difference = percent(Some(turned(difference)));
    match &solved.interval {
        Some(Interval { low, high }) => {
            let turned = Interval {
                low: turned(*high),
                high: turned(*low),
            };
            let per_cent = |share: f64| fixed(Some(100.0 * share), 1);
            format!("{difference} {}", interval(Some(&turned), per_cent))
        }
        None => difference,
    }
}

/// Of a test, if there was one.
fn p_value(p: Option<f64>) -> String {
    p.map_or(NONE.to_owned(), probability)
}

/// Reasons for which trials failed; nothing if none did.
pub(super) fn failures(evaluation: &Evaluation) -> Option<Table> {
    let head = [("Planner", true), ("Reason", true), ("Trials", false)];
    let mut table = Table::new("Failures", String::new(), &head);
    for summary in &evaluation.planners {
        for reason in &summary.reasons {
            table.rows.push(vec![
                summary.planner.clone(),
                reason.reason.clone(),
                reason.trials.to_string(),
            ]);
        }
    }
    (!table.rows.is_empty()).then_some(table)
}

/// Two planners, metric by metric.
pub(super) fn two_planners(trials: &Trials<'_>, a: &str, b: &str) -> Option<Table> {
    let (first, second) = (trials.planner(a)?, trials.planner(b)?);
    let note = format!(
        "Differences are {b} − {a}, on the instances that both solved. Exact 95 % intervals of the \
         median and two-sided sign tests, over {}, without correction. {a} solved {} of {} cases, {b} {} \
         of {}.",
        trials.unit().name(),
        first.successes().count(),
        first.cases.len(),
        second.successes().count(),
        second.cases.len(),
    );
    let solved = Success::between(first, second);
    let note = format!(
        "{note} Success of {b} less that of {a}: {}, p = {}.",
        success_of_second(&solved),
        p_value(solved.p)
    );
    let note = match censored(trials, a, b) {
        Some(found) => format!(
            "{note} With failures as times beyond the budget, {a} takes {} ms and {b} {} ms on average \
             (restricted means), log-rank p = {}.",
            digits(Some(found.first.0)),
            digits(Some(found.second.0)),
            probability(found.p)
        ),
        None => note,
    };
    let [mean_a, mean_b] = [a, b].map(|label| format!("Mean of {label}"));
    let head = [
        ("Metric", true),
        (mean_a.as_str(), false),
        (mean_b.as_str(), false),
        ("Median Δ", false),
        ("95 % interval", false),
        ("More/less", false),
        ("p", false),
        ("Pairs", false),
    ];
    let mut table = Table::new(&format!("{a} and {b}"), note, &head);
    for metric in METRICS {
        let comparison = compare_with(trials, a, metric)?;
        let mut planners = comparison.planners.iter();
        let is_other = |one: &&Against| one.planner == b && one.paired.pairs > 0;
        let Some(Against { paired, .. }) = planners.find(is_other) else {
            continue;
        };
        table.rows.push(vec![
            named(metric),
            digits(paired.mean_first),
            digits(paired.mean_second),
            digits(paired.median_delta),
            interval(paired.delta_interval.as_ref(), three),
            format!("{}/{}", paired.greater, paired.smaller),
            p_value(paired.p),
            paired.pairs.to_string(),
        ]);
    }
    Some(table)
}

fn named(metric: &Metric) -> String {
    match metric.unit {
        "" => metric.title.to_owned(),
        unit => format!("{}, {unit}", metric.title),
    }
}

/// Shares of time for which threads waited for a processor that differ by more are said.
const RUN_DELAY: f64 = 0.01;

/// Two runs of one suite: what became of every planner, and of its numbers.
pub(super) fn two_runs(comparison: &RunComparison, a: &str, b: &str) -> Vec<Table> {
    let machines = if comparison.same_machines {
        "Both ran on machines of the same description."
    } else {
        "They ran on different machines: times can be compared only with care."
    };
    let settings: Vec<String> = comparison
        .settings
        .iter()
        .map(|one| {
            format!(
                "{} ({}; in B {})",
                one.name,
                one.a.join(", "),
                one.b.join(", ")
            )
        })
        .collect();
    let settings = match &settings[..] {
        [] => String::new(),
        some => format!(
            " They were measured otherwise, so that times cannot be compared: {}.",
            some.join(", ")
        ),
    };
    let waited = match comparison.run_delay {
        Some([in_a, in_b]) if (in_a - in_b).abs() > RUN_DELAY => format!(
            " Threads waited for a processor {} of the time of their calls in A and {} in B.",
            percent(Some(in_a)),
            percent(Some(in_b))
        ),
        _ => String::new(),
    };
    let note = format!(
        "A is {a}, B is {b}. {} in both, {} only in A, {} only in B. {machines}{settings}{waited} p of \
         success is of sign flips over {} {}, with Holm's correction over planners.",
        plural(comparison.pairs, "trial"),
        grouped(comparison.only_in_a as u64),
        grouped(comparison.only_in_b as u64),
        grouped(comparison.clusters as u64),
        comparison.unit.name(),
    );
    let head = [
        ("Planner", true),
        ("Trials", false),
        ("Code", true),
        ("Success A", false),
        ("Success B", false),
        ("Lost", false),
        ("Won", false),
        ("p of success", false),
        ("Plans differ", false),
        ("Traces differ", false),
    ];
    let mut runs = Table::new("Two runs", note, &head);
    let note = format!(
        "Cases that both runs solved. Differences are B − A, ratios B / A: below 1 is faster. Exact 95 % \
         intervals of medians and two-sided sign tests, over {}, with Holm's correction over planners.",
        comparison.unit.name()
    );
    let head = [
        ("Planner", true),
        ("Pairs", false),
        ("Mean A, ms", false),
        ("Mean B, ms", false),
        ("Median Δ, ms", false),
        ("95 % interval", false),
        ("Median ratio", false),
        ("95 % interval", false),
        ("p, Holm", false),
    ];
    let mut times = Table::new("Solve times of both runs", note, &head);
    for planner in &comparison.planners {
        let code = match planner.same_code {
            Some(true) => "same",
            Some(false) => "other",
            None => NONE,
        };
        let differ = |digests: &crate::evaluate::Digests| {
            let known = digests.same + digests.different.len();
            format!("{}/{known}", digests.different.len())
        };
        runs.rows.push(vec![
            planner.planner.clone(),
            planner.pairs.to_string(),
            code.to_owned(),
            planner.successes_a.to_string(),
            planner.successes_b.to_string(),
            planner.lost.len().to_string(),
            planner.won.len().to_string(),
            p_value(planner.solved.p),
            differ(&planner.plans),
            differ(&planner.traces),
        ]);
        let mut metrics = planner.metrics.iter();
        if let Some(time) = metrics.find(|found| found.metric == SOLVE_TIME) {
            let paired = &time.paired;
            times.rows.push(vec![
                planner.planner.clone(),
                paired.pairs.to_string(),
                digits(paired.mean_first),
                digits(paired.mean_second),
                digits(paired.median_delta),
                interval(paired.delta_interval.as_ref(), three),
                fixed(paired.median_ratio, 3),
                interval(paired.ratio_interval.as_ref(), |x| fixed(Some(x), 3)),
                p_value(paired.p_holm),
            ]);
        }
    }
    vec![runs, times]
}

/// `percent` of a part of a whole.
pub(super) fn share(part: usize, whole: usize) -> String {
    percent((whole > 0).then(|| part as f64 / whole as f64))
}
