//! The last node of a search, for people: its constraints, and the conflicts that it has left.

use fleetyard_abi::Annotation;
use fleetyard_abi::sdk::Annotations;
use fleetyard_plugin_spacetime::conflict::{FOREVER, Kind};
use fleetyard_plugin_spacetime::graph::Vertex;
use fleetyard_plugin_spacetime::problem::Problem;

use crate::{Constraint, Outcome};

/// Hands over what there is to show, in layers `constraints` and `conflicts`; a step takes so long.
pub(crate) fn show(outcome: &Outcome, problem: &Problem, step_s: f64, to: &dyn Annotations) {
    let cell = |v: &Vertex| problem.graph.cell(*v);
    let seconds = |step: u32| f64::from(step) * step_s;
    let until = |step: u32| (step < FOREVER).then(|| seconds(step));
    let shown = outcome.constraints.iter().map(|constraint| {
        let about = |shape: &[u32], from: u32, to: u32, text: String| Annotation {
            agent: Some(constraint.agent()),
            from_s: seconds(from),
            to_s: until(to),
            text,
            ..Annotation::places("constraints", [shape.iter().copied()])
        };
        match constraint {
            Constraint::Cell { v, begin, end, .. } => {
                about(&[cell(v)], *begin, *end, "is not here".into())
            }
            Constraint::Barrier { cells, .. } => {
                let times = || cells.iter().map(|(_, time)| *time);
                let (from, to) = (times().min().unwrap_or(0), times().max().unwrap_or(0));
                Annotation {
                    places: cells.iter().map(|(v, _)| [cell(v)]).collect(),
                    values: times().map(seconds).collect(),
                    ..about(
                        &[],
                        from,
                        to,
                        "is not here at the second of the value".into(),
                    )
                }
            }
            Constraint::Move { from, to, time, .. } => {
                let ends = [cell(from), cell(to)];
                about(&ends, *time, time + 1, "does not make this move".into())
            }
            Constraint::ArriveAfter { agent, time } => {
                let goal = problem.routes[*agent as usize].goals.last().map(cell);
                let text = format!("arrives for good after {} s", seconds(*time));
                about(goal.as_slice(), 0, *time, text)
            }
            Constraint::ArriveBy {
                goal, time, others, ..
            } => {
                let by = format!("arrives for good by {} s", seconds(*time));
                let text = format!("{by}, and nobody else is here from now on");
                about(&[cell(goal)], *others, FOREVER, text)
            }
        }
    });
    let left = outcome.conflicts.iter().map(|conflict| {
        let [one, other] = conflict.agents;
        let (cells, steps): (Vec<u32>, u32) = match &conflict.kind {
            Kind::Cell(v) => (vec![cell(v)], 0),
            Kind::Swap(ends) => (ends.iter().map(cell).collect(), 1),
            Kind::Ring(moves) => {
                let round = moves.iter().chain(moves.first());
                (round.map(|(_, v)| cell(v)).collect(), 1)
            }
        };
        Annotation {
            from_s: seconds(conflict.time),
            to_s: Some(seconds(conflict.time + steps)),
            text: format!("agents {one} and {other} collide"),
            ..Annotation::places("conflicts", [cells])
        }
    });
    for annotation in shown.chain(left) {
        // What is not kept the host counts.
        let _ = to.annotate(&annotation);
    }
}
