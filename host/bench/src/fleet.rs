//! A trial of a lifelong fleet: four plugins, a map and robots, for as long as the suite says.

use std::sync::Arc;
use std::time::Duration;

use fleetyard_abi::Kind;
use fleetyard_core::document::Place;
use fleetyard_core::{Digest, Grid, Hasher, InputError};
use fleetyard_fleet::{
    EventKind, FleetConfig, FleetOutcome, Ground, ModuleInfo, Modules, Watch, run,
};
use fleetyard_runtime::measure::{Call, Reason, Snapshot, Spent, contended};
use fleetyard_runtime::{
    Attach, Closing, Discovery, Fault, Limits, Runtime, SandboxReport, Termination, Usage,
};
use serde_json::{Map, Value};

use crate::error::BenchError;
use crate::plugin::{GivenOptions, Plugin};
use crate::record::{devices, unranked, watched};
use crate::row::Row;
use crate::suite::{Clock, FleetPlugin, FleetSetup};
use crate::trial_error::TrialError;

/// Starts the plugins of a fleet: planner, generator, invocation policy and fail policy.
pub fn start_modules(runtime: &Runtime, plugins: [&Plugin; 4]) -> Result<Modules, TrialError> {
    let [planner, generator, invocation, fail_policy] = plugins;
    Ok(Modules {
        planner: planner.module(runtime)?,
        generator: generator.module(runtime)?,
        invocation: invocation.module(runtime)?,
        fail_policy: fail_policy.module(runtime)?,
    })
}

/// The plugins of a setup beside its planner, found and started once.
pub(crate) struct FleetModules {
    setup: FleetSetup,
    members: [Member; 3],
}

struct Member {
    plugin: Plugin,
    id: String,
    /// Checked against the plugin's schema.
    options: Map<String, Value>,
}

/// The kinds of [`FleetModules::members`], in their order.
const KINDS: [Kind; 3] = [
    Kind::InstanceGenerator,
    Kind::InvocationPolicy,
    Kind::FailPolicy,
];

/// An error of a plugin at its place in the suite.
pub(crate) fn blamed(place: &Place, error: TrialError) -> BenchError {
    BenchError::Plugin {
        at: InputError {
            hint: error.hint(),
            ..place.error(error.to_string())
        },
        error: Box::new(error),
    }
}

impl FleetModules {
    /// Finds the plugins, and starts each of them once.
    pub(crate) fn new(
        setup: &FleetSetup,
        discovery: &Discovery,
        runtime: &Runtime,
    ) -> Result<Self, BenchError> {
        let member = |kind: Kind, asked: &FleetPlugin| {
            let name = asked.plugin.as_str();
            let blamed = |error: TrialError| blamed(&asked.place, error);
            let mut found = discovery.find_all(runtime, Some(kind), [name]).into_iter();
            let found = found.next().unwrap_or_else(|| {
                let reason = format!("no {} is called `{name}`", kind.as_str());
                Err(Fault::Refused { reason, hint: None })
            });
            let plugin = found
                .and_then(|found| Plugin::new(runtime, found, kind, name))
                .map_err(|fault| blamed(fault.into()))?
                .with_options(GivenOptions::Values(asked.options.clone()));
            let running = plugin.start(runtime).map_err(blamed)?;
            let member = Member {
                id: running.descriptor.id.clone(),
                options: running.options.clone(),
                plugin,
            };
            running.close();
            Ok::<_, BenchError>(member)
        };
        let [generator, invocation, fail_policy] = KINDS;
        Ok(Self {
            members: [
                member(generator, &setup.generator)?,
                member(invocation, &setup.invocation)?,
                member(fail_policy, &setup.fail_policy)?,
            ],
            setup: setup.clone(),
        })
    }

    /// The configuration without the parts that depend on the machine.
    fn asked(&self) -> FleetConfig {
        let mut config = self.setup.config.clone();
        config.allowance.memory_bytes = 0;
        config
    }

