#!/usr/bin/env python3
"""An invocation policy: calls the planner just in time for its plan to arrive before
somebody has nothing left to do, and at the latest after a period."""

import pathlib
import sys

try:
    import fleetyard
except ImportError:  # not installed: the package lies in the same repository
    sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[3] / "abi" / "python"))
    import fleetyard


class JustInTime(fleetyard.InvocationPolicy):
    id = "just-in-time-python"
    name = "Just in time (Python example)"
    version = "0.1.0"
    license = "MIT OR Apache-2.0"
    description = (
        "Calls the planner when what is committed lasts no longer than planning may take, "
        "and after a period."
    )
    options_schema = {
        "type": "object",
        "additionalProperties": False,
        "properties": {
            "margin": {
                "type": "number",
                "minimum": 0,
                "default": 1,
                "description": "Times the planner's limit that has to be left.",
            },
            "period_s": {
                "type": "number",
                "minimum": 0,
                "default": 30,
                "description": "Most seconds between two calls.",
            },
        },
    }

    def should_invoke(self, status, context):
        if status.since_last_call_s >= self.options["period_s"]:
            return True
        left_s = min(status.actions_left) * status.action_s
        return left_s <= self.options["margin"] * status.planning_limit_s


if __name__ == "__main__":
    fleetyard.run(JustInTime)
