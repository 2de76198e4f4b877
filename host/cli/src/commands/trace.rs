//! `fleetyard trace`: what a trace file says, where two differ, and other files of one.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::fmt::Write as _;
use std::fs::File;
use std::io::{self, BufReader, BufWriter, Read, Write};
use std::path::{Path, PathBuf};

use fleetyard_bench::number;
use fleetyard_core::{InputError, open_input};
use fleetyard_sim::trace::{
    By, Cells, Entry, Frame, Happening, Header, Remark, Scene, States, Summary, TraceContents,
};
use fleetyard_sim::{Event, EventKind, Other, TraceReader, TraceSink};
use indicatif::ProgressBar;
use serde::Serialize;
use serde_json::{Value, json};

use super::convert::refuse_input;
use super::show::Shown;
use super::{Unnamed, file_name};
use crate::args::{Format, TraceDiff, TraceExport};
use crate::exit::{Exit, Failure, Result, internal};
use crate::output;

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

fn open(path: &Path, bar: &ProgressBar) -> Result<Reader> {
    let name = path.display().to_string();
    let file = open_input(path).map_err(|mut error| {
        let written = "`fleetyard run --trace FILE` writes one";
        error.hint.get_or_insert_with(|| written.into());
        error
    })?;
    let bar = bar.clone();
    let input = BufReader::with_capacity(1 << 16, Watched { file, bar });
    Ok(TraceReader::open(input, name)?)
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

/// How many contacts `info` names.
const NAMED: usize = 10;

/// What events there are.
#[derive(Debug, Default, Serialize)]
struct Counts {
    contacts_agent_agent: u64,
    contacts_agent_obstacle: u64,
    contacts_agent_mover: u64,
    arrivals: u64,
    /// The first contacts to begin.
    first: Vec<Event>,
    /// What a fleet did; all zero where there is none.
    fleet: FleetCounts,
}

#[derive(Debug, Default, Serialize)]
struct FleetCounts {
    goals: u64,
    goals_reached: u64,
    tasks_done: u64,
    calls: u64,
    answered_by_planner: u64,
    answered_by_fail_policy: u64,
    answered_by_nobody: u64,
    /// How many notices there are of each name.
    notices: BTreeMap<String, u64>,
    /// The last goals of tasks that robots are on the way to, by robot.
    #[serde(skip)]
    last_of_task: BTreeSet<u32>,
}

impl FleetCounts {
    fn count(&mut self, what: &Happening) {
        *match what {
            Happening::Goal(goal) => {
                if goal.errand.is_some_and(|errand| errand.at + 1 == errand.of) {
                    self.last_of_task.insert(goal.agent);
                }
                &mut self.goals
            }
            Happening::Reached { agent, .. } => {
                self.tasks_done += u64::from(self.last_of_task.remove(agent));
                &mut self.goals_reached
            }
            Happening::Asked { .. } => &mut self.calls,
            Happening::Answered { by, .. } => match by {
                By::Planner => &mut self.answered_by_planner,
                By::FailPolicy => &mut self.answered_by_fail_policy,
                By::Nobody => &mut self.answered_by_nobody,
            },
            Happening::Notice { name, .. } => self.notices.entry(name.clone()).or_default(),
        } += 1;
    }
}

impl TraceSink for Counts {
    fn begin(&mut self, _: &Header) -> io::Result<()> {
        Ok(())
    }

    fn state(&mut self, _: u64, _: &States<'_>) -> io::Result<()> {
        Ok(())
    }

    fn events(&mut self, events: &[Event]) -> io::Result<()> {
        for event in events {
            match (event.kind, event.other) {
                (EventKind::Arrive, _) => self.arrivals += 1,
                (EventKind::End, _) => {}
                (EventKind::Begin, other) => {
                    *match other {
                        Other::Agent(_) => &mut self.contacts_agent_agent,
                        Other::Mover(_) => &mut self.contacts_agent_mover,
                        _ => &mut self.contacts_agent_obstacle,
                    } += 1;
                    if self.first.len() < NAMED {
                        self.first.push(*event);
                    }
                }
            }
        }
        Ok(())
    }

    fn journal(&mut self, entries: &[Entry]) -> io::Result<()> {
        for entry in entries {
            self.fleet.count(&entry.what);
        }
        Ok(())
    }

    fn end(&mut self, _: &Summary) -> io::Result<()> {
        Ok(())
    }
}

pub(crate) fn info(path: &Path, format: Format) -> Result<Exit> {
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

/// How many cells these are.
fn count(cells: Option<&Cells>) -> u64 {
    let runs = cells.into_iter().flat_map(Cells::in_rows);
    runs.map(|(_, _, length)| u64::from(length)).sum()
}

fn info_text(path: &Path, bytes: u64, contents: &TraceContents, counts: &Counts) -> String {
    let header = &contents.header;
    let mut out = String::new();
    // Writing to a string cannot fail.
    let mut line = |name: &str, value: String| {
        let _ = writeln!(out, "{name:<18}{value}");
    };
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
        line(
            "",
            format!("at {} s {}", number(event.time_s), described(event)),
        );
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

fn described(event: &Event) -> String {
    let agent = event.agent;
    let other = match event.other {
        Other::Agent(other) => format!("agent {other}"),
        Other::Obstacle { cell } => format!("cell {cell}"),
        Other::Polygon(index) => format!("polygon {index}"),
        Other::Mover(index) => format!("moving obstacle {index}"),
        Other::Goal => "its goal".to_owned(),
    };
    match event.kind {
        EventKind::Begin => format!("agent {agent} begins to touch {other}"),
        EventKind::End => format!("agent {agent} no longer touches {other}"),
        EventKind::Arrive => format!("agent {agent} arrives at {other}"),
    }
}

// ---- diff ------------------------------------------------------------------------------

/// Where two traces differ; nothing is left out but what is empty.
#[derive(Debug, Default, Serialize)]
struct Difference {
    /// Fields of the header, with both values.
    header: Vec<FieldDifference>,
    /// The first state that differs.
    #[serde(skip_serializing_if = "Option::is_none")]
    state: Option<StateDifference>,
    /// How far apart any two values of the states are at most.
    largest: f64,
    /// The first event that differs.
    #[serde(skip_serializing_if = "Option::is_none")]
    event: Option<ItemDifference<Event>>,
    /// The first entry of the journals that differs, where both traces have one.
    #[serde(skip_serializing_if = "Option::is_none")]
    entry: Option<ItemDifference<Entry>>,
    /// Figures of the summary, with both values.
    summary: Vec<FieldDifference>,
    /// Ticks whose states were compared.
    ticks_compared: u64,
    events_compared: u64,
    entries_compared: u64,
}

#[derive(Debug, Serialize)]
struct FieldDifference {
    field: String,
    a: Value,
    b: Value,
}

#[derive(Debug, Serialize)]
struct StateDifference {
    tick: u64,
    time_s: f64,
    body: usize,
    value: &'static str,
    a: Option<f64>,
    b: Option<f64>,
}

#[derive(Debug, Serialize)]
struct ItemDifference<T> {
    index: u64,
    a: Option<T>,
    b: Option<T>,
}

/// What describes a trace but decides nothing about the execution.
const DESCRIPTION: [&str; 3] = ["program", "state_every", "progress"];
/// Follow from everything else.
const DIGESTS: [&str; 3] = ["states_digest", "events_digest", "trace_digest"];

pub(crate) fn diff(arguments: &TraceDiff) -> Result<Exit> {
    let TraceDiff { a, b, .. } = arguments;
    // Each anew: states, events and, of fleets, journals need not lie beside each other alike.
    let bar = watch(&[a, b, a, b, a, b]);
    let (mut one, mut other) = (open(a, &bar)?, open(b, &bar)?);
    let mut difference = Difference {
        header: header_differences(one.header(), other.header()),
        ..Difference::default()
    };
    compare_states(&mut one, &mut other, arguments.tolerance, &mut difference)?;
    let (mut one, mut other) = (open(a, &bar)?, open(b, &bar)?);
    let fleets = compare_events(&mut one, &mut other, arguments.tolerance, &mut difference)?;
    if fleets {
        let (mut one, mut other) = (open(a, &bar)?, open(b, &bar)?);
        compare_journals(&mut one, &mut other, &mut difference)?;
    }
    bar.finish_and_clear();
    let describes = |field: &FieldDifference| DESCRIPTION.contains(&field.field.as_str());
    let same = difference.header.iter().all(describes)
        && difference.summary.is_empty()
        && difference.state.is_none()
        && difference.event.is_none()
        && difference.entry.is_none();
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

fn header_differences(a: &Header, b: &Header) -> Vec<FieldDifference> {
    // Everything in a header can be written as JSON.
    let values = |header: &Header| serde_json::to_value(header).unwrap_or_default();
    let mut found = field_differences(&values(a), &values(b), |_, _, _| false);
    let (a, b) = (&a.scene, &b.scene);
    let parts = [
        ("cells", a.cells == b.cells),
        ("endpoints", a.endpoints == b.endpoints),
        ("workstations", a.workstations == b.workstations),
        ("polygons", a.polygons_m == b.polygons_m),
        ("outline", a.outline_m == b.outline_m),
        ("roadmap", a.roadmap_m == b.roadmap_m),
        ("profiles of bodies", a.profile_of_body == b.profile_of_body),
        ("goals", a.goals_m == b.goals_m),
    ];
    for (part, same) in parts {
        if !same {
            found.push(FieldDifference {
                field: part.to_owned(),
                a: Value::Null,
                b: Value::Null,
            });
        }
    }
    found
}

/// Fields of objects that differ, those of nested objects too.
fn field_differences(
    a: &Value,
    b: &Value,
    near: impl Fn(&str, &Value, &Value) -> bool + Copy,
) -> Vec<FieldDifference> {
    let (Value::Object(a), Value::Object(b)) = (a, b) else {
        return Vec::new();
    };
    let names: BTreeSet<&String> = a.keys().chain(b.keys()).collect();
    let mut found = Vec::new();
    for name in names {
        let (a, b) = (&a.get(name), &b.get(name));
        let (a, b) = (
            a.cloned().unwrap_or_default(),
            b.cloned().unwrap_or_default(),
        );
        if a == b || near(name, &a, &b) {
            continue;
        }
        if a.is_object() && b.is_object() {
            for mut inner in field_differences(&a, &b, near) {
                inner.field = format!("{name}.{}", inner.field);
                found.push(inner);
            }
        } else {
            let field = name.clone();
            found.push(FieldDifference { field, a, b });
        }
    }
    found
}

/// The states of a tick, kept.
#[derive(Default)]
struct Kept {
    tick: u64,
    channels: [Vec<f64>; 3],
    progress: Vec<u32>,
}

impl Kept {
    /// Goes to the next states; `false` at the end.
    fn advance(&mut self, reader: &mut Reader) -> Result<bool> {
        while let Some(frame) = reader.next_frame()? {
            if let Frame::State { tick, states } = frame {
                self.tick = tick;
                let channels = [Some(states.x_m), Some(states.y_m), states.heading_rad];
                for (kept, channel) in self.channels.iter_mut().zip(channels) {
                    kept.clear();
                    kept.extend(channel.unwrap_or_default());
                }
                self.progress.clear();
                self.progress.extend(states.progress.unwrap_or_default());
                return Ok(true);
            }
        }
        Ok(false)
    }
}

fn compare_states(
    one: &mut Reader,
    other: &mut Reader,
    tolerance: f64,
    difference: &mut Difference,
) -> Result<()> {
    let (a_header, b_header) = (one.header().clone(), other.header().clone());
    if a_header.bodies() != b_header.bodies() || a_header.ticks_hz != b_header.ticks_hz {
        return Ok(());
    }
    let (mut a, mut b) = (Kept::default(), Kept::default());
    let (mut a_is_there, mut b_is_there) = (a.advance(one)?, b.advance(other)?);
    let records_alike = a_header.state_every == b_header.state_every;
    while a_is_there && b_is_there {
        // Where one trace has states less often, others are passed over.
        if a.tick == b.tick {
            compare_tick(&a_header, &a, &b, tolerance, difference);
            difference.ticks_compared += 1;
        }
        let tick = a.tick.min(b.tick);
        let (from_a, from_b) = (a.tick == tick, b.tick == tick);
        if from_a {
            a_is_there = a.advance(one)?;
        }
        if from_b {
            b_is_there = b.advance(other)?;
        }
    }
    if records_alike && a_is_there != b_is_there && difference.state.is_none() {
        let tick = if a_is_there { a.tick } else { b.tick };
        difference.state = Some(StateDifference {
            tick,
            time_s: a_header.time_s(tick),
            body: 0,
            value: "existence",
            a: a_is_there.then_some(1.0),
            b: b_is_there.then_some(1.0),
        });
    }
    Ok(())
}

/// Names of the values of a state.
const VALUES: [&str; 3] = ["x_m", "y_m", "heading_rad"];

fn compare_tick(header: &Header, a: &Kept, b: &Kept, tolerance: f64, difference: &mut Difference) {
    let mut note = |body, value, one: Option<f64>, other: Option<f64>| {
        difference.state.get_or_insert_with(|| StateDifference {
            tick: a.tick,
            time_s: header.time_s(a.tick),
            body,
            value,
            a: one,
            b: other,
        });
        if let (Some(one), Some(other)) = (one, other) {
            difference.largest = difference.largest.max((one - other).abs());
        }
    };
    for body in 0..header.bodies() {
        for ((one, other), value) in a.channels.iter().zip(&b.channels).zip(VALUES) {
            let (one, other) = (one.get(body).copied(), other.get(body).copied());
            let near = match (one, other) {
                // Bits, so that what is no number can be the same.
                (Some(one), Some(other)) => {
                    one.to_bits() == other.to_bits()
                        || tolerance > 0.0 && (one - other).abs() <= tolerance
                }
                (one, other) => one.is_none() && other.is_none(),
            };
            if !near {
                note(body, value, one, other);
            }
        }
    }
    // It describes, and is not in every trace.
    for (body, (one, other)) in a.progress.iter().zip(&b.progress).enumerate() {
        if one != other {
            note(body, "knot", Some(f64::from(*one)), Some(f64::from(*other)));
        }
    }
}

/// Events or entries of a journal one by one.
struct Items<'a, T> {
    reader: &'a mut Reader,
    waiting: VecDeque<T>,
    /// Those of a frame.
    of: for<'f> fn(&Frame<'f>) -> &'f [T],
    has_journal: bool,
    summary: Option<Summary>,
}

impl<'a, T: Clone> Items<'a, T> {
    fn new(reader: &'a mut Reader, of: for<'f> fn(&Frame<'f>) -> &'f [T]) -> Self {
        Self {
            reader,
            waiting: VecDeque::new(),
            of,
            has_journal: false,
            summary: None,
        }
    }

    /// The next one; at the end of the trace `None`, and there is a summary.
    fn next(&mut self) -> Result<Option<T>> {
        loop {
            if let Some(item) = self.waiting.pop_front() {
                return Ok(Some(item));
            }
            let Some(frame) = self.reader.next_frame()? else {
                return Ok(None);
            };
            self.waiting.extend((self.of)(&frame).iter().cloned());
            match frame {
                Frame::Journal(_) => self.has_journal = true,
                Frame::End(summary) => self.summary = Some(summary.clone()),
                Frame::State { .. } | Frame::Events(_) | Frame::Remarks(_) => {}
            }
        }
    }
}

/// The first two that differ, and how many were compared.
fn first_difference<T: Clone>(
    (one, other): (&mut Items<'_, T>, &mut Items<'_, T>),
    same: impl Fn(&T, &T) -> bool,
) -> Result<(Option<ItemDifference<T>>, u64)> {
    let (mut first, mut compared) = (None, 0);
    loop {
        let (a, b) = (one.next()?, other.next()?);
        let same = match (&a, &b) {
            (None, None) => return Ok((first, compared)),
            (Some(a), Some(b)) => same(a, b),
            _ => false,
        };
        if !same && first.is_none() {
            let index = compared;
            first = Some(ItemDifference { index, a, b });
        }
        compared += 1;
    }
}

/// What a fleet did. It is in ticks, which are equal or not.
fn compare_journals(
    one: &mut Reader,
    other: &mut Reader,
    difference: &mut Difference,
) -> Result<()> {
    fn entries<'f>(frame: &Frame<'f>) -> &'f [Entry] {
        match frame {
            Frame::Journal(entries) => entries,
            _ => &[],
        }
    }
    let (mut one, mut other) = (Items::new(one, entries), Items::new(other, entries));
    (difference.entry, difference.entries_compared) =
        first_difference((&mut one, &mut other), |a, b| a == b)?;
    Ok(())
}

/// Events and summaries; true if both traces have a journal.
fn compare_events(
    one: &mut Reader,
    other: &mut Reader,
    tolerance: f64,
    difference: &mut Difference,
) -> Result<bool> {
    fn events<'f>(frame: &Frame<'f>) -> &'f [Event] {
        match frame {
            Frame::Events(events) => events,
            _ => &[],
        }
    }
    let (mut one, mut other) = (Items::new(one, events), Items::new(other, events));
    let same = |a: &Event, b: &Event| {
        if tolerance > 0.0 {
            (a.kind, a.agent, a.other) == (b.kind, b.agent, b.other)
                && (a.time_s - b.time_s).abs() <= tolerance
        } else {
            a == b
        }
    };
    (difference.event, difference.events_compared) =
        first_difference((&mut one, &mut other), same)?;
    let value = |summary: &Option<Summary>| serde_json::to_value(summary).map_err(internal);
    let near = |name: &str, a: &Value, b: &Value| {
        // With a tolerance digests say nothing.
        tolerance > 0.0
            && (DIGESTS.contains(&name)
                || matches!((a.as_f64(), b.as_f64()), (Some(a), Some(b)) if (a - b).abs() <= tolerance))
    };
    let (a, b) = (value(&one.summary)?, value(&other.summary)?);
    difference.summary = field_differences(&a, &b, near);
    Ok(one.has_journal && other.has_journal)
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
            Some(event) => format!("at {:?} s {}", event.time_s, described(event)),
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

