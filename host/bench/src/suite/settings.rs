//! `[budget]`, `[sandbox]` and `[execution]`: what trials may use, and who executes plans.

use std::str::FromStr;
use std::time::Duration;

use bytesize::ByteSize;
use fleetyard_core::document::{Fault, Value, between, text};
use fleetyard_core::{InputError, shown};
use fleetyard_runtime::Level;
use fleetyard_sim::motion::load_fleet;
use fleetyard_sim::noise::{Delay, Disturbance, Messages, VelocityNoise};
use fleetyard_sim::{SimConfig, SimError};
use serde::{Deserialize, Deserializer};

use super::read::Paths;
use crate::options::{Robots, SandboxOptions};

/// Reads a duration with its unit, such as `10s`.
pub(crate) fn duration<'de, D, T>(deserializer: D) -> Result<T, D::Error>
where
    D: Deserializer<'de>,
    T: From<Duration>,
{
    let hint = "write it with its unit, such as \"500ms\", \"10s\" or \"2m\"";
    text(deserializer, hint, |text| {
        let duration = time(text, hint)?;
        if duration.is_zero() {
            return Err(Fault::new("it is zero, so nobody could do anything"));
        }
        // Deadlines are 64-bit nanoseconds; a year is plenty.
        if duration > Duration::from_hours(366 * 24) {
            return Err(Fault::new("it is longer than a year"));
        }
        Ok(duration.into())
    })
}

/// Reads simulated seconds, which may be none.
pub(super) fn seconds<'de, D, T>(deserializer: D) -> Result<T, D::Error>
where
    D: Deserializer<'de>,
    T: From<f64>,
{
    let hint = "write it with its unit, such as \"500ms\", \"10s\" or \"10m\"";
    text(deserializer, hint, |text| {
        Ok(time(text, hint)?.as_secs_f64().into())
    })
}

fn time(text: &str, hint: &str) -> Result<Duration, Fault> {
    let is_none = |_| Fault::new(format!("it is \"{}\", which is no duration", shown(text)));
    humantime::parse_duration(text).map_err(|error| is_none(error).hint(hint))
}

/// Reads bytes with their unit, such as `4GiB`.
pub(crate) fn size<'de, D, T>(deserializer: D) -> Result<T, D::Error>
where
    D: Deserializer<'de>,
    T: From<u64>,
{
    let hint = "write it with its unit, such as \"512MiB\" or \"4GiB\"";
    text(deserializer, hint, |text| {
        let is_none = |_| Fault::new(format!("it is \"{}\", which is no size", shown(text)));
        let size: ByteSize = text.parse().map_err(|error| is_none(error).hint(hint))?;
        if size.as_u64() < 1 << 12 {
            return Err(Fault::new("it is less than 4KiB"));
        }
        Ok(size.as_u64().into())
    })
}

/// Reads what is written as on the command line.
pub(super) fn as_argument<'de, D, N, T>(deserializer: D) -> Result<T, D::Error>
where
    D: Deserializer<'de>,
    N: FromStr<Err = SimError>,
    T: From<N>,
{
    text(deserializer, "", |text| {
        let parsed: Result<N, SimError> = text.parse();
        parsed.map(T::from).map_err(|error| {
            let fault = Fault::new(error.to_string());
            match error.hint() {
                Some(hint) => fault.hint(hint),
                None => fault,
            }
        })
    })
}

/// The keys of `[sandbox]` of which each stands for itself.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SandboxTable {
    level: Option<Level>,
    #[serde(default, deserialize_with = "between::<2, 100_000, u32, _, _>")]
    processes: Option<u32>,
    #[serde(default, deserialize_with = "size")]
    disk: Option<u64>,
    #[serde(default, deserialize_with = "size")]
    output: Option<u64>,
    network: Option<bool>,
    pin: Option<bool>,
}

