#!/usr/bin/env python3
"""Planners for roadmaps, for discs in the plane and for robots with dynamics beside other programs, as ratios.

    scripts/beside_continuous.py roadmap     --rows FILE [--only GLOB] [TABLE ...]
    scripts/beside_continuous.py discs       --rows FILE [--only GLOB] [TABLE ...]
    scripts/beside_continuous.py kinodynamic --rows FILE [--only GLOB] [TABLE ...]

Problems are those of $FLEETYARD_DATA/continuous, and teams of 1,000 discs that are drawn
here from a seed. Continuous-CBS, PSIPP/CTC and db-CBS run through their adapters ($CCBS, $PSIPP
and $DB_CBS name the programs); the programs take turns on each problem, under the same budget, and the
judge checks every plan in the task's world. Programs that cannot be run here (SI-CPP has no
licence; OMPL) stand with the figures of $FLEETYARD_DATA/peers/continuous.csv, which were
measured apart: such tables say `not paired`.

CPU is that of the planner's processes, from the start of the map's preparation to the end of
the call. A series over team sizes ends with the first size that a planner does not solve.
Every finished run is a line of the file of rows: a run that was cut off goes on where it was.
Tables are Markdown, losses first.
"""

import argparse
import csv
import fnmatch
import json
import math
import os
import pathlib
import random
import statistics
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
TEAMS = [5, 10, 15, 20, 25, 30, 40, 50, 60]
PEERS = {name: ROOT / "plugins/adapters" / folder for name, folder in [("CCBS", "ccbs"), ("PSIPP/CTC", "psipp"), ("db-CBS", "db-cbs")]}
WORLDS = ["empty-32", "boxes-32", "rooms-32", "aisles-32"]


class Problem:
    """A task in a world, with a roadmap or without: a team is its first agents. `terms` are further members of the task."""

    def __init__(self, name, world, robot, agents, roadmap=None, terms=None):
        self.name, self.world, self.robot, self.agents, self.roadmap = name, world, robot, agents, roadmap
        self.terms = terms or {}

    def arguments(self, team, folder):
        """Of the command; files it needs are written to the folder."""
        path = folder / f"{self.name}-{team}.task.json"
        if not path.exists():
            world, roadmap = self.world, self.roadmap
            if isinstance(world, dict):
                (folder / f"{self.name}.world.json").write_text(json.dumps(world))
                world = f"{self.name}.world.json"
            task = {"format": "fleetyard.task/1", "name": path.stem, "world": str(world)}
            task |= {"robots": {"robot": self.robot}, "agents": self.agents[:team], **self.terms}
            path.write_text(json.dumps(task))
            if isinstance(roadmap, dict):
                (folder / f"{self.name}.roadmap.json").write_text(json.dumps(roadmap))
        if self.roadmap is None:
            return ["--task", path, "--representation", "continuous"]
        roadmap = self.roadmap
        if isinstance(roadmap, dict):
            roadmap = folder / f"{self.name}.roadmap.json"
        return ["--task", path, "--roadmap", roadmap]


def disc(radius, speed=1.0):
    """A disc that sets out and stops in no time: metres, and metres per second."""
    return {"footprint": {"disc": {"radius_m": radius}}, "model": {"single-integrator": {"speed_m_per_s": speed}}}


def on_roadmap(data, name):
    """A problem of `roadmap-tasks`."""
    path = data / "roadmap-tasks" / f"{name}.tasks.json"
    tasks = json.loads(path.read_text())
    roadmap = (path.parent / tasks["roadmap"]).resolve()
    places = json.loads(roadmap.read_text())["vertices"]
    ends = zip(tasks["starts"], tasks["goals"])
    agents = [{"start": places[start], "goal": places[goal]} for start, goal in ends]
    world = data / "worlds" / ("-".join(name.split("-")[:2]) + ".world.json")
    # A few edges of superdense roadmaps are micrometres too near to obstacles.
    radius = tasks["radius_m"] - (1e-5 if family(name) == "superdense" else 0)
    return Problem(name, world, disc(radius, tasks["speed_m_per_s"]), agents, roadmap)


