#!/usr/bin/env python3
"""Drives the mazes of the grid-maze benchmark with a robot that has a body and dynamics: planners on the grid, in the
plane and for dynamics, each plan followed by the benchmark's waypoint law and, where it has controls, by these exactly.

    scripts/maze-paper drive [--sizes N,…] [--seeds N] [--planner ID]… [--budget TIME] [--only CELLS,SEED,PLANNER,MODEL]
                            [--out FOLDER] [--rows FILE]

Mazes by the recursive backtracker of each size [default: 5,9,15], seeds 7, 8, … [default: 3 of them], on cells of 1 m. The
robot is a rectangle of 0.6 x 0.4 m. Planners on grids get the maze's own cells; planners in the plane its walls and the
most exact model of the robot that they know: that of the waypoint law, which is a unicycle of second order, or one of
first order, or a body that sets out in any direction. Every installed planner is asked unless --planner names some. One
that improves its plan until the budget [default: 5s] ends is asked for its first plan where it has that option; else it has
the budget in the plane, and is left out on the grid, where the maze has one way.

A trial that is done is a file in FOLDER/trials [default: target/maze-paper/drive], and is not repeated for the same planner
and maze. Rows go to FILE [default: docs/results/maze-drive.csv], the table of the page to standard output. --only makes one row
anew and prints it. FLEETYARD names the command. Standard library only.
"""

import argparse
import csv
import hashlib
import json
import math
import os
import pathlib
import statistics
import subprocess
import sys

sys.dont_write_bytecode = True

from experiment import ROOT, as_csv, keep, only, replace  # noqa: E402

FIRST_SEED = 7
BODY_M = (0.6, 0.4)
FOOTPRINT = {"rectangle": {"length_m": BODY_M[0], "width_m": BODY_M[1]}}
# The parameters of the benchmark's program (docs/mazes.md), but for its speed: all drivers have the robot's.
PROGRAM = {"max_turn_rate_rad_per_s": 3.5, "speed_up_m_per_s2": 7, "slow_down_m_per_s2": 9, "braking_m_per_s2": 9, "turn_up_rad_per_s2": 12,
           "turn_down_rad_per_s2": 14, "drive_within_rad": 0.25, "turn_beyond_rad": 0.85, "arrival_tolerance_m": 0.35, "final_tolerance_m": 0.5}
SPEED = 1
TURN_RATE = 1.5
LAW = {"max_speed_m_per_s": SPEED, "max_turn_rate_rad_per_s": TURN_RATE}
# Who drives along the waypoints of a plan.
DRIVERS = {"law": {"waypoint-law": LAW}, "program": {"waypoint-law": {**PROGRAM, "max_speed_m_per_s": SPEED}}}
# The robot as planners in the plane are told it, the most exact first: feature, name, model.
MODELS = (
    ("dynamics:fleetyard.unicycle-2/1", "second", {"waypoint-law": LAW}),
    ("dynamics:fleetyard.unicycle/1", "first", {"unicycle-1": {**LAW, "control": {"reverse": False}}}),
    ("dynamics:fleetyard.single-integrator/1", "single", {"single-integrator": {"speed_m_per_s": SPEED, "turn_rate_rad_per_s": TURN_RATE}}),
)
# How far from its goal a plan may end: that of the sampling planners of others.
GOAL = {"goal_tolerance_m": 0.2, "goal_tolerance_rate": 0.2}
# A curved way has waypoints so that the lines between them are nowhere farther beside it.
BESIDE_M = 0.02
FIGURES = ("time_s", "way_m", "off_max_m", "contacts", "margin_m")
COLUMNS = ["cells", "seed", "planner", "model", "termination", "solved", "failure", "first_ms", "cpu_ms", "searched", "length_m", "plan_s",
           "plan_margin_m", "waypoints", "controls", *(f"{driver}_{figure}" for driver in DRIVERS for figure in ("arrived", *FIGURES)), "build"]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter, usage=argparse.SUPPRESS)
    parser.add_argument("--sizes", type=lambda text: [int(one) for one in text.split(",")], default=[5, 9, 15])
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--planner", action="append")
    parser.add_argument("--budget", default="5s")
    parser.add_argument("--only", type=only("CELLS", "SEED", "PLANNER", "MODEL"))
    parser.add_argument("--out", type=pathlib.Path, default=ROOT / "target" / "maze-paper" / "drive")
    parser.add_argument("--rows", type=pathlib.Path, default=ROOT / "docs" / "results" / "maze-drive.csv")
    arguments = parser.parse_args()
    experiment = Experiment(arguments)
    rows = experiment.run()
    if arguments.only:
        print(as_csv(COLUMNS, rows), end="")
        return
    keep(arguments.rows, COLUMNS, rows)
    print_tables(rows)


