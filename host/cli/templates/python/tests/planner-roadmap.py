"""python3 -m unittest discover tests"""

import math
import pathlib
import sys
import unittest
from unittest.mock import Mock

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))

import example_plugin
import fleetyard

# A street of 10 m, a vertex every 2 m, and a place beside vertex 1 to make way.
STREET = [(0, 0), (2, 0), (4, 0), (6, 0), (8, 0), (10, 0), (2, 3)]
ENDS = [[1], [0, 2, 6], [1, 3], [2, 4], [3, 5], [4], [1]]


def plan(points, edges, starts, goals, **options):
    """The answer of the planner, without a host, and the roadmap."""
    planner = example_plugin.ExamplePlugin(example_plugin.ExamplePlugin.complete(options))
    planner.roadmap = fleetyard.Roadmap.straight(points, edges, 2.0, 1.0)
    instance = fleetyard.Instance(starts, [[goal] for goal in goals], motion="stop-go")
    return planner.plan(instance, fleetyard.Budget.lasting(10), Mock()), planner.roadmap


def place(roadmap, visits, time_s):
    """The place of an agent at a time."""
    for (one, _, leave_s), (two, there_s, _) in zip(visits, visits[1:]):
        if time_s <= leave_s:
            return roadmap.point(one)
        if time_s < there_s:
            share = (time_s - leave_s) / (there_s - leave_s)
            ends = zip(roadmap.point(one), roadmap.point(two))
            return tuple(a + share * (b - a) for a, b in ends)
    return roadmap.point(visits[-1][0])


class Plans(unittest.TestCase):
    def test_quickest_way(self):
        plans, _ = plan(STREET, ENDS, [0], [2])
        self.assertEqual(plans, [[(0, 0.0, 0.0), (1, 1.0, 1.0), (2, 2.0, 2.0)]])

    def test_agents_keep_their_distance(self):
        plans, roadmap = plan(STREET, ENDS, [0, 5], [5, 0])
        self.assertIn(6, [vertex for vertex, _, _ in plans[0]], "it makes way")
        for visits, goal in zip(plans, [5, 0]):
            self.assertEqual(visits[-1][0], goal)
            for (one, arrival_s, leave_s), (two, there_s, _) in zip(visits, visits[1:]):
                self.assertLessEqual(arrival_s, leave_s)
                self.assertIn(two, roadmap.edges[one])
                self.assertAlmostEqual(there_s - leave_s, dict(roadmap.drives(one))[two])
        for step in range(2000):
            places = [place(roadmap, visits, step * 0.01) for visits in plans]
            for one in range(len(places)):
                for two in range(one):
                    apart_m = math.dist(places[one], places[two])
                    self.assertGreaterEqual(apart_m, 1.0 - 1e-6, (step, places))

    def test_says_when_there_is_no_plan(self):
        with self.assertRaises(fleetyard.Infeasible):
            plan([(0, 0), (5, 0)], [[], [0]], [0], [1])
        with self.assertRaises(fleetyard.GaveUp):
            plan([(0, 0), (5, 0)], [[1], [0]], [0, 1], [1, 0], attempts=3)


if __name__ == "__main__":
    unittest.main()
