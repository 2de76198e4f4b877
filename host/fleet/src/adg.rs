//! The action dependency graph: who may drive where, in which order.
//!
//! A plan says which robot is in which cell at which step. Robots are late, so what is
//! kept of it is an order: through every cell robots pass in the plan's order (Hönig et
//! al., "Persistent and robust execution of MAPF schedules in warehouses", RA-L 2019).
//! A *node* is a robot's move to an adjacent cell, with the turns before it and the
//! dwelling after it; waits are dropped. It depends on the robot's node before it, and
//! on every earlier visitor having left its cell: having done the node that leaves it, or
//! being far enough on its way.
//!
//! The second kind of edge is not stored. Every cell has a queue of visits in passing
//! order, from which a visit goes when it is over, so that a node's edges are satisfied
//! exactly when its visit is at the front. Every robot has a list of nodes that begins
//! with the one that took it to where it stands. What is done is forgotten.
//!
//! # Guarantees
//!
//! Let batches be those that [`judge`](crate::batch::judge) lets pass. Then, whatever the
//! delays and however late, often or seldom messages come:
//!
//! **(A) The last visit of a robot is the last one in its cell's queue, so that robots end in
//! distinct cells.** True at the start. A batch begins at the ends, and has nobody in the
//! same cell at any step of its window: who is in a cell at its last step is alone there and
//! entered it last. A robot stopped by a ring stays in its cell, and everybody who would enter
//! it stops. A cut: see (E).
//!
//! **(B) At most one robot is in a cell, comes to it, or leaves it without being clear of
//! it.** From the moment a node is enqueued until its robot is known to have left its cell,
//! its visit is at the front of the queue, and a queue has one front. What is known has
//! happened, and a robot that is clear of a cell only gets farther from it, since it drives on
//! to the next one.
//!
//! **(C) Centres are never nearer than the lesser of the side of a cell and c = 2 (r + t)**,
//! with the largest radius r and the tolerances t of arrival and of the way, up to how exactly
//! robots keep to their way. By (B) two robots are at the same time on two segments between
//! adjacent cells, or in cells, that have no cell in common but one that one of them, X, has
//! left. Without such a cell, the nearest points of the segments include an end of one of
//! them, and a point of the unit lattice is at least 1 from a unit segment of the lattice that
//! does not contain it. With it, call it A and the next one of X B: the other robot is on a
//! segment that ends in A and not in B, which the passing order of B still keeps for X. So
//! that segment leads away from X or is at right angles to its way, and A is its nearest
//! point to X, at c or more. So discs of a radius below half a cell do not touch.
//!
//! **(D) The graph has no cycle, and everything that is pending gets done** if every robot
//! does what it is told some day and news arrives some day. Order nodes by batch, then by
//! step. A node depends on nodes of its robot at earlier steps, and on leaving moves at no
//! later steps, since the plan has nobody in a cell that has not been left. Within a step
//! everybody goes to one cell, which at most one other leaves; such a relation has chains and
//! rings, and rings were cut. So there is always a pending node that depends on nothing
//! pending; its robot has nothing before it to do, so that it is enqueued, and done some day.
//!
//! **(E) A cut keeps all of this.** What is kept contains what it depends on, by construction.
//! If two kept visits were in one cell, the later one depends on the move by which the first
//! one leaves; so that move is kept, and the first one's robot does not end there: ends are
//! distinct. What is dropped was enqueued to nobody.
//!
//! **(F) The order of news does not matter.** News is a number: the robot has done so many
//! nodes since the start. The graph is a function of the batches, the cuts and the largest
//! numbers so far, so that repeated and stale news changes nothing, and one number may jump
//! over several nodes. A number above what was enqueued cannot be true and counts as what was
//! enqueued.
//!
//! (B), (D), (E), (F) and the passing order are tested on random maps with random walks,
//! rings, windows, cuts and delays (`tests/it/adg.rs`), (C) with robots that drive, noise and
//! lost messages (`tests/it/live.rs` of the simulator).
//!
//! # Costs
//!
//! `append` is linear in the cells of all paths, `enqueue` in what has changed, `complete` in
//! the nodes that are news, `cut` and `is_acyclic` in what is pending. Memory is 48 bytes a
//! pending node, with room for up to twice as many since it grows by doubling, 40 an agent and
//! 12 a cell of the map.

use std::cmp::Reverse;
use std::mem;

use fleetyard_abi::{Heading, Lists};
use fleetyard_core::{Grid, OFF_MAP};

use crate::batch::Batch;

/// No node, no robot.
const NONE: u32 = u32::MAX;

/// Most goals that are reached without leaving a cell: a stream of goals that stays in
/// one would have no end.
const MOST_STAYS: u32 = 1000;

