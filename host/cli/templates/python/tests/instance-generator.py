"""python3 -m unittest discover tests"""

import pathlib
import sys
import unittest
from unittest.mock import Mock

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))

import example_plugin
import fleetyard


def generate(row, cells, goals, tasks, **options):
    """The goals that the generator gives, without a host."""
    generator = example_plugin.ExamplePlugin(example_plugin.ExamplePlugin.complete(options))
    generator.grid = fleetyard.Grid.from_rows([row])
    tasks = [fleetyard.Task(number, task) for number, task in enumerate(tasks)]
    state = fleetyard.FleetState(0.0, fleetyard.Instance(cells, goals), tasks)
    return generator.generate(state, fleetyard.Budget.lasting(10), Mock()).goals


class Generates(unittest.TestCase):
    def test_a_task_goes_to_the_nearest_who_is_idle(self):
        goals = generate("......", [0, 3, 5], [[], [], [2]], [[4, 1]])
        self.assertEqual(goals, [[0], [4, 1], [2]])

    def test_no_two_agents_end_in_one_cell(self):
        goals = generate("....", [0, 3], [[], [1]], [[2, 1], [3, 0]])
        self.assertEqual(goals, [[3, 0], [1]])
        self.assertEqual(generate("...", [1, 2], [[], [1]], []), [[0], [1]])

    def test_nobody_is_sent_behind_a_wall(self):
        self.assertEqual(generate("..@.", [0], [[]], [[3], [1, 3]]), [[0]])

    def test_gives_away_no_more_than_it_may(self):
        self.assertEqual(generate("...", [0, 1], [[], []], [[2]], most_tasks=0), [[0], [1]])


if __name__ == "__main__":
    unittest.main()
