//! Edits: what changes a document, all of it or nothing.
//!
//! An edit is read from JSON, `{"op": NAME, …}`; `docs/studio-protocol.md` lists the operations with
//! their keys. What cannot be read, and what would make the document malformed, is refused with the
//! place at fault.

use std::collections::BTreeSet;
use std::ops::Range;
use std::sync::Arc;

use fleetyard_core::json::json_error;
use fleetyard_core::{Grid, InputError, Role, shown, words};
use fleetyard_sim::motion::Profile;
use fleetyard_views::{Agent, GridSpec, Positive, Representation, RoadmapParameters, State};
use fleetyard_world::{Boundary, Bounds, Mover, Polygon, Workspace};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::document::{
    BLOCKED, Document, FREE, Ground, MOST_CELLS, RawAgent, Views, check_map, check_name,
    check_world, ranges,
};
use crate::place::{scatter, snap};

/// Most operations of a batch.
pub const MOST_OPERATIONS: usize = 10_000;

/// Most operations of a batch that look for places.
pub const MOST_PLACINGS: usize = 16;

/// The reason why an edit is not made.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, thiserror::Error)]
#[error("{place}: {error}")]
pub struct Refusal {
    /// The reason, in one sentence without a full stop.
    pub error: String,
    /// JSON pointer: into the request where that begins with `/op`, else into the document as it
    /// would be.
    pub place: String,
    /// A way out.
    pub hint: String,
}

impl Refusal {
    pub(crate) fn new(
        place: impl Into<String>,
        error: impl Into<String>,
        hint: impl Into<String>,
    ) -> Self {
        Self {
            error: error.into(),
            place: place.into(),
            hint: hint.into(),
        }
    }

    pub(crate) fn at(place: impl Into<String>, error: InputError) -> Self {
        let hint = error.hint.unwrap_or_else(|| READ_HINT.to_owned());
        Self::new(place, error.reason, hint)
    }
}

const READ_HINT: &str =
    "the section `Document and edits` of docs/studio-protocol.md has operations, keys and bounds";

/// A key of an object as a step of a JSON pointer.
pub(crate) fn pointer(key: &str) -> String {
    key.replace('~', "~0").replace('/', "~1")
}

/// Reads JSON whose place in a request is known. Of the path below it `skip` steps are left out.
pub(crate) fn read<T: DeserializeOwned>(
    value: Value,
    place: &str,
    skip: usize,
) -> Result<T, Refusal> {
    use serde_path_to_error::Segment;
    serde_path_to_error::deserialize(value).map_err(|error| {
        let steps = error.path().iter().skip(skip);
        let steps = steps.map(|step| match step {
            Segment::Seq { index } => format!("/{index}"),
            Segment::Map { key } | Segment::Enum { variant: key } => format!("/{}", pointer(key)),
            Segment::Unknown => String::new(),
        });
        let place = format!("{place}{}", steps.collect::<String>());
        Refusal::at(place, json_error("", b"", error.inner()))
    })
}

/// An edit that was read.
#[derive(Debug, Clone, PartialEq)]
pub struct Edit {
    name: String,
    operation: Operation,
}

/// The colours of the brush.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Paint {
    Free,
    Blocked,
    Workstation,
    Endpoint,
}

words!(Paint {
    Free = "free";
    Blocked = "blocked";
    Workstation = "workstation";
    Endpoint = "endpoint";
});

