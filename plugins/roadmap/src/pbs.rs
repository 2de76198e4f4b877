//! Priority-based search in continuous time: priorities only between discs that meet.
//!
//! H. Ma, D. Harabor, P. J. Stuckey, J. Li, S. Koenig, "Searching with consistent prioritization for multi-agent path finding",
//! AAAI 2019. A node is a partial order of the discs, and paths of which each keeps out of the way of all that come before it in
//! the order. At the root nobody does. Where two meet the order is decided both ways; discs whose path no longer fits are planned
//! anew, by safe intervals. The search goes depth first. After some dead ends it begins anew, with those first that found no path.

use fleetyard_abi::leftovers::Leftover;
use fleetyard_plugin_spacetime::order::{Order, Prefer};

use crate::closeness::Closeness;
use crate::crowd::{Crowd, Others, Scratch};
use crate::plan::{Path, Visit};
use crate::sipp::{Found, Search, Task};

/// The search begins anew after so many dead ends, then after half as many more, and so on.
const PATIENCE: u64 = 20;

/// Limits of a run.
pub struct Control<'a> {
    /// True once the budget is spent; asked often.
    pub stop: &'a mut dyn FnMut() -> bool,
    /// At most so many nodes are made.
    pub nodes: u64,
    /// About how many bytes the search may hold beside the roadmap.
    pub memory: u64,
}

/// Reason why a search ended.
#[derive(Debug, Clone, PartialEq)]
pub enum End {
    /// With paths that keep their distance.
    Solved(Vec<Path>),
    /// It was told to stop, or made all nodes that it may.
    Stopped,
    /// No order that the search looks at leads to a plan.
    Exhausted,
    /// It needs more memory than it may have.
    Memory,
}

/// Searches for priorities, and says how many nodes it made.
pub fn search(
    closeness: &Closeness,
    tasks: &[Task<'_>],
    (until, prefer): (f64, Prefer),
    single: &mut Search,
    control: &mut Control<'_>,
) -> (End, u64) {
    let mut crowd = Crowd::new(closeness, tasks.len(), until);
    for (disc, task) in tasks.iter().enumerate() {
        crowd.hold(disc, task.start, task.least_stay(closeness.roadmap()));
    }
    let mut run = Run {
        closeness,
        tasks,
        prefer,
        crowd,
        scratch: Scratch::new(closeness),
        single,
        order: Order::new(tasks.len()),
        failed: vec![0; tasks.len()],
        nodes: 0,
    };
    let end = match run.search(control) {
        Stop::Solved => End::Solved(run.crowd.into_paths()),
        Stop::Told => End::Stopped,
        Stop::Exhausted => End::Exhausted,
        Stop::Memory => End::Memory,
    };
    (end, run.nodes)
}

enum Stop {
    Solved,
    Told,
    Exhausted,
    Memory,
}

/// The search was told to stop.
struct Told;

/// The path of a disc.
type Planned = (u32, Path);

/// A node that has yet to be looked at: a decision, and the paths that it changes.
struct Child {
    decision: (u32, u32),
    paths: Vec<Planned>,
    cost: f64,
    pairs: usize,
}

fn bytes(paths: &[Planned]) -> u64 {
    let each = |(_, path): &Planned| size_of::<Planned>() + path.len() * size_of::<Visit>();
    (size_of::<Child>() + paths.iter().map(each).sum::<usize>()) as u64
}

/// A node on the way from the root to where the search is.
#[derive(Default)]
struct Frame {
    /// The decision that led here; none at the root.
    decision: Option<(u32, u32)>,
    /// The paths that the decision replaced.
    old: Vec<Planned>,
    /// Children not yet looked at, the next one last.
    children: Vec<Child>,
}

struct Run<'a> {
    closeness: &'a Closeness,
    tasks: &'a [Task<'a>],
    prefer: Prefer,
    crowd: Crowd<'a>,
    scratch: Scratch,
    single: &'a mut Search,
    order: Order,
    /// Number of searches of each disc that found no path.
    failed: Vec<u32>,
    nodes: u64,
}

