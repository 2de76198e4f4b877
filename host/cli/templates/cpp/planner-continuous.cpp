/* One robot after the other drives to its goal while all others rest.
 *
 * A robot goes a shortest way past the corners of obstacles and past robots that rest, in a
 * visibility graph (Lozano-Perez and Wesley, "An Algorithm for Planning Collision-Free Paths Among
 * Polyhedral Obstacles", CACM 1979). Its enclosing circle stands for it. Simple and slow, for
 * nobody drives beside another. Put your own algorithm into `plan`.
 */

#include "fleetyard.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

namespace {

using fleetyard::Knot;
using fleetyard::Point;

constexpr double infinite = std::numeric_limits<double>::infinity(), whole_turn = 6.283185307179586;

double distance(Point a, Point b) { return std::hypot(a.x_m - b.x_m, a.y_m - b.y_m); }

Point position(const fleetyard::Knot &knot) { return {knot.x_m, knot.y_m}; }

double from_segment(Point p, Point a, Point b) {
  const double dx = b.x_m - a.x_m, dy = b.y_m - a.y_m, length = dx * dx + dy * dy;
  const double ahead = (p.x_m - a.x_m) * dx + (p.y_m - a.y_m) * dy;
  const double along = length > 0 ? std::clamp(ahead / length, 0.0, 1.0) : 0.0;
  return distance(p, {a.x_m + along * dx, a.y_m + along * dy});
}

/* The side of the line from `a` to `b` on which a point lies, by its sign. */
double side(Point a, Point b, Point p) {
  return (b.x_m - a.x_m) * (p.y_m - a.y_m) - (b.y_m - a.y_m) * (p.x_m - a.x_m);
}

double between(Point a, Point b, Point c, Point d) {
  if (side(a, b, c) * side(a, b, d) < 0 && side(c, d, a) * side(c, d, b) < 0)
    return 0; // they cross
  return std::min({from_segment(a, c, d), from_segment(b, c, d), from_segment(c, a, b),
                   from_segment(d, a, b)});
}

/* A robot that rests, or the corner of an obstacle: the centre of who drives keeps away. */
struct Circle {
  Point centre;
  double reach_m;
};

/* Where a mover is between two knots: the centre of who drives keeps away, whatever the time. */
struct Swept {
  Point from, to;
  double reach_m;
};

/* What a robot that drives has to keep away from, as it is seen from its centre. */
class Ground {
public:
  Ground(const fleetyard::Workspace &space, double radius_m, std::vector<Circle> resting)
      : min_(space.min_m()), max_(space.max_m()), radius_m_(radius_m),
        resting_(std::move(resting)) {
    for (std::size_t at = 0; at < space.obstacles(); at++)
      obstacles_.push_back(space.obstacle(at));
    for (std::size_t at = 0; at < space.movers(); at++) {
      const fleetyard::Mover mover = space.mover(at);
      const double reach_m = radius_m + mover.footprint().radius_m();
      for (std::size_t knot = 0; knot < mover.knots(); knot++)
        movers_.push_back({position(mover.knot(knot)),
                           position(mover.knot(std::min(knot + 1, mover.knots() - 1))), reach_m});
    }
  }

  /* Whether the robot may drive straight from a point to another one. */
  bool is_free(Point a, Point b) const {
    return in_bounds(a) && in_bounds(b) &&
           std::all_of(resting_.begin(), resting_.end(),
                       [&](const Circle &circle) {
                         return from_segment(circle.centre, a, b) >= circle.reach_m;
                       }) &&
           std::all_of(movers_.begin(), movers_.end(),
                       [&](const Swept &swept) {
                         return between(a, b, swept.from, swept.to) >= swept.reach_m;
                       }) &&
           std::all_of(obstacles_.begin(), obstacles_.end(),
                       [&](const std::vector<Point> &polygon) { return is_past(polygon, a, b); });
  }

