/* Prioritized planning, as a Fleetyard plugin in one C file.
 *
 * What it is: agents are planned one after the other; each takes a shortest path
 * through space and time that avoids the paths of those before it (Erdmann and
 * Lozano-Perez, "On Multiple Moving Objects", Algorithmica 1987; the search in
 * space-time with a reservation table is that of Silver, "Cooperative
 * Pathfinding", AIIDE 2005). When an agent finds no path, planning begins again
 * in another order, until one works or the budget ends (the idea of restarts:
 * Bennewitz, Burgard and Thrun, ICRA 2001).
 *
 * What it is not: complete or optimal. There are instances that no order solves.
 * Nor is it the fastest: waiting makes many states of one cell, which planners over
 * safe intervals (Phillips and Likhachev, ICRA 2011) put into one.
 *
 * The rules of movement are those of classical MAPF: no two agents in a cell, no
 * two agents exchanging cells in a step, and an agent stays at its goal for good.
 *
 * Build: cc -std=c11 -O2 -fPIC -shared -fvisibility=hidden -I ABI/include
 *        -o prioritized.so prioritized.c
 */

#include "fleetyard_easy.h"

#define NONE FLEETYARD_NONE

/* ---- Options --------------------------------------------------------------- */

/* Shortest first costs a tenth less than longest first, and is the default: whoever has
 * a short way then need not wait until all the long ways across its goal are over. */
typedef enum { SHORTEST_FIRST, LONGEST_FIRST, RANDOM_FIRST } FirstOrder;

typedef struct {
  uint64_t restarts; /* at most so many; 0 for no limit */
  FirstOrder first_order;
} Options;

#define OPTIONS_SCHEMA                                                                 \
  "{\"type\":\"object\",\"additionalProperties\":false,\"properties\":{"               \
  "\"restarts\":{\"type\":\"integer\",\"minimum\":0,\"default\":0,"                    \
  "\"description\":\"Most orders to try after the first; 0 for as many as the budget " \
  "allows.\"},"                                                                        \
  "\"first_order\":{\"enum\":[\"shortest\",\"longest\",\"random\"],"                   \
  "\"default\":\"shortest\",\"description\":\"Who is planned first in the first order:" \
  " the agent with the shortest way, with the longest, or anyone.\"}}}"

/* ---- The planner object ---------------------------------------------------- */

typedef struct {
  Options options;
} Planner;

static void *make(const FleetyardOptions *options, const FleetyardSink *sink) {
  Planner *planner = fleetyard_array(1, sizeof *planner);
  (void)sink;
  planner->options.restarts = (uint64_t)fleetyard_number(options, "restarts", 0);
  planner->options.first_order =
      (FirstOrder)fleetyard_choice(options, "first_order", "shortest longest random");
  return planner;
}

/* ---- One call of plan: what it keeps --------------------------------------- */

/* A table from (time, cell) to a number, by open addressing. Clearing is free:
 * an entry counts only while its stamp is the table's. */
typedef struct {
  uint64_t key;
  uint32_t value;
  uint32_t stamp;
} Entry;

typedef struct {
  Entry *entries;
  size_t capacity; /* a power of two, or 0 */
  size_t used;
  uint32_t stamp;
} Table;

typedef struct {
  uint32_t cell;
  uint32_t time;
  uint32_t parent;
  uint32_t next; /* in the bucket */
} Node;

typedef struct {
  uint32_t begin, length; /* in `cells` */
} Path;

