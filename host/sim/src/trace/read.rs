//! Reading of trace files.

use std::io::{self, Read, Seek, SeekFrom};

use fleetyard_core::{InputError, shown};
use xxhash_rust::xxh3::Xxh3;
use zstd::bulk::Decompressor;
use zstd::zstd_safe::compress_bound;

use super::delta::{Layout, Tracks, from_planes};
use super::journal::{Limits, ROWS_BYTES, ROWS_PER_FRAME, Row, unpack};
use super::{
    Cells, END_MAGIC, EVENT_BYTES, EVENTS_PER_FRAME, Entry, EventsDigest, FRAME_CHECK, FRAME_HEAD,
    Fields, GROUP_BYTES, Header, Index, MAGIC, NoTrace, Remark, SUMMARY_BYTES, States,
    StatesDigest, Summary, TRAILER_BYTES, TraceSink, VERSION, Waiting, kind, parse_event,
};
use crate::event::Event;

/// The longest header that is read, scene aside.
const LONGEST_HEADER: usize = 16 << 20;
/// Bytes of a group of states before its compressed part.
const GROUP_HEAD: usize = 13;
/// Bytes of a frame of journal entries or remarks before its compressed part.
const ROWS_HEAD: usize = 9;

/// One piece of a trace.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Frame<'a> {
    /// States of all bodies at a tick.
    State {
        /// The tick.
        tick: u64,
        /// The states.
        states: States<'a>,
    },
    /// Events, in order.
    Events(&'a [Event]),
    /// Journal entries, in order. After [`TraceReader::seek`] it begins with earlier
    /// entries that are still open at that point: goals, and a call.
    Journal(&'a [Entry]),
    /// Data of a fleet's run that may differ when it is repeated.
    Remarks(&'a [Remark]),
    /// Changes of what agents wait for, in order. After [`TraceReader::seek`] it begins with
    /// earlier ones, of agents that wait at that point.
    Waits(&'a [Waiting]),
    /// The summary.
    End(&'a Summary),
}

/// The piece read last.
enum Piece {
    State,
    Events,
    Journal,
    Remarks,
    Waits,
    End,
}

/// Reads a trace file frame by frame. Give it a buffered reader.
pub struct TraceReader<R> {
    source: Source<R>,
    header: Header,
    layout: Layout,
    decompressor: Option<Decompressor<'static>>,
    index: Index,
    /// The current group of states: its numbers, its ticks, and the number of ticks
    /// already returned.
    numbers: Vec<u64>,
    ticks: usize,
    given: usize,
    tracks: Tracks,
    /// The tick returned last, the expected next tick, and the states.
    tick: u64,
    next_tick: u64,
    values: Vec<f64>,
    events: Vec<Event>,
    journal: Vec<Entry>,
    remarks: Vec<Remark>,
    waits: Vec<Waiting>,
    /// The ticks of the last entry of the journal and of the last change of waits.
    journal_tick: u64,
    waits_tick: u64,
    /// Set if the group read last is the first one after a seek, so that open journal
    /// entries have to be returned.
    has_leapt: bool,
    summary: Option<Summary>,
    states_digest: StatesDigest,
    events_digest: EventsDigest,
    /// Set if everything since the beginning was read, so that digests can be checked.
    whole: bool,
    over: bool,
}

impl<R: Read> TraceReader<R> {
    /// Reads the header and the scene. `name` is the file's name for messages.
    pub fn open(input: R, name: impl Into<String>) -> Result<Self, InputError> {
        let mut source = Source {
            input,
            name: name.into(),
            offset: 0,
            hash: Xxh3::new(),
        };
        source.preamble()?;
        let frame = source.frame(|kind| (kind == kind::HEADER).then_some(LONGEST_HEADER))?;
        let mut header: Header = serde_json::from_slice(&frame.payload).map_err(|error| {
            let reason = format!("the header makes no sense: {}", shown(&error.to_string()));
            source.damaged(frame.start, &reason)
        })?;
        if let Some(fault) = header.fault() {
            return Err(source.damaged(frame.start, fault));
        }
        loop {
            let frame = source.frame(|kind| match kind {
                kind::CELLS
                | kind::ENDPOINTS
                | kind::WORKSTATIONS
                | kind::POLYGONS
                | kind::OUTLINE
                | kind::ROADMAP
                | kind::BODIES => Some(u32::MAX as usize),
                _ => None,
            })?;
            let payload = &frame.payload[..];
            let scene = &mut header.scene;
            let cells = |place: &mut Option<Cells>| {
                *place = Some(Cells::parse(payload)?);
                Some(())
            };
            let parsed = match frame.kind {
                kind::CELLS => cells(&mut scene.cells),
                kind::ENDPOINTS => cells(&mut scene.endpoints),
                kind::WORKSTATIONS => cells(&mut scene.workstations),
                kind::POLYGONS => scene.parse_polygons(payload),
                kind::OUTLINE => scene.parse_outline(payload),
                kind::ROADMAP => scene.parse_roadmap(payload),
                kind::BODIES => scene.parse_bodies(payload, header.agents),
                _ => Some(()),
            };
            if parsed.is_none() {
                return Err(source.damaged(frame.start, "a part of the scene makes no sense"));
            }
            if frame.kind == kind::BODIES {
                // From here on the file has proven 20 bytes for every body.
                if let Some(fault) = header.scene_fault() {
                    return Err(source.damaged(frame.start, fault));
                }
                break;
            }
        }
        let layout = Layout::new(&header);
        Ok(Self {
            source,
            layout,
            decompressor: None,
            index: Index::default(),
            numbers: Vec::new(),
            ticks: 0,
            given: 0,
            tracks: Tracks::default(),
            tick: 0,
            next_tick: 0,
            values: Vec::new(),
            events: Vec::new(),
            journal: Vec::new(),
            remarks: Vec::new(),
            waits: Vec::new(),
            journal_tick: 0,
            waits_tick: 0,
            has_leapt: false,
            summary: None,
            states_digest: StatesDigest::new(layout.bodies),
            events_digest: EventsDigest::default(),
            whole: true,
            over: false,
            header,
        })
    }

    /// The header of the trace.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// True if the states returned last are the first of their group. Then all that the trace
    /// tells of the ticks before them has been returned.
    pub fn begins_group(&self) -> bool {
        self.given == 1
    }

    /// Number of bytes read so far, all intact.
    pub fn offset(&self) -> u64 {
        self.source.offset
    }

    /// The next frame; `None` at the end. After an error nothing more can be read, but
    /// everything returned before is intact.
    pub fn next_frame(&mut self) -> Result<Option<Frame<'_>>, InputError> {
        if self.over {
            return Ok(None);
        }
        let piece = self.advance().inspect_err(|_| self.over = true)?;
        Ok(piece.map(|piece| match piece {
            Piece::State => Frame::State {
                tick: self.tick,
                states: self.tracks.states(&self.values),
            },
            Piece::Events => Frame::Events(&self.events),
            Piece::Journal => Frame::Journal(&self.journal),
            Piece::Remarks => Frame::Remarks(&self.remarks),
            Piece::Waits => Frame::Waits(&self.waits),
            // There is one after this piece.
            Piece::End => self.summary.as_ref().map_or(Frame::Events(&[]), Frame::End),
        }))
    }

    fn advance(&mut self) -> Result<Option<Piece>, InputError> {
        if self.given < self.ticks {
            self.next_state();
            return Ok(Some(Piece::State));
        }
        if self.summary.is_some() {
            self.over = true;
            self.read_index()?;
            return Ok(None);
        }
        loop {
            let most_states = self.layout.tick_bytes().max(GROUP_BYTES);
            let frame = self.source.frame(|kind| match kind {
                kind::STATES => Some(GROUP_HEAD + compress_bound(most_states)),
                kind::EVENTS => Some(4 + compress_bound(EVENTS_PER_FRAME * EVENT_BYTES)),
                kind::JOURNAL | kind::REMARKS | kind::WAITS => {
                    Some(ROWS_HEAD + compress_bound(ROWS_BYTES))
                }
                kind::SUMMARY => Some(SUMMARY_BYTES),
                _ => None,
            })?;
            let read = match frame.kind {
                kind::STATES => self.read_states(&frame).map(|()| Piece::State),
                kind::EVENTS => self.read_events(&frame.payload).map(|()| Piece::Events),
                kind::JOURNAL => match self.read_journal(&frame.payload) {
                    Ok(true) => Ok(Piece::Journal),
                    Ok(false) => continue,
                    Err(reason) => Err(reason),
                },
                kind::WAITS => match self.read_waits(&frame.payload) {
                    Ok(true) => Ok(Piece::Waits),
                    Ok(false) => continue,
                    Err(reason) => Err(reason),
                },
                kind::REMARKS => self.read_remarks(&frame.payload).map(|()| Piece::Remarks),
                kind::SUMMARY => self.read_summary(&frame).map(|()| Piece::End),
                _ => continue,
            };
            let read = read.map_err(|reason| self.source.damaged(frame.start, reason))?;
            if matches!(read, Piece::State) {
                self.next_state();
            }
            return Ok(Some(read));
        }
    }

    /// Advances to the next states of the group.
    fn next_state(&mut self) {
        let tick = self.layout.numbers();
        let numbers = &self.numbers[self.given * tick..][..tick];
        self.tracks.decode(numbers, &mut self.values);
        self.given += 1;
        self.tick = self.next_tick;
        self.next_tick = self.tick.saturating_add(u64::from(self.header.state_every));
        if self.whole && self.header.state_every == 1 {
            self.states_digest.update(&self.tracks.states(&self.values));
        }
    }

    fn read_states(&mut self, frame: &RawFrame) -> Result<(), &'static str> {
        let parse = |fields: &mut Fields<'_>| Some((fields.u64()?, fields.u32()?, fields.u8()?));
        let mut fields = Fields(&frame.payload);
        let (tick, ticks, is_key) = parse(&mut fields).ok_or("a group of states is too short")?;
        let ticks = ticks as usize;
        let bytes = ticks.saturating_mul(self.layout.tick_bytes());
        if ticks == 0 || is_key > 1 || (ticks > 1 && bytes > GROUP_BYTES) {
            return Err("the size of a group of states makes no sense");
        }
        if tick != self.next_tick || self.header.state_every == 0 {
            return Err("a group of states has another tick than it should have");
        }
        let is_key = is_key == 1;
        self.has_leapt = self.values.is_empty() && !self.whole;
        if self.values.is_empty() {
            if !is_key {
                return Err("the first group of states needs one before it");
            }
            self.tracks = Tracks::new(self.layout);
            self.values = vec![0.0; self.layout.floats()];
        }
        if is_key {
            self.tracks.reset();
            self.index.note(tick, frame.start);
        }
        let planes = self.decompress(fields.0, bytes)?;
        from_planes(self.layout, &planes, &mut self.numbers);
        self.ticks = ticks;
        self.given = 0;
        Ok(())
    }

    fn read_events(&mut self, payload: &[u8]) -> Result<(), &'static str> {
        let mut fields = Fields(payload);
        let count = fields.u32().unwrap_or(0) as usize;
        if count == 0 || count > EVENTS_PER_FRAME {
            return Err("the number of events makes no sense");
        }
        let planes = self.decompress(fields.0, count * EVENT_BYTES)?;
        self.events.clear();
        for at in 0..count {
            let bytes = std::array::from_fn(|place| planes[place * count + at]);
            let event = parse_event(&bytes).ok_or("an event makes no sense")?;
            self.events.push(event);
        }
        if self.whole {
            self.events_digest.update(&self.events);
        }
        Ok(())
    }

    /// Reads journal entries; false if they repeat earlier ones and nothing was skipped.
    fn read_journal(&mut self, payload: &[u8]) -> Result<bool, &'static str> {
        let (entries, last) = self.read_ordered(payload, self.journal_tick)?;
        self.journal_tick = last;
        self.journal = entries;
        Ok(!self.journal.is_empty())
    }

    /// Reads changes of waits; false if they repeat earlier ones and nothing was skipped.
    fn read_waits(&mut self, payload: &[u8]) -> Result<bool, &'static str> {
        let (changes, last) = self.read_ordered(payload, self.waits_tick)?;
        self.waits_tick = last;
        self.waits = changes;
        Ok(!self.waits.is_empty())
    }

    /// Reads rows after one of the tick `last`, and returns the tick of the last one with them.
    /// There are none if they repeat earlier ones and nothing was skipped.
    fn read_ordered<T: Row>(
        &mut self,
        payload: &[u8],
        last: u64,
    ) -> Result<(Vec<T>, u64), &'static str> {
        let mut fields = Fields(payload);
        let is_recap = match fields.u8() {
            Some(flags @ (0 | 1)) => flags == 1,
            _ => return Err("the flags of entries make no sense"),
        };
        let rows: Vec<T> = self.read_rows(fields)?;
        match (is_recap, rows.first(), rows.last()) {
            (true, ..) if !self.has_leapt => Ok((Vec::new(), last)),
            (false, Some(first), _) if first.tick() < last => Err("entries are not in order"),
            (false, _, Some(end)) => {
                let end = end.tick();
                Ok((rows, end))
            }
            _ => Ok((rows, last)),
        }
    }

    fn read_remarks(&mut self, payload: &[u8]) -> Result<(), &'static str> {
        let mut fields = Fields(payload);
        if fields.u8() != Some(0) {
            return Err("the remarks make no sense");
        }
        self.remarks = self.read_rows(fields)?;
        Ok(())
    }

    fn read_rows<T: Row>(&mut self, mut fields: Fields<'_>) -> Result<Vec<T>, &'static str> {
        let [count, length] = [(); 2].map(|()| fields.u32().unwrap_or(0) as usize);
        if count == 0 || count > ROWS_PER_FRAME || length > ROWS_BYTES {
            return Err("the number of entries makes no sense");
        }
        let bytes = self.decompress(fields.0, length)?;
        unpack(count, &bytes, Limits::new(&self.header)).ok_or("an entry makes no sense")
    }

    /// Decompresses data of a known length.
    fn decompress(&mut self, bytes: &[u8], length: usize) -> Result<Vec<u8>, &'static str> {
        let decompressor = match &mut self.decompressor {
            Some(decompressor) => decompressor,
            none => {
                let made = Decompressor::new().map_err(|_| "the memory is not enough")?;
                none.insert(made)
            }
        };
        // The decompressor writes into this buffer and keeps no window of its own.
        let decompressed = decompressor.decompress(bytes, length);
        let decompressed = decompressed.map_err(|_| "something cannot be decompressed")?;
        if decompressed.len() == length {
            Ok(decompressed)
        } else {
            Err("something is shorter than it should be when it is decompressed")
        }
    }

    fn read_summary(&mut self, frame: &RawFrame) -> Result<(), &'static str> {
        let mut fields = Fields(&frame.payload);
        let parsed = Summary::parse(&mut fields);
        let (summary, file) = parsed
            .and_then(|summary| Some((summary, fields.u128()?)))
            .ok_or("the summary makes no sense")?;
        if !fields.0.is_empty() {
            return Err("the summary makes no sense");
        }
        if summary.digest(&self.header) != summary.trace_digest {
            return Err("header and summary do not match the trace digest");
        }
        if self.whole {
            if frame.hash_before_file_digest != file {
                return Err("the file does not match its digest: frames are missing or exchanged");
            }
            if self.events_digest.finish() != summary.events_digest {
                return Err("the events do not match their digest");
            }
            // Only all states have a digest.
            let states = || self.states_digest.finish();
            if self.header.state_every == 1 && states() != summary.states_digest {
                return Err("the states do not match their digest");
            }
        }
        self.summary = Some(summary);
        Ok(())
    }

    /// Reads and checks the rest after the summary.
    fn read_index(&mut self) -> Result<(), InputError> {
        let frame = self.source.frame(|kind| {
            (kind == kind::INDEX).then_some(super::INDEX_ENTRIES * super::INDEX_ENTRY_BYTES)
        })?;
        if self.whole && frame.payload != self.index.bytes() {
            let reason = "the index is not that of the file";
            return Err(self.source.damaged(frame.start, reason));
        }
        let start = self.source.offset;
        let trailer = self.source.take(TRAILER_BYTES)?;
        if trailer.len() < TRAILER_BYTES {
            return Err(self.source.truncated(start));
        }
        if trailer[..8] != frame.start.to_le_bytes() || trailer[8..] != END_MAGIC {
            return Err(self.source.damaged(start, "the end makes no sense"));
        }
        self.source.offset += TRAILER_BYTES as u64;
        if !self.source.take(1)?.is_empty() {
            let reason = "there is something after the end";
            return Err(self.source.damaged(self.source.offset, reason));
        }
        Ok(())
    }

    /// Reads the rest and sends its intact part to a sink. Only errors of the sink are
    /// errors; damage of the trace is in [`TraceContents::damage`].
    pub fn replay(mut self, sink: &mut dyn TraceSink) -> io::Result<TraceContents> {
        sink.begin(&self.header)?;
        let (mut states, mut last_tick, mut events) = (0, None, 0);
        let (mut entries, mut remarks, mut waits) = (0, 0, 0);
        let (mut end, mut damage) = (None, None);
        loop {
            match self.next_frame() {
                Ok(Some(Frame::State { tick, states: now })) => {
                    states += 1;
                    last_tick = Some(tick);
                    sink.state(tick, &now)?;
                }
                Ok(Some(Frame::Events(more))) => {
                    events += more.len() as u64;
                    sink.events(more)?;
                }
                Ok(Some(Frame::Journal(more))) => {
                    entries += more.len() as u64;
                    sink.journal(more)?;
                }
                Ok(Some(Frame::Remarks(more))) => {
                    remarks += more.len() as u64;
                    sink.remarks(more)?;
                }
                Ok(Some(Frame::Waits(more))) => {
                    waits += more.len() as u64;
                    sink.waits(more)?;
                }
                Ok(Some(Frame::End(summary))) => {
                    end = Some(summary.clone());
                    sink.end(summary)?;
                }
                Ok(None) => break,
                Err(error) => {
                    damage = Some(error);
                    break;
                }
            }
        }
        Ok(TraceContents {
            intact_bytes: self.source.offset,
            header: self.header,
            states,
            last_tick,
            events,
            entries,
            remarks,
            waits,
            end,
            damage,
        })
    }
}

