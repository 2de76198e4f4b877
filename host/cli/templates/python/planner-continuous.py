#!/usr/bin/env python3
"""Sends robots through the plane one after the other, while all others stand.

Each goes straight, or along the shortest way round the corners of what is in the way: a
visibility graph (Lozano-Perez and Wesley, "An Algorithm for Planning Collision-Free Paths
Among Polyhedral Obstacles", CACM 1979) of corners that are moved outwards. Neither complete
nor optimal. Put your own algorithm into `plan`.
"""

import heapq
import math

import fleetyard


class ExamplePlugin(fleetyard.Planner):
    """Robots go one after the other, round the corners of what is in the way."""

    id = "example-plugin"
    version = "0.1.0"
    # What the host may ask of the planner; docs/conformance.md lists all there is.
    capabilities = ("continuous", "dynamics", "heterogeneous", "deterministic")
    # Robots that can move in any direction at once; docs/contract.md says what others are.
    features = ("dynamics:fleetyard.single-integrator/1",)
    # What `--option NAME=VALUE` may say. The host checks it before the planner starts.
    options_schema = {
        "type": "object",
        "additionalProperties": False,
        "properties": {
            "clearance_m": {
                "type": "number",
                "minimum": 0,
                "default": 0.001,
                "description": "Distance that robots keep from everything at least.",
            }
        },
    }

    def plan(self, instance, budget, context):
        robots = [instance.robot(agent) for agent in range(instance.agents)]
        plans = [[knot(0.0, state, robot)] for state, robot in zip(instance.start_states, robots)]
        waiting, refused, time_s = list(range(instance.agents)), 0, 0.0
        while waiting:
            agent = waiting.pop(0)
            others = [
                (plans[other][-1][1:3], robots[other].footprint.radius_m)
                for other in range(instance.agents)
                if other != agent
            ]
            goal = instance.goal_states[agent][-1]
            here = plans[agent][-1]
            # Where any x or y will do, the robot keeps its own.
            to = tuple(own if math.isnan(at) else at for at, own in zip(goal, here[1:3]))
            way = self.find_way(here[1:3], to, robots[agent], others, context)
            if way is None:
                waiting.append(agent)
                refused += 1
                if refused == len(waiting):
                    raise fleetyard.GaveUp(f"no way leads agent {agent} to its goal")
                continue
            refused = 0
            plans[agent] += self.drive(way, goal, robots[agent], here, time_s)
            time_s = plans[agent][-1][0]
        return plans

    def drive(self, way, goal, robot, here, time_s):
        """The knots along a way from a time on, and a turn at its end."""
        heading = here[3:]
        knots = [(time_s, *way[0], *heading)] if time_s > here[0] else []
        for one, two in zip(way, way[1:]):
            step = (two[0] - one[0], two[1] - one[1])
            time_s += duration_s(step, robot)
            knots.append((time_s, *two, *heading))
        if robot.has_heading and not math.isnan(goal[2]):
            turn = math.remainder(goal[2] - heading[0], math.tau)
            least, most = robot.control_limits[2] if len(robot.control_limits) > 2 else (-1, 1)
            rate = min(most if turn > 0 else -least, math.pi)
            if turn:
                if rate <= 0:
                    raise fleetyard.Infeasible(f"robot {robot.name!r} cannot turn that way")
                knots.append((time_s + abs(turn) / rate, *way[-1], heading[0] + turn))
        return knots

    def find_way(self, start, goal, robot, others, context):
        """The corners of a shortest way, or None. `others` are places and radii of robots."""
        map, margin_m = self.workspace, self.options["clearance_m"] + 1e-9
        radius_m = robot.footprint.radius_m + margin_m
        # Everything in the way is segments to stay away from, and the distance to keep.
        walls = [
            (corners[at - 1], corners[at], radius_m)
            for corners in map.obstacles
            for at in range(len(corners))
        ]
        walls += [(place, place, radius_m + other_m) for place, other_m in others]
        for mover in map.movers:  # wherever it may ever be
            path = [knot[1:3] for knot in mover.knots]
            apart_m = radius_m + mover.footprint.radius_m
            walls += [(one, two, apart_m) for one, two in zip(path, path[1:] or path)]
        bounds = [
            (max(low + radius_m, limit[0]), min(high - radius_m, limit[1]))
            for low, high, limit in zip(map.min_m, map.max_m, robot.state_limits)
        ]

        def is_free(a, b):
            inside = all(
                low <= p[axis] <= high for p in (a, b) for axis, (low, high) in enumerate(bounds)
            )
            return inside and all(distance_m(a, b, c, d) >= apart for c, d, apart in walls)

        if not is_free(start, start):
            return None
        # Eight points round every end of a segment: the octagon encloses the circle.
        nodes = [start, goal]
        for place, apart_m in sorted({(end, apart) for c, d, apart in walls for end in (c, d)}):
            out_m = (apart_m + 1e-6) / math.cos(math.pi / 8)
            for eighth in range(8):
                angle = (eighth + 0.5) * math.pi / 4
                node = (place[0] + out_m * math.cos(angle), place[1] + out_m * math.sin(angle))
                if is_free(node, node) and not any(contains(c, node) for c in map.obstacles):
                    nodes.append(node)
        heap, done = [(math.dist(start, goal), 0.0, start, (start,))], set()
        while heap:
            _, length_m, here, way = heapq.heappop(heap)
            if here in done:
                continue
            done.add(here)
            if here == goal:
                return list(way)
            for near in nodes:
                context.check()  # ends the call when its time is up
                if near not in done and is_free(here, near):
                    total_m = length_m + math.dist(here, near)
                    estimate_m = total_m + math.dist(near, goal)
                    heapq.heappush(heap, (estimate_m, total_m, near, (*way, near)))
        return None


