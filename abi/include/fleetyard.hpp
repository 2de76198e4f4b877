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
 * What a plugin does not claim it is not asked: an environment, motion, flag or critical part
 * that its capabilities and features do not name ends the call as unsupported before the plugin
 * hears of it.
 *
 * Instances, states and budgets are views of the host's memory: they end with the call that
 * received them. An environment stays until the next `prepare`, or the end of the plugin. A
 * Sink may be used from any thread until the call returns.
 */

#ifndef FLEETYARD_HPP
#define FLEETYARD_HPP

#include "fleetyard.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <functional>
#include <limits>
#include <memory>
#include <new>
#include <optional>
#include <queue>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

namespace fleetyard {

/* ---- Names for the constants of the contract -------------------------------- */

/* A cell of a grid, row * cols + col with row 0 at the top, or a vertex of a roadmap. */
using Place = std::uint32_t;
using Cell = Place;
using Vertex = Place;

/* No place, and the distance of a cell from which no path leads to the goal. */
inline constexpr std::uint32_t none = FLEETYARD_NONE, unreachable = FLEETYARD_NONE;

/* Capabilities that a plugin claims, joined by `|`. */
namespace capability {
inline constexpr std::uint64_t grid = FLEETYARD_CAPABILITY_GRID;
inline constexpr std::uint64_t roadmap = FLEETYARD_CAPABILITY_ROADMAP;
inline constexpr std::uint64_t continuous = FLEETYARD_CAPABILITY_CONTINUOUS;
inline constexpr std::uint64_t eight_connected = FLEETYARD_CAPABILITY_EIGHT_CONNECTED;
inline constexpr std::uint64_t move_mask = FLEETYARD_CAPABILITY_MOVE_MASK;
inline constexpr std::uint64_t pebble = FLEETYARD_CAPABILITY_PEBBLE;
inline constexpr std::uint64_t rotation = FLEETYARD_CAPABILITY_ROTATION;
inline constexpr std::uint64_t any_angle = FLEETYARD_CAPABILITY_ANY_ANGLE;
inline constexpr std::uint64_t stop_go = FLEETYARD_CAPABILITY_STOP_GO;
inline constexpr std::uint64_t slower = FLEETYARD_CAPABILITY_SLOWER;
inline constexpr std::uint64_t dynamics = FLEETYARD_CAPABILITY_DYNAMICS;
inline constexpr std::uint64_t anytime = FLEETYARD_CAPABILITY_ANYTIME;
inline constexpr std::uint64_t windowed = FLEETYARD_CAPABILITY_WINDOWED;
inline constexpr std::uint64_t duplicate_goals = FLEETYARD_CAPABILITY_DUPLICATE_GOALS;
inline constexpr std::uint64_t colliding_plans = FLEETYARD_CAPABILITY_COLLIDING_PLANS;
inline constexpr std::uint64_t k_robust = FLEETYARD_CAPABILITY_K_ROBUST;
inline constexpr std::uint64_t deterministic = FLEETYARD_CAPABILITY_DETERMINISTIC;
inline constexpr std::uint64_t threads = FLEETYARD_CAPABILITY_THREADS;
inline constexpr std::uint64_t idle = FLEETYARD_CAPABILITY_IDLE;
inline constexpr std::uint64_t heterogeneous = FLEETYARD_CAPABILITY_HETEROGENEOUS;
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

/* What became of an answer that was submitted. */
enum class Result : std::int32_t {
  ok = FLEETYARD_OK,
  rejected = FLEETYARD_REJECTED,
  too_late = FLEETYARD_TOO_LATE,
  busy = FLEETYARD_BUSY,
};

enum class Representation : std::int32_t {
  grid = FLEETYARD_REPRESENTATION_GRID,
  roadmap = FLEETYARD_REPRESENTATION_ROADMAP,
  continuous = FLEETYARD_REPRESENTATION_CONTINUOUS,
};

enum class Motion : std::int32_t {
  pebble = FLEETYARD_MOTION_PEBBLE,
  rotation = FLEETYARD_MOTION_ROTATION,
  any_angle = FLEETYARD_MOTION_ANY_ANGLE,
  stop_go = FLEETYARD_MOTION_STOP_GO,
  slower = FLEETYARD_MOTION_SLOWER,
  dynamics = FLEETYARD_MOTION_DYNAMICS,
};

enum class Objective : std::int32_t {
  sum_of_costs = FLEETYARD_OBJECTIVE_SUM_OF_COSTS,
  makespan = FLEETYARD_OBJECTIVE_MAKESPAN,
};

enum class Form : std::int32_t {
  cells = FLEETYARD_FORM_CELLS,
  visits = FLEETYARD_FORM_VISITS,
  trajectories = FLEETYARD_FORM_TRAJECTORIES,
};

enum class Heading : std::int8_t {
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

inline FleetyardStr str(std::string_view text) noexcept { return {text.data(), text.size()}; }

inline std::string_view view(FleetyardStr text) noexcept {
  return text.ptr ? std::string_view(text.ptr, text.len) : std::string_view();
}

[[noreturn]] inline void invalid(const std::string &reason) {
  throw Failure(Status::invalid_input, reason);
}

[[noreturn]] inline void unsupported(const std::string &reason) {
  throw Failure(Status::unsupported, reason);
}

/* A structure of the host, which may be longer than the one of this header. */
template <class T> const T &checked(const T *pointer, const char *name) {
  if (!pointer)
    invalid(std::string(name) + " is null");
  if (pointer->struct_size < sizeof(T))
    invalid(std::string(name) + ".struct_size is " + std::to_string(pointer->struct_size) +
            ", but the structure has " + std::to_string(sizeof(T)) + " bytes");
  return *pointer;
}

template <class T> Span<T> checked(const T *pointer, std::size_t size, const char *name) {
  if (!pointer && size)
    invalid(std::string(name) + " is null");
  return {pointer, size};
}

inline void zero(std::uint32_t reserved, const char *name) {
  if (reserved != 0)
    invalid(std::string(name) + ".reserved is " + std::to_string(reserved) + ", not 0");
}

/* A code of which this header knows those from 1 to `last`. */
inline std::int32_t code(std::int32_t value, std::int32_t last, const char *name) {
  if (value == 0)
    invalid(std::string(name) + " is 0, which is no value");
  if (value < 0 || value > last)
    unsupported(std::string(name) + " " + std::to_string(value) + " is unknown");
  return value;
}

inline void flags(std::uint32_t value, std::uint32_t known, const char *name) {
  if (value & ~known)
    unsupported(std::string(name) + " has unknown flags: " + std::to_string(value & ~known));
}

/* Offsets into something, as the contract has them. */
inline Span<std::uint64_t> offsets(const std::uint64_t *pointer, std::size_t count,
                                   const char *name) {
  const Span<std::uint64_t> all = checked(pointer, count + 1, name);
  if (all.front() != 0 || !std::is_sorted(all.begin(), all.end()))
    invalid(std::string("the offsets of ") + name + " are out of order");
  return all;
}

/* Several lists in one array, with their offsets. */
template <class T> class Lists {
public:
  Lists() = default;
  Lists(const std::uint64_t *begins, const T *items, std::size_t count, const char *name)
      : offsets_(detail::offsets(begins, count, name)), items_(items) {
    checked(items, static_cast<std::size_t>(offsets_.back()), name);
  }

  std::size_t size() const noexcept { return offsets_.empty() ? 0 : offsets_.size() - 1; }
  Span<T> operator[](std::size_t at) const noexcept {
    const auto begin = static_cast<std::size_t>(offsets_[at]);
    const auto end = static_cast<std::size_t>(offsets_[at + 1]);
    return begin == end ? Span<T>() : Span<T>(items_ + begin, end - begin);
  }

private:
  Span<std::uint64_t> offsets_;
  const T *items_ = nullptr;
};

} // namespace detail

/* A position in the plane: x to the right, y upwards. */
struct Point {
  double x_m, y_m;
};

/* Data with a name that a view or a question carries. */
class Part {
public:
  explicit Part(const FleetyardPart &raw) : raw_(raw) {}

