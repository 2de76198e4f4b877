/* An instance generator in one C file: an agent without a goal gets the first open task
 * that it can reach, in the order in which tasks were released.
 *
 * An agent that is left without a task stays where it is. Agents may share a goal, which the planner
 * has to be able to deal with.
 *
 * Build: cc -std=c11 -O2 -fPIC -shared -fvisibility=hidden -I ABI/include
 *        -o first_task.so first_task.c
 */

#include "fleetyard.h"

#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#define NONE UINT32_MAX
#define TEXT(literal) {(const uint8_t *)(literal), sizeof(literal) - 1}

static int32_t fail(const FleetyardSink *sink, int32_t status, const char *message) {
  sink->fail(sink->context, (FleetyardStr){(const uint8_t *)message, strlen(message)});
  return status;
}

/* ---- The generator ----------------------------------------------------------- */

typedef struct {
  uint32_t *region; /* per cell the number of the region that is connected; NONE if blocked */
} Generator;

/* Moves past corners lead nowhere that straight ones do not: both cells at the side of a
 * diagonal move are free. So four neighbours make the regions of eight. */
static void fill(uint32_t *region, uint32_t *stack, const FleetyardGrid *grid, uint32_t cell) {
  size_t height = 0;
  uint32_t cols = grid->cols, cells = grid->rows * cols, number = cell;
  region[cell] = number;
  for (stack[height++] = cell; height > 0;) {
    cell = stack[--height];
    uint32_t near[4] = {
        cell >= cols ? cell - cols : NONE,
        cell % cols + 1 < cols ? cell + 1 : NONE,
        cell + cols < cells ? cell + cols : NONE,
        cell % cols > 0 ? cell - 1 : NONE,
    };
    for (int i = 0; i < 4; i++)
      if (near[i] != NONE && grid->passable[near[i]] && region[near[i]] == NONE) {
        region[near[i]] = number;
        stack[height++] = near[i];
      }
  }
}

static int32_t prepare(void *context, const FleetyardEnvironment *environment,
                       const FleetyardBudget *budget, const FleetyardSink *sink) {
  Generator *generator = context;
  (void)budget; /* a few milliseconds for the largest maps */
  if (environment->representation != FLEETYARD_REPRESENTATION_GRID)
    return fail(sink, FLEETYARD_STATUS_UNSUPPORTED, "this generator knows grids only");
  const FleetyardGrid *grid = environment->view;
  uint64_t cells = (uint64_t)grid->rows * grid->cols;
  if (cells == 0 || cells >= NONE)
    return fail(sink, FLEETYARD_STATUS_UNSUPPORTED, "the map has no cells or too many");
  uint32_t *region = malloc((size_t)cells * sizeof *region);
  uint32_t *stack = malloc((size_t)cells * sizeof *stack);
  if (!region || !stack) {
    free(region);
    free(stack);
    return fail(sink, FLEETYARD_STATUS_INTERNAL_ERROR, "out of memory");
  }
  memset(region, 0xFF, (size_t)cells * sizeof *region);
  for (uint32_t cell = 0; cell < cells; cell++)
    if (grid->passable[cell] && region[cell] == NONE)
      fill(region, stack, grid, cell);
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
    return fail(sink, FLEETYARD_STATUS_INVALID_INPUT, "`generate` came before `prepare`");

  /* Every goal and every task once, and a cell for who has neither. */
  size_t most = (size_t)state->goal_offsets[agents] + agents;
  if (state->tasks > 0)
    most += (size_t)state->task_offsets[state->tasks];
  uint64_t *offsets = malloc(((size_t)agents + 1) * sizeof *offsets);
  uint32_t *goals = malloc(most * sizeof *goals);
  uint8_t *given = calloc((size_t)state->tasks + 1, 1);
  FleetyardAssignment *assignments = calloc((size_t)state->tasks + 1, sizeof *assignments);
  uint32_t assigned = 0;
  if (!offsets || !goals || !given || !assignments) {
    status = fail(sink, FLEETYARD_STATUS_INTERNAL_ERROR, "out of memory");
    goto end;
  }
  uint64_t used = 0;
  for (uint32_t agent = 0; agent < agents; agent++) {
    offsets[agent] = used;
    for (uint64_t i = state->goal_offsets[agent]; i < state->goal_offsets[agent + 1]; i++)
      goals[used++] = state->goals[i];
    for (uint32_t task = 0; task < state->tasks && used == offsets[agent]; task++)
      if (!given[task] && can_reach(generator, state, agent, task)) {
        given[task] = 1;
        assignments[assigned++] =
            (FleetyardAssignment){.task = state->task_ids[task], .agent = agent};
        for (uint64_t i = state->task_offsets[task]; i < state->task_offsets[task + 1]; i++)
          goals[used++] = state->task_cells[i];
      }
    if (used == offsets[agent])
      goals[used++] = state->cells[agent];
    if (agent % 64 == 0 && sink->cancelled(sink->context)) {
      status = fail(sink, FLEETYARD_STATUS_TIMED_OUT, "the call's time is up");
      goto end;
    }
  }
  offsets[agents] = used;
  FleetyardInstance instance = {
      .struct_size = sizeof instance,
      .agents = agents,
      .starts = state->cells,
      .headings = state->headings,
      .goal_offsets = offsets,
      .goals = goals,
      .motion = state->motion,
      .objective = state->objective,
      .window_steps = state->window_steps,
      .allows_cycles = state->allows_cycles,
      .radius_m = state->radius_m,
      .assignments_count = assigned,
      .assignments = assignments,
  };
  sink->submit_instance(sink->context, &instance);

end:
  free(offsets);
  free(goals);
  free(given);
  free(assignments);
  return status;
}

