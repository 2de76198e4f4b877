"""Maps in the three representations: a grid, a roadmap, and the plane itself.

Field names are those of the wire; fields that this version does not know are ignored.
Lengths are metres, times seconds, angles radians. In the plane x goes right and y up.
"""

from __future__ import annotations

import importlib
import math
from bisect import bisect_right
from collections import deque
from dataclasses import dataclass, field
from heapq import heappop, heappush
from typing import Any, Dict, List, Mapping, Optional, Sequence, Tuple, Union

from . import _memory
from ._failures import InvalidInput, Unsupported
from ._memory import GoalTasks, Guidance, RestOfPlan, Traffic
from ._numbers import Point, finite, lists, number, numbers, places, point, same_length

MOVES = {
    "N": (-1, 0),
    "E": (0, 1),
    "S": (1, 0),
    "W": (0, -1),
    "n": (-1, 1),
    "e": (1, 1),
    "s": (1, -1),
    "w": (-1, -1),
}
"""The step of each move in rows and columns, in the order of the bits of ``Grid.moves``."""


class Parts(Dict[str, Any]):
    """Data with names, by their identifiers: ``fleetyard.NAME/REVISION``, those of others with
    a reversed domain name before it. A plugin passes over parts that it does not know. A
    critical one comes to plugins alone that list ``part:IDENTIFIER`` in their features."""

    critical: Tuple[str, ...] = ()
    """Identifiers of those that must be understood."""

    def features(self) -> List[str]:
        """The features that a plugin must list."""
        return [f"part:{identifier}" for identifier in self.critical]

    @property
    def traffic(self) -> Optional[Traffic]:
        """Averages of waiting and of flows, if the host keeps them for this plugin."""
        return self.get(_memory.TRAFFIC)

    @property
    def rest_of_plan(self) -> Optional[RestOfPlan]:
        """The rest of the last plan, if the host keeps it for this plugin."""
        return self.get(_memory.REST_OF_PLAN)

    @property
    def goal_tasks(self) -> Optional[GoalTasks]:
        """The tasks of goals, if the host keeps them for this plugin."""
        return self.get(_memory.GOAL_TASKS)

    @property
    def guidance(self) -> Optional[Guidance]:
        """The guidance graph of the map, if the run has one and this plugin reads it."""
        return self.get(_memory.GUIDANCE)

    @property
    def kept(self) -> Optional[bytes]:
        """The bytes that this plugin kept last (:meth:`Context.keep`)."""
        return self.get(_memory.KEPT)

    @classmethod
    def _from_wire(cls, wire: Mapping[str, Any]) -> Parts:
        listed = wire.get("parts") or ()
        parts = cls((str(part["id"]), _data(part)) for part in listed)
        parts.critical = tuple(str(part["id"]) for part in listed if part.get("critical"))
        return parts


def _data(part: Mapping[str, Any]) -> Any:
    read = _memory.READ.get(str(part["id"]))
    return part.get("data") if read is None else read(part["data"])


