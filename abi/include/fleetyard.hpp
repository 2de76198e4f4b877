/* Plugins for Fleetyard in C++17: header only, over fleetyard.h. MIT OR Apache-2.0.
 *
 * A whole planner, which sends every agent along a shortest path and lets them collide:
 *
 *     #include "fleetyard.hpp"
 *
 *     struct Blind : fleetyard::Planner {
 *       static constexpr auto id = "blind";
 *       static constexpr auto capabilities =
 *           fleetyard::capability::grid | fleetyard::capability::pebble;
 *
 *       void plan(const fleetyard::Instance &instance, const fleetyard::Budget &,
 *                 const fleetyard::Sink &sink) override {
 *         const fleetyard::Grid grid = instance.grid();
 *         fleetyard::Plan plan;
 *         for (std::uint32_t agent = 0; agent < instance.agents(); agent++)
 *           plan.add(grid.path(instance.starts()[agent], grid.distances(instance.goal(agent))));
 *         sink.submit_plan(plan);
 *       }
 *     };
 *
 *     FLEETYARD_PLUGINS(Blind);
 *
 * It is built by
 *
 *     c++ -std=c++17 -O2 -fPIC -shared -fvisibility=hidden -I INCLUDE \
 *         -Wl,--version-script=INCLUDE/fleetyard.map -o blind.so blind.cpp
 *
 * where the last option keeps what the compiler makes of the standard library's templates
 * out of the list of exported symbols.
 *
 * The four kinds are Planner, FailPolicy, InstanceGenerator and InvocationPolicy. A
 * plugin derives from one of them, says who it is in static members (see Plugin), and
 * is named in FLEETYARD_PLUGINS, once per library and with as many plugins as one likes.
 *
 * A call that returns claims success; to end it otherwise, throw a Failure. Whatever is
 * thrown stays in the library: another exception becomes FLEETYARD_STATUS_INTERNAL_ERROR
 * with its message. (An exception that leaves a thread of the plugin's own ends the
 * process, as always in C++.)
 *
 * Instances, maps, states and budgets are views of the host's memory: they end with the
 * call that received them. Copy what is to stay. A Sink may be used from any thread until
 * the call returns.
 */

#ifndef FLEETYARD_HPP
#define FLEETYARD_HPP

#include "fleetyard.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <limits>
#include <locale>
#include <memory>
#include <new>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

namespace fleetyard {

/* ---- Names for the constants of the contract -------------------------------- */

/* A cell of a grid: row * cols + col, with row 0 at the top. */
using Cell = std::uint32_t;

/* The distance of a cell from which no path leads to the goal. */
inline constexpr std::uint32_t unreachable = std::numeric_limits<std::uint32_t>::max();

/* Capabilities that a plugin claims, joined by `|`. */
namespace capability {
inline constexpr std::uint64_t grid = FLEETYARD_CAPABILITY_GRID;
inline constexpr std::uint64_t roadmap = FLEETYARD_CAPABILITY_ROADMAP;
inline constexpr std::uint64_t continuous = FLEETYARD_CAPABILITY_CONTINUOUS;
inline constexpr std::uint64_t eight_connected = FLEETYARD_CAPABILITY_EIGHT_CONNECTED;
inline constexpr std::uint64_t pebble = FLEETYARD_CAPABILITY_PEBBLE;
inline constexpr std::uint64_t rotation = FLEETYARD_CAPABILITY_ROTATION;
inline constexpr std::uint64_t any_angle = FLEETYARD_CAPABILITY_ANY_ANGLE;
inline constexpr std::uint64_t anytime = FLEETYARD_CAPABILITY_ANYTIME;
inline constexpr std::uint64_t windowed = FLEETYARD_CAPABILITY_WINDOWED;
inline constexpr std::uint64_t duplicate_goals = FLEETYARD_CAPABILITY_DUPLICATE_GOALS;
inline constexpr std::uint64_t colliding_plans = FLEETYARD_CAPABILITY_COLLIDING_PLANS;
inline constexpr std::uint64_t k_robust = FLEETYARD_CAPABILITY_K_ROBUST;
inline constexpr std::uint64_t deterministic = FLEETYARD_CAPABILITY_DETERMINISTIC;
inline constexpr std::uint64_t threads = FLEETYARD_CAPABILITY_THREADS;
} // namespace capability

/* Status of a call that does not succeed. */
enum class Status : std::int32_t {
  infeasible = FLEETYARD_STATUS_INFEASIBLE,
  timed_out = FLEETYARD_STATUS_TIMED_OUT,
  gave_up = FLEETYARD_STATUS_GAVE_UP,
  cancelled = FLEETYARD_STATUS_CANCELLED,
  unsupported = FLEETYARD_STATUS_UNSUPPORTED,
  invalid_input = FLEETYARD_STATUS_INVALID_INPUT,
  internal_error = FLEETYARD_STATUS_INTERNAL_ERROR,
};

enum class Motion : std::int32_t {
  pebble = FLEETYARD_MOTION_PEBBLE,
  rotation = FLEETYARD_MOTION_ROTATION,
  any_angle = FLEETYARD_MOTION_ANY_ANGLE,
};

enum class Objective : std::int32_t {
  sum_of_costs = FLEETYARD_OBJECTIVE_SUM_OF_COSTS,
  makespan = FLEETYARD_OBJECTIVE_MAKESPAN,
};

enum class Heading : std::int32_t {
  east = FLEETYARD_HEADING_EAST,
  south = FLEETYARD_HEADING_SOUTH,
  west = FLEETYARD_HEADING_WEST,
  north = FLEETYARD_HEADING_NORTH,
};

enum class Level : std::int32_t {
  error = FLEETYARD_LOG_ERROR,
  warning = FLEETYARD_LOG_WARNING,
  info = FLEETYARD_LOG_INFO,
  debug = FLEETYARD_LOG_DEBUG,
};

/* Ends a call with a status, and says why. */
class Failure : public std::runtime_error {
public:
  Failure(Status status, const std::string &message)
      : std::runtime_error(message), status_(status) {}

