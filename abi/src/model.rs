//! The owned model: the same things as the C structures, as Rust values whose
//! serde form is the JSON wire.

use std::sync::Arc;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::c;
use crate::environment::{Environment, Footprint};
use crate::lists::{Goals, Lists};
use crate::memory::Data;

/// The four kinds of plugin.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// Solves instances.
    Planner,
    /// Gets the fleet moving again after a planner failed.
    FailPolicy,
    /// Decides what the planner is asked next.
    InstanceGenerator,
    /// Decides when the planner is called.
    InvocationPolicy,
}

impl Kind {
    /// All kinds, in the order in which they are listed.
    pub const ALL: [Self; 4] = [
        Self::Planner,
        Self::FailPolicy,
        Self::InstanceGenerator,
        Self::InvocationPolicy,
    ];

    /// The kind's name on the wire.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Planner => "planner",
            Self::FailPolicy => "fail-policy",
            Self::InstanceGenerator => "instance-generator",
            Self::InvocationPolicy => "invocation-policy",
        }
    }

    /// The identifier of the kind's factory in the C ABI.
    pub fn factory_id(self) -> &'static str {
        match self {
            Self::Planner => c::PLANNER_FACTORY_ID,
            Self::FailPolicy => c::FAIL_POLICY_FACTORY_ID,
            Self::InstanceGenerator => c::INSTANCE_GENERATOR_FACTORY_ID,
            Self::InvocationPolicy => c::INVOCATION_POLICY_FACTORY_ID,
        }
    }
}

impl std::fmt::Display for Kind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.pad(self.as_str())
    }
}

macro_rules! capabilities {
    ($($(#[doc = $doc:literal])* $name:ident = $bit:ident, $text:literal;)*) => {
        /// A capability that a plugin may claim.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
        #[serde(rename_all = "kebab-case")]
        pub enum Capability {
            $($(#[doc = $doc])* $name,)*
        }

        impl Capability {
            /// Every capability, lowest bit first.
            pub const ALL: &'static [Self] = &[$(Self::$name),*];

            /// The capability's bit in the C ABI.
            pub fn bit(self) -> u64 {
                match self { $(Self::$name => c::$bit,)* }
            }

            /// The capability's name on the wire.
            pub fn as_str(self) -> &'static str {
                match self { $(Self::$name => $text,)* }
            }
        }
    };
}

capabilities! {
    /// Plans on grids.
    Grid = CAPABILITY_GRID, "grid";
    /// Plans on roadmaps.
    Roadmap = CAPABILITY_ROADMAP, "roadmap";
    /// Plans in continuous space.
    Continuous = CAPABILITY_CONTINUOUS, "continuous";
    /// Grids with eight neighbours as well as four.
    EightConnected = CAPABILITY_EIGHT_CONNECTED, "eight-connected";
    /// Grids with one-way moves.
    MoveMask = CAPABILITY_MOVE_MASK, "move-mask";
    /// The pebble motion model.
    Pebble = CAPABILITY_PEBBLE, "pebble";
    /// The rotation motion model.
    Rotation = CAPABILITY_ROTATION, "rotation";
    /// The any-angle motion model.
    AnyAngle = CAPABILITY_ANY_ANGLE, "any-angle";
    /// The stop-go motion model of roadmaps.
    StopGo = CAPABILITY_STOP_GO, "stop-go";
    /// The slower motion model of roadmaps.
    Slower = CAPABILITY_SLOWER, "slower";
    /// Robots of the plane whose speeds have limits.
    Dynamics = CAPABILITY_DYNAMICS, "dynamics";
    /// Keeps submitting better plans until the budget ends.
    Anytime = CAPABILITY_ANYTIME, "anytime";
    /// Several goals per agent, planned up to a window.
    Windowed = CAPABILITY_WINDOWED, "windowed";
    /// Goals that several agents share.
    DuplicateGoals = CAPABILITY_DUPLICATE_GOALS, "duplicate-goals";
    /// May submit colliding paths when it fails.
    CollidingPlans = CAPABILITY_COLLIDING_PLANS, "colliding-plans";
    /// Plans that tolerate k steps of delay.
    KRobust = CAPABILITY_K_ROBUST, "k-robust";
    /// The same instance, options and seed give the same plan.
    Deterministic = CAPABILITY_DETERMINISTIC, "deterministic";
    /// Uses more than one thread when the budget allows it.
    Threads = CAPABILITY_THREADS, "threads";
    /// Agents without a goal, which may end anywhere.
    Idle = CAPABILITY_IDLE, "idle";
    /// Robots of different footprints or dynamics in one team.
    Heterogeneous = CAPABILITY_HETEROGENEOUS, "heterogeneous";
}

/// A set of [`Capability`]; on the wire a list of names, in which unknown names
/// are ignored so that a newer plugin works with an older host.
#[derive(Clone, Copy, PartialEq, Eq, Default)]
pub struct Capabilities(u64);

impl Capabilities {
    /// From the bits of the C ABI.
    pub fn from_bits(bits: u64) -> Self {
        Self(bits)
    }

    /// The bits of the C ABI.
    pub fn bits(self) -> u64 {
        self.0
    }

    /// The set of some capabilities.
    pub fn of(capabilities: &[Capability]) -> Self {
        Self(
            capabilities
                .iter()
                .fold(0, |bits, capability| bits | capability.bit()),
        )
    }

    /// The capabilities that are in both sets.
    #[must_use]
    pub fn and(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }

    /// The capabilities that are in either set.
    #[must_use]
    pub fn with(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// True if the set has a capability.
    pub fn has(self, capability: Capability) -> bool {
        self.0 & capability.bit() != 0
    }

    /// The known capabilities in the set.
    pub fn iter(self) -> impl Iterator<Item = Capability> {
        Capability::ALL
            .iter()
            .copied()
            .filter(move |capability| self.has(*capability))
    }
}

impl std::fmt::Debug for Capabilities {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_set().entries(self.iter()).finish()
    }
}

impl Serialize for Capabilities {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.iter())
    }
}

impl<'de> Deserialize<'de> for Capabilities {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let names = Vec::<String>::deserialize(deserializer)?;
        let known = Capability::ALL
            .iter()
            .filter(|known| names.iter().any(|name| name == known.as_str()));
        Ok(Self(
            known.fold(0, |bits, capability| bits | capability.bit()),
        ))
    }
}

