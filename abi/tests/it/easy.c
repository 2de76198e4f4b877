/* Plays the host to planners on fleetyard_easy.h: options, views, plans of three forms, requests,
 * what is refused, and what is exported. C11 and C++17. Ends with the line of the check that
 * fails, if one does. */
#include "fleetyard_easy.h"

typedef struct Settings {
  double share;
  int order;
  bool strict;
} Settings;

static void *make(const FleetyardOptions *options, const FleetyardSink *sink) {
  Settings *settings = (Settings *)fleetyard_array(1, sizeof *settings);
  settings->share = fleetyard_number(options, "share", 0.5);
  settings->order = fleetyard_choice(options, "order", "first last any");
  settings->strict = fleetyard_flag(options, "strict", true);
  if (settings->share <= 1)
    return settings;
  free(settings);
  fleetyard_fail(sink, FLEETYARD_STATUS_INVALID_INPUT, "options: `share` is above 1");
  return NULL;
}

/* On a grid everybody goes east, on a roadmap along the first edge, and in the plane to its goal
 * in a second. */
static int32_t solve(void *context, const FleetyardInstance *instance,
                     const FleetyardBudget *budget, const FleetyardSink *sink) {
  const FleetyardEnvironment *environment = instance->environment;
  uint32_t agents = instance->agents;
  FleetyardPaths paths = fleetyard_paths(environment->representation, agents);
  (void)budget;
  fleetyard_note(sink, "order", ((const Settings *)context)->order == 1 ? "last" : "other");
  for (uint32_t agent = agents; agent-- > 0;) {
    if (environment->representation == FLEETYARD_REPRESENTATION_GRID) {
      uint32_t cell = instance->starts[agent];
      for (; cell != FLEETYARD_NONE; cell = fleetyard_move(fleetyard_grid(environment, sink), cell, 1))
        fleetyard_add_cell(&paths, agent, cell);
    } else if (environment->representation == FLEETYARD_REPRESENTATION_ROADMAP) {
      const FleetyardRoadmap *roadmap = fleetyard_roadmap(environment, sink);
      uint64_t edge = roadmap->edge_offsets[instance->starts[agent]];
      fleetyard_add_visit(&paths, agent, instance->starts[agent], 0, 1);
      fleetyard_add_visit(&paths, agent, roadmap->targets[edge], 1 + roadmap->duration_s[edge], 9);
    } else {
      const double *start = instance->start_states + instance->start_state_offsets[agent];
      const double *goal = instance->goal_states +
                           instance->goal_state_offsets[instance->goal_offsets[agent]];
      bool heading = (fleetyard_robot(instance, agent)->flags & FLEETYARD_ROBOT_HEADING) != 0;
      fleetyard_add_knot(&paths, agent, 0, start[0], start[1], heading ? start[2] : NAN);
      fleetyard_add_knot(&paths, agent, 1, goal[0], goal[1], heading ? start[2] : NAN);
      const double control[] = {1, 2};
      for (uint32_t i = 0; i < 20 * agent; i++) // of the second one alone
        fleetyard_add_control(&paths, agent, 0.5 + i, control, 2);
    }
  }
  int32_t status = fleetyard_submit(&paths, sink);
  fleetyard_free_paths(&paths);
  return status;
}

static const FleetyardStr features[] = {FLEETYARD_TEXT("part:org.example.known/1"),
                                        FLEETYARD_TEXT("dynamics:org.example.slide/1")};

static const FleetyardDescriptor east = {
    sizeof(FleetyardDescriptor), 2,
    FLEETYARD_TEXT("east"),      FLEETYARD_TEXT("East"),
    FLEETYARD_TEXT("0.1.0"),     FLEETYARD_TEXT("Goes east."),
    FLEETYARD_TEXT(""),          FLEETYARD_TEXT(""),
    FLEETYARD_CAPABILITY_GRID | FLEETYARD_CAPABILITY_ROADMAP | FLEETYARD_CAPABILITY_CONTINUOUS |
        FLEETYARD_CAPABILITY_PEBBLE | FLEETYARD_CAPABILITY_STOP_GO |
        FLEETYARD_CAPABILITY_DYNAMICS,
    features};

FLEETYARD_EXPORT_PLANNER(east, make, fleetyard_learn_nothing, solve, free);

/* ---- The host ---------------------------------------------------------------- */

