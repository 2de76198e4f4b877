//! A trial: one planner, one instance, one budget, judged and executed.

use std::path::Path;
use std::time::{Duration, Instant};

use fleetyard_abi::{Budget, Capability, Descriptor, Kind, SharedEnvironment};
use fleetyard_check::{metrics, sum_of_costs, validate};
use fleetyard_core::{Connectivity, Digest, GridInstance, GridPlan};
use fleetyard_runtime::measure::{
    Difference, Machine, NoCores, Reservation, Snapshot, Spent, Topology, contended,
    pin_this_process,
};
use fleetyard_runtime::{
    Attach, CallReport, CallUsage, CodeFile, Discovery, Fault, Found, LOCK_FILE, Level, Limits,
    Lock, LogLine, Origin, PlanRun, PluginFile, Policy, Runtime, Session, Standing, Termination,
    Trust, check_options, parse_option,
};
use fleetyard_sim::{Plan, SimConfig, Simulator, TraceSink};
use serde_json::{Map, Value};

use crate::args::{BudgetArgs, GrantArgs, PinArg, TrustArgs, WorldArgs};
use crate::exit::{Exit, Failure, Result, internal};
use crate::record::{
    BudgetInfo, CallInfo, ExecutionInfo, IncumbentInfo, InstanceInfo, Measurement, Metrics,
    PlannerInfo, Record, VerdictInfo,
};
use crate::{BUILT_IN, claims, output};

/// How many violations a record lists; all are counted.
const VIOLATIONS: usize = 20;

/// A planner that was found, not yet started.
pub(crate) struct Candidate {
    pub(crate) name: String,
    file: PluginFile,
    id: Option<String>,
    /// Of its code, which is read once.
    digest: Option<Digest>,
    code: Vec<CodeFile>,
    standing: Standing,
}

/// The runtime with default limits.
pub(crate) fn runtime(trust: Trust) -> Result<Runtime> {
    runtime_with(Policy::default(), trust)
}

/// The same, with another sandbox.
pub(crate) fn runtime_with(policy: Policy, trust: Trust) -> Result<Runtime> {
    let limits = Limits {
        memory_bytes: half_of_memory(),
        policy,
        trust,
        ..Limits::default()
    };
    Runtime::new(BUILT_IN, limits).map_err(internal)
}

/// Half of the machine's memory; no limit where nobody tells how much that is.
pub(crate) fn half_of_memory() -> u64 {
    Machine::here().memory_kb.unwrap_or(0) / 2 * 1024
}

/// Where trials run: the runtime with its limits, and the cores that are theirs.
pub(crate) struct Host {
    pub(crate) runtime: Runtime,
    cores: Option<std::result::Result<Reservation, NoCores>>,
}

impl Host {
    /// With the limits that the arguments ask for.
    pub(crate) fn new(budget: &BudgetArgs, attach: Option<Attach>) -> Result<Self> {
        let sandbox = &budget.sandbox;
        // In process the planner runs where the host does.
        let apart = attach != Some(Attach::InProcess);
        let cores = (apart && sandbox.pin == PinArg::Auto).then(|| {
            Topology::of_this_process().and_then(|topology| topology.reserve(budget.threads))
        });
        let reserved = cores.as_ref().and_then(|cores| cores.as_ref().ok());
        if let Some(reserved) = reserved {
            // Where it is refused, the load that is recorded shows it.
            let _ = pin_this_process(&reserved.host);
        }
        let limits = Limits {
            grace: budget.grace.unwrap_or(Duration::ZERO),
            startup: budget.startup,
            output_bytes: sandbox.grants.output_limit,
            policy: policy(&sandbox.grants)?,
            trust: trust(&sandbox.grants.trust)?,
            prepare_cpu: sandbox.prepare_cpu.or(sandbox.cpu),
            cpu: sandbox.cpu,
            memory_bytes: memory(budget).max(prepare_memory(budget)),
            threads: budget.threads,
            cpus: reserved.map(|reserved| reserved.mask.clone()),
            ..Limits::default()
        };
        let runtime = Runtime::new(BUILT_IN, limits).map_err(internal)?;
        Ok(Self { runtime, cores })
    }

