//! Prioritised planning that goes on where orders of all discs fail: by priorities between two at a time.
//!
//! K. Kasaura, M. Nishimura, R. Yonetani, "Prioritized safe interval path planning for multi-agent pathfinding with continuous
//! time on 2D roadmaps", RA-L 7(4), 2022, plan in one order. Where roadmap vertices are closer than the separation a disc at its
//! goal blocks several of them, and one order seldom does. So others are tried, in which those come first that found no path
//! ([`crate::priority`]). Then priorities are searched for where discs meet ([`crate::pbs`]): that takes longer, and
//! leads to shorter paths, since fewer discs give way.

use fleetyard_plugin_plane::orders;
use fleetyard_plugin_spacetime::order::Prefer;

use crate::closeness::Closeness;
use crate::pbs::{self, Control, End};
use crate::plan::Path;
use crate::priority::{Disc, in_orders, rests, sum_of_costs, tasks};
use crate::rest::Known;
use crate::sipp::Search;

/// Nodes of the search for priorities per disc when there is a plan already: most searches end within two.
const NODES: u64 = 10;

/// Settings.
#[derive(Debug, Clone, Copy)]
pub struct Settings {
    /// Most orders of all discs to try.
    pub orders: u64,
    /// The child of a node that priority-based search looks at first.
    pub prefer: Prefer,
    /// Of shuffled orders.
    pub seed: u64,
}

/// Result, and the work for it.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// Paths, or the reason why there are none.
    pub end: Ended,
    /// Orders that were tried.
    pub orders: u64,
    /// Nodes of priority-based search.
    pub nodes: u64,
    /// States that searches expanded.
    pub expanded: u64,
}

/// Reason why planning ended.
#[derive(Debug, Clone, PartialEq)]
pub enum Ended {
    /// No way leads this disc to its goals, not even alone.
    NoWay(usize),
    /// As of the last method that was tried.
    Tried(End),
}

/// Plans for discs up to the time `until`, after which they may be in each other's way; infinite for whole paths. Tells each plan
/// that is better than the last; in a window the first one is the last.
pub fn plan(
    closeness: &Closeness,
    known: &mut Known,
    team: (&[Disc], f64),
    settings: Settings,
    control: &mut Control<'_>,
    found: &mut dyn FnMut(&[Path]),
) -> Outcome {
    let mut outcome = Outcome {
        end: Ended::Tried(End::Stopped),
        orders: 0,
        nodes: 0,
        expanded: 0,
    };
    let Some(rests) = rests(closeness, known, team, control.stop) else {
        return outcome;
    };
    let tasks = tasks(team, &rests);
    let roadmap = closeness.roadmap();
    if let Some(disc) = tasks
        .iter()
        .position(|task| task.alone(roadmap).is_infinite())
    {
        outcome.end = Ended::NoWay(disc);
        return outcome;
    }
    let mut single = Search::new(roadmap);
    let limit = (settings.orders.min(control.nodes), settings.seed);
    let (first, orders) = in_orders(closeness, &tasks, limit, &mut single, control.stop);
    outcome.orders = orders;
    let mut nodes = control.nodes - orders;
    let first = match first {
        orders::End::Solved(paths) => {
            found(&paths);
            nodes = nodes.min(NODES * tasks.len() as u64);
            Some(paths)
        }
        orders::End::Stopped => {
            nodes = 0;
            None
        }
        orders::End::GaveUp => None,
    };
    let whole = team.1 == f64::INFINITY;
    let mut end = End::Stopped;
    if nodes > 0 && (whole || first.is_none()) {
        let mut control = Control {
            stop: control.stop,
            nodes,
            memory: control.memory,
        };
        let how = (team.1, settings.prefer);
        (end, outcome.nodes) = pbs::search(closeness, &tasks, how, &mut single, &mut control);
    }
    outcome.end = Ended::Tried(match (first, end) {
        (Some(first), End::Solved(paths)) if sum_of_costs(&paths) >= sum_of_costs(&first) => {
            End::Solved(first)
        }
        (_, End::Solved(paths)) => {
            found(&paths);
            End::Solved(paths)
        }
        (Some(first), _) => End::Solved(first),
        (None, end) => end,
    });
    outcome.expanded = single.expanded;
    outcome
}
