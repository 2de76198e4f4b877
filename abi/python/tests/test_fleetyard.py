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
BUDGET = {"deadline_monotonic_ns": FAR, "answer_by_ns": FAR, "wall_ns": 1}
CELLS = {
    "rows": 2,
    "cols": 3,
    "connectivity": 4,
    "cell_size_m": 1.0,
    "step_s": 1.0,
    "passable": ["..@", "..."],
    "unknown": 1,
}
GRID = {"representation": "grid", "name": "m", "grid": CELLS, "unknown": 1}
INSTANCE = {"starts": [0, 4], "goals": [[1], [5]]}
ROADMAP = {
    "representation": "roadmap",
    "name": "line",
    "digest": "77ab",
    "roadmap": {
        "x_m": [0, 3, 3],
        "y_m": [0, 0, 4],
        "edges": [[1], [0, 2], [1]],
        "speed_m_per_s": 2,
        "separation_m": 0.5,
    },
}
WORKSPACE = {
    "representation": "continuous",
    "workspace": {
        "min_m": [0, 0],
        "max_m": [10, 5],
        "obstacles": [[[4, 0], [5, 0], [5, 2], [4, 2]]],
        "movers": [
            {"footprint": {"radius_m": 0.3}, "knots": [[1, 1, 1, 0], [3, 5, 1, 1], [3, 6, 1, 1]]}
        ],
    },
}


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
            ({"starts": [0, 4]}, "2 starts but 0 goal lists"),
            ({"starts": [0], "goals": [[1]], "headings": []}, "`headings` has 0 entries"),
            ({"starts": [0], "goals": [[1]], "robot_of": [0]}, "robot 0 is none of the 0 models"),
        ]:
            with self.subTest(message=message):
                (answer,), _ = planned(lambda *_: None, instance=instance)
                self.assertEqual(answer["result"]["status"], "invalid-input")
                self.assertIn(message, answer["result"]["message"])
        call = request(3, "plan", instance={"starts": 5, "goals": []}, budget=BUDGET)
        answers, _ = converse([stay], create(), PREPARE, call)
        self.assertEqual(answers[2]["error"]["code"], -32602)
        self.assertIn("`instance`: ", answers[2]["error"]["message"])

    def test_what_a_plugin_does_not_claim_is_unsupported(self):
        robot = {"footprint": {"radius_m": 0.3}}
        for more, message in [
            ({"goals": [[1], []]}, "the capability `idle`"),
            ({"goals": [[1, 0], [5]]}, "the capability `windowed`"),
            ({"window_steps": 3}, "the capability `windowed`"),
            ({"goals": [[5], [5]]}, "the capability `duplicate-goals`"),
            ({"motion": "rotation"}, "the capability `rotation`"),
            ({"motion": "flying"}, "the motion `flying` is unknown"),
            ({"objective": "joy"}, "the objective `joy` is unknown"),
            ({"robots": [robot] * 2, "robot_of": [0, 1]}, "the capability `heterogeneous`"),
            ({"parts": [{"id": "org.example.dust/1", "critical": True, "data": 1}]},
             "the instance needs the feature `part:org.example.dust/1`, which this plugin does "
             "not claim; hint: take one that does"),
        ]:
            with self.subTest(message=message):
                (answer,), _ = planned(lambda *_: None, instance=dict(INSTANCE, **more))
                self.assertEqual(answer["result"]["status"], "unsupported")
                self.assertIn(message, answer["result"]["message"])
        # Who comes as one of a window may share a goal.
        Test = planner(lambda self, instance, *_: [[start] for start in instance.starts])
        Test.capabilities = ("grid", "pebble", "windowed", "idle")
        instance = dict(INSTANCE, goals=[[5], [5]], window_steps=2)
        call = request(3, "plan", instance=instance, budget=BUDGET)
        answers, _ = converse([Test], create(), PREPARE, call)
        self.assertEqual(answers[2]["result"]["status"], "solved")

    def test_memory(self):
        seen = []

        def plan(self, instance, budget, context):
            seen.append(instance.parts)
            context.keep(b"\x00\xa2")
            with test.assertRaises(ValueError):
                context.keep(bytes(fleetyard.KEPT_LIMIT + 1))
            return [[start] for start in instance.starts]

        test = self
        times = {"period_s": 20, "time_constant_s": 50, "since_s": 3.5, "flow_unit_per_s": 0.5}
        last = {"number": 1, "waiting": "g3fi", "flow": "m0A"}
        before = {"number": 0, "waiting": "ih", "flow": "kj"}
        parts = [
            {"id": "fleetyard.traffic/1", "data": dict(times, last=last, before=before)},
            {"id": "fleetyard.rest-of-plan/1", "data": {"paths": ["E.", ""]}},
            {
                "id": "fleetyard.goal-tasks/1",
                "data": {
                    "time_s": 23.5,
                    "tasks": [7, None],
                    "errands": [1, None],
                    "released_s": [2, 21.5],
                    "given_s": [9, 21.5],
                },
            },
            {
                "id": "fleetyard.guidance/1",
                "data": {"moves": [100, 10], "waits": [10_000]},
            },
            {"id": "fleetyard.kept/1", "data": "00a1"},
        ]
        call = request(3, "plan", instance=dict(INSTANCE, parts=parts), budget=BUDGET)
        answers, _ = converse([planner(plan)], create(), PREPARE, call)
        self.assertEqual(answers[2]["method"], "keep")
        self.assertEqual(answers[2]["params"], {"bytes": "00a2"})
        self.assertEqual(answers[3]["result"]["status"], "solved")
        memory = seen[0]
        self.assertEqual(memory.traffic.last.waiting, bytes([0, 0x3F, 0, 0, 0, 0]))
        self.assertEqual(memory.traffic.before.flow, bytes(24))
        self.assertEqual((memory.traffic.before.number, memory.traffic.since_s), (0, 3.5))
        with self.assertRaises(ValueError):
            memory.traffic.last.flow
        self.assertEqual(memory.rest_of_plan.paths, ["E.", ""])
        self.assertEqual(memory.goal_tasks.tasks, [7, None])
        self.assertEqual(memory.goal_tasks.given_s, [9.0, 21.5])
        self.assertEqual((memory.guidance.moves, memory.guidance.waits), ([100, 10], [10_000]))
        self.assertEqual(memory.kept, b"\x00\xa1")
        self.assertEqual(fleetyard.Parts().kept, None)

    def test_what_is_kept_belongs_to_calls(self):
        def prepare(self, environment, budget, context):
            context.keep(b"early")

        Test = planner(lambda self, instance, *_: [[start] for start in instance.starts])
        Test.prepare = prepare
        answers, _ = converse([Test], create(), PREPARE)
        self.assertEqual(answers[1]["result"]["status"], "internal-error")
        self.assertIn("keep bytes", answers[1]["result"]["message"])

    def test_parts(self):
        def plan(self, instance, budget, context):
            context.log(repr((dict(self.grid.parts), dict(instance.parts))))
            return [[start] for start in instance.starts]

        dust = {"id": "org.example.dust/1", "data": {"level": 3}}
        environment = dict(GRID, parts=[dict(dust, critical=True), {"id": "other/1"}])
        Test = planner(plan)
        call = request(3, "plan", instance=dict(INSTANCE, parts=[dust]), budget=BUDGET)
        session = [create(), request(2, "prepare", environment=environment, budget=BUDGET), call]
        answers, _ = converse([Test], *session)
        self.assertEqual(answers[1]["result"]["status"], "unsupported")
        self.assertIn("part:org.example.dust/1", answers[1]["result"]["message"])
        Test.features = ("part:org.example.dust/1",)
        self.assertEqual(Test.descriptor()["features"], ["part:org.example.dust/1"])
        answers, _ = converse([Test], *session)
        seen = "({'org.example.dust/1': {'level': 3}, 'other/1': None}, " \
            "{'org.example.dust/1': {'level': 3}})"
        self.assertEqual(answers[2]["params"]["text"], seen)
        self.assertEqual(answers[3]["result"]["status"], "solved")

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

    def test_maps_that_are_not_claimed_or_not_whole(self):
        stay = planner(lambda self, instance, budget, context: None)

        def cells(**more):
            return dict(GRID, grid=dict(CELLS, **more))

        def roadmap(**more):
            return dict(ROADMAP, roadmap=dict(ROADMAP["roadmap"], **more))

        def workspace(**more):
            return dict(WORKSPACE, workspace=dict(WORKSPACE["workspace"], **more))

        mover = {"footprint": {"radius_m": 1}, "knots": [[1, 0, 0, 0], [0, 0, 0, 0]]}
        for environment, status, message in [
            ({"representation": "tree"}, "unsupported", "the representation `tree` is unknown"),
            (ROADMAP, "unsupported", "the map needs the capability `roadmap`, which this plugin "
             "does not claim; hint: take one that does"),
            (WORKSPACE, "unsupported", "the capability `continuous`"),
            (cells(connectivity=8), "unsupported", "the capability `eight-connected`"),
            (cells(moves=["060800", "020a08"]), "unsupported", "the capability `move-mask`"),
            (cells(passable=["..", "..."]), "invalid-input", "is not 2 rows of 3 letters"),
            (cells(rows=0), "invalid-input", "a grid of 0 rows and 3 columns has no cell"),
            (cells(moves=["0608", "020a08"]), "invalid-input", "is not 2 rows of 6 letters"),
            (cells(moves=["06080g", "020a08"]), "invalid-input", "hexadecimal digits"),
            (cells(moves=["060200", "020a08"]), "invalid-input",
             "`moves` allows a move from cell 1 that leads off the free cells"),
            (roadmap(y_m=[0]), "invalid-input", "`y_m` has 1 entries, not 3"),
            (roadmap(edges=[[1], [0, 3], [1]]), "invalid-input", "from vertex 1 to 3"),
            (roadmap(edges=[[1], [2, 0], [1]]), "invalid-input", "do not ascend"),
            (roadmap(length_m=[1]), "invalid-input", "`length_m` has 1 entries, not 4"),
            (roadmap(x_m=[]), "invalid-input", "has no vertex"),
            (roadmap(speed_m_per_s=0), "invalid-input", "`speed_m_per_s` is not positive"),
            (workspace(obstacles=[[[0, 0], [1, 1]]]), "invalid-input", "obstacle 0 has fewer"),
            (workspace(movers=[mover]), "invalid-input", "its times do not ascend"),
        ]:
            with self.subTest(message=message):
                prepare = request(2, "prepare", environment=environment, budget=BUDGET)
                answers, _ = converse([stay], create(), prepare, PLAN)
                self.assertEqual(answers[1]["result"]["status"], status)
                self.assertIn(message, answers[1]["result"]["message"])
                self.assertIn("before a successful `prepare`", answers[2]["error"]["message"])
        for environment, message in [
            ({"representation": "roadmap"}, "an environment without `roadmap`"),
            (dict(GRID, grid={}), "there is no 'rows'"),
            ({}, "there is no 'representation'"),
        ]:
            prepare = request(2, "prepare", environment=environment, budget=BUDGET)
            answers, _ = converse([stay], create(), prepare)
            self.assertEqual(answers[1]["error"]["code"], -32602)
            self.assertIn(message, answers[1]["error"]["message"])
        # Masks that say no more than the cells are none.
        plain = request(2, "prepare", environment=cells(moves=["060c00", "030b08"]), budget=BUDGET)
        answers, _ = converse([stay], create(), plain)
        self.assertEqual(answers[1]["result"]["status"], "solved")

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
            context.note("weights-sha256", "0f3c")
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
                ("note", {"name": "weights-sha256", "text": "0f3c"}),
                ("progress", {"done": 1, "total": 2}),
                ("incumbent", {"paths": ["SE", "E"]}),
                ("incumbent", {"paths": ["E", "E"]}),
                (None, {"status": "solved"}),
            ],
        )

    def test_annotations_where_somebody_wants_to_see_them(self):
        def plan(self, instance, budget, context):
            shown = context.annotations
            if shown:
                shown.places("constraints", [[0], (1, 2)], agent=1, from_s=1, to_s=2.5, text="no")
                shown.points("tree", [(0.5, 1)], to_s=math.inf, values=[2])
                shown.lines("tree", [[(0, 0), (1, 1)]])
                shown.rings("tree", [[(0, 0), (1, 1), (1, 0)]])
                with self_test.assertRaises(TypeError):
                    shown.places("tree", [["0"]])
            return [[0, 1], [4, 5]]

        self_test = self
        messages, _ = planned(plan)
        self.assertEqual(len(messages), 1)
        call = dict(instance=INSTANCE, budget=BUDGET)
        wanted = request(3, "plan", extensions=["org.example/1", "fleetyard.annotations/1"], **call)
        messages, _ = converse([planner(plan)], create(), PREPARE, wanted)
        self.assertEqual(
            [m["params"] for m in messages if m.get("method") == "annotation"],
            [
                {
                    "layer": "constraints",
                    "shape": "places",
                    "places": [[0], [1, 2]],
                    "agent": 1,
                    "from_s": 1.0,
                    "to_s": 2.5,
                    "text": "no",
                },
                {"layer": "tree", "shape": "points", "xy_m": [[[0.5, 1.0]]], "values": [2.0]},
                {"layer": "tree", "shape": "lines", "xy_m": [[[0, 0], [1, 1]]]},
                {"layer": "tree", "shape": "rings", "xy_m": [[[0, 0], [1, 1], [1, 0]]]},
            ],
        )
        self.assertEqual(messages[-1]["result"]["paths"], ["E", "E"])

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

        past = time.monotonic_ns() - 1
        budget = {"deadline_monotonic_ns": past, "answer_by_ns": past, "wall_ns": 1}
        (answer,), _ = planned(plan, budget=budget)
        self.assertEqual(answer["result"]["status"], "timed-out")

    def test_the_host_says_when_the_answer_is_due(self):
        def plan(self, instance, budget, context):
            assert not context.cancelled(), "no reserve of its own"
            while not context.cancelled():
                pass
            assert budget.ending() and not budget.expired()
            assert context.incumbent([[0], [4]]), "plans count until the deadline"
            context.check()

        due = time.monotonic_ns() + 50_000_000
        budget = {"deadline_monotonic_ns": FAR, "answer_by_ns": due, "wall_ns": 60_000_000}
        answers, _ = planned(plan, budget=budget)
        self.assertEqual(answers[0]["params"], {"paths": ["", ""]})
        self.assertEqual(answers[1]["result"]["status"], "timed-out")
        self.assertGreaterEqual(time.monotonic_ns(), due)
        budget = fleetyard.Budget.lasting(1, seed=3)
        self.assertEqual(budget.deadline_monotonic_ns - budget.answer_by_ns, 20_000_000)
        self.assertEqual((budget.wall_ns, budget.seed), (10**9, 3))

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

    def test_a_request_of_arrays(self):
        class Draw(fleetyard.InstanceGenerator):
            def generate(self, state, budget, context):
                return fleetyard.Request(self.goals(numpy.array([[5]])))

        state = {"time_s": 0, "next": {"starts": [0], "goals": [[]]}}
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
            def recover(self, instance, failed_plan, budget, context):
                context.log(repr(failed_plan))
                return [[start] for start in instance.starts]

        def call(**more):
            return request(3, "recover", instance=INSTANCE, budget=BUDGET, **more)

        for failed, seen in [
            ({"paths": ["E", [4, 5]]}, "[[0, 1], [4, 5]]"),
            ({"paths": [[[0, 0], [5, 5]], []]}, "[[0, -1], []]"),
            ({}, "None"),
            (None, "None"),
        ]:
            answers, _ = converse(
                [Wait], create("fail-policy", "wait"), PREPARE, call(failed_plan=failed)
            )
            self.assertEqual(answers[2]["params"]["text"], seen)
            self.assertEqual(answers[3]["result"], {"status": "solved", "paths": ["", ""]})
        answers, _ = converse(
            [Wait],
            create("fail-policy", "wait"),
            PREPARE,
            call(failed_plan={"paths": ["Q", ""]}),
            PLAN,
        )
        self.assertIn("'Q'", answers[2]["error"]["message"])
        self.assertIn("is not for a plugin of kind fail-policy", answers[3]["error"]["message"])

    def test_generate(self):
        class Again(fleetyard.InstanceGenerator):
            options_schema = {"properties": {"good": {"type": "boolean"}}}

            def generate(self, state, budget, context):
                assert state.agents == 1 and state.tasks[0].places == [4, 5]
                assert state.next.starts == [0] and state.next.goals == [[1]]
                goals = [5] if self.options["good"] else [6]
                return state.request([goals], [fleetyard.Assignment(0, 8)])

        state = {"time_s": 0, "next": {"starts": [0], "goals": [[1]], "window_steps": 7}}
        state["tasks"] = [{"id": 8, "places": [4, 5]}]
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
                given = [{"agent": 0, "task": 8}]
                wanted = {"goals": [[5]], "window_steps": 7, "assignments": given}
                self.assertEqual(result["request"], wanted)
            else:
                self.assertIn("agent 0: cell 6 is not on a map", result["message"])

    def test_requests_that_do_not_fit(self):
        class Odd(fleetyard.InstanceGenerator):
            answer = None

            def generate(self, state, budget, context):
                return Odd.answer

        state = {"time_s": 0, "next": {"starts": [0], "goals": [[1]]}}
        for answer, message in [
            (None, "`generate` returned no Request but None"),
            (fleetyard.Request([]), "the request has 0 goal lists, but there are 1 agents"),
            (fleetyard.Request([[1]], [fleetyard.Assignment(2, 8)]),
             "task 8 is given to agent 2, but there are 1 agents"),
        ]:
            Odd.answer = answer
            answers, _ = converse(
                [Odd],
                create("instance-generator", "odd"),
                PREPARE,
                request(3, "generate", state=state, budget=BUDGET),
            )
            self.assertEqual(answers[2]["result"]["status"], "internal-error")
            self.assertIn(message, answers[2]["result"]["message"])

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


