//! A fleet that does exactly the first step of every plan, all at once, and gets new goals at
//! random; for tests, example and benchmark.
#![allow(dead_code, reason = "each user takes what it needs")]

use std::sync::Arc;

use fleetyard_abi::{GridEnvironment, GridPlan, Heading, Instance, Motion};
use fleetyard_plugin_mapf::Watch;
use fleetyard_plugin_mapf::epibt::run::{End, Query, run};
use fleetyard_plugin_mapf::streets::{Journeys, Streets, Survey, Turning};
use fleetyard_plugin_mapf::wppl;
use fleetyard_plugin_spacetime::graph::Graph;
use fleetyard_testkit::{Case, grid};

/// Never looks at a clock.
pub(crate) struct Patient;

impl Watch for Patient {
    fn stop(&mut self) -> bool {
        false
    }
    fn begin(&mut self, _: u32) -> bool {
        true
    }
    fn ready(&mut self) {}
    fn pause(&mut self) -> bool {
        false
    }
}

/// Says stop whenever it is asked.
pub(crate) struct Hasty;

impl Watch for Hasty {
    fn stop(&mut self) -> bool {
        true
    }
    fn begin(&mut self, _: u32) -> bool {
        false
    }
    fn ready(&mut self) {}
    fn pause(&mut self) -> bool {
        true
    }
}

/// A fleet on its map.
pub(crate) struct Floor {
    pub(crate) case: Case,
    pub(crate) streets: Streets,
    graph: Arc<Graph>,
    free: Vec<u32>,
    /// Goals that each agent has been given.
    given: Vec<u64>,
    seed: u64,
    step: u64,
    /// The rest of the last plan.
    rest: Option<GridPlan>,
}

/// The settings of a fleet's planner.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Manner {
    pub(crate) horizon: usize,
    pub(crate) tries: Option<u32>,
    pub(crate) window: u32,
    pub(crate) threads: usize,
    pub(crate) planner: Planner,
}

/// The planner of a fleet.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Planner {
    Epibt,
    Wppl { depth: u32 },
}

impl Floor {
    /// Agents at random cells of the largest part of a map, each of which knows so many goals, along
    /// lanes if moves against them are charged.
    pub(crate) fn new(
        map: GridEnvironment,
        agents: usize,
        turning: bool,
        known: u64,
        charge: u32,
        seed: u64,
    ) -> Self {
        let free = largest_part(&map);
        let mut starts = free.clone();
        starts.sort_by_key(|&cell| grid::mix(seed << 40 ^ u64::from(cell)));
        starts.truncate(agents);
        let passable: Vec<bool> = map.passable.iter().map(|free| *free != 0).collect();
        let graph = Graph::new(map.rows as usize, map.cols as usize, &passable);
        let graph = Arc::new(graph);
        let agents = starts.len();
        let instance = Instance::one_shot(starts, vec![0; agents]);
        let case = Case { map, instance };
        let mut floor = Self {
            case: if turning { case.turning() } else { case },
            streets: Survey::new(&graph, charge, 1.0, 1 << 30).finish(),
            graph,
            free,
            given: vec![0; agents],
            seed,
            step: 0,
            rest: None,
        };
        let lists: Vec<Vec<u32>> = (0..agents)
            .map(|agent| (0..known).map(|_| floor.draw(agent)).collect())
            .collect();
        floor.case = floor.case.windowed(1, &lists);
        floor.case.instance.allows_cycles = true;
        floor
    }

    /// With so many bytes for tables.
    pub(crate) fn within(mut self, bytes: u64) -> Self {
        self.streets = Survey::new(&self.graph, 0, 1.0, bytes).finish();
        self
    }

    fn draw(&mut self, agent: usize) -> u32 {
        let number = (agent as u64) << 32 | self.given[agent];
        self.given[agent] += 1;
        let at = grid::mix(self.seed << 50 ^ number) % self.free.len() as u64;
        self.free[at as usize]
    }

