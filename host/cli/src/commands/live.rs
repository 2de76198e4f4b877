//! `fleetyard fleet --live`: a fleet that hears commands while it drives, and shows where it is.
//!
//! Commands are lines of JSON on standard input, what happens is lines of JSON on standard output.
//! Interventions go into the recording of the fleet; how fast it goes does not matter to what happens.

use std::collections::{BTreeMap, VecDeque};
use std::io::{self, BufRead, BufWriter, Read as _};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use fleetyard_fleet::{Intervened, Intervention, Notice, Point};
use fleetyard_sim::trace::{Entry, Happening, Header, Remark, States, Summary, Waiting};
use fleetyard_sim::{Event, TraceSink, TraceWriter};
use fleetyard_view::{Clip, Meta, Overview, Recording, base64};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::fleet::interrupted;
use crate::exit::{Result, internal};
use crate::files::Unnamed;
use crate::output;

/// Longest line that is heard, in bytes.
const LINE_BYTES: u64 = 1 << 16;
/// Most interventions that wait for the next block.
const WAITING: usize = 10_000;
/// Samples of a clip per simulated second, and the least time between two clips.
const SAMPLES_HZ: f64 = 10.0;
const PAUSE: Duration = Duration::from_millis(50);
/// Most samples of a clip: a reader that wants them all reads the trace.
const SAMPLES: u32 = 64;
/// Speeds, in simulated seconds per second.
const SPEEDS: std::ops::RangeInclusive<f64> = 1e-3..=1e6;
/// Between two looks for an interrupt.
const LOOK: Duration = Duration::from_millis(100);

/// A line of standard input that is about the run. Others are interventions.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Pace {
    /// Stands still, or goes on.
    Pause(bool),
    /// So many blocks while it stands still.
    Step(u32),
    /// Simulated seconds per second; 0 for as many as can be.
    Speed(f64),
    /// Ends the run with what it has.
    Stop(bool),
}