  /* `fleetyard.NAME/REVISION`, or the same beginning with a reversed domain name. */
  std::string_view id() const noexcept { return detail::view(raw_.id); }
  /* True if a plugin that does not know it must refuse the question. */
  bool critical() const noexcept { return (raw_.flags & FLEETYARD_PART_CRITICAL) != 0; }
  /* The JSON text, if the part is one. */
  std::optional<std::string_view> json() const {
    if ((raw_.flags & FLEETYARD_PART_JSON) == 0)
      return std::nullopt;
    const auto *json = static_cast<const FleetyardJson *>(raw_.data);
    return detail::view(detail::checked(json, "part.data").text);
  }
  /* The structure otherwise, as its identifier says. */
  const void *data() const noexcept { return raw_.data; }

private:
  FleetyardPart raw_;
};

/* All of them. */
class Parts {
public:
  explicit Parts(const FleetyardParts &raw)
      : list_(detail::checked(raw.list, static_cast<std::size_t>(raw.count), "parts")) {
    for (const FleetyardPart &part : list_)
      detail::zero(part.reserved, "part");
  }

  std::size_t size() const noexcept { return list_.size(); }
  Part operator[](std::size_t at) const { return Part(list_[at]); }
  std::optional<Part> find(std::string_view id) const {
    for (const FleetyardPart &part : list_)
      if (detail::view(part.id) == id)
        return Part(part);
    return std::nullopt;
  }

  /* The structure of a part, if there is one and it is not JSON. */
  template <class T> std::optional<T> structure(std::string_view id) const {
    const std::optional<Part> part = find(id);
    if (!part || part->json())
      return std::nullopt;
    return detail::checked(static_cast<const T *>(part->data()), "part.data");
  }

private:
  Span<FleetyardPart> list_;
};

/* Averages of how a fleet moves, at a moment. Everything is 0 in the first ones. */
struct Snapshot {
  std::uint64_t number = 0;   /* how many were taken before: a key for caches */
  Span<std::uint8_t> waiting; /* per place, the share of time in units of 1/255 */
  Span<std::uint8_t> flow;    /* per cell and move, or per edge, in Traffic::flow_unit_per_s */
};

/* Where robots wait, and which way they go: two snapshots, a period apart. */
class Traffic {
public:
  explicit Traffic(const FleetyardTraffic &raw)
      : raw_(raw), last_(snapshot(raw.last)), before_(snapshot(raw.before)) {}

  /* Simulated time from a snapshot to the next, and since the last one. */
  double period_s() const noexcept { return raw_.period_s; }
  double since_s() const noexcept { return raw_.since_s; }
  /* Time constant of the exponential averages. */
  double time_constant_s() const noexcept { return raw_.time_constant_s; }
  /* A flow of 1 stands for so many moves per second. */
  double flow_unit_per_s() const noexcept { return raw_.flow_unit_per_s; }
  /* The last snapshot, and the one before: the same as long as there is only one. */
  const Snapshot &last() const noexcept { return last_; }
  const Snapshot &before() const noexcept { return before_; }

private:
  Snapshot snapshot(const FleetyardSnapshot *pointer) const {
    const FleetyardSnapshot &raw = detail::checked(pointer, "traffic");
    return {raw.number, detail::checked(raw.waiting, raw_.places, "traffic.waiting"),
            detail::checked(raw.flow, static_cast<std::size_t>(raw_.flows), "traffic.flow")};
  }

  FleetyardTraffic raw_;
  Snapshot last_, before_;
};

/* What of the last plan nobody is committed to. */
class RestOfPlan {
public:
  explicit RestOfPlan(const FleetyardRestOfPlan &raw)
      : paths_(raw.offsets, raw.moves, raw.agents, "rest_of_plan") {}

  std::size_t agents() const noexcept { return paths_.size(); }
  /* A letter of `NESWnesw` per step of an agent from its start on, `.` for a wait. */
  std::string_view moves(std::size_t agent) const noexcept {
    const Span<std::uint8_t> path = paths_[agent];
    return {reinterpret_cast<const char *>(path.data()), path.size()};
  }

private:
  detail::Lists<std::uint8_t> paths_;
};

/* The tasks that goals belong to: the goals of all agents one after the other, in the order of the
 * instance. */
struct GoalTasks {
  static constexpr std::uint64_t no_task = UINT64_MAX;

  double time_s;              /* since the run began */
  Span<std::uint64_t> tasks;  /* `no_task` for a goal of none, or not the agent's own */
  Span<std::uint32_t> errands; /* which of the task's places a goal is */
  Span<double> released_s;    /* when its task was released; for other goals as given_s */
  Span<double> given_s;       /* when the agent was given it; without a task, when the goal before
                                 it was reached */

  explicit GoalTasks(const FleetyardGoalTasks &raw)
      : time_s(raw.time_s), tasks(column(raw.tasks, raw)), errands(column(raw.errands, raw)),
        released_s(column(raw.released_s, raw)), given_s(column(raw.given_s, raw)) {
    detail::zero(raw.reserved, "goal_tasks");
  }

private:
  template <class T> static Span<T> column(const T *pointer, const FleetyardGoalTasks &raw) {
    return detail::checked(pointer, static_cast<std::size_t>(raw.goals), "goal_tasks");
  }
};

/* Factors on what moves and waits cost, in units of 1 / FLEETYARD_GUIDANCE_NEUTRAL. */
struct Guidance {
  Span<std::uint16_t> moves; /* per cell and move, or per edge */
  Span<std::uint16_t> waits; /* per place */

  explicit Guidance(const FleetyardGuidance &raw)
      : moves(detail::checked(raw.moves, static_cast<std::size_t>(raw.move_count),
                              "guidance.moves")),
        waits(detail::checked(raw.waits, raw.places, "guidance.waits")) {}
};

/* The memory that the host keeps of a fleet, of instances and states. It hands it to plugins alone
 * that list `part:` and the identifier in their features. */
template <class Input> class WithMemory {
public:
  std::optional<Traffic> traffic() const {
    return read<Traffic, FleetyardTraffic>(FLEETYARD_TRAFFIC_ID);
  }
  std::optional<RestOfPlan> rest_of_plan() const {
    return read<RestOfPlan, FleetyardRestOfPlan>(FLEETYARD_REST_OF_PLAN_ID);
  }
  std::optional<GoalTasks> goal_tasks() const {
    return read<GoalTasks, FleetyardGoalTasks>(FLEETYARD_GOAL_TASKS_ID);
  }
  std::optional<Guidance> guidance() const {
    return read<Guidance, FleetyardGuidance>(FLEETYARD_GUIDANCE_ID);
  }
  /* The bytes that this plugin kept last; empty when there are none. */
  Span<std::uint8_t> kept() const {
    const auto raw = parts().template structure<FleetyardBytes>(FLEETYARD_KEPT_ID);
    return raw ? detail::checked(raw->ptr, static_cast<std::size_t>(raw->len), "kept")
               : Span<std::uint8_t>();
  }

private:
  Parts parts() const { return static_cast<const Input &>(*this).parts(); }
  template <class T, class Raw> std::optional<T> read(std::string_view id) const {
    const std::optional<Raw> raw = parts().template structure<Raw>(id);
    return raw ? std::optional<T>(T(*raw)) : std::nullopt;
  }
};

/* Limits of one call. The host enforces them. */
class Budget {
public:
  explicit Budget(const FleetyardBudget *raw) : raw_(detail::checked(raw, "budget")) {}

  /* When the call must have returned, on the clock of Sink::now. */
  std::chrono::nanoseconds deadline() const noexcept {
    return nanoseconds(raw_.deadline_monotonic_ns);
  }
  /* When to come to an end, so that the answer arrives in time: Sink::cancelled then says so. */
  std::chrono::nanoseconds answer_by() const noexcept { return nanoseconds(raw_.answer_by_ns); }
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
    detail::checked(raw_.moves, size(), "grid.moves");
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
  /* Per cell the moves that are allowed, bits of FLEETYARD_MOVE_*. */
  Span<std::uint8_t> moves() const noexcept { return {raw_.moves, size()}; }

  Cell cell(std::uint32_t row, std::uint32_t col) const noexcept { return row * raw_.cols + col; }
  std::uint32_t row(Cell cell) const noexcept { return cell / raw_.cols; }
  std::uint32_t col(Cell cell) const noexcept { return cell % raw_.cols; }
  /* The middle of a cell in the plane. */
  Point centre(Cell cell) const noexcept {
    return {raw_.origin_x_m + (col(cell) + 0.5) * raw_.cell_size_m,
            raw_.origin_y_m + (raw_.rows - row(cell) - 0.5) * raw_.cell_size_m};
  }

