//! The report as one HTML page that needs no network and no other file.
//!
//! The page's own parts are in `page/`; this module fills in the trials. Whatever names
//! and messages contain, they are text: they are escaped in HTML and in JSON, and the
//! page's policy lets nothing be loaded.

use std::fmt::Write as _;

use fleetyard_view::{Shell, embedded, escape};
use serde::Serialize;

use super::Report;
use super::columns::{Packed, pack, pack_numbers, pack_words};
use super::figures::{Quantity, moments};
use super::palette::COLORS;
use super::story::methods;
use super::table::{self, Table};
use crate::evaluate::{
    COMPARED, METRICS, Metric, Order, Ranked, SOLVE_TIME, best_of, compare_with,
};
use crate::{COLUMNS, ColumnType, Places, Row};

const BODY: &str = include_str!("page/page.html");
const STYLE: &str = include_str!("page/page.css");

/// The script, which is one function around all of these.
const SCRIPT: [&str; 9] = [
    include_str!("page/start.js"),
    include_str!("page/data.js"),
    include_str!("page/names.js"),
    include_str!("page/numbers.js"),
    include_str!("page/evaluate.js"),
    include_str!("page/plot.js"),
    include_str!("page/figures.js"),
    include_str!("page/page.js"),
    include_str!("page/end.js"),
];

#[derive(Serialize)]
struct Data<'a> {
    rows: usize,
    columns: Vec<Packed>,
    /// Names of columns whose numbers are yes and no.
    booleans: Vec<&'static str>,
    /// The end of each trial.
    outcome: Packed,
    planners: Vec<&'a str>,
    order: Order,
    path_rule: Option<&'a str>,
    places: &'a Places,
    metrics: Vec<Quantity>,
    colors: [&'static str; COLORS.len()],
    /// Every planner against each of the others, by the rank of the latter.
    paired: Vec<PairedTable>,
    /// Of each trial the name of its planner in tables: with that of the view, of a task.
    entrants: Packed,
    /// Of each trial the digest of its task, or else of its instance.
    questions: Packed,
    /// Of each trial the number of its cluster.
    clusters: Packed,
    /// Of each trial the number of its map.
    maps: Packed,
    /// Of each planner where 95 % of its ranks lie when clusters are drawn anew.
    ranks: Vec<Option<[usize; 2]>>,
    /// The unit that is drawn then.
    unit: &'static str,
    /// Numbers of the planners that are held against each other at first.
    scatter: [usize; 2],
    quality: Quality,
    /// Of each trial its store.
    stores: Packed,
    /// True if the studio serves the page.
    in_studio: bool,
}

/// Planners against one of them.
#[derive(Serialize)]
struct PairedTable {
    /// Number of the planner that the others are held against.
    baseline: usize,
    metric: &'static str,
    note: String,
    head: Vec<String>,
    rows: Vec<Vec<String>>,
}

/// Most planners of which each is held against all others; with more the first is.
const ALL_PAIRS: usize = 16;

/// The best sums of costs at some moments: where they change.
#[derive(Serialize)]
struct Quality {
    moments_ms: Vec<f64>,
    /// Changes per trial.
    changes: Packed,
    /// Number of the moment, by change.
    moment: Packed,
    /// Sum of costs, by change.
    soc: Packed,
}

impl Quality {
    fn of(rows: &[&Row], moments_ms: Vec<f64>) -> Self {
        let (mut changes, mut moment, mut socs) = (Vec::new(), Vec::new(), Vec::new());
        for row in rows {
            let before = socs.len();
            let mut last = f64::INFINITY;
            for (number, soc) in best_of(row, &moments_ms).into_iter().enumerate() {
                if soc < last {
                    moment.push(Some(number as f64));
                    socs.push(Some(soc));
                    last = soc;
                }
            }
            changes.push(Some((socs.len() - before) as f64));
        }
        Self {
            moments_ms,
            changes: pack_numbers("changes", &changes),
            moment: pack_numbers("moment", &moment),
            soc: pack_numbers("soc", &socs),
        }
    }
}

