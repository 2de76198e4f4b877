//! One trial as a record: the keys of `--format json`, and its text form.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use fleetyard_abi::Status;
use fleetyard_check::{Verdict, Violation};
use fleetyard_core::Digest;
use fleetyard_runtime::measure::{Cpus, Difference, Machine, Reason};
use fleetyard_runtime::{Attach, CodeFile, Layer, Level, Limit, SandboxReport, Termination, Usage};
use fleetyard_sim::Policy;
use serde::Serialize;

use crate::claims::Claim;
use crate::exit::Exit;

/// Everything there is to say about one run. Values that do not exist are
/// absent, never zero.
#[derive(Debug, Serialize)]
pub(crate) struct Record {
    pub(crate) fleetyard: &'static str,
    pub(crate) planner: PlannerInfo,
    pub(crate) instance: InstanceInfo,
    pub(crate) budget: BudgetInfo,
    /// How the call ended.
    pub(crate) termination: Termination,
    /// What is wrong with the plugin, if something is.
    pub(crate) fault: Option<String>,
    /// Whether the plugin was stopped, rather than ending its call by itself.
    pub(crate) stopped: bool,
    /// The limit that it exceeded, whether it was stopped for it or not.
    pub(crate) limit: Option<Limit>,
    /// From the decision to stop it until nobody was left.
    pub(crate) kill_latency_ms: Option<f64>,
    /// What the planner claims.
    pub(crate) claim: Option<Status>,
    /// The planner's explanation.
    pub(crate) message: Option<String>,
    /// What the host found.
    pub(crate) verdict: VerdictInfo,
    pub(crate) metrics: Metrics,
    /// Figures that the planner reported of itself.
    pub(crate) claimed_metrics: BTreeMap<String, f64>,
    /// What it claims, held against what the host found.
    pub(crate) claims: Vec<Claim>,
    pub(crate) resources: Option<Usage>,
    pub(crate) measurement: Measurement,
    /// The layers that were active; absent in process, where there are none.
    pub(crate) sandbox: Option<SandboxReport>,
    pub(crate) environment_digest: Option<Digest>,
    pub(crate) execution: Option<ExecutionInfo>,
    pub(crate) instance_digest: Digest,
    pub(crate) plan_digest: Option<Digest>,
}

#[derive(Debug, Serialize)]
pub(crate) struct PlannerInfo {
    pub(crate) id: String,
    pub(crate) version: String,
    pub(crate) attach: Attach,
    /// In the host's own process nothing is isolated, so the result may not be
    /// compared with others.
    pub(crate) ranked: bool,
    pub(crate) path: Option<String>,
    /// Of the plugin's code; of this program, for built-ins.
    pub(crate) digest: Option<Digest>,
    /// Its files with their SHA-256; none for built-ins.
    pub(crate) code: Vec<CodeFile>,
    /// Whether the lock file has just this code.
    pub(crate) pinned: bool,
    pub(crate) options: serde_json::Value,
}

/// How the times were taken, and what stood in the way.
#[derive(Debug, Serialize)]
pub(crate) struct Measurement {
    /// From the start of the plugin until it had introduced itself, the sandbox
    /// included.
    pub(crate) startup_ms: f64,
    pub(crate) prepare: Option<CallInfo>,
    pub(crate) plan: CallInfo,
    /// The processors that the plugin had to itself.
    pub(crate) cpus: Option<Cpus>,
    /// Those that were kept idle for it.
    pub(crate) idle_siblings: Option<Cpus>,
    /// Why it had none.
    pub(crate) not_pinned: Option<String>,
    /// What happened on the machine during `prepare` and `plan`.
    pub(crate) load: Difference,
    /// Why the times cannot be compared with others; empty when they can.
    pub(crate) contended: Vec<Reason>,
    pub(crate) machine_digest: Digest,
    pub(crate) machine: &'static Machine,
}

/// What a call used.
#[derive(Debug, Serialize)]
pub(crate) struct CallInfo {
    pub(crate) cpu_ms: Option<f64>,
    pub(crate) run_delay_ms: Option<f64>,
}

