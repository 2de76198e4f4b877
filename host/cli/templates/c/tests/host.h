/* Stands for the host in tests: a sink that keeps the last answer as text. */

#include "fleetyard.h"

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

/* The last plan or instance: "0 1 2, 5 4 3" for the cells of two agents. */
static char answer[1000];

static inline FleetyardStr text(const char *bytes) {
  return (FleetyardStr){(const uint8_t *)bytes, strlen(bytes)};
}

static int32_t keep(uint32_t agents, const uint64_t *offsets, const uint32_t *cells) {
  char *end = answer;
  for (uint32_t agent = 0; agent < agents; agent++) {
    end += sprintf(end, "%s", agent > 0 ? "," : "");
    for (uint64_t i = offsets[agent]; i < offsets[agent + 1]; i++)
      end += sprintf(end, "%s%u", end > answer ? " " : "", (unsigned)cells[i]);
  }
  return FLEETYARD_OK;
}

static int32_t submit_plan(void *context, const FleetyardPlan *plan) {
  (void)context;
  return keep(plan->agents, plan->offsets, plan->cells);
}

static int32_t submit_instance(void *context, const FleetyardInstance *instance) {
  (void)context;
  return keep(instance->agents, instance->goal_offsets, instance->goals);
}

static void metric(void *context, FleetyardStr name, double value) {
  (void)context;
  printf("%.*s = %g\n", (int)name.len, (const char *)name.ptr, value);
}

static void log_line(void *context, int32_t level, FleetyardStr line) {
  (void)context;
  printf("log %d: %.*s\n", (int)level, (int)line.len, (const char *)line.ptr);
}

static void progress(void *context, uint64_t done, uint64_t total) {
  (void)context;
  (void)done;
  (void)total;
}

static int32_t cancelled(void *context) {
  (void)context;
  return 0;
}

static void explain(void *context, FleetyardStr message) {
  (void)context;
  printf("%.*s\n", (int)message.len, (const char *)message.ptr);
}

static const FleetyardSink sink = {sizeof sink, 0,        NULL,     submit_plan, submit_instance,
                                   metric,      log_line, progress, cancelled,   explain};

/* A map of rows, `.` where a robot may stand, for as long as the map stays. */
static inline FleetyardEnvironment environment_of(FleetyardGrid *grid, uint32_t rows,
                                                  const char *map) {
  static uint8_t passable[100];
  uint32_t cells = (uint32_t)strlen(map);
  for (uint32_t cell = 0; cell < cells; cell++)
    passable[cell] = map[cell] == '.';
  *grid = (FleetyardGrid){sizeof *grid, rows, cells / rows,          4, 1.0, 1.0,
                          passable,     (const uint8_t *)map};
  return (FleetyardEnvironment){sizeof(FleetyardEnvironment), FLEETYARD_REPRESENTATION_GRID,
                                text("test"), grid};
}

static const FleetyardBudget budget = {
    .struct_size = sizeof budget,
    .threads = 1,
    .deadline_monotonic_ns = UINT64_MAX,
    .wall_ns = UINT64_MAX,
    .seed = 1,
};
