//! One trial as a record: the keys of `--format json`, and its text form.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::time::Duration;

use fleetyard_abi::Status;
use fleetyard_check::{PathRule, Verdict, Violation};
use fleetyard_core::{Digest, Words as _, one_line};
use fleetyard_runtime::measure::{Cpus, Difference, Machine, Reason};
use fleetyard_runtime::{
    Attach, BrokenPromise, CodeFile, Fault, Layer, Level, Limit, Limits, SandboxReport, Source,
    Termination, Usage, Work,
};
use fleetyard_sim::{Figures, Policy};
use fleetyard_views::{Judged, Representation};
use serde::Serialize;

use crate::claims::Claim;
use crate::correction::Correction;
use crate::failure::is_invalid;

/// Everything there is to say about one run. Values that do not exist are
/// absent, never zero.
#[derive(Debug, Serialize)]
pub struct Record {
    /// Version of this program.
    pub fleetyard: &'static str,
    /// The planner that was asked.
    pub planner: PlannerInfo,
    /// The instance that it was asked.
    pub instance: InstanceInfo,
    /// The budget that it might use.
    pub budget: BudgetInfo,
    /// The end of the call.
    pub termination: Termination,
    /// The fault of the plugin, if it has one.
    pub fault: Option<String>,
    /// True if the plugin was stopped, rather than ending its call by itself.
    pub stopped: bool,
    /// The limit that it exceeded, whether it was stopped for it or not.
    pub limit: Option<Limit>,
    /// The budget of wall time was spent, or nearly: another run may end with another plan.
    pub ended_by_clock: bool,
    /// From the decision to stop it until nobody was left.
    pub kill_latency_ms: Option<f64>,
    /// The planner's claim.
    pub claim: Option<Status>,
    /// The planner's explanation.
    pub message: Option<String>,
    /// The host's verdict.
    pub verdict: VerdictInfo,
    /// The verdicts on a plan of a view, by its rules and by footprints in the world.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub judged: Option<Judged>,
    /// Figures of the plan and of the call.
    pub metrics: Metrics,
    /// Figures that the planner reported of itself.
    pub claimed_metrics: BTreeMap<String, f64>,
    /// Facts that the planner noted about its inputs.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub notes: BTreeMap<String, String>,
    /// Its claims, held against what the host found.
    pub claims: Vec<Claim>,
    /// The parts of the host's process that it did not leave as they were, where it was called
    /// there.
    pub broken_promises: Vec<BrokenPromise>,
    /// The use of the plugin's processes in all; absent in process, and while they are kept.
    pub resources: Option<Usage>,
    /// The conditions under which times were taken.
    pub measurement: Measurement,
    /// The layers that were active and the limits that were enforced; absent in process,
    /// where there are none.
    pub sandbox: Option<SandboxReport>,
    /// Stands for the plugin's whole environment.
    pub environment_digest: Option<Digest>,
    /// The plan's execution.
    pub execution: Option<ExecutionInfo>,
    /// Digest of the instance.
    pub instance_digest: Digest,
    /// Digest of the plan.
    pub plan_digest: Option<Digest>,
}

/// A planner, as it was asked.
#[derive(Debug, Serialize)]
pub struct PlannerInfo {
    /// Its identifier.
    pub id: String,
    /// Its version.
    pub version: String,
    /// The attachment.
    pub attach: Attach,
    /// True if the result may be compared with others.
    pub ranked: bool,
    /// The reason why it may not: nothing is isolated in the host's own process and without a
    /// sandbox,
    /// nobody was held to a limit whose supervisor was lost, processor time that is limited
    /// has to be known, and who works between its calls has longer than its budget.
    pub unranked: Option<String>,
    /// Its file; absent for built-ins.
    pub path: Option<String>,
    /// Of the plugin's code; of this program, for built-ins.
    pub digest: Digest,
    /// Its files with their SHA-256; none for built-ins.
    pub code: Vec<CodeFile>,
    /// True if the lock file has just this code.
    pub pinned: bool,
    /// Its options.
    pub options: serde_json::Value,
}

