//! The operations of an agent, and what each leaves to be done.
//!
//! An operation is told by the cells where the agent is. A robot that turns does so while it waits,
//! as early as it can: so there is one operation for all orders of turns and waits between two
//! moves, and none ends with turns that serve no move. Four steps on open ground make 48 of them for
//! robots that turn; three make 125 for pebbles.
//!
//! The loss of an operation is the cost of its steps and of the way that is left behind it. Where
//! it leads through a goal, the next goal counts if it is known, and otherwise nothing does
//! from there on.

use fleetyard_plugin_spacetime::graph::{Graph, Vertex};

use super::Operation;
use crate::streets::STEP;
use crate::streets::ways::{FAR, Moves, Tolls, Ways, quarters};

/// Steps of preference in a unit of cost: among equals moves had better come early.
const PREFERENCE: i32 = 64;

/// The costs of the way to one goal.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Aim<'a> {
    pub(crate) goal: Vertex,
    /// Without them the way is as long as if nothing were in the way.
    pub(crate) costs: Option<Costs<'a>>,
}

/// Costs of ways to a goal.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Costs<'a> {
    /// By move.
    Ways(&'a Ways, &'a Tolls),
    /// By vertex, in the surroundings of an agent.
    Near(&'a Near),
}

/// Costs of the ways from some vertices.
#[derive(Debug, Clone)]
pub(crate) struct Near(Vec<(Vertex, u32)>);

impl Near {
    /// From these vertices, and no others.
    pub(crate) fn new(costs: impl Iterator<Item = (Vertex, u32)>) -> Self {
        let mut costs: Vec<_> = costs.collect();
        costs.sort_unstable();
        Self(costs)
    }

    fn from(&self, v: Vertex) -> u32 {
        let at = self.0.partition_point(|entry| entry.0 < v);
        let entry = self.0.get(at).filter(|entry| entry.0 == v);
        entry.map_or(FAR, |entry| entry.1)
    }
}

impl Aim<'_> {
    /// The cost of the way from a vertex, for an agent that looks this way, or any way.
    #[inline]
    pub(crate) fn from(&self, graph: &Graph, moves: &Moves, v: Vertex, heading: Option<u8>) -> u32 {
        match self.costs {
            Some(Costs::Ways(ways, tolls)) => ways.from(moves, v, heading, tolls),
            Some(Costs::Near(near)) => near.from(v),
            None => graph.manhattan(v, self.goal) * STEP,
        }
    }

    /// The cost of a move, turns not counted.
    #[inline]
    pub(crate) fn toll(&self, moves: &Moves, v: Vertex, d: usize) -> u32 {
        match (self.costs, moves.away(v, d)) {
            (Some(Costs::Ways(_, tolls)), Some(number)) => tolls.of(number),
            // A barred move costs no more than the way on from where it leads.
            _ => STEP,
        }
    }

    /// The cost of a turn by 90°.
    pub(crate) fn turn(&self) -> u32 {
        match self.costs {
            Some(Costs::Ways(_, tolls)) => tolls.turn(),
            _ => 0,
        }
    }
}

/// Makes operations.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Maker<'a> {
    pub(crate) graph: &'a Graph,
    pub(crate) moves: &'a Moves,
    /// True if a turn by 90° takes a step.
    pub(crate) turning: bool,
}

/// An agent that is to go somewhere.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Errand<'a> {
    pub(crate) start: Vertex,
    /// The direction in which it looks, if that matters.
    pub(crate) heading: Option<u8>,
    /// Its next goals: two at most.
    pub(crate) aims: &'a [Aim<'a>],
    /// True if it comes back to its last goal, or stays there.
    pub(crate) stays: bool,
}

impl Errand<'_> {
    /// The cost of the way to the next goal.
    pub(crate) fn rest(&self, maker: &Maker<'_>) -> u32 {
        let aim = self.aims.first();
        aim.map_or(0, |aim| {
            aim.from(maker.graph, maker.moves, self.start, self.heading)
        })
    }
}

/// An operation up to some step.
#[derive(Debug, Clone, Copy)]
struct Partial<const D: usize> {
    cells: [Vertex; D],
    steps: usize,
    at: Vertex,
    heading: Option<u8>,
    /// Steps that it has waited since its last move.
    waited: u32,
    cost: u32,
    /// Sum of the steps that follow moves, those included.
    early: u32,
    /// Goals that it has visited.
    visited: usize,
}

impl<const D: usize> Partial<D> {
    /// None of the steps.
    fn begin(errand: &Errand<'_>) -> Self {
        let mut partial = Self {
            cells: [errand.start; D],
            steps: 0,
            at: errand.start,
            heading: errand.heading,
            waited: 0,
            cost: 0,
            early: 0,
            visited: 0,
        };
        partial.arrive(errand);
        partial
    }

