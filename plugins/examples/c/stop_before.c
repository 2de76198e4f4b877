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

#include "fleetyard.h"

#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#define NOBODY UINT32_MAX
#define TEXT(literal) {(const uint8_t *)(literal), sizeof(literal) - 1}

static int32_t fail(const FleetyardSink *sink, int32_t status, const char *message) {
  sink->fail(sink->context, (FleetyardStr){(const uint8_t *)message, strlen(message)});
  return status;
}

/* ---- The policy -------------------------------------------------------------- */

typedef struct {
  uint32_t rows, cols; /* 0 before prepare */
  uint8_t *passable;
} Policy;

static int32_t prepare(void *context, const FleetyardEnvironment *environment,
                       const FleetyardBudget *budget, const FleetyardSink *sink) {
  Policy *policy = context;
  (void)budget;
  if (environment->representation != FLEETYARD_REPRESENTATION_GRID)
    return fail(sink, FLEETYARD_STATUS_UNSUPPORTED, "this policy knows grids only");
  const FleetyardGrid *grid = environment->view;
  if (grid->connectivity != 4)
    return fail(sink, FLEETYARD_STATUS_UNSUPPORTED, "this policy knows 4 neighbours only");
  size_t cells = (size_t)grid->rows * grid->cols;
  uint8_t *passable = malloc(cells);
  if (!passable)
    return fail(sink, FLEETYARD_STATUS_INTERNAL_ERROR, "out of memory");
  memcpy(passable, grid->passable, cells);
  free(policy->passable);
  *policy = (Policy){grid->rows, grid->cols, passable};
  return FLEETYARD_STATUS_SOLVED;
}

/* The cell of an agent of the failed plan; after its last cell it stays there. */
static uint32_t at(const FleetyardPlan *plan, uint32_t agent, uint64_t time) {
  uint64_t length = plan->offsets[agent + 1] - plan->offsets[agent];
  return plan->cells[plan->offsets[agent] + (time < length ? time : length - 1)];
}

static bool is_move(const Policy *policy, uint32_t from, uint32_t to) {
  uint64_t cells = (uint64_t)policy->rows * policy->cols;
  if (to >= cells || !policy->passable[to])
    return false;
  uint32_t low = from < to ? from : to, high = from < to ? to : from;
  return low == high || high - low == policy->cols ||
         (high - low == 1 && high % policy->cols != 0);
}

/* True if the step from `time` to the next has no fault. `stands` has the agent in each cell
 * before it and after it; in between it is put together in `next`. */
static bool step(const Policy *policy, const FleetyardPlan *plan, uint64_t time,
                 uint32_t *stands, uint32_t *next) {
  bool sound = true;
  uint32_t agents = plan->agents, agent = 0;
  for (; agent < agents && sound; agent++) {
    uint32_t from = at(plan, agent, time), to = at(plan, agent, time + 1);
    sound = is_move(policy, from, to) && next[to] == NOBODY;
    uint32_t other = sound ? stands[to] : NOBODY;
    if (other != NOBODY && other != agent && at(plan, other, time + 1) == from)
      sound = false; /* through one another */
    if (sound)
      next[to] = agent;
  }
  /* `next` is empty again, and `stands` what the step has made of it. */
  for (uint32_t each = 0; each < agents && sound; each++)
    stands[at(plan, each, time)] = NOBODY;
  for (uint32_t each = 0; each < (sound ? agents : agent); each++) {
    uint32_t to = at(plan, each, time + 1);
    if ((uint64_t)to < (uint64_t)policy->rows * policy->cols)
      next[to] = NOBODY;
    if (sound)
      stands[to] = each;
  }
  return sound;
}

/* The number of steps before the first fault. `stands` says who is where at first. */
static uint64_t sound_steps(const Policy *policy, const FleetyardInstance *instance,
                            const FleetyardPlan *plan, const FleetyardSink *sink,
                            uint32_t *stands, uint32_t *next) {
  uint64_t longest = 0, time = 0;
  for (uint32_t agent = 0; agent < plan->agents; agent++) {
    uint64_t length = plan->offsets[agent + 1] - plan->offsets[agent];
    if (length == 0 || at(plan, agent, 0) != instance->starts[agent])
      return 0;
    longest = length > longest ? length : longest;
  }
  while (time + 1 < longest && !sink->cancelled(sink->context) &&
         step(policy, plan, time, stands, next))
    time++;
  return time;
}

