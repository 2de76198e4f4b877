#!/usr/bin/env python3
"""docs/results/lsmart.md from the stores that scripts/lsmart left: what LSMART's paper concludes,
beside what was measured here.

    python3 scripts/lsmart_page.py FOLDER [reduced | full] [KEPT] > docs/results/lsmart.md
    python3 scripts/lsmart_page.py rows FOLDER      # the rows of its stores, as CSV, each with its store's name

Needs nothing but Python's own library and what stands beside it. Rows that figures come from are kept as CSV in the folder KEPT,
so that measuring can go on in parts: a row of a store takes the place of the same row that was kept.
Every verdict follows from the rows by the rules that the page states.
"""

import csv
import json
import math
import os
import sqlite3
import sys
from collections import defaultdict
from xml.sax.saxutils import escape

from figures import COLOURS, picture
from verdicts import MARGIN, Claim, Seeds, judge, log_odds, spread

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
           "fail_policy_ratio", "contacts", "success", "rtf", "contended", "machine", "planner_digest", "trace_digest",
           "nodes", "limit_s", "suite_digest"]

# Seeds by which the best of several setups is chosen.
CHOOSING = 3

# What else says if the clock took part in a row.
CLOCK = ["planner_call_max_ms", "planner_limit_ms"]

# Planners that use up their limit by design: their plans depend on what else the machine does.
ANYTIME = ("lns", "lns2")

def mean(values):
    return sum(values) / len(values)


def numbers(row):
    """A row of a CSV file with the types that a store has."""
    for column in ("agents", "seed", "contacts", "success", "goals_committed", "planner_calls"):
        row[column] = int(row[column])
    for column in ("throughput_per_s", "simulated_s", "fail_policy_ratio", "rtf"):
        row[column] = float(row[column])
    # What older rows do not say.
    for column, kind in (("nodes", int), ("limit_s", float)):
        row[column] = kind(row[column]) if row.get(column) else None
    row.setdefault("suite_digest", "")
    return row


def stored(path):
    """Rows of a store, with what is asked of the clock, and its machines by digest."""
    own = [column for column in COLUMNS if column not in ("nodes", "limit_s", "suite_digest")]
    with sqlite3.connect(f"file:{path}?mode=ro", uri=True) as database:
        database.row_factory = sqlite3.Row
        found = [dict(row) for row in database.execute(f"SELECT {', '.join([*own, *CLOCK, 'fleet'])} FROM trials WHERE current = 1")]
        suite, = database.execute("SELECT value FROM meta WHERE name = 'suite_digest'").fetchone()
        machines = {digest: description for digest, description in database.execute("SELECT digest, description FROM machines")}
    for row in found:
        asked = json.loads(row["fleet"])
        row.update(nodes=asked["allowance"]["nodes"], limit_s=asked["limit_s"], suite_digest=suite)
    return found, machines


def print_rows(folder):
    writer = csv.DictWriter(sys.stdout, ["store", *COLUMNS, *CLOCK], extrasaction="ignore", lineterminator="\n")
    writer.writeheader()
    for name in sorted(os.listdir(folder)):
        if name.endswith(".sqlite"):
            writer.writerows({"store": name.removesuffix(".sqlite"), **row} for row in stored(os.path.join(folder, name))[0])


class Rows:
    """Rows of one experiment by setup, map and number of robots, then by seed."""

    def __init__(self, folder, kept, name):
        self.rows, self.machines = {}, {}
        self.disturbed = 0
        self.path = os.path.join(kept, f"{name}.csv") if kept else None
        if self.path and os.path.exists(self.path):
            with open(self.path, newline="", encoding="utf-8") as file:
                for row in csv.DictReader(file):
                    self.take(numbers(row))
        store = os.path.join(folder, f"{name}.sqlite")
        if os.path.exists(store):
            anytime = name.split("-")[1] in ANYTIME
            found, self.machines = stored(store)
            # A call that failed for want of time, on a machine that had something else to do, says
            # nothing of the planner. The cell is left out as a whole: seeds are no choice. Calls that
            # failed for want of search nodes fail on any machine.
            cell = lambda row: (row["planner"], row["map"], row["agents"])
            met = lambda row: row["planner_call_max_ms"] is None or row["planner_call_max_ms"] >= 0.95 * row["planner_limit_ms"]
            timed = lambda row: anytime or (row["fail_policy_ratio"] != 0 and met(row))
            doubtful = {cell(row) for row in found
                        if row["throughput_per_s"] is None or (timed(row) and row["contended"])}
            for row in found:
                if cell(row) in doubtful:
                    self.disturbed += 1
                else:
                    self.take({column: row[column] for column in COLUMNS})
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

    def by_seed(self, setup, place):
        return self.cells.get((setup, *place), {})

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
        """The share of calls that failed; None where it was not measured."""
        cell = self.by_seed(setup, place)
        return mean([row["fail_policy_ratio"] for row in cell.values()]) if cell else None

    def throughput(self, setup, place, seeds):
        """Mean over some seeds; nothing of a setup that has none of them."""
        found = [row["throughput_per_s"] for seed, row in self.by_seed(setup, place).items() if seed in seeds]
        return mean(found) if found else 0.0


