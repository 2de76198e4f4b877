#!/usr/bin/env python3
"""An instance generator: whoever has nothing to do gets the nearest task, agents in the
order of their numbers. Who is left without a task stays where it is."""

import pathlib
import sys

try:
    import fleetyard
except ImportError:  # not installed: the package lies in the same repository
    sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[3] / "abi" / "python"))
    import fleetyard


class NearestTask(fleetyard.InstanceGenerator):
    id = "nearest-task-python"
    name = "Nearest task (Python example)"
    version = "0.1.0"
    license = "MIT OR Apache-2.0"
    description = "Gives every idle agent the task whose first place is nearest."
    capabilities = (
        "grid",
        "eight-connected",
        "pebble",
        "rotation",
        "windowed",
        "duplicate-goals",
        "deterministic",
    )

    def generate(self, state, budget, context):
        tasks = [task for task in state.tasks if task.places]
        goals = []
        given = []
        for agent, (here, open_goals) in enumerate(zip(state.next.starts, state.next.goals)):
            if not open_goals and tasks:
                context.check()
                distance = self.grid.distances(here)
                reachable = [t for t in tasks if all(distance[cell] >= 0 for cell in t.places)]
                if reachable:
                    nearest = min(reachable, key=lambda task: distance[task.places[0]])
                    tasks.remove(nearest)
                    open_goals = nearest.places
                    given.append(fleetyard.Assignment(agent, nearest.id))
            goals.append(open_goals or [here])
        return state.request(goals, given)


if __name__ == "__main__":
    fleetyard.run(NearestTask)