static int32_t recover(void *context, const FleetyardInstance *instance,
                       const FleetyardPlan *failed, const FleetyardBudget *budget,
                       const FleetyardSink *sink) {
  const Policy *policy = context;
  uint32_t agents = instance->agents;
  size_t cells = (size_t)policy->rows * policy->cols;
  int32_t status = FLEETYARD_STATUS_SOLVED;
  (void)budget; /* one look at every cell of the plan; `cancelled` is enough */
  if (!policy->passable)
    return fail(sink, FLEETYARD_STATUS_INVALID_INPUT, "`recover` came before `prepare`");
  if (failed && failed->agents != agents)
    return fail(sink, FLEETYARD_STATUS_INVALID_INPUT, "the failed plan has other agents");

  uint32_t *stands = malloc(cells * sizeof *stands), *next = malloc(cells * sizeof *next);
  uint64_t *offsets = malloc(((size_t)agents + 1) * sizeof *offsets);
  uint32_t *path = NULL;
  if (!stands || !next || !offsets) {
    status = fail(sink, FLEETYARD_STATUS_INTERNAL_ERROR, "out of memory");
    goto end;
  }
  memset(stands, 0xFF, cells * sizeof *stands);
  memset(next, 0xFF, cells * sizeof *next);
  for (uint32_t agent = 0; agent < agents; agent++) {
    uint32_t start = instance->starts[agent];
    if (!policy->passable[start] || stands[start] != NOBODY) {
      status = fail(sink, FLEETYARD_STATUS_INVALID_INPUT,
                    "somebody starts on an obstacle or another agent");
      goto end;
    }
    stands[start] = agent;
  }

  uint64_t steps = failed ? sound_steps(policy, instance, failed, sink, stands, next) : 0;
  path = malloc((size_t)agents * (size_t)(steps + 1) * sizeof *path);
  if (!path) {
    status = fail(sink, FLEETYARD_STATUS_INTERNAL_ERROR, "out of memory");
    goto end;
  }
  for (uint32_t agent = 0; agent < agents; agent++) {
    offsets[agent] = agent * (steps + 1);
    path[offsets[agent]] = instance->starts[agent];
    for (uint64_t time = 1; time <= steps; time++)
      path[offsets[agent] + time] = at(failed, agent, time);
  }
  offsets[agents] = agents * (steps + 1);
  FleetyardPlan plan = {sizeof plan, agents, offsets, path};
  sink->submit_plan(sink->context, &plan);

end:
  free(stands);
  free(next);
  free(offsets);
  free(path);
  return status;
}

static void destroy(void *context) {
  Policy *policy = context;
  free(policy->passable);
  free(policy);
}

/* ---- What the library exports ------------------------------------------------ */

static const FleetyardDescriptor stop_before = {
    .struct_size = sizeof(FleetyardDescriptor),
    .id = TEXT("stop-before"),
    .name = TEXT("Stop before the fault (C example)"),
    .version = TEXT("0.1.0"),
    .description = TEXT("Follows the failed plan up to the last step before its first fault."),
    .license = TEXT("MIT OR Apache-2.0"),
    .capabilities = FLEETYARD_CAPABILITY_GRID | FLEETYARD_CAPABILITY_PEBBLE |
                    FLEETYARD_CAPABILITY_WINDOWED | FLEETYARD_CAPABILITY_DUPLICATE_GOALS |
                    FLEETYARD_CAPABILITY_DETERMINISTIC,
};

static uint32_t count(void) { return 1; }

static const FleetyardDescriptor *descriptor(uint32_t index) {
  return index == 0 ? &stop_before : NULL;
}

static int32_t create(uint32_t index, FleetyardStr options, const FleetyardSink *sink,
                      FleetyardFailPolicy *out) {
  /* An object with a member has a colon; the host lets no option through without a schema. */
  if (index != 0 || (options.len != 0 && memchr(options.ptr, ':', options.len)))
    return fail(sink, FLEETYARD_STATUS_INVALID_INPUT, "this policy has no options");
  Policy *policy = calloc(1, sizeof *policy);
  if (!policy)
    return fail(sink, FLEETYARD_STATUS_INTERNAL_ERROR, "out of memory");
  *out = (FleetyardFailPolicy){
      .struct_size = sizeof *out,
      .context = policy,
      .prepare = prepare,
      .recover = recover,
      .destroy = destroy,
  };
  return FLEETYARD_STATUS_SOLVED;
}

static const FleetyardFailPolicyFactory factory = {
    .struct_size = sizeof(FleetyardFailPolicyFactory),
    .count = count,
    .descriptor = descriptor,
    .create = create,
};

static const void *get_factory(FleetyardStr id) {
  static const char own[] = FLEETYARD_FAIL_POLICY_FACTORY_ID;
  return id.len == sizeof own - 1 && memcmp(id.ptr, own, id.len) == 0 ? &factory : NULL;
}

const FleetyardPluginEntry fleetyard_plugin_entry_v1 = {
    .struct_size = sizeof(FleetyardPluginEntry),
    .abi_major = FLEETYARD_ABI_MAJOR,
    .abi_minor = FLEETYARD_ABI_MINOR,
    .get_factory = get_factory,
};
