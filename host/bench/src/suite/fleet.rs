//! `[fleet]`: suites of lifelong fleets, in the words of `fleetyard fleet`.

use fleetyard_abi::Motion;
use fleetyard_core::InputError;
use fleetyard_core::document::{Place, Table, Value};
use fleetyard_fleet::{Allowance, Assign, Clock, CutBy, FleetConfig, FleetError, step_s};
use fleetyard_sim::SimConfig;
use serde_json::Map;

use super::read::{Paths, small};
use super::settings;
use crate::options::{BudgetOptions, Robots};

pub(super) const FLEET: &[&str] = &[
    "duration",
    "generator",
    "invocation",
    "fail_policy",
    "period",
    "window",
    "limit",
    "nodes",
    "motion",
    "clock",
    "cut",
    "assign",
    "dwell",
    "queue",
    "model",
    "delay",
    "velocity_noise",
    "messages",
    "watchdog",
    "call_budget",
];
const PLUGIN: &[&str] = &["plugin", "options"];

/// How often the series of a run has a point; rows keep none of it.
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

/// What the suite says for every setup, and where a setup says otherwise.
struct Layers<'t, 'a> {
    own: Option<Table<'t, 'a>>,
    common: Table<'t, 'a>,
}

impl<'t, 'a> Layers<'t, 'a> {
    fn get(&self, key: &'t str) -> Option<Value<'t, 'a>> {
        let own = self.own.as_ref().and_then(|own| own.get(key));
        own.or_else(|| self.common.get(key))
    }

    /// An error at the key that it is about.
    fn blamed(&self, error: &FleetError) -> InputError {
        let key = match error {
            FleetError::Config { field, .. } => {
                let name = field.strip_suffix("_s").unwrap_or(field);
                FLEET.iter().copied().find(|key| *key == name)
            }
            _ => None,
        };
        let reason = error.to_string();
        let fault = match key.and_then(|key| self.get(key)) {
            Some(value) => value.error(reason),
            None => self.common.error(reason),
        };
        hinted(fault, error.hint())
    }
}

fn hinted(error: InputError, hint: Option<&str>) -> InputError {
    match hint {
        Some(hint) => error.hint(hint),
        None => error,
    }
}

/// What the suite says beside `[fleet]` that is true of fleets as well.
pub(super) struct Around<'s> {
    pub(super) budget: &'s BudgetOptions,
    pub(super) config: &'s SimConfig,
    /// Whether `[execution]` says how long a step is.
    pub(super) step_given: bool,
}

