#!/usr/bin/env python3
"""The protocol in one page, without the SDK, for authors in other languages: one JSON
object per line, requests on standard input, answers on standard output. The agents go
one after the other while all others stand, which works where there is room to pass."""
import json
import sys
import time
from collections import deque


def steps(grid, start, goal, standing):
    """A shortest path as cells, by breadth-first search around those that stand."""
    rows, cols = grid["rows"], grid["cols"]
    came_from, queue = {start: None}, deque([start])
    while queue and goal not in came_from:
        cell = queue.popleft()
        row, col = divmod(cell, cols)
        for r, c in ((row - 1, col), (row, col + 1), (row + 1, col), (row, col - 1)):
            if 0 <= r < rows and 0 <= c < cols and grid["passable"][r][c] == ".":
                if (r * cols + c) not in standing and (r * cols + c) not in came_from:
                    came_from[r * cols + c] = cell
                    queue.append(r * cols + c)
    path = [goal] if goal in came_from else []
    while path and came_from[path[-1]] is not None:
        path.append(came_from[path[-1]])
    return path[::-1]


def plan(grid, instance, budget):
    paths = [[start] for start in instance["starts"]]
    waiting = [(agent, goals[-1]) for agent, goals in enumerate(instance["goals"])]
    for _ in range(len(waiting) ** 2 + 1):  # who finds no way now may find one later
        if not waiting:
            return {"status": "solved", "paths": paths}
        if time.monotonic_ns() > budget["answer_by_ns"]:
            return {"status": "timed-out"}  # later, the host may kill this process
        agent, goal = waiting.pop(0)
        standing = {path[-1] for path in paths} - {paths[agent][-1]}
        path = steps(grid, paths[agent][-1], goal, standing)[1:]
        if not path and paths[agent][-1] != goal:
            waiting.append((agent, goal))
        for other, so_far in enumerate(paths):
            so_far.extend(path if other == agent else [so_far[-1]] * len(path))
    return {"status": "gave-up", "message": "somebody stands in everybody's way"}


def unknown(given):
    """The refusal of a map that is no grid, or of data that must be understood and is not."""
    names = [part["id"] for part in given.get("parts", []) if part.get("critical")]
    if given.get("representation", "grid") != "grid":
        names.append(given["representation"])
    if names:
        return {"status": "unsupported", "message": f"{names[0]} is unknown here"}


for line in sys.stdin:
    message = json.loads(line)
    answer, params = {"jsonrpc": "2.0", "id": message.get("id")}, message.get("params")
    if message["method"] == "initialize":  # params["protocol_versions"] has 1, for now
        about = {"id": "raw-protocol", "kind": "planner", "version": "0.1.0"}
        about["capabilities"] = ["grid", "pebble"]
        answer["result"] = {"protocol_version": 1, "plugins": [about]}
    elif message["method"] == "prepare":
        grid = params["environment"].get("grid")  # else a "roadmap" or a "workspace"
        answer["result"] = unknown(params["environment"]) or {"status": "solved"}
    elif message["method"] == "plan":
        answer["result"] = unknown(params["instance"]) or plan(
            grid, params["instance"], params["budget"])
    elif message["method"] == "exit":
        break
    else:  # create and shutdown; the notification $/cancel may be ignored
        answer["result"] = {"status": "solved"} if message["method"] == "create" else None
    if "id" in message:
        print(json.dumps(answer), flush=True)
