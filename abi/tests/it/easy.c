/* Plays the host to a planner on fleetyard_easy.h: options, maps, plans, and what is exported.
 * C11 and C++17. Ends with the line of the check that fails, if one does. */
#include "fleetyard_easy.h"

typedef struct Settings {
  FleetyardMap map;
  double share, order, strict;
} Settings;

static int32_t configure(void *context, FleetyardStr options, const FleetyardSink *sink) {
  Settings *settings = (Settings *)context;
  const FleetyardOption known[] = {{"share", &settings->share, 0, 1.5, NULL},
                                   {"order", &settings->order, 0, 0, "first last any"},
                                   {"strict", &settings->strict, 0, 1, NULL}};
  return fleetyard_read_options(options, known, 3, sink);
}

static int32_t solve(void *context, const FleetyardInstance *instance,
                     const FleetyardBudget *budget, const FleetyardSink *sink) {
  const FleetyardMap *map = &((const Settings *)context)->map;
  FleetyardLists paths;
  (void)budget;
  memset(&paths, 0, sizeof paths);
  for (uint32_t agent = 0; agent < instance->agents; agent++) {
    uint32_t cell = instance->starts[agent];
    for (; cell != FLEETYARD_NONE; cell = map->neighbours[cell][1])
      fleetyard_append(&paths, cell);
    fleetyard_end_list(&paths);
  }
  return fleetyard_submit_plan(&paths, sink);
}

static const FleetyardDescriptor east = {
    sizeof(FleetyardDescriptor), 0,
    FLEETYARD_TEXT("east"),      FLEETYARD_TEXT("East"),
    FLEETYARD_TEXT("0.1.0"),     FLEETYARD_TEXT("Goes east."),
    FLEETYARD_TEXT(""),          FLEETYARD_TEXT(""),
    FLEETYARD_CAPABILITY_GRID};

FLEETYARD_PLANNER(east, sizeof(Settings), configure, solve);

/* ---- The host ---------------------------------------------------------------- */

static char said[600];
static uint32_t agents, cells[2000];
static uint64_t offsets[3];

static int32_t submit_plan(void *context, const FleetyardPlan *plan) {
  agents = plan->agents;
  memcpy(offsets, plan->offsets, (agents + 1) * sizeof *offsets);
  memcpy(cells, plan->cells, (size_t)offsets[agents] * sizeof *cells);
  return context ? FLEETYARD_REJECTED : FLEETYARD_OK;
}

static void explain(void *context, FleetyardStr message) {
  (void)context;
  snprintf(said, sizeof said, "%.*s", (int)message.len, (const char *)message.ptr);
}

static void check_at(bool holds, int line) {
  if (!holds) {
    fprintf(stderr, "line %d: %s\n", line, said);
    exit(1);
  }
}
#define CHECK(condition) check_at(condition, __LINE__)

static FleetyardSink sink;

/* The status of options, and what they became. */
static int32_t read(const char *options, Settings *settings) {
  memset(settings, 0, sizeof *settings);
  said[0] = 0;
  return configure(settings, fleetyard_text(options), &sink);
}

static void options(void) {
  const int32_t wrong = FLEETYARD_STATUS_INVALID_INPUT;
  Settings settings;
  CHECK(read("", &settings) == 0 && read("{}", &settings) == 0 && read(" { } ", &settings) == 0);
  CHECK(read("{\"share\": 15e-1,\n\"order\":\"last\", \"strict\" : true}", &settings) == 0);
  CHECK(settings.share >= 1.5 && settings.order >= 1 && settings.strict >= 1);
  CHECK(read("{\"strict\":false, \"share\":0.25}", &settings) == 0);
  CHECK(settings.share >= 0.25 && settings.strict <= 0);
  CHECK(read("{\"order\": \"any\"}", &settings) == 0 && settings.order >= 2);
  static const char *const refused[] = {
      "[]", "{", "{\"share\"}", "{\"share\": }", "{\"share\": 1,}", "{\"share\": 1} 2",
      "{\"share\": 0x1}", "{\"share\": nan}", "{\"share\": 1 2}", "{\"share\": \"1\"}",
      "{\"share\": 1.6}", "{\"share\": -1}", "{\"order\": \"fir\"}", "{\"order\": \"first last\"}",
      "{\"order\": \"\"}", "{\"order\": 1}", "{\"order\": \"last}", "{\"other\": 1}", "{\"shar",
      "{\"share\": [1]}"};
  for (size_t i = 0; i < sizeof refused / sizeof *refused; i++) {
    CHECK(read(refused[i], &settings) == wrong && strncmp(said, "options: ", 9) == 0);
  }
  CHECK(read("{\"order\": \"none\"}", &settings) == wrong);
  CHECK(strcmp(said, "options: `order` is none of: first last any") == 0);
  CHECK(fleetyard_no_options(NULL, fleetyard_text("{}"), &sink) == 0);
  CHECK(fleetyard_no_options(NULL, fleetyard_text("{\"a\":1}"), &sink) == wrong);
  CHECK(strcmp(said, "options: there is no option `a`") == 0);
}

