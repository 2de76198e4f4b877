//! Plans of views, judged by the rules of the view and by footprints in the world of the task.
//!
//! A plan of a view is *lifted*: it becomes trajectories in the world, cells by their centres, visits
//! by their vertices. There the exact checker of [`fleetyard_world::exact`] decides whether footprints
//! stay clear of each other, of obstacles, of movers and of the edge. What it does not look at is what
//! a view has abstracted from: starts and goals beside the centre of a cell, and what bodies can do.
//!
//! Plans on grids and on roadmaps give no headings. A robot that is no disc is judged there by the
//! smallest disc around it, so that a valid plan is valid for every heading. Robots that are smaller
//! than r_com may be clear of each other in the world where the discs of the view are not.

use fleetyard_check::{
    ContinuousTask, ContinuousVerdict, ControlTask, Near, Pace, RoadmapTask, RoadmapVerdict, Terms,
    Tolerance, TrailerTask, TravelCosts, Verdict, validate_roadmap, validate_terms,
    validate_trajectories,
};
use fleetyard_core::{
    GridPlan, InputError, Knot, RoadmapPlan, RoadmapPlanError, Separation, TrajectoryError,
    TrajectoryPlan,
};
use fleetyard_world::exact::Obstacles;
use fleetyard_world::{ControlModel, Dynamics, Footprint, Pose, Shape};
use serde::Serialize;

use crate::{Agent, GridSpec, GridView, Problem, RoadmapView, State, cell_side_m};

/// The verdicts on a plan side by side, and its costs.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Judged {
    /// The verdict by the rules of the view; none where the view is the world.
    pub view: Option<ViewVerdict>,
    /// The verdict by footprints in the world; none for a plan that has no place there.
    pub world: Option<ContinuousVerdict>,
    /// The reason why a plan has no place in the world.
    pub no_place: Option<String>,
    /// Costs of the plan in the world.
    pub costs: Option<TravelCosts>,
    /// Costs in steps, of a plan on a grid.
    pub steps: Option<StepCosts>,
    /// The plan in the world.
    #[serde(skip)]
    pub lifted: Option<TrajectoryPlan>,
}

impl Judged {
    /// True if no verdict finds anything, and the plan has a place in the world.
    pub fn is_valid(&self) -> bool {
        let view = self.view.as_ref().is_none_or(ViewVerdict::is_valid);
        view && self.world.as_ref().is_some_and(|verdict| verdict.valid)
    }

    /// The violations that are described, by either judge.
    pub fn sentences(&self) -> impl Iterator<Item = String> {
        let view = self.view.iter().flat_map(ViewVerdict::sentences);
        let world = self.world.iter().flat_map(|verdict| &verdict.violations);
        let world = world.map(|violation| format!("in the world: {}", violation.sentence));
        view.chain(world).chain(self.no_place.clone())
    }

    fn new(
        view: Option<ViewVerdict>,
        lifted: Result<TrajectoryPlan, String>,
        judge: impl FnOnce(&TrajectoryPlan) -> ContinuousVerdict,
    ) -> Self {
        let (lifted, no_place) = match lifted {
            Ok(plan) => (Some(plan), None),
            Err(reason) => (None, Some(reason)),
        };
        Self {
            view,
            world: lifted.as_ref().map(judge),
            no_place,
            costs: lifted.as_ref().map(TravelCosts::of),
            steps: None,
            lifted,
        }
    }
}

/// The verdict by the rules of a view.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub enum ViewVerdict {
    /// By the rules of the grid.
    Grid(Verdict),
    /// By the distance of discs on the roadmap.
    Roadmap(RoadmapVerdict),
}

impl ViewVerdict {
    fn sentences(&self) -> Vec<String> {
        match self {
            Self::Grid(verdict) => {
                let found = verdict.violations.iter();
                found.map(|violation| violation.sentence.clone()).collect()
            }
            Self::Roadmap(verdict) => {
                let found = verdict.violations.iter();
                found.map(|violation| violation.sentence.clone()).collect()
            }
        }
    }

    /// True if the plan breaks no rule.
    pub fn is_valid(&self) -> bool {
        match self {
            Self::Grid(verdict) => verdict.valid,
            Self::Roadmap(verdict) => verdict.valid,
        }
    }
}

/// Costs of a plan on a grid in steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct StepCosts {
    /// Sum over agents of the step of their last arrival.
    pub sum_of_costs: u64,
    /// The latest last arrival.
    pub makespan: u64,
}

/// The terms by which plans on a grid view are judged.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GridTerms {
    /// The distance that robots keep, whatever the side of the view's cells.
    pub separation: Separation,
    /// Duration of a step in seconds.
    pub step_s: f64,
}