impl<R: Read + Seek> TraceReader<R> {
    /// Seeks the last entry point at or before a tick: the next frame of
    /// [`TraceReader::next_frame`] has the states there, or the first states. Digests of
    /// the whole can no longer be checked.
    pub fn seek(&mut self, tick: u64) -> Result<(), InputError> {
        let (first, at) = self.place_of(tick)?;
        self.source.go_to(SeekFrom::Start(at))?;
        self.next_tick = first;
        // The first group then needs no earlier one.
        self.values.clear();
        (self.ticks, self.given) = (0, 0);
        (self.journal_tick, self.waits_tick) = (0, 0);
        self.summary = None;
        self.whole = false;
        self.over = false;
        Ok(())
    }

    /// First tick and offset of the entry point.
    fn place_of(&mut self, tick: u64) -> Result<(u64, u64), InputError> {
        self.source.go_to(SeekFrom::End(-(TRAILER_BYTES as i64)))?;
        let start = self.source.offset;
        let trailer = self.source.take(TRAILER_BYTES)?;
        let mut fields = Fields(&trailer);
        let at = fields.u64().filter(|_| fields.0 == END_MAGIC);
        let at = at.ok_or_else(|| {
            let error = self
                .source
                .damaged(start, "the end of the trace is missing");
            error.hint("without it there is no index; the trace can be read from its beginning")
        })?;
        self.source.go_to(SeekFrom::Start(at))?;
        let frame = self.source.frame(|kind| {
            (kind == kind::INDEX).then_some(super::INDEX_ENTRIES * super::INDEX_ENTRY_BYTES)
        })?;
        let index = Index::parse(&frame.payload)
            .ok_or_else(|| self.source.damaged(frame.start, "the index makes no sense"))?;
        let after = index.entries.partition_point(|(first, _)| *first <= tick);
        let entry = index.entries.get(after.saturating_sub(1)).copied();
        entry.ok_or_else(|| {
            InputError::new(self.source.name.as_str(), "the trace has no states")
                .hint("execute the plan again and record states")
        })
    }
}

