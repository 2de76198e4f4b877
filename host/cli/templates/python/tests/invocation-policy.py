"""python3 -m unittest discover tests"""

import pathlib
import sys
import unittest
from unittest.mock import Mock

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))

import example_plugin
import fleetyard


def should_invoke(since_s, actions_left, **options):
    """The answer of the policy, without a host."""
    status = fleetyard.FleetStatus(
        time_s=100.0,
        since_last_call_s=since_s,
        planning_limit_s=1.0,
        action_s=0.5,
        actions_left=actions_left,
    )
    return example_plugin.ExamplePlugin(example_plugin.ExamplePlugin.complete(options)).should_invoke(status, Mock())


class Invokes(unittest.TestCase):
    def test_calls_when_it_is_time(self):
        self.assertFalse(should_invoke(4.9, [1, 2]))
        self.assertTrue(should_invoke(5.0, [1, 2]))
        self.assertTrue(should_invoke(2.0, [1, 2], period_s=2))

    def test_calls_when_somebody_is_idle(self):
        self.assertTrue(should_invoke(0.0, [1, 0]))


if __name__ == "__main__":
    unittest.main()
