/* Plays the host to plugins on fleetyard.hpp: options, exceptions, the order of calls and
 * structures that are not what they should be. Exits with 1 at the first surprise. */

#include "fleetyard.hpp"

#include <cstdio>
#include <cstdlib>

namespace {

#define EXPECT(condition)                                                             \
  do {                                                                                \
    if (!(condition)) {                                                               \
      std::fprintf(stderr, "line %d: %s; said: %s\n", __LINE__, #condition, said.c_str()); \
      std::exit(1);                                                                   \
    }                                                                                 \
  } while (false)

std::string said; /* what the last failure explained */
std::vector<std::vector<fleetyard::Cell>> submitted;

constexpr auto schema = R"({"type": "object", "additionalProperties": false, "properties": {
  "how": {"enum": ["returns", "failure", "exception", "memory", "other"], "default": "returns"},
  "count": {"type": "integer", "default": 3}, "weight": {"type": "number", "default": 1.5},
  "fast": {"type": "boolean", "default": false}, "bare": {}, "nested": {"default": {"a": [1]}}}})";

struct Odd : fleetyard::Planner {
  static constexpr auto id = "odd";
  static constexpr auto options_schema = schema;
  static constexpr auto capabilities = fleetyard::capability::grid | fleetyard::capability::pebble;
  std::string how;

  explicit Odd(const fleetyard::Options &options) : how(options.text("how")) {
    options.integer("count");
  }
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
    const std::vector<std::vector<fleetyard::Cell>> paths{{instance.starts()[0]}};
    sink.submit_plan(paths);
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

std::string failure_of(const char *json) {
  try {
    const fleetyard::Options options(json, schema);
    for (const char *name : {"count", "weight", "fast", "how"})
      static_cast<void>(options.has(name));
    options.integer("count");
    options.number("weight");
    options.flag("fast");
    options.text("how");
  } catch (const fleetyard::Failure &failure) {
    return failure.status() == fleetyard::Status::invalid_input ? failure.what() : "status";
  }
  return "";
}

void options_are_read() {
  const fleetyard::Options usual("", schema);
  EXPECT(usual.integer("count") == 3 && !usual.flag("fast") && usual.text("how") == "returns");
  EXPECT(usual.number("weight") > 1.4 && usual.number("weight") < 1.6);
  EXPECT(!usual.has("bare") && !usual.has("other") && usual.json("nested") == R"({"a": [1]})");
  const fleetyard::Options given(
      " {\"count\" : -4.0e1, \"fast\":true,\"how\":\"\\u00e4\\ud83e\\udd16\\n\", \"bare\": null}",
      schema);
  EXPECT(given.integer("count") == -40 && given.flag("fast") && given.json("bare") == "null");
  EXPECT(given.text("how") == "\xc3\xa4\xf0\x9f\xa4\x96\n");
  EXPECT(fleetyard::Options(R"({"anything": 1})", R"({"properties": {}})").has("anything"));

  EXPECT((said = failure_of("{}")).empty());
  EXPECT((said = failure_of(R"({"cuont": 1})")) == "options: there is no option `cuont`");
  EXPECT((said = failure_of(R"({"count": 1.5})")) ==
         "options: `count` is 1.5, not a whole number");
  for (const char *wrong :
       {R"({"count": "1"})", R"({"count": 1e300})", R"({"count": 99999999999999999999})",
        R"({"weight": true})", R"({"fast": 1})", R"({"how": null})", R"({"count": [1]})",
        "", "[]", "{", "{\"count\"}", R"({"count": 1)", R"({"count": 1,})", R"({"count": 01})",
        R"({"count": 1.})", R"({"count": +1})", R"({"count": 1} x)", R"({"count": 1, "count": 2})",
        "{\"how\": \"\n\"}", R"({"how": "\x"})", R"({"how": "\ud83e"})", R"({"how": "\ud83eab"})",
        R"({"how": "\u12)", R"({"how": "\)", R"({"how": tru})", "{\"bare\": \"", "{\"bare\": -}"}) {
    said = failure_of(wrong);
    EXPECT(said.empty() == (*wrong == 0));
  }
  said = failure_of(("{\"bare\":" + std::string(100000, '[')).c_str());
  EXPECT(said.find("too deep") != std::string::npos);
}

std::int32_t submit_plan(void *, const FleetyardPlan *plan) {
  submitted.clear();
  for (std::uint32_t agent = 0; agent < plan->agents; agent++)
    submitted.emplace_back(plan->cells + plan->offsets[agent],
                           plan->cells + plan->offsets[agent + 1]);
  return FLEETYARD_OK;
}
std::int32_t submit_instance(void *, const FleetyardInstance *) { return FLEETYARD_REJECTED; }
void metric(void *, FleetyardStr, double) {}
void log_line(void *, std::int32_t, FleetyardStr) {}
void progress(void *, std::uint64_t, std::uint64_t) {}
std::int32_t cancelled(void *) { return 0; }
void fail(void *, FleetyardStr text) {
  said.assign(reinterpret_cast<const char *>(text.ptr), text.len);
}

} // namespace

FLEETYARD_PLUGINS(Odd, Idle);

int main() {
  options_are_read();

  const FleetyardSink sink = {sizeof sink, 0,        nullptr,   submit_plan, submit_instance,
                              metric,      log_line, progress, cancelled,   fail};
  const auto &entry = fleetyard_plugin_entry_v1;
  const auto factory_of = [&](std::string_view id) {
    return entry.get_factory(fleetyard::detail::str(id));
  };
  EXPECT(entry.struct_size == sizeof entry && entry.abi_major == FLEETYARD_ABI_MAJOR);
  EXPECT(!factory_of(FLEETYARD_FAIL_POLICY_FACTORY_ID) && !factory_of("fleetyard.planner/2"));
  const auto *planners =
      static_cast<const FleetyardPlannerFactory *>(factory_of(FLEETYARD_PLANNER_FACTORY_ID));
  EXPECT(planners && planners->count() == 1 && !planners->descriptor(1));
  const FleetyardDescriptor *about = planners->descriptor(0);
  EXPECT(fleetyard::detail::view(about->name) == "odd" && about->options_schema.len > 0);
  EXPECT(about->capabilities == (FLEETYARD_CAPABILITY_GRID | FLEETYARD_CAPABILITY_PEBBLE));

  const std::uint8_t passable[] = {1, 1}, terrain[] = {'.', '.'};
  const FleetyardGrid grid = {sizeof grid, 1, 2, 4, 1.0, 1.0, passable, terrain};
  FleetyardEnvironment environment = {sizeof environment, FLEETYARD_REPRESENTATION_GRID, {}, &grid};
  const std::uint32_t starts[] = {1}, goals[] = {1};
  std::uint64_t offsets[] = {0, 1};
  FleetyardInstance instance{};
  instance.struct_size = sizeof instance;
  instance.agents = 1;
  instance.environment = &environment;
  instance.starts = starts;
  instance.goals = goals;
  instance.goal_offsets = offsets;
  FleetyardBudget budget{};
  budget.struct_size = sizeof budget;

  FleetyardPlanner planner{};
  const auto make = [&](const std::string &options) {
    said.clear();
    return planners->create(0, fleetyard::detail::str(options), &sink, &planner);
  };
  const auto plan = [&] {
    said.clear();
    submitted.clear();
    return planner.plan(planner.context, &instance, &budget, &sink);
  };
  EXPECT(make(R"({"how": 3})") == FLEETYARD_STATUS_INVALID_INPUT);
  EXPECT(said == "options: `how` is 3, not a string");
  EXPECT(make(R"({"what": 3})") == FLEETYARD_STATUS_INVALID_INPUT);
  EXPECT(planners->create(1, {}, &sink, &planner) == FLEETYARD_STATUS_INVALID_INPUT);
  EXPECT(planners->create(0, {}, nullptr, &planner) == FLEETYARD_STATUS_INVALID_INPUT);

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
    EXPECT(make(std::string("{\"how\": \"") + ending.how + "\"}") == FLEETYARD_STATUS_SOLVED);
    EXPECT(plan() == FLEETYARD_STATUS_INVALID_INPUT);
    EXPECT(said == "the call came before a successful `prepare`");
    EXPECT(planner.prepare(planner.context, &environment, &budget, &sink) ==
           FLEETYARD_STATUS_SOLVED);
    EXPECT(plan() == ending.status && said == ending.message);
    EXPECT(submitted.size() == (ending.status == FLEETYARD_STATUS_SOLVED ? 1u : 0u));
    planner.destroy(planner.context);
  }

