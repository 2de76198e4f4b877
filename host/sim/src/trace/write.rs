//! Writing of trace files.

use std::io::{self, Write};

use xxhash_rust::xxh3::{Xxh3, xxh3_64};
use zstd::bulk::Compressor;

use super::delta::{Layout, Tracks, to_planes};
use super::journal::{Limits, ROWS_PER_FRAME, Row, pack};
use super::{
    END_MAGIC, EVENT_BYTES, EVENTS_PER_FRAME, Entry, FRAME_HEAD, GROUP_BYTES, Header, Index, MAGIC,
    Remark, SUMMARY_BYTES, Standing, States, Summary, TraceSink, VERSION, Waiting, Waits,
    event_bytes, kind,
};
use crate::event::Event;

/// Options of the writer. None of them changes the data that is read back.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TraceOptions {
    /// Ticks between recorded states; 1 is every tick, 0 is none.
    pub every: u32,
    /// Level of compression, from 1 (fast) to 19 (small).
    pub level: i32,
    /// Number of recorded states between two entry points.
    pub key_every: u32,
    /// Number of recorded states that are compressed together, unless they exceed the
    /// limit of a group.
    pub group: u32,
}

impl Default for TraceOptions {
    fn default() -> Self {
        Self {
            every: 1,
            level: 1,
            key_every: 600,
            group: 60,
        }
    }
}

/// Rows in the order of their ticks that are not written yet, and the tick of the last one so far.
#[derive(Debug)]
struct Ordered<T> {
    rows: Vec<T>,
    tick: u64,
}

impl<T> Default for Ordered<T> {
    fn default() -> Self {
        Self {
            rows: Vec::new(),
            tick: 0,
        }
    }
}

/// Writes a trace file while the execution runs. Give it a buffered writer; it holds one
/// group of states and the predictors' state, whatever the length of the execution.
pub struct TraceWriter<W> {
    out: W,
    options: TraceOptions,
    compressor: Option<Compressor<'static>>,
    /// Bytes written so far, and their hash.
    offset: u64,
    hash: Xxh3,
    index: Index,
    layout: Layout,
    tracks: Tracks,
    headings: bool,
    progress: bool,
    /// The group not yet written.
    first_tick: u64,
    ticks: u32,
    /// Most ticks of a group.
    most_ticks: u32,
    is_key: bool,
    numbers: Vec<u64>,
    /// Recorded states since the last entry point.
    since_key: u32,
    /// Data that follows the group.
    events: Vec<Event>,
    journal: Ordered<Entry>,
    remarks: Vec<Remark>,
    waits: Ordered<Waiting>,
    /// Journal entries that were open before the group, and agents that waited.
    standing: Standing,
    standing_waits: Waits,
    limits: Limits,
    frame: Vec<u8>,
    planes: Vec<u8>,
}

impl<W: Write> TraceWriter<W> {
    /// Records events only.
    pub fn events_only(out: W) -> Self {
        Self::new(out, 0)
    }

    /// Records events and the state at every `every`-th tick; 1 is every tick
    /// and 0 is none.
    pub fn new(out: W, every: u32) -> Self {
        let options = TraceOptions {
            every,
            ..TraceOptions::default()
        };
        Self::with_options(out, options)
    }

    /// A writer with all options.
    pub fn with_options(out: W, options: TraceOptions) -> Self {
        Self {
            out,
            options,
            compressor: None,
            offset: 0,
            hash: Xxh3::new(),
            index: Index::default(),
            layout: Layout::default(),
            tracks: Tracks::default(),
            headings: false,
            progress: false,
            first_tick: 0,
            ticks: 0,
            most_ticks: 1,
            is_key: false,
            numbers: Vec::new(),
            since_key: 0,
            events: Vec::new(),
            journal: Ordered::default(),
            remarks: Vec::new(),
            waits: Ordered::default(),
            standing: Standing::default(),
            standing_waits: Waits::default(),
            limits: Limits::default(),
            frame: Vec::new(),
            planes: Vec::new(),
        }
    }

    /// The writer, once the execution has ended.
    pub fn into_inner(self) -> W {
        self.out
    }

    fn put(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.hash.update(bytes);
        self.offset += bytes.len() as u64;
        self.out.write_all(bytes)
    }

    /// Starts a frame in the buffer.
    fn open_frame(&mut self, kind: u8) {
        self.frame.clear();
        self.frame.push(kind);
        self.frame.extend([0; 4]);
    }

    /// Adds compressed bytes to the frame.
    fn compress(&mut self, bytes: &[u8]) -> io::Result<()> {
        let compressor = match &mut self.compressor {
            Some(compressor) => compressor,
            none => none.insert(Compressor::new(self.options.level)?),
        };
        let start = self.frame.len();
        let most = zstd::zstd_safe::compress_bound(bytes.len());
        self.frame.resize(start + most, 0);
        let length = compressor.compress_to_buffer(bytes, &mut self.frame[start..])?;
        self.frame.truncate(start + length);
        Ok(())
    }

