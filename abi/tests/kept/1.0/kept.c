/* A library as it was written for contract 1.0: planners of all three views, and one plugin of each
 * other kind, on nothing but the header beside it. Kept with that header after the release, so that
 * later hosts are tried with it.
 *
 * The planners move one robot at a time, while those before it rest at their goals and those after
 * it at their starts: along the fewest cells, along the fastest edges, or straight ahead.
 *
 * Build: cc -std=c11 -O2 -fPIC -shared -fvisibility=hidden -o kept.so kept.c -lm
 */

#include "fleetyard.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#define SOLVED FLEETYARD_STATUS_SOLVED
#define NONE FLEETYARD_NONE
#define TEXT(literal) {literal, sizeof(literal) - 1}
#define COUNT(array) (sizeof(array) / sizeof *(array))

/* Ends a function with a status that is no success. */
#define TRY(call)                                                                                  \
  do {                                                                                             \
    int32_t tried = call;                                                                          \
    if (tried != SOLVED)                                                                           \
      return tried;                                                                                \
  } while (0)

/* ---- What is refused ----------------------------------------------------------- */

static int32_t fail(const FleetyardSink *sink, int32_t status, const char *text) {
  FleetyardStr message = {text, strlen(text)};
  sink->fail(sink->context, message);
  return status;
}

static int32_t whole(const void *structure, size_t size, const FleetyardSink *sink) {
  uint32_t found = 0;
  if (structure)
    memcpy(&found, structure, sizeof found);
  return found >= size ? SOLVED
                       : fail(sink, FLEETYARD_STATUS_INVALID_INPUT, "a structure is too short");
}
#define WHOLE(pointer, sink) TRY(whole(pointer, sizeof *(pointer), sink))

/* A code is one of the first `last` codes; 0 is none. */
static int32_t code(int32_t code, int32_t first, int32_t last, const FleetyardSink *sink) {
  if (code == 0)
    return fail(sink, FLEETYARD_STATUS_INVALID_INPUT, "a code is 0");
  return code >= first && code <= last ? SOLVED
                                       : fail(sink, FLEETYARD_STATUS_UNSUPPORTED, "unknown code");
}

static int32_t flags(uint32_t flags, uint32_t known, uint32_t reserved, const FleetyardSink *sink) {
  if (reserved != 0)
    return fail(sink, FLEETYARD_STATUS_INVALID_INPUT, "a reserved field is not 0");
  return (flags & ~known) == 0 ? SOLVED : fail(sink, FLEETYARD_STATUS_UNSUPPORTED, "unknown flag");
}

static int32_t parts(const FleetyardParts *parts, const FleetyardSink *sink) {
  for (uint64_t i = 0; i < parts->count; i++)
    if (parts->list[i].flags & FLEETYARD_PART_CRITICAL)
      return fail(sink, FLEETYARD_STATUS_UNSUPPORTED, "unknown critical part");
  return SOLVED;
}

static const char *const SINGLE_INTEGRATOR = "fleetyard.single-integrator/1";

/* An environment of one representation, with the motion's views as 1.0 had them. */
static int32_t check_environment(const FleetyardEnvironment *environment, int32_t representation,
                                 const FleetyardSink *sink) {
  WHOLE(environment, sink);
  TRY(code(environment->representation, representation, representation, sink));
  if (representation == FLEETYARD_REPRESENTATION_GRID) {
    const FleetyardGrid *grid = environment->view;
    WHOLE(grid, sink);
    if (grid->connectivity != 4)
      return fail(sink, FLEETYARD_STATUS_UNSUPPORTED, "four neighbours only");
  } else if (representation == FLEETYARD_REPRESENTATION_ROADMAP) {
    const FleetyardRoadmap *roadmap = environment->view;
    WHOLE(roadmap, sink);
    TRY(flags(roadmap->flags, FLEETYARD_ROADMAP_SYMMETRIC, roadmap->reserved, sink));
  } else {
    const FleetyardWorkspace *workspace = environment->view;
    WHOLE(workspace, sink);
  }
  return parts(&environment->parts, sink);
}

