//! One robot after the other drives to its goal while all others rest.
//!
//! A robot goes a shortest way past corners of obstacles and past robots that rest, in a
//! visibility graph (Lozano-Perez and Wesley, "An Algorithm for Planning Collision-Free Paths
//! Among Polyhedral Obstacles", CACM 1979). Its enclosing circle stands for it. Simple and slow,
//! for nobody drives beside another. Put your own algorithm into `plan`.

use std::f64::consts::TAU;

use fleetyard_abi::sdk::{Failure, Options, Planner, Plugin, Sink, options_schema};
use fleetyard_abi::{
    Budget, Capabilities, Capability, Descriptor, Instance, Kind, Knot, KnotPlan, Robot,
    SharedEnvironment, Status, WorkspaceEnvironment,
};
use schemars::JsonSchema;
use serde::Deserialize;

fleetyard_abi::export! { planners: [InTurn] }

/// The options, as in `--option NAME=VALUE`. The host checks them before the planner starts.
#[derive(Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct InTurnOptions {
    /// Distance that robots keep from obstacles and from each other, in metres.
    #[schemars(range(min = 0.0, max = 1000.0))]
    clearance_m: f64,
    /// Speed of robots that have no limit, in metres per second.
    #[schemars(range(min = 0.001, max = 1000.0))]
    speed_m_per_s: f64,
}

impl Default for InTurnOptions {
    fn default() -> Self {
        Self {
            clearance_m: 0.001,
            speed_m_per_s: 1.0,
        }
    }
}

/// One robot after the other drives while the others rest.
pub struct InTurn {
    options: InTurnOptions,
}

/// The map.
pub struct Map(SharedEnvironment);

type Point = [f64; 2];

/// Something that the centre of who drives keeps away from: a segment and the distance to keep.
struct Wall {
    ends: [Point; 2],
    away_m: f64,
}

/// The obstacles of a robot that drives, as they are seen from its centre.
struct Ground<'a> {
    space: &'a WorkspaceEnvironment,
    radius_m: f64,
    walls: Vec<Wall>,
}

impl Plugin for InTurn {
    fn descriptor() -> Descriptor {
        Descriptor {
            version: env!("CARGO_PKG_VERSION").into(),
            // What the host may ask; docs/conformance.md lists all there is.
            capabilities: Capabilities::of(&[
                Capability::Continuous,
                Capability::Dynamics,
                Capability::Heterogeneous,
                Capability::Deterministic,
            ]),
            // The models of robots that it knows: those that set out and stop in no time.
            features: vec!["dynamics:fleetyard.single-integrator/1".into()],
            options_schema: options_schema::<InTurnOptions>(),
            ..Descriptor::new(
                Kind::Planner,
                env!("CARGO_PKG_NAME"),
                "One robot after the other drives while the others rest.",
            )
        }
    }

    fn create(options: Options<'_>) -> Result<Self, Failure> {
        Ok(Self {
            options: options.parse()?,
        })
    }
}

impl Planner for InTurn {
    type Map = Map;

    fn prepare(
        &mut self,
        environment: &SharedEnvironment,
        _: &Budget,
        _: &dyn Sink,
    ) -> Result<Map, Failure> {
        Ok(Map(environment.clone()))
    }

    fn plan(
        &mut self,
        map: &mut Map,
        instance: &Instance,
        _budget: &Budget,
        sink: &dyn Sink,
    ) -> Result<(), Failure> {
        let unknown = || Failure::new(Status::Unsupported, "this planner knows `continuous` only");
        let space = map.0.workspace().ok_or_else(unknown)?;
        let robots: Vec<&Robot> = (0..instance.agents())
            .map(|agent| instance.robot(agent).expect("a model for every agent"))
            .collect();
        let mut paths: Vec<Vec<Knot>> = std::iter::zip(&robots, &instance.start_states)
            .map(|(robot, state)| {
                vec![knot(
                    0.0,
                    [state.0[0], state.0[1]],
                    heading(robot, &state.0),
                )]
            })
            .collect();
        let mut left: Vec<usize> = (0..robots.len()).collect();
        let mut time_s = 0.0;
        while !left.is_empty() {
            let mut stuck = Vec::new();
            for &agent in &left {
                let place = |other: usize| position(&paths[other][paths[other].len() - 1]);
                let resting = (0..robots.len()).filter(|other| *other != agent);
                let resting = resting.map(|other| (place(other), robots[other].footprint.radius_m));
                let radius_m = robots[agent].footprint.radius_m + self.options.clearance_m;
                let ground = Ground::new(space, radius_m, resting);
                let goal = &instance.goal_states[agent][0].0;
                match ground.find_way(place(agent), [goal[0], goal[1]], sink)? {
                    Some(way) => {
                        time_s = self.drive(&mut paths[agent], &way, robots[agent], goal, time_s)
                    }
                    None => stuck.push(agent),
                }
            }
            if stuck.len() == left.len() {
                let reason = format!("{} robots have no way past those that rest", stuck.len());
                return Err(Failure::new(Status::GaveUp, reason));
            }
            left = stuck;
        }
        sink.submit(&paths.into_iter().collect::<KnotPlan>())?;
        Ok(())
    }
}

