//! `[budget]`, `[sandbox]` and `[execution]`: what trials may use, and who executes plans.

use std::time::Duration;

use bytesize::ByteSize;
use fleetyard_core::document::{Table, Value};
use fleetyard_core::{InputError, shown};
use fleetyard_runtime::Level;
use fleetyard_sim::motion::load_fleet;
use fleetyard_sim::{Policy, SimConfig, SimError, Tier};

use super::read::{Paths, small};
use crate::options::{BudgetOptions, Robots, SandboxOptions};

pub(super) const BUDGET: &[&str] = &[
    "wall",
    "prepare",
    "startup",
    "grace",
    "cpu",
    "prepare_cpu",
    "memory",
    "prepare_memory",
    "nodes",
    "threads",
];
pub(super) const SANDBOX: &[&str] = &[
    "level",
    "processes",
    "disk",
    "output",
    "read",
    "network",
    "env",
    "pin",
];
pub(super) const EXECUTION: &[&str] = &[
    "execute",
    "model",
    "fleet",
    "cell_size_m",
    "step_s",
    "radius_m",
    "ticks_hz",
    "substeps",
    "tier",
    "policy",
    "delay",
    "velocity_noise",
    "messages",
    "message_period_s",
    "margin_m",
    "seed",
    "until_done",
    "time_limit_s",
    "start_heading_deg",
    "allow_overlaps",
];

fn duration(value: &Value<'_, '_>) -> Result<Duration, InputError> {
    let key = shown(&value.key);
    let hint = "write it with its unit, such as \"500ms\", \"10s\" or \"2m\"";
    let text = value.text().map_err(|error| error.hint(hint))?;
    let duration = humantime::parse_duration(text).map_err(|_| {
        let reason = format!("`{key}` is \"{}\", which is no duration", shown(text));
        value.error(reason).hint(hint)
    })?;
    if duration.is_zero() {
        let reason = format!("`{key}` is zero, so nobody could do anything");
        return Err(value.error(reason));
    }
    // Deadlines are 64-bit nanoseconds; a year is plenty.
    if duration > Duration::from_hours(366 * 24) {
        return Err(value.error(format!("`{key}` is longer than a year")));
    }
    Ok(duration)
}

/// Simulated seconds, which may be none.
pub(super) fn seconds(value: &Value<'_, '_>) -> Result<f64, InputError> {
    let key = shown(&value.key);
    let hint = "write it with its unit, such as \"500ms\", \"10s\" or \"10m\"";
    let text = value.text().map_err(|error| error.hint(hint))?;
    let duration = humantime::parse_duration(text).map_err(|_| {
        let reason = format!("`{key}` is \"{}\", which is no duration", shown(text));
        value.error(reason).hint(hint)
    })?;
    Ok(duration.as_secs_f64())
}

fn size(value: &Value<'_, '_>) -> Result<u64, InputError> {
    let key = shown(&value.key);
    let hint = "write it with its unit, such as \"512MiB\" or \"4GiB\"";
    let text = value.text().map_err(|error| error.hint(hint))?;
    let size: ByteSize = text.parse().map_err(|_| {
        let reason = format!("`{key}` is \"{}\", which is no size", shown(text));
        value.error(reason).hint(hint)
    })?;
    if size.as_u64() < 1 << 12 {
        return Err(value.error(format!("`{key}` is less than 4KiB")));
    }
    Ok(size.as_u64())
}

pub(super) fn budget(value: &Value<'_, '_>) -> Result<BudgetOptions, InputError> {
    let table = value.table("[budget]", BUDGET)?;
    let default = BudgetOptions::default();
    let time = |key| table.get(key).as_ref().map(duration).transpose();
    let bytes = |key| table.get(key).as_ref().map(size).transpose();
    Ok(BudgetOptions {
        wall: time("wall")?.unwrap_or(default.wall),
        prepare: time("prepare")?,
        startup: time("startup")?.unwrap_or(default.startup),
        grace: time("grace")?,
        cpu: time("cpu")?,
        prepare_cpu: time("prepare_cpu")?,
        memory_bytes: bytes("memory")?,
        prepare_memory_bytes: bytes("prepare_memory")?,
        nodes: match table.get("nodes") {
            Some(nodes) => nodes.whole(1, u64::MAX)?,
            None => default.nodes,
        },
        threads: match table.get("threads") {
            Some(threads) => small(&threads, 1, 4096)?,
            None => default.threads,
        },
    })
}

const LEVELS: &[(&str, Level)] = &[
    ("strict", Level::Strict),
    ("auto", Level::Auto),
    ("none", Level::None),
];

pub(super) fn sandbox(
    value: &Value<'_, '_>,
    paths: &Paths<'_>,
) -> Result<SandboxOptions, InputError> {
    let table = value.table("[sandbox]", SANDBOX)?;
    let mut sandbox = SandboxOptions::default();
    let policy = &mut sandbox.policy;
    if let Some(level) = table.get("level") {
        policy.level = level.choice(LEVELS)?;
    }
    if let Some(processes) = table.get("processes") {
        policy.processes = small(&processes, 2, 100_000)?;
    }
    if let Some(disk) = table.get("disk") {
        policy.disk_bytes = size(&disk)?;
    }
    if let Some(output) = table.get("output") {
        sandbox.output_bytes = size(&output)?;
    }
    if let Some(read) = table.get("read") {
        for item in read.one_or_more()? {
            policy.read.push(paths.path(&item)?.path);
        }
    }
    if let Some(network) = table.get("network") {
        policy.network = network.flag()?;
    }
    if let Some(env) = table.get("env") {
        for (name, value) in env.names("`env`")?.values() {
            if name.is_empty() || name.contains(['=', '\0']) {
                let reason = format!("`{}` cannot be the name of a variable", shown(name));
                return Err(value.error(reason));
            }
            policy.env.push((name.to_owned(), paths.expanded(&value)?));
        }
    }
    if let Some(pin) = table.get("pin") {
        sandbox.pin = pin.flag()?;
    }
    Ok(sandbox)
}

