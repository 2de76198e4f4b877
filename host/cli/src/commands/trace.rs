//! `fleetyard trace`: what a trace file says, where two differ, and other files of one.

use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};
use fleetyard_bench::number;
use fleetyard_core::{InputError, open_input};
use fleetyard_sim::trace::{
    Cells, Counts, Difference, Entry, Exporter, FieldDifference, Outputs, Scene, TraceContents,
};
use fleetyard_sim::{Event, TraceReader, TraceSink};
use indicatif::ProgressBar;
use serde_json::{Value, json};

use super::convert::refuse_input;
use super::show::{Shown, ShownArgs};
use crate::args::{Format, Written, not_negative};
use crate::exit::{Exit, Failure, Result, internal};
use crate::files::{Unnamed, file_name, keep};
use crate::output;

#[derive(Debug, Subcommand)]
pub(crate) enum Trace {
    /// Say what a trace is about and whether it is whole; the exit code is 3 if not
    Info {
        /// The trace
        file: PathBuf,
        #[command(flatten)]
        format: Format,
    },
    Diff(TraceDiff),
    Export(Box<TraceExport>),
}

/// Find where two traces differ first; the exit code is 1 if they do.
#[derive(Debug, Args)]
pub(crate) struct TraceDiff {
    /// A trace
    #[arg(value_name = "A")]
    a: PathBuf,
    /// Another one
    #[arg(value_name = "B")]
    b: PathBuf,
    /// Largest difference of values, in metres, radians and seconds
    #[arg(long, value_name = "DISTANCE", default_value_t = 0.0, value_parser = |text: &str| not_negative(text, "tolerance"))]
    tolerance: f64,
    #[command(flatten)]
    format: Format,
}

/// Write states and events of a trace to other files.
#[derive(Debug, Args)]
#[command(group(clap::ArgGroup::new("targets").required(true).multiple(true)))]
pub(crate) struct TraceExport {
    /// The trace
    file: PathBuf,
    /// Write states as CSV, a line for every body at every tick
    #[arg(long, value_name = "FILE", value_parser = |text: &str| Written::Csv.path(text), group = "targets")]
    csv: Option<PathBuf>,
    /// Write events as CSV
    #[arg(long, value_name = "FILE", value_parser = |text: &str| Written::Csv.path(text), group = "targets")]
    events: Option<PathBuf>,
    /// Write goals, calls and notices of a fleet as CSV
    #[arg(long, value_name = "FILE", value_parser = |text: &str| Written::Csv.path(text), group = "targets")]
    journal: Option<PathBuf>,
    /// Write everything as one JSON document
    #[arg(long, value_name = "FILE", value_parser = |text: &str| Written::Json.path(text), group = "targets")]
    json: Option<PathBuf>,
    /// Leave out all states but those of every n-th tick, in CSV and JSON
    #[arg(long, value_name = "N", default_value_t = 1,
          value_parser = clap::value_parser!(u32).range(1..))]
    every: u32,
    #[command(flatten)]
    shown: ShownArgs,
}

pub(crate) fn trace(what: &Trace) -> Result<Exit> {
    match what {
        Trace::Info { file, format } => info(file, *format),
        Trace::Diff(arguments) => diff(arguments),
        Trace::Export(arguments) => export(arguments),
    }
}

type Reader = TraceReader<BufReader<Watched>>;

/// A file whose bytes a bar counts.
struct Watched {
    file: File,
    bar: ProgressBar,
}

impl Read for Watched {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let read = self.file.read(buffer)?;
        self.bar.inc(read as u64);
        Ok(read)
    }
}

/// A bar of the bytes that these have together.
fn watch(paths: &[&Path]) -> ProgressBar {
    let bytes = |path: &&Path| std::fs::metadata(path).map_or(0, |meta| meta.len());
    output::bytes(paths.iter().map(bytes).sum())
}

