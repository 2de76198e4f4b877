//! Traces: what happened in an execution, as a stream and as a file.
//!
//! # File format, version 1
//!
//! All numbers are little endian; floats are IEEE `f64` bit patterns. A file is
//! a preamble and frames.
//!
//! | part | bytes | content |
//! | --- | --- | --- |
//! | magic | 8 | `89 46 59 54 0d 0a 1a 0a`, which breaks if the file is treated as text |
//! | version | 2 | 1 |
//! | header length | 2 | length of the header |
//! | header | … | see below |
//! | check | 8 | XXH3-64 of everything before it |
//!
//! The header: agents `u32`, rows `u32`, columns `u32`, ticks per second `u32`,
//! substeps `u32`, tier `u8` (0 kinematic, 1 contact), flags `u8` (bit 0: states
//! are recorded, bit 1: every substep was taken apart), two zero bytes, ticks
//! between recorded states `u32`, ticks `u64`, then the floats cell side, step,
//! radius, maximum speed in cells per step and approach range in cells, then
//! the 128-bit digests of map and plan. Readers skip what a longer header adds.
//!
//! A frame is kind `u8`, payload length `u32`, payload, and the XXH3-64 of
//! those three. The kinds:
//!
//! - `S`, state at a tick: tick `u64`, a bitmap of 2·agents bits (bit 2i for x and
//!   bit 2i + 1 for y of agent i, lowest bit first) of the coordinates that differ
//!   from the last recorded state (at first: from +0), and the new values of those.
//! - `E`, events: 26 bytes each: substep `u64`, time in seconds `f64`, kind `u8`
//!   (0 begin, 1 end, 2 arrival), other `u8` (0 agent, 1 cell, 2 polygon, 3 mover, 4 goal),
//!   agent `u32`, other agent, cell or index `u32`. At most 4096 in a frame. Events come in order, in frames after
//!   the states of the ticks that they fall into.
//! - `Z`, the end: ticks `u64`, simulated seconds, contacts between agents `u64`,
//!   contacts with obstacles `u64`, nearest approach (NaN if none), largest and mean
//!   tracking error, 128-bit trace digest, and the XXH3-128 of the whole file
//!   before this number. Nothing follows.
//!
//! Since every frame carries a check, whatever precedes a damaged place can be
//! trusted, and [`read_trace`] returns it.
//!
//! The trace digest identifies the execution and does not depend on what is
//! recorded: it covers the header (without its recording flags), the states at all
//! ticks, all events and the figures of the end frame.

use std::io::{self, Read, Write};

use fleetyard_core::{Digest, Grid, GridPlan, Hasher, InputError};
use xxhash_rust::xxh3::{Xxh3, xxh3_64};

use crate::config::{SimConfig, Tier};
use crate::event::{Event, EventKind, Other};

const MAGIC: [u8; 8] = *b"\x89FYT\r\n\x1a\n";
const VERSION: u16 = 1;
const HEADER_BYTES: usize = 108;
const EVENT_BYTES: usize = 26;
const END_BYTES: usize = 88;
/// Most events in one frame.
const EVENTS_PER_FRAME: usize = 4096;

/// Receives an execution as it happens.
///
/// An error breaks the execution off.
pub trait TraceSink {
    /// Before everything else.
    fn begin(&mut self, header: &Header) -> io::Result<()>;

    /// Where everybody is at a tick; ticks come in order, from 0.
    fn state(&mut self, tick: u64, x_m: &[f64], y_m: &[f64]) -> io::Result<()>;

    /// What happened since the last call, in order. It comes after the states
    /// of the ticks that the events fall into, not necessarily directly.
    fn events(&mut self, events: &[Event]) -> io::Result<()>;

    /// After everything else.
    fn end(&mut self, summary: &Summary) -> io::Result<()>;
}

/// Forgets everything.
#[derive(Debug, Clone, Copy, Default)]
pub struct NoTrace;

