/* Prioritized planning: agents plan one after the other, each round those before it.
 *
 * After Erdmann and Lozano-Perez, "On Multiple Moving Objects" (Algorithmica 1987). It is
 * simple, and neither complete nor optimal. Put your own algorithm into `plan`.
 */

#include "fleetyard_easy.h"

#define NONE FLEETYARD_NONE

typedef struct {
  FleetyardMap map; /* learnt before `plan` is called */
  uint32_t attempts;
} Planner;

/* Where an agent is at time 0, 1, 2, ... After its last cell it stays there. */
typedef struct {
  uint32_t *cells;
  uint32_t length;
} Path;

static uint32_t at(const Path *path, uint32_t time) {
  return path->cells[time < path->length ? time : path->length - 1];
}

/* Whether one of the paths is in a cell at a time or later. */
static bool comes_by(const Path *paths, uint32_t count, uint32_t cell, uint32_t time) {
  for (uint32_t i = 0; i < count; i++)
    for (uint32_t later = time; later < paths[i].length; later++)
      if (paths[i].cells[later] == cell)
        return true;
  return false;
}

/* Fills in a shortest path that meets none of the others, if there is one. */
static bool find_path(const FleetyardMap *map, const FleetyardInstance *instance, uint32_t agent,
                      const Path *others, uint32_t count, const FleetyardSink *sink,
                      Path *path) {
  uint32_t start = instance->starts[agent];
  uint32_t goal = instance->goals[instance->goal_offsets[agent]];
  uint32_t cells = map->cells, time = 0, reachable = 1;
  /* steps[t][cell] is where the agent was before, if it can be there at time t. */
  uint32_t **steps = fleetyard_array(1, sizeof *steps);
  /* Who is where, one step ago and now: 1 and more, 0 for nobody. */
  uint32_t *before = fleetyard_array(cells, sizeof *before);
  uint32_t *now = fleetyard_array(cells, sizeof *now);
  bool found, stuck = false;

  steps[0] = memset(fleetyard_array(cells, sizeof **steps), 0xFF, cells * sizeof **steps);
  steps[0][start] = start;
  for (;;) {
    /* At the goal it stays: nobody may come by later. */
    found = steps[time][goal] != NONE && !comes_by(others, count, goal, time + 1);
    if (found || stuck || fleetyard_cancelled(sink))
      break;
    time++;
    uint32_t **more = realloc(steps, (time + 1) * sizeof *steps);
    if (!more)
      abort();
    steps = more;
    steps[time] = memset(fleetyard_array(cells, sizeof **steps), 0xFF, cells * sizeof **steps);

    uint32_t reached = 0;
    bool still = true;
    for (uint32_t i = 0; i < count; i++) {
      before[at(&others[i], time - 1)] = now[at(&others[i], time)] = i + 1;
      still = still && others[i].length < time;
    }
    for (uint32_t cell = 0; cell < cells; cell++)
      for (int i = 0; i < 5 && steps[time - 1][cell] != NONE; i++) {
        uint32_t near = i < 4 ? map->neighbours[cell][i] : cell; /* it may wait */
        if (near == NONE || now[near] || steps[time][near] != NONE)
          continue;
        if (before[near] && before[near] == now[cell])
          continue; /* they would exchange cells */
        steps[time][near] = cell;
        reached++;
      }
    for (uint32_t i = 0; i < count; i++)
      before[at(&others[i], time - 1)] = now[at(&others[i], time)] = 0;
    /* Once the others stand still, what is not reached now never will be. */
    stuck = reached == 0 || (still && reached == reachable);
    reachable = reached;
  }

  if (found) {
    *path = (Path){fleetyard_array(time + 1, sizeof *path->cells), time + 1};
    path->cells[time] = goal;
    for (uint32_t t = time; t > 0; t--)
      path->cells[t - 1] = steps[t][path->cells[t]];
  }
  for (uint32_t t = 0; t <= time; t++)
    free(steps[t]);
  free(steps);
  free(before);
  free(now);
  return found;
}

/* Hands the paths over to the host, by agent. */
static int32_t submit(const FleetyardSink *sink, const Path *paths, const uint32_t *order,
                      uint32_t agents) {
  FleetyardLists plan = {0};
  const Path **of_agent = fleetyard_array(agents, sizeof *of_agent);
  for (uint32_t i = 0; i < agents; i++)
    of_agent[order[i]] = &paths[i];
  for (uint32_t agent = 0; agent < agents; agent++) {
    fleetyard_append_all(&plan, of_agent[agent]->cells, of_agent[agent]->length);
    fleetyard_end_list(&plan);
  }
  free(of_agent);
  return fleetyard_submit_plan(&plan, sink);
}

static int32_t plan(void *context, const FleetyardInstance *instance,
                    const FleetyardBudget *budget, const FleetyardSink *sink) {
  const Planner *planner = context;
  const FleetyardMap *map = &planner->map;
  uint32_t agents = instance->agents;
  uint32_t *order = fleetyard_array(agents, sizeof *order);
  Path *paths = fleetyard_array(agents, sizeof *paths); /* in that order */
  int32_t status = FLEETYARD_STATUS_GAVE_UP;
  (void)budget; /* `cancelled` says when the time is up */
  for (uint32_t i = 0; i < agents; i++)
    order[i] = i;
  for (uint32_t attempt = 0;
       attempt < planner->attempts && status == FLEETYARD_STATUS_GAVE_UP; attempt++) {
    uint32_t planned = 0;
    while (planned < agents &&
           find_path(map, instance, order[planned], paths, planned, sink, &paths[planned]))
      planned++;
    if (planned == agents) {
      status = submit(sink, paths, order, agents);
    } else if (fleetyard_cancelled(sink)) {
      status = fleetyard_fail(sink, FLEETYARD_STATUS_TIMED_OUT, "the time is up");
    } else if (planned == 0) {
      status =
          fleetyard_fail(sink, FLEETYARD_STATUS_INFEASIBLE, "an agent has no path to its goal");
    } else {
      /* Who found no path goes first, and who went first goes last. */
      uint32_t failed = order[planned];
      memmove(order + planned, order + planned + 1, (agents - planned - 1) * sizeof *order);
      order[agents - 1] = order[0];
      order[0] = failed;
    }
    while (planned > 0)
      free(paths[--planned].cells);
  }
  free(order);
  free(paths);
  if (status == FLEETYARD_STATUS_GAVE_UP)
    fleetyard_fail(sink, status, "no order of the agents worked");
  return status;
}

/* ---- What the library exports ---------------------------------------------- */

/* What the host knows of the planner; docs/conformance.md lists all capabilities. The
 * schema says what `--option NAME=VALUE` may be; the host checks it beforehand. */
static const FleetyardDescriptor descriptor = {
    .struct_size = sizeof descriptor,
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
                    FLEETYARD_CAPABILITY_DETERMINISTIC,
};

static int32_t configure(void *context, FleetyardStr options, const FleetyardSink *sink) {
  double attempts = 100;
  const FleetyardOption known[] = {{"attempts", &attempts, 1, UINT32_MAX, NULL}};
  int32_t status = fleetyard_read_options(options, known, 1, sink);
  ((Planner *)context)->attempts = (uint32_t)attempts;
  return status;
}

FLEETYARD_PLANNER(descriptor, sizeof(Planner), configure, plan);
