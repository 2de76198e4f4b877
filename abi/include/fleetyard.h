/* The plugin contract of Fleetyard. MIT OR Apache-2.0.
 *
 * A plugin is a shared library that exports one symbol:
 *
 *     const FleetyardPluginEntry fleetyard_plugin_entry_v1 = { ... };
 *
 * Nothing changes owner. Inputs are borrowed for the duration of the call; what a
 * plugin has to say goes to the host's sink, which copies before it returns. Each
 * structure begins with its own size. Function pointers are never null unless
 * their comment says that they may be.
 *
 * [main-thread]  calls into one object come from one thread at a time
 * [thread-safe]  from any thread while the call that received it has not returned
 *
 * This file is generated from abi/src/c.rs.
 */

#ifndef FLEETYARD_H
#define FLEETYARD_H

#include <stddef.h>
#include <stdint.h>

/* Identifiers for get_factory. */
#define FLEETYARD_PLANNER_FACTORY_ID "fleetyard.planner/1"
#define FLEETYARD_FAIL_POLICY_FACTORY_ID "fleetyard.fail-policy/1"
#define FLEETYARD_INSTANCE_GENERATOR_FACTORY_ID "fleetyard.instance-generator/1"
#define FLEETYARD_INVOCATION_POLICY_FACTORY_ID "fleetyard.invocation-policy/1"


/*
 Major version of the ABI; host and plugin agree only when it is equal.
 */
#define FLEETYARD_ABI_MAJOR 1

/*
 Minor version of the ABI; grows with additions that old plugins can ignore.
 */
#define FLEETYARD_ABI_MINOR 0

/*
 Success, for functions that return a result code.
 */
#define FLEETYARD_OK 0

/*
 The host refused what was submitted (malformed, too late, or cancelled).
 */
#define FLEETYARD_REJECTED -1

/*
 The plan that was submitted solves the instance.
 */
#define FLEETYARD_STATUS_SOLVED 0

/*
 The instance has no solution, and the planner proved it.
 */
#define FLEETYARD_STATUS_INFEASIBLE 1

/*
 The budget ran out: the deadline or the node limit was reached.
 */
#define FLEETYARD_STATUS_TIMED_OUT 2

/*
 The planner stopped trying without a proof.
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
#define FLEETYARD_REPRESENTATION_GRID 0

/*
 A graph embedded in the plane, continuous time.
 */
#define FLEETYARD_REPRESENTATION_ROADMAP 1

/*
 Free space itself, continuous time.
 */
#define FLEETYARD_REPRESENTATION_CONTINUOUS 2

/*
 A robot moves to an adjacent cell or waits, each in one step.
 */
#define FLEETYARD_MOTION_PEBBLE 0

/*
 As a pebble, but turning by 90 degrees takes a step.
 */
#define FLEETYARD_MOTION_ROTATION 1

/*
 A robot moves in straight lines between the cells of its path, which need not be
 adjacent; a path is a place after the other, without times.
 */
#define FLEETYARD_MOTION_ANY_ANGLE 2

/*
 Minimise the sum over agents of the last time of arrival at the goal.
 */
#define FLEETYARD_OBJECTIVE_SUM_OF_COSTS 0

/*
 Minimise the time at which the last agent arrives.
 */
#define FLEETYARD_OBJECTIVE_MAKESPAN 1

/*
 Heading of a robot on a grid: towards larger columns.
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
 Log level: something failed.
 */
#define FLEETYARD_LOG_ERROR 0

/*
 Log level: something is odd.
 */
#define FLEETYARD_LOG_WARNING 1

/*
 Log level: worth knowing once per run.
 */
#define FLEETYARD_LOG_INFO 2

/*
 Log level: for the plugin's author.
 */
#define FLEETYARD_LOG_DEBUG 3

/*
 `FleetyardInvocationPolicy::should_invoke` answers: not yet.
 */
#define FLEETYARD_INVOKE_NOT_YET 0

/*
 `FleetyardInvocationPolicy::should_invoke` answers: call the planner now.
 */
#define FLEETYARD_INVOKE_NOW 1

/*
 UTF-8 text, not terminated by a zero byte.
 */
typedef struct FleetyardStr {
  /*
   First byte; may be null when `len` is 0.
   */
  const uint8_t *ptr;
  /*
   Length in bytes.
   */
  size_t len;
} FleetyardStr;

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
   When the call must have returned: nanoseconds of `CLOCK_MONOTONIC`.
   */
  uint64_t deadline_monotonic_ns;
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
} FleetyardBudget;

