//! An animated replay as one HTML page that needs no network and no other file.
//!
//! The page's own parts are `replay.html`, `replay.css` and `replay.js` in `web/`, with the modules of
//! the viewer; this module fills in what was recorded. Whatever names contain, they are text: they are
//! escaped in HTML and in JSON, and the page's policy lets nothing be loaded.

use std::io;

use fleetyard_sim::trace::{Entry, Remark, States, Summary};
use fleetyard_sim::{Event, TraceSink};

use crate::ViewError;
use crate::layers::Layers;
use crate::overview::Overview;
use crate::recording::Recording;
use crate::shell::{Shell, embedded};
use crate::track::{Track, base64};
use crate::web::joined;

const BODY: &str = include_str!("../web/replay.html");
const STYLE: &str = concat!(
    include_str!("../web/viewer.css"),
    include_str!("../web/replay.css")
);
const SCRIPT: &str = include_str!("../web/replay.js");

/// The largest page that is written; browsers do not hold longer strings.
const MAX_BYTES: usize = 200_000_000;

/// Options of a page.
#[derive(Debug, Clone, PartialEq)]
pub struct PageOptions {
    /// States per simulated second, at most; more than were recorded there
    /// cannot be.
    pub rate_hz: f64,
    /// The agents to show, all if `None`.
    pub agents: Option<Vec<u32>>,
}

impl Default for PageOptions {
    fn default() -> Self {
        Self {
            rate_hz: 10.0,
            agents: None,
        }
    }
}

/// A page in the making. It takes states and events as they come from a trace and
/// holds little more than what will be on the page.
#[derive(Debug)]
pub struct Page {
    overview: Overview,
    tracks: Vec<Track>,
    /// The last sample that tracks have.
    sample: u32,
    /// The last state if it came between samples.
    between: Option<State>,
}

#[derive(Debug)]
struct State {
    tick: u64,
    x_m: Vec<f64>,
    y_m: Vec<f64>,
    heading_rad: Option<Vec<f64>>,
}

impl Page {
    /// A page without states so far.
    pub fn new(recording: Recording, options: &PageOptions) -> Result<Self, ViewError> {
        let agents = recording.robots();
        let movers = recording.agents..recording.outline_of_body.len() as u32;
        let ids = match &options.agents {
            None => (0..movers.end).collect(),
            Some(wanted) => {
                let mut ids = wanted.clone();
                ids.sort_unstable();
                ids.dedup();
                if let Some(id) = ids.iter().find(|id| **id >= agents) {
                    return Err(ViewError::new(
                        format!("there is no agent {id}: the trace has {agents}"),
                        "agents are numbered from 0",
                    ));
                }
                // Trailers belong to their cars.
                let trailers = (agents..recording.agents).zip(&recording.cars);
                let towed = trailers.filter(|(_, car)| wanted.contains(car));
                ids.extend(towed.map(|(trailer, _)| trailer));
                ids.extend(movers);
                ids
            }
        };
        // Written so that NaN is refused.
        if !(options.rate_hz > 0.0 && options.rate_hz <= 1e6) {
            return Err(ViewError::new(
                format!("{} states per second is out of range", options.rate_hz),
                "give a rate between 0 and 1000000 per second; 10 is smooth",
            ));
        }
        let recorded_s = f64::from(recording.state_every.max(1)) * recording.tick_s;
        let skip = (1.0 / (options.rate_hz * recorded_s))
            .round()
            .clamp(1.0, 1e9);
        let stride = skip as u64 * u64::from(recording.state_every.max(1));
        Ok(Self {
            overview: Overview::of(recording, ids, stride),
            tracks: Vec::new(),
            sample: 0,
            between: None,
        })
    }

    /// Shows what the planner wanted to show, as far as it is about agents that are shown.
    #[must_use]
    pub fn layers(mut self, layers: Layers) -> Self {
        self.overview = self.overview.layers(layers);
        self
    }

