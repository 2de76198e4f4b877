/* The plugin contract of Fleetyard. MIT OR Apache-2.0.
 *
 * A plugin is a shared library that exports one symbol:
 *
 *     const FleetyardPluginEntry fleetyard_plugin_entry_v1 = { ... };
 *
 * Nothing changes owner. An environment stays as it is from a successful `prepare` until the next
 * `prepare` or `destroy`; other inputs are borrowed for the duration of the call. What a plugin has
 * to say goes to the host's sink, which copies before it returns. Each structure begins with its
 * own size, and may be longer than yours. No value that means something is 0. Answer UNSUPPORTED
 * to a code, flag or critical part that you do not know. Function pointers are never null unless
 * their comment says that they may be.
 *
 * [one-at-a-time]  calls into one object never overlap, but may come from different threads
 * [any-thread]     from any thread while the call that received it has not returned
 *
 * This file is generated from abi/src/c.rs.
 */

#ifndef FLEETYARD_H
#define FLEETYARD_H

#include <stddef.h>
#include <stdint.h>

/* Makes the one symbol of a library visible, whatever the compiler's flags are. */
#define FLEETYARD_EXPORT __attribute__((visibility("default")))

/* Identifiers for get_factory. */
#define FLEETYARD_PLANNER_FACTORY_ID "fleetyard.planner/1"
#define FLEETYARD_FAIL_POLICY_FACTORY_ID "fleetyard.fail-policy/1"
#define FLEETYARD_INSTANCE_GENERATOR_FACTORY_ID "fleetyard.instance-generator/1"
#define FLEETYARD_INVOCATION_POLICY_FACTORY_ID "fleetyard.invocation-policy/1"

/* Identifiers of parts: FleetyardTraffic, FleetyardRestOfPlan, FleetyardGoalTasks,
 * FleetyardGuidance, and a FleetyardBytes with what the plugin kept last. */
#define FLEETYARD_TRAFFIC_ID "fleetyard.traffic/1"
#define FLEETYARD_REST_OF_PLAN_ID "fleetyard.rest-of-plan/1"
#define FLEETYARD_GOAL_TASKS_ID "fleetyard.goal-tasks/1"
#define FLEETYARD_GUIDANCE_ID "fleetyard.guidance/1"
#define FLEETYARD_KEPT_ID "fleetyard.kept/1"

/* Identifiers for get_extension of a sink: FleetyardKeep, FleetyardAnnotations. */
#define FLEETYARD_KEEP_ID "fleetyard.keep/1"
#define FLEETYARD_ANNOTATIONS_ID "fleetyard.annotations/1"

/* Identifier for get_extension of a planner, fail policy or instance generator:
 * FleetyardLeftovers. */
#define FLEETYARD_LEFTOVERS_ID "fleetyard.leftovers/1"


/*
 Major version of the ABI; host and plugin agree only when it is equal.
 */
#define FLEETYARD_ABI_MAJOR 1

/*
 Minor version of the ABI; grows with additions that old plugins can ignore.
 */
#define FLEETYARD_ABI_MINOR 0

/*
 The factor of guidance that changes nothing.
 */
#define FLEETYARD_GUIDANCE_NEUTRAL 100

/*
 The least factor of guidance.
 */
#define FLEETYARD_GUIDANCE_LEAST 10

/*
 The greatest factor of guidance.
 */
#define FLEETYARD_GUIDANCE_MOST 10000

/*
 Most bytes that a plugin may keep.
 */
#define FLEETYARD_KEPT_LIMIT (1 << 20)

/*
 Success, for functions that return a result code.
 */
#define FLEETYARD_OK 0

/*
 The submitted data are malformed: the call is lost.
 */
#define FLEETYARD_REJECTED -1

/*
 The submission came after the deadline, or after the host gave up on the call.
 */
#define FLEETYARD_TOO_LATE -2

/*
 There is no room for what was submitted at the moment; nothing is wrong.
 */
#define FLEETYARD_BUSY -3

/*
 The plan that was submitted solves the instance.
 */
#define FLEETYARD_STATUS_SOLVED 0

/*
 The instance has no solution, and the planner proved it.
 */
#define FLEETYARD_STATUS_INFEASIBLE 1

/*
 The time of the budget ran out.
 */
#define FLEETYARD_STATUS_TIMED_OUT 2

/*
 The planner stopped trying without a proof: a limit of nodes or memory was reached, or nothing
 was left to try.
 */
#define FLEETYARD_STATUS_GAVE_UP 3

/*
 The planner stopped before the deadline because `cancelled` returned non-zero.
 */
#define FLEETYARD_STATUS_CANCELLED 4

/*
 The planner cannot handle this kind of instance, map or option.
 */
#define FLEETYARD_STATUS_UNSUPPORTED 5

/*
 The input contradicts itself.
 */
#define FLEETYARD_STATUS_INVALID_INPUT 6

/*
 The plugin failed; `FleetyardSink::fail` says why.
 */
#define FLEETYARD_STATUS_INTERNAL_ERROR 7

/*
 Cells of a grid, unit time steps.
 */
#define FLEETYARD_REPRESENTATION_GRID 1

/*
 A graph embedded in the plane, continuous time.
 */
#define FLEETYARD_REPRESENTATION_ROADMAP 2

/*
 Free space itself, continuous time.
 */
#define FLEETYARD_REPRESENTATION_CONTINUOUS 3

/*
 A robot moves to an adjacent cell or waits, each in one step.
 */
#define FLEETYARD_MOTION_PEBBLE 1

/*
 As a pebble, but turning by 90 degrees takes a step.
 */
#define FLEETYARD_MOTION_ROTATION 2

/*
 A robot moves in straight lines between the cells of its path, which need not be
 adjacent; a path is a place after the other, without times.
 */
#define FLEETYARD_MOTION_ANY_ANGLE 3

/*
 A robot on a roadmap drives an edge at the roadmap's speed, or stands on a vertex.
 */
#define FLEETYARD_MOTION_STOP_GO 4

/*
 A robot on a roadmap drives an edge at any uniform speed up to the roadmap's, or stands on a
 vertex.
 */
#define FLEETYARD_MOTION_SLOWER 5

/*
 A robot in the plane moves as its `FleetyardRobot` says.
 */
#define FLEETYARD_MOTION_DYNAMICS 6

/*
 Minimise the sum over agents of the last time of arrival at the goal.
 */
#define FLEETYARD_OBJECTIVE_SUM_OF_COSTS 1

/*
 Minimise the time at which the last agent arrives.
 */
#define FLEETYARD_OBJECTIVE_MAKESPAN 2

/*
 Form of a plan: `FleetyardCells`, a cell per step.
 */
#define FLEETYARD_FORM_CELLS 1

/*
 Form of a plan: `FleetyardVisits`, vertices with times.
 */
#define FLEETYARD_FORM_VISITS 2

/*
 Form of a plan: `FleetyardTrajectories`, knots or controls in the plane.
 */
#define FLEETYARD_FORM_TRAJECTORIES 3

/*
 Shape of an annotation: points in the plane.
 */
#define FLEETYARD_SHAPE_POINTS 1

/*
 Shape of an annotation: lines from point to point.
 */
#define FLEETYARD_SHAPE_LINES 2

/*
 Shape of an annotation: lines from point to point, and back to the first.
 */
#define FLEETYARD_SHAPE_RINGS 3

/*
 Shape of an annotation: places, and lines from place to place.
 */
#define FLEETYARD_SHAPE_PLACES 4

