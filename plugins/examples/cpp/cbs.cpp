/* Conflict-based search, as a Fleetyard plugin in one C++ file.
 *
 * What it is: every agent takes a shortest path of its own. Where two of them meet, the
 * search splits: either the one or the other must not be there then, and plans anew. The
 * cheapest such tree of prohibitions without a conflict left is an optimal plan (Sharon,
 * Stern, Felner and Sturtevant, "Conflict-Based Search for Optimal Multi-Agent
 * Pathfinding", Artificial Intelligence 219, 2015). A new path that costs no more and has
 * fewer conflicts is taken without a split (Boyarski et al., "Don't Split, Try To Work It
 * Out", ICAPS 2015). With `suboptimality` w > 1 it looks first where the fewest conflicts
 * are, among what costs at most w times the lower bound (Barer, Sharon, Stern and Felner,
 * "Suboptimal Variants of the Conflict-Based Search Algorithm", SoCS 2014).
 *
 * What it is not: for crowds. The tree grows with the number of conflicts; a dozen agents
 * in the open are easy, and fifty are not. Where there is no plan, it searches until the
 * budget ends, unless one goal is out of reach by itself.
 */

#include "fleetyard.hpp"

#include <queue>
#include <set>
#include <string>
#include <tuple>
#include <unordered_set>
#include <utility>

namespace {

using fleetyard::Cell;
using fleetyard::Failure;
using fleetyard::Status;
namespace capability = fleetyard::capability;

using Path = std::vector<Cell>;
using Time = std::uint32_t;

constexpr Cell anywhere = fleetyard::unreachable;

/* After its last cell an agent stays there. */
Cell at(const Path &path, Time time) { return path[std::min<std::size_t>(time, path.size() - 1)]; }

/* An agent must not enter `to` at `time`, be it from anywhere or from one cell. */
struct Prohibition {
  Time time;
  Cell from, to;
  bool operator<(const Prohibition &other) const {
    return std::tie(time, from, to) < std::tie(other.time, other.from, other.to);
  }
};

/* Two agents and what each would have to avoid. */
struct Conflict {
  Time time;
  std::size_t agents[2];
  Prohibition avoid[2];
};

/* A node of the tree says what is new in it: the path of one agent, and what that agent
 * must avoid. Everything else is as in its parent. The first nodes have no prohibition:
 * each adds the path of another agent, and the last of them is the root of the search. */
struct Node {
  std::size_t parent;
  std::size_t agent;
  std::size_t path, length; /* in `cells_` */
  std::optional<Prohibition> avoid;
  std::uint64_t cost;
  std::size_t conflicts; /* pairs of agents that meet */
  Conflict first;        /* the earliest, if there is any */
};

class Search {
public:
  Search(const fleetyard::Instance &instance, const fleetyard::Budget &budget,
         const fleetyard::Sink &sink, double suboptimality)
      : instance_(instance), grid_(instance.grid()), budget_(budget), sink_(sink),
        suboptimality_(suboptimality) {
    std::set<Cell> starts, goals;
    for (std::size_t agent = 0; agent < instance.agents(); agent++) {
      const std::string who = "agent " + std::to_string(agent);
      const Cell start = instance.starts()[agent], goal = instance.goal(agent);
      if (!grid_.is_free(start) || !grid_.is_free(goal))
        throw Failure(Status::invalid_input, who + " starts or ends where nobody can stand");
      if (!starts.insert(start).second)
        throw Failure(Status::invalid_input, who + " starts where another one does");
      if (!goals.insert(goal).second)
        throw Failure(Status::unsupported, who + " has the goal of another one");
      distances_.push_back(grid_.distances(goal));
      if (distances_.back()[start] == fleetyard::unreachable)
        throw Failure(Status::infeasible, "no path leads " + who + " to its goal");
      sink.check();
    }
  }

  void run() {
    for (std::size_t agent = 0; agent < instance_.agents(); agent++) {
      paths_.push_back(*shortest(agent, {}));
      add({agent ? agent - 1 : 0, agent, 0, 0, {}, 0, 0, {}}, paths_.back());
    }
    judge(nodes_.back());
    open(nodes_.size() - 1);
    while (!open_.empty()) {
      const std::uint64_t bound = open_.begin()->first;
      std::size_t node = pop();
      recall(node);
      while (nodes_[node].conflicts > 0 && split(node)) {
      }
      if (nodes_[node].conflicts == 0)
        return submit(bound);
    }
    throw Failure(Status::gave_up, "every way to resolve a conflict is closed");
  }

private:
  void submit(std::uint64_t bound) const {
    sink_.submit_plan(paths_);
    sink_.metric("expansions", static_cast<double>(expansions_));
    sink_.metric("tree_nodes", static_cast<double>(nodes_.size()));
    sink_.metric("lower_bound", static_cast<double>(bound));
  }

  /* ---- The tree -------------------------------------------------------------- */

