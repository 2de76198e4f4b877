/* Code that plugins in C have in common, as functions over fleetyard.h. MIT OR Apache-2.0.
 *
 * A planner is its options, its capabilities and a function that solves:
 *
 *     #include "fleetyard_easy.h"
 *
 *     typedef struct {
 *       FleetyardMap map; // first: filled in before each call
 *       double patience;
 *     } Planner;
 *
 *     static int32_t solve(void *context, const FleetyardInstance *instance,
 *                          const FleetyardBudget *budget, const FleetyardSink *sink) {
 *       FleetyardLists paths = {0};
 *       (void)context, (void)budget;
 *       for (uint32_t agent = 0; agent < instance->agents; agent++) {
 *         fleetyard_append(&paths, instance->starts[agent]); // and so on, to its goal
 *         fleetyard_end_list(&paths);
 *       }
 *       return fleetyard_submit_plan(&paths, sink);
 *     }
 *
 *     static int32_t configure(void *context, FleetyardStr options, const FleetyardSink *sink) {
 *       Planner *planner = (Planner *)context;
 *       planner->patience = 0.5;
 *       const FleetyardOption known[] = {{"patience", &planner->patience, 0, 1, NULL}};
 *       return fleetyard_read_options(options, known, 1, sink);
 *     }
 *
 *     static const FleetyardDescriptor descriptor = { ... };
 *
 *     FLEETYARD_PLANNER(descriptor, sizeof(Planner), configure, solve);
 *
 * Nothing here is a part of the contract. C11, and C++17.
 */
#ifndef FLEETYARD_EASY_H
#define FLEETYARD_EASY_H

#include "fleetyard.h"

#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* No cell, no agent, no distance. */
#define FLEETYARD_NONE UINT32_MAX

/* A text of a descriptor. */
#define FLEETYARD_TEXT(literal) {(const uint8_t *)(literal), sizeof(literal) - 1}

/* ---- Texts, figures and memory --------------------------------------------- */

static inline FleetyardStr fleetyard_text(const char *text) {
  FleetyardStr str = {(const uint8_t *)text, strlen(text)};
  return str;
}

static inline bool fleetyard_equals(FleetyardStr text, const char *other) {
  return text.len == strlen(other) && (text.len == 0 || memcmp(text.ptr, other, text.len) == 0);
}

/* Explains a status and returns it, so that a function can end with one line. */
#if defined(__GNUC__)
__attribute__((format(printf, 3, 4)))
#endif
static inline int32_t
fleetyard_fail(const FleetyardSink *sink, int32_t status, const char *format, ...) {
  char text[512];
  va_list arguments;
  va_start(arguments, format);
  if (vsnprintf(text, sizeof text, format, arguments) < 0)
    text[0] = 0;
  va_end(arguments);
  sink->fail(sink->context, fleetyard_text(text));
  return status;
}

static inline void fleetyard_metric(const FleetyardSink *sink, const char *name, double value) {
  sink->metric(sink->context, fleetyard_text(name), value);
}

/* True when the call should end. Ask often. */
static inline bool fleetyard_cancelled(const FleetyardSink *sink) {
  return sink->cancelled(sink->context) != 0;
}

/* Zeroed memory. Without any left the process ends, which is the plugin's own. */
static inline void *fleetyard_array(size_t count, size_t size) {
  void *memory = calloc(count ? count : 1, size ? size : 1);
  if (!memory)
    abort();
  return memory;
}

/* Makes room for `wanted` elements, as `fleetyard_array`; what is added is not zeroed. */
static inline void *fleetyard_grown(void *array, uint64_t *room, uint64_t wanted, size_t size) {
  if (wanted <= *room && array)
    return array;
  uint64_t larger = *room < 8 ? 16 : 2 * *room;
  larger = larger < wanted ? wanted : larger;
  void *moved = larger <= SIZE_MAX / size ? realloc(array, (size_t)larger * size) : NULL;
  if (!moved)
    abort();
  *room = larger;
  return moved;
}

/* ---- Options --------------------------------------------------------------- */

/* An option that a plugin has. */
typedef struct FleetyardOption {
  const char *name;
  double *value;      /* stays as it is when the option is not given */
  double least, most; /* of a number; true is 1 and false 0 */
  const char *words;  /* "fast slow": one of these instead, and `value` is its index */
} FleetyardOption;

/* The rest of a JSON text. */
typedef struct FleetyardJson {
  const uint8_t *at, *end;
} FleetyardJson;