  EXPECT(make("") == FLEETYARD_STATUS_SOLVED);
  EXPECT(planner.prepare(planner.context, &environment, &budget, &sink) == FLEETYARD_STATUS_SOLVED);
  instance.struct_size--;
  EXPECT(plan() == FLEETYARD_STATUS_INVALID_INPUT && said.find("instance.struct_size") == 0);
  instance.struct_size++;
  offsets[1] = 0;
  EXPECT(plan() == FLEETYARD_STATUS_INVALID_INPUT && said == "agent 0 has no goal");
  offsets[1] = 1;
  instance.starts = nullptr;
  EXPECT(plan() == FLEETYARD_STATUS_INVALID_INPUT && said == "instance.starts is null");
  instance.starts = starts;
  EXPECT(plan() == FLEETYARD_STATUS_SOLVED);
  EXPECT(planner.prepare(planner.context, nullptr, &budget, &sink) ==
         FLEETYARD_STATUS_INVALID_INPUT);
  EXPECT(plan() == FLEETYARD_STATUS_INVALID_INPUT); // the last `prepare` failed
  planner.destroy(planner.context);

  const auto *policies = static_cast<const FleetyardInvocationPolicyFactory *>(
      factory_of(FLEETYARD_INVOCATION_POLICY_FACTORY_ID));
  FleetyardInvocationPolicy policy{};
  EXPECT(policies->create(0, fleetyard::detail::str("{\"x\": 1}"), &sink, &policy) ==
         FLEETYARD_STATUS_INVALID_INPUT);
  EXPECT(policies->create(0, fleetyard::detail::str("{}"), &sink, &policy) ==
         FLEETYARD_STATUS_SOLVED);
  std::uint32_t left[] = {0};
  FleetyardFleetStatus status{};
  status.struct_size = sizeof status;
  status.agents = 1;
  status.actions_left = left;
  EXPECT(policy.should_invoke(policy.context, &status, &sink) == FLEETYARD_INVOKE_NOW);
  left[0] = 2;
  EXPECT(policy.should_invoke(policy.context, &status, &sink) == FLEETYARD_INVOKE_NOT_YET);
  status.agents = 0;
  EXPECT(policy.should_invoke(policy.context, &status, &sink) < 0 && said == "nobody is there");
  policy.destroy(policy.context);
  return 0;
}