class Maze:
    """A maze as a map with a scenario, and as tasks in the plane by model."""

    def __init__(self, size, seed, folder, run):
        self.cells, self.seed = size, seed
        run("maps", "generate", "maze", "--width", size, "--height", size, "--random", "python", "--seed", seed, "--scenario", "--out", folder)
        side = 2 * size + 1
        self.map = folder / f"maze-{side}-{side}-1-backtracker-{seed}.map"
        self.scenario = self.map.with_suffix(".scen")
        letters = self.map.read_text(encoding="utf-8").split("map\n", 1)[1].split()
        self.blocked = {(col, side - 1 - row) for row, line in enumerate(letters) for col, letter in enumerate(line) if letter == "@"}
        start_col, start_row, goal_col, goal_row = map(int, self.scenario.read_text(encoding="utf-8").splitlines()[1].split("\t")[4:8])
        place = lambda col, row: [col + 0.5, side - 1 - row + 0.5]
        self.start, goal = place(start_col, start_row), place(goal_col, goal_row)
        self.tasks = {}
        models = {name: model for _, name, model in MODELS} | DRIVERS
        for name, model in models.items():
            self.tasks[name] = folder / f"{self.map.stem}-{name}.task.json"
            task = {"format": "fleetyard.task/1", "name": f"{self.map.stem}-{name}", "map": self.map.name, "cell_size_m": 1, "seed": seed,
                    "robots": {"cart": {"footprint": FOOTPRINT, "model": model}}, "agents": [{"start": [*self.start, 0], "goal": goal}], **GOAL}
            replace(self.tasks[name], json.dumps(task, indent=1) + "\n")

    def margin(self, x, y, heading):
        """The least distance of the body from a wall; 0 where it touches one."""
        cos, sin = math.cos(heading), math.sin(heading)
        # In the frame of the body.
        long, wide = BODY_M[0] / 2, BODY_M[1] / 2
        least = math.inf
        for col in range(int(x) - 1, int(x) + 2):
            for row in range(int(y) - 1, int(y) + 2):
                if (col, row) in self.blocked:
                    least = min(least, self.apart(x, y, cos, sin, long, wide, col, row))
        return least

    @staticmethod
    def apart(x, y, cos, sin, long, wide, col, row):
        """The distance of the body from a cell."""
        corners = [(x + cos * u - sin * v, y + sin * u + cos * v) for u, v in ((long, wide), (-long, wide), (-long, -wide), (long, -wide))]
        cell = [(col, row), (col + 1, row), (col + 1, row + 1), (col, row + 1)]
        # Where neither has a side between them, they overlap.
        if max(min(c[0] for c in corners) - col - 1, col - max(c[0] for c in corners), min(c[1] for c in corners) - row - 1,
               row - max(c[1] for c in corners)) <= 0:
            own = [((c - x) * cos + (r - y) * sin, (r - y) * cos - (c - x) * sin) for c, r in cell]
            if max(min(u for u, _ in own) - long, -long - max(u for u, _ in own), min(v for _, v in own) - wide, -wide - max(v for _, v in own)) <= 0:
                return 0.0
        # A corner of one is nearest.
        beyond = lambda value, low, high: max(low - value, 0, value - high)
        of_body = min(math.hypot(beyond(u, col, col + 1), beyond(v, row, row + 1)) for u, v in corners)
        of_cell = (((c - x) * cos + (r - y) * sin, (r - y) * cos - (c - x) * sin) for c, r in cell)
        return min(of_body, *(math.hypot(beyond(u, -long, long), beyond(v, -wide, wide)) for u, v in of_cell))


