//! Scenes on roadmaps.

use fleetyard_abi::{
    Goals, Instance, Lists, Motion, Plan, PlanRef, Request, RoadmapEnvironment, Robot,
    SharedEnvironment,
};
use fleetyard_check::{Pace, RoadmapRule, RoadmapTask, TravelCosts, validate_roadmap};
use fleetyard_core::{Roadmap, RoadmapPlan, Visit};
use fleetyard_world::Footprint;

use super::{RADIUS_M, Scene, middle_m};
use crate::question::Question;
use crate::rules::{Arrival, Rules, VIOLATIONS, broken, other_form};
use crate::stop::Step;

const SPEED_M_PER_S: f64 = 1.0;

/// An instance on a roadmap, with a name.
#[derive(Debug, Clone)]
pub(crate) struct RoadmapScene {
    name: String,
    roadmap: RoadmapEnvironment,
    starts: Vec<u32>,
    goals: Goals,
    robots: Vec<Robot>,
    robot_of: Vec<u32>,
    pub(crate) motion: Motion,
    best: Option<f64>,
    crowded: bool,
}

/// A roadmap by hand: its name, its vertices, the lines between them that can be driven both ways,
/// start and goal of every agent, and the least sum of costs.
pub(crate) type Sketch = (
    &'static str,
    &'static [[f64; 2]],
    &'static [[u32; 2]],
    &'static [[u32; 2]],
    Option<f64>,
);

impl RoadmapScene {
    /// From a sketch, with so many metres between any two centres.
    pub(crate) fn sketched(
        (name, vertices, lines, agents, best): Sketch,
        separation_m: f64,
        motion: Motion,
    ) -> Self {
        let both_ways = lines
            .iter()
            .flat_map(|[one, other]| [[*one, *other], [*other, *one]]);
        let edges = both_ways.map(|[from, to]| (from, to));
        Self {
            name: name.into(),
            roadmap: roadmap(vertices, edges.collect(), separation_m),
            starts: agents.iter().map(|[start, _]| *start).collect(),
            goals: Goals::single(agents.iter().map(|[_, goal]| *goal).collect()),
            robots: Vec::new(),
            robot_of: Vec::new(),
            motion,
            best,
            crowded: false,
        }
    }

    /// A scene on a grid: a vertex in the middle of every cell, of which those of obstacles have no
    /// edges.
    pub(crate) fn of(scene: &Scene, motion: Motion) -> Self {
        Self::beside(scene, motion, &[])
    }

    /// The same with vertices so many metres beside the middle of their cells, as far as the list goes.
    pub(crate) fn beside(scene: &Scene, motion: Motion, beside_m: &[[f64; 2]]) -> Self {
        let grid = &scene.grid;
        let cells = 0..grid.cell_count();
        let place = |cell: u32| {
            let ([x, y], beside) = (middle_m(grid, cell), beside_m.get(cell as usize));
            let [right, up] = beside.copied().unwrap_or_default();
            [x + right, y + up]
        };
        let vertices: Vec<[f64; 2]> = cells.clone().map(place).collect();
        let edges = cells.flat_map(|from| {
            let targets = grid.neighbors(from, scene.connectivity);
            targets.map(move |to| (from, to))
        });
        let (robots, robot_of) = scene.robots();
        Self {
            name: format!("{}, as a roadmap", scene.name),
            roadmap: roadmap(&vertices, edges.collect(), 2.0 * RADIUS_M),
            starts: scene.starts.clone(),
            goals: scene.goals.iter().cloned().collect(),
            robots,
            robot_of,
            motion,
            best: None,
            crowded: scene.crowded,
        }
    }

    /// The roadmap as the host knows it.
    pub(crate) fn roads(&self) -> Result<Roadmap, String> {
        let own = &self.roadmap;
        let edges = own.edges.iter().zip(0..);
        let edges = edges.flat_map(|(targets, from)| targets.iter().map(move |to| (from, *to)));
        Roadmap::new(own.x_m.clone(), own.y_m.clone(), edges).map_err(|error| error.to_string())
    }
}

/// A roadmap of directed edges, in any order.
fn roadmap(
    vertices: &[[f64; 2]],
    mut edges: Vec<(u32, u32)>,
    separation_m: f64,
) -> RoadmapEnvironment {
    edges.sort_unstable();
    let mut targets: Vec<Vec<u32>> = vec![Vec::new(); vertices.len()];
    for (from, to) in edges {
        targets[from as usize].push(to);
    }
    RoadmapEnvironment::straight(
        vertices.iter().map(|[x, _]| *x).collect(),
        vertices.iter().map(|[_, y]| *y).collect(),
        targets.into_iter().collect(),
        SPEED_M_PER_S,
        separation_m,
    )
}

