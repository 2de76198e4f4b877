//! The execution of a plan: the loop that both tiers share.

use fleetyard_core::{Digest, Grid, GridPlan, Hasher};
use serde::Serialize;

use crate::bodies::{Bodies, Span};
use crate::config::{SimConfig, Tier};
use crate::contact::Physics;
use crate::convert::cell_center_m;
use crate::error::SimError;
use crate::event::{Contacts, Event, Log};
use crate::kinematic::{Engine, Kinematic, Nearest, Scene};
use crate::pairs::{Pairs, TooManyPairs};
use crate::reference::Reference;
use crate::statics::Statics;
use crate::trace::{
    self, Bounds, Cells, Digests, EventsDigest, Header, Outline, Profile, Scene as TraceScene,
    States, StatesDigest, TraceSink,
};

/// How near an agent came to another one, between centres.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Approach {
    /// Least distance between the centres, in metres.
    pub distance_m: f64,
    /// When it was reached first, in simulated seconds.
    pub time_s: f64,
    /// The two agents; the one that was asked about comes first.
    pub agents: [u32; 2],
}

/// What an execution came to.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Outcome {
    /// The tier that executed it.
    pub tier: Tier,
    /// Number of agents.
    pub agents: u32,
    /// Radius of their discs in metres.
    pub radius_m: f64,
    /// Simulated time in seconds: the plan's duration rounded up to whole ticks.
    pub simulated_s: f64,
    /// Number of ticks.
    pub ticks: u64,
    /// Contacts.
    pub contacts: Contacts,
    /// Least distance between the centres of any two agents in metres, over
    /// all time and not only at ticks; `None` if no two came within
    /// [`SimConfig::approach_range_cells`].
    pub nearest_approach_m: Option<f64>,
    /// The same with time and pair.
    pub nearest_approach: Option<Approach>,
    /// The same for every agent. Not serialised: it is as long as the fleet.
    #[serde(skip)]
    pub nearest_approach_by_agent: Vec<Option<Approach>>,
    /// Largest distance between a body and its reference at the end of any
    /// substep, in metres.
    pub tracking_error_max_m: f64,
    /// The agent that it belongs to, the lowest index in ties; `None` if every
    /// body followed its reference exactly.
    pub tracking_error_max_agent: Option<u32>,
    /// Mean over agents and time of the distance between body and reference.
    pub tracking_error_mean_m: f64,
    /// Digest of everything: parameters, map, plan, all states, all events and
    /// the figures above. Equal executions have equal digests, on every machine.
    pub trace_digest: Digest,
}

/// Runs plans.
#[derive(Debug)]
pub struct Execution(());

impl Execution {
    /// Executes `plan` on `grid` and tells `sink` what happens meanwhile.
    ///
    /// Memory is bounded by the map, the number of agents and the crowding, not
    /// by the length of the plan.
    pub fn run(
        grid: &Grid,
        plan: &GridPlan,
        config: &SimConfig,
        sink: &mut dyn TraceSink,
    ) -> Result<Outcome, SimError> {
        config.validate()?;
        check_plan(grid, plan)?;
        let clock = Clock::new(config, plan.horizon())?;
        let statics = Statics::new(grid, config.cell_size_m);
        let reference = Reference::new(grid, plan, config.cell_size_m);
        let bodies = Bodies::at_rest(reference.ax.clone(), reference.ay.clone());
        let (radius, tolerance) = (config.radius_m(), config.touch_tolerance_m());
        match config.tier {
            Tier::Kinematic => {
                let engine = Kinematic {
                    agent_contact_m: 2.0 * radius - tolerance,
                    static_contact_m: radius - tolerance,
                };
                Run::new(grid, plan, config, clock, reference, bodies)
                    .execute(engine, &statics, sink)
            }
            Tier::Contact => {
                let seconds = 1.0 / clock.substeps_per_s;
                let engine = Physics::new(&statics, &bodies, radius - 0.5 * tolerance, seconds);
                Run::new(grid, plan, config, clock, reference, bodies)
                    .execute(engine, &statics, sink)
            }
        }
    }
}

