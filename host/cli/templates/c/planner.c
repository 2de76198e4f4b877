/* Prioritized planning: agents plan one after the other, each round those before it.
 *
 * After Erdmann and Lozano-Perez, "On Multiple Moving Objects" (Algorithmica 1987). It is
 * simple, and neither complete nor optimal. Put your own algorithm into `plan`.
 */

#include "fleetyard_easy.h"

#define NONE FLEETYARD_NONE

typedef struct {
  uint32_t attempts;
} Planner;

/* A cell where the agent can be at a time, and the step before by its place in the list. */
typedef struct {
  uint32_t cell, before;
} Step;

/* Adds a shortest path of an agent that meets none of the others, if there is one. */
static bool find_path(const FleetyardInstance *instance, uint32_t agent, FleetyardPaths *all,
                      const FleetyardSink *sink) {
  const FleetyardGrid *grid = fleetyard_grid(instance->environment, sink);
  uint32_t goal = instance->goals[instance->goal_offsets[agent]];
  uint32_t cells = grid->rows * grid->cols, time = 0, rest = 0, end = 0;
  /* From `rest` on nobody comes by the goal, and at `end` the others stand still. */
  for (uint32_t i = 0; i < all->agents; i++)
    for (uint32_t t = 0; t < all->of[i].length; t++) {
      end = t > end ? t : end;
      rest = all->of[i].places[t] == goal && t + 1 > rest ? t + 1 : rest;
    }
  /* The steps of all times, one time after the other: those of the last two begin at `last`
   * and at `first`. Memory follows what the agent can reach. */
  Step *steps = fleetyard_array(1, sizeof *steps);
  uint64_t room = 1;
  uint32_t last = 0, first = 0, count = 1, found = NONE;
  steps[0].cell = instance->starts[agent];
  /* The last step in each cell, and who is where, one step ago and now: 1 and more, 0 for nobody. */
  uint32_t *step_in = fleetyard_array(cells, sizeof *step_in);
  uint32_t *before = fleetyard_array(cells, sizeof *before);
  uint32_t *now = fleetyard_array(cells, sizeof *now);
  for (;;) {
    for (uint32_t i = first; i < count && time >= rest; i++)
      found = steps[i].cell == goal ? i : found;
    /* Once the others stand still, what is not reached now never will be. */
    bool is_all = count == first || (time > end && count - first == first - last);
    if (found != NONE || is_all || fleetyard_cancelled(sink))
      break;
    time++, last = first, first = count;
    for (uint32_t i = 0; i < all->agents; i++)
      if (all->of[i].length > 0)
        before[fleetyard_path_at(&all->of[i], time - 1)] =
            now[fleetyard_path_at(&all->of[i], time)] = i + 1;
    for (uint32_t i = last; i < first; i++)
      for (int move = 0; move < 9; move++) {
        uint32_t cell = steps[i].cell, to = fleetyard_move(grid, cell, move); /* the last move waits */
        if (to == NONE || now[to] || (before[to] && before[to] == now[cell]))
          continue; /* they would meet there, or exchange cells */
        if (step_in[to] >= first) { /* of several cells it comes from the first */
          Step *known = &steps[step_in[to]];
          known->before = cell < steps[known->before].cell ? i : known->before;
          continue;
        }
        if (count == room) {
          uint64_t more = fleetyard_more_room(room, room + 1);
          steps = fleetyard_grown(steps, room, more, sizeof *steps);
          room = more;
        }
        step_in[to] = count;
        steps[count++] = (Step){to, i};
      }
    for (uint32_t i = 0; i < all->agents; i++)
      if (all->of[i].length > 0)
        before[fleetyard_path_at(&all->of[i], time - 1)] =
            now[fleetyard_path_at(&all->of[i], time)] = 0;
  }
  if (found != NONE) {
    uint32_t *path = fleetyard_array((size_t)time + 1, sizeof *path);
    for (uint32_t t = time + 1, step = found; t > 0; step = steps[step].before)
      path[--t] = steps[step].cell;
    fleetyard_add_cells(all, agent, path, (uint64_t)time + 1);
    free(path);
  }
  free(steps), free(step_in), free(before), free(now);
  return found != NONE;
}

