//! The cheapest path of one agent in a window, among the paths of others: A\* over poses and steps.
//!
//! The rest of the way is known, and a state whose cost with it is least is expanded first; of equals
//! the last that was found, which is mostly the one that is farthest on. Hence few states beside the
//! path are looked at where nobody is in the way. Where no move against a lane makes the way shorter,
//! the path is the cheapest; others are found where such a move is next to it.

use fleetyard_plugin_spacetime::graph::{DIRECTIONS, Vertex};
use fleetyard_plugin_spacetime::known::{Known, NONE};
use fleetyard_plugin_spacetime::random::Random;
use fleetyard_plugin_spacetime::reservation::Reservations;

use super::errand::{Errand, Ground, Pose};
use crate::streets::STEP;

/// Expansions between two calls of `stop`.
const PATIENCE: u32 = 512;
/// Costs that are less than that of the start by more than this are alike.
const SLACK: u32 = 64 * STEP;

/// Scratch memory.
#[derive(Debug, Default)]
pub(super) struct Search {
    states: Vec<State>,
    /// States by pose, step and goals visited.
    known: Known,
    /// States that are not expanded yet, by their cost less that of the start, and [`SLACK`] more.
    open: Vec<Vec<u32>>,
    /// The first list that may not be empty.
    at: usize,
    limits: Limits,
    /// States expanded since the beginning.
    pub(super) expansions: u64,
}

/// A pose after a number of steps.
#[derive(Debug, Clone, Copy)]
struct State {
    pose: Pose,
    time: u32,
    parent: u32,
    /// Cost of the way to it, and of the way on from it.
    cost: u32,
    rest: u32,
}

/// Measures of costs and keys of states.
#[derive(Debug, Clone, Copy, Default)]
struct Limits {
    vertices: u64,
    stages: u64,
    least: u32,
    most: u32,
}

/// The input of [`Search::path`].
#[derive(Debug, Clone, Copy)]
pub(super) struct Query<'a> {
    pub(super) ground: Ground<'a>,
    pub(super) errand: &'a Errand,
    pub(super) others: &'a Reservations,
    /// Steps of the window.
    pub(super) window: u32,
    pub(super) cycles: bool,
    /// The most that the path may cost.
    pub(super) most: u64,
}

impl Search {
    /// The path, with a vertex for each step.
    pub(super) fn path(
        &mut self,
        query: &Query<'_>,
        random: &mut Random,
        stop: &mut dyn FnMut() -> bool,
    ) -> Option<Vec<Vertex>> {
        let Query {
            ground,
            errand,
            others,
            window,
            cycles,
            most,
        } = *query;
        let Ground { graph, turning, .. } = ground;
        let pose = errand.begin();
        let least = ground.rest(errand, pose);
        self.begin(Limits {
            vertices: graph.len() as u64,
            stages: errand.legs.len() as u64 + 1,
            least,
            most: u32::try_from(most).unwrap_or(u32::MAX),
        });
        self.push(State {
            pose,
            time: 0,
            parent: NONE,
            cost: 0,
            rest: least,
        });
        // Which direction comes first decides between equals.
        let turn = random.below(DIRECTIONS);
        let mut patience = PATIENCE;
        while let Some((id, state)) = self.pop() {
            if state.time == window {
                return Some(self.trace(id));
            }
            self.expansions += 1;
            patience -= 1;
            if patience == 0 {
                patience = PATIENCE;
                if stop() {
                    return None;
                }
            }
            let State { pose, time, .. } = state;
            let v = pose.v;
            let stays = !others.busy(v, time + 1);
            let next = |pose: Pose, cost: u32, rest: u32| State {
                pose,
                time: time + 1,
                parent: id,
                cost: state.cost + cost,
                rest,
            };
            let done = pose.visited == errand.legs.len();
            let wait = next(pose, errand.wait(pose), state.rest);
            // The last of equals is tried first: who has nothing to do stays, others go.
            if stays && !done {
                self.push(wait);
            }
            if let (true, true, Some(heading)) = (turning, stays, pose.heading) {
                for heading in [(heading + 1) % 4, (heading + 3) % 4] {
                    let turned = Pose {
                        heading: Some(heading),
                        ..pose
                    };
                    let cost = ground.turn(errand, pose.visited);
                    self.push(next(turned, cost, ground.rest(errand, turned)));
                }
            }
            for k in 0..DIRECTIONS {
                let d = (k + turn) % DIRECTIONS;
                let u = graph.around(v)[d];
                if u == graph.wall()
                    || turning && pose.heading != Some(d as u8)
                    || others.busy(u, time + 1)
                {
                    continue;
                }
                // Whoever leaves as we come must not come to where we leave from.
                let blocked = if cycles {
                    others.leaves(u, (d + 2) % DIRECTIONS, time)
                } else {
                    others.closes_ring(graph, v, u, time)
                };
                if blocked {
                    continue;
                }
                let (cost, to) = ground.advance(errand, pose, d);
                self.push(next(to, cost, ground.rest(errand, to)));
            }
            if stays && done {
                self.push(wait);
            }
        }
        None
    }

    fn begin(&mut self, limits: Limits) {
        self.states.clear();
        self.known.begin();
        self.open.iter_mut().for_each(Vec::clear);
        self.at = SLACK as usize;
        self.limits = limits;
    }

    /// The newest state of the same pose, step and number of goals; [`NONE`] where there is none.
    #[inline]
    fn entry(&mut self, state: &State) -> &mut u32 {
        let Limits {
            vertices, stages, ..
        } = self.limits;
        let Pose {
            v,
            heading,
            visited,
        } = state.pose;
        let place = u64::from(state.time) * vertices + u64::from(v);
        let place = place * DIRECTIONS as u64 + u64::from(heading.unwrap_or(0));
        self.known.entry(place * stages + visited as u64)
    }

    /// Adds a state, unless it costs too much or no less than another one in its place.
    #[inline]
    fn push(&mut self, state: State) {
        let cost = state.cost + state.rest;
        if cost > self.limits.most {
            return;
        }
        let id = self.states.len() as u32;
        let other = *self.entry(&state);
        if other != NONE && self.states[other as usize].cost <= state.cost {
            return;
        }
        *self.entry(&state) = id;
        let place = (cost + SLACK).saturating_sub(self.limits.least) as usize;
        self.at = self.at.min(place);
        if place >= self.open.len() {
            self.open.resize_with(place + 1, Vec::new);
        }
        self.open[place].push(id);
        self.states.push(state);
    }

    /// Takes the state that is to be expanded next.
    #[inline]
    fn pop(&mut self) -> Option<(u32, State)> {
        loop {
            let Some(id) = self.open.get_mut(self.at)?.pop() else {
                self.at += 1;
                continue;
            };
            let state = self.states[id as usize];
            // Others were found later, at less cost.
            if *self.entry(&state) == id {
                return Some((id, state));
            }
        }
    }

    fn trace(&self, last: u32) -> Vec<Vertex> {
        let mut state = self.states[last as usize];
        let mut path = vec![state.pose.v; state.time as usize + 1];
        while state.parent != NONE {
            state = self.states[state.parent as usize];
            path[state.time as usize] = state.pose.v;
        }
        path
    }
}
