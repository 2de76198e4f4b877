//! Views as planners are given them through the contract, and the way back of their plans.

use fleetyard_abi::convert::wrong_agents;
use fleetyard_abi::{
    Environment, Footprint, GridEnvironment, Instance, KnotPlan, Limit, Lists, Motion, MotionPlan,
    Mover, Plan, RoadmapEnvironment, Robot, SharedEnvironment, State, VisitPlan,
    WorkspaceEnvironment,
};
use fleetyard_check::{MOST_DRIVEN_KNOTS, Pace};
use fleetyard_core::{
    Grid, InputError, Knot, RoadmapPlan, Separation, TrajectoryPlan, check_controls,
};
use fleetyard_sim::Fleet;
use fleetyard_sim::motion::{Car, Model};
use fleetyard_world::{Boundary, ControlModel, Dynamics, Shape, Trailer, Travel, Workspace};

use crate::judge::{GridTerms, Judged};
use crate::{GridView, Problem, RoadmapView, View};

/// Rules that a view leaves open.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlanTerms {
    /// Distance that robots on a grid keep.
    pub separation: Separation,
    /// Duration of a step on a grid in seconds.
    pub step_s: f64,
    /// Speeds of robots on a roadmap.
    pub pace: Pace,
}

impl GridView {
    /// Duration of a step in seconds: of a move at the speed that all robots have, or of a second where
    /// they have no limit.
    pub fn step_s(&self, problem: &Problem) -> f64 {
        let speed = problem.common_speed_m_per_s();
        if speed.is_finite() {
            self.cell_m / speed
        } else {
            1.0
        }
    }
}

impl View {
    /// Duration of a step in seconds: see [`GridView::step_s`]; a second in other views.
    pub fn step_s(&self, problem: &Problem) -> f64 {
        match self {
            Self::Grid(view) => view.step_s(problem),
            Self::Roadmap(_) | Self::Continuous => 1.0,
        }
    }

    /// The rules of the view where these are asked for: robots on a grid keep at least the distance that
    /// its cells are made for, and make a step at the speed that all of them have unless its duration is
    /// given.
    pub fn terms(
        &self,
        problem: &Problem,
        separation: Separation,
        pace: Pace,
        step_s: Option<f64>,
    ) -> PlanTerms {
        let own = match self {
            Self::Grid(view) => view.spec.separation,
            Self::Roadmap(_) | Self::Continuous => Separation::default(),
        };
        PlanTerms {
            separation: separation.max(own),
            step_s: step_s.unwrap_or_else(|| self.step_s(problem)),
            pace,
        }
    }

    /// The map as planners are told it. A step of a grid takes `step_s` seconds.
    pub fn environment(&self, problem: &Problem, step_s: f64) -> SharedEnvironment {
        let environment: Environment = match self {
            Self::Grid(view) => view.environment(step_s).into(),
            Self::Roadmap(view) => RoadmapEnvironment {
                workspace: Some(workspace(&problem.world)),
                ..view.environment()
            }
            .into(),
            Self::Continuous => workspace(&problem.world).into(),
        };
        SharedEnvironment::new(Environment {
            digest: self.digest(problem).to_string(),
            ..environment.named(problem.task.name.as_str())
        })
    }

    /// The instance as a planner is asked to solve it.
    pub fn instance(&self, problem: &Problem, terms: PlanTerms) -> Instance {
        let radius_m = problem.common_radius_m();
        match self {
            Self::Grid(view) => Instance {
                radius_m,
                strict: view.rule(terms.separation) == Separation::Strict,
                ..Instance::one_shot(
                    view.instance.starts().to_vec(),
                    view.instance.goals().to_vec(),
                )
            },
            Self::Roadmap(view) => Instance {
                motion: match terms.pace {
                    Pace::StopGo => Motion::StopGo,
                    Pace::Slower => Motion::Slower,
                },
                radius_m,
                allows_cycles: false,
                ..Instance::one_shot(view.starts.clone(), view.goals.clone())
            },
            Self::Continuous => problem.instance(radius_m),
        }
    }