impl JsonSchema for Capabilities {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Capabilities".into()
    }

    fn json_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
        let names: Vec<&str> = Capability::ALL
            .iter()
            .map(|capability| capability.as_str())
            .collect();
        schemars::json_schema!({
            "description": "Names of capabilities; unknown names are ignored.",
            "type": "array",
            "items": { "type": "string", "examples": names }
        })
    }
}

/// Identity and capabilities of a plugin.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Descriptor {
    /// Short identifier, `[a-z0-9][a-z0-9._-]*`.
    pub id: String,
    /// The kind of plugin.
    pub kind: Kind,
    /// Human-readable name.
    #[serde(default)]
    pub name: String,
    /// Version of the plugin.
    #[serde(default)]
    pub version: String,
    /// One paragraph, the paper cited.
    #[serde(default)]
    pub description: String,
    /// SPDX licence expression; may be empty.
    #[serde(default)]
    pub license: String,
    /// Capabilities that the plugin claims.
    #[serde(default)]
    pub capabilities: Capabilities,
    /// JSON Schema of the options object; `null` when there are none.
    #[serde(default)]
    pub options_schema: serde_json::Value,
    /// Names of what has no capability: `dynamics:NAME` for each model of robots that it plans
    /// for, `part:ID` for each part that it reads. Two are limits, which hosts heed that know them:
    /// `agents:N` says that it plans for no more than N agents, `for:measuring` that it is there to
    /// measure hosts, and plans nothing worth having.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub features: Vec<String>,
    /// Encoding of the paths that the host sends.
    #[serde(default)]
    pub path_encoding: PathEncoding,
}

impl Descriptor {
    /// The feature of a planner that plans for one agent.
    pub const ONE_AGENT: &'static str = "agents:1";
    /// The feature of a planner that is there to measure hosts.
    pub const FOR_MEASURING: &'static str = "for:measuring";