/// A trace without its states and events, and the extent of its intact part.
#[derive(Debug, Clone, PartialEq)]
pub struct TraceContents {
    /// The header.
    pub header: Header,
    /// Number of states read.
    pub states: u64,
    /// The last tick with a state.
    pub last_tick: Option<u64>,
    /// Number of events read.
    pub events: u64,
    /// Number of journal entries read.
    pub entries: u64,
    /// Number of remarks read.
    pub remarks: u64,
    /// Number of changes of waits read.
    pub waits: u64,
    /// The summary, if it was reached.
    pub end: Option<Summary>,
    /// Bytes from the beginning that are intact.
    pub intact_bytes: u64,
    /// Reason for which the rest could not be read.
    pub damage: Option<InputError>,
}

/// Reads a whole trace and checks it. Fails only if the beginning cannot be read; later
/// damage is in [`TraceContents::damage`], beside the intact part.
pub fn read_trace(input: impl Read, name: impl Into<String>) -> Result<TraceContents, InputError> {
    let reader = TraceReader::open(input, name)?;
    let told = reader.replay(&mut NoTrace);
    told.map_err(|error| InputError::new("trace", error.to_string()))
}

/// A frame with a valid check.
struct RawFrame {
    /// Offset of the frame.
    start: u64,
    kind: u8,
    payload: Vec<u8>,
    /// Hash of the file up to the last 16 bytes of a summary.
    hash_before_file_digest: u128,
}