static int32_t check_instance(const FleetyardInstance *instance, int32_t representation,
                              bool fleet, const FleetyardSink *sink) {
  const uint32_t known =
      FLEETYARD_ROBOT_HEADING | FLEETYARD_ROBOT_POLAR_STATE | FLEETYARD_ROBOT_POLAR_CONTROL;
  static const int32_t motions[] = {0, FLEETYARD_MOTION_PEBBLE, FLEETYARD_MOTION_STOP_GO,
                                    FLEETYARD_MOTION_DYNAMICS};
  WHOLE(instance, sink);
  TRY(flags(instance->flags, FLEETYARD_INSTANCE_CYCLES | FLEETYARD_INSTANCE_STRICT,
            instance->reserved, sink));
  TRY(check_environment(instance->environment, representation, sink));
  TRY(code(instance->motion, motions[representation], motions[representation], sink));
  TRY(code(instance->objective, FLEETYARD_OBJECTIVE_SUM_OF_COSTS, FLEETYARD_OBJECTIVE_MAKESPAN,
           sink));
  TRY(parts(&instance->parts, sink));
  for (uint32_t i = 0; i < instance->robot_count; i++) {
    const FleetyardRobot *robot = instance->robots[i];
    WHOLE(robot, sink);
    WHOLE(robot->footprint, sink);
    TRY(flags(robot->flags, known, robot->reserved, sink));
    bool same = robot->dynamics.len == strlen(SINGLE_INTEGRATOR) &&
                memcmp(robot->dynamics.ptr, SINGLE_INTEGRATOR, robot->dynamics.len) == 0;
    if (representation == FLEETYARD_REPRESENTATION_CONTINUOUS && robot->dynamics.len > 0 && !same)
      return fail(sink, FLEETYARD_STATUS_UNSUPPORTED, "unknown dynamics");
  }
  if (instance->agents == 0 || !instance->goal_offsets)
    return fail(sink, FLEETYARD_STATUS_INVALID_INPUT, "no agents or no goals");
  for (uint32_t agent = 0; agent < instance->agents && !fleet; agent++)
    if (instance->goal_offsets[agent + 1] - instance->goal_offsets[agent] != 1 ||
        instance->window_steps > 0 || instance->window_s > 0)
      return fail(sink, FLEETYARD_STATUS_UNSUPPORTED, "one goal each, and no windows");
  if (representation == FLEETYARD_REPRESENTATION_CONTINUOUS) {
    if (!instance->start_state_offsets || !instance->goal_state_offsets ||
        instance->robot_count == 0)
      return fail(sink, FLEETYARD_STATUS_INVALID_INPUT, "no states or no robots");
    return SOLVED;
  }
  const FleetyardGrid *grid = instance->environment->view;
  const FleetyardRoadmap *roadmap = instance->environment->view;
  uint32_t places = representation == FLEETYARD_REPRESENTATION_GRID ? grid->rows * grid->cols
                                                                    : roadmap->vertices;
  if (!instance->starts)
    return fail(sink, FLEETYARD_STATUS_INVALID_INPUT, "no starts");
  for (uint32_t agent = 0; agent < instance->agents; agent++) {
    bool on = instance->starts[agent] < places;
    for (uint64_t i = instance->goal_offsets[agent]; i < instance->goal_offsets[agent + 1]; i++)
      on = on && instance->goals[i] < places;
    if (!on)
      return fail(sink, FLEETYARD_STATUS_INVALID_INPUT, "a start or goal is off the map");
  }
  return SOLVED;
}

static int32_t time_is_up(const FleetyardBudget *budget, const FleetyardSink *sink) {
  return sink->now_ns(sink->context) >= budget->answer_by_ns
             ? fail(sink, FLEETYARD_STATUS_TIMED_OUT, "the time is up")
             : fail(sink, FLEETYARD_STATUS_CANCELLED, "the host gave up on the call");
}

static void *array(size_t count, size_t size) {
  void *memory = calloc(count ? count : 1, size);
  if (!memory)
    abort();
  return memory;
}

/* ---- Plans ---------------------------------------------------------------------- */

/* Entries of all agents, one after the other. */
typedef struct {
  uint64_t *offsets, length, room;
  uint32_t *places;
  double *a, *b, *c;
} Plan;

static Plan begin(uint32_t agents) {
  Plan plan = {array(agents + 1, sizeof(uint64_t)), 0, 0, NULL, NULL, NULL, NULL};
  return plan;
}

static void add(Plan *plan, uint32_t place, double a, double b, double c) {
  if (plan->length == plan->room) {
    plan->room = plan->room ? 2 * plan->room : 64;
    plan->places = realloc(plan->places, plan->room * sizeof *plan->places);
    double **columns[] = {&plan->a, &plan->b, &plan->c};
    for (size_t i = 0; i < COUNT(columns); i++) {
      *columns[i] = realloc(*columns[i], plan->room * sizeof(double));
      if (!*columns[i] || !plan->places)
        abort();
    }
  }
  plan->places[plan->length] = place;
  plan->a[plan->length] = a;
  plan->b[plan->length] = b;
  plan->c[plan->length++] = c;
}

static void end(Plan *plan) {
  free(plan->offsets), free(plan->places), free(plan->a), free(plan->b), free(plan->c);
}

/* Shows the way of each agent, where somebody wants to see it. */
static void show(const Plan *plan, int32_t form, uint32_t agents, const FleetyardSink *sink) {
  const FleetyardStr id = TEXT(FLEETYARD_ANNOTATIONS_ID);
  const FleetyardAnnotations *annotations = sink->get_extension(sink->context, id);
  bool knots = form == FLEETYARD_FORM_TRAJECTORIES;
  if (!annotations || annotations->struct_size < sizeof *annotations)
    return;
  FleetyardAnnotation ways = {.struct_size = sizeof ways,
                              .shape = knots ? FLEETYARD_SHAPE_LINES : FLEETYARD_SHAPE_PLACES,
                              .layer = TEXT("ways"),
                              .agent = NONE,
                              .count = agents,
                              .to_s = INFINITY,
                              .offsets = plan->offsets,
                              .x_m = knots ? plan->b : NULL,
                              .y_m = knots ? plan->c : NULL,
                              .places = knots ? NULL : plan->places};
  annotations->annotate(sink->context, &ways);
}

