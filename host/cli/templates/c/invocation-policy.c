/* Calls the planner every so many seconds, and when somebody has nothing left to do.
 *
 * Put your own rule into `should_invoke`.
 */

#include "fleetyard_easy.h"

typedef struct {
  double period_s;
} Policy;

/* ---- The algorithm --------------------------------------------------------- */

static int32_t should_invoke(void *context, const FleetyardFleetStatus *status,
                             const FleetyardSink *sink) {
  const Policy *policy = context;
  bool now = status->since_last_call_s >= policy->period_s;
  (void)sink;
  for (uint32_t agent = 0; agent < status->agents; agent++)
    now = now || status->actions_left[agent] == 0;
  return now ? FLEETYARD_INVOKE_NOW : FLEETYARD_INVOKE_NOT_YET;
}

/* ---- What the library exports ---------------------------------------------- */

/* What the host knows of the policy. The schema says what `--option NAME=VALUE` may be;
 * the host checks it beforehand. */
static const FleetyardDescriptor descriptor = {
    .struct_size = sizeof descriptor,
    .id = FLEETYARD_TEXT("example-plugin"),
    .name = FLEETYARD_TEXT("example-plugin"),
    .version = FLEETYARD_TEXT("0.1.0"),
    .description =
        FLEETYARD_TEXT("Calls the planner periodically, and when an agent has nothing left to do."),
    .options_schema = FLEETYARD_TEXT(
        "{\"type\": \"object\", \"additionalProperties\": false, \"properties\": {"
        "\"period_s\": {\"type\": \"number\", \"exclusiveMinimum\": 0, \"default\": 5,"
        "\"description\": \"Simulated seconds between calls.\"}}}"),
};

static int32_t configure(void *context, FleetyardStr options, const FleetyardSink *sink) {
  Policy *policy = context;
  policy->period_s = 5;
  const FleetyardOption known[] = {{"period_s", &policy->period_s, 0, 1e9, NULL}};
  return fleetyard_read_options(options, known, 1, sink);
}

FLEETYARD_INVOCATION_POLICY(descriptor, sizeof(Policy), configure, should_invoke);
