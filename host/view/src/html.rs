//! An animated replay as one HTML page that needs no network and no other file.
//!
//! The page's own parts are `replay.html`, `replay.css` and `replay.js` in `web/`, with the modules of
//! the viewer; this module fills in what was recorded. Whatever names contain, they are text: they are
//! escaped in HTML and in JSON, and the page's policy lets nothing be loaded.

use std::collections::BTreeMap;
use std::io;

use fleetyard_sim::trace::{self, Entry, Header, Outline, Remark, States, Summary};
use fleetyard_sim::{Event, EventKind, Other, TraceSink};
use serde::Serialize;

use crate::ViewError;
use crate::layers::{Layer, Layers};
use crate::palette::{AGENTS, HEAT};
use crate::shell::{Shell, embedded};
use crate::svg::reach_m;
use crate::track::{Quanta, Track, base64};
use crate::web::joined;
use crate::work::{Work, WorkMeta};
use crate::world::{Cells, World, floor_exponent};

const BODY: &str = include_str!("../web/replay.html");
const STYLE: &str = concat!(
    include_str!("../web/viewer.css"),
    include_str!("../web/replay.css")
);
const SCRIPT: &str = include_str!("../web/replay.js");

/// The most contacts that a page lists.
const MAX_CONTACTS: usize = 10_000;

/// The largest page that is written; browsers do not hold longer strings.
const MAX_BYTES: usize = 200_000_000;

/// A tenth of a degree.
const ANGLE_RAD: f64 = std::f64::consts::PI / 1800.0;

/// A recorded run, ready for a page.
#[derive(Debug, Clone)]
pub struct Recording {
    /// Title of the page.
    pub title: String,
    /// The map.
    pub world: World,
    /// Columns of the map, of which cells are told by number; 0 if there are no cells.
    pub columns: u32,
    /// Cells that are endpoints of a warehouse.
    pub endpoints: Option<Cells>,
    /// Cells that are workstations.
    pub workstations: Option<Cells>,
    /// The outlines that agents have.
    pub outlines: Vec<Outline>,
    /// For each body its index in `outlines`: first the agents, then obstacles
    /// that move.
    pub outline_of_body: Vec<u32>,
    /// Number of agents.
    pub agents: u32,
    /// Goal of every agent, in metres; empty if not known.
    pub goals_m: Vec<[f64; 2]>,
    /// True if headings mean anything; otherwise they are not shown.
    pub headings: bool,
    /// Duration of a tick.
    pub tick_s: f64,
    /// Ticks between the states that will be given.
    pub state_every: u32,
    /// Name and value of what else a reader may want to know.
    pub facts: Vec<(String, String)>,
}

impl Recording {
    /// A recording that begins with this header.
    pub fn of_trace(title: impl Into<String>, header: &Header) -> Self {
        let title = title.into();
        let scene = &header.scene;
        Self {
            columns: scene.cells.as_ref().map_or(0, trace::Cells::cols),
            endpoints: scene.endpoints.as_ref().map(Cells::of_trace),
            workstations: scene.workstations.as_ref().map(Cells::of_trace),
            world: World::of_trace(&title, header),
            title,
            outlines: header.profiles.iter().map(|p| p.outline.clone()).collect(),
            outline_of_body: scene.profile_of_body.clone(),
            agents: header.agents,
            goals_m: scene.goals_m.clone(),
            headings: header.headings,
            tick_s: 1.0 / f64::from(header.ticks_hz),
            state_every: header.state_every,
            facts: facts(header),
        }
    }
}

/// Facts of a header, as names and values for readers.
fn facts(header: &Header) -> Vec<(String, String)> {
    let rate = format!(
        "{} per second, {} substeps",
        header.ticks_hz, header.substeps
    );
    let digests = &header.digests;
    let mut facts = vec![
        ("executed by", header.program.clone()),
        ("tier", header.tier.clone()),
        ("policy", header.policy.clone()),
        ("seed", header.seed.to_string()),
        ("ticks", rate),
    ];
    for profile in &header.profiles {
        let model = match profile.model.as_str() {
            "" => "moving obstacle",
            model => model,
        };
        facts.push(("robot", format!("{}, {model}", profile.name)));
    }
    for (name, digest) in [
        ("world digest", digests.world),
        ("plan digest", digests.plan),
        ("fleet digest", digests.fleet),
    ] {
        if digest.0 != 0 {
            facts.push((name, digest.to_string()));
        }
    }
    named(facts)
}

