#!/usr/bin/env python3
"""Prioritized planning on a roadmap: agents plan one after the other, each round those before it.

An agent that drives along an edge or stands on a vertex reserves it for that time, with all
that is nearer than the separation: more than it takes, and simple. Neither complete nor
optimal. Put your own algorithm into `plan`.
"""

import heapq
import math

import fleetyard


class ExamplePlugin(fleetyard.Planner):
    """Prioritized planning on roadmaps, in another order when an agent finds no way."""

    id = "example-plugin"
    version = "0.1.0"
    # What the host may ask of the planner; docs/conformance.md lists all there is. Driving at
    # full speed, as this one does, is right where slower is allowed as well.
    capabilities = ("roadmap", "stop-go", "slower", "deterministic")
    # What `--option NAME=VALUE` may say. The host checks it before the planner starts.
    options_schema = {
        "type": "object",
        "additionalProperties": False,
        "properties": {
            "attempts": {
                "type": "integer",
                "minimum": 1,
                "default": 100,
                "description": "Most orders of the agents to try.",
            }
        },
    }

    def plan(self, instance, budget, context):
        order = list(range(instance.agents))
        for _ in range(self.options["attempts"]):
            plans, reserved = {}, []
            for agent in order:
                visits = self.find_way(instance, agent, reserved, context)
                if visits is None:
                    break
                plans[agent] = visits
                reserved += self.reservations(visits)
            else:
                return [plans[agent] for agent in range(instance.agents)]
            if not plans:
                raise fleetyard.Infeasible(f"no way leads agent {agent} to its goal")
            # Who found no way goes first, and who went first goes last.
            order.remove(agent)
            order = [agent, *order[1:], order[0]]
        raise fleetyard.GaveUp("no order of the agents worked")

    def find_way(self, instance, agent, reserved, context):
        """The visits of a quickest way that meets no reservation, or None.

        Safe interval path planning (Phillips and Likhachev, ICRA 2011): of each time in which
        a vertex is free only the earliest arrival counts.
        """
        start, goal = instance.starts[agent], instance.goal(agent)
        ahead_s = self.roadmap.durations(goal)
        free = {}  # when a vertex (one end) or an edge (two ends) is free

        def free_times(*ends):
            if ends not in free:
                free[ends] = self.free_times(ends, reserved)
            return free[ends]

        first = next(iter(free_times(start)), (math.inf, 0))
        if first[0] > 0 or ahead_s[start] == math.inf:
            return None
        # Estimated end, arrival, vertex, its free time, and the visits so far.
        heap, done = [(ahead_s[start], 0.0, start, first, ())], set()
        while heap:
            context.check()  # ends the call when its time is up
            _, arrival_s, vertex, (begin_s, end_s), before = heapq.heappop(heap)
            if (vertex, begin_s) in done:
                continue
            done.add((vertex, begin_s))
            if vertex == goal and end_s == math.inf:
                return [*before, (vertex, arrival_s, arrival_s)]
            for near, duration_s in self.roadmap.drives(vertex):
                for window in free_times(near):
                    for edge in free_times(vertex, near):
                        leave_s = max(arrival_s, edge[0], window[0] - duration_s)
                        latest_s = min(edge[1] - duration_s, window[1] - duration_s, end_s)
                        if leave_s <= latest_s and (near, window[0]) not in done:
                            there_s = leave_s + duration_s
                            visits = (*before, (vertex, arrival_s, leave_s))
                            estimate_s = there_s + ahead_s[near]
                            heapq.heappush(heap, (estimate_s, there_s, near, window, visits))
        return None

    def reservations(self, visits):
        """The points and segments that an agent is on, each with its times."""
        result = []
        for (one, _, leave_s), (two, there_s, _) in zip(visits, visits[1:]):
            result.append((self.segment((one, two)), leave_s, there_s))
        for vertex, arrival_s, leave_s in visits[:-1]:
            result.append((self.segment((vertex,)), arrival_s, leave_s))
        vertex, arrival_s, _ = visits[-1]  # where it stays
        return [*result, (self.segment((vertex,)), arrival_s, math.inf)]

    def free_times(self, ends, reserved):
        """The times in which nobody is too near to a vertex or an edge, in order."""
        # A little more, for times and places are rounded.
        apart_m = self.roadmap.separation_m * (1 + 1e-9)
        segment = self.segment(ends)
        busy = [
            (begin_s, end_s)
            for other, begin_s, end_s in reserved
            if distance_m(*segment, *other) < apart_m
        ]
        times, since_s = [], 0.0
        for begin_s, end_s in sorted(busy):
            if begin_s > since_s:
                times.append((since_s, begin_s))
            since_s = max(since_s, end_s)
        return times if since_s == math.inf else [*times, (since_s, math.inf)]

    def segment(self, ends):
        return self.roadmap.point(ends[0]), self.roadmap.point(ends[-1])


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


if __name__ == "__main__":
    fleetyard.run(ExamplePlugin)