fn open(path: &Path, bar: &ProgressBar) -> std::result::Result<Reader, InputError> {
    let name = path.display().to_string();
    let file = open_input(path).map_err(|mut error| {
        let written = "`fleetyard run --trace FILE` writes one";
        error.hint.get_or_insert_with(|| written.into());
        error
    })?;
    let bar = bar.clone();
    let input = BufReader::with_capacity(1 << 16, Watched { file, bar });
    TraceReader::open(input, name)
}

/// Exit code and message for what was read of a trace.
fn verdict(contents: &TraceContents) -> Exit {
    match &contents.damage {
        None => Exit::Success,
        Some(damage) => {
            output::error(&damage.to_string());
            if let Some(hint) = &damage.hint {
                output::hint(hint);
            }
            Exit::Input
        }
    }
}

// ---- info ------------------------------------------------------------------------------

fn info(path: &Path, format: Format) -> Result<Exit> {
    let mut counts = Counts::default();
    let bytes = std::fs::metadata(path).map_or(0, |meta| meta.len());
    let bar = watch(&[path]);
    let contents = open(path, &bar)?.replay(&mut counts).map_err(internal)?;
    bar.finish_and_clear();
    match format {
        Format::Json => output::print_json(&json!({
            "file": path.display().to_string(),
            "bytes": bytes,
            "intact_bytes": contents.intact_bytes,
            "damage": contents.damage.as_ref().map(|damage| &damage.reason),
            "header": contents.header,
            "scene": scene_info(&contents.header.scene),
            "states": contents.states,
            "last_tick": contents.last_tick,
            "events": contents.events,
            "entries": contents.entries,
            "remarks": contents.remarks,
            "counts": counts,
            "summary": contents.end,
        }))?,
        Format::Text => output::print(&info_text(path, bytes, &contents, &counts))?,
    }
    Ok(verdict(&contents))
}

fn scene_info(scene: &Scene) -> Value {
    let cells = scene.cells.as_ref().map(|cells| {
        json!({
            "rows": cells.rows(),
            "cols": cells.cols(),
            "cell_size_m": cells.cell_size_m(),
            "solid": count(Some(cells)),
        })
    });
    json!({
        "cells": cells,
        "endpoints": count(scene.endpoints.as_ref()),
        "workstations": count(scene.workstations.as_ref()),
        "polygons": scene.polygons_m.len(),
        "outline": scene.outline_m.len(),
        "roadmap": scene.roadmap_m.len(),
        "goals": scene.goals_m.len(),
    })
}

/// Number of cells.
fn count(cells: Option<&Cells>) -> u64 {
    let runs = cells.into_iter().flat_map(Cells::in_rows);
    runs.map(|(_, _, length)| u64::from(length)).sum()
}