static int32_t submit(const Plan *plan, int32_t form, uint32_t agents, const FleetyardSink *sink) {
  FleetyardCells cells = {sizeof cells, 0, plan->places};
  FleetyardVisits visits = {sizeof visits, 0, plan->places, plan->a, plan->b};
  FleetyardTrajectories knots = {sizeof knots, 0,    plan->a, plan->b, plan->c,
                                 NULL,         NULL, NULL,    NULL,    NULL};
  const void *bodies[] = {NULL, &cells, &visits, &knots};
  FleetyardPlan whole = {sizeof whole, agents, form, 0, plan->offsets, bodies[form], {NULL, 0}};
  show(plan, form, agents, sink);
  return sink->submit_plan(sink->context, &whole) == FLEETYARD_OK
             ? SOLVED
             : fail(sink, FLEETYARD_STATUS_INTERNAL_ERROR, "the plan was not taken");
}

/* ---- Planners ------------------------------------------------------------------- */

typedef struct {
  int32_t representation;
  bool prepared;
} Planner;

/* The squared distance of a point from a segment. */
static double near(double x, double y, double ax, double ay, double bx, double by) {
  double dx = bx - ax, dy = by - ay, length = dx * dx + dy * dy;
  double along = length > 0 ? ((x - ax) * dx + (y - ay) * dy) / length : 0;
  along = fmin(1, fmax(0, along));
  x -= ax + along * dx, y -= ay + along * dy;
  return x * x + y * y;
}

/* Where an agent rests while another one moves. */
static uint32_t resting(const FleetyardInstance *instance, uint32_t agent, uint32_t moving) {
  return agent < moving ? instance->goals[instance->goal_offsets[agent]] : instance->starts[agent];
}

/* Ways of one agent: `from` has for every place the one before it, NONE where no way leads. */
typedef struct {
  uint32_t *from, *queue;
  double *cost;
  bool *blocked;
} Ways;

static Ways ways(uint32_t places) {
  Ways ways = {array(places, sizeof(uint32_t)), array(places, sizeof(uint32_t)),
               array(places, sizeof(double)), array(places, sizeof(bool))};
  return ways;
}

static void end_ways(Ways *ways) {
  free(ways->from), free(ways->queue), free(ways->cost), free(ways->blocked);
}

static bool spread_grid(const FleetyardGrid *grid, Ways *ways, uint32_t start, uint32_t goal) {
  static const int down[] = {-1, 0, 1, 0}, right[] = {0, 1, 0, -1};
  uint32_t count = 0;
  memset(ways->from, 0xFF, (size_t)grid->rows * grid->cols * sizeof *ways->from);
  ways->from[start] = start;
  ways->queue[count++] = start;
  for (uint32_t head = 0; head < count && ways->from[goal] == NONE; head++)
    for (int move = 0; move < 4; move++) {
      uint32_t cell = ways->queue[head];
      if (!(grid->moves[cell] >> move & 1))
        continue;
      uint32_t next = (uint32_t)((int64_t)cell + down[move] * (int64_t)grid->cols + right[move]);
      if (ways->from[next] != NONE || ways->blocked[next])
        continue;
      ways->from[next] = cell;
      ways->queue[count++] = next;
    }
  return ways->from[goal] != NONE;
}

/* True if a disc that drives an edge keeps away from all that rest. */
static bool clear(const FleetyardRoadmap *roadmap, const FleetyardInstance *instance,
                  uint32_t moving, uint32_t from, uint32_t to) {
  double apart = roadmap->separation_m * roadmap->separation_m;
  for (uint32_t agent = 0; agent < instance->agents; agent++) {
    uint32_t at = resting(instance, agent, moving);
    if (agent != moving && near(roadmap->x_m[at], roadmap->y_m[at], roadmap->x_m[from],
                                roadmap->y_m[from], roadmap->x_m[to], roadmap->y_m[to]) < apart)
      return false;
  }
  return true;
}

static bool spread_roadmap(const FleetyardRoadmap *roadmap, const FleetyardInstance *instance,
                           Ways *ways, uint32_t moving, uint32_t goal,
                           const FleetyardSink *sink) {
  bool more = true;
  uint32_t start = instance->starts[moving];
  memset(ways->from, 0xFF, roadmap->vertices * sizeof *ways->from);
  ways->from[start] = start;
  ways->cost[start] = 0;
  /* Rounds over all edges, until nothing becomes faster. */
  while (more && sink->cancelled(sink->context) == 0) {
    more = false;
    for (uint32_t vertex = 0; vertex < roadmap->vertices; vertex++) {
      if (ways->from[vertex] == NONE)
        continue;
      for (uint64_t edge = roadmap->edge_offsets[vertex]; edge < roadmap->edge_offsets[vertex + 1];
           edge++) {
        uint32_t to = roadmap->targets[edge];
        double cost = ways->cost[vertex] + roadmap->duration_s[edge];
        if ((ways->from[to] == NONE || cost < ways->cost[to]) &&
            clear(roadmap, instance, moving, vertex, to)) {
          ways->cost[to] = cost;
          ways->from[to] = vertex;
          more = true;
        }
      }
    }
  }
  return ways->from[goal] != NONE && !more;
}

