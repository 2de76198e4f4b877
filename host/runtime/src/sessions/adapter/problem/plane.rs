//! The plane, with robots that the solver knows by name.

use std::path::Path;

use fleetyard_abi::sdk::Failure;
use fleetyard_abi::{
    Footprint, Instance, Knot, KnotPlan, Limit, Motion, MotionPlan, Plan, Robot, SharedEnvironment,
    State,
};
use fleetyard_core::formats::{DynobenchProblem, Format, read_dynobench, write_dynobench_problem};
use fleetyard_core::{InputError, MotionFile, read_motions};

use super::super::input::{Limits, PROBLEM_NAME, ProblemInput, RobotType, Size};
use super::super::manifest::{Manifest, Written};
use super::terms::{File, Problem, check_places, elsewhere, invalid, unsupported};

/// Lower left and upper right corner of a box along the axes.
type Corners = [[f64; 2]; 2];

/// Thickness in metres of the walls around the bounds.
const WALL_M: f64 = 1.0;

/// Difference between a number of a robot and that of its type that is rounding.
const SAME: f64 = 1e-9;

/// Free space among boxes along the axes.
pub(super) struct InPlane {
    environment: SharedEnvironment,
    bounds_m: Corners,
    boxes_m: Vec<Corners>,
}

impl InPlane {
    pub(super) fn new(
        manifest: &Manifest,
        environment: &SharedEnvironment,
    ) -> Result<Self, Failure> {
        let Some(workspace) = environment.workspace() else {
            return Err(elsewhere(manifest, "plans in the plane", environment));
        };
        if !workspace.movers.is_empty() {
            return Err(unsupported(manifest, "knows no moving obstacles"));
        }
        let obstacles = workspace.obstacles.iter().enumerate();
        let boxes_m = obstacles.map(|(number, corners)| {
            box_of(corners).ok_or_else(|| {
                let what = format!(
                    "knows boxes along the axes as obstacles, and obstacle {number} is none"
                );
                unsupported(manifest, &what)
            })
        });
        Ok(Self {
            bounds_m: [workspace.min_m, workspace.max_m],
            boxes_m: boxes_m.collect::<Result<_, _>>()?,
            environment: environment.clone(),
        })
    }

    fn types<'m>(manifest: &'m Manifest, instance: &Instance) -> Result<Vec<&'m str>, Failure> {
        let ProblemInput::Plane(input) = &manifest.input.problem else {
            return Ok(Vec::new());
        };
        let kinds = instance.robots.iter().map(|robot| {
            let found = input.robots.iter().find(|known| is_of(robot, known));
            found.map(|known| known.name.as_str()).ok_or_else(|| {
                let names: Vec<&str> = input.robots.iter().map(|known| &*known.name).collect();
                let name = match robot.name.as_str() {
                    "" => &robot.dynamics,
                    name => name,
                };
                let what = format!(
                    "plans for robots with exactly the footprint and the limits of {}, and `{name}` is none",
                    names.join(", ")
                );
                unsupported(manifest, &what)
            })
        });
        let kinds: Vec<&str> = kinds.collect::<Result<_, _>>()?;
        let agents = 0..instance.agents();
        let of_agents = agents.map(|agent| instance.robot_of.get(agent).copied().unwrap_or(0));
        of_agents
            .map(|kind| {
                let name = kinds.get(kind as usize).copied();
                name.ok_or_else(|| invalid("an agent without a model of robots"))
            })
            .collect()
    }
}

/// The box along the axes that a polygon is.
#[expect(
    clippy::float_cmp,
    reason = "a side that is nearly along an axis is not along it"
)]
fn box_of(corners: &[[f64; 2]]) -> Option<Corners> {
    let [a, b, c, d] = corners else {
        return None;
    };
    // Corners follow each other along the axes: first along x, or first along y.
    let first_x = a[1] == b[1] && b[0] == c[0] && c[1] == d[1] && d[0] == a[0];
    let first_y = a[0] == b[0] && b[1] == c[1] && c[0] == d[0] && d[1] == a[1];
    let low = [0, 1].map(|axis| a[axis].min(c[axis]));
    let high = [0, 1].map(|axis| a[axis].max(c[axis]));
    let is_box = (first_x || first_y) && low[0] < high[0] && low[1] < high[1];
    is_box.then_some([low, high])
}

/// Walls along the outside of the bounds. The bounds of a problem are for the middles of robots;
/// walls keep the bodies inside.
fn walls([low, high]: Corners) -> [Corners; 4] {
    let [[left, bottom], [right, top]] = [low, high];
    let out = [low.map(|at| at - WALL_M), high.map(|at| at + WALL_M)];
    [
        [out[0], [left, out[1][1]]],
        [[right, out[0][1]], out[1]],
        [out[0], [out[1][0], bottom]],
        [[out[0][0], top], out[1]],
    ]
}

