/* An invocation policy: calls the planner just in time for its plan to arrive before
 * somebody has nothing left to do, and at the latest after a period.
 */

#include "fleetyard.hpp"

namespace {

class JustInTime : public fleetyard::InvocationPolicy {
public:
  static constexpr auto id = "just-in-time";
  static constexpr auto name = "Just in time (C++ example)";
  static constexpr auto version = "0.1.0";
  static constexpr auto license = "MIT OR Apache-2.0";
  static constexpr auto description =
      "Calls the planner when what is committed lasts no longer than planning may take, and "
      "after a period.";
  static constexpr auto options_schema = R"({
    "type": "object", "additionalProperties": false,
    "properties": {
      "margin": {
        "type": "number", "minimum": 0, "default": 1,
        "description": "Times the planner's limit that has to be left."
      },
      "period_s": {
        "type": "number", "minimum": 0, "default": 30,
        "description": "Most seconds between two calls."
      }
    }
  })";

  explicit JustInTime(const fleetyard::Options &options)
      : margin_(options.number("margin")), period_s_(options.number("period_s")) {}

  bool should_invoke(const fleetyard::FleetStatus &status, const fleetyard::Sink &) override {
    if (status.since_last_call_s() >= period_s_)
      return true;
    const auto left = status.actions_left();
    const auto least = std::min_element(left.begin(), left.end());
    return least != left.end() &&
           *least * status.action_s() <= margin_ * status.planning_limit_s();
  }

private:
  double margin_, period_s_;
};

} // namespace

FLEETYARD_PLUGINS(JustInTime);
