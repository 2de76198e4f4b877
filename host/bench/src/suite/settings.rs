//! `[budget]`, `[sandbox]` and `[execution]`: what trials may use, and who executes plans.

use fleetyard_core::InputError;
use fleetyard_core::document::{Fault, Value, between};
use fleetyard_runtime::Level;
use fleetyard_runtime::sandbox::devices;
use fleetyard_sim::motion::load_fleet;
use fleetyard_sim::noise::{Delay, Disturbance, Messages, TwistNoise, VelocityNoise};
use fleetyard_sim::{SimConfig, SimError};
use serde::Deserialize;

use super::values::Paths;
use crate::options::{Robots, SandboxOptions};
use crate::quantity::{as_argument, size};

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
    let said: SandboxTable = table.clone().apart(&["read", "env", "devices"]).read()?;
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
    for item in table.get("devices").iter().flat_map(Value::one_or_more) {
        let found = item.text(|name| {
            devices(name, policy.level).map_err(|fault| {
                let said = Fault::new(fault.to_string());
                match fault.hint() {
                    Some(hint) => said.hint(hint),
                    None => said,
                }
            })
        })?;
        policy.devices.extend(found);
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
    #[serde(deserialize_with = "as_argument::<_, TwistNoise, _>")]
    twist_noise: TwistNoise,
    #[serde(deserialize_with = "as_argument::<_, Messages, _>")]
    messages: Messages,
    seed: u64,
    start_heading_deg: Option<f64>,
    allow_overlaps: bool,
}

/// The keys of `[execution]` that are.
const OF_CONFIG: [&str; 12] = [
    "cell_size_m",
    "step_s",
    "radius_m",
    "ticks_hz",
    "substeps",
    "tier",
    "policy",
    "message_period_s",
    "margin_m",
    "smooth_m",
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
        twist: said.twist_noise,
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