/* The next byte that is not blank; -1 at the end. */
static inline int fleetyard_json_peek(FleetyardJson *json) {
  while (json->at < json->end && *json->at != 0 && strchr(" \t\r\n", *json->at))
    json->at++;
  return json->at < json->end ? *json->at : -1;
}

static inline bool fleetyard_json_take(FleetyardJson *json, char wanted) {
  bool found = fleetyard_json_peek(json) == wanted;
  json->at += found ? 1 : 0;
  return found;
}

/* Reads a name or a word, cut to `room` bytes: texts without escapes, which they do not need. */
static inline bool fleetyard_json_word(FleetyardJson *json, char *out, size_t room) {
  size_t used = 0;
  if (!fleetyard_json_take(json, '"'))
    return false;
  for (; json->at < json->end && *json->at >= ' ' && !strchr("\"\\", *json->at); json->at++)
    if (used + 1 < room)
      out[used++] = (char)*json->at;
  out[used] = 0;
  return json->at < json->end && *json->at++ == '"';
}

/* Reads a number, true or false. */
static inline bool fleetyard_json_number(FleetyardJson *json, double *out) {
  char text[64], *end = text;
  size_t used = 0;
  fleetyard_json_peek(json);
  for (; json->at < json->end && *json->at > ' ' && !strchr(",}", *json->at); json->at++)
    if (used + 1 < sizeof text)
      text[used++] = (char)*json->at;
  text[used] = 0;
  *out = strcmp(text, "true") == 0 ? 1 : 0;
  if (*out > 0 || strcmp(text, "false") == 0)
    return true;
  /* `strtod` knows more than JSON does. */
  if (used == 0 || text[strspn(text, "+-.0123456789Ee")] != 0)
    return false;
  *out = strtod(text, &end);
  return *end == 0;
}

/* The index of a word in words with blanks between them, -1 for none. */
static inline int fleetyard_word_index(const char *words, const char *word) {
  size_t length = strlen(word);
  for (int index = 0; *words != 0; index++) {
    size_t next = strcspn(words, " ");
    if (next == length && memcmp(words, word, length) == 0)
      return index;
    words += next;
    words += strspn(words, " ");
  }
  return -1;
}

/* Reads options, which are a JSON object of numbers and words. Refuses any that is not among the
 * `count` known ones; the host has checked the rest against the schema. */
static inline int32_t fleetyard_read_options(FleetyardStr options, const FleetyardOption *known,
                                             size_t count, const FleetyardSink *sink) {
  const int32_t wrong = FLEETYARD_STATUS_INVALID_INPUT;
  FleetyardJson json = {options.ptr, options.len ? options.ptr + options.len : options.ptr};
  char name[64], word[64];
  if (options.len == 0)
    return FLEETYARD_STATUS_SOLVED;
  if (!fleetyard_json_take(&json, '{'))
    return fleetyard_fail(sink, wrong, "options: not a JSON object");
  bool more = fleetyard_json_peek(&json) != '}';
  while (more) {
    if (!fleetyard_json_word(&json, name, sizeof name) || !fleetyard_json_take(&json, ':'))
      return fleetyard_fail(sink, wrong, "options: malformed JSON");
    size_t index = 0;
    while (index < count && strcmp(known[index].name, name) != 0)
      index++;
    if (index == count)
      return fleetyard_fail(sink, wrong, "options: there is no option `%s`", name);
    const FleetyardOption *option = &known[index];
    if (option->words) {
      bool read = fleetyard_json_word(&json, word, sizeof word);
      int choice = read ? fleetyard_word_index(option->words, word) : -1;
      if (choice < 0)
        return fleetyard_fail(sink, wrong, "options: `%s` is none of: %s", name, option->words);
      *option->value = choice;
    } else {
      double value;
      bool read = fleetyard_json_number(&json, &value);
      if (!read || value < option->least || value > option->most)
        return fleetyard_fail(sink, wrong, "options: `%s` is not a number from %g to %g", name,
                              option->least, option->most);
      *option->value = value;
    }
    more = fleetyard_json_take(&json, ',');
  }
  if (!fleetyard_json_take(&json, '}') || fleetyard_json_peek(&json) != -1)
    return fleetyard_fail(sink, wrong, "options: malformed JSON");
  return FLEETYARD_STATUS_SOLVED;
}

/* For plugins without options. */
static inline int32_t fleetyard_no_options(void *context, FleetyardStr options,
                                           const FleetyardSink *sink) {
  (void)context;
  return fleetyard_read_options(options, NULL, 0, sink);
}

/* ---- Maps ------------------------------------------------------------------ */

