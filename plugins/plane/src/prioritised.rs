//! Prioritised planning of discs in the plane: one after the other goes a shortest way and, among those planned before, as
//! early as that way allows.
//!
//! A way is the shortest round the goals of those before and the starts of those after ([`crate::tangent`]); where there is none,
//! round the goals alone, and at last round nobody. Only its times give way to moving discs ([`crate::timing`]). Where starts and
//! goals leave ways between them everybody arrives in any order (M. Čáp, P. Novák, A. Kleiner, M. Selecký, "Prioritized planning
//! algorithms for trajectory coordination of multiple mobile robots", IEEE T-ASE 12(3), 2015: well-formed infrastructures).

use std::cell::LazyCell;

use crate::Vector;
use crate::bins::Rectangle;
use crate::obstacles::{self, Obstacles};
use crate::orders::{Attempt, End, longest_first, try_orders};
use crate::tangent::Tangents;
use crate::timing::{Obstruction, Stop, earliest, obstructions};

/// A disc that wants to go somewhere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Disc {
    /// In metres.
    pub radius: f64,
    /// Metres per second.
    pub speed: f64,
    /// Its centre at the beginning, in metres.
    pub start: Vector,
    /// The place where its centre has to stay in the end, in metres.
    pub goal: Vector,
}

/// A disc that moves in a known way, and rests at its last stop.
#[derive(Debug, Clone, PartialEq)]
pub struct Mover {
    /// In metres.
    pub radius: f64,
    /// Its stops from time 0 on.
    pub stops: Vec<Stop>,
}

/// The world in which discs move.
#[derive(Debug, Clone, PartialEq)]
pub struct World {
    /// The corners of obstacles.
    pub polygons: Vec<Vec<Vector>>,
    /// The box that no disc leaves.
    pub bounds: Rectangle,
    /// Discs that give way to nobody.
    pub movers: Vec<Mover>,
}

/// Result of planning.
#[derive(Debug, Clone, PartialEq)]
pub enum Outcome {
    /// By orders of priority.
    Ordered {
        /// The stops of every disc, if an order gives them.
        end: End<Vec<Vec<Stop>>>,
        /// Orders that were tried.
        orders: u64,
    },
    /// This disc has no way, whatever the others do.
    NoWay(usize),
    /// It was told to stop before all ways were known.
    Stopped,
}

/// Discs keep so much more distance from each other, as a share of their radii: times are rounded.
const MARGIN: f64 = 1e-9;

/// Bounds of the search, and its choices.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Effort {
    /// Metres that discs keep from obstacles and from each other beyond touching, where there is
    /// room for it.
    pub clearance: f64,
    /// Most orders of priority to try.
    pub limit: u64,
    /// Of the orders that are drawn.
    pub seed: u64,
}

/// Obstacles for the discs of one radius.
struct Known {
    radius: f64,
    /// With clearance, and without.
    levels: [Obstacles; 2],
}

impl Known {
    fn new(world: &World, radius: f64, clearance: f64) -> Self {
        let level = |radius| Obstacles::new(world.polygons.clone(), world.bounds, radius);
        Self {
            radius,
            levels: [level(radius + clearance), level(radius)],
        }
    }
}

/// Plans for discs in a world.
pub fn plan(
    world: &World,
    discs: &[Disc],
    effort: Effort,
    stop: &mut dyn FnMut() -> bool,
) -> Outcome {
    let mut known: Vec<Known> = Vec::new();
    let mut places = Vec::with_capacity(discs.len());
    let mut lengths = Vec::with_capacity(discs.len());
    for (number, disc) in discs.iter().enumerate() {
        let same = |known: &Known| known.radius.total_cmp(&disc.radius).is_eq();
        let found = known.iter().position(same).unwrap_or_else(|| {
            known.push(Known::new(world, disc.radius, effort.clearance));
            known.len() - 1
        });
        let mut levels = known[found].levels.iter().enumerate();
        let way = levels.find_map(|(level, obstacles)| {
            let way = Tangents::new(obstacles).shortest(disc.start, disc.goal, stop)?;
            Some((level, way.length))
        });
        match way {
            Some((level, length)) => {
                places.push((found, level));
                lengths.push(length / disc.speed);
            }
            None if stop() => return Outcome::Stopped,
            None => return Outcome::NoWay(number),
        }
    }
    let parked: Vec<_> = world
        .movers
        .iter()
        .filter_map(|mover| {
            let at = mover.stops.last()?.at;
            Some(obstacles::Disc {
                at,
                radius: mover.radius,
            })
        })
        .collect();
    let (end, orders) = try_orders(
        longest_first(&lengths),
        effort.limit,
        effort.seed,
        |order| {
            let mut plans: Vec<Vec<Stop>> = vec![Vec::new(); discs.len()];
            for (place, agent) in order.iter().map(|agent| *agent as usize).enumerate() {
                let disc = &discs[agent];
                let rest = |at: Vector, radius: f64| obstacles::Disc { at, radius };
                let before = order[..place].iter().map(|other| &discs[*other as usize]);
                let after = order[place + 1..]
                    .iter()
                    .map(|other| &discs[*other as usize]);
                let goals = before.map(|other| rest(other.goal, other.radius));
                let goals: Vec<_> = goals.chain(parked.iter().copied()).collect();
                let starts = after.map(|other| rest(other.start, other.radius));
                let moving = |clearance: f64| -> Vec<Obstruction> {
                    let own = disc.radius;
                    let distance = |other: f64| (own + other) * (1.0 + MARGIN) + clearance;
                    let planned = order[..place].iter().flat_map(|other| {
                        let other = *other as usize;
                        obstructions(&plans[other], distance(discs[other].radius))
                    });
                    let moved = world.movers.iter();
                    let moved =
                        moved.flat_map(|mover| obstructions(&mover.stops, distance(mover.radius)));
                    planned.chain(moved).collect()
                };
                // Most find a way with clearance, and never ask for the other.
                let moving = [effort.clearance, 0.0]
                    .map(|clearance| LazyCell::new(move || moving(clearance)));
                let all = goals.iter().copied().chain(starts).collect();
                let (found, level) = places[agent];
                let levels = std::iter::zip(&known[found].levels, &moving).skip(level);
                let stops = [all, goals.clone(), Vec::new()]
                    .into_iter()
                    .flat_map(|rests| levels.clone().map(move |level| (level, rests.clone())))
                    .find_map(|((level, moving), rests)| {
                        let obstacles = level.with_discs(rests);
                        let way =
                            Tangents::new(&obstacles).shortest(disc.start, disc.goal, stop)?;
                        earliest(&way.places, disc.speed, moving)
                    });
                if stop() {
                    return Attempt::Stopped;
                }
                match stops {
                    Some(stops) => plans[agent] = stops,
                    None => return Attempt::Blocked(place),
                }
            }
            Attempt::Solved(plans)
        },
    );
    Outcome::Ordered { end, orders }
}