@dataclass(frozen=True)
class Grid:
    """A map of cells: row 0 is the top, column 0 the left."""

    rows: int
    cols: int
    passable: bytes
    """One byte per cell: 1 where a robot may stand, else 0."""
    terrain: str = ""
    """One letter per cell, as in the map file."""
    moves: Optional[bytes] = None
    """One byte per cell, the mask of the moves that are allowed: bit i for letter i of
    ``NESWnesw``. ``None`` where every move to a free neighbour is."""
    connectivity: int = 4
    """4 or 8 neighbours."""
    cell_size_m: float = 1.0
    step_s: float = 1.0
    """Duration of one move or wait."""
    origin_m: Point = (0.0, 0.0)
    """The lower left corner of the lower left cell in the plane."""
    name: str = ""
    """For messages."""
    digest: str = ""
    """A key for caches: equal digests, equal maps. Empty when there is none."""
    parts: Parts = field(default_factory=Parts)
    """Further data by name."""
    _neighbors: Dict[int, Tuple[int, ...]] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    @property
    def places(self) -> int:
        """Number of cells."""
        return self.rows * self.cols

    def cell(self, row: int, col: int) -> int:
        """The index of a position, which must be on the map."""
        if not (0 <= row < self.rows and 0 <= col < self.cols):
            raise IndexError(f"({row}, {col}) is not on a map of {self.rows} x {self.cols}")
        return row * self.cols + col

    def position(self, cell: int) -> Tuple[int, int]:
        """Row and column of a cell."""
        return divmod(cell, self.cols)

    def is_free(self, cell: int) -> bool:
        """True if a robot may stand in a cell."""
        return 0 <= cell < len(self.passable) and self.passable[cell] != 0

    def free_cells(self) -> List[int]:
        """Every cell where a robot may stand."""
        return [cell for cell, free in enumerate(self.passable) if free]

    def as_numpy(self) -> Any:
        """``passable`` as an array of ``bool``, rows by columns. Needs NumPy."""
        numpy = importlib.import_module("numpy")
        cells = numpy.frombuffer(self.passable, dtype=numpy.uint8)
        return cells.reshape(self.rows, self.cols) != 0

    def neighbors(self, cell: int) -> Tuple[int, ...]:
        """The cells that one move reaches. Waiting is always possible too."""
        known = self._neighbors.get(cell)
        if known is None:
            mask = self._plain(cell) if self.moves is None else self.moves[cell]
            known = self._neighbors[cell] = tuple(
                cell + row_step * self.cols + col_step
                for bit, (row_step, col_step) in enumerate(MOVES.values())
                if mask >> bit & 1
            )
        return known

    def move(self, here: int, there: int) -> str:
        """The letter of a move between cells, one of ``.NESWnesw``."""
        if here == there:
            return "."
        (row, col), (to_row, to_col) = self.position(here), self.position(there)
        for letter, step in MOVES.items():
            if step == (to_row - row, to_col - col):
                return letter
        raise ValueError(f"no move leads from cell {here} to {there}")

    def _plain(self, cell: int) -> int:
        """The mask of a cell when every move to a free neighbour is allowed."""
        if not self.passable[cell]:
            return 0
        row, col = self.position(cell)

        def free(r: int, c: int) -> bool:
            inside = 0 <= r < self.rows and 0 <= c < self.cols
            return inside and self.passable[r * self.cols + c] != 0

        mask = 0
        for bit, (dr, dc) in enumerate(MOVES.values()):
            # A diagonal move needs both cells at its side free; for a straight one
            # they are the cell itself and the target.
            if bit < self.connectivity and free(row + dr, col + dc):
                if free(row + dr, col) and free(row, col + dc):
                    mask |= 1 << bit
        return mask

    def distances(self, *goals: int) -> List[int]:
        """Steps from every cell to the nearest goal when nobody is in the way; -1
        where no path leads to one."""
        before: Any = self.neighbors
        if self.moves is not None:  # streets of one way: backwards from the goals
            leading: List[List[int]] = [[] for _ in range(self.places)]
            for cell in range(self.places):
                for near in self.neighbors(cell):
                    leading[near].append(cell)
            before = leading.__getitem__
        distance = [-1] * self.places
        for goal in goals:
            distance[goal] = 0
        queue = deque(goals)
        while queue:
            cell = queue.popleft()
            for near in before(cell):
                if distance[near] < 0:
                    distance[near] = distance[cell] + 1
                    queue.append(near)
        return distance

    def needs(self) -> List[str]:
        """The capabilities that a plugin must have to learn it."""
        needed = ["grid"]
        if self.connectivity != 4:
            needed.append("eight-connected")
        if self.moves is not None:
            needed.append("move-mask")
        return needed

    @classmethod
    def from_rows(cls, rows: Sequence[str], **fields: Any) -> Grid:
        """From one string per row, ``.`` where a robot may stand."""
        letters = "".join(rows)
        cols = len(rows[0]) if rows else 0
        if not cols or any(len(row) != cols for row in rows):
            raise ValueError("rows of a grid have one length, and there is at least one")
        fields.setdefault("terrain", letters)
        passable = bytes(letter == "." for letter in letters)
        return cls(rows=len(rows), cols=cols, passable=passable, **fields)

    @classmethod
    def _from_wire(cls, wire: Mapping[str, Any], **fields: Any) -> Grid:
        rows, cols = int(wire["rows"]), int(wire["cols"])
        if rows < 1 or cols < 1:
            raise InvalidInput(f"a grid of {rows} rows and {cols} columns has no cell")

        def flat(name: str, letters: int = 1) -> str:
            lines = wire[name]
            if len(lines) != rows or any(len(line) != cols * letters for line in lines):
                raise InvalidInput(f"`{name}` is not {rows} rows of {cols * letters} letters")
            return "".join(lines)

        moves = None
        letters = flat("passable")
        if wire.get("moves"):
            try:
                moves = bytes.fromhex(flat("moves", 2))
            except ValueError:
                moves = b""
            if len(moves) != rows * cols:
                raise InvalidInput("`moves` has other letters than hexadecimal digits")
        grid = cls(
            rows=rows,
            cols=cols,
            passable=bytes(letter == "." for letter in letters),
            terrain=flat("terrain") if wire.get("terrain") else letters,
            moves=moves,
            connectivity=int(wire["connectivity"]),
            cell_size_m=number(wire["cell_size_m"]),
            step_s=number(wire["step_s"]),
            origin_m=point(wire.get("origin_m") or (0, 0)),
            **fields,
        )
        finite("cell_size_m, step_s", (grid.cell_size_m, grid.step_s))
        finite("origin_m", grid.origin_m)
        return grid if moves is None else grid._with_checked(moves)

    def _with_checked(self, moves: bytes) -> Grid:
        """The same with ``None`` for masks that say no more than ``passable`` does."""
        plain = bytes(map(self._plain, range(self.places)))
        for cell, (mask, most) in enumerate(zip(moves, plain)):
            if mask & ~most:
                raise InvalidInput(
                    f"`moves` allows a move from cell {cell} that leads off the free cells"
                )
        if plain == moves:
            object.__setattr__(self, "moves", None)
        return self