    fn close_frame(&mut self) -> io::Result<()> {
        let mut frame = std::mem::take(&mut self.frame);
        let length = u32::try_from(frame.len() - FRAME_HEAD)
            .map_err(|_| io::Error::other("the trace needs a frame of more than 4 GiB"))?;
        frame[1..FRAME_HEAD].copy_from_slice(&length.to_le_bytes());
        let check = xxh3_64(&frame);
        self.put(&frame)?;
        self.put(&check.to_le_bytes())?;
        self.frame = frame;
        Ok(())
    }

    fn put_frame(&mut self, kind: u8, payload: &[u8]) -> io::Result<()> {
        self.open_frame(kind);
        self.frame.extend(payload);
        self.close_frame()
    }

    /// Writes the group of states, and after an entry point the journal entries that were
    /// open before it.
    fn put_states(&mut self) -> io::Result<()> {
        if self.ticks == 0 {
            return Ok(());
        }
        if self.is_key {
            self.index.note(self.first_tick, self.offset);
        }
        let mut planes = std::mem::take(&mut self.planes);
        to_planes(self.layout, &self.numbers, &mut planes);
        self.open_frame(kind::STATES);
        self.frame.extend(self.first_tick.to_le_bytes());
        self.frame.extend(self.ticks.to_le_bytes());
        self.frame.push(u8::from(self.is_key));
        self.compress(&planes)?;
        self.planes = planes;
        self.ticks = 0;
        self.numbers.clear();
        self.close_frame()?;
        if self.is_key {
            let recap = self.standing.recap();
            self.put_rows(kind::JOURNAL, 1, &recap)?;
            let recap = self.standing_waits.recap();
            self.put_rows(kind::WAITS, 1, &recap)?;
        }
        Ok(())
    }

    fn put_rows<T: Row>(&mut self, kind: u8, flags: u8, rows: &[T]) -> io::Result<()> {
        for (count, bytes) in pack(rows) {
            self.open_frame(kind);
            self.frame.push(flags);
            self.frame.extend(count.to_le_bytes());
            self.frame.extend((bytes.len() as u32).to_le_bytes());
            self.compress(&bytes)?;
            self.close_frame()?;
        }
        Ok(())
    }

    /// Adds rows to those that are written after the group, or refuses them for a fault.
    fn add_rows<T: Row + Clone>(
        &mut self,
        rows: &[T],
        of: fn(&mut Self) -> &mut Ordered<T>,
        fault: &'static str,
    ) -> io::Result<()> {
        let last = of(self).tick;
        if !are_right(rows, last, self.limits) {
            return Err(io::Error::new(io::ErrorKind::InvalidInput, fault));
        }
        of(self).tick = rows.last().map_or(last, Row::tick);
        for chunk in rows.chunks(ROWS_PER_FRAME) {
            if of(self).rows.len() + chunk.len() > ROWS_PER_FRAME {
                self.put_pending()?;
            }
            of(self).rows.extend_from_slice(chunk);
        }
        Ok(())
    }

    fn put_events(&mut self, events: &[Event]) -> io::Result<()> {
        let mut planes = vec![0; events.len() * EVENT_BYTES];
        for (at, event) in events.iter().enumerate() {
            for (place, byte) in event_bytes(event).into_iter().enumerate() {
                planes[place * events.len() + at] = byte;
            }
        }
        self.open_frame(kind::EVENTS);
        self.frame.extend((events.len() as u32).to_le_bytes());
        self.compress(&planes)?;
        self.close_frame()
    }

    /// Writes the pending data: the group of states, then the events of its time.
    fn put_pending(&mut self) -> io::Result<()> {
        self.put_states()?;
        let journal = std::mem::take(&mut self.journal.rows);
        self.put_rows(kind::JOURNAL, 0, &journal)?;
        for entry in &journal {
            self.standing.note(entry);
        }
        let waits = std::mem::take(&mut self.waits.rows);
        self.put_rows(kind::WAITS, 0, &waits)?;
        for change in &waits {
            self.standing_waits.note(change);
        }
        let remarks = std::mem::take(&mut self.remarks);
        self.put_rows(kind::REMARKS, 0, &remarks)?;
        let events = std::mem::take(&mut self.events);
        for chunk in events.chunks(EVENTS_PER_FRAME) {
            self.put_events(chunk)?;
        }
        self.events = events;
        self.events.clear();
        Ok(())
    }
}

/// True if rows are valid, and in order after a row of the tick `last`.
fn are_right<T: Row>(rows: &[T], last: u64, limits: Limits) -> bool {
    let ticks = rows.iter().map(Row::tick);
    std::iter::once(last).chain(ticks).is_sorted() && rows.iter().all(|row| row.fits(limits))
}

impl<W: Write + Send> TraceSink for TraceWriter<W> {
    fn wants_state(&self, tick: u64) -> bool {
        self.options.every > 0 && tick.is_multiple_of(u64::from(self.options.every))
    }

