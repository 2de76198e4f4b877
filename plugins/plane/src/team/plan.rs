//! Teams of discs in the plane: a first plan by priorities that give way, and better ones by large neighbourhood search.
//!
//! One disc after the other takes the earliest way among those that have one ([`super::search`]); those that have none yet stand at
//! their starts for a while, so that they have the time to get away. A disc that finds no way takes one through others, and those it
//! meets lose theirs and are planned anew after it. What a disc costs whoever wants to pass through it grows each time that it found
//! no way, so that the same discs do not push each other out for ever (the ejections of Y. Nagata, O. Bräysy, "A powerful route
//! minimization heuristic for the vehicle routing problem with time windows", Operations Research Letters 37(5), 2009; collisions
//! that are allowed and then repaired: J. Li, Z. Chen, D. Harabor, P. J. Stuckey, S. Koenig, AAAI 2022).
//!
//! A plan is improved as by J. Li, Z. Chen, D. Harabor, P. J. Stuckey, S. Koenig, "Anytime multi-agent path finding via large
//! neighborhood search", IJCAI 2021: a few discs are taken out and planned again, and the outcome is kept if it is cheaper.

use std::collections::VecDeque;

use fleetyard_plugin_spacetime::plugin::MEMORY;
use fleetyard_plugin_spacetime::random::Random;

use super::ground::{Course, Ground};
use super::search::{Control, Driver, Field, Search};
use super::traffic::Traffic;
use crate::Vector;
use crate::obstacles::{self, Obstacles};
use crate::prioritised::{Disc, World};
use crate::tangent::Tangents;
use crate::timing::{Stop, obstructions};

/// Bounds of the search, and its choices.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Effort {
    /// Metres that discs keep from obstacles and from each other beyond touching, where there is room for it.
    pub clearance: f64,
    /// Most discs to plan anew at a time.
    pub neighborhood: usize,
    /// Most neighbourhoods to plan anew.
    pub rounds: u64,
    /// Bytes to use; 0 for as many as usual.
    pub memory: u64,
    /// Of all that is drawn.
    pub seed: u64,
}

/// Result of planning.
#[derive(Debug, Clone, PartialEq)]
pub enum Outcome {
    /// The last plan that was told of is the best.
    Solved,
    /// So many discs lost their ways to others, and still not all have one.
    GaveUp(u64),
    /// This disc has no way, whatever the others do.
    NoWay(usize),
    /// A limit was met before there was a plan.
    Stopped,
}

/// Figures of a run.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Figures {
    /// Discs that lost their ways to others before there was a plan.
    pub ejections: u64,
    /// Neighbourhoods that were planned anew.
    pub rounds: u64,
}

/// Discs keep so much more distance from each other, as a share of their radii: times are rounded.
const MARGIN: f64 = 1e-9;
/// Longest turn of an arc that is one place, in radians, on a way that is found only so: two degrees.
const FINE: f64 = std::f64::consts::PI / 90.0;
/// Seconds that a disc without a way stands at its start, in times that it takes to drive its own diameter.
const STANDING: f64 = 1.0;
/// Seconds that a disc is worth to one that passes through it, and that one at its start is.
const WORTH: f64 = 4.0;
/// States of a search that finds a way soon if it finds one, in places of the ground.
const SOON: u64 = 4;
/// Ejections for each disc after which an attempt is given up.
const EJECTIONS: u64 = 40;
/// Attempts, the first of them with clearance.
const ATTEMPTS: u64 = 6;
/// Neighbourhoods between plans that are told of, at least.
const REPORT: u64 = 64;

/// The ground of the discs of one radius.
struct Known {
    radius: f64,
    clearance: f64,
    ground: Ground,
    /// Ways that its places alone did not give.
    ways: Vec<Vec<Vector>>,
}

/// Those to keep clear of.
#[derive(Clone, Copy, PartialEq)]
enum Who {
    All,
    Movers,
    Team,
}

