/* Prioritized planning on roadmaps over safe intervals, as a Fleetyard plugin in one C file.
 *
 * What it is: robots are planned one after the other, and each waits for those before it. In
 * `prepare` it finds out which edges and vertices come nearer to each other than robots may; a
 * stay on one then closes all that are near to it. The search is A* over the safe intervals of
 * vertices (Phillips and Likhachev, "SIPP: Safe Interval Path Planning for Dynamic Environments",
 * ICRA 2011). When a robot finds no path it goes first, and all are planned again.
 *
 * What it is not: complete or optimal; and it forbids more than it must, for a robot closes an
 * edge as a whole until it has driven it.
 *
 * Build: cc -std=c11 -O2 -fPIC -shared -fvisibility=hidden -I ABI/include
 *        -o roadmap_sipp.so roadmap_sipp.c -lm
 */

#include "fleetyard_easy.h"

#define NONE FLEETYARD_NONE

/* ---- What is near what: once per map ----------------------------------------- */

/* A lane is a vertex, or an edge: vertices come first. */
typedef struct {
  uint64_t restarts; /* at most so many; 0 for no limit */
  uint32_t lanes;
  uint32_t *from, *to;   /* vertices of a lane */
  uint64_t *near_begin;  /* `lanes + 1` offsets into `near_lanes` */
  uint32_t *near_lanes;  /* the lanes near each, itself among them */
} Planner;

static double from_line(const FleetyardRoadmap *map, uint32_t point, uint32_t a, uint32_t b) {
  double ax = map->x_m[a], ay = map->y_m[a], dx = map->x_m[b] - ax, dy = map->y_m[b] - ay;
  double px = map->x_m[point] - ax, py = map->y_m[point] - ay, length = dx * dx + dy * dy;
  double along = length > 0 ? (px * dx + py * dy) / length : 0;
  along = along < 0 ? 0 : along > 1 ? 1 : along;
  return hypot(px - along * dx, py - along * dy);
}

/* The side of the line from `a` to `b` on which a vertex lies, by its sign. */
static double side(const FleetyardRoadmap *map, uint32_t a, uint32_t b, uint32_t vertex) {
  return (map->x_m[b] - map->x_m[a]) * (map->y_m[vertex] - map->y_m[a]) -
         (map->y_m[b] - map->y_m[a]) * (map->x_m[vertex] - map->x_m[a]);
}

static bool is_near(const FleetyardRoadmap *map, const Planner *planner, uint32_t one,
                    uint32_t other) {
  uint32_t a = planner->from[one], b = planner->to[one];
  uint32_t c = planner->from[other], d = planner->to[other];
  double least = map->separation_m;
  bool cross = side(map, a, b, c) * side(map, a, b, d) < 0 &&
               side(map, c, d, a) * side(map, c, d, b) < 0;
  return one == other || cross || from_line(map, a, c, d) < least ||
         from_line(map, b, c, d) < least || from_line(map, c, a, b) < least ||
         from_line(map, d, a, b) < least;
}

/* A lane by the least of its x. */
typedef struct {
  double least_m, most_m;
  uint32_t lane;
} Extent;

static int compare_extents(const void *left, const void *right) {
  const Extent *a = left, *b = right;
  return a->least_m < b->least_m ? -1 : a->least_m > b->least_m;
}

static void forget(Planner *planner) {
  free(planner->from), free(planner->to), free(planner->near_begin), free(planner->near_lanes);
  planner->from = planner->to = planner->near_lanes = NULL;
  planner->near_begin = NULL;
}