def planned_on(environment, instance, plan, capabilities):
    """The messages of one call on a map of any kind."""
    Test = planner(plan)
    Test.capabilities = capabilities
    Test.features = ("dynamics:fleetyard.unicycle/1",)
    prepare = request(2, "prepare", environment=environment, budget=BUDGET)
    call = request(3, "plan", instance=instance, budget=BUDGET)
    answers, _ = converse([Test], create(), prepare, call)
    assert answers[1]["result"] == {"status": "solved"}, answers[1]
    return answers[2:]


class Roadmaps(unittest.TestCase):
    INSTANCE = {"starts": [0], "goals": [[2]], "motion": "stop-go", "window_s": 0.0}
    CAPABILITIES = ("roadmap", "stop-go")

    def planned(self, plan):
        return planned_on(ROADMAP, self.INSTANCE, plan, self.CAPABILITIES)

    def test_the_map(self):
        def plan(self, instance, budget, context):
            roadmap = self.roadmap
            assert (roadmap.places, roadmap.name, roadmap.digest) == (3, "line", "77ab")
            assert roadmap.length_m == [[3], [3, 4], [4]]
            assert roadmap.drives(1) == [(0, 1.5), (2, 2.0)]
            assert roadmap.durations(2) == [3.5, 2.0, 0.0] and roadmap.point(2) == (3, 4)
            raise fleetyard.GaveUp("seen")

        (answer,) = self.planned(plan)
        self.assertEqual(answer["result"], {"status": "gave-up", "message": "seen"})
        given = dict(ROADMAP["roadmap"], length_m=[4, 4, 6, 6], workspace=WORKSPACE["workspace"])
        roadmap = fleetyard.Roadmap._from_wire(given)
        self.assertEqual(roadmap.duration_s, [[2], [2, 3], [3]])
        self.assertEqual(roadmap.workspace.max_m, (10, 5))
        slow = fleetyard.Roadmap._from_wire(dict(given, duration_s=[1, 2, 3, 4]))
        self.assertEqual((slow.length_m, slow.duration_s), ([[4], [4, 6], [6]], [[1], [2, 3], [4]]))
        lane = fleetyard.Roadmap.straight([(0, 0), (1, 0)], [[1], []], 1.0, 0.5)
        self.assertEqual(lane.durations(0), [0.0, math.inf])

    def test_plans(self):
        visits = [[fleetyard.Visit(0, 0, 0.5), (1, 2.0, 2), [2, 4, 4]]]

        def plan(self, instance, budget, context):
            context.incumbent(visits)
            return Array(visits)

        messages = self.planned(plan)
        wire = [[[0, 0, 0.5], [1, 2, 2], [2, 4, 4]]]
        self.assertEqual(messages[0]["params"], {"visits": wire})
        self.assertEqual(messages[1]["result"], {"status": "solved", "visits": wire})
        for plan, message in [
            ([], "the plan has 0 visits, but the instance has 1 agents"),
            (5, "the plan is not a list but 5"),
            ([[(0, 0)]], "the plan of agent 0 has (0, 0) at place 0, which is no (vertex,"),
            ([[(0.5, 0, 0)]], "which is no (vertex, arrival_s, departure_s)"),
            ([[(0, 0, math.nan)]], "which is no (vertex, arrival_s, departure_s)"),
        ]:
            with self.subTest(message=message):
                (answer,) = self.planned(lambda *_: plan)
                self.assertEqual(answer["result"]["status"], "internal-error")
                self.assertIn(message, answer["result"]["message"])

    def test_failed_plans(self):
        class Wait(fleetyard.FailPolicy):
            capabilities = ("roadmap",)

            def recover(self, instance, failed_plan, budget, context):
                context.log(repr(failed_plan))
                return [[(start, 0, 0)] for start in instance.starts]

        prepare = request(2, "prepare", environment=ROADMAP, budget=BUDGET)
        for failed, seen in [
            ({"visits": [[[0, 0, 1], [-4, 2, 2]]]},
             "[[Visit(vertex=0, arrival_s=0.0, departure_s=1.0), "
             "Visit(vertex=-1, arrival_s=2.0, departure_s=2.0)]]"),
            ({"paths": ["E"]}, None),
        ]:
            call = request(
                3, "recover", instance=self.INSTANCE, budget=BUDGET, failed_plan=failed
            )
            answers, _ = converse([Wait], create("fail-policy", "wait"), prepare, call)
            if seen:
                self.assertEqual(answers[2]["params"]["text"], seen)
                self.assertEqual(answers[3]["result"]["visits"], [[[0, 0, 0]]])
            else:
                message = "a plan of another form than `visits`, which this map takes"
                self.assertIn(message, answers[2]["error"]["message"])