/// An order to a robot: to go to the next cell of its path.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Node {
    /// The cell to go to: one beside the cell before, or the same for a goal that is reached
    /// without leaving the cell.
    pub cell: u32,
    /// Actions that this takes: the move, quarter turns before it, dwelling after it.
    pub actions: u32,
    /// The index of the robot's goal that is reached by it.
    pub goal: Option<u32>,
}

/// Number of actions for everything besides a move, which is one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Costs {
    /// A turn by 90°; 0 for robots that need not turn.
    pub quarter_turn: u32,
    /// Dwelling at a goal; 0 where nobody does.
    pub dwell: u32,
}

impl Default for Costs {
    fn default() -> Self {
        Self {
            quarter_turn: 1,
            dwell: 0,
        }
    }
}

/// The least times of actions, in seconds.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Pace {
    /// A move to the next cell without a stop before or after it.
    pub move_s: f64,
    /// The time by which a move is longer that begins at rest.
    pub set_out_s: f64,
    /// A turn by 90°.
    pub quarter_turn_s: f64,
    /// Dwelling at a goal.
    pub dwell_s: f64,
}

impl Pace {
    fn of(&self, moves: bool, quarter_turns: u32, goal: bool) -> f64 {
        let mut takes_s = 0.0;
        if moves {
            takes_s += self.move_s + f64::from(quarter_turns) * self.quarter_turn_s;
        }
        if moves && quarter_turns > 0 {
            takes_s += self.set_out_s;
        }
        if goal {
            takes_s += self.dwell_s;
        }
        takes_s
    }
}

/// The reason why something cannot be begun, or appended. Agents are counted from 0.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages document the fields")]
#[non_exhaustive]
pub enum AdgError {
    #[error("{starts} starts but {headings} headings")]
    LengthMismatch { starts: usize, headings: usize },
    #[error("agent {agent} starts in cell {cell}, where the map has no free cell")]
    Blocked { agent: usize, cell: u32 },
    #[error("agents {first} and {agent} start in the same cell, {cell}")]
    Occupied {
        first: usize,
        agent: usize,
        cell: u32,
    },
    #[error("the batch has {found} paths, the fleet {agents} agents")]
    WrongAgents { found: usize, agents: usize },
    #[error("the path of agent {agent} begins in cell {found}, what it has ends in cell {end}")]
    WrongStart { agent: usize, found: u32, end: u32 },
}

/// The outcome of appending a batch.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Appended {
    /// Nodes that were appended.
    pub nodes: usize,
    /// Rings of robots, each going to where the next one is at the same step, before
    /// which the batch was cut.
    pub rings_cut: usize,
    /// Agents whose paths were not appended to their ends, in or behind such rings.
    pub stopped: usize,
}

/// The state of all agents when everything that is committed has been done.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Cut {
    /// Cells, no two the same.
    pub cells: Vec<u32>,
    /// Headings there: that of the last move.
    pub headings: Vec<Heading>,
    /// The first goal of each agent that no committed node reaches.
    pub next_goal: Vec<u32>,
    /// Nodes that were dropped.
    pub dropped: usize,
    /// The moves that were dropped, a string per agent from its cell on, if the graph was asked to
    /// tell ([`Adg::tell_rest`]). Moves of the last batch are at their steps, counted from the first
    /// one that was dropped, so that paths do not collide.
    pub rest: Vec<String>,
}

/// A robot's visit to a cell, with the node that begins it. Links are indices into the
/// graph's visits.
#[derive(Debug, Clone, Copy)]
struct Visit {
    node: Node,
    agent: u32,
    /// Number of the agent's node, counted from 1 at the start of everything; 0 is standing at the
    /// start.
    number: u32,
    /// The agent's visits before and after.
    before: u32,
    after: u32,
    /// Visits of the same cell ahead of this and behind it. A visit that stays in the
    /// cell of the one before it is no visit of its own: it is in no queue until the one
    /// before it is forgotten, whose place it takes then.
    ahead: u32,
    behind: u32,
    heading: Heading,
    /// True if the turns before the node take steps.
    turning: bool,
    /// The batch that it came with, and the step of it after which the node begins: turns that take
    /// steps are part of it.
    batch: u32,
    step: u32,
}

#[derive(Debug, Clone, Copy)]
struct Robot {
    /// The visit that it is at, the last one that is done; and its last one.
    head: u32,
    tail: u32,
    /// The first visit that is not enqueued.
    next: u32,
    /// Numbers of the last visits that are done, and enqueued.
    done: u32,
    enqueued: u32,
    /// True if it has left the cell where it was when its last node was done, so that its
    /// visit there is in no queue.
    left: bool,
    /// Actions of all nodes that are not done.
    actions: u32,
    /// The first goal that no node reaches, and its cell as of the last append.
    next_goal: u32,
    goal_cell: u32,
}