static int32_t prepare(void *context, const FleetyardEnvironment *environment,
                       const FleetyardBudget *budget, const FleetyardSink *sink) {
  Planner *planner = context;
  const FleetyardRoadmap *map = fleetyard_roadmap(environment, sink);
  int32_t status = FLEETYARD_STATUS_SOLVED;
  if (map->vertices + map->edges >= NONE)
    return fleetyard_fail(sink, FLEETYARD_STATUS_UNSUPPORTED, "the roadmap has too many edges");
  forget(planner);
  uint32_t lanes = planner->lanes = (uint32_t)(map->vertices + map->edges);
  planner->from = fleetyard_array(lanes, sizeof *planner->from);
  planner->to = fleetyard_array(lanes, sizeof *planner->to);
  planner->near_begin = fleetyard_array((size_t)lanes + 1, sizeof *planner->near_begin);
  Extent *extents = fleetyard_array(lanes, sizeof *extents);
  for (uint32_t vertex = 0; vertex < map->vertices; vertex++) {
    planner->from[vertex] = planner->to[vertex] = vertex;
    for (uint64_t edge = map->edge_offsets[vertex]; edge < map->edge_offsets[vertex + 1]; edge++) {
      planner->from[map->vertices + edge] = vertex;
      planner->to[map->vertices + edge] = map->targets[edge];
    }
  }
  for (uint32_t lane = 0; lane < lanes; lane++) {
    double a = map->x_m[planner->from[lane]], b = map->x_m[planner->to[lane]];
    extents[lane] = (Extent){fmin(a, b), fmax(a, b), lane};
  }
  /* From left to right, a lane is compared with those that begin before it ends; first they are
   * counted, then written. */
  qsort(extents, lanes, sizeof *extents, compare_extents);
  uint64_t *filled = fleetyard_array(lanes, sizeof *filled);
  for (int writing = 0; writing < 2 && status == FLEETYARD_STATUS_SOLVED; writing++) {
    for (uint32_t i = 0; i < lanes && status == FLEETYARD_STATUS_SOLVED; i++) {
      for (uint32_t j = i;
           j < lanes && extents[j].least_m <= extents[i].most_m + map->separation_m; j++) {
        uint32_t one = extents[i].lane, other = extents[j].lane;
        if (!is_near(map, planner, one, other))
          continue;
        if (writing) {
          planner->near_lanes[planner->near_begin[one] + filled[one]++] = other;
          if (one != other)
            planner->near_lanes[planner->near_begin[other] + filled[other]++] = one;
        } else {
          planner->near_begin[one + 1]++;
          planner->near_begin[other + 1] += one != other;
        }
      }
      if (i % 64 == 0 && fleetyard_cancelled(sink))
        status = fleetyard_time_is_up(budget, sink);
    }
    for (uint32_t lane = 0; lane < lanes && !writing; lane++)
      planner->near_begin[lane + 1] += planner->near_begin[lane];
    if (!writing)
      planner->near_lanes =
          fleetyard_array((size_t)planner->near_begin[lanes], sizeof *planner->near_lanes);
  }
  free(extents), free(filled);
  return status;
}

/* ---- When lanes are closed ---------------------------------------------------- */

typedef struct {
  double begin_s, end_s;
} Stay;

/* The times at which somebody is near a lane, in no order. */
typedef struct {
  Stay *stays;
  uint64_t count, room;
} Closed;

static void reserve(const Planner *planner, Closed *closed, uint32_t lane, double begin_s,
                    double end_s) {
  for (uint64_t i = planner->near_begin[lane]; i < planner->near_begin[lane + 1]; i++) {
    Closed *near = &closed[planner->near_lanes[i]];
    uint64_t room = fleetyard_more_room(near->room, near->count + 1);
    near->stays = fleetyard_grown(near->stays, near->room, room, sizeof *near->stays);
    near->room = room;
    near->stays[near->count++] = (Stay){begin_s, end_s};
  }
}

/* The end of a stay that is in the way, or `begin_s`. */
static double blocked(const Closed *lane, double begin_s, double end_s) {
  double until_s = begin_s;
  for (uint64_t i = 0; i < lane->count; i++)
    if (lane->stays[i].begin_s < end_s && begin_s < lane->stays[i].end_s)
      until_s = fmax(until_s, lane->stays[i].end_s);
  return until_s;
}

/* The number of stays that are over, which is that of a safe interval; and when the next ends. */
static uint64_t interval(const Closed *lane, double time_s, double *next_s) {
  uint64_t over = 0;
  *next_s = INFINITY;
  for (uint64_t i = 0; i < lane->count; i++)
    if (lane->stays[i].end_s <= time_s)
      over++;
    else
      *next_s = fmin(*next_s, lane->stays[i].end_s);
  return over;
}

/* ---- Searching ---------------------------------------------------------------- */

/* A robot can be on a vertex from a time on. */
typedef struct {
  double least_s; /* least time of arrival at the goal by way of it */
  double departure_s, arrival_s;
  uint64_t interval;
  uint32_t vertex, before, edge;
  bool done;
} Node;

typedef struct {
  const Planner *planner;
  const FleetyardInstance *instance;
  const FleetyardRoadmap *map;
  const FleetyardSink *sink;
  Closed *closed;
  double *to_goal_s; /* per vertex, when nobody is in the way */
  Node *nodes;
  uint64_t room, expansions;
  uint32_t count, heap_count;
  uint32_t *heap; /* open nodes by `least_s` */
} Work;

static bool is_before(const Work *work, uint32_t a, uint32_t b) {
  return work->nodes[a].least_s < work->nodes[b].least_s;
}

static void push(Work *work, Node node) {
  uint64_t room = fleetyard_more_room(work->room, (uint64_t)work->count + 1);
  work->nodes = fleetyard_grown(work->nodes, work->room, room, sizeof *work->nodes);
  work->heap = fleetyard_grown(work->heap, work->room, room, sizeof *work->heap);
  work->room = room;
  work->nodes[work->count] = node;
  uint32_t at = work->heap_count++;
  for (; at > 0 && is_before(work, work->count, work->heap[(at - 1) / 2]); at = (at - 1) / 2)
    work->heap[at] = work->heap[(at - 1) / 2];
  work->heap[at] = work->count++;
}

