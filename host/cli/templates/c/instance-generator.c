/* Gives each open task to the nearest agent that has nothing to do; the rest wait.
 *
 * Tasks are given away in the order in which they came. Put your own rule into `generate`.
 */

#include "fleetyard_easy.h"

#define NONE FLEETYARD_NONE

typedef struct {
  uint32_t most_tasks;
} Generator;

/* ---- The algorithm --------------------------------------------------------- */

/* What a call works with. */
typedef struct {
  const FleetyardFleetState *state;
  const FleetyardGrid *grid;
  FleetyardDecision decision;
  uint32_t *distance, *queue;
  bool *taken; /* two agents cannot end in the same cell */
} Work;

static bool is_idle(const Work *work, uint32_t agent) {
  return work->decision.goals.of[agent].length == 0;
}

/* Gives a task to the nearest idle agent that can do it, if there is one. */
static void give_away(Work *work, uint32_t task) {
  const FleetyardFleetState *state = work->state;
  const uint32_t *visits = state->task_places + state->task_offsets[task];
  uint64_t length = state->task_offsets[task + 1] - state->task_offsets[task];
  if (length == 0 || work->taken[visits[length - 1]])
    return;
  bool possible = true; /* to go from each place to the next */
  for (uint64_t i = 1; i < length && possible; i++) {
    fleetyard_distances(work->grid, visits[i], work->distance, work->queue);
    possible = work->distance[visits[i - 1]] != NONE;
  }
  fleetyard_distances(work->grid, visits[0], work->distance, work->queue);
  uint32_t nearest = NONE, best = NONE;
  for (uint32_t agent = 0; agent < state->next->agents && possible; agent++) {
    uint32_t distance = work->distance[state->next->starts[agent]];
    if (is_idle(work, agent) && distance < best)
      nearest = agent, best = distance;
  }
  if (nearest != NONE) {
    fleetyard_assign(&work->decision, task, nearest);
    work->taken[visits[length - 1]] = true;
  }
}

/* Lets an idle agent wait in the nearest cell where nobody ends; false when there is none. */
static bool wait(Work *work, uint32_t agent) {
  uint32_t start = work->state->next->starts[agent], near = 0;
  uint32_t reach = fleetyard_spread(work->grid, start, false, work->distance, work->queue);
  while (near < reach && work->taken[work->queue[near]])
    near++;
  if (near == reach)
    return false;
  fleetyard_add_cell(&work->decision.goals, agent, work->queue[near]);
  work->taken[work->queue[near]] = true;
  return true;
}

static int32_t generate(void *context, const FleetyardFleetState *state,
                        const FleetyardBudget *budget, const FleetyardSink *sink) {
  const FleetyardGrid *grid = fleetyard_grid(state->next->environment, sink);
  uint32_t agents = state->next->agents, cells = grid->rows * grid->cols;
  uint32_t most = ((const Generator *)context)->most_tasks;
  int32_t status = FLEETYARD_STATUS_SOLVED;
  /* The decision begins with the goals that agents have already. */
  Work work = {state,
               grid,
               fleetyard_decide(state),
               fleetyard_array(cells, sizeof *work.distance),
               fleetyard_array(cells, sizeof *work.queue),
               fleetyard_array(cells, sizeof *work.taken)};
  (void)budget; /* `cancelled` says when the time is up */
  for (uint32_t agent = 0; agent < agents; agent++)
    if (!is_idle(&work, agent)) /* its last goal is where it ends */
      work.taken[fleetyard_path_at(&work.decision.goals.of[agent], UINT64_MAX)] = true;
  for (uint32_t task = 0; task < state->tasks && task < most && !fleetyard_cancelled(sink); task++)
    give_away(&work, task);
  for (uint32_t agent = 0; agent < agents && status == FLEETYARD_STATUS_SOLVED; agent++)
    if (is_idle(&work, agent) && !wait(&work, agent))
      status = fleetyard_fail(sink, FLEETYARD_STATUS_GAVE_UP,
                              "no cell is left for an agent to wait in");
  if (status == FLEETYARD_STATUS_SOLVED)
    status = fleetyard_submit_request(&work.decision, sink);
  fleetyard_free_decision(&work.decision);
  free(work.distance), free(work.queue), free(work.taken);
  return status;
}

/* ---- What the library exports ---------------------------------------------- */

/* What the host knows of the generator; docs/conformance.md lists all capabilities. The
 * schema says what `--option NAME=VALUE` may be; the host checks it beforehand. */
static const FleetyardDescriptor about = {
    .struct_size = sizeof about,
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
                    FLEETYARD_CAPABILITY_MOVE_MASK | FLEETYARD_CAPABILITY_DETERMINISTIC,
};

static void *make(const FleetyardOptions *options, const FleetyardSink *sink) {
  Generator *generator = fleetyard_array(1, sizeof *generator);
  (void)sink;
  generator->most_tasks = (uint32_t)fleetyard_number(options, "most_tasks", 1000);
  return generator;
}

FLEETYARD_EXPORT_INSTANCE_GENERATOR(about, make, fleetyard_learn_nothing, generate, free);
