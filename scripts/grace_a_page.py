"""docs/results/grace-a.md from the rows that scripts/grace-a keeps: representations of the same tasks beside each
other, and beside what GRACE published. Everything on the page follows from the rows."""

import csv
import io
import math
from collections import defaultdict

from experiment import Page, count, digits, mean, read, replace, share
from figures import COLOURS, picture
from verdicts import Claim, judge, spread

FAMILIES = ("empty", "maze", "warehouse", "window")

# Views by name: the representation, and the arguments of `run` and `simulate` for it.
VIEWS = {
    "grid": ("grid", ["--representation", "grid"]),
    "grid-strict": ("grid", ["--representation", "grid", "--separation", "strict"]),
    **{density: ("roadmap", ["--representation", "roadmap", "--density", density]) for density in ("S", "D", "SD")},
    "continuous": ("continuous", ["--representation", "continuous"]),
}
TITLES = {"grid": "grid of 2r", "grid-strict": "grid of 2√2·r", "S": "roadmap S", "D": "roadmap D", "SD": "roadmap SD",
          "continuous": "plane"}
PLACES = {**{view: f"on the {title}" for view, title in TITLES.items()}, "continuous": "in the plane"}

EXECUTIONS = ("followed", "driven")
# Figures of an execution, as they are kept and as `simulate` calls them.
EXECUTED = {"pairs": "contacts_agent_agent", "walls": "contacts_agent_obstacle", "nearest_m": "nearest_approach_m",
            "arrived": "arrived", "makespan_s": "makespan_s", "off_m": "tracking_error_max_m"}
MEASURED = ("plan_ms", "prepare_ms", "length_m", "soc_s", "makespan_s",
            *(f"{how}_{figure}" for how in EXECUTIONS for figure in EXECUTED))
# Columns of a trial: which it is, how it ended, and figures of plan and executions, empty where there are none.
COLUMNS = ["family", "seed", "agents", "view", "planner", "model", "termination", "failure", "valid", "valid_in_world",
           "keeps_limits", *MEASURED, "by_clock", "contended", "machine", "build"]
COUNTS = ("seed", "agents", "valid", "valid_in_world", "keeps_limits", "by_clock")
PLANNER_COLUMNS = ["planner", "version", "views", "options", "exact", "left_out"]

# Views of the study: roadmaps of these sizes, each vertex joined with its eight nearest.
SIZES = (40, 80, 160, 320, 640, 1280, 2560)
STUDY = {f"{size} vertices": ("roadmap", ["--representation", "roadmap", "--vertices", str(size), "--neighbors", "8"])
         for size in SIZES}

# A plan on a view is good enough for robots with inertia where its ways are longer by no more than this, and driving it touches nothing.
GOOD_ENOUGH = 1.25

# Section V-A, observations 1 to 3: SoC, makespan and planning time in per cent of db-CBS.
PUBLISHED = {"grid": ("123", "61", "2.4"), "SD": ("108", "52", "1.6")}
PUBLISHED_ROADMAPS = ("108–118", "52–61", "0.16–1.6")


class Trials:
    """Rows by view and planner, then by family, seed and number of robots."""

    def __init__(self, rows, views=tuple(VIEWS)):
        self.rows = rows
        self.lines = defaultdict(dict)
        for row in rows:
            self.lines[row["view"], row["planner"]][row["family"], row["seed"], row["agents"]] = row
        self.seeds = sorted({row["seed"] for row in rows})
        self.teams = sorted({row["agents"] for row in rows})
        self.chosen = {view: line for view in views if (line := self.best(view))}
        self.exact = any(row["model"] == "double" for row in self.chosen.get("continuous", ("", {}))[1].values())

    def planners(self):
        """All planners, by name."""
        return sorted({planner for _, planner in self.lines})

    def best(self, view):
        """The planner that stands for a view: in the plane one for the task's own model if there is one, then who
        solves most, then the shortest ways on what all those solve, then the name."""
        lines = {planner: cells for (of, planner), cells in self.lines.items() if of == view}
        exact = {planner: cells for planner, cells in lines.items()
                 if any(row["model"] == "double" and row["valid"] for row in cells.values())}
        lines = exact or lines
        if not lines:
            return None
        solved = {planner: {key for key, row in cells.items() if row["valid"]} for planner, cells in lines.items()}
        most = max(map(len, solved.values()))
        first = sorted(planner for planner in lines if len(solved[planner]) == most)
        common = set.intersection(*(solved[planner] for planner in first))
        way = lambda planner: round(sum(lines[planner][key]["length_m"] for key in common), 6)
        planner = min(first, key=lambda planner: (way(planner), planner))
        return planner, lines[planner]

    def all_solved(self):
        """Instances that the planners of all views solved."""
        solved = [{key for key, row in cells.items() if row["valid"]} for _, cells in self.chosen.values()]
        return set.intersection(*solved) if solved else set()


