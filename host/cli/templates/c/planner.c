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
  uint32_t most = end + cells; /* later, nothing new can be reached */
  /* from[t][cell] is where the agent was before, if it can be there at time t. */
  uint32_t **from = fleetyard_array((size_t)most + 1, sizeof *from);
  /* Who is where, one step ago and now: 1 and more, 0 for nobody. */
  uint32_t *before = fleetyard_array(cells, sizeof *before);
  uint32_t *now = fleetyard_array(cells, sizeof *now);
  from[0] = memset(fleetyard_array(cells, sizeof **from), 0xFF, cells * sizeof **from);
  from[0][instance->starts[agent]] = instance->starts[agent];
  while ((from[time][goal] == NONE || time < rest) && time < most && !fleetyard_cancelled(sink)) {
    time++;
    from[time] = memset(fleetyard_array(cells, sizeof **from), 0xFF, cells * sizeof **from);
    for (uint32_t i = 0; i < all->agents; i++)
      if (all->of[i].length > 0)
        before[fleetyard_path_at(&all->of[i], time - 1)] =
            now[fleetyard_path_at(&all->of[i], time)] = i + 1;
    for (uint32_t cell = 0; cell < cells; cell++)
      for (int move = 0; move < 9 && from[time - 1][cell] != NONE; move++) {
        uint32_t to = fleetyard_move(grid, cell, move); /* the last move waits */
        if (to == NONE || from[time][to] != NONE || now[to])
          continue;
        if (before[to] && before[to] == now[cell])
          continue; /* they would exchange cells */
        from[time][to] = cell;
      }
    for (uint32_t i = 0; i < all->agents; i++)
      if (all->of[i].length > 0)
        before[fleetyard_path_at(&all->of[i], time - 1)] =
            now[fleetyard_path_at(&all->of[i], time)] = 0;
  }
  bool found = from[time][goal] != NONE && time >= rest;
  uint32_t *path = fleetyard_array((size_t)time + 1, sizeof *path);
  path[time] = goal;
  for (uint32_t t = time; t > 0 && found; t--)
    path[t - 1] = from[t][path[t]];
  if (found)
    fleetyard_add_cells(all, agent, path, (uint64_t)time + 1);
  for (uint32_t t = 0; t <= time; t++)
    free(from[t]);
  free(from), free(path), free(before), free(now);
  return found;
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