/// A file with its offset and the hash of the part read.
struct Source<R> {
    input: R,
    name: String,
    offset: u64,
    hash: Xxh3,
}

impl<R: Read> Source<R> {
    fn preamble(&mut self) -> Result<(), InputError> {
        let bytes = self.take(12)?;
        if bytes.is_empty() || !MAGIC.starts_with(&bytes[..bytes.len().min(8)]) {
            let reason = if bytes.is_empty() {
                "the file is empty"
            } else {
                "this is not a trace file"
            };
            return Err(InputError::new(self.name.as_str(), reason)
                .hint("traces are written by this program while it executes a plan"));
        }
        let mut fields = Fields(bytes.get(8..).unwrap_or_default());
        let Some(version) = fields.take().map(u16::from_le_bytes) else {
            return Err(self.truncated(bytes.len() as u64));
        };
        if version != VERSION {
            let reason = format!("the trace has version {version}, this program reads {VERSION}");
            let hint = if version > VERSION {
                "use a newer release to read it"
            } else {
                "execute the plan again with this release"
            };
            return Err(InputError::new(self.name.as_str(), reason).hint(hint));
        }
        match fields.take() {
            Some([0, 0]) => {}
            Some(_) => return Err(self.damaged(10, "the version makes no sense")),
            None => return Err(self.truncated(bytes.len() as u64)),
        }
        self.hash.update(&bytes);
        self.offset = bytes.len() as u64;
        Ok(())
    }