/*
 No cell, vertex or agent.
 */
#define FLEETYARD_NONE UINT32_MAX

/*
 Heading of a robot on a grid: towards larger columns. In the plane, heading_rad is -pi/2 times
 the code: rows grow down, y grows up.
 */
#define FLEETYARD_HEADING_EAST 0

/*
 Heading of a robot on a grid: towards larger rows.
 */
#define FLEETYARD_HEADING_SOUTH 1

/*
 Heading of a robot on a grid: towards smaller columns.
 */
#define FLEETYARD_HEADING_WEST 2

/*
 Heading of a robot on a grid: towards smaller rows.
 */
#define FLEETYARD_HEADING_NORTH 3

/*
 Capability: plans on grids.
 */
#define FLEETYARD_CAPABILITY_GRID (1 << 0)

/*
 Capability: plans on roadmaps.
 */
#define FLEETYARD_CAPABILITY_ROADMAP (1 << 1)

/*
 Capability: plans in continuous space.
 */
#define FLEETYARD_CAPABILITY_CONTINUOUS (1 << 2)

/*
 Capability: grids with eight neighbours as well as four.
 */
#define FLEETYARD_CAPABILITY_EIGHT_CONNECTED (1 << 3)

/*
 Capability: grids with one-way moves, whose `moves` say less than `passable` does. A plugin
 without it is given grids on which both agree.
 */
#define FLEETYARD_CAPABILITY_MOVE_MASK (1 << 4)

/*
 Capability: the pebble motion model.
 */
#define FLEETYARD_CAPABILITY_PEBBLE (1 << 8)

/*
 Capability: the rotation motion model.
 */
#define FLEETYARD_CAPABILITY_ROTATION (1 << 9)

/*
 Capability: the any-angle motion model.
 */
#define FLEETYARD_CAPABILITY_ANY_ANGLE (1 << 10)

/*
 Capability: the stop-go motion model of roadmaps.
 */
#define FLEETYARD_CAPABILITY_STOP_GO (1 << 11)

/*
 Capability: the slower motion model of roadmaps.
 */
#define FLEETYARD_CAPABILITY_SLOWER (1 << 12)

/*
 Capability: robots of the plane whose speeds have limits; the models are in
 `FleetyardDescriptor::features`.
 */
#define FLEETYARD_CAPABILITY_DYNAMICS (1 << 13)

/*
 Capability: keeps submitting better plans until the budget ends.
 */
#define FLEETYARD_CAPABILITY_ANYTIME (1 << 16)

/*
 Capability: several goals per agent, planned up to `FleetyardInstance::window_steps`.
 */
#define FLEETYARD_CAPABILITY_WINDOWED (1 << 17)

/*
 Capability: goals that several agents share.
 */
#define FLEETYARD_CAPABILITY_DUPLICATE_GOALS (1 << 18)

/*
 Capability: may submit colliding paths when it fails, for a fail policy.
 */
#define FLEETYARD_CAPABILITY_COLLIDING_PLANS (1 << 19)

/*
 Capability: plans that tolerate k steps of delay (option `k`).
 */
#define FLEETYARD_CAPABILITY_K_ROBUST (1 << 20)

/*
 Capability: the same instance, options and seed give the same plan.
 */
#define FLEETYARD_CAPABILITY_DETERMINISTIC (1 << 21)

/*
 Capability: uses more than one thread when the budget allows it.
 */
#define FLEETYARD_CAPABILITY_THREADS (1 << 22)

/*
 Capability: agents without a goal, which may end anywhere.
 */
#define FLEETYARD_CAPABILITY_IDLE (1 << 23)

/*
 Capability: robots of different footprints or dynamics in one team.
 */
#define FLEETYARD_CAPABILITY_HETEROGENEOUS (1 << 24)

/*
 Bit of `FleetyardGrid::moves`: towards smaller rows. The bits are in the order of the letters
 of moves, `NESWnesw`.
 */
#define FLEETYARD_MOVE_NORTH (1 << 0)

/*
 Bit of `FleetyardGrid::moves`: towards larger columns.
 */
#define FLEETYARD_MOVE_EAST (1 << 1)

/*
 Bit of `FleetyardGrid::moves`: towards larger rows.
 */
#define FLEETYARD_MOVE_SOUTH (1 << 2)

/*
 Bit of `FleetyardGrid::moves`: towards smaller columns.
 */
#define FLEETYARD_MOVE_WEST (1 << 3)

/*
 Bit of `FleetyardGrid::moves`: north and east in one move.
 */
#define FLEETYARD_MOVE_NORTH_EAST (1 << 4)

/*
 Bit of `FleetyardGrid::moves`: south and east in one move.
 */
#define FLEETYARD_MOVE_SOUTH_EAST (1 << 5)

/*
 Bit of `FleetyardGrid::moves`: south and west in one move.
 */
#define FLEETYARD_MOVE_SOUTH_WEST (1 << 6)

/*
 Bit of `FleetyardGrid::moves`: north and west in one move.
 */
#define FLEETYARD_MOVE_NORTH_WEST (1 << 7)

/*
 Flag of `FleetyardRoadmap`: each edge can be driven both ways.
 */
#define FLEETYARD_ROADMAP_SYMMETRIC (1 << 0)

/*
 Flag of `FleetyardRobot`: a state has a heading after x and y.
 */
#define FLEETYARD_ROBOT_HEADING (1 << 0)

/*
 Flag of `FleetyardRobot`: the largest of the first two rates of a state bounds their length.
 */
#define FLEETYARD_ROBOT_POLAR_STATE (1 << 1)

/*
 Flag of `FleetyardRobot`: the largest of the first two numbers of a control bounds their length.
 */
#define FLEETYARD_ROBOT_POLAR_CONTROL (1 << 2)

/*
 Flag of `FleetyardInstance`: three or more agents may move round in a ring in one step, each
 into the cell that the next one leaves. In plans for a fleet nobody enters a cell before it is
 empty.
 */
#define FLEETYARD_INSTANCE_CYCLES (1 << 0)

/*
 Flag of `FleetyardInstance`: no agent follows another one round a corner, because robots of
 `radius_m` would touch there.
 */
#define FLEETYARD_INSTANCE_STRICT (1 << 1)

/*
 Flag of `FleetyardPart`: a reader that does not know the part answers `UNSUPPORTED`.
 */
#define FLEETYARD_PART_CRITICAL (1 << 0)

/*
 Flag of `FleetyardPart`: `data` is a `FleetyardJson`, whatever the identifier.
 */
#define FLEETYARD_PART_JSON (1 << 1)

/*
 Type of an option: `number` has it.
 */
#define FLEETYARD_OPTION_NUMBER 1

/*
 Type of an option: `text` has it.
 */
#define FLEETYARD_OPTION_TEXT 2

/*
 Type of an option: `number` is 0 or 1.
 */
#define FLEETYARD_OPTION_FLAG 3

/*
 Type of an option: `text` is a JSON object, a list or null.
 */
#define FLEETYARD_OPTION_JSON 4

/*
 Log level: something failed.
 */
#define FLEETYARD_LOG_ERROR 1

/*
 Log level: something is odd.
 */
#define FLEETYARD_LOG_WARNING 2

/*
 Log level: worth knowing once per run.
 */
#define FLEETYARD_LOG_INFO 3

/*
 Log level: for the plugin's author.
 */
#define FLEETYARD_LOG_DEBUG 4

/*
 UTF-8 text, not terminated by a zero byte.
 */
