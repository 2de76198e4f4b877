/* Stands for the host in tests: a sink that keeps the last answer as text, and maps. */

#include "fleetyard.h"

#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Ends the test when a condition does not hold. */
#define CHECK(condition)                                                   \
  do {                                                                     \
    if (!(condition)) {                                                    \
      fprintf(stderr, "%s:%d: %s\n", __FILE__, __LINE__, #condition);      \
      exit(1);                                                             \
    }                                                                      \
  } while (0)

/* The last answer: "0 1 2, 5 4 3" for the cells or goals of two agents, "0@0-1.5 1@3" for visits
 * with their times, and "0:(1 1) 2:(3 1)" for knots. */
static char answer[1000];

static inline FleetyardStr text(const char *bytes) {
  return (FleetyardStr){bytes, strlen(bytes)};
}

/* Begins the answer for an entry of an agent; where to write it. */
static char *entry(char *end, uint32_t agent, int first) {
  return end + sprintf(end, "%s%s", first && agent > 0 ? "," : "", end > answer ? " " : "");
}

static int32_t keep(uint32_t agents, const uint64_t *offsets, const uint32_t *places) {
  char *end = answer;
  *end = 0;
  for (uint32_t agent = 0; agent < agents; agent++)
    for (uint64_t i = offsets[agent]; i < offsets[agent + 1]; i++) {
      end = entry(end, agent, i == offsets[agent]);
      end += sprintf(end, "%u", (unsigned)places[i]);
    }
  return FLEETYARD_OK;
}

static int32_t submit_plan(void *context, const FleetyardPlan *plan) {
  const FleetyardVisits *visits = plan->body;
  const FleetyardTrajectories *knots = plan->body;
  char *end = answer;
  (void)context;
  if (plan->form == FLEETYARD_FORM_CELLS)
    return keep(plan->agents, plan->offsets, ((const FleetyardCells *)plan->body)->cells);
  for (uint32_t agent = 0; agent < plan->agents; agent++)
    for (uint64_t i = plan->offsets[agent]; i < plan->offsets[agent + 1]; i++) {
      end = entry(end, agent, i == plan->offsets[agent]);
      if (plan->form == FLEETYARD_FORM_TRAJECTORIES)
        end += sprintf(end, "%.2g:(%.2g %.2g)", knots->time_s[i], knots->x_m[i], knots->y_m[i]);
      else if (visits->departure_s[i] > visits->arrival_s[i])
        end += sprintf(end, "%u@%g-%g", (unsigned)visits->vertices[i], visits->arrival_s[i],
                       visits->departure_s[i]);
      else
        end += sprintf(end, "%u@%g", (unsigned)visits->vertices[i], visits->arrival_s[i]);
    }
  return FLEETYARD_OK;
}

static int32_t submit_request(void *context, const FleetyardRequest *request) {
  (void)context;
  return keep(request->agents, request->goal_offsets, request->goals);
}

static int32_t cancelled(void *context) {
  (void)context;
  return 0;
}

static uint64_t now_ns(void *context) {
  (void)context;
  return 0;
}

static void explain(void *context, FleetyardStr message) {
  (void)context;
  printf("%.*s\n", (int)message.len, message.ptr);
}

static void log_line(void *context, int32_t level, FleetyardStr line) {
  (void)context;
  printf("log %d: %.*s\n", (int)level, (int)line.len, line.ptr);
}

static void metric(void *context, FleetyardStr name, double value) {
  (void)context;
  printf("%.*s = %g\n", (int)name.len, name.ptr, value);
}

static void note(void *context, FleetyardStr name, FleetyardStr value) {
  (void)context;
  printf("%.*s: %.*s\n", (int)name.len, name.ptr, (int)value.len, value.ptr);
}

static void progress(void *context, uint64_t done, uint64_t total) {
  (void)context;
  (void)done;
  (void)total;
}

static const void *no_extension(void *context, FleetyardStr id) {
  (void)context;
  (void)id;
  return NULL;
}

static const FleetyardSink sink = {
    .struct_size = sizeof sink,
    .submit_plan = submit_plan,
    .submit_request = submit_request,
    .cancelled = cancelled,
    .now_ns = now_ns,
    .fail = explain,
    .log = log_line,
    .metric = metric,
    .note = note,
    .progress = progress,
    .get_extension = no_extension,
};

static const FleetyardBudget budget = {
    .struct_size = sizeof budget,
    .threads = 1,
    .deadline_monotonic_ns = UINT64_MAX,
    .answer_by_ns = UINT64_MAX,
    .wall_ns = UINT64_MAX,
    .seed = 1,
};

/* The plugin's factory, which is that of its kind. */
static inline const void *factory_of(const char *id) {
  const void *factory = fleetyard_plugin_entry_v1.get_factory(text(id));
  CHECK(factory);
  return factory;
}

/* A table of one option, for as long as the next one is not made. */
static inline const FleetyardOptions *number_option(const char *name, double value) {
  static FleetyardPluginOption option;
  static FleetyardOptions options;
  option = (FleetyardPluginOption){
      .name = text(name), .number = value, .kind = FLEETYARD_OPTION_NUMBER};
  options = (FleetyardOptions){sizeof options, 1, &option, text("")};
  return &options;
}

/* A map of rows, `.` where a robot may stand, for as long as no other one is made. */
static inline const FleetyardEnvironment *map_of(uint32_t rows, const char *letters) {
  static uint8_t passable[100], moves[100];
  static FleetyardGrid grid;
  static FleetyardEnvironment environment;
  uint32_t cells = (uint32_t)strlen(letters), cols = cells / rows;
  for (uint32_t cell = 0; cell < cells; cell++)
    passable[cell] = letters[cell] == '.';
  for (uint32_t cell = 0; cell < cells; cell++) {
    uint32_t row = cell / cols, col = cell % cols;
    moves[cell] = 0;
    if (passable[cell] && row > 0 && passable[cell - cols])
      moves[cell] |= FLEETYARD_MOVE_NORTH;
    if (passable[cell] && col + 1 < cols && passable[cell + 1])
      moves[cell] |= FLEETYARD_MOVE_EAST;
    if (passable[cell] && row + 1 < rows && passable[cell + cols])
      moves[cell] |= FLEETYARD_MOVE_SOUTH;
    if (passable[cell] && col > 0 && passable[cell - 1])
      moves[cell] |= FLEETYARD_MOVE_WEST;
  }
  grid = (FleetyardGrid){.struct_size = sizeof grid,
                         .rows = rows,
                         .cols = cols,
                         .connectivity = 4,
                         .cell_size_m = 1.0,
                         .step_s = 1.0,
                         .passable = passable,
                         .terrain = (const uint8_t *)letters,
                         .moves = moves};
  environment = (FleetyardEnvironment){.struct_size = sizeof environment,
                                       .representation = FLEETYARD_REPRESENTATION_GRID,
                                       .view = &grid,
                                       .name = text("test")};
  return &environment;
}

/* An instance with a goal for each agent. */
static inline FleetyardInstance instance_of(const FleetyardEnvironment *environment,
                                            int32_t motion, uint32_t agents,
                                            const uint32_t *starts, const uint32_t *goals) {
  static const uint64_t offsets[] = {0, 1, 2, 3, 4};
  return (FleetyardInstance){.struct_size = sizeof(FleetyardInstance),
                             .agents = agents,
                             .environment = environment,
                             .motion = motion,
                             .objective = FLEETYARD_OBJECTIVE_SUM_OF_COSTS,
                             .starts = starts,
                             .goal_offsets = offsets,
                             .goals = goals};
}

/* Makes a planner, asks it about an instance, and ends it. */
static inline int32_t ask(const FleetyardInstance *instance, const FleetyardOptions *options) {
  const FleetyardPlannerFactory *factory = factory_of(FLEETYARD_PLANNER_FACTORY_ID);
  FleetyardPlanner planner = {.struct_size = sizeof planner};
  int32_t status = factory->create(factory->context, 0, options, &sink, &planner);
  CHECK(status == FLEETYARD_STATUS_SOLVED);
  status = planner.prepare(planner.context, instance->environment, &budget, &sink);
  if (status == FLEETYARD_STATUS_SOLVED)
    status = planner.plan(planner.context, instance, &budget, &sink);
  planner.destroy(planner.context);
  return status;
}