def percent(difference):
    """Of a difference of logarithms."""
    rounded = round(100 * math.expm1(difference))
    return f"{'+' if rounded > 0 else '−' if rounded < 0 else ''}{abs(rounded)} %"


def by_throughput(above, below):
    """ln of the ratio of goals; half a goal keeps it finite where there are none."""
    goals = lambda row: row["throughput_per_s"] * row["simulated_s"] + 0.5
    return math.log(goals(above) / goals(below))


def by_failures(above, below):
    odds = lambda row: log_odds(row["fail_policy_ratio"] * row["planner_calls"], row["planner_calls"])
    return odds(above) - odds(below)


class Effect:
    """Differences of two setups by cell and seed."""

    def __init__(self):
        self.cells = {}

    def add(self, name, above, below, difference):
        """A cell: rows by seed of what is claimed to be above, and of the other."""
        seeds = above.keys() & below.keys()
        if seeds:
            self.cells[name] = {seed: difference(above[seed], below[seed]) for seed in sorted(seeds)}

    def by_seed(self):
        """For each seed that all cells have, the mean over cells, which weigh the same."""
        if not self.cells:
            return []
        seeds = set.intersection(*(set(cell) for cell in self.cells.values()))
        return [mean([cell[seed] for cell in self.cells.values()]) for seed in sorted(seeds)]


# The two forms in which setups are run.
FORMS = ("as in the paper", "as shipped")


class Said:
    """A claim of the paper, and what there is about it in each form."""

    def __init__(self, text, kind, effects, odds, maps):
        self.text, self.kind, self.effects, self.odds, self.maps = text, kind, effects, odds, maps
        self.claims = [Claim(kind, effect.by_seed()) for effect in effects]

    def tell(self, verdicts):
        told = []
        for name, effect, claim, verdict in zip(FORMS, self.effects, self.claims, verdicts):
            if verdict == "not measured":
                if name == FORMS[0]:
                    told.append(f"{name} **not measured**")
                continue
            size = self.size(claim)
            missing = [one for one in self.maps if not any(one in cell for cell in effect.cells)]
            if missing:
                verdict, size = "undecided", f"there is nothing from {' and '.join(missing)}; elsewhere {size}"
            size += f", {len(effect.cells)} cells" if len(effect.cells) != 1 else ", 1 cell"
            size += f", {claim.seeds.n} seed{'s' if claim.seeds.n != 1 else ''}"
            if verdict == "undecided":
                needed = claim.seeds_needed()
                size += f"; {needed} would decide" if needed else "; none would decide"
            told.append(f"{name} **{verdict}** ({size})")
        line = "; ".join(told)
        print(f"- *{self.text}* {line[0].upper()}{line[1:]}.")

    def size(self, claim):
        show = (lambda value: f"{math.exp(value):.2f}") if self.odds else percent
        low, high = claim.seeds.interval()
        size = show(claim.seeds.mean) + (f" [{show(low)}, {show(high)}]" if math.isfinite(low) else "")
        return f"odds × {size}" if self.odds else size


class Page:
    """What is printed when all claims are known, so that they are corrected together."""

    def __init__(self):
        self.parts = []

    def text(self, *lines):
        self.parts.extend(lines)

    def say(self, text, kind, forms, effect, odds=False, maps=()):
        self.parts.append(Said(text, kind, [effect(measured) for measured in forms], odds, maps))

    def said(self):
        return [part for part in self.parts if isinstance(part, Said)]

    def print(self):
        said = self.said()
        by_form = [judge([one.claims[form] for one in said if form < len(one.claims)]) for form in range(len(FORMS))]
        verdicts = [iter(found) for found in by_form]
        for part in self.parts:
            if isinstance(part, Said):
                part.tell([next(verdicts[form]) for form in range(len(part.claims))])
            else:
                print(part)


def pairs(setups, only=None, ends=None, where=None, difference=by_throughput):
    """The effect of the first of each pair of setups over the second, at all places or those of some
    maps, or at the smallest ("few") or largest ("many") teams."""
    def effect(measured):
        found = Effect()
        names = sorted({setup for pair in setups for setup in pair})
        if ends is None:
            places = measured.places(names, only)
        else:
            places = measured.ends(names, only)[0 if ends == "few" else 1]
        for place in places:
            for above, below in setups:
                if where is None or where(measured, above, below, place):
                    found.add(f"{place[0]} N = {place[1]}: {above} over {below}", measured.by_seed(above, place),
                              measured.by_seed(below, place), difference)
        return found
    return effect


