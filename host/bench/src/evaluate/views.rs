use std::collections::BTreeMap;

use fleetyard_views::Representation;
use serde::Serialize;

use super::{Case, Metric, SOLVE_TIME, Trials};
use crate::Row;
use crate::failure::INVALID_IN_WORLD;
use crate::statistics::{mean, median, sorted};

/// A planner on a view of tasks with so many agents, beside the best plans in the plane.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ViewLine {
    /// Number of agents.
    pub agents: u64,
    /// Representation of the view.
    pub representation: String,
    /// Label of the view.
    pub view: String,
    /// The planner's label in the suite.
    pub planner: String,
    /// Cases.
    pub cases: usize,
    /// Cases of which every repeat has a plan that keeps the rules of the view and is valid in the world.
    pub solved: usize,
    /// Trials whose plan keeps the rules of the view and is not valid in the world.
    pub invalid_in_world: usize,
    /// Over the solved cases.
    pub means: WorldCosts,
    /// Median of the solve times of the solved cases.
    pub solve_time_ms: Option<f64>,
    /// Cases that it and a planner in the plane solved.
    pub compared: usize,
    /// Over these, means of its costs over those of the best plan in the plane: the one with the least sum
    /// of arrivals.
    pub ratios: WorldCosts,
}

/// Costs in the world of a task, or their ratios.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct WorldCosts {
    /// Length of all paths in metres.
    pub length_m: Option<f64>,
    /// Sum of arrivals in seconds.
    pub soc_s: Option<f64>,
    /// The latest arrival in seconds.
    pub makespan_s: Option<f64>,
}

impl WorldCosts {
    /// Of a case that was solved: medians over its repeats.
    fn of(case: &Case<'_>) -> Self {
        let value = |column| case.value(Metric::named(column)?);
        Self {
            length_m: value("path_length_m"),
            soc_s: value("soc_s"),
            makespan_s: value("makespan_s"),
        }
    }

    /// Over others; a plan without a way is as good as any without one.
    fn over(self, other: Self) -> Self {
        let ratio = |own: Option<f64>, other: Option<f64>| {
            let (own, other) = (own?, other?);
            if other > 0.0 {
                Some(own / other)
            } else {
                (own == 0.0).then_some(1.0)
            }
        };
        Self {
            length_m: ratio(self.length_m, other.length_m),
            soc_s: ratio(self.soc_s, other.soc_s),
            makespan_s: ratio(self.makespan_s, other.makespan_s),
        }
    }

    fn mean(all: &[Self]) -> Self {
        let of = |read: fn(&Self) -> Option<f64>| mean(&sorted(all.iter().filter_map(read)));
        Self {
            length_m: of(|one| one.length_m),
            soc_s: of(|one| one.soc_s),
            makespan_s: of(|one| one.makespan_s),
        }
    }
}

impl ViewLine {
    /// By team size, then in the suite's order; none where nobody was asked about a view.
    pub(super) fn all(trials: &Trials<'_>) -> Vec<Self> {
        let cases = || trials.planners().iter().flat_map(|planner| &planner.cases);
        let mut best: Vec<Option<WorldCosts>> = vec![None; trials.instances().len()];
        for case in cases() {
            let plane = Representation::Continuous.name();
            let is_plane =
                first(case).is_some_and(|row| row.representation.as_deref() == Some(plane));
            let found = WorldCosts::of(case);
            let Some(own) = found.soc_s.filter(|_| is_plane) else {
                continue;
            };
            let known = &mut best[case.instance];
            if known
                .and_then(|known| known.soc_s)
                .is_none_or(|known| own < known)
            {
                *known = Some(found);
            }
        }
        let mut lines: BTreeMap<(u64, usize), Vec<&Case<'_>>> = BTreeMap::new();
        for (number, planner) in trials.planners().iter().enumerate() {
            for case in &planner.cases {
                if let Some(row) = first(case).filter(|row| row.view.is_some()) {
                    lines.entry((row.agents, number)).or_default().push(case);
                }
            }
        }
        let lines = lines.into_values();
        lines.filter_map(|cases| Self::of(&cases, &best)).collect()
    }

