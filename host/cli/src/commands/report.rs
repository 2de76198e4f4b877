//! `fleetyard report`: what the trials of stores say, in the terminal, as a page, as
//! Markdown, as figures and as CSV.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use clap::Args;
use fleetyard_bench::Row;
use fleetyard_bench::evaluate::{Order, RunComparison, TrialPair};
use fleetyard_bench::export::{Format as Export, export, without_formulas};
use fleetyard_bench::report::{Loaded, Report, Table, svg, two_runs};
use fleetyard_core::{InputError, nearest, write_all_atomically};
use serde_json::json;

use crate::args::{Format, Written, word};
use crate::exit::{Exit, Failure, Result, internal};
use crate::output;

/// Trials that are named where two runs differ.
const NAMED: usize = 10;

/// Show what the trials of a suite say: who is best, by how much, and how sure that is.
#[derive(Debug, Args)]
pub(crate) struct ReportArgs {
    /// Stores of `fleetyard bench`, whose trials are taken together
    #[arg(value_name = "STORE", required_unless_present = "compare")]
    stores: Vec<PathBuf>,
    /// Hold two runs of one suite against each other, given as two stores; or two planners
    /// of the STOREs, given as their labels
    #[arg(long, value_names = ["A", "B"], num_args = 2)]
    compare: Vec<String>,
    /// Only trials of this map; may be given several times
    #[arg(long, value_name = "NAME", requires = "stores")]
    map: Vec<String>,
    /// Order of the ranking [default: as the suite says]
    #[arg(long, value_parser = word::<Order>())]
    rank: Option<Order>,
    /// Write a page with filters, tables and figures, which needs no other file
    #[arg(long, value_name = "FILE", value_parser = |text: &str| Written::Html.path(text), requires = "stores")]
    html: Option<PathBuf>,
    /// Write Markdown with the same numbers
    #[arg(long, value_name = "FILE", value_parser = |text: &str| Written::Markdown.path(text), requires = "stores")]
    markdown: Option<PathBuf>,
    /// Write the figures for papers, a file each, into this folder
    #[arg(long, value_name = "DIR", requires = "stores")]
    svg: Option<PathBuf>,
    /// Write all trials, the columns of the maze paper first
    #[arg(long, value_name = "FILE", value_parser = |text: &str| Written::Csv.path(text), requires = "stores")]
    csv: Option<PathBuf>,
    /// In CSV, put a ' before texts that a spreadsheet would take for formulas
    #[arg(long, requires = "csv")]
    no_formulas: bool,
    #[command(flatten)]
    format: Format,
}

pub(crate) fn report(arguments: &ReportArgs) -> Result<Exit> {
    let runs = match &arguments.compare[..] {
        [a, b] if is_store(a) && is_store(b) => Some(compare_stores(a, b)?),
        [a, b] if arguments.stores.is_empty() => {
            let missing = if is_store(a) { b } else { a };
            let error = InputError::new(missing.as_str(), "there is no such store");
            return Err(error
                .hint("name two stores, or the stores in which these are labels of planners")
                .into());
        }
        _ => None,
    };
    if arguments.stores.is_empty() {
        if let Some((comparison, tables)) = runs {
            match arguments.format {
                Format::Json => output::print_json(&json!({ "runs": comparison }))?,
                Format::Text => output::print(&text_of_runs(&comparison, &tables))?,
            }
        }
        return Ok(Exit::Success);
    }
    let mut loaded = load(&arguments.stores, arguments.rank)?;
    keep_maps(&mut loaded, &arguments.map)?;
    let report = Report::new(loaded.subject, &loaded.rows);
    let mut more = Vec::new();
    if let Some((_, tables)) = &runs {
        more.extend(tables.iter().cloned());
    } else if let [a, b] = &arguments.compare[..] {
        more.push(compare_planners(&report, a, b)?);
    }
    write(arguments, &report, &loaded.rows, &more)?;
    match arguments.format {
        Format::Json => {
            let mut numbers = report.json().map_err(internal)?;
            if let Some((comparison, _)) = &runs {
                numbers["runs"] = serde_json::to_value(comparison).map_err(internal)?;
            } else if let [a, b] = &arguments.compare[..] {
                numbers["pair"] = report.pair_json(a, b).map_err(internal)?;
            }
            output::print_json(&numbers)?;
        }
        Format::Text => {
            let mut parts = vec![text_of(&report)];
            match &runs {
                Some((comparison, tables)) => parts.push(text_of_runs(comparison, tables)),
                None => parts.extend(more.iter().map(text_of_table)),
            }
            output::print(&parts.join("\n\n"))?;
        }
    }
    Ok(Exit::Success)
}