/// The first and the last visit in the passing order of a cell, as far as it is not over, and the
/// agent whose path ends there.
#[derive(Debug, Clone, Copy)]
struct Place {
    front: u32,
    back: u32,
    end_of: u32,
}

/// The state of the decision about an agent's part of a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Fate {
    /// It does not move, or not any more.
    Stays,
    /// It would move.
    Open,
    /// It waits for the answer of the one in whose place it would come.
    Asked,
    Goes,
    Stops,
}

/// The graph of what is pending. Its memory is that of what was ever pending at once.
#[derive(Debug, Clone)]
pub struct Adg {
    cols: u32,
    costs: Costs,
    robots: Vec<Robot>,
    visits: Vec<Visit>,
    /// Indices of visits that are not in use.
    free: Vec<u32>,
    places: Vec<Place>,
    pending: usize,
    /// Number of batches appended, and the step of the last one that is being appended.
    batches: u32,
    step: u32,
    /// True if turns take steps in it.
    turning: bool,
    /// True if cuts tell what they drop.
    tells_rest: bool,
    /// A bit per robot whose next node may have become free to be enqueued.
    ready: Vec<u64>,
    // Memory that calls would else ask for each time.
    fates: Vec<Fate>,
    active: Vec<u32>,
    movers: Vec<(u32, u32)>,
    stack: Vec<u32>,
}

impl Adg {
    /// Robots at rest in distinct free cells.
    pub fn new(
        grid: &Grid,
        starts: &[u32],
        headings: &[Heading],
        costs: Costs,
    ) -> Result<Self, AdgError> {
        if starts.len() != headings.len() {
            let (starts, headings) = (starts.len(), headings.len());
            return Err(AdgError::LengthMismatch { starts, headings });
        }
        let nobody = Place {
            front: NONE,
            back: NONE,
            end_of: NONE,
        };
        let mut places = vec![nobody; grid.cell_count() as usize];
        let mut robots = Vec::with_capacity(starts.len());
        let mut visits = Vec::with_capacity(starts.len());
        for (agent, (&cell, &heading)) in starts.iter().zip(headings).enumerate() {
            if !grid.is_passable(cell) {
                return Err(AdgError::Blocked { agent, cell });
            }
            let place = &mut places[cell as usize];
            if place.end_of != NONE {
                let first = place.end_of as usize;
                return Err(AdgError::Occupied { first, agent, cell });
            }
            let at = agent as u32;
            *place = Place {
                front: at,
                back: at,
                end_of: at,
            };
            visits.push(Visit {
                node: Node {
                    cell,
                    actions: 0,
                    goal: None,
                },
                agent: at,
                number: 0,
                before: NONE,
                after: NONE,
                ahead: NONE,
                behind: NONE,
                heading,
                turning: false,
                batch: 0,
                step: 0,
            });
            robots.push(Robot {
                head: at,
                tail: at,
                next: NONE,
                done: 0,
                enqueued: 0,
                left: false,
                actions: 0,
                next_goal: 0,
                goal_cell: OFF_MAP,
            });
        }
        Ok(Self {
            cols: grid.cols(),
            costs,
            ready: vec![0; starts.len().div_ceil(64)],
            fates: vec![Fate::Stays; starts.len()],
            robots,
            visits,
            free: Vec::new(),
            places,
            pending: 0,
            batches: 0,
            step: 0,
            turning: false,
            tells_rest: false,
            active: Vec::new(),
            movers: Vec::new(),
            stack: Vec::new(),
        })
    }

    /// Appends a batch whose paths begin where agents end.
    ///
    /// `goals(agent, index)` is the cell of a goal, or [`OFF_MAP`] where there is none;
    /// an agent's goals are matched in order, each where the path enters its cell, or
    /// where it begins.
    ///
    /// If robots moved round in a ring at one step, none of them could begin. They stop before that
    /// step, and so does every robot that would enter a cell that is not left any more.
    ///
    /// On an error nothing has been appended.
    pub fn append(
        &mut self,
        batch: &Batch,
        goals: &mut dyn FnMut(usize, u32) -> u32,
    ) -> Result<Appended, AdgError> {
        self.check(batch)?;
        let before = self.pending;
        let mut appended = Appended::default();
        let mut active = mem::take(&mut self.active);
        active.clear();
        self.batches = self.batches.wrapping_add(1);
        self.step = 0;
        self.turning = batch.turning();
        for agent in 0..self.robots.len() {
            let robot = &mut self.robots[agent];
            robot.goal_cell = goals(agent, robot.next_goal);
            self.match_stays(agent, goals);
            if batch.path(agent).len() > 1 {
                active.push(agent as u32);
            }
        }
        let mut time = 1;
        while !active.is_empty() {
            self.step = time as u32 - 1;
            self.movers.clear();
            for &agent in &active {
                let path = batch.path(agent as usize);
                if path[time] != path[time - 1] {
                    self.movers.push((agent, path[time]));
                    self.fates[agent as usize] = Fate::Open;
                }
            }
            appended.rings_cut += self.decide(batch, time);
            let movers = mem::take(&mut self.movers);
            for &(agent, to) in &movers {
                let fate = &mut self.fates[agent as usize];
                if *fate == Fate::Goes {
                    *fate = Fate::Stays;
                    self.push_move(agent as usize, to, goals);
                } else {
                    appended.stopped += 1;
                }
            }
            self.movers = movers;
            time += 1;
            let fates = &mut self.fates;
            active.retain(|agent| {
                let fate = mem::replace(&mut fates[*agent as usize], Fate::Stays);
                fate != Fate::Stops && batch.path(*agent as usize).len() > time
            });
        }
        self.active = active;
        appended.nodes = self.pending - before;
        debug_assert!(self.is_acyclic());
        Ok(appended)
    }

