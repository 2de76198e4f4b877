//! Verdicts and costs as people read them.

use std::fmt::Write as _;

use fleetyard_bench::number;
use fleetyard_check::{ContinuousVerdict, TravelCosts};

/// Violations beyond those that are shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Unlisted {
    /// So many.
    Counted(u64),
    /// Some, if there are any: the judge stopped at as many as were asked for.
    Unknown,
}

impl Unlisted {
    /// Those that a judge who counts all of them did not describe.
    pub(super) fn of_all(count: u64, described: usize) -> Self {
        Self::Counted(count.saturating_sub(described as u64))
    }

    /// Those that a judge did not look for who stops at as many as were asked for.
    pub(super) fn of_some(asked: usize, described: usize) -> Self {
        if described >= asked {
            Self::Unknown
        } else {
            Self::Counted(0)
        }
    }
}

/// Writes a verdict: rule and sentence of what was found, after a label.
pub(super) fn write_verdict<'a>(
    out: &mut String,
    label: &str,
    found: impl ExactSizeIterator<Item = (&'a str, &'a str)>,
    unlisted: Unlisted,
) {
    let described = found.len() as u64;
    // Writing to a string cannot fail.
    let _ = match (described, unlisted) {
        (0, _) => writeln!(out, "{label}valid"),
        (_, Unlisted::Unknown) => writeln!(out, "{label}INVALID: {described} or more violations"),
        (_, Unlisted::Counted(more)) => {
            writeln!(out, "{label}INVALID: {} violations", described + more)
        }
    };
    for (rule, sentence) in found {
        let _ = writeln!(out, "  {rule}: {sentence}");
    }
    let _ = match unlisted {
        Unlisted::Counted(0) => Ok(()),
        Unlisted::Counted(more) => writeln!(out, "  … and {more} more; --all lists them"),
        Unlisted::Unknown => writeln!(out, "  … and maybe more; --all lists them"),
    };
}

/// Writes a verdict in the plane, of which at most so many violations were `asked` for.
pub(super) fn write_world(
    out: &mut String,
    label: &str,
    verdict: &ContinuousVerdict,
    asked: usize,
) {
    let found = verdict.violations.iter();
    let found = found.map(|found| (found.rule.name(), found.sentence.as_str()));
    let unlisted = Unlisted::of_some(asked, verdict.violations.len());
    write_verdict(out, label, found, unlisted);
}

/// Writes costs in the plane.
pub(super) fn write_costs(out: &mut String, costs: &TravelCosts) {
    let TravelCosts {
        sum_of_costs_s,
        makespan_s,
        length_m,
    } = *costs;
    // Writing to a string cannot fail.
    let _ = writeln!(out, "sum of costs {} s", number(sum_of_costs_s));
    let _ = writeln!(out, "makespan     {} s", number(makespan_s));
    let _ = writeln!(out, "path length  {} m", number(length_m));
}