/// Plans for discs in a world, and calls `tell` with every plan that is better than the ones before.
pub fn plan(
    world: &World,
    discs: &[Disc],
    effort: Effort,
    control: &mut Control<'_>,
    tell: &mut dyn FnMut(&[Vec<Stop>]),
) -> (Outcome, Figures) {
    let mut figures = Figures::default();
    let mut random = Random::new(effort.seed, STREAM);
    let mut ejections = 0;
    for attempt in 0..ATTEMPTS {
        let clearance = if attempt == 0 { effort.clearance } else { 0.0 };
        let made = Team::new(world, discs, (clearance, effort.memory), control);
        let mut team = match made {
            Ok(team) => team,
            Err(outcome) => return (outcome, figures),
        };
        let solved = team.first(attempt, &mut random, control, &mut figures);
        if solved {
            tell(&team.plans);
            team.improve(effort, &mut random, control, &mut figures, tell);
            return (Outcome::Solved, figures);
        }
        if control.ended() {
            return (Outcome::Stopped, figures);
        }
        ejections = figures.ejections;
    }
    (Outcome::GaveUp(ejections), figures)
}

/// Bytes for a place: its lines, and for each disc its distance to the goal.
const PLACE: u64 = 2048;
const DISTANCE: u64 = 16;
/// Bytes for a state and what is left to be tried from there.
const STATE: u64 = 2048;

/// Random stream of plans.
const STREAM: u64 = 1 << 17;

/// A team under way.
struct Team<'a> {
    discs: &'a [Disc],
    /// The discs, then movers.
    bodies: Vec<Disc>,
    clearance: f64,
    grounds: Vec<Known>,
    /// The ground of each disc.
    ground_of: Vec<usize>,
    courses: Vec<Course>,
    traffic: Traffic,
    search: Search,
    /// Most bays of a ground.
    most_bays: usize,
    plans: Vec<Vec<Stop>>,
    /// The earliest arrival of each disc, were it alone.
    least: Vec<f64>,
    alone: Vec<Vec<Stop>>,
}

impl<'a> Team<'a> {
    fn new(
        world: &World,
        discs: &'a [Disc],
        (clearance, memory): (f64, u64),
        control: &mut Control<'_>,
    ) -> Result<Self, Outcome> {
        let memory = if memory == 0 { MEMORY } else { memory };
        let per_place = PLACE + DISTANCE * discs.len() as u64;
        let mut bodies = discs.to_vec();
        let moving = || world.movers.iter().filter(|mover| !mover.stops.is_empty());
        bodies.extend(moving().filter_map(|mover| {
            let (first, last) = (mover.stops.first()?, mover.stops.last()?);
            Some(Disc {
                radius: mover.radius,
                speed: 0.0,
                start: first.at,
                goal: last.at,
            })
        }));
        let mut team = Self {
            traffic: Traffic::new(
                world.bounds,
                bodies.iter().map(|body| body.radius).collect(),
                clearance,
            ),
            discs,
            bodies,
            clearance,
            grounds: Vec::new(),
            ground_of: Vec::with_capacity(discs.len()),
            courses: Vec::with_capacity(discs.len()),
            search: Search::new((memory / 4 / STATE) as usize),
            most_bays: (memory / 2 / per_place) as usize,
            plans: vec![Vec::new(); discs.len()],
            least: vec![0.0; discs.len()],
            alone: vec![Vec::new(); discs.len()],
        };
        for (mover, body) in moving().zip(discs.len() as u32..) {
            team.traffic.set(body, &mover.stops);
        }
        for disc in 0..discs.len() {
            team.join(world, disc, control)?;
        }
        Ok(team)
    }

