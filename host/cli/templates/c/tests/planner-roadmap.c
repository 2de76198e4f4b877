/* The planner without a host: `make check`. */

#include "host.h"

/* A corridor of four vertices, a metre and a second apart, with a bay at the third.
 *
 *     0 - 1 - 2 - 3
 *             |
 *             4
 */
static const FleetyardEnvironment *corridor(void) {
  static const double x[] = {0, 1, 2, 3, 2}, y[] = {0, 0, 0, 0, -1}, ones[] = {1, 1, 1, 1, 1, 1, 1, 1};
  static const uint64_t edge_offsets[] = {0, 1, 3, 6, 7, 8};
  static const uint32_t targets[] = {1, 0, 2, 1, 3, 4, 2, 2};
  static const FleetyardRoadmap roadmap = {.struct_size = sizeof roadmap,
                                           .vertices = 5,
                                           .edges = 8,
                                           .x_m = x,
                                           .y_m = y,
                                           .edge_offsets = edge_offsets,
                                           .targets = targets,
                                           .length_m = ones,
                                           .duration_s = ones,
                                           .speed_m_per_s = 1.0,
                                           .separation_m = 0.5,
                                           .flags = FLEETYARD_ROADMAP_SYMMETRIC};
  static const FleetyardEnvironment environment = {.struct_size = sizeof environment,
                                                   .representation =
                                                       FLEETYARD_REPRESENTATION_ROADMAP,
                                                   .view = &roadmap};
  return &environment;
}

static int32_t plan(uint32_t agents, const uint32_t *starts, const uint32_t *goals) {
  FleetyardInstance instance =
      instance_of(corridor(), FLEETYARD_MOTION_STOP_GO, agents, starts, goals);
  return ask(&instance, number_option("attempts", 4));
}

int main(void) {
  /* A shortest path. */
  CHECK(plan(1, (uint32_t[]){0}, (uint32_t[]){4}) == FLEETYARD_STATUS_SOLVED);
  CHECK(strcmp(answer, "0@0 1@1 2@2 4@3") == 0);
  /* One follows the other when the edge is free. */
  CHECK(plan(2, (uint32_t[]){1, 0}, (uint32_t[]){3, 2}) == FLEETYARD_STATUS_SOLVED);
  CHECK(strcmp(answer, "1@0 2@1 3@2, 0@0-1 1@2 2@3") == 0);
  /* One waits in the bay until the other has passed. */
  CHECK(plan(2, (uint32_t[]){0, 2}, (uint32_t[]){3, 0}) == FLEETYARD_STATUS_SOLVED);
  CHECK(strcmp(answer, "0@0 1@1 2@2 3@3, 2@0 4@1-3 2@4 1@5 0@6") == 0);
  /* There is no plan. */
  CHECK(plan(2, (uint32_t[]){0, 1}, (uint32_t[]){1, 0}) == FLEETYARD_STATUS_GAVE_UP);
  puts("passed");
  return 0;
}
