//! Planners of robots with dynamics behind the plugin contract.
//!
//! A planner is its options: a type that implements [`Method`] says what it is and how it plans. [`InStates`] makes the plugin of it.

use std::fmt;
use std::rc::Rc;

use fleetyard_abi::sdk::{Failure, Options, Planner, Plugin, Sink};
use fleetyard_abi::{
    Annotation, Budget, Capability, ControlPlan, Descriptor, Instance, Kind, MotionPlan,
    SharedEnvironment, Status,
};
use fleetyard_plugin_plane::plugin::robots::world;
use fleetyard_plugin_plane::prioritised::World;
use fleetyard_plugin_plane::sssp::bodies::{Body, Space};
use fleetyard_plugin_spacetime::plugin::{Call, described, parse};
use schemars::JsonSchema;
use serde::de::DeserializeOwned;

use crate::course::{Course, Track};
use crate::robot::{CARS, DYNAMICS, Free, Goal, Robot, State};
use crate::scene::{Scene, clash, is_clear};

pub mod cbs_rrt;
pub mod db_astar;
pub mod db_cbs;
pub mod db_lacam;
pub mod hybrid_astar;
pub mod k_cbs;
pub mod rrt_star;
pub mod sst;

/// A way to plan; the type is that of its options.
pub trait Method: DeserializeOwned + JsonSchema + Send + 'static {
    /// The identifier.
    const ID: &'static str;
    /// The name.
    const NAME: &'static str;
    /// The method in a sentence or two, with its source.
    const ABOUT: &'static str;
    /// Names of the dynamics of robots that it plans for, besides [`DYNAMICS`].
    const MORE_DYNAMICS: &'static [&'static str] = &[];
    /// Features besides those of its dynamics, such as [`Descriptor::ONE_AGENT`].
    const MORE_FEATURES: &'static [&'static str] = &[];
    /// Capabilities besides [`Capability::Continuous`], [`Capability::Dynamics`] and [`Capability::Deterministic`].
    const CAPABILITIES: &'static [Capability];

    /// The reason why the options are refused, beyond what their schema says.
    fn check(&self) -> Result<(), String> {
        Ok(())
    }

    /// Distance that robots keep from all others beyond touching, in metres, where there is room for it.
    fn clearance_m(&self) -> f64 {
        CLEARANCE_M
    }

    /// Plans for a team, and submits plans to the call.
    fn solve(&self, team: &Team<'_>, call: &Call<'_>) -> Result<(), Failure>;
}

/// The usual [`Method::clearance_m`]: motions are judged by chords that are up to a tenth of a millimetre beside them.
pub const CLEARANCE_M: f64 = 1e-3;

/// Two ends of a line, in metres.
pub type Line = [[f64; 2]; 2];

/// Most lines of a tree that are shown.
const LINES: usize = 16_000;

/// Shows the first lines of a tree, if somebody wants to see them.
pub(crate) fn show_tree(call: &Call<'_>, lines: impl IntoIterator<Item = Line>) {
    if let Some(annotations) = call.annotations() {
        // What is not kept the host counts.
        let _ = annotations.annotate(&Annotation::lines("trees", lines.into_iter().take(LINES)));
    }
}

/// A team in a world.
#[derive(Debug)]
pub struct Team<'a> {
    /// The world.
    pub scene: Scene<'a>,
    /// Its robots.
    pub members: Vec<Member>,
}

/// A robot of a team, with its task.
#[derive(Debug, Clone)]
pub struct Member {
    /// The robot.
    pub robot: Robot,
    /// Its state at time zero.
    pub start: State,
    /// The state that it has to come to rest in.
    pub goal: Goal,
    /// Its body, with half of the distance that robots keep from each other.
    pub body: Body,
    /// Obstacles that stand, as its body sees them with the distance that it keeps.
    pub space: Rc<Space>,
    /// The same, as its trailer sees them.
    pub behind: Option<Rc<Space>>,
}