def on_grid(data, name):
    """A problem of `grids` as a roadmap: cells of a metre with their eight neighbours."""
    lines = (data / "grids" / f"{name.rsplit('-', 1)[0]}.map").read_text().split("map\n", 1)[1].split()
    height, width = len(lines), len(lines[0])
    place = lambda row, column: [column + 0.5, height - row - 0.5]
    free = {(row, column) for row in range(height) for column in range(width) if lines[row][column] == "."}
    numbers = {cell: number for number, cell in enumerate(sorted(free))}
    edges = []
    for row, column in sorted(free):
        # A diagonal leads past the corners of the two cells beside it.
        for down, right in [(0, 1), (1, 0), (1, 1), (1, -1)]:
            cells = {(row, column + right), (row + down, column), (row + down, column + right)}
            if cells <= free:
                edges.append([numbers[row, column], numbers[row + down, column + right]])
    blocked = []
    for row in range(height):
        for column in range(width):
            if (row, column) not in free:
                x, y = place(row, column)
                corners = [[x - 0.5, y - 0.5], [x + 0.5, y - 0.5], [x + 0.5, y + 0.5], [x - 0.5, y + 0.5]]
                blocked.append({"polygon": corners})
    world = {"format": "fleetyard.world/1", "bounds_m": [0, 0, width, height], "obstacles": blocked}
    vertices = [place(*cell) for cell in sorted(free)]
    roadmap = {"format": "fleetyard.roadmap/1", "directed": False, "vertices": vertices, "edges": edges}
    agents = []
    for line in (data / "grids" / f"{name}.scen").read_text().splitlines()[1:]:
        column, row, goal_column, goal_row = map(int, line.split("\t")[4:8])
        agents.append({"start": place(row, column), "goal": place(goal_row, goal_column)})
    return Problem(f"{name} 2^3".replace(" ", "-"), world, disc(math.sqrt(2) / 4), agents, roadmap)


def crowd(data, name, radius, team, seed):
    """Many small discs on a superdense roadmap: starts, and goals, 2.05 radii apart."""
    roadmap = data / "roadmaps" / f"{name}-superdense.roadmap.json"
    places = json.loads(roadmap.read_text())["vertices"]
    source = random.Random(seed)

    def drawn():
        chosen, bins, side = [], {}, 2.05 * radius
        for vertex in source.sample(range(len(places)), len(places)):
            x, y = places[vertex]
            at = (int(x / side), int(y / side))
            near = [bins.get((at[0] + i, at[1] + j), []) for i in (-1, 0, 1) for j in (-1, 0, 1)]
            if all(math.dist(places[other], (x, y)) >= side for each in near for other in each):
                bins.setdefault(at, []).append(vertex)
                chosen.append(vertex)
        return chosen[:team]

    ends = zip(drawn(), drawn())
    agents = [{"start": places[start], "goal": places[goal]} for start, goal in ends]
    return Problem(f"{name}-crowd-{seed}", data / "worlds" / f"{name}.world.json", disc(radius), agents, roadmap)


def in_plane(data, name):
    """A problem of `plane-tasks`."""
    path = data / "plane-tasks" / f"{name}.tasks.json"
    tasks = json.loads(path.read_text())
    first = tasks["robots"][0]
    robot = disc(first["footprint"]["disc"]["radius_m"], first["speed_m_per_s"])
    agents = [{"start": each["start"], "goal": each["goal"]} for each in tasks["robots"]]
    return Problem(name, (path.parent / tasks["world"]).resolve(), robot, agents)


# db-CBS may miss goals by so much, and its steps of Euler lead so far beside its own states.
NEAR = {"goal_tolerance_m": 0.01, "goal_tolerance_rad": 0.02, "goal_tolerance_rate": 0.01, "dynamics_tolerance": 0.06}
# OMPL's trees ended within 0.2, metres and radians as a vector.
WITHIN = {"goal_tolerance_m": 0.14, "goal_tolerance_rad": 0.14}

