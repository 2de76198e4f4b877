//! The execution of a plan, block by block.
//!
//! A block is a step of a grid plan if all agents follow the plan exactly, and a message
//! period otherwise.

use fleetyard_core::TrajectoryPlan;

use crate::chunk::CHUNK;
use crate::config::Policy;
use crate::control::Releases;
use crate::engine::{Engine, Guide};
use crate::error::SimError;
use crate::gate::{Gates, Refined, Routes};
use crate::outcome::Outcome;
use crate::route::{Plan, Reference};
use crate::trace::{TraceSink, WaitLog};
use crate::track::Span;

/// The execution ends after this time without progress of any agent, in seconds.
const STALL_S: f64 = 600.0;

/// Interval between checks for progress, in seconds.
const LOOK_S: f64 = 10.0;

/// A body within this distance of its last checked position, in cells, has made no
/// progress: one that pushes against a wall trembles for ever.
const NOWHERE_CELLS: f64 = 0.25;

/// The execution of a plan under way.
pub(crate) struct Run<'a> {
    engine: Engine<'a>,
    plan: Plan<'a>,
    reference: Reference<'a>,
    gates: Option<Gates>,
    /// Per agent, the reason of its wait in this block; empty without gates.
    waits: WaitLog,
    /// Time of the last observed progress, and the positions of all bodies then.
    moved: f64,
    were: Vec<[f64; 2]>,
    /// Time of the last check for progress.
    looked: f64,
}

/// Motion of the agents under a plan.
fn guide<'g>(
    engine: &Engine<'_>,
    plan: Plan<'_>,
    reference: &'g Reference<'g>,
    refined: Option<&'g Refined<'g, Reference<'g>>>,
    gates: Option<&'g Gates>,
) -> Guide<'g> {
    if engine.setup.exact {
        return Guide::Follow(reference);
    }
    let trajectories = match plan {
        Plan::Grid(_) => None,
        Plan::Trajectories(plan) => Some(plan),
    };
    Guide::Drive {
        routes: match refined {
            Some(refined) => refined as &dyn Routes,
            None => reference,
        },
        headings: trajectories.is_some_and(TrajectoryPlan::has_headings),
        chase: engine.setup.policy == Policy::Time && trajectories.is_some(),
        releases: match gates {
            Some(gates) => Releases::Order(gates.released()),
            None => Releases::Time,
        },
    }
}

impl<'a> Run<'a> {
    pub(crate) fn new(
        engine: Engine<'a>,
        plan: Plan<'a>,
        reference: Reference<'a>,
        gates: Option<Gates>,
    ) -> Self {
        Self {
            engine,
            plan,
            reference,
            waits: WaitLog::default(),
            gates,
            moved: 0.0,
            were: Vec::new(),
            looked: f64::NEG_INFINITY,
        }
    }

    pub(crate) fn execute(mut self, sink: &mut dyn TraceSink) -> Result<Outcome, SimError> {
        let (engine, reference) = (&self.engine, &self.reference);
        let mut header = engine
            .setup
            .header(&engine.shapes, Some(reference), sink.wants_scene());
        header.waits = self.gates.is_some();
        sink.begin(&header)?;
        let limit = self.limit()?;
        self.with_guide(|engine, guide| engine.start(guide, sink))?;
        self.look_around(0.0);
        self.engine.check_starts(limit <= 0.0)?;
        let mut number = 0;
        let mut now = 0.0;
        loop {
            let end = self.end_of_block(number + 1).min(limit);
            let block = Span { start: now, end };
            if block.length() <= 0.0 {
                break;
            }
            self.advance(block, number, sink)?;
            (now, number) = (end, number + 1);
            if self.is_over(now) {
                break;
            }
        }
        self.with_guide(|engine, guide| engine.end(now, number, guide, sink))?;
        let end = self.engine.last_tick();
        let arrivals: Vec<f64> = self.arrivals(end).collect();
        self.engine.outcome(&header, arrivals.into_iter(), sink)
    }

