#!/usr/bin/env python3
"""Reads a trace file (docs/trace-format.md) and prints where every body is at every tick, as CSV;
events, and what a fleet did, go to standard error.

The whole format in one page, to be read beside the specification. It needs Python 3.14
(compression.zstd) or the package zstandard, and nothing of Fleetyard. Checks are not
verified: they are XXH3, which is not in the standard library; `fleetyard trace info` does.
"""

import json
import struct
import sys

try:
    from compression.zstd import decompress
except ImportError:
    import zstandard

    def decompress(data):
        return zstandard.ZstdDecompressor().decompress(data)


def frames(file):
    """Kind and payload of every frame, up to the summary."""
    magic, version, zero = struct.unpack("<8sHH", file.read(12))
    if magic != b"\x89FYT\r\n\x1a\n" or zero != 0:
        sys.exit("this is not a trace file")
    if version != 2:
        sys.exit(f"version {version} is not understood")
    while True:
        head = file.read(5)
        if len(head) < 5:
            sys.exit("the trace is cut")
        kind, length = struct.unpack("<cI", head)
        payload = file.read(length)
        if len(payload) < length or len(file.read(8)) < 8:
            sys.exit("the trace is cut")
        yield kind, payload
        if kind == b"Z":
            return


def bits(value):
    return struct.unpack("<q", struct.pack("<d", value))[0]


def ordered(value):
    """The bit pattern as an integer that grows with the float."""
    number = bits(value)
    return number if number >= 0 else number ^ 0x7FFF_FFFF_FFFF_FFFF


def unordered(number):
    number = (number + 2**63) % 2**64 - 2**63
    if number < 0:
        number ^= 0x7FFF_FFFF_FFFF_FFFF
    return struct.unpack("<d", struct.pack("<q", number))[0]


def zigzag(number):
    number = (number + 2**63) % 2**64 - 2**63
    return 2 * number if number >= 0 else -2 * number - 1


def unzigzag(number):
    return number >> 1 if number % 2 == 0 else -(number >> 1) - 1


def finite_or(value, otherwise):
    return value if abs(value) < float("inf") else otherwise


class Track:
    """A coordinate of a body, predicted from its last three values."""

    def __init__(self):
        self.last = None
        self.curved = False

    def straight(self):
        a, b, _ = self.last
        return finite_or(a + (a - b), a)

    def curve(self):
        a, b, c = self.last
        return finite_or(3.0 * (a - b) + c, a)

    def next(self, number):
        if self.last is None:
            value = unordered(unzigzag(number))
            self.last = [value] * 3
            return value
        prediction = self.curve() if self.curved else self.straight()
        value = unordered(ordered(prediction) + unzigzag(number))
        straight = zigzag(ordered(value) - ordered(self.straight()))
        self.curved = zigzag(ordered(value) - ordered(self.curve())) < straight >> 2
        self.last = [value] + self.last[:2]
        return value


class Rows:
    """What the rows of a frame of the journal or of remarks are made of."""

    def __init__(self, data):
        self.data = data

    def take(self, count):
        part, self.data = self.data[:count], self.data[count:]
        return part

    def number(self):
        value = shift = 0
        while True:
            (byte,) = self.take(1)
            value |= (byte & 0x7F) << shift
            shift += 7
            if byte < 0x80:
                return value

    def numbers(self, count):
        return [self.number() for _ in range(count)]

    def text(self):
        return self.take(self.number()).decode()

    def entry(self):
        kind = self.number()
        if kind == 0:
            agent, number, cell, of = self.numbers(4)
            at, task = self.numbers(2) if of else (0, None)
            errand = f", {at + 1} of {of} of task {task}" if of else ""
            return f"agent {agent} has goal {number}, cell {cell}{errand}"
        if kind == 1:
            return "agent {} has reached goal {}".format(*self.numbers(2))
        if kind == 2:
            return f"call {self.number()} is asked"
        if kind == 3:
            by = ["planner", "fail policy", "nobody"]
            return f"call {self.number()} is answered by {by[self.number()]}"
        number, call = self.numbers(2)
        return f"call {call}, notice {number}: {self.text()} of {self.text()}"

    def remark(self):
        if self.number() == 0:
            call = self.number()
            planner, fail_policy = struct.unpack("<dd", self.take(16))
            return f"call {call} took {planner!r} and {fail_policy!r} ms"
        return f"notice {self.number()} says {self.text()!r}"


def main():
    header, tracks, progress = None, [], []
    for kind, payload in frames(open(sys.argv[1], "rb")):
        if kind == b"H":
            header = json.loads(payload)
            bodies = header["agents"] + header["movers"]
            names = ["x_m", "y_m"] + ["heading_rad"] * header["headings"]
            widths = [8] * len(names) + [4] * header["progress"]
            columns = ["tick", "body"] + names + ["knot"] * header["progress"]
            print(",".join(columns))
        elif kind == b"S":
            tick, ticks, is_key = struct.unpack_from("<QIB", payload)
            if is_key:
                tracks = [[Track() for _ in range(bodies)] for _ in names]
                progress = [0] * bodies
            planes = decompress(payload[13:])
            # Planes of bytes: channel, place of the byte, body, tick.
            starts = [sum(widths[:channel]) for channel in range(len(widths))]

            def number(channel, body, at):
                places = range(widths[channel])
                at += body * ticks
                size = bodies * ticks
                return sum(
                    planes[(starts[channel] + place) * size + at] << (8 * place)
                    for place in places
                )

            for at in range(ticks):
                for body in range(bodies):
                    row = [tick + at * header["state_every"], body]
                    for channel, of_bodies in enumerate(tracks):
                        row.append(repr(of_bodies[body].next(number(channel, body, at))))
                    if header["progress"]:
                        step = unzigzag(number(len(names), body, at))
                        progress[body] = (progress[body] + step) % 2**32
                        row.append(progress[body])
                    print(*row, sep=",")
        elif kind == b"E":
            (count,) = struct.unpack_from("<I", payload)
            planes = decompress(payload[4:])
            for at in range(count):
                event = struct.unpack("<QdBBII", planes[at::count])
                substep, time_s, kind, tag, agent, other = event
                kind = ["begin", "end", "arrive"][kind]
                tag = ["agent", "cell", "polygon", "mover", "goal"][tag]
                print(f"{time_s!r} s: agent {agent} {kind} {tag} {other}", file=sys.stderr)
        elif kind in (b"j", b"r"):
            flags, count, _ = struct.unpack_from("<BII", payload)
            if flags & 1:
                continue  # a recap of what was there before
            rows, tick = Rows(decompress(payload[9:])), 0
            for _ in range(count):
                if kind == b"r":
                    print(f"remark: {rows.remark()}", file=sys.stderr)
                    continue
                tick += rows.number()
                time_s = tick / header["ticks_hz"]
                print(f"{time_s!r} s: {rows.entry()}", file=sys.stderr)


if __name__ == "__main__":
    main()
