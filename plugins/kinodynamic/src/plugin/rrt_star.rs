//! The planner behind the plugin contract: id `rrt-star`.

use fleetyard_abi::sdk::Failure;
use fleetyard_abi::{Capability, Descriptor, Status};
use fleetyard_plugin_plane::sssp::bodies::{Pose, wrapped};
use fleetyard_plugin_spacetime::plugin::{Call, ROOM_LIMIT, half_of_memory};

use super::{InStates, Member, Method, Team, show_tree};
use crate::course::Course;
use crate::sampling::motions::{Motions, seconds};
use crate::sampling::rrt_star::{Options, Task, Tree, VERTEX_BYTES};
use crate::steer::brake;

/// The clock is read after so many samples.
const SAMPLES: u64 = 16;

/// A plan that is better by less than this part of its cost waits for the end of the budget.
const BETTER: f64 = 1e-3;

/// A tree of ways from rest to rest.
pub type RrtStar = InStates<Options>;

impl Method for Options {
    const ID: &'static str = "rrt-star";
    const NAME: &'static str = "RRT*";
    const ABOUT: &'static str = "Anytime: one robot, whose ways from rest to rest are a random tree that is rewired \
         where that is faster (RRT*: Karaman, Frazzoli, IJRR 2011), with samples where a faster way may lead \
         (Informed RRT*: Gammell, Srinivasa, Barfoot, IROS 2014). Discs and convex polygons; teams are for sssp.";
    const MORE_FEATURES: &'static [&'static str] = &[Descriptor::ONE_AGENT];
    const CAPABILITIES: &'static [Capability] = &[Capability::Anytime];

    fn clearance_m(&self) -> f64 {
        self.clearance_m
    }

    fn solve(&self, team: &Team<'_>, call: &Call<'_>) -> Result<(), Failure> {
        let member = alone(team, "sssp and k-cbs plan for teams")?;
        if !team.scene.movers.is_empty() {
            return Err(Failure::new(
                Status::Unsupported,
                format!(
                    "this planner knows obstacles at rest only, the world has {} movers; hint: sst keeps clear of them",
                    team.scene.movers.len()
                ),
            ));
        }
        let gave_up = |reason: &str| Failure::new(Status::GaveUp, reason);
        let (robot, goal) = (&member.robot, &member.goal);
        let halt = Course {
            start: member.start,
            segments: brake(robot, &member.start).into_iter().collect(),
        };
        let rest = halt.end(robot);
        if !member.space.is_free(&member.start.pose()) || team.track(0, &halt).is_err() {
            return Err(gave_up(
                "the robot touches an obstacle at its start or before it can stop",
            ));
        }
        if goal.is_reached(&rest) {
            call.metric("nodes", 0.0);
            return submitted(team, call, &halt);
        }
        let motions = Motions::new(member);
        let is_chosen = goal.free.heading && motions.turns;
        if !is_chosen && !member.space.is_free(&goal.state.pose()) {
            return Err(gave_up("the robot touches an obstacle at its goal"));
        }
        let heading = (!goal.free.heading).then_some(goal.state.heading);
        let turn = heading.filter(|_| robot.has_heading && !motions.turns);
        // A turn that the ways of the tree leave out, in seconds.
        let turning = turn.map_or(0.0, |heading| {
            let turn = wrapped(heading - rest.heading);
            let [least, most] = robot.rates[2];
            let seconds = (turn / most).max(turn / least);
            if turn == 0.0 { 0.0 } else { seconds }
        });
        if !turning.is_finite() {
            return Err(gave_up("the robot has to turn to its goal, and cannot"));
        }
        let task = Task {
            start: rest.pose(),
            goal: goal.state.pose(),
            any_heading: goal.free.heading,
            bounds: team.scene.world.bounds,
            least: 0.0,
        };
        let goal_pose = Pose {
            heading: heading.unwrap_or(rest.heading),
            ..task.goal
        };
        let task = Task {
            least: motions.bound(&task.start, &goal_pose).max(turning),
            ..task
        };
        let mut tree = Tree::new(&motions, task, self, call.budget.seed);
        let room = (half_of_memory(call.budget) / VERTEX_BYTES).clamp(1, u64::from(u32::MAX) - 1);
        let nodes = call.node_limit().unwrap_or(u64::MAX);
        let mut told = f64::INFINITY;
        let mut tell = |tree: &mut Tree<'_>, part: f64| {
            let Some(way) = tree.way() else {
                return Ok(());
            };
            let way = if self.shorten {
                motions.shortened(&way)
            } else {
                way
            };
            let Some(segments) = motions.course(&way, turn) else {
                return Ok(());
            };
            let cost = seconds(&segments);
            tree.learn(cost);
            if cost >= told * (1.0 - part) {
                return Ok(());
            }
            if told.is_infinite() {
                call.metric("first_cost_s", cost);
            }
            told = cost;
            let mut course = halt.clone();
            course.segments.extend(segments);
            submitted(team, call, &course)
        };
        while tree.samples < nodes && (tree.vertices() as u64) < room && !tree.is_done() {
            if tree.samples.is_multiple_of(SAMPLES) && call.stop() {
                break;
            }
            if tree.grow() {
                tell(&mut tree, BETTER)?;
            }
        }
        tell(&mut tree, 0.0)?;
        show_tree(call, tree.lines());
        call.metric("nodes", tree.samples as f64);
        call.metric("vertices", tree.vertices() as f64);
        call.metric("tests", tree.tests as f64);
        if told.is_finite() {
            return Ok(());
        }
        Err(call.unfinished(ROOM_LIMIT, "a way was found"))
    }
}

/// The one robot of a team, or a refusal with a hint.
pub(super) fn alone<'a>(team: &'a Team<'_>, hint: &str) -> Result<&'a Member, Failure> {
    match team.members.as_slice() {
        [member] => Ok(member),
        members => Err(Failure::new(
            Status::Unsupported,
            format!(
                "this planner plans for one agent, the instance has {}; hint: {hint}",
                members.len()
            ),
        )),
    }
}

/// Submits the course of a robot, which has to be a plan.
pub(super) fn submitted(team: &Team<'_>, call: &Call<'_>, course: &Course) -> Result<(), Failure> {
    Ok(team.submit(call, std::slice::from_ref(course))?)
}