impl Member {
    /// The robot, and what it tows, are clear of what stands.
    pub fn is_free(&self, state: &State) -> bool {
        is_free(&self.robot, (&self.space, self.behind.as_deref()), state)
    }

    /// A motion touches nothing that stands.
    pub fn is_clear(&self, track: &Track) -> bool {
        let trail = track.trail.as_ref().zip(self.behind.as_ref());
        is_clear(&self.space, track)
            && trail.is_none_or(|(trail, space)| is_clear(space, &trail.track))
    }
}

fn is_free(robot: &Robot, (space, behind): (&Space, Option<&Space>), state: &State) -> bool {
    let trailer = robot.trailer().zip(behind);
    space.is_free(&state.pose())
        && trailer
            .is_none_or(|(trailer, space)| space.is_free(&trailer.pose(state.at, state.behind)))
}

/// The reason why courses are no plan.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Fault {
    /// Controls of this robot exceed its limits.
    Limits(usize),
    /// This robot touches what stands.
    Wall(usize),
    /// This robot touches what moves.
    Mover(usize),
    /// These robots touch, at a time in seconds.
    Pair([usize; 2], f64),
    /// This robot does not come to rest at its goal.
    Goal(usize),
}

impl fmt::Display for Fault {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Limits(agent) => write!(to, "agent {agent} exceeds its limits"),
            Self::Wall(agent) => write!(to, "agent {agent} touches an obstacle"),
            Self::Mover(agent) => write!(to, "agent {agent} touches an obstacle that moves"),
            Self::Pair([one, other], time) => {
                write!(to, "agents {one} and {other} touch at {time} s")
            }
            Self::Goal(agent) => write!(to, "agent {agent} does not come to rest at its goal"),
        }
    }
}

/// A plan that the planner itself refuses is not submitted.
impl From<Fault> for Failure {
    fn from(fault: Fault) -> Self {
        Self::new(
            Status::GaveUp,
            format!("the plan that was found is none: {fault}"),
        )
    }
}

impl<'a> Team<'a> {
    /// The team of an instance. Robots keep so many metres of clearance where there is room for it at their starts and goals.
    pub fn new(world: &'a World, instance: &Instance, clearance: f64) -> Result<Self, Failure> {
        let scene = Scene::new(world);
        let tasks: Vec<(Robot, State, Goal)> = (0..instance.agents())
            .map(|agent| task(instance, agent))
            .collect::<Result<_, _>>()?;
        let touches = |one: &(Robot, State, Goal), other: &(Robot, State, Goal), distance: f64| {
            let robots = [one, other].map(|(robot, _, _)| grown(robot, distance / 2.0));
            let bodies = [one, other].map(|(robot, _, _)| robot.body.grown(distance / 2.0));
            let touch = |states: [&State; 2]| {
                let rests = |number: usize| Course::stay(*states[number]).track(&robots[number]);
                let (own, others) = (rests(0), rests(1));
                clash((&bodies[0], &own), (&bodies[1], &others), 0.0, 1.0).is_some()
            };
            touch([&one.1, &other.1]) || touch([&one.2.state, &other.2.state])
        };
        let mut members: Vec<Member> = Vec::with_capacity(tasks.len());
        let mut spaces: Vec<Rc<Space>> = Vec::new();
        for (agent, own) in tasks.iter().enumerate() {
            let (robot, start, goal) = own;
            let others = tasks
                .iter()
                .enumerate()
                .filter(|(other, _)| *other != agent);
            let apart = shrinking(clearance, |distance| {
                !others
                    .clone()
                    .any(|(_, other)| touches(own, other, distance))
            });
            let mut space_of = |body: &Body, distance: f64| {
                let grown = body.grown(distance);
                let known = spaces.iter().find(|space| space.body == grown).cloned();
                known.unwrap_or_else(|| {
                    spaces.push(scene.space(body, distance));
                    spaces[spaces.len() - 1].clone()
                })
            };
            let towed = robot.trailer().map(|trailer| Rc::clone(&trailer.body));
            let mut spaces_of = |distance: f64| {
                let own = space_of(&robot.body, distance);
                let behind = towed.as_ref().map(|body| space_of(body, distance));
                (own, behind)
            };
            let from_walls = shrinking(clearance, |distance| {
                let (own, behind) = spaces_of(distance);
                let ends = [*start, goal.state];
                let mut ends = ends.iter();
                ends.all(|state| is_free(robot, (&own, behind.as_deref()), state))
            });
            let (space, behind) = spaces_of(from_walls);
            members.push(Member {
                body: robot.body.grown(apart / 2.0),
                space,
                behind,
                robot: grown(robot, apart / 2.0),
                start: *start,
                goal: *goal,
            });
        }
        Ok(Self { scene, members })
    }

