//! Task files, `fleetyard.task/1`: one JSON object with world or map, robots, starts, goals and seed.
//!
//! ```json
//! {
//!   "format": "fleetyard.task/1",
//!   "name": "two rooms",
//!   "world": "two-rooms.world.json",
//!   "robots": {
//!     "cart": {
//!       "footprint": {"disc": {"radius_m": 0.25}},
//!       "model": {"single-integrator": {"speed_m_per_s": 1.0}}
//!     }
//!   },
//!   "agents": [
//!     {"robot": "cart", "start": [1, 1], "goal": [9, 5]},
//!     {"robot": "cart", "start": [9, 1, 3.14], "goal": [1, 2]}
//!   ],
//!   "goal_tolerance_m": 0.01,
//!   "seed": 1
//! }
//! ```
//!
//! Either `world` names a world file, or `map` a map on a grid whose cells have the side
//! `cell_size_m`; its lower left corner is at (0, 0). Either `robots` has kinds of robots, as
//! profiles of a fleet file, and every agent names its own in `robot`; or `fleet` names a fleet
//! file, which deals its profiles to the agents. Files are named from the folder of the task.
//! Starts and goals are `[x, y]` or `[x, y, heading]`, of a car with a trailer also `[x, y, heading,
//! trailer heading]`; robots rest there. Unknown keys are refused.

use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::path::Path;

use fleetyard_core::json::{
    self, Listed, ReadList, checked, named, push_lines, read_key, read_object, with_hint,
};
use fleetyard_core::{
    Digest, Grid, Hasher, InputError, load_file, load_map, shown, words, write_atomically,
};
use fleetyard_sim::motion::{Fleet, Profile, load_fleet};
use fleetyard_world::{
    Bend, Boundary, Bounds, BoxIndex, DYNAMICS_TOLERANCE, Placement, Polygon, Pose, Shape,
    Workspace, load_workspace, separation_m,
};
use serde::de::{DeserializeSeed, Deserializer, Error as _, IgnoredAny, SeqAccess};
use serde::ser::Serializer;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use crate::Free;

/// The value of `format`.
pub const TASK_FORMAT: &str = "fleetyard.task/1";

/// Largest task file that is read, in bytes.
pub const TASK_FILE_LIMIT: u64 = 1 << 28;

/// Most agents of a task.
const MAX_AGENTS: usize = 1 << 20;

const HINT: &str =
    "a task file is a JSON object with format, world or map, robots or fleet, and agents";

/// Content of a task file.
#[derive(Debug, Clone, PartialEq)]
pub struct Task {
    /// The file, for error messages.
    pub source: String,
    /// A name for output; may be empty.
    pub name: String,
    /// The place: a world or a map.
    pub place: Place,
    /// The robots.
    pub fleet: Fleets,
    /// Start and goal of each robot, at least one.
    pub agents: Vec<Agent>,
    /// Distance from its goal at which a robot may end, in metres; for planners in the plane.
    pub goal_tolerance_m: f64,
    /// The same of its heading, in radians.
    pub goal_tolerance_rad: f64,
    /// The same of each rate, where controls say it.
    pub goal_tolerance_rate: f64,
    /// Distance by which controls may lead beside knots of the same plan, in metres and in radians.
    pub dynamics_tolerance: f64,
    /// Seed of everything random that is derived from the task.
    pub seed: u64,
}

impl Task {
    /// That distance where a task does not say it.
    pub const BESIDE_KNOTS: f64 = 1e-3;
}

/// The world of a task. Files are named from the folder of the task.
#[derive(Debug, Clone, PartialEq)]
pub enum Place {
    /// A world file.
    World(String),
    /// A map on a grid.
    Map {
        /// Its file.
        file: String,
        /// The side of a cell in metres.
        cell_size_m: f64,
    },
}

/// The robots of a task.
#[derive(Debug, Clone, PartialEq)]
pub enum Fleets {
    /// A fleet file.
    File(String),
    /// Kinds with their names, in the order of the file; agents have them by number.
    Kinds(Vec<(String, Profile)>),
}

/// A robot with its start and its goal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Agent {
    /// Number of its kind; 0 where a fleet file deals them.
    pub robot: u32,
    /// Its state at the beginning, at rest.
    pub start: State,
    /// The state in which it is to come to rest.
    pub goal: State,
}

