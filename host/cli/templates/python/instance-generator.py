#!/usr/bin/env python3
"""Gives each open task to the nearest agent that has nothing to do; the rest wait.

Tasks are given away in the order in which they came. Put your own rule into `generate`.
"""

import fleetyard


class ExamplePlugin(fleetyard.InstanceGenerator):
    """Gives each open task to the nearest agent that has nothing to do."""

    id = "example-plugin"
    version = "0.1.0"
    # What the host may ask of the generator; docs/conformance.md lists all there is.
    capabilities = ("grid", "pebble", "deterministic")
    # What `--option NAME=VALUE` may say. The host checks it before the generator starts.
    options_schema = {
        "type": "object",
        "additionalProperties": False,
        "properties": {
            "most_tasks": {
                "type": "integer",
                "minimum": 1,
                "default": 1000,
                "description": "Most tasks to give away in one call.",
            }
        },
    }

    def generate(self, state, budget, context):
        # What agents have to do they keep.
        goals = [list(open_goals) for open_goals in state.next.goals]
        cells = state.next.starts
        idle = [agent for agent, open_goals in enumerate(goals) if not open_goals]
        # Two agents cannot end in the same cell.
        ends = {open_goals[-1] for open_goals in goals if open_goals}
        # The host appends the places of these tasks to the goals of their agents.
        given = []
        for task in state.tasks[: self.options["most_tasks"]]:
            context.check()  # ends the call when its time is up
            distance = self.grid.distances(task.places[0])
            able = [agent for agent in idle if distance[cells[agent]] >= 0]
            reachable = all(distance[cell] >= 0 for cell in task.places)
            if able and reachable and task.places[-1] not in ends:
                nearest = min(able, key=lambda agent: distance[cells[agent]])
                goals[nearest] = list(task.places)
                given.append(fleetyard.Assignment(nearest, task.id))
                ends.add(task.places[-1])
                idle.remove(nearest)
        for agent in idle:
            goals[agent] = [self.place_to_wait(cells[agent], ends)]
            ends.add(goals[agent][-1])
        return state.request(goals, given)

    def place_to_wait(self, cell, ends):
        """The nearest cell where nobody ends: most often where the agent is."""
        if cell not in ends:
            return cell
        distance = self.grid.distances(cell)
        free = [near for near, steps in enumerate(distance) if steps >= 0 and near not in ends]
        if not free:
            raise fleetyard.GaveUp(f"no cell is left for the agent in cell {cell}")
        return min(free, key=distance.__getitem__)


if __name__ == "__main__":
    fleetyard.run(ExamplePlugin)