impl Paint {
    /// The letter of a cell that is painted, if it has to change.
    fn over(self, letter: u8) -> Option<u8> {
        let (is_there, painted) = match self {
            // Cells that are so already keep their letters, of which maps have several.
            Self::Free => {
                let plain =
                    Role::Endpoint.letter() != letter && Role::Workstation.letter() != letter;
                (Grid::letter_is_passable(letter) && plain, FREE)
            }
            Self::Blocked => (!Grid::letter_is_passable(letter), BLOCKED),
            Self::Workstation => (false, Role::Workstation.letter()),
            Self::Endpoint => (false, Role::Endpoint.letter()),
        };
        (!is_there && letter != painted).then_some(painted)
    }
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
enum Operation {
    SetName {
        name: String,
    },
    SetBounds {
        bounds_m: Bounds,
    },
    SetBoundary {
        boundary_m: Boundary,
    },
    AddObstacles {
        obstacles: Vec<Polygon>,
    },
    SetObstacle {
        index: usize,
        obstacle: Polygon,
    },
    RemoveObstacles {
        indices: Vec<usize>,
    },
    AddMover {
        mover: Mover,
    },
    SetMover {
        index: usize,
        mover: Mover,
    },
    RemoveMovers {
        indices: Vec<usize>,
    },
    Paint {
        #[serde(rename = "as")]
        paint: Paint,
        runs: Vec<u32>,
    },
    SetCellSize {
        cell_size_m: Positive,
    },
    ResizeMap {
        rows: u32,
        cols: u32,
    },
    SetRobot {
        name: String,
        profile: Profile,
    },
    RenameRobot {
        name: String,
        to: String,
    },
    RemoveRobot {
        name: String,
    },
    AddAgents {
        agents: Vec<RawAgent>,
    },
    SetAgent {
        index: usize,
        agent: RawAgent,
    },
    SetAgents {
        indices: Vec<usize>,
        agents: Vec<RawAgent>,
    },
    RemoveAgents {
        indices: Vec<usize>,
    },
    Scatter {
        count: u32,
        robot: Option<String>,
        seed: Option<u64>,
        #[serde(default)]
        replace: bool,
    },
    Snap {
        view: Representation,
    },
    SetTolerances {
        goal_tolerance_m: Option<Positive>,
        goal_tolerance_rad: Option<Positive>,
        goal_tolerance_rate: Option<Positive>,
        dynamics_tolerance: Option<Positive>,
    },
    SetSeed {
        seed: u64,
    },
    SetView {
        grid: Option<GridSpec>,
        roadmap: Option<RoadmapParameters>,
    },
    #[serde(skip)]
    Replace(Box<Document>),
    #[serde(skip)]
    Batch(Vec<Edit>),
}

/// Every operation by its name.
const NAMES: &[&str] = &[
    "set-name",
    "set-bounds",
    "set-boundary",
    "add-obstacles",
    "set-obstacle",
    "remove-obstacles",
    "add-mover",
    "set-mover",
    "remove-movers",
    "paint",
    "set-cell-size",
    "resize-map",
    "set-robot",
    "rename-robot",
    "remove-robot",
    "add-agents",
    "set-agent",
    "set-agents",
    "remove-agents",
    "scatter",
    "snap",
    "set-tolerances",
    "set-seed",
    "set-view",
    "replace",
    "batch",
];

impl Edit {
    /// Puts another document in place of what is there, under a name for the history.
    pub fn replace(name: &str, document: Document) -> Self {
        Self {
            name: name.to_owned(),
            operation: Operation::Replace(Box::new(document)),
        }
    }

    /// Gives the document another name.
    pub(crate) fn rename(name: String) -> Self {
        Self {
            name: "set-name".to_owned(),
            operation: Operation::SetName { name },
        }
    }

    /// Reads the operation of a request, `{"op": NAME, …}`. Places in refusals begin with `/op`.
    pub fn read(operation: Value) -> Result<Self, Refusal> {
        Self::read_at(operation, "/op", true)
    }

    /// True if it puts another document in the place of the one that is there.
    pub(crate) fn is_replacement(&self) -> bool {
        match &self.operation {
            Operation::Replace(_) => true,
            Operation::Batch(edits) => edits.iter().any(Self::is_replacement),
            _ => false,
        }
    }

    /// The name for the history: that of the operation, or the one that a batch is given.
    pub fn name(&self) -> &str {
        &self.name
    }