# Robots that take the places of unicycles: presets, or the robot itself. One without a heading goes from place to place.
MODELS = {
    "unicycle-1": "dynobench-unicycle-1",
    "unicycle-2": "dynobench-unicycle-2",
    "double-integrator": {"footprint": {"disc": {"radius_m": 0.15}}, "model": "dynobench-double-integrator"},
    "holonomic": {"footprint": {"rectangle": {"length_m": 0.5, "width_m": 0.25}}, "model": "holonomic"},
    "car": "dynobench-car",
    # Its trailer begins in line and may end at any angle.
    "car-trailer": "dynobench-car-trailer",
}


def in_states(data, name, model="unicycle-1", terms=None):
    """A problem of unicycles of `plane-tasks`, for robots of a model."""
    path = data / "plane-tasks" / f"{name}.tasks.json"
    tasks = json.loads(path.read_text())
    numbers = 2 if model == "double-integrator" else 3
    agents = [{"start": each["start"][:numbers], "goal": each["goal"][:numbers]} for each in tasks["robots"]]
    own = name if model == "unicycle-1" else f"{name}-{model}"
    return Problem(own, (path.parent / tasks["world"]).resolve(), MODELS[model], agents, terms=terms or NEAR)


def crowd_of_unicycles(seed, team=50, side=16.0):
    """Unicycles on a floor with boxes, drawn from a seed: starts, and goals, a metre apart and clear of boxes."""
    source = random.Random(seed)
    place = lambda: (source.uniform(0.6, side - 0.6), source.uniform(0.6, side - 0.6))
    boxes = []
    while len(boxes) < 12:
        x, y = place()
        width, height = source.uniform(0.4, 1.6), source.uniform(0.4, 1.6)
        boxes.append((x - width / 2, y - height / 2, x + width / 2, y + height / 2))
    free = lambda x, y: all(not (left - 0.45 < x < right + 0.45 and low - 0.45 < y < high + 0.45) for left, low, right, high in boxes)

    def drawn():
        chosen = []
        while len(chosen) < team:
            at = place()
            if free(*at) and all(math.dist(at, other) >= 1.0 for other in chosen):
                chosen.append(at)
        return [[*at, source.uniform(-math.pi, math.pi)] for at in chosen]

    corners = [[[left, low], [right, low], [right, high], [left, high]] for left, low, right, high in boxes]
    world = {"format": "fleetyard.world/1", "bounds_m": [0, 0, side, side], "obstacles": [{"polygon": each} for each in corners]}
    agents = [{"start": start, "goal": goal} for start, goal in zip(drawn(), drawn())]
    return Problem(f"unicycle-crowd-{team}-{seed}", world, MODELS["unicycle-1"], agents, terms=NEAR)


