/* A planner that misbehaves on request: option `fault`, see README.md. A fixture for
 * tests of the host, and nothing to learn from.
 *
 * With `none` it is honest: the agents go to their goals one after the other while
 * all others stand. Faults of plans begin with that honest plan and add one wrong
 * thing, so that the host should find one rule broken and no other. What it does to
 * its process and to the machine stands in mischief.h.
 *
 * -DVARIANT=NAME builds libraries that are faulty before any planner exists.
 */

#define _GNU_SOURCE

#define HONEST_ENTRY 0
#define SHORT_ENTRY 1       /* struct_size too small */
#define WRONG_MAJOR 2       /* abi_major 2 */
#define NEWER_MINOR 3       /* abi_minor 9: no fault, must load */
#define NO_SYMBOL 4         /* no entry symbol */
#define CONSTRUCTOR_CRASH 5 /* SIGSEGV while the library is being loaded */
#define CONSTRUCTOR_HANG 6  /* loading never ends */
#define CHATTY_LOAD 7       /* no fault, but prints while being loaded */
#define INIT_FAILS 8        /* init returns -1 */
#define NULL_GET_FACTORY 9  /* get_factory is null */
#define SHORT_FACTORY 10    /* factory with struct_size too small */
#define SHORT_DESCRIPTOR 11 /* descriptor with struct_size too small */
#define NULL_DESCRIPTOR 12  /* count says 1, the descriptor is null */
#define MANY_PLUGINS 13     /* count says four thousand million */
#define BAD_ID 14           /* identifier with spaces */
#define BAD_SCHEMA 15       /* options schema that is not JSON */
#define SHORT_PLANNER 16    /* create fills in a planner with struct_size too small */
#define NULL_PLAN 17        /* create fills in a planner without `plan` */
#define LYING_CAPABILITIES 18 /* claims what it cannot do */
#define CONSTRUCTOR_FAULT 19  /* does FLEETYARD_FAULT while being loaded */

#ifndef VARIANT
#define VARIANT HONEST_ENTRY
#endif

#include <arpa/inet.h>
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <linux/filter.h>
#include <linux/perf_event.h>
#include <locale.h>
#include <math.h>
#include <netinet/in.h>
#include <pthread.h>
#include <pwd.h>
#include <sched.h>
#include <setjmp.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/inotify.h>
#include <sys/ioctl.h>
#include <sys/ipc.h>
#include <sys/mman.h>
#include <sys/mount.h>
#include <sys/personality.h>
#include <sys/prctl.h>
#include <sys/ptrace.h>
#include <sys/resource.h>
#include <sys/shm.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <sys/uio.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "fleetyard.h"

#define TEXT(literal) {literal, sizeof(literal) - 1}
#define NONE FLEETYARD_NONE

#if VARIANT == CONSTRUCTOR_CRASH || VARIANT == CONSTRUCTOR_HANG || VARIANT == CHATTY_LOAD
__attribute__((constructor)) static void at_load(void) {
#if VARIANT == CONSTRUCTOR_CRASH
  volatile int *volatile nowhere = NULL; /* so that no compiler sees it coming */
  *nowhere = 1;
#elif VARIANT == CONSTRUCTOR_HANG
  for (;;)
    pause();
#else
  puts("{\"hello\": \"from the constructor\"}");
  fflush(stdout);
#endif
}
#endif

#if VARIANT == NO_SYMBOL
extern FLEETYARD_EXPORT const int faulty_has_no_entry;
const int faulty_has_no_entry = 1;
#else

/* The faults of plans and answers, for the schema; the others are in mischief.h. */
#define FAULTS(F)                                                                      \
  F("too-few-agents") F("too-many-agents") F("empty-path") F("wrong-start")            \
  F("not-at-goal") F("teleport") F("collide") F("collide-parked") F("swap")            \
  F("leave-map") F("through-obstacle") F("late") F("twice")                            \
  F("claims-solved-without-plan") F("claims-infeasible") F("bad-status")               \
  F("huge-plan") F("null-plan") F("null-offsets") F("null-cells") F("bad-plan-size")   \
  F("unordered-offsets") F("bad-request")  F("fails") F("exit-after-plan")             \
  F("changes-plan-after") F("changes-plan-during") F("shrinks-plan")                   \
  F("longjmp-callback") F("longjmp-stale") F("crash-after") F("keeps-too-much")

#define ITEM(name) "\"" name "\","
#define MISCHIEF_ITEM(name, function) ITEM(name)

typedef struct {
  char fault[48], during[16], target[256];
  uint64_t size, count; /* 0 for what the fault is usually done with */
  int64_t pid;
  uint32_t rows, cols;
  const uint8_t *passable;
} Faulty;

