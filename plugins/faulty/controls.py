#!/usr/bin/env python3
"""controls.c as a program that speaks JSON over stdio, without the SDK: single integrators drive
straight to their goals, by knots and by controls, of which one is wrong on request."""

import json
import math
import sys

SPEED = 0.5
FAULTS = ["none", "off-controls", "too-fast", "ragged", "lengths", "huge", "null", "nan",
          "negative", "endless", "no-list", "neither", "twice"]
ABOUT = {
    "id": "faulty-controls", "kind": "planner", "version": "0.1.0",
    "capabilities": ["continuous", "dynamics", "heterogeneous", "deterministic"],
    "features": ["dynamics:fleetyard.single-integrator/1"],
    "options_schema": {
        "type": "object", "additionalProperties": False,
        "properties": {"fault": {"type": "string", "default": "none", "enum": FAULTS}}},
}


def motion(start, goal, fault):
    way = [goal[0] - start[0], goal[1] - start[1]]
    takes_s = math.hypot(*way) / (SPEED * (4 if fault == "too-fast" else 1)) + 1e-3
    aside = 0.1 if fault == "off-controls" else 0
    knots = [[0, *start[:2]], [takes_s, *goal[:2]]]
    half = [takes_s / 2, way[0] / takes_s, way[1] / takes_s + aside]
    return {"knots": knots, "controls": [half, list(half)]}


def spoil(motions, fault):
    """The plan with its fault, as text: some are none that a library would write."""
    controls = motions[0]["controls"]
    if fault == "ragged":
        controls[1].pop()
    elif fault == "lengths":
        motions[0]["controls"] = [control[:2] for control in controls]
    elif fault == "huge":
        controls[0] = [0] * 100_000
    elif fault == "null":
        controls[0][1] = None
    elif fault == "nan":
        controls[0][1] = math.nan
    elif fault == "negative":
        controls[0][0] = -1
    elif fault == "endless":
        controls[0][0] = 1e300
    elif fault == "no-list":
        motions[0]["controls"] = {"0": controls[0]}
    elif fault == "neither":
        motions[0] = {}
    text = json.dumps(motions)
    return text.replace('"controls"', '"controls": [], "controls"', 1) if fault == "twice" else text


for line in sys.stdin:
    message = json.loads(line)
    number, params, method = message.get("id"), message.get("params"), message["method"]
    if method == "exit":
        break
    result = '{"status": "solved"}'
    if method == "initialize":
        result = json.dumps({"protocol_version": 1, "plugins": [ABOUT]})
    elif method == "create":
        wanted = (params.get("options") or {}).get("fault", "none")
    elif method == "plan":
        instance = params["instance"]
        pairs = zip(instance["start_states"], instance["goal_states"])
        plan = spoil([motion(start, goals[-1], wanted) for start, goals in pairs], wanted)
        result = '{"status": "solved", "trajectories": %s}' % plan
    elif method == "shutdown":
        result = "null"
    if number is not None:
        print('{"jsonrpc": "2.0", "id": %d, "result": %s}' % (number, result), flush=True)