  Status status() const noexcept { return status_; }

private:
  Status status_;
};

/* ---- Views of what the host tells ------------------------------------------- */

/* Elements that somebody else owns, in a row. */
template <class T> class Span {
public:
  using value_type = T;
  using const_iterator = const T *;
  using iterator = const_iterator;

  constexpr Span() noexcept = default;
  constexpr Span(const T *data, std::size_t size) noexcept : data_(data), size_(size) {}
  Span(const std::vector<T> &elements) noexcept : Span(elements.data(), elements.size()) {}

  constexpr const T *data() const noexcept { return data_; }
  constexpr std::size_t size() const noexcept { return size_; }
  constexpr bool empty() const noexcept { return size_ == 0; }
  constexpr const T *begin() const noexcept { return data_; }
  constexpr const T *end() const noexcept { return data_ + size_; }
  constexpr const T &operator[](std::size_t at) const noexcept { return data_[at]; }
  constexpr const T &front() const noexcept { return data_[0]; }
  constexpr const T &back() const noexcept { return data_[size_ - 1]; }

private:
  const T *data_ = nullptr;
  std::size_t size_ = 0;
};

namespace detail {

inline FleetyardStr str(std::string_view text) noexcept {
  return {reinterpret_cast<const std::uint8_t *>(text.data()), text.size()};
}

inline std::string_view view(FleetyardStr text) noexcept {
  return {reinterpret_cast<const char *>(text.ptr), text.ptr ? text.len : 0};
}

[[noreturn]] inline void invalid(const std::string &reason) {
  throw Failure(Status::invalid_input, reason);
}

/* A structure of the host, if it is the one of this header. */
template <class T> const T &checked(const T *pointer, const char *name) {
  if (!pointer)
    invalid(std::string(name) + " is null");
  if (pointer->struct_size != sizeof(T))
    invalid(std::string(name) + ".struct_size is " + std::to_string(pointer->struct_size) +
            ", but the structure has " + std::to_string(sizeof(T)) + " bytes");
  return *pointer;
}

template <class T> Span<T> checked(const T *pointer, std::size_t size, const char *name) {
  if (!pointer && size)
    invalid(std::string(name) + " is null");
  return {pointer, size};
}

/* Several lists of cells in one array, with their offsets. */
class Lists {
public:
  Lists(const std::uint64_t *offsets, const Cell *cells, std::size_t count, const char *name)
      : offsets_(checked(offsets, count + 1, name)), cells_(cells) {
    if (offsets_.front() != 0 || !std::is_sorted(offsets_.begin(), offsets_.end()))
      invalid(std::string("the offsets of ") + name + " are out of order");
    checked(cells, static_cast<std::size_t>(offsets_.back()), name);
  }

  Span<Cell> operator[](std::size_t at) const noexcept {
    const auto begin = static_cast<std::size_t>(offsets_[at]);
    const auto end = static_cast<std::size_t>(offsets_[at + 1]);
    return begin == end ? Span<Cell>() : Span<Cell>(cells_ + begin, end - begin);
  }

private:
  Span<std::uint64_t> offsets_;
  const Cell *cells_;
};

} // namespace detail

/* Limits of one call. The host enforces them. */
class Budget {
public:
  explicit Budget(const FleetyardBudget *raw) : raw_(detail::checked(raw, "budget")) {}

  /* When the call must have returned. */
  std::chrono::steady_clock::time_point deadline() const noexcept {
    return std::chrono::steady_clock::time_point(nanoseconds(raw_.deadline_monotonic_ns));
  }
  /* Time until the deadline; negative once it has passed. */
  std::chrono::nanoseconds remaining() const noexcept {
    return deadline() - std::chrono::steady_clock::now();
  }
  /* True once the deadline has passed. Sink::cancelled tells earlier, and hears the host. */
  bool expired() const noexcept { return remaining().count() <= 0; }
  /* Length of the budget when the call began. */
  std::chrono::nanoseconds wall() const noexcept { return nanoseconds(raw_.wall_ns); }
  /* Most threads to use at a time; at least 1. */
  std::uint32_t threads() const noexcept { return std::max(raw_.threads, std::uint32_t{1}); }
  /* Most search nodes to expand; 0 for no limit. */
  std::uint64_t nodes() const noexcept { return raw_.nodes; }
  /* Most memory to use in bytes; 0 for no limit. */
  std::uint64_t memory_bytes() const noexcept { return raw_.memory_bytes; }
  /* Seed of every random choice. */
  std::uint64_t seed() const noexcept { return raw_.seed; }

private:
  static std::chrono::nanoseconds nanoseconds(std::uint64_t count) noexcept {
    const auto most = static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max());
    return std::chrono::nanoseconds(static_cast<std::int64_t>(std::min(count, most)));
  }

  FleetyardBudget raw_;
};

/* Up to eight cells. */
class Neighbours {
public:
  const Cell *begin() const noexcept { return cells_.data(); }
  const Cell *end() const noexcept { return cells_.data() + size_; }
  std::size_t size() const noexcept { return size_; }
  bool empty() const noexcept { return size_ == 0; }
  Cell operator[](std::size_t at) const noexcept { return cells_[at]; }

private:
  friend class Grid;
  void add(Cell cell) noexcept { cells_[size_++] = cell; }

  std::array<Cell, 8> cells_{};
  std::size_t size_ = 0;
};

/* A grid: row 0 is the top, column 0 the left. */
class Grid {
public:
  explicit Grid(const FleetyardGrid *raw) : raw_(detail::checked(raw, "environment.view")) {
    detail::checked(raw_.passable, size(), "grid.passable");
    detail::checked(raw_.terrain, size(), "grid.terrain");
  }

  std::uint32_t rows() const noexcept { return raw_.rows; }
  std::uint32_t cols() const noexcept { return raw_.cols; }
  /* Number of cells. */
  std::size_t size() const noexcept { return std::size_t{raw_.rows} * raw_.cols; }
  /* 4 or 8 neighbours. */
  std::uint32_t connectivity() const noexcept { return raw_.connectivity; }
  double cell_size_m() const noexcept { return raw_.cell_size_m; }
  /* Duration of one move or wait. */
  double step_s() const noexcept { return raw_.step_s; }
  /* Per cell 1 where a robot may stand, else 0. */
  Span<std::uint8_t> passable() const noexcept { return {raw_.passable, size()}; }
  /* Per cell the letter of the map file. */
  Span<std::uint8_t> terrain() const noexcept { return {raw_.terrain, size()}; }

  Cell cell(std::uint32_t row, std::uint32_t col) const noexcept { return row * raw_.cols + col; }
  std::uint32_t row(Cell cell) const noexcept { return cell / raw_.cols; }
  std::uint32_t col(Cell cell) const noexcept { return cell % raw_.cols; }