#include "mischief.h"

static int32_t fail(const FleetyardSink *sink, int32_t status, const char *text) {
  sink->fail(sink->context, (FleetyardStr){text, strlen(text)});
  return status;
}

/* Refuses data that must be understood and is not: this plugin knows none. */
static bool is_critical(const FleetyardParts *parts, const FleetyardSink *sink) {
  for (uint64_t i = 0; i < parts->count; i++) {
    FleetyardStr id = parts->list[i].id;
    char text[256];
    if (!(parts->list[i].flags & FLEETYARD_PART_CRITICAL)) continue;
    snprintf(text, sizeof text, "the critical part `%.*s` is unknown", (int)id.len, id.ptr);
    fail(sink, FLEETYARD_STATUS_UNSUPPORTED, text);
    return true;
  }
  return false;
}

/* ---- Where there is no sink ------------------------------------------------- */

static int32_t no_plan(void *context, const FleetyardPlan *plan) {
  (void)context;
  (void)plan;
  return FLEETYARD_REJECTED;
}

static int32_t no_request(void *context, const FleetyardRequest *request) {
  (void)context;
  (void)request;
  return FLEETYARD_REJECTED;
}

static uint64_t monotonic_ns(void *context) {
  struct timespec now = {0, 0};
  (void)context;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return (uint64_t)now.tv_sec * 1000000000u + (uint64_t)now.tv_nsec;
}

static void metric_to_stderr(void *context, FleetyardStr name, double value) {
  (void)context;
  fprintf(stderr, "faulty: %.*s = %g\n", (int)name.len, name.ptr, value);
}

static void log_to_stderr(void *context, int32_t level, FleetyardStr text) {
  (void)context;
  (void)level;
  fprintf(stderr, "faulty: %.*s\n", (int)text.len, text.ptr);
}

static void note_to_stderr(void *context, FleetyardStr name, FleetyardStr text) {
  (void)context;
  fprintf(stderr, "faulty: %.*s: %.*s\n", (int)name.len, name.ptr, (int)text.len, text.ptr);
}

static const void *no_extension(void *context, FleetyardStr id) {
  (void)context;
  (void)id;
  return NULL;
}

static void no_progress(void *context, uint64_t done, uint64_t total) {
  (void)context;
  (void)done;
  (void)total;
}

static int32_t never_cancelled(void *context) {
  (void)context;
  return 0;
}

static void no_message(void *context, FleetyardStr message) {
  (void)context;
  (void)message;
}

/* For what has no call to answer: constructors, `destroy`, `deinit`. */
static const FleetyardSink standard_error = {
    .struct_size = sizeof(FleetyardSink),
    .submit_plan = no_plan,
    .submit_request = no_request,
    .cancelled = never_cancelled,
    .now_ns = monotonic_ns,
    .fail = no_message,
    .log = log_to_stderr,
    .metric = metric_to_stderr,
    .note = note_to_stderr,
    .progress = no_progress,
    .get_extension = no_extension,
};

/* What `deinit` does, which has no object. */
static Faulty at_the_end;

static void deinit(void) { misbehave(&at_the_end, "deinit", &standard_error); }

#if VARIANT == CONSTRUCTOR_FAULT
static const char *variable(const char *name) {
  const char *value = getenv(name);
  return value ? value : "";
}

__attribute__((constructor)) static void fault_at_load(void) {
  static Faulty faulty;
  snprintf(faulty.fault, sizeof faulty.fault, "%s", variable("FLEETYARD_FAULT"));
  snprintf(faulty.target, sizeof faulty.target, "%s", variable("FLEETYARD_TARGET"));
  strcpy(faulty.during, "load");
  faulty.size = strtoull(variable("FLEETYARD_SIZE"), NULL, 10);
  faulty.count = strtoull(variable("FLEETYARD_COUNT"), NULL, 10);
  faulty.pid = strtoll(variable("FLEETYARD_PID"), NULL, 10);
  misbehave(&faulty, "load", &standard_error);
}
#endif

/* ---- The honest plan ------------------------------------------------------- */

/* Where everybody is, step by step: at[step * agents + agent]. */
typedef struct {
  const Faulty *faulty;
  uint32_t agents, steps;
  uint32_t *at;
  bool broken; /* out of memory */
} Steps;

static uint32_t *last_step(const Steps *steps) {
  return steps->at + (size_t)(steps->steps - 1) * steps->agents;
}

