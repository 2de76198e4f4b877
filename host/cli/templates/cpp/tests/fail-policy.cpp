/* The policy without a host: `make check`. */

#include "../example_plugin.cpp"
#include "host.hpp"

/* What the policy does for two agents at the ends of a corridor of four cells. */
static Lists recover(double steps, const std::optional<Lists> &failed) {
  Host host;
  const Map map(1, "....");
  const Question question(map.environment, FLEETYARD_MOTION_PEBBLE, {0, 3}, {3, 0});
  const fleetyard::Plan plan(failed.value_or(Lists()));
  const FleetyardCells cells{sizeof cells, 0, plan.entries().data()};
  const FleetyardPlan raw{sizeof raw,           2,      FLEETYARD_FORM_CELLS, 0,
                          plan.offsets().data(), &cells, {}};
  std::optional<fleetyard::PlanView> view;
  if (failed)
    view.emplace(&raw);
  const Given given("steps", steps);
  SafePrefix policy(given.options);
  policy.recover(fleetyard::Instance(&question.raw), view, host.budget, host.sink);
  return host.answer;
}

int main() {
  const Lists through{{0, 1, 2, 3}, {3, 2, 1, 0}}, stay{{0}, {3}};
  /* They stop before they go through each other. */
  CHECK(recover(10, through) == Lists({{0, 1}, {3, 2}}));
  /* They take no more steps than they may. */
  CHECK(recover(0, through) == stay);
  /* They wait where there is nothing to follow. */
  CHECK(recover(10, Lists{{0, 9}, {3}}) == stay);
  CHECK(recover(10, std::nullopt) == stay);
  std::cout << "passed\n";
}
