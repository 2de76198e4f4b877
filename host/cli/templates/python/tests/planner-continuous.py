"""python3 -m unittest discover tests"""

import math
import pathlib
import sys
import unittest
from unittest.mock import Mock

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))

import example_plugin
import fleetyard

ANY = math.nan
DISC = fleetyard.Footprint(0.5)
NO_LIMIT = (-math.inf, math.inf)
# At most 2 m/s in any direction.
ROBOT = fleetyard.Robot(
    DISC,
    polar_control=True,
    state_limits=(NO_LIMIT, NO_LIMIT),
    control_limits=((-2.0, 2.0), (-2.0, 2.0)),
)
# From below into the middle of a room of 10 m by 10 m.
WALL = [(4.0, 0.0), (6.0, 0.0), (6.0, 6.0), (4.0, 6.0)]


def plan(starts, goals, robot=ROBOT, obstacles=(), movers=(), **options):
    """The answer of the planner, without a host."""
    planner = example_plugin.ExamplePlugin(example_plugin.ExamplePlugin.complete(options))
    planner.workspace = fleetyard.Workspace((0.0, 0.0), (10.0, 10.0), list(obstacles), list(movers))
    instance = fleetyard.Instance(
        start_states=[list(start) for start in starts],
        goal_states=[[list(goal)] for goal in goals],
        motion="dynamics",
        robots=[robot],
    )
    return planner.plan(instance, fleetyard.Budget.lasting(60), Mock())


def place(knots, time_s):
    """The place of a robot at a time."""
    for one, two in zip(knots, knots[1:]):
        if one[0] <= time_s < two[0]:
            share = (time_s - one[0]) / (two[0] - one[0])
            return tuple(a + share * (b - a) for a, b in zip(one[1:3], two[1:3]))
    return knots[-1][1:3] if time_s >= knots[-1][0] else knots[0][1:3]


class Plans(unittest.TestCase):
    def test_straight_where_nothing_is_in_the_way(self):
        self.assertEqual(plan([(1, 1)], [(4, 5)])[0][-1], (2.5, 4, 5))

    def test_round_an_obstacle(self):
        (knots,) = plan([(1, 1)], [(9, 1)], obstacles=[WALL])
        self.assertEqual(knots[-1][1:], (9, 1))
        for step in range(2000):
            x_m, y_m = place(knots, step * 0.01)
            gap_m = math.hypot(max(4 - x_m, 0, x_m - 6), max(0 - y_m, 0, y_m - 6))
            self.assertGreaterEqual(gap_m, 0.5, (x_m, y_m))
        self.assertLess(knots[-1][0], 10, "a short way")

    def test_robots_keep_their_distance(self):
        # The first waits for the second, and the third for the first.
        starts, goals = [(1, 5), (9, 5), (5, 5)], [(9, 5), (9, 9), (1, 5)]
        plans = plan(starts, goals)
        self.assertEqual([knots[-1][1:] for knots in plans], goals)
        for step in range(4000):
            places = [place(knots, step * 0.01) for knots in plans]
            for one in range(3):
                for two in range(one):
                    self.assertGreaterEqual(math.dist(places[one], places[two]), 1.0)
        for knots in plans:
            times = [knot[0] for knot in knots]
            self.assertEqual((times[0], times), (0.0, sorted(times)))

    def test_where_a_mover_may_be_nobody_goes(self):
        mover = fleetyard.Mover(DISC, ((0, 5, 5, 0), (9, 5, 0, 0)))
        (knots,) = plan([(1, 1)], [(9, 1)], movers=[mover])
        self.assertGreater(max(y_m for _, _, y_m in knots), 5.8)

    def test_turns_at_the_goal(self):
        robot = fleetyard.Robot(
            DISC,
            has_heading=True,
            state_limits=(NO_LIMIT,) * 3,
            control_limits=((-1.0, 1.0), (-1.0, 1.0), (-0.5, 0.25)),
        )
        (knots,) = plan([(1, 1, 3.0)], [(3, 1, -3.0)], robot)
        turn = math.tau - 6
        self.assertEqual(knots[-2], (2.0, 3, 1, 3.0))
        self.assertAlmostEqual(knots[-1][0], 2 + 4 * turn)
        self.assertAlmostEqual(knots[-1][3], 3 + turn)
        (knots,) = plan([(1, 1, 3.0)], [(3, 1, ANY)], robot)
        self.assertEqual(knots[-1], (2.0, 3, 1, 3.0))

    def test_says_when_there_is_no_plan(self):
        closed = [(4.0, 0.0), (6.0, 0.0), (6.0, 10.0), (4.0, 10.0)]
        with self.assertRaises(fleetyard.GaveUp):
            plan([(1, 1)], [(9, 1)], obstacles=[closed])


if __name__ == "__main__":
    unittest.main()