class Bench:
    """Runs, and the rows that are known."""

    def __init__(self, arguments):
        self.arguments, self.rows = arguments, {}
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="beside-"))
        if arguments.rows.exists():
            for line in arguments.rows.read_text().splitlines():
                row = json.loads(line)
                self.rows[row["planner"], row["problem"], row["team"], row["repeat"]] = row

    def run(self, planner, problem, team, repeat=1, seconds=None):
        """The row of one run; the budget is that of the command unless it is given. Options follow a planner's name."""
        key = (planner, problem.name, team, repeat)
        if key not in self.rows:
            self.rows[key] = row = self.measured(planner, problem, team, repeat, seconds or self.arguments.seconds)
            with self.arguments.rows.open("a") as file:
                file.write(json.dumps(row) + "\n")
            cost = "-" if row["cost"] is None else f"{row['cost']:.4f}"
            print(f"{planner} {problem.name} N={team}: {row['claim']}, cost {cost}, {row['cpu_s']:.3f} s", file=sys.stderr)
        return self.rows[key]

    def measured(self, planner, problem, team, repeat, seconds):
        command = [self.arguments.fleetyard, "run", *problem.arguments(team, self.folder)]
        name, *options = planner.split(" ")
        command += ["--planner", PEERS.get(name, name), *options, "--budget", f"{seconds}s", "--format", "json", "--seed", str(repeat)]
        if name == "db-CBS":
            # It looks for primitives and models beside itself.
            command += ["--allow-read", pathlib.Path(os.environ.get("DB_CBS", ".")).resolve().parent]
        done = subprocess.run([str(word) for word in command], capture_output=True, text=True, check=False,
                              start_new_session=True)
        row = {"planner": planner, "problem": problem.name, "team": team, "repeat": repeat}
        try:
            record = json.loads(done.stdout)
        except json.JSONDecodeError:
            sys.exit(f"{' '.join(map(str, command))}\n{done.stderr.strip()}")
        phases = [record["measurement"][phase] for phase in ("prepare", "plan")]
        cpu = sum(phase["cpu_ms"] for phase in phases if phase and phase["cpu_ms"]) / 1000
        valid = record["verdict"]["valid"] if record["verdict"] else None
        first = record["metrics"]["first_solution_ms"]
        row.update(
            claim=record["claim"] or record["termination"], valid=valid, cpu_s=cpu,
            first_s=None if first is None else first / 1000,
            memory_mb=record["resources"]["peak_memory_kb"] / 1024,
            cost=record["metrics"]["soc_s"] if valid else None,
            metrics=record["claimed_metrics"], message=record["message"],
            disagreements=[claim for claim in record["claims"] if not claim["agrees"]],
        )
        return row

    def series(self, planners, problem, teams):
        """Rows by team of planners that take turns, each until it first fails."""
        left, rows = list(planners), {}
        for team in teams:
            for planner in list(left):
                best = [self.run(planner, problem, team, repeat) for repeat in range(1, self.arguments.repeats + 1)]
                rows[planner, team] = middle(best)
                if not solved(rows[planner, team]):
                    left.remove(planner)
        return rows