/// The conditions under which times were taken, and what stood in the way.
#[derive(Debug, Serialize)]
pub struct Measurement {
    /// From the start of the plugin until it had introduced itself, the sandbox
    /// included.
    pub startup_ms: Option<f64>,
    /// While it learnt the map.
    pub prepare: Option<CallInfo>,
    /// While it planned.
    pub plan: CallInfo,
    /// The host meanwhile.
    pub host: HostInfo,
    /// The processors that the plugin had to itself.
    pub cpus: Option<Cpus>,
    /// Those that were kept idle for it.
    pub idle_siblings: Option<Cpus>,
    /// The reason why it had none.
    pub not_pinned: Option<String>,
    /// The load of the machine during `prepare` and `plan`.
    pub load: Difference,
    /// The reasons why the times cannot be compared with others; empty when they can.
    pub contended: Vec<Reason>,
    /// Digest of the machine's description.
    pub machine_digest: Digest,
    /// The machine.
    pub machine: &'static Machine,
}

/// The use of a call.
#[derive(Debug, Serialize)]
pub struct CallInfo {
    /// Processor time.
    pub cpu_ms: Option<f64>,
    /// The source of that; it is a lower bound unless it is the control group.
    pub cpu_source: Option<Source>,
    /// The time for which it was ready to run and had no processor.
    pub run_delay_ms: Option<f64>,
    /// Processor time since the call before, or since the plugin was made, until this one began.
    pub cpu_before_ms: Option<f64>,
}

/// The host's own thread while a planner planned.
#[derive(Debug, Serialize)]
pub struct HostInfo {
    /// Processor time.
    pub cpu_ms: Option<f64>,
    /// The time for which it was ready to run and had no processor.
    pub run_delay_ms: Option<f64>,
}

/// An instance.
#[derive(Debug, Serialize)]
pub struct InstanceInfo {
    /// The rule by which paths on a grid are judged.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub path_rule: Option<PathRule>,
    /// Name of the map, or of the task.
    pub map: String,
    /// The origin of starts and goals.
    pub scenario: String,
    /// Number of agents.
    pub agents: usize,
    /// Neighbours of a cell, on a grid.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub connectivity: Option<u32>,
    /// The representation of a view of a task.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub representation: Option<Representation>,
}

/// The budget that a planner might use.
#[derive(Debug, Serialize)]
pub struct BudgetInfo {
    /// Wall time.
    pub wall_ms: f64,
    /// Wall time of learning the map.
    pub prepare_wall_ms: f64,
    /// The time for which it might go on after the deadline.
    pub grace_ms: Option<f64>,
    /// Processor time.
    pub cpu_ms: Option<f64>,
    /// Processor time of learning the map.
    pub prepare_cpu_ms: Option<f64>,
    /// Memory of all processes.
    pub memory_bytes: Option<u64>,
    /// Memory of learning the map.
    pub prepare_memory_bytes: Option<u64>,
    /// Processes and threads.
    pub processes: u32,
    /// Output that is no message.
    pub output_bytes: u64,
    /// Size of the scratch folder.
    pub disk_bytes: u64,
    /// Search nodes.
    pub nodes: Option<u64>,
    /// Threads.
    pub threads: u32,
    /// Seed of every random choice.
    pub seed: u64,
}

/// The validator's findings about the plan.
#[derive(Debug, Default, Serialize)]
pub struct VerdictInfo {
    /// True if it is valid.
    pub valid: bool,
    /// The number of all violations.
    pub violation_count: u64,
    /// The first of them.
    pub violations: Vec<Violation>,
    /// The reason why a plan is none that could be judged.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub no_plan: Option<String>,
}

