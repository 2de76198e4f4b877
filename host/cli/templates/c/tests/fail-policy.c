/* The policy without a host: `make check`. */

#include "host.h"

/* Asks the policy about two agents at the ends of a corridor of four cells. */
static void recover(double steps, const uint32_t *cells) {
  const FleetyardEnvironment *environment = map_of(1, "....");
  FleetyardInstance instance = instance_of(environment, FLEETYARD_MOTION_PEBBLE, 2,
                                           (uint32_t[]){0, 3}, (uint32_t[]){3, 0});
  FleetyardCells body = {sizeof body, 0, cells};
  FleetyardPlan failed = {.struct_size = sizeof failed,
                          .agents = 2,
                          .form = FLEETYARD_FORM_CELLS,
                          .offsets = (const uint64_t[]){0, 4, 8},
                          .body = &body};
  FleetyardFailPolicy policy = {.struct_size = sizeof policy};
  const FleetyardFailPolicyFactory *factory = factory_of(FLEETYARD_FAIL_POLICY_FACTORY_ID);
  int32_t status = factory->create(factory->context, 0, number_option("steps", steps), &sink,
                                   &policy);
  CHECK(status == FLEETYARD_STATUS_SOLVED);
  status = policy.prepare(policy.context, environment, &budget, &sink);
  CHECK(status == FLEETYARD_STATUS_SOLVED);
  status = policy.recover(policy.context, &instance, cells ? &failed : NULL, &budget, &sink);
  CHECK(status == FLEETYARD_STATUS_SOLVED);
  policy.destroy(policy.context);
}

int main(void) {
  static const uint32_t through[] = {0, 1, 2, 3, 3, 2, 1, 0}, away[] = {0, 9, 9, 9, 3, 3, 3, 3};
  /* They stop before they go through each other. */
  recover(10, through);
  CHECK(strcmp(answer, "0 1, 3 2") == 0);
  /* They take no more steps than they may. */
  recover(0, through);
  CHECK(strcmp(answer, "0, 3") == 0);
  /* They wait where there is nothing to follow. */
  recover(10, away);
  CHECK(strcmp(answer, "0, 3") == 0);
  recover(10, NULL);
  CHECK(strcmp(answer, "0, 3") == 0);
  puts("passed");
  return 0;
}
