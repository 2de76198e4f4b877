"""The four kinds of plugin, to be subclassed, and what a call may say meanwhile."""

from __future__ import annotations

import math
import re
import threading
import time
from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any, Callable, ClassVar, Dict, Mapping, Optional, Sequence

from ._failures import Cancelled, InvalidInput, TimedOut
from ._annotations import Annotations
from ._maps import Environment, Grid, Roadmap, Workspace
from ._memory import KEPT_LIMIT
from ._model import Budget, FleetState, FleetStatus, Instance, Request
from ._plans import Form, Plan

if TYPE_CHECKING:
    from ._server import Channel

LOG_LEVELS = ("error", "warning", "info", "debug")


class Context:
    """Services of the host while one call is running, from any thread."""

    def __init__(
        self,
        channel: Channel,
        request: int,
        budget: Optional[Budget] = None,
        form: Optional[Form] = None,
        keeps: bool = False,
        extensions: Sequence[str] = (),
    ) -> None:
        self._channel = channel
        self._request = request
        self._budget = budget
        self._form = form
        self._keeps = keeps or form is not None
        self._submitted = False
        self._thread = threading.get_ident()
        self._writing_ns = 0
        self.annotations: Optional[Annotations] = None
        """Takes what a planner wants to show; ``None`` unless somebody wants to see it. The plan must
        not depend on it."""
        if Annotations.ID in extensions:
            self.annotations = Annotations(
                lambda params: self._notify("annotation", lambda: params)
            )

    def cancelled(self) -> bool:
        """True if the call should end: its :attr:`Budget.answer_by_ns` has passed, or the host
        gave up on it. Cheap; ask often."""
        return self._revoked() or (self._budget is not None and self._budget.ending())

    def _revoked(self) -> bool:
        return self._channel.cancelled == self._request

    def check(self) -> None:
        """Raises :class:`TimedOut` or :class:`Cancelled` if the call should end."""
        if self._budget is not None and self._budget.ending():
            raise TimedOut("the call's time is up")
        if self._revoked():
            raise Cancelled("cancelled by the host")

    def incumbent(self, plan: Plan) -> bool:
        """Hands over a plan, better than the last one, and goes on. It is as
        :meth:`Planner.plan` returns it. The answer says if it was sent: after the deadline it
        is not."""
        if self._form is None:
            raise RuntimeError("only planners and fail policies have plans")
        late = self._budget is not None and self._budget.expired()
        if late or self._revoked():
            return False
        form = self._form
        self._notify("incumbent", lambda: {form.field: form.encode(plan)})
        self._submitted = True
        return True

    def keep(self, data: bytes) -> None:
        """Lets the host keep bytes in place of those before, at most :data:`KEPT_LIMIT`: the
        next call has them as ``parts.kept`` of the instance or the state, if the plugin's
        features list ``part:fleetyard.kept/1``. The last ones of a call count, and only if it ends
        well and in time."""
        if not self._keeps:
            raise RuntimeError("only planners, fail policies and generators keep bytes")
        if len(data) > KEPT_LIMIT:
            raise ValueError(f"{len(data)} bytes are more than the limit of {KEPT_LIMIT}")
        self._notify("keep", lambda: {"bytes": bytes(data).hex()})

    def metric(self, name: str, value: float) -> None:
        """Reports a figure such as ``expansions``, a claim. Some have a domain, such as
        whole numbers from 0: another value breaks the protocol. JSON has no infinities: a
        value that is not finite is left out."""
        value = float(value)
        if math.isfinite(value):
            self._notify("metric", lambda: {"name": str(name), "value": value})

    def note(self, name: str, text: str) -> None:
        """Notes a fact about the plugin's inputs, such as the digest of its weights, a claim."""
        self._notify("note", lambda: {"name": str(name), "text": str(text)})

    def progress(self, done: int, total: int = 0) -> None:
        """Says how much of the work is done; ``total`` 0 if unknown."""
        params = {"done": max(0, int(done)), "total": max(0, int(total))}
        self._notify("progress", lambda: params)

    def log(self, text: str, level: str = "info") -> None:
        """Writes to the run's log; levels are error, warning, info, debug."""
        if level not in LOG_LEVELS:
            raise ValueError(f"{level!r} is none of {', '.join(LOG_LEVELS)}")
        self._notify("log", lambda: {"level": level, "text": str(text)})

    def _notify(self, method: str, params: Callable[[], Dict[str, Any]]) -> None:
        """Sends a message, and notes how long that kept the call from its work."""
        began = time.monotonic_ns()
        self._channel.notify(method, params())
        if threading.get_ident() == self._thread:
            self._writing_ns += time.monotonic_ns() - began