/* A grid, copied: it outlives the call that tells of it. Without cells before that. */
typedef struct FleetyardMap {
  uint32_t rows, cols, cells;
  uint8_t *passable;    /* per cell: 1 where a robot may stand, else 0 */
  uint32_t (*neighbours)[4]; /* per cell: where a step up, right, down and left leads, or NONE */
} FleetyardMap;

static inline void fleetyard_forget(FleetyardMap *map) {
  free(map->passable);
  free(map->neighbours);
  memset(map, 0, sizeof *map);
}

/* Learns a map, in place of the one before. */
static inline int32_t fleetyard_learn(FleetyardMap *map, const FleetyardEnvironment *environment,
                                      const FleetyardSink *sink) {
  const int32_t unknown = FLEETYARD_STATUS_UNSUPPORTED;
  if (environment->struct_size != sizeof *environment)
    return fleetyard_fail(sink, unknown, "FleetyardEnvironment has another size");
  if (environment->representation != FLEETYARD_REPRESENTATION_GRID)
    return fleetyard_fail(sink, unknown, "this plugin knows grids only");
  const FleetyardGrid *grid = (const FleetyardGrid *)environment->view;
  if (grid->struct_size != sizeof *grid)
    return fleetyard_fail(sink, unknown, "FleetyardGrid has another size");
  uint64_t cells = (uint64_t)grid->rows * grid->cols;
  if (cells == 0 || cells >= FLEETYARD_NONE / 4)
    return fleetyard_fail(sink, unknown, "the map has no cells or too many");
  fleetyard_forget(map);
  map->rows = grid->rows;
  map->cols = grid->cols;
  map->cells = (uint32_t)cells;
  map->passable = (uint8_t *)fleetyard_array(map->cells, 1);
  map->neighbours = (uint32_t(*)[4])fleetyard_array(map->cells, sizeof *map->neighbours);
  memcpy(map->passable, grid->passable, map->cells);
  for (uint32_t cell = 0; cell < map->cells; cell++) {
    uint32_t row = cell / map->cols, col = cell % map->cols;
    const uint32_t neighbours[4] = {row > 0 ? cell - map->cols : FLEETYARD_NONE,
                                col + 1 < map->cols ? cell + 1 : FLEETYARD_NONE,
                                row + 1 < map->rows ? cell + map->cols : FLEETYARD_NONE,
                                col > 0 ? cell - 1 : FLEETYARD_NONE};
    for (int i = 0; i < 4; i++) {
      bool free_cell = neighbours[i] != FLEETYARD_NONE && map->passable[neighbours[i]];
      map->neighbours[cell][i] = free_cell ? neighbours[i] : FLEETYARD_NONE;
    }
  }
  return FLEETYARD_STATUS_SOLVED;
}

/* True if an agent may go from one cell to another in a step, or wait. Any numbers may be asked. */
static inline bool fleetyard_is_step(const FleetyardMap *map, uint32_t from, uint32_t to) {
  if (from >= map->cells || to >= map->cells || !map->passable[to])
    return false;
  bool step = from == to;
  for (int i = 0; i < 4; i++)
    step = step || map->neighbours[from][i] == to;
  return step;
}

/* The steps from a cell to all others; NONE where no way leads. `queue` gets the cells that are
 * reached, nearest first; gives how many. Both have room for all cells of the map. */
static inline uint32_t fleetyard_distances(const FleetyardMap *map, uint32_t from,
                                           uint32_t *distance, uint32_t *queue) {
  uint32_t reached = 1;
  memset(distance, 0xFF, map->cells * sizeof *distance);
  distance[from] = 0;
  queue[0] = from;
  for (uint32_t head = 0; head < reached; head++)
    for (int i = 0; i < 4; i++) {
      uint32_t cell = map->neighbours[queue[head]][i];
      if (cell != FLEETYARD_NONE && distance[cell] == FLEETYARD_NONE) {
        distance[cell] = distance[queue[head]] + 1;
        queue[reached++] = cell;
      }
    }
  return reached;
}

/* ---- Plans and goals ------------------------------------------------------- */

/* The cell of an agent of a plan; after its last one it stays there. NONE without any cell. */
static inline uint32_t fleetyard_at(const FleetyardPlan *plan, uint32_t agent, uint64_t time) {
  uint64_t begin = plan->offsets[agent], length = plan->offsets[agent + 1] - begin;
  return length == 0 ? FLEETYARD_NONE : plan->cells[begin + (time < length ? time : length - 1)];
}

/* Lists of cells, one agent's after the other's: the paths of a plan or the goals of an
 * instance. Begins as zeroes. */