impl VerdictInfo {
    /// On what is no plan of the instance.
    pub(crate) fn none(reason: String) -> Self {
        Self {
            violation_count: 1,
            no_plan: Some(reason),
            ..Self::default()
        }
    }

    /// Of both judges of a plan of a view.
    pub(crate) fn of_view(judged: &Judged) -> Self {
        Self {
            valid: judged.is_valid(),
            violation_count: judged.sentences().count() as u64,
            ..Self::default()
        }
    }
}

impl From<Verdict> for VerdictInfo {
    fn from(verdict: Verdict) -> Self {
        let Verdict {
            valid,
            violations,
            violation_count,
            ..
        } = verdict;
        Self {
            valid,
            violation_count,
            violations,
            no_plan: None,
        }
    }
}

/// Figures of a plan and of the call.
#[derive(Debug, Default, Serialize)]
pub struct Metrics {
    /// Sum of costs.
    pub soc_steps: Option<u64>,
    /// Step at which the last agent arrives.
    pub makespan_steps: Option<u64>,
    /// Sum of shortest distances.
    pub lower_bound_steps: u64,
    /// SoC over lower bound, of a valid plan.
    pub suboptimality: Option<f64>,
    /// Length of all paths in cells: of the lines between the cells of each.
    pub length_cells: Option<u64>,
    /// Length of all paths.
    pub length_m: Option<f64>,
    /// Sum over agents of the time of their last arrival in the world of a task.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub soc_s: Option<f64>,
    /// The latest of these times.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub makespan_s: Option<f64>,
    /// Sum of the lengths of shortest paths.
    pub lower_bound_m: f64,
    /// Steps in which an agent waits before it has arrived.
    pub waits: Option<u64>,
    /// Agents whose paths end at their goals, in the plan or in what the planner left; absent in the
    /// plane.
    pub agents_at_goal: Option<u64>,
    /// The share of these in all agents.
    pub individual_success: Option<f64>,
    /// By the host's clock, transport included.
    pub planning_time_ms: f64,
    /// As the plugin's process claims it, without transport.
    pub call_time_ms: Option<f64>,
    /// From the request to the last byte of the answer, by the host's clock.
    pub round_trip_ms: Option<f64>,
    /// The part of it that the host's own work and other processes may have taken.
    pub held_up_ms: Option<f64>,
    /// The part of it that an empty call takes, where that was measured.
    pub correction: Option<Correction>,
    /// Of learning the map, also where the planner ended there and was not asked for a plan; absent
    /// when the map was known.
    pub prepare_time_ms: Option<f64>,
    /// Until the first valid plan had come.
    pub first_solution_ms: Option<f64>,
    /// The plans that came in time.
    pub incumbents: Vec<IncumbentInfo>,
    /// Plans that came after the deadline and do not count.
    pub late_plans: u64,
}

/// A plan that came in time.
#[derive(Debug, Serialize)]
pub struct IncumbentInfo {
    /// Time of its arrival, from the start of the call.
    pub time_ms: f64,
    /// Sum of costs.
    pub soc_steps: Option<u64>,
    /// True if it is valid.
    pub valid: Option<bool>,
}

/// The figures of an execution.
#[derive(Debug, Serialize)]
pub struct ExecutionInfo {
    /// The policy that decided when agents went on.
    pub policy: Policy,
    /// Number of agents.
    pub agents: u32,
    /// The number of those that arrived.
    pub arrived: u32,
    /// Time at which the last one arrived.
    pub makespan_s: Option<f64>,
    /// Sum of arrivals.
    pub sum_of_costs_s: Option<f64>,
    /// The figures of every execution.
    #[serde(flatten)]
    pub figures: Figures,
    /// Wall time.
    pub wall_ms: f64,
    /// Largest distance from the plan.
    pub tracking_error_max_m: f64,
    /// Largest difference of headings from the plan's, where it gives them.
    pub tracking_error_max_rad: Option<f64>,
    /// Mean distance from the plan.
    pub tracking_error_mean_m: f64,
    /// Largest resident set of the host so far, the simulator's included.
    pub host_peak_memory_kb: Option<u64>,
}

