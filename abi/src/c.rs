//! The C ABI: every type and constant of `fleetyard.h`, which is generated from
//! this file.
//!
//! The rules, so that a structure can stay frozen once it is released
//! (`docs/contract.md` says what may be added later, and how):
//!
//! - Nothing changes owner. An environment and all it points to stay as they are from a successful
//!   `prepare` until the next `prepare` or `destroy`; other inputs are borrowed for the duration of
//!   the call; outputs go to the host's [`Sink`], which copies before it returns.
//! - Data grows by [`Part`]s, functions grow by `get_extension`. `struct_size` is `sizeof` the
//!   structure of the writer: a reader takes one that is at least as long as it knows, and reads no
//!   further.
//! - No `bool` and no `enum` crosses: `int32_t` and named constants do. No constant that means
//!   something is 0, so that a structure of zeros is refused rather than guessed at; a flag's 0 is
//!   the default.
//! - A reader answers `UNSUPPORTED` to a code, flag, representation or critical part that it does
//!   not know, and `INVALID_INPUT` to what no version allows. Reserved fields are 0, and anything
//!   else is refused.
//! - Large arrays are flat with offsets: `n + 1` offsets and one value array.
//! - Times are nanoseconds (`_ns`, `uint64_t`) or seconds (`_s`, `double`) on the
//!   clock that the name says; lengths are metres (`_m`), angles radians (`_rad`). Whole numbers
//!   stay below 2^53, so that JSON carries them.
//! - A pointer that may be null says so; every other pointer is not null.
//!
//! Thread tags: `[one-at-a-time]` calls into one object never overlap, but may come from different
//! threads; `[any-thread]` may be called from any thread while the call that received it has not
//! returned.

use std::ffi::{c_char, c_void};

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

/// Identifier of a part, a `FleetyardTraffic`, of instances and states.
pub const TRAFFIC_ID: &str = "fleetyard.traffic/1";
/// Identifier of a part, a `FleetyardRestOfPlan`, of instances and states.
pub const REST_OF_PLAN_ID: &str = "fleetyard.rest-of-plan/1";
/// Identifier of a part, a `FleetyardGoalTasks`, of instances and states.
pub const GOAL_TASKS_ID: &str = "fleetyard.goal-tasks/1";
/// Identifier of a part, a `FleetyardGuidance`, of instances and states.
pub const GUIDANCE_ID: &str = "fleetyard.guidance/1";
/// The factor of guidance that changes nothing.
pub const GUIDANCE_NEUTRAL: u16 = 100;
/// The least factor of guidance.
pub const GUIDANCE_LEAST: u16 = 10;
/// The greatest factor of guidance.
pub const GUIDANCE_MOST: u16 = 10_000;
/// Identifier of a part, a `FleetyardBytes`, of instances and states: what the plugin kept last.
pub const KEPT_ID: &str = "fleetyard.kept/1";
/// Identifier of an extension of the sink, a `FleetyardKeep`.
pub const KEEP_ID: &str = "fleetyard.keep/1";
/// Most bytes that a plugin may keep.
pub const KEPT_LIMIT: u64 = 1 << 20;

/// `FleetyardSink::get_extension` identifier of `FleetyardAnnotations`.
pub const ANNOTATIONS_ID: &str = "fleetyard.annotations/1";

/// `get_extension` identifier of `FleetyardLeftovers`, of planners, fail policies and instance
/// generators.
pub const LEFTOVERS_ID: &str = "fleetyard.leftovers/1";

/// Success, for functions that return a result code.
pub const OK: i32 = 0;
/// The submitted data are malformed: the call is lost.
pub const REJECTED: i32 = -1;
/// The submission came after the deadline, or after the host gave up on the call.
pub const TOO_LATE: i32 = -2;
/// There is no room for what was submitted at the moment; nothing is wrong.
pub const BUSY: i32 = -3;

/// The plan that was submitted solves the instance.
pub const STATUS_SOLVED: i32 = 0;
/// The instance has no solution, and the planner proved it.
pub const STATUS_INFEASIBLE: i32 = 1;
/// The time of the budget ran out.
pub const STATUS_TIMED_OUT: i32 = 2;
/// The planner stopped trying without a proof: a limit of nodes or memory was reached, or nothing
/// was left to try.
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
pub const REPRESENTATION_GRID: i32 = 1;
/// A graph embedded in the plane, continuous time.
pub const REPRESENTATION_ROADMAP: i32 = 2;
/// Free space itself, continuous time.
pub const REPRESENTATION_CONTINUOUS: i32 = 3;

/// A robot moves to an adjacent cell or waits, each in one step.
pub const MOTION_PEBBLE: i32 = 1;
/// As a pebble, but turning by 90 degrees takes a step.
pub const MOTION_ROTATION: i32 = 2;
/// A robot moves in straight lines between the cells of its path, which need not be
/// adjacent; a path is a place after the other, without times.
pub const MOTION_ANY_ANGLE: i32 = 3;
/// A robot on a roadmap drives an edge at the roadmap's speed, or stands on a vertex.
pub const MOTION_STOP_GO: i32 = 4;
/// A robot on a roadmap drives an edge at any uniform speed up to the roadmap's, or stands on a
/// vertex.
pub const MOTION_SLOWER: i32 = 5;
/// A robot in the plane moves as its `FleetyardRobot` says.
pub const MOTION_DYNAMICS: i32 = 6;

/// Minimise the sum over agents of the last time of arrival at the goal.
pub const OBJECTIVE_SUM_OF_COSTS: i32 = 1;
/// Minimise the time at which the last agent arrives.
pub const OBJECTIVE_MAKESPAN: i32 = 2;
/// Form of a plan: `FleetyardCells`, a cell per step.
pub const FORM_CELLS: i32 = 1;
/// Form of a plan: `FleetyardVisits`, vertices with times.
pub const FORM_VISITS: i32 = 2;
/// Form of a plan: `FleetyardTrajectories`, knots or controls in the plane.
pub const FORM_TRAJECTORIES: i32 = 3;
/// Shape of an annotation: points in the plane.
pub const SHAPE_POINTS: i32 = 1;
/// Shape of an annotation: lines from point to point.
pub const SHAPE_LINES: i32 = 2;
/// Shape of an annotation: lines from point to point, and back to the first.
pub const SHAPE_RINGS: i32 = 3;
/// Shape of an annotation: places, and lines from place to place.
pub const SHAPE_PLACES: i32 = 4;
/// No cell, vertex or agent.
pub const NONE: u32 = u32::MAX;