/// Refuses what cannot be executed at all.
fn check_plan(grid: &Grid, plan: &GridPlan) -> Result<(), SimError> {
    // Traces number agents with 32 bits and states with twice as many.
    let most = 1 << 27;
    let agents = plan.agents();
    if agents == 0 {
        return Err(SimError::NoAgents);
    }
    if agents > most {
        return Err(SimError::TooManyAgents { agents, most });
    }
    for (agent, path) in plan.paths().enumerate() {
        if path.is_empty() {
            return Err(SimError::EmptyPath { agent });
        }
        if let Some(time) = path.iter().position(|cell| *cell >= grid.cell_count()) {
            return Err(SimError::OffMap { agent, time });
        }
    }
    Ok(())
}

/// The relation of steps, ticks and substeps. Times are in substeps.
#[derive(Debug, Clone, Copy)]
struct Clock {
    substeps_per_s: f64,
    substeps_per_tick: f64,
    substeps_per_step: f64,
    /// Steps of the plan.
    steps: usize,
    ticks: u64,
}

impl Clock {
    fn new(config: &SimConfig, steps: usize) -> Result<Self, SimError> {
        let substeps_per_tick = f64::from(config.substeps);
        let substeps_per_s = f64::from(config.ticks_hz) * substeps_per_tick;
        // A step that is meant to be a whole number of substeps is one, whatever
        // the rounding of decimal fractions says.
        let exact = config.step_s * substeps_per_s;
        let whole = exact.round();
        let substeps_per_step = if whole >= 1.0 && (exact - whole).abs() <= 1e-9 * whole {
            whole
        } else {
            exact
        };
        let most = (1u64 << 40) as f64;
        let ticks = (steps as f64 * substeps_per_step / substeps_per_tick).ceil();
        if ticks > most {
            return Err(SimError::TooLong { ticks, most });
        }
        Ok(Self {
            substeps_per_s,
            substeps_per_tick,
            substeps_per_step,
            steps,
            ticks: ticks as u64,
        })
    }

    fn step_start(&self, step: usize) -> f64 {
        step as f64 * self.substeps_per_step
    }

    fn tick_start(&self, tick: u64) -> f64 {
        tick as f64 * self.substeps_per_tick
    }

    fn end(&self) -> f64 {
        self.tick_start(self.ticks)
    }
}

fn header(grid: &Grid, plan: &GridPlan, config: &SimConfig) -> Header {
    let side = config.cell_size_m;
    let center = |cell| {
        let (x, y) = cell_center_m(grid, side, cell);
        [x, y]
    };
    let goals = plan.paths().filter_map(|path| path.last().copied());
    let mut parameters = Hasher::new("fleetyard.sim.config/1");
    for value in [
        side,
        config.step_s,
        config.radius_m(),
        config.max_speed_cells_per_step,
        config.approach_range_cells,
    ] {
        parameters.f64(value);
    }
    parameters.u64(u64::from(config.every_substep));
    Header {
        program: concat!("fleetyard ", env!("CARGO_PKG_VERSION")).to_owned(),
        agents: plan.agents() as u32,
        movers: 0,
        ticks_hz: config.ticks_hz,
        substeps: config.substeps,
        tier: config.tier.name().to_owned(),
        policy: "time".to_owned(),
        seed: 0,
        headings: false,
        progress: false,
        state_every: 0,
        bounds_m: Bounds {
            min_x: 0.0,
            min_y: 0.0,
            max_x: f64::from(grid.cols()) * side,
            max_y: f64::from(grid.rows()) * side,
        },
        profiles: vec![Profile {
            name: "disc".to_owned(),
            model: "replay".to_owned(),
            outline: Outline::Disc {
                radius_m: config.radius_m(),
            },
        }],
        digests: Digests {
            world: grid.digest(),
            plan: plan.digest(),
            fleet: Digest(0),
            config: parameters.finish(),
        },
        scene: TraceScene {
            cells: Some(Cells::new(grid, side)),
            polygons_m: Vec::new(),
            profile_of_body: vec![0; plan.agents()],
            goals_m: goals.map(center).collect(),
        },
    }
}