/// A place at which a robot rests.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct State {
    /// x in metres.
    pub x_m: f64,
    /// y in metres.
    pub y_m: f64,
    /// Its heading in radians; any if there is none.
    pub heading_rad: Option<f64>,
    /// Heading of its trailer in radians, if there is one: without it a trailer begins in line with its
    /// car, and ends with any.
    pub trailer_rad: Option<f64>,
}

impl State {
    /// The place, in metres.
    pub fn at_m(self) -> [f64; 2] {
        [self.x_m, self.y_m]
    }

    fn pose(self) -> Pose {
        Pose::new(self.x_m, self.y_m, self.heading_rad.unwrap_or(0.0))
    }
}

/// As task files have it: `[x, y]`, `[x, y, heading]`, or that with the heading of a trailer.
impl Serialize for State {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match (self.heading_rad, self.trailer_rad) {
            (Some(heading), Some(trailer)) => {
                [self.x_m, self.y_m, heading, trailer].serialize(serializer)
            }
            (Some(heading), None) => [self.x_m, self.y_m, heading].serialize(serializer),
            (None, _) => [self.x_m, self.y_m].serialize(serializer),
        }
    }
}

impl<'de> Deserialize<'de> for State {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Listed(Numbers).deserialize(deserializer)
    }
}

/// The numbers of a [`State`].
struct Numbers;

impl<'de> ReadList<'de> for Numbers {
    const EXPECTED: &'static str =
        "a place [x, y] or [x, y, heading], with a trailer [x, y, heading, trailer heading]";
    type Value = State;

    fn read<A: SeqAccess<'de>>(self, mut list: A) -> Result<State, A::Error> {
        let wrong = |count| A::Error::invalid_length(count, &Self::EXPECTED);
        let x_m: f64 = list.next_element()?.ok_or_else(|| wrong(0))?;
        let y_m: f64 = list.next_element()?.ok_or_else(|| wrong(1))?;
        let heading_rad: Option<f64> = list.next_element()?;
        let trailer_rad: Option<f64> = match heading_rad {
            Some(_) => list.next_element()?,
            None => None,
        };
        if trailer_rad.is_some() && list.next_element::<IgnoredAny>()?.is_some() {
            return Err(wrong(5));
        }
        let headings = [heading_rad, trailer_rad].map(Option::unwrap_or_default);
        let numbers = [x_m, y_m, headings[0], headings[1]];
        let most = Polygon::MOST_M;
        if x_m.abs() > most || y_m.abs() > most {
            let reason = format!("[{x_m}, {y_m}] is farther than {most} m from the origin");
            return Err(with_hint(&reason, Some(Polygon::FAR_HINT)));
        }
        if numbers.iter().any(|number| number.abs() > most) {
            let reason = format!("[{x_m}, {y_m}] is turned by more than {most} radians");
            return Err(with_hint(&reason, Some("give a heading in radians")));
        }
        Ok(State {
            x_m: x_m + 0.0,
            y_m: y_m + 0.0,
            heading_rad,
            trailer_rad,
        })
    }
}

/// Reads and parses a task file, but not the files that it names.
pub fn load_task(path: impl AsRef<Path>) -> Result<Task, InputError> {
    load_file(path, TASK_FILE_LIMIT, read_task)
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a task: a JSON object")]
struct Document {
    #[serde(deserialize_with = "format", rename = "format")]
    _format: (),
    #[serde(default)]
    name: String,
    world: Option<String>,
    map: Option<String>,
    cell_size_m: Option<Positive>,
    robots: Option<Kinds>,
    fleet: Option<String>,
    #[serde(rename = "agents")]
    _agents: IgnoredAny,
    goal_tolerance_m: Option<Positive>,
    goal_tolerance_rad: Option<Positive>,
    goal_tolerance_rate: Option<Positive>,
    dynamics_tolerance: Option<Positive>,
    #[serde(default)]
    seed: u64,
}

fn format<'de, D: Deserializer<'de>>(deserializer: D) -> Result<(), D::Error> {
    json::format(deserializer, TASK_FORMAT)
}

/// A length in metres or an angle in radians of a file: between 1e-6 and 1e6.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Positive(pub f64);

impl<'de> Deserialize<'de> for Positive {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let value = f64::deserialize(deserializer)?;
        if value >= Polygon::MOST_M.recip() && value <= Polygon::MOST_M {
            return Ok(Self(value));
        }
        let hint = "give metres or radians between 1e-6 and 1e6";
        Err(with_hint(&format!("{value} is no size"), Some(hint)))
    }
}