    /// Stands for all that results depend on, but map, agents, seed, planner and budget.
    pub(crate) fn digest(&self) -> Digest {
        let mut hasher = Hasher::new("fleetyard.crew/2");
        hasher.value(&(self.asked(), &self.setup.robots));
        for member in &self.members {
            hasher.bytes(&member.plugin.digest().0.to_le_bytes());
            hasher.bytes(member.id.as_bytes());
            hasher.bytes(Value::Object(member.options.clone()).to_string().as_bytes());
        }
        hasher.finish()
    }

    /// Simulated time that it drives, in seconds.
    pub(crate) fn duration_s(&self) -> f64 {
        self.setup.config.duration_s
    }

    /// Writes what is asked for into a row.
    pub(crate) fn describe(&self, row: &mut Row) {
        let config = self.asked();
        let [generator, invocation, fail_policy] = &self.members;
        row.budget_ms = config.duration_s * 1e3;
        row.planner_limit_ms = Some(config.limit_s * 1e3);
        row.generator = Some(generator.id.clone());
        row.invocation = Some(invocation.id.clone());
        row.fail_policy = Some(fail_policy.id.clone());
        let mut said = match serde_json::to_value(&config) {
            Ok(Value::Object(said)) => said,
            _ => Map::new(),
        };
        // They have columns of their own.
        said.remove("agents");
        said.remove("seed");
        for (member, kind) in self.members.iter().zip(KINDS) {
            let options = Value::Object(member.options.clone());
            said.insert(format!("{} options", kind.as_str()), options);
        }
        let robots = match &self.setup.robots {
            crate::options::Robots::Pebbles => "pebble",
            crate::options::Robots::Model(name) | crate::options::Robots::File(name, _) => name,
        };
        said.insert("robots".into(), robots.into());
        row.fleet = Some(Value::Object(said).to_string());
    }

    /// Lets a fleet drive.
    pub(crate) fn run(
        &self,
        runtime: &Runtime,
        planner: &Plugin,
        grid: &Arc<Grid>,
        agents: u32,
        seed: u64,
    ) -> Result<Drive, TrialError> {
        let mut config = self.setup.config.clone();
        config.agents = agents;
        config.seed = seed;
        config.sim.disturbance.seed = seed;
        let bodies = self.setup.robots.fleet(agents as usize, &config.sim)?;
        let [generator, invocation, fail_policy] =
            self.members.each_ref().map(|member| &member.plugin);
        let modules = start_modules(runtime, [planner, generator, invocation, fail_policy])?;
        let ground = Ground {
            grid,
            fleet: bodies.as_ref(),
            tasks: None,
            starts: None,
            guidance: None,
        };
        let mut watch = PlannerWatch::default();
        let before = Snapshot::take(None);
        let outcome = run(&ground, &config, modules, &mut watch)?;
        // That is no trial of the planner.
        if let Some(fault) = watch.failed {
            return Err(fault.into());
        }
        // Modules compute on any core, by turns with the simulator: what they waited for is known of
        // the machine alone.
        let load = Snapshot::take(None).since(&before);
        let spent = Spent {
            wall: Duration::from_secs_f64(load.elapsed_ms / 1e3),
            cpu: None,
            cpu_most: None,
            run_delay: None,
            threads: config.allowance.threads,
            call: Call::default(),
        };
        Ok(Drive {
            contended: contended(&load, &spent),
            outcome,
            usage: watch.usage,
            sandbox: watch.sandbox,
            unsupervised: watch.unsupervised,
        })
    }
}

/// Result of a trial.
pub(crate) struct Drive {
    outcome: FleetOutcome,
    /// Of the planner's processes.
    usage: Option<Usage>,
    pub(crate) sandbox: Option<SandboxReport>,
    /// The module that ran without its supervisor, and its fault.
    unsupervised: Option<String>,
    /// Reasons for which times cannot be compared.
    contended: Vec<Reason>,
}

