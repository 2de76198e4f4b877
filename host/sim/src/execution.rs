//! The execution of a plan: the loop over blocks of time.
//!
//! A block is a step of a grid plan if everybody follows it exactly, and a
//! period of messages otherwise. Within a block agents move without knowing of
//! each other, so that all of them can be moved at once, on any number of
//! threads, before it is found out who came near whom.

use fleetyard_core::{Digest, Grid, Hasher};
use fleetyard_world::{Mover, Shape, Workspace, write_workspace};
use xxhash_rust::xxh3::Xxh3;

use crate::chunk::{CHUNK, Chunk, Span, Tracking};
use crate::clock::Clock;
use crate::config::{Policy, SimConfig};
use crate::control::{Driver, Releases};
use crate::error::SimError;
use crate::event::{Change, Event, EventKind, Log, Other};
use crate::follow::{Follower, follow_mover};
use crate::gate::{Gates, Routes};
use crate::kinematic::{Bodies, Nearest, Shapes, Sweep};
use crate::motion::{Fleet, Model};
use crate::noise::Noise;
use crate::obstacles::Obstacles;
use crate::outcome::{Approach, Outcome};
use crate::pairs::{Pairs, TooManyPairs};
use crate::route::{Plan, Reference};
use crate::solved::Solved;
use crate::trace::{
    Bounds, Cells, Digests, EventsDigest, Header, Outline, Profile, Scene, States, Summary,
    TraceSink,
};
use crate::workers::Workers;

/// An execution ends if nobody has got anywhere for so long, in seconds.
const STALL_S: f64 = 600.0;

/// How often that is looked at, in seconds.
const LOOK_S: f64 = 10.0;

/// Nearer to where it was, in cells, a body has got nowhere: one that pushes against a
/// wall trembles for ever.
const NOWHERE_CELLS: f64 = 0.25;

/// What does not change while a plan is executed.
pub(crate) struct Setup<'a> {
    pub(crate) config: &'a SimConfig,
    pub(crate) clock: Clock,
    pub(crate) workers: Workers,
    pub(crate) agents: usize,
    pub(crate) movers: &'a [Mover],
    pub(crate) plan: Plan<'a>,
    /// By kind of shape; none follows its reference exactly.
    pub(crate) models: Vec<Option<&'a Model>>,
    pub(crate) obstacles: Obstacles,
    /// Whether the plan has headings.
    pub(crate) headings: bool,
    /// Whether states have headings.
    pub(crate) with_heading: bool,
    /// Everybody follows the plan exactly, by time.
    pub(crate) exact: bool,
    pub(crate) grid: Option<&'a Grid>,
    pub(crate) workspace: Option<&'a Workspace>,
    pub(crate) fleet: Option<&'a Fleet>,
}

/// An execution under way.
pub(crate) struct Run<'a> {
    setup: &'a Setup<'a>,
    reference: Reference<'a>,
    shapes: Shapes,
    gates: Option<Gates>,
    noise: Noise,
    /// The bodies that push each other, in the contact tier.
    solved: Option<Solved>,
    chunks: Vec<Chunk>,
    pairs: Pairs,
    sweep: Sweep,
    nearest: Nearest,
    /// Where bodies are at the start of the block, and how far they get.
    places: Vec<[f64; 3]>,
    log: Log,
    next_tick: u64,
    /// The moments of the block at which ticks start.
    moments: Vec<f64>,
    /// The ends of its ticks.
    tick_ends: Vec<f64>,
    events: EventsDigest,
    settled: Vec<Event>,
    /// A state of everybody, put together for the trace.
    state: [Vec<f64>; 3],
    /// When it was seen last that somebody had got anywhere, and where all were then.
    moved: f64,
    were: Vec<[f64; 2]>,
    /// When that was looked at last.
    looked: f64,
}

