/* An instance generator: whoever has nothing to do gets the nearest task.
 *
 * Agents choose in the order of their numbers, by the length of the way. Where the host
 * plans in windows, an agent gets more tasks until they last for the window. Who is left
 * without a task stays where it is.
 */

#include "fleetyard.hpp"

namespace {

using fleetyard::Cell;
namespace capability = fleetyard::capability;

class NearestTask : public fleetyard::InstanceGenerator {
public:
  static constexpr auto id = "nearest-task";
  static constexpr auto name = "Nearest task (C++ example)";
  static constexpr auto version = "0.1.0";
  static constexpr auto license = "MIT OR Apache-2.0";
  static constexpr auto description =
      "Gives every idle agent the task whose first cell is nearest, and more for a window.";
  static constexpr auto capabilities = capability::grid | capability::eight_connected |
                                       capability::pebble | capability::rotation |
                                       capability::windowed | capability::duplicate_goals |
                                       capability::deterministic;

  void generate(const fleetyard::FleetState &state, const fleetyard::Budget &,
                const fleetyard::Sink &sink) override {
    const fleetyard::Grid grid = state.grid();
    std::vector<fleetyard::Task> tasks;
    for (std::uint32_t each = 0; each < state.tasks(); each++)
      if (!state.task(each).cells.empty())
        tasks.push_back(state.task(each));

    fleetyard::NextInstance next(state);
    for (std::size_t agent = 0; agent < next.starts.size(); agent++) {
      std::vector<Cell> &goals = next.goals[agent];
      std::uint64_t steps = 0; // from where the agent is to its last goal so far
      Cell end = next.starts[agent];
      const auto go = [&](Cell goal) {
        steps += grid.distances(goal)[end];
        end = goal;
      };
      if (state.window_steps() > 0)
        for (const Cell goal : goals)
          go(goal);
      while (!tasks.empty() && (goals.empty() || steps < state.window_steps())) {
        sink.check();
        const std::vector<std::uint32_t> distance = grid.distances(end);
        const auto reachable = [&](Cell cell) { return distance[cell] != fleetyard::unreachable; };
        auto best = tasks.end();
        for (auto task = tasks.begin(); task != tasks.end(); ++task)
          if (std::all_of(task->cells.begin(), task->cells.end(), reachable) &&
              (best == tasks.end() ||
               distance[task->cells.front()] < distance[best->cells.front()]))
            best = task;
        if (best == tasks.end())
          break;
        for (const Cell cell : best->cells) {
          goals.push_back(cell);
          if (state.window_steps() > 0)
            go(cell);
        }
        next.assignments.push_back({static_cast<std::uint32_t>(agent), best->id});
        tasks.erase(best);
      }
      if (goals.empty())
        goals.push_back(next.starts[agent]);
    }
    sink.submit_instance(next);
  }
};

} // namespace

FLEETYARD_PLUGINS(NearestTask);