    fn read_at(operation: Value, place: &str, is_outer: bool) -> Result<Self, Refusal> {
        let Value::Object(mut keys) = operation else {
            let reason = "an operation is a JSON object";
            return Err(Refusal::new(place, reason, READ_HINT));
        };
        let name = match keys.remove("op") {
            Some(Value::String(name)) if NAMES.contains(&name.as_str()) => name,
            Some(Value::String(name)) => {
                let reason = format!("there is no operation {:?}", shown(&name));
                let hint = format!("operations are {}", NAMES.join(", "));
                return Err(Refusal::new(format!("{place}/op"), reason, hint));
            }
            _ => {
                let reason = "the operation has no name";
                return Err(Refusal::new(format!("{place}/op"), reason, READ_HINT));
            }
        };
        match name.as_str() {
            "replace" => {
                #[derive(Deserialize)]
                #[serde(deny_unknown_fields)]
                struct Raw {
                    document: Value,
                }
                let Raw { document } = read(keys.into(), place, 0)?;
                let document = Document::read(document, &format!("{place}/document"))?;
                Ok(Self::replace(&name, document))
            }
            "batch" if is_outer => {
                #[derive(Deserialize)]
                #[serde(deny_unknown_fields)]
                struct Raw {
                    name: String,
                    ops: Vec<Value>,
                }
                let Raw { name, ops } = read(keys.into(), place, 0)?;
                check_name(&name, &format!("{place}/name"))?;
                if ops.len() > MOST_OPERATIONS {
                    let count = ops.len();
                    let reason = format!("a batch of {count} operations");
                    let hint = format!("a batch has {MOST_OPERATIONS} at most");
                    return Err(Refusal::new(format!("{place}/ops"), reason, hint));
                }
                let numbered = ops.into_iter().enumerate();
                let edits = numbered.map(|(number, operation)| {
                    Self::read_at(operation, &format!("{place}/ops/{number}"), false)
                });
                let edits: Vec<Self> = edits.collect::<Result<_, _>>()?;
                let places = |edit: &&Self| {
                    let operation = &edit.operation;
                    matches!(
                        operation,
                        Operation::Scatter { .. } | Operation::Snap { .. }
                    )
                };
                let count = edits.iter().filter(places).count();
                if count > MOST_PLACINGS {
                    let reason = format!("a batch that scatters and snaps {count} times");
                    let hint = format!("a batch does so {MOST_PLACINGS} times at most");
                    return Err(Refusal::new(format!("{place}/ops"), reason, hint));
                }
                Ok(Self {
                    name,
                    operation: Operation::Batch(edits),
                })
            }
            "batch" => {
                let reason = "a batch within a batch";
                let hint = "put its operations into the outer one";
                Err(Refusal::new(format!("{place}/op"), reason, hint))
            }
            _ => {
                let tagged = [(name.clone(), Value::Object(keys))].into_iter().collect();
                let operation = read(Value::Object(tagged), place, 1)?;
                Ok(Self { name, operation })
            }
        }
    }
}

impl Document {
    /// The document after an edit. A refusal leaves this one as it is, which nothing changes.
    pub fn edited(&self, edit: &Edit) -> Result<Self, Refusal> {
        let mut document = self.clone();
        document.make(&edit.operation, "/op")?;
        Ok(document)
    }

