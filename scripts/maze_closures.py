#!/usr/bin/env python3
"""Cells of mazes close and open again while a robot drives: planners that repair their search, and planners that begin anew.

    scripts/maze-paper closures [--sizes N,…] [--seeds N] [--planner 'ID OPTION=VALUE…']… [--only 'CELLS,SEED,ID OPTION=VALUE…']
                               [--out FOLDER] [--rows FILE]

Mazes by the recursive backtracker of each size [default: 15,63], seeds 7, 8, … [default: 3 of them], in which every fifth of
the walls that are left is opened. A robot that moves a cell a second drives to random goals for 2000 s. Of a thousand free cells
six are closed at a time, each for twice as many seconds as the maze has cells along its side. Planners are asked when a cell
closes or opens, and for every new goal; an answer takes effect after 0.2 s. By default astar, d-star-lite and lpa-star, these with and
without keep_tree.

A goal's delay is the time from the goal before, less that of the earliest arrival of a robot that knows all closures in
advance: by safe intervals (Phillips, Likhachev, ICRA 2011), with the closures that there were and moves of a second.
A run that is done is a file in FOLDER [default: target/maze-paper/closures], and is not repeated for the same planner. Rows go to
FILE [default: docs/results/maze-closures.csv], the table of the page to standard output. --only makes one row anew
and prints it. FLEETYARD names the command. Standard library only.
"""

import argparse
import csv
import hashlib
import heapq
import json
import os
import pathlib
import statistics
import subprocess
import sys

sys.dont_write_bytecode = True

from experiment import ROOT, as_csv, keep, only, replace  # noqa: E402
from maze_drive import FIRST_SEED  # noqa: E402

PLANNERS = ("astar", "d-star-lite", "d-star-lite keep_tree=true", "lpa-star", "lpa-star keep_tree=true")
# Of the walls between two cells that a maze leaves.
OPENED = 0.2
# Share of free cells that are closed at a time.
CLOSED = 0.006
LIMIT_S = 0.2
DURATION_S = 2000
COLUMNS = ["cells", "seed", "planner", "free", "goals", "closures", "calls", "replans", "waits", "expansions_first",
           "expansions_replan", "expansions_replan_max", "cpu_ms_replan", "wall_ms_replan", "goal_s", "informed_s", "late_most_s", "build"]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter, usage=argparse.SUPPRESS)
    parser.add_argument("--sizes", type=lambda text: [int(one) for one in text.split(",")], default=[15, 63])
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--planner", action="append")
    parser.add_argument("--only", type=only("CELLS", "SEED", "PLANNER"))
    parser.add_argument("--out", type=pathlib.Path, default=ROOT / "target" / "maze-paper" / "closures")
    parser.add_argument("--rows", type=pathlib.Path, default=ROOT / "docs" / "results" / "maze-closures.csv")
    arguments = parser.parse_args()
    experiment = Experiment(arguments.out.resolve())
    if arguments.only:
        print(as_csv(COLUMNS, [experiment.done(*arguments.only)]), end="")
        return
    rows = [experiment.done(size, FIRST_SEED + seed, planner) for size in arguments.sizes for seed in range(arguments.seeds)
            for planner in arguments.planner or PLANNERS]
    keep(arguments.rows, COLUMNS, rows)
    print_table(rows)


class Experiment:
    def __init__(self, folder):
        self.path = os.environ.get("FLEETYARD")
        if not self.path:
            sys.exit("error: there is no command\nhint: `scripts/maze-paper closures` builds it, or FLEETYARD names it")
        self.folder = folder
        folder.mkdir(parents=True, exist_ok=True)
        self.digests = {plugin["id"]: file["digest"] for file in json.loads(self.run("plugins", "list", "--format", "json"))
                        for plugin in file["plugins"] if plugin["kind"] == "planner"}

    def run(self, *arguments):
        done = subprocess.run([self.path, *map(str, arguments)], capture_output=True, text=True, check=False)
        if done.returncode:
            sys.exit(f"error: fleetyard {' '.join(map(str, arguments))}:\n{done.stderr}")
        return done.stdout

    def done(self, size, seed, planner):
        """The row of a run, from its file if it was made of the same."""
        made_of = hashlib.sha256(pathlib.Path(__file__).read_bytes())
        made_of.update(json.dumps([self.digests.get(planner.split()[0])]).encode())
        file = self.folder / f"{size}-{seed}-{planner.replace(' ', '-')}.json"
        if file.exists():
            known = json.loads(file.read_text(encoding="utf-8"))
            if known["made_of"] == made_of.hexdigest():
                return known["row"]
        row = self.row(size, seed, planner)
        replace(file, json.dumps({"made_of": made_of.hexdigest(), "row": row}, indent=1) + "\n")
        return row

    def row(self, size, seed, planner):
        # A tree of n² cells leaves (n − 1)² of the 2n (n − 1) walls.
        loops = round(OPENED * (size - 1) ** 2)
        name = f"maze-{size}-{seed}"
        self.run("maps", "generate", "maze", "--width", size, "--height", size, "--random", "python", "--seed", seed, "--loops", loops,
                 "--name", name, "--out", self.folder)
        letters = (self.folder / f"{name}.map").read_text(encoding="utf-8").split("map\n", 1)[1].split()
        side = len(letters)
        free = {row * side + col for row, line in enumerate(letters) for col, letter in enumerate(line) if letter != "@"}
        closed_s = 2 * size
        record, trace, journal = (self.folder / f"{name}.{end}" for end in ("record", "fyt", "csv"))
        outcome = json.loads(self.run(
            "fleet", "--map", self.folder / f"{name}.map", "--agents", 1, "--seed", seed, "--duration", f"{DURATION_S}s", "--model", "pebble",
            "--planner", *planner.split(), "--generator", "distinct-one-goal", "--invocation", "event-based", "--fail-policy", "all-wait",
            "--window", "0s", "--limit", f"{round(LIMIT_S * 1000)}ms", "--closures", f"{CLOSED * len(free) / closed_s:.6f},{closed_s}s", "--record", record,
            "--trace", trace, "--trace-every", 1, "--format", "json"))
        self.run("trace", "export", trace, "--journal", journal)
        rounds = [json.loads(line).get("round") for line in record.read_text(encoding="utf-8").splitlines()[1:]]
        legs = legs_of(journal)
        informed = [earliest(free, side, outcome["closures"], *leg) for leg in legs]
        took = [arrival - departure for _, _, departure, arrival in legs]
        return {"cells": size, "seed": seed, "planner": planner, "free": len(free), "goals": len(legs),
                "closures": len(outcome["closures"]), **calls([each for each in rounds if each]), "goal_s": rounded(mean(took)),
                "informed_s": rounded(mean(informed)), "late_most_s": rounded(max(map(lambda own, least: own - least, took, informed), default=None)),
                "build": self.digests.get(planner.split()[0], "")}


