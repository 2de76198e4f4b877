//! `fleetyard store export`: the trials of a store in the formats of other tools.

use std::path::{Path, PathBuf};

use clap::Args;
use fleetyard_bench::evaluate::Order;
use fleetyard_bench::export::{Format, export, without_formulas};
use fleetyard_bench::report::Report;
use fleetyard_core::write_all_atomically;

use super::convert::{refuse_input, to_stdout};
use super::report::load;
use crate::args::{Written, word};
use crate::exit::{Exit, Failure, Result, internal};
use crate::output;

/// Write the trials of a store in the formats of other tools.
#[derive(Debug, Args)]
pub(crate) struct StoreExport {
    /// The store
    #[arg(value_name = "STORE")]
    store: PathBuf,
    #[command(flatten)]
    files: ExportFiles,
    /// In CSV, put a ' before texts that a spreadsheet would take for formulas
    #[arg(long)]
    no_formulas: bool,
    /// Order of the ranking in Markdown [default: as the suite says]
    #[arg(long, value_parser = word::<Order>())]
    rank: Option<Order>,
}

/// The files to write; `-` is standard output.
#[derive(Debug, Args)]
#[group(required = true, multiple = true)]
struct ExportFiles {
    /// Every column as CSV
    #[arg(long, value_name = "FILE", value_parser = |text: &str| Written::Csv.path(text))]
    csv: Option<PathBuf>,
    /// CSV with the columns of the maze paper first
    #[arg(long, value_name = "FILE", value_parser = |text: &str| Written::Csv.path(text))]
    maze_csv: Option<PathBuf>,
    /// A JSON object per trial and line
    #[arg(long, value_name = "FILE", value_parser = |text: &str| Written::JsonLines.path(text))]
    jsonl: Option<PathBuf>,
    /// Apache Parquet
    #[arg(long, value_name = "FILE", value_parser = |text: &str| Written::Parquet.path(text))]
    parquet: Option<PathBuf>,
    /// The Markdown of `fleetyard report`
    #[arg(long, value_name = "FILE", value_parser = |text: &str| Written::Markdown.path(text))]
    markdown: Option<PathBuf>,
    /// A database for OMPL's Planner Arena
    #[arg(long, value_name = "FILE")]
    planner_arena: Option<PathBuf>,
}

pub(super) fn export_store(arguments: &StoreExport) -> Result<Exit> {
    let files = &arguments.files;
    let wanted: Vec<(Option<Format>, &Path)> = [
        (Some(Format::Csv), &files.csv),
        (Some(Format::MazeCsv), &files.maze_csv),
        (Some(Format::JsonLines), &files.jsonl),
        (Some(Format::Parquet), &files.parquet),
        (Some(Format::PlannerArena), &files.planner_arena),
        (None, &files.markdown),
    ]
    .into_iter()
    .filter_map(|(format, path)| Some((format, path.as_deref()?)))
    .collect();
    for (at, (_, path)) in wanted.iter().enumerate() {
        refuse_input(path, &[&arguments.store])?;
        // Two formats in one file would leave the second.
        if wanted[..at].iter().any(|(_, other)| other == path) {
            let reason = format!("two formats would be written to {}", path.display());
            return Err(Failure::new(Exit::Usage, reason).hint("give each a file of its own"));
        }
    }
    if arguments.no_formulas && files.csv.is_none() && files.maze_csv.is_none() {
        let reason = "--no-formulas is about CSV, and none is written";
        return Err(Failure::new(Exit::Usage, reason).hint("add --csv FILE or --maze-csv FILE"));
    }
    let loaded = load(std::slice::from_ref(&arguments.store), arguments.rank)?;
    let mut written: Vec<(&Path, Vec<u8>)> = Vec::new();
    for (format, path) in wanted {
        let bytes = if let Some(format) = format {
            let bytes = export(format, &loaded.rows).map_err(internal)?;
            match format {
                Format::Csv | Format::MazeCsv if arguments.no_formulas => {
                    without_formulas(&bytes).map_err(internal)?
                }
                _ => bytes,
            }
        } else {
            let report = Report::new(loaded.subject.clone(), &loaded.rows);
            report.markdown(None, &[]).into_bytes()
        };
        written.push((path, bytes));
    }
    let (printed, files): (Vec<_>, Vec<_>) =
        written.into_iter().partition(|(path, _)| is_stdout(path));
    let files: Vec<(&Path, &[u8])> = files
        .iter()
        .map(|(path, bytes)| (*path, &**bytes))
        .collect();
    write_all_atomically(&files)?;
    if let Some((_, bytes)) = printed.first() {
        return to_stdout(bytes);
    }
    for (path, _) in files {
        output::print(&path.display().to_string())?;
    }
    Ok(Exit::Success)
}

fn is_stdout(path: &Path) -> bool {
    path == Path::new("-")
}
