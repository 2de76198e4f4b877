/* Gives each open task to the nearest agent that has nothing to do; the rest wait.
 *
 * Tasks are given away in the order in which they came. Put your own rule into `generate`.
 */

#include "fleetyard_easy.h"

#define NONE FLEETYARD_NONE

typedef struct {
  FleetyardMap map; /* learnt before `generate` is called */
  uint32_t most_tasks;
} Generator;

/* ---- The algorithm --------------------------------------------------------- */

/* The goals of an agent: what it has to do already, a task, or a place to wait. */
typedef struct {
  const uint32_t *cells;
  uint64_t length;
  uint32_t wait;
} Goals;

static int32_t generate(void *context, const FleetyardFleetState *state,
                        const FleetyardBudget *budget, const FleetyardSink *sink) {
  const Generator *generator = context;
  const FleetyardMap *map = &generator->map;
  uint32_t agents = state->agents, cells = map->cells;
  uint32_t tasks = state->tasks < generator->most_tasks ? state->tasks : generator->most_tasks;
  uint32_t *distance = fleetyard_array(cells, sizeof *distance);
  uint32_t *queue = fleetyard_array(cells, sizeof *queue);
  /* Two agents cannot end in the same cell. */
  bool *taken = fleetyard_array(cells, sizeof *taken);
  Goals *goals = fleetyard_array(agents, sizeof *goals);
  /* What the host is told of tasks: it appends their cells to the goals of the agents. */
  FleetyardAssignment *assignments = fleetyard_array((size_t)tasks + 1, sizeof *assignments);
  uint32_t assigned = 0;
  FleetyardLists lists = {0};
  int32_t status = FLEETYARD_STATUS_SOLVED;
  (void)budget; /* `cancelled` says when the time is up */

  for (uint32_t agent = 0; agent < agents; agent++) {
    uint64_t begin = state->goal_offsets[agent];
    goals[agent] = (Goals){state->goals + begin, state->goal_offsets[agent + 1] - begin, 0};
    if (goals[agent].length > 0)
      taken[goals[agent].cells[goals[agent].length - 1]] = true;
  }
  for (uint32_t task = 0; task < tasks && !fleetyard_cancelled(sink); task++) {
    const uint32_t *visits = state->task_cells + state->task_offsets[task];
    uint64_t length = state->task_offsets[task + 1] - state->task_offsets[task];
    if (length == 0 || taken[visits[length - 1]])
      continue;
    fleetyard_distances(map, visits[0], distance, queue);
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
      uint32_t near = 0, reach = fleetyard_distances(map, state->cells[agent], distance, queue);
      while (near < reach && taken[queue[near]])
        near++;
      if (near == reach) {
        status = fleetyard_fail(sink, FLEETYARD_STATUS_GAVE_UP,
                                "no cell is left for an agent to wait in");
        goto end;
      }
      goals[agent] = (Goals){&goals[agent].wait, 1, queue[near]};
      taken[queue[near]] = true;
    }

  for (uint32_t agent = 0; agent < agents; agent++) {
    fleetyard_append_all(&lists, goals[agent].cells, goals[agent].length);
    fleetyard_end_list(&lists);
  }
  status = fleetyard_submit_instance(state, &lists, assignments, assigned, sink);
end:
  free(distance);
  free(queue);
  free(taken);
  free(goals);
  free(assignments);
  return status;
}

/* ---- What the library exports ---------------------------------------------- */

/* What the host knows of the generator; docs/conformance.md lists all capabilities. The
 * schema says what `--option NAME=VALUE` may be; the host checks it beforehand. */
static const FleetyardDescriptor descriptor = {
    .struct_size = sizeof descriptor,
    .id = FLEETYARD_TEXT("example-plugin"),
    .name = FLEETYARD_TEXT("example-plugin"),
    .version = FLEETYARD_TEXT("0.1.0"),
    .description =
        FLEETYARD_TEXT("Gives each open task to the nearest agent that has nothing to do."),
    .options_schema = FLEETYARD_TEXT(
        "{\"type\": \"object\", \"additionalProperties\": false, \"properties\": {"
        "\"most_tasks\": {\"type\": \"integer\", \"minimum\": 1, \"default\": 1000,"
        "\"description\": \"Most tasks to give away in one call.\"}}}"),
    .capabilities = FLEETYARD_CAPABILITY_GRID | FLEETYARD_CAPABILITY_PEBBLE |
                    FLEETYARD_CAPABILITY_DETERMINISTIC,
};

static int32_t configure(void *context, FleetyardStr options, const FleetyardSink *sink) {
  double most_tasks = 1000;
  const FleetyardOption known[] = {{"most_tasks", &most_tasks, 1, UINT32_MAX, NULL}};
  int32_t status = fleetyard_read_options(options, known, 1, sink);
  ((Generator *)context)->most_tasks = (uint32_t)most_tasks;
  return status;
}

FLEETYARD_INSTANCE_GENERATOR(descriptor, sizeof(Generator), configure, generate);
