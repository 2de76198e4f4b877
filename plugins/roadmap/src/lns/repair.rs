//! Repair of paths that meet, a neighbourhood of discs at a time.
//!
//! MAPF-LNS2 (Li et al., AAAI 2022) in continuous time. The discs get paths one after the other: the earliest that keeps out of the
//! way of all others, or where there is none the one that meets the fewest. Then a few at a time are planned anew in the second way,
//! and the outcome is kept if no more pairs meet than before. Those are chosen in three ways; ways that have led further are taken
//! more often.

use fleetyard_plugin_plane::orders::longest_first;

use super::members::by_weight;
use super::weights::Weights;
use super::{Control, Team};
use crate::sipp::Found;

/// Rate at which the weights of the ways to choose follow success, as in the paper.
const REACTION: f64 = 0.01;

/// A way to choose a neighbourhood.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Choice {
    /// Discs that meet one another.
    Collision,
    /// One that meets others, those that park in its way, and those that pass where it wants to park.
    Failure,
    /// Anybody, those that meet more others more often.
    Random,
}

const CHOICES: [Choice; 3] = [Choice::Collision, Choice::Failure, Choice::Random];

/// Result of a repair.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Repaired {
    /// Everybody has a path, and nobody meets another.
    pub valid: bool,
    /// Pairs that met after everybody was planned once.
    pub pairs_at_first: usize,
    /// Neighbourhoods tried.
    pub neighborhoods: u64,
}

impl Team<'_> {
    /// Gives everybody a path, and repairs them until nobody meets another or a limit is met.
    pub fn repair(&mut self, control: &mut Control<'_>) -> Repaired {
        let mut repaired = Repaired {
            valid: false,
            pairs_at_first: 0,
            neighborhoods: 0,
        };
        let order = longest_first(&self.alone);
        let mut planned = order.into_iter();
        if planned.any(|disc| {
            control.spend() || self.bytes() > control.memory || !self.plan_first(disc, control)
        }) {
            return repaired;
        }
        repaired.pairs_at_first = self.pairs();
        let mut weights = Weights::<{ CHOICES.len() }>::new(REACTION);
        while self.pairs() > 0 && !control.spend() {
            repaired.neighborhoods += 1;
            let way = weights.draw(&mut self.random);
            let members = self.choose_for_repair(CHOICES[way]);
            weights.learn(way, self.plan_anew(members, control) as f64);
        }
        repaired.valid = self.pairs() == 0;
        repaired
    }

    /// The earliest path that keeps out of the way of all others, or the one that meets the fewest.
    fn plan_first(&mut self, disc: u32, control: &mut Control<'_>) -> bool {
        let (roadmap, task) = (self.closeness.roadmap(), &self.tasks[disc as usize]);
        self.search.most = f64::INFINITY;
        match self.search.find(roadmap, &self.crowd, task, control.stop) {
            Found::Path(path) => {
                self.crowd.exchange(disc, path);
                true
            }
            Found::None => self.plan_fewest(disc, control),
            Found::Stopped => false,
        }
    }

    /// Gives a disc without a path the one that meets the fewest others.
    fn plan_fewest(&mut self, disc: u32, control: &mut Control<'_>) -> bool {
        let (roadmap, task) = (self.closeness.roadmap(), &self.tasks[disc as usize]);
        match self.fewest.find(roadmap, &self.crowd, task, control.stop) {
            Found::Path(path) => {
                self.crowd.exchange(disc, path);
                true
            }
            Found::None | Found::Stopped => false,
        }
    }

    /// Plans a neighbourhood anew, keeps that unless more pairs meet than before, and gives the number of pairs that meet no longer.
    fn plan_anew(&mut self, mut members: Vec<u32>, control: &mut Control<'_>) -> usize {
        let before = self.pairs();
        let old = self.take_out(&members);
        self.random.shuffle(&mut members);
        let better = members.iter().all(|disc| {
            !control.spend() && self.plan_fewest(*disc, control) && self.pairs() <= before
        });
        if !better {
            self.take_out(&members);
            self.restore(old);
        }
        before.saturating_sub(self.pairs())
    }

    fn choose_for_repair(&mut self, choice: Choice) -> Vec<u32> {
        self.members.begin(self.size);
        let discs = 0..self.tasks.len() as u32;
        let met: Vec<usize> = discs.map(|disc| self.crowd.meetings(disc).len()).collect();
        let Self {
            members,
            crowd,
            random,
            ..
        } = self;
        let roadmap = self.closeness.roadmap();
        if choice == Choice::Random {
            let mut weights: Vec<f64> = met.iter().map(|met| *met as f64 + 1.0).collect();
            while !members.is_full() {
                let Some(disc) = by_weight(&weights, random) else {
                    break;
                };
                weights[disc as usize] = 0.0;
                members.take(disc);
            }
            return members.finish();
        }
        let weights: Vec<f64> = met.iter().map(|met| (*met).min(1) as f64).collect();
        if let Some(first) = by_weight(&weights, random) {
            members.take(first);
            if choice == Choice::Failure {
                members.parking(crowd, first, random);
            } else {
                // Those that meet members, and so on.
                let mut next = 0;
                while let Some(member) = members.as_slice().get(next).copied() {
                    next += 1;
                    let others = crowd.meetings(member).iter().map(|meeting| meeting.disc);
                    members.take_all(others.collect(), random);
                }
            }
            members.walk(roadmap, crowd, random);
        }
        members.finish()
    }
}
