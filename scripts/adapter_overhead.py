#!/usr/bin/env python3
"""What a command adapter costs: a solver run through `fleetyard run`, and by itself.

    scripts/adapter_overhead.py --fleetyard target/release/fleetyard

Each job is deterministic work of about a second or more, not a search until a limit: the
same program, instance and arguments give the same plan, however long they take. Both ways
alternate, in an order that changes with each pair, and medians are compared. The time of a
process is that of everything it started, from its start to its end: for `fleetyard run`
this includes starting the sandbox, reading the map, writing the solver's files, reading
its answer, judging the plan and writing the record.

Programs are found as manifests find them, on PATH; a job whose program is missing is
skipped. Standard library only.
"""

import argparse
import json
import os
import resource
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent

# Planner, agents, options for the adapter, and arguments that come to the same: what the
# adapter says beyond these are the programs' defaults.
JOBS = [
    (
        "mapf-lns2",
        100,
        {"iterations": 3000},
        ["-m", "{map}", "-a", "{scen}", "-k", "{agents}", "-t", "{seconds}", "--seed", "1",
         "--outputPaths", "{out}", "--maxIterations", "3000"],
    ),
    (
        "pbs",
        150,
        {},
        ["-m", "{map}", "-a", "{scen}", "-k", "{agents}", "-t", "{seconds}",
         "--outputPaths", "{out}"],
    ),
    (
        "eecbs",
        150,
        {},
        ["-m", "{map}", "-a", "{scen}", "-k", "{agents}", "-t", "{seconds}",
         "--outputPaths", "{out}"],
    ),
    (
        "cbsh2-rtc",
        48,
        {},
        ["-m", "{map}", "-a", "{scen}", "-k", "{agents}", "-t", "{seconds}", "-d", "1",
         "--outputPaths", "{out}"],
    ),
]


def timed(command, folder):
    """Wall seconds and processor seconds of a command and all that it started.

    In a session of its own, as the host starts every plugin: on a loaded machine the
    kernel gives each session the same share (autogroup scheduling).
    """
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    begun = time.monotonic()
    ended = subprocess.run(command, cwd=folder, stdin=subprocess.DEVNULL,
                           stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True)
    wall = time.monotonic() - begun
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    if ended.returncode:
        sys.exit(f"{command[0]} ended with {ended.returncode}:\n{ended.stderr.decode()}")
    return wall, cpu, ended.stdout


def measure(job, given):
    planner, agents, options, arguments = job
    program = shutil.which(planner)
    if program is None:
        print(f"{planner:<12} skipped: not on PATH")
        return
    with tempfile.TemporaryDirectory() as folder:
        values = {"map": given.map, "scen": given.scen, "agents": agents,
                  "seconds": given.budget, "out": os.path.join(folder, "paths.txt")}
        direct = [program] + [word.format(**values) for word in arguments]
        through = [given.fleetyard, "run", "--map", given.map, "--scen", given.scen,
                   "--agents", str(agents), "--seed", "1", "--budget", f"{given.budget}s",
                   "--planner", str(ROOT / "plugins/adapters" / planner), "--format", "json"]
        for name, value in options.items():
            through += ["--option", f"{name}={value}"]
        walls, cpus, inside = {"direct": [], "through": []}, {"direct": [], "through": []}, []
        for pair in range(given.pairs):
            ways = [("direct", direct), ("through", through)]
            for way, command in ways if pair % 2 else reversed(ways):
                wall, cpu, out = timed(command, folder)
                walls[way].append(wall)
                cpus[way].append(cpu)
                if way == "through":
                    record = json.loads(out)
                    if not record["verdict"]["valid"]:
                        sys.exit(f"{planner}: the plan is not valid")
                    inside.append(record["metrics"]["planning_time_ms"] / 1000)
    median = statistics.median
    wall, cpu = ({way: median(times) for way, times in figures.items()} for figures in (walls, cpus))
    share = lambda figures: 100 * (figures["through"] / figures["direct"] - 1)
    print(f"{planner:<12} {agents:>6} {wall['direct']:>9.3f} {wall['through']:>9.3f} {share(wall):>+7.1f} "
          f"{cpu['direct']:>9.3f} {cpu['through']:>9.3f} {share(cpu):>+7.1f} "
          f"{100 * (median(inside) / wall['direct'] - 1):>+8.1f}", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--fleetyard", default=str(ROOT / "target/release/fleetyard"))
    parser.add_argument("--map", default=str(ROOT / "maps/random-32-32-20.map"))
    parser.add_argument("--scen", default=str(ROOT / "maps/random-32-32-20-random-1.scen"))
    parser.add_argument("--budget", type=int, default=120, help="seconds, never to be reached")
    parser.add_argument("--pairs", type=int, default=7)
    parser.add_argument("--only", help="one of the planners")
    given = parser.parse_args()
    if not Path(given.fleetyard).is_file():
        parser.error(f"{given.fleetyard} does not exist; name the program with --fleetyard")
    print("planner      agents  direct s  fleety. s      %  direct cpu  fleety.      %   plan %")
    for job in JOBS:
        if given.only in (None, job[0]):
            measure(job, given)


if __name__ == "__main__":
    main()