@dataclass(frozen=True)
class Footprint:
    """The body of a robot or a mover about its origin: a disc, or a convex polygon."""

    radius_m: float
    """Radius of the disc; of a polygon, that of the smallest circle about the origin that
    encloses it."""
    corners_m: Tuple[Point, ...] = ()
    """Corners of a convex polygon, counter-clockwise; none for a disc."""

    @classmethod
    def _from_wire(cls, wire: Mapping[str, Any]) -> Footprint:
        corners = tuple(map(point, wire.get("corners_m") or ()))
        footprint = cls(number(wire["radius_m"]), corners)
        finite("footprint.radius_m", (footprint.radius_m,))
        finite("footprint.corners_m", (value for corner in corners for value in corner))
        if len(corners) in (1, 2):
            raise InvalidInput("a footprint of one or two corners")
        return footprint


@dataclass(frozen=True)
class Mover:
    """An obstacle that moves in a known way."""

    footprint: Footprint
    knots: Tuple[Tuple[float, float, float, float], ...]
    """``(time_s, x_m, y_m, heading_rad)``, times ascending. It moves linearly between knots
    and rests before the first and after the last."""

    def pose(self, time_s: float) -> Tuple[float, float, float]:
        """``(x_m, y_m, heading_rad)`` at a time."""
        after = bisect_right([knot[0] for knot in self.knots], time_s)
        if after in (0, len(self.knots)):
            return self.knots[min(after, len(self.knots) - 1)][1:]
        one, two = self.knots[after - 1], self.knots[after]
        share = (time_s - one[0]) / (two[0] - one[0])
        x_m, y_m, heading_rad = (a + share * (b - a) for a, b in zip(one[1:], two[1:]))
        return x_m, y_m, heading_rad


