//! The planner behind the plugin contract: id `cbs-rrt`.

use std::rc::Rc;

use fleetyard_abi::sdk::{Annotations, Failure};
use fleetyard_abi::{Annotation, Capability, Status};
use fleetyard_plugin_spacetime::plugin::{Call, ROOM_LIMIT, half_of_memory};

use super::{InStates, Method, Team};
use crate::course::Course;
use crate::rrt::Options;
use crate::rrt::barred::Constraint;
use crate::rrt::edge::Walker;
use crate::rrt::search::{Outcome, Plan, Search};

/// Conflict-based search over rapidly-exploring random trees.
pub type CbsRrt = InStates<Options>;

impl Method for Options {
    const ID: &'static str = "cbs-rrt";
    const NAME: &'static str = "CBS over RRTs";
    const ABOUT: &'static str = "Robots with dynamics, from rest to rest: a tree in place, heading and time for each (RRT), and a greedy \
         conflict-based search whose constraints keep a footprint off a point for some time (Veerapaneni et al., 2025, for quadrupeds). \
         Discs and convex polygons. Not complete.";
    const CAPABILITIES: &'static [Capability] = &[Capability::Heterogeneous, Capability::Anytime];

    fn solve(&self, team: &Team<'_>, call: &Call<'_>) -> Result<(), Failure> {
        let walkers = Walker::team(team).into_iter().enumerate();
        let walkers = walkers.map(|(agent, walker)| {
            let reason = || format!("agent {agent} is moving and cannot come to rest");
            walker.ok_or_else(|| Failure::new(Status::GaveUp, reason()))
        });
        let walkers: Vec<Walker> = walkers.collect::<Result<_, _>>()?;
        let limits = (
            call.budget.seed,
            call.node_limit().unwrap_or(u64::MAX),
            half_of_memory(call.budget),
        );
        let stop = || call.stop();
        let mut search = Search::new(team, &walkers, self, limits, &stop);
        let outcome = search.solve();
        let submit = |plans: &[Rc<Plan>]| {
            let courses: Vec<Course> = plans.iter().map(|plan| plan.course.clone()).collect();
            team.submit(call, &courses)
        };
        let sum = |plans: &[Rc<Plan>]| plans.iter().map(|plan| plan.way.arrival()).sum::<f64>();
        let result = match outcome {
            Outcome::Solved(mut plans, constraints) => {
                submit(&plans)?;
                call.metric("first_cost_s", sum(&plans));
                let mut rounds = self.rounds;
                while rounds > 0 && search.improve(&mut plans) {
                    submit(&plans)?;
                    rounds -= 1;
                }
                if let Some(annotations) = call.annotations() {
                    show(&plans, &constraints, annotations);
                }
                Ok(())
            }
            Outcome::NoWay(agent) => Err(Failure::new(
                Status::GaveUp,
                format!("no tree of agent {agent} reached its goal; try more `samples`"),
            )),
            Outcome::GaveUp => Err(Failure::new(
                Status::GaveUp,
                "conflicts were left after the last restart; try more `restarts`",
            )),
            Outcome::Stopped => Err(call.unfinished(ROOM_LIMIT, "a plan was found")),
        };
        let effort = search.effort;
        call.metric("nodes", effort.samples as f64);
        call.metric("trees", effort.trees as f64);
        call.metric("conflict_nodes", effort.nodes as f64);
        call.metric("restarts", effort.restarts as f64);
        result
    }
}

/// Hands over the last tree of every robot, and the constraints of the plan.
fn show(plans: &[Rc<Plan>], constraints: &[(usize, Constraint)], to: &dyn Annotations) {
    for (agent, plan) in plans.iter().enumerate() {
        // What is not kept the host counts.
        let _ = to.annotate(&Annotation {
            agent: Some(agent as u32),
            ..Annotation::lines("trees", plan.lines.iter().copied())
        });
    }
    for (agent, constraint) in constraints {
        let _ = to.annotate(&Annotation {
            agent: Some(*agent as u32),
            from_s: constraint.from.max(0.0),
            to_s: Some(constraint.to.max(0.0)),
            text: "the footprint must not be here".to_owned(),
            ..Annotation::points("constraints", [[constraint.point.x, constraint.point.y]])
        });
    }
}