    fn check(&self, batch: &Batch) -> Result<(), AdgError> {
        let agents = self.robots.len();
        if batch.agents() != agents {
            let found = batch.agents();
            return Err(AdgError::WrongAgents { found, agents });
        }
        for agent in 0..agents {
            let found = batch.path(agent).first().copied().unwrap_or(OFF_MAP);
            let end = self.end(agent);
            if found != end {
                return Err(AdgError::WrongStart { agent, found, end });
            }
        }
        Ok(())
    }

    /// Decides who of the movers of a step goes, and counts the rings. Everybody goes to
    /// one cell, where at most one other is: so the movers are chains and rings.
    fn decide(&mut self, batch: &Batch, time: usize) -> usize {
        let mut rings = 0;
        for at in 0..self.movers.len() {
            let (mut agent, mut to) = self.movers[at];
            if self.fates[agent as usize] != Fate::Open {
                continue;
            }
            self.stack.clear();
            let fate = loop {
                self.fates[agent as usize] = Fate::Asked;
                self.stack.push(agent);
                let there = self.places[to as usize].end_of;
                if there == NONE {
                    break Fate::Goes;
                }
                match self.fates[there as usize] {
                    Fate::Goes => break Fate::Goes,
                    Fate::Stays | Fate::Stops => break Fate::Stops,
                    Fate::Asked => {
                        rings += 1;
                        break Fate::Stops;
                    }
                    Fate::Open => {
                        agent = there;
                        to = batch.path(agent as usize)[time];
                    }
                }
            };
            for agent in &self.stack {
                self.fates[*agent as usize] = fate;
            }
        }
        rings
    }

    /// Appends a move, and what is reached with it.
    fn push_move(&mut self, agent: usize, to: u32, goals: &mut dyn FnMut(usize, u32) -> u32) {
        let robot = self.robots[agent];
        let from = &self.visits[robot.tail as usize];
        let (left, heading) = (from.node.cell, from.heading);
        let towards = Heading::of_move(left, to, self.cols);
        let turns = heading.quarters_to(towards);
        let place = &mut self.places[left as usize];
        // Whoever follows at the same step may be there already.
        if place.end_of == agent as u32 {
            place.end_of = NONE;
        }
        let ahead = self.places[to as usize].back;
        let goal = (robot.goal_cell == to).then_some(robot.next_goal);
        let node = Node {
            cell: to,
            actions: 1 + turns * self.costs.quarter_turn,
            goal,
        };
        let at = self.push(agent, node, towards, ahead);
        let place = &mut self.places[to as usize];
        place.back = at;
        place.end_of = agent as u32;
        match ahead {
            NONE => place.front = at,
            ahead => self.visits[ahead as usize].behind = at,
        }
        if goal.is_some() {
            self.next_goal(agent, goals);
            self.match_stays(agent, goals);
        }
    }

    /// Appends the goals that are reached where the agent ends already.
    fn match_stays(&mut self, agent: usize, goals: &mut dyn FnMut(usize, u32) -> u32) {
        for _ in 0..MOST_STAYS {
            let robot = self.robots[agent];
            let cell = self.end(agent);
            if robot.goal_cell != cell {
                break;
            }
            let heading = self.visits[robot.tail as usize].heading;
            let node = Node {
                cell,
                actions: 0,
                goal: Some(robot.next_goal),
            };
            self.push(agent, node, heading, NONE);
            self.next_goal(agent, goals);
        }
    }

    fn next_goal(&mut self, agent: usize, goals: &mut dyn FnMut(usize, u32) -> u32) {
        let robot = &mut self.robots[agent];
        robot.next_goal += 1;
        robot.goal_cell = goals(agent, robot.next_goal);
    }