fn info_text(path: &Path, bytes: u64, contents: &TraceContents, counts: &Counts) -> String {
    let header = &contents.header;
    let mut out = String::new();
    let mut line = |label: &str, value: String| output::labelled(&mut out, label, value);
    line("trace", format!("{}, {bytes} bytes", file_name(path)));
    line(
        "state of the file",
        match (&contents.damage, &contents.end) {
            (None, Some(_)) if header.state_every == 1 => {
                "intact, states and events match their digests".to_owned()
            }
            (None, _) => "intact, events match their digest".to_owned(),
            (Some(_), _) => format!("damaged, {} bytes are intact", contents.intact_bytes),
        },
    );
    line("written by", header.program.clone());
    let movers = match header.movers {
        0 => String::new(),
        movers => format!(", {movers} moving obstacles"),
    };
    line("agents", format!("{}{movers}", header.agents));
    for profile in &header.profiles {
        let model = match profile.model.as_str() {
            "" => String::new(),
            model => format!(", {model}"),
        };
        line("  profile", format!("{}{model}", profile.name));
    }
    let scene = &header.scene;
    if let Some(cells) = &scene.cells {
        let (rows, cols, side) = (cells.rows(), cells.cols(), cells.cell_size_m());
        line("map", format!("{rows} × {cols} cells of {side} m"));
    }
    let [endpoints, workstations] =
        [&scene.endpoints, &scene.workstations].map(|cells| count(cells.as_ref()));
    if endpoints + workstations > 0 {
        let stations = format!("{workstations} workstations, {endpoints} endpoints");
        line("stations", stations);
    }
    if !scene.polygons_m.is_empty() {
        line("obstacles", format!("{} polygons", scene.polygons_m.len()));
    }
    if !scene.outline_m.is_empty() {
        let corners = scene.outline_m.len();
        line("edge", format!("a polygon of {corners} corners"));
    }
    if !scene.roadmap_m.is_empty() {
        line("roadmap", format!("{} edges", scene.roadmap_m.len()));
    }
    let rate = format!(
        "{} ticks per second, {} substeps",
        header.ticks_hz, header.substeps
    );
    line("execution", format!("tier {}, {rate}", header.tier));
    line("policy", format!("{}, seed {}", header.policy, header.seed));
    let states = match contents.last_tick {
        None => "none".to_owned(),
        Some(last) => {
            let each = contents.states as f64 * header.bodies() as f64;
            format!(
                "{}, every {}, to tick {last} ({} s), {} bytes for a body at a tick",
                contents.states,
                match header.state_every {
                    1 => "tick".to_owned(),
                    every => format!("{every} ticks"),
                },
                number(header.time_s(last)),
                number(contents.intact_bytes as f64 / each),
            )
        }
    };
    line("states", states);
    line("events", contents.events.to_string());
    let contacts = counts.contacts_agent_agent + counts.contacts_agent_obstacle;
    line(
        "contacts",
        format!(
            "{} ({} between agents, {} with obstacles, {} with moving ones)",
            contacts + counts.contacts_agent_mover,
            counts.contacts_agent_agent,
            counts.contacts_agent_obstacle,
            counts.contacts_agent_mover
        ),
    );
    for event in &counts.first {
        line("", format!("at {} s {event}", number(event.time_s)));
    }
    if counts.arrivals > 0 {
        line("arrivals", counts.arrivals.to_string());
    }
    let fleet = &counts.fleet;
    if contents.entries > 0 {
        let goals = format!("{} reached of {} given", fleet.goals_reached, fleet.goals);
        line("goals", goals);
        if fleet.tasks_done > 0 {
            line("tasks", format!("{} done", fleet.tasks_done));
        }
        line(
            "calls",
            format!(
                "{}, answered {} by the planner, {} by the fail policy, {} by nobody",
                fleet.calls,
                fleet.answered_by_planner,
                fleet.answered_by_fail_policy,
                fleet.answered_by_nobody
            ),
        );
        for (name, count) in &fleet.notices {
            line("  notices", format!("{count} {name}"));
        }
    }
    if let Some(end) = &contents.end {
        line("simulated", format!("{} s", number(end.simulated_s)));
        if let Some(nearest) = end.nearest_approach_m {
            line(
                "nearest approach",
                format!("{nearest:.3} m between centres"),
            );
        }
        let error = format!("{:.4} m at most", end.tracking_error_max_m);
        line("tracking error", error);
        line("trace digest", end.trace_digest.to_string());
    }
    line("world digest", header.digests.world.to_string());
    line("plan digest", header.digests.plan.to_string());
    out.truncate(out.trim_end().len());
    out
}

// ---- diff ------------------------------------------------------------------------------

fn diff(arguments: &TraceDiff) -> Result<Exit> {
    let TraceDiff { a, b, .. } = arguments;
    // A fleet's traces are read three times.
    let bar = watch(&[a, b, a, b, a, b]);
    let difference =
        Difference::between(&|| open(a, &bar), &|| open(b, &bar), arguments.tolerance)?;
    bar.finish_and_clear();
    let same = difference.is_same();
    match arguments.format {
        Format::Json => {
            let mut value = serde_json::to_value(&difference).map_err(internal)?;
            value["same"] = same.into();
            output::print_json(&value)?;
        }
        Format::Text => output::print(&diff_text(&difference, same))?,
    }
    Ok(if same { Exit::Success } else { Exit::NoPlan })
}

