//! Improvement of paths that meet nobody, a neighbourhood of discs at a time.
//!
//! MAPF-LNS (Li et al., IJCAI 2021) in continuous time. A few discs are planned anew one after the other, in random order, each on
//! the earliest path that keeps out of the way of all others; the outcome is kept if they arrive earlier taken together. They are
//! chosen around a delayed disc, around a place, around a goal, and at random; ways that have gained more for their work are taken
//! more often.

use super::members::by_weight;
use super::weights::Weights;
use super::{Control, Team};
use crate::plan::cost;
use crate::sipp::Found;

/// Rate at which the weights of the ways to choose follow success.
const REACTION: f64 = 0.05;
/// The least weight: no way is given up for good.
const LEAST: f64 = 1e-3;
/// Gains below this are of rounding, in seconds.
const GAIN: f64 = 1e-9;
/// Walks tried to find discs in the way.
const WALKS: usize = 12;

/// A way to choose a neighbourhood.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Choice {
    /// A delayed disc and those in the way of shorter paths.
    Delay,
    /// A delayed disc and those near a place on its path.
    Place,
    /// A delayed disc, those that cross its goal, and those that park where it passes.
    Goal,
    /// Anybody.
    Random,
}

const CHOICES: [Choice; 4] = [Choice::Delay, Choice::Place, Choice::Goal, Choice::Random];

/// The ways to choose, with their weights.
#[derive(Debug)]
pub struct Ways(Weights<{ CHOICES.len() }>);

impl Default for Ways {
    fn default() -> Self {
        Self(Weights::new(REACTION))
    }
}

impl Team<'_> {
    /// Plans one neighbourhood anew, where nobody meets another, and gives the seconds that are gained.
    pub fn improve(&mut self, ways: &mut Ways, control: &mut Control<'_>) -> f64 {
        let way = ways.0.draw(&mut self.random);
        let members = self.choose_to_improve(CHOICES[way]);
        let before = self.search.expanded;
        let gain = self.plan_earlier(members, control);
        let work = (self.search.expanded - before) as f64;
        ways.0.learn(way, (gain / (1.0 + work / 1000.0)).max(LEAST));
        gain
    }

    fn plan_earlier(&mut self, mut members: Vec<u32>, control: &mut Control<'_>) -> f64 {
        let roadmap = self.closeness.roadmap();
        let costs = |team: &Self| -> f64 {
            let each = members.iter();
            each.map(|disc| cost(team.crowd.path(*disc))).sum()
        };
        let before = costs(self);
        // What members may need, and those not yet planned need at least.
        let mut left = before - GAIN;
        let mut least: f64 = members.iter().map(|disc| self.alone[*disc as usize]).sum();
        if least > left {
            return 0.0;
        }
        let old = self.take_out(&members);
        self.random.shuffle(&mut members);
        let better = members.iter().all(|disc| {
            if control.spend() {
                return false;
            }
            least -= self.alone[*disc as usize];
            self.search.most = left - least;
            let task = &self.tasks[*disc as usize];
            let Found::Path(path) = self.search.find(roadmap, &self.crowd, task, control.stop)
            else {
                return false;
            };
            left -= cost(&path);
            self.crowd.exchange(*disc, path);
            true
        });
        if better {
            return left + GAIN;
        }
        self.take_out(&members);
        self.restore(old);
        0.0
    }

    fn choose_to_improve(&mut self, choice: Choice) -> Vec<u32> {
        self.members.begin(self.size);
        let discs = 0..self.tasks.len() as u32;
        let first = if choice == Choice::Random {
            None
        } else {
            let delays: Vec<f64> = discs.map(|disc| self.delay(disc)).collect();
            by_weight(&delays, &mut self.random)
        };
        if let Some(first) = first {
            self.members.take(first);
        }
        match (choice, first) {
            (Choice::Delay, Some(first)) => self.in_the_way(first),
            (Choice::Place, Some(first)) => {
                let path = self.crowd.path(first);
                let center = path[self.random.below(path.len())].vertex;
                let (roadmap, random) = (self.closeness.roadmap(), &mut self.random);
                self.members.around(roadmap, &self.crowd, center, random);
            }
            (Choice::Goal, Some(first)) => {
                self.members.parking(&self.crowd, first, &mut self.random);
            }
            _ => {
                for _ in 0..4 * self.size {
                    let disc = self.random.below(self.tasks.len()) as u32;
                    self.members.take(disc);
                }
            }
        }
        self.members.finish()
    }

    /// Walks of a disc towards an earlier arrival; whoever is in the way is a member.
    fn in_the_way(&mut self, disc: u32) {
        let roadmap = self.closeness.roadmap();
        let (path, rest) = (self.crowd.path(disc), self.tasks[disc as usize].rest);
        let arrival = cost(path);
        for walk in 0..WALKS {
            let from = if walk == 0 {
                0
            } else {
                self.random.below(path.len())
            };
            let (mut vertex, mut time) = (path[from].vertex, path[from].arrival);
            while !self.members.is_full() {
                let gains = |edge: &u32| {
                    let rest = rest.from(roadmap, 0, roadmap.target(*edge), |_| 0.0);
                    time + roadmap.duration(*edge) + rest < arrival - GAIN
                };
                let edges: Vec<u32> = roadmap.leaving(vertex).filter(gains).collect();
                if edges.is_empty() {
                    break;
                }
                let edge = edges[self.random.below(edges.len())];
                for claim in self.crowd.claims_to_edge(edge) {
                    if claim.span.low < time && time < claim.span.high && claim.disc != disc {
                        self.members.take(claim.disc);
                    }
                }
                (vertex, time) = (roadmap.target(edge), time + roadmap.duration(edge));
            }
        }
    }
}