def time_ms(row):
    """Time from the view to the plan, None where the trial was beside other work on the machine."""
    return None if row["contended"] else row["plan_ms"] + row["prepare_ms"]


METRICS = {
    "SoC": lambda row: row["length_m"],
    "makespan": lambda row: row["makespan_s"],
    "planning time": time_ms,
}


def ratios(cells, base, of, keys):
    """ln of the ratio of a figure to the baseline's, by seed, of the instances that both solved."""
    found = defaultdict(list)
    for key in sorted(keys):
        above, below = cells.get(key), base.get(key)
        if above and below and above["valid"] and below["valid"]:
            above, below = of(above), of(below)
            if above and below:
                found[key[1]].append(math.log(above / below))
    return {seed: sum(values) / len(values) for seed, values in found.items()}


def percent(by_seed):
    """The geometric mean in per cent, with its 95 % t interval over seeds."""
    if not by_seed:
        return "–"
    middle, low, high = (100 * math.exp(value) for value in spread(list(by_seed.values())))
    return digits(middle) if len(by_seed) < 2 else f"{digits(middle)} [{digits(low)}, {digits(high)}]"


def figure(trials):
    """An SVG picture: a column for every family, a row for what is solved and for every figure against the number of
    robots, in per cent of the planner in the plane."""
    base = trials.chosen["continuous"][1]
    wide, left, top, gap, below = 205, 62, 46, 38, 44
    shown = [view for view in VIEWS if view in trials.chosen]
    colours = dict(zip(shown, COLOURS))
    drawn = {}
    for family in FAMILIES:
        for metric, of in METRICS.items():
            for view in shown:
                cells = trials.chosen[view][1]
                points = []
                for team in trials.teams:
                    keys = [(family, seed, team) for seed in trials.seeds]
                    found = ratios(cells, base, of, keys)
                    if found:
                        points.append((team, *(100 * math.exp(value) for value in spread(list(found.values())))))
                if view != "continuous":
                    drawn[metric, family, view] = points
        for view in shown:
            cells = trials.chosen[view][1]
            points = []
            for team in trials.teams:
                rows = [cells[key] for seed in trials.seeds if (key := (family, seed, team)) in cells]
                if rows:
                    value = 100 * mean([row["valid"] for row in rows])
                    points.append((team, value, value, value))
            drawn["solved", family, view] = points
    out = []
    y0 = top
    for number, metric in enumerate([*METRICS, "solved"]):
        high = 60 if metric == "solved" else 130
        values = [value for (of, _, _), points in drawn.items() if of == metric for point in points for value in point[1:2]]
        marks, place = scale(metric, values)
        y = lambda value: y0 + high - min(max(place(value), 0), 1) * high
        out.append(f'<text x="12" y="{y0 - 10}" class="name">{metric}, %</text>')
        for column, family in enumerate(FAMILIES):
            x0 = left + column * (wide + 24)
            first, last = trials.teams[0], trials.teams[-1]
            x = lambda team: x0 + 8 + (team - first) / max(1, last - first) * (wide - 16)
            if not number:
                out.append(f'<text x="{x0 + wide / 2}" y="{top - 26}" text-anchor="middle" class="name">{family}</text>')
            for mark in marks:
                out.append(f'<path class="{"even" if mark == 100 else "line"}" d="M{x0} {y(mark):.1f}h{wide}"/>')
                if not column:
                    out.append(f'<text x="{x0 - 6}" y="{y(mark) + 4:.1f}" text-anchor="end">{mark:g}</text>')
            out.append(f'<path class="axis" d="M{x0} {y0}v{high}h{wide}"/>')
            for team in trials.teams:
                out.append(f'<text x="{x(team):.1f}" y="{y0 + high + 15}" text-anchor="middle">{team}</text>')
            for view in shown:
                points = drawn.get((metric, family, view))
                if not points:
                    continue
                band = [(a, h) for a, _, _, h in points] + [(a, l) for a, _, l, _ in reversed(points)]
                joined = lambda pairs: " ".join(f"{x(a):.1f},{y(v):.1f}" for a, v in pairs)
                dots = "".join(f'<circle cx="{x(a):.1f}" cy="{y(m):.1f}" r="2.5" fill="{colours[view]}"/>'
                               for a, m, _, _ in points)
                # Of two seeds an interval says nothing.
                shade = "" if metric == "solved" or len(trials.seeds) < 3 else f'<polygon points="{joined(band)}" fill="{colours[view]}"/>'
                out.append(f'{shade}<polyline points="{joined([(a, m) for a, m, _, _ in points])}" stroke="{colours[view]}"/>{dots}')
        y0 += high + gap
    width, end = left + len(FAMILIES) * (wide + 24), y0
    out.append(f'<text x="{left + (width - left) / 2}" y="{end - 2}" text-anchor="middle">number of robots</text>')
    for number, view in enumerate(shown):
        at = left + number * (width - left) / len(shown)
        out.append(f'<path class="key" d="M{at:.0f} {end + 22}h14" stroke="{colours[view]}"/>'
                   f'<text x="{at + 18:.0f}" y="{end + 20}">{TITLES[view]}</text>'
                   f'<text x="{at + 18:.0f}" y="{end + 34}">{trials.chosen[view][0]}</text>')
    style = (".name{font-weight:bold}.axis{stroke:#888;fill:none}.line{stroke:#eee}.even{stroke:#aaa;stroke-dasharray:4 3}"
             "polyline{fill:none;stroke-width:1.5}polygon{fill-opacity:.12}.key{stroke-width:2.5}")
    return picture("SoC, makespan and planning time in per cent of the planner in the plane, and solved instances, by number of robots",
                   width, end + below, "\n".join(out), style, ".line{stroke:#333}.even{stroke:#777}")