static uint32_t pop(Work *work) {
  uint32_t first = work->heap[0], last = work->heap[--work->heap_count], at = 0;
  for (;;) {
    uint32_t child = 2 * at + 1;
    if (child + 1 < work->heap_count &&
        is_before(work, work->heap[child + 1], work->heap[child]))
      child++;
    if (child >= work->heap_count || !is_before(work, work->heap[child], last))
      break;
    work->heap[at] = work->heap[child];
    at = child;
  }
  work->heap[at] = last;
  return first;
}

/* Times to a goal by relaxing edges until nothing changes, for a graph that may be one-way. */
static void learn_goal(Work *work, uint32_t goal) {
  for (uint32_t vertex = 0; vertex < work->map->vertices; vertex++)
    work->to_goal_s[vertex] = vertex == goal ? 0 : INFINITY;
  for (bool changed = true; changed && !fleetyard_cancelled(work->sink);) {
    changed = false;
    for (uint32_t vertex = 0; vertex < work->map->vertices; vertex++)
      for (uint64_t edge = work->map->edge_offsets[vertex];
           edge < work->map->edge_offsets[vertex + 1]; edge++) {
        double by_s = work->map->duration_s[edge] + work->to_goal_s[work->map->targets[edge]];
        if (by_s < work->to_goal_s[vertex]) {
          work->to_goal_s[vertex] = by_s;
          changed = true;
        }
      }
  }
}

/* Adds the nodes that one edge leads to: one for each safe interval at its end, reached as early
 * as possible. The robot waits while its vertex is free. */
static void follow(Work *work, uint32_t now, uint64_t edge) {
  const FleetyardRoadmap *map = work->map;
  Node node = work->nodes[now];
  uint32_t to = map->targets[edge];
  const Closed *here = &work->closed[node.vertex], *lane = &work->closed[map->vertices + edge];
  double departure_s = node.arrival_s;
  while (!isinf(departure_s) && !(blocked(here, node.arrival_s, departure_s) > node.arrival_s)) {
    double arrival_s = departure_s + map->duration_s[edge], next_s;
    double free_s = blocked(lane, departure_s, arrival_s);
    if (free_s > departure_s) {
      departure_s = free_s;
      continue;
    }
    uint64_t safe = interval(&work->closed[to], arrival_s, &next_s);
    if (!isinf(work->to_goal_s[to]))
      push(work, (Node){arrival_s + work->to_goal_s[to], departure_s, arrival_s, safe, to, now,
                        (uint32_t)edge, false});
    departure_s = next_s; /* whatever is near the end of an edge is near the edge */
  }
}

/* The last node of an earliest path that comes near none of the others, or NONE. */
static uint32_t find_path(Work *work, uint32_t agent) {
  uint32_t start = work->instance->starts[agent];
  uint32_t goal = work->instance->goals[work->instance->goal_offsets[agent]];
  double next_s;
  learn_goal(work, goal);
  work->count = work->heap_count = 0;
  if (!isinf(work->to_goal_s[start]))
    push(work, (Node){work->to_goal_s[start], 0, 0,
                      interval(&work->closed[start], 0, &next_s), start, NONE, 0, false});
  while (work->heap_count > 0 && !fleetyard_cancelled(work->sink)) {
    uint32_t now = pop(work);
    Node *node = &work->nodes[now];
    bool known = false; /* somebody was in this interval earlier */
    for (uint32_t i = 0; i < work->count && !known; i++)
      known = work->nodes[i].done && work->nodes[i].vertex == node->vertex &&
              work->nodes[i].interval == node->interval;
    if (known)
      continue;
    node->done = true;
    work->expansions++;
    if (node->vertex == goal &&
        !(blocked(&work->closed[goal], node->arrival_s, INFINITY) > node->arrival_s))
      return now; /* it may stay for good */
    uint32_t vertex = node->vertex;
    for (uint64_t edge = work->map->edge_offsets[vertex];
         edge < work->map->edge_offsets[vertex + 1]; edge++)
      follow(work, now, edge);
  }
  return NONE;
}

/* Writes a path down, from its end, and closes what is near to it. */
static void take(Work *work, uint32_t last, uint32_t agent, FleetyardPaths *paths) {
  uint32_t *way = fleetyard_array(work->count, sizeof *way), length = 0;
  for (uint32_t at = last; at != NONE; at = work->nodes[at].before)
    way[length++] = at;
  while (length-- > 0) {
    const Node *node = &work->nodes[way[length]];
    const Node *next = length > 0 ? &work->nodes[way[length - 1]] : NULL;
    if (next)
      reserve(work->planner, work->closed, work->map->vertices + next->edge, next->departure_s,
              next->arrival_s);
    reserve(work->planner, work->closed, node->vertex, node->arrival_s,
            next ? next->departure_s : INFINITY);
    fleetyard_add_visit(paths, agent, node->vertex, node->arrival_s,
                        next ? next->departure_s : node->arrival_s);
  }
  free(way);
}

