#!/usr/bin/env python3
"""docs/results/lsmart.md from the stores that scripts/lsmart left: what LSMART's paper concludes,
beside what was measured here.

    python3 scripts/lsmart_page.py FOLDER [reduced | full] > docs/results/lsmart.md

Needs nothing but Python's own library. Every verdict follows from the rows by the rules below:
two setups differ where the 95 % interval of the difference of their means (Welch) leaves out zero.
"""

import csv
import math
import os
import sqlite3
import sys
from collections import defaultdict

SETUPS = {
    "1": "standard, periodic", "2": "standard, event-based",
    "3": "windowed W = P = 1 s, periodic", "4": "windowed W = 1 s, event-based",
    "5": "transient, periodic", "6": "transient, event-based",
    "7": "windowed W = P = 10 s, periodic", "8": "windowed W = 10 s, event-based",
    "9": "windowed W = P = 2 s", "10": "windowed W = P = 5 s",
    "12": "W = 1 s, LRGW", "13": "W = 1 s, guided PIBT",
    "14": "W = 10 s, LRGW", "15": "W = 10 s, guided PIBT",
    "16": "CBS, pebbles", "17": "CBS, turns", "18": "PP, pebbles", "19": "PP, turns",
}

# Two-sided 95 % quantiles of Student's t by degrees of freedom.
T95 = [12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228, 2.201, 2.179,
       2.160, 2.145, 2.131, 2.120, 2.110, 2.101, 2.093, 2.086]


def t95(freedom):
    if freedom < 1:
        return math.nan
    whole = int(freedom)
    return T95[whole - 1] if whole <= len(T95) else 1.96 + 2.5 / freedom


class Sample:
    """Values of one setup on one map with one number of robots, a value per seed."""

    def __init__(self, values):
        self.values = values
        self.n = len(values)
        self.mean = sum(values) / self.n
        spread = sum((value - self.mean) ** 2 for value in values)
        self.var = spread / (self.n - 1) if self.n > 1 else math.nan

    def half(self):
        return t95(self.n - 1) * math.sqrt(self.var / self.n) if self.n > 1 else math.nan


def compare(a, b):
    """1 where a is above b, -1 where it is below, 0 where the interval holds zero, None where
    there are too few values to tell."""
    if a is None or b is None or a.n < 2 or b.n < 2:
        return None
    terms = (a.var / a.n, b.var / b.n)
    error = math.sqrt(sum(terms))
    if error == 0:
        return (a.mean > b.mean) - (a.mean < b.mean)
    freedom = sum(terms) ** 2 / sum(term ** 2 / (s.n - 1) for term, s in zip(terms, (a, b)))
    difference = a.mean - b.mean
    if abs(difference) <= t95(freedom) * error:
        return 0
    return 1 if difference > 0 else -1


class Store:
    """Rows of a store by setup, map and number of robots."""

    def __init__(self, path):
        self.rows = []
        if os.path.exists(path):
            with sqlite3.connect(f"file:{path}?mode=ro", uri=True) as database:
                database.row_factory = sqlite3.Row
                self.rows = [dict(row) for row in database.execute("SELECT * FROM trials")]
        self.cells = defaultdict(list)
        for row in self.rows:
            self.cells[row["planner"], row["map"], row["agents"]].append(row)

    def sample(self, setup, at, column="throughput_per_s"):
        values = [row[column] for row in self.cells.get((setup, *at), []) if row[column] is not None]
        return Sample(values) if values else None

    def places(self):
        """Map and number of robots, in order."""
        return sorted({(row["map"], row["agents"]) for row in self.rows})


def number(value, digits=3):
    return "–" if value is None or math.isnan(value) else f"{value:.{digits}f}"


def cell(throughput, ratio):
    if throughput is None:
        return "–"
    half = throughput.half()
    spread = "" if math.isnan(half) else f" ± {half:.2f}"
    failed = "" if ratio is None else f" ({100 * ratio.mean:.0f} %)"
    return f"{throughput.mean:.2f}{spread}{failed}"


def table(store, setups, names):
    print("| map | N | " + " | ".join(names[setup] for setup in setups) + " |")
    print("| --- | ---: |" + " ---: |" * len(setups))
    for at in store.places():
        cells = [cell(store.sample(s, at), store.sample(s, at, "fail_policy_ratio")) for s in setups]
        if any(text != "–" for text in cells):
            print(f"| {at[0]} | {at[1]} | " + " | ".join(cells) + " |")
    print()