    fn reserved(&self) -> Option<&Reservation> {
        self.cores.as_ref()?.as_ref().ok()
    }
}

/// The lock that the arguments name, or the one that lies in the current folder.
pub(crate) fn trust(arguments: &TrustArgs) -> Result<Trust> {
    let usual = Path::new(LOCK_FILE);
    let file = arguments.lock.as_deref();
    let file = file.or_else(|| usual.exists().then_some(usual));
    Ok(Trust {
        lock: file.map(Lock::read).transpose()?,
        locked: arguments.locked,
    })
}

/// What the sandbox is to grant.
pub(crate) fn policy(grants: &GrantArgs) -> Result<Policy> {
    for path in &grants.allow_read {
        if !path.exists() {
            let message = format!("{}: there is no such file or folder", path.display());
            return Err(Failure::new(Exit::Input, message)
                .hint("--allow-read names what the plugin may read"));
        }
    }
    Ok(Policy {
        level: grants.sandbox.into(),
        read: grants.allow_read.clone(),
        network: grants.allow_network,
        env: grants.env.clone(),
        processes: grants.processes,
        disk_bytes: grants.disk,
        ..Policy::default()
    })
}

fn memory(budget: &BudgetArgs) -> u64 {
    budget.sandbox.memory.unwrap_or_else(half_of_memory)
}

fn prepare_memory(budget: &BudgetArgs) -> u64 {
    budget
        .sandbox
        .prepare_memory
        .unwrap_or_else(|| memory(budget))
}

/// Finds a plugin by path, `PATH:ID` or identifier, and says what the user should know
/// of the choice.
pub(crate) fn find(runtime: &Runtime, kind: Option<Kind>, name: &str) -> Result<Found> {
    let discovery = Discovery::from_environment();
    let found = discovery.find(runtime, kind, name);
    if matches!(found, Err(Fault::Unknown { .. })) {
        for (folder, reason) in discovery.unreadable() {
            output::warning(&unreadable(&folder, &reason));
        }
    }
    let found = found?;
    let place = |file: &PluginFile| match file.path() {
        Some(path) => path.display().to_string(),
        None => "the built-in one".into(),
    };
    if !found.shadowed.is_empty() {
        output::note(&format!(
            "`{name}` is {}, which shadows {}",
            place(&found.file),
            found.shadowed.join(", ")
        ));
    }
    let trust = &runtime.limits().trust;
    if let (Some(lock), Standing::Unlisted, false) =
        (&trust.lock, trust.standing(&found.file), trust.locked)
    {
        output::note(&format!(
            "{} is not in {}; `fleetyard plugins pin` puts it there",
            place(&found.file),
            lock.file().display()
        ));
    }
    Ok(found)
}

/// Why a folder of the plugin path has no plugins.
pub(crate) fn unreadable(folder: &Path, reason: &str) -> String {
    format!(
        "the folder {} of FLEETYARD_PLUGIN_PATH cannot be searched: {reason}",
        folder.display()
    )
}

impl Candidate {
    pub(crate) fn find(runtime: &Runtime, name: &str) -> Result<Self> {
        let Found {
            file, origin, id, ..
        } = find(runtime, Some(Kind::Planner), name)?;
        let name = match (&origin, file.path().and_then(|path| path.file_stem())) {
            (Origin::Path, Some(stem)) => stem.to_string_lossy().into_owned(),
            _ => name.to_owned(),
        };
        let digest = file.digest();
        let code = file.code()?;
        let standing = runtime.limits().trust.standing(&file);
        Ok(Self {
            name,
            file,
            id,
            digest,
            code,
            standing,
        })
    }

