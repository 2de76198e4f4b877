//! A recording but for the motion of its bodies: what a replay page and a server tell the viewer of it.

use std::collections::BTreeMap;
use std::io;

use fleetyard_sim::trace::{Entry, Outline, Remark, States, Summary};
use fleetyard_sim::{Event, EventKind, Other, TraceSink};
use serde::Serialize;

use crate::layers::{Layer, Layers};
use crate::palette::{AGENTS, HEAT};
use crate::recording::{Recording, named};
use crate::track::Quanta;
use crate::work::{Work, WorkMeta};
use crate::world::Cells;

/// The most contacts that a page lists.
const MAX_CONTACTS: usize = 10_000;

/// Contacts, arrivals, and the work of a fleet, as they come from a trace. Of states the last tick is kept.
#[derive(Debug)]
pub struct Overview {
    pub(crate) recording: Recording,
    pub(crate) quanta: Quanta,
    /// Ticks between samples.
    pub(crate) stride: u64,
    /// Knots of tracks, if there are any.
    pub(crate) knots: u64,
    /// The bodies that are shown: some or all agents, and all moving obstacles.
    pub(crate) ids: Vec<u32>,
    pub(crate) last_tick: Option<u64>,
    /// Contacts of agents that are shown; open ones by agent and other.
    contacts: Vec<Contact>,
    open: BTreeMap<(u32, (u8, u32)), usize>,
    /// Times at which agents that are shown came to the ends of their routes.
    arrivals: BTreeMap<u32, f64>,
    contacts_total: u64,
    work: Work,
    layers: Layers,
}

/// Begin, end if it ended, agent, other body or none for an obstacle that stands.
#[derive(Debug, Clone, Copy, Serialize)]
struct Contact(f64, Option<f64>, u32, Option<u32>);

/// All that the viewer is told of a recording besides motion. It is made to be serialised: its form is that which
/// `web/recording.js` reads, and belongs to this version of the viewer.
#[derive(Debug, Serialize)]
pub struct Meta<'a> {
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
    /// Robots that are shown; trailers come after them, then moving obstacles.
    agents: usize,
    /// Of the trace; ids from here on are of trailers and moving obstacles.
    all_agents: u32,
    ids: &'a [u32],
    /// Trailers that are shown, each with its car.
    cars: Vec<[u32; 2]>,
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

#[derive(Debug, Serialize)]
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

#[derive(Debug, Serialize)]
#[serde(untagged)]
enum OutlineMeta<'a> {
    Disc { r: f64 },
    Polygon { v: &'a [f64] },
}

impl Overview {
    /// Of all bodies of a recording.
    pub fn new(recording: Recording) -> Self {
        let ids = (0..recording.outline_of_body.len() as u32).collect();
        let stride = recording.state_every.max(1).into();
        Self::of(recording, ids, stride)
    }

    /// Of some bodies, at every so many ticks.
    pub(crate) fn of(recording: Recording, ids: Vec<u32>, stride: u64) -> Self {
        Self {
            quanta: Quanta::of(&recording.outlines),
            stride,
            knots: 0,
            ids,
            last_tick: None,
            contacts: Vec::new(),
            open: BTreeMap::new(),
            arrivals: BTreeMap::new(),
            contacts_total: 0,
            work: Work::default(),
            layers: Layers::default(),
            recording,
        }
    }

    /// Shows what the planner wanted to show, as far as it is about agents that are shown.
    #[must_use]
    pub fn layers(mut self, layers: Layers) -> Self {
        let agents = self.recording.agents;
        let ids = &self.ids;
        self.layers = layers.about(|id| id < agents && ids.binary_search(&id).is_ok());
        self
    }

    /// Says at which tick the recording ends, where its states are not given.
    pub fn ends_at(&mut self, tick: u64) {
        self.last_tick = Some(tick);
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

    /// All that the viewer is told. `incomplete` says why the recording ends early, if it does.
    pub fn meta(&self, incomplete: Option<&str>) -> Meta<'_> {
        let recording = &self.recording;
        let world = &recording.world;
        let agents = self.ids.partition_point(|id| *id < recording.robots());
        let trailers = (recording.robots()..recording.agents).zip(&recording.cars);
        let is_shown = |id: &u32| self.ids.binary_search(id).is_ok();
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
            all_agents: recording.robots(),
            ids: &self.ids,
            cars: trailers
                .filter(|(trailer, _)| is_shown(trailer))
                .map(|(trailer, car)| [trailer, *car])
                .collect(),
            goals: per_agent(shown, recording.goals_m.is_empty(), &|id| {
                recording.goals_m.get(id as usize).copied()
            }),
            arrivals: per_agent(shown, self.arrivals.is_empty(), &|id| {
                self.arrivals.get(&id).copied()
            }),
            headings: recording.headings,
            knots: self.knots,
            sample_s: self.stride as f64 * recording.tick_s,
            duration_s: self.last_tick.unwrap_or(0) as f64 * recording.tick_s,
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
        let all = recording.robots() as usize;
        let shown = self.ids.partition_point(|id| *id < recording.robots());
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

/// Takes a recording whose header [`Recording::of_trace`] has seen.
impl TraceSink for Overview {
    fn state(&mut self, tick: u64, _: &States<'_>) -> io::Result<()> {
        self.last_tick = Some(tick);
        Ok(())
    }

    fn events(&mut self, events: &[Event]) -> io::Result<()> {
        for event in events {
            self.add_event(event);
        }
        Ok(())
    }

    fn journal(&mut self, entries: &[Entry]) -> io::Result<()> {
        let agents = (self.ids).partition_point(|id| *id < self.recording.robots());
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