/*
 A grid: row 0 is the top, column 0 the left, and the cell at `(row, col)` has
 the index `row * cols + col`.
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
   `rows * cols` bytes: 1 where a robot may stand, else 0.
   */
  const uint8_t *passable;
  /*
   `rows * cols` terrain letters as in the map file (`e` endpoint, `w`
   workstation, …).
   */
  const uint8_t *terrain;
} FleetyardGrid;

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
   The map's name, for messages.
   */
  struct FleetyardStr map_name;
  /*
   `FleetyardGrid` when the representation is a grid.
   */
  const void *view;
} FleetyardEnvironment;

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
 An instance: the input of a planner.
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
   The environment of the last successful `prepare`, borrowed for the call.
   */
  const struct FleetyardEnvironment *environment;
  /*
   `agents` cells.
   */
  const uint32_t *starts;
  /*
   `agents` headings, one of `FLEETYARD_HEADING_*`; null when headings do
   not matter.
   */
  const int32_t *headings;
  /*
   `agents + 1` offsets into `goals`; the goals of agent `i` are those from
   `goal_offsets[i]` up to but not including `goal_offsets[i + 1]`, to be
   visited in order. Every agent has at least one.
   */
  const uint64_t *goal_offsets;
  /*
   Cells.
   */
  const uint32_t *goals;
  /*
   One of `FLEETYARD_MOTION_*`.
   */
  int32_t motion;
  /*
   One of `FLEETYARD_OBJECTIVE_*`.
   */
  int32_t objective;
  /*
   Collisions after this many steps do not matter, and paths may end before
   their goals; 0 for a complete plan.
   */
  uint32_t window_steps;
  /*
   Non-zero where three or more agents may move round in a ring in one step,
   each into the cell that the next one leaves. Plans for a fleet must not:
   there nobody enters a cell before it is empty.
   */
  int32_t allows_cycles;
  /*
   Radius of the largest robot's enclosing circle.
   */
  double radius_m;
  /*
   Number of assignments; 0 in calls of planners and fail policies.
   */
  uint32_t assignments_count;
  /*
   Zero.
   */
  uint32_t reserved;
  /*
   `assignments_count` tasks that the generator gives to agents: the host
   appends the cells of a task to the goals of its agent. May be null when
   there are none.
   */
  const struct FleetyardAssignment *assignments;
} FleetyardInstance;

/*
 Paths on a grid: the cells of agent `i` at times 0, 1, 2, … are those from
 `offsets[i]` up to but not including `offsets[i + 1]`. After its last cell an
 agent stays there.
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
   `agents + 1` offsets into `cells`, beginning with 0, never decreasing.
   */
  const uint64_t *offsets;
  /*
   Cells.
   */
  const uint32_t *cells;
} FleetyardPlan;

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
   Number of agents.
   */
  uint32_t agents;
  /*
   The environment of the last successful `prepare`, borrowed for the call.
   */
  const struct FleetyardEnvironment *environment;
  /*
   Simulated time since the run began.
   */
  double time_s;
  /*
   `agents` cells at the end of what is committed.
   */
  const uint32_t *cells;
  /*
   `agents` headings there; null when headings do not matter.
   */
  const int32_t *headings;
  /*
   `agents + 1` offsets into `goals`.
   */
  const uint64_t *goal_offsets;
  /*
   Goals that agents have been given and have not reached, in order: the first
   is current. Where goals never end, as many as it takes to keep the agent
   busy for longer than the window, and at least two.
   */
  const uint32_t *goals;
  /*
   Number of open tasks: released and given to nobody.
   */
  uint32_t tasks;
  /*
   Planning window asked for in steps; 0 for none. The next instance may have a
   shorter one.
   */
  uint32_t window_steps;
  /*
   `tasks` identifiers.
   */
  const uint64_t *task_ids;
  /*
   `tasks + 1` offsets into `task_cells`.
   */
  const uint64_t *task_offsets;
  /*
   The cells that a task visits, in order.
   */
  const uint32_t *task_cells;
  /*
   One of `FLEETYARD_MOTION_*`, which the next instance must repeat.
   */
  int32_t motion;
  /*
   One of `FLEETYARD_OBJECTIVE_*`, which the next instance must repeat.
   */
  int32_t objective;
  /*
   Radius of the largest robot's enclosing circle, which the next instance must repeat.
   */
  double radius_m;
  /*
   As `FleetyardInstance::allows_cycles`; the next instance must repeat it.
   */
  int32_t allows_cycles;
  /*
   Zero.
   */
  uint32_t reserved;
} FleetyardFleetState;

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
   `[thread-safe]` Hands over a plan, in calls that ask for one. May be
   called any number of times, each plan better than the last. Copies.
   Returns `FLEETYARD_OK` or `FLEETYARD_REJECTED`.
   */
  int32_t (*submit_plan)(void *context, const struct FleetyardPlan *plan);
  /*
   `[thread-safe]` Hands over the next instance, in `generate`. Its
   environment may be null. Copies. Returns as `submit_plan`.
   */
  int32_t (*submit_instance)(void *context, const struct FleetyardInstance *instance);
  /*
   `[thread-safe]` Reports a figure such as `expansions`, kept as a claim. Some names have
   a meaning and a domain (`docs/protocol.md`): another value breaks the contract.
   */
  void (*metric)(void *context, struct FleetyardStr name, double value);
  /*
   `[thread-safe]` Writes to the run's log; `level` is `FLEETYARD_LOG_*`.
   */
  void (*log)(void *context, int32_t level, struct FleetyardStr text);
  /*
   `[thread-safe]` Says how much of the work is done; `total` 0 if unknown.
   */
  void (*progress)(void *context, uint64_t done, uint64_t total);
  /*
   `[thread-safe]` Non-zero when the call should end: the deadline has
   passed or the host gave up on it. Cheap; ask often.
   */
  int32_t (*cancelled)(void *context);
  /*
   `[thread-safe]` Explains the status that the call is about to return.
   */
  void (*fail)(void *context, struct FleetyardStr message);
} FleetyardSink;

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
   The host's name.
   */
  struct FleetyardStr name;
  /*
   The host's version.
   */
  struct FleetyardStr version;
  /*
   `[thread-safe]` An extension structure by its identifier
   (`fleetyard.NAME/REVISION`; third parties begin with a reversed domain
   name), or null.
   */
  const void *(*get_extension)(struct FleetyardStr id);
} FleetyardHost;

