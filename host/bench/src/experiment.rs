//! A suite that is ready to run: its planners found and asked what they are, its instances
//! counted, every trial with its key.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

use fleetyard_abi::c::PluginEntry;
use fleetyard_abi::{Descriptor, Kind};
use fleetyard_check::metrics;
use fleetyard_core::{Connectivity, Digest, Grid, GridPlan, Hasher, InputError};
use fleetyard_runtime::measure::{Cpus, Machine, Reason};
use fleetyard_runtime::{Attach, Discovery, Limit, Policy, Runtime, SandboxReport, Trust};
use fleetyard_sim::{Figures, NoTrace};
use fleetyard_views::Representation;
use serde::Serialize;
use serde_json::{Map, Value, json};

use crate::calibration;
use crate::error::BenchError;
use crate::fleet::{FleetModules, blamed};
use crate::kept;
use crate::options::Robots;
use crate::plan::{Planned, Schedule};
use crate::plugin::{GivenOptions, Plugin, Running};
use crate::record::{self, Ending, Record, milliseconds};
use crate::row::{Incumbent, Row};
use crate::suite::{
    Clock, MazeOrigin, Origin, PlannerSetup, Question, Reuse, Suite, SuiteInstance,
};
use crate::trial::{Host, Outcome, Trial};
use crate::trial_error::TrialError;

/// A suite with its planners and instances.
pub struct Experiment<'s> {
    suite: &'s Suite,
    host: Host,
    planners: Vec<Planner>,
    instances: Vec<SuiteInstance>,
    schedule: Schedule,
    /// The instance of the latest trial: those of one instance follow each other.
    latest: Option<(usize, Question)>,
    pin: Option<Pin>,
}

/// The processors on which planners ran.
#[derive(Debug, Clone, Serialize)]
pub struct Pin {
    /// The processors that they had to themselves.
    pub cpus: Option<Cpus>,
    /// The reason why they had none.
    pub not_pinned: Option<String>,
}

/// A planner of the suite that was found, and has said what it is.
pub struct Planner {
    /// Its name in the suite.
    pub label: String,
    /// Its code.
    pub plugin: Plugin,
    /// Its own description.
    pub descriptor: Descriptor,
    /// Its options, checked.
    pub options: Map<String, Value>,
    /// Its sandbox, once a process of it has ended.
    pub sandbox: Option<SandboxReport>,
    running: Option<Running>,
    /// The rest of its fleet, in a suite of fleets.
    fleet: Option<FleetModules>,
}

