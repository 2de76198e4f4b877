#!/usr/bin/env python3
"""Calls the planner every so many seconds, and when somebody has nothing left to do.

Put your own rule into `should_invoke`.
"""

import fleetyard


class ExamplePlugin(fleetyard.InvocationPolicy):
    """Calls the planner periodically, and when an agent has nothing left to do."""

    id = "example-plugin"
    version = "0.1.0"
    # What `--option NAME=VALUE` may say. The host checks it before the policy starts.
    options_schema = {
        "type": "object",
        "additionalProperties": False,
        "properties": {
            "period_s": {
                "type": "number",
                "exclusiveMinimum": 0,
                "default": 5,
                "description": "Simulated seconds between calls.",
            }
        },
    }

    def should_invoke(self, status, context):
        idle = 0 in status.actions_left
        return idle or status.since_last_call_s >= self.options["period_s"]


if __name__ == "__main__":
    fleetyard.run(ExamplePlugin)
