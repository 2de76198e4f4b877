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

from ._model import (
    OFF_MAP,
    Assignment,
    Budget,
    Cancelled,
    Failure,
    FleetState,
    FleetStatus,
    GaveUp,
    Grid,
    Infeasible,
    Instance,
    InternalError,
    InvalidInput,
    Task,
    TimedOut,
    Unsupported,
)
from ._paths import Paths
from ._plugins import (
    Context,
    FailPolicy,
    InstanceGenerator,
    InvocationPolicy,
    Planner,
    Plugin,
)
from ._server import PROTOCOL_VERSION, run, serve

__version__ = "0.1.0"

__all__ = [
    "OFF_MAP",
    "PROTOCOL_VERSION",
    "Assignment",
    "Budget",
    "Cancelled",
    "Context",
    "FailPolicy",
    "Failure",
    "FleetState",
    "FleetStatus",
    "GaveUp",
    "Grid",
    "Infeasible",
    "Instance",
    "InstanceGenerator",
    "InternalError",
    "InvalidInput",
    "InvocationPolicy",
    "Paths",
    "Planner",
    "Plugin",
    "Task",
    "TimedOut",
    "Unsupported",
    "run",
    "serve",
]