/// How well bodies follow their references.
#[derive(Debug, Default)]
struct Tracking {
    max_m: f64,
    max_agent: Option<u32>,
    /// Sum over agents of metres times substeps.
    sum: f64,
}

impl Tracking {
    fn note(&mut self, agent: u32, error: f64, substeps: f64) {
        if error > self.max_m {
            self.max_m = error;
            self.max_agent = Some(agent);
        }
        self.sum += error * substeps;
    }
}

struct Run<'a> {
    config: &'a SimConfig,
    clock: Clock,
    reference: Reference<'a>,
    bodies: Bodies,
    header: Header,
    pairs: Pairs,
    nearest: Nearest,
    log: Log,
    tracking: Tracking,
    next_tick: u64,
    states: StatesDigest,
    events: EventsDigest,
    /// Agents that are not on their reference, or whose reference is too fast.
    loose: Vec<u32>,
    /// Agents whose way may meet solid cells.
    suspects: Vec<u32>,
    settled: Vec<Event>,
    target_x: Vec<f64>,
    target_y: Vec<f64>,
}

impl<'a> Run<'a> {
    fn new(
        grid: &Grid,
        plan: &GridPlan,
        config: &'a SimConfig,
        clock: Clock,
        reference: Reference<'a>,
        bodies: Bodies,
    ) -> Self {
        let agents = bodies.len();
        let approach_m = config.approach_range_cells * config.cell_size_m;
        let range = approach_m.max(2.0 * config.radius_m());
        Self {
            config,
            clock,
            header: header(grid, plan, config),
            pairs: Pairs::new(range, config.max_pairs),
            nearest: Nearest::new(agents, approach_m),
            log: Log::new(clock.substeps_per_s, config.max_contacts_kept),
            tracking: Tracking::default(),
            next_tick: 0,
            states: StatesDigest::new(agents),
            events: EventsDigest::default(),
            loose: Vec::new(),
            suspects: Vec::new(),
            settled: Vec::new(),
            target_x: vec![0.0; agents],
            target_y: vec![0.0; agents],
            reference,
            bodies,
        }
    }

    fn execute(
        mut self,
        mut engine: impl Engine,
        statics: &Statics,
        sink: &mut dyn TraceSink,
    ) -> Result<Outcome, SimError> {
        sink.begin(&self.header)?;
        // The moment of the start, at which overlapping agents are in contact.
        self.suspects.extend(0..self.bodies.len() as u32);
        let start = Span {
            start: 0.0,
            end: 0.0,
        };
        self.advance(&mut engine, statics, sink, start, 0.0, true)?;
        for step in 0..=self.clock.steps {
            // The last one is the rest of the last tick.
            let (start, end) = (self.clock.step_start(step), self.clock.step_start(step + 1));
            let end = end.min(self.clock.end());
            if start >= end {
                break;
            }
            self.step(&mut engine, statics, sink, step, Span { start, end })?;
        }
        let end = self.clock.end();
        engine.finish(end, statics, &self.bodies, &mut self.log.pending);
        self.settle(sink, f64::INFINITY)?;
        let (x, y) = (&self.bodies.x0, &self.bodies.y0);
        tell_state(&mut self.states, sink, self.next_tick, x, y)?;
        self.outcome(sink)
    }

    /// Executes one step of the plan.
    fn step(
        &mut self,
        engine: &mut impl Engine,
        statics: &Statics,
        sink: &mut dyn TraceSink,
        step: usize,
        span: Span,
    ) -> Result<(), SimError> {
        self.reference.load(step);
        let cell = self.config.cell_size_m;
        let speed = self.config.max_speed_cells_per_step * cell;
        let travel = self.sort_out(statics, speed);
        if engine.takes_long_spans() && self.loose.is_empty() && !self.config.every_substep {
            self.bodies.x1.copy_from_slice(&self.reference.bx);
            self.bodies.y1.copy_from_slice(&self.reference.by);
            self.advance(engine, statics, sink, span, travel, false)?;
            self.turn_over();
            return Ok(());
        }
        let mut now = span.start;
        while now < span.end {
            let piece = Span {
                start: now,
                end: (now.floor() + 1.0).min(span.end),
            };
            let most = speed * piece.length() / self.clock.substeps_per_step;
            self.aim(step, piece, most);
            self.advance(engine, statics, sink, piece, most, false)?;
            self.measure(piece);
            self.turn_over();
            now = piece.end;
        }
        Ok(())
    }