    fn make(&mut self, operation: &Operation, place: &str) -> Result<(), Refusal> {
        match operation {
            Operation::SetName { name } => self.set_name(name.clone()),
            Operation::SetBounds { bounds_m } => {
                let world = self.world_mut(place)?;
                world.bounds = *bounds_m;
                world.boundary = None;
                self.check_places()
            }
            Operation::SetBoundary { boundary_m } => {
                let world = self.world_mut(place)?;
                world.bounds = boundary_m.polygon().bounds();
                world.boundary = Some(boundary_m.clone());
                self.check_places()
            }
            Operation::AddObstacles { obstacles } => {
                let world = self.world_mut(place)?;
                world.obstacles.extend_from_slice(obstacles);
                check_world(world)
            }
            Operation::SetObstacle { index, obstacle } => {
                let world = self.world_mut(place)?;
                *of(&mut world.obstacles, *index, "obstacle", place)? = obstacle.clone();
                check_world(world)
            }
            Operation::RemoveObstacles { indices } => {
                let world = self.world_mut(place)?;
                remove(&mut world.obstacles, indices, "obstacle", place)
            }
            Operation::AddMover { mover } => {
                let world = self.world_mut(place)?;
                world.movers.push(mover.clone());
                check_world(world)
            }
            Operation::SetMover { index, mover } => {
                let world = self.world_mut(place)?;
                *of(&mut world.movers, *index, "moving obstacle", place)? = mover.clone();
                check_world(world)
            }
            Operation::RemoveMovers { indices } => {
                let world = self.world_mut(place)?;
                remove(&mut world.movers, indices, "moving obstacle", place)
            }
            Operation::Paint { paint, runs } => self.paint(*paint, runs, place),
            Operation::SetCellSize { cell_size_m } => self.set_cell_size(cell_size_m.0, place),
            Operation::ResizeMap { rows, cols } => self.resize_map(*rows, *cols, place),
            Operation::SetRobot { name, profile } => {
                let robots = Arc::make_mut(&mut self.robots);
                match robots.iter_mut().find(|(known, _)| known == name) {
                    Some((_, known)) => *known = profile.clone(),
                    None => robots.push((name.clone(), profile.clone())),
                }
                self.check_robots()
            }
            Operation::RenameRobot { name, to } => {
                let kind = self.kind(name, &format!("{place}/name"))?;
                if name != to && self.robots.iter().any(|(known, _)| known == to) {
                    let reason = format!("the robot {:?} is there already", shown(to));
                    let hint = "give each robot its own name";
                    return Err(Refusal::new(format!("{place}/to"), reason, hint));
                }
                Arc::make_mut(&mut self.robots)[kind as usize]
                    .0
                    .clone_from(to);
                self.check_robots()
            }
            Operation::RemoveRobot { name } => self.remove_robot(name, place),
            Operation::AddAgents { agents } => self.add_agents(agents.clone()),
            Operation::SetAgent { index, agent } => {
                self.set_agents(&[*index], std::slice::from_ref(agent), |_| {
                    format!("{place}/index")
                })
            }
            Operation::SetAgents { indices, agents } => {
                if indices.len() != agents.len() {
                    let (indices, agents) = (indices.len(), agents.len());
                    let reason = format!("{indices} indices, but {agents} agents");
                    let hint = "give an agent for each index";
                    return Err(Refusal::new(format!("{place}/agents"), reason, hint));
                }
                self.set_agents(indices, agents, |at| format!("{place}/indices/{at}"))
            }
            Operation::RemoveAgents { indices } => {
                let agents = Arc::make_mut(&mut self.agents);
                remove(agents, indices, "agent", place)
            }
            Operation::Scatter {
                count,
                robot,
                seed,
                replace,
            } => {
                let kind = match robot {
                    Some(name) => self.kind(name, &format!("{place}/robot"))?,
                    None => 0,
                };
                if *replace {
                    self.agents = Arc::default();
                }
                let seed = seed.unwrap_or(self.seed);
                let agents = scatter(self, *count, kind, seed, place)?;
                Arc::make_mut(&mut self.agents).extend(agents);
                Ok(())
            }
            Operation::Snap { view } => {
                self.agents = Arc::new(snap(self, *view, place)?);
                Ok(())
            }
            Operation::SetTolerances {
                goal_tolerance_m,
                goal_tolerance_rad,
                goal_tolerance_rate,
                dynamics_tolerance,
            } => {
                let known = &mut self.tolerances;
                for (known, given) in [
                    (&mut known.goal_m, goal_tolerance_m),
                    (&mut known.goal_rad, goal_tolerance_rad),
                    (&mut known.goal_rate, goal_tolerance_rate),
                    (&mut known.dynamics, dynamics_tolerance),
                ] {
                    *known = given.map_or(*known, |given| given.0);
                }
                Ok(())
            }
            Operation::SetSeed { seed } => {
                self.seed = *seed;
                Ok(())
            }
            Operation::SetView { grid, roadmap } => self.set_views(Views {
                grid: grid.unwrap_or(self.views.grid),
                roadmap: roadmap.unwrap_or(self.views.roadmap),
            }),
            Operation::Replace(document) => {
                self.clone_from(document);
                Ok(())
            }
            Operation::Batch(edits) => {
                for (number, edit) in edits.iter().enumerate() {
                    let place = format!("{place}/ops/{number}");
                    self.make(&edit.operation, &place).map_err(|refusal| {
                        let error = format!("operation {number}, {}: {}", edit.name, refusal.error);
                        Refusal { error, ..refusal }
                    })?;
                }
                Ok(())
            }
        }
    }

