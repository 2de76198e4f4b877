/* Tries a planner library on a MovingAI map and scenario, without the host: for
 * valgrind, sanitizers and debuggers, and to see the host's side of the contract
 * in one short file.
 *
 *     try LIBRARY MAP SCENARIO AGENTS [SECONDS [SEED [ROUNDS [NAME=VALUE]...]]]
 *
 * Options are given to the planner as they are: nobody looks at its schema or its defaults. It
 * checks the plan by the rules of classical MAPF in the plainest way. It is no
 * replacement for `fleetyard run`: it stops nobody and trusts the library.
 */

#define _POSIX_C_SOURCE 200809L

#include "fleetyard.h"

#include <dlfcn.h>
#include <inttypes.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

typedef struct {
  uint64_t answer_by_ns;
  uint32_t agents;
  uint64_t *offsets; /* the last plan, copied */
  uint32_t *cells;
} Host;

static uint64_t now_ns(void) {
  struct timespec now = {0, 0};
  clock_gettime(CLOCK_MONOTONIC, &now);
  return (uint64_t)now.tv_sec * 1000000000u + (uint64_t)now.tv_nsec;
}

static FleetyardStr text(const char *bytes) {
  return (FleetyardStr){bytes, strlen(bytes)};
}

static void die(const char *message) {
  fprintf(stderr, "try: %s\n", message);
  exit(2);
}

static void *array(size_t count, size_t size) {
  void *memory = calloc(count ? count : 1, size);
  if (!memory)
    die("out of memory");
  return memory;
}

/* ---- The sink -------------------------------------------------------------- */

static int32_t submit_plan(void *context, const FleetyardPlan *plan) {
  Host *host = context;
  if (!plan || plan->struct_size < sizeof *plan || plan->agents != host->agents ||
      plan->form != FLEETYARD_FORM_CELLS || !plan->offsets || !plan->body)
    return FLEETYARD_REJECTED;
  const uint32_t *cells = ((const FleetyardCells *)plan->body)->cells;
  uint64_t total = plan->offsets[plan->agents];
  free(host->offsets);
  free(host->cells);
  host->offsets = array((size_t)plan->agents + 1, sizeof *host->offsets);
  host->cells = array((size_t)total, sizeof *host->cells);
  memcpy(host->offsets, plan->offsets, ((size_t)plan->agents + 1) * sizeof *host->offsets);
  memcpy(host->cells, cells, (size_t)total * sizeof *host->cells);
  return FLEETYARD_OK;
}

static int32_t submit_request(void *context, const FleetyardRequest *request) {
  (void)context;
  (void)request;
  return FLEETYARD_REJECTED;
}

static uint64_t clock_ns(void *context) {
  (void)context;
  return now_ns();
}

static void metric(void *context, FleetyardStr name, double value) {
  (void)context;
  printf(" %.*s=%g", (int)name.len, name.ptr, value);
}

static void note(void *context, FleetyardStr name, FleetyardStr value) {
  (void)context;
  printf(" %.*s=%.*s", (int)name.len, name.ptr, (int)value.len, value.ptr);
}

static void log_line(void *context, int32_t level, FleetyardStr line) {
  (void)context;
  fprintf(stderr, "log %" PRId32 ": %.*s\n", level, (int)line.len, line.ptr);
}

static void progress(void *context, uint64_t done, uint64_t total) {
  (void)context;
  (void)done;
  (void)total;
}

static int32_t cancelled(void *context) { return now_ns() >= ((Host *)context)->answer_by_ns; }

static void explain(void *context, FleetyardStr message) {
  (void)context;
  fprintf(stderr, "fail: %.*s\n", (int)message.len, message.ptr);
}

static const void *no_extension(void *context, FleetyardStr id) {
  (void)context;
  (void)id;
  return NULL;
}

/* ---- Map and scenario ------------------------------------------------------ */

static uint8_t *read_map(const char *path, uint32_t *rows, uint32_t *cols, uint8_t **terrain) {
  FILE *file = fopen(path, "r");
  if (!file || fscanf(file, "type %*s height %" SCNu32 " width %" SCNu32 " map", rows, cols) != 2)
    die("cannot read the map");
  size_t cells = (size_t)*rows * *cols;
  uint8_t *passable = array(cells, 1);
  *terrain = array(cells, 1);
  for (size_t cell = 0; cell < cells; cell++) {
    int letter = fgetc(file);
    while (letter == '\n' || letter == '\r')
      letter = fgetc(file);
    if (letter == EOF)
      die("the map is too short");
    (*terrain)[cell] = (uint8_t)letter;
    passable[cell] = letter == '.' || letter == 'G' || letter == 'S';
  }
  fclose(file);
  return passable;
}

