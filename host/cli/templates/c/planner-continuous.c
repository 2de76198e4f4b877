/* One robot after the other drives to its goal while all others rest.
 *
 * A robot goes a shortest way past the corners of obstacles and past robots that rest, in a
 * visibility graph (Lozano-Perez and Wesley, "An Algorithm for Planning Collision-Free Paths Among
 * Polyhedral Obstacles", CACM 1979). Its enclosing circle stands for it. Simple and slow, for
 * nobody drives beside another. Put your own algorithm into `plan`.
 */

#include "fleetyard_easy.h"

typedef struct {
  double speed_m_per_s;
} Planner;

typedef struct {
  double x, y;
} Point;

/* What a robot that drives has to keep away from, as it is seen from its centre. */
typedef struct {
  const FleetyardWorkspace *space;
  double radius_m;
  const Point *resting; /* centres of the others */
  const double *reach;  /* how far the centre stays from each; 0 for itself */
  uint32_t robots;
} Ground;

/* Corners that a way may have. */
typedef struct {
  Point at;
  uint32_t before;
  double way_m;
  bool done;
} Node;

typedef struct {
  Node *list;
  uint64_t room;
  uint32_t count;
} Nodes;

static double distance(Point a, Point b) { return hypot(a.x - b.x, a.y - b.y); }

static Point corner(const FleetyardWorkspace *space, uint64_t at) {
  return (Point){space->x_m[at], space->y_m[at]};
}

/* The distance of a point from a segment. */
static double from_segment(Point p, Point a, Point b) {
  double dx = b.x - a.x, dy = b.y - a.y, length = dx * dx + dy * dy;
  double along = length > 0 ? ((p.x - a.x) * dx + (p.y - a.y) * dy) / length : 0;
  along = along < 0 ? 0 : along > 1 ? 1 : along;
  return distance(p, (Point){a.x + along * dx, a.y + along * dy});
}

/* The side of the line from `a` to `b` on which a point lies, by its sign. */
static double side(Point a, Point b, Point p) {
  return (b.x - a.x) * (p.y - a.y) - (b.y - a.y) * (p.x - a.x);
}

static bool keeps_away(Point a, Point b, Point c, Point d, double away_m) {
  bool cross = side(a, b, c) * side(a, b, d) < 0 && side(c, d, a) * side(c, d, b) < 0;
  return !cross && from_segment(a, c, d) >= away_m && from_segment(b, c, d) >= away_m &&
         from_segment(c, a, b) >= away_m && from_segment(d, a, b) >= away_m;
}

static bool in_bounds(const Ground *ground, Point p) {
  const FleetyardWorkspace *space = ground->space;
  double radius_m = ground->radius_m;
  return p.x - radius_m >= space->min_x_m && p.x + radius_m <= space->max_x_m &&
         p.y - radius_m >= space->min_y_m && p.y + radius_m <= space->max_y_m;
}

/* Whether the robot may drive straight from a point to another one. */
static bool is_free(const Ground *ground, Point a, Point b) {
  const FleetyardWorkspace *space = ground->space;
  if (!in_bounds(ground, a) || !in_bounds(ground, b))
    return false;
  for (uint32_t robot = 0; robot < ground->robots; robot++)
    if (from_segment(ground->resting[robot], a, b) < ground->reach[robot])
      return false;
  for (uint64_t i = 0; i < space->mover_count; i++) { /* away from wherever it may ever be */
    const FleetyardMover *mover = space->movers[i];
    double away_m = ground->radius_m + mover->footprint->radius_m;
    for (uint32_t knot = 0; knot < mover->knots; knot++) {
      uint32_t next = knot + 1 < mover->knots ? knot + 1 : knot;
      Point c = {mover->x_m[knot], mover->y_m[knot]}, d = {mover->x_m[next], mover->y_m[next]};
      if (!keeps_away(a, b, c, d, away_m))
        return false;
    }
  }
  for (uint32_t i = 0; i < space->obstacles; i++) {
    uint64_t begin = space->corner_offsets[i], end = space->corner_offsets[i + 1];
    bool inside = false;
    for (uint64_t at = begin; at < end; at++) {
      Point c = corner(space, at), d = corner(space, at + 1 < end ? at + 1 : begin);
      if (!keeps_away(a, b, c, d, ground->radius_m))
        return false;
      if ((c.y > a.y) != (d.y > a.y) && a.x < c.x + (a.y - c.y) / (d.y - c.y) * (d.x - c.x))
        inside = !inside;
    }
    if (inside)
      return false;
  }
  return true;
}

