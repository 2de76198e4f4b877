//! The C ABI: every type and constant of `fleetyard.h`, which is generated from
//! this file.
//!
//! The rules, so that a structure can stay frozen once it is released:
//!
//! - Nothing changes owner. Inputs are borrowed for the duration of the call;
//!   outputs go to the host's [`Sink`], which copies before it returns.
//! - Growth is by `get_extension` on both sides, never by longer structures.
//!   `struct_size` is a tripwire: it must equal `sizeof` the structure.
//! - No `bool` and no `enum` crosses: `int32_t` and named constants do.
//! - Large arrays are flat with offsets: `n + 1` offsets and one value array.
//! - Times are nanoseconds (`_ns`, `uint64_t`) or seconds (`_s`, `double`) on the
//!   clock that the name says; lengths are metres (`_m`).
//! - A pointer that may be null says so; every other pointer is not null.
//!
//! Thread tags: `[main-thread]` is the one thread on which the host makes all
//! calls into one object; `[thread-safe]` may be called from any thread while
//! the call that received it has not returned.

use std::ffi::c_void;

#[cfg(feature = "layout")]
use abi_stable::StableAbi;

/// Major version of the ABI; host and plugin agree only when it is equal.
pub const ABI_MAJOR: u16 = 1;
/// Minor version of the ABI; grows with additions that old plugins can ignore.
pub const ABI_MINOR: u16 = 0;

/// `get_factory` identifier of `FleetyardPlannerFactory`.
pub const PLANNER_FACTORY_ID: &str = "fleetyard.planner/1";
/// `get_factory` identifier of `FleetyardFailPolicyFactory`.
pub const FAIL_POLICY_FACTORY_ID: &str = "fleetyard.fail-policy/1";
/// `get_factory` identifier of `FleetyardInstanceGeneratorFactory`.
pub const INSTANCE_GENERATOR_FACTORY_ID: &str = "fleetyard.instance-generator/1";
/// `get_factory` identifier of `FleetyardInvocationPolicyFactory`.
pub const INVOCATION_POLICY_FACTORY_ID: &str = "fleetyard.invocation-policy/1";

/// Success, for functions that return a result code.
pub const OK: i32 = 0;
/// The host refused what was submitted (malformed, too late, or cancelled).
pub const REJECTED: i32 = -1;

/// The plan that was submitted solves the instance.
pub const STATUS_SOLVED: i32 = 0;
/// The instance has no solution, and the planner proved it.
pub const STATUS_INFEASIBLE: i32 = 1;
/// The budget ran out: the deadline or the node limit was reached.
pub const STATUS_TIMED_OUT: i32 = 2;
/// The planner stopped trying without a proof.
pub const STATUS_GAVE_UP: i32 = 3;
/// The planner stopped before the deadline because `cancelled` returned non-zero.
pub const STATUS_CANCELLED: i32 = 4;
/// The planner cannot handle this kind of instance, map or option.
pub const STATUS_UNSUPPORTED: i32 = 5;
/// The input contradicts itself.
pub const STATUS_INVALID_INPUT: i32 = 6;
/// The plugin failed; `FleetyardSink::fail` says why.
pub const STATUS_INTERNAL_ERROR: i32 = 7;

/// Cells of a grid, unit time steps.
pub const REPRESENTATION_GRID: i32 = 0;
/// A graph embedded in the plane, continuous time.
pub const REPRESENTATION_ROADMAP: i32 = 1;
/// Free space itself, continuous time.
pub const REPRESENTATION_CONTINUOUS: i32 = 2;

/// A robot moves to an adjacent cell or waits, each in one step.
pub const MOTION_PEBBLE: i32 = 0;
/// As a pebble, but turning by 90 degrees takes a step.
pub const MOTION_ROTATION: i32 = 1;
/// A robot moves in straight lines between the cells of its path, which need not be
/// adjacent; a path is a place after the other, without times.
pub const MOTION_ANY_ANGLE: i32 = 2;

/// Minimise the sum over agents of the last time of arrival at the goal.
pub const OBJECTIVE_SUM_OF_COSTS: i32 = 0;
/// Minimise the time at which the last agent arrives.
pub const OBJECTIVE_MAKESPAN: i32 = 1;

