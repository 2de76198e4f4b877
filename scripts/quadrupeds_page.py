"""docs/results/quadrupeds.md from the rows that scripts/quadrupeds keeps: teams of quadrupeds planned for and driven, beside
what Multi-Quadruped MAPF published. Everything on the page follows from the rows."""

import os
import statistics
from collections import defaultdict

from experiment import Page, count, digits, read, replace, share

KINDS = ("go2", "spot", "anymal-c")

# Executions of a plan by name, and the arguments of `simulate` for each; NOISE stands for the errors of velocity.
EXECUTIONS = {
    "kinematic": [],
    "kinematic-noise": ["--twist-noise", "NOISE"],
    "contact": ["--tier", "contact"],
    "contact-noise": ["--tier", "contact", "--twist-noise", "NOISE"],
}
TITLES = {"kinematic": "kinematic", "kinematic-noise": "kinematic, with errors", "contact": "contact",
          "contact-noise": "contact, with errors"}
# Figures of an execution, as they are kept and as `simulate` calls them.
EXECUTED = {"pairs": "contacts_agent_agent", "walls": "contacts_agent_obstacle", "arrived": "arrived", "makespan_s": "makespan_s",
            "off_m": "tracking_error_max_m", "off_rad": "tracking_error_max_rad"}
MEASURED = ("plan_ms", "first_ms", "makespan_s", "length_m", "inflation_m", "radius_m",
            *(f"{how}_{figure}" for how in EXECUTIONS for figure in EXECUTED))
# Columns of a trial: which it is, how it ended, and figures of plan and executions, empty where there are none.
COLUMNS = ["robots", "trial", "planner", "model", "kinds", "termination", "failure", "valid", *MEASURED, "contended", "machine", "build"]
COUNTS = ("robots", "trial", "valid")
PLANNER_COLUMNS = ["planner", "version", "model", "options", "left_out"]
CALIBRATION = ["kind", "execution", "seed", "off_m", "off_rad", "radius_m", "inflation_m"]

# Section 3, three trials each: mean and standard deviation of the execution time in seconds.
PUBLISHED = {5: (113.32, 4.79), 8: (198.60, 12.44), 12: (312.86, 23.76)}
PAPER_TRIALS = 3

MODELS = {"holonomic": "the robots' own limits", "single": "robots that set out, turn and stop in no time"}


def spread(values):
    """Mean and standard deviation, as the paper writes them."""
    if not values:
        return "–"
    middle = statistics.fmean(values)
    return f"{middle:.1f} ± {statistics.stdev(values):.1f}" if len(values) > 1 else f"{middle:.1f}"


class Trials:
    """Rows by planner and number of robots."""

    def __init__(self, rows):
        self.rows = rows
        self.cells = defaultdict(list)
        for row in rows:
            self.cells[row["planner"], row["robots"]].append(row)
        self.teams = sorted({row["robots"] for row in rows})
        self.planners = sorted({row["planner"] for row in rows})
        # Who solves most stands for the plans, one for the robots' own limits first.
        own = lambda planner: any(row["model"] == "holonomic" and row["valid"] for row in self.of(planner))
        self.best = min(self.planners, default=None,
                        key=lambda planner: (not own(planner), -sum(row["valid"] for row in self.of(planner)), planner))

    def of(self, planner):
        return [row for row in self.rows if row["planner"] == planner]


def driven(rows, how):
    """Rows whose plan was executed so."""
    return [row for row in rows if row["valid"] and row[f"{how}_arrived"] is not None]


def is_done(row, how):
    """True if all robots arrived and nobody touched anything."""
    return row[f"{how}_arrived"] == row["robots"] and not row[f"{how}_pairs"] and not row[f"{how}_walls"]


def error_share(row, how):
    """The largest error, of place and of heading together, against what rectangles were inflated by for it."""
    return (row[f"{how}_off_m"] + row["radius_m"] * row[f"{how}_off_rad"]) / row["inflation_m"]


def table_of_times(page, trials):
    rows = []
    for team in trials.teams:
        cell = trials.cells[trials.best, team]
        row = [team]
        for only in (PAPER_TRIALS, None):
            times = [one["contact-noise_makespan_s"] for one in driven(cell[:only], "contact-noise") if is_done(one, "contact-noise")]
            row.append(f"{spread(times)} ({len(times)})")
        published = PUBLISHED.get(team)
        row.append(f"{published[0]:.2f} ± {published[1]:.2f} ({PAPER_TRIALS})" if published else "–")
        rows.append(row)
    page.table(["robots", f"first {PAPER_TRIALS} trials, s", "all trials, s", "paper, s"], rows)
    page.text(f"Time until the last robot arrives, mean ± standard deviation (number of trials), of plans of `{trials.best}` in the contact tier "
              "with errors of velocity: what is nearest to the paper's Isaac Sim.\n")