static void add(Nodes *nodes, Point at) {
  uint64_t room = fleetyard_more_room(nodes->room, (uint64_t)nodes->count + 1);
  nodes->list = fleetyard_grown(nodes->list, nodes->room, room, sizeof *nodes->list);
  nodes->room = room;
  nodes->list[nodes->count++] = (Node){at, FLEETYARD_NONE, INFINITY, false};
}

/* Adds the corners of a polygon round a circle, where the robot may be. */
static void add_ring(Nodes *nodes, const Ground *ground, Point centre, double radius_m) {
  enum { CORNERS = 12 };
  const double turn = 6.283185307179586 / CORNERS;
  double reach = radius_m * (1 + 1e-6) / cos(turn / 2);
  for (int i = 0; i < CORNERS; i++) {
    Point at = {centre.x + reach * cos(i * turn), centre.y + reach * sin(i * turn)};
    if (is_free(ground, at, at))
      add(nodes, at);
  }
}

/* Finds a shortest way by A*: the goal is node 1, and the start node 0. */
static bool find_way(Nodes *nodes, const Ground *ground, Point start, Point goal,
                     const FleetyardSink *sink) {
  nodes->count = 0;
  add(nodes, start);
  add(nodes, goal);
  nodes->list[0].way_m = 0;
  if (!is_free(ground, start, goal)) { /* else it needs no corners */
    for (uint64_t at = 0; at < ground->space->corner_offsets[ground->space->obstacles]; at++)
      add_ring(nodes, ground, corner(ground->space, at), ground->radius_m);
    for (uint64_t i = 0; i < ground->space->mover_count; i++) {
      const FleetyardMover *mover = ground->space->movers[i];
      for (uint32_t knot = 0; knot < mover->knots; knot++)
        add_ring(nodes, ground, (Point){mover->x_m[knot], mover->y_m[knot]},
                 ground->radius_m + mover->footprint->radius_m);
    }
    for (uint32_t robot = 0; robot < ground->robots; robot++)
      if (ground->reach[robot] > 0)
        add_ring(nodes, ground, ground->resting[robot], ground->reach[robot]);
  }
  while (!fleetyard_cancelled(sink)) {
    uint32_t now = FLEETYARD_NONE;
    double least = INFINITY;
    for (uint32_t i = 0; i < nodes->count; i++) {
      double through = nodes->list[i].way_m + distance(nodes->list[i].at, goal);
      if (!nodes->list[i].done && through < least)
        now = i, least = through;
    }
    if (now == 1 || now == FLEETYARD_NONE)
      return now == 1;
    nodes->list[now].done = true;
    for (uint32_t i = 0; i < nodes->count; i++) {
      Node *node = &nodes->list[i];
      double way_m = nodes->list[now].way_m + distance(nodes->list[now].at, node->at);
      if (!node->done && way_m < node->way_m && is_free(ground, nodes->list[now].at, node->at))
        node->way_m = way_m, node->before = now;
    }
  }
  return false;
}

/* The speed that a robot may have in any direction: the least limit of its first two controls. */
static double speed(const FleetyardRobot *robot, double otherwise) {
  double least = INFINITY;
  for (uint32_t i = 0; i < 2 && i < robot->control_size; i++)
    least = fmin(least, fmin(-robot->control_min[i], robot->control_max[i]));
  return isinf(least) ? otherwise : least;
}

static double heading(const FleetyardRobot *robot, const double *state) {
  return (robot->flags & FLEETYARD_ROBOT_HEADING) != 0 ? state[2] : NAN;
}

/* Lets a robot drive the way that was found, and turn at its end; when it is there. */
static double drive(FleetyardPaths *paths, const Nodes *nodes, const FleetyardInstance *instance,
                    uint32_t agent, double time_s, double fastest) {
  const FleetyardRobot *robot = fleetyard_robot(instance, agent);
  const double *start = instance->start_states + instance->start_state_offsets[agent];
  const double *goal = instance->goal_states +
                       instance->goal_state_offsets[instance->goal_offsets[agent]];
  double from_rad = heading(robot, start), to_rad = heading(robot, goal);
  double speed_m_per_s = speed(robot, fastest), begin_s = time_s;
  uint32_t *way = fleetyard_array(nodes->count, sizeof *way), length = 0;
  for (uint32_t node = 1; node != 0; node = nodes->list[node].before)
    way[length++] = node;
  if (time_s > 0)
    fleetyard_add_knot(paths, agent, time_s, start[0], start[1], from_rad);
  while (length > 0) {
    const Node *node = &nodes->list[way[--length]];
    if (begin_s + node->way_m / speed_m_per_s > time_s) {
      time_s = begin_s + node->way_m / speed_m_per_s;
      fleetyard_add_knot(paths, agent, time_s, node->at.x, node->at.y, from_rad);
    }
  }
  free(way);
  double turn_rad = remainder(to_rad - from_rad, 6.283185307179586);
  if (fabs(turn_rad) > 0) { /* not for a robot without a heading */
    bool limited = robot->control_size > 2 && !isinf(robot->control_max[2]);
    time_s += fabs(turn_rad) / (limited ? fmin(-robot->control_min[2], robot->control_max[2]) : 1);
    fleetyard_add_knot(paths, agent, time_s, goal[0], goal[1], from_rad + turn_rad);
  }
  return time_s;
}