/// Heading of a robot on a grid: towards larger columns.
pub const HEADING_EAST: i32 = 0;
/// Heading of a robot on a grid: towards larger rows.
pub const HEADING_SOUTH: i32 = 1;
/// Heading of a robot on a grid: towards smaller columns.
pub const HEADING_WEST: i32 = 2;
/// Heading of a robot on a grid: towards smaller rows.
pub const HEADING_NORTH: i32 = 3;

/// Capability: plans on grids.
pub const CAPABILITY_GRID: u64 = 1 << 0;
/// Capability: plans on roadmaps.
pub const CAPABILITY_ROADMAP: u64 = 1 << 1;
/// Capability: plans in continuous space.
pub const CAPABILITY_CONTINUOUS: u64 = 1 << 2;
/// Capability: grids with eight neighbours as well as four.
pub const CAPABILITY_EIGHT_CONNECTED: u64 = 1 << 3;
/// Capability: the pebble motion model.
pub const CAPABILITY_PEBBLE: u64 = 1 << 8;
/// Capability: the rotation motion model.
pub const CAPABILITY_ROTATION: u64 = 1 << 9;
/// Capability: the any-angle motion model.
pub const CAPABILITY_ANY_ANGLE: u64 = 1 << 10;
/// Capability: keeps submitting better plans until the budget ends.
pub const CAPABILITY_ANYTIME: u64 = 1 << 16;
/// Capability: several goals per agent, planned up to `FleetyardInstance::window_steps`.
pub const CAPABILITY_WINDOWED: u64 = 1 << 17;
/// Capability: goals that several agents share.
pub const CAPABILITY_DUPLICATE_GOALS: u64 = 1 << 18;
/// Capability: may submit colliding paths when it fails, for a fail policy.
pub const CAPABILITY_COLLIDING_PLANS: u64 = 1 << 19;
/// Capability: plans that tolerate k steps of delay (option `k`).
pub const CAPABILITY_K_ROBUST: u64 = 1 << 20;
/// Capability: the same instance, options and seed give the same plan.
pub const CAPABILITY_DETERMINISTIC: u64 = 1 << 21;
/// Capability: uses more than one thread when the budget allows it.
pub const CAPABILITY_THREADS: u64 = 1 << 22;

/// Log level: something failed.
pub const LOG_ERROR: i32 = 0;
/// Log level: something is odd.
pub const LOG_WARNING: i32 = 1;
/// Log level: worth knowing once per run.
pub const LOG_INFO: i32 = 2;
/// Log level: for the plugin's author.
pub const LOG_DEBUG: i32 = 3;

/// `FleetyardInvocationPolicy::should_invoke` answers: not yet.
pub const INVOKE_NOT_YET: i32 = 0;
/// `FleetyardInvocationPolicy::should_invoke` answers: call the planner now.
pub const INVOKE_NOW: i32 = 1;

/// UTF-8 text, not terminated by a zero byte.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout", derive(StableAbi))]
pub struct Str {
    /// First byte; may be null when `len` is 0.
    pub ptr: *const u8,
    /// Length in bytes.
    pub len: usize,
}

/// Limits of one call. The host enforces them; a planner that keeps them is not
/// killed.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout", derive(StableAbi))]
pub struct Budget {
    /// `sizeof(FleetyardBudget)`.
    pub struct_size: u32,
    /// Most threads to use at a time; at least 1.
    pub threads: u32,
    /// When the call must have returned: nanoseconds of `CLOCK_MONOTONIC`.
    pub deadline_monotonic_ns: u64,
    /// Length of the budget when the call began.
    pub wall_ns: u64,
    /// Most search nodes to expand; 0 for no limit.
    pub nodes: u64,
    /// Most memory to use in bytes; 0 for no limit.
    pub memory_bytes: u64,
    /// Seed of every random choice.
    pub seed: u64,
}

