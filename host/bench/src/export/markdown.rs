//! Tables for people, from the same numbers as every report.

use std::fmt::Write as _;

use crate::evaluate::{
    Comparison, EXPANSIONS, Evaluation, METRICS, Metric, Order, Overview, PlannerSummary,
    SOLVE_TIME, Trials,
};
use crate::statistics::{Interval, Summary};
use crate::{Row, number};

/// Columns of means beside the times, where any planner has them.
const SHOWN: [&str; 8] = [
    "path_length_cells",
    "expansions",
    "soc_steps",
    "suboptimality",
    "makespan_steps",
    "first_solution_ms",
    "throughput_per_s",
    "contacts",
];

/// What a suite says: an overview, the ranking, failures and paired comparisons.
pub fn markdown<'a>(rows: impl IntoIterator<Item = &'a Row>, order: Order) -> String {
    let trials = Trials::new(rows);
    let found = Evaluation::of(&trials, order);
    let mut text = overview(&found.overview);
    text.push_str("\n## Ranking\n\n");
    ranking(&mut text, &found);
    failures(&mut text, &found.planners);
    if let Some(comparison) = &found.comparison {
        paired(&mut text, comparison);
    }
    text
}

/// Text that Markdown leaves as it is.
fn plain(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for letter in text.chars() {
        if letter.is_ascii_punctuation() && !".,:;()/-+=%'\"".contains(letter) {
            escaped.push('\\');
        }
        escaped.push(if letter.is_control() { ' ' } else { letter });
    }
    escaped
}

/// How many of something, in words.
fn count(number: usize, one: &str, many: &str) -> String {
    format!("{number} {}", if number == 1 { one } else { many })
}

fn overview(found: &Overview) -> String {
    let mut text = format!(
        "{}: {} on {}; {} solved by all of them. {} failed.\n",
        count(found.trials, "trial", "trials"),
        count(found.planners, "planner", "planners"),
        count(found.instances, "instance", "instances"),
        found.shared,
        count(found.failures, "trial", "trials"),
    );
    if found.repeats_max > 1 {
        let _ = writeln!(
            text,
            "\nEvery case has {} to {} repeats, of which the median counts; it succeeds if all of them do.",
            found.repeats_min, found.repeats_max
        );
    }
    if found.descriptive && found.trials > 0 {
        text.push_str("\nTimings without repeats are descriptive: they say what happened once.\n");
    }
    if found.contended > 0 {
        let disturbed = count(found.contended, "trial was", "trials were");
        let _ = writeln!(text, "\n{disturbed} disturbed by others on the machine.");
    }
    if found.unranked > 0 {
        let unranked = count(found.unranked, "trial", "trials");
        let _ = writeln!(
            text,
            "\n{unranked} without a sandbox or in the host's own process may not be compared."
        );
    }
    if found.machines.len() > 1 {
        let machines = found.machines.len();
        let _ = writeln!(text, "\nThe trials ran on {machines} different machines.");
    }
    text
}

fn spread(summary: &Summary) -> String {
    match summary.standard_deviation {
        Some(deviation) => format!("{} ± {}", number(summary.mean), number(deviation)),
        None => number(summary.mean),
    }
}

fn interval(found: Option<Interval>, of: fn(f64) -> String) -> String {
    found.map_or("–".into(), |found| {
        format!("[{}, {}]", of(found.low), of(found.high))
    })
}

fn percent(share: f64) -> String {
    format!("{:.1} %", share * 100.0)
}

/// Differences are smaller than what they are of.
fn fine(value: f64) -> String {
    if value.abs() < 100.0 {
        format!("{value:.3}")
    } else {
        number(value)
    }
}

fn heading(metric: &Metric) -> String {
    match metric.unit {
        "" => metric.title.to_owned(),
        unit => format!("{} ({unit})", metric.title),
    }
}

fn line(text: &mut String, cells: &[String]) {
    let _ = writeln!(text, "| {} |", cells.join(" | "));
}

/// The first columns are words, the others numbers.
fn head(text: &mut String, words: usize, cells: &[String]) {
    line(text, cells);
    let rule = |at: usize| if at < words { "---" } else { "---:" }.to_owned();
    line(text, &(0..cells.len()).map(rule).collect::<Vec<_>>());
}