/// Kinds of robots by name, in the order of the file.
struct Kinds(Vec<(String, Profile)>);

impl<'de> Deserialize<'de> for Kinds {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        named(deserializer, "robot", "robots").map(Self)
    }
}

/// Parses the content of a task file. Errors name `source`.
pub fn read_task(source: &str, bytes: &[u8]) -> Result<Task, InputError> {
    let hinted = |error: InputError| error.or_hint(HINT);
    let one_of = |reason: &str, hint: &str| Err(InputError::new(source, reason).hint(hint));
    let document: Document = read_object(source, bytes, HINT).map_err(hinted)?;
    let place = match (document.world, document.map, document.cell_size_m) {
        (Some(world), None, None) => Place::World(world),
        (None, Some(file), Some(Positive(cell_size_m))) => Place::Map { file, cell_size_m },
        (None, Some(_), None) => {
            return one_of(
                "a map has no size without cell_size_m",
                "add cell_size_m, the side of a cell in metres",
            );
        }
        (Some(_), None, Some(_)) => {
            return one_of(
                "a world has no cells",
                "leave out cell_size_m, or name a map",
            );
        }
        (world, ..) => {
            let both = world.is_some();
            let reason = if both {
                "there are both world and map"
            } else {
                "there are neither world nor map"
            };
            return one_of(
                reason,
                "name a world file with world, or a map with map and cell_size_m",
            );
        }
    };
    let fleet = match (document.robots, document.fleet) {
        (Some(Kinds(kinds)), None) => Fleets::Kinds(kinds),
        (None, Some(file)) => Fleets::File(file),
        (robots, _) => {
            let reason = if robots.is_some() {
                "there are both robots and fleet"
            } else {
                "there are neither robots nor fleet"
            };
            return one_of(
                reason,
                "describe the kinds in robots, or name a fleet file with fleet",
            );
        }
    };
    // Names can only be resolved when all kinds are known, and an unknown one is refused at
    // its place: so the agents are read in a second pass.
    let agents = read_key(source, bytes, "agents", Listed(AgentList(&fleet))).map_err(hinted)?;
    let tolerance = |given: Option<Positive>| given.map_or(DYNAMICS_TOLERANCE, |value| value.0);
    Ok(Task {
        source: source.to_owned(),
        name: document.name,
        place,
        fleet,
        agents,
        goal_tolerance_m: tolerance(document.goal_tolerance_m),
        goal_tolerance_rad: tolerance(document.goal_tolerance_rad),
        goal_tolerance_rate: tolerance(document.goal_tolerance_rate),
        dynamics_tolerance: document
            .dynamics_tolerance
            .map_or(Task::BESIDE_KNOTS, |value| value.0),
        seed: document.seed,
    })
}

struct AgentList<'a>(&'a Fleets);

impl<'de> ReadList<'de> for AgentList<'_> {
    const EXPECTED: &'static str = "a list of agents";
    type Value = Vec<Agent>;

    fn read<A: SeqAccess<'de>>(self, mut list: A) -> Result<Vec<Agent>, A::Error> {
        let mut agents = Vec::new();
        while let Some(agent) = list.next_element_seed(AgentEntry(self.0))? {
            agents.push(agent);
            if agents.len() > MAX_AGENTS {
                return Err(A::Error::custom(format!("more than {MAX_AGENTS} agents")));
            }
        }
        if agents.is_empty() {
            let hint = "give each a start and a goal";
            return Err(with_hint(&"there are no agents", Some(hint)));
        }
        Ok(agents)
    }
}

struct AgentEntry<'a>(&'a Fleets);

