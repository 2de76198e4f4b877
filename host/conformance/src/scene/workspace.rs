//! Scenes in the plane.

use fleetyard_abi::{
    Environment, Footprint, Instance, Lists, Motion, MotionPlan, Mover, Plan, Request, Robot,
    SharedEnvironment, State, WorkspaceEnvironment,
};
use fleetyard_check::{
    ContinuousRule, ContinuousTask, ControlTask, MOST_DRIVEN_KNOTS, Near, Tolerance, TravelCosts,
    validate_trajectories,
};
use fleetyard_core::{Knot, TrajectoryPlan, check_controls};
use fleetyard_world::exact::Obstacles;
use fleetyard_world::{Bounds, ControlModel, Dynamics, Polygon, Pose, Shape, Workspace};

use super::robots::{disc, moved_by};
use super::{RADIUS_M, Scene, middle_m};
use crate::question::Question;
use crate::rules::{Arrival, Rules, VIOLATIONS, broken, other_form};
use crate::stop::Step;

const GOAL_TOLERANCE_M: f64 = 0.05;
const GOAL_TOLERANCE_RAD: f64 = 0.1;
const GOAL_TOLERANCE_RATE: f64 = 0.02;
const BESIDE_KNOTS: f64 = 0.01;

/// An instance in the plane, with a name.
#[derive(Debug, Clone)]
pub(crate) struct WorkspaceScene {
    name: String,
    workspace: WorkspaceEnvironment,
    robots: Vec<Robot>,
    robot_of: Vec<u32>,
    starts: Vec<State>,
    goals: Vec<Vec<State>>,
    crowded: bool,
}

/// The state of a robot that rests, headed along x.
fn at_rest(robot: &Robot, at: [f64; 2]) -> State {
    let mut numbers = at.to_vec();
    numbers.resize(robot.state_limits.len(), 0.0);
    State(numbers)
}

/// Corners of a rectangle from its lower left to its upper right corner.
fn corners([left, bottom, right, top]: [f64; 4]) -> [[f64; 2]; 4] {
    [[left, bottom], [right, bottom], [right, top], [left, top]]
}

impl WorkspaceScene {
    /// A floor of so many metres from the origin, with rectangles on it that stand, each `[left,
    /// bottom, right, top]`, and agents: robot, start and goal.
    pub(crate) fn new(
        name: &str,
        size_m: [f64; 2],
        obstacles: &[[f64; 4]],
        agents: Vec<(Robot, [f64; 2], [f64; 2])>,
    ) -> Self {
        let mut scene = Self {
            name: name.into(),
            workspace: WorkspaceEnvironment {
                min_m: [0.0, 0.0],
                max_m: size_m,
                obstacles: obstacles.iter().copied().map(corners).collect(),
                movers: Vec::new(),
            },
            robots: Vec::new(),
            robot_of: Vec::new(),
            starts: Vec::new(),
            goals: Vec::new(),
            crowded: false,
        };
        for (robot, start, goal) in agents {
            let state = |at: [f64; 2]| at_rest(&robot, at);
            scene.starts.push(state(start));
            scene.goals.push(vec![state(goal)]);
            let known = scene.robots.iter().position(|known| *known == robot);
            let model = known.unwrap_or(scene.robots.len());
            if known.is_none() {
                scene.robots.push(robot);
            }
            scene.robot_of.push(model as u32);
        }
        scene
    }

    /// The same with a disc that moves from place to place, each with the time in seconds.
    pub(crate) fn with_mover(mut self, radius_m: f64, knots: &[[f64; 3]]) -> Self {
        self.workspace.movers.push(Mover {
            footprint: Footprint::disc(radius_m),
            knots: knots
                .iter()
                .map(|[time_s, x, y]| [*time_s, *x, *y, 0.0])
                .collect(),
        });
        self
    }