fn diff_text(difference: &Difference, same: bool) -> String {
    let mut out = Vec::new();
    for field in &difference.header {
        out.push(field_line("header", field));
    }
    if let Some(first) = &difference.state {
        let value =
            |value: Option<f64>| value.map_or("none".to_owned(), |value| format!("{value:?}"));
        let (a, b) = (value(first.a), value(first.b));
        let apart = match (first.a, first.b) {
            (Some(a), Some(b)) => format!(", {:e} apart", (a - b).abs()),
            _ => String::new(),
        };
        out.push(format!(
            "states    first at tick {} ({} s), body {}: {} is {a} and {b}{apart}",
            first.tick,
            number(first.time_s),
            first.body,
            first.value
        ));
        out.push(format!("          {:e} apart at most", difference.largest));
    }
    if let Some(first) = &difference.event {
        let event = |event: &Option<Event>| match event {
            None => "nothing".to_owned(),
            Some(event) => format!("at {:?} s {event}", event.time_s),
        };
        let (a, b) = (event(&first.a), event(&first.b));
        out.push(format!("events    first number {}: {a}; {b}", first.index));
    }
    if let Some(first) = &difference.entry {
        // Everything in an entry can be written as JSON.
        let entry = |entry: &Option<Entry>| match entry {
            None => "nothing".to_owned(),
            Some(entry) => serde_json::to_string(entry).unwrap_or_default(),
        };
        let (a, b) = (entry(&first.a), entry(&first.b));
        out.push(format!("journal   first number {}: {a}; {b}", first.index));
    }
    for field in &difference.summary {
        out.push(field_line("summary", field));
    }
    let journal = match difference.entries_compared {
        0 => String::new(),
        entries => format!(", and {entries} entries of the journal"),
    };
    out.push(format!(
        "{}, after {} states and {} events{journal}",
        if same {
            "the same execution"
        } else {
            "different executions"
        },
        difference.ticks_compared,
        difference.events_compared
    ));
    out.join("\n")
}

fn field_line(part: &str, field: &FieldDifference) -> String {
    let FieldDifference { field, a, b } = field;
    if a.is_null() && b.is_null() {
        format!("{part:<10}{field} differ")
    } else {
        format!("{part:<10}{field} is {a} and {b}")
    }
}

// ---- export ----------------------------------------------------------------------------

fn export(arguments: &TraceExport) -> Result<Exit> {
    let TraceExport {
        file,
        csv,
        events,
        journal,
        json,
        every,
        shown,
    } = arguments;
    let files = [csv, events, journal, json].into_iter().flatten();
    let inputs: Vec<&Path> = shown.input().into_iter().chain([file.as_path()]).collect();
    for path in files.chain(shown.files()) {
        refuse_input(path, &inputs)?;
    }
    let bar = watch(&[file]);
    let reader = open(file, &bar)?;
    let create = |path: &Option<PathBuf>| path.as_deref().map(Unnamed::beside).transpose();
    let out = Outputs {
        states: create(csv)?,
        events: create(events)?,
        journal: create(journal)?,
        json: create(json)?,
    };
    let failed = |error: io::Error| {
        let reason = format!("the files could not be written: {error}");
        Failure::from(InputError::new(file.display().to_string(), reason))
    };
    let mut exporter = Exporter::new(*every, out);
    let mut shown = Shown::new(shown, file, reader.header())?;
    let mut sinks: Vec<&mut dyn TraceSink> = vec![&mut exporter];
    sinks.extend(shown.sinks());
    let contents = reader.replay(&mut sinks).map_err(failed)?;
    shown.finish(&contents)?;
    let Outputs {
        states,
        events,
        journal,
        json,
    } = exporter.finish(contents.end.as_ref()).map_err(failed)?;
    let files = [json, states, events, journal];
    files.into_iter().flatten().try_for_each(keep)?;
    bar.finish_and_clear();
    Ok(verdict(&contents))
}
