//! Probes: instances of the fuzzer as data, which can be drawn, made smaller, written and asked again.

use std::collections::BTreeSet;
use std::fmt;

use fleetyard_abi::{FleetStatus, Kind, Motion};
use fleetyard_core::{Connectivity, Grid, GridPlan, Roadmap};
use fleetyard_world::Workspace;
use serde::{Deserialize, Serialize};

use super::seconds;
use crate::judge;
use crate::question::Question;
use crate::rules::Arrival;
use crate::scene::roadmap::RoadmapScene;
use crate::scene::robots::DYNAMICS;
use crate::scene::workspace::WorkspaceScene;
use crate::scene::{Demand, HEADINGS, Scene};
use crate::stop::{Step, Stop};
use crate::trial::Expectation;

/// The form in which a plugin sees a map and agents.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum View {
    /// Cells.
    Grid,
    /// Cells, and agents that turn.
    Turning,
    /// Cells, and one agent that goes in straight lines.
    Straight,
    /// A vertex for every cell, edges at full speed.
    RoadmapStopGo,
    /// A vertex for every cell, edges at full speed or slower.
    RoadmapSlower,
    /// The floor of the free cells.
    Plane,
    /// No map: the status of a fleet.
    Status,
}

impl fmt::Display for View {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Grid => "grid",
            Self::Turning => "turning",
            Self::Straight => "straight",
            Self::RoadmapStopGo => "roadmap-stop-go",
            Self::RoadmapSlower => "roadmap-slower",
            Self::Plane => "plane",
            Self::Status => "status",
        })
    }
}

/// A map, and the calls that are made about it one after the other.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Probe {
    /// The seed that it was drawn from, and that the plugin gets.
    pub seed: u64,
    /// The form in which the plugin sees it.
    pub view: View,
    /// Rows of the map: `.` is free, `@` blocked.
    pub map: Vec<String>,
    /// True if agents may move diagonally.
    #[serde(default, skip_serializing_if = "is_default")]
    pub eight: bool,
    /// Moves that the map forbids besides, each from a cell to a neighbour.
    #[serde(default, skip_serializing_if = "is_default")]
    pub closed: Vec<[u32; 2]>,
    /// Distance of each vertex of a roadmap from the middle of its cell, in metres; empty for none.
    #[serde(default, skip_serializing_if = "is_default")]
    pub beside_m: Vec<[f64; 2]>,
    /// Dynamics of robots in the plane, unless they move in any way.
    #[serde(default, skip_serializing_if = "is_default")]
    pub dynamics: Option<String>,
    /// Radius of each agent's disc in metres, where they differ.
    #[serde(default, skip_serializing_if = "is_default")]
    pub radii_m: Vec<f64>,
    /// True if it is asked twice, of two processes, and the answers have to be the same.
    #[serde(default, skip_serializing_if = "is_default")]
    pub twice: bool,
    /// The calls, at least one, all of the same number of agents.
    pub calls: Vec<Call>,
}

/// A call of a probe.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Call {
    /// The agents, at least one.
    pub agents: Vec<Member>,
    /// Budget in nanoseconds of a first `prepare`, which may fail; another one with time enough follows.
    #[serde(default, skip_serializing_if = "is_default")]
    pub prepare_ns: Option<u64>,
    /// Budget of the call in nanoseconds, where it is not the usual one.
    #[serde(default, skip_serializing_if = "is_default")]
    pub wall_ns: Option<u64>,
    /// Most nodes of the search; 0 for no limit.
    #[serde(default, skip_serializing_if = "is_default")]
    pub nodes: u64,
    /// Threads that are allowed besides the first.
    #[serde(default, skip_serializing_if = "is_default")]
    pub more_threads: u32,
    /// Number of steps that have to be free of collisions; 0 for all.
    #[serde(default, skip_serializing_if = "is_default")]
    pub window: u32,
    /// Steps of the plan before that are made first; agents then stand where it led.
    #[serde(default, skip_serializing_if = "is_default")]
    pub after: u32,
    /// The work of a fleet, for instance generators.
    #[serde(default, skip_serializing_if = "is_default")]
    pub work: Work,
    /// The fleet's status but for what agents have still to do, for invocation policies: time, time since the
    /// last call, limit of the planner, and time of an action, in seconds.
    #[serde(default, skip_serializing_if = "is_default")]
    pub times_s: Option<[f64; 4]>,
}