    fn world_mut(&mut self, place: &str) -> Result<&mut Workspace, Refusal> {
        match &mut self.ground {
            Ground::World(world) => Ok(Arc::make_mut(world)),
            Ground::Map { .. } => {
                let reason = "the ground is a map, which has cells and no outlines";
                let hint = "paint its cells, or open a world";
                Err(Refusal::new(format!("{place}/op"), reason, hint))
            }
        }
    }

    fn map_mut(&mut self, place: &str) -> Result<(&mut Arc<Grid>, &mut f64), Refusal> {
        match &mut self.ground {
            Ground::Map { grid, cell_size_m } => Ok((grid, cell_size_m)),
            Ground::World(_) => {
                let reason = "the ground is a world in the plane, which has no cells";
                let hint = "edit its obstacles, or open a map";
                Err(Refusal::new(format!("{place}/op"), reason, hint))
            }
        }
    }

    fn paint(&mut self, paint: Paint, runs: &[u32], place: &str) -> Result<(), Refusal> {
        let (grid, _) = self.map_mut(place)?;
        let cells = ranges(runs, grid.cell_count(), &format!("{place}/runs"))?;
        let map = Arc::make_mut(grid);
        for Range { start, end } in cells {
            let mut first = start;
            while first < end {
                let painted = paint.over(map.terrain()[first as usize]);
                let rest = &map.terrain()[first as usize..end as usize];
                let same = rest
                    .iter()
                    .take_while(|letter| paint.over(**letter) == painted);
                let last = first + same.count() as u32;
                if let Some(letter) = painted {
                    let filled = map.fill(first..last, letter);
                    filled.map_err(|error| Refusal::at(format!("{place}/runs"), error))?;
                }
                first = last;
            }
        }
        Ok(())
    }

    /// Robots stay in their cells.
    fn set_cell_size(&mut self, to_m: f64, place: &str) -> Result<(), Refusal> {
        let (grid, cell_size_m) = self.map_mut(place)?;
        check_map(grid.rows(), grid.cols(), to_m)?;
        let from_m = std::mem::replace(cell_size_m, to_m);
        let bounds = self.bounds();
        let moved = |state: State| State {
            x_m: (state.x_m / from_m * to_m).clamp(bounds.min[0], bounds.max[0]),
            y_m: (state.y_m / from_m * to_m).clamp(bounds.min[1], bounds.max[1]),
            ..state
        };
        for agent in Arc::make_mut(&mut self.agents) {
            (agent.start, agent.goal) = (moved(agent.start), moved(agent.goal));
        }
        Ok(())
    }