/// Hears what the planner used.
#[derive(Default)]
struct PlannerWatch {
    usage: Option<Usage>,
    sandbox: Option<SandboxReport>,
    unsupervised: Option<String>,
    /// The fault of the host, if it has one.
    failed: Option<Fault>,
}

impl Watch for PlannerWatch {
    fn closed(&mut self, info: &ModuleInfo, closing: Closing) {
        if info.kind == Kind::Planner {
            self.usage = closing.usage;
            self.sandbox = closing.sandbox;
        }
    }

    fn unsupervised(&mut self, info: &ModuleInfo, fault: &Fault) {
        if fault.is_of_host() {
            self.failed.get_or_insert_with(|| fault.clone());
        }
        let what = || format!("{} `{}` {fault}", info.kind.as_str(), info.name);
        self.unsupervised.get_or_insert_with(what);
    }
}

impl Drive {
    /// The reason why the row may not be compared with others; `None` when it may.
    pub(crate) fn unranked(&self, attach: Attach, limits: &Limits) -> Option<String> {
        let (sandbox, usage) = (self.sandbox.as_ref(), self.usage.as_ref());
        let work = Some(self.outcome.metrics.planner_work());
        let unranked = || unranked(attach, limits, sandbox, usage, work, []);
        self.unsupervised.clone().or_else(unranked)
    }

    /// Writes the result into a row. The trial succeeded if the fleet drove to the end and nobody
    /// touched anything.
    pub(crate) fn fill(&self, row: &mut Row) {
        let FleetOutcome {
            metrics,
            execution,
            events,
            ..
        } = &self.outcome;
        row.termination = "completed".into();
        row.valid = metrics.invalid_batches == 0;
        row.violations = metrics.invalid_batches;
        let first = |kind| events.iter().find(|event| event.kind == kind);
        let invalid = first(EventKind::InvalidBatch);
        row.first_violation = invalid.map(|event| event.message.clone());
        let fault = first(EventKind::PlannerFault);
        row.fault = fault.map(|event| format!("at {} s: {}", event.time_s, event.message));
        row.success = execution.figures.contacts == 0;
        if let Some(what) = &self.unsupervised {
            row.termination = Termination::Failed.to_string();
            row.fault = Some(what.clone());
            row.success = false;
        }
        row.limits_watched = watched(self.sandbox.as_ref());
        row.devices = devices(self.sandbox.as_ref());
        row.clock = Some(Clock::Host.name().to_owned());
        row.found_contended(&self.contended);
        let times = &metrics.planner_time_ms;
        row.solve_time_ms = times.mean;
        row.planning_time_ms = times.mean * metrics.planner_calls as f64;
        row.planner_call_max_ms = Some(times.max);
        row.cpu_between_calls_ms = metrics.planner_cpu_between_calls_ms;
        row.planner_calls = Some(metrics.planner_calls);
        row.fail_policy_ratio = Some(metrics.fail_policy_ratio);
        row.all_waits = Some(metrics.all_waits);
        row.invalid_batches = Some(metrics.invalid_batches);
        row.rings_cut = Some(metrics.rings_cut);
        row.waiting_share = Some(metrics.waiting_share);
        row.adg_nodes_max = Some(metrics.adg_nodes_max as u64);
        row.goals_reached = Some(metrics.goals_reached);
        row.goals_committed = Some(metrics.goals_committed);
        row.throughput_per_s = Some(metrics.throughput_per_s);
        row.executed(&execution.figures);
        if let Some(usage) = &self.usage {
            row.peak_memory_kb = usage.peak_memory_kb;
            let micros = usage
                .user_us
                .map(|user| user + usage.system_us.unwrap_or(0));
            row.cpu_time_ms = micros.map(|micros| micros as f64 / 1e3);
        }
    }
}