  /* True if a robot may stand in a cell; false off the map. */
  bool is_free(Cell cell) const noexcept { return cell < size() && raw_.passable[cell] != 0; }

  /* The cells that one move reaches from a cell of the map: north, east, south, west and
   * then, with eight neighbours, the diagonals. Waiting is always possible too. */
  Neighbours neighbours(Cell cell) const noexcept {
    Neighbours found;
    const bool north = row(cell) > 0 && is_free(cell - raw_.cols);
    const bool east = col(cell) + 1 < raw_.cols && is_free(cell + 1);
    const bool south = row(cell) + 1 < raw_.rows && is_free(cell + raw_.cols);
    const bool west = col(cell) > 0 && is_free(cell - 1);
    const auto add = [&](bool reachable, Cell near) {
      if (reachable && is_free(near))
        found.add(near);
    };
    add(north, cell - raw_.cols);
    add(east, cell + 1);
    add(south, cell + raw_.cols);
    add(west, cell - 1);
    if (raw_.connectivity == 8) { // past no corner: both cells at the side are free
      add(north && east, cell - raw_.cols + 1);
      add(south && east, cell + raw_.cols + 1);
      add(south && west, cell + raw_.cols - 1);
      add(north && west, cell - raw_.cols - 1);
    }
    return found;
  }

  /* Steps from every cell to a goal when nobody is in the way, or `unreachable`. */
  std::vector<std::uint32_t> distances(Cell goal) const {
    std::vector<std::uint32_t> distance(size(), unreachable);
    std::vector<Cell> queue;
    if (is_free(goal)) {
      distance[goal] = 0;
      queue.push_back(goal);
    }
    for (std::size_t next = 0; next < queue.size(); next++) {
      const Cell cell = queue[next];
      for (const Cell near : neighbours(cell))
        if (distance[near] == unreachable) {
          distance[near] = distance[cell] + 1;
          queue.push_back(near);
        }
    }
    return distance;
  }

  /* A shortest path from a cell down a table of `distances`, both ends included; the cell
   * alone when no path leads to the goal. */
  std::vector<Cell> path(Cell from, const std::vector<std::uint32_t> &distances) const {
    std::vector<Cell> path{from};
    while (distances[path.back()] != 0 && distances[path.back()] != unreachable)
      for (const Cell near : neighbours(path.back()))
        if (distances[near] == distances[path.back()] - 1) {
          path.push_back(near);
          break;
        }
    return path;
  }

private:
  FleetyardGrid raw_;
};

/* The map. */
class Environment {
public:
  explicit Environment(const FleetyardEnvironment *raw)
      : raw_(detail::checked(raw, "environment")) {}

  std::string_view map_name() const noexcept { return detail::view(raw_.map_name); }
  bool is_grid() const noexcept { return raw_.representation == FLEETYARD_REPRESENTATION_GRID; }

  /* The map as a grid; fails as unsupported when it is none. */
  Grid grid() const {
    if (!is_grid())
      throw Failure(Status::unsupported, "this plugin knows grids only");
    return Grid(static_cast<const FleetyardGrid *>(raw_.view));
  }

private:
  FleetyardEnvironment raw_;
};

/* An instance: the input of a planner. */
class Instance {
public:
  explicit Instance(const FleetyardInstance *raw)
      : raw_(detail::checked(raw, "instance")),
        starts_(detail::checked(raw_.starts, raw_.agents, "instance.starts")),
        goals_(raw_.goal_offsets, raw_.goals, raw_.agents, "instance.goals") {
    for (std::size_t agent = 0; agent < raw_.agents; agent++)
      if (goals_[agent].empty())
        detail::invalid("agent " + std::to_string(agent) + " has no goal");
  }

  /* Number of agents; at least 1. */
  std::uint32_t agents() const noexcept { return raw_.agents; }
  /* The map of the last `prepare`. */
  Environment environment() const { return Environment(raw_.environment); }
  /* The same as a grid; fails as unsupported when it is none. */
  Grid grid() const { return environment().grid(); }
  /* Start cell of every agent. */
  Span<Cell> starts() const noexcept { return starts_; }
  /* Goals of an agent, to be visited in order; at least one. */
  Span<Cell> goals(std::size_t agent) const noexcept { return goals_[agent]; }
  /* The last goal of an agent: where its path should end. */
  Cell goal(std::size_t agent) const noexcept { return goals_[agent].back(); }
  /* True if headings matter. */
  bool has_headings() const noexcept { return raw_.headings != nullptr; }
  /* The heading of an agent at its start, if headings matter. */
  Heading heading(std::size_t agent) const noexcept {
    return static_cast<Heading>(raw_.headings[agent]);
  }
  Motion motion() const noexcept { return static_cast<Motion>(raw_.motion); }
  Objective objective() const noexcept { return static_cast<Objective>(raw_.objective); }
  /* Collisions after so many steps do not matter, and paths may end before their goals; 0
   * for a complete plan. */
  std::uint32_t window_steps() const noexcept { return raw_.window_steps; }
  /* Radius of the largest robot's enclosing circle. */
  double radius_m() const noexcept { return raw_.radius_m; }
  /* True if three or more agents may move round in a ring in one step, each into the cell
   * that the next one leaves. Plans for a fleet must not. */
  bool allows_cycles() const noexcept { return raw_.allows_cycles != 0; }

private:
  FleetyardInstance raw_;
  Span<Cell> starts_;
  detail::Lists goals_;
};

/* Paths that somebody else planned. They may collide, and jump, and leave the map. */
class PlanView {
public:
  explicit PlanView(const FleetyardPlan *raw)
      : agents_(detail::checked(raw, "failed_plan").agents),
        paths_(raw->offsets, raw->cells, agents_, "failed_plan") {}

  std::uint32_t agents() const noexcept { return agents_; }
  /* The cells of an agent at times 0, 1, 2, …; it may have none. */
  Span<Cell> path(std::size_t agent) const noexcept { return paths_[agent]; }

private:
  std::uint32_t agents_;
  detail::Lists paths_;
};

/* A task that nobody has been given. */
struct Task {
  std::uint64_t id;
  Span<Cell> cells; /* to be visited in order */
};

/* The state of the fleet when everything committed has been executed, and the work that
 * is left. */
