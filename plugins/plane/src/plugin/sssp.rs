//! The planner behind the plugin contract: id `sssp`.

use std::rc::Rc;

use fleetyard_abi::sdk::Failure;
use fleetyard_abi::{Capability, Instance, Knot, KnotPlan, Status};
use fleetyard_plugin_spacetime::plugin::{Call, half_of_memory};

use super::robots::Agent;
use super::{InPlane, Method, Team};
use crate::Vector;
use crate::obstacles::Disc;
use crate::prioritised::{Mover, World};
use crate::sssp::Options;
use crate::sssp::bodies::{Body, Pose, Space};
use crate::sssp::order::{Course, schedule, shorten};
use crate::sssp::refine::{Moving, Refiner};
use crate::sssp::roadmap::{Robot, Sampler};
use crate::sssp::search::{Limits, Outcome, solve};
use crate::timing::Stop;

/// Orders of priority that are tried where obstacles move.
const ORDERS: u64 = 1000;

/// Telling of a plan takes about as long as planning so many of its robots anew.
const REPORT: u64 = 1;

/// Sampling and search at once.
pub type Sssp = InPlane<Options>;

impl Method for Options {
    const ID: &'static str = "sssp";
    const NAME: &'static str = "SSSP";
    const ABOUT: &'static str = "Anytime: samples a roadmap for every robot where a greedy search for the team \
         goes, one robot at a time (SSSP: Okumura, Defago, IJCAI 2023), then lets all move at \
         once and makes ways and times better until the budget ends. Discs and convex polygons.";
    const CAPABILITIES: &'static [Capability] = &[Capability::Heterogeneous, Capability::Anytime];

    fn solve(&self, team: &Team<'_>, call: &Call<'_>) -> Result<(), Failure> {
        let Team {
            world,
            instance,
            agents,
        } = team;
        let seed = call.budget.seed;
        let mut stop = || call.stop();
        let robots = robots(world, instance, agents)?;
        let mut sampler = Sampler::new(world.bounds, seed);
        let nodes = call.node_limit().unwrap_or(u64::MAX);
        let mut limits = Limits {
            nodes,
            memory: half_of_memory(call.budget),
            stop: &mut stop,
        };
        let (outcome, roadmaps, effort) = solve(&robots, &mut sampler, self, &mut limits);
        call.metric("expansions", effort.expanded as f64);
        call.metric("generated", effort.generated as f64);
        call.metric("rounds", effort.rounds as f64);
        let spent = effort.expanded + effort.samples;
        let mut left = nodes.saturating_sub(spent);
        let mut moves = match outcome {
            Outcome::Solved(moves) => moves,
            other => {
                call.metric("nodes", spent as f64);
                if let Outcome::NoWay(agent) = other {
                    return Err(team.no_way(agent, call));
                }
                return Err(failure(&other, call.stop()));
            }
        };
        shorten(&robots, &mut moves, &mut stop);
        let courses = schedule(&robots, &moves);
        let moving: Vec<Moving> = world.movers.iter().map(moving).collect();
        let mut refiner = Refiner::new(&robots, &roadmaps, &moving, courses, seed, &mut stop);
        if !moving.is_empty() && !refiner.give_way(ORDERS.min(nodes), seed, &mut stop) {
            call.metric("nodes", spent as f64);
            let reason = "no order of priority was found in which all robots give way to obstacles that move";
            return Err(unsolved(call.stop(), reason));
        }
        let submit = |refiner: &Refiner<'_>| {
            let plan: KnotPlan = std::iter::zip(&robots, agents)
                .zip(refiner.courses())
                .map(|((robot, agent), course)| knots(robot, agent, course))
                .collect();
            call.submit(&plan);
        };
        let [first, bound] = refiner.sums();
        call.metric("first_cost_s", first);
        call.metric("lower_bound", bound);
        submit(&refiner);
        // A way that is only shorter is no better plan.
        let (mut told, mut work, mut refinements) = (first, 0, 0);
        let is_better = |refiner: &Refiner<'_>, told: f64| refiner.sums()[0] < told - 1e-6;
        let most = self.refinements.unwrap_or(u64::MAX);
        while refinements < most && left > 0 && !refiner.is_done() && !stop() {
            let (_, count) = refiner.attempt();
            (refinements, work) = (refinements + 1, work + count);
            left = left.saturating_sub(count);
            if work > REPORT * agents.len() as u64 && is_better(&refiner, told) {
                submit(&refiner);
                (told, work) = (refiner.sums()[0], 0);
            }
        }
        if is_better(&refiner, told) {
            submit(&refiner);
        }
        call.metric("refinements", refinements as f64);
        call.metric("nodes", (nodes - left) as f64);
        Ok(())
    }
}