    fn of(cases: &[&Case<'_>], best: &[Option<WorldCosts>]) -> Option<Self> {
        let row = first(cases.first()?)?;
        let solved: Vec<&&Case<'_>> = cases.iter().filter(|case| case.success()).collect();
        let costs: Vec<WorldCosts> = solved.iter().map(|case| WorldCosts::of(case)).collect();
        let ratios: Vec<WorldCosts> = (solved.iter().zip(&costs))
            .filter_map(|(case, own)| Some(own.over(best[case.instance]?)))
            .collect();
        let rows = cases.iter().flat_map(|case| &case.repeats);
        let only_in_view = |row: &&&Row| row.failure().as_deref() == Some(INVALID_IN_WORLD);
        Some(Self {
            agents: row.agents,
            representation: row.representation.clone().unwrap_or_default(),
            view: row.view.clone().unwrap_or_default(),
            planner: row.planner.clone(),
            cases: cases.len(),
            solved: solved.len(),
            invalid_in_world: rows.filter(only_in_view).count(),
            means: WorldCosts::mean(&costs),
            solve_time_ms: median(&sorted(
                solved.iter().filter_map(|case| case.value(&SOLVE_TIME)),
            )),
            compared: ratios.len(),
            ratios: WorldCosts::mean(&ratios),
        })
    }
}

fn first<'a>(case: &Case<'a>) -> Option<&'a Row> {
    case.repeats.first().copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(task: &str, view: (&str, &str), planner: &str, costs: Option<[f64; 3]>) -> Row {
        Row {
            key: format!("{task} {view:?} {planner}"),
            planner: planner.into(),
            agents: 3,
            instance_digest: format!("{task} {view:?}"),
            task_digest: Some(task.into()),
            representation: Some(view.0.into()),
            view: Some(view.1.into()),
            termination: "completed".into(),
            claim: Some("solved".into()),
            plan_digest: Some("p".into()),
            valid_in_view: (view.0 != "continuous").then_some(true),
            valid_in_world: Some(costs.is_some()),
            success: costs.is_some(),
            valid: costs.is_some(),
            path_length_m: costs.map(|costs| costs[0]),
            soc_s: costs.map(|costs| costs[1]),
            makespan_s: costs.map(|costs| costs[2]),
            solve_time_ms: 2.0,
            ..Row::default()
        }
    }

    #[test]
    fn views_of_one_task_stand_beside_the_best_plan_in_the_plane() {
        let (grid, plane) = (("grid", "wide"), ("continuous", "continuous"));
        let rows = [
            row("a", grid, "cells", Some([12.0, 30.0, 9.0])),
            row("b", grid, "cells", None),
            row("c", grid, "cells", Some([5.0, 5.0, 5.0])),
            // The second has the least sum of arrivals, and the longer way.
            row("a", plane, "one", Some([10.0, 24.0, 6.0])),
            row("a", plane, "two", Some([11.0, 20.0, 6.0])),
            row("b", plane, "one", Some([1.0, 1.0, 1.0])),
            row("c", plane, "one", None),
        ];
        let trials = Trials::new(&rows);
        assert_eq!(trials.instances().len(), 3, "one per task");
        let lines = ViewLine::all(&trials);
        let told: Vec<_> = lines
            .iter()
            .map(|line| {
                (
                    line.view.as_str(),
                    line.planner.as_str(),
                    line.cases,
                    line.solved,
                )
            })
            .collect();
        assert_eq!(
            told,
            [
                ("wide", "cells", 3, 2),
                ("continuous", "one", 3, 2),
                ("continuous", "two", 1, 1)
            ]
        );
        let of_cells = &lines[0];
        assert_eq!((of_cells.invalid_in_world, of_cells.compared), (1, 1));
        assert_eq!(
            of_cells.ratios,
            WorldCosts {
                length_m: Some(12.0 / 11.0),
                soc_s: Some(1.5),
                makespan_s: Some(1.5),
            }
        );
        assert_eq!(of_cells.means.soc_s, Some(17.5));
        assert_eq!(lines[1].ratios.soc_s, Some(f64::midpoint(1.2, 1.0)));
        assert_eq!(lines[2].ratios.soc_s, Some(1.0));
        assert!(ViewLine::all(&Trials::new(&[Row::default()])).is_empty());
    }
}