    /// Appends a visit to the agent's list.
    fn push(&mut self, agent: usize, mut node: Node, heading: Heading, ahead: u32) -> u32 {
        if node.goal.is_some() {
            node.actions += self.costs.dwell;
        }
        let robot = &mut self.robots[agent];
        let tail = &self.visits[robot.tail as usize];
        let turning_steps = if self.turning {
            tail.heading.quarters_to(heading)
        } else {
            0
        };
        let visit = Visit {
            node,
            agent: agent as u32,
            number: tail.number + 1,
            before: robot.tail,
            after: NONE,
            ahead,
            behind: NONE,
            heading,
            turning: self.turning,
            batch: self.batches,
            step: self.step.saturating_sub(turning_steps),
        };
        let at = if let Some(at) = self.free.pop() {
            self.visits[at as usize] = visit;
            at
        } else {
            self.visits.push(visit);
            self.visits.len() as u32 - 1
        };
        self.visits[robot.tail as usize].after = at;
        robot.tail = at;
        robot.actions += node.actions;
        if robot.next == NONE {
            robot.next = at;
            self.look_at(agent);
        }
        self.pending += 1;
        at
    }

    /// Takes a visit out of its cell's queue.
    fn unlink(&mut self, at: u32) {
        let Visit {
            node,
            ahead,
            behind,
            ..
        } = self.visits[at as usize];
        let place = &mut self.places[node.cell as usize];
        match ahead {
            NONE => place.front = behind,
            ahead => self.visits[ahead as usize].behind = behind,
        }
        match behind {
            NONE => place.back = ahead,
            behind => self.visits[behind as usize].ahead = ahead,
        }
        let visit = &mut self.visits[at as usize];
        (visit.ahead, visit.behind) = (NONE, NONE);
    }

    /// A visit is over: takes it out of its cell's queue, and has the next one looked at.
    fn end_visit(&mut self, at: u32) {
        let behind = self.visits[at as usize].behind;
        self.unlink(at);
        if let Some(next) = self.visits.get(behind as usize) {
            let agent = next.agent as usize;
            self.look_at(agent);
        }
    }

    /// A robot's next node may have become free to be enqueued.
    fn look_at(&mut self, agent: usize) {
        self.ready[agent / 64] |= 1 << (agent % 64);
    }

    /// True if a visit stays in the cell of the one before it.
    fn is_stay(&self, visit: &Visit) -> bool {
        visit.before != NONE && self.visits[visit.before as usize].node.cell == visit.node.cell
    }

    /// Drops what nobody is committed to, and says where agents are then.
    ///
    /// Committed is what is enqueued, what an agent will do with its next
    /// `lookahead_actions` actions, and everything that has to be done before that.
    pub fn cut(&mut self, lookahead_actions: u32) -> Cut {
        // Per agent the last visit that is kept; kept visits that may need others to be.
        let mut last = Vec::with_capacity(self.robots.len());
        let mut stack = mem::take(&mut self.stack);
        stack.clear();
        for robot in &self.robots {
            let (mut at, mut actions) = (robot.head, 0);
            loop {
                let after = self.visits[at as usize].after;
                if after == NONE {
                    break;
                }
                let visit = &self.visits[after as usize];
                if visit.number > robot.enqueued {
                    if actions >= lookahead_actions {
                        break;
                    }
                    stack.push(after);
                }
                actions = u32::saturating_add(actions, visit.node.actions);
                at = after;
            }
            last.push(at);
        }
        while let Some(at) = stack.pop() {
            // Who was in the cell before has to leave it. That is enough: who was there
            // before that has to leave for this one to come, and so on.
            let ahead = self.visits[at as usize].ahead;
            if ahead == NONE {
                continue;
            }
            let leave = self.leave_of(ahead);
            let agent = self.visits[ahead as usize].agent as usize;
            let until = leave.map_or(0, |leave| self.visits[leave as usize].number);
            while self.visits[last[agent] as usize].number < until {
                last[agent] = self.visits[last[agent] as usize].after;
                stack.push(last[agent]);
            }
        }
        self.stack = stack;
        self.keep(&last)
    }