  /* Resolves the earliest conflict of a node, whose paths are in `paths_`. Either opens two
   * children, or moves on to a node with the same prohibitions and fewer conflicts, and
   * returns true. */
  bool split(std::size_t &node) {
    const Conflict conflict = nodes_[node].first;
    std::optional<std::size_t> children[2];
    for (int side = 0; side < 2; side++) {
      const std::size_t agent = conflict.agents[side];
      const std::optional<Path> path = shortest(agent, prohibitions(node, conflict, side));
      if (!path)
        continue; // that way is closed
      const Path before = std::exchange(paths_[agent], *path);
      Node child{node, agent, 0, 0, conflict.avoid[side], 0, 0, {}};
      judge(child);
      if (child.cost == nodes_[node].cost && child.conflicts < nodes_[node].conflicts) {
        child.avoid.reset(); // the path keeps to what it need not
        node = add(child, *path);
        return true;
      }
      children[side] = add(child, *path);
      paths_[agent] = before;
    }
    for (const auto &child : children)
      if (child)
        open(*child);
    return false;
  }

  /* The moves that an agent has to avoid in a child of a node. */
  std::vector<Prohibition> prohibitions(std::size_t node, const Conflict &conflict,
                                        int side) const {
    std::vector<Prohibition> found{conflict.avoid[side]};
    for (; nodes_[node].parent != node; node = nodes_[node].parent)
      if (nodes_[node].agent == conflict.agents[side] && nodes_[node].avoid)
        found.push_back(*nodes_[node].avoid);
    std::sort(found.begin(), found.end());
    return found;
  }

  std::size_t add(Node node, const Path &path) {
    node.path = cells_.size();
    node.length = path.size();
    cells_.insert(cells_.end(), path.begin(), path.end());
    nodes_.push_back(node);
    const std::size_t bytes = nodes_.capacity() * sizeof(Node) + cells_.capacity() * sizeof(Cell);
    if (budget_.memory_bytes() && bytes > budget_.memory_bytes() / 4)
      throw Failure(Status::gave_up, "the tree of conflicts has outgrown the memory");
    return nodes_.size() - 1;
  }

  /* Puts the paths of a node into `paths_`. */
  void recall(std::size_t node) {
    std::vector<bool> known(paths_.size());
    for (std::size_t left = paths_.size(); left > 0; node = nodes_[node].parent) {
      const Node &each = nodes_[node];
      if (known[each.agent])
        continue;
      known[each.agent] = true;
      left--;
      const auto begin = cells_.begin() + static_cast<std::ptrdiff_t>(each.path);
      paths_[each.agent].assign(begin, begin + static_cast<std::ptrdiff_t>(each.length));
    }
  }

  /* Fills in what a node costs whose paths are in `paths_`, and which conflicts it has. */
  void judge(Node &node) const {
    const bool makespan = instance_.objective() == fleetyard::Objective::makespan;
    for (const Path &path : paths_) {
      const std::uint64_t arrival = path.size() - 1;
      node.cost = makespan ? std::max(node.cost, arrival) : node.cost + arrival;
    }
    for (std::size_t one = 0; one < paths_.size(); one++)
      for (std::size_t other = one + 1; other < paths_.size(); other++) {
        Conflict conflict{0, {one, other}, {}};
        if (meet(paths_[one], paths_[other], conflict)) {
          if (node.conflicts == 0 || conflict.time < node.first.time)
            node.first = conflict;
          node.conflicts++;
        }
      }
  }

  /* True if two paths collide; gives the first conflict. */
  static bool meet(const Path &one, const Path &other, Conflict &conflict) {
    const auto length = static_cast<Time>(std::max(one.size(), other.size()));
    for (Time time = 1; time < length; time++) {
      const Cell here = at(one, time), there = at(other, time);
      const Cell from = at(one, time - 1), other_from = at(other, time - 1);
      const bool swap = here == other_from && there == from && here != from;
      if (here != there && !swap)
        continue;
      conflict.time = time;
      conflict.avoid[0] = {time, swap ? from : anywhere, here};
      conflict.avoid[1] = {time, swap ? other_from : anywhere, there};
      return true;
    }
    return false;
  }

  /* Open nodes are in `open_` by cost, and those within the bound in `focal_` as well, by
   * conflicts. Their numbers, the order in which they came, break ties. */
  void open(std::size_t node) {
    open_.emplace(nodes_[node].cost, node);
    if (within(nodes_[node].cost, bound_))
      focal_.emplace(nodes_[node].conflicts, nodes_[node].cost, node);
  }

  bool within(std::uint64_t cost, std::uint64_t bound) const {
    return static_cast<double>(cost) <= suboptimality_ * static_cast<double>(bound);
  }

  std::size_t pop() {
    // The bound never falls: children cost as much as their parents, or more.
    const std::uint64_t before = std::exchange(bound_, open_.begin()->first);
    if (bound_ > before) {
      for (const auto &[cost, node] : open_) {
        if (!within(cost, bound_))
          break;
        if (!within(cost, before))
          focal_.emplace(nodes_[node].conflicts, cost, node);
      }
    }
    const auto [conflicts, cost, node] = *focal_.begin();
    focal_.erase(focal_.begin());
    open_.erase({cost, node});
    return node;
  }

  /* ---- One agent -------------------------------------------------------------- */