impl<'a> Run<'a> {
    pub(crate) fn new(
        setup: &'a Setup<'a>,
        reference: Reference<'a>,
        shapes: Shapes,
        gates: Option<Gates>,
        solved: Option<Solved>,
        chunks: Vec<Chunk>,
    ) -> Self {
        let (config, clock) = (setup.config, setup.clock);
        let approach_m = config.approach_range_cells * config.cell_size_m;
        let range = approach_m.max(2.0 * shapes.largest_radius_m());
        Self {
            setup,
            reference,
            noise: Noise::new(&config.disturbance, clock.period_s()),
            pairs: Pairs::new(range, config.max_pairs),
            sweep: Sweep::default(),
            places: Vec::new(),
            nearest: Nearest::new(setup.agents, approach_m),
            log: Log::new(clock.substeps_per_s, config.max_contacts_kept),
            next_tick: 0,
            moments: Vec::new(),
            tick_ends: Vec::new(),
            events: EventsDigest::default(),
            settled: Vec::new(),
            state: Default::default(),
            moved: 0.0,
            were: Vec::new(),
            looked: f64::NEG_INFINITY,
            shapes,
            gates,
            solved,
            chunks,
        }
    }

    pub(crate) fn execute(mut self, sink: &mut dyn TraceSink) -> Result<Outcome, SimError> {
        let header = self
            .setup
            .header(&self.shapes, &self.reference, sink.wants_scene());
        sink.begin(&header)?;
        let limit = self.limit()?;
        // The moment of the start, at which overlapping agents are in contact.
        let start = Span {
            start: 0.0,
            end: 0.0,
        };
        self.block(start, 0, sink, false)?;
        self.check_starts(limit)?;
        let mut number = 0;
        let mut now = 0.0;
        loop {
            let end = self.end_of_block(number + 1).min(limit);
            let block = Span { start: now, end };
            if block.length() <= 0.0 {
                break;
            }
            self.block(block, number, sink, false)?;
            (now, number) = (end, number + 1);
            if self.is_over(now) {
                break;
            }
        }
        // The state at the very end.
        let end = Span {
            start: now,
            end: now,
        };
        self.block(end, number, sink, true)?;
        self.settle(sink, f64::INFINITY)?;
        self.outcome(&header, sink)
    }

    /// The moment at which the execution ends at the latest.
    fn limit(&self) -> Result<f64, SimError> {
        let (config, clock) = (self.setup.config, self.setup.clock);
        let planned = clock.ticks_until(self.reference.horizon())?;
        let given = config
            .time_limit_s
            .map(|limit| limit * clock.substeps_per_s);
        let limit = match given {
            Some(limit) => clock.ticks_until(limit)?,
            None => u64::MAX,
        };
        Ok(clock.tick_start(if self.goes_on() {
            limit
        } else {
            planned.min(limit)
        }))
    }

    /// Whether the execution goes on until everybody has arrived.
    fn goes_on(&self) -> bool {
        let config = self.setup.config;
        !self.setup.exact && (config.until_done || config.policy == Policy::Adg)
    }

    fn end_of_block(&self, count: u64) -> f64 {
        let clock = self.setup.clock;
        match self.setup.plan {
            Plan::Grid(_) if self.setup.exact && !self.setup.config.every_substep => {
                clock.step_start(count)
            }
            _ => clock.tick_start(count * clock.ticks_per_period),
        }
    }

    /// Whether nothing more will happen.
    fn is_over(&self, now: f64) -> bool {
        if !self.goes_on() {
            return false;
        }
        let mut pilots = self.chunks.iter().flat_map(|chunk| &chunk.pilots);
        pilots.all(|pilot| pilot.arrival.is_finite())
            || now - self.moved > STALL_S * self.setup.clock.substeps_per_s
    }