#[derive(Debug, Serialize)]
pub(crate) struct InstanceInfo {
    pub(crate) map: String,
    pub(crate) scenario: String,
    pub(crate) agents: usize,
    pub(crate) connectivity: u32,
}

#[derive(Debug, Serialize)]
pub(crate) struct BudgetInfo {
    pub(crate) wall_ms: f64,
    pub(crate) prepare_wall_ms: f64,
    pub(crate) grace_ms: Option<f64>,
    pub(crate) cpu_ms: Option<f64>,
    pub(crate) prepare_cpu_ms: Option<f64>,
    pub(crate) memory_bytes: Option<u64>,
    pub(crate) prepare_memory_bytes: Option<u64>,
    pub(crate) processes: u32,
    pub(crate) output_bytes: u64,
    pub(crate) disk_bytes: u64,
    pub(crate) nodes: Option<u64>,
    pub(crate) threads: u32,
    pub(crate) seed: u64,
}

#[derive(Debug, Default, Serialize)]
pub(crate) struct VerdictInfo {
    pub(crate) valid: bool,
    pub(crate) violation_count: u64,
    pub(crate) violations: Vec<Violation>,
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
        }
    }
}

#[derive(Debug, Default, Serialize)]
pub(crate) struct Metrics {
    pub(crate) soc_steps: Option<u64>,
    pub(crate) makespan_steps: Option<u64>,
    pub(crate) lower_bound_steps: u64,
    /// SoC over lower bound, of a valid plan.
    pub(crate) suboptimality: Option<f64>,
    pub(crate) length_m: Option<f64>,
    pub(crate) lower_bound_m: f64,
    pub(crate) waits: Option<u64>,
    pub(crate) planning_time_ms: f64,
    pub(crate) prepare_time_ms: Option<f64>,
    pub(crate) first_solution_ms: Option<f64>,
    pub(crate) incumbents: Vec<IncumbentInfo>,
    /// Plans that came after the deadline and do not count.
    pub(crate) late_plans: u64,
}

#[derive(Debug, Serialize)]
pub(crate) struct IncumbentInfo {
    pub(crate) time_ms: f64,
    pub(crate) soc_steps: Option<u64>,
    pub(crate) valid: Option<bool>,
}

#[derive(Debug, Serialize)]
pub(crate) struct ExecutionInfo {
    pub(crate) policy: Policy,
    pub(crate) agents: u32,
    pub(crate) arrived: u32,
    pub(crate) makespan_s: Option<f64>,
    pub(crate) sum_of_costs_s: Option<f64>,
    pub(crate) ticks: u64,
    pub(crate) rtf: f64,
    pub(crate) simulated_s: f64,
    pub(crate) wall_ms: f64,
    pub(crate) contacts: u64,
    pub(crate) contacts_agent_agent: u64,
    pub(crate) contacts_agent_obstacle: u64,
    pub(crate) nearest_approach_m: Option<f64>,
    pub(crate) tracking_error_max_m: f64,
    pub(crate) tracking_error_mean_m: f64,
    pub(crate) radius_m: f64,
    /// Largest resident set of the host so far, the simulator's included.
    pub(crate) host_peak_memory_kb: Option<u64>,
    pub(crate) trace_digest: Digest,
}

/// Which layers were active, in one line.
fn sandbox_line(sandbox: &SandboxReport) -> String {
    if sandbox.level == Level::None {
        return "none, unranked".into();
    }
    let active = sandbox.layers.iter().filter(|state| state.active).count();
    let refused: Vec<&str> = sandbox
        .refused()
        .map(|state| state.layer.as_str())
        .collect();
    let mut text = format!("{active} of {} layers", Layer::ALL.len());
    if !refused.is_empty() {
        let _ = write!(text, "; refused: {}", refused.join(", "));
    }
    text
}

/// A number without needless digits.
pub(crate) fn number(value: f64) -> String {
    let digits = match value.abs() {
        size if size >= 1000.0 => 0,
        size if size >= 10.0 => 1,
        size if size >= 0.1 => 2,
        _ => 4,
    };
    format!("{value:.digits$}")
}

