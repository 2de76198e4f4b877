//! Planners of roadmaps and of the plane: the standard ones, and what is broken afterwards.

use std::sync::{Arc, Mutex, PoisonError};

use fleetyard_abi::sdk::{self, Failure, Options, Plugin, Rejected, Sink};
use fleetyard_abi::{
    Budget, Capabilities, Capability, ControlPlan, Descriptor, Environment, GridPlan, Instance,
    Kind, KnotPlan, Lists, LogLevel, MotionPlan, Plan, PlanRef, Request, RoadmapEnvironment,
    SharedEnvironment, Status, View,
};
use fleetyard_plugin_plane::plugin::PlanePrioritised;
use fleetyard_plugin_roadmap::plugin::RoadmapPrioritised;

use crate::{Choice, Mistake};

/// A planner that keeps its promises, and the one that is broken.
pub(crate) struct Spoiled<P> {
    choice: Choice,
    planner: P,
}

pub(crate) type Roads = Spoiled<RoadmapPrioritised>;
pub(crate) type Plane = Spoiled<PlanePrioritised>;

/// The descriptor of a planner under another name, which claims agents without a goal besides.
fn described<P: Plugin>(id: &str) -> Descriptor {
    let own = P::descriptor();
    let idle = Capabilities::of(&[Capability::Idle]);
    Descriptor {
        capabilities: Capabilities::from_bits(own.capabilities.bits() | idle.bits()),
        features: own.features,
        ..Choice::descriptor(Kind::Planner, id)
    }
}

fn made<P: Plugin>(options: Options<'_>) -> Result<Spoiled<P>, Failure> {
    Ok(Spoiled {
        choice: Choice::read(options)?,
        planner: P::create(Options::new("{}"))?,
    })
}

impl Plugin for Roads {
    fn descriptor() -> Descriptor {
        described::<RoadmapPrioritised>("promising-roads")
    }

    fn create(options: Options<'_>) -> Result<Self, Failure> {
        made(options)
    }
}

impl Plugin for Plane {
    fn descriptor() -> Descriptor {
        described::<PlanePrioritised>("promising-plane")
    }

    fn create(options: Options<'_>) -> Result<Self, Failure> {
        made(options)
    }
}

impl<P: sdk::Planner> sdk::Planner for Spoiled<P>
where
    Self: Plugin,
{
    type Map = P::Map;

    fn prepare(
        &mut self,
        environment: &SharedEnvironment,
        budget: &Budget,
        sink: &dyn Sink,
    ) -> Result<P::Map, Failure> {
        let mut known = Environment::clone(environment);
        match (&mut known.view, self.choice.mistake) {
            (View::Roadmap(roadmap), Mistake::IgnoresArrows) => *roadmap = both_ways(roadmap),
            (View::Workspace(workspace), Mistake::IgnoresMovers) => workspace.movers.clear(),
            _ => {}
        }
        self.planner.prepare(&Arc::new(known), budget, sink)
    }

    fn plan(
        &mut self,
        map: &mut P::Map,
        instance: &Instance,
        budget: &Budget,
        sink: &dyn Sink,
    ) -> Result<(), Failure> {
        let agents = 0..instance.agents();
        let is_idle = |agent: &usize| {
            let places = instance.goals.get(*agent).is_none_or(<[u32]>::is_empty);
            places && instance.goal_states.get(*agent).is_none_or(<[_]>::is_empty)
        };
        // Who is in one group does not collide.
        let groups: Vec<Vec<usize>> = match self.choice.mistake {
            Mistake::IgnoresOthers => agents.map(|agent| vec![agent]).collect(),
            Mistake::IdleAgentBlocks => {
                let (idle, busy): (Vec<_>, Vec<_>) = agents.partition(is_idle);
                let idle = idle.into_iter().map(|agent| vec![agent]);
                idle.chain([busy])
                    .filter(|group| !group.is_empty())
                    .collect()
            }
            _ => vec![agents.collect()],
        };
        let mut plans = Vec::new();
        for group in &groups {
            let own = Own {
                sink,
                plan: Mutex::default(),
            };
            self.planner.plan(map, &of(instance, group), budget, &own)?;
            let plan = own
                .plan
                .into_inner()
                .unwrap_or_else(PoisonError::into_inner);
            plans.push(plan.ok_or_else(|| Failure::new(Status::GaveUp, "no plan"))?);
        }
        let plan = joined(instance.agents(), &groups, &plans);
        sink.submit(&self.spoiled(plan, instance))?;
        Ok(())
    }
}

impl<P> Spoiled<P> {
    /// The controls that lead single integrators along their knots, or beside them.
    fn controls(&self, knots: &KnotPlan, instance: &Instance) -> Option<ControlPlan> {
        let aside = if self.choice.mistake == Mistake::OffControls {
            0.1
        } else {
            0.0
        };
        let mut controls = ControlPlan::default();
        for (agent, knots) in knots.iter().enumerate() {
            let robot = instance.robot(agent)?;
            let is_known = robot.dynamics == "fleetyard.single-integrator/1";
            if !is_known || knots.iter().any(|knot| knot.time_s.is_nan()) {
                return None;
            }
            let segments = knots.windows(2).filter_map(|knots| {
                let (from, to) = (knots[0], knots[1]);
                let takes_s = to.time_s - from.time_s;
                let mut control = vec![
                    (to.x_m - from.x_m) / takes_s + aside,
                    (to.y_m - from.y_m) / takes_s,
                ];
                if robot.has_heading {
                    control.push((to.heading_rad - from.heading_rad) / takes_s);
                }
                (takes_s > 0.0).then_some((takes_s, control))
            });
            controls.push_agent(segments).ok()?;
        }
        Some(controls)
    }

