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

/* Lists of cells: the paths of a plan, or the goals of a request. */
using Lists = std::vector<std::vector<fleetyard::Place>>;

struct Host {
  Lists answer;
  std::vector<std::vector<fleetyard::Visit>> visits; /* of a plan on a roadmap */
  std::vector<std::vector<fleetyard::Knot>> knots;   /* of one in the plane */

  void keep(const FleetyardPlan &plan) {
    const fleetyard::PlanView view(&plan);
    answer.clear(), visits.clear(), knots.clear();
    for (std::size_t agent = 0; agent < view.agents(); agent++) {
      if (view.form() == fleetyard::Form::cells) {
        answer.emplace_back(view.path(agent).begin(), view.path(agent).end());
        continue;
      }
      visits.emplace_back(), knots.emplace_back();
      for (std::size_t at = 0; at < view.length(agent); at++)
        if (view.form() == fleetyard::Form::visits)
          visits.back().push_back(view.visit(agent, at));
        else
          knots.back().push_back(view.knot(agent, at));
    }
  }

  void keep(const FleetyardRequest &request) {
    answer.clear();
    for (std::uint32_t agent = 0; agent < request.agents; agent++)
      answer.emplace_back(request.goals + request.goal_offsets[agent],
                          request.goals + request.goal_offsets[agent + 1]);
  }

  FleetyardSink raw{
      sizeof(FleetyardSink),
      0,
      this,
      [](void *host, const FleetyardPlan *plan) -> std::int32_t {
        static_cast<Host *>(host)->keep(*plan);
        return FLEETYARD_OK;
      },
      [](void *host, const FleetyardRequest *request) -> std::int32_t {
        static_cast<Host *>(host)->keep(*request);
        return FLEETYARD_OK;
      },
      [](void *) -> std::int32_t { return 0; },
      [](void *) -> std::uint64_t { return 0; },
      [](void *, FleetyardStr) {},
      [](void *, std::int32_t, FleetyardStr) {},
      [](void *, FleetyardStr, double) {},
      [](void *, FleetyardStr, FleetyardStr) {},
      [](void *, std::uint64_t, std::uint64_t) {},
      [](void *, FleetyardStr) -> const void * { return nullptr; },
  };
  fleetyard::Sink sink{&raw};

  FleetyardBudget limits{sizeof(FleetyardBudget), 1, UINT64_MAX, UINT64_MAX, UINT64_MAX, 0, 0, 1, {}};
  fleetyard::Budget budget{&limits};
};

/* A table of one option, as the host hands it over. */
struct Given {
  Given(std::string_view name, double number)
      : option{fleetyard::detail::str(name), {}, number, FLEETYARD_OPTION_NUMBER, 0},
        raw{sizeof raw, 1, &option, {}}, options(&raw) {}
  Given(const Given &) = delete;
  Given &operator=(const Given &) = delete;

  FleetyardPluginOption option;
  FleetyardOptions raw;
  fleetyard::Options options;
};

/* A map of rows, `.` where a robot may stand. */
struct Map {
  Map(std::uint32_t rows, const std::string &letters)
      : terrain(letters.begin(), letters.end()), moves(letters.size()) {
    const auto cols = static_cast<std::uint32_t>(letters.size()) / rows;
    const auto is_free = [&](std::size_t cell) { return letters[cell] == '.'; };
    for (std::size_t cell = 0; cell < letters.size(); cell++) {
      passable.push_back(is_free(cell));
      const auto allow = [&](bool on_map, std::size_t to, int move) {
        if (on_map && is_free(cell) && is_free(to))
          moves[cell] = static_cast<std::uint8_t>(moves[cell] | move);
      };
      allow(cell >= cols, cell - cols, FLEETYARD_MOVE_NORTH);
      allow(cell % cols + 1 < cols, cell + 1, FLEETYARD_MOVE_EAST);
      allow(cell + cols < letters.size(), cell + cols, FLEETYARD_MOVE_SOUTH);
      allow(cell % cols > 0, cell - 1, FLEETYARD_MOVE_WEST);
    }
    grid.struct_size = sizeof grid;
    grid.rows = rows;
    grid.cols = cols;
    grid.connectivity = 4;
    grid.cell_size_m = grid.step_s = 1.0;
    grid.passable = passable.data();
    grid.terrain = terrain.data();
    grid.moves = moves.data();
    environment.struct_size = sizeof environment;
    environment.representation = FLEETYARD_REPRESENTATION_GRID;
    environment.view = &grid;
  }
  Map(const Map &) = delete;
  Map &operator=(const Map &) = delete;

  std::vector<std::uint8_t> passable, terrain, moves;
  FleetyardGrid grid{};
  FleetyardEnvironment environment{};
};

/* An instance on a grid or a roadmap, with one goal per agent. */
struct Question {
  Question(const FleetyardEnvironment &environment, std::int32_t motion,
           std::vector<fleetyard::Place> from, std::vector<fleetyard::Place> to)
      : starts(std::move(from)), goals(std::move(to)) {
    for (std::size_t agent = 0; agent <= starts.size(); agent++)
      offsets.push_back(agent);
    raw.struct_size = sizeof raw;
    raw.agents = static_cast<std::uint32_t>(starts.size());
    raw.environment = &environment;
    raw.motion = motion;
    raw.objective = FLEETYARD_OBJECTIVE_SUM_OF_COSTS;
    raw.starts = starts.data();
    raw.goal_offsets = offsets.data();
    raw.goals = goals.data();
  }
  Question(const Question &) = delete;
  Question &operator=(const Question &) = delete;

  std::vector<fleetyard::Place> starts, goals;
  std::vector<std::uint64_t> offsets;
  FleetyardInstance raw{};
};
