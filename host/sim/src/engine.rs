//! The engine of all executions: it advances all bodies block by block.
//!
//! Within a block agents move independently of each other: all of them can be moved at
//! once, on any number of threads, before contacts and approaches are searched.

use fleetyard_core::Digest;
use xxhash_rust::xxh3::Xxh3;

use crate::chunk::{Chunk, Tracking};
use crate::control::{Driver, Releases};
use crate::error::SimError;
use crate::event::{Change, Event, EventKind, Log, Other};
use crate::follow::{Follower, follow_mover};
use crate::gate::Routes;
use crate::kinematic::{Bodies, Nearest, Shapes, Sweep};
use crate::noise::Noise;
use crate::outcome::{Approach, Outcome};
use crate::pairs::{Pairs, TooManyPairs};
use crate::route::Reference;
use crate::setup::Setup;
use crate::solved::Solved;
use crate::trace::{EventsDigest, Header, States, Summary, TraceSink};
use crate::track::Span;

/// Source of the agents' motion.
pub(crate) enum Guide<'g> {
    /// All agents follow the plan exactly, by time.
    Follow(&'g Reference<'g>),
    /// Controllers drive the agents.
    Drive {
        routes: &'g dyn Routes,
        /// Set if the headings of the routes are meaningful.
        headings: bool,
        /// Set if a plan of poses is followed in time by chasing its current pose.
        chase: bool,
        releases: Releases<'g>,
    },
}

/// An execution under way.
pub(crate) struct Engine<'a> {
    pub(crate) setup: Setup<'a>,
    pub(crate) shapes: Shapes,
    noise: Noise,
    /// The bodies of the contact tier.
    pub(crate) solved: Option<Solved>,
    pub(crate) chunks: Vec<Chunk>,
    pairs: Pairs,
    sweep: Sweep,
    nearest: Nearest,
    /// Positions of the bodies at the start of the block, and their largest distances
    /// from them.
    pub(crate) places: Vec<[f64; 3]>,
    pub(crate) log: Log,
    next_tick: u64,
    /// Starts of the ticks in the block.
    moments: Vec<f64>,
    /// Ends of the ticks in the block.
    tick_ends: Vec<f64>,
    events: EventsDigest,
    settled: Vec<Event>,
    /// State of all bodies, assembled for the trace.
    state: [Vec<f64>; 3],
}

impl<'a> Engine<'a> {
    pub(crate) fn new(
        setup: Setup<'a>,
        shapes: Shapes,
        solved: Option<Solved>,
        chunks: Vec<Chunk>,
    ) -> Self {
        let (config, clock) = (setup.config, setup.clock);
        let approach_m = config.approach_range_cells * config.cell_size_m;
        let range = approach_m.max(2.0 * shapes.largest_radius_m());
        Self {
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
            setup,
            shapes,
            solved,
            chunks,
        }
    }

    /// The moment of the start, at which overlapping agents are in contact.
    pub(crate) fn start(
        &mut self,
        guide: &Guide<'_>,
        sink: &mut dyn TraceSink,
    ) -> Result<(), SimError> {
        let start = Span {
            start: 0.0,
            end: 0.0,
        };
        self.block(start, 0, guide, sink, false)
    }

    /// Emits the final state and all remaining events.
    pub(crate) fn end(
        &mut self,
        now: f64,
        number: u64,
        guide: &Guide<'_>,
        sink: &mut dyn TraceSink,
    ) -> Result<(), SimError> {
        let end = Span {
            start: now,
            end: now,
        };
        self.block(end, number, guide, sink, true)?;
        self.settle(sink, f64::INFINITY)
    }

    /// Executes a block; `number` is its index, for the noise.
    pub(crate) fn advance(
        &mut self,
        block: Span,
        number: u64,
        guide: &Guide<'_>,
        sink: &mut dyn TraceSink,
    ) -> Result<(), SimError> {
        self.block(block, number, guide, sink, false)
    }