    /// Starts the planner and picks its descriptor.
    pub(crate) fn open(&self, runtime: &Runtime, attach: Attach) -> Result<(Session, Descriptor)> {
        let mut session = runtime.open(&self.file, attach)?;
        // What the record says of the code has to be true of every trial.
        if self.file.code()? != self.code {
            session.close();
            let message = format!("{}: its code was changed meanwhile", self.name);
            return Err(Failure::new(Exit::Plugin, message).hint("run the command again"));
        }
        let planners: Vec<_> = session
            .descriptors()
            .iter()
            .filter(|d| d.kind == Kind::Planner)
            .collect();
        let names = || {
            planners
                .iter()
                .map(|d| d.id.as_str())
                .collect::<Vec<_>>()
                .join(", ")
        };
        let chosen = match (&self.id, planners.as_slice()) {
            (Some(id), planners) => planners.iter().find(|d| d.id == *id).copied(),
            (None, [only]) => Some(*only),
            (None, []) => None,
            (None, _) => {
                let shown = &self.name;
                let message = format!("{shown} has several planners: {}", names());
                return Err(
                    Failure::new(Exit::Usage, message).hint("write PATH:ID to choose one of them")
                );
            }
        };
        let descriptor = chosen.cloned().ok_or_else(|| {
            let wanted = self
                .id
                .as_ref()
                .map_or(String::new(), |id| format!(" `{id}`"));
            let failure = Failure::new(
                Exit::Plugin,
                format!("{} has no planner{wanted}", self.name),
            );
            if planners.is_empty() {
                failure
            } else {
                failure.hint(format!("it has {}", names()))
            }
        })?;
        Ok((session, descriptor))
    }

    pub(crate) fn attach(&self, wanted: Option<Attach>) -> Attach {
        wanted.unwrap_or(self.file.default_attach())
    }
}

/// What a trial is about.
pub(crate) struct Trial<'a> {
    pub(crate) host: &'a Host,
    pub(crate) candidate: &'a Candidate,
    pub(crate) attach: Option<Attach>,
    pub(crate) options: &'a [String],
    pub(crate) instance: &'a GridInstance,
    pub(crate) scenario: String,
    pub(crate) budget: &'a BudgetArgs,
    pub(crate) world: &'a WorldArgs,
    pub(crate) execute: bool,
}

/// What came of it.
pub(crate) struct Outcome {
    pub(crate) record: Record,
    pub(crate) plan: Option<GridPlan>,
    pub(crate) warnings: Vec<String>,
    pub(crate) log: Vec<LogLine>,
    pub(crate) stderr: String,
}