pub(super) fn sandbox(table: &Value<'_>, paths: &Paths<'_>) -> Result<SandboxOptions, InputError> {
    let said: SandboxTable = table.clone().apart(&["read", "env"]).read()?;
    let mut sandbox = SandboxOptions::default();
    sandbox.output_bytes = said.output.unwrap_or(sandbox.output_bytes);
    sandbox.pin = said.pin.unwrap_or(sandbox.pin);
    let policy = &mut sandbox.policy;
    policy.level = said.level.unwrap_or(policy.level);
    policy.processes = said.processes.unwrap_or(policy.processes);
    policy.disk_bytes = said.disk.unwrap_or(policy.disk_bytes);
    policy.network = said.network.unwrap_or(policy.network);
    for item in table.get("read").iter().flat_map(Value::one_or_more) {
        policy.read.push(paths.path(&item)?.path);
    }
    let variables = table.optional("env", Value::entries)?.unwrap_or_default();
    for (name, value) in variables {
        let name = name.text(|name| {
            if name.is_empty() || name.contains(['=', '\0']) {
                return Err(Fault::new("it cannot be the name of a variable"));
            }
            Ok(name.to_owned())
        })?;
        policy.env.push((name, paths.expanded(&value)?));
    }
    policy.env.sort();
    Ok(sandbox)
}

/// The keys of `[execution]` that are no fields of [`SimConfig`].
#[derive(Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct ExecutionTable {
    execute: Option<bool>,
    model: Option<String>,
    #[serde(deserialize_with = "as_argument::<_, Delay, _>")]
    delay: Delay,
    #[serde(deserialize_with = "as_argument::<_, VelocityNoise, _>")]
    velocity_noise: VelocityNoise,
    #[serde(deserialize_with = "as_argument::<_, Messages, _>")]
    messages: Messages,
    seed: u64,
    start_heading_deg: Option<f64>,
    allow_overlaps: bool,
}

/// The keys of `[execution]` that are.
const OF_CONFIG: [&str; 11] = [
    "cell_size_m",
    "step_s",
    "radius_m",
    "ticks_hz",
    "substeps",
    "tier",
    "policy",
    "message_period_s",
    "margin_m",
    "until_done",
    "time_limit_s",
];

/// The simulator's parameters, and the robots unless nobody executes anything.
pub(super) fn execution(
    table: &Value<'_>,
    paths: &Paths<'_>,
) -> Result<(SimConfig, Option<Robots>), InputError> {
    let apart: Vec<&str> = OF_CONFIG.into_iter().chain(["fleet"]).collect();
    let said: ExecutionTable = table.clone().apart(&apart).read()?;
    let mut config: SimConfig = table.part(&OF_CONFIG).read()?;
    config.start_heading_rad = match said.start_heading_deg {
        Some(degrees) => degrees.to_radians(),
        None => config.start_heading_rad,
    };
    config.overlapping_starts = said.allow_overlaps;
    config.disturbance = Disturbance {
        seed: said.seed,
        delay: said.delay,
        velocity: said.velocity_noise,
        messages: said.messages,
    };
    config.validate().map_err(|error| {
        let key = match error {
            SimError::Config { field, .. } => field,
            _ => "",
        };
        hinted(table.error_at(key, error.to_string()), error.hint())
    })?;
    let robots = match (said.model, table.get("fleet")) {
        (Some(_), Some(fleet)) => {
            return Err(fleet
                .error("`model` and `fleet` are two ways to say who executes plans")
                .hint("remove one of them"));
        }
        (None, Some(fleet)) => {
            if let Some(radius) = table.get("radius_m") {
                return Err(radius.error("the robots of a `fleet` have footprints of their own"));
            }
            let path = paths.path(&fleet)?.path;
            let file = load_fleet(&path).map_err(|error| fleet.place().error_in_file(error))?;
            Robots::File(path.display().to_string(), Box::new(file))
        }
        (Some(model), None) => {
            let robots = Robots::Model(model);
            robots.fleet(1, &config).map_err(|error| {
                hinted(table.error_at("model", error.to_string()), error.hint())
            })?;
            robots
        }
        (None, None) => Robots::Pebbles,
    };
    Ok((config, said.execute.unwrap_or(true).then_some(robots)))
}

/// The error with a hint, if there is one.
pub(super) fn hinted(error: InputError, hint: Option<&str>) -> InputError {
    InputError {
        hint: hint.map(str::to_owned),
        ..error
    }
}