class FleetState {
public:
  explicit FleetState(const FleetyardFleetState *raw)
      : raw_(detail::checked(raw, "state")),
        cells_(detail::checked(raw_.cells, raw_.agents, "state.cells")),
        goals_(raw_.goal_offsets, raw_.goals, raw_.agents, "state.goals"),
        tasks_(raw_.task_offsets, raw_.task_cells, raw_.tasks, "state.tasks") {
    detail::checked(raw_.task_ids, raw_.tasks, "state.task_ids");
  }

  std::uint32_t agents() const noexcept { return raw_.agents; }
  Environment environment() const { return Environment(raw_.environment); }
  Grid grid() const { return environment().grid(); }
  /* Simulated time since the run began. */
  double time_s() const noexcept { return raw_.time_s; }
  /* The cell of every agent at the end of what is committed. */
  Span<Cell> cells() const noexcept { return cells_; }
  bool has_headings() const noexcept { return raw_.headings != nullptr; }
  Heading heading(std::size_t agent) const noexcept {
    return static_cast<Heading>(raw_.headings[agent]);
  }
  /* Goals that an agent has been given and has not reached, the current one first; may be
   * none. Where goals never end, as many as it takes to keep the agent busy for longer than
   * the window, and at least two. */
  Span<Cell> goals(std::size_t agent) const noexcept { return goals_[agent]; }
  /* Number of open tasks. */
  std::uint32_t tasks() const noexcept { return raw_.tasks; }
  Task task(std::size_t at) const noexcept { return {raw_.task_ids[at], tasks_[at]}; }
  /* Planning window asked for in steps; 0 for none. The next instance may have a shorter
   * one. */
  std::uint32_t window_steps() const noexcept { return raw_.window_steps; }
  Motion motion() const noexcept { return static_cast<Motion>(raw_.motion); }
  Objective objective() const noexcept { return static_cast<Objective>(raw_.objective); }
  double radius_m() const noexcept { return raw_.radius_m; }
  /* True if agents may move round in a ring in one step. */
  bool allows_cycles() const noexcept { return raw_.allows_cycles != 0; }

private:
  FleetyardFleetState raw_;
  Span<Cell> cells_;
  detail::Lists goals_;
  detail::Lists tasks_;
};

/* The status of the fleet. */
class FleetStatus {
public:
  explicit FleetStatus(const FleetyardFleetStatus *raw)
      : raw_(detail::checked(raw, "status")),
        actions_left_(detail::checked(raw_.actions_left, raw_.agents, "status.actions_left")) {}

  std::uint32_t agents() const noexcept { return raw_.agents; }
  /* Simulated time since the run began. */
  double time_s() const noexcept { return raw_.time_s; }
  /* Simulated time since the planner was last called. */
  double since_last_call_s() const noexcept { return raw_.since_last_call_s; }
  /* Limit of the planner's time: its answer to a call now takes effect so much later. */
  double planning_limit_s() const noexcept { return raw_.planning_limit_s; }
  /* The least time that an action of a robot takes. */
  double action_s() const noexcept { return raw_.action_s; }
  /* Per agent the number of committed actions that are not yet executed. */
  Span<std::uint32_t> actions_left() const noexcept { return actions_left_; }

private:
  FleetyardFleetStatus raw_;
  Span<std::uint32_t> actions_left_;
};

/* ---- What a plugin says ------------------------------------------------------ */

/* Paths on a grid. After its last cell an agent stays there. */
class Plan {
public:
  Plan() : offsets_{0} {}
  Plan(const std::vector<std::vector<Cell>> &paths) : Plan() {
    for (const auto &path : paths)
      add(path);
  }

  /* Adds the path of the next agent: its cells at times 0, 1, 2, … */
  void add(Span<Cell> path) {
    cells_.insert(cells_.end(), path.begin(), path.end());
    offsets_.push_back(cells_.size());
  }

  std::size_t agents() const noexcept { return offsets_.size() - 1; }
  FleetyardPlan raw() const noexcept {
    return {sizeof(FleetyardPlan), static_cast<std::uint32_t>(agents()), offsets_.data(),
            cells_.data()};
  }

private:
  std::vector<std::uint64_t> offsets_;
  std::vector<Cell> cells_;
};

/* A task that an instance generator gives to an agent. */
struct Assignment {
  std::uint32_t agent;
  std::uint64_t task; /* identifier of one of the open tasks */
};

/* The instance that a generator submits. */
struct NextInstance {
  std::vector<Cell> starts;
  std::vector<std::vector<Cell>> goals; /* per agent, at least one each */
  std::vector<Heading> headings;        /* empty when they do not matter */
  Motion motion = Motion::pebble;
  Objective objective = Objective::sum_of_costs;
  std::uint32_t window_steps = 0;
  double radius_m = 0.0;
  bool allows_cycles = true;
  /* The host appends the cells of these tasks to the goals of their agents. */
  std::vector<Assignment> assignments;

  NextInstance() = default;
  /* The instance that the state asks for, with the goals that agents have already. Agents
   * that have none need one yet. */
  explicit NextInstance(const FleetState &state)
      : starts(state.cells().begin(), state.cells().end()), motion(state.motion()),
        objective(state.objective()), window_steps(state.window_steps()),
        radius_m(state.radius_m()), allows_cycles(state.allows_cycles()) {
    for (std::size_t agent = 0; agent < starts.size(); agent++) {
      goals.emplace_back(state.goals(agent).begin(), state.goals(agent).end());
      if (state.has_headings())
        headings.push_back(state.heading(agent));
    }
  }
};

/* The host's ear during a call. [thread-safe] */
class Sink {
public:
  explicit Sink(const FleetyardSink *raw) : raw_(&detail::checked(raw, "sink")) {}
  Sink(const Sink &sink, const Budget &budget) : raw_(sink.raw_) {
    const std::chrono::nanoseconds least = std::chrono::milliseconds(1), most = 100 * least;
    stop_ = budget.deadline() - std::clamp(budget.wall() / 50, least, most);
  }

  /* Hands over a plan; may be called again with a better one. Returns whether the host
   * took it: it refuses what is malformed or comes too late. */
  bool submit_plan(const Plan &plan) const noexcept {
    const FleetyardPlan raw = plan.raw();
    return raw_->submit_plan(raw_->context, &raw) == FLEETYARD_OK;
  }