impl<'de> DeserializeSeed<'de> for AgentEntry<'_> {
    type Value = Agent;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Agent, D::Error> {
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Raw {
            robot: Option<String>,
            start: State,
            goal: State,
        }
        let expected = "an agent: an object with robot, start and goal";
        checked(deserializer, expected, |Raw { robot, start, goal }| {
            let robot = match (self.0, robot) {
                (Fleets::File(_), None) => Ok(0),
                (Fleets::File(_), Some(_)) => Err((
                    "the agent names a robot, but the fleet file deals them".to_owned(),
                    "leave out robot, or use robots in place of fleet",
                )),
                (Fleets::Kinds(kinds), Some(name)) => {
                    let found = kinds.iter().position(|(known, _)| *known == name);
                    found.map(|at| at as u32).ok_or_else(|| {
                        let reason = format!("{:?} is not one of the robots", shown(&name));
                        (reason, "name a kind of robots")
                    })
                }
                (Fleets::Kinds(kinds), None) if kinds.len() == 1 => Ok(0),
                (Fleets::Kinds(_), None) => Err((
                    "the agent does not say which robot it is".to_owned(),
                    "add robot with the name of a kind",
                )),
            };
            let robot = robot.map_err(|(reason, hint)| with_hint(&reason, Some(hint)))?;
            Ok(Agent { robot, start, goal })
        })
    }
}

/// The content of a task file, one agent per line.
pub fn write_task(task: &Task) -> Vec<u8> {
    let mut lines = vec![format!("\"format\": \"{TASK_FORMAT}\"")];
    let mut key = |key: &str, value: Value| lines.push(format!("\"{key}\": {value}"));
    if !task.name.is_empty() {
        key("name", json!(task.name));
    }
    match &task.place {
        Place::World(file) => key("world", json!(file)),
        Place::Map { file, cell_size_m } => {
            key("map", json!(file));
            key("cell_size_m", json!(cell_size_m));
        }
    }
    for (name, tolerance) in [
        ("goal_tolerance_m", task.goal_tolerance_m),
        ("goal_tolerance_rad", task.goal_tolerance_rad),
        ("goal_tolerance_rate", task.goal_tolerance_rate),
    ] {
        if tolerance != DYNAMICS_TOLERANCE {
            key(name, json!(tolerance));
        }
    }
    if task.dynamics_tolerance != Task::BESIDE_KNOTS {
        key("dynamics_tolerance", json!(task.dynamics_tolerance));
    }
    key("seed", json!(task.seed));
    let kinds = match &task.fleet {
        Fleets::File(file) => {
            key("fleet", json!(file));
            None
        }
        Fleets::Kinds(kinds) => {
            let entries = kinds
                .iter()
                .map(|(name, profile)| format!("    {}: {}", json!(name), json!(profile)));
            let entries: Vec<String> = entries.collect();
            lines.push(format!("\"robots\": {{\n{}\n  }}", entries.join(",\n")));
            Some(kinds)
        }
    };
    let mut text = format!("{{\n  {},\n", lines.join(",\n  "));
    push_lines(&mut text, "agents", &task.agents, |text, agent| {
        let robot = kinds.map(|kinds| json!(kinds[agent.robot as usize].0));
        let robot = robot.map(|robot| format!("\"robot\": {robot}, "));
        let (start, goal) = (json!(agent.start), json!(agent.goal));
        let robot = robot.unwrap_or_default();
        let _ = write!(text, "{{{robot}\"start\": {start}, \"goal\": {goal}}}");
    });
    text.push_str("\n}\n");
    text.into_bytes()
}

impl Task {
    /// The task's own name, or else that of its file without `.task.json`.
    pub fn title(&self) -> &str {
        if !self.name.is_empty() {
            return &self.name;
        }
        let file = self.source.rsplit('/').next().unwrap_or_default();
        let short = file.strip_suffix(".json").unwrap_or(file);
        short.strip_suffix(".task").unwrap_or(short)
    }
}

/// Writes a task file.
pub fn save_task(task: &Task, path: impl AsRef<Path>) -> Result<(), InputError> {
    write_atomically(path.as_ref(), &write_task(task))
}

/// A task with everything that it names: the workspace view, from which the others are derived.
#[derive(Debug, Clone)]
pub struct Problem {
    /// The task.
    pub task: Task,
    /// Bounds, obstacles and movers.
    pub world: Workspace,
    /// The map, where the task has one; its cells have the side that the task says.
    pub map: Option<Grid>,
    /// The robots, one per agent.
    pub fleet: Fleet,
}

