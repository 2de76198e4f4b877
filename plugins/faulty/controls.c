/* A planner of single integrators in the plane that drives every robot straight to its goal, by
 * knots and by controls, and breaks what the option `fault` names. A fixture for tests of the host.
 */
#include "fleetyard_easy.h"

#define SPEED 0.5
#define FAULTS "none off-controls too-fast ragged lengths huge null nan negative endless"

static int fault_of(const void *context, const char *name) {
  return *(const int *)context == fleetyard_word_index(FAULTS, fleetyard_text(name));
}

static int32_t solve(void *context, const FleetyardInstance *instance,
                     const FleetyardBudget *budget, const FleetyardSink *sink) {
  uint32_t agents = instance->agents;
  uint64_t *knot_offsets = (uint64_t *)fleetyard_array(agents + 1, sizeof(uint64_t));
  uint64_t *segment_offsets = (uint64_t *)fleetyard_array(agents + 1, sizeof(uint64_t));
  uint64_t *control_offsets = (uint64_t *)fleetyard_array(agents + 1, sizeof(uint64_t));
  double *columns[5]; /* time, x, y, duration, controls */
  (void)budget;
  for (int i = 0; i < 5; i++)
    columns[i] = (double *)fleetyard_array(4 * (size_t)agents, sizeof(double));
  double faster = fault_of(context, "too-fast") ? 4 : 1;
  double aside = fault_of(context, "off-controls") ? 0.1 : 0;
  for (uint32_t agent = 0; agent < agents; agent++) {
    const double *start = instance->start_states + instance->start_state_offsets[agent];
    const double *goal =
        instance->goal_states + instance->goal_state_offsets[instance->goal_offsets[agent]];
    double way[] = {goal[0] - start[0], goal[1] - start[1]};
    double takes_s = hypot(way[0], way[1]) / (SPEED * faster) + 1e-3;
    for (int end = 0; end < 2; end++) {
      columns[0][2 * agent + end] = end ? takes_s : 0;
      columns[1][2 * agent + end] = start[0] + end * way[0];
      columns[2][2 * agent + end] = start[1] + end * way[1];
      columns[3][2 * agent + end] = takes_s / 2; /* one half, and the other */
      columns[4][4 * agent + 2 * end] = way[0] / takes_s;
      columns[4][4 * agent + 2 * end + 1] = way[1] / takes_s + aside;
    }
    knot_offsets[agent + 1] = segment_offsets[agent + 1] = 2 * (agent + 1);
    control_offsets[agent + 1] = 4 * (agent + 1);
  }
  FleetyardTrajectories body = {sizeof body,     0,          columns[0],      columns[1], columns[2], NULL,
                                segment_offsets, columns[3], control_offsets, columns[4]};
  if (fault_of(context, "ragged")) /* three numbers for two controls */
    control_offsets[agents] -= 1;
  if (fault_of(context, "lengths")) /* one for each */
    control_offsets[agents] -= 2;
  if (fault_of(context, "huge"))
    segment_offsets[agents] = UINT64_C(1) << 60;
  if (fault_of(context, "null"))
    body.controls = NULL;
  if (fault_of(context, "nan"))
    columns[4][0] = NAN;
  if (fault_of(context, "negative"))
    columns[3][0] = -1;
  if (fault_of(context, "endless"))
    columns[3][0] = 1e300;
  FleetyardPlan plan = {sizeof plan,  agents, FLEETYARD_FORM_TRAJECTORIES, 0,
                        knot_offsets, &body,  {NULL, 0}};
  int32_t code = sink->submit_plan(sink->context, &plan);
  free(knot_offsets);
  free(segment_offsets);
  free(control_offsets);
  for (int i = 0; i < 5; i++)
    free(columns[i]);
  return fleetyard_taken(code, sink);
}

static void *make(const FleetyardOptions *options, const FleetyardSink *sink) {
  int *fault = (int *)fleetyard_array(1, sizeof *fault);
  (void)sink;
  *fault = fleetyard_choice(options, "fault", FAULTS);
  return fault;
}

static const FleetyardStr features[] = {FLEETYARD_TEXT("dynamics:fleetyard.single-integrator/1")};

static const FleetyardDescriptor about = {
    .struct_size = sizeof about,
    .feature_count = 1,
    .id = FLEETYARD_TEXT("faulty-controls"),
    .name = FLEETYARD_TEXT("Faulty controls"),
    .version = FLEETYARD_TEXT("0.1.0"),
    .description = FLEETYARD_TEXT("Straight on, with controls that are wrong on request."),
    .license = FLEETYARD_TEXT("MIT OR Apache-2.0"),
    .options_schema = FLEETYARD_TEXT(
        "{\"type\": \"object\", \"additionalProperties\": false, \"properties\": {\"fault\": "
        "{\"type\": \"string\", \"default\": \"none\", \"enum\": [\"none\", \"off-controls\", "
        "\"too-fast\", \"ragged\", \"lengths\", \"huge\", \"null\", \"nan\", \"negative\", "
        "\"endless\"]}}}"),
    .capabilities = FLEETYARD_CAPABILITY_CONTINUOUS | FLEETYARD_CAPABILITY_DYNAMICS |
                    FLEETYARD_CAPABILITY_HETEROGENEOUS | FLEETYARD_CAPABILITY_DETERMINISTIC,
    .features = features};

FLEETYARD_EXPORT_PLANNER(about, make, fleetyard_learn_nothing, solve, free);
