//! `fleetyard store export`: the trials of a store in the formats of other tools.

use std::path::{Path, PathBuf};

use clap::Args;
use fleetyard_bench::Store;
use fleetyard_bench::evaluate::Order;
use fleetyard_bench::export::{Format, export};
use fleetyard_core::write_all_atomically;
use serde_json::Value;

use super::convert::{refuse_input, to_stdout};
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
    /// The order of the ranking in Markdown; the suite's by default
    #[arg(long, value_parser = order, value_name = "ORDER")]
    ranking: Option<Order>,
}

/// What to write; `-` is standard output.
#[derive(Debug, Args)]
#[group(required = true, multiple = true)]
struct ExportFiles {
    /// Every column as CSV
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// CSV with the columns of the maze paper first
    #[arg(long, value_name = "FILE")]
    maze_csv: Option<PathBuf>,
    /// A JSON object per trial and line
    #[arg(long, value_name = "FILE")]
    jsonl: Option<PathBuf>,
    /// Apache Parquet
    #[arg(long, value_name = "FILE")]
    parquet: Option<PathBuf>,
    /// Tables: ranking, failures, paired comparison
    #[arg(long, value_name = "FILE")]
    markdown: Option<PathBuf>,
    /// A database for OMPL's Planner Arena
    #[arg(long, value_name = "FILE")]
    planner_arena: Option<PathBuf>,
}

fn order(text: &str) -> std::result::Result<Order, String> {
    let orders = [Order::Text, Order::Appendix];
    let found = orders.into_iter().find(|order| order.name() == text);
    found.ok_or_else(|| "it is `text` or `appendix`".into())
}

pub(super) fn export_store(arguments: &StoreExport) -> Result<Exit> {
    let store = Store::open_read_only(&arguments.store)?;
    let order = match arguments.ranking {
        Some(order) => order,
        None => order_of_suite(&store.meta()?.suite_values),
    };
    let files = &arguments.files;
    let wanted: Vec<(Format, &Path)> = [
        (Format::Csv, &files.csv),
        (Format::MazeCsv, &files.maze_csv),
        (Format::JsonLines, &files.jsonl),
        (Format::Parquet, &files.parquet),
        (Format::Markdown(order), &files.markdown),
        (Format::PlannerArena, &files.planner_arena),
    ]
    .into_iter()
    .filter_map(|(format, path)| Some((format, path.as_deref()?)))
    .collect();
    refuse_same(&wanted)?;
    for (_, path) in &wanted {
        refuse_input(path, &[&arguments.store])?;
    }
    let rows = store.rows()?;
    let mut written: Vec<(&Path, Vec<u8>)> = Vec::new();
    for (format, path) in wanted {
        written.push((path, export(format, &rows).map_err(internal)?));
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

/// Two formats in one file would leave the second.
fn refuse_same(wanted: &[(Format, &Path)]) -> Result<()> {
    for (at, (_, path)) in wanted.iter().enumerate() {
        if wanted[..at].iter().any(|(_, other)| other == path) {
            let reason = format!("two formats would be written to {}", path.display());
            return Err(Failure::new(Exit::Usage, reason).hint("give each a file of its own"));
        }
    }
    Ok(())
}

/// The order that the suite names.
fn order_of_suite(suite_values: &str) -> Order {
    let values: Value = serde_json::from_str(suite_values).unwrap_or_default();
    let named = values.pointer("/protocol/ranking").and_then(Value::as_str);
    named.and_then(|name| order(name).ok()).unwrap_or_default()
}
