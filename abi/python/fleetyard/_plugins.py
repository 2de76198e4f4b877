"""The four kinds of plugin, to be subclassed, and what a call may say meanwhile."""

from __future__ import annotations

import math
import re
import threading
import time
from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any, Callable, ClassVar, Dict, List, Mapping, Optional, Sequence

from . import _paths
from ._model import (
    Budget,
    Cancelled,
    FleetState,
    FleetStatus,
    Grid,
    Instance,
    InvalidInput,
    TimedOut,
)
from ._paths import Paths

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
        encode: Optional[Callable[[Any], List[Any]]] = None,
    ) -> None:
        self._channel = channel
        self._request = request
        self._budget = budget
        self._encode = encode
        self._submitted = False
        self._thread = threading.get_ident()
        self._writing_ns = 0

    def cancelled(self) -> bool:
        """True if the call should end: its deadline is so near that an answer may just
        arrive in time (see :meth:`Budget.ending`), or the host gave up on it. Cheap; ask
        often."""
        return self._revoked() or (self._budget is not None and self._budget.ending())

    def _revoked(self) -> bool:
        return self._channel.cancelled == self._request

    def check(self) -> None:
        """Raises :class:`TimedOut` or :class:`Cancelled` if the call should end."""
        if self._budget is not None and self._budget.ending():
            raise TimedOut("the call's time is up")
        if self._revoked():
            raise Cancelled("cancelled by the host")

    def incumbent(self, paths: Paths) -> bool:
        """Hands over a plan, better than the last one, and goes on. Whether it was
        sent: after the deadline it is not. Paths are as :meth:`Planner.plan` returns
        them."""
        if self._encode is None:
            raise RuntimeError("only planners and fail policies have plans")
        late = self._budget is not None and self._budget.expired()
        if late or self._revoked():
            return False
        encode = self._encode
        self._notify("incumbent", lambda: {"paths": encode(paths)})
        self._submitted = True
        return True

    def metric(self, name: str, value: float) -> None:
        """Reports a figure such as ``expansions``, a claim. Some have a domain, such as
        whole numbers from 0: another value breaks the protocol. JSON has no infinities: a
        value that is not finite is left out."""
        value = float(value)
        if math.isfinite(value):
            self._notify("metric", lambda: {"name": str(name), "value": value})

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
    options_schema: ClassVar[Optional[Mapping[str, Any]]] = None
    """JSON Schema of the options; ``None`` when there are none."""

    grid: Grid
    """The map, from ``prepare`` on."""

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
    def prepare(self, grid: Grid, budget: Budget, context: Context) -> None:
        """Learns a map, within a budget of its own. ``self.grid`` is set already."""


class Planner(_Prepared):
    """Solves instances."""

    kind = "planner"
    capabilities = ("grid", "pebble")

    @abstractmethod
    def plan(self, instance: Instance, budget: Budget, context: Context) -> Optional[Paths]:
        """Returns one path per agent, or ``None`` when the last
        ``context.incumbent(...)`` is the answer. Raises a
        :class:`~fleetyard.Failure` to give up.

        A path lists where the agent is at time 0, 1, 2, ...: cells, or ``(row,
        col)``, or an array of either, or a string of moves. After its last cell an agent
        stays there.
        """


class FailPolicy(_Prepared):
    """Gets the fleet moving again when the planner has failed."""

    kind = "fail-policy"

    @abstractmethod
    def recover(
        self,
        instance: Instance,
        failed_paths: Optional[List[List[int]]],
        budget: Budget,
        context: Context,
    ) -> Optional[Paths]:
        """Returns collision-free paths, as :meth:`Planner.plan`. ``failed_paths`` is
        what the planner left, collisions and all, as lists of cells."""


class InstanceGenerator(_Prepared):
    """Decides what the planner is asked next."""

    kind = "instance-generator"

    @abstractmethod
    def generate(self, state: FleetState, budget: Budget, context: Context) -> Instance:
        """Returns the next instance."""


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


def encoder(instance: Instance, grid: Grid) -> Callable[[Any], List[Any]]:
    """The encoder of paths of an instance."""
    return lambda paths: _paths.encode(paths, instance.starts, grid.rows, grid.cols)
