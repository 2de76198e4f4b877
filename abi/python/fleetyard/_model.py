"""Input of a plugin apart from maps, as dataclasses, and what generators answer.

Field names are those of the wire; fields that this version does not know are ignored. A
*place* is a cell of a grid, ``row * cols + col`` with row 0 at the top, or a vertex of a
roadmap. Lengths are metres, times seconds, angles radians.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field, replace
from typing import Any, Dict, Iterator, List, Mapping, Optional, Sequence, Tuple

from ._failures import InvalidInput, Unsupported
from ._maps import Environment, Footprint, Parts
from ._numbers import lists, number, numbers, places, whole

OFF_MAP = -1
"""The place of a position that is on no map, in plans from a failed planner."""

MOTIONS = ("pebble", "rotation", "any-angle", "stop-go", "slower", "dynamics")
"""Motions of robots. Each is the name of a capability as well."""

OBJECTIVES = ("sum-of-costs", "makespan")

State = List[float]
"""A state of a robot in the plane: x, y, the heading if its model has one, and what its
dynamics add. NaN where any value will do."""

Limit = Tuple[float, float]
"""The least and the most; infinite where there is no limit."""


@dataclass(frozen=True)
class Budget:
    """Limits of one call. The host enforces them."""

    deadline_monotonic_ns: int
    """When the call must have returned, on the clock of ``time.monotonic_ns()``."""
    answer_by_ns: int
    """When to come to an end, so that the answer arrives before the deadline, on the same
    clock: from here on a call is cancelled. Plans that were handed over before the deadline
    count."""
    wall_ns: int
    """Length of the budget when the call began."""
    nodes: int = 0
    """Most search nodes to expand; 0 for no limit."""
    memory_bytes: int = 0
    """Most memory to use; 0 for no limit."""
    threads: int = 1
    """Most threads to use at a time."""
    seed: int = 0
    """Seed of every random choice, below 2**53."""

    @classmethod
    def lasting(cls, wall_s: float, **limits: int) -> Budget:
        """A budget that begins now, for tests: the answer is due a fiftieth of it before the
        deadline, but at least 1 ms and at most 100 ms, as the host has it."""
        wall_ns = int(wall_s * 1e9)
        deadline = time.monotonic_ns() + wall_ns
        reserve = min(max(wall_ns // 50, 1_000_000), 100_000_000)
        return cls(deadline, deadline - reserve, wall_ns, **limits)

    def remaining_s(self) -> float:
        """Seconds until the answer is due; negative from then on."""
        return (self.answer_by_ns - time.monotonic_ns()) * 1e-9

    def expired(self) -> bool:
        """True once the deadline has passed: what is handed over now does not count."""
        return time.monotonic_ns() >= self.deadline_monotonic_ns

    def ending(self) -> bool:
        """True when it is time to answer."""
        return time.monotonic_ns() >= self.answer_by_ns

    @classmethod
    def _from_wire(cls, wire: Mapping[str, Any]) -> Budget:
        return cls(
            deadline_monotonic_ns=int(wire["deadline_monotonic_ns"]),
            answer_by_ns=int(wire["answer_by_ns"]),
            wall_ns=int(wire["wall_ns"]),
            nodes=int(wire.get("nodes") or 0),
            memory_bytes=int(wire.get("memory_bytes") or 0),
            threads=max(1, int(wire.get("threads") or 1)),
            seed=int(wire.get("seed") or 0),
        )


@dataclass(frozen=True)
class Robot:
    """A model of robots."""

    footprint: Footprint
    name: str = ""
    dynamics: str = ""
    """Name of its dynamics, such as ``fleetyard.double-integrator/1``; empty where any motion
    will do. ``docs/contract.md`` says what they are."""
    has_heading: bool = False
    """True if a state has a heading after x and y."""
    polar_state: bool = False
    """True if the largest of the first two rates of a state bounds their length."""
    polar_control: bool = False
    """True if the largest of the first two numbers of a control bounds their length."""
    state_limits: Tuple[Limit, ...] = ()
    """The limits of each number of a state."""
    control_limits: Tuple[Limit, ...] = ()
    """The limits of each number of a control."""
    parameters: Tuple[float, ...] = ()
    """Further numbers, as the dynamics say."""

    @classmethod
    def _from_wire(cls, wire: Mapping[str, Any]) -> Robot:
        def limits(pairs: Sequence[Sequence[Optional[float]]]) -> Iterator[Limit]:
            for least, most in pairs:
                yield (
                    -math.inf if least is None else number(least),
                    math.inf if most is None else number(most),
                )

        return cls(
            footprint=Footprint._from_wire(wire["footprint"]),
            name=str(wire.get("name") or ""),
            dynamics=str(wire.get("dynamics") or ""),
            has_heading=bool(wire.get("has_heading")),
            polar_state=bool(wire.get("polar_state")),
            polar_control=bool(wire.get("polar_control")),
            state_limits=tuple(limits(wire.get("state_limits") or ())),
            control_limits=tuple(limits(wire.get("control_limits") or ())),
            parameters=tuple(numbers(wire.get("parameters") or ())),
        )


@dataclass
class Instance:
    """An instance: the input of a planner, on the map it was prepared for."""

    starts: List[int] = field(default_factory=list)
    """Start of every agent, a place; empty in the plane."""
    goals: List[List[int]] = field(default_factory=list)
    """Goals of every agent, places to be visited in order. An agent without one may end
    anywhere; only plugins with the capability ``idle`` meet one."""
    headings: Optional[List[str]] = None
    """Start headings (east, south, west, north), when they matter."""
    motion: str = "pebble"
    """On a grid ``pebble``, ``rotation`` where turning by 90 degrees takes a step, or
    ``any-angle``. On a roadmap ``stop-go``, or ``slower`` where an edge may be driven at any
    uniform speed up to the roadmap's. In the plane ``dynamics``."""
    objective: str = "sum-of-costs"
    """``sum-of-costs`` or ``makespan``."""
    window_steps: int = 0
    """On grids: collisions after this many steps do not matter, and paths may end before
    their goals; 0 for a complete plan."""
    window_s: float = 0.0
    """The same in the other representations."""
    radius_m: float = 0.0
    """Radius of the largest robot's enclosing circle."""
    allows_cycles: bool = False
    """True if three or more agents may move round in a ring in one step, each into the cell
    that the next one leaves. In plans for a fleet nobody enters a cell before it is empty."""
    strict: bool = False
    """True if no agent may follow another one round a corner, because robots of ``radius_m``
    would touch there."""
    start_states: List[State] = field(default_factory=list)
    """Start of every agent in the plane; empty elsewhere."""
    goal_states: List[List[State]] = field(default_factory=list)
    """Goals of every agent in the plane, NaN where any value will do; empty elsewhere."""
    robots: List[Robot] = field(default_factory=list)
    """Models of robots. May be empty on grids and roadmaps."""
    robot_of: List[int] = field(default_factory=list)
    """The model of every agent; empty when there is one model at most."""
    goal_tolerance_m: float = 0.0
    """In the plane: distance from its goal at which a robot may end."""
    goal_tolerance_rad: float = 0.0
    """In the plane: the same of its heading."""
    goal_tolerance_rate: float = 0.0
    """In the plane: the same of each further number of its state, where controls say it."""
    dynamics_tolerance: float = 0.0
    """In the plane: how far controls may lead beside the knots of the same plan, in metres and in
    radians."""
    parts: Parts = field(default_factory=Parts)
    """Further data by name."""

    @property
    def agents(self) -> int:
        """Number of agents."""
        return max(len(self.starts), len(self.start_states))

    def goal(self, agent: int) -> int:
        """The last goal of an agent, which must have one: where its path should end."""
        return self.goals[agent][-1]

    def robot(self, agent: int) -> Optional[Robot]:
        """The model of an agent's robot, if the instance has models."""
        model = self.robot_of[agent] if self.robot_of else 0
        return self.robots[model] if self.robots else None

    def needs(self) -> List[str]:
        """The capabilities that a planner must have to solve it."""
        needed = [self.motion]
        counts = [len(goals) for goals in self.goals or self.goal_states]
        windowed = self.window_steps > 0 or self.window_s > 0
        if windowed or any(count > 1 for count in counts):
            needed.append("windowed")
        if 0 in counts:
            needed.append("idle")
        if len(self.robots) > 1:
            needed.append("heterogeneous")
        if not windowed:
            last = [goals[-1] for goals in self.goals if goals]
            if len(set(last)) < len(last):
                needed.append("duplicate-goals")
        return needed

    def features(self) -> List[str]:
        """Names of what has no capability and a planner must list in its features: the dynamics
        of robots where they matter, and critical parts."""
        moved = self.robots if self.motion == "dynamics" else []
        dynamics = {f"dynamics:{robot.dynamics}" for robot in moved if robot.dynamics}
        return sorted(dynamics.union(self.parts.features()))

    @classmethod
    def _from_wire(cls, wire: Mapping[str, Any], environment: Environment) -> Instance:
        headings = wire.get("headings")

        def state(values: Sequence[Optional[float]]) -> State:
            return [math.nan if value is None else number(value) for value in values]

        instance = cls(
            starts=places(wire.get("starts") or ()),
            goals=[places(goals) for goals in wire.get("goals") or ()],
            headings=None if headings is None else [str(heading) for heading in headings],
            motion=str(wire.get("motion") or "pebble"),
            objective=str(wire.get("objective") or "sum-of-costs"),
            window_steps=int(wire.get("window_steps") or 0),
            window_s=number(wire.get("window_s") or 0),
            radius_m=number(wire.get("radius_m") or 0),
            allows_cycles=bool(wire.get("allows_cycles")),
            strict=bool(wire.get("strict")),
            start_states=[state(values) for values in wire.get("start_states") or ()],
            goal_states=lists(wire.get("goal_states") or (), state),
            robots=[Robot._from_wire(robot) for robot in wire.get("robots") or ()],
            robot_of=places(wire.get("robot_of") or ()),
            goal_tolerance_m=number(wire.get("goal_tolerance_m") or 0),
            goal_tolerance_rad=number(wire.get("goal_tolerance_rad") or 0),
            goal_tolerance_rate=number(wire.get("goal_tolerance_rate") or 0),
            dynamics_tolerance=number(wire.get("dynamics_tolerance") or 0),
            parts=Parts._from_wire(wire),
        )
        instance._check(environment.places)
        return instance

    def _check(self, places: Optional[int]) -> None:
        if self.motion not in MOTIONS:
            raise Unsupported(f"the motion `{self.motion}` is unknown")
        if self.objective not in OBJECTIVES:
            raise Unsupported(f"the objective `{self.objective}` is unknown")
        plane = places is None
        starts = len(self.start_states if plane else self.starts)
        goals = len(self.goal_states if plane else self.goals)
        if not starts or self.agents != starts or goals != starts:
            raise InvalidInput(f"{starts} starts but {goals} goal lists")

        def length(what: str, values: Sequence[Any]) -> None:
            if len(values) != starts:
                raise InvalidInput(
                    f"`{what}` has {len(values)} entries, but there are {starts} agents"
                )

        if self.headings is not None:
            length("headings", self.headings)
        if self.robot_of:
            length("robot_of", self.robot_of)
        elif len(self.robots) > 1:
            raise InvalidInput("several models of robots, but no `robot_of`")
        for model in self.robot_of:
            if not 0 <= model < len(self.robots):
                raise InvalidInput(f"robot {model} is none of the {len(self.robots)} models")
        if places is None:
            self._check_states()
        else:
            for agent, own in enumerate(self.goals):
                _on_map((self.starts[agent], *own), places)

    def _check_states(self) -> None:
        for agent, start in enumerate(self.start_states):
            robot = self.robot(agent)
            if robot is None:
                raise InvalidInput("an instance in the plane without a model of robots")
            size = len(robot.state_limits)
            for state in (start, *self.goal_states[agent]):
                if len(state) != size:
                    raise InvalidInput(
                        f"agent {agent} has a state of {len(state)} numbers, but its robot has "
                        f"{size}"
                    )
            if not all(map(math.isfinite, start)):
                raise InvalidInput(f"agent {agent} has no start")


