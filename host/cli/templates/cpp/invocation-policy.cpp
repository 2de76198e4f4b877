/* Calls the planner every so many seconds, and when somebody has nothing left to do.
 *
 * Put your own rule into `should_invoke`.
 */

#include "fleetyard.hpp"

#include <algorithm>

namespace {

/* Calls the planner periodically, and when an agent has nothing left to do. */
class Periodic : public fleetyard::InvocationPolicy {
public:
  static constexpr auto id = "example-plugin";
  static constexpr auto version = "0.1.0";
  static constexpr auto description =
      "Calls the planner periodically, and when an agent has nothing left to do.";
  /* What `--option NAME=VALUE` may say. The host checks it before the policy starts. */
  static constexpr auto options_schema = R"({
    "type": "object",
    "additionalProperties": false,
    "properties": {
      "period_s": {
        "type": "number",
        "exclusiveMinimum": 0,
        "default": 5,
        "description": "Simulated seconds between calls."
      }
    }
  })";

  explicit Periodic(const fleetyard::Options &options) : period_s_(options.number("period_s")) {}

  bool should_invoke(const fleetyard::FleetStatus &status, const fleetyard::Sink &) override {
    const auto left = status.actions_left();
    const bool idle = std::find(left.begin(), left.end(), 0) != left.end();
    return idle || status.since_last_call_s() >= period_s_;
  }

private:
  double period_s_;
};

} // namespace

FLEETYARD_PLUGINS(Periodic);