typedef struct FleetyardStr {
  /*
   First byte; may be null when `len` is 0.
   */
  const char *ptr;
  /*
   Length in bytes.
   */
  size_t len;
} FleetyardStr;

/*
 A structure with a name: the one way in which data grows. It is frozen under its identifier, and
 another revision is another identifier.
 */
typedef struct FleetyardPart {
  /*
   `fleetyard.NAME/REVISION`; third parties begin with a reversed domain name.
   */
  struct FleetyardStr id;
  /*
   The structure, which begins with its `uint32_t struct_size`; with `FLEETYARD_PART_JSON` a
   `FleetyardJson`, which is how the host hands on what it does not know itself.
   */
  const void *data;
  /*
   Or of `FLEETYARD_PART_*`.
   */
  uint32_t flags;
  /*
   Zero.
   */
  uint32_t reserved;
} FleetyardPart;

/*
 Parts of an input or an output. A reader passes over those that it does not know, unless they
 are critical.
 */
typedef struct FleetyardParts {
  /*
   `count` parts; may be null when there are none.
   */
  const struct FleetyardPart *list;
  /*
   Number of parts.
   */
  uint64_t count;
} FleetyardParts;

/*
 A part as JSON.
 */
typedef struct FleetyardJson {
  /*
   `sizeof(FleetyardJson)`.
   */
  uint32_t struct_size;
  /*
   Zero.
   */
  uint32_t reserved;
  /*
   A JSON value.
   */
  struct FleetyardStr text;
} FleetyardJson;

/*
 Limits of one call. The host enforces them; a planner that keeps them is not
 killed.
 */
typedef struct FleetyardBudget {
  /*
   `sizeof(FleetyardBudget)`.
   */
  uint32_t struct_size;
  /*
   Most threads to use at a time; at least 1.
   */
  uint32_t threads;
  /*
   When the call must have returned, on the clock of `FleetyardSink::now_ns`.
   */
  uint64_t deadline_monotonic_ns;
  /*
   When to come to an end, so that the answer arrives before the deadline, on the same clock:
   from here on `FleetyardSink::cancelled` says so.
   */
  uint64_t answer_by_ns;
  /*
   Length of the budget when the call began.
   */
  uint64_t wall_ns;
  /*
   Most search nodes to expand; 0 for no limit.
   */
  uint64_t nodes;
  /*
   Most memory to use in bytes; 0 for no limit.
   */
  uint64_t memory_bytes;
  /*
   Seed of every random choice.
   */
  uint64_t seed;
  /*
   None yet.
   */
  struct FleetyardParts parts;
} FleetyardBudget;

/*
 The grid representation: row 0 is the top, column 0 the left, and the cell at `(row, col)`
 has the index `row * cols + col`.
 */
typedef struct FleetyardGrid {
  /*
   `sizeof(FleetyardGrid)`.
   */
  uint32_t struct_size;
  /*
   Number of rows.
   */
  uint32_t rows;
  /*
   Number of columns.
   */
  uint32_t cols;
  /*
   4 or 8 neighbours. A diagonal move needs both shared orthogonal
   neighbours free.
   */
  uint32_t connectivity;
  /*
   Side of a cell.
   */
  double cell_size_m;
  /*
   Duration of one move or wait.
   */
  double step_s;
  /*
   The lower left corner of the lower left cell: x, to the right.
   */
  double origin_x_m;
  /*
   The lower left corner of the lower left cell: y, upwards.
   */
  double origin_y_m;
  /*
   `rows * cols` bytes: 1 where a robot may stand, else 0.
   */
  const uint8_t *passable;
  /*
   `rows * cols` terrain letters as in the map file (`e` endpoint, `w`
   workstation, …).
   */
  const uint8_t *terrain;
  /*
   `rows * cols` masks of `FLEETYARD_MOVE_*`, complete: a bit is set only where the move is
   allowed, borders and corners seen to. Waiting is allowed wherever a robot may stand.
   */
  const uint8_t *moves;
} FleetyardGrid;

/*
 The body of a robot or a mover, about its origin.
 */
typedef struct FleetyardFootprint {
  /*
   `sizeof(FleetyardFootprint)`.
   */
  uint32_t struct_size;
  /*
   Number of corners of a convex polygon; 0 for a disc.
   */
  uint32_t corners;
  /*
   Radius of the disc; of a polygon, that of the smallest circle about the origin that
   encloses it.
   */
  double radius_m;
  /*
   x of the corners, counter-clockwise; may be null for a disc.
   */
  const double *x_m;
  /*
   y of the corners; may be null for a disc.
   */
  const double *y_m;
} FleetyardFootprint;

/*
 An obstacle that moves in a known way.
 */
typedef struct FleetyardMover {
  /*
   `sizeof(FleetyardMover)`.
   */
  uint32_t struct_size;
  /*
   Number of knots, at least 1: it moves linearly between them and rests before the first and
   after the last.
   */
  uint32_t knots;
  /*
   Its body.
   */
  const struct FleetyardFootprint *footprint;
  /*
   `knots` times, ascending.
   */
  const double *time_s;
  /*
   `knots` positions.
   */
  const double *x_m;
  /*
   `knots` positions.
   */
  const double *y_m;
  /*
   `knots` headings, counter-clockwise and unwrapped.
   */
  const double *heading_rad;
} FleetyardMover;

/*
 The continuous representation: free space is the bounds without the obstacles. x goes right, y
 up.
 */
typedef struct FleetyardWorkspace {
  /*
   `sizeof(FleetyardWorkspace)`.
   */
  uint32_t struct_size;
  /*
   Number of obstacles that stand.
   */
  uint32_t obstacles;
  /*
   Bounds. A world with another outline has obstacles that fill the rest.
   */
  double min_x_m;
  /*
   Bounds.
   */
  double min_y_m;
  /*
   Bounds.
   */
  double max_x_m;
  /*
   Bounds.
   */
  double max_y_m;
  /*
   `obstacles + 1` offsets into the corners.
   */
  const uint64_t *corner_offsets;
  /*
   x of the corners of simple polygons, counter-clockwise.
   */
  const double *x_m;
  /*
   y of the corners.
   */
  const double *y_m;
  /*
   `mover_count` movers; may be null when there are none.
   */
  const struct FleetyardMover *const *movers;
  /*
   Number of movers.
   */
  uint64_t mover_count;
} FleetyardWorkspace;

/*
 The roadmap representation: a graph whose vertices lie in the plane, and whose edges are
 driven straight.
 */
typedef struct FleetyardRoadmap {
  /*
   `sizeof(FleetyardRoadmap)`.
   */
  uint32_t struct_size;
  /*
   Number of vertices.
   */
  uint32_t vertices;
  /*
   Number of directed edges.
   */
  uint64_t edges;
  /*
   `vertices` positions.
   */
  const double *x_m;
  /*
   `vertices` positions.
   */
  const double *y_m;
  /*
   `vertices + 1` offsets into the edges: those from a vertex.
   */
  const uint64_t *edge_offsets;
  /*
   The vertex at the end of each edge, ascending for each vertex.
   */
  const uint32_t *targets;
  /*
   The length of each edge.
   */
  const double *length_m;
  /*
   The time that each edge takes at full speed.
   */
  const double *duration_s;
  /*
   Full speed.
   */
  double speed_m_per_s;
  /*
   The least distance of two robots' centres at any time: the diameter of the largest
   robot's enclosing circle.
   */
  double separation_m;
  /*
   The world in which the roadmap lies, for those who want to look; may be null.
   */
  const struct FleetyardWorkspace *workspace;
  /*
   Or of `FLEETYARD_ROADMAP_*`.
   */
  uint32_t flags;
  /*
   Zero.
   */
  uint32_t reserved;
} FleetyardRoadmap;

