/* Follows the planner's failed paths for as long as nobody collides, and then waits.
 *
 * So the fleet goes on a little, and the next call of the planner is another question. Put
 * your own algorithm into `recover`.
 */

#include "fleetyard_easy.h"

typedef struct {
  uint32_t steps;
} Policy;

/* ---- The algorithm --------------------------------------------------------- */

/* Whether all agents can go from where they are at a time to where they are next. */
static bool is_safe(const FleetyardGrid *grid, const FleetyardPaths *paths,
                    const uint32_t *next) {
  for (uint32_t a = 0; a < paths->agents; a++) {
    uint32_t now = fleetyard_path_at(&paths->of[a], UINT64_MAX); /* its last cell */
    if (!fleetyard_is_step(grid, now, next[a]))
      return false;
    for (uint32_t b = 0; b < a; b++)
      if (next[a] == next[b] ||
          (next[b] == now && next[a] == fleetyard_path_at(&paths->of[b], UINT64_MAX)))
        return false;
  }
  return true;
}

static int32_t recover(void *context, const FleetyardInstance *instance,
                       const FleetyardPlan *failed, const FleetyardBudget *budget,
                       const FleetyardSink *sink) {
  const FleetyardGrid *grid = fleetyard_grid(instance->environment, sink);
  uint32_t agents = instance->agents, steps = ((const Policy *)context)->steps;
  uint32_t *next = fleetyard_array(agents, sizeof *next);
  FleetyardPaths paths = fleetyard_paths(FLEETYARD_FORM_CELLS, agents);
  (void)budget; /* `cancelled` says when the time is up */
  for (uint32_t agent = 0; agent < agents; agent++)
    fleetyard_add_cell(&paths, agent, instance->starts[agent]);

  /* The planner may have left nothing. */
  for (uint32_t time = 1; failed && time <= steps && !fleetyard_cancelled(sink); time++) {
    for (uint32_t agent = 0; agent < agents; agent++) {
      next[agent] = fleetyard_at(failed, agent, time);
      if (next[agent] == FLEETYARD_NONE)
        next[agent] = instance->starts[agent];
    }
    if (!is_safe(grid, &paths, next))
      break;
    for (uint32_t agent = 0; agent < agents; agent++)
      fleetyard_add_cell(&paths, agent, next[agent]);
  }
  int32_t status = fleetyard_submit(&paths, sink);
  fleetyard_free_paths(&paths);
  free(next);
  return status;
}

/* ---- What the library exports ---------------------------------------------- */

/* What the host knows of the policy; docs/conformance.md lists all capabilities. The
 * schema says what `--option NAME=VALUE` may be; the host checks it beforehand. */
static const FleetyardDescriptor about = {
    .struct_size = sizeof about,
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
                    FLEETYARD_CAPABILITY_MOVE_MASK | FLEETYARD_CAPABILITY_DETERMINISTIC,
};

static void *make(const FleetyardOptions *options, const FleetyardSink *sink) {
  Policy *policy = fleetyard_array(1, sizeof *policy);
  (void)sink;
  policy->steps = (uint32_t)fleetyard_number(options, "steps", 10);
  return policy;
}

FLEETYARD_EXPORT_FAIL_POLICY(about, make, fleetyard_learn_nothing, recover, free);
