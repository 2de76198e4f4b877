/* Follows the planner's failed paths for as long as nobody collides, and then waits.
 *
 * So the fleet goes on a little, and the next call of the planner is another question. Put
 * your own algorithm into `recover`.
 */

#include "fleetyard_easy.h"

typedef struct {
  FleetyardMap map; /* learnt before `recover` is called */
  uint32_t steps;
} Policy;

/* ---- The algorithm --------------------------------------------------------- */

/* Whether all agents can go from their cells to these in one step. */
static bool is_safe(const FleetyardMap *map, uint32_t agents, const uint32_t *now,
                    const uint32_t *after) {
  for (uint32_t a = 0; a < agents; a++) {
    if (!fleetyard_is_step(map, now[a], after[a]))
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
  uint32_t *at = memcpy(fleetyard_array((size_t)policy->steps + 1, row), instance->starts, row);
  (void)budget; /* `cancelled` says when the time is up */

  /* The planner may have left nothing. */
  while (failed && time < policy->steps && !fleetyard_cancelled(sink)) {
    const uint32_t *now = at + (size_t)time * agents;
    uint32_t *after = at + ((size_t)time + 1) * agents;
    for (uint32_t agent = 0; agent < agents; agent++) {
      uint32_t next = fleetyard_at(failed, agent, time + 1);
      after[agent] = next == FLEETYARD_NONE ? now[agent] : next;
    }
    if (!is_safe(&policy->map, agents, now, after))
      break;
    time++;
  }

  FleetyardLists plan = {0};
  for (uint32_t agent = 0; agent < agents; agent++) {
    for (uint32_t t = 0; t <= time; t++)
      fleetyard_append(&plan, at[(size_t)t * agents + agent]);
    fleetyard_end_list(&plan);
  }
  free(at);
  return fleetyard_submit_plan(&plan, sink);
}

/* ---- What the library exports ---------------------------------------------- */

/* What the host knows of the policy; docs/conformance.md lists all capabilities. The
 * schema says what `--option NAME=VALUE` may be; the host checks it beforehand. */
static const FleetyardDescriptor descriptor = {
    .struct_size = sizeof descriptor,
    .id = FLEETYARD_TEXT("example-plugin"),
    .name = FLEETYARD_TEXT("example-plugin"),
    .version = FLEETYARD_TEXT("0.1.0"),
    .description =
        FLEETYARD_TEXT("Keeps what is free of collisions at the beginning of the failed paths."),
    .options_schema = FLEETYARD_TEXT(
        "{\"type\": \"object\", \"additionalProperties\": false, \"properties\": {"
        "\"steps\": {\"type\": \"integer\", \"minimum\": 0, \"maximum\": 100000,"
        "\"default\": 10, \"description\": \"Most steps to take.\"}}}"),
    .capabilities = FLEETYARD_CAPABILITY_GRID | FLEETYARD_CAPABILITY_PEBBLE |
                    FLEETYARD_CAPABILITY_DETERMINISTIC,
};

static int32_t configure(void *context, FleetyardStr options, const FleetyardSink *sink) {
  double steps = 10;
  const FleetyardOption known[] = {{"steps", &steps, 0, 100000, NULL}};
  int32_t status = fleetyard_read_options(options, known, 1, sink);
  ((Policy *)context)->steps = (uint32_t)steps;
  return status;
}

FLEETYARD_FAIL_POLICY(descriptor, sizeof(Policy), configure, recover);
