//! Hybrid A* behind the plugin contract: id `hybrid-astar`.

use fleetyard_abi::sdk::Failure;
use fleetyard_abi::{Capability, Descriptor, Status};
use fleetyard_plugin_spacetime::plugin::{Call, ROOM_LIMIT, half_of_memory};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::course::{CHORD, Course, Segment};
use crate::hybrid::{Effort, Outcome, Query};
use crate::plugin::{CLEARANCE_M, InStates, Line, Member, Method, Team, show_tree};
use crate::scene::is_clear;
use crate::steer::brake;

/// Options of `hybrid-astar`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Hybrid {
    /// The side of a bin of places, in metres; `null` for half of the robot's radius.
    #[schemars(range(min = 0.001, max = 1000.0))]
    pub bin_m: Option<f64>,
    /// Bins of a full turn; 72 have the paper's 5°.
    #[schemars(range(min = 4, max = 3600))]
    pub headings: u32,
    /// Factor of the estimate of what is left; 1 is the paper's, and in mazes looks into every bin.
    #[schemars(range(min = 1.0, max = 1000.0))]
    pub weight: f64,
    /// True to leave out poses of the way that was found where controls lead past them sooner.
    pub shorten: bool,
    /// Distance that the robot keeps from obstacles beyond touching, in metres.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub clearance_m: f64,
}

impl Default for Hybrid {
    fn default() -> Self {
        Self {
            bin_m: None,
            headings: 72,
            weight: 2.0,
            shorten: true,
            clearance_m: CLEARANCE_M,
        }
    }
}

/// Hybrid A*.
pub type HybridAstar = InStates<Hybrid>;

/// Bytes of a pose that is kept, with its bin and its place in the open list.
const POSE_BYTES: u64 = 256;

impl Method for Hybrid {
    const ID: &'static str = "hybrid-astar";
    const NAME: &'static str = "Hybrid A*";
    const ABOUT: &'static str = "Plans one robot among obstacles that stand: A* over poses of which one for each bin of place and \
         heading is kept, by arcs and turns that the robot can drive, and straight to the goal where nothing is in the way \
         (Dolgov, Thrun, Montemerlo, Diebel, IJRR 2010). Complete for its bins alone, and not optimal.";
    const MORE_FEATURES: &'static [&'static str] = &[Descriptor::ONE_AGENT];
    const CAPABILITIES: &'static [Capability] = &[];

    fn check(&self) -> Result<(), String> {
        let in_range = |name: &str, value: f64, least: f64, most: f64| {
            // Written so that NaN is out of range.
            if value >= least && value <= most {
                Ok(())
            } else {
                Err(format!(
                    "`{name}` is {value}, but has to be from {least} to {most}"
                ))
            }
        };
        in_range("bin_m", self.bin_m.unwrap_or(1.0), 0.001, 1000.0)?;
        in_range("headings", f64::from(self.headings), 4.0, 3600.0)?;
        in_range("weight", self.weight, 1.0, 1000.0)?;
        in_range("clearance_m", self.clearance_m, 0.0, 1000.0)
    }

    fn clearance_m(&self) -> f64 {
        self.clearance_m
    }

    fn solve(&self, team: &Team<'_>, call: &Call<'_>) -> Result<(), Failure> {
        let failed = |status, reason: String| Err(Failure::new(status, reason));
        let [member] = team.members.as_slice() else {
            return failed(
                Status::Unsupported,
                format!(
                    "this planner plans for one agent, the instance has {}",
                    team.len()
                ),
            );
        };
        if !team.scene.movers.is_empty() {
            let movers = team.scene.movers.len();
            return failed(
                Status::Unsupported,
                format!("this planner knows obstacles at rest only, the world has {movers} movers"),
            );
        }
        let rests = member.start.rates.iter().all(|rate| *rate == 0.0);
        if rests && member.goal.is_reached(&member.start) {
            call.metric("expansions", 0.0);
            return Ok(team.submit(call, &[Course::stay(member.start)])?);
        }
        let Some(braked) = stopped(member) else {
            return failed(
                Status::GaveUp,
                "the robot is in motion at its start, and cannot stop there".to_owned(),
            );
        };
        let effort = Effort {
            side: self.bin_m.unwrap_or(member.robot.body.radius / 2.0),
            headings: self.headings,
            expansions: call.node_limit().unwrap_or(u64::MAX),
            poses: (half_of_memory(call.budget) / POSE_BYTES).min(u64::from(u32::MAX)) as usize,
            weight: self.weight,
            shortens: self.shorten,
        };
        let ends = [member.start, member.goal.state].map(|state| state.pose());
        // What is found with a little more room is one that the same check by other chords finds clear.
        let roomy = team
            .scene
            .space(&member.robot.body, self.clearance_m + 2.0 * CHORD);
        let has_room = ends.iter().all(|pose| roomy.is_free(pose));
        let query = Query {
            robot: &member.robot,
            space: if has_room { &roomy } else { &member.space },
            world: team.scene.world,
            goal: &member.goal,
        };
        let start = braked.end(&member.robot).pose();
        let mut lines = Vec::new();
        let wanted = call.annotations().is_some();
        let mut line = |line: Line| lines.extend(wanted.then_some(line));
        let (outcome, expansions) = query.solve(start, &effort, &mut || call.stop(), &mut line);
        show_tree(call, lines);
        call.metric("expansions", expansions as f64);
        match outcome {
            Outcome::Found(course) => {
                let segments = [braked.segments, course.segments].concat();
                let course = Course {
                    start: member.start,
                    segments,
                };
                Ok(team.submit(call, &[course])?)
            }
            Outcome::NoWay => failed(
                Status::GaveUp,
                "no way was found from bin to bin; hint: a smaller `bin_m`, more `headings` or less `clearance_m` find more"
                    .to_owned(),
            ),
            Outcome::Stopped => Err(call.unfinished(ROOM_LIMIT, "a way was found")),
        }
    }
}

/// The way on which the robot comes to rest, if nothing stands there.
fn stopped(member: &Member) -> Option<Course> {
    let segments: Vec<Segment> = brake(&member.robot, &member.start).into_iter().collect();
    let course = Course {
        start: member.start,
        segments,
    };
    let end = course.end(&member.robot);
    let rests = end.rates.iter().all(|rate| rate.abs() < 1e-9);
    (rests && is_clear(&member.space, &course.track(&member.robot))).then_some(course)
}
