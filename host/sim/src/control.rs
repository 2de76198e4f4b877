//! Driven bodies: controllers and models move them along their routes.
//!
//! A policy bounds each agent's progress: `released` is the last knot of its route that
//! it may head for. Released actions that lie on one straight line are driven as one leg
//! with one stop at its end; where a way bends a little, bodies that move in any direction
//! go on without one. Within a block of ticks no agent influences another, so that
//! all of them can be driven at once.

use std::f64::consts::FRAC_PI_2;

use fleetyard_world::Pose;

use crate::ahead::Cone;
use crate::chunk::{Chunk, Off};
use crate::gate::Routes;
use crate::motion::{Model, State, Target, stopping_speed, wrap};
use crate::noise::{Noise, Slip};
use crate::route::Place;
use crate::track::{Span, Tracks, fraction, interpolate};

/// The progress of a body along its route.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Pilot {
    pub(crate) state: State,
    /// The last knot reached.
    pub(crate) done: u32,
    /// The knot at the end of the current leg.
    pub(crate) leg: u32,
    /// Start of the leg.
    from: Place,
    /// Earliest departure, in substeps.
    hold: f64,
    /// End of the current stop, in substeps; the body stands wherever it is.
    stop: f64,
    /// The last knot whose planned time has passed.
    due: u32,
    /// The last action whose delay was drawn.
    drawn: u32,
    /// Time spent on the current action, for bodies without a controller.
    spent: f64,
    /// Time at which the last knot was reached for good, in substeps; infinite before.
    pub(crate) arrival: f64,
    /// Set once the arrival has been reported.
    pub(crate) told: bool,
}

impl Pilot {
    pub(crate) fn new(start: Pose) -> Self {
        Self {
            state: State::at_rest(start.x, start.y, start.heading),
            done: 0,
            leg: 0,
            from: Place {
                x: start.x,
                y: start.y,
                heading: None,
            },
            hold: 0.0,
            stop: 0.0,
            due: 0,
            drawn: 0,
            spent: 0.0,
            arrival: f64::INFINITY,
            told: false,
        }
    }
}

/// Source of the agents' releases.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Releases<'a> {
    /// The times of the plan.
    Time,
    /// The order of passing: per agent the last knot.
    Order(&'a [u32]),
}

/// Drives bodies through a block.
#[derive(Clone, Copy)]
pub(crate) struct Driver<'a> {
    pub(crate) routes: &'a dyn Routes,
    /// Set if the headings of the routes are meaningful.
    pub(crate) headings: bool,
    /// Set if a plan of poses is followed in time by chasing its current pose.
    pub(crate) chase: bool,
    pub(crate) substeps_per_s: f64,
    /// The largest speed of bodies without a controller, in metres per second.
    pub(crate) plan_speed: f64,
    pub(crate) releases: Releases<'a>,
    pub(crate) noise: &'a Noise,
    /// Index of the block, for the noise.
    pub(crate) number: u64,
    pub(crate) block: Span,
    /// The ends of the block's ticks.
    pub(crate) ticks: &'a [f64],
    pub(crate) tick_s: f64,
}

impl Place {
    fn target(self) -> Target {
        Target {
            x: self.x,
            y: self.y,
            heading: self.heading,
        }
    }
}

/// Interpolates between two places.
fn between(from: Place, to: Place, share: f64) -> Place {
    Place {
        x: interpolate(from.x, to.x, share),
        y: interpolate(from.y, to.y, share),
        heading: from
            .heading
            .zip(to.heading)
            .map(|(from, to)| interpolate(from, to, share)),
    }
}

/// Arrival tolerance, in metres, of bodies without a controller that can be pushed.
const CLOSE_M: f64 = 0.01;

/// Arrival tolerance, in metres and radians, of bodies that are exact by themselves but can be
/// pushed: what their drives leave.
const EXACT: f64 = 0.001;

/// Acceleration of bodies without limits, in m/s² and rad/s²: harder drives press robots
/// into each other (docs/results/simulator.md).
pub(crate) const UNLIMITED: f64 = 15.0;

/// Deceleration in m/s² and rad/s² that bodies without limits plan with where contacts are
/// solved: less than their drives have, whose work within a tick is not instant.
const BRAKING: f64 = 0.5 * UNLIMITED;