static char said[600], noted[100];
static int32_t form, answer = FLEETYARD_OK;
static uint32_t agents, entries[2000];
static uint64_t offsets[3];
static double columns[4][20];
static bool headings;
static int segments;
static double last_s, last_number;

static void keep(double *to, const double *from) {
  memcpy(to, from, (size_t)offsets[agents] * sizeof *from);
}

static int32_t submit_plan(void *context, const FleetyardPlan *plan) {
  (void)context;
  form = plan->form;
  agents = plan->agents;
  memcpy(offsets, plan->offsets, (agents + 1) * sizeof *offsets);
  const FleetyardCells *cells = (const FleetyardCells *)plan->body;
  const FleetyardVisits *visits = (const FleetyardVisits *)plan->body;
  const FleetyardTrajectories *knots = (const FleetyardTrajectories *)plan->body;
  if (form == FLEETYARD_FORM_CELLS) {
    memcpy(entries, cells->cells, (size_t)offsets[agents] * sizeof *entries);
  } else if (form == FLEETYARD_FORM_VISITS) {
    memcpy(entries, visits->vertices, (size_t)offsets[agents] * sizeof *entries);
    keep(columns[0], visits->arrival_s);
    keep(columns[1], visits->departure_s);
  } else {
    keep(columns[0], knots->time_s);
    keep(columns[1], knots->x_m);
    keep(columns[2], knots->y_m);
    headings = knots->heading_rad != NULL;
    if (headings)
      keep(columns[3], knots->heading_rad);
    segments = knots->segment_offsets ? (int)knots->segment_offsets[agents] : -1;
    if (segments > 0) {
      last_s = knots->duration_s[segments - 1];
      last_number = knots->controls[knots->control_offsets[agents] - 1];
    }
  }
  return answer;
}

static FleetyardRequest asked;
static int32_t submit_request(void *context, const FleetyardRequest *request) {
  (void)context;
  asked = *request;
  agents = request->agents;
  memcpy(offsets, request->goal_offsets, (agents + 1) * sizeof *offsets);
  memcpy(entries, request->goals, (size_t)offsets[agents] * sizeof *entries);
  return answer;
}

static void explain(void *context, FleetyardStr message) {
  (void)context;
  snprintf(said, sizeof said, "%.*s", (int)message.len, message.ptr);
}

static void note(void *context, FleetyardStr name, FleetyardStr text) {
  (void)context;
  snprintf(noted, sizeof noted, "%.*s=%.*s", (int)name.len, name.ptr, (int)text.len, text.ptr);
}

static uint64_t clock_ns = 5;
static uint64_t now_ns(void *context) {
  (void)context;
  return clock_ns;
}

static void check_at(bool holds, int line) {
  if (!holds) {
    fprintf(stderr, "line %d: %s\n", line, said);
    exit(1);
  }
}
#define CHECK(condition) check_at(condition, __LINE__)

/* A number that went through unchanged. */
static bool same(double a, double b) { return !(a < b) && !(b < a); }

static FleetyardSink sink;
static FleetyardBudget budget;
static FleetyardPlanner planner;

static const FleetyardPlannerFactory *factory(void) {
  return (const FleetyardPlannerFactory *)fleetyard_plugin_entry_v1.get_factory(
      fleetyard_text(FLEETYARD_PLANNER_FACTORY_ID));
}

static int32_t create(const FleetyardOptions *options) {
  said[0] = 0;
  memset(&planner, 0, sizeof planner);
  planner.struct_size = sizeof planner;
  return factory()->create(NULL, 0, options, &sink, &planner);
}

static const FleetyardOptions no_options = {sizeof no_options, 0, NULL, FLEETYARD_TEXT("{}")};

/* The status of a call of `prepare` and `plan`. */
static int32_t plan(const FleetyardInstance *instance) {
  said[0] = noted[0] = 0;
  int32_t status = planner.prepare(planner.context, instance->environment, &budget, &sink);
  return status == FLEETYARD_STATUS_SOLVED
             ? planner.plan(planner.context, instance, &budget, &sink)
             : status;
}

