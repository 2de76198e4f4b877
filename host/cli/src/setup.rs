//! From arguments to what runs: the runtime, the sandbox and its limits, plugins by
//! name.

use std::path::{Path, PathBuf};

use fleetyard_abi::Kind;
use fleetyard_bench::{
    BudgetOptions, Host, Plugin, Robots, RobotsError, SandboxOptions, half_of_memory, number,
};
use fleetyard_check::PathRule;
use fleetyard_core::{Grid, InputError, Scenario, find_map, read_file};
use fleetyard_runtime::{
    Attach, Discovery, Fault, Found, LOCK_FILE, Limits, Lock, PluginFile, Policy, Runtime,
    Standing, Trust,
    sandbox::{devices, out_of_reach},
};
use fleetyard_sim::motion::load_fleet;
use fleetyard_sim::{Fleet, SimConfig};
use fleetyard_views::VIEW_FILE_LIMIT;
use serde::Deserialize;

use crate::args::{BudgetArgs, GrantArgs, PinArg, TrustArgs, WorldArgs};
use crate::exit::{Exit, Failure, Result, internal};
use crate::output;

/// The plugins that are linked in, by the same entry that a shared library has.
pub(crate) static BUILT_IN: &[&fleetyard_abi::c::PluginEntry] =
    &[&fleetyard_plugins::fleetyard_plugin_entry_v1];

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

/// The host of trials, with the limits that the arguments ask for. Files that the command itself
/// reads and writes are `hidden` from planners.
pub(crate) fn host(
    arguments: &BudgetArgs,
    attach: Option<Attach>,
    hidden: Vec<PathBuf>,
) -> Result<Host> {
    // In process the planner runs where the host does.
    let apart = attach != Some(Attach::InProcess);
    let sandbox = sandbox(&arguments.sandbox.grants, arguments.sandbox.pin, hidden)?;
    Host::new(BUILT_IN, budget(arguments), sandbox, apart).map_err(internal)
}

fn budget(arguments: &BudgetArgs) -> BudgetOptions {
    let sandbox = &arguments.sandbox;
    BudgetOptions {
        wall: arguments.budget,
        prepare: arguments.prepare_budget,
        startup: arguments.startup,
        grace: arguments.grace,
        cpu: sandbox.cpu,
        prepare_cpu: sandbox.prepare_cpu,
        memory_bytes: sandbox.memory,
        prepare_memory_bytes: sandbox.prepare_memory,
        nodes: arguments.nodes.unwrap_or(BudgetOptions::default().nodes),
        threads: arguments.threads,
    }
}

