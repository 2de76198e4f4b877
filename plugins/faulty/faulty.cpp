// A planner in C++ that lets exceptions out: through the plugin contract, which is one
// of C, out of a thread, out of a destructor. Option `fault`, see README.md. A fixture
// for tests of the host, and nothing to learn from. With `none` all agents stay.

#include <atomic>
#include <chrono>
#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "fleetyard.h"

namespace {

FleetyardStr text(const char *words) {
  return {words, std::strlen(words)};
}

struct Faulty {
  std::string options;

  bool asked_for(const char *fault) const {
    return options.find('"' + std::string(fault) + '"') != std::string::npos;
  }
};

// Throws while an exception is on its way.
struct Destructor {
  ~Destructor() noexcept(false) { throw std::runtime_error("from a destructor, as asked"); }
};

std::int32_t prepare(void *context, const FleetyardEnvironment *, const FleetyardBudget *,
                     const FleetyardSink *) {
  if (static_cast<Faulty *>(context)->asked_for("throw-prepare"))
    throw std::runtime_error("from `prepare`, as asked");
  return FLEETYARD_STATUS_SOLVED;
}

std::int32_t plan(void *context, const FleetyardInstance *instance, const FleetyardBudget *,
                  const FleetyardSink *sink) {
  const Faulty *faulty = static_cast<Faulty *>(context);
  if (faulty->asked_for("throw-plan"))
    throw std::runtime_error("from `plan`, as asked");
  if (faulty->asked_for("throw-number"))
    throw 42;
  if (faulty->asked_for("throw-thread"))
    std::thread([] { throw std::runtime_error("from a thread, as asked"); }).join();
  if (faulty->asked_for("throw-twice")) {
    Destructor destructor;
    throw std::runtime_error("from `plan`, as asked");
  }
  if (faulty->asked_for("joinable-thread")) // its destructor ends the program
    std::thread thread([] { std::this_thread::sleep_for(std::chrono::seconds(60)); });
  if (faulty->asked_for("bad-alloc")) {
    // A call, and the address is used: a compiler may leave other allocations out.
    std::atomic<std::size_t> size{SIZE_MAX / 4};
    void *memory = ::operator new(size);
    sink->metric(sink->context, text("address"),
                 static_cast<double>(reinterpret_cast<std::uintptr_t>(memory)));
    ::operator delete(memory);
  }
  std::vector<std::uint64_t> offsets;
  for (std::uint64_t agent = 0; agent <= instance->agents; agent++)
    offsets.push_back(agent);
  const FleetyardCells starts = {sizeof starts, 0, instance->starts};
  const FleetyardPlan stay = {sizeof stay, instance->agents, FLEETYARD_FORM_CELLS, 0,
                              offsets.data(), &starts, {}};
  sink->submit_plan(sink->context, &stay);
  return FLEETYARD_STATUS_SOLVED;
}

void destroy(void *context) {
  const Faulty *faulty = static_cast<Faulty *>(context);
  const bool throws = faulty->asked_for("throw-destroy");
  delete faulty;
  if (throws)
    throw std::runtime_error("from `destroy`, as asked");
}

std::int32_t create(void *, std::uint32_t, const FleetyardOptions *options, const FleetyardSink *,
                    FleetyardPlanner *out) {
  if (out->struct_size < sizeof *out)
    return FLEETYARD_STATUS_UNSUPPORTED;
  auto *faulty = new Faulty{std::string(options->json.ptr, options->json.len)};
  if (faulty->asked_for("throw-create"))
    throw std::runtime_error("from `create`, as asked");
  *out = {};
  out->struct_size = sizeof *out;
  out->context = faulty;
  out->prepare = prepare;
  out->plan = plan;
  out->destroy = destroy;
  return FLEETYARD_STATUS_SOLVED;
}

const FleetyardDescriptor *descriptor(void *, std::uint32_t index) {
  static const FleetyardDescriptor about = {
      sizeof about,
      0,
      text("faulty-cpp"),
      text("Faulty in C++"),
      text("0.1.0"),
      text("Lets exceptions out on request. For tests of the host."),
      text("MIT OR Apache-2.0"),
      text(R"({"type":"object","additionalProperties":false,"properties":{"fault":{"enum":[)"
           R"("none","throw-create","throw-prepare","throw-plan","throw-number",)"
           R"("throw-thread","throw-twice","throw-destroy","joinable-thread","bad-alloc"],)"
           R"("default":"none"}}})"),
      FLEETYARD_CAPABILITY_GRID | FLEETYARD_CAPABILITY_PEBBLE | FLEETYARD_CAPABILITY_DETERMINISTIC,
      nullptr,
  };
  return index == 0 ? &about : nullptr;
}

std::uint32_t count(void *) { return 1; }

const void *get_factory(FleetyardStr id) {
  static const FleetyardPlannerFactory planners = {sizeof planners, 0,          nullptr,
                                                   count,           descriptor, create};
  return std::string(id.ptr, id.len) == FLEETYARD_PLANNER_FACTORY_ID ? &planners : nullptr;
}

} // namespace

const FleetyardPluginEntry fleetyard_plugin_entry_v1 = {
    sizeof(FleetyardPluginEntry), FLEETYARD_ABI_MAJOR, FLEETYARD_ABI_MINOR, nullptr, nullptr,
    get_factory,
};