    /// Finds the agents that need care in this step and how far the farthest
    /// one of the others goes.
    fn sort_out(&mut self, statics: &Statics, speed: f64) -> f64 {
        let reference = &self.reference;
        self.loose.clear();
        self.suspects.clear();
        let limit = speed * speed;
        let mut farthest = 0f64;
        for agent in 0..self.bodies.len() {
            let dx = reference.bx[agent] - reference.ax[agent];
            let dy = reference.by[agent] - reference.ay[agent];
            let squared = dx * dx + dy * dy;
            let on_track = self.bodies.x0[agent].to_bits() == reference.ax[agent].to_bits()
                && self.bodies.y0[agent].to_bits() == reference.ay[agent].to_bits();
            let loose = !on_track || squared > limit;
            if loose {
                self.loose.push(agent as u32);
            } else {
                farthest = farthest.max(squared);
            }
            if loose || !statics.way_is_clear(reference.from[agent], reference.to[agent]) {
                self.suspects.push(agent as u32);
            }
        }
        farthest.sqrt()
    }

    /// Where bodies should be at the end of a piece of a step, given how far
    /// the reference can be followed in that time.
    fn aim(&mut self, step: usize, piece: Span, most: f64) {
        let (start, length) = (self.clock.step_start(step), self.clock.substeps_per_step);
        let fraction = (piece.end - start) / length;
        if fraction >= 1.0 {
            self.target_x.copy_from_slice(&self.reference.bx);
            self.target_y.copy_from_slice(&self.reference.by);
        } else {
            self.reference
                .at(fraction, &mut self.target_x, &mut self.target_y);
        }
        self.bodies.x1.copy_from_slice(&self.target_x);
        self.bodies.y1.copy_from_slice(&self.target_y);
        for agent in self.loose.iter().map(|agent| *agent as usize) {
            let (x, y) = (self.bodies.x0[agent], self.bodies.y0[agent]);
            let (dx, dy) = (self.target_x[agent] - x, self.target_y[agent] - y);
            let squared = dx * dx + dy * dy;
            if squared > most * most {
                let part = most / squared.sqrt();
                self.bodies.x1[agent] = x + dx * part;
                self.bodies.y1[agent] = y + dy * part;
            }
        }
    }

    /// Compares bodies with their references at the end of a piece.
    fn measure(&mut self, piece: Span) {
        let (bodies, substeps) = (&self.bodies, piece.length());
        for agent in 0..bodies.len() {
            let dx = self.target_x[agent] - bodies.x1[agent];
            let dy = self.target_y[agent] - bodies.y1[agent];
            if dx != 0.0 || dy != 0.0 {
                let error = (dx * dx + dy * dy).sqrt();
                self.tracking.note(agent as u32, error, substeps);
            }
        }
    }

    fn turn_over(&mut self) {
        self.bodies.turn_over();
    }

    /// Lets the engine run through a span and passes on what can be told.
    fn advance(
        &mut self,
        engine: &mut impl Engine,
        statics: &Statics,
        sink: &mut dyn TraceSink,
        span: Span,
        travel: f64,
        first: bool,
    ) -> Result<(), SimError> {
        // A list lasts for a quarter of a step, or for the span if that is longer.
        let horizon = 0.25 * self.config.max_speed_cells_per_step * self.config.cell_size_m;
        let horizon = if travel > horizon { travel } else { horizon };
        self.pairs
            .cover(&self.bodies, travel * (1.0 + 1e-6), horizon)
            .map_err(|TooManyPairs| SimError::TooDense {
                most: self.config.max_pairs,
                time_s: span.start / self.clock.substeps_per_s,
            })?;
        let scene = Scene {
            span,
            statics,
            pairs: self.pairs.list(),
            suspects: &self.suspects,
            first,
        };
        engine.advance(
            &scene,
            &mut self.bodies,
            &mut self.nearest,
            &mut self.log.pending,
        )?;
        self.tell_states(sink, span)?;
        self.settle(sink, span.end)
    }

