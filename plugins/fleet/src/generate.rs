//! Instance generators: they choose the goals that the planner gets.
//!
//! All three keep the goals that agents have, as far as they can be used, and give open tasks to
//! agents without any: each task, in the order in which tasks are listed, to the nearest agent that
//! has nothing to do. Agents that are left without goals stay where they are.
//!
//! The three are those that "LSMART" (J. Yan, Y. Zhang, Z. Liu, H. Zhang, H. Jiang, J. Chen,
//! S. F. Smith, J. Li, "Lifelong scalable multi-agent realistic testbed and a comprehensive
//! study on design choices in lifelong AGV fleet management systems") compares:
//!
//! - [`DistinctOneGoal`]: for planners of the usual kind, which want goals to differ;
//! - [`OneGoal`]: J. Morag, N. Gabay, D. Koyfman, R. Stern, "Should multi-agent path finding
//!   algorithms coordinate target arrival times?", SoCS 2025.
//! - [`WindowedMultiGoals`]: J. Li, A. Tinka, S. Kiesel, J. W. Durham, T. K. S. Kumar,
//!   S. Koenig, "Lifelong multi-agent path finding in large-scale warehouses", AAAI 2021.

use fleetyard_abi::sdk::{Failure, InstanceGenerator, Options, Plugin, Sink};
use fleetyard_abi::{
    Assignment, Budget, Capability, Descriptor, FleetState, Goals, Instance, Kind, Request,
    SharedEnvironment, Status, Task,
};
use fleetyard_plugin_spacetime::graph::Vertex;
use fleetyard_plugin_spacetime::plugin::described;
use schemars::JsonSchema;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::ground::{Ground, Learn, Search};
use crate::invalid;

/// The rule by which a generator chooses goals; also the type of its options.
pub trait Rule: DeserializeOwned + JsonSchema + Send + 'static {
    /// Identifier and name.
    const NAMES: (&'static str, &'static str);
    /// Description of the generator for `plugins info`.
    const ABOUT: &'static str;
    /// Capabilities of the generator besides grids, pebbles and rotation.
    const EXTRA: &'static [Capability];
    /// The goals of every agent in the next instance.
    #[doc(hidden)]
    fn goals(&self, fleet: &Fleet<'_>, sink: &dyn Sink) -> Result<Goals, Failure>;
}

/// A generator with the options of a [`Rule`].
#[derive(Debug)]
pub struct Generator<R>(R);

/// One goal per agent, all different.
pub type DistinctOneGoal = Generator<Distinct>;
/// One goal per agent, which others may share.
pub type OneGoal = Generator<Current>;
/// As many goals per agent as keep it busy for the window.
pub type WindowedMultiGoals = Generator<Windowed>;

impl<R: Rule> Plugin for Generator<R> {
    fn descriptor() -> Descriptor {
        let common = &[
            Capability::Grid,
            Capability::Pebble,
            Capability::MoveMask,
            Capability::Rotation,
            Capability::Deterministic,
        ];
        described::<R>(
            Kind::InstanceGenerator,
            R::NAMES,
            R::ABOUT,
            [common, R::EXTRA],
        )
    }

    fn create(options: Options<'_>) -> Result<Self, Failure> {
        options.parse().map(Self)
    }
}

impl<R: Rule> InstanceGenerator for Generator<R> {
    type Map = Ground;

    fn prepare(
        &mut self,
        environment: &SharedEnvironment,
        _: &Budget,
        _: &dyn Sink,
    ) -> Result<Ground, Failure> {
        Ground::learn(environment)
    }

    fn generate(
        &mut self,
        ground: &mut Ground,
        state: &FleetState,
        _: &Budget,
        sink: &dyn Sink,
    ) -> Result<(), Failure> {
        let ground = &*ground;
        let Instance { starts, goals, .. } = &state.next;
        if goals.len() != starts.len() {
            return Err(invalid(format!(
                "the fleet has {} agents, but {} lists of goals",
                starts.len(),
                goals.len()
            )));
        }
        let at = ground.places(starts)?;
        let given = give(ground, state, &at, sink)?;
        let mut upcoming: Vec<&[u32]> = goals.iter().collect();
        for (agent, task) in &given {
            upcoming[*agent] = &task.places;
        }
        let fleet = Fleet {
            ground,
            at: &at,
            upcoming: &upcoming,
            window_steps: state.next.window_steps,
        };
        let assignments = given.iter().map(|(agent, task)| Assignment {
            agent: *agent as u32,
            task: task.id,
        });
        sink.submit_request(&Request {
            assignments: assignments.collect(),
            ..state.request(self.0.goals(&fleet, sink)?)
        })?;
        Ok(())
    }
}

fn check(sink: &dyn Sink) -> Result<(), Failure> {
    if sink.cancelled() {
        return Err(Failure::new(Status::TimedOut, "the call's time is up"));
    }
    Ok(())
}

