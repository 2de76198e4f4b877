//! Planners by random trees.

mod k_cbs;
mod near;
mod rrt_star;
mod sst;

use std::sync::Arc;
use std::sync::atomic::Ordering;

use fleetyard_abi::sdk::{Failure, Options, Planner, Plugin};
use fleetyard_abi::{Budget, Footprint, Plan, Robot, monotonic_ns};
use fleetyard_plugin_kinodynamic::course::{Course, Segment};
use fleetyard_plugin_kinodynamic::plugin::Team;
use fleetyard_plugin_plane::plugin::robots::world;
use fleetyard_testkit::Notes;

use super::tasks::{Problem, robot};

/// An answer of a planner.
pub(super) struct Answer {
    pub(super) end: Result<(), Failure>,
    /// The courses of all robots, of every plan.
    pub(super) plans: Vec<Vec<Course>>,
    figures: Vec<(String, f64)>,
}

impl Answer {
    /// Seconds of the last plan, in sum.
    fn cost(&self) -> f64 {
        let last = &self.plans[self.plans.len() - 1];
        last.iter().map(Course::seconds).sum()
    }

    pub(super) fn count(&self, name: &str) -> u64 {
        let mut named = self.figures.iter().filter(|(known, _)| known == name);
        named.next_back().unwrap().1 as u64
    }
}

/// A robot of these dynamics.
fn of(dynamics: &str, footprint: Footprint) -> Robot {
    let axes = if dynamics.contains("unicycle") { 2 } else { 3 };
    let second = dynamics.contains("double") || dynamics.contains("-2");
    let changes = [0.5, 0.4, 0.6];
    robot(
        dynamics,
        footprint,
        &[0.8, 0.7, 0.9][3 - axes..],
        if second { &changes[3 - axes..] } else { &[] },
    )
}

/// Plans with so many nodes, and asserts that all plans are plans, and each better than the one before.
fn ask<P: Plugin + Planner>(problem: &Problem, options: &str, nodes: u64) -> Answer {
    asked::<P>(problem, options, nodes, 1, false)
}

pub(super) fn asked<P: Plugin + Planner>(
    problem: &Problem,
    options: &str,
    nodes: u64,
    seed: u64,
    cancelled: bool,
) -> Answer {
    let environment = Arc::new(problem.environment());
    let mut budget = Budget::lasting(monotonic_ns(), 60_000_000_000);
    (budget.nodes, budget.seed) = (nodes, seed);
    let notes = Notes::default();
    notes.cancelled.store(cancelled, Ordering::Relaxed);
    let mut planner = P::create(Options::new(options)).unwrap();
    let mut map = planner.prepare(&environment, &budget, &notes).unwrap();
    let end = planner.plan(&mut map, &problem.instance, &budget, &notes);
    let world = world(&environment).unwrap();
    let mut plans: Vec<Vec<Course>> = Vec::new();
    for plan in notes.others.lock().unwrap().iter() {
        let Plan::Trajectories(plan) = plan else {
            panic!("{plan:?}");
        };
        let controls = plan.controls().unwrap();
        let team = Team::new(&world, &problem.instance, 0.0).unwrap();
        let courses = team.members.iter().enumerate().map(|(agent, member)| {
            let segments = controls.of(agent).map(|segment| {
                let mut numbers = segment.control.iter().copied();
                let axes = member.robot.axes();
                let mut any = |there| if there { numbers.next().unwrap() } else { 0.0 };
                Segment {
                    control: axes.map(&mut any),
                    seconds: segment.duration_s,
                }
            });
            Course {
                start: member.start,
                segments: segments.collect(),
            }
        });
        let courses: Vec<Course> = courses.collect();
        assert_eq!(team.fault(&courses), None);
        plans.push(courses);
    }
    let costs: Vec<f64> = plans
        .iter()
        .map(|plan| plan.iter().map(Course::seconds).sum())
        .collect();
    assert!(costs.is_sorted_by(|one, other| one > other), "{costs:?}");
    assert_eq!(end.is_ok(), !plans.is_empty(), "{end:?}");
    let figures = notes.figures.lock().unwrap().clone();
    Answer {
        end,
        plans,
        figures,
    }
}