typedef struct FleetyardLists {
  uint32_t lists;
  uint64_t *offsets; /* of `lists` + 1 */
  uint32_t *cells;
  uint64_t used, room, offsets_room;
} FleetyardLists;

/* Appends cells to the list that is being written. */
static inline void fleetyard_append_all(FleetyardLists *lists, const uint32_t *cells,
                                        uint64_t count) {
  lists->cells = (uint32_t *)fleetyard_grown(lists->cells, &lists->room, lists->used + count,
                                             sizeof *lists->cells);
  if (count > 0)
    memcpy(lists->cells + lists->used, cells, (size_t)count * sizeof *cells);
  lists->used += count;
}

static inline void fleetyard_append(FleetyardLists *lists, uint32_t cell) {
  fleetyard_append_all(lists, &cell, 1);
}

/* Ends the list that is being written; the next one is that of the next agent. */
static inline void fleetyard_end_list(FleetyardLists *lists) {
  lists->offsets = (uint64_t *)fleetyard_grown(lists->offsets, &lists->offsets_room,
                                               (uint64_t)lists->lists + 2, sizeof *lists->offsets);
  lists->offsets[0] = 0;
  lists->offsets[++lists->lists] = lists->used;
}

static inline void fleetyard_free_lists(FleetyardLists *lists) {
  free(lists->offsets);
  free(lists->cells);
  memset(lists, 0, sizeof *lists);
}

/* Hands a plan over to the host, which copies it, and frees its paths. */
static inline int32_t fleetyard_submit_plan(FleetyardLists *paths, const FleetyardSink *sink) {
  FleetyardPlan plan = {sizeof plan, paths->lists, paths->offsets, paths->cells};
  int32_t taken = sink->submit_plan(sink->context, &plan);
  fleetyard_free_lists(paths);
  return taken == FLEETYARD_OK
             ? FLEETYARD_STATUS_SOLVED
             : fleetyard_fail(sink, FLEETYARD_STATUS_TIMED_OUT, "the plan came too late");
}

/* Hands over the next instance: these goals, these tasks given away, and what a generator has to
 * repeat of the fleet's state. Frees the goals. */
static inline int32_t fleetyard_submit_instance(const FleetyardFleetState *state,
                                                FleetyardLists *goals,
                                                const FleetyardAssignment *assignments,
                                                uint32_t assigned, const FleetyardSink *sink) {
  FleetyardInstance instance;
  memset(&instance, 0, sizeof instance);
  instance.struct_size = sizeof instance;
  instance.agents = state->agents;
  instance.starts = state->cells;
  instance.headings = state->headings;
  instance.goal_offsets = goals->offsets;
  instance.goals = goals->cells;
  instance.motion = state->motion;
  instance.objective = state->objective;
  instance.window_steps = state->window_steps;
  instance.allows_cycles = state->allows_cycles;
  instance.radius_m = state->radius_m;
  instance.assignments_count = assigned;
  instance.assignments = assignments;
  int32_t taken = sink->submit_instance(sink->context, &instance);
  fleetyard_free_lists(goals);
  return taken == FLEETYARD_OK
             ? FLEETYARD_STATUS_SOLVED
             : fleetyard_fail(sink, FLEETYARD_STATUS_TIMED_OUT, "the instance came too late");
}

/* ---- What the library exports ---------------------------------------------- */

/* For plugins whose context begins with a FleetyardMap. */
static inline int32_t fleetyard_prepare(void *context, const FleetyardEnvironment *environment,
                                        const FleetyardBudget *budget, const FleetyardSink *sink) {
  (void)budget; /* a few milliseconds for the largest maps */
  return fleetyard_learn((FleetyardMap *)context, environment, sink);
}

/* For the same, if the context has no other memory. */
static inline void fleetyard_destroy(void *context) {
  fleetyard_forget((FleetyardMap *)context);
  free(context);
}

/* Exports one plugin. `KIND` is Planner, FailPolicy, InstanceGenerator or InvocationPolicy, and
 * `CREATE` fills in `out` as FleetyardPlannerFactory::create does, but without the index. */