    /// The most agents that it says it plans for; `None` without such a limit.
    pub fn most_agents(&self) -> Option<usize> {
        let mut features = self.features.iter();
        features.find_map(|feature| feature.strip_prefix("agents:")?.parse().ok())
    }

    /// True if it is there to measure hosts.
    pub fn is_for_measuring(&self) -> bool {
        let mut features = self.features.iter();
        features.any(|feature| feature == Self::FOR_MEASURING)
    }
}

/// Encoding of a path in JSON.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum PathEncoding {
    /// `[[row, col], …]`
    #[default]
    Pairs,
    /// Cell indices `[row * cols + col, …]`
    Cells,
    /// A string of moves from the agent's start; see [`crate::moves`].
    Moves,
}

impl PathEncoding {
    /// Every encoding.
    pub const ALL: [Self; 3] = [Self::Pairs, Self::Cells, Self::Moves];

    /// Its name in JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::Pairs => "pairs",
            Self::Cells => "cells",
            Self::Moves => "moves",
        }
    }
}

impl std::fmt::Display for PathEncoding {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.pad(self.name())
    }
}

/// Limits of one call.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Budget {
    /// When the call must have returned: nanoseconds of `CLOCK_MONOTONIC`.
    pub deadline_monotonic_ns: u64,
    /// When to come to an end, so that the answer arrives before the deadline, on the same clock:
    /// from here on a call is cancelled. Plans that were submitted before the deadline count.
    pub answer_by_ns: u64,
    /// Length of the budget when the call began.
    pub wall_ns: u64,
    /// Most search nodes to expand; 0 for no limit.
    #[serde(default)]
    pub nodes: u64,
    /// Most memory to use in bytes; 0 for no limit.
    #[serde(default)]
    pub memory_bytes: u64,
    /// Most threads to use at a time.
    #[serde(default = "one")]
    pub threads: u32,
    /// Seed of every random choice.
    #[serde(default)]
    pub seed: u64,
}

fn one() -> u32 {
    1
}

impl Budget {
    /// So long from `now_ns` on, on one thread, with seed 0 and no other limit.
    pub fn lasting(now_ns: u64, wall_ns: u64) -> Self {
        Self {
            deadline_monotonic_ns: 0,
            answer_by_ns: 0,
            wall_ns,
            nodes: 0,
            memory_bytes: 0,
            threads: 1,
            seed: 0,
        }
        .starting(now_ns)
    }

    /// The same budget for a call that begins at `now_ns`. The answer is due a fiftieth of the
    /// budget before the deadline, but at least 1 ms and at most 100 ms.
    #[must_use]
    pub fn starting(self, now_ns: u64) -> Self {
        let deadline_monotonic_ns = now_ns.saturating_add(self.wall_ns);
        let reserve = (self.wall_ns / 50).clamp(1_000_000, 100_000_000);
        Self {
            deadline_monotonic_ns,
            answer_by_ns: deadline_monotonic_ns.saturating_sub(reserve),
            ..self
        }
    }
}

/// Data with a name, frozen under its identifier: the one way in which inputs grow.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "PartWire")]
#[schemars(with = "PartWire")]
pub struct Part {
    /// `fleetyard.NAME/REVISION`; third parties begin with a reversed domain name.
    pub id: String,
    /// True if who does not know the part has to answer `unsupported`.
    #[serde(skip_serializing_if = "is_false")]
    pub critical: bool,
    /// The data.
    pub data: Data,
}

/// Data with a name, frozen under its identifier: the one way in which inputs grow.
#[derive(Serialize, Deserialize, JsonSchema)]
#[schemars(rename = "Part")]
struct PartWire {
    /// `fleetyard.NAME/REVISION`; third parties begin with a reversed domain name.
    id: String,
    /// True if who does not know the part has to answer `unsupported`.
    #[serde(default, skip_serializing_if = "is_false")]
    critical: bool,
    /// The data.
    #[serde(default)]
    data: serde_json::Value,
}