impl<'s> Experiment<'s> {
    /// Finds the planners of a suite and starts each of them once, so that a name, an
    /// option or a file that is wrong shows before any budget is spent.
    pub fn new(
        suite: &'s Suite,
        built_in: &'static [&'static PluginEntry],
        trust: Trust,
    ) -> Result<Self, BenchError> {
        let instances = suite.instances()?;
        let apart = suite
            .planners
            .iter()
            .all(|planner| planner.attach != Some(Attach::InProcess));
        let mut sandbox = suite.sandbox.clone();
        sandbox.trust = trust;
        sandbox.policy.hidden.extend(suite.files()?);
        let mut host = Host::new(built_in, suite.budget.clone(), sandbox, apart)?;
        let lifelong = suite.planners.iter().any(|planner| planner.fleet.is_some());
        if suite.protocol.clock == Clock::LessEmpty && !lifelong {
            // Before any planner runs that could be in the way.
            let planners = suite.planners.iter();
            let direct = planners.filter(|planner| planner.attach == Some(Attach::InProcess));
            let attachments: &[Attach] = match direct.count() {
                0 => &[Attach::Worker],
                all if all == suite.planners.len() => &[Attach::InProcess],
                _ => &[Attach::Worker, Attach::InProcess],
            };
            host.calibration = calibration::take(&host, &instances, &suite.config, attachments)?;
        }
        let names = suite.planners.iter().map(|planner| planner.plugin.as_str());
        let discovery = Discovery::from_environment();
        let found = discovery.find_all(&host.runtime, Some(Kind::Planner), names);
        let plugins = suite.planners.iter().zip(found).map(|(setup, found)| {
            let plugin = found
                .and_then(|found| Plugin::new(&host.runtime, found, Kind::Planner, &setup.plugin))
                .map_err(|fault| setup.blamed(fault.into()))?;
            let options = GivenOptions::Values(setup.options.clone());
            Ok(plugin.attached(setup.attach).with_options(options))
        });
        let plugins = plugins.collect::<Result<_, BenchError>>()?;
        Self::of_parts(suite, host, plugins, instances)
    }

    /// Of a suite whose plugins were found already, one for each planner, and whose instances were
    /// read.
    pub fn of_parts(
        suite: &'s Suite,
        host: Host,
        plugins: Vec<Plugin>,
        instances: Vec<SuiteInstance>,
    ) -> Result<Self, BenchError> {
        let discovery = Discovery::from_environment();
        let mut planners = Vec::new();
        for (setup, plugin) in suite.planners.iter().zip(plugins) {
            let keep = suite.protocol.reuse == Reuse::Planner && setup.fleet.is_none();
            let mut planner = Planner::new(setup, plugin, &host.runtime, keep)?;
            if let Some(setup) = &setup.fleet {
                planner.fleet = Some(FleetModules::new(setup, &discovery, &host.runtime)?);
            }
            planners.push(planner);
        }
        let context = context(suite);
        let digests: Vec<Digest> = planners
            .iter()
            .map(|planner| planner.digest(&context))
            .collect();
        for (index, digest) in digests.iter().enumerate() {
            if let Some(twin) = digests[..index].iter().position(|other| other == digest) {
                let reason = format!(
                    "`{}` is the same as `{}`: the same code, options and attachment",
                    planners[index].label, planners[twin].label
                );
                let place = &suite.planners[index].plugin_place;
                return Err(place
                    .error(reason)
                    .hint("remove one of them; `repeats` asks a planner several times")
                    .into());
            }
        }
        let instance_digests = instances
            .iter()
            .map(SuiteInstance::digest)
            .collect::<Result<_, InputError>>()?;
        let protocol = &suite.protocol;
        let schedule = Schedule::new(
            digests,
            instance_digests,
            protocol.seeds.clone(),
            protocol.repeats,
            protocol.warm_ups,
        );
        let schedule = schedule.only(
            &planners.iter().map(Planner::bits).collect::<Vec<u8>>(),
            instances.iter().map(bit_of).collect(),
        );
        check_views(&host, suite, &planners, &instances, &schedule)?;
        Ok(Self {
            suite,
            host,
            planners,
            instances,
            schedule,
            latest: None,
            pin: None,
        })
    }

    /// The suite.
    pub fn suite(&self) -> &'s Suite {
        self.suite
    }

    /// Its trials.
    pub fn schedule(&self) -> &Schedule {
        &self.schedule
    }

    /// Its planners, in the order of the suite.
    pub fn planners(&self) -> &[Planner] {
        &self.planners
    }

    /// Its instances, in the order of the suite.
    pub fn instances(&self) -> &[SuiteInstance] {
        &self.instances
    }

    /// The longest that a trial may take with all of its attempts, if its planner has to be started
    /// for each.
    pub fn longest(&self) -> Duration {
        let attempts = 1 + self.suite.protocol.retry_contended;
        self.longest_attempt().saturating_mul(attempts)
    }

    /// The time that a trial takes whose planner uses its whole budget, and no more.
    pub fn budgeted(&self) -> Duration {
        let drive = self.longest_drive_s();
        if drive > 0.0 {
            return Duration::try_from_secs_f64(drive).unwrap_or(Duration::MAX);
        }
        self.host.budget().wall
    }

    /// The longest time that a fleet of the suite drives.
    fn longest_drive_s(&self) -> f64 {
        let fleets = self
            .planners
            .iter()
            .filter_map(|planner| planner.fleet.as_ref());
        fleets.map(FleetModules::duration_s).fold(0.0, f64::max)
    }

    fn longest_attempt(&self) -> Duration {
        let budget = self.host.budget();
        let drive = self.longest_drive_s();
        if drive > 0.0 {
            // A planner is asked again when its limit is over, so that it takes no longer than
            // the fleet drives, and the rest seldom does.
            let drive = Duration::try_from_secs_f64(2.0 * drive).unwrap_or(Duration::MAX);
            return [budget.startup, budget.prepare_wall(), drive]
                .into_iter()
                .fold(Duration::ZERO, Duration::saturating_add);
        }
        self.host.longest()
    }

    /// Makes a trial. What goes wrong with a planner is in the row; an error is something
    /// that makes going on useless.
    pub fn trial(&mut self, planned: &Planned) -> Result<Row, BenchError> {
        Ok(self.trial_in_full(planned)?.0)
    }

    /// The same, with all there is to say of a planner that was asked for a plan.
    pub fn trial_in_full(
        &mut self,
        planned: &Planned,
    ) -> Result<(Row, Option<Record>), BenchError> {
        let instance = &self.instances[planned.instance];
        let planner = &self.planners[planned.planner];
        let limits = self.host.runtime.limits();
        let unranked = record::unranked(planner.plugin.attach(), limits, None, None, None, []);
        let started_unix_ms = now_unix_ms();
        let mut row = Row {
            key: self.schedule.key(planned),
            trial: planned.number,
            planner: planner.label.clone(),
            planner_id: planner.descriptor.id.clone(),
            planner_version: planner.descriptor.version.clone(),
            planner_digest: Some(planner.plugin.digest().to_string()),
            options: Value::Object(planner.options.clone()).to_string(),
            attach: planner.plugin.attach().name().to_owned(),
            ranked: unranked.is_none(),
            unranked,
            built_in: Some(planner.plugin.is_built_in()),
            instance_digest: instance.digest()?.to_string(),
            agents: instance.agents() as u64,
            connectivity: instance.connectivity().map(Connectivity::degree),
            seed: planned.seed,
            repeat: planned.repeat,
            machine: Machine::here().digest().to_string(),
            started_unix_ms,
            ..Row::default()
        };
        row.place(instance.origin());
        if let (Some(view), Some(problem)) = (instance.view(), instance.problem()) {
            row.representation = Some(view.spec.representation().to_string());
            row.view = Some(view.label.clone());
            row.task_digest = Some(problem.digest().to_string());
        } else {
            row.lie_on(&*instance.grid()?);
        }
        let made = if planner.fleet.is_some() {
            self.drive(planned, &mut row).map(|()| None)
        } else {
            self.plan(planned, &mut row).map(Some)
        };
        let record = made.or_else(|error| {
            let planner = &self.planners[planned.planner];
            let Some(termination) = error.termination() else {
                return Err(BenchError::Trial {
                    planner: planner.label.clone(),
                    error: Box::new(error),
                });
            };
            let (attach, limits) = (planner.plugin.attach(), self.host.runtime.limits());
            row.unranked = record::unranked(attach, limits, None, None, None, error.fault());
            row.ranked = row.unranked.is_none();
            row.termination = termination.to_string();
            row.fault = Some(error.to_string());
            Ok(None)
        })?;
        Ok((row, record))
    }

    /// Refuses planners that do not do what an instance on a grid needs.
    pub fn check_capabilities(&self, instance: &SuiteInstance) -> Result<(), TrialError> {
        if instance.view().is_some() {
            return Ok(());
        }
        let question = instance.question()?;
        let asked = question.trial(self.suite.protocol.path_rule);
        let config = &self.suite.config;
        let map = asked.environment(config);
        self.planners.iter().try_for_each(|planner| {
            asked.check_planner(&self.host, &planner.descriptor, &map, config)
        })
    }

    /// A trial of a plan.
    fn plan(&mut self, planned: &Planned, row: &mut Row) -> Result<Record, TrialError> {
        let suite = self.suite;
        let question = match self.latest.take() {
            Some((index, question)) if index == planned.instance => question,
            _ => {
                let instance = &self.instances[planned.instance];
                instance.question().map_err(|error| match instance.view() {
                    Some(_) if instance.may_lack() => TrialError::NoView(error),
                    _ => error.into(),
                })?
            }
        };
        let (_, question) = &*self.latest.insert((planned.instance, question));
        if let (Question::View(asked), Some(view)) =
            (question, self.instances[planned.instance].view())
        {
            let parameters = view.spec.parameters(&asked.problem, asked.terms);
            row.view_parameters = Some(Value::Object(parameters).to_string());
            row.view_digest = Some(asked.view.digest(&asked.problem).to_string());
            if let Some(cells) = question.cells() {
                row.lie_on(cells.grid());
            }
        }
        let planner = &mut self.planners[planned.planner];
        let budget = self.host.budget();
        row.budget_ms = milliseconds(budget.wall);
        row.threads = Some(budget.threads);
        row.reuse = Some(suite.protocol.reuse.name().to_owned());
        let trial = Trial {
            host: &self.host,
            planner: &planner.plugin,
            instance: question.trial(suite.protocol.path_rule),
            scenario: &row.scenario,
            seed: planned.seed,
            config: &suite.config,
            robots: suite.robots.as_ref(),
            annotations: false,
            follower: None,
        };
        let made = match suite.protocol.reuse {
            Reuse::Planner => trial.run_again(&mut planner.running, &mut NoTrace),
            Reuse::Never => trial.run(&mut NoTrace),
        };
        let Outcome { record, plan, .. } = made.inspect_err(|_| {
            if let Question::Grid(instance) = question {
                let bound = metrics(instance, &GridPlan::default(), suite.config.cell_size_m);
                row.lower_bound_steps = Some(bound.lower_bound_steps);
            }
        })?;
        if record.sandbox.is_some() {
            planner.sandbox.clone_from(&record.sandbox);
        }
        self.pin.get_or_insert_with(|| Pin {
            cpus: record.measurement.cpus.clone(),
            not_pinned: record.measurement.not_pinned.clone(),
        });
        row.fill(&record, suite.protocol.clock);
        if suite.protocol.keep_plans {
            row.plan = plan.and_then(|plan| kept::packed(question, &plan));
        }
        Ok(record)
    }

    /// A trial of a fleet.
    fn drive(&mut self, planned: &Planned, row: &mut Row) -> Result<(), TrialError> {
        let grid = self.instances[planned.instance].grid()?;
        let agents = u32::try_from(row.agents).unwrap_or(u32::MAX);
        let planner = &mut self.planners[planned.planner];
        let Some(fleet) = &planner.fleet else {
            return Err(InputError::new("suite", "there is no such fleet").into());
        };
        fleet.describe(row);
        let runtime = &self.host.runtime;
        let drive = fleet.run(runtime, &planner.plugin, &grid, agents, planned.seed)?;
        drive.fill(row);
        row.unranked = drive.unranked(planner.plugin.attach(), runtime.limits());
        row.ranked = row.unranked.is_none();
        planner.sandbox = drive.sandbox.or(planner.sandbox.take());
        Ok(())
    }

    /// The processors on which planners ran, once one did.
    pub fn pin(&self) -> Option<&Pin> {
        self.pin.as_ref()
    }

    /// Ends the processes that were kept; by then planners know what their sandboxes were.
    pub fn finish(&mut self) {
        for planner in &mut self.planners {
            if let Some(running) = planner.running.take() {
                let closing = running.close();
                planner.sandbox = closing.sandbox.or(planner.sandbox.take());
            }
        }
    }
}