  /* Hands over the next instance, in `generate`. */
  bool submit_instance(const NextInstance &next) const {
    if (next.goals.size() != next.starts.size() ||
        (!next.headings.empty() && next.headings.size() != next.starts.size()))
      throw std::invalid_argument("an instance needs as many starts as goals, and headings");
    const Plan goals(next.goals); // the same form: lists of cells
    std::vector<std::int32_t> headings;
    for (const Heading heading : next.headings)
      headings.push_back(static_cast<std::int32_t>(heading));
    FleetyardInstance raw{};
    raw.struct_size = sizeof raw;
    raw.agents = static_cast<std::uint32_t>(next.starts.size());
    raw.starts = next.starts.data();
    raw.headings = headings.empty() ? nullptr : headings.data();
    raw.goal_offsets = goals.raw().offsets;
    raw.goals = goals.raw().cells;
    raw.motion = static_cast<std::int32_t>(next.motion);
    raw.objective = static_cast<std::int32_t>(next.objective);
    raw.window_steps = next.window_steps;
    raw.radius_m = next.radius_m;
    raw.allows_cycles = next.allows_cycles ? 1 : 0;
    std::vector<FleetyardAssignment> assignments;
    for (const Assignment &given : next.assignments)
      assignments.push_back({given.task, given.agent, 0});
    raw.assignments_count = static_cast<std::uint32_t>(assignments.size());
    raw.assignments = assignments.data();
    return raw_->submit_instance(raw_->context, &raw) == FLEETYARD_OK;
  }

  /* Reports a figure such as `expansions`, kept as a claim. */
  void metric(std::string_view name, double value) const noexcept {
    raw_->metric(raw_->context, detail::str(name), value);
  }
  /* Writes to the run's log. */
  void log(Level level, std::string_view text) const noexcept {
    raw_->log(raw_->context, static_cast<std::int32_t>(level), detail::str(text));
  }
  void log(std::string_view text) const noexcept { log(Level::info, text); }
  /* Says how much of the work is done; `total` 0 if unknown. */
  void progress(std::uint64_t done, std::uint64_t total) const noexcept {
    raw_->progress(raw_->context, done, total);
  }
  /* True if the call should end: the host gave up on it, or the deadline is near. It is so
   * a fiftieth of the budget before, but at least 1 ms and at most 100 ms, because an answer
   * that comes after the deadline does not count. Cheap; ask often. */
  bool cancelled() const noexcept {
    return std::chrono::steady_clock::now() >= stop_ || raw_->cancelled(raw_->context) != 0;
  }
  /* Ends the call as timed out when it should end. */
  void check() const {
    if (cancelled())
      throw Failure(Status::timed_out, "the call's time is up");
  }

private:
  const FleetyardSink *raw_;
  std::chrono::steady_clock::time_point stop_ = std::chrono::steady_clock::time_point::max();
};

/* ---- Options ----------------------------------------------------------------- */

namespace detail {

/* Reads the outermost object of a JSON text, strictly; what its members hold is kept as
 * text. */
class Json {
public:
  struct Member {
    std::string name;
    std::string_view value;
  };

  explicit Json(std::string_view text) : text_(text) {}

  std::vector<Member> object() {
    std::vector<Member> members;
    expect('{');
    if (!take('}')) {
      do {
        blank();
        Member member{string(), {}};
        expect(':');
        member.value = value(0);
        if (find(members, member.name))
          fail("`" + member.name + "` is there twice");
        members.push_back(std::move(member));
      } while (take(','));
      expect('}');
    }
    finish();
    return members;
  }

  /* The text of a string that is all there is. */
  std::string only_string() {
    blank();
    std::string text = string();
    finish();
    return text;
  }

  static const Member *find(const std::vector<Member> &members, std::string_view name) {
    for (const Member &member : members)
      if (member.name == name)
        return &member;
    return nullptr;
  }

private:
  [[noreturn]] void fail(const std::string &reason) const {
    invalid("malformed JSON at byte " + std::to_string(at_) + ": " + reason);
  }
  int peek() const noexcept {
    return at_ < text_.size() ? static_cast<unsigned char>(text_[at_]) : -1;
  }
  void blank() noexcept {
    while (peek() == ' ' || peek() == '\t' || peek() == '\r' || peek() == '\n')
      at_++;
  }
  bool take(char wanted) noexcept {
    blank();
    if (peek() != wanted)
      return false;
    at_++;
    return true;
  }
  void expect(char wanted) {
    if (!take(wanted))
      fail(std::string("`") + wanted + "` is missing");
  }
  void finish() {
    blank();
    if (at_ != text_.size())
      fail("something follows the end");
  }

  std::string_view value(int depth) {
    if (depth > 100)
      fail("too deep");
    blank();
    const std::size_t begin = at_;
    if (peek() == '"') {
      string();
    } else if (peek() == '{' || peek() == '[') {
      const char close = peek() == '{' ? '}' : ']';
      at_++;
      if (!take(close)) {
        do {
          if (close == '}') {
            blank();
            string();
            expect(':');
          }
          value(depth + 1);
        } while (take(','));
        expect(close);
      }
    } else if (!literal("true") && !literal("false") && !literal("null")) {
      number();
    }
    return text_.substr(begin, at_ - begin);
  }

  bool literal(std::string_view word) noexcept {
    if (text_.substr(at_, word.size()) != word)
      return false;
    at_ += word.size();
    return true;
  }

  bool digits() noexcept {
    const std::size_t begin = at_;
    while (peek() >= '0' && peek() <= '9')
      at_++;
    return at_ > begin;
  }

  void number() {
    if (peek() == '-')
      at_++;
    const bool zero = peek() == '0';
    const std::size_t begin = at_;
    if (!digits() || (zero && at_ > begin + 1))
      fail("no value");
    if (peek() == '.') {
      at_++;
      if (!digits())
        fail("no digit after the point");
    }
    if (peek() == 'e' || peek() == 'E') {
      at_++;
      if (peek() == '+' || peek() == '-')
        at_++;
      if (!digits())
        fail("no digit in the exponent");
    }
  }

  std::uint32_t hex() {
    std::uint32_t code = 0;
    const std::string_view four = text_.substr(at_, 4);
    const char *const after = four.data() + four.size();
    const auto [end, error] = std::from_chars(four.data(), after, code, 16);
    if (error != std::errc() || end != after || four.size() != 4)
      fail("not four hexadecimal digits");
    at_ += 4;
    return code;
  }