/// A file that takes its name when it is whole.
struct Target<'a> {
    path: &'a Path,
    out: BufWriter<Unnamed>,
}

impl<'a> Target<'a> {
    fn create(path: Option<&'a PathBuf>) -> Result<Option<Self>> {
        path.map(|path| {
            let out = BufWriter::with_capacity(1 << 16, Unnamed::beside(path)?);
            Ok(Self { path, out })
        })
        .transpose()
    }

    fn finish(self) -> Result<()> {
        let out = self.out.into_inner().map_err(|error| {
            InputError::new(
                self.path.display().to_string(),
                format!("cannot be written: {error}"),
            )
        })?;
        out.keep(self.path)
    }
}

/// Writes what it is told as CSV and JSON.
struct Exporter<'a> {
    every: u64,
    ticks_hz: u32,
    csv: Option<Target<'a>>,
    events: Option<Target<'a>>,
    journal: Option<Target<'a>>,
    json: Option<Target<'a>>,
    /// Whether the JSON document has a record already.
    begun: bool,
}

/// Columns of a journal: the keys of entries and remarks. Most are empty in most rows.
const JOURNAL: [&str; 16] = [
    "tick",
    "time_s",
    "kind",
    "agent",
    "number",
    "cell",
    "task",
    "at",
    "of",
    "call",
    "by",
    "name",
    "module",
    "planner_ms",
    "fail_policy_ms",
    "message",
];

