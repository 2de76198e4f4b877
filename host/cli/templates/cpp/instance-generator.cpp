/* Gives each open task to the nearest agent that has nothing to do; the rest wait.
 *
 * Tasks are given away in the order in which they came. Put your own rule into `generate`.
 */

#include "fleetyard.hpp"

#include <algorithm>
#include <set>
#include <vector>

namespace {

using fleetyard::Cell;

/* Gives each open task to the nearest agent that has nothing to do. */
class NearestIdle : public fleetyard::InstanceGenerator {
public:
  static constexpr auto id = "example-plugin";
  static constexpr auto version = "0.1.0";
  static constexpr auto description =
      "Gives each open task to the nearest agent that has nothing to do.";
  /* What the host may ask of the generator; docs/conformance.md lists all there is. */
  static constexpr auto capabilities = fleetyard::capability::grid |
                                       fleetyard::capability::pebble |
                                       fleetyard::capability::move_mask |
                                       fleetyard::capability::deterministic;
  /* What `--option NAME=VALUE` may say. The host checks it before the generator starts. */
  static constexpr auto options_schema = R"({
    "type": "object",
    "additionalProperties": false,
    "properties": {
      "most_tasks": {
        "type": "integer",
        "minimum": 1,
        "default": 1000,
        "description": "Most tasks to give away in one call."
      }
    }
  })";

  explicit NearestIdle(const fleetyard::Options &options)
      : most_tasks_(options.integer("most_tasks")) {}

  void generate(const fleetyard::FleetState &state, const fleetyard::Budget &,
                const fleetyard::Sink &sink) override {
    const fleetyard::Grid grid = state.grid();
    const fleetyard::Span<Cell> starts = state.next().starts();
    fleetyard::Request request(state); // with the goals that agents have already
    std::set<Cell> ends;               // two agents cannot end in the same cell
    for (const auto &goals : request.goals)
      if (!goals.empty())
        ends.insert(goals.back());
    for (std::uint32_t i = 0; i < state.tasks() && i < most_tasks_; i++) {
      sink.check(); // ends the call when its time is up
      const fleetyard::Span<Cell> visits = state.task(i).places;
      if (visits.empty() || ends.count(visits.back()) || !is_possible(grid, visits))
        continue;
      const auto distance = grid.distances(visits.front());
      const auto is_nearer = [&](std::size_t a, std::size_t b) {
        return distance[starts[a]] < distance[starts[b]];
      };
      std::vector<std::size_t> able; // agents that could do it
      for (std::size_t agent = 0; agent < state.agents(); agent++)
        if (request.goals[agent].empty() && distance[starts[agent]] != fleetyard::unreachable)
          able.push_back(agent);
      if (able.empty())
        continue;
      request.assign(state.task(i), *std::min_element(able.begin(), able.end(), is_nearer));
      ends.insert(visits.back());
    }
    for (std::size_t agent = 0; agent < state.agents(); agent++)
      if (request.goals[agent].empty()) {
        request.goals[agent].push_back(place_to_wait(grid, starts[agent], ends));
        ends.insert(request.goals[agent].back());
      }
    sink.submit_request(request);
  }

private:
  /* Whether a way leads from each place of a task to the next. */
  static bool is_possible(const fleetyard::Grid &grid, fleetyard::Span<Cell> visits) {
    for (std::size_t at = 1; at < visits.size(); at++)
      if (grid.distances(visits[at])[visits[at - 1]] == fleetyard::unreachable)
        return false;
    return true;
  }

  /* The nearest cell where nobody ends: most often where the agent is. */
  static Cell place_to_wait(const fleetyard::Grid &grid, Cell from, const std::set<Cell> &ends) {
    if (!ends.count(from))
      return from;
    const auto distance = grid.reach(from);
    std::vector<Cell> free;
    for (Cell cell = 0; cell < distance.size(); cell++)
      if (distance[cell] != fleetyard::unreachable && !ends.count(cell))
        free.push_back(cell);
    if (free.empty())
      throw fleetyard::Failure(fleetyard::Status::gave_up,
                               "no cell is left for an agent to wait in");
    return *std::min_element(free.begin(), free.end(),
                             [&](Cell a, Cell b) { return distance[a] < distance[b]; });
  }

  std::int64_t most_tasks_;
};

} // namespace

FLEETYARD_PLUGINS(NearestIdle);
