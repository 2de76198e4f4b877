/* A planner of the League of Robot Runners as a Fleetyard plugin.
 *
 * What it is: the glue between this contract and the class `MAPFPlanner` of a Start-Kit,
 * https://github.com/MAPF-Competition/Start-Kit, with which it is compiled (see the
 * Makefile). Every agent has its goal for the whole call. The planner is asked for actions
 * again and again, as the competition asks it, and its turns and moves are followed cell
 * by cell until all agents are at their goals at once. An agent waits in its cell while it
 * turns, so that plans hold for robots that turn, too.
 *
 * What it is not: the competition. Nothing assigns tasks, so neither `Entry` nor a task
 * scheduler is asked, no action is delayed, and one action is one step.
 *
 * Each call runs the planner in a process of its own. These programs keep their data in
 * global variables, which begin anew there, and may exit or crash without taking the
 * plugin with them. Its standard output goes to the log.
 *
 * It fits Start-Kits of the versions 3 and 2.
 */

#include "fleetyard.hpp"

#include "MAPFPlanner.h"

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
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

struct Settings {
  int call_ms;
  int steps_per_call;
  int max_steps;
};

/* The competition, as far as the planner sees it. Lives in a process of its own. */
class Game {
public:
  Game(const fleetyard::Instance &instance, const fleetyard::Sink &sink, Settings settings)
      : sink_(sink), settings_(settings), env_(*new SharedEnvironment()),
        planner_(*new MAPFPlanner(&env_)) {
    const fleetyard::Grid grid = instance.grid();
    const int agents = static_cast<int>(instance.agents());
    env_.num_of_agents = agents;
    env_.rows = static_cast<int>(grid.rows());
    env_.cols = static_cast<int>(grid.cols());
    env_.map_name = std::string(instance.environment().name());
    env_.file_storage_path = ".";
    for (Cell cell = 0; cell < grid.size(); cell++)
      env_.map.push_back(grid.passable()[cell] ? 0 : 1);
    env_.goal_locations.resize(instance.agents());
    env_.curr_task_schedule.resize(instance.agents());
    for (int agent = 0; agent < agents; agent++) {
      const auto at = static_cast<std::size_t>(agent);
      const int goal = static_cast<int>(instance.goal(at));
      const int heading = instance.has_headings() ? static_cast<int>(instance.heading(at)) : 0;
      State state;
      state.location = static_cast<int>(instance.starts()[at]);
      state.timestep = 0;
      state.orientation = heading;
      env_.curr_states.push_back(state);
      env_.goal_locations[at].push_back({goal, 0});
      Task task(agent, {goal}, 0);
      task.agent_assigned = agent;
      env_.task_pool.emplace(agent, task);
      env_.new_tasks.push_back(agent);
      env_.new_freeagents.push_back(agent);
      env_.curr_task_schedule[at] = agent;
    }
    tell_states();
#if __has_include("Plan.h")
    // An action is one tick, and a call plans for so many.
    env_.max_counter = 1;
    env_.action_time = 100;
    env_.min_planner_communication_time = (settings.steps_per_call - 1) * env_.action_time;
#endif
  }

  /* Plays until all are at their goals; the cells after each step go to `pipe`. */
  Exit play(int pipe) {
    // A quarter of the time each for what is done once.
    env_.plan_start_time = Clock::now();
    planner_.initialize(whole_ms(sink_.remaining()) / 4);
    int limit = std::max(settings_.call_ms, whole_ms(sink_.remaining()) / 4);
    while (env_.curr_timestep < settings_.max_steps) {
      env_.plan_start_time = Clock::now();
      std::vector<std::vector<Action>> steps = ask(limit);
      if (steps.empty()) // late; in the competition everybody waits then, too
        steps.emplace_back(env_.curr_states.size(), Action::W);
      for (const std::vector<Action> &actions : steps) {
        if (!step(actions))
          return bad_actions;
        if (!send(pipe) || arrived())
          return reached_end;
      }
      env_.new_tasks.clear();
      env_.new_freeagents.clear();
      limit = settings_.call_ms;
    }
    return too_many_steps;
  }

private:
  /* The actions of all agents, step by step. */
  std::vector<std::vector<Action>> ask(int limit) {
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
    std::vector<Action> actions;
    planner_.plan(limit, actions);
    return {actions};
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
    const char *data = reinterpret_cast<const char *>(cells.data());
    for (std::size_t left = cells.size() * sizeof(Cell); left > 0;) {
      const ssize_t written = write(pipe, data, left);
      if (written < 0 && errno == EINTR)
        continue;
      if (written <= 0)
        return false;
      data += written;
      left -= static_cast<std::size_t>(written);
    }
    return true;
  }