/// Share of the arrival tolerances within which the line from a way to the place ahead passes the knots
/// between, for bodies that do not stop at bends. A body that always heads for such a place goes round
/// a circle inside of its way at four times the distance, and brakes across its way too.
const BEND: f64 = 0.2;

/// A way that bends by more than 45° is driven with a stop: this is the cosine.
const SHARPEST: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// Distance that a body looks ahead on its way: so many stopping distances (a body that turns brakes
/// at half its acceleration), so many seconds at its speed, and so many metres.
const AHEAD: [f64; 3] = [2.0, 0.5, 0.1];

/// Places nearer than this to each other, in metres, are equal.
const SAME_M: f64 = 1e-9;

/// True if a body is at the end of its leg; `last` if the leg ends at the route's last
/// knot.
fn is_there(model: &Model, last: bool, state: &State, target: &Target) -> bool {
    if last {
        model.has_finished(state, target)
    } else {
        model.has_arrived(state, target)
    }
}

fn same(a: Place, b: Place) -> bool {
    let (dx, dy) = (a.x - b.x, a.y - b.y);
    let heading = match (a.heading, b.heading) {
        (Some(a), Some(b)) => (a - b).abs() <= 1e-9,
        _ => true,
    };
    dx * dx + dy * dy <= SAME_M * SAME_M && heading
}

/// Metres that a radian counts as on a way: as far as corners of a body move that is a metre long. Headings decide
/// where a body is on ways on which it turns more than it moves.
const RADIAN_M: f64 = 0.5;

/// The way from a place to another one: metres along both axes and, where both have headings, of the turn.
fn way(from: Place, to: Place) -> [f64; 3] {
    let headings = from.heading.zip(to.heading);
    let turn = headings.map_or(0.0, |(from, to)| RADIAN_M * (to - from));
    [to.x - from.x, to.y - from.y, turn]
}

fn dot([ax, ay, at]: [f64; 3], [bx, by, bt]: [f64; 3]) -> f64 {
    ax * bx + ay * by + at * bt
}

/// True if the way continues straight through `by` to `to`, with the same turn per metre.
fn goes_on(from: Place, by: Place, to: Place) -> bool {
    let (a, b) = (way(from, by), way(by, to));
    let ([ax, ay, at], [bx, by, bt]) = (a, b);
    let across = [ax * by - ay * bx, ax * bt - at * bx, ay * bt - at * by];
    let most = 1e-18 * dot(a, a) * dot(b, b);
    across.iter().all(|cross| cross * cross <= most)
        && ax * bx + ay * by >= 0.0
        && (ax != 0.0 || ay != 0.0)
}

/// The directions half-way between those of two ways that meet, with turns and without, if the bend between
/// them needs no stop: whoever has crossed the planes across both is on the second way. A body stops before it
/// turns more than it moves.
fn bisectors(from: Place, by: Place, to: Place) -> Option<[[f64; 3]; 2]> {
    let half_way = |a: [f64; 3], b: [f64; 3]| {
        let unit = |way: [f64; 3]| {
            let length = dot(way, way).sqrt();
            (length > SAME_M).then(|| way.map(|part| part / length))
        };
        let (a, b) = (unit(a)?, unit(b)?);
        (dot(a, b) >= SHARPEST).then(|| [0, 1, 2].map(|axis| a[axis] + b[axis]))
    };
    let (a, b) = (way(from, by), way(by, to));
    let flat = |[x, y, _]: [f64; 3]| [x, y, 0.0];
    Some([half_way(a, b)?, half_way(flat(a), flat(b))?])
}

/// Part of a turn that counts for the nearest place on a way: little for robots on wheels, which head elsewhere
/// than their plan.
fn share_of_turns(model: Option<&Model>) -> f64 {
    if model.is_some_and(Model::keeps_headings) {
        1.0
    } else {
        0.2
    }
}

/// The place on a way that is nearest to a body of this model; the end of a way that goes nowhere.
fn nearest(model: Option<&Model>, from: Place, to: Place, body: &State) -> Place {
    let share = share_of_turns(model);
    let seen = |to: Place| {
        let [x, y, turn] = way(from, to);
        [x, y, share * turn]
    };
    let whole = seen(to);
    let length = dot(whole, whole);
    let share = if length > 0.0 {
        (dot(seen(at(body)), whole) / length).clamp(0.0, 1.0)
    } else {
        1.0
    };
    between(from, to, share)
}