/*
 Identity and capabilities of a plugin. Static: valid until `deinit`.
 */
typedef struct FleetyardDescriptor {
  /*
   `sizeof(FleetyardDescriptor)`.
   */
  uint32_t struct_size;
  /*
   Zero.
   */
  uint32_t reserved;
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
} FleetyardDescriptor;

/*
 A planner.

 Life: `create`, then `prepare` once per map, then `plan` any number of times,
 then `destroy`. All calls into one object come from one thread at a time.
 */
typedef struct FleetyardPlanner {
  /*
   `sizeof(FleetyardPlanner)`.
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
   `[main-thread]` Learns a map, within a budget of its own. Returns a
   `FLEETYARD_STATUS_*`, `SOLVED` for success.
   */
  int32_t (*prepare)(void *context,
                     const struct FleetyardEnvironment *environment,
                     const struct FleetyardBudget *budget,
                     const struct FleetyardSink *sink);
  /*
   `[main-thread]`, after `prepare`. Solves an instance and submits plans to
   the sink. Returns a `FLEETYARD_STATUS_*`.
   */
  int32_t (*plan)(void *context,
                  const struct FleetyardInstance *instance,
                  const struct FleetyardBudget *budget,
                  const struct FleetyardSink *sink);
  /*
   `[main-thread]` Ends the object.
   */
  void (*destroy)(void *context);
  /*
   `[main-thread]` An extension structure by its identifier, or null. May be
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
   `sizeof(FleetyardFailPolicy)`.
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
   `[main-thread]` As `FleetyardPlanner::prepare`.
   */
  int32_t (*prepare)(void *context,
                     const struct FleetyardEnvironment *environment,
                     const struct FleetyardBudget *budget,
                     const struct FleetyardSink *sink);
  /*
   `[main-thread]`, after `prepare`. Submits a collision-free plan.
   `failed_plan` is what the planner left, collisions and all; may be null.
   */
  int32_t (*recover)(void *context,
                     const struct FleetyardInstance *instance,
                     const struct FleetyardPlan *failed_plan,
                     const struct FleetyardBudget *budget,
                     const struct FleetyardSink *sink);
  /*
   `[main-thread]` Ends the object.
   */
  void (*destroy)(void *context);
  /*
   `[main-thread]` As `FleetyardPlanner::get_extension`.
   */
  const void *(*get_extension)(void *context, struct FleetyardStr id);
} FleetyardFailPolicy;

/*
 An instance generator: decides what the planner is asked next.

 Life: as a planner's, with `generate` in place of `plan`.
 */
