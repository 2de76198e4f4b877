/* The planner without a host: `make check`. */

#include "host.h"

/* Asks the planner about a map of rows, `.` where a robot may stand. */
static int32_t plan(uint32_t rows, const char *map, uint32_t agents, const uint32_t *starts,
                    const uint32_t *goals) {
  FleetyardInstance instance =
      instance_of(map_of(rows, map), FLEETYARD_MOTION_PEBBLE, agents, starts, goals);
  return ask(&instance, number_option("attempts", 3));
}

int main(void) {
  /* A shortest path. */
  CHECK(plan(2, "....", 1, (uint32_t[]){0}, (uint32_t[]){1}) == FLEETYARD_STATUS_SOLVED);
  CHECK(strcmp(answer, "0 1") == 0);
  /* Two agents pass each other in a bay. */
  CHECK(plan(2, "....@@.@", 2, (uint32_t[]){0, 3}, (uint32_t[]){3, 0}) == FLEETYARD_STATUS_SOLVED);
  CHECK(strcmp(answer, "0 1 2 3, 3 2 6 2 1 0") == 0);
  /* There is no plan. */
  CHECK(plan(1, ".@.", 1, (uint32_t[]){0}, (uint32_t[]){2}) == FLEETYARD_STATUS_INFEASIBLE);
  CHECK(plan(1, "...", 2, (uint32_t[]){0, 2}, (uint32_t[]){2, 0}) == FLEETYARD_STATUS_GAVE_UP);
  puts("passed");
  return 0;
}
