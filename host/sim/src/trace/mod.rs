//! Traces: records of executions, as a stream and as a file.
//!
//! An execution tells a [`TraceSink`] what happens. [`TraceWriter`] is a sink
//! that makes a file of it, and [`TraceReader`] gives the file back, frame by
//! frame or into another sink ([`TraceReader::replay`]). A file explains itself:
//! with its [`Header`] it can be drawn without map, plan and fleet.
//!
//! The format is specified in `docs/trace-format.md`. States are lossless, to the bit;
//! memory is bounded on both sides, by the number of bodies and not by the length
//! of the execution, and for a reader also by what the file really has.
//!
//! The *trace digest* identifies the execution and does not depend on what is
//! recorded of it: see [`Summary::digest`].

mod counts;
mod delta;
mod diff;
mod digest;
mod export;
mod header;
mod journal;
mod read;
mod waits;
mod write;

use std::io;

pub use counts::{Counts, FleetCounts};
pub use diff::{Difference, FieldDifference, ItemDifference, StateDifference};
pub use digest::{CHUNK, ChunkDigest, EventsDigest, StatesDigest};
pub use export::{Exporter, Outputs};
pub use header::{Bounds, Cells, Digests, Header, Outline, Profile, Scene};
pub use journal::{By, Entry, Errand, Goal, Happening, Remark, Standing};
pub use read::{Frame, TraceContents, TraceReader, read_trace};
pub use waits::{Awaited, WaitLog, Waiting, Waits};
pub use write::{TraceOptions, TraceWriter};

use fleetyard_core::{Digest, Hasher};
use serde::Serialize;

use crate::event::{Event, EventKind, Other};

/// The first bytes of a file, chosen so that treatment as text corrupts them.
const MAGIC: [u8; 8] = *b"\x89FYT\r\n\x1a\n";
/// The last bytes of a file.
const END_MAGIC: [u8; 8] = *b"FYTend\r\n";
const VERSION: u16 = 2;

/// Kinds of frames. Readers skip kinds that they do not know if these are lower
/// case letters, and refuse them otherwise.
mod kind {
    pub(super) const HEADER: u8 = b'H';
    pub(super) const CELLS: u8 = b'C';
    pub(super) const POLYGONS: u8 = b'P';
    pub(super) const OUTLINE: u8 = b'o';
    pub(super) const ROADMAP: u8 = b'm';
    pub(super) const BODIES: u8 = b'B';
    pub(super) const STATES: u8 = b'S';
    pub(super) const EVENTS: u8 = b'E';
    pub(super) const ENDPOINTS: u8 = b'e';
    pub(super) const WORKSTATIONS: u8 = b'w';
    pub(super) const JOURNAL: u8 = b'j';
    pub(super) const REMARKS: u8 = b'r';
    pub(super) const WAITS: u8 = b'd';
    pub(super) const SUMMARY: u8 = b'Z';
    pub(super) const INDEX: u8 = b'I';
}

/// Bytes of a frame before its payload: the kind and the length of the payload.
const FRAME_HEAD: usize = 5;
/// Bytes of the check after the payload.
const FRAME_CHECK: usize = 8;
/// Bytes of the end of a file: the place of the index, and the magic number.
const TRAILER_BYTES: usize = 16;
const EVENT_BYTES: usize = 26;
/// Bytes of a summary, including the digest of the file.
const SUMMARY_BYTES: usize = 120;
/// Most events in one frame.
const EVENTS_PER_FRAME: usize = 4096;
/// Limit of a group of states before compression, in bytes, unless it has a single tick.
const GROUP_BYTES: usize = 4 << 20;
/// At this number of entries, an index drops every other entry.
const INDEX_ENTRIES: usize = 1 << 16;
const INDEX_ENTRY_BYTES: usize = 16;
/// Most agents and moving obstacles, together.
const MAX_BODIES: usize = 1 << 27;

/// State of all bodies at a tick. All slices have one entry per body: first the agents,
/// then the moving obstacles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct States<'a> {
    /// x in metres.
    pub x_m: &'a [f64],
    /// y in metres.
    pub y_m: &'a [f64],
    /// Headings in radians, counter-clockwise from the x axis; present if and
    /// only if [`Header::headings`].
    pub heading_rad: Option<&'a [f64]>,
    /// The knot of its route that each body has reached, counted from 0; present
    /// if and only if [`Header::progress`].
    pub progress: Option<&'a [u32]>,
}

/// Receives an execution while it runs.
///
/// An error aborts the execution.
pub trait TraceSink: Send {
    /// True if the sink reads [`Header::scene`]; otherwise the scene may stay empty.
    fn wants_scene(&self) -> bool {
        true
    }

    /// True if the sink reads the states of a tick; otherwise they need not be sent.
    fn wants_state(&self, tick: u64) -> bool {
        let _ = tick;
        true
    }

    /// The header; called before everything else.
    fn begin(&mut self, header: &Header) -> io::Result<()> {
        let _ = header;
        Ok(())
    }