def middle(rows):
    """One row for repeated runs: the one with the median CPU."""
    return sorted(rows, key=lambda row: row["cpu_s"])[len(rows) // 2]


def solved(row):
    return bool(row and row["valid"] and row["claim"] in ("solved", "optimal", "improved", "timed-out"))


def table(title, heads, lines, worst=None):
    """Prints a table, sorted by the number in column `worst`, the largest first."""
    print(f"\n### {title}\n")
    if worst is not None:
        lines = sorted(lines, key=lambda line: -(line[worst] if isinstance(line[worst], float) else -1.0))
    print("| " + " | ".join(heads) + " |")
    print("|" + " --- |" * len(heads))
    for line in lines:
        cells = (f"{cell:.3g}" if isinstance(cell, float) else str(cell) for cell in line)
        print("| " + " | ".join(cells) + " |")
    sys.stdout.flush()


def median(numbers):
    numbers = list(numbers)
    return float(statistics.median(numbers)) if numbers else "-"


def tally(rows):
    """So many of so many."""
    rows = list(rows)
    return f"{sum(map(solved, rows))}/{len(rows)}"


def family(name):
    return next((kind for kind in ("superdense", "sparse", "dense", "2^3") if kind in name), name.rsplit("-", 1)[0])


def wanted(arguments, names):
    return [name for name in names if fnmatch.fnmatch(name, arguments.only)]


def ccbs(bench, data):
    """`ccbs` beside Continuous-CBS, and `eccbs`."""
    names = [f"{world}-{kind}-{number}" for kind in ("sparse", "dense") for world in WORLDS for number in (1, 2, 3)]
    problems = [on_roadmap(data, name) for name in wanted(bench.arguments, names)]
    grids = [f"{name}-{number}" for name in ("open-16", "blocks-32", "rooms-33") for number in (1, 2, 3)]
    problems += [on_grid(data, name) for name in wanted(bench.arguments, grids)]
    both, lines, finds, larger = ("CCBS", "ccbs"), [], [], []
    results = {problem.name: bench.series(both, problem, TEAMS) for problem in problems}
    for kind in ("sparse", "dense", "2^3"):
        of_kind = [rows for name, rows in results.items() if family(name) == kind]
        for team in TEAMS:
            pairs = [[rows.get((planner, team)) for planner in both] for rows in of_kind]
            asked = [pair for pair in pairs if pair[0] or pair[1]]
            if not asked:
                continue
            equal = [pair for pair in asked if solved(pair[0]) and solved(pair[1])]
            ratio = median(ours["cpu_s"] / theirs["cpu_s"] for theirs, ours in equal)
            costs = median(ours["cost"] / theirs["cost"] for theirs, ours in equal)
            memory = max((pair[1]["memory_mb"] for pair in asked if pair[1]), default="-")
            counts = [f"{sum(solved(pair[at]) for pair in pairs)}/{len(pairs)}" for at in (1, 0)]
            lines.append([kind, team, *counts, ratio, costs, memory])
    table("`ccbs` beside Continuous-CBS", ["family", "N", "solved", "CCBS", "CPU ratio", "cost ratio", "most MB"], lines, 4)
    for name, rows in sorted(results.items()):
        theirs = max((team for (planner, team), row in rows.items() if planner == both[0] and solved(row)), default=0)
        ours = max((team for (planner, team), row in rows.items() if planner == both[1] and solved(row)), default=0)
        larger.append([name, theirs, ours, float(theirs - ours)])
        for team in TEAMS:
            peer, own = rows.get((both[0], team)), rows.get((both[1], team))
            if solved(peer) and solved(own) and abs(peer["cost"] - own["cost"]) > 1e-4 * own["cost"]:
                finds.append([name, team, f"{peer['cost']:.4f}", f"{own['cost']:.4f}", own["cost"] / peer["cost"]])
    table("Largest team solved", ["problem", "CCBS", "`ccbs`", "difference"], larger, 3)
    table("Plans of other cost than CCBS's", ["problem", "N", "CCBS", "`ccbs`", "ratio"], finds, 4)


def eccbs(bench, data):
    """`eccbs` on the larger teams."""
    lines = []
    for kind in ("sparse", "dense"):
        names = [f"{world}-{kind}-{number}" for world in WORLDS for number in (1, 2, 3)]
        problems = [on_roadmap(data, name) for name in wanted(bench.arguments, names)]
        for team in (20, 40, 60):
            rows = [bench.run("eccbs", problem, team) for problem in problems]
            done = [row for row in rows if solved(row)]
            lines.append([kind, team, tally(rows), median(row["cpu_s"] for row in done),
                          max((row["memory_mb"] for row in rows), default="-")])
    table("`eccbs`", ["family", "N", "solved", "CPU s", "most MB"], lines)


def ctc(bench, data):
    """`ctc` beside PSIPP/CTC."""
    lines = []
    for kind, numbers, teams in (("sparse", (1, 2, 3), (10, 20, 40, 60)), ("dense", (1, 2, 3), (10, 20, 40, 60)), ("superdense", (1,), (60,))):
        # The other program annotates a superdense roadmap for some twenty seconds.
        seconds = 60 if kind == "superdense" else None
        for world in WORLDS:
            names = [f"{world}-{kind}-{number}" for number in numbers]
            problems = [on_roadmap(data, name) for name in wanted(bench.arguments, names)]
            for team in teams:
                pairs = [[bench.run(planner, problem, team, seconds=seconds) for planner in ("PSIPP/CTC", "ctc")]
                         for problem in problems]
                if pairs:
                    lines.append([kind, world, team, *beside(pairs), *memory(pairs)])
    heads = ["family", "world", "N", "solved", "PSIPP", "CPU s", "CPU ratio", "cost ratio", "MB ratio"]
    table("`ctc` beside PSIPP/CTC", heads, lines, 6)


def beside(pairs):
    """Solved by both, our CPU, and ratios of CPU and cost: of pairs (theirs, ours)."""
    equal = [pair for pair in pairs if solved(pair[0]) and solved(pair[1])]
    counts = [tally(pair[at] for pair in pairs) for at in (1, 0)]
    return [*counts, median(ours["cpu_s"] for _, ours in pairs), median(ours["cpu_s"] / theirs["cpu_s"] for theirs, ours in equal),
            median(ours["cost"] / theirs["cost"] for theirs, ours in equal)]


def memory(pairs):
    return [median(ours["memory_mb"] / theirs["memory_mb"] for theirs, ours in pairs)]


def crowds(bench, data):
    """A thousand discs on four thousand vertices."""
    lines = []
    for world in WORLDS:
        for seed in (1,):
            problem = crowd(data, world, 0.1, 1000, seed)
            for planner in ("roadmap-lns", "roadmap-lacam"):
                for name in wanted(bench.arguments, [problem.name]):
                    row = bench.run(planner, problem, 1000)
                    first = row["metrics"].get("first_cost_s")
                    lines.append([name, planner, "yes" if solved(row) else row["claim"], row["first_s"] or "-",
                                  row["cost"] / first if first and row["cost"] else "-", row["cost"] or "-", row["memory_mb"]])
    heads = ["problem", "planner", "solved", "first plan s", "cost against first", "cost s", "MB"]
    table("1,000 discs (r = 0.1 m) on 4,000 vertices", heads, lines, 3)


def figures(data):
    """Rows of other programs' figures, by solver, problem and team."""
    with (data.parent / "peers/continuous.csv").open() as file:
        rows = [row for row in csv.DictReader(file) if row["success"] == "1"]
    known = {}
    for row in rows:
        known.setdefault((row["solver"], row["problem"], int(row["N"])), []).append(row)
    return known


def tangent(bench, data):
    """`tangent` beside OMPL's figures."""
    peers, lines = figures(data), []
    for name in wanted(bench.arguments, ["one-trap", "one-slalom", "one-clutter", "one-clutter-large"]):
        row = bench.run("tangent", in_plane(data, name), 1)
        others = [(float(each["cost"]), solver) for (solver, problem, _), each_of in peers.items()
                  for each in each_of if problem == name and solver.startswith("OMPL")]
        length, solver = min(others)
        lines.append([name, f"{row['cost']:.4f}" if row["cost"] else "-", row["cpu_s"] * 1000, f"{length:.4f}", solver,
                      row["cost"] / length if row["cost"] else "-"])
    heads = ["problem", "length m", "CPU ms", "best of OMPL in 2 s", "by", "length ratio"]
    table("`tangent` beside OMPL (not paired)", heads, lines, 5)


def teams(planner):
    """A planner of teams in the plane beside SI-CPP's figures."""

    def asked(bench, data):
        peers, lines = figures(data), []
        for world in ("empty-10", "polygons-10", "rooms-16"):
            names = wanted(bench.arguments, [f"{world}-{number}" for number in (1, 2, 3)])
            problems = [in_plane(data, name) for name in names]
            for team in (10, 20, 30, 40, 50):
                rows = [bench.run(planner, problem, team) for problem in problems]
                known = [peers.get(("SI-CPP", problem.name, team), [None])[0] for problem in problems]
                pairs = [(row, peer) for row, peer in zip(rows, known) if peer and solved(row)]
                lines.append([world, team, tally(rows), f"{sum(map(bool, known))}/{len(known)}" if any(known) else "-",
                              median(row["first_s"] for row in rows if solved(row)), median(row["first_s"] / float(peer["cpu_s"]) for row, peer in pairs),
                              median(row["cost"] / float(peer["cost"]) for row, peer in pairs)])
        heads = ["world", "N", "solved", "SI-CPP", "first plan s", "time ratio", "cost ratio in the end"]
        table(f"`{planner}` beside SI-CPP (not paired)", heads, lines, 5)

    asked.__doc__ = f"`{planner}` beside SI-CPP's figures."
    return asked


# Planners over motion primitives.
DB_ASTAR, DB_CBS, DB_LACAM = "db-astar", "db-cbs", "db-lacam"


def unicycles(kind, teams):
    return [f"unicycle-{kind}-{team}-{number}" for team in teams for number in (1, 2, 3)]


def db_cbs(bench, data):
    """`db-astar` and `db-cbs` beside db-CBS."""
    lines = []
    for kind, team in [("random", 1), ("swap", 2), ("random", 2), ("swap", 4), ("random", 4), ("swap", 8), ("random", 8)]:
        ours = DB_ASTAR if team == 1 else DB_CBS
        problems = [in_states(data, name) for name in wanted(bench.arguments, unicycles(kind, [team]))]
        pairs = [[bench.run(planner, problem, team, seconds=30) for planner in ("db-CBS", ours)] for problem in problems]
        if pairs:
            lines.append([kind, team, ours, *beside(pairs), *memory(pairs)])
    heads = ["family", "N", "planner", "solved", "db-CBS", "CPU s", "CPU ratio", "cost ratio", "MB ratio"]
    table("`db-astar`, `db-cbs` beside db-CBS", heads, lines, 6)


def models(bench, data):
    """`db-cbs` with robots of other models."""
    lines = []
    for model in MODELS:
        for team in (1, 2, 4, 8):
            problems = [in_states(data, name, model) for name in wanted(bench.arguments, unicycles("random", [team]))]
            rows = [bench.run(DB_ASTAR if team == 1 else DB_CBS, problem, team, seconds=30) for problem in problems]
            done = [row for row in rows if solved(row)]
            if rows:
                lines.append([model, team, tally(rows), median(row["cpu_s"] for row in done), median(row["cost"] for row in done),
                              max(row["memory_mb"] for row in rows)])
    table("`db-cbs` by model", ["model", "N", "solved", "CPU s", "cost s", "most MB"], lines, 3)


def db_lacam(bench, _):
    """`db-lacam` with fifty unicycles."""
    lines = []
    for seed in (1, 2, 3, 4, 5):
        problem = crowd_of_unicycles(seed)
        for name in wanted(bench.arguments, [problem.name]):
            row = bench.run(DB_LACAM, problem, 50, seconds=30)
            lines.append([name, "yes" if solved(row) else row["claim"], row["first_s"] or "-", row["cpu_s"], row["cost"] or "-", row["memory_mb"]])
    table("`db-lacam`, 50 unicycles on 16 x 16 m", ["problem", "solved", "first plan s", "CPU s", "cost s", "MB"], lines, 2)


def others(bench, data):
    """`k-cbs`, with one search as in the paper, and `cbs-rrt` with unicycles."""
    lines = []
    for planner in ("k-cbs rounds=1", "cbs-rrt"):
        for kind, team in [("swap", 2), ("random", 2), ("swap", 4), ("random", 4), ("swap", 8), ("random", 8)]:
            problems = [in_states(data, name) for name in wanted(bench.arguments, unicycles(kind, [team]))]
            rows = [bench.run(planner, problem, team, seconds=30) for problem in problems]
            done = [row for row in rows if solved(row)]
            if rows:
                lines.append([planner, kind, team, tally(rows), median(row["cpu_s"] for row in done), median(row["cost"] for row in done)])
    table("Trees under conflict-based search", ["planner", "family", "N", "solved", "CPU s", "cost s"], lines)


def sst(bench, data):
    """`sst` beside OMPL's SST."""
    peers, lines = figures(data), []
    for name in wanted(bench.arguments, unicycles("random", [1])):
        problem = in_states(data, name, terms=WITHIN)
        rows = [bench.run("sst", problem, 1, repeat, seconds=5) for repeat in (1, 2, 3)]
        known = peers.get(("OMPL SST", name, 1), [])
        done = [row["cost"] for row in rows if solved(row)]
        theirs = [float(each["cost"]) for each in known]
        rate = lambda vertices: vertices / 5
        lines.append([name, tally(rows), f"{len(known)}/3", median(done), median(theirs), median(done) / median(theirs) if done and theirs else "-",
                      rate(median(row["metrics"].get("nodes", 0) for row in rows))])
    heads = ["problem", "solved", "OMPL", "duration s", "OMPL s", "ratio", "vertices a second"]
    table("`sst` beside OMPL's SST in 5 s (not paired; goal within 0.2)", heads, lines, 5)


def rrt_star(bench, data):
    """`rrt-star` beside OMPL's RRT*."""
    peers, lines = figures(data), []
    for name in wanted(bench.arguments, ["one-trap", "one-slalom", "one-clutter", "one-clutter-large"]):
        rows = [bench.run("rrt-star", in_plane(data, name), 1, repeat, seconds=2) for repeat in (1, 2, 3)]
        done = [row for row in rows if solved(row)]
        known = peers.get(("OMPL RRT*", name, 1), [])
        theirs = median(float(each["cost"]) for each in known)
        vertices = median(float(each["notes"].rsplit(";", 1)[1].split()[0]) for each in known)
        own = median(row["metrics"].get("nodes", 0) for row in done)
        length = median(row["cost"] for row in done)
        lines.append([name, tally(rows), length, theirs, length / theirs, own / 2, own / vertices])
    heads = ["problem", "solved", "length m", "OMPL m", "length ratio", "vertices a second", "ratio of vertices"]
    table("`rrt-star` beside OMPL's RRT* in 2 s (not paired)", heads, lines, 4)


TABLES = {
    "kinodynamic": {"db-cbs": db_cbs, "models": models, "db-lacam": db_lacam, "others": others, "sst": sst, "rrt-star": rrt_star},
    "roadmap": {"ccbs": ccbs, "eccbs": eccbs, "ctc": ctc, "crowds": crowds},
    "discs": {"tangent": tangent} | {planner: teams(planner) for planner in ("si-tangent", "sssp", "cbs-mp")},
}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("side", choices=list(TABLES))
    parser.add_argument("tables", nargs="*", metavar="TABLE",
                        help="\n".join(f"{name}: {of.__doc__}" for side in TABLES.values() for name, of in side.items()))
    parser.add_argument("--rows", type=pathlib.Path, required=True, help="file of finished runs, one JSON line each")
    parser.add_argument("--fleetyard", default=ROOT / "target/release/fleetyard", help="our executable")
    parser.add_argument("--data", type=pathlib.Path, default=os.environ.get("FLEETYARD_DATA"))
    parser.add_argument("--seconds", type=int, default=10, help="budget of a run, in seconds of wall time")
    parser.add_argument("--repeats", type=int, default=1, help="runs of each series; the median by CPU counts")
    parser.add_argument("--only", default="*", help="problems whose name the pattern matches")
    arguments = parser.parse_args()
    if arguments.data is None:
        parser.error("set FLEETYARD_DATA to the folder that has continuous/ and peers/")
    known = TABLES[arguments.side]
    for name in arguments.tables:
        if name not in known:
            parser.error(f"no table `{name}` of {arguments.side}: {', '.join(known)}")
    bench, data = Bench(arguments), pathlib.Path(arguments.data).resolve() / "continuous"
    for name in arguments.tables or known:
        known[name](bench, data)
    wrong = [row for row in bench.rows.values() if row["disagreements"]]
    lines = [[row["planner"], row["problem"], row["team"], claim["what"], claim["claimed"], claim["found"]]
             for row in wrong for claim in row["disagreements"]]
    table("Claims that the judge does not confirm", ["planner", "problem", "N", "claim", "said", "found"], lines)


if __name__ == "__main__":
    main()
