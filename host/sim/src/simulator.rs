//! The simulator: setup, validation and start of executions.

use std::borrow::Cow;

use fleetyard_core::{Digest, Grid, GridPlan, Roadmap, TrajectoryPlan};
use fleetyard_world::{Demand, Pose, Shape, Workspace};

use crate::chunk::{CHUNK, Chunk};
use crate::clock::Clock;
use crate::config::{Policy, SimConfig, Tier};
use crate::control::Pilot;
use crate::engine::Engine;
use crate::error::SimError;
use crate::execution::Run;
use crate::gate::{DependencyGraph, GateOptions, Gates, Routes};
use crate::kinematic::Shapes;
use crate::motion::{Fleet, Model, Pebble, Profile, smooth};
use crate::obstacles::Obstacles;
use crate::outcome::Outcome;
use crate::route::{Place, Plan, Reference};
use crate::setup::Setup;
use crate::solved::Solved;
use crate::trace::TraceSink;
use crate::workers::Workers;

/// Executes plans in a world.
///
/// Without a fleet every agent is a pebble: a disc of
/// [`SimConfig::radius_m`] that follows the plan exactly.
#[derive(Debug, Clone, Copy)]
pub struct Simulator<'a> {
    grid: Option<&'a Grid>,
    workspace: Option<&'a Workspace>,
    fleet: Option<&'a Fleet>,
    roadmap: Option<&'a Roadmap>,
    headings: &'a [Option<f64>],
    trailers: &'a [Option<f64>],
    /// The car of each trailer; trailers are the last agents.
    cars: &'a [u32],
    config: &'a SimConfig,
}

impl<'a> Simulator<'a> {
    /// A simulator of an empty, unbounded plane.
    pub fn new(config: &'a SimConfig) -> Self {
        Self {
            grid: None,
            workspace: None,
            fleet: None,
            roadmap: None,
            headings: &[],
            trailers: &[],
            cars: &[],
            config,
        }
    }

    /// Adds a map, whose lower left corner is the origin. Plans on grids need one.
    #[must_use]
    pub fn on_grid(self, grid: &'a Grid) -> Self {
        Self {
            grid: Some(grid),
            ..self
        }
    }

    /// Adds the bounds, obstacles and moving obstacles of a workspace.
    #[must_use]
    pub fn in_workspace(self, workspace: &'a Workspace) -> Self {
        Self {
            workspace: Some(workspace),
            ..self
        }
    }

    /// Uses the robots of a fleet as agents.
    #[must_use]
    pub fn with_fleet(self, fleet: &'a Fleet) -> Self {
        Self {
            fleet: Some(fleet),
            ..self
        }
    }

    /// Adds the roadmap of the plan, which traces show.
    #[must_use]
    pub fn over_roadmap(self, roadmap: &'a Roadmap) -> Self {
        Self {
            roadmap: Some(roadmap),
            ..self
        }
    }

    /// Adds headings of agents at the start of a plan that gives none, in radians: in place of
    /// [`SimConfig::start_heading_rad`], where an agent has one.
    #[must_use]
    pub fn facing(self, headings: &'a [Option<f64>]) -> Self {
        Self { headings, ..self }
    }

    /// Adds headings of trailers at the start, in radians; where an agent has none, its trailer is in
    /// line with the car.
    #[must_use]
    pub fn towing(self, trailers: &'a [Option<f64>]) -> Self {
        Self { trailers, ..self }
    }