impl TraceSink for NoTrace {
    fn begin(&mut self, _: &Header) -> io::Result<()> {
        Ok(())
    }

    fn state(&mut self, _: u64, _: &[f64], _: &[f64]) -> io::Result<()> {
        Ok(())
    }

    fn events(&mut self, _: &[Event]) -> io::Result<()> {
        Ok(())
    }

    fn end(&mut self, _: &Summary) -> io::Result<()> {
        Ok(())
    }
}

/// What a trace is about.
#[derive(Debug, Clone, PartialEq)]
pub struct Header {
    /// Number of agents.
    pub agents: u32,
    /// Rows of the map.
    pub rows: u32,
    /// Columns of the map.
    pub cols: u32,
    /// Ticks per simulated second.
    pub ticks_hz: u32,
    /// Substeps per tick.
    pub substeps: u32,
    /// How bodies moved and how contacts were found.
    pub tier: Tier,
    /// Whether every substep was taken apart.
    pub every_substep: bool,
    /// Ticks between recorded states; 0 if none are recorded.
    pub state_every: u32,
    /// Number of ticks.
    pub ticks: u64,
    /// Side of a cell in metres.
    pub cell_size_m: f64,
    /// Duration of a step in seconds.
    pub step_s: f64,
    /// Radius of an agent in metres.
    pub radius_m: f64,
    /// See [`SimConfig::max_speed_cells_per_step`].
    pub max_speed_cells_per_step: f64,
    /// See [`SimConfig::approach_range_cells`].
    pub approach_range_cells: f64,
    /// Digest of the map.
    pub grid: Digest,
    /// Digest of the plan.
    pub plan: Digest,
}

impl Header {
    pub(crate) fn new(grid: &Grid, plan: &GridPlan, config: &SimConfig, ticks: u64) -> Self {
        Self {
            agents: plan.agents() as u32,
            rows: grid.rows(),
            cols: grid.cols(),
            ticks_hz: config.ticks_hz,
            substeps: config.substeps,
            tier: config.tier,
            every_substep: config.every_substep,
            state_every: 0,
            ticks,
            cell_size_m: config.cell_size_m,
            step_s: config.step_s,
            radius_m: config.radius_m(),
            max_speed_cells_per_step: config.max_speed_cells_per_step,
            approach_range_cells: config.approach_range_cells,
            grid: grid.digest(),
            plan: plan.digest(),
        }
    }

    fn bytes(&self) -> Vec<u8> {
        let mut out = Vec::with_capacity(HEADER_BYTES);
        for value in [
            self.agents,
            self.rows,
            self.cols,
            self.ticks_hz,
            self.substeps,
        ] {
            out.extend(value.to_le_bytes());
        }
        out.push(match self.tier {
            Tier::Kinematic => 0,
            Tier::Contact => 1,
        });
        out.push(u8::from(self.state_every > 0) | u8::from(self.every_substep) << 1);
        out.extend([0, 0]);
        out.extend(self.state_every.to_le_bytes());
        out.extend(self.ticks.to_le_bytes());
        for value in [
            self.cell_size_m,
            self.step_s,
            self.radius_m,
            self.max_speed_cells_per_step,
            self.approach_range_cells,
        ] {
            out.extend(value.to_le_bytes());
        }
        out.extend(self.grid.0.to_le_bytes());
        out.extend(self.plan.0.to_le_bytes());
        out
    }

    fn parse(bytes: &[u8]) -> Option<Self> {
        let mut fields = Fields(bytes);
        let [agents, rows, cols, ticks_hz, substeps] = [
            fields.u32()?,
            fields.u32()?,
            fields.u32()?,
            fields.u32()?,
            fields.u32()?,
        ];
        let tier = match fields.u8()? {
            0 => Tier::Kinematic,
            1 => Tier::Contact,
            _ => return None,
        };
        let flags = fields.u8()?;
        fields.take::<2>()?;
        Some(Self {
            agents,
            rows,
            cols,
            ticks_hz,
            substeps,
            tier,
            every_substep: flags & 2 != 0,
            state_every: fields.u32()?,
            ticks: fields.u64()?,
            cell_size_m: fields.f64()?,
            step_s: fields.f64()?,
            radius_m: fields.f64()?,
            max_speed_cells_per_step: fields.f64()?,
            approach_range_cells: fields.f64()?,
            grid: Digest(fields.u128()?),
            plan: Digest(fields.u128()?),
        })
    }
}