/// The reason why a result may not be compared with others; `None` when it may.
pub(crate) fn unranked<'f>(
    attach: Attach,
    limits: &Limits,
    sandbox: Option<&SandboxReport>,
    usage: Option<&Usage>,
    work: Option<Work>,
    faults: impl IntoIterator<Item = &'f Fault>,
) -> Option<String> {
    let mut faults = faults.into_iter();
    if let Some(lost) = faults.find(|fault| matches!(fault, Fault::Unsupervised { .. })) {
        return Some(format!("it {lost}"));
    }
    if attach == Attach::InProcess {
        return Some("it ran in the host's own process".into());
    }
    if limits.policy.level == Level::None {
        return Some("it ran without a sandbox".into());
    }
    let cpu_is_limited = limits.cpu.is_some() || limits.prepare_cpu.is_some();
    if cpu_is_limited && sandbox.is_some_and(|sandbox| sandbox.only_watches(Limit::Cpu)) {
        return Some("its limit of processor time was only watched, not enforced".into());
    }
    if usage.is_some_and(|usage| usage.cpu_lost) {
        return Some("processes of it ended without their processor time being known".into());
    }
    work.and_then(Work::excess)
}

/// The limits that were only watched, if there are any.
pub(crate) fn watched(sandbox: Option<&SandboxReport>) -> Option<String> {
    let watched = sandbox.into_iter().flat_map(SandboxReport::watched);
    let watched: Vec<String> = watched.map(|state| state.limit.to_string()).collect();
    (!watched.is_empty()).then(|| watched.join(", "))
}

/// The devices that a plugin was granted.
pub(crate) fn devices(sandbox: Option<&SandboxReport>) -> Option<String> {
    let devices = sandbox.map_or(&[][..], |sandbox| &sandbox.devices).iter();
    let devices: Vec<String> = devices.map(|path| path.display().to_string()).collect();
    (!devices.is_empty()).then(|| devices.join(", "))
}

/// The layers that were active and the limits that were only watched, in one line.
fn sandbox_line(sandbox: &SandboxReport) -> String {
    if sandbox.level == Level::None {
        return "none".into();
    }
    let active = sandbox.layers.iter().filter(|state| state.active).count();
    let refused: Vec<&str> = sandbox.refused().map(|state| state.layer.name()).collect();
    let mut text = format!("{active} of {} layers", Layer::ALL.len());
    if let Some(filter) = &sandbox.seccomp
        && sandbox.level == Level::Strict
    {
        let _ = write!(text, ", system calls by the {}", filter.profile.name());
    }
    if !refused.is_empty() {
        let _ = write!(text, "; refused: {}", refused.join(", "));
    }
    if let Some(limits) = watched(Some(sandbox)) {
        let _ = write!(text, "; limits watched, not enforced: {limits}");
    }
    if let Some(devices) = devices(Some(sandbox)) {
        let _ = write!(
            text,
            "; devices granted, their time and memory not counted: {devices}"
        );
    }
    text
}

/// A duration as records have it.
pub fn milliseconds(duration: Duration) -> f64 {
    duration.as_secs_f64() * 1000.0
}

/// A number without needless digits.
pub fn number(value: f64) -> String {
    let digits = match value.abs() {
        size if size >= 1000.0 => 0,
        size if size >= 10.0 => 1,
        size if size >= 0.1 => 2,
        _ => 4,
    };
    format!("{value:.digits$}")
}

/// The end of a trial, in the words that matter to who asked for it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ending {
    /// With a valid plan.
    Success,
    /// Without a plan: none within the budget, none exists, or the planner does not
    /// support the instance.
    NoPlan,
    /// With a plan that breaks a rule.
    InvalidPlan,
    /// The plugin crashed, broke the protocol or reported an error.
    Plugin,
    /// Before its time, because somebody told the host to end.
    Interrupted,
}