    /// The same, where committed is what is enqueued and what can begin within so many
    /// seconds: a robot that turns, or waits for others, is committed to less than one that
    /// drives, and all of them end at about the same time.
    ///
    /// The times follow from the least times of actions and from the order in which robots wait for
    /// each other; and a move that was planned for later is not committed because a cell happens to
    /// be free: the last batch was appended `since_s` ago. A node that is under way may be all but
    /// done.
    pub fn cut_within(&mut self, horizon_s: f64, since_s: f64, pace: &Pace) -> Cut {
        let mut last: Vec<u32> = self.robots.iter().map(|robot| robot.head).collect();
        // When an agent has done what is kept of it, and when a visit's cell is free.
        let mut done_s = vec![0.0; last.len()];
        let mut free_s = vec![f64::INFINITY; self.visits.len()];
        let mut work = mem::take(&mut self.stack);
        work.clear();
        work.extend((0..last.len() as u32).rev());
        while let Some(agent) = work.pop() {
            let agent = agent as usize;
            let robot = &self.robots[agent];
            loop {
                let before = self.visits[last[agent] as usize];
                if before.after == NONE {
                    break;
                }
                let visit = &self.visits[before.after as usize];
                let mut begin_s: f64 = done_s[agent];
                if visit.number > robot.enqueued {
                    if visit.ahead != NONE {
                        begin_s = begin_s.max(free_s[before.after as usize]);
                    }
                    let planned_s = f64::from(visit.step) * pace.move_s - since_s;
                    let is_new = visit.batch == self.batches;
                    if begin_s >= horizon_s || is_new && planned_s >= horizon_s {
                        break;
                    }
                }
                let moves = before.node.cell != visit.node.cell;
                let under_way = visit.number <= robot.enqueued && last[agent] == robot.head;
                let takes_s = if under_way {
                    0.0
                } else {
                    let quarter_turns = before.heading.quarters_to(visit.heading);
                    pace.of(moves, quarter_turns, visit.node.goal.is_some())
                };
                done_s[agent] = begin_s + takes_s;
                if moves {
                    let mut left = last[agent];
                    while self.is_stay(&self.visits[left as usize]) {
                        left = self.visits[left as usize].before;
                    }
                    let behind = self.visits[left as usize].behind;
                    if behind != NONE {
                        free_s[behind as usize] = done_s[agent];
                        work.push(self.visits[behind as usize].agent);
                    }
                }
                last[agent] = before.after;
            }
        }
        self.stack = work;
        self.keep(&last)
    }

    /// Lets cuts tell what they drop.
    pub fn tell_rest(&mut self) {
        self.tells_rest = true;
    }

    /// The moves behind the given visits, one of each agent.
    fn rest(&self, last: &[u32]) -> Vec<String> {
        // Batch, counted back from the last one, steps of beginning and arrival, and the move.
        let mut moves: Lists<(u32, u32, u32, char)> = Lists::with_capacity(last.len(), 0);
        for last in last {
            let mut at = *last;
            while let Some(visit) = self.visits.get(self.visits[at as usize].after as usize) {
                let from = &self.visits[at as usize];
                at = from.after;
                if visit.node.cell == from.node.cell {
                    continue;
                }
                let turns = if visit.turning {
                    from.heading.quarters_to(visit.heading)
                } else {
                    0
                };
                let letter = match visit.heading {
                    Heading::North => 'N',
                    Heading::East => 'E',
                    Heading::South => 'S',
                    Heading::West => 'W',
                };
                let ago = self.batches.wrapping_sub(visit.batch);
                moves.push_item((ago, visit.step, visit.step + turns + 1, letter));
            }
            moves.end_list();
        }
        // Of earlier batches only the order counts.
        let earlier = moves.items().iter().filter(|(ago, ..)| *ago > 0);
        let mut earlier: Vec<_> = earlier
            .map(|(ago, _, step, _)| (Reverse(*ago), *step))
            .collect();
        earlier.sort_unstable();
        earlier.dedup();
        let recent = moves.items().iter().filter(|(ago, ..)| *ago == 0);
        let first = recent.map(|(_, begin, ..)| *begin).min().unwrap_or(0);
        let first = if earlier.is_empty() { first } else { 0 };
        let when = |(ago, _, step, _): (u32, u32, u32, char)| match ago {
            0 => earlier.len() + (step - first) as usize,
            ago => earlier.partition_point(|other| *other < (Reverse(ago), step)) + 1,
        };
        let path = |moves: &[(u32, u32, u32, char)]| {
            let mut letters = String::new();
            for found in moves {
                let waits = when(*found).saturating_sub(letters.len() + 1);
                letters.extend(std::iter::repeat_n('.', waits));
                letters.push(found.3);
            }
            letters
        };
        moves.iter().map(path).collect()
    }

    /// Drops everything behind the given visits, one of each agent.
    fn keep(&mut self, last: &[u32]) -> Cut {
        let before = self.pending;
        let rest = if self.tells_rest {
            self.rest(last)
        } else {
            Vec::new()
        };
        for (agent, last) in last.iter().copied().enumerate() {
            self.drop_behind(agent, last);
        }
        let ends = self
            .robots
            .iter()
            .map(|robot| &self.visits[robot.tail as usize]);
        Cut {
            cells: ends.clone().map(|end| end.node.cell).collect(),
            headings: ends.map(|end| end.heading).collect(),
            next_goal: self.robots.iter().map(|robot| robot.next_goal).collect(),
            dropped: before - self.pending,
            rest,
        }
    }

