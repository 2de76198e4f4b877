/* Calls the planner every so many seconds, and when somebody has nothing left to do.
 *
 * Put your own rule into `should_invoke`.
 */

#include "fleetyard.h"

#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define TEXT(literal) {(const uint8_t *)(literal), sizeof(literal) - 1}

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
    .id = TEXT("example-plugin"),
    .name = TEXT("example-plugin"),
    .version = TEXT("0.1.0"),
    .description =
        TEXT("Calls the planner periodically, and when an agent has nothing left to do."),
    .options_schema =
        TEXT("{\"type\": \"object\", \"additionalProperties\": false, \"properties\": {"
             "\"period_s\": {\"type\": \"number\", \"exclusiveMinimum\": 0, \"default\": 5,"
             "\"description\": \"Simulated seconds between calls.\"}}}"),
};

/* The number that an option has. With more than a few options, take a JSON library. */
static double option(FleetyardStr options, const char *name, double otherwise) {
  char text[256];
  snprintf(text, sizeof text, "%.*s", (int)options.len, (const char *)options.ptr);
  const char *found = strstr(text, name);
  found = found ? strchr(found, ':') : NULL;
  return found ? strtod(found + 1, NULL) : otherwise;
}

static void destroy(void *context) { free(context); }

static int32_t create(uint32_t index, FleetyardStr options, const FleetyardSink *sink,
                      FleetyardInvocationPolicy *out) {
  Policy *policy = malloc(sizeof *policy);
  (void)index; /* there is one policy */
  (void)sink;
  if (!policy)
    return FLEETYARD_STATUS_INTERNAL_ERROR;
  policy->period_s = option(options, "\"period_s\"", 5);
  *out = (FleetyardInvocationPolicy){
      .struct_size = sizeof *out,
      .context = policy,
      .should_invoke = should_invoke,
      .destroy = destroy,
  };
  return FLEETYARD_STATUS_SOLVED;
}

static uint32_t count(void) { return 1; }

static const FleetyardDescriptor *describe(uint32_t index) {
  return index == 0 ? &descriptor : NULL;
}

static const FleetyardInvocationPolicyFactory factory = {sizeof factory, 0, count, describe,
                                                         create};

static const void *get_factory(FleetyardStr id) {
  static const char wanted[] = FLEETYARD_INVOCATION_POLICY_FACTORY_ID;
  bool equal = id.len == sizeof wanted - 1 && memcmp(id.ptr, wanted, id.len) == 0;
  return equal ? &factory : NULL;
}

const FleetyardPluginEntry fleetyard_plugin_entry_v1 = {
    .struct_size = sizeof fleetyard_plugin_entry_v1,
    .abi_major = FLEETYARD_ABI_MAJOR,
    .abi_minor = FLEETYARD_ABI_MINOR,
    .get_factory = get_factory,
};