def table_of_planners(page, trials):
    rows = []
    for planner in trials.planners:
        for team in trials.teams:
            cell = trials.cells[planner, team]
            plans = [row for row in cell if row["valid"]]
            calm = [row for row in plans if not row["contended"]] or plans
            times = [sorted(row[figure] / 1000 for row in calm if row[figure] is not None) for figure in ("first_ms", "plan_ms")]
            rows.append([f"`{planner}`", team, share(len(plans), len(cell)),
                         *(f"{digits(statistics.median(of))}, {digits(of[-1])}" if of else "–" for of in times),
                         spread([row["makespan_s"] for row in plans]),
                         spread([row["contact-noise_makespan_s"] for row in driven(plans, "contact-noise") if is_done(row, "contact-noise")])])
    page.table(["planner", "robots", "plans", "first plan, s: median, longest", "planning time, s: median, longest", "plan's makespan, s", "driven, s"], rows)


def table_of_executions(page, trials):
    rows = []
    for planner in trials.planners:
        for team in trials.teams:
            plans = [row for row in trials.cells[planner, team] if row["valid"]]
            for how, title in TITLES.items():
                ran = driven(plans, how)
                if not plans:
                    continue
                done = [row for row in ran if is_done(row, how)]
                rows.append([f"`{planner}`", team, title, share(len(done), len(plans)), len(plans) - len(ran),
                             sum(int(row[f"{how}_pairs"]) for row in ran), sum(int(row[f"{how}_walls"]) for row in ran),
                             spread([row[f"{how}_makespan_s"] for row in done]),
                             f"{100 * max(row[f'{how}_off_m'] for row in ran):.1f}" if ran else "–",
                             f"{max(row[f'{how}_off_rad'] for row in ran):.3f}" if ran else "–",
                             f"{100 * max(error_share(row, how) for row in ran):.0f}" if ran else "–"])
    page.table(["planner", "robots", "execution", "all arrive untouched", "refused", "contacts of robots", "of walls", "time, s",
                "off, cm", "off, rad", "error / inflation, %"], rows, texts=1)
    page.text("*Refused*: the order needs more room than the plan leaves. *Off*: the largest distance and angle of a robot from its way. "
              "*Error / inflation*: distance and angle times the largest effective radius of the team, together, over the least that a rectangle of "
              "the team was inflated by for errors (curves come on top): a bound, for neither is the largest at the same moment.\n")


def table_of_calibration(page, calibration):
    rows = []
    for kind in KINDS:
        of = [row for row in calibration if row["kind"] == kind]
        if not of:
            continue
        cells = []
        for how in EXECUTIONS:
            ran = [row for row in of if row["execution"] == how]
            cells.append(f"{100 * max(row['off_m'] for row in ran):.1f}, {max(row['off_rad'] for row in ran):.3f}")
        rows.append([f"`{kind}`", *cells, f"{100 * of[0]['inflation_m']:.1f}"])
    page.table(["robot", *(f"{title}: cm, rad" for title in TITLES.values()), "inflated by, cm"], rows)
    page.text("The largest distance and angle from the way, in a course of 40 m with turns on the way and in place, driven alone, with "
              f"errors {max(int(row['seed']) for row in calibration)} times. Every side of a rectangle is moved out by 1.25 times the largest distance + "
              "effective radius × angle, and by the 5 cm that round corners may be from the plan.\n")