/// True if this names a file. Labels of planners seldom do; a store that is not there is told from
/// a label by how it looks.
fn is_store(name: &str) -> bool {
    Path::new(name).is_file()
}

/// All trials of the stores, with remarks for whoever asked.
pub(super) fn load(stores: &[PathBuf], rank: Option<Order>) -> Result<Loaded> {
    let loaded = Loaded::load(stores, rank)?;
    if loaded.doubled > 0 {
        output::note(&format!(
            "{} trials are in several stores; those of the last one are taken",
            loaded.doubled
        ));
    }
    if loaded.rows.is_empty() {
        output::warning("there are no trials in what was given");
    }
    Ok(loaded)
}

/// The name that was meant, or else all that there are.
fn known_names(name: &str, known: &[&str], what: &str) -> String {
    nearest(name, known.iter().copied(), 3).map_or_else(
        || format!("{what} are: {}", known.join(", ")),
        |name| format!("there is `{name}`"),
    )
}

/// Leaves the trials of some maps; of all, if none is named.
fn keep_maps(loaded: &mut Loaded, maps: &[String]) -> Result<()> {
    if maps.is_empty() {
        return Ok(());
    }
    let known: BTreeSet<&str> = loaded.rows.iter().map(|row| row.map.as_str()).collect();
    for map in maps {
        if !known.contains(map.as_str()) {
            let message = format!("there is no trial of a map `{map}`");
            let known: Vec<&str> = known.into_iter().collect();
            let hint = known_names(map, &known, "maps");
            return Err(Failure::new(Exit::Input, message).hint(hint));
        }
    }
    loaded.rows.retain(|row| maps.contains(&row.map));
    // Nobody says how many of them the suite asks for.
    loaded.subject.asked = None;
    for map in maps {
        let _ = write!(loaded.subject.title, ", {map}");
    }
    Ok(())
}

fn compare_stores(a: &str, b: &str) -> Result<(RunComparison, Vec<Table>)> {
    let [in_a, in_b] = [load(&[a.into()], None)?, load(&[b.into()], None)?];
    let found = two_runs(in_a.subject.unit, (a, &in_a.rows), (b, &in_b.rows));
    if found.0.pairs == 0 {
        output::warning("the stores have no trial in common");
    }
    Ok(found)
}

fn compare_planners(report: &Report<'_>, a: &str, b: &str) -> Result<Table> {
    let labels = report.planners();
    for name in [a, b] {
        if !labels.contains(&name) {
            let message = format!("`{name}` is neither a store nor the label of a planner");
            let hint = known_names(name, &labels, "labels");
            return Err(Failure::new(Exit::Input, message).hint(hint));
        }
    }
    if a == b {
        let failure = Failure::new(Exit::Usage, format!("`{a}` is compared with itself"));
        return Err(failure.hint("name two planners"));
    }
    let table = report.two_planners(a, b);
    table.ok_or_else(|| internal("a planner is in the report and is not"))
}

/// Writes all files that were asked for: each whole, none before all are made.
fn write(arguments: &ReportArgs, report: &Report<'_>, rows: &[Row], more: &[Table]) -> Result<()> {
    let mut files: Vec<(PathBuf, Vec<u8>)> = Vec::new();
    if let Some(folder) = &arguments.svg {
        fs::create_dir_all(folder).map_err(|error| {
            let reason = format!("cannot be made: {error}");
            InputError::new(folder.display().to_string(), reason)
        })?;
        for figure in report.figures() {
            let path = folder.join(format!("{}.svg", figure.id));
            files.push((path, svg(&figure).into_bytes()));
        }
    }
    if let Some(path) = &arguments.markdown {
        let folder = arguments.svg.as_deref().map(|to| way(path, to));
        let text = report.markdown(folder.as_deref(), more);
        files.push((path.clone(), text.into_bytes()));
    }
    if let Some(path) = &arguments.csv {
        let csv = export(Export::MazeCsv, rows).map_err(internal)?;
        let csv = if arguments.no_formulas {
            without_formulas(&csv).map_err(internal)?
        } else {
            csv
        };
        files.push((path.clone(), csv));
    }
    if let Some(path) = &arguments.html {
        files.push((path.clone(), report.html().into_bytes()));
    }
    let files: Vec<(&Path, &[u8])> = (files.iter())
        .map(|(path, bytes)| (path.as_path(), bytes.as_slice()))
        .collect();
    write_all_atomically(&files)?;
    Ok(())
}

