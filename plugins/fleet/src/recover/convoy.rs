//! Driving along given paths in a given order of passing.
//!
//! The paths say where agents go and who is in a cell before whom; when they get there
//! follows from that: an agent goes on as soon as everybody who comes before it in its next
//! cell has been there and leaves. No two are in a cell and no two change places, whatever the
//! paths are, and with the order kept there are no more waits than it demands. So paths that
//! do not collide come out as fast as they can be driven, also by robots that take a step to
//! turn; of paths that do collide as much comes out as is possible.
//!
//! Paths that collide may want an order in which everybody waits for somebody else. Such a
//! circle is opened at one place: an agent that waits for a cell which nobody is in goes
//! first. The same happens when the one who is waited for can never come.

use std::collections::VecDeque;

use fleetyard_plugin_spacetime::graph::{DIRECTIONS, Vertex};

use super::Problem;

/// Most changes of the order in one step.
const PATIENCE: u32 = 2;
/// Nobody.
const NOBODY: u32 = u32::MAX;

/// The action of an agent in the step that is being made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Act {
    /// Not decided.
    Open,
    /// About to be decided: it depends on those after it in the chain.
    Asked,
    Moves,
    Turns,
    /// Waits for somebody.
    Waits,
    /// Is at the end of its path.
    Rests,
}

/// The prospects of an agent that waits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Fate {
    Unknown,
    Asked,
    Comes,
    Never,
}

/// Drives along the paths for as many steps as the window has, or until nobody can go on. The
/// order in each cell is that of the times in the paths; who has the lower number goes first
/// where two come at once.
pub(super) fn drive(
    problem: &Problem<'_>,
    paths: &[Vec<Vertex>],
    stop: &mut dyn FnMut() -> bool,
) -> Vec<Vec<Vertex>> {
    let mut convoy = Convoy::new(problem, paths);
    let mut driven: Vec<Vec<Vertex>> = problem.starts.iter().map(|start| vec![*start]).collect();
    let steps = problem.window.unwrap_or(u32::MAX);
    for _ in 0..steps {
        if stop() || !convoy.step() {
            break;
        }
        for (path, at) in driven.iter_mut().zip(&convoy.at) {
            path.push(*at);
        }
    }
    driven
}

struct Convoy<'q> {
    problem: &'q Problem<'q>,
    /// The cells that an agent still has to visit, nearest first, and its present cell.
    ahead: Vec<VecDeque<Vertex>>,
    at: Vec<Vertex>,
    headings: Option<Vec<u8>>,
    /// Per cell, the agent that is in it and those that come next, in order.
    queues: Vec<VecDeque<u32>>,
    occupant: Vec<u32>,
    acts: Vec<Act>,
    fates: Vec<Fate>,
    chain: Vec<u32>,
    /// Agents that go first into their next cell once that is empty.
    early: Vec<u32>,
}

impl<'q> Convoy<'q> {
    fn new(problem: &'q Problem<'q>, paths: &[Vec<Vertex>]) -> Self {
        let vertices = problem.ground.graph.len();
        let agents = problem.starts.len();
        let mut queues = vec![VecDeque::new(); vertices];
        let mut ahead = vec![VecDeque::new(); agents];
        let longest = paths.iter().map(Vec::len).max().unwrap_or(0);
        for time in 0..longest {
            for (agent, path) in paths.iter().enumerate() {
                let Some(&v) = path.get(time) else { continue };
                if time == 0 || path[time - 1] != v {
                    queues[v as usize].push_back(agent as u32);
                    if time > 0 {
                        ahead[agent].push_back(v);
                    }
                }
            }
        }
        let mut occupant = vec![NOBODY; vertices];
        for (agent, start) in problem.starts.iter().enumerate() {
            occupant[*start as usize] = agent as u32;
        }
        Self {
            problem,
            ahead,
            at: problem.starts.clone(),
            headings: problem.headings.clone(),
            queues,
            occupant,
            acts: vec![Act::Open; agents],
            fates: vec![Fate::Unknown; agents],
            chain: Vec::new(),
            early: Vec::new(),
        }
    }

    /// Makes one step; false when nobody can do anything any more.
    fn step(&mut self) -> bool {
        for round in 0..=PATIENCE {
            self.acts.fill(Act::Open);
            for agent in 0..self.acts.len() as u32 {
                self.decide(agent);
            }
            if round == PATIENCE || !self.open_circles() {
                break;
            }
        }
        let mut moved = false;
        for agent in 0..self.acts.len() {
            match self.acts[agent] {
                Act::Moves => {
                    moved = true;
                    let from = self.at[agent] as usize;
                    self.queues[from].pop_front();
                    if self.occupant[from] == agent as u32 {
                        self.occupant[from] = NOBODY;
                    }
                    if let Some(to) = self.ahead[agent].pop_front() {
                        self.at[agent] = to;
                        self.occupant[to as usize] = agent as u32;
                    }
                }
                Act::Turns => {
                    moved = true;
                    self.turn(agent);
                }
                Act::Open | Act::Asked | Act::Waits | Act::Rests => {}
            }
        }
        moved
    }

