//! Courses of teams that end sooner: trajectory optimisation.
//!
//! A guess is states and controls, which need not fit together: states may jump, robots overlap a little, goals be missed. One
//! robot after the other is improved among the motions of all others, again and again. The costs of a round so
//! grow with the number of robots, where a problem of all robots together has them grow with its cube (db-CBS: A. Moldagalieva,
//! J. Ortiz-Haro, M. Toussaint, W. Hönig, ICRA 2024). What is returned was found to be without a fault ([`Team::fault`]).
//!
//! - [`quadratic`]: programs along a chain of states; the problem of one robot is a sequence of them;
//! - [`linear`]: derivatives of steps;
//! - [`gap`]: signed distances of bodies.

pub mod gap;
mod guess;
pub mod linear;
pub mod matrix;
pub mod quadratic;
mod single;

use fleetyard_plugin_plane::sssp::bodies::{Leg, together};

use self::gap::{Shape, Walls};
pub use self::guess::Guess;
use self::guess::{SLOWEST, Steps};
use self::single::{Around, Effort, improve};
use crate::course::{Course, Track};
use crate::plugin::{Member, Team};
use crate::scene::clash;

/// Bounds of the work.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// Most rounds, in each of which every robot is improved once.
    pub rounds: u32,
    /// Most programs for a robot in a round.
    pub programs: u32,
    /// Steps of a course that lasts long; it may have a few times as many.
    pub steps: u32,
    /// A round that makes the sum of durations less by a smaller part than this is the last one.
    pub gain: f64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            rounds: 12,
            programs: 30,
            steps: 300,
            gain: 2e-3,
        }
    }
}

/// Figures.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Figures {
    /// Rounds.
    pub rounds: u64,
    /// Quadratic programs.
    pub programs: u64,
    /// Iterations of all programs.
    pub iterations: u64,
}

/// A robot between rounds.
#[derive(Debug, Clone)]
struct Lane {
    steps: Steps,
    /// The guess.
    begin: Steps,
    /// Its controls. Steps may be fewer than these at first, and lead to about the same.
    course: Course,
    /// Its motion as others see it.
    track: Track,
    /// Its controls lead to the goal, and nothing but perhaps other robots is in their way.
    is_sound: bool,
    /// It lasts not much shorter than before, and nothing near it changed since.
    is_settled: bool,
    /// Distance that it keeps from what it might touch between two samples, in metres.
    margin: f64,
    body_at_walls: Shape,
    body: Shape,
}

/// Fewest steps of a course.
const FEWEST_STEPS: f64 = 12.0;

/// A robot moves by no more than this part of its radius in a step, where that does not make too many of them.
const STEP: f64 = 0.35;

/// Distance that robots keep from all that is beside them at samples, in metres, and what is added where that is too little.
const MARGIN: [f64; 2] = [5e-4, 1e-3];

/// Times that the steps of a robot are made shorter in one round, and its margin larger.
const TRIES: u32 = 5;

/// Price of breaking constraints at the beginning, and its factor where a round leaves some broken.
const PRICE: [f64; 2] = [1.5, 2.0];

/// The price of a robot that does not reach its goal becomes so many times as high.
const DEARER: f64 = 4.0;

/// Rounds after which robots that still touch each other begin anew.
const PATIENCE: u64 = 3;

/// Half of the distance by which they are set aside at first, as a part of their radii; it is also what is added each time.
const ASIDE: f64 = 0.5;

/// Improves a guess for every robot. Returns courses without a fault, and figures; no courses if none were found. Where the
/// guess is without a fault, they last no longer than it in sum.
pub fn optimise(
    team: &Team<'_>,
    guess: &[Guess],
    options: &Options,
    stop: &mut dyn FnMut() -> bool,
) -> (Option<Vec<Course>>, Figures) {
    let mut both = guess.iter().zip(&team.members);
    if guess.len() != team.len()
        || !both.all(|(guess, member)| guess.is_sound(&member.start))
        || !starts_clear(team)
    {
        return (None, Figures::default());
    }
    let begin: Vec<Course> = guess.iter().map(Guess::course).collect();
    let best = team.fault(&begin).is_none().then_some(begin);
    let lanes = guess.iter().zip(&team.members).map(|(guess, member)| {
        let lane = Lane::new(&guess.begun(member), member, options);
        if best.is_none() {
            return lane;
        }
        let course = guess.course();
        Lane {
            track: course.track(&member.robot),
            course,
            is_sound: true,
            ..lane
        }
    });
    let mut rounds = Rounds {
        team,
        options,
        walls: Walls::new(team.scene.world),
        movers: team
            .scene
            .movers
            .iter()
            .map(|mover| Shape::new(&mover.body))
            .collect(),
        lanes: lanes.collect(),
        best,
        price: PRICE[0],
        asides: 0.0,
        figures: Figures::default(),
    };
    for _ in 0..options.rounds {
        if !rounds.next(stop) {
            break;
        }
    }
    (rounds.best, rounds.figures)
}

