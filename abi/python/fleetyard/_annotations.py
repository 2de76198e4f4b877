"""What a planner wants to show of its search, beside its plan."""

from __future__ import annotations

import math
from typing import Any, Callable, ClassVar, Dict, Iterable, List, Optional

from ._numbers import Point, listed, number, places, point


class Annotations:
    """Takes what a planner wants to show, from any thread. It is shown and never judged.

    Shapes have a layer by whose name they are shown or hidden together; ``agent`` is whom they are
    about, ``from_s`` and ``to_s`` when they hold, in seconds of the plan, and ``values`` a number
    for each shape, for colours. An annotation has at most 32768 shapes, and as many points or
    places together."""

    ID: ClassVar[str] = "fleetyard.annotations/1"

    def __init__(self, send: Callable[[Dict[str, Any]], None]) -> None:
        self._send = send

    def points(self, layer: str, points: Iterable[Point], **about: Any) -> None:
        """Points ``(x_m, y_m)`` in the plane, each a shape."""
        shapes = [[list(point(each))] for each in points]
        self._annotate(layer, "points", "xy_m", shapes, **about)

    def lines(self, layer: str, lines: Iterable[Iterable[Point]], **about: Any) -> None:
        """Lines from point to point."""
        self._annotate(layer, "lines", "xy_m", _points(lines), **about)

    def rings(self, layer: str, rings: Iterable[Iterable[Point]], **about: Any) -> None:
        """Lines from point to point, and back to the first."""
        self._annotate(layer, "rings", "xy_m", _points(rings), **about)

    def places(self, layer: str, shapes: Iterable[Iterable[int]], **about: Any) -> None:
        """Cells or vertices: of each shape one place, or a way from place to place."""
        shapes = [places(each, "a shape") for each in shapes]
        self._annotate(layer, "places", "places", shapes, **about)

    def _annotate(
        self,
        layer: str,
        shape: str,
        field: str,
        shapes: List[List[Any]],
        *,
        agent: Optional[int] = None,
        from_s: float = 0.0,
        to_s: Optional[float] = None,
        text: str = "",
        values: Optional[Iterable[float]] = None,
    ) -> None:
        params: Dict[str, Any] = {"layer": str(layer), "shape": shape, field: shapes}
        if agent is not None:
            params["agent"] = int(agent)
        if from_s:
            params["from_s"] = number(from_s)
        if to_s is not None and not math.isinf(to_s):
            params["to_s"] = number(to_s)
        if text:
            params["text"] = str(text)
        if values is not None:
            params["values"] = [number(value) for value in listed(values, "`values`")]
        self._send(params)


def _points(shapes: Iterable[Iterable[Point]]) -> List[List[List[float]]]:
    return [[list(point(each)) for each in shape] for shape in shapes]
