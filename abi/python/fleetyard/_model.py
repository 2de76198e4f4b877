"""Input of a plugin, as dataclasses, and the ways in which a call fails.

Field names are those of the wire. Cells are indices, ``row * cols + col``, with row
0 at the top; fields that this version does not know are ignored.
"""

from __future__ import annotations

import importlib
import operator
import time
from collections import deque
from dataclasses import dataclass, field, replace
from typing import Any, Dict, List, Mapping, Optional, Sequence, Tuple

OFF_MAP = -1
"""The cell of a position that is on no map, in paths from a failed planner."""


class Failure(Exception):
    """Ends a call with a status other than solved, and says why."""

    status = "internal-error"

    def __init__(self, message: str) -> None:
        super().__init__(message)
        self.message = message


class Infeasible(Failure):
    """The instance has no solution, and the planner proved it."""

    status = "infeasible"


class TimedOut(Failure):
    """The budget ran out."""

    status = "timed-out"


class GaveUp(Failure):
    """The planner stopped trying without a proof."""

    status = "gave-up"


class Cancelled(Failure):
    """The call ended because the host asked for it."""

    status = "cancelled"


class Unsupported(Failure):
    """The plugin cannot handle this kind of instance, map or option."""

    status = "unsupported"


class InvalidInput(Failure):
    """The input contradicts itself."""

    status = "invalid-input"


class InternalError(Failure):
    """The plugin failed. Any other exception means the same."""


