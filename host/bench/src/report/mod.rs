//! Reports: what the trials of a suite say, as a page, as Markdown, as figures for
//! papers, and as tables for a terminal.
//!
//! All of them show what [`evaluate`](crate::evaluate) finds, and nothing else: numbers in
//! text, tables and figures are the same. The page has all trials in it and makes tables
//! and figures of those that pass its filters by the same definitions (`page/evaluate.js`);
//! a test in a real browser holds both against each other.

mod columns;
mod figure;
mod figures;
mod format;
mod load;
mod markdown;
mod page;
mod palette;
mod story;
mod svg;
mod table;

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde::Serialize;

pub use figure::{Axis, Figure, Marks, Series};
pub use load::Loaded;
pub use svg::svg;
pub use table::Table;

use crate::evaluate::{
    Against, Dimension, Evaluation, METRICS, Order, RankStability, Success, Trials, Unit, censored,
    compare_runs, compare_with, groups, rank_stability,
};
use crate::{Places, Row};
use figures::Maker;

/// The subject of a report.
#[derive(Debug, Clone, Default)]
pub struct Subject {
    /// Name of the suite.
    pub title: String,
    /// The purpose of the suite.
    pub description: Option<String>,
    /// Trials that the suites ask for; absent where a store does not say.
    pub asked: Option<u64>,
    /// The order of the ranking.
    pub order: Order,
    /// The unit to which results are generalised.
    pub unit: Unit,
    /// The rule that paths were judged by, if it is not the usual one.
    pub path_rule: Option<String>,
    /// The places of suites' files, for commands that make a trial again.
    pub places: Places,
    /// The store of each trial, by its key: a page says there how the studio opens it.
    pub stores: BTreeMap<String, PathBuf>,
    /// True of a page that the studio serves: it links to its trials there.
    pub in_studio: bool,
    /// The origin of the trials: names and values.
    pub facts: Vec<(String, String)>,
    /// Longer texts: names and what they say, such as the suite's file.
    pub texts: Vec<(String, String)>,
}

/// A report of trials.
#[derive(Debug)]
pub struct Report<'a> {
    subject: Subject,
    trials: Trials<'a>,
    evaluation: Evaluation,
    stability: Option<RankStability>,
}

/// All numbers of a report.
#[derive(Serialize)]
struct Numbers<'a> {
    title: &'a str,
    story: Vec<String>,
    /// The sentence of the story and the page about who is best.
    headline: Option<String>,
    caveats: Vec<String>,
    facts: &'a [(String, String)],
    #[serde(flatten)]
    evaluation: &'a Evaluation,
    stability: Option<&'a RankStability>,
    figures: Vec<Figure>,
}

impl<'a> Report<'a> {
    /// Of rows in any order, of which each has a key of its own.
    pub fn new(subject: Subject, rows: impl IntoIterator<Item = &'a Row>) -> Self {
        let trials = Trials::speaking_for(subject.unit, rows);
        let evaluation = Evaluation::of(&trials, subject.order);
        let stability = stability(&trials, subject.order);
        Self {
            subject,
            trials,
            evaluation,
            stability,
        }
    }

    /// The first sentences: what was run, and who is best.
    pub fn story(&self) -> Vec<String> {
        story::story(&self.subject, &self.evaluation)
    }

    /// The sentences about what to be careful with.
    pub fn caveats(&self) -> Vec<String> {
        story::caveats(&self.trials, &self.evaluation)
    }

    /// Views of tasks if there are any, ranking, standings, means over what all solved, plans on the way, paired comparisons of times and
    /// of costs, how rankings agree where instances differ, and failures, if there are any.
    pub fn tables(&self) -> Vec<Table> {
        let mut tables = Vec::from_iter(table::views(&self.evaluation));
        tables.push(table::ranking(&self.evaluation));
        tables.extend(table::standings(&self.evaluation));
        tables.extend(table::shared(&self.evaluation));
        tables.extend(table::anytime(&self.evaluation));
        let Evaluation {
            comparison, costs, ..
        } = &self.evaluation;
        tables.extend([comparison, costs].into_iter().flatten().map(table::paired));
        tables.extend(self.stability.as_ref().map(table::stability));
        tables.extend(table::failures(&self.evaluation));
        tables
    }

