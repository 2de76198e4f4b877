"""python3 -m unittest discover tests"""

import pathlib
import sys
import unittest
from unittest.mock import Mock

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))

import example_plugin
import fleetyard


def plan(rows, starts, goals, **options):
    """The answer of the planner, without a host."""
    planner = example_plugin.ExamplePlugin(example_plugin.ExamplePlugin.complete(options))
    planner.grid = fleetyard.Grid.from_rows(rows)
    instance = fleetyard.Instance(starts, [[goal] for goal in goals])
    return planner.plan(instance, fleetyard.Budget.lasting(10, seed=1), Mock())


class Plans(unittest.TestCase):
    def test_shortest_path(self):
        self.assertEqual(plan(["..", ".."], [0], [1]), [[0, 1]])

    def test_agents_do_not_meet(self):
        paths = plan(["....", "@@.@"], [0, 3], [3, 0])
        self.assertEqual([path[-1] for path in paths], [3, 0])
        steps = max(map(len, paths))
        first, second = (path + path[-1:] * (steps - len(path)) for path in paths)
        for time in range(steps):
            self.assertNotEqual(first[time], second[time])
            self.assertNotEqual(first[time : time + 2], second[time : time + 2][::-1])

    def test_says_when_there_is_no_plan(self):
        with self.assertRaises(fleetyard.Infeasible):
            plan([".@."], [0], [2])
        with self.assertRaises(fleetyard.GaveUp):
            plan(["..."], [0, 2], [2, 0], attempts=3)


if __name__ == "__main__":
    unittest.main()