def _on_map(cells: Sequence[int], places: int) -> None:
    for cell in cells:
        if not 0 <= cell < places:
            raise InvalidInput(f"cell {cell} is not on a map of {places} cells")


@dataclass
class Task:
    """An open task."""

    id: int
    places: List[int]
    """The places that it visits, in order."""
    released_s: float = 0.0
    """Simulated time at which it was released."""


@dataclass
class Assignment:
    """A task that an instance generator gives to an agent."""

    agent: int
    """Number of the agent."""
    task: int
    """Identifier of one of the open tasks."""


@dataclass
class Request:
    """The decision of an instance generator. The rest of the next instance is as
    :attr:`FleetState.next` has it."""

    goals: List[List[int]]
    """The goals that the planner is asked to visit, for every agent, in order."""
    assignments: List[Assignment] = field(default_factory=list)
    """Tasks that are given to agents: the host appends the places of a task to the goals of
    its agent."""
    window_steps: int = 0
    """The window of the next instance on a grid, no longer than the one asked for."""
    window_s: float = 0.0
    """The same in the other representations."""

    def _plain(self) -> Request:
        """The same with lists of numbers, whatever an author has put in."""
        plain = getattr(self.goals, "tolist", lambda: self.goals)()
        if isinstance(plain, (str, bytes)) or not hasattr(plain, "__iter__"):
            raise TypeError(f"`goals` is no list with one list per agent but {plain!r:.60}")
        return replace(
            self,
            goals=[places(each, f"`goals` of agent {agent}") for agent, each in enumerate(plain)],
            assignments=[
                Assignment(agent=whole(given.agent), task=whole(given.task))
                for given in self.assignments
            ],
            window_steps=whole(self.window_steps),
            window_s=number(self.window_s),
        )

    def _check(self, agents: int, places: Optional[int]) -> None:
        if len(self.goals) != agents:
            raise ValueError(
                f"the request has {len(self.goals)} goal lists, but there are {agents} agents"
            )
        for agent, goals in enumerate(self.goals):
            for cell in goals:
                if places is not None and not 0 <= cell < places:
                    raise ValueError(
                        f"agent {agent}: cell {cell} is not on a map of {places} cells"
                    )
        for given in self.assignments:
            if not 0 <= given.agent < agents:
                raise ValueError(
                    f"task {given.task} is given to agent {given.agent}, but there are "
                    f"{agents} agents"
                )

    def _to_wire(self) -> Dict[str, Any]:
        wire: Dict[str, Any] = {"goals": self.goals, "window_steps": self.window_steps}
        if self.window_s:
            wire["window_s"] = self.window_s
        if self.assignments:
            wire["assignments"] = [
                {"agent": given.agent, "task": given.task} for given in self.assignments
            ]
        return wire


