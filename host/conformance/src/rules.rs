//! Rules of plans that their instances do not say.

use fleetyard_abi::{Plan, PlanRef};

/// Most violations that are looked at. Not all of them are wanted.
pub(crate) const VIOLATIONS: usize = 10_000;

/// The rule of a plan about goals.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Arrival {
    /// Visit them in order and stay at the last.
    Stay,
    /// Visit them in order.
    Visit,
    /// Nothing.
    Free,
}

/// The rules of a plan that its instance does not say.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Rules {
    pub(crate) arrival: Arrival,
    /// Number of steps of delay that it tolerates, on a grid.
    pub(crate) delay: u32,
    /// True if it need not be one: paths of these agents are enough.
    pub(crate) may_collide: bool,
}

/// The reason of a verdict: a sentence with its rule.
pub(crate) fn broken(sentence: &str, rule: impl std::fmt::Display) -> String {
    format!("{sentence} ({rule})")
}

/// The rule of such a reason.
pub(crate) fn broken_rule(reason: &str) -> Option<&str> {
    let (_, rule) = reason.strip_suffix(')')?.rsplit_once(" (")?;
    Some(rule)
}

/// The reason why a plan of another form is none.
pub(crate) fn other_form(wanted: &str, plan: &Plan) -> String {
    let given = PlanRef::from(plan).field();
    format!("it is a plan of `{given}`, but the map asks for `{wanted}`")
}