    /// A scene on a grid: the floor of its free cells.
    pub(crate) fn of(scene: &Scene) -> Self {
        let grid = &scene.grid;
        let (rows, cols) = (grid.rows(), grid.cols());
        let is_blocked = |row: u32, col: u32| !grid.is_passable(row * cols + col);
        let mut obstacles = Vec::new();
        for row in 0..rows {
            let top = f64::from(rows - row);
            let mut col = 0;
            while col < cols {
                let begin = col;
                while col < cols && is_blocked(row, col) {
                    col += 1;
                }
                if col > begin {
                    obstacles.push([f64::from(begin), top - 1.0, f64::from(col), top]);
                }
                col += 1;
            }
        }
        let state = |cell: &u32| State(middle_m(grid, *cell).to_vec());
        let (mut robots, robot_of) = scene.robots();
        if robots.is_empty() {
            robots.push(disc(RADIUS_M));
        }
        let name = format!("{}, in the plane", scene.name);
        Self {
            robots,
            robot_of,
            starts: scene.starts.iter().map(state).collect(),
            goals: scene
                .goals
                .iter()
                .map(|goals| goals.iter().map(state).collect())
                .collect(),
            crowded: scene.crowded,
            ..Self::new(&name, [cols, rows].map(f64::from), &obstacles, Vec::new())
        }
    }

    fn robot(&self, agent: usize) -> &Robot {
        let model = self.robot_of.get(agent).copied().unwrap_or(0);
        &self.robots[model as usize]
    }

    /// The world as the host knows it.
    pub(crate) fn world(&self) -> Result<Workspace, String> {
        let own = &self.workspace;
        let polygon =
            |corners: &[[f64; 2]]| Polygon::new(corners).map_err(|error| error.to_string());
        let mover = |mover: &Mover| {
            let knots = mover.knots.iter();
            let knots: Vec<(f64, Pose)> = knots
                .map(|[time_s, x, y, heading]| (*time_s, Pose::new(*x, *y, *heading)))
                .collect();
            fleetyard_world::Mover::new(of_world(&mover.footprint), &knots)
                .map_err(|error| error.to_string())
        };
        Ok(Workspace {
            name: self.name.clone(),
            bounds: Bounds {
                min: own.min_m,
                max: own.max_m,
            },
            boundary: None,
            obstacles: own
                .obstacles
                .iter()
                .map(polygon)
                .collect::<Result<_, _>>()?,
            movers: own.movers.iter().map(mover).collect::<Result<_, _>>()?,
        })
    }
}

fn of_world(footprint: &Footprint) -> fleetyard_world::Footprint {
    if footprint.corners_m.is_empty() {
        let radius_m = footprint.radius_m;
        return fleetyard_world::Footprint::Disc { radius_m };
    }
    let vertices_m = footprint.corners_m.clone();
    fleetyard_world::Footprint::Polygon { vertices_m }
}

fn pose(State(numbers): &State, robot: &Robot) -> Pose {
    let number = |at: usize| numbers.get(at).copied().filter(|number| !number.is_nan());
    Pose::new(
        number(0).unwrap_or(0.0),
        number(1).unwrap_or(0.0),
        number(2).filter(|_| robot.has_heading).unwrap_or(0.0),
    )
}

impl Question for WorkspaceScene {
    fn name(&self) -> &str {
        &self.name
    }

    fn environment(&self) -> Step<SharedEnvironment> {
        let environment = Environment::from(self.workspace.clone());
        Ok(SharedEnvironment::new(environment.named(&self.name)))
    }

    fn instance(&self) -> Instance {
        let radii = self.robots.iter().map(|robot| robot.footprint.radius_m);
        let has_headings = self.robots.iter().any(|robot| robot.has_heading);
        Instance {
            start_states: self.starts.clone(),
            goal_states: self.goals.iter().cloned().collect(),
            robots: self.robots.clone(),
            robot_of: self.robot_of.clone(),
            motion: Motion::Dynamics,
            radius_m: radii.fold(0.0, f64::max),
            goal_tolerance_m: GOAL_TOLERANCE_M,
            goal_tolerance_rate: GOAL_TOLERANCE_RATE,
            dynamics_tolerance: BESIDE_KNOTS,
            goal_tolerance_rad: if has_headings {
                GOAL_TOLERANCE_RAD
            } else {
                0.0
            },
            ..Instance::default()
        }
    }