/// Reads a task file and the files that it names, and checks that every robot is free at its
/// start and at its goal.
pub fn load_problem(path: impl AsRef<Path>) -> Result<Problem, InputError> {
    let path = path.as_ref();
    let task = load_task(path)?;
    let folder = path.parent().unwrap_or(Path::new("."));
    let (world, map) = match &task.place {
        Place::World(file) => (load_workspace(folder.join(file))?, None),
        Place::Map { file, cell_size_m } => {
            let map = load_map(folder.join(file))?;
            (
                crate::grid_to_world(&map, *cell_size_m, [0.0, 0.0])?.world,
                Some(map),
            )
        }
    };
    let fleet = match &task.fleet {
        Fleets::File(file) => load_fleet(folder.join(file))?.fleet(task.agents.len()),
        Fleets::Kinds(kinds) => Fleet::new(
            kinds.iter().map(|(_, profile)| profile.clone()).collect(),
            task.agents.iter().map(|agent| agent.robot).collect(),
        ),
    };
    let fleet = fleet.map_err(|error| {
        InputError::new(task.source.as_str(), error.to_string()).hint(error.hint())
    })?;
    let problem = Problem {
        task,
        world,
        map,
        fleet,
    };
    problem.check()?;
    Ok(problem)
}

impl Task {
    /// The files that the task names: its world or its map, and its fleet, from the folder of the task.
    pub fn files(&self) -> impl Iterator<Item = &str> {
        let place = match &self.place {
            Place::World(file) | Place::Map { file, .. } => file.as_str(),
        };
        let fleet = match &self.fleet {
            Fleets::File(file) => Some(file.as_str()),
            Fleets::Kinds(_) => None,
        };
        [place].into_iter().chain(fleet)
    }
}

impl Problem {
    /// The same with its first agents alone, each the robot that it was; with all of them where it has no
    /// more.
    #[must_use]
    pub fn first(mut self, agents: usize) -> Self {
        self.task.agents.truncate(agents);
        self.fleet = self.fleet.first(agents);
        self
    }

    /// An agent's shape.
    pub fn shape(&self, agent: usize) -> &Shape {
        &self.fleet.shapes()[self.fleet.profile_of()[agent] as usize]
    }

    /// Heading of every agent at its start, where the task gives one.
    pub fn start_headings(&self) -> Vec<Option<f64>> {
        let agents = self.task.agents.iter();
        agents.map(|agent| agent.start.heading_rad).collect()
    }

    /// Heading of every trailer at its start, where the task gives one.
    pub fn trailer_headings(&self) -> Vec<Option<f64>> {
        let agents = self.task.agents.iter();
        agents.map(|agent| agent.start.trailer_rad).collect()
    }

    /// r_com, the largest effective radius of the agents, in metres; of a car with a trailer, that of the
    /// disc about the car that holds both.
    pub fn common_radius_m(&self) -> f64 {
        let agents = 0..self.task.agents.len();
        let reaches = agents.map(|agent| self.fleet.reach_m(agent));
        reaches.fold(0.0, f64::max)
    }

    /// Digest of everything that planners can see: names and the kind of file are no part of it.
    pub fn digest(&self) -> Digest {
        let mut hasher = Hasher::new("fleetyard.problem/1");
        let world = self.world.digest().0;
        hasher.u64(world as u64);
        hasher.u64((world >> 64) as u64);
        hasher.u64(self.task.agents.len() as u64);
        for (agent, kind) in self.task.agents.iter().zip(self.fleet.profile_of()) {
            hasher.value(&self.fleet.profiles()[*kind as usize]);
            hasher.value(&[agent.start, agent.goal]);
        }
        hasher.f64(self.task.goal_tolerance_m);
        hasher.f64(self.task.goal_tolerance_rad);
        let of_controls = [self.task.goal_tolerance_rate, self.task.dynamics_tolerance];
        if of_controls != [DYNAMICS_TOLERANCE, Task::BESIDE_KNOTS] {
            for tolerance in of_controls {
                hasher.f64(tolerance);
            }
        }
        hasher.finish()
    }

    /// Refuses starts and goals at which a robot is not free, or two robots are in each other.
    fn check(&self) -> Result<(), InputError> {
        let fault = self.faults(1).into_iter().next();
        fault.map_or(Ok(()), |Fault { reason, hint, .. }| {
            Err(InputError::new(self.task.source.as_str(), reason).hint(hint))
        })
    }

