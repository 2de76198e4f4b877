/* A fail policy: everybody follows the path that the failed planner left, step by step,
 * and waits whenever the next cell is not to be had.
 *
 * Nobody collides, because a step is taken only into a cell that is free by then, by one
 * agent, and never through one another. Where paths close a circle of agents that wait for
 * each other head on, they stand until the planner is called again.
 */

#include "fleetyard.hpp"

namespace {

using fleetyard::Cell;
namespace capability = fleetyard::capability;

constexpr std::uint32_t nobody = 0xFFFFFFFF;

class Follow : public fleetyard::FailPolicy {
public:
  static constexpr auto id = "follow";
  static constexpr auto name = "Follow and wait (C++ example)";
  static constexpr auto version = "0.1.0";
  static constexpr auto license = "MIT OR Apache-2.0";
  static constexpr auto description =
      "Follows the paths of the failed plan and waits where they collide.";
  static constexpr auto capabilities = capability::grid | capability::move_mask |
                                       capability::pebble | capability::idle |
                                       capability::windowed | capability::duplicate_goals |
                                       capability::deterministic;

  void recover(const fleetyard::Instance &instance,
               const std::optional<fleetyard::PlanView> &failed, const fleetyard::Budget &,
               const fleetyard::Sink &sink) override {
    const fleetyard::Grid grid = instance.grid();
    const std::size_t agents = instance.agents();
    std::vector<std::vector<Cell>> paths(agents);
    std::vector<std::size_t> done(agents); // how far along its failed path each agent is
    // Per cell: who stands there, and who goes there next.
    std::vector<std::uint32_t> stands(grid.size(), nobody), goes(grid.size(), nobody);
    for (std::uint32_t agent = 0; agent < agents; agent++) {
      const Cell start = instance.starts()[agent];
      if (!grid.is_free(start) || std::exchange(stands[start], agent) != nobody)
        throw fleetyard::Failure(fleetyard::Status::invalid_input,
                                 "agent " + std::to_string(agent) +
                                     " starts on an obstacle or another agent");
      paths[agent].push_back(start);
    }

    const auto wish = [&](std::uint32_t agent) { // its cell if there is nowhere to go
      const Cell here = paths[agent].back();
      const fleetyard::Span<Cell> path =
          failed ? failed->path(agent) : fleetyard::Span<Cell>();
      if (done[agent] + 1 >= path.size() || path[done[agent]] != here)
        return here;
      const Cell next = path[done[agent] + 1];
      return grid.is_step(here, next) ? next : here;
    };
    const auto waits_in_path = [&](std::uint32_t agent) {
      return failed && done[agent] + 1 < failed->path(agent).size() &&
             failed->path(agent)[done[agent] + 1] == paths[agent].back();
    };

    std::vector<Cell> next(agents);
    std::vector<std::uint32_t> stopped;
    const auto stop = [&](std::uint32_t agent) {
      // Whoever wanted its cell waits too, and so on.
      for (stopped.push_back(agent); !stopped.empty();) {
        const std::uint32_t waiting = stopped.back();
        const Cell here = paths[waiting].back();
        stopped.pop_back();
        if (next[waiting] != here && goes[next[waiting]] == waiting)
          goes[next[waiting]] = nobody;
        next[waiting] = here;
        const std::uint32_t behind = std::exchange(goes[here], waiting);
        if (behind != nobody && behind != waiting)
          stopped.push_back(behind);
      }
    };
    // What has been done so far is a plan at any time: when time is up, it is the answer.
    for (bool moved = true; moved && !sink.cancelled();) {
      moved = false;
      std::fill(goes.begin(), goes.end(), nobody);
      for (std::uint32_t agent = 0; agent < agents; agent++) {
        next[agent] = paths[agent].back();
        const Cell to = wish(agent);
        const std::uint32_t other = stands[to];
        const bool swap = other < agent && next[other] == paths[agent].back() && other != agent;
        if (to != next[agent] && goes[to] == nobody && !swap) {
          next[agent] = to;
          goes[to] = agent;
        }
      }
      for (std::uint32_t agent = 0; agent < agents; agent++)
        if (next[agent] == paths[agent].back())
          stop(agent);
      for (std::uint32_t agent = 0; agent < agents; agent++) {
        const Cell here = paths[agent].back();
        if (next[agent] != here || waits_in_path(agent)) {
          done[agent]++;
          moved = true;
        }
        if (stands[here] == agent)
          stands[here] = nobody;
        paths[agent].push_back(next[agent]);
        stands[next[agent]] = agent;
      }
    }
    sink.submit_plan(paths);
  }
};

} // namespace

FLEETYARD_PLUGINS(Follow);
