#!/usr/bin/env python3
"""docs/results/lsmart.md from the stores that scripts/lsmart left: what LSMART's paper concludes,
beside what was measured here.

    python3 scripts/lsmart_page.py FOLDER [reduced | full] [KEPT] > docs/results/lsmart.md

Needs nothing but Python's own library. Rows that figures come from are kept as CSV in the folder KEPT,
so that measuring can go on in parts: a row of a store takes the place of the same row that was kept.
Every verdict follows from the rows by the rules that the page states.
"""

import csv
import math
import os
import sqlite3
import sys
from collections import defaultdict

SETUPS = {
    "1": "1: standard, periodic", "2": "2: standard, event-based",
    "3": "3: windowed W = P = 1 s", "4": "4: windowed W = 1 s, event-based",
    "5": "5: transient, periodic", "6": "6: transient, event-based",
    "7": "7: windowed W = P = 10 s", "8": "8: windowed W = 10 s, event-based",
    "9": "9: W = P = 2 s", "10": "10: W = P = 5 s",
    "12": "12: W = 1 s, LRGW", "13": "13: W = 1 s, guided PIBT",
    "14": "14: W = 10 s, LRGW", "15": "15: W = 10 s, guided PIBT",
    "16": "16: CBS, pebbles", "17": "17: CBS, turns", "18": "18: PP, pebbles", "19": "19: PP, turns",
}

# What is kept of a row.
COLUMNS = ["planner", "map", "agents", "seed", "throughput_per_s", "goals_committed", "simulated_s", "planner_calls",
           "fail_policy_ratio", "contacts", "success", "rtf", "contended", "machine", "trace_digest"]

# Planners that use up their limit by design: their plans depend on what else the machine does.
ANYTIME = ("lns", "lns2")

# Two-sided 95 % quantiles of Student's t by degrees of freedom.
T95 = [12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228, 2.201, 2.179,
       2.160, 2.145, 2.131, 2.120, 2.110, 2.101, 2.093, 2.086]


def t95(freedom):
    if freedom < 1:
        return math.nan
    return T95[freedom - 1] if freedom <= len(T95) else 1.96 + 2.5 / freedom


def mean(values):
    return sum(values) / len(values)


def deviation(values):
    if len(values) < 2:
        return math.nan
    centre = mean(values)
    return math.sqrt(sum((value - centre) ** 2 for value in values) / (len(values) - 1))


class Interval:
    """The mean of values that are independent, and its 95 % t interval."""

    def __init__(self, values):
        self.n = len(values)
        self.mean = mean(values)
        self.deviation = deviation(values)
        half = t95(self.n - 1) * self.deviation / math.sqrt(self.n) if self.n > 1 else math.inf
        self.low, self.high = self.mean - half, self.mean + half

    def decided_after(self, bound):
        """With how many values of this mean and spread the interval would leave the bound out."""
        distance = abs(self.mean - bound)
        if distance == 0 or math.isnan(self.deviation):
            return None
        for n in range(2, 1000):
            if t95(n - 1) * self.deviation / math.sqrt(n) < distance:
                return max(n, self.n + 1)
        return None


def numbers(row):
    """A row of a CSV file with the types that a store has."""
    for column in ("agents", "seed", "contacts", "success", "goals_committed", "planner_calls"):
        row[column] = int(row[column])
    for column in ("throughput_per_s", "simulated_s", "fail_policy_ratio", "rtf"):
        row[column] = float(row[column])
    return row


