/* An instance generator in one C file: an agent without a goal gets the first open task
 * that it can reach, in the order in which tasks were released.
 *
 * The host keeps for the next call who comes after the last agent that was given a task: so
 * agents take turns, and a run goes on alike after a restart.
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
  uint32_t *region; /* per cell the first cell of the region that is connected; NONE if blocked */
} Generator;

static void fill(const FleetyardGrid *grid, uint32_t *region, uint32_t *stack, uint32_t first) {
  size_t height = 0;
  region[first] = first;
  for (stack[height++] = first; height > 0;) {
    uint32_t cell = stack[--height];
    for (int move = 0; move < 8; move++) {
      uint32_t near = fleetyard_move(grid, cell, move);
      if (near != NONE && region[near] == NONE) {
        region[near] = first;
        stack[height++] = near;
      }
    }
  }
}

static int32_t prepare(void *context, const FleetyardEnvironment *environment,
                       const FleetyardBudget *budget, const FleetyardSink *sink) {
  Generator *generator = context;
  const FleetyardGrid *grid = fleetyard_grid(environment, sink);
  uint32_t cells = grid->rows * grid->cols;
  uint32_t *stack = fleetyard_array(cells, sizeof *stack);
  (void)budget; /* a few milliseconds for the largest maps */
  free(generator->region);
  generator->region = fleetyard_array(cells, sizeof *generator->region);
  memset(generator->region, 0xFF, cells * sizeof *generator->region);
  for (uint32_t cell = 0; cell < cells; cell++)
    if (grid->passable[cell] && generator->region[cell] == NONE)
      fill(grid, generator->region, stack, cell);
  free(stack);
  return FLEETYARD_STATUS_SOLVED;
}

static bool can_reach(const Generator *generator, const FleetyardFleetState *state,
                      uint32_t agent, uint32_t task) {
  uint32_t home = generator->region[state->next->starts[agent]];
  uint64_t begin = state->task_offsets[task], end = state->task_offsets[task + 1];
  bool all = home != NONE && begin < end;
  for (uint64_t i = begin; i < end; i++)
    all = all && generator->region[state->task_places[i]] == home;
  return all;
}

static int32_t generate(void *context, const FleetyardFleetState *state,
                        const FleetyardBudget *budget, const FleetyardSink *sink) {
  const Generator *generator = context;
  int32_t status = FLEETYARD_STATUS_SOLVED;
  FleetyardDecision decision = fleetyard_decide(state);
  bool *given = fleetyard_array(state->tasks, sizeof *given);
  const FleetyardBytes *kept = fleetyard_kept(&state->parts);
  uint32_t agents = decision.goals.agents, first = 0, next;
  if (kept && kept->len == sizeof first)
    memcpy(&first, kept->ptr, sizeof first);
  next = first %= agents;
  for (uint32_t i = 0; i < agents; i++) {
    uint32_t agent = (first + i) % agents;
    const FleetyardPath *goals = &decision.goals.of[agent];
    for (uint32_t task = 0; task < state->tasks && goals->length == 0; task++)
      if (!given[task] && can_reach(generator, state, agent, task)) {
        given[task] = true;
        fleetyard_assign(&decision, task, agent);
        next = (agent + 1) % agents;
      }
    if (goals->length == 0)
      fleetyard_add_cell(&decision.goals, agent, state->next->starts[agent]);
    if (i % 64 == 0 && fleetyard_cancelled(sink)) {
      status = fleetyard_time_is_up(budget, sink);
      break;
    }
  }
  if (status == FLEETYARD_STATUS_SOLVED) {
    fleetyard_keep(sink, &next, sizeof next); /* not every host does */
    status = fleetyard_submit_request(&decision, sink);
  }
  fleetyard_free_decision(&decision);
  free(given);
  return status;
}

static void end(void *context) {
  free(((Generator *)context)->region);
  free(context);
}

/* ---- What the library exports ------------------------------------------------ */

static const FleetyardStr features[] = {FLEETYARD_TEXT("part:" FLEETYARD_KEPT_ID)};

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
    .feature_count = 1,
    .features = features,
};

static void *make(const FleetyardOptions *options, const FleetyardSink *sink) {
  (void)options, (void)sink; /* it has none */
  return fleetyard_array(1, sizeof(Generator));
}

FLEETYARD_EXPORT_INSTANCE_GENERATOR(first_task, make, prepare, generate, end);