/// The task of each agent that gets one, by agents in ascending order. Tasks that no agent without
/// goals can reach stay open.
fn give<'s>(
    ground: &Ground,
    state: &'s FleetState,
    at: &[Vertex],
    sink: &dyn Sink,
) -> Result<Vec<(usize, &'s Task)>, Failure> {
    const NOBODY: u32 = u32::MAX;
    let mut given = Vec::new();
    if state.tasks.is_empty() {
        return Ok(given);
    }
    let mut idle = vec![NOBODY; ground.graph.len()];
    // How many are idle in a region, by the vertex that numbers it.
    let mut left = vec![0_u32; ground.graph.len()];
    let mut total = 0;
    for (agent, goals) in state.next.goals.iter().enumerate() {
        if goals.is_empty() {
            idle[at[agent] as usize] = agent as u32;
            left[ground.region(at[agent]) as usize] += 1;
            total += 1;
        }
    }
    let mut search = Search::new(ground);
    for task in &state.tasks {
        if total == 0 {
            break;
        }
        check(sink)?;
        let visits: Option<Vec<Vertex>> = task
            .places
            .iter()
            .map(|cell| ground.graph.vertex(*cell))
            .collect();
        let Some((&first, visits)) = visits
            .as_deref()
            .and_then(|visits| Some((visits.first()?, visits)))
        else {
            continue;
        };
        let nobody = left[ground.region(first) as usize] == 0 && !ground.graph.is_directed();
        let leads = |step: &[Vertex]| ground.leads(step[0], step[1]);
        if nobody || !visits.windows(2).all(leads) {
            continue;
        }
        if let Some(v) = search.nearest_to(first, |v| idle[v as usize] != NOBODY) {
            given.push((idle[v as usize] as usize, task));
            idle[v as usize] = NOBODY;
            left[ground.region(v) as usize] -= 1;
            total -= 1;
        }
    }
    given.sort_unstable_by_key(|(agent, _)| *agent);
    Ok(given)
}

/// The state of the fleet, as rules see it.
#[derive(Debug)]
pub struct Fleet<'a> {
    ground: &'a Ground,
    at: &'a [Vertex],
    /// The goals of every agent, in order; some may have none.
    upcoming: &'a [&'a [u32]],
    window_steps: u32,
}

impl Fleet<'_> {
    /// A goal of an agent as a vertex: it has to be one that the agent can reach.
    fn reachable(&self, agent: usize, cell: u32) -> Result<Vertex, Failure> {
        let Some(goal) = self.ground.graph.vertex(cell) else {
            return Err(invalid(format!(
                "the goal of agent {agent}, cell {cell}, is not a free cell of the map"
            )));
        };
        if !self.ground.leads(self.at[agent], goal) {
            return Err(invalid(format!(
                "agent {agent} cannot get from cell {} to its goal, cell {cell}",
                self.ground.graph.cell(self.at[agent])
            )));
        }
        Ok(goal)
    }

    /// The goal that each agent is after now, if it has one.
    fn current(&self) -> Result<Vec<Option<Vertex>>, Failure> {
        let first = |(agent, goals): (usize, &&[u32])| {
            let goal = goals.first().map(|cell| self.reachable(agent, *cell));
            goal.transpose()
        };
        self.upcoming.iter().enumerate().map(first).collect()
    }

    /// The agents that head for each goal, with their Manhattan distance to it: sorted by goal, the
    /// nearest agent first.
    fn rivals(&self, current: &[Option<Vertex>]) -> Vec<(Vertex, u32, usize)> {
        let rival = |(agent, goal): (usize, &Option<Vertex>)| {
            let goal = (*goal)?;
            let steps = self.ground.graph.manhattan(self.at[agent], goal);
            Some((goal, steps, agent))
        };
        let mut rivals: Vec<_> = current.iter().enumerate().filter_map(rival).collect();
        rivals.sort_unstable();
        rivals
    }

    fn cells(&self, vertices: impl IntoIterator<Item = Vertex>) -> Goals {
        let cells = vertices.into_iter().map(|v| self.ground.graph.cell(v));
        Goals::single(cells.collect())
    }
}

/// Options of `one-goal`: none.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Current {}

impl Rule for Current {
    const NAMES: (&'static str, &'static str) = ("one-goal", "One goal");
    const ABOUT: &'static str = "Gives every agent its current goal. Agents may share goals: for \
        planners that let agents go on once they have arrived (Morag, Gabay, Koyfman, Stern, \
        SoCS 2025).";
    const EXTRA: &'static [Capability] = &[Capability::Windowed, Capability::DuplicateGoals];

    fn goals(&self, fleet: &Fleet<'_>, _: &dyn Sink) -> Result<Goals, Failure> {
        let current = fleet.current()?;
        let or_here = current.iter().zip(fleet.at);
        Ok(fleet.cells(or_here.map(|(goal, here)| goal.unwrap_or(*here))))
    }
}

/// Options of `windowed-multi-goals`.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Windowed {
    /// Goals that every agent has at least, as far as it has so many.
    #[schemars(range(min = 1))]
    least: u32,
    /// Distance that agents keep from a goal that others have too, in steps: an agent waits where
    /// it is, and makes way, if two or more others are nearer to its goal and it is within so many
    /// steps for each of them. 0: no agent waits.
    #[schemars(range(max = 1000))]
    spacing: u32,
}

