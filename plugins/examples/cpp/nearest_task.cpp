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
  static constexpr auto capabilities = capability::grid | capability::move_mask |
                                       capability::eight_connected | capability::pebble | capability::rotation |
                                       capability::windowed | capability::duplicate_goals |
                                       capability::deterministic;

  void generate(const fleetyard::FleetState &state, const fleetyard::Budget &,
                const fleetyard::Sink &sink) override {
    const fleetyard::Grid grid = state.grid();
    const fleetyard::Instance &next = state.next();
    std::vector<fleetyard::Task> tasks;
    for (std::uint32_t each = 0; each < state.tasks(); each++)
      if (is_possible(grid, state.task(each).places))
        tasks.push_back(state.task(each));

    fleetyard::Request request(state);
    for (std::size_t agent = 0; agent < state.agents(); agent++) {
      std::vector<Cell> &goals = request.goals[agent];
      std::uint64_t steps = 0; // from where the agent is to its last goal so far
      Cell end = next.starts()[agent];
      const auto go = [&](fleetyard::Span<Cell> places) {
        for (const Cell place : places) {
          if (next.window_steps() > 0)
            steps += grid.distances(place)[end];
          end = place;
        }
      };
      go(goals);
      while (!tasks.empty() && (goals.empty() || steps < next.window_steps())) {
        sink.check();
        const std::vector<std::uint32_t> distance = grid.reach(end);
        const auto nearest = std::min_element(
            tasks.begin(), tasks.end(), [&](const fleetyard::Task &a, const fleetyard::Task &b) {
              return distance[a.places.front()] < distance[b.places.front()];
            });
        if (distance[nearest->places.front()] == fleetyard::unreachable)
          break;
        request.assign(*nearest, agent);
        go(nearest->places);
        tasks.erase(nearest);
      }
      if (goals.empty())
        goals.push_back(end);
    }
    sink.submit_request(request);
  }

private:
  /* True if a way leads from each place of a task to the next. */
  static bool is_possible(const fleetyard::Grid &grid, fleetyard::Span<Cell> places) {
    for (std::size_t at = 1; at < places.size(); at++)
      if (grid.distances(places[at])[places[at - 1]] == fleetyard::unreachable)
        return false;
    return !places.empty();
  }
};

} // namespace

FLEETYARD_PLUGINS(NearestTask);
