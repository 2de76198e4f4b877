/* Prioritized planning: agents plan one after the other, each round those before it.
 *
 * After Erdmann and Lozano-Perez, "On Multiple Moving Objects" (Algorithmica 1987). It is
 * simple, and neither complete nor optimal. Put your own algorithm into `plan`.
 */

#include "fleetyard.h"

#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define NONE UINT32_MAX
#define TEXT(literal) {(const uint8_t *)(literal), sizeof(literal) - 1}

typedef struct {
  uint32_t attempts;
  uint32_t cells;
  uint32_t (*moves)[5]; /* per cell: where a step leads, NONE where it cannot */
} Planner;

/* Where an agent is at time 0, 1, 2, ... After its last cell it stays there. */
typedef struct {
  uint32_t *cells;
  uint32_t length;
} Path;

static uint32_t at(const Path *path, uint32_t time) {
  return path->cells[time < path->length ? time : path->length - 1];
}

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
  Planner *planner = context;
  (void)budget;
  if (environment->representation != FLEETYARD_REPRESENTATION_GRID)
    return fail(sink, FLEETYARD_STATUS_UNSUPPORTED, "this planner knows grids only");
  const FleetyardGrid *grid = environment->view;
  uint32_t rows = grid->rows, cols = grid->cols;
  free(planner->moves);
  planner->cells = rows * cols;
  planner->moves = array(planner->cells, sizeof *planner->moves);
  for (uint32_t cell = 0; cell < planner->cells; cell++) {
    uint32_t row = cell / cols, col = cell % cols;
    uint32_t near[5] = {row > 0 ? cell - cols : NONE, col + 1 < cols ? cell + 1 : NONE,
                        row + 1 < rows ? cell + cols : NONE, col > 0 ? cell - 1 : NONE, cell};
    for (int i = 0; i < 5; i++)
      planner->moves[cell][i] = near[i] != NONE && grid->passable[near[i]] ? near[i] : NONE;
  }
  return FLEETYARD_STATUS_SOLVED;
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
static bool find_path(const Planner *planner, const FleetyardInstance *instance, uint32_t agent,
                      const Path *others, uint32_t count, const FleetyardSink *sink,
                      Path *path) {
  uint32_t start = instance->starts[agent];
  uint32_t goal = instance->goals[instance->goal_offsets[agent]];
  uint32_t cells = planner->cells, time = 0, reachable = 1;
  /* steps[t][cell] is where the agent was before, if it can be there at time t. */
  uint32_t **steps = array(1, sizeof *steps);
  /* Who is where, one step ago and now: 1 and more, 0 for nobody. */
  uint32_t *before = array(cells, sizeof *before), *now = array(cells, sizeof *now);
  bool found, stuck = false;

  steps[0] = memset(array(cells, sizeof **steps), 0xFF, cells * sizeof **steps);
  steps[0][start] = start;
  for (;;) {
    /* At the goal it stays: nobody may come by later. */
    found = steps[time][goal] != NONE && !comes_by(others, count, goal, time + 1);
    if (found || stuck || sink->cancelled(sink->context))
      break;
    time++;
    uint32_t **more = realloc(steps, (time + 1) * sizeof *steps);
    if (!more)
      abort();
    steps = more;
    steps[time] = memset(array(cells, sizeof **steps), 0xFF, cells * sizeof **steps);

    uint32_t reached = 0;
    bool still = true;
    for (uint32_t i = 0; i < count; i++) {
      before[at(&others[i], time - 1)] = now[at(&others[i], time)] = i + 1;
      still = still && others[i].length < time;
    }
    for (uint32_t cell = 0; cell < cells; cell++)
      for (int i = 0; i < 5 && steps[time - 1][cell] != NONE; i++) {
        uint32_t near = planner->moves[cell][i];
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
    *path = (Path){array(time + 1, sizeof *path->cells), time + 1};
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

/* Hands the paths over to the host, which copies them. */
static int32_t submit(const FleetyardSink *sink, const Path *paths, const uint32_t *order,
                      uint32_t agents) {
  const Path **of_agent = array(agents, sizeof *of_agent);
  uint64_t *offsets = array((size_t)agents + 1, sizeof *offsets);
  for (uint32_t i = 0; i < agents; i++)
    of_agent[order[i]] = &paths[i];
  for (uint32_t agent = 0; agent < agents; agent++)
    offsets[agent + 1] = offsets[agent] + of_agent[agent]->length;
  uint32_t *cells = array(offsets[agents], sizeof *cells);
  for (uint32_t agent = 0; agent < agents; agent++)
    memcpy(cells + offsets[agent], of_agent[agent]->cells,
           of_agent[agent]->length * sizeof *cells);
  FleetyardPlan plan = {sizeof plan, agents, offsets, cells};
  int32_t taken = sink->submit_plan(sink->context, &plan);
  free(of_agent);
  free(offsets);
  free(cells);
  return taken == FLEETYARD_OK ? FLEETYARD_STATUS_SOLVED
                               : fail(sink, FLEETYARD_STATUS_TIMED_OUT, "the plan came too late");
}

static int32_t plan(void *context, const FleetyardInstance *instance,
                    const FleetyardBudget *budget, const FleetyardSink *sink) {
  const Planner *planner = context;
  uint32_t agents = instance->agents;
  uint32_t *order = array(agents, sizeof *order);
  Path *paths = array(agents, sizeof *paths); /* in that order */
  int32_t status = FLEETYARD_STATUS_GAVE_UP;
  (void)budget; /* `cancelled` says when the time is up */
  for (uint32_t i = 0; i < agents; i++)
    order[i] = i;
  for (uint32_t attempt = 0;
       attempt < planner->attempts && status == FLEETYARD_STATUS_GAVE_UP; attempt++) {
    uint32_t planned = 0;
    while (planned < agents &&
           find_path(planner, instance, order[planned], paths, planned, sink, &paths[planned]))
      planned++;
    if (planned == agents) {
      status = submit(sink, paths, order, agents);
    } else if (sink->cancelled(sink->context)) {
      status = fail(sink, FLEETYARD_STATUS_TIMED_OUT, "the time is up");
    } else if (planned == 0) {
      status = fail(sink, FLEETYARD_STATUS_INFEASIBLE, "an agent has no path to its goal");
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
    fail(sink, status, "no order of the agents worked");
  return status;
}

/* ---- What the library exports ---------------------------------------------- */

/* What the host knows of the planner; docs/conformance.md lists all capabilities. The
 * schema says what `--option NAME=VALUE` may be; the host checks it beforehand. */
static const FleetyardDescriptor descriptor = {
    .struct_size = sizeof descriptor,
    .id = TEXT("example-plugin"),
    .name = TEXT("example-plugin"),
    .version = TEXT("0.1.0"),
    .description = TEXT("Prioritized planning, in another order when an agent finds no path."),
    .options_schema =
        TEXT("{\"type\": \"object\", \"additionalProperties\": false, \"properties\": {"
             "\"attempts\": {\"type\": \"integer\", \"minimum\": 1, \"default\": 100,"
             "\"description\": \"Most orders of the agents to try.\"}}}"),
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
  Planner *planner = context;
  free(planner->moves);
  free(planner);
}

static int32_t create(uint32_t index, FleetyardStr options, const FleetyardSink *sink,
                      FleetyardPlanner *out) {
  double attempts = option(options, "\"attempts\"", 100);
  (void)index; /* there is one planner */
  if (!(attempts >= 1 && attempts <= UINT32_MAX))
    return fail(sink, FLEETYARD_STATUS_INVALID_INPUT, "`attempts` is not a number from 1 on");
  Planner *planner = array(1, sizeof *planner);
  planner->attempts = (uint32_t)attempts;
  *out = (FleetyardPlanner){
      .struct_size = sizeof *out,
      .context = planner,
      .prepare = prepare,
      .plan = plan,
      .destroy = destroy,
  };
  return FLEETYARD_STATUS_SOLVED;
}

static uint32_t count(void) { return 1; }

static const FleetyardDescriptor *describe(uint32_t index) {
  return index == 0 ? &descriptor : NULL;
}

static const FleetyardPlannerFactory factory = {sizeof factory, 0, count, describe, create};

static const void *get_factory(FleetyardStr id) {
  static const char wanted[] = FLEETYARD_PLANNER_FACTORY_ID;
  bool equal = id.len == sizeof wanted - 1 && memcmp(id.ptr, wanted, id.len) == 0;
  return equal ? &factory : NULL;
}

const FleetyardPluginEntry fleetyard_plugin_entry_v1 = {
    .struct_size = sizeof fleetyard_plugin_entry_v1,
    .abi_major = FLEETYARD_ABI_MAJOR,
    .abi_minor = FLEETYARD_ABI_MINOR,
    .get_factory = get_factory,
};
