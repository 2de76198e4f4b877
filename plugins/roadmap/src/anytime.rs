//! Plans that get shorter as long as there is time: a first plan, then large neighbourhood search.
//!
//! The first plan comes of repairs ([`crate::lns::repair`]) or of steps ([`crate::lacam`]). Steps are many times faster and cost
//! up to twice as much, since everybody waits for everybody in every step and the order in which discs pass stays; so repairs make
//! another plan after them, and the better one is improved.

use crate::closeness::Closeness;
use crate::lacam::{self, schedule};
use crate::lns::{self, Team, improve::Ways};
use crate::plan::Path;
use crate::priority::{Disc, rests, sum_of_costs, tasks};
use crate::rest::Known;
use crate::roadmap::Vertex;
use crate::sipp::Task;

/// Telling of a plan costs about as much as expanding so many states per visit.
const REPORT: u64 = 2;
/// Searches and neighbourhoods per disc for another plan when there is one of steps.
const NODES: u64 = 10;
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
    /// Plans are improved; else the first one is the last.
    pub anytime: bool,
    /// Of random choices.
    pub seed: u64,
}

/// Limits of a run.
pub struct Control<'a> {
    /// True once the budget is spent; asked often.
    pub stop: &'a mut dyn FnMut() -> bool,
    /// Configurations, neighbourhoods, and searches for the path of one disc that may be tried.
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
    /// Plans that were told.
    pub plans: u64,
    /// Cost of the first plan, in seconds.
    pub first_cost: f64,
    /// Pairs of discs that met after everybody was planned once.
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
    let work = Work::default();
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
    let mut run = Run {
        closeness,
        tasks: &tasks,
        settings,
        control,
        work,
        found,
    };
    let end = run.begin();
    let work = run.work;
    Outcome { end, work }
}

/// A run under way.
struct Run<'a, 'b> {
    closeness: &'a Closeness,
    tasks: &'a [Task<'a>],
    settings: Settings,
    control: &'a mut Control<'b>,
    work: Work,
    found: &'a mut dyn FnMut(&[Path]),
}

impl Run<'_, '_> {
    fn begin(&mut self) -> End {
        let roadmap = self.closeness.roadmap();
        let alone = self.tasks.iter().map(|task| task.alone(roadmap));
        self.work.lower_bound = alone.sum();
        let first = match self.settings.begin {
            Begin::Repair => None,
            Begin::Steps => match self.in_steps() {
                Ok(first) => first,
                Err(end) => return end,
            },
        };
        if first.is_some() && !self.settings.anytime {
            return End::Solved;
        }
        let Settings {
            neighborhood, seed, ..
        } = self.settings;
        let mut team = Team::new(self.closeness, self.tasks, (neighborhood, seed));
        let end = self.repair(&mut team, first);
        if end == End::Solved && self.settings.anytime {
            self.improve(&mut team);
        }
        self.work.expanded = team.expanded();
        end
    }

    /// A first plan by steps, which is told; none where the search for it ends without one.
    fn in_steps(&mut self) -> Result<Option<Vec<Path>>, End> {
        let mut limits = lacam::Control {
            stop: self.control.stop,
            nodes: self.control.nodes,
            memory: self.control.memory,
        };
        let seed = self.settings.seed;
        let (end, made) = lacam::search(self.closeness, self.tasks, seed, &mut limits);
        self.work.configurations = made;
        self.spent(made);
        match end {
            lacam::End::Solved(steps) => {
                let starts: Vec<Vertex> = self.tasks.iter().map(|task| task.start).collect();
                let paths = schedule::earliest(self.closeness, &starts, &steps);
                self.tell(&paths);
                Ok(Some(paths))
            }
            lacam::End::Stopped => Err(End::Stopped),
            lacam::End::Exhausted | lacam::End::Memory => Ok(None),
        }
    }

    /// Gives the team a plan of its own, which costs less than that of steps as a rule, or that one.
    fn repair(&mut self, team: &mut Team<'_>, first: Option<Vec<Path>>) -> End {
        let enough = match &first {
            Some(first) => NODES * first.len() as u64,
            None => u64::MAX,
        };
        let mut limits = self.limits();
        limits.nodes = limits.nodes.min(enough);
        let left = limits.nodes;
        let repaired = team.repair(&mut limits);
        let spent = left - limits.nodes;
        self.spent(spent);
        self.work.pairs_at_first = repaired.pairs_at_first as u64;
        self.work.repairs = repaired.neighborhoods;
        match first {
            // There is neither time nor room for the paths that are to be improved.
            Some(_) if (self.control.stop)() || team.bytes() > self.control.memory => {
                self.control.nodes = 0;
                End::Solved
            }
            Some(first) if !repaired.valid || team.cost() >= sum_of_costs(&first) => {
                team.adopt(first);
                End::Solved
            }
            _ if repaired.valid => {
                self.tell(team.paths());
                End::Solved
            }
            _ if team.bytes() > self.control.memory => End::Memory,
            _ => End::Stopped,
        }
    }

    /// Makes a plan shorter until a limit is met, or everybody goes as if alone.
    fn improve(&mut self, team: &mut Team<'_>) {
        let mut ways = Ways::default();
        let visits: usize = team.paths().iter().map(Vec::len).sum();
        let least = self.work.lower_bound * (1.0 + ROUNDING);
        let (mut told, mut gained) = (team.expanded(), 0.0);
        while team.cost() > least {
            let mut limits = self.limits();
            let left = limits.nodes;
            let is_over = limits.spend();
            if !is_over {
                gained += team.improve(&mut ways, &mut limits);
            }
            let spent = left - limits.nodes;
            self.spent(spent);
            if is_over {
                break;
            }
            if gained > 0.0 && team.expanded() - told > REPORT * visits as u64 {
                self.tell(team.paths());
                (told, gained) = (team.expanded(), 0.0);
            }
        }
        if gained > 0.0 {
            self.tell(team.paths());
        }
    }

    fn limits(&mut self) -> lns::Control<'_> {
        lns::Control {
            stop: self.control.stop,
            nodes: self.control.nodes,
            memory: self.control.memory,
        }
    }

    fn spent(&mut self, nodes: u64) {
        self.work.nodes += nodes;
        self.control.nodes -= nodes;
    }

    fn tell(&mut self, paths: &[Path]) {
        if self.work.plans == 0 {
            self.work.first_cost = sum_of_costs(paths);
        }
        self.work.plans += 1;
        (self.found)(paths);
    }
}