/* Everybody stays, except that `agent` goes to `cell` (nobody when NONE). */
static void step(Steps *steps, uint32_t agent, uint32_t cell) {
  size_t row = steps->agents * sizeof *steps->at;
  uint32_t *moved = realloc(steps->at, (steps->steps + 1) * row);
  if (!moved) {
    steps->broken = true;
    return;
  }
  steps->at = moved;
  memcpy(moved + (size_t)steps->steps * steps->agents, last_step(steps), row);
  steps->steps++;
  if (agent != NONE)
    last_step(steps)[agent] = cell;
}

static uint32_t neighbour(const Faulty *faulty, uint32_t cell, int direction) {
  uint32_t row = cell / faulty->cols, col = cell % faulty->cols;
  if (direction == 0)
    return row > 0 ? cell - faulty->cols : NONE;
  if (direction == 1)
    return col + 1 < faulty->cols ? cell + 1 : NONE;
  if (direction == 2)
    return row + 1 < faulty->rows ? cell + faulty->cols : NONE;
  return col > 0 ? cell - 1 : NONE;
}

static bool occupied(const Steps *steps, uint32_t cell) {
  for (uint32_t agent = 0; agent < steps->agents; agent++)
    if (last_step(steps)[agent] == cell)
      return true;
  return false;
}

/* Where each cell was reached from in a breadth-first search of `agent` around those
 * that stand; `through` may be entered even so. NONE where it was not reached. */
static uint32_t *search(Steps *steps, uint32_t agent, uint32_t through) {
  const Faulty *faulty = steps->faulty;
  size_t cells = (size_t)faulty->rows * faulty->cols;
  uint32_t *from = malloc(cells * sizeof *from), *queue = malloc(cells * sizeof *queue);
  uint8_t *standing = calloc(cells, 1);
  if (!from || !queue || !standing) {
    steps->broken = true;
    free(queue);
    free(standing);
    free(from);
    return NULL;
  }
  for (uint32_t other = 0; other < steps->agents; other++)
    standing[last_step(steps)[other]] = 1;
  memset(from, 0xFF, cells * sizeof *from);
  uint32_t start = last_step(steps)[agent], head = 0, tail = 0;
  from[start] = start;
  queue[tail++] = start;
  while (head < tail) {
    uint32_t cell = queue[head++];
    for (int direction = 0; direction < 4; direction++) {
      uint32_t next = neighbour(faulty, cell, direction);
      if (next == NONE || !faulty->passable[next] || from[next] != NONE ||
          (standing[next] && next != through))
        continue;
      from[next] = cell;
      queue[tail++] = next;
    }
  }
  free(queue);
  free(standing);
  return from;
}

static void walk(Steps *steps, uint32_t agent, const uint32_t *from, uint32_t to) {
  if (from[to] == to)
    return;
  walk(steps, agent, from, from[to]);
  step(steps, agent, to);
}

/* Sends an agent to a cell, if there is a way. */
static bool go(Steps *steps, uint32_t agent, uint32_t to, uint32_t through) {
  uint32_t *from = search(steps, agent, through);
  bool found = from && from[to] != NONE;
  if (found)
    walk(steps, agent, from, to);
  free(from);
  return found && !steps->broken;
}

/* A free neighbour where nobody stands, or NONE. */
static uint32_t free_neighbour(const Steps *steps, uint32_t cell) {
  for (int direction = 0; direction < 4; direction++) {
    uint32_t next = neighbour(steps->faulty, cell, direction);
    if (next != NONE && steps->faulty->passable[next] && !occupied(steps, next))
      return next;
  }
  return NONE;
}

static bool honest(Steps *steps, const FleetyardInstance *instance) {
  uint32_t left = instance->agents;
  uint8_t *done = calloc(instance->agents, 1);
  bool moving = done != NULL;
  while (left > 0 && moving) {
    moving = false;
    for (uint32_t agent = 0; agent < instance->agents; agent++) {
      uint32_t goal = instance->goals[instance->goal_offsets[agent + 1] - 1];
      if (!done[agent] && go(steps, agent, goal, NONE)) {
        done[agent] = 1;
        moving = true;
        left--;
      }
    }
  }
  free(done);
  return left == 0 && !steps->broken;
}

/* ---- One wrong thing more -------------------------------------------------- */