/* ..@
 * ... */
static const uint8_t passable[] = {1, 1, 0, 1, 1, 1};

static void maps(const FleetyardEnvironment *environment) {
  FleetyardMap map;
  uint32_t distance[6], queue[6];
  memset(&map, 0, sizeof map);
  for (int round = 0; round < 2; round++)
    CHECK(fleetyard_learn(&map, environment, &sink) == 0 && map.cells == 6);
  CHECK(map.neighbours[1][0] == FLEETYARD_NONE && map.neighbours[1][1] == FLEETYARD_NONE);
  CHECK(map.neighbours[1][2] == 4 && map.neighbours[1][3] == 0);
  CHECK(fleetyard_is_step(&map, 4, 4) && fleetyard_is_step(&map, 4, 1));
  CHECK(!fleetyard_is_step(&map, 1, 2) && !fleetyard_is_step(&map, 3, 5));
  CHECK(!fleetyard_is_step(&map, 3, 6) && !fleetyard_is_step(&map, FLEETYARD_NONE, FLEETYARD_NONE));
  CHECK(fleetyard_distances(&map, 0, distance, queue) == 5 && queue[0] == 0 && queue[4] == 5);
  CHECK(distance[5] == 3 && distance[2] == FLEETYARD_NONE);
  fleetyard_forget(&map);
  FleetyardEnvironment other = *environment;
  other.representation = FLEETYARD_REPRESENTATION_ROADMAP;
  CHECK(fleetyard_learn(&map, &other, &sink) == FLEETYARD_STATUS_UNSUPPORTED && !map.cells);
}

static void plans(const FleetyardEnvironment *environment) {
  const uint32_t starts[] = {0, 3};
  FleetyardInstance instance;
  FleetyardPlanner planner;
  memset(&instance, 0, sizeof instance);
  instance.struct_size = sizeof instance;
  instance.agents = 2;
  instance.starts = starts;
  const FleetyardPluginEntry *entry = &fleetyard_plugin_entry_v1;
  CHECK(!entry->get_factory(fleetyard_text("fleetyard.planner/2")));
  const FleetyardPlannerFactory *factory = (const FleetyardPlannerFactory *)entry->get_factory(
      fleetyard_text(FLEETYARD_PLANNER_FACTORY_ID));
  CHECK(factory && factory->count() == 1 && factory->descriptor(0) == &east);
  CHECK(!factory->descriptor(1));
  CHECK(factory->create(1, fleetyard_text(""), &sink, &planner) != 0);
  CHECK(factory->create(0, fleetyard_text("{\"share\": 2}"), &sink, &planner) != 0);
  CHECK(factory->create(0, fleetyard_text(""), &sink, &planner) == 0);
  CHECK(planner.prepare(planner.context, environment, NULL, &sink) == 0);
  CHECK(planner.plan(planner.context, &instance, NULL, &sink) == 0);
  CHECK(agents == 2 && offsets[1] == 2 && offsets[2] == 5 && cells[1] == 1 && cells[4] == 5);
  sink.context = &sink;
  CHECK(planner.plan(planner.context, &instance, NULL, &sink) == FLEETYARD_STATUS_TIMED_OUT);
  sink.context = NULL;
  planner.destroy(planner.context);
}

/* Lists grow as they need to, and a plan is read past its end. */
static void lists(void) {
  FleetyardLists all;
  memset(&all, 0, sizeof all);
  fleetyard_end_list(&all);
  for (uint32_t cell = 0; cell < 1000; cell++)
    fleetyard_append(&all, cell);
  fleetyard_end_list(&all);
  CHECK(all.lists == 2 && all.offsets[1] == 0 && all.offsets[2] == 1000 && all.cells[999] == 999);
  FleetyardPlan plan = {sizeof plan, 2, all.offsets, all.cells};
  CHECK(fleetyard_at(&plan, 0, 0) == FLEETYARD_NONE);
  CHECK(fleetyard_at(&plan, 1, 7) == 7 && fleetyard_at(&plan, 1, 5000) == 999);
  fleetyard_free_lists(&all);
  CHECK(all.lists == 0 && !all.cells);
}

int main(void) {
  memset(&sink, 0, sizeof sink);
  sink.struct_size = sizeof sink;
  sink.submit_plan = submit_plan;
  sink.fail = explain;
  FleetyardGrid grid = {sizeof grid, 2, 3, 4, 1.0, 1.0, passable, passable};
  FleetyardEnvironment environment = {sizeof environment, FLEETYARD_REPRESENTATION_GRID,
                                      fleetyard_text("test"), &grid};
  options();
  maps(&environment);
  plans(&environment);
  lists();
  return 0;
}