/// Nothing touches a robot where it begins; otherwise there is no plan.
fn starts_clear(team: &Team<'_>) -> bool {
    let rest = |member: &Member| Leg::rest(member.start.pose(), 1.0);
    team.members.iter().enumerate().all(|(agent, member)| {
        let mut others = team.members[agent + 1..].iter();
        let meets = |other: &Member| {
            together(&member.body, &rest(member), &other.body, &rest(other)).is_some()
        };
        member.space.is_free(&member.start.pose()) && !others.any(meets)
    })
}

/// Courses of a plan that end sooner in sum, and figures; no courses if none were found.
pub fn shortened(
    team: &Team<'_>,
    courses: &[Course],
    stop: &mut dyn FnMut() -> bool,
) -> (Option<Vec<Course>>, Figures) {
    // Its programs know neither steering nor trailers.
    if team.members.iter().any(|member| member.robot.car.is_some()) {
        return (None, Figures::default());
    }
    let both = courses.iter().zip(&team.members);
    let guess: Vec<Guess> = both
        .map(|(course, member)| Guess::of(course, &member.robot))
        .collect();
    let (found, figures) = optimise(team, &guess, &Options::default(), stop);
    let seconds = |courses: &[Course]| -> f64 { courses.iter().map(Course::seconds).sum() };
    let less = found.filter(|found| seconds(found) < seconds(courses));
    (less, figures)
}

struct Rounds<'a> {
    team: &'a Team<'a>,
    options: &'a Options,
    walls: Walls,
    movers: Vec<Shape>,
    lanes: Vec<Lane>,
    /// The best courses without a fault.
    best: Option<Vec<Course>>,
    price: f64,
    /// Times that robots were set aside.
    asides: f64,
    figures: Figures,
}

