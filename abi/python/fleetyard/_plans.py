"""Plans in each of their forms, on the wire and as an author has them.

A plan on a grid is a list of paths (:mod:`._paths`), on a roadmap a list of visits per agent,
in the plane a list of knots per agent, or a :class:`Motion` with controls.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import (
    Any,
    Dict,
    Iterable,
    List,
    Mapping,
    NamedTuple,
    Optional,
    Sequence,
    Set,
    SupportsIndex,
    Tuple,
    Union,
)

from . import _paths
from ._maps import Environment, Grid, Roadmap, Workspace
from ._model import OFF_MAP, Instance
from ._numbers import number, whole
from ._paths import Paths

Seconds = Union[float, SupportsIndex]


class Visit(NamedTuple):
    """The time that an agent spends at a vertex of a roadmap. It drives straight and evenly
    to the next one."""

    vertex: int
    arrival_s: float
    """When the agent arrives; 0 at its start."""
    departure_s: float
    """When it leaves; of the last visit, no earlier than the arrival."""


class Knot(NamedTuple):
    """A moment of a path in the plane, between which position and heading are linear in
    time."""

    time_s: float
    """0 of the first knot."""
    x_m: float
    y_m: float
    heading_rad: float = math.nan
    """Counter-clockwise and unwrapped; NaN where the robot has none."""


Visits = Iterable[Iterable[Union[Visit, Sequence[Seconds]]]]
"""A plan on a roadmap: per agent its visits, in order. It stays at the last."""

class Segment(NamedTuple):
    """A control that is held for a time."""

    duration_s: float
    control: Sequence[float]
    """As the robot's dynamics say, all of one agent of the same length."""


@dataclass
class Motion:
    """The motion of an agent in the plane by controls, from the state at its start on. With
    ``knots`` it moves by these, and its controls have to lead there."""

    controls: Optional[Iterable[Union[Segment, Tuple[Seconds, Sequence[Seconds]]]]] = None
    """One after the other; without any it stays at its start."""
    knots: Iterable[Union[Knot, Sequence[Seconds]]] = field(default_factory=list)


Trajectories = Iterable[Union[Motion, Iterable[Union[Knot, Sequence[Seconds]]]]]
"""A plan in the plane: per agent its knots, in order, or a :class:`Motion`. It rests at the
last."""

Plan = Union[Paths, Visits, Trajectories]
"""A plan of any form."""


class Form:
    """The form of the plans for an instance."""

    def __init__(self, environment: Environment, instance: Instance) -> None:
        self._environment, self._instance = environment, instance
        fields = {Grid: "paths", Roadmap: "visits", Workspace: "trajectories"}
        self.field = fields[type(environment)]
        """The field of a message that has a plan."""

    def encode(self, plan: Any) -> List[Any]:
        """The plan as the wire has it; fails for what is none."""
        if isinstance(self._environment, Grid):
            rows, cols = self._environment.rows, self._environment.cols
            return _paths.encode(plan, self._instance.starts, rows, cols)
        lists = _per_agent(plan, self._instance.agents, self.field)
        if self.field == "visits":
            return [_entries(_visit, agent, own) for agent, own in enumerate(lists)]
        return [_motion(agent, own) for agent, own in enumerate(lists)]

    def decode(self, wire: Mapping[str, Any]) -> Any:
        """The plan of a message, if it has one."""
        for other in ("paths", "visits", "trajectories"):
            if other != self.field and wire.get(other) is not None:
                raise ValueError(
                    f"a plan of another form than `{self.field}`, which this map takes"
                )
        plan = wire.get(self.field)
        if plan is None:
            return None
        if isinstance(self._environment, Grid):
            rows, cols = self._environment.rows, self._environment.cols
            return _paths.decode(plan, self._instance.starts, rows, cols)
        if self.field == "visits":
            return [[_read_visit(*visit) for visit in own] for own in plan]
        return [_read_motion(own) for own in plan]


def _per_agent(plan: Any, agents: int, field: str) -> List[List[Any]]:
    def as_list(value: Any, what: str) -> List[Any]:
        value = getattr(value, "tolist", lambda: value)()
        if isinstance(value, (str, bytes, Mapping, Set)) or not hasattr(value, "__iter__"):
            raise TypeError(f"{what} is not a list but {value!r:.60}")
        return list(value)

    lists = as_list(plan, "the plan")
    if len(lists) != agents:
        raise ValueError(f"the plan has {len(lists)} {field}, but the instance has {agents} agents")
    return [
        own if isinstance(own, Motion) else as_list(own, f"{field} of agent {agent}")
        for agent, own in enumerate(lists)
    ]


def _entries(write: Any, agent: int, own: Iterable[Any]) -> List[List[Any]]:
    return [_entry(write, agent, at, item) for at, item in enumerate(own)]


def _motion(agent: int, own: Any) -> Any:
    if not isinstance(own, Motion):
        return _entries(_knot, agent, own)
    wire: Dict[str, Any] = {}
    knots = _entries(_knot, agent, own.knots)
    if knots:
        wire["knots"] = knots
    if own.controls is not None or not knots:
        wire["controls"] = _entries(_segment, agent, own.controls or ())
        sizes = {len(segment) for segment in wire["controls"]}
        if len(sizes) > 1:
            raise ValueError(f"the controls of agent {agent} differ in length")
    return wire


def _read_motion(own: Any) -> Any:
    if not isinstance(own, Mapping):
        return [Knot(*map(number, knot)) for knot in own]
    controls = own.get("controls")
    return Motion(
        controls=controls
        and [Segment(number(each[0]), [number(value) for value in each[1:]]) for each in controls],
        knots=[Knot(*map(number, knot)) for knot in own.get("knots") or ()],
    )


def _entry(write: Any, agent: int, at: int, item: Any) -> List[Any]:
    try:
        entry: List[Any] = write(*item)
        if not all(map(math.isfinite, entry)):
            raise ValueError
        return entry
    except (TypeError, ValueError):
        wanted = {
            _visit: "(vertex, arrival_s, departure_s)",
            _knot: "(time_s, x_m, y_m) with or without heading_rad",
            _segment: "(duration_s, control)",
        }[write]
        raise TypeError(
            f"the plan of agent {agent} has {item!r:.60} at place {at}, which is no {wanted}"
        ) from None


def _visit(vertex: Any, arrival_s: Any, departure_s: Any) -> List[Any]:
    if isinstance(vertex, float) and vertex.is_integer():  # a row of an array of floats
        vertex = int(vertex)
    return [whole(vertex), number(arrival_s), number(departure_s)]


def _knot(time_s: Any, x_m: Any, y_m: Any, heading_rad: Any = math.nan) -> List[Any]:
    knot = [number(time_s), number(x_m), number(y_m)]
    heading_rad = math.nan if heading_rad is None else number(heading_rad)
    return knot if math.isnan(heading_rad) else [*knot, heading_rad]


def _segment(duration_s: Any, control: Any) -> List[Any]:
    control = getattr(control, "tolist", lambda: control)()
    return [number(duration_s), *map(number, control)]


def _read_visit(vertex: Any, arrival_s: Any, departure_s: Any) -> Visit:
    # A vertex that is on no roadmap is a fault of the plan, not of its text.
    vertex = whole(vertex)
    return Visit(vertex if vertex >= 0 else OFF_MAP, number(arrival_s), number(departure_s))