static void read_scenario(const char *path, uint32_t agents, uint32_t cols, uint32_t *starts,
                          uint32_t *goals) {
  FILE *file = fopen(path, "r");
  if (!file || fscanf(file, "version %*s") != 0)
    die("cannot read the scenario");
  for (uint32_t i = 0; i < agents; i++) {
    uint32_t x, y, to_x, to_y;
    if (fscanf(file,
               "%*s %*s %*s %*s %" SCNu32 " %" SCNu32 " %" SCNu32 " %" SCNu32 " %*s", &x, &y,
               &to_x, &to_y) != 4)
      die("the scenario has not so many agents");
    starts[i] = y * cols + x;
    goals[i] = to_y * cols + to_x;
  }
  fclose(file);
}

/* The moves on a map with four neighbours: to every free cell beside. */
static uint8_t *moves_of(const uint8_t *passable, uint32_t rows, uint32_t cols) {
  uint8_t *moves = array((size_t)rows * cols, 1);
  for (uint32_t cell = 0; cell < rows * cols; cell++) {
    if (!passable[cell])
      continue;
    bool north = cell >= cols && passable[cell - cols];
    bool south = cell + cols < rows * cols && passable[cell + cols];
    bool east = cell % cols + 1 < cols && passable[cell + 1];
    bool west = cell % cols > 0 && passable[cell - 1];
    moves[cell] = (uint8_t)((north ? FLEETYARD_MOVE_NORTH : 0) | (east ? FLEETYARD_MOVE_EAST : 0) |
                            (south ? FLEETYARD_MOVE_SOUTH : 0) | (west ? FLEETYARD_MOVE_WEST : 0));
  }
  return moves;
}

/* An option NAME=VALUE: a number, true, false or a text. */
static FleetyardPluginOption option_of(char *given) {
  char *value = strchr(given, '='), *end = NULL;
  if (!value)
    die("options are NAME=VALUE");
  FleetyardPluginOption option = {.kind = FLEETYARD_OPTION_TEXT};
  option.name = (FleetyardStr){given, (size_t)(value++ - given)};
  option.text = text(value);
  option.number = strtod(value, &end);
  if (*value && !*end)
    option.kind = FLEETYARD_OPTION_NUMBER;
  bool yes = strcmp(value, "true") == 0;
  if (yes || strcmp(value, "false") == 0) {
    option.kind = FLEETYARD_OPTION_FLAG;
    option.number = yes ? 1 : 0;
  }
  return option;
}

/* ---- Checking -------------------------------------------------------------- */

static uint32_t at(const Host *host, uint32_t agent, uint64_t time) {
  uint64_t last = host->offsets[agent + 1] - host->offsets[agent] - 1;
  return host->cells[host->offsets[agent] + (time < last ? time : last)];
}

static const char *check(const Host *host, const uint8_t *passable, uint32_t rows, uint32_t cols,
                         const uint32_t *starts, const uint32_t *goals, uint64_t *cost,
                         uint64_t *makespan) {
  *cost = *makespan = 0;
  for (uint32_t agent = 0; agent < host->agents; agent++) {
    uint64_t length = host->offsets[agent + 1] - host->offsets[agent];
    if (length == 0 || at(host, agent, 0) != starts[agent] ||
        at(host, agent, length) != goals[agent])
      return "a path does not lead from start to goal";
    uint64_t arrival = length - 1;
    while (arrival > 0 && at(host, agent, arrival - 1) == goals[agent])
      arrival--;
    *cost += arrival;
    *makespan = arrival > *makespan ? arrival : *makespan;
    for (uint64_t time = 0; time < length; time++) {
      uint32_t cell = at(host, agent, time), before = at(host, agent, time ? time - 1 : 0);
      if (cell >= rows * cols || !passable[cell])
        return "a path leaves the free cells";
      uint32_t apart = (uint32_t)abs((int)(cell / cols) - (int)(before / cols)) +
                       (uint32_t)abs((int)(cell % cols) - (int)(before % cols));
      if (apart > 1)
        return "a step is longer than one cell";
    }
  }
  for (uint64_t time = 0; time <= *makespan; time++)
    for (uint32_t a = 0; a < host->agents; a++)
      for (uint32_t b = a + 1; b < host->agents; b++) {
        if (at(host, a, time) == at(host, b, time))
          return "two agents are in one cell";
        if (at(host, a, time) == at(host, b, time + 1) && at(host, b, time) == at(host, a, time + 1))
          return "two agents exchange cells";
      }
  return NULL;
}

