//! Space-time A\* for one agent under constraints, with focal search: the low level of
//! constraint-tree searches.
//!
//! States are poses at steps, with the number of goals that have been visited. Of all paths
//! whose cost is within the bound ([`Query::weight`]) those that run into fewest others are
//! preferred (Barer et al., "Suboptimal variants of the conflict-based search algorithm",
//! SoCS 2014). With a weight of 1 that is A\* whose ties go to the path with the fewest
//! collisions, which it finds exactly: all ways to a state have the same f.
//!
//! After the last constraint and the last move of anybody else, time stands still in the
//! table of states, so that a search without a solution ends.

use std::cmp::Reverse;
use std::collections::{BinaryHeap, VecDeque};

use fleetyard_abi::leftovers::Leftover;

use crate::conflict::FOREVER;
use crate::constraints::Constraints;
use crate::graph::Vertex;
use crate::known::{Known, NONE};
use crate::pose::{MOVES, Pose, Poses};
use crate::problem::Route;
use crate::sipp::Guidance;
use crate::traffic::Traffic;

/// Expansions between two calls of `stop`.
const PATIENCE: u32 = 512;
/// Most states of one search: 1 GiB.
const MOST_STATES: usize = 1 << 25;

/// The input of a search.
pub struct Query<'a> {
    /// The agent's number in the traffic.
    pub agent: u32,
    /// The start and the goals.
    pub route: &'a Route,
    /// Constraints on the path.
    pub constraints: &'a Constraints,
    /// The others; the agent itself is not in it.
    pub traffic: Option<&'a Traffic>,
    /// Last step that matters: paths end there, wherever they are. [`FOREVER`] for none.
    pub until: u32,
    /// Factor by which the cost may exceed the least one: by `weight - 1` of the least cost, of
    /// which no more counts than the steps up to `until`. At least 1.
    pub weight: f64,
    /// A lower bound of the cost that is known already.
    pub least: u32,
    /// Paths that cost more are of no use.
    pub most: u32,
}

/// The result of a search.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Found {
    /// A vertex per step. The agent stays at the end, or the window ends there.
    pub path: Vec<Vertex>,
    /// Steps until the last goal; where the window ends before, the least number it takes.
    pub cost: u32,
    /// A lower bound of the cost of any path under these constraints.
    pub bound: u32,
    /// Collisions of the path with the traffic.
    pub collisions: u32,
}

/// The search was told to stop, or needed too much memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stopped;

#[derive(Debug, Clone, Copy)]
struct State {
    pose: Pose,
    time: u32,
    /// Goals visited; [`NONE`] for the end of a path, not to be expanded but returned.
    stage: u32,
    cost: u32,
    collisions: u32,
    parent: u32,
    /// Neither expanded nor superseded.
    open: bool,
}

/// Working memory of searches on one graph, kept from one to the next.
#[derive(Debug, Clone)]
pub struct Astar<'g> {
    poses: Poses<'g>,
    states: Leftover<Vec<State>>,
    table: Table,
    /// States within the bound: fewest collisions, then least cost, then latest.
    focal: BinaryHeap<Reverse<(u64, u32)>>,
    /// States beyond the bound, by their cost less `limit + 1`.
    beyond: VecDeque<Vec<u32>>,
    /// Number of open states, by their cost less `base`.
    open: VecDeque<u32>,
    origin: u32,
    base: u32,
    limit: u32,
    expansions: u64,
}

impl<'g> Astar<'g> {
    /// Nothing searched yet.
    pub fn new(poses: Poses<'g>) -> Self {
        Self {
            poses,
            states: Leftover::default(),
            table: Table::default(),
            focal: BinaryHeap::new(),
            beyond: VecDeque::new(),
            open: VecDeque::new(),
            origin: 0,
            base: 0,
            limit: 0,
            expansions: 0,
        }
    }

