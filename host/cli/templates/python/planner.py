#!/usr/bin/env python3
"""Prioritized planning: agents plan one after the other, each round those before it.

After Erdmann and Lozano-Perez, "On Multiple Moving Objects" (Algorithmica 1987). It is
simple, and neither complete nor optimal. Put your own algorithm into `plan`.
"""

import fleetyard


class ExamplePlugin(fleetyard.Planner):
    """Prioritized planning, in another order when an agent finds no path."""

    id = "example-plugin"
    version = "0.1.0"
    # What the host may ask of the planner; docs/conformance.md lists all there is.
    capabilities = ("grid", "pebble", "deterministic")
    # What `--option NAME=VALUE` may say. The host checks it before the planner starts.
    options_schema = {
        "type": "object",
        "additionalProperties": False,
        "properties": {
            "attempts": {
                "type": "integer",
                "minimum": 1,
                "default": 100,
                "description": "Most orders of the agents to try.",
            }
        },
    }

    def plan(self, instance, budget, context):
        if len(set(instance.starts)) < instance.agents:
            raise fleetyard.InvalidInput("two agents start in one cell")
        order = list(range(instance.agents))
        for _ in range(self.options["attempts"]):
            paths = {}
            for agent in order:
                path = self.find_path(instance, agent, list(paths.values()), context)
                if path is None:
                    break
                paths[agent] = path
            else:
                return [paths[agent] for agent in range(instance.agents)]
            if not paths:
                raise fleetyard.Infeasible(f"no path leads agent {agent} to its goal")
            # Who found no path goes first, and who went first goes last.
            order.remove(agent)
            order = [agent, *order[1:], order[0]]
        raise fleetyard.GaveUp("no order of the agents worked")

    def find_path(self, instance, agent, others, context):
        """The cells of a shortest path that meets none of the other paths, or None."""
        start, goal = instance.starts[agent], instance.goal(agent)
        # steps[t] has every cell where the agent can be at time t, and where it was
        # before that.
        steps = [{start: None}]
        # At the goal it stays: nobody may come by later.
        while goal not in steps[-1] or any(goal in path[len(steps) :] for path in others):
            context.check()  # ends the call when its time is up
            time = len(steps)
            before, now = positions(others, time - 1), positions(others, time)
            reached = {}
            for cell in steps[-1]:
                for near in (*self.grid.neighbors(cell), cell):
                    swap = near in before and now.get(cell) == before[near]
                    if near not in now and not swap:
                        reached.setdefault(near, cell)
            # Once the others stand still, what is not reached now never will be.
            still = all(len(path) < time for path in others)
            if not reached or (still and len(reached) == len(steps[-1])):
                return None
            steps.append(reached)
        path = [goal]
        for reached in steps[:0:-1]:
            path.append(reached[path[-1]])
        return path[::-1]


def positions(paths, time):
    """The agents at a time, by cell. After its last cell an agent stays there."""
    return {path[min(time, len(path) - 1)]: who for who, path in enumerate(paths)}


if __name__ == "__main__":
    fleetyard.run(ExamplePlugin)