    /// With a wait.
    #[inline]
    fn waited(mut self, errand: &Errand<'_>) -> Self {
        // To be at a goal where it stays costs nothing.
        if errand
            .aims
            .get(self.visited)
            .is_some_and(|aim| aim.goal != self.at)
        {
            self.cost += STEP;
        }
        self.cells[self.steps] = self.at;
        self.steps += 1;
        self.waited += 1;
        self
    }

    /// Counts the goals that it has come to.
    #[inline]
    fn arrive(&mut self, errand: &Errand<'_>) {
        while let Some(aim) = errand.aims.get(self.visited)
            && aim.goal == self.at
            && !(errand.stays && self.visited + 1 == errand.aims.len())
        {
            self.visited += 1;
        }
    }
}

impl Maker<'_> {
    /// The operation that is to wait at the start.
    pub(crate) fn wait<const D: usize>(&self, errand: &Errand<'_>) -> Operation<D> {
        self.along(errand, &[errand.start; D])
    }

    /// All operations of an agent are added to a list, and those put into order. Only who has nothing
    /// to go for may wait: where others may stay when they are displaced, so do those who want to get
    /// past them.
    pub(crate) fn all<const D: usize>(&self, errand: &Errand<'_>, list: &mut Vec<Operation<D>>) {
        let begin = list.len();
        self.extend(errand, Partial::begin(errand), list);
        if errand.rest(self) > 0 {
            // To wait is the first of all.
            list.swap_remove(begin);
        }
        list[begin..].sort_unstable_by_key(|operation| operation.loss);
    }

    /// The operation along some cells, in which robots that turn do so as early as they can.
    pub(crate) fn along<const D: usize>(
        &self,
        errand: &Errand<'_>,
        cells: &[Vertex; D],
    ) -> Operation<D> {
        let mut partial = Partial::begin(errand);
        for &v in cells {
            partial = match self.direction(partial.at, v) {
                Some(d) => self.moved(errand, partial, d, v),
                None => partial.waited(errand),
            };
        }
        self.end(errand, &partial)
    }

    /// True if an agent can follow these cells from its start.
    pub(crate) fn can(&self, start: Vertex, heading: Option<u8>, cells: &[Vertex]) -> bool {
        let (mut at, mut heading, mut waited) = (start, heading, 0);
        cells.iter().all(|&v| {
            if v == at {
                waited += 1;
                return true;
            }
            let Some(d) = self.direction(at, v) else {
                return false;
            };
            let turns = heading.map_or(0, |heading| quarters(heading, d));
            if self.turning && turns > waited {
                return false;
            }
            (at, heading, waited) = (v, heading.map(|_| d as u8), 0);
            true
        })
    }

    fn direction(&self, from: Vertex, to: Vertex) -> Option<usize> {
        let around = self.graph.around(from);
        around
            .iter()
            .position(|&u| u == to && u != self.graph.wall())
    }

    fn extend<const D: usize>(
        &self,
        errand: &Errand<'_>,
        partial: Partial<D>,
        list: &mut Vec<Operation<D>>,
    ) {
        if partial.steps == D {
            list.push(self.end(errand, &partial));
            return;
        }
        self.extend(errand, partial.waited(errand), list);
        for (d, &v) in self.graph.around(partial.at).iter().enumerate() {
            let turns = partial.heading.map_or(0, |heading| quarters(heading, d));
            if v != self.graph.wall() && (!self.turning || turns <= partial.waited) {
                self.extend(errand, self.moved(errand, partial, d, v), list);
            }
        }
    }

    #[inline]
    fn moved<const D: usize>(
        &self,
        errand: &Errand<'_>,
        mut to: Partial<D>,
        d: usize,
        v: Vertex,
    ) -> Partial<D> {
        if let Some(aim) = errand.aims.get(to.visited) {
            to.cost += aim.toll(self.moves, to.at, d);
            // What is not paid for by waiting.
            let turns = to.heading.map_or(0, |heading| quarters(heading, d));
            let paid = if self.turning { STEP } else { 0 };
            to.cost += turns * aim.turn().saturating_sub(paid);
        }
        to.cells[to.steps] = v;
        to.early += (D - to.steps) as u32;
        to.steps += 1;
        (to.at, to.heading, to.waited) = (v, to.heading.map(|_| d as u8), 0);
        to.arrive(errand);
        to
    }

    #[inline]
    fn end<const D: usize>(&self, errand: &Errand<'_>, partial: &Partial<D>) -> Operation<D> {
        let mut cost = partial.cost;
        let mut from = (partial.at, partial.heading);
        for aim in errand.aims.iter().skip(partial.visited) {
            cost += aim.from(self.graph, self.moves, from.0, from.1);
            from = (aim.goal, None);
        }
        // Who wants nothing had better stay.
        let early = match errand.aims {
            [] => -(partial.early as i32),
            _ => partial.early as i32,
        };
        Operation {
            cells: partial.cells,
            // A way costs less than 2^16, and there are two at most.
            loss: cost as i32 * PREFERENCE - early,
        }
    }
}