    /// Two of its planners, metric by metric; `None` if there is no such label.
    pub fn two_planners(&self, a: &str, b: &str) -> Option<Table> {
        table::two_planners(&self.trials, a, b)
    }

    /// Labels of planners in the suite's order.
    pub fn planners(&self) -> Vec<&str> {
        let planners = self.trials.planners().iter();
        planners.map(|planner| &*planner.label).collect()
    }

    /// All that have something to show.
    pub fn figures(&self) -> Vec<Figure> {
        Maker::new(&self.trials, &self.evaluation).all()
    }

    /// The policy of the page, which lets it load nothing and run its own script alone.
    pub fn policy() -> String {
        page::policy()
    }

    /// The page, of which nothing is outside.
    pub fn html(&self) -> String {
        page::html(self)
    }

    /// Markdown, with links to figures in a folder if it is given, and with further tables.
    pub fn markdown(&self, folder: Option<&str>, more: &[Table]) -> String {
        let mut out = String::new();
        markdown::paragraphs(
            &mut out,
            &self.subject.title,
            &self.story(),
            &self.caveats(),
        );
        for table in self.tables().iter().chain(more) {
            markdown::table(&mut out, table);
        }
        if let Some(folder) = folder {
            markdown::figures(&mut out, &self.figures(), folder);
        }
        markdown::section(&mut out, "Methods");
        markdown::list(&mut out, &story::methods());
        markdown::facts(&mut out, &self.subject.facts);
        out.truncate(out.trim_end().len());
        out.push('\n');
        out
    }

    /// Two of its planners in numbers, metric by metric: values of the second less those of
    /// the first.
    pub fn pair_json(&self, a: &str, b: &str) -> serde_json::Result<serde_json::Value> {
        let mut pair = serde_json::Map::new();
        for metric in METRICS {
            let comparison = compare_with(&self.trials, a, metric);
            let planners = comparison.into_iter().flat_map(|found| found.planners);
            let mut found = planners.filter(|one| one.planner == b && one.paired.pairs > 0);
            if let Some(Against { paired, .. }) = found.next() {
                pair.insert(metric.column.to_owned(), serde_json::to_value(paired)?);
            }
        }
        if let Some((first, second)) = self.trials.planner(a).zip(self.trials.planner(b)) {
            let solved = Success::between(first, second);
            pair.insert("success".to_owned(), serde_json::to_value(solved)?);
        }
        if let Some(found) = censored(&self.trials, a, b) {
            pair.insert("censored".to_owned(), serde_json::to_value(found)?);
        }
        Ok(pair.into())
    }

    /// All numbers, those of the figures too.
    pub fn json(&self) -> serde_json::Result<serde_json::Value> {
        serde_json::to_value(Numbers {
            title: &self.subject.title,
            story: self.story(),
            headline: (self.evaluation.lead.as_ref())
                .map(|lead| story::headline(lead, &self.evaluation.overview)),
            caveats: self.caveats(),
            facts: &self.subject.facts,
            evaluation: &self.evaluation,
            stability: self.stability.as_ref(),
            figures: self.figures(),
        })
    }
}

/// The agreement of rankings: of mazes by algorithm and size, of others by map and team size, as
/// far
/// as these differ.
fn stability(trials: &Trials<'_>, order: Order) -> Option<RankStability> {
    let mazes = trials.rows().all(|row| row.maze_width.is_some());
    let mut by = if mazes {
        vec![Dimension::MazeAlgorithm, Dimension::MazeSize]
    } else {
        vec![Dimension::Map, Dimension::Agents]
    };
    by.retain(|dimension| groups(trials.rows(), &[*dimension]).len() > 1);
    if by.is_empty() {
        return None;
    }
    let found = rank_stability(trials.rows(), &by, order);
    (found.planners.len() > 1).then_some(found)
}

/// Two runs of one suite beside each other, under these names.
pub fn two_runs<'a>(
    unit: Unit,
    a: (&str, impl IntoIterator<Item = &'a Row>),
    b: (&str, impl IntoIterator<Item = &'a Row>),
) -> (crate::evaluate::RunComparison, Vec<Table>) {
    let comparison = compare_runs(unit, a.1, b.1);
    let tables = table::two_runs(&comparison, a.0, b.0);
    (comparison, tables)
}