impl Question for RoadmapScene {
    fn name(&self) -> &str {
        &self.name
    }

    fn environment(&self) -> Step<SharedEnvironment> {
        let environment = fleetyard_abi::Environment::from(self.roadmap.clone());
        Ok(SharedEnvironment::new(environment.named(&self.name)))
    }

    fn instance(&self) -> Instance {
        Instance {
            starts: self.starts.clone(),
            goals: self.goals.clone(),
            robots: self.robots.clone(),
            robot_of: self.robot_of.clone(),
            motion: self.motion,
            radius_m: self.roadmap.separation_m / 2.0,
            ..Instance::default()
        }
    }

    fn first_agent(&self) -> Box<dyn Question> {
        Box::new(Self {
            starts: self.starts.iter().copied().take(1).collect(),
            goals: self.goals.iter().take(1).map(<[u32]>::to_vec).collect(),
            robots: self.robots.iter().take(1).cloned().collect(),
            robot_of: Vec::new(),
            best: None,
            ..self.clone()
        })
    }

    fn pair(&self) -> Step<Option<Box<dyn Question>>> {
        let pair = Self::of(&Scene::pair()?, self.motion);
        Ok(Some(Box::new(pair)))
    }

    fn is_crowded(&self) -> bool {
        self.crowded
    }

    fn best(&self) -> Option<f64> {
        self.best
    }

    fn judge(&self, plan: &Plan, rules: Rules) -> Result<f64, String> {
        let Plan::Visits(visits) = plan else {
            return Err(other_form("visits", plan));
        };
        let plan = timed(visits).map_err(|error| error.to_string())?;
        let own = &self.roadmap;
        let roadmap = self.roads()?;
        let radius_m = own.separation_m / 2.0;
        let disc = Footprint::Disc { radius_m }
            .shape()
            .map_err(|error| error.to_string())?;
        let pace = match self.motion {
            Motion::Slower => Pace::Slower,
            _ => Pace::StopGo,
        };
        // Who has no goal may end anywhere.
        let paths = plan.paths().map(<[Visit]>::last);
        let ends = paths.map(|last| last.map_or(0, |visit| visit.vertex));
        let goals: Vec<u32> = self
            .goals
            .iter()
            .zip(ends.chain(std::iter::repeat(0)))
            .map(|(goals, end)| goals.last().copied().unwrap_or(end))
            .collect();
        let task = RoadmapTask {
            pace,
            starts: Some(&self.starts),
            goals: (rules.arrival != Arrival::Free).then_some(&goals),
            ..RoadmapTask::new(&roadmap, &disc, own.speed_m_per_s)
        };
        let verdict = validate_roadmap(&plan, &task, VIOLATIONS);
        let counts = |rule: RoadmapRule| !(rule.is_contact() && rules.may_collide);
        let found = verdict.violations.iter().find(|found| counts(found.rule));
        if let Some(found) = found {
            return Err(broken(&found.sentence, found.rule));
        }
        let lifted = plan
            .to_trajectories(&roadmap)
            .map_err(|error| error.to_string())?;
        Ok(TravelCosts::of(&lifted).sum_of_costs_s)
    }

    fn judge_request(&self, request: &Request) -> Result<(), String> {
        request.check(self.starts.len(), self.roadmap.vertices())
    }

    fn picture(&self) -> String {
        let at = |vertex: u32| {
            let [x, y] = [&self.roadmap.x_m, &self.roadmap.y_m].map(|all| all[vertex as usize]);
            format!("vertex {vertex} ({x}, {y})")
        };
        let agents = self.starts.iter().zip(self.goals.iter());
        super::listed(agents.map(|(start, goals)| {
            let goal = goals.last().map_or("anywhere".into(), |goal| at(*goal));
            format!("{} to {goal}", at(*start))
        }))
    }
}

/// The plan as the host keeps it.
fn timed(
    visits: &Lists<fleetyard_abi::Visit>,
) -> Result<RoadmapPlan, fleetyard_core::RoadmapPlanError> {
    let entries = PlanRef::Visits(visits).entries();
    let mut plan = RoadmapPlan::with_capacity(visits.len(), entries);
    for visits in visits.iter() {
        plan.push_path(visits.iter().map(|visit| Visit {
            vertex: visit.vertex,
            arrival_s: visit.arrival_s,
            departure_s: visit.departure_s,
        }))?;
    }
    Ok(plan)
}
