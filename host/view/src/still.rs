//! Still pictures of traces.

use std::collections::BTreeMap;
use std::io;

use fleetyard_sim::trace::{Entry, Header, Standing, States};
use fleetyard_sim::{Event, EventKind, Other, TraceSink};

use crate::svg::{Body, Picture, reach_m};
use crate::world::World;

/// Takes a trace and makes a picture of it: of the whole, with the ways of all
/// agents and where contacts began, or of a moment, with everybody's outline and
/// the contacts that last.
#[derive(Debug)]
pub struct Still {
    header: Header,
    at_s: Option<f64>,
    paths: Vec<Vec<[f64; 2]>>,
    /// The last poses, or the last before the moment and the first after it.
    before: Option<(f64, Vec<Pose>)>,
    after: Option<(f64, Vec<Pose>)>,
    /// Contacts at the moment.
    open: BTreeMap<(u32, u64), (u32, Option<u32>)>,
    /// Places where contacts began, in metres.
    places: Vec<[f64; 2]>,
    /// The goals of a fleet at the moment.
    standing: Standing,
}

/// x, y and heading.
type Pose = [f64; 3];

/// The most places of contacts in a picture of the whole.
const MAX_PLACES: usize = 2000;

impl Still {
    /// A picture of a trace with this header, at a time or of the whole.
    pub fn new(header: &Header, at_s: Option<f64>) -> Self {
        Self {
            header: header.clone(),
            at_s,
            paths: vec![Vec::new(); header.agents as usize],
            before: None,
            after: None,
            open: BTreeMap::new(),
            places: Vec::new(),
            standing: Standing::new(header.agents),
        }
    }

    /// The last recorded time, once the trace has been read; `None` if it has no
    /// states.
    pub fn end_s(&self) -> Option<f64> {
        let last = self.after.as_ref().or(self.before.as_ref());
        last.map(|(time_s, _)| *time_s)
    }

    /// The picture, once the trace has been read. `world` is what
    /// [`World::of_trace`] makes of the same header.
    pub fn picture(self, world: &World) -> Picture<'_> {
        let mut picture = Picture::new(world);
        let poses = self.poses();
        if let Some(time_s) = self.at_s {
            picture.time_s = Some(time_s.min(self.end_s().unwrap_or(time_s)));
            picture.bodies = (poses.iter().enumerate())
                .filter_map(|(body, [x, y, heading])| {
                    let profile = *self.header.scene.profile_of_body.get(body)?;
                    Some(Body {
                        at_m: [*x, *y],
                        heading_rad: self.header.headings.then_some(*heading),
                        outline: self.header.profiles.get(profile as usize)?.outline.clone(),
                    })
                })
                .collect();
            let contacts = self.open.values();
            picture.contacts = contacts
                .filter_map(|(agent, other)| middle(&poses, *agent, *other))
                .collect();
        } else {
            picture.contacts = self.places;
        }
        picture.goals = self
            .header
            .scene
            .goals_m
            .iter()
            .copied()
            .map(Some)
            .collect();
        if let (true, Some(cells), Some(_)) = (
            picture.goals.is_empty(),
            &self.header.scene.cells,
            self.at_s,
        ) {
            let goal = |agent| Some(cells.center_m(self.standing.goal(agent)?.cell));
            picture.goals = (0..self.header.agents).map(goal).collect();
        }
        if picture.goals.is_empty() && self.at_s.is_none() {
            picture.goals = self.paths.iter().map(|path| path.last().copied()).collect();
        }
        picture.paths = self.paths;
        picture
    }

    /// Poses of all agents at the moment, or at the end.
    fn poses(&self) -> Vec<Pose> {
        match (&self.before, &self.after, self.at_s) {
            (Some((from, a)), Some((to, b)), Some(at)) if at > *from && to > from => {
                let part = ((at - from) / (to - from)).min(1.0);
                let turn = std::f64::consts::TAU;
                let between = |a: &Pose, b: &Pose| {
                    let mut change = [b[0] - a[0], b[1] - a[1], b[2] - a[2]];
                    change[2] -= (change[2] / turn).round() * turn;
                    [0, 1, 2].map(|at| a[at] + part * change[at])
                };
                a.iter().zip(b).map(|(a, b)| between(a, b)).collect()
            }
            (Some((_, poses)), ..) => poses.clone(),
            _ => Vec::new(),
        }
    }

    fn extend_paths(&mut self, poses: &[Pose]) {
        let header = &self.header;
        for (body, (path, [x, y, _])) in self.paths.iter_mut().zip(poses).enumerate() {
            let profile = header.scene.profile_of_body.get(body);
            let profile = profile.and_then(|at| header.profiles.get(*at as usize));
            // Less than a quarter of the body cannot be seen in a line.
            let least = 0.25 * profile.map_or(0.0, |profile| reach_m(&profile.outline));
            let moved = path.last().is_none_or(|[a, b]| {
                let (dx, dy) = (x - a, y - b);
                dx * dx + dy * dy > least * least
            });
            if moved {
                path.push([*x, *y]);
            }
        }
    }
}

/// Between two bodies, or at the one that touches an obstacle.
fn middle(poses: &[Pose], agent: u32, other: Option<u32>) -> Option<[f64; 2]> {
    let [x, y, _] = *poses.get(agent as usize)?;
    let other = other.and_then(|other| poses.get(other as usize));
    Some(other.map_or([x, y], |[a, b, _]| [0.5 * (x + a), 0.5 * (y + b)]))
}

impl TraceSink for Still {
    fn state(&mut self, tick: u64, states: &States<'_>) -> io::Result<()> {
        let time_s = self.header.time_s(tick);
        let headings = states.heading_rad.unwrap_or(&[]);
        let places = states.x_m.iter().zip(states.y_m).enumerate();
        let poses: Vec<Pose> = places
            .map(|(body, (x, y))| [*x, *y, headings.get(body).copied().unwrap_or(0.0)])
            .collect();
        self.extend_paths(&poses);
        if self.at_s.is_none_or(|at| time_s <= at) || self.before.is_none() {
            self.before = Some((time_s, poses));
        } else if self.after.is_none() {
            self.after = Some((time_s, poses));
        }
        Ok(())
    }

    fn events(&mut self, events: &[Event]) -> io::Result<()> {
        for event in events {
            if self.at_s.is_some_and(|at| event.time_s > at) {
                continue;
            }
            let agents = self.header.agents;
            let (other, key) = match event.other {
                Other::Agent(other) => (Some(other), u64::from(other)),
                Other::Mover(index) => (agents.checked_add(index), 1 << 32 | u64::from(index)),
                Other::Polygon(index) => (None, 2 << 32 | u64::from(index)),
                Other::Obstacle { .. } => (None, 3 << 32),
                Other::Goal => continue,
            };
            let key = (event.agent, key);
            match event.kind {
                EventKind::Begin => {
                    self.open.insert(key, (event.agent, other));
                    let poses = self.before.as_ref().map_or(&[][..], |(_, poses)| poses);
                    let place = middle(poses, event.agent, other);
                    if self.at_s.is_none() && self.places.len() < MAX_PLACES {
                        self.places.extend(place);
                    }
                }
                EventKind::End => {
                    self.open.remove(&key);
                }
                EventKind::Arrive => {}
            }
        }
        Ok(())
    }

    fn journal(&mut self, entries: &[Entry]) -> io::Result<()> {
        let header = &self.header;
        let is_past = |entry: &&Entry| self.at_s.is_none_or(|at| header.time_s(entry.tick) <= at);
        let past = entries.iter().take_while(is_past);
        past.for_each(|entry| self.standing.note(entry));
        Ok(())
    }
}
