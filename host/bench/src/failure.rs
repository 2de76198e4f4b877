//! The reason of a failed trial, in a few words that many trials share.
//!
//! A failure has one reason, the first of these that there is: what ended the run; what the
//! planner itself says of it; what is wrong with a plan that it claims to be a solution. A plan of a view
//! of a task solves it where it keeps the rules of the view and is valid by footprints in the world: one
//! that only keeps the rules has a reason of its own. What a
//! planner leaves that did not claim one is judged in the record, and is no reason.

use fleetyard_abi::Status;
use fleetyard_runtime::Termination;

use crate::record::{Ending, Record};
use crate::row::Row;

pub(crate) const INVALID_PLAN: &str = "invalid plan";

/// The reason of a plan that keeps the rules of its view, and not clear of others in the world.
pub(crate) const INVALID_IN_WORLD: &str = "invalid in the world";

/// True if the reason is a plan that is wrong.
pub(crate) fn is_invalid(reason: &str) -> bool {
    [INVALID_PLAN, INVALID_IN_WORLD].contains(&reason)
}

/// The facts that decide how a trial ended.
struct Trial<'a> {
    termination: &'a str,
    limit: Option<&'a str>,
    claim: Option<&'a str>,
    /// The verdict on the plan, if there is one.
    valid: Option<bool>,
    /// True if the plan keeps the rules of a view.
    keeps_rules: bool,
}

impl Trial<'_> {
    /// `None` if it succeeded.
    fn failure(&self) -> Option<String> {
        let is = |termination: Termination| self.termination == termination.to_string();
        let claims = |status: Status| self.claim == Some(&*status.to_string());
        let may_count = is(Termination::Completed)
            || is(Termination::TimedOut)
            || is(Termination::Interrupted)
            || is(Termination::OverLimit);
        if may_count && self.valid == Some(true) {
            return None;
        }
        // What stopped the planner says more than that it was stopped.
        Some(match (self.limit, self.claim, self.valid) {
            (Some(limit), ..) if is(Termination::OverLimit) => format!("over limit: {limit}"),
            _ if !is(Termination::Completed) => self.termination.into(),
            _ if claims(Status::TimedOut) => Termination::TimedOut.to_string(),
            (_, Some(claim), _) if !claims(Status::Solved) => format!("no plan: {claim}"),
            (.., Some(_)) if self.keeps_rules => INVALID_IN_WORLD.into(),
            (.., Some(_)) => INVALID_PLAN.into(),
            (.., None) => "no plan".into(),
        })
    }
}

impl Row {
    /// The reason if the trial failed.
    pub fn failure(&self) -> Option<String> {
        if self.success {
            return None;
        }
        let completed = self.termination == Termination::Completed.to_string();
        if completed && self.fleet.is_some() {
            // It drove to the end.
            return Some("contacts".into());
        }
        // Without a plan nothing is wrong with one.
        let has_plan = self.plan_digest.is_some() || self.violations > 0;
        let trial = Trial {
            termination: &self.termination,
            limit: given(self.limit_exceeded.as_deref()),
            claim: given(self.claim.as_deref()),
            valid: has_plan.then_some(false),
            keeps_rules: self.valid_in_view == Some(true),
        };
        trial.failure()
    }
}

/// Rows that come from CSV may have empty texts.
fn given(text: Option<&str>) -> Option<&str> {
    text.filter(|text| !text.is_empty())
}

impl Record {
    /// The reason if the trial failed.
    pub fn failure(&self) -> Option<String> {
        let limit = self.limit.map(|limit| limit.to_string());
        let claim = self.claim.map(|claim| claim.to_string());
        let trial = Trial {
            termination: &self.termination.to_string(),
            limit: limit.as_deref(),
            claim: claim.as_deref(),
            valid: self.plan_digest.map(|_| self.verdict.valid),
            keeps_rules: self.valid_in_view() == Some(true),
        };
        trial.failure()
    }

    /// The end of the trial, as exit codes tell it.
    pub fn ending(&self) -> Ending {
        match self.termination {
            Termination::Crashed
            | Termination::Exited
            | Termination::ProtocolError
            | Termination::Failed => Ending::Plugin,
            Termination::Interrupted => Ending::Interrupted,
            Termination::Completed
            | Termination::TimedOut
            | Termination::OverLimit
            | Termination::Unsupported => match self.failure().as_deref() {
                None => Ending::Success,
                Some(reason) if is_invalid(reason) => Ending::InvalidPlan,
                Some(_) => Ending::NoPlan,
            },
        }
    }

    /// True if it ended with a valid plan.
    pub fn succeeded(&self) -> bool {
        self.ending() == Ending::Success
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn failure(termination: Termination, claim: Option<Status>, valid: Option<bool>) -> String {
        let claim = claim.map(|claim| claim.to_string());
        let trial = Trial {
            termination: &termination.to_string(),
            limit: Some("memory"),
            claim: claim.as_deref(),
            valid,
            keeps_rules: false,
        };
        trial.failure().unwrap_or_else(|| "none".into())
    }

    #[test]
    fn a_plan_that_only_keeps_the_rules_of_its_view_has_a_reason_of_its_own() {
        let row = |valid_in_view: Option<bool>, claim: &str| Row {
            termination: "completed".into(),
            claim: Some(claim.into()),
            plan_digest: Some("p".into()),
            valid_in_view,
            valid_in_world: Some(false),
            ..Row::default()
        };
        let reason = |row: Row| row.failure().unwrap();
        assert_eq!(reason(row(Some(true), "solved")), "invalid in the world");
        assert_eq!(reason(row(Some(false), "solved")), "invalid plan");
        // The plane is the world.
        assert_eq!(reason(row(None, "solved")), "invalid plan");
        assert_eq!(reason(row(Some(true), "gave-up")), "no plan: gave-up");
    }

    #[test]
    fn leftovers_that_nobody_claimed_to_be_a_plan_are_not_an_invalid_plan() {
        use Status::{GaveUp, Infeasible, Solved, TimedOut};
        use Termination as End;
        for (end, claim, valid, expected) in [
            (End::Completed, Some(TimedOut), Some(false), "timed-out"),
            (End::TimedOut, None, Some(false), "timed-out"),
            (End::TimedOut, Some(Solved), Some(false), "timed-out"),
            (End::OverLimit, None, Some(false), "over limit: memory"),
            (
                End::Completed,
                Some(GaveUp),
                Some(false),
                "no plan: gave-up",
            ),
            (
                End::Completed,
                Some(Infeasible),
                None,
                "no plan: infeasible",
            ),
            (End::Completed, Some(Solved), Some(false), "invalid plan"),
            (End::Completed, None, Some(false), "invalid plan"),
            (End::Completed, Some(Solved), None, "no plan"),
            (End::Crashed, Some(Solved), Some(true), "crashed"),
            // A plan that is valid counts, whatever was said of it.
            (End::TimedOut, None, Some(true), "none"),
            (End::Completed, Some(TimedOut), Some(true), "none"),
        ] {
            assert_eq!(
                failure(end, claim, valid),
                expected,
                "{end} {claim:?} {valid:?}"
            );
        }
    }
}