    /// Executes a plan and reports its events to `sink`.
    ///
    /// A trailer is a body of its own: an agent after all those of the plan, in the order of their cars,
    /// which it neither touches nor comes near.
    ///
    /// Memory is bounded by the map, the number of agents, the crowding and, if
    /// agents go by order, the dependencies between them.
    pub fn run<'p>(
        &self,
        plan: impl Into<Plan<'p>>,
        sink: &mut dyn TraceSink,
    ) -> Result<Outcome, SimError> {
        let plan = plan.into();
        self.check(plan)?;
        self.check_cars(plan)?;
        if let Some(fleet) = self.fleet.filter(|fleet| fleet.has_trailers())
            && let Plan::Trajectories(plan) = plan
        {
            let (trains, fleet, cars) = self.trains(plan, fleet)?;
            let with_trailers = Simulator {
                fleet: Some(&fleet),
                cars: &cars,
                ..*self
            };
            return with_trailers.run_bodies(Plan::Trajectories(&trains), sink);
        }
        self.run_bodies(plan, sink)
    }

    fn run_bodies(&self, plan: Plan<'_>, sink: &mut dyn TraceSink) -> Result<Outcome, SimError> {
        let smoothed = self.smoothed(plan)?;
        let plan = smoothed.as_ref().map_or(plan, Plan::Trajectories);
        let workers = Workers::new(self.config.threads);
        workers.run(|| match plan {
            // An agent stays where its path ends: a path that ends in waits is the same
            // plan.
            Plan::Grid(plan) => {
                let waits =
                    |path: &[u32]| path.len() > 1 && path[path.len() - 2] == path[path.len() - 1];
                let plan: Cow<'_, GridPlan> = if plan.paths().any(waits) {
                    Cow::Owned(plan.trimmed())
                } else {
                    Cow::Borrowed(plan)
                };
                self.execute(Plan::Grid(&plan), workers, sink)
            }
            Plan::Trajectories(_) => self.execute(plan, workers, sink),
        })
    }

    /// Refuses plans that cannot be executed at all.
    fn check(&self, plan: Plan<'_>) -> Result<(), SimError> {
        self.check_agents(plan.agents())?;
        let Plan::Grid(plan) = plan else {
            return Ok(());
        };
        let Some(grid) = self.grid else {
            return Err(SimError::NoMap);
        };
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

    /// Refuses cars where they cannot be executed: they follow trajectories exactly, by time.
    fn check_cars(&self, plan: Plan<'_>) -> Result<(), SimError> {
        let Some(agent) = self.first_car(plan.agents()) else {
            return Ok(());
        };
        let config = self.config;
        let reason = match plan {
            Plan::Grid(_) => "a plan on a grid",
            Plan::Trajectories(plan) if !plan.has_headings() => "a plan without headings",
            Plan::Trajectories(_) if config.policy != Policy::Time => "an execution by order",
            Plan::Trajectories(_) if config.tier != Tier::Kinematic => "the contact tier",
            Plan::Trajectories(_) if config.disturbance.moves_agents() => "disturbances",
            Plan::Trajectories(_) if config.smooth_m > 0.0 => "corners that are rounded",
            Plan::Trajectories(_) => return Ok(()),
        };
        Err(SimError::Car { agent, reason })
    }

    /// The first agent that is a car.
    pub(crate) fn first_car(&self, agents: usize) -> Option<usize> {
        let is_car = |agent: &usize| matches!(self.model(*agent), Some(Model::Car(_)));
        (0..agents).find(is_car)
    }

    /// A plan and a fleet with trailers as agents of their own, and their cars.
    fn trains(
        &self,
        plan: &TrajectoryPlan,
        fleet: &Fleet,
    ) -> Result<(TrajectoryPlan, Fleet, Vec<u32>), SimError> {
        let mut trains = TrajectoryPlan::with_capacity(2 * plan.agents(), 2 * plan.knot_count());
        for knots in plan.paths() {
            trains.push_path(knots.iter())?;
        }
        let mut profiles = fleet.profiles().to_vec();
        let mut profile_of = fleet.profile_of().to_vec();
        let (mut cars, mut kinds) = (Vec::new(), vec![None; profiles.len()]);
        for agent in 0..fleet.agents() {
            let Some((trailer, _)) = fleet.trailer(agent) else {
                continue;
            };
            let knots = plan.knots(agent);
            let given = self.trailers.get(agent).copied().flatten();
            let heading = given.or(knots.get(0).heading_rad).unwrap_or(0.0);
            let towed = trailer.follow(knots, heading, MOST_TOWED_KNOTS);
            let towed = towed.ok_or(SimError::LongTow { agent })?;
            trains.push_path(towed.knots)?;
            cars.push(agent as u32);
            let own = fleet.profile_of()[agent] as usize;
            let kind = *kinds[own].get_or_insert_with(|| {
                profiles.push(Profile {
                    footprint: trailer.footprint(),
                    model: Model::Pebble(Pebble::default()),
                });
                profiles.len() as u32 - 1
            });
            profile_of.push(kind);
        }
        let fleet = Fleet::new(profiles, profile_of).map_err(|error| SimError::Config {
            field: "fleet",
            value: "a trailer".to_owned(),
            reason: "is no robot",
            hint: error.hint(),
        })?;
        Ok((trains, fleet, cars))
    }

    /// The plan with round corners, if they are asked for: agents go by its times or its order, as
    /// by those of any other plan.
    fn smoothed(&self, plan: Plan<'_>) -> Result<Option<TrajectoryPlan>, SimError> {
        let config = self.config;
        if config.smooth_m <= 0.0 {
            return Ok(None);
        }
        let by_order = config.policy == Policy::Adg;
        let stops = |model: &Model| by_order && !is_pebble(model) && !model.keeps_headings();
        let mut agents = (0..plan.agents()).map(|agent| (agent, self.model(agent)));
        let stopper = agents.find_map(|(agent, model)| Some((agent, model.filter(|m| stops(m))?)));
        if let Some((agent, model)) = stopper {
            let model = model.name();
            return Err(SimError::Corners { agent, model });
        }
        let radius_m = |agent: usize| {
            let shape = self.fleet.map(|fleet| fleet.shape(agent));
            let turns = shape.filter(|shape| !shape.is_disc());
            turns.map_or(0.0, Shape::effective_radius_m)
        };
        let smoothed = match (plan, self.grid) {
            (Plan::Trajectories(plan), _) => smooth(plan, config.smooth_m, &radius_m)?,
            (Plan::Grid(_), None) => return Err(SimError::NoMap),
            (Plan::Grid(plan), Some(grid)) => {
                let (side_m, step_s) = (config.cell_size_m, config.step_s);
                let placed = TrajectoryPlan::from_grid(plan, grid, side_m, step_s)?;
                smooth(&placed, config.smooth_m, &radius_m)?
            }
        };
        Ok(Some(smoothed))
    }

    /// Refuses parameters out of range, and invalid numbers of agents.
    pub(crate) fn check_agents(&self, agents: usize) -> Result<(), SimError> {
        self.config.validate()?;
        // Traces number agents with 32 bits and states with twice as many.
        let most = 1 << 27;
        if agents == 0 {
            return Err(SimError::NoAgents);
        }
        if agents > most {
            return Err(SimError::TooManyAgents { agents, most });
        }
        if let Some(limit) = self.config.memory_limit_bytes {
            let needed = self.memory_bytes(agents);
            if needed > limit {
                return Err(SimError::TooLarge {
                    agents,
                    needed,
                    limit,
                });
            }
        }
        if let Some(fleet) = self
            .fleet
            .map(Fleet::agents)
            .filter(|fleet| *fleet != agents)
        {
            return Err(SimError::OtherFleet { agents, fleet });
        }
        Ok(())
    }

    /// Estimate of an execution's memory in bytes, without the map, the plan and
    /// crowding, as `benches/table.rs` measures it, rounded up. Crowds, and dependencies
    /// between agents beyond a few steps, come on top.
    pub fn memory_bytes(&self, agents: usize) -> u64 {
        let driven = match self.fleet {
            Some(fleet) => fleet
                .profiles()
                .iter()
                .any(|profile| !is_pebble(&profile.model)),
            None => self.config.policy == Policy::Adg,
        };
        agents as u64 * if driven { 900 } else { 500 }
    }

    fn model(&self, agent: usize) -> Option<&'a Model> {
        Some(self.fleet?.model(agent))
    }

    /// Heading of an agent at the start of a plan without headings.
    fn start_heading_rad(&self, agent: usize) -> f64 {
        let given = self.headings.get(agent).copied().flatten();
        given.unwrap_or_else(|| {
            // A body without a model has no heading of its own: plans give it.
            if self.model(agent).is_none_or(is_pebble) {
                0.0
            } else {
                self.config.start_heading_rad
            }
        })
    }

    fn shapes(&self, agents: usize) -> Result<Shapes, SimError> {
        let mut shapes = match self.fleet {
            Some(fleet) => Shapes {
                kinds: fleet.shapes().to_vec(),
                of_body: if fleet.profiles().len() > 1 {
                    fleet.profile_of().to_vec()
                } else {
                    Vec::new()
                },
            },
            None => Shapes {
                kinds: vec![self.config.footprint()?],
                of_body: Vec::new(),
            },
        };
        let movers = self
            .workspace
            .map_or(&[][..], |workspace| &workspace.movers);
        if !movers.is_empty() {
            shapes.of_body.resize(agents, 0);
            for mover in movers {
                shapes.of_body.push(shapes.kinds.len() as u32);
                shapes.kinds.push(mover.shape().clone());
            }
        }
        Ok(shapes)
    }

    fn execute(
        &self,
        plan: Plan<'_>,
        workers: Workers,
        sink: &mut dyn TraceSink,
    ) -> Result<Outcome, SimError> {
        let (config, agents) = (self.config, plan.agents());
        let clock = Clock::new(config);
        let substeps_per_s = clock.substeps_per_s;
        let reference = match (plan, self.grid) {
            (Plan::Grid(plan), Some(grid)) => Reference::Grid {
                grid,
                plan,
                cell_size_m: config.cell_size_m,
                substeps_per_step: clock.substeps_per_step,
                substeps_per_s,
            },
            (Plan::Grid(_), None) => return Err(SimError::NoMap),
            (Plan::Trajectories(plan), _) => Reference::Trajectories {
                plan,
                substeps_per_s,
            },
        };
        let by_time = config.policy == Policy::Time;
        if by_time && let Plan::Trajectories(plan) = plan {
            self.check_speeds(plan)?;
        }
        // Undisturbed pebbles move with the plan's clock.
        let ideal = self.models().into_iter().flatten().all(is_pebble);
        let kinematic = config.tier == Tier::Kinematic;
        let crowd = Crowd {
            agents,
            policy: config.policy,
            exact: kinematic && ideal && by_time && !config.disturbance.moves_agents(),
            headings: matches!(plan, Plan::Trajectories(plan) if plan.has_headings()),
            plan: plan.digest(),
            start: &|agent| reference.place(agent, 0),
        };
        let engine = self.engine(workers, &crowd)?;
        let gates = if by_time {
            None
        } else {
            let (shapes, models) = (&engine.shapes, &engine.setup.models);
            let swept = swept_shapes(shapes, models, crowd.headings);
            let needed_m = 2.0 * swept.iter().map(|swept| swept.off_m).fold(0.0, f64::max);
            let options = GateOptions {
                margin_m: config.margin_m + needed_m,
                least_margin_m: if config.tight { 0.0 } else { needed_m },
                cell_size_m: matches!(plan, Plan::Grid(_)).then_some(config.cell_size_m),
                ..GateOptions::default()
            };
            let shape_of = |agent: usize| {
                let kind = shapes.kind_of(agent as u32);
                swept[kind].disc.as_ref().unwrap_or(&shapes.kinds[kind])
            };
            let heading_rad = |agent: usize| self.start_heading_rad(agent);
            let routes = Headed {
                routes: &reference,
                heading_rad: (!crowd.headings).then_some(&heading_rad as _),
            };
            let graph = DependencyGraph::build(&routes, &shape_of, &options)?;
            let (messages, seed) = (&config.disturbance.messages, config.disturbance.seed);
            Some(Gates::with_messages(
                graph,
                messages,
                seed,
                clock.period_s(),
            ))
        };
        Run::new(engine, plan, reference, gates).execute(sink)
    }

    /// Model of each kind of robot; a kind without a model follows its reference exactly.
    fn models(&self) -> Vec<Option<&'a Model>> {
        match self.fleet {
            Some(fleet) => {
                let profiles = fleet.profiles().iter();
                profiles.map(|profile| Some(&profile.model)).collect()
            }
            None => vec![None],
        }
    }

    /// Refuses errors of velocity of bodies that have no velocity of their own.
    fn check_slips(&self, agents: usize) -> Result<(), SimError> {
        if self.config.disturbance.twist.is_none() {
            return Ok(());
        }
        let exact = (0..agents).find_map(|agent| {
            let model = self.model(agent);
            let name = model.map_or("pebble", Model::name);
            model.is_none_or(Model::is_exact).then_some((agent, name))
        });
        match exact {
            Some((agent, model)) => Err(SimError::NoSlip { agent, model }),
            None => Ok(()),
        }
    }

    /// The engine with all agents at the start.
    pub(crate) fn engine(
        &self,
        workers: Workers,
        crowd: &Crowd<'_>,
    ) -> Result<Engine<'a>, SimError> {
        let (config, agents) = (self.config, crowd.agents);
        self.check_slips(agents)?;
        let models = self.models();
        let shapes = self.shapes(agents)?;
        let ideal = models.iter().flatten().copied().all(is_pebble);
        let with_heading =
            crowd.headings || !ideal || shapes.kinds.iter().any(|shape| !shape.is_disc());
        let movers = self
            .workspace
            .map_or(&[][..], |workspace| &workspace.movers);
        let start = |body: usize| -> Pose {
            if body >= agents {
                return movers[body - agents].pose_at(0.0);
            }
            let place = (crowd.start)(body);
            let heading = place
                .heading
                .unwrap_or_else(|| self.start_heading_rad(body));
            Pose::new(place.x, place.y, heading)
        };
        let bodies = agents + movers.len();
        let chunks = (0..bodies).step_by(CHUNK).map(|first| {
            let mut chunk = Chunk::new(first as u32, with_heading);
            for body in first..(first + CHUNK).min(bodies) {
                let pose = start(body);
                chunk.x.push(pose.x);
                chunk.y.push(pose.y);
                chunk.heading.push(pose.heading);
                if !crowd.exact && body < agents {
                    chunk.pilots.push(Pilot::new(pose));
                }
            }
            chunk
        });
        let chunks: Vec<Chunk> = chunks.collect();
        let solved = if config.tier == Tier::Kinematic {
            None
        } else {
            let model = |agent: u32| models[shapes.kind_of(agent)];
            let world = (self.grid, self.workspace);
            Some(Solved::new(
                config, world, &shapes, &model, &chunks, agents,
            )?)
        };
        let setup = Setup {
            config,
            clock: Clock::new(config),
            workers,
            agents,
            movers,
            policy: crowd.policy,
            plan: crowd.plan,
            models,
            obstacles: Obstacles::new(self.grid, config.cell_size_m, self.workspace),
            with_heading,
            headings: crowd.headings,
            exact: crowd.exact,
            grid: self.grid,
            workspace: self.workspace,
            fleet: self.fleet,
            cars: self.cars,
            roadmap: self.roadmap,
        };
        Ok(Engine::new(setup, shapes, solved, chunks))
    }

    /// Refuses plan speeds above a model's limit, at which it falls behind for good.
    /// Acceleration limits show in the execution instead.
    fn check_speeds(&self, plan: &TrajectoryPlan) -> Result<(), SimError> {
        for (agent, knots) in plan.paths().enumerate() {
            let Some(model) = self.model(agent) else {
                return Ok(());
            };
            let excesses = model.dynamics().excesses(knots);
            for excess in excesses {
                let what = match excess.demand {
                    Demand::Speed => "moves at",
                    Demand::TurnRate if knots.heading_rad.is_some() => "turns at",
                    _ => continue,
                };
                return Err(SimError::TooFast {
                    agent,
                    knot: excess.knot,
                    what,
                    value: excess.value,
                    most: excess.limit,
                    model: model.name(),
                });
            }
        }
        Ok(())
    }
}