def study_figure(trials, study):
    """An SVG picture: a panel for every family with ways against planning time, both in per cent of the planner in the plane."""
    base = trials.chosen["continuous"][1]
    colours = dict(zip(trials.chosen, COLOURS))

    def point(cells, family):
        keys = [key for key in cells if key[0] == family]
        both = [ratios(cells, base, METRICS[metric], keys) for metric in ("planning time", "SoC")]
        if not all(both):
            return None
        solved = sum(cells[key]["valid"] for key in keys)
        return (*(100 * math.exp(mean(list(found.values()))) for found in both), solved, len(keys))

    dots = {family: [(view, planner, at) for (view, planner), cells in trials.lines.items()
                     if view in colours and view != "continuous" and (at := point(cells, family))] for family in FAMILIES}
    lines = {family: {planner: [(view, at) for view in STUDY
                                if (view, planner) in study.lines and (at := point(study.lines[view, planner], family))]
                      for planner in study.planners()} for family in FAMILIES}
    known = [at for family in FAMILIES for at in [*(at for _, _, at in dots[family]), *(at for line in lines[family].values() for _, at in line)]]
    # Of trials that were disturbed no time is known.
    known = known or [(100.0, 100.0)]
    left, top, wide, high, gap = 62, 46, 205, 200, 24
    low, most = (bound(math.log10(limit(at[0] for at in known))) for bound, limit in ((math.floor, min), (math.ceil, max)))
    # All may be one value.
    most = max(most, low + 1)
    highest = min(200, 10 * math.ceil(max(at[1] for at in known) / 10))
    y = lambda value: top + high - (min(value, highest) - 95) / (highest - 95) * high
    out = [f'<text x="12" y="{top - 10}" class="name">SoC, %</text>']
    for column, family in enumerate(FAMILIES):
        x0 = left + column * (wide + gap)
        x = lambda value: x0 + 6 + (math.log10(value) - low) / (most - low) * (wide - 12)
        out.append(f'<text x="{x0 + wide / 2}" y="{top - 26}" text-anchor="middle" class="name">{family}</text>')
        for mark in range(100, highest + 1, 20):
            out.append(f'<path class="line" d="M{x0} {y(mark):.1f}h{wide}"/>')
            if not column:
                out.append(f'<text x="{x0 - 6}" y="{y(mark) + 4:.1f}" text-anchor="end">{mark}</text>')
        for power in range(low, most + 1):
            out.append(f'<path class="line" d="M{x(10.0**power):.1f} {top}v{high}"/>'
                       f'<text x="{x(10.0**power):.1f}" y="{top + high + 15}" text-anchor="middle">{10.0**power:g}</text>')
        out.append(f'<path class="axis" d="M{x0} {top}v{high}h{wide}"/>')
        for line in lines[family].values():
            joined = " ".join(f"{x(at[0]):.1f},{y(at[1]):.1f}" for _, at in line)
            out.append(f'<polyline points="{joined}"/>')
            for view, (time, way, solved, asked) in line:
                told = view.split(" ")[0] + (f" ({solved}/{asked})" if solved < asked else "")
                out.append(f'<circle cx="{x(time):.1f}" cy="{y(way):.1f}" r="2" class="size"/>'
                           f'<text x="{x(time) + 4:.1f}" y="{y(way) - 4:.1f}" class="told">{told}</text>')
        for view, planner, (time, way, _, _) in dots[family]:
            out.append(f'<circle cx="{x(time):.1f}" cy="{y(way):.1f}" r="3.5" fill="{colours[view]}"><title>{TITLES[view]}, {planner}</title></circle>')
    width = left + len(FAMILIES) * (wide + gap)
    out.append(f'<text x="{(left + width) / 2}" y="{top + high + 34}" text-anchor="middle">planning time, %</text>')
    shown = [view for view in trials.chosen if view != "continuous"]
    for number, view in enumerate(shown):
        at = left + number * (width - left) / len(shown)
        out.append(f'<circle cx="{at + 5:.0f}" cy="{top + high + 54}" r="3.5" fill="{colours[view]}"/>'
                   f'<text x="{at + 14:.0f}" y="{top + high + 58}">{TITLES[view]}</text>')
    style = (".name{font-weight:bold}.axis{stroke:#888;fill:none}.line{stroke:#eee}polyline{fill:none;stroke:#888}.size{fill:#888}"
             ".told{font-size:9px}")
    return picture("Ways against planning time in per cent of the planner in the plane, by view and by size of roadmaps", width, top + high + 72,
                   "\n".join(out), style, ".line{stroke:#333}")