impl Rounds<'_> {
    /// Improves every robot once. False if there is no more to gain.
    fn next(&mut self, stop: &mut dyn FnMut() -> bool) -> bool {
        self.figures.rounds += 1;
        let before = self.seconds();
        let was_sound = self.best.is_some();
        let mut is_stopped = false;
        for agent in 0..self.lanes.len() {
            is_stopped = is_stopped || stop();
            if !is_stopped && !self.lanes[agent].is_settled {
                self.improve(agent, stop);
            }
        }
        if self.lanes.iter().all(|lane| lane.is_sound) {
            let courses: Vec<Course> = self.lanes.iter().map(|lane| lane.course.clone()).collect();
            if self.team.fault(&courses).is_none() {
                self.best = Some(courses);
                let gained = before - self.seconds();
                return !is_stopped && (!was_sound || gained > before * self.options.gain);
            }
        }
        if is_stopped {
            return false;
        }
        self.price *= PRICE[1];
        if self.figures.rounds.is_multiple_of(PATIENCE) {
            self.set_aside();
        }
        for agent in 0..self.lanes.len() {
            let lane = &self.lanes[agent];
            if !lane.is_sound || !self.touched(agent, &lane.track).is_empty() {
                self.lanes[agent].is_settled = false;
            }
        }
        true
    }

    /// Begins anew with all robots to the right of where they were, farther each time: who met head-on gets past.
    fn set_aside(&mut self) {
        self.price = PRICE[0];
        self.asides += 1.0;
        for (lane, member) in self.lanes.iter_mut().zip(&self.team.members) {
            lane.steps = lane.begin.clone();
            let metres = ASIDE * (1.0 + self.asides) * member.body.radius;
            lane.steps.guess = lane.begin.guess.aside(metres);
            lane.course = lane.steps.guess.course();
            lane.track = lane.steps.guess.track();
            lane.is_sound = false;
            lane.margin = MARGIN[0];
        }
    }

    fn seconds(&self) -> f64 {
        self.lanes.iter().map(|lane| lane.course.seconds()).sum()
    }

    /// Improves a robot among the motions of all others. While there is no plan without a fault the better of two broken
    /// motions is taken, afterwards only one that breaks nothing and ends sooner.
    fn improve(&mut self, agent: usize, stop: &mut dyn FnMut() -> bool) {
        let member = &self.team.members[agent];
        let movers = self.movers.iter().zip(&self.team.scene.movers);
        let others = self
            .lanes
            .iter()
            .enumerate()
            .filter(|(other, _)| *other != agent);
        let lane = &self.lanes[agent];
        let around = Around {
            walls: &self.walls,
            body_at_walls: &lane.body_at_walls,
            body: &lane.body,
            others: movers
                .map(|(shape, mover)| (shape, &mover.track))
                .chain(others.map(|(_, lane)| (&lane.body, &lane.track)))
                .collect(),
        };
        let mut steps = lane.steps.clone();
        let (mut margin, mut price) = (lane.margin, self.price);
        let mut found: Option<Track> = None;
        let most_steps = 2 * lane.begin.spans.len().max(self.options.steps as usize);
        for _ in 0..TRIES {
            let effort = Effort {
                margin,
                programs: self.options.programs,
                price,
            };
            let done = improve(member, &around, effort, &mut steps, stop);
            self.figures.programs += done.programs;
            self.figures.iterations += done.iterations;
            let course = steps.guess.course();
            let is_there = member.goal.is_reached(&course.end(&member.robot));
            if done.touches {
                break;
            }
            let finer = if is_there {
                if !course.is_allowed(&member.robot) {
                    break;
                }
                let track = course.track(&member.robot);
                let touched = self.touched(agent, &track);
                if touched.is_empty() {
                    found = Some(track);
                    break;
                }
                margin += MARGIN[1];
                steps.finer(&member.robot, &touched)
            } else {
                price *= DEARER;
                let longer = steps.extended(&member.robot);
                longer.unwrap_or_else(|| lane.steps.clone())
            };
            if finer.spans.len() > most_steps {
                break;
            }
            steps = finer;
        }
        let (is_sound, track) = match found {
            Some(track) => (true, track),
            None => (false, steps.guess.track()),
        };
        let course = steps.guess.course();
        let gained = lane.course.seconds() - course.seconds();
        let is_taken = self.best.is_none() || (is_sound && gained > 0.0);
        let is_settled = gained.abs() < self.options.gain * course.seconds();
        if is_taken && !(is_sound && is_settled) {
            self.wake(agent, &track);
        }
        let lane = &mut self.lanes[agent];
        lane.is_settled = is_settled && (is_sound || self.best.is_some());
        if is_taken {
            *lane = Lane {
                steps,
                course,
                track,
                is_sound,
                margin,
                ..lane.clone()
            };
        }
    }

    /// Robots that come near a track, or that came near the one that it replaces, have more to gain.
    fn wake(&mut self, agent: usize, track: &Track) {
        let reach = 2.0 * self.team.members[agent].body.radius;
        for other in 0..self.lanes.len() {
            let apart = reach + self.team.members[other].body.radius;
            let lane = &self.lanes[other];
            let near = |track: &Track| {
                let mut knots = track.knots.iter();
                knots.any(|knot| (knot.pose.at - lane.track.at(knot.time).at).norm() < apart)
            };
            if near(track) || near(&self.lanes[agent].track) {
                self.lanes[other].is_settled = false;
            }
        }
    }

    /// The times at which a robot touches what it should not.
    fn touched(&self, agent: usize, track: &Track) -> Vec<f64> {
        let member = &self.team.members[agent];
        let mut times = Vec::new();
        let mut time = 0.0;
        for leg in track.legs() {
            if !member.space.is_clear(&leg) {
                times.push(time + leg.duration / 2.0);
            }
            time += leg.duration;
        }
        let movers = self.team.scene.movers.iter();
        let robots = self.lanes.iter().zip(&self.team.members).enumerate();
        let robots = robots.filter(|(other, _)| *other != agent);
        let others = robots.map(|(_, (lane, member))| (&member.body, &lane.track));
        for other in movers
            .map(|mover| (&mover.body, &mover.track))
            .chain(others)
        {
            times.extend(clash((&member.body, track), other, 0.0, f64::INFINITY));
        }
        times
    }
}

impl Lane {
    fn new(guess: &Guess, member: &Member, options: &Options) -> Self {
        let total = guess.seconds();
        let usual = STEP * member.body.radius / member.robot.top_speed().max(SLOWEST);
        let step = usual
            .min(total / FEWEST_STEPS)
            .max(total / f64::from(options.steps))
            .max(1e-6);
        let steps = Steps::new(guess, &member.robot, step);
        Self {
            course: steps.guess.course(),
            track: steps.guess.track(),
            is_sound: false,
            is_settled: guess.segments.is_empty(),
            margin: MARGIN[0],
            body_at_walls: Shape::new(&member.space.body),
            body: Shape::new(&member.body),
            begin: steps.clone(),
            steps,
        }
    }
}