/// The work of a fleet.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Work {
    /// Some agents have goals, and there are tasks.
    #[default]
    Some,
    /// No goals, no tasks.
    Nothing,
    /// Everybody has a goal, and there are no tasks.
    Everything,
}

/// An agent of a call.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Member {
    /// The cell in which it is.
    pub start: u32,
    /// Cells that it has to visit in order, none for one without a goal.
    pub goals: Vec<u32>,
    /// Its heading as a number from 0: east, south, west, north.
    #[serde(default, skip_serializing_if = "is_default")]
    pub heading: u8,
    /// Its part of a plan that the fuzzer knows; empty where it knows none.
    #[serde(default, skip_serializing_if = "is_default")]
    pub known: Vec<u32>,
    /// Its part of the plan that a planner left, for fail policies; empty for all where it left none.
    #[serde(default, skip_serializing_if = "is_default")]
    pub failed: Vec<u32>,
    /// Actions that it has still to do, for invocation policies.
    #[serde(default, skip_serializing_if = "is_default")]
    pub actions_left: u32,
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

/// Size of an instance, for reports.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Size {
    /// Instances that are asked in one process, the one that fails is the last.
    pub instances: usize,
    /// Calls of all of them.
    pub calls: usize,
    /// Agents of the last.
    pub agents: usize,
    /// Rows of the map of the last.
    pub rows: usize,
    /// Columns of it.
    pub cols: usize,
    /// Blocked cells of it.
    pub blocked: usize,
}

impl Size {
    /// The size of instances that are asked one after the other.
    pub(crate) fn of(probes: &[Probe]) -> Self {
        let last = probes.last();
        Self {
            instances: probes.len(),
            calls: probes.iter().map(|probe| probe.calls.len()).sum(),
            agents: last.map_or(0, Probe::agents),
            rows: last.map_or(0, |probe| probe.map.len()),
            cols: last.map_or(0, |probe| probe.cols() as usize),
            blocked: last.map_or(0, |probe| probe.blocked().len()),
        }
    }
}

impl fmt::Display for Size {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let some = |number: usize, of: &str| {
            let end = if number == 1 { "" } else { "s" };
            format!("{number} {of}{end}")
        };
        if self.instances > 1 {
            write!(f, "{}, ", some(self.instances, "instance"))?;
        }
        write!(
            f,
            "{}, {}",
            some(self.calls, "call"),
            some(self.agents, "agent")
        )?;
        if self.rows == 0 {
            return Ok(());
        }
        write!(
            f,
            ", {} × {} cells, {} blocked",
            self.rows, self.cols, self.blocked
        )
    }
}

impl Probe {
    /// A probe without a map and without calls.
    pub(crate) fn new(seed: u64, view: View) -> Self {
        Self {
            seed,
            view,
            map: Vec::new(),
            eight: false,
            closed: Vec::new(),
            beside_m: Vec::new(),
            dynamics: None,
            radii_m: Vec::new(),
            twice: false,
            calls: Vec::new(),
        }
    }

    /// Agents of every call.
    pub fn agents(&self) -> usize {
        self.calls.first().map_or(0, |call| call.agents.len())
    }

    pub(crate) fn rows(&self) -> u32 {
        self.map.len() as u32
    }

    pub(crate) fn cols(&self) -> u32 {
        self.map.first().map_or(0, |row| row.len() as u32)
    }

    /// Blocked cells, in order.
    pub(crate) fn blocked(&self) -> Vec<u32> {
        let letters = self.map.iter().flat_map(|row| row.bytes());
        let cells = letters.zip(0..).filter(|(letter, _)| *letter != b'.');
        cells.map(|(_, cell)| cell).collect()
    }

