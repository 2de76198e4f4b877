/* Prioritized planning: agents plan one after the other, each round those before it.
 *
 * After Erdmann and Lozano-Perez, "On Multiple Moving Objects" (Algorithmica 1987). It is
 * simple, and neither complete nor optimal. Put your own algorithm into `plan`.
 */

#include "fleetyard.hpp"

#include <algorithm>
#include <map>
#include <numeric>
#include <optional>
#include <set>
#include <string>
#include <vector>

namespace {

using fleetyard::Cell;

/* Where an agent is at time 0, 1, 2, ... After its last cell it stays there. */
using Path = std::vector<Cell>;

/* Who is where at a time, by cell. */
std::map<Cell, std::size_t> positions(const std::vector<Path> &paths, std::size_t time) {
  std::map<Cell, std::size_t> found;
  for (std::size_t who = 0; who < paths.size(); who++)
    found[paths[who][std::min(time, paths[who].size() - 1)]] = who;
  return found;
}

/* Prioritized planning, in another order when an agent finds no path. */
class Prioritized : public fleetyard::Planner {
public:
  static constexpr auto id = "example-plugin";
  static constexpr auto version = "0.1.0";
  static constexpr auto description =
      "Prioritized planning, in another order when an agent finds no path.";
  /* What the host may ask of the planner; docs/conformance.md lists all there is. */
  static constexpr auto capabilities = fleetyard::capability::grid |
                                       fleetyard::capability::pebble |
                                       fleetyard::capability::move_mask |
                                       fleetyard::capability::deterministic;
  /* What `--option NAME=VALUE` may say. The host checks it before the planner starts. */
  static constexpr auto options_schema = R"({
    "type": "object",
    "additionalProperties": false,
    "properties": {
      "attempts": {
        "type": "integer",
        "minimum": 1,
        "default": 100,
        "description": "Most orders of the agents to try."
      }
    }
  })";

  explicit Prioritized(const fleetyard::Options &options)
      : attempts_(options.integer("attempts")) {}

  void plan(const fleetyard::Instance &instance, const fleetyard::Budget &,
            const fleetyard::Sink &sink) override {
    const auto starts = instance.starts();
    if (std::set<Cell>(starts.begin(), starts.end()).size() < instance.agents())
      throw fleetyard::Failure(fleetyard::Status::invalid_input, "two agents start in one cell");
    std::vector<std::size_t> order(instance.agents());
    std::iota(order.begin(), order.end(), 0);
    for (std::int64_t attempt = 0; attempt < attempts_; attempt++) {
      std::vector<Path> paths; // in that order
      while (paths.size() < order.size()) {
        const auto path = find_path(instance, order[paths.size()], paths, sink);
        if (!path)
          break;
        paths.push_back(*path);
      }
      if (paths.size() == order.size()) {
        std::vector<Path> of_agent(paths.size());
        for (std::size_t i = 0; i < order.size(); i++)
          of_agent[order[i]] = paths[i];
        sink.submit_plan(of_agent);
        return;
      }
      const auto failed = order.begin() + static_cast<std::ptrdiff_t>(paths.size());
      if (failed == order.begin())
        throw fleetyard::Failure(fleetyard::Status::infeasible,
                                 "no path leads agent " + std::to_string(*failed) +
                                     " to its goal");
      /* Who found no path goes first, and who went first goes last. */
      std::rotate(failed, failed + 1, order.end());
      std::swap(order.front(), order.back());
    }
    throw fleetyard::Failure(fleetyard::Status::gave_up, "no order of the agents worked");
  }

private:
  /* The cells of a shortest path that meets none of the others, if there is one. */
  static std::optional<Path> find_path(const fleetyard::Instance &instance, std::size_t agent,
                                       const std::vector<Path> &others,
                                       const fleetyard::Sink &sink) {
    const fleetyard::Grid grid = instance.grid();
    const Cell start = instance.starts()[agent], goal = instance.goal(agent);
    /* steps[t] has every cell where the agent can be at time t, and where it was before. */
    std::vector<std::map<Cell, Cell>> steps{{{start, start}}};
    for (;;) {
      const std::size_t time = steps.size();
      /* At the goal it stays: nobody may come by later. */
      const bool comes_by = std::any_of(others.begin(), others.end(), [&](const Path &path) {
        const auto from = path.begin() + static_cast<std::ptrdiff_t>(std::min(time, path.size()));
        return std::find(from, path.end(), goal) != path.end();
      });
      if (steps.back().count(goal) && !comes_by)
        break;
      sink.check(); // ends the call when its time is up
      const auto before = positions(others, time - 1), now = positions(others, time);
      std::map<Cell, Cell> reached;
      const auto reach = [&](Cell from, Cell to) {
        const auto there = before.find(to), here = now.find(from);
        const bool swap =
            there != before.end() && here != now.end() && there->second == here->second;
        if (!now.count(to) && !swap)
          reached.emplace(to, from);
      };
      for (const auto &[cell, from] : steps.back()) {
        for (const Cell near : grid.neighbours(cell))
          reach(cell, near);
        reach(cell, cell);
      }
      /* Once the others stand still, what is not reached now never will be. */
      const bool still = std::all_of(others.begin(), others.end(),
                                     [&](const Path &path) { return path.size() < time; });
      if (reached.empty() || (still && reached.size() == steps.back().size()))
        return std::nullopt;
      steps.push_back(reached);
    }
    Path path{goal};
    for (std::size_t time = steps.size() - 1; time > 0; time--)
      path.push_back(steps[time].at(path.back()));
    std::reverse(path.begin(), path.end());
    return path;
  }

  std::int64_t attempts_;
};

} // namespace

FLEETYARD_PLUGINS(Prioritized);
