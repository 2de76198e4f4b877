//! The owned model: the same things as the C structures, as Rust values whose
//! serde form is the JSON wire.

use std::sync::Arc;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::c;
use crate::lists::Goals;

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
    /// The pebble motion model.
    Pebble = CAPABILITY_PEBBLE, "pebble";
    /// The rotation motion model.
    Rotation = CAPABILITY_ROTATION, "rotation";
    /// The any-angle motion model.
    AnyAngle = CAPABILITY_ANY_ANGLE, "any-angle";
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
    /// Encoding of the paths that the host sends.
    #[serde(default)]
    pub path_encoding: PathEncoding,
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
    /// When to come to an end, so that the answer arrives before the deadline: a
    /// fiftieth of the budget earlier, but at least 1 ms and at most 100 ms. A late
    /// answer does not count, though plans that were submitted in time do.
    pub fn answer_by_ns(&self) -> u64 {
        let reserve = (self.wall_ns / 50).clamp(1_000_000, 100_000_000);
        self.deadline_monotonic_ns.saturating_sub(reserve)
    }
}

/// The part of the input that stays the same between calls: the map.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "representation", rename_all = "kebab-case")]
pub enum Environment {
    /// A grid.
    Grid(GridEnvironment),
}

impl Environment {
    /// The grid, if the environment is one.
    pub fn grid(&self) -> Option<&GridEnvironment> {
        match self {
            Self::Grid(grid) => Some(grid),
        }
    }

    /// The capabilities that a plugin must have to learn it.
    pub fn needs(&self) -> Capabilities {
        match self {
            Self::Grid(grid) if grid.connectivity == 4 => Capabilities::of(&[Capability::Grid]),
            Self::Grid(_) => Capabilities::of(&[Capability::Grid, Capability::EightConnected]),
        }
    }
}

/// A grid. On the wire `passable` and `terrain` are lists of row strings.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "GridWire", into = "GridWire")]
#[schemars(with = "GridWire")]
pub struct GridEnvironment {
    /// The map's name, for messages.
    pub map_name: String,
    /// Number of rows.
    pub rows: u32,
    /// Number of columns.
    pub cols: u32,
    /// 4 or 8 neighbours.
    pub connectivity: u32,
    /// Side of a cell.
    pub cell_size_m: f64,
    /// Duration of one move or wait.
    pub step_s: f64,
    /// Row-major: 1 where a robot may stand, else 0.
    pub passable: Vec<u8>,
    /// Row-major terrain letters as in the map file.
    pub terrain: Vec<u8>,
}

impl GridEnvironment {
    /// A four-connected grid without a name, of cells of 1 m and steps of 1 s; `passable` has
    /// an entry for each cell, row by row.
    pub fn four_connected(rows: u32, cols: u32, passable: Vec<u8>) -> Self {
        Self {
            map_name: String::new(),
            rows,
            cols,
            connectivity: 4,
            cell_size_m: 1.0,
            step_s: 1.0,
            terrain: passable
                .iter()
                .map(|free| if *free == 0 { b'@' } else { b'.' })
                .collect(),
            passable,
        }
    }
}

#[derive(Serialize, Deserialize, JsonSchema)]
#[schemars(rename = "Grid")]
struct GridWire {
    /// The map's name, for messages.
    map_name: String,
    /// Number of rows.
    rows: u32,
    /// Number of columns.
    cols: u32,
    /// 4 or 8 neighbours.
    connectivity: u32,
    /// Side of a cell.
    cell_size_m: f64,
    /// Duration of one move or wait.
    step_s: f64,
    /// One string a row, `.` where a robot may stand and `@` elsewhere.
    passable: Vec<String>,
    /// One string a row of terrain letters as in the map file; left out when it
    /// says no more than `passable`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    terrain: Vec<String>,
}