    /// The agent that has to leave a cell before an agent's next node can be enqueued, and the number
    /// of the node by which it does, if it has one.
    pub fn ahead(&self, agent: usize) -> Option<(u32, Option<u32>)> {
        let next = self.visits.get(self.robots[agent].next as usize)?;
        let ahead = self.visits.get(next.ahead as usize)?;
        let leave = self.leave_of(next.ahead);
        Some((
            ahead.agent,
            leave.map(|leave| self.visits[leave as usize].number),
        ))
    }

    /// The node of the same agent by which the cell of a visit is left.
    fn leave_of(&self, at: u32) -> Option<u32> {
        let cell = self.visits[at as usize].node.cell;
        let mut after = self.visits[at as usize].after;
        while after != NONE && self.visits[after as usize].node.cell == cell {
            after = self.visits[after as usize].after;
        }
        (after != NONE).then_some(after)
    }

    /// Drops an agent's visits after one that is kept.
    fn drop_behind(&mut self, agent: usize, last: u32) {
        let mut robot = self.robots[agent];
        if robot.tail == last {
            return;
        }
        let place = &mut self.places[self.visits[robot.tail as usize].node.cell as usize];
        if place.end_of == agent as u32 {
            place.end_of = NONE;
        }
        while robot.tail != last {
            let visit = self.visits[robot.tail as usize];
            if !self.is_stay(&visit) {
                self.unlink(robot.tail);
            }
            if robot.next == robot.tail {
                robot.next = NONE;
            }
            if let Some(goal) = visit.node.goal {
                robot.next_goal = goal;
            }
            robot.actions -= visit.node.actions;
            self.free.push(robot.tail);
            self.pending -= 1;
            robot.tail = visit.before;
        }
        let end = &mut self.visits[last as usize];
        end.after = NONE;
        self.places[end.node.cell as usize].end_of = agent as u32;
        self.robots[agent] = robot;
    }

    /// Enqueues every node that may be, as long as a robot has fewer than `queue` that
    /// are enqueued and not done, and tells of them: agents ascend, the nodes of an agent
    /// are in order.
    ///
    /// Only agents are looked at for which something has changed, so that `queue` should
    /// be the same in every call.
    pub fn enqueue(&mut self, queue: u32, tell: &mut dyn FnMut(usize, &Node)) {
        self.enqueue_but(queue, &|_| false, tell);
    }

    /// The same but for those who are held: they are told later.
    pub fn enqueue_but(
        &mut self,
        queue: u32,
        is_held: &dyn Fn(usize) -> bool,
        tell: &mut dyn FnMut(usize, &Node),
    ) {
        for word in 0..self.ready.len() {
            let mut bits = mem::take(&mut self.ready[word]);
            while bits != 0 {
                let agent = word * 64 + bits.trailing_zeros() as usize;
                let bit = bits & bits.wrapping_neg();
                bits &= bits - 1;
                if is_held(agent) {
                    self.ready[word] |= bit;
                    continue;
                }
                let robot = &mut self.robots[agent];
                while robot.next != NONE && robot.enqueued - robot.done < queue {
                    let visit = &self.visits[robot.next as usize];
                    if visit.ahead != NONE {
                        break;
                    }
                    robot.enqueued = visit.number;
                    robot.next = visit.after;
                    tell(agent, &visit.node);
                }
            }
        }
    }

    /// The robot has done its first `done` nodes since the start, and has left the cells
    /// from which its first `left` nodes lead; tells of those done that are news. Fewer than
    /// were known are no news. More than were enqueued cannot be: it has done what was
    /// enqueued then.
    pub fn complete(&mut self, agent: usize, done: u32, left: u32, tell: &mut dyn FnMut(&Node)) {
        let enqueued = self.robots[agent].enqueued;
        let done = done.min(enqueued);
        while self.robots[agent].done < done {
            let robot = &mut self.robots[agent];
            let over = robot.head;
            robot.head = self.visits[over as usize].after;
            robot.done += 1;
            let has_left = mem::take(&mut robot.left);
            let head = robot.head;
            let was = self.visits[over as usize];
            let node = self.visits[head as usize].node;
            robot.actions -= node.actions;
            self.pending -= 1;
            if node.cell == was.node.cell {
                // It stays, and keeps its place.
                let place = &mut self.places[node.cell as usize];
                place.front = head;
                self.visits[head as usize].behind = was.behind;
                match was.behind {
                    NONE => place.back = head,
                    behind => self.visits[behind as usize].ahead = head,
                }
            } else if !has_left {
                self.end_visit(over);
            }
            self.visits[head as usize].before = NONE;
            self.free.push(over);
            self.look_at(agent);
            tell(&node);
        }
        let robot = &mut self.robots[agent];
        if !robot.left && robot.done < left.min(enqueued) {
            let (head, visit) = (robot.head, self.visits[robot.head as usize]);
            if self.visits[visit.after as usize].node.cell != visit.node.cell {
                robot.left = true;
                self.end_visit(head);
            }
        }
    }