    /// The moves that agents may make.
    pub fn connectivity(&self) -> Connectivity {
        if self.eight {
            Connectivity::Eight
        } else {
            Connectivity::Four
        }
    }

    /// True if the answer may depend on how fast this machine is: a budget is short.
    pub fn is_hurried(&self) -> bool {
        let mut calls = self.calls.iter();
        calls.any(|call| call.wall_ns.is_some() || call.prepare_ns.is_some())
    }

    /// The map.
    pub fn grid(&self) -> Result<Grid, String> {
        let terrain = self.map.concat().into_bytes();
        let name = format!("fuzz {}", self.seed);
        let grid = Grid::new(name, self.rows(), self.cols(), terrain);
        let grid = grid.map_err(|error| error.to_string())?;
        if self.closed.is_empty() {
            return Ok(grid);
        }
        let mut masks = grid.move_masks(Connectivity::Eight);
        for [from, to] in &self.closed {
            let bit = fleetyard_core::move_bit(grid.row_col(*from), grid.row_col(*to));
            if let (Some(mask), Some(bit)) = (masks.get_mut(*from as usize), bit) {
                *mask &= !(1 << bit);
            }
        }
        grid.with_moves(masks).map_err(|error| error.to_string())
    }

    /// The map as a world: the floor of the free cells, which have sides of a metre.
    pub fn workspace(&self) -> Result<Workspace, String> {
        let grid = self.grid()?;
        let nobody = Scene::new(grid.name(), grid.clone(), Vec::new(), Vec::new());
        WorkspaceScene::of(&nobody).world()
    }

    /// The map as a roadmap.
    pub fn roadmap(&self) -> Result<Roadmap, String> {
        let grid = self.grid()?;
        let nobody = Scene::new(grid.name(), grid.clone(), Vec::new(), Vec::new());
        RoadmapScene::beside(&nobody, Motion::StopGo, &self.beside_m).roads()
    }

    /// Checks what a file says: a probe that was drawn is in order.
    pub(crate) fn check(&self) -> Result<(), String> {
        let cols = self.cols();
        if let Some(row) = self.map.iter().find(|row| row.len() as u32 != cols) {
            return Err(format!(
                "the row {row:?} of the map is not as long as the first"
            ));
        }
        let cells = if self.view == View::Status {
            u32::MAX
        } else {
            self.grid()?.cell_count()
        };
        let agents = self.agents();
        if agents == 0 {
            return Err("there are no calls, or no agents".into());
        }
        for call in &self.calls {
            if call.agents.len() != agents {
                return Err("not all calls have the same number of agents".into());
            }
            for member in &call.agents {
                let paths = member.known.iter().chain(&member.failed);
                let mut places = paths.chain(&member.goals).chain([&member.start]);
                if let Some(cell) = places.find(|cell| **cell >= cells) {
                    return Err(format!("cell {cell} is not on the map"));
                }
                if member.heading > 3 {
                    return Err(format!("{} is no heading", member.heading));
                }
            }
        }
        if let Some(unknown) = self
            .dynamics
            .as_deref()
            .filter(|_| self.dynamics().is_none())
        {
            return Err(format!("there are no dynamics {unknown:?}"));
        }
        let lists = [
            (self.radii_m.len(), agents),
            (self.beside_m.len(), cells as usize),
        ];
        if let Some((found, wanted)) = lists
            .into_iter()
            .find(|(found, wanted)| *found > 0 && found != wanted)
        {
            return Err(format!("a list has {found} entries and not {wanted}"));
        }
        Ok(())
    }

    fn scene(&self, call: &Call) -> Step<Scene> {
        let grid = self.grid();
        let grid = grid.map_err(|error| Stop::failed(format!("the kit has no map: {error}")))?;
        let starts = call.agents.iter().map(|member| member.start).collect();
        let mut scene = Scene::new(&format!("fuzz {}", self.seed), grid, starts, Vec::new());
        scene.goals = call
            .agents
            .iter()
            .map(|member| member.goals.clone())
            .collect();
        scene.connectivity = self.connectivity();
        scene.window_steps = call.window;
        scene.radii_m.clone_from(&self.radii_m);
        scene.demand = match call.work {
            Work::Some => Demand::Some,
            Work::Nothing => Demand::Nothing,
            Work::Everything => Demand::Everything,
        };
        Ok(scene)
    }