/*
 The part of the input that stays the same between calls: the map.
 */
typedef struct FleetyardEnvironment {
  /*
   `sizeof(FleetyardEnvironment)`.
   */
  uint32_t struct_size;
  /*
   One of `FLEETYARD_REPRESENTATION_*`; says what `view` points to.
   */
  int32_t representation;
  /*
   `FleetyardGrid`, `FleetyardRoadmap` or `FleetyardWorkspace`.
   */
  const void *view;
  /*
   The map's name, for messages.
   */
  struct FleetyardStr name;
  /*
   A key for caches: equal digests, equal views. Empty when the host has none.
   */
  struct FleetyardStr digest;
  /*
   None yet.
   */
  struct FleetyardParts parts;
} FleetyardEnvironment;

/*
 A model of robots.
 */
typedef struct FleetyardRobot {
  /*
   `sizeof(FleetyardRobot)`.
   */
  uint32_t struct_size;
  /*
   Or of `FLEETYARD_ROBOT_*`.
   */
  uint32_t flags;
  /*
   Its name, for messages.
   */
  struct FleetyardStr name;
  /*
   Name of its dynamics, such as `fleetyard.double-integrator/1`: it fixes what follows `x, y`
   and, with `FLEETYARD_ROBOT_HEADING`, the heading in a state, what a control is, and the
   parameters (`docs/contract.md`).
   */
  struct FleetyardStr dynamics;
  /*
   Its body.
   */
  const struct FleetyardFootprint *footprint;
  /*
   Numbers of a state.
   */
  uint32_t state_size;
  /*
   Numbers of a control.
   */
  uint32_t control_size;
  /*
   Number of parameters.
   */
  uint32_t parameter_count;
  /*
   Zero.
   */
  uint32_t reserved;
  /*
   `state_size` numbers, infinite where there is no limit.
   */
  const double *state_min;
  /*
   `state_size` numbers, infinite where there is no limit.
   */
  const double *state_max;
  /*
   `control_size` numbers, infinite where there is no limit.
   */
  const double *control_min;
  /*
   `control_size` numbers, infinite where there is no limit.
   */
  const double *control_max;
  /*
   `parameter_count` numbers.
   */
  const double *parameters;
} FleetyardRobot;

/*
 An instance: the input of a planner. A *place* is a cell of a grid or a vertex of a roadmap.
 Agent `i` is the same robot in all calls of a run.
 */
typedef struct FleetyardInstance {
  /*
   `sizeof(FleetyardInstance)`.
   */
  uint32_t struct_size;
  /*
   Number of agents; at least 1.
   */
  uint32_t agents;
  /*
   The environment of the last successful `prepare`.
   */
  const struct FleetyardEnvironment *environment;
  /*
   `robot_count` models.
   */
  const struct FleetyardRobot *const *robots;
  /*
   `agents` numbers of models; null when there is one model at most.
   */
  const uint32_t *robot_of;
  /*
   Number of models; may be 0 on grids and roadmaps.
   */
  uint32_t robot_count;
  /*
   One of `FLEETYARD_MOTION_*`.
   */
  int32_t motion;
  /*
   One of `FLEETYARD_OBJECTIVE_*`.
   */
  int32_t objective;
  /*
   Or of `FLEETYARD_INSTANCE_*`.
   */
  uint32_t flags;
  /*
   `agents` places; null in the plane.
   */
  const uint32_t *starts;
  /*
   `agents` headings, one of `FLEETYARD_HEADING_*`; null when headings do
   not matter.
   */
  const int8_t *start_headings;
  /*
   `agents + 1` offsets into `start_states`; null but in the plane.
   */
  const uint64_t *start_state_offsets;
  /*
   The state of each agent at its start, as its robot says; null but in the plane.
   */
  const double *start_states;
  /*
   `agents + 1` offsets into the goals; the goals of agent `i` are those from
   `goal_offsets[i]` up to but not including `goal_offsets[i + 1]`, to be
   visited in order. An agent without one may end anywhere.
   */
  const uint64_t *goal_offsets;
  /*
   Places; null in the plane.
   */
  const uint32_t *goals;
  /*
   An offset into `goal_states` for each goal, and one more; null but in the plane.
   */
  const uint64_t *goal_state_offsets;
  /*
   The state to come to at each goal, as the robot says, NaN where any will do; null but in the
   plane.
   */
  const double *goal_states;
  /*
   On grids: collisions after this many steps do not matter, and paths may end before
   their goals; 0 for a complete plan.
   */
  uint32_t window_steps;
  /*
   Zero.
   */
  uint32_t reserved;
  /*
   The same in the other representations; 0 for a complete plan.
   */
  double window_s;
  /*
   Radius of the largest robot's enclosing circle.
   */
  double radius_m;
  /*
   In the plane: distance from its goal at which a robot may end.
   */
  double goal_tolerance_m;
  /*
   In the plane: the same of its heading.
   */
  double goal_tolerance_rad;
  /*
   In the plane: the same of each further number of its state, where controls say it.
   */
  double goal_tolerance_rate;
  /*
   In the plane: how far controls may lead beside the knots of the same plan, in metres and in
   radians.
   */
  double dynamics_tolerance;
  /*
   See `FLEETYARD_TRAFFIC_ID` and those after it.
   */
  struct FleetyardParts parts;
} FleetyardInstance;

/*
 A plan. What is in it says `form`; the entries of agent `i` are those from `offsets[i]` up to
 but not including `offsets[i + 1]`. After its last entry an agent stays where it is.
 */
typedef struct FleetyardPlan {
  /*
   `sizeof(FleetyardPlan)`.
   */
  uint32_t struct_size;
  /*
   Number of agents; must equal that of the instance.
   */
  uint32_t agents;
  /*
   One of `FLEETYARD_FORM_*`: cells on a grid, visits on a roadmap, trajectories in the plane.
   */
  int32_t form;
  /*
   Zero.
   */
  uint32_t reserved;
  /*
   `agents + 1` offsets into the entries of `body`, beginning with 0, never decreasing.
   */
  const uint64_t *offsets;
  /*
   `FleetyardCells`, `FleetyardVisits` or `FleetyardTrajectories`.
   */
  const void *body;
  /*
   None yet.
   */
  struct FleetyardParts parts;
} FleetyardPlan;

/*
 The body of a plan on a grid: the cell of an agent at times 0, 1, 2, … steps.
 */
typedef struct FleetyardCells {
  /*
   `sizeof(FleetyardCells)`.
   */
  uint32_t struct_size;
  /*
   Zero.
   */
  uint32_t reserved;
  /*
   Cells.
   */
  const uint32_t *cells;
} FleetyardCells;

/*
 The body of a plan on a roadmap: the vertices that an agent visits. It drives straight and
 evenly from one to the next, and is at the first one from time 0.
 */
typedef struct FleetyardVisits {
  /*
   `sizeof(FleetyardVisits)`.
   */
  uint32_t struct_size;
  /*
   Zero.
   */
  uint32_t reserved;
  /*
   Vertices.
   */
  const uint32_t *vertices;
  /*
   When the agent arrives.
   */
  const double *arrival_s;
  /*
   When it leaves; of the last visit, no earlier than the arrival.
   */
  const double *departure_s;
} FleetyardVisits;