def against_best(setups, never=False, where=None):
    """The effect of a setup over the best of some others at each place; turned, if it is claimed never
    to be the best. The best is chosen by the first seeds, which are left out of what is compared: the
    largest of several equals lies above them by luck."""
    def effect(measured):
        found = Effect()
        for setup, others in setups:
            for place in measured.places([setup]):
                rivals = [other for other in others if measured.by_seed(other, place)]
                if len(rivals) < len(others) or (where and not where(measured, setup, place)):
                    continue
                seeds = sorted(measured.by_seed(setup, place))
                choosing, compared = (seeds[:CHOOSING], seeds[CHOOSING:]) if len(seeds) > CHOOSING else (seeds, seeds)
                best = max(rivals, key=lambda other: measured.throughput(other, place, choosing))
                above, below = (best, setup) if never else (setup, best)
                rows = lambda one: {seed: row for seed, row in measured.by_seed(one, place).items() if seed in compared}
                found.add(f"{place[0]} N = {place[1]}: {above} over {below}", rows(above), rows(below), by_throughput)
        return found
    return effect


def one_fails(measured, above, below, place):
    return (measured.fails(above, place) or 0) + (measured.fails(below, place) or 0) > 0


def cell(measured, setup, place):
    rows = measured.by_seed(setup, place).values()
    if not rows:
        return "–"
    seeds = Seeds([row["throughput_per_s"] for row in rows])
    spread = "" if seeds.n < 2 else f"±{seeds.interval()[1] - seeds.mean:.2f}"
    fails = measured.fails(setup, place)
    return f"{seeds.mean:.2f}{spread}" + (f" ({100 * fails:.0f}%)" if fails else "")


def table(page, forms, setups, names=SETUPS):
    if not any(measured.places(setups) for measured in forms):
        page.text("Not measured yet.\n")
        return
    several = len(forms) > 1
    page.text("| map | N |" + (" setups |" if several else "") + " " + " | ".join(names[setup] for setup in setups) + " |",
              "| --- | ---: |" + (" --- |" if several else "") + " ---: |" * len(setups))
    for place in sorted({place for measured in forms for place in measured.places(setups)}):
        for name, measured in zip(("paper", "shipped"), forms):
            if any(measured.by_seed(setup, place) for setup in setups):
                cells = [cell(measured, setup, place) for setup in setups]
                page.text(f"| {place[0]} | {place[1]} |" + (f" {name} |" if several else "") + " " + " | ".join(cells) + " |")
    page.text("")


def best(page, forms, groups):
    """The best of several setups in each group, by name of the group."""
    setups = [setup for group in groups.values() for setup in group]
    if not any(measured.places(setups) for measured in forms):
        page.text("Not measured yet.\n")
        return
    page.text("| map | N | setups | " + " | ".join(groups) + " |", "| --- | ---: | --- |" + " ---: |" * len(groups))
    for place in sorted({place for measured in forms for place in measured.places(setups)}):
        for name, measured in zip(("paper", "shipped"), forms):
            cells = []
            for group in groups.values():
                tried = [setup for setup in group if measured.by_seed(setup, place)]
                rate = lambda setup: mean([row["throughput_per_s"] for row in measured.by_seed(setup, place).values()])
                first = max(tried, key=rate, default=None)
                cells.append(f"{first}: {cell(measured, first, place)}" if tried else "–")
            if any(found != "–" for found in cells):
                page.text(f"| {place[0]} | {place[1]} | {name} | " + " | ".join(cells) + " |")
    page.text("")


def write_cells(path, parts):
    """A line for every setup on every map with every number of robots."""
    with open(path, "w", newline="", encoding="utf-8") as file:
        out = csv.writer(file, lineterminator="\n")
        out.writerow(["setups", "setup", "map", "agents", "seeds", "throughput_per_s", "half_interval", "fail_policy_ratio"])
        for name, measured in parts:
            for setup, *place in sorted(measured.cells):
                rows = measured.by_seed(setup, tuple(place)).values()
                if rows:
                    seeds = Seeds([row["throughput_per_s"] for row in rows])
                    half = f"{seeds.interval()[1] - seeds.mean:.3f}" if seeds.n > 1 else ""
                    out.writerow([name, setup, *place, seeds.n, f"{seeds.mean:.3f}", half, f"{measured.fails(setup, tuple(place)):.3f}"])