    /// States at a tick; ticks come in order, from 0.
    fn state(&mut self, tick: u64, states: &States<'_>) -> io::Result<()> {
        let _ = (tick, states);
        Ok(())
    }

    /// Events since the last call, in order. Called after the states of the ticks of the
    /// events, not necessarily directly.
    fn events(&mut self, events: &[Event]) -> io::Result<()> {
        let _ = events;
        Ok(())
    }

    /// Journal entries since the last call, in order. Called at the beginning of a block
    /// of time, before the states of the block.
    fn journal(&mut self, entries: &[Entry]) -> io::Result<()> {
        let _ = entries;
        Ok(())
    }

    /// Data of a fleet's run that may differ when it is repeated.
    fn remarks(&mut self, remarks: &[Remark]) -> io::Result<()> {
        let _ = remarks;
        Ok(())
    }

    /// Changes of what agents wait for since the last call, in order, if
    /// [`Header::waits`]. Called at the beginning of a block of time, before the states of
    /// the block.
    fn waits(&mut self, changes: &[Waiting]) -> io::Result<()> {
        let _ = changes;
        Ok(())
    }

    /// The summary; called after everything else.
    fn end(&mut self, summary: &Summary) -> io::Result<()> {
        let _ = summary;
        Ok(())
    }
}

/// Sinks that each receive everything, in this order.
impl TraceSink for Vec<&mut dyn TraceSink> {
    fn wants_scene(&self) -> bool {
        self.iter().any(|sink| sink.wants_scene())
    }

    fn wants_state(&self, tick: u64) -> bool {
        self.iter().any(|sink| sink.wants_state(tick))
    }

    fn begin(&mut self, header: &Header) -> io::Result<()> {
        self.iter_mut().try_for_each(|sink| sink.begin(header))
    }

    fn state(&mut self, tick: u64, states: &States<'_>) -> io::Result<()> {
        let mut sinks = self.iter_mut().filter(|sink| sink.wants_state(tick));
        sinks.try_for_each(|sink| sink.state(tick, states))
    }

    fn events(&mut self, events: &[Event]) -> io::Result<()> {
        self.iter_mut().try_for_each(|sink| sink.events(events))
    }

    fn journal(&mut self, entries: &[Entry]) -> io::Result<()> {
        self.iter_mut().try_for_each(|sink| sink.journal(entries))
    }

    fn remarks(&mut self, remarks: &[Remark]) -> io::Result<()> {
        self.iter_mut().try_for_each(|sink| sink.remarks(remarks))
    }

    fn waits(&mut self, changes: &[Waiting]) -> io::Result<()> {
        self.iter_mut().try_for_each(|sink| sink.waits(changes))
    }

    fn end(&mut self, summary: &Summary) -> io::Result<()> {
        self.iter_mut().try_for_each(|sink| sink.end(summary))
    }
}

/// Discards everything.
#[derive(Debug, Clone, Copy, Default)]
pub struct NoTrace;

impl TraceSink for NoTrace {
    fn wants_scene(&self) -> bool {
        false
    }

    fn wants_state(&self, _: u64) -> bool {
        false
    }
}

/// Outcome of an execution in a trace.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Summary {
    /// Number of ticks; there are states of ticks 0 to this one.
    pub ticks: u64,
    /// Simulated time in seconds.
    pub simulated_s: f64,
    /// Contacts between agents.
    pub contacts_agent_agent: u64,
    /// Contacts of agents with obstacles, standing or moving.
    pub contacts_agent_obstacle: u64,
    /// Least distance between centres.
    pub nearest_approach_m: Option<f64>,
    /// Largest tracking error in metres.
    pub tracking_error_max_m: f64,
    /// Mean tracking error in metres.
    pub tracking_error_mean_m: f64,
    /// Digest of the states at all ticks: see [`StatesDigest`].
    pub states_digest: Digest,
    /// Digest of all events: see [`EventsDigest`].
    pub events_digest: Digest,
    /// Digest of the execution: see [`Summary::digest`].
    pub trace_digest: Digest,
}

impl Summary {
    /// The trace digest: of the identity of the header, which is everything that affects
    /// the execution, and of all other fields of the summary.
    pub fn digest(&self, header: &Header) -> Digest {
        let mut hasher = Hasher::new("fleetyard.trace/2");
        header.identify(&mut hasher);
        hasher.bytes(&self.figures());
        hasher.finish()
    }

    /// The summary with its trace digest.
    #[must_use]
    pub fn sealed(mut self, header: &Header) -> Self {
        self.trace_digest = self.digest(header);
        self
    }

    /// All fields but the trace digest.
    fn figures(&self) -> Vec<u8> {
        let mut out = Vec::with_capacity(SUMMARY_BYTES);
        out.extend(self.ticks.to_le_bytes());
        out.extend(self.simulated_s.to_le_bytes());
        out.extend(self.contacts_agent_agent.to_le_bytes());
        out.extend(self.contacts_agent_obstacle.to_le_bytes());
        // One bit pattern for "none", since arithmetic makes several NaNs.
        let nearest = self.nearest_approach_m.map_or(NO_VALUE, f64::to_bits);
        out.extend(nearest.to_le_bytes());
        out.extend(self.tracking_error_max_m.to_le_bytes());
        out.extend(self.tracking_error_mean_m.to_le_bytes());
        out.extend(self.states_digest.0.to_le_bytes());
        out.extend(self.events_digest.0.to_le_bytes());
        out
    }

