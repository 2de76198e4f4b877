//! PIBT along one-way streets, with turns that cost.
//!
//! Of the cells where an agent could be next it prefers the one over which the way to its goal
//! costs the least; of equals those that PIBT prefers by itself. The agent whose way costs least goes
//! first, but for those in and before passages of one cell's width, so that the first of all still
//! arrives. Four things make a way longer than its moves:
//!
//! - a move against a [lane](Lanes) is charged. Where lanes alone lead everywhere
//!   ([`Lanes::is_barred`]), an agent makes one only if it is pushed, and no way counts on one: if
//!   ways led along it, agents would stand before it. The same holds for moves against doors, which
//!   lead one way where others lead back;
//! - a turn by 90° costs what it costs the robot: the turn itself, braking before it and setting
//!   out after it ([`Turning`]);
//! - a cell where others had to wait of late costs a little more ([`Traffic`]): a jam is gone round
//!   before it grows. Tables of goals take up new averages in turn, not all at once;
//! - staying costs a step, and leaves the way as long as it was.
//!
//! A guidance graph multiplies steps, the charges of lanes among them, and stays by its factors
//! ([`Guidance`]): Y. Zhang, H. Jiang, V. Bhatt, S. Nikolaidis, J. Li, "Guidance graph optimization
//! for lifelong multi-agent path finding", IJCAI 2024. Factors whose mean is above 1 count by their
//! proportions, so that ways stay within what tables hold.
//!
//! Were turns and lanes charged in the step alone, and not in the tables, agents would rather wait
//! than turn, and nobody would push.

mod admission;
mod doors;
mod passages;
mod signals;
pub mod ways;

use std::f64::consts::FRAC_PI_2;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::sync::Arc;

use fleetyard_abi::{GoalTasks, Goals, Guidance, Heading, Instance, Limit, Robot, Traffic, c};
use fleetyard_plugin_spacetime::distance::Tables;
use fleetyard_plugin_spacetime::gradient::{Expected, Gradients};
use fleetyard_plugin_spacetime::graph::{DIRECTIONS, Graph, Vertex, direction};
use fleetyard_plugin_spacetime::lanes::Lanes;

use self::admission::Admission;
use self::doors::Doors;
use self::passages::Passage;
use self::signals::{Crossings, SIGHT, Signals};
use self::ways::{Moves, Tolls, Ways};
use crate::lifelong::{Place, Ranking};
use crate::share::share;

/// Units of cost in a step.
pub(crate) const STEP: u32 = 4;
/// Steps that a cell costs more where always somebody waits. Much more, and robots take long ways
/// round; much less, and they queue.
const WAIT: u32 = 5;
/// A turn costs no more steps than this: robots that hardly turn are to arrive as well.
const MOST_TURN: f64 = 50.0;
/// Tables that no agent asks for any longer are kept in so many bytes.
const IDLE_BYTES: u64 = 256 << 20;
/// Most moves of a way on which passages are looked for.
const FAR: usize = 1000;
/// Agents whose ways are found between two looks at the clock.
const PATIENCE: usize = 8;

/// The time that a turn by 90° takes a robot: to brake, to turn and to set out again, less the time
/// in which it would have driven the same way without a stop.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Turning {
    /// Seconds; 0 for robots that drive any way that they want.
    pub quarter_s: f64,
}

impl Turning {
    /// Of the robots of an instance that have to look where they drive: the mean over its agents,
    /// since they share the tables. None where nobody's headings are known.
    pub fn of(instance: &Instance) -> Self {
        let agents = instance.agents();
        if instance.headings.is_none() || instance.robots.is_empty() || agents == 0 {
            return Self::default();
        }
        let models: Vec<f64> = instance.robots.iter().map(quarter_s).collect();
        let model = |agent: usize| {
            instance
                .robot_of
                .get(agent)
                .map_or(0, |model| *model as usize)
        };
        let sum_s: f64 = (0..agents)
            .filter_map(|agent| models.get(model(agent)))
            .sum();
        Self {
            quarter_s: sum_s / agents as f64,
        }
    }