impl TryFrom<PartWire> for Part {
    type Error = String;

    fn try_from(PartWire { id, critical, data }: PartWire) -> Result<Self, String> {
        let data = Data::read(&id, data)?;
        Ok(Self { id, critical, data })
    }
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "for serde")]
fn is_false(value: &bool) -> bool {
    !*value
}

macro_rules! code_enum {
    ($(#[doc = $doc:literal])* $name:ident { $($(#[doc = $vdoc:literal])* $variant:ident = $code:ident, $text:literal;)* }) => {
        $(#[doc = $doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
        #[serde(rename_all = "kebab-case")]
        pub enum $name {
            $($(#[doc = $vdoc])* $variant,)*
        }

        impl $name {
            /// Every value, in the order of the constants.
            pub const ALL: &'static [Self] = &[$(Self::$variant),*];

            /// The value's name on the wire.
            pub fn as_str(self) -> &'static str {
                match self { $(Self::$variant => $text,)* }
            }

            /// The constant of the C ABI.
            pub fn code(self) -> i32 {
                match self { $(Self::$variant => c::$code,)* }
            }

            /// From the constant of the C ABI.
            pub fn from_code(code: i32) -> Option<Self> {
                match code { $(c::$code => Some(Self::$variant),)* _ => None }
            }
        }

        impl std::fmt::Display for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.pad(self.as_str())
            }
        }
    };
}

code_enum! {
    /// The plugin's account of its call. A claim, never a verdict.
    Status {
        /// The plan that was submitted solves the instance.
        Solved = STATUS_SOLVED, "solved";
        /// The instance has no solution, and the planner proved it.
        Infeasible = STATUS_INFEASIBLE, "infeasible";
        /// The budget ran out: the deadline or the node limit was reached.
        TimedOut = STATUS_TIMED_OUT, "timed-out";
        /// The planner stopped trying without a proof.
        GaveUp = STATUS_GAVE_UP, "gave-up";
        /// The planner stopped before the deadline because it was asked to.
        Cancelled = STATUS_CANCELLED, "cancelled";
        /// The planner cannot handle this kind of instance, map or option.
        Unsupported = STATUS_UNSUPPORTED, "unsupported";
        /// The input contradicts itself.
        InvalidInput = STATUS_INVALID_INPUT, "invalid-input";
        /// The plugin failed.
        InternalError = STATUS_INTERNAL_ERROR, "internal-error";
    }
}

code_enum! {
    /// The moves of a robot on a grid.
    Motion {
        /// To an adjacent cell, or waits, each in one step.
        Pebble = MOTION_PEBBLE, "pebble";
        /// As a pebble, but turning by 90 degrees takes a step.
        Rotation = MOTION_ROTATION, "rotation";
        /// In straight lines between the cells of its path, which need not be
        /// adjacent; a path is a place after the other, without times.
        AnyAngle = MOTION_ANY_ANGLE, "any-angle";
        /// On a roadmap, along an edge at the roadmap's speed, or waits on a vertex.
        StopGo = MOTION_STOP_GO, "stop-go";
        /// On a roadmap, along an edge at any uniform speed up to the roadmap's, or waits on a
        /// vertex.
        Slower = MOTION_SLOWER, "slower";
        /// In the plane, as its robot's model says.
        Dynamics = MOTION_DYNAMICS, "dynamics";
    }
}

code_enum! {
    /// The quantity that a plan should minimise.
    Objective {
        /// The sum over agents of the last time of arrival at the goal.
        SumOfCosts = OBJECTIVE_SUM_OF_COSTS, "sum-of-costs";
        /// The time at which the last agent arrives.
        Makespan = OBJECTIVE_MAKESPAN, "makespan";
    }
}

code_enum! {
    /// The direction in which a robot on a grid looks.
    Heading {
        /// Towards larger columns.
        East = HEADING_EAST, "east";
        /// Towards larger rows.
        South = HEADING_SOUTH, "south";
        /// Towards smaller columns.
        West = HEADING_WEST, "west";
        /// Towards smaller rows.
        North = HEADING_NORTH, "north";
    }
}

impl Heading {
    /// The heading of a robot that goes to an adjacent cell of a grid of so many columns.
    pub fn of_move(from: u32, to: u32, cols: u32) -> Self {
        if from.checked_add(cols) == Some(to) {
            Self::South
        } else if to.checked_add(cols) == Some(from) {
            Self::North
        } else if to > from {
            Self::East
        } else {
            Self::West
        }
    }

    /// Turns by 90 degrees from one heading to another, the short way: at most 2.
    pub fn quarters_to(self, other: Self) -> u32 {
        // Headings are numbered round the compass.
        let apart = (other.code() - self.code()).rem_euclid(4) as u32;
        apart.min(4 - apart)
    }
}

code_enum! {
    /// Severity of a log line.
    LogLevel {
        /// Something failed.
        Error = LOG_ERROR, "error";
        /// Something is odd.
        Warning = LOG_WARNING, "warning";
        /// Worth knowing once per run.
        Info = LOG_INFO, "info";
        /// For the plugin's author.
        Debug = LOG_DEBUG, "debug";
    }
}

/// A model of robots.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Robot {
    /// Its name, for messages.
    #[serde(default)]
    pub name: String,
    /// Its body.
    pub footprint: Footprint,
    /// Name of its dynamics, such as `fleetyard.double-integrator/1`; empty where any motion will
    /// do.
    #[serde(default)]
    pub dynamics: String,
    /// True if a state has a heading after x and y.
    #[serde(default, skip_serializing_if = "is_false")]
    pub has_heading: bool,
    /// True if the largest of the first two rates of a state bounds their length.
    #[serde(default, skip_serializing_if = "is_false")]
    pub polar_state: bool,
    /// True if the largest of the first two numbers of a control bounds their length.
    #[serde(default, skip_serializing_if = "is_false")]
    pub polar_control: bool,
    /// The limits of each number of a state, `[least, most]`; `null` where there is none.
    #[serde(default)]
    pub state_limits: Vec<[Limit; 2]>,
    /// The limits of each number of a control, `[least, most]`; `null` where there is none.
    #[serde(default)]
    pub control_limits: Vec<[Limit; 2]>,
    /// Further numbers, as the dynamics say.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub parameters: Vec<f64>,
}

