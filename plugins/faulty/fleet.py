#!/usr/bin/env python3
"""The four modules of a fleet that misbehave on request: option `fault`, see README.md. A
fixture for tests of the host.

With `none` they are honest: the planner and the fail policy let robots go towards their
goals through cells that nobody is in, the generator repeats the goals that there are, and
the invocation policy calls every `period_s`. The fault happens in every `every`-th call of
a process.
"""

import os
import pathlib
import signal
import sys
import time

try:
    import fleetyard
except ImportError:  # not installed: the package lies in the same repository
    sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "abi" / "python"))
    import fleetyard

CAPABILITIES = ("grid", "pebble", "windowed", "duplicate-goals", "colliding-plans")


def schema(*faults):
    return {
        "type": "object",
        "additionalProperties": False,
        "properties": {
            "fault": {"enum": ["none", *faults], "default": "none"},
            "every": {"type": "integer", "minimum": 1, "default": 1},
            "period_s": {"type": "number", "minimum": 0, "default": 1},
        },
    }


class Faulty:
    """Counts calls, and does to its process what any kind of plugin may."""

    version = "0.1.0"
    license = "MIT OR Apache-2.0"
    calls = 0

    def fault(self):
        self.calls += 1
        fault = self.options["fault"] if self.calls % self.options["every"] == 0 else "none"
        if fault == "crash":
            print("something is wrong", file=sys.stderr, flush=True)
            os.kill(os.getpid(), signal.SIGSEGV)
        if fault == "late":
            time.sleep(60)
        if fault == "tardy":
            time.sleep(0.4)
        if fault == "fails":
            raise fleetyard.Failure("failed as asked")
        if fault == "works-between-calls" and self.calls == 1 and os.fork() == 0:
            end = time.monotonic() + 60
            while time.monotonic() < end:
                pass
            os._exit(0)
        return fault

    def walk(self, instance):
        """Paths towards the first goals, through cells that are free before each step."""
        at = list(instance.starts)
        paths = [[cell] for cell in at]
        distances = [self.grid.distances(goals[0]) for goals in instance.goals]
        for _ in range(min(instance.window_steps or 8, 8)):
            taken = set(at)
            for agent, here in enumerate(at):
                free = [cell for cell in self.grid.neighbors(here) if cell not in taken]
                best = min([here, *free], key=distances[agent].__getitem__)
                taken.add(best)
                at[agent] = best
                paths[agent].append(best)
        return paths

    def collide(self, instance):
        """The same, but the first agent goes to where the second one stands."""
        paths = [[cell] for cell in instance.starts]
        distance = self.grid.distances(instance.starts[1])
        while paths[0][-1] != instance.starts[1]:
            near = self.grid.neighbors(paths[0][-1])
            paths[0].append(min(near, key=distance.__getitem__))
        return paths


class Planner(Faulty, fleetyard.Planner):
    id = "faulty-fleet"
    description = "A planner that fails as asked."
    capabilities = CAPABILITIES
    features = ("part:fleetyard.kept/1",)
    options_schema = schema(
        "crash",
        "late",
        "tardy",
        "works-between-calls",
        "fails",
        "gives-up",
        "nonsense",
        "collide",
        "collide-and-give-up",
        "remembers",
        "keeps-garbage",
        "keeps-too-much",
        "keeps-and-crashes",
    )

    def plan(self, instance, budget, context):
        fault = self.fault()
        if fault == "keeps-garbage":
            context.keep(bytes((byte * self.calls) % 251 for byte in range(1000)))
        if fault == "keeps-too-much":
            context._notify("keep", lambda: {"bytes": "00" * (fleetyard.KEPT_LIMIT + 1)})
        if self.options["fault"] == "keeps-and-crashes":
            # The calls that ended well, whatever became of processes meanwhile.
            context.keep(int.to_bytes(int.from_bytes(instance.parts.kept or b"", "big") + 1, 8, "big"))
            if fault != "none":
                os.kill(os.getpid(), signal.SIGSEGV)
        if fault == "gives-up":
            raise fleetyard.GaveUp("gave up as asked")
        if fault == "nonsense":
            return [[0, len(self.grid.passable) - 1] for _ in instance.starts]
        if fault == "collide":
            return self.collide(instance)
        if fault == "collide-and-give-up":
            context.incumbent(self.collide(instance))
            raise fleetyard.GaveUp("its paths collide")
        # Robots wait longer from call to call.
        waits = min(self.calls, 6) if fault == "remembers" else 0
        return [path[:1] * waits + path for path in self.walk(instance)]


class Alone(Planner):
    id = "faulty-fleet-alone"
    description = "The same planner, which does not claim that robots may share goals."
    capabilities = tuple(name for name in CAPABILITIES if name != "duplicate-goals")


class FailPolicy(Faulty, fleetyard.FailPolicy):
    id = "faulty-fleet"
    description = "A fail policy that fails as asked, or where it gets no paths."
    capabilities = CAPABILITIES
    options_schema = schema("crash", "late", "fails", "collide", "no-paths")

    def recover(self, instance, failed_plan, budget, context):
        fault = self.fault()
        if fault == "collide":
            return self.collide(instance)
        if fault == "no-paths" and failed_plan is None:
            raise fleetyard.GaveUp("there are no failed paths")
        return self.walk(instance)


class Generator(Faulty, fleetyard.InstanceGenerator):
    id = "faulty-fleet"
    description = "An instance generator that fails as asked."
    capabilities = CAPABILITIES
    options_schema = schema(
        "crash", "fails", "blocked", "duplicate", "missing", "longer-window", "invents-tasks"
    )

    def generate(self, state, budget, context):
        fault = self.fault()
        goals = [list(own) for own in state.next.goals]
        if fault == "blocked":
            goals[1] = [next(c for c, free in enumerate(self.grid.passable) if not free)]
        if fault == "duplicate":
            goals = [[goals[0][0]] for _ in goals]
        if fault == "missing":
            goals.pop()
        request = state.request(goals)
        if fault == "duplicate":
            request.window_steps = 0
        if fault == "longer-window":
            request.window_steps += 1
        if fault == "invents-tasks":
            request.assignments = [fleetyard.Assignment(0, 12345)]
        return request


class InvocationPolicy(Faulty, fleetyard.InvocationPolicy):
    id = "faulty-fleet"
    description = "An invocation policy that never calls, or always, or fails as asked."
    options_schema = schema("crash", "fails", "never", "always")

    def should_invoke(self, status, context):
        fault = self.fault()
        if fault in ("never", "always"):
            return fault == "always"
        return status.since_last_call_s >= self.options["period_s"]


if __name__ == "__main__":
    fleetyard.run(Planner, Alone, FailPolicy, Generator, InvocationPolicy)