    /// In units of cost.
    fn units(self, step_s: f64) -> u32 {
        let steps = (self.quarter_s / step_s).clamp(0.0, MOST_TURN);
        (steps * f64::from(STEP)).round() as u32
    }
}

/// Time for which a turn by 90° keeps a robot, in seconds.
fn quarter_s(robot: &Robot) -> f64 {
    let wheels = ["unicycle", "unicycle-2", "differential-drive"];
    let name = robot.dynamics.strip_prefix("fleetyard.");
    let name = name.and_then(|name| name.strip_suffix("/1")).unwrap_or("");
    if !wheels.contains(&name) {
        return 0.0;
    }
    let most = |limits: &[[Limit; 2]], at: usize, end: usize| {
        let limit = limits.get(at).and_then(|limits| limits[end]);
        limit.map_or(f64::INFINITY, f64::abs)
    };
    let (speed, turn, rates) = if name == "unicycle-2" {
        let state = &robot.state_limits;
        (
            most(state, 3, 1),
            most(state, 4, 1),
            Some(&robot.control_limits),
        )
    } else {
        let control = &robot.control_limits;
        (most(control, 0, 1), most(control, 1, 1), None)
    };
    let rate = |at, end| rates.map_or(f64::INFINITY, |rates| most(rates, at, end));
    // Uniform braking takes speed / rate and half the way that speed makes of that time.
    let lost_s = |rate: f64| {
        if speed.is_finite() {
            speed / (2.0 * rate)
        } else {
            0.0
        }
    };
    let to_speed_s = turn / rate(1, 1);
    let turn_s = if to_speed_s.is_nan() || to_speed_s == 0.0 {
        FRAC_PI_2 / turn
    } else if to_speed_s * turn >= FRAC_PI_2 {
        2.0 * (FRAC_PI_2 / rate(1, 1)).sqrt()
    } else {
        FRAC_PI_2 / turn + to_speed_s
    };
    turn_s + lost_s(rate(0, 0)) + lost_s(rate(0, 1))
}

/// The streets of a map, and the ways to goals along them, kept from call to call. A [`Survey`] learns
/// them.
#[derive(Debug)]
pub struct Streets {
    graph: Arc<Graph>,
    lanes: Lanes,
    /// All but those that are barred.
    moves: Moves,
    doors: Doors,
    crossings: Crossings,
    step_s: f64,
    tables: Tables<Key, Ways>,
    /// Costs of the last call, each with its turn and the hash of its averages and its guidance.
    tolls: Vec<(u32, u64, Arc<Tolls>)>,
    /// Distances for those whose tables do not fit.
    gradients: Option<Gradients>,
}

/// All that decides about a table: the goal, the cost of a turn, and a hash of the averages and of
/// the guidance graph.
type Key = (Vertex, u32, u64);

/// The input of [`Streets::ranking`].
#[derive(Debug, Clone, Copy)]
pub struct Journeys<'a> {
    /// The cell where each agent is.
    pub starts: &'a [u32],
    /// The goal cells of each agent.
    pub goals: &'a Goals,
    /// Headings of the agents, if they are known.
    pub headings: Option<&'a [Heading]>,
    /// The time that turns take.
    pub turning: Turning,
    /// Averages of where agents wait, if they are known.
    pub traffic: Option<&'a Traffic>,
    /// Since when agents have their goals, if it is known. Where there are signals, those that have had
    /// theirs for longest have leave to go to a passage before the others.
    pub tasks: Option<&'a GoalTasks>,
    /// Threads that look for ways.
    pub threads: usize,
    /// The instant, by the monotonic clock, after which nobody looks for ways any more: where they are not known they
    /// cost what they do at least. [`u64::MAX`] for none; then the ranking depends on no clock.
    pub until_ns: u64,
    /// The guidance graph of the map, if there is one: of as many moves and cells.
    pub guidance: Option<&'a Guidance>,
}