    /// Joins a disc to the ground of its radius, with clearance if it has a way there.
    fn join(
        &mut self,
        world: &World,
        disc: usize,
        control: &mut Control<'_>,
    ) -> Result<(), Outcome> {
        let Disc {
            radius,
            start,
            goal,
            ..
        } = self.discs[disc];
        let levels = if self.clearance > 0.0 {
            vec![self.clearance, 0.0]
        } else {
            vec![0.0]
        };
        for clearance in levels {
            let ground = self.ground(world, radius, clearance);
            let others = self.rings(radius, clearance);
            let known = &mut self.grounds[ground].ground;
            if !known.obstacles().free(start) || !known.obstacles().free(goal) {
                continue;
            }
            let mut course =
                Course::new(known, [start, goal], control.stop).ok_or(Outcome::Stopped)?;
            if course.from_start.0.is_infinite() {
                // It may fit where lines with few corners do not.
                let mut tangents = Tangents::with_step(known.obstacles(), FINE);
                let way = tangents.shortest(start, goal, control.stop);
                if (control.stop)() {
                    return Err(Outcome::Stopped);
                }
                let Some(way) = way else {
                    continue;
                };
                let obstacles = known.obstacles().clone();
                let known = &mut self.grounds[ground];
                known.ways.push(way.places);
                known.ground = Ground::new(obstacles, self.most_bays, &others, &known.ways);
                let known = &mut known.ground;
                // Those who were joined before have lines to places of other numbers now.
                for other in 0..disc {
                    if self.ground_of[other] == ground {
                        let ends = [self.discs[other].start, self.discs[other].goal];
                        self.courses[other] =
                            Course::new(known, ends, control.stop).ok_or(Outcome::Stopped)?;
                    }
                }
                course = Course::new(known, [start, goal], control.stop).ok_or(Outcome::Stopped)?;
            }
            self.ground_of.push(ground);
            self.courses.push(course);
            return Ok(());
        }
        Err(Outcome::NoWay(disc))
    }

    /// The number of the ground for a radius.
    fn ground(&mut self, world: &World, radius: f64, clearance: f64) -> usize {
        let same = |known: &Known| {
            known.radius.total_cmp(&radius).is_eq() && known.clearance.total_cmp(&clearance).is_eq()
        };
        self.grounds.iter().position(same).unwrap_or_else(|| {
            let obstacles =
                Obstacles::new(world.polygons.clone(), world.bounds, radius + clearance);
            let ground = Ground::new(
                obstacles,
                self.most_bays,
                &self.rings(radius, clearance),
                &[],
            );
            self.grounds.push(Known {
                radius,
                clearance,
                ground,
                ways: Vec::new(),
            });
            self.grounds.len() - 1
        })
    }

    /// Starts and goals of all, and the distance of a disc that passes them.
    fn rings(&self, radius: f64, clearance: f64) -> Vec<obstacles::Disc> {
        let discs = self.discs.iter().flat_map(|disc| {
            let apart = (radius + disc.radius) * (1.0 + 2.0 * MARGIN) + clearance;
            [disc.start, disc.goal].map(|at| obstacles::Disc { at, radius: apart })
        });
        discs.collect()
    }

    /// The distances that a disc keeps from the others: clearance as far as their starts and goals allow.
    fn apart(&self, disc: usize, who: Who) -> Vec<f64> {
        let own = &self.bodies[disc];
        let distance = |(number, other): (usize, &Disc)| {
            let is_mover = number >= self.discs.len();
            if who == (if is_mover { Who::Team } else { Who::Movers }) {
                return 0.0;
            }
            let sum = own.radius + other.radius;
            let ends = [own.start - other.start, own.goal - other.goal];
            let most = ends[0].norm().min(ends[1].norm()).max(sum);
            (sum * (1.0 + MARGIN) + self.clearance).min(most * (1.0 - 1e-12))
        };
        self.bodies.iter().enumerate().map(distance).collect()
    }

    /// Searches a way for a disc that arrives before a time, expanding so many states at most.
    fn earliest(
        &mut self,
        disc: usize,
        who: Who,
        (hold, before, most): (f64, f64, u64),
        control: &mut Control<'_>,
    ) -> Option<Vec<Stop>> {
        if !control.search() {
            return None;
        }
        let apart = self.apart(disc, who);
        let mut field = Field {
            ground: &mut self.grounds[self.ground_of[disc]].ground,
            course: &mut self.courses[disc],
            traffic: &mut self.traffic,
            apart: &apart,
        };
        let driver = Driver {
            disc: disc as u32,
            speed: self.discs[disc].speed,
            hold,
            before,
            most,
        };
        self.search.earliest(&mut field, &driver, control)
    }

    /// Lets a disc stand at its start until it had the time to get away.
    fn stand(&mut self, disc: usize) {
        let Disc {
            radius,
            speed,
            start,
            ..
        } = self.discs[disc];
        self.plans[disc].clear();
        let stop = Stop {
            at: start,
            arrival: 0.0,
            departure: STANDING * 2.0 * radius / speed,
        };
        self.traffic.set(disc as u32, &[stop]);
    }