impl PlannerSetup {
    /// An error of the planner at its place in the suite, where a line of it is the cause.
    fn blamed(&self, error: TrialError) -> BenchError {
        match &error {
            TrialError::Fault(fault) if fault.is_of_host() => BenchError::Trial {
                planner: self.label.clone(),
                error: Box::new(error),
            },
            TrialError::Options(_) => blamed(&self.options_place, error),
            _ => blamed(&self.plugin_place, error),
        }
    }
}

impl Planner {
    fn new(
        setup: &PlannerSetup,
        plugin: Plugin,
        runtime: &Runtime,
        keep: bool,
    ) -> Result<Self, BenchError> {
        let running = plugin.start(runtime).map_err(|error| setup.blamed(error))?;
        let mut planner = Self {
            label: setup.label.clone(),
            descriptor: running.descriptor.clone(),
            options: running.options.clone(),
            sandbox: None,
            plugin,
            running: None,
            fleet: None,
        };
        if keep {
            planner.running = Some(running);
        } else {
            planner.sandbox = running.close().sandbox;
        }
        Ok(planner)
    }

    /// The kinds of instances that it is asked, as a [`Schedule`] has them.
    fn bits(&self) -> u8 {
        ON_A_MAP | bits(&self.descriptor)
    }

    /// Stands for the planner as it is asked in this suite.
    fn digest(&self, context: &Value) -> Digest {
        let mut hasher = of_planner(
            self.plugin.digest(),
            &self.descriptor.id,
            self.plugin.attach().name(),
            &Value::Object(self.options.clone()).to_string(),
            context,
        );
        if let Some(fleet) = &self.fleet {
            hasher.bytes(&fleet.digest().0.to_le_bytes());
        }
        hasher.finish()
    }
}