/// A guidance graph, and the factor that changes nothing.
#[derive(Debug, Clone, Copy)]
struct Guide<'a> {
    factors: &'a Guidance,
    neutral: u32,
}

impl<'a> Guide<'a> {
    fn new(graph: &Graph, moves: &Moves, factors: &'a Guidance) -> Self {
        let (mut sum, mut count) = (0, 0);
        for v in 0..graph.len() as Vertex {
            for d in (0..DIRECTIONS).filter(|d| moves.away(v, *d).is_some()) {
                sum += u64::from(factors.moves[DIRECTIONS * graph.cell(v) as usize + d]);
                count += 1;
            }
        }
        let mean = sum.checked_div(count).unwrap_or(0) as u32;
        Self {
            factors,
            neutral: mean.max(c::GUIDANCE_NEUTRAL.into()),
        }
    }

    /// A cost by a factor, at least 1.
    fn times(self, cost: u32, factor: u16) -> u32 {
        let product = u64::from(cost) * u64::from(factor) + u64::from(self.neutral / 2);
        (product / u64::from(self.neutral)).max(1) as u32
    }

    /// The cost of a move in direction `d` from a cell.
    fn step(self, cost: u32, cell: u32, d: usize) -> u32 {
        self.times(cost, self.factors.moves[DIRECTIONS * cell as usize + d])
    }

    /// The cost of a stay in a cell.
    fn stay(self, cell: u32) -> u32 {
        self.times(STEP, self.factors.waits[cell as usize])
    }
}

/// Streets while they are learnt, a part at a time: each takes time in proportion to the map.
#[derive(Debug)]
pub struct Survey {
    graph: Arc<Graph>,
    charge: u32,
    step_s: f64,
    bytes: u64,
    signals: bool,
    learnt: Learnt,
}

/// The parts that are learnt.
#[derive(Debug)]
enum Learnt {
    Nothing,
    Lanes(Lanes),
    Passages(Lanes, Vec<Passage>),
    Doors(Lanes, Vec<Passage>, Doors),
    All(Box<Streets>),
}

impl Survey {
    /// Moves against a lane are charged so many steps of so many seconds; 0 for no lanes. Tables may
    /// take so many bytes. There are no [signals](Survey::with_signals). Where streets are one-way already,
    /// there are neither lanes nor doors nor signals. Nothing is learnt yet.
    pub fn new(graph: &Arc<Graph>, charge: u32, step_s: f64, bytes: u64) -> Self {
        Self {
            graph: Arc::clone(graph),
            charge: if graph.is_directed() { 0 } else { charge },
            step_s,
            bytes,
            signals: false,
            learnt: Learnt::Nothing,
        }
    }

    /// With signals before passages of one cell's width that are driven in both directions, for planners
    /// that ask [`Ranking::rank`]. Moves that join the approach of one are charged.
    #[must_use]
    pub fn with_signals(mut self) -> Self {
        self.signals = !self.graph.is_directed();
        self
    }

    /// Goes on until the streets are known, or `stop`, which is asked between parts, says so. The next
    /// time it goes on from there.
    pub fn streets(&mut self, stop: &mut dyn FnMut() -> bool) -> Option<&mut Streets> {
        while !matches!(self.learnt, Learnt::All(_)) && !stop() {
            self.learnt = self.next();
        }
        match &mut self.learnt {
            Learnt::All(streets) => Some(streets),
            _ => None,
        }
    }

    /// All of the streets.
    pub fn finish(mut self) -> Streets {
        loop {
            match self.next() {
                Learnt::All(streets) => return *streets,
                part => self.learnt = part,
            }
        }
    }

