#!/usr/bin/env python3
"""Draws how planners for roadmaps and the plane grow, from the trials of scripts/suites/growth.toml.

    fleetyard bench scripts/suites/growth.toml --store target/growth.sqlite
    fleetyard store export target/growth.sqlite --csv target/growth.csv
    scripts/growth.py target/growth.csv target/growth.svg

Above: CPU time (learning the roadmap and planning) and peak memory of the planner's process by the number of
discs, on the roadmap of 1,000 vertices and in the plane. Below: the same by the number of vertices, with
50 discs. A planner's line ends with the last that it solved.
"""

import argparse
import csv
import math
import pathlib
import sys

sys.dont_write_bytecode = True

from figures import COLOURS, picture  # noqa: E402

VERTICES, TEAM = "1000", 50
WIDE, HIGH, LEFT, TOP, GAP = 300, 170, 62, 40, 70


def read(path):
    """Solved trials: by planner, view and team the CPU time in ms and the memory in MB."""
    with path.open() as file:
        rows = [row for row in csv.DictReader(file) if row["success"] == "1"]
    known = {}
    for row in rows:
        cpu = float(row["cpu_time_ms"]) + float(row["prepare_time_ms"])
        known[row["planner_id"], row["view"], int(row["agents"])] = (cpu, float(row["peak_memory_kb"]) / 1024)
    return known


def lines(known, which, by_team):
    """Points by planner: (team or vertices, figure)."""
    found = {}
    for (planner, view, team), figures in sorted(known.items(), key=lambda item: (item[0][0], item[0][2])):
        if by_team and view in (VERTICES, "continuous"):
            found.setdefault(planner, []).append((team, figures[which]))
        elif not by_team and team == TEAM and view != "continuous":
            found.setdefault(planner, []).append((int(view), figures[which]))
    return {planner: sorted(points) for planner, points in found.items()}


def powers(values):
    """The powers of ten around values."""
    low, high = math.floor(math.log10(min(values))), math.ceil(math.log10(max(values)))
    return [10.0**power for power in range(low, max(high, low + 1) + 1)]


def panel(x0, y0, title, name, drawn, colours):
    """Axes with logarithmic scales, and the lines."""
    points = [point for line in drawn.values() for point in line]
    if not points:
        return ""
    marks = [powers([point[axis] for point in points]) for axis in (0, 1)]
    ends = [[math.log10(of[0]), math.log10(of[-1])] for of in marks]
    share = lambda value, axis: (math.log10(value) - ends[axis][0]) / (ends[axis][1] - ends[axis][0])
    x, y = lambda value: x0 + share(value, 0) * WIDE, lambda value: y0 + HIGH - share(value, 1) * HIGH
    out = [f'<text x="{x0}" y="{y0 - 10}" class="name">{title}</text>',
           f'<text x="{x0 + WIDE / 2}" y="{y0 + HIGH + 32}" text-anchor="middle">{name}</text>']
    for mark in marks[1]:
        out.append(f'<path class="line" d="M{x0} {y(mark):.1f}h{WIDE}"/>'
                   f'<text x="{x0 - 6}" y="{y(mark) + 4:.1f}" text-anchor="end">{mark:g}</text>')
    for mark in marks[0]:
        out.append(f'<text x="{x(mark):.1f}" y="{y0 + HIGH + 16}" text-anchor="middle">{mark:g}</text>')
    out.append(f'<path class="axis" d="M{x0} {y0}v{HIGH}h{WIDE}"/>')
    for planner, line in drawn.items():
        joined = " ".join(f"{x(at):.1f},{y(value):.1f}" for at, value in line)
        dots = "".join(f'<circle cx="{x(at):.1f}" cy="{y(value):.1f}" r="2.5" fill="{colours[planner]}"/>' for at, value in line)
        out.append(f'<polyline points="{joined}" stroke="{colours[planner]}"/>{dots}')
    return "".join(out)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("trials", type=pathlib.Path, help="CSV of the suite's store")
    parser.add_argument("picture", type=pathlib.Path, help="SVG file to write")
    arguments = parser.parse_args()
    known = read(arguments.trials)
    planners = sorted({planner for planner, _, _ in known})
    dashed = lambda at: '" stroke-dasharray="5 3' if at >= len(COLOURS) else ""
    colours = {planner: COLOURS[at % len(COLOURS)] + dashed(at) for at, planner in enumerate(planners)}
    out = []
    for row, by_team in enumerate((True, False)):
        where = f"{VERTICES} vertices, or the plane" if by_team else f"{TEAM} discs"
        for column, (which, what) in enumerate(((0, "CPU, ms"), (1, "memory, MB"))):
            place = (LEFT + column * (WIDE + GAP), TOP + row * (HIGH + GAP))
            name = "discs" if by_team else "vertices"
            out.append(panel(*place, f"{what}: {where}", name, lines(known, which, by_team), colours))
    bottom = TOP + 2 * (HIGH + GAP)
    for at, planner in enumerate(planners):
        x, y = LEFT + at % 5 * 135, bottom + at // 5 * 18
        out.append(f'<path class="key" d="M{x} {y}h14" stroke="{colours[planner]}"/><text x="{x + 18}" y="{y + 4}">{planner}</text>')
    style = ".name{font-weight:bold}.axis{stroke:#888;fill:none}.line{stroke:#eee}polyline{fill:none;stroke-width:1.5}.key{stroke-width:2.5}"
    title = "CPU time and memory of planners by discs and by vertices"
    text = picture(title, LEFT + 2 * (WIDE + GAP), bottom + 18 * (len(planners) // 5 + 1), "\n".join(out), style, ".line{stroke:#333}")
    arguments.picture.write_text(text)


if __name__ == "__main__":
    main()