    /// Reads the next frame, of a kind for which `most` returns the largest payload, or
    /// of one that may be skipped.
    fn frame(&mut self, most: impl Fn(u8) -> Option<usize>) -> Result<RawFrame, InputError> {
        let start = self.offset;
        let head = self.take(FRAME_HEAD)?;
        let mut fields = Fields(&head);
        let (Some(kind), Some(length)) = (fields.u8(), fields.u32()) else {
            return Err(self.truncated(start));
        };
        let length = length as usize;
        let skipped = kind.is_ascii_lowercase().then_some(u32::MAX as usize);
        match most(kind).or(skipped) {
            None => {
                let reason = "there is no such kind of frame, or it has no place here";
                return Err(self.damaged(start, reason));
            }
            Some(most) if length > most => {
                return Err(self.damaged(start, "a frame is longer than it can be"));
            }
            Some(_) => {}
        }
        let payload = self.take(length)?;
        let check = self.take(FRAME_CHECK)?;
        if payload.len() < length || check.len() < FRAME_CHECK {
            return Err(self.truncated(start));
        }
        let mut hash = Xxh3::new();
        hash.update(&head);
        hash.update(&payload);
        if check != hash.digest().to_le_bytes() {
            return Err(self.damaged(start, "a frame does not match its check"));
        }
        self.hash.update(&head);
        let (fields, file) = payload.split_at(length.saturating_sub(16));
        self.hash.update(fields);
        let hash_before_file_digest = match kind {
            kind::SUMMARY => self.hash.digest128(),
            _ => 0,
        };
        self.hash.update(file);
        self.hash.update(&check);
        self.offset += length as u64 + (FRAME_HEAD + FRAME_CHECK) as u64;
        Ok(RawFrame {
            start,
            kind,
            payload,
            hash_before_file_digest,
        })
    }