/// Heading of a robot on a grid: towards larger columns. In the plane, heading_rad is -pi/2 times
/// the code: rows grow down, y grows up.
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
/// Capability: grids with one-way moves, whose `moves` say less than `passable` does. A plugin
/// without it is given grids on which both agree.
pub const CAPABILITY_MOVE_MASK: u64 = 1 << 4;
/// Capability: the pebble motion model.
pub const CAPABILITY_PEBBLE: u64 = 1 << 8;
/// Capability: the rotation motion model.
pub const CAPABILITY_ROTATION: u64 = 1 << 9;
/// Capability: the any-angle motion model.
pub const CAPABILITY_ANY_ANGLE: u64 = 1 << 10;
/// Capability: the stop-go motion model of roadmaps.
pub const CAPABILITY_STOP_GO: u64 = 1 << 11;
/// Capability: the slower motion model of roadmaps.
pub const CAPABILITY_SLOWER: u64 = 1 << 12;
/// Capability: robots of the plane whose speeds have limits; the models are in
/// `FleetyardDescriptor::features`.
pub const CAPABILITY_DYNAMICS: u64 = 1 << 13;
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

/// Capability: agents without a goal, which may end anywhere.
pub const CAPABILITY_IDLE: u64 = 1 << 23;
/// Capability: robots of different footprints or dynamics in one team.
pub const CAPABILITY_HETEROGENEOUS: u64 = 1 << 24;

/// Bit of `FleetyardGrid::moves`: towards smaller rows. The bits are in the order of the letters
/// of moves, `NESWnesw`.
pub const MOVE_NORTH: u8 = 1 << 0;
/// Bit of `FleetyardGrid::moves`: towards larger columns.
pub const MOVE_EAST: u8 = 1 << 1;
/// Bit of `FleetyardGrid::moves`: towards larger rows.
pub const MOVE_SOUTH: u8 = 1 << 2;
/// Bit of `FleetyardGrid::moves`: towards smaller columns.
pub const MOVE_WEST: u8 = 1 << 3;
/// Bit of `FleetyardGrid::moves`: north and east in one move.
pub const MOVE_NORTH_EAST: u8 = 1 << 4;
/// Bit of `FleetyardGrid::moves`: south and east in one move.
pub const MOVE_SOUTH_EAST: u8 = 1 << 5;
/// Bit of `FleetyardGrid::moves`: south and west in one move.
pub const MOVE_SOUTH_WEST: u8 = 1 << 6;
/// Bit of `FleetyardGrid::moves`: north and west in one move.
pub const MOVE_NORTH_WEST: u8 = 1 << 7;

/// Flag of `FleetyardRoadmap`: each edge can be driven both ways.
pub const ROADMAP_SYMMETRIC: u32 = 1 << 0;
/// Flag of `FleetyardRobot`: a state has a heading after x and y.
pub const ROBOT_HEADING: u32 = 1 << 0;
/// Flag of `FleetyardRobot`: the largest of the first two rates of a state bounds their length.
pub const ROBOT_POLAR_STATE: u32 = 1 << 1;
/// Flag of `FleetyardRobot`: the largest of the first two numbers of a control bounds their length.
pub const ROBOT_POLAR_CONTROL: u32 = 1 << 2;
/// Flag of `FleetyardInstance`: three or more agents may move round in a ring in one step, each
/// into the cell that the next one leaves. In plans for a fleet nobody enters a cell before it is
/// empty.
pub const INSTANCE_CYCLES: u32 = 1 << 0;
/// Flag of `FleetyardInstance`: no agent follows another one round a corner, because robots of
/// `radius_m` would touch there.
pub const INSTANCE_STRICT: u32 = 1 << 1;
/// Flag of `FleetyardPart`: a reader that does not know the part answers `UNSUPPORTED`.
pub const PART_CRITICAL: u32 = 1 << 0;
/// Flag of `FleetyardPart`: `data` is a `FleetyardJson`, whatever the identifier.
pub const PART_JSON: u32 = 1 << 1;

/// Type of an option: `number` has it.
pub const OPTION_NUMBER: i32 = 1;
/// Type of an option: `text` has it.
pub const OPTION_TEXT: i32 = 2;
/// Type of an option: `number` is 0 or 1.
pub const OPTION_FLAG: i32 = 3;
/// Type of an option: `text` is a JSON object, a list or null.
pub const OPTION_JSON: i32 = 4;

/// Log level: something failed.
pub const LOG_ERROR: i32 = 1;
/// Log level: something is odd.
pub const LOG_WARNING: i32 = 2;
/// Log level: worth knowing once per run.
pub const LOG_INFO: i32 = 3;
/// Log level: for the plugin's author.
pub const LOG_DEBUG: i32 = 4;

/// UTF-8 text, not terminated by a zero byte.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout", derive(StableAbi))]
pub struct Str {
    /// First byte; may be null when `len` is 0.
    pub ptr: *const c_char,
    /// Length in bytes.
    pub len: usize,
}

/// A structure with a name: the one way in which data grows. It is frozen under its identifier, and
/// another revision is another identifier.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout", derive(StableAbi))]
pub struct Part {
    /// `fleetyard.NAME/REVISION`; third parties begin with a reversed domain name.
    pub id: Str,
    /// The structure, which begins with its `uint32_t struct_size`; with `FLEETYARD_PART_JSON` a
    /// `FleetyardJson`, which is how the host hands on what it does not know itself.
    pub data: *const c_void,
    /// Or of `FLEETYARD_PART_*`.
    pub flags: u32,
    /// Zero.
    pub reserved: u32,
}

