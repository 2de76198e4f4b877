//! `[fleet]`: suites of lifelong fleets, in the words of `fleetyard fleet`.

use fleetyard_abi::Motion;
use fleetyard_core::InputError;
use fleetyard_core::document::{Place, Value, between, one_of};
use fleetyard_fleet::{Allowance, Assign, Clock, CutBy, FleetConfig, FleetError, step_s};
use fleetyard_sim::SimConfig;
use fleetyard_sim::noise::{Delay, Messages, VelocityNoise};
use serde::{Deserialize, Deserializer};
use serde_json::Map;

use super::settings::hinted;
use super::values::Paths;
use crate::options::{BudgetOptions, Robots};
use crate::quantity::{as_argument, seconds};

/// Seconds between points of the series of a run; rows keep none of it.
const SERIES_S: f64 = 10.0;

/// A run of a fleet, but for map, agents, seed and planner.
#[derive(Debug, Clone)]
pub struct FleetSetup {
    /// All numbers; `agents` and the seeds are those of a trial.
    pub config: FleetConfig,
    /// The robots.
    pub robots: Robots,
    /// Says what the planner is asked.
    pub generator: FleetPlugin,
    /// Says when it is asked.
    pub invocation: FleetPlugin,
    /// Gets the fleet moving where the planner failed.
    pub fail_policy: FleetPlugin,
}

/// A plugin of a fleet beside its planner.
#[derive(Debug, Clone)]
pub struct FleetPlugin {
    /// An identifier, the path of a library or program, or `PATH:ID`.
    pub plugin: String,
    /// Its options, not yet checked against its schema.
    pub options: Map<String, serde_json::Value>,
    /// Its place in the suite.
    pub place: Place,
}

/// The keys of `[fleet]` of which each stands for itself.
#[derive(Deserialize)]
#[serde(default, deny_unknown_fields)]
struct FleetTable {
    #[serde(deserialize_with = "seconds")]
    duration: f64,
    #[serde(deserialize_with = "seconds")]
    period: Option<f64>,
    #[serde(deserialize_with = "seconds")]
    window: f64,
    #[serde(deserialize_with = "seconds")]
    limit: f64,
    #[serde(deserialize_with = "between::<1, { u64::MAX }, u64, _, _>")]
    nodes: Option<u64>,
    #[serde(deserialize_with = "motion")]
    motion: Motion,
    clock: Clock,
    cut: CutBy,
    #[serde(deserialize_with = "assign")]
    assign: Assign,
    #[serde(deserialize_with = "seconds")]
    dwell: f64,
    #[serde(deserialize_with = "between::<1, 10_000, u32, _, _>")]
    queue: u32,
    #[serde(deserialize_with = "robots")]
    model: Robots,
    #[serde(deserialize_with = "as_argument::<_, Delay, _>")]
    delay: Option<Delay>,
    #[serde(deserialize_with = "as_argument::<_, VelocityNoise, _>")]
    velocity_noise: Option<VelocityNoise>,
    #[serde(deserialize_with = "as_argument::<_, Messages, _>")]
    messages: Option<Messages>,
    #[serde(deserialize_with = "seconds")]
    watchdog: f64,
    #[serde(deserialize_with = "seconds")]
    call_budget: f64,
}

impl Default for FleetTable {
    fn default() -> Self {
        let config = FleetConfig::default();
        Self {
            duration: config.duration_s,
            period: None,
            window: config.window_s,
            limit: config.limit_s,
            nodes: None,
            motion: config.motion,
            clock: config.clock,
            cut: config.cut,
            assign: config.assign,
            dwell: config.dwell_s,
            queue: config.queue,
            model: Robots::Model("agv".to_owned()),
            delay: None,
            velocity_noise: None,
            messages: None,
            watchdog: config.watchdog_s,
            call_budget: config.allowance.call_s,
        }
    }
}

fn motion<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Motion, D::Error> {
    one_of(deserializer, FleetConfig::MOTIONS)
}

fn assign<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Assign, D::Error> {
    one_of(deserializer, &[Assign::Auto, Assign::Random, Assign::Roles])
}

fn robots<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Robots, D::Error> {
    Ok(match String::deserialize(deserializer)? {
        name if name == "pebble" => Robots::Pebbles,
        name => Robots::Model(name),
    })
}

/// Settings of a suite beside `fleet` that hold for its fleet as well as for a planner.
pub(super) struct Around<'s> {
    /// `[fleet]`
    pub(super) fleet: Option<Value<'s>>,
    pub(super) budget: &'s BudgetOptions,
    pub(super) config: &'s SimConfig,
    /// True if `[execution]` says how long a step is.
    pub(super) step_given: bool,
    pub(super) paths: &'s Paths<'s>,
}