/* The number of places on the way to a goal, in their order in `queue`. */
static uint32_t unwind(Ways *ways, uint32_t start, uint32_t goal) {
  uint32_t count = 0;
  for (uint32_t place = goal; place != start; place = ways->from[place])
    ways->queue[count++] = place;
  for (uint32_t i = 0; i < count / 2; i++) {
    uint32_t other = ways->queue[i];
    ways->queue[i] = ways->queue[count - 1 - i];
    ways->queue[count - 1 - i] = other;
  }
  return count;
}

static int32_t plan_cells(const FleetyardInstance *instance, Plan *plan, Ways *ways,
                          const FleetyardBudget *budget, const FleetyardSink *sink) {
  const FleetyardGrid *grid = instance->environment->view;
  uint64_t step = 0;
  for (uint32_t agent = 0; agent < instance->agents; agent++) {
    uint32_t start = instance->starts[agent], goal = instance->goals[instance->goal_offsets[agent]];
    for (uint32_t other = 0; other < instance->agents; other++)
      ways->blocked[resting(instance, other, agent)] = other != agent;
    bool found = !ways->blocked[goal] && spread_grid(grid, ways, start, goal);
    for (uint32_t other = 0; other < instance->agents; other++)
      ways->blocked[resting(instance, other, agent)] = false;
    if (sink->cancelled(sink->context))
      return time_is_up(budget, sink);
    if (!found)
      return fail(sink, FLEETYARD_STATUS_GAVE_UP, "somebody is in the way");
    for (uint64_t wait = 0; wait <= step; wait++)
      add(plan, start, 0, 0, 0);
    uint32_t count = unwind(ways, start, goal);
    for (uint32_t i = 0; i < count; i++)
      add(plan, ways->queue[i], 0, 0, 0);
    step += count;
    plan->offsets[agent + 1] = plan->length;
    sink->progress(sink->context, agent + 1, instance->agents);
  }
  return SOLVED;
}

static int32_t plan_visits(const FleetyardInstance *instance, Plan *plan, Ways *ways,
                           const FleetyardBudget *budget, const FleetyardSink *sink) {
  const FleetyardRoadmap *roadmap = instance->environment->view;
  double time = 0;
  for (uint32_t agent = 0; agent < instance->agents; agent++) {
    uint32_t start = instance->starts[agent], goal = instance->goals[instance->goal_offsets[agent]];
    bool found = clear(roadmap, instance, agent, goal, goal) &&
                 spread_roadmap(roadmap, instance, ways, agent, goal, sink);
    if (sink->cancelled(sink->context))
      return time_is_up(budget, sink);
    if (!found)
      return fail(sink, FLEETYARD_STATUS_GAVE_UP, "somebody is in the way");
    uint32_t count = unwind(ways, start, goal);
    double arrival = 0, departure = count > 0 ? time : 0;
    uint32_t at = start;
    add(plan, start, arrival, departure, 0);
    for (uint32_t i = 0; i < count; i++) {
      uint64_t edge = roadmap->edge_offsets[at];
      while (roadmap->targets[edge] != ways->queue[i] ||
             ways->cost[at] + roadmap->duration_s[edge] > ways->cost[ways->queue[i]])
        edge++;
      at = ways->queue[i];
      departure += roadmap->duration_s[edge];
      add(plan, at, departure, departure, 0);
    }
    time = fmax(time, departure);
    plan->offsets[agent + 1] = plan->length;
  }
  return SOLVED;
}

/* The speed that a robot has in every direction, and a metre per second if nothing limits it. */
static double speed(const FleetyardRobot *robot) {
  double speed = INFINITY;
  for (uint32_t i = 0; i < 2 && i < robot->control_size; i++)
    speed = fmin(speed, fmin(robot->control_max[i], -robot->control_min[i]));
  return isinf(speed) ? 1 : speed;
}

static const FleetyardRobot *robot(const FleetyardInstance *instance, uint32_t agent) {
  return instance->robots[instance->robot_of ? instance->robot_of[agent] : 0];
}