impl InTurn {
    /// Lets a robot drive a way, and turn at its end; when it is there.
    fn drive(
        &self,
        path: &mut Vec<Knot>,
        way: &[Point],
        robot: &Robot,
        goal: &[f64],
        mut time_s: f64,
    ) -> f64 {
        let speed_m_per_s = limit(robot, 0)
            .min(limit(robot, 1))
            .min(self.options.speed_m_per_s);
        let rest = path[path.len() - 1];
        if time_s > 0.0 {
            path.push(Knot { time_s, ..rest });
        }
        for pair in way.windows(2).filter(|pair| pair[0] != pair[1]) {
            time_s += distance(pair[0], pair[1]) / speed_m_per_s;
            path.push(knot(time_s, pair[1], rest.heading_rad));
        }
        let turn =
            (heading(robot, goal) - rest.heading_rad + TAU / 2.0).rem_euclid(TAU) - TAU / 2.0;
        // NaN for a robot without a heading.
        if turn.abs() > 0.0 {
            time_s += turn.abs() / limit(robot, 2).min(1.0);
            path.push(knot(time_s, way[way.len() - 1], rest.heading_rad + turn));
        }
        time_s
    }
}

impl<'a> Ground<'a> {
    /// The ground of a robot among others that rest, each with its radius.
    fn new(
        space: &'a WorkspaceEnvironment,
        radius_m: f64,
        resting: impl Iterator<Item = (Point, f64)>,
    ) -> Self {
        let mut walls = Vec::new();
        let mut keep = |from: Point, to: Point, other_m: f64| {
            walls.push(Wall {
                ends: [from, to],
                away_m: radius_m + other_m,
            });
        };
        for corners in space.obstacles.iter() {
            for (at, corner) in corners.iter().enumerate() {
                keep(*corner, corners[(at + 1) % corners.len()], 0.0);
            }
        }
        for (place, other_m) in resting {
            keep(place, place, other_m);
        }
        for mover in &space.movers {
            // Wherever it may ever be.
            for (at, [_, x, y, _]) in mover.knots.iter().enumerate() {
                let [_, to_x, to_y, _] = mover.knots[(at + 1).min(mover.knots.len() - 1)];
                keep([*x, *y], [to_x, to_y], mover.footprint.radius_m);
            }
        }
        Self {
            space,
            radius_m,
            walls,
        }
    }

    /// True if the robot may drive straight from a point to another one.
    fn is_free(&self, from: Point, to: Point) -> bool {
        let inside = |point: Point| {
            (0..2).all(|axis| {
                point[axis] - self.radius_m >= self.space.min_m[axis]
                    && point[axis] + self.radius_m <= self.space.max_m[axis]
            })
        };
        let mut walls = self.walls.iter();
        inside(from)
            && inside(to)
            && walls.all(|wall| between([from, to], wall.ends) >= wall.away_m)
            && !self
                .space
                .obstacles
                .iter()
                .any(|corners| is_in(corners, from))
    }

