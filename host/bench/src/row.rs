//! A trial as one row: the columns of the store, of its exports and of reports.
//!
//! Every column is declared once, with its type and its documentation; the table of
//! the store, CSV, JSON Lines, Parquet and the documentation follow from [`COLUMNS`].
//! What does not exist is absent (`NULL`, an empty field), never zero. Columns are
//! only ever added; a change of meaning is a new name.

use std::borrow::Cow;
use std::time::Duration;

/// Type of the values of a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ColumnType {
    /// UTF-8 text.
    Text,
    /// A whole number.
    Integer,
    /// A floating point number.
    Real,
    /// Yes or no; 1 or 0 in SQLite.
    Boolean,
}

/// A column: its name with its unit, what it holds, and what that means.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Column {
    /// Snake case, with the unit as the last word.
    pub name: &'static str,
    /// Type of its values.
    pub kind: ColumnType,
    /// True if it may be absent.
    pub optional: bool,
    /// Its meaning.
    pub doc: &'static str,
}

/// A value of a column.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// Absent.
    Null,
    /// Text.
    Text(String),
    /// A whole number.
    Integer(i64),
    /// A number.
    Real(f64),
    /// Yes or no.
    Boolean(bool),
}

/// The common interface of the types of fields.
trait Field: Sized {
    const KIND: ColumnType;
    const OPTIONAL: bool = false;
    fn to_value(&self) -> Value;
    fn from_value(value: Value) -> Option<Self>;
}

macro_rules! field {
    ($type:ty, $kind:ident, $self:ident => $to:expr, $from:pat => $back:expr) => {
        impl Field for $type {
            const KIND: ColumnType = ColumnType::$kind;
            fn to_value(&self) -> Value {
                let $self = self;
                Value::$kind($to)
            }
            fn from_value(value: Value) -> Option<Self> {
                match value {
                    Value::$kind($from) => $back,
                    _ => None,
                }
            }
        }
    };
}

field!(String, Text, text => text.clone(), text => Some(text));
field!(bool, Boolean, value => *value, value => Some(value));
field!(f64, Real, value => *value, value => Some(value));
// SQLite's integers are signed: larger ones are stored as their bits.
field!(u64, Integer, value => value.cast_signed(), value => Some(value.cast_unsigned()));
field!(u32, Integer, value => i64::from(*value), value => u32::try_from(value).ok());

impl<T: Field> Field for Option<T> {
    const KIND: ColumnType = T::KIND;
    const OPTIONAL: bool = true;
    fn to_value(&self) -> Value {
        self.as_ref().map_or(Value::Null, Field::to_value)
    }
    fn from_value(value: Value) -> Option<Self> {
        match value {
            Value::Null => Some(None),
            value => T::from_value(value).map(Some),
        }
    }
}