    /// Judges the plan of a planner by the rules of the view and in the world; at most `limit`
    /// violations of each are described. Says why a plan is none that could be judged.
    pub fn judge(
        &self,
        problem: &Problem,
        plan: &Plan,
        terms: PlanTerms,
        limit: usize,
    ) -> Result<Judged, String> {
        match (self, plan) {
            (Self::Grid(view), Plan::Cells(plan)) => {
                let terms = GridTerms {
                    separation: terms.separation,
                    step_s: terms.step_s,
                };
                Ok(view.judge(problem, plan, terms, limit))
            }
            (Self::Roadmap(view), Plan::Visits(visits)) => {
                let plan = visits_of(visits)?;
                let judged = view.judge(problem, &plan, terms.pace, limit);
                judged.map_err(|error: InputError| error.to_string())
            }
            (Self::Continuous, Plan::Trajectories(motions)) => {
                Ok(problem.judge(&problem.motions(motions)?, limit))
            }
            _ => Err(format!(
                "the plan has the form `{}`, which is none for a view of the representation `{}`",
                plan.as_ref().field(),
                self.representation()
            )),
        }
    }
}

/// Visits of a planner as a plan, or the reason why they are none.
pub fn visits_of(visits: &VisitPlan) -> Result<RoadmapPlan, String> {
    let mut plan = RoadmapPlan::with_capacity(visits.len(), visits.items().len());
    for path in visits.iter() {
        let path = path.iter().copied();
        plan.push_path(path).map_err(|error| error.to_string())?;
    }
    Ok(plan)
}

/// Knots of a planner as a plan, or the reason why they are none. Where one robot has headings,
/// those of the others are 0.
fn trajectories_of(knots: &KnotPlan) -> Result<TrajectoryPlan, String> {
    let turns = knots.items().iter().any(|knot| !knot.heading_rad.is_nan());
    let mut plan = TrajectoryPlan::with_capacity(knots.len(), knots.items().len());
    for path in knots.iter() {
        let path = path.iter().map(|knot| Knot {
            time_s: knot.time_s,
            x_m: knot.x_m,
            y_m: knot.y_m,
            heading_rad: turns.then(|| {
                if knot.heading_rad.is_nan() {
                    0.0
                } else {
                    knot.heading_rad
                }
            }),
        });
        plan.push_path(path).map_err(|error| error.to_string())?;
    }
    Ok(plan)
}

impl GridView {
    fn environment(&self, step_s: f64) -> GridEnvironment {
        let grid = self.instance.grid();
        let connectivity = self.instance.connectivity();
        GridEnvironment {
            rows: grid.rows(),
            cols: grid.cols(),
            connectivity: connectivity.degree(),
            cell_size_m: self.cell_m,
            step_s,
            origin_m: self.corner_m,
            passable: grid
                .terrain()
                .iter()
                .map(|letter| Grid::letter_is_passable(*letter).into())
                .collect(),
            terrain: grid.terrain().to_vec(),
            moves: grid.move_masks(connectivity),
        }
    }
}

impl RoadmapView {
    fn environment(&self) -> RoadmapEnvironment {
        let vertices = 0..self.roadmap.vertices() as u32;
        let places = vertices
            .clone()
            .map(|vertex| self.roadmap.position_m(vertex));
        let (x_m, y_m) = places.unzip();
        let edges: Lists<u32> = vertices
            .map(|vertex| self.roadmap.neighbors(vertex).iter().copied())
            .collect();
        let apart_m = 2.0 * self.radius_m;
        RoadmapEnvironment::straight(x_m, y_m, edges, self.speed_m_per_s, apart_m)
    }
}

/// A world as planners are told it: what is beyond an edge that is no rectangle is obstacles.
fn workspace(world: &Workspace) -> WorkspaceEnvironment {
    let standing = world
        .obstacles
        .iter()
        .map(|polygon| polygon.vertices().to_vec());
    let boundary = world.boundary.iter();
    let beyond = boundary
        .flat_map(Boundary::outside)
        .map(|(pose, shape)| shape.corners(*pose).collect());
    let movers = world.movers.iter().map(|mover| Mover {
        footprint: footprint(mover.shape()),
        knots: mover
            .times_s()
            .iter()
            .zip(mover.poses())
            .map(|(time_s, pose)| [*time_s, pose.x, pose.y, pose.heading])
            .collect(),
    });
    WorkspaceEnvironment {
        min_m: world.bounds.min,
        max_m: world.bounds.max,
        obstacles: standing.chain(beyond).collect::<Lists<[f64; 2]>>(),
        movers: movers.collect(),
    }
}

