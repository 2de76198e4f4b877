/* Prioritized planning on a roadmap: robots plan one after the other, and each keeps its distance
 * from those before it by waiting.
 *
 * While a robot drives an edge, nobody comes nearer to any point of the edge than the separation;
 * while it stands on a vertex, nobody comes nearer to that. This is safe and simple, and forbids
 * more than it must. The search is over safe intervals of vertices (Phillips and Likhachev, "SIPP:
 * Safe Interval Path Planning for Dynamic Environments", ICRA 2011). Neither complete nor optimal.
 * Put your own algorithm into `plan`.
 */

#include "fleetyard.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <queue>
#include <set>
#include <string>
#include <tuple>
#include <vector>

namespace {

using fleetyard::Point;
using fleetyard::Vertex;
using fleetyard::Visit;

constexpr double infinite = std::numeric_limits<double>::infinity();

/* A straight line between two vertices, or a vertex. */
struct Line {
  Point a, b;
};

double from_line(Point p, const Line &line) {
  const double dx = line.b.x_m - line.a.x_m, dy = line.b.y_m - line.a.y_m;
  const double px = p.x_m - line.a.x_m, py = p.y_m - line.a.y_m, length = dx * dx + dy * dy;
  const double along = length > 0 ? std::clamp((px * dx + py * dy) / length, 0.0, 1.0) : 0.0;
  return std::hypot(px - along * dx, py - along * dy);
}

/* The side of a line on which a point lies, by its sign. */
double side(const Line &line, Point p) {
  return (line.b.x_m - line.a.x_m) * (p.y_m - line.a.y_m) -
         (line.b.y_m - line.a.y_m) * (p.x_m - line.a.x_m);
}

double distance(const Line &a, const Line &b) {
  if (side(a, b.a) * side(a, b.b) < 0 && side(b, a.a) * side(b, a.b) < 0)
    return 0; // they cross
  return std::min({from_line(a.a, b), from_line(a.b, b), from_line(b.a, a), from_line(b.b, a)});
}

/* A robot is somewhere on a line for a while: nobody else comes near. */
struct Stay {
  Line line;
  double begin_s, end_s;
};

/* Where the robots that have been planned are, and when. */
class Table {
public:
  explicit Table(double separation_m) : separation_m_(separation_m) {}

  void add(const Line &line, double begin_s, double end_s) {
    stays_.push_back({line, begin_s, end_s});
  }

  /* The end of a stay that forbids to be on a line in a time, if there is one. */
  std::optional<double> forbidden(const Line &line, double begin_s, double end_s) const {
    for (const Stay &stay : stays_)
      if (stay.begin_s < end_s && begin_s < stay.end_s && is_near(stay, line))
        return stay.end_s;
    return std::nullopt;
  }

  /* The number of a safe interval of a vertex: that of stays near it that are over. */
  std::size_t interval(const Line &vertex, double time_s) const {
    return static_cast<std::size_t>(
        std::count_if(stays_.begin(), stays_.end(), [&](const Stay &stay) {
          return stay.end_s <= time_s && is_near(stay, vertex);
        }));
  }

  /* The next time at which a safe interval of a vertex may begin; infinite if none does. */
  double next_interval(const Line &vertex, double time_s) const {
    double next = infinite;
    for (const Stay &stay : stays_)
      if (stay.end_s > time_s && is_near(stay, vertex))
        next = std::min(next, stay.end_s);
    return next;
  }

private:
  bool is_near(const Stay &stay, const Line &line) const {
    return distance(stay.line, line) < separation_m_;
  }