    /// Puts a disc on its way.
    fn go(&mut self, disc: usize, stops: Vec<Stop>) {
        self.traffic.set(disc as u32, &stops);
        self.plans[disc] = stops;
    }

    /// Finds the first plan. False when a limit was met, or when too many discs lost their ways.
    fn first(
        &mut self,
        attempt: u64,
        random: &mut Random,
        control: &mut Control<'_>,
        figures: &mut Figures,
    ) -> bool {
        for disc in 0..self.discs.len() {
            let Some(stops) =
                self.earliest(disc, Who::Movers, (0.0, f64::INFINITY, u64::MAX), control)
            else {
                return false;
            };
            self.least[disc] = arrival(&stops);
            self.alone[disc] = stops;
        }
        for disc in 0..self.discs.len() {
            self.stand(disc);
        }
        let mut order: Vec<usize> = (0..self.discs.len()).collect();
        if attempt < 2 {
            // Whoever has arrived is out of the way of those who have far to go, and fewer are delayed.
            order.sort_by(|a, b| self.least[*a].total_cmp(&self.least[*b]));
        } else {
            random.shuffle(&mut order);
        }
        let mut waiting = VecDeque::from(order);
        let mut failures = vec![0.0_f64; self.discs.len()];
        let mut left = EJECTIONS * self.discs.len() as u64;
        while let Some(disc) = waiting.pop_front() {
            let most = SOON * self.grounds[self.ground_of[disc]].ground.len() as u64;
            // Who is planned first never waits for others, though it may have to: later attempts let some wait at random.
            let hold = if attempt > 0 && random.one_in(2) {
                self.least[disc] * random.share()
            } else {
                0.0
            };
            let bounds = (hold, f64::INFINITY, most);
            if let Some(stops) = self.earliest(disc, Who::All, bounds, control) {
                self.go(disc, stops);
                continue;
            }
            if control.ended() || left == 0 {
                return false;
            }
            failures[disc] += 1.0;
            let Some((stops, met)) = self.through(disc, &failures, control) else {
                return false;
            };
            for other in met {
                let other = other as usize;
                if !self.plans[other].is_empty() {
                    self.stand(other);
                    waiting.push_front(other);
                    figures.ejections += 1;
                    left = left.saturating_sub(1);
                }
            }
            self.go(disc, stops);
        }
        true
    }

    /// A way through others, and those whom it meets.
    fn through(
        &mut self,
        disc: usize,
        failures: &[f64],
        control: &mut Control<'_>,
    ) -> Option<(Vec<Stop>, Vec<u32>)> {
        if !control.search() {
            return None;
        }
        let movers = self.apart(disc, Who::Movers);
        let others = self.apart(disc, Who::Team);
        let plans = &self.plans;
        let penalty = |other: u32| {
            let other = other as usize;
            if plans[other].is_empty() {
                WORTH / 2.0
            } else {
                WORTH * (1.0 + failures[other])
            }
        };
        let mut field = Field {
            ground: &mut self.grounds[self.ground_of[disc]].ground,
            course: &mut self.courses[disc],
            traffic: &mut self.traffic,
            apart: &movers,
        };
        let driver = Driver {
            disc: disc as u32,
            speed: self.discs[disc].speed,
            hold: 0.0,
            before: f64::INFINITY,
            most: u64::MAX,
        };
        let stops = self
            .search
            .through(&mut field, &others, &penalty, &driver, control)?;
        let met = met(&mut self.traffic, &others, disc as u32, &stops);
        Some((stops, met))
    }

    /// Makes the plan cheaper until a limit is met, or nobody is delayed.
    fn improve(
        &mut self,
        effort: Effort,
        random: &mut Random,
        control: &mut Control<'_>,
        figures: &mut Figures,
        tell: &mut dyn FnMut(&[Vec<Stop>]),
    ) {
        let (mut news, mut since) = (false, 0);
        let most = effort.neighborhood.min(self.discs.len()).max(1);
        while figures.rounds < effort.rounds && !control.ended() {
            let delays: Vec<f64> = (0..self.discs.len())
                .map(|disc| arrival(&self.plans[disc]) - self.least[disc])
                .collect();
            let Some(members) = self.neighborhood(&delays, most, random) else {
                break;
            };
            figures.rounds += 1;
            news |= self.again(&members, control);
            since += 1;
            if news && since >= REPORT {
                tell(&self.plans);
                (news, since) = (false, 0);
            }
        }
        if news {
            tell(&self.plans);
        }
    }