/// The place of a body.
fn at(body: &State) -> Place {
    Place {
        x: body.x,
        y: body.y,
        heading: Some(body.heading),
    }
}

/// The farthest place on a way, of which the end is too far, that a cone admits.
fn farthest(cone: &Cone, from: Place, to: Place) -> Option<Place> {
    const HALVINGS: usize = 8;
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if cone.admits(between(from, to, middle)) {
            low = middle;
        } else {
            high = middle;
        }
    }
    (low > 0.0).then(|| between(from, to, low))
}

impl Driver<'_> {
    fn place(&self, agent: usize, knot: u32) -> Place {
        let pose = self.routes.pose(agent, knot as usize);
        Place {
            x: pose.x,
            y: pose.y,
            heading: self.headings.then_some(pose.heading),
        }
    }

    /// Planned time of a knot, in substeps.
    fn time(&self, agent: usize, knot: u32) -> f64 {
        self.routes.time_s(agent, knot as usize) * self.substeps_per_s
    }

    fn last(&self, agent: usize) -> u32 {
        self.routes.actions(agent) as u32
    }

    /// Updates the last knot whose planned time has passed.
    fn look_at_the_clock(&self, agent: usize, pilot: &mut Pilot, when: f64) {
        let last = self.last(agent);
        while pilot.due < last && self.time(agent, pilot.due + 1) <= when {
            pilot.due += 1;
        }
    }

    /// Planned place of the agent at a moment, from `pilot.due`.
    fn planned(&self, agent: usize, pilot: &Pilot, when: f64) -> Place {
        let here = self.place(agent, pilot.due);
        if pilot.due >= self.last(agent) {
            return here;
        }
        let next = self.place(agent, pilot.due + 1);
        let (from, to) = (self.time(agent, pilot.due), self.time(agent, pilot.due + 1));
        between(here, next, fraction(from, to, when))
    }

    /// The last released knot of the agent.
    fn released(&self, agent: usize, pilot: &mut Pilot) -> u32 {
        match self.releases {
            Releases::Time => {
                self.look_at_the_clock(agent, pilot, self.block.start);
                (pilot.due + 1).min(self.last(agent)).max(pilot.done)
            }
            Releases::Order(released) => released[agent],
        }
    }

    /// Appends the track of the next body of a chunk, which has a model with a
    /// controller.
    pub(crate) fn drive(&self, model: &Model, chunk: &mut Chunk, lane: usize) {
        let agent = chunk.first as usize + lane;
        let pilot = &mut chunk.pilots[lane];
        let tracks = &mut chunk.tracks;
        tracks.open();
        let State { x, y, heading, .. } = pilot.state;
        tracks.push(self.block.start, x, y, heading);
        let released = self.released(agent, pilot);
        let factor = chunk.factors[lane];
        let slip = chunk.slips.get(lane).copied().unwrap_or_default();
        let chase = self.chase;
        let before = (pilot.done, pilot.leg);
        let mut stood = false;
        let mut left = self.ticks;
        if left.is_empty() {
            tracks.push(self.block.end, x, y, heading);
        }
        if chase && model.is_exact() {
            self.keep_up(model, agent, pilot, factor, tracks);
            left = &[];
        }
        while !left.is_empty() {
            let begin = self.ticks.len() - left.len();
            let now = if begin == 0 {
                self.block.start
            } else {
                self.ticks[begin - 1]
            };
            let target = if chase {
                self.look_at_the_clock(agent, pilot, self.block.end);
                pilot.done = pilot.due;
                Some(self.planned(agent, pilot, self.block.end))
            } else {
                self.leg(agent, pilot, released, now)
            };
            let ahead = target.and_then(|_| self.ahead(model, agent, pilot, released));
            let rest = target.is_none();
            if rest && pilot.state.vx == 0.0 && pilot.state.vy == 0.0 && pilot.state.omega == 0.0 {
                let State { x, y, heading, .. } = pilot.state;
                tracks.push(self.block.end, x, y, heading);
                stood = begin == 0;
                break;
            }
            // A body without a leg stays where its last one ended.
            let target = ahead
                .or(target)
                .unwrap_or_else(|| self.place(agent, pilot.done))
                .target();
            // A body that finishes its leg within the block starts its next leg at once.
            let last = pilot.leg == self.last(agent);
            let mut arrived: Option<(usize, State)> = None;
            let mut count = 0;
            if ahead.is_some() || self.noise.has_slips() {
                // What comes next depends on where the body is after each tick.
                let state = &mut pilot.state;
                model.run(state, &target, 1, self.tick_s, factor, &mut |_| {});
                self.slip(slip, state);
                tracks.push(left[0], state.x, state.y, state.heading);
                let end = left[0];
                left = &left[1..];
                if ahead.is_some() {
                    self.pass_bends(agent, pilot, released, end);
                } else if !rest && !chase && is_there(model, last, &pilot.state, &target) {
                    self.reach(agent, pilot, end);
                } else if !rest && !chase {
                    self.pass(agent, pilot);
                }
                continue;
            }
            model.run(
                &mut pilot.state,
                &target,
                left.len(),
                self.tick_s,
                factor,
                &mut |state: &State| {
                    if arrived.is_none() {
                        tracks.push(left[count], state.x, state.y, state.heading);
                        count += 1;
                        if !rest && !chase && is_there(model, last, state, &target) {
                            arrived = Some((count, *state));
                        }
                    }
                },
            );
            if let Some((count, state)) = arrived {
                pilot.state = state;
                left = &left[count..];
                self.reach(agent, pilot, self.ticks[begin + count - 1]);
            } else {
                left = &[];
                if !chase && !rest {
                    self.pass(agent, pilot);
                }
            }
        }
        if chase && pilot.done == self.last(agent) && pilot.arrival.is_infinite() {
            let goal = self.place(agent, pilot.done).target();
            if model.has_finished(&pilot.state, &goal) {
                pilot.arrival = self.block.end;
            }
        }
        let known = chunk.errors[lane];
        let by_order = matches!(self.releases, Releases::Order(_));
        // A standing body keeps its distance from the end of its leg.
        let off = if stood && by_order && before == (pilot.done, pilot.leg) && !known.m.is_nan() {
            known
        } else {
            self.off(Some(model), agent, pilot)
        };
        chunk.errors[lane] = off;
        chunk.tracking.note(agent as u32, off, self.block.length());
    }

    /// Moves an exact body along a plan of poses in time, through all its knots, as long as it
    /// is on the planned place and not slowed down; otherwise it runs after it.
    fn keep_up(
        &self,
        model: &Model,
        agent: usize,
        pilot: &mut Pilot,
        factor: f64,
        tracks: &mut Tracks,
    ) {
        let mut now = self.block.start;
        for end in self.ticks {
            self.look_at_the_clock(agent, pilot, now);
            let here = self.planned(agent, pilot, now);
            let (due, before) = (pilot.due, pilot.state);
            self.look_at_the_clock(agent, pilot, *end);
            let there = self.planned(agent, pilot, *end);
            let (dx, dy) = (here.x - before.x, here.y - before.y);
            let turned = here
                .heading
                .is_some_and(|heading| (heading - before.heading).abs() > SAME_M);
            let state = &mut pilot.state;
            if factor < 1.0 || turned || dx * dx + dy * dy > SAME_M * SAME_M {
                model.run(state, &there.target(), 1, self.tick_s, factor, &mut |_| {});
            } else {
                for knot in due + 1..=pilot.due {
                    let (time, place) = (self.time(agent, knot), self.place(agent, knot));
                    if time < *end {
                        let heading = place.heading.unwrap_or(before.heading);
                        tracks.push(time, place.x, place.y, heading);
                    }
                }
                (state.x, state.y) = (there.x, there.y);
                state.heading = there.heading.unwrap_or(before.heading);
                state.vx = (state.x - before.x) / self.tick_s;
                state.vy = (state.y - before.y) / self.tick_s;
                state.omega = (state.heading - before.heading) / self.tick_s;
            }
            tracks.push(*end, state.x, state.y, state.heading);
            now = *end;
        }
        pilot.done = pilot.due;
    }

    /// Velocity that the agent requests for the end of a tick from its current state, for
    /// bodies that can be pushed: the next step of its model, or for bodies without a
    /// controller the way to the planned place. `now` is the start of the tick.
    pub(crate) fn wish(
        &self,
        model: Option<&Model>,
        agent: usize,
        pilot: &mut Pilot,
        factor: f64,
        [now, end]: [f64; 2],
    ) -> State {
        let released = self.released(agent, pilot);
        let model = model.filter(|model| !model.is_ideal());
        let by_time = matches!(self.releases, Releases::Time);
        let target = if self.chase || (by_time && model.is_none()) {
            self.look_at_the_clock(agent, pilot, end);
            pilot.done = pilot.due;
            pilot.leg = pilot.due;
            Some(self.planned(agent, pilot, end))
        } else {
            let end = self.leg(agent, pilot, released, now);
            let through = model.filter(|_| end.is_some());
            let ahead = through.and_then(|model| self.ahead(model, agent, pilot, released));
            ahead.or(end)
        };
        let target = target
            .unwrap_or_else(|| self.place(agent, pilot.done))
            .target();
        let mut state = pilot.state;
        if let Some(model) = model {
            model.run(&mut state, &target, 1, self.tick_s, factor, &mut |_| {});
            if (model.is_exact() || matches!(model, Model::DoubleIntegrator(_))) && !by_time {
                self.brake(&mut state, &pilot.state, &target);
            }
            return state;
        }
        let (dx, dy) = (target.x - state.x, target.y - state.y);
        let distance = (dx * dx + dy * dy).sqrt();
        let most = self.plan_speed * self.tick_s * factor;
        let part = if distance > most {
            most / distance
        } else {
            1.0
        };
        state.vx = dx * part / self.tick_s;
        state.vy = dy * part / self.tick_s;
        let turn = target
            .heading
            .map_or(0.0, |heading| heading - state.heading);
        state.omega = turn / self.tick_s;
        if !by_time {
            self.brake(&mut state, &pilot.state, &target);
        }
        state
    }

    /// Slows a body that has no limits of its own so far down that its drive stops it at its
    /// target: who passes there next relies on that.
    fn brake(&self, wish: &mut State, now: &State, target: &Target) {
        let (dx, dy) = (target.x - now.x, target.y - now.y);
        let turn = target
            .heading
            .map_or(0.0, |heading| (heading - now.heading).abs());
        let speed = (wish.vx * wish.vx + wish.vy * wish.vy).sqrt();
        let mut part: f64 = 1.0;
        for (rate, gap) in [
            (speed, (dx * dx + dy * dy).sqrt()),
            (wish.omega.abs(), turn),
        ] {
            if rate > 0.0 {
                part = part.min(stopping_speed(gap, BRAKING, self.tick_s) / rate);
            }
        }
        wish.vx *= part;
        wish.vy *= part;
        wish.omega *= part;
    }

    /// Updates the progress of a body that can be pushed from its actual place.
    pub(crate) fn notice(&self, model: Option<&Model>, agent: usize, pilot: &mut Pilot, now: f64) {
        let target = self.place(agent, pilot.leg.max(pilot.done)).target();
        let state = &pilot.state;
        let is_near = |by: f64| {
            let (dx, dy) = (target.x - state.x, target.y - state.y);
            dx * dx + dy * dy <= by * by
        };
        let arrived = match model.filter(|model| !model.is_ideal()) {
            Some(model) if model.is_exact() => {
                let turn = target.heading.map(|heading| heading - state.heading);
                is_near(EXACT) && turn.is_none_or(|turn| turn.abs() <= EXACT)
            }
            Some(model) => {
                let last = pilot.leg.max(pilot.done) == self.last(agent);
                is_there(model, last, state, &target)
            }
            None => is_near(CLOSE_M),
        };
        if pilot.leg > pilot.done {
            if arrived {
                self.reach(agent, pilot, now);
            } else if model.is_some_and(Model::goes_through_bends) {
                let released = self.released(agent, pilot);
                self.pass_bends(agent, pilot, released, now);
            } else {
                self.pass(agent, pilot);
            }
        } else if arrived {
            self.note_arrival(agent, pilot, now);
        }
    }

    /// Tracking error of a body at the end of the block: its distance and angle from the planned
    /// pose or, under an order of passing, from its leg.
    pub(crate) fn off(&self, model: Option<&Model>, agent: usize, pilot: &mut Pilot) -> Off {
        let State { x, y, heading, .. } = pilot.state;
        let place = match self.releases {
            Releases::Time => {
                self.look_at_the_clock(agent, pilot, self.block.end);
                self.planned(agent, pilot, self.block.end)
            }
            Releases::Order(_) => {
                let end = self.place(agent, pilot.leg.max(pilot.done));
                nearest(model, pilot.from, end, &pilot.state)
            }
        };
        let turned = place.heading.map(|planned| planned - heading);
        let (dx, dy) = (place.x - x, place.y - y);
        Off {
            m: (dx * dx + dy * dy).sqrt(),
            rad: turned.map_or(0.0, |turned| wrap(turned).abs()),
        }
    }

    /// Moves a body by the error of its velocity in a tick.
    fn slip(&self, slip: Slip, state: &mut State) {
        let [x, y, turn] = slip.of(state.vx, state.vy, state.omega);
        state.x += x * self.tick_s;
        state.y += y * self.tick_s;
        state.heading += turn * self.tick_s;
    }

    /// End of the current leg, if the agent may proceed.
    fn leg(&self, agent: usize, pilot: &mut Pilot, released: u32, now: f64) -> Option<Place> {
        if pilot.leg <= pilot.done {
            // Actions without a way are done as soon as they are released.
            let here = loop {
                if pilot.done >= released {
                    self.note_arrival(agent, pilot, now);
                    return None;
                }
                let action = pilot.done + 1;
                if !self.is_ready(agent, pilot, action, now) {
                    return None;
                }
                let here = self.place(agent, pilot.done);
                if !same(here, self.place(agent, action)) {
                    break here;
                }
                pilot.done += 1;
                self.stay(agent, pilot, now);
            };
            pilot.from = here;
            pilot.leg = pilot.done + 1;
        }
        let mut end = self.place(agent, pilot.leg);
        while pilot.leg < released && self.routes.stay_s(agent, pilot.leg as usize) <= 0.0 {
            let next = self.place(agent, pilot.leg + 1);
            // A delay would stop the body in the middle of the leg.
            if !goes_on(pilot.from, end, next) || self.delay(agent, pilot.leg + 1) > 0.0 {
                break;
            }
            pilot.leg += 1;
            pilot.drawn = pilot.leg;
            end = next;
        }
        Some(end)
    }

    /// The next knot after one, in another place, to which the agent may drive on without a stop.
    fn next_place(&self, agent: usize, knot: u32, released: u32) -> Option<u32> {
        let here = self.place(agent, knot);
        let mut next = knot;
        loop {
            let stays = self.routes.stay_s(agent, next as usize) > 0.0;
            if next >= released || stays || self.delay(agent, next + 1) > 0.0 {
                return None;
            }
            next += 1;
            let there = self.place(agent, next);
            let (dx, dy) = (there.x - here.x, there.y - here.y);
            if dx * dx + dy * dy > SAME_M * SAME_M {
                return Some(next);
            }
            // It turns in place.
            if !same(here, there) {
                return None;
            }
        }
    }

    /// The farthest released place beyond the end of the leg for which a body may head without
    /// leaving its way by more than its tolerance, if it need not stop at that end.
    fn ahead(&self, model: &Model, agent: usize, pilot: &Pilot, released: u32) -> Option<Place> {
        if matches!(self.releases, Releases::Time) || !model.goes_through_bends() {
            return None;
        }
        let state = &pilot.state;
        let [stops, seconds, metres] = AHEAD;
        let stop_m = stops * model.stop_distance_m(state);
        let reach = stop_m + seconds * state.speed_m_per_s() + metres;
        let near = [model.arrival_tolerance_m(), model.heading_tolerance_rad()];
        let (mut from, mut knot) = (pilot.from, pilot.leg);
        let mut end = self.place(agent, knot);
        let here = nearest(Some(model), from, end, state);
        let mut cone = Cone::new(here, near.map(|near| BEND * near));
        let mut ahead = None;
        loop {
            if cone.pass(end) > reach {
                break;
            }
            let Some(next) = self.next_place(agent, knot, released) else {
                break;
            };
            let to = self.place(agent, next);
            if bisectors(from, end, to).is_none() {
                break;
            }
            if !cone.admits(to) {
                ahead = farthest(&cone, end, to).or(ahead);
                break;
            }
            ahead = Some(to);
            (from, end, knot) = (end, to, next);
        }
        let mut aim = None;
        if let Some(to) = ahead {
            let (dx, dy) = (to.x - state.x, to.y - state.y);
            let distance = (dx * dx + dy * dy).sqrt();
            let turns = state.omega != 0.0
                || to
                    .heading
                    .is_some_and(|heading| (heading - state.heading).abs() > SAME_M);
            // A body that begins to turn brakes less than one that does not. Whoever is there already
            // has reached the end of the leg, too.
            let is_too_fast = turns && state.omega == 0.0 && stop_m > distance;
            if !is_too_fast && !model.has_arrived(state, &to.target()) {
                let now = Place {
                    x: state.x,
                    y: state.y,
                    heading: to.heading.map(|_| state.heading),
                };
                let gentle = between(now, to, model.gentle_share(distance, turns));
                // A body that rests nearer to it than its tolerance would go on to.
                let rests = state.speed_m_per_s() == 0.0
                    && state.omega == 0.0
                    && model.has_arrived(state, &gentle.target());
                aim = Some(if rests { to } else { gentle });
            }
        }
        if aim.is_none() && self.noise.has_slips() {
            // Whoever slips off a line has to return to it.
            let end = self.place(agent, pilot.leg);
            let (dx, dy) = (end.x - here.x, end.y - here.y);
            let left = (dx * dx + dy * dy).sqrt();
            return (left > reach).then(|| between(here, end, reach / left));
        }
        aim
    }

    /// Counts the knots that a body has passed, those at the bends of its way included.
    fn pass_bends(&self, agent: usize, pilot: &mut Pilot, released: u32, now: f64) {
        loop {
            let end = self.place(agent, pilot.leg);
            self.pass(agent, pilot);
            let next = self.next_place(agent, pilot.leg, released);
            let after = next.map(|next| self.place(agent, next));
            let across = after.and_then(|after| bisectors(pilot.from, end, after));
            let beyond = way(end, at(&pilot.state));
            let is_past =
                across.is_some_and(|both| both.iter().all(|across| dot(beyond, *across) >= 0.0));
            if pilot.done + 1 < pilot.leg || !is_past {
                return;
            }
            self.reach(agent, pilot, now);
            if self.leg(agent, pilot, released, now).is_none() {
                return;
            }
        }
    }

    /// Delay of the agent before an action, in substeps.
    fn delay(&self, agent: usize, action: u32) -> f64 {
        if self.noise.delays_starts() {
            self.noise.start_delay_s(agent, action as usize) * self.substeps_per_s
        } else {
            0.0
        }
    }

    /// Draws the speed factors of a chunk's bodies in this block, and their stops.
    pub(crate) fn draw(&self, chunk: &mut Chunk) {
        let (first, count) = (chunk.first as usize, chunk.pilots.len());
        let now = self.block.start;
        chunk.factors.resize(count, 1.0);
        self.noise
            .speed_factors(self.number, first, &mut chunk.factors);
        if self.noise.has_slips() {
            chunk.slips.resize(count, Slip::default());
            self.noise.slips(self.number, first, &mut chunk.slips);
        }
        self.draw_stops(chunk);
        if self.noise.has_stops() {
            for (pilot, factor) in chunk.pilots.iter().zip(&mut chunk.factors) {
                if pilot.stop > now {
                    *factor = 0.0;
                }
            }
        }
    }

    /// Draws the stops of a chunk's bodies.
    pub(crate) fn draw_stops(&self, chunk: &mut Chunk) {
        let (first, pilots) = (chunk.first as usize, &mut chunk.pilots);
        let (now, agents) = (self.block.start, first..first + pilots.len());
        self.noise.stops(self.number, agents, |agent, seconds| {
            pilots[agent - first].stop = now + seconds * self.substeps_per_s;
        });
    }

    /// True if all bodies of a chunk are driven by order, stand, and have reached their
    /// releases.
    pub(crate) fn is_idle(&self, chunk: &Chunk) -> bool {
        let Releases::Order(released) = self.releases else {
            return false;
        };
        let released = &released[chunk.first as usize..];
        chunk.pilots.len() == chunk.len()
            && chunk.pilots.iter().zip(released).all(|(pilot, released)| {
                let State { vx, vy, omega, .. } = pilot.state;
                pilot.done >= *released && vx == 0.0 && vy == 0.0 && omega == 0.0
            })
    }

    /// True once the stay at the knot before an action and the action's delay are over.
    fn is_ready(&self, agent: usize, pilot: &mut Pilot, action: u32, now: f64) -> bool {
        if pilot.drawn < action && now >= pilot.hold {
            pilot.drawn = action;
            pilot.hold = now + self.delay(agent, action);
        }
        now >= pilot.hold
    }

    /// Marks the end of the leg as reached.
    fn reach(&self, agent: usize, pilot: &mut Pilot, now: f64) {
        pilot.done = pilot.leg;
        self.stay(agent, pilot, now);
        self.note_arrival(agent, pilot, now);
    }

    /// Starts the stay at the current knot, if the route has one.
    fn stay(&self, agent: usize, pilot: &mut Pilot, now: f64) {
        let stay_s = self.routes.stay_s(agent, pilot.done as usize);
        if stay_s > 0.0 {
            pilot.hold = now + stay_s * self.substeps_per_s;
        }
    }

    fn note_arrival(&self, agent: usize, pilot: &mut Pilot, now: f64) {
        if pilot.arrival.is_infinite() && pilot.done >= self.last(agent) {
            pilot.arrival = now;
        }
    }

    /// Counts the knots passed within the leg.
    fn pass(&self, agent: usize, pilot: &mut Pilot) {
        let leg = way(pilot.from, self.place(agent, pilot.leg));
        while pilot.done + 1 < pilot.leg {
            let knot = self.place(agent, pilot.done + 1);
            if dot(way(knot, at(&pilot.state)), leg) < 0.0 {
                break;
            }
            pilot.done += 1;
        }
    }

    /// Appends the track of the next body of a chunk, which has no controller: each
    /// action takes its planned duration from the moment of departure; waits take none.
    /// `quarter_turn`, in substeps, is the duration of a turn in place before a move, for
    /// bodies that turn.
    pub(crate) fn follow(&self, quarter_turn: Option<f64>, chunk: &mut Chunk, lane: usize) {
        let agent = chunk.first as usize + lane;
        let pilot = &mut chunk.pilots[lane];
        let tracks = &mut chunk.tracks;
        let State {
            mut x,
            mut y,
            mut heading,
            ..
        } = pilot.state;
        tracks.open();
        tracks.push(self.block.start, x, y, heading);
        let released = self.released(agent, pilot);
        let factor = chunk.factors[lane];
        let mut now = self.block.start;
        let end = self.block.end;
        while now < end {
            if pilot.done >= released {
                self.note_arrival(agent, pilot, now);
                break;
            }
            let action = pilot.done + 1;
            if !self.is_ready(agent, pilot, action, now) {
                if pilot.hold >= end {
                    break;
                }
                now = pilot.hold;
                tracks.push(now, x, y, heading);
                continue;
            }
            let knot = pilot.done;
            let (here, next) = (self.place(agent, knot), self.place(agent, knot + 1));
            let moves = (here.x, here.y) != (next.x, next.y);
            if let Some(quarter_turn) = quarter_turn.filter(|_| moves && !same(here, next)) {
                let way = libm::atan2(next.y - here.y, next.x - here.x);
                let turn = wrap(way - heading);
                if turn.abs() > 1e-9 {
                    let takes = turn.abs() / FRAC_PI_2 * quarter_turn / factor;
                    let share = ((end - now) / takes).min(1.0);
                    heading += turn * share;
                    now = (now + takes).min(end);
                    tracks.push(now, x, y, heading);
                    continue;
                }
            }
            let whole = self.time(agent, knot + 1) - self.time(agent, knot);
            let left = whole - pilot.spent;
            let until = now + left / factor;
            if same(here, next) || until <= end {
                if !same(here, next) {
                    now = until;
                    (x, y, heading) = (next.x, next.y, next.heading.unwrap_or(heading));
                    tracks.push(now, x, y, heading);
                }
                pilot.done += 1;
                pilot.spent = 0.0;
                self.stay(agent, pilot, now);
            } else {
                pilot.spent += (end - now) * factor;
                let place = between(here, next, pilot.spent / whole);
                (x, y, heading) = (place.x, place.y, place.heading.unwrap_or(heading));
                now = end;
                tracks.push(now, x, y, heading);
            }
        }
        if now < end || self.block.length() <= 0.0 {
            tracks.push(end, x, y, heading);
        }
        self.note_arrival(agent, pilot, now.max(self.block.start));
        (pilot.state.x, pilot.state.y, pilot.state.heading) = (x, y, heading);
    }
}