class Planes(unittest.TestCase):
    INSTANCE = {
        "motion": "dynamics",
        "robots": [
            {
                "name": "cart",
                "dynamics": "fleetyard.unicycle/1",
                "footprint": {"radius_m": 0.3},
                "has_heading": True,
                "polar_state": False,
                "state_limits": [[None, None], [None, 4], [None, None]],
                "control_limits": [[-0.5, 0.5], [-1, 1]],
            }
        ],
        "start_states": [[1, 1, 0]],
        "goal_states": [[[9, 1, None]]],
        "goal_tolerance_m": 0.1,
    }
    CAPABILITIES = ("continuous", "dynamics")

    def planned(self, plan, **more):
        instance = dict(self.INSTANCE, **more)
        return planned_on(WORKSPACE, instance, plan, self.CAPABILITIES)

    def test_the_input(self):
        def plan(self, instance, budget, context):
            assert self.workspace.obstacles == [[(4, 0), (5, 0), (5, 2), (4, 2)]]
            (mover,) = self.workspace.movers
            poses = [mover.pose(time) for time in (0, 2, 3, 9)]
            assert poses == [(1, 1, 0), (3, 1, 0.5), (6, 1, 1), (6, 1, 1)], poses
            robot = instance.robot(0)
            assert robot.state_limits[1] == (-math.inf, 4) and robot.has_heading
            assert robot.control_limits == ((-0.5, 0.5), (-1, 1)) and not robot.polar_control
            assert instance.agents == 1 and instance.start_states == [[1, 1, 0]]
            assert math.isnan(instance.goal_states[0][0][2])
            raise fleetyard.GaveUp("seen")

        (answer,) = self.planned(plan)
        self.assertEqual(answer["result"], {"status": "gave-up", "message": "seen"})

    def test_instances_that_are_not_whole(self):
        other = dict(self.INSTANCE["robots"][0], dynamics="org.example.boat/2")
        for more, status, message in [
            ({"start_states": [[1, 1]]}, "invalid-input",
             "agent 0 has a state of 2 numbers, but its robot has 3"),
            ({"start_states": [[1, 1, None]]}, "invalid-input", "agent 0 has no start"),
            ({"robots": []}, "invalid-input", "without a model of robots"),
            ({"goal_states": []}, "invalid-input", "1 starts but 0 goal lists"),
            ({"robots": [other]}, "unsupported", "the feature `dynamics:org.example.boat/2`"),
            ({"goal_states": [[]]}, "unsupported", "the capability `idle`"),
        ]:
            with self.subTest(message=message):
                (answer,) = self.planned(lambda *_: None, **more)
                self.assertEqual(answer["result"]["status"], status)
                self.assertIn(message, answer["result"]["message"])

    def test_plans(self):
        knots = [[(0, 1, 1, 0.5), fleetyard.Knot(1, 2, 1), [2, 3, 1, None]]]
        (answer,) = self.planned(lambda *_: knots)
        wire = [[[0, 1, 1, 0.5], [1, 2, 1], [2, 3, 1]]]
        self.assertEqual(answer["result"], {"status": "solved", "trajectories": wire})
        (answer,) = self.planned(lambda *_: [[(0, 1)]])
        self.assertIn("is no (time_s, x_m, y_m) with or", answer["result"]["message"])

    def test_controls(self):
        controls = [(0.5, (1, 0.25)), fleetyard.Segment(2, [0, 0])]
        for motion, wire in [
            (fleetyard.Motion(controls), {"controls": [[0.5, 1, 0.25], [2, 0, 0]]}),
            (fleetyard.Motion(), {"controls": []}),
            (fleetyard.Motion([(1, ())], [(0, 1, 1)]), {"knots": [[0, 1, 1]], "controls": [[1]]}),
            (fleetyard.Motion(knots=[(0, 1, 1)]), {"knots": [[0, 1, 1]]}),
        ]:
            (answer,) = self.planned(lambda *_: [motion])
            self.assertEqual(answer["result"], {"status": "solved", "trajectories": [wire]})
        for controls, message in [
            ([(1, (1,)), (1, (1, 2))], "the controls of agent 0 differ in length"),
            ([(1, 1, 2)], "has (1, 1, 2) at place 0, which is no (duration_s, control)"),
            ([(1, (math.nan,))], "which is no (duration_s, control)"),
        ]:
            (answer,) = self.planned(lambda *_: [fleetyard.Motion(controls)])
            self.assertIn(message, answer["result"]["message"])