    /// Hashes and passes on the states at the ticks that start in a span.
    fn tell_states(&mut self, sink: &mut dyn TraceSink, span: Span) -> Result<(), SimError> {
        let bodies = &self.bodies;
        loop {
            let when = self.clock.tick_start(self.next_tick);
            if when >= span.end {
                return Ok(());
            }
            if when <= span.start {
                tell_state(
                    &mut self.states,
                    sink,
                    self.next_tick,
                    &bodies.x0,
                    &bodies.y0,
                )?;
            } else {
                let fraction = (when - span.start) / span.length();
                let (x, y) = (&mut self.target_x, &mut self.target_y);
                interpolate(&bodies.x0, &bodies.x1, fraction, x);
                interpolate(&bodies.y0, &bodies.y1, fraction, y);
                tell_state(&mut self.states, sink, self.next_tick, x, y)?;
            }
            self.next_tick += 1;
        }
    }

    /// Hashes and passes on the events that nothing can precede any more.
    fn settle(&mut self, sink: &mut dyn TraceSink, now: f64) -> Result<(), SimError> {
        self.log.settle(now, &mut self.settled);
        if self.settled.is_empty() {
            return Ok(());
        }
        self.events.update(&self.settled);
        sink.events(&self.settled)?;
        Ok(())
    }

    fn outcome(self, sink: &mut dyn TraceSink) -> Result<Outcome, SimError> {
        let nearest = &self.nearest;
        let by_agent: Vec<Option<Approach>> = (0..self.bodies.len())
            .map(|agent| {
                nearest.squared[agent].is_finite().then(|| Approach {
                    distance_m: nearest.squared[agent].sqrt(),
                    time_s: nearest.when[agent] / self.clock.substeps_per_s,
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
        let duration = self.clock.end() * self.bodies.len() as f64;
        let mean = if duration > 0.0 {
            self.tracking.sum / duration
        } else {
            0.0
        };
        let summary = trace::Summary {
            ticks: self.clock.ticks,
            simulated_s: self.clock.end() / self.clock.substeps_per_s,
            contacts_agent_agent: self.log.contacts.agent_agent,
            contacts_agent_obstacle: self.log.contacts.agent_obstacle,
            nearest_approach_m: overall.map(|approach| approach.distance_m),
            tracking_error_max_m: self.tracking.max_m,
            tracking_error_mean_m: mean,
            states_digest: self.states.finish(),
            events_digest: self.events.finish(),
            trace_digest: Digest(0),
        }
        .sealed(&self.header);
        sink.end(&summary)?;
        Ok(Outcome {
            tier: self.config.tier,
            agents: self.bodies.len() as u32,
            radius_m: self.config.radius_m(),
            simulated_s: summary.simulated_s,
            ticks: summary.ticks,
            contacts: self.log.contacts,
            nearest_approach_m: summary.nearest_approach_m,
            nearest_approach: overall,
            nearest_approach_by_agent: by_agent,
            tracking_error_max_m: self.tracking.max_m,
            tracking_error_max_agent: self.tracking.max_agent,
            tracking_error_mean_m: mean,
            trace_digest: summary.trace_digest,
        })
    }
}

fn interpolate(from: &[f64], to: &[f64], fraction: f64, out: &mut [f64]) {
    for ((out, a), b) in out.iter_mut().zip(from).zip(to) {
        *out = a + (b - a) * fraction;
    }
}

fn tell_state(
    digest: &mut StatesDigest,
    sink: &mut dyn TraceSink,
    tick: u64,
    x_m: &[f64],
    y_m: &[f64],
) -> Result<(), SimError> {
    let states = States {
        x_m,
        y_m,
        heading_rad: None,
        progress: None,
    };
    digest.update(&states);
    sink.state(tick, &states)?;
    Ok(())
}