impl Trial<'_> {
    /// Whether the planner can be asked at all: it starts, takes its options, and can do
    /// what the instance needs.
    pub(crate) fn check(&self) -> Result<()> {
        let attach = self.candidate.attach(self.attach);
        let (mut session, descriptor) = self.candidate.open(&self.host.runtime, attach)?;
        session.close();
        self.options(&descriptor)?;
        self.check_capabilities(&descriptor)
    }

    fn simulator<'c>(&'c self, config: &'c SimConfig) -> Simulator<'c> {
        Simulator::new(config).on_grid(self.instance.grid())
    }

    pub(crate) fn run(&self, trace: &mut dyn TraceSink) -> Result<Outcome> {
        let config = sim_config(self.world);
        if self.execute {
            // Before the planner is started, not after its budget is spent.
            config.validate()?;
        }
        let attach = self.candidate.attach(self.attach);
        let (mut session, descriptor) = self.candidate.open(&self.host.runtime, attach)?;
        let options = self.options(&descriptor)?;
        self.check_capabilities(&descriptor)?;
        let environment =
            fleetyard_runtime::environment(self.instance, self.world.cell_size, self.world.step);
        let watched = self.host.reserved().map(Reservation::watched);
        let before = Snapshot::take(watched.as_ref());
        let (run, prepared) = self.plan(
            &mut session,
            &descriptor,
            &options,
            &environment,
            config.radius_m(),
        );
        let load = Snapshot::take(watched.as_ref()).since(&before);
        let startup = session.startup();
        let closing = session.close();
        let measurement = self.measurement(&run, prepared.as_ref(), startup, load);
        let mut warnings = Vec::new();
        let mut termination = run.termination;
        let mut fault = run.fault.as_ref().map(ToString::to_string);
        if let (Some(late), None) = (closing.fault, &run.fault) {
            if matches!(late, Fault::Protocol { .. }) {
                termination = Termination::from(&late);
                fault = Some(late.to_string());
            } else {
                warnings.push(format!("after its answer the planner {late}"));
            }
        }
        if closing.stray_lines > 0 {
            let count = closing.stray_lines;
            warnings.push(format!(
                "the planner wrote {count} lines to standard output that are no messages; \
                 --verbose shows them"
            ));
        }
        let plan = run.plan().cloned();
        let execution = match &plan {
            Some(plan) if self.execute => match execute(&self.simulator(&config), plan, trace) {
                Ok(execution) => Some(execution),
                Err(failure) if failure.exit == Exit::Internal => return Err(failure),
                Err(failure) => {
                    warnings.push(format!("the plan was not executed: {}", failure.message));
                    None
                }
            },
            _ => None,
        };
        let verdict = plan.as_ref().map_or_else(VerdictInfo::default, |plan| {
            validate(self.instance, plan, VIOLATIONS).into()
        });
        let mut record = Record {
            fleetyard: env!("CARGO_PKG_VERSION"),
            planner: PlannerInfo {
                id: descriptor.id,
                version: descriptor.version,
                attach,
                ranked: attach != Attach::InProcess
                    && self.host.runtime.limits().policy.level != Level::None,
                path: self
                    .candidate
                    .file
                    .path()
                    .map(|path| path.display().to_string()),
                digest: self.candidate.digest,
                code: self.candidate.code.clone(),
                pinned: self.candidate.standing == Standing::Pinned,
                options: Value::Object(options),
            },
            instance: InstanceInfo {
                map: self.instance.grid().name().to_owned(),
                scenario: self.scenario.clone(),
                agents: self.instance.agents(),
                connectivity: self.instance.connectivity().degree(),
            },
            budget: self.budget(),
            termination,
            fault,
            stopped: run.stopped || closing.over.is_some(),
            limit: run.limit.or(closing.over),
            kill_latency_ms: closing.kill_latency.map(milliseconds),
            claim: run.claim,
            message: run.message.clone(),
            metrics: self.metrics(
                &run,
                plan.as_ref(),
                verdict.valid,
                prepared.map(|prepared| milliseconds(prepared.wall)),
            ),
            verdict,
            claimed_metrics: run.metrics,
            claims: Vec::new(),
            resources: closing.usage,
            measurement,
            sandbox: closing.sandbox,
            environment_digest: closing.environment,
            execution,
            instance_digest: self.instance.digest(),
            plan_digest: plan.as_ref().map(GridPlan::digest),
        };
        record.claims = claims::of(&record);
        Ok(Outcome {
            record,
            plan,
            warnings,
            log: closing.log,
            stderr: closing.stderr,
        })
    }

    /// The limits of the run, as they are recorded.
    fn budget(&self) -> BudgetInfo {
        let budget = self.budget;
        let sandbox = &budget.sandbox;
        let limits = self.host.runtime.limits();
        let ms = |duration: Option<Duration>| duration.map(milliseconds);
        let bytes = |bytes: u64| (bytes > 0).then_some(bytes);
        BudgetInfo {
            wall_ms: milliseconds(budget.budget),
            prepare_wall_ms: milliseconds(budget.prepare_budget.unwrap_or(budget.budget)),
            grace_ms: ms(budget.grace),
            cpu_ms: ms(limits.cpu),
            prepare_cpu_ms: ms(limits.prepare_cpu),
            memory_bytes: bytes(memory(budget)),
            prepare_memory_bytes: bytes(prepare_memory(budget)),
            processes: sandbox.grants.processes,
            output_bytes: sandbox.grants.output_limit,
            disk_bytes: sandbox.grants.disk,
            nodes: (budget.nodes > 0).then_some(budget.nodes),
            threads: budget.threads,
            seed: budget.seed,
        }
    }

    fn measurement(
        &self,
        run: &PlanRun,
        prepared: Option<&CallReport>,
        startup: Duration,
        load: Difference,
    ) -> Measurement {
        let micros = |us: Option<u64>| us.map(Duration::from_micros);
        let call = |usage: &CallUsage| CallInfo {
            cpu_ms: micros(usage.cpu_us).map(milliseconds),
            run_delay_ms: micros(usage.run_delay_us).map(milliseconds),
        };
        let sum = |a: Option<u64>, b: Option<u64>| Some(a? + b?);
        let first = prepared.map(|prepared| prepared.usage).unwrap_or_default();
        let spent = Spent {
            wall: run.planning + prepared.map_or(Duration::ZERO, |prepared| prepared.wall),
            cpu: micros(sum(first.cpu_us, run.usage.cpu_us)),
            run_delay: micros(sum(first.run_delay_us, run.usage.run_delay_us)),
            threads: self.budget.threads,
        };
        let not_pinned = match &self.host.cores {
            None => Some("not asked for".to_owned()),
            Some(Err(reason)) => Some(reason.to_string()),
            Some(Ok(_)) => None,
        };
        Measurement {
            startup_ms: milliseconds(startup),
            prepare: prepared.map(|prepared| call(&prepared.usage)),
            plan: call(&run.usage),
            cpus: self.host.reserved().map(|cores| cores.mask.clone()),
            idle_siblings: self
                .host
                .reserved()
                .map(|cores| cores.siblings.clone())
                .filter(|siblings| !siblings.is_empty()),
            not_pinned,
            contended: contended(&load, &spent),
            load,
            machine_digest: Machine::here().digest(),
            machine: Machine::here(),
        }
    }

    fn options(&self, descriptor: &Descriptor) -> Result<Map<String, Value>> {
        let mut options = Map::new();
        for text in self.options {
            options.extend([parse_option(text, &descriptor.options_schema)?]);
        }
        check_options(&options, &descriptor.options_schema)?;
        Ok(options)
    }

    /// Asking for what a planner does not claim is refused before it is asked.
    fn check_capabilities(&self, descriptor: &Descriptor) -> Result<()> {
        let mut needed = vec![Capability::Grid, Capability::Pebble];
        if self.instance.connectivity() == Connectivity::Eight {
            needed.push(Capability::EightConnected);
        }
        match needed
            .into_iter()
            .find(|needed| !descriptor.capabilities.has(*needed))
        {
            None => Ok(()),
            Some(missing) => Err(Failure::new(
                Exit::NoPlan,
                format!(
                    "planner `{}` does not support `{}`",
                    descriptor.id,
                    missing.as_str()
                ),
            )
            .hint(format!(
                "`fleetyard plugins info {}` lists what it can do",
                self.candidate.name
            ))),
        }
    }

    fn plan(
        &self,
        session: &mut Session,
        descriptor: &Descriptor,
        options: &Map<String, Value>,
        environment: &SharedEnvironment,
        radius_m: f64,
    ) -> (PlanRun, Option<CallReport>) {
        let budget = |wall: Duration, memory_bytes: u64| Budget {
            deadline_monotonic_ns: 0,
            wall_ns: wall.as_nanos() as u64,
            nodes: self.budget.nodes,
            memory_bytes,
            threads: self.budget.threads,
            seed: self.budget.seed,
        };
        let prepare_budget = budget(
            self.budget.prepare_budget.unwrap_or(self.budget.budget),
            prepare_memory(self.budget),
        );
        let ready = session
            .create(
                Kind::Planner,
                &descriptor.id,
                Value::Object(options.clone()),
            )
            .and_then(|()| session.prepare(environment, &prepare_budget));
        match ready {
            Ok(report) => {
                let instance = fleetyard_runtime::instance(self.instance, radius_m);
                let budget = budget(self.budget.budget, memory(self.budget));
                (session.plan(&instance, &budget), Some(report))
            }
            Err(fault) => (PlanRun::failed(fault), None),
        }
    }

    fn metrics(
        &self,
        run: &PlanRun,
        plan: Option<&GridPlan>,
        valid: bool,
        prepare_time_ms: Option<f64>,
    ) -> Metrics {
        // The lower bound does not depend on the plan: an empty one will do.
        let empty = GridPlan::default();
        let of_plan = metrics(self.instance, plan.unwrap_or(&empty), self.world.cell_size);
        // The last one is the plan itself, which was validated already.
        let last = run.incumbents.len().saturating_sub(1);
        let incumbents = run.incumbents.iter().enumerate().map(|(index, incumbent)| {
            let valid = |plan| {
                if index == last {
                    valid
                } else {
                    validate(self.instance, plan, 0).valid
                }
            };
            IncumbentInfo {
                time_ms: milliseconds(incumbent.arrived),
                soc_steps: incumbent.plan.as_ref().map(sum_of_costs),
                valid: incumbent.plan.as_ref().map(valid),
            }
        });
        let bound = of_plan.lower_bound_steps;
        Metrics {
            soc_steps: plan.map(|_| of_plan.sum_of_costs),
            makespan_steps: plan.map(|_| of_plan.makespan),
            lower_bound_steps: bound,
            suboptimality: plan
                .filter(|_| valid && bound > 0)
                .map(|_| of_plan.sum_of_costs as f64 / bound as f64),
            length_m: plan.map(|_| of_plan.length_m),
            lower_bound_m: of_plan.lower_bound_m,
            waits: plan.map(|_| of_plan.waits),
            planning_time_ms: milliseconds(run.planning),
            prepare_time_ms,
            first_solution_ms: run
                .incumbents
                .first()
                .map(|first| milliseconds(first.arrived)),
            incumbents: incumbents.collect(),
            late_plans: run.late,
        }
    }
}