class Policies(unittest.TestCase):
    def plan(self, act, **more):
        """The messages of a step policy on the grid."""

        class Test(fleetyard.StepPolicy):
            capabilities = ("grid", "pebble", "windowed", "idle", "duplicate-goals")
            most_steps = 9

        Test.act = act
        Test.__abstractmethods__ = frozenset()
        self.policy = Test
        call = request(3, "plan", instance=dict(INSTANCE, **more), budget=BUDGET)
        answers, _ = converse([Test], create(), PREPARE, call)
        self.handed_in = [
            answer["params"]["paths"] for answer in answers if answer.get("method") == "incumbent"
        ]
        return next(answer["result"] for answer in answers if answer.get("id") == 3)

    def test_moves_become_a_plan(self):
        seen = []

        def act(self, observations):
            assert self.budget.seed == 0 and not self.context.cancelled()
            seen.append(observations)
            return "EE" if observations[0].time == 0 else ".."

        self.assertEqual(self.plan(act), {"status": "solved", "paths": ["E", "E"]})
        self.assertEqual(seen, [[(0, 0, 0, 1), (1, 0, 4, 5)]])

    def test_goals_are_visited_in_order_and_who_has_none_waits(self):
        seen = []

        def act(self, observations):
            seen.append([observation.goal for observation in observations])
            return ["E" if observations[0].time == 0 else "W", "."]

        result = self.plan(act, goals=[[1, 0], []])
        self.assertEqual(result, {"status": "solved", "paths": ["EW", ".."]})
        self.assertEqual(seen, [[1, None], [0, None]])

    def test_what_would_collide_waits(self):
        # Off the map; both into one cell; one behind the other; into a wall and into one who
        # waits for it; to the goal.
        moves = iter(["N.", "EN", "SE", "EN", "N."])
        result = self.plan(lambda self, observations: next(moves))
        self.assertEqual(result, {"status": "solved", "paths": [".ES.N", "..E.."]})

    def test_what_is_no_answer(self):
        for moves, message in [
            (".", "`act` returned 1 moves, but there are 2 agents"),
            (".x", "`act` returned 'x' for agent 1, which is no move"),
            (["."] * 2, "0 of 2 agents are at their last goals after 9 steps"),
        ]:
            result = self.plan(lambda self, observations: moves)
            self.assertIn(message, result["message"])
        self.assertEqual(result["status"], "gave-up")

    def test_a_policy_that_fails_leaves_its_rollout(self):
        moves = iter(["E.", "..", ".."])

        def stops(self, observations):
            return next(moves)

        result = self.plan(stops)
        self.assertEqual(result["status"], "internal-error")  # no more moves: a mistake of its own
        self.assertEqual(self.handed_in, [["E..", "..."]])
        result = self.plan(lambda self, observations: ["E." if not observations[0].time else ".."][0])
        self.assertEqual(result["message"], "1 of 2 agents are at their last goals after 9 steps")
        self.assertEqual(self.handed_in, [["E........", "........."]])
        self.assertEqual(result["status"], "gave-up")
        self.assertIn("colliding-plans", self.policy.descriptor()["capabilities"])

    def test_a_window_ends_a_plan(self):
        result = self.plan(lambda self, observations: "..", window_steps=2)
        self.assertEqual(result, {"status": "solved", "paths": ["..", ".."]})

    def test_settling(self):
        grid = fleetyard.Grid.from_rows(["...", "..."])
        eight = fleetyard.Grid.from_rows(["...", "..."], connectivity=8)
        for on, at, wishes, options, steps in [
            (grid, [0, 1], [1, 0], {}, [0, 1]),  # an exchange
            (grid, [0, 1], [1, 2], {}, [1, 2]),  # one behind the other
            (grid, [0, 1], [1, 1], {}, [0, 1]),  # into one who stands
            (grid, [0, 2], [1, 1], {}, [1, 2]),  # both into one cell
            (grid, [0, 1, 5], [1, 2, 2], {}, [1, 2, 5]),
            (grid, [0, 1, 5, 2], [1, 2, 2, 2], {}, [0, 1, 5, 2]),  # all wait behind one
            (grid, [0], [4], {}, [0]),  # no move
            (grid, [0, 1, 4, 3], [1, 4, 3, 0], {}, [0, 1, 4, 3]),  # a ring
            (grid, [0, 1, 4, 3], [1, 4, 3, 0], {"allows_cycles": True}, [1, 4, 3, 0]),
            (grid, [0, 1], [1, 4], {}, [1, 4]),  # round a corner
            (grid, [0, 1], [1, 4], {"strict": True}, [0, 4]),
            (eight, [0, 1], [4, 3], {}, [0, 3]),  # two diagonals cross
            (eight, [0, 4], [4, 3], {}, [0, 3]),  # out of the way, but past its corner
            (eight, [0, 4], [4, 5], {}, [4, 5]),
        ]:
            with self.subTest(at=at, wishes=wishes, options=options):
                found = fleetyard.settle(on, at, wishes, **options)
                self.assertEqual(found, steps)