/// Path from a file's own folder to a folder, where that is possible.
fn way(file: &Path, folder: &Path) -> String {
    let whole = |path: &Path| std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    let (file, folder) = (whole(file), whole(folder));
    let from = file.parent().unwrap_or(&file);
    let common = (from.components())
        .zip(folder.components())
        .take_while(|(a, b)| a == b)
        .count();
    let up = from.components().skip(common).map(|_| "..".to_owned());
    let down = folder.components().skip(common);
    let down = down.map(|part| part.as_os_str().to_string_lossy().into_owned());
    let parts: Vec<String> = up.chain(down).collect();
    if parts.is_empty() {
        ".".to_owned()
    } else {
        parts.join("/")
    }
}

fn text_of(report: &Report<'_>) -> String {
    let mut parts = vec![report.story().join("\n")];
    let caveats = report.caveats();
    if !caveats.is_empty() {
        let lines: Vec<String> = caveats.iter().map(|line| format!("- {line}")).collect();
        parts.push(lines.join("\n"));
    }
    parts.extend(report.tables().iter().map(text_of_table));
    output::plain(&parts.join("\n\n"))
}

fn text_of_table(table: &Table) -> String {
    let head: Vec<&str> = table.head.iter().map(String::as_str).collect();
    let numbers = table.words.iter().enumerate();
    let numbers: Vec<usize> = numbers.filter(|(_, words)| !**words).map(|n| n.0).collect();
    let one_line = |cell: &String| output::plain(&cell.replace(['\n', '\t'], " "));
    let rows = table
        .rows
        .iter()
        .map(|row| row.iter().map(one_line).collect());
    let cells = output::table(&head, rows.collect(), &numbers);
    let mut parts = vec![output::plain(&table.title), cells];
    if !table.note.is_empty() {
        parts.push(output::plain(&table.note));
    }
    parts.join("\n")
}

/// Both runs, and which trials differ.
fn text_of_runs(comparison: &RunComparison, tables: &[Table]) -> String {
    let mut parts: Vec<String> = tables.iter().map(text_of_table).collect();
    let mut lines = Vec::new();
    let mut name = |planner: &str, what: &str, trials: &[TrialPair]| {
        if trials.is_empty() {
            return;
        }
        let numbers = trials.iter().take(NAMED).map(|pair| pair.a.to_string());
        let numbers: Vec<String> = numbers.collect();
        let rest = match trials.len().saturating_sub(NAMED) {
            0 => String::new(),
            rest => format!(" and {rest} more"),
        };
        lines.push(format!(
            "{planner}: {what} in trials {}{rest}",
            numbers.join(", ")
        ));
    };
    for planner in &comparison.planners {
        name(&planner.planner, "succeeded in A alone", &planner.lost);
        name(&planner.planner, "succeeded in B alone", &planner.won);
        name(&planner.planner, "plans differ", &planner.plans.different);
        name(&planner.planner, "traces differ", &planner.traces.different);
    }
    if !lines.is_empty() {
        parts.push(output::plain(&lines.join("\n")));
    }
    parts.join("\n\n")
}

#[cfg(test)]
mod tests {
    use super::way;
    use std::path::Path;

    #[test]
    fn a_folder_is_named_from_where_the_file_is() {
        let cases = [
            ("out/report.md", "out/figures", "figures"),
            ("report.md", "figures", "figures"),
            ("out/report.md", "figures", "../figures"),
            ("out/report.md", "out", "."),
        ];
        for (file, folder, expected) in cases {
            assert_eq!(
                way(Path::new(file), Path::new(folder)),
                expected,
                "{file} {folder}"
            );
        }
    }
}