fn unsolved(stopped: bool, otherwise: &str) -> Failure {
    if stopped {
        return Failure::new(Status::TimedOut, "the budget ended before a plan was found");
    }
    Failure::new(Status::GaveUp, otherwise)
}

/// The failure of a search. What touches at its start or goal by a rounding error may do so for who judges, and an obstacle that moves
/// leaves: neither proves that there is no plan.
fn failure(outcome: &Outcome, stopped: bool) -> Failure {
    match outcome {
        Outcome::NotFree(agent) => Failure::new(
            Status::GaveUp,
            format!("agent {agent} touches an obstacle at its start or its goal"),
        ),
        Outcome::Touching([a, b]) => Failure::new(
            Status::GaveUp,
            format!("agents {a} and {b} touch at their starts or at their goals"),
        ),
        Outcome::Solved(_) | Outcome::NoWay(_) | Outcome::Stopped => {
            unsolved(stopped, "a limit was met before a plan was found")
        }
    }
}

/// Robots of the same body share what they know of obstacles. Obstacles that move stand at their last place.
fn robots(world: &World, instance: &Instance, agents: &[Agent]) -> Result<Vec<Robot>, Failure> {
    let parked = world.movers.iter().filter_map(|mover| {
        let at = mover.stops.last()?.at;
        Some(Disc {
            at,
            radius: mover.radius,
        })
    });
    let parked: Vec<Disc> = parked.collect();
    let mut spaces: Vec<Rc<Space>> = Vec::new();
    let robots = agents.iter().enumerate().map(|(number, agent)| {
        let lacking = || {
            let reason = format!("agent {number} has no robot");
            Failure::new(Status::InvalidInput, reason)
        };
        let footprint = &instance.robot(number).ok_or_else(lacking)?.footprint;
        let corners = footprint.corners_m.iter();
        let body = Body {
            radius: footprint.radius_m,
            corners: corners.map(|[x, y]| Vector::new(*x, *y)).collect(),
        };
        let known = spaces.iter().find(|space| space.body == body).cloned();
        let space = known.unwrap_or_else(|| {
            let space = Space::new(body, &world.polygons, world.bounds, &parked);
            spaces.push(Rc::new(space));
            spaces[spaces.len() - 1].clone()
        });
        // The heading of a disc is brought about at its goal.
        let turn = agent.turn.as_ref().filter(|_| !space.body.is_disc());
        let [from, by, turn_rate] =
            turn.map_or([0.0; 3], |turn| [turn.from_rad, turn.by_rad, turn.rate]);
        let pose = |at, heading| Pose { at, heading };
        Ok(Robot {
            space,
            speed: agent.disc.speed,
            turn_rate,
            start: pose(agent.disc.start, from),
            goal: pose(agent.disc.goal, from + by),
        })
    });
    robots.collect()
}

fn moving(mover: &Mover) -> Moving {
    let at = |stop: &Stop| Pose {
        at: stop.at,
        heading: 0.0,
    };
    Moving {
        body: Body {
            radius: mover.radius,
            corners: Vec::new(),
        },
        course: Course {
            way: mover.stops.iter().map(at).collect(),
            times: mover
                .stops
                .iter()
                .map(|stop| [stop.arrival, stop.departure])
                .collect(),
        },
    }
}

fn knots(robot: &Robot, agent: &Agent, course: &Course) -> Vec<Knot> {
    let poses = std::iter::zip(&course.way, &course.times);
    if robot.space.body.is_disc() || agent.turn.is_none() {
        let stops = poses.map(|(pose, [arrival, departure])| Stop {
            at: pose.at,
            arrival: *arrival,
            departure: *departure,
        });
        return agent.knots(&stops.collect::<Vec<_>>());
    }
    let knot = |pose: &Pose, time_s: f64| Knot {
        time_s,
        x_m: pose.at.x,
        y_m: pose.at.y,
        heading_rad: pose.heading,
    };
    let knots = poses.flat_map(|(pose, [arrival, departure])| {
        let waits = departure.is_finite() && departure > arrival;
        let arrives = knot(pose, *arrival);
        [arrives]
            .into_iter()
            .chain(waits.then(|| knot(pose, *departure)))
    });
    knots.collect()
}