/* True if a disc of a radius can be swept along a segment. */
static bool free_way(const FleetyardWorkspace *world, const double *from, const double *to,
                     double radius) {
  double low_x = fmin(from[0], to[0]), high_x = fmax(from[0], to[0]);
  double low_y = fmin(from[1], to[1]), high_y = fmax(from[1], to[1]);
  if (low_x - radius < world->min_x_m || high_x + radius > world->max_x_m ||
      low_y - radius < world->min_y_m || high_y + radius > world->max_y_m)
    return false;
  for (uint32_t obstacle = 0; obstacle < world->obstacles; obstacle++) {
    uint64_t first = world->corner_offsets[obstacle], last = world->corner_offsets[obstacle + 1];
    bool inside = false;
    for (uint64_t i = first, j = last - 1; i < last; j = i++) {
      double ax = world->x_m[j], ay = world->y_m[j], bx = world->x_m[i], by = world->y_m[i];
      double rx = to[0] - from[0], ry = to[1] - from[1], sx = bx - ax, sy = by - ay;
      double turn = rx * sy - ry * sx;
      double on = ((ax - from[0]) * sy - (ay - from[1]) * sx) / turn;
      double off = ((ax - from[0]) * ry - (ay - from[1]) * rx) / turn;
      bool cross = fabs(turn) > 0 && on >= 0 && on <= 1 && off >= 0 && off <= 1;
      double nearest = fmin(near(from[0], from[1], ax, ay, bx, by), near(to[0], to[1], ax, ay, bx, by));
      nearest = fmin(nearest, near(ax, ay, from[0], from[1], to[0], to[1]));
      if (cross || nearest < radius * radius)
        return false;
      if ((ay > from[1]) != (by > from[1]) && from[0] < ax + (from[1] - ay) * sx / sy)
        inside = !inside;
    }
    if (inside)
      return false;
  }
  return true;
}

static int32_t plan_knots(const FleetyardInstance *instance, Plan *plan,
                          const FleetyardSink *sink) {
  const FleetyardWorkspace *world = instance->environment->view;
  double time = 0;
  for (uint32_t agent = 0; agent < instance->agents; agent++) {
    const double *from = instance->start_states + instance->start_state_offsets[agent];
    const double *to = instance->goal_states + instance->goal_state_offsets[agent];
    double radius = robot(instance, agent)->footprint->radius_m + 1e-9;
    bool clear = free_way(world, from, to, radius);
    if (world->mover_count > 0 || robot(instance, agent)->flags & FLEETYARD_ROBOT_HEADING)
      return fail(sink, FLEETYARD_STATUS_GAVE_UP, "no movers, and no robots with headings");
    for (uint32_t other = 0; other < instance->agents && clear; other++) {
      const double *at = other < agent ? instance->goal_states + instance->goal_state_offsets[other]
                                       : instance->start_states + instance->start_state_offsets[other];
      double apart = radius + robot(instance, other)->footprint->radius_m;
      clear = other == agent || near(at[0], at[1], from[0], from[1], to[0], to[1]) >= apart * apart;
    }
    if (!clear)
      return fail(sink, FLEETYARD_STATUS_GAVE_UP, "something is in the way");
    double length = hypot(to[0] - from[0], to[1] - from[1]);
    add(plan, NONE, 0, from[0], from[1]);
    if (length > 0) {
      if (time > 0)
        add(plan, NONE, time, from[0], from[1]);
      time += length / speed(robot(instance, agent)) * (1 + 1e-12);
      add(plan, NONE, time, to[0], to[1]);
    }
    plan->offsets[agent + 1] = plan->length;
  }
  return SOLVED;
}

static int32_t prepare(void *context, const FleetyardEnvironment *environment,
                       const FleetyardBudget *budget, const FleetyardSink *sink) {
  Planner *planner = context;
  planner->prepared = false;
  WHOLE(budget, sink);
  TRY(check_environment(environment, planner->representation, sink));
  planner->prepared = true;
  return SOLVED;
}

static int32_t plan(void *context, const FleetyardInstance *instance,
                    const FleetyardBudget *budget, const FleetyardSink *sink) {
  const Planner *planner = context;
  if (!planner->prepared)
    return fail(sink, FLEETYARD_STATUS_INVALID_INPUT, "there is no environment yet");
  WHOLE(budget, sink);
  TRY(check_instance(instance, planner->representation, false, sink));
  const FleetyardGrid *grid = instance->environment->view;
  const FleetyardRoadmap *roadmap = instance->environment->view;
  Plan made = begin(instance->agents);
  Ways found = {NULL, NULL, NULL, NULL};
  int32_t status;
  if (planner->representation == FLEETYARD_REPRESENTATION_GRID) {
    found = ways(grid->rows * grid->cols);
    status = plan_cells(instance, &made, &found, budget, sink);
  } else if (planner->representation == FLEETYARD_REPRESENTATION_ROADMAP) {
    found = ways(roadmap->vertices);
    status = plan_visits(instance, &made, &found, budget, sink);
  } else {
    status = plan_knots(instance, &made, sink);
  }
  FleetyardStr entries = {"entries", 7};
  sink->metric(sink->context, entries, (double)made.length);
  /* Forms have the numbers of their views. */
  if (status == SOLVED)
    status = submit(&made, planner->representation, instance->agents, sink);
  end_ways(&found);
  end(&made);
  return status;
}

/* ---- The other kinds -------------------------------------------------------------- */