/// A limit, if there is one.
pub type Limit = Option<f64>;

/// A state of a robot in the plane: x, y, the heading if its model has one, and what its dynamics
/// add. NaN, `null` on the wire, where any value will do.
#[derive(Debug, Clone, PartialEq, JsonSchema)]
#[schemars(with = "Vec<Option<f64>>")]
pub struct State(pub Vec<f64>);

impl Serialize for State {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let known = |number: &f64| (!number.is_nan()).then_some(*number);
        serializer.collect_seq(self.0.iter().map(known))
    }
}

impl<'de> Deserialize<'de> for State {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let numbers = Vec::<Option<f64>>::deserialize(deserializer)?;
        let known = |number: Option<f64>| number.unwrap_or(f64::NAN);
        Ok(Self(numbers.into_iter().map(known).collect()))
    }
}

/// An instance: the input of a planner, on the environment it was prepared for. A *place* is a cell
/// of a grid or a vertex of a roadmap.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Instance {
    /// Start of every agent, a place; empty in the plane.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub starts: Vec<u32>,
    /// Start heading of every agent, when headings matter.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub headings: Option<Vec<Heading>>,
    /// Goals of every agent, places to be visited in order. An agent without one may end anywhere.
    #[serde(default, skip_serializing_if = "Lists::is_empty")]
    pub goals: Goals,
    /// Start of every agent in the plane; empty elsewhere.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub start_states: Vec<State>,
    /// Goals of every agent in the plane; empty elsewhere.
    #[serde(default, skip_serializing_if = "Lists::is_empty")]
    #[schemars(with = "Vec<Vec<State>>")]
    pub goal_states: Lists<State>,
    /// Models of robots. May be empty on grids and roadmaps.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub robots: Vec<Robot>,
    /// The model of every agent; empty when there is one model at most.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub robot_of: Vec<u32>,
    /// The motion of robots.
    #[serde(default = "pebble")]
    pub motion: Motion,
    /// The quantity to minimise.
    #[serde(default = "sum_of_costs")]
    pub objective: Objective,
    /// On grids: collisions after this many steps do not matter, and paths may end before
    /// their goals; 0 for a complete plan.
    #[serde(default)]
    pub window_steps: u32,
    /// The same in the other representations.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub window_s: f64,
    /// Radius of the largest robot's enclosing circle.
    #[serde(default)]
    pub radius_m: f64,
    /// True if three or more agents may move round in a ring in one step, each into the cell that
    /// the next one leaves. In plans for a fleet nobody enters a cell before it is empty.
    #[serde(default, skip_serializing_if = "is_false")]
    pub allows_cycles: bool,
    /// True if no agent may follow another one round a corner, because robots of `radius_m` would
    /// touch there.
    #[serde(default, skip_serializing_if = "is_false")]
    pub strict: bool,
    /// In the plane: distance from its goal at which a robot may end.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub goal_tolerance_m: f64,
    /// In the plane: the same of its heading.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub goal_tolerance_rad: f64,
    /// In the plane: the same of each further number of its state, where controls say it.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub goal_tolerance_rate: f64,
    /// In the plane: how far controls may lead beside the knots of the same plan, in metres and in
    /// radians.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub dynamics_tolerance: f64,
    /// Further data by name.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub parts: Vec<Part>,
}