/// What an execution came to, as traces tell it.
#[derive(Debug, Clone, PartialEq)]
pub struct Summary {
    /// Number of ticks.
    pub ticks: u64,
    /// Simulated time in seconds.
    pub simulated_s: f64,
    /// Contacts between agents.
    pub contacts_agent_agent: u64,
    /// Contacts of agents with obstacles.
    pub contacts_agent_obstacle: u64,
    /// Least distance between centres.
    pub nearest_approach_m: Option<f64>,
    /// Largest tracking error in metres.
    pub tracking_error_max_m: f64,
    /// Mean tracking error in metres.
    pub tracking_error_mean_m: f64,
    /// Digest of the execution.
    pub trace_digest: Digest,
}

impl Summary {
    /// All fields but the digest.
    fn figures(&self) -> Vec<u8> {
        let mut out = Vec::with_capacity(END_BYTES);
        out.extend(self.ticks.to_le_bytes());
        out.extend(self.simulated_s.to_le_bytes());
        out.extend(self.contacts_agent_agent.to_le_bytes());
        out.extend(self.contacts_agent_obstacle.to_le_bytes());
        out.extend(self.nearest_approach_m.unwrap_or(f64::NAN).to_le_bytes());
        out.extend(self.tracking_error_max_m.to_le_bytes());
        out.extend(self.tracking_error_mean_m.to_le_bytes());
        out
    }

    /// The digest of an execution, from the digests of its states and events.
    pub(crate) fn digest(&self, header: &Header, states: u128, events: u128) -> Digest {
        let header = Header {
            state_every: 0,
            ..header.clone()
        };
        let mut hasher = Hasher::new("fleetyard.trace/1");
        hasher.bytes(&header.bytes());
        hasher.bytes(&states.to_le_bytes());
        hasher.bytes(&events.to_le_bytes());
        hasher.bytes(&self.figures());
        hasher.finish()
    }

    fn parse(bytes: &[u8]) -> Option<(Self, u128)> {
        let mut fields = Fields(bytes);
        let summary = Self {
            ticks: fields.u64()?,
            simulated_s: fields.f64()?,
            contacts_agent_agent: fields.u64()?,
            contacts_agent_obstacle: fields.u64()?,
            nearest_approach_m: Some(fields.f64()?).filter(|value| !value.is_nan()),
            tracking_error_max_m: fields.f64()?,
            tracking_error_mean_m: fields.f64()?,
            trace_digest: Digest(fields.u128()?),
        };
        let file = fields.u128()?;
        fields.0.is_empty().then_some((summary, file))
    }
}

/// An event as files and digests hold it.
pub(crate) fn event_bytes(event: &Event) -> [u8; EVENT_BYTES] {
    let (tag, other) = match event.other {
        Other::Agent(agent) => (0, agent),
        Other::Obstacle { cell } => (1, cell),
        Other::Polygon(index) => (2, index),
        Other::Mover(index) => (3, index),
        Other::Goal => (4, 0),
    };
    let mut out = [0; EVENT_BYTES];
    out[0..8].copy_from_slice(&event.substep.to_le_bytes());
    out[8..16].copy_from_slice(&event.time_s.to_le_bytes());
    out[16] = match event.kind {
        EventKind::Begin => 0,
        EventKind::End => 1,
        EventKind::Arrive => 2,
    };
    out[17] = tag;
    out[18..22].copy_from_slice(&event.agent.to_le_bytes());
    out[22..26].copy_from_slice(&other.to_le_bytes());
    out
}