/* Adds the fault to an honest plan. NULL, or why this instance does not allow it. */
static const char *spoil(Steps *steps, const char *fault) {
  const Faulty *faulty = steps->faulty;
  uint32_t cells = faulty->rows * faulty->cols;
  uint32_t home = last_step(steps)[0];
  uint32_t beside = free_neighbour(steps, home);
  if (strcmp(fault, "leave-map") == 0) {
    step(steps, 0, cells + 5);
    step(steps, 0, home);
  } else if (strcmp(fault, "not-at-goal") == 0) {
    if (beside == NONE)
      return "agent 0 cannot leave its goal";
    step(steps, 0, beside);
  } else if (strcmp(fault, "wrong-start") == 0) {
    for (uint32_t agent = 0; agent < steps->agents; agent++) {
      uint32_t start = steps->at[agent], near = free_neighbour(steps, start);
      bool taken = near == NONE;
      for (uint32_t other = 0; other < steps->agents; other++)
        taken = taken || steps->at[other] == near;
      if (!taken) {
        /* Everybody waits one step, and this agent comes from the wrong cell. */
        step(steps, NONE, 0);
        memmove(steps->at + steps->agents, steps->at,
                (size_t)(steps->steps - 1) * steps->agents * sizeof *steps->at);
        steps->at[agent] = near;
        return NULL;
      }
    }
    return "no agent has a free cell beside its start";
  } else if (strcmp(fault, "teleport") == 0) {
    for (uint32_t cell = 0; cell < cells; cell++) {
      uint32_t rows = cell / faulty->cols > home / faulty->cols ? cell / faulty->cols - home / faulty->cols
                                                                : home / faulty->cols - cell / faulty->cols;
      if (rows >= 2 && faulty->passable[cell] && !occupied(steps, cell)) {
        step(steps, 0, cell);
        step(steps, 0, home);
        return NULL;
      }
    }
    return "no cell is far enough away";
  } else if (strcmp(fault, "through-obstacle") == 0) {
    uint32_t *from = search(steps, 0, NONE);
    for (uint32_t cell = 0; from && cell < cells; cell++)
      for (int direction = 0; from[cell] != NONE && direction < 4; direction++) {
        uint32_t wall = neighbour(faulty, cell, direction);
        if (wall != NONE && !faulty->passable[wall]) {
          walk(steps, 0, from, cell);
          free(from);
          step(steps, 0, wall);
          step(steps, 0, cell);
          return go(steps, 0, home, NONE) ? NULL : "no way back";
        }
      }
    free(from);
    return "agent 0 reaches no obstacle";
  } else if (strcmp(fault, "collide") == 0 || strcmp(fault, "collide-parked") == 0 ||
             strcmp(fault, "swap") == 0) {
    if (steps->agents < 2)
      return "it takes two agents";
    uint32_t other = last_step(steps)[1];
    uint32_t *from = search(steps, 1, home);
    if (!from || from[home] == NONE) {
      free(from);
      return "agent 1 does not reach agent 0";
    }
    uint32_t door = from[home];
    walk(steps, 1, from, door);
    free(from);
    step(steps, 1, home);
    if (strcmp(fault, "swap") == 0)
      last_step(steps)[0] = door;
    step(steps, 1, door);
    last_step(steps)[0] = home;
    if (!go(steps, 1, other, NONE))
      return "no way back";
    if (strcmp(fault, "collide") == 0) {
      /* Agent 0 moves once more: so it was not parked when agent 1 came. */
      if (beside == NONE)
        beside = free_neighbour(steps, home);
      if (beside == NONE)
        return "agent 0 cannot leave its goal";
      step(steps, 0, beside);
      step(steps, 0, home);
    }
  }
  return NULL;
}

static int32_t submit(const FleetyardSink *sink, const FleetyardPlan *plan) {
  int32_t code = sink->submit_plan(sink->context, plan);
  if (code != FLEETYARD_OK)
    say(sink, "the host rejected the plan");
  return code;
}

/* ---- Plans that do not stay as they are ------------------------------------- */

typedef struct {
  uint64_t *offset;
  uint32_t *cell;
  atomic_bool started, stop;
} Scribbler;

static void *scribble(void *context) {
  Scribbler *scribbler = context;
  volatile uint64_t *offset = scribbler->offset;
  volatile uint32_t *cell = scribbler->cell;
  uint64_t honest_offset = *offset;
  uint32_t honest_cell = *cell;
  scribbler->started = true;
  while (!scribbler->stop) {
    *offset = UINT64_C(1) << 40;
    *cell = UINT32_MAX;
    *offset = honest_offset;
    *cell = honest_cell;
  }
  return NULL;
}

/* Submits while another thread makes the plan a bad one and a good one again. */
static void submit_while_changing(const FleetyardSink *sink, const FleetyardPlan *plan,
                                  uint64_t *offsets, uint32_t *cells) {
  Scribbler scribbler = {&offsets[plan->agents], &cells[0], false, false};
  pthread_t thread;
  if (pthread_create(&thread, NULL, scribble, &scribbler) != 0) {
    say(sink, "could not start a thread");
    return;
  }
  while (!scribbler.started)
    sched_yield();
  uint64_t rejected = 0;
  for (int turn = 0; turn < 200; turn++)
    rejected += sink->submit_plan(sink->context, plan) != FLEETYARD_OK;
  scribbler.stop = true;
  pthread_join(thread, NULL);
  metric(sink, "rejected", (double)rejected);
}