impl Exporter<'_> {
    /// A row of the journal.
    fn journal_row(&mut self, row: &impl Serialize) -> io::Result<()> {
        let Some(csv) = &mut self.journal else {
            return Ok(());
        };
        let row = serde_json::to_value(row)?;
        for (at, column) in JOURNAL.into_iter().enumerate() {
            if at > 0 {
                csv.out.write_all(b",")?;
            }
            match (&row[column], row["tick"].as_u64()) {
                (_, Some(tick)) if column == "time_s" => {
                    write!(csv.out, "{:?}", tick as f64 / f64::from(self.ticks_hz))?;
                }
                (Value::Null, _) => {}
                (Value::String(text), _) if text.contains([',', '"', '\n', '\r']) => {
                    write!(csv.out, "\"{}\"", text.replace('"', "\"\""))?;
                }
                (Value::String(text), _) => csv.out.write_all(text.as_bytes())?,
                (value, _) => write!(csv.out, "{value}")?,
            }
        }
        csv.out.write_all(b"\n")
    }

    fn record(&mut self, record: &impl Serialize) -> io::Result<()> {
        if let Some(json) = &mut self.json {
            json.out
                .write_all(if self.begun { b",\n" } else { b"\n" })?;
            self.begun = true;
            serde_json::to_writer(&mut json.out, record)?;
        }
        Ok(())
    }
}