static int32_t plan(void *context, const FleetyardInstance *instance,
                    const FleetyardBudget *budget, const FleetyardSink *sink) {
  uint32_t agents = instance->agents, attempts = ((const Planner *)context)->attempts;
  uint32_t *order = fleetyard_array(agents, sizeof *order);
  int32_t status = FLEETYARD_STATUS_GAVE_UP;
  FleetyardPaths paths = fleetyard_paths(FLEETYARD_FORM_CELLS, agents);
  for (uint32_t i = 0; i < agents; i++)
    order[i] = i;
  for (uint32_t i = 0; i < agents; i++)
    for (uint32_t other = 0; other < i; other++)
      if (instance->starts[i] == instance->starts[other])
        status = FLEETYARD_STATUS_INVALID_INPUT;
  for (; attempts > 0 && status == FLEETYARD_STATUS_GAVE_UP; attempts--) {
    uint32_t planned = 0;
    fleetyard_clear_paths(&paths);
    while (planned < agents && find_path(instance, order[planned], &paths, sink))
      planned++;
    if (planned == agents) {
      status = fleetyard_submit(&paths, sink);
    } else if (fleetyard_cancelled(sink)) {
      status = fleetyard_time_is_up(budget, sink);
    } else if (planned == 0) {
      status = fleetyard_fail(sink, FLEETYARD_STATUS_INFEASIBLE, "an agent has no path to its goal");
    } else { /* Who found no path goes first, and who went first goes last. */
      uint32_t failed = order[planned];
      memmove(order + planned, order + planned + 1, (agents - planned - 1) * sizeof *order);
      order[agents - 1] = order[0];
      order[0] = failed;
    }
  }
  fleetyard_free_paths(&paths);
  free(order);
  if (status == FLEETYARD_STATUS_INVALID_INPUT)
    return fleetyard_fail(sink, status, "two agents start in one cell");
  return status == FLEETYARD_STATUS_GAVE_UP
             ? fleetyard_fail(sink, status, "no order of the agents worked")
             : status;
}

/* ---- What the library exports ---------------------------------------------- */

/* What the host knows of the planner; docs/conformance.md lists all capabilities. The
 * schema says what `--option NAME=VALUE` may be; the host checks it beforehand. */
static const FleetyardDescriptor about = {
    .struct_size = sizeof about,
    .id = FLEETYARD_TEXT("example-plugin"),
    .name = FLEETYARD_TEXT("example-plugin"),
    .version = FLEETYARD_TEXT("0.1.0"),
    .description =
        FLEETYARD_TEXT("Prioritized planning, in another order when an agent finds no path."),
    .options_schema = FLEETYARD_TEXT(
        "{\"type\": \"object\", \"additionalProperties\": false, \"properties\": {"
        "\"attempts\": {\"type\": \"integer\", \"minimum\": 1, \"default\": 100,"
        "\"description\": \"Most orders of the agents to try.\"}}}"),
    .capabilities = FLEETYARD_CAPABILITY_GRID | FLEETYARD_CAPABILITY_PEBBLE |
                    FLEETYARD_CAPABILITY_MOVE_MASK | FLEETYARD_CAPABILITY_DETERMINISTIC,
};

static void *make(const FleetyardOptions *options, const FleetyardSink *sink) {
  Planner *planner = fleetyard_array(1, sizeof *planner);
  (void)sink;
  planner->attempts = (uint32_t)fleetyard_number(options, "attempts", 100);
  return planner;
}

FLEETYARD_EXPORT_PLANNER(about, make, fleetyard_learn_nothing, plan, free);