    /// The parts with one more learnt.
    fn next(&mut self) -> Learnt {
        let (graph, charge) = (&*self.graph, self.charge);
        let open = |lanes: &Lanes, v, d| charge == 0 || !lanes.is_barred(v, d);
        match std::mem::replace(&mut self.learnt, Learnt::Nothing) {
            Learnt::Nothing => Learnt::Lanes(Lanes::new(graph, charge)),
            Learnt::Lanes(lanes) => {
                let wanted = charge > 0 || self.signals;
                let passages = wanted.then(|| Passage::all(graph));
                Learnt::Passages(lanes, passages.unwrap_or_default())
            }
            Learnt::Passages(lanes, passages) => {
                let doors = match charge {
                    0 => Doors::default(),
                    _ => Doors::new(graph, &passages, |v, d| open(&lanes, v, d)),
                };
                Learnt::Doors(lanes, passages, doors)
            }
            Learnt::Doors(lanes, mut passages, doors) => {
                let may = |v, d| open(&lanes, v, d) && !doors.is_barred(v, d);
                if !self.signals {
                    passages.clear();
                }
                Learnt::All(Box::new(Streets {
                    graph: Arc::clone(&self.graph),
                    crossings: Crossings::new(graph, passages, may),
                    moves: Moves::new(graph, may),
                    lanes,
                    doors,
                    step_s: self.step_s,
                    tables: Tables::new(self.bytes),
                    tolls: Vec::new(),
                    gradients: None,
                }))
            }
            all @ Learnt::All(_) => all,
        }
    }
}

impl Streets {
    /// True if ways may lead along the move from `v` in direction `d`: there is one, and neither a lane
    /// nor a door bars it.
    pub fn may(&self, v: Vertex, d: usize) -> bool {
        self.moves.away(v, d).is_some()
    }

    /// Bytes that tables take now.
    pub fn bytes(&self) -> u64 {
        self.tables.iter().map(Ways::bytes).sum()
    }

