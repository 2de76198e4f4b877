//! A trial: one planner, one instance, one budget, judged and executed.

use std::sync::Arc;
use std::time::Duration;

use fleetyard_abi::c::PluginEntry;
use fleetyard_abi::{Budget, Kind, Plan, SharedEnvironment};
use fleetyard_check::PathRule;
use fleetyard_core::{AnnotationFile, GridPlan};
use fleetyard_runtime::measure::{
    Call, Difference, Machine, NoCores, Reservation, Snapshot, Spent, Topology, contended,
    pin_this_process,
};
use fleetyard_runtime::{
    Able, Attach, CallReport, CallUsage, Fault, Follow, Limit, Limits, LogLine, PlanRun, Runtime,
    Source, Termination,
};
use fleetyard_sim::{SimConfig, SimError, TraceSink};
use serde_json::Value;

use crate::claims;
use crate::correction::Calibration;
use crate::options::{BudgetOptions, Robots, SandboxOptions};
use crate::plugin::{Plugin, Running, Unready};
use crate::record::{
    BudgetInfo, CallInfo, ExecutionInfo, HostInfo, IncumbentInfo, Measurement, Metrics,
    PlannerInfo, Record, VerdictInfo, milliseconds, unranked,
};
use crate::trial_error::TrialError;
use crate::trial_instance::{Found, TrialInstance};

/// Planners that watch the clock end a little before their budget does.
const NEARLY: f64 = 0.9;

/// The place where trials run: the runtime with its limits, and the cores that are theirs.
#[derive(Debug)]
pub struct Host {
    /// Starts plugins.
    pub runtime: Runtime,
    budget: BudgetOptions,
    cores: Option<Result<Reservation, NoCores>>,
    /// Empty calls by which round trips are corrected.
    pub(crate) calibration: Calibration,
}

impl Host {
    /// For a program with these plugins linked in. Without `apart` planners run in the
    /// host's own process, so that none has cores of its own.
    pub fn new(
        built_in: &'static [&'static PluginEntry],
        budget: BudgetOptions,
        sandbox: SandboxOptions,
        apart: bool,
    ) -> std::io::Result<Self> {
        let cores = (apart && sandbox.pin).then(|| {
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
            output_bytes: sandbox.output_bytes,
            policy: sandbox.policy,
            trust: sandbox.trust,
            prepare_cpu: budget.prepare_cpu.or(budget.cpu),
            cpu: budget.cpu,
            memory_bytes: budget.plan_memory().max(budget.prepare_memory()),
            threads: budget.threads,
            cpus: reserved.map(|reserved| reserved.mask.clone()),
            ..Limits::default()
        };
        Ok(Self {
            runtime: Runtime::new(built_in, limits)?,
            budget,
            cores,
            calibration: Calibration::default(),
        })
    }

    /// The budget of every trial.
    pub fn budget(&self) -> &BudgetOptions {
        &self.budget
    }

    /// The longest that a planner may take for a trial, if it has to be started for it.
    pub fn longest(&self) -> Duration {
        let budget = &self.budget;
        [
            budget.startup,
            budget.prepare_wall(),
            budget.wall,
            budget.grace.unwrap_or(Duration::ZERO),
            self.runtime.limits().ending,
        ]
        .into_iter()
        .fold(Duration::ZERO, Duration::saturating_add)
    }

    fn reserved(&self) -> Option<&Reservation> {
        self.cores.as_ref()?.as_ref().ok()
    }
}

/// The parts of a trial.
#[derive(Debug, Clone, Copy)]
pub struct Trial<'a> {
    /// The host on which it runs.
    pub host: &'a Host,
    /// The planner that is asked.
    pub planner: &'a Plugin,
    /// The instance that it is asked.
    pub instance: TrialInstance<'a>,
    /// The instance's origin, for people.
    pub scenario: &'a str,
    /// Seed of every random choice of the planner.
    pub seed: u64,
    /// Size of cells and steps, and how the plan is executed if it is.
    pub config: &'a SimConfig,
    /// The robots that execute it; `None` when nobody does.
    pub robots: Option<&'a Robots>,
    /// True if the planner is asked what it wants to show.
    pub annotations: bool,
    /// Is told of plans as they come.
    pub follower: Option<&'a Arc<dyn Follow>>,
}

/// The outcome of a trial.
#[derive(Debug)]
pub struct Outcome {
    /// All there is to say.
    pub record: Record,
    /// The plan that counts.
    pub plan: Option<Plan>,
    /// The planner's annotations, if it was asked for them.
    pub annotations: Option<AnnotationFile>,
    /// Notes that the user should see.
    pub warnings: Vec<String>,
    /// The planner's log; empty while its process is kept.
    pub log: Vec<LogLine>,
    /// The end of what it wrote to standard error; empty while its process is kept.
    pub stderr: String,
}

