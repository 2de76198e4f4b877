//! The document: a piece of ground, kinds of robots, agents with starts and goals, and the parameters
//! of its views.
//!
//! Its parts are those of world, map and task files, and it is written as such files
//! ([`files`](crate::files)); between page and server it is one JSON object, which
//! `docs/studio-protocol.md` describes. A document that exists is *well-formed*: outlines are polygons,
//! places are within the world, agents are robots of its kinds. It need not be *whole*: robots may
//! overlap or stand in walls, and there may be none ([`Whole`](crate::artefacts::Whole) says why).
//!
//! Documents are values. A copy shares what it is made of, and an edit leaves the parts alone that it
//! does not change.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

use fleetyard_core::json::named;
use fleetyard_core::{Digest, Grid, Hasher, InputError, Role, shown};
use fleetyard_sim::motion::{Fleet, Model, Profile, SingleIntegrator};
use fleetyard_views::{
    Agent, End, Fleets, GridSpec, Place, Positive, Problem, RoadmapParameters, State, Task,
    grid_to_world,
};
use fleetyard_world::{Boundary, Bounds, DYNAMICS_TOLERANCE, Footprint, Mover, Polygon, Workspace};
use serde::de::Deserializer;
use serde::ser::{SerializeMap, Serializer};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::edit::{Refusal, pointer, read};
use crate::files::{ground_file, task_file};

/// Most agents of a document.
pub const MOST_AGENTS: usize = 100_000;

/// Most obstacles of a world.
pub const MOST_OBSTACLES: usize = 100_000;

/// Most corners of all obstacles of a world.
pub const MOST_CORNERS: usize = 1_000_000;

/// Most moving obstacles of a world.
pub const MOST_MOVERS: usize = 1000;

/// Most knots of all moving obstacles of a world.
pub const MOST_KNOTS: usize = 100_000;

/// Most cells of a map, and of a grid that is derived. [`Grid::MAX_CELLS`] are more than a page can
/// show, and each snapshot of a painted map has its own.
pub const MOST_CELLS: u64 = 1 << 24;

/// Most kinds of robots.
pub const MOST_KINDS: usize = 256;

/// Most characters of a name.
pub const MOST_CHARACTERS: usize = 200;

/// Ground, robots and agents as they are edited.
#[derive(Debug, Clone, PartialEq)]
pub struct Document {
    pub(crate) name: String,
    pub(crate) ground: Ground,
    pub(crate) robots: Arc<Vec<(String, Profile)>>,
    pub(crate) agents: Arc<Vec<Agent>>,
    pub(crate) tolerances: Tolerances,
    pub(crate) seed: u64,
    pub(crate) views: Views,
}

/// The floor and what stands and moves on it.
#[derive(Debug, Clone, PartialEq)]
pub enum Ground {
    /// A world in the plane. It has no name of its own.
    World(Arc<Workspace>),
    /// A map of cells, whose lower left corner is at (0, 0).
    Map {
        /// The cells.
        grid: Arc<Grid>,
        /// The side of a cell in metres.
        cell_size_m: f64,
    },
}

/// Distances and angles that plans in the plane may be off; those of [`Task`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tolerances {
    /// Distance from its goal at which a robot may end, in metres.
    pub goal_m: f64,
    /// The same of its heading, in radians.
    pub goal_rad: f64,
    /// The same of each rate.
    pub goal_rate: f64,
    /// Distance by which controls may lead beside knots.
    pub dynamics: f64,
}

impl Tolerances {
    /// Those of a task.
    pub(crate) fn of(task: &Task) -> Self {
        Self {
            goal_m: task.goal_tolerance_m,
            goal_rad: task.goal_tolerance_rad,
            goal_rate: task.goal_tolerance_rate,
            dynamics: task.dynamics_tolerance,
        }
    }
}

impl Default for Tolerances {
    fn default() -> Self {
        Self {
            goal_m: DYNAMICS_TOLERANCE,
            goal_rad: DYNAMICS_TOLERANCE,
            goal_rate: DYNAMICS_TOLERANCE,
            dynamics: Task::BESIDE_KNOTS,
        }
    }
}

/// Parameters of the views that are derived.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Views {
    /// Those of `fleetyard world grid`.
    pub grid: GridSpec,
    /// Those of `fleetyard world roadmap`.
    pub roadmap: RoadmapParameters,
}