/* The plan's cells are in a file that is empty before anybody reads them. */
static int32_t submit_shrunk(const FleetyardSink *sink, const FleetyardPlan *plan,
                             FleetyardCells *body, size_t size) {
  char path[4200];
  snprintf(path, sizeof path, "%.4096s/fy-plan-XXXXXX", scratch());
  int descriptor = mkstemp(path);
  void *mapped = MAP_FAILED;
  if (descriptor >= 0) {
    unlink(path);
    if (write(descriptor, body->cells, size) == (ssize_t)size)
      mapped = mmap(NULL, size, PROT_READ, MAP_SHARED, descriptor, 0);
  }
  if (mapped == MAP_FAILED || ftruncate(descriptor, 0) != 0)
    return fail(sink, FLEETYARD_STATUS_INTERNAL_ERROR, strerror(errno));
  body->cells = mapped;
  submit(sink, plan);
  return FLEETYARD_STATUS_SOLVED;
}

/* ---- Jumps ------------------------------------------------------------------ */

static sigjmp_buf out_of_callback;
static jmp_buf out_of_prepare; /* useless once `prepare` has returned */
static volatile sig_atomic_t in_callback;

static void jump_out(int number) {
  (void)number;
  if (in_callback) {
    in_callback = 0;
    siglongjmp(out_of_callback, 1);
  }
}

typedef struct {
  pthread_t planner;
  atomic_bool stop;
} Pest;

static void *pester(void *context) {
  Pest *pest = context;
  while (!pest->stop) {
    usleep(500);
    pthread_kill(pest->planner, SIGUSR1);
  }
  return NULL;
}

/* Leaves a function of the host by a signal handler that does not return to it:
 * whatever that function held, it holds for ever. */
static void longjmp_over_host(const FleetyardSink *sink) {
  static char text[1 << 16];
  static Pest pest;
  pthread_t thread;
  struct sigaction action = {.sa_handler = jump_out};
  sigemptyset(&action.sa_mask);
  sigaction(SIGUSR1, &action, NULL);
  memset(text, 'x', sizeof text - 1);
  pest.planner = pthread_self();
  pest.stop = false;
  bool started = pthread_create(&thread, NULL, pester, &pest) == 0;
  volatile bool jumped = false;
  if (sigsetjmp(out_of_callback, 1) == 0)
    for (int turn = 0; started && turn < 2000; turn++) {
      in_callback = 1;
      say(sink, text);
      in_callback = 0;
    }
  else
    jumped = true;
  pest.stop = true;
  if (started)
    pthread_join(thread, NULL);
  signal(SIGUSR1, SIG_IGN);
  metric(sink, "jumped", jumped); /* may wait for ever */
}

/* ---- After the answer ------------------------------------------------------- */

static void *crash_later(void *unused) {
  (void)unused;
  sleep_s(0.1);
  crash(NULL, NULL);
  return NULL;
}