typedef struct {
  const Planner *planner;
  const FleetyardInstance *instance;
  const FleetyardGrid *grid;
  const FleetyardBudget *budget;
  const FleetyardSink *sink;
  uint32_t places; /* cells of the grid */
  uint64_t expansions, restarts, random;
  size_t bytes; /* held in the tables that grow */
  bool cancelled, out_of_memory, out_of_nodes;

  uint32_t **distance; /* per agent: steps to its goal, or null when not kept */
  uint32_t *shared_distance;
  uint32_t *queue; /* of the breadth-first search */
  bool keep_distances;

  uint32_t *order;
  Path *paths;
  uint32_t *cells; /* the paths of this order, one after the other */
  size_t cells_used, cells_capacity;

  Table occupant;     /* (time, cell) -> agent */
  uint32_t *parked;   /* per cell: from when on an agent stays there, or NONE */
  uint32_t *last_use; /* per cell: 1 + the last time at which an agent is there */
  uint32_t horizon;   /* from then on nobody moves */

  Node *nodes;
  size_t nodes_used, nodes_capacity;
  uint32_t *buckets; /* stacks of open nodes, by detour: f minus the first f */
  size_t buckets_capacity;
  Table seen;
  uint32_t *settled; /* per cell: the search that expanded it after the horizon */
  uint32_t search;
} Work;

/* Makes room for `wanted` elements. Refuses more than the budget allows. */
static bool grow(Work *work, void **array, size_t *capacity, size_t wanted, size_t size) {
  if (wanted <= *capacity)
    return true;
  size_t larger = *capacity ? *capacity * 2 : 1024;
  if (larger < wanted)
    larger = wanted;
  size_t added = (larger - *capacity) * size;
  uint64_t limit = work->budget->memory_bytes;
  void *moved = NULL;
  if (limit == 0 || work->bytes + added <= limit)
    moved = realloc(*array, larger * size);
  if (!moved) {
    work->out_of_memory = true;
    return false;
  }
  *array = moved;
  *capacity = larger;
  work->bytes += added;
  return true;
}

static uint64_t space_time(uint32_t time, uint32_t cell) {
  return (uint64_t)time << 32 | cell;
}

/* The entry of a key, or the free one where it would be. The table has room. */
static Entry *table_slot(const Table *table, uint64_t key) {
  size_t mask = table->capacity - 1;
  size_t at = (size_t)((key * UINT64_C(0x9E3779B97F4A7C15)) >> 24) & mask;
  while (table->entries[at].stamp == table->stamp && table->entries[at].key != key)
    at = (at + 1) & mask;
  return &table->entries[at];
}

static uint32_t table_get(const Table *table, uint64_t key) {
  if (table->used == 0)
    return NONE;
  const Entry *entry = table_slot(table, key);
  return entry->stamp == table->stamp ? entry->value : NONE;
}

static void table_clear(Table *table) {
  table->used = 0;
  table->stamp++;
  if (table->stamp == 0) { /* after 2^32 clearings old stamps could count again */
    if (table->capacity)
      memset(table->entries, 0, table->capacity * sizeof *table->entries);
    table->stamp = 1;
  }
}

/* Adds a key. Returns false when it was there already or memory ran out. */
static bool table_add(Work *work, Table *table, uint64_t key, uint32_t value) {
  if (2 * (table->used + 1) > table->capacity) {
    Table larger = {NULL, 0, 0, 1};
    size_t capacity = table->capacity ? 2 * table->capacity : 4096;
    size_t bytes = capacity * sizeof *larger.entries;
    uint64_t limit = work->budget->memory_bytes;
    if (limit == 0 || work->bytes + bytes <= limit)
      larger.entries = calloc(capacity, sizeof *larger.entries);
    if (!larger.entries) {
      work->out_of_memory = true;
      return false;
    }
    larger.capacity = capacity;
    for (size_t i = 0; i < table->capacity; i++)
      if (table->entries[i].stamp == table->stamp) {
        Entry *entry = table_slot(&larger, table->entries[i].key);
        *entry = table->entries[i];
        entry->stamp = 1;
      }
    larger.used = table->used;
    work->bytes += bytes - table->capacity * sizeof *table->entries;
    free(table->entries);
    *table = larger;
  }
  Entry *entry = table_slot(table, key);
  if (entry->stamp == table->stamp)
    return false;
  *entry = (Entry){key, value, table->stamp};
  table->used++;
  return true;
}

/* splitmix64: small, and equal on every machine. */
static uint64_t random_number(Work *work) {
  uint64_t x = work->random += UINT64_C(0x9E3779B97F4A7C15);
  x = (x ^ (x >> 30)) * UINT64_C(0xBF58476D1CE4E5B9);
  x = (x ^ (x >> 27)) * UINT64_C(0x94D049BB133111EB);
  return x ^ (x >> 31);
}

