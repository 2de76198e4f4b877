//! Comparison of two traces.

use std::collections::BTreeSet;
use std::io::Read;

use fleetyard_core::InputError;
use serde::Serialize;
use serde_json::Value;

use super::{Entry, Frame, Header, Summary, TraceReader};
use crate::event::Event;

/// The differences of two traces; only what is empty is left out.
#[derive(Debug, Default, Serialize)]
pub struct Difference {
    /// Fields of the header, with both values.
    pub header: Vec<FieldDifference>,
    /// The first state that differs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub state: Option<StateDifference>,
    /// The largest distance between two values of the states.
    pub largest: f64,
    /// The first event that differs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub event: Option<ItemDifference<Event>>,
    /// The first entry of the journals that differs, where both traces have one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub entry: Option<ItemDifference<Entry>>,
    /// Figures of the summary, with both values.
    pub summary: Vec<FieldDifference>,
    /// Ticks whose states were compared.
    pub ticks_compared: u64,
    /// Events that were compared.
    pub events_compared: u64,
    /// Entries of the journals that were compared.
    pub entries_compared: u64,
}

/// A field that differs. A part of the scene has no values: it would be too long.
#[derive(Debug, Serialize)]
pub struct FieldDifference {
    /// Name of the field; a field of a nested object has its names joined by dots.
    pub field: String,
    /// Its value in the first trace.
    pub a: Value,
    /// Its value in the second trace.
    pub b: Value,
}

/// A value of a state that differs.
#[derive(Debug, Serialize)]
pub struct StateDifference {
    /// The tick.
    pub tick: u64,
    /// Its time in simulated seconds.
    pub time_s: f64,
    /// The body.
    pub body: usize,
    /// Name of the value; `existence` if one trace has no more states.
    pub value: &'static str,
    /// The value in the first trace.
    pub a: Option<f64>,
    /// The value in the second trace.
    pub b: Option<f64>,
}

/// An event or an entry that differs.
#[derive(Debug, Serialize)]
pub struct ItemDifference<T> {
    /// Its number, from 0.
    pub index: u64,
    /// The one of the first trace; absent if it has no more.
    pub a: Option<T>,
    /// The one of the second trace.
    pub b: Option<T>,
}

/// Fields of a header that describe a trace and do not affect the execution.
const DESCRIPTION: [&str; 4] = ["program", "state_every", "progress", "waits"];
/// Fields of a summary that follow from everything else.
const DIGESTS: [&str; 3] = ["states_digest", "events_digest", "trace_digest"];
/// Names of the channels of a state.
const CHANNELS: [&str; 3] = ["x_m", "y_m", "heading_rad"];

type Opened<R> = Result<TraceReader<R>, InputError>;

impl Difference {
    /// Compares two traces. Numbers that are no farther apart than `tolerance` count as equal; 0
    /// compares their bits. Each trace is opened up to three times, because states, events and the
    /// journal of one need not be interleaved like those of the other.
    pub fn between<R: Read>(
        a: &dyn Fn() -> Opened<R>,
        b: &dyn Fn() -> Opened<R>,
        tolerance: f64,
    ) -> Result<Self, InputError> {
        let mut found = Self::default();
        found.compare_states(a()?, b()?, tolerance)?;
        if found.compare_events(a()?, b()?, tolerance)? {
            found.compare_journals(a()?, b()?)?;
        }
        Ok(found)
    }

    /// True if both traces are of the same execution.
    pub fn is_same(&self) -> bool {
        let describes = |field: &FieldDifference| DESCRIPTION.contains(&field.field.as_str());
        self.header.iter().all(describes)
            && self.summary.is_empty()
            && self.state.is_none()
            && self.event.is_none()
            && self.entry.is_none()
    }

    fn compare_states<R: Read>(
        &mut self,
        one: TraceReader<R>,
        other: TraceReader<R>,
        tolerance: f64,
    ) -> Result<(), InputError> {
        self.header = header_differences(one.header(), other.header());
        let header = one.header().clone();
        let (bodies, ticks_hz) = (other.header().bodies(), other.header().ticks_hz);
        if (header.bodies(), header.ticks_hz) != (bodies, ticks_hz) {
            return Ok(());
        }
        let records_alike = header.state_every == other.header().state_every;
        let (mut one, mut other) = (Items::new(one, states), Items::new(other, states));
        let (mut a, mut b) = (one.next()?, other.next()?);
        while let (Some(now), Some(then)) = (&a, &b) {
            let order = now.tick.cmp(&then.tick);
            // Where one trace has states less often, others are passed over.
            if order.is_eq() {
                self.compare_tick(&header, now, then, tolerance);
                self.ticks_compared += 1;
            }
            if order.is_le() {
                a = one.next()?;
            }
            if order.is_ge() {
                b = other.next()?;
            }
        }
        if let (true, Some(longer)) = (records_alike, a.as_ref().or(b.as_ref())) {
            let exists = |state: &Option<Kept>| state.is_some().then_some(1.0);
            self.state.get_or_insert_with(|| StateDifference {
                tick: longer.tick,
                time_s: header.time_s(longer.tick),
                body: 0,
                value: "existence",
                a: exists(&a),
                b: exists(&b),
            });
        }
        Ok(())
    }