/// A grid: row 0 is the top, column 0 the left, and the cell at `(row, col)` has
/// the index `row * cols + col`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout", derive(StableAbi))]
pub struct Grid {
    /// `sizeof(FleetyardGrid)`.
    pub struct_size: u32,
    /// Number of rows.
    pub rows: u32,
    /// Number of columns.
    pub cols: u32,
    /// 4 or 8 neighbours. A diagonal move needs both shared orthogonal
    /// neighbours free.
    pub connectivity: u32,
    /// Side of a cell.
    pub cell_size_m: f64,
    /// Duration of one move or wait.
    pub step_s: f64,
    /// `rows * cols` bytes: 1 where a robot may stand, else 0.
    pub passable: *const u8,
    /// `rows * cols` terrain letters as in the map file (`e` endpoint, `w`
    /// workstation, …).
    pub terrain: *const u8,
}

/// The part of the input that stays the same between calls: the map.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout", derive(StableAbi))]
pub struct Environment {
    /// `sizeof(FleetyardEnvironment)`.
    pub struct_size: u32,
    /// One of `FLEETYARD_REPRESENTATION_*`; says what `view` points to.
    pub representation: i32,
    /// The map's name, for messages.
    pub map_name: Str,
    /// `FleetyardGrid` when the representation is a grid.
    pub view: *const c_void,
}

/// A task that an instance generator gives to an agent.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout", derive(StableAbi))]
pub struct Assignment {
    /// Identifier of the task, one of `FleetyardFleetState::task_ids`.
    pub task: u64,
    /// Number of the agent.
    pub agent: u32,
    /// Zero.
    pub reserved: u32,
}

/// An instance: the input of a planner.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout", derive(StableAbi))]
pub struct Instance {
    /// `sizeof(FleetyardInstance)`.
    pub struct_size: u32,
    /// Number of agents; at least 1.
    pub agents: u32,
    /// The environment of the last successful `prepare`, borrowed for the call.
    pub environment: *const Environment,
    /// `agents` cells.
    pub starts: *const u32,
    /// `agents` headings, one of `FLEETYARD_HEADING_*`; null when headings do
    /// not matter.
    pub headings: *const i32,
    /// `agents + 1` offsets into `goals`; the goals of agent `i` are those from
    /// `goal_offsets[i]` up to but not including `goal_offsets[i + 1]`, to be
    /// visited in order. Every agent has at least one.
    pub goal_offsets: *const u64,
    /// Cells.
    pub goals: *const u32,
    /// One of `FLEETYARD_MOTION_*`.
    pub motion: i32,
    /// One of `FLEETYARD_OBJECTIVE_*`.
    pub objective: i32,
    /// Collisions after this many steps do not matter, and paths may end before
    /// their goals; 0 for a complete plan.
    pub window_steps: u32,
    /// Non-zero where three or more agents may move round in a ring in one step,
    /// each into the cell that the next one leaves. Plans for a fleet must not:
    /// there nobody enters a cell before it is empty.
    pub allows_cycles: i32,
    /// Radius of the largest robot's enclosing circle.
    pub radius_m: f64,
    /// Number of assignments; 0 in calls of planners and fail policies.
    pub assignments_count: u32,
    /// Zero.
    pub reserved: u32,
    /// `assignments_count` tasks that the generator gives to agents: the host
    /// appends the cells of a task to the goals of its agent. May be null when
    /// there are none.
    pub assignments: *const Assignment,
}

/// Paths on a grid: the cells of agent `i` at times 0, 1, 2, … are those from
/// `offsets[i]` up to but not including `offsets[i + 1]`. After its last cell an
/// agent stays there.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout", derive(StableAbi))]
pub struct Plan {
    /// `sizeof(FleetyardPlan)`.
    pub struct_size: u32,
    /// Number of agents; must equal that of the instance.
    pub agents: u32,
    /// `agents + 1` offsets into `cells`, beginning with 0, never decreasing.
    pub offsets: *const u64,
    /// Cells.
    pub cells: *const u32,
}