fn ranking(text: &mut String, found: &Evaluation) {
    let has = |metric: &&Metric| {
        found
            .planners
            .iter()
            .any(|planner| planner.metric(metric).is_some())
    };
    let shown: Vec<&Metric> = METRICS
        .iter()
        .filter(|metric| SHOWN.contains(&metric.column))
        .filter(has)
        .collect();
    let fixed = [
        "rank",
        "planner",
        "success",
        "95 %",
        "time (ms)",
        "median [IQR] (ms)",
        "p95 (ms)",
        "comparable (ms)",
    ];
    let mut cells: Vec<String> = fixed.map(str::to_owned).to_vec();
    cells.extend(shown.iter().map(|metric| heading(metric)));
    cells.push("left out".into());
    head(text, 2, &cells);
    for (ranked, planner) in found.ranking.planners.iter().zip(&found.planners) {
        let of = |metric: &Metric| planner.metric(metric).map(|found| found.summary);
        let time = of(&SOLVE_TIME);
        let or_dash = |found: Option<String>| found.unwrap_or_else(|| "–".into());
        let mut cells = vec![
            ranked.rank.to_string(),
            plain(&planner.planner),
            format!("{}/{}", planner.successes, planner.cases),
            interval(planner.success_interval, percent),
            or_dash(time.as_ref().map(spread)),
            or_dash(time.map(|time| {
                format!(
                    "{} [{}, {}]",
                    number(time.median),
                    number(time.q1),
                    number(time.q3)
                )
            })),
            or_dash(time.map(|time| number(time.p95))),
            or_dash(ranked.comparable_time_ms.map(number)),
        ];
        for metric in &shown {
            let exact = [EXPANSIONS.column, "path_length_cells"].contains(&metric.column);
            let mean = |found: Summary| {
                if exact {
                    format!("{:.2}", found.mean)
                } else {
                    number(found.mean)
                }
            };
            cells.push(or_dash(of(metric).map(mean)));
        }
        cells.push(planner.failures.to_string());
        line(text, &cells);
    }
    let over = if found.ranking.over_shared {
        format!(
            "over the {} that every planner solved",
            count(found.ranking.shared, "instance", "instances")
        )
    } else {
        "over all instances, because no instance was solved by every planner".into()
    };
    let order = found.ranking.order;
    let _ = writeln!(
        text,
        "\nRanked by {} (`{}`). Times and other means are over the cases that a planner solved, \
         mean ± sample standard deviation; *left out* counts the others. *Comparable* is the mean \
         {over}. The interval of success is Wilson's.",
        order.description(),
        order.name(),
    );
}

fn failures(text: &mut String, planners: &[PlannerSummary]) {
    if planners.iter().all(|planner| planner.reasons.is_empty()) {
        return;
    }
    text.push_str("\n## Failures\n\n");
    head(text, 2, &["planner", "reason", "trials"].map(str::to_owned));
    for planner in planners {
        for found in &planner.reasons {
            let cells = [
                plain(&planner.planner),
                plain(&found.reason),
                found.trials.to_string(),
            ];
            line(text, &cells);
        }
    }
}

fn paired(text: &mut String, comparison: &Comparison) {
    let _ = writeln!(
        text,
        "\n## Paired comparison with {}\n",
        plain(&comparison.baseline)
    );
    let unit = comparison.metric.unit;
    let cells = [
        "planner".into(),
        format!("median Δ ({unit})"),
        "95 %".into(),
        "slower/faster/tied".into(),
        "p (Holm)".into(),
        "left out".into(),
    ];
    head(text, 1, &cells);
    for (planner, found) in &comparison.planners {
        let cells = [
            plain(planner),
            found.median_delta.map_or("–".into(), fine),
            interval(found.delta_interval, fine),
            format!("{}/{}/{}", found.greater, found.smaller, found.tied),
            format!("{:.2e}", found.p_holm),
            found.left_out.to_string(),
        ];
        line(text, &cells);
    }
    text.push_str(
        "\nΔ is the planner's time less that of the best, on the instances that both solved; a positive one \
         is slower. Percentile bootstrap of 40,000 resamples, exact two-sided sign test, Holm's correction \
         for all comparisons of the table.",
    );
    if comparison.descriptive {
        text.push_str(" Without repeats the p-values are exploratory.");
    }
    text.push('\n');
}
