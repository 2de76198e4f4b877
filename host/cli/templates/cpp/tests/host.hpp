/* Stands for the host in tests: a sink that keeps the last answer, and maps. */

#include "fleetyard.hpp"

#include <cstdlib>
#include <iostream>
#include <string>
#include <vector>

/* Ends the test when a condition does not hold. */
#define CHECK(condition)                                                        \
  do {                                                                          \
    if (!(condition)) {                                                         \
      std::cerr << __FILE__ << ":" << __LINE__ << ": " << #condition << "\n";   \
      std::exit(1);                                                             \
    }                                                                           \
  } while (0)

/* Lists of cells: the paths of a plan, or the goals of an instance. */
using Lists = std::vector<std::vector<fleetyard::Cell>>;

struct Host {
  Lists answer;

  void keep(std::uint32_t agents, const std::uint64_t *offsets, const fleetyard::Cell *cells) {
    answer.clear();
    for (std::uint32_t agent = 0; agent < agents; agent++)
      answer.emplace_back(cells + offsets[agent], cells + offsets[agent + 1]);
  }

  FleetyardSink raw{
      sizeof(FleetyardSink),
      0,
      this,
      [](void *host, const FleetyardPlan *plan) -> std::int32_t {
        static_cast<Host *>(host)->keep(plan->agents, plan->offsets, plan->cells);
        return FLEETYARD_OK;
      },
      [](void *host, const FleetyardInstance *next) -> std::int32_t {
        static_cast<Host *>(host)->keep(next->agents, next->goal_offsets, next->goals);
        return FLEETYARD_OK;
      },
      [](void *, FleetyardStr, double) {},
      [](void *, std::int32_t, FleetyardStr) {},
      [](void *, std::uint64_t, std::uint64_t) {},
      [](void *) -> std::int32_t { return 0; },
      [](void *, FleetyardStr) {},
  };
  fleetyard::Sink sink{&raw};

  FleetyardBudget limits{sizeof(FleetyardBudget), 1, UINT64_MAX, UINT64_MAX, 0, 0, 1};
  fleetyard::Budget budget{&limits};
};

/* A map of rows, `.` where a robot may stand. */
struct Map {
  Map(std::uint32_t rows, const std::string &letters) : terrain(letters.begin(), letters.end()) {
    for (const char letter : letters)
      passable.push_back(letter == '.');
    const auto cols = static_cast<std::uint32_t>(letters.size()) / rows;
    grid = {sizeof grid, rows, cols, 4, 1.0, 1.0, passable.data(), terrain.data()};
    environment = {sizeof environment, FLEETYARD_REPRESENTATION_GRID, {}, &grid};
  }

  std::vector<std::uint8_t> passable, terrain;
  FleetyardGrid grid{};
  FleetyardEnvironment environment{};
};

/* An instance on a map, with one goal per agent. */
struct Question {
  Question(const Map &map, std::vector<fleetyard::Cell> from, std::vector<fleetyard::Cell> to)
      : starts(std::move(from)), goals(std::move(to)) {
    for (std::size_t agent = 0; agent <= starts.size(); agent++)
      offsets.push_back(agent);
    raw.struct_size = sizeof raw;
    raw.agents = static_cast<std::uint32_t>(starts.size());
    raw.environment = &map.environment;
    raw.starts = starts.data();
    raw.goal_offsets = offsets.data();
    raw.goals = goals.data();
  }

  std::vector<fleetyard::Cell> starts, goals;
  std::vector<std::uint64_t> offsets;
  FleetyardInstance raw{};
};