@dataclass
class FleetState:
    """The state of the fleet when everything committed has been executed, and the work that
    is left."""

    time_s: float
    """Simulated time since the run began."""
    next: Instance
    """The next instance as it is if nobody is given more. Its goals are those that agents have
    been given and have not reached, in order: the first is current. Where goals never end, they
    are as many as it takes to keep the agent busy for longer than the window, and at least two.
    Its window is the one asked for."""
    tasks: List[Task] = field(default_factory=list)
    """Tasks that were released and given to nobody."""
    parts: Parts = field(default_factory=Parts)
    """Further data by name."""

    @property
    def agents(self) -> int:
        """Number of agents."""
        return self.next.agents

    def request(
        self, goals: List[List[int]], assignments: Optional[List[Assignment]] = None
    ) -> Request:
        """A request for these goals, with the window as asked."""
        return Request(goals, assignments or [], self.next.window_steps, self.next.window_s)

    @classmethod
    def _from_wire(cls, wire: Mapping[str, Any], environment: Environment) -> FleetState:
        return cls(
            time_s=number(wire["time_s"]),
            next=Instance._from_wire(wire["next"], environment),
            tasks=[
                Task(
                    int(task["id"]), places(task["places"]), number(task.get("released_s", 0.0))
                )
                for task in wire.get("tasks") or ()
            ],
            parts=Parts._from_wire(wire),
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
            actions_left=places(wire["actions_left"]),
        )