fn parse_event(bytes: &[u8]) -> Option<Event> {
    let mut fields = Fields(bytes);
    let (substep, time_s) = (fields.u64()?, fields.f64()?);
    let kind = match fields.u8()? {
        0 => EventKind::Begin,
        1 => EventKind::End,
        2 => EventKind::Arrive,
        _ => return None,
    };
    let tag = fields.u8()?;
    let (agent, other) = (fields.u32()?, fields.u32()?);
    let other = match tag {
        0 => Other::Agent(other),
        1 => Other::Obstacle { cell: other },
        2 => Other::Polygon(other),
        3 => Other::Mover(other),
        4 => Other::Goal,
        _ => return None,
    };
    Some(Event {
        substep,
        time_s,
        kind,
        agent,
        other,
    })
}

/// Takes fields off the front of a slice.
struct Fields<'a>(&'a [u8]);

impl Fields<'_> {
    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (head, tail) = self.0.split_first_chunk::<N>()?;
        self.0 = tail;
        Some(*head)
    }

    fn u8(&mut self) -> Option<u8> {
        self.take::<1>().map(|[byte]| byte)
    }

    fn u32(&mut self) -> Option<u32> {
        self.take().map(u32::from_le_bytes)
    }

    fn u64(&mut self) -> Option<u64> {
        self.take().map(u64::from_le_bytes)
    }

    fn u128(&mut self) -> Option<u128> {
        self.take().map(u128::from_le_bytes)
    }

    fn f64(&mut self) -> Option<f64> {
        self.take().map(f64::from_le_bytes)
    }
}

/// Writes a trace file while the execution runs. Give it a buffered writer; it
/// holds one frame and the last recorded state, whatever the length of the plan.
pub struct TraceWriter<W> {
    out: W,
    every: u32,
    hash: Xxh3,
    frame: Vec<u8>,
    last: Vec<f64>,
}

impl<W: Write> TraceWriter<W> {
    /// Records events only.
    pub fn events_only(out: W) -> Self {
        Self::new(out, 0)
    }

    /// Records events and the state at every `every`-th tick; 1 is every tick
    /// and 0 is none.
    pub fn new(out: W, every: u32) -> Self {
        Self {
            out,
            every,
            hash: Xxh3::new(),
            frame: Vec::new(),
            last: Vec::new(),
        }
    }

    /// The writer, once the execution has ended.
    pub fn into_inner(self) -> W {
        self.out
    }

    fn put(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.hash.update(bytes);
        self.out.write_all(bytes)
    }

    /// Starts a frame in the buffer.
    fn open_frame(&mut self, kind: u8) {
        self.frame.clear();
        self.frame.push(kind);
        self.frame.extend([0; 4]);
    }

    fn close_frame(&mut self) -> io::Result<()> {
        let mut frame = std::mem::take(&mut self.frame);
        let length = u32::try_from(frame.len() - 5)
            .map_err(|_| io::Error::other("too many agents for one state frame"))?;
        frame[1..5].copy_from_slice(&length.to_le_bytes());
        let check = xxh3_64(&frame);
        self.put(&frame)?;
        self.put(&check.to_le_bytes())?;
        self.frame = frame;
        Ok(())
    }
}

impl<W: Write> TraceSink for TraceWriter<W> {
    fn begin(&mut self, header: &Header) -> io::Result<()> {
        let header = Header {
            state_every: self.every,
            ..header.clone()
        };
        let body = header.bytes();
        let mut bytes = MAGIC.to_vec();
        bytes.extend(VERSION.to_le_bytes());
        bytes.extend((body.len() as u16).to_le_bytes());
        bytes.extend(body);
        let check = xxh3_64(&bytes);
        self.put(&bytes)?;
        self.put(&check.to_le_bytes())?;
        if self.every > 0 {
            self.last = vec![0.0; 2 * header.agents as usize];
        }
        Ok(())
    }

