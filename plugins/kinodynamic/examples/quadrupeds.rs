//! Plans for random quadrupeds on an indoor floor by `cbs-rrt`: `quadrupeds N FIRST LAST SECONDS [OPTIONS [SVG]]` for N robots and
//! seeds from FIRST to LAST, each within so many seconds of this process. OPTIONS are those of the planner as JSON, SVG is the
//! file of a picture of the last plan.

use std::error::Error;
use std::fmt::Write as _;
use std::time::Instant;

use fleetyard_abi::Footprint;
use fleetyard_plugin_kinodynamic::plugin::{Member, Team};
use fleetyard_plugin_kinodynamic::robot::{Free, Goal, Robot, State};
use fleetyard_plugin_kinodynamic::rrt::Options;
use fleetyard_plugin_kinodynamic::rrt::edge::Walker;
use fleetyard_plugin_kinodynamic::rrt::search::{Outcome, Search};
use fleetyard_plugin_kinodynamic::scene::Scene;
use fleetyard_plugin_plane::Vector;
use fleetyard_plugin_plane::bins::Rectangle;
use fleetyard_plugin_plane::prioritised::World;
use fleetyard_plugin_plane::sssp::bodies::{Leg, Pose, together};
use fleetyard_plugin_spacetime::random::Random;

/// Length and width in metres, speed in m/s, acceleration in m/s²: Go2, Spot, ANYmal C as the host's presets have them.
const KINDS: [[f64; 4]; 3] = [
    [0.70, 0.31, 2.5, 2.5],
    [1.10, 0.50, 1.6, 1.6],
    [0.93, 0.53, 0.7, 0.75],
];

const COLOURS: [&str; 12] = [
    "#1f77b4", "#ff7f0e", "#2ca02c", "#d62728", "#9467bd", "#8c564b", "#e377c2", "#7f7f7f",
    "#bcbd22", "#17becf", "#1b4f8a", "#a05000",
];

fn quadruped([length, width, speed, acceleration]: [f64; 4]) -> Result<Robot, String> {
    use std::f64::consts::{FRAC_PI_2, PI};
    let (x, y) = (length / 2.0, width / 2.0);
    let either = |most: f64| [Some(-most), Some(most)];
    Robot::new(&fleetyard_abi::Robot {
        name: String::new(),
        footprint: Footprint {
            radius_m: libm::hypot(x, y),
            corners_m: vec![[x, y], [-x, y], [-x, -y], [x, -y]],
        },
        dynamics: "fleetyard.holonomic-2/1".to_owned(),
        has_heading: true,
        polar_state: false,
        polar_control: false,
        state_limits: vec![
            [None; 2],
            [None; 2],
            [None; 2],
            [Some(-speed / 2.0), Some(speed)],
            either(speed / 2.0),
            either(FRAC_PI_2),
        ],
        control_limits: vec![either(acceleration), either(acceleration), either(PI)],
        parameters: Vec::new(),
    })
}

/// Twelve by twelve metres: four walls inwards with passages between them, and a pillar in each quarter.
fn floor() -> World {
    let boxed = |x: f64, y: f64, width: f64, height: f64| {
        vec![
            Vector::new(x, y),
            Vector::new(x + width, y),
            Vector::new(x + width, y + height),
            Vector::new(x, y + height),
        ]
    };
    World {
        polygons: vec![
            boxed(5.9, 0.0, 0.2, 2.6),
            boxed(5.9, 9.4, 0.2, 2.6),
            boxed(0.0, 5.9, 2.6, 0.2),
            boxed(9.4, 5.9, 2.6, 0.2),
            boxed(5.5, 5.5, 1.0, 1.0),
            boxed(2.9, 2.9, 0.4, 0.4),
            boxed(8.7, 8.7, 0.4, 0.4),
        ],
        bounds: Rectangle {
            min: Vector::zeros(),
            max: Vector::repeat(12.0),
        },
        movers: Vec::new(),
    }
}