    /// The plan of the next steps.
    pub(crate) fn plan(&mut self, manner: Manner, watch: &mut dyn Watch) -> (GridPlan, End) {
        let instance = &self.case.instance;
        let turning = instance.motion == Motion::Rotation;
        let journeys = Journeys {
            starts: &instance.starts,
            goals: &instance.goals,
            headings: instance.headings.as_deref(),
            turning: Turning {
                quarter_s: f64::from(u8::from(turning)),
            },
            traffic: None,
            tasks: None,
            threads: manner.threads,
            until_ns: u64::MAX,
            guidance: None,
        };
        let mut streets = self.streets.ranking(journeys, &mut || watch.pause());
        let first = Query {
            starts: &instance.starts,
            goals: &instance.goals,
            visited: &[],
            headings: instance.headings.as_deref(),
            turning,
            window: Some(manner.window),
            step_limit: 0,
            horizon: manner.horizon,
            tries: manner.tries,
            rings: instance.allows_cycles,
            rest: self.rest.as_ref(),
            seed: grid::mix(self.seed ^ self.step << 20),
            threads: manner.threads,
        };
        let in_reach = "goals are in reach";
        match manner.planner {
            Planner::Epibt => run(&self.graph, &mut streets, &first, watch).expect(in_reach),
            Planner::Wppl { depth } => {
                let tries = Some(0);
                let query = wppl::Query {
                    first: Query { tries, ..first },
                    depth,
                    tries: manner.tries,
                };
                let (plan, end, _) =
                    wppl::run(&self.graph, &mut streets, &query, watch).expect(in_reach);
                (plan, end)
            }
        }
    }

    /// Does the first step of a plan, turning as early as possible. Gives the number of goals
    /// reached.
    pub(crate) fn follow(&mut self, plan: &GridPlan) -> u64 {
        let mut reached = 0;
        let mut lists: Vec<Vec<u32>> = Vec::new();
        let mut rest = GridPlan::default();
        for (agent, path) in plan.paths().enumerate() {
            let here = self.case.instance.starts[agent];
            let to = path.get(1).copied().unwrap_or(here);
            let next = path.iter().find(|cell| **cell != here);
            if let (Some(headings), Some(&next)) = (&mut self.case.instance.headings, next) {
                let by = i64::from(next) - i64::from(here);
                let towards = match by {
                    1 => Heading::East,
                    -1 => Heading::West,
                    by if by > 0 => Heading::South,
                    _ => Heading::North,
                };
                headings[agent] = if to == here {
                    turned(headings[agent], towards)
                } else {
                    towards
                };
            }
            let mut list = self.case.instance.goals[agent].to_vec();
            let visited = grid::visited(&list, &[to]);
            list.drain(..visited);
            reached += visited as u64;
            list.extend((0..visited).map(|_| self.draw(agent)));
            lists.push(list);
            rest.push_path(path.iter().copied().skip(usize::from(path.len() > 1)));
            self.case.instance.starts[agent] = to;
        }
        self.case.instance.goals = grid::goals(&lists);
        self.rest = Some(rest);
        self.step += 1;
        reached
    }

    /// The reason why a plan is none, to the end of all paths.
    pub(crate) fn judge(&self, plan: &GridPlan) -> Result<(), String> {
        let paths: Vec<&[u32]> = plan.paths().collect();
        self.case.motions(&paths)?;
        let mut whole = self.case.clone();
        whole.instance.window_steps = 0;
        whole.collisions(&paths, 0)
    }

    /// Plans and drives so many steps. Gives the number of goals reached.
    pub(crate) fn drive(&mut self, steps: u32, manner: Manner) -> u64 {
        let step = |_| {
            let (plan, end) = self.plan(manner, &mut Patient);
            assert_eq!(end, End::Done);
            assert_eq!(self.judge(&plan), Ok(()));
            self.follow(&plan)
        };
        (0..steps).map(step).sum()
    }
}

/// The cells of the largest part of a map that hangs together.
fn largest_part(map: &GridEnvironment) -> Vec<u32> {
    let mut left = grid::free(map);
    let mut largest = Vec::new();
    while let Some(&from) = left.first() {
        let part = grid::region(map, from);
        left.retain(|cell| part.binary_search(cell).is_err());
        if part.len() > largest.len() {
            largest = part;
        }
    }
    largest
}

/// A quarter turn from one heading towards another.
fn turned(from: Heading, to: Heading) -> Heading {
    const ROUND: [Heading; 4] = [Heading::North, Heading::East, Heading::South, Heading::West];
    let place = |of: Heading| ROUND.iter().position(|heading| *heading == of).unwrap_or(0);
    match (place(to) + 4 - place(from)) % 4 {
        0 => from,
        3 => ROUND[(place(from) + 3) % 4],
        _ => ROUND[(place(from) + 1) % 4],
    }
}