fn near(one: f64, other: f64) -> bool {
    (one - other).abs() <= SAME * other.abs().max(1.0)
}

/// True if a robot has the footprint, the dynamics and the limits of a type.
fn is_of(robot: &Robot, known: &RobotType) -> bool {
    let pose = if robot.has_heading { 3 } else { 2 };
    let Some((pose, rates)) = robot.state_limits.split_at_checked(pose) else {
        return false;
    };
    // A type is free to be anywhere, and its limits are along the axes.
    robot.dynamics == known.dynamics
        && pose.iter().flatten().all(Option::is_none)
        && !robot.polar_state
        && !robot.polar_control
        && robot.parameters.is_empty()
        && have(rates, &known.rates)
        && have(&robot.control_limits, &known.controls)
        && is_body(&robot.footprint, known)
}

fn have(limits: &[[Limit; 2]], known: &[Limits]) -> bool {
    let is = |limit: Limit, known: f64| limit.is_some_and(|limit| near(limit, known));
    let mut pairs = limits.iter().zip(known);
    limits.len() == known.len()
        && pairs.all(|([least, most], Limits([low, high]))| is(*least, *low) && is(*most, *high))
}

fn is_body(footprint: &Footprint, known: &RobotType) -> bool {
    let corners = &footprint.corners_m;
    if let Some(Size(radius_m)) = known.disc_m {
        return corners.is_empty() && near(footprint.radius_m, radius_m);
    }
    let Some([Size(length_m), Size(width_m)]) = known.rectangle_m else {
        return false;
    };
    let at = |x: f64, y: f64| {
        let mut corners = corners.iter();
        corners.any(|corner| near(corner[0], x) && near(corner[1], y))
    };
    let (x, y) = (length_m / 2.0, width_m / 2.0);
    corners.len() == 4 && at(x, y) && at(x, -y) && at(-x, y) && at(-x, -y)
}

impl Problem for InPlane {
    fn check(&self, manifest: &Manifest, instance: &Instance) -> Result<(), Failure> {
        if instance.motion != Motion::Dynamics {
            return Err(unsupported(manifest, "plans for robots with dynamics"));
        }
        check_places(manifest, &self.environment, instance)?;
        let open = |state: &State| state.0.iter().any(|number| !number.is_finite());
        if let Some(agent) = instance
            .goal_states
            .iter()
            .position(|goals| goals.iter().any(open))
        {
            let what = format!("takes goals with a heading, which agent {agent} has not");
            return Err(unsupported(manifest, &what));
        }
        Self::types(manifest, instance).map(|_| ())
    }

    fn files(
        &self,
        manifest: &Manifest,
        instance: &Instance,
        _: u64,
        _: &Path,
    ) -> Result<Vec<File>, Failure> {
        let types = Self::types(manifest, instance)?;
        let ends = instance
            .start_states
            .iter()
            .zip(instance.goal_states.items());
        let robots = types.into_iter().zip(ends);
        let problem = DynobenchProblem {
            min_m: self.bounds_m[0],
            max_m: self.bounds_m[1],
            boxes_m: [&self.boxes_m[..], &walls(self.bounds_m)].concat(),
            robots: robots
                .map(|(name, (start, goal))| (name, &*start.0, &*goal.0))
                .collect(),
        };
        Ok(vec![(PROBLEM_NAME, write_dynobench_problem(&problem))])
    }

    fn plan_in(
        &self,
        manifest: &Manifest,
        answer: &[u8],
        instance: &Instance,
    ) -> Result<Plan, InputError> {
        let source = manifest.output.source();
        let plan = match &manifest.output.written {
            Written::As(Format::Dynobench) => read_dynobench(&source, answer)?,
            _ => match read_motions(&source, answer)? {
                MotionFile::Paths(file) => file.plan,
                MotionFile::Controls(file) => {
                    return Ok(Plan::Trajectories(file.controls.into()));
                }
            },
        };
        let agents = instance.agents();
        if plan.agents() != agents {
            let reason = format!("{} paths for {agents} agents", plan.agents());
            return Err(InputError::new(source, reason));
        }
        let paths = (0..agents).map(|agent| {
            let turns = instance.robot(agent).is_some_and(|robot| robot.has_heading);
            plan.knots(agent).iter().map(move |knot| Knot {
                time_s: knot.time_s,
                x_m: knot.x_m,
                y_m: knot.y_m,
                heading_rad: knot.heading_rad.filter(|_| turns).unwrap_or(f64::NAN),
            })
        });
        let knots: KnotPlan = paths.collect();
        Ok(plan
            .controls()
            .and_then(|controls| MotionPlan::new(knots.clone(), controls.clone()))
            .map_or_else(|| knots.into(), Plan::from))
    }