  std::uint32_t escaped_code() {
    const std::uint32_t code = hex();
    if (code < 0xD800 || code > 0xDFFF)
      return code;
    if (code > 0xDBFF || !literal("\\u"))
      fail("half a surrogate pair");
    const std::uint32_t low = hex();
    if (low < 0xDC00 || low > 0xDFFF)
      fail("half a surrogate pair");
    return 0x10000 + ((code - 0xD800) << 10) + (low - 0xDC00);
  }

  static void append(std::string &text, std::uint32_t code) {
    const auto byte = [&](std::uint32_t bits) { text += static_cast<char>(bits); };
    if (code < 0x80) {
      byte(code);
    } else if (code < 0x800) {
      byte(0xC0 | code >> 6);
      byte(0x80 | (code & 0x3F));
    } else if (code < 0x10000) {
      byte(0xE0 | code >> 12);
      byte(0x80 | (code >> 6 & 0x3F));
      byte(0x80 | (code & 0x3F));
    } else {
      byte(0xF0 | code >> 18);
      byte(0x80 | (code >> 12 & 0x3F));
      byte(0x80 | (code >> 6 & 0x3F));
      byte(0x80 | (code & 0x3F));
    }
  }

  std::string string() {
    if (peek() != '"')
      fail("no string");
    at_++;
    std::string text;
    while (peek() != '"') {
      const int byte = peek();
      if (byte < 0x20)
        fail(byte < 0 ? "a string without an end" : "a control character in a string");
      at_++;
      if (byte != '\\') {
        text += static_cast<char>(byte);
        continue;
      }
      const int letter = peek();
      at_++;
      constexpr std::string_view letters = "\"\\/bfnrt", meanings = "\"\\/\b\f\n\r\t";
      const std::size_t known =
          letter < 0 ? std::string_view::npos : letters.find(static_cast<char>(letter));
      if (known != std::string_view::npos)
        text += meanings[known];
      else if (letter == 'u')
        append(text, escaped_code());
      else
        fail("an unknown escape");
    }
    at_++;
    return text;
  }

  std::string_view text_;
  std::size_t at_ = 0;
};

} // namespace detail

/* The options that the user gave, a JSON object. The host has checked them against the
 * plugin's schema; what the user did not give has the default of the schema.
 *
 * Every getter fails as invalid input when the value is of another type, and when there
 * is neither a value nor a default (has() tells). */
class Options {
public:
  Options(std::string_view json, std::string_view schema) : json_(json.empty() ? "{}" : json) {
    given_ = read(json_, "options");
    if (schema.empty()) { // a plugin without options
      closed_ = true;
    } else {
      const std::vector<Member> all = read(schema, "options_schema");
      if (const Member *properties = Json::find(all, "properties"))
        properties_ = read(properties->value, "options_schema");
      const Member *additional = Json::find(all, "additionalProperties");
      closed_ = additional && additional->value == "false";
    }
    for (const Member &member : given_)
      if (closed_ && !Json::find(properties_, member.name))
        detail::invalid("options: there is no option `" + member.name + "`");
  }

  /* The JSON text, for plugins that have a library to read it. */
  std::string_view json() const noexcept { return json_; }
  /* True if an option has a value or a default. */
  bool has(std::string_view name) const { return find(name).has_value(); }
  /* The JSON text of a value. */
  std::string_view json(std::string_view name) const {
    if (const auto value = find(name))
      return *value;
    detail::invalid("options: `" + std::string(name) + "` is missing");
  }

  /* A whole number; 3.0 is one. */
  std::int64_t integer(std::string_view name) const {
    const std::string_view text = json(name);
    std::int64_t value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error == std::errc() && end == text.data() + text.size())
      return value;
    const std::optional<double> real = number_of(text);
    constexpr double exact = 9007199254740992.0; // 2^53
    if (!real || std::nearbyint(*real) < *real || std::nearbyint(*real) > *real ||
        std::abs(*real) > exact)
      wrong(name, "a whole number");
    return static_cast<std::int64_t>(*real);
  }
  double number(std::string_view name) const {
    const std::optional<double> value = number_of(json(name));
    if (!value)
      wrong(name, "a number");
    return *value;
  }
  bool flag(std::string_view name) const {
    const std::string_view text = json(name);
    if (text != "true" && text != "false")
      wrong(name, "true or false");
    return text == "true";
  }
  std::string text(std::string_view name) const {
    const std::string_view text = json(name);
    if (text.empty() || text.front() != '"')
      wrong(name, "a string");
    return Json(text).only_string();
  }

private:
  using Json = detail::Json;
  using Member = Json::Member;

  static std::vector<Member> read(std::string_view text, const char *what) {
    try {
      return Json(text).object();
    } catch (const Failure &failure) {
      detail::invalid(std::string(what) + ": " + failure.what());
    }
  }

  std::optional<std::string_view> find(std::string_view name) const {
    if (const Member *given = Json::find(given_, name))
      return given->value;
    const Member *property = Json::find(properties_, name);
    if (!property || property->value.front() != '{')
      return std::nullopt;
    const std::vector<Member> about = read(property->value, "options_schema");
    const Member *usual = Json::find(about, "default");
    // Into the text of the schema, which outlives `about`.
    return usual ? std::optional(usual->value) : std::nullopt;
  }

  /* The text of a JSON number as one, whatever the locale. */
  static std::optional<double> number_of(std::string_view text) {
    if (text.empty() || (text.front() != '-' && (text.front() < '0' || text.front() > '9')))
      return std::nullopt;
    std::istringstream stream{std::string(text)};
    stream.imbue(std::locale::classic());
    double value = 0;
    stream >> value;
    return stream && stream.peek() == std::istringstream::traits_type::eof()
               ? std::optional(value)
               : std::nullopt;
  }

  [[noreturn]] void wrong(std::string_view name, const char *wanted) const {
    detail::invalid("options: `" + std::string(name) + "` is " + std::string(json(name)) +
                    ", not " + wanted);
  }

  std::string_view json_;
  std::vector<Member> given_;
  std::vector<Member> properties_; /* of the schema */
  bool closed_ = false;            /* whether the schema allows no others */
};

/* ---- The four kinds ---------------------------------------------------------- */

