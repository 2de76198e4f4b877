/* The policy without a host: `make check`. */

#include "../example_plugin.cpp"
#include "host.hpp"

/* What the policy answers about two agents. */
static bool should_invoke(double period_s, double since_s, std::uint32_t left) {
  const Host host;
  const std::vector<std::uint32_t> actions_left{left, 3};
  const FleetyardFleetStatus status{
      sizeof status, 2, 100.0, since_s, 0.1, 0.5, actions_left.data(), {}};
  const Given given("period_s", period_s);
  Periodic policy(given.options);
  return policy.should_invoke(fleetyard::FleetStatus(&status), host.sink);
}

int main() {
  /* When it is time. */
  CHECK(!should_invoke(5, 4.9, 1));
  CHECK(should_invoke(5, 5.0, 1));
  CHECK(should_invoke(2, 2.0, 1));
  /* When somebody is idle. */
  CHECK(should_invoke(5, 0.0, 0));
  std::cout << "passed\n";
}
