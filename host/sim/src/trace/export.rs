//! Traces as CSV and JSON.

use std::io::{self, Write};

use serde::Serialize;
use serde_json::{Value, json};

use super::{Cells, Entry, Header, Remark, States, Summary, TraceSink, Waiting};
use crate::event::{Event, EventKind, Other};

/// The outputs of an [`Exporter`]; those that are absent are not written.
#[derive(Debug, Default)]
pub struct Outputs<W> {
    /// A row of CSV for each body at a tick.
    pub states: Option<W>,
    /// A row of CSV for each event.
    pub events: Option<W>,
    /// A row of CSV for each entry of the journal and each remark.
    pub journal: Option<W>,
    /// Everything as one JSON document.
    pub json: Option<W>,
}

/// Writes a trace as CSV and JSON.
#[derive(Debug)]
pub struct Exporter<W> {
    every: u64,
    out: Outputs<W>,
    ticks_hz: u32,
    /// True once the JSON document has a record.
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

impl<W: Write> Exporter<W> {
    /// Writes the states of every so many ticks, and everything else.
    pub fn new(every: u32, out: Outputs<W>) -> Self {
        Self {
            every: u64::from(every),
            out,
            ticks_hz: 1,
            begun: false,
        }
    }

    /// Completes the JSON document, and returns the outputs. The summary of a damaged trace is
    /// absent, and `null` in the document.
    pub fn finish(mut self, summary: Option<&Summary>) -> io::Result<Outputs<W>> {
        if let Some(json) = &mut self.out.json {
            json.write_all(b"\n],\n\"summary\":")?;
            serde_json::to_writer(&mut *json, &summary)?;
            json.write_all(b"}\n")?;
        }
        Ok(self.out)
    }

    /// A row of the journal.
    fn journal_row(&mut self, row: &impl Serialize) -> io::Result<()> {
        let Some(csv) = &mut self.out.journal else {
            return Ok(());
        };
        let row = serde_json::to_value(row)?;
        for (at, column) in JOURNAL.into_iter().enumerate() {
            if at > 0 {
                csv.write_all(b",")?;
            }
            match (&row[column], row["tick"].as_u64()) {
                (_, Some(tick)) if column == "time_s" => {
                    write!(csv, "{:?}", tick as f64 / f64::from(self.ticks_hz))?;
                }
                (Value::Null, _) => {}
                (Value::String(text), _) if text.contains([',', '"', '\n', '\r']) => {
                    write!(csv, "\"{}\"", text.replace('"', "\"\""))?;
                }
                (Value::String(text), _) => csv.write_all(text.as_bytes())?,
                (value, _) => write!(csv, "{value}")?,
            }
        }
        csv.write_all(b"\n")
    }

    /// A record of the JSON document.
    fn record(&mut self, record: &impl Serialize) -> io::Result<()> {
        if let Some(json) = &mut self.out.json {
            json.write_all(if self.begun { b",\n" } else { b"\n" })?;
            self.begun = true;
            serde_json::to_writer(json, record)?;
        }
        Ok(())
    }
}

impl<W: Write + Send> TraceSink for Exporter<W> {
    fn begin(&mut self, header: &Header) -> io::Result<()> {
        self.ticks_hz = header.ticks_hz;
        if let Some(csv) = &mut self.out.states {
            csv.write_all(b"tick,time_s,body,x_m,y_m")?;
            if header.headings {
                csv.write_all(b",heading_rad")?;
            }
            if header.progress {
                csv.write_all(b",knot")?;
            }
            csv.write_all(b"\n")?;
        }
        if let Some(csv) = &mut self.out.events {
            csv.write_all(b"time_s,substep,kind,agent,other,index\n")?;
        }
        if let Some(csv) = &mut self.out.journal {
            writeln!(csv, "{}", JOURNAL.join(","))?;
        }
        if let Some(json) = &mut self.out.json {
            json.write_all(b"{\"header\":")?;
            serde_json::to_writer(&mut *json, header)?;
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
            json.write_all(b",\n\"scene\":")?;
            serde_json::to_writer(&mut *json, &scene)?;
            json.write_all(b",\n\"records\":[")?;
        }
        Ok(())
    }

    fn state(&mut self, tick: u64, states: &States<'_>) -> io::Result<()> {
        if !tick.is_multiple_of(self.every) {
            return Ok(());
        }
        let time_s = tick as f64 / f64::from(self.ticks_hz);
        if let Some(csv) = &mut self.out.states {
            for body in 0..states.x_m.len() {
                let (x, y) = (states.x_m[body], states.y_m[body]);
                write!(csv, "{tick},{time_s:?},{body},{x:?},{y:?}")?;
                if let Some(headings) = states.heading_rad {
                    write!(csv, ",{:?}", headings[body])?;
                }
                if let Some(progress) = states.progress {
                    write!(csv, ",{}", progress[body])?;
                }
                csv.write_all(b"\n")?;
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
        if let Some(csv) = &mut self.out.events {
            for event in events {
                let kind = match event.kind {
                    EventKind::Begin => "begin",
                    EventKind::End => "end",
                    EventKind::Arrive => "arrive",
                };
                let (other, index) = match event.other {
                    Other::Agent(index) => ("agent", Some(index)),
                    Other::Obstacle { cell } => ("cell", Some(cell)),
                    Other::Polygon(index) => ("polygon", Some(index)),
                    Other::Mover(index) => ("mover", Some(index)),
                    Other::Goal => ("goal", None),
                };
                let index = index.map(|index| index.to_string()).unwrap_or_default();
                let (time, substep, agent) = (event.time_s, event.substep, event.agent);
                writeln!(csv, "{time:?},{substep},{kind},{agent},{other},{index}")?;
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

    fn waits(&mut self, changes: &[Waiting]) -> io::Result<()> {
        self.record(&json!({ "waits": changes }))
    }
}
