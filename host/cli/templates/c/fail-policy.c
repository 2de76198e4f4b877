/* Follows the planner's failed paths for as long as nobody collides, and then waits.
 *
 * So the fleet goes on a little, and the next call of the planner is another question. Put
 * your own algorithm into `recover`.
 */

#include "fleetyard.h"

#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define TEXT(literal) {(const uint8_t *)(literal), sizeof(literal) - 1}

typedef struct {
  uint32_t steps;
  uint32_t rows, cols;
  uint8_t *passable;
} Policy;

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
  Policy *policy = context;
  (void)budget;
  if (environment->representation != FLEETYARD_REPRESENTATION_GRID)
    return fail(sink, FLEETYARD_STATUS_UNSUPPORTED, "this policy knows grids only");
  const FleetyardGrid *grid = environment->view;
  size_t cells = (size_t)grid->rows * grid->cols;
  free(policy->passable);
  policy->rows = grid->rows;
  policy->cols = grid->cols;
  policy->passable = memcpy(array(cells, 1), grid->passable, cells);
  return FLEETYARD_STATUS_SOLVED;
}

/* Whether one step leads from a cell to another, or the agent waits. */
static bool is_step(const Policy *policy, uint32_t from, uint32_t to) {
  uint32_t cols = policy->cols;
  if (to >= policy->rows * cols || !policy->passable[to])
    return to == from;
  return to == from || to == from + cols || to + cols == from ||
         (from / cols == to / cols && (to == from + 1 || to + 1 == from));
}

/* Whether all agents can go from their cells to these in one step. */
static bool is_safe(const Policy *policy, uint32_t agents, const uint32_t *now,
                    const uint32_t *after) {
  for (uint32_t a = 0; a < agents; a++) {
    if (!is_step(policy, now[a], after[a]))
      return false;
    for (uint32_t b = 0; b < a; b++)
      if (after[a] == after[b] || (after[a] == now[b] && after[b] == now[a]))
        return false;
  }
  return true;
}

static int32_t recover(void *context, const FleetyardInstance *instance,
                       const FleetyardPlan *failed, const FleetyardBudget *budget,
                       const FleetyardSink *sink) {
  const Policy *policy = context;
  uint32_t agents = instance->agents, time = 0;
  size_t row = agents * sizeof(uint32_t);
  /* Where everybody is at time 0, 1, 2, ..., one after the other. */
  uint32_t *at = memcpy(array((size_t)policy->steps + 1, row), instance->starts, row);
  (void)budget; /* `cancelled` says when the time is up */

  /* The planner may have left nothing. */
  while (failed && time < policy->steps && !sink->cancelled(sink->context)) {
    const uint32_t *now = at + (size_t)time * agents;
    uint32_t *after = at + ((size_t)time + 1) * agents;
    for (uint32_t agent = 0; agent < agents; agent++) {
      uint64_t begin = failed->offsets[agent], length = failed->offsets[agent + 1] - begin;
      uint64_t step = time + 1 < length ? time + 1 : length - 1;
      after[agent] = length > 0 ? failed->cells[begin + step] : now[agent];
    }
    if (!is_safe(policy, agents, now, after))
      break;
    time++;
  }

  uint64_t *offsets = array((size_t)agents + 1, sizeof *offsets);
  uint32_t *cells = array((size_t)time + 1, row);
  for (uint32_t agent = 0; agent < agents; agent++) {
    offsets[agent + 1] = offsets[agent] + time + 1;
    for (uint32_t t = 0; t <= time; t++)
      cells[offsets[agent] + t] = at[(size_t)t * agents + agent];
  }
  FleetyardPlan plan = {sizeof plan, agents, offsets, cells};
  int32_t taken = sink->submit_plan(sink->context, &plan);
  free(at);
  free(offsets);
  free(cells);
  return taken == FLEETYARD_OK ? FLEETYARD_STATUS_SOLVED
                               : fail(sink, FLEETYARD_STATUS_TIMED_OUT, "the plan came too late");
}

/* ---- What the library exports ---------------------------------------------- */

/* What the host knows of the policy; docs/conformance.md lists all capabilities. The
 * schema says what `--option NAME=VALUE` may be; the host checks it beforehand. */
static const FleetyardDescriptor descriptor = {
    .struct_size = sizeof descriptor,
    .id = TEXT("example-plugin"),
    .name = TEXT("example-plugin"),
    .version = TEXT("0.1.0"),
    .description = TEXT("Keeps what is free of collisions at the beginning of the failed paths."),
    .options_schema =
        TEXT("{\"type\": \"object\", \"additionalProperties\": false, \"properties\": {"
             "\"steps\": {\"type\": \"integer\", \"minimum\": 0, \"maximum\": 100000,"
             "\"default\": 10, \"description\": \"Most steps to take.\"}}}"),
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
  Policy *policy = context;
  free(policy->passable);
  free(policy);
}

static int32_t create(uint32_t index, FleetyardStr options, const FleetyardSink *sink,
                      FleetyardFailPolicy *out) {
  double steps = option(options, "\"steps\"", 10);
  (void)index; /* there is one policy */
  if (!(steps >= 0 && steps <= 100000))
    return fail(sink, FLEETYARD_STATUS_INVALID_INPUT, "`steps` is not a number up to 100000");
  Policy *policy = array(1, sizeof *policy);
  policy->steps = (uint32_t)steps;
  *out = (FleetyardFailPolicy){
      .struct_size = sizeof *out,
      .context = policy,
      .prepare = prepare,
      .recover = recover,
      .destroy = destroy,
  };
  return FLEETYARD_STATUS_SOLVED;
}

static uint32_t count(void) { return 1; }

static const FleetyardDescriptor *describe(uint32_t index) {
  return index == 0 ? &descriptor : NULL;
}

static const FleetyardFailPolicyFactory factory = {sizeof factory, 0, count, describe, create};

static const void *get_factory(FleetyardStr id) {
  static const char wanted[] = FLEETYARD_FAIL_POLICY_FACTORY_ID;
  bool equal = id.len == sizeof wanted - 1 && memcmp(id.ptr, wanted, id.len) == 0;
  return equal ? &factory : NULL;
}

const FleetyardPluginEntry fleetyard_plugin_entry_v1 = {
    .struct_size = sizeof fleetyard_plugin_entry_v1,
    .abi_major = FLEETYARD_ABI_MAJOR,
    .abi_minor = FLEETYARD_ABI_MINOR,
    .get_factory = get_factory,
};