    /// The starts and goals at which a robot is not free, by agents, and then those at which two robots
    /// are in each other, by pairs: at most `limit`. Without any the problem is one that
    /// [`load_problem`] takes, if it has an agent.
    pub fn faults(&self, limit: usize) -> Vec<Fault> {
        let free = Free::new(&self.world);
        let solid = Solid::new(&self.world);
        let mut faults = Vec::new();
        for (number, agent) in self.task.agents.iter().enumerate() {
            for (end, state) in [(End::Start, agent.start), (End::Goal, agent.goal)] {
                if faults.len() >= limit {
                    return faults;
                }
                let shape = self.shape(number);
                let [x, y] = state.at_m();
                if free.holds([x, y], shape.effective_radius_m()) {
                    continue;
                }
                let depth = solid.depth_m(shape, state.pose());
                let reason = if !free.is_inside([x, y]) {
                    "outside of the free space".to_owned()
                } else if depth > FORGIVEN_M {
                    format!("{depth:.4} m inside an obstacle or the edge")
                } else {
                    continue;
                };
                faults.push(Fault {
                    end,
                    agents: vec![number],
                    reason: format!("the {end} of agent {number} at ({x}, {y}) is {reason}"),
                    hint: "move it, or give the agent a smaller footprint",
                });
            }
        }
        self.find_trailer_faults(&solid, limit, &mut faults);
        for end in [End::Start, End::Goal] {
            let states = self.task.agents.iter().map(|agent| end.of(agent));
            let room = limit.saturating_sub(faults.len());
            let found = self.overlaps(&states.collect::<Vec<_>>(), end, room);
            faults.extend(found.into_iter().map(|(first, second, depth)| Fault {
                end,
                agents: vec![first, second],
                reason: format!(
                    "the {end}s of agents {first} and {second} overlap by {depth:.4} m"
                ),
                hint: "move one of them",
            }));
        }
        faults
    }

    /// Bodies of an agent at a place: its own, and that of its trailer, where it is known how that stands.
    fn bodies(&self, agent: usize, state: State, end: End) -> Vec<(&Shape, Pose)> {
        let mut bodies = vec![(self.shape(agent), state.pose())];
        if let Some((trailer, shape)) = self.fleet.trailer(agent) {
            let in_line = (end == End::Start).then(|| state.pose().heading);
            let heading = state.trailer_rad.or(in_line);
            bodies.extend(heading.map(|heading| (shape, trailer.pose(state.at_m(), heading))));
        }
        bodies
    }

    /// Adds headings of trailers that there are not, joints that are bent too far, and trailers that are
    /// not free.
    fn find_trailer_faults(&self, solid: &Solid<'_>, limit: usize, faults: &mut Vec<Fault>) {
        for (number, agent) in self.task.agents.iter().enumerate() {
            for end in [End::Start, End::Goal] {
                if faults.len() >= limit {
                    return;
                }
                let found = self.trailer_fault(solid, number, end.of(agent), end);
                faults.extend(found.map(|(reason, hint)| Fault {
                    end,
                    agents: vec![number],
                    reason: format!("the {end} of agent {number} {reason}"),
                    hint,
                }));
            }
        }
    }

    fn trailer_fault(
        &self,
        solid: &Solid<'_>,
        agent: usize,
        state: State,
        end: End,
    ) -> Option<(String, &'static str)> {
        let Some((trailer, _)) = self.fleet.trailer(agent) else {
            let reason = "has four numbers, but its robot tows no trailer".to_owned();
            let hint = "give [x, y] or [x, y, heading]";
            return state.trailer_rad.map(|_| (reason, hint));
        };
        if let (Some(heading), Some(behind)) = (state.heading_rad, state.trailer_rad) {
            let turn = heading - behind;
            let bend = Bend {
                time_s: 0.0,
                place_m: state.at_m(),
                joint_rad: turn - TAU * (turn / TAU).round(),
            };
            if trailer.is_beyond(&bend) {
                let (joint, most) = (bend.joint_rad.abs(), trailer.max_joint_rad);
                let reason = format!(
                    "bends the joint to its trailer by {joint:.4} rad, more than {most} rad"
                );
                return Some((reason, "turn the trailer nearer to the car's heading"));
            }
        }
        let bodies = self.bodies(agent, state, end);
        let depths = bodies[1..]
            .iter()
            .map(|(shape, pose)| solid.depth_m(shape, *pose));
        let depth = depths.fold(0.0, f64::max);
        (depth > FORGIVEN_M).then(|| {
            let reason = format!("has its trailer {depth:.4} m inside an obstacle or the edge");
            (reason, "move it, or turn the trailer")
        })
    }