/* Hands the steps over, as the fault wants it. */
static int32_t hand_over(const Steps *steps, const char *fault, uint64_t size,
                         const FleetyardSink *sink) {
  uint32_t agents = steps->agents, length = steps->steps;
  uint64_t *offsets = calloc((size_t)agents + 2, sizeof *offsets);
  uint32_t *cells = calloc(((size_t)agents + 1) * length, sizeof *cells);
  if (!offsets || !cells) {
    free(offsets);
    free(cells);
    return fail(sink, FLEETYARD_STATUS_INTERNAL_ERROR, "out of memory");
  }
  for (uint32_t agent = 0; agent <= agents; agent++) {
    /* The path after the last is for `too-many-agents`: a copy of the first. */
    for (uint32_t time = 0; time < length; time++)
      cells[(size_t)agent * length + time] = steps->at[(size_t)time * agents + agent % agents];
    offsets[agent + 1] = (uint64_t)(agent + 1) * length;
  }
  FleetyardCells body = {sizeof body, 0, cells};
  FleetyardPlan plan = {.struct_size = sizeof plan,
                        .agents = agents,
                        .form = FLEETYARD_FORM_CELLS,
                        .offsets = offsets,
                        .body = &body};
  if (strcmp(fault, "empty-path") == 0) {
    for (uint32_t agent = 0; agent <= agents; agent++)
      offsets[agent + 1] -= length;
    body.cells += length;
  }
  if (strcmp(fault, "too-few-agents") == 0)
    plan.agents = agents - 1;
  if (strcmp(fault, "too-many-agents") == 0)
    plan.agents = agents + 1;
  if (strcmp(fault, "bad-plan-size") == 0)
    plan.struct_size = 8;
  if (strcmp(fault, "null-offsets") == 0)
    plan.offsets = NULL;
  if (strcmp(fault, "null-cells") == 0)
    body.cells = NULL;
  if (strcmp(fault, "unordered-offsets") == 0)
    offsets[1] = offsets[agents] + 7;
  if (strcmp(fault, "huge-plan") == 0)
    offsets[agents] = size << 20; /* and far fewer cells behind the pointer */
  if (strcmp(fault, "changes-plan-during") == 0)
    submit_while_changing(sink, &plan, offsets, cells);
  if (strcmp(fault, "shrinks-plan") == 0)
    return submit_shrunk(sink, &plan, &body, (size_t)agents * length * sizeof *cells);
  submit(sink, strcmp(fault, "null-plan") == 0 ? NULL : &plan);
  if (strcmp(fault, "twice") == 0)
    submit(sink, &plan);
  if (strcmp(fault, "changes-plan-after") == 0) {
    memset(offsets, 0xFF, ((size_t)agents + 2) * sizeof *offsets);
    memset(cells, 0xFF, ((size_t)agents + 1) * length * sizeof *cells);
  }
  if (strcmp(fault, "exit-after-plan") == 0)
    exit(0);
  free(offsets);
  free(cells);
  return strcmp(fault, "bad-status") == 0 ? 99 : FLEETYARD_STATUS_SOLVED;
}

/* ---- The planner ----------------------------------------------------------- */

static int32_t prepare(void *context, const FleetyardEnvironment *environment,
                       const FleetyardBudget *budget, const FleetyardSink *sink) {
  Faulty *faulty = context;
  (void)budget;
  misbehave(faulty, "prepare", sink);
  if (environment->representation != FLEETYARD_REPRESENTATION_GRID)
    return fail(sink, FLEETYARD_STATUS_UNSUPPORTED, "neither roadmap nor continuous: grids only");
  if (is_critical(&environment->parts, sink)) return FLEETYARD_STATUS_UNSUPPORTED;
  const FleetyardGrid *grid = environment->view;
  if (strcmp(faulty->fault, "longjmp-stale") == 0 && setjmp(out_of_prepare) != 0)
    return FLEETYARD_STATUS_SOLVED;
  if (grid->connectivity != 4)
    return fail(sink, FLEETYARD_STATUS_UNSUPPORTED, "4 neighbours only");
  faulty->passable = grid->passable; /* stays until the next `prepare` */
  faulty->rows = grid->rows;
  faulty->cols = grid->cols;
  return FLEETYARD_STATUS_SOLVED;
}

static int32_t plan(void *context, const FleetyardInstance *instance,
                    const FleetyardBudget *budget, const FleetyardSink *sink) {
  const Faulty *faulty = context;
  const char *fault = strcmp(faulty->during, "plan") == 0 ? faulty->fault : "none";
  misbehave(faulty, "plan", sink);
  if (is_critical(&instance->parts, sink)) return FLEETYARD_STATUS_UNSUPPORTED;
  if (strcmp(fault, "claims-solved-without-plan") == 0)
    return FLEETYARD_STATUS_SOLVED;
  if (strcmp(fault, "claims-infeasible") == 0)
    return fail(sink, FLEETYARD_STATUS_INFEASIBLE, "it cannot be done, believe me");
  if (strcmp(fault, "fails") == 0)
    return fail(sink, FLEETYARD_STATUS_INTERNAL_ERROR, "failed as asked");
  if (strcmp(fault, "bad-request") == 0) { /* `plan` asks for a plan */
    const FleetyardRequest request = {.struct_size = sizeof request,
                                      .agents = instance->agents,
                                      .goal_offsets = instance->goal_offsets,
                                      .goals = instance->goals};
    sink->submit_request(sink->context, &request);
  }
  if (strcmp(fault, "keeps-too-much") == 0) {
    const char *id = FLEETYARD_KEEP_ID;
    const FleetyardKeep *host =
        sink->get_extension(sink->context, (FleetyardStr){id, strlen(id)});
    const FleetyardBytes bytes = {sizeof bytes, 0, calloc(FLEETYARD_KEPT_LIMIT + 1, 1),
                                  FLEETYARD_KEPT_LIMIT + 1};
    if (!host || !bytes.ptr)
      return fail(sink, FLEETYARD_STATUS_INTERNAL_ERROR, "nothing to keep, or nobody who does");
    host->keep(sink->context, &bytes);
    free((void *)bytes.ptr);
  }
  if (strcmp(fault, "longjmp-stale") == 0)
    longjmp(out_of_prepare, 1);
  if (strcmp(fault, "longjmp-callback") == 0)
    longjmp_over_host(sink);
  if (strcmp(fault, "crash-after") == 0) {
    pthread_t thread;
    if (pthread_create(&thread, NULL, crash_later, NULL) != 0)
      say(sink, "could not start a thread");
  }

  Steps steps = {faulty, instance->agents, 1, malloc(instance->agents * sizeof(uint32_t)), false};
  if (!steps.at)
    return fail(sink, FLEETYARD_STATUS_INTERNAL_ERROR, "out of memory");
  memcpy(steps.at, instance->starts, instance->agents * sizeof *steps.at);
  int32_t status;
  if (!honest(&steps, instance)) {
    status = fail(sink, FLEETYARD_STATUS_GAVE_UP, "too crowded for the honest part of the plan");
  } else {
    const char *reason = spoil(&steps, fault);
    if (strcmp(fault, "late") == 0) {
      double left =
          (double)budget->deadline_monotonic_ns * 1e-9 - (double)sink->now_ns(sink->context) * 1e-9;
      sleep_s(left > 0 ? left + 0.5 : 0.5);
    }
    status = reason ? fail(sink, FLEETYARD_STATUS_UNSUPPORTED, reason)
                    : hand_over(&steps, fault, or_else(faulty->size, GIB), sink);
  }
  free(steps.at);
  return status;
}