    /// Executes a block. `last` is true at the very end, of which the state is told.
    fn block(
        &mut self,
        block: Span,
        number: u64,
        sink: &mut dyn TraceSink,
        last: bool,
    ) -> Result<(), SimError> {
        let Setup {
            config,
            clock,
            obstacles,
            ..
        } = self.setup;
        let first = block.end <= 0.0 && !last;
        self.look_at_ticks(block, last);
        if let Some(gates) = &mut self.gates
            && !first
            && !last
        {
            gates.exchange(number);
        }
        let follower = Follower {
            reference: &self.reference,
            config,
            substeps_per_step: clock.substeps_per_step,
            block,
        };
        let refined = self
            .gates
            .as_ref()
            .map(|gates| gates.graph().routes(&self.reference));
        let driver = Driver {
            routes: match &refined {
                Some(refined) => refined as &dyn Routes,
                None => &self.reference,
            },
            headings: self.setup.headings,
            chase: config.policy == Policy::Time
                && matches!(self.setup.plan, Plan::Trajectories(_)),
            substeps_per_s: clock.substeps_per_s,
            plan_speed: config.max_speed_cells_per_step * config.cell_size_m / config.step_s,
            releases: match &self.gates {
                Some(gates) => Releases::Gates(gates.released()),
                None => Releases::Time,
            },
            noise: &self.noise,
            number,
            block,
            ticks: &self.tick_ends,
            tick_s: clock.tick_s(),
        };
        let (setup, shapes, moments) = (self.setup, &self.shapes, &self.moments);
        let before = self.next_tick - moments.len() as u64;
        let keep = (before..self.next_tick).any(|tick| sink.wants_state(tick));
        let tolerance_m = config.touch_tolerance_m();
        let contacts = (self.solved.is_none() || first) && !last;
        let solved = if last { None } else { self.solved.as_mut() };
        let is_solved = solved.is_some();
        if let Some(solved) = solved {
            for chunk in &mut self.chunks {
                chunk.begin_block();
                driver.draw(chunk);
            }
            let models = &setup.models;
            let model = |agent: u32| models[shapes.kind_of(agent)];
            solved.drive(&driver, &model, &mut self.chunks, &mut self.log.pending)?;
        }
        setup.workers.each(&mut self.chunks, |chunk| {
            let agents = setup
                .agents
                .saturating_sub(chunk.first as usize)
                .min(chunk.len());
            if !is_solved {
                chunk.begin_block();
            }
            if is_solved {
                // Their tracks are made: where they get depends on all of them.
            } else if last {
                for lane in 0..chunk.len() {
                    chunk.rest(block, lane);
                }
            } else if setup.exact {
                for lane in 0..agents {
                    follower.follow(chunk, lane);
                }
            } else {
                driver.draw(chunk);
                for lane in 0..agents {
                    setup.drive(&driver, shapes, chunk, lane);
                }
            }
            if !last {
                for lane in agents..chunk.len() {
                    let mover = &setup.movers[chunk.first as usize + lane - setup.agents];
                    follow_mover(mover, clock.substeps_per_s, block, chunk, lane);
                }
            }
            chunk.end_block();
            if contacts {
                for lane in 0..agents {
                    let (agent, track) = (chunk.first + lane as u32, chunk.tracks.get(lane));
                    let (shape, changes) = (shapes.of(agent), &mut chunk.changes);
                    obstacles.sweep_track(agent, shape, track, first, tolerance_m, changes);
                }
            }
            chunk.sample(moments, keep);
        });
        if !last {
            self.report_progress();
            self.search(block, first)?;
        }
        self.tell_states(sink)?;
        self.settle(sink, block.end)
    }

    /// Lists the ticks that start in a block and those that end in it.
    fn look_at_ticks(&mut self, block: Span, last: bool) {
        let clock = self.setup.clock;
        self.moments.clear();
        self.tick_ends.clear();
        loop {
            let when = clock.tick_start(self.next_tick);
            if when > block.end || (when >= block.end && !last) {
                break;
            }
            self.moments.push(when);
            self.next_tick += 1;
            if !self.setup.exact && !last {
                self.tick_ends.push(clock.tick_start(self.next_tick));
            }
        }
    }

    /// Tells the gates which knots agents have reached, and notes arrivals.
    fn report_progress(&mut self) {
        let mut gates = self.gates.as_mut();
        for chunk in &mut self.chunks {
            self.log.pending.append(&mut chunk.changes);
            for (lane, pilot) in chunk.pilots.iter_mut().enumerate() {
                let agent = chunk.first as usize + lane;
                if let Some(gates) = &mut gates {
                    gates.done(agent, pilot.done as usize);
                }
                if pilot.arrival.is_finite() && !pilot.told {
                    pilot.told = true;
                    let arrival =
                        Change::new(pilot.arrival, EventKind::Arrive, agent as u32, Other::Goal);
                    self.log.pending.push(arrival);
                }
            }
        }
    }

    /// Refuses what begins with agents in obstacles or in each other.
    fn check_starts(&mut self, limit: f64) -> Result<(), SimError> {
        if self.setup.config.overlapping_starts {
            if self.solved.is_some() && limit > 0.0 {
                // The world will find them by itself.
                self.log.forget();
            }
            return Ok(());
        }
        match self.log.first_contact() {
            Some((agent, other)) => Err(SimError::StartOverlap { agent, other }),
            None => Ok(()),
        }
    }