fn sandbox(grants: &GrantArgs, pin: PinArg, hidden: Vec<PathBuf>) -> Result<SandboxOptions> {
    Ok(SandboxOptions {
        policy: policy(grants, hidden)?,
        output_bytes: grants.output_limit,
        trust: trust(&grants.trust)?,
        pin: pin == PinArg::Auto,
    })
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

/// The grants of the sandbox, and the files that it hides.
pub(crate) fn policy(grants: &GrantArgs, hidden: Vec<PathBuf>) -> Result<Policy> {
    for path in &grants.allow_read {
        if !path.exists() {
            let message = format!("{}: there is no such file or folder", path.display());
            return Err(Failure::new(Exit::Input, message)
                .hint("--allow-read names what the plugin may read"));
        }
    }
    for (name, value) in &grants.env {
        for (folder, reason) in out_of_reach(name, value) {
            output::warning(&format!("--env {name}: {} {reason}", folder.display()));
        }
    }
    let mut granted = Vec::new();
    for name in &grants.allow_device {
        let found = devices(name, grants.sandbox);
        granted.extend(found.map_err(|fault| Failure {
            exit: Exit::Input,
            ..Failure::from(fault)
        })?);
    }
    Ok(Policy {
        level: grants.sandbox,
        devices: granted,
        read: grants.allow_read.clone(),
        hidden,
        network: grants.allow_network,
        env: grants.env.clone(),
        processes: grants.processes,
        disk_bytes: grants.disk,
        ..Policy::default()
    })
}

/// A planner by path, `PATH:ID` or identifier.
pub(crate) fn find_planner(runtime: &Runtime, name: &str) -> Result<Plugin> {
    find_plugin(runtime, Kind::Planner, name)
}

/// The same of any kind.
pub(crate) fn find_plugin(runtime: &Runtime, kind: Kind, name: &str) -> Result<Plugin> {
    let found = find(runtime, Some(kind), name)?;
    Ok(Plugin::new(runtime, found, kind, name)?)
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

/// The warning that a folder of the plugin path cannot be searched.
pub(crate) fn unreadable(folder: &Path, reason: &str) -> String {
    format!(
        "the folder {} of FLEETYARD_PLUGIN_PATH cannot be searched: {reason}",
        folder.display()
    )
}

/// The file of a scenario's map: the one that is named, or `NAME.map` in the folder that is named or
/// else in that of the scenario.
pub(crate) fn map_of(
    scenario: &Scenario,
    file: &Path,
    named: Option<&PathBuf>,
) -> std::result::Result<PathBuf, InputError> {
    let name = scenario.map_name().unwrap_or_default();
    find_map(name, file, named.map_or(&[], std::slice::from_ref), "--map")
}

/// The simulator's parameters from the arguments.
pub(crate) fn sim_config(world: &WorldArgs) -> SimConfig {
    SimConfig {
        cell_size_m: world.cell_size,
        step_s: world.step.unwrap_or(SimConfig::default().step_s),
        radius_m: world.radius,
        ticks_hz: world.ticks_hz,
        substeps: world.substeps,
        tier: world.tier,
        ..SimConfig::default()
    }
}

/// Warns of a map that was made for cells of another side, as the file of its view beside it says.
pub(crate) fn warn_of_cell_size(map: &Path, grid: &Grid, cell_size_m: f64) {
    #[derive(Deserialize)]
    struct Made {
        cell_m: f64,
    }
    let file = map.with_extension("grid.json");
    let read = file.exists().then(|| read_file(&file, VIEW_FILE_LIMIT));
    let made = read.and_then(|read| serde_json::from_slice::<Made>(&read.ok()?).ok());
    let Some(Made { cell_m }) = made else { return };
    if (cell_m - cell_size_m).abs() <= 1e-9 * cell_m {
        return;
    }
    let size = |side_m: f64| {
        let [width, height] = [grid.cols(), grid.rows()].map(|count| f64::from(count) * side_m);
        format!("{} by {} m", number(width), number(height))
    };
    output::warning(&format!(
        "{}: with cells of {} m this is a map of {}; it was made of cells of {} m, and {}",
        map.display(),
        number(cell_size_m),
        size(cell_size_m),
        number(cell_m),
        size(cell_m)
    ));
    output::hint(&format!(
        "{} says so; --cell-size {cell_m} keeps the world's size",
        file.display()
    ));
}

/// The robots of a fleet file, or all of one model; pebbles without either.
pub(crate) fn robots(fleet: Option<&Path>, model: Option<&str>) -> Result<Robots> {
    Ok(match (fleet, model) {
        (Some(path), _) => Robots::File(path.display().to_string(), Box::new(load_fleet(path)?)),
        (None, Some(name)) => Robots::Model(name.to_owned()),
        (None, None) => Robots::Pebbles,
    })
}

/// The bodies of so many robots; pebbles need none.
pub(crate) fn bodies(robots: &Robots, agents: usize, config: &SimConfig) -> Result<Option<Fleet>> {
    robots.fleet(agents, config).map_err(|error| match error {
        RobotsError::File(error) => error.into(),
        error => Failure {
            exit: Exit::Usage,
            message: format!("--model: {error}"),
            hint: error.hint().map(str::to_owned),
        },
    })
}

/// Refuses a path rule that is not for so many agents.
pub(crate) fn check_rule(rule: PathRule, agents: usize) -> Result<()> {
    if rule.allows_agents(agents) {
        return Ok(());
    }
    let message = format!("--path-rule {rule} is for one agent, not for {agents}");
    Err(Failure::new(Exit::Usage, message)
        .hint("such paths have no times, so that nobody can say who meets whom"))
}