/// Parts of an input or an output. A reader passes over those that it does not know, unless they
/// are critical.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout", derive(StableAbi))]
pub struct Parts {
    /// `count` parts; may be null when there are none.
    pub list: *const Part,
    /// Number of parts.
    pub count: u64,
}

/// A part as JSON.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout", derive(StableAbi))]
pub struct Json {
    /// `sizeof(FleetyardJson)`.
    pub struct_size: u32,
    /// Zero.
    pub reserved: u32,
    /// A JSON value.
    pub text: Str,
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
    /// When the call must have returned, on the clock of `FleetyardSink::now_ns`.
    pub deadline_monotonic_ns: u64,
    /// When to come to an end, so that the answer arrives before the deadline, on the same clock:
    /// from here on `FleetyardSink::cancelled` says so.
    pub answer_by_ns: u64,
    /// Length of the budget when the call began.
    pub wall_ns: u64,
    /// Most search nodes to expand; 0 for no limit.
    pub nodes: u64,
    /// Most memory to use in bytes; 0 for no limit.
    pub memory_bytes: u64,
    /// Seed of every random choice.
    pub seed: u64,
    /// None yet.
    pub parts: Parts,
}

/// The grid representation: row 0 is the top, column 0 the left, and the cell at `(row, col)`
/// has the index `row * cols + col`.
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
    /// The lower left corner of the lower left cell: x, to the right.
    pub origin_x_m: f64,
    /// The lower left corner of the lower left cell: y, upwards.
    pub origin_y_m: f64,
    /// `rows * cols` bytes: 1 where a robot may stand, else 0.
    pub passable: *const u8,
    /// `rows * cols` terrain letters as in the map file (`e` endpoint, `w`
    /// workstation, …).
    pub terrain: *const u8,
    /// `rows * cols` masks of `FLEETYARD_MOVE_*`, complete: a bit is set only where the move is
    /// allowed, borders and corners seen to. Waiting is allowed wherever a robot may stand.
    pub moves: *const u8,
}

/// The body of a robot or a mover, about its origin.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout", derive(StableAbi))]
pub struct Footprint {
    /// `sizeof(FleetyardFootprint)`.
    pub struct_size: u32,
    /// Number of corners of a convex polygon; 0 for a disc.
    pub corners: u32,
    /// Radius of the disc; of a polygon, that of the smallest circle about the origin that
    /// encloses it.
    pub radius_m: f64,
    /// x of the corners, counter-clockwise; may be null for a disc.
    pub x_m: *const f64,
    /// y of the corners; may be null for a disc.
    pub y_m: *const f64,
}

/// An obstacle that moves in a known way.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout", derive(StableAbi))]
pub struct Mover {
    /// `sizeof(FleetyardMover)`.
    pub struct_size: u32,
    /// Number of knots, at least 1: it moves linearly between them and rests before the first and
    /// after the last.
    pub knots: u32,
    /// Its body.
    pub footprint: *const Footprint,
    /// `knots` times, ascending.
    pub time_s: *const f64,
    /// `knots` positions.
    pub x_m: *const f64,
    /// `knots` positions.
    pub y_m: *const f64,
    /// `knots` headings, counter-clockwise and unwrapped.
    pub heading_rad: *const f64,
}

/// The continuous representation: free space is the bounds without the obstacles. x goes right, y
/// up.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout", derive(StableAbi))]
pub struct Workspace {
    /// `sizeof(FleetyardWorkspace)`.
    pub struct_size: u32,
    /// Number of obstacles that stand.
    pub obstacles: u32,
    /// Bounds. A world with another outline has obstacles that fill the rest.
    pub min_x_m: f64,
    /// Bounds.
    pub min_y_m: f64,
    /// Bounds.
    pub max_x_m: f64,
    /// Bounds.
    pub max_y_m: f64,
    /// `obstacles + 1` offsets into the corners.
    pub corner_offsets: *const u64,
    /// x of the corners of simple polygons, counter-clockwise.
    pub x_m: *const f64,
    /// y of the corners.
    pub y_m: *const f64,
    /// `mover_count` movers; may be null when there are none.
    pub movers: *const *const Mover,
    /// Number of movers.
    pub mover_count: u64,
}

/// The roadmap representation: a graph whose vertices lie in the plane, and whose edges are
/// driven straight.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout", derive(StableAbi))]
pub struct Roadmap {
    /// `sizeof(FleetyardRoadmap)`.
    pub struct_size: u32,
    /// Number of vertices.
    pub vertices: u32,
    /// Number of directed edges.
    pub edges: u64,
    /// `vertices` positions.
    pub x_m: *const f64,
    /// `vertices` positions.
    pub y_m: *const f64,
    /// `vertices + 1` offsets into the edges: those from a vertex.
    pub edge_offsets: *const u64,
    /// The vertex at the end of each edge, ascending for each vertex.
    pub targets: *const u32,
    /// The length of each edge.
    pub length_m: *const f64,
    /// The time that each edge takes at full speed.
    pub duration_s: *const f64,
    /// Full speed.
    pub speed_m_per_s: f64,
    /// The least distance of two robots' centres at any time: the diameter of the largest
    /// robot's enclosing circle.
    pub separation_m: f64,
    /// The world in which the roadmap lies, for those who want to look; may be null.
    pub workspace: *const Workspace,
    /// Or of `FLEETYARD_ROADMAP_*`.
    pub flags: u32,
    /// Zero.
    pub reserved: u32,
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
    /// `FleetyardGrid`, `FleetyardRoadmap` or `FleetyardWorkspace`.
    pub view: *const c_void,
    /// The map's name, for messages.
    pub name: Str,
    /// A key for caches: equal digests, equal views. Empty when the host has none.
    pub digest: Str,
    /// None yet.
    pub parts: Parts,
}