    fn state(&mut self, tick: u64, x_m: &[f64], y_m: &[f64]) -> io::Result<()> {
        if self.every == 0 || !tick.is_multiple_of(u64::from(self.every)) {
            return Ok(());
        }
        self.open_frame(b'S');
        self.frame.extend(tick.to_le_bytes());
        let bits = self.frame.len();
        self.frame.resize(bits + self.last.len().div_ceil(8), 0);
        let values = x_m.iter().zip(y_m).flat_map(|(x, y)| [*x, *y]);
        for (at, (value, last)) in values.zip(&mut self.last).enumerate() {
            if value.to_bits() != last.to_bits() {
                self.frame[bits + at / 8] |= 1 << (at % 8);
                self.frame.extend(value.to_le_bytes());
                *last = value;
            }
        }
        self.close_frame()
    }

    fn events(&mut self, events: &[Event]) -> io::Result<()> {
        for chunk in events.chunks(EVENTS_PER_FRAME) {
            self.open_frame(b'E');
            for event in chunk {
                self.frame.extend(event_bytes(event));
            }
            self.close_frame()?;
        }
        Ok(())
    }

    fn end(&mut self, summary: &Summary) -> io::Result<()> {
        self.open_frame(b'Z');
        self.frame.extend(summary.figures());
        self.frame.extend(summary.trace_digest.0.to_le_bytes());
        // The head of the frame and its fields so far belong to the file's hash.
        self.frame[1..5].copy_from_slice(&(END_BYTES as u32).to_le_bytes());
        let mut hash = self.hash.clone();
        hash.update(&self.frame);
        let file = hash.digest128();
        self.frame.extend(file.to_le_bytes());
        self.close_frame()?;
        self.out.flush()
    }
}

/// One piece of a trace file.
#[derive(Debug, Clone, PartialEq)]
pub enum Frame {
    /// Where everybody is at a tick.
    State {
        /// The tick.
        tick: u64,
        /// x of every agent in metres.
        x_m: Vec<f64>,
        /// y of every agent in metres.
        y_m: Vec<f64>,
    },
    /// Events, in order.
    Events(Vec<Event>),
    /// The end.
    End(Summary),
}

/// Reads a trace file frame by frame.
pub struct TraceReader<R> {
    input: R,
    name: String,
    header: Header,
    hash: Xxh3,
    /// Bytes read so far.
    offset: u64,
    last: Vec<f64>,
    events: Xxh3,
    states: Xxh3,
    states_seen: u64,
    over: bool,
}

impl<R: Read> TraceReader<R> {
    /// Reads the preamble. `name` is the file's name for messages.
    pub fn open(mut input: R, name: impl Into<String>) -> Result<Self, InputError> {
        let name = name.into();
        let mut preamble = read_up_to(&mut input, 12, &name)?;
        if !preamble.starts_with(&MAGIC) {
            let error = if preamble.is_empty() {
                InputError::new(name, "the file is empty")
            } else {
                InputError::new(name, "this is not a trace file")
            };
            return Err(error.hint("traces are written by this program while it executes a plan"));
        }
        let mut fields = Fields(&preamble[8..]);
        let (version, length) = match (fields.take(), fields.take()) {
            (Some(version), Some(length)) => {
                (u16::from_le_bytes(version), u16::from_le_bytes(length))
            }
            _ => return Err(truncated(name, preamble.len() as u64)),
        };
        if version > VERSION {
            let reason =
                format!("the trace has version {version}, this program reads up to {VERSION}");
            return Err(InputError::new(name, reason).hint("use a newer release to read it"));
        }
        let rest = usize::from(length) + 8;
        let body = read_up_to(&mut input, rest, &name)?;
        if body.len() < rest {
            return Err(truncated(name, (preamble.len() + body.len()) as u64));
        }
        let (body, check) = body.split_at(usize::from(length));
        preamble.extend(body);
        if check != xxh3_64(&preamble).to_le_bytes() {
            return Err(damaged(name, 0, "the header does not match its check"));
        }
        let Some(header) = Header::parse(body).filter(|_| version == VERSION) else {
            return Err(damaged(name, 12, "the header makes no sense"));
        };
        let mut hash = Xxh3::new();
        hash.update(&preamble);
        hash.update(check);
        Ok(Self {
            input,
            name,
            header,
            hash,
            offset: (preamble.len() + 8) as u64,
            last: Vec::new(),
            events: Xxh3::new(),
            states: Xxh3::new(),
            states_seen: 0,
            over: false,
        })
    }

