/* The generator without a host: `make check`. */

#include "host.h"

/* Asks the generator about two agents in a corridor: the first has nothing to do, the
 * second has a goal, and there is one task, of two cells. */
static int32_t generate(const char *map, const uint32_t *cells, uint32_t goal,
                        const uint32_t *task) {
  FleetyardInstance next = instance_of(map_of(1, map), FLEETYARD_MOTION_PEBBLE, 2, cells, &goal);
  next.goal_offsets = (const uint64_t[]){0, 0, 1};
  FleetyardFleetState state = {.struct_size = sizeof state,
                               .tasks = 1,
                               .next = &next,
                               .task_ids = (const uint64_t[]){7},
                               .task_offsets = (const uint64_t[]){0, 2},
                               .task_places = task,
                               .task_released_s = (const double[]){0}};
  FleetyardInstanceGenerator generator = {.struct_size = sizeof generator};
  const FleetyardInstanceGeneratorFactory *factory =
      factory_of(FLEETYARD_INSTANCE_GENERATOR_FACTORY_ID);
  int32_t status = factory->create(factory->context, 0, number_option("most_tasks", 10), &sink,
                                   &generator);
  CHECK(status == FLEETYARD_STATUS_SOLVED);
  status = generator.prepare(generator.context, next.environment, &budget, &sink);
  CHECK(status == FLEETYARD_STATUS_SOLVED);
  status = generator.generate(generator.context, &state, &budget, &sink);
  generator.destroy(generator.context);
  return status;
}

int main(void) {
  /* Who is idle gets the task. */
  generate("......", (uint32_t[]){0, 5}, 2, (uint32_t[]){4, 1});
  CHECK(strcmp(answer, "4 1, 2") == 0);
  /* No two agents end in one cell: the idle one waits, or makes way. */
  generate("....", (uint32_t[]){0, 3}, 1, (uint32_t[]){2, 1});
  CHECK(strcmp(answer, "0, 1") == 0);
  generate("....", (uint32_t[]){1, 3}, 1, (uint32_t[]){2, 1});
  CHECK(strcmp(answer, "2, 1") == 0);
  /* Nobody is sent behind a wall. */
  generate("..@.", (uint32_t[]){0, 1}, 1, (uint32_t[]){1, 3});
  CHECK(strcmp(answer, "0, 1") == 0);
  /* No cell is left. */
  int32_t status = generate(".@.", (uint32_t[]){0, 2}, 0, (uint32_t[]){0, 0});
  CHECK(status == FLEETYARD_STATUS_GAVE_UP);
  puts("passed");
  return 0;
}