#define FLEETYARD_LIBRARY(KIND, FACTORY_ID, DESCRIPTOR, CREATE)                                    \
  static uint32_t fleetyard_count(void) { return 1; }                                              \
  static const FleetyardDescriptor *fleetyard_describe(uint32_t index) {                           \
    return index == 0 ? &(DESCRIPTOR) : NULL;                                                      \
  }                                                                                                \
  static int32_t fleetyard_create(uint32_t index, FleetyardStr options, const FleetyardSink *sink, \
                                  Fleetyard##KIND *out) {                                          \
    if (index != 0)                                                                                \
      return fleetyard_fail(sink, FLEETYARD_STATUS_UNSUPPORTED, "this library has one plugin");    \
    memset(out, 0, sizeof *out);                                                                   \
    out->struct_size = sizeof *out;                                                                \
    return CREATE(options, sink, out);                                                             \
  }                                                                                                \
  static const Fleetyard##KIND##Factory fleetyard_factory = {                                      \
      sizeof(Fleetyard##KIND##Factory), 0, fleetyard_count, fleetyard_describe, fleetyard_create}; \
  static const void *fleetyard_get_factory(FleetyardStr id) {                                      \
    return fleetyard_equals(id, FACTORY_ID) ? &fleetyard_factory : NULL;                           \
  }                                                                                                \
  const FleetyardPluginEntry fleetyard_plugin_entry_v1 = {                                         \
      sizeof(FleetyardPluginEntry), FLEETYARD_ABI_MAJOR,  FLEETYARD_ABI_MINOR, NULL, NULL,         \
      fleetyard_get_factory}

/* Exports one plugin with a map: `CONTEXT_SIZE` bytes of zeroes are its context, which begins
 * with a FleetyardMap; `CONFIGURE` reads the options into it, and `SOLVE` is the kind's call. */
#define FLEETYARD_MAP_LIBRARY(KIND, CALL, FACTORY_ID, DESCRIPTOR, CONTEXT_SIZE, CONFIGURE, SOLVE)  \
  static int32_t fleetyard_make(FleetyardStr options, const FleetyardSink *sink,                   \
                                Fleetyard##KIND *out) {                                            \
    out->context = fleetyard_array(1, CONTEXT_SIZE);                                               \
    out->prepare = fleetyard_prepare;                                                              \
    out->CALL = SOLVE;                                                                             \
    out->destroy = fleetyard_destroy;                                                              \
    int32_t status = CONFIGURE(out->context, options, sink);                                       \
    if (status != FLEETYARD_STATUS_SOLVED)                                                         \
      free(out->context);                                                                          \
    return status;                                                                                 \
  }                                                                                                \
  FLEETYARD_LIBRARY(KIND, FACTORY_ID, DESCRIPTOR, fleetyard_make)

#define FLEETYARD_PLANNER(DESCRIPTOR, CONTEXT_SIZE, CONFIGURE, PLAN)                               \
  FLEETYARD_MAP_LIBRARY(Planner, plan, FLEETYARD_PLANNER_FACTORY_ID, DESCRIPTOR, CONTEXT_SIZE,     \
                        CONFIGURE, PLAN)

#define FLEETYARD_FAIL_POLICY(DESCRIPTOR, CONTEXT_SIZE, CONFIGURE, RECOVER)                        \
  FLEETYARD_MAP_LIBRARY(FailPolicy, recover, FLEETYARD_FAIL_POLICY_FACTORY_ID, DESCRIPTOR,         \
                        CONTEXT_SIZE, CONFIGURE, RECOVER)

#define FLEETYARD_INSTANCE_GENERATOR(DESCRIPTOR, CONTEXT_SIZE, CONFIGURE, GENERATE)                \
  FLEETYARD_MAP_LIBRARY(InstanceGenerator, generate, FLEETYARD_INSTANCE_GENERATOR_FACTORY_ID,      \
                        DESCRIPTOR, CONTEXT_SIZE, CONFIGURE, GENERATE)

/* The same for invocation policies, which learn no map: any context. */
#define FLEETYARD_INVOCATION_POLICY(DESCRIPTOR, CONTEXT_SIZE, CONFIGURE, SHOULD_INVOKE)            \
  static int32_t fleetyard_make(FleetyardStr options, const FleetyardSink *sink,                   \
                                FleetyardInvocationPolicy *out) {                                  \
    out->context = fleetyard_array(1, CONTEXT_SIZE);                                               \
    out->should_invoke = SHOULD_INVOKE;                                                            \
    out->destroy = free;                                                                           \
    int32_t status = CONFIGURE(out->context, options, sink);                                       \
    if (status != FLEETYARD_STATUS_SOLVED)                                                         \
      free(out->context);                                                                          \
    return status;                                                                                 \
  }                                                                                                \
  FLEETYARD_LIBRARY(InvocationPolicy, FLEETYARD_INVOCATION_POLICY_FACTORY_ID, DESCRIPTOR,          \
                    fleetyard_make)

#endif /* FLEETYARD_EASY_H */