class Plugin(ABC):
    """The part that all kinds share. The class attributes describe the plugin."""

    kind: ClassVar[str]
    id: ClassVar[str] = ""
    """Short identifier; by default the name of the class, as in ``my-planner``."""
    name: ClassVar[str] = ""
    version: ClassVar[str] = ""
    description: ClassVar[str] = ""
    """One paragraph, the paper cited; by default the class's docstring."""
    license: ClassVar[str] = ""
    capabilities: ClassVar[Sequence[str]] = ()
    features: ClassVar[Sequence[str]] = ()
    """Names of what has no capability: ``dynamics:NAME`` for each model of robots that it plans
    for, ``part:IDENTIFIER`` for each part that it reads, ``agents:1`` if it plans for one agent
    alone."""
    options_schema: ClassVar[Optional[Mapping[str, Any]]] = None
    """JSON Schema of the options; ``None`` when there are none."""

    grid: Grid
    """The map, from ``prepare`` on, if it is a grid."""
    roadmap: Roadmap
    """The map, from ``prepare`` on, if it is a roadmap."""
    workspace: Workspace
    """The map, from ``prepare`` on, if it is the plane."""

    def __init__(self, options: Dict[str, Any]) -> None:
        """Options are those that the user gave, checked by the host against the schema,
        and the schema's defaults for those that were left out."""
        self.options = options

    @classmethod
    def descriptor(cls) -> Dict[str, Any]:
        """The descriptor of the plugin for the host."""
        own_doc = cls.__doc__ if cls.__doc__ not in _BASE_DOCS else ""
        return {
            "id": cls.identifier(),
            "kind": cls.kind,
            "name": cls.name or cls.identifier(),
            "version": cls.version,
            "description": cls.description or " ".join((own_doc or "").split()),
            "license": cls.license,
            "capabilities": list(cls.capabilities),
            "features": list(cls.features),
            "options_schema": cls.options_schema,
            "path_encoding": "moves",
        }

    @classmethod
    def complete(cls, options: Mapping[str, Any]) -> Dict[str, Any]:
        """Options with the schema's defaults; fails for one that the schema rules out."""
        schema = cls.options_schema or {"additionalProperties": False}
        known: Mapping[str, Any] = schema.get("properties", {})
        if schema.get("additionalProperties") is False:
            for name in options:
                if name not in known:
                    raise InvalidInput(f"options: there is no option `{name}`")
        given = dict(options)
        for name, about in known.items():
            if isinstance(about, Mapping) and "default" in about:
                given.setdefault(name, about["default"])
        return given

    @classmethod
    def identifier(cls) -> str:
        """``id``, or else the name of the class in small letters with hyphens."""
        return cls.id or re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "-", cls.__name__).lower()


class _Prepared(Plugin):
    capabilities = ("grid", "pebble")

    # Authors know which kind of map they claimed, and say so when they override this.
    def prepare(self, environment: Any, budget: Budget, context: Context) -> None:
        """Learns a map, within a budget of its own: a :class:`Grid`, a :class:`Roadmap` or a
        :class:`Workspace`, which ``self.grid``, ``self.roadmap`` or ``self.workspace`` is
        already. It needs nothing that ``capabilities`` and ``features`` lack."""

    def _learn(self, environment: Environment) -> None:
        if isinstance(environment, Grid):
            self.grid = environment
        elif isinstance(environment, Roadmap):
            self.roadmap = environment
        else:
            self.workspace = environment


class Planner(_Prepared):
    """Solves instances."""

    kind = "planner"

    @abstractmethod
    def plan(self, instance: Instance, budget: Budget, context: Context) -> Optional[Plan]:
        """Returns a plan, or ``None`` when the last ``context.incumbent(...)`` is the answer.
        Raises a :class:`~fleetyard.Failure` to give up. The instance is whole and needs
        nothing that ``capabilities`` and ``features`` lack.

        On a grid a plan is a path per agent, which lists where it is at time 0, 1, 2, ...:
        cells, or ``(row, col)``, or an array of either, or a string of moves. On a roadmap it
        is a list of :class:`~fleetyard.Visit` per agent, in the plane a list of
        :class:`~fleetyard.Knot` or a :class:`~fleetyard.Motion` with controls per agent; plain
        tuples will do. After its last entry an agent stays where it is.
        """


class FailPolicy(_Prepared):
    """Gets the fleet moving again when the planner has failed."""

    kind = "fail-policy"

    @abstractmethod
    def recover(
        self,
        instance: Instance,
        failed_plan: Any,
        budget: Budget,
        context: Context,
    ) -> Optional[Plan]:
        """Returns a collision-free plan, as :meth:`Planner.plan`. ``failed_plan`` is what the
        planner left, collisions and all: a list per agent of cells, of
        :class:`~fleetyard.Visit` or of :class:`~fleetyard.Knot`; ``None`` if it left
        nothing."""


class InstanceGenerator(_Prepared):
    """Decides what the planner is asked next."""

    kind = "instance-generator"

    @abstractmethod
    def generate(self, state: FleetState, budget: Budget, context: Context) -> Request:
        """Returns what the planner is asked next; :meth:`FleetState.request` makes it."""


class InvocationPolicy(Plugin):
    """Decides when the planner is called."""

    kind = "invocation-policy"

    @abstractmethod
    def should_invoke(self, status: FleetStatus, context: Context) -> bool:
        """True if the planner has to be called now."""


_BASE_DOCS = {
    base.__doc__
    for base in (Plugin, _Prepared, Planner, FailPolicy, InstanceGenerator, InvocationPolicy)
}