impl Default for Document {
    /// An empty room of 10 by 6 metres, and one kind of robots.
    fn default() -> Self {
        let world = Workspace {
            name: String::new(),
            bounds: Bounds {
                min: [0.0, 0.0],
                max: [10.0, 6.0],
            },
            boundary: None,
            obstacles: Vec::new(),
            movers: Vec::new(),
        };
        Self {
            name: "untitled".into(),
            ground: Ground::World(Arc::new(world)),
            robots: Arc::new(vec![Self::disc(0.25)]),
            agents: Arc::default(),
            tolerances: Tolerances::default(),
            seed: 1,
            views: Views::default(),
        }
    }
}

impl Document {
    /// The kind of robots of a document that nobody has described robots for: discs that stop and go.
    pub(crate) fn disc(radius_m: f64) -> (String, Profile) {
        let profile = Profile {
            footprint: Footprint::Disc { radius_m },
            model: Model::SingleIntegrator(SingleIntegrator::default()),
        };
        ("robot".into(), profile)
    }

    /// True if there is nothing in it: a floor without anything on it.
    pub(crate) fn is_blank(&self) -> bool {
        let is_bare = match &self.ground {
            Ground::World(world) => {
                world.obstacles.is_empty() && world.movers.is_empty() && world.boundary.is_none()
            }
            Ground::Map { grid, .. } => grid.terrain().iter().all(|letter| *letter == FREE),
        };
        is_bare && self.agents.is_empty()
    }

    /// Its name; may be empty.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The floor and what stands on it.
    pub fn ground(&self) -> &Ground {
        &self.ground
    }

    /// The kinds of robots with their names, at least one.
    pub fn robots(&self) -> &[(String, Profile)] {
        &self.robots
    }

    /// Start and goal of each robot, whose kind is a number among [`Document::robots`].
    pub fn agents(&self) -> &[Agent] {
        &self.agents
    }

    /// The tolerances of plans.
    pub fn tolerances(&self) -> Tolerances {
        self.tolerances
    }

    /// The seed of everything random that is derived.
    pub fn seed(&self) -> u64 {
        self.seed
    }

    /// The parameters of its views.
    pub fn views(&self) -> Views {
        self.views
    }

    /// Reads the JSON of a document. Refusals name the place in it, below `place`, a JSON pointer.
    pub fn read(document: Value, place: &str) -> Result<Self, Refusal> {
        let Raw {
            name,
            ground,
            robots,
            agents,
            goal_tolerance_m,
            goal_tolerance_rad,
            goal_tolerance_rate,
            dynamics_tolerance,
            seed,
            views,
        } = read(document, place, 0)?;
        let below = |refusal: Refusal| Refusal {
            place: format!("{place}{}", refusal.place),
            ..refusal
        };
        let mut document = Self {
            ground: ground.ground().map_err(below)?,
            robots: Arc::new(robots.0),
            seed,
            ..Self::default()
        };
        document.set_name(name).map_err(below)?;
        document.check_robots().map_err(below)?;
        let known = Tolerances::default();
        let given = |value: Option<Positive>, other: f64| value.map_or(other, |value| value.0);
        document.tolerances = Tolerances {
            goal_m: given(goal_tolerance_m, known.goal_m),
            goal_rad: given(goal_tolerance_rad, known.goal_rad),
            goal_rate: given(goal_tolerance_rate, known.goal_rate),
            dynamics: given(dynamics_tolerance, known.dynamics),
        };
        document.set_views(views).map_err(below)?;
        document.add_agents(agents).map_err(below)?;
        Ok(document)
    }

    pub(crate) fn set_name(&mut self, name: String) -> Result<(), Refusal> {
        check_name(&name, "/name")?;
        self.name = name;
        Ok(())
    }

    pub(crate) fn set_views(&mut self, views: Views) -> Result<(), Refusal> {
        let refuse = |error: InputError| Refusal::at("/views/roadmap", error);
        views.roadmap.spec().check("roadmap").map_err(refuse)?;
        if let Some(speed) = views.roadmap.speed_m_per_s
            && !(speed.is_finite() && speed > 0.0)
        {
            let reason = format!("robots on a roadmap need a speed, not {speed} m/s");
            let hint = "give a speed above 0, or none for the largest that every robot has";
            return Err(Refusal::new("/views/roadmap/speed", reason, hint));
        }
        self.views = views;
        Ok(())
    }