impl Run<'_> {
    fn search(&mut self, control: &mut Control<'_>) -> Stop {
        match self.root(control) {
            Ok(true) => {}
            Ok(false) => return Stop::Exhausted,
            Err(Told) => return Stop::Told,
        }
        let mut frames = Leftover::new(vec![Frame::default()]);
        let (mut dead_ends, mut patience, mut held, mut fresh) = (0, PATIENCE, 0, true);
        while let Some(frame) = frames.last_mut() {
            if fresh {
                if self.nodes >= control.nodes || (control.stop)() {
                    return Stop::Told;
                }
                self.nodes += 1;
                let Some(pair) = self.crowd.first_pair() else {
                    return Stop::Solved;
                };
                let Ok(children) = self.children(pair, control) else {
                    return Stop::Told;
                };
                frame.children = children;
                let new = frame.children.iter().map(|child| bytes(&child.paths));
                held += new.sum::<u64>();
                if held + self.crowd.bytes() > control.memory {
                    return Stop::Memory;
                }
                if frame.children.is_empty() {
                    dead_ends += 1;
                }
                if dead_ends > patience {
                    patience += patience / 2;
                    (dead_ends, held) = (0, 0);
                    while frames.len() > 1 {
                        frames.pop().into_iter().for_each(|frame| self.undo(frame));
                    }
                    frames[0].children.clear();
                    continue;
                }
            }
            if let Some(child) = frame.children.pop() {
                self.order.decide(child.decision);
                let old = self.exchange(child.paths);
                frames.push(Frame {
                    decision: Some(child.decision),
                    old,
                    children: Vec::new(),
                });
                fresh = true;
            } else if let Some(frame) = frames.pop() {
                fresh = false;
                held = held.saturating_sub(bytes(&frame.old));
                self.undo(frame);
            }
        }
        Stop::Exhausted
    }

    /// Everybody on the path that it would have alone. False if somebody has none.
    fn root(&mut self, control: &mut Control<'_>) -> Result<bool, Told> {
        for disc in 0..self.tasks.len() as u32 {
            self.order.mark_before(disc);
            let Some(path) = self.replan(disc, control)? else {
                return Ok(false);
            };
            self.crowd.exchange(disc, path);
        }
        Ok(true)
    }

    fn undo(&mut self, frame: Frame) {
        self.exchange(frame.old);
        if let Some(decision) = frame.decision {
            self.order.forget(decision);
        }
    }

    /// Exchanges paths for others.
    fn exchange(&mut self, paths: Vec<Planned>) -> Vec<Planned> {
        let crowd = &mut self.crowd;
        let paths = paths.into_iter();
        paths
            .map(|(disc, path)| (disc, crowd.exchange(disc, path)))
            .collect()
    }

    /// Both decisions about a pair, as far as there are paths; the better one last.
    fn children(
        &mut self,
        (a, b): (u32, u32),
        control: &mut Control<'_>,
    ) -> Result<Vec<Child>, Told> {
        let mut children = Vec::with_capacity(2);
        for decision in [(a, b), (b, a)] {
            children.extend(self.child(decision, control)?);
        }
        children.sort_by(|one: &Child, other: &Child| {
            // The last is taken first.
            let failed = |child: &Child| self.failed[child.decision.0 as usize];
            let cost = other.cost.total_cmp(&one.cost);
            let pairs = other.pairs.cmp(&one.pairs);
            let better = match self.prefer {
                Prefer::Cost => cost.then(pairs),
                Prefer::Collisions => pairs.then(cost),
            };
            failed(one).cmp(&failed(other)).then(better)
        });
        Ok(children)
    }

    fn child(
        &mut self,
        decision: (u32, u32),
        control: &mut Control<'_>,
    ) -> Result<Option<Child>, Told> {
        self.order.decide(decision);
        let mut old = Vec::new();
        let planned = self.settle(decision.1, &mut old, control);
        let (cost, pairs) = (self.crowd.cost(), self.crowd.pairs());
        let paths = self.exchange(old);
        self.order.forget(decision);
        Ok(planned?.then_some(Child {
            decision,
            paths,
            cost,
            pairs,
        }))
    }

    /// Plans anew whoever, from a disc on, does not keep out of the way of those before it; false if somebody cannot. What paths
    /// were goes into `old`.
    fn settle(
        &mut self,
        disc: u32,
        old: &mut Vec<Planned>,
        control: &mut Control<'_>,
    ) -> Result<bool, Told> {
        for disc in self.order.from(disc) {
            self.order.mark_before(disc);
            let mut met = self.crowd.meetings(disc).iter();
            if !met.any(|meeting| self.order.is_before(meeting.disc)) {
                continue;
            }
            let Some(path) = self.replan(disc, control)? else {
                self.failed[disc as usize] += 1;
                return Ok(false);
            };
            old.push((disc, self.crowd.exchange(disc, path)));
        }
        Ok(true)
    }

    /// The earliest path of a disc that keeps out of the way of those marked to be before it.
    fn replan(&mut self, disc: u32, control: &mut Control<'_>) -> Result<Option<Path>, Told> {
        let order = &self.order;
        let counts = |other| order.is_before(other);
        let others = Others::new(&self.crowd, &mut self.scratch, disc, counts);
        let (roadmap, task) = (self.closeness.roadmap(), &self.tasks[disc as usize]);
        match self.single.find(roadmap, &others, task, control.stop) {
            Found::Path(path) => Ok(Some(path)),
            Found::None => Ok(None),
            Found::Stopped => Err(Told),
        }
    }
}
