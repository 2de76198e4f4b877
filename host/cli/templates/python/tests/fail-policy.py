"""python3 -m unittest discover tests"""

import pathlib
import sys
import unittest
from unittest.mock import Mock

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))

import example_plugin
import fleetyard


def recover(row, failed_plan, **options):
    """The answer of the policy, without a host."""
    policy = example_plugin.ExamplePlugin(example_plugin.ExamplePlugin.complete(options))
    policy.grid = fleetyard.Grid.from_rows([row])
    starts = [0, len(row) - 1]
    instance = fleetyard.Instance(starts, [[goal] for goal in reversed(starts)])
    return policy.recover(instance, failed_plan, fleetyard.Budget.lasting(10), Mock())


class Recovers(unittest.TestCase):
    def test_stops_before_the_collision(self):
        self.assertEqual(recover("....", [[0, 1, 2, 3], [3, 2, 1, 0]]), [[0, 1], [3, 2]])
        self.assertEqual(recover("...", [[0, 1, 2], [2, 1, 0]]), [[0], [2]])

    def test_takes_no_more_steps_than_it_may(self):
        self.assertEqual(recover("....", [[0, 1], [3, 2]], steps=0), [[0], [3]])

    def test_waits_where_there_is_nothing_to_follow(self):
        self.assertEqual(recover("..", None, steps=1), [[0, 0], [1, 1]])
        self.assertEqual(recover("..", [[0, -1], [1]]), [[0], [1]])


if __name__ == "__main__":
    unittest.main()
