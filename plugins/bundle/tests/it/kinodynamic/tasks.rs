//! Problems of robots in the plane, from files and by hand.

#![allow(dead_code)]

use std::error::Error;
use std::fs;
use std::path::Path;

use fleetyard_abi::{Environment, Footprint, Instance, Robot, State, WorkspaceEnvironment};
use serde::Deserialize;

#[derive(Deserialize)]
struct Tasks {
    world: String,
    robots: Vec<Told>,
}

#[derive(Deserialize)]
struct Told {
    footprint: Shape,
    model: String,
    speed_m_per_s: f64,
    #[serde(default)]
    turn_rate_rad_per_s: f64,
    start: Vec<f64>,
    goal: Vec<f64>,
}

#[derive(Deserialize)]
#[serde(rename_all = "lowercase")]
enum Shape {
    Disc { radius_m: f64 },
    Rectangle { length_m: f64, width_m: f64 },
}

#[derive(Deserialize)]
struct World {
    bounds_m: [f64; 4],
    obstacles: Vec<Obstacle>,
}

#[derive(Deserialize)]
struct Obstacle {
    polygon: Vec<[f64; 2]>,
}

/// Robots in a world.
#[derive(Debug, Clone)]
pub(crate) struct Problem {
    pub(crate) environment: WorkspaceEnvironment,
    pub(crate) instance: Instance,
}

impl Problem {
    /// A world of so many metres to each side, with these obstacles.
    pub(crate) fn new(side: f64, obstacles: &[&[[f64; 2]]]) -> Self {
        Self {
            environment: WorkspaceEnvironment {
                min_m: [0.0, 0.0],
                max_m: [side, side],
                obstacles: obstacles.iter().map(|corners| corners.to_vec()).collect(),
                movers: Vec::new(),
            },
            instance: Instance {
                goal_tolerance_m: 1e-6,
                goal_tolerance_rad: 1e-6,
                goal_tolerance_rate: 1e-6,
                ..Instance::default()
            },
        }
    }

    /// With one more robot. Numbers of its states that are not given are zero.
    #[must_use]
    pub(crate) fn with(mut self, robot: Robot, start: &[f64], goal: &[f64]) -> Self {
        let size = robot.state_limits.len();
        let state = |numbers: &[f64]| {
            let zeros = std::iter::repeat(0.0);
            State(numbers.iter().copied().chain(zeros).take(size).collect())
        };
        let instance = &mut self.instance;
        instance.robot_of.push(instance.robots.len() as u32);
        instance.robots.push(robot);
        instance.start_states.push(state(start));
        instance.goal_states.push([state(goal)]);
        self
    }

    /// Goals are reached within this, in every number.
    #[must_use]
    pub(crate) fn within(mut self, tolerance: f64) -> Self {
        self.instance.goal_tolerance_m = tolerance;
        self.instance.goal_tolerance_rad = tolerance;
        self.instance.goal_tolerance_rate = tolerance;
        self
    }

    /// The first `count` robots of a file.
    pub(crate) fn read(file: &Path, count: usize) -> Result<Self, Box<dyn Error>> {
        let tasks: Tasks = serde_json::from_str(&fs::read_to_string(file)?)?;
        let world = file.parent().unwrap_or(Path::new(".")).join(&tasks.world);
        let world: World = serde_json::from_str(&fs::read_to_string(world)?)?;
        let [left, bottom, right, top] = world.bounds_m;
        let mut problem = Self::new(0.0, &[]);
        let obstacles = world.obstacles.into_iter();
        problem.environment = WorkspaceEnvironment {
            min_m: [left, bottom],
            max_m: [right, top],
            obstacles: obstacles.map(|obstacle| obstacle.polygon).collect(),
            movers: Vec::new(),
        };
        for told in tasks.robots.into_iter().take(count) {
            let body = match told.footprint {
                Shape::Disc { radius_m } => Footprint::disc(radius_m),
                Shape::Rectangle { length_m, width_m } => rectangle(length_m, width_m),
            };
            let (dynamics, other) = match &*told.model {
                "single-integrator" => ("fleetyard.single-integrator/1", told.speed_m_per_s),
                "unicycle-1" => ("fleetyard.unicycle/1", told.turn_rate_rad_per_s),
                other => return Err(format!("the model `{other}` is not known").into()),
            };
            let robot = robot(dynamics, body, &[told.speed_m_per_s, other], &[]);
            problem = problem.with(robot, &told.start, &told.goal);
        }
        Ok(problem)
    }