    /// Makes ready for a fleet. Agents whose tables do not fit, which are those furthest from their
    /// goals, and those whose ways were not found before time was up, follow their planner's own
    /// order. The ways of those nearest to their goals are found first, and all that were found are
    /// kept.
    pub fn ranking<'a>(
        &'a mut self,
        journeys: Journeys<'a>,
        stop: &mut dyn FnMut() -> bool,
    ) -> ByStreet<'a> {
        let Journeys {
            starts,
            goals,
            headings,
            turning,
            traffic,
            tasks,
            threads,
            until_ns,
            guidance,
        } = journeys;
        self.tables.weigh(IDLE_BYTES, Ways::bytes);
        self.tables.begin();
        let averages = match traffic {
            Some(traffic) => vec![&traffic.last.waiting[..], &traffic.before.waiting],
            None => vec![&[][..]],
        };
        let turn = turning.units(self.step_s);
        let guide = guidance.map(|factors| Guide::new(&self.graph, &self.moves, factors));
        self.tolls = averages
            .into_iter()
            .map(|waiting| self.price(turn, waiting, guide))
            .collect();
        let tolls = self
            .tolls
            .iter()
            .map(|(_, hash, tolls)| (*hash, Arc::clone(tolls)))
            .inspect(|(_, tolls)| tolls.search_until(until_ns))
            .collect();
        let fits = self.fits(starts, goals);
        let mut ranking = ByStreet {
            tolls,
            traffic,
            guide,
            turn,
            starts,
            goals,
            journeys: vec![Journey::default(); goals.len()],
            wanting: fits.iter().filter(|fits| !**fits).count(),
            fits,
            signals: None,
            held: Vec::new(),
            late: false,
            streets: self,
        };
        let mut missing = Vec::new();
        for agent in 0..goals.len() {
            let Some((goal, key, tolls)) = ranking.key(agent, 0) else {
                continue;
            };
            let Streets { graph, tables, .. } = &mut *ranking.streets;
            if !ranking.fits[agent] {
                continue;
            }
            if let Some(ways) = tables.kept(key) {
                ranking.journeys[agent] = Journey {
                    visited: 0,
                    ways: Some(ways),
                    tolls,
                };
            } else {
                missing.push((away(graph, starts, agent, goal), agent));
            }
        }
        missing.sort_unstable();
        for part in missing.chunks(PATIENCE) {
            if stop() {
                ranking.late = true;
                break;
            }
            for &(_, agent) in part {
                ranking.journeys[agent] = ranking.journey(agent, 0);
            }
            let mut workers = vec![(); threads.clamp(1, part.len())];
            share(&mut workers, part.iter(), |(), &(_, agent)| {
                let heading = headings.and_then(|headings| headings.get(agent));
                ranking.rest(agent, heading.map(|heading| direction(*heading)));
            });
        }
        if !ranking.streets.crossings.is_empty() {
            let heading = |agent: usize| {
                let heading = headings.and_then(|headings| headings.get(agent));
                heading.map(|heading| direction(*heading))
            };
            let routes = (0..goals.len()).map(|agent| ranking.route(agent, heading(agent)));
            ranking.signals = Some(Signals::new(&ranking.streets.crossings, routes, traffic));
            if let Some(tasks) = tasks {
                ranking.held = ranking.hold_back(tasks, heading);
            }
        }
        ranking
    }

    /// Of all agents those whose ways fit into half of the bytes, the nearest to their goals first. This
    /// depends on their places alone, not on what is kept.
    fn fits(&self, starts: &[u32], goals: &Goals) -> Vec<bool> {
        let graph = &*self.graph;
        let journeys = starts.iter().zip(goals.iter()).enumerate();
        let journeys = journeys.filter_map(|(agent, (start, goals))| {
            let [start, goal] = [start, goals.first()?].map(|cell| graph.vertex(*cell));
            let (start, goal) = start.zip(goal)?;
            let bytes = Ways::expected(graph, &self.moves, start, goal);
            Some((graph.manhattan(start, goal), agent, bytes))
        });
        let mut journeys: Vec<(u32, usize, u64)> = journeys.collect();
        let mut fits = vec![true; goals.len()];
        let mut left = self.tables.limit() / 2;
        if journeys.iter().map(|(_, _, bytes)| bytes).sum::<u64>() > left {
            journeys.sort_unstable();
            for (_, agent, bytes) in journeys {
                fits[agent] = bytes <= left;
                left = left.saturating_sub(bytes);
            }
        }
        fits
    }

    /// The costs of turns, and of moves where agents wait so much, of the last call if they are the
    /// same.
    fn price(&self, turn: u32, waiting: &[u8], guide: Option<Guide<'_>>) -> (u32, u64, Arc<Tolls>) {
        let hash = hash_of(&(guide.map(|guide| &guide.factors.moves), waiting));
        let kept = self
            .tolls
            .iter()
            .find(|kept| (kept.0, kept.1) == (turn, hash));
        let tolls = kept.map(|kept| Arc::clone(&kept.2));
        (
            turn,
            hash,
            tolls.unwrap_or_else(|| Arc::new(self.tolls(turn, waiting, guide))),
        )
    }

    /// Costs of turns, and of moves where agents wait so much, by cell, in units of 1/255.
    fn tolls(&self, turn: u32, waiting: &[u8], guide: Option<Guide<'_>>) -> Tolls {
        self.moves.tolls(turn, |v, d| {
            let to = self.graph.around(v)[d];
            let share = waiting.get(self.graph.cell(to) as usize);
            let wait = share.map_or(0, |share| {
                u32::from(*share) * WAIT * STEP / u32::from(u8::MAX)
            });
            let charge = if self.doors.leads(v, d) {
                0
            } else {
                self.lanes.charge(v, d)
            };
            let cost = STEP * (1 + charge + self.crossings.charge(v, to));
            guide.map_or(cost, |guide| guide.step(cost, self.graph.cell(v), d)) + wait
        })
    }
}

