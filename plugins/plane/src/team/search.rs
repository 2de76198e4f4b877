//! The earliest way of one disc among discs on their ways, in space and time together.
//!
//! Safe-interval path planning (M. Phillips, M. Likhachev, "SIPP: Safe interval path planning for dynamic environments", ICRA
//! 2011): a state is a place and one of the intervals of time in which it is safe, and of the ways into it the earliest is kept.
//! Lines are straight motions in continuous time; the times at which they must not begin are exact ([`crate::motion`]; K. Kasaura,
//! M. Nishimura, R. Yonetani, RA-L 7(4), 2022, on given roadmaps). They are worked out for a line only when it is the best that is
//! left, as if nobody were in its way.
//!
//! [`Search::through`] finds, for a disc that has no way, one through others that is short and meets few of them.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use super::ground::{Course, Ground};
use super::traffic::Traffic;
use crate::Vector;
use crate::motion::{Motion, Span};
use crate::spans::Spans;
use crate::timing::Stop;

/// Seconds in which others are looked at, at a time, to find when a line is free.
const SLICE: f64 = 1.0;

/// Limits of a run.
pub struct Control<'a> {
    /// Says when to stop. Asked often.
    pub stop: &'a mut dyn FnMut() -> bool,
    /// Searches that are left.
    pub nodes: u64,
    /// Searches so far.
    pub searches: u64,
    /// Expansions so far.
    pub expanded: u64,
}

impl Control<'_> {
    /// Counts a search. False when it is one too many.
    pub fn search(&mut self) -> bool {
        if self.ended() {
            return false;
        }
        self.nodes -= 1;
        self.searches += 1;
        true
    }

    /// Counts an expansion. False when it is time to stop.
    fn expand(&mut self) -> bool {
        self.expanded += 1;
        !(self.stop)()
    }

    /// A limit was met.
    pub fn ended(&mut self) -> bool {
        self.nodes == 0 || (self.stop)()
    }
}

/// A disc that looks for a way.
#[derive(Debug, Clone, Copy)]
pub struct Driver {
    /// Its number.
    pub disc: u32,
    /// Metres per second.
    pub speed: f64,
    /// It stays at its start until this time.
    pub hold: f64,
    /// Ways that arrive at this time or later are of no use.
    pub before: f64,
    /// Most states to expand.
    pub most: u64,
}

/// A state that was reached.
#[derive(Debug, Clone, Copy)]
struct State {
    place: u32,
    /// The number of its safe interval.
    interval: u32,
    parent: u32,
    arrival: f64,
    /// When it was left for here, at the parent.
    set_out: f64,
    /// Arrival and penalties.
    cost: f64,
}

/// A way to go on.
#[derive(Debug, Clone, Copy)]
enum Step {
    /// From a state.
    Reached(u32),
    /// Along a line from a state, if that is possible.
    Line { from: u32, to: u32, length: f64 },
}

/// A step that was not tried yet; the greatest is the best.
struct Entry {
    estimate: f64,
    rest: f64,
    step: Step,
}

impl PartialEq for Entry {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Entry {}

impl PartialOrd for Entry {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Entry {
    fn cmp(&self, other: &Self) -> Ordering {
        let least = other.estimate.total_cmp(&self.estimate);
        least.then(other.rest.total_cmp(&self.rest))
    }
}

/// A place in a search.
#[derive(Debug, Default)]
struct Slot {
    /// The number of the search that made it.
    search: u32,
    taken: Spans,
    /// The least arrival in each safe interval; in a search through others the least cost.
    best: Vec<f64>,
    /// Seconds to the goal, and true if the way is straight.
    rest: (f64, bool),
}

/// Searches, one after the other; memory is kept between them.
#[derive(Debug)]
pub struct Search {
    most_states: usize,
    slots: Vec<Slot>,
    number: u32,
    states: Vec<State>,
    open: BinaryHeap<Entry>,
    forbidden: Spans,
}

impl std::fmt::Debug for Entry {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:?} at {}", self.step, self.estimate)
    }
}

/// All that a search reads.
pub struct Field<'a> {
    /// The places.
    pub ground: &'a mut Ground,
    /// Start and goal.
    pub course: &'a mut Course,
    /// The others.
    pub traffic: &'a mut Traffic,
    /// The distances to keep from them; zero for those who do not matter.
    pub apart: &'a [f64],
}