/// The bit of instances on maps, which every planner is asked: one that cannot has trials that fail.
const ON_A_MAP: u8 = 1;

/// The bit of views of a representation.
fn bit(representation: Representation) -> u8 {
    match representation {
        Representation::Grid => 2,
        Representation::Roadmap => 4,
        Representation::Continuous => 8,
    }
}

/// The bits of the views that a planner of this description claims.
fn bits(descriptor: &Descriptor) -> u8 {
    let views = Representation::claimed_in(descriptor.capabilities).map(bit);
    views.fold(0, |bits, view| bits | view)
}

/// The bit of an instance.
fn bit_of(instance: &SuiteInstance) -> u8 {
    let view = instance.view();
    view.map_or(ON_A_MAP, |view| bit(view.spec.representation()))
}

/// Refuses a planner that plans on none of the views, and a view on which no planner plans.
fn check_views(
    host: &Host,
    suite: &Suite,
    planners: &[Planner],
    instances: &[SuiteInstance],
    schedule: &Schedule,
) -> Result<(), BenchError> {
    let all = instances
        .iter()
        .fold(0, |bits, instance| bits | bit_of(instance));
    for (setup, planner) in suite.planners.iter().zip(planners) {
        if planner.bits() & all == 0 {
            let error = TrialError::NoneOfViews {
                planner: setup.label.clone(),
                able: host
                    .runtime
                    .able(Kind::Planner, |other| bits(other) & all != 0),
            };
            return Err(setup.blamed(error));
        }
    }
    for (index, instance) in instances.iter().enumerate() {
        if let Some(view) = instance.view().filter(|_| schedule.asked(index).is_empty()) {
            let reason = format!("no planner plans on the view `{}`", view.label);
            let asked = bit_of(instance);
            let able = host
                .runtime
                .able(Kind::Planner, |other| bits(other) & asked != 0);
            let hint = format!("leave it out, or add a planner; {able}");
            return Err(view.place.error(reason).hint(hint).into());
        }
    }
    Ok(())
}

