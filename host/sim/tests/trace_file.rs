//! Trace files: what is written is read; damage is found, named and confined.

mod common;

use fleetyard_core::{Grid, GridPlan};
use fleetyard_sim::trace::{Frame, Header, Summary, read_trace};
use fleetyard_sim::{
    Event, Execution, NoTrace, Outcome, SimConfig, SimError, TraceReader, TraceSink, TraceWriter,
};
use std::io;

fn world() -> (Grid, GridPlan) {
    let mut rng = common::rng(7);
    let grid = common::random_grid(&mut rng, 8, 8, 15);
    let plan = common::wild_walks(&mut rng, &grid, 8, 4, true, 10);
    (grid, plan)
}

fn config() -> SimConfig {
    SimConfig {
        ticks_hz: 10,
        ..SimConfig::default()
    }
}

fn written(every: u32) -> (Vec<u8>, Outcome) {
    let (grid, plan) = world();
    let mut writer = TraceWriter::new(Vec::new(), every);
    let outcome = Execution::run(&grid, &plan, &config(), &mut writer).expect("can be executed");
    (writer.into_inner(), outcome)
}

/// Keeps all that it is told.
#[derive(Default)]
struct Memory {
    states: Vec<(u64, Vec<f64>, Vec<f64>)>,
    events: Vec<Event>,
}

impl TraceSink for Memory {
    fn begin(&mut self, _: &Header) -> io::Result<()> {
        Ok(())
    }
    fn state(&mut self, tick: u64, x_m: &[f64], y_m: &[f64]) -> io::Result<()> {
        self.states.push((tick, x_m.to_vec(), y_m.to_vec()));
        Ok(())
    }
    fn events(&mut self, events: &[Event]) -> io::Result<()> {
        self.events.extend(events);
        Ok(())
    }
    fn end(&mut self, _: &Summary) -> io::Result<()> {
        Ok(())
    }
}

#[test]
fn what_is_written_is_read() {
    let (grid, plan) = world();
    let mut memory = Memory::default();
    let outcome = Execution::run(&grid, &plan, &config(), &mut memory).unwrap();
    assert_eq!(memory.states.len() as u64, outcome.ticks + 1);
    assert!(!memory.events.is_empty());
    let order = |e: &Event| (e.substep, e.agent);
    assert!(memory.events.is_sorted_by_key(order));

    for every in [0, 1, 7] {
        let (bytes, with_trace) = written(every);
        assert_eq!(with_trace, outcome, "a trace changes nothing");
        let mut reader = TraceReader::open(&bytes[..], "memory").unwrap();
        assert_eq!(reader.header().grid, grid.digest());
        assert_eq!(reader.header().plan, plan.digest());
        assert_eq!(reader.header().ticks, outcome.ticks);
        let (mut states, mut events, mut end) = (Vec::new(), Vec::new(), None);
        while let Some(frame) = reader.next_frame().unwrap() {
            match frame {
                Frame::State { tick, x_m, y_m } => states.push((tick, x_m, y_m)),
                Frame::Events(more) => events.extend(more),
                Frame::End(summary) => end = Some(summary),
            }
        }
        let wanted: Vec<_> = memory
            .states
            .iter()
            .filter(|(tick, ..)| every > 0 && tick % u64::from(every) == 0)
            .cloned()
            .collect();
        assert_eq!(states, wanted);
        assert_eq!(events, memory.events);
        assert_eq!(end.unwrap().trace_digest, outcome.trace_digest);
    }
}

#[test]
fn a_cut_file_gives_what_is_left() {
    let (bytes, _) = written(5);
    let whole = read_trace(&bytes[..], "t").unwrap();
    assert!(whole.damage.is_none() && whole.end.is_some());
    let mut least = 0;
    for length in 0..bytes.len() {
        match read_trace(&bytes[..length], "t") {
            Ok(part) => {
                let damage = part.damage.expect("a cut is damage");
                assert!(damage.reason.contains("ends within"), "{damage}");
                assert!(damage.hint.is_some());
                assert!(part.end.is_none());
                assert!(whole.events.starts_with(&part.events));
                let got = part.states + part.events.len() as u64;
                assert!(got >= least, "more bytes, less content");
                least = got;
            }
            Err(error) => {
                assert!(length < 128, "only the preamble is indispensable");
                assert!(error.hint.is_some(), "{error}");
            }
        }
    }
    assert_eq!(least, whole.states + whole.events.len() as u64);
}

#[test]
fn every_damaged_byte_is_found() {
    for every in [0, 9] {
        let (bytes, _) = written(every);
        let whole = read_trace(&bytes[..], "t").unwrap();
        for at in 0..bytes.len() {
            let mut bad = bytes.clone();
            bad[at] ^= 1 << (at % 8);
            match read_trace(&bad[..], "t") {
                Ok(part) => {
                    assert!(part.damage.is_some(), "byte {at} went unnoticed");
                    assert!(part.end.is_none());
                    assert!(whole.events.starts_with(&part.events));
                }
                Err(error) => assert!(at < 128 && error.hint.is_some(), "{error}"),
            }
        }
    }
}

#[test]
fn exchanged_frames_and_trailing_bytes_are_found() {
    let (bytes, _) = written(0);
    let mut longer = bytes.clone();
    longer.push(0);
    let damage = read_trace(&longer[..], "t").unwrap().damage.unwrap();
    assert!(damage.reason.contains("after the end"), "{damage}");
    // Leave out the first frame: every frame is fine, the file is not.
    let length = u32::from_le_bytes(bytes[129..133].try_into().unwrap()) as usize;
    let mut shorter = bytes[..128].to_vec();
    shorter.extend(&bytes[128 + 13 + length..]);
    let damage = read_trace(&shorter[..], "t").unwrap().damage.unwrap();
    assert!(damage.reason.contains("missing or exchanged"), "{damage}");
}

#[test]
fn newer_versions_and_other_files_are_named() {
    let (mut bytes, _) = written(0);
    bytes[8] = 2;
    let error = read_trace(&bytes[..], "t").unwrap_err();
    assert!(error.to_string().contains("version 2"), "{error}");
    for other in [
        &b""[..],
        b"type octile\nheight 4\n",
        b"\x89PNG\r\n\x1a\n........",
    ] {
        assert!(read_trace(other, "t").unwrap_err().hint.is_some());
    }
}

/// A disk that fills up.
struct Full(usize);

impl io::Write for Full {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if bytes.len() > self.0 {
            return Err(io::Error::from(io::ErrorKind::StorageFull));
        }
        self.0 -= bytes.len();
        Ok(bytes.len())
    }
    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[test]
fn a_full_disk_is_an_error() {
    let (grid, plan) = world();
    let length = written(1).0.len();
    for room in [0, 100, length / 2, length - 1] {
        let mut writer = TraceWriter::new(Full(room), 1);
        let error = Execution::run(&grid, &plan, &config(), &mut writer).unwrap_err();
        assert!(matches!(error, SimError::Trace(_)));
    }
    let mut writer = TraceWriter::new(Full(length), 1);
    assert!(Execution::run(&grid, &plan, &config(), &mut writer).is_ok());
    assert!(Execution::run(&grid, &plan, &config(), &mut NoTrace).is_ok());
}