class Grids(unittest.TestCase):
    def test_helpers(self):
        grid = fleetyard.Grid.from_rows(["..@", "...", "@@."])
        self.assertEqual(grid.cell(1, 2), 5)
        self.assertEqual(grid.position(5), (1, 2))
        self.assertEqual(sorted(grid.neighbors(4)), [1, 3, 5])
        self.assertEqual(grid.distances(8), [4, 3, -1, 3, 2, 1, -1, -1, 0])
        self.assertEqual(grid.free_cells(), [0, 1, 3, 4, 5, 8])
        self.assertFalse(grid.is_free(9))
        self.assertEqual([grid.move(4, near) for near in (4, 1, 5, 7, 3)], list(".NESW"))
        with self.assertRaises(IndexError):
            grid.cell(3, 0)
        with self.assertRaises(ValueError):
            grid.move(2, 3)
        eight = fleetyard.Grid.from_rows(["..@", "...", "@@."], connectivity=8)
        # 4 to 8 would cut the corner at 7, and 4 to 2 is blocked.
        self.assertEqual(sorted(eight.neighbors(4)), [0, 1, 3, 5])

    def test_streets_of_one_way(self):
        # Round clockwise: 0, 1, 4, 3.
        grid = fleetyard.Grid.from_rows(["..@", "..."], moves=bytes([2, 4, 0, 1, 8, 0]))
        self.assertEqual([grid.neighbors(cell) for cell in range(6)],
                         [(1,), (4,), (), (0,), (3,), ()])
        self.assertEqual(grid.distances(0), [0, 3, -1, 1, 2, -1])
        self.assertEqual(grid.needs(), ["grid", "move-mask"])


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

    def test_the_step_policy_of_the_readme(self):
        readme = (ROOT / "README.md").read_text(encoding="utf-8")
        pattern = r"<!-- test: step policy -->\n```python\n(.*?)```"
        script = re.search(pattern, readme, re.S).group(1)
        process = self.start(script, env=dict(os.environ, PYTHONPATH=str(ROOT)))
        session = [create(plugin="greedy"), PREPARE, PLAN, '{"method":"exit"}', ""]
        output, errors = process.communicate("\n".join(session).encode(), timeout=60)
        answers = [read(line) for line in output.splitlines()]
        self.assertEqual(errors, b"")
        self.assertEqual(answers[2]["result"], {"status": "solved", "paths": ["E", "E"]})

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
