/* The policy without a host: `make check`. */

#include "host.h"

/* Whether the policy wants the planner called for two agents. */
static bool should_invoke(double period_s, double since_s, uint32_t left) {
  FleetyardFleetStatus status = {.struct_size = sizeof status,
                                 .agents = 2,
                                 .time_s = 100.0,
                                 .since_last_call_s = since_s,
                                 .planning_limit_s = 1.0,
                                 .action_s = 0.5,
                                 .actions_left = (const uint32_t[]){left, 3}};
  FleetyardInvocationPolicy policy = {.struct_size = sizeof policy};
  const FleetyardInvocationPolicyFactory *factory =
      factory_of(FLEETYARD_INVOCATION_POLICY_FACTORY_ID);
  int32_t created = factory->create(factory->context, 0, number_option("period_s", period_s),
                                    &sink, &policy);
  CHECK(created == FLEETYARD_STATUS_SOLVED);
  int32_t now = -1;
  int32_t asked = policy.should_invoke(policy.context, &status, &sink, &now);
  CHECK(asked == FLEETYARD_STATUS_SOLVED);
  policy.destroy(policy.context);
  return now == 1;
}

int main(void) {
  /* When it is time. */
  CHECK(!should_invoke(5, 4.9, 1));
  CHECK(should_invoke(5, 5.0, 1));
  CHECK(should_invoke(2, 2.0, 1));
  /* When somebody is idle. */
  CHECK(should_invoke(5, 0.0, 0));
  puts("passed");
  return 0;
}
