"""The memory of a fleet, which the host keeps: modules keep none.

It comes as parts of instances and states, to plugins that list ``part:IDENTIFIER`` in their
features: :attr:`Parts.traffic` and its like.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Callable, Dict, List, Mapping, Optional

from ._numbers import number, whole

TRAFFIC = "fleetyard.traffic/1"
REST_OF_PLAN = "fleetyard.rest-of-plan/1"
GOAL_TASKS = "fleetyard.goal-tasks/1"
GUIDANCE = "fleetyard.guidance/1"
KEPT = "fleetyard.kept/1"

KEPT_LIMIT = 1 << 20
"""Most bytes that a plugin may keep."""

_RUN = re.compile("[g-m]|[0-9a-f]+")


@dataclass(frozen=True)
class Snapshot:
    """Averages of how a fleet moves, at a moment. Everything is 0 in the first one, which is
    taken when a run begins."""

    number: int
    """How many were taken before: a key for caches."""
    waiting_text: str
    """:attr:`waiting` as the wire has it."""
    flow_text: str
    """:attr:`flow` as the wire has it."""

    @cached_property
    def waiting(self) -> bytes:
        """Per place, the share of time in which somebody stood there whose goal is elsewhere, in
        units of 1/255."""
        return _expand(self.waiting_text)

    @cached_property
    def flow(self) -> bytes:
        """Per move, the flow in units of :attr:`Traffic.flow_unit_per_s`: on a grid the moves
        from cell 0 in the order of the letters ``NESW``, with 8 neighbours ``NESWnesw``, then those
        from cell 1; on a roadmap its edges."""
        return _expand(self.flow_text)

    @classmethod
    def _from_wire(cls, wire: Mapping[str, Any]) -> Snapshot:
        return cls(whole(wire["number"]), str(wire["waiting"]), str(wire["flow"]))


def _expand(text: str) -> bytes:
    """Two hexadecimal digits a byte, and a letter for a run of zeros."""
    pieces = _RUN.findall(text)
    if sum(map(len, pieces)) != len(text):
        raise ValueError("averages are hexadecimal digits and letters g to m")
    return b"".join(
        bytes(1 << (ord(piece) - ord("g"))) if piece >= "g" else bytes.fromhex(piece)
        for piece in pieces
    )


@dataclass(frozen=True)
class Traffic:
    """Averages of where robots wait, and which way they go: two snapshots of them, a period
    apart, so that a planner can turn from the one to the other bit by bit."""

    period_s: float
    """Simulated time from a snapshot to the next."""
    time_constant_s: float
    """Time constant of the exponential averages."""
    since_s: float
    """Simulated time since the last snapshot was taken, less than the period."""
    flow_unit_per_s: float
    """A flow of 1 stands for so many moves per second."""
    last: Snapshot
    before: Snapshot
    """The snapshot before the last; the same as long as there is only one."""

    @classmethod
    def _from_wire(cls, wire: Mapping[str, Any]) -> Traffic:
        times = ("period_s", "time_constant_s", "since_s", "flow_unit_per_s")
        return cls(
            *(number(wire[name]) for name in times),
            last=Snapshot._from_wire(wire["last"]),
            before=Snapshot._from_wire(wire["before"]),
        )


@dataclass(frozen=True)
class RestOfPlan:
    """What of the last plan nobody is committed to."""

    paths: List[str]
    """A letter of ``NESWnesw`` per step of an agent from its start on, ``.`` for a wait."""

    @classmethod
    def _from_wire(cls, wire: Mapping[str, Any]) -> RestOfPlan:
        return cls([str(path) for path in wire["paths"]])


@dataclass(frozen=True)
class GoalTasks:
    """The tasks that goals belong to, and since when agents have them: the goals of all agents
    one after the other, as the instance has them."""

    time_s: float
    """Simulated time since the run began."""
    tasks: List[Optional[int]]
    """The task of a goal; ``None`` for one that is of no task, or not the agent's own."""
    errands: List[Optional[int]]
    """Which of the task's places it is, from 0."""
    released_s: List[float]
    """When its task was released; for other goals as ``given_s``."""
    given_s: List[float]
    """When its task was given to the agent. A goal without a task is given when the one before it
    is reached; ``time_s`` if that is still to come."""

    @classmethod
    def _from_wire(cls, wire: Mapping[str, Any]) -> GoalTasks:
        def maybe(values: Any) -> List[Optional[int]]:
            return [None if value is None else whole(value) for value in values]

        return cls(
            number(wire["time_s"]),
            maybe(wire["tasks"]),
            maybe(wire["errands"]),
            [number(time) for time in wire["released_s"]],
            [number(time) for time in wire["given_s"]],
        )


@dataclass(frozen=True)
class Guidance:
    """A guidance graph: factors on what moves and waits cost, in units of 1/100, from 10 to 10000.
    Where it is cheap robots are to go, where it is dear they are not."""

    moves: List[int]
    """Per move, in the order of :attr:`Snapshot.flow`. Moves that the map does not have have one as
    well."""
    waits: List[int]
    """Per place, for a wait there."""

    @classmethod
    def _from_wire(cls, wire: Mapping[str, Any]) -> Guidance:
        def factors(name: str) -> List[int]:
            values = [whole(value) for value in wire[name]]
            if any(not 10 <= value <= 10_000 for value in values):
                raise ValueError(f"the factors `{name}` are not all from 10 to 10000")
            return values

        return cls(factors("moves"), factors("waits"))


READ: Dict[str, Callable[[Any], Any]] = {
    TRAFFIC: Traffic._from_wire,
    REST_OF_PLAN: RestOfPlan._from_wire,
    GOAL_TASKS: GoalTasks._from_wire,
    GUIDANCE: Guidance._from_wire,
    KEPT: bytes.fromhex,
}
"""How the data of known parts are read."""