def knot(time_s, state, robot):
    return (time_s, *state[: 3 if robot.has_heading else 2])


def duration_s(step, robot):
    """Time that a straight step takes as fast as the robot may; at 1 m/s without limits."""
    limits = robot.control_limits[:2]
    length_m = math.hypot(*step)
    if length_m == 0:
        return 0.0
    speeds = []
    for along, (least, most) in zip(step, limits):
        share = along / length_m
        if share:
            speeds.append(max(most / share if share > 0 else least / share, 0.0))
    if robot.polar_control:
        speeds.append(max(most for _, most in limits))
    speed = min(speeds, default=math.inf)
    if speed == 0:
        raise fleetyard.Infeasible(f"robot {robot.name!r} cannot move that way")
    return length_m / (1.0 if speed == math.inf else speed)


def distance_m(a, b, c, d):
    """The distance of the segments from a to b and from c to d."""
    if side(a, b, c) * side(a, b, d) < 0 and side(c, d, a) * side(c, d, b) < 0:
        return 0.0  # they cross
    return min(
        to_segment_m(a, c, d), to_segment_m(b, c, d), to_segment_m(c, a, b), to_segment_m(d, a, b)
    )


def side(a, b, p):
    """Positive if a point is to the left of the line from a to b, negative to the right."""
    return (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])


def to_segment_m(p, a, b):
    """The distance of a point to the segment from a to b."""
    along = (b[0] - a[0], b[1] - a[1])
    squared = along[0] ** 2 + along[1] ** 2
    share = 0.0
    if squared > 0:
        share = ((p[0] - a[0]) * along[0] + (p[1] - a[1]) * along[1]) / squared
        share = min(max(share, 0.0), 1.0)
    return math.dist(p, (a[0] + share * along[0], a[1] + share * along[1]))


def contains(corners, p):
    """True if a point is inside a polygon."""
    inside = False
    for (x, y), (next_x, next_y) in zip(corners, [*corners[1:], corners[0]]):
        if (y > p[1]) != (next_y > p[1]):
            inside ^= p[0] < x + (p[1] - y) / (next_y - y) * (next_x - x)
    return inside


if __name__ == "__main__":
    fleetyard.run(ExamplePlugin)