    /// True of a cell where an agent is, or into which it was told to go; with `planned` into which it is to go at all.
    pub fn is_held(&self, cell: u32, planned: bool) -> bool {
        let visit = |at: u32| self.visits.get(at as usize);
        let place = self.places.get(cell as usize);
        let first = place.and_then(|place| visit(place.front));
        let mut all = std::iter::successors(first, move |at| visit(at.behind));
        all.any(|visit| planned || visit.number <= self.robots[visit.agent as usize].enqueued)
    }

    /// True if somebody is to go, but was not told to yet, into a cell of which this is true.
    pub fn leads_into(&self, is_it: &dyn Fn(u32) -> bool) -> bool {
        self.robots.iter().any(|robot| {
            let visit = |at: u32| self.visits.get(at as usize);
            let mut all = std::iter::successors(visit(robot.next), |at| visit(at.after));
            all.any(|visit| is_it(visit.node.cell))
        })
    }

    /// Number of agents.
    pub fn agents(&self) -> usize {
        self.robots.len()
    }

    /// Actions of an agent that are committed or planned, and not done.
    pub fn actions_left(&self, agent: usize) -> u32 {
        self.robots[agent].actions
    }

    /// Nodes that are not done.
    pub fn pending(&self) -> usize {
        self.pending
    }

    /// The cell where an agent is when everything has been done.
    pub fn end(&self, agent: usize) -> u32 {
        self.visits[self.robots[agent].tail as usize].node.cell
    }

    /// Number of nodes that an agent has done, and of those that it was told of.
    pub fn progress(&self, agent: usize) -> (u32, u32) {
        let robot = &self.robots[agent];
        (robot.done, robot.enqueued)
    }

    /// The nodes of an agent that are not done, in order.
    pub fn nodes(&self, agent: usize) -> impl Iterator<Item = &Node> {
        let visit = |at: u32| self.visits.get(at as usize);
        let first = visit(self.robots[agent].head).and_then(|head| visit(head.after));
        std::iter::successors(first, move |at| visit(at.after)).map(|visit| &visit.node)
    }

    /// The agents that are in a cell or will come there, in passing order.
    pub fn visitors(&self, cell: u32) -> impl Iterator<Item = u32> {
        let visit = |at: u32| self.visits.get(at as usize);
        let first = self
            .places
            .get(cell as usize)
            .and_then(|place| visit(place.front));
        std::iter::successors(first, move |at| visit(at.behind)).map(|visit| visit.agent)
    }

    /// Bytes of memory in use.
    pub fn memory_bytes(&self) -> usize {
        self.robots.capacity() * size_of::<Robot>()
            + self.visits.capacity() * size_of::<Visit>()
            + self.places.capacity() * size_of::<Place>()
            + (self.free.capacity() + self.active.capacity() + self.stack.capacity()) * 4
            + (self.ready.capacity() + self.movers.capacity()) * 8
            + self.fates.capacity()
    }

    /// True if what is pending has an order in which it can be done (Kahn 1962).
    pub fn is_acyclic(&self) -> bool {
        // Edges that are not yet removed, per visit: at most one of either kind.
        let mut edges = vec![0u8; self.visits.len()];
        let mut free = Vec::new();
        for robot in &self.robots {
            let mut at = self.visits[robot.head as usize].after;
            let mut follows = 0;
            while at != NONE {
                let visit = &self.visits[at as usize];
                edges[at as usize] = follows + u8::from(visit.ahead != NONE);
                if edges[at as usize] == 0 {
                    free.push(at);
                }
                follows = 1;
                at = visit.after;
            }
        }
        let mut done = 0;
        while let Some(at) = free.pop() {
            done += 1;
            let visit = &self.visits[at as usize];
            // Whoever comes next to the cell that this leaves.
            let behind = if self.is_stay(visit) {
                NONE
            } else {
                let mut left = visit.before;
                while self.is_stay(&self.visits[left as usize]) {
                    left = self.visits[left as usize].before;
                }
                self.visits[left as usize].behind
            };
            for next in [visit.after, behind] {
                if let Some(edges) = edges.get_mut(next as usize) {
                    *edges -= 1;
                    if *edges == 0 {
                        free.push(next);
                    }
                }
            }
        }
        done == self.pending
    }
}
