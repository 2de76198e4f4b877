/* fleetyard.h of contract 1.0 without its comments, as plugins were built with it. Kept: never
 * changed after the release. MIT OR Apache-2.0. */
#ifndef FLEETYARD_H
#define FLEETYARD_H
#include <stddef.h>
#include <stdint.h>
#define FLEETYARD_EXPORT __attribute__((visibility("default")))
#define FLEETYARD_PLANNER_FACTORY_ID "fleetyard.planner/1"
#define FLEETYARD_FAIL_POLICY_FACTORY_ID "fleetyard.fail-policy/1"
#define FLEETYARD_INSTANCE_GENERATOR_FACTORY_ID "fleetyard.instance-generator/1"
#define FLEETYARD_INVOCATION_POLICY_FACTORY_ID "fleetyard.invocation-policy/1"
#define FLEETYARD_TRAFFIC_ID "fleetyard.traffic/1"
#define FLEETYARD_REST_OF_PLAN_ID "fleetyard.rest-of-plan/1"
#define FLEETYARD_GOAL_TASKS_ID "fleetyard.goal-tasks/1"
#define FLEETYARD_GUIDANCE_ID "fleetyard.guidance/1"
#define FLEETYARD_KEPT_ID "fleetyard.kept/1"
#define FLEETYARD_KEEP_ID "fleetyard.keep/1"
#define FLEETYARD_ANNOTATIONS_ID "fleetyard.annotations/1"
#define FLEETYARD_ABI_MAJOR 1
#define FLEETYARD_ABI_MINOR 0
#define FLEETYARD_GUIDANCE_NEUTRAL 100
#define FLEETYARD_GUIDANCE_LEAST 10
#define FLEETYARD_GUIDANCE_MOST 10000
#define FLEETYARD_KEPT_LIMIT (1 << 20)
#define FLEETYARD_OK 0
#define FLEETYARD_REJECTED -1
#define FLEETYARD_TOO_LATE -2
#define FLEETYARD_BUSY -3
#define FLEETYARD_STATUS_SOLVED 0
#define FLEETYARD_STATUS_INFEASIBLE 1
#define FLEETYARD_STATUS_TIMED_OUT 2
#define FLEETYARD_STATUS_GAVE_UP 3
#define FLEETYARD_STATUS_CANCELLED 4
#define FLEETYARD_STATUS_UNSUPPORTED 5
#define FLEETYARD_STATUS_INVALID_INPUT 6
#define FLEETYARD_STATUS_INTERNAL_ERROR 7
#define FLEETYARD_REPRESENTATION_GRID 1
#define FLEETYARD_REPRESENTATION_ROADMAP 2
#define FLEETYARD_REPRESENTATION_CONTINUOUS 3
#define FLEETYARD_MOTION_PEBBLE 1
#define FLEETYARD_MOTION_ROTATION 2
#define FLEETYARD_MOTION_ANY_ANGLE 3
#define FLEETYARD_MOTION_STOP_GO 4
#define FLEETYARD_MOTION_SLOWER 5
#define FLEETYARD_MOTION_DYNAMICS 6
#define FLEETYARD_OBJECTIVE_SUM_OF_COSTS 1
#define FLEETYARD_OBJECTIVE_MAKESPAN 2
#define FLEETYARD_FORM_CELLS 1
#define FLEETYARD_FORM_VISITS 2
#define FLEETYARD_FORM_TRAJECTORIES 3
#define FLEETYARD_SHAPE_POINTS 1
#define FLEETYARD_SHAPE_LINES 2
#define FLEETYARD_SHAPE_RINGS 3
#define FLEETYARD_SHAPE_PLACES 4
#define FLEETYARD_NONE UINT32_MAX
#define FLEETYARD_HEADING_EAST 0
#define FLEETYARD_HEADING_SOUTH 1
#define FLEETYARD_HEADING_WEST 2
#define FLEETYARD_HEADING_NORTH 3
#define FLEETYARD_CAPABILITY_GRID (1 << 0)
#define FLEETYARD_CAPABILITY_ROADMAP (1 << 1)
#define FLEETYARD_CAPABILITY_CONTINUOUS (1 << 2)
#define FLEETYARD_CAPABILITY_EIGHT_CONNECTED (1 << 3)
#define FLEETYARD_CAPABILITY_MOVE_MASK (1 << 4)
#define FLEETYARD_CAPABILITY_PEBBLE (1 << 8)
#define FLEETYARD_CAPABILITY_ROTATION (1 << 9)
#define FLEETYARD_CAPABILITY_ANY_ANGLE (1 << 10)
#define FLEETYARD_CAPABILITY_STOP_GO (1 << 11)
#define FLEETYARD_CAPABILITY_SLOWER (1 << 12)
#define FLEETYARD_CAPABILITY_DYNAMICS (1 << 13)
#define FLEETYARD_CAPABILITY_ANYTIME (1 << 16)
#define FLEETYARD_CAPABILITY_WINDOWED (1 << 17)
#define FLEETYARD_CAPABILITY_DUPLICATE_GOALS (1 << 18)
#define FLEETYARD_CAPABILITY_COLLIDING_PLANS (1 << 19)
#define FLEETYARD_CAPABILITY_K_ROBUST (1 << 20)
#define FLEETYARD_CAPABILITY_DETERMINISTIC (1 << 21)
#define FLEETYARD_CAPABILITY_THREADS (1 << 22)
#define FLEETYARD_CAPABILITY_IDLE (1 << 23)
#define FLEETYARD_CAPABILITY_HETEROGENEOUS (1 << 24)
#define FLEETYARD_MOVE_NORTH (1 << 0)
#define FLEETYARD_MOVE_EAST (1 << 1)
#define FLEETYARD_MOVE_SOUTH (1 << 2)
#define FLEETYARD_MOVE_WEST (1 << 3)
#define FLEETYARD_MOVE_NORTH_EAST (1 << 4)
#define FLEETYARD_MOVE_SOUTH_EAST (1 << 5)
#define FLEETYARD_MOVE_SOUTH_WEST (1 << 6)
#define FLEETYARD_MOVE_NORTH_WEST (1 << 7)
#define FLEETYARD_ROADMAP_SYMMETRIC (1 << 0)
#define FLEETYARD_ROBOT_HEADING (1 << 0)
#define FLEETYARD_ROBOT_POLAR_STATE (1 << 1)
#define FLEETYARD_ROBOT_POLAR_CONTROL (1 << 2)
#define FLEETYARD_INSTANCE_CYCLES (1 << 0)
#define FLEETYARD_INSTANCE_STRICT (1 << 1)
#define FLEETYARD_PART_CRITICAL (1 << 0)
#define FLEETYARD_PART_JSON (1 << 1)
#define FLEETYARD_OPTION_NUMBER 1
#define FLEETYARD_OPTION_TEXT 2
#define FLEETYARD_OPTION_FLAG 3
#define FLEETYARD_OPTION_JSON 4
#define FLEETYARD_LOG_ERROR 1
#define FLEETYARD_LOG_WARNING 2
#define FLEETYARD_LOG_INFO 3
#define FLEETYARD_LOG_DEBUG 4
typedef struct FleetyardStr {
  const char *ptr;
  size_t len;
} FleetyardStr;
typedef struct FleetyardPart {
  struct FleetyardStr id;
  const void *data;
  uint32_t flags;
  uint32_t reserved;
} FleetyardPart;
typedef struct FleetyardParts {
  const struct FleetyardPart *list;
  uint64_t count;
} FleetyardParts;
typedef struct FleetyardJson {
  uint32_t struct_size;
  uint32_t reserved;
  struct FleetyardStr text;
} FleetyardJson;
typedef struct FleetyardBudget {
  uint32_t struct_size;
  uint32_t threads;
  uint64_t deadline_monotonic_ns;
  uint64_t answer_by_ns;
  uint64_t wall_ns;
  uint64_t nodes;
  uint64_t memory_bytes;
  uint64_t seed;
  struct FleetyardParts parts;
} FleetyardBudget;
typedef struct FleetyardGrid {
  uint32_t struct_size;
  uint32_t rows;
  uint32_t cols;
  uint32_t connectivity;
  double cell_size_m;
  double step_s;
  double origin_x_m;
  double origin_y_m;
  const uint8_t *passable;
  const uint8_t *terrain;
  const uint8_t *moves;
} FleetyardGrid;
typedef struct FleetyardFootprint {
  uint32_t struct_size;
  uint32_t corners;
  double radius_m;
  const double *x_m;
  const double *y_m;
} FleetyardFootprint;
typedef struct FleetyardMover {
  uint32_t struct_size;
  uint32_t knots;
  const struct FleetyardFootprint *footprint;
  const double *time_s;
  const double *x_m;
  const double *y_m;
  const double *heading_rad;
} FleetyardMover;
typedef struct FleetyardWorkspace {
  uint32_t struct_size;
  uint32_t obstacles;
  double min_x_m;
  double min_y_m;
  double max_x_m;
  double max_y_m;
  const uint64_t *corner_offsets;
  const double *x_m;
  const double *y_m;
  const struct FleetyardMover *const *movers;
  uint64_t mover_count;
} FleetyardWorkspace;
typedef struct FleetyardRoadmap {
  uint32_t struct_size;
  uint32_t vertices;
  uint64_t edges;
  const double *x_m;
  const double *y_m;
  const uint64_t *edge_offsets;
  const uint32_t *targets;
  const double *length_m;
  const double *duration_s;
  double speed_m_per_s;
  double separation_m;
  const struct FleetyardWorkspace *workspace;
  uint32_t flags;
  uint32_t reserved;
} FleetyardRoadmap;
typedef struct FleetyardEnvironment {
  uint32_t struct_size;
  int32_t representation;
  const void *view;
  struct FleetyardStr name;
  struct FleetyardStr digest;
  struct FleetyardParts parts;
} FleetyardEnvironment;
typedef struct FleetyardRobot {
  uint32_t struct_size;
  uint32_t flags;
  struct FleetyardStr name;
  struct FleetyardStr dynamics;
  const struct FleetyardFootprint *footprint;
  uint32_t state_size;
  uint32_t control_size;
  uint32_t parameter_count;
  uint32_t reserved;
  const double *state_min;
  const double *state_max;
  const double *control_min;
  const double *control_max;
  const double *parameters;
} FleetyardRobot;
typedef struct FleetyardInstance {
  uint32_t struct_size;
  uint32_t agents;
  const struct FleetyardEnvironment *environment;
  const struct FleetyardRobot *const *robots;
  const uint32_t *robot_of;
  uint32_t robot_count;
  int32_t motion;
  int32_t objective;
  uint32_t flags;
  const uint32_t *starts;
  const int8_t *start_headings;
  const uint64_t *start_state_offsets;
  const double *start_states;
  const uint64_t *goal_offsets;
  const uint32_t *goals;
  const uint64_t *goal_state_offsets;
  const double *goal_states;
  uint32_t window_steps;
  uint32_t reserved;
  double window_s;
  double radius_m;
  double goal_tolerance_m;
  double goal_tolerance_rad;
  double goal_tolerance_rate;
  double dynamics_tolerance;
  struct FleetyardParts parts;
} FleetyardInstance;
typedef struct FleetyardPlan {
  uint32_t struct_size;
  uint32_t agents;
  int32_t form;
  uint32_t reserved;
  const uint64_t *offsets;
  const void *body;
  struct FleetyardParts parts;
} FleetyardPlan;
typedef struct FleetyardCells {
  uint32_t struct_size;
  uint32_t reserved;
  const uint32_t *cells;
} FleetyardCells;
typedef struct FleetyardVisits {
  uint32_t struct_size;
  uint32_t reserved;
  const uint32_t *vertices;
  const double *arrival_s;
  const double *departure_s;
} FleetyardVisits;
typedef struct FleetyardTrajectories {
  uint32_t struct_size;
  uint32_t reserved;
  const double *time_s;
  const double *x_m;
  const double *y_m;
  const double *heading_rad;
  const uint64_t *segment_offsets;
  const double *duration_s;
  const uint64_t *control_offsets;
  const double *controls;
} FleetyardTrajectories;
typedef struct FleetyardAssignment {
  uint64_t task;
  uint32_t agent;
  uint32_t reserved;
} FleetyardAssignment;
typedef struct FleetyardFleetState {
  uint32_t struct_size;
  uint32_t tasks;
  double time_s;
  const struct FleetyardInstance *next;
  const uint64_t *task_ids;
  const uint64_t *task_offsets;
  const uint32_t *task_places;
  const double *task_released_s;
  struct FleetyardParts parts;
} FleetyardFleetState;
typedef struct FleetyardRequest {
  uint32_t struct_size;
  uint32_t agents;
  const uint64_t *goal_offsets;
  const uint32_t *goals;
  const struct FleetyardAssignment *assignments;
  uint64_t assignment_count;
  uint32_t window_steps;
  uint32_t reserved;
  double window_s;
  struct FleetyardParts parts;
} FleetyardRequest;
typedef struct FleetyardSnapshot {
  uint32_t struct_size;
  uint32_t reserved;
  uint64_t number;
  const uint8_t *waiting;
  const uint8_t *flow;
} FleetyardSnapshot;
typedef struct FleetyardTraffic {
  uint32_t struct_size;
  uint32_t places;
  uint64_t flows;
  double period_s;
  double time_constant_s;
  double since_s;
  double flow_unit_per_s;
  const struct FleetyardSnapshot *last;
  const struct FleetyardSnapshot *before;
} FleetyardTraffic;
typedef struct FleetyardRestOfPlan {
  uint32_t struct_size;
  uint32_t agents;
  const uint64_t *offsets;
  const uint8_t *moves;
} FleetyardRestOfPlan;
typedef struct FleetyardGoalTasks {
  uint32_t struct_size;
  uint32_t reserved;
  uint64_t goals;
  double time_s;
  const uint64_t *tasks;
  const uint32_t *errands;
  const double *released_s;
  const double *given_s;
} FleetyardGoalTasks;
typedef struct FleetyardGuidance {
  uint32_t struct_size;
  uint32_t places;
  uint64_t move_count;
  const uint16_t *moves;
  const uint16_t *waits;
} FleetyardGuidance;
typedef struct FleetyardBytes {
  uint32_t struct_size;
  uint32_t reserved;
  const uint8_t *ptr;
  uint64_t len;
} FleetyardBytes;
typedef struct FleetyardKeep {
  uint32_t struct_size;
  uint32_t reserved;
  int32_t (*keep)(void *sink_context, const struct FleetyardBytes *bytes);
} FleetyardKeep;
typedef struct FleetyardFleetStatus {
  uint32_t struct_size;
  uint32_t agents;
  double time_s;
  double since_last_call_s;
  double planning_limit_s;
  double action_s;
  const uint32_t *actions_left;
  struct FleetyardParts parts;
} FleetyardFleetStatus;
typedef struct FleetyardSink {
  uint32_t struct_size;
  uint32_t reserved;
  void *context;
  int32_t (*submit_plan)(void *context, const struct FleetyardPlan *plan);
  int32_t (*submit_request)(void *context, const struct FleetyardRequest *request);
  int32_t (*cancelled)(void *context);
  uint64_t (*now_ns)(void *context);
  void (*fail)(void *context, struct FleetyardStr message);
  void (*log)(void *context, int32_t level, struct FleetyardStr text);
  void (*metric)(void *context, struct FleetyardStr name, double value);
  void (*note)(void *context, struct FleetyardStr name, struct FleetyardStr text);
  void (*progress)(void *context, uint64_t done, uint64_t total);
  const void *(*get_extension)(void *context, struct FleetyardStr id);
} FleetyardSink;
typedef struct FleetyardAnnotation {
  uint32_t struct_size;
  int32_t shape;
  struct FleetyardStr layer;
  struct FleetyardStr text;
  uint32_t agent;
  uint32_t count;
  double from_s;
  double to_s;
  const uint64_t *offsets;
  const double *x_m;
  const double *y_m;
  const uint32_t *places;
  const double *values;
} FleetyardAnnotation;
typedef struct FleetyardAnnotations {
  uint32_t struct_size;
  uint32_t reserved;
  int32_t (*annotate)(void *context, const struct FleetyardAnnotation *annotation);
} FleetyardAnnotations;
typedef struct FleetyardHost {
  uint32_t struct_size;
  uint16_t abi_major;
  uint16_t abi_minor;
  void *context;
  struct FleetyardStr name;
  struct FleetyardStr version;
  const void *(*get_extension)(void *context, struct FleetyardStr id);
} FleetyardHost;
typedef struct FleetyardPluginOption {
  struct FleetyardStr name;
  struct FleetyardStr text;
  double number;
  int32_t kind;
  uint32_t reserved;
} FleetyardPluginOption;
typedef struct FleetyardOptions {
  uint32_t struct_size;
  uint32_t count;
  const struct FleetyardPluginOption *list;
  struct FleetyardStr json;
} FleetyardOptions;
typedef struct FleetyardDescriptor {
  uint32_t struct_size;
  uint32_t feature_count;
  struct FleetyardStr id;
  struct FleetyardStr name;
  struct FleetyardStr version;
  struct FleetyardStr description;
  struct FleetyardStr license;
  struct FleetyardStr options_schema;
  uint64_t capabilities;
  const struct FleetyardStr *features;
} FleetyardDescriptor;
typedef struct FleetyardPlanner {
  uint32_t struct_size;
  uint32_t reserved;
  void *context;
  int32_t (*prepare)(void *context,
                     const struct FleetyardEnvironment *environment,
                     const struct FleetyardBudget *budget,
                     const struct FleetyardSink *sink);
  int32_t (*plan)(void *context,
                  const struct FleetyardInstance *instance,
                  const struct FleetyardBudget *budget,
                  const struct FleetyardSink *sink);
  void (*destroy)(void *context);
  const void *(*get_extension)(void *context, struct FleetyardStr id);
} FleetyardPlanner;
typedef struct FleetyardFailPolicy {
  uint32_t struct_size;
  uint32_t reserved;
  void *context;
  int32_t (*prepare)(void *context,
                     const struct FleetyardEnvironment *environment,
                     const struct FleetyardBudget *budget,
                     const struct FleetyardSink *sink);
  int32_t (*recover)(void *context,
                     const struct FleetyardInstance *instance,
                     const struct FleetyardPlan *failed_plan,
                     const struct FleetyardBudget *budget,
                     const struct FleetyardSink *sink);
  void (*destroy)(void *context);
  const void *(*get_extension)(void *context, struct FleetyardStr id);
} FleetyardFailPolicy;
typedef struct FleetyardInstanceGenerator {
  uint32_t struct_size;
  uint32_t reserved;
  void *context;
  int32_t (*prepare)(void *context,
                     const struct FleetyardEnvironment *environment,
                     const struct FleetyardBudget *budget,
                     const struct FleetyardSink *sink);
  int32_t (*generate)(void *context,
                      const struct FleetyardFleetState *state,
                      const struct FleetyardBudget *budget,
                      const struct FleetyardSink *sink);
  void (*destroy)(void *context);
  const void *(*get_extension)(void *context, struct FleetyardStr id);
} FleetyardInstanceGenerator;
typedef struct FleetyardInvocationPolicy {
  uint32_t struct_size;
  uint32_t reserved;
  void *context;
  int32_t (*should_invoke)(void *context,
                           const struct FleetyardFleetStatus *status,
                           const struct FleetyardSink *sink,
                           int32_t *out);
  void (*destroy)(void *context);
  const void *(*get_extension)(void *context, struct FleetyardStr id);
} FleetyardInvocationPolicy;
typedef struct FleetyardPlannerFactory {
  uint32_t struct_size;
  uint32_t reserved;
  void *context;
  uint32_t (*count)(void *context);
  const struct FleetyardDescriptor *(*descriptor)(void *context, uint32_t index);
  int32_t (*create)(void *context,
                    uint32_t index,
                    const struct FleetyardOptions *options,
                    const struct FleetyardSink *sink,
                    struct FleetyardPlanner *out);
} FleetyardPlannerFactory;
typedef struct FleetyardFailPolicyFactory {
  uint32_t struct_size;
  uint32_t reserved;
  void *context;
  uint32_t (*count)(void *context);
  const struct FleetyardDescriptor *(*descriptor)(void *context, uint32_t index);
  int32_t (*create)(void *context,
                    uint32_t index,
                    const struct FleetyardOptions *options,
                    const struct FleetyardSink *sink,
                    struct FleetyardFailPolicy *out);
} FleetyardFailPolicyFactory;
typedef struct FleetyardInstanceGeneratorFactory {
  uint32_t struct_size;
  uint32_t reserved;
  void *context;
  uint32_t (*count)(void *context);
  const struct FleetyardDescriptor *(*descriptor)(void *context, uint32_t index);
  int32_t (*create)(void *context,
                    uint32_t index,
                    const struct FleetyardOptions *options,
                    const struct FleetyardSink *sink,
                    struct FleetyardInstanceGenerator *out);
} FleetyardInstanceGeneratorFactory;
typedef struct FleetyardInvocationPolicyFactory {
  uint32_t struct_size;
  uint32_t reserved;
  void *context;
  uint32_t (*count)(void *context);
  const struct FleetyardDescriptor *(*descriptor)(void *context, uint32_t index);
  int32_t (*create)(void *context,
                    uint32_t index,
                    const struct FleetyardOptions *options,
                    const struct FleetyardSink *sink,
                    struct FleetyardInvocationPolicy *out);
} FleetyardInvocationPolicyFactory;
typedef struct FleetyardPluginEntry {
  uint32_t struct_size;
  uint16_t abi_major;
  uint16_t abi_minor;
  int32_t (*init)(const struct FleetyardHost *host, struct FleetyardStr path);
  void (*deinit)(void);
  const void *(*get_factory)(struct FleetyardStr id);
} FleetyardPluginEntry;
#endif
#ifdef __cplusplus
extern "C" {
#endif
extern FLEETYARD_EXPORT const FleetyardPluginEntry fleetyard_plugin_entry_v1;
#ifdef __cplusplus
}
#endif