class Rows:
    """Rows of one experiment by setup, map and number of robots, then by seed."""

    def __init__(self, folder, kept, name):
        self.rows = {}
        self.disturbed = 0
        self.path = os.path.join(kept, f"{name}.csv") if kept else None
        if self.path and os.path.exists(self.path):
            with open(self.path, newline="", encoding="utf-8") as file:
                for row in csv.DictReader(file):
                    self.take(numbers(row))
        store = os.path.join(folder, f"{name}.sqlite")
        if os.path.exists(store):
            anytime = name.split("-")[1] in ANYTIME
            with sqlite3.connect(f"file:{store}?mode=ro", uri=True) as database:
                database.row_factory = sqlite3.Row
                found = [dict(row) for row in database.execute(f"SELECT {', '.join(COLUMNS)} FROM trials")]
            # A call that failed for want of time, on a machine that had something else to do, says
            # nothing of the planner. The cell is left out as a whole: seeds are no choice.
            cell = lambda row: (row["planner"], row["map"], row["agents"])
            timed = lambda row: anytime or row["fail_policy_ratio"] != 0
            doubtful = {cell(row) for row in found
                        if row["throughput_per_s"] is None or (timed(row) and row["contended"])}
            for row in found:
                if cell(row) in doubtful:
                    self.disturbed += 1
                else:
                    self.take(row)
        self.cells = defaultdict(dict)
        for row in self.rows.values():
            self.cells[row["planner"], row["map"], row["agents"]][row["seed"]] = row

    def take(self, row):
        self.rows[row["planner"], row["map"], row["agents"], row["seed"]] = row

    def keep(self):
        if not (self.path and self.rows):
            return
        os.makedirs(os.path.dirname(self.path), exist_ok=True)
        order = sorted(self.rows, key=lambda key: (key[1], key[2], key[3], len(key[0]), key[0]))
        with open(self.path, "w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
            writer.writeheader()
            writer.writerows(self.rows[key] for key in order)


class Measured:
    """All rows of one form of the setups."""

    def __init__(self, parts):
        self.cells = {}
        for part in parts:
            for key, cell in part.cells.items():
                # Setups that two suites share are the same trials.
                self.cells[key] = {**self.cells.get(key, {}), **cell}

    def values(self, setup, place, column="throughput_per_s"):
        """By seed."""
        return {seed: row[column] for seed, row in self.cells.get((setup, *place), {}).items()}

    def places(self, setups, only=None):
        """Maps and numbers of robots that one of these setups has."""
        found = {key[1:] for key in self.cells if key[0] in setups}
        return sorted(place for place in found if only is None or place[0] in only)

    def ends(self, setups, only=None):
        """The smallest and the largest team of each map that has one of these setups."""
        teams = defaultdict(list)
        for place in self.places(setups, only):
            teams[place[0]].append(place)
        several = [places for places in teams.values() if len(places) > 1]
        return [places[0] for places in several], [places[-1] for places in several]

    def fails(self, setup, place):
        ratios = self.values(setup, place, "fail_policy_ratio")
        return mean(list(ratios.values())) if ratios else None


def share(value):
    percent = round(100 * value)
    return f"{'+' if percent > 0 else '−' if percent < 0 else ''}{abs(percent)} %"


class Effect:
    """A difference between setups by seed, averaged over places; each place weighs the same."""

    def __init__(self):
        self.by_place = []

    def add(self, above, below, relative=True):
        """A place: values by seed of what is claimed to be above, and of the other."""
        seeds = above.keys() & below.keys()
        if not seeds:
            return
        unit = mean([below[seed] for seed in seeds]) if relative else 1
        if unit > 0:
            self.by_place.append({seed: (above[seed] - below[seed]) / unit for seed in seeds})

    def interval(self):
        if not self.by_place:
            return None
        seeds = set.intersection(*(set(place) for place in self.by_place))
        return Interval([mean([place[seed] for place in self.by_place]) for seed in sorted(seeds)]) if seeds else None

    def describe(self, interval):
        size = share(interval.mean)
        if interval.n > 1:
            size += f" [{share(interval.low)}, {share(interval.high)}]"
        places, seeds = len(self.by_place), interval.n
        return f"{size} over {places} place{'s' if places != 1 else ''}, {seeds} seed{'s' if seeds != 1 else ''}"

    def above(self, bound=0.0):
        """The verdict on a claim that the difference is above the bound."""
        interval = self.interval()
        if interval is None:
            return "not measured", ""
        if interval.low > bound:
            return "confirmed", self.describe(interval)
        if interval.high < bound:
            return "contradicted", self.describe(interval)
        return "undecided", self.describe(interval) + needed(interval, [bound])

    def within(self, bound):
        """The verdict on a claim that the difference is no more than the bound either way."""
        interval = self.interval()
        if interval is None:
            return "not measured", ""
        if -bound < interval.low and interval.high < bound:
            return "confirmed", self.describe(interval)
        if interval.low > bound or interval.high < -bound:
            return "contradicted", self.describe(interval)
        inside = abs(interval.mean) < bound
        bounds = [-bound, bound] if inside else [math.copysign(bound, interval.mean)]
        return "undecided", self.describe(interval) + needed(interval, bounds)


def needed(interval, bounds):
    counts = [interval.decided_after(bound) for bound in bounds]
    if interval.n < 2 or None in counts:
        return "; how many seeds would decide cannot be said from these"
    return f"; about {max(counts)} seeds would decide"


# The two forms in which setups are run.
FORMS = ("as in the paper", "as shipped")


def say(claim, forms, judge, maps=None):
    """A claim with its verdict in each form; `maps` are those that it names."""
    told = []
    for name, measured in zip(FORMS, forms):
        verdict, size = judge(measured)
        if maps and verdict != "not measured":
            missing = [one for one in maps if one not in judge.seen(measured)]
            if missing:
                size = f"there is nothing from {' and '.join(missing)}; elsewhere {size}"
                verdict = "undecided"
        if verdict == "not measured" and name != FORMS[0]:
            continue
        told.append(f"{name} **{verdict}**" + (f" ({size})" if size else ""))
    print(f"- *{claim}* " + "; ".join(told)[0].upper() + "; ".join(told)[1:] + ".")


class Pairs:
    """A claim about pairs of setups, at all places or those of some maps."""

    def __init__(self, pairs, kind="above", bound=0.0, column="throughput_per_s", only=None, ends=None, where=None):
        self.pairs, self.kind, self.bound, self.column = pairs, kind, bound, column
        self.only, self.ends, self.where = only, ends, where

    def places(self, measured):
        setups = sorted({setup for above, below in self.pairs for setup in (above, below)})
        if self.ends is None:
            return measured.places(setups, self.only)
        return measured.ends(setups, self.only)[0 if self.ends == "few" else 1]

    def seen(self, measured):
        return {place[0] for place in self.places(measured)
                if any((a, *place) in measured.cells and (b, *place) in measured.cells for a, b in self.pairs)}

    def __call__(self, measured):
        effect = Effect()
        for place in self.places(measured):
            for above, below in self.pairs:
                if self.where is None or self.where(measured, above, below, place):
                    effect.add(measured.values(above, place, self.column), measured.values(below, place, self.column),
                               relative=self.column == "throughput_per_s")
        return effect.above(self.bound) if self.kind == "above" else effect.within(self.bound)


class AgainstBest:
    """A claim that a setup is above the best of some others at each place, or below it."""

    def __init__(self, setups, bound=0.0, never=False, where=None):
        self.setups, self.bound, self.never, self.where = setups, bound, never, where

    def seen(self, measured):
        return {place[0] for place in measured.places([setup for setup, _ in self.setups])}

    def __call__(self, measured):
        effect = Effect()
        for setup, others in self.setups:
            for place in measured.places([setup]):
                rivals = [values for other in others if (values := measured.values(other, place))]
                own = measured.values(setup, place)
                if len(rivals) < len(others) or (self.where and not self.where(measured, setup, place)):
                    continue
                best = max(rivals, key=lambda values: mean(list(values.values())))
                effect.add(*((best, own) if self.never else (own, best)))
        return effect.above(self.bound)


def cell(measured, setup, place):
    values = list(measured.values(setup, place).values())
    if not values:
        return "–"
    interval = Interval(values)
    spread = "" if len(values) < 2 else f" ± {interval.high - interval.mean:.2f}"
    fails = measured.fails(setup, place)
    return f"{interval.mean:.2f}{spread}" + (f" ({100 * fails:.0f} %)" if fails else "")


def table(forms, setups, names=SETUPS):
    if not any(measured.places(setups) for measured in forms):
        print("Not measured yet.\n")
        return
    print("| map | N | setups | " + " | ".join(names[setup] for setup in setups) + " |")
    print("| --- | ---: | --- |" + " ---: |" * len(setups))
    for place in sorted({place for measured in forms for place in measured.places(setups)}):
        for name, measured in zip(FORMS, forms):
            if any((setup, *place) in measured.cells for setup in setups):
                cells = [cell(measured, setup, place) for setup in setups]
                print(f"| {place[0]} | {place[1]} | {name} | " + " | ".join(cells) + " |")
    print()


def experiment_1(forms):
    print("## 1: instance generators\n")
    table(forms, ["1", "2", "3", "4", "5", "6"])
    say("The windowed setup consistently achieves equal or highest throughput (here: no more than 5 % below the best of "
        "the others).", forms, AgainstBest([("3", "15"), ("4", "26")], bound=-0.05))
    say("It is asked for less, and so fails less: fewer calls go to the fail policy.", forms,
        Pairs([("1", "3"), ("5", "3"), ("2", "4"), ("6", "4")], column="fail_policy_ratio"))
    say("In warehouse-10-20-10-2-1, with few possible goals, transient outperforms standard.", forms,
        Pairs([("5", "1"), ("6", "2")], only=["warehouse-10-20-10-2-1"]))
    say("In room-64-64-16 both are similar (here: within 10 %).", forms,
        Pairs([("5", "1"), ("6", "2")], kind="within", bound=0.1, only=["room-64-64-16"]))
    say("In random-64-64-10 standard is slightly better.", forms,
        Pairs([("1", "5"), ("2", "6")], only=["random-64-64-10"]))
    print()


def experiment_2(forms):
    print("## 2: when to plan\n")
    table(forms, ["3", "4", "7", "8"])
    named = ["room-64-64-16", "warehouse-10-20-10-2-1"]
    say("In room-64-64-16 and warehouse-10-20-10-2-1 both policies are similar for the same W (here: within 10 %).", forms,
        Pairs([("3", "4"), ("7", "8")], kind="within", bound=0.1, only=named), named)
    say("In random-64-64-10 with W = 1 s periodic is slightly better.", forms, Pairs([("3", "4")], only=["random-64-64-10"]))
    say("In random-64-64-10 with W = 10 s event-based is better.", forms, Pairs([("8", "7")], only=["random-64-64-10"]))
    print()


def experiment_3(forms):
    print("## 3: windows\n")
    table(forms, ["3", "9", "10", "7"])
    say("With few robots (here: the smallest team of each map) frequent calls and short windows are better: W = 1 s against "
        "10 s.", forms, Pairs([("3", "7")], ends="few"))
    say("With many (the largest team) rare calls and long windows are better: W = 10 s against 1 s.", forms,
        Pairs([("7", "3")], ends="many"))
    print()


def periods(measured):
    return sorted({key[0] for key in measured.cells}, key=lambda label: float(label.split()[2]))


def experiment_4(measured):
    print("## 4: how often to plan (setup 11)\n")
    labels = periods(measured)
    table([measured], labels, {label: label for label in labels})
    if len(labels) > 1:
        slow = labels[-1]
        fast = next((label for label in labels if float(label.split()[2]) >= 1), labels[0])
        named = ["random-64-64-10", "warehouse-10-20-10-2-1"]
        say(f"At high density a shorter period is better in random-64-64-10 and warehouse-10-20-10-2-1 (here: {fast} against "
            f"{slow}, largest teams).", [measured], Pairs([(fast, slow)], only=named, ends="many"), named)
        say("In room-64-64-16 it is not.", [measured], Pairs([(slow, fast)], bound=-0.05, only=["room-64-64-16"]))
        say("At lower densities (here: the smallest teams) it is not either.", [measured],
            Pairs([(slow, fast)], bound=-0.05, ends="few"))
        print()


def experiment_5(forms):
    print("## 5: fail policies\n")
    table(forms, ["3", "12", "13", "7", "14", "15"], dict(SETUPS, **{"3": "3: W = 1 s, PIBT", "7": "7: W = 10 s, PIBT"}))

    def called(measured, setup, place):
        return (measured.fails(setup, place) or 0) > 0.01

    def either(measured, above, below, place):
        return called(measured, above, place) or called(measured, below, place)

    say("Guided PIBT is never the best (here: the better of the other two is above it, where a fail policy is called in more "
        "than 1 % of calls).", forms,
        AgainstBest([("13", ["3", "12"]), ("15", ["7", "14"])], never=True, where=called))
    say("LRGW is better than PIBT in random-64-64-10 with many robots (where either is called).", forms,
        Pairs([("12", "3"), ("14", "7")], only=["random-64-64-10"], where=either))
    say("PIBT is better than LRGW in room-64-64-16 (where either is called).", forms,
        Pairs([("3", "12"), ("7", "14")], only=["room-64-64-16"], where=either))
    print()


def experiment_6(forms):
    print("## 6: optimality and the model\n")
    table(forms, ["16", "17", "18", "19"])

    def neither_fails(measured, above, below, place):
        return measured.fails(above, place) == 0 and measured.fails(below, place) == 0

    def one_fails(measured, above, below, place):
        return (measured.fails(above, place) or 0) + (measured.fails(below, place) or 0) > 0

    say("Where no fail policy is called, planners with the more accurate model achieve better throughput.", forms,
        Pairs([("17", "16"), ("19", "18")], where=neither_fails))
    say("Optimal and suboptimal planners are close where both solve everything, as in random-64-64-10 (here: within 10 %, "
        "everywhere).", forms, Pairs([("16", "18"), ("17", "19")], kind="within", bound=0.1, where=neither_fails))
    say("The same in random-64-64-10 alone.", forms,
        Pairs([("16", "18"), ("17", "19")], kind="within", bound=0.1, where=neither_fails, only=["random-64-64-10"]))
    named = ["room-64-64-16", "warehouse-10-20-10-2-1"]
    say("Better models and optimality scale worse, as in room-64-64-16 and warehouse-10-20-10-2-1: more calls fail (where "
        "some do).", forms,
        Pairs([("17", "16"), ("19", "18"), ("16", "18"), ("17", "19")], column="fail_policy_ratio", where=one_fails,
              only=named))
    print()


def appendix_c(measured):
    print("## Appendix C: how long to plan\n")
    labels = periods(measured)
    table([measured], labels, {label: label for label in labels})
    for place in measured.places(labels):
        means = [mean(list(values.values())) for label in labels if (values := measured.values(label, place))]
        if len(means) > 1 and max(means) > 0:
            print(f"- *The curves are relatively flat.* {place[0]}, N = {place[1]}: the worst T is "
                  f"{100 * (1 - min(means) / max(means)):.0f} % below the best.")
    print()


def peers(rows):
    print("## Beside LSMART's own program\n")
    path = os.path.join(os.environ.get("FLEETYARD_DATA", ""), "peers", "lsmart.csv")
    if not os.path.exists(path):
        print("Its measured figures (`FLEETYARD_DATA/peers/lsmart.csv`) were not there.\n")
        return
    theirs = defaultdict(list)
    with open(path, newline="", encoding="utf-8") as file:
        for row in csv.DictReader(file):
            theirs[row["map"], row["planner"], int(row["agents"])].append(row)
    print("Its program (commit ce0a020) on two cores, windows of ten steps, a call every second, against ours with "
          "robots of its effective limits (`lsmart-effective`), the same windows, period and limit of 1 s, two seconds at a "
          "station. Where it was run for 60 or 120 s only (PIBT with 800 robots, RHCR with 200 and more) the beginning "
          "counts for more. It counts a goal when robots are *committed* to it; we count arrivals, and give both. Its "
          "RHCR is windowed PBS. Ours are as shipped ([planners](../planners.md#lanes)). An RTF of ours is given where the "
          "machine had nothing else to do.\n")
    print("| map | planner | N | its goals/s | its RTF | its fail calls | our goals/s | our committed/s | our RTF | our fail calls | contacts |")
    print("| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |")
    for (name, planner, agents), given in sorted(theirs.items()):
        of = lambda key: mean([float(row[key]) for row in given])
        calls = of("rule_based_fail_calls") / max(of("planner_invocations"), 1)
        ours = list(rows.cells.get((planner, name, agents), {}).values())
        right = ["–"] * 5
        if ours:
            quiet = [row["rtf"] for row in ours if not row["contended"]]
            right = [f"{mean([row['throughput_per_s'] for row in ours]):.2f}",
                     f"{mean([row['goals_committed'] / row['simulated_s'] for row in ours]):.2f}",
                     f"{mean(quiet):.0f}" if quiet else "–",
                     f"{100 * mean([row['fail_policy_ratio'] for row in ours]):.0f} %",
                     f"{sum(row['contacts'] for row in ours)}"]
        left = [f"{of('throughput_per_s'):.2f}", f"{of('rtf_wall'):.1f}", f"{100 * calls:.0f} %"]
        print(f"| {name} | {planner} | {agents} | " + " | ".join(left + right) + " |")
    print()


def main():
    folder = sys.argv[1] if len(sys.argv) > 1 else "target/lsmart"
    form = sys.argv[2] if len(sys.argv) > 2 else "reduced"
    kept = sys.argv[3] if len(sys.argv) > 3 else None
    twice = ("models", "windows", "generators")
    names = [*twice, "policies", "lns2", "lns", "peers", *(f"{name}-shipped" for name in twice)]
    rows = {name: Rows(folder, kept, f"{form}-{name}") for name in names}
    for part in rows.values():
        part.keep()
    paper = Measured([rows[name] for name in ("models", "windows", "generators", "policies")])
    shipped = Measured([rows[f"{name}-shipped"] for name in twice])
    both = [paper, shipped]
    print("# LSMART's experiments\n")
    print("Yan, Zhang, Liu, Zhang, Jiang, Chen, Smith and Li, \"Lifelong Scalable Multi-Agent Realistic Testbed and A "
          "Comprehensive Study on Design Choices in Lifelong AGV Fleet Management Systems\", 2026: nineteen setups, six "
          "experiments and an appendix, with our modules, planners and simulator ([fleets](../fleet.md)).\n")
    print("```sh\nscripts/lsmart             # the reduced form: three seeds, 300 s, a few team sizes\n"
          "scripts/lsmart --full --slurm '--partition short --time-limit 12h'    # ten seeds, 600 s, all maps and teams\n"
          "scripts/lsmart page        # this page\n```\n")
    all_rows = [row for part in rows.values() for row in part.rows.values()]
    if not all_rows:
        print(f"There are no rows of the {form} form.\n")
        return
    driven = sum(row["simulated_s"] * row["agents"] for row in all_rows)
    failed = sum(not row["success"] for row in all_rows)
    if disturbed := sum(part.disturbed for part in rows.values()):
        print(f"{disturbed} runs are left out: calls failed on a machine that had something else to do", file=sys.stderr)
    print(f"What follows was written by `scripts/lsmart_page.py` from {len(all_rows)} runs of the {form} form, seeds "
          f"{', '.join(map(str, sorted({row['seed'] for row in all_rows})))}: {driven / 3600:.0f} robot-hours, "
          f"{sum(row['contacts'] for row in all_rows)} contacts" + (f", {failed} runs that did not succeed" if failed else "") + ". "
          + f"The rows are in `docs/results/lsmart/`. Each cell is the mean throughput in goals per simulated second, the half "
          "of its 95 % t interval over seeds, and in brackets the share of calls that went to the fail policy, if any did; – "
          "is not measured. Where no call failed, a run is the same on any machine; a cell in which calls failed on a machine that "
          "had something else to do is left out.\n")
    print("**Verdicts.** The difference of two setups is taken for each seed, relative to the second one's mean, and averaged over "
          "the places (a map with a number of robots) that the claim is about, each weighing the same. Seeds are the "
          "unit: the interval is Student's 95 % over them. A claim is *confirmed* where the whole interval is on its side of "
          "its bound (0 for \"better\", −5 % for \"equal or better\", ±10 % for \"similar\"), *contradicted* where it is on the "
          "other, else *undecided*, with the number of seeds after which the interval would leave the bound out if mean and "
          "spread stayed as they are. Shares of failed calls are compared by their difference.\n")
    print("**What differs from the paper.** Setups *as in the paper* plan without charges for turns and lanes and without a "
          "distance from crowded goals, and commit robots to ⌈T/ε⌉ actions; *as shipped* they have what our planners do by "
          "default, and the cut by time. Starts are random cells facing north, goals random, as in the paper; the simulator is "
          "ours, with exact contacts instead of ARGoS, robots at the paper's nominal limits (2 m/s, 2 m/s², 45°/s), actions "
          "sent without delays. PBS, CBS, PP and LNS are our own. The reduced form has fewer seeds (3 of 10), "
          "shorter runs (300 of 600 s) and fewer team sizes, and leaves out maze-32-32-4 and empty-32-32. The limit of a planner "
          "is wall-clock time here as there, so that shares of failed calls depend on the machine.\n")
    print("**Maps.** warehouse-33-36 and empty-32-32 are cell by cell the paper's. warehouse-10-20-10-2-1 is MovingAI's without "
          "its wall, with [roles](../maps.md#warehouses) in the way of warehouse-33-36: where its authors put them is not "
          "published. The others are MovingAI's where `FLEETYARD_DATA` has them, else ours of the same kind and size.\n")
    experiment_1(both)
    experiment_2(both)
    experiment_3(both)
    experiment_4(Measured([rows["lns2"]]))
    experiment_5([Measured([rows["policies"]])])
    experiment_6(both)
    appendix_c(Measured([rows["lns"]]))
    peers(rows["peers"])


if __name__ == "__main__":
    main()
