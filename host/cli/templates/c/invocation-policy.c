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
                             const FleetyardSink *sink, int32_t *out) {
  const Policy *policy = context;
  bool now = status->since_last_call_s >= policy->period_s;
  (void)sink;
  for (uint32_t agent = 0; agent < status->agents; agent++)
    now = now || status->actions_left[agent] == 0;
  *out = now ? 1 : 0;
  return FLEETYARD_STATUS_SOLVED;
}

/* ---- What the library exports ---------------------------------------------- */

/* What the host knows of the policy. The schema says what `--option NAME=VALUE` may be;
 * the host checks it beforehand. */
static const FleetyardDescriptor about = {
    .struct_size = sizeof about,
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

static void *make(const FleetyardOptions *options, const FleetyardSink *sink) {
  Policy *policy = fleetyard_array(1, sizeof *policy);
  (void)sink;
  policy->period_s = fleetyard_number(options, "period_s", 5);
  return policy;
}

FLEETYARD_EXPORT_INVOCATION_POLICY(about, make, should_invoke, free);