impl From<GridEnvironment> for GridWire {
    fn from(grid: GridEnvironment) -> Self {
        let cols = (grid.cols as usize).max(1);
        let free = |byte: &u8| if *byte == 0 { '@' } else { '.' };
        let passable: Vec<String> = grid
            .passable
            .chunks(cols)
            .map(|row| row.iter().map(free).collect())
            .collect();
        let terrain: Vec<String> = grid
            .terrain
            .chunks(cols)
            .map(|row| row.iter().copied().map(char::from).collect())
            .collect();
        Self {
            map_name: grid.map_name,
            rows: grid.rows,
            cols: grid.cols,
            connectivity: grid.connectivity,
            cell_size_m: grid.cell_size_m,
            step_s: grid.step_s,
            terrain: if terrain == passable {
                Vec::new()
            } else {
                terrain
            },
            passable,
        }
    }
}

impl TryFrom<GridWire> for GridEnvironment {
    type Error = String;

    fn try_from(wire: GridWire) -> Result<Self, String> {
        if wire.rows == 0 || wire.cols == 0 {
            return Err(format!(
                "a grid of {} rows and {} columns has no cell",
                wire.rows, wire.cols
            ));
        }
        let flatten = |what: &str, rows: &[String]| {
            let whole = rows.len() == wire.rows as usize
                && rows
                    .iter()
                    .all(|row| row.is_ascii() && row.len() == wire.cols as usize);
            if whole {
                Ok(rows.concat().into_bytes())
            } else {
                Err(format!(
                    "`{what}` is not {} rows of {} letters",
                    wire.rows, wire.cols
                ))
            }
        };
        let letters = flatten("passable", &wire.passable)?;
        let terrain = if wire.terrain.is_empty() {
            letters.clone()
        } else {
            flatten("terrain", &wire.terrain)?
        };
        Ok(Self {
            map_name: wire.map_name,
            rows: wire.rows,
            cols: wire.cols,
            connectivity: wire.connectivity,
            cell_size_m: wire.cell_size_m,
            step_s: wire.step_s,
            passable: letters
                .iter()
                .map(|letter| u8::from(*letter == b'.'))
                .collect(),
            terrain,
        })
    }
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

/// An instance: the input of a planner, on the environment it was prepared for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Instance {
    /// Start cell of every agent.
    pub starts: Vec<u32>,
    /// Start heading of every agent, when headings matter.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub headings: Option<Vec<Heading>>,
    /// Goal cells of every agent, to be visited in order; at least one each.
    pub goals: Goals,
    /// The motion of robots.
    #[serde(default = "pebble")]
    pub motion: Motion,
    /// The quantity to minimise.
    #[serde(default = "sum_of_costs")]
    pub objective: Objective,
    /// Collisions after this many steps do not matter, and paths may end before
    /// their goals; 0 for a complete plan.
    #[serde(default)]
    pub window_steps: u32,
    /// Radius of the largest robot's enclosing circle.
    #[serde(default)]
    pub radius_m: f64,
    /// True if three or more agents may move round in a ring in one step, each into the cell that
    /// the next one leaves. Plans for a fleet must not: there nobody enters a cell before it is
    /// empty.
    #[serde(default = "yes")]
    pub allows_cycles: bool,
    /// Tasks that an instance generator gives to agents: the host appends the cells
    /// of a task to the goals of its agent. Empty in calls of planners and fail
    /// policies.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub assignments: Vec<Assignment>,
}

/// A task that an instance generator gives to an agent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Assignment {
    /// Number of the agent.
    pub agent: u32,
    /// Identifier of one of the open tasks.
    pub task: u64,
}

fn yes() -> bool {
    true
}

fn pebble() -> Motion {
    Motion::Pebble
}

fn sum_of_costs() -> Objective {
    Objective::SumOfCosts
}

impl Instance {
    /// One goal per agent, pebbles, sum of costs, no window.
    pub fn one_shot(starts: Vec<u32>, goals: Vec<u32>) -> Self {
        Self {
            starts,
            headings: None,
            goals: Goals::single(goals),
            motion: Motion::Pebble,
            objective: Objective::SumOfCosts,
            window_steps: 0,
            radius_m: 0.0,
            allows_cycles: true,
            assignments: Vec::new(),
        }
    }