  double separation_m_;
  std::vector<Stay> stays_;
};

/* Prioritized planning, in another order when a robot finds no path. */
class Prioritized : public fleetyard::Planner {
public:
  static constexpr auto id = "example-plugin";
  static constexpr auto version = "0.1.0";
  static constexpr auto description =
      "Prioritized planning on roadmaps, in another order when one fails.";
  /* What the host may ask of the planner; docs/conformance.md lists all there is. */
  static constexpr auto capabilities =
      fleetyard::capability::roadmap | fleetyard::capability::stop_go |
      fleetyard::capability::slower | fleetyard::capability::heterogeneous |
      fleetyard::capability::deterministic;
  /* What `--option NAME=VALUE` may say. The host checks it before the planner starts. */
  static constexpr auto options_schema = R"({
    "type": "object",
    "additionalProperties": false,
    "properties": {
      "attempts": {
        "type": "integer",
        "minimum": 1,
        "default": 100,
        "description": "Most orders of the robots to try."
      }
    }
  })";

  explicit Prioritized(const fleetyard::Options &options)
      : attempts_(options.integer("attempts")) {}

  void plan(const fleetyard::Instance &instance, const fleetyard::Budget &,
            const fleetyard::Sink &sink) override {
    const fleetyard::Roadmap roadmap = instance.roadmap();
    std::vector<std::size_t> order(instance.agents());
    std::iota(order.begin(), order.end(), 0);
    for (std::int64_t attempt = 0; attempt < attempts_; attempt++) {
      std::vector<std::vector<Visit>> paths(order.size()); // by agent
      Table table(roadmap.separation_m());
      auto next = order.begin();
      for (; next != order.end(); ++next) {
        paths[*next] =
            find_path(roadmap, instance.starts()[*next], instance.goal(*next), table, sink);
        if (paths[*next].empty())
          break;
      }
      if (next == order.end()) {
        sink.submit_plan(paths);
        return;
      }
      if (next == order.begin())
        throw fleetyard::Failure(fleetyard::Status::infeasible,
                                 "no path leads robot " + std::to_string(*next) + " to its goal");
      /* Who found no path goes first, and who went first goes last. */
      std::rotate(next, next + 1, order.end());
      std::swap(order.front(), order.back());
    }
    throw fleetyard::Failure(fleetyard::Status::gave_up, "no order of the robots worked");
  }

private:
  /* A robot can be on a vertex from a time on. */
  struct Node {
    Vertex vertex;
    std::size_t before; /* the node that it comes from; its own number at the start */
    double departure_s, arrival_s;
  };

  /* The visits of an earliest path that comes near none of the others, and none if there is no
   * such path. Others keep away from it afterwards. */
  static std::vector<Visit> find_path(const fleetyard::Roadmap &roadmap, Vertex start, Vertex goal,
                                      Table &table, const fleetyard::Sink &sink) {
    const auto line = [&](Vertex from, Vertex to) {
      return Line{roadmap.position(from), roadmap.position(to)};
    };
    std::vector<Node> nodes{{start, 0, 0, 0}};
    std::set<std::pair<Vertex, std::size_t>> done; // vertices with the numbers of intervals
    using Entry = std::pair<double, std::size_t>;
    std::priority_queue<Entry, std::vector<Entry>, std::greater<Entry>> open;
    for (open.push({0.0, 0}); !open.empty();) {
      sink.check(); // ends the call when its time is up
      const std::size_t now = open.top().second;
      const Node node = nodes[now];
      const Line here = line(node.vertex, node.vertex);
      open.pop();
      if (!done.emplace(node.vertex, table.interval(here, node.arrival_s)).second)
        continue;
      if (node.vertex == goal && !table.forbidden(here, node.arrival_s, infinite))
        return taken(nodes, now, line, table);
      for (std::size_t at = 0; at < roadmap.degree(node.vertex); at++) {
        const fleetyard::Edge edge = roadmap.edge(node.vertex, at);
        /* It waits until the edge is free, as long as the vertex is. */
        for (double departure_s = node.arrival_s;
             departure_s < infinite && !table.forbidden(here, node.arrival_s, departure_s);) {
          const double arrival_s = departure_s + edge.duration_s;
          if (const auto free_s = table.forbidden(line(edge.from, edge.to), departure_s, arrival_s)) {
            departure_s = *free_s;
            continue;
          }
          open.push({arrival_s, nodes.size()});
          nodes.push_back({edge.to, now, departure_s, arrival_s});
          departure_s = table.next_interval(line(edge.to, edge.to), arrival_s);
        }
      }
    }
    return {};
  }

  template <class LineOf>
  static std::vector<Visit> taken(const std::vector<Node> &nodes, std::size_t last, LineOf line,
                                  Table &table) {
    std::vector<Visit> visits;
    double departure_s = infinite; // at its goal it stays for good
    for (std::size_t at = last;; at = nodes[at].before) {
      const Node &node = nodes[at];
      table.add(line(node.vertex, node.vertex), node.arrival_s, departure_s);
      visits.push_back({node.vertex, node.arrival_s, at == last ? node.arrival_s : departure_s});
      if (node.before == at)
        break;
      table.add(line(nodes[node.before].vertex, node.vertex), node.departure_s, node.arrival_s);
      departure_s = node.departure_s;
    }
    std::reverse(visits.begin(), visits.end());
    return visits;
  }

  std::int64_t attempts_;
};

} // namespace

FLEETYARD_PLUGINS(Prioritized);