  const fleetyard::Sink &sink_;
  Settings settings_;
  // Never freed: the classes free each other's data, and the process ends anyway.
  SharedEnvironment &env_;
  MAPFPlanner &planner_;
};

/* A process, ended with this object. */
class Process {
public:
  Process(pid_t pid, int pipe) : pid_(pid), pipe_(pipe) {}
  Process(const Process &) = delete;
  Process &operator=(const Process &) = delete;
  ~Process() { end(); }

  int pipe() const { return pipe_; }

  /* Waits for a process that has closed its pipe; how it ended. */
  int wait() {
    int status = 0;
    while (waitpid(pid_, &status, 0) < 0 && errno == EINTR) {
    }
    pid_ = 0;
    return status;
  }

private:
  void end() {
    close(pipe_);
    if (pid_ > 0) {
      kill(pid_, SIGKILL);
      wait();
    }
  }

  pid_t pid_;
  int pipe_;
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
      fleetyard::capability::rotation;

  explicit League(const fleetyard::Options &options)
      : settings_{static_cast<int>(options.integer("call_ms")),
                  static_cast<int>(options.integer("steps_per_call")),
                  static_cast<int>(options.integer("max_steps"))} {}

  void plan(const fleetyard::Instance &instance, const fleetyard::Budget &budget,
            const fleetyard::Sink &sink) override {
    check(instance);
    std::vector<std::vector<Cell>> paths;
    for (const Cell start : instance.starts())
      paths.push_back({start});
    Process process = start(instance, budget, sink);
    while (!arrived(instance, paths))
      receive(process, paths, sink);
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
      if (!goals.insert(instance.goal(agent)).second)
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

  Process start(const fleetyard::Instance &instance, const fleetyard::Budget &budget,
                const fleetyard::Sink &sink) const {
    int ends[2];
    if (pipe(ends) != 0)
      throw std::runtime_error(std::string("no pipe: ") + std::strerror(errno));
    const pid_t parent = getpid();
    const pid_t pid = fork();
    if (pid < 0) {
      close(ends[0]);
      close(ends[1]);
      throw std::runtime_error(std::string("no process: ") + std::strerror(errno));
    }
    if (pid > 0) {
      close(ends[1]);
      return Process(pid, ends[0]);
    }
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (getppid() != parent)
      _exit(1);
    close(ends[0]);
    dup2(STDERR_FILENO, STDOUT_FILENO);
    std::srand(static_cast<unsigned>(budget.seed()));
    int code = 1;
    try {
      code = Game(instance, sink, settings_).play(ends[1]);
    } catch (const std::exception &error) {
      std::fprintf(stderr, "the planner threw: %s\n", error.what());
    } catch (...) {
      std::fprintf(stderr, "the planner threw\n");
    }
    std::fflush(nullptr);
    _exit(code);
  }

  /* Adds the cells of the next step to the paths. */
  void receive(Process &process, std::vector<std::vector<Cell>> &paths,
               const fleetyard::Sink &sink) const {
    std::vector<Cell> cells(paths.size());
    char *data = reinterpret_cast<char *>(cells.data());
    for (std::size_t left = cells.size() * sizeof(Cell); left > 0;) {
      sink.check();
      pollfd waiting{process.pipe(), POLLIN, 0};
      if (poll(&waiting, 1, 5) <= 0)
        continue;
      const ssize_t got = read(process.pipe(), data, left);
      if (got < 0 && errno == EINTR)
        continue;
      if (got <= 0)
        ended(process.wait());
      data += got;
      left -= static_cast<std::size_t>(got);
    }
    for (std::size_t agent = 0; agent < paths.size(); agent++)
      paths[agent].push_back(cells[agent]);
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
};

} // namespace

FLEETYARD_PLUGINS(League);