  /* True if a robot may stand in a cell; false off the map. */
  bool is_free(Cell cell) const noexcept { return cell < size() && raw_.passable[cell] != 0; }

  /* The cells that one move reaches from a cell of the map: north, east, south, west and
   * then, with eight neighbours, the diagonals. Waiting is always possible too. */
  Neighbours neighbours(Cell cell) const noexcept {
    Neighbours found;
    for (int move = 0; move < 8; move++)
      if (allows(cell, move))
        found.add(beside(cell, move));
    return found;
  }

  /* The cells from which one move leads to a cell: where all moves can be made both ways, its
   * neighbours. */
  Neighbours origins(Cell cell) const noexcept {
    Neighbours found;
    for (int move = 0; move < 8; move++) {
      const Cell from = beside(cell, move ^ 2); // the opposite direction
      if (from != none && allows(from, move))
        found.add(from);
    }
    return found;
  }

  /* True if an agent may go from one cell to another in a step, or wait. */
  bool is_step(Cell from, Cell to) const noexcept {
    if (!is_free(from) || from == to)
      return is_free(from) && from == to;
    const Neighbours near = neighbours(from);
    return std::find(near.begin(), near.end(), to) != near.end();
  }

  /* Steps from every cell to a goal when nobody is in the way, or `unreachable`. */
  std::vector<std::uint32_t> distances(Cell goal) const {
    return spread(goal, [this](Cell cell) { return origins(cell); });
  }

  /* Steps from a cell to every cell when nobody is in the way, or `unreachable`. */
  std::vector<std::uint32_t> reach(Cell start) const {
    return spread(start, [this](Cell cell) { return neighbours(cell); });
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
  bool allows(Cell cell, int move) const noexcept { return (raw_.moves[cell] >> move & 1) != 0; }

  /* The cell in the direction of a move, in the order of the bits of `moves`. */
  Cell beside(Cell cell, int move) const noexcept {
    constexpr int rows[] = {-1, 0, 1, 0, -1, 1, 1, -1}, cols[] = {0, 1, 0, -1, 1, 1, -1, -1};
    const std::int64_t to_row = std::int64_t{row(cell)} + rows[move];
    const std::int64_t to_col = std::int64_t{col(cell)} + cols[move];
    if (to_row < 0 || to_row >= raw_.rows || to_col < 0 || to_col >= raw_.cols)
      return none;
    return static_cast<Cell>(to_row * raw_.cols + to_col);
  }

  template <class Next> std::vector<std::uint32_t> spread(Cell first, Next next) const {
    std::vector<std::uint32_t> distance(size(), unreachable);
    std::vector<Cell> queue;
    if (is_free(first)) {
      distance[first] = 0;
      queue.push_back(first);
    }
    for (std::size_t head = 0; head < queue.size(); head++) {
      const Cell cell = queue[head];
      for (const Cell near : next(cell))
        if (distance[near] == unreachable) {
          distance[near] = distance[cell] + 1;
          queue.push_back(near);
        }
    }
    return distance;
  }

  FleetyardGrid raw_;
};

/* The body of a robot or a mover, about its origin. */
class Footprint {
public:
  explicit Footprint(const FleetyardFootprint *raw) : raw_(detail::checked(raw, "footprint")) {
    detail::checked(raw_.x_m, raw_.corners, "footprint.x_m");
    detail::checked(raw_.y_m, raw_.corners, "footprint.y_m");
  }

  /* Radius of the disc, or of the smallest circle about the origin that encloses the polygon. */
  double radius_m() const noexcept { return raw_.radius_m; }
  /* Number of corners of a convex polygon; 0 for a disc. */
  std::size_t corners() const noexcept { return raw_.corners; }
  Point corner(std::size_t at) const noexcept { return {raw_.x_m[at], raw_.y_m[at]}; }

private:
  FleetyardFootprint raw_;
};

/* A knot of a trajectory, between which position and heading are linear in time. */
struct Knot {
  double time_s, x_m, y_m;
  /* Counter-clockwise and unwrapped; NaN for a robot without one. */
  double heading_rad = std::numeric_limits<double>::quiet_NaN();
};

/* A control of a robot, and the time that it is held. */
struct Segment {
  double duration_s;
  std::vector<double> control;
};

/* An obstacle that moves in a known way. */
class Mover {
public:
  explicit Mover(const FleetyardMover *raw) : raw_(detail::checked(raw, "mover")) {
    for (const double *column : {raw_.time_s, raw_.x_m, raw_.y_m, raw_.heading_rad})
      detail::checked(column, raw_.knots, "mover.knots");
  }

  Footprint footprint() const { return Footprint(raw_.footprint); }
  std::size_t knots() const noexcept { return raw_.knots; }
  Knot knot(std::size_t at) const noexcept {
    return {raw_.time_s[at], raw_.x_m[at], raw_.y_m[at], raw_.heading_rad[at]};
  }

private:
  FleetyardMover raw_;
};

/* Free space: the bounds without the obstacles. */
class Workspace {
public:
  explicit Workspace(const FleetyardWorkspace *raw)
      : raw_(detail::checked(raw, "workspace")),
        x_m_(raw_.corner_offsets, raw_.x_m, raw_.obstacles, "workspace.x_m"),
        y_m_(raw_.corner_offsets, raw_.y_m, raw_.obstacles, "workspace.y_m") {
    detail::checked(raw_.movers, static_cast<std::size_t>(raw_.mover_count), "workspace.movers");
  }

  Point min_m() const noexcept { return {raw_.min_x_m, raw_.min_y_m}; }
  Point max_m() const noexcept { return {raw_.max_x_m, raw_.max_y_m}; }
  std::size_t obstacles() const noexcept { return raw_.obstacles; }
  /* The corners of a simple polygon, counter-clockwise. */
  std::vector<Point> obstacle(std::size_t at) const {
    std::vector<Point> corners;
    for (std::size_t corner = 0; corner < x_m_[at].size(); corner++)
      corners.push_back({x_m_[at][corner], y_m_[at][corner]});
    return corners;
  }
  std::size_t movers() const noexcept { return static_cast<std::size_t>(raw_.mover_count); }
  Mover mover(std::size_t at) const { return Mover(raw_.movers[at]); }

private:
  FleetyardWorkspace raw_;
  detail::Lists<double> x_m_, y_m_;
};

/* A directed edge of a roadmap. */
struct Edge {
  Vertex from, to;
  double length_m;
  double duration_s; /* at full speed */
};

/* A graph in the plane, whose edges are driven straight. */
class Roadmap {
public:
  explicit Roadmap(const FleetyardRoadmap *raw)
      : raw_(detail::checked(raw, "environment.view")),
        targets_(raw_.edge_offsets, raw_.targets, raw_.vertices, "roadmap.targets") {
    detail::zero(raw_.reserved, "roadmap");
    detail::flags(raw_.flags, FLEETYARD_ROADMAP_SYMMETRIC, "roadmap");
    detail::checked(raw_.x_m, raw_.vertices, "roadmap.x_m");
    detail::checked(raw_.y_m, raw_.vertices, "roadmap.y_m");
    detail::checked(raw_.length_m, edges(), "roadmap.length_m");
    detail::checked(raw_.duration_s, edges(), "roadmap.duration_s");
  }

  /* Number of vertices. */
  std::size_t size() const noexcept { return raw_.vertices; }
  /* Number of edges. */
  std::size_t edges() const noexcept { return static_cast<std::size_t>(raw_.edges); }
  Point position(Vertex vertex) const noexcept { return {raw_.x_m[vertex], raw_.y_m[vertex]}; }
  /* Number of the edges from a vertex. */
  std::size_t degree(Vertex vertex) const noexcept { return targets_[vertex].size(); }
  /* The edge with that number among those from a vertex. */
  Edge edge(Vertex from, std::size_t at) const noexcept {
    const std::size_t edge = static_cast<std::size_t>(raw_.edge_offsets[from]) + at;
    return {from, targets_[from][at], raw_.length_m[edge], raw_.duration_s[edge]};
  }
  double speed_m_per_s() const noexcept { return raw_.speed_m_per_s; }
  /* The least distance of two robots' centres at any time. */
  double separation_m() const noexcept { return raw_.separation_m; }
  /* True if each edge can be driven both ways. */
  bool symmetric() const noexcept { return (raw_.flags & FLEETYARD_ROADMAP_SYMMETRIC) != 0; }
  /* The world in which the roadmap lies, if the host tells. */
  std::optional<Workspace> workspace() const {
    return raw_.workspace ? std::optional<Workspace>(raw_.workspace) : std::nullopt;
  }

