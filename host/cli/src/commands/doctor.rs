//! `fleetyard doctor`: what this machine grants to this user, what each missing layer
//! costs, and what to do about it.

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use clap::Args;
use fleetyard_bench::milliseconds;
use fleetyard_runtime::measure::{Cpus, Machine, Topology};
use fleetyard_runtime::sandbox::Backend;
use fleetyard_runtime::{
    Discovery, Filter, Keeper, LayerState, Level, Limit, LimitState, Policy, Runtime, Trust,
};
use serde::Serialize;

use crate::args::{Format, word};
use crate::exit::{Exit, Result};
use crate::output;
use crate::setup::runtime_with;

/// Say what this machine grants to this user, and what to do about what it does not.
#[derive(Debug, Args)]
pub(crate) struct Doctor {
    /// Say instead which promises about plugins hold on this machine, and what would
    /// restore the others; the exit code is 1 when one is broken
    #[arg(long)]
    pub(crate) security: bool,
    /// The level that is needed; the exit code is 1 when it cannot be had
    #[arg(long, value_name = "LEVEL", value_parser = word::<Level>(), default_value_t)]
    pub(super) sandbox: Level,
    #[command(flatten)]
    pub(super) format: Format,
}

/// Everything that the doctor found.
#[derive(Serialize)]
struct Findings {
    fleetyard: &'static str,
    user: u32,
    machine: Machine,
    sandbox: Sandbox,
    cores: Cores,
    tools: Vec<Tool>,
    plugin_path: Vec<Folder>,
    advice: Vec<String>,
}

#[derive(Serialize)]
struct Sandbox {
    /// True if `--sandbox strict` would run.
    strict: bool,
    backend: Option<Backend>,
    /// The filter of system calls with `--sandbox strict`; absent where that does not run.
    seccomp: Option<Filter>,
    layers: Vec<Finding>,
    limits: Vec<LimitState>,
    /// From start to end of a process that does nothing, median.
    spawn_ms: f64,
    /// The same without any layer.
    spawn_without_ms: f64,
}

#[derive(Serialize)]
struct Finding {
    #[serde(flatten)]
    state: LayerState,
    required: bool,
    /// The loss without it; absent when it is active.
    costs: Option<&'static str>,
    /// A way out; absent when nobody refused it.
    advice: Option<&'static str>,
}

#[derive(Serialize)]
struct Cores {
    physical: Option<u32>,
    /// The logical processors that this process may use.
    usable: Option<Cpus>,
    /// True if a trial of one thread can have a core of its own right now.
    reservable: bool,
    reason: Option<String>,
}

#[derive(Serialize)]
struct Tool {
    name: &'static str,
    /// The purpose of the tool.
    purpose: &'static str,
    version: Option<String>,
}

#[derive(Serialize)]
struct Folder {
    path: String,
    exists: bool,
    /// Files in it that may be plugins.
    candidates: usize,
}

pub(crate) fn doctor(arguments: &Doctor) -> Result<Exit> {
    let findings = examine()?;
    match arguments.format {
        Format::Json => output::print_json(&findings)?,
        Format::Text => output::print(&output::plain(&text(&findings)))?,
    }
    if arguments.sandbox == Level::Strict && !findings.sandbox.strict {
        output::error("this machine does not grant every required layer and limit to this user");
        return Ok(Exit::NoPlan);
    }
    Ok(Exit::Success)
}

fn examine() -> Result<Findings> {
    let sandboxed = level(Level::Auto)?;
    let report = sandboxed.probe()?;
    let memory_is_watched = report.only_watches(Limit::Memory);
    let layers: Vec<Finding> = report.layers.into_iter().map(Finding::from).collect();
    let strict = !memory_is_watched
        && !layers.iter().any(|finding| {
            finding.required && !finding.state.active && finding.state.errno.is_some()
        });
    let seccomp = if strict {
        level(Level::Strict)?.probe()?.seccomp
    } else {
        None
    };
    let sandbox = Sandbox {
        strict,
        backend: report.backend,
        seccomp,
        layers,
        limits: report.limits,
        spawn_ms: spawn(&sandboxed)?,
        spawn_without_ms: spawn(&level(Level::None)?)?,
    };
    let machine = Machine::here().clone();
    let cores = cores(&machine);
    let tools = vec![
        tool("cc", "to build plugins in C", &["--version"]),
        tool("python3", "to run plugins in Python", &["--version"]),
        tool(
            "bwrap",
            "makes namespaces where only it may",
            &["--version"],
        ),
    ];
    let advice = advice(&sandbox, &cores, &machine, &tools);
    Ok(Findings {
        fleetyard: env!("CARGO_PKG_VERSION"),
        user: fleetyard_runtime::user(),
        machine,
        sandbox,
        cores,
        tools,
        plugin_path: Discovery::from_environment()
            .folders
            .iter()
            .map(|folder| Folder::new(folder))
            .collect(),
        advice,
    })
}

