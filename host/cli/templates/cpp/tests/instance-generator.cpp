/* The generator without a host: `make check`. */

#include "../example_plugin.cpp"
#include "host.hpp"

/* The goals of two agents in a corridor: the first has nothing to do, the second has a
 * goal, and there is one task. */
static Lists generate(const char *row, const std::vector<Cell> &cells, Cell goal,
                      const std::vector<Cell> &task) {
  Host host;
  const Map map(1, row);
  Question next(map.environment, FLEETYARD_MOTION_PEBBLE, cells, {goal});
  next.offsets = {0, 0, 1};
  next.raw.goal_offsets = next.offsets.data();
  const std::vector<std::uint64_t> ids{7}, task_offsets{0, task.size()};
  FleetyardFleetState state{};
  state.struct_size = sizeof state;
  state.tasks = 1;
  state.next = &next.raw;
  state.task_ids = ids.data();
  state.task_offsets = task_offsets.data();
  state.task_places = task.data();
  const double released_s = 0;
  state.task_released_s = &released_s;
  const Given given("most_tasks", 10);
  NearestIdle generator(given.options);
  try {
    generator.generate(fleetyard::FleetState(&state), host.budget, host.sink);
  } catch (const fleetyard::Failure &failure) {
    CHECK(failure.status() == fleetyard::Status::gave_up);
  }
  return host.answer;
}

int main() {
  /* Who is idle gets the task. */
  CHECK(generate("......", {0, 5}, 2, {4, 1}) == Lists({{4, 1}, {2}}));
  /* No two agents end in one cell: the idle one waits, or makes way. */
  CHECK(generate("....", {0, 3}, 1, {2, 1}) == Lists({{0}, {1}}));
  CHECK(generate("....", {1, 3}, 1, {2, 1}) == Lists({{0}, {1}}));
  /* Nobody is sent behind a wall. */
  CHECK(generate("..@.", {0, 1}, 1, {1, 3}) == Lists({{0}, {1}}));
  /* No cell is left. */
  CHECK(generate(".@.", {0, 2}, 0, {0, 0}).empty());
  std::cout << "passed\n";
}