/// States as a record of a JSON document.
#[derive(Serialize)]
struct StatesRecord<'a> {
    tick: u64,
    time_s: f64,
    x_m: &'a [f64],
    y_m: &'a [f64],
    #[serde(skip_serializing_if = "Option::is_none")]
    heading_rad: Option<&'a [f64]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    knot: Option<&'a [u32]>,
}

impl TraceSink for Exporter<'_> {
    fn begin(&mut self, header: &Header) -> io::Result<()> {
        self.ticks_hz = header.ticks_hz;
        if let Some(csv) = &mut self.csv {
            csv.out.write_all(b"tick,time_s,body,x_m,y_m")?;
            if header.headings {
                csv.out.write_all(b",heading_rad")?;
            }
            if header.progress {
                csv.out.write_all(b",knot")?;
            }
            csv.out.write_all(b"\n")?;
        }
        if let Some(events) = &mut self.events {
            events
                .out
                .write_all(b"time_s,substep,kind,agent,other,index\n")?;
        }
        if let Some(journal) = &mut self.journal {
            writeln!(journal.out, "{}", JOURNAL.join(","))?;
        }
        if let Some(json) = &mut self.json {
            json.out.write_all(b"{\"header\":")?;
            serde_json::to_writer(&mut json.out, header)?;
            let scene = &header.scene;
            let cells = scene.cells.as_ref().map(|cells| {
                json!({
                    "rows": cells.rows(),
                    "cols": cells.cols(),
                    "cell_size_m": cells.cell_size_m(),
                    "solid_runs": cells.in_rows().collect::<Vec<_>>(),
                })
            });
            let runs = |cells: &Option<Cells>| {
                let runs = cells.iter().flat_map(Cells::in_rows);
                runs.collect::<Vec<_>>()
            };
            let scene = json!({
                "cells": cells,
                "endpoint_runs": runs(&scene.endpoints),
                "workstation_runs": runs(&scene.workstations),
                "polygons_m": scene.polygons_m,
                "outline_m": scene.outline_m,
                "roadmap_m": scene.roadmap_m,
                "profile_of_body": scene.profile_of_body,
                "goals_m": scene.goals_m,
            });
            json.out.write_all(b",\n\"scene\":")?;
            serde_json::to_writer(&mut json.out, &scene)?;
            json.out.write_all(b",\n\"records\":[")?;
        }
        Ok(())
    }

    fn state(&mut self, tick: u64, states: &States<'_>) -> io::Result<()> {
        if !tick.is_multiple_of(self.every) {
            return Ok(());
        }
        let time_s = tick as f64 / f64::from(self.ticks_hz);
        if let Some(csv) = &mut self.csv {
            for body in 0..states.x_m.len() {
                let (x, y) = (states.x_m[body], states.y_m[body]);
                write!(csv.out, "{tick},{time_s:?},{body},{x:?},{y:?}")?;
                if let Some(headings) = states.heading_rad {
                    write!(csv.out, ",{:?}", headings[body])?;
                }
                if let Some(progress) = states.progress {
                    write!(csv.out, ",{}", progress[body])?;
                }
                csv.out.write_all(b"\n")?;
            }
        }
        self.record(&StatesRecord {
            tick,
            time_s,
            x_m: states.x_m,
            y_m: states.y_m,
            heading_rad: states.heading_rad,
            knot: states.progress,
        })
    }

    fn events(&mut self, events: &[Event]) -> io::Result<()> {
        if let Some(csv) = &mut self.events {
            for event in events {
                let (kind, agent) = (kind_name(event.kind), event.agent);
                let (other, index) = match event.other {
                    Other::Agent(index) => ("agent", Some(index)),
                    Other::Obstacle { cell } => ("cell", Some(cell)),
                    Other::Polygon(index) => ("polygon", Some(index)),
                    Other::Mover(index) => ("mover", Some(index)),
                    Other::Goal => ("goal", None),
                };
                let index = index.map(|index| index.to_string()).unwrap_or_default();
                let (time, substep) = (event.time_s, event.substep);
                writeln!(csv.out, "{time:?},{substep},{kind},{agent},{other},{index}")?;
            }
        }
        self.record(&json!({ "events": events }))
    }

    fn journal(&mut self, entries: &[Entry]) -> io::Result<()> {
        entries
            .iter()
            .try_for_each(|entry| self.journal_row(entry))?;
        self.record(&json!({ "journal": entries }))
    }

    fn remarks(&mut self, remarks: &[Remark]) -> io::Result<()> {
        remarks
            .iter()
            .try_for_each(|remark| self.journal_row(remark))?;
        self.record(&json!({ "remarks": remarks }))
    }

    fn end(&mut self, _: &Summary) -> io::Result<()> {
        Ok(())
    }
}

