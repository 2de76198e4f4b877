//! Recordings: traces of jobs and of files, of which a page gets what it shows.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use fleetyard_core::{InputError, load_annotations, open_regular};
use fleetyard_sim::trace::{Frame, TraceReader};
use fleetyard_view::{Clip, Layers, Overview, Recording, ViewError};
use serde::{Deserialize, Serialize};

use crate::answer::{Refused, Result};

/// The first bytes of a trace file.
const MAGIC: &[u8] = b"\x89FYT";
/// Samples per second where a page does not say it.
const USUAL_HZ: f64 = 10.0;
/// Most samples of a clip.
const MOST_SAMPLES: u64 = 20_000;
/// Most poses of a clip: of all bodies in all samples.
const MOST_POSES: u64 = 1 << 23;
/// Most recordings whose description is kept.
const KEPT: usize = 8;

/// A recording that was opened from a file.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct Opened {
    pub(crate) name: String,
    #[serde(skip)]
    pub(crate) path: PathBuf,
}

/// Recordings that were opened from files, and what was found in recordings.
#[derive(Debug, Default)]
pub(crate) struct Recordings {
    opened: Mutex<BTreeMap<u32, Opened>>,
    /// Descriptions by the numbers of recordings, the newest last.
    metas: Mutex<Vec<(u32, Arc<[u8]>)>>,
}

/// The window of a clip.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Window {
    from_s: f64,
    to_s: f64,
    /// Samples per second, at most.
    #[serde(default = "usual_hz")]
    rate: f64,
}

/// A window of time.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Span {
    pub(crate) from_s: f64,
    pub(crate) to_s: f64,
}

impl Span {
    /// The window, if it is one.
    pub(crate) fn checked(self) -> Result<Self> {
        let Self { from_s, to_s } = self;
        let within = |value: f64| (0.0..=1e9).contains(&value);
        if within(from_s) && within(to_s) && from_s <= to_s {
            return Ok(self);
        }
        Err(
            Refused::value(format!("a window from {from_s} s to {to_s} s"))
                .hint("give from_s and to_s in seconds, both at least 0"),
        )
    }
}

fn usual_hz() -> f64 {
    USUAL_HZ
}

/// True if a file begins as a trace does.
pub(crate) fn is_trace(bytes: &[u8]) -> bool {
    bytes.starts_with(MAGIC)
}

impl From<ViewError> for Refused {
    fn from(error: ViewError) -> Self {
        Self::value(error.reason).hint(error.hint)
    }
}

impl Recordings {
    fn opened(&self) -> MutexGuard<'_, BTreeMap<u32, Opened>> {
        self.opened.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn metas(&self) -> MutexGuard<'_, Vec<(u32, Arc<[u8]>)>> {
        self.metas.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes a trace file under a number, if it is one.
    pub(crate) fn open(
        &self,
        id: u32,
        name: &str,
        path: &Path,
    ) -> std::result::Result<(), InputError> {
        read(path)?;
        let opened = Opened {
            name: name.to_owned(),
            path: path.to_owned(),
        };
        self.opened().insert(id, opened);
        Ok(())
    }

    /// All that were opened.
    pub(crate) fn all(&self) -> Vec<(u32, Opened)> {
        let opened = self.opened();
        opened.iter().map(|(id, one)| (*id, one.clone())).collect()
    }

    /// The file of a recording that was opened.
    pub(crate) fn path(&self, id: u32) -> Option<PathBuf> {
        self.opened().get(&id).map(|opened| opened.path.clone())
    }

    /// Forgets what was found in a recording.
    pub(crate) fn forget(&self, id: u32) {
        self.metas().retain(|(known, _)| *known != id);
    }