static void options(void) {
  FleetyardPluginOption list[] = {
      {FLEETYARD_TEXT("share"), FLEETYARD_TEXT(""), 0.25, FLEETYARD_OPTION_NUMBER, 0},
      {FLEETYARD_TEXT("order"), FLEETYARD_TEXT("last"), 0, FLEETYARD_OPTION_TEXT, 0},
      {FLEETYARD_TEXT("strict"), FLEETYARD_TEXT(""), 0, FLEETYARD_OPTION_FLAG, 0}};
  FleetyardOptions given = {sizeof given, 3, list, FLEETYARD_TEXT("{}")};
  Settings *settings = (Settings *)make(&given, &sink);
  CHECK(settings && same(settings->share, 0.25) && settings->order == 1 && !settings->strict);
  free(settings);
  settings = (Settings *)make(&no_options, &sink);
  CHECK(settings && same(settings->share, 0.5) && settings->order == 0 && settings->strict);
  free(settings);
  CHECK(fleetyard_option(&given, "order") == &list[1] && !fleetyard_option(&given, "orders"));
  CHECK(same(fleetyard_number(&given, "order", 7), 7));
  list[0].number = 2;
  CHECK(create(&given) == FLEETYARD_STATUS_INVALID_INPUT);
  CHECK(strcmp(said, "options: `share` is above 1") == 0);
  given.struct_size = 8;
  CHECK(create(&given) == FLEETYARD_STATUS_INVALID_INPUT);
}

/* ..@
 * ...  where nobody goes west from the cell at the end. */
static const uint8_t passable[] = {1, 1, 0, 1, 1, 1};
static const uint8_t moves[] = {2 | 4, 4 | 8, 0, 1 | 2, 1 | 2 | 8, 0};

static void grids(const FleetyardInstance *instance) {
  const FleetyardGrid *grid = fleetyard_grid(instance->environment, &sink);
  uint32_t distance[6], queue[6];
  CHECK(grid && !fleetyard_roadmap(instance->environment, &sink));
  CHECK(strcmp(said, "this plugin knows roadmaps only") == 0);
  CHECK(fleetyard_move(grid, 1, 0) == FLEETYARD_NONE && fleetyard_move(grid, 1, 2) == 4);
  CHECK(fleetyard_move(grid, 1, 8) == 1 && fleetyard_move(grid, 2, 8) == FLEETYARD_NONE);
  CHECK(fleetyard_is_step(grid, 4, 4) && fleetyard_is_step(grid, 4, 5));
  CHECK(!fleetyard_is_step(grid, 5, 4) && !fleetyard_is_step(grid, 3, 5));
  CHECK(!fleetyard_is_step(grid, 3, 6) && !fleetyard_is_step(grid, FLEETYARD_NONE, FLEETYARD_NONE));
  CHECK(fleetyard_distances(grid, 5, distance, queue) == 5 && queue[0] == 5 && queue[1] == 4);
  CHECK(distance[0] == 3 && distance[2] == FLEETYARD_NONE);
  CHECK(fleetyard_distances(grid, 0, distance, queue) == 4 && distance[5] == FLEETYARD_NONE);
  CHECK(fleetyard_spread(grid, 0, false, distance, queue) == 5 && distance[5] == 3);
  CHECK(plan(instance) == 0 && form == FLEETYARD_FORM_CELLS && strcmp(noted, "order=other") == 0);
  CHECK(agents == 2 && offsets[1] == 2 && offsets[2] == 5 && entries[1] == 1 && entries[4] == 5);
}

static void roadmaps(FleetyardInstance instance) {
  const double x[] = {0, 3, 3}, y[] = {0, 0, 4}, length[] = {3, 4, 5}, duration[] = {1.5, 2, 2.5};
  const uint64_t edge_offsets[] = {0, 1, 2, 3};
  const uint32_t targets[] = {1, 2, 0};
  FleetyardRoadmap roadmap;
  memset(&roadmap, 0, sizeof roadmap);
  roadmap.struct_size = sizeof roadmap;
  roadmap.vertices = 3;
  roadmap.edges = 3;
  roadmap.x_m = x;
  roadmap.y_m = y;
  roadmap.edge_offsets = edge_offsets;
  roadmap.targets = targets;
  roadmap.length_m = length;
  roadmap.duration_s = duration;
  FleetyardEnvironment environment = *instance.environment;
  environment.representation = FLEETYARD_REPRESENTATION_ROADMAP;
  environment.view = &roadmap;
  const uint32_t starts[] = {0, 2}, goals[] = {1, 0};
  instance.environment = &environment;
  instance.motion = FLEETYARD_MOTION_STOP_GO;
  instance.starts = starts;
  instance.goals = goals;
  CHECK(plan(&instance) == 0 && form == FLEETYARD_FORM_VISITS && agents == 2 && offsets[2] == 4);
  CHECK(entries[0] == 0 && entries[1] == 1 && entries[2] == 2 && entries[3] == 0);
  CHECK(same(columns[0][1], 2.5) && same(columns[1][0], 1) && same(columns[0][3], 3.5));
  roadmap.flags = 1u << 7;
  CHECK(plan(&instance) == FLEETYARD_STATUS_UNSUPPORTED);
  roadmap.flags = FLEETYARD_ROADMAP_SYMMETRIC;
  CHECK(plan(&instance) == FLEETYARD_STATUS_SOLVED);
  roadmap.reserved = 1;
  CHECK(plan(&instance) == FLEETYARD_STATUS_INVALID_INPUT);
}