    fn first_agent(&self) -> Box<dyn Question> {
        let mut alone = self.clone();
        alone.robots = vec![self.robot(0).clone()];
        alone.robot_of.clear();
        alone.starts.truncate(1);
        alone.goals.truncate(1);
        Box::new(alone)
    }

    fn pair(&self) -> Step<Option<Box<dyn Question>>> {
        Ok(Some(Box::new(Self::of(&Scene::pair()?))))
    }

    fn moved_by(&self, dynamics: &'static str) -> Option<Box<dyn Question>> {
        let is_free = |robot: &Robot| robot.dynamics.is_empty();
        if !self.robots.iter().any(is_free) {
            return None;
        }
        let mut moved = self.clone();
        for robot in moved.robots.iter_mut().filter(|robot| is_free(robot)) {
            *robot = moved_by(robot.clone(), dynamics, 1.0);
        }
        let size = |agent: usize| moved.robot(agent).state_limits.len();
        let sizes: Vec<usize> = (0..moved.starts.len()).map(size).collect();
        for ((start, goals), size) in moved.starts.iter_mut().zip(&mut moved.goals).zip(sizes) {
            for State(numbers) in goals.iter_mut().chain([start]) {
                numbers.resize(size, 0.0);
            }
        }
        Some(Box::new(moved))
    }

    fn may_be_unknown(&self) -> bool {
        true
    }

    fn is_crowded(&self) -> bool {
        self.crowded
    }

    fn judge(&self, plan: &Plan, rules: Rules) -> Result<f64, String> {
        let Plan::Trajectories(motions) = plan else {
            return Err(other_form("trajectories", plan));
        };
        let control_models: Vec<Option<ControlModel>> = self
            .robots
            .iter()
            .map(|robot| ControlModel::new(robot).ok())
            .collect();
        let plan = self.motions(motions, &control_models)?;
        let agents = 0..self.starts.len();
        let bodies = self
            .robots
            .iter()
            .map(|robot| of_world(&robot.footprint).shape());
        let bodies: Vec<Shape> = bodies
            .collect::<Result<_, _>>()
            .map_err(|error| error.to_string())?;
        let model = |agent: usize| self.robot_of.get(agent).copied().unwrap_or(0) as usize;
        let shapes: Vec<&Shape> = agents.clone().map(|agent| &bodies[model(agent)]).collect();
        let starts = self.starts.iter().zip(agents.clone());
        let starts: Vec<Pose> = starts
            .map(|(start, agent)| pose(start, self.robot(agent)))
            .collect();
        // Who has no goal may end anywhere.
        let end = |agent: usize| {
            let last = (agent < plan.agents()).then(|| plan.knots(agent));
            last.map_or(Pose::at(0.0, 0.0), |knots| {
                let Knot {
                    x_m,
                    y_m,
                    heading_rad,
                    ..
                } = knots.get(knots.len() - 1);
                Pose::new(x_m, y_m, heading_rad.unwrap_or(0.0))
            })
        };
        let goals = self.goals.iter().enumerate();
        let goals: Vec<Pose> = goals
            .map(|(agent, goals)| {
                let goal = goals.last().map(|goal| pose(goal, self.robot(agent)));
                goal.unwrap_or_else(|| end(agent))
            })
            .collect();
        let models = agents.map(|agent| control_models[model(agent)].as_ref());
        let models: Vec<Option<&ControlModel>> = models.collect();
        // Of dynamics that the kit does not know there are no limits.
        let limits: Vec<Dynamics> = models
            .iter()
            .map(|model| model.map_or(Dynamics::UNLIMITED, ControlModel::dynamics))
            .collect();
        let states = |states: &mut dyn Iterator<Item = Option<&State>>| -> Vec<Vec<f64>> {
            let numbers = states.map(|state| state.map_or(Vec::new(), |state| state.0.clone()));
            numbers.collect()
        };
        let start_states = states(&mut self.starts.iter().map(Some));
        let goal_states = states(&mut self.goals.iter().map(|goals| goals.last()));
        let world = self.world()?;
        let obstacles = Obstacles::workspace(&world);
        let task = ContinuousTask {
            starts: Some(&starts),
            goals: (rules.arrival != Arrival::Free).then_some(&goals),
            limits: Some(&limits),
            controls: Some(ControlTask {
                models: &models,
                starts: &start_states,
                goals: if rules.arrival == Arrival::Free {
                    &[]
                } else {
                    &goal_states
                },
                tolerance: BESIDE_KNOTS,
                goal_rate: GOAL_TOLERANCE_RATE,
            }),
            tolerance: Tolerance {
                goal: Near {
                    place_m: GOAL_TOLERANCE_M,
                    heading_rad: GOAL_TOLERANCE_RAD,
                },
                ..Tolerance::default()
            },
            ..ContinuousTask::new(&shapes, &obstacles)
        };
        let verdict = validate_trajectories(&plan, &task, VIOLATIONS);
        let counts = |rule| !(rules.may_collide && rule == ContinuousRule::AgentContact);
        match verdict.violations.iter().find(|found| counts(found.rule)) {
            Some(found) => Err(broken(&found.sentence, found.rule)),
            None => Ok(TravelCosts::of(&plan).sum_of_costs_s),
        }
    }

