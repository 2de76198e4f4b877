"""Verdicts on claims about two setups, from the same seeds of both.

For a claim, d_s is the difference of seed s: the mean over cells (a map with a number of robots) of
ln(T_A/T_B), or of the difference of log odds where shares are compared. Seeds are the unit, for all
cells of a seed share its random numbers; at least six of them are needed. A claim is about one of

    better      d > 0
    no worse    d > -margin
    similar     -margin < d < margin

and is confirmed or contradicted where Student's t test over seeds tells so with 5 % at most, after
Holm's correction (1979) for all claims that are judged together; else it is undecided. "Similar" takes
two one-sided tests (Schuirmann, Journal of Pharmacokinetics and Biopharmaceutics 15, 1987). They also
make a claim of "better" that is neither confirmed nor contradicted equivalent, with a Holm correction of
their own: the difference is within the margin, whatever its sign. The margin is fixed before anything is
measured. Not for fewer than six seeds, for seeds that share random numbers, or for a margin that was chosen
after looking.
"""

import math
from functools import lru_cache

MARGIN = math.log(1.05)
LEVEL = 0.05
FEWEST_SEEDS = 6


def student_tail(t, freedom):
    """P(T > t) of Student's distribution, by the continued fraction of the incomplete beta function
    (Lentz's method; Press et al., "Numerical recipes", section 6.4)."""
    if t < 0:
        return 1 - student_tail(-t, freedom)
    x = freedom / (freedom + t * t)
    a, b = freedom / 2, 0.5
    if x >= 1:
        return 0.5
    front = math.exp(math.lgamma(a + b) - math.lgamma(a) - math.lgamma(b) + a * math.log(x) + b * math.log1p(-x))
    if x < (a + 1) / (a + b + 2):
        return 0.5 * front * fraction(a, b, x) / a
    return 0.5 * (1 - front * fraction(b, a, 1 - x) / b)


def fraction(a, b, x):
    tiny = 1e-300
    c, d = 1.0, 1 / max(1 - (a + b) * x / (a + 1), tiny)
    value = d
    for m in range(1, 500):
        for term in (m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m)),
                     -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1))):
            d = 1 + term * d
            c = 1 + term / c
            d = 1 / (d if abs(d) > tiny else tiny)
            c = c if abs(c) > tiny else tiny
            value *= d * c
        if abs(d * c - 1) < 1e-14:
            break
    return value


@lru_cache(maxsize=None)
def student_quantile(tail, freedom):
    """The t above which there is so much of Student's distribution, for tails below one half."""
    low, high = 0.0, 1.0
    while student_tail(high, freedom) > tail:
        high *= 2
    for _ in range(100):
        middle = (low + high) / 2
        low, high = (middle, high) if student_tail(middle, freedom) > tail else (low, middle)
    return high


class Seeds:
    """One difference for each seed."""

    def __init__(self, differences):
        self.n = len(differences)
        self.mean = sum(differences) / self.n
        squares = sum((value - self.mean) ** 2 for value in differences)
        self.deviation = math.sqrt(squares / (self.n - 1)) if self.n > 1 else math.nan

    def interval(self, n=None):
        """The 95 % t interval; as it would be with n seeds of this mean and spread."""
        n = n or self.n
        if n < 2:
            return -math.inf, math.inf
        half = student_quantile(LEVEL / 2, n - 1) * self.deviation / math.sqrt(n)
        return self.mean - half, self.mean + half

    def p_above(self, bound, n=None):
        """One-sided p of the hypothesis that the difference is no more than the bound."""
        n = n or self.n
        if n < 2:
            return 1.0
        if self.deviation == 0:
            return 0.0 if self.mean > bound else 1.0
        return student_tail((self.mean - bound) / self.deviation * math.sqrt(n), n - 1)

    def p_below(self, bound, n=None):
        """The same the other way round."""
        return Seeds.p_above(self.turned(), -bound, n)

    def turned(self):
        other = object.__new__(Seeds)
        other.n, other.mean, other.deviation = self.n, -self.mean, self.deviation
        return other


def spread(values):
    """Mean and ends of its 95 % t interval; of one value that value."""
    if len(values) < 2:
        return values[0], values[0], values[0]
    seeds = Seeds(values)
    return (seeds.mean, *seeds.interval())


class Claim:
    """One of the three claims about differences by seed."""

    def __init__(self, kind, differences, margin=MARGIN):
        self.kind, self.margin = kind, margin
        self.seeds = Seeds(differences) if differences else None

    def tests(self, n=None):
        """p for the claim, and p against it; the smaller one, doubled where both ends are looked at,
        is what is corrected."""
        seeds = self.seeds
        if self.kind == "similar":
            inside = max(seeds.p_above(-self.margin, n), seeds.p_below(self.margin, n))
            outside = min(seeds.p_above(self.margin, n), seeds.p_below(-self.margin, n))
            return inside, min(2 * outside, 1.0)
        bound = 0.0 if self.kind == "better" else -self.margin
        return min(2 * seeds.p_above(bound, n), 1.0), min(2 * seeds.p_below(bound, n), 1.0)

    def p(self, n=None):
        return min(self.tests(n))

    def p_equivalent(self, n=None):
        """Of two one-sided tests that the difference is within the margin: at most 5 % where the 90 %
        interval is."""
        return max(self.seeds.p_above(-self.margin, n), self.seeds.p_below(self.margin, n))

    def decided(self, p, p_equivalent):
        """The verdict where these are what correction made of both p."""
        if self.seeds is None:
            return "not measured"
        if self.seeds.n < FEWEST_SEEDS:
            return "undecided"
        if p <= LEVEL:
            for_it, against = self.tests()
            return "confirmed" if for_it < against else "contradicted"
        return "equivalent" if self.kind == "better" and p_equivalent <= LEVEL else "undecided"

    def seeds_needed(self):
        """How many seeds of this mean and spread would decide, before correction; None where a
        thousand would not, or where one seed does not show a spread."""
        if self.seeds.n < 2:
            return None
        for n in range(max(self.seeds.n + 1, FEWEST_SEEDS), 1001):
            if min(self.p(n), self.p_equivalent(n) if self.kind == "better" else 1.0) <= LEVEL:
                return n
        return None


def holm(p_values):
    """What Holm's correction makes of p-values, by their keys."""
    adjusted, largest = {}, 0.0
    for rank, key in enumerate(sorted(p_values, key=p_values.get)):
        largest = max(largest, min((len(p_values) - rank) * p_values[key], 1.0))
        adjusted[key] = largest
    return adjusted


def judge(claims):
    """Verdicts on claims, with Holm's correction for those that are measured."""
    measured = {at: claim for at, claim in enumerate(claims)
                if claim.seeds is not None and claim.seeds.n >= FEWEST_SEEDS}
    adjusted = holm({at: claim.p() for at, claim in measured.items()})
    equivalent = holm({at: claim.p_equivalent() for at, claim in measured.items() if claim.kind == "better"})
    return [claim.decided(adjusted.get(at, 1.0), equivalent.get(at, 1.0)) for at, claim in enumerate(claims)]


def log_odds(failed, calls):
    """Of a share of calls, with half a call added on either side."""
    return math.log((failed + 0.5) / (calls - failed + 0.5))