static void shuffle(Work *work) {
  for (uint32_t i = work->instance->agents; i > 1; i--) {
    uint32_t j = (uint32_t)(random_number(work) % i);
    uint32_t swap = work->order[i - 1];
    work->order[i - 1] = work->order[j];
    work->order[j] = swap;
  }
}

/* ---- Searching ------------------------------------------------------------- */

/* Steps from every cell to the agent's goal when nobody is in the way. */
static const uint32_t *distances(Work *work, uint32_t agent) {
  uint32_t *distance = work->distance[agent];
  if (distance)
    return distance;
  if (work->keep_distances)
    distance = work->distance[agent] = malloc(work->places * sizeof *distance);
  if (!distance) {
    work->keep_distances = false;
    distance = work->shared_distance;
  }
  uint32_t goal = work->instance->goals[work->instance->goal_offsets[agent]];
  fleetyard_distances(work->grid, goal, distance, work->queue);
  return distance;
}

/* True if an agent may go from one cell to another (or wait) between `time` and
 * the step after it. */
static bool free_to_move(const Work *work, uint32_t from, uint32_t to, uint32_t time) {
  if (work->parked[to] <= time + 1)
    return false;
  if (time >= work->horizon)
    return true;
  if (table_get(&work->occupant, space_time(time + 1, to)) != NONE)
    return false;
  if (from == to)
    return true;
  uint32_t other = table_get(&work->occupant, space_time(time, to));
  return other == NONE || table_get(&work->occupant, space_time(time + 1, from)) != other;
}

static bool push(Work *work, uint32_t cell, uint32_t time, uint32_t parent, uint32_t detour) {
  if (detour >= work->buckets_capacity) {
    size_t before = work->buckets_capacity;
    if (!grow(work, (void **)&work->buckets, &work->buckets_capacity, (size_t)detour + 1,
              sizeof *work->buckets))
      return false;
    memset(work->buckets + before, 0xFF,
           (work->buckets_capacity - before) * sizeof *work->buckets);
  }
  if (work->nodes_used >= NONE - 1) {
    work->out_of_memory = true;
    return false;
  }
  if (!grow(work, (void **)&work->nodes, &work->nodes_capacity, work->nodes_used + 1,
            sizeof *work->nodes))
    return false;
  work->nodes[work->nodes_used] = (Node){cell, time, parent, work->buckets[detour]};
  work->buckets[detour] = (uint32_t)work->nodes_used++;
  return true;
}

/* True if the call has to end. The host is asked now and then only. */
static bool stopped(Work *work) {
  uint64_t limit = work->budget->nodes;
  if (limit && work->expansions >= limit)
    work->out_of_nodes = true;
  if (work->expansions % 256 == 0 && fleetyard_cancelled(work->sink))
    work->cancelled = true;
  return work->out_of_nodes || work->cancelled || work->out_of_memory;
}

/* Space-time A*. All steps cost one, so f = time + distance grows by 0, 1 or 2
 * per step, and stacks by f are a priority queue that goes deep first among
 * equals. From the horizon on nobody else moves: then the time does not matter,
 * each cell is expanded once, and the search ends. Returns the last node. */
static uint32_t find_path(Work *work, uint32_t agent) {
  uint32_t start = work->instance->starts[agent];
  uint32_t goal = work->instance->goals[work->instance->goal_offsets[agent]];
  const uint32_t *distance = distances(work, agent);
  uint32_t shortest = distance[start];
  if (work->buckets_capacity)
    memset(work->buckets, 0xFF, work->buckets_capacity * sizeof *work->buckets);
  work->nodes_used = 0;
  work->search++;
  table_clear(&work->seen);
  if (!push(work, start, 0, NONE, 0))
    return NONE;
  for (uint32_t detour = 0; detour < work->buckets_capacity; detour++) {
    while (work->buckets[detour] != NONE) {
      uint32_t index = work->buckets[detour];
      Node node = work->nodes[index];
      work->buckets[detour] = node.next;
      if (node.time >= work->horizon) {
        if (work->settled[node.cell] == work->search)
          continue;
        work->settled[node.cell] = work->search;
      }
      if (node.cell == goal && node.time >= work->last_use[goal])
        return index;
      work->expansions++;
      if (stopped(work))
        return NONE;
      /* The step pushed last is tried first: waiting comes last. */
      for (int i = 4; i >= 0; i--) {
        uint32_t next = i == 4 ? node.cell : fleetyard_move(work->grid, node.cell, i);
        if (next == NONE || !free_to_move(work, node.cell, next, node.time))
          continue;
        uint32_t time = node.time + 1;
        if (time >= work->horizon ? work->settled[next] == work->search
                                  : !table_add(work, &work->seen, space_time(time, next), 0))
          continue;
        if (!push(work, next, time, index, time + distance[next] - shortest))
          return NONE;
      }
    }
  }
  return NONE;
}