/* Description of a plugin, which hides these members by its own. A plugin
 * with options has a constructor that takes `const Options &`. */
class Plugin {
public:
  /* Short identifier, [a-z0-9][a-z0-9._-]*, unique in the library per kind. */
  static constexpr std::string_view id = "";
  /* Human-readable; the identifier when empty. */
  static constexpr std::string_view name = "";
  static constexpr std::string_view version = "";
  /* One paragraph, the paper cited. */
  static constexpr std::string_view description = "";
  /* SPDX licence expression. */
  static constexpr std::string_view license = "";
  /* JSON Schema of the options; empty when there are none. */
  static constexpr std::string_view options_schema = "";
  static constexpr std::uint64_t capabilities = 0;

  Plugin() = default;
  Plugin(const Plugin &) = delete;
  Plugin &operator=(const Plugin &) = delete;
  virtual ~Plugin() = default;
};

/* Solves instances. */
class Planner : public Plugin {
public:
  /* Learns a map, within a budget of its own. Called once per map, before `plan`. */
  virtual void prepare(const Environment &, const Budget &, const Sink &) {}
  /* Solves an instance and submits plans to the sink. To return claims that the last one
   * solves it. */
  virtual void plan(const Instance &instance, const Budget &budget, const Sink &sink) = 0;
};

/* Gets the fleet moving again when the planner has failed. */
class FailPolicy : public Plugin {
public:
  /* As Planner::prepare. */
  virtual void prepare(const Environment &, const Budget &, const Sink &) {}
  /* Submits a collision-free plan; `failed` is what the planner left, if it left anything. */
  virtual void recover(const Instance &instance, const std::optional<PlanView> &failed,
                       const Budget &budget, const Sink &sink) = 0;
};

/* Decides what the planner is asked next. */
class InstanceGenerator : public Plugin {
public:
  /* As Planner::prepare. */
  virtual void prepare(const Environment &, const Budget &, const Sink &) {}
  /* Submits one instance. */
  virtual void generate(const FleetState &state, const Budget &budget, const Sink &sink) = 0;
};

/* Decides when the planner is called. */
class InvocationPolicy : public Plugin {
public:
  /* True if the planner has to be called now. */
  virtual bool should_invoke(const FleetStatus &status, const Sink &sink) = 0;
};

/* ---- From there to the C ABI ------------------------------------------------- */

/* Hidden whatever the compiler's options are: two libraries in one process may have
 * plugins of the same name, and must not share their tables. */
#if defined(__GNUC__)
#define FLEETYARD_HIDDEN __attribute__((visibility("hidden")))
#else
#define FLEETYARD_HIDDEN
#endif