    /// Notes whether anybody is elsewhere than when that was so last.
    fn look_for_progress(&mut self, now: f64) {
        let far = NOWHERE_CELLS * self.setup.config.cell_size_m;
        let is = |place: &[f64; 3]| [place[0], place[1]];
        let elsewhere = |(place, were): (&[f64; 3], &[f64; 2])| {
            let (dx, dy) = (place[0] - were[0], place[1] - were[1]);
            dx * dx + dy * dy > far * far
        };
        let first = self.were.len() != self.places.len();
        if first || self.places.iter().zip(&self.were).any(elsewhere) {
            self.were = self.places.iter().map(is).collect();
            self.moved = now;
        }
    }

    /// Finds what came near and into contact in the block.
    fn search(&mut self, block: Span, first: bool) -> Result<(), SimError> {
        let Setup { config, clock, .. } = self.setup;
        let mut travel = 0f64;
        self.places.clear();
        for chunk in &self.chunks {
            for (lane, reach) in chunk.travel[..chunk.len()].iter().enumerate() {
                let (x, y) = chunk.tracks.first(lane);
                self.places.push([x, y, *reach]);
                travel = travel.max(*reach);
            }
        }
        if block.end - self.looked >= LOOK_S * clock.substeps_per_s {
            self.looked = block.end;
            self.look_for_progress(block.end);
        }
        // A list lasts while bodies move by a part of a cell, or for the block if
        // they move more.
        let horizon = 0.375 * config.cell_size_m;
        let places = |x: &mut Vec<f64>, y: &mut Vec<f64>| {
            x.extend(self.places.iter().map(|place| place[0]));
            y.extend(self.places.iter().map(|place| place[1]));
        };
        self.pairs
            .cover(self.setup.workers, places, travel * (1.0 + 1e-6), horizon)
            .map_err(|TooManyPairs| SimError::TooDense {
                most: config.max_pairs,
                time_s: block.start / clock.substeps_per_s,
            })?;
        let bodies = Bodies {
            chunks: &self.chunks,
            places: &self.places,
            agents: self.setup.agents as u32,
            shapes: &self.shapes,
            contacts: self.solved.is_none() || first,
            tolerance_m: config.touch_tolerance_m(),
        };
        self.sweep.run(
            self.setup.workers,
            &bodies,
            self.pairs.list(),
            first,
            &mut self.nearest,
            &mut self.log.pending,
        );
        Ok(())
    }

    /// Passes on the states at the ticks of the block.
    fn tell_states(&mut self, sink: &mut dyn TraceSink) -> Result<(), SimError> {
        let before = self.next_tick - self.moments.len() as u64;
        let columns = if self.setup.with_heading { 3 } else { 2 };
        for at in 0..self.moments.len() {
            let tick = before + at as u64;
            if !sink.wants_state(tick) {
                continue;
            }
            for (column, all) in self.state.iter_mut().enumerate().take(columns) {
                all.clear();
                for chunk in &self.chunks {
                    let from = (at * columns + column) * chunk.len();
                    all.extend_from_slice(&chunk.samples[from..from + chunk.len()]);
                }
            }
            let [x_m, y_m, heading] = &self.state;
            let states = States {
                x_m,
                y_m,
                heading_rad: self.setup.with_heading.then_some(heading),
                progress: None,
            };
            sink.state(tick, &states)?;
        }
        Ok(())
    }

    /// Hashes and passes on the events that nothing can precede any more.
    fn settle(&mut self, sink: &mut dyn TraceSink, now: f64) -> Result<(), SimError> {
        self.log.settle(now, &mut self.settled);
        if !self.settled.is_empty() {
            self.events.update(&self.settled);
            sink.events(&self.settled)?;
        }
        Ok(())
    }