/// Steps from the start of an agent to a goal if nothing were in the way.
fn away(graph: &Graph, starts: &[u32], agent: usize, goal: Vertex) -> Option<u32> {
    let start = graph.vertex(*starts.get(agent)?)?;
    Some(graph.manhattan(start, goal))
}

/// Stands for averages and guidance among those of a process. What a number stands for in one run may
/// be something else in the next.
fn hash_of(value: &impl Hash) -> u64 {
    let mut hasher = DefaultHasher::new();
    value.hash(&mut hasher);
    hasher.finish()
}

/// The order of streets in one call.
#[derive(Debug)]
pub struct ByStreet<'a> {
    streets: &'a mut Streets,
    /// Cost of a turn by 90°.
    turn: u32,
    traffic: Option<&'a Traffic>,
    guide: Option<Guide<'a>>,
    /// Costs of moves by the last averages, and by those before, with a hash of the averages.
    tolls: Vec<(u64, Arc<Tolls>)>,
    starts: &'a [u32],
    goals: &'a Goals,
    journeys: Vec<Journey>,
    /// Per agent true if there is room for its ways.
    fits: Vec<bool>,
    /// Agents for whose ways there is none.
    wanting: usize,
    signals: Option<Signals>,
    /// Per agent true if it is held back; empty if nobody is.
    held: Vec<bool>,
    /// True once there is no time for more tables.
    late: bool,
}

/// An agent on its way to a goal.
#[derive(Debug, Clone, Default)]
struct Journey {
    /// Goals that it has visited before.
    visited: usize,
    /// The ways to the goal.
    ways: Option<Arc<Ways>>,
    /// The [`ByStreet::tolls`] that they are made of.
    tolls: usize,
}