impl Field<'_> {
    fn start(&self) -> u32 {
        self.ground.len() as u32
    }

    fn goal(&self) -> u32 {
        self.start() + 1
    }

    fn at(&self, place: u32) -> Vector {
        if place == self.start() {
            self.course.start
        } else if place == self.goal() {
            self.course.distances.goal()
        } else {
            self.ground.at(place)
        }
    }

    /// Metres to the goal.
    fn rest(&mut self, place: u32) -> (f64, bool) {
        if place == self.start() {
            self.course.from_start
        } else if place == self.goal() {
            (0.0, false)
        } else {
            self.course.distances.from(self.ground, place)
        }
    }

    /// Calls `found` with every place to which a line leads, and the length of that.
    fn lines(&mut self, place: u32, mut found: impl FnMut(&mut Self, u32, f64)) {
        let (rest, straight) = self.rest(place);
        if straight {
            let goal = self.goal();
            found(self, goal, rest);
        }
        if place == self.start() {
            for at in 0..self.course.lines.len() {
                let line = self.course.lines[at];
                found(self, line.to, line.length);
            }
            return;
        }
        for at in 0..self.ground.to_turns(place).len() {
            let line = self.ground.to_turns(place)[at];
            found(self, line.to, line.length);
        }
        for at in 0..self.ground.to_bays(place).len() {
            let line = self.ground.to_bays(place)[at];
            found(self, line.to, line.length);
        }
    }
}

impl Search {
    /// Searches that reach so many states at most.
    pub fn new(most_states: usize) -> Self {
        Self {
            most_states,
            slots: Vec::new(),
            number: 0,
            states: Vec::new(),
            open: BinaryHeap::new(),
            forbidden: Spans::new(),
        }
    }

    fn begin(&mut self, field: &Field<'_>) {
        self.number = self.number.wrapping_add(1);
        if self.number == 0 {
            self.slots.clear();
            self.number = 1;
        }
        let places = field.ground.len() + 2;
        if self.slots.len() < places {
            self.slots.resize_with(places, Slot::default);
        }
        self.states.clear();
        self.open.clear();
    }

    /// Makes sure that a place is known to this search.
    fn touch(&mut self, field: &mut Field<'_>, driver: &Driver, place: u32) {
        let slot = &mut self.slots[place as usize];
        if slot.search == self.number {
            return;
        }
        slot.search = self.number;
        slot.taken.clear();
        let at = field.at(place);
        field
            .traffic
            .taken(driver.disc, at, field.apart, &mut slot.taken);
        slot.best.clear();
        slot.best
            .resize(slot.taken.as_slice().len() + 1, f64::INFINITY);
        let (rest, straight) = field.rest(place);
        slot.rest = (rest / driver.speed, straight);
    }

    /// The stops on the earliest way: at the start at time 0, at the goal for ever. None where there is none, or where a limit is
    /// met.
    pub fn earliest(
        &mut self,
        field: &mut Field<'_>,
        driver: &Driver,
        control: &mut Control<'_>,
    ) -> Option<Vec<Stop>> {
        self.begin(field);
        let (start, goal) = (field.start(), field.goal());
        self.touch(field, driver, start);
        self.touch(field, driver, goal);
        let first = self.slots[start as usize].taken.ended(0.0);
        let last = self.slots[goal as usize].taken.as_slice().len();
        let safe = self.slots[start as usize].taken.safe(first);
        if safe.low > 0.0 || safe.high < driver.hold {
            return None;
        }
        // Nobody arrives for good while others are still to pass.
        let free = self.slots[goal as usize].taken.safe(last).low.max(0.0);
        let rest = self.slots[start as usize].rest.0;
        if !free.is_finite() || free.max(rest) >= driver.before {
            return None;
        }
        self.reach(start, first, 0, [0.0, driver.hold], free);
        let mut left = driver.most;
        while let Some(entry) = self.open.pop() {
            match entry.step {
                Step::Reached(number) => {
                    let state = self.states[number as usize];
                    let slot = &self.slots[state.place as usize];
                    if state.arrival > slot.best[state.interval as usize] {
                        continue;
                    }
                    if state.place == goal {
                        if state.interval as usize == last {
                            return Some(self.stops(field, number));
                        }
                        continue;
                    }
                    if left == 0 || !control.expand() {
                        return None;
                    }
                    left -= 1;
                    self.expand(field, driver, number, free);
                }
                Step::Line { from, to, length } => {
                    self.drive(field, driver, (from, to, length), free);
                }
            }
        }
        None
    }