impl Trial<'_> {
    fn check(&self, running: &Running, map: &SharedEnvironment) -> Result<(), TrialError> {
        self.instance.check(self.scenario)?;
        self.instance
            .check_planner(self.host, &running.descriptor, map, self.config)
    }

    /// The planners beside this one that claim what the instance needs: hints name them where it says
    /// itself that the instance is not for it.
    pub fn others(&self, id: &str) -> Able {
        let (map, config) = (self.instance.environment(self.config), self.config);
        let runtime = &self.host.runtime;
        runtime.able(Kind::Planner, |other| {
            other.id != id && self.instance.missing(other, &map, config).is_none()
        })
    }

    /// Asks a process of its own.
    pub fn run(&self, trace: &mut dyn TraceSink) -> Result<Outcome, TrialError> {
        self.trial(&mut None, false, trace)
    }

    /// Asks the process that is there, or a new one, and leaves it there for the next
    /// trial unless something went wrong with it. What the whole life of a process shows
    /// is not in the record of a trial then.
    pub fn run_again(
        &self,
        running: &mut Option<Running>,
        trace: &mut dyn TraceSink,
    ) -> Result<Outcome, TrialError> {
        self.trial(running, true, trace)
    }

    fn trial(
        &self,
        kept: &mut Option<Running>,
        keep: bool,
        trace: &mut dyn TraceSink,
    ) -> Result<Outcome, TrialError> {
        if self.robots.is_some() {
            // Before the planner is started, not after its budget is spent.
            self.config.validate()?;
        }
        let mut running = match kept.take() {
            Some(running) => running,
            None => self.planner.start(&self.host.runtime)?,
        };
        let environment = self.instance.environment(self.config);
        self.check(&running, &environment)?;
        let watched = self.host.reserved().map(Reservation::watched);
        let before = Snapshot::take(watched.as_ref());
        let startup = (running.trials == 0).then(|| running.session.startup());
        let (run, learning, prepared) = self.plan(&mut running, &environment);
        // That is no trial of the planner.
        if let Some(fault) = run.fault.as_ref().filter(|fault| fault.is_of_host()) {
            running.close();
            return Err(fault.clone().into());
        }
        let load = Snapshot::take(watched.as_ref()).since(&before);
        let attach = self.planner.attach();
        let measurement = self.measurement(attach, &run, prepared.as_ref(), startup, load);
        let (descriptor, options) = (running.descriptor.clone(), running.options.clone());
        let sandbox = running.session.sandbox().cloned();
        // Now, so that nothing that it left is there while its plan is judged and executed.
        let mut broken_promises = running.session.broken_promises().to_vec();
        // A planner that failed, or whose limits were exceeded, starts anew next time.
        let closing = if keep && run.fault.is_none() && run.limit.is_none() {
            *kept = Some(running);
            None
        } else {
            Some(running.close())
        };
        let mut warnings = Vec::new();
        let mut termination = run.termination;
        let mut fault = run.fault.as_ref().map(ToString::to_string);
        if let Some(closing) = &closing {
            if let (Some(late), None) = (&closing.fault, &run.fault) {
                if matches!(late, Fault::Protocol { .. } | Fault::Unsupervised { .. }) {
                    termination = Termination::from(late);
                    fault = Some(late.to_string());
                } else {
                    let who = if late.is_of_host() {
                        ""
                    } else {
                        "the planner "
                    };
                    warnings.push(format!("after its answer {who}{late}"));
                }
            }
            broken_promises.clone_from(&closing.broken_promises);
            if closing.stray_lines > 0 {
                let count = closing.stray_lines;
                warnings.push(format!(
                    "the planner wrote {count} lines to standard output that are no messages; \
                     --verbose shows them"
                ));
            }
        }
        let plan = run.plan().cloned();
        let plan_digest = plan.as_ref().map(|plan| self.instance.plan_digest(plan));
        let annotations = self.annotations.then(|| AnnotationFile {
            planner: Some(format!("{} {}", descriptor.id, descriptor.version)),
            plan_digest,
            left_out: run.annotations.left_out(),
            ..AnnotationFile::new(
                &environment,
                self.instance.agents() as u32,
                run.annotations.kept(),
            )
        });
        let found = plan.as_ref().map(|plan| self.instance.judge(plan));
        let execution = match (&plan, &found, self.robots) {
            (Some(plan), Some(found), Some(robots)) => {
                match self.execute(robots, plan, found, trace) {
                    Ok(execution) => execution,
                    Err(error @ TrialError::Simulation(SimError::Trace(_))) => return Err(error),
                    Err(error) => {
                        warnings.push(format!("the plan was not executed: {error}"));
                        None
                    }
                }
            }
            _ => None,
        };
        let over = closing.as_ref().and_then(|closing| closing.over);
        let late = closing.as_ref().and_then(|closing| closing.fault.as_ref());
        let usage = closing.as_ref().and_then(|closing| closing.usage);
        let unranked = unranked(
            attach,
            self.host.runtime.limits(),
            sandbox.as_ref(),
            usage.as_ref(),
            run.usage.work,
            run.fault.iter().chain(late),
        );
        let mut record = Record {
            fleetyard: env!("CARGO_PKG_VERSION"),
            planner: PlannerInfo {
                id: descriptor.id,
                version: descriptor.version,
                attach,
                ranked: unranked.is_none(),
                unranked,
                path: self.planner.path().map(|path| path.display().to_string()),
                digest: self.planner.digest(),
                code: self.planner.code().to_vec(),
                pinned: self.planner.is_pinned(),
                options: Value::Object(options),
            },
            instance: self.instance.info(self.scenario),
            budget: self.budget(),
            termination,
            fault,
            stopped: run.stopped || over.is_some(),
            limit: run.limit.or(over),
            ended_by_clock: run.limit == Some(Limit::Wall)
                || run.termination == Termination::Interrupted
                || run.planning.as_secs_f64() >= NEARLY * self.host.budget.wall.as_secs_f64(),
            kill_latency_ms: closing
                .as_ref()
                .and_then(|closing| closing.kill_latency.map(milliseconds)),
            claim: run.claim,
            message: run.message.clone(),
            metrics: self.metrics(
                &run,
                plan.as_ref(),
                found.as_ref(),
                attach,
                learning.map(milliseconds),
            ),
            verdict: VerdictInfo::default(),
            judged: None,
            claimed_metrics: run.metrics,
            notes: run.notes,
            claims: Vec::new(),
            broken_promises,
            resources: usage,
            measurement,
            sandbox,
            environment_digest: None,
            execution,
            instance_digest: self.instance.digest(),
            plan_digest,
        };
        if let Some(found) = found {
            (record.verdict, record.judged) = (found.verdict, found.judged);
        }
        record.claims = claims::of(&record);
        let (mut log, mut stderr) = (Vec::new(), String::new());
        if let Some(closing) = closing {
            record.environment_digest = closing.environment;
            (log, stderr) = (closing.log, closing.stderr);
        }
        Ok(Outcome {
            record,
            plan,
            annotations,
            warnings,
            log,
            stderr,
        })
    }

    fn execute(
        &self,
        robots: &Robots,
        plan: &Plan,
        found: &Found,
        trace: &mut dyn TraceSink,
    ) -> Result<Option<ExecutionInfo>, TrialError> {
        let terms = (self.config, self.scenario);
        self.instance.execute(robots, plan, found, terms, trace)
    }

    /// The limits of the run, as they are recorded.
    fn budget(&self) -> BudgetInfo {
        let budget = &self.host.budget;
        let limits = self.host.runtime.limits();
        let policy = &limits.policy;
        let ms = |duration: Option<Duration>| duration.map(milliseconds);
        let bytes = |bytes: u64| (bytes > 0).then_some(bytes);
        BudgetInfo {
            wall_ms: milliseconds(budget.wall),
            prepare_wall_ms: milliseconds(budget.prepare_wall()),
            grace_ms: ms(budget.grace),
            cpu_ms: ms(limits.cpu),
            prepare_cpu_ms: ms(limits.prepare_cpu),
            memory_bytes: bytes(budget.plan_memory()),
            prepare_memory_bytes: bytes(budget.prepare_memory()),
            processes: policy.processes,
            output_bytes: limits.output_bytes,
            disk_bytes: policy.disk_bytes,
            nodes: (budget.nodes > 0).then_some(budget.nodes),
            threads: budget.threads,
            seed: self.seed,
        }
    }

    fn measurement(
        &self,
        attach: Attach,
        run: &PlanRun,
        prepared: Option<&CallReport>,
        startup: Option<Duration>,
        load: Difference,
    ) -> Measurement {
        let micros = |us: Option<u64>| us.map(Duration::from_micros);
        let call = |usage: &CallUsage| CallInfo {
            cpu_ms: micros(usage.cpu_us).map(milliseconds),
            cpu_source: usage.cpu_source,
            run_delay_ms: micros(usage.run_delay_us).map(milliseconds),
            cpu_before_ms: micros(usage.before_us).map(milliseconds),
        };
        // Of both calls; of one where the map was known.
        let sum = |of: fn(&CallUsage) -> Option<u64>| {
            let first = prepared.map_or(Some(0), |prepared| of(&prepared.usage));
            micros(Some(first? + of(&run.usage)?))
        };
        // What a solver used is gone with it unless its group counted it.
        let whole = attach != Attach::Command || run.usage.cpu_source == Some(Source::Cgroup);
        let spent = Spent {
            wall: run.planning + prepared.map_or(Duration::ZERO, |prepared| prepared.wall),
            cpu: sum(|usage| usage.cpu_us),
            cpu_most: sum(|usage| {
                let is_whole = usage.cpu_source == Some(Source::Cgroup);
                Some(usage.cpu_us? + usage.before_us?).filter(|_| is_whole)
            }),
            run_delay: sum(|usage| usage.run_delay_us),
            threads: self.host.budget.threads,
            call: Call {
                wall: run.planning,
                claimed: run.call,
                cpu: micros(run.usage.cpu_us).filter(|_| whole),
                host_cpu: run.host.cpu,
                host_run_delay: run.host.run_delay,
            },
        };
        let not_pinned = match &self.host.cores {
            None => Some("not asked for".to_owned()),
            Some(Err(reason)) => Some(reason.to_string()),
            Some(Ok(_)) => None,
        };
        Measurement {
            startup_ms: startup.map(milliseconds),
            prepare: prepared.map(|prepared| call(&prepared.usage)),
            plan: call(&run.usage),
            host: HostInfo {
                cpu_ms: run.host.cpu.map(milliseconds),
                run_delay_ms: run.host.run_delay.map(milliseconds),
            },
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

    /// Asks, after the planner has learnt the map: the run, the time for which it learnt, and the
    /// report about that unless it ended there.
    fn plan(
        &self,
        running: &mut Running,
        environment: &SharedEnvironment,
    ) -> (PlanRun, Option<Duration>, Option<CallReport>) {
        let allowed = &self.host.budget;
        let budget = |wall: Duration, memory_bytes: u64| Budget {
            nodes: allowed.nodes,
            memory_bytes,
            threads: allowed.threads,
            seed: self.seed,
            ..Budget::lasting(0, wall.as_nanos() as u64)
        };
        match running.ready(
            environment,
            &budget(allowed.prepare_wall(), allowed.prepare_memory()),
        ) {
            Ok(report) => {
                let instance = self.instance.instance(&running.descriptor, self.config);
                let budget = budget(allowed.wall, allowed.plan_memory());
                running.session.want_annotations(self.annotations);
                running.session.follow(self.follower.cloned());
                let learning = report.as_ref().map(|report| report.wall);
                (running.session.plan(&instance, &budget), learning, report)
            }
            Err(Unready { fault, after }) => (PlanRun::failed(fault), after, None),
        }
    }

    fn metrics(
        &self,
        run: &PlanRun,
        plan: Option<&Plan>,
        found: Option<&Found>,
        attach: Attach,
        prepare_time_ms: Option<f64>,
    ) -> Metrics {
        // The last one is the plan itself, which was judged already.
        let last = run.incumbents.len().saturating_sub(1);
        let timed = !matches!(
            self.instance,
            TrialInstance::Grid { path_rule, .. } if path_rule != PathRule::Steps
        );
        let incumbents = run.incumbents.iter().enumerate();
        let incumbents = incumbents.map(|(index, incumbent)| {
            let valid = |plan: &Plan| match found {
                Some(found) if index == last => found.verdict.valid,
                _ => self.instance.allows(plan),
            };
            let cells = incumbent.plan.as_ref().and_then(Plan::cells);
            IncumbentInfo {
                time_ms: milliseconds(incumbent.arrived),
                soc_steps: cells.filter(|_| timed).map(GridPlan::sum_of_costs),
                valid: incumbent.plan.as_ref().map(valid),
            }
        });
        let incumbents: Vec<IncumbentInfo> = incumbents.collect();
        // What breaks a rule is no solution, however soon it comes.
        let solution = incumbents.iter().find(|plan| plan.valid == Some(true));
        Metrics {
            planning_time_ms: milliseconds(run.planning),
            call_time_ms: run.call.map(milliseconds),
            round_trip_ms: run.round_trip.map(milliseconds),
            held_up_ms: run.held_up.map(milliseconds),
            correction: plan.and_then(Plan::cells).and_then(|plan| {
                let cells: usize = plan.paths().map(<[_]>::len).sum();
                let calibration = &self.host.calibration;
                calibration.of(attach, self.instance.agents(), cells as u64)
            }),
            prepare_time_ms,
            first_solution_ms: solution.map(|plan| plan.time_ms),
            incumbents,
            late_plans: run.late,
            ..self.instance.metrics(plan, found, self.config)
        }
    }
}