static int32_t plan(void *context, const FleetyardInstance *instance,
                    const FleetyardBudget *budget, const FleetyardSink *sink) {
  const FleetyardWorkspace *space = fleetyard_workspace(instance->environment, sink);
  uint32_t agents = instance->agents, left = agents;
  Point *at = fleetyard_array(agents, sizeof *at);
  double *reach = fleetyard_array(agents, sizeof *reach), time_s = 0;
  bool *there = fleetyard_array(agents, sizeof *there), moving = true;
  Nodes nodes = {NULL, 0, 0};
  FleetyardPaths paths = fleetyard_paths(FLEETYARD_FORM_TRAJECTORIES, agents);
  for (uint32_t agent = 0; agent < agents; agent++) {
    const double *start = instance->start_states + instance->start_state_offsets[agent];
    at[agent] = (Point){start[0], start[1]};
    fleetyard_add_knot(&paths, agent, 0, start[0], start[1],
                       heading(fleetyard_robot(instance, agent), start));
  }
  while (moving && left > 0) {
    moving = false;
    for (uint32_t agent = 0; agent < agents && !fleetyard_cancelled(sink); agent++) {
      double radius_m = fleetyard_robot(instance, agent)->footprint->radius_m;
      const double *goal = instance->goal_states +
                           instance->goal_state_offsets[instance->goal_offsets[agent]];
      Point end = {goal[0], goal[1]};
      for (uint32_t i = 0; i < agents; i++)
        reach[i] = i == agent ? 0
                              : radius_m + fleetyard_robot(instance, i)->footprint->radius_m;
      Ground ground = {space, radius_m, at, reach, agents};
      if (there[agent] || !find_way(&nodes, &ground, at[agent], end, sink))
        continue;
      time_s = drive(&paths, &nodes, instance, agent, time_s,
                     ((const Planner *)context)->speed_m_per_s);
      at[agent] = end;
      there[agent] = moving = true;
      left--;
    }
  }
  int32_t status = left == 0 ? fleetyard_submit(&paths, sink)
                   : fleetyard_cancelled(sink)
                       ? fleetyard_time_is_up(budget, sink)
                       : fleetyard_fail(sink, FLEETYARD_STATUS_GAVE_UP,
                                        "%" PRIu32 " robots have no way past those that rest",
                                        left);
  fleetyard_free_paths(&paths);
  free(nodes.list), free(at), free(reach), free(there);
  return status;
}

/* ---- What the library exports ---------------------------------------------- */

/* The models of robots that the planner knows: those that may set out and stop in no time. */
static const FleetyardStr features[] = {FLEETYARD_TEXT("dynamics:fleetyard.single-integrator/1")};

/* What the host knows of the planner; docs/conformance.md lists all capabilities. The
 * schema says what `--option NAME=VALUE` may be; the host checks it beforehand. */
static const FleetyardDescriptor about = {
    .struct_size = sizeof about,
    .feature_count = 1,
    .id = FLEETYARD_TEXT("example-plugin"),
    .name = FLEETYARD_TEXT("example-plugin"),
    .version = FLEETYARD_TEXT("0.1.0"),
    .description = FLEETYARD_TEXT("One robot after the other drives while the others rest."),
    .options_schema = FLEETYARD_TEXT(
        "{\"type\": \"object\", \"additionalProperties\": false, \"properties\": {"
        "\"speed_m_per_s\": {\"type\": \"number\", \"exclusiveMinimum\": 0, \"default\": 1,"
        "\"description\": \"Speed of robots that have no limit.\"}}}"),
    .capabilities = FLEETYARD_CAPABILITY_CONTINUOUS | FLEETYARD_CAPABILITY_DYNAMICS |
                    FLEETYARD_CAPABILITY_HETEROGENEOUS | FLEETYARD_CAPABILITY_DETERMINISTIC,
    .features = features,
};

static void *make(const FleetyardOptions *options, const FleetyardSink *sink) {
  Planner *planner = fleetyard_array(1, sizeof *planner);
  (void)sink;
  planner->speed_m_per_s = fleetyard_number(options, "speed_m_per_s", 1);
  return planner;
}

FLEETYARD_EXPORT_PLANNER(about, make, fleetyard_learn_nothing, plan, free);