/// The state of the fleet when everything committed has been executed, and the work that is left:
/// the input of an instance generator.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout", derive(StableAbi))]
pub struct FleetState {
    /// `sizeof(FleetyardFleetState)`.
    pub struct_size: u32,
    /// Number of agents.
    pub agents: u32,
    /// The environment of the last successful `prepare`, borrowed for the call.
    pub environment: *const Environment,
    /// Simulated time since the run began.
    pub time_s: f64,
    /// `agents` cells at the end of what is committed.
    pub cells: *const u32,
    /// `agents` headings there; null when headings do not matter.
    pub headings: *const i32,
    /// `agents + 1` offsets into `goals`.
    pub goal_offsets: *const u64,
    /// Goals that agents have been given and have not reached, in order: the first
    /// is current. Where goals never end, as many as it takes to keep the agent
    /// busy for longer than the window, and at least two.
    pub goals: *const u32,
    /// Number of open tasks: released and given to nobody.
    pub tasks: u32,
    /// Planning window asked for in steps; 0 for none. The next instance may have a
    /// shorter one.
    pub window_steps: u32,
    /// `tasks` identifiers.
    pub task_ids: *const u64,
    /// `tasks + 1` offsets into `task_cells`.
    pub task_offsets: *const u64,
    /// The cells that a task visits, in order.
    pub task_cells: *const u32,
    /// One of `FLEETYARD_MOTION_*`, which the next instance must repeat.
    pub motion: i32,
    /// One of `FLEETYARD_OBJECTIVE_*`, which the next instance must repeat.
    pub objective: i32,
    /// Radius of the largest robot's enclosing circle, which the next instance must repeat.
    pub radius_m: f64,
    /// As `FleetyardInstance::allows_cycles`; the next instance must repeat it.
    pub allows_cycles: i32,
    /// Zero.
    pub reserved: u32,
}

/// The status of the fleet: the input of an invocation policy.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout", derive(StableAbi))]
pub struct FleetStatus {
    /// `sizeof(FleetyardFleetStatus)`.
    pub struct_size: u32,
    /// Number of agents.
    pub agents: u32,
    /// Simulated time since the run began.
    pub time_s: f64,
    /// Simulated time since the planner was last called.
    pub since_last_call_s: f64,
    /// Limit of the planner's time: its answer to a call now takes effect so much later.
    pub planning_limit_s: f64,
    /// The least time that an action of a robot takes.
    pub action_s: f64,
    /// `agents` counts of committed actions that are not yet executed.
    pub actions_left: *const u32,
}

/// Receives what a plugin has to say. Given to a call, valid until it returns.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout", derive(StableAbi))]
pub struct Sink {
    /// `sizeof(FleetyardSink)`.
    pub struct_size: u32,
    /// Zero.
    pub reserved: u32,
    /// The host's; pass it back as it is.
    pub context: *mut c_void,
    /// `[thread-safe]` Hands over a plan, in calls that ask for one. May be
    /// called any number of times, each plan better than the last. Copies.
    /// Returns `FLEETYARD_OK` or `FLEETYARD_REJECTED`.
    pub submit_plan: Option<unsafe extern "C" fn(context: *mut c_void, plan: *const Plan) -> i32>,
    /// `[thread-safe]` Hands over the next instance, in `generate`. Its
    /// environment may be null. Copies. Returns as `submit_plan`.
    pub submit_instance:
        Option<unsafe extern "C" fn(context: *mut c_void, instance: *const Instance) -> i32>,
    /// `[thread-safe]` Reports a figure such as `expansions`, kept as a claim. Some names have
    /// a meaning and a domain (`docs/protocol.md`): another value breaks the contract.
    pub metric: Option<unsafe extern "C" fn(context: *mut c_void, name: Str, value: f64)>,
    /// `[thread-safe]` Writes to the run's log; `level` is `FLEETYARD_LOG_*`.
    pub log: Option<unsafe extern "C" fn(context: *mut c_void, level: i32, text: Str)>,
    /// `[thread-safe]` Says how much of the work is done; `total` 0 if unknown.
    pub progress: Option<unsafe extern "C" fn(context: *mut c_void, done: u64, total: u64)>,
    /// `[thread-safe]` Non-zero when the call should end: the deadline has
    /// passed or the host gave up on it. Cheap; ask often.
    pub cancelled: Option<unsafe extern "C" fn(context: *mut c_void) -> i32>,
    /// `[thread-safe]` Explains the status that the call is about to return.
    pub fail: Option<unsafe extern "C" fn(context: *mut c_void, message: Str)>,
}

