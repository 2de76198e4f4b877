/* The planner without a host: `make check`. */

#include "../example_plugin.cpp"
#include "host.hpp"

/* The paths that the planner finds; none, and the status, when it fails. */
static Lists plan(const Map &map, const std::vector<Cell> &starts, const std::vector<Cell> &goals,
                  fleetyard::Status *status = nullptr) {
  Host host;
  const Question question(map.environment, FLEETYARD_MOTION_PEBBLE, starts, goals);
  const Given given("attempts", 3);
  Prioritized planner(given.options);
  try {
    planner.plan(fleetyard::Instance(&question.raw), host.budget, host.sink);
  } catch (const fleetyard::Failure &failure) {
    CHECK(status);
    *status = failure.status();
  }
  return host.answer;
}

int main() {
  /* A shortest path. */
  CHECK(plan(Map(2, "...."), {0}, {1}) == Lists({{0, 1}}));
  /* Two agents pass each other in a bay. */
  const Map bay(2, "....@@.@");
  CHECK(plan(bay, {0, 3}, {3, 0}) == Lists({{0, 1, 2, 3}, {3, 2, 6, 2, 1, 0}}));
  /* There is no plan. */
  fleetyard::Status status{};
  CHECK(plan(Map(1, ".@."), {0}, {2}, &status).empty());
  CHECK(status == fleetyard::Status::infeasible);
  CHECK(plan(Map(1, "..."), {0, 2}, {2, 0}, &status).empty());
  CHECK(status == fleetyard::Status::gave_up);
  std::cout << "passed\n";
}