    /// What the trace is about.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// The next frame; `None` after the end frame. After an error nothing more
    /// can be read, but everything returned before is intact.
    pub fn next_frame(&mut self) -> Result<Option<Frame>, InputError> {
        if self.over {
            return Ok(None);
        }
        let frame = self.read_frame();
        self.over = !matches!(frame, Ok(Frame::State { .. } | Frame::Events(_)));
        frame.map(Some)
    }

    fn read_frame(&mut self) -> Result<Frame, InputError> {
        let start = self.offset;
        let name = self.name.clone();
        let wrong = |reason| damaged(name.clone(), start, reason);
        let mut frame = read_up_to(&mut self.input, 5, &self.name)?;
        if frame.len() < 5 {
            return Err(truncated(self.name.clone(), start));
        }
        let kind = frame[0];
        let length = Fields(&frame[1..]).u32().unwrap_or(0) as usize;
        // 8 bytes and 2 bits per coordinate are the most that a state takes.
        let coordinates = 2 * u64::from(self.header.agents);
        let most = match kind {
            b'S' => 8 + coordinates.div_ceil(8) + 8 * coordinates,
            b'E' => (EVENTS_PER_FRAME * EVENT_BYTES) as u64,
            b'Z' => END_BYTES as u64,
            _ => return Err(wrong("there is no such kind of frame")),
        };
        if length as u64 > most {
            return Err(wrong("a frame is longer than it can be"));
        }
        let rest = read_up_to(&mut self.input, length + 8, &self.name)?;
        if rest.len() < length + 8 {
            return Err(truncated(self.name.clone(), start));
        }
        let (payload, check) = rest.split_at(length);
        frame.extend(payload);
        if check != xxh3_64(&frame).to_le_bytes() {
            return Err(wrong("a frame does not match its check"));
        }
        let result = match kind {
            b'S' => self.parse_state(payload).ok_or("a state makes no sense"),
            b'E' => self.parse_events(payload).ok_or("an event makes no sense"),
            _ => self.parse_end(&frame, payload),
        };
        let result = result.map_err(wrong)?;
        self.hash.update(&frame);
        self.hash.update(check);
        self.offset += (frame.len() + 8) as u64;
        if matches!(result, Frame::End(_))
            && !read_up_to(&mut self.input, 1, &self.name)?.is_empty()
        {
            let reason = "there is something after the end frame";
            return Err(damaged(self.name.clone(), self.offset, reason));
        }
        Ok(result)
    }

    fn parse_state(&mut self, payload: &[u8]) -> Option<Frame> {
        let mut fields = Fields(payload);
        let tick = fields.u64()?;
        let coordinates = 2 * self.header.agents as usize;
        let (bits, values) = fields.0.split_at_checked(coordinates.div_ceil(8))?;
        // Only now is the number of agents known to be backed by data.
        self.last.resize(coordinates, 0.0);
        let mut values = Fields(values);
        for (at, last) in self.last.iter_mut().enumerate() {
            if bits[at / 8] >> (at % 8) & 1 == 1 {
                *last = values.f64()?;
            }
        }
        if !values.0.is_empty() {
            return None;
        }
        let (mut x_m, mut y_m) = (Vec::new(), Vec::new());
        for pair in self.last.chunks_exact(2) {
            x_m.push(pair[0]);
            y_m.push(pair[1]);
        }
        if self.header.state_every == 1 && tick == self.states_seen {
            self.states_seen += 1;
            for value in x_m.iter().chain(&y_m) {
                self.states.update(&value.to_le_bytes());
            }
        }
        Some(Frame::State { tick, x_m, y_m })
    }