def scale(metric, values):
    """Marks of an axis, and the share of its height at which a value stands; planning times by their logarithm."""
    if metric == "solved":
        return (0, 50, 100), lambda value: value / 100
    if metric == "planning time":
        low = math.floor(math.log10(min([100, *values])))
        high = max(low + 1, math.ceil(math.log10(max([100, *values]))))
        return [10.0**power for power in range(low, high + 1)], lambda value: (math.log10(max(value, 1e-9)) - low) / (high - low)
    low, high = min([95, *values]), max([105, *values])
    step = next(step for step in (10, 25, 50, 100, 250, 500, 1000, 10**9) if (high - low) / step <= 5)
    low, high = math.floor(low / step) * step, math.ceil(high / step) * step
    return list(range(low, high + 1, step)), lambda value: (value - low) / (high - low)


def table_of_views(page, trials):
    common = trials.all_solved()
    base = trials.chosen["continuous"][1]
    rows = []
    for view, (planner, cells) in trials.chosen.items():
        solved = [row for row in cells.values() if row["valid"]]
        figures = ["100"] * len(METRICS) if view == "continuous" else [
            percent(ratios(cells, base, of, common)) for of in METRICS.values()]
        published = PUBLISHED.get(view, ("100",) * 3 if view == "continuous" else ("–",) * 3)
        rows.append([TITLES[view], f"`{planner}`", share(len(solved), len(cells)), *figures, *published])
    page.table(["view", "planner", "solved", *(f"{metric}, %" for metric in METRICS),
                *(f"GRACE: {metric}, %" for metric in METRICS)], rows, texts=2)
    page.text(f"Geometric means, with 95 % t intervals over seeds, on the {len(common)} instances that the planners of all views solved. "
              "*SoC* is the length of all ways in metres, as in the paper, *makespan* the plan's own, *planning time* includes learning the "
              "view, but not making it. The planner of a view is the one that solves most there, then the one with the shortest ways.\n")


class Conclusion:
    """A sentence of GRACE's about two views, as a claim about differences by seed."""

    def __init__(self, said, kind, by_seed, ratio, margin=None):
        self.said, self.by_seed, self.ratio = said, by_seed, ratio
        differences = list(by_seed.values())
        self.claim = Claim(kind, differences, *([margin] if margin else []))