/// The hash of a planner with its code, attachment, options and context, but for the rest of a
/// fleet.
fn of_planner(code: Digest, id: &str, attach: &str, options: &str, context: &Value) -> Hasher {
    let mut hasher = Hasher::new("fleetyard.entrant/2");
    hasher.bytes(&code.0.to_le_bytes());
    hasher.bytes(id.as_bytes());
    hasher.bytes(attach.as_bytes());
    hasher.bytes(options.as_bytes());
    hasher.value(context);
    hasher
}

/// The key that a trial has in a suite without fleets, from the row that it left; the instance is
/// given by its digest and by how many before have the same. `None` if the row has no digest of the
/// planner's code.
pub(crate) fn key_of(suite: &Suite, row: &Row, instance: (Digest, u64)) -> Option<String> {
    let code = u128::from_str_radix(row.planner_digest.as_ref()?, 16).ok()?;
    let planner = of_planner(
        Digest(code),
        &row.planner_id,
        &row.attach,
        &row.options,
        &context(suite),
    );
    let (instance, twins) = instance;
    Some(crate::plan::key(
        planner.finish(),
        instance,
        twins,
        row.seed,
        row.repeat,
    ))
}

/// All of a suite that results may depend on, beside planners, instances, seeds and repeats.
fn context(suite: &Suite) -> Value {
    let sandbox = &suite.sandbox;
    let protocol = &suite.protocol;
    // No result depends on where the host's own files lie.
    let policy = Policy {
        hidden: Vec::new(),
        ..sandbox.policy.clone()
    };
    json!({
        "budget": suite.budget,
        "policy": policy,
        "output_bytes": sandbox.output_bytes,
        "pin": sandbox.pin,
        "config": suite.config,
        "robots": suite.robots.as_ref().map(Robots::said),
        "reuse": protocol.reuse.name(),
        "clock": protocol.clock.name(),
        "path_rule": protocol.path_rule,
        "warm_ups": protocol.warm_ups,
    })
}