/// Services of the host for the plugin. Valid from `init` to `deinit`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout", derive(StableAbi))]
pub struct Host {
    /// `sizeof(FleetyardHost)`.
    pub struct_size: u32,
    /// The host's `FLEETYARD_ABI_MAJOR`.
    pub abi_major: u16,
    /// The host's `FLEETYARD_ABI_MINOR`.
    pub abi_minor: u16,
    /// The host's name.
    pub name: Str,
    /// The host's version.
    pub version: Str,
    /// `[thread-safe]` An extension structure by its identifier
    /// (`fleetyard.NAME/REVISION`; third parties begin with a reversed domain
    /// name), or null.
    pub get_extension: Option<unsafe extern "C" fn(id: Str) -> *const c_void>,
}

/// Identity and capabilities of a plugin. Static: valid until `deinit`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout", derive(StableAbi))]
pub struct Descriptor {
    /// `sizeof(FleetyardDescriptor)`.
    pub struct_size: u32,
    /// Zero.
    pub reserved: u32,
    /// Short identifier, `[a-z0-9][a-z0-9._-]*`, unique in the library per kind.
    pub id: Str,
    /// Human-readable name.
    pub name: Str,
    /// Version of the plugin.
    pub version: Str,
    /// One paragraph, the paper cited.
    pub description: Str,
    /// SPDX licence expression; may be empty.
    pub license: Str,
    /// JSON Schema of the options object; empty when there are none.
    pub options_schema: Str,
    /// Or of `FLEETYARD_CAPABILITY_*`.
    pub capabilities: u64,
}

/// A planner.
///
/// Life: `create`, then `prepare` once per map, then `plan` any number of times,
/// then `destroy`. All calls into one object come from one thread at a time.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout", derive(StableAbi))]
pub struct Planner {
    /// `sizeof(FleetyardPlanner)`.
    pub struct_size: u32,
    /// Zero.
    pub reserved: u32,
    /// The plugin's; passed back as it is.
    pub context: *mut c_void,
    /// `[main-thread]` Learns a map, within a budget of its own. Returns a
    /// `FLEETYARD_STATUS_*`, `SOLVED` for success.
    pub prepare: Option<
        unsafe extern "C" fn(
            context: *mut c_void,
            environment: *const Environment,
            budget: *const Budget,
            sink: *const Sink,
        ) -> i32,
    >,
    /// `[main-thread]`, after `prepare`. Solves an instance and submits plans to
    /// the sink. Returns a `FLEETYARD_STATUS_*`.
    pub plan: Option<
        unsafe extern "C" fn(
            context: *mut c_void,
            instance: *const Instance,
            budget: *const Budget,
            sink: *const Sink,
        ) -> i32,
    >,
    /// `[main-thread]` Ends the object.
    pub destroy: Option<unsafe extern "C" fn(context: *mut c_void)>,
    /// `[main-thread]` An extension structure by its identifier, or null. May be
    /// null itself.
    pub get_extension: Option<unsafe extern "C" fn(context: *mut c_void, id: Str) -> *const c_void>,
}

/// A fail policy: gets the fleet moving again when the planner has failed.
///
/// Life: as a planner's, with `recover` in place of `plan`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout", derive(StableAbi))]
pub struct FailPolicy {
    /// `sizeof(FleetyardFailPolicy)`.
    pub struct_size: u32,
    /// Zero.
    pub reserved: u32,
    /// The plugin's; passed back as it is.
    pub context: *mut c_void,
    /// `[main-thread]` As `FleetyardPlanner::prepare`.
    pub prepare: Option<
        unsafe extern "C" fn(
            context: *mut c_void,
            environment: *const Environment,
            budget: *const Budget,
            sink: *const Sink,
        ) -> i32,
    >,
    /// `[main-thread]`, after `prepare`. Submits a collision-free plan.
    /// `failed_plan` is what the planner left, collisions and all; may be null.
    pub recover: Option<
        unsafe extern "C" fn(
            context: *mut c_void,
            instance: *const Instance,
            failed_plan: *const Plan,
            budget: *const Budget,
            sink: *const Sink,
        ) -> i32,
    >,
    /// `[main-thread]` Ends the object.
    pub destroy: Option<unsafe extern "C" fn(context: *mut c_void)>,
    /// `[main-thread]` As `FleetyardPlanner::get_extension`.
    pub get_extension: Option<unsafe extern "C" fn(context: *mut c_void, id: Str) -> *const c_void>,
}