static void destroy(void *context) {
  Generator *generator = context;
  free(generator->region);
  free(generator);
}

/* ---- What the library exports ------------------------------------------------ */

static const FleetyardDescriptor first_task = {
    .struct_size = sizeof(FleetyardDescriptor),
    .id = TEXT("first-task"),
    .name = TEXT("First task (C example)"),
    .version = TEXT("0.1.0"),
    .description = TEXT("Gives every idle agent the first open task that it can reach."),
    .license = TEXT("MIT OR Apache-2.0"),
    .capabilities = FLEETYARD_CAPABILITY_GRID | FLEETYARD_CAPABILITY_EIGHT_CONNECTED |
                    FLEETYARD_CAPABILITY_PEBBLE | FLEETYARD_CAPABILITY_ROTATION |
                    FLEETYARD_CAPABILITY_WINDOWED | FLEETYARD_CAPABILITY_DUPLICATE_GOALS |
                    FLEETYARD_CAPABILITY_DETERMINISTIC,
};

static uint32_t count(void) { return 1; }

static const FleetyardDescriptor *descriptor(uint32_t index) {
  return index == 0 ? &first_task : NULL;
}

static int32_t create(uint32_t index, FleetyardStr options, const FleetyardSink *sink,
                      FleetyardInstanceGenerator *out) {
  /* An object with a member has a colon; the host lets no option through without a schema. */
  if (index != 0 || (options.len != 0 && memchr(options.ptr, ':', options.len)))
    return fail(sink, FLEETYARD_STATUS_INVALID_INPUT, "this generator has no options");
  Generator *generator = calloc(1, sizeof *generator);
  if (!generator)
    return fail(sink, FLEETYARD_STATUS_INTERNAL_ERROR, "out of memory");
  *out = (FleetyardInstanceGenerator){
      .struct_size = sizeof *out,
      .context = generator,
      .prepare = prepare,
      .generate = generate,
      .destroy = destroy,
  };
  return FLEETYARD_STATUS_SOLVED;
}

static const FleetyardInstanceGeneratorFactory factory = {
    .struct_size = sizeof(FleetyardInstanceGeneratorFactory),
    .count = count,
    .descriptor = descriptor,
    .create = create,
};

static const void *get_factory(FleetyardStr id) {
  static const char own[] = FLEETYARD_INSTANCE_GENERATOR_FACTORY_ID;
  return id.len == sizeof own - 1 && memcmp(id.ptr, own, id.len) == 0 ? &factory : NULL;
}

const FleetyardPluginEntry fleetyard_plugin_entry_v1 = {
    .struct_size = sizeof(FleetyardPluginEntry),
    .abi_major = FLEETYARD_ABI_MAJOR,
    .abi_minor = FLEETYARD_ABI_MINOR,
    .get_factory = get_factory,
};