    fn outcome(self, header: &Header, sink: &mut dyn TraceSink) -> Result<Outcome, SimError> {
        let Setup { config, clock, .. } = self.setup;
        let agents = self.setup.agents;
        let nearest = &self.nearest;
        let by_agent: Vec<Option<Approach>> = (0..agents)
            .map(|agent| {
                nearest.distance[agent].is_finite().then(|| Approach {
                    distance_m: nearest.distance[agent],
                    time_s: nearest.when[agent] / clock.substeps_per_s,
                    agents: [agent as u32, nearest.other[agent]],
                })
            })
            .collect();
        let overall = by_agent.iter().flatten().copied().min_by(|a, b| {
            let by_distance = a.distance_m.total_cmp(&b.distance_m);
            by_distance
                .then(a.time_s.total_cmp(&b.time_s))
                .then(a.agents.cmp(&b.agents))
        });
        let mut tracking = Tracking::default();
        let mut states = Xxh3::new();
        for chunk in &self.chunks {
            tracking.join(chunk.tracking);
            states.update(&chunk.states.digest128().to_le_bytes());
        }
        let ticks = self.next_tick - 1;
        let end = clock.tick_start(ticks);
        let duration = end * agents as f64;
        let mean = if duration > 0.0 {
            tracking.sum / duration
        } else {
            0.0
        };
        let contacts = &self.log.contacts;
        let summary = Summary {
            ticks,
            simulated_s: end / clock.substeps_per_s,
            contacts_agent_agent: contacts.agent_agent,
            contacts_agent_obstacle: contacts.agent_obstacle,
            nearest_approach_m: overall.map(|approach| approach.distance_m),
            tracking_error_max_m: tracking.max_m,
            tracking_error_mean_m: mean,
            states_digest: Digest(states.digest128()),
            events_digest: self.events.finish(),
            trace_digest: Digest(0),
        }
        .sealed(header);
        sink.end(&summary)?;
        let arrivals = self.arrivals();
        let arrived: Vec<f64> = arrivals.filter(|when| when.is_finite()).collect();
        let all = arrived.len() == agents;
        let seconds = |substeps: f64| substeps / clock.substeps_per_s;
        Ok(Outcome {
            tier: config.tier,
            policy: config.policy,
            agents: agents as u32,
            radius_m: self.shapes.largest_radius_m(),
            arrived: arrived.len() as u32,
            makespan_s: all.then(|| seconds(arrived.iter().copied().fold(0.0, f64::max))),
            sum_of_costs_s: all.then(|| seconds(arrived.iter().sum())),
            simulated_s: summary.simulated_s,
            ticks: summary.ticks,
            nearest_approach_m: summary.nearest_approach_m,
            nearest_approach: overall,
            nearest_approach_by_agent: by_agent,
            tracking_error_max_m: tracking.max_m,
            tracking_error_max_agent: tracking.max_agent,
            tracking_error_mean_m: mean,
            trace_digest: summary.trace_digest,
            contacts: self.log.contacts,
        })
    }

    /// When each agent arrived, in substeps; infinite for those that did not.
    fn arrivals(&self) -> impl Iterator<Item = f64> {
        let end = self.setup.clock.tick_start(self.next_tick - 1);
        (0..self.setup.agents).map(move |agent| {
            if self.setup.exact {
                let when = self.reference.time(agent, self.reference.last(agent));
                if when <= end { when } else { f64::INFINITY }
            } else {
                self.chunks[agent / CHUNK].pilots[agent % CHUNK].arrival
            }
        })
    }
}