/// An instance generator: decides what the planner is asked next.
///
/// Life: as a planner's, with `generate` in place of `plan`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout", derive(StableAbi))]
pub struct InstanceGenerator {
    /// `sizeof(FleetyardInstanceGenerator)`.
    pub struct_size: u32,
    /// Zero.
    pub reserved: u32,
    /// The plugin's; passed back as it is.
    pub context: *mut c_void,
    /// `[main-thread]` As `FleetyardPlanner::prepare`.
    pub prepare: Option<
        unsafe extern "C" fn(
            context: *mut c_void,
            environment: *const Environment,
            budget: *const Budget,
            sink: *const Sink,
        ) -> i32,
    >,
    /// `[main-thread]`, after `prepare`. Submits one instance.
    pub generate: Option<
        unsafe extern "C" fn(
            context: *mut c_void,
            state: *const FleetState,
            budget: *const Budget,
            sink: *const Sink,
        ) -> i32,
    >,
    /// `[main-thread]` Ends the object.
    pub destroy: Option<unsafe extern "C" fn(context: *mut c_void)>,
    /// `[main-thread]` As `FleetyardPlanner::get_extension`.
    pub get_extension: Option<unsafe extern "C" fn(context: *mut c_void, id: Str) -> *const c_void>,
}

/// An invocation policy: decides when the planner is called.
///
/// Life: `create`, then `should_invoke` any number of times, then `destroy`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout", derive(StableAbi))]
pub struct InvocationPolicy {
    /// `sizeof(FleetyardInvocationPolicy)`.
    pub struct_size: u32,
    /// Zero.
    pub reserved: u32,
    /// The plugin's; passed back as it is.
    pub context: *mut c_void,
    /// `[main-thread]` `FLEETYARD_INVOKE_NOW`, `FLEETYARD_INVOKE_NOT_YET`, or
    /// a negative number after a call of `FleetyardSink::fail`.
    pub should_invoke: Option<
        unsafe extern "C" fn(
            context: *mut c_void,
            status: *const FleetStatus,
            sink: *const Sink,
        ) -> i32,
    >,
    /// `[main-thread]` Ends the object.
    pub destroy: Option<unsafe extern "C" fn(context: *mut c_void)>,
    /// `[main-thread]` As `FleetyardPlanner::get_extension`.
    pub get_extension: Option<unsafe extern "C" fn(context: *mut c_void, id: Str) -> *const c_void>,
}

/// Makes planners.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout", derive(StableAbi))]
pub struct PlannerFactory {
    /// `sizeof(FleetyardPlannerFactory)`.
    pub struct_size: u32,
    /// Zero.
    pub reserved: u32,
    /// `[thread-safe]` How many planners the library has.
    pub count: Option<unsafe extern "C" fn() -> u32>,
    /// `[thread-safe]` Describes planner `index`; null when out of range.
    pub descriptor: Option<unsafe extern "C" fn(index: u32) -> *const Descriptor>,
    /// `[main-thread]` Makes planner `index` from its options (a JSON object)
    /// and fills in `out`. Returns a `FLEETYARD_STATUS_*`, `SOLVED` for success.
    pub create: Option<
        unsafe extern "C" fn(index: u32, options: Str, sink: *const Sink, out: *mut Planner) -> i32,
    >,
}