    /// Number of agents.
    pub fn agents(&self) -> usize {
        self.starts.len()
    }

    /// The capabilities that a planner must have to solve it: its motion, `windowed` for a
    /// window or for other than one goal per agent, and `duplicate-goals` where several agents
    /// end at one goal and no window ends before.
    pub fn needs(&self) -> Capabilities {
        let mut needed = vec![match self.motion {
            Motion::Pebble => Capability::Pebble,
            Motion::Rotation => Capability::Rotation,
            Motion::AnyAngle => Capability::AnyAngle,
        }];
        if self.window_steps > 0 || self.goals.iter().any(|goals| goals.len() != 1) {
            needed.push(Capability::Windowed);
        }
        if self.window_steps == 0 {
            let mut last: Vec<_> = self.goals.iter().filter_map(<[u32]>::last).collect();
            last.sort_unstable();
            if last.windows(2).any(|pair| pair[0] == pair[1]) {
                needed.push(Capability::DuplicateGoals);
            }
        }
        Capabilities::of(&needed)
    }

    /// Checks that lengths agree, every agent has a goal, and all cells are on a map of `cells`
    /// cells. Gives the reason why not otherwise.
    pub fn check(&self, cells: usize) -> Result<(), String> {
        let agents = self.agents();
        if agents == 0 || self.goals.len() != agents {
            return Err(format!(
                "{agents} starts but {} goal lists",
                self.goals.len()
            ));
        }
        if self
            .headings
            .as_ref()
            .is_some_and(|headings| headings.len() != agents)
        {
            return Err("`headings` has another length than `starts`".into());
        }
        if let Some(agent) = self.goals.iter().position(<[u32]>::is_empty) {
            return Err(format!("agent {agent} has no goal"));
        }
        let mut all = self.starts.iter().chain(self.goals.items());
        if let Some(cell) = all.find(|cell| **cell as usize >= cells) {
            return Err(format!("cell {cell} is not on a map of {cells} cells"));
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

/// The state of the fleet when everything committed has been executed, and the work that is left.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FleetState {
    /// Simulated time since the run began.
    pub time_s: f64,
    /// Every agent's cell at the end of what is committed.
    pub cells: Vec<u32>,
    /// Every agent's heading there, when headings matter.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub headings: Option<Vec<Heading>>,
    /// Goals that agents have been given and have not reached, in order: the first is
    /// current. Where goals never end, as many as it takes to keep the agent busy for
    /// longer than the window, and at least two.
    pub goals: Goals,
    /// Tasks that were released and given to nobody.
    pub tasks: Vec<Task>,
    /// Planning window asked for in steps; 0 for none. The next instance may have a
    /// shorter one.
    #[serde(default)]
    pub window_steps: u32,
    /// The motion of robots, which the next instance must repeat.
    #[serde(default = "pebble")]
    pub motion: Motion,
    /// The quantity to minimise, which the next instance must repeat.
    #[serde(default = "sum_of_costs")]
    pub objective: Objective,
    /// Radius of the largest robot's enclosing circle, which the next instance must repeat.
    #[serde(default)]
    pub radius_m: f64,
    /// True if agents may move round in a ring in one step; the next instance must repeat it.
    #[serde(default = "yes")]
    pub allows_cycles: bool,
}

impl FleetState {
    /// The next instance with these goals: it repeats what it has to, takes the window
    /// as asked, and gives no task to anybody.
    pub fn instance(&self, goals: Goals) -> Instance {
        Instance {
            starts: self.cells.clone(),
            headings: self.headings.clone(),
            goals,
            motion: self.motion,
            objective: self.objective,
            window_steps: self.window_steps,
            radius_m: self.radius_m,
            allows_cycles: self.allows_cycles,
            assignments: Vec::new(),
        }
    }
}

/// An open task.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Task {
    /// Identifier.
    pub id: u64,
    /// The cells that it visits, in order.
    pub cells: Vec<u32>,
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