    fn judge_request(&self, request: &Request) -> Result<(), String> {
        request.check(self.starts.len(), 0)
    }

    fn picture(&self) -> String {
        super::listed(self.starts.iter().zip(&self.goals).map(|(start, goals)| {
            let goal = goals
                .last()
                .map_or("anywhere".into(), |State(goal)| format!("{goal:?}"));
            format!("{:?} to {goal}", start.0)
        }))
    }
}

impl WorkspaceScene {
    /// The plan as the host keeps it, with knots where there are controls alone. Where a robot has
    /// headings all have, as far as the host is concerned: of those without one it does not matter.
    fn motions(
        &self,
        plan: &MotionPlan,
        models: &[Option<ControlModel>],
    ) -> Result<TrajectoryPlan, String> {
        let has_headings = self.robots.iter().any(|robot| robot.has_heading);
        let knots = plan.knots();
        let mut motions = TrajectoryPlan::with_capacity(knots.len(), Lists::items(knots).len());
        for (agent, own) in knots.iter().enumerate() {
            let driven = match plan.controls() {
                Some(controls) if own.is_empty() && agent < self.starts.len() => {
                    let model = self.robot_of.get(agent).copied().unwrap_or(0);
                    let model = models[model as usize].as_ref();
                    let model = model.ok_or("controls of a robot that moves in any way")?;
                    check_controls(controls).map_err(|error| error.to_string())?;
                    let driven =
                        model.drive(&self.starts[agent].0, controls.of(agent), MOST_DRIVEN_KNOTS);
                    let driven = driven.map_err(|error| {
                        format!("the controls of agent {agent} lead nowhere: {error}")
                    })?;
                    driven.knots
                }
                _ => Vec::new(),
            };
            let may_lack = agent >= self.starts.len() || !self.robot(agent).has_heading;
            let given = own.iter().map(|knot| Knot {
                time_s: knot.time_s,
                x_m: knot.x_m,
                y_m: knot.y_m,
                heading_rad: (!may_lack).then_some(knot.heading_rad),
            });
            let knots = given.chain(driven).map(|knot| Knot {
                heading_rad: has_headings.then(|| knot.heading_rad.unwrap_or(0.0)),
                ..knot
            });
            motions
                .push_path(knots)
                .map_err(|error| error.to_string())?;
        }
        match plan.controls() {
            Some(controls) => motions
                .with_controls(controls.clone())
                .map_err(|error| error.to_string()),
            None => Ok(motions),
        }
    }
}