def conclusions(trials):
    """Takeaways of section V-A. A difference is the logarithm of the ratio that a claim says is above 1."""
    lines = {view: cells for view, (_, cells) in trials.chosen.items()}
    keys = trials.all_solved()
    found = []

    def claim(said, more, less, metric, kind="better", margin=None, only=None):
        if more in lines and less in lines:
            within = {key for key in keys if only is None or key[0] == only}
            by_seed = ratios(lines[more], lines[less], METRICS[metric], within)
            sign = -1 if kind == "no worse" else 1
            found.append(Conclusion(said, kind, {seed: sign * value for seed, value in by_seed.items()}, percent(by_seed), margin))

    for view in ("S", "D", "SD"):
        name = TITLES[view]
        claim(f"{name}: ways are at most 18 % longer than in the plane", view, "continuous", "SoC", "no worse", math.log(1.18))
        claim(f"{name}: makespans are shorter than in the plane", "continuous", view, "makespan")
        claim(f"{name}: planning is faster than in the plane", "continuous", view, "planning time")
    claim("denser roadmaps have shorter ways (S to SD)", "S", "SD", "SoC")
    claim("denser roadmaps have shorter makespans (S to SD)", "S", "SD", "makespan")
    claim("grids are planned faster than the roadmap D", "D", "grid", "planning time")
    claim("grids have longer ways than the roadmap D", "grid", "D", "SoC")
    claim("grids have longer makespans than the roadmap D", "grid", "D", "makespan")
    claim("aisles mitigate: in the warehouse a grid's ways are at most 18 % longer", "grid", "continuous", "SoC", "no worse",
          math.log(1.18), "warehouse")
    return found


def table_of_conclusions(page, trials):
    told = conclusions(trials)
    verdicts = judge([conclusion.claim for conclusion in told])
    page.table(["GRACE's conclusion", "here", "ratio, %"],
               [[conclusion.said, f"**{verdict}**" if verdict == "contradicted" else verdict, conclusion.ratio]
                for conclusion, verdict in zip(told, verdicts)], texts=2)
    page.text("*Ratio*: of the first to the second, with its 95 % interval over seeds, on the instances that all views solved. Verdicts take Student's "
              "t test over seeds at 5 %, after Holm's correction for all of these claims ([the rule](../../scripts/verdicts.py)).\n")


def table_of_good_enough(page, trials):
    """Shares of instances in which a plan on a view will do for robots with inertia, by family and view."""
    base = trials.chosen["continuous"][1]
    rows = []
    for view, (planner, cells) in trials.chosen.items():
        if view == "continuous":
            continue
        told = []
        for family in FAMILIES:
            asked = [key for key in cells if key[0] == family and (below := base.get(key)) and below["valid"]]
            good = [key for key in asked if good_enough(cells[key], base[key])]
            told.append(share(len(good), len(asked)))
        faster = ratios(cells, base, METRICS["makespan"], trials.all_solved())
        speed = f"{0.5 * math.exp(mean(list(faster.values()))):.2f}" if faster else "–"
        others = [line for (of, name), line in trials.lines.items() if of == view and any(row["valid"] for row in line.values())]
        ways = [math.exp(mean(list(found.values()))) for line in others if (found := ratios(line, base, METRICS["SoC"], line))]
        rows.append([TITLES[view], f"`{planner}`", *told, speed, f"{100 * min(ways):.0f} to {100 * max(ways):.0f}" if ways else "–"])
    page.table(["view", "planner", *FAMILIES, "even speed, m/s", "SoC by planner, %"], rows, texts=2)
    page.text(f"Instances in which the plan of the view's planner is good enough for the task's double integrators: its ways are at most "
              f"{100 * (GOOD_ENOUGH - 1):.0f} % longer than in the plane, and driving it touches nobody and no wall. *Even speed*: the speed ν of stop-go robots, "
              "unpublished and 0.5 m/s here, at which makespans on the view and in the plane are equal: a plan of theirs takes time as 1/ν. *SoC by planner*: "
              "from the best planner of the view to the worst.\n")


def good_enough(row, base):
    return bool(row["valid"] and row["driven_pairs"] == 0 and row["driven_walls"] == 0 and row["driven_arrived"] == row["agents"]
                and row["length_m"] <= GOOD_ENOUGH * base["length_m"])