fn paired_tables(report: &Report<'_>, planners: &[&str]) -> Vec<PairedTable> {
    let ranked = report.evaluation.ranking.planners.iter();
    let most = match planners.len() {
        0 | 1 => 0,
        2..=ALL_PAIRS => planners.len(),
        _ => 1,
    };
    let metrics = || COMPARED.iter().filter_map(|column| Metric::named(column));
    let of = |ranked: &Ranked, metric: &Metric| {
        let baseline = planners.iter().position(|label| *label == ranked.planner)?;
        let comparison = compare_with(&report.trials, &ranked.planner, metric)?;
        let some = comparison.planners.iter().any(|one| one.paired.pairs > 0);
        if !some && *metric != SOLVE_TIME {
            return None;
        }
        let table = table::paired(&comparison);
        Some(PairedTable {
            baseline,
            metric: metric.column,
            note: table.note,
            head: table.head,
            rows: table.rows,
        })
    };
    ranked
        .take(most)
        .flat_map(|ranked| metrics().filter_map(move |metric| of(ranked, metric)))
        .collect()
}

fn ranks(report: &Report<'_>, planners: &[&str]) -> Vec<Option<[usize; 2]>> {
    let of = |label: &&str| {
        let mut standings = report.evaluation.standings.iter();
        standings.find(|one| one.planner == *label)?.ranks
    };
    planners.iter().map(of).collect()
}

/// The store of a trial in the words of a command line.
fn store(report: &Report<'_>, row: &Row) -> String {
    let store = report.subject.stores.get(&row.key);
    store.map_or_else(|| "STORE".to_owned(), |path| path.display().to_string())
}

/// The policy of the page.
pub(super) fn policy() -> String {
    fleetyard_view::policy(&SCRIPT)
}

/// The page.
pub(super) fn html(report: &Report<'_>) -> String {
    let booleans = COLUMNS.iter().filter(|c| c.kind == ColumnType::Boolean);
    let mut rows: Vec<&Row> = report.trials.rows().collect();
    rows.sort_by_key(|row| (row.trial, row.repeat, &row.planner, &row.key));
    let numbers = report.trials.numbers_by_key();
    let [clusters, maps] = [0, 1].map(|which| -> Vec<Option<f64>> {
        let number = |row: &&Row| Some(numbers.get(row.key.as_str())?[which] as f64);
        rows.iter().map(number).collect()
    });
    let outcomes = rows.iter().map(|row| row.failure());
    let planners = report.planners();
    let slot = |at: usize| {
        let ranked = report.evaluation.ranking.planners.get(at)?;
        planners.iter().position(|label| *label == ranked.planner)
    };
    let data = Data {
        rows: rows.len(),
        columns: pack(&rows),
        booleans: booleans.map(|column| column.name).collect(),
        outcome: pack_words(
            "outcome",
            outcomes.map(|failure| failure.unwrap_or_else(|| "success".to_owned())),
        ),
        scatter: [slot(0).unwrap_or(0), slot(1).unwrap_or(0)],
        order: report.subject.order,
        path_rule: report.subject.path_rule.as_deref(),
        places: &report.subject.places,
        metrics: METRICS.iter().map(Quantity::of).collect(),
        colors: COLORS,
        paired: paired_tables(report, &planners),
        entrants: pack_words("entrant", rows.iter().map(|row| row.entrant().into_owned())),
        questions: pack_words("question", rows.iter().map(|row| row.question().to_owned())),
        clusters: pack_numbers("clusters", &clusters),
        maps: pack_numbers("maps", &maps),
        ranks: ranks(report, &planners),
        unit: report.subject.unit.name(),
        quality: Quality::of(&rows, moments(&report.trials)),
        stores: pack_words("store", rows.iter().map(|row| store(report, row))),
        in_studio: report.subject.in_studio,
        planners,
    };
    // Numbers are finite and keys are text: there is nothing that JSON cannot hold.
    let data = embedded(&data).expect("the data can be written as JSON");
    let shell = Shell {
        title: &report.subject.title,
        style: STYLE,
        script: &SCRIPT,
        body: BODY,
    };
    shell.page(&[
        ("data", &data),
        ("story", &story(report)),
        ("methods", &list(&methods())),
        ("stability", &stability(report)),
        ("views", &views(report)),
        ("standings", &standings(report)),
        ("origin", &origin(report)),
    ])
}

