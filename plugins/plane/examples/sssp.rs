//! Plans for discs by sampling and search: `sssp TASKS N [SECONDS [SEED [REFINEMENTS]]]` for the first N of a file of tasks in
//! the plane; `sssp point2d COUNT [SECONDS]` and `sssp point2d-many COUNT [SECONDS]` for random problems as the authors of SSSP drew
//! theirs.

#[path = "../../bundle/tests/it/plane/support.rs"]
mod support;

use std::error::Error;
use std::rc::Rc;
use std::time::Instant;

use fleetyard_plugin_plane::Vector;
use fleetyard_plugin_plane::bins::Rectangle;
use fleetyard_plugin_plane::obstacles::Disc;
use fleetyard_plugin_plane::sssp::Options;
use fleetyard_plugin_plane::sssp::bodies::{Body, Pose, Space};
use fleetyard_plugin_plane::sssp::order::{schedule, shorten};
use fleetyard_plugin_plane::sssp::refine::Refiner;
use fleetyard_plugin_plane::sssp::roadmap::{Roadmap, Robot, Sampler};
use fleetyard_plugin_plane::sssp::search::{Limits, Outcome, solve};
use fleetyard_plugin_plane::timing::Stop;
use fleetyard_plugin_spacetime::random::Random;

/// Random problems in a unit square as the authors' program draws them: from `robots`, radii, and obstacles, each from least to most.
struct Drawn {
    robots: [usize; 2],
    radius: [f64; 2],
    obstacles: [usize; 2],
    obstacle_radius: [f64; 2],
}

const POINT_2D: Drawn = Drawn {
    robots: [2, 8],
    radius: [0.025, 0.1],
    obstacles: [0, 10],
    obstacle_radius: [0.05, 0.1],
};

const CROWD: Drawn = Drawn {
    robots: [200, 200],
    radius: [0.0125, 0.0125],
    obstacles: [0, 0],
    obstacle_radius: [0.0, 0.0],
};

const POINT_2D_MANY: Drawn = Drawn {
    robots: [30, 30],
    radius: [1.0 / 64.0, 3.0 / 128.0],
    obstacles: [10, 10],
    obstacle_radius: [0.025, 0.04],
};

impl Drawn {
    fn problem(&self, seed: u64) -> (Vec<Robot>, Rectangle) {
        let mut random = Random::new(seed, 7);
        let bounds = Rectangle {
            min: Vector::zeros(),
            max: Vector::repeat(1.0),
        };
        loop {
            let mut unit = || random.below(1 << 32) as f64 / f64::from(u32::MAX);
            let whole = |[least, most]: [usize; 2], unit: &mut dyn FnMut() -> f64| {
                least + ((most - least + 1) as f64 * unit() * 0.999_999) as usize
            };
            let within = |[least, most]: [f64; 2], part: f64| least + (most - least) * part;
            let (robots, obstacles) = (
                whole(self.robots, &mut unit),
                whole(self.obstacles, &mut unit),
            );
            let discs: Vec<Disc> = (0..obstacles)
                .map(|_| Disc {
                    at: Vector::new(unit(), unit()),
                    radius: within(self.obstacle_radius, unit()),
                })
                .collect();
            let mut team: Vec<Robot> = Vec::new();
            for _ in 0..robots {
                let radius = within(self.radius, unit());
                let body = Body {
                    radius,
                    corners: Vec::new(),
                };
                let space = Rc::new(Space::new(body, &[], bounds, &discs));
                let mut free = |pose_of: &dyn Fn(&Robot) -> Pose| {
                    (0..20_000).find_map(|_| {
                        let pose = Pose {
                            at: Vector::new(unit(), unit()),
                            heading: 0.0,
                        };
                        let apart = |other: &Robot| {
                            let least = radius + other.space.body.radius;
                            (pose_of(other).at - pose.at).norm() > least
                        };
                        (space.is_free(&pose) && team.iter().all(apart)).then_some(pose)
                    })
                };
                let (start, goal) = (free(&|robot| robot.start), free(&|robot| robot.goal));
                let (Some(start), Some(goal)) = (start, goal) else {
                    break;
                };
                team.push(Robot {
                    space,
                    speed: 1.0,
                    turn_rate: 0.0,
                    start,
                    goal,
                });
            }
            if team.len() == robots {
                return (team, bounds);
            }
        }
    }
}