/*
 The body of a plan in the plane: knots, controls, or both.

 Between knots position and heading are linear in time; the first is at time 0. Controls lead from
 the state at the start, each held for its duration, one after the other; the host works out where.
 An agent with both moves by its knots, to which its controls have to lead within
 `FleetyardInstance::dynamics_tolerance`. One that has neither, in a plan with controls, stays at
 its start.
 */
typedef struct FleetyardTrajectories {
  /*
   `sizeof(FleetyardTrajectories)`.
   */
  uint32_t struct_size;
  /*
   Zero.
   */
  uint32_t reserved;
  /*
   Times, ascending for each agent; as x and y null when there are no knots.
   */
  const double *time_s;
  /*
   Positions.
   */
  const double *x_m;
  /*
   Positions.
   */
  const double *y_m;
  /*
   Headings, counter-clockwise and unwrapped; NaN where a robot has none, null when none has
   one.
   */
  const double *heading_rad;
  /*
   `agents + 1` offsets into `duration_s`; null when there are no controls.
   */
  const uint64_t *segment_offsets;
  /*
   The time that each control is held, above 0.
   */
  const double *duration_s;
  /*
   `agents + 1` offsets into `controls`: an agent has as many numbers for each of its durations
   as a control of its robot has. Null when there are no controls.
   */
  const uint64_t *control_offsets;
  /*
   The controls, number after number.
   */
  const double *controls;
} FleetyardTrajectories;

/*
 A task that an instance generator gives to an agent.
 */
typedef struct FleetyardAssignment {
  /*
   Identifier of the task, one of `FleetyardFleetState::task_ids`.
   */
  uint64_t task;
  /*
   Number of the agent.
   */
  uint32_t agent;
  /*
   Zero.
   */
  uint32_t reserved;
} FleetyardAssignment;

/*
 The state of the fleet when everything committed has been executed, and the work that is left:
 the input of an instance generator.
 */
typedef struct FleetyardFleetState {
  /*
   `sizeof(FleetyardFleetState)`.
   */
  uint32_t struct_size;
  /*
   Number of open tasks: released and given to nobody.
   */
  uint32_t tasks;
  /*
   Simulated time since the run began.
   */
  double time_s;
  /*
   The next instance as it is if nobody is given more. Its goals are those that agents have been
   given and have not reached, in order: the first is current. Where goals never end, they are
   as many as it takes to keep the agent busy for longer than the window, and at least two. Its
   window is the one asked for.
   */
  const struct FleetyardInstance *next;
  /*
   `tasks` identifiers.
   */
  const uint64_t *task_ids;
  /*
   `tasks + 1` offsets into `task_places`.
   */
  const uint64_t *task_offsets;
  /*
   The places that a task visits, in order.
   */
  const uint32_t *task_places;
  /*
   `tasks` times at which tasks were released.
   */
  const double *task_released_s;
  /*
   See `FLEETYARD_TRAFFIC_ID` and those after it.
   */
  struct FleetyardParts parts;
} FleetyardFleetState;

/*
 The decision of an instance generator, and nothing else: the rest of the next instance is as
 `FleetyardFleetState::next` has it.
 */
typedef struct FleetyardRequest {
  /*
   `sizeof(FleetyardRequest)`.
   */
  uint32_t struct_size;
  /*
   Number of agents; must equal that of the state.
   */
  uint32_t agents;
  /*
   `agents + 1` offsets into `goals`.
   */
  const uint64_t *goal_offsets;
  /*
   The places that the planner is asked to visit.
   */
  const uint32_t *goals;
  /*
   `assignment_count` tasks that are given to agents: the host appends the places of a task to
   the goals of its agent. May be null when there are none.
   */
  const struct FleetyardAssignment *assignments;
  /*
   Number of assignments.
   */
  uint64_t assignment_count;
  /*
   The window of the next instance on a grid, no longer than the one asked for.
   */
  uint32_t window_steps;
  /*
   Zero.
   */
  uint32_t reserved;
  /*
   The same in the other representations.
   */
  double window_s;
  /*
   None yet.
   */
  struct FleetyardParts parts;
} FleetyardRequest;

/*
 Averages at a moment. Everything is 0 in the first one, which is taken when a run begins.
 */
typedef struct FleetyardSnapshot {
  /*
   `sizeof(FleetyardSnapshot)`.
   */
  uint32_t struct_size;
  /*
   Zero.
   */
  uint32_t reserved;
  /*
   Number of snapshots before it: a key for caches.
   */
  uint64_t number;
  /*
   Per place, the share of time in which somebody stood there whose goal is elsewhere, in units
   of 1/255.
   */
  const uint8_t *waiting;
  /*
   Per move, the flow in units of `FleetyardTraffic::flow_unit_per_s`: on a grid the moves from
   cell 0 in the order of the bits of `FleetyardGrid::moves`, 4 or 8 of them, then those from
   cell 1; on a roadmap its edges.
   */
  const uint8_t *flow;
} FleetyardSnapshot;

/*
 Part of instances and states: averages of where robots wait, and which way they go. Like the
 other parts of this kind, the host hands it to plugins alone that list it in their features.
 */
typedef struct FleetyardTraffic {
  /*
   `sizeof(FleetyardTraffic)`.
   */
  uint32_t struct_size;
  /*
   Number of places of the map.
   */
  uint32_t places;
  /*
   Number of flows: cells by neighbours on a grid, edges on a roadmap.
   */
  uint64_t flows;
  /*
   Simulated time from a snapshot to the next.
   */
  double period_s;
  /*
   Time constant of the exponential averages.
   */
  double time_constant_s;
  /*
   Simulated time since the last snapshot was taken.
   */
  double since_s;
  /*
   A flow of 1 stands for so many moves per second.
   */
  double flow_unit_per_s;
  /*
   The last snapshot.
   */
  const struct FleetyardSnapshot *last;
  /*
   The one before; the same as long as there is only one.
   */
  const struct FleetyardSnapshot *before;
} FleetyardTraffic;

/*
 Part of instances and states: what of the last plan nobody is committed to.
 */
typedef struct FleetyardRestOfPlan {
  /*
   `sizeof(FleetyardRestOfPlan)`.
   */
  uint32_t struct_size;
  /*
   Number of agents.
   */
  uint32_t agents;
  /*
   `agents + 1` offsets into `moves`.
   */
  const uint64_t *offsets;
  /*
   A letter of `NESWnesw` per step of an agent from its start on, `.` for a wait.
   */
  const uint8_t *moves;
} FleetyardRestOfPlan;

/*
 Part of instances and states: the tasks that goals belong to, and since when agents have them.
 */
typedef struct FleetyardGoalTasks {
  /*
   `sizeof(FleetyardGoalTasks)`.
   */
  uint32_t struct_size;
  /*
   Zero.
   */
  uint32_t reserved;
  /*
   Number of goals: those of the instance, in their order.
   */
  uint64_t goals;
  /*
   Simulated time since the run began.
   */
  double time_s;
  /*
   The task of each goal; `UINT64_MAX` for one that is of no task, or not the agent's own.
   */
  const uint64_t *tasks;
  /*
   The number of each goal among the task's places; `FLEETYARD_NONE` as above.
   */
  const uint32_t *errands;
  /*
   When the task of each goal was released; for other goals as `given_s`.
   */
  const double *released_s;
  /*
   When the task of each goal was given to the agent. A goal without a task is given when the
   one before it is reached; `time_s` if that is still to come.
   */
  const double *given_s;
} FleetyardGoalTasks;