impl Record {
    /// Claims that are not what the host found.
    pub fn disagreements(&self) -> impl Iterator<Item = &Claim> {
        let claims = self.claims.iter();
        claims.filter(|claim| claim.agrees == Some(false))
    }

    /// True if the planner ended while it learnt the map.
    pub fn ended_while_learning(&self) -> bool {
        self.fault.is_some()
            && self.metrics.prepare_time_ms.is_some()
            && self.metrics.planning_time_ms == 0.0
    }

    /// True if the plan keeps the rules of its view; none in the plane, which is the world, and without a
    /// view or a plan.
    pub fn valid_in_view(&self) -> Option<bool> {
        Some(self.judged.as_ref()?.view.as_ref()?.is_valid())
    }

    /// True if the plan of a view is valid by footprints in the world; none if it has no place there.
    pub fn valid_in_world(&self) -> Option<bool> {
        Some(self.judged.as_ref()?.world.as_ref()?.valid)
    }

    /// The violations of the plan that are known, a sentence each.
    pub fn sentences(&self) -> Vec<String> {
        let own = self.verdict.violations.iter();
        let own = own.map(|violation| violation.sentence.clone());
        let judged = self.judged.iter().flat_map(Judged::sentences);
        own.chain(judged)
            .chain(self.verdict.no_plan.clone())
            .collect()
    }

