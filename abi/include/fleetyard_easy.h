/* Code that plugins in C have in common, as functions over fleetyard.h. MIT OR Apache-2.0.
 *
 * A planner is what it has to remember, a description of itself, and a function that solves:
 *
 *     #include "fleetyard_easy.h"
 *
 *     typedef struct {
 *       double patience;
 *     } Planner;
 *
 *     static int32_t solve(void *context, const FleetyardInstance *instance,
 *                          const FleetyardBudget *budget, const FleetyardSink *sink) {
 *       FleetyardPaths paths = fleetyard_paths(FLEETYARD_FORM_CELLS, instance->agents);
 *       (void)context, (void)budget;
 *       for (uint32_t agent = 0; agent < instance->agents; agent++)
 *         fleetyard_add_cell(&paths, agent, instance->starts[agent]); // and so on, to its goal
 *       int32_t status = fleetyard_submit(&paths, sink);
 *       fleetyard_free_paths(&paths);
 *       return status;
 *     }
 *
 *     static void *make(const FleetyardOptions *options, const FleetyardSink *sink) {
 *       Planner *planner = (Planner *)fleetyard_array(1, sizeof *planner);
 *       (void)sink;
 *       planner->patience = fleetyard_number(options, "patience", 0.5);
 *       return planner;
 *     }
 *
 *     static const FleetyardDescriptor about = { ... };
 *
 *     FLEETYARD_EXPORT_PLANNER(about, make, fleetyard_learn_nothing, solve, free);
 *
 * What the host asks is checked against the description before `solve` is called, so that a plugin
 * is asked only what it claims. Nothing here is a part of the contract. C11, and C++17.
 */
#ifndef FLEETYARD_EASY_H
#define FLEETYARD_EASY_H

#include "fleetyard.h"

#include <inttypes.h>
#include <math.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* A text of a descriptor. */
#define FLEETYARD_TEXT(literal) {literal, sizeof(literal) - 1}

/* ---- Texts, figures and memory --------------------------------------------- */

static inline FleetyardStr fleetyard_text(const char *text) {
  FleetyardStr str = {text, strlen(text)};
  return str;
}

static inline bool fleetyard_equals(FleetyardStr text, const char *other) {
  return text.len == strlen(other) && (text.len == 0 || memcmp(text.ptr, other, text.len) == 0);
}