static void workspaces(FleetyardInstance instance) {
  const double x[] = {1, 2, 2, 1}, y[] = {1, 1, 2, 2};
  const uint64_t corner_offsets[] = {0, 4}, state_offsets[] = {0, 3, 6};
  const double states[] = {0, 0, 1, 3, 0, 2}, goals[] = {0, 3, 1, 3, 3, 2};
  FleetyardWorkspace workspace;
  memset(&workspace, 0, sizeof workspace);
  workspace.struct_size = sizeof workspace;
  workspace.obstacles = 1;
  workspace.max_x_m = workspace.max_y_m = 4;
  workspace.corner_offsets = corner_offsets;
  workspace.x_m = x;
  workspace.y_m = y;
  FleetyardEnvironment environment = *instance.environment;
  environment.representation = FLEETYARD_REPRESENTATION_CONTINUOUS;
  environment.view = &workspace;
  FleetyardFootprint footprint = {sizeof footprint, 0, 0.2, NULL, NULL};
  FleetyardRobot robot;
  memset(&robot, 0, sizeof robot);
  robot.struct_size = sizeof robot;
  robot.flags = FLEETYARD_ROBOT_HEADING;
  robot.footprint = &footprint;
  const FleetyardRobot *robots[] = {&robot, &robot};
  instance.environment = &environment;
  instance.motion = FLEETYARD_MOTION_DYNAMICS;
  instance.robots = robots;
  instance.robot_count = 1;
  instance.starts = instance.goals = NULL;
  instance.start_state_offsets = instance.goal_state_offsets = state_offsets;
  instance.start_states = states;
  instance.goal_states = goals;
  CHECK(fleetyard_workspace(&environment, &sink) == &workspace);
  CHECK(plan(&instance) == 0 && form == FLEETYARD_FORM_TRAJECTORIES && offsets[2] == 4);
  CHECK(segments == 20 && same(last_s, 19.5) && same(last_number, 2));
  CHECK(headings && same(columns[3][0], 1) && same(columns[3][3], 2) && same(columns[2][1], 3));
  robot.flags = 0;
  CHECK(plan(&instance) == 0 && !headings && same(columns[0][3], 1) && same(columns[1][2], 3));
  robot.dynamics = fleetyard_text("org.example.slide/1");
  CHECK(plan(&instance) == FLEETYARD_STATUS_SOLVED);
  robot.dynamics = fleetyard_text("org.example.slide/2");
  CHECK(plan(&instance) == FLEETYARD_STATUS_UNSUPPORTED && strstr(said, "slide/2"));
  robot.dynamics.len = 0;
  instance.window_s = 5;
  CHECK(plan(&instance) == FLEETYARD_STATUS_UNSUPPORTED);
  instance.window_s = 0;
  robot.flags = 1u << 9;
  CHECK(plan(&instance) == FLEETYARD_STATUS_UNSUPPORTED);
  robot.flags = 0;
  instance.robot_count = 2; /* and the plugin does not claim teams of different robots */
  CHECK(plan(&instance) == FLEETYARD_STATUS_UNSUPPORTED);
  instance.robot_count = 0;
  CHECK(plan(&instance) == FLEETYARD_STATUS_INVALID_INPUT);
}