    fn compare_tick(&mut self, header: &Header, a: &Kept, b: &Kept, tolerance: f64) {
        let mut note = |body, value, one: Option<f64>, other: Option<f64>| {
            self.state.get_or_insert_with(|| StateDifference {
                tick: a.tick,
                time_s: header.time_s(a.tick),
                body,
                value,
                a: one,
                b: other,
            });
            if let (Some(one), Some(other)) = (one, other) {
                self.largest = self.largest.max((one - other).abs());
            }
        };
        for body in 0..header.bodies() {
            for ((one, other), value) in a.channels.iter().zip(&b.channels).zip(CHANNELS) {
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

    /// Events and summaries; true if both traces have a journal.
    fn compare_events<R: Read>(
        &mut self,
        one: TraceReader<R>,
        other: TraceReader<R>,
        tolerance: f64,
    ) -> Result<bool, InputError> {
        let (mut one, mut other) = (Items::new(one, events), Items::new(other, events));
        let same = |a: &Event, b: &Event| {
            if tolerance > 0.0 {
                (a.kind, a.agent, a.other) == (b.kind, b.agent, b.other)
                    && (a.time_s - b.time_s).abs() <= tolerance
            } else {
                a == b
            }
        };
        (self.event, self.events_compared) = first_difference(&mut one, &mut other, same)?;
        let near = |name: &str, a: &Value, b: &Value| {
            // With a tolerance digests say nothing.
            tolerance > 0.0
                && (DIGESTS.contains(&name)
                    || matches!((a.as_f64(), b.as_f64()), (Some(a), Some(b)) if (a - b).abs() <= tolerance))
        };
        self.summary = field_differences(&json(&one.summary), &json(&other.summary), near);
        Ok(one.has_journal && other.has_journal)
    }

    /// The journals of fleets. Their times are ticks, which are equal or not.
    fn compare_journals<R: Read>(
        &mut self,
        one: TraceReader<R>,
        other: TraceReader<R>,
    ) -> Result<(), InputError> {
        let (mut one, mut other) = (Items::new(one, entries), Items::new(other, entries));
        (self.entry, self.entries_compared) =
            first_difference(&mut one, &mut other, |a, b| a == b)?;
        Ok(())
    }
}

fn json(value: &impl Serialize) -> Value {
    // Everything in a header and in a summary can be written as JSON.
    serde_json::to_value(value).unwrap_or_default()
}

fn header_differences(a: &Header, b: &Header) -> Vec<FieldDifference> {
    let mut found = field_differences(&json(a), &json(b), |_, _, _| false);
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
    let parts = parts.into_iter().filter(|(_, same)| !same);
    found.extend(parts.map(|(part, _)| FieldDifference {
        field: part.to_owned(),
        a: Value::Null,
        b: Value::Null,
    }));
    found
}

/// Fields of objects that differ, including those of nested objects.
fn field_differences(
    a: &Value,
    b: &Value,
    near: impl Fn(&str, &Value, &Value) -> bool + Copy,
) -> Vec<FieldDifference> {
    let (Value::Object(one), Value::Object(other)) = (a, b) else {
        return Vec::new();
    };
    let names: BTreeSet<&String> = one.keys().chain(other.keys()).collect();
    let mut found = Vec::new();
    for name in names {
        // Indexing finds `null` where a field is missing.
        let (a, b) = (&a[name], &b[name]);
        if a == b || near(name, a, b) {
            continue;
        }
        if a.is_object() && b.is_object() {
            for mut inner in field_differences(a, b, near) {
                inner.field = format!("{name}.{}", inner.field);
                found.push(inner);
            }
        } else {
            let (field, a, b) = (name.clone(), a.clone(), b.clone());
            found.push(FieldDifference { field, a, b });
        }
    }
    found
}

/// The states of a tick.
struct Kept {
    tick: u64,
    channels: [Vec<f64>; 3],
    progress: Vec<u32>,
}

fn states(frame: &Frame<'_>) -> Vec<Kept> {
    let Frame::State { tick, states } = frame else {
        return Vec::new();
    };
    let channels = [Some(states.x_m), Some(states.y_m), states.heading_rad];
    vec![Kept {
        tick: *tick,
        channels: channels.map(|channel| channel.unwrap_or_default().to_vec()),
        progress: states.progress.unwrap_or_default().to_vec(),
    }]
}

fn events(frame: &Frame<'_>) -> Vec<Event> {
    match frame {
        Frame::Events(events) => events.to_vec(),
        _ => Vec::new(),
    }
}

fn entries(frame: &Frame<'_>) -> Vec<Entry> {
    match frame {
        Frame::Journal(entries) => entries.to_vec(),
        _ => Vec::new(),
    }
}

/// States, events or entries of a journal one by one.
struct Items<R, T> {
    reader: TraceReader<R>,
    waiting: std::vec::IntoIter<T>,
    /// Those of a frame.
    of: fn(&Frame<'_>) -> Vec<T>,
    has_journal: bool,
    summary: Option<Summary>,
}

impl<R: Read, T> Items<R, T> {
    fn new(reader: TraceReader<R>, of: fn(&Frame<'_>) -> Vec<T>) -> Self {
        Self {
            reader,
            waiting: Vec::new().into_iter(),
            of,
            has_journal: false,
            summary: None,
        }
    }

    /// The next one; at the end of the trace `None`, and there is a summary.
    fn next(&mut self) -> Result<Option<T>, InputError> {
        loop {
            if let Some(item) = self.waiting.next() {
                return Ok(Some(item));
            }
            let Some(frame) = self.reader.next_frame()? else {
                return Ok(None);
            };
            self.waiting = (self.of)(&frame).into_iter();
            match frame {
                Frame::Journal(_) => self.has_journal = true,
                Frame::End(summary) => self.summary = Some(summary.clone()),
                Frame::State { .. } | Frame::Events(_) | Frame::Remarks(_) | Frame::Waits(_) => {}
            }
        }
    }
}

/// The first two that differ, and the number of those that were compared.
fn first_difference<R: Read, T>(
    one: &mut Items<R, T>,
    other: &mut Items<R, T>,
    same: impl Fn(&T, &T) -> bool,
) -> Result<(Option<ItemDifference<T>>, u64), InputError> {
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