impl Setup<'_> {
    /// Moves an agent through a block.
    fn drive(&self, driver: &Driver<'_>, shapes: &Shapes, chunk: &mut Chunk, lane: usize) {
        match self.models[shapes.kind_of(chunk.first + lane as u32)] {
            None | Some(Model::Pebble(_)) => driver.follow(None, chunk, lane),
            Some(Model::Rotation(model)) => {
                let quarter_turn = model.turn_s * self.clock.substeps_per_s;
                driver.follow(Some(quarter_turn), chunk, lane);
            }
            Some(model) => driver.drive(model, chunk, lane),
        }
    }

    /// What a trace says of the execution. The scene is made for those who look
    /// at it only.
    fn header(&self, shapes: &Shapes, reference: &Reference<'_>, scene: bool) -> Header {
        let outline = |shape: &Shape| {
            if shape.is_disc() {
                Outline::Disc {
                    radius_m: shape.effective_radius_m(),
                }
            } else {
                Outline::Polygon {
                    vertices_m: shape.vertices().to_vec(),
                }
            }
        };
        let profiles = shapes.kinds.iter().enumerate().map(|(kind, shape)| {
            let model = self.models.get(kind).copied();
            Profile {
                name: match model {
                    Some(_) => format!("robot {kind}"),
                    None => format!("mover {}", kind - self.models.len()),
                },
                model: match model {
                    Some(model) => model.map_or("pebble", Model::name).to_owned(),
                    None => String::new(),
                },
                outline: outline(shape),
            }
        });
        let scene = if scene {
            self.scene(shapes, reference)
        } else {
            Scene::default()
        };
        Header {
            program: concat!("fleetyard ", env!("CARGO_PKG_VERSION")).to_owned(),
            agents: self.agents as u32,
            movers: self.movers.len() as u32,
            ticks_hz: self.config.ticks_hz,
            substeps: self.config.substeps,
            tier: self.config.tier.name().to_owned(),
            policy: self.config.policy.name().to_owned(),
            seed: self.config.disturbance.seed,
            headings: self.with_heading,
            progress: false,
            state_every: 0,
            bounds_m: self.bounds(reference),
            profiles: profiles.collect(),
            digests: self.digests(),
            scene,
        }
    }

    fn scene(&self, shapes: &Shapes, reference: &Reference<'_>) -> Scene {
        let bodies = 0..(self.agents + self.movers.len()) as u32;
        let polygons = self
            .workspace
            .map_or(&[][..], |workspace| &workspace.obstacles);
        let goals = (0..self.agents).map(|agent| {
            let goal = reference.place(agent, reference.last(agent));
            [goal.x, goal.y]
        });
        Scene {
            cells: self
                .grid
                .map(|grid| Cells::new(grid, self.config.cell_size_m)),
            polygons_m: polygons
                .iter()
                .map(|polygon| polygon.vertices().to_vec())
                .collect(),
            profile_of_body: bodies.map(|body| shapes.kind_of(body) as u32).collect(),
            goals_m: goals.collect(),
        }
    }

    /// What is to be seen in a picture: the map and the workspace, or else where
    /// the plan goes.
    fn bounds(&self, reference: &Reference<'_>) -> Bounds {
        let mut bounds: Option<Bounds> = None;
        let mut add = |min_x: f64, min_y: f64, max_x: f64, max_y: f64| {
            let known = bounds.unwrap_or(Bounds {
                min_x,
                min_y,
                max_x,
                max_y,
            });
            bounds = Some(Bounds {
                min_x: known.min_x.min(min_x),
                min_y: known.min_y.min(min_y),
                max_x: known.max_x.max(max_x),
                max_y: known.max_y.max(max_y),
            });
        };
        if let Some(grid) = self.grid {
            let side = self.config.cell_size_m;
            add(
                0.0,
                0.0,
                f64::from(grid.cols()) * side,
                f64::from(grid.rows()) * side,
            );
        }
        if let Some(workspace) = self.workspace {
            let of = workspace.bounds;
            add(of.min[0], of.min[1], of.max[0], of.max[1]);
        }
        if self.grid.is_none() && self.workspace.is_none() {
            for agent in 0..self.agents {
                for knot in 0..=reference.last(agent) {
                    let place = reference.place(agent, knot);
                    add(place.x - 1.0, place.y - 1.0, place.x + 1.0, place.y + 1.0);
                }
            }
        }
        bounds.unwrap_or(Bounds {
            min_x: 0.0,
            min_y: 0.0,
            max_x: 0.0,
            max_y: 0.0,
        })
    }

    fn digests(&self) -> Digests {
        let workspace = self.workspace.map(|workspace| {
            let mut hasher = Hasher::new("fleetyard.workspace/1");
            hasher.bytes(&write_workspace(workspace));
            hasher.finish()
        });
        let world = match (self.grid.map(Grid::digest), workspace) {
            (Some(grid), Some(workspace)) => {
                let mut both = Hasher::new("fleetyard.map-and-workspace/1");
                both.bytes(&grid.0.to_le_bytes());
                both.bytes(&workspace.0.to_le_bytes());
                both.finish()
            }
            (one, other) => one.or(other).unwrap_or(Digest(0)),
        };
        Digests {
            world,
            plan: self.plan.digest(),
            fleet: self.fleet.map_or(Digest(0), fleet_digest),
            config: self.config.digest(),
        }
    }
}

/// Digest of who is who and moves how.
fn fleet_digest(fleet: &Fleet) -> Digest {
    let mut hasher = Hasher::new("fleetyard.fleet/1");
    for profile in fleet.profiles() {
        // Its derived form says everything, numbers to the last bit.
        hasher.bytes(format!("{profile:?}").as_bytes());
    }
    hasher.u32s(fleet.profile_of());
    hasher.finish()
}