    /// Appends agents, all of them or none.
    pub(crate) fn add_agents(&mut self, agents: Vec<RawAgent>) -> Result<(), Refusal> {
        let first = self.agents.len();
        if first + agents.len() > MOST_AGENTS {
            return Err(too_many(
                "/agents",
                "agents",
                first + agents.len(),
                MOST_AGENTS,
            ));
        }
        let numbered = agents.into_iter().enumerate();
        let agents = numbered.map(|(number, raw)| self.agent(first + number, &raw));
        let agents: Vec<Agent> = agents.collect::<Result<_, _>>()?;
        Arc::make_mut(&mut self.agents).extend(agents);
        Ok(())
    }

    /// The agent of this number as it is to be.
    pub(crate) fn agent(&self, number: usize, raw: &RawAgent) -> Result<Agent, Refusal> {
        let robot = match &raw.robot {
            Some(name) => self.kind(name, &format!("/agents/{number}/robot"))?,
            None if self.robots.len() == 1 => 0,
            None => {
                let reason = "the agent does not say which robot it is";
                let hint = "add robot with the name of a kind";
                return Err(Refusal::new(format!("/agents/{number}"), reason, hint));
            }
        };
        let agent = Agent {
            robot,
            start: raw.start,
            goal: raw.goal,
        };
        check_place(&self.bounds(), number, &agent)?;
        Ok(agent)
    }

    /// The number of a kind of robots.
    pub(crate) fn kind(&self, name: &str, place: &str) -> Result<u32, Refusal> {
        let mut names = self.robots.iter();
        let found = names.position(|(known, _)| known == name);
        found.map(|kind| kind as u32).ok_or_else(|| {
            let reason = format!("{:?} is not one of the robots", shown(name));
            let names = self
                .robots
                .iter()
                .map(|(name, _)| format!("{:?}", shown(name)));
            let names: Vec<String> = names.take(10).collect();
            let hint = format!("name a kind of robots, such as {}", names.join(", "));
            Refusal::new(place, reason, hint)
        })
    }

    /// The box around the ground, in metres.
    pub fn bounds(&self) -> Bounds {
        match &self.ground {
            Ground::World(world) => world.bounds,
            Ground::Map { grid, cell_size_m } => map_bounds(grid, *cell_size_m),
        }
    }

    /// Refuses a ground on which an agent would be outside.
    pub(crate) fn check_places(&self) -> Result<(), Refusal> {
        let bounds = self.bounds();
        let mut agents = self.agents.iter().enumerate();
        agents.try_for_each(|(number, agent)| check_place(&bounds, number, agent))
    }

    pub(crate) fn check_robots(&self) -> Result<(), Refusal> {
        if self.robots.len() > MOST_KINDS {
            let count = self.robots.len();
            return Err(too_many("/robots", "kinds of robots", count, MOST_KINDS));
        }
        for (name, _) in self.robots.iter() {
            check_name(name, &format!("/robots/{}", pointer(name)))?;
        }
        Ok(())
    }

    /// The world of the ground; blocked cells of a map are its obstacles.
    pub fn world(&self) -> Result<Arc<Workspace>, InputError> {
        match &self.ground {
            Ground::World(world) => Ok(Arc::clone(world)),
            Ground::Map { grid, cell_size_m } => {
                let view = grid_to_world(grid, *cell_size_m, [0.0, 0.0])?;
                Ok(Arc::new(view.world))
            }
        }
    }

    /// The problem that planners are given, in a world that is [`Document::world`]. It is one to plan
    /// for if it has an agent and no [`faults`](Problem::faults). Its task names the files that
    /// [`files::write`](crate::files::write) writes.
    pub fn problem(&self, world: &Workspace) -> Result<Problem, InputError> {
        let task = self.task(&ground_file(self));
        let map = match &self.ground {
            Ground::World(_) => None,
            Ground::Map { grid, .. } => Some(Grid::clone(grid)),
        };
        let profiles = self.robots.iter().map(|(_, profile)| profile.clone());
        let kinds = self.agents.iter().map(|agent| agent.robot);
        let fleet = Fleet::new(profiles.collect(), kinds.collect());
        let fleet = fleet.map_err(|error| {
            InputError::new(task.source.as_str(), error.to_string()).hint(error.hint())
        })?;
        Ok(Problem {
            task,
            world: world.clone(),
            map,
            fleet,
        })
    }

