/* The policy without a host: `make check`. */

#include "host.h"

/* Asks the policy about two agents at the ends of a corridor of four cells. */
static void recover(const char *options, const FleetyardPlan *failed) {
  FleetyardGrid grid;
  FleetyardEnvironment environment = environment_of(&grid, 1, "....");
  FleetyardInstance instance = {.struct_size = sizeof instance,
                                .agents = 2,
                                .environment = &environment,
                                .starts = (const uint32_t[]){0, 3},
                                .goal_offsets = (const uint64_t[]){0, 1, 2},
                                .goals = (const uint32_t[]){3, 0}};
  FleetyardFailPolicy policy;
  const FleetyardFailPolicyFactory *factory =
      fleetyard_plugin_entry_v1.get_factory(text(FLEETYARD_FAIL_POLICY_FACTORY_ID));
  CHECK(factory && factory->count() == 1);
  CHECK(factory->create(0, text(options), &sink, &policy) == FLEETYARD_STATUS_SOLVED);
  int32_t status = policy.prepare(policy.context, &environment, &budget, &sink);
  CHECK(status == FLEETYARD_STATUS_SOLVED);
  status = policy.recover(policy.context, &instance, failed, &budget, &sink);
  CHECK(status == FLEETYARD_STATUS_SOLVED);
  policy.destroy(policy.context);
}

int main(void) {
  static const uint64_t offsets[] = {0, 4, 8};
  static const uint32_t cells[] = {0, 1, 2, 3, 3, 2, 1, 0}, nowhere[8] = {0, 9, 9, 9, 3, 3, 3, 3};
  FleetyardPlan through = {sizeof through, 2, offsets, cells};
  FleetyardPlan away = {sizeof away, 2, offsets, nowhere};
  /* They stop before they go through each other. */
  recover("{}", &through);
  CHECK(strcmp(answer, "0 1, 3 2") == 0);
  /* They take no more steps than they may. */
  recover("{\"steps\": 0}", &through);
  CHECK(strcmp(answer, "0, 3") == 0);
  /* They wait where there is nothing to follow. */
  recover("{}", &away);
  CHECK(strcmp(answer, "0, 3") == 0);
  recover("{}", NULL);
  CHECK(strcmp(answer, "0, 3") == 0);
  puts("passed");
  return 0;
}
