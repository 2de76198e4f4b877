//! Conflict-based search on roadmaps that grow: teams of discs in the plane.
//!
//! I. Solis, J. Motes, R. Sandström, N. M. Amato, "Representation-optimal multi-robot motion planning using conflict-based search",
//! RA-L 6(3), 2021 (CBS-MP). Every robot has a roadmap that is drawn for it. A plan of conflict-based search is the best that these
//! roadmaps have; when they grow, plans get cheaper.
//!
//! Robots of the same radius and speed share one: a part of a [`Roadmap`] that has a part for each kind. New vertices are joined with
//! as many of their nearest as make shortest paths converge to the optimum (S. Karaman, E. Frazzoli, "Sampling-based algorithms for
//! optimal motion planning", IJRR 30(7), 2011: k-PRM\*). Shortest ways of robots alone, which are tangents, are there from the
//! beginning: they find doors that few drawn places do. The paper samples motions to find conflicts; here the times are exact
//! ([`crate::conflict`]). Each time a plan within a factor comes first, then, if few nodes suffice, the best one.

use fleetyard_plugin_plane::Vector;
use fleetyard_plugin_plane::obstacles::Obstacles;
use fleetyard_plugin_plane::prioritised::{Disc, World};
use fleetyard_plugin_plane::tangent::Tangents;
use fleetyard_plugin_plane::timing::Stop;
use fleetyard_plugin_spacetime::random::Random;

use crate::closeness::Closeness;
use crate::conflict::{self, solve};
use crate::plan::Visit;
use crate::roadmap::{Roadmap, Vertex};

/// Most vertices of all parts.
const MOST_VERTICES: usize = 1 << 14;

/// Places that are drawn for one vertex before a part is taken to have no more room.
const DRAWS: usize = 200;

/// The factor within which the first plan on a roadmap is the cheapest.
const FIRST_WEIGHT: f64 = 1.2;

/// Most nodes to search on the first roadmap, for a plan within the factor and for the best; twice as many on each later one.
const NODES: [u64; 2] = [200, 100];

/// Choices of a search.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Vertices that are drawn for each kind of robots at first; each time it grows a part has twice as many.
    pub vertices: usize,
    /// Metres that discs keep from obstacles and from each other beyond touching, where starts and goals leave room for it.
    pub clearance: f64,
    /// Go on after the first plan.
    pub anytime: bool,
    /// Most bytes of a tree.
    pub memory: u64,
    /// Of the places that are drawn.
    pub seed: u64,
}

/// Limits of a search, and its work.
pub struct Control<'a> {
    /// True once the budget is spent; asked often.
    pub stop: &'a mut dyn FnMut() -> bool,
    /// At most so many vertices and nodes of trees are made.
    pub nodes: u64,
    /// Vertices and nodes that were made.
    pub made: u64,
}

impl Control<'_> {
    fn left(&self) -> u64 {
        self.nodes.saturating_sub(self.made)
    }

    fn is_spent(&mut self) -> bool {
        self.left() == 0 || (self.stop)()
    }
}

/// Reason why a search ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum End {
    /// Plans were handed over.
    Solved,
    /// It was told to stop, or made all nodes that it may, and had no plan.
    Spent,
    /// Roadmaps are as large as they get, and have no plan.
    Grown,
    /// This robot has no way, whatever the others do.
    NoWay(usize),
}

/// Figures of a search.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Figures {
    /// Vertices of the last roadmap.
    pub vertices: usize,
    /// Times that roadmaps grew.
    pub growths: u64,
    /// Plans that are the best of their roadmaps, which is proven.
    pub optimal: u64,
    /// The sum of arrival times of the first plan, in seconds.
    pub first_cost: f64,
}