    /// The task of the document, whose ground is in a file.
    pub(crate) fn task(&self, file: &str) -> Task {
        let file = file.to_owned();
        Task {
            source: task_file(self),
            name: self.name.clone(),
            place: match &self.ground {
                Ground::World(_) => Place::World(file),
                Ground::Map { cell_size_m, .. } => Place::Map {
                    file,
                    cell_size_m: *cell_size_m,
                },
            },
            fleet: Fleets::Kinds(self.robots.to_vec()),
            agents: self.agents.to_vec(),
            goal_tolerance_m: self.tolerances.goal_m,
            goal_tolerance_rad: self.tolerances.goal_rad,
            goal_tolerance_rate: self.tolerances.goal_rate,
            dynamics_tolerance: self.tolerances.dynamics,
            seed: self.seed,
        }
    }

    /// Digest of its canonical JSON, for documents that make no problem to plan for. The parameters of
    /// views are no part of it, as of no problem: files do not have them.
    pub(crate) fn json_digest(&self) -> Digest {
        let mut document = self.clone();
        document.views = Views::default();
        let mut hasher = Hasher::new("fleetyard.studio-document/1");
        hasher.value(&document);
        hasher.finish()
    }
}

/// The area of a map in metres.
pub(crate) fn map_bounds(grid: &Grid, cell_size_m: f64) -> Bounds {
    Bounds {
        min: [0.0, 0.0],
        max: [grid.cols(), grid.rows()].map(|count| f64::from(count) * cell_size_m),
    }
}

/// Refuses a map that is no piece of ground.
pub(crate) fn check_map(rows: u32, cols: u32, cell_size_m: f64) -> Result<(), Refusal> {
    let cells = u64::from(rows) * u64::from(cols);
    if cells == 0 || cells > MOST_CELLS {
        let reason = format!("a map of {rows} rows and {cols} columns is empty or too large");
        let hint = format!("a map has between 1 and {MOST_CELLS} cells");
        return Err(Refusal::new("/ground/map", reason, hint));
    }
    if f64::from(rows.max(cols)) * cell_size_m > Polygon::MOST_M {
        let reason = format!("a map of {cols} by {rows} cells of {cell_size_m} m is no world");
        let hint = "give the side of a cell in metres, so that the map is at most 1000 km wide";
        return Err(Refusal::new("/ground/map", reason, hint));
    }
    Ok(())
}

/// Refuses a world with more in it than a document may have.
pub(crate) fn check_world(world: &Workspace) -> Result<(), Refusal> {
    let refuse = |key: &str, what: &str, count: usize, most: usize| {
        if count <= most {
            return Ok(());
        }
        Err(too_many(&format!("/ground/world/{key}"), what, count, most))
    };
    let corners = world
        .obstacles
        .iter()
        .map(|polygon| polygon.vertices().len());
    let knots = world.movers.iter().map(|mover| mover.times_s().len());
    refuse(
        "obstacles",
        "obstacles",
        world.obstacles.len(),
        MOST_OBSTACLES,
    )?;
    refuse(
        "obstacles",
        "corners of obstacles",
        corners.sum(),
        MOST_CORNERS,
    )?;
    refuse(
        "movers",
        "moving obstacles",
        world.movers.len(),
        MOST_MOVERS,
    )?;
    refuse(
        "movers",
        "knots of moving obstacles",
        knots.sum(),
        MOST_KNOTS,
    )
}

pub(crate) fn too_many(place: &str, what: &str, count: usize, most: usize) -> Refusal {
    let reason = format!("there are {count} {what}, more than {most}");
    Refusal::new(place, reason, format!("the studio takes {most} at most"))
}

pub(crate) fn check_name(name: &str, place: &str) -> Result<(), Refusal> {
    let reason = if name.chars().nth(MOST_CHARACTERS).is_some() {
        format!("the name {:?} is too long", shown(name))
    } else if name.contains(char::is_control) {
        format!("the name {:?} has a control character", shown(name))
    } else {
        return Ok(());
    };
    let hint = format!("a name has at most {MOST_CHARACTERS} characters, all of which can be seen");
    Err(Refusal::new(place, reason, hint))
}

fn check_place(bounds: &Bounds, number: usize, agent: &Agent) -> Result<(), Refusal> {
    for end in [End::Start, End::Goal] {
        let [x, y] = end.of(agent).at_m();
        if bounds.contains([x, y]) {
            continue;
        }
        let ([left, bottom], [right, top]) = (bounds.min, bounds.max);
        let reason = format!("the {end} of agent {number} at ({x}, {y}) is outside of the world");
        let hint = format!("the world reaches from ({left}, {bottom}) to ({right}, {top})");
        return Err(Refusal::new(
            format!("/agents/{number}/{end}"),
            reason,
            hint,
        ));
    }
    Ok(())
}

