"""The package from outside: conversations with the served protocol, and a script as
the host starts one."""

import io
import json
import math
import os
import pathlib
import re
import signal
import subprocess
import sys
import tempfile
import textwrap
import time
import unittest
import zipfile
from contextlib import redirect_stderr

ROOT = pathlib.Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

import fleetyard  # noqa: E402
from fleetyard import _paths  # noqa: E402

try:
    import numpy
except ImportError:
    numpy = None

FAR = 2**63
BUDGET = {"deadline_monotonic_ns": FAR, "wall_ns": 1}
GRID = {
    "representation": "grid",
    "map_name": "m",
    "rows": 2,
    "cols": 3,
    "connectivity": 4,
    "cell_size_m": 1.0,
    "step_s": 1.0,
    "passable": ["..@", "..."],
    "unknown": 1,
}
INSTANCE = {"starts": [0, 4], "goals": [[1], [5]]}


def request(number, method, **params):
    return json.dumps({"jsonrpc": "2.0", "id": number, "method": method, "params": params})


def create(kind="planner", plugin="test", **more):
    return request(1, "create", kind=kind, plugin=plugin, **more)


PREPARE = request(2, "prepare", environment=GRID, budget=BUDGET)
PLAN = request(3, "plan", instance=INSTANCE, budget=BUDGET)


def converse(plugins, *lines):
    """The answers to some lines, and what went to standard error."""
    text = "\n".join(lines).encode() + b"\n"
    return converse_bytes(plugins, text)


def converse_bytes(plugins, text):
    output, errors = io.BytesIO(), io.StringIO()
    with redirect_stderr(errors):
        fleetyard.serve(plugins, io.BytesIO(text), output)
    answers = [read(line) for line in output.getvalue().splitlines()]
    return answers, errors.getvalue()


def read(line):
    """A message; how long a call took is left out, once it is known to be a duration."""
    message = json.loads(line)
    result = message.get("result")
    if isinstance(result, dict) and "call_ns" in result:
        spent = result.pop("call_ns")
        assert isinstance(spent, int) and 0 <= spent < 10**12, spent
    return message


def planner(plan):
    """A planner class whose method is a function of (self, instance, budget, context)."""

    class Test(fleetyard.Planner):
        pass

    Test.plan = plan
    Test.__abstractmethods__ = frozenset()
    return Test


def planned(plan, *more, instance=None, budget=None):
    """The messages of one call of a planner."""
    call = request(3, "plan", instance=instance or INSTANCE, budget=budget or BUDGET)
    answers, errors = converse([planner(plan)], create(), PREPARE, *more, call)
    return answers[2:], errors