fn named(facts: Vec<(&str, String)>) -> Vec<(String, String)> {
    let facts = facts.into_iter();
    facts
        .map(|(name, value)| (name.to_owned(), value))
        .collect()
}

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
    recording: Recording,
    quanta: Quanta,
    /// Ticks between samples.
    stride: u64,
    /// The bodies that are shown: some or all agents, and all moving obstacles.
    ids: Vec<u32>,
    tracks: Vec<Track>,
    /// The last sample that tracks have.
    sample: u32,
    /// The last state if it came between samples.
    between: Option<State>,
    last_tick: Option<u64>,
    /// Contacts of agents that are shown; open ones by agent and other.
    contacts: Vec<Contact>,
    open: BTreeMap<(u32, (u8, u32)), usize>,
    /// Times at which agents that are shown came to the ends of their routes.
    arrivals: BTreeMap<u32, f64>,
    contacts_total: u64,
    work: Work,
    layers: Layers,
}

#[derive(Debug)]
struct State {
    tick: u64,
    x_m: Vec<f64>,
    y_m: Vec<f64>,
    heading_rad: Option<Vec<f64>>,
}

/// Begin, end if it ended, agent, other body or none for an obstacle that stands.
#[derive(Debug, Clone, Copy, Serialize)]
struct Contact(f64, Option<f64>, u32, Option<u32>);

#[derive(Serialize)]
struct Meta<'a> {
    bounds: [f64; 4],
    cells: Option<CellsMeta<'a>>,
    endpoints: Option<CellsMeta<'a>>,
    workstations: Option<CellsMeta<'a>>,
    /// x and y of each corner, one after the other; likewise below.
    polygons: Vec<&'a [f64]>,
    outline: &'a [f64],
    roadmap: &'a [f64],
    outlines: Vec<OutlineMeta<'a>>,
    outline_of: Vec<u32>,
    agents: usize,
    /// Of the trace; ids from here on are of moving obstacles.
    all_agents: u32,
    ids: &'a [u32],
    /// Per agent that is shown, or empty; likewise below.
    goals: Vec<Option<[f64; 2]>>,
    arrivals: Vec<Option<f64>>,
    headings: bool,
    knots: u64,
    sample_s: f64,
    duration_s: f64,
    length_m: f64,
    angle_rad: f64,
    contacts: &'a [Contact],
    contacts_total: u64,
    /// Absent if nothing is known of a fleet.
    work: Option<WorkMeta<'a>>,
    layers: &'a [Layer],
    colors: [&'a str; AGENTS.len()],
    /// From little to much.
    heat: [&'a str; HEAT.len()],
    facts: &'a [(String, String)],
    notes: Vec<String>,
}

#[derive(Serialize)]
struct CellsMeta<'a> {
    rows: u32,
    side: f64,
    /// Row, column, rows and columns of each, one after the other.
    rectangles: &'a [u32],
}

impl<'a> CellsMeta<'a> {
    fn of(cells: &'a Cells) -> Self {
        Self {
            rows: cells.rows,
            side: cells.side_m,
            rectangles: cells.rectangles.as_flattened(),
        }
    }
}

#[derive(Serialize)]
#[serde(untagged)]
enum OutlineMeta<'a> {
    Disc { r: f64 },
    Polygon { v: &'a [f64] },
}

impl Page {
    /// A page without states so far.
    pub fn new(recording: Recording, options: &PageOptions) -> Result<Self, ViewError> {
        let agents = recording.agents;
        let movers = agents..recording.outline_of_body.len() as u32;
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
        let least = (recording.outlines.iter().map(reach_m)).fold(f64::INFINITY, f64::min);
        let exponent = floor_exponent(if least > 0.0 { least / 100.0 } else { 1e-3 });
        let recorded_s = f64::from(recording.state_every.max(1)) * recording.tick_s;
        let skip = (1.0 / (options.rate_hz * recorded_s))
            .round()
            .clamp(1.0, 1e9);
        Ok(Self {
            quanta: Quanta {
                length_m: 10f64.powi(exponent.min(1)),
                angle_rad: ANGLE_RAD,
            },
            stride: skip as u64 * u64::from(recording.state_every.max(1)),
            ids,
            tracks: Vec::new(),
            sample: 0,
            between: None,
            last_tick: None,
            contacts: Vec::new(),
            open: BTreeMap::new(),
            arrivals: BTreeMap::new(),
            contacts_total: 0,
            work: Work::default(),
            layers: Layers::default(),
            recording,
        })
    }