    /// The description of a recording for the viewer, as JSON. A quick answer has no contacts, no arrivals
    /// and no work of a fleet, for which all of the file is read.
    pub(crate) fn meta(
        &self,
        id: u32,
        path: &Path,
        annotations: Option<&Path>,
        quick: bool,
    ) -> Result<Arc<[u8]>> {
        let known = self.metas().iter().find(|(known, _)| *known == id).cloned();
        if let Some((_, meta)) = known {
            return Ok(meta);
        }
        let reader = read(path)?;
        let title = path.file_name().unwrap_or_default().to_string_lossy();
        let mut overview = Overview::new(Recording::of_trace(title, reader.header()));
        if let Some(annotations) = annotations {
            overview = overview.layers(Layers::of(&load_annotations(annotations)?));
        }
        let incomplete = if quick {
            overview.ends_at(last_tick(reader)?);
            None
        } else {
            let contents = reader.replay(&mut overview);
            let contents = contents.map_err(|error| Refused::machine("the trace", error))?;
            contents.damage.map(|damage| damage.reason)
        };
        let meta = serde_json::to_vec(&overview.meta(incomplete.as_deref()));
        let meta =
            meta.map_err(|error| Refused::machine("the trace cannot be described", error))?;
        let meta: Arc<[u8]> = meta.into();
        if !quick {
            let mut metas = self.metas();
            metas.retain(|(known, _)| *known != id);
            metas.push((id, Arc::clone(&meta)));
            let surplus = metas.len().saturating_sub(KEPT);
            metas.drain(..surplus);
        }
        Ok(meta)
    }
}

pub(crate) type Reader = TraceReader<BufReader<File>>;

pub(crate) fn read(path: &Path) -> std::result::Result<Reader, InputError> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    TraceReader::open(BufReader::new(open_regular(path)?), name)
}

/// The last tick with states.
fn last_tick(mut reader: Reader) -> Result<u64> {
    reader.seek(u64::MAX)?;
    let mut last = 0;
    while let Some(frame) = reader.next_frame()? {
        if let Frame::State { tick, .. } = frame {
            last = tick;
        }
    }
    Ok(last)
}

/// The poses of all bodies in a window of time: from the last sample not after its beginning to the
/// first one not before its end. Samples are at multiples of their distance, whatever the window.
pub(crate) fn clip(path: &Path, window: Window) -> Result<Vec<u8>> {
    let Window { from_s, to_s, rate } = window;
    Span { from_s, to_s }.checked()?;
    if !(rate > 0.0 && rate <= 1e6) {
        return Err(Refused::value(format!("{rate} samples per second")));
    }
    let mut reader = read(path)?;
    let header = reader.header();
    let every = u64::from(header.state_every);
    if every == 0 {
        return Err(
            Refused::value("the trace has no states, only events").hint("record states, too")
        );
    }
    let ticks_hz = f64::from(header.ticks_hz);
    let recorded_hz = ticks_hz / every as f64;
    let stride = every * (recorded_hz / rate).round().max(1.0) as u64;
    let stride_s = stride as f64 / ticks_hz;
    let first = (from_s / stride_s).floor() as u64;
    let last = (to_s / stride_s).ceil() as u64;
    let samples = last - first + 1;
    let bodies = header.bodies() as u64;
    if samples > MOST_SAMPLES || samples.saturating_mul(bodies) > MOST_POSES {
        let reason = format!("{samples} samples of {bodies} bodies are too many");
        return Err(Refused::value(reason).hint(format!(
            "a clip has {MOST_SAMPLES} samples and {MOST_POSES} poses at most: ask for less time or a lower rate"
        )));
    }
    let recording = Recording::of_trace("", header);
    let mut clip = Clip::new(&recording, first as f64 * stride_s, stride_s);
    let (begin, end) = (first * stride, last * stride);
    // Where the end of the file is missing there is no index; it is read from its beginning then.
    if reader.seek(begin).is_err() {
        reader = read(path)?;
    }
    while let Ok(Some(frame)) = reader.next_frame() {
        let Frame::State { tick, states } = frame else {
            continue;
        };
        if tick > end {
            break;
        }
        if tick >= begin && tick.is_multiple_of(stride) {
            clip.push(&states)?;
            if tick == end {
                break;
            }
        }
    }
    Ok(clip.finish())
}
