"""Policies that decide step by step: the SDK runs them and makes a plan of their moves."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any, ClassVar, Dict, List, NamedTuple, Optional, Sequence

from ._failures import GaveUp
from ._maps import MOVES, Grid
from ._model import Budget, Instance
from ._paths import Paths
from ._plugins import Context, Planner


class Observation(NamedTuple):
    """The situation of one agent before a step. The map is in the policy's ``grid``."""

    agent: int
    """Its number."""
    time: int
    """Steps since the start."""
    cell: int
    """The cell where it is."""
    goal: Optional[int]
    """The goal that it has to visit now; ``None`` when it has none left."""


class StepPolicy(Planner):
    """A planner for grids that decides step by step, as learned policies do.

    The SDK asks for the moves of all agents until everybody is at the last goal, turns moves
    that are illegal or would collide into waits, and hands over the plan. Where the policy
    fails, it hands over how far they came, which the host shows and counts, and does not take
    for a solution: so a policy claims ``colliding-plans``. In ``begin`` and ``act``,
    ``self.budget`` and ``self.context`` are those of the call.
    """

    most_steps: ClassVar[int] = 0
    """Steps after which the SDK gives up; 0 to go on until the call's time is up."""

    budget: Budget
    context: Context

    @classmethod
    def descriptor(cls) -> Dict[str, Any]:
        described = super().descriptor()
        claims = described["capabilities"]
        if "colliding-plans" not in claims:
            described["capabilities"] = [*claims, "colliding-plans"]
        return described

    def begin(self, instance: Instance) -> None:
        """Called once before the steps of an instance. Random choices come from
        ``self.budget.seed``."""

    @abstractmethod
    def act(self, observations: Sequence[Observation]) -> Sequence[str]:
        """The move of each agent, a letter of ``.NESWnesw`` in a string or a list. ``.``
        waits, ``N`` is up, ``n`` up and right; the others follow clockwise."""

    def plan(self, instance: Instance, budget: Budget, context: Context) -> Optional[Paths]:
        self.budget, self.context = budget, context
        paths = [[start] for start in instance.starts]
        # The goals that are left, the next one last.
        left = [goals[::-1] for goals in instance.goals]
        try:
            self._roll_out(instance, paths, left)
        except Exception:
            # How far everybody came, for those who look for the reason.
            context.incumbent(paths)
            raise
        return paths

    def _roll_out(
        self, instance: Instance, paths: List[List[int]], left: Sequence[List[int]]
    ) -> None:
        """Makes the paths longer until everybody has arrived, or the policy fails."""
        self.begin(instance)
        time = 0
        while not _arrived(paths, left):
            if instance.window_steps:
                if time == instance.window_steps or self.context.cancelled():
                    return  # what there is then is a plan for the window as well
            elif time == self.most_steps > 0:
                there = sum(not goals or path[-1] == goals[0] for path, goals in zip(paths, left))
                raise GaveUp(
                    f"{there} of {len(paths)} agents are at their last goals after {time} steps"
                )
            else:
                self.context.check()
            at = [path[-1] for path in paths]
            observations = [
                Observation(agent, time, cell, goals[-1] if goals else None)
                for agent, (cell, goals) in enumerate(zip(at, left))
            ]
            wishes = self._wishes(at, self.act(observations))
            steps = settle(self.grid, at, wishes, instance.allows_cycles, instance.strict)
            for path, cell in zip(paths, steps):
                path.append(cell)
            time += 1

    def _wishes(self, at: Sequence[int], moves: Sequence[str]) -> List[int]:
        moves = list(moves)
        if len(moves) != len(at):
            raise ValueError(f"`act` returned {len(moves)} moves, but there are {len(at)} agents")
        wishes = []
        for agent, (cell, move) in enumerate(zip(at, moves)):
            if move != "." and move not in MOVES:
                raise ValueError(f"`act` returned {move!r:.60} for agent {agent}, which is no move")
            row, col = self.grid.position(cell)
            row_step, col_step = MOVES.get(move, (0, 0))
            row, col = row + row_step, col + col_step
            inside = 0 <= row < self.grid.rows and 0 <= col < self.grid.cols
            wishes.append(self.grid.cell(row, col) if inside else cell)
        return wishes


def _arrived(paths: Sequence[Sequence[int]], left: Sequence[List[int]]) -> bool:
    """Takes away goals that are reached, but the last one of an agent, which may still be
    sent away from it. True if all are at their last goals."""
    there = True
    for path, goals in zip(paths, left):
        while len(goals) > 1 and path[-1] == goals[-1]:
            goals.pop()
        there = there and (not goals or (len(goals) == 1 and path[-1] == goals[0]))
    return there


def settle(
    grid: Grid,
    at: Sequence[int],
    wishes: Sequence[int],
    allows_cycles: bool = False,
    strict: bool = False,
) -> List[int]:
    """The cells of all agents after one step: those that they wish for, but who would make an
    illegal move or collide waits, and so do those behind. Of several agents that wish for one
    cell the first gets it. ``at`` are cells of their own; so is the result.

    ``allows_cycles`` and ``strict`` are those of the instance. On grids with eight neighbours
    who moves diagonally waits for those whose way it would cross, and who pass the same corner.
    """
    steps = list(wishes)
    standing = {cell: agent for agent, cell in enumerate(at)}
    wanting: Dict[int, List[int]] = {}
    for agent, cell in enumerate(wishes):
        wanting.setdefault(cell, []).append(agent)

    def stop(agent: int) -> None:
        """Lets an agent wait, and with it all that wish for its cell."""
        stopped = [agent]
        while stopped:
            agent = stopped.pop()
            steps[agent] = at[agent]
            behind = wanting.get(at[agent], ())
            stopped += [other for other in behind if steps[other] != at[other]]

    def mover(cell: int) -> Optional[int]:
        """The agent that leaves a cell in this step."""
        agent = standing.get(cell)
        return None if agent is None or steps[agent] == cell else agent

    for agent, (here, wish) in enumerate(zip(at, wishes)):
        if wish == here or wish not in grid.neighbors(here):
            stop(agent)
    for agents in wanting.values():
        moving = [agent for agent in agents if steps[agent] != at[agent]]
        for agent in moving[1:]:
            stop(agent)
    for agent, here in enumerate(at):
        there = steps[agent]
        ahead = mover(there)
        if there == here:
            continue
        if ahead is not None:
            if steps[ahead] == here:
                stop(agent)
                stop(ahead)
            elif strict and steps[ahead] - there != there - here:
                stop(agent)
        for origin, end in _across(grid, here, there):
            other = mover(origin)
            if other is not None and steps[other] == end:
                stop(agent)
    if not allows_cycles:
        # Nobody wishes for the cell of two, so who follows whom is a set of chains and rings.
        seen = [0] * len(at)
        for first in range(len(at)):
            follower: Optional[int] = first
            while follower is not None and not seen[follower]:
                seen[follower] = first + 1
                follower = None if steps[follower] == at[follower] else mover(steps[follower])
            if follower is not None and seen[follower] == first + 1:
                stop(follower)
    return steps


def _across(grid: Grid, here: int, there: int) -> List[List[int]]:
    """The moves that cross a diagonal move, or pass the corner that it passes, on the way
    towards it; none for a straight move."""
    row, col = grid.position(here)
    to_row, to_col = grid.position(there)
    if row == to_row or col == to_col:
        return []
    beside, other = grid.cell(to_row, col), grid.cell(row, to_col)
    return [
        [beside, other],
        [other, beside],
        [there, beside],
        [there, other],
        [beside, here],
        [other, here],
    ]