/// A runtime that tries a level of the sandbox.
pub(crate) fn level(level: Level) -> Result<Runtime> {
    let policy = Policy {
        level,
        ..Policy::default()
    };
    runtime_with(policy, Trust::default())
}

/// Time that an empty sandbox takes, as the median of a few.
fn spawn(runtime: &Runtime) -> Result<f64> {
    const TIMES: usize = 9;
    let mut times = Vec::with_capacity(TIMES);
    for _ in 0..TIMES {
        let started = Instant::now();
        runtime.probe()?;
        times.push(started.elapsed());
    }
    times.sort();
    Ok(milliseconds(times[TIMES / 2]))
}

impl From<LayerState> for Finding {
    fn from(state: LayerState) -> Self {
        let refused = state.errno.as_deref().filter(|_| !state.active);
        Self {
            required: state.layer.is_required(),
            costs: (!state.active).then(|| state.layer.cost_of_missing()),
            advice: refused.map(|errno| state.layer.advice(errno)),
            state,
        }
    }
}

impl Folder {
    fn new(folder: &Path) -> Self {
        let discovery = Discovery {
            folders: vec![folder.to_owned()],
            named: 0,
        };
        Self {
            path: folder.display().to_string(),
            exists: folder.is_dir(),
            candidates: discovery.count(),
        }
    }
}

fn cores(machine: &Machine) -> Cores {
    let topology = Topology::of_this_process();
    let usable = topology.as_ref().ok().map(|topology| topology.cpus());
    let reserved = topology.and_then(|topology| topology.reserve(1).map(|_| ()));
    Cores {
        physical: machine.physical_cores,
        usable,
        reservable: reserved.is_ok(),
        reason: reserved.err().map(|reason| reason.to_string()),
    }
}

/// The first line of what a program says of its version, if it is there and answers.
fn tool(name: &'static str, purpose: &'static str, arguments: &[&str]) -> Tool {
    Tool {
        name,
        purpose,
        version: first_line(name, arguments),
    }
}