/// The time of day, in milliseconds since 1970.
pub fn now_unix_ms() -> u64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH);
    since.map_or(0, |since| since.as_millis() as u64)
}

impl Row {
    /// The instance's origin.
    fn place(&mut self, origin: Origin) {
        self.map = origin.map;
        self.scenario = origin.scenario;
        let Some(MazeOrigin {
            index,
            seed,
            width,
            height,
            algorithm,
        }) = origin.maze
        else {
            return;
        };
        self.maze_index = Some(index);
        self.maze_seed = Some(seed);
        self.maze_width = Some(width);
        self.maze_height = Some(height);
        self.maze_algorithm = Some(algorithm.name().to_owned());
    }

    /// It is on this grid.
    fn lie_on(&mut self, grid: &Grid) {
        self.map_rows = Some(grid.rows());
        self.map_cols = Some(grid.cols());
    }

    /// It may not be compared, for this reason if there is none yet.
    fn unrank(&mut self, reason: &str) {
        self.ranked = false;
        self.unranked.get_or_insert_with(|| reason.to_owned());
    }

    /// Takes the reasons for which its times cannot be compared with others.
    pub(crate) fn found_contended(&mut self, reasons: &[Reason]) {
        self.contended_by_others = Some(reasons.iter().any(|reason| reason.by_others));
        let reasons: Vec<String> = reasons.iter().map(ToString::to_string).collect();
        self.contended = reasons.join("; ");
    }

    /// Takes the figures of the execution.
    pub(crate) fn executed(&mut self, figures: &Figures) {
        self.simulated_s = Some(figures.simulated_s);
        self.rtf = Some(figures.rtf);
        self.contacts = Some(figures.contacts);
        self.nearest_approach_m = figures.nearest_approach_m;
        self.trace_digest = Some(figures.trace_digest.to_string());
    }