    /// The poses that it searches.
    pub fn poses(&self) -> Poses<'g> {
        self.poses
    }

    /// States expanded by all searches so far.
    pub fn expansions(&self) -> u64 {
        self.expansions
    }

    /// Finds a path; `None` if there is none.
    pub fn find(
        &mut self,
        query: &Query<'_>,
        stop: &mut dyn FnMut() -> bool,
    ) -> Result<Option<Found>, Stopped> {
        let poses = self.poses;
        let &Query {
            route,
            constraints,
            until,
            ..
        } = query;
        let start = route.start;
        let Some((settle, latest)) = settling(route, constraints, until) else {
            return Ok(None);
        };
        let latest = latest.min(query.most);
        let stage = route.reached(0, start);
        let floor = settle.max(query.least);
        let cost = route.rest(stage, start, route.heading).max(floor);
        if constraints.forbids(start, start, 0) || cost > latest {
            return Ok(None);
        }
        let horizon = query.traffic.map_or(0, Traffic::horizon);
        self.begin(query, cost, constraints.last().max(horizon) + 1);
        self.push(State {
            pose: poses.pose(start, route.heading),
            time: 0,
            stage,
            cost,
            collisions: 0,
            parent: NONE,
            open: true,
        });
        let mut patience = PATIENCE;
        let mut next = [0; MOVES];
        while let Some(id) = self.pop(query) {
            let state = self.states[id as usize];
            if state.stage == NONE {
                return Ok(Some(self.trace(state)));
            }
            self.expansions += 1;
            patience -= 1;
            if patience == 0 {
                patience = PATIENCE;
                if stop() || self.states.len() > MOST_STATES {
                    return Err(Stopped);
                }
            }
            let v = poses.vertex(state.pose);
            let all = route.goals.len() as u32;
            let done = !route.stays && state.stage == all;
            if self.ends(query, &state, settle) {
                let parked = match query.traffic {
                    Some(traffic) if state.time < until => {
                        traffic.collisions_parked(query.agent, v, state.time)
                    }
                    _ => 0,
                };
                let end = State {
                    stage: NONE,
                    collisions: state.collisions + parked,
                    parent: id,
                    open: true,
                    ..state
                };
                if parked == 0 {
                    return Ok(Some(self.trace(end)));
                }
                self.push(end);
                if state.time >= until {
                    continue;
                }
            }
            let time = state.time + 1;
            let count = poses.next(state.pose, &mut next);
            for &pose in &next[..count] {
                let u = poses.vertex(pose);
                let stage = match route.stays && state.stage + 1 >= all {
                    true if u == v && route.goals.last() == Some(&u) => all,
                    true => all - 1,
                    false => route.reached(state.stage, u),
                };
                let rest = route.rest(stage, u, poses.direction(pose));
                let cost = if done {
                    state.cost
                } else {
                    (time + rest).max(floor)
                };
                if cost > latest || constraints.forbids(v, u, time) {
                    continue;
                }
                let met = match query.traffic {
                    Some(traffic) => traffic.collisions(query.agent, v, u, time),
                    None => 0,
                };
                self.push(State {
                    pose,
                    time,
                    stage,
                    cost,
                    collisions: state.collisions + met,
                    parent: id,
                    open: true,
                });
            }
        }
        Ok(None)
    }

    /// True if a path may end in a state.
    fn ends(&self, query: &Query<'_>, state: &State, settle: u32) -> bool {
        let (route, stage) = (query.route, state.stage as usize);
        let v = self.poses.vertex(state.pose);
        if state.time >= query.until {
            return true;
        }
        if !route.stays {
            let constraints = query.constraints;
            return stage == route.goals.len()
                && !constraints.forbids_staying(v, state.time + 1, query.until);
        }
        // The stage of those who were there the step before is another one: they have arrived
        // already, and cannot arrive again without having been away.
        let last = stage + 1 == route.goals.len() && v == route.goals[stage];
        last && state.time >= settle
    }

    fn begin(&mut self, query: &Query<'_>, base: u32, still: u32) {
        self.states.clear();
        self.focal.clear();
        self.open.clear();
        for costs in &mut self.beyond {
            costs.clear();
        }
        let stages = query.route.goals.len() as u64 + 1;
        self.table.begin(self.poses.len() as u64, stages, still);
        (self.origin, self.base) = (base, base);
        self.limit = query.limit(base);
    }

    /// Adds a state unless one as good is there for the same pose and time.
    fn push(&mut self, state: State) {
        let id = self.states.len() as u32;
        if state.stage != NONE {
            let entry = self.table.entry(&state);
            if *entry != NONE {
                let other = &mut self.states[*entry as usize];
                if (other.cost, other.collisions) <= (state.cost, state.collisions) {
                    return;
                }
                if std::mem::take(&mut other.open) {
                    self.open[(other.cost - self.base) as usize] -= 1;
                }
            }
            *entry = id;
        }
        let place = (state.cost - self.base) as usize;
        if place >= self.open.len() {
            self.open.resize(place + 1, 0);
        }
        self.open[place] += 1;
        self.states.push(state);
        if state.cost <= self.limit {
            self.offer(id);
        } else {
            let place = (state.cost - self.limit - 1) as usize;
            if place >= self.beyond.len() {
                self.beyond.resize(place + 1, Vec::new());
            }
            self.beyond[place].push(id);
        }
    }

    /// Puts a state in the focal list.
    fn offer(&mut self, id: u32) {
        let state = &self.states[id as usize];
        if state.open {
            let collisions = u64::from(state.collisions.min(0xffff));
            let cost = u64::from((state.cost - self.origin).min(0xff_ffff));
            let late = u64::from(0xff_ffff - state.time.min(0xff_ffff));
            let key = collisions << 48 | cost << 24 | late;
            self.focal.push(Reverse((key, id)));
        }
    }

    /// Takes the next state to be expanded.
    fn pop(&mut self, query: &Query<'_>) -> Option<u32> {
        let risen = self.open.iter().position(|&count| count > 0)?;
        if risen > 0 {
            self.open.drain(..risen);
            self.base += risen as u32;
            let limit = query.limit(self.base);
            for _ in self.limit..limit {
                let Some(states) = self.beyond.pop_front() else {
                    break;
                };
                for &id in &states {
                    self.offer(id);
                }
            }
            self.limit = limit;
        }
        while let Some(Reverse((_, id))) = self.focal.pop() {
            let state = &mut self.states[id as usize];
            if std::mem::take(&mut state.open) {
                self.open[(state.cost - self.base) as usize] -= 1;
                return Some(id);
            }
        }
        None
    }

    fn trace(&self, end: State) -> Found {
        let mut path = vec![self.poses.vertex(end.pose); end.time as usize + 1];
        let mut state = end;
        while state.parent != NONE {
            state = self.states[state.parent as usize];
            path[state.time as usize] = self.poses.vertex(state.pose);
        }
        Found {
            path,
            cost: end.cost,
            bound: self.base,
            collisions: end.collisions,
        }
    }
}