/// The kinds of cells that a page paints.
pub(crate) const BLOCKED: u8 = b'@';
pub(crate) const FREE: u8 = b'.';

/// Runs of the cells of a map that are as asked, row by row from the top: first cell and length.
pub(crate) fn runs(grid: &Grid, is_meant: impl Fn(u8) -> bool) -> Vec<u32> {
    let mut at = 0;
    let chunks = grid.terrain().chunk_by(|a, b| is_meant(*a) == is_meant(*b));
    let runs = chunks.filter_map(|run| {
        let first = at;
        at += run.len() as u32;
        is_meant(run[0]).then_some([first, run.len() as u32])
    });
    runs.flatten().collect()
}

/// Cells of runs as ranges. They ascend, do not overlap, and are all on the map of so many cells.
pub(crate) fn ranges(runs: &[u32], cells: u32, place: &str) -> Result<Vec<Range<u32>>, Refusal> {
    let hint = "a run is the first cell and the length, row by row from the top; runs ascend";
    if runs.len() % 2 == 1 {
        let reason = "the last run has no length";
        return Err(Refusal::new(place, reason, hint));
    }
    let mut least = 0;
    let ranges = runs.chunks_exact(2).enumerate().map(|(number, run)| {
        let (first, length) = (run[0], run[1]);
        let end = first.checked_add(length).filter(|end| *end <= cells);
        let end = end.filter(|_| first >= least && length > 0);
        let end = end.ok_or_else(|| {
            let reason = format!("{length} cells from cell {first} are no run here");
            let hint = format!("{hint}, and the map has {cells} cells");
            Refusal::new(format!("{place}/{}", 2 * number), reason, hint)
        })?;
        least = end;
        Ok(first..end)
    });
    ranges.collect()
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a document: a JSON object")]
struct Raw {
    #[serde(default)]
    name: String,
    ground: RawGround,
    robots: RawRobots,
    #[serde(default)]
    agents: Vec<RawAgent>,
    goal_tolerance_m: Option<Positive>,
    goal_tolerance_rad: Option<Positive>,
    goal_tolerance_rate: Option<Positive>,
    dynamics_tolerance: Option<Positive>,
    #[serde(default = "first_seed")]
    seed: u64,
    #[serde(default)]
    views: Views,
}

fn first_seed() -> u64 {
    1
}

struct RawRobots(Vec<(String, Profile)>);

impl<'de> Deserialize<'de> for RawRobots {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        named(deserializer, "robot", "robots").map(Self)
    }
}

/// An agent as the page has it.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(
    deny_unknown_fields,
    expecting = "an agent: an object with robot, start and goal"
)]
pub struct RawAgent {
    /// The name of its kind; may be left out where there is one only.
    pub robot: Option<String>,
    /// Its state at the beginning.
    pub start: State,
    /// Its goal.
    pub goal: State,
}