def losses(trials, planners):
    """Sentences that speak against the system."""
    told = []
    if not any(row["model"] == "holonomic" and row["valid"] for row in trials.rows):
        told.append("**No planner has planned with the robots' own limits.** Plans are those of robots that set out, turn and stop in no time; by order "
                    "their times do not count.")
    for planner in trials.planners:
        rows = trials.of(planner)
        cells = {team: trials.cells[planner, team] for team in trials.teams}
        missed = [f"{share(sum(not row['valid'] for row in cell), len(cell), ' of ')} with {team} robots" for team, cell in cells.items()
                  if any(not row["valid"] for row in cell)]
        if missed:
            told.append(f"**No plan** by `{planner}`: {', '.join(missed)}.")
        for how, title in TITLES.items():
            ran = driven(rows, how)
            refused = sum(row["valid"] for row in rows) - len(ran)
            touched = sum(bool(row[f"{how}_pairs"] or row[f"{how}_walls"]) for row in ran)
            late = sum(row[f"{how}_arrived"] != row["robots"] for row in ran)
            if refused or touched or late:
                told.append(f"**{title.capitalize()}**, plans of `{planner}`: {refused} refused, {touched} with contacts, {late} in which not all "
                            f"arrive, of {sum(row['valid'] for row in rows)}.")
    over = [(error_share(row, how), row["planner"]) for how in EXECUTIONS for row in driven(trials.rows, how) if error_share(row, how) > 1]
    if over:
        told.append(f"**Errors may be larger than the calibration says** in {count(len(over), 'execution')}: by the bound of the last column below, by up "
                    f"to {100 * max(over)[0] - 100:.0f} %.")
    return told


def write(path, kept, picture):
    trials = Trials(read(kept / "rows.csv", MEASURED, COUNTS))
    planners = read(kept / "planners.csv")
    calibration = read(kept / "calibration.csv", ("off_m", "off_rad", "radius_m", "inflation_m"))
    page = Page()
    of_docs = lambda file: os.path.relpath(path.parent.parent / file, path.parent)
    machines = sorted({row["machine"] for row in trials.rows if row["machine"]})
    contended = sum(bool(row["contended"]) for row in trials.rows)
    page.text("# Teams of quadrupeds", "",
              "This page repeats the experiment of Multi-Quadruped MAPF (Veerapaneni et al., \"Towards Unstructured MAPF: Multi-Quadruped MAPF Demo\", "
              f"section 3): random teams of Go2, Spot and ANYmal C on one floor, planned for as rectangles and "
              f"[driven by order]({of_docs('execution.md')}#keep-the-plans-order) with round corners.", "",
              "```sh", "scripts/quadrupeds            # all planners that take such robots; what was stopped goes on",
              "scripts/quadrupeds --quick    # two trials of five robots", "scripts/quadrupeds page       # this page from its rows", "```", "",
              f"Written by `scripts/quadrupeds_page.py` from {count(len(trials.rows), 'trial')}. The rows are in `{kept.name}/`. "
              f"{' and '.join(machines) or 'Nothing'} planned; "
              f"{count(contended, 'trial') if contended else 'no trial'} {'were' if contended > 1 else 'was'} disturbed by other work on the machine.", "")
    told = losses(trials, planners)
    if told:
        page.text("## What is worse", "", *(f"- {one}" for one in told), "")
    page.text("## Execution times", "")
    if picture.exists():
        page.text(f"![Four quadrupeds on the floor, part of the way]({os.path.relpath(picture, path.parent)})", "")
    table_of_times(page, trials)
    page.text("The figures cannot be compared:", "",
              "| the paper | here |", "| --- | --- |",
              "| unpublished maps of unknown size | `maps/floor.world.json`, 16 × 12 m, starts and goals at least 6 m apart |",
              "| conflict-based search over RRT; δ and the parameters of RRT are unpublished | the planners below |",
              "| Isaac Sim with learned policies of legs | the contact tier; policies are errors of velocity: 5 % of the speed along each axis, "
              "5 % of the turn rate and 0.02 rad/m, drawn anew ten times a second |",
              "| unpublished limits of speed | `go2`, `spot`, `anymal-c`: public figures, and ours where there are none |", "")
    page.text("## Planners", "")
    table_of_planners(page, trials)
    asked = defaultdict(list)
    for one in planners:
        if not one["left_out"]:
            asked[MODELS[one["model"]]].append(f"`{one['planner']}`")
    left_out = defaultdict(list)
    for one in planners:
        if one["left_out"]:
            left_out[one["left_out"]].append(f"`{one['planner']}`")
    page.text("*Driven* in the contact tier with errors. Planned for " + ", for ".join(f"{model}: {', '.join(names)}" for model, names in asked.items())
              + ". Plans are those of inflated rectangles, valid by the exact judge. A planner without a plan for any of three teams "
              "of a size is not asked for more." + (" Left out: " + "; ".join(
                  f"{', '.join(names)} ({reason})" for reason, names in left_out.items()) + "." if left_out else ""), "")
    page.text("## Executions", "")
    table_of_executions(page, trials)
    page.text("## Calibration", "")
    table_of_calibration(page, calibration)
    replace(path, "\n".join(page.lines).rstrip() + "\n")