def experiments_1_to_3(page, forms):
    page.text("## 1 to 3: instance generators, when to plan, windows\n")
    page.text("The best setup of each kind, by its number. 2, 4, 6 and 8 plan event-based, the others periodically; W = P is 1 s in 3, 2 s in 9, 5 s "
              "in 10 and 10 s in 7, W 1 s in 4 and 10 s in 8.\n")
    best(page, forms, {"standard": ["1", "2"], "transient": ["5", "6"], "windowed": ["3", "4", "7", "8", "9", "10"]})
    experiment_1(page, forms)
    experiment_2(page, forms)
    experiment_3(page, forms)


def experiment_1(page, forms):
    page.text("Instance generators:\n")
    page.say("The windowed setup consistently achieves equal or highest throughput.", "no worse", forms,
             against_best([("3", "15"), ("4", "26")]))
    page.say("It is asked for less, and so fails less: fewer calls go to the fail policy.", "better", forms,
             pairs([("1", "3"), ("5", "3"), ("2", "4"), ("6", "4")], where=one_fails, difference=by_failures), odds=True)
    page.say("In warehouse-10-20-10-2-1, with few possible goals, transient outperforms standard.", "better", forms,
             pairs([("5", "1"), ("6", "2")], only=["warehouse-10-20-10-2-1"]))
    page.say("In room-64-64-16 both are similar.", "similar", forms,
             pairs([("5", "1"), ("6", "2")], only=["room-64-64-16"]))
    page.say("In random-64-64-10 standard is slightly better.", "better", forms,
             pairs([("1", "5"), ("2", "6")], only=["random-64-64-10"]))
    page.text("")


def experiment_2(page, forms):
    page.text("When to plan:\n")
    named = ["room-64-64-16", "warehouse-10-20-10-2-1"]
    page.say("In room-64-64-16 and warehouse-10-20-10-2-1 both policies are similar for the same W.", "similar", forms,
             pairs([("3", "4"), ("7", "8")], only=named), maps=named)
    page.say("In random-64-64-10 with W = 1 s periodic is slightly better.", "better", forms,
             pairs([("3", "4")], only=["random-64-64-10"]))
    page.say("In random-64-64-10 with W = 10 s event-based is better.", "better", forms,
             pairs([("8", "7")], only=["random-64-64-10"]))
    page.text("")


def experiment_3(page, forms):
    page.text("Windows:\n")
    page.say("With few robots (here: the smallest team of each map) frequent calls and short windows are better: W = 1 s "
             "against 10 s.", "better", forms, pairs([("3", "7")], ends="few"))
    page.say("With many (the largest team) rare calls and long windows are better: W = 10 s against 1 s.", "better", forms,
             pairs([("7", "3")], ends="many"))
    page.text("")


def periods(measured):
    return sorted({key[0] for key in measured.cells}, key=lambda label: float(label.split()[2]))


def experiment_4(page, measured):
    page.text("## 4: how often to plan (setup 11)\n")
    labels = periods(measured)
    table(page, [measured], labels, {label: label for label in labels})
    if len(labels) > 1:
        slow = labels[-1]
        fast = next((label for label in labels if float(label.split()[2]) >= 1), labels[0])
        named = ["random-64-64-10", "warehouse-10-20-10-2-1"]
        page.say(f"At high density a shorter period is better in random-64-64-10 and warehouse-10-20-10-2-1 (here: {fast} "
                 f"against {slow}, largest teams).", "better", [measured], pairs([(fast, slow)], only=named, ends="many"),
                 maps=named)
        page.say("In room-64-64-16 it is not.", "no worse", [measured], pairs([(slow, fast)], only=["room-64-64-16"]))
        page.say("At lower densities (here: the smallest teams) it is not either.", "no worse", [measured],
                 pairs([(slow, fast)], ends="few"))
        page.text("")


def experiment_5(page, forms, kept):
    page.text("## 5: fail policies\n")
    setups = ["3", "12", "13", "7", "14", "15"]
    picture = curves(forms[0], setups)
    if picture and kept:
        with open(os.path.join(kept, "policies.svg"), "w", encoding="utf-8") as out:
            out.write(picture)
        page.text("![Throughput and calls of fail policies by number of robots](lsmart/policies.svg)\n")
    table(page, forms, setups, dict(SETUPS, **{"3": "3: W = 1 s, PIBT", "7": "7: W = 10 s, PIBT"}))

    def called(measured, setup, place):
        return (measured.fails(setup, place) or 0) > 0.01

    def either(measured, above, below, place):
        return called(measured, above, place) or called(measured, below, place)

    page.say("Guided PIBT is never the best (here: the better of the other two is above it, where a fail policy is called in "
             "more than 1 % of calls).", "better", forms,
             against_best([("13", ["3", "12"]), ("15", ["7", "14"])], never=True, where=called))
    page.say("LRGW is better than PIBT in random-64-64-10 with many robots (where either is called).", "better", forms,
             pairs([("12", "3"), ("14", "7")], only=["random-64-64-10"], where=either))
    page.say("PIBT is better than LRGW in room-64-64-16 (where either is called).", "better", forms,
             pairs([("3", "12"), ("7", "14")], only=["room-64-64-16"], where=either))
    page.text("")