/// Robots of random kinds at random poses that are half a metre apart from all others.
fn team(world: &World, count: usize, seed: u64) -> Result<Team<'_>, String> {
    let mut random = Random::new(seed, 1);
    let scene = Scene::new(world);
    let mut members: Vec<Member> = Vec::new();
    while members.len() < count {
        let robot = quadruped(KINDS[random.below(3)])?;
        let space = scene.space(&robot.body, 1e-3);
        let roomy = scene.space(&robot.body, 0.2);
        let wide = robot.body.grown(0.25);
        let draw = |random: &mut Random, ends: fn(&Member) -> State| loop {
            let share = Vector::new(random.share(), random.share());
            let heading = (random.share() - 0.5) * std::f64::consts::TAU;
            let at = world.bounds.min + (world.bounds.max - world.bounds.min).component_mul(&share);
            let pose = Pose { at, heading };
            let leg = Leg::rest(pose, 1.0);
            let is_apart = |other: &Member| {
                together(
                    &wide,
                    &leg,
                    &other.robot.body.grown(0.25),
                    &Leg::rest(ends(other).pose(), 1.0),
                )
                .is_none()
            };
            if roomy.is_free(&pose) && members.iter().all(is_apart) {
                break State::rest(at, heading);
            }
        };
        let start = draw(&mut random, |member| member.start);
        let goal = draw(&mut random, |member| member.goal.state);
        members.push(Member {
            behind: None,
            body: robot.body.grown(0.5e-3),
            space,
            start,
            goal: Goal {
                state: goal,
                free: Free {
                    heading: false,
                    rates: [false; 3],
                    trailer: true,
                },
                place_m: 1e-6,
                heading_rad: 1e-6,
                rate: 1e-6,
            },
            robot,
        });
    }
    Ok(Team { scene, members })
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |at: usize| {
        arguments
            .get(at)
            .ok_or("too few arguments")
            .map(|text| text.parse::<f64>())
    };
    let (count, first, last, seconds) = (number(0)??, number(1)??, number(2)??, number(3)??);
    let options: Options = serde_json::from_str(arguments.get(4).map_or("{}", String::as_str))?;
    let world = floor();
    let mut solved = 0;
    let mut times = Vec::new();
    for seed in first as u64..=last as u64 {
        let team = team(&world, count as usize, seed)?;
        let walkers: Vec<Walker> = Walker::team(&team).into_iter().flatten().collect();
        let begin = Instant::now();
        let stop = || begin.elapsed().as_secs_f64() > seconds;
        let mut search = Search::new(&team, &walkers, &options, (seed, u64::MAX, 1 << 29), &stop);
        let outcome = search.solve();
        let taken = begin.elapsed().as_secs_f64();
        let Outcome::Solved(mut plans, constraints) = outcome else {
            println!(
                "{seed}: {outcome:?} after {taken:.2} s, {:?}",
                search.effort
            );
            continue;
        };
        solved += 1;
        times.push(taken);
        let courses: Vec<_> = plans.iter().map(|plan| plan.course.clone()).collect();
        let fault = team.fault(&courses);
        let sum = |plans: &[std::rc::Rc<fleetyard_plugin_kinodynamic::rrt::search::Plan>]| {
            plans.iter().map(|plan| plan.way.arrival()).sum::<f64>()
        };
        let cost = sum(&plans);
        let effort = search.effort;
        let mut rounds = options.rounds;
        while rounds > 0 && search.improve(&mut plans) {
            rounds -= 1;
        }
        let all = begin.elapsed().as_secs_f64();
        let edges: usize = plans.iter().map(|plan| plan.way.edges.len()).sum();
        println!(
            "{seed}: {taken:.2} s, cost {cost:.1}, {} constraints, {effort:?}, {fault:?}; improved {:.1} after {all:.2} s, {edges} motions, {:?}",
            constraints.len(),
            sum(&plans),
            team.fault(
                &plans
                    .iter()
                    .map(|plan| plan.course.clone())
                    .collect::<Vec<_>>()
            ),
        );
        if let Some(file) = arguments.get(5) {
            std::fs::write(file, picture(&world, &team, &plans))?;
        }
    }
    times.sort_by(f64::total_cmp);
    println!(
        "{solved} solved, median {:.2} s, most {:.2} s",
        times.get(times.len() / 2).copied().unwrap_or(f64::NAN),
        times.last().copied().unwrap_or(f64::NAN),
    );
    Ok(())
}

/// Bodies every half second, starts filled.
fn picture(
    world: &World,
    team: &Team<'_>,
    plans: &[std::rc::Rc<fleetyard_plugin_kinodynamic::rrt::search::Plan>],
) -> String {
    let mut svg = String::from(
        "<svg xmlns='http://www.w3.org/2000/svg' width='900' height='900' viewBox='0 0 12 12'><rect width='12' height='12' fill='white'/><g transform='matrix(1 0 0 -1 0 12)'>",
    );
    let points = |corners: &[Vector]| {
        let mut text = String::new();
        for at in corners {
            let _ = write!(text, "{:.3},{:.3} ", at.x, at.y);
        }
        text
    };
    for polygon in &world.polygons {
        let _ = write!(svg, "<polygon points='{}' fill='#444'/>", points(polygon));
    }
    for (agent, (member, plan)) in team.members.iter().zip(plans).enumerate() {
        let colour = COLOURS[agent % COLOURS.len()];
        let track = plan.course.track(&member.robot);
        let steps = (track.seconds() / 0.5).ceil() as u32;
        for step in 0..=steps {
            let pose = track.at(f64::from(step) * 0.5);
            let (sin, cos) = libm::sincos(pose.heading);
            let corners: Vec<Vector> = member
                .robot
                .body
                .corners
                .iter()
                .map(|at| pose.at + Vector::new(at.x * cos - at.y * sin, at.x * sin + at.y * cos))
                .collect();
            let fill = if step == 0 {
                0.5
            } else if step == steps {
                0.15
            } else {
                0.0
            };
            let width = if step == 0 || step == steps {
                0.04
            } else {
                0.01
            };
            let _ = write!(
                svg,
                "<polygon points='{}' fill='{colour}' fill-opacity='{fill}' stroke='{colour}' stroke-width='{width}'/>",
                points(&corners)
            );
        }
        let way: Vec<Vector> = track.knots.iter().map(|knot| knot.pose.at).collect();
        let _ = write!(
            svg,
            "<polyline points='{}' fill='none' stroke='{colour}' stroke-width='0.03'/>",
            points(&way)
        );
    }
    svg.push_str("</g></svg>\n");
    svg
}