    /// Rows come and go at the top and columns at the right, so that nothing moves in the plane.
    fn resize_map(&mut self, rows: u32, cols: u32, place: &str) -> Result<(), Refusal> {
        let (grid, cell_size_m) = self.map_mut(place)?;
        check_map(rows, cols, *cell_size_m)?;
        let (cells, kept) = (
            u64::from(rows) * u64::from(cols),
            cols.min(grid.cols()) as usize,
        );
        debug_assert!(cells <= MOST_CELLS);
        let mut terrain = vec![FREE; cells as usize];
        let old = grid.terrain().chunks(grid.cols() as usize).rev();
        for (new, old) in terrain.chunks_mut(cols as usize).rev().zip(old) {
            new[..kept].copy_from_slice(&old[..kept]);
        }
        let resized = Grid::new(grid.name(), rows, cols, terrain);
        *grid = Arc::new(resized.map_err(|error| Refusal::at(place, error))?);
        self.check_places()
    }

    fn remove_robot(&mut self, name: &str, place: &str) -> Result<(), Refusal> {
        let kind = self.kind(name, &format!("{place}/name"))?;
        let at = || format!("/robots/{}", pointer(name));
        let mut users = self.agents.iter().enumerate();
        let users = users.by_ref().filter(|(_, agent)| agent.robot == kind);
        let users: Vec<usize> = users.map(|(number, _)| number).collect();
        if let Some(first) = users.first() {
            let reason = format!(
                "{:?} is the robot of {} agents, the first of them agent {first}",
                shown(name),
                users.len()
            );
            let hint = "give them another robot, or remove them first";
            return Err(Refusal::new(at(), reason, hint));
        }
        if self.robots.len() == 1 {
            let hint = "add another one first, or describe this one anew";
            return Err(Refusal::new(at(), "this is the only kind of robots", hint));
        }
        Arc::make_mut(&mut self.robots).remove(kind as usize);
        for agent in Arc::make_mut(&mut self.agents) {
            agent.robot -= u32::from(agent.robot > kind);
        }
        Ok(())
    }

    fn set_agents(
        &mut self,
        indices: &[usize],
        agents: &[RawAgent],
        place: impl Fn(usize) -> String,
    ) -> Result<(), Refusal> {
        for (at, (index, raw)) in indices.iter().zip(agents).enumerate() {
            if *index >= self.agents.len() {
                return Err(no_such(*index, self.agents.len(), "agent", place(at)));
            }
            let agent: Agent = self.agent(*index, raw)?;
            Arc::make_mut(&mut self.agents)[*index] = agent;
        }
        Ok(())
    }
}

fn no_such(index: usize, count: usize, what: &str, place: String) -> Refusal {
    let reason = format!("there is no {what} {index}");
    let hint = match count {
        0 => format!("there is no {what} at all"),
        _ => format!("they are numbered from 0 to {}", count - 1),
    };
    Refusal::new(place, reason, hint)
}

/// One of a list.
fn of<'a, T>(
    list: &'a mut [T],
    index: usize,
    what: &str,
    place: &str,
) -> Result<&'a mut T, Refusal> {
    let count = list.len();
    let found = list.get_mut(index);
    found.ok_or_else(|| no_such(index, count, what, format!("{place}/index")))
}

/// Removes some of a list, each named once.
fn remove<T>(list: &mut Vec<T>, indices: &[usize], what: &str, place: &str) -> Result<(), Refusal> {
    let mut gone = BTreeSet::new();
    for (at, index) in indices.iter().enumerate() {
        let place = || format!("{place}/indices/{at}");
        if *index >= list.len() {
            return Err(no_such(*index, list.len(), what, place()));
        }
        if !gone.insert(*index) {
            let reason = format!("the {what} {index} is named twice");
            return Err(Refusal::new(place(), reason, "name each once"));
        }
    }
    let mut number = 0;
    list.retain(|_| {
        number += 1;
        !gone.contains(&(number - 1))
    });
    Ok(())
}