    /// Executes a block; `last` is true for the final moment, whose state is emitted.
    fn block(
        &mut self,
        block: Span,
        number: u64,
        guide: &Guide<'_>,
        sink: &mut dyn TraceSink,
        last: bool,
    ) -> Result<(), SimError> {
        self.look_at_ticks(block, last);
        let Setup {
            config,
            clock,
            obstacles,
            ..
        } = &self.setup;
        let first = block.end <= 0.0 && !last;
        let substeps_per_step = clock.substeps_per_step;
        let driver = match *guide {
            Guide::Follow(_) => None,
            Guide::Drive {
                routes,
                headings,
                chase,
                releases,
            } => Some(Driver {
                routes,
                headings,
                chase,
                substeps_per_s: clock.substeps_per_s,
                plan_speed: config.max_speed_cells_per_step * config.cell_size_m / config.step_s,
                releases,
                noise: &self.noise,
                number,
                block,
                ticks: &self.tick_ends,
                tick_s: clock.tick_s(),
            }),
        };
        let (setup, shapes, moments) = (&self.setup, &self.shapes, &self.moments);
        let before = self.next_tick - moments.len() as u64;
        let keep = (before..self.next_tick).any(|tick| sink.wants_state(tick));
        let tolerance_m = config.touch_tolerance_m();
        let contacts = (self.solved.is_none() || first) && !last;
        let mut is_solved = false;
        if !last
            && let Some(solved) = &mut self.solved
            && let Some(driver) = &driver
        {
            is_solved = true;
            for chunk in &mut self.chunks {
                chunk.begin_block();
                driver.draw(chunk);
            }
            let models = &setup.models;
            let model = |agent: u32| models[shapes.kind_of(agent)];
            solved.drive(driver, &model, &mut self.chunks, &mut self.log.pending)?;
        }
        setup.workers.each(&mut self.chunks, |chunk| {
            let driver = driver.as_ref().filter(|_| !is_solved && !last);
            if chunk.is_still
                && let Some(driver) = driver
                && driver.is_idle(chunk)
            {
                driver.draw_stops(chunk);
                chunk.stand(block, moments, keep);
                return;
            }
            let agents = setup
                .agents
                .saturating_sub(chunk.first as usize)
                .min(chunk.len());
            if !is_solved {
                chunk.begin_block();
            }
            if is_solved {
                // Tracks already made: the solver moves all bodies together.
            } else if last {
                for lane in 0..chunk.len() {
                    chunk.rest(block, lane);
                }
            } else {
                match (guide, driver) {
                    (Guide::Follow(reference), _) => {
                        let follower = Follower {
                            reference,
                            config,
                            substeps_per_step,
                            block,
                        };
                        for lane in 0..agents {
                            follower.follow(chunk, lane);
                        }
                    }
                    (_, Some(driver)) => {
                        driver.draw(chunk);
                        for lane in 0..agents {
                            setup.drive(driver, shapes, chunk, lane);
                        }
                    }
                    _ => {}
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
            let is_idle = driver.is_some_and(|driver| driver.is_idle(chunk));
            chunk.is_still = is_idle && !first && chunk.stood();
        });
        if !last {
            self.collect();
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

    /// Collects the contacts and arrivals that the chunks found.
    fn collect(&mut self) {
        for chunk in &mut self.chunks {
            self.log.pending.append(&mut chunk.changes);
            for (lane, pilot) in chunk.pilots.iter_mut().enumerate() {
                if pilot.arrival.is_finite() && !pilot.told {
                    pilot.told = true;
                    let agent = chunk.first + lane as u32;
                    let arrival = Change::new(pilot.arrival, EventKind::Arrive, agent, Other::Goal);
                    self.log.pending.push(arrival);
                }
            }
        }
    }

    /// Refuses executions that start with agents in obstacles or overlapping each other.
    /// `is_all` if nothing happens after the start.
    pub(crate) fn check_starts(&mut self, is_all: bool) -> Result<(), SimError> {
        if self.setup.config.overlapping_starts {
            if self.solved.is_some() && !is_all {
                // The world of the contact tier finds these contacts itself.
                self.log.forget();
            }
            return Ok(());
        }
        match self.log.first_contact() {
            Some((agent, other)) => Err(SimError::StartOverlap { agent, other }),
            None => Ok(()),
        }
    }

    /// Searches the block for approaches and contacts.
    fn search(&mut self, block: Span, first: bool) -> Result<(), SimError> {
        let Setup { config, clock, .. } = &self.setup;
        let mut travel = 0f64;
        self.places.clear();
        for chunk in &self.chunks {
            for (lane, reach) in chunk.travel[..chunk.len()].iter().enumerate() {
                let (x, y) = chunk.tracks.first(lane);
                self.places.push([x, y, *reach]);
                travel = travel.max(*reach);
            }
        }
        // A list of pairs stays valid while bodies move by a part of a cell, or for the
        // block if they move farther.
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
            cars: self.setup.cars,
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

    /// Emits the states at the ticks of the block.
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

    /// Hashes and emits the events that no later one can precede.
    fn settle(&mut self, sink: &mut dyn TraceSink, now: f64) -> Result<(), SimError> {
        self.log.settle(now, &mut self.settled);
        if !self.settled.is_empty() {
            self.events.update(&self.settled);
            sink.events(&self.settled)?;
        }
        Ok(())
    }

    /// Nearest approach of an agent to another one.
    fn nearest_of(&self, agent: usize) -> Option<Approach> {
        let nearest = &self.nearest;
        nearest.distance[agent].is_finite().then(|| Approach {
            distance_m: nearest.distance[agent],
            time_s: nearest.when[agent] / self.setup.clock.substeps_per_s,
            agents: [agent as u32, nearest.other[agent]],
        })
    }

    /// Nearest approach of any two agents.
    pub(crate) fn nearest(&self) -> Option<Approach> {
        let each = (0..self.setup.agents).filter_map(|agent| self.nearest_of(agent));
        each.min_by(|a, b| {
            let by_distance = a.distance_m.total_cmp(&b.distance_m);
            by_distance
                .then(a.time_s.total_cmp(&b.time_s))
                .then(a.agents.cmp(&b.agents))
        })
    }

    /// Memory of the execution in bytes, without the world and the bodies of the contact
    /// tier.
    pub(crate) fn memory_bytes(&self) -> usize {
        let agents = self.setup.agents;
        let columns: usize = self.state.iter().map(Vec::capacity).sum();
        let moments = self.moments.capacity() + self.tick_ends.capacity();
        self.chunks.iter().map(Chunk::memory_bytes).sum::<usize>()
            + self.pairs.memory_bytes()
            + self.sweep.memory_bytes()
            + self.log.memory_bytes()
            + agents * (2 * size_of::<f64>() + size_of::<u32>())
            + self.places.capacity() * size_of::<[f64; 3]>()
            + (columns + moments) * size_of::<f64>()
            + self.settled.capacity() * size_of::<Event>()
    }

    /// Start of the last tick with a known state, in substeps.
    pub(crate) fn last_tick(&self) -> f64 {
        self.setup
            .clock
            .tick_start(self.next_tick.saturating_sub(1))
    }

    /// Outcome of the execution, after its end. `arrivals` are the agents' times of
    /// arrival in substeps; infinite for agents that did not arrive.
    pub(crate) fn outcome(
        self,
        header: &Header,
        arrivals: impl Iterator<Item = f64>,
        sink: &mut dyn TraceSink,
    ) -> Result<Outcome, SimError> {
        let Setup { config, clock, .. } = &self.setup;
        let agents = self.setup.agents;
        let by_agent = (0..agents).map(|agent| self.nearest_of(agent)).collect();
        let overall = self.nearest();
        let mut tracking = Tracking::default();
        let mut states = Xxh3::new();
        for chunk in &self.chunks {
            tracking.join(chunk.tracking);
            states.update(&chunk.states.digest128().to_le_bytes());
        }
        let end = self.last_tick();
        let duration = end * agents as f64;
        let mean = if duration > 0.0 {
            tracking.sum / duration
        } else {
            0.0
        };
        let contacts = &self.log.contacts;
        let summary = Summary {
            ticks: self.next_tick.saturating_sub(1),
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
        // Trailers, which are the last, arrive with their cars.
        let robots = agents - self.setup.cars.len();
        let arrivals = arrivals.take(robots);
        let arrived: Vec<f64> = arrivals.filter(|when| when.is_finite()).collect();
        let all = arrived.len() == robots;
        let seconds = |substeps: f64| substeps / clock.substeps_per_s;
        Ok(Outcome {
            tier: config.tier,
            policy: self.setup.policy,
            agents: robots as u32,
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
            tracking_error_max_rad: self.setup.headings.then_some(tracking.max_rad),
            tracking_error_max_agent: tracking.max_agent,
            tracking_error_mean_m: mean,
            trace_digest: summary.trace_digest,
            contacts: self.log.contacts,
        })
    }
}