    fn add_state(&mut self, tick: u64, states: &States<'_>) {
        let States {
            x_m,
            y_m,
            heading_rad,
            ..
        } = *states;
        self.overview.last_tick = Some(tick);
        self.between = None;
        if tick.is_multiple_of(self.overview.stride) || self.tracks.is_empty() {
            self.push((tick / self.overview.stride) as u32, x_m, y_m, heading_rad);
        } else {
            self.between = Some(State {
                tick,
                x_m: x_m.to_vec(),
                y_m: y_m.to_vec(),
                heading_rad: heading_rad.map(<[f64]>::to_vec),
            });
        }
    }

    fn push(&mut self, sample: u32, x_m: &[f64], y_m: &[f64], heading_rad: Option<&[f64]>) {
        let quanta = self.overview.quanta;
        let of = |values: &[f64], id: u32| values.get(id as usize).copied().unwrap_or(0.0);
        let pose = |id: u32| {
            let heading = heading_rad.map_or(0.0, |headings| of(headings, id));
            (of(x_m, id), of(y_m, id), heading)
        };
        if self.tracks.is_empty() {
            let tracks = self.overview.ids.iter().map(|id| {
                let (x, y, heading) = pose(*id);
                Track::new(quanta, x, y, heading)
            });
            self.tracks = tracks.collect();
        } else if sample > self.sample {
            for (track, id) in self.tracks.iter_mut().zip(&self.overview.ids) {
                let (x, y, heading) = pose(*id);
                track.push(sample, quanta, x, y, heading);
            }
        }
        self.sample = sample;
    }

    /// The page. `incomplete` says why the recording ends early, if it does.
    pub fn finish(mut self, incomplete: Option<&str>) -> Result<String, ViewError> {
        if let Some(state) = self.between.take() {
            // It ends between samples: everybody stops at the last one, so that
            // the last, shorter stretch stands for itself.
            for track in &mut self.tracks {
                track.rest();
            }
            let sample = self.sample + 1;
            self.push(sample, &state.x_m, &state.y_m, state.heading_rad.as_deref());
            self.overview.last_tick = Some(state.tick);
        }
        if self.overview.last_tick.is_none() {
            return Err(ViewError::new(
                "the trace has no states, only events",
                "record states too: leave out --events",
            ));
        }
        let mut bytes = Vec::new();
        for track in std::mem::take(&mut self.tracks) {
            self.overview.knots += track.write(&mut bytes);
        }
        let meta = embedded(&self.overview.meta(incomplete)).map_err(|error| {
            ViewError::new(
                format!("the page cannot be written: {error}"),
                "its numbers must be finite",
            )
        })?;
        let size = meta.len() + bytes.len().div_ceil(3) * 4;
        if size > MAX_BYTES {
            return Err(ViewError::new(
                format!("the page would have {} MB", size / 1_000_000),
                "give a lower --rate or fewer --agents",
            ));
        }
        let shell = Shell {
            title: &self.overview.recording.title,
            style: STYLE,
            script: &[&joined(SCRIPT)],
            body: BODY,
        };
        Ok(shell.page(&[("meta", &meta), ("tracks", &base64(&bytes))]))
    }
}

/// A page takes a recording whose header [`Recording::of_trace`] has seen. Headings
/// may be wrapped or not.
impl TraceSink for Page {
    fn state(&mut self, tick: u64, states: &States<'_>) -> io::Result<()> {
        self.add_state(tick, states);
        Ok(())
    }

    fn events(&mut self, events: &[Event]) -> io::Result<()> {
        self.overview.events(events)
    }

    fn journal(&mut self, entries: &[Entry]) -> io::Result<()> {
        self.overview.journal(entries)
    }

    fn remarks(&mut self, remarks: &[Remark]) -> io::Result<()> {
        self.overview.remarks(remarks)
    }

    fn end(&mut self, summary: &Summary) -> io::Result<()> {
        self.overview.end(summary)
    }
}