    fn spoiled(&self, plan: Plan, instance: &Instance) -> Plan {
        let faster = if self.choice.mistake == Mistake::TooFast {
            0.5
        } else {
            1.0
        };
        let late = |number: usize, time_s: f64| match self.choice.mistake {
            Mistake::NanTimes if number > 0 => f64::NAN,
            _ => time_s * faster,
        };
        match plan {
            _ if self.choice.mistake == Mistake::OtherForm => {
                GridPlan::from_paths(vec![[0]; plan.agents()]).into()
            }
            Plan::Visits(visits) => {
                let path = |path: &[fleetyard_abi::Visit]| {
                    let mut path = path.to_vec();
                    if self.choice.mistake == Mistake::JumpsEdges && path.len() > 2 {
                        path.drain(1..path.len() - 1);
                    }
                    for (number, visit) in path.iter_mut().enumerate() {
                        visit.arrival_s = late(number, visit.arrival_s);
                        visit.departure_s *= faster;
                    }
                    path
                };
                Plan::Visits(visits.iter().map(path).collect())
            }
            Plan::Trajectories(motions) => {
                let path = |path: &[fleetyard_abi::Knot]| {
                    let mut path = path.to_vec();
                    for (number, knot) in path.iter_mut().enumerate() {
                        knot.time_s = late(number, knot.time_s);
                    }
                    path
                };
                let knots: KnotPlan = motions.knots().iter().map(path).collect();
                self.controls(&knots, instance)
                    .and_then(|controls| MotionPlan::new(knots.clone(), controls))
                    .map_or_else(|| knots.into(), Plan::from)
            }
            cells @ Plan::Cells(_) => cells,
        }
    }
}

/// The roadmap with the way back of every edge.
fn both_ways(roadmap: &RoadmapEnvironment) -> RoadmapEnvironment {
    let mut targets: Vec<Vec<u32>> = roadmap.edges.iter().map(<[u32]>::to_vec).collect();
    for (from, edges) in (0..).zip(roadmap.edges.iter()) {
        for to in edges {
            targets[*to as usize].push(from);
        }
    }
    for edges in &mut targets {
        edges.sort_unstable();
        edges.dedup();
    }
    RoadmapEnvironment::straight(
        roadmap.x_m.clone(),
        roadmap.y_m.clone(),
        targets.into_iter().collect(),
        roadmap.speed_m_per_s,
        roadmap.separation_m,
    )
}

/// Some agents of an instance; who has no goal stays.
fn of(instance: &Instance, agents: &[usize]) -> Instance {
    fn some<T: Clone>(all: &[T], agents: &[usize]) -> Vec<T> {
        let some = agents.iter().filter_map(|agent| all.get(*agent));
        some.cloned().collect()
    }
    fn ends<T: Clone>(goals: &Lists<T>, starts: &[T], agents: &[usize]) -> Lists<T> {
        let end = |agent: &usize| goals.get(*agent)?.last().or(starts.get(*agent)).cloned();
        Lists::single(agents.iter().filter_map(end).collect())
    }
    Instance {
        starts: some(&instance.starts, agents),
        goals: ends(&instance.goals, &instance.starts, agents),
        start_states: some(&instance.start_states, agents),
        goal_states: ends(&instance.goal_states, &instance.start_states, agents),
        robot_of: some(&instance.robot_of, agents),
        ..instance.clone()
    }
}

/// One plan of the plans of groups.
fn joined(agents: usize, groups: &[Vec<usize>], plans: &[Plan]) -> Plan {
    fn ordered<T: Clone>(
        agents: usize,
        groups: &[Vec<usize>],
        plans: impl Iterator<Item = Lists<T>>,
    ) -> Lists<T> {
        let mut paths = vec![Vec::new(); agents];
        for (group, plan) in groups.iter().zip(plans) {
            for (agent, path) in group.iter().zip(plan.iter()) {
                paths[*agent] = path.to_vec();
            }
        }
        paths.into_iter().collect()
    }
    let visits = plans.iter().filter_map(|plan| match plan {
        Plan::Visits(visits) => Some(visits.clone()),
        _ => None,
    });
    let knots = plans.iter().filter_map(|plan| match plan {
        Plan::Trajectories(motions) => Some(motions.knots().clone()),
        _ => None,
    });
    match plans.first() {
        Some(Plan::Visits(_)) => Plan::Visits(ordered(agents, groups, visits)),
        _ => ordered(agents, groups, knots).into(),
    }
}

/// Keeps the plan of a planner, and passes on everything else.
struct Own<'a> {
    sink: &'a dyn Sink,
    plan: Mutex<Option<Plan>>,
}

impl Sink for Own<'_> {
    fn submit_plan(&self, plan: PlanRef<'_>) -> Result<(), Rejected> {
        let mut own = self.plan.lock().unwrap_or_else(PoisonError::into_inner);
        *own = Some(plan.to_plan());
        Ok(())
    }

    fn submit_request(&self, request: &Request) -> Result<(), Rejected> {
        self.sink.submit_request(request)
    }

    fn metric(&self, name: &str, value: f64) {
        self.sink.metric(name, value);
    }

    fn note(&self, name: &str, text: &str) {
        self.sink.note(name, text);
    }

    fn log(&self, level: LogLevel, text: &str) {
        self.sink.log(level, text);
    }

    fn progress(&self, done: u64, total: u64) {
        self.sink.progress(done, total);
    }

    fn cancelled(&self) -> bool {
        self.sink.cancelled()
    }
}