impl GridView {
    /// The plan in the world: from centre to centre of its cells, a step in `step_s` seconds.
    pub fn lift(&self, plan: &GridPlan, step_s: f64) -> Result<TrajectoryPlan, TrajectoryError> {
        let grid = self.instance.grid();
        let placed = TrajectoryPlan::from_grid(plan, grid, self.cell_m, step_s)?;
        let [left, bottom] = self.corner_m;
        let mut lifted = TrajectoryPlan::with_capacity(placed.agents(), placed.knot_count());
        for knots in placed.paths() {
            lifted.push_path(knots.iter().map(|knot| Knot {
                x_m: left + knot.x_m,
                y_m: bottom + knot.y_m,
                ..knot
            }))?;
        }
        Ok(lifted)
    }

    /// The rule that keeps robots apart as they are asked to be: cells that are wide enough keep them
    /// 2r apart by themselves.
    pub(crate) fn rule(&self, separation: Separation) -> Separation {
        let strict = GridSpec {
            separation: Separation::Strict,
            ..self.spec
        };
        // But for the rounding of the side.
        if self.cell_m >= cell_side_m(strict, self.radius_m) * (1.0 - 1e-12) {
            Separation::Rules
        } else {
            separation
        }
    }

    /// Judges a plan by the rules of the grid and in the world; at most `limit` violations of each are
    /// described.
    pub fn judge(
        &self,
        problem: &Problem,
        plan: &GridPlan,
        terms: GridTerms,
        limit: usize,
    ) -> Judged {
        let rules = Terms {
            separation: self.rule(terms.separation),
            ..(&self.instance).into()
        };
        let verdict = ViewVerdict::Grid(validate_terms(&rules, plan, limit));
        let lifted = self.lift(plan, terms.step_s);
        let lifted = lifted.map_err(|error| error.to_string());
        let judge = |plan: &TrajectoryPlan| problem.judge_footprints(plan, None, limit);
        Judged {
            steps: Some(StepCosts {
                sum_of_costs: plan.sum_of_costs(),
                makespan: plan.trimmed().horizon() as u64,
            }),
            ..Judged::new(Some(verdict), lifted, judge)
        }
    }
}

impl RoadmapView {
    /// The plan in the world: from vertex to vertex, along every edge at one speed.
    pub fn lift(&self, plan: &RoadmapPlan) -> Result<TrajectoryPlan, RoadmapPlanError> {
        plan.to_trajectories(&self.roadmap)
    }

    /// Judges a plan by the distance of discs of radius r_com and in the world; at most `limit`
    /// violations of each are described. Fails where r_com is no radius.
    pub fn judge(
        &self,
        problem: &Problem,
        plan: &RoadmapPlan,
        pace: Pace,
        limit: usize,
    ) -> Result<Judged, InputError> {
        let disc = Footprint::Disc {
            radius_m: self.radius_m,
        };
        let disc = disc.shape().map_err(|error| {
            InputError::new(problem.task.source.as_str(), error.to_string()).hint(error.hint())
        })?;
        let task = RoadmapTask {
            pace,
            starts: Some(&self.starts),
            goals: Some(&self.goals),
            ..RoadmapTask::new(&self.roadmap, &disc, self.speed_m_per_s)
        };
        let verdict = ViewVerdict::Roadmap(validate_roadmap(plan, &task, limit));
        let lifted = self.lift(plan).map_err(|error| error.to_string());
        let judge = |plan: &TrajectoryPlan| problem.judge_footprints(plan, None, limit);
        Ok(Judged::new(Some(verdict), lifted, judge))
    }
}

