/* Follows the planner's failed paths for as long as nobody collides, and then waits.
 *
 * So the fleet goes on a little, and the next call of the planner is another question. Put
 * your own algorithm into `recover`.
 */

#include "fleetyard.hpp"

#include <algorithm>
#include <optional>
#include <vector>

namespace {

using fleetyard::Cell;

/* Keeps what is free of collisions at the beginning of the failed paths. */
class SafePrefix : public fleetyard::FailPolicy {
public:
  static constexpr auto id = "example-plugin";
  static constexpr auto version = "0.1.0";
  static constexpr auto description =
      "Keeps what is free of collisions at the beginning of the failed paths.";
  /* What the host may ask of the policy; docs/conformance.md lists all there is. */
  static constexpr auto capabilities = fleetyard::capability::grid |
                                       fleetyard::capability::pebble |
                                       fleetyard::capability::move_mask |
                                       fleetyard::capability::deterministic;
  /* What `--option NAME=VALUE` may say. The host checks it before the policy starts. */
  static constexpr auto options_schema = R"({
    "type": "object",
    "additionalProperties": false,
    "properties": {
      "steps": {
        "type": "integer",
        "minimum": 0,
        "default": 10,
        "description": "Most steps to take."
      }
    }
  })";

  explicit SafePrefix(const fleetyard::Options &options) : steps_(options.integer("steps")) {}

  void recover(const fleetyard::Instance &instance,
               const std::optional<fleetyard::PlanView> &failed, const fleetyard::Budget &,
               const fleetyard::Sink &sink) override {
    const fleetyard::Grid grid = instance.grid();
    std::vector<Cell> now(instance.starts().begin(), instance.starts().end());
    std::vector<std::vector<Cell>> paths;
    for (const Cell start : now)
      paths.push_back({start});
    /* The planner may have left nothing. */
    for (std::int64_t time = 1; failed && time <= steps_; time++) {
      std::vector<Cell> after = now;
      for (std::size_t agent = 0; agent < after.size(); agent++) {
        const fleetyard::Span<Cell> path = failed->path(agent);
        if (!path.empty())
          after[agent] = path[std::min(static_cast<std::size_t>(time), path.size() - 1)];
      }
      if (sink.cancelled() || !is_safe(grid, now, after))
        break;
      for (std::size_t agent = 0; agent < after.size(); agent++)
        paths[agent].push_back(after[agent]);
      now = after;
    }
    sink.submit_plan(paths);
  }

private:
  /* Whether all agents can go from their cells to these in one step. */
  static bool is_safe(const fleetyard::Grid &grid, const std::vector<Cell> &now,
                      const std::vector<Cell> &after) {
    for (std::size_t a = 0; a < now.size(); a++) {
      if (!grid.is_step(now[a], after[a]))
        return false;
      for (std::size_t b = 0; b < a; b++)
        if (after[a] == after[b] || (after[a] == now[b] && after[b] == now[a]))
          return false;
    }
    return true;
  }

  std::int64_t steps_;
};

} // namespace

FLEETYARD_PLUGINS(SafePrefix);