/// The setup of a planner: `common` is `[fleet]`, `own` is `fleet` of its `[[planner]]`.
pub(super) fn setup(
    common: &Value<'_, '_>,
    own: Option<&Value<'_, '_>>,
    around: &Around<'_>,
    paths: &Paths<'_>,
) -> Result<FleetSetup, InputError> {
    let layers = Layers {
        common: common.table("[fleet]", FLEET)?,
        own: own.map(|own| own.table("`fleet`", FLEET)).transpose()?,
    };
    let default = FleetConfig::default();
    let seconds = |key, default: f64| match layers.get(key) {
        Some(value) => settings::seconds(&value),
        None => Ok(default),
    };
    let mut sim = around.config.clone();
    if let Some(value) = layers.get("delay") {
        sim.disturbance.delay = settings::parsed_value(&value)?;
    }
    if let Some(value) = layers.get("velocity_noise") {
        sim.disturbance.velocity = settings::parsed_value(&value)?;
    }
    if let Some(value) = layers.get("messages") {
        sim.disturbance.messages = settings::parsed_value(&value)?;
    }
    let robots = match layers.get("model") {
        Some(model) if model.text()? == "pebble" => Robots::Pebbles,
        Some(model) => Robots::Model(model.text()?.to_owned()),
        None => Robots::Model("agv".to_owned()),
    };
    let bodies = robots.fleet(1, &sim).map_err(|error| {
        let reason = error.to_string();
        let fault = match layers.get("model") {
            Some(model) => model.error(reason),
            None => layers.common.error(reason),
        };
        hinted(fault, error.hint())
    })?;
    if !around.step_given {
        sim.step_s = step_s(bodies.as_ref(), sim.cell_size_m);
    }
    let mut config = FleetConfig {
        duration_s: seconds("duration", default.duration_s)?,
        window_s: seconds("window", default.window_s)?,
        limit_s: seconds("limit", default.limit_s)?,
        dwell_s: seconds("dwell", default.dwell_s)?,
        watchdog_s: seconds("watchdog", default.watchdog_s)?,
        series_s: SERIES_S,
        allowance: Allowance {
            prepare_s: match around.budget.prepare {
                Some(prepare) => prepare.as_secs_f64(),
                None => default.allowance.prepare_s,
            },
            call_s: seconds("call_budget", default.allowance.call_s)?,
            threads: around.budget.threads,
            memory_bytes: around.budget.plan_memory(),
            nodes: match layers.get("nodes") {
                Some(nodes) => nodes.whole(1, u64::MAX)?,
                None => around.budget.nodes,
            },
        },
        sim,
        ..default
    };
    if let Some(value) = layers.get("motion") {
        config.motion =
            value.choice(&[("pebble", Motion::Pebble), ("rotation", Motion::Rotation)])?;
    }
    if let Some(value) = layers.get("clock") {
        let clocks = [("lockstep", Clock::Lockstep), ("realtime", Clock::Realtime)];
        config.clock = value.choice(&clocks)?;
    }
    if let Some(value) = layers.get("cut") {
        config.cut = value.choice(&[("time", CutBy::Time), ("actions", CutBy::Actions)])?;
    }
    if let Some(value) = layers.get("assign") {
        config.assign = value.choice(&[
            ("auto", Assign::Auto),
            ("random", Assign::Random),
            ("roles", Assign::Roles),
        ])?;
    }
    if let Some(value) = layers.get("queue") {
        config.queue = small(&value, 1, 10_000)?;
    }
    config.validate().map_err(|error| layers.blamed(&error))?;
    let plugin = |key, default: &str| plugin(&layers, key, default, paths);
    let mut invocation = plugin("invocation", "periodic")?;
    // A setup with an invocation policy of its own does not want the period of another one.
    let own = layers.own.as_ref();
    let replaced =
        own.is_some_and(|own| own.get("invocation").is_some() && own.get("period").is_none());
    if let Some(period) = layers.get("period").filter(|_| !replaced) {
        let said = settings::seconds(&period)?;
        if invocation.options.contains_key("period_s") {
            let reason = "`period` is the option `period_s` of the invocation policy, which is \
                          there as well";
            return Err(period.error(reason).hint("leave one of them out"));
        }
        if said <= 0.0 {
            return Err(period
                .error("`period` is zero")
                .hint("give more than nothing"));
        }
        let said = serde_json::Number::from_f64(said).unwrap_or_else(|| 1.into());
        invocation.options.insert("period_s".into(), said.into());
    }
    Ok(FleetSetup {
        generator: plugin("generator", "windowed-multi-goals")?,
        fail_policy: plugin("fail_policy", "pibt")?,
        invocation,
        robots,
        config,
    })
}

/// An identifier or a path, or a table with that and options.
fn plugin<'t>(
    layers: &Layers<'t, '_>,
    key: &'t str,
    default: &str,
    paths: &Paths<'_>,
) -> Result<FleetPlugin, InputError> {
    let Some(value) = layers.get(key) else {
        return Ok(FleetPlugin {
            plugin: default.to_owned(),
            options: Map::new(),
            place: layers.common.place(),
        });
    };
    let (named, options) = if value.is_table() {
        let table = value.table(format!("`{key}`"), PLUGIN)?;
        let options = table.get("options").map(|options| options.object());
        (table.require("plugin")?, options.transpose()?)
    } else {
        (value.clone(), None)
    };
    let expanded = paths.expanded(&named)?;
    Ok(FleetPlugin {
        plugin: paths.plugin(expanded),
        options: options.unwrap_or_default(),
        place: value.place(),
    })
}