class Session(unittest.TestCase):
    def test_initialize_describes_the_plugins(self):
        class MyPlanner(fleetyard.Planner):
            """Does
            nothing."""

            version = "1.2"

            def plan(self, instance, budget, context):
                return None

        ask = request(7, "initialize", protocol_versions=[1, 9], host={"name": "h", "version": "1"})
        (answer,), _ = converse([MyPlanner], ask)
        self.assertEqual(answer["id"], 7)
        self.assertEqual(answer["result"]["protocol_version"], 1)
        (plugin,) = answer["result"]["plugins"]
        self.assertEqual(plugin["id"], "my-planner")
        self.assertEqual(plugin["kind"], "planner")
        self.assertEqual(plugin["description"], "Does nothing.")
        self.assertEqual(plugin["capabilities"], ["grid", "pebble"])

    def test_faults_of_the_host_are_answered_and_the_session_goes_on(self):
        stay = planner(lambda self, instance, budget, context: [[s] for s in instance.starts])
        deep = '{"jsonrpc":"2.0","id":1,"method":"create","params":' + "[" * 100_000
        cases = [
            (PLAN, -32600, "`plan` came before a successful `create`"),
            ("{", -32700, ""),
            ('{"id":1,"x":NaN}', -32700, "NaN is not JSON"),
            ("[1]", -32600, "not a request"),
            ('{"id":-1,"method":"plan"}', -32600, "not a request"),
            (request(9, "dance"), -32601, "there is no method `dance`"),
            (request(9, "initialize", protocol_versions=[7]), -32602, "protocol 1, not [7]"),
            (deep, -32700, ""),
        ]
        for line, code, message in cases:
            with self.subTest(line=line[:60]):
                answers, _ = converse([stay], line, create())
                self.assertEqual(answers[0]["error"]["code"], code)
                self.assertIn(message, answers[0]["error"]["message"])
                self.assertEqual(answers[1]["result"]["status"], "solved")
        answers, _ = converse_bytes([stay], b'{"id":1,"method":"\xff"}\n' + create().encode())
        self.assertEqual(answers[0]["error"]["code"], -32700)
        self.assertEqual(answers[1]["result"]["status"], "solved")

    def test_instances_that_do_not_fit_the_map_are_refused(self):
        stay = planner(lambda self, instance, budget, context: None)
        for instance, message in [
            ({"starts": [0, 6], "goals": [[1], [5]]}, "cell 6 is not on a map of 6 cells"),
            ({"starts": [0], "goals": [[1], [5]]}, "1 starts but 2 goal lists"),
            ({"starts": [0, 4], "goals": [[1], []]}, "agent 1 has no goal"),
            ({"starts": [0, 4]}, "there is no 'goals'"),
            ({"starts": 5, "goals": []}, "instance"),
        ]:
            with self.subTest(message=message):
                call = request(3, "plan", instance=instance, budget=BUDGET)
                answers, _ = converse([stay], create(), PREPARE, call)
                self.assertEqual(answers[2]["error"]["code"], -32602)
                self.assertIn(message, answers[2]["error"]["message"])

    def test_create_names_what_is_wrong(self):
        class Picky(fleetyard.Planner):
            options_schema = {
                "additionalProperties": False,
                "properties": {"speed": {"type": "integer"}, "depth": {"default": 7}},
            }

            def __init__(self, options):
                raise fleetyard.InvalidInput(f"speed {options['speed']}, depth {options['depth']}")

            def plan(self, instance, budget, context):
                return None

        for ask, status, message in [
            (create(plugin="picky", options={"speed": 3}), "invalid-input", "speed 3, depth 7"),
            (create(plugin="picky", options={"deep": 3}), "invalid-input",
             "options: there is no option `deep`"),
            (create(plugin="picky", options={}), "internal-error", "KeyError: 'speed'"),
            (create(plugin="picky", options=[1]), "invalid-input", "options: not an object"),
            (create(plugin="other"), "unsupported", "there is no planner `other`"),
        ]:
            answers, _ = converse([Picky], ask)
            self.assertEqual(answers[0]["result"], {"status": status, "message": message})

    def test_a_map_that_is_no_grid_is_unsupported(self):
        stay = planner(lambda self, instance, budget, context: None)
        other = request(2, "prepare", environment={"representation": "roadmap"}, budget=BUDGET)
        answers, _ = converse([stay], create(), other, PLAN)
        self.assertEqual(answers[1]["result"]["status"], "unsupported")
        self.assertIn("before a successful `prepare`", answers[2]["error"]["message"])

    def test_classes_are_checked_when_served(self):
        class Unfinished(fleetyard.Planner):
            pass

        class Named(fleetyard.InvocationPolicy):
            id = "No Identifier"

            def should_invoke(self, status, context):
                return True

        with self.assertRaisesRegex(TypeError, "Unfinished does not define plan"):
            fleetyard.serve([Unfinished], io.BytesIO(), io.BytesIO())
        with self.assertRaisesRegex(ValueError, "no identifier"):
            fleetyard.serve([Named], io.BytesIO(), io.BytesIO())


class Array:
    """As much of a numpy array as the package uses."""

    def __init__(self, values):
        self.values = values

    def tolist(self):
        return self.values