    fn parse(fields: &mut Fields<'_>) -> Option<Self> {
        Some(Self {
            ticks: fields.u64()?,
            simulated_s: fields.f64()?,
            contacts_agent_agent: fields.u64()?,
            contacts_agent_obstacle: fields.u64()?,
            nearest_approach_m: Some(fields.f64()?).filter(|value| !value.is_nan()),
            tracking_error_max_m: fields.f64()?,
            tracking_error_mean_m: fields.f64()?,
            states_digest: Digest(fields.u128()?),
            events_digest: Digest(fields.u128()?),
            trace_digest: Digest(fields.u128()?),
        })
    }
}

/// The bits of a float that stands for no value.
const NO_VALUE: u64 = 0x7ff8_0000_0000_0000;

/// An event in files and digests.
fn event_bytes(event: &Event) -> [u8; EVENT_BYTES] {
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

fn parse_event(bytes: &[u8; EVENT_BYTES]) -> Option<Event> {
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
        4 if other == 0 => Other::Goal,
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

/// Entry points for reading, in order: (first tick, offset in the file) of groups of
/// states. Thinned out as it grows, identically by writer and reader.
#[derive(Debug, Clone, Default, PartialEq)]
struct Index {
    entries: Vec<(u64, u64)>,
    /// Number of groups to skip after each entry.
    pass: u64,
    passed: u64,
}

impl Index {
    fn note(&mut self, tick: u64, offset: u64) {
        if self.passed > 0 {
            self.passed -= 1;
            return;
        }
        if self.entries.len() == INDEX_ENTRIES {
            let mut at = 0;
            self.entries.retain(|_| {
                at += 1;
                at % 2 == 1
            });
            self.pass = 2 * self.pass + 1;
        }
        self.entries.push((tick, offset));
        self.passed = self.pass;
    }

    fn bytes(&self) -> Vec<u8> {
        let numbers = self.entries.iter().flat_map(|(tick, at)| [*tick, *at]);
        numbers.flat_map(u64::to_le_bytes).collect()
    }

    fn parse(payload: &[u8]) -> Option<Self> {
        let (entries, rest) = payload.as_chunks::<INDEX_ENTRY_BYTES>();
        let entry = |bytes: &[u8; INDEX_ENTRY_BYTES]| {
            let mut fields = Fields(bytes);
            Some((fields.u64()?, fields.u64()?))
        };
        let entries: Vec<_> = entries.iter().map(entry).collect::<Option<_>>()?;
        rest.is_empty().then(|| Self {
            entries,
            ..Self::default()
        })
    }
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

    /// A LEB128 number of 64 bits.
    fn number(&mut self) -> Option<u64> {
        let mut value = 0;
        for shift in (0..64).step_by(7) {
            let byte = self.u8()?;
            let part = u64::from(byte & 0x7f);
            // Exceeds 64 bits.
            if shift == 63 && part > 1 {
                return None;
            }
            value |= part << shift;
            if byte & 0x80 == 0 {
                return Some(value);
            }
        }
        None
    }

    /// A LEB128 number of 32 bits.
    fn number32(&mut self) -> Option<u32> {
        self.number()?.try_into().ok()
    }
}

/// Appends a number as LEB128.
fn put_number(out: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}

#[cfg(test)]
mod tests {
    use super::{Fields, INDEX_ENTRIES, Index, put_number};

    #[test]
    fn numbers_keep_their_value() {
        for value in [0, 1, 127, 128, 300, 1 << 20, 1 << 32, 1 << 63, u64::MAX] {
            let mut bytes = Vec::new();
            put_number(&mut bytes, value);
            let mut fields = Fields(&bytes);
            assert_eq!(fields.number(), Some(value));
            assert!(fields.0.is_empty());
            let small = u32::try_from(value).ok();
            assert_eq!(Fields(&bytes).number32(), small);
        }
        assert_eq!(Fields(&[0xff; 11]).number(), None);
        let past = [[0xff; 9].as_slice(), &[2]].concat();
        assert_eq!(Fields(&past).number(), None);
        assert_eq!(Fields(&[0x80]).number(), None);
    }

    #[test]
    fn a_long_index_is_thinned_out_evenly() {
        let mut index = Index::default();
        for group in 0..5 * INDEX_ENTRIES as u64 {
            index.note(600 * group, 1000 + group);
        }
        assert!(index.entries.len() <= INDEX_ENTRIES);
        assert!(index.entries.len() > INDEX_ENTRIES / 2);
        let steps: Vec<u64> = index.entries.windows(2).map(|w| w[1].0 - w[0].0).collect();
        assert!(steps.iter().all(|step| *step == steps[0]), "{steps:?}");
        assert_eq!(Index::parse(&index.bytes()).unwrap().entries, index.entries);
    }
}
