//! Robots that push each other out of the way on their roadmaps, where the search makes no headway: priority inheritance with
//! backtracking (K. Okumura, M. Machida, X. Défago, Y. Tamura, "Priority inheritance with backtracking for iterative multi-agent
//! path finding", AIJ 310, 2022) with motions instead of steps.
//!
//! In a step everybody moves at most once, who has been away from its goal for the longest first. A robot takes the vertex next to
//! its own from which the goal is nearest. Robots that rest in the way move before, so that the motion meets none of them. The
//! moves are one after the other, as those of the search. It may go on for ever: the number of steps is limited.

use super::bodies::{Leg, hits};
use super::roadmap::{Roadmap, Robot, START, Sampler};
use super::search::Move;

/// A robot pushes at most so many others for one motion: a long one through a crowd would move everybody and fail.
const PUSHED: usize = 3;

/// A team on its roadmaps.
pub struct Pushing<'a, G> {
    robots: &'a [Robot],
    roadmaps: &'a mut [Roadmap],
    sampler: &'a mut Sampler,
    /// Lets the roadmap of a robot grow around a vertex.
    grow: G,
    at: Vec<u32>,
    /// Robots that have moved in this step, or stay.
    done: Vec<bool>,
    /// Steps since a robot was at its goal, and a lot.
    away: Vec<(u64, usize)>,
    /// Those who wait for a way to be free, and their motions.
    waiting: Vec<(usize, Leg)>,
    moves: Vec<Move>,
}

impl<'a, G: Fn(&mut Sampler, &mut Roadmap, usize, u32)> Pushing<'a, G> {
    /// All at their starts.
    pub fn new(
        robots: &'a [Robot],
        roadmaps: &'a mut [Roadmap],
        sampler: &'a mut Sampler,
        grow: G,
    ) -> Self {
        let mut lots: Vec<usize> = (0..robots.len()).collect();
        sampler.shuffle(&mut lots);
        Self {
            at: vec![START; robots.len()],
            done: vec![false; robots.len()],
            away: lots.into_iter().map(|lot| (0, lot)).collect(),
            waiting: Vec::new(),
            moves: Vec::new(),
            robots,
            roadmaps,
            sampler,
            grow,
        }
    }

    /// Moves that bring everybody to its goal in at most so many steps, if they do.
    pub fn run(mut self, steps: u64, more: &mut dyn FnMut() -> bool) -> Option<Vec<Move>> {
        let mut order: Vec<usize> = (0..self.robots.len()).collect();
        for _ in 0..steps {
            let home = |robot: usize, at: &[u32]| self.roadmaps[robot].goal() == at[robot];
            if order.iter().all(|robot| home(*robot, &self.at)) {
                return Some(self.moves);
            }
            for robot in 0..self.robots.len() {
                let away = &mut self.away[robot].0;
                *away = if home(robot, &self.at) { 0 } else { *away + 1 };
            }
            order.sort_by_key(|robot| std::cmp::Reverse(self.away[*robot]));
            self.done.fill(false);
            for robot in &order {
                if !more() {
                    return None;
                }
                if !self.done[*robot] {
                    self.push(*robot);
                }
            }
        }
        None
    }

    /// Moves a robot, if it can be; it has to get out of the way of those who wait.
    fn push(&mut self, robot: usize) -> bool {
        let from = self.at[robot];
        (self.grow)(self.sampler, &mut self.roadmaps[robot], robot, from);
        let roadmap = &self.roadmaps[robot];
        let mut next: Vec<u32> = roadmap.next(from).chain([from]).collect();
        next.sort_by(|a, b| roadmap.to_goal(*a).total_cmp(&roadmap.to_goal(*b)));
        self.done[robot] = true;
        for to in next {
            let pose = self.roadmaps[robot].pose(to);
            let body = &self.robots[robot].space.body;
            let in_the_way = |(waiting, leg): &(usize, Leg)| {
                hits(&self.robots[*waiting].space.body, leg, body, &pose)
            };
            if self.waiting.iter().any(in_the_way) {
                continue;
            }
            if to == from {
                return true;
            }
            let leg = self.robots[robot].leg(self.roadmaps[robot].pose(from), pose);
            let blocking = self.blocking(robot, &leg);
            if blocking.len() > PUSHED || blocking.iter().any(|other| self.done[*other]) {
                continue;
            }
            self.waiting.push((robot, leg));
            let pushed = blocking
                .into_iter()
                .all(|other| self.done[other] || self.push(other));
            self.waiting.pop();
            if pushed && self.blocking(robot, &leg).is_empty() {
                self.moves.push(Move { robot, leg });
                self.at[robot] = to;
                return true;
            }
        }
        false
    }

    /// Robots that a motion touches where they rest.
    fn blocking(&self, robot: usize, leg: &Leg) -> Vec<usize> {
        let body = &self.robots[robot].space.body;
        let touched = |other: &usize| {
            let pose = self.roadmaps[*other].pose(self.at[*other]);
            *other != robot && hits(body, leg, &self.robots[*other].space.body, &pose)
        };
        (0..self.robots.len()).filter(touched).collect()
    }
}