impl ByStreet<'_> {
    /// An agent's goal, the key of its ways, and the tolls that they are made of.
    fn key(&self, agent: usize, visited: usize) -> Option<(Vertex, Key, usize)> {
        let cell = *self.goals.get(agent)?.get(visited)?;
        let goal = self.streets.graph.vertex(cell)?;
        let at = self.traffic.map_or(0, |traffic| {
            let snapshot = traffic.snapshot_of(cell.into());
            usize::from(snapshot.number != traffic.last.number)
        });
        Some((goal, (goal, self.turn, self.tolls[at].0), at))
    }

    fn journey(&mut self, agent: usize, visited: usize) -> Journey {
        let key = self.key(agent, visited);
        let Some((goal, key, at)) = key.filter(|_| self.fits[agent]) else {
            return Journey {
                visited,
                ..Journey::default()
            };
        };
        // The agent comes from its last goal, or its start.
        let before = match visited.checked_sub(1) {
            Some(last) => self.goals[agent].get(last),
            None => self.starts.get(agent),
        };
        let Streets {
            graph,
            moves,
            tables,
            ..
        } = &mut *self.streets;
        let before = before.and_then(|cell| graph.vertex(*cell)).unwrap_or(goal);
        let tolls = &self.tolls[at].1;
        Journey {
            visited,
            ways: if self.late {
                tables.kept(key)
            } else {
                let bytes = Ways::expected(graph, moves, before, goal);
                tables.get(key, bytes, || Ways::new(graph, moves, goal, before, tolls))
            },
            tolls: at,
        }
    }

    /// Finds the way of an agent to its first goal, and those from the cells around it, which are asked
    /// for when it makes a step.
    fn rest(&self, agent: usize, heading: Option<u8>) {
        let Streets { graph, moves, .. } = &*self.streets;
        let Journey { ways, tolls, .. } = &self.journeys[agent];
        let Some((ways, start)) = ways.as_deref().zip(graph.vertex(self.starts[agent])) else {
            return;
        };
        let tolls = self.tolls(*tolls);
        ways.from(moves, start, heading, tolls);
        for d in 0..DIRECTIONS {
            if let Some(number) = moves.away(start, d) {
                ways.along(moves, number, d, heading, tolls);
            }
        }
    }

    /// The costs of the ways of an agent to the goal after so many that it has visited, and which
    /// [`ByStreet::tolls`] they are made of; `None` where there is no
    /// room for the table, or no time to make it.
    pub(crate) fn ways(&mut self, agent: usize, visited: usize) -> Option<(Arc<Ways>, usize)> {
        let known = &self.journeys[agent];
        let journey = if known.visited == visited && known.ways.is_some() {
            known.clone()
        } else {
            self.journey(agent, visited)
        };
        journey.ways.map(|ways| (ways, journey.tolls))
    }

    /// The distances from some cells to the goal of an agent after so many that it has visited, without
    /// what streets, turns and crowds cost; `None` where there is room for all that, or for neither, or no
    /// time.
    pub(crate) fn distances(
        &mut self,
        agent: usize,
        visited: usize,
        cells: &[Vertex],
    ) -> Option<Vec<u32>> {
        let goal = *self.goals.get(agent)?.get(visited)?;
        if self.fits[agent] {
            return None;
        }
        let Streets {
            graph,
            gradients,
            tables,
            ..
        } = &mut *self.streets;
        let goal = graph.vertex(goal)?;
        let bytes = tables.limit() / 2;
        let late = &mut || self.tolls[0].1.is_late();
        let gradients = gradients.get_or_insert_with(|| Gradients::new(graph, bytes));
        if gradients.expect(graph, self.wanting, bytes, late) != Expected::Ready
            || late() && !gradients.is_kept(goal)
        {
            return None;
        }
        let row = gradients.hold(graph, goal);
        let steps = cells.iter().map(|&v| gradients.distance(graph, row, v));
        let steps = steps.collect();
        gradients.release(row);
        steps
    }

    /// Costs of moves and turns.
    pub(crate) fn tolls(&self, number: usize) -> &Tolls {
        &self.tolls[number].1
    }

    /// The moves that ways lead along.
    pub(crate) fn moves(&self) -> &Moves {
        &self.streets.moves
    }

    /// The cells on the way of an agent to its first goal, that where it is first.
    fn way(&self, agent: usize, mut heading: Option<u8>) -> impl Iterator<Item = Vertex> {
        let Streets { graph, moves, .. } = &*self.streets;
        let journey = &self.journeys[agent];
        let start = self.starts.get(agent).and_then(|cell| graph.vertex(*cell));
        let tolls = &self.tolls[journey.tolls].1;
        std::iter::successors(start, move |at| {
            let d = journey.ways.as_ref()?.best(moves, *at, heading, tolls)?;
            heading = heading.map(|_| d as u8);
            Some(graph.around(*at)[d])
        })
    }

    /// The next cells on that way; the last one again where it ends.
    fn route(&self, agent: usize, heading: Option<u8>) -> [Vertex; SIGHT] {
        let mut way = self.way(agent, heading);
        let mut at = 0;
        std::array::from_fn(|_| {
            at = way.next().unwrap_or(at);
            at
        })
    }

    /// The agents that are held back.
    fn hold_back(&self, tasks: &GoalTasks, heading: impl Fn(usize) -> Option<u8>) -> Vec<bool> {
        let crossings = &self.streets.crossings;
        let firsts = self.goals.iter().scan(0, |goals, list| {
            let first = *goals;
            *goals += list.len();
            Some(first)
        });
        let given_s = firsts.map(|goal| tasks.given_s.get(goal).copied().unwrap_or(f64::MAX));
        let mut order: Vec<(f64, usize)> = given_s.zip(0..).collect();
        order.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut admission = Admission::new(crossings.len());
        let mut held = vec![false; order.len()];
        let mut passages = Vec::new();
        for (_, agent) in order {
            passages.clear();
            let way = self.way(agent, heading(agent)).take(FAR);
            passages.extend(way.filter_map(|v| crossings.at(v)));
            passages.dedup();
            let here = self.starts.get(agent);
            let here = here.and_then(|cell| self.streets.graph.vertex(*cell));
            let can_wait = here.is_some_and(|here| crossings.can_wait(&self.streets.graph, here));
            held[agent] = admission.holds(&passages, can_wait);
        }
        held
    }

    /// Agents that are held back.
    pub fn held(&self) -> usize {
        self.held.iter().filter(|held| **held).count()
    }

    /// True if an agent had better stay where it is, since it is held back or waits at a passage.
    fn waits(&self, agent: usize) -> bool {
        let signals = self.signals.as_ref();
        self.is_held(agent) || signals.is_some_and(|signals| signals.holds(agent))
    }

    fn is_held(&self, agent: usize) -> bool {
        self.held.get(agent) == Some(&true)
    }

    /// Sees to the ways to the next goal of the agent of a [`Place`].
    #[inline]
    fn follow(&mut self, place: Place) {
        if self.journeys[place.agent].visited != place.visited {
            self.journeys[place.agent] = self.journey(place.agent, place.visited);
        }
    }
}

