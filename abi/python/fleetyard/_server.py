"""The plugin's side of the wire: newline-delimited JSON-RPC 2.0.

A thread reads, so that ``$/cancel``, ``exit`` and the end of the input are heard
while a call is running; calls run one after the other in the main thread.
"""

from __future__ import annotations

import inspect
import json
import os
import queue
import re
import sys
import threading
import time
import traceback
from typing import (
    Any,
    BinaryIO,
    Callable,
    Dict,
    Iterable,
    Iterator,
    List,
    Mapping,
    Optional,
    Sequence,
    Tuple,
    Type,
)

from ._failures import Failure, GaveUp, InvalidInput, Unsupported
from ._maps import Environment, environment_from_wire
from ._model import Budget, FleetState, FleetStatus, Instance, Request
from ._plans import Form
from ._plugins import (
    Context,
    FailPolicy,
    InstanceGenerator,
    InvocationPolicy,
    Planner,
    Plugin,
    _Prepared,
)

PROTOCOL_VERSION = 1
"""The version of the protocol that this package speaks."""

PARSE_ERROR = -32700
INVALID_REQUEST = -32600
METHOD_NOT_FOUND = -32601
INVALID_PARAMS = -32602
INTERNAL_ERROR = -32603

_GRACE_S = 1.0
"""Seconds for which a call may go on when the host has gone away."""


class _Refusal(Exception):
    """An error of the protocol, as opposed to a call that failed."""

    def __init__(self, code: int, message: str) -> None:
        super().__init__(message)
        self.code = code
        self.message = message


class Channel:
    """The output for messages, and the request that was cancelled."""

    def __init__(self, output: BinaryIO) -> None:
        self._output = output
        self._lock = threading.Lock()
        self.cancelled: Optional[int] = None
        """The request that should end; -1 for whichever is running."""

    def send(self, message: Dict[str, Any]) -> None:
        text = json.dumps(message, allow_nan=False, ensure_ascii=False, separators=(",", ":"))
        # Python strings may hold halves of surrogate pairs, UTF-8 may not.
        line = text.encode("utf-8", "replace") + b"\n"
        with self._lock:
            try:
                self._output.write(line)
                self._output.flush()
            except (OSError, ValueError):
                pass  # the host has gone away: the reading thread hears of it

    def notify(self, method: str, params: Dict[str, Any]) -> None:
        self.send({"jsonrpc": "2.0", "method": method, "params": params})

    def reply(self, request: int, result: Any) -> None:
        try:
            self.send({"jsonrpc": "2.0", "id": request, "result": result})
        except (TypeError, ValueError, RecursionError) as error:
            self.refuse(request, INTERNAL_ERROR, f"the answer is not JSON: {error}")

    def refuse(self, request: Optional[int], code: int, message: str) -> None:
        self.send({"jsonrpc": "2.0", "id": request, "error": {"code": code, "message": message}})


def _parse(line: bytes) -> Any:
    def no_constant(name: str) -> Any:
        raise ValueError(f"{name} is not JSON")

    return json.loads(line.decode("utf-8"), parse_constant=no_constant)