/// A task that an instance generator gives to an agent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Assignment {
    /// Number of the agent.
    pub agent: u32,
    /// Identifier of one of the open tasks.
    pub task: u64,
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "for serde")]
fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

fn pebble() -> Motion {
    Motion::Pebble
}

fn sum_of_costs() -> Objective {
    Objective::SumOfCosts
}

/// Nobody, pebbles, sum of costs, no window; for struct update syntax.
impl Default for Instance {
    fn default() -> Self {
        Self {
            starts: Vec::new(),
            headings: None,
            goals: Goals::default(),
            start_states: Vec::new(),
            goal_states: Lists::default(),
            robots: Vec::new(),
            robot_of: Vec::new(),
            motion: Motion::Pebble,
            objective: Objective::SumOfCosts,
            window_steps: 0,
            window_s: 0.0,
            radius_m: 0.0,
            allows_cycles: false,
            strict: false,
            goal_tolerance_m: 0.0,
            goal_tolerance_rad: 0.0,
            goal_tolerance_rate: 0.0,
            dynamics_tolerance: 0.0,
            parts: Vec::new(),
        }
    }
}

impl Instance {
    /// One goal per agent, pebbles that may move round in rings, sum of costs, no window.
    pub fn one_shot(starts: Vec<u32>, goals: Vec<u32>) -> Self {
        Self {
            starts,
            goals: Goals::single(goals),
            allows_cycles: true,
            ..Self::default()
        }
    }

    /// Number of agents.
    pub fn agents(&self) -> usize {
        self.starts.len().max(self.start_states.len())
    }

    /// Number of goals of an agent, which must exist.
    fn goals_of(&self, agent: usize) -> usize {
        let places = self.goals.get(agent).map_or(0, <[u32]>::len);
        places.max(self.goal_states.get(agent).map_or(0, <[State]>::len))
    }

    /// The model of an agent's robot, if the instance has models.
    pub fn robot(&self, agent: usize) -> Option<&Robot> {
        let model = self.robot_of.get(agent).copied().unwrap_or(0);
        self.robots.get(model as usize)
    }