# Fail policies under disturbances, each with the setup that has it without them.
DISTURBED = {"all-wait": None, "rule-based": None, "pibt": "3", "guided-pibt": "13", "lrgw": "12"}


def under_disturbances(page, calm, measured):
    page.text("## Under disturbances\n")
    places = measured.places(DISTURBED)
    if not places:
        page.text("Not measured yet.\n")
        return
    rows = [row for key, found in measured.cells.items() if key[0] in DISTURBED for row in found.values()]
    told = []
    for policy, setup in DISTURBED.items():
        lost = Effect()
        for place in places if setup else []:
            lost.add(place, measured.by_seed(policy, place), calm.by_seed(setup, place), by_throughput)
        if by_seed := lost.by_seed():
            seeds = Seeds(by_seed)
            low, high = seeds.interval()
            told.append((seeds.mean, f"{policy} {percent(seeds.mean)}"
                         + (f" [{percent(low)}, {percent(high)}]" if math.isfinite(low) else "")))
    page.text("Not in the paper: setup 3 with each fail policy, where actions begin 2 s late with probability 0.1, speeds vary in each "
              "block by a normal deviate of 20 %, down to 30 %, and messages take up to 0.5 s or are lost with probability 0.2 "
              "([execution](../execution.md)). "
              + (f"Losses of throughput against the same without (section 5, the same cells and seeds): {', '.join(text for _, text in sorted(told))}. "
                 if told else "")
              + f"In {sum(row['simulated_s'] * row['agents'] for row in rows) / 3600:.0f} robot-hours there were "
              f"{sum(row['contacts'] for row in rows)} contacts.\n")
    table(page, [measured], list(DISTURBED), {policy: policy for policy in DISTURBED})


def experiment_6(page, forms):
    page.text("## 6: optimality and the model\n")
    table(page, forms, ["16", "17", "18", "19"])

    def neither_fails(measured, above, below, place):
        return measured.fails(above, place) == 0 and measured.fails(below, place) == 0

    page.say("Where no fail policy is called, planners with the more accurate model achieve better throughput.", "better",
             forms, pairs([("17", "16"), ("19", "18")], where=neither_fails))
    page.say("Optimal and suboptimal planners are close where both solve everything.", "similar", forms,
             pairs([("16", "18"), ("17", "19")], where=neither_fails))
    page.say("They are close in random-64-64-10.", "similar", forms,
             pairs([("16", "18"), ("17", "19")], where=neither_fails, only=["random-64-64-10"]))
    page.say("Better models and optimality scale worse, as in room-64-64-16 and warehouse-10-20-10-2-1: more calls fail (where "
             "some do).", "better", forms,
             pairs([("17", "16"), ("19", "18"), ("16", "18"), ("17", "19")], where=one_fails, difference=by_failures,
                   only=["room-64-64-16", "warehouse-10-20-10-2-1"]), odds=True)
    page.text("")


def appendix_c(page, measured):
    page.text("## Appendix C: how long to plan\n")
    labels = periods(measured)
    table(page, [measured], labels, {label: label for label in labels})
    if len(labels) > 1:
        page.say("The curves are relatively flat: the longest T is no better than the shortest.", "similar", [measured],
                 pairs([(labels[-1], labels[0])]))
        page.text("")


