/* An invocation policy in one C file: calls the planner when enough agents have next to
 * nothing left to do, and at the latest after a minute.
 *
 * It has no options and no state.
 *
 * Build: cc -std=c11 -O2 -fPIC -shared -fvisibility=hidden -I ABI/include
 *        -o when_idle.so when_idle.c
 */

#include "fleetyard_easy.h"

/* A tenth of the fleet, rounded up, with at most so many actions left. */
#define FEW_ACTIONS 2
#define SHARE 10
#define LONGEST_S 60.0

static int32_t should_invoke(void *context, const FleetyardFleetStatus *status,
                             const FleetyardSink *sink, int32_t *out) {
  uint64_t idle = 0;
  (void)context, (void)sink;
  for (uint32_t agent = 0; agent < status->agents; agent++)
    idle += status->actions_left[agent] <= FEW_ACTIONS;
  bool many = idle > 0 && idle * SHARE >= status->agents;
  *out = many || status->since_last_call_s >= LONGEST_S ? 1 : 0;
  return FLEETYARD_STATUS_SOLVED;
}

/* ---- What the library exports ------------------------------------------------ */

static const FleetyardDescriptor when_idle = {
    .struct_size = sizeof(FleetyardDescriptor),
    .id = FLEETYARD_TEXT("when-idle"),
    .name = FLEETYARD_TEXT("When idle (C example)"),
    .version = FLEETYARD_TEXT("0.1.0"),
    .description = FLEETYARD_TEXT(
        "Calls the planner when a tenth of the fleet has at most two actions "
        "left, and once a minute."),
    .license = FLEETYARD_TEXT("MIT OR Apache-2.0"),
};

FLEETYARD_EXPORT_INVOCATION_POLICY(when_idle, fleetyard_make_nothing, should_invoke, free);
