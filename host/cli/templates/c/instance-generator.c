/* Gives each open task to the nearest agent that has nothing to do; the rest wait.
 *
 * Tasks are given away in the order in which they came. Put your own rule into `generate`.
 */

#include "fleetyard.h"

#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define NONE UINT32_MAX
#define TEXT(literal) {(const uint8_t *)(literal), sizeof(literal) - 1}

typedef struct {
  uint32_t most_tasks;
  uint32_t rows, cols;
  uint8_t *passable;
} Generator;

/* Zeroed memory. Without any left the process ends, which is the plugin's own. */
static void *array(size_t count, size_t size) {
  void *memory = calloc(count, size);
  if (!memory)
    abort();
  return memory;
}

/* Explains a status and returns it. */
static int32_t fail(const FleetyardSink *sink, int32_t status, const char *why) {
  sink->fail(sink->context, (FleetyardStr){(const uint8_t *)why, strlen(why)});
  return status;
}

/* ---- The algorithm --------------------------------------------------------- */

static int32_t prepare(void *context, const FleetyardEnvironment *environment,
                       const FleetyardBudget *budget, const FleetyardSink *sink) {
  Generator *generator = context;
  (void)budget;
  if (environment->representation != FLEETYARD_REPRESENTATION_GRID)
    return fail(sink, FLEETYARD_STATUS_UNSUPPORTED, "this generator knows grids only");
  const FleetyardGrid *grid = environment->view;
  size_t cells = (size_t)grid->rows * grid->cols;
  free(generator->passable);
  generator->rows = grid->rows;
  generator->cols = grid->cols;
  generator->passable = memcpy(array(cells, 1), grid->passable, cells);
  return FLEETYARD_STATUS_SOLVED;
}

/* The cells that one can reach from a cell, nearest first, and how many they are.
 * `distance` gets the steps to each, NONE for the others. */
static uint32_t spread(const Generator *generator, uint32_t from, uint32_t *distance,
                       uint32_t *queue) {
  uint32_t rows = generator->rows, cols = generator->cols, tail = 1;
  memset(distance, 0xFF, (size_t)rows * cols * sizeof *distance);
  distance[from] = 0;
  queue[0] = from;
  for (uint32_t head = 0; head < tail; head++) {
    uint32_t cell = queue[head], row = cell / cols, col = cell % cols;
    uint32_t near[4] = {row > 0 ? cell - cols : NONE, col + 1 < cols ? cell + 1 : NONE,
                        row + 1 < rows ? cell + cols : NONE, col > 0 ? cell - 1 : NONE};
    for (int i = 0; i < 4; i++)
      if (near[i] != NONE && generator->passable[near[i]] && distance[near[i]] == NONE) {
        distance[near[i]] = distance[cell] + 1;
        queue[tail++] = near[i];
      }
  }
  return tail;
}

/* The goals of an agent: what it has to do already, a task, or a place to wait. */
typedef struct {
  const uint32_t *cells;
  uint64_t length;
  uint32_t wait;
} Goals;

static int32_t generate(void *context, const FleetyardFleetState *state,
                        const FleetyardBudget *budget, const FleetyardSink *sink) {
  const Generator *generator = context;
  uint32_t agents = state->agents, cells = generator->rows * generator->cols;
  uint32_t tasks = state->tasks < generator->most_tasks ? state->tasks : generator->most_tasks;
  uint32_t *distance = array(cells, sizeof *distance), *queue = array(cells, sizeof *queue);
  bool *taken = array(cells, sizeof *taken); /* two agents cannot end in the same cell */
  Goals *goals = array(agents, sizeof *goals);
  uint64_t *offsets = array((size_t)agents + 1, sizeof *offsets);
  /* What the host is told of tasks: it appends their cells to the goals of the agents. */
  FleetyardAssignment *assignments = array((size_t)tasks + 1, sizeof *assignments);
  uint32_t assigned = 0;
  uint32_t *flat = NULL;
  int32_t status = FLEETYARD_STATUS_SOLVED;
  (void)budget; /* `cancelled` says when the time is up */

  for (uint32_t agent = 0; agent < agents; agent++) {
    uint64_t begin = state->goal_offsets[agent];
    goals[agent] = (Goals){state->goals + begin, state->goal_offsets[agent + 1] - begin, 0};
    if (goals[agent].length > 0)
      taken[goals[agent].cells[goals[agent].length - 1]] = true;
  }
  for (uint32_t task = 0; task < tasks && !sink->cancelled(sink->context); task++) {
    const uint32_t *visits = state->task_cells + state->task_offsets[task];
    uint64_t length = state->task_offsets[task + 1] - state->task_offsets[task];
    if (length == 0 || taken[visits[length - 1]])
      continue;
    spread(generator, visits[0], distance, queue);
    bool reachable = true;
    for (uint64_t i = 0; i < length; i++)
      reachable = reachable && distance[visits[i]] != NONE;
    uint32_t nearest = NONE;
    for (uint32_t agent = 0; agent < agents && reachable; agent++)
      if (goals[agent].length == 0 && distance[state->cells[agent]] != NONE &&
          (nearest == NONE ||
           distance[state->cells[agent]] < distance[state->cells[nearest]]))
        nearest = agent;
    if (nearest != NONE) {
      goals[nearest] = (Goals){visits, length, 0};
      taken[visits[length - 1]] = true;
      assignments[assigned++] =
          (FleetyardAssignment){.task = state->task_ids[task], .agent = nearest};
    }
  }
  /* Who has nothing to do waits in the nearest cell where nobody ends. */
  for (uint32_t agent = 0; agent < agents; agent++)
    if (goals[agent].length == 0) {
      uint32_t near = 0, reach = spread(generator, state->cells[agent], distance, queue);
      while (near < reach && taken[queue[near]])
        near++;
      if (near == reach) {
        status = fail(sink, FLEETYARD_STATUS_GAVE_UP, "no cell is left for an agent to wait in");
        goto end;
      }
      goals[agent] = (Goals){&goals[agent].wait, 1, queue[near]};
      taken[queue[near]] = true;
    }

  for (uint32_t agent = 0; agent < agents; agent++)
    offsets[agent + 1] = offsets[agent] + goals[agent].length;
  flat = array(offsets[agents], sizeof *flat);
  for (uint32_t agent = 0; agent < agents; agent++)
    memcpy(flat + offsets[agent], goals[agent].cells, goals[agent].length * sizeof *flat);
  FleetyardInstance instance = {
      .struct_size = sizeof instance,
      .agents = agents,
      .starts = state->cells,
      .headings = state->headings,
      .goal_offsets = offsets,
      .goals = flat,
      .motion = state->motion,
      .objective = state->objective,
      .window_steps = state->window_steps,
      .allows_cycles = state->allows_cycles,
      .radius_m = state->radius_m,
      .assignments_count = assigned,
      .assignments = assignments,
  };
  if (sink->submit_instance(sink->context, &instance) != FLEETYARD_OK)
    status = fail(sink, FLEETYARD_STATUS_TIMED_OUT, "the instance came too late");
end:
  free(distance);
  free(queue);
  free(taken);
  free(goals);
  free(offsets);
  free(assignments);
  free(flat);
  return status;
}