/*
 Part of instances and states: a guidance graph, factors on what moves and waits cost. Where it is
 cheap robots are to go, where it is dear they are not, and every way stays allowed.
 */
typedef struct FleetyardGuidance {
  /*
   `sizeof(FleetyardGuidance)`.
   */
  uint32_t struct_size;
  /*
   Number of places of the map.
   */
  uint32_t places;
  /*
   Number of moves: cells by neighbours on a grid, edges on a roadmap.
   */
  uint64_t move_count;
  /*
   Per move, in the order of `FleetyardSnapshot::flow`, the factor of its cost in units of
   1 / `FLEETYARD_GUIDANCE_NEUTRAL`, from `FLEETYARD_GUIDANCE_LEAST` to
   `FLEETYARD_GUIDANCE_MOST`. Moves that the map does not have have one as well.
   */
  const uint16_t *moves;
  /*
   The same per place, for a wait there.
   */
  const uint16_t *waits;
} FleetyardGuidance;

/*
 Bytes of a plugin's own.
 */
typedef struct FleetyardBytes {
  /*
   `sizeof(FleetyardBytes)`.
   */
  uint32_t struct_size;
  /*
   Zero.
   */
  uint32_t reserved;
  /*
   `len` bytes; may be null when there are none.
   */
  const uint8_t *ptr;
  /*
   Their number, at most `FLEETYARD_KEPT_LIMIT`.
   */
  uint64_t len;
} FleetyardBytes;

/*
 Extension of the sink in `plan`, `recover` and `generate`: the host keeps bytes for the plugin.
 */
typedef struct FleetyardKeep {
  /*
   `sizeof(FleetyardKeep)`.
   */
  uint32_t struct_size;
  /*
   Zero.
   */
  uint32_t reserved;
  /*
   `[any-thread]` Keeps bytes in place of those before; the next call has them as the part
   `FLEETYARD_KEPT_ID`, if the plugin lists that in its features. The last ones of a call count,
   and only if it ends well and in time. Copies. Returns as `FleetyardSink::submit_plan`.
   */
  int32_t (*keep)(void *sink_context, const struct FleetyardBytes *bytes);
} FleetyardKeep;

/*
 The status of the fleet: the input of an invocation policy.
 */
typedef struct FleetyardFleetStatus {
  /*
   `sizeof(FleetyardFleetStatus)`.
   */
  uint32_t struct_size;
  /*
   Number of agents.
   */
  uint32_t agents;
  /*
   Simulated time since the run began.
   */
  double time_s;
  /*
   Simulated time since the planner was last called.
   */
  double since_last_call_s;
  /*
   Limit of the planner's time: its answer to a call now takes effect so much later.
   */
  double planning_limit_s;
  /*
   The least time that an action of a robot takes.
   */
  double action_s;
  /*
   `agents` counts of committed actions that are not yet executed.
   */
  const uint32_t *actions_left;
  /*
   None yet.
   */
  struct FleetyardParts parts;
} FleetyardFleetStatus;

/*
 Receives what a plugin has to say. Given to a call, valid until it returns.
 */
typedef struct FleetyardSink {
  /*
   `sizeof(FleetyardSink)`.
   */
  uint32_t struct_size;
  /*
   Zero.
   */
  uint32_t reserved;
  /*
   The host's; pass it back as it is.
   */
  void *context;
  /*
   `[any-thread]` Hands over a plan, in calls that ask for one. May be
   called any number of times, each plan better than the last. Copies.
   Returns `FLEETYARD_OK`, `FLEETYARD_REJECTED`, `FLEETYARD_TOO_LATE` or `FLEETYARD_BUSY`.
   */
  int32_t (*submit_plan)(void *context, const struct FleetyardPlan *plan);
  /*
   `[any-thread]` Hands over what a generator decided, in `generate`. Copies. Returns as
   `submit_plan`.
   */
  int32_t (*submit_request)(void *context, const struct FleetyardRequest *request);
  /*
   `[any-thread]` Non-zero when the call should end: `FleetyardBudget::answer_by_ns` has
   passed or the host gave up on it. Cheap; ask often.
   */
  int32_t (*cancelled)(void *context);
  /*
   `[any-thread]` The host's monotonic clock.
   */
  uint64_t (*now_ns)(void *context);
  /*
   `[any-thread]` Explains the status that the call is about to return; the last explanation
   counts.
   */
  void (*fail)(void *context, struct FleetyardStr message);
  /*
   `[any-thread]` Writes to the run's log; `level` is `FLEETYARD_LOG_*`.
   */
  void (*log)(void *context, int32_t level, struct FleetyardStr text);
  /*
   `[any-thread]` Reports a figure such as `expansions`, kept as a claim. Some names have
   a meaning and a domain (`docs/protocol.md`): another value breaks the contract.
   */
  void (*metric)(void *context, struct FleetyardStr name, double value);
  /*
   `[any-thread]` Notes a fact about the plugin's inputs, such as the digest of its weights;
   kept as a claim.
   */
  void (*note)(void *context, struct FleetyardStr name, struct FleetyardStr text);
  /*
   `[any-thread]` Says how much of the work is done; `total` 0 if unknown.
   */
  void (*progress)(void *context, uint64_t done, uint64_t total);
  /*
   `[any-thread]` An extension structure of this call by its identifier
   (`fleetyard.NAME/REVISION`), or null when the host has no use for it. Its functions take
   the sink's context.
   */
  const void *(*get_extension)(void *context, struct FleetyardStr id);
} FleetyardSink;

/*
 Something that a planner wants to show, such as a constraint, a conflict or a tree: shapes of a
 layer. It is shown and never judged. An annotation has at most 32,768 shapes and as many points
 or places together.
 */
typedef struct FleetyardAnnotation {
  /*
   `sizeof(FleetyardAnnotation)`.
   */
  uint32_t struct_size;
  /*
   One of `FLEETYARD_SHAPE_*`.
   */
  int32_t shape;
  /*
   Name of the layer, 1 to 64 bytes without control characters: what is shown or hidden
   together.
   */
  struct FleetyardStr layer;
  /*
   For people, at most 1024 bytes; may be empty.
   */
  struct FleetyardStr text;
  /*
   The agent that it is about, or `FLEETYARD_NONE`.
   */
  uint32_t agent;
  /*
   Number of shapes.
   */
  uint32_t count;
  /*
   When it begins to hold, in seconds of the plan, from 0.
   */
  double from_s;
  /*
   When it ends; infinite where it does not.
   */
  double to_s;
  /*
   `count + 1` offsets of the shapes into the points or places.
   */
  const uint64_t *offsets;
  /*
   x of the points; may be null for places.
   */
  const double *x_m;
  /*
   y of the points; may be null for places.
   */
  const double *y_m;
  /*
   Cells or vertices; null but for places.
   */
  const uint32_t *places;
  /*
   `count` numbers, one for each shape, for colours; may be null.
   */
  const double *values;
} FleetyardAnnotation;

/*
 Extension of the sink of `plan` and `recover`, null unless somebody wants to see annotations.
 */
typedef struct FleetyardAnnotations {
  /*
   `sizeof(FleetyardAnnotations)`.
   */
  uint32_t struct_size;
  /*
   Zero.
   */
  uint32_t reserved;
  /*
   `[any-thread]` Hands over an annotation, with the sink's context. Copies. Returns as
   `submit_plan`: `FLEETYARD_BUSY` when the host keeps no more of them, which may be ignored.
   */
  int32_t (*annotate)(void *context, const struct FleetyardAnnotation *annotation);
} FleetyardAnnotations;

