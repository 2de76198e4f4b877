#!/usr/bin/env python3
"""A planner that misbehaves on request: option `fault`, see README.md. A fixture for
tests of the host, and nothing to learn from. It speaks the protocol without the SDK,
which would not let it.

With `none` it is honest: the agents go to their goals one after the other while all
others stand. Faults of plans begin with that honest plan and add one wrong thing, as
in faulty.c. What it does to its process and to the machine stands in mischief.py.
"""

import array
import fcntl
import json
import os
import sys
import termios
import time
from collections import deque

import mischief

PLAN_FAULTS = """too-few-agents too-many-agents empty-path wrong-start not-at-goal teleport
    collide collide-parked swap leave-map through-obstacle""".split()
ANSWER_FAULTS = """late twice two-results claims-solved-without-plan claims-infeasible
    bad-status huge-plan huge-answer late-huge-answer incumbent-flood answers-early null-plan
    fails rpc-error bad-cells bad-moves exit-after-plan hangs-after-plan crash-after thread-raises forged-time
    endless-call keeps-too-much first-plan-forged""".split()
# What it says of itself.
IDENTITIES = {
    "id-of-a-path": {"id": "../../faulty"},
    "id-of-nobody": {"id": ""},
    "id-of-two-lines": {"id": "faulty\nverdict           valid"},
    "forged-header": {"version": "0.1.0 (worker process)\nverdict           valid\x1b[1A"},
}
FAULTS = ["none", *PLAN_FAULTS, *ANSWER_FAULTS, *IDENTITIES, *mischief.FAULTS]

SCHEMA = {
    "type": "object",
    "additionalProperties": False,
    "properties": {
        "fault": {"enum": FAULTS, "default": "none"},
        "during": {
            "enum": ["initialize", "create", "prepare", "plan", "shutdown"],
            "default": "plan",
            "description": "The call that fails; `initialize` only by FLEETYARD_FAULT.",
        },
        "size": {
            "type": "integer",
            "minimum": 1,
            "description": "Bytes to take or to write [default: depends on the fault].",
        },
        "count": {
            "type": "integer",
            "minimum": 1,
            "description": "Most processes, threads or files [default: depends on the fault].",
        },
        "target": {
            "type": "string",
            "maxLength": 255,
            "description": "What an attempt is at: a path, HOST:PORT, the name of a variable, "
            "an address in memory.",
        },
        "pid": {
            "type": "integer",
            "minimum": 1,
            "description": "The process that an attempt is at [default: the parent].",
        },
    },
}


def write(data):
    while data:
        data = data[os.write(1, data) :]


def send(message):
    write(json.dumps(message).encode() + b"\n")


def notify(method, **params):
    send({"jsonrpc": "2.0", "method": method, "params": params})


def pad(head, tail, size, until=0):
    """Writes a message with so many blanks in the middle, and more of them until then."""
    write(head)
    blanks = b" " * (1 << 20)
    while size > 0 or time.monotonic_ns() < until:
        write(blanks)
        size -= len(blanks)
    write(tail + b"\n")


class Spoiled(Exception):
    """Why an instance does not allow a fault."""