class Planner:
    """A planner by what it says of itself, and how it is asked."""

    def __init__(self, descriptor, digest):
        self.id = descriptor["id"]
        can, features = descriptor["capabilities"], descriptor.get("features") or []
        self.digest = digest
        self.asked = [("grid", ["--path-rule", "bresenham"] if "any-angle" in can else [])] if "grid" in can else []
        known = [name for feature, name, _ in MODELS if feature in features] if "continuous" in can else []
        # A body that sets out in any direction is for those alone that know no wheels.
        self.asked += [(name, ["--representation", "continuous"]) for name in known if name != "single" or known == ["single"]]
        self.options = []
        if "anytime" in can:
            if "anytime" in (descriptor.get("options_schema") or {}).get("properties", {}):
                self.options = ["--option", "anytime=false"]
            else:
                self.asked = [(model, how) for model, how in self.asked if model != "grid"]


class Experiment:
    def __init__(self, arguments):
        self.path = os.environ.get("FLEETYARD")
        if not self.path:
            sys.exit("error: there is no command\nhint: `scripts/maze-paper drive` builds it, or FLEETYARD names it")
        self.folder = arguments.out.resolve()
        self.budget = arguments.budget
        (self.folder / "mazes").mkdir(parents=True, exist_ok=True)
        mazes = [(size, FIRST_SEED + seed) for size in arguments.sizes for seed in range(arguments.seeds)]
        self.model = None
        if arguments.only:
            *maze, planner, self.model = arguments.only
            mazes, arguments.planner = [maze], [planner]
        self.planners = self.installed(arguments.planner)
        self.mazes = [Maze(*maze, self.folder / "mazes", self.must) for maze in mazes]
        self.driven = {}

    def ended(self, *arguments):
        """The answer of a command that may fail, and the last error."""
        done = subprocess.run([self.path, *map(str, arguments), "--format", "json"], capture_output=True, text=True, check=False)
        errors = [line.removeprefix("error: ") for line in done.stderr.splitlines() if line.startswith("error: ")]
        return (json.loads(done.stdout) if done.stdout else None), errors[-1] if errors else None

    def must(self, *arguments):
        done = subprocess.run([self.path, *map(str, arguments)], capture_output=True, text=True, check=False)
        if done.returncode:
            sys.exit(f"error: fleetyard {' '.join(map(str, arguments))}:\n{done.stderr}")
        return done.stdout

    def installed(self, named):
        files = json.loads(self.must("plugins", "list", "--format", "json"))
        found = [Planner(plugin, file["digest"]) for file in files for plugin in file["plugins"] if plugin["kind"] == "planner" and plugin["shadowed_by"] is None]
        unknown = set(named or []) - {planner.id for planner in found}
        if unknown:
            print(f"error: there is no planner {', '.join(sorted(unknown))}\nhint: `fleetyard plugins list` shows what there is", file=sys.stderr)
            sys.exit(2)
        # `empty` moves nobody.
        return [planner for planner in found if (planner.id in named if named else planner.id != "empty")]

    def run(self):
        rows = []
        trials = [(planner, model, how, maze) for planner in self.planners for model, how in planner.asked for maze in self.mazes
                  if self.model in (None, model)]
        for number, (planner, model, how, maze) in enumerate(trials, 1):
            if sys.stderr.isatty():
                print(f"\r{number} of {len(trials)}", end="", file=sys.stderr, flush=True)
            row = self.done(planner, model, how, maze)
            # A planner that does not take one robot, or its model, is none of the experiment's.
            if row["termination"] != "unsupported":
                rows.append(row)
        return rows

    def done(self, planner, model, how, maze):
        """The row of a trial, from its file if it was made of the same."""
        made_of = hashlib.sha256(pathlib.Path(__file__).read_bytes())
        made_of.update(maze.map.read_bytes() + json.dumps([planner.digest, planner.options, how, self.budget]).encode())
        file = self.folder / "trials" / f"{maze.map.stem}-{planner.id}-{model}.json"
        if file.exists():
            known = json.loads(file.read_text(encoding="utf-8"))
            if known["made_of"] == made_of.hexdigest():
                return known["row"]
        row = dict.fromkeys(COLUMNS, "") | {"cells": maze.cells, "seed": maze.seed, "planner": planner.id, "model": model, "solved": 0, "build": planner.digest}
        row.update(self.trial(planner, model, how, maze))
        replace(file, json.dumps({"made_of": made_of.hexdigest(), "row": row}, indent=1) + "\n")
        return row

    def trial(self, planner, model, how, maze):
        plan = self.folder / "plan.json"
        plan.unlink(missing_ok=True)
        on = ["--map", maze.map, "--scen", maze.scenario, "--agents", 1] if model == "grid" else ["--task", maze.tasks[model]]
        record, error = self.ended("run", *on, "--planner", planner.id, *planner.options, *how, "--budget", self.budget, "--plan-out", plan)
        error = (error or "").replace(f"{self.folder}/", "")
        if record is None:
            # A planner that the host does not ask such a question is one that does not support it.
            return {"termination": "unsupported", "failure": error}
        claimed, took = record["claimed_metrics"], record["metrics"]
        found = {"termination": record["termination"], "failure": record["message"] or error, "first_ms": rounded(took["first_solution_ms"]),
                 "cpu_ms": rounded((record["measurement"]["plan"] or {}).get("cpu_ms")), "searched": claimed.get("expansions", claimed.get("nodes", ""))}
        if not plan.exists() or not record["verdict"]["valid"]:
            return found
        written = json.loads(plan.read_text(encoding="utf-8"))
        knots = knots_of(written, maze)
        found |= {"solved": 1, "length_m": rounded(took["length_m"]), "controls": int("controls" in written),
                  "plan_margin_m": rounded(min(maze.margin(*pose) for pose in between(knots)))}
        if model != "grid":
            found["plan_s"] = rounded(took["makespan_s"])
        corners = waypoints(knots)
        found["waypoints"] = len(corners)
        for driver in DRIVERS:
            found |= {f"{driver}_{name}": value for name, value in self.drive(corners, driver, maze).items()}
        return found

    def drive(self, corners, driver, maze):
        """Figures of a driver along waypoints, as they were the last time."""
        key = (maze.map.stem, driver, tuple(corners))
        if key not in self.driven:
            self.driven[key] = self.simulated(corners, driver, maze)
        return self.driven[key]

    def simulated(self, corners, driver, maze):
        way, trace, states = (self.folder / name for name in ("way.json", "way.fyt", "way.csv"))
        replace(way, json.dumps({"format": "fleetyard.trajectories/1", "paths": [headed(corners)]}))
        done, error = self.ended("simulate", "--task", maze.tasks[driver], way, "--policy", "adg", "--trace", trace)
        if done is None:
            sys.exit(f"error: {maze.map.stem} by {driver}: {error}")
        self.must("trace", "export", trace, "--csv", states, "--every", 6)
        with states.open(encoding="utf-8") as file:
            poses = [tuple(float(row[name]) for name in ("x_m", "y_m", "heading_rad")) for row in csv.DictReader(file)]
        return {"arrived": done["arrived"], "time_s": rounded(done["makespan_s"]), "way_m": rounded(sum(map(apart, poses, poses[1:]))),
                "off_max_m": rounded(done["tracking_error_max_m"]),
                "contacts": done["contacts"], "margin_m": rounded(min(maze.margin(*pose) for pose in poses))}


