"""What experiments share: the command, rows in files that appear whole, and pages that are made of them."""

import csv
import io
import json
import math
import os
import pathlib
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent


def numbers(text):
    return sorted({int(one) for one in text.split(",")})


def refuse(reason, hint):
    """Ends with what is wrong with the arguments."""
    print(f"error: {reason}\nhint: {hint}", file=sys.stderr)
    sys.exit(2)


class Fleetyard:
    """The command."""

    def __init__(self):
        self.path = os.environ.get("FLEETYARD")
        if not self.path:
            subprocess.run(["cargo", "build", "--release", "--quiet"], cwd=ROOT, check=True)
            target = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", "target"))
            self.path = str(ROOT / target / "release" / "fleetyard")

    def run(self, *arguments):
        """Standard output, and the last error in words."""
        done = subprocess.run([self.path, *map(str, arguments)], capture_output=True, text=True, check=False)
        errors = [line.removeprefix("error: ") for line in done.stderr.splitlines() if line.startswith("error: ")]
        failed = f"exit code {done.returncode}" if done.returncode else None
        return done.stdout, errors[-1] if errors else failed

    def ended(self, *arguments):
        """The answer of a command that may fail, None if there is none, and the last error in words."""
        answer, error = self.run(*arguments, "--format", "json")
        return json.loads(answer) if answer else None, error

    def must(self, *arguments):
        """Standard output of a command that does not fail."""
        answer, error = self.run(*arguments)
        if error:
            sys.exit(f"error: fleetyard {' '.join(map(str, arguments))}: {error}")
        return answer


def as_csv(columns, rows):
    file = io.StringIO()
    writer = csv.DictWriter(file, columns, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return file.getvalue()


def keep(path, columns, rows):
    replace(path, as_csv(columns, rows))


def only(*names):
    """The type of --only: a row by what it is the row of, numbers as such."""
    def trial(text):
        parts = text.split(",")
        if len(parts) != len(names):
            refuse(f"--only {text} names no row", f"--only takes {','.join(names)}")
        return [int(part) if part.isdecimal() else part for part in parts]
    return trial


def rounded(value):
    return "" if value is None else round(value, 6)


def machine(of):
    return f"{of.get('cpu_model') or of.get('architecture')} with {of.get('logical_cpus')} CPUs"


def replace(path, text):
    """A file that appears whole."""
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(f".{path.name}.{os.getpid()}")
    part.write_text(text, encoding="utf-8")
    os.replace(part, path)


def read(path, numbers=(), counts=()):
    with open(path, newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    for row in rows:
        for column in numbers:
            row[column] = float(row[column]) if row[column] else None
        for column in counts:
            row[column] = int(row[column]) if row[column] else None
    return rows


def mean(values):
    return sum(values) / len(values)


def digits(value):
    """Three significant digits, without an exponent."""
    if value == 0:
        return "0"
    return f"{value:.{max(0, 2 - math.floor(math.log10(abs(value))))}f}"


def count(number, what):
    return f"{number} {what}{'' if number == 1 else 's'}"


def share(part, whole, by="/"):
    return f"{part}{by}{whole}"


class Page:
    def __init__(self):
        self.lines = []

    def text(self, *lines):
        self.lines.extend(lines)

    def table(self, head, rows, texts=1):
        self.text("| " + " | ".join(head) + " |", "|" + " --- |" * texts + " ---: |" * (len(head) - texts))
        self.text(*("| " + " | ".join(map(str, row)) + " |" for row in rows), "")
