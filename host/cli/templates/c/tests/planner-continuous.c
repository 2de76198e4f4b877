/* The planner without a host: `make check`. */

#include "host.h"

/* Asks the planner about two discs in a room of four by four metres, with a wall in the middle
 * that is `wall_m` long. */
static int32_t plan(double wall_m, const double *starts, const double *goals) {
  const double x[] = {1.9, 2.1, 2.1, 1.9}, y[] = {0, 0, wall_m, wall_m};
  static const uint64_t corner_offsets[] = {0, 4}, offsets[] = {0, 2, 4}, goal_offsets[] = {0, 1, 2};
  const FleetyardWorkspace workspace = {.struct_size = sizeof workspace,
                                        .obstacles = 1,
                                        .max_x_m = 4,
                                        .max_y_m = 4,
                                        .corner_offsets = corner_offsets,
                                        .x_m = x,
                                        .y_m = y};
  const FleetyardEnvironment environment = {.struct_size = sizeof environment,
                                            .representation = FLEETYARD_REPRESENTATION_CONTINUOUS,
                                            .view = &workspace};
  const FleetyardFootprint disc = {.struct_size = sizeof disc, .radius_m = 0.25};
  const FleetyardRobot robot = {.struct_size = sizeof robot, .footprint = &disc, .state_size = 2};
  const FleetyardRobot *robots[] = {&robot};
  const FleetyardInstance instance = {.struct_size = sizeof instance,
                                      .agents = 2,
                                      .environment = &environment,
                                      .robots = robots,
                                      .robot_count = 1,
                                      .motion = FLEETYARD_MOTION_DYNAMICS,
                                      .objective = FLEETYARD_OBJECTIVE_SUM_OF_COSTS,
                                      .start_state_offsets = offsets,
                                      .start_states = starts,
                                      .goal_offsets = goal_offsets,
                                      .goal_state_offsets = offsets,
                                      .goal_states = goals,
                                      .radius_m = 0.25};
  return ask(&instance, number_option("speed_m_per_s", 0.5));
}

int main(void) {
  /* Straight, and who is in the way of another one goes first. */
  CHECK(plan(0.5, (double[]){1, 2, 3, 2}, (double[]){3, 2, 3, 3}) == FLEETYARD_STATUS_SOLVED);
  CHECK(strcmp(answer, "0:(1 2) 2:(1 2) 6:(3 2), 0:(3 2) 2:(3 3)") == 0);
  /* Round the end of the wall: two more knots. */
  CHECK(plan(2, (double[]){1, 1, 1, 3.5}, (double[]){3, 1, 1, 3.5}) == FLEETYARD_STATUS_SOLVED);
  CHECK(strncmp(answer, "0:(1 1) ", 8) == 0 && strstr(answer, ":(3 1), 0:(1 3.5)"));
  CHECK(strstr(answer, " 2.3)") != NULL);
  /* There is no way: the gap is too narrow, or they stand in each other's goals. */
  CHECK(plan(3.6, (double[]){1, 1, 1, 3}, (double[]){3, 1, 1, 3}) == FLEETYARD_STATUS_GAVE_UP);
  CHECK(plan(0.5, (double[]){1, 2, 3, 2}, (double[]){3, 2, 1, 2}) == FLEETYARD_STATUS_GAVE_UP);
  puts("passed");
  return 0;
}