impl Problem {
    /// Judges a plan in the plane: footprints, starts and goals, and what bodies can do. At most
    /// `limit` violations are described. A goal may be missed by the task's tolerances, and where the
    /// task gives no heading any is right.
    pub fn judge(&self, plan: &TrajectoryPlan, limit: usize) -> Judged {
        let agents = &self.task.agents;
        let robots = self.robots();
        let kinds = self.fleet.profile_of();
        let models: Vec<Option<ControlModel>> = robots
            .iter()
            .map(|robot| ControlModel::new(robot).ok())
            .collect();
        let states = |pick: fn(&Agent) -> State, any: &dyn Fn(usize) -> f64| {
            let state = |(number, agent): (usize, &Agent)| {
                let robot = &robots[kinds[number] as usize];
                Self::state(robot, pick(agent), any(number)).0
            };
            agents.iter().enumerate().map(state).collect()
        };
        let first = |agent: usize| {
            let planned = (agent < plan.agents()).then(|| plan.knots(agent).get(0).heading_rad);
            planned.flatten().unwrap_or(0.0)
        };
        let aims = Aims {
            models: kinds
                .iter()
                .map(|kind| models[*kind as usize].as_ref())
                .collect(),
            start_states: states(|agent| agent.start, &first),
            goal_states: states(|agent| agent.goal, &|_| f64::NAN),
            goal_rate: self.task.goal_tolerance_rate,
            beside_knots: self.task.dynamics_tolerance,
            starts: self.poses(plan, |agent| agents[agent].start, |knots| knots[0]),
            goals: self.poses(
                plan,
                |agent| agents[agent].goal,
                |knots| knots[knots.len() - 1],
            ),
            limits: (0..agents.len())
                .map(|agent| self.fleet.model(agent).dynamics())
                .collect(),
            tolerance: Tolerance {
                goal: Near {
                    place_m: self.task.goal_tolerance_m,
                    heading_rad: self.task.goal_tolerance_rad,
                },
                ..Tolerance::default()
            },
        };
        let judge = |plan: &TrajectoryPlan| self.judge_footprints(plan, Some(&aims), limit);
        Judged::new(None, Ok(plan.clone()), judge)
    }

    /// A state of every agent, with the heading of the plan where the task has none.
    fn poses(
        &self,
        plan: &TrajectoryPlan,
        state: impl Fn(usize) -> State,
        pick: impl Fn(&[f64]) -> f64,
    ) -> Vec<Pose> {
        let pose = |agent: usize| {
            let State {
                x_m,
                y_m,
                heading_rad,
                ..
            } = state(agent);
            let is_planned = agent < plan.agents();
            let own = || plan.knots(agent).heading_rad.map(&pick);
            let own = is_planned.then(own).flatten();
            Pose::new(x_m, y_m, heading_rad.or(own).unwrap_or(0.0))
        };
        (0..self.task.agents.len()).map(pose).collect()
    }

    /// Judges a plan by footprints, and by aims where they are given.
    fn judge_footprints(
        &self,
        plan: &TrajectoryPlan,
        aims: Option<&Aims<'_>>,
        limit: usize,
    ) -> ContinuousVerdict {
        let agents = 0..self.task.agents.len();
        let discs: Vec<Shape> = agents
            .clone()
            .map(|agent| self.fleet.enclosing_disc(agent))
            .collect();
        let headed = plan.has_headings();
        let shapes: Vec<&Shape> = if headed {
            agents
                .clone()
                .map(|agent| self.fleet.shape(agent))
                .collect()
        } else {
            discs.iter().collect()
        };
        let start_rad = |agent: usize| {
            let State {
                heading_rad,
                trailer_rad,
                ..
            } = self.task.agents[agent].start;
            let planned = (agent < plan.agents()).then(|| plan.knots(agent).get(0).heading_rad);
            let in_line = || planned.flatten().unwrap_or(0.0);
            trailer_rad.or(heading_rad).unwrap_or_else(in_line)
        };
        // A body without a heading is the disc that holds its trailer as well.
        let trailers = agents.filter(|_| headed).map(|agent| {
            let (trailer, shape) = self.fleet.trailer(agent)?;
            let goal_rad = self.task.agents[agent].goal.trailer_rad;
            Some(TrailerTask {
                trailer,
                shape,
                start_rad: start_rad(agent),
                goal_rad: goal_rad.unwrap_or(f64::NAN),
            })
        });
        let trailers: Vec<Option<TrailerTask<'_>>> = trailers.collect();
        let obstacles = Obstacles::workspace(&self.world);
        let footprints = ContinuousTask {
            trailers: &trailers,
            ..ContinuousTask::new(&shapes, &obstacles)
        };
        let task = match aims {
            None => footprints,
            Some(aims) => ContinuousTask {
                starts: Some(&aims.starts),
                goals: Some(&aims.goals),
                limits: Some(&aims.limits),
                controls: Some(ControlTask {
                    models: &aims.models,
                    starts: &aims.start_states,
                    goals: &aims.goal_states,
                    tolerance: aims.beside_knots,
                    goal_rate: aims.goal_rate,
                }),
                tolerance: aims.tolerance,
                ..footprints
            },
        };
        validate_trajectories(plan, &task, limit)
    }
}

/// The demands of a task on plans in the plane, beside footprints.
struct Aims<'a> {
    models: Vec<Option<&'a ControlModel>>,
    start_states: Vec<Vec<f64>>,
    goal_states: Vec<Vec<f64>>,
    goal_rate: f64,
    beside_knots: f64,
    starts: Vec<Pose>,
    goals: Vec<Pose>,
    limits: Vec<Dynamics>,
    tolerance: Tolerance,
}
