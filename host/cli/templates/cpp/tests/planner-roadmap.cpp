/* The planner without a host: `make check`. */

#include "../example_plugin.cpp"
#include "host.hpp"

#include <sstream>

/* A corridor of four vertices, a metre and a second apart, with a bay at the third.
 *
 *     0 - 1 - 2 - 3
 *             |
 *             4
 */
struct Corridor {
  std::vector<double> x{0, 1, 2, 3, 2}, y{0, 0, 0, 0, -1}, ones = std::vector<double>(8, 1.0);
  std::vector<std::uint64_t> edge_offsets{0, 1, 3, 6, 7, 8};
  std::vector<std::uint32_t> targets{1, 0, 2, 1, 3, 4, 2, 2};
  FleetyardRoadmap roadmap{};
  FleetyardEnvironment environment{};

  Corridor() {
    roadmap.struct_size = sizeof roadmap;
    roadmap.vertices = 5;
    roadmap.edges = 8;
    roadmap.x_m = x.data();
    roadmap.y_m = y.data();
    roadmap.edge_offsets = edge_offsets.data();
    roadmap.targets = targets.data();
    roadmap.length_m = roadmap.duration_s = ones.data();
    roadmap.speed_m_per_s = 1.0;
    roadmap.separation_m = 0.5;
    roadmap.flags = FLEETYARD_ROADMAP_SYMMETRIC;
    environment.struct_size = sizeof environment;
    environment.representation = FLEETYARD_REPRESENTATION_ROADMAP;
    environment.view = &roadmap;
  }
  Corridor(const Corridor &) = delete;
  Corridor &operator=(const Corridor &) = delete;
};

/* The visits that the planner finds: "0@0-1 1@2" is a robot that waits for a second and arrives
 * at the next vertex at 2. The status when it fails. */
static std::string plan(const std::vector<Vertex> &starts, const std::vector<Vertex> &goals) {
  Host host;
  const Corridor corridor;
  const Question question(corridor.environment, FLEETYARD_MOTION_STOP_GO, starts, goals);
  const Given given("attempts", 4);
  Prioritized planner(given.options);
  std::ostringstream text;
  try {
    planner.plan(fleetyard::Instance(&question.raw), host.budget, host.sink);
  } catch (const fleetyard::Failure &failure) {
    text << static_cast<int>(failure.status());
  }
  for (const auto &visits : host.visits) {
    text << (text.tellp() > 0 ? "," : "");
    for (const Visit &visit : visits) {
      text << (text.tellp() > 0 ? " " : "") << visit.vertex << "@" << visit.arrival_s;
      if (visit.departure_s > visit.arrival_s)
        text << "-" << visit.departure_s;
    }
  }
  return text.str();
}

int main() {
  /* A shortest path. */
  CHECK(plan({0}, {4}) == "0@0 1@1 2@2 4@3");
  /* One follows the other when the edge is free. */
  CHECK(plan({1, 0}, {3, 2}) == "1@0 2@1 3@2, 0@0-1 1@2 2@3");
  /* One waits in the bay until the other has passed. */
  CHECK(plan({0, 2}, {3, 0}) == "0@0 1@1 2@2 3@3, 2@0 4@1-3 2@4 1@5 0@6");
  /* There is no plan. */
  CHECK(plan({0, 1}, {1, 0}) == std::to_string(FLEETYARD_STATUS_GAVE_UP));
  std::cout << "passed\n";
}