def agents_of(store, setups, where=None):
    """The smallest and largest team of every map that has these setups."""
    teams = defaultdict(list)
    for at in store.places():
        if all(store.sample(s, at) for s in setups) and (where is None or where in at[0]):
            teams[at[0]].append(at)
    return {name: (min(places), max(places)) for name, places in teams.items()}


def tally(pairs):
    """How often a claim held, failed and could not be told, from compare() turned so that 1 is
    for the claim."""
    known = [result for result in pairs if result is not None]
    return {
        "for": sum(result == 1 for result in known),
        "even": sum(result == 0 for result in known),
        "against": sum(result == -1 for result in known),
        "missing": len(pairs) - len(known),
    }


def count(found):
    if not any(found[key] for key in ("for", "even", "against")):
        return "not measured"
    return (f"of {sum(found.values())} comparisons {found['for']} for it, {found['even']} even, "
            f"{found['against']} against" + (f", {found['missing']} not measured" if found["missing"] else ""))


def verdict(found, share=0.2):
    """Confirmed where it nearly always holds, contradicted where it fails more often than it holds,
    else undecided, as after fewer than four comparisons."""
    known = found["for"] + found["even"] + found["against"]
    if known < 4:
        return "undecided"
    if found["against"] > max(found["for"], share * known):
        return "contradicted"
    if found["for"] >= (1 - share) * known:
        return "confirmed"
    return "undecided"


def say(claim, found):
    print(f"- *{claim}* **{verdict(found).capitalize()}**: {count(found)}.")


def above(store, a, b, at, column="throughput_per_s"):
    return compare(store.sample(a, at, column), store.sample(b, at, column))


def no_worse(store, a, b, at, column="throughput_per_s"):
    """1 where a is above b, or below it by no more than 5 %; -1 where it is surely below, else 0."""
    one, other = store.sample(a, at, column), store.sample(b, at, column)
    found = compare(one, other)
    if found == 0 and one.mean >= 0.95 * other.mean:
        return 1
    return found


def experiment_1(store):
    setups = ["1", "2", "3", "4", "5", "6"]
    print("## 1: instance generators\n")
    table(store, setups, SETUPS)
    places = [at for at in store.places() if any(store.sample(s, at) for s in setups)]
    pairs = [no_worse(store, w, o, at) for at in places for w, others in (("3", "15"), ("4", "26"))
             for o in others]
    say("The windowed setup consistently achieves equal or highest throughput.", tally(pairs))
    pairs = [no_worse(store, o, w, at, "fail_policy_ratio") for at in places
             for w, others in (("3", "15"), ("4", "26")) for o in others]
    say("It is asked for less, and so fails less: fewer calls go to the fail policy.", tally(pairs))
    pairs = [above(store, t, s, at) for at in places if "warehouse" in at[0]
             for t, s in (("5", "1"), ("6", "2"))]
    say("With few possible goals (warehouses) transient outperforms standard.", tally(pairs))
    pairs = [no_worse(store, s, t, at) for at in places if "warehouse" not in at[0]
             for t, s in (("5", "1"), ("6", "2"))]
    say("Elsewhere both are similar, or standard is slightly better.", tally(pairs))
    print()


def experiment_2(store):
    setups = ["3", "4", "7", "8"]
    print("## 2: when to plan\n")
    table(store, setups, SETUPS)
    places = [at for at in store.places() if any(store.sample(s, at) for s in setups)]
    similar = []
    for at in places:
        if "room" in at[0] or "warehouse-10" in at[0]:
            for p, e in (("3", "4"), ("7", "8")):
                a, b = store.sample(p, at), store.sample(e, at)
                near = a and b and abs(a.mean - b.mean) <= 0.1 * max(a.mean, b.mean, 1e-9)
                similar.append(None if not (a and b) else 1 if near else -1)
    say("In room-64-64-16 and warehouse-10-20-10-2-1 both policies are similar for the same W "
        "(here: within 10 %).", tally(similar))
    random = [at for at in places if "random" in at[0]]
    say("In random-64-64-10 with W = 1 s periodic is slightly better.",
        tally([above(store, "3", "4", at) for at in random]))
    say("In random-64-64-10 with W = 10 s event-based is better.",
        tally([above(store, "8", "7", at) for at in random]))
    print()


def experiment_3(store):
    setups = ["3", "9", "10", "7"]
    print("## 3: windows\n")
    table(store, setups, SETUPS)
    ends = agents_of(store, setups)
    say("With few robots (here: the smallest team of each map) frequent calls and short windows are better.",
        tally([above(store, "3", "7", few) for few, _ in ends.values()]))
    say("With many (the largest team) rare calls and long windows are better.",
        tally([above(store, "7", "3", many) for _, many in ends.values()]))
    print()