int main(int count, char **arguments) {
  if (count < 5)
    die("try LIBRARY MAP SCENARIO AGENTS [SECONDS [SEED [ROUNDS [NAME=VALUE]...]]]");
  double seconds = count > 5 ? atof(arguments[5]) : 10.0;
  uint64_t seed = count > 6 ? strtoull(arguments[6], NULL, 10) : 0;
  int rounds = count > 7 ? atoi(arguments[7]) : 1;
  FleetyardOptions options = {.struct_size = sizeof options, .json = text("{}")};
  FleetyardPluginOption *list = array((size_t)count, sizeof *list);
  for (int i = 8; i < count; i++)
    list[options.count++] = option_of(arguments[i]);
  options.list = list;

  uint32_t rows, cols, agents = (uint32_t)strtoul(arguments[4], NULL, 10);
  uint8_t *terrain, *passable = read_map(arguments[2], &rows, &cols, &terrain);
  uint8_t *moves = moves_of(passable, rows, cols);
  uint32_t *starts = array(agents, sizeof *starts), *goals = array(agents, sizeof *goals);
  uint64_t *goal_offsets = array((size_t)agents + 1, sizeof *goal_offsets);
  read_scenario(arguments[3], agents, cols, starts, goals);
  for (uint32_t i = 0; i <= agents; i++)
    goal_offsets[i] = i;

  void *library = dlopen(arguments[1], RTLD_NOW | RTLD_LOCAL);
  if (!library)
    die(dlerror());
  const FleetyardPluginEntry *entry = dlsym(library, "fleetyard_plugin_entry_v1");
  if (!entry || entry->struct_size < sizeof *entry || entry->abi_major != FLEETYARD_ABI_MAJOR)
    die("the library has no entry, or one for another version");
  FleetyardHost about = {sizeof about, FLEETYARD_ABI_MAJOR, FLEETYARD_ABI_MINOR, NULL,
                         text("try"),  text("0"),           no_extension};
  if (entry->init && entry->init(&about, text(arguments[1])) != FLEETYARD_OK)
    die("the library does not want to be used");
  const FleetyardPlannerFactory *factory = entry->get_factory(text("fleetyard.planner/1"));
  if (!factory || factory->count(factory->context) == 0)
    die("the library has no planner");

  Host host = {.agents = agents};
  FleetyardSink sink = {.struct_size = sizeof sink,
                        .context = &host,
                        .submit_plan = submit_plan,
                        .submit_request = submit_request,
                        .cancelled = cancelled,
                        .now_ns = clock_ns,
                        .fail = explain,
                        .log = log_line,
                        .metric = metric,
                        .note = note,
                        .progress = progress,
                        .get_extension = no_extension};
  FleetyardGrid grid = {.struct_size = sizeof grid,
                        .rows = rows,
                        .cols = cols,
                        .connectivity = 4,
                        .cell_size_m = 1.0,
                        .step_s = 1.0,
                        .passable = passable,
                        .terrain = terrain,
                        .moves = moves};
  FleetyardEnvironment environment = {.struct_size = sizeof environment,
                                      .representation = FLEETYARD_REPRESENTATION_GRID,
                                      .view = &grid,
                                      .name = text(arguments[2])};
  FleetyardInstance instance = {.struct_size = sizeof instance,
                                .agents = agents,
                                .environment = &environment,
                                .motion = FLEETYARD_MOTION_PEBBLE,
                                .objective = FLEETYARD_OBJECTIVE_SUM_OF_COSTS,
                                .flags = FLEETYARD_INSTANCE_CYCLES,
                                .starts = starts,
                                .goal_offsets = goal_offsets,
                                .goals = goals,
                                .radius_m = 0.25};
  int result = 0;
  host.answer_by_ns = UINT64_MAX;
  FleetyardPlanner planner = {.struct_size = sizeof planner};
  if (factory->create(factory->context, 0, &options, &sink, &planner) != FLEETYARD_STATUS_SOLVED) {
    result = 1;
    goto end;
  }
  for (int round = 0; round < rounds; round++) {
    uint64_t begin = now_ns(), length = (uint64_t)(seconds * 1e9);
    FleetyardBudget budget = {.struct_size = sizeof budget,
                              .threads = 1,
                              .deadline_monotonic_ns = begin + length,
                              .answer_by_ns = begin + length - length / 50,
                              .wall_ns = length,
                              .seed = seed};
    host.answer_by_ns = budget.answer_by_ns;
    int32_t prepared = planner.prepare(planner.context, &environment, &budget, &sink);
    int32_t status = planner.plan(planner.context, &instance, &budget, &sink);
    printf(" prepare=%" PRId32 " status=%" PRId32 " seconds=%.3f", prepared, status,
           (double)(now_ns() - begin) * 1e-9);
    if (host.offsets) {
      uint64_t cost, makespan;
      const char *fault = check(&host, passable, rows, cols, starts, goals, &cost, &makespan);
      printf(" sum-of-costs=%" PRIu64 " makespan=%" PRIu64 " %s", cost, makespan,
             fault ? fault : "valid");
      result |= fault != NULL;
    }
    printf("\n");
    result |= status != FLEETYARD_STATUS_SOLVED;
    free(host.offsets);
    free(host.cells);
    host.offsets = NULL;
    host.cells = NULL;
  }
  planner.destroy(planner.context);
end:
  if (entry->deinit)
    entry->deinit();
  free(starts);
  free(goals);
  free(goal_offsets);
  free(passable);
  free(terrain);
  free(moves);
  free(list);
  dlclose(library);
  return result;
}