def table_of_executions(page, trials):
    rows = []
    for view in VIEWS:
        plans = [row for (of, _), cells in trials.lines.items() if of == view for row in cells.values() if row["valid"]]
        if not plans:
            continue
        told = [share(sum(not row["valid_in_world"] for row in plans), len(plans))]
        for how in EXECUTIONS:
            driven = [row for row in plans if row[f"{how}_pairs"] is not None]
            told += [str(sum(row[f"{how}_{what}"] > 0 for row in driven)) if driven else "–" for what in ("pairs", "walls")]
            near = [row[f"{how}_nearest_m"] for row in driven if row[f"{how}_nearest_m"] is not None]
            told.append(f"{min(near):.3f}" if near else "–")
        later = [row["driven_makespan_s"] - row["makespan_s"] for row in plans if row["driven_makespan_s"] is not None]
        off = [row["driven_off_m"] for row in plans if row["driven_off_m"] is not None]
        told += [f"{mean(later):.2f}" if later else "–", f"{max(off):.2f}" if off else "–"]
        rows.append([TITLES[view], *told])
    page.table(["view", "overlap in the world", "followed: robots touch", "walls", "nearest, m",
                "driven: robots touch", "walls", "nearest, m", "later, s", "off course, m"], rows, texts=1)
    page.text("Plans of all planners of a view. *Overlap*: footprints overlap, by the exact judge, in a plan that is valid on its view. "
              "*Followed*: at 60 Hz by the single integrators that planners on views are told of, as GRACE plays plans back; within a tick "
              "robots cut corners by millimetres. *Driven*: by the task's double integrators, from knot to knot by the plan's times, until "
              "all have arrived. Columns have the number of plans with a contact, the least distance between centres, the mean delay of the "
              "last arrival, and the largest distance from the plan.\n")