/* Everybody stays, as long as the failed plan is. */
static int32_t recover(void *context, const FleetyardInstance *instance,
                       const FleetyardPlan *failed, const FleetyardBudget *budget,
                       const FleetyardSink *sink) {
  const Planner *planner = context;
  if (!planner->prepared)
    return fail(sink, FLEETYARD_STATUS_INVALID_INPUT, "there is no environment yet");
  WHOLE(budget, sink);
  TRY(check_instance(instance, FLEETYARD_REPRESENTATION_GRID, true, sink));
  if (failed) {
    WHOLE(failed, sink);
    TRY(flags(0, 0, failed->reserved, sink));
    TRY(code(failed->form, FLEETYARD_FORM_CELLS, FLEETYARD_FORM_CELLS, sink));
    TRY(parts(&failed->parts, sink));
    const FleetyardCells *cells = failed->body;
    WHOLE(cells, sink);
    if (failed->agents != instance->agents)
      return fail(sink, FLEETYARD_STATUS_INVALID_INPUT, "other agents");
  }
  Plan made = begin(instance->agents);
  for (uint32_t agent = 0; agent < instance->agents; agent++) {
    add(&made, instance->starts[agent], 0, 0, 0);
    made.offsets[agent + 1] = made.length;
  }
  int32_t status = submit(&made, FLEETYARD_FORM_CELLS, instance->agents, sink);
  end(&made);
  return status;
}

/* Agents keep their goals, and who has none stays where it is. */
/* The structure of a part, if there is one and it is no JSON. */
static const void *structure(const FleetyardParts *parts, const char *id) {
  for (uint64_t i = 0; i < parts->count; i++) {
    const FleetyardPart *part = &parts->list[i];
    if (part->id.len == strlen(id) && memcmp(part->id.ptr, id, part->id.len) == 0)
      return part->flags & FLEETYARD_PART_JSON ? NULL : part->data;
  }
  return NULL;
}

static int32_t misfit(const FleetyardSink *sink) {
  return fail(sink, FLEETYARD_STATUS_INVALID_INPUT, "the memory does not fit the state");
}

/* Looks at all that the host remembers, and keeps how often it was asked. */
static int32_t remember(const FleetyardFleetState *state, const FleetyardSink *sink) {
  const FleetyardInstance *next = state->next;
  const FleetyardGrid *grid = next->environment->view;
  const FleetyardTraffic *traffic = structure(&state->parts, FLEETYARD_TRAFFIC_ID);
  const FleetyardRestOfPlan *rest = structure(&state->parts, FLEETYARD_REST_OF_PLAN_ID);
  const FleetyardGoalTasks *goals = structure(&state->parts, FLEETYARD_GOAL_TASKS_ID);
  const FleetyardBytes *kept = structure(&state->parts, FLEETYARD_KEPT_ID);
  const char *keep_id = FLEETYARD_KEEP_ID;
  double seen = 0;
  if (traffic) {
    WHOLE(traffic, sink);
    WHOLE(traffic->last, sink);
    WHOLE(traffic->before, sink);
    if (traffic->places != grid->rows * grid->cols || traffic->flows != 4 * traffic->places ||
        traffic->since_s >= traffic->period_s || traffic->last->number < traffic->before->number)
      return misfit(sink);
    for (uint32_t i = 0; i < traffic->places; i++)
      seen += traffic->last->waiting[i] - traffic->before->waiting[i];
    for (uint64_t i = 0; i < traffic->flows; i++)
      seen += (traffic->last->flow[i] - traffic->before->flow[i]) * traffic->flow_unit_per_s;
  }
  if (rest) {
    WHOLE(rest, sink);
    if (rest->agents != next->agents || rest->offsets[0] != 0)
      return misfit(sink);
    for (uint64_t i = 0; i < rest->offsets[rest->agents]; i++)
      if (!strchr(".NESW", rest->moves[i]))
        return misfit(sink);
  }
  if (goals) {
    WHOLE(goals, sink);
    if (goals->goals != next->goal_offsets[next->agents])
      return misfit(sink);
    for (uint64_t i = 0; i < goals->goals; i++) {
      seen += goals->time_s - goals->given_s[i];
      if (goals->given_s[i] < goals->released_s[i] ||
          (goals->tasks[i] == UINT64_MAX) != (goals->errands[i] == NONE))
        return misfit(sink);
    }
  }
  uint64_t asked = 0;
  if (kept) {
    WHOLE(kept, sink);
    if (kept->len == sizeof asked)
      memcpy(&asked, kept->ptr, sizeof asked);
  }
  asked++;
  const FleetyardKeep *host =
      sink->get_extension(sink->context, (FleetyardStr){keep_id, strlen(keep_id)});
  const FleetyardBytes bytes = {sizeof bytes, 0, (const uint8_t *)&asked, sizeof asked};
  if (!host || whole(host, sizeof *host, sink) != SOLVED ||
      host->keep(sink->context, &bytes) != FLEETYARD_OK)
    return fail(sink, FLEETYARD_STATUS_INTERNAL_ERROR, "the host keeps nothing");
  sink->metric(sink->context, (FleetyardStr)TEXT("seen"), seen);
  return SOLVED;
}