typedef struct FleetyardInstanceGenerator {
  /*
   `sizeof(FleetyardInstanceGenerator)`.
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
   `[main-thread]` As `FleetyardPlanner::prepare`.
   */
  int32_t (*prepare)(void *context,
                     const struct FleetyardEnvironment *environment,
                     const struct FleetyardBudget *budget,
                     const struct FleetyardSink *sink);
  /*
   `[main-thread]`, after `prepare`. Submits one instance.
   */
  int32_t (*generate)(void *context,
                      const struct FleetyardFleetState *state,
                      const struct FleetyardBudget *budget,
                      const struct FleetyardSink *sink);
  /*
   `[main-thread]` Ends the object.
   */
  void (*destroy)(void *context);
  /*
   `[main-thread]` As `FleetyardPlanner::get_extension`.
   */
  const void *(*get_extension)(void *context, struct FleetyardStr id);
} FleetyardInstanceGenerator;

/*
 An invocation policy: decides when the planner is called.

 Life: `create`, then `should_invoke` any number of times, then `destroy`.
 */
typedef struct FleetyardInvocationPolicy {
  /*
   `sizeof(FleetyardInvocationPolicy)`.
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
   `[main-thread]` `FLEETYARD_INVOKE_NOW`, `FLEETYARD_INVOKE_NOT_YET`, or
   a negative number after a call of `FleetyardSink::fail`.
   */
  int32_t (*should_invoke)(void *context,
                           const struct FleetyardFleetStatus *status,
                           const struct FleetyardSink *sink);
  /*
   `[main-thread]` Ends the object.
   */
  void (*destroy)(void *context);
  /*
   `[main-thread]` As `FleetyardPlanner::get_extension`.
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
   `[thread-safe]` How many planners the library has.
   */
  uint32_t (*count)(void);
  /*
   `[thread-safe]` Describes planner `index`; null when out of range.
   */
  const struct FleetyardDescriptor *(*descriptor)(uint32_t index);
  /*
   `[main-thread]` Makes planner `index` from its options (a JSON object)
   and fills in `out`. Returns a `FLEETYARD_STATUS_*`, `SOLVED` for success.
   */
  int32_t (*create)(uint32_t index,
                    struct FleetyardStr options,
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
   `[thread-safe]` As `FleetyardPlannerFactory::count`.
   */
  uint32_t (*count)(void);
  /*
   `[thread-safe]` As `FleetyardPlannerFactory::descriptor`.
   */
  const struct FleetyardDescriptor *(*descriptor)(uint32_t index);
  /*
   `[main-thread]` As `FleetyardPlannerFactory::create`.
   */
  int32_t (*create)(uint32_t index,
                    struct FleetyardStr options,
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
   `[thread-safe]` As `FleetyardPlannerFactory::count`.
   */
  uint32_t (*count)(void);
  /*
   `[thread-safe]` As `FleetyardPlannerFactory::descriptor`.
   */
  const struct FleetyardDescriptor *(*descriptor)(uint32_t index);
  /*
   `[main-thread]` As `FleetyardPlannerFactory::create`.
   */
  int32_t (*create)(uint32_t index,
                    struct FleetyardStr options,
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
   `[thread-safe]` As `FleetyardPlannerFactory::count`.
   */
  uint32_t (*count)(void);
  /*
   `[thread-safe]` As `FleetyardPlannerFactory::descriptor`.
   */
  const struct FleetyardDescriptor *(*descriptor)(uint32_t index);
  /*
   `[main-thread]` As `FleetyardPlannerFactory::create`.
   */
  int32_t (*create)(uint32_t index,
                    struct FleetyardStr options,
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
   `[main-thread]` Called once before anything else; `path` is the library's
   own. Returns `FLEETYARD_OK` or a negative number. May be null.
   */
  int32_t (*init)(const struct FleetyardHost *host, struct FleetyardStr path);
  /*
   `[main-thread]` Called once, after everything was destroyed. May be null.
   */
  void (*deinit)(void);
  /*
   `[thread-safe]` The factory with this identifier, or null.
   */
  const void *(*get_factory)(struct FleetyardStr id);
} FleetyardPluginEntry;

#endif  /* FLEETYARD_H */

#ifndef FLEETYARD_EXPORT
#ifdef _WIN32
#define FLEETYARD_EXPORT __declspec(dllexport)
#else
#define FLEETYARD_EXPORT __attribute__((visibility("default")))
#endif

#ifdef __cplusplus
extern "C" {
#endif
/* What a plugin defines. */
extern FLEETYARD_EXPORT const FleetyardPluginEntry fleetyard_plugin_entry_v1;
#ifdef __cplusplus
}
#endif
#endif /* FLEETYARD_EXPORT */