    /// The capabilities that a planner must have to solve it: its motion, `windowed` for a
    /// window or for several goals of one agent, `idle` for an agent without one, `heterogeneous`
    /// for several models of robots, and `duplicate-goals` where several agents end at one goal and
    /// no window ends before.
    pub fn needs(&self) -> Capabilities {
        let mut needed = vec![match self.motion {
            Motion::Pebble => Capability::Pebble,
            Motion::Rotation => Capability::Rotation,
            Motion::AnyAngle => Capability::AnyAngle,
            Motion::StopGo => Capability::StopGo,
            Motion::Slower => Capability::Slower,
            Motion::Dynamics => Capability::Dynamics,
        }];
        let counts = || (0..self.agents()).map(|agent| self.goals_of(agent));
        let windowed = self.window_steps > 0 || self.window_s > 0.0;
        if windowed || counts().any(|goals| goals > 1) {
            needed.push(Capability::Windowed);
        }
        if counts().any(|goals| goals == 0) {
            needed.push(Capability::Idle);
        }
        if self.robots.len() > 1 {
            needed.push(Capability::Heterogeneous);
        }
        if !windowed {
            let mut last: Vec<_> = self.goals.iter().filter_map(<[u32]>::last).collect();
            last.sort_unstable();
            if last.windows(2).any(|pair| pair[0] == pair[1]) {
                needed.push(Capability::DuplicateGoals);
            }
        }
        Capabilities::of(&needed)
    }

    /// Names of what has no capability and a planner must list in its descriptor's features: the
    /// dynamics of robots where they matter, and critical parts.
    pub fn needs_features(&self) -> Vec<String> {
        let moved = self.motion == Motion::Dynamics;
        let dynamics = self.robots.iter().filter(|_| moved);
        let mut needed: Vec<String> = dynamics
            .filter(|robot| !robot.dynamics.is_empty())
            .map(|robot| format!("dynamics:{}", robot.dynamics))
            .chain(critical(&self.parts))
            .collect();
        needed.sort_unstable();
        needed.dedup();
        needed
    }

    /// Checks that lengths agree, and that all places are among `places`, the cells of a grid or
    /// the vertices of a roadmap; `None` in the plane. Gives the reason why not otherwise.
    pub fn check(&self, places: Option<usize>) -> Result<(), String> {
        let agents = self.agents();
        let at_places = (self.starts.len(), self.goals.len());
        let in_plane = (self.start_states.len(), self.goal_states.len());
        let ((starts, goals), others) = match places {
            Some(_) => (at_places, in_plane),
            None => (in_plane, at_places),
        };
        if others != (0, 0) {
            return Err("starts or goals both at places and in the plane".into());
        }
        if starts == 0 || agents != starts || goals != agents {
            return Err(format!("{starts} starts but {goals} goal lists"));
        }
        let length = |what: &str, len: usize| {
            let same = len == agents;
            let reason = || format!("`{what}` has {len} entries, but there are {agents} agents");
            if same { Ok(()) } else { Err(reason()) }
        };
        if let Some(headings) = &self.headings {
            length("headings", headings.len())?;
        }
        if !self.robot_of.is_empty() {
            length("robot_of", self.robot_of.len())?;
        } else if self.robots.len() > 1 {
            return Err("several models of robots, but no `robot_of`".into());
        }
        let mut models = self.robot_of.iter();
        if let Some(model) = models.find(|model| **model as usize >= self.robots.len()) {
            return Err(format!(
                "robot {model} is none of the {} models",
                self.robots.len()
            ));
        }
        for robot in &self.robots {
            robot.footprint.check()?;
        }
        match places {
            Some(places) => self.check_places(places),
            None => self.check_states(),
        }
    }

    fn check_places(&self, places: usize) -> Result<(), String> {
        let mut all = self.starts.iter().chain(self.goals.items());
        match all.find(|place| **place as usize >= places) {
            Some(place) => Err(format!("cell {place} is not on a map of {places} cells")),
            None => Ok(()),
        }
    }

    fn check_states(&self) -> Result<(), String> {
        for agent in 0..self.agents() {
            let Some(robot) = self.robot(agent) else {
                return Err("an instance in the plane without a model of robots".into());
            };
            let size = robot.state_limits.len();
            let least = if robot.has_heading { 3 } else { 2 };
            if size < least {
                return Err(format!(
                    "the robot of agent {agent} has states of {size} numbers, but its position \
                     and heading are {least}"
                ));
            }
            let start = &self.start_states[agent];
            let mut states = self.goal_states[agent].iter().chain([start]);
            if let Some(state) = states.find(|state| state.0.len() != size) {
                return Err(format!(
                    "agent {agent} has a state of {} numbers, but its robot has {size}",
                    state.0.len()
                ));
            }
            if start.0.iter().any(|number| !number.is_finite()) {
                return Err(format!("agent {agent} has no start"));
            }
        }
        Ok(())
    }
}