/* Writes a path down and reserves it. */
static bool reserve(Work *work, uint32_t agent, uint32_t last) {
  uint32_t length = work->nodes[last].time + 1;
  if (!grow(work, (void **)&work->cells, &work->cells_capacity, work->cells_used + length,
            sizeof *work->cells))
    return false;
  uint32_t *path = work->cells + work->cells_used;
  for (uint32_t at = last; at != NONE; at = work->nodes[at].parent) {
    uint32_t cell = work->nodes[at].cell, time = work->nodes[at].time;
    path[time] = cell;
    if (!table_add(work, &work->occupant, space_time(time, cell), agent))
      return false;
    if (work->last_use[cell] < time + 1)
      work->last_use[cell] = time + 1;
  }
  work->parked[path[length - 1]] = length - 1;
  if (work->horizon < length)
    work->horizon = length;
  work->paths[agent] = (Path){(uint32_t)work->cells_used, length};
  work->cells_used += length;
  return true;
}

/* Plans the agents in the present order. Returns how many have a path. */
static uint32_t plan_in_order(Work *work) {
  size_t map = work->places * sizeof(uint32_t);
  work->cells_used = 0;
  work->horizon = 0;
  table_clear(&work->occupant);
  memset(work->parked, 0xFF, map);
  memset(work->last_use, 0, map);
  for (uint32_t i = 0; i < work->instance->agents; i++) {
    uint32_t agent = work->order[i];
    uint32_t last = find_path(work, agent);
    if (last == NONE || !reserve(work, agent, last))
      return i;
  }
  return work->instance->agents;
}

/* The order after a failure. The agent that found no path goes first, since that
 * mends most orders at once; now and then everything is shuffled, since it does
 * not mend all. */
static void next_order(Work *work, uint32_t failed) {
  uint32_t agents = work->instance->agents;
  work->restarts++;
  if (random_number(work) % 16 == 0) {
    shuffle(work);
    return;
  }
  uint32_t agent = work->order[failed];
  memmove(work->order + 1, work->order, failed * sizeof *work->order);
  work->order[0] = agent;
  /* A little noise keeps two agents from sending each other forward for ever. */
  uint32_t i = (uint32_t)(random_number(work) % agents);
  uint32_t j = (uint32_t)(random_number(work) % agents);
  agent = work->order[i];
  work->order[i] = work->order[j];
  work->order[j] = agent;
}

typedef struct {
  uint32_t length, agent;
} Way;

static int compare_ways(const void *left, const void *right) {
  const Way *a = left, *b = right;
  if (a->length != b->length)
    return a->length < b->length ? -1 : 1;
  return a->agent < b->agent ? -1 : a->agent > b->agent;
}

/* ---- Checking the question, handing over the answer ------------------------ */