class Plans(unittest.TestCase):
    def test_every_form_of_a_path(self):
        for paths in [
            [[0, 1], [4, 5]],
            [[(0, 0), (0, 1)], [(1, 1), (1, 2)]],
            (((0, 0), (0, 1)), [[1, 1], [1, 2]]),
            ["E", "E"],
            Array([[0, 1], [4, 5]]),
            [Array([[0, 0], [0, 1]]), Array([4, 5])],
            [iter([0, 1]), "E"],
        ]:
            with self.subTest(paths=paths):
                (answer,), _ = planned(lambda self, *_: paths)
                self.assertEqual(answer["result"], {"status": "solved", "paths": ["E", "E"]})

    def test_faulty_plans_reach_the_host_as_they_are(self):
        for path, wire in [
            ([0, 5], [[0, 0], [1, 2]]),
            ([1], [[0, 1]]),
            ([], []),
            ([(0, 0), (-1, 0)], [[0, 0], [-1, 0]]),
            ([0, 7], [[0, 0], [2, 1]]),
            ([0, -1], [[0, 0], [-1, 2]]),
        ]:
            with self.subTest(path=path):
                (answer,), _ = planned(lambda self, *_: [path, "."])
                self.assertEqual(answer["result"]["paths"], [wire, "."])

    def test_what_is_no_plan_is_an_internal_error(self):
        for paths, message in [
            ([[0]], "ValueError: the plan has 1 paths, but the instance has 2 agents"),
            (3, "TypeError: a plan is a list with one path per agent, not 3"),
            ("NE", "TypeError: a plan is a list with one path per agent, not 'NE'"),
            ([[0], 4], "TypeError: the path of agent 1 is not a list but 4"),
            ([[0], [4, 5.0]], "the path of agent 1 has 5.0 at time 1"),
            ([[0], [(1, 1), (1,)]], "the path of agent 1 has (1,) at time 1"),
            ([[0], "EQ"], "letter 'Q' at position 1 of the path of agent 1 is no move"),
            ([[0], None], "TypeError: the path of agent 1 is not a list but None"),
            ([[0], [4, None]], "the path of agent 1 has None at time 1"),
            ([[0], [4, "5"]], "the path of agent 1 has '5' at time 1"),
            ([[0], [4, True]], "the path of agent 1 has True at time 1"),
            ([[0], [(1, 1), (1, 2.0)]], "the path of agent 1 has (1, 2.0) at time 1"),
            ([[0], {4}], "the path of agent 1 is not a list but {4}"),
            ({0: [0], 1: [4]}, "a plan is a list with one path per agent, not {0: [0], 1: [4]}"),
        ]:
            with self.subTest(message=message):
                (answer,), errors = planned(lambda self, *_: paths)
                self.assertEqual(answer["result"]["status"], "internal-error")
                self.assertIn(message, answer["result"]["message"])
                self.assertIn("Traceback", errors)

    def test_incumbents_and_the_rest(self):
        def plan(self, instance, budget, context):
            context.log("begin", "debug")
            context.metric("expansions", 7)
            context.metric("nothing", math.nan)
            context.metric("nothing", math.inf)
            context.progress(1, 2)
            assert context.incumbent([[0, 3, 4], "E"])
            assert context.incumbent([[0, 1], [4, 5]])
            with self_test.assertRaises(ValueError):
                context.log("?", "loud")

        self_test = self
        messages, _ = planned(plan)
        self.assertEqual(
            [(m.get("method"), m.get("params", m.get("result"))) for m in messages],
            [
                ("log", {"level": "debug", "text": "begin"}),
                ("metric", {"name": "expansions", "value": 7.0}),
                ("progress", {"done": 1, "total": 2}),
                ("incumbent", {"paths": ["SE", "E"]}),
                ("incumbent", {"paths": ["E", "E"]}),
                (None, {"status": "solved"}),
            ],
        )

    def test_failures_are_statuses(self):
        for failure in (
            fleetyard.Infeasible,
            fleetyard.TimedOut,
            fleetyard.GaveUp,
            fleetyard.Cancelled,
            fleetyard.Unsupported,
            fleetyard.InvalidInput,
            fleetyard.InternalError,
        ):

            def plan(self, *_, failure=failure):
                raise failure("because")

            (answer,), errors = planned(plan)
            self.assertEqual(answer["result"], {"status": failure.status, "message": "because"})
            self.assertEqual(errors, "")
        (answer,), _ = planned(lambda *_: None)
        self.assertEqual(answer["result"]["status"], "gave-up")
        (answer,), _ = planned(lambda *_: sys.exit("enough"))
        self.assertEqual(answer["result"]["message"], "SystemExit: enough")
        (answer,), _ = planned(lambda *_: 1 // 0)
        self.assertIn("ZeroDivisionError", answer["result"]["message"])

    def test_text_that_is_not_utf_8_is_repaired(self):
        def plan(self, instance, budget, context):
            context.log("half a pair: \ud800")

        messages, _ = planned(plan)
        self.assertEqual(messages[0]["params"]["text"], "half a pair: ?")

    def test_the_deadline_ends_calls(self):
        def plan(self, instance, budget, context):
            assert budget.expired() and budget.remaining_s() < 0 and context.cancelled()
            assert not context.incumbent([[0], [4]])
            context.check()

        past = {"deadline_monotonic_ns": time.monotonic_ns() - 1, "wall_ns": 1}
        (answer,), _ = planned(plan, budget=past)
        self.assertEqual(answer["result"]["status"], "timed-out")

    def test_cancelling(self):
        def plan(self, instance, budget, context):
            while not context.cancelled():
                time.sleep(0.001)
            context.check()

        def cancel(number):
            return json.dumps({"jsonrpc": "2.0", "method": "$/cancel", "params": {"id": number}})

        (answer,), _ = planned(plan, cancel(2), cancel(3))
        self.assertEqual(answer["result"]["status"], "cancelled")

    def test_encoding_and_decoding_agree(self):
        paths = [[0, 1, 1, 4, 3], [4, 5]]
        wire = _paths.encode(paths, [0, 4], 2, 3)
        self.assertEqual(wire, ["E.SW", "E"])
        self.assertEqual(_paths.decode(wire, [0, 4], 2, 3), paths)
        self.assertEqual(_paths.encode([[0, 4], [4, 0, 4]], [0, 4], 2, 3), ["e", "we"])
        self.assertEqual(_paths.decode(["NS", [[0, 1], [9, 9], 4, 99]], [0, 4], 2, 3),
                         [[0, -1, -1], [1, -1, 4, -1]])


@unittest.skipUnless(numpy, "needs NumPy")
class Arrays(unittest.TestCase):
    def test_every_form_of_an_array(self):
        for paths in [
            numpy.array([[0, 1], [4, 5]]),
            numpy.array([[0, 1], [4, 5]], dtype=numpy.uint8),
            numpy.array([[[0, 0], [0, 1]], [[1, 1], [1, 2]]]),
            [numpy.array([0, 1]), numpy.array([[1, 1], [1, 2]], dtype=numpy.int32)],
            [[numpy.int64(0), numpy.int16(1)], [numpy.array([1, 1]), (1, numpy.int8(2))]],
            numpy.array([[0, 1], "E"], dtype=object),
        ]:
            with self.subTest(paths=paths):
                (answer,), errors = planned(lambda self, *_: paths)
                expected = {"status": "solved", "paths": ["E", "E"]}
                self.assertEqual(answer["result"], expected, errors)

        def plan(self, instance, budget, context):
            context.incumbent(numpy.array([[0, 1, 1], [4, 4, 5]]))
            context.metric("figure", numpy.float32(1.5))
            context.progress(numpy.int64(1), numpy.int64(2))

        messages, _ = planned(plan)
        self.assertEqual(messages[0]["params"], {"paths": ["E.", ".E"]})
        self.assertEqual(messages[1]["params"]["value"], 1.5)
        self.assertEqual(messages[3]["result"], {"status": "solved"})

    def test_what_is_no_plan_says_why(self):
        for paths, message in [
            (numpy.zeros((2, 3)), "the plan is an array of float64, but cells are whole numbers"),
            (numpy.zeros((2, 3), bool), "the plan is an array of bool"),
            ([[0], numpy.array([4.0])], "the path of agent 1 is an array of float64"),
            (numpy.zeros(2, int), "the plan is an array of shape (2,), not (agents, steps)"),
            (numpy.zeros((2, 3, 4), int), "shape (2, 3, 4), not (agents, steps) of cells or "
                                          "(agents, steps, 2) of rows and columns"),
            (numpy.zeros((3, 2), int), "the plan has 3 paths, but the instance has 2 agents"),
            ([[0], numpy.zeros((2, 3), int)], "the path of agent 1 is an array of shape (2, 3), "
                                              "not (steps,) of cells or (steps, 2)"),
            ([[0], numpy.int64(4)], "the path of agent 1 is an array of shape ()"),
            ([[0], [4, numpy.float32(5)]], "at time 1, which is neither a cell nor (row, col)"),
        ]:
            with self.subTest(message=message):
                (answer,), _ = planned(lambda self, *_: paths)
                self.assertEqual(answer["result"]["status"], "internal-error")
                self.assertIn(message, answer["result"]["message"])

    def test_a_grid_as_an_array(self):
        grid = fleetyard.Grid.from_rows(["..@", "..."])
        array = grid.as_numpy()
        self.assertEqual(array.dtype, bool)
        self.assertEqual(array.tolist(), [[True, True, False], [True, True, True]])

    def test_an_instance_of_arrays(self):
        class Draw(fleetyard.InstanceGenerator):
            def generate(self, state, budget, context):
                starts = numpy.array(state.cells)
                return fleetyard.Instance(starts, self.goals(numpy.array([[5]])))

        state = {"time_s": 0, "cells": [0], "goals": [[]], "tasks": []}
        for goals, status, message in [
            (lambda goals: goals, "solved", ""),
            (lambda goals: goals[0] * 1.0, "internal-error", "`goals` of agent 0 is no list"),
            (lambda goals: goals * 1.0, "internal-error", "`goals` of agent 0 has 5.0 at place 0"),
            (lambda goals: 5, "internal-error", "`goals` is no list with one list per agent"),
        ]:
            with self.subTest(message=message):
                Draw.goals = staticmethod(goals)
                answers, _ = converse(
                    [Draw],
                    create("instance-generator", "draw"),
                    PREPARE,
                    request(3, "generate", state=state, budget=BUDGET),
                )
                result = answers[2]["result"]
                self.assertEqual(result["status"], status)
                self.assertIn(message, result.get("message", ""))


class Package(unittest.TestCase):
    def test_a_wheel_of_the_standard_library_alone(self):
        sys.path.insert(0, str(ROOT))
        import build_backend

        with tempfile.TemporaryDirectory() as folder:
            name = build_backend.build_wheel(folder)
            self.assertEqual(name, f"fleetyard-{fleetyard.__version__}-py3-none-any.whl")
            with zipfile.ZipFile(pathlib.Path(folder) / name) as wheel:
                names = wheel.namelist()
                info = name.replace("-py3-none-any.whl", ".dist-info")
                record = wheel.read(f"{info}/RECORD").decode().splitlines()
                metadata = wheel.read(f"{info}/METADATA").decode()
            self.assertEqual([line.split(",")[0] for line in record], names)
            self.assertIn("fleetyard/py.typed", names)
            self.assertIn("Requires-Python: >=3.9\n", metadata)
            script = "import fleetyard; print(fleetyard.__file__)"
            environment = dict(os.environ, PYTHONPATH=str(pathlib.Path(folder) / name))
            found = subprocess.run([sys.executable, "-c", script], env=environment, cwd=folder,
                                   stdout=subprocess.PIPE, check=True).stdout
            self.assertIn(name, found.decode())
            sdist = build_backend.build_sdist(folder)
            self.assertTrue((pathlib.Path(folder) / sdist).stat().st_size > 1000)


class OtherKinds(unittest.TestCase):
    def test_recover(self):
        class Wait(fleetyard.FailPolicy):
            def recover(self, instance, failed_paths, budget, context):
                context.log(repr(failed_paths))
                return [[start] for start in instance.starts]

        def call(**more):
            return request(3, "recover", instance=INSTANCE, budget=BUDGET, **more)

        for failed, seen in [
            (["E", [4, 5]], "[[0, 1], [4, 5]]"),
            ([[[0, 0], [5, 5]], []], "[[0, -1], []]"),
            (None, "None"),
        ]:
            answers, _ = converse(
                [Wait], create("fail-policy", "wait"), PREPARE, call(failed_paths=failed)
            )
            self.assertEqual(answers[2]["params"]["text"], seen)
            self.assertEqual(answers[3]["result"], {"status": "solved", "paths": ["", ""]})
        answers, _ = converse(
            [Wait], create("fail-policy", "wait"), PREPARE, call(failed_paths=["Q", ""]), PLAN
        )
        self.assertIn("'Q'", answers[2]["error"]["message"])
        self.assertIn("is not for a plugin of kind fail-policy", answers[3]["error"]["message"])

    def test_generate(self):
        class Again(fleetyard.InstanceGenerator):
            options_schema = {"properties": {"good": {"type": "boolean"}}}

            def generate(self, state, budget, context):
                assert state.agents == 1 and state.tasks[0].cells == [4, 5]
                goals = [5] if self.options["good"] else [6]
                return fleetyard.Instance(starts=state.cells, goals=[goals])

        state = {"time_s": 0, "cells": [0], "goals": [[1]], "tasks": [{"id": 8, "cells": [4, 5]}]}
        call = request(3, "generate", state=state, budget=BUDGET)
        for good, status in [(True, "solved"), (False, "internal-error")]:
            answers, _ = converse(
                [Again],
                create("instance-generator", "again", options={"good": good}),
                PREPARE,
                call,
            )
            result = answers[2]["result"]
            self.assertEqual(result["status"], status)
            if good:
                self.assertEqual(result["instance"]["starts"], [0])
                self.assertEqual(result["instance"]["goals"], [[5]])
                self.assertNotIn("headings", result["instance"])
            else:
                self.assertIn("agent 0: cell 6 is not on a map", result["message"])

    def test_should_invoke(self):
        class Late(fleetyard.InvocationPolicy):
            def should_invoke(self, status, context):
                return status.since_last_call_s >= 1 / len(status.actions_left)

        def call(actions):
            status = {"time_s": 2, "since_last_call_s": 0.5}
            status.update(planning_limit_s=1, action_s=0.5)
            return request(3, "should_invoke", status=dict(status, actions_left=actions))

        answers, _ = converse(
            [Late], create("invocation-policy", "late"), call([1]), call([1, 2]), call([])
        )
        self.assertEqual(answers[1]["result"], {"invoke": False})
        self.assertEqual(answers[2]["result"], {"invoke": True})
        self.assertIn("ZeroDivisionError", answers[3]["error"]["message"])

        class Forgetful(fleetyard.InvocationPolicy):
            def should_invoke(self, status, context):
                pass

        answers, _ = converse([Forgetful], create("invocation-policy", "forgetful"), call([1]))
        self.assertIn("`should_invoke` returned None", answers[1]["error"]["message"])


class Grids(unittest.TestCase):
    def test_helpers(self):
        grid = fleetyard.Grid.from_rows(["..@", "...", "@@."])
        self.assertEqual(grid.cell(1, 2), 5)
        self.assertEqual(grid.position(5), (1, 2))
        self.assertEqual(sorted(grid.neighbors(4)), [1, 3, 5])
        self.assertEqual(grid.distances(8), [4, 3, -1, 3, 2, 1, -1, -1, 0])
        self.assertEqual(grid.free_cells(), [0, 1, 3, 4, 5, 8])
        self.assertFalse(grid.is_free(9))
        with self.assertRaises(IndexError):
            grid.cell(3, 0)
        eight = fleetyard.Grid.from_rows(["..@", "...", "@@."], connectivity=8)
        # 4 to 8 would cut the corner at 7, and 4 to 2 is blocked.
        self.assertEqual(sorted(eight.neighbors(4)), [0, 1, 3, 5])


SCRIPT = """
import os, sys, time
sys.path.insert(0, {root!r})
import fleetyard

class Test(fleetyard.Planner):
    def prepare(self, grid, budget, context):
        print("a stray line")
        os.write(1, b"another\\n")
        assert sys.stdin.read() == ""
        os.system("echo a child")

    def plan(self, instance, budget, context):
        context.log("busy")
        while True:
            pass

fleetyard.run(Test)
"""


class Process(unittest.TestCase):
    def start(self, script, **more):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        path = pathlib.Path(folder.name) / "plugin.py"
        path.write_text(textwrap.dedent(script))
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
        pipes.update(more)
        process = subprocess.Popen([sys.executable, str(path)], **pipes)
        self.addCleanup(process.kill)
        return process

    def busy(self):
        process = self.start(SCRIPT.format(root=str(ROOT)))
        process.stdin.write("\n".join([create(), PREPARE, PLAN, ""]).encode())
        process.stdin.flush()
        lines = [read(process.stdout.readline()) for _ in range(3)]
        self.assertEqual(lines[0]["result"], {"status": "solved"})
        self.assertEqual(lines[1]["result"], {"status": "solved"})
        self.assertEqual(lines[2]["params"]["text"], "busy")
        return process

    def test_print_is_harmless_and_the_end_of_input_ends_a_busy_process(self):
        process = self.busy()
        rest, errors = process.communicate(timeout=60)
        self.assertEqual(process.returncode, 0)
        self.assertEqual(rest, b"")
        for line in (b"a stray line", b"another", b"a child"):
            self.assertIn(line, errors)

    def test_exit_ends_a_busy_process(self):
        process = self.busy()
        process.stdin.write(b'{"jsonrpc":"2.0","method":"exit"}\n')
        process.stdin.flush()
        self.assertEqual(process.wait(timeout=60), 0)
        process.communicate()

    def test_a_whole_session_and_the_readme(self):
        readme = (ROOT / "README.md").read_text(encoding="utf-8")
        script = re.search(r"<!-- test: readme -->\n```python\n(.*?)```", readme, re.S).group(1)
        own = script.split("class OneByOne")[1].split("if __name__")[0].strip().splitlines()
        self.assertLess(len(own), 20, "a first planner is shorter than twenty lines")
        environment = dict(os.environ, PYTHONPATH=str(ROOT))
        process = self.start(script, env=environment)
        ask = create(plugin="one-by-one")
        session = [ask, PREPARE, PLAN, request(4, "shutdown"), '{"method":"exit"}', ""]
        output, errors = process.communicate("\n".join(session).encode(), timeout=60)
        answers = [read(line) for line in output.splitlines()]
        self.assertEqual(errors, b"")
        self.assertEqual(answers[2]["result"], {"status": "solved", "paths": ["E.", ".E"]})
        self.assertEqual(answers[3], {"jsonrpc": "2.0", "id": 4, "result": None})
        self.assertEqual(process.returncode, 0)

    @unittest.skipUnless(hasattr(os, "openpty"), "needs pseudo-terminals")
    def test_started_from_a_terminal_it_explains_itself(self):
        master, slave = os.openpty()
        self.addCleanup(os.close, master)
        process = self.start(SCRIPT.format(root=str(ROOT)), stdin=slave)
        os.close(slave)
        _, errors = process.communicate(timeout=60)
        self.assertEqual(process.returncode, 2)
        self.assertIn(b"is a Fleetyard plugin", errors)
        self.assertIn(b"test (planner)", errors)
        self.assertIn(b"hint: ", errors)

    @unittest.skipUnless(hasattr(signal, "SIGINT"), "needs signals")
    def test_interrupted_it_ends_quietly(self):
        # What a shell starts in the background ignores the signal, and so do its children.
        before = signal.signal(signal.SIGINT, signal.default_int_handler)
        self.addCleanup(signal.signal, signal.SIGINT, before)
        process = self.start(SCRIPT.format(root=str(ROOT)))
        process.stdin.write((create() + "\n").encode())
        process.stdin.flush()
        process.stdout.readline()
        process.send_signal(signal.SIGINT)
        self.assertEqual(process.wait(timeout=60), 130)
        self.assertEqual(process.stderr.read(), b"")
        process.communicate()


if __name__ == "__main__":
    unittest.main()