    /// Shows what the planner wanted to show, as far as it is about agents that are shown.
    #[must_use]
    pub fn layers(mut self, layers: Layers) -> Self {
        let agents = self.recording.agents;
        let ids = &self.ids;
        self.layers = layers.about(|id| id < agents && ids.binary_search(&id).is_ok());
        self
    }

    fn add_state(&mut self, tick: u64, states: &States<'_>) {
        let States {
            x_m,
            y_m,
            heading_rad,
            ..
        } = *states;
        self.last_tick = Some(tick);
        self.between = None;
        if tick.is_multiple_of(self.stride) || self.tracks.is_empty() {
            self.push((tick / self.stride) as u32, x_m, y_m, heading_rad);
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
        let quanta = self.quanta;
        let of = |values: &[f64], id: u32| values.get(id as usize).copied().unwrap_or(0.0);
        let pose = |id: u32| {
            let heading = heading_rad.map_or(0.0, |headings| of(headings, id));
            (of(x_m, id), of(y_m, id), heading)
        };
        if self.tracks.is_empty() {
            let tracks = self.ids.iter().map(|id| {
                let (x, y, heading) = pose(*id);
                Track::new(quanta, x, y, heading)
            });
            self.tracks = tracks.collect();
        } else if sample > self.sample {
            for (track, id) in self.tracks.iter_mut().zip(&self.ids) {
                let (x, y, heading) = pose(*id);
                track.push(sample, quanta, x, y, heading);
            }
        }
        self.sample = sample;
    }

    fn add_event(&mut self, event: &Event) {
        let agents = self.recording.agents;
        let is_shown = |id: u32| id < agents && self.ids.binary_search(&id).is_ok();
        // Which other body it is, and what tells contacts at the same time apart.
        let (other, key) = match event.other {
            Other::Agent(other) => (Some(other), (0, other)),
            Other::Mover(index) => (agents.checked_add(index), (1, index)),
            Other::Polygon(index) => (None, (2, index)),
            Other::Obstacle { .. } => (None, (3, 0)),
            Other::Goal => (None, (4, 0)),
        };
        if !is_shown(event.agent) && !other.is_some_and(is_shown) {
            return;
        }
        let time_s = (event.time_s * 1e4).round() / 1e4;
        match event.kind {
            EventKind::Begin => {
                self.contacts_total += 1;
                if self.contacts.len() < MAX_CONTACTS {
                    self.open.insert((event.agent, key), self.contacts.len());
                    let contact = Contact(time_s, None, event.agent, other);
                    self.contacts.push(contact);
                }
            }
            EventKind::End => {
                if let Some(at) = self.open.remove(&(event.agent, key)) {
                    self.contacts[at].1 = Some(time_s);
                }
            }
            EventKind::Arrive => {
                self.arrivals.insert(event.agent, time_s);
            }
        }
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
            self.last_tick = Some(state.tick);
        }
        let Some(last_tick) = self.last_tick else {
            return Err(ViewError::new(
                "the trace has no states, only events",
                "record states too: leave out --events",
            ));
        };
        let mut knots = 0;
        let mut bytes = Vec::new();
        for track in std::mem::take(&mut self.tracks) {
            knots += track.write(&mut bytes);
        }
        let meta = embedded(&self.meta(knots, last_tick, incomplete)).map_err(|error| {
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
            title: &self.recording.title,
            style: STYLE,
            script: &[&joined(SCRIPT)],
            body: BODY,
        };
        Ok(shell.page(&[("meta", &meta), ("tracks", &base64(&bytes))]))
    }

    fn meta(&self, knots: u64, last_tick: u64, incomplete: Option<&str>) -> Meta<'_> {
        let recording = &self.recording;
        let world = &recording.world;
        let agents = self.ids.partition_point(|id| *id < recording.agents);
        let outlines = recording.outlines.iter().map(|outline| match outline {
            Outline::Disc { radius_m } => OutlineMeta::Disc { r: *radius_m },
            Outline::Polygon { vertices_m } => OutlineMeta::Polygon {
                v: vertices_m.as_flattened(),
            },
        });
        let outline_of = match recording.outlines.len() {
            0 | 1 => Vec::new(),
            _ => {
                let of = |id: &u32| recording.outline_of_body[*id as usize];
                self.ids.iter().map(of).collect()
            }
        };
        let ([left, bottom], [right, top]) = (world.bounds.min, world.bounds.max);
        let shown = &self.ids[..agents];
        Meta {
            bounds: [left, bottom, right, top],
            cells: world.cells.as_ref().map(CellsMeta::of),
            endpoints: recording.endpoints.as_ref().map(CellsMeta::of),
            workstations: recording.workstations.as_ref().map(CellsMeta::of),
            polygons: world.polygons.iter().map(|p| p.as_flattened()).collect(),
            outline: world.outline.as_flattened(),
            roadmap: world.roadmap.as_flattened().as_flattened(),
            outlines: outlines.collect(),
            outline_of,
            agents,
            all_agents: recording.agents,
            ids: &self.ids,
            goals: per_agent(shown, recording.goals_m.is_empty(), &|id| {
                recording.goals_m.get(id as usize).copied()
            }),
            arrivals: per_agent(shown, self.arrivals.is_empty(), &|id| {
                self.arrivals.get(&id).copied()
            }),
            headings: recording.headings,
            knots,
            sample_s: self.stride as f64 * recording.tick_s,
            duration_s: last_tick as f64 * recording.tick_s,
            length_m: self.quanta.length_m,
            angle_rad: self.quanta.angle_rad,
            contacts: &self.contacts,
            contacts_total: self.contacts_total,
            work: self.work.meta(recording.tick_s, recording.columns),
            layers: &self.layers.all,
            colors: AGENTS,
            heat: HEAT,
            facts: &recording.facts,
            notes: self.notes(incomplete),
        }
    }