macro_rules! columns {
    ($($(#[doc = $doc:literal])+ $name:ident: $type:ty,)*) => {
        /// One trial. Fields are columns, in this order.
        #[derive(Debug, Clone, PartialEq, Default)]
        pub struct Row {
            $($(#[doc = $doc])+ pub $name: $type,)*
            /// The plans that came in time, in order of arrival.
            pub incumbents: Vec<Incumbent>,
            /// The plan that counts, a compressed plan file, where the suite keeps plans. Rows
            /// that are read do without; see [`Store::plans`](crate::Store::plans).
            pub plan: Option<Vec<u8>>,
        }

        /// Every column, in the order of [`Row::values`].
        pub const COLUMNS: &[Column] = &[$(Column {
            name: stringify!($name),
            kind: <$type as Field>::KIND,
            optional: <$type as Field>::OPTIONAL,
            doc: concat!($($doc),+),
        },)*];

        impl Row {
            /// The values, by column.
            pub fn values(&self) -> Vec<Value> {
                vec![$(self.$name.to_value()),*]
            }

            /// From the values by column, without incumbents; the name of the first
            /// column whose value does not fit it otherwise.
            pub fn from_values(values: impl IntoIterator<Item = Value>) -> Result<Self, &'static str> {
                let mut values = values.into_iter();
                Ok(Self {
                    $($name: values
                        .next()
                        .and_then(Field::from_value)
                        .ok_or(stringify!($name))?,)*
                    incumbents: Vec::new(),
                    plan: None,
                })
            }
        }
    };
}

/// A plan that came in time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Incumbent {
    /// From the start of the call, by the host's clock.
    pub time_ms: f64,
    /// Its sum of costs, if it was kept.
    pub soc_steps: Option<u64>,
    /// True if it is valid; absent if it was not kept.
    pub valid: Option<bool>,
}

columns! {
    /// Digest of all that decides the result; no two rows of a store have the same.
    key: String,
    /// Place in the suite's order, from 0.
    trial: u64,
    /// The planner's label in the suite.
    planner: String,
    /// Identifier of the plugin.
    planner_id: String,
    /// Version of the plugin.
    planner_version: String,
    /// Digest of the plugin's code.
    planner_digest: Option<String>,
    /// Options as a JSON object.
    options: String,
    /// The way in which the plugin was attached.
    attach: String,
    /// True if the result may be compared: sandboxed, supervised to the end, and with all its
    /// processor time known where that is limited.
    ranked: bool,
    /// The reason why it may not be compared.
    unranked: Option<String>,
    /// Limits that were only watched, not enforced.
    limits_watched: Option<String>,
    /// Devices that the planner was granted, whose time and memory are not counted.
    devices: Option<String>,
    /// True if the planner is a part of the host, so that its figures may rank it.
    built_in: Option<bool>,
    /// Digest of the instance.
    instance_digest: String,
    /// Name of the map.
    map: String,
    /// Origin of starts and goals.
    scenario: String,
    /// Number of agents.
    agents: u64,
    /// Neighbours of a cell, 4 or 8, on a grid.
    connectivity: Option<u32>,
    /// Rows of the map, on a grid.
    map_rows: Option<u32>,
    /// Columns of the map, on a grid.
    map_cols: Option<u32>,
    /// Representation of the view of a task: `grid`, `roadmap` or `continuous`.
    representation: Option<String>,
    /// The view's label in the suite.
    view: Option<String>,
    /// Its parameters by the names of the command line, as a JSON object.
    view_parameters: Option<String>,
    /// Digest of what the planner was given: cells, or roadmap, with starts and goals.
    view_digest: Option<String>,
    /// Digest of the task: world, robots, starts and goals.
    task_digest: Option<String>,
    /// Number of the maze in its series, from 0.
    maze_index: Option<u64>,
    /// Seed of the maze.
    maze_seed: Option<u64>,
    /// Width of the maze in maze cells.
    maze_width: Option<u32>,
    /// Height of the maze in maze cells.
    maze_height: Option<u32>,
    /// The algorithm that carved the maze.
    maze_algorithm: Option<String>,
    /// Wall-clock budget of the plan; of a fleet, how long it drives in simulated time.
    budget_ms: f64,
    /// Seed given to the planner.
    seed: u64,
    /// Number of the repeat, from 0.
    repeat: u32,
    /// The end of the call.
    termination: String,
    /// The fault of the plugin, if it has one.
    fault: Option<String>,
    /// The limit that it exceeded.
    limit_exceeded: Option<String>,
    /// The status that the planner claims.
    claim: Option<String>,
    /// The planner's explanation.
    message: Option<String>,
    /// Claims that the host found to be otherwise.
    false_claims: Option<String>,
    /// True if the last plan is valid.
    valid: bool,
    /// Violations in the last plan.
    violations: u64,
    /// The first violation, in words.
    first_violation: Option<String>,
    /// True if the last plan keeps the rules of the view; absent in the plane.
    valid_in_view: Option<bool>,
    /// True if the last plan is valid by footprints in the task's world; absent if it has no place there.
    valid_in_world: Option<bool>,
    /// Agents whose paths end at their goals, in the plan or in what the planner left; absent in the plane.
    agents_at_goal: Option<u64>,
    /// The share of these in all agents.
    individual_success: Option<f64>,
    /// True if the planner ended as it should and its plan is valid, of a view in the world too.
    success: bool,
    /// The time that is compared, as `clock` says; of a fleet, the mean over its planner's calls.
    solve_time_ms: f64,
    /// The suite's clock: `host`, `call` or `cpu`.
    clock: Option<String>,
    /// Wall time of the call by the host's clock, transport included; of a fleet, of all calls of
    /// its planner together.
    planning_time_ms: f64,
    /// Wall time of the call as the plugin's process claims it.
    call_time_ms: Option<f64>,
    /// From the request to the last byte of the answer, by the host's clock.
    round_trip_ms: Option<f64>,
    /// Time of an empty call, which is no planner's time.
    correction_ms: Option<f64>,
    /// Distance of empty calls from that.
    correction_uncertainty_ms: Option<f64>,
    /// From the start of the plugin until it had introduced itself; absent when its process
    /// was used again.
    startup_time_ms: Option<f64>,
    /// Wall time of learning the map, also where the planner ended there; absent when it was known.
    prepare_time_ms: Option<f64>,
    /// Start, learning the map and the call together, so far as they were made for this trial.
    total_time_ms: Option<f64>,
    /// From the start of the call to the first valid plan, by the host's clock.
    first_solution_ms: Option<f64>,
    /// Sum over agents of the last arrival at the goal.
    soc_steps: Option<u64>,
    /// Time at which the last agent arrives.
    makespan_steps: Option<u64>,
    /// Sum over agents of the shortest distance, on a grid.
    lower_bound_steps: Option<u64>,
    /// Sum of costs over lower bound, of a valid plan.
    suboptimality: Option<f64>,
    /// Length of all paths in cells: moves, or cells of the rasterised segments.
    path_length_cells: Option<f64>,
    /// Length of all paths.
    path_length_m: Option<f64>,
    /// Sum over agents of the time of their last arrival in a task's world.
    soc_s: Option<f64>,
    /// The latest of these times.
    makespan_s: Option<f64>,
    /// Expansions that the planner claims.
    expansions: Option<f64>,
    /// Agents that arrived in the execution.
    arrived: Option<u64>,
    /// Simulated time of the execution.
    simulated_s: Option<f64>,
    /// Simulated time over wall time.
    rtf: Option<f64>,
    /// Contacts in the execution.
    contacts: Option<u64>,
    /// Nearest approach of two agents in the execution.
    nearest_approach_m: Option<f64>,
    /// Largest distance between an agent and its plan.
    tracking_error_max_m: Option<f64>,
    /// Arrival of the last agent in the execution.
    execution_makespan_s: Option<f64>,
    /// Goals reached per simulated second.
    throughput_per_s: Option<f64>,
    /// Numbers and plugins of the fleet with their options, as a JSON object.
    fleet: Option<String>,
    /// Identifier of the instance generator.
    generator: Option<String>,
    /// Identifier of the invocation policy.
    invocation: Option<String>,
    /// Identifier of the fail policy.
    fail_policy: Option<String>,
    /// Goals that robots reached.
    goals_reached: Option<u64>,
    /// Goals on the ways to which robots are committed, reached or not.
    goals_committed: Option<u64>,
    /// Share of calls in which the fail policy was asked.
    fail_policy_ratio: Option<f64>,
    /// Calls that were answered.
    planner_calls: Option<u64>,
    /// Calls after which everybody waited.
    all_waits: Option<u64>,
    /// Plans that were claimed to be right and refused.
    invalid_batches: Option<u64>,
    /// Rings that were cut out of plans.
    rings_cut: Option<u64>,
    /// The longest of the planner's calls, by the host's clock.
    planner_call_max_ms: Option<f64>,
    /// Limit of a call of the planner.
    planner_limit_ms: Option<f64>,
    /// Share of robots and time spent standing still.
    waiting_share: Option<f64>,
    /// Most actions in the graph at a time.
    adg_nodes_max: Option<u64>,
    /// Processor time of the call; a lower bound where `limits_watched` has `cpu`.
    cpu_time_ms: Option<f64>,
    /// Processor time of its processes before the trial's calls, since the call before; of a fleet,
    /// between all calls of its planner.
    cpu_between_calls_ms: Option<f64>,
    /// Largest resident memory of the plugin's processes together.
    peak_memory_kb: Option<u64>,
    /// Time for which threads of the call were ready to run and did not.
    run_delay_ms: Option<f64>,
    /// Threads that the planner was allowed.
    threads: Option<u32>,
    /// The suite's `reuse`: `never` or `planner`.
    reuse: Option<String>,
    /// The processors that the plugin had to itself; absent where it had none.
    cpus: Option<String>,
    /// Reasons why the times cannot be compared with others; empty when they can.
    contended: String,
    /// True if others are known to have disturbed it, which alone makes a trial be made again.
    contended_by_others: Option<bool>,
    /// Attempts at the trial until others did not disturb it; absent where each trial has one.
    attempts: Option<u32>,
    /// Digest of the machine's description.
    machine: String,
    /// Digest of the plan.
    plan_digest: Option<String>,
    /// Digest of the execution's trace.
    trace_digest: Option<String>,
    /// Begin of the trial, in milliseconds since 1970.
    started_unix_ms: u64,
}

impl Row {
    /// The name under which the planner is evaluated: on a view of a task another one than elsewhere.
    pub fn entrant(&self) -> Cow<'_, str> {
        match self.view.as_deref().filter(|view| !view.is_empty()) {
            Some(view) => format!("{} on {view}", self.planner).into(),
            None => self.planner.as_str().into(),
        }
    }

    /// True if the planner ended while it learnt the map, and was not asked for a plan.
    pub fn ended_while_learning(&self) -> bool {
        self.fault.is_some() && self.prepare_time_ms.is_some() && self.planning_time_ms == 0.0
    }

    /// Wall time of the trial, as far as it was measured: its start, learning the map, the call and the
    /// execution; of a fleet, whose planner is called while it drives, the longer of both.
    pub fn took(&self) -> Duration {
        let planned_s = self.total_time_ms.unwrap_or(self.planning_time_ms) / 1e3;
        let driven_s = match (self.simulated_s, self.rtf) {
            (Some(simulated_s), Some(rtf)) if rtf > 0.0 => simulated_s / rtf,
            _ => 0.0,
        };
        let is_fleet = self.generator.is_some();
        let seconds = if is_fleet {
            planned_s.max(driven_s)
        } else {
            planned_s + driven_s
        };
        Duration::try_from_secs_f64(seconds).unwrap_or_default()
    }

    /// The digest of what is asked: of the task, on whichever view, or of the instance.
    pub fn question(&self) -> &str {
        let task = self
            .task_digest
            .as_deref()
            .filter(|digest| !digest.is_empty());
        task.unwrap_or(&self.instance_digest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_survive_their_values() {
        let row = Row {
            key: "k".into(),
            seed: u64::MAX,
            maze_width: Some(15),
            rtf: Some(2.5),
            success: true,
            ..Row::default()
        };
        assert_eq!(row.values().len(), COLUMNS.len());
        assert_eq!(Row::from_values(row.values()), Ok(row.clone()));
        let mut wrong = row.values();
        wrong[1] = Value::Text("one".into());
        assert_eq!(Row::from_values(wrong), Err("trial"));
        let short = row.values().into_iter().take(3);
        assert_eq!(Row::from_values(short), Err("planner_id"));
    }
}
