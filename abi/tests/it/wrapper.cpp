/* Plays the host to plugins on fleetyard.hpp: options, exceptions, the order of calls, views and
 * plans of three kinds, and what is refused. Exits with 1 at the first surprise. */

#include "fleetyard.hpp"

#include <cstdio>
#include <cstdlib>
#include <cstring>

namespace {

#define EXPECT(condition)                                                             \
  do {                                                                                \
    if (!(condition)) {                                                               \
      std::fprintf(stderr, "line %d: %s; said: %s\n", __LINE__, #condition, said.c_str()); \
      std::exit(1);                                                                   \
    }                                                                                 \
  } while (false)

std::string said; /* what the last failure explained */
std::string noted;
std::vector<std::vector<double>> submitted; /* per agent: its cells, visits or knots */
std::int32_t form, answer = FLEETYARD_OK, stop = 0;
fleetyard::Result result;

bool same(double a, double b) { return !(a < b) && !(b < a); }

/* Ends as its option says; otherwise plans for any representation, without a look at others. */
struct Odd : fleetyard::Planner {
  static constexpr auto id = "odd";
  static constexpr auto options_schema = "{}";
  static constexpr auto capabilities =
      fleetyard::capability::grid | fleetyard::capability::roadmap |
      fleetyard::capability::continuous | fleetyard::capability::pebble |
      fleetyard::capability::stop_go | fleetyard::capability::dynamics;
  static constexpr std::array<std::string_view, 2> features{"part:org.example.known/1",
                                                           "dynamics:org.example.slide/1"};
  std::string how;

  explicit Odd(const fleetyard::Options &options) : how(options.text("how")) {}
  void plan(const fleetyard::Instance &instance, const fleetyard::Budget &,
            const fleetyard::Sink &sink) override {
    if (how == "failure")
      throw fleetyard::Failure(fleetyard::Status::gave_up, "no luck");
    if (how == "exception")
      throw std::out_of_range("beyond the end");
    if (how == "memory")
      throw std::bad_alloc();
    if (how == "other")
      throw 7;
    sink.check();
    sink.note("weights", "0f3c");
    switch (instance.environment().representation()) {
    case fleetyard::Representation::grid:
      return on_grid(instance, sink);
    case fleetyard::Representation::roadmap:
      return on_roadmap(instance, sink);
    case fleetyard::Representation::continuous:
      return in_plane(instance, sink);
    }
  }

  static void on_grid(const fleetyard::Instance &instance, const fleetyard::Sink &sink) {
    const fleetyard::Grid grid = instance.grid();
    fleetyard::Plan plan;
    for (std::size_t agent = 0; agent < instance.agents(); agent++)
      plan.add(grid.path(instance.starts()[agent], grid.distances(instance.goal(agent))));
    result = sink.submit_plan(plan);
  }

  static void on_roadmap(const fleetyard::Instance &instance, const fleetyard::Sink &sink) {
    const fleetyard::Roadmap roadmap = instance.roadmap();
    fleetyard::RoadmapPlan plan;
    for (std::size_t agent = 0; agent < instance.agents(); agent++) {
      const auto times = roadmap.times(instance.goal(agent));
      std::vector<fleetyard::Visit> visits{{instance.starts()[agent], 0, 0}};
      while (visits.back().vertex != instance.goal(agent))
        for (std::size_t at = 0; at < roadmap.degree(visits.back().vertex); at++) {
          const fleetyard::Edge edge = roadmap.edge(visits.back().vertex, at);
          const double arrival = visits.back().departure_s + edge.duration_s;
          if (same(times[edge.to] + edge.duration_s, times[edge.from])) {
            visits.push_back({edge.to, arrival, arrival});
            break;
          }
        }
      plan.add(visits);
    }
    result = sink.submit_plan(plan);
  }

  static void in_plane(const fleetyard::Instance &instance, const fleetyard::Sink &sink) {
    fleetyard::ContinuousPlan plan;
    fleetyard::MotionPlan motions;
    for (std::size_t agent = 0; agent < instance.agents(); agent++) {
      const auto start = instance.start_state(agent), goal = instance.goal_state(agent, 0);
      fleetyard::Knot first{0, start[0], start[1]}, last{2, goal[0], goal[1]};
      if (instance.robot(agent).has_heading())
        first.heading_rad = last.heading_rad = start[2];
      const std::vector<fleetyard::Knot> knots{first, last};
      plan.add(knots);
      const fleetyard::Segment odd{1, {1}}, starts{0.5, {1, 2}}, rolls{1.5, {0, 0}};
      try {
        motions.add({starts, odd});
        EXPECT(false);
      } catch (const std::invalid_argument &) {
      }
      motions.add({starts, rolls}, knots);
    }
    const bool turns = instance.robot(0).has_heading();
    result = turns ? sink.submit_plan(plan) : sink.submit_plan(motions);
  }
};

struct Idle : fleetyard::InvocationPolicy {
  static constexpr std::string_view id = "idle";
  bool should_invoke(const fleetyard::FleetStatus &status, const fleetyard::Sink &) override {
    if (status.agents() == 0)
      throw fleetyard::Failure(fleetyard::Status::unsupported, "nobody is there");
    return status.actions_left()[0] == 0;
  }
};

/* Gives the first task to the first agent. */
struct First : fleetyard::InstanceGenerator {
  static constexpr auto id = "first";
  static constexpr auto capabilities = fleetyard::capability::grid | fleetyard::capability::pebble;
  void generate(const fleetyard::FleetState &state, const fleetyard::Budget &,
                const fleetyard::Sink &sink) override {
    fleetyard::Request request(state);
    request.assign(state.task(0), 0);
    result = sink.submit_request(request);
  }
};

/* Repeats what the planner left. */
struct Again : fleetyard::FailPolicy {
  static constexpr auto id = "again";
  static constexpr auto capabilities = fleetyard::capability::grid | fleetyard::capability::pebble;
  void recover(const fleetyard::Instance &, const std::optional<fleetyard::PlanView> &failed,
               const fleetyard::Budget &, const fleetyard::Sink &sink) override {
    fleetyard::Plan plan;
    for (std::size_t agent = 0; failed && agent < failed->agents(); agent++)
      plan.add(failed->path(agent));
    result = sink.submit_plan(plan);
  }
};

std::int32_t submit_plan(void *, const FleetyardPlan *plan) {
  submitted.clear();
  form = plan->form;
  for (std::uint32_t agent = 0; agent < plan->agents; agent++) {
    submitted.emplace_back();
    for (std::uint64_t at = plan->offsets[agent]; at < plan->offsets[agent + 1]; at++) {
      const auto add = [&](double number) { submitted.back().push_back(number); };
      if (form == FLEETYARD_FORM_CELLS) {
        add(static_cast<const FleetyardCells *>(plan->body)->cells[at]);
      } else if (form == FLEETYARD_FORM_VISITS) {
        const auto &body = *static_cast<const FleetyardVisits *>(plan->body);
        add(body.vertices[at]);
        add(body.arrival_s[at]);
        add(body.departure_s[at]);
      } else {
        const auto &body = *static_cast<const FleetyardTrajectories *>(plan->body);
        add(body.time_s[at]);
        add(body.x_m[at]);
        add(body.y_m[at]);
        if (body.heading_rad)
          add(body.heading_rad[at]);
      }
    }
    const auto *body = static_cast<const FleetyardTrajectories *>(plan->body);
    if (form != FLEETYARD_FORM_TRAJECTORIES || !body->segment_offsets)
      continue;
    std::vector<double> &numbers = submitted.back();
    numbers.insert(numbers.end(), body->duration_s + body->segment_offsets[agent],
                   body->duration_s + body->segment_offsets[agent + 1]);
    numbers.insert(numbers.end(), body->controls + body->control_offsets[agent],
                   body->controls + body->control_offsets[agent + 1]);
  }
  return answer;
}
std::int32_t submit_request(void *, const FleetyardRequest *request) {
  submitted.clear();
  for (std::uint32_t agent = 0; agent < request->agents; agent++)
    submitted.emplace_back(request->goals + request->goal_offsets[agent],
                           request->goals + request->goal_offsets[agent + 1]);
  said = std::to_string(request->assignment_count) + " of " +
         std::to_string(request->assignments[0].task) + " in " +
         std::to_string(request->window_steps);
  return answer;
}
std::int32_t cancelled(void *) { return stop; }
std::uint64_t now_ns(void *) { return 5; }
void fail(void *, FleetyardStr text) { said.assign(text.ptr, text.len); }
void log_line(void *, std::int32_t, FleetyardStr) {}
void metric(void *, FleetyardStr, double) {}
void note(void *, FleetyardStr name, FleetyardStr text) {
  noted = std::string(name.ptr, name.len) + "=" + std::string(text.ptr, text.len);
}
void progress(void *, std::uint64_t, std::uint64_t) {}
const void *no_extension(void *, FleetyardStr) { return nullptr; }

const FleetyardSink sink = {sizeof sink, 0,      nullptr, submit_plan, submit_request, cancelled,
                            now_ns,      fail,   log_line, metric,     note,           progress,
                            no_extension};

/* A table of one option, as the host has it. */
struct Given {
  FleetyardPluginOption option;
  FleetyardOptions raw;

  Given(std::string_view name, std::string_view text, double number, std::int32_t kind)
      : option{fleetyard::detail::str(name), fleetyard::detail::str(text), number, kind, 0},
        raw{sizeof raw, 1, &option, fleetyard::detail::str("{}")} {}
};

template <class Read> std::string failure_of(Read read) {
  try {
    read();
  } catch (const fleetyard::Failure &failure) {
    return failure.status() == fleetyard::Status::invalid_input ? failure.what() : "status";
  }
  return "";
}

void options_are_read() {
  const Given number("count", "", -40, FLEETYARD_OPTION_NUMBER),
      half("count", "", 1.5, FLEETYARD_OPTION_NUMBER), huge("count", "", 1e300,
                                                            FLEETYARD_OPTION_NUMBER),
      flag("count", "", 1, FLEETYARD_OPTION_FLAG), text("count", "\xc3\xa4", 0,
                                                        FLEETYARD_OPTION_TEXT),
      json("count", R"({"a": [1]})", 0, FLEETYARD_OPTION_JSON);
  const auto read = [](const Given &given) { return fleetyard::Options(&given.raw); };
  EXPECT(read(number).integer("count") == -40 && same(read(number).number("count"), -40));
  EXPECT(same(read(half).number("count"), 1.5) && read(flag).flag("count"));
  EXPECT(read(text).text("count") == "\xc3\xa4" && read(json).json("count") == R"({"a": [1]})");
  EXPECT(read(text).has("count") && !read(text).has("other") && read(text).json() == "{}");
  for (const Given *wrong : {&half, &huge, &flag, &text, &json}) {
    said = failure_of([&] { read(*wrong).integer("count"); });
    EXPECT(said.find("options: `count` is not ") == 0);
  }
  EXPECT((said = failure_of([&] { read(number).flag("count"); })) ==
         "options: `count` is not true or false");
  EXPECT((said = failure_of([&] { read(number).text("count"); })) ==
         "options: `count` is not a string");
  EXPECT((said = failure_of([&] { read(number).json("count"); })).find("not an object") !=
         std::string::npos);
  EXPECT((said = failure_of([&] { read(number).number("other"); })) ==
         "options: `other` is missing");
  Given is_short = number;
  is_short.raw.struct_size = 8;
  EXPECT((said = failure_of([&] { read(is_short); })).find("options.struct_size is 8") == 0);
}

} // namespace

FLEETYARD_PLUGINS(Odd, Idle, First, Again);

namespace {

template <class Factory> const Factory *factory_of(std::string_view id) {
  return static_cast<const Factory *>(
      fleetyard_plugin_entry_v1.get_factory(fleetyard::detail::str(id)));
}

/* A grid of two cells, where nobody goes from the first to the second. */
constexpr std::uint8_t passable[] = {1, 1}, terrain[] = {'.', '.'}, moves[] = {0, 8};

struct World {
  FleetyardGrid grid{sizeof grid, 1, 2, 4, 1.0, 1.0, 0.0, 0.0, passable, terrain, moves};
  FleetyardEnvironment environment{sizeof environment, FLEETYARD_REPRESENTATION_GRID, &grid, {}, {},
                                   {}};
  std::vector<std::uint32_t> starts{1}, goals{0};
  std::vector<std::uint64_t> offsets{0, 1};
  FleetyardInstance instance{};
  FleetyardBudget budget{};
  FleetyardPlanner planner{};

