#!/usr/bin/env python3
"""A planner for roadmaps: everybody takes a quickest way round the starts and goals of all
others, and leaves so much later that it meets nobody who was planned before.

Where such ways exist, the infrastructure is well-formed, and there always is a plan: at the
worst everybody leaves when all before have arrived (Cap, Vokrinek and Kleiner, "Complete
Decentralized Method for On-Line Multi-Robot Trajectory Planning in Well-formed
Infrastructures", ICAPS 2015). Who is nearer than the separation is worked out exactly, in
closed form.
"""

import heapq
import math
import pathlib
import sys

try:
    import fleetyard
except ImportError:  # not installed: the package lies in the same repository
    sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[3] / "abi" / "python"))
    import fleetyard


class LeaveLater(fleetyard.Planner):
    id = "leave-later-python"
    name = "Leave later (Python example)"
    version = "0.1.0"
    license = "MIT OR Apache-2.0"
    description = (
        "Ways round the starts and goals of all others, and departures late enough to meet "
        "nobody (Cap, Vokrinek, Kleiner 2015)."
    )
    # Full speed is right where slower is allowed as well.
    capabilities = ("roadmap", "stop-go", "slower", "deterministic")
    options_schema = {
        "type": "object",
        "additionalProperties": False,
        "properties": {
            "step_s": {
                "type": "number",
                "exclusiveMinimum": 0,
                "default": 0.25,
                "description": "Departures are tried in such steps.",
            }
        },
    }

    def plan(self, instance, budget, context):
        ways = [self.find_way(instance, agent, context) for agent in range(instance.agents)]
        # Who has the longest way goes first: it ends last anyway.
        order = sorted(range(len(ways)), key=lambda agent: (-ways[agent][-1][1], agent))
        planned = {}
        for agent in order:
            end_s = max((visits[-1][1] for visits in planned.values()), default=0.0)
            tried = 0
            while True:
                context.check()
                leave_s = min(tried * self.options["step_s"], end_s)
                visits = later(ways[agent], leave_s)
                if not any(self.meet(visits, other) for other in planned.values()):
                    break
                if leave_s == end_s:
                    raise fleetyard.GaveUp(f"agent {agent} meets somebody whenever it leaves")
                tried += 1
            planned[agent] = visits
        return [planned[agent] for agent in range(len(ways))]

    def find_way(self, instance, agent, context):
        """Vertices with the times of a quickest way that nobody's start or goal is near."""
        roadmap = self.roadmap
        start, goal = instance.starts[agent], instance.goal(agent)
        others = {
            roadmap.point(place)
            for other in range(instance.agents)
            if other != agent
            for place in (instance.starts[other], instance.goal(other))
        }
        times, before, heap = {start: 0.0}, {}, [(0.0, start)]
        while heap:
            context.check()
            reached_s, vertex = heapq.heappop(heap)
            if vertex == goal:
                break
            if reached_s > times[vertex]:
                continue
            for near, duration_s in roadmap.drives(vertex):
                there_s = reached_s + duration_s
                if there_s < times.get(near, math.inf) and not any(
                    self.is_near(place, vertex, near) for place in others
                ):
                    times[near], before[near] = there_s, vertex
                    heapq.heappush(heap, (there_s, near))
        if goal not in times:
            if roadmap.durations(goal)[start] == math.inf:
                raise fleetyard.Infeasible(f"no way leads agent {agent} to its goal")
            raise fleetyard.GaveUp(f"no way of agent {agent} is clear of all starts and goals")
        way = [(goal, times[goal])]
        while way[-1][0] != start:
            vertex = before[way[-1][0]]
            way.append((vertex, times[vertex]))
        return way[::-1]

    def is_near(self, place, *ends):
        """True if somebody who drives along an edge comes too near to one at a place."""
        motion = [(0.0, self.roadmap.point(ends[0])), (1.0, self.roadmap.point(ends[1]))]
        return self.too_near(motion, [(0.0, place)])

    def meet(self, one, two):
        """True if two agents come too near to each other."""
        return self.too_near(
            *(
                [
                    (time_s, self.roadmap.point(vertex))
                    for vertex, arrival_s, leave_s in visits
                    for time_s in (arrival_s, leave_s)
                ]
                for visits in (one, two)
            )
        )

    def too_near(self, one, two):
        # A little more, for times and places are rounded.
        apart_m = self.roadmap.separation_m * (1 + 1e-9)
        times = sorted({time_s for motion in (one, two) for time_s, _ in motion})
        offsets = [
            [b - a for a, b in zip(place(one, time_s), place(two, time_s))] for time_s in times
        ]
        # Between these times both move straight and evenly, and so does their offset.
        return any(nearest_m(*pair) < apart_m for pair in zip(offsets, offsets[1:] or offsets))


def later(way, leave_s):
    """The visits along a way that begins so much later."""
    start = (way[0][0], 0.0, leave_s)
    return [start, *((vertex, leave_s + time_s, leave_s + time_s) for vertex, time_s in way[1:])]


def place(motion, time_s):
    """The place of one at a time: at rest before the first and after the last moment."""
    for (from_s, start), (to_s, end) in zip(motion, motion[1:]):
        if from_s <= time_s < to_s:
            share = (time_s - from_s) / (to_s - from_s)
            return [a + share * (b - a) for a, b in zip(start, end)]
    return motion[0][1] if time_s < motion[0][0] else motion[-1][1]


def nearest_m(one, two):
    """The least length of an offset that changes evenly from one to the other."""
    along = [b - a for a, b in zip(one, two)]
    squared = sum(value * value for value in along)
    share = 0.0
    if squared > 0:
        share = min(max(-sum(a * d for a, d in zip(one, along)) / squared, 0.0), 1.0)
    return math.hypot(*(a + share * d for a, d in zip(one, along)))


if __name__ == "__main__":
    fleetyard.run(LeaveLater)