    /// The direction from where an agent is to where it goes.
    fn towards(&self, agent: usize, to: Vertex) -> u8 {
        let around = self.problem.ground.graph.around(self.at[agent]);
        let direction = around.iter().position(|v| *v == to).unwrap_or(0);
        direction as u8
    }

    fn turn(&mut self, agent: usize) {
        let Some(&to) = self.ahead[agent].front() else {
            return;
        };
        let wanted = self.towards(agent, to);
        if let Some(headings) = &mut self.headings {
            let quarters = DIRECTIONS as u8;
            let apart = (wanted + quarters - headings[agent]) % quarters;
            let by = if apart == 3 { 3 } else { 1 };
            headings[agent] = (headings[agent] + by) % quarters;
        }
    }

    /// Decides what an agent does, and with it those whom it follows.
    fn decide(&mut self, agent: u32) {
        self.chain.clear();
        let mut asked = agent;
        // Whether the last of the chain moves, and so all before it that follow one another.
        let moves = loop {
            match self.acts[asked as usize] {
                Act::Moves => break true,
                Act::Turns | Act::Waits | Act::Rests => break false,
                Act::Asked => {
                    // A ring of agents, each in the next one's way. Two would change places.
                    let length = self.chain.iter().rev().take_while(|a| **a != asked).count() + 1;
                    break self.problem.rings && length > 2;
                }
                Act::Open => {}
            }
            let Some(&to) = self.ahead[asked as usize].front() else {
                self.acts[asked as usize] = Act::Rests;
                break false;
            };
            let faces = self.headings.as_ref().map(|all| all[asked as usize]);
            if faces.is_some_and(|heading| heading != self.towards(asked as usize, to)) {
                self.acts[asked as usize] = Act::Turns;
                break false;
            }
            self.acts[asked as usize] = Act::Asked;
            self.chain.push(asked);
            let queue = &self.queues[to as usize];
            let occupant = self.occupant[to as usize];
            if occupant == NOBODY {
                break queue.front() == Some(&asked);
            }
            if queue.get(1) != Some(&asked) {
                break false;
            }
            asked = occupant;
        };
        for agent in &self.chain {
            self.acts[*agent as usize] = if moves { Act::Moves } else { Act::Waits };
        }
    }

    /// The agent that another one waits for, just before it in its next cell; and whether it is
    /// there already.
    fn awaited(&self, agent: u32) -> Option<(u32, bool)> {
        let to = *self.ahead[agent as usize].front()? as usize;
        let place = self.queues[to].iter().position(|other| *other == agent)?;
        let before = self.queues[to][place.checked_sub(1)?];
        Some((before, place == 1 && self.occupant[to] == before))
    }

    /// Lets an agent go first into its next cell, once that is empty.
    fn advance(&mut self, agent: u32) {
        let Some(&to) = self.ahead[agent as usize].front() else {
            return;
        };
        let first = usize::from(self.occupant[to as usize] != NOBODY);
        let queue = &mut self.queues[to as usize];
        if let Some(place) = queue.iter().position(|other| *other == agent) {
            queue.remove(place);
            queue.insert(first.min(queue.len()), agent);
        }
    }

    /// Changes the order where it would keep somebody waiting for ever; whether it did.
    fn open_circles(&mut self) -> bool {
        for (fate, act) in self.fates.iter_mut().zip(&self.acts) {
            *fate = match act {
                Act::Moves | Act::Turns => Fate::Comes,
                // It has come, and stays in the way.
                Act::Rests => Fate::Never,
                Act::Open | Act::Asked | Act::Waits => Fate::Unknown,
            };
        }
        for agent in 0..self.fates.len() as u32 {
            self.chain.clear();
            let mut asked = agent;
            let mut fate = loop {
                match self.fates[asked as usize] {
                    Fate::Comes => break Fate::Comes,
                    Fate::Never => break Fate::Never,
                    Fate::Asked => {
                        // They wait for one another.
                        let first = self.chain.iter().position(|a| *a == asked).unwrap_or(0);
                        let circle = &self.chain[first..];
                        let open = |a: &&u32| self.awaited(**a).is_some_and(|(_, there)| !there);
                        break match circle.iter().filter(open).min().copied() {
                            Some(goes_first) => {
                                self.early.push(goes_first);
                                Fate::Comes
                            }
                            None => Fate::Never,
                        };
                    }
                    Fate::Unknown => {}
                }
                self.fates[asked as usize] = Fate::Asked;
                self.chain.push(asked);
                match self.awaited(asked) {
                    Some((before, _)) => asked = before,
                    // First in line: it could have moved, so it will.
                    None => break Fate::Comes,
                }
            };
            // From the end of the chain back to the one that was asked about.
            for at in (0..self.chain.len()).rev() {
                let waits = self.chain[at];
                if fate == Fate::Never && self.awaited(waits).is_some_and(|(_, there)| !there) {
                    self.early.push(waits);
                    fate = Fate::Comes;
                }
                self.fates[waits as usize] = fate;
            }
        }
        let early = std::mem::take(&mut self.early);
        for agent in &early {
            self.advance(*agent);
        }
        !early.is_empty()
    }
}