  World() {
    instance.struct_size = sizeof instance;
    instance.agents = 1;
    instance.environment = &environment;
    instance.motion = FLEETYARD_MOTION_PEBBLE;
    instance.objective = FLEETYARD_OBJECTIVE_SUM_OF_COSTS;
    instance.starts = starts.data();
    instance.goals = goals.data();
    instance.goal_offsets = offsets.data();
    budget.struct_size = sizeof budget;
    budget.answer_by_ns = 6;
  }
  World(const World &) = delete;
  World &operator=(const World &) = delete;
  ~World() {
    if (planner.destroy)
      planner.destroy(planner.context);
  }

  std::int32_t make(std::string_view how) {
    said.clear();
    if (planner.destroy)
      planner.destroy(planner.context);
    planner = {};
    planner.struct_size = sizeof planner;
    const Given given("how", how, 0, FLEETYARD_OPTION_TEXT);
    return factory_of<FleetyardPlannerFactory>(FLEETYARD_PLANNER_FACTORY_ID)
        ->create(nullptr, 0, &given.raw, &sink, &planner);
  }
  std::int32_t prepare() {
    said.clear();
    return planner.prepare(planner.context, &environment, &budget, &sink);
  }
  std::int32_t plan() {
    said.clear();
    submitted.clear();
    return planner.plan(planner.context, &instance, &budget, &sink);
  }
  std::int32_t both() {
    const std::int32_t prepared = prepare();
    return prepared == FLEETYARD_STATUS_SOLVED ? plan() : prepared;
  }
};

void calls_end_as_they_should() {
  const auto *planners = factory_of<FleetyardPlannerFactory>(FLEETYARD_PLANNER_FACTORY_ID);
  EXPECT(planners && planners->count(nullptr) == 1 && !planners->descriptor(nullptr, 1));
  const FleetyardDescriptor *about = planners->descriptor(nullptr, 0);
  EXPECT(fleetyard::detail::view(about->name) == "odd" && about->feature_count == 2);
  EXPECT(about->capabilities == Odd::capabilities);
  EXPECT(fleetyard::detail::view(about->features[0]) == Odd::features[0]);

  World world;
  const Given number("how", "", 3, FLEETYARD_OPTION_NUMBER);
  world.planner.struct_size = sizeof world.planner;
  EXPECT(planners->create(nullptr, 0, &number.raw, &sink, &world.planner) ==
         FLEETYARD_STATUS_INVALID_INPUT);
  EXPECT(said == "options: `how` is not a string");
  EXPECT(planners->create(nullptr, 1, &number.raw, &sink, &world.planner) ==
         FLEETYARD_STATUS_INVALID_INPUT);
  EXPECT(planners->create(nullptr, 0, &number.raw, nullptr, &world.planner) ==
         FLEETYARD_STATUS_INVALID_INPUT);

  const struct {
    const char *how;
    std::int32_t status;
    const char *message;
  } endings[] = {
      {"returns", FLEETYARD_STATUS_SOLVED, ""},
      {"failure", FLEETYARD_STATUS_GAVE_UP, "no luck"},
      {"exception", FLEETYARD_STATUS_INTERNAL_ERROR, "beyond the end"},
      {"memory", FLEETYARD_STATUS_INTERNAL_ERROR, "out of memory"},
      {"other", FLEETYARD_STATUS_INTERNAL_ERROR, "an exception that is no std::exception"},
  };
  for (const auto &ending : endings) {
    EXPECT(world.make(ending.how) == FLEETYARD_STATUS_SOLVED);
    EXPECT(world.plan() == FLEETYARD_STATUS_INVALID_INPUT);
    EXPECT(said == "the call came before a successful `prepare`");
    EXPECT(world.prepare() == FLEETYARD_STATUS_SOLVED);
    EXPECT(world.plan() == ending.status && said == ending.message);
    EXPECT(submitted.size() == (ending.status == FLEETYARD_STATUS_SOLVED ? 1u : 0u));
  }

  EXPECT(world.make("returns") == FLEETYARD_STATUS_SOLVED);
  EXPECT(world.both() == FLEETYARD_STATUS_SOLVED && noted == "weights=0f3c");
  EXPECT(form == FLEETYARD_FORM_CELLS && submitted[0] == std::vector<double>({1, 0}));
  for (const std::int32_t code : {FLEETYARD_BUSY, FLEETYARD_TOO_LATE, FLEETYARD_REJECTED}) {
    answer = code;
    EXPECT(world.plan() == FLEETYARD_STATUS_SOLVED);
    EXPECT(result == static_cast<fleetyard::Result>(code));
  }
  answer = FLEETYARD_OK;
  stop = 1;
  EXPECT(world.plan() == FLEETYARD_STATUS_CANCELLED);
  world.budget.answer_by_ns = 5;
  EXPECT(world.plan() == FLEETYARD_STATUS_TIMED_OUT);
  stop = 0;
}

void what_is_not_known_is_refused() {
  World world;
  EXPECT(world.make("returns") == FLEETYARD_STATUS_SOLVED);
  for (const std::int32_t code : {0, -1, 99}) {
    const std::int32_t refused =
        code == 0 ? FLEETYARD_STATUS_INVALID_INPUT : FLEETYARD_STATUS_UNSUPPORTED;
    world.environment.representation = code;
    EXPECT(world.both() == refused && said.find("representation") == 0);
    world.environment.representation = FLEETYARD_REPRESENTATION_GRID;
    world.instance.motion = code;
    EXPECT(world.both() == refused && said.find("motion") == 0);
    world.instance.motion = FLEETYARD_MOTION_PEBBLE;
    world.instance.objective = code;
    EXPECT(world.both() == refused && said.find("objective") == 0);
    world.instance.objective = FLEETYARD_OBJECTIVE_MAKESPAN;
  }
  world.instance.motion = FLEETYARD_MOTION_ROTATION; // known, and not claimed
  EXPECT(world.both() == FLEETYARD_STATUS_UNSUPPORTED);
  world.instance.motion = FLEETYARD_MOTION_PEBBLE;
  world.instance.flags = 1u << 20;
  EXPECT(world.both() == FLEETYARD_STATUS_UNSUPPORTED);
  world.instance.flags = FLEETYARD_INSTANCE_CYCLES;
  world.instance.reserved = 1;
  EXPECT(world.both() == FLEETYARD_STATUS_INVALID_INPUT);
  world.instance.reserved = 0;
  world.grid.connectivity = 8;
  EXPECT(world.both() == FLEETYARD_STATUS_UNSUPPORTED);
  world.grid.connectivity = 4;

  FleetyardPart part = {fleetyard::detail::str("org.example.dust/1"), nullptr,
                        FLEETYARD_PART_CRITICAL, 0};
  for (FleetyardParts *parts : {&world.instance.parts, &world.environment.parts}) {
    *parts = {&part, 1};
    EXPECT(world.both() == FLEETYARD_STATUS_UNSUPPORTED);
    EXPECT(said == "this plugin does not know the critical part `org.example.dust/1`");
    part.flags = 0;
    EXPECT(world.both() == FLEETYARD_STATUS_SOLVED);
    part.flags = FLEETYARD_PART_CRITICAL;
    part.id = fleetyard::detail::str("org.example.known/1");
    EXPECT(world.both() == FLEETYARD_STATUS_SOLVED);
    part.reserved = 3;
    EXPECT(world.both() == FLEETYARD_STATUS_INVALID_INPUT);
    part.reserved = 0;
    part.id = fleetyard::detail::str("org.example.dust/1");
    *parts = {};
  }
  const FleetyardJson json = {sizeof json, 0, fleetyard::detail::str("[1]")};
  part.data = &json;
  part.flags = FLEETYARD_PART_JSON;
  const fleetyard::Parts parts(FleetyardParts{&part, 1});
  EXPECT(parts.find("org.example.dust/1")->json() == "[1]" && !parts.find("org.example.dust/2"));

  world.offsets[1] = 0;
  EXPECT(world.both() == FLEETYARD_STATUS_UNSUPPORTED && said.find("agent 0 has 0 goals") == 0);
  world.offsets[1] = 1;
  world.goals[0] = 2;
  EXPECT(world.both() == FLEETYARD_STATUS_INVALID_INPUT && said == "agent 0 has a goal off the map");
  world.goals[0] = 0;
  world.instance.starts = nullptr;
  EXPECT(world.both() == FLEETYARD_STATUS_INVALID_INPUT && said == "instance.starts is null");
  world.instance.starts = world.starts.data();
  EXPECT(world.both() == FLEETYARD_STATUS_SOLVED);
  EXPECT(world.planner.prepare(world.planner.context, nullptr, &world.budget, &sink) ==
         FLEETYARD_STATUS_INVALID_INPUT);
  EXPECT(world.plan() == FLEETYARD_STATUS_INVALID_INPUT); // the last `prepare` failed
}

/* A structure of a later version may be longer, and none is shorter. */
void sizes_are_checked() {
  World world;
  EXPECT(world.make("returns") == FLEETYARD_STATUS_SOLVED);
  world.instance.struct_size--;
  EXPECT(world.both() == FLEETYARD_STATUS_INVALID_INPUT && said.find("instance.struct_size") == 0);
  world.instance.struct_size += 9;
  world.grid.struct_size += 8;
  world.budget.struct_size += 8;
  EXPECT(world.both() == FLEETYARD_STATUS_SOLVED);

  const auto *planners = factory_of<FleetyardPlannerFactory>(FLEETYARD_PLANNER_FACTORY_ID);
  const Given given("how", "returns", 0, FLEETYARD_OPTION_TEXT);
  struct {
    FleetyardPlanner known;
    double added;
  } room{{}, 7};
  room.known.struct_size = sizeof room.known - 1;
  EXPECT(planners->create(nullptr, 0, &given.raw, &sink, &room.known) ==
         FLEETYARD_STATUS_UNSUPPORTED);
  EXPECT(!room.known.plan && room.known.struct_size == sizeof room.known - 1);
  room.known.struct_size = sizeof room;
  EXPECT(planners->create(nullptr, 0, &given.raw, &sink, &room.known) == FLEETYARD_STATUS_SOLVED);
  EXPECT(room.known.struct_size == sizeof room.known && same(room.added, 7));
  room.known.destroy(room.known.context);
}

void roadmaps_are_read() {
  World world;
  EXPECT(world.make("returns") == FLEETYARD_STATUS_SOLVED);
  const double x[] = {0, 3, 3}, y[] = {0, 0, 4}, length[] = {3, 5, 3, 4, 5, 4};
  const double duration[] = {1.5, 9, 1.5, 2, 9, 2};
  const std::uint64_t edge_offsets[] = {0, 2, 4, 6};
  const std::uint32_t targets[] = {1, 2, 0, 2, 0, 1};
  FleetyardRoadmap roadmap{};
  roadmap.struct_size = sizeof roadmap;
  roadmap.vertices = 3;
  roadmap.edges = 6;
  roadmap.x_m = x;
  roadmap.y_m = y;
  roadmap.edge_offsets = edge_offsets;
  roadmap.targets = targets;
  roadmap.length_m = length;
  roadmap.duration_s = duration;
  roadmap.separation_m = 0.5;
  roadmap.flags = FLEETYARD_ROADMAP_SYMMETRIC;
  world.environment.representation = FLEETYARD_REPRESENTATION_ROADMAP;
  world.environment.view = &roadmap;
  world.instance.motion = FLEETYARD_MOTION_STOP_GO;
  world.starts[0] = 0;
  world.goals[0] = 2;
  EXPECT(world.both() == FLEETYARD_STATUS_SOLVED && form == FLEETYARD_FORM_VISITS);
  EXPECT(submitted[0] == std::vector<double>({0, 0, 0, 1, 1.5, 1.5, 2, 3.5, 3.5}));
  const fleetyard::Roadmap view(&roadmap);
  EXPECT(view.symmetric() && same(view.position(2).y_m, 4) && !view.workspace());
  EXPECT(failure_of([&] { fleetyard::Environment(&world.environment).grid(); }) == "status");
  roadmap.flags = 2;
  EXPECT(world.both() == FLEETYARD_STATUS_UNSUPPORTED);
}

void workspaces_are_read() {
  World world;
  EXPECT(world.make("returns") == FLEETYARD_STATUS_SOLVED);
  const double x[] = {1, 2, 2}, y[] = {1, 1, 2};
  const std::uint64_t corner_offsets[] = {0, 3}, state_offsets[] = {0, 3};
  const double start[] = {0, 0, 0.5}, goal[] = {3, 1, 2}, times[] = {0, 1};
  const FleetyardFootprint footprint = {sizeof footprint, 0, 0.25, nullptr, nullptr};
  const FleetyardMover mover = {sizeof mover, 2, &footprint, times, times, times, times};
  const FleetyardMover *movers[] = {&mover};
  FleetyardWorkspace workspace{};
  workspace.struct_size = sizeof workspace;
  workspace.obstacles = 1;
  workspace.max_x_m = workspace.max_y_m = 4;
  workspace.corner_offsets = corner_offsets;
  workspace.x_m = x;
  workspace.y_m = y;
  workspace.movers = movers;
  workspace.mover_count = 1;
  FleetyardRobot robot{};
  robot.struct_size = sizeof robot;
  robot.flags = FLEETYARD_ROBOT_HEADING;
  robot.footprint = &footprint;
  const FleetyardRobot *robots[] = {&robot};
  world.environment.representation = FLEETYARD_REPRESENTATION_CONTINUOUS;
  world.environment.view = &workspace;
  world.instance.motion = FLEETYARD_MOTION_DYNAMICS;
  world.instance.robots = robots;
  world.instance.robot_count = 1;
  world.instance.starts = world.instance.goals = nullptr;
  world.instance.start_state_offsets = world.instance.goal_state_offsets = state_offsets;
  world.instance.start_states = start;
  world.instance.goal_states = goal;
  EXPECT(world.both() == FLEETYARD_STATUS_SOLVED && form == FLEETYARD_FORM_TRAJECTORIES);
  EXPECT(submitted[0] == std::vector<double>({0, 0, 0, 0.5, 2, 3, 1, 0.5}));
  robot.flags = 0;
  EXPECT(world.both() == FLEETYARD_STATUS_SOLVED);
  EXPECT(submitted[0] == std::vector<double>({0, 0, 0, 2, 3, 1, 0.5, 1.5, 1, 2, 0, 0}));
  const fleetyard::Workspace view(&workspace);
  EXPECT(view.obstacle(0).size() == 3 && same(view.obstacle(0)[2].y_m, 2));
  EXPECT(same(view.max_m().x_m, 4) && same(view.mover(0).knot(1).y_m, 1));
  EXPECT(same(view.mover(0).footprint().radius_m(), 0.25));
  robot.dynamics = fleetyard::detail::str("org.example.slide/1");
  EXPECT(world.both() == FLEETYARD_STATUS_SOLVED);
  robot.dynamics = fleetyard::detail::str("org.example.slide/2");
  EXPECT(world.both() == FLEETYARD_STATUS_UNSUPPORTED && said.find("slide/2") != std::string::npos);
  robot.dynamics = {};
  world.instance.window_s = 5;
  EXPECT(world.both() == FLEETYARD_STATUS_UNSUPPORTED);
  robot.flags = 1u << 8;
  EXPECT(failure_of([&] { fleetyard::Robot{&robot}; }) == "status");
}

void modules_of_fleets_are_called() {
  World world;
  const FleetyardOptions options = {sizeof options, 0, nullptr, {}};
  const std::uint64_t ids[] = {7}, task_offsets[] = {0, 2};
  const std::uint32_t places[] = {0, 1};
  const double released[] = {0.5};
  FleetyardFleetState state{};
  state.struct_size = sizeof state;
  state.tasks = 1;
  state.next = &world.instance;
  state.task_ids = ids;
  state.task_offsets = task_offsets;
  state.task_places = places;
  state.task_released_s = released;
  world.instance.window_steps = 5;
  FleetyardInstanceGenerator generator{};
  generator.struct_size = sizeof generator;
  EXPECT(factory_of<FleetyardInstanceGeneratorFactory>(FLEETYARD_INSTANCE_GENERATOR_FACTORY_ID)
             ->create(nullptr, 0, &options, &sink, &generator) == FLEETYARD_STATUS_SOLVED);
  EXPECT(generator.prepare(generator.context, &world.environment, &world.budget, &sink) == 0);
  EXPECT(generator.generate(generator.context, &state, &world.budget, &sink) == 0);
  EXPECT(submitted[0] == std::vector<double>({0, 0, 1}) && said == "1 of 7 in 5");
  generator.destroy(generator.context);

  FleetyardFailPolicy policy{};
  policy.struct_size = sizeof policy;
  EXPECT(factory_of<FleetyardFailPolicyFactory>(FLEETYARD_FAIL_POLICY_FACTORY_ID)
             ->create(nullptr, 0, &options, &sink, &policy) == FLEETYARD_STATUS_SOLVED);
  EXPECT(policy.prepare(policy.context, &world.environment, &world.budget, &sink) == 0);
  const FleetyardCells cells = {sizeof cells, 0, places};
  FleetyardPlan failed = {sizeof failed,       1,      FLEETYARD_FORM_CELLS, 0, task_offsets,
                          &cells,              {}};
  const auto recover = [&] {
    return policy.recover(policy.context, &world.instance, &failed, &world.budget, &sink);
  };
  EXPECT(recover() == 0 && submitted[0] == std::vector<double>({0, 1}));
  const std::uint64_t none[] = {0, 0}, held[] = {0, 2}, given[] = {0, 4};
  const double durations[] = {0.5, 1.5}, numbers[] = {1, 2, 0, 3};
  FleetyardTrajectories motions{};
  motions.struct_size = sizeof motions;
  motions.segment_offsets = held;
  motions.duration_s = durations;
  motions.control_offsets = given;
  motions.controls = numbers;
  const FleetyardPlan driven = {sizeof driven, 1, FLEETYARD_FORM_TRAJECTORIES, 0, none, &motions,
                                {}};
  const fleetyard::PlanView led(&driven);
  EXPECT(led.length(0) == 0 && led.segments(0) == 2 && same(led.segment(0, 1).duration_s, 1.5));
  EXPECT(led.segment(0, 1).control == std::vector<double>({0, 3}));
  failed.form = 0;
  EXPECT(recover() == FLEETYARD_STATUS_INVALID_INPUT);
  failed.form = 9;
  EXPECT(recover() == FLEETYARD_STATUS_UNSUPPORTED);
  failed.form = FLEETYARD_FORM_CELLS;
  failed.agents = 2;
  const std::uint64_t two[] = {0, 1, 2};
  failed.offsets = two;
  EXPECT(recover() == FLEETYARD_STATUS_INVALID_INPUT);
  policy.destroy(policy.context);

  FleetyardInvocationPolicy invocation{};
  invocation.struct_size = sizeof invocation;
  EXPECT(factory_of<FleetyardInvocationPolicyFactory>(FLEETYARD_INVOCATION_POLICY_FACTORY_ID)
             ->create(nullptr, 0, &options, &sink, &invocation) == FLEETYARD_STATUS_SOLVED);
  std::uint32_t left[] = {0};
  FleetyardFleetStatus status{};
  status.struct_size = sizeof status;
  status.agents = 1;
  status.actions_left = left;
  std::int32_t now = -1;
  const auto ask = [&] {
    return invocation.should_invoke(invocation.context, &status, &sink, &now);
  };
  EXPECT(ask() == FLEETYARD_STATUS_SOLVED && now == 1);
  left[0] = 2;
  EXPECT(ask() == FLEETYARD_STATUS_SOLVED && now == 0);
  status.agents = 0;
  EXPECT(ask() == FLEETYARD_STATUS_UNSUPPORTED && said == "nobody is there");
  invocation.destroy(invocation.context);
}

std::vector<std::uint8_t> remembered;

std::int32_t remember(void *, const FleetyardBytes *bytes) {
  remembered.assign(bytes->ptr, bytes->ptr + bytes->len);
  return FLEETYARD_OK;
}

const void *keeps(void *, FleetyardStr id) {
  static const FleetyardKeep host = {sizeof host, 0, remember};
  return fleetyard::detail::view(id) == FLEETYARD_KEEP_ID ? &host : nullptr;
}

/* What the host keeps of a fleet has a type, on instances and states alike. */
void memory_is_read() {
  World world;
  const std::uint8_t averages[] = {0, 255}, letters[] = {'E', '.'};
  const FleetyardSnapshot first = {sizeof first, 0, 0, averages, averages};
  FleetyardSnapshot second = {sizeof second, 0, 1, averages, averages};
  const FleetyardTraffic traffic = {sizeof traffic, 2, 2, 20, 50, 3.5, 0.5, &second, &first};
  const std::uint64_t offsets[] = {0, 2}, tasks[] = {fleetyard::GoalTasks::no_task};
  const std::uint32_t errands[] = {fleetyard::none};
  const double times[] = {2.5};
  const FleetyardRestOfPlan rest = {sizeof rest, 1, offsets, letters};
  const FleetyardGoalTasks goals = {sizeof goals, 0, 1, 9, tasks, errands, times, times};
  const std::uint16_t factors[] = {100, 250};
  const FleetyardGuidance guidance = {sizeof guidance, 1, 2, factors, factors};
  const FleetyardBytes kept = {sizeof kept, 0, averages, 2};
  FleetyardPart list[] = {{fleetyard::detail::str(FLEETYARD_TRAFFIC_ID), &traffic, 0, 0},
                          {fleetyard::detail::str(FLEETYARD_REST_OF_PLAN_ID), &rest, 0, 0},
                          {fleetyard::detail::str(FLEETYARD_GOAL_TASKS_ID), &goals, 0, 0},
                          {fleetyard::detail::str(FLEETYARD_GUIDANCE_ID), &guidance, 0, 0},
                          {fleetyard::detail::str(FLEETYARD_KEPT_ID), &kept, 0, 0}};
  world.instance.parts = {list, 5};
  const fleetyard::Instance instance(&world.instance);
  EXPECT(instance.traffic()->last().number == 1 && instance.traffic()->before().flow[1] == 255);
  EXPECT(same(instance.traffic()->since_s(), 3.5));
  EXPECT(instance.rest_of_plan()->moves(0) == "E.");
  EXPECT(instance.goal_tasks()->tasks[0] == fleetyard::GoalTasks::no_task);
  EXPECT(same(instance.goal_tasks()->given_s[0], 2.5) && instance.kept().size() == 2);
  EXPECT(instance.guidance()->moves[1] == 250 && instance.guidance()->waits.size() == 1);
  second.struct_size--;
  EXPECT(failure_of([&] { instance.traffic(); }).find("struct_size") != std::string::npos);
  world.instance.parts = {};
  const fleetyard::Instance forgetful(&world.instance);
  EXPECT(!forgetful.traffic() && !forgetful.goal_tasks() && forgetful.kept().empty());

  FleetyardSink host = sink;
  EXPECT(fleetyard::Sink(&host).keep({averages, 2}) == fleetyard::Result::busy);
  host.get_extension = keeps;
  EXPECT(fleetyard::Sink(&host).keep({averages, 2}) == fleetyard::Result::ok);
  EXPECT(remembered == std::vector<std::uint8_t>({0, 255}));
}

FleetyardAnnotation shown{};
std::vector<double> shown_numbers;

std::int32_t annotate(void *, const FleetyardAnnotation *annotation) {
  shown = *annotation;
  shown_numbers.clear();
  for (std::uint64_t at = 0; at < annotation->offsets[annotation->count]; at++)
    shown_numbers.push_back(annotation->places ? annotation->places[at] : annotation->y_m[at]);
  return FLEETYARD_BUSY;
}

const void *annotations(void *, FleetyardStr id) {
  static const FleetyardAnnotations all = {sizeof all, 0, annotate};
  return fleetyard::detail::view(id) == FLEETYARD_ANNOTATIONS_ID ? &all : nullptr;
}

void annotations_are_handed_over() {
  EXPECT(!fleetyard::Sink(&sink).annotations());
  FleetyardSink wanting = sink;
  wanting.get_extension = annotations;
  const auto all = fleetyard::Sink(&wanting).annotations();
  EXPECT(all);
  fleetyard::Annotation about;
  about.layer = "tree";
  about.agent = 3;
  about.values = {0.5, 1};
  EXPECT(all->places(about, {{7}, {8, 9}}) == fleetyard::Result::busy);
  EXPECT(shown.shape == FLEETYARD_SHAPE_PLACES && shown.count == 2 && shown.agent == 3);
  EXPECT(shown_numbers == std::vector<double>({7, 8, 9}) && same(shown.values[1], 1));
  EXPECT(same(shown.from_s, 0) && std::isinf(shown.to_s) && shown.layer.len == 4);
  all->points(about, {{1, 2}, {3, 4}});
  EXPECT(shown.shape == FLEETYARD_SHAPE_POINTS && shown_numbers == std::vector<double>({2, 4}));
  about.values.clear();
  all->rings(about, {{{0, 0}, {1, 0}, {1, 1}}});
  EXPECT(shown.shape == FLEETYARD_SHAPE_RINGS && shown.count == 1 && !shown.values);
  all->lines(about, {{{0, 0}, {1, 5}}});
  EXPECT(shown.shape == FLEETYARD_SHAPE_LINES && shown_numbers == std::vector<double>({0, 5}));
  about.values = {1};
  EXPECT(failure_of([&] { all->points(about, {}); }) ==
         "an annotation has 1 values for 0 shapes");
}

} // namespace

int main() {
  const FleetyardPluginEntry &entry = fleetyard_plugin_entry_v1;
  EXPECT(entry.struct_size == sizeof entry && entry.abi_major == FLEETYARD_ABI_MAJOR);
  EXPECT(!factory_of<FleetyardPlannerFactory>("fleetyard.planner/2"));
  options_are_read();
  calls_end_as_they_should();
  what_is_not_known_is_refused();
  sizes_are_checked();
  roadmaps_are_read();
  workspaces_are_read();
  modules_of_fleets_are_called();
  memory_is_read();
  annotations_are_handed_over();
  return 0;
}