/* The index of a word in words with blanks between them, -1 for none. */
static inline int fleetyard_word_index(const char *words, FleetyardStr word) {
  for (int index = 0; *words != 0; index++) {
    size_t next = strcspn(words, " ");
    if (next == word.len && memcmp(words, word.ptr, word.len) == 0)
      return index;
    words += next;
    words += strspn(words, " ");
  }
  return -1;
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

static inline void fleetyard_log(const FleetyardSink *sink, int32_t level, const char *text) {
  sink->log(sink->context, level, fleetyard_text(text));
}

static inline void fleetyard_metric(const FleetyardSink *sink, const char *name, double value) {
  sink->metric(sink->context, fleetyard_text(name), value);
}

static inline void fleetyard_note(const FleetyardSink *sink, const char *name, const char *text) {
  sink->note(sink->context, fleetyard_text(name), fleetyard_text(text));
}

/* True when the call should end: the host knows the time. Ask often. */
static inline bool fleetyard_cancelled(const FleetyardSink *sink) {
  return sink->cancelled(sink->context) != 0;
}

/* Ends a call as `fleetyard_cancelled` wants it. */
static inline int32_t fleetyard_time_is_up(const FleetyardBudget *budget,
                                           const FleetyardSink *sink) {
  bool late = sink->now_ns(sink->context) >= budget->answer_by_ns;
  return late ? fleetyard_fail(sink, FLEETYARD_STATUS_TIMED_OUT, "the call's time is up")
              : fleetyard_fail(sink, FLEETYARD_STATUS_CANCELLED, "the host gave up on the call");
}

/* Zeroed memory. Without any left the process ends, which is the plugin's own. */
static inline void *fleetyard_array(size_t count, size_t size) {
  void *memory = calloc(count ? count : 1, size ? size : 1);
  if (!memory)
    abort();
  return memory;
}

/* Makes room for `wanted` elements where there was room for `room`, as `fleetyard_array`; what is
 * added is not zeroed. */
static inline void *fleetyard_grown(void *array, uint64_t room, uint64_t wanted, size_t size) {
  if (wanted <= room && array)
    return array;
  void *moved = wanted <= SIZE_MAX / size ? realloc(array, (size_t)wanted * size) : NULL;
  if (!moved)
    abort();
  return moved;
}

/* The room to make when `wanted` do not fit into `room`. */
static inline uint64_t fleetyard_more_room(uint64_t room, uint64_t wanted) {
  uint64_t larger = room < 8 ? 16 : 2 * room;
  return wanted <= room ? room : larger < wanted ? wanted : larger;
}

/* ---- Options --------------------------------------------------------------- */

/* The option with this name, which the host has checked against the schema; null when it is not
 * given and has no default. */
static inline const FleetyardPluginOption *fleetyard_option(const FleetyardOptions *options,
                                                            const char *name) {
  for (uint32_t i = 0; i < options->count; i++)
    if (fleetyard_equals(options->list[i].name, name))
      return &options->list[i];
  return NULL;
}

/* The value of a number, or that of a flag as 0 or 1. */
static inline double fleetyard_number(const FleetyardOptions *options, const char *name,
                                      double otherwise) {
  const FleetyardPluginOption *option = fleetyard_option(options, name);
  bool given = option && (option->kind == FLEETYARD_OPTION_NUMBER ||
                          option->kind == FLEETYARD_OPTION_FLAG);
  return given ? option->number : otherwise;
}

static inline bool fleetyard_flag(const FleetyardOptions *options, const char *name,
                                  bool otherwise) {
  return fleetyard_number(options, name, otherwise ? 1 : 0) > 0;
}

/* The text of an option, empty when it has none. */
static inline FleetyardStr fleetyard_option_text(const FleetyardOptions *options,
                                                 const char *name) {
  const FleetyardPluginOption *option = fleetyard_option(options, name);
  return option ? option->text : fleetyard_text("");
}

/* The index of an option's text in words with blanks between them; 0 when it is none of them. */
static inline int fleetyard_choice(const FleetyardOptions *options, const char *name,
                                   const char *words) {
  int index = fleetyard_word_index(words, fleetyard_option_text(options, name));
  return index < 0 ? 0 : index;
}

/* ---- Checks: what this plugin does not know, it refuses ---------------------- */

/* Refuses a structure that is missing, or shorter than this header has it. All structures but the
 * elements of arrays begin with their size. */
#define FLEETYARD_WHOLE(pointer, sink) \
  fleetyard_whole(pointer, (uint32_t)sizeof *(pointer), #pointer, sink)

static inline int32_t fleetyard_whole(const void *pointer, uint32_t size, const char *name,
                                      const FleetyardSink *sink) {
  uint32_t found = 0;
  if (pointer)
    memcpy(&found, pointer, sizeof found);
  return found >= size ? FLEETYARD_STATUS_SOLVED
                       : fleetyard_fail(sink, FLEETYARD_STATUS_INVALID_INPUT,
                                        "%s is missing or too short: %" PRIu32 " of %" PRIu32
                                        " bytes",
                                        name, found, size);
}

/* Refuses a code: 0 is none in any version. `known` has the bit of each code. */
static inline int32_t fleetyard_code(int32_t code, uint32_t known, const char *name,
                                     const FleetyardSink *sink) {
  if (code > 0 && code < 32 && (known >> code & 1) != 0)
    return FLEETYARD_STATUS_SOLVED;
  return code == 0 ? fleetyard_fail(sink, FLEETYARD_STATUS_INVALID_INPUT,
                                    "%s is 0, which is no value", name)
                   : fleetyard_fail(sink, FLEETYARD_STATUS_UNSUPPORTED,
                                    "this plugin does not know %s %" PRId32, name, code);
}

/* Refuses flags of which the plugin does not know one. */
static inline int32_t fleetyard_flags(uint32_t flags, uint32_t known, const char *name,
                                      const FleetyardSink *sink) {
  return (flags & ~known) == 0 ? FLEETYARD_STATUS_SOLVED
                               : fleetyard_fail(sink, FLEETYARD_STATUS_UNSUPPORTED,
                                                "%s has flags that this plugin does not know: "
                                                "0x%" PRIX32,
                                                name, flags & ~known);
}

/* Refuses a reserved field that is not 0. */
static inline int32_t fleetyard_zero(uint32_t reserved, const char *name,
                                     const FleetyardSink *sink) {
  return reserved == 0 ? FLEETYARD_STATUS_SOLVED
                       : fleetyard_fail(sink, FLEETYARD_STATUS_INVALID_INPUT,
                                        "%s.reserved is %" PRIu32 ", not 0", name, reserved);
}

/* The part with this identifier, or null. With FLEETYARD_PART_JSON its data is a FleetyardJson. */
static inline const FleetyardPart *fleetyard_part(const FleetyardParts *parts, const char *id) {
  for (uint64_t i = 0; i < parts->count; i++)
    if (fleetyard_equals(parts->list[i].id, id))
      return &parts->list[i];
  return NULL;
}

/* The structure of a part with this identifier, or null: without one, or when it comes as JSON or
 * is shorter than this header has it. */
static inline const void *fleetyard_structure(const FleetyardParts *parts, const char *id,
                                              size_t size) {
  const FleetyardPart *part = fleetyard_part(parts, id);
  uint32_t found = 0;
  if (part && part->data && !(part->flags & FLEETYARD_PART_JSON))
    memcpy(&found, part->data, sizeof found);
  return found >= size ? part->data : NULL;
}

/* The memory that the host keeps of a fleet, of an instance or a state; null when it keeps none.
 * It hands it to plugins alone that list `part:` and the identifier in their features. */
static inline const FleetyardTraffic *fleetyard_traffic(const FleetyardParts *parts) {
  return (const FleetyardTraffic *)fleetyard_structure(parts, FLEETYARD_TRAFFIC_ID,
                                                       sizeof(FleetyardTraffic));
}
static inline const FleetyardRestOfPlan *fleetyard_rest_of_plan(const FleetyardParts *parts) {
  return (const FleetyardRestOfPlan *)fleetyard_structure(parts, FLEETYARD_REST_OF_PLAN_ID,
                                                          sizeof(FleetyardRestOfPlan));
}
static inline const FleetyardGoalTasks *fleetyard_goal_tasks(const FleetyardParts *parts) {
  return (const FleetyardGoalTasks *)fleetyard_structure(parts, FLEETYARD_GOAL_TASKS_ID,
                                                         sizeof(FleetyardGoalTasks));
}
static inline const FleetyardGuidance *fleetyard_guidance(const FleetyardParts *parts) {
  return (const FleetyardGuidance *)fleetyard_structure(parts, FLEETYARD_GUIDANCE_ID,
                                                        sizeof(FleetyardGuidance));
}
/* The bytes that this plugin kept last. */
static inline const FleetyardBytes *fleetyard_kept(const FleetyardParts *parts) {
  return (const FleetyardBytes *)fleetyard_structure(parts, FLEETYARD_KEPT_ID,
                                                     sizeof(FleetyardBytes));
}

/* Lets the host keep bytes for the next call, in place of those before. Returns as `submit_plan`;
 * FLEETYARD_BUSY from a host that keeps none. */
static inline int32_t fleetyard_keep(const FleetyardSink *sink, const void *bytes, uint64_t len) {
  const FleetyardKeep *host = (const FleetyardKeep *)sink->get_extension(
      sink->context, fleetyard_text(FLEETYARD_KEEP_ID));
  FleetyardBytes kept = {sizeof kept, 0, (const uint8_t *)bytes, len};
  return host && host->struct_size >= sizeof *host ? host->keep(sink->context, &kept)
                                                   : FLEETYARD_BUSY;
}

/* True if the plugin's features name it after `sort`, which is `part:` or `dynamics:`. */
static inline bool fleetyard_knows(const FleetyardDescriptor *about, const char *sort,
                                   FleetyardStr id) {
  size_t begin = strlen(sort);
  for (uint32_t i = 0; i < about->feature_count; i++) {
    FleetyardStr feature = about->features[i];
    if (feature.len == begin + id.len && memcmp(feature.ptr, sort, begin) == 0 &&
        (id.len == 0 || memcmp(feature.ptr + begin, id.ptr, id.len) == 0))
      return true;
  }
  return false;
}

/* Refuses a critical part that the plugin's features do not name. */
static inline int32_t fleetyard_check_parts(const FleetyardParts *parts,
                                            const FleetyardDescriptor *about,
                                            const FleetyardSink *sink) {
  for (uint64_t i = 0; i < parts->count; i++) {
    const FleetyardPart *part = &parts->list[i];
    if ((part->flags & FLEETYARD_PART_CRITICAL) != 0 && !fleetyard_knows(about, "part:", part->id))
      return fleetyard_fail(sink, FLEETYARD_STATUS_UNSUPPORTED,
                            "this plugin does not know the critical part `%.*s`",
                            (int)(part->id.len < 200 ? part->id.len : 200), part->id.ptr);
  }
  return FLEETYARD_STATUS_SOLVED;
}

/* Ends a function with the status of a check that fails. */
#define FLEETYARD_CHECK(check)                                                                     \
  do {                                                                                             \
    int32_t fleetyard_status = check;                                                              \
    if (fleetyard_status != FLEETYARD_STATUS_SOLVED)                                               \
      return fleetyard_status;                                                                     \
  } while (0)

/* The view of an environment, or null after a failure that says why not. */
static inline const void *fleetyard_view(const FleetyardEnvironment *environment,
                                         int32_t representation, const char *name,
                                         const FleetyardSink *sink) {
  if (environment->representation == representation && environment->view)
    return environment->view;
  fleetyard_fail(sink, FLEETYARD_STATUS_UNSUPPORTED, "this plugin knows %s only", name);
  return NULL;
}

static inline const FleetyardGrid *fleetyard_grid(const FleetyardEnvironment *environment,
                                                  const FleetyardSink *sink) {
  return (const FleetyardGrid *)fleetyard_view(environment, FLEETYARD_REPRESENTATION_GRID, "grids",
                                               sink);
}

static inline const FleetyardRoadmap *fleetyard_roadmap(const FleetyardEnvironment *environment,
                                                        const FleetyardSink *sink) {
  return (const FleetyardRoadmap *)fleetyard_view(environment, FLEETYARD_REPRESENTATION_ROADMAP,
                                                  "roadmaps", sink);
}

static inline const FleetyardWorkspace *
fleetyard_workspace(const FleetyardEnvironment *environment, const FleetyardSink *sink) {
  return (const FleetyardWorkspace *)fleetyard_view(
      environment, FLEETYARD_REPRESENTATION_CONTINUOUS, "the plane", sink);
}

/* Refuses an environment that the plugin does not claim to know. */
static inline int32_t fleetyard_check_environment(const FleetyardEnvironment *environment,
                                                  const FleetyardDescriptor *about,
                                                  const FleetyardSink *sink) {
  FLEETYARD_CHECK(FLEETYARD_WHOLE(environment, sink));
  /* The capabilities of representations are in the order of their codes. */
  static const char *const names[] = {"grid", "roadmap", "continuous"};
  int32_t code = environment->representation;
  if (code >= 1 && code <= 3 && !(about->capabilities >> (code - 1) & 1))
    return fleetyard_fail(sink, FLEETYARD_STATUS_UNSUPPORTED,
                          "this plugin does not know representation `%s`", names[code - 1]);
  FLEETYARD_CHECK(fleetyard_code(environment->representation,
                                 (uint32_t)(about->capabilities & 7) << 1, "representation",
                                 sink));
  if (environment->representation == FLEETYARD_REPRESENTATION_GRID) {
    const FleetyardGrid *grid = (const FleetyardGrid *)environment->view;
    FLEETYARD_CHECK(FLEETYARD_WHOLE(grid, sink));
    bool eight = (about->capabilities & FLEETYARD_CAPABILITY_EIGHT_CONNECTED) != 0;
    if (grid->connectivity != 4 && !(grid->connectivity == 8 && eight))
      return fleetyard_fail(sink, FLEETYARD_STATUS_UNSUPPORTED,
                            "this plugin does not know grids with %" PRIu32 " neighbours",
                            grid->connectivity);
    uint64_t cells = (uint64_t)grid->rows * grid->cols;
    if (cells == 0 || cells >= FLEETYARD_NONE)
      return fleetyard_fail(sink, FLEETYARD_STATUS_INVALID_INPUT,
                            "the grid has no cells or too many");
  } else if (environment->representation == FLEETYARD_REPRESENTATION_ROADMAP) {
    const FleetyardRoadmap *roadmap = (const FleetyardRoadmap *)environment->view;
    FLEETYARD_CHECK(FLEETYARD_WHOLE(roadmap, sink));
    FLEETYARD_CHECK(fleetyard_zero(roadmap->reserved, "roadmap", sink));
    FLEETYARD_CHECK(fleetyard_flags(roadmap->flags, FLEETYARD_ROADMAP_SYMMETRIC, "roadmap", sink));
  } else {
    const FleetyardWorkspace *workspace = (const FleetyardWorkspace *)environment->view;
    FLEETYARD_CHECK(FLEETYARD_WHOLE(workspace, sink));
  }
  return fleetyard_check_parts(&environment->parts, about, sink);
}

/* Number of places: cells or vertices; 0 in the plane. */
static inline uint32_t fleetyard_places(const FleetyardEnvironment *environment) {
  const FleetyardGrid *grid = (const FleetyardGrid *)environment->view;
  if (environment->representation == FLEETYARD_REPRESENTATION_GRID)
    return grid->rows * grid->cols;
  return environment->representation == FLEETYARD_REPRESENTATION_ROADMAP
             ? ((const FleetyardRoadmap *)environment->view)->vertices
             : 0;
}

/* Refuses robots that the plugin does not claim to know. */
static inline int32_t fleetyard_check_robots(const FleetyardInstance *instance,
                                             const FleetyardDescriptor *about,
                                             const FleetyardSink *sink) {
  const uint32_t known =
      FLEETYARD_ROBOT_HEADING | FLEETYARD_ROBOT_POLAR_STATE | FLEETYARD_ROBOT_POLAR_CONTROL;
  if (instance->robot_count > 1 && !(about->capabilities & FLEETYARD_CAPABILITY_HETEROGENEOUS))
    return fleetyard_fail(sink, FLEETYARD_STATUS_UNSUPPORTED,
                          "this plugin does not know teams of different robots");
  for (uint32_t i = 0; i < instance->robot_count; i++) {
    const FleetyardRobot *robot = instance->robots[i];
    FLEETYARD_CHECK(FLEETYARD_WHOLE(robot, sink));
    FLEETYARD_CHECK(FLEETYARD_WHOLE(robot->footprint, sink));
    FLEETYARD_CHECK(fleetyard_zero(robot->reserved, "robot", sink));
    FLEETYARD_CHECK(fleetyard_flags(robot->flags, known, "robot", sink));
    if (instance->motion == FLEETYARD_MOTION_DYNAMICS && robot->dynamics.len > 0 &&
        !fleetyard_knows(about, "dynamics:", robot->dynamics))
      return fleetyard_fail(sink, FLEETYARD_STATUS_UNSUPPORTED,
                            "this plugin does not know the dynamics `%.*s`",
                            (int)(robot->dynamics.len < 200 ? robot->dynamics.len : 200),
                            robot->dynamics.ptr);
  }
  for (uint32_t agent = 0; agent < instance->agents && instance->robot_of; agent++)
    if (instance->robot_of[agent] >= instance->robot_count)
      return fleetyard_fail(sink, FLEETYARD_STATUS_INVALID_INPUT,
                            "agent %" PRIu32 " is no robot of the team", agent);
  return FLEETYARD_STATUS_SOLVED;
}

/* The robot of an agent; null when the instance has none. */
static inline const FleetyardRobot *fleetyard_robot(const FleetyardInstance *instance,
                                                    uint32_t agent) {
  uint32_t model = instance->robot_of ? instance->robot_of[agent] : 0;
  return model < instance->robot_count ? instance->robots[model] : NULL;
}

/* Refuses an instance whose environment, motion, flags, robots or parts the plugin does not claim
 * to know, and places that are none. */
static inline int32_t fleetyard_check_question(const FleetyardInstance *instance,
                                               const FleetyardDescriptor *about,
                                               const FleetyardSink *sink) {
  FLEETYARD_CHECK(FLEETYARD_WHOLE(instance, sink));
  FLEETYARD_CHECK(fleetyard_zero(instance->reserved, "instance", sink));
  FLEETYARD_CHECK(fleetyard_check_environment(instance->environment, about, sink));
  /* The capabilities of motions are in the order of their codes, from bit 8 on. */
  FLEETYARD_CHECK(fleetyard_code(instance->motion, (uint32_t)(about->capabilities >> 7 & 0x7E),
                                 "motion", sink));
  FLEETYARD_CHECK(fleetyard_code(instance->objective,
                                 1u << FLEETYARD_OBJECTIVE_SUM_OF_COSTS |
                                     1u << FLEETYARD_OBJECTIVE_MAKESPAN,
                                 "objective", sink));
  FLEETYARD_CHECK(fleetyard_flags(instance->flags,
                                  FLEETYARD_INSTANCE_CYCLES | FLEETYARD_INSTANCE_STRICT,
                                  "instance", sink));
  FLEETYARD_CHECK(fleetyard_check_parts(&instance->parts, about, sink));
  FLEETYARD_CHECK(fleetyard_check_robots(instance, about, sink));
  uint32_t places = fleetyard_places(instance->environment);
  if (instance->agents == 0 || !instance->goal_offsets || (places > 0 && !instance->starts) ||
      (places == 0 && (!instance->start_state_offsets || !instance->goal_state_offsets ||
                       instance->robot_count == 0)))
    return fleetyard_fail(sink, FLEETYARD_STATUS_INVALID_INPUT,
                          "the instance has no agents, starts, goals or robots");
  for (uint32_t agent = 0; agent < instance->agents && places > 0; agent++) {
    bool placed = instance->starts[agent] < places;
    for (uint64_t i = instance->goal_offsets[agent]; i < instance->goal_offsets[agent + 1]; i++)
      placed = placed && instance->goals[i] < places;
    if (!placed)
      return fleetyard_fail(sink, FLEETYARD_STATUS_INVALID_INPUT,
                            "agent %" PRIu32 " starts or ends off the map", agent);
  }
  return FLEETYARD_STATUS_SOLVED;
}

/* The same for planners, and refuses windows and agents with fewer or more goals than the plugin
 * claims to know: a goal each, without CAPABILITY_IDLE and CAPABILITY_WINDOWED. */
static inline int32_t fleetyard_check_instance(const FleetyardInstance *instance,
                                               const FleetyardDescriptor *about,
                                               const FleetyardSink *sink) {
  FLEETYARD_CHECK(fleetyard_check_question(instance, about, sink));
  bool idle = (about->capabilities & FLEETYARD_CAPABILITY_IDLE) != 0;
  bool many = (about->capabilities & FLEETYARD_CAPABILITY_WINDOWED) != 0;
  if (!many && (instance->window_steps > 0 || instance->window_s > 0))
    return fleetyard_fail(sink, FLEETYARD_STATUS_UNSUPPORTED, "this plugin knows no windows");
  for (uint32_t agent = 0; agent < instance->agents; agent++) {
    uint64_t goals = instance->goal_offsets[agent + 1] - instance->goal_offsets[agent];
    if ((goals == 0 && !idle) || (goals > 1 && !many))
      return fleetyard_fail(sink, FLEETYARD_STATUS_UNSUPPORTED,
                            "agent %" PRIu32 " has %" PRIu64
                            " goals, and this plugin knows one for each",
                            agent, goals);
  }
  return FLEETYARD_STATUS_SOLVED;
}

/* ---- Grids ------------------------------------------------------------------- */

/* The steps of a move down and to the right; the moves are 0 to 7 in the order of the letters
 * NESWnesw, and 8 for waiting. */
static inline int fleetyard_down(int move) {
  static const int rows[] = {-1, 0, 1, 0, -1, 1, 1, -1, 0};
  return rows[move];
}
static inline int fleetyard_right(int move) {
  static const int cols[] = {0, 1, 0, -1, 1, 1, -1, -1, 0};
  return cols[move];
}

/* The cell beside another one in the direction of a move; NONE off the map. */
static inline uint32_t fleetyard_beside(const FleetyardGrid *grid, uint32_t cell, int move) {
  int64_t row = (int64_t)(cell / grid->cols) + fleetyard_down(move);
  int64_t col = (int64_t)(cell % grid->cols) + fleetyard_right(move);
  bool inside = row >= 0 && row < grid->rows && col >= 0 && col < grid->cols;
  return inside ? (uint32_t)(row * grid->cols + col) : FLEETYARD_NONE;
}

/* The move of a letter, as FleetyardRestOfPlan has them; -1 for no letter of a move. */
static inline int fleetyard_move_of(uint8_t letter) {
  static const char letters[] = "NESWnesw.";
  const char *found = letter ? strchr(letters, letter) : NULL;
  return found ? (int)(found - letters) : -1;
}

/* Where a move leads that a robot may make, or NONE. */
static inline uint32_t fleetyard_move(const FleetyardGrid *grid, uint32_t cell, int move) {
  bool may = move == 8 ? grid->passable[cell] != 0 : (grid->moves[cell] >> move & 1) != 0;
  int64_t to = (int64_t)cell + fleetyard_down(move) * (int64_t)grid->cols + fleetyard_right(move);
  return may ? (uint32_t)to : FLEETYARD_NONE; /* no mask has a move that leaves the map */
}

/* True if an agent may go from one cell to another in a step, or wait. Any numbers may be asked. */
static inline bool fleetyard_is_step(const FleetyardGrid *grid, uint32_t from, uint32_t to) {
  bool step = false;
  if (from < grid->rows * grid->cols && to != FLEETYARD_NONE)
    for (int move = 0; move < 9; move++)
      step = step || fleetyard_move(grid, from, move) == to;
  return step;
}

/* The steps from a cell to all others, or with `to` from all others to it; NONE where no way
 * leads. `queue` gets the cells of finite distance, nearest first; gives how many. Both have room
 * for all cells. */
static inline uint32_t fleetyard_spread(const FleetyardGrid *grid, uint32_t cell, bool to,
                                        uint32_t *distance, uint32_t *queue) {
  uint32_t reached = 1;
  memset(distance, 0xFF, (size_t)grid->rows * grid->cols * sizeof *distance);
  distance[cell] = 0;
  queue[0] = cell;
  for (uint32_t head = 0; head < reached; head++)
    for (int move = 0; move < 8; move++) {
      /* The opposite of a move has the number that differs in the second bit. */
      uint32_t next = to ? fleetyard_beside(grid, queue[head], move ^ 2)
                         : fleetyard_move(grid, queue[head], move);
      if (next == FLEETYARD_NONE || distance[next] != FLEETYARD_NONE ||
          (to && (grid->moves[next] >> move & 1) == 0))
        continue;
      distance[next] = distance[queue[head]] + 1;
      queue[reached++] = next;
    }
  return reached;
}

/* The steps from every cell to a goal; otherwise as fleetyard_spread. */
static inline uint32_t fleetyard_distances(const FleetyardGrid *grid, uint32_t goal,
                                           uint32_t *distance, uint32_t *queue) {
  return fleetyard_spread(grid, goal, true, distance, queue);
}

/* ---- Plans ------------------------------------------------------------------- */

/* The path of an agent, or its goals: entries with a place, or with numbers, or with both. */
typedef struct FleetyardPath {
  uint64_t length, room;
  uint32_t *places;   /* cells or vertices; null in the plane */
  double *columns[4]; /* of visits: arrival, departure; of knots: time, x, y, heading */
  uint64_t segments, segment_room;
  double *duration_s; /* of each segment */
  uint64_t numbers, number_room;
  double *controls; /* of all segments, one after the other */
} FleetyardPath;

/* A plan that is being made: paths of agents, which may be written in any order of agents. */
typedef struct FleetyardPaths {
  int32_t form; /* FLEETYARD_FORM_* */
  uint32_t agents;
  FleetyardPath *of;
} FleetyardPaths;

static inline FleetyardPaths fleetyard_paths(int32_t form, uint32_t agents) {
  FleetyardPaths paths = {form, agents,
                          (FleetyardPath *)fleetyard_array(agents, sizeof(FleetyardPath))};
  return paths;
}

/* Number of columns that the form of a plan has. */
static inline int fleetyard_columns(int32_t form) {
  return form == FLEETYARD_FORM_CELLS ? 0 : form == FLEETYARD_FORM_VISITS ? 2 : 4;
}

/* Adds an entry with a place and as many numbers as the form has. */
static inline void fleetyard_add(FleetyardPaths *paths, uint32_t agent, uint32_t place,
                                 const double *numbers) {
  FleetyardPath *path = &paths->of[agent];
  uint64_t room = fleetyard_more_room(path->room, path->length + 1);
  if (paths->form != FLEETYARD_FORM_TRAJECTORIES) {
    path->places =
        (uint32_t *)fleetyard_grown(path->places, path->room, room, sizeof *path->places);
    path->places[path->length] = place;
  }
  for (int i = 0; i < fleetyard_columns(paths->form); i++) {
    path->columns[i] = (double *)fleetyard_grown(path->columns[i], path->room, room,
                                                 sizeof *path->columns[i]);
    path->columns[i][path->length] = numbers[i];
  }
  path->room = room;
  path->length++;
}

static inline void fleetyard_add_cell(FleetyardPaths *paths, uint32_t agent, uint32_t cell) {
  fleetyard_add(paths, agent, cell, NULL);
}

static inline void fleetyard_add_cells(FleetyardPaths *paths, uint32_t agent,
                                       const uint32_t *cells, uint64_t count) {
  for (uint64_t i = 0; i < count; i++)
    fleetyard_add_cell(paths, agent, cells[i]);
}

static inline void fleetyard_add_visit(FleetyardPaths *paths, uint32_t agent, uint32_t vertex,
                                       double arrival_s, double departure_s) {
  const double times[] = {arrival_s, departure_s};
  fleetyard_add(paths, agent, vertex, times);
}

/* `heading_rad` is NaN for a robot without one. */
static inline void fleetyard_add_knot(FleetyardPaths *paths, uint32_t agent, double time_s,
                                      double x_m, double y_m, double heading_rad) {
  const double numbers[] = {time_s, x_m, y_m, heading_rad};
  fleetyard_add(paths, agent, FLEETYARD_NONE, numbers);
}

/* In the plane: a control of `size` numbers that is held for a time, from the end of the agent's last
 * one on. An agent needs no knots beside its controls; without either it stays at its start. */
static inline void fleetyard_add_control(FleetyardPaths *paths, uint32_t agent, double duration_s,
                                         const double *control, uint32_t size) {
  FleetyardPath *path = &paths->of[agent];
  uint64_t room = fleetyard_more_room(path->segment_room, path->segments + 1);
  path->duration_s = (double *)fleetyard_grown(path->duration_s, path->segment_room, room,
                                               sizeof *path->duration_s);
  path->segment_room = room;
  path->duration_s[path->segments++] = duration_s;
  room = fleetyard_more_room(path->number_room, path->numbers + size);
  path->controls =
      (double *)fleetyard_grown(path->controls, path->number_room, room, sizeof *path->controls);
  path->number_room = room;
  for (uint32_t i = 0; i < size; i++)
    path->controls[path->numbers++] = control[i];
}

/* The place of an agent's entry; after its last one it stays there. NONE without any. */
static inline uint32_t fleetyard_path_at(const FleetyardPath *path, uint64_t time) {
  return path->length == 0 ? FLEETYARD_NONE
                           : path->places[time < path->length ? time : path->length - 1];
}

/* Takes an agent's path back. */
static inline void fleetyard_clear_path(FleetyardPath *path) {
  free(path->places);
  for (int i = 0; i < 4; i++)
    free(path->columns[i]);
  free(path->duration_s);
  free(path->controls);
  memset(path, 0, sizeof *path);
}

static inline void fleetyard_clear_paths(FleetyardPaths *paths) {
  for (uint32_t agent = 0; agent < paths->agents; agent++)
    fleetyard_clear_path(&paths->of[agent]);
}

static inline void fleetyard_free_paths(FleetyardPaths *paths) {
  fleetyard_clear_paths(paths);
  free(paths->of);
  memset(paths, 0, sizeof *paths);
}

/* Paths in the arrays that the contract wants. */
typedef struct FleetyardFlat {
  uint64_t *offsets;
  uint32_t *places;
  double *columns[4];
  uint64_t *segment_offsets; /* null without controls, as what follows */
  double *duration_s;
  uint64_t *control_offsets;
  double *controls;
} FleetyardFlat;

/* The controls of a plan in the plane, unless every agent has nothing but knots. */
static inline void fleetyard_flat_controls(const FleetyardPaths *paths, FleetyardFlat *flat) {
  bool any = false;
  for (uint32_t agent = 0; agent < paths->agents; agent++)
    any = any || paths->of[agent].segments > 0 || paths->of[agent].length == 0;
  if (paths->form != FLEETYARD_FORM_TRAJECTORIES || !any)
    return;
  size_t offsets = (size_t)paths->agents + 1;
  flat->segment_offsets = (uint64_t *)fleetyard_array(offsets, sizeof *flat->segment_offsets);
  flat->control_offsets = (uint64_t *)fleetyard_array(offsets, sizeof *flat->control_offsets);
  for (uint32_t agent = 0; agent < paths->agents; agent++) {
    flat->segment_offsets[agent + 1] = flat->segment_offsets[agent] + paths->of[agent].segments;
    flat->control_offsets[agent + 1] = flat->control_offsets[agent] + paths->of[agent].numbers;
  }
  flat->duration_s = (double *)fleetyard_array((size_t)flat->segment_offsets[paths->agents],
                                               sizeof *flat->duration_s);
  flat->controls = (double *)fleetyard_array((size_t)flat->control_offsets[paths->agents],
                                             sizeof *flat->controls);
  for (uint32_t agent = 0; agent < paths->agents; agent++) {
    const FleetyardPath *path = &paths->of[agent];
    if (path->segments > 0)
      memcpy(flat->duration_s + flat->segment_offsets[agent], path->duration_s,
             (size_t)path->segments * sizeof *path->duration_s);
    if (path->numbers > 0)
      memcpy(flat->controls + flat->control_offsets[agent], path->controls,
             (size_t)path->numbers * sizeof *path->controls);
  }
}

static inline FleetyardFlat fleetyard_flat(const FleetyardPaths *paths) {
  FleetyardFlat flat;
  memset(&flat, 0, sizeof flat);
  flat.offsets = (uint64_t *)fleetyard_array((size_t)paths->agents + 1, sizeof *flat.offsets);
  for (uint32_t agent = 0; agent < paths->agents; agent++)
    flat.offsets[agent + 1] = flat.offsets[agent] + paths->of[agent].length;
  size_t total = (size_t)flat.offsets[paths->agents];
  if (paths->form != FLEETYARD_FORM_TRAJECTORIES)
    flat.places = (uint32_t *)fleetyard_array(total, sizeof *flat.places);
  for (int i = 0; i < fleetyard_columns(paths->form); i++)
    flat.columns[i] = (double *)fleetyard_array(total, sizeof *flat.columns[i]);
  for (uint32_t agent = 0; agent < paths->agents; agent++) {
    const FleetyardPath *path = &paths->of[agent];
    uint64_t begin = flat.offsets[agent];
    if (path->length > 0 && flat.places)
      memcpy(flat.places + begin, path->places, (size_t)path->length * sizeof *path->places);
    for (int i = 0; i < 4 && path->length > 0 && flat.columns[i]; i++)
      memcpy(flat.columns[i] + begin, path->columns[i],
             (size_t)path->length * sizeof *path->columns[i]);
  }
  fleetyard_flat_controls(paths, &flat);
  return flat;
}

static inline void fleetyard_free_flat(FleetyardFlat *flat) {
  free(flat->offsets);
  free(flat->places);
  for (int i = 0; i < 4; i++)
    free(flat->columns[i]);
  free(flat->segment_offsets);
  free(flat->duration_s);
  free(flat->control_offsets);
  free(flat->controls);
}

/* The status of a call that has submitted something. A host that is busy takes it later. */
static inline int32_t fleetyard_taken(int32_t code, const FleetyardSink *sink) {
  if (code == FLEETYARD_OK)
    return FLEETYARD_STATUS_SOLVED;
  return code == FLEETYARD_TOO_LATE
             ? fleetyard_fail(sink, FLEETYARD_STATUS_TIMED_OUT, "the answer came too late")
         : code == FLEETYARD_BUSY
             ? fleetyard_fail(sink, FLEETYARD_STATUS_GAVE_UP, "the host has no room for the answer")
             : fleetyard_fail(sink, FLEETYARD_STATUS_INTERNAL_ERROR,
                              "the host rejected the answer, which is malformed");
}

/* Hands a plan over to the host, which copies it. */
static inline int32_t fleetyard_submit(const FleetyardPaths *paths, const FleetyardSink *sink) {
  FleetyardFlat flat = fleetyard_flat(paths);
  bool headings = false;
  for (uint64_t i = 0; flat.columns[3] && i < flat.offsets[paths->agents]; i++)
    headings = headings || !isnan(flat.columns[3][i]);
  FleetyardCells cells = {sizeof cells, 0, flat.places};
  FleetyardVisits visits = {sizeof visits, 0, flat.places, flat.columns[0], flat.columns[1]};
  FleetyardTrajectories motions = {sizeof motions,
                                   0,
                                   flat.columns[0],
                                   flat.columns[1],
                                   flat.columns[2],
                                   headings ? flat.columns[3] : NULL,
                                   flat.segment_offsets,
                                   flat.duration_s,
                                   flat.control_offsets,
                                   flat.controls};
  FleetyardPlan plan;
  memset(&plan, 0, sizeof plan);
  plan.struct_size = sizeof plan;
  plan.agents = paths->agents;
  plan.form = paths->form;
  plan.offsets = flat.offsets;
  plan.body = paths->form == FLEETYARD_FORM_CELLS    ? (const void *)&cells
              : paths->form == FLEETYARD_FORM_VISITS ? (const void *)&visits
                                                     : (const void *)&motions;
  int32_t code = sink->submit_plan(sink->context, &plan);
  fleetyard_free_flat(&flat);
  return fleetyard_taken(code, sink);
}

/* ---- Annotations ------------------------------------------------------------- */

/* Takes what a planner wants to show; null unless somebody wants to see it, so that `plan` does no
 * work for nobody. */
static inline const FleetyardAnnotations *fleetyard_annotations(const FleetyardSink *sink) {
  const FleetyardAnnotations *annotations = (const FleetyardAnnotations *)sink->get_extension(
      sink->context, fleetyard_text(FLEETYARD_ANNOTATIONS_ID));
  return annotations && annotations->struct_size >= sizeof *annotations ? annotations : NULL;
}

/* An annotation of a layer that holds at all times, without shapes so far. */
static inline FleetyardAnnotation fleetyard_annotation(const char *layer, const char *text) {
  FleetyardAnnotation annotation;
  memset(&annotation, 0, sizeof annotation);
  annotation.struct_size = sizeof annotation;
  annotation.layer = fleetyard_text(layer);
  annotation.text = fleetyard_text(text);
  annotation.agent = FLEETYARD_NONE;
  annotation.to_s = INFINITY;
  return annotation;
}

/* Hands over places as one shape: a way from place to place. What the host does not keep, it counts. */
static inline void fleetyard_annotate_places(const FleetyardSink *sink,
                                             FleetyardAnnotation annotation,
                                             const uint32_t *places, uint32_t count) {
  const FleetyardAnnotations *annotations = fleetyard_annotations(sink);
  const uint64_t offsets[2] = {0, count};
  annotation.shape = FLEETYARD_SHAPE_PLACES;
  annotation.count = 1;
  annotation.offsets = offsets;
  annotation.places = places;
  if (annotations)
    annotations->annotate(sink->context, &annotation);
}

/* Hands over points as one shape: FLEETYARD_SHAPE_POINTS, _LINES or _RINGS. */
static inline void fleetyard_annotate_points(const FleetyardSink *sink,
                                             FleetyardAnnotation annotation, int32_t shape,
                                             const double *x_m, const double *y_m,
                                             uint32_t count) {
  const FleetyardAnnotations *annotations = fleetyard_annotations(sink);
  const uint64_t offsets[2] = {0, count};
  annotation.shape = shape;
  annotation.count = 1;
  annotation.offsets = offsets;
  annotation.x_m = x_m;
  annotation.y_m = y_m;
  if (annotations)
    annotations->annotate(sink->context, &annotation);
}

/* Refuses a plan that somebody else left, unless it has a path of cells for each agent. */
static inline int32_t fleetyard_check_cells(const FleetyardPlan *plan,
                                            const FleetyardInstance *instance,
                                            const FleetyardDescriptor *about,
                                            const FleetyardSink *sink) {
  FLEETYARD_CHECK(FLEETYARD_WHOLE(plan, sink));
  FLEETYARD_CHECK(fleetyard_zero(plan->reserved, "plan", sink));
  FLEETYARD_CHECK(fleetyard_code(plan->form, 1u << FLEETYARD_FORM_CELLS, "form", sink));
  FLEETYARD_CHECK(fleetyard_check_parts(&plan->parts, about, sink));
  const FleetyardCells *cells = (const FleetyardCells *)plan->body;
  FLEETYARD_CHECK(FLEETYARD_WHOLE(cells, sink));
  return plan->agents == instance->agents
             ? FLEETYARD_STATUS_SOLVED
             : fleetyard_fail(sink, FLEETYARD_STATUS_INVALID_INPUT,
                              "the failed plan has other agents than the instance");
}

/* The cell of an agent of a plan of cells; after its last one it stays there. NONE without any. */
static inline uint32_t fleetyard_at(const FleetyardPlan *plan, uint32_t agent, uint64_t time) {
  const FleetyardCells *body = (const FleetyardCells *)plan->body;
  uint64_t begin = plan->offsets[agent], length = plan->offsets[agent + 1] - begin;
  return length == 0 ? FLEETYARD_NONE : body->cells[begin + (time < length ? time : length - 1)];
}

/* ---- Requests ---------------------------------------------------------------- */

/* What a generator decides, while it is being decided. */
typedef struct FleetyardDecision {
  const FleetyardFleetState *state;
  FleetyardPaths goals; /* by agent, in the form of cells: places in their order */
  FleetyardAssignment *assignments;
  uint64_t assigned, room;
  uint32_t window_steps; /* those asked for, unless they are changed */
  double window_s;
} FleetyardDecision;

/* Begins with the goals that agents have already, and no tasks given away. */
static inline FleetyardDecision fleetyard_decide(const FleetyardFleetState *state) {
  const FleetyardInstance *next = state->next;
  FleetyardDecision decision;
  memset(&decision, 0, sizeof decision);
  decision.state = state;
  decision.window_steps = next->window_steps;
  decision.window_s = next->window_s;
  decision.goals = fleetyard_paths(FLEETYARD_FORM_CELLS, next->agents);
  for (uint32_t agent = 0; agent < next->agents; agent++)
    for (uint64_t i = next->goal_offsets[agent]; i < next->goal_offsets[agent + 1]; i++)
      fleetyard_add_cell(&decision.goals, agent, next->goals[i]);
  return decision;
}

/* Gives a task to an agent by its index: its places become the agent's last goals. */
static inline void fleetyard_assign(FleetyardDecision *decision, uint32_t task, uint32_t agent) {
  const FleetyardFleetState *state = decision->state;
  uint64_t begin = state->task_offsets[task];
  FleetyardAssignment given = {state->task_ids[task], agent, 0};
  uint64_t room = fleetyard_more_room(decision->room, decision->assigned + 1);
  decision->assignments = (FleetyardAssignment *)fleetyard_grown(
      decision->assignments, decision->room, room, sizeof *decision->assignments);
  decision->room = room;
  decision->assignments[decision->assigned++] = given;
  fleetyard_add_cells(&decision->goals, agent, state->task_places + begin,
                      state->task_offsets[task + 1] - begin);
}

static inline int32_t fleetyard_submit_request(const FleetyardDecision *decision,
                                               const FleetyardSink *sink) {
  FleetyardFlat flat = fleetyard_flat(&decision->goals);
  FleetyardRequest request;
  memset(&request, 0, sizeof request);
  request.struct_size = sizeof request;
  request.agents = decision->goals.agents;
  request.goal_offsets = flat.offsets;
  request.goals = flat.places;
  request.assignments = decision->assignments;
  request.assignment_count = decision->assigned;
  request.window_steps = decision->window_steps;
  request.window_s = decision->window_s;
  int32_t code = sink->submit_request(sink->context, &request);
  fleetyard_free_flat(&flat);
  return fleetyard_taken(code, sink);
}

static inline void fleetyard_free_decision(FleetyardDecision *decision) {
  fleetyard_free_paths(&decision->goals);
  free(decision->assignments);
  memset(decision, 0, sizeof *decision);
}

/* ---- What the library exports ---------------------------------------------- */

/* For plugins without options, and with nothing to remember. */
static inline void *fleetyard_make_nothing(const FleetyardOptions *options,
                                           const FleetyardSink *sink) {
  (void)options, (void)sink;
  return fleetyard_array(1, 1);
}

/* For plugins that learn nothing of a map beforehand: the instance names it. */
static inline int32_t fleetyard_learn_nothing(void *context,
                                              const FleetyardEnvironment *environment,
                                              const FleetyardBudget *budget,
                                              const FleetyardSink *sink) {
  (void)context, (void)environment, (void)budget, (void)sink;
  return FLEETYARD_STATUS_SOLVED;
}

/* A plugin that has been made: what the functions below have as their context. */
typedef struct FleetyardMade {
  void *context; /* the plugin's */
  bool prepared;
} FleetyardMade;

/* Refuses a call that comes before a successful `prepare`. */
static inline int32_t fleetyard_check_prepared(const FleetyardMade *made,
                                               const FleetyardSink *sink) {
  return made->prepared ? FLEETYARD_STATUS_SOLVED
                        : fleetyard_fail(sink, FLEETYARD_STATUS_INVALID_INPUT,
                                         "the call came before a successful `prepare`");
}

/* Exports one plugin. `KIND` is Planner, FailPolicy, InstanceGenerator or InvocationPolicy, and
 * `CREATE` fills in what the host gets, as the kind's factory does, but without the index. */
#define FLEETYARD_LIBRARY(KIND, FACTORY_ID, ABOUT, CREATE)                                         \
  static uint32_t fleetyard_count(void *unused) {                                                  \
    (void)unused;                                                                                  \
    return 1;                                                                                      \
  }                                                                                                \
  static const FleetyardDescriptor *fleetyard_describe(void *unused, uint32_t index) {             \
    (void)unused;                                                                                  \
    return index == 0 ? &(ABOUT) : NULL;                                                           \
  }                                                                                                \
  static int32_t fleetyard_create(void *unused, uint32_t index, const FleetyardOptions *options,   \
                                  const FleetyardSink *sink, Fleetyard##KIND *out) {               \
    Fleetyard##KIND made;                                                                          \
    (void)unused;                                                                                  \
    memset(&made, 0, sizeof made);                                                                 \
    made.struct_size = sizeof made;                                                                \
    if (index != 0)                                                                                \
      return fleetyard_fail(sink, FLEETYARD_STATUS_INVALID_INPUT, "this library has one plugin");  \
    if (out->struct_size < sizeof made)                                                            \
      return fleetyard_fail(sink, FLEETYARD_STATUS_UNSUPPORTED,                                    \
                            "the host is older than this plugin: it has no room for it");          \
    FLEETYARD_CHECK(FLEETYARD_WHOLE(options, sink));                                               \
    FLEETYARD_CHECK(CREATE(options, sink, &made));                                                 \
    *out = made;                                                                                   \
    return FLEETYARD_STATUS_SOLVED;                                                                \
  }                                                                                                \
  static const Fleetyard##KIND##Factory fleetyard_factory = {                                      \
      sizeof(Fleetyard##KIND##Factory), 0,                  NULL, fleetyard_count,                 \
      fleetyard_describe,               fleetyard_create};                                         \
  static const void *fleetyard_get_factory(FleetyardStr id) {                                      \
    return fleetyard_equals(id, FACTORY_ID) ? &fleetyard_factory : NULL;                           \
  }                                                                                                \
  const FleetyardPluginEntry fleetyard_plugin_entry_v1 = {                                         \
      sizeof(FleetyardPluginEntry), FLEETYARD_ABI_MAJOR,  FLEETYARD_ABI_MINOR, NULL, NULL,         \
      fleetyard_get_factory}

/* The part of the kinds that is the same: NEW makes the plugin's context from its options, or
 * gives null after a failure, and FREE ends it. */
#define FLEETYARD_MAKE(KIND, NEW, FREE, FILL)                                                      \
  static void fleetyard_destroy(void *context) {                                                   \
    FREE(((FleetyardMade *)context)->context);                                                     \
    free(context);                                                                                 \
  }                                                                                                \
  static int32_t fleetyard_make(const FleetyardOptions *options, const FleetyardSink *sink,        \
                                Fleetyard##KIND *out) {                                            \
    void *context = NEW(options, sink);                                                            \
    if (!context)                                                                                  \
      return FLEETYARD_STATUS_INVALID_INPUT;                                                       \
    FleetyardMade *made = (FleetyardMade *)fleetyard_array(1, sizeof *made);                       \
    made->context = context;                                                                       \
    out->context = made;                                                                           \
    out->destroy = fleetyard_destroy;                                                              \
    FILL;                                                                                          \
    return FLEETYARD_STATUS_SOLVED;                                                                \
  }

#define FLEETYARD_PREPARE(ABOUT, PREPARE)                                                          \
  static int32_t fleetyard_prepare(void *context, const FleetyardEnvironment *environment,         \
                                   const FleetyardBudget *budget, const FleetyardSink *sink) {     \
    FleetyardMade *made = (FleetyardMade *)context;                                                \
    made->prepared = false;                                                                        \
    FLEETYARD_CHECK(FLEETYARD_WHOLE(budget, sink));                                                \
    FLEETYARD_CHECK(fleetyard_check_environment(environment, &(ABOUT), sink));                     \
    FLEETYARD_CHECK(PREPARE(made->context, environment, budget, sink));                            \
    made->prepared = true;                                                                         \
    return FLEETYARD_STATUS_SOLVED;                                                                \
  }

/* Exports one planner. What it is asked has passed the checks above. */
#define FLEETYARD_EXPORT_PLANNER(ABOUT, NEW, PREPARE, PLAN, FREE)                                  \
  FLEETYARD_PREPARE(ABOUT, PREPARE)                                                                \
  static int32_t fleetyard_call(void *context, const FleetyardInstance *instance,                  \
                                const FleetyardBudget *budget, const FleetyardSink *sink) {        \
    const FleetyardMade *made = (const FleetyardMade *)context;                                    \
    FLEETYARD_CHECK(fleetyard_check_prepared(made, sink));                                         \
    FLEETYARD_CHECK(FLEETYARD_WHOLE(budget, sink));                                                \
    FLEETYARD_CHECK(fleetyard_check_instance(instance, &(ABOUT), sink));                           \
    return PLAN(made->context, instance, budget, sink);                                            \
  }                                                                                                \
  FLEETYARD_MAKE(Planner, NEW, FREE, out->prepare = fleetyard_prepare; out->plan = fleetyard_call) \
  FLEETYARD_LIBRARY(Planner, FLEETYARD_PLANNER_FACTORY_ID, ABOUT, fleetyard_make)

/* Exports one fail policy, for grids. */
#define FLEETYARD_EXPORT_FAIL_POLICY(ABOUT, NEW, PREPARE, RECOVER, FREE)                           \
  FLEETYARD_PREPARE(ABOUT, PREPARE)                                                                \
  static int32_t fleetyard_call(void *context, const FleetyardInstance *instance,                  \
                                const FleetyardPlan *failed, const FleetyardBudget *budget,        \
                                const FleetyardSink *sink) {                                       \
    const FleetyardMade *made = (const FleetyardMade *)context;                                    \
    FLEETYARD_CHECK(fleetyard_check_prepared(made, sink));                                         \
    FLEETYARD_CHECK(FLEETYARD_WHOLE(budget, sink));                                                \
    FLEETYARD_CHECK(fleetyard_check_question(instance, &(ABOUT), sink));                           \
    if (failed)                                                                                    \
      FLEETYARD_CHECK(fleetyard_check_cells(failed, instance, &(ABOUT), sink));                    \
    return RECOVER(made->context, instance, failed, budget, sink);                                 \
  }                                                                                                \
  FLEETYARD_MAKE(FailPolicy, NEW, FREE, out->prepare = fleetyard_prepare;                          \
                 out->recover = fleetyard_call)                                                    \
  FLEETYARD_LIBRARY(FailPolicy, FLEETYARD_FAIL_POLICY_FACTORY_ID, ABOUT, fleetyard_make)

/* Exports one instance generator. */
#define FLEETYARD_EXPORT_INSTANCE_GENERATOR(ABOUT, NEW, PREPARE, GENERATE, FREE)                   \
  FLEETYARD_PREPARE(ABOUT, PREPARE)                                                                \
  static int32_t fleetyard_call(void *context, const FleetyardFleetState *state,                   \
                                const FleetyardBudget *budget, const FleetyardSink *sink) {        \
    const FleetyardMade *made = (const FleetyardMade *)context;                                    \
    FLEETYARD_CHECK(fleetyard_check_prepared(made, sink));                                         \
    FLEETYARD_CHECK(FLEETYARD_WHOLE(budget, sink));                                                \
    FLEETYARD_CHECK(FLEETYARD_WHOLE(state, sink));                                                 \
    FLEETYARD_CHECK(fleetyard_check_parts(&state->parts, &(ABOUT), sink));                         \
    FLEETYARD_CHECK(fleetyard_check_question(state->next, &(ABOUT), sink));                        \
    return GENERATE(made->context, state, budget, sink);                                           \
  }                                                                                                \
  FLEETYARD_MAKE(InstanceGenerator, NEW, FREE, out->prepare = fleetyard_prepare;                   \
                 out->generate = fleetyard_call)                                                   \
  FLEETYARD_LIBRARY(InstanceGenerator, FLEETYARD_INSTANCE_GENERATOR_FACTORY_ID, ABOUT,             \
                    fleetyard_make)

/* Exports one invocation policy, which learns no map. */
#define FLEETYARD_EXPORT_INVOCATION_POLICY(ABOUT, NEW, SHOULD_INVOKE, FREE)                        \
  static int32_t fleetyard_call(void *context, const FleetyardFleetStatus *status,                 \
                                const FleetyardSink *sink, int32_t *out) {                         \
    FLEETYARD_CHECK(FLEETYARD_WHOLE(status, sink));                                                \
    FLEETYARD_CHECK(fleetyard_check_parts(&status->parts, &(ABOUT), sink));                        \
    return SHOULD_INVOKE(((const FleetyardMade *)context)->context, status, sink, out);            \
  }                                                                                                \
  FLEETYARD_MAKE(InvocationPolicy, NEW, FREE, out->should_invoke = fleetyard_call)                 \
  FLEETYARD_LIBRARY(InvocationPolicy, FLEETYARD_INVOCATION_POLICY_FACTORY_ID, ABOUT,               \
                    fleetyard_make)

#endif /* FLEETYARD_EASY_H */