    /// Problems of K-CBS's authors (K-CBS-Demos: `Corridor10x10`, `Congested10x10`, `Empty32x32`), with unicycles of second
    /// order in place of their cars. Bodies may be half a metre beyond the bounds, as there, and have to come within half a metre
    /// of their goals.
    pub(crate) fn of_k_cbs(name: &str) -> Option<Self> {
        let square = |[x, y, length, width]: [f64; 4]| {
            [
                [x, y],
                [x + length, y],
                [x + length, y + width],
                [x, y + width],
            ]
        };
        let (side, body, boxes, tasks): (f64, _, &[[f64; 4]], &[[f64; 4]]) = match name {
            "corridor" => (
                10.0,
                rectangle(1.0, 1.0),
                &[[0.5, 2.0, 9.0, 0.5], [4.0, 5.0, 2.0, 2.0]],
                &[
                    [1.0, 0.5, 9.0, 0.5],
                    [1.0, 3.5, 9.0, 9.0],
                    [9.0, 0.5, 1.0, 0.5],
                    [9.0, 3.5, 1.0, 9.0],
                ],
            ),
            "congested" => (
                10.0,
                rectangle(1.0, 1.0),
                &[
                    [5.5, 1.25, 5.0, 1.0],
                    [2.0, 8.0, 1.0, 1.0],
                    [7.0, 6.0, 1.0, 2.0],
                    [9.0, 9.0, 1.0, 1.0],
                    [4.0, 4.0, 1.0, 1.0],
                    [0.0, 0.0, 1.0, 1.0],
                    [0.0, 5.5, 2.0, 1.0],
                    [7.0, 2.25, 1.0, 1.0],
                ],
                &[
                    [3.0, 0.5, 7.0, 0.5],
                    [8.5, 0.5, 5.0, 2.5],
                    [9.0, 7.0, 6.0, 7.0],
                    [1.0, 8.0, 9.0, 3.0],
                    [1.5, 4.5, 1.0, 8.0],
                    [9.0, 3.0, 9.0, 6.0],
                ],
            ),
            "empty" => (
                32.0,
                rectangle(0.7, 0.5),
                &[],
                &[
                    [11.0, 6.0, 7.0, 18.0],
                    [29.0, 9.0, 3.0, 5.0],
                    [9.0, 1.0, 13.0, 21.0],
                    [11.0, 16.0, 26.0, 15.0],
                    [3.0, 26.0, 24.0, 26.0],
                    [30.0, 28.0, 22.0, 18.0],
                    [2.0, 12.0, 14.0, 30.0],
                    [18.0, 12.0, 27.0, 3.0],
                    [19.0, 21.0, 30.0, 22.0],
                    [10.0, 22.0, 18.0, 4.0],
                ],
            ),
            _ => return None,
        };
        let mut problem = Self::new(side, &[]).within(0.5);
        problem.environment.obstacles = boxes.iter().map(|each| square(*each)).collect();
        problem.environment.min_m = [-0.5; 2];
        problem.environment.max_m = [side + 0.5; 2];
        for [x, y, goal_x, goal_y] in tasks {
            let dynamics = "fleetyard.unicycle-2/1";
            let robot = robot(dynamics, body.clone(), &[1.0, 1.0], &[1.0, 1.0]);
            let goal = [*goal_x, *goal_y, f64::NAN, f64::NAN, f64::NAN];
            problem = problem.with(robot, &[*x, *y], &goal);
        }
        Some(problem)
    }

    /// The environment.
    pub(crate) fn environment(&self) -> Environment {
        self.environment.clone().into()
    }
}

/// A rectangle about its middle.
pub(crate) fn rectangle(length_m: f64, width_m: f64) -> Footprint {
    let (x, y) = (length_m / 2.0, width_m / 2.0);
    Footprint {
        radius_m: x.hypot(y),
        corners_m: vec![[x, y], [-x, y], [-x, -y], [x, -y]],
    }
}

/// A robot with so much of each rate to both sides, and of each change where its dynamics have them. Single and double
/// integrators have a heading where there is a third rate.
pub(crate) fn robot(dynamics: &str, footprint: Footprint, rates: &[f64], changes: &[f64]) -> Robot {
    let both = |most: &[f64]| -> Vec<_> {
        let limits = most.iter().map(|most| [Some(-most), Some(*most)]);
        limits.collect()
    };
    let has_heading = !dynamics.contains("integrator") || rates.len() > 2;
    let mut state_limits = vec![[None; 2]; if has_heading { 3 } else { 2 }];
    let is_second = !changes.is_empty();
    if is_second {
        state_limits.extend(both(rates));
    }
    Robot {
        name: String::new(),
        footprint,
        dynamics: dynamics.to_owned(),
        has_heading,
        polar_state: false,
        polar_control: dynamics.contains("single"),
        state_limits,
        control_limits: both(if is_second { changes } else { rates }),
        parameters: Vec::new(),
    }
}