    /// A shortest way, found by A*; none if there is none.
    fn find_way(
        &self,
        start: Point,
        goal: Point,
        sink: &dyn Sink,
    ) -> Result<Option<Vec<Point>>, Failure> {
        const CORNERS: u32 = 12;
        let mut points = vec![start, goal];
        if !self.is_free(start, goal) {
            // Corners of a polygon round each end of a wall.
            let turn = TAU / f64::from(CORNERS);
            for wall in &self.walls {
                let reach = wall.away_m * (1.0 + 1e-6) / (turn / 2.0).cos();
                for end in wall.ends {
                    let corner = |number| {
                        let angle = f64::from(number) * turn;
                        [end[0] + reach * angle.cos(), end[1] + reach * angle.sin()]
                    };
                    let corners = (0..CORNERS).map(corner);
                    points.extend(corners.filter(|corner| self.is_free(*corner, *corner)));
                }
            }
        }
        let mut length_m = vec![f64::INFINITY; points.len()];
        let mut before = vec![0; points.len()];
        let mut done = vec![false; points.len()];
        length_m[0] = 0.0;
        loop {
            if sink.cancelled() {
                return Err(Failure::new(Status::TimedOut, "the time is up"));
            }
            let through = |at: &usize| length_m[*at] + distance(points[*at], goal);
            let open = (0..points.len()).filter(|at| !done[*at] && length_m[*at].is_finite());
            let Some(now) = open.min_by(|a, b| through(a).total_cmp(&through(b))) else {
                return Ok(None);
            };
            if now == 1 {
                break;
            }
            done[now] = true;
            for next in 0..points.len() {
                let new_m = length_m[now] + distance(points[now], points[next]);
                if !done[next] && new_m < length_m[next] && self.is_free(points[now], points[next])
                {
                    length_m[next] = new_m;
                    before[next] = now;
                }
            }
        }
        let mut way = vec![goal];
        let mut at = 1;
        while at != 0 {
            at = before[at];
            way.push(points[at]);
        }
        way.reverse();
        Ok(Some(way))
    }
}

fn knot(time_s: f64, [x_m, y_m]: Point, heading_rad: f64) -> Knot {
    Knot {
        time_s,
        x_m,
        y_m,
        heading_rad,
    }
}

fn position(knot: &Knot) -> Point {
    [knot.x_m, knot.y_m]
}

/// The heading of a state; NaN if the robot has none, or any will do.
fn heading(robot: &Robot, state: &[f64]) -> f64 {
    if robot.has_heading {
        state[2]
    } else {
        f64::NAN
    }
}

/// The amount that a control may have in either direction; infinite where there is no limit.
fn limit(robot: &Robot, control: usize) -> f64 {
    let limits = robot.control_limits.get(control).copied();
    let [least, most] = limits.unwrap_or_default();
    most.unwrap_or(f64::INFINITY)
        .min(-least.unwrap_or(f64::NEG_INFINITY))
}

fn distance(a: Point, b: Point) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// The distance of a point from a segment.
fn from_segment(point: Point, [from, to]: [Point; 2]) -> f64 {
    let along = [to[0] - from[0], to[1] - from[1]];
    let aside = [point[0] - from[0], point[1] - from[1]];
    let length = along[0] * along[0] + along[1] * along[1];
    let ahead = aside[0] * along[0] + aside[1] * along[1];
    let part = if length > 0.0 {
        (ahead / length).clamp(0.0, 1.0)
    } else {
        0.0
    };
    (aside[0] - part * along[0]).hypot(aside[1] - part * along[1])
}

/// The distance of two segments.
fn between(one: [Point; 2], two: [Point; 2]) -> f64 {
    if sides(one, two) < 0.0 && sides(two, one) < 0.0 {
        return 0.0; // they cross
    }
    let to_two = one.map(|end| from_segment(end, two));
    let to_one = two.map(|end| from_segment(end, one));
    to_two[0].min(to_two[1]).min(to_one[0]).min(to_one[1])
}

/// Negative if the ends of a segment are on both sides of a line.
fn sides([from, to]: [Point; 2], segment: [Point; 2]) -> f64 {
    let side = |point: Point| {
        (to[0] - from[0]) * (point[1] - from[1]) - (to[1] - from[1]) * (point[0] - from[0])
    };
    side(segment[0]) * side(segment[1])
}

/// True if a point is inside a polygon.
fn is_in(corners: &[Point], point: Point) -> bool {
    let crossed = corners.iter().enumerate().filter(|(at, c)| {
        let d = corners[(at + 1) % corners.len()];
        let along = (point[1] - c[1]) / (d[1] - c[1]);
        (c[1] > point[1]) != (d[1] > point[1]) && point[0] < c[0] + along * (d[0] - c[0])
    });
    crossed.count() % 2 == 1
}