fn footprint(shape: &Shape) -> Footprint {
    Footprint {
        radius_m: shape.effective_radius_m(),
        corners_m: shape.vertices().iter().map(|at| [at.x, at.y]).collect(),
    }
}

impl Problem {
    /// The kinds of robots as planners are told them.
    pub(crate) fn robots(&self) -> Vec<Robot> {
        robots_of(&self.fleet, |kind| self.kind_name(kind))
    }

    /// The state of a robot of an agent that rests at a place, with `any` as its heading where the task
    /// gives none; its trailer is in line then, or NaN as well.
    pub(crate) fn state(robot: &Robot, at: crate::State, any: f64) -> State {
        let mut numbers = vec![0.0; robot.state_limits.len()];
        (numbers[0], numbers[1]) = (at.x_m, at.y_m);
        if robot.has_heading {
            numbers[2] = at.heading_rad.unwrap_or(any);
        }
        if robot.dynamics == CAR_TRAILER {
            let in_line = if any.is_nan() { any } else { numbers[2] };
            numbers[3] = at.trailer_rad.unwrap_or(in_line);
        }
        State(numbers)
    }

    /// The motions of a planner as a plan, or the reason why they are none: an agent with controls
    /// alone moves from its start as they lead it.
    pub fn motions(&self, plan: &MotionPlan) -> Result<TrajectoryPlan, String> {
        let Some(controls) = plan.controls() else {
            return trajectories_of(plan.knots());
        };
        let (agents, robots) = (self.task.agents.len(), self.robots());
        if plan.agents() != agents {
            return Err(wrong_agents(plan.agents(), agents));
        }
        check_controls(controls).map_err(|error| error.to_string())?;
        let mut room = MOST_DRIVEN_KNOTS;
        let mut knots = KnotPlan::with_capacity(agents, plan.knots().items().len());
        for (agent, own) in plan.knots().iter().enumerate() {
            if !own.is_empty() {
                knots.push(own.iter().copied());
                continue;
            }
            let robot = &robots[self.fleet.profile_of()[agent] as usize];
            let start = Self::state(robot, self.task.agents[agent].start, 0.0);
            let wrong = |error| format!("the controls of agent {agent} lead nowhere: {error}");
            let model = ControlModel::new(robot).map_err(wrong)?;
            let driven = model
                .drive(&start.0, controls.of(agent), room)
                .map_err(wrong)?;
            room = room.saturating_sub(driven.knots.len());
            knots.push(driven.knots.iter().map(|knot| fleetyard_abi::Knot {
                time_s: knot.time_s,
                x_m: knot.x_m,
                y_m: knot.y_m,
                heading_rad: knot.heading_rad.unwrap_or(f64::NAN),
            }));
        }
        let plan = trajectories_of(&knots)?.with_controls(controls.clone());
        plan.map_err(|error| error.to_string())
    }

    fn instance(&self, radius_m: f64) -> Instance {
        let robots = self.robots();
        let state = |agent: usize, at: crate::State, any: f64| {
            Self::state(&robots[self.fleet.profile_of()[agent] as usize], at, any)
        };
        let agents = self.task.agents.iter().enumerate();
        let goal = |(number, agent): (usize, &crate::Agent)| [state(number, agent.goal, f64::NAN)];
        Instance {
            start_states: agents
                .clone()
                .map(|(number, agent)| state(number, agent.start, 0.0))
                .collect(),
            goal_states: agents.map(goal).collect(),
            robot_of: if robots.len() > 1 {
                self.fleet.profile_of().to_vec()
            } else {
                Vec::new()
            },
            motion: Motion::Dynamics,
            radius_m,
            goal_tolerance_m: self.task.goal_tolerance_m,
            goal_tolerance_rad: self.task.goal_tolerance_rad,
            goal_tolerance_rate: self.task.goal_tolerance_rate,
            dynamics_tolerance: self.task.dynamics_tolerance,
            robots,
            ..Instance::default()
        }
    }

    /// The name of a kind of robots; empty where a fleet file has none.
    fn kind_name(&self, kind: usize) -> String {
        match &self.task.fleet {
            crate::Fleets::Kinds(kinds) => kinds
                .get(kind)
                .map_or_else(String::new, |kind| kind.0.clone()),
            crate::Fleets::File(_) => String::new(),
        }
    }
}