    /// Number of robots.
    pub fn len(&self) -> usize {
        self.members.len()
    }

    /// There is no robot.
    pub fn is_empty(&self) -> bool {
        self.members.is_empty()
    }

    /// The first fault of courses, one for every robot: of robots by themselves, then of pairs by time.
    pub fn fault(&self, courses: &[Course]) -> Option<Fault> {
        let mut tracks = Vec::with_capacity(courses.len());
        for (agent, (member, course)) in self.members.iter().zip(courses).enumerate() {
            match self.track(agent, course) {
                Ok(track) => tracks.push(track),
                Err(fault) => return Some(fault),
            }
            if !member.goal.is_reached(&course.end(&member.robot)) {
                return Some(Fault::Goal(agent));
            }
        }
        self.first_clash(&tracks)
    }

    /// The motion of a robot that touches nothing but perhaps other robots, or its fault.
    pub fn track(&self, agent: usize, course: &Course) -> Result<Track, Fault> {
        let member = &self.members[agent];
        if !course.is_allowed(&member.robot) {
            return Err(Fault::Limits(agent));
        }
        let track = course.track(&member.robot);
        if !member.is_clear(&track) {
            return Err(Fault::Wall(agent));
        }
        if !self.scene.is_clear_of_movers(&member.body, &track, true) {
            return Err(Fault::Mover(agent));
        }
        Ok(track)
    }

    /// The pair of robots that touch first, and when.
    pub fn first_clash(&self, tracks: &[Track]) -> Option<Fault> {
        let mut first: Option<([usize; 2], f64)> = None;
        for one in 0..tracks.len() {
            for other in one + 1..tracks.len() {
                let until = first.map_or(f64::INFINITY, |(_, time)| time);
                let moving = |agent: usize| (&self.members[agent].body, &tracks[agent]);
                if let Some(time) = clash(moving(one), moving(other), 0.0, until) {
                    first = Some(([one, other], time));
                }
            }
        }
        first.map(|(pair, time)| Fault::Pair(pair, time))
    }

    /// Submits courses, one for every robot, if they are a plan. Otherwise says why they are none.
    pub fn submit(&self, call: &Call<'_>, courses: &[Course]) -> Result<(), Fault> {
        if let Some(fault) = self.fault(courses) {
            return Err(fault);
        }
        let mut controls = ControlPlan::default();
        for (member, course) in self.members.iter().zip(courses) {
            let lasting = course
                .segments
                .iter()
                .filter(|segment| segment.seconds > 0.0);
            let numbers =
                lasting.map(|segment| (segment.seconds, member.robot.numbers(&segment.control)));
            // Controls of one robot have the same numbers.
            let _ = controls.push_agent(numbers);
        }
        call.submit(&MotionPlan::from(controls));
        Ok(())
    }
}

/// A robot whose trailer is larger by a distance on all sides.
fn grown(robot: &Robot, distance: f64) -> Robot {
    let mut grown = robot.clone();
    if let Some(trailer) = grown.car.as_mut().and_then(|car| car.trailer.as_mut()) {
        trailer.body = Rc::new(trailer.body.grown(distance));
    }
    grown
}