    fn dynamics(&self) -> Option<&'static str> {
        let name = self.dynamics.as_deref()?;
        DYNAMICS.into_iter().find(|known| *known == name)
    }

    /// A call as the plugin is asked.
    pub(crate) fn question(&self, call: &Call) -> Step<Box<dyn Question>> {
        let mut scene = self.scene(call)?;
        Ok(match self.view {
            View::Grid | View::Status => Box::new(scene),
            View::Turning => {
                let headings = call.agents.iter();
                let headings = headings.map(|member| HEADINGS[member.heading as usize % 4]);
                scene.headings = Some(headings.collect());
                scene.motion = Motion::Rotation;
                Box::new(scene)
            }
            View::Straight => Box::new(scene.straight()),
            View::RoadmapStopGo => {
                Box::new(RoadmapScene::beside(&scene, Motion::StopGo, &self.beside_m))
            }
            View::RoadmapSlower => {
                Box::new(RoadmapScene::beside(&scene, Motion::Slower, &self.beside_m))
            }
            View::Plane => {
                let plane = WorkspaceScene::of(&scene);
                let moved = self.dynamics().and_then(|name| plane.moved_by(name));
                moved.unwrap_or_else(|| Box::new(plane))
            }
        })
    }

    /// The cost of the plan of a call that the fuzzer knows, in steps on the grid; `None` if there is none or
    /// it is no plan.
    pub(crate) fn known_cost(&self, call: &Call) -> Step<Option<u64>> {
        let mut scene = self.scene(call)?;
        scene.window_steps = 0;
        let of = if self.view == View::Straight {
            1
        } else {
            call.agents.len()
        };
        let paths = call
            .agents
            .iter()
            .take(of)
            .map(|member| member.known.as_slice());
        let plan = GridPlan::from_paths(paths);
        if self.view == View::Straight {
            scene = scene.straight();
            scene.motion = Motion::Pebble;
        }
        Ok(judge::plan(&scene, &plan, Arrival::Stay, 0).ok())
    }

    /// The fuzzer's own knowledge of the answer to a call.
    pub(crate) fn expectation(&self, call: &Call, kind: Kind) -> Step<Expectation> {
        if self.view == View::Status {
            return Ok(Expectation::Plan);
        }
        if call.shares_starts() {
            return Ok(Expectation::Survival);
        }
        if kind != Kind::Planner {
            return Ok(Expectation::Plan);
        }
        let is_reachable = self.is_reachable(call)?;
        Ok(if call.window > 0 && is_reachable {
            // To stay is a plan.
            Expectation::Plan
        } else if call.window > 0 {
            Expectation::Unknown
        } else if !is_reachable {
            Expectation::NoPlan
        } else if !call.shares_goals() && self.known_cost(call)?.is_some() {
            Expectation::Plan
        } else {
            Expectation::Unknown
        })
    }

    /// Start and goal of every agent of a call, if it is an instance as files have them: one-shot, each agent with one
    /// goal that it can reach, and no cell that two agents start from or go to.
    pub fn ways(&self, call: &Call) -> Option<Vec<(u32, u32)>> {
        let is_instance = call.window == 0
            && !call.shares_starts()
            && !call.shares_goals()
            && matches!(self.is_reachable(call), Ok(true));
        let way = |member: &Member| match member.goals[..] {
            [goal] => Some((member.start, goal)),
            _ => None,
        };
        let ways = call.agents.iter().map(way).collect::<Option<_>>();
        ways.filter(|_| is_instance)
    }

    /// True if every agent alone can visit its goals.
    fn is_reachable(&self, call: &Call) -> Step<bool> {
        let grid = self.scene(call)?.grid;
        let reaches = |from: u32, to: u32| {
            let mut reached = vec![from];
            let mut seen = BTreeSet::from([from]);
            let mut next = 0;
            while let Some(cell) = reached.get(next).copied() {
                next += 1;
                for near in grid.neighbors(cell, self.connectivity()) {
                    if seen.insert(near) {
                        reached.push(near);
                    }
                }
            }
            seen.contains(&to)
        };
        Ok(call.agents.iter().all(|member| {
            let from = [member.start]
                .into_iter()
                .chain(member.goals.iter().copied());
            from.zip(&member.goals).all(|(from, to)| reaches(from, *to))
        }))
    }
}