#[derive(Deserialize)]
#[serde(
    rename_all = "lowercase",
    deny_unknown_fields,
    expecting = "an object with world or map"
)]
enum RawGround {
    World(RawWorld),
    Map(RawMap),
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a world: an object")]
struct RawWorld {
    bounds_m: Option<Bounds>,
    boundary_m: Option<Boundary>,
    #[serde(default)]
    obstacles: Vec<Polygon>,
    #[serde(default)]
    movers: Vec<Mover>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a map: an object")]
struct RawMap {
    rows: u32,
    cols: u32,
    cell_size_m: Positive,
    #[serde(default)]
    blocked: Vec<u32>,
    #[serde(default)]
    workstations: Vec<u32>,
    #[serde(default)]
    endpoints: Vec<u32>,
}

impl RawGround {
    fn ground(self) -> Result<Ground, Refusal> {
        match self {
            Self::World(RawWorld {
                bounds_m,
                boundary_m,
                obstacles,
                movers,
            }) => {
                let world = Workspace::new(String::new(), bounds_m, boundary_m, obstacles, movers);
                let world = world.map_err(|error| Refusal::at("/ground/world", error))?;
                check_world(&world)?;
                Ok(Ground::World(Arc::new(world)))
            }
            Self::Map(map) => map.ground(),
        }
    }
}

impl RawMap {
    fn ground(self) -> Result<Ground, Refusal> {
        let Positive(cell_size_m) = self.cell_size_m;
        check_map(self.rows, self.cols, cell_size_m)?;
        let cells = self.rows * self.cols;
        let mut terrain = vec![FREE; cells as usize];
        for (key, letter, runs) in [
            ("blocked", BLOCKED, &self.blocked),
            (
                "workstations",
                Role::Workstation.letter(),
                &self.workstations,
            ),
            ("endpoints", Role::Endpoint.letter(), &self.endpoints),
        ] {
            let place = format!("/ground/map/{key}");
            for (number, cells) in ranges(runs, cells, &place)?.into_iter().enumerate() {
                let cells = &mut terrain[cells.start as usize..cells.end as usize];
                if cells.iter().any(|known| *known != FREE) {
                    let reason = "cells of the run are something else already";
                    let hint = "name a cell once among blocked, workstations and endpoints";
                    return Err(Refusal::new(
                        format!("{place}/{}", 2 * number),
                        reason,
                        hint,
                    ));
                }
                cells.fill(letter);
            }
        }
        let grid = Grid::new("", self.rows, self.cols, terrain);
        let grid = grid.map_err(|error| Refusal::at("/ground/map", error))?;
        Ok(Ground::Map {
            grid: Arc::new(grid),
            cell_size_m,
        })
    }
}

impl Serialize for Document {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(Serialize)]
        struct Written<'a> {
            name: &'a str,
            ground: &'a Ground,
            robots: WrittenRobots<'a>,
            agents: Vec<WrittenAgent<'a>>,
            goal_tolerance_m: f64,
            goal_tolerance_rad: f64,
            goal_tolerance_rate: f64,
            dynamics_tolerance: f64,
            seed: u64,
            views: Views,
        }
        #[derive(Serialize)]
        struct WrittenAgent<'a> {
            robot: &'a str,
            start: State,
            goal: State,
        }
        struct WrittenRobots<'a>(&'a [(String, Profile)]);
        impl Serialize for WrittenRobots<'_> {
            fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                // In the order of their names, as readers without an order of keys have them.
                let kinds: BTreeMap<&String, &Profile> = self
                    .0
                    .iter()
                    .map(|(name, profile)| (name, profile))
                    .collect();
                kinds.serialize(serializer)
            }
        }
        let agents = self.agents.iter().map(|agent| WrittenAgent {
            robot: &self.robots[agent.robot as usize].0,
            start: agent.start,
            goal: agent.goal,
        });
        Written {
            name: &self.name,
            ground: &self.ground,
            robots: WrittenRobots(&self.robots),
            agents: agents.collect(),
            goal_tolerance_m: self.tolerances.goal_m,
            goal_tolerance_rad: self.tolerances.goal_rad,
            goal_tolerance_rate: self.tolerances.goal_rate,
            dynamics_tolerance: self.tolerances.dynamics,
            seed: self.seed,
            views: self.views,
        }
        .serialize(serializer)
    }
}

impl Serialize for Ground {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(Serialize)]
        struct World<'a> {
            #[serde(skip_serializing_if = "Option::is_none")]
            bounds_m: Option<Bounds>,
            #[serde(skip_serializing_if = "Option::is_none")]
            boundary_m: Option<&'a Boundary>,
            obstacles: &'a [Polygon],
            movers: &'a [Mover],
        }
        #[derive(Serialize)]
        struct Map {
            rows: u32,
            cols: u32,
            cell_size_m: f64,
            blocked: Vec<u32>,
            workstations: Vec<u32>,
            endpoints: Vec<u32>,
        }
        let mut ground = serializer.serialize_map(Some(1))?;
        match self {
            Self::World(world) => {
                let boundary_m = world.boundary.as_ref();
                let world = World {
                    bounds_m: boundary_m.is_none().then_some(world.bounds),
                    boundary_m,
                    obstacles: &world.obstacles,
                    movers: &world.movers,
                };
                ground.serialize_entry("world", &world)?;
            }
            Self::Map { grid, cell_size_m } => {
                let of = |role: Role| runs(grid, |letter| letter == role.letter());
                let map = Map {
                    rows: grid.rows(),
                    cols: grid.cols(),
                    cell_size_m: *cell_size_m,
                    blocked: runs(grid, |letter| !Grid::letter_is_passable(letter)),
                    workstations: of(Role::Workstation),
                    endpoints: of(Role::Endpoint),
                };
                ground.serialize_entry("map", &map)?;
            }
        }
        ground.end()
    }
}