/// Most knots of the motion of one trailer.
const MOST_TOWED_KNOTS: usize = 1 << 22;

/// The agents of an execution.
pub(crate) struct Crowd<'c> {
    pub(crate) agents: usize,
    /// Rule by which agents proceed.
    pub(crate) policy: Policy,
    /// Set if all agents follow the plan exactly, by time.
    pub(crate) exact: bool,
    /// Set if the plan has headings.
    pub(crate) headings: bool,
    /// Digest of the plan.
    pub(crate) plan: Digest,
    /// Initial places.
    pub(crate) start: &'c dyn Fn(usize) -> Place,
}

/// Geometry of a kind of robots for the dependency graph.
struct Swept {
    /// The disc around its footprint, if its heading is unknown: wheels head where their
    /// controllers drive.
    disc: Option<Shape>,
    /// Largest deviation of a point of it from its planned sweep, in metres; 0 where it is
    /// rounding alone.
    off_m: f64,
}

/// For every kind of robots, the accuracy of the routes' poses: the tolerances of the model,
/// of place and, where the footprint is no disc, of heading.
fn swept_shapes(shapes: &Shapes, models: &[Option<&Model>], headings: bool) -> Vec<Swept> {
    let kinds = shapes.kinds.iter().zip(models);
    kinds
        .map(|(shape, model)| {
            let Some(model) = model else {
                return Swept {
                    disc: None,
                    off_m: 0.0,
                };
            };
            let drives_as_it_heads = !is_pebble(model) && !model.keeps_headings();
            let disc = (drives_as_it_heads && !shape.is_disc()).then(|| shape.enclosing_disc());
            if model.is_exact() {
                return Swept { disc, off_m: 0.0 };
            }
            let mut off_m = model.arrival_tolerance_m().max(model.lateral_tolerance_m());
            // A heading that nothing asks for does not change at all.
            if headings && disc.is_none() && !shape.is_disc() {
                off_m += shape.effective_radius_m() * model.heading_tolerance_rad();
            }
            Swept { disc, off_m }
        })
        .collect()
}

/// Routes of which those without headings keep the headings of their starts: so do all bodies
/// that do not drive where they head, which are swept as discs.
struct Headed<'a, R> {
    routes: &'a R,
    /// Heading of an agent at the start, if the routes have none.
    heading_rad: Option<&'a (dyn Fn(usize) -> f64 + Sync)>,
}

impl<R: Routes> Routes for Headed<'_, R> {
    fn agents(&self) -> usize {
        self.routes.agents()
    }

    fn actions(&self, agent: usize) -> usize {
        self.routes.actions(agent)
    }

    fn pose(&self, agent: usize, knot: usize) -> Pose {
        let pose = self.routes.pose(agent, knot);
        match self.heading_rad {
            Some(heading_rad) => Pose::new(pose.x, pose.y, heading_rad(agent)),
            None => pose,
        }
    }

    fn time_s(&self, agent: usize, knot: usize) -> f64 {
        self.routes.time_s(agent, knot)
    }
}

/// True if a model follows its reference without any time to spare.
fn is_pebble(model: &Model) -> bool {
    matches!(model, Model::Pebble(_) | Model::Car(_))
}