/* What no version allows is invalid; what a later one may is unsupported. */
static void refusals(FleetyardInstance instance) {
  FleetyardEnvironment environment = *instance.environment;
  FleetyardGrid grid = *(const FleetyardGrid *)environment.view;
  FleetyardPart part = {FLEETYARD_TEXT("org.example.dust/1"), NULL, FLEETYARD_PART_CRITICAL, 0};
  environment.view = &grid;
  instance.environment = &environment;
  CHECK(plan(&instance) == FLEETYARD_STATUS_SOLVED);
  const int32_t codes[] = {0, FLEETYARD_REPRESENTATION_CONTINUOUS + 1, -1};
  for (int i = 0; i < 3; i++) {
    const int32_t refused =
        codes[i] == 0 ? FLEETYARD_STATUS_INVALID_INPUT : FLEETYARD_STATUS_UNSUPPORTED;
    environment.representation = codes[i];
    CHECK(plan(&instance) == refused && strstr(said, "representation"));
    environment.representation = FLEETYARD_REPRESENTATION_GRID;
    instance.motion = codes[i] > 0 ? FLEETYARD_MOTION_ROTATION : codes[i]; /* not claimed */
    CHECK(plan(&instance) == refused && strstr(said, "motion"));
    instance.motion = FLEETYARD_MOTION_PEBBLE;
    instance.objective = codes[i];
    CHECK(plan(&instance) == refused && strstr(said, "objective"));
    instance.objective = FLEETYARD_OBJECTIVE_MAKESPAN;
  }
  instance.flags = FLEETYARD_INSTANCE_CYCLES | FLEETYARD_INSTANCE_STRICT;
  CHECK(plan(&instance) == FLEETYARD_STATUS_SOLVED);
  instance.flags = 1u << 30;
  CHECK(plan(&instance) == FLEETYARD_STATUS_UNSUPPORTED && strstr(said, "40000000"));
  instance.flags = 0;
  grid.connectivity = 8;
  CHECK(plan(&instance) == FLEETYARD_STATUS_UNSUPPORTED);
  grid.connectivity = 4;

  instance.parts.list = environment.parts.list = &part;
  instance.parts.count = 1;
  CHECK(plan(&instance) == FLEETYARD_STATUS_UNSUPPORTED && strstr(said, "org.example.dust/1"));
  part.flags = 0;
  CHECK(plan(&instance) == FLEETYARD_STATUS_SOLVED);
  part.flags = FLEETYARD_PART_CRITICAL;
  part.id = fleetyard_text("org.example.known/1");
  CHECK(plan(&instance) == FLEETYARD_STATUS_SOLVED);
  CHECK(fleetyard_part(&instance.parts, "org.example.known/1") == &part);
  CHECK(!fleetyard_part(&instance.parts, "org.example.known/2"));
  instance.parts.count = 0;
  environment.parts.count = 1;
  part.id = fleetyard_text("org.example.known/2");
  CHECK(plan(&instance) == FLEETYARD_STATUS_UNSUPPORTED);
  CHECK(planner.plan(planner.context, &instance, &budget, &sink) == FLEETYARD_STATUS_INVALID_INPUT);
  CHECK(strcmp(said, "the call came before a successful `prepare`") == 0);
  environment.parts.count = 0;

  instance.reserved = 1;
  CHECK(plan(&instance) == FLEETYARD_STATUS_INVALID_INPUT);
  instance.reserved = 0;
  const uint64_t none[] = {0, 0, 1}, two[] = {0, 1, 3};
  const uint32_t goals[] = {1, 5, 5}, off[] = {1, 6};
  instance.goal_offsets = none;
  CHECK(plan(&instance) == FLEETYARD_STATUS_UNSUPPORTED);
  instance.goal_offsets = two;
  instance.goals = goals;
  CHECK(plan(&instance) == FLEETYARD_STATUS_UNSUPPORTED);
  const uint64_t one[] = {0, 1, 2};
  instance.goal_offsets = one;
  instance.goals = off;
  CHECK(plan(&instance) == FLEETYARD_STATUS_INVALID_INPUT && strstr(said, "off the map"));
  instance.goals = goals;
  CHECK(plan(&instance) == FLEETYARD_STATUS_SOLVED);
}