  /* A shortest way, found by A*; empty when there is none. */
  std::vector<Point> way(Point start, Point goal, const fleetyard::Sink &sink) const {
    std::vector<Point> points{start, goal};
    if (!is_free(start, goal)) { // else it needs no corners
      for (const auto &polygon : obstacles_)
        for (const Point corner : polygon)
          add_ring(points, {corner, radius_m_});
      for (const Circle &circle : resting_)
        add_ring(points, circle);
      for (const Swept &swept : movers_)
        for (const Point end : {swept.from, swept.to})
          add_ring(points, {end, swept.reach_m});
    }
    std::vector<double> length(points.size(), infinite);
    std::vector<std::size_t> before(points.size());
    std::vector<bool> done(points.size());
    length[0] = 0;
    for (;;) {
      sink.check(); // ends the call when its time is up
      std::size_t now = 0;
      double least = infinite;
      for (std::size_t at = 0; at < points.size(); at++)
        if (!done[at] && length[at] + distance(points[at], goal) < least)
          now = at, least = length[at] + distance(points[at], goal);
      if (!(least < infinite))
        return {};
      if (now == 1)
        break;
      done[now] = true;
      for (std::size_t at = 0; at < points.size(); at++) {
        const double through = length[now] + distance(points[now], points[at]);
        if (!done[at] && through < length[at] && is_free(points[now], points[at]))
          length[at] = through, before[at] = now;
      }
    }
    std::vector<Point> found{goal};
    for (std::size_t at = 1; at != 0; at = before[at])
      found.push_back(points[before[at]]);
    std::reverse(found.begin(), found.end());
    return found;
  }

private:
  bool in_bounds(Point p) const {
    return p.x_m - radius_m_ >= min_.x_m && p.x_m + radius_m_ <= max_.x_m &&
           p.y_m - radius_m_ >= min_.y_m && p.y_m + radius_m_ <= max_.y_m;
  }

  bool is_past(const std::vector<Point> &polygon, Point a, Point b) const {
    bool inside = false;
    for (std::size_t at = 0; at < polygon.size(); at++) {
      const Point c = polygon[at], d = polygon[(at + 1) % polygon.size()];
      if (between(a, b, c, d) < radius_m_)
        return false;
      if ((c.y_m > a.y_m) != (d.y_m > a.y_m) &&
          a.x_m < c.x_m + (a.y_m - c.y_m) / (d.y_m - c.y_m) * (d.x_m - c.x_m))
        inside = !inside;
    }
    return !inside;
  }

  /* Adds the corners of a polygon round a circle, where the robot may be. */
  void add_ring(std::vector<Point> &points, const Circle &circle) const {
    constexpr int corners = 12;
    const double turn = whole_turn / corners;
    const double reach = circle.reach_m * (1 + 1e-6) / std::cos(turn / 2);
    for (int i = 0; i < corners; i++) {
      const Point at{circle.centre.x_m + reach * std::cos(i * turn),
                     circle.centre.y_m + reach * std::sin(i * turn)};
      if (is_free(at, at))
        points.push_back(at);
    }
  }