def periods(store):
    labels = {row["planner"] for row in store.rows}
    return sorted(labels, key=lambda label: float(label.split()[2]))


def experiment_4(store):
    print("## 4: how often to plan (setup 11)\n")
    labels = periods(store)
    table(store, labels, {label: label for label in labels})
    if len(labels) > 1:
        ends = agents_of(store, [labels[0], labels[-1]])
        # Calls that are much rarer than the shortest period but not of another kind.
        slow = labels[-1]
        fast = next((label for label in labels if float(label.split()[2]) >= 1), labels[0])
        open_maps = [many for name, (_, many) in ends.items() if "room" not in name]
        say(f"At high density a shorter period is better in random-64-64-10 and the warehouses (here: "
            f"{fast} against {slow}, largest teams).", tally([above(store, fast, slow, at) for at in open_maps]))
        low = [few for few, _ in ends.values()]
        even = [None if (r := above(store, fast, slow, at)) is None else 1 if r <= 0 else -1 for at in low]
        say("At low density it is not consistently so.", tally(even))
    print()


def experiment_5(store):
    setups = ["3", "12", "13", "7", "14", "15"]
    names = dict(SETUPS, **{"3": "W = 1 s, PIBT", "7": "W = 10 s, PIBT"})
    print("## 5: fail policies\n")
    table(store, setups, names)
    places = [at for at in store.places() if any(store.sample(s, at) for s in setups)]
    called = [at for at in places if any((r := store.sample(s, at, "fail_policy_ratio")) and r.mean > 0.01
                                         for s in setups)]
    best = []
    for at in called:
        for pibt, lrgw, guided in (("3", "12", "13"), ("7", "14", "15")):
            results = [above(store, guided, other, at) for other in (pibt, lrgw)]
            best.append(None if None in results else -1 if all(r == 1 for r in results) else 1)
    say("Guided PIBT is never the best (where a fail policy was called in 1 % of calls or more).", tally(best))
    say("LRGW is better than PIBT in random-64-64-10 with many robots.",
        tally([above(store, l, p, at) for at in called if "random" in at[0]
               for l, p in (("12", "3"), ("14", "7"))]))
    say("PIBT is better than LRGW in room-64-64-16.",
        tally([above(store, p, l, at) for at in called if "room" in at[0]
               for l, p in (("12", "3"), ("14", "7"))]))
    print()


def experiment_6(store):
    setups = ["16", "17", "18", "19"]
    print("## 6: optimality and the model\n")
    table(store, setups, SETUPS)
    places = [at for at in store.places() if any(store.sample(s, at) for s in setups)]

    def never_failed(setup, at):
        ratio = store.sample(setup, at, "fail_policy_ratio")
        return ratio is not None and ratio.mean == 0

    better = [above(store, turns, pebbles, at) for at in places
              for turns, pebbles in (("17", "16"), ("19", "18"))
              if never_failed(turns, at) and never_failed(pebbles, at)]
    say("Where no fail policy is called, planners with the more accurate model achieve better throughput.",
        tally(better))
    close = []
    for at in places:
        for optimal, fast in (("16", "18"), ("17", "19")):
            if never_failed(optimal, at) and never_failed(fast, at):
                a, b = store.sample(optimal, at), store.sample(fast, at)
                close.append(1 if abs(a.mean - b.mean) <= 0.1 * max(a.mean, b.mean, 1e-9) else -1)
    say("Optimal and suboptimal planners are close where both solve everything (here: within 10 %).", tally(close))
    scale = [above(store, more, less, at, "fail_policy_ratio") for at in places
             for more, less in (("17", "16"), ("19", "18"), ("16", "18"), ("17", "19"))]
    scale = [result for result in scale if result != 0]
    say("Better models and optimality scale worse: they fail more often (where one failed more than the other).",
        tally(scale))
    print()


def appendix_c(store):
    print("## Appendix C: how long to plan\n")
    labels = periods(store)
    table(store, labels, {label: label for label in labels})
    flat = []
    for at in store.places():
        means = [sample.mean for label in labels if (sample := store.sample(label, at))]
        if len(means) > 1:
            flat.append(1 if max(means) - min(means) <= 0.2 * max(max(means), 1e-9) else -1)
    say("The curves are relatively flat: for an anytime planner T hardly matters (here: within 20 % over all T).",
        tally(flat))
    print()