static void destroy(void *context) {
  Faulty *faulty = context;
  misbehave(faulty, "destroy", &standard_error);
  if (strcmp(faulty->fault, "crash-after") == 0)
    sleep_s(1); /* so that the thread has its time */
  free(faulty);
}

/* ---- What the library exports ---------------------------------------------- */

static const FleetyardDescriptor descriptor_of_faulty = {
#if VARIANT == SHORT_DESCRIPTOR
    .struct_size = 8,
#else
    .struct_size = sizeof(FleetyardDescriptor),
#endif
#if VARIANT == BAD_ID
    .id = TEXT("Not an identifier"),
#else
    .id = TEXT("faulty"),
#endif
    .name = TEXT("Faulty"),
    .version = TEXT("0.1.0"),
    .description = TEXT("Misbehaves on request. For tests of the host."),
    .license = TEXT("MIT OR Apache-2.0"),
#if VARIANT == BAD_SCHEMA
    .options_schema = TEXT("{\"type\": object"),
#else
    .options_schema = TEXT(
        "{\"type\":\"object\",\"additionalProperties\":false,\"properties\":{"
        "\"fault\":{\"enum\":[" FAULTS(ITEM) MISCHIEF(MISCHIEF_ITEM)
        "\"none\"],\"default\":\"none\"},"
        "\"during\":{\"enum\":[\"create\",\"prepare\",\"plan\",\"destroy\",\"deinit\"],"
        "\"default\":\"plan\",\"description\":\"The call that fails.\"},"
        "\"size\":{\"type\":\"integer\",\"minimum\":1,"
        "\"description\":\"Bytes to take or to write [default: depends on the fault]; "
        "a huge plan claims as many MiB of cells.\"},"
        "\"count\":{\"type\":\"integer\",\"minimum\":1,"
        "\"description\":\"Most processes, threads or files [default: depends on the fault].\"},"
        "\"target\":{\"type\":\"string\",\"maxLength\":255,"
        "\"description\":\"What an attempt is at: a path, HOST:PORT, the name of a variable, "
        "an address in memory.\"},"
        "\"pid\":{\"type\":\"integer\",\"minimum\":1,"
        "\"description\":\"The process that an attempt is at [default: the parent].\"}}}"),
#endif
#if VARIANT == LYING_CAPABILITIES
    .capabilities = FLEETYARD_CAPABILITY_GRID | FLEETYARD_CAPABILITY_PEBBLE |
                    FLEETYARD_CAPABILITY_EIGHT_CONNECTED | FLEETYARD_CAPABILITY_MOVE_MASK |
                    FLEETYARD_CAPABILITY_ROTATION | FLEETYARD_CAPABILITY_K_ROBUST |
                    FLEETYARD_CAPABILITY_DETERMINISTIC,
#else
    .capabilities =
        FLEETYARD_CAPABILITY_GRID | FLEETYARD_CAPABILITY_PEBBLE | FLEETYARD_CAPABILITY_DETERMINISTIC,
#endif
};

