"""The solver by itself: python3 -m unittest discover tests"""

import pathlib
import subprocess
import sys
import tempfile
import unittest

SOLVER = pathlib.Path(__file__).resolve().parent.parent / "solver" / "solve.py"


def solve(rows, agents):
    """Exit code and answer on a map of rows; agents are (x, y, goal x, goal y)."""
    size = f"height {len(rows)}\nwidth {len(rows[0])}"
    lines = [f"0 test.map {len(rows[0])} {len(rows)} {x} {y} {u} {v} 0" for x, y, u, v in agents]
    with tempfile.TemporaryDirectory() as folder:
        here = pathlib.Path(folder)
        (here / "test.map").write_text("\n".join([f"type octile\n{size}\nmap", *rows, ""]))
        (here / "test.scen").write_text("\n".join(["version 1", *lines, ""]))
        words = ["--map", "test.map", "--scen", "test.scen", "--agents", str(len(agents))]
        command = [sys.executable, SOLVER, *words, "--output", "paths.txt"]
        ended = subprocess.run(command, cwd=here, capture_output=True)
        answer = here / "paths.txt"
        return ended.returncode, answer.read_text() if answer.exists() else None


class Solves(unittest.TestCase):
    def test_shortest_path(self):
        self.assertEqual(solve(["..", ".."], [(0, 0, 1, 0)]), (0, "Agent 0: (0,0)->(0,1)->\n"))

    def test_agents_do_not_meet(self):
        code, answer = solve(["....", "@@.@"], [(0, 0, 3, 0), (3, 0, 0, 0)])
        self.assertEqual(code, 0)
        self.assertIn("(0,2)->(1,2)->(0,2)", answer)

    def test_says_when_there_is_no_plan(self):
        self.assertEqual(solve(["..."], [(0, 0, 2, 0), (2, 0, 0, 0)]), (1, None))


if __name__ == "__main__":
    unittest.main()
