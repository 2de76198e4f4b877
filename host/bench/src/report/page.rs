//! The report as one HTML page that needs no network and no other file.
//!
//! The page's own parts are in `page/`; this module fills in the trials. Whatever names
//! and messages contain, they are text: they are escaped in HTML and in JSON, and the
//! page's policy lets nothing be loaded.

use std::fmt::Write as _;

use fleetyard_view::escape;
use serde::Serialize;

use super::Report;
use super::columns::{Packed, pack};
use super::figures::{METRICS, Metric};
use super::palette::COLORS;
use crate::{COLUMNS, ColumnType};

const PAGE: &str = include_str!("page/page.html");
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
    planners: &'a [String],
    ranking: &'a str,
    metrics: &'static [Metric],
    colors: [&'static str; COLORS.len()],
}

/// The page.
pub(super) fn html(report: &Report) -> String {
    let booleans = COLUMNS.iter().filter(|c| c.kind == ColumnType::Boolean);
    let data = Data {
        rows: report.rows.len(),
        columns: pack(&report.rows),
        booleans: booleans.map(|column| column.name).collect(),
        planners: &report.planners,
        ranking: &report.ranking,
        metrics: METRICS,
        colors: COLORS,
    };
    // Numbers are finite and keys are text: there is nothing that JSON cannot hold.
    let data = serde_json::to_string(&data).expect("the data can be written as JSON");
    // No `<` may end the element that holds it.
    let data = data.replace('<', "\\u003c");
    let title = escape(&report.title);
    let script = SCRIPT.concat();
    let (story, methods, origin) = (story(report), list(&report.methods), origin(report));
    let mut page = String::with_capacity(data.len() + PAGE.len() + STYLE.len() + script.len() + 4096);
    let mut rest = PAGE;
    while let Some((before, (name, after))) = rest
        .split_once("{{")
        .and_then(|(before, rest)| Some((before, rest.split_once("}}")?)))
    {
        page.push_str(before);
        page.push_str(match name {
            "title" => &title,
            "style" => STYLE,
            "script" => &script,
            "data" => &data,
            "story" => &story,
            "methods" => &methods,
            "origin" => &origin,
            other => unreachable!("page.html has no {other}"),
        });
        rest = after;
    }
    page.push_str(rest);
    page
}

fn story(report: &Report) -> String {
    let mut out = String::new();
    for (index, paragraph) in report.story.iter().enumerate() {
        let class = if index == 0 { " class=\"lead\"" } else { "" };
        let _ = writeln!(out, "<p{class}>{}</p>", escape(paragraph));
    }
    out + &list(&report.caveats)
}

fn list(entries: &[String]) -> String {
    if entries.is_empty() {
        return String::new();
    }
    let entries = entries.iter().map(|entry| format!("<li>{}</li>\n", escape(entry)));
    format!("<ul>\n{}</ul>\n", entries.collect::<String>())
}

fn origin(report: &Report) -> String {
    let mut out = "<dl>\n".to_owned();
    for (name, value) in &report.facts {
        let _ = writeln!(out, "<dt>{}</dt><dd>{}</dd>", escape(name), escape(value));
    }
    out.push_str("</dl>\n");
    for (name, text) in &report.texts {
        let (name, text) = (escape(name), escape(text));
        let _ = writeln!(
            out,
            "<details><summary>{name}</summary><pre>{text}</pre></details>"
        );
    }
    out
}