/* ---- What the library exports ---------------------------------------------- */

/* What the host knows of the generator; docs/conformance.md lists all capabilities. The
 * schema says what `--option NAME=VALUE` may be; the host checks it beforehand. */
static const FleetyardDescriptor descriptor = {
    .struct_size = sizeof descriptor,
    .id = TEXT("example-plugin"),
    .name = TEXT("example-plugin"),
    .version = TEXT("0.1.0"),
    .description = TEXT("Gives each open task to the nearest agent that has nothing to do."),
    .options_schema =
        TEXT("{\"type\": \"object\", \"additionalProperties\": false, \"properties\": {"
             "\"most_tasks\": {\"type\": \"integer\", \"minimum\": 1, \"default\": 1000,"
             "\"description\": \"Most tasks to give away in one call.\"}}}"),
    .capabilities = FLEETYARD_CAPABILITY_GRID | FLEETYARD_CAPABILITY_PEBBLE |
                    FLEETYARD_CAPABILITY_DETERMINISTIC,
};

/* The number that an option has. With more than a few options, take a JSON library. */
static double option(FleetyardStr options, const char *name, double otherwise) {
  char text[256];
  snprintf(text, sizeof text, "%.*s", (int)options.len, (const char *)options.ptr);
  const char *found = strstr(text, name);
  found = found ? strchr(found, ':') : NULL;
  return found ? strtod(found + 1, NULL) : otherwise;
}

static void destroy(void *context) {
  Generator *generator = context;
  free(generator->passable);
  free(generator);
}

static int32_t create(uint32_t index, FleetyardStr options, const FleetyardSink *sink,
                      FleetyardInstanceGenerator *out) {
  double most_tasks = option(options, "\"most_tasks\"", 1000);
  (void)index; /* there is one generator */
  if (!(most_tasks >= 1 && most_tasks <= UINT32_MAX))
    return fail(sink, FLEETYARD_STATUS_INVALID_INPUT, "`most_tasks` is no number from 1 on");
  Generator *generator = array(1, sizeof *generator);
  generator->most_tasks = (uint32_t)most_tasks;
  *out = (FleetyardInstanceGenerator){
      .struct_size = sizeof *out,
      .context = generator,
      .prepare = prepare,
      .generate = generate,
      .destroy = destroy,
  };
  return FLEETYARD_STATUS_SOLVED;
}

static uint32_t count(void) { return 1; }

static const FleetyardDescriptor *describe(uint32_t index) {
  return index == 0 ? &descriptor : NULL;
}

static const FleetyardInstanceGeneratorFactory factory = {sizeof factory, 0, count, describe,
                                                          create};

static const void *get_factory(FleetyardStr id) {
  static const char wanted[] = FLEETYARD_INSTANCE_GENERATOR_FACTORY_ID;
  bool equal = id.len == sizeof wanted - 1 && memcmp(id.ptr, wanted, id.len) == 0;
  return equal ? &factory : NULL;
}

const FleetyardPluginEntry fleetyard_plugin_entry_v1 = {
    .struct_size = sizeof fleetyard_plugin_entry_v1,
    .abi_major = FLEETYARD_ABI_MAJOR,
    .abi_minor = FLEETYARD_ABI_MINOR,
    .get_factory = get_factory,
};
