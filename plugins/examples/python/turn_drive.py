#!/usr/bin/env python3
"""Turns, drives and turns: a planner for unicycles that set their accelerations, whose plan is
nothing but controls.

One robot after the other: it turns towards its goal, drives straight, and turns as it should end,
speeding up and slowing down as hard as it may, while the others stand. Where something is in the
way it gives up.
"""

import math
import pathlib
import sys

try:
    import fleetyard
except ImportError:  # not installed: the package lies in the same repository
    sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[3] / "abi" / "python"))
    import fleetyard


def ramps(distance, fastest, push):
    """The accelerations, each with its time, that cover a distance from rest to rest."""
    way, distance = math.copysign(1, distance), abs(distance)
    if distance < 1e-9:
        return []
    top = min(fastest, math.sqrt(distance * push))
    sped_s = top / push
    rolls_s = (distance - top * sped_s) / top
    all_three = [(sped_s, way * push), (rolls_s, 0.0), (sped_s, -way * push)]
    return [(duration_s, change) for duration_s, change in all_three if duration_s > 1e-9]


def either_way(limits):
    """What a pair of limits allows either way."""
    size = min(-limits[0], limits[1])
    return size if math.isfinite(size) else 1.0


def apart(point, one, two):
    """The distance of a point from the segment between two others."""
    (x, y), (dx, dy) = (point[0] - one[0], point[1] - one[1]), (two[0] - one[0], two[1] - one[1])
    long = dx * dx + dy * dy
    share = min(max((x * dx + y * dy) / long, 0), 1) if long else 0
    return math.hypot(x - share * dx, y - share * dy)


def crosses(one, two, a, b):
    """True if two segments cross."""

    def side(p, q, r):
        return (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])

    return side(one, two, a) * side(one, two, b) < 0 and side(a, b, one) * side(a, b, two) < 0


class TurnDrive(fleetyard.Planner):
    id = "turn-drive"
    name = "Turn, drive, turn"
    version = "0.1.0"
    license = "MIT OR Apache-2.0"
    description = "Straight to the goal, one robot after the other, as controls alone."
    capabilities = ("continuous", "dynamics", "heterogeneous", "deterministic")
    features = ("dynamics:fleetyard.unicycle-2/1",)

    def is_free(self, one, two, radius_m, others):
        """True if a disc may drive from one place to the other."""
        space = self.workspace
        for point in (one, two):
            for axis in (0, 1):
                if not space.min_m[axis] + radius_m <= point[axis] <= space.max_m[axis] - radius_m:
                    return False
        for polygon in space.obstacles:
            for a, b in zip(polygon, [*polygon[1:], polygon[0]]):
                ends = [apart(a, one, two), apart(b, one, two), apart(one, a, b), apart(two, a, b)]
                if min(ends) < radius_m or crosses(one, two, a, b):
                    return False
        return all(apart(at, one, two) >= radius_m + own_m for at, own_m in others)

    def plan(self, instance, budget, context):
        if self.workspace.movers:
            raise fleetyard.Unsupported("this planner knows no moving obstacles")
        radii = [instance.robot(agent).footprint.radius_m for agent in range(instance.agents)]
        places = [tuple(start[:2]) for start in instance.start_states]
        motions, begins_s = [], 0.0
        for agent, (start, goals) in enumerate(zip(instance.start_states, instance.goal_states)):
            goal, robot = goals[-1], instance.robot(agent)
            others = [(places[other], radii[other]) for other in range(instance.agents)]
            del others[agent]
            if not self.is_free(start[:2], goal[:2], radii[agent], others):
                raise fleetyard.GaveUp(f"something is in the way of agent {agent}")
            speed, turns = min(robot.state_limits[3][1], 10.0), either_way(robot.state_limits[4])
            push, twist = map(either_way, robot.control_limits)
            far = math.dist(start[:2], goal[:2])
            course = math.atan2(goal[1] - start[1], goal[0] - start[0]) if far else start[2]
            ends = course if math.isnan(goal[2]) else goal[2]
            controls = [(begins_s, (0.0, 0.0))] if begins_s else []
            for turn in (course - start[2], None, ends - course):
                if turn is None:
                    controls += [(time_s, (by, 0.0)) for time_s, by in ramps(far, speed, push)]
                    continue
                turn = math.remainder(turn, math.tau)
                controls += [(time_s, (0.0, by)) for time_s, by in ramps(turn, turns, twist)]
            begins_s = sum(time_s for time_s, _ in controls) or begins_s
            places[agent] = tuple(goal[:2])
            motions.append(fleetyard.Motion(controls))
        return motions


if __name__ == "__main__":
    fleetyard.run(TurnDrive)