def rounded(value):
    return "" if value is None else round(value, 4)


def apart(one, other):
    return math.hypot(other[0] - one[0], other[1] - one[1])


def knots_of(plan, maze):
    """Time and pose of a plan's knots; along the grid from centre to centre, headings along the way."""
    path = plan["paths"][0]
    if "format" in plan and len(path[0]) == 4:
        return [tuple(knot) for knot in path]
    if "format" in plan and len(path[0]) == 3:
        return headed([tuple(knot) for knot in path])
    side = 2 * maze.cells + 1
    return headed([(float(step), col + 0.5, side - 1 - row + 0.5) for step, (row, col) in enumerate(path)])


def headed(corners):
    """Waypoints with headings: that of the task at first, then along the way."""
    knots, heading = [], 0.0
    for number, (time, x, y) in enumerate(corners):
        if number and number + 1 < len(corners):
            course = math.atan2(corners[number + 1][2] - y, corners[number + 1][1] - x)
            heading += (course - heading + math.pi) % (2 * math.pi) - math.pi
        knots.append((time, x, y, heading))
    return knots


def between(knots):
    """Poses along the knots, at most a decimetre or a tenth of a radian apart."""
    for (_, *before), (_, *after) in zip(knots, knots[1:]):
        parts = max(1, math.ceil(max(apart(before, after), abs(after[2] - before[2])) / 0.1))
        for part in range(parts + 1):
            yield tuple(a + (b - a) * part / parts for a, b in zip(before, after))