    fn begin(&mut self, header: &Header) -> io::Result<()> {
        let header = Header {
            state_every: self.options.every,
            ..header.clone()
        };
        if let Some(fault) = header.fault().or_else(|| header.scene_fault()) {
            return Err(io::Error::new(io::ErrorKind::InvalidInput, fault));
        }
        self.put(&MAGIC)?;
        self.put(&u32::from(VERSION).to_le_bytes())?;
        self.put_frame(kind::HEADER, &serde_json::to_vec(&header)?)?;
        let scene = &header.scene;
        if let Some(cells) = &scene.cells {
            self.put_frame(kind::CELLS, &cells.bytes())?;
        }
        for (kind, cells) in [
            (kind::ENDPOINTS, &scene.endpoints),
            (kind::WORKSTATIONS, &scene.workstations),
        ] {
            if let Some(cells) = cells {
                self.put_frame(kind, &cells.bytes())?;
            }
        }
        if !scene.polygons_m.is_empty() {
            self.put_frame(kind::POLYGONS, &scene.polygon_bytes())?;
        }
        let bytes = |points: &[[f64; 2]]| -> Vec<u8> {
            points
                .as_flattened()
                .iter()
                .flat_map(|value| value.to_le_bytes())
                .collect()
        };
        if !scene.outline_m.is_empty() {
            self.put_frame(kind::OUTLINE, &bytes(&scene.outline_m))?;
        }
        if !scene.roadmap_m.is_empty() {
            self.put_frame(kind::ROADMAP, &bytes(scene.roadmap_m.as_flattened()))?;
        }
        self.put_frame(kind::BODIES, &scene.body_bytes())?;
        self.limits = Limits::new(&header);
        self.standing = Standing::new(header.agents);
        self.headings = header.headings;
        self.progress = header.progress;
        self.layout = Layout::new(&header);
        let ticks = (GROUP_BYTES / self.layout.tick_bytes()) as u32;
        self.most_ticks = ticks.min(self.options.group).max(1);
        if self.options.every > 0 {
            self.tracks = Tracks::new(self.layout);
        }
        Ok(())
    }

    fn state(&mut self, tick: u64, states: &States<'_>) -> io::Result<()> {
        if !self.wants_state(tick) {
            return Ok(());
        }
        let bodies = self.layout.bodies;
        let fits = states.x_m.len() == bodies
            && states.y_m.len() == bodies
            && states.heading_rad.map(<[f64]>::len) == self.headings.then_some(bodies)
            && states.progress.map(<[u32]>::len) == self.progress.then_some(bodies);
        if !fits {
            let reason = "the states are not as the header says";
            return Err(io::Error::new(io::ErrorKind::InvalidInput, reason));
        }
        if self.ticks >= self.most_ticks {
            self.put_pending()?;
        }
        if self.ticks == 0 {
            self.first_tick = tick;
            self.is_key = self.since_key >= self.options.key_every || tick == 0;
            if self.is_key {
                self.tracks.reset();
                self.since_key = 0;
            }
        }
        self.tracks.encode(states, &mut self.numbers);
        self.ticks += 1;
        self.since_key += 1;
        Ok(())
    }

    fn events(&mut self, events: &[Event]) -> io::Result<()> {
        for chunk in events.chunks(EVENTS_PER_FRAME) {
            if self.events.len() + chunk.len() > EVENTS_PER_FRAME {
                self.put_pending()?;
            }
            self.events.extend(chunk);
        }
        Ok(())
    }

    fn journal(&mut self, entries: &[Entry]) -> io::Result<()> {
        let fault = "an entry of the journal is not as the header says, or not in order";
        self.add_rows(entries, |writer| &mut writer.journal, fault)
    }

    fn waits(&mut self, changes: &[Waiting]) -> io::Result<()> {
        let fault = "a wait is not as the header says, or not in order";
        self.add_rows(changes, |writer| &mut writer.waits, fault)
    }

    fn remarks(&mut self, remarks: &[Remark]) -> io::Result<()> {
        if !remarks.iter().all(|remark| remark.fits(self.limits)) {
            let reason = "a remark has a text that is too long, or a time that is none";
            return Err(io::Error::new(io::ErrorKind::InvalidInput, reason));
        }
        for remark in remarks {
            if self.remarks.len() == ROWS_PER_FRAME {
                self.put_pending()?;
            }
            self.remarks.push(remark.clone());
        }
        Ok(())
    }

    fn end(&mut self, summary: &Summary) -> io::Result<()> {
        self.put_pending()?;
        self.open_frame(kind::SUMMARY);
        self.frame.extend(summary.figures());
        self.frame.extend(summary.trace_digest.0.to_le_bytes());
        // The head of the frame and its fields so far are part of the file's hash.
        self.frame[1..FRAME_HEAD].copy_from_slice(&(SUMMARY_BYTES as u32).to_le_bytes());
        let mut hash = self.hash.clone();
        hash.update(&self.frame);
        self.frame.extend(hash.digest128().to_le_bytes());
        self.close_frame()?;
        let at = self.offset;
        let index = self.index.bytes();
        self.put_frame(kind::INDEX, &index)?;
        self.put(&at.to_le_bytes())?;
        self.put(&END_MAGIC)?;
        self.out.flush()
    }
}