fn kind_name(kind: EventKind) -> &'static str {
    match kind {
        EventKind::Begin => "begin",
        EventKind::End => "end",
        EventKind::Arrive => "arrive",
    }
}

pub(crate) fn export(arguments: &TraceExport) -> Result<Exit> {
    let TraceExport {
        file,
        csv,
        events,
        journal,
        json,
        every,
        svg,
        png,
        html,
        ..
    } = arguments;
    for path in [csv, events, journal, json, svg, png, html]
        .into_iter()
        .flatten()
    {
        refuse_input(path, &[file.as_path()])?;
    }
    let bar = watch(&[file]);
    let reader = open(file, &bar)?;
    let mut exporter = Exporter {
        every: u64::from(*every),
        ticks_hz: reader.header().ticks_hz,
        csv: Target::create(csv.as_ref())?,
        events: Target::create(events.as_ref())?,
        journal: Target::create(journal.as_ref())?,
        json: Target::create(json.as_ref())?,
        begun: false,
    };
    let failed = |error: io::Error| {
        let reason = format!("the files could not be written: {error}");
        Failure::from(InputError::new(file.display().to_string(), reason))
    };
    let mut shown = Shown::new(arguments, reader.header())?;
    let mut both = Both(&mut exporter, &mut shown);
    let contents = reader.replay(&mut both).map_err(failed)?;
    shown.finish(&contents)?;
    let Exporter {
        csv,
        events,
        journal,
        json,
        ..
    } = exporter;
    if let Some(mut json) = json {
        // What a damaged trace does not tell is null.
        let summary = serde_json::to_string(&contents.end).map_err(internal)?;
        writeln!(json.out, "\n],\n\"summary\":{summary}}}").map_err(failed)?;
        json.finish()?;
    }
    for target in [csv, events, journal].into_iter().flatten() {
        target.finish()?;
    }
    bar.finish_and_clear();
    Ok(verdict(&contents))
}

/// Tells both what it is told.
struct Both<'a>(&'a mut dyn TraceSink, &'a mut dyn TraceSink);

impl TraceSink for Both<'_> {
    fn begin(&mut self, header: &Header) -> io::Result<()> {
        self.0.begin(header)?;
        self.1.begin(header)
    }

    fn state(&mut self, tick: u64, states: &States<'_>) -> io::Result<()> {
        self.0.state(tick, states)?;
        self.1.state(tick, states)
    }

    fn events(&mut self, events: &[Event]) -> io::Result<()> {
        self.0.events(events)?;
        self.1.events(events)
    }

    fn journal(&mut self, entries: &[Entry]) -> io::Result<()> {
        self.0.journal(entries)?;
        self.1.journal(entries)
    }

    fn remarks(&mut self, remarks: &[Remark]) -> io::Result<()> {
        self.0.remarks(remarks)?;
        self.1.remarks(remarks)
    }

    fn end(&mut self, summary: &Summary) -> io::Result<()> {
        self.0.end(summary)?;
        self.1.end(summary)
    }
}