@dataclass(frozen=True)
class Budget:
    """Limits of one call. The host enforces them."""

    deadline_monotonic_ns: int
    """When the call must have returned, on the clock of ``time.monotonic_ns()``."""
    wall_ns: int
    """Length of the budget when the call began."""
    nodes: int = 0
    """Most search nodes to expand; 0 for no limit."""
    memory_bytes: int = 0
    """Most memory to use; 0 for no limit."""
    threads: int = 1
    """Most threads to use at a time."""
    seed: int = 0
    """Seed of every random choice."""

    def remaining_s(self) -> float:
        """Seconds until the deadline; negative once it has passed."""
        return (self.deadline_monotonic_ns - time.monotonic_ns()) * 1e-9

    def expired(self) -> bool:
        """True once the deadline has passed."""
        return time.monotonic_ns() >= self.deadline_monotonic_ns

    def ending(self) -> bool:
        """True when it is time to answer: a fiftieth of the budget before the deadline, but
        at least 1 ms and at most 100 ms, because a late answer does not count."""
        reserve = min(max(self.wall_ns // 50, 1_000_000), 100_000_000)
        return time.monotonic_ns() >= self.deadline_monotonic_ns - reserve

    @classmethod
    def _from_wire(cls, wire: Mapping[str, Any]) -> Budget:
        return cls(
            deadline_monotonic_ns=int(wire["deadline_monotonic_ns"]),
            wall_ns=int(wire["wall_ns"]),
            nodes=int(wire.get("nodes", 0)),
            memory_bytes=int(wire.get("memory_bytes", 0)),
            threads=max(1, int(wire.get("threads", 1))),
            seed=int(wire.get("seed", 0)),
        )


@dataclass(frozen=True)
class Grid:
    """A map: row 0 is the top, column 0 the left."""

    rows: int
    cols: int
    passable: bytes
    """One byte per cell: 1 where a robot may stand, else 0."""
    terrain: str = ""
    """One letter per cell, as in the map file."""
    map_name: str = ""
    connectivity: int = 4
    """4 or 8 neighbours."""
    cell_size_m: float = 1.0
    step_s: float = 1.0
    """Duration of one move or wait."""
    _neighbors: Dict[int, Tuple[int, ...]] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )

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
            known = self._neighbors[cell] = tuple(self._moves(cell))
        return known

    def _moves(self, cell: int) -> List[int]:
        row, col = self.position(cell)

        def free(r: int, c: int) -> bool:
            inside = 0 <= r < self.rows and 0 <= c < self.cols
            return inside and self.passable[r * self.cols + c] != 0

        moves = [(-1, 0), (0, 1), (1, 0), (0, -1)]
        if self.connectivity == 8:
            moves += [(-1, 1), (1, 1), (1, -1), (-1, -1)]
        # A diagonal move needs both cells at its side free; for a straight one
        # they are the cell itself and the target.
        return [
            (row + dr) * self.cols + col + dc
            for dr, dc in moves
            if free(row + dr, col + dc)
            and (dr == 0 or dc == 0 or (free(row + dr, col) and free(row, col + dc)))
        ]

    def distances(self, *goals: int) -> List[int]:
        """Steps from every cell to the nearest goal when nobody is in the way; -1
        where no path leads to one."""
        distance = [-1] * (self.rows * self.cols)
        for goal in goals:
            distance[goal] = 0
        queue = deque(goals)
        while queue:
            cell = queue.popleft()
            for near in self.neighbors(cell):
                if distance[near] < 0:
                    distance[near] = distance[cell] + 1
                    queue.append(near)
        return distance

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
    def _from_wire(cls, wire: Mapping[str, Any]) -> Grid:
        if wire["representation"] != "grid":
            raise Unsupported(f"this plugin knows grids, not {wire['representation']!r}")
        rows, cols = int(wire["rows"]), int(wire["cols"])

        def flat(name: str, lines: Sequence[str]) -> str:
            if len(lines) != rows or any(len(line) != cols for line in lines):
                raise ValueError(f"`{name}` is not {rows} rows of {cols} letters")
            return "".join(lines)

        letters = flat("passable", wire["passable"])
        terrain = wire.get("terrain")
        return cls(
            rows=rows,
            cols=cols,
            passable=bytes(letter == "." for letter in letters),
            terrain=flat("terrain", terrain) if terrain else letters,
            map_name=str(wire.get("map_name", "")),
            connectivity=int(wire["connectivity"]),
            cell_size_m=float(wire["cell_size_m"]),
            step_s=float(wire["step_s"]),
        )


@dataclass
class Assignment:
    """A task that an instance generator gives to an agent."""

    agent: int
    """Number of the agent."""
    task: int
    """Identifier of one of the open tasks."""


@dataclass
class Instance:
    """An instance: the input of a planner, on the map it was prepared for."""

    starts: List[int]
    """Start cell of every agent."""
    goals: List[List[int]]
    """Goal cells of every agent, to be visited in order; at least one each."""
    headings: Optional[List[str]] = None
    """Start headings (east, south, west, north), when they matter."""
    motion: str = "pebble"
    """``pebble``, or ``rotation`` where turning by 90 degrees takes a step."""
    objective: str = "sum-of-costs"
    """``sum-of-costs`` or ``makespan``."""
    window_steps: int = 0
    """Collisions after this many steps do not matter, and paths may end before their goals;
    0 for a complete plan."""
    radius_m: float = 0.0
    """Radius of the largest robot's enclosing circle."""
    allows_cycles: bool = True
    """True if three or more agents may move round in a ring in one step, each into the cell
    that the next one leaves. Plans for a fleet must not."""
    assignments: List[Assignment] = field(default_factory=list)
    """Tasks that an instance generator gives to agents: the host appends the cells of a task
    to the goals of its agent."""

    @property
    def agents(self) -> int:
        """Number of agents."""
        return len(self.starts)

    def goal(self, agent: int) -> int:
        """The last goal of an agent: where its path should end."""
        return self.goals[agent][-1]

    @classmethod
    def _from_wire(cls, wire: Mapping[str, Any], grid: Grid) -> Instance:
        headings = wire.get("headings")
        instance = cls(
            starts=_cells(wire["starts"]),
            goals=[_cells(goals) for goals in wire["goals"]],
            headings=None if headings is None else [str(heading) for heading in headings],
            motion=str(wire.get("motion", "pebble")),
            objective=str(wire.get("objective", "sum-of-costs")),
            window_steps=int(wire.get("window_steps", 0)),
            radius_m=float(wire.get("radius_m", 0.0)),
            allows_cycles=bool(wire.get("allows_cycles", True)),
            assignments=[
                Assignment(agent=int(given["agent"]), task=int(given["task"]))
                for given in wire.get("assignments", ())
            ],
        )
        instance._check(grid)
        return instance

    def _plain(self) -> Instance:
        """The same with lists of numbers, whatever an author has put in."""
        goals = getattr(self.goals, "tolist", lambda: self.goals)()
        if isinstance(goals, (str, bytes)) or not hasattr(goals, "__iter__"):
            raise TypeError(f"`goals` is no list with one list per agent but {goals!r:.60}")
        return replace(
            self,
            starts=_cells(self.starts, "`starts`"),
            goals=[_cells(each, f"`goals` of agent {agent}") for agent, each in enumerate(goals)],
            headings=None if self.headings is None else list(self.headings),
            allows_cycles=bool(self.allows_cycles),
            assignments=[
                Assignment(agent=whole(given.agent), task=whole(given.task))
                for given in self.assignments
            ],
        )

    def _check(self, grid: Grid) -> None:
        if not self.starts or len(self.goals) != len(self.starts):
            raise ValueError(f"{len(self.starts)} starts but {len(self.goals)} goal lists")
        if self.headings is not None and len(self.headings) != len(self.starts):
            raise ValueError("`headings` has another length than `starts`")
        cells = grid.rows * grid.cols
        for agent, goals in enumerate(self.goals):
            if not goals:
                raise ValueError(f"agent {agent} has no goal")
            for cell in (self.starts[agent], *goals):
                if not 0 <= cell < cells:
                    raise ValueError(
                        f"agent {agent}: cell {cell} is not on a map of {cells} cells"
                    )
        for given in self.assignments:
            if not 0 <= given.agent < len(self.starts):
                raise ValueError(
                    f"task {given.task} is given to agent {given.agent}, but there are "
                    f"{len(self.starts)} agents"
                )

    def _to_wire(self) -> Dict[str, Any]:
        wire: Dict[str, Any] = {
            "starts": self.starts,
            "goals": self.goals,
            "motion": self.motion,
            "objective": self.objective,
            "window_steps": self.window_steps,
            "radius_m": self.radius_m,
            "allows_cycles": self.allows_cycles,
        }
        if self.headings is not None:
            wire["headings"] = self.headings
        if self.assignments:
            wire["assignments"] = [
                {"agent": given.agent, "task": given.task} for given in self.assignments
            ]
        return wire


@dataclass
class Task:
    """An open task."""

    id: int
    cells: List[int]
    """The cells that it visits, in order."""


@dataclass
class FleetState:
    """The state of the fleet when everything committed has been executed."""

    time_s: float
    """Simulated time since the run began."""
    cells: List[int]
    """Every agent's cell at the end of what is committed."""
    goals: List[List[int]]
    """Goals that agents have been given and have not reached, in order: the first is current.
    Where goals never end, as many as it takes to keep the agent busy for longer than the
    window, and at least two."""
    tasks: List[Task] = field(default_factory=list)
    """Tasks that were released and given to nobody."""
    headings: Optional[List[str]] = None
    window_steps: int = 0
    """Planning window asked for in steps; 0 for none. The next instance may have a shorter
    one."""
    motion: str = "pebble"
    """The motion of robots, which the next instance must repeat."""
    objective: str = "sum-of-costs"
    """The quantity to minimise, which the next instance must repeat."""
    radius_m: float = 0.0
    """Radius of the largest robot's enclosing circle, which the next instance must repeat."""
    allows_cycles: bool = True
    """True if agents may move round in a ring in one step; the next instance must repeat it."""

    @property
    def agents(self) -> int:
        """Number of agents."""
        return len(self.cells)

    def instance(self, goals: List[List[int]]) -> Instance:
        """The next instance with these goals: it repeats what it has to, takes the window as
        asked, and gives no task to anybody."""
        return Instance(
            starts=list(self.cells),
            goals=goals,
            headings=None if self.headings is None else list(self.headings),
            motion=self.motion,
            objective=self.objective,
            window_steps=self.window_steps,
            radius_m=self.radius_m,
            allows_cycles=self.allows_cycles,
        )

    @classmethod
    def _from_wire(cls, wire: Mapping[str, Any]) -> FleetState:
        headings = wire.get("headings")
        return cls(
            time_s=float(wire["time_s"]),
            cells=_cells(wire["cells"]),
            goals=[_cells(goals) for goals in wire["goals"]],
            tasks=[Task(int(task["id"]), _cells(task["cells"])) for task in wire["tasks"]],
            headings=None if headings is None else [str(heading) for heading in headings],
            window_steps=int(wire.get("window_steps", 0)),
            motion=str(wire.get("motion", "pebble")),
            objective=str(wire.get("objective", "sum-of-costs")),
            radius_m=float(wire.get("radius_m", 0.0)),
            allows_cycles=bool(wire.get("allows_cycles", True)),
        )


@dataclass
class FleetStatus:
    """The status of the fleet."""

    time_s: float
    """Simulated time since the run began."""
    since_last_call_s: float
    """Simulated time since the planner was last called."""
    planning_limit_s: float
    """Limit of the planner's time: its answer to a call now takes effect so much later."""
    action_s: float
    """The least time that an action of a robot takes."""
    actions_left: List[int]
    """Per agent, committed actions that are not yet executed."""

    @classmethod
    def _from_wire(cls, wire: Mapping[str, Any]) -> FleetStatus:
        return cls(
            time_s=float(wire["time_s"]),
            since_last_call_s=float(wire["since_last_call_s"]),
            planning_limit_s=float(wire["planning_limit_s"]),
            action_s=float(wire["action_s"]),
            actions_left=_cells(wire["actions_left"]),
        )


def whole(value: Any) -> int:
    """An integer of any kind; no float, and no truth value."""
    if isinstance(value, bool):
        raise TypeError("a truth value is no number")
    return operator.index(value)


def _cells(values: Any, what: str = "the list") -> List[int]:
    """A list of ints from a list, or from an array that has ``tolist``."""
    values = getattr(values, "tolist", lambda: values)()
    if isinstance(values, (str, bytes)) or not hasattr(values, "__iter__"):
        raise TypeError(f"{what} is no list but {values!r:.60}")
    cells = []
    for place, value in enumerate(values):
        try:
            cells.append(whole(value))
        except TypeError:
            raise TypeError(f"{what} has {value!r:.60} at place {place}, no whole number") from None
    return cells
