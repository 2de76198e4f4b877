#!/usr/bin/env python3
"""Whether every standard planner answers within its budget, whatever it is asked.

    scripts/limits.py --fleetyard target/release/fleetyard [--budgets 3s 10s] [--planners ID ...]

Each planner gets tasks that have no solution and large ones, alone and in teams, in each budget, with
no grace: none may be killed. Prints a line for each call that was, and ends with 1 then. What else runs on
the machine, or on the one below it, takes its time from the planners: a killed call that was contended is
asked again, twice at most. Some twenty minutes; tests hold planners to 0.1 s and 1 s. Standard library only.
"""

import argparse
import json
import random
import subprocess
import sys
import tempfile
from pathlib import Path

# Times that a call is asked which was killed while others had the processor.
TRIES = 3

MODELS = {
    "disc": {"single-integrator": {"speed_m_per_s": 1.0}},
    "rover": {"unicycle-1": {"max_speed_m_per_s": 1.0, "max_turn_rate_rad_per_s": 1.0}},
}


def square(x, y, side):
    return {"polygon": [[x, y], [x + side, y], [x + side, y + side], [x, y + side]]}


def tasks(folder, model):
    """Task files by name: with and without a solution, of one robot and of many."""
    draw = random.Random(1)
    pillars = [square(4.0 * i + 2.0, 4.0 * j + 2.0, 1.0) for i in range(30) for j in range(30)]
    places = [[4.0 * i + 0.7, 4.0 * j + 0.7] for i in range(30) for j in range(30)]
    starts, goals = draw.sample(places, 100), draw.sample(places, 100)
    corridor = [[0.7 + 1.1 * at, 0.45] for at in (0, 1, 8, 9)]
    walls = [
        {"polygon": [[6, 6], [10, 6], [10, 6.3], [6, 6.3]]},
        {"polygon": [[6, 9.7], [10, 9.7], [10, 10], [6, 10]]},
        {"polygon": [[6, 6.4], [6.3, 6.4], [6.3, 9.6], [6, 9.6]]},
        {"polygon": [[9.7, 6.4], [10, 6.4], [10, 9.6], [9.7, 9.6]]},
    ]
    worlds = {
        "stuck-team": ([0, 0, 12, 0.9], [], list(zip(corridor, corridor[::-1]))),
        "stuck-one": ([0, 0, 16, 16], walls, [([1.0, 1.0], [8.0, 8.0])]),
        "huge-team": ([0, 0, 122, 122], pillars, list(zip(starts, goals))),
        "huge-one": ([0, 0, 122, 122], pillars, [(places[0], places[-1])]),
    }
    made = {}
    for name, (bounds, obstacles, agents) in worlds.items():
        world = {"format": "fleetyard.world/1", "name": name, "bounds_m": bounds,
                 "obstacles": obstacles, "movers": []}
        (folder / f"{name}.world.json").write_text(json.dumps(world))
        heading = [0.0] if model == "rover" else []
        task = {
            "format": "fleetyard.task/1", "name": name, "world": f"{name}.world.json", "seed": 1,
            "goal_tolerance_m": 0.1, "goal_tolerance_rad": 3.2,
            "robots": {model: {"footprint": {"disc": {"radius_m": 0.3}}, "model": MODELS[model]}},
            "agents": [{"robot": model, "start": start + heading, "goal": goal + heading}
                       for start, goal in agents],
        }
        made[name] = folder / f"{name}.task.json"
        made[name].write_text(json.dumps(task))
    return made


def run(program, planner, task, budget):
    command = [program, "run", "--task", str(task), "--planner", planner, "--budget", budget,
               "--prepare-budget", "1m", "--format", "json"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    try:
        return json.loads(done.stdout), done.stderr
    except json.JSONDecodeError:
        return None, done.stderr


def asked(program, planner, task, budget):
    """The record of a call that nobody else had a part in, its faults, and whether it was killed."""
    for _ in range(TRIES):
        record, said = run(program, planner, task, budget)
        if record is None or record.get("claim") == "unsupported":
            return None, said, False
        was_killed = record["stopped"] or record["termination"] != "completed"
        if not (was_killed and record["measurement"]["contended"]):
            break
    return record, record["fault"] or said.strip(), was_killed


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n", maxsplit=1)[0])
    parser.add_argument("--fleetyard", default="target/release/fleetyard")
    parser.add_argument("--budgets", nargs="+", default=["3s", "10s"])
    parser.add_argument("--planners", nargs="+")
    given = parser.parse_args()
    listed = subprocess.run([given.fleetyard, "plugins", "list", "--format", "json"],
                            capture_output=True, text=True, check=True)
    known = [plugin["id"] for origin in json.loads(listed.stdout) if origin["origin"] == "built-in"
             for plugin in origin["plugins"] if plugin["kind"] == "planner"]
    killed = calls = 0
    silent = []
    with tempfile.TemporaryDirectory() as folder:
        made = {}
        for model in MODELS:
            place = Path(folder) / model
            place.mkdir()
            made[model] = tasks(place, model)
        for planner in given.planners or known:
            answered = False
            for model in MODELS:
                if answered:
                    break
                for name, task in made[model].items():
                    for budget in given.budgets:
                        record, fault, was_killed = asked(given.fleetyard, planner, task, budget)
                        if record is None:
                            break
                        answered, calls = True, calls + 1
                        if was_killed:
                            killed += 1
                            print(f"{planner}: {name} within {budget}: {record['termination']}: {fault}")
            if not answered:
                silent.append(planner)
    if silent:
        print(f"asked nothing: {', '.join(silent)}")
    print(f"{calls} calls, {killed} killed")
    return int(killed > 0)


if __name__ == "__main__":
    sys.exit(main())
