#!/usr/bin/env python3
"""PIBT in Python, as a Fleetyard plugin.

Priority inheritance with backtracking (Okumura, Machida, Defago and Tamura,
"Priority Inheritance with Backtracking for Iterative Multi-agent Path Finding",
Artificial Intelligence 310, 2022): step by step, agents choose their next cells in
the order of their priorities, and an agent that stands in the way of a more
important one moves first, in that one's name.

It is fast and neither complete nor optimal: agents can get into each other's way for
ever. Then it begins again with other random choices, until the budget ends.
"""

import pathlib
import random
import sys

try:
    import fleetyard
except ImportError:  # not installed: the package lies in the same repository
    sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[3] / "abi" / "python"))
    import fleetyard


class Pibt(fleetyard.Planner):
    id = "pibt-python"
    name = "PIBT (Python example)"
    version = "0.1.0"
    license = "MIT OR Apache-2.0"
    description = "Priority inheritance with backtracking (Okumura et al. 2022), with restarts."
    capabilities = ("grid", "pebble", "deterministic")
    features = ("part:fleetyard.goal-tasks/1",)
    options_schema = {
        "type": "object",
        "additionalProperties": False,
        "properties": {
            "patience": {
                "type": "number",
                "exclusiveMinimum": 0,
                "default": 4,
                "description": "Begins again after so many times the longest distance.",
            }
        },
    }

    def plan(self, instance, budget, context):
        goals = [instance.goal(agent) for agent in range(instance.agents)]
        if len(set(instance.starts)) < len(instance.starts):
            raise fleetyard.InvalidInput("two agents start in the same cell")
        distances = []
        for agent, goal in enumerate(goals):
            distances.append(self.grid.distances(goal))
            context.check()
            if distances[agent][instance.starts[agent]] < 0:
                raise fleetyard.Infeasible(f"no path leads agent {agent} to its goal")
        longest = max(d[start] for d, start in zip(distances, instance.starts))
        # A chain of agents that make way for each other is a chain of calls.
        sys.setrecursionlimit(max(sys.getrecursionlimit(), 2 * instance.agents + 1000))
        most_steps = int(self.options["patience"] * (longest + 10))
        chance = random.Random(budget.seed)
        attempts = 0
        while True:
            attempts += 1
            steps = Steps(self.grid, instance.starts, goals, distances, chance)
            if instance.parts.goal_tasks is not None:
                steps.waited = self.ages(instance.parts.goal_tasks)
            for _ in range(most_steps):
                if steps.at == goals:
                    context.metric("attempts", attempts)
                    return steps.paths
                context.check()
                steps.step()

    def ages(self, tasks):
        """In a fleet, for how many steps agents have had their goals: the oldest goes first."""
        return [(tasks.time_s - given_s) / self.grid.step_s for given_s in tasks.given_s]


class Steps:
    """One attempt: where everybody is, and the paths so far."""

    def __init__(self, grid, starts, goals, distances, chance):
        self.grid, self.goals, self.distances, self.chance = grid, goals, distances, chance
        self.at = list(starts)
        self.paths = [[start] for start in starts]
        # Waiting raises the priority; the fractions make all priorities different.
        self.fractions = [(agent + 1) / (len(starts) + 1) for agent in range(len(starts))]
        chance.shuffle(self.fractions)
        self.waited = [d[start] for d, start in zip(distances, starts)]

    def step(self):
        self.here = {cell: agent for agent, cell in enumerate(self.at)}
        self.next, self.taken = {}, {}
        order = sorted(range(len(self.at)), key=lambda a: -self.waited[a] - self.fractions[a])
        for agent in order:
            if agent not in self.next:
                self.choose(agent)
        for agent, goal in enumerate(self.goals):
            self.at[agent] = self.next[agent]
            self.paths[agent].append(self.at[agent])
            self.waited[agent] = 0 if self.at[agent] == goal else self.waited[agent] + 1

    def choose(self, agent, by=None):
        """Takes the best cell that works out for whoever stands there. ``by`` is the
        cell of the agent that asks: to go there would be an exchange of cells."""
        here = self.at[agent]
        cells = [*self.grid.neighbors(here), here]
        self.chance.shuffle(cells)
        distance = self.distances[agent]
        cells.sort(key=lambda cell: (distance[cell], cell in self.here))
        for cell in cells:
            if cell in self.taken or cell == by:
                continue
            self.next[agent], self.taken[cell] = cell, agent
            other = self.here.get(cell)
            if other is None or other in self.next or self.choose(other, by=here):
                return True
            if self.taken.get(cell) == agent:
                del self.taken[cell]
        self.next[agent], self.taken[here] = here, agent
        return False


if __name__ == "__main__":
    fleetyard.run(Pibt)
