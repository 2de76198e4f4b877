#!/usr/bin/env python3
"""Single-agent grid search in Python: five planners in one file.

A* (Hart, Nilsson and Raphael 1968), Dijkstra's algorithm (1959), breadth-first search
(Moore 1959), greedy best-first search (Doran and Michie 1966) and weighted A* (Pohl
1970), with nothing but the standard library. They count expansions as the built-in
planners of the same names do, and expand the same cells in the same order: what is
left to compare is what the language costs.
"""

import pathlib
import sys
from collections import deque
from heapq import heappop, heappush

try:
    import fleetyard
except ImportError:  # not installed: the package lies in the same repository
    sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[3] / "abi" / "python"))
    import fleetyard

LOOK_EVERY = 1024
"""Expansions between two looks at the clock."""


class GridSearch(fleetyard.Planner):
    """The part that the five share: one agent, four neighbours, one goal."""

    version = "0.1.0"
    license = "MIT OR Apache-2.0"
    capabilities = ("grid", "pebble", "deterministic")

    def prepare(self, grid, budget, context):
        self.around = [self.near(cell) for cell in range(grid.rows * grid.cols)]

    def near(self, cell):
        """The neighbours of a cell, in the order in which they are found."""
        return self.grid.neighbors(cell)

    def plan(self, instance, budget, context):
        if instance.agents != 1:
            raise fleetyard.Unsupported(
                f"this planner plans for one agent, the instance has {instance.agents}"
            )
        start, goal = instance.starts[0], instance.goal(0)
        for what, cell in (("start", start), ("goal", goal)):
            if not self.grid.is_free(cell):
                raise fleetyard.InvalidInput(f"the {what}, cell {cell}, is not free")
        self.budget, self.context = budget, context
        self.expansions = 0
        parents = self.search(start, goal)
        context.metric("expansions", self.expansions)
        if parents is None:
            raise fleetyard.Infeasible("the goal cannot be reached")
        if context.annotations:
            self.show(parents, context.annotations)
        path = [goal]
        while path[-1] != start:
            path.append(parents[path[-1]])
        path.reverse()
        return [path]

    def show(self, parents, annotations):
        """The tree of the search, an edge from each cell's parent to it."""
        edges = [(parent, cell) for cell, parent in parents.items() if parent != cell]
        for first in range(0, len(edges), 10_000):  # an annotation has at most 32768 places
            annotations.places("tree", edges[first : first + 10_000], agent=0)

    def expand(self):
        """Counts an expansion, and looks at the limits now and then."""
        if self.expansions % LOOK_EVERY == 0:
            self.context.check()
        if self.budget.nodes and self.expansions >= self.budget.nodes:
            raise fleetyard.GaveUp("the node limit was reached")
        self.expansions += 1

    def search(self, start, goal):
        """The parents of all cells that were found, or None if the goal was not."""
        raise NotImplementedError


class BestFirst(GridSearch):
    """Expands the cell with the least cost * g + weight * h first, then the one with
    the lower h if `low_h`, then the one that was found first."""

    cost, weight, low_h = 1, 1, False
    reopen = True
    """True if a shorter path to a cell that was expanded counts."""

    def search(self, start, goal):
        cols = self.grid.cols
        goal_row, goal_col = divmod(goal, cols)
        cost, weight, low_h, around = self.cost, self.weight, self.low_h, self.around
        parents, costs, closed = {}, {start: 0}, set()
        found = 0
        heap = [(0, 0, found, start)]
        while heap:
            here = heappop(heap)[3]
            if here in closed:
                continue
            self.expand()
            closed.add(here)
            if here == goal:
                return parents
            reached = costs[here] + 1
            for cell in around[here]:
                if reached >= costs.get(cell, reached + 1):
                    continue
                if cell in closed and not self.reopen:
                    continue
                costs[cell] = reached
                parents[cell] = here
                row, col = divmod(cell, cols)
                left = abs(row - goal_row) + abs(col - goal_col)
                found += 1
                closed.discard(cell)
                priority = cost * reached + weight * left
                heappush(heap, (priority, left if low_h else 0, found, cell))
        return None


class Astar(BestFirst):
    id = "astar-python"
    name = "A* (Python example)"
    description = "A*: the cell with the least f = g + h first (Hart, Nilsson, Raphael 1968)."
    low_h = True


class Dijkstra(BestFirst):
    id = "dijkstra-python"
    name = "Dijkstra (Python example)"
    description = "Dijkstra's algorithm: the cell nearest to the start first (Dijkstra 1959)."
    weight = 0


class Greedy(BestFirst):
    id = "greedy-best-first-python"
    name = "Greedy best-first search (Python example)"
    description = "The cell that seems nearest to the goal first (Doran, Michie 1966)."
    cost, reopen = 0, False


class WeightedAstar(BestFirst):
    id = "weighted-astar-python"
    name = "Weighted A* (Python example)"
    description = "The cell with the least f = g + w * h first (Pohl 1970)."
    options_schema = {
        "type": "object",
        "additionalProperties": False,
        "properties": {
            "weight": {
                "type": "number",
                "minimum": 1,
                "default": 1.5,
                "description": "What the estimate is multiplied by: paths are at most so many "
                "times as long as the shortest.",
            }
        },
    }

    def __init__(self, options):
        super().__init__(options)
        self.weight = self.options["weight"]
        if not self.weight >= 1:
            raise fleetyard.InvalidInput("options: `weight` has to be at least 1")

    def near(self, cell):
        # As the built-in planner: those above and below first.
        return sorted(super().near(cell), key=lambda other: (abs(other - cell) == 1, other))


class BreadthFirst(GridSearch):
    id = "bfs-python"
    name = "Breadth-first search (Python example)"
    description = "The cells in the order in which they are found (Moore 1959)."

    def search(self, start, goal):
        parents, queue = {start: start}, deque([start])
        while queue:
            here = queue.popleft()
            self.expand()
            if here == goal:
                return parents
            for cell in self.around[here]:
                if cell not in parents:
                    parents[cell] = here
                    queue.append(cell)
        return None


if __name__ == "__main__":
    fleetyard.run(Astar, Dijkstra, Greedy, WeightedAstar, BreadthFirst)
