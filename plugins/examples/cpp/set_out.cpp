/* A planner for roadmaps: every robot keeps to a route past those that rest, and sets out as soon
 * as those planned before it allow.
 *
 * Routes avoid the goals of robots that are planned already and the starts of those that are not,
 * so that a robot can always wait at its start until the others have arrived. Whoever has such a
 * route is planned next. Where starts and goals leave ways between them everybody arrives (Cap,
 * Novak, Kleiner and Selecky, "Prioritized Planning Algorithms for Trajectory Coordination of
 * Multiple Mobile Robots", IEEE T-ASE 2015); elsewhere it may give up.
 */

#include "fleetyard.hpp"

#include <queue>

namespace {

using fleetyard::Point;
using fleetyard::Vertex;
using fleetyard::Visit;
namespace capability = fleetyard::capability;

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

/* A robot is somewhere on a line for a while. */
struct Stay {
  Line line;
  double begin_s, end_s;
};

class SetOut : public fleetyard::Planner {
public:
  static constexpr auto id = "set-out";
  static constexpr auto name = "Routes and times to set out (C++ example)";
  static constexpr auto version = "0.1.0";
  static constexpr auto license = "MIT OR Apache-2.0";
  static constexpr auto description =
      "Routes past robots that rest, each begun as early as those before allow (after Cap et al. "
      "2015).";
  static constexpr auto capabilities = capability::roadmap | capability::stop_go |
                                       capability::slower | capability::heterogeneous |
                                       capability::deterministic;

  void plan(const fleetyard::Instance &instance, const fleetyard::Budget &,
            const fleetyard::Sink &sink) override {
    const fleetyard::Roadmap roadmap = instance.roadmap();
    const std::size_t agents = instance.agents();
    std::vector<Vertex> rests(instance.starts().begin(), instance.starts().end());
    std::vector<std::vector<Visit>> paths(agents);
    std::vector<Stay> stays; // of those that are planned, from when they set out
    std::size_t planned = 0;
    for (bool going = true; going && planned < agents;) {
      going = false;
      for (std::size_t agent = 0; agent < agents; agent++) {
        if (!paths[agent].empty())
          continue;
        std::vector<Point> others;
        for (std::size_t other = 0; other < agents; other++)
          if (other != agent)
            others.push_back(roadmap.position(rests[other]));
        paths[agent] = route(roadmap, rests[agent], instance.goal(agent), others, sink);
        if (paths[agent].empty())
          continue;
        set_out(roadmap, paths[agent], stays);
        rests[agent] = instance.goal(agent);
        going = true;
        sink.progress(++planned, agents);
      }
    }
    if (planned < agents)
      throw fleetyard::Failure(fleetyard::Status::gave_up,
                               std::to_string(agents - planned) +
                                   " robots have no route past those that rest");
    sink.submit_plan(paths);
  }

private:
  static Line line(const fleetyard::Roadmap &roadmap, Vertex from, Vertex to) {
    return {roadmap.position(from), roadmap.position(to)};
  }

  /* The visits of a fastest route, begun at once, that comes near none of the others; none if
   * there is no such route. */
  static std::vector<Visit> route(const fleetyard::Roadmap &roadmap, Vertex start, Vertex goal,
                                  const std::vector<Point> &others, const fleetyard::Sink &sink) {
    const auto is_free = [&](const Line &way) {
      return std::all_of(others.begin(), others.end(), [&](Point other) {
        return from_line(other, way) >= roadmap.separation_m();
      });
    };
    std::vector<double> arrival_s(roadmap.size(), infinite);
    std::vector<Vertex> before(roadmap.size(), fleetyard::none);
    using Entry = std::pair<double, Vertex>;
    std::priority_queue<Entry, std::vector<Entry>, std::greater<Entry>> open;
    arrival_s[start] = 0;
    for (open.push({0.0, start}); !open.empty();) {
      const auto [now, vertex] = open.top();
      open.pop();
      if (vertex == goal)
        break;
      sink.check();
      for (std::size_t at = 0; now <= arrival_s[vertex] && at < roadmap.degree(vertex); at++) {
        const fleetyard::Edge edge = roadmap.edge(vertex, at);
        const double then = now + edge.duration_s;
        if (then < arrival_s[edge.to] && is_free(line(roadmap, edge.from, edge.to))) {
          arrival_s[edge.to] = then;
          before[edge.to] = vertex;
          open.push({then, edge.to});
        }
      }
    }
    std::vector<Visit> visits;
    if (arrival_s[goal] < infinite && is_free(line(roadmap, goal, goal)))
      for (Vertex vertex = goal; vertex != fleetyard::none; vertex = before[vertex])
        visits.push_back({vertex, arrival_s[vertex], arrival_s[vertex]});
    std::reverse(visits.begin(), visits.end());
    return visits;
  }

  /* Begins a route as early as the stays of others allow, and adds its own. */
  static void set_out(const fleetyard::Roadmap &roadmap, std::vector<Visit> &visits,
                      std::vector<Stay> &stays) {
    std::vector<Stay> own;
    for (std::size_t at = 1; at < visits.size(); at++)
      own.push_back({line(roadmap, visits[at - 1].vertex, visits[at].vertex),
                     visits[at - 1].departure_s, visits[at].arrival_s});
    const Vertex goal = visits.back().vertex;
    own.push_back({line(roadmap, goal, goal), visits.back().arrival_s, infinite});
    /* Where it comes too near to another one, it goes so much later that the other is gone. None
     * of them stays there for good, or the route would not lead there. */
    double wait_s = 0;
    for (bool late = true; late;) {
      late = false;
      for (const Stay &mine : own)
        for (const Stay &other : stays)
          if (wait_s < other.end_s - mine.begin_s && other.begin_s - mine.end_s < wait_s &&
              distance(mine.line, other.line) < roadmap.separation_m()) {
            wait_s = other.end_s - mine.begin_s;
            late = true;
          }
    }
    for (Visit &visit : visits) {
      visit.arrival_s += wait_s;
      visit.departure_s += wait_s;
    }
    visits.front().arrival_s = 0;
    const Vertex start = visits.front().vertex;
    stays.push_back({line(roadmap, start, start), 0, wait_s});
    for (const Stay &mine : own)
      stays.push_back({mine.line, mine.begin_s + wait_s, mine.end_s + wait_s});
  }
};

} // namespace

FLEETYARD_PLUGINS(SetOut);
