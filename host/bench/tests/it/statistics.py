"""Answers what tests/it/statistics.rs asks with SciPy: JSON from standard input to standard output."""

import json
import sys

import numpy
from scipy import stats

questions = json.load(sys.stdin)


def of_counts(counts):
    test = stats.binomtest(counts[0], sum(counts))
    interval = test.proportion_ci(0.95, method="wilson")
    return [test.pvalue, interval.low, interval.high]


def of_sample(sample):
    mean = numpy.mean(sample)
    interval = stats.t.interval(0.95, len(sample) - 1, mean, stats.sem(sample))
    quantiles = numpy.quantile(sample, [0.25, 0.5, 0.75, 0.95])

    def bootstrap(statistic):
        found = stats.bootstrap(
            (sample,), statistic, n_resamples=40_000, batch=2_000, method="percentile", rng=1
        ).confidence_interval
        return [found.low, found.high]

    return {
        "summary": [mean, numpy.std(sample, ddof=1), *quantiles, *interval],
        "mean": bootstrap(numpy.mean),
    }


json.dump(
    {
        "counts": [of_counts(counts) for counts in questions["counts"]],
        "pairs": [stats.kendalltau(x, y).statistic for x, y in questions["pairs"]],
        "samples": [of_sample(sample) for sample in questions["samples"]],
    },
    sys.stdout,
)
