//! Plans while a planner goes on: what they cost as the planner has them, before anybody judges them.

use std::collections::BTreeMap;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::time::Duration;

use fleetyard_abi::{Knot, PlanRef, Visit};
use fleetyard_runtime::Follow;
use serde::Serialize;

use crate::record::milliseconds;

/// Most plans that wait to be told of; more of them are not told.
const WAITING: usize = 1024;

/// The figure by which planners report what no plan costs less than.
pub(crate) const LOWER_BOUND: &str = "lower_bound";

/// A plan that has come, by what its planner claims: nobody has judged it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ClaimedIncumbent {
    /// Time of its arrival, from the start of the call.
    pub at_ms: f64,
    /// Sum over agents of the time at which they come to rest for good.
    pub soc: f64,
    /// The latest of these times.
    pub makespan: f64,
    /// The unit of both: `steps`, or `s` for seconds.
    pub unit: &'static str,
    /// The planner's claim of what no plan costs less than, if it has made one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lower_bound: Option<f64>,
    /// Always true: the record has what the host finds.
    pub claimed: bool,
}

impl ClaimedIncumbent {
    fn new(plan: PlanRef<'_>, arrived: Duration, metrics: &BTreeMap<String, f64>) -> Self {
        let (soc, makespan) = costs(plan);
        Self {
            at_ms: milliseconds(arrived),
            soc,
            makespan,
            unit: match plan {
                PlanRef::Cells(_) => "steps",
                PlanRef::Visits(_) | PlanRef::Trajectories(_) => "s",
            },
            lower_bound: metrics.get(LOWER_BOUND).copied(),
            claimed: true,
        }
    }
}

/// Sum of costs and makespan, whatever the plan is worth.
fn costs(plan: PlanRef<'_>) -> (f64, f64) {
    let of = |ends: &mut dyn Iterator<Item = f64>| {
        ends.fold((0.0, 0.0_f64), |(sum, most), end| {
            (sum + end, most.max(end))
        })
    };
    match plan {
        PlanRef::Cells(plan) => of(&mut (0..plan.agents()).map(|agent| plan.arrival(agent) as f64)),
        PlanRef::Visits(plan) => of(&mut plan.iter().map(|visits| {
            let is_at = |a: &Visit, b: &Visit| a.vertex == b.vertex;
            rest(visits, is_at).map_or(0.0, |visit| visit.arrival_s)
        })),
        PlanRef::Trajectories(plan) => of(&mut (0..plan.knots.len()).map(|agent| {
            let is_at = |a: &Knot, b: &Knot| {
                let moved = (a.x_m - b.x_m).abs() + (a.y_m - b.y_m).abs();
                let turned = a.heading_rad - b.heading_rad;
                moved == 0.0 && (turned == 0.0 || turned.is_nan())
            };
            let knots = plan.knots.get(agent).and_then(|knots| rest(knots, is_at));
            let durations = plan
                .controls
                .and_then(|controls| controls.durations_s().get(agent));
            let driven = || durations.map_or(0.0, |durations| durations.iter().sum());
            knots.map_or_else(driven, |knot| knot.time_s)
        })),
    }
}

/// The first of the items from which on all are where the last one is.
fn rest<T>(items: &[T], is_at: impl Fn(&T, &T) -> bool) -> Option<&T> {
    let last = items.last()?;
    let before = items.iter().rposition(|item| !is_at(item, last));
    items.get(before.map_or(0, |index| index + 1))
}

/// Hands on what plans cost as they come, to a reader that may be slow.
#[derive(Debug)]
pub struct Followed(SyncSender<ClaimedIncumbent>);

impl Followed {
    /// Both ends. The reader gets nothing more once the other end is dropped.
    pub fn new() -> (Self, Receiver<ClaimedIncumbent>) {
        let (sender, receiver) = sync_channel(WAITING);
        (Self(sender), receiver)
    }
}

impl Follow for Followed {
    fn incumbent(&self, plan: PlanRef<'_>, arrived: Duration, metrics: &BTreeMap<String, f64>) {
        // Whoever does not read them in time misses some, and keeps nobody waiting.
        let _ = self
            .0
            .try_send(ClaimedIncumbent::new(plan, arrived, metrics));
    }
}

#[cfg(test)]
mod tests {
    use fleetyard_abi::{GridPlan, Plan, VisitPlan};

    use super::*;

    #[test]
    fn plans_are_told_with_the_costs_that_they_have() {
        let (followed, told) = Followed::new();
        let mut cells = GridPlan::with_capacity(2, 7);
        cells.push_path([0, 1, 2, 2]);
        cells.push_path([5, 5, 4]);
        let metrics = BTreeMap::from([("lower_bound".to_owned(), 3.0)]);
        let at = Duration::from_millis(7);
        followed.incumbent(Plan::Cells(cells).as_ref(), at, &metrics);
        let visit = |vertex, arrival_s| Visit {
            vertex,
            arrival_s,
            departure_s: arrival_s,
        };
        let mut visits = VisitPlan::with_capacity(2, 4);
        visits.push([visit(0, 0.0), visit(1, 1.5), visit(1, 9.0)]);
        visits.push([visit(3, 0.0)]);
        followed.incumbent(Plan::Visits(visits).as_ref(), at, &BTreeMap::new());
        drop(followed);
        let told: Vec<_> = told.iter().collect();
        let costs: Vec<_> = told
            .iter()
            .map(|one| (one.soc, one.makespan, one.unit, one.lower_bound))
            .collect();
        assert_eq!(
            costs,
            [(4.0, 2.0, "steps", Some(3.0)), (1.5, 1.5, "s", None)]
        );
        assert!(told.iter().all(|one| one.claimed && one.at_ms > 0.0));
    }

    #[test]
    fn a_reader_that_does_not_read_keeps_nobody_waiting() {
        let (followed, told) = Followed::new();
        let plan = Plan::Cells(GridPlan::with_capacity(0, 0));
        for _ in 0..3 * WAITING {
            followed.incumbent(plan.as_ref(), Duration::ZERO, &BTreeMap::new());
        }
        drop(followed);
        assert_eq!(told.iter().count(), WAITING);
    }
}