/// A model of robots.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout", derive(StableAbi))]
pub struct Robot {
    /// `sizeof(FleetyardRobot)`.
    pub struct_size: u32,
    /// Or of `FLEETYARD_ROBOT_*`.
    pub flags: u32,
    /// Its name, for messages.
    pub name: Str,
    /// Name of its dynamics, such as `fleetyard.double-integrator/1`: it fixes what follows `x, y`
    /// and, with `FLEETYARD_ROBOT_HEADING`, the heading in a state, what a control is, and the
    /// parameters (`docs/contract.md`).
    pub dynamics: Str,
    /// Its body.
    pub footprint: *const Footprint,
    /// Numbers of a state.
    pub state_size: u32,
    /// Numbers of a control.
    pub control_size: u32,
    /// Number of parameters.
    pub parameter_count: u32,
    /// Zero.
    pub reserved: u32,
    /// `state_size` numbers, infinite where there is no limit.
    pub state_min: *const f64,
    /// `state_size` numbers, infinite where there is no limit.
    pub state_max: *const f64,
    /// `control_size` numbers, infinite where there is no limit.
    pub control_min: *const f64,
    /// `control_size` numbers, infinite where there is no limit.
    pub control_max: *const f64,
    /// `parameter_count` numbers.
    pub parameters: *const f64,
}

/// An instance: the input of a planner. A *place* is a cell of a grid or a vertex of a roadmap.
/// Agent `i` is the same robot in all calls of a run.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout", derive(StableAbi))]
pub struct Instance {
    /// `sizeof(FleetyardInstance)`.
    pub struct_size: u32,
    /// Number of agents; at least 1.
    pub agents: u32,
    /// The environment of the last successful `prepare`.
    pub environment: *const Environment,
    /// `robot_count` models.
    pub robots: *const *const Robot,
    /// `agents` numbers of models; null when there is one model at most.
    pub robot_of: *const u32,
    /// Number of models; may be 0 on grids and roadmaps.
    pub robot_count: u32,
    /// One of `FLEETYARD_MOTION_*`.
    pub motion: i32,
    /// One of `FLEETYARD_OBJECTIVE_*`.
    pub objective: i32,
    /// Or of `FLEETYARD_INSTANCE_*`.
    pub flags: u32,
    /// `agents` places; null in the plane.
    pub starts: *const u32,
    /// `agents` headings, one of `FLEETYARD_HEADING_*`; null when headings do
    /// not matter.
    pub start_headings: *const i8,
    /// `agents + 1` offsets into `start_states`; null but in the plane.
    pub start_state_offsets: *const u64,
    /// The state of each agent at its start, as its robot says; null but in the plane.
    pub start_states: *const f64,
    /// `agents + 1` offsets into the goals; the goals of agent `i` are those from
    /// `goal_offsets[i]` up to but not including `goal_offsets[i + 1]`, to be
    /// visited in order. An agent without one may end anywhere.
    pub goal_offsets: *const u64,
    /// Places; null in the plane.
    pub goals: *const u32,
    /// An offset into `goal_states` for each goal, and one more; null but in the plane.
    pub goal_state_offsets: *const u64,
    /// The state to come to at each goal, as the robot says, NaN where any will do; null but in the
    /// plane.
    pub goal_states: *const f64,
    /// On grids: collisions after this many steps do not matter, and paths may end before
    /// their goals; 0 for a complete plan.
    pub window_steps: u32,
    /// Zero.
    pub reserved: u32,
    /// The same in the other representations; 0 for a complete plan.
    pub window_s: f64,
    /// Radius of the largest robot's enclosing circle.
    pub radius_m: f64,
    /// In the plane: distance from its goal at which a robot may end.
    pub goal_tolerance_m: f64,
    /// In the plane: the same of its heading.
    pub goal_tolerance_rad: f64,
    /// In the plane: the same of each further number of its state, where controls say it.
    pub goal_tolerance_rate: f64,
    /// In the plane: how far controls may lead beside the knots of the same plan, in metres and in
    /// radians.
    pub dynamics_tolerance: f64,
    /// See `FLEETYARD_TRAFFIC_ID` and those after it.
    pub parts: Parts,
}

/// A plan. What is in it says `form`; the entries of agent `i` are those from `offsets[i]` up to
/// but not including `offsets[i + 1]`. After its last entry an agent stays where it is.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout", derive(StableAbi))]
pub struct Plan {
    /// `sizeof(FleetyardPlan)`.
    pub struct_size: u32,
    /// Number of agents; must equal that of the instance.
    pub agents: u32,
    /// One of `FLEETYARD_FORM_*`: cells on a grid, visits on a roadmap, trajectories in the plane.
    pub form: i32,
    /// Zero.
    pub reserved: u32,
    /// `agents + 1` offsets into the entries of `body`, beginning with 0, never decreasing.
    pub offsets: *const u64,
    /// `FleetyardCells`, `FleetyardVisits` or `FleetyardTrajectories`.
    pub body: *const c_void,
    /// None yet.
    pub parts: Parts,
}

/// The body of a plan on a grid: the cell of an agent at times 0, 1, 2, … steps.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout", derive(StableAbi))]
pub struct Cells {
    /// `sizeof(FleetyardCells)`.
    pub struct_size: u32,
    /// Zero.
    pub reserved: u32,
    /// Cells.
    pub cells: *const u32,
}

/// The body of a plan on a roadmap: the vertices that an agent visits. It drives straight and
/// evenly from one to the next, and is at the first one from time 0.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout", derive(StableAbi))]
pub struct Visits {
    /// `sizeof(FleetyardVisits)`.
    pub struct_size: u32,
    /// Zero.
    pub reserved: u32,
    /// Vertices.
    pub vertices: *const u32,
    /// When the agent arrives.
    pub arrival_s: *const f64,
    /// When it leaves; of the last visit, no earlier than the arrival.
    pub departure_s: *const f64,
}