static int32_t generate(void *context, const FleetyardFleetState *state,
                        const FleetyardBudget *budget, const FleetyardSink *sink) {
  const Planner *planner = context;
  if (!planner->prepared)
    return fail(sink, FLEETYARD_STATUS_INVALID_INPUT, "there is no environment yet");
  WHOLE(budget, sink);
  WHOLE(state, sink);
  TRY(parts(&state->parts, sink));
  const FleetyardInstance *next = state->next;
  TRY(check_instance(next, FLEETYARD_REPRESENTATION_GRID, true, sink));
  TRY(remember(state, sink));
  Plan goals = begin(next->agents);
  for (uint32_t agent = 0; agent < next->agents; agent++) {
    for (uint64_t i = next->goal_offsets[agent]; i < next->goal_offsets[agent + 1]; i++)
      add(&goals, next->goals[i], 0, 0, 0);
    if (next->goal_offsets[agent] == next->goal_offsets[agent + 1])
      add(&goals, next->starts[agent], 0, 0, 0);
    goals.offsets[agent + 1] = goals.length;
  }
  FleetyardRequest request = {.struct_size = sizeof request,
                              .agents = next->agents,
                              .goal_offsets = goals.offsets,
                              .goals = goals.places,
                              .window_steps = next->window_steps,
                              .window_s = next->window_s};
  int32_t taken = sink->submit_request(sink->context, &request);
  end(&goals);
  return taken == FLEETYARD_OK
             ? SOLVED
             : fail(sink, FLEETYARD_STATUS_INTERNAL_ERROR, "the request was not taken");
}

/* When somebody has nothing left to do, or after ten seconds. */
static int32_t should_invoke(void *context, const FleetyardFleetStatus *status,
                             const FleetyardSink *sink, int32_t *out) {
  bool idle = false;
  (void)context;
  WHOLE(status, sink);
  TRY(parts(&status->parts, sink));
  for (uint32_t agent = 0; agent < status->agents; agent++)
    idle = idle || status->actions_left[agent] == 0;
  *out = idle || status->since_last_call_s >= 10;
  return SOLVED;
}

/* ---- What the library exports ------------------------------------------------------ */

static const FleetyardStr features[] = {TEXT("dynamics:fleetyard.single-integrator/1")};

#define ABOUT(ID, NAME, DESCRIPTION, FEATURES, CAPABILITIES)                                       \
  {sizeof(FleetyardDescriptor),                                                                    \
   FEATURES,                                                                                       \
   TEXT(ID),                                                                                       \
   TEXT(NAME),                                                                                     \
   TEXT("1.0.0"),                                                                                  \
   TEXT(DESCRIPTION),                                                                              \
   TEXT("MIT OR Apache-2.0"),                                                                      \
   {NULL, 0},                                                                                      \
   (CAPABILITIES) | FLEETYARD_CAPABILITY_DETERMINISTIC,                                            \
   features}

static const FleetyardDescriptor planners[] = {
    ABOUT("kept-grid", "One by one on a grid", "Moves one robot at a time along the fewest cells.",
          0, FLEETYARD_CAPABILITY_GRID | FLEETYARD_CAPABILITY_PEBBLE),
    ABOUT("kept-roadmap", "One by one on a roadmap",
          "Moves one robot at a time along the fastest edges.", 0,
          FLEETYARD_CAPABILITY_ROADMAP | FLEETYARD_CAPABILITY_STOP_GO),
    ABOUT("kept-plane", "One by one in the plane", "Moves one robot at a time straight ahead.", 1,
          FLEETYARD_CAPABILITY_CONTINUOUS | FLEETYARD_CAPABILITY_DYNAMICS |
              FLEETYARD_CAPABILITY_HETEROGENEOUS),
};

#define LIFELONG                                                                                   \
  (FLEETYARD_CAPABILITY_GRID | FLEETYARD_CAPABILITY_PEBBLE | FLEETYARD_CAPABILITY_WINDOWED |       \
   FLEETYARD_CAPABILITY_DUPLICATE_GOALS | FLEETYARD_CAPABILITY_IDLE)

static const FleetyardDescriptor fail_policy =
    ABOUT("kept-stay", "Stay", "Keeps everybody where they are.", 0, LIFELONG);
static const FleetyardStr memory[] = {
    TEXT("part:" FLEETYARD_TRAFFIC_ID), TEXT("part:" FLEETYARD_REST_OF_PLAN_ID),
    TEXT("part:" FLEETYARD_GOAL_TASKS_ID), TEXT("part:" FLEETYARD_KEPT_ID)};
static const FleetyardDescriptor generator = {
    .struct_size = sizeof(FleetyardDescriptor),
    .feature_count = COUNT(memory),
    .id = TEXT("kept-goals"),
    .name = TEXT("Same goals"),
    .version = TEXT("1.0.0"),
    .description = TEXT("Keeps the goals that agents have."),
    .license = TEXT("MIT OR Apache-2.0"),
    .capabilities = LIFELONG | FLEETYARD_CAPABILITY_DETERMINISTIC,
    .features = memory,
};
static const FleetyardDescriptor invocation =
    ABOUT("kept-idle", "When idle", "Calls the planner when somebody is idle.", 0, 0);