    /// For people.
    pub fn text(&self) -> String {
        let mut out = String::new();
        let mut line = |name: &str, value: String| {
            // Writing to a string cannot fail.
            let _ = writeln!(out, "{name:<18}{}", one_line(&value));
        };
        let attach = match self.planner.attach {
            Attach::InProcess => "in the host's process",
            Attach::Worker => "worker process",
            Attach::Stdio => "JSON over stdio",
            Attach::Command => "command adapter",
        };
        let PlannerInfo { id, version, .. } = &self.planner;
        line("planner", format!("{id} {version} ({attach})"));
        let InstanceInfo {
            map,
            scenario,
            agents,
            ..
        } = &self.instance;
        let map = match self.instance.representation {
            Some(representation) => format!("{map} ({representation})"),
            None => map.clone(),
        };
        line("instance", format!("{map}, {scenario}, {agents} agents"));
        let claim = self
            .claim
            .map_or("none".to_owned(), |claim| claim.to_string());
        line(
            "termination",
            format!("{} (claim: {claim})", self.termination),
        );
        if let Some(message) = &self.message {
            line("message", message.clone());
        }
        if let Some(limit) = self.limit {
            let how = match (self.stopped, self.kill_latency_ms) {
                (true, Some(ms)) => format!("stopped, nobody left after {} ms", number(ms)),
                (true, None) => "stopped".to_owned(),
                (false, _) => "it stopped by itself".to_owned(),
            };
            line("exceeded", format!("{limit} limit ({how})"));
        }
        if self.ended_by_clock {
            let why =
                "it decided: another run may end with another plan; a budget of --nodes does not";
            line("clock", why.into());
        }
        let count = self.verdict.violation_count;
        let is_wrong = self.failure().as_deref().is_some_and(is_invalid);
        line(
            "verdict",
            match self.plan_digest {
                None => "no plan".into(),
                Some(_) if self.verdict.valid => "valid".into(),
                Some(_) if is_wrong => format!("INVALID, {count} violations"),
                Some(_) => format!("no plan; what the planner left has {count} violations"),
            },
        );
        for sentence in self.sentences().into_iter().take(5).filter(|_| is_wrong) {
            line("", sentence);
        }
        for claim in self.disagreements() {
            line("false claim", claim.to_string());
        }
        for promise in &self.broken_promises {
            line("broken promise", promise.to_string());
        }
        let metrics = &self.metrics;
        if let (Some(there), Some(share)) = (metrics.agents_at_goal, metrics.individual_success)
            && share < 1.0
        {
            let agents = self.instance.agents;
            line(
                "at goals",
                format!("{there} of {agents} agents ({:.1} %)", 100.0 * share),
            );
        }
        let bound = metrics.lower_bound_steps;
        if let (Some(soc), Some(makespan)) = (metrics.soc_steps, metrics.makespan_steps) {
            let ratio = metrics
                .suboptimality
                .map_or(String::new(), |r| format!(", ratio {r:.3}"));
            line(
                "sum of costs",
                match self.instance.representation {
                    Some(_) => format!("{soc} steps"),
                    None => format!("{soc} steps (lower bound {bound}{ratio})"),
                },
            );
            line("makespan", format!("{makespan} steps"));
        } else if self.instance.representation.is_none() {
            line("lower bound", format!("{bound} steps"));
        }
        if let Some(length) = metrics.length_m {
            line("path length", format!("{} m", number(length)));
        }
        if let (Some(soc), Some(makespan)) = (metrics.soc_s, metrics.makespan_s) {
            let (soc, makespan) = (number(soc), number(makespan));
            line(
                "in the world",
                format!("sum of costs {soc} s, makespan {makespan} s"),
            );
        }
        let learning = metrics.prepare_time_ms;
        let learning = learning.filter(|learning| *learning > metrics.planning_time_ms);
        if let Some(learning) = learning {
            let ended = if self.ended_while_learning() {
                " (it ended there, and was not asked for a plan)"
            } else {
                ""
            };
            line(
                "learning the map",
                format!("{} ms{ended}", number(learning)),
            );
        }
        let mut planning = format!("{} ms", number(metrics.planning_time_ms));
        if let Some(first) = metrics.first_solution_ms {
            let count = metrics.incumbents.len();
            let _ = write!(
                planning,
                " (first plan after {} ms, {count} plans)",
                number(first)
            );
        }
        line("planning", planning);
        if let Some(usage) = &self.resources {
            let cpu_us = usage
                .user_us
                .map(|user| user + usage.system_us.unwrap_or(0));
            let least = match usage.cpu_source {
                Some(source) if source.is_lower_bound() => "at least ",
                _ => "",
            };
            let cpu = cpu_us.map(|us| format!("{least}{} ms CPU", number(us as f64 / 1000.0)));
            let memory = usage
                .peak_memory_kb
                .map(|kb| format!("{:.0} MiB", kb as f64 / 1024.0));
            let parts: Vec<String> = [cpu, memory].into_iter().flatten().collect();
            line("plugin process", parts.join(", "));
        }
        if let Some(sandbox) = &self.sandbox {
            line("sandbox", sandbox_line(sandbox));
        }
        if let Some(reason) = &self.planner.unranked {
            line("unranked", reason.clone());
        }
        for reason in &self.measurement.contended {
            line("contended", format!("{reason}: {}", reason.cause.remedy()));
        }
        if let Some(execution) = &self.execution {
            let figures = &execution.figures;
            let (simulated_s, rtf) = (number(figures.simulated_s), number(figures.rtf));
            let wall_ms = number(execution.wall_ms);
            line(
                "execution",
                format!("{simulated_s} s simulated in {wall_ms} ms (RTF {rtf})"),
            );
            let nearest = figures
                .nearest_approach_m
                .map_or("none".into(), |distance| {
                    format!("{distance:.3} m between centres")
                });
            line("contacts", figures.contacts.to_string());
            line("nearest approach", nearest);
            line(
                "tracking error",
                format!("{:.4} m at most", execution.tracking_error_max_m),
            );
            line("trace digest", figures.trace_digest.to_string());
        }
        line("instance digest", self.instance_digest.to_string());
        if let Some(digest) = self.plan_digest {
            line("plan digest", digest.to_string());
        }
        out.truncate(out.trim_end().len());
        out
    }
}
