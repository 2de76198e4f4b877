//! Trace files.

use std::io::Cursor;

use fleetyard_sim::TraceWriter;
use fleetyard_sim::trace::{Frame, Standing, TraceContents, TraceReader, Waits, read_trace};
use xxhash_rust::xxh3::{Xxh3, xxh3_64};

use super::check_error;

const SOURCE: &str = "a.fyt";

/// Reads a trace as it is, and once more with checks that are right: without them next
/// to nothing behind them would be reached.
pub fn run(data: &[u8]) {
    read(data);
    read(&with_right_checks(data));
}

fn read(data: &[u8]) {
    let reader = match TraceReader::open(data, SOURCE) {
        Ok(reader) => reader,
        Err(error) => return check_error(&error, SOURCE, data),
    };
    let mut writer = TraceWriter::new(Vec::new(), reader.header().state_every);
    let contents = reader
        .replay(&mut writer)
        .expect("what is read can be written");
    assert!(contents.intact_bytes <= data.len() as u64);
    assert!(contents.header.bodies() * 20 <= data.len());
    if let Some(damage) = &contents.damage {
        return check_error(damage, SOURCE, data);
    }
    assert_eq!(contents.intact_bytes, data.len() as u64);
    let bytes = writer.into_inner();
    let again = read_trace(&bytes[..], SOURCE).expect("a trace");
    if contents.entries + contents.waits > 0 && contents.states > 0 {
        let all = standing(&bytes, None);
        let last = contents.last_tick.unwrap_or(0);
        for tick in [0, last / 2, last] {
            let part = standing(&bytes, Some(tick));
            assert_eq!(part, all, "a leap to {tick} loses what is open");
        }
    }
    let place = |contents: TraceContents| TraceContents {
        intact_bytes: 0,
        ..contents
    };
    assert_eq!(place(again), place(contents));
}

/// The open entries at the end of a journal that is read from a tick on, or as a whole, and who waits then.
fn standing(bytes: &[u8], from: Option<u64>) -> (Standing, Waits) {
    let mut reader = TraceReader::open(Cursor::new(bytes), SOURCE).expect("a trace");
    let mut standing = Standing::new(reader.header().agents);
    let mut waits = Waits::default();
    if let Some(tick) = from {
        reader.seek(tick).expect("there is an index");
    }
    while let Some(frame) = reader.next_frame().expect("it was read before") {
        match frame {
            Frame::Journal(entries) => entries.iter().for_each(|entry| standing.note(entry)),
            Frame::Waits(changes) => changes.iter().for_each(|change| waits.note(change)),
            _ => {}
        }
    }
    (standing, waits)
}

/// The bytes with the checks of all frames as they should be, and the digest of the file.
fn with_right_checks(data: &[u8]) -> Vec<u8> {
    let mut bytes = data.to_vec();
    let mut at = 12;
    let mut file = Xxh3::new();
    file.update(&bytes[..bytes.len().min(at)]);
    while let Some(head) = bytes.get(at..at + 5) {
        let length = u32::from_le_bytes([head[1], head[2], head[3], head[4]]) as usize;
        let end = at + 5 + length;
        if bytes.len() < end + 8 {
            break;
        }
        if head[0] == b'Z' && length >= 16 {
            file.update(&bytes[at..end - 16]);
            bytes[end - 16..end].copy_from_slice(&file.digest128().to_le_bytes());
        }
        let check = xxh3_64(&bytes[at..end]).to_le_bytes();
        bytes[end..end + 8].copy_from_slice(&check);
        file.update(&bytes[at..end + 8]);
        at = end + 8;
    }
    bytes
}