namespace detail FLEETYARD_HIDDEN {

/* Runs a call of a plugin: no exception leaves it, and failures are explained to the sink. */
template <class Call> std::int32_t guarded(const FleetyardSink *raw, Call call) noexcept {
  const auto explained = [raw](Status status, std::string_view message) {
    if (raw && raw->struct_size == sizeof *raw)
      raw->fail(raw->context, str(message));
    return static_cast<std::int32_t>(status);
  };
  try {
    call(Sink(raw));
    return FLEETYARD_STATUS_SOLVED;
  } catch (const Failure &failure) {
    return explained(failure.status(), failure.what());
  } catch (const std::bad_alloc &) {
    return explained(Status::internal_error, "out of memory");
  } catch (const std::exception &error) {
    return explained(Status::internal_error, error.what());
  } catch (...) {
    return explained(Status::internal_error, "an exception that is no std::exception");
  }
}

/* A plugin that has been made. */
template <class Base> struct Made {
  std::unique_ptr<Base> plugin;
  bool prepared = false;

  static Made &of(void *context) noexcept { return *static_cast<Made *>(context); }

  Base &ready() const {
    if (!prepared)
      invalid("the call came before a successful `prepare`");
    return *plugin;
  }

  static std::int32_t prepare(void *context, const FleetyardEnvironment *environment,
                              const FleetyardBudget *budget, const FleetyardSink *sink) noexcept {
    return guarded(sink, [&](const Sink &to) {
      Made &made = of(context);
      made.prepared = false;
      const Budget limits(budget);
      made.plugin->prepare(Environment(environment), limits, Sink(to, limits));
      made.prepared = true;
    });
  }

  static void destroy(void *context) noexcept {
    try {
      delete static_cast<Made *>(context);
    } catch (...) { // nobody is left to hear of it
    }
  }
};

/* Per kind: its structures, its identifier, and how its functions are filled in. */
template <class Base> struct Kind;

template <> struct Kind<Planner> {
  using Object = FleetyardPlanner;
  using Factory = FleetyardPlannerFactory;
  static constexpr std::string_view factory_id = FLEETYARD_PLANNER_FACTORY_ID;

  static std::int32_t plan(void *context, const FleetyardInstance *instance,
                           const FleetyardBudget *budget, const FleetyardSink *sink) noexcept {
    return guarded(sink, [&](const Sink &to) {
      const Budget limits(budget);
      Made<Planner>::of(context).ready().plan(Instance(instance), limits, Sink(to, limits));
    });
  }
  static void fill(Object &out) noexcept {
    out.prepare = Made<Planner>::prepare;
    out.plan = plan;
  }
};

template <> struct Kind<FailPolicy> {
  using Object = FleetyardFailPolicy;
  using Factory = FleetyardFailPolicyFactory;
  static constexpr std::string_view factory_id = FLEETYARD_FAIL_POLICY_FACTORY_ID;

  static std::int32_t recover(void *context, const FleetyardInstance *instance,
                              const FleetyardPlan *failed_plan, const FleetyardBudget *budget,
                              const FleetyardSink *sink) noexcept {
    return guarded(sink, [&](const Sink &to) {
      const Instance asked(instance);
      std::optional<PlanView> failed;
      if (failed_plan)
        failed.emplace(failed_plan);
      if (failed && failed->agents() != asked.agents())
        invalid("failed_plan has paths for another number of agents than the instance");
      const Budget limits(budget);
      Made<FailPolicy>::of(context).ready().recover(asked, failed, limits, Sink(to, limits));
    });
  }
  static void fill(Object &out) noexcept {
    out.prepare = Made<FailPolicy>::prepare;
    out.recover = recover;
  }
};

template <> struct Kind<InstanceGenerator> {
  using Object = FleetyardInstanceGenerator;
  using Factory = FleetyardInstanceGeneratorFactory;
  static constexpr std::string_view factory_id = FLEETYARD_INSTANCE_GENERATOR_FACTORY_ID;

  static std::int32_t generate(void *context, const FleetyardFleetState *state,
                               const FleetyardBudget *budget, const FleetyardSink *sink) noexcept {
    return guarded(sink, [&](const Sink &to) {
      const Budget limits(budget);
      Made<InstanceGenerator>::of(context).ready().generate(FleetState(state), limits,
                                                            Sink(to, limits));
    });
  }
  static void fill(Object &out) noexcept {
    out.prepare = Made<InstanceGenerator>::prepare;
    out.generate = generate;
  }
};

template <> struct Kind<InvocationPolicy> {
  using Object = FleetyardInvocationPolicy;
  using Factory = FleetyardInvocationPolicyFactory;
  static constexpr std::string_view factory_id = FLEETYARD_INVOCATION_POLICY_FACTORY_ID;

  static std::int32_t should_invoke(void *context, const FleetyardFleetStatus *status,
                                    const FleetyardSink *sink) noexcept {
    bool now = false;
    const std::int32_t ended = guarded(sink, [&](const Sink &to) {
      now = Made<InvocationPolicy>::of(context).plugin->should_invoke(FleetStatus(status), to);
    });
    if (ended != FLEETYARD_STATUS_SOLVED)
      return -ended;
    return now ? FLEETYARD_INVOKE_NOW : FLEETYARD_INVOKE_NOT_YET;
  }
  static void fill(Object &out) noexcept { out.should_invoke = should_invoke; }
};

constexpr bool is_identifier(std::string_view id) noexcept {
  const auto letter = [](char c) { return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9'); };
  for (const char c : id)
    if (!letter(c) && c != '.' && c != '_' && c != '-')
      return false;
  return !id.empty() && letter(id.front());
}

/* Descriptor and constructor of one plugin type. */
template <class Base> struct Entry {
  FleetyardDescriptor descriptor;
  std::unique_ptr<Base> (*make)(const Options &);

  template <class T> static Entry of() {
    static_assert(is_identifier(T::id),
                  "a plugin needs `static constexpr auto id` of the form [a-z0-9][a-z0-9._-]*");
    const std::string_view name = T::name, id = T::id;
    return {{sizeof(FleetyardDescriptor), 0, str(id), str(name.empty() ? id : name),
             str(T::version), str(T::description), str(T::license), str(T::options_schema),
             T::capabilities},
            [](const Options &options) -> std::unique_ptr<Base> {
              if constexpr (std::is_constructible_v<T, const Options &>) {
                return std::make_unique<T>(options);
              } else {
                static_cast<void>(options);
                return std::make_unique<T>();
              }
            }};
  }
};

/* The factory of one kind, for those of the plugins that are of it. */
template <class Base, class... Plugins> struct Factory {
  using Object = typename Kind<Base>::Object;
  static constexpr std::uint32_t size =
      (std::uint32_t{0} + ... + std::uint32_t{std::is_base_of_v<Base, Plugins>});

  static const std::vector<Entry<Base>> &entries() {
    static const std::vector<Entry<Base>> list = [] {
      std::vector<Entry<Base>> all;
      (add<Plugins>(all), ...);
      return all;
    }();
    return list;
  }

  template <class T> static void add(std::vector<Entry<Base>> &all) {
    if constexpr (std::is_base_of_v<Base, T>)
      all.push_back(Entry<Base>::template of<T>());
    else
      static_cast<void>(all);
  }

  static std::uint32_t count() noexcept { return size; }

  static const FleetyardDescriptor *descriptor(std::uint32_t index) noexcept {
    try {
      return index < size ? &entries()[index].descriptor : nullptr;
    } catch (...) { // out of memory
      return nullptr;
    }
  }

  static std::int32_t create(std::uint32_t index, FleetyardStr options, const FleetyardSink *sink,
                             Object *out) noexcept {
    return guarded(sink, [&](const Sink &) {
      if (index >= size || !out)
        invalid("there is no plugin with that number, or no place for it");
      const Entry<Base> &entry = entries()[index];
      const Options given(view(options), view(entry.descriptor.options_schema));
      auto made = std::make_unique<Made<Base>>();
      made->plugin = entry.make(given);
      *out = Object{};
      out->struct_size = sizeof *out;
      out->destroy = Made<Base>::destroy;
      Kind<Base>::fill(*out);
      out->context = made.release();
    });
  }

  static constexpr typename Kind<Base>::Factory table = {
      sizeof(typename Kind<Base>::Factory), 0, count, descriptor, create};
};

template <class... Plugins> struct Library {
  template <class T>
  static constexpr int kinds = std::is_base_of_v<Planner, T> + std::is_base_of_v<FailPolicy, T> +
                               std::is_base_of_v<InstanceGenerator, T> +
                               std::is_base_of_v<InvocationPolicy, T>;
  static_assert(((kinds<Plugins> == 1) && ...),
                "a plugin derives from one of fleetyard::Planner, FailPolicy, "
                "InstanceGenerator and InvocationPolicy");

  template <class Base> static const void *factory(std::string_view id) noexcept {
    using Made = Factory<Base, Plugins...>;
    return Made::size > 0 && id == Kind<Base>::factory_id ? &Made::table : nullptr;
  }

  static const void *get_factory(FleetyardStr text) noexcept {
    const std::string_view id = view(text);
    for (const void *found : {factory<Planner>(id), factory<FailPolicy>(id),
                              factory<InstanceGenerator>(id), factory<InvocationPolicy>(id)})
      if (found)
        return found;
    return nullptr;
  }
};

} // namespace detail
#undef FLEETYARD_HIDDEN

} // namespace fleetyard

/* Exports plugins, once per library: FLEETYARD_PLUGINS(MyPlanner, MyPolicy); */
#define FLEETYARD_PLUGINS(...)                                                                  \
  const FleetyardPluginEntry fleetyard_plugin_entry_v1 = {                                      \
      sizeof(FleetyardPluginEntry), FLEETYARD_ABI_MAJOR, FLEETYARD_ABI_MINOR, nullptr, nullptr, \
      ::fleetyard::detail::Library<__VA_ARGS__>::get_factory}

#endif /* FLEETYARD_HPP */
