//! What is done when the planner has failed: fail policies.
//!
//! Every one of them answers with paths that do not collide within the window (without one,
//! ever), and in which nobody moves round in a ring where that is not allowed. They need not
//! lead anybody to a goal.
//!
//! - [`Pibt`] and [`GuidedPibt`] plan anew, from step to step;
//! - [`Lrgw`] and [`RuleBased`] save what they can of the paths that the planner left;
//! - [`AllWait`] stays.
//!
//! Where robots take a step to turn, [`Pibt`], [`GuidedPibt`] and [`Lrgw`] drive their paths
//! in the order in which agents pass, with the time that turning takes; see the module
//! `convoy`.

mod convoy;
mod guided;
mod lrgw;
mod pibt;
mod rules;
mod wait;

use fleetyard_abi::sdk::{Failure, Sink};
use fleetyard_abi::{Budget, Instance, Motion, Plan, PlanRef, Status, monotonic_ns};
use fleetyard_plugin_spacetime::graph::{Vertex, direction};

pub use guided::GuidedPibt;
pub use lrgw::Lrgw;
pub use pibt::Pibt;
pub use rules::RuleBased;
pub use wait::AllWait;

use crate::ground::Ground;
use crate::invalid;

/// What a fail policy is asked, in terms of the map.
struct Question<'a> {
    ground: &'a Ground,
    starts: Vec<Vertex>,
    /// Where agents look, if that matters.
    headings: Option<Vec<u8>>,
    /// Whether agents may move round in a ring.
    rings: bool,
    /// Steps that count; `None`: all.
    window: Option<u32>,
}

impl<'a> Question<'a> {
    fn new(ground: &'a Ground, instance: &Instance) -> Result<Self, Failure> {
        let agents = instance.agents();
        if instance.goals.len() != agents {
            return Err(invalid(format!(
                "the instance has {agents} agents, but {} lists of goals",
                instance.goals.len()
            )));
        }
        let headings = match instance.motion {
            Motion::Pebble => None,
            Motion::Rotation => {
                let given = instance.headings.as_deref();
                let headings = given.filter(|all| all.len() == agents).ok_or_else(|| {
                    invalid("agents turn, but their headings are not given, or not all of them")
                })?;
                Some(headings.iter().copied().map(direction).collect())
            }
            Motion::AnyAngle => {
                let reason = "any-angle motion is not supported";
                return Err(Failure::new(Status::Unsupported, reason));
            }
        };
        Ok(Self {
            ground,
            starts: ground.places(&instance.starts)?,
            headings,
            rings: instance.allows_cycles,
            window: (instance.window_steps > 0).then_some(instance.window_steps),
        })
    }

    /// What the planner left, made usable: of each path as much as begins where the agent is,
    /// goes from cell to cell, and lies within the window. At least the start.
    fn paths(&self, failed: Option<PlanRef<'_>>) -> Vec<Vec<Vertex>> {
        let graph = &self.ground.graph;
        let most = self.window.map_or(usize::MAX, |steps| steps as usize);
        let mut left = failed.map(|plan| plan.paths());
        let usable = |start: &Vertex| {
            let mut path = vec![*start];
            let cells = left.as_mut().and_then(Iterator::next).unwrap_or_default();
            if cells.first() != Some(&graph.cell(*start)) {
                return path;
            }
            let mut here = *start;
            for cell in cells.iter().skip(1).take(most) {
                match graph.vertex(*cell) {
                    Some(v) if v == here || graph.neighbors(here).any(|near| near == v) => {
                        path.push(v);
                        here = v;
                    }
                    _ => break,
                }
            }
            path
        };
        self.starts.iter().map(usable).collect()
    }

    /// Submits paths without the waits at their ends.
    fn submit(&self, paths: &[Vec<Vertex>], sink: &dyn Sink) -> Result<(), Failure> {
        let mut plan = Plan::default();
        let mut cells = Vec::new();
        for path in paths {
            let moves = path.iter().rposition(|v| Some(v) != path.last());
            let used = moves.map_or(1, |last| last + 2).min(path.len());
            cells.clear();
            cells.extend(path[..used].iter().map(|v| self.ground.graph.cell(*v)));
            plan.push_path(&cells);
        }
        sink.submit_plan(plan.as_ref())?;
        Ok(())
    }
}

/// Says when a call has to come to its end.
fn stop<'s>(budget: &Budget, sink: &'s dyn Sink) -> impl FnMut() -> bool + use<'s> {
    let answer_by_ns = budget.answer_by_ns();
    move || sink.cancelled() || monotonic_ns() >= answer_by_ns
}

/// That a fail policy learns a map.
macro_rules! learns {
    () => {
        fn prepare(
            &mut self,
            environment: &fleetyard_abi::SharedEnvironment,
            _: &fleetyard_abi::Budget,
            _: &dyn fleetyard_abi::sdk::Sink,
        ) -> Result<(), fleetyard_abi::sdk::Failure> {
            self.ground = None;
            self.ground = Some(crate::ground::Ground::learn(environment)?);
            Ok(())
        }
    };
}
use learns;