def table_of_planners(page, trials, planners, path):
    """The planners of every view, as a file beside the rows, and what the page says of it."""
    base = trials.chosen["continuous"][1]
    rows = []
    for (view, planner), cells in sorted(trials.lines.items(), key=lambda line: (list(VIEWS).index(line[0][0]), line[0][1])):
        solved = [row for row in cells.values() if row["valid"]]
        times = sorted(time for row in solved if (time := time_ms(row)) is not None)
        figures = ["100", "100"] if cells is base else [
            percent(ratios(cells, base, METRICS[metric], cells)) for metric in ("SoC", "makespan")]
        middle = digits(times[len(times) // 2]) if times else ""
        rows.append([TITLES[view], planner, len(solved), len(cells), sum(not row["valid_in_world"] for row in solved), *figures, middle,
                     digits(times[-1]) if times else ""])
    out = io.StringIO()
    table = csv.writer(out, lineterminator="\n")
    table.writerow(["view", "planner", "solved", "instances", "overlap", "SoC, %", "makespan, %", "median ms", "longest ms"])
    table.writerows(rows)
    replace(path, out.getvalue())
    page.text(f"[{path.name}]({path.parent.name}/{path.name}) has a line for every planner on every view: solved instances, plans that overlap in the "
              "world, SoC and makespan relative to the planner in the plane where both solved, and planning times of solved instances.\n")
    told = [f"`{planner['planner']}` with `{planner['options']}`" for planner in planners if planner["options"] and not planner["left_out"]]
    if told:
        page.text(f"Planners that improve plans until the budget ends are asked for the first one: {', '.join(told)}.")
    left_out = defaultdict(list)
    for planner in planners:
        if planner["left_out"]:
            left_out[planner["left_out"]].append(f"`{planner['planner']}`")
    page.text("A team is not asked for where a smaller part of it took the whole budget, and counts as unsolved."
              + (" Left out: " + "; ".join(f"{', '.join(names)} ({reason})" for reason, names in left_out.items()) + "." if left_out else "") + "\n")


def losses(trials):
    """Sentences that speak against a view or its planner."""
    told = []
    base, cells = trials.chosen["continuous"]
    plans = [row for row in cells.values() if row["valid"]]
    if not trials.exact:
        told.append("**No planner for the plane knows double integrators.** "
                    f"`{base}` plans for discs that set out, turn and stop in no time, at 0.5 m/s: "
                    f"{share(sum(not row['keeps_limits'] for row in plans), len(plans), ' of ')} of its plans break the task's limits of acceleration. All "
                    "other figures are relative to such plans, not to plans of db-CBS.")
    touched = []
    for view, (planner, line) in trials.chosen.items():
        driven = [row for row in line.values() if row["valid"] and row["driven_pairs"] is not None]
        if driven:
            touched.append((sum(row["driven_pairs"] + row["driven_walls"] > 0 for row in driven), len(driven), PLACES[view]))
    touched = sorted(((some, of, name) for some, of, name in touched if some), key=lambda one: -one[0] / one[1])
    if touched:
        told.append("**Driven by double integrators, plans touch**: "
                    + ", ".join(f"{share(some, of, ' of ')} {name}" for some, of, name in touched)
                    + ". Robots drive from knot to knot by a controller of their own, which cuts corners of plans that do not know of "
                    "inertia, and is behind trajectories that ask for all that robots can do: a plan's controls are not used.")
    for view in ("grid", "grid-strict"):
        rows = [row for (of, _), line in trials.lines.items() if of == view for row in line.values() if row["valid"]]
        bad = [row for row in rows if not row["valid_in_world"]]
        if bad:
            near = [row["followed_nearest_m"] for row in bad if row["followed_nearest_m"] is not None]
            told.append(f"**{share(len(bad), len(rows), ' of ')} plans {PLACES[view]} keep the rules of the grid and overlap in the world**"
                        + (f", with centres down to {min(near):.3f} m apart" if near else "") + ".")
    unsolved = [f"{share(sum(not row['valid'] for row in line.values()), len(line), ' of ')} {PLACES[view]} by `{planner}`"
                for view, (planner, line) in trials.chosen.items() if not all(row["valid"] for row in line.values())]
    if unsolved:
        told.append("**Not solved**: " + ", ".join(unsolved) + ".")
    slower = []
    for view, (planner, line) in trials.chosen.items():
        found = ratios(line, cells, time_ms, trials.all_solved())
        if view != "continuous" and found and (times := math.exp(mean(list(found.values())))) > 1.05:
            slower.append(f"{digits(times)} times {PLACES[view]}")
    if slower:
        told.append(f"**Planning takes longer on views than in the plane**, against what GRACE found with db-CBS: {', '.join(slower)} "
                    f"(`{base}` in the plane).")
    longer = [f"{percent_more(found)} {PLACES[view]}" for view, (planner, line) in trials.chosen.items()
              if view != "continuous" and (found := ratios(line, cells, METRICS["SoC"], trials.all_solved())) and mean(list(found.values())) > 0.005]
    if longer:
        told.append("**Ways are longer on views**: " + ", ".join(longer) + ".")
    return told


def percent_more(by_seed):
    return f"{digits(100 * math.expm1(mean(list(by_seed.values()))))} %"


def write(page, kept):
    """Writes the page and its picture from the rows in the folder `kept`."""
    trials = Trials(read(kept / "rows.csv", MEASURED, COUNTS))
    planners = read(kept / "planners.csv", counts=("exact",))
    folder = kept.name
    if "continuous" not in trials.chosen:
        raise SystemExit("error: nothing is relative to anything without a planner in the plane\n"
                         "hint: name one with --planner, or none; `fleetyard plugins list` shows what there is")
    out = Page()
    base, cells = trials.chosen["continuous"]
    teams = f"{trials.teams[0]} to {trials.teams[-1]}" if len(trials.teams) > 1 else str(trials.teams[0])
    out.text("# GRACE's comparison of representations\n")
    out.text("This page repeats the comparison of grid, roadmaps and plane of GRACE (Zang et al., \"GRACE: A Unified 2D Multi-Robot Path "
             "Planning Simulator & Benchmark for Grid, Roadmap, And Continuous Environments\", section V-A): [views](../worlds.md#views-of-a-task) of the same "
             "tasks, every plan judged and driven in the same world.\n")
    out.text("```sh\nscripts/grace-a            # all planners that are installed; what was stopped goes on\n"
             "scripts/grace-a study      # sizes of roadmaps, for the picture of ways against planning time\n"
             "scripts/grace-a --quick    # two seeds, three team sizes\nscripts/grace-a page       # this page from its rows\n```\n")
    disturbed = sum(bool(row["contended"]) for row in trials.rows)
    machines = sorted({row["machine"] for row in trials.rows if row["machine"]})
    out.text(f"Written by `scripts/grace_a_page.py` from {len(trials.rows)} trials: {count(len(trials.seeds), 'seed')}, teams of {teams}, 5 × 5 m. The rows are in "
             f"`{folder}/`. Planners had 60 s on grids and roadmaps and 300 s in the plane, on one thread of {' and of '.join(machines)}. "
             + (f"The machine had something else to do during {count(disturbed, 'trial')}, whose times are not used." if disturbed
                else "No trial was disturbed by other work on the machine.") + "\n")
    out.text("## What is worse\n")
    out.text(*(f"- {loss}" for loss in losses(trials)), "")
    out.text("## Views beside each other\n")
    out.text(f"![SoC, makespan, planning time and solved instances by number of robots]({folder}/figure.svg)\n")
    out.text(f"Per cent of `{base}` in the plane, for every family; shades are 95 % t intervals over seeds.\n")
    table_of_views(out, trials)
    low, middle, high = PUBLISHED_ROADMAPS
    out.text(f"GRACE gives for its roadmaps together SoC {low} %, makespan {middle} % and planning time {high} % of db-CBS, apart only for the superdense "
             "one. Its worlds, starts, roadmaps, the speed ν and the planners behind its grid and roadmap figures are not published, so:\n")
    exact = trials.exact
    plane = f"`{base}` plans for the same double integrators" if exact else f"`{base}` plans without inertia"
    out.table(["figure", "comparable", "reason"], [
        ["SoC", "in kind", f"not the same worlds and roadmaps; {plane}, but is not db-CBS"],
        ["makespan", "no" if not exact else "in kind", "db-CBS has to speed up and to brake, stop-go robots do not, as GRACE says" + ("" if exact else "; here robots "
         "do not have to in the plane either")],
        ["planning time", "no", f"another planner in the plane, and another machine: db-CBS searches in states with speeds, `{base}` "
         + ("is not db-CBS" if exact else "in places alone")],
    ], texts=3)
    out.text("## GRACE's conclusions\n")
    table_of_conclusions(out, trials)
    out.text("## When a view is good enough\n")
    table_of_good_enough(out, trials)
    sizes = kept / "study.csv"
    if sizes.exists():
        study = Trials(read(sizes, MEASURED, COUNTS), list(STUDY))
        out.text(f"![Ways against planning time, by view and by size of roadmaps]({folder}/study.svg)\n")
        out.text(f"Ways against planning time in per cent of `{base}`, for every planner on every view (dots) and, joined by lines, for roadmaps of "
                 f"{SIZES[0]} to {SIZES[-1]} vertices with eight neighbours, by {' and '.join(f'`{name}`' for name in study.planners())}: geometric means of what both solved; "
                 "beside a size stands how much it solved, where that is not all.\n")
        replace(kept / "study.svg", study_figure(trials, study))
    out.text("## Executions\n")
    table_of_executions(out, trials)
    out.text("## All planners\n")
    table_of_planners(out, trials, planners, kept / "by-planner.csv")
    out.text("## Tasks\n")
    out.text("Worlds: `empty`; `maze`, a perfect maze for each seed with lanes of 0.71 m; `warehouse`, eight shelves with aisles of 0.79 m; `window`, a "
             "wall with two openings of 0.6 m (`maps/window.world.json`). Robots: discs of 0.08 m, rectangles and triangles of "
             "`maps/window.task.json`, double integrators with ±0.5 m/s and ±2 m/s² per axis. Starts and goals are drawn where the cells of both grids "
             "are free; a smaller team is a part of the larger one. Planners on views are told of discs of r_com = 0.08 m at 0.5 m/s, as GRACE's "
             "operators have it; so are planners in the plane that do not know double integrators, with the robots' own footprints.\n")
    out.text("## Where GRACE contradicts itself\n")
    out.text("- *Cells of 2r.* Section III-D concludes that robots are 2r apart, and forbids \"corner-meets\", which it does not define. The rules of MAPF, which "
             "planners keep, allow a robot to follow another one round a corner, where centres are as near as √2·r = 0.113 m. The tables have cells of 2r, "
             "and of 2√2·r, where that is 2r.",
             "- *32 × 32 cells.* 5 m are 31.25 cells of 2r = 0.16 m. Here the last row and column reach over the edge and are blocked, so that 31 × 31 are "
             "left; 32 × 32 would fit robots of 0.078 m.",
             "- *Speed of grids.* The text has grids \"further accelerate\" planning, the figures have 2.4 % of db-CBS's time for grids and 0.16 to "
             "1.6 % for roadmaps.",
             "- *Edges of roadmaps.* Section IV-A inflates both obstacles and segments, which asks for 2r of clearance. Here robots are counted once.", "")
    text = "\n".join(out.lines).rstrip("\n") + "\n"
    replace(kept / "figure.svg", figure(trials))
    replace(page, text)
