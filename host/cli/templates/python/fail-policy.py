#!/usr/bin/env python3
"""Follows the planner's failed plan for as long as nobody collides, and then waits.

So the fleet goes on a little, and the next call of the planner is another question.
Put your own algorithm into `recover`.
"""

import fleetyard


class ExamplePlugin(fleetyard.FailPolicy):
    """Keeps what is free of collisions at the beginning of the failed plan."""

    id = "example-plugin"
    version = "0.1.0"
    # What the host may ask of the policy; docs/conformance.md lists all there is.
    capabilities = ("grid", "pebble", "deterministic")
    # What `--option NAME=VALUE` may say. The host checks it before the policy starts.
    options_schema = {
        "type": "object",
        "additionalProperties": False,
        "properties": {
            "steps": {
                "type": "integer",
                "minimum": 0,
                "default": 10,
                "description": "Most steps to take.",
            }
        },
    }

    def recover(self, instance, failed_plan, budget, context):
        paths = [[start] for start in instance.starts]
        failed_plan = failed_plan or paths  # the planner may have left nothing
        for time in range(1, self.options["steps"] + 1):
            context.check()  # ends the call when its time is up
            now = [path[-1] for path in paths]
            after = [path[min(time, len(path) - 1)] for path in failed_plan]
            if not self.is_safe(now, after):
                break
            for path, cell in zip(paths, after):
                path.append(cell)
        return paths

    def is_safe(self, now, after):
        """True if all agents can go from their cells to these in one step."""
        moves = set(zip(now, after))
        return len(set(after)) == len(after) and all(
            here == there or (there in self.grid.neighbors(here) and (there, here) not in moves)
            for here, there in moves
        )


if __name__ == "__main__":
    fleetyard.run(ExamplePlugin)
