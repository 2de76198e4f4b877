/* An invocation policy in one C file: calls the planner when enough agents have next to
 * nothing left to do, and at the latest after a minute.
 *
 * It has no options and no state, so one object serves all.
 *
 * Build: cc -std=c11 -O2 -fPIC -shared -fvisibility=hidden -I ABI/include
 *        -o when_idle.so when_idle.c
 */

#include "fleetyard.h"

#include <string.h>

#define TEXT(literal) {(const uint8_t *)(literal), sizeof(literal) - 1}

/* A tenth of the fleet, rounded up, with at most so many actions left. */
#define FEW_ACTIONS 2
#define SHARE 10
#define LONGEST_S 60.0

static int32_t should_invoke(void *context, const FleetyardFleetStatus *status,
                             const FleetyardSink *sink) {
  uint64_t idle = 0;
  (void)context;
  if (status->struct_size != sizeof *status) {
    sink->fail(sink->context, (FleetyardStr)TEXT("FleetyardFleetStatus has another size"));
    return -FLEETYARD_STATUS_INVALID_INPUT;
  }
  for (uint32_t agent = 0; agent < status->agents; agent++)
    idle += status->actions_left[agent] <= FEW_ACTIONS;
  return (idle > 0 && idle * SHARE >= status->agents) || status->since_last_call_s >= LONGEST_S
             ? FLEETYARD_INVOKE_NOW
             : FLEETYARD_INVOKE_NOT_YET;
}

static void destroy(void *context) { (void)context; }

/* ---- What the library exports ------------------------------------------------ */

static const FleetyardDescriptor when_idle = {
    .struct_size = sizeof(FleetyardDescriptor),
    .id = TEXT("when-idle"),
    .name = TEXT("When idle (C example)"),
    .version = TEXT("0.1.0"),
    .description = TEXT("Calls the planner when a tenth of the fleet has at most two actions "
                        "left, and once a minute."),
    .license = TEXT("MIT OR Apache-2.0"),
};

static uint32_t count(void) { return 1; }

static const FleetyardDescriptor *descriptor(uint32_t index) {
  return index == 0 ? &when_idle : NULL;
}

static int32_t create(uint32_t index, FleetyardStr options, const FleetyardSink *sink,
                      FleetyardInvocationPolicy *out) {
  /* An object with a member has a colon; the host lets no option through without a schema. */
  if (index != 0 || (options.len != 0 && memchr(options.ptr, ':', options.len))) {
    sink->fail(sink->context, (FleetyardStr)TEXT("this policy has no options"));
    return FLEETYARD_STATUS_INVALID_INPUT;
  }
  *out = (FleetyardInvocationPolicy){
      .struct_size = sizeof *out,
      .should_invoke = should_invoke,
      .destroy = destroy,
  };
  return FLEETYARD_STATUS_SOLVED;
}

static const FleetyardInvocationPolicyFactory factory = {
    .struct_size = sizeof(FleetyardInvocationPolicyFactory),
    .count = count,
    .descriptor = descriptor,
    .create = create,
};

static const void *get_factory(FleetyardStr id) {
  static const char own[] = FLEETYARD_INVOCATION_POLICY_FACTORY_ID;
  return id.len == sizeof own - 1 && memcmp(id.ptr, own, id.len) == 0 ? &factory : NULL;
}

const FleetyardPluginEntry fleetyard_plugin_entry_v1 = {
    .struct_size = sizeof(FleetyardPluginEntry),
    .abi_major = FLEETYARD_ABI_MAJOR,
    .abi_minor = FLEETYARD_ABI_MINOR,
    .get_factory = get_factory,
};