/// A line of standard output.
#[derive(Serialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Line<'a> {
    Clip(String),
    Doing(Doing),
    Point(&'a Point),
    /// The world and the robots, before the first clip.
    Meta(Box<Meta<'a>>),
    Intervened {
        at_s: f64,
        #[serde(flatten)]
        what: &'a Intervened,
    },
    Doubt(&'a Notice),
    Refused {
        what: String,
        reason: &'a str,
    },
}

/// Prints a line. A reader that went away is no reason to end the run.
pub(super) fn say(line: &Line<'_>) {
    let _ = output::print_json_line(line);
}

/// Goals and waits of robots, as far as they are others than before.
#[derive(Default, Serialize)]
pub(super) struct Doing {
    at_s: f64,
    /// By robot the cell of its goal, if it has one.
    goals: BTreeMap<u32, Option<u32>>,
    /// By robot the number of the one that it waits for, `message`, or nothing.
    waits: BTreeMap<u32, Value>,
}

#[derive(Debug, Default)]
struct Control {
    paused: bool,
    steps: u32,
    /// As fast as can be without one.
    speed: Option<f64>,
    stop: bool,
    waiting: VecDeque<Intervention>,
}

/// The fault of a line that is neither of two things: of the one that it meant to be, if that is known.
fn of_two(one: &serde_json::Error, other: &serde_json::Error) -> String {
    let faults = [one.to_string(), other.to_string()];
    let is_meant = |fault: &&String| !fault.starts_with("unknown variant");
    let meant = faults.iter().find(is_meant);
    meant.cloned().unwrap_or_else(|| faults.join(", or "))
}

/// The wishes of commands.
#[derive(Debug, Default)]
struct Ear {
    control: Mutex<Control>,
    heard: Condvar,
}

impl Ear {
    fn control(&self) -> MutexGuard<'_, Control> {
        self.control.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Hears a line, or says why it makes no sense.
    fn hear(&self, line: &str) -> std::result::Result<(), String> {
        let value: Value = serde_json::from_str(line).map_err(|error| error.to_string())?;
        let mut control = self.control();
        match Pace::deserialize(&value) {
            Ok(Pace::Pause(paused)) => {
                control.paused = paused;
                control.steps = 0;
            }
            Ok(Pace::Step(steps)) => control.steps = control.steps.saturating_add(steps),
            Ok(Pace::Speed(0.0)) => control.speed = None,
            Ok(Pace::Speed(speed)) if SPEEDS.contains(&speed) => control.speed = Some(speed),
            Ok(Pace::Speed(speed)) => return Err(format!("a speed of {speed}")),
            Ok(Pace::Stop(stop)) => control.stop |= stop,
            Err(no_pace) => {
                let intervention = Intervention::deserialize(&value);
                let intervention = intervention.map_err(|error| of_two(&no_pace, &error))?;
                if control.waiting.len() >= WAITING {
                    return Err(format!("{WAITING} interventions wait already"));
                }
                control.waiting.push_back(intervention);
            }
        }
        drop(control);
        self.heard.notify_all();
        Ok(())
    }

    /// Hears lines until there are none. A run that nobody can tell anything any more goes on.
    fn listen(&self) {
        let mut input = io::stdin().lock();
        let mut line = Vec::new();
        loop {
            line.clear();
            match (&mut input).take(LINE_BYTES).read_until(b'\n', &mut line) {
                Ok(1..) => {}
                Ok(0) | Err(_) => break,
            }
            let text = String::from_utf8_lossy(&line);
            let text = text.trim();
            if text.is_empty() {
                continue;
            }
            if let Err(reason) = self.hear(text) {
                let what = text.chars().take(200).collect();
                say(&Line::Refused {
                    what,
                    reason: &reason,
                });
            }
        }
        self.control().paused = false;
        self.heard.notify_all();
    }
}

/// A live run: its commands, its clock, and its clips.
pub(super) struct Live {
    ear: Arc<Ear>,
    /// When the next block is due.
    due: Option<Instant>,
    clips: Clips,
}

impl Live {
    /// Begins to hear.
    pub(super) fn start() -> Result<Self> {
        let ear = Arc::new(Ear::default());
        let listener = Arc::clone(&ear);
        thread::Builder::new()
            .name("commands".into())
            .spawn(move || listener.listen())
            .map_err(internal)?;
        Ok(Self {
            ear,
            due: None,
            clips: Clips::default(),
        })
    }

    /// True once somebody has said stop.
    pub(super) fn is_stopped(&self) -> bool {
        self.ear.control().stop
    }

    /// Interventions that were asked for since the last block.
    pub(super) fn interventions(&self) -> Vec<Intervention> {
        self.ear.control().waiting.drain(..).collect()
    }

    /// Simulated seconds that were shown.
    pub(super) fn now_s(&self) -> f64 {
        self.clips.now_s()
    }

    /// Waits until a block of so many seconds may be driven.
    pub(super) fn pace(&mut self, period_s: f64) {
        let ear = Arc::clone(&self.ear);
        let mut control = ear.control();
        if control.paused {
            self.clips.show();
        }
        loop {
            if control.stop || interrupted() {
                return;
            }
            let now = Instant::now();
            let wait = if control.paused && control.steps == 0 {
                self.due = None;
                LOOK
            } else if control.paused {
                control.steps -= 1;
                return;
            } else {
                let Some(speed) = control.speed else {
                    self.due = None;
                    return;
                };
                let due = *self.due.get_or_insert(now);
                if due <= now {
                    // A run that is behind does not hurry afterwards.
                    let from = if now - due > Duration::from_secs(1) {
                        now
                    } else {
                        due
                    };
                    self.due = Some(from + Duration::from_secs_f64(period_s / speed));
                    return;
                }
                (due - now).min(LOOK)
            };
            let waited = ear.heard.wait_timeout(control, wait);
            control = waited.map_or_else(|error| error.into_inner().0, |(control, _)| control);
        }
    }
}

/// Shows where robots are, again and again.
#[derive(Default)]
struct Clips {
    recording: Option<Recording>,
    ticks_hz: f64,
    stride: u64,
    clip: Option<Clip>,
    last: Option<Sample>,
    doing: Doing,
    shown: Option<Instant>,
}

/// The poses of a tick.
struct Sample {
    tick: u64,
    x_m: Vec<f64>,
    y_m: Vec<f64>,
    heading_rad: Option<Vec<f64>>,
}

impl Sample {
    fn of(tick: u64, states: &States<'_>) -> Self {
        Self {
            tick,
            x_m: states.x_m.to_vec(),
            y_m: states.y_m.to_vec(),
            heading_rad: states.heading_rad.map(<[f64]>::to_vec),
        }
    }

    fn states(&self) -> States<'_> {
        States {
            x_m: &self.x_m,
            y_m: &self.y_m,
            heading_rad: self.heading_rad.as_deref(),
            progress: None,
        }
    }
}

impl Clips {
    fn now_s(&self) -> f64 {
        let last = self.last.as_ref();
        last.map_or(0.0, |last| last.tick as f64 / self.ticks_hz)
    }

    /// A clip that begins with a sample, so that the one before ends where it begins.
    fn begin_clip(&self, sample: &Sample) -> Option<Clip> {
        let recording = self.recording.as_ref()?;
        let first_s = sample.tick as f64 / self.ticks_hz;
        let mut clip = Clip::new(recording, first_s, self.stride as f64 / self.ticks_hz);
        clip.push(&sample.states()).ok()?;
        Some(clip)
    }

    /// Shows what there is that was not shown.
    fn show(&mut self) {
        let Some(clip) = self.clip.take_if(|clip| clip.samples() > 1) else {
            return;
        };
        say(&Line::Clip(base64(&clip.finish())));
        let mut doing = std::mem::take(&mut self.doing);
        if !(doing.goals.is_empty() && doing.waits.is_empty()) {
            doing.at_s = self.now_s();
            say(&Line::Doing(doing));
        }
        self.shown = Some(Instant::now());
        self.clip = self.last.as_ref().and_then(|last| self.begin_clip(last));
    }
}

impl TraceSink for Clips {
    fn wants_state(&self, tick: u64) -> bool {
        self.stride > 0 && tick.is_multiple_of(self.stride)
    }

    fn begin(&mut self, header: &Header) -> io::Result<()> {
        let recording = Recording::of_trace("", header);
        self.recording = Some(recording.clone());
        let overview = Overview::new(recording);
        say(&Line::Meta(Box::new(overview.meta(None))));
        self.ticks_hz = f64::from(header.ticks_hz);
        self.stride = (self.ticks_hz / SAMPLES_HZ).round().max(1.0) as u64;
        Ok(())
    }

    fn state(&mut self, tick: u64, states: &States<'_>) -> io::Result<()> {
        if !self.wants_state(tick) {
            return Ok(());
        }
        let sample = Sample::of(tick, states);
        self.clip = match self.clip.take() {
            Some(mut clip) if clip.samples() < SAMPLES => clip.push(states).ok().map(|()| clip),
            _ => None,
        };
        if self.clip.is_none() {
            self.clip = self.begin_clip(&sample);
        }
        self.last = Some(sample);
        if self.shown.is_none_or(|shown| shown.elapsed() >= PAUSE) {
            self.show();
        }
        Ok(())
    }

    fn journal(&mut self, entries: &[Entry]) -> io::Result<()> {
        for entry in entries {
            match &entry.what {
                Happening::Goal(goal) => self.doing.goals.insert(goal.agent, Some(goal.cell)),
                Happening::Reached { agent, .. } => self.doing.goals.insert(*agent, None),
                _ => None,
            };
        }
        Ok(())
    }

    fn waits(&mut self, changes: &[Waiting]) -> io::Result<()> {
        let changes = changes.iter();
        let waits = changes.map(|change| (change.agent, change.awaited.brief()));
        self.doing.waits.extend(waits);
        Ok(())
    }

    fn end(&mut self, _: &Summary) -> io::Result<()> {
        self.show();
        Ok(())
    }
}

/// The trace of a run, and its clips.
#[derive(Default)]
pub(super) struct Tee {
    pub(super) trace: Option<TraceWriter<BufWriter<Unnamed>>>,
    pub(super) live: Option<Live>,
}

impl Tee {
    /// Both, as far as they are there.
    fn all(&mut self) -> impl Iterator<Item = &mut dyn TraceSink> {
        let trace = self.trace.as_mut().map(|trace| trace as &mut dyn TraceSink);
        let clips = self
            .live
            .as_mut()
            .map(|live| &mut live.clips as &mut dyn TraceSink);
        trace.into_iter().chain(clips)
    }
}

impl TraceSink for Tee {
    fn wants_state(&self, tick: u64) -> bool {
        let trace = self.trace.as_ref();
        let clips = self.live.as_ref();
        trace.is_some_and(|trace| trace.wants_state(tick))
            || clips.is_some_and(|live| live.clips.wants_state(tick))
    }

    fn begin(&mut self, header: &Header) -> io::Result<()> {
        self.all().try_for_each(|sink| sink.begin(header))
    }

    fn state(&mut self, tick: u64, states: &States<'_>) -> io::Result<()> {
        let mut sinks = self.all().filter(|sink| sink.wants_state(tick));
        sinks.try_for_each(|sink| sink.state(tick, states))
    }

    fn events(&mut self, events: &[Event]) -> io::Result<()> {
        self.all().try_for_each(|sink| sink.events(events))
    }

    fn journal(&mut self, entries: &[Entry]) -> io::Result<()> {
        self.all().try_for_each(|sink| sink.journal(entries))
    }

    fn waits(&mut self, changes: &[Waiting]) -> io::Result<()> {
        self.all().try_for_each(|sink| sink.waits(changes))
    }

    fn remarks(&mut self, remarks: &[Remark]) -> io::Result<()> {
        self.all().try_for_each(|sink| sink.remarks(remarks))
    }

    fn end(&mut self, summary: &Summary) -> io::Result<()> {
        self.all().try_for_each(|sink| sink.end(summary))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_are_heard_or_refused() {
        let ear = Ear::default();
        for command in [
            r#"{"pause":true}"#,
            r#"{"step":3}"#,
            r#"{"speed":2.5}"#,
            r#"{"close":{"cell":7,"for_s":30}}"#,
            r#"{"hold":{"agent":1,"for_s":5}}"#,
        ] {
            ear.hear(command).unwrap();
        }
        let control = ear.control();
        assert!(control.paused && control.steps == 3 && control.speed == Some(2.5));
        assert_eq!(control.waiting.len(), 2);
        drop(control);
        for wrong in [
            "",
            "pause",
            r#"{"speed":-1}"#,
            r#"{"speed":1e99}"#,
            r#"{"close":{"cell":-1,"for_s":1}}"#,
            r#"{"pause":true,"stop":true}"#,
            r#"{"shout":1}"#,
        ] {
            assert!(ear.hear(wrong).is_err(), "{wrong}");
        }
    }
}
