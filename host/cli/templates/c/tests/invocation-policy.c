/* The policy without a host: `make check`. */

#include "host.h"

/* What the policy answers about two agents. */
static int32_t should_invoke(const char *options, double since_s, uint32_t left) {
  FleetyardFleetStatus status = {.struct_size = sizeof status,
                                 .agents = 2,
                                 .time_s = 100.0,
                                 .since_last_call_s = since_s,
                                 .planning_limit_s = 1.0,
                                 .action_s = 0.5,
                                 .actions_left = (const uint32_t[]){left, 3}};
  FleetyardInvocationPolicy policy;
  const FleetyardInvocationPolicyFactory *factory =
      fleetyard_plugin_entry_v1.get_factory(text(FLEETYARD_INVOCATION_POLICY_FACTORY_ID));
  CHECK(factory && factory->count() == 1);
  CHECK(factory->create(0, text(options), &sink, &policy) == FLEETYARD_STATUS_SOLVED);
  int32_t invoke = policy.should_invoke(policy.context, &status, &sink);
  policy.destroy(policy.context);
  return invoke;
}

int main(void) {
  /* When it is time. */
  CHECK(should_invoke("{}", 4.9, 1) == FLEETYARD_INVOKE_NOT_YET);
  CHECK(should_invoke("{}", 5.0, 1) == FLEETYARD_INVOKE_NOW);
  CHECK(should_invoke("{\"period_s\": 2}", 2.0, 1) == FLEETYARD_INVOKE_NOW);
  /* When somebody is idle. */
  CHECK(should_invoke("{}", 0.0, 0) == FLEETYARD_INVOKE_NOW);
  puts("passed");
  return 0;
}