/* A structure of a later version may be longer, and none is shorter. */
static void sizes(const FleetyardInstance *instance) {
  struct {
    FleetyardInstance known;
    double added;
  } longer = {*instance, 7};
  longer.known.struct_size = sizeof longer;
  CHECK(plan(&longer.known) == FLEETYARD_STATUS_SOLVED);
  longer.known.struct_size = sizeof longer.known - 1;
  CHECK(plan(&longer.known) == FLEETYARD_STATUS_INVALID_INPUT && strstr(said, "too short"));

  struct {
    FleetyardPlanner known;
    double added;
  } room;
  memset(&room, 0x55, sizeof room);
  room.known.struct_size = sizeof(FleetyardPlanner) - 1;
  FleetyardPlanner before = room.known;
  CHECK(factory()->create(NULL, 0, &no_options, &sink, &room.known) ==
        FLEETYARD_STATUS_UNSUPPORTED);
  CHECK(memcmp(&before, &room.known, sizeof before) == 0);
  const double added = room.added;
  room.known.struct_size = sizeof room;
  CHECK(factory()->create(NULL, 0, &no_options, &sink, &room.known) == FLEETYARD_STATUS_SOLVED);
  CHECK(room.known.struct_size == sizeof(FleetyardPlanner) &&
        memcmp(&added, &room.added, sizeof added) == 0);
  room.known.destroy(room.known.context);
}

static void answers(const FleetyardInstance *instance) {
  const int32_t codes[] = {FLEETYARD_TOO_LATE, FLEETYARD_BUSY, FLEETYARD_REJECTED};
  const int32_t statuses[] = {FLEETYARD_STATUS_TIMED_OUT, FLEETYARD_STATUS_GAVE_UP,
                              FLEETYARD_STATUS_INTERNAL_ERROR};
  for (int i = 0; i < 3; i++) {
    answer = codes[i];
    CHECK(plan(instance) == statuses[i]);
  }
  answer = FLEETYARD_OK;
  budget.answer_by_ns = clock_ns + 1;
  CHECK(fleetyard_time_is_up(&budget, &sink) == FLEETYARD_STATUS_CANCELLED);
  clock_ns++;
  CHECK(fleetyard_time_is_up(&budget, &sink) == FLEETYARD_STATUS_TIMED_OUT);
}

static void requests(FleetyardInstance next) {
  const uint64_t goal_offsets[] = {0, 0, 1}, task_offsets[] = {0, 1, 3}, ids[] = {7, 8};
  const uint32_t goals[] = {5}, places[] = {1, 3, 4};
  const double released[] = {0.5, 1.5};
  next.goal_offsets = goal_offsets;
  next.goals = goals;
  next.window_steps = 9;
  FleetyardFleetState state;
  memset(&state, 0, sizeof state);
  state.struct_size = sizeof state;
  state.tasks = 2;
  state.next = &next;
  state.task_ids = ids;
  state.task_offsets = task_offsets;
  state.task_places = places;
  state.task_released_s = released;
  FleetyardDecision decision = fleetyard_decide(&state);
  fleetyard_assign(&decision, 1, 0);
  CHECK(fleetyard_submit_request(&decision, &sink) == FLEETYARD_STATUS_SOLVED);
  CHECK(asked.agents == 2 && offsets[1] == 2 && offsets[2] == 3 && asked.window_steps == 9);
  CHECK(entries[0] == 3 && entries[1] == 4 && entries[2] == 5 && asked.assignment_count == 1);
  CHECK(decision.assignments[0].task == 8 && decision.assignments[0].agent == 0);
  fleetyard_free_decision(&decision);
  CHECK(!decision.assignments);
}

static uint8_t remembered[4];

static int32_t remember(void *context, const FleetyardBytes *bytes) {
  (void)context;
  if (bytes->len > sizeof remembered)
    return FLEETYARD_REJECTED;
  memcpy(remembered, bytes->ptr, (size_t)bytes->len);
  return FLEETYARD_OK;
}

static const void *keeps(void *context, FleetyardStr id) {
  static const FleetyardKeep host = {sizeof host, 0, remember};
  (void)context;
  return fleetyard_equals(id, FLEETYARD_KEEP_ID) ? &host : NULL;
}

static const void *keeps_nothing(void *context, FleetyardStr id) {
  (void)context, (void)id;
  return NULL;
}