def forest(said, form):
    """An SVG picture of the effects on throughput: a line for every cell of every claim, with the
    claim's own below."""
    width, left, line, low, high = 900, 430, 16, math.log(0.5), math.log(2)
    x = lambda value: left + (min(max(value, low), high) - low) / (high - low) * (width - left - 20)
    out, y = [], 40
    for one in said:
        if one.odds or form >= len(one.effects) or not one.effects[form].cells:
            continue
        title = one.text if len(one.text) < 110 else one.text[:108] + "…"
        out.append(f'<text x="10" y="{y}" class="claim">{escape(title)}</text>')
        y += line
        lines = [(name, list(cell.values()), "cell") for name, cell in one.effects[form].cells.items()]
        for name, values, kind in [*lines, ("all, by seed", one.effects[form].by_seed(), "all")]:
            if not values:
                continue
            seeds = Seeds(values)
            start, end = seeds.interval()
            out.append(f'<text x="{left - 12}" y="{y}" text-anchor="end">{escape(name)}</text>'
                       f'<path class="{kind}" d="M{x(start):.1f} {y - 4}H{x(end):.1f}"/>'
                       f'<circle class="{kind}" cx="{x(seeds.mean):.1f}" cy="{y - 4}" r="{4 if kind == "all" else 3}"/>')
            y += line
        y += line // 2
    if not out:
        return None
    axis = []
    for ratio in (0.5, 0.75, 1, 1.25, 1.5, 2):
        at = x(math.log(ratio))
        axis.append(f'<path class="{"even" if ratio == 1 else "axis"}" d="M{at:.1f} 22V{y}"/>'
                    f'<text x="{at:.1f}" y="16" text-anchor="middle">× {ratio}</text>')
    margin = [x(-MARGIN), x(MARGIN)]
    style = (".claim{font-weight:bold}path{stroke:#4477aa;stroke-width:1.5;fill:none}circle{fill:#4477aa}"
             ".all{stroke:#cc3311}circle.all{fill:#cc3311}.axis{stroke:#ddd;stroke-width:1}"
             ".even{stroke:#888;stroke-width:1}.similar{fill:#f2f2ea}")
    similar = f'<rect class="similar" x="{margin[0]:.1f}" y="22" width="{margin[1] - margin[0]:.1f}" height="{y - 22}"/>'
    return picture(f"Effects on throughput, {FORMS[form]}, with 95 % intervals", width, y + 10,
                   similar + "".join(axis) + "\n".join(out), style, ".similar{fill:#2a2a26}.axis{stroke:#3a3a3a}")


def peers(page, rows):
    page.text("## Beside LSMART's own program\n")
    path = os.path.join(os.environ.get("FLEETYARD_DATA", ""), "peers", "lsmart.csv")
    if not os.path.exists(path):
        page.text("Its measured figures (`FLEETYARD_DATA/peers/lsmart.csv`) were not there.\n")
        return
    theirs = defaultdict(list)
    with open(path, newline="", encoding="utf-8") as file:
        for row in csv.DictReader(file):
            theirs[row["map"], row["planner"], int(row["agents"])].append(row)
    page.text("Its program (commit ce0a020) on two cores, windows of ten steps, a call every second, two seconds at a station; runs of "
          "60 or 120 s only for PIBT with 800 robots and RHCR (windowed PBS) with 200 and more. It counts a goal when robots are "
          "*committed* to it."
          + (" Ours as shipped, with robots of its effective limits (`lsmart-effective`): goals are arrivals, and an RTF is given "
             "where the machine had nothing else to do." if rows.cells else "") + "\n")
    head = ["map", "planner", "N", "its goals/s", "its RTF", "its fail calls"]
    if rows.cells:
        head += ["our goals/s", "our committed/s", "our RTF", "our fail calls", "contacts"]
    page.text("| " + " | ".join(head) + " |", "| --- | --- |" + " ---: |" * (len(head) - 2))
    for (name, planner, agents), given in sorted(theirs.items()):
        of = lambda key: mean([float(row[key]) for row in given])
        calls = of("rule_based_fail_calls") / max(of("planner_invocations"), 1)
        ours = list(rows.cells.get((planner, name, agents), {}).values())
        right = ["–"] * 5 if rows.cells else []
        if ours:
            quiet = [row["rtf"] for row in ours if not row["contended"]]
            right = [f"{mean([row['throughput_per_s'] for row in ours]):.2f}",
                     f"{mean([row['goals_committed'] / row['simulated_s'] for row in ours]):.2f}",
                     f"{mean(quiet):.0f}" if quiet else "–",
                     f"{100 * mean([row['fail_policy_ratio'] for row in ours]):.0f}%",
                     f"{sum(row['contacts'] for row in ours)}"]
        left = [f"{of('throughput_per_s'):.2f}", f"{of('rtf_wall'):.1f}", f"{100 * calls:.0f}%"]
        page.text(f"| {name} | {planner} | {agents} | " + " | ".join(left + right) + " |")
    page.text()