def _is_id(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and value >= 0


_Asked = Tuple[Context, Callable[[], Any]]
"""A call for a plan, once it is read: its context, and the call itself."""


class _Server:
    def __init__(self, plugins: Sequence[Type[Plugin]], channel: Channel) -> None:
        self._plugins = plugins
        self._channel = channel
        self._object: Optional[Plugin] = None
        self._environment: Optional[Environment] = None
        self._methods: Dict[str, Callable[[int, Mapping[str, Any]], Any]] = {
            "initialize": self._initialize,
            "create": self._create,
            "prepare": self._prepare,
            "plan": self._plan,
            "recover": self._recover,
            "generate": self._generate,
            "should_invoke": self._should_invoke,
            "shutdown": self._shutdown,
        }

    def answer(self, line: bytes) -> None:
        try:
            message = _parse(line)
        except (ValueError, RecursionError) as error:
            self._channel.refuse(None, PARSE_ERROR, str(error) or type(error).__name__)
            return
        request = message.get("id") if isinstance(message, dict) else None
        method = message.get("method") if isinstance(message, dict) else None
        if not _is_id(request) or not isinstance(method, str):
            known = request if _is_id(request) else None
            self._channel.refuse(known, INVALID_REQUEST, "not a request")
            return
        assert isinstance(request, int)
        try:
            handler = self._methods.get(method)
            if handler is None:
                raise _Refusal(METHOD_NOT_FOUND, f"there is no method `{method}`")
            params = message.get("params")
            result = handler(request, params if isinstance(params, dict) else {})
        except _Refusal as refusal:
            self._channel.refuse(request, refusal.code, refusal.message)
        else:
            self._channel.reply(request, result)

    # ---- Methods ----

    def _initialize(self, _: int, params: Mapping[str, Any]) -> Any:
        offered = params.get("protocol_versions")
        if not isinstance(offered, list):
            raise _Refusal(INVALID_PARAMS, "`protocol_versions` is not a list")
        if PROTOCOL_VERSION not in offered:
            reason = f"this plugin speaks protocol {PROTOCOL_VERSION}, not {offered}"
            raise _Refusal(INVALID_PARAMS, reason)
        return {
            "protocol_version": PROTOCOL_VERSION,
            "plugins": [plugin.descriptor() for plugin in self._plugins],
        }

    def _create(self, _: int, params: Mapping[str, Any]) -> Any:
        kind, name = params.get("kind"), params.get("plugin")
        options = params.get("options")
        self._object = self._environment = None

        def make() -> None:
            for plugin in self._plugins:
                if plugin.kind == kind and plugin.identifier() == name:
                    if options is not None and not isinstance(options, dict):
                        raise InvalidInput("options: not an object")
                    self._object = plugin(plugin.complete(options or {}))
                    return
            raise Unsupported(f"there is no {kind} `{name}`")

        return _outcome(make)

    def _prepare(self, request: int, params: Mapping[str, Any]) -> Any:
        plugin = self._of(_Prepared, "prepare")
        budget = _read(Budget._from_wire, params, "budget")
        self._environment = None

        def prepare() -> None:
            environment = _read(environment_from_wire, params, "environment")
            _claims(plugin, "map", environment.needs(), environment.parts.features())
            plugin._learn(environment)
            plugin.prepare(environment, budget, Context(self._channel, request, budget))
            self._environment = environment

        return _outcome(prepare)

    def _plan(self, request: int, params: Mapping[str, Any]) -> Any:
        planner = self._of(Planner, "plan")
        environment = self._prepared()
        budget = _read(Budget._from_wire, params, "budget")

        def plan() -> _Asked:
            instance = _read(
                lambda wire: Instance._from_wire(wire, environment), params, "instance"
            )
            _claims(planner, "instance", instance.needs(), instance.features())
            form = Form(environment, instance)
            context = Context(
                self._channel, request, budget, form, extensions=_extensions(params)
            )
            return context, lambda: planner.plan(instance, budget, context)

        return _plan_result(plan)

    def _recover(self, request: int, params: Mapping[str, Any]) -> Any:
        policy = self._of(FailPolicy, "recover")
        environment = self._prepared()
        budget = _read(Budget._from_wire, params, "budget")

        def recover() -> _Asked:
            instance = _read(
                lambda wire: Instance._from_wire(wire, environment), params, "instance"
            )
            # It gets the fleet moving whatever the planner was asked to do, but authors count
            # on goals.
            idle = [needed for needed in instance.needs() if needed == "idle"]
            _claims(policy, "instance", idle, instance.features())
            form = Form(environment, instance)
            failed: Any = None
            if params.get("failed_plan") is not None:
                failed = _read(form.decode, params, "failed_plan")
            context = Context(
                self._channel, request, budget, form, extensions=_extensions(params)
            )
            return context, lambda: policy.recover(instance, failed, budget, context)

        return _plan_result(recover)

    def _generate(self, request: int, params: Mapping[str, Any]) -> Any:
        generator = self._of(InstanceGenerator, "generate")
        environment = self._prepared()
        budget = _read(Budget._from_wire, params, "budget")
        context = Context(self._channel, request, budget, keeps=True)
        made: Dict[str, Any] = {}

        def generate() -> None:
            state = _read(lambda wire: FleetState._from_wire(wire, environment), params, "state")
            _claims(generator, "state", (), state.parts.features() + state.next.parts.features())
            answer = generator.generate(state, budget, context)
            if not isinstance(answer, Request):
                raise TypeError(f"`generate` returned no Request but {answer!r:.60}")
            answer = answer._plain()
            answer._check(state.agents, environment.places)
            made["request"] = answer._to_wire()

        result = _outcome(generate)
        result.update(made)
        return result

    def _should_invoke(self, request: int, params: Mapping[str, Any]) -> Any:
        policy = self._of(InvocationPolicy, "should_invoke")
        status = _read(FleetStatus._from_wire, params, "status")
        answer: List[bool] = []

        def decide() -> None:
            invoke: Any = policy.should_invoke(status, Context(self._channel, request))
            if invoke is None:
                raise TypeError("`should_invoke` returned None, not whether to call the planner")
            answer.append(bool(invoke))

        outcome = _outcome(decide)
        if not answer:
            raise _Refusal(INTERNAL_ERROR, f"{outcome['status']}: {outcome['message']}")
        return {"invoke": answer[0]}

    def _shutdown(self, _: int, __: Mapping[str, Any]) -> Any:
        self._object = self._environment = None
        return None

    # ---- What several methods need ----

    def _of(self, kind: Any, method: str) -> Any:
        if isinstance(self._object, kind):
            return self._object
        if self._object is None:
            raise _Refusal(INVALID_REQUEST, f"`{method}` came before a successful `create`")
        reason = f"`{method}` is not for a plugin of kind {self._object.kind}"
        raise _Refusal(INVALID_REQUEST, reason)

    def _prepared(self) -> Environment:
        if self._environment is None:
            raise _Refusal(INVALID_REQUEST, "the call came before a successful `prepare`")
        return self._environment


def _claims(
    plugin: Plugin, what: str, capabilities: Iterable[str], features: Iterable[str]
) -> None:
    """That a plugin claims what a map or an instance needs."""
    lacking = [("capability", name) for name in capabilities if name not in plugin.capabilities]
    lacking += [("feature", name) for name in features if name not in plugin.features]
    for kind, name in lacking:
        raise Unsupported(
            f"the {what} needs the {kind} `{name}`, which this plugin does not claim; hint: take "
            "one that does"
        )


def _read(read: Callable[[Any], Any], params: Mapping[str, Any], name: str) -> Any:
    try:
        return read(params[name])
    except KeyError as error:
        raise _Refusal(INVALID_PARAMS, f"`{name}`: there is no {error}") from None
    except (TypeError, ValueError, AttributeError, IndexError) as error:
        raise _Refusal(INVALID_PARAMS, f"`{name}`: {error}") from None


def _extensions(params: Mapping[str, Any]) -> Sequence[str]:
    """What the host offers for a call besides."""
    extensions = params.get("extensions") or ()
    if not isinstance(extensions, (list, tuple)):
        raise _Refusal(INVALID_PARAMS, "`extensions` is no list")
    return extensions


def _outcome(call: Callable[[], Any]) -> Dict[str, Any]:
    """Runs a call of the plugin: whatever it raises becomes a status."""
    try:
        call()
    except _Refusal:
        raise
    except Failure as failure:
        return {"status": failure.status, "message": failure.message}
    except (Exception, SystemExit) as error:
        traceback.print_exc(file=sys.stderr)
        return {"status": "internal-error", "message": f"{type(error).__name__}: {error}"}
    return {"status": "solved"}


def _plan_result(ask: Callable[[], _Asked]) -> Dict[str, Any]:
    """The answer to a call that asked for a plan; ``ask`` reads what was asked."""
    written: Dict[str, Any] = {}
    worked: List[int] = [0]

    def plan() -> None:
        context, call = ask()
        began = time.monotonic_ns()
        try:
            found = call()
        finally:
            worked[0] = time.monotonic_ns() - began - context._writing_ns
        if found is not None:
            assert context._form is not None
            written[context._form.field] = context._form.encode(found)
        elif not context._submitted:
            raise GaveUp("the plugin returned None and had handed over no plan")

    result = _outcome(plan)
    result.update(written)
    result["call_ns"] = max(worked[0], 0)
    return result


def serve(
    plugins: Sequence[Type[Plugin]],
    input: BinaryIO,
    output: BinaryIO,
    gone: Callable[[], None] = lambda: None,
) -> None:
    """Serves plugins on two streams until the host says ``exit`` or closes the input.
    Then ``gone`` is called from the reading thread, even while a call is running.
    """
    for plugin in plugins:
        if inspect.isabstract(plugin):
            missing = ", ".join(sorted(plugin.__abstractmethods__))
            raise TypeError(f"{plugin.__name__} does not define {missing}")
        if not re.fullmatch(r"[a-z0-9][a-z0-9._-]*", plugin.identifier()):
            raise ValueError(f"{plugin.identifier()!r} is no identifier: use a-z, 0-9, . _ -")
    channel = Channel(output)
    lines: queue.SimpleQueue[Optional[bytes]] = queue.SimpleQueue()

    def read() -> None:
        for line in _lines(input):
            notification = _notification(line)
            if notification is None:
                lines.put(line)
            elif notification == "exit":
                break
            else:
                channel.cancelled = notification
        lines.put(None)
        gone()

    threading.Thread(target=read, name="fleetyard-reader", daemon=True).start()
    server = _Server(plugins, channel)
    while True:
        line = lines.get()
        if line is None:
            return
        server.answer(line)


def _lines(input: BinaryIO) -> Iterator[bytes]:
    while True:
        try:
            line = input.readline()
        except (OSError, ValueError):
            return
        if not line:
            return
        yield line


def _notification(line: bytes) -> Any:
    """A notification that must be heard while a call is running: the id to cancel, or
    ``exit``. Other lines are cheap to rule out."""
    if len(line) > 256 or (b"cancel" not in line and b"exit" not in line):
        return None
    try:
        message = _parse(line)
        method = message.get("method")
        if method == "exit":
            return "exit"
        if method == "$/cancel" and _is_id(message["params"]["id"]):
            return message["params"]["id"]
    except (ValueError, AttributeError, KeyError, TypeError, RecursionError):
        pass
    return None


def run(*plugins: Type[Plugin]) -> None:
    """Serves plugins on standard input and output: the last line of a plugin's
    script. The process ends when the host says so or goes away.

    The protocol moves to private descriptors first: standard output becomes standard
    error, so that a stray ``print`` is a line in the log. Started from a terminal, it
    explains itself and exits with 2.
    """
    if not plugins:
        raise TypeError("run() needs at least one plugin class")
    if sys.stdin is None or sys.stdin.isatty():
        offers = "\n".join(f"  {plugin.identifier()} ({plugin.kind})" for plugin in plugins)
        print(
            "This program is a Fleetyard plugin: it speaks JSON over standard input and output "
            f"and is started by the host.\nIt offers:\n{offers}\n"
            f"hint: try `fleetyard plugins info {sys.argv[0]}`",
            file=sys.stderr,
        )
        sys.exit(2)
    input, output = _private_stdio()

    def gone() -> None:
        # A call that is nearly done may finish; one that is not, may not.
        time.sleep(_GRACE_S)
        os._exit(0)

    try:
        serve(plugins, input, output, gone)
    except KeyboardInterrupt:
        sys.exit(130)


def _private_stdio() -> Tuple[BinaryIO, BinaryIO]:
    if sys.stdout is not None:
        sys.stdout.flush()
    input, output = os.dup(0), os.dup(1)  # not inherited by children
    null = os.open(os.devnull, os.O_RDONLY)
    os.dup2(null, 0)
    os.close(null)
    os.dup2(2, 1)
    if hasattr(sys.stdout, "reconfigure"):
        sys.stdout.reconfigure(line_buffering=True)
    return os.fdopen(input, "rb"), os.fdopen(output, "wb")