  /* Seconds from every vertex to a goal at full speed when nobody is in the way; infinite where
   * no way leads. */
  std::vector<double> times(Vertex goal) const {
    std::vector<std::vector<Edge>> into(size());
    for (Vertex from = 0; from < size(); from++)
      for (std::size_t at = 0; at < degree(from); at++)
        into[edge(from, at).to].push_back(edge(from, at));
    std::vector<double> time(size(), std::numeric_limits<double>::infinity());
    using Entry = std::pair<double, Vertex>;
    std::priority_queue<Entry, std::vector<Entry>, std::greater<Entry>> open;
    time[goal] = 0;
    for (open.push({0.0, goal}); !open.empty();) {
      const auto [now, vertex] = open.top();
      open.pop();
      for (const Edge &edge : now > time[vertex] ? std::vector<Edge>() : into[vertex])
        if (now + edge.duration_s < time[edge.from]) {
          time[edge.from] = now + edge.duration_s;
          open.push({time[edge.from], edge.from});
        }
    }
    return time;
  }

private:
  FleetyardRoadmap raw_;
  detail::Lists<Vertex> targets_;
};

/* The map: a grid, a roadmap or a workspace. */
class Environment {
public:
  explicit Environment(const FleetyardEnvironment *raw)
      : raw_(detail::checked(raw, "environment")) {
    detail::code(raw_.representation, FLEETYARD_REPRESENTATION_CONTINUOUS, "representation");
  }

  /* The map's name, for messages. */
  std::string_view name() const noexcept { return detail::view(raw_.name); }
  /* A key for caches: equal digests, equal maps. Empty when the host has none. */
  std::string_view digest() const noexcept { return detail::view(raw_.digest); }
  Representation representation() const noexcept {
    return static_cast<Representation>(raw_.representation);
  }
  Parts parts() const { return Parts(raw_.parts); }

  /* The view; each fails as unsupported when the map is another one. */
  Grid grid() const { return Grid(view<FleetyardGrid>(Representation::grid, "grids")); }
  Roadmap roadmap() const {
    return Roadmap(view<FleetyardRoadmap>(Representation::roadmap, "roadmaps"));
  }
  Workspace workspace() const {
    return Workspace(view<FleetyardWorkspace>(Representation::continuous, "the plane"));
  }
  /* Number of cells or vertices; 0 in the plane. */
  std::size_t places() const {
    switch (representation()) {
    case Representation::grid:
      return grid().size();
    case Representation::roadmap:
      return roadmap().size();
    default:
      return 0;
    }
  }

private:
  template <class T> const T *view(Representation wanted, const char *name) const {
    if (representation() != wanted)
      detail::unsupported(std::string("this plugin knows ") + name + " only");
    return static_cast<const T *>(raw_.view);
  }

  FleetyardEnvironment raw_;
};

/* A model of robots. */
class Robot {
public:
  explicit Robot(const FleetyardRobot *raw) : raw_(detail::checked(raw, "robot")) {
    detail::zero(raw_.reserved, "robot");
    detail::flags(raw_.flags,
                  FLEETYARD_ROBOT_HEADING | FLEETYARD_ROBOT_POLAR_STATE |
                      FLEETYARD_ROBOT_POLAR_CONTROL,
                  "robot");
    for (const double *limits : {raw_.state_min, raw_.state_max})
      detail::checked(limits, raw_.state_size, "robot.state_min, state_max");
    for (const double *limits : {raw_.control_min, raw_.control_max})
      detail::checked(limits, raw_.control_size, "robot.control_min, control_max");
    detail::checked(raw_.parameters, raw_.parameter_count, "robot.parameters");
  }

  std::string_view name() const noexcept { return detail::view(raw_.name); }
  /* Name of its dynamics; empty where any motion will do. */
  std::string_view dynamics() const noexcept { return detail::view(raw_.dynamics); }
  Footprint footprint() const { return Footprint(raw_.footprint); }
  /* True if a state has a heading after x and y. */
  bool has_heading() const noexcept { return (raw_.flags & FLEETYARD_ROBOT_HEADING) != 0; }
  /* True if the largest of the first two rates of a state bounds their length. */
  bool polar_state() const noexcept { return (raw_.flags & FLEETYARD_ROBOT_POLAR_STATE) != 0; }
  /* True if the largest of the first two numbers of a control bounds their length. */
  bool polar_control() const noexcept { return (raw_.flags & FLEETYARD_ROBOT_POLAR_CONTROL) != 0; }
  /* Limits of each number, infinite where there is none. */
  Span<double> state_min() const noexcept { return {raw_.state_min, raw_.state_size}; }
  Span<double> state_max() const noexcept { return {raw_.state_max, raw_.state_size}; }
  Span<double> control_min() const noexcept { return {raw_.control_min, raw_.control_size}; }
  Span<double> control_max() const noexcept { return {raw_.control_max, raw_.control_size}; }
  Span<double> parameters() const noexcept { return {raw_.parameters, raw_.parameter_count}; }

private:
  FleetyardRobot raw_;
};

/* An instance: the input of a planner. Agents have places on grids and roadmaps, and states in
 * the plane. */
class Instance : public WithMemory<Instance> {
public:
  explicit Instance(const FleetyardInstance *raw) : raw_(detail::checked(raw, "instance")) {
    detail::zero(raw_.reserved, "instance");
    detail::code(raw_.motion, FLEETYARD_MOTION_DYNAMICS, "motion");
    detail::code(raw_.objective, FLEETYARD_OBJECTIVE_MAKESPAN, "objective");
    detail::flags(raw_.flags, FLEETYARD_INSTANCE_CYCLES | FLEETYARD_INSTANCE_STRICT, "instance");
    detail::checked(raw_.robots, raw_.robot_count, "instance.robots");
    if (raw_.agents == 0)
      detail::invalid("the instance has no agents");
    const std::size_t places = environment().places();
    if (places > 0) {
      starts_ = detail::checked(raw_.starts, raw_.agents, "instance.starts");
      goals_ = {raw_.goal_offsets, raw_.goals, raw_.agents, "instance.goals"};
    } else {
      goal_offsets_ = detail::offsets(raw_.goal_offsets, raw_.agents, "instance.goals");
      start_states_ = {raw_.start_state_offsets, raw_.start_states, raw_.agents,
                       "instance.start_states"};
      goal_states_ = {raw_.goal_state_offsets, raw_.goal_states,
                      static_cast<std::size_t>(goal_offsets_.back()), "instance.goal_states"};
    }
    for (std::size_t agent = 0; agent < raw_.agents; agent++)
      check_agent(agent, places);
  }