static int32_t check_instance(const Work *work) {
  const FleetyardInstance *instance = work->instance;
  const FleetyardSink *sink = work->sink;
  const uint8_t *passable = work->grid->passable;
  int32_t result = FLEETYARD_STATUS_SOLVED;
  uint32_t *start_of = work->queue, *goal_of = work->shared_distance; /* not in use yet */
  memset(start_of, 0xFF, work->places * sizeof *start_of);
  memset(goal_of, 0xFF, work->places * sizeof *goal_of);
  for (uint32_t agent = 0; agent < instance->agents; agent++) {
    uint32_t start = instance->starts[agent];
    uint32_t goal = instance->goals[instance->goal_offsets[agent]];
    if (!passable[start] || !passable[goal])
      return fleetyard_fail(sink, FLEETYARD_STATUS_INVALID_INPUT,
                            "agent %" PRIu32 " starts or ends in a cell where nobody can stand",
                            agent);
    if (start_of[start] != NONE)
      return fleetyard_fail(sink, FLEETYARD_STATUS_INVALID_INPUT,
                            "agents %" PRIu32 " and %" PRIu32 " start in the same cell",
                            start_of[start], agent);
    if (goal_of[goal] != NONE)
      result = fleetyard_fail(sink, FLEETYARD_STATUS_UNSUPPORTED,
                              "agents %" PRIu32 " and %" PRIu32 " have the same goal",
                              goal_of[goal], agent);
    start_of[start] = goal_of[goal] = agent;
  }
  return result;
}

static int32_t submit(Work *work) {
  FleetyardPaths paths = fleetyard_paths(FLEETYARD_FORM_CELLS, work->instance->agents);
  for (uint32_t agent = 0; agent < paths.agents; agent++)
    fleetyard_add_cells(&paths, agent, work->cells + work->paths[agent].begin,
                        work->paths[agent].length);
  int32_t status = fleetyard_submit(&paths, work->sink);
  fleetyard_free_paths(&paths);
  return status;
}

/* The reason why the search was stopped, as a status. */
static int32_t explain(const Work *work) {
  uint64_t restarts = work->restarts;
  if (work->out_of_memory)
    return fleetyard_fail(work->sink, FLEETYARD_STATUS_GAVE_UP,
                          "the memory ran out after %" PRIu64 " restarts", restarts);
  if (work->out_of_nodes)
    return fleetyard_fail(work->sink, FLEETYARD_STATUS_GAVE_UP,
                          "the node limit was reached after %" PRIu64 " restarts", restarts);
  if (work->sink->now_ns(work->sink->context) < work->budget->answer_by_ns)
    return fleetyard_fail(work->sink, FLEETYARD_STATUS_CANCELLED,
                          "cancelled after %" PRIu64 " restarts", restarts);
  return fleetyard_fail(work->sink, FLEETYARD_STATUS_TIMED_OUT,
                        "no order of %" PRIu64 " worked before the deadline", restarts + 1);
}

static int32_t solve(Work *work) {
  uint32_t agents = work->instance->agents;
  const Options *options = &work->planner->options;
  int32_t status = check_instance(work);
  if (status != FLEETYARD_STATUS_SOLVED)
    return status;

  Way *ways = malloc(agents * sizeof *ways);
  if (!ways)
    return fleetyard_fail(work->sink, FLEETYARD_STATUS_INTERNAL_ERROR, "out of memory");
  for (uint32_t agent = 0; agent < agents && status == FLEETYARD_STATUS_SOLVED; agent++) {
    uint32_t length = distances(work, agent)[work->instance->starts[agent]];
    ways[agent] = (Way){length, agent};
    if (length == NONE)
      status = fleetyard_fail(work->sink, FLEETYARD_STATUS_INFEASIBLE,
                              "no path leads agent %" PRIu32 " to its goal", agent);
    else if (agent % 16 == 0 && fleetyard_cancelled(work->sink))
      status = explain(work);
  }
  if (status == FLEETYARD_STATUS_SOLVED) {
    qsort(ways, agents, sizeof *ways, compare_ways);
    for (uint32_t i = 0; i < agents; i++)
      work->order[i] = ways[options->first_order == LONGEST_FIRST ? agents - 1 - i : i].agent;
    if (options->first_order == RANDOM_FIRST)
      shuffle(work);
  }
  free(ways);
  if (status != FLEETYARD_STATUS_SOLVED)
    return status;

  uint32_t best = 0;
  for (;;) {
    uint32_t planned = plan_in_order(work);
    if (planned > best) {
      best = planned;
      work->sink->progress(work->sink->context, best, agents);
    }
    if (planned == agents)
      return submit(work);
    if (work->cancelled || work->out_of_nodes || work->out_of_memory)
      return explain(work);
    if (options->restarts && work->restarts >= options->restarts)
      return fleetyard_fail(work->sink, FLEETYARD_STATUS_GAVE_UP,
                            "no order of %" PRIu64 " worked; at best %" PRIu32 " of %" PRIu32
                            " agents had a path",
                            work->restarts + 1, best, agents);
    next_order(work, planned);
  }
}

