/* Prioritized planning on a roadmap: robots plan one after the other, and each keeps its distance
 * from those before it by waiting.
 *
 * While a robot drives an edge, nobody comes nearer to any point of the edge than the separation;
 * while it stands on a vertex, nobody comes nearer to that. This is safe and simple, and forbids
 * more than it must. The search is over safe intervals of vertices (Phillips and Likhachev, "SIPP:
 * Safe Interval Path Planning for Dynamic Environments", ICRA 2011). Neither complete nor optimal.
 * Put your own algorithm into `plan`.
 */

#include "fleetyard_easy.h"

typedef struct {
  uint32_t attempts;
} Planner;

/* A robot is somewhere between two vertices, or on one, for a while: nobody else comes near. */
typedef struct {
  uint32_t from, to;
  double begin_s, end_s;
} Stay;

/* A robot can be on a vertex from a time on. */
typedef struct {
  uint32_t vertex, before;       /* the node that it comes from; NONE for the start */
  double departure_s, arrival_s; /* from there and here */
  bool done;
} Node;

typedef struct {
  const FleetyardRoadmap *roadmap;
  Stay *stays; /* of the robots that have been planned */
  uint64_t count, room;
} Table;

/* The distance of a point from the straight line between two vertices. */
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

/* Whether somewhere between `a` and `b` is too near to somewhere between `c` and `d`. */
static bool is_near(const FleetyardRoadmap *map, uint32_t a, uint32_t b, uint32_t c, uint32_t d) {
  bool cross = side(map, a, b, c) * side(map, a, b, d) < 0 &&
               side(map, c, d, a) * side(map, c, d, b) < 0;
  return cross || from_line(map, a, c, d) < map->separation_m ||
         from_line(map, b, c, d) < map->separation_m || from_line(map, c, a, b) < map->separation_m ||
         from_line(map, d, a, b) < map->separation_m;
}

/* The end of a stay that forbids to be between two vertices in a time, or `begin_s`. */
static double forbidden(const Table *table, uint32_t from, uint32_t to, double begin_s,
                        double end_s) {
  for (uint64_t i = 0; i < table->count; i++) {
    const Stay *stay = &table->stays[i];
    if (stay->begin_s < end_s && begin_s < stay->end_s &&
        is_near(table->roadmap, from, to, stay->from, stay->to))
      return stay->end_s;
  }
  return begin_s;
}

/* The number of stays near a vertex that are over: it is the number of a safe interval. */
static uint64_t interval(const Table *table, uint32_t vertex, double time_s) {
  uint64_t over = 0;
  for (uint64_t i = 0; i < table->count; i++)
    over += table->stays[i].end_s <= time_s && is_near(table->roadmap, vertex, vertex,
                                                       table->stays[i].from, table->stays[i].to);
  return over;
}

static void reserve(Table *table, uint32_t from, uint32_t to, double begin_s, double end_s) {
  uint64_t room = fleetyard_more_room(table->room, table->count + 1);
  table->stays = fleetyard_grown(table->stays, table->room, room, sizeof *table->stays);
  table->room = room;
  table->stays[table->count++] = (Stay){from, to, begin_s, end_s};
}

/* Writes down the visits up to a node, and keeps the others away from them. */
static void take(Table *table, const Node *nodes, uint32_t last, uint32_t agent,
                 FleetyardPaths *paths) {
  uint32_t length = 0, at = last;
  for (uint32_t node = last; node != FLEETYARD_NONE; node = nodes[node].before)
    length++;
  uint32_t *way = fleetyard_array(length, sizeof *way);
  for (uint32_t i = length; i > 0; at = nodes[at].before)
    way[--i] = at;
  for (uint32_t i = 0; i < length; i++) {
    const Node *node = &nodes[way[i]], *next = i + 1 < length ? &nodes[way[i + 1]] : NULL;
    if (next)
      reserve(table, node->vertex, next->vertex, next->departure_s, next->arrival_s);
    reserve(table, node->vertex, node->vertex, node->arrival_s,
            next ? next->departure_s : INFINITY); /* at its goal it stays for good */
    fleetyard_add_visit(paths, agent, node->vertex, node->arrival_s,
                        next ? next->departure_s : node->arrival_s);
  }
  free(way);
}