/// The clearance, or what is left of it where there is less room.
fn shrinking(clearance: f64, mut fits: impl FnMut(f64) -> bool) -> f64 {
    let tried = [1.0, 0.5, 0.25, 0.1].map(|part| part * clearance);
    tried
        .into_iter()
        .find(|distance| fits(*distance))
        .unwrap_or(0.0)
}

/// The robot, start and goal of an agent.
fn task(instance: &Instance, agent: usize) -> Result<(Robot, State, Goal), Failure> {
    let invalid = |reason: String| Failure::new(Status::InvalidInput, reason);
    let lacking = |what: &str| invalid(format!("agent {agent} has no {what}"));
    let robot = instance.robot(agent).ok_or_else(|| lacking("robot"))?;
    let robot = Robot::new(robot).map_err(|reason| {
        Failure::new(
            Status::Unsupported,
            format!("robot of agent {agent}: {reason}"),
        )
    })?;
    let start = instance
        .start_states
        .get(agent)
        .ok_or_else(|| lacking("start"))?;
    let (start, _) = robot
        .state(&start.0)
        .ok_or_else(|| lacking("start with a place"))?;
    if !robot.allows(&start.rates) {
        return Err(invalid(format!(
            "agent {agent} is faster at its start than it can be"
        )));
    }
    let goals = instance.goal_states.get(agent).unwrap_or_default();
    let goal = match goals {
        // It may end anywhere.
        [] => Goal {
            state: start,
            free: Free {
                heading: true,
                rates: [true; 3],
                trailer: true,
            },
            place_m: f64::INFINITY,
            heading_rad: instance.goal_tolerance_rad,
            rate: instance.goal_tolerance_rate,
        },
        [goal] => {
            let (state, free) = robot
                .state(&goal.0)
                .ok_or_else(|| lacking("goal with a place"))?;
            Goal {
                state,
                free,
                place_m: instance.goal_tolerance_m,
                heading_rad: instance.goal_tolerance_rad,
                rate: instance.goal_tolerance_rate,
            }
        }
        _ => {
            let reason = format!("agent {agent} has several goals, this planner plans to one");
            return Err(Failure::new(Status::Unsupported, reason));
        }
    };
    Ok((robot, start, goal))
}

/// The plugin of a [`Method`].
#[derive(Debug)]
pub struct InStates<M>(M);

impl<M: Method> Plugin for InStates<M> {
    fn descriptor() -> Descriptor {
        let common = &[
            Capability::Continuous,
            Capability::Dynamics,
            Capability::Deterministic,
        ];
        let names = (M::ID, M::NAME);
        let known = DYNAMICS.iter().chain(M::MORE_DYNAMICS);
        let features = known
            .map(|name| format!("dynamics:{name}"))
            .chain(M::MORE_FEATURES.iter().map(|&feature| feature.to_owned()));
        Descriptor {
            features: features.collect(),
            ..described::<M>(Kind::Planner, names, M::ABOUT, [common, M::CAPABILITIES])
        }
    }

    fn create(options: Options<'_>) -> Result<Self, Failure> {
        parse(options, M::check).map(Self)
    }
}

impl<M: Method> Planner for InStates<M> {
    type Map = World;

    fn prepare(
        &mut self,
        environment: &SharedEnvironment,
        _: &Budget,
        _: &dyn Sink,
    ) -> Result<World, Failure> {
        world(environment)
    }

    fn plan(
        &mut self,
        world: &mut World,
        instance: &Instance,
        budget: &Budget,
        sink: &dyn Sink,
    ) -> Result<(), Failure> {
        let other = |robot: &&fleetyard_abi::Robot| {
            let name = &&*robot.dynamics;
            CARS.contains(name) && !M::MORE_DYNAMICS.contains(name)
        };
        if let Some(robot) = instance.robots.iter().find(other) {
            let reason = format!("the dynamics `{}` are not planned for", robot.dynamics);
            return Err(Failure::new(Status::Unsupported, reason));
        }
        let team = Team::new(world, instance, self.0.clearance_m())?;
        self.0.solve(&team, &Call::new(budget, sink))
    }
}