/// The setup of a planner whose `fleet` is `own`, in a suite of fleets.
pub(super) fn setup(
    own: Option<&Value<'_>>,
    around: &Around<'_>,
) -> Result<Option<FleetSetup>, InputError> {
    let table = match (&around.fleet, own) {
        (None, None) => return Ok(None),
        (None, Some(own)) => {
            return Err(own
                .error("`fleet` says what is otherwise for a planner than in [fleet]")
                .hint("write a table [fleet], which makes the suite one of fleets"));
        }
        (Some(common), None) => common.clone(),
        (Some(common), Some(own)) => common.under(own)?,
    };
    let plugins = ["generator", "invocation", "fail_policy"];
    let said: FleetTable = table.clone().apart(&plugins).read()?;
    let mut sim = around.config.clone();
    let disturbance = &mut sim.disturbance;
    disturbance.delay = said.delay.unwrap_or(disturbance.delay);
    disturbance.velocity = said.velocity_noise.unwrap_or(disturbance.velocity);
    disturbance.messages = said.messages.unwrap_or(disturbance.messages);
    let bodies = said.model.fleet(1, &sim);
    let bodies =
        bodies.map_err(|error| hinted(table.error_at("model", error.to_string()), error.hint()))?;
    if !around.step_given {
        sim.step_s = step_s(bodies.as_ref(), sim.cell_size_m);
    }
    let default = FleetConfig::default();
    let prepare = around.budget.prepare;
    let config = FleetConfig {
        duration_s: said.duration,
        window_s: said.window,
        limit_s: said.limit,
        clock: said.clock,
        cut: said.cut,
        motion: said.motion,
        queue: said.queue,
        dwell_s: said.dwell,
        assign: said.assign,
        watchdog_s: said.watchdog,
        series_s: SERIES_S,
        allowance: Allowance {
            prepare_s: prepare.map_or(default.allowance.prepare_s, |prepare| prepare.as_secs_f64()),
            call_s: said.call_budget,
            grace_s: (around.budget.grace)
                .map_or(default.allowance.grace_s, |grace| grace.as_secs_f64()),
            threads: around.budget.threads,
            memory_bytes: around.budget.plan_memory(),
            nodes: said.nodes.unwrap_or(around.budget.nodes),
        },
        sim,
        ..default
    };
    config.validate().map_err(|error| {
        let key = match error {
            FleetError::Config { field, .. } => field.strip_suffix("_s").unwrap_or(field),
            _ => "",
        };
        hinted(table.error_at(key, error.to_string()), error.hint())
    })?;
    let plugin = |key, usual: &str| plugin(&table, key, usual, around.paths);
    let mut invocation = plugin("invocation", "periodic")?;
    // A setup with an invocation policy of its own does not want the period of another one.
    let has = |key| own.is_some_and(|own| own.get(key).is_some());
    let replaced = has("invocation") && !has("period");
    if let Some(period) = said.period.filter(|_| !replaced) {
        if invocation.options.contains_key("period_s") {
            let reason = "`period` is the option `period_s` of the invocation policy, which is \
                          there as well";
            let fault = table.error_at("period", reason);
            return Err(fault.hint("leave one of them out"));
        }
        if period <= 0.0 {
            let fault = table.error_at("period", "`period` is zero");
            return Err(fault.hint("give more than nothing"));
        }
        invocation.options.insert("period_s".into(), period.into());
    }
    Ok(Some(FleetSetup {
        generator: plugin("generator", "windowed-multi-goals")?,
        fail_policy: plugin("fail_policy", "pibt")?,
        invocation,
        robots: said.model,
        config,
    }))
}

/// An identifier or a path, or a table with that and options.
fn plugin(
    table: &Value<'_>,
    key: &'static str,
    usual: &str,
    paths: &Paths<'_>,
) -> Result<FleetPlugin, InputError> {
    let Some(value) = table.get(key) else {
        return Ok(FleetPlugin {
            plugin: usual.to_owned(),
            options: Map::new(),
            place: table.place(),
        });
    };
    let (named, options) = if value.is_table() {
        value.only(&["plugin", "options"])?;
        let options = value.optional("options", Value::read)?;
        (value.require("plugin")?, options.unwrap_or_default())
    } else {
        (value.clone(), Map::new())
    };
    Ok(FleetPlugin {
        plugin: paths.plugin(paths.expanded(&named)?),
        options,
        place: value.place(),
    })
}