  /* Number of agents; at least 1. */
  std::uint32_t agents() const noexcept { return raw_.agents; }
  /* The map of the last `prepare`. */
  Environment environment() const { return Environment(raw_.environment); }
  /* The same as a grid, a roadmap or a workspace; fails as unsupported when it is none. */
  Grid grid() const { return environment().grid(); }
  Roadmap roadmap() const { return environment().roadmap(); }
  Workspace workspace() const { return environment().workspace(); }
  /* Start place of every agent; empty in the plane. */
  Span<Place> starts() const noexcept { return starts_; }
  /* Goals of an agent, to be visited in order; an agent without one may end anywhere. */
  Span<Place> goals(std::size_t agent) const noexcept {
    return goals_.size() == 0 ? Span<Place>() : goals_[agent];
  }
  /* The last goal of an agent: where its path should end. `none` without one. */
  Place goal(std::size_t agent) const noexcept {
    const Span<Place> all = goals(agent);
    return all.empty() ? none : all.back();
  }
  /* In the plane: the state of an agent at its start, as its robot says. */
  Span<double> start_state(std::size_t agent) const noexcept { return start_states_[agent]; }
  /* Number of goals of an agent. */
  std::size_t goal_count(std::size_t agent) const noexcept {
    return goal_offsets_.empty()
               ? goals(agent).size()
               : static_cast<std::size_t>(goal_offsets_[agent + 1] - goal_offsets_[agent]);
  }
  /* In the plane: the state to come to at a goal, NaN where any will do. */
  Span<double> goal_state(std::size_t agent, std::size_t at) const noexcept {
    return goal_states_[static_cast<std::size_t>(goal_offsets_[agent]) + at];
  }
  /* Number of robot models; may be 0 on grids and roadmaps. */
  std::size_t robots() const noexcept { return raw_.robot_count; }
  Robot model(std::size_t at) const { return Robot(raw_.robots[at]); }
  /* The model of an agent; fails as invalid when there is none. */
  Robot robot(std::size_t agent) const {
    const std::size_t model = raw_.robot_of ? raw_.robot_of[agent] : 0;
    if (model >= raw_.robot_count)
      detail::invalid("agent " + std::to_string(agent) + " has no robot");
    return Robot(raw_.robots[model]);
  }
  /* True if headings matter. */
  bool has_headings() const noexcept { return raw_.start_headings != nullptr; }
  /* The heading of an agent at its start, if headings matter. */
  Heading heading(std::size_t agent) const noexcept {
    return static_cast<Heading>(raw_.start_headings[agent]);
  }
  Motion motion() const noexcept { return static_cast<Motion>(raw_.motion); }
  Objective objective() const noexcept { return static_cast<Objective>(raw_.objective); }
  /* On grids: collisions after so many steps do not matter, and paths may end before their
   * goals; 0 for a complete plan. */
  std::uint32_t window_steps() const noexcept { return raw_.window_steps; }
  /* The same in the other representations. */
  double window_s() const noexcept { return raw_.window_s; }
  /* Radius of the largest robot's enclosing circle. */
  double radius_m() const noexcept { return raw_.radius_m; }
  /* In the plane: distance from its goal at which a robot may end, and of its heading. */
  double goal_tolerance_m() const noexcept { return raw_.goal_tolerance_m; }
  double goal_tolerance_rad() const noexcept { return raw_.goal_tolerance_rad; }
  double goal_tolerance_rate() const noexcept { return raw_.goal_tolerance_rate; }
  double dynamics_tolerance() const noexcept { return raw_.dynamics_tolerance; }
  /* True if three or more agents may move round in a ring in one step, each into the cell
   * that the next one leaves. Plans for a fleet must not. */
  bool allows_cycles() const noexcept { return (raw_.flags & FLEETYARD_INSTANCE_CYCLES) != 0; }
  /* True if no agent may follow another one round a corner. */
  bool strict() const noexcept { return (raw_.flags & FLEETYARD_INSTANCE_STRICT) != 0; }
  Parts parts() const { return Parts(raw_.parts); }

private:
  void check_agent(std::size_t agent, std::size_t places) const {
    const std::string who = "agent " + std::to_string(agent);
    if (raw_.robot_of && raw_.robot_of[agent] >= raw_.robot_count)
      detail::invalid(who + " is no robot of the team");
    if (places > 0 && starts_[agent] >= places)
      detail::invalid(who + " starts off the map");
    for (const Place goal : goals(agent))
      if (goal >= places)
        detail::invalid(who + " has a goal off the map");
    if (places == 0 && start_state(agent).size() < 2)
      detail::invalid(who + " has no position");
    for (std::size_t at = 0; places == 0 && at < goal_count(agent); at++)
      if (goal_state(agent, at).size() < 2)
        detail::invalid(who + " has a goal without a position");
  }

  FleetyardInstance raw_;
  Span<Place> starts_;
  detail::Lists<Place> goals_;
  Span<std::uint64_t> goal_offsets_; /* in the plane */
  detail::Lists<double> start_states_, goal_states_;
};

/* A vertex that an agent visits. It drives straight and evenly from one to the next. */
struct Visit {
  Vertex vertex;
  double arrival_s, departure_s;
};

/* Paths that somebody else planned. They may collide, and jump, and leave the map. */
class PlanView {
public:
  explicit PlanView(const FleetyardPlan *raw) : raw_(detail::checked(raw, "failed_plan")) {
    detail::zero(raw_.reserved, "failed_plan");
    detail::code(raw_.form, FLEETYARD_FORM_TRAJECTORIES, "form");
    offsets_ = detail::offsets(raw_.offsets, raw_.agents, "failed_plan");
    const auto total = static_cast<std::size_t>(offsets_.back());
    if (form() == Form::cells) {
      const FleetyardCells &body = body_of<FleetyardCells>();
      detail::checked(body.cells, total, "failed_plan.cells");
    } else if (form() == Form::visits) {
      const FleetyardVisits &body = body_of<FleetyardVisits>();
      detail::checked(body.vertices, total, "failed_plan.vertices");
      for (const double *times : {body.arrival_s, body.departure_s})
        detail::checked(times, total, "failed_plan.arrival_s, departure_s");
    } else {
      const FleetyardTrajectories &body = body_of<FleetyardTrajectories>();
      for (const double *column : {body.time_s, body.x_m, body.y_m})
        detail::checked(column, total, "failed_plan.time_s, x_m, y_m");
      if (body.segment_offsets) {
        segments_ = detail::offsets(body.segment_offsets, raw_.agents, "failed_plan.segments");
        controls_ = detail::offsets(body.control_offsets, raw_.agents, "failed_plan.controls");
        detail::checked(body.duration_s, static_cast<std::size_t>(segments_.back()),
                        "failed_plan.duration_s");
        detail::checked(body.controls, static_cast<std::size_t>(controls_.back()),
                        "failed_plan.controls");
      }
    }
  }

  std::uint32_t agents() const noexcept { return raw_.agents; }
  Form form() const noexcept { return static_cast<Form>(raw_.form); }
  /* Number of entries of an agent: cells, visits or knots. */
  std::size_t length(std::size_t agent) const noexcept {
    return length_of(offsets_, agent);
  }
  /* On a grid: the cells of an agent at times 0, 1, 2, …; it may have none. */
  Span<Cell> path(std::size_t agent) const {
    if (form() != Form::cells)
      detail::unsupported("this plugin knows plans of cells only");
    const Cell *cells = static_cast<const FleetyardCells *>(raw_.body)->cells;
    return {cells + offsets_[agent], length(agent)};
  }
  /* On a roadmap: a visit of an agent. */
  Visit visit(std::size_t agent, std::size_t at) const noexcept {
    const auto &body = *static_cast<const FleetyardVisits *>(raw_.body);
    const std::size_t entry = static_cast<std::size_t>(offsets_[agent]) + at;
    return {body.vertices[entry], body.arrival_s[entry], body.departure_s[entry]};
  }
  /* In the plane: a knot of an agent. */
  Knot knot(std::size_t agent, std::size_t at) const noexcept {
    const auto &body = *static_cast<const FleetyardTrajectories *>(raw_.body);
    const std::size_t entry = static_cast<std::size_t>(offsets_[agent]) + at;
    Knot knot{body.time_s[entry], body.x_m[entry], body.y_m[entry]};
    if (body.heading_rad)
      knot.heading_rad = body.heading_rad[entry];
    return knot;
  }
  /* In the plane: number of segments of an agent. */
  std::size_t segments(std::size_t agent) const noexcept {
    return segments_.size() == 0 ? 0 : length_of(segments_, agent);
  }
  /* In the plane: a control of an agent, and the time that it is held. */
  Segment segment(std::size_t agent, std::size_t at) const {
    const auto &body = *static_cast<const FleetyardTrajectories *>(raw_.body);
    const std::size_t size = length_of(controls_, agent) / segments(agent);
    const double *control = body.controls + controls_[agent] + at * size;
    return {body.duration_s[segments_[agent] + at], {control, control + size}};
  }
  Parts parts() const { return Parts(raw_.parts); }

private:
  static std::size_t length_of(const Span<std::uint64_t> &offsets, std::size_t agent) noexcept {
    return static_cast<std::size_t>(offsets[agent + 1] - offsets[agent]);
  }
  template <class T> const T &body_of() const {
    const T &body = detail::checked(static_cast<const T *>(raw_.body), "failed_plan.body");
    detail::zero(body.reserved, "failed_plan.body");
    return body;
  }