/// Plans for discs in a world without movers; every plan that is cheaper than those before is handed over.
pub fn plan(
    world: &World,
    discs: &[Disc],
    settings: Settings,
    control: &mut Control<'_>,
    submit: &mut dyn FnMut(&[Vec<Stop>]),
) -> (End, Figures) {
    let clearance = settings.clearance.min(room_between(discs));
    let mut figures = Figures::default();
    let mut parts = match parts(world, discs, settings.clearance, control.stop) {
        Ok(parts) => parts,
        Err(_) if (control.stop)() => return (End::Spent, figures),
        Err(robot) => return (End::NoWay(robot), figures),
    };
    let least: f64 = parts.iter().map(|part| part.alone).sum();
    let mut random = Random::new(settings.seed, 0);
    let mut best = f64::INFINITY;
    let mut wanted = settings.vertices;
    let end = loop {
        let mut is_full = false;
        for part in &mut parts {
            is_full |= !part.grow(wanted, &mut random, control);
        }
        figures.vertices = parts.iter().map(|part| part.places.len()).sum();
        is_full |= figures.vertices >= MOST_VERTICES;
        if control.is_spent() {
            break End::Spent;
        }
        let (roadmap, tasks) = joined(&parts, discs.len(), clearance);
        let closeness = Closeness::new(roadmap);
        let mut is_best = false;
        for (weight, limit) in [FIRST_WEIGHT, 1.0].into_iter().zip(NODES) {
            let search = conflict::Settings {
                weight,
                node_limit: Some((limit << figures.growths.min(32)).min(control.left())),
                memory_limit: settings.memory,
                ..conflict::Settings::default()
            };
            let outcome = solve(&closeness, &tasks, &search, control.stop);
            control.made += outcome.expanded;
            if outcome.end != conflict::End::Solved {
                // Without a plan within a factor there is none at all, or it takes too long.
                break;
            }
            is_best = weight <= 1.0;
            figures.optimal += u64::from(is_best);
            if outcome.cost < best * (1.0 - 1e-9) {
                if best.is_infinite() {
                    figures.first_cost = outcome.cost;
                }
                best = outcome.cost;
                let stops = |path: &Vec<Visit>| stops(closeness.roadmap(), path);
                submit(&outcome.paths.iter().map(stops).collect::<Vec<_>>());
            }
            if !settings.anytime || control.is_spent() {
                break;
            }
        }
        // Nobody gives way to anybody, or roadmaps have no better plan.
        let is_least = best <= least * (1.0 + 1e-9) || is_full && is_best;
        if best.is_finite() && !settings.anytime || is_least {
            break End::Solved;
        }
        if control.is_spent() {
            break End::Spent;
        }
        if is_full {
            break End::Grown;
        }
        figures.growths += 1;
        wanted *= 2;
    };
    let end = if best.is_finite() { End::Solved } else { end };
    (end, figures)
}

/// The least distance between two discs at their starts, or at their goals, in metres; zero if two overlap.
fn room_between(discs: &[Disc]) -> f64 {
    let pairs = (0..discs.len()).flat_map(|i| (0..i).map(move |j| (&discs[i], &discs[j])));
    let room = pairs.map(|(one, other)| {
        let apart = (one.start - other.start).norm();
        apart.min((one.goal - other.goal).norm()) - (one.radius + other.radius)
    });
    room.fold(f64::INFINITY, f64::min).max(0.0)
}

/// The roadmap of the robots of one radius and speed.
#[derive(Debug)]
struct Part {
    radius: f64,
    speed: f64,
    obstacles: Obstacles,
    /// The box that has the centres.
    low: Vector,
    extent: Vector,
    places: Vec<Vector>,
    /// Number of places that are on the way of a robot alone.
    pinned: usize,
    edges: Vec<(u32, u32)>,
    /// Of each robot its number, start and goal.
    robots: Vec<(usize, u32, u32)>,
    /// Seconds that all robots need alone.
    alone: f64,
}

/// A part for each kind of discs, with their starts and goals and the shortest ways of each alone, which pass where no place is
/// drawn. The number of a disc that has none, if there is one.
fn parts(
    world: &World,
    discs: &[Disc],
    clearance: f64,
    stop: &mut dyn FnMut() -> bool,
) -> Result<Vec<Part>, usize> {
    let same = |a: f64, b: f64| a.total_cmp(&b).is_eq();
    let mut kinds: Vec<Vec<usize>> = Vec::new();
    for (number, disc) in discs.iter().enumerate() {
        let is_like = |kind: &Vec<usize>| {
            let other = &discs[kind[0]];
            same(other.radius, disc.radius) && same(other.speed, disc.speed)
        };
        match kinds.iter_mut().find(|kind| is_like(kind)) {
            Some(kind) => kind.push(number),
            None => kinds.push(vec![number]),
        }
    }
    let mut parts = Vec::with_capacity(kinds.len());
    for kind in kinds {
        let Disc { radius, speed, .. } = discs[kind[0]];
        let mut ways = |margin: f64| -> Result<(Obstacles, Vec<Vec<Vector>>), usize> {
            let obstacles = Obstacles::new(world.polygons.clone(), world.bounds, radius + margin);
            let mut tangents = Tangents::new(&obstacles);
            let ways = kind.iter().map(|number| {
                let disc = &discs[*number];
                let way = tangents.shortest(disc.start, disc.goal, stop);
                way.map(|way| way.places).ok_or(*number)
            });
            let ways: Vec<Vec<Vector>> = ways.collect::<Result<_, _>>()?;
            Ok((obstacles, ways))
        };
        // One kind of robots needs one distance from obstacles.
        let (obstacles, ways) = ways(clearance).or_else(|_| ways(0.0))?;
        let margin = Vector::repeat(obstacles.radius());
        let mut part = Part {
            radius,
            speed,
            low: world.bounds.min + margin,
            extent: (world.bounds.max - world.bounds.min - margin * 2.0).sup(&Vector::zeros()),
            obstacles,
            places: Vec::new(),
            pinned: 0,
            edges: Vec::new(),
            robots: Vec::new(),
            alone: 0.0,
        };
        for (number, way) in kind.iter().zip(&ways) {
            let disc = &discs[*number];
            let (start, goal) = (part.pin(disc.start), part.pin(disc.goal));
            part.robots.push((*number, start, goal));
            let way: Vec<u32> = way.iter().map(|place| part.pin(*place)).collect();
            let legs = way.windows(2).filter(|leg| leg[0] != leg[1]);
            for leg in legs {
                let [from, to] = [leg[0], leg[1]].map(|vertex| part.places[vertex as usize]);
                part.alone += (to - from).norm() / speed;
                part.edges.push((leg[0], leg[1]));
            }
        }
        part.pinned = part.places.len();
        for at in 0..part.pinned {
            part.join(at);
        }
        parts.push(part);
    }
    Ok(parts)
}

