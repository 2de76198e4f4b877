/* A planner of the League of Robot Runners as a Fleetyard plugin.
 *
 * What it is: the glue between this contract and the class `MAPFPlanner` of a Start-Kit,
 * https://github.com/MAPF-Competition/Start-Kit, with which it is compiled (see the
 * Makefile). The planner is asked for actions, as the competition asks it, and its turns and
 * moves are followed cell by cell: without a window until all agents are at their goals at
 * once, with one for the steps of the window. An agent waits in its cell while it turns, so
 * that plans hold for robots that turn, too.
 *
 * What it is not: the competition. Whoever calls assigns tasks, so neither `Entry` nor a task
 * scheduler is asked, no action is delayed, and one action is one step.
 *
 * The planner runs in a process of its own. These programs keep their data in global
 * variables, and may exit or crash without taking the plugin with them. Without a window each
 * call has a process, in which they begin anew. Calls with windows have one together: a
 * planner of the competition remembers what it planned before. An answer that comes too late
 * is that of the next call, if robots stood still meanwhile, as in the competition. Its
 * standard output goes to the log.
 *
 * It fits Start-Kits of the versions 3 and 2.
 */

#include "fleetyard.hpp"

#include "MAPFPlanner.h"

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <optional>
#include <set>
#include <string>

#include <poll.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