@dataclass(frozen=True)
class Workspace:
    """Free space: bounds without obstacles."""

    min_m: Point
    """Lower left corner."""
    max_m: Point
    """Upper right corner."""
    obstacles: List[List[Point]] = field(default_factory=list)
    """Corners of simple polygons, counter-clockwise."""
    movers: List[Mover] = field(default_factory=list)
    """Obstacles that move."""
    name: str = ""
    """For messages."""
    digest: str = ""
    """A key for caches: equal digests, equal maps. Empty when there is none."""
    parts: Parts = field(default_factory=Parts)
    """Further data by name."""

    places = None
    """There are no places in the plane."""

    def needs(self) -> List[str]:
        """The capabilities that a plugin must have to learn it."""
        return ["continuous"]

    @classmethod
    def _from_wire(cls, wire: Mapping[str, Any], **fields: Any) -> Workspace:
        movers = []
        for at, mover in enumerate(wire.get("movers") or ()):
            knots = []
            for knot in mover["knots"]:
                time_s, x_m, y_m, heading_rad = numbers(knot)
                knots.append((time_s, x_m, y_m, heading_rad))
            finite("movers", (value for knot in knots for value in knot))
            if not knots or any(one[0] > two[0] for one, two in zip(knots, knots[1:])):
                raise InvalidInput(f"mover {at} has no knots, or its times do not ascend")
            movers.append(Mover(Footprint._from_wire(mover["footprint"]), tuple(knots)))
        workspace = cls(
            min_m=point(wire["min_m"]),
            max_m=point(wire["max_m"]),
            obstacles=lists(wire.get("obstacles") or (), point),
            movers=movers,
            **fields,
        )
        finite("min_m", workspace.min_m)
        finite("max_m", workspace.max_m)
        for at, corners in enumerate(workspace.obstacles):
            finite("obstacles", (value for corner in corners for value in corner))
            if len(corners) < 3:
                raise InvalidInput(f"obstacle {at} has fewer than three corners")
        return workspace