impl Part {
    /// The vertex of a place that is not drawn.
    fn pin(&mut self, place: Vector) -> u32 {
        let known = self.places.iter().position(|known| *known == place);
        known.unwrap_or_else(|| {
            self.places.push(place);
            self.places.len() - 1
        }) as u32
    }

    /// Draws vertices until there are so many beside those of ways. False if there is no room for so many.
    fn grow(&mut self, wanted: usize, random: &mut Random, control: &mut Control<'_>) -> bool {
        let wanted = (wanted + self.pinned).min(MOST_VERTICES);
        while self.places.len() < wanted && !control.is_spent() {
            let Some(place) = self.draw(random) else {
                return false;
            };
            control.made += 1;
            self.places.push(place);
            self.join(self.places.len() - 1);
        }
        true
    }

    /// A place where the disc is free.
    fn draw(&self, random: &mut Random) -> Option<Vector> {
        (0..DRAWS).find_map(|_| {
            let share = Vector::new(random.share(), random.share());
            let place = self.low + self.extent.component_mul(&share);
            self.obstacles.free(place).then_some(place)
        })
    }

    /// Joins a vertex with its nearest before it.
    fn join(&mut self, at: usize) {
        let place = self.places[at];
        let count = (self.places.len() as f64).ln() * std::f64::consts::E * 1.5;
        let count = (count.ceil() as usize).min(at);
        let square = |other: &u32| (self.places[*other as usize] - place).norm_squared();
        let mut nearest: Vec<u32> = (0..at as u32).collect();
        let by_distance = |a: &u32, b: &u32| square(a).total_cmp(&square(b)).then(a.cmp(b));
        if count > 0 && count < at {
            nearest.select_nth_unstable_by(count - 1, by_distance);
        }
        nearest.truncate(count);
        nearest.sort_unstable();
        let seen = |other: &u32| self.obstacles.clear(self.places[*other as usize], place);
        let joined = nearest.into_iter().filter(seen);
        self.edges.extend(joined.map(|other| (other, at as u32)));
    }
}

/// One roadmap of all parts, and the start and goal of each robot.
fn joined(parts: &[Part], robots: usize, clearance: f64) -> (Roadmap, Vec<(Vertex, Vertex)>) {
    let (mut places, mut radii, mut edges) = (Vec::new(), Vec::new(), Vec::new());
    let mut tasks = vec![(0, 0); robots];
    for part in parts {
        let first = places.len() as u32;
        for (a, b) in &part.edges {
            let length = (part.places[*a as usize] - part.places[*b as usize]).norm();
            let (a, b, seconds) = (first + a, first + b, length / part.speed);
            edges.extend([(a, b, seconds), (b, a, seconds)]);
        }
        for (robot, start, goal) in &part.robots {
            tasks[*robot] = (first + start, first + goal);
        }
        places.extend_from_slice(&part.places);
        radii.resize(places.len(), part.radius + clearance / 2.0);
    }
    let roadmap = Roadmap::new(places, edges, 0.0);
    let roadmap = roadmap.unwrap_or_else(|refused| unreachable!("{refused}"));
    (roadmap.with_radii(radii), tasks)
}

/// The stops of a path.
fn stops(roadmap: &Roadmap, path: &[Visit]) -> Vec<Stop> {
    let stop = |visit: &Visit| Stop {
        at: roadmap.place(visit.vertex),
        arrival: visit.arrival,
        departure: visit.departure,
    };
    path.iter().map(stop).collect()
}