/// The models of a fleet as planners are told them.
pub fn robots_of(fleet: &Fleet, name: impl Fn(usize) -> String) -> Vec<Robot> {
    let profiles = fleet.profiles().iter().zip(fleet.shapes()).enumerate();
    profiles
        .map(|(kind, (profile, shape))| match &profile.model {
            Model::Car(model) => car(&name(kind), shape, model),
            model => robot(&name(kind), shape, model.dynamics()),
        })
        .collect()
}

const CAR: &str = "fleetyard.car/1";
const CAR_TRAILER: &str = "fleetyard.car-trailer/1";

/// A car, with its trailer if it has one.
fn car(name: &str, shape: &Shape, model: &Car) -> Robot {
    let mut parameters = vec![model.wheelbase_m];
    if let Some(trailer) = &model.trailer {
        let Trailer {
            hitch_m,
            length_m,
            width_m,
            max_joint_rad,
        } = *trailer;
        parameters.extend([hitch_m, length_m, width_m, max_joint_rad]);
    }
    let steering = model.max_steering_rad;
    let towing = usize::from(model.trailer.is_some());
    Robot {
        name: name.into(),
        footprint: footprint(shape),
        dynamics: [CAR, CAR_TRAILER][towing].to_owned(),
        has_heading: true,
        polar_state: false,
        polar_control: false,
        state_limits: vec![[None, None]; 3 + towing],
        control_limits: vec![
            [
                limit(-model.max_reverse_m_per_s),
                limit(model.max_speed_m_per_s),
            ],
            [limit(-steering), limit(steering)],
        ],
        parameters,
    }
}

/// A robot with the dynamics that its limits make of it.
fn robot(name: &str, shape: &Shape, dynamics: Dynamics) -> Robot {
    let either = |most: f64| [limit(-most), limit(most)];
    let free: [Limit; 2] = [None, None];
    let (turn, turns) = (
        either(dynamics.turn_rad_per_s),
        either(dynamics.turn_acceleration_rad_per_s2),
    );
    let wheels = matches!(dynamics.travel, Travel::Wheels { .. });
    let has_heading = wheels || matches!(dynamics.travel, Travel::Body { .. }) || !shape.is_disc();
    // Velocities, and their changes.
    let (first, second, polar) = match dynamics.travel {
        Travel::Polar {
            speed,
            acceleration,
        } => (vec![either(speed); 2], vec![either(acceleration); 2], true),
        Travel::Axes {
            speed,
            acceleration,
        } => (vec![either(speed); 2], vec![either(acceleration); 2], false),
        Travel::Body {
            forward,
            backward,
            sideways,
            forward_acceleration,
            sideways_acceleration,
        } => (
            vec![[limit(-backward), limit(forward)], either(sideways)],
            vec![either(forward_acceleration), either(sideways_acceleration)],
            false,
        ),
        Travel::Wheels {
            forward,
            backward,
            acceleration,
            deceleration,
        } => (
            vec![[limit(-backward), limit(forward)]],
            vec![[limit(-deceleration), limit(acceleration)]],
            false,
        ),
    };
    let turning = |limits: Vec<[Limit; 2]>, turn: [Limit; 2]| -> Vec<[Limit; 2]> {
        limits
            .into_iter()
            .chain(has_heading.then_some(turn))
            .collect()
    };
    let (rates, changes) = (turning(first, turn), turning(second, turns));
    let is_second = changes.iter().flatten().any(Option::is_some);
    let name_of = |first: &str, second: &str| {
        let name = if is_second { second } else { first };
        format!("fleetyard.{name}/1")
    };
    let dynamics = match dynamics.travel {
        Travel::Polar { .. } | Travel::Axes { .. } => {
            name_of("single-integrator", "double-integrator")
        }
        Travel::Body { .. } => name_of("holonomic", "holonomic-2"),
        Travel::Wheels { .. } => name_of("unicycle", "unicycle-2"),
    };
    let mut state_limits = vec![free; if has_heading { 3 } else { 2 }];
    let control_limits = if is_second {
        state_limits.extend(rates);
        changes
    } else {
        rates
    };
    Robot {
        name: name.into(),
        footprint: footprint(shape),
        dynamics,
        has_heading,
        polar_state: polar && is_second,
        polar_control: polar,
        state_limits,
        control_limits,
        parameters: Vec::new(),
    }
}

/// A limit, unless it is infinite.
fn limit(value: f64) -> Limit {
    value.is_finite().then_some(value)
}