impl Ranking for ByStreet<'_> {
    #[inline]
    fn rank(&mut self, place: Place, cells: &mut [u32]) -> usize {
        self.follow(place);
        let Streets {
            graph,
            moves,
            crossings,
            ..
        } = &*self.streets;
        let journey = &self.journeys[place.agent];
        let Some((ways, here)) = journey.ways.as_deref().zip(graph.vertex(place.cell)) else {
            return 0;
        };
        let tolls = &self.tolls[journey.tolls].1;
        let around = graph.around(here);
        let stay = self.guide.map_or(STEP, |guide| guide.stay(place.cell));
        let mut barred = 0;
        let mut keys = [(0, 0); DIRECTIONS + 1];
        let keys = &mut keys[..cells.len()];
        for (key, &cell) in keys.iter_mut().zip(&*cells) {
            let v = graph.vertex(cell).unwrap_or(here);
            let closed = self
                .signals
                .as_ref()
                .map_or(0, |signals| signals.closed(crossings, place.agent, here, v));
            if closed > 0 {
                barred += usize::from(v != here);
                // Of two that are as bad, staying is better.
                *key = (u32::MAX - 8 + 2 * closed + u32::from(v != here), cell);
                continue;
            }
            let cost = match around.iter().position(|u| *u == v) {
                None if self.waits(place.agent) => 0,
                None => stay + ways.from(moves, here, place.heading, tolls),
                Some(d) => {
                    if let Some(number) = moves.away(here, d) {
                        ways.along(moves, number, d, place.heading, tolls)
                    } else {
                        barred += 1;
                        u32::MAX
                    }
                }
            };
            *key = (cost, cell);
        }
        keys.sort_by_key(|key| key.0);
        for (cell, key) in cells.iter_mut().zip(&*keys) {
            *cell = key.1;
        }
        barred
    }

    #[inline]
    fn urgency(&mut self, place: Place, distance: u32) -> u32 {
        self.follow(place);
        let journey = &self.journeys[place.agent];
        let here = self.streets.graph.vertex(place.cell);
        match journey.ways.as_deref().zip(here) {
            Some((ways, here)) => {
                let (moves, tolls) = (&self.streets.moves, &self.tolls[journey.tolls].1);
                let class = match &self.signals {
                    _ if self.is_held(place.agent) => 3,
                    Some(_) if self.streets.crossings.contains(here) => 0,
                    Some(signals) if signals.holds(place.agent) => 2,
                    _ => 1,
                };
                class << 20 | ways.from(moves, here, place.heading, tolls)
            }
            None => distance.saturating_mul(STEP),
        }
    }
}