  Point min_, max_;
  double radius_m_;
  std::vector<Circle> resting_;
  std::vector<std::vector<Point>> obstacles_;
  std::vector<Swept> movers_;
};

/* One robot after the other drives while the others rest. */
class InTurn : public fleetyard::Planner {
public:
  static constexpr auto id = "example-plugin";
  static constexpr auto version = "0.1.0";
  static constexpr auto description = "One robot after the other drives while the others rest.";
  /* What the host may ask of the planner; docs/conformance.md lists all there is. */
  static constexpr auto capabilities =
      fleetyard::capability::continuous | fleetyard::capability::dynamics |
      fleetyard::capability::heterogeneous | fleetyard::capability::deterministic;
  /* The models of robots that it knows: those that may set out and stop in no time. */
  static constexpr std::array<std::string_view, 1> features{
      "dynamics:fleetyard.single-integrator/1"};
  /* What `--option NAME=VALUE` may say. The host checks it before the planner starts. */
  static constexpr auto options_schema = R"({
    "type": "object",
    "additionalProperties": false,
    "properties": {
      "speed_m_per_s": {
        "type": "number",
        "exclusiveMinimum": 0,
        "default": 1,
        "description": "Speed of robots that have no limit."
      }
    }
  })";

  explicit InTurn(const fleetyard::Options &options)
      : speed_m_per_s_(options.number("speed_m_per_s")) {}

  void plan(const fleetyard::Instance &instance, const fleetyard::Budget &,
            const fleetyard::Sink &sink) override {
    const fleetyard::Workspace space = instance.workspace();
    const std::size_t agents = instance.agents();
    std::vector<std::vector<Knot>> paths(agents);
    for (std::size_t agent = 0; agent < agents; agent++)
      paths[agent].push_back(knot(0, instance.robot(agent), instance.start_state(agent)));
    std::vector<bool> there(agents);
    double time_s = 0;
    for (bool moving = true; moving;) {
      moving = false;
      for (std::size_t agent = 0; agent < agents; agent++) {
        if (there[agent])
          continue;
        const double radius_m = instance.robot(agent).footprint().radius_m();
        std::vector<Circle> resting;
        for (std::size_t other = 0; other < agents; other++)
          if (other != agent)
            resting.push_back({position(paths[other].back()),
                               radius_m + instance.robot(other).footprint().radius_m()});
        const auto goal = instance.goal_state(agent, 0);
        const auto way = Ground(space, radius_m, resting)
                             .way(position(paths[agent].back()), {goal[0], goal[1]}, sink);
        if (way.empty())
          continue;
        time_s = drive(paths[agent], way, instance.robot(agent), goal, time_s);
        there[agent] = moving = true;
      }
    }
    const auto left = std::count(there.begin(), there.end(), false);
    if (left > 0)
      throw fleetyard::Failure(fleetyard::Status::gave_up,
                               std::to_string(left) + " robots have no way past those that rest");
    sink.submit_plan(paths);
  }

private:
  static Knot knot(double time_s, const fleetyard::Robot &robot, fleetyard::Span<double> state) {
    Knot knot{time_s, state[0], state[1]};
    if (robot.has_heading() && state.size() > 2)
      knot.heading_rad = state[2];
    return knot;
  }

  /* The limit of one of a robot's controls in either direction; infinite without one. */
  static double limit(const fleetyard::Robot &robot, std::size_t control) {
    return control < robot.control_max().size()
               ? std::min(-robot.control_min()[control], robot.control_max()[control])
               : infinite;
  }

  /* Lets a robot drive a way and turn at its end; when it is there. */
  double drive(std::vector<Knot> &path, const std::vector<Point> &way,
               const fleetyard::Robot &robot, fleetyard::Span<double> goal, double time_s) const {
    const double most = std::min(limit(robot, 0), limit(robot, 1));
    const double speed_m_per_s = most < infinite ? most : speed_m_per_s_;
    Knot last = path.back();
    const auto go_on = [&](double seconds) {
      last.time_s = time_s += seconds;
      if (last.time_s > path.back().time_s)
        path.push_back(last);
    };
    go_on(0); // until now it has rested
    for (std::size_t at = 1; at < way.size(); at++) {
      last.x_m = way[at].x_m;
      last.y_m = way[at].y_m;
      go_on(distance(way[at - 1], way[at]) / speed_m_per_s);
    }
    const double turn_rad =
        std::remainder(knot(0, robot, goal).heading_rad - last.heading_rad, whole_turn);
    if (std::abs(turn_rad) > 0) { // not for a robot without a heading
      last.heading_rad += turn_rad;
      go_on(std::abs(turn_rad) / (limit(robot, 2) < infinite ? limit(robot, 2) : 1.0));
    }
    return time_s;
  }

  double speed_m_per_s_;
};

} // namespace

FLEETYARD_PLUGINS(InTurn);