  FleetyardPlan raw_;
  Span<std::uint64_t> offsets_, segments_, controls_;
};

/* A task that nobody has been given. */
struct Task {
  std::uint64_t id;
  Span<Place> places; /* to be visited in order */
  double released_s;  /* simulated time */
};

/* The state of the fleet when everything committed has been executed, and the work that
 * is left. */
class FleetState : public WithMemory<FleetState> {
public:
  explicit FleetState(const FleetyardFleetState *raw)
      : raw_(detail::checked(raw, "state")), next_(raw_.next),
        tasks_(raw_.task_offsets, raw_.task_places, raw_.tasks, "state.tasks") {
    detail::checked(raw_.task_ids, raw_.tasks, "state.task_ids");
    detail::checked(raw_.task_released_s, raw_.tasks, "state.task_released_s");
  }

  /* The next instance as it is if nobody is given more: starts, the goals that agents have
   * already, the current one first, and the window asked for. Where goals never end, they are as
   * many as it takes to keep an agent busy for longer than the window, and at least two. */
  const Instance &next() const noexcept { return next_; }
  std::uint32_t agents() const noexcept { return next_.agents(); }
  Environment environment() const { return next_.environment(); }
  Grid grid() const { return next_.grid(); }
  /* Simulated time since the run began. */
  double time_s() const noexcept { return raw_.time_s; }
  /* Number of open tasks. */
  std::uint32_t tasks() const noexcept { return raw_.tasks; }
  Task task(std::size_t at) const noexcept { return {raw_.task_ids[at], tasks_[at], raw_.task_released_s[at]}; }
  Parts parts() const { return Parts(raw_.parts); }

private:
  FleetyardFleetState raw_;
  Instance next_;
  detail::Lists<Place> tasks_;
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
  Parts parts() const { return Parts(raw_.parts); }

private:
  FleetyardFleetStatus raw_;
  Span<std::uint32_t> actions_left_;
};

/* ---- What a plugin says ------------------------------------------------------ */

/* Paths of agents, one after the other. After its last entry an agent stays where it is. */
template <class Entry> class Paths {
public:
  Paths() : offsets_{0} {}
  Paths(const std::vector<std::vector<Entry>> &paths) : Paths() {
    for (const auto &path : paths)
      add(path);
  }

  /* Adds the path of the next agent. */
  void add(Span<Entry> path) {
    entries_.insert(entries_.end(), path.begin(), path.end());
    offsets_.push_back(entries_.size());
  }

  std::size_t agents() const noexcept { return offsets_.size() - 1; }
  const std::vector<std::uint64_t> &offsets() const noexcept { return offsets_; }
  const std::vector<Entry> &entries() const noexcept { return entries_; }

private:
  std::vector<std::uint64_t> offsets_;
  std::vector<Entry> entries_;
};

/* On a grid: the cells of each agent at times 0, 1, 2, … steps. */
using Plan = Paths<Cell>;
/* On a roadmap: the vertices that each agent visits, from time 0 on. */
using RoadmapPlan = Paths<Visit>;
/* In the plane: the knots of each agent, from time 0 on. */
using ContinuousPlan = Paths<Knot>;

/* In the plane: the knots of each agent, its controls, or both. An agent with neither stays at its
 * start. */
class MotionPlan {
public:
  MotionPlan() : segments_{0}, numbers_{0} {}

  /* Adds the motion of the next agent. All its controls have as many numbers. */
  void add(const std::vector<Segment> &segments, Span<Knot> knots = {}) {
    for (const Segment &segment : segments)
      if (segment.control.size() != segments[0].control.size())
        throw std::invalid_argument("controls of one agent that differ in length");
    for (const Segment &segment : segments) {
      durations_.push_back(segment.duration_s);
      controls_.insert(controls_.end(), segment.control.begin(), segment.control.end());
    }
    segments_.push_back(durations_.size());
    numbers_.push_back(controls_.size());
    knots_.add(knots);
  }

  const ContinuousPlan &knots() const noexcept { return knots_; }

private:
  friend class Sink;
  ContinuousPlan knots_;
  std::vector<std::uint64_t> segments_, numbers_;
  std::vector<double> durations_, controls_;
};

/* A task that an instance generator gives to an agent. */
struct Assignment {
  std::uint32_t agent;
  std::uint64_t task; /* identifier of one of the open tasks */
};

/* What a generator decides: the rest of the next instance is as the state has it. */
struct Request {
  std::vector<std::vector<Place>> goals; /* per agent */
  std::vector<Assignment> assignments;
  std::uint32_t window_steps = 0; /* no longer than the one asked for */
  double window_s = 0.0;

  Request() = default;
  /* The goals that agents have already, and the window asked for. */
  explicit Request(const FleetState &state)
      : window_steps(state.next().window_steps()), window_s(state.next().window_s()) {
    for (std::size_t agent = 0; agent < state.agents(); agent++) {
      const Span<Place> has = state.next().goals(agent);
      goals.emplace_back(has.begin(), has.end());
    }
  }

  /* Gives a task to an agent: its places become the agent's last goals. */
  void assign(const Task &task, std::size_t agent) {
    goals[agent].insert(goals[agent].end(), task.places.begin(), task.places.end());
    assignments.push_back({static_cast<std::uint32_t>(agent), task.id});
  }
};

/* Something that a planner wants to show: shapes of a layer. It is shown and never judged. */
struct Annotation {
  std::string layer;
  std::string text;
  /* Whom it is about. */
  std::uint32_t agent = none;
  /* When it holds, in seconds of the plan. */
  double from_s = 0, to_s = std::numeric_limits<double>::infinity();
  /* A number for each shape, for colours; may be empty. */
  std::vector<double> values;
};

/* Takes what a planner wants to show, from any thread. */
class Annotations {
public:
  Annotations(const FleetyardAnnotations &raw, void *context) : raw_(&raw), context_(context) {}

  /* Points in the plane, each a shape. `busy` says that the host keeps no more of them. */
  Result points(const Annotation &about, const std::vector<Point> &points) const {
    std::vector<std::vector<Point>> shapes;
    for (const Point &point : points)
      shapes.push_back({point});
    return plane(about, FLEETYARD_SHAPE_POINTS, shapes);
  }
  /* Lines from point to point. */
  Result lines(const Annotation &about, const std::vector<std::vector<Point>> &shapes) const {
    return plane(about, FLEETYARD_SHAPE_LINES, shapes);
  }
  /* Lines from point to point, and back to the first. */
  Result rings(const Annotation &about, const std::vector<std::vector<Point>> &shapes) const {
    return plane(about, FLEETYARD_SHAPE_RINGS, shapes);
  }
  /* Cells or vertices: of each shape one place, or a way from place to place. */
  Result places(const Annotation &about, const std::vector<std::vector<Place>> &shapes) const {
    const Plan flat(shapes); // the same form: lists of places
    FleetyardAnnotation raw = begun(about, FLEETYARD_SHAPE_PLACES, shapes.size());
    raw.offsets = flat.offsets().data();
    raw.places = flat.entries().data();
    return submit(raw);
  }

private:
  static FleetyardAnnotation begun(const Annotation &about, std::int32_t shape,
                                   std::size_t count) {
    if (!about.values.empty() && about.values.size() != count)
      detail::invalid("an annotation has " + std::to_string(about.values.size()) +
                      " values for " + std::to_string(count) + " shapes");
    FleetyardAnnotation raw{};
    raw.struct_size = sizeof raw;
    raw.shape = shape;
    raw.layer = detail::str(about.layer);
    raw.text = detail::str(about.text);
    raw.agent = about.agent;
    raw.count = static_cast<std::uint32_t>(count);
    raw.from_s = about.from_s;
    raw.to_s = about.to_s;
    raw.values = about.values.empty() ? nullptr : about.values.data();
    return raw;
  }
  Result plane(const Annotation &about, std::int32_t shape,
               const std::vector<std::vector<Point>> &shapes) const {
    std::vector<std::uint64_t> offsets{0};
    std::vector<double> xs, ys;
    for (const std::vector<Point> &points : shapes) {
      for (const Point &point : points) {
        xs.push_back(point.x_m);
        ys.push_back(point.y_m);
      }
      offsets.push_back(xs.size());
    }
    FleetyardAnnotation raw = begun(about, shape, shapes.size());
    raw.offsets = offsets.data();
    raw.x_m = xs.data();
    raw.y_m = ys.data();
    return submit(raw);
  }
  Result submit(const FleetyardAnnotation &raw) const {
    return static_cast<Result>(raw_->annotate(context_, &raw));
  }

