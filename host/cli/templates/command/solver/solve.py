#!/usr/bin/env python3
"""A small solver for MovingAI files, which knows nothing of Fleetyard.

It stands for your own: prioritized planning (Erdmann and Lozano-Perez, "On Multiple Moving
Objects", Algorithmica 1987), neither complete nor optimal.

    solve.py --map MAP --scen SCEN --agents N --output PATHS

Exit codes: 0 solved, 1 no order of the agents worked, 3 the time was up.
"""

import argparse
import sys
import time


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--map", required=True)
    parser.add_argument("--scen", required=True)
    parser.add_argument("--agents", type=int, required=True)
    parser.add_argument("--output", required=True)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--attempts", type=int, default=100)
    arguments = parser.parse_args()
    deadline = time.monotonic() + arguments.seconds
    free = read_map(arguments.map)
    agents = read_scenario(arguments.scen)[: arguments.agents]
    paths = solve(free, agents, arguments.attempts, deadline)
    if paths is None:
        sys.exit(3 if time.monotonic() >= deadline else 1)
    with open(arguments.output, "w") as file:
        for agent, path in enumerate(paths):
            cells = "".join(f"({row},{col})->" for row, col in path)
            file.write(f"Agent {agent}: {cells}\n")


def read_map(path):
    """The free cells of a map, as (row, col)."""
    with open(path) as file:
        rows = file.read().split("map\n", 1)[1].splitlines()
    return {(r, c) for r, row in enumerate(rows) for c, letter in enumerate(row) if letter in ".GS"}


def read_scenario(path):
    """Start and goal of every agent, as (row, col). The file has columns before rows."""
    with open(path) as file:
        lines = [line.split() for line in file.readlines()[1:] if line.strip()]
    return [((int(y), int(x)), (int(v), int(u))) for _, _, _, _, x, y, u, v, _ in lines]


def solve(free, agents, attempts, deadline):
    """One path per agent, or None."""
    order = list(range(len(agents)))
    for attempt in range(1, attempts + 1):
        paths = {}
        for agent in order:
            path = find_path(free, *agents[agent], list(paths.values()), deadline)
            if path is None:
                break
            paths[agent] = path
        else:
            print(f"attempts: {attempt}")
            return [paths[agent] for agent in range(len(agents))]
        if not paths or time.monotonic() >= deadline:
            return None
        # Who found no path goes first, and who went first goes last.
        order.remove(agent)
        order = [agent, *order[1:], order[0]]
    return None


def find_path(free, start, goal, others, deadline):
    """A shortest path that meets none of the others, or None."""
    # steps[t] has every cell where the agent can be at time t, and where it was before.
    steps = [{start: None}]
    # At the goal it stays: nobody may come by later.
    while goal not in steps[-1] or any(goal in path[len(steps) :] for path in others):
        if time.monotonic() >= deadline:
            return None
        now = len(steps)
        before, after = positions(others, now - 1), positions(others, now)
        reached = {}
        for row, col in steps[-1]:
            near_by = [(row - 1, col), (row, col + 1), (row + 1, col), (row, col - 1), (row, col)]
            for near in near_by:
                swap = near in before and after.get((row, col)) == before[near]
                if near in free and near not in after and not swap:
                    reached.setdefault(near, (row, col))
        # Once the others stand still, what is not reached now never will be.
        still = all(len(path) < now for path in others)
        if not reached or (still and len(reached) == len(steps[-1])):
            return None
        steps.append(reached)
    path = [goal]
    for reached in steps[:0:-1]:
        path.append(reached[path[-1]])
    return path[::-1]


def positions(paths, step):
    """Who is where at a step, by cell. After its last cell an agent stays there."""
    return {path[min(step, len(path) - 1)]: who for who, path in enumerate(paths)}


if __name__ == "__main__":
    main()
