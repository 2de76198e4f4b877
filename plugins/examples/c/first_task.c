/* An instance generator in one C file: an agent without a goal gets the first open task
 * that it can reach, in the order in which tasks were released.
 *
 * An agent that is left without a task stays where it is. Agents may share a goal, which the planner
 * has to be able to deal with.
 *
 * Build: cc -std=c11 -O2 -fPIC -shared -fvisibility=hidden -I ABI/include
 *        -o first_task.so first_task.c
 */

#include "fleetyard_easy.h"

#define NONE FLEETYARD_NONE

typedef struct {
  FleetyardMap map;
  uint32_t *region; /* per cell the first cell of the region that is connected; NONE if blocked */
} Generator;

/* Moves past corners lead nowhere that straight ones do not: both cells at the side of a
 * diagonal move are free. So four neighbours make the regions of eight. */
static void fill(const FleetyardMap *map, uint32_t *region, uint32_t *stack, uint32_t first) {
  size_t height = 0;
  region[first] = first;
  for (stack[height++] = first; height > 0;) {
    const uint32_t *near = map->neighbours[stack[--height]];
    for (int i = 0; i < 4; i++)
      if (near[i] != NONE && region[near[i]] == NONE) {
        region[near[i]] = first;
        stack[height++] = near[i];
      }
  }
}

static int32_t prepare(void *context, const FleetyardEnvironment *environment,
                       const FleetyardBudget *budget, const FleetyardSink *sink) {
  Generator *generator = context;
  const FleetyardMap *map = &generator->map;
  (void)budget; /* a few milliseconds for the largest maps */
  int32_t status = fleetyard_learn(&generator->map, environment, sink);
  if (status != FLEETYARD_STATUS_SOLVED)
    return status;
  uint32_t *region = fleetyard_array(map->cells, sizeof *region);
  uint32_t *stack = fleetyard_array(map->cells, sizeof *stack);
  memset(region, 0xFF, map->cells * sizeof *region);
  for (uint32_t cell = 0; cell < map->cells; cell++)
    if (map->passable[cell] && region[cell] == NONE)
      fill(map, region, stack, cell);
  free(stack);
  free(generator->region);
  generator->region = region;
  return FLEETYARD_STATUS_SOLVED;
}

static bool can_reach(const Generator *generator, const FleetyardFleetState *state,
                      uint32_t agent, uint32_t task) {
  uint32_t home = generator->region[state->cells[agent]];
  uint64_t begin = state->task_offsets[task], end = state->task_offsets[task + 1];
  bool all = home != NONE && begin < end;
  for (uint64_t i = begin; i < end; i++)
    all = all && generator->region[state->task_cells[i]] == home;
  return all;
}

static int32_t generate(void *context, const FleetyardFleetState *state,
                        const FleetyardBudget *budget, const FleetyardSink *sink) {
  const Generator *generator = context;
  uint32_t agents = state->agents;
  int32_t status = FLEETYARD_STATUS_SOLVED;
  (void)budget;
  if (!generator->region)
    return fleetyard_fail(sink, FLEETYARD_STATUS_INVALID_INPUT,
                          "`generate` came before `prepare`");

  FleetyardLists goals = {0};
  bool *given = fleetyard_array(state->tasks, sizeof *given);
  FleetyardAssignment *assignments = fleetyard_array(state->tasks, sizeof *assignments);
  uint32_t assigned = 0;
  for (uint32_t agent = 0; agent < agents; agent++) {
    uint64_t begin = state->goal_offsets[agent], end = state->goal_offsets[agent + 1];
    fleetyard_append_all(&goals, state->goals + begin, end - begin);
    for (uint32_t task = 0; task < state->tasks && begin == end; task++)
      if (!given[task] && can_reach(generator, state, agent, task)) {
        given[task] = true;
        assignments[assigned++] =
            (FleetyardAssignment){.task = state->task_ids[task], .agent = agent};
        begin = state->task_offsets[task], end = state->task_offsets[task + 1];
        fleetyard_append_all(&goals, state->task_cells + begin, end - begin);
      }
    if (begin == end)
      fleetyard_append(&goals, state->cells[agent]);
    fleetyard_end_list(&goals);
    if (agent % 64 == 0 && fleetyard_cancelled(sink)) {
      fleetyard_free_lists(&goals);
      status = fleetyard_fail(sink, FLEETYARD_STATUS_TIMED_OUT, "the call's time is up");
      break;
    }
  }
  if (status == FLEETYARD_STATUS_SOLVED)
    status = fleetyard_submit_instance(state, &goals, assignments, assigned, sink);
  free(given);
  free(assignments);
  return status;
}

static void destroy(void *context) {
  free(((Generator *)context)->region);
  fleetyard_destroy(context);
}

/* ---- What the library exports ------------------------------------------------ */

static const FleetyardDescriptor first_task = {
    .struct_size = sizeof(FleetyardDescriptor),
    .id = FLEETYARD_TEXT("first-task"),
    .name = FLEETYARD_TEXT("First task (C example)"),
    .version = FLEETYARD_TEXT("0.1.0"),
    .description =
        FLEETYARD_TEXT("Gives every idle agent the first open task that it can reach."),
    .license = FLEETYARD_TEXT("MIT OR Apache-2.0"),
    .capabilities = FLEETYARD_CAPABILITY_GRID | FLEETYARD_CAPABILITY_EIGHT_CONNECTED |
                    FLEETYARD_CAPABILITY_PEBBLE | FLEETYARD_CAPABILITY_ROTATION |
                    FLEETYARD_CAPABILITY_WINDOWED | FLEETYARD_CAPABILITY_DUPLICATE_GOALS |
                    FLEETYARD_CAPABILITY_DETERMINISTIC,
};

static int32_t create(FleetyardStr options, const FleetyardSink *sink,
                      FleetyardInstanceGenerator *out) {
  int32_t status = fleetyard_no_options(NULL, options, sink);
  if (status != FLEETYARD_STATUS_SOLVED)
    return status;
  out->context = fleetyard_array(1, sizeof(Generator));
  out->prepare = prepare;
  out->generate = generate;
  out->destroy = destroy;
  return status;
}

FLEETYARD_LIBRARY(InstanceGenerator, FLEETYARD_INSTANCE_GENERATOR_FACTORY_ID, first_task, create);
