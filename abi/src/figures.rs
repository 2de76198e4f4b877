//! Figures that a plugin reports of itself, and the values that they may have.
//!
//! A figure is a claim, and any name may be given to one. Those of [`FIGURES`] have a
//! meaning in the contract, and with it the values that they may have: one outside of them
//! breaks the contract, from a library as on the wire.

/// The values of a figure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Domain {
    /// A number of things: whole, from 0.
    Count,
    /// A sum or a length: from 0.
    Amount,
}

/// A figure that the contract gives a meaning.
#[derive(Debug, Clone, Copy)]
pub struct Figure {
    /// Its name.
    pub name: &'static str,
    /// Its values.
    pub domain: Domain,
    /// Its meaning.
    pub about: &'static str,
}

macro_rules! figures {
    ($($name:literal, $domain:ident, $about:literal;)*) => {
        /// Every figure that the contract gives a meaning.
        pub const FIGURES: &[Figure] = &[$(Figure {
            name: $name,
            domain: Domain::$domain,
            about: $about,
        },)*];
    };
}

figures! {
    "expansions", Count, "nodes of the search whose successors were made";
    "generated", Count, "nodes of the search that were made";
    "nodes", Count, "nodes of the high level, of a search that has two";
    "iterations", Count, "rounds of a search that goes in rounds";
    "lower_bound", Amount, "no plan has a lesser sum of costs, in steps";
    "claimed_sum_of_costs", Amount, "of the plan, in steps; compared with the host's";
    "claimed_makespan", Amount, "of the plan, in steps; compared with the host's";
}

impl Domain {
    /// In words.
    pub fn in_words(self) -> &'static str {
        match self {
            Self::Count => "a whole number from 0",
            Self::Amount => "a number from 0",
        }
    }

    fn has(self, value: f64) -> bool {
        value.is_finite() && value >= 0.0 && (self == Self::Amount || value.fract() == 0.0)
    }
}

/// Says why a figure cannot be what it is called. Other names may have any value.
pub fn check_figure(name: &str, value: f64) -> Result<(), String> {
    match FIGURES.iter().find(|figure| figure.name == name) {
        Some(Figure { domain, .. }) if !domain.has(value) => Err(format!(
            "the figure `{name}` must be {}, not {value}",
            domain.in_words()
        )),
        _ => Ok(()),
    }
}

/// The longest time of work, `call_ns`, that a plugin may claim of a call which took so long
/// by the host's clock: a thousandth and a millisecond more, for its clock may be another one.
pub fn longest_call_ns(round_trip_ns: u64) -> u64 {
    round_trip_ns.saturating_add(round_trip_ns / 1000 + 1_000_000)
}