/// The first step at which an agent may have arrived for good and the last one by which it
/// has to; `None` if it can never stay.
pub fn settling(route: &Route, constraints: &Constraints, until: u32) -> Option<(u32, u32)> {
    let Some(&goal) = route.goals.last().filter(|_| route.stays) else {
        return Some((0, FOREVER));
    };
    let free = constraints.free_from(goal);
    let settle = constraints
        .earliest()
        .max(free)
        .min(until.saturating_add(1));
    (settle < FOREVER).then_some((settle, constraints.latest()))
}

impl Query<'_> {
    /// The highest cost that is good enough while the least one is `base`.
    fn limit(&self, base: u32) -> u32 {
        let slack = f64::from(base.min(self.until)) * (self.weight - 1.0).max(0.0);
        // A little above, so that rounding does not take a step away.
        base.saturating_add((slack + 1e-6) as u32)
    }
}

/// The known state of each pose, time and stage.
#[derive(Debug, Clone, Default)]
struct Table {
    known: Known,
    poses: u64,
    stages: u64,
    still: u32,
}

impl Table {
    fn begin(&mut self, poses: u64, stages: u64, still: u32) {
        (self.poses, self.stages, self.still) = (poses, stages, still);
        self.known.begin();
    }

    /// The entry of a state; [`NONE`] where there was none.
    #[inline]
    fn entry(&mut self, state: &State) -> &mut u32 {
        let time = u64::from(state.time.min(self.still));
        let place = time * self.stages + u64::from(state.stage);
        self.known.entry(place * self.poses + u64::from(state.pose))
    }
}