  const FleetyardAnnotations *raw_;
  void *context_;
};

/* The host's ear during a call, for any thread. */
class Sink {
public:
  explicit Sink(const FleetyardSink *raw) : raw_(&detail::checked(raw, "sink")) {}
  Sink(const Sink &sink, const Budget &budget)
      : raw_(sink.raw_), answer_by_(budget.answer_by()) {}

  /* Hands over a plan; may be called again with a better one. */
  Result submit_plan(const Plan &plan) const noexcept {
    const FleetyardCells body{sizeof body, 0, plan.entries().data()};
    return submit(Form::cells, plan.offsets(), &body);
  }
  Result submit_plan(const RoadmapPlan &plan) const {
    std::vector<Vertex> vertices;
    std::vector<double> arrivals, departures;
    for (const Visit &visit : plan.entries()) {
      vertices.push_back(visit.vertex);
      arrivals.push_back(visit.arrival_s);
      departures.push_back(visit.departure_s);
    }
    const FleetyardVisits body{sizeof body, 0, vertices.data(), arrivals.data(),
                               departures.data()};
    return submit(Form::visits, plan.offsets(), &body);
  }
  Result submit_plan(const ContinuousPlan &plan) const { return submit(plan, {}); }
  Result submit_plan(const MotionPlan &plan) const {
    FleetyardTrajectories body{};
    body.segment_offsets = plan.segments_.data();
    body.duration_s = plan.durations_.data();
    body.control_offsets = plan.numbers_.data();
    body.controls = plan.controls_.data();
    return submit(plan.knots_, body);
  }

  /* Hands over what a generator decided, in `generate`. */
  Result submit_request(const Request &request) const {
    const Plan goals(request.goals); // the same form: lists of places
    std::vector<FleetyardAssignment> assignments;
    for (const Assignment &given : request.assignments)
      assignments.push_back({given.task, given.agent, 0});
    FleetyardRequest raw{};
    raw.struct_size = sizeof raw;
    raw.agents = static_cast<std::uint32_t>(goals.agents());
    raw.goal_offsets = goals.offsets().data();
    raw.goals = goals.entries().data();
    raw.assignments = assignments.data();
    raw.assignment_count = assignments.size();
    raw.window_steps = request.window_steps;
    raw.window_s = request.window_s;
    return static_cast<Result>(raw_->submit_request(raw_->context, &raw));
  }

  /* Lets the host keep bytes in place of those before, at most FLEETYARD_KEPT_LIMIT: the next call
   * has them as Instance::kept or FleetState::kept, if the plugin lists them in its features. The
   * last ones of a call count, and only if it ends well and in time. */
  Result keep(Span<std::uint8_t> bytes) const noexcept {
    const auto *host = static_cast<const FleetyardKeep *>(extension(FLEETYARD_KEEP_ID));
    if (!host || host->struct_size < sizeof *host)
      return Result::busy;
    const FleetyardBytes raw{sizeof raw, 0, bytes.data(), bytes.size()};
    return static_cast<Result>(host->keep(raw_->context, &raw));
  }
  /* Reports a figure such as `expansions`, kept as a claim. */
  void metric(std::string_view name, double value) const noexcept {
    raw_->metric(raw_->context, detail::str(name), value);
  }
  /* Notes a fact about the plugin's inputs, such as the digest of its weights; kept as a claim. */
  void note(std::string_view name, std::string_view text) const noexcept {
    raw_->note(raw_->context, detail::str(name), detail::str(text));
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
  /* The host's monotonic clock. */
  std::chrono::nanoseconds now() const noexcept {
    return std::chrono::nanoseconds(static_cast<std::int64_t>(raw_->now_ns(raw_->context)));
  }
  /* Time until the call should end; negative afterwards. */
  std::chrono::nanoseconds remaining() const noexcept { return answer_by_ - now(); }
  /* True if the call should end: Budget::answer_by has passed, or the host gave up on it. Cheap;
   * ask often. */
  bool cancelled() const noexcept { return raw_->cancelled(raw_->context) != 0; }
  /* Ends the call when it should end. */
  void check() const {
    if (!cancelled())
      return;
    if (remaining().count() <= 0)
      throw Failure(Status::timed_out, "the call's time is up");
    throw Failure(Status::cancelled, "the host gave up on the call");
  }
  /* An extension structure of this call by its identifier, or null when the host has no use for
   * it; its functions take `context`. */
  const void *extension(std::string_view id) const noexcept {
    return raw_->get_extension(raw_->context, detail::str(id));
  }
  void *context() const noexcept { return raw_->context; }
  /* Takes what a planner wants to show; empty unless somebody wants to see it. The plan must not
   * depend on it. */
  std::optional<Annotations> annotations() const {
    const auto *raw =
        static_cast<const FleetyardAnnotations *>(extension(FLEETYARD_ANNOTATIONS_ID));
    if (!raw)
      return std::nullopt;
    return Annotations(detail::checked(raw, "annotations"), raw_->context);
  }

private:
  /* Knots, beside the controls that are in the body already. */
  Result submit(const ContinuousPlan &plan, FleetyardTrajectories body) const {
    std::vector<double> times, xs, ys, headings;
    bool turned = false;
    for (const Knot &knot : plan.entries()) {
      times.push_back(knot.time_s);
      xs.push_back(knot.x_m);
      ys.push_back(knot.y_m);
      headings.push_back(knot.heading_rad);
      turned = turned || !std::isnan(knot.heading_rad);
    }
    body.struct_size = sizeof body;
    body.time_s = times.data();
    body.x_m = xs.data();
    body.y_m = ys.data();
    body.heading_rad = turned ? headings.data() : nullptr;
    return submit(Form::trajectories, plan.offsets(), &body);
  }
  Result submit(Form form, const std::vector<std::uint64_t> &offsets,
                const void *body) const noexcept {
    FleetyardPlan plan{};
    plan.struct_size = sizeof plan;
    plan.agents = static_cast<std::uint32_t>(offsets.size() - 1);
    plan.form = static_cast<std::int32_t>(form);
    plan.offsets = offsets.data();
    plan.body = body;
    return static_cast<Result>(raw_->submit_plan(raw_->context, &plan));
  }

  const FleetyardSink *raw_;
  std::chrono::nanoseconds answer_by_ = std::chrono::nanoseconds::zero();
};

/* ---- Options ----------------------------------------------------------------- */

/* The options of a plugin. The host has checked them against the plugin's schema, and filled in
 * the defaults of the schema.
 *
 * Every getter fails as invalid input when the value is of another type, and when there
 * is neither a value nor a default (has() tells). */
class Options {
public:
  explicit Options(const FleetyardOptions *raw)
      : raw_(detail::checked(raw, "options")),
        list_(detail::checked(raw_.list, raw_.count, "options.list")) {}

  /* All of them as JSON, for plugins that have a library to read it. */
  std::string_view json() const noexcept { return detail::view(raw_.json); }
  /* True if an option has a value or a default. */
  bool has(std::string_view name) const noexcept { return find(name) != nullptr; }

  /* A whole number; 3.0 is one. */
  std::int64_t integer(std::string_view name) const {
    const double value = number(name);
    constexpr double exact = 9007199254740992.0; // 2^53
    if (!(std::abs(value) <= exact) || std::trunc(value) < value || std::trunc(value) > value)
      wrong(name, "a whole number");
    return static_cast<std::int64_t>(value);
  }
  double number(std::string_view name) const {
    return value(name, FLEETYARD_OPTION_NUMBER, "a number").number;
  }
  bool flag(std::string_view name) const {
    return value(name, FLEETYARD_OPTION_FLAG, "true or false").number > 0;
  }
  std::string text(std::string_view name) const {
    return std::string(detail::view(value(name, FLEETYARD_OPTION_TEXT, "a string").text));
  }
  /* The JSON text of an object, a list or null. */
  std::string_view json(std::string_view name) const {
    return detail::view(value(name, FLEETYARD_OPTION_JSON, "an object, a list or null").text);
  }

private:
  const FleetyardPluginOption *find(std::string_view name) const noexcept {
    for (const FleetyardPluginOption &option : list_)
      if (detail::view(option.name) == name)
        return &option;
    return nullptr;
  }