    /// The first pairs of robots that overlap when all are at these places, and by how much.
    fn overlaps(&self, states: &[State], end: End, limit: usize) -> Vec<(usize, usize, f64)> {
        let bodies = |agent: usize| self.bodies(agent, states[agent], end);
        let around = |agent: usize| {
            let boxes = bodies(agent)
                .into_iter()
                .map(|(shape, pose)| shape.bounds(pose));
            let both = boxes.reduce(|one, other| Bounds {
                min: [0, 1].map(|axis: usize| one.min[axis].min(other.min[axis])),
                max: [0, 1].map(|axis: usize| one.max[axis].max(other.max[axis])),
            });
            both.unwrap_or_else(|| self.shape(agent).bounds(states[agent].pose()))
        };
        let boxes: Vec<Bounds> = (0..states.len()).map(around).collect();
        let index = BoxIndex::new(boxes.clone());
        let (mut found, mut near) = (Vec::new(), Vec::new());
        for (first, own) in boxes.iter().enumerate() {
            near.clear();
            index.near(*own, &mut near);
            let others = near.iter().map(|other| *other as usize);
            for second in others.filter(|other| *other > first) {
                if found.len() >= limit {
                    return found;
                }
                let (own, others) = (bodies(first), bodies(second));
                let pairs = own
                    .iter()
                    .flat_map(|own| others.iter().map(move |other| (own, other)));
                let depths =
                    pairs.map(|(own, other)| -separation_m(own.0, own.1, other.0, other.1));
                let depth = depths.fold(f64::NEG_INFINITY, f64::max);
                if depth > FORGIVEN_M {
                    found.push((first, second, depth));
                }
            }
        }
        found
    }
}

/// A reason for which a problem is none that planners are given.
#[derive(Debug, Clone, PartialEq)]
pub struct Fault {
    /// The places at fault are starts or goals.
    pub end: End,
    /// The agents at fault, ascending.
    pub agents: Vec<usize>,
    /// The reason, in one sentence without a full stop.
    pub reason: String,
    /// A way out.
    pub hint: &'static str,
}

/// One of the two places of an agent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum End {
    /// The one at the beginning.
    Start,
    /// The one at which it is to come to rest.
    Goal,
}

words!(End {
    Start = "start";
    Goal = "goal";
});

impl End {
    /// This place of an agent.
    pub fn of(self, agent: &Agent) -> State {
        match self {
            Self::Start => agent.start,
            Self::Goal => agent.goal,
        }
    }
}

/// Things that a robot can be in: obstacles by place, and the edge of the world.
struct Solid<'a> {
    world: &'a Workspace,
    index: BoxIndex,
}

impl<'a> Solid<'a> {
    fn new(world: &'a Workspace) -> Self {
        let boxes = world.obstacles.iter().map(Polygon::bounds).collect();
        let index = BoxIndex::new(boxes);
        Self { world, index }
    }

    /// Depth of a shape in an obstacle or beyond the edge of the world, in metres.
    fn depth_m(&self, shape: &Shape, pose: Pose) -> f64 {
        let at = Placement::from(pose);
        let mut near = Vec::new();
        self.index.near(shape.bounds(pose), &mut near);
        let obstacles = near
            .iter()
            .map(|number| &self.world.obstacles[*number as usize]);
        let solid = obstacles.flat_map(Polygon::parts);
        let edge = self.world.boundary.iter().flat_map(Boundary::outside);
        let into = solid
            .chain(edge)
            .map(|(pose, part)| -separation_m(shape, at, part, Placement::from(*pose)))
            .fold(0.0, f64::max);
        let reach = |axis: usize, sign: f64| {
            if shape.is_disc() {
                return shape.effective_radius_m();
            }
            let here = [pose.x, pose.y][axis];
            let corners = shape.corners(pose);
            let corners = corners.map(|corner| sign * (corner[axis] - here));
            corners.fold(0.0, f64::max)
        };
        let (bounds, point) = (self.world.bounds, [pose.x, pose.y]);
        let over = [0, 1].map(|axis| {
            let low = bounds.min[axis] - (point[axis] - reach(axis, -1.0));
            let high = point[axis] + reach(axis, 1.0) - bounds.max[axis];
            low.max(high)
        });
        into.max(over[0]).max(over[1])
    }
}

/// An overlap that is no contact, in metres.
const FORGIVEN_M: f64 = 1e-6;