fn first_line(name: &str, arguments: &[&str]) -> Option<String> {
    const PATIENCE: Duration = Duration::from_secs(5);
    let mut child = Command::new(name)
        .args(arguments)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .ok()?;
    let started = Instant::now();
    while child.try_wait().ok()?.is_none() {
        if started.elapsed() > PATIENCE {
            let _ = child.kill();
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    let output = child.wait_with_output().ok()?;
    let text = String::from_utf8_lossy(&output.stdout);
    let line = text.lines().next()?.trim();
    (output.status.success() && !line.is_empty()).then(|| line.to_owned())
}

/// Advice to the user, most important first, each piece once.
fn advice(sandbox: &Sandbox, cores: &Cores, machine: &Machine, tools: &[Tool]) -> Vec<String> {
    let mut advice: Vec<String> = Vec::new();
    for finding in &sandbox.layers {
        if let Some(text) = finding.advice
            && !advice.iter().any(|known| known.ends_with(text))
        {
            advice.push(format!("{}: {text}", finding.state.layer));
        }
    }
    for state in &sandbox.limits {
        if let Some(text) = state.advice()
            && !advice.iter().any(|known| known.ends_with(text))
        {
            advice.push(format!("limit of {}: {text}", state.limit));
        }
    }
    if let (false, Some(reason)) = (cores.reservable, &cores.reason) {
        advice.push(format!("cores: {reason}; times will vary more"));
    }
    if let Some(governor) = machine.governor.as_deref().filter(|g| *g != "performance") {
        advice.push(format!(
            "frequency: the governor is `{governor}`; `cpupower frequency-set -g performance` \
             makes times steadier"
        ));
    }
    if machine.turbo == Some(true) {
        advice.push(
            "frequency: turbo is on, so speed depends on temperature; switch it off for \
             figures that are to be compared"
                .into(),
        );
    }
    if machine.smt == Some(true) {
        advice.push(
            "cores: each runs several threads; the siblings of a trial's cores are kept idle"
                .into(),
        );
    }
    for tool in tools.iter().filter(|tool| tool.version.is_none()) {
        // bwrap is of use only where something is refused, and then advised above.
        if tool.name != "bwrap" {
            advice.push(format!("{}: not found; needed {}", tool.name, tool.purpose));
        }
    }
    advice
}

fn text(findings: &Findings) -> String {
    let Findings {
        machine, sandbox, ..
    } = findings;
    let known = |value: &Option<String>| value.clone().unwrap_or_else(|| "unknown".into());
    let mut parts = vec![format!(
        "machine   {}\nsystem    {}, kernel {}\nuser      {}{}",
        known(&machine.cpu_model),
        known(&machine.os),
        known(&machine.kernel),
        findings.user,
        if findings.user == 0 { " (root)" } else { "" },
    )];
    let rows = sandbox.layers.iter().map(|finding| {
        let state = &finding.state;
        let (active, why) = match (&state.active, &state.errno, &state.reason) {
            (true, _, remark) => ("yes", remark.clone().unwrap_or_default()),
            (false, Some(errno), Some(reason)) => ("refused", format!("{errno}: {reason}")),
            (false, _, reason) => ("no", reason.clone().unwrap_or_default()),
        };
        vec![state.layer.to_string(), active.into(), why]
    });
    parts.push(output::table(
        &["layer", "active", "why not, or not wholly"],
        rows.collect(),
        &[],
    ));
    let lost: Vec<String> = sandbox
        .layers
        .iter()
        .filter(|finding| finding.state.errno.is_some())
        .filter_map(|finding| Some(format!("  {}: {}", finding.state.layer, finding.costs?)))
        .collect();
    if !lost.is_empty() {
        parts.push(format!("What that costs:\n{}", lost.join("\n")));
    }
    let strict = match &sandbox.seccomp {
        Some(Filter {
            profile,
            reason: Some(reason),
        }) => format!(
            "would run, system calls by the {}: {reason}",
            profile.name()
        ),
        Some(Filter { profile, .. }) => {
            format!("would run, system calls by the {}", profile.name())
        }
        None if sandbox.strict => "would run".to_owned(),
        None => "would refuse to run".to_owned(),
    };
    let limits = sandbox.limits.iter().map(|state| {
        let held = match (state.enforced, state.by) {
            (true, Keeper::Kernel) => "enforced by the kernel",
            (true, Keeper::Host) => "enforced by the host",
            (false, _) => "watched, not enforced",
        };
        let why = state.reason.clone().unwrap_or_default();
        vec![state.limit.to_string(), held.into(), why]
    });
    parts.push(output::table(
        &["limit", "how it holds", "why not better"],
        limits.collect(),
        &[],
    ));
    parts.push(format!(
        "--sandbox strict {strict}; a sandbox takes {:.1} ms, a process without one {:.1} ms",
        sandbox.spawn_ms, sandbox.spawn_without_ms,
    ));
    let cores = &findings.cores;
    let mut lines = vec![format!(
        "cores     {} physical, usable {}, {}",
        cores.physical.map_or("?".into(), |count| count.to_string()),
        cores
            .usable
            .as_ref()
            .map_or("unknown".into(), ToString::to_string),
        if cores.reservable {
            "one can be had for a trial"
        } else {
            "none can be had for a trial"
        }
    )];
    for tool in &findings.tools {
        let version = tool.version.as_deref().unwrap_or("not found");
        lines.push(format!("{:<9} {version}", tool.name));
    }
    for folder in &findings.plugin_path {
        let found = match (folder.exists, folder.candidates) {
            (false, _) => "not there".to_owned(),
            (true, 1) => "1 file".to_owned(),
            (true, count) => format!("{count} files"),
        };
        lines.push(format!("plugins   {} ({found})", folder.path));
    }
    parts.push(lines.join("\n"));
    if !findings.advice.is_empty() {
        parts.push(format!(
            "What you can do:\n  {}",
            findings.advice.join("\n  ")
        ));
    }
    parts.join("\n\n")
}
