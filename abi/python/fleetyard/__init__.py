"""Plugins for Fleetyard in Python.

Subclass one of the four kinds and give it to :func:`run`::

    import fleetyard

    class Stay(fleetyard.Planner):
        '''Leaves everybody at their start.'''

        def plan(self, instance, budget, context):
            return [[start] for start in instance.starts]

    if __name__ == "__main__":
        fleetyard.run(Stay)

The host starts the script and speaks JSON with it over standard input and
output; :func:`run` is the plugin's side of that. Standard library only.
"""

from ._annotations import Annotations
from ._failures import (
    Cancelled,
    Failure,
    GaveUp,
    Infeasible,
    InternalError,
    InvalidInput,
    TimedOut,
    Unsupported,
)
from ._maps import Environment, Footprint, Grid, Mover, Parts, Roadmap, Workspace
from ._memory import KEPT_LIMIT, GoalTasks, Guidance, RestOfPlan, Snapshot, Traffic
from ._model import (
    OFF_MAP,
    Assignment,
    Budget,
    FleetState,
    FleetStatus,
    Instance,
    Request,
    Robot,
    State,
    Task,
)
from ._paths import Paths
from ._plans import Knot, Motion, Plan, Segment, Trajectories, Visit, Visits
from ._plugins import (
    Context,
    FailPolicy,
    InstanceGenerator,
    InvocationPolicy,
    Planner,
    Plugin,
)
from ._server import PROTOCOL_VERSION, run, serve
from ._steps import Observation, StepPolicy, settle

__version__ = "0.1.0"

__all__ = [
    "KEPT_LIMIT",
    "OFF_MAP",
    "PROTOCOL_VERSION",
    "Annotations",
    "Assignment",
    "Budget",
    "Cancelled",
    "Context",
    "Environment",
    "FailPolicy",
    "Failure",
    "FleetState",
    "FleetStatus",
    "Footprint",
    "GaveUp",
    "GoalTasks",
    "Grid",
    "Guidance",
    "Infeasible",
    "Instance",
    "InstanceGenerator",
    "InternalError",
    "InvalidInput",
    "InvocationPolicy",
    "Knot",
    "Motion",
    "Mover",
    "Observation",
    "Parts",
    "Paths",
    "Plan",
    "Planner",
    "Plugin",
    "Request",
    "RestOfPlan",
    "Roadmap",
    "Robot",
    "Segment",
    "Snapshot",
    "State",
    "StepPolicy",
    "Task",
    "TimedOut",
    "Traffic",
    "Trajectories",
    "Unsupported",
    "Visit",
    "Visits",
    "Workspace",
    "run",
    "serve",
    "settle",
]