/// Solves problems within a time each, and says how many and how fast.
fn drawn(drawn: &Drawn, count: u64, seconds: f64) {
    let options = Options::default();
    let mut times = Vec::new();
    for seed in 0..count {
        let (robots, bounds) = drawn.problem(seed);
        let begin = Instant::now();
        let mut limits = Limits {
            nodes: u64::MAX,
            memory: 1 << 30,
            stop: &mut || begin.elapsed().as_secs_f64() >= seconds,
        };
        let mut sampler = Sampler::new(bounds, seed);
        let (outcome, ..) = solve(&robots, &mut sampler, &options, &mut limits);
        if matches!(outcome, Outcome::Solved(_)) {
            times.push(begin.elapsed().as_secs_f64());
        } else {
            println!("problem {seed} of {} robots: {outcome:?}", robots.len());
        }
    }
    times.sort_by(f64::total_cmp);
    let part = |share: f64| times.get((times.len() as f64 * share) as usize).copied();
    println!(
        "{} of {count} solved; median {:?} s, 90 %: {:?} s, most {:?} s",
        times.len(),
        part(0.5),
        part(0.9),
        times.last()
    );
}

fn main() -> Result<(), Box<dyn Error>> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    if let [kind, count, rest @ ..] = words.as_slice()
        && let Some((_, problems)) = [
            ("point2d", POINT_2D),
            ("point2d-many", POINT_2D_MANY),
            ("crowd", CROWD),
        ]
        .into_iter()
        .find(|(name, _)| name == kind)
    {
        let seconds = rest.first().map_or(Ok(30.0), |word| word.parse())?;
        drawn(&problems, count.parse()?, seconds);
        return Ok(());
    }
    let [tasks, discs, rest @ ..] = words.as_slice() else {
        return Err("sssp TASKS N [SECONDS [SEED [REFINEMENTS]]]".into());
    };
    let number = |at: usize, default| rest.get(at).map_or(Ok(default), |word| word.parse());
    let (seconds, seed, refinements) = (number(0, 30)?, number(1, 1)?, number(2, 0)?);
    let case = support::Case::read(tasks.as_ref(), discs.parse()?)?;
    let begin = Instant::now();
    let mut stop = || begin.elapsed().as_secs() >= seconds;
    let mut spaces: Vec<Rc<Space>> = Vec::new();
    let mut robots = Vec::new();
    for disc in &case.discs {
        let body = Body {
            radius: disc.radius,
            corners: Vec::new(),
        };
        let known = spaces.iter().find(|space| space.body == body).cloned();
        let space = known.unwrap_or_else(|| {
            let space = Space::new(body, &case.polygons, case.bounds, &[]);
            spaces.push(Rc::new(space));
            spaces[spaces.len() - 1].clone()
        });
        let pose = |at: Vector| Pose { at, heading: 0.0 };
        robots.push(Robot {
            space,
            speed: disc.speed,
            turn_rate: 0.0,
            start: pose(disc.start),
            goal: pose(disc.goal),
        });
    }
    let mut sampler = Sampler::new(case.bounds, seed);
    let options = Options::default();
    let mut limits = Limits {
        nodes: u64::MAX,
        memory: 1 << 30,
        stop: &mut stop,
    };
    let (outcome, roadmaps, effort) = solve(&robots, &mut sampler, &options, &mut limits);
    let found = begin.elapsed().as_secs_f64();
    let Outcome::Solved(mut moves) = outcome else {
        println!("{outcome:?}, {found:.4} s, {effort:?}");
        return Ok(());
    };
    let vertices: usize = roadmaps.iter().map(Roadmap::vertices).sum();
    let count = moves.len();
    shorten(&robots, &mut moves, &mut stop);
    let shortened = begin.elapsed().as_secs_f64();
    let courses = schedule(&robots, &moves);
    let mut refiner = Refiner::new(&robots, &roadmaps, &[], courses, seed, &mut stop);
    let [first, bound] = refiner.sums();
    let ready = begin.elapsed().as_secs_f64();
    let mut attempts = 0;
    while attempts < refinements && !refiner.is_done() && !stop() {
        refiner.attempt();
        attempts += 1;
    }
    let plans: Vec<Vec<Stop>> = refiner
        .courses()
        .iter()
        .map(|course| {
            let stops = std::iter::zip(&course.way, &course.times);
            let stops = stops.map(|(pose, [arrival, departure])| Stop {
                at: pose.at,
                arrival: *arrival,
                departure: *departure,
            });
            stops.collect()
        })
        .collect();
    let least = support::least_clearance(&case.discs, &plans);
    let last = begin.elapsed().as_secs_f64();
    println!(
        "bound {bound:.3}, first {first:.3}, last {:.3}; {found:.4} s, shortened after {shortened:.4} s, ready {ready:.4} s, \
         {attempts} attempts {last:.4} s; {count} moves, {} after; {vertices} vertices, {} nodes, {} generated, \
         {} rounds; least clearance {least:.9} m",
        refiner.sums()[0],
        moves.len(),
        effort.expanded,
        effort.generated,
        effort.rounds
    );
    Ok(())
}