def calls(rounds):
    """Figures of calls: those for a new goal or without need, and those after cells had closed or opened."""
    asked = [each for each in rounds if each.get("planner_ms") is not None]
    again = [each for each in asked if any(notice["kind"] == "map-changed" for notice in each.get("notices", []))]
    first = [each for each in asked if each not in again]
    expansions = lambda those: [each["expansions"] for each in those if "expansions" in each]
    # Who has no plan is asked for one again and again.
    by = ["planner", *(each["by"] for each in rounds)]
    waits = sum(before == "planner" != now for before, now in zip(by, by[1:]))
    return {"calls": len(rounds), "replans": len(again), "waits": waits,
            "expansions_first": rounded(mean(expansions(first))), "expansions_replan": rounded(mean(expansions(again))),
            "expansions_replan_max": max(expansions(again), default=""),
            "cpu_ms_replan": rounded(mean([each["planner_cpu_ms"] for each in again if each.get("planner_cpu_ms") is not None])),
            "wall_ms_replan": rounded(mean([each["planner_ms"] for each in again]))}


def legs_of(journal):
    """From goal to goal: cells, and the times of departure and arrival."""
    goals, reached = {}, {}
    with journal.open(encoding="utf-8") as file:
        for row in csv.DictReader(file):
            if row["kind"] == "goal":
                goals[int(row["number"])] = int(row["cell"])
            elif row["kind"] == "reached":
                reached[int(row["number"])] = float(row["time_s"])
    return [(goals[number - 1], goals[number], reached[number - 1], time) for number, time in sorted(reached.items()) if number]


def earliest(free, side, closures, start, goal, departure, _):
    """Seconds to the earliest arrival of a robot that knows when cells close: A* over safe intervals. A move takes a second, in
    which both cells are open."""
    spans = {}
    for closure in closures:
        spans.setdefault(closure["cell"], []).append((closure["from_s"], closure["until_s"]))

    def open_spans(cell):
        begin = 0.0
        for closed, opened in sorted(spans.get(cell, [])):
            if closed > begin:
                yield begin, closed
            begin = max(begin, opened)
        yield begin, float("inf")

    apart = lambda cell: abs(cell // side - goal // side) + abs(cell % side - goal % side)
    first = next(span for span in open_spans(start) if span[0] <= departure + 1e-9 < span[1])
    queue, seen = [(departure + apart(start), departure, start, first)], set()
    while queue:
        _, time, cell, span = heapq.heappop(queue)
        if (cell, span) in seen:
            continue
        seen.add((cell, span))
        if cell == goal:
            return time - departure
        for near in (cell - side, cell + 1, cell + side, cell - 1):
            if near not in free:
                continue
            for begin, end in open_spans(near):
                leaves = max(time, begin)
                if leaves + 1 <= min(span[1], end) + 1e-9 and (near, (begin, end)) not in seen:
                    heapq.heappush(queue, (leaves + 1 + apart(near), leaves + 1, near, (begin, end)))
    return None


def mean(values):
    return statistics.fmean(values) if values else None


def rounded(value):
    return "" if value is None else round(value, 4)


def print_table(rows):
    heads = ["maze", "planner", "goals", "replans", "cut off", "expansions, new goal", "after a change", "most", "CPU ms", "goal s",
             "informed s", "late s"]
    print(f"| {' | '.join(heads)} |\n| ---: | --- | {' | '.join(['---:'] * (len(heads) - 2))} |")
    groups = {}
    for row in rows:
        groups.setdefault((row["cells"], row["planner"]), []).append(row)
    for (size, planner), own in groups.items():
        total = lambda column: sum(row[column] for row in own)
        # By the number of what they are means of.
        weighted = lambda column, by: sum((row[column] or 0) * row[by] for row in own) / max(total(by), 1)
        goal, informed = weighted("goal_s", "goals"), weighted("informed_s", "goals")
        cells = [f"{size} × {size}", f"`{planner}`", total("goals"), total("replans"), total("waits"),
                 f"{mean([row['expansions_first'] for row in own]):.0f}", f"{weighted('expansions_replan', 'replans'):.1f}",
                 f"{max(row['expansions_replan_max'] or 0 for row in own):.0f}", f"{weighted('cpu_ms_replan', 'replans'):.3f}", f"{goal:.1f}", f"{informed:.1f}",
                 f"{goal - informed:.1f}"]
        print(f"| {' | '.join(map(str, cells))} |")


if __name__ == "__main__":
    try:
        main()
    except KeyboardInterrupt:
        sys.exit("interrupted; the same command goes on where it was")