static int32_t plan(void *context, const FleetyardInstance *instance,
                    const FleetyardBudget *budget, const FleetyardSink *sink) {
  const Planner *planner = context;
  int32_t status;
  const FleetyardGrid *grid = fleetyard_grid(instance->environment, sink);
  size_t agents = instance->agents, cells = (size_t)grid->rows * grid->cols;
  if (agents > cells)
    return fleetyard_fail(sink, FLEETYARD_STATUS_INVALID_INPUT, "%zu agents on %zu cells", agents,
                          cells);
  Work work = {.planner = planner,
               .instance = instance,
               .grid = grid,
               .budget = budget,
               .sink = sink,
               .places = (uint32_t)cells};
  work.random = budget->seed;
  work.occupant.stamp = work.seen.stamp = 1;
  /* Distances are computed once per agent while they fit into half the memory. */
  uint64_t room = budget->memory_bytes ? budget->memory_bytes / 2 : UINT64_C(1) << 30;
  work.keep_distances = (uint64_t)agents * cells * sizeof(uint32_t) <= room;
  work.distance = calloc(agents, sizeof *work.distance);
  work.shared_distance = malloc(cells * sizeof *work.shared_distance);
  work.queue = malloc(cells * sizeof *work.queue);
  work.order = malloc(agents * sizeof *work.order);
  work.paths = malloc(agents * sizeof *work.paths);
  work.parked = malloc(cells * sizeof *work.parked);
  work.last_use = malloc(cells * sizeof *work.last_use);
  work.settled = calloc(cells, sizeof *work.settled);
  if (work.distance && work.shared_distance && work.queue && work.order && work.paths &&
      work.parked && work.last_use && work.settled)
    status = solve(&work);
  else
    status = fleetyard_fail(sink, FLEETYARD_STATUS_INTERNAL_ERROR, "out of memory");

  fleetyard_metric(sink, "expansions", (double)work.expansions);
  fleetyard_metric(sink, "restarts", (double)work.restarts);
  for (size_t agent = 0; work.distance && agent < agents; agent++)
    free(work.distance[agent]);
  free(work.distance);
  free(work.shared_distance);
  free(work.queue);
  free(work.order);
  free(work.paths);
  free(work.cells);
  free(work.occupant.entries);
  free(work.parked);
  free(work.last_use);
  free(work.nodes);
  free(work.buckets);
  free(work.seen.entries);
  free(work.settled);
  return status;
}

/* ---- What the library exports ---------------------------------------------- */

static const FleetyardDescriptor prioritized = {
    .struct_size = sizeof(FleetyardDescriptor),
    .id = FLEETYARD_TEXT("prioritized"),
    .name = FLEETYARD_TEXT("Prioritized planning (C example)"),
    .version = FLEETYARD_TEXT("0.1.0"),
    .description = FLEETYARD_TEXT(
        "Plans agents one after the other by A* in space and time around the "
        "paths of those before (Erdmann and Lozano-Perez 1987; Silver 2005), "
        "in other orders when an agent finds no path."),
    .license = FLEETYARD_TEXT("MIT OR Apache-2.0"),
    .options_schema = FLEETYARD_TEXT(OPTIONS_SCHEMA),
    .capabilities =
        FLEETYARD_CAPABILITY_GRID | FLEETYARD_CAPABILITY_PEBBLE |
        FLEETYARD_CAPABILITY_MOVE_MASK | FLEETYARD_CAPABILITY_DETERMINISTIC,
};

FLEETYARD_EXPORT_PLANNER(prioritized, make, fleetyard_learn_nothing, plan, free);