  const FleetyardPluginOption &value(std::string_view name, std::int32_t kind,
                                     const char *wanted) const {
    const FleetyardPluginOption *option = find(name);
    if (!option)
      detail::invalid("options: `" + std::string(name) + "` is missing");
    if (option->kind != kind)
      wrong(name, wanted);
    return *option;
  }

  [[noreturn]] static void wrong(std::string_view name, const char *wanted) {
    detail::invalid("options: `" + std::string(name) + "` is not " + wanted);
  }

  FleetyardOptions raw_;
  Span<FleetyardPluginOption> list_;
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
  /* Names of what has no bit: `dynamics:NAME` for each model of robots that it plans for,
   * `part:ID` for each part that it reads, `agents:1` if it plans for one agent alone. */
  static constexpr std::array<std::string_view, 0> features{};

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
  /* Submits one request. */
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
    if (raw && raw->struct_size >= sizeof *raw)
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

/* What a plugin claims to know; the rest is refused before it hears of it. */
class Claims {
public:
  explicit Claims(const FleetyardDescriptor &about) : about_(about) {}

  void check(const Parts &parts) const {
    for (std::size_t at = 0; at < parts.size(); at++)
      if (parts[at].critical() && !names("part:", parts[at].id()))
        unsupported("this plugin does not know the critical part `" +
                    std::string(parts[at].id()) + "`");
  }

  void check(const Environment &environment) const {
    const auto code = static_cast<unsigned>(environment.representation());
    const std::array<const char *, 3> names{"grid", "roadmap", "continuous"};
    if (!claims(std::uint64_t{1} << (code - 1)))
      unsupported("this plugin does not know representation " +
                  (code <= names.size() ? "`" + std::string(names[code - 1]) + "`"
                                        : std::to_string(code)));
    if (environment.representation() == Representation::grid &&
        environment.grid().connectivity() != 4 &&
        !(environment.grid().connectivity() == 8 && claims(capability::eight_connected)))
      unsupported("this plugin does not know grids with " +
                  std::to_string(environment.grid().connectivity()) + " neighbours");
    check(environment.parts());
  }

  void check(const Instance &instance) const {
    check(instance.environment());
    const auto motion = static_cast<unsigned>(instance.motion());
    if (!claims(capability::pebble << (motion - 1))) // in the order of the codes
      unsupported("this plugin does not know motion " + std::to_string(motion));
    if (instance.robots() > 1 && !claims(capability::heterogeneous))
      unsupported("this plugin does not know teams of different robots");
    for (std::size_t at = 0; at < instance.robots(); at++) {
      const Robot robot = instance.model(at);
      if (instance.motion() == Motion::dynamics && !robot.dynamics().empty() &&
          !names("dynamics:", robot.dynamics()))
        unsupported("this plugin does not know the dynamics `" + std::string(robot.dynamics()) +
                    "`");
    }
    check(instance.parts());
  }

  /* A planner is asked for a goal for each agent, unless it claims more. */
  void check_goals(const Instance &instance) const {
    if (!claims(capability::windowed) && (instance.window_steps() > 0 || instance.window_s() > 0))
      unsupported("this plugin knows no windows");
    for (std::size_t agent = 0; agent < instance.agents(); agent++) {
      const std::size_t goals = instance.goal_count(agent);
      if ((goals == 0 && !claims(capability::idle)) ||
          (goals > 1 && !claims(capability::windowed)))
        unsupported("agent " + std::to_string(agent) + " has " + std::to_string(goals) +
                    " goals, and this plugin knows one for each");
    }
  }

private:
  bool claims(std::uint64_t bit) const noexcept { return (about_.capabilities & bit) != 0; }
  bool names(std::string_view sort, std::string_view id) const {
    const std::string wanted = std::string(sort) + std::string(id);
    for (std::uint32_t at = 0; at < about_.feature_count; at++)
      if (view(about_.features[at]) == wanted)
        return true;
    return false;
  }

  FleetyardDescriptor about_;
};

/* A plugin that has been made. */
template <class Base> struct Made {
  std::unique_ptr<Base> plugin;
  Claims claims;
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
      const Environment map(environment);
      made.claims.check(map);
      made.plugin->prepare(map, limits, Sink(to, limits));
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
      const Made<Planner> &made = Made<Planner>::of(context);
      Planner &planner = made.ready();
      const Budget limits(budget);
      const Instance asked(instance);
      made.claims.check(asked);
      made.claims.check_goals(asked);
      planner.plan(asked, limits, Sink(to, limits));
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
      const Made<FailPolicy> &made = Made<FailPolicy>::of(context);
      FailPolicy &policy = made.ready();
      const Instance asked(instance);
      made.claims.check(asked);
      std::optional<PlanView> failed;
      if (failed_plan) {
        failed.emplace(failed_plan);
        made.claims.check(failed->parts());
      }
      if (failed && failed->agents() != asked.agents())
        invalid("failed_plan has paths for another number of agents than the instance");
      const Budget limits(budget);
      policy.recover(asked, failed, limits, Sink(to, limits));
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
      const Made<InstanceGenerator> &made = Made<InstanceGenerator>::of(context);
      InstanceGenerator &generator = made.ready();
      const Budget limits(budget);
      const FleetState fleet(state);
      made.claims.check(fleet.parts());
      made.claims.check(fleet.next());
      generator.generate(fleet, limits, Sink(to, limits));
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
                                    const FleetyardSink *sink, std::int32_t *out) noexcept {
    return guarded(sink, [&](const Sink &to) {
      const Made<InvocationPolicy> &made = Made<InvocationPolicy>::of(context);
      const FleetStatus fleet(status);
      made.claims.check(fleet.parts());
      *out = made.plugin->should_invoke(fleet, to) ? 1 : 0;
    });
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

/* Names of features in the form of the contract. */
template <class T> const std::vector<FleetyardStr> &features_of() {
  static const std::vector<FleetyardStr> list = [] {
    std::vector<FleetyardStr> all;
    for (const std::string_view feature : T::features)
      all.push_back(str(feature));
    return all;
  }();
  return list;
}

/* Descriptor and constructor of one plugin type. */
template <class Base> struct Entry {
  FleetyardDescriptor descriptor;
  std::unique_ptr<Base> (*make)(const Options &);

  template <class T> static Entry of() {
    static_assert(is_identifier(T::id),
                  "a plugin needs `static constexpr auto id` of the form [a-z0-9][a-z0-9._-]*");
    const std::string_view name = T::name, id = T::id;
    const std::vector<FleetyardStr> &features = features_of<T>();
    return {{sizeof(FleetyardDescriptor), static_cast<std::uint32_t>(features.size()), str(id),
             str(name.empty() ? id : name), str(T::version), str(T::description), str(T::license),
             str(T::options_schema), T::capabilities, features.data()},
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

  static std::uint32_t count(void *) noexcept { return size; }

  static const FleetyardDescriptor *descriptor(void *, std::uint32_t index) noexcept {
    try {
      return index < size ? &entries()[index].descriptor : nullptr;
    } catch (...) { // out of memory
      return nullptr;
    }
  }

  static std::int32_t create(void *, std::uint32_t index, const FleetyardOptions *options,
                             const FleetyardSink *sink, Object *out) noexcept {
    return guarded(sink, [&](const Sink &) {
      if (index >= size || !out)
        invalid("there is no plugin with that number, or no place for it");
      if (out->struct_size < sizeof(Object))
        unsupported("the host is older than this plugin: it has no room for it");
      const Entry<Base> &entry = entries()[index];
      std::unique_ptr<Made<Base>> made(
          new Made<Base>{entry.make(Options(options)), Claims(entry.descriptor)});
      *out = Object{};
      out->struct_size = sizeof *out;
      out->destroy = Made<Base>::destroy;
      Kind<Base>::fill(*out);
      out->context = made.release();
    });
  }

  static constexpr typename Kind<Base>::Factory table = {
      sizeof(typename Kind<Base>::Factory), 0, nullptr, count, descriptor, create};
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