pub(crate) fn milliseconds(duration: Duration) -> f64 {
    duration.as_secs_f64() * 1000.0
}

/// The simulator's parameters from the arguments.
pub(crate) fn sim_config(world: &WorldArgs) -> SimConfig {
    SimConfig {
        cell_size_m: world.cell_size,
        step_s: world.step,
        radius_m: world.radius,
        ticks_hz: world.ticks_hz,
        substeps: world.substeps,
        tier: world.tier.into(),
        ..SimConfig::default()
    }
}

/// Executes a plan and takes the time.
pub(crate) fn execute<'p>(
    simulator: &Simulator<'_>,
    plan: impl Into<Plan<'p>>,
    trace: &mut dyn TraceSink,
) -> Result<ExecutionInfo> {
    let started = Instant::now();
    let outcome = simulator.run(plan, trace)?;
    let wall = started.elapsed();
    Ok(ExecutionInfo {
        rtf: outcome.simulated_s / wall.as_secs_f64().max(1e-9),
        policy: outcome.policy,
        agents: outcome.agents,
        arrived: outcome.arrived,
        makespan_s: outcome.makespan_s,
        sum_of_costs_s: outcome.sum_of_costs_s,
        ticks: outcome.ticks,
        simulated_s: outcome.simulated_s,
        wall_ms: milliseconds(wall),
        contacts: outcome.contacts.total(),
        contacts_agent_agent: outcome.contacts.agent_agent,
        contacts_agent_obstacle: outcome.contacts.agent_obstacle,
        nearest_approach_m: outcome.nearest_approach_m,
        tracking_error_max_m: outcome.tracking_error_max_m,
        tracking_error_mean_m: outcome.tracking_error_mean_m,
        radius_m: outcome.radius_m,
        host_peak_memory_kb: peak_memory_kb(),
        trace_digest: outcome.trace_digest,
    })
}

/// The high-water mark of this process's resident set, where the kernel tells.
fn peak_memory_kb() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status
        .lines()
        .find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.trim().strip_suffix("kB")?.trim().parse().ok()
}