const TIERS: &[(&str, Tier)] = &[("kinematic", Tier::Kinematic), ("contact", Tier::Contact)];
const POLICIES: &[(&str, Policy)] = &[("time", Policy::Time), ("adg", Policy::Adg)];

/// The simulator's parameters, and the robots unless nobody executes anything.
pub(super) fn execution(
    value: &Value<'_, '_>,
    paths: &Paths<'_>,
) -> Result<(SimConfig, Option<Robots>), InputError> {
    let table = value.table("[execution]", EXECUTION)?;
    let mut config = SimConfig::default();
    let set = |key, to: &mut f64| -> Result<(), InputError> {
        if let Some(value) = table.get(key) {
            *to = value.number()?;
        }
        Ok(())
    };
    set("cell_size_m", &mut config.cell_size_m)?;
    set("step_s", &mut config.step_s)?;
    set("message_period_s", &mut config.message_period_s)?;
    set("margin_m", &mut config.margin_m)?;
    let number = |key| table.get(key).map(|value| value.number()).transpose();
    config.radius_m = number("radius_m")?;
    config.time_limit_s = number("time_limit_s")?;
    if let Some(degrees) = number("start_heading_deg")? {
        config.start_heading_rad = degrees.to_radians();
    }
    for (key, to) in [
        ("ticks_hz", &mut config.ticks_hz),
        ("substeps", &mut config.substeps),
    ] {
        if let Some(value) = table.get(key) {
            *to = small(&value, 1, u32::MAX)?;
        }
    }
    for (key, to) in [
        ("until_done", &mut config.until_done),
        ("allow_overlaps", &mut config.overlapping_starts),
    ] {
        if let Some(value) = table.get(key) {
            *to = value.flag()?;
        }
    }
    if let Some(tier) = table.get("tier") {
        config.tier = tier.choice(TIERS)?;
    }
    if let Some(policy) = table.get("policy") {
        config.policy = policy.choice(POLICIES)?;
    }
    if let Some(seed) = table.get("seed") {
        config.disturbance.seed = seed.whole(0, u64::MAX)?;
    }
    config.disturbance.delay = parsed(&table, "delay")?.unwrap_or_default();
    config.disturbance.velocity = parsed(&table, "velocity_noise")?.unwrap_or_default();
    config.disturbance.messages = parsed(&table, "messages")?.unwrap_or_default();
    config.validate().map_err(|error| blamed(&table, &error))?;
    let robots = robots(&table, &config, paths)?;
    let execute = match table.get("execute") {
        Some(execute) => execute.flag()?,
        None => true,
    };
    Ok((config, execute.then_some(robots)))
}

/// What is written as on the command line.
fn parsed<T: std::str::FromStr<Err = SimError>>(
    table: &Table<'_, '_>,
    key: &'static str,
) -> Result<Option<T>, InputError> {
    table.get(key).as_ref().map(parsed_value).transpose()
}

/// A value that is written as on the command line.
pub(super) fn parsed_value<T: std::str::FromStr<Err = SimError>>(
    value: &Value<'_, '_>,
) -> Result<T, InputError> {
    let parsed = value.text()?.parse();
    parsed.map_err(|error: SimError| hinted(value.error(error.to_string()), error.hint()))
}

fn hinted(error: InputError, hint: Option<&str>) -> InputError {
    InputError {
        hint: hint.map(str::to_owned),
        ..error
    }
}

/// An error of the simulator at the key that it is about.
fn blamed(table: &Table<'_, '_>, error: &SimError) -> InputError {
    let key = match error {
        SimError::Config { field, .. } => EXECUTION.iter().find(|key| *key == field),
        _ => None,
    };
    let value = key.and_then(|key| table.get(key));
    let reason = error.to_string();
    let fault = value.map_or_else(|| table.error(&reason), |value| value.error(&reason));
    hinted(fault, error.hint())
}

fn robots(
    table: &Table<'_, '_>,
    config: &SimConfig,
    paths: &Paths<'_>,
) -> Result<Robots, InputError> {
    match (table.get("model"), table.get("fleet")) {
        (Some(_), Some(fleet)) => Err(fleet
            .error("`model` and `fleet` are two ways to say who executes plans")
            .hint("remove one of them")),
        (None, Some(fleet)) => {
            if let Some(radius) = table.get("radius_m") {
                return Err(radius.error("the robots of a `fleet` have footprints of their own"));
            }
            let path = paths.path(&fleet)?.path;
            let file = load_fleet(&path).map_err(|error| fleet.place().error_in_file(error))?;
            Ok(Robots::File(path.display().to_string(), Box::new(file)))
        }
        (Some(model), None) => {
            let robots = Robots::Model(model.text()?.to_owned());
            match robots.fleet(1, config) {
                Ok(_) => Ok(robots),
                Err(error) => Err(hinted(model.error(error.to_string()), error.hint())),
            }
        }
        (None, None) => Ok(Robots::Pebbles),
    }
}
