//! The rest of a way: lower bounds of the time to goals, kept from one search to the next.

use std::collections::HashMap;
use std::sync::Arc;

use crate::roadmap::{Edge, NONE, Roadmap, Vertex};

/// Most numbers that are kept, of eight bytes each.
const MOST_KEPT: usize = 1 << 24;

/// Lower bounds of the seconds to one goal.
#[derive(Debug)]
struct Bounds {
    goal: Vertex,
    /// By vertex, or by line where robots have to turn.
    times: Vec<f64>,
}

impl Bounds {
    fn to(roadmap: &Roadmap, goal: Vertex) -> Self {
        let times = if roadmap.is_driven() {
            roadmap.times_of_lines(goal)
        } else {
            roadmap.times_to(goal)
        };
        Self { goal, times }
    }

    /// From rest at a vertex, with the time that turning to a line takes.
    fn from(&self, roadmap: &Roadmap, vertex: Vertex, turn: impl Fn(Edge) -> f64) -> f64 {
        if vertex == self.goal {
            return 0.0;
        }
        if !roadmap.is_driven() {
            return self.times[vertex as usize];
        }
        let times = roadmap.lines(vertex).map(|line| {
            let onward = self.times[roadmap.line_number(line)];
            turn(line) + roadmap.stopping(line) + roadmap.in_motion(line) + onward
        });
        times.fold(f64::INFINITY, f64::min)
    }

    /// From a vertex in motion, in whatever direction is the best.
    fn passing(&self, roadmap: &Roadmap, vertex: Vertex) -> f64 {
        if !roadmap.is_driven() {
            return self.times[vertex as usize];
        }
        let times = roadmap
            .lines(vertex)
            .map(|line| roadmap.in_motion(line) + self.times[roadmap.line_number(line)]);
        times.fold(f64::INFINITY, f64::min)
    }
}

/// Bounds of goals that were asked for, as long as there is room for them.
#[derive(Debug, Default)]
pub struct Known {
    bounds: HashMap<Vertex, Arc<Bounds>>,
    kept: usize,
}

impl Known {
    fn of(&mut self, roadmap: &Roadmap, goal: Vertex) -> Arc<Bounds> {
        if let Some(known) = self.bounds.get(&goal) {
            return Arc::clone(known);
        }
        let found = Arc::new(Bounds::to(roadmap, goal));
        if self.kept + found.times.len() > MOST_KEPT {
            self.bounds.clear();
            self.kept = 0;
        }
        self.kept += found.times.len();
        self.bounds.insert(goal, Arc::clone(&found));
        found
    }
}

/// The goals of one disc, in order, and lower bounds of the time to the last of them.
#[derive(Debug)]
pub struct Rest {
    goals: Vec<Vertex>,
    bounds: Vec<Arc<Bounds>>,
    /// From each goal to the last one.
    onward: Vec<f64>,
    /// The number of goals that may be passed through.
    passed: usize,
}

impl Rest {
    /// To goals of a roadmap, which are met in order. A disc that `stays` ends at the last one; another one may pass through it
    /// and end anywhere.
    pub fn to(roadmap: &Roadmap, goals: &[Vertex], stays: bool, known: &mut Known) -> Self {
        let bounds: Vec<Arc<Bounds>> = goals.iter().map(|goal| known.of(roadmap, *goal)).collect();
        let mut onward = vec![0.0; goals.len()];
        for at in (1..goals.len()).rev() {
            let same = goals[at] == goals[at - 1];
            let leg = if same {
                0.0
            } else {
                bounds[at].passing(roadmap, goals[at - 1])
            };
            onward[at - 1] = onward[at] + leg;
        }
        Self {
            goals: goals.to_vec(),
            bounds,
            onward,
            passed: goals.len().saturating_sub(usize::from(stays)),
        }
    }

    /// True if a disc that has met so many goals needs no others at a vertex.
    pub fn is_over(&self, met: usize, vertex: Vertex) -> bool {
        met >= self.passed && self.goals.get(met).is_none_or(|last| *last == vertex)
    }

    /// The number of goals that are met with a visit, of which `met` were before; the one to stay at is not counted.
    pub fn met(&self, met: usize, vertex: Vertex) -> usize {
        let more = self.goals[met..self.passed]
            .iter()
            .take_while(|goal| **goal == vertex);
        met + more.count()
    }

    /// Lower bound of the seconds from rest at a vertex where so many goals are met; `turn` is the time that it takes to turn to
    /// a line.
    pub fn from(
        &self,
        roadmap: &Roadmap,
        met: usize,
        vertex: Vertex,
        turn: impl Fn(Edge) -> f64,
    ) -> f64 {
        match self.bounds.get(met) {
            Some(bounds) => bounds.from(roadmap, vertex, turn) + self.onward[met],
            None => 0.0,
        }
    }

    /// The same after the drive that ended with an edge, or at a start where that is [`NONE`] and nobody has to turn.
    pub fn after(&self, roadmap: &Roadmap, met: usize, vertex: Vertex, last: Edge) -> f64 {
        self.from(roadmap, met, vertex, |line| match last {
            NONE => 0.0,
            last => roadmap.turn_between(last, line),
        })
    }
}