    /// Calls `job` with the engine and the agents' motion.
    fn with_guide<R>(&mut self, job: impl FnOnce(&mut Engine<'a>, &Guide<'_>) -> R) -> R {
        let gates = self.gates.as_ref();
        let refined = gates.map(|gates| gates.graph().routes(&self.reference));
        let guide = guide(
            &self.engine,
            self.plan,
            &self.reference,
            refined.as_ref(),
            gates,
        );
        job(&mut self.engine, &guide)
    }

    /// Executes a block: messages, motion, and the knots that agents reach.
    fn advance(
        &mut self,
        block: Span,
        number: u64,
        sink: &mut dyn TraceSink,
    ) -> Result<(), SimError> {
        if let Some(gates) = &mut self.gates {
            gates.exchange(number);
            let tick = number * self.engine.setup.clock.ticks_per_period;
            let agents = self.engine.setup.agents;
            let changes = self
                .waits
                .changes(tick, agents, |agent| gates.awaited(agent));
            if !changes.is_empty() {
                sink.waits(&changes)?;
            }
        }
        self.with_guide(|engine, guide| engine.advance(block, number, guide, sink))?;
        if let Some(gates) = &mut self.gates {
            for chunk in &self.engine.chunks {
                for (lane, pilot) in chunk.pilots.iter().enumerate() {
                    gates.done(chunk.first as usize + lane, pilot.done as usize);
                }
            }
        }
        self.look_around(block.end);
        Ok(())
    }

    /// Latest end of the execution.
    fn limit(&self) -> Result<f64, SimError> {
        let (config, clock) = (self.engine.setup.config, self.engine.setup.clock);
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

    /// True if the execution continues until all agents have arrived.
    fn goes_on(&self) -> bool {
        let setup = &self.engine.setup;
        !setup.exact && (setup.config.until_done || setup.policy == Policy::Adg)
    }

    fn end_of_block(&self, count: u64) -> f64 {
        let setup = &self.engine.setup;
        match self.plan {
            Plan::Grid(_) if setup.exact && !setup.config.every_substep => {
                setup.clock.step_start(count)
            }
            _ => setup.clock.tick_start(count * setup.clock.ticks_per_period),
        }
    }

    /// True once all agents have arrived or none makes progress.
    fn is_over(&self, now: f64) -> bool {
        if !self.goes_on() {
            return false;
        }
        let mut pilots = self.engine.chunks.iter().flat_map(|chunk| &chunk.pilots);
        pilots.all(|pilot| pilot.arrival.is_finite())
            || now - self.moved > STALL_S * self.engine.setup.clock.substeps_per_s
    }

    /// Checks for progress every [`LOOK_S`] seconds.
    fn look_around(&mut self, now: f64) {
        if now - self.looked < LOOK_S * self.engine.setup.clock.substeps_per_s {
            return;
        }
        self.looked = now;
        let places = &self.engine.places;
        let far = NOWHERE_CELLS * self.engine.setup.config.cell_size_m;
        let is = |place: &[f64; 3]| [place[0], place[1]];
        let elsewhere = |(place, were): (&[f64; 3], &[f64; 2])| {
            let (dx, dy) = (place[0] - were[0], place[1] - were[1]);
            dx * dx + dy * dy > far * far
        };
        let first = self.were.len() != places.len();
        if first || places.iter().zip(&self.were).any(elsewhere) {
            self.were = places.iter().map(is).collect();
            self.moved = now;
        }
    }

    /// Times of arrival in substeps; infinite for agents that have not arrived by `end`.
    fn arrivals(&self, end: f64) -> impl Iterator<Item = f64> {
        (0..self.engine.setup.agents).map(move |agent| {
            if self.engine.setup.exact {
                let when = self.reference.time(agent, self.reference.last(agent));
                if when <= end { when } else { f64::INFINITY }
            } else {
                self.engine.chunks[agent / CHUNK].pilots[agent % CHUNK].arrival
            }
        })
    }
}