/*
 Extension of a planner, a fail policy or an instance generator: memory that a call leaves to be
 freed when it has been answered, so that it is answered sooner.
 */
typedef struct FleetyardLeftovers {
  /*
   `sizeof(FleetyardLeftovers)`.
   */
  uint32_t struct_size;
  /*
   Zero.
   */
  uint32_t reserved;
  /*
   `[one-at-a-time]`, with the object's context. Non-zero if there is some. Cheap: asked after
   every call, on its thread.
   */
  int32_t (*any)(void *context);
  /*
   `[one-at-a-time]`, with the object's context. Frees it, on the thread of the call that left
   it, when that has been answered. Where a host does not ask, the plugin frees it in its next
   call or with the object.
   */
  void (*free)(void *context);
} FleetyardLeftovers;

/*
 Services of the host for the plugin. Valid from `init` to `deinit`.
 */
typedef struct FleetyardHost {
  /*
   `sizeof(FleetyardHost)`.
   */
  uint32_t struct_size;
  /*
   The host's `FLEETYARD_ABI_MAJOR`.
   */
  uint16_t abi_major;
  /*
   The host's `FLEETYARD_ABI_MINOR`.
   */
  uint16_t abi_minor;
  /*
   The host's; pass it back as it is.
   */
  void *context;
  /*
   The host's name.
   */
  struct FleetyardStr name;
  /*
   The host's version.
   */
  struct FleetyardStr version;
  /*
   `[any-thread]` An extension structure by its identifier
   (`fleetyard.NAME/REVISION`; third parties begin with a reversed domain
   name), or null.
   */
  const void *(*get_extension)(void *context, struct FleetyardStr id);
} FleetyardHost;

/*
 An option of a plugin.
 */
typedef struct FleetyardPluginOption {
  /*
   Its name.
   */
  struct FleetyardStr name;
  /*
   Its value, where `kind` says so.
   */
  struct FleetyardStr text;
  /*
   Its value, where `kind` says so.
   */
  double number;
  /*
   One of `FLEETYARD_OPTION_*`.
   */
  int32_t kind;
  /*
   Zero.
   */
  uint32_t reserved;
} FleetyardPluginOption;

/*
 The options of a plugin. The host has checked them against the plugin's schema, and filled in
 the defaults of the schema.
 */
typedef struct FleetyardOptions {
  /*
   `sizeof(FleetyardOptions)`.
   */
  uint32_t struct_size;
  /*
   Number of options.
   */
  uint32_t count;
  /*
   `count` options; may be null when there are none.
   */
  const struct FleetyardPluginOption *list;
  /*
   The same as the text of a JSON object.
   */
  struct FleetyardStr json;
} FleetyardOptions;

/*
 Identity and capabilities of a plugin. Static: valid until `deinit`.
 */
typedef struct FleetyardDescriptor {
  /*
   `sizeof(FleetyardDescriptor)`.
   */
  uint32_t struct_size;
  /*
   Number of features.
   */
  uint32_t feature_count;
  /*
   Short identifier, `[a-z0-9][a-z0-9._-]*`, unique in the library per kind.
   */
  struct FleetyardStr id;
  /*
   Human-readable name.
   */
  struct FleetyardStr name;
  /*
   Version of the plugin.
   */
  struct FleetyardStr version;
  /*
   One paragraph, the paper cited.
   */
  struct FleetyardStr description;
  /*
   SPDX licence expression; may be empty.
   */
  struct FleetyardStr license;
  /*
   JSON Schema of the options object; empty when there are none.
   */
  struct FleetyardStr options_schema;
  /*
   Or of `FLEETYARD_CAPABILITY_*`.
   */
  uint64_t capabilities;
  /*
   `feature_count` names of what has no bit: `dynamics:NAME` for each model of robots that
   it plans for, `part:ID` for each part that it reads; and two limits: `agents:N` if it plans
   for no more than N agents, `for:measuring` if it is there to measure hosts. May be null when
   there are none.
   */
  const struct FleetyardStr *features;
} FleetyardDescriptor;

/*
 A planner.

 Life: `create`, then `prepare` once per map, then `plan` any number of times, then `destroy`.
 A `prepare` that fails leaves the object without a map.
 */
typedef struct FleetyardPlanner {
  /*
   `sizeof(FleetyardPlanner)`: before `create` the room that the host has, afterwards what the
   plugin filled in.
   */
  uint32_t struct_size;
  /*
   Zero.
   */
  uint32_t reserved;
  /*
   The plugin's; passed back as it is.
   */
  void *context;
  /*
   `[one-at-a-time]` Learns a map, within a budget of its own. Returns a
   `FLEETYARD_STATUS_*`, `SOLVED` for success.
   */
  int32_t (*prepare)(void *context,
                     const struct FleetyardEnvironment *environment,
                     const struct FleetyardBudget *budget,
                     const struct FleetyardSink *sink);
  /*
   `[one-at-a-time]`, after `prepare`. Solves an instance and submits plans to
   the sink. Returns a `FLEETYARD_STATUS_*`.
   */
  int32_t (*plan)(void *context,
                  const struct FleetyardInstance *instance,
                  const struct FleetyardBudget *budget,
                  const struct FleetyardSink *sink);
  /*
   `[one-at-a-time]` Ends the object.
   */
  void (*destroy)(void *context);
  /*
   `[one-at-a-time]` An extension structure by its identifier, or null. May be
   null itself.
   */
  const void *(*get_extension)(void *context, struct FleetyardStr id);
} FleetyardPlanner;

/*
 A fail policy: gets the fleet moving again when the planner has failed.

 Life: as a planner's, with `recover` in place of `plan`.
 */
typedef struct FleetyardFailPolicy {
  /*
   `sizeof(FleetyardFailPolicy)`: before `create` the room that the host has, afterwards what the
   plugin filled in.
   */
  uint32_t struct_size;
  /*
   Zero.
   */
  uint32_t reserved;
  /*
   The plugin's; passed back as it is.
   */
  void *context;
  /*
   `[one-at-a-time]` As `FleetyardPlanner::prepare`.
   */
  int32_t (*prepare)(void *context,
                     const struct FleetyardEnvironment *environment,
                     const struct FleetyardBudget *budget,
                     const struct FleetyardSink *sink);
  /*
   `[one-at-a-time]`, after `prepare`. Submits a collision-free plan.
   `failed_plan` is what the planner left, collisions and all; may be null.
   */
  int32_t (*recover)(void *context,
                     const struct FleetyardInstance *instance,
                     const struct FleetyardPlan *failed_plan,
                     const struct FleetyardBudget *budget,
                     const struct FleetyardSink *sink);
  /*
   `[one-at-a-time]` Ends the object.
   */
  void (*destroy)(void *context);
  /*
   `[one-at-a-time]` As `FleetyardPlanner::get_extension`.
   */
  const void *(*get_extension)(void *context, struct FleetyardStr id);
} FleetyardFailPolicy;

/*
 An instance generator: decides what the planner is asked next.

 Life: as a planner's, with `generate` in place of `plan`.
 */