/* What the host keeps of a fleet is found by its type, unless it is JSON or too short. */
static void memory(void) {
  const uint8_t averages[] = {0, 255};
  const FleetyardSnapshot first = {sizeof first, 0, 0, averages, averages};
  FleetyardTraffic traffic = {sizeof traffic, 2, 2, 20, 50, 3.5, 0.5, &first, &first};
  const uint64_t begins[] = {0, 2};
  const uint8_t letters[] = {'E', '.'};
  const FleetyardRestOfPlan rest = {sizeof rest, 1, begins, letters};
  const uint64_t tasks[] = {7};
  const uint32_t errands[] = {1};
  const double times[] = {2.5};
  const FleetyardGoalTasks goals = {sizeof goals, 0, 1, 9, tasks, errands, times, times};
  const uint16_t factors[] = {100, 250};
  const FleetyardGuidance guidance = {sizeof guidance, 2, 2, factors, factors};
  const FleetyardBytes kept = {sizeof kept, 0, averages, 2};
  FleetyardPart list[] = {{FLEETYARD_TEXT(FLEETYARD_TRAFFIC_ID), &traffic, 0, 0},
                          {FLEETYARD_TEXT(FLEETYARD_REST_OF_PLAN_ID), &rest, 0, 0},
                          {FLEETYARD_TEXT(FLEETYARD_GOAL_TASKS_ID), &goals, 0, 0},
                          {FLEETYARD_TEXT(FLEETYARD_GUIDANCE_ID), &guidance, 0, 0},
                          {FLEETYARD_TEXT(FLEETYARD_KEPT_ID), &kept, 0, 0}};
  FleetyardParts parts = {list, 5};
  CHECK(fleetyard_traffic(&parts)->last->waiting[1] == 255);
  CHECK(fleetyard_move_of(fleetyard_rest_of_plan(&parts)->moves[0]) == 1);
  CHECK(fleetyard_move_of('.') == 8 && fleetyard_move_of('x') < 0 && fleetyard_move_of(0) < 0);
  CHECK(fleetyard_goal_tasks(&parts)->tasks[0] == 7 && fleetyard_kept(&parts)->len == 2);
  CHECK(fleetyard_guidance(&parts)->moves[1] == 250);
  traffic.struct_size--;
  list[1].flags = FLEETYARD_PART_JSON;
  parts.count = 4;
  CHECK(!fleetyard_traffic(&parts) && !fleetyard_rest_of_plan(&parts) && !fleetyard_kept(&parts));

  sink.get_extension = keeps_nothing;
  CHECK(fleetyard_keep(&sink, averages, 2) == FLEETYARD_BUSY);
  sink.get_extension = keeps;
  CHECK(fleetyard_keep(&sink, averages, 2) == FLEETYARD_OK && remembered[1] == 255);
  CHECK(fleetyard_keep(&sink, averages, 5) == FLEETYARD_REJECTED);
}

/* Paths grow as they need to, in any order of agents, and a plan is read past its end. */
static void paths(const FleetyardInstance *instance) {
  FleetyardPaths all = fleetyard_paths(FLEETYARD_FORM_CELLS, 2);
  for (uint32_t cell = 0; cell < 1000; cell++)
    fleetyard_add_cell(&all, 1, cell);
  CHECK(fleetyard_path_at(&all.of[1], 7) == 7 && fleetyard_path_at(&all.of[1], 5000) == 999);
  CHECK(fleetyard_path_at(&all.of[0], 0) == FLEETYARD_NONE);
  FleetyardFlat flat = fleetyard_flat(&all);
  CHECK(flat.offsets[1] == 0 && flat.offsets[2] == 1000 && flat.places[999] == 999);
  FleetyardCells body = {sizeof body, 0, flat.places};
  FleetyardPlan plan_of;
  memset(&plan_of, 0, sizeof plan_of);
  plan_of.struct_size = sizeof plan_of;
  plan_of.agents = 2;
  plan_of.form = FLEETYARD_FORM_CELLS;
  plan_of.offsets = flat.offsets;
  plan_of.body = &body;
  CHECK(fleetyard_at(&plan_of, 0, 0) == FLEETYARD_NONE);
  CHECK(fleetyard_at(&plan_of, 1, 7) == 7 && fleetyard_at(&plan_of, 1, 5000) == 999);
  CHECK(fleetyard_check_cells(&plan_of, instance, &east, &sink) == FLEETYARD_STATUS_SOLVED);
  plan_of.agents = 1;
  CHECK(fleetyard_check_cells(&plan_of, instance, &east, &sink) == FLEETYARD_STATUS_INVALID_INPUT);
  plan_of.form = FLEETYARD_FORM_VISITS;
  CHECK(fleetyard_check_cells(&plan_of, instance, &east, &sink) == FLEETYARD_STATUS_UNSUPPORTED);
  fleetyard_free_flat(&flat);
  fleetyard_free_paths(&all);
  CHECK(all.agents == 0 && !all.of);
}