def waypoints(knots):
    """The places of knots without those that lie within a bound of the lines between others (Douglas, Peucker, 1973)."""
    places = [knot[:3] for knot in knots]
    places = [place for number, place in enumerate(places) if not number or place[1:] != places[number - 1][1:]]
    kept, parts = {0, len(places) - 1}, [(0, len(places) - 1)]
    while parts:
        first, last = parts.pop()
        (_, ax, ay), (_, bx, by) = places[first], places[last]
        length = math.hypot(bx - ax, by - ay)
        farthest, found = BESIDE_M, None
        for number in range(first + 1, last):
            _, x, y = places[number]
            along = ((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / length**2 if length else 0.0
            along = min(max(along, 0.0), 1.0)
            beside = math.hypot(x - ax - along * (bx - ax), y - ay - along * (by - ay))
            if beside > farthest:
                farthest, found = beside, number
        if found is not None:
            kept.add(found)
            parts += [(first, found), (found, last)]
    return [places[number] for number in sorted(kept)]


def print_tables(rows):
    """Tables for the page: planners with equal figures on one line."""
    groups = {}
    for row in rows:
        groups.setdefault((row["planner"], row["model"]), []).append(row)
    mean = lambda values, digits: f"{statistics.fmean(values):.{digits}f}" if values else "–"
    lines = {}
    for (planner, model), own in groups.items():
        solved = [row for row in own if row["solved"]]
        cells = [model, f"{len(solved)}/{len(own)}", mean([row["length_m"] for row in solved], 1),
                 mean([row["plan_s"] for row in solved if row["controls"]], 0), mean([row["plan_margin_m"] for row in solved], 3)]
        for driver in DRIVERS:
            kept = [row for row in solved if row[f"{driver}_arrived"]]
            touched = sum(row[f"{driver}_contacts"] > 0 for row in solved)
            cells += [mean([row[f"{driver}_time_s"] for row in kept], 0), str(touched)]
        lines.setdefault(tuple(cells), []).append((planner, mean([row["first_ms"] for row in solved], 1)))
    heads = ["planner", "model", "solved", "length, m", "by controls, s", "margin, m"]
    heads += [f"{driver}{what}" for driver in DRIVERS for what in (", s", ": touching")]
    print(f"| {' | '.join([heads[0], 'first plan, ms', *heads[1:]])} |\n| --- | {' | '.join(['---:'] * len(heads))} |")
    for cells, planners in lines.items():
        names = ", ".join(f"`{planner}`" for planner, _ in planners)
        times = sorted((float(time) for _, time in planners if time != "–"))
        spread = "–" if not times else f"{times[0]:g}" if times[0] == times[-1] else f"{times[0]:g}–{times[-1]:g}"
        print(f"| {' | '.join([names, spread, *cells])} |")


if __name__ == "__main__":
    try:
        main()
    except KeyboardInterrupt:
        sys.exit("interrupted; the same command goes on where it was")