    /// Reads this number of bytes, or fewer at the end of the input. Memory grows with
    /// the data and not with the length that a damaged file claims.
    fn take(&mut self, count: usize) -> Result<Vec<u8>, InputError> {
        let mut bytes = Vec::new();
        let read = (&mut self.input).take(count as u64).read_to_end(&mut bytes);
        read.map_err(|error| self.unreadable(&error))?;
        Ok(bytes)
    }

    fn unreadable(&self, error: &io::Error) -> InputError {
        let reason = format!("the trace could not be read: {error}");
        InputError::new(self.name.as_str(), reason)
    }

    fn truncated(&self, offset: u64) -> InputError {
        let reason = format!("the trace ends within the piece at byte {offset}");
        InputError::new(self.name.as_str(), reason).hint(
            "the execution was broken off or the file was cut; what precedes that byte is intact",
        )
    }

    fn damaged(&self, offset: u64, reason: &str) -> InputError {
        let reason = format!("damaged at byte {offset}: {reason}");
        InputError::new(self.name.as_str(), reason)
            .hint("what precedes that byte is intact; run the execution again to get the rest")
    }
}

impl<R: Read + Seek> Source<R> {
    fn go_to(&mut self, place: SeekFrom) -> Result<(), InputError> {
        let went = self.input.seek(place);
        self.offset = went.map_err(|error| self.unreadable(&error))?;
        Ok(())
    }
}