/* Adds an earliest path of an agent that comes near none of the others, if there is one. */
static bool find_path(Table *table, const FleetyardInstance *instance, uint32_t agent,
                      FleetyardPaths *paths, const FleetyardSink *sink) {
  const FleetyardRoadmap *map = table->roadmap;
  uint32_t goal = instance->goals[instance->goal_offsets[agent]], count = 1, last = FLEETYARD_NONE;
  uint64_t room = 64;
  Node *nodes = fleetyard_array(room, sizeof *nodes);
  nodes[0] = (Node){instance->starts[agent], FLEETYARD_NONE, 0, 0, false};
  for (;;) {
    uint32_t now = FLEETYARD_NONE; /* the earliest node that is not done */
    for (uint32_t i = 0; i < count; i++)
      if (!nodes[i].done && (now == FLEETYARD_NONE || nodes[i].arrival_s < nodes[now].arrival_s))
        now = i;
    if (now == FLEETYARD_NONE || fleetyard_cancelled(sink))
      break;
    uint32_t vertex = nodes[now].vertex;
    double arrival_s = nodes[now].arrival_s;
    nodes[now].done = true;
    if (vertex == goal && !(forbidden(table, goal, goal, arrival_s, INFINITY) > arrival_s)) {
      last = now; /* it may stay for good */
      break;
    }
    for (uint64_t edge = map->edge_offsets[vertex]; edge < map->edge_offsets[vertex + 1]; edge++)
      /* It waits until the edge is free, as long as the vertex is. */
      for (double departure_s = arrival_s;
           !(forbidden(table, vertex, vertex, arrival_s, departure_s) > arrival_s);) {
        uint32_t to = map->targets[edge];
        double arrives_s = departure_s + map->duration_s[edge];
        double free_s = forbidden(table, vertex, to, departure_s, arrives_s);
        bool known = free_s > departure_s;
        uint64_t safe = known ? 0 : interval(table, to, arrives_s);
        for (uint32_t i = 0; i < count && !known; i++)
          known = nodes[i].vertex == to && !(nodes[i].arrival_s > arrives_s) &&
                  interval(table, to, nodes[i].arrival_s) == safe;
        if (!known) {
          uint64_t larger = fleetyard_more_room(room, (uint64_t)count + 1);
          nodes = fleetyard_grown(nodes, room, larger, sizeof *nodes);
          room = larger;
          nodes[count++] = (Node){to, now, departure_s, arrives_s, false};
        }
        if (!(free_s > departure_s)) { /* later only into another interval, which begins so */
          free_s = INFINITY;
          for (uint64_t i = 0; i < table->count; i++)
            if (table->stays[i].end_s > arrives_s && table->stays[i].end_s < free_s &&
                is_near(map, to, to, table->stays[i].from, table->stays[i].to))
              free_s = table->stays[i].end_s;
        }
        if (isinf(free_s))
          break;
        departure_s = free_s;
      }
  }
  if (last != FLEETYARD_NONE)
    take(table, nodes, last, agent, paths);
  free(nodes);
  return last != FLEETYARD_NONE;
}

static int32_t plan(void *context, const FleetyardInstance *instance,
                    const FleetyardBudget *budget, const FleetyardSink *sink) {
  uint32_t agents = instance->agents, attempts = ((const Planner *)context)->attempts;
  uint32_t *order = fleetyard_array(agents, sizeof *order);
  int32_t status = FLEETYARD_STATUS_GAVE_UP;
  Table table = {fleetyard_roadmap(instance->environment, sink), NULL, 0, 0};
  FleetyardPaths paths = fleetyard_paths(FLEETYARD_FORM_VISITS, agents);
  for (uint32_t i = 0; i < agents; i++)
    order[i] = i;
  for (; attempts > 0 && status == FLEETYARD_STATUS_GAVE_UP; attempts--) {
    uint32_t planned = 0;
    fleetyard_clear_paths(&paths);
    table.count = 0;
    while (planned < agents && find_path(&table, instance, order[planned], &paths, sink))
      planned++;
    if (planned == agents) {
      status = fleetyard_submit(&paths, sink);
    } else if (fleetyard_cancelled(sink)) {
      status = fleetyard_time_is_up(budget, sink);
    } else if (planned == 0) {
      status = fleetyard_fail(sink, FLEETYARD_STATUS_INFEASIBLE, "a robot has no path to its goal");
    } else { /* Who found no path goes first, and who went first goes last. */
      uint32_t failed = order[planned];
      memmove(order + planned, order + planned + 1, (agents - planned - 1) * sizeof *order);
      order[agents - 1] = order[0];
      order[0] = failed;
    }
  }
  fleetyard_free_paths(&paths);
  free(table.stays);
  free(order);
  return status == FLEETYARD_STATUS_GAVE_UP
             ? fleetyard_fail(sink, status, "no order of the robots worked")
             : status;
}

/* ---- What the library exports ---------------------------------------------- */

/* What the host knows of the planner; docs/conformance.md lists all capabilities. The
 * schema says what `--option NAME=VALUE` may be; the host checks it beforehand. */
static const FleetyardDescriptor about = {
    .struct_size = sizeof about,
    .id = FLEETYARD_TEXT("example-plugin"),
    .name = FLEETYARD_TEXT("example-plugin"),
    .version = FLEETYARD_TEXT("0.1.0"),
    .description =
        FLEETYARD_TEXT("Prioritized planning on roadmaps, in another order when one fails."),
    .options_schema = FLEETYARD_TEXT(
        "{\"type\": \"object\", \"additionalProperties\": false, \"properties\": {"
        "\"attempts\": {\"type\": \"integer\", \"minimum\": 1, \"default\": 100,"
        "\"description\": \"Most orders of the robots to try.\"}}}"),
    .capabilities = FLEETYARD_CAPABILITY_ROADMAP | FLEETYARD_CAPABILITY_STOP_GO |
                    FLEETYARD_CAPABILITY_SLOWER | FLEETYARD_CAPABILITY_HETEROGENEOUS |
                    FLEETYARD_CAPABILITY_DETERMINISTIC,
};

static void *make(const FleetyardOptions *options, const FleetyardSink *sink) {
  Planner *planner = fleetyard_array(1, sizeof *planner);
  (void)sink;
  planner->attempts = (uint32_t)fleetyard_number(options, "attempts", 100);
  return planner;
}

FLEETYARD_EXPORT_PLANNER(about, make, fleetyard_learn_nothing, plan, free);
