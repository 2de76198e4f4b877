//! Plans that get shorter as long as there is time: a first plan, then large neighbourhood search.
//!
//! The first plan comes of repairs ([`lns::repair`](crate::lns::repair)) or of steps ([`lacam`](crate::lacam)).

use crate::closeness::Closeness;
use crate::lacam::{self, schedule};
use crate::lns::{self, Team, improve::Ways};
use crate::plan::Path;
use crate::priority::{Disc, rests, tasks};
use crate::rest::Known;
use crate::sipp::Task;

/// Telling of a plan costs about as much as expanding so many states per visit.
const REPORT: u64 = 2;
/// Costs closer to a lower bound differ by rounding, as a share of it.
const ROUNDING: f64 = 1e-9;

/// The way to a first plan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Begin {
    /// Paths that meet few others, which are repaired.
    Repair,
    /// Configurations one after the other; repairs where these end without a plan.
    Steps,
}

/// Settings.
#[derive(Debug, Clone, Copy)]
pub struct Settings {
    /// The way to a first plan.
    pub begin: Begin,
    /// Discs that are planned anew at a time.
    pub neighborhood: usize,
    /// Of random choices.
    pub seed: u64,
}

/// Limits of a run.
pub struct Control<'a> {
    /// True once the budget is spent; asked often.
    pub stop: &'a mut dyn FnMut() -> bool,
    /// Configurations, searches for first paths and neighbourhoods that may be tried.
    pub nodes: u64,
    /// About how many bytes the search may hold beside the roadmap.
    pub memory: u64,
}

/// Work of a run.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Work {
    /// Nodes of the limit that were used.
    pub nodes: u64,
    /// Configurations among them.
    pub configurations: u64,
    /// Pairs of discs that met after everybody was planned once, and neighbourhoods for their repair.
    pub pairs_at_first: u64,
    /// Neighbourhoods for their repair.
    pub repairs: u64,
    /// States that searches expanded.
    pub expanded: u64,
    /// Sum of the times at which everybody would arrive alone, in seconds.
    pub lower_bound: f64,
}

/// Reason why a run ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum End {
    /// A plan was told that no other can be better than, or as good as the limits allow.
    Solved,
    /// No way leads this disc to its goal, not even alone.
    NoWay(usize),
    /// It was told to stop before there was a plan, or had no nodes left.
    Stopped,
    /// It needs more memory than it may have.
    Memory,
}

/// Result, and the work for it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outcome {
    /// Reason why it ended.
    pub end: End,
    /// Work.
    pub work: Work,
}

/// Plans for discs of one goal each, where they stay, and tells each plan that is better than the last.
pub fn plan(
    closeness: &Closeness,
    known: &mut Known,
    discs: &[Disc],
    settings: Settings,
    control: &mut Control<'_>,
    found: &mut dyn FnMut(&[Path]),
) -> Outcome {
    let mut work = Work::default();
    let team = (discs, f64::INFINITY);
    let Some(rests) = rests(closeness, known, team, control.stop) else {
        let end = End::Stopped;
        return Outcome { end, work };
    };
    let tasks = tasks(team, &rests);
    let roadmap = closeness.roadmap();
    if let Some(disc) = tasks
        .iter()
        .position(|task| task.alone(roadmap).is_infinite())
    {
        let end = End::NoWay(disc);
        return Outcome { end, work };
    }
    let mut team = Team::new(closeness, &tasks, (settings.neighborhood, settings.seed));
    work.lower_bound = team.lower_bound();
    let end = first(&mut team, (closeness, &tasks), settings, control, &mut work);
    if end == End::Solved {
        found(team.paths());
        improve(&mut team, control, &mut work, found);
    }
    work.expanded = team.expanded();
    Outcome { end, work }
}

/// Gives the team its first plan.
fn first(
    team: &mut Team<'_>,
    (closeness, tasks): (&Closeness, &[Task<'_>]),
    settings: Settings,
    control: &mut Control<'_>,
    work: &mut Work,
) -> End {
    if settings.begin == Begin::Steps {
        let mut limits = lacam::Control {
            stop: control.stop,
            nodes: control.nodes,
            memory: control.memory,
        };
        let (end, made) = lacam::search(closeness, tasks, settings.seed, &mut limits);
        work.configurations = made;
        work.nodes += made;
        control.nodes -= made;
        match end {
            lacam::End::Solved(steps) => {
                let starts: Vec<u32> = tasks.iter().map(|task| task.start).collect();
                team.adopt(schedule::earliest(closeness, &starts, &steps));
                if team.pairs() == 0 {
                    return End::Solved;
                }
            }
            lacam::End::Stopped => return End::Stopped,
            lacam::End::Exhausted | lacam::End::Memory => {}
        }
    }
    let mut limits = lns::Control {
        stop: control.stop,
        nodes: control.nodes,
    };
    let repaired = team.repair(&mut limits);
    work.nodes += control.nodes - limits.nodes;
    control.nodes = limits.nodes;
    work.pairs_at_first = repaired.pairs_at_first as u64;
    work.repairs = repaired.neighborhoods;
    match repaired.valid {
        true => End::Solved,
        false if team.bytes() > control.memory => End::Memory,
        false => End::Stopped,
    }
}

/// Makes a plan shorter until a limit is met, or everybody goes as if alone.
fn improve(
    team: &mut Team<'_>,
    control: &mut Control<'_>,
    work: &mut Work,
    found: &mut dyn FnMut(&[Path]),
) {
    let mut limits = lns::Control {
        stop: control.stop,
        nodes: control.nodes,
    };
    let mut ways = Ways::default();
    let visits: usize = team.paths().iter().map(Vec::len).sum();
    let least = team.lower_bound() * (1.0 + ROUNDING);
    let (mut told, mut gained) = (team.expanded(), 0.0);
    while team.cost() > least && !limits.spend() {
        gained += team.improve(&mut ways, &mut limits);
        if gained > 0.0 && team.expanded() - told > REPORT * visits as u64 {
            found(team.paths());
            (told, gained) = (team.expanded(), 0.0);
        }
    }
    if gained > 0.0 {
        found(team.paths());
    }
    work.nodes += control.nodes - limits.nodes;
}