def curves(measured, setups):
    """An SVG picture of throughput, and of the share of calls that went to the fail policy, against the number of robots:
    a column for every map, a line for every setup with its 95 % t interval over seeds."""
    found = defaultdict(lambda: defaultdict(dict))
    for (setup, name, agents), cell in measured.cells.items():
        if setup in setups:
            found[name][setup][agents] = list(cell.values())
    found = {name: lines for name, lines in found.items() if any(len(line) > 1 for line in lines.values())}
    if not found:
        return None
    wide, high, left, top, gap = 200, 150, 50, 40, 60
    colours = dict(zip(setups, COLOURS))
    out = []
    for column, name in enumerate(sorted(found)):
        lines = found[name]
        sizes = sorted({agents for line in lines.values() for agents in line})
        x0 = left + column * (wide + gap)
        x = lambda agents: x0 + (agents - sizes[0]) / max(1, sizes[-1] - sizes[0]) * wide
        out.append(f'<text x="{x0 + wide / 2}" y="{top - 22}" text-anchor="middle" class="name">{escape(name)}</text>')
        for row, (title, of) in enumerate((("goals/s", lambda run: run["throughput_per_s"]),
                                           ("calls to the fail policy, %", lambda run: 100 * run["fail_policy_ratio"]))):
            y0 = top + row * (high + gap)
            points = {setup: [(agents, *spread([of(run) for run in line[agents]])) for agents in sorted(line)]
                      for setup, line in lines.items()}
            most = 100 if row else max(high_end for line in points.values() for _, _, _, high_end in line) or 1
            y = lambda value: y0 + high - min(max(value, 0), most) / most * high
            out.append(f'<path class="axis" d="M{x0} {y0}V{y0 + high}H{x0 + wide}"/>')
            if not column:
                out.append(f'<text x="{x0 - 40}" y="{y0 - 8}">{title}</text>')
            for value in (0, most / 2, most):
                out.append(f'<text x="{x0 - 6}" y="{y(value) + 4:.1f}" text-anchor="end">{value:.3g}</text>')
            for agents in sizes:
                out.append(f'<text x="{x(agents):.1f}" y="{y0 + high + 16}" text-anchor="middle">{agents}</text>')
            for setup in setups:
                line = points.get(setup)
                if not line:
                    continue
                band = [(a, h) for a, _, _, h in line] + [(a, l) for a, _, l, _ in reversed(line)]
                joined = lambda pairs: " ".join(f"{x(a):.1f},{y(v):.1f}" for a, v in pairs)
                out.append(f'<polygon points="{joined(band)}" fill="{colours[setup]}" fill-opacity=".13"/>'
                           f'<polyline points="{joined([(a, m) for a, m, _, _ in line])}" stroke="{colours[setup]}"/>'
                           + "".join(f'<circle cx="{x(a):.1f}" cy="{y(m):.1f}" r="2.5" fill="{colours[setup]}"/>'
                                     for a, m, _, _ in line))
    width, height = max(1040, left + len(found) * (wide + gap)), top + 2 * (high + gap) + 12
    for number, setup in enumerate(setups):
        at = left + number * (width - left) / len(setups)
        label = {"3": "3: W = 1 s, PIBT", "7": "7: W = 10 s, PIBT"}.get(setup, SETUPS[setup])
        out.append(f'<path d="M{at:.0f} {height - 10}h14" stroke="{colours[setup]}" stroke-width="2"/>'
                   f'<text x="{at + 18:.0f}" y="{height - 6}">{escape(label)}</text>')
    style = ".name{font-weight:bold}.axis{stroke:#888;fill:none}polyline{fill:none;stroke-width:1.5}"
    return picture("Throughput and calls of fail policies by number of robots, with 95 % intervals", width, height,
                   "\n".join(out), style)


def keep_machines(path, parts):
    """What machines of rows are, as far as stores have told it."""
    known = {}
    if os.path.exists(path):
        with open(path, newline="", encoding="utf-8") as file:
            known = {row["machine"]: row["description"] for row in csv.DictReader(file)}
    for part in parts:
        known.update(part.machines)
    if not known:
        return
    with open(path, "w", newline="", encoding="utf-8") as file:
        out = csv.writer(file, lineterminator="\n")
        out.writerows([("machine", "description"), *sorted(known.items())])


