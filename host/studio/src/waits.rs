//! The waits of robots for each other in a window of a recording, as the simulator's dependency graph
//! had them when it let robots go on.

use std::path::Path;

use fleetyard_sim::trace::{Frame, Header, Waiting, Waits};
use serde_json::{Value, json};

use crate::answer::{Refused, Result};
use crate::recordings::{Span, read};

/// Most changes in an answer.
const MOST_CHANGES: usize = 200_000;

/// The changes of waits in a window: first those that hold when it begins, each since the time at
/// which it began, then those within it. Without `changes` there is the reason in `why`.
pub(crate) fn waits(path: &Path, span: Span) -> Result<Value> {
    let Span { from_s, to_s } = span.checked()?;
    let mut reader = read(path)?;
    if let Some(why) = why_unknown(reader.header()) {
        return Ok(json!({"why": why}));
    }
    let header = reader.header().clone();
    let ticks_hz = f64::from(header.ticks_hz);
    let begin = (from_s * ticks_hz).floor() as u64;
    let end = (to_s * ticks_hz).ceil() as u64;
    // Where the end of the file is missing there is no index; it is read from its beginning then.
    if reader.seek(begin).is_err() {
        reader = read(path)?;
    }
    let mut standing = Waits::default();
    let mut within: Vec<Waiting> = Vec::new();
    loop {
        let is_past = match reader.next_frame() {
            Ok(Some(Frame::Waits(changes))) => {
                for change in changes {
                    if change.tick <= begin {
                        standing.note(change);
                    } else if change.tick <= end {
                        within.push(*change);
                    }
                }
                false
            }
            Ok(Some(Frame::State { tick, .. })) => tick > end,
            Ok(Some(_)) => false,
            Ok(None) | Err(_) => break,
        };
        if within.len() > MOST_CHANGES {
            let reason = format!("there are more than {MOST_CHANGES} changes of waits");
            return Err(Refused::value(reason).hint("ask for less time"));
        }
        if is_past && reader.begins_group() {
            break;
        }
    }
    let told = |change: &Waiting| {
        json!([
            header.time_s(change.tick),
            change.agent,
            change.awaited.brief()
        ])
    };
    let changes: Vec<Value> = standing.iter().chain(&within).map(told).collect();
    Ok(json!({"changes": changes}))
}

/// The reason for which a recording does not have the waits, if it does not.
fn why_unknown(header: &Header) -> Option<&'static str> {
    if header.waits {
        None
    } else if header.policy == "time" {
        Some("its robots go by the times of the plan, so that nobody waits for anybody")
    } else {
        Some(
            "the recording does not say it: its robots go step by step together, or it was made by an earlier release",
        )
    }
}
