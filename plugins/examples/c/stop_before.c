/* A fail policy in one C file: everybody follows the plan that failed up to the last step
 * before its first fault, and waits there.
 *
 * A fault is a collision, or a step that is no move. What comes before is as good as a
 * plan; what comes after is the planner's to think over again. Where nothing is left of
 * the plan, everybody stays.
 *
 * Build: cc -std=c11 -O2 -fPIC -shared -fvisibility=hidden -I ABI/include
 *        -o stop_before.so stop_before.c
 */

#include "fleetyard_easy.h"

#define NOBODY FLEETYARD_NONE

/* True if the step from `time` to the next has no fault. `stands` is who is where before
 * it and after it; in between it is put together in `next`. */
static bool step(const FleetyardGrid *grid, const FleetyardPlan *plan, uint64_t time,
                 uint32_t *stands, uint32_t *next) {
  bool sound = true;
  uint32_t agents = plan->agents, agent = 0;
  for (; agent < agents && sound; agent++) {
    uint32_t from = fleetyard_at(plan, agent, time), to = fleetyard_at(plan, agent, time + 1);
    sound = fleetyard_is_step(grid, from, to) && next[to] == NOBODY;
    uint32_t other = sound ? stands[to] : NOBODY;
    if (other != NOBODY && other != agent && fleetyard_at(plan, other, time + 1) == from)
      sound = false; /* through one another */
    if (sound)
      next[to] = agent;
  }
  /* `next` is empty again, and `stands` what the step has made of it. */
  for (uint32_t each = 0; each < agents && sound; each++)
    stands[fleetyard_at(plan, each, time)] = NOBODY;
  for (uint32_t each = 0; each < (sound ? agents : agent); each++) {
    uint32_t to = fleetyard_at(plan, each, time + 1);
    if (to < grid->rows * grid->cols)
      next[to] = NOBODY;
    if (sound)
      stands[to] = each;
  }
  return sound;
}

/* The number of steps before the first fault. `stands` says who is where at first. */
static uint64_t sound_steps(const FleetyardGrid *grid, const FleetyardInstance *instance,
                            const FleetyardPlan *plan, const FleetyardSink *sink,
                            uint32_t *stands, uint32_t *next) {
  uint64_t longest = 0, time = 0;
  for (uint32_t agent = 0; agent < plan->agents; agent++) {
    uint64_t length = plan->offsets[agent + 1] - plan->offsets[agent];
    if (length == 0 || fleetyard_at(plan, agent, 0) != instance->starts[agent])
      return 0;
    longest = length > longest ? length : longest;
  }
  while (time + 1 < longest && !fleetyard_cancelled(sink) &&
         step(grid, plan, time, stands, next))
    time++;
  return time;
}

static int32_t recover(void *context, const FleetyardInstance *instance,
                       const FleetyardPlan *failed, const FleetyardBudget *budget,
                       const FleetyardSink *sink) {
  const FleetyardGrid *grid = fleetyard_grid(instance->environment, sink);
  uint32_t agents = instance->agents, cells = grid->rows * grid->cols;
  int32_t status = FLEETYARD_STATUS_INVALID_INPUT;
  (void)context;
  (void)budget; /* one look at every cell of the plan; `cancelled` is enough */

  uint32_t *stands = fleetyard_array(cells, sizeof *stands);
  uint32_t *next = fleetyard_array(cells, sizeof *next);
  memset(stands, 0xFF, cells * sizeof *stands);
  memset(next, 0xFF, cells * sizeof *next);
  for (uint32_t agent = 0; agent < agents; agent++) {
    uint32_t start = instance->starts[agent];
    if (!grid->passable[start] || stands[start] != NOBODY) {
      fleetyard_fail(sink, status, "somebody starts on an obstacle or another agent");
      goto end;
    }
    stands[start] = agent;
  }

  uint64_t steps = failed ? sound_steps(grid, instance, failed, sink, stands, next) : 0;
  FleetyardPaths paths = fleetyard_paths(FLEETYARD_FORM_CELLS, agents);
  for (uint32_t agent = 0; agent < agents; agent++) {
    fleetyard_add_cell(&paths, agent, instance->starts[agent]);
    for (uint64_t time = 1; time <= steps; time++)
      fleetyard_add_cell(&paths, agent, fleetyard_at(failed, agent, time));
  }
  status = fleetyard_submit(&paths, sink);
  fleetyard_free_paths(&paths);

end:
  free(stands);
  free(next);
  return status;
}

/* ---- What the library exports ------------------------------------------------ */

static const FleetyardDescriptor stop_before = {
    .struct_size = sizeof(FleetyardDescriptor),
    .id = FLEETYARD_TEXT("stop-before"),
    .name = FLEETYARD_TEXT("Stop before the fault (C example)"),
    .version = FLEETYARD_TEXT("0.1.0"),
    .description = FLEETYARD_TEXT(
        "Follows the failed plan up to the last step before its first fault."),
    .license = FLEETYARD_TEXT("MIT OR Apache-2.0"),
    .capabilities = FLEETYARD_CAPABILITY_GRID | FLEETYARD_CAPABILITY_PEBBLE |
                    FLEETYARD_CAPABILITY_MOVE_MASK | FLEETYARD_CAPABILITY_IDLE |
                    FLEETYARD_CAPABILITY_WINDOWED | FLEETYARD_CAPABILITY_DUPLICATE_GOALS |
                    FLEETYARD_CAPABILITY_DETERMINISTIC,
};

FLEETYARD_EXPORT_FAIL_POLICY(stop_before, fleetyard_make_nothing, fleetyard_learn_nothing, recover, free);