/* ---- Annotations --------------------------------------------------------------- */

static FleetyardAnnotation shown;
static uint64_t shown_places, shown_points;

static int32_t annotate(void *context, const FleetyardAnnotation *annotation) {
  (void)context;
  shown = *annotation;
  shown_places = annotation->places ? annotation->places[1] : 0;
  shown_points = annotation->x_m ? annotation->offsets[1] : 0;
  return FLEETYARD_OK;
}

static bool wanted;

static const void *extension(void *context, FleetyardStr id) {
  static const FleetyardAnnotations annotations = {sizeof annotations, 0, annotate};
  (void)context;
  return wanted && fleetyard_equals(id, FLEETYARD_ANNOTATIONS_ID) ? &annotations : NULL;
}

static void annotations(void) {
  const uint32_t places[] = {3, 4};
  const double x_m[] = {0.5, 1, 2}, y_m[] = {0, 1, 0};
  FleetyardAnnotation about = fleetyard_annotation("constraints", "not here");
  about.agent = 7;
  sink.get_extension = extension;
  CHECK(!fleetyard_annotations(&sink));
  fleetyard_annotate_places(&sink, about, places, 2);
  CHECK(shown.struct_size == 0);
  wanted = true;
  CHECK(fleetyard_annotations(&sink));
  fleetyard_annotate_places(&sink, about, places, 2);
  CHECK(shown.struct_size == sizeof shown && shown.shape == FLEETYARD_SHAPE_PLACES);
  CHECK(shown.count == 1 && shown.agent == 7 && shown_places == 4 && isinf(shown.to_s));
  CHECK(fleetyard_equals(shown.layer, "constraints") && fleetyard_equals(shown.text, "not here"));
  fleetyard_annotate_points(&sink, about, FLEETYARD_SHAPE_RINGS, x_m, y_m, 3);
  CHECK(shown.shape == FLEETYARD_SHAPE_RINGS && !shown.places && shown_points == 3);
}

int main(void) {
  memset(&sink, 0, sizeof sink);
  sink.struct_size = sizeof sink;
  sink.submit_plan = submit_plan;
  sink.submit_request = submit_request;
  sink.now_ns = now_ns;
  sink.fail = explain;
  sink.note = note;
  budget.struct_size = sizeof budget;
  FleetyardGrid grid = {sizeof grid, 2, 3, 4, 1.0, 1.0, 0.0, 0.0, passable, passable, moves};
  FleetyardEnvironment environment = {sizeof environment,     FLEETYARD_REPRESENTATION_GRID,
                                      &grid,                  FLEETYARD_TEXT("test"),
                                      FLEETYARD_TEXT("0f3c"), {NULL, 0}};
  const uint32_t starts[] = {0, 3}, goals[] = {1, 5};
  const uint64_t goal_offsets[] = {0, 1, 2};
  FleetyardInstance instance;
  memset(&instance, 0, sizeof instance);
  instance.struct_size = sizeof instance;
  instance.agents = 2;
  instance.environment = &environment;
  instance.motion = FLEETYARD_MOTION_PEBBLE;
  instance.objective = FLEETYARD_OBJECTIVE_SUM_OF_COSTS;
  instance.starts = starts;
  instance.goal_offsets = goal_offsets;
  instance.goals = goals;

  CHECK(!fleetyard_plugin_entry_v1.get_factory(fleetyard_text("fleetyard.planner/2")));
  CHECK(factory() && factory()->count(NULL) == 1 && factory()->descriptor(NULL, 0) == &east);
  CHECK(!factory()->descriptor(NULL, 1));
  planner.struct_size = sizeof planner;
  CHECK(factory()->create(NULL, 1, &no_options, &sink, &planner) != 0);
  options();
  CHECK(create(&no_options) == FLEETYARD_STATUS_SOLVED);
  CHECK(planner.plan(planner.context, &instance, &budget, &sink) == FLEETYARD_STATUS_INVALID_INPUT);
  grids(&instance);
  roadmaps(instance);
  workspaces(instance);
  refusals(instance);
  sizes(&instance);
  answers(&instance);
  requests(instance);
  memory();
  paths(&instance);
  annotations();
  planner.destroy(planner.context);
  return 0;
}