impl Member {
    /// Lets the agent stop earlier on the way that is known, if its goal is at the end: after half of its moves, or
    /// with one, one move before the last.
    pub(crate) fn halt(&mut self, part: usize) {
        let [goal] = self.goals[..] else { return };
        if self.known.last() != Some(&goal) {
            return;
        }
        let moves = self.known.windows(2).enumerate();
        let moves = moves.filter(|(_, step)| step[0] != step[1]);
        let times: Vec<usize> = moves.map(|(time, _)| time).collect();
        let fewer = if part == 1 {
            times.len().saturating_sub(1)
        } else {
            times.len() / part
        };
        if let Some(time) = times.get(fewer) {
            self.known.truncate(time + 1);
            self.goals = vec![self.known[*time]];
        }
    }
}

impl Call {
    /// Leaves out of the known plan the steps in which nobody moves.
    pub(crate) fn tidy(&mut self) {
        if self.agents.iter().any(|member| member.known.is_empty()) {
            return;
        }
        let plan = GridPlan::from_paths(self.agents.iter().map(|member| &member.known));
        let moves = |time: &usize| {
            *time == 0
                || (0..plan.agents())
                    .any(|agent| plan.at(agent, *time) != plan.at(agent, *time - 1))
        };
        let times: Vec<usize> = (0..=plan.horizon()).filter(moves).collect();
        for (agent, member) in self.agents.iter_mut().enumerate() {
            member.known = times.iter().map(|time| plan.at(agent, *time)).collect();
            while member.known.len() > 1
                && member
                    .known
                    .ends_with(&[member.known[member.known.len() - 1]; 2])
            {
                member.known.pop();
            }
        }
    }

    /// True if two agents are in one cell.
    pub(crate) fn shares_starts(&self) -> bool {
        let starts: BTreeSet<u32> = self.agents.iter().map(|member| member.start).collect();
        starts.len() < self.agents.len()
    }

    /// True if two agents have the same last goal.
    pub(crate) fn shares_goals(&self) -> bool {
        let mut last: Vec<u32> = self
            .agents
            .iter()
            .filter_map(|member| member.goals.last().copied())
            .collect();
        last.sort_unstable();
        last.windows(2).any(|pair| pair[0] == pair[1])
    }

    /// The plan that a planner left, if it left one.
    pub(crate) fn failed(&self) -> Option<GridPlan> {
        let paths = self.agents.iter().map(|member| member.failed.as_slice());
        let has_all = paths.clone().all(|path| !path.is_empty());
        has_all.then(|| GridPlan::from_paths(paths))
    }

    /// The status of the fleet.
    pub(crate) fn status(&self) -> FleetStatus {
        let [time_s, since_last_call_s, planning_limit_s, action_s] =
            self.times_s.unwrap_or_default();
        FleetStatus {
            time_s,
            since_last_call_s,
            planning_limit_s,
            action_s,
            actions_left: self
                .agents
                .iter()
                .map(|member| member.actions_left)
                .collect(),
        }
    }

    /// The budgets and limits of a call, for people; empty if it has the usual ones.
    pub(crate) fn hurry(&self) -> String {
        let mut words = Vec::new();
        if let Some(ns) = self.prepare_ns {
            words.push(format!("after a `prepare` of {}", seconds(ns)));
        }
        if let Some(ns) = self.wall_ns {
            words.push(format!("within {}", seconds(ns)));
        }
        if self.nodes > 0 {
            words.push(format!("with {} nodes", self.nodes));
        }
        words.join(", ")
    }
}
