#!/usr/bin/env python3
"""Fleetyard's LaCAM* beside lacam3 (https://github.com/Kei18/lacam3), as ratios.

    scripts/beside_lacam3.py --lacam3 PATH [--mode first|anytime|largest] [CASE ...]

`first` runs both to their first plan: `lacam3 --no-star` on one thread and as it is
by default, and `fleetyard run --option anytime=false` as a whole process, with its
validation. Figures are medians over the scenarios of the ratio (ours / theirs) of
process CPU time (user and system, children included) and of the sum of costs. The
programs take turns, so that a machine whose speed drifts is no one's advantage.
`anytime` gives both --seconds and compares the sum of costs alone. `largest` runs
ours on all 25 scenarios and counts valid plans.

A CASE is MAP:AGENTS; maps come from $FLEETYARD_DATA/movingai. The sum of costs is
computed here from lacam3's paths by the convention of the field: the last arrival.
"""

import argparse
import json
import os
import pathlib
import re
import statistics
import subprocess
import sys
import tempfile

CASES = {
    "first": "random-64-64-10:400 random-64-64-10:800 warehouse-10-20-10-2-1:400 "
    "warehouse-10-20-10-2-1:1000 den312d:400 den312d:900 maze-32-32-4:200 random-32-32-20:400",
    "largest": "random-64-64-10:1000 maze-32-32-4:390 warehouse-10-20-10-2-1:1000 den312d:1000",
}
CASES["anytime"] = CASES["first"]


def measured(command):
    """Runs a command; its output and the CPU seconds of its process tree.

    In a session of its own, as the host starts every plugin: on a loaded machine the
    kernel gives each session the same share (autogroup scheduling).
    """
    before = os.times()
    done = subprocess.run(command, capture_output=True, text=True, check=False, start_new_session=True)
    after = os.times()
    cpu = after.children_user - before.children_user
    return done, cpu + after.children_system - before.children_system


def files(data, name, number):
    folder = data / "movingai" / name
    return str(folder / f"{name}.map"), str(folder / f"{name}-random-{number}.scen")


def theirs(arguments, case, number, extra, seconds):
    """Sum of costs (None if unsolved) and CPU seconds of lacam3."""
    name, agents = case
    map_file, scen = files(arguments.data, name, number)
    with tempfile.TemporaryDirectory() as folder:
        out = os.path.join(folder, "result.txt")
        _, cpu = measured(
            [arguments.lacam3, "-m", map_file, "-i", scen, "-N", str(agents), "-o", out]
            + ["-s", "0", "-t", str(seconds), "-v", "0"] + extra
        )
        text = pathlib.Path(out).read_text() if os.path.exists(out) else ""
    lines = re.findall(r"^\d+:(.*)$", text, re.M)
    if not lines:
        return None, cpu
    steps = [re.findall(r"\((\d+),(\d+)\)", line) for line in lines]
    last = steps[-1]
    arrivals = [0] * len(last)
    for time, places in enumerate(steps):
        for agent, place in enumerate(places):
            if place != last[agent]:
                arrivals[agent] = time + 1
    return sum(arrivals), cpu


def ours(arguments, case, number, options, seconds):
    """Sum of costs (None if there is no valid plan) and CPU seconds of Fleetyard."""
    name, agents = case
    map_file, scen = files(arguments.data, name, number)
    done, cpu = measured(
        [arguments.fleetyard, "run", "--map", map_file, "--scen", scen, "--agents", str(agents)]
        + ["--planner", "lacam", "--budget", f"{seconds}s", "--format", "json"] + options
    )
    if done.returncode != 0:
        print(f"  {name} {agents} scenario {number}: {done.stderr.strip()}", file=sys.stderr)
        return None, cpu
    return json.loads(done.stdout)["metrics"]["soc_steps"], cpu


def ratio(pairs):
    known = [a / b for a, b in pairs if a is not None and b]
    return f"{statistics.median(known):.3f}" if known else "-"