typedef struct FleetyardInstanceGenerator {
  /*
   `sizeof(FleetyardInstanceGenerator)`: before `create` the room that the host has, afterwards what the
   plugin filled in.
   */
  uint32_t struct_size;
  /*
   Zero.
   */
  uint32_t reserved;
  /*
   The plugin's; passed back as it is.
   */
  void *context;
  /*
   `[one-at-a-time]` As `FleetyardPlanner::prepare`.
   */
  int32_t (*prepare)(void *context,
                     const struct FleetyardEnvironment *environment,
                     const struct FleetyardBudget *budget,
                     const struct FleetyardSink *sink);
  /*
   `[one-at-a-time]`, after `prepare`. Submits one instance.
   */
  int32_t (*generate)(void *context,
                      const struct FleetyardFleetState *state,
                      const struct FleetyardBudget *budget,
                      const struct FleetyardSink *sink);
  /*
   `[one-at-a-time]` Ends the object.
   */
  void (*destroy)(void *context);
  /*
   `[one-at-a-time]` As `FleetyardPlanner::get_extension`.
   */
  const void *(*get_extension)(void *context, struct FleetyardStr id);
} FleetyardInstanceGenerator;

/*
 An invocation policy: decides when the planner is called.

 Life: `create`, then `should_invoke` any number of times, then `destroy`.
 */
typedef struct FleetyardInvocationPolicy {
  /*
   `sizeof(FleetyardInvocationPolicy)`: before `create` the room that the host has, afterwards what the
   plugin filled in.
   */
  uint32_t struct_size;
  /*
   Zero.
   */
  uint32_t reserved;
  /*
   The plugin's; passed back as it is.
   */
  void *context;
  /*
   `[one-at-a-time]` Writes 1 to `out` if the planner has to be called now, else 0. Returns a
   `FLEETYARD_STATUS_*`, `SOLVED` for success.
   */
  int32_t (*should_invoke)(void *context,
                           const struct FleetyardFleetStatus *status,
                           const struct FleetyardSink *sink,
                           int32_t *out);
  /*
   `[one-at-a-time]` Ends the object.
   */
  void (*destroy)(void *context);
  /*
   `[one-at-a-time]` As `FleetyardPlanner::get_extension`.
   */
  const void *(*get_extension)(void *context, struct FleetyardStr id);
} FleetyardInvocationPolicy;

/*
 Makes planners.
 */
typedef struct FleetyardPlannerFactory {
  /*
   `sizeof(FleetyardPlannerFactory)`.
   */
  uint32_t struct_size;
  /*
   Zero.
   */
  uint32_t reserved;
  /*
   The plugin's; passed back as it is. May be null.
   */
  void *context;
  /*
   `[any-thread]` How many planners the library has.
   */
  uint32_t (*count)(void *context);
  /*
   `[any-thread]` Describes planner `index`; null when out of range.
   */
  const struct FleetyardDescriptor *(*descriptor)(void *context, uint32_t index);
  /*
   `[one-at-a-time]` Makes planner `index` from its options and fills in `out`, whose
   `struct_size` says how much room there is: with too little it writes nothing and returns
   `UNSUPPORTED`. Returns a `FLEETYARD_STATUS_*`, `SOLVED` for success.
   */
  int32_t (*create)(void *context,
                    uint32_t index,
                    const struct FleetyardOptions *options,
                    const struct FleetyardSink *sink,
                    struct FleetyardPlanner *out);
} FleetyardPlannerFactory;

/*
 Makes fail policies; as `FleetyardPlannerFactory`.
 */
typedef struct FleetyardFailPolicyFactory {
  /*
   `sizeof(FleetyardFailPolicyFactory)`.
   */
  uint32_t struct_size;
  /*
   Zero.
   */
  uint32_t reserved;
  /*
   The plugin's; passed back as it is. May be null.
   */
  void *context;
  /*
   `[any-thread]` As `FleetyardPlannerFactory::count`.
   */
  uint32_t (*count)(void *context);
  /*
   `[any-thread]` As `FleetyardPlannerFactory::descriptor`.
   */
  const struct FleetyardDescriptor *(*descriptor)(void *context, uint32_t index);
  /*
   `[one-at-a-time]` As `FleetyardPlannerFactory::create`.
   */
  int32_t (*create)(void *context,
                    uint32_t index,
                    const struct FleetyardOptions *options,
                    const struct FleetyardSink *sink,
                    struct FleetyardFailPolicy *out);
} FleetyardFailPolicyFactory;

/*
 Makes instance generators; as `FleetyardPlannerFactory`.
 */
typedef struct FleetyardInstanceGeneratorFactory {
  /*
   `sizeof(FleetyardInstanceGeneratorFactory)`.
   */
  uint32_t struct_size;
  /*
   Zero.
   */
  uint32_t reserved;
  /*
   The plugin's; passed back as it is. May be null.
   */
  void *context;
  /*
   `[any-thread]` As `FleetyardPlannerFactory::count`.
   */
  uint32_t (*count)(void *context);
  /*
   `[any-thread]` As `FleetyardPlannerFactory::descriptor`.
   */
  const struct FleetyardDescriptor *(*descriptor)(void *context, uint32_t index);
  /*
   `[one-at-a-time]` As `FleetyardPlannerFactory::create`.
   */
  int32_t (*create)(void *context,
                    uint32_t index,
                    const struct FleetyardOptions *options,
                    const struct FleetyardSink *sink,
                    struct FleetyardInstanceGenerator *out);
} FleetyardInstanceGeneratorFactory;

/*
 Makes invocation policies; as `FleetyardPlannerFactory`.
 */
typedef struct FleetyardInvocationPolicyFactory {
  /*
   `sizeof(FleetyardInvocationPolicyFactory)`.
   */
  uint32_t struct_size;
  /*
   Zero.
   */
  uint32_t reserved;
  /*
   The plugin's; passed back as it is. May be null.
   */
  void *context;
  /*
   `[any-thread]` As `FleetyardPlannerFactory::count`.
   */
  uint32_t (*count)(void *context);
  /*
   `[any-thread]` As `FleetyardPlannerFactory::descriptor`.
   */
  const struct FleetyardDescriptor *(*descriptor)(void *context, uint32_t index);
  /*
   `[one-at-a-time]` As `FleetyardPlannerFactory::create`.
   */
  int32_t (*create)(void *context,
                    uint32_t index,
                    const struct FleetyardOptions *options,
                    const struct FleetyardSink *sink,
                    struct FleetyardInvocationPolicy *out);
} FleetyardInvocationPolicyFactory;

/*
 The one symbol that a library exports, named `fleetyard_plugin_entry_v1`.
 */
typedef struct FleetyardPluginEntry {
  /*
   `sizeof(FleetyardPluginEntry)`.
   */
  uint32_t struct_size;
  /*
   `FLEETYARD_ABI_MAJOR` of the header that the plugin was built with.
   */
  uint16_t abi_major;
  /*
   `FLEETYARD_ABI_MINOR` of the header that the plugin was built with.
   */
  uint16_t abi_minor;
  /*
   `[one-at-a-time]` Called once before anything else; `path` is the library's
   own. Returns `FLEETYARD_OK` or a negative number. May be null.
   */
  int32_t (*init)(const struct FleetyardHost *host, struct FleetyardStr path);
  /*
   `[one-at-a-time]` Called once, after everything was destroyed. May be null.
   */
  void (*deinit)(void);
  /*
   `[any-thread]` The factory with this identifier, or null.
   */
  const void *(*get_factory)(struct FleetyardStr id);
} FleetyardPluginEntry;

#endif  /* FLEETYARD_H */

#ifdef __cplusplus
extern "C" {
#endif
/* What a plugin defines. */
extern FLEETYARD_EXPORT const FleetyardPluginEntry fleetyard_plugin_entry_v1;
#ifdef __cplusplus
}
#endif