    fn parse_events(&mut self, payload: &[u8]) -> Option<Frame> {
        if !payload.len().is_multiple_of(EVENT_BYTES) {
            return None;
        }
        self.events.update(payload);
        let events: Option<Vec<Event>> =
            payload.chunks_exact(EVENT_BYTES).map(parse_event).collect();
        events.map(Frame::Events)
    }

    fn parse_end(&mut self, frame: &[u8], payload: &[u8]) -> Result<Frame, &'static str> {
        let (summary, file) = Summary::parse(payload).ok_or("the end makes no sense")?;
        let mut hash = self.hash.clone();
        hash.update(&frame[..frame.len() - 16]);
        if hash.digest128() != file {
            return Err("the file does not match its digest: frames are missing or exchanged");
        }
        // With all states at hand the trace digest can be computed again.
        if self.header.state_every == 1 {
            let (states, events) = (self.states.digest128(), self.events.digest128());
            if summary.digest(&self.header, states, events) != summary.trace_digest {
                return Err("states and events do not match the trace digest");
            }
        }
        Ok(Frame::End(summary))
    }
}

/// Everything of a trace but its states, and as much of it as is intact.
#[derive(Debug, Clone, PartialEq)]
pub struct TraceContents {
    /// What the trace is about.
    pub header: Header,
    /// The events before the damage, in order.
    pub events: Vec<Event>,
    /// How many states were read.
    pub states: u64,
    /// The last tick of which the state was read.
    pub last_tick: Option<u64>,
    /// The end frame, if it was reached.
    pub end: Option<Summary>,
    /// Why the rest could not be read.
    pub damage: Option<InputError>,
}

/// Reads a whole trace. Fails only if the preamble cannot be read; damage
/// further on is told in [`TraceContents::damage`] beside what is intact.
pub fn read_trace(input: impl Read, name: impl Into<String>) -> Result<TraceContents, InputError> {
    let mut reader = TraceReader::open(input, name)?;
    let mut contents = TraceContents {
        header: reader.header().clone(),
        events: Vec::new(),
        states: 0,
        last_tick: None,
        end: None,
        damage: None,
    };
    loop {
        match reader.next_frame() {
            Ok(Some(Frame::State { tick, .. })) => {
                contents.states += 1;
                contents.last_tick = Some(tick);
            }
            Ok(Some(Frame::Events(events))) => contents.events.extend(events),
            Ok(Some(Frame::End(summary))) => contents.end = Some(summary),
            Ok(None) => return Ok(contents),
            Err(damage) => {
                contents.damage = Some(damage);
                return Ok(contents);
            }
        }
    }
}

/// Reads `count` bytes, or fewer at the end of the input. Memory grows with what
/// is there, not with what a damaged length claims.
fn read_up_to(input: &mut impl Read, count: usize, name: &str) -> Result<Vec<u8>, InputError> {
    let mut bytes = Vec::new();
    input
        .take(count as u64)
        .read_to_end(&mut bytes)
        .map_err(|error| InputError::new(name, format!("the trace could not be read: {error}")))?;
    Ok(bytes)
}

fn truncated(name: String, offset: u64) -> InputError {
    InputError::new(
        name,
        format!("the trace ends within the piece at byte {offset}"),
    )
    .hint("the execution was broken off or the file was cut; what precedes that byte is intact")
}

fn damaged(name: String, offset: u64, reason: &str) -> InputError {
    InputError::new(name, format!("damaged at byte {offset}: {reason}"))
        .hint("what precedes that byte is intact; run the execution again to get the rest")
}