    /// Discs to be planned anew, the first of them delayed; none where nobody is.
    fn neighborhood(
        &mut self,
        delays: &[f64],
        most: usize,
        random: &mut Random,
    ) -> Option<Vec<usize>> {
        let total: f64 = delays.iter().map(|delay| delay.max(0.0)).sum();
        if total <= 1e-6 {
            return None;
        }
        let mut left = total * random.share();
        let chosen = delays.iter().position(|delay| {
            left -= delay.max(0.0);
            left < 0.0
        });
        let seed = chosen.unwrap_or(0);
        let size = 1 + random.below(most);
        let mut members = vec![seed];
        let mut others: Vec<usize> = if random.one_in(2) {
            // Those in the way of the disc, were it alone.
            let apart = self.apart(seed, Who::Team);
            let met = met(&mut self.traffic, &apart, seed as u32, &self.alone[seed]);
            let mut met: Vec<usize> = met.into_iter().map(|disc| disc as usize).collect();
            random.shuffle(&mut met);
            met
        } else {
            // Those that are nearest at some time of its way.
            let time = arrival(&self.plans[seed]) * random.share();
            let at = position(&self.plans[seed], time);
            let mut near: Vec<(f64, usize)> = (0..self.discs.len())
                .filter(|disc| *disc != seed)
                .map(|disc| ((position(&self.plans[disc], time) - at).norm(), disc))
                .collect();
            near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            near.into_iter().map(|(_, disc)| disc).collect()
        };
        others.truncate(size - 1);
        members.extend(others);
        while members.len() < size {
            let other = random.below(self.discs.len());
            if !members.contains(&other) {
                members.push(other);
            }
        }
        random.shuffle(&mut members);
        Some(members)
    }

    /// Plans discs anew, one after the other. True if that is cheaper; else all is as before.
    fn again(&mut self, members: &[usize], control: &mut Control<'_>) -> bool {
        let before: Vec<Vec<Stop>> = members
            .iter()
            .map(|disc| self.plans[*disc].clone())
            .collect();
        let sum: f64 = before.iter().map(|stops| arrival(stops)).sum();
        let mut least: f64 = members.iter().map(|disc| self.least[*disc]).sum();
        for disc in members {
            self.stand(*disc);
        }
        let mut spent = 0.0;
        let cheaper = members.iter().all(|disc| {
            least -= self.least[*disc];
            let bound = sum - 1e-9 - spent - least;
            let most = SOON * self.grounds[self.ground_of[*disc]].ground.len() as u64;
            match self.earliest(*disc, Who::All, (0.0, bound, most), control) {
                Some(stops) => {
                    spent += arrival(&stops);
                    self.go(*disc, stops);
                    true
                }
                None => false,
            }
        });
        if !cheaper {
            for (disc, stops) in members.iter().zip(before) {
                self.go(*disc, stops);
            }
        }
        cheaper
    }
}

fn arrival(stops: &[Stop]) -> f64 {
    stops.last().map_or(0.0, |stop| stop.arrival)
}

/// Position of a disc at a time.
fn position(stops: &[Stop], time: f64) -> Vector {
    let at = stops.partition_point(|stop| stop.arrival <= time).max(1) - 1;
    let stop = stops[at];
    match stops.get(at + 1) {
        Some(next) if time > stop.departure => {
            let part = (time - stop.departure) / (next.arrival - stop.departure);
            stop.at + (next.at - stop.at) * part
        }
        _ => stop.at,
    }
}

/// Those who come too close to a disc on its way, in order.
fn met(traffic: &mut Traffic, apart: &[f64], disc: u32, stops: &[Stop]) -> Vec<u32> {
    let mut met = Vec::new();
    for piece in obstructions(stops, 0.0) {
        if piece.motion.duration > 0.0 {
            traffic.meeting(disc, (piece.start, &piece.motion), apart, |other| {
                met.push(other);
            });
        }
    }
    met.sort_unstable();
    met.dedup();
    met
}