  /* A path of earliest arrival that keeps to the prohibitions and, among those, meets few
   * of the others; none when there is no such path. A* through space and time. */
  std::optional<Path> shortest(std::size_t agent, const std::vector<Prohibition> &avoid) {
    struct State {
      Cell cell;
      Time time;
      std::uint32_t conflicts;
      std::size_t before;
    };
    const auto &distance = distances_[agent];
    const Cell goal = instance_.goal(agent);
    Time free_from = 0; // nobody has to leave the goal from then on
    for (const Prohibition &each : avoid)
      if (each.to == goal && each.from == anywhere)
        free_from = std::max(free_from, each.time + 1);
    const auto prohibited = [&](Time time, Cell from, Cell to) {
      return std::binary_search(avoid.begin(), avoid.end(), Prohibition{time, anywhere, to}) ||
             std::binary_search(avoid.begin(), avoid.end(), Prohibition{time, from, to});
    };

    std::vector<State> states;
    std::unordered_set<std::uint64_t> closed;
    // The least arrival time first, then the fewest conflicts, then the latest time.
    using Rank = std::tuple<std::uint64_t, std::uint32_t, std::uint32_t, std::size_t>;
    std::priority_queue<Rank, std::vector<Rank>, std::greater<Rank>> open;
    const auto add = [&](Cell cell, Time time, std::uint32_t conflicts, std::size_t before) {
      const std::uint64_t arrival =
          std::max<std::uint64_t>(std::uint64_t{time} + distance[cell], free_from);
      open.emplace(arrival, conflicts, fleetyard::unreachable - time, states.size());
      states.push_back({cell, time, conflicts, before});
    };
    add(instance_.starts()[agent], 0, 0, 0);
    while (!open.empty()) {
      const std::size_t index = std::get<3>(open.top());
      open.pop();
      const State state = states[index];
      if (state.cell == goal && state.time >= free_from)
        return traced(states, index);
      if (!closed.insert(std::uint64_t{state.time} << 32 | state.cell).second)
        continue;
      count();
      const Time next = state.time + 1;
      const auto step = [&](Cell to) {
        if (!prohibited(next, state.cell, to))
          add(to, next, state.conflicts + met(agent, next, state.cell, to), index);
      };
      step(state.cell);
      for (const Cell near : grid_.neighbours(state.cell))
        step(near);
    }
    return std::nullopt;
  }

  template <class State>
  static Path traced(const std::vector<State> &states, std::size_t index) {
    Path path(std::size_t{states[index].time} + 1);
    for (std::size_t left = path.size(); left > 0; left--) {
      path[left - 1] = states[index].cell;
      index = states[index].before;
    }
    return path;
  }

  /* Number of the others that a step meets. */
  std::uint32_t met(std::size_t agent, Time time, Cell from, Cell to) const {
    std::uint32_t count = 0;
    for (std::size_t other = 0; other < paths_.size(); other++) {
      const Cell there = at(paths_[other], time);
      count += other != agent &&
               (there == to || (there == from && at(paths_[other], time - 1) == to));
    }
    return count;
  }

  void count() {
    expansions_++;
    if (budget_.nodes() && expansions_ > budget_.nodes())
      throw Failure(Status::gave_up, "the limit of search nodes is reached");
    if (expansions_ % 256 == 0)
      sink_.check();
  }

  const fleetyard::Instance &instance_;
  fleetyard::Grid grid_;
  const fleetyard::Budget &budget_;
  const fleetyard::Sink &sink_;
  double suboptimality_;
  std::vector<std::vector<std::uint32_t>> distances_;
  std::vector<Path> paths_; /* of the node that is looked at */
  std::vector<Node> nodes_; /* all in two arrays, which are quickly gone when time is up */
  std::vector<Cell> cells_;
  std::set<std::pair<std::uint64_t, std::size_t>> open_;
  std::set<std::tuple<std::size_t, std::uint64_t, std::size_t>> focal_;
  std::uint64_t bound_ = 0, expansions_ = 0;
};

class Cbs : public fleetyard::Planner {
public:
  static constexpr auto id = "cbs";
  static constexpr auto name = "Conflict-based search (C++ example)";
  static constexpr auto version = "0.1.0";
  static constexpr auto license = "MIT OR Apache-2.0";
  static constexpr auto description =
      "Optimal plans for small teams by conflict-based search (Sharon et al. 2015), or plans "
      "within a factor of the optimum sooner.";
  static constexpr auto capabilities =
      capability::grid | capability::move_mask | capability::pebble | capability::deterministic;
  static constexpr auto options_schema = R"({
    "type": "object", "additionalProperties": false,
    "properties": {
      "suboptimality": {
        "type": "number", "minimum": 1, "default": 1,
        "description": "Most times the cost of the best plan that a plan may cost."
      }
    }
  })";

  explicit Cbs(const fleetyard::Options &options)
      : suboptimality_(options.number("suboptimality")) {}

  void plan(const fleetyard::Instance &instance, const fleetyard::Budget &budget,
            const fleetyard::Sink &sink) override {
    Search(instance, budget, sink, suboptimality_).run();
  }

private:
  double suboptimality_;
};

} // namespace

FLEETYARD_PLUGINS(Cbs);