fn story(report: &Report<'_>) -> String {
    let mut out = String::new();
    let mut rest = report.story().into_iter();
    for lead in rest.by_ref().take(1) {
        let _ = writeln!(out, "<p class=\"lead\">{}</p>", escape(&lead));
    }
    let more: Vec<String> = rest.chain(report.caveats()).collect();
    if !more.is_empty() {
        let _ = writeln!(
            out,
            "<details><summary>{} to know before this is believed</summary>\n{}</details>",
            table::plural(more.len(), "thing"),
            list(&more)
        );
    }
    out
}

fn list(entries: &[String]) -> String {
    if entries.is_empty() {
        return String::new();
    }
    let entries = entries
        .iter()
        .map(|entry| format!("<li>{}</li>\n", escape(entry)));
    format!("<ul>\n{}</ul>\n", entries.collect::<String>())
}

/// The agreement of the rankings of all trials, if there is more than one.
fn stability(report: &Report<'_>) -> String {
    let table = report.stability.as_ref().map(table::stability);
    table.map_or(String::new(), |table| fixed("stability", &table, false))
}

/// Views of tasks, if there are any: the first thing that is asked of them.
fn views(report: &Report<'_>) -> String {
    let table = table::views(&report.evaluation);
    table.map_or(String::new(), |table| fixed("views", &table, true))
}

/// Success, time and quality of all trials, and plans on the way, if there are any.
fn standings(report: &Report<'_>) -> String {
    let tables = [
        ("standings", table::standings(&report.evaluation)),
        ("shared", table::shared(&report.evaluation)),
        ("anytime", table::anytime(&report.evaluation)),
    ];
    let tables = tables
        .into_iter()
        .filter_map(|(id, table)| Some(fixed(id, &table?, false)));
    tables.collect()
}

/// A table of all trials, which no filter changes.
fn fixed(id: &str, table: &Table, open: bool) -> String {
    let line = |tag: &str, cells: &[String]| {
        let cells = cells.iter().zip(&table.words).map(|(text, words)| {
            let class = if *words { " class=\"text\"" } else { "" };
            format!("<{tag}{class}>{}</{tag}>", escape(text))
        });
        format!("<tr>{}</tr>\n", cells.collect::<String>())
    };
    let rows = table.rows.iter().map(|row| line("td", row));
    let open = if open { " open" } else { "" };
    format!(
        "<section id=\"{id}\" aria-labelledby=\"{id}-title\">\n<details{open}>\n\
         <summary><h2 id=\"{id}-title\">{}</h2></summary>\n<p class=\"note\">{} Of all trials, whatever is \
         filtered.</p>\n<div class=\"scroll\" tabindex=\"0\"><table>\n<thead>{}</thead>\n<tbody>\n{}</tbody>\n\
         </table></div>\n</details>\n</section>\n",
        escape(&table.title),
        escape(&table.note),
        line("th", &table.head),
        rows.collect::<String>()
    )
}

fn origin(report: &Report<'_>) -> String {
    let mut out = "<dl>\n".to_owned();
    for (name, value) in &report.subject.facts {
        let _ = writeln!(out, "<dt>{}</dt><dd>{}</dd>", escape(name), escape(value));
    }
    out.push_str("</dl>\n");
    for (name, text) in &report.subject.texts {
        let (name, text) = (escape(name), escape(text));
        let _ = writeln!(
            out,
            "<details><summary>{name}</summary><pre>{text}</pre></details>"
        );
    }
    out
}