static uint32_t count(void *context) {
  (void)context;
#if VARIANT == MANY_PLUGINS
  return 4000000000u;
#else
  return 1;
#endif
}

static const FleetyardDescriptor *descriptor(void *context, uint32_t index) {
  (void)context;
  return index == 0 && VARIANT != NULL_DESCRIPTOR ? &descriptor_of_faulty : NULL;
}

/* The option with this name; one without a text or a number when it is not given. */
static FleetyardPluginOption option(const FleetyardOptions *options, const char *name) {
  const FleetyardPluginOption none = {.kind = FLEETYARD_OPTION_TEXT};
  for (uint32_t i = 0; i < options->count; i++) {
    FleetyardStr found = options->list[i].name;
    if (found.len == strlen(name) && memcmp(found.ptr, name, found.len) == 0)
      return options->list[i];
  }
  return none;
}

static void text_option(const FleetyardOptions *options, const char *name, char *out,
                        size_t room) {
  FleetyardStr text = option(options, name).text;
  if (text.len)
    snprintf(out, room, "%.*s", (int)text.len, text.ptr);
}

static uint64_t number_option(const FleetyardOptions *options, const char *name) {
  return (uint64_t)option(options, name).number;
}

static int32_t create(void *context, uint32_t index, const FleetyardOptions *options,
                      const FleetyardSink *sink, FleetyardPlanner *out) {
  (void)context;
  (void)index;
  if (out->struct_size < sizeof *out)
    return fail(sink, FLEETYARD_STATUS_UNSUPPORTED, "the host has no room for a planner");
  Faulty *faulty = calloc(1, sizeof *faulty);
  if (!faulty)
    return fail(sink, FLEETYARD_STATUS_INTERNAL_ERROR, "out of memory");
  strcpy(faulty->fault, "none");
  strcpy(faulty->during, "plan");
  text_option(options, "fault", faulty->fault, sizeof faulty->fault);
  text_option(options, "during", faulty->during, sizeof faulty->during);
  text_option(options, "target", faulty->target, sizeof faulty->target);
  faulty->size = number_option(options, "size");
  faulty->count = number_option(options, "count");
  faulty->pid = (int64_t)number_option(options, "pid");
  at_the_end = *faulty;
  misbehave(faulty, "create", sink);
  if (strcmp(faulty->during, "create") == 0 && strcmp(faulty->fault, "fails") == 0) {
    free(faulty);
    return fail(sink, FLEETYARD_STATUS_INTERNAL_ERROR, "failed as asked");
  }
  *out = (FleetyardPlanner){
      .struct_size = sizeof *out,
      .context = faulty,
      .prepare = prepare,
      .plan = plan,
      .destroy = destroy,
  };
#if VARIANT == SHORT_PLANNER
  out->struct_size = 8;
#elif VARIANT == NULL_PLAN
  out->plan = NULL;
#endif
  return FLEETYARD_STATUS_SOLVED;
}

static const FleetyardPlannerFactory planners = {
#if VARIANT == SHORT_FACTORY
    .struct_size = 8,
#else
    .struct_size = sizeof(FleetyardPlannerFactory),
#endif
    .count = count,
    .descriptor = descriptor,
    .create = create,
};

#if VARIANT != NULL_GET_FACTORY
static const void *get_factory(FleetyardStr id) {
  static const char wanted[] = "fleetyard.planner/1";
  return id.len == sizeof wanted - 1 && memcmp(id.ptr, wanted, id.len) == 0 ? &planners : NULL;
}
#endif

#if VARIANT == INIT_FAILS
static int32_t init(const FleetyardHost *host, FleetyardStr path) {
  (void)host;
  (void)path;
  return -1;
}
#endif

const FleetyardPluginEntry fleetyard_plugin_entry_v1 = {
#if VARIANT == SHORT_ENTRY
    .struct_size = 16,
#else
    .struct_size = sizeof(FleetyardPluginEntry),
#endif
#if VARIANT == WRONG_MAJOR
    .abi_major = 2,
#else
    .abi_major = FLEETYARD_ABI_MAJOR,
#endif
#if VARIANT == NEWER_MINOR
    .abi_minor = 9,
#else
    .abi_minor = FLEETYARD_ABI_MINOR,
#endif
#if VARIANT == INIT_FAILS
    .init = init,
#endif
    .deinit = deinit,
#if VARIANT != NULL_GET_FACTORY
    .get_factory = get_factory,
#endif
};

#if VARIANT == NULL_GET_FACTORY
/* Nothing refers to these here. */
const void *faulty_unused(void);
const void *faulty_unused(void) { return &planners; }
#endif
#endif /* NO_SYMBOL */