@dataclass(frozen=True)
class Roadmap:
    """A map of vertices in the plane, and directed edges that are driven straight."""

    x_m: List[float]
    """x of every vertex."""
    y_m: List[float]
    """y of every vertex."""
    edges: List[List[int]]
    """For each vertex the ends of its edges, ascending."""
    length_m: List[List[float]]
    """Length of each edge, as ``edges`` has them."""
    duration_s: List[List[float]]
    """Time that each edge takes at full speed, as ``edges`` has them."""
    speed_m_per_s: float
    """Full speed."""
    separation_m: float
    """The least distance of two robots' centres at any time."""
    workspace: Optional[Workspace] = None
    """The world in which the roadmap lies, for those who want to look."""
    name: str = ""
    """For messages."""
    digest: str = ""
    """A key for caches: equal digests, equal maps. Empty when there is none."""
    parts: Parts = field(default_factory=Parts)
    """Further data by name."""

    @property
    def places(self) -> int:
        """Number of vertices."""
        return len(self.x_m)

    def point(self, vertex: int) -> Point:
        """The place of a vertex in the plane."""
        return self.x_m[vertex], self.y_m[vertex]

    def drives(self, vertex: int) -> List[Tuple[int, float]]:
        """The vertices that an edge leads to, each with the time at full speed."""
        return list(zip(self.edges[vertex], self.duration_s[vertex]))

    def durations(self, *goals: int) -> List[float]:
        """Seconds from every vertex to the nearest goal at full speed when nobody is in the
        way; infinite where no edges lead to one."""
        leading: List[List[Tuple[int, float]]] = [[] for _ in self.x_m]
        for vertex in range(self.places):
            for target, seconds in self.drives(vertex):
                leading[target].append((vertex, seconds))
        duration = [math.inf] * self.places
        heap: List[Tuple[float, int]] = []
        for goal in goals:
            duration[goal] = 0.0
            heappush(heap, (0.0, goal))
        while heap:
            reached, vertex = heappop(heap)
            if reached > duration[vertex]:
                continue
            for before, seconds in leading[vertex]:
                if reached + seconds < duration[before]:
                    duration[before] = reached + seconds
                    heappush(heap, (duration[before], before))
        return duration

    def needs(self) -> List[str]:
        """The capabilities that a plugin must have to learn it."""
        return ["roadmap"]

    @classmethod
    def straight(
        cls,
        points: Sequence[Point],
        edges: Sequence[Sequence[int]],
        speed_m_per_s: float,
        separation_m: float,
        **fields: Any,
    ) -> Roadmap:
        """A roadmap whose edges are as long as they look, and take as long as that says."""
        length = [
            [math.dist(points[vertex], points[target]) for target in targets]
            for vertex, targets in enumerate(edges)
        ]
        fields.setdefault("duration_s", [[m / speed_m_per_s for m in each] for each in length])
        return cls(
            x_m=[x_m for x_m, _ in points],
            y_m=[y_m for _, y_m in points],
            edges=[list(targets) for targets in edges],
            length_m=length,
            speed_m_per_s=speed_m_per_s,
            separation_m=separation_m,
            **fields,
        )

    @classmethod
    def _from_wire(cls, wire: Mapping[str, Any], **fields: Any) -> Roadmap:
        x_m, y_m = numbers(wire["x_m"]), numbers(wire["y_m"])
        edges = [places(targets) for targets in wire["edges"]]
        speed, separation = number(wire["speed_m_per_s"]), number(wire["separation_m"])
        vertices = len(x_m)
        if not vertices:
            raise InvalidInput("a roadmap has no vertex or too many")
        same_length("y_m", len(y_m), vertices)
        same_length("edges", len(edges), vertices)
        finite("x_m", x_m)
        finite("y_m", y_m)
        finite("speed_m_per_s, separation_m", (speed, separation))
        if not speed > 0:
            raise InvalidInput("`speed_m_per_s` is not positive")
        for vertex, targets in enumerate(edges):
            for target in targets:
                if not 0 <= target < vertices:
                    raise InvalidInput(
                        f"an edge goes from vertex {vertex} to {target}, but there are "
                        f"{vertices} vertices"
                    )
            if any(one >= two for one, two in zip(targets, targets[1:])):
                raise InvalidInput(f"the edges of vertex {vertex} do not ascend")
        roadmap = cls.straight(list(zip(x_m, y_m)), edges, speed, separation, **fields)

        def per_edge(name: str, otherwise: List[List[float]]) -> List[List[float]]:
            flat = numbers(wire.get(name) or ())
            if not flat:
                return otherwise
            same_length(name, len(flat), sum(map(len, edges)))
            finite(name, flat)
            rest = iter(flat)
            return [[next(rest) for _ in targets] for targets in edges]

        length = per_edge("length_m", roadmap.length_m)
        durations = [[m / speed for m in each] for each in length]
        world = wire.get("workspace")
        return cls(
            x_m=x_m,
            y_m=y_m,
            edges=edges,
            length_m=length,
            duration_s=per_edge("duration_s", durations),
            speed_m_per_s=speed,
            separation_m=separation,
            workspace=None if world is None else Workspace._from_wire(world),
            **fields,
        )


Environment = Union[Grid, Roadmap, Workspace]
"""A map in one of its representations."""

_VIEWS: Dict[str, Tuple[str, Any]] = {
    "grid": ("grid", Grid._from_wire),
    "roadmap": ("roadmap", Roadmap._from_wire),
    "continuous": ("workspace", Workspace._from_wire),
}


def environment_from_wire(wire: Mapping[str, Any]) -> Environment:
    """The map of a message."""
    representation = wire["representation"]
    if representation not in _VIEWS:
        raise Unsupported(f"the representation `{representation}` is unknown")
    view, read = _VIEWS[representation]
    if wire.get(view) is None:
        raise ValueError(f"an environment without `{view}`")
    environment: Environment = read(
        wire[view],
        name=str(wire.get("name") or ""),
        digest=str(wire.get("digest") or ""),
        parts=Parts._from_wire(wire),
    )
    return environment