impl Default for Windowed {
    fn default() -> Self {
        Self {
            least: 2,
            spacing: 12,
        }
    }
}

impl Rule for Windowed {
    const NAMES: (&'static str, &'static str) =
        ("windowed-multi-goals", "Windowed, multiple goals");
    const ABOUT: &'static str = "Gives every agent as many of its goals, in order, as it takes to \
        be under way for longer than the window. Agents may share goals: for planners in windows \
        (Li, Tinka, Kiesel, Durham, Kumar, Koenig, AAAI 2021).";
    const EXTRA: &'static [Capability] = &[Capability::Windowed, Capability::DuplicateGoals];

    fn goals(&self, fleet: &Fleet<'_>, _: &dyn Sink) -> Result<Goals, Failure> {
        let mut lists = Goals::with_capacity(fleet.at.len(), fleet.at.len() * 2);
        let waits = self.waits(fleet)?;
        for (agent, goals) in fleet.upcoming.iter().enumerate() {
            let mut here = fleet.at[agent];
            let goals = if waits[agent] { &[] } else { *goals };
            let mut steps = 0_u64;
            for (before, &cell) in (0..).zip(goals) {
                if before >= self.least.max(1) && steps > u64::from(fleet.window_steps) {
                    break;
                }
                let goal = fleet.reachable(agent, cell)?;
                steps += u64::from(fleet.ground.graph.manhattan(here, goal));
                here = goal;
                lists.push_item(cell);
            }
            if goals.is_empty() {
                lists.push_item(fleet.ground.graph.cell(here));
            }
            lists.end_list();
        }
        Ok(lists)
    }
}

/// So many agents may be at a goal at a time: one comes when another goes.
const AT_A_GOAL: usize = 2;

impl Windowed {
    /// True for the agents that do not go on to their goal yet, because enough others are nearer to
    /// it: an agent that queues right before a goal stands in the way of those that leave it.
    fn waits(&self, fleet: &Fleet<'_>) -> Result<Vec<bool>, Failure> {
        let mut waits = vec![false; fleet.at.len()];
        if self.spacing == 0 {
            return Ok(waits);
        }
        let rivals = fleet.rivals(&fleet.current()?);
        for same in rivals.chunk_by(|a, b| a.0 == b.0) {
            for (nearer, &(_, steps, agent)) in same.iter().enumerate().skip(AT_A_GOAL) {
                waits[agent] = u64::from(steps) < u64::from(self.spacing) * nearer as u64;
            }
        }
        Ok(waits)
    }
}

/// Options of `distinct-one-goal`: none.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Distinct {}

impl Rule for Distinct {
    const NAMES: (&'static str, &'static str) = ("distinct-one-goal", "Distinct, one goal");
    const ABOUT: &'static str = "Gives every agent its current goal. Where several have the same, \
        the nearest keeps it, and the others go for the nearest cells that nobody heads for until \
        it is free: for planners that want goals to differ.";
    const EXTRA: &'static [Capability] = &[Capability::Windowed];

    fn goals(&self, fleet: &Fleet<'_>, sink: &dyn Sink) -> Result<Goals, Failure> {
        let Fleet { ground, at, .. } = *fleet;
        let current = fleet.current()?;
        let mut taken = vec![false; ground.graph.len()];
        for goal in current.iter().flatten() {
            taken[*goal as usize] = true;
        }
        let rivals = fleet.rivals(&current);
        let mut goals = current.clone();
        let mut search = Search::new(ground);
        let free = |search: &mut Search<'_>, taken: &mut [bool], from: Vertex, agent: usize| {
            let found = search.nearest(from, |v| !taken[v as usize]);
            let cell = ground.graph.cell(from);
            let found = found.ok_or_else(|| {
                let reason = format!("no cell near cell {cell} is left for agent {agent}");
                Failure::new(Status::GaveUp, reason)
            })?;
            taken[found as usize] = true;
            Ok::<_, Failure>(found)
        };
        for group in rivals
            .chunk_by(|a, b| a.0 == b.0)
            .filter(|group| group.len() > 1)
        {
            check(sink)?;
            let goal = group[0].0;
            // The nearest keeps its goal: it comes nearer and so it goes on being the one,
            // and when it has arrived the next one is. The straight way is the least that a
            // way can be, so most need not be looked for.
            let mut nearest = (u32::MAX, usize::MAX);
            for &(_, least, agent) in group {
                if (least, agent) > nearest {
                    break;
                }
                if let Some(steps) = search.distance(at[agent], goal, nearest.0) {
                    nearest = nearest.min((steps, agent));
                }
            }
            for &(_, _, agent) in group {
                if agent != nearest.1 {
                    goals[agent] = Some(free(&mut search, &mut taken, goal, agent)?);
                }
            }
        }
        // Who has nothing to do waits where it is, or makes way.
        let idle = goals
            .iter_mut()
            .enumerate()
            .filter(|(_, goal)| goal.is_none());
        for (agent, goal) in idle {
            *goal = Some(free(&mut search, &mut taken, at[agent], agent)?);
        }
        Ok(fleet.cells(goals.into_iter().flatten()))
    }
}