static uint32_t three(void *context) {
  (void)context;
  return COUNT(planners);
}
static uint32_t one(void *context) {
  (void)context;
  return 1;
}
static const FleetyardDescriptor *describe_planner(void *context, uint32_t index) {
  (void)context;
  return index < COUNT(planners) ? &planners[index] : NULL;
}
static const FleetyardDescriptor *describe(void *context, uint32_t index) {
  return index == 0 ? context : NULL;
}

static int32_t check_room(uint32_t size, size_t needed, const FleetyardOptions *options,
                          const FleetyardSink *sink) {
  WHOLE(options, sink);
  if (options->count > 0)
    return fail(sink, FLEETYARD_STATUS_INVALID_INPUT, "there are no options");
  return size >= needed ? SOLVED
                        : fail(sink, FLEETYARD_STATUS_UNSUPPORTED, "the host has too little room");
}

static void *made(int32_t representation) {
  Planner *planner = array(1, sizeof *planner);
  planner->representation = representation;
  return planner;
}

static int32_t create_planner(void *context, uint32_t index, const FleetyardOptions *options,
                              const FleetyardSink *sink, FleetyardPlanner *out) {
  (void)context;
  TRY(check_room(out->struct_size, sizeof *out, options, sink));
  if (index >= COUNT(planners))
    return fail(sink, FLEETYARD_STATUS_INVALID_INPUT, "there is no such planner");
  /* The planners are in the order of their views' codes. */
  FleetyardPlanner planner = {sizeof planner, 0, made((int32_t)index + 1), prepare, plan, free,
                              NULL};
  *out = planner;
  return SOLVED;
}

static int32_t create_fail_policy(void *context, uint32_t index, const FleetyardOptions *options,
                                  const FleetyardSink *sink, FleetyardFailPolicy *out) {
  (void)context, (void)index;
  TRY(check_room(out->struct_size, sizeof *out, options, sink));
  FleetyardFailPolicy policy = {sizeof policy, 0,    made(FLEETYARD_REPRESENTATION_GRID),
                                prepare,       recover, free, NULL};
  *out = policy;
  return SOLVED;
}

static int32_t create_generator(void *context, uint32_t index, const FleetyardOptions *options,
                                const FleetyardSink *sink, FleetyardInstanceGenerator *out) {
  (void)context, (void)index;
  TRY(check_room(out->struct_size, sizeof *out, options, sink));
  FleetyardInstanceGenerator made_one = {
      sizeof made_one, 0, made(FLEETYARD_REPRESENTATION_GRID), prepare, generate, free, NULL};
  *out = made_one;
  return SOLVED;
}

static int32_t create_invocation(void *context, uint32_t index, const FleetyardOptions *options,
                                 const FleetyardSink *sink, FleetyardInvocationPolicy *out) {
  (void)context, (void)index;
  TRY(check_room(out->struct_size, sizeof *out, options, sink));
  FleetyardInvocationPolicy policy = {
      sizeof policy, 0, made(FLEETYARD_REPRESENTATION_GRID), should_invoke, free, NULL};
  *out = policy;
  return SOLVED;
}

static const FleetyardPlannerFactory planner_factory = {
    sizeof(FleetyardPlannerFactory), 0, NULL, three, describe_planner, create_planner};
static const FleetyardFailPolicyFactory fail_policy_factory = {
    sizeof(FleetyardFailPolicyFactory), 0, (void *)&fail_policy, one, describe, create_fail_policy};
static const FleetyardInstanceGeneratorFactory generator_factory = {
    sizeof(FleetyardInstanceGeneratorFactory), 0, (void *)&generator, one, describe,
    create_generator};
static const FleetyardInvocationPolicyFactory invocation_factory = {
    sizeof(FleetyardInvocationPolicyFactory), 0, (void *)&invocation, one, describe,
    create_invocation};

static const void *get_factory(FleetyardStr id) {
  const struct {
    const char *id;
    const void *factory;
  } factories[] = {{FLEETYARD_PLANNER_FACTORY_ID, &planner_factory},
                   {FLEETYARD_FAIL_POLICY_FACTORY_ID, &fail_policy_factory},
                   {FLEETYARD_INSTANCE_GENERATOR_FACTORY_ID, &generator_factory},
                   {FLEETYARD_INVOCATION_POLICY_FACTORY_ID, &invocation_factory}};
  for (size_t i = 0; i < COUNT(factories); i++)
    if (id.len == strlen(factories[i].id) && memcmp(id.ptr, factories[i].id, id.len) == 0)
      return factories[i].factory;
  return NULL;
}

const FleetyardPluginEntry fleetyard_plugin_entry_v1 = {
    sizeof(FleetyardPluginEntry), 1, 0, NULL, NULL, get_factory};