impl Record {
    /// How the command should end.
    pub(crate) fn exit(&self) -> Exit {
        match self.termination {
            Termination::Crashed
            | Termination::Exited
            | Termination::ProtocolError
            | Termination::Failed => Exit::Plugin,
            Termination::Unsupported => Exit::NoPlan,
            Termination::Completed | Termination::TimedOut | Termination::OverLimit => {
                match self.plan_digest {
                    None => Exit::NoPlan,
                    Some(_) if self.verdict.valid => Exit::Success,
                    Some(_) => Exit::InvalidPlan,
                }
            }
        }
    }

    pub(crate) fn succeeded(&self) -> bool {
        self.exit() == Exit::Success
    }

    /// Claims that are not what the host found.
    pub(crate) fn disagreements(&self) -> impl Iterator<Item = &Claim> {
        let claims = self.claims.iter();
        claims.filter(|claim| claim.agrees == Some(false))
    }

    /// For people.
    pub(crate) fn text(&self) -> String {
        let mut out = String::new();
        let mut line = |name: &str, value: String| {
            // Writing to a string cannot fail.
            let _ = writeln!(out, "{name:<18}{value}");
        };
        let attach = match self.planner.attach {
            Attach::InProcess => "in the host's process, unranked",
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
        match (
            self.plan_digest,
            self.verdict.valid,
            self.verdict.violation_count,
        ) {
            (None, ..) => line("verdict", "no plan".into()),
            (_, true, _) => line("verdict", "valid".into()),
            (.., count) => line("verdict", format!("INVALID, {count} violations")),
        }
        for violation in self.verdict.violations.iter().take(5) {
            line("", violation.sentence.clone());
        }
        for claim in self.disagreements() {
            line("false claim", claim.to_string());
        }
        let metrics = &self.metrics;
        let bound = metrics.lower_bound_steps;
        if let (Some(soc), Some(makespan)) = (metrics.soc_steps, metrics.makespan_steps) {
            let ratio = metrics
                .suboptimality
                .map_or(String::new(), |r| format!(", ratio {r:.3}"));
            line(
                "sum of costs",
                format!("{soc} steps (lower bound {bound}{ratio})"),
            );
            line("makespan", format!("{makespan} steps"));
        } else {
            line("lower bound", format!("{bound} steps"));
        }
        if let Some(length) = metrics.length_m {
            line("path length", format!("{} m", number(length)));
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
            let cpu = cpu_us.map(|us| format!("{} ms CPU", number(us as f64 / 1000.0)));
            let memory = usage
                .peak_memory_kb
                .map(|kb| format!("{:.0} MiB", kb as f64 / 1024.0));
            let parts: Vec<String> = [cpu, memory].into_iter().flatten().collect();
            line("plugin process", parts.join(", "));
        }
        if let Some(sandbox) = &self.sandbox {
            line("sandbox", sandbox_line(sandbox));
        }
        for reason in &self.measurement.contended {
            line("contended", reason.to_string());
        }
        if let Some(execution) = &self.execution {
            let ExecutionInfo {
                simulated_s,
                wall_ms,
                rtf,
                ..
            } = execution;
            let (simulated_s, wall_ms) = (number(*simulated_s), number(*wall_ms));
            let rtf = number(*rtf);
            line(
                "execution",
                format!("{simulated_s} s simulated in {wall_ms} ms (RTF {rtf})"),
            );
            let nearest = execution
                .nearest_approach_m
                .map_or("none".into(), |distance| {
                    format!("{distance:.3} m between centres")
                });
            line("contacts", execution.contacts.to_string());
            line("nearest approach", nearest);
            line(
                "tracking error",
                format!("{:.4} m at most", execution.tracking_error_max_m),
            );
            line("trace digest", execution.trace_digest.to_string());
        }
        line("instance digest", self.instance_digest.to_string());
        if let Some(digest) = self.plan_digest {
            line("plan digest", digest.to_string());
        }
        out.truncate(out.trim_end().len());
        out
    }
}