    fn places(&self) -> u64 {
        0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_are_along_the_axes() {
        let found = Some([[1.0, 2.0], [3.0, 5.0]]);
        let corners = [[1.0, 2.0], [3.0, 2.0], [3.0, 5.0], [1.0, 5.0]];
        for first in 0..4 {
            let mut turned = corners;
            turned.rotate_left(first);
            assert_eq!(box_of(&turned), found);
            turned.reverse();
            assert_eq!(box_of(&turned), found);
        }
        let others: [&[[f64; 2]]; 4] = [
            &corners[..3],
            &[[1.0, 2.0], [3.0, 2.000_000_1], [3.0, 5.0], [1.0, 5.0]],
            // Neither a trapezium nor a line is one.
            &[[1.0, 2.0], [3.0, 2.0], [2.5, 5.0], [1.0, 5.0]],
            &[[1.0, 2.0], [3.0, 2.0], [3.0, 2.0], [1.0, 2.0]],
        ];
        for corners in others {
            assert_eq!(box_of(corners), None, "{corners:?}");
        }
    }

    #[test]
    fn walls_are_around_the_bounds() {
        let around = walls([[0.0, -2.0], [5.0, 4.0]]);
        let inside = [
            [0.001, -1.999],
            [0.001, 3.999],
            [4.999, -1.999],
            [4.999, 3.999],
            [2.0, 1.0],
        ];
        let outside = [
            [-0.5, 1.0],
            [5.5, 1.0],
            [2.0, -2.5],
            [2.0, 4.5],
            [-0.9, -2.9],
            [5.9, 4.9],
        ];
        let is_in = |[x, y]: [f64; 2]| {
            let mut walls = around.iter();
            walls.any(|[low, high]| low[0] <= x && x <= high[0] && low[1] <= y && y <= high[1])
        };
        assert!(!inside.into_iter().any(is_in));
        assert!(outside.into_iter().all(is_in));
    }

    fn cart() -> (Robot, RobotType) {
        let robot = Robot {
            name: "cart".into(),
            footprint: Footprint {
                radius_m: 0.28,
                corners_m: vec![
                    [0.25, 0.125],
                    [-0.25, 0.125],
                    [-0.25, -0.125],
                    [0.25, -0.125],
                ],
            },
            dynamics: "fleetyard.unicycle-2/1".into(),
            has_heading: true,
            polar_state: false,
            polar_control: false,
            state_limits: vec![
                [None, None],
                [None, None],
                [None, None],
                [Some(-0.5), Some(0.5)],
                [Some(-0.5), Some(0.5)],
            ],
            control_limits: vec![[Some(-0.25), Some(0.25)]; 2],
            parameters: Vec::new(),
        };
        let known = RobotType {
            name: "unicycle_second_order_0".into(),
            dynamics: robot.dynamics.clone(),
            rectangle_m: Some([Size(0.5), Size(0.25)]),
            disc_m: None,
            rates: vec![Limits([-0.5, 0.5]); 2],
            controls: vec![Limits([-0.25, 0.25]); 2],
        };
        (robot, known)
    }

    #[test]
    fn a_robot_is_of_a_type_if_all_its_numbers_are() {
        let (robot, known) = cart();
        assert!(is_of(&robot, &known));
        let changes: [fn(&mut Robot); 8] = [
            |robot| robot.dynamics.push('1'),
            |robot| robot.has_heading = false,
            |robot| robot.polar_control = true,
            |robot| robot.state_limits[3][1] = Some(0.6),
            |robot| robot.state_limits[0][0] = Some(0.0),
            |robot| robot.state_limits.truncate(1),
            |robot| robot.control_limits[1][0] = None,
            |robot| robot.footprint.corners_m[2][0] = -0.3,
        ];
        for (number, change) in changes.into_iter().enumerate() {
            let mut robot = cart().0;
            change(&mut robot);
            assert!(!is_of(&robot, &known), "change {number}");
        }
        let disc = RobotType {
            rectangle_m: None,
            disc_m: Some(Size(0.28)),
            ..known
        };
        assert!(!is_of(&robot, &disc));
        let round = Robot {
            footprint: Footprint::disc(0.28),
            ..robot
        };
        assert!(is_of(&round, &disc));
    }
}