/// The body of a plan in the plane: knots, controls, or both.
///
/// Between knots position and heading are linear in time; the first is at time 0. Controls lead from
/// the state at the start, each held for its duration, one after the other; the host works out where.
/// An agent with both moves by its knots, to which its controls have to lead within
/// `FleetyardInstance::dynamics_tolerance`. One that has neither, in a plan with controls, stays at
/// its start.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout", derive(StableAbi))]
pub struct Trajectories {
    /// `sizeof(FleetyardTrajectories)`.
    pub struct_size: u32,
    /// Zero.
    pub reserved: u32,
    /// Times, ascending for each agent; as x and y null when there are no knots.
    pub time_s: *const f64,
    /// Positions.
    pub x_m: *const f64,
    /// Positions.
    pub y_m: *const f64,
    /// Headings, counter-clockwise and unwrapped; NaN where a robot has none, null when none has
    /// one.
    pub heading_rad: *const f64,
    /// `agents + 1` offsets into `duration_s`; null when there are no controls.
    pub segment_offsets: *const u64,
    /// The time that each control is held, above 0.
    pub duration_s: *const f64,
    /// `agents + 1` offsets into `controls`: an agent has as many numbers for each of its durations
    /// as a control of its robot has. Null when there are no controls.
    pub control_offsets: *const u64,
    /// The controls, number after number.
    pub controls: *const f64,
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

/// The state of the fleet when everything committed has been executed, and the work that is left:
/// the input of an instance generator.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout", derive(StableAbi))]
pub struct FleetState {
    /// `sizeof(FleetyardFleetState)`.
    pub struct_size: u32,
    /// Number of open tasks: released and given to nobody.
    pub tasks: u32,
    /// Simulated time since the run began.
    pub time_s: f64,
    /// The next instance as it is if nobody is given more. Its goals are those that agents have been
    /// given and have not reached, in order: the first is current. Where goals never end, they are
    /// as many as it takes to keep the agent busy for longer than the window, and at least two. Its
    /// window is the one asked for.
    pub next: *const Instance,
    /// `tasks` identifiers.
    pub task_ids: *const u64,
    /// `tasks + 1` offsets into `task_places`.
    pub task_offsets: *const u64,
    /// The places that a task visits, in order.
    pub task_places: *const u32,
    /// `tasks` times at which tasks were released.
    pub task_released_s: *const f64,
    /// See `FLEETYARD_TRAFFIC_ID` and those after it.
    pub parts: Parts,
}

/// The decision of an instance generator, and nothing else: the rest of the next instance is as
/// `FleetyardFleetState::next` has it.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout", derive(StableAbi))]
pub struct Request {
    /// `sizeof(FleetyardRequest)`.
    pub struct_size: u32,
    /// Number of agents; must equal that of the state.
    pub agents: u32,
    /// `agents + 1` offsets into `goals`.
    pub goal_offsets: *const u64,
    /// The places that the planner is asked to visit.
    pub goals: *const u32,
    /// `assignment_count` tasks that are given to agents: the host appends the places of a task to
    /// the goals of its agent. May be null when there are none.
    pub assignments: *const Assignment,
    /// Number of assignments.
    pub assignment_count: u64,
    /// The window of the next instance on a grid, no longer than the one asked for.
    pub window_steps: u32,
    /// Zero.
    pub reserved: u32,
    /// The same in the other representations.
    pub window_s: f64,
    /// None yet.
    pub parts: Parts,
}

/// Averages at a moment. Everything is 0 in the first one, which is taken when a run begins.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout", derive(StableAbi))]
pub struct Snapshot {
    /// `sizeof(FleetyardSnapshot)`.
    pub struct_size: u32,
    /// Zero.
    pub reserved: u32,
    /// Number of snapshots before it: a key for caches.
    pub number: u64,
    /// Per place, the share of time in which somebody stood there whose goal is elsewhere, in units
    /// of 1/255.
    pub waiting: *const u8,
    /// Per move, the flow in units of `FleetyardTraffic::flow_unit_per_s`: on a grid the moves from
    /// cell 0 in the order of the bits of `FleetyardGrid::moves`, 4 or 8 of them, then those from
    /// cell 1; on a roadmap its edges.
    pub flow: *const u8,
}

/// Part of instances and states: averages of where robots wait, and which way they go. Like the
/// other parts of this kind, the host hands it to plugins alone that list it in their features.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout", derive(StableAbi))]
pub struct Traffic {
    /// `sizeof(FleetyardTraffic)`.
    pub struct_size: u32,
    /// Number of places of the map.
    pub places: u32,
    /// Number of flows: cells by neighbours on a grid, edges on a roadmap.
    pub flows: u64,
    /// Simulated time from a snapshot to the next.
    pub period_s: f64,
    /// Time constant of the exponential averages.
    pub time_constant_s: f64,
    /// Simulated time since the last snapshot was taken.
    pub since_s: f64,
    /// A flow of 1 stands for so many moves per second.
    pub flow_unit_per_s: f64,
    /// The last snapshot.
    pub last: *const Snapshot,
    /// The one before; the same as long as there is only one.
    pub before: *const Snapshot,
}

/// Part of instances and states: what of the last plan nobody is committed to.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout", derive(StableAbi))]
pub struct RestOfPlan {
    /// `sizeof(FleetyardRestOfPlan)`.
    pub struct_size: u32,
    /// Number of agents.
    pub agents: u32,
    /// `agents + 1` offsets into `moves`.
    pub offsets: *const u64,
    /// A letter of `NESWnesw` per step of an agent from its start on, `.` for a wait.
    pub moves: *const u8,
}

/// Part of instances and states: the tasks that goals belong to, and since when agents have them.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout", derive(StableAbi))]
pub struct GoalTasks {
    /// `sizeof(FleetyardGoalTasks)`.
    pub struct_size: u32,
    /// Zero.
    pub reserved: u32,
    /// Number of goals: those of the instance, in their order.
    pub goals: u64,
    /// Simulated time since the run began.
    pub time_s: f64,
    /// The task of each goal; `UINT64_MAX` for one that is of no task, or not the agent's own.
    pub tasks: *const u64,
    /// The number of each goal among the task's places; `FLEETYARD_NONE` as above.
    pub errands: *const u32,
    /// When the task of each goal was released; for other goals as `given_s`.
    pub released_s: *const f64,
    /// When the task of each goal was given to the agent. A goal without a task is given when the
    /// one before it is reached; `time_s` if that is still to come.
    pub given_s: *const f64,
}

/// Part of instances and states: a guidance graph, factors on what moves and waits cost. Where it is
/// cheap robots are to go, where it is dear they are not, and every way stays allowed.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout", derive(StableAbi))]
pub struct Guidance {
    /// `sizeof(FleetyardGuidance)`.
    pub struct_size: u32,
    /// Number of places of the map.
    pub places: u32,
    /// Number of moves: cells by neighbours on a grid, edges on a roadmap.
    pub move_count: u64,
    /// Per move, in the order of `FleetyardSnapshot::flow`, the factor of its cost in units of
    /// 1 / `FLEETYARD_GUIDANCE_NEUTRAL`, from `FLEETYARD_GUIDANCE_LEAST` to
    /// `FLEETYARD_GUIDANCE_MOST`. Moves that the map does not have have one as well.
    pub moves: *const u16,
    /// The same per place, for a wait there.
    pub waits: *const u16,
}

/// Bytes of a plugin's own.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout", derive(StableAbi))]
pub struct Bytes {
    /// `sizeof(FleetyardBytes)`.
    pub struct_size: u32,
    /// Zero.
    pub reserved: u32,
    /// `len` bytes; may be null when there are none.
    pub ptr: *const u8,
    /// Their number, at most `FLEETYARD_KEPT_LIMIT`.
    pub len: u64,
}

/// Extension of the sink in `plan`, `recover` and `generate`: the host keeps bytes for the plugin.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout", derive(StableAbi))]
pub struct Keep {
    /// `sizeof(FleetyardKeep)`.
    pub struct_size: u32,
    /// Zero.
    pub reserved: u32,
    /// `[any-thread]` Keeps bytes in place of those before; the next call has them as the part
    /// `FLEETYARD_KEPT_ID`, if the plugin lists that in its features. The last ones of a call count,
    /// and only if it ends well and in time. Copies. Returns as `FleetyardSink::submit_plan`.
    pub keep: Option<unsafe extern "C" fn(sink_context: *mut c_void, bytes: *const Bytes) -> i32>,
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
    /// None yet.
    pub parts: Parts,
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
    /// `[any-thread]` Hands over a plan, in calls that ask for one. May be
    /// called any number of times, each plan better than the last. Copies.
    /// Returns `FLEETYARD_OK`, `FLEETYARD_REJECTED`, `FLEETYARD_TOO_LATE` or `FLEETYARD_BUSY`.
    pub submit_plan: Option<unsafe extern "C" fn(context: *mut c_void, plan: *const Plan) -> i32>,
    /// `[any-thread]` Hands over what a generator decided, in `generate`. Copies. Returns as
    /// `submit_plan`.
    pub submit_request:
        Option<unsafe extern "C" fn(context: *mut c_void, request: *const Request) -> i32>,
    /// `[any-thread]` Non-zero when the call should end: `FleetyardBudget::answer_by_ns` has
    /// passed or the host gave up on it. Cheap; ask often.
    pub cancelled: Option<unsafe extern "C" fn(context: *mut c_void) -> i32>,
    /// `[any-thread]` The host's monotonic clock.
    pub now_ns: Option<unsafe extern "C" fn(context: *mut c_void) -> u64>,
    /// `[any-thread]` Explains the status that the call is about to return; the last explanation
    /// counts.
    pub fail: Option<unsafe extern "C" fn(context: *mut c_void, message: Str)>,
    /// `[any-thread]` Writes to the run's log; `level` is `FLEETYARD_LOG_*`.
    pub log: Option<unsafe extern "C" fn(context: *mut c_void, level: i32, text: Str)>,
    /// `[any-thread]` Reports a figure such as `expansions`, kept as a claim. Some names have
    /// a meaning and a domain (`docs/protocol.md`): another value breaks the contract.
    pub metric: Option<unsafe extern "C" fn(context: *mut c_void, name: Str, value: f64)>,
    /// `[any-thread]` Notes a fact about the plugin's inputs, such as the digest of its weights;
    /// kept as a claim.
    pub note: Option<unsafe extern "C" fn(context: *mut c_void, name: Str, text: Str)>,
    /// `[any-thread]` Says how much of the work is done; `total` 0 if unknown.
    pub progress: Option<unsafe extern "C" fn(context: *mut c_void, done: u64, total: u64)>,
    /// `[any-thread]` An extension structure of this call by its identifier
    /// (`fleetyard.NAME/REVISION`), or null when the host has no use for it. Its functions take
    /// the sink's context.
    pub get_extension: Option<unsafe extern "C" fn(context: *mut c_void, id: Str) -> *const c_void>,
}

/// Something that a planner wants to show, such as a constraint, a conflict or a tree: shapes of a
/// layer. It is shown and never judged. An annotation has at most 32,768 shapes and as many points
/// or places together.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout", derive(StableAbi))]
pub struct Annotation {
    /// `sizeof(FleetyardAnnotation)`.
    pub struct_size: u32,
    /// One of `FLEETYARD_SHAPE_*`.
    pub shape: i32,
    /// Name of the layer, 1 to 64 bytes without control characters: what is shown or hidden
    /// together.
    pub layer: Str,
    /// For people, at most 1024 bytes; may be empty.
    pub text: Str,
    /// The agent that it is about, or `FLEETYARD_NONE`.
    pub agent: u32,
    /// Number of shapes.
    pub count: u32,
    /// When it begins to hold, in seconds of the plan, from 0.
    pub from_s: f64,
    /// When it ends; infinite where it does not.
    pub to_s: f64,
    /// `count + 1` offsets of the shapes into the points or places.
    pub offsets: *const u64,
    /// x of the points; may be null for places.
    pub x_m: *const f64,
    /// y of the points; may be null for places.
    pub y_m: *const f64,
    /// Cells or vertices; null but for places.
    pub places: *const u32,
    /// `count` numbers, one for each shape, for colours; may be null.
    pub values: *const f64,
}

/// Extension of the sink of `plan` and `recover`, null unless somebody wants to see annotations.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout", derive(StableAbi))]
pub struct Annotations {
    /// `sizeof(FleetyardAnnotations)`.
    pub struct_size: u32,
    /// Zero.
    pub reserved: u32,
    /// `[any-thread]` Hands over an annotation, with the sink's context. Copies. Returns as
    /// `submit_plan`: `FLEETYARD_BUSY` when the host keeps no more of them, which may be ignored.
    pub annotate:
        Option<unsafe extern "C" fn(context: *mut c_void, annotation: *const Annotation) -> i32>,
}

/// Extension of a planner, a fail policy or an instance generator: memory that a call leaves to be
/// freed when it has been answered, so that it is answered sooner.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout", derive(StableAbi))]
pub struct Leftovers {
    /// `sizeof(FleetyardLeftovers)`.
    pub struct_size: u32,
    /// Zero.
    pub reserved: u32,
    /// `[one-at-a-time]`, with the object's context. Non-zero if there is some. Cheap: asked after
    /// every call, on its thread.
    pub any: Option<unsafe extern "C" fn(context: *mut c_void) -> i32>,
    /// `[one-at-a-time]`, with the object's context. Frees it, on the thread of the call that left
    /// it, when that has been answered. Where a host does not ask, the plugin frees it in its next
    /// call or with the object.
    pub free: Option<unsafe extern "C" fn(context: *mut c_void)>,
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
    /// The host's; pass it back as it is.
    pub context: *mut c_void,
    /// The host's name.
    pub name: Str,
    /// The host's version.
    pub version: Str,
    /// `[any-thread]` An extension structure by its identifier
    /// (`fleetyard.NAME/REVISION`; third parties begin with a reversed domain
    /// name), or null.
    pub get_extension: Option<unsafe extern "C" fn(context: *mut c_void, id: Str) -> *const c_void>,
}

/// An option of a plugin.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout", derive(StableAbi))]
pub struct PluginOption {
    /// Its name.
    pub name: Str,
    /// Its value, where `kind` says so.
    pub text: Str,
    /// Its value, where `kind` says so.
    pub number: f64,
    /// One of `FLEETYARD_OPTION_*`.
    pub kind: i32,
    /// Zero.
    pub reserved: u32,
}

/// The options of a plugin. The host has checked them against the plugin's schema, and filled in
/// the defaults of the schema.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout", derive(StableAbi))]
pub struct Options {
    /// `sizeof(FleetyardOptions)`.
    pub struct_size: u32,
    /// Number of options.
    pub count: u32,
    /// `count` options; may be null when there are none.
    pub list: *const PluginOption,
    /// The same as the text of a JSON object.
    pub json: Str,
}

/// Identity and capabilities of a plugin. Static: valid until `deinit`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout", derive(StableAbi))]
pub struct Descriptor {
    /// `sizeof(FleetyardDescriptor)`.
    pub struct_size: u32,
    /// Number of features.
    pub feature_count: u32,
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
    /// `feature_count` names of what has no bit: `dynamics:NAME` for each model of robots that
    /// it plans for, `part:ID` for each part that it reads; and two limits: `agents:N` if it plans
    /// for no more than N agents, `for:measuring` if it is there to measure hosts. May be null when
    /// there are none.
    pub features: *const Str,
}

/// A planner.
///
/// Life: `create`, then `prepare` once per map, then `plan` any number of times, then `destroy`.
/// A `prepare` that fails leaves the object without a map.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout", derive(StableAbi))]
pub struct Planner {
    /// `sizeof(FleetyardPlanner)`: before `create` the room that the host has, afterwards what the
    /// plugin filled in.
    pub struct_size: u32,
    /// Zero.
    pub reserved: u32,
    /// The plugin's; passed back as it is.
    pub context: *mut c_void,
    /// `[one-at-a-time]` Learns a map, within a budget of its own. Returns a
    /// `FLEETYARD_STATUS_*`, `SOLVED` for success.
    pub prepare: Option<
        unsafe extern "C" fn(
            context: *mut c_void,
            environment: *const Environment,
            budget: *const Budget,
            sink: *const Sink,
        ) -> i32,
    >,
    /// `[one-at-a-time]`, after `prepare`. Solves an instance and submits plans to
    /// the sink. Returns a `FLEETYARD_STATUS_*`.
    pub plan: Option<
        unsafe extern "C" fn(
            context: *mut c_void,
            instance: *const Instance,
            budget: *const Budget,
            sink: *const Sink,
        ) -> i32,
    >,
    /// `[one-at-a-time]` Ends the object.
    pub destroy: Option<unsafe extern "C" fn(context: *mut c_void)>,
    /// `[one-at-a-time]` An extension structure by its identifier, or null. May be
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
    /// `sizeof(FleetyardFailPolicy)`: before `create` the room that the host has, afterwards what the
    /// plugin filled in.
    pub struct_size: u32,
    /// Zero.
    pub reserved: u32,
    /// The plugin's; passed back as it is.
    pub context: *mut c_void,
    /// `[one-at-a-time]` As `FleetyardPlanner::prepare`.
    pub prepare: Option<
        unsafe extern "C" fn(
            context: *mut c_void,
            environment: *const Environment,
            budget: *const Budget,
            sink: *const Sink,
        ) -> i32,
    >,
    /// `[one-at-a-time]`, after `prepare`. Submits a collision-free plan.
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
    /// `[one-at-a-time]` Ends the object.
    pub destroy: Option<unsafe extern "C" fn(context: *mut c_void)>,
    /// `[one-at-a-time]` As `FleetyardPlanner::get_extension`.
    pub get_extension: Option<unsafe extern "C" fn(context: *mut c_void, id: Str) -> *const c_void>,
}

/// An instance generator: decides what the planner is asked next.
///
/// Life: as a planner's, with `generate` in place of `plan`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout", derive(StableAbi))]
pub struct InstanceGenerator {
    /// `sizeof(FleetyardInstanceGenerator)`: before `create` the room that the host has, afterwards what the
    /// plugin filled in.
    pub struct_size: u32,
    /// Zero.
    pub reserved: u32,
    /// The plugin's; passed back as it is.
    pub context: *mut c_void,
    /// `[one-at-a-time]` As `FleetyardPlanner::prepare`.
    pub prepare: Option<
        unsafe extern "C" fn(
            context: *mut c_void,
            environment: *const Environment,
            budget: *const Budget,
            sink: *const Sink,
        ) -> i32,
    >,
    /// `[one-at-a-time]`, after `prepare`. Submits one instance.
    pub generate: Option<
        unsafe extern "C" fn(
            context: *mut c_void,
            state: *const FleetState,
            budget: *const Budget,
            sink: *const Sink,
        ) -> i32,
    >,
    /// `[one-at-a-time]` Ends the object.
    pub destroy: Option<unsafe extern "C" fn(context: *mut c_void)>,
    /// `[one-at-a-time]` As `FleetyardPlanner::get_extension`.
    pub get_extension: Option<unsafe extern "C" fn(context: *mut c_void, id: Str) -> *const c_void>,
}

/// An invocation policy: decides when the planner is called.
///
/// Life: `create`, then `should_invoke` any number of times, then `destroy`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout", derive(StableAbi))]
pub struct InvocationPolicy {
    /// `sizeof(FleetyardInvocationPolicy)`: before `create` the room that the host has, afterwards what the
    /// plugin filled in.
    pub struct_size: u32,
    /// Zero.
    pub reserved: u32,
    /// The plugin's; passed back as it is.
    pub context: *mut c_void,
    /// `[one-at-a-time]` Writes 1 to `out` if the planner has to be called now, else 0. Returns a
    /// `FLEETYARD_STATUS_*`, `SOLVED` for success.
    pub should_invoke: Option<
        unsafe extern "C" fn(
            context: *mut c_void,
            status: *const FleetStatus,
            sink: *const Sink,
            out: *mut i32,
        ) -> i32,
    >,
    /// `[one-at-a-time]` Ends the object.
    pub destroy: Option<unsafe extern "C" fn(context: *mut c_void)>,
    /// `[one-at-a-time]` As `FleetyardPlanner::get_extension`.
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
    /// The plugin's; passed back as it is. May be null.
    pub context: *mut c_void,
    /// `[any-thread]` How many planners the library has.
    pub count: Option<unsafe extern "C" fn(context: *mut c_void) -> u32>,
    /// `[any-thread]` Describes planner `index`; null when out of range.
    pub descriptor:
        Option<unsafe extern "C" fn(context: *mut c_void, index: u32) -> *const Descriptor>,
    /// `[one-at-a-time]` Makes planner `index` from its options and fills in `out`, whose
    /// `struct_size` says how much room there is: with too little it writes nothing and returns
    /// `UNSUPPORTED`. Returns a `FLEETYARD_STATUS_*`, `SOLVED` for success.
    pub create: Option<
        unsafe extern "C" fn(
            context: *mut c_void,
            index: u32,
            options: *const Options,
            sink: *const Sink,
            out: *mut Planner,
        ) -> i32,
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
    /// The plugin's; passed back as it is. May be null.
    pub context: *mut c_void,
    /// `[any-thread]` As `FleetyardPlannerFactory::count`.
    pub count: Option<unsafe extern "C" fn(context: *mut c_void) -> u32>,
    /// `[any-thread]` As `FleetyardPlannerFactory::descriptor`.
    pub descriptor:
        Option<unsafe extern "C" fn(context: *mut c_void, index: u32) -> *const Descriptor>,
    /// `[one-at-a-time]` As `FleetyardPlannerFactory::create`.
    pub create: Option<
        unsafe extern "C" fn(
            context: *mut c_void,
            index: u32,
            options: *const Options,
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
    /// The plugin's; passed back as it is. May be null.
    pub context: *mut c_void,
    /// `[any-thread]` As `FleetyardPlannerFactory::count`.
    pub count: Option<unsafe extern "C" fn(context: *mut c_void) -> u32>,
    /// `[any-thread]` As `FleetyardPlannerFactory::descriptor`.
    pub descriptor:
        Option<unsafe extern "C" fn(context: *mut c_void, index: u32) -> *const Descriptor>,
    /// `[one-at-a-time]` As `FleetyardPlannerFactory::create`.
    pub create: Option<
        unsafe extern "C" fn(
            context: *mut c_void,
            index: u32,
            options: *const Options,
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
    /// The plugin's; passed back as it is. May be null.
    pub context: *mut c_void,
    /// `[any-thread]` As `FleetyardPlannerFactory::count`.
    pub count: Option<unsafe extern "C" fn(context: *mut c_void) -> u32>,
    /// `[any-thread]` As `FleetyardPlannerFactory::descriptor`.
    pub descriptor:
        Option<unsafe extern "C" fn(context: *mut c_void, index: u32) -> *const Descriptor>,
    /// `[one-at-a-time]` As `FleetyardPlannerFactory::create`.
    pub create: Option<
        unsafe extern "C" fn(
            context: *mut c_void,
            index: u32,
            options: *const Options,
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
    /// `[one-at-a-time]` Called once before anything else; `path` is the library's
    /// own. Returns `FLEETYARD_OK` or a negative number. May be null.
    pub init: Option<unsafe extern "C" fn(host: *const Host, path: Str) -> i32>,
    /// `[one-at-a-time]` Called once, after everything was destroyed. May be null.
    pub deinit: Option<unsafe extern "C" fn()>,
    /// `[any-thread]` The factory with this identifier, or null.
    pub get_factory: Option<unsafe extern "C" fn(id: Str) -> *const c_void>,
}

// SAFETY: descriptors, factories and the entry are read-only tables of static
// data and functions once they are built.
unsafe impl Sync for PluginEntry {}
// SAFETY: as above.
unsafe impl Sync for Descriptor {}
// SAFETY: as above; the pointers of a descriptor point to static text.
unsafe impl Send for Descriptor {}
// SAFETY: as above.
unsafe impl Sync for PlannerFactory {}
// SAFETY: as above.
unsafe impl Sync for FailPolicyFactory {}
// SAFETY: as above.
unsafe impl Sync for InstanceGeneratorFactory {}
// SAFETY: as above.
unsafe impl Sync for InvocationPolicyFactory {}

impl Str {
    /// Borrows a Rust string. The result must not outlive it.
    pub const fn new(text: &str) -> Self {
        Self {
            ptr: text.as_ptr().cast(),
            len: text.len(),
        }
    }
}

impl Parts {
    /// No parts.
    pub const NONE: Self = Self {
        list: std::ptr::null(),
        count: 0,
    };
}