/// Makes fail policies; as `FleetyardPlannerFactory`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout", derive(StableAbi))]
pub struct FailPolicyFactory {
    /// `sizeof(FleetyardFailPolicyFactory)`.
    pub struct_size: u32,
    /// Zero.
    pub reserved: u32,
    /// `[thread-safe]` As `FleetyardPlannerFactory::count`.
    pub count: Option<unsafe extern "C" fn() -> u32>,
    /// `[thread-safe]` As `FleetyardPlannerFactory::descriptor`.
    pub descriptor: Option<unsafe extern "C" fn(index: u32) -> *const Descriptor>,
    /// `[main-thread]` As `FleetyardPlannerFactory::create`.
    pub create: Option<
        unsafe extern "C" fn(
            index: u32,
            options: Str,
            sink: *const Sink,
            out: *mut FailPolicy,
        ) -> i32,
    >,
}

/// Makes instance generators; as `FleetyardPlannerFactory`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout", derive(StableAbi))]
pub struct InstanceGeneratorFactory {
    /// `sizeof(FleetyardInstanceGeneratorFactory)`.
    pub struct_size: u32,
    /// Zero.
    pub reserved: u32,
    /// `[thread-safe]` As `FleetyardPlannerFactory::count`.
    pub count: Option<unsafe extern "C" fn() -> u32>,
    /// `[thread-safe]` As `FleetyardPlannerFactory::descriptor`.
    pub descriptor: Option<unsafe extern "C" fn(index: u32) -> *const Descriptor>,
    /// `[main-thread]` As `FleetyardPlannerFactory::create`.
    pub create: Option<
        unsafe extern "C" fn(
            index: u32,
            options: Str,
            sink: *const Sink,
            out: *mut InstanceGenerator,
        ) -> i32,
    >,
}

/// Makes invocation policies; as `FleetyardPlannerFactory`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout", derive(StableAbi))]
pub struct InvocationPolicyFactory {
    /// `sizeof(FleetyardInvocationPolicyFactory)`.
    pub struct_size: u32,
    /// Zero.
    pub reserved: u32,
    /// `[thread-safe]` As `FleetyardPlannerFactory::count`.
    pub count: Option<unsafe extern "C" fn() -> u32>,
    /// `[thread-safe]` As `FleetyardPlannerFactory::descriptor`.
    pub descriptor: Option<unsafe extern "C" fn(index: u32) -> *const Descriptor>,
    /// `[main-thread]` As `FleetyardPlannerFactory::create`.
    pub create: Option<
        unsafe extern "C" fn(
            index: u32,
            options: Str,
            sink: *const Sink,
            out: *mut InvocationPolicy,
        ) -> i32,
    >,
}

/// The one symbol that a library exports, named `fleetyard_plugin_entry_v1`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout", derive(StableAbi))]
pub struct PluginEntry {
    /// `sizeof(FleetyardPluginEntry)`.
    pub struct_size: u32,
    /// `FLEETYARD_ABI_MAJOR` of the header that the plugin was built with.
    pub abi_major: u16,
    /// `FLEETYARD_ABI_MINOR` of the header that the plugin was built with.
    pub abi_minor: u16,
    /// `[main-thread]` Called once before anything else; `path` is the library's
    /// own. Returns `FLEETYARD_OK` or a negative number. May be null.
    pub init: Option<unsafe extern "C" fn(host: *const Host, path: Str) -> i32>,
    /// `[main-thread]` Called once, after everything was destroyed. May be null.
    pub deinit: Option<unsafe extern "C" fn()>,
    /// `[thread-safe]` The factory with this identifier, or null.
    pub get_factory: Option<unsafe extern "C" fn(id: Str) -> *const c_void>,
}

// SAFETY: descriptors, factories and the entry are read-only tables of static
// data and functions once they are built.
unsafe impl Sync for PluginEntry {}
// SAFETY: as above.
unsafe impl Sync for Descriptor {}
// SAFETY: as above; the pointers of a descriptor point to static text.
unsafe impl Send for Descriptor {}

impl Str {
    /// Borrows a Rust string. The result must not outlive it.
    pub const fn new(text: &str) -> Self {
        Self {
            ptr: text.as_ptr(),
            len: text.len(),
        }
    }
}
