//! The tables of a report, as text cells that terminals, Markdown and the page share.

use super::format::{NONE, digits, fixed, grouped, percent, probability};
use crate::evaluate::{
    Comparison, EXPANSIONS, Evaluation, GAPS, METRICS, Metric, PARTS, PATH_LENGTH, PlannerSummary,
    RankStability, Ranked, RunComparison, SOLVE_TIME, Trials, censored, compare_with,
};
use crate::statistics::{Interval, Posterior};

/// A table.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Table {
    /// What it shows.
    pub title: String,
    /// What has to be known to read it.
    pub note: String,
    /// Names of columns.
    pub head: Vec<String>,
    /// Whether each column is of words, and not of numbers.
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

/// Table III of the maze paper.
pub(super) fn ranking(evaluation: &Evaluation) -> Table {
    let ranking = &evaluation.ranking;
    let shared = plural(ranking.shared, "case");
    let instances = grouped(ranking.instances as u64);
    let comparable = if ranking.over_shared {
        format!(
            "Every planner solved {shared} of {instances}: comparable times are means over them."
        )
    } else {
        "No case was solved by every planner: comparable times are means over all cases of each \
         planner."
            .to_owned()
    };
    let near = if ranking.planners.iter().any(|ranked| ranked.near) {
        " ≈ marks a comparable time that is no farther from the one before than the uncertainties \
         of both."
    } else {
        ""
    };
    let note = format!(
        "{comparable} Other times, lengths, costs and expansions are of the cases that succeeded; \
         those that failed stand beside them.{near}"
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
    for (ranked, summary) in ranking.planners.iter().zip(&evaluation.planners) {
        table.rows.push(ranking_row(ranked, summary));
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

fn ranking_row(ranked: &Ranked, summary: &PlannerSummary) -> Vec<String> {
    let of = |metric: &Metric| summary.metric(metric).map(|found| found.summary);
    let mean = |metric: &Metric| of(metric).map(|found| found.mean);
    let ratio = Metric::named("suboptimality").and_then(mean);
    let time = of(&SOLVE_TIME);
    let per_cent = |share: f64| fixed(Some(100.0 * share), 1);
    vec![
        ranked.rank.to_string(),
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
        fixed(mean(&PATH_LENGTH), 2),
        fixed(ratio, 3),
        fixed(mean(&EXPANSIONS), 2),
        summary.failures.to_string(),
    ]
}

/// How sure ranks are, and success, time and quality together; nothing of one planner.
pub(super) fn standings(evaluation: &Evaluation) -> Option<Table> {
    let overview = &evaluation.overview;
    let note = format!(
        "Failures count here. Ranks: where 95 % of them lie when {} are drawn anew, and how often the \
         planner is first then. PAR-2: mean time, a failure counting as two budgets. min(t, budget): mean \
         with its 95 % interval. Score: mean of the best sum of costs of all planners over its own, 0 \
         for a failure. Fastest: share of cases in which nobody was faster. Alone: cases that nobody \
         else solved. Pareto: no planner is as good in success, PAR-2 and score and better in one.",
        overview.unit.name()
    );
    let head = [
        ("Planner", true),
        ("Success", false),
        ("Ranks", false),
        ("P(first)", false),
        ("PAR-2, ms", false),
        ("min(t, budget), ms", false),
        ("Score", false),
        ("Fastest", false),
        ("Alone", false),
        ("Pareto", true),
    ];
    let mut table = Table::new("Success, time and quality", note, &head);
    for (standing, summary) in evaluation.standings.iter().zip(&evaluation.planners) {
        let [once, twice, _] = standing.par_ms;
        let within = match &standing.par_1_interval {
            Some(found) => format!("{} {}", digits(once), interval(Some(found), three)),
            None => digits(once),
        };
        table.rows.push(vec![
            standing.planner.clone(),
            percent(Some(summary.success_rate)),
            match standing.ranks {
                Some([low, high]) if low == high => low.to_string(),
                Some([low, high]) => format!("{low} to {high}"),
                None => NONE.to_owned(),
            },
            fixed(standing.p_first, 2),
            digits(twice),
            within,
            fixed(standing.score, 3),
            percent(Some(standing.fastest)),
            standing.alone.to_string(),
            if standing.undominated { "yes" } else { NONE }.to_owned(),
        ]);
    }
    (table.rows.len() > 1).then(|| table.without_empty())
}

/// How soon plans are how good; nothing where no planner sends plans on the way.
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

/// Table IV of the maze paper.
pub(super) fn paired(comparison: &Comparison) -> Table {
    let note = format!(
        "Differences of solve times from {}, on the instances that both solved: positive where \
         the planner is slower. Medians, their exact 95 % intervals and two-sided sign tests with \
         Holm's correction are over {}; 5 % more or less is as fast.",
        comparison.baseline,
        comparison.unit.name()
    );
    let head = [
        ("Planner", true),
        ("Pairs", false),
        ("Median Δ, ms", false),
        ("95 % interval", false),
        ("Ratio", false),
        ("Slower/faster", false),
        ("p, Holm", false),
        ("P(faster)", false),
        ("P(as fast)", false),
        ("P(slower)", false),
    ];
    let mut table = Table::new("Paired comparison", note, &head);
    for (planner, paired) in &comparison.planners {
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
        ]);
    }
    table.without_empty()
}

/// Of a test, if there was one.
fn p_value(p: Option<f64>) -> String {
    p.map_or(NONE.to_owned(), probability)
}

/// Why trials failed; nothing if none did.
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
        let Some((_, paired)) = planners.find(|(label, paired)| label == b && paired.pairs > 0)
        else {
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
    let note = format!(
        "A is {a}, B is {b}. {} in both, {} only in A, {} only in B. {machines}{settings}",
        plural(comparison.pairs, "trial"),
        grouped(comparison.only_in_a as u64),
        grouped(comparison.only_in_b as u64),
    );
    let head = [
        ("Planner", true),
        ("Trials", false),
        ("Code", true),
        ("Success A", false),
        ("Success B", false),
        ("Lost", false),
        ("Won", false),
        ("Plans differ", false),
        ("Traces differ", false),
    ];
    let mut runs = Table::new("Two runs", note, &head);
    let note = "Cases that both runs solved. Differences are B − A, ratios B / A: below 1 is \
                faster. Exact 95 % intervals of medians and two-sided sign tests, over scenarios or \
                what the suite generalises over, with Holm's correction over planners.";
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
    let mut times = Table::new("Solve times of both runs", note.to_owned(), &head);
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