/// The features that critical parts need.
pub(crate) fn critical<'a>(
    parts: impl IntoIterator<Item = &'a Part>,
) -> impl Iterator<Item = String> {
    let critical = parts.into_iter().filter(|part| part.critical);
    critical.map(|part| format!("part:{}", part.id))
}

/// The state of the fleet when everything committed has been executed, and the work that is left.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FleetState {
    /// Simulated time since the run began.
    pub time_s: f64,
    /// The next instance as it is if nobody is given more. Its goals are those that agents have been
    /// given and have not reached, in order: the first is current. Where goals never end, they are
    /// as many as it takes to keep the agent busy for longer than the window, and at least two. Its
    /// window is the one asked for.
    pub next: Instance,
    /// Tasks that were released and given to nobody.
    #[serde(default)]
    pub tasks: Vec<Task>,
    /// Further data by name.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub parts: Vec<Part>,
}

impl FleetState {
    /// A request for these goals, with the window as asked and no task given to anybody.
    pub fn request(&self, goals: Goals) -> Request {
        Request {
            goals,
            window_steps: self.next.window_steps,
            window_s: self.next.window_s,
            assignments: Vec::new(),
        }
    }

    /// The instance that a generator asks for.
    pub fn instance(&self, request: &Request) -> Instance {
        Instance {
            goals: request.goals.clone(),
            window_steps: request.window_steps,
            window_s: request.window_s,
            ..self.next.clone()
        }
    }
}

/// The decision of an instance generator: the rest of the next instance is as `next` of the state
/// has it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Request {
    /// The goals that the planner is asked to visit, for every agent, in order.
    pub goals: Goals,
    /// The window of the next instance on a grid, no longer than the one asked for.
    #[serde(default)]
    pub window_steps: u32,
    /// The same in the other representations.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub window_s: f64,
    /// Tasks that are given to agents: the host appends the places of a task to the goals of its
    /// agent.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub assignments: Vec<Assignment>,
}

impl Request {
    /// The sentence for a request with goal lists for too few or too many agents.
    pub(crate) fn wrong_agents(goal_lists: usize, agents: usize) -> String {
        format!("the request has {goal_lists} goal lists, but there are {agents} agents")
    }

    /// Checks that it is about so many agents and that all places are among `places`. Gives the
    /// reason why not otherwise.
    pub fn check(&self, agents: usize, places: usize) -> Result<(), String> {
        if self.goals.len() != agents {
            return Err(Self::wrong_agents(self.goals.len(), agents));
        }
        let mut all = self.goals.items().iter();
        if let Some(place) = all.find(|place| **place as usize >= places) {
            return Err(format!("cell {place} is not on a map of {places} cells"));
        }
        let mut given = self.assignments.iter();
        match given.find(|assignment| assignment.agent as usize >= agents) {
            Some(Assignment { agent, task }) => Err(format!(
                "task {task} is given to agent {agent}, but there are {agents} agents"
            )),
            None => Ok(()),
        }
    }
}

/// An open task.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Task {
    /// Identifier.
    pub id: u64,
    /// The places that it visits, in order.
    pub places: Vec<u32>,
    /// Simulated time at which it was released.
    #[serde(default)]
    pub released_s: f64,
}

/// The status of the fleet.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FleetStatus {
    /// Simulated time since the run began.
    pub time_s: f64,
    /// Simulated time since the planner was last called.
    pub since_last_call_s: f64,
    /// Limit of the planner's time: its answer to a call now takes effect so much later.
    pub planning_limit_s: f64,
    /// The least time that an action of a robot takes.
    pub action_s: f64,
    /// Per agent, committed actions that are not yet executed.
    pub actions_left: Vec<u32>,
}

/// Shared environments: a planner may keep what it was prepared with.
pub type SharedEnvironment = Arc<Environment>;