    /// Remarks for the reader about what was left out.
    fn notes(&self, incomplete: Option<&str>) -> Vec<String> {
        let recording = &self.recording;
        let recorded_hz = 1.0 / (f64::from(recording.state_every.max(1)) * recording.tick_s);
        let kept_hz = 1.0 / (self.stride as f64 * recording.tick_s);
        let two = |value: f64| (value * 100.0).round() / 100.0;
        let mut notes = vec![format!(
            "{} of {} recorded states per second are kept. Agents are shown within {} mm{} of \
             them, and move uniformly in between.",
            two(kept_hz),
            two(recorded_hz),
            two(1500.0 * self.quanta.length_m),
            if recording.headings {
                " and 0.15°"
            } else {
                ""
            },
        )];
        notes
            .push("Times of contacts are those of the trace, which may lie between states.".into());
        let all = recording.agents as usize;
        let shown = self.ids.partition_point(|id| *id < recording.agents);
        if shown < all {
            notes.push(format!(
                "{shown} of {all} agents are shown, and the contacts in which they take part."
            ));
        }
        let listed = self.contacts.len() as u64;
        if listed < self.contacts_total {
            notes.push(format!(
                "The first {listed} of {} contacts are listed and marked.",
                self.contacts_total
            ));
        }
        notes.extend(self.work.note());
        notes.extend(self.layers.note());
        if !self.layers.is_empty() {
            notes.push("Times of annotations are those of the plan.".into());
        }
        if let Some(reason) = incomplete {
            notes.push(format!("The recording is not complete: {reason}."));
        }
        notes
    }
}

/// A value per agent; empty if there is none for any.
fn per_agent<T>(ids: &[u32], unknown: bool, of: &dyn Fn(u32) -> Option<T>) -> Vec<Option<T>> {
    if unknown {
        return Vec::new();
    }
    ids.iter().map(|id| of(*id)).collect()
}

/// A page takes a recording whose header [`Recording::of_trace`] has seen. Headings
/// may be wrapped or not.
impl TraceSink for Page {
    fn state(&mut self, tick: u64, states: &States<'_>) -> io::Result<()> {
        self.add_state(tick, states);
        Ok(())
    }

    fn events(&mut self, events: &[Event]) -> io::Result<()> {
        for event in events {
            self.add_event(event);
        }
        Ok(())
    }

    fn journal(&mut self, entries: &[Entry]) -> io::Result<()> {
        let agents = self.ids.partition_point(|id| *id < self.recording.agents);
        self.work.journal(&self.ids[..agents], entries);
        Ok(())
    }

    fn remarks(&mut self, remarks: &[Remark]) -> io::Result<()> {
        self.work.remarks(remarks);
        Ok(())
    }

    fn end(&mut self, summary: &Summary) -> io::Result<()> {
        let mut facts = Vec::new();
        if let Some(nearest) = summary.nearest_approach_m {
            facts.push(("nearest", format!("{nearest:.3} m between centres")));
        }
        let (most, mean) = (summary.tracking_error_max_m, summary.tracking_error_mean_m);
        facts.push((
            "tracking error",
            format!("{most:.4} m at most, {mean:.4} m mean"),
        ));
        facts.push(("trace digest", summary.trace_digest.to_string()));
        self.recording.facts.extend(named(facts));
        Ok(())
    }
}
