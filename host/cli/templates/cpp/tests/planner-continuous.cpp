/* The planner without a host: `make check`. */

#include "../example_plugin.cpp"
#include "host.hpp"

using Paths = std::vector<std::vector<Knot>>;

/* The paths of two discs in a room of four by four metres, with a wall in the middle that is
 * `wall_m` long; none when there is no plan. */
static Paths plan(double wall_m, const std::vector<double> &starts,
                  const std::vector<double> &goals) {
  const std::vector<double> x{1.9, 2.1, 2.1, 1.9}, y{0, 0, wall_m, wall_m};
  const std::vector<std::uint64_t> corner_offsets{0, 4}, offsets{0, 2, 4};
  FleetyardWorkspace workspace{};
  workspace.struct_size = sizeof workspace;
  workspace.obstacles = 1;
  workspace.max_x_m = workspace.max_y_m = 4;
  workspace.corner_offsets = corner_offsets.data();
  workspace.x_m = x.data();
  workspace.y_m = y.data();
  FleetyardEnvironment environment{};
  environment.struct_size = sizeof environment;
  environment.representation = FLEETYARD_REPRESENTATION_CONTINUOUS;
  environment.view = &workspace;
  const FleetyardFootprint disc{sizeof disc, 0, 0.25, nullptr, nullptr};
  FleetyardRobot robot{};
  robot.struct_size = sizeof robot;
  robot.footprint = &disc;
  const FleetyardRobot *const robots[] = {&robot};
  Question question(environment, FLEETYARD_MOTION_DYNAMICS, {0, 0}, {0, 0});
  question.raw.starts = question.raw.goals = nullptr;
  question.raw.robots = robots;
  question.raw.robot_count = 1;
  question.raw.start_state_offsets = question.raw.goal_state_offsets = offsets.data();
  question.raw.start_states = starts.data();
  question.raw.goal_states = goals.data();
  Host host;
  const Given given("speed_m_per_s", 0.5);
  InTurn planner(given.options);
  try {
    planner.plan(fleetyard::Instance(&question.raw), host.budget, host.sink);
  } catch (const fleetyard::Failure &failure) {
    CHECK(failure.status() == fleetyard::Status::gave_up);
  }
  return host.knots;
}

static bool is_at(const Knot &knot, double time_s, double x_m, double y_m) {
  return std::abs(knot.time_s - time_s) < 1e-9 &&
         distance({knot.x_m, knot.y_m}, {x_m, y_m}) < 1e-9 && std::isnan(knot.heading_rad);
}

int main() {
  /* Straight, and who is in the way of another one goes first. */
  const Paths straight = plan(0.5, {1, 2, 3, 2}, {3, 2, 3, 3});
  CHECK(straight.size() == 2 && straight[0].size() == 3 && straight[1].size() == 2);
  CHECK(is_at(straight[1][1], 2, 3, 3) && is_at(straight[0][1], 2, 1, 2));
  CHECK(is_at(straight[0][2], 6, 3, 2));
  /* Round the end of the wall, which is longer. */
  const Paths round = plan(2, {1, 1, 1, 3.5}, {3, 1, 1, 3.5});
  CHECK(round.size() == 2 && round[0].size() > 3 && round[0].back().time_s > 5);
  CHECK(is_at(round[0].back(), round[0].back().time_s, 3, 1));
  CHECK(std::all_of(round[0].begin() + 1, round[0].end() - 1,
                    [](const Knot &knot) { return knot.y_m > 2; }));
  /* There is no way: the gap is too narrow, or they stand in each other's goals. */
  CHECK(plan(3.6, {1, 1, 1, 3}, {3, 1, 1, 3}).empty());
  CHECK(plan(0.5, {1, 2, 3, 2}, {3, 2, 1, 2}).empty());
  std::cout << "passed\n";
}
