#!/usr/bin/env python3
"""A fail policy: everybody follows the path that the failed planner left, and waits
whenever the next cell is not to be had.

Nobody collides: a step is taken only into a cell that is free by then, by one agent, and
never through one another, nor round in a ring where that is not allowed.
"""

import pathlib
import sys

try:
    import fleetyard
except ImportError:  # not installed: the package lies in the same repository
    sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[3] / "abi" / "python"))
    import fleetyard


class Follow(fleetyard.FailPolicy):
    id = "follow-python"
    name = "Follow and wait (Python example)"
    version = "0.1.0"
    license = "MIT OR Apache-2.0"
    description = "Follows the paths of the failed plan and waits where they collide."
    capabilities = ("grid", "pebble", "windowed", "duplicate-goals", "deterministic")

    def recover(self, instance, failed_plan, budget, context):
        starts = list(instance.starts)
        if len(set(starts)) < len(starts) or not all(map(self.grid.is_free, starts)):
            raise fleetyard.InvalidInput("somebody starts on an obstacle or another agent")
        # What is left of each path; one that does not begin at the start is worth nothing.
        left = [
            path[:0:-1] if path and path[0] == start else []
            for path, start in zip(failed_plan or [[]] * len(starts), starts)
        ]
        paths = [[start] for start in starts]
        while any(left) and not context.cancelled():  # what there is then is a plan as well
            at = [path[-1] for path in paths]
            wishes = [rest[-1] if rest else here for rest, here in zip(left, at)]
            steps = fleetyard.settle(
                self.grid, at, wishes, instance.allows_cycles, instance.strict
            )
            if steps == at and not any(rest and rest[-1] == here for rest, here in zip(left, at)):
                break  # nobody will ever move again
            for path, rest, step in zip(paths, left, steps):
                path.append(step)
                if rest and rest[-1] == step:
                    rest.pop()
        return paths


if __name__ == "__main__":
    fleetyard.run(Follow)