def main():
    if sys.argv[1:2] == ["rows"]:
        return print_rows(sys.argv[2])
    folder = sys.argv[1] if len(sys.argv) > 1 else "target/lsmart"
    form = sys.argv[2] if len(sys.argv) > 2 else "reduced"
    kept = sys.argv[3] if len(sys.argv) > 3 else None
    twice = ("models", "windows", "generators")
    names = [*twice, "policies", "disturbances", "lns2", "lns", "peers", *(f"{name}-shipped" for name in twice)]
    rows = {name: Rows(folder, kept, f"{form}-{name}") for name in names}
    for part in rows.values():
        part.keep()
    if kept:
        keep_machines(os.path.join(kept, "machines.csv"), rows.values())
    paper = Measured([rows[name] for name in twice])
    shipped = Measured([rows[f"{name}-shipped"] for name in twice])
    both = [paper, shipped]
    page = Page()
    page.text("# LSMART's experiments\n")
    page.text("This page repeats the experiments of LSMART (Yan et al., \"Lifelong Scalable Multi-Agent Realistic Testbed and A "
          "Comprehensive Study on Design Choices in Lifelong AGV Fleet Management Systems\", 2026) with the modules, planners and "
          "simulator of [fleets](../fleet.md).\n")
    page.text("```sh\nscripts/lsmart             # the reduced form: ten seeds, 300 s\n"
          "scripts/lsmart --full --slurm '--partition short --time-limit 12h'    # ten seeds, 600 s, all maps and teams\n"
          "scripts/lsmart page        # this page\n```\n")
    all_rows = [row for part in rows.values() for row in part.rows.values()]
    if not all_rows:
        page.text(f"There are no rows of the {form} form.\n")
        page.print()
        return
    driven = sum(row["simulated_s"] * row["agents"] for row in all_rows)
    failed = sum(not row["success"] for row in all_rows)
    if disturbed := sum(part.disturbed for part in rows.values()):
        print(f"{disturbed} runs are left out: calls failed on a machine that had something else to do", file=sys.stderr)
    seeds = sorted({row["seed"] for row in all_rows})
    page.text(f"Written by `scripts/lsmart_page.py` from {len(all_rows)} runs of the {form} form, seeds {seeds[0]} to {seeds[-1]}: "
          f"{driven / 3600:.0f} robot-hours, "
          f"{sum(row['contacts'] for row in all_rows)} contacts" + (f", {failed} runs that did not succeed" if failed else "")
          + (f", made by {builds} builds" if (builds := len({row["planner_digest"] for row in all_rows})) > 1 else "") + ". "
          + "The rows are in `docs/results/lsmart/`, the means of all setups in [cells.csv](lsmart/cells.csv). A cell is the mean throughput in goals per simulated second, the half of its "
          "95 % t interval over seeds, and in brackets the share of calls that went to the fail policy; – is not measured. Calls are "
          "limited by search nodes, so that runs repeat on any machine; cells in which calls failed on a busy machine are left out.\n")
    page.text("**Verdicts.** For each seed, d is the mean of ln(goals of A / goals of B) over the cells (a map with a number of robots) "
              "of the claim; shares of failed calls are compared by log odds. \"Better\" means d > 0, \"equal or better\" d > −δ, "
              "\"similar\" −δ < d < δ, with δ = ln 1.05. Student's t test over at least six seeds makes a claim *confirmed* or "
              "*contradicted* (p ≤ 5 % after Holm's correction for all claims here), else two one-sided tests make one of \"better\" "
              "*equivalent* (d between −δ and δ). All else is *undecided*, with about the number of seeds that would decide "
              "([the rule](../../scripts/verdicts.py)). Brackets have 95 % intervals before correction.\n")
    page.text("**Differences from the paper.** Setups *as in the paper* plan without charges for turns and lanes and without spacing, and "
          "commit robots to ⌈T/ε⌉ actions; *as shipped* they have the defaults of our planners, and the cut by time. Instead of ARGoS "
          "there are exact contacts, robots at the paper's nominal limits (2 m/s, 2 m/s², 45°/s), and actions sent without delays. The "
          "reduced form has 300 of 600 s and fewer team sizes, and leaves out maze-32-32-4 and empty-32-32. Calls of CBS, PP and PBS "
          "end by search nodes before the paper's wall-clock limit, so that more of them fail.\n")
    page.text("**Maps.** warehouse-33-36 and empty-32-32 are the paper's. warehouse-10-20-10-2-1 is MovingAI's without its wall, with "
          "[roles](../maps.md#warehouses) in the way of warehouse-33-36. The others are MovingAI's where `FLEETYARD_DATA` has them, "
          "else ours of the same kind and size.\n")
    policies, disturbances = Measured([rows["policies"]]), Measured([rows["disturbances"]])
    if kept:
        write_cells(os.path.join(kept, "cells.csv"), [("paper", paper), ("shipped", shipped), ("policies", policies), ("disturbances", disturbances)])
    experiments_1_to_3(page, both)
    experiment_4(page, Measured([rows["lns2"]]))
    experiment_5(page, [policies], kept)
    experiment_6(page, both)
    under_disturbances(page, policies, disturbances)
    appendix_c(page, Measured([rows["lns"]]))
    page.text("## Cell by cell\n")
    for number, name in enumerate(FORMS):
        picture = forest(page.said(), number)
        if picture and kept:
            file = f"forest-{name.replace(' ', '-')}.svg"
            with open(os.path.join(kept, file), "w", encoding="utf-8") as out:
                out.write(picture)
            page.text(f"![Effects by cell, {name}](lsmart/{file})\n")
    peers(page, rows["peers"])
    page.print()


if __name__ == "__main__":
    main()