def first(arguments, cases):
    print(f"{'case':<30}{'ours':>8}{'ours s':>8} | {'one thread':^25} | {'default':^25}")
    print(f"{'':<30}{'solved':>8}{'CPU':>8} | {'CPU':>8}{'SoC':>8}{'solved':>9} | {'CPU':>8}{'SoC':>8}{'solved':>9}")
    for case in cases:
        rows = []
        for number in range(1, arguments.scenarios + 1):
            mine = ours(arguments, case, number, ["--option", "anytime=false"], 60)
            single = theirs(arguments, case, number, ["--no-star", "--no-multi-thread"], 60)
            default = theirs(arguments, case, number, ["--no-star"], 60)
            rows.append((mine, single, default))
        solved = [sum(row[at][0] is not None for row in rows) for at in range(3)]
        cpu = statistics.median(row[0][1] for row in rows)
        text = f"{case[0] + ' ' + str(case[1]):<30}{solved[0]:>8}{cpu:>8.3f}"
        for at in (1, 2):
            cpus = ratio([(row[0][1], row[at][1]) for row in rows])
            socs = ratio([(row[0][0], row[at][0]) for row in rows])
            text += f" | {cpus:>8}{socs:>8}{solved[at]:>9}"
        print(text, flush=True)


def anytime(arguments, cases):
    print(f"{'case':<30}{'SoC ratio':>10}{'best':>8}{'worst':>8}{'solved':>8}{'theirs':>8}")
    for case in cases:
        pairs = []
        for number in range(1, arguments.scenarios + 1):
            mine, _ = ours(arguments, case, number, [], arguments.seconds)
            peer, _ = theirs(arguments, case, number, [], arguments.seconds)
            pairs.append((mine, peer))
        known = [a / b for a, b in pairs if a is not None and b]
        best, worst = (f"{min(known):.3f}", f"{max(known):.3f}") if known else ("-", "-")
        solved = [sum(pair[at] is not None for pair in pairs) for at in range(2)]
        print(f"{case[0] + ' ' + str(case[1]):<30}{ratio(pairs):>10}{best:>8}{worst:>8}"
              f"{solved[0]:>8}{solved[1]:>8}", flush=True)


def largest(arguments, cases):
    print(f"{'case':<30}{'valid':>8}{'CPU s median':>14}{'max':>8}")
    for case in cases:
        results = [
            ours(arguments, case, number, ["--option", "anytime=false"], 60) for number in range(1, 26)
        ]
        valid = sum(soc is not None for soc, _ in results)
        cpus = [cpu for _, cpu in results]
        print(f"{case[0] + ' ' + str(case[1]):<30}{valid:>5}/25{statistics.median(cpus):>14.2f}"
              f"{max(cpus):>8.2f}", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--fleetyard", default="target/release/fleetyard", help="our executable")
    parser.add_argument("--lacam3", help="its executable, built from its repository")
    parser.add_argument("--data", type=pathlib.Path, default=os.environ.get("FLEETYARD_DATA"))
    parser.add_argument("--mode", choices=["first", "anytime", "largest"], default="first")
    parser.add_argument("--scenarios", type=int, default=5, help="scenarios 1 to this number")
    parser.add_argument("--seconds", type=int, default=10, help="budget of `anytime`")
    parser.add_argument("cases", nargs="*", metavar="CASE")
    arguments = parser.parse_args()
    if arguments.data is None:
        parser.error("set FLEETYARD_DATA to the folder that has movingai/")
    if arguments.lacam3 is None and arguments.mode != "largest":
        parser.error("--lacam3 is needed")
    cases = arguments.cases or CASES[arguments.mode].split()
    cases = [(name, int(agents)) for name, agents in (case.rsplit(":", 1) for case in cases)]
    {"first": first, "anytime": anytime, "largest": largest}[arguments.mode](arguments, cases)


if __name__ == "__main__":
    main()