static int32_t plan(void *context, const FleetyardInstance *instance,
                    const FleetyardBudget *budget, const FleetyardSink *sink) {
  const Planner *planner = context;
  const FleetyardRoadmap *map = fleetyard_roadmap(instance->environment, sink);
  uint32_t agents = instance->agents;
  uint64_t restarts = 0;
  int32_t status = FLEETYARD_STATUS_GAVE_UP;
  Work work = {.planner = planner, .instance = instance, .map = map, .sink = sink};
  work.closed = fleetyard_array(planner->lanes, sizeof *work.closed);
  work.to_goal_s = fleetyard_array(map->vertices, sizeof *work.to_goal_s);
  uint32_t *order = fleetyard_array(agents, sizeof *order);
  FleetyardPaths paths = fleetyard_paths(FLEETYARD_FORM_VISITS, agents);
  for (uint32_t i = 0; i < agents; i++)
    order[i] = i;
  for (;; restarts++) {
    uint32_t planned = 0, last = 0;
    fleetyard_clear_paths(&paths);
    for (uint32_t lane = 0; lane < planner->lanes; lane++)
      work.closed[lane].count = 0;
    for (; planned < agents && last != NONE; planned += last != NONE) {
      last = find_path(&work, order[planned]);
      if (last != NONE)
        take(&work, last, order[planned], &paths);
    }
    if (planned == agents)
      status = fleetyard_submit(&paths, sink);
    else if (fleetyard_cancelled(sink))
      status = fleetyard_time_is_up(budget, sink);
    else if (planned == 0)
      status = fleetyard_fail(sink, FLEETYARD_STATUS_INFEASIBLE,
                              "no path leads robot %" PRIu32 " to its goal", order[0]);
    else if (planner->restarts && restarts >= planner->restarts)
      fleetyard_fail(sink, status, "no order of %" PRIu64 " worked", restarts + 1);
    else {
      uint32_t failed = order[planned];
      memmove(order + planned, order + planned + 1, (agents - planned - 1) * sizeof *order);
      order[agents - 1] = order[0];
      order[0] = failed;
      continue;
    }
    break;
  }
  fleetyard_metric(sink, "expansions", (double)work.expansions);
  fleetyard_metric(sink, "restarts", (double)restarts);
  for (uint32_t lane = 0; lane < planner->lanes; lane++)
    free(work.closed[lane].stays);
  fleetyard_free_paths(&paths);
  free(work.closed), free(work.to_goal_s), free(work.nodes), free(work.heap), free(order);
  return status;
}

/* ---- What the library exports ------------------------------------------------ */

static const FleetyardDescriptor roadmap_sipp = {
    .struct_size = sizeof(FleetyardDescriptor),
    .id = FLEETYARD_TEXT("roadmap-sipp"),
    .name = FLEETYARD_TEXT("Prioritized planning on roadmaps (C example)"),
    .version = FLEETYARD_TEXT("0.1.0"),
    .description = FLEETYARD_TEXT(
        "Plans robots one after the other over safe intervals of a roadmap (Phillips and "
        "Likhachev 2011), in other orders when one finds no path."),
    .license = FLEETYARD_TEXT("MIT OR Apache-2.0"),
    .options_schema = FLEETYARD_TEXT(
        "{\"type\":\"object\",\"additionalProperties\":false,\"properties\":{"
        "\"restarts\":{\"type\":\"integer\",\"minimum\":0,\"default\":100,"
        "\"description\":\"Most orders to try after the first; 0 for as many as the budget "
        "allows.\"}}}"),
    .capabilities = FLEETYARD_CAPABILITY_ROADMAP | FLEETYARD_CAPABILITY_STOP_GO |
                    FLEETYARD_CAPABILITY_SLOWER | FLEETYARD_CAPABILITY_HETEROGENEOUS |
                    FLEETYARD_CAPABILITY_DETERMINISTIC,
};

static void *make(const FleetyardOptions *options, const FleetyardSink *sink) {
  Planner *planner = fleetyard_array(1, sizeof *planner);
  (void)sink;
  planner->restarts = (uint64_t)fleetyard_number(options, "restarts", 100);
  return planner;
}

static void end(void *context) {
  forget(context);
  free(context);
}

FLEETYARD_EXPORT_PLANNER(roadmap_sipp, make, prepare, plan, end);