class Steps:
    """Where everybody is, step by step."""

    def __init__(self, grid, instance):
        self.rows, self.cols = grid["rows"], grid["cols"]
        self.free = [letter == "." for row in grid["passable"] for letter in row]
        self.at = [list(instance["starts"])]
        waiting = [(agent, goals[-1]) for agent, goals in enumerate(instance["goals"])]
        while waiting:
            left = [(agent, goal) for agent, goal in waiting if not self.go(agent, goal)]
            if len(left) == len(waiting):
                raise Spoiled("too crowded for the honest part of the plan")
            waiting = left

    def step(self, agent=None, cell=None):
        self.at.append(list(self.at[-1]))
        if agent is not None:
            self.at[-1][agent] = cell

    def near(self, cell):
        row, col = divmod(cell, self.cols)
        for r, c in ((row - 1, col), (row, col + 1), (row + 1, col), (row, col - 1)):
            if 0 <= r < self.rows and 0 <= c < self.cols:
                yield r * self.cols + c

    def search(self, agent, through=None):
        start, standing = self.at[-1][agent], set(self.at[-1])
        came, queue = {start: None}, deque([start])
        while queue:
            cell = queue.popleft()
            for near in self.near(cell):
                if self.free[near] and near not in came:
                    if near not in standing or near == through:
                        came[near] = cell
                        queue.append(near)
        return came

    def walk(self, agent, came, to):
        path = []
        while came[to] is not None:
            path.append(to)
            to = came[to]
        for cell in reversed(path):
            self.step(agent, cell)

    def go(self, agent, to):
        came = self.search(agent)
        if to in came:
            self.walk(agent, came, to)
        return to in came

    def beside(self, cell):
        standing = set(self.at[-1])
        for near in self.near(cell):
            if self.free[near] and near not in standing:
                return near
        return None

    def spoil(self, fault):
        home = self.at[-1][0]
        beside = self.beside(home)
        if fault in ("not-at-goal", "collide") and beside is None:
            raise Spoiled("agent 0 cannot leave its goal")
        if fault == "leave-map":
            self.step(0, -1)
            self.step(0, home)
        elif fault == "not-at-goal":
            self.step(0, beside)
        elif fault == "wrong-start":
            for agent, start in enumerate(self.at[0]):
                near = self.beside(start)
                if near is not None and near not in self.at[0]:
                    self.at.insert(0, list(self.at[0]))
                    self.at[0][agent] = near
                    return
            raise Spoiled("no agent has a free cell beside its start")
        elif fault == "teleport":
            for cell, free in enumerate(self.free):
                far = abs(cell // self.cols - home // self.cols) >= 2
                if far and free and cell not in self.at[-1]:
                    self.step(0, cell)
                    self.step(0, home)
                    return
            raise Spoiled("no cell is far enough away")
        elif fault == "through-obstacle":
            came = self.search(0)
            for cell in sorted(came):
                for wall in self.near(cell):
                    if not self.free[wall]:
                        self.walk(0, came, cell)
                        self.step(0, wall)
                        self.step(0, cell)
                        self.go(0, home)
                        return
            raise Spoiled("agent 0 reaches no obstacle")
        elif fault in ("collide", "collide-parked", "swap"):
            if len(self.at[0]) < 2:
                raise Spoiled("it takes two agents")
            other, came = self.at[-1][1], self.search(1, through=home)
            if home not in came:
                raise Spoiled("agent 1 does not reach agent 0")
            door = came[home]
            self.walk(1, came, door)
            self.step(1, home)
            if fault == "swap":
                self.at[-1][0] = door
            self.step(1, door)
            self.at[-1][0] = home
            self.go(1, other)
            if fault == "collide":  # agent 0 moves once more: it was not parked
                self.step(0, beside)
                self.step(0, home)


def plan_paths(grid, instance, fault):
    steps = Steps(grid, instance)
    steps.spoil(fault)
    cols = steps.cols
    paths = [
        [[-1, 0] if cell < 0 else list(divmod(cell, cols)) for cell in path]
        for path in zip(*steps.at)
    ]
    if fault == "too-few-agents":
        paths.pop()
    elif fault == "too-many-agents":
        paths.append(paths[0])
    elif fault == "empty-path":
        paths[0] = []
    elif fault == "bad-cells":
        paths[0] = ["here", "there"]
    elif fault == "bad-moves":
        paths[0] = "NOWHERE"
    return paths


def moves(path):
    letters = {(0, 0): ".", (-1, 0): "N", (0, 1): "E", (1, 0): "S", (0, -1): "W"}
    steps = zip(path, path[1:])
    return "".join(letters[to[0] - of[0], to[1] - of[1]] for of, to in steps)


def hang_once_read(target):
    """Makes the file when the host has read all that was written, and does nothing more."""
    unread = array.array("i", [1])
    while unread[0]:
        fcntl.ioctl(1, termios.FIONREAD, unread)
    open(target, "w").close()
    while True:
        time.sleep(60)


def answer_plan(request, grid, params, fault, size, target):
    def reply(**result):
        send({"jsonrpc": "2.0", "id": request, "result": result})

    if fault == "claims-solved-without-plan":
        return reply(status="solved")
    if fault == "claims-infeasible":
        return reply(status="infeasible", message="it cannot be done, believe me")
    if fault == "bad-status":
        return reply(status="brilliant")
    if fault == "fails":
        return reply(status="internal-error", message="failed as asked")
    if fault == "rpc-error":
        error = {"code": -32603, "message": "failed as asked"}
        return send({"jsonrpc": "2.0", "id": request, "error": error})
    if fault == "null-plan":
        return reply(status="solved", paths=None)
    if fault == "huge-plan":  # letters of moves: as many cells as bytes
        head = '{"jsonrpc":"2.0","id":%d,"result":{"status":"solved","paths":["' % request
        write(head.encode())
        for _ in range(0, size, 1 << 20):
            write(b"." * (1 << 20))
        return write(b'"]}}\n')
    try:
        paths = plan_paths(grid, params["instance"], fault)
    except Spoiled as reason:
        return reply(status="gave-up", message=str(reason))
    if fault == "late":
        left = params["budget"]["deadline_monotonic_ns"] - time.monotonic_ns()
        time.sleep(max(0, left) * 1e-9 + 0.5)
    if fault in ("huge-answer", "late-huge-answer"):
        until = 0
        if fault == "late-huge-answer":
            until = params["budget"]["deadline_monotonic_ns"] + 500_000_000
        head = '{"jsonrpc":"2.0","id":%d,"result":{"status":"solved","paths":[' % request
        tail = json.dumps(paths)[1:] + "}}"
        return pad(head.encode(), tail.encode(), size, until)
    if fault == "incumbent-flood":
        longer = [moves(path) + "." * 50_000 for path in paths]
        plan = {"jsonrpc": "2.0", "method": "incumbent", "params": {"paths": longer}}
        line = json.dumps(plan).encode() + b"\n"
        for _ in range(0, size, len(line)):
            write(line)
        write(b"\n" * (1 << 20))
    if fault == "keeps-too-much":
        notify("keep", bytes="00" * ((1 << 20) + 1))
    if fault == "exit-after-plan":
        notify("incumbent", paths=paths)
        sys.exit(0)
    if fault == "hangs-after-plan":
        notify("incumbent", paths=paths)
        hang_once_read(target)
    if fault == "crash-after":
        mischief.crash_later()
    if fault == "thread-raises":
        mischief.thread_raises()
    if fault == "forged-time":
        time.sleep(0.3)
        return reply(status="solved", paths=paths, call_ns=1)
    if fault == "endless-call":
        return reply(status="solved", paths=paths, call_ns=10**18)
    if fault == "first-plan-forged":
        # No solution: nobody leaves the start.
        notify("incumbent", paths=[path[:1] for path in paths])
        time.sleep(0.3)
    if fault in ("twice", "two-results"):
        notify("incumbent", paths=paths)
        notify("incumbent", paths=paths)
    if fault == "two-results":
        reply(status="solved", paths=paths)
    return reply(status="solved", paths=paths)


def main():
    # So that `initialize` can fail too, before there are options.
    options = {"fault": os.environ.get("FLEETYARD_FAULT", "none"), "during": "initialize"}
    for name in ("target", "size", "count", "pid"):
        value = os.environ.get(f"FLEETYARD_{name.upper()}")
        if value:
            options[name] = value if name == "target" else int(value)
    grid = None
    while True:
        line = sys.stdin.buffer.readline()
        if not line:
            return
        message = json.loads(line)
        method, request = message["method"], message.get("id")
        params = message.get("params")
        if method == "exit":
            return
        if request is None:
            continue
        if method == "create":
            options = dict(params.get("options") or {})
            options.setdefault("during", "plan")
        fault = options.get("fault", "none") if options["during"] == method else "none"
        if fault in mischief.FAULTS:
            mischief.FAULTS[fault](mischief.Call(options, request, write, notify))
        if method == "initialize":
            about = {
                "id": "faulty",
                "kind": "planner",
                "name": "Faulty",
                "version": "0.1.0",
                "description": "Misbehaves on request. For tests of the host.",
                "capabilities": ["grid", "pebble", "deterministic"],
                "options_schema": SCHEMA,
                **IDENTITIES.get(fault, {}),
            }
            result = {"protocol_version": 1, "plugins": [about]}
        elif method == "plan":
            size, target = options.get("size", 1 << 30), options.get("target")
            answer_plan(request, grid, params, fault, size, target)
            continue
        elif method == "shutdown":
            result = None
            if options.get("fault") == "crash-after":
                time.sleep(1)  # so that the thread has its time
        else:
            if method == "prepare":
                grid = params["environment"]["grid"]
            failed = {"status": "internal-error", "message": "failed as asked"}
            result = failed if fault == "fails" else {"status": "solved"}
        answer = {"jsonrpc": "2.0", "id": request, "result": result}
        if method == "prepare" and options.get("fault") == "answers-early":
            plan = {"jsonrpc": "2.0", "id": request + 1, "result": {"status": "gave-up"}}
            write(b"".join(json.dumps(each).encode() + b"\n" for each in (answer, plan)))
            continue
        send(answer)
        if fault == "two-results":
            send(answer)


main()