    /// Takes the columns that the record of the trial says.
    fn fill(&mut self, record: &Record, clock: Clock) {
        let metrics = &record.metrics;
        self.termination = record.termination.to_string();
        self.fault.clone_from(&record.fault);
        self.ranked = record.planner.ranked;
        self.unranked.clone_from(&record.planner.unranked);
        self.limits_watched = record::watched(record.sandbox.as_ref());
        self.devices = record::devices(record.sandbox.as_ref());
        self.limit_exceeded = record.limit.map(|limit| limit.to_string());
        self.claim = record.claim.map(|claim| claim.to_string());
        self.message.clone_from(&record.message);
        self.valid = record.plan_digest.is_some() && record.verdict.valid;
        self.violations = record.verdict.violation_count;
        self.first_violation = record.sentences().into_iter().next();
        self.valid_in_view = record.valid_in_view();
        self.valid_in_world = record.valid_in_world();
        self.agents_at_goal = record.metrics.agents_at_goal;
        self.individual_success = record.metrics.individual_success;
        self.success = record.ending() == Ending::Success;
        self.planning_time_ms = metrics.planning_time_ms;
        self.call_time_ms = metrics.call_time_ms;
        self.round_trip_ms = metrics.round_trip_ms;
        let correction = metrics.correction.filter(|_| clock == Clock::LessEmpty);
        self.correction_ms = correction.map(|correction| correction.ms);
        self.correction_uncertainty_ms = correction.map(|correction| correction.uncertainty_ms);
        let measurement = &record.measurement;
        self.clock = Some(clock.name().to_owned());
        self.solve_time_ms = match metrics.round_trip_ms.zip(correction) {
            Some((round_trip_ms, correction)) => (round_trip_ms - correction.ms).max(0.0),
            // Without an answer there is nothing that could be the transport's.
            None => metrics.planning_time_ms,
        };
        if clock == Clock::Cpu {
            let whole = record
                .sandbox
                .as_ref()
                .is_some_and(|sandbox| !sandbox.only_watches(Limit::Cpu));
            match measurement.plan.cpu_ms.filter(|_| whole) {
                Some(cpu_ms) => self.solve_time_ms = cpu_ms,
                None => self.unrank("its processor time, which is compared, is not known in full"),
            }
        }
        self.total_time_ms = Some(
            metrics.planning_time_ms
                + measurement.startup_ms.unwrap_or_default()
                + metrics.prepare_time_ms.unwrap_or_default(),
        );
        self.run_delay_ms = measurement.plan.run_delay_ms;
        self.cpus = measurement.cpus.as_ref().map(ToString::to_string);
        let claims: Vec<String> = record.disagreements().map(ToString::to_string).collect();
        self.false_claims = (!claims.is_empty()).then(|| claims.join("; "));
        self.startup_time_ms = record.measurement.startup_ms;
        self.prepare_time_ms = metrics.prepare_time_ms;
        self.first_solution_ms = metrics.first_solution_ms;
        self.soc_steps = metrics.soc_steps;
        self.makespan_steps = metrics.makespan_steps;
        let on_a_map = record.instance.representation.is_none();
        self.lower_bound_steps = on_a_map.then_some(metrics.lower_bound_steps);
        self.soc_s = metrics.soc_s;
        self.makespan_s = metrics.makespan_s;
        self.suboptimality = metrics.suboptimality;
        self.path_length_cells = metrics.length_cells.map(|cells| cells as f64);
        self.path_length_m = metrics.length_m;
        self.expansions = record.claimed_metrics.get("expansions").copied();
        if let Some(execution) = &record.execution {
            self.arrived = Some(execution.arrived.into());
            self.executed(&execution.figures);
            self.tracking_error_max_m = Some(execution.tracking_error_max_m);
            self.execution_makespan_s = execution.makespan_s;
            let simulated_s = execution.figures.simulated_s;
            self.throughput_per_s =
                (simulated_s > 0.0).then(|| f64::from(execution.arrived) / simulated_s);
        }
        self.cpu_time_ms = measurement.plan.cpu_ms;
        let learning = measurement.prepare.as_ref();
        let before = [learning, Some(&measurement.plan)].into_iter().flatten();
        let before = before.filter_map(|call| call.cpu_before_ms);
        self.cpu_between_calls_ms = before.reduce(|a, b| a + b);
        let usage = record.resources.as_ref();
        self.peak_memory_kb = usage.and_then(|usage| usage.peak_memory_kb);
        self.found_contended(&record.measurement.contended);
        self.plan_digest = record.plan_digest.map(|digest| digest.to_string());
        self.incumbents = metrics
            .incumbents
            .iter()
            .map(|plan| Incumbent {
                time_ms: plan.time_ms,
                soc_steps: plan.soc_steps,
                valid: plan.valid,
            })
            .collect();
    }
}
