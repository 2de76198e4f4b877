//! `fleetyard store`: looks at the stores of suites, joins them, writes them in other formats.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::Subcommand;
use fleetyard_bench::Store;
use fleetyard_bench::evaluate::{PlannerSummary, Trials};
use fleetyard_runtime::CodeFile;
use serde::Serialize;
use serde_json::Value;

use super::bundle::{StoreBundle, StoreRepeat, bundle_store, repeat};
use super::export::{StoreExport, export_store};
use crate::args::Format;
use crate::exit::{Exit, Result};
use crate::output;

/// The subcommands for stores.
#[derive(Debug, Subcommand)]
pub(crate) enum Stores {
    /// Say what a store has
    Info {
        /// The store
        store: PathBuf,
        #[command(flatten)]
        format: Format,
    },
    /// Join the stores of a suite's shards into a new one
    Merge {
        /// The store to write
        out: PathBuf,
        /// The stores to read
        #[arg(required = true)]
        parts: Vec<PathBuf>,
    },
    Export(StoreExport),
    Bundle(StoreBundle),
    Repeat(StoreRepeat),
}

pub(crate) fn stores(what: &Stores) -> Result<Exit> {
    match what {
        Stores::Info { store, format } => info(store, *format),
        Stores::Merge { out, parts } => merge(out, parts),
        Stores::Export(arguments) => export_store(arguments),
        Stores::Bundle(arguments) => bundle_store(arguments),
        Stores::Repeat(arguments) => repeat(arguments),
    }
}

fn merge(out: &Path, parts: &[PathBuf]) -> Result<Exit> {
    let merged = Store::merge(out, parts)?;
    let mut text = format!("{} has {} trials", out.display(), merged.trials);
    if merged.repeated > 0 {
        let _ = write!(text, "; {} were in several stores", merged.repeated);
    }
    output::print(&output::plain(&text))?;
    Ok(Exit::Success)
}

/// The content of a store, as JSON.
#[derive(Serialize)]
struct Info<'a> {
    format: &'static str,
    store: &'a Path,
    suite: String,
    suite_digest: String,
    suite_values: Value,
    suite_text: String,
    fleetyard: String,
    created_unix_ms: u64,
    trials: u64,
    superseded: u64,
    planners: Vec<PlannerSummary>,
    machines: BTreeMap<String, Value>,
    code: BTreeMap<String, Vec<CodeFile>>,
}

fn info(place: &Path, format: Format) -> Result<Exit> {
    let store = Store::open_read_only(place)?;
    let meta = store.meta()?;
    let rows = store.rows()?;
    let trials = Trials::new(&rows);
    let shared = trials.shared();
    let (current, superseded) = store.counts()?;
    let machines = store.machines()?.into_iter();
    let info = Info {
        format: "fleetyard.store-info/1",
        store: place,
        suite: meta.suite,
        suite_digest: meta.suite_digest,
        suite_values: serde_json::from_str(&meta.suite_values).unwrap_or_default(),
        suite_text: meta.suite_text,
        fleetyard: meta.fleetyard,
        created_unix_ms: meta.created_unix_ms,
        trials: current,
        superseded,
        planners: (trials.planners().iter())
            .map(|planner| PlannerSummary::of(planner, &shared))
            .collect(),
        machines: machines
            .map(|(digest, text)| (digest, serde_json::from_str(&text).unwrap_or_default()))
            .collect(),
        code: store.code()?,
    };
    match format {
        Format::Json => output::print_json(&info)?,
        Format::Text => output::print(&output::plain(&text(&info)))?,
    }
    Ok(Exit::Success)
}

fn text(info: &Info<'_>) -> String {
    let mut text = format!(
        "suite     {}\ndigest    {}\nwritten   by fleetyard {}\ntrials    {}",
        info.suite, info.suite_digest, info.fleetyard, info.trials
    );
    if info.superseded > 0 {
        let _ = write!(text, "\napart     {} of an earlier state", info.superseded);
    }
    for (digest, machine) in &info.machines {
        let model = machine["cpu_model"].as_str().unwrap_or("unknown processor");
        let _ = write!(text, "\nmachine   {digest} {model}");
    }
    let lines = info.planners.iter().map(|planner| {
        vec![
            planner.planner.clone(),
            planner.planner_id.clone(),
            planner.versions.join(", "),
            planner.trials.to_string(),
            planner.successes.to_string(),
            planner.cases.to_string(),
        ]
    });
    let header = ["planner", "plugin", "version", "trials", "solved", "cases"];
    text += "\n\n";
    text += &output::table(&header, lines.collect(), &[3, 4, 5]);
    text
}