def peers(store):
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
          "RHCR is windowed PBS. Other than in the experiments above, ours keep to lanes and away from crowded goals "
          "([planners](../planners.md#lanes)), as they do unless they are told otherwise.\n")
    print("| map | planner | N | its goals/s | its RTF | its fail calls | our goals/s | our committed/s | our RTF | our fail calls | contacts |")
    print("| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |")
    for (name, planner, agents), rows in sorted(theirs.items()):
        mean = lambda key: sum(float(row[key]) for row in rows) / len(rows)
        calls = mean("rule_based_fail_calls") / max(mean("planner_invocations"), 1)
        at = (name, agents)
        ours = store.cells.get((planner, *at), [])
        if ours:
            of = lambda key: sum(row[key] for row in ours) / len(ours)
            committed = sum(row["goals_committed"] / row["simulated_s"] for row in ours) / len(ours)
            right = [number(of("throughput_per_s"), 2), number(committed, 2), number(of("rtf"), 1),
                     f"{100 * of('fail_policy_ratio'):.0f} %", f"{of('contacts'):.0f}"]
        else:
            right = ["–"] * 5
        left = [number(mean("throughput_per_s"), 2), number(mean("rtf_wall"), 1), f"{100 * calls:.0f} %"]
        print(f"| {name} | {planner} | {agents} | " + " | ".join(left + right) + " |")
    print()


def main():
    folder = sys.argv[1] if len(sys.argv) > 1 else "target/lsmart"
    form = sys.argv[2] if len(sys.argv) > 2 else "reduced"
    store = {name: Store(os.path.join(folder, f"{form}-{name}.sqlite"))
             for name in ("pbs", "models", "lns2", "lns", "peers")}
    print("# LSMART's experiments\n")
    print("Yan, Zhang, Liu, Zhang, Jiang, Chen, Smith and Li, \"Lifelong Scalable Multi-Agent Realistic Testbed and A "
          "Comprehensive Study on Design Choices in Lifelong AGV Fleet Management Systems\", 2026: nineteen setups, six "
          "experiments and an appendix, with our modules, planners and simulator ([fleets](../fleet.md)).\n")
    print("```sh\nscripts/lsmart             # the reduced form: two seeds, 120 s, two team sizes; about an hour on two cores\n"
          "scripts/lsmart --full --slurm '--partition short --time-limit 12h'    # ten seeds, 600 s, all maps and teams\n"
          "scripts/lsmart page        # this page\n```\n")
    rows = [row for one in store.values() for row in one.rows]
    if rows:
        seeds = sorted({row["seed"] for row in rows})
        contacts = sum(row["contacts"] or 0 for row in rows)
        driven = sum((row["simulated_s"] or 0) * row["agents"] for row in rows)
        failed = sum(not row["success"] for row in rows)
        machines = len({row["machine"] for row in rows})
        print(f"What follows was written by `scripts/lsmart_page.py` from {len(rows)} runs of the {form} form, seeds "
              f"{', '.join(map(str, seeds))}, on {machines} machine{'s' if machines != 1 else ''}: "
              f"{driven / 3600:.0f} robot-hours, {contacts} contacts"
              + (f", {failed} runs that did not succeed" if failed else "") + ".")
    else:
        print(f"There are no stores of the {form} form in the folder that this page was written from.")
    print("Each cell is the mean throughput in goals per simulated second, the half of its 95 % t interval over seeds, and in "
          "brackets the share of calls that went to the fail policy; – is not measured.\n")
    print("Verdicts follow from the rows by a rule: two setups differ where Welch's 95 % interval of the difference leaves out "
          "zero; where a claim allows equality, means within 5 % are for it as well. A claim is *confirmed* where there are at "
          "least four comparisons and four fifths of them are for it, *contradicted* where more are against it than for it "
          "and more than a fifth, else *undecided*. With two seeds only large differences show.\n")
    print("Maps: warehouse-33-36 and empty-32-32 are cell by cell the paper's. warehouse-10-20-10-2-1 is MovingAI's without "
          "its wall, with [roles](../maps.md#warehouses) in the way of warehouse-33-36: where its authors put them is not "
          "published. The others are MovingAI's where `FLEETYARD_DATA` has them, else ours of the same kind and size. Planners "
          "have their limit in wall-clock time, so that figures of a loaded machine are worse than those of a quiet one.\n")
    experiment_1(store["pbs"])
    experiment_2(store["pbs"])
    experiment_3(store["pbs"])
    experiment_4(store["lns2"])
    experiment_5(store["pbs"])
    experiment_6(store["models"])
    appendix_c(store["lns"])
    peers(store["peers"])


if __name__ == "__main__":
    main()