namespace {

using fleetyard::Cell;
using fleetyard::Failure;
using Clock = std::chrono::steady_clock;
using Ms = std::chrono::milliseconds;

/* Milliseconds, as the Start-Kit counts them. */
int whole_ms(Clock::duration time) {
  const auto count = std::chrono::duration_cast<Ms>(time).count();
  return static_cast<int>(std::clamp<decltype(count)>(count, 0, 1'000'000'000));
}

/* Exit codes of the planner's process. */
enum Exit : int { reached_end = 0, too_many_steps = 3, bad_actions = 4 };

/* Where an agent is, looks and is to go. */
struct Robot {
  Cell cell;
  std::int32_t heading;
  Cell goal;

  bool stands_as(const Robot &other) const {
    return cell == other.cell && heading == other.heading;
  }
};

/* What the planner's process is asked where there is a window, before the agents: what is left
 * of the call, and how many steps to plan. */
struct Request {
  std::int32_t limit_ms;
  std::int32_t steps;
};

/* Writes or reads all of it; false if the other end is gone. */
bool write_all(int pipe, const void *from, std::size_t bytes) {
  for (auto data = static_cast<const char *>(from); bytes > 0;) {
    const ssize_t written = write(pipe, data, bytes);
    if (written < 0 && errno == EINTR)
      continue;
    if (written <= 0)
      return false;
    data += written;
    bytes -= static_cast<std::size_t>(written);
  }
  return true;
}

bool read_all(int pipe, void *to, std::size_t bytes) {
  for (auto data = static_cast<char *>(to); bytes > 0;) {
    const ssize_t got = read(pipe, data, bytes);
    if (got < 0 && errno == EINTR)
      continue;
    if (got <= 0)
      return false;
    data += got;
    bytes -= static_cast<std::size_t>(got);
  }
  return true;
}

std::vector<Robot> robots_of(const fleetyard::Instance &instance) {
  std::vector<Robot> robots;
  for (std::size_t agent = 0; agent < instance.agents(); agent++) {
    const auto heading =
        instance.has_headings() ? static_cast<std::int32_t>(instance.heading(agent)) : 0;
    const Cell goal = instance.goals(agent)[0];
    robots.push_back({instance.starts()[agent], heading, goal});
  }
  return robots;
}

struct Settings {
  int call_ms;
  int steps_per_call;
  int max_steps;
};

/* The competition, as far as the planner sees it. Lives in a process of its own. */
class Game {
public:
  Game(const fleetyard::Instance &instance, Settings settings)
      : settings_(settings), env_(*new SharedEnvironment()), planner_(*new MAPFPlanner(&env_)) {
    const fleetyard::Grid grid = instance.grid();
    env_.num_of_agents = static_cast<int>(instance.agents());
    env_.rows = static_cast<int>(grid.rows());
    env_.cols = static_cast<int>(grid.cols());
    env_.map_name = std::string(instance.environment().name());
    env_.file_storage_path = ".";
    for (Cell cell = 0; cell < grid.size(); cell++)
      env_.map.push_back(grid.passable()[cell] ? 0 : 1);
    env_.goal_locations.resize(instance.agents());
    env_.curr_task_schedule.resize(instance.agents());
    env_.curr_states.resize(instance.agents());
    place(robots_of(instance));
  }

  /* Plays until all are at their goals; the cells after each step go to `pipe`. */
  Exit play(int pipe, const fleetyard::Sink &sink) {
    // A quarter of the time each for what is done once.
    initialize(whole_ms(sink.remaining()) / 4);
    announce(settings_.steps_per_call);
    int limit = std::max(settings_.call_ms, whole_ms(sink.remaining()) / 4);
    while (env_.curr_timestep < settings_.max_steps) {
      for (const std::vector<Action> &actions : ask(limit)) {
        if (!step(actions))
          return bad_actions;
        if (!send(pipe) || arrived())
          return reached_end;
      }
      limit = settings_.call_ms;
    }
    return too_many_steps;
  }

  /* Answers requests from a pipe with the cells and headings after each step, or with none where
   * the actions cannot be followed. */
  Exit serve(int from, int to) {
    std::vector<Robot> robots(env_.curr_states.size());
    int timestep = 0;
    for (Request request{}; read_all(from, &request, sizeof request); timestep++) {
      if (!read_all(from, robots.data(), robots.size() * sizeof(Robot)))
        break;
      const auto deadline = Clock::now() + Ms(request.limit_ms);
      if (timestep == 0)
        initialize(request.limit_ms / 4);
      env_.curr_timestep = timestep;
      place(robots);
      announce(request.steps);
      std::int32_t steps = 0;
      for (bool follows = true; follows && steps < request.steps;) {
        const int left = request.steps - steps;
        for (const std::vector<Action> &actions : ask(whole_ms(deadline - Clock::now()) / left)) {
          follows = steps < request.steps && step(actions);
          if (!follows)
            break;
          steps++;
          for (std::size_t agent = 0; agent < robots.size(); agent++) {
            const State &state = env_.curr_states[agent];
            robots[agent].cell = static_cast<Cell>(state.location);
            robots[agent].heading = state.orientation;
          }
          if (!write_all(to, robots.data(), robots.size() * sizeof(Robot)))
            return reached_end;
        }
      }
      if (steps < request.steps) {
        // Nobody is nowhere.
        robots.assign(robots.size(), {fleetyard::unreachable, 0, 0});
        for (; steps < request.steps; steps++)
          if (!write_all(to, robots.data(), robots.size() * sizeof(Robot)))
            return reached_end;
      }
    }
    return reached_end;
  }

private:
  void initialize(int limit) {
    env_.plan_start_time = Clock::now();
    planner_.initialize(limit);
  }

  /* Puts agents in their places, with a task of one errand for each goal that is new. */
  void place(const std::vector<Robot> &robots) {
    env_.new_tasks.clear();
    env_.new_freeagents.clear();
    for (std::size_t at = 0; at < robots.size(); at++) {
      const int agent = static_cast<int>(at), goal = static_cast<int>(robots[at].goal);
      State &state = env_.curr_states[at];
      state.location = static_cast<int>(robots[at].cell);
      state.timestep = env_.curr_timestep;
      state.orientation = robots[at].heading;
      auto &goals = env_.goal_locations[at];
      if (!goals.empty() && goals.front().first == goal)
        continue;
      goals = {{goal, env_.curr_timestep}};
      Task task(agent, {goal}, env_.curr_timestep);
      task.agent_assigned = agent;
      env_.task_pool[agent] = task;
      env_.new_tasks.push_back(agent);
      env_.new_freeagents.push_back(agent);
      env_.curr_task_schedule[at] = agent;
    }
    tell_states();
  }

  /* Says how many steps a call plans, in version 3. */
  void announce([[maybe_unused]] int steps) {
#if __has_include("Plan.h")
    // An action is one tick.
    env_.max_counter = 1;
    env_.action_time = 100;
    env_.min_planner_communication_time = (steps - 1) * env_.action_time;
#endif
  }

  /* The actions of all agents, step by step. */
  std::vector<std::vector<Action>> ask(int limit) {
    env_.plan_start_time = Clock::now();
    std::vector<std::vector<Action>> steps = actions(limit);
    if (steps.empty()) // late; in the competition everybody waits then, too
      steps.emplace_back(env_.curr_states.size(), Action::W);
    env_.new_tasks.clear();
    env_.new_freeagents.clear();
    return steps;
  }

  std::vector<std::vector<Action>> actions(int limit) {
#if __has_include("Plan.h")
    ::Plan plan;
    planner_.plan(limit, plan);
    std::vector<std::vector<Action>> steps;
    for (std::size_t agent = 0; agent < plan.actions.size(); agent++)
      for (std::size_t at = 0; at < plan.actions[agent].size(); at++) {
        if (steps.size() <= at)
          steps.resize(at + 1, std::vector<Action>(env_.curr_states.size(), Action::W));
        steps[at].at(agent) = plan.actions[agent][at];
      }
    return steps;
#else
    std::vector<Action> step;
    planner_.plan(limit, step);
    return {step};
#endif
  }

  /* Follows the actions of one step; whether they are actions on this map. */
  bool step(const std::vector<Action> &actions) {
    if (actions.size() != env_.curr_states.size()) {
      std::fprintf(stderr, "step %d: %zu actions for %zu agents\n", env_.curr_timestep,
                   actions.size(), env_.curr_states.size());
      return false;
    }
    for (std::size_t agent = 0; agent < actions.size(); agent++) {
      State &state = env_.curr_states[agent];
      state.timestep++;
      switch (actions[agent]) {
      case Action::CR:
        state.orientation = (state.orientation + 1) % 4;
        break;
      case Action::CCR:
        state.orientation = (state.orientation + 3) % 4;
        break;
      case Action::FW: {
        // East, south, west, north, as in the contract.
        constexpr int rows[] = {0, 1, 0, -1}, cols[] = {1, 0, -1, 0};
        const int row = state.location / env_.cols + rows[state.orientation];
        const int col = state.location % env_.cols + cols[state.orientation];
        if (row < 0 || row >= env_.rows || col < 0 || col >= env_.cols) {
          std::fprintf(stderr, "step %d: agent %zu leaves the map\n", env_.curr_timestep, agent);
          return false;
        }
        state.location = row * env_.cols + col;
        break;
      }
      default:
        break;
      }
    }
    env_.curr_timestep++;
    tell_states();
    return true;
  }

  /* Version 3 tells the states in three ways; without delays they are the same. */
  void tell_states() {
#if __has_include("Plan.h")
    env_.start_states = env_.curr_states;
    env_.system_states = env_.curr_states;
    env_.system_timestep = env_.curr_timestep;
#endif
  }

  bool arrived() const {
    for (std::size_t agent = 0; agent < env_.curr_states.size(); agent++)
      if (env_.curr_states[agent].location != env_.goal_locations[agent].front().first)
        return false;
    return true;
  }

  bool send(int pipe) const {
    std::vector<Cell> cells;
    for (const State &state : env_.curr_states)
      cells.push_back(static_cast<Cell>(state.location));
    return write_all(pipe, cells.data(), cells.size() * sizeof(Cell));
  }

  Settings settings_;
  // Never freed: the classes free each other's data, and the process ends anyway.
  SharedEnvironment &env_;
  MAPFPlanner &planner_;
};

/* A process with pipes to and from it, ended with this object. */
class Process {
public:
  Process(pid_t pid, int from, int to) : pid_(pid), from_(from), to_(to) {}
  Process(const Process &) = delete;
  Process &operator=(const Process &) = delete;
  ~Process() {
    close(from_);
    close(to_);
    if (pid_ > 0) {
      kill(pid_, SIGKILL);
      wait();
    }
  }

  bool ask(const void *data, std::size_t bytes) const { return write_all(to_, data, bytes); }

  /* Waits for so many bytes, as long as the call goes on; `got` of them were there before. False
   * if the process is gone. */
  bool receive(std::vector<char> &data, std::size_t bytes, const fleetyard::Sink &sink) const {
    std::size_t got = data.size();
    data.resize(bytes);
    try {
      while (got < bytes) {
        sink.check();
        pollfd waiting{from_, POLLIN, 0};
        if (poll(&waiting, 1, 5) <= 0)
          continue;
        const ssize_t more = read(from_, data.data() + got, bytes - got);
        if (more < 0 && errno == EINTR)
          continue;
        if (more <= 0)
          return false;
        got += static_cast<std::size_t>(more);
      }
    } catch (...) {
      data.resize(got);
      throw;
    }
    return true;
  }

  /* Waits for a process that has closed its pipe; how it ended. */
  int wait() {
    int status = 0;
    while (waitpid(pid_, &status, 0) < 0 && errno == EINTR) {
    }
    pid_ = 0;
    return status;
  }

private:
  pid_t pid_;
  int from_, to_;
};

/* A planner that remembers, and what it was asked last. */
struct Lasting {
  std::unique_ptr<Process> process;
  std::vector<Robot> asked;
  std::uint32_t steps = 0;
  /* What it has answered, while that is not all. */
  std::vector<char> answer;
  bool is_open = false;
};

struct League : fleetyard::Planner {
  static constexpr std::string_view id = "lorr";
  static constexpr std::string_view name = "League of Robot Runners";
  static constexpr std::string_view version = LORR_VERSION;
  static constexpr std::string_view description =
      "The MAPFPlanner of a Start-Kit, step by step with fixed goals "
      "<https://github.com/MAPF-Competition/Start-Kit>";
  static constexpr std::string_view options_schema = R"({
    "type": "object",
    "properties": {
      "call_ms": {"type": "integer", "minimum": 1, "maximum": 600000, "default": 250,
        "description": "Time limit of a call of the planner; of the first, a quarter of the budget if that is more"},
      "steps_per_call": {"type": "integer", "minimum": 1, "maximum": 1000, "default": 20,
        "description": "How many steps a call plans, in version 3; in version 2 it is always one"},
      "max_steps": {"type": "integer", "minimum": 1, "maximum": 1000000, "default": 2000,
        "description": "It gives up after so many steps"}
    },
    "additionalProperties": false
  })";
  static constexpr std::uint64_t capabilities =
      fleetyard::capability::grid | fleetyard::capability::pebble |
      fleetyard::capability::rotation | fleetyard::capability::windowed;

  explicit League(const fleetyard::Options &options)
      : settings_{static_cast<int>(options.integer("call_ms")),
                  static_cast<int>(options.integer("steps_per_call")),
                  static_cast<int>(options.integer("max_steps"))} {}

  void prepare(const fleetyard::Environment &, const fleetyard::Budget &,
               const fleetyard::Sink &) override {
    lasting_ = {};
  }

  void plan(const fleetyard::Instance &instance, const fleetyard::Budget &budget,
            const fleetyard::Sink &sink) override {
    check(instance);
    std::vector<std::vector<Cell>> paths;
    for (const Cell start : instance.starts())
      paths.push_back({start});
    if (instance.window_steps() > 0) {
      follow(instance, budget, sink, paths);
    } else {
      const auto process = start(budget, [&](int, int to) {
        return Game(instance, settings_).play(to, sink);
      });
      while (!arrived(instance, paths)) {
        std::vector<char> data;
        if (!process->receive(data, paths.size() * sizeof(Cell), sink))
          ended(process->wait());
        const auto cells = reinterpret_cast<const Cell *>(data.data());
        for (std::size_t agent = 0; agent < paths.size(); agent++)
          paths[agent].push_back(cells[agent]);
      }
    }
    sink.submit_plan(paths);
  }

private:
  static void check(const fleetyard::Instance &instance) {
    using fleetyard::Status;
    const fleetyard::Grid grid = instance.grid();
    const std::vector<Cell> parts = parts_of(grid);
    std::set<Cell> starts, goals;
    for (std::size_t agent = 0; agent < instance.agents(); agent++) {
      for (const Cell cell : {instance.starts()[agent], instance.goal(agent)})
        if (!grid.is_free(cell))
          throw Failure(Status::invalid_input,
                        "cell " + std::to_string(cell) + " is blocked, but a start or a goal");
      if (!starts.insert(instance.starts()[agent]).second)
        throw Failure(Status::invalid_input, "two agents start in one cell");
      if (!goals.insert(instance.goal(agent)).second && instance.window_steps() == 0)
        throw Failure(Status::unsupported, "lorr takes no goal twice");
      // The default planner exits when it looks for such a path.
      if (parts[instance.starts()[agent]] != parts[instance.goal(agent)])
        throw Failure(Status::infeasible,
                      "agent " + std::to_string(agent) + " cannot reach its goal");
    }
  }

  /* For every free cell, the first of the cells that can be reached from it. */
  static std::vector<Cell> parts_of(const fleetyard::Grid &grid) {
    std::vector<Cell> parts(grid.size(), fleetyard::unreachable), open;
    for (Cell first = 0; first < grid.size(); first++) {
      if (!grid.passable()[first] || parts[first] != fleetyard::unreachable)
        continue;
      parts[first] = first;
      for (open = {first}; !open.empty();) {
        const Cell cell = open.back();
        open.pop_back();
        for (const Cell next : grid.neighbours(cell))
          if (parts[next] == fleetyard::unreachable) {
            parts[next] = first;
            open.push_back(next);
          }
      }
    }
    return parts;
  }

  static bool arrived(const fleetyard::Instance &instance,
                      const std::vector<std::vector<Cell>> &paths) {
    for (std::size_t agent = 0; agent < paths.size(); agent++)
      if (paths[agent].back() != instance.goal(agent))
        return false;
    return true;
  }

  /* The steps of a window, and behind it where agents that turned last will go. */
  void follow(const fleetyard::Instance &instance, const fleetyard::Budget &budget,
              const fleetyard::Sink &sink, std::vector<std::vector<Cell>> &paths) {
    const std::vector<Robot> robots = robots_of(instance);
    const std::uint32_t steps = instance.window_steps();
    if (lasting_.process && lasting_.asked.size() != robots.size())
      lasting_ = {};
    const bool stood = lasting_.is_open && lasting_.steps == steps &&
                       std::equal(robots.begin(), robots.end(), lasting_.asked.begin(),
                                  [](const Robot &a, const Robot &b) { return a.stands_as(b); });
    if (lasting_.is_open && !stood)
      finish(sink);
    if (!lasting_.process)
      lasting_.process = start(budget, [&](int from, int to) {
        return Game(instance, settings_).serve(from, to);
      });
    if (!stood) {
      const Request request{std::max(whole_ms(sink.remaining()), 1),
                            static_cast<std::int32_t>(steps)};
      lasting_.asked = robots;
      lasting_.steps = steps;
      lasting_.is_open = true;
      lasting_.answer.clear();
      if (!lasting_.process->ask(&request, sizeof request) ||
          !lasting_.process->ask(robots.data(), robots.size() * sizeof(Robot)))
        lost();
    }
    finish(sink);
    const auto *at = reinterpret_cast<const Robot *>(lasting_.answer.data());
    std::vector<Robot> before = robots;
    // The heading of each agent's last move, and steps that it stayed since then.
    std::vector<Robot> moved = robots;
    for (std::uint32_t step = 0; step < steps; step++)
      for (std::size_t agent = 0; agent < paths.size(); agent++, at++) {
        if (at->cell == fleetyard::unreachable)
          throw Failure(fleetyard::Status::internal_error,
                        "the planner's actions cannot be followed: see the log");
        if (at->cell != before[agent].cell)
          moved[agent] = *at;
        before[agent] = *at;
        paths[agent].push_back(at->cell);
      }
    const fleetyard::Grid grid = instance.grid();
    for (std::size_t agent = 0; agent < paths.size(); agent++)
      turn(grid, moved[agent].heading, before[agent], paths[agent]);
  }

  /* Lets a path say that its agent turned at its end: a plan has cells, and robots turn towards
   * the next one. Where that is blocked, half a turn was begun. */
  static void turn(const fleetyard::Grid &grid, std::int32_t looked, const Robot &robot,
                   std::vector<Cell> &path) {
    const std::int32_t turned = (robot.heading - looked + 4) % 4;
    if (turned == 0)
      return;
    const auto ahead = [&](std::int32_t heading) -> std::optional<Cell> {
      constexpr std::int64_t rows[] = {0, 1, 0, -1}, cols[] = {1, 0, -1, 0};
      const std::int64_t row = robot.cell / grid.cols() + rows[heading];
      const std::int64_t col = robot.cell % grid.cols() + cols[heading];
      if (row < 0 || row >= grid.rows() || col < 0 || col >= grid.cols())
        return std::nullopt;
      const auto cell = static_cast<Cell>(row * grid.cols() + col);
      return grid.is_free(cell) ? std::optional(cell) : std::nullopt;
    };
    if (const auto cell = ahead(robot.heading)) {
      path.push_back(*cell);
    } else if (const auto behind = ahead((looked + 2) % 4); behind && turned != 2) {
      path.insert(path.end(), {robot.cell, *behind});
    }
  }

  /* Waits for the rest of the last answer. */
  void finish(const fleetyard::Sink &sink) {
    const std::size_t bytes = lasting_.asked.size() * sizeof(Robot) * lasting_.steps;
    if (!lasting_.process->receive(lasting_.answer, bytes, sink))
      lost();
    lasting_.is_open = false;
  }

  [[noreturn]] void lost() {
    const int status = lasting_.process->wait();
    lasting_ = {};
    ended(status);
  }

  template <class Play>
  std::unique_ptr<Process> start(const fleetyard::Budget &budget, Play play) const {
    int out[2], in[2];
    if (pipe(out) != 0)
      throw std::runtime_error(std::string("no pipe: ") + std::strerror(errno));
    if (pipe(in) != 0) {
      close(out[0]);
      close(out[1]);
      throw std::runtime_error(std::string("no pipe: ") + std::strerror(errno));
    }
    const pid_t parent = getpid();
    const pid_t pid = fork();
    if (pid < 0) {
      for (const int end : {out[0], out[1], in[0], in[1]})
        close(end);
      throw std::runtime_error(std::string("no process: ") + std::strerror(errno));
    }
    if (pid > 0) {
      close(out[1]);
      close(in[0]);
      return std::make_unique<Process>(pid, out[0], in[1]);
    }
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (getppid() != parent)
      _exit(1);
    close(out[0]);
    close(in[1]);
    dup2(STDERR_FILENO, STDOUT_FILENO);
    std::srand(static_cast<unsigned>(budget.seed()));
    int code = 1;
    try {
      code = play(in[0], out[1]);
    } catch (const std::exception &error) {
      std::fprintf(stderr, "the planner threw: %s\n", error.what());
    } catch (...) {
      std::fprintf(stderr, "the planner threw\n");
    }
    std::fflush(nullptr);
    _exit(code);
  }

  /* The process ended before all agents were at their goals. */
  [[noreturn]] void ended(int status) const {
    using fleetyard::Status;
    if (WIFSIGNALED(status))
      throw Failure(Status::internal_error,
                    "signal " + std::to_string(WTERMSIG(status)) + " ended the planner");
    switch (WEXITSTATUS(status)) {
    case too_many_steps:
      throw Failure(Status::gave_up, "not all agents were at their goals at once within " +
                                         std::to_string(settings_.max_steps) + " steps");
    case bad_actions:
      throw Failure(Status::internal_error, "the planner's actions cannot be followed: see the log");
    default:
      throw Failure(Status::internal_error,
                    "the planner exited with code " + std::to_string(WEXITSTATUS(status)));
    }
  }

  Settings settings_;
  Lasting lasting_;
};

} // namespace

FLEETYARD_PLUGINS(League);