    /// Takes up a state.
    fn reach(&mut self, place: u32, interval: usize, parent: u32, times: [f64; 2], free: f64) {
        let slot = &mut self.slots[place as usize];
        let [set_out, arrival] = times;
        if arrival >= slot.best[interval] || self.states.len() >= self.most_states {
            return;
        }
        slot.best[interval] = arrival;
        let rest = slot.rest.0;
        self.open.push(Entry {
            estimate: (arrival + rest).max(free),
            rest,
            step: Step::Reached(self.states.len() as u32),
        });
        self.states.push(State {
            place,
            interval: interval as u32,
            parent,
            arrival,
            set_out,
            cost: arrival,
        });
    }

    /// Offers the lines from a state.
    fn expand(&mut self, field: &mut Field<'_>, driver: &Driver, from: u32, free: f64) {
        let state = self.states[from as usize];
        field.lines(state.place, |field, to, length| {
            let rest = field.rest(to).0 / driver.speed;
            let arrival = state.arrival + length / driver.speed;
            let estimate = (arrival + rest).max(free);
            if estimate >= driver.before {
                return;
            }
            let slot = &self.slots[to as usize];
            if slot.search == self.number && slot.best[slot.best.len() - 1] <= arrival {
                return;
            }
            self.open.push(Entry {
                estimate,
                rest,
                step: Step::Line { from, to, length },
            });
        });
    }

    /// Reaches all safe intervals of the place at the end of a line, each as early as it can be.
    fn drive(
        &mut self,
        field: &mut Field<'_>,
        driver: &Driver,
        (from, to, length): (u32, u32, f64),
        free: f64,
    ) {
        let state = self.states[from as usize];
        let seconds = length / driver.speed;
        self.touch(field, driver, to);
        let until = self.slots[state.place as usize]
            .taken
            .safe(state.interval as usize)
            .high;
        let mut interval = self.slots[to as usize].taken.ended(state.arrival + seconds);
        let intervals = self.slots[to as usize].best.len();
        let better = |slot: &Slot, interval: usize| {
            let arrival = (state.arrival + seconds).max(slot.taken.safe(interval).low);
            arrival < slot.best[interval] && arrival - seconds <= until
        };
        while interval < intervals && !better(&self.slots[to as usize], interval) {
            interval += 1;
        }
        if interval == intervals {
            return;
        }
        let motion = Motion::between(field.at(state.place), field.at(to), seconds);
        let mut soonest = state.arrival;
        for interval in interval..intervals {
            let safe = self.slots[to as usize].taken.safe(interval);
            soonest = soonest.max(safe.low - seconds);
            let Some(set_out) = self.set_out(field, driver.disc, &motion, [soonest, until]) else {
                return;
            };
            let arrival = (set_out + seconds).max(safe.low);
            if arrival + self.slots[to as usize].rest.0 >= driver.before {
                return;
            }
            if arrival <= safe.high {
                self.reach(to, interval, from, [set_out, arrival], free);
            }
            soonest = set_out;
        }
    }

    /// The first time from `soonest` to `latest` at which a motion may begin.
    fn set_out(
        &mut self,
        field: &mut Field<'_>,
        disc: u32,
        motion: &Motion,
        [mut soonest, latest]: [f64; 2],
    ) -> Option<f64> {
        // Most lines are free at once, whatever happens later.
        while soonest <= latest && soonest.is_finite() {
            let within = Span {
                low: soonest,
                high: latest.min(soonest + SLICE),
            };
            self.forbidden.clear();
            let (traffic, forbidden) = (&mut *field.traffic, &mut self.forbidden);
            traffic.forbidden(disc, motion, within, field.apart, forbidden);
            soonest = forbidden.first_outside(soonest);
            if soonest <= within.high {
                return Some(soonest);
            }
        }
        None
    }

    /// The stops on the way to a state.
    fn stops(&self, field: &Field<'_>, last: u32) -> Vec<Stop> {
        let (mut stops, mut departure, mut number) = (Vec::new(), f64::INFINITY, last);
        loop {
            let state = self.states[number as usize];
            stops.push(Stop {
                at: field.at(state.place),
                arrival: if number == 0 { 0.0 } else { state.arrival },
                departure,
            });
            if number == 0 {
                break;
            }
            (number, departure) = (state.parent, state.set_out);
        }
        stops.reverse();
        stops
    }

    /// The stops on a way that goes without a wait, keeps clear of those whom `field.apart` has, and is cheap by its time
    /// and the `penalty`, in seconds, of each of `others`, with their distances, that is met on a line. None where there is none, or where a limit is
    /// met.
    pub fn through(
        &mut self,
        field: &mut Field<'_>,
        others: &[f64],
        penalty: &dyn Fn(u32) -> f64,
        driver: &Driver,
        control: &mut Control<'_>,
    ) -> Option<Vec<Stop>> {
        self.begin(field);
        let (start, goal) = (field.start(), field.goal());
        self.touch(field, driver, start);
        self.touch(field, driver, goal);
        let last = self.slots[goal as usize].taken.as_slice().len();
        let first = self.slots[start as usize].taken.ended(0.0);
        if self.slots[start as usize].taken.safe(first).low > 0.0 {
            return None;
        }
        self.slots[start as usize].best[0] = 0.0;
        self.pass(start, first, 0, [0.0; 3]);
        let mut met = Vec::new();
        while let Some(entry) = self.open.pop() {
            match entry.step {
                Step::Reached(number) => {
                    let state = self.states[number as usize];
                    if state.cost > self.slots[state.place as usize].best[0] {
                        continue;
                    }
                    if state.place == goal {
                        return Some(self.stops(field, number));
                    }
                    if !control.expand() {
                        return None;
                    }
                    field.lines(state.place, |field, to, length| {
                        let rest = field.rest(to).0 / driver.speed;
                        let cost = state.cost + length / driver.speed;
                        let slot = &self.slots[to as usize];
                        if slot.search == self.number && slot.best[0] <= cost {
                            return;
                        }
                        self.open.push(Entry {
                            estimate: cost + rest,
                            rest,
                            step: Step::Line {
                                from: number,
                                to,
                                length,
                            },
                        });
                    });
                }
                Step::Line { from, to, length } => {
                    let state = self.states[from as usize];
                    let seconds = length / driver.speed;
                    self.touch(field, driver, to);
                    let motion = Motion::between(field.at(state.place), field.at(to), seconds);
                    let here = &self.slots[state.place as usize].taken;
                    let until = here.safe(state.interval as usize).high;
                    let there = &self.slots[to as usize].taken;
                    let soonest = if to == goal {
                        there.safe(last).low - seconds
                    } else {
                        there.first_outside(state.arrival + seconds) - seconds
                    };
                    let times = [state.arrival.max(soonest), until];
                    let Some(set_out) = self.set_out(field, driver.disc, &motion, times) else {
                        continue;
                    };
                    let there = &self.slots[to as usize].taken;
                    let arrival = set_out + seconds;
                    let interval = there.ended(arrival);
                    if there.safe(interval).low > arrival + 1e-9 || (to == goal && interval != last)
                    {
                        continue;
                    }
                    met.clear();
                    let traffic = &mut *field.traffic;
                    traffic.meeting(driver.disc, (set_out, &motion), others, |disc| {
                        met.push(disc);
                    });
                    let wait = match to == goal {
                        true => Some((
                            arrival,
                            Motion::rest(field.course.distances.goal(), f64::INFINITY),
                        )),
                        false if set_out > state.arrival => Some((
                            state.arrival,
                            Motion::rest(motion.from, set_out - state.arrival),
                        )),
                        false => None,
                    };
                    if let Some((from, wait)) = wait {
                        traffic.meeting(driver.disc, (from, &wait), others, |disc| met.push(disc));
                    }
                    met.sort_unstable();
                    met.dedup();
                    let penalties: f64 = met.iter().map(|disc| penalty(*disc)).sum();
                    let cost = state.cost + (arrival - state.arrival) + penalties;
                    let slot = &mut self.slots[to as usize];
                    if cost < slot.best[0] && self.states.len() < self.most_states {
                        slot.best[0] = cost;
                        self.pass(to, interval, from, [set_out, arrival, cost]);
                    }
                }
            }
        }
        None
    }

    fn pass(&mut self, place: u32, interval: usize, parent: u32, times: [f64; 3]) {
        let [set_out, arrival, cost] = times;
        let rest = self.slots[place as usize].rest.0;
        self.open.push(Entry {
            estimate: cost + rest,
            rest,
            step: Step::Reached(self.states.len() as u32),
        });
        self.states.push(State {
            place,
            interval: interval as u32,
            parent,
            arrival,
            set_out,
            cost,
        });
    }
}
