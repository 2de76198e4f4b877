//! The event-driven checker: contacts of motions that are uniform from knot to
//! knot, in continuous time. Nothing is sampled and there are no ticks.
//!
//! Time is cut into windows in which bodies move about their own size. In a
//! window the boxes around all motions are put into bins; two bodies whose boxes
//! overlap are followed from knot to knot, and in every interval in which both
//! move uniformly the contact is computed in closed form, or by conservative
//! advancement where a polygon turns (see [`contacts_in_span`]). Intervals that
//! continue each other are one contact, however many knots and windows they
//! cover.
//!
//! With N bodies, K knots and W windows this takes time O(W·N + K + C) for C
//! intervals of neighbouring bodies, and memory O(N) besides the motions. W is
//! about the length of the way of a typical body in units of its size, and at
//! most 2²⁰ (for motions with a step, at most 1024 per step).
//!
//! This is what continuous feasibility asks for in GRACE (section III-D): X_i(t)
//! in the free space and disjoint from X_j(t) at all times.

mod motions;
mod near;
mod obstacles;

use std::collections::BTreeMap;

use self::motions::{Bodies, Leg};
use self::near::Near;
use self::obstacles::{Hit, Scratch};
use crate::{Bounds, Inside, Mover, Pose, Relative, Shape, contacts_in_span};

pub use self::motions::{GridMotions, Motions};
pub use self::obstacles::Obstacles;

/// The other party of a contact.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Touched {
    /// Another agent, always of a higher index.
    Agent(u32),
    /// Solid cells of the grid, and the one that is met first. An agent has at
    /// most one such contact at a time, however many cells it overlaps.
    Cell(u32),
    /// A polygon of the workspace, by its index.
    Polygon(u32),
    /// The area outside of the bounds.
    Outside,
    /// A moving obstacle, by its index.
    Mover(u32),
}

impl Touched {
    /// Overlaps with the same key are the same contact.
    fn key(self) -> Self {
        match self {
            Self::Cell(_) => Self::Cell(0),
            other => other,
        }
    }
}

/// A contact from beginning to end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactInterval {
    /// Time of its begin, in seconds.
    pub begin_s: f64,
    /// Time of its end; `None` if it never ends, or not before the check stopped.
    pub end_s: Option<f64>,
    /// The agent, the lower index of two.
    pub agent: u32,
    /// The other party.
    pub other: Touched,
}

/// The nearest approach of an agent to any other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NearestApproach {
    /// The distance of their centres c_eff in metres.
    pub distance_m: f64,
    /// The first time at which it is reached, in seconds.
    pub time_s: f64,
    /// The other agent, the lowest index in ties.
    pub other: u32,
}

/// Parameters of a search for contacts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactSearch {
    /// Bodies touch when they overlap by more than this, in metres.
    pub tolerance_m: f64,
    /// Stop when as many contacts have begun. All contacts that begin before the
    /// check stops are found, which may be more.
    pub limit: usize,
    /// Also find the nearest approach of every agent among those within this
    /// range between centres, in metres.
    pub approach_range_m: Option<f64>,
}

impl Default for ContactSearch {
    /// Overlaps of more than a micrometre, all of them.
    fn default() -> Self {
        Self {
            tolerance_m: 1e-6,
            limit: usize::MAX,
            approach_range_m: None,
        }
    }
}

/// Results of a search for contacts.
#[derive(Debug, Clone, PartialEq)]
pub struct Found {
    /// By beginning, then agent, then the other one.
    pub contacts: Vec<ContactInterval>,
    /// Per agent, if asked for; `None` for agents whom nobody came near.
    pub nearest: Vec<Option<NearestApproach>>,
    /// Up to when the motions were looked at, in seconds: to their end unless the
    /// limit was reached.
    pub until_s: f64,
}

/// Finds the contacts of agents with each other and with obstacles.
///
/// `shapes[i]` is agent i's; there are as many as agents.
///
/// # Panics
///
/// If there are not as many shapes as agents.
pub fn contacts(
    motions: &impl Motions,
    shapes: &[&Shape],
    obstacles: &Obstacles<'_>,
    search: &ContactSearch,
) -> Found {
    assert_eq!(shapes.len(), motions.agents(), "one shape per agent");
    let movers = obstacles.movers();
    let bodies = Bodies { motions, movers };
    let mut shapes = shapes.to_vec();
    shapes.extend(movers.iter().map(Mover::shape));
    let mut sweep = Sweep::new(bodies, shapes, obstacles, search);
    sweep.run();
    sweep.finish()
}

/// Ticks per base unit of time: windows begin and end at whole ticks.
const TICK_BITS: u32 = 20;
/// The shortest window, in ticks, as a power of two.
const LEAST_BITS: u32 = 10;
/// The longest window, in ticks, as a power of two.
const MOST_BITS: u32 = 40;
/// The most steps of motions that windows are fitted to.
const MOST_STEPS: f64 = (1u64 << 40) as f64;
/// A window is halved if the boxes of motions cover this many times what bodies
/// at rest cover, and doubled below the second.
const CROWDED: f64 = 6.0;
const SPARSE: f64 = 1.5;

struct Sweep<'a, M> {
    bodies: Bodies<'a, M>,
    agents: usize,
    shapes: Vec<&'a Shape>,
    obstacles: &'a Obstacles<'a>,
    search: &'a ContactSearch,
    window: Window,
    /// Motions at the beginning of the window, and at its end.
    legs: Vec<Leg>,
    next_legs: Vec<Leg>,
    /// Poses at the beginning of the window, and at its end.
    from: Vec<Pose>,
    to: Vec<Pose>,
    /// Boxes around the motions of bodies.
    boxes: Vec<Bounds>,
    path: Vec<Path>,
    near: Near,
    scratch: Scratch,
    account: Account,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Path {
    /// The body rests in the whole window.
    Rest,
    /// It moves uniformly.
    Straight,
    /// It comes by a knot.
    Bent,
}

/// A stretch of time.
#[derive(Debug, Clone, Copy)]
struct Window {
    begin_s: f64,
    end_s: f64,
    is_first: bool,
}

impl Window {
    fn at(self, fraction: f64) -> f64 {
        if fraction >= 1.0 {
            self.end_s
        } else {
            self.begin_s + fraction * (self.end_s - self.begin_s)
        }
    }
}

/// Contacts that are over, contacts that last, and approaches.
#[derive(Default)]
struct Account {
    over: Vec<ContactInterval>,
    open: BTreeMap<(u32, Touched), ContactInterval>,
    nearest: Vec<Option<(f64, f64, u32)>>,
}

impl Account {
    /// Takes note of an overlap within a span.
    fn note(&mut self, span: Window, agent: u32, other: Touched, inside: Inside) {
        let key = (agent, other.key());
        let begins = ContactInterval {
            begin_s: span.at(inside.enter),
            end_s: None,
            agent,
            other,
        };
        let mut contact = match self.open.remove(&key) {
            Some(begun) if inside.at_start => begun,
            Some(begun) => {
                // Rounding: what was inside at the end of the span before is
                // outside at the start of this one.
                let end_s = Some(span.begin_s);
                self.over.push(ContactInterval { end_s, ..begun });
                begins
            }
            None => begins,
        };
        if inside.at_end {
            self.open.insert(key, contact);
        } else {
            contact.end_s = Some(span.at(inside.leave));
            self.over.push(contact);
        }
    }

    /// Takes note of an approach. The order of calls does not matter.
    fn approach(&mut self, agent: usize, squared: f64, time_s: f64, other: u32) {
        let slot = &mut self.nearest[agent];
        let better = slot.is_none_or(|(least, when, who)| {
            squared < least || (squared <= least && (time_s, other) < (when, who))
        });
        if better {
            *slot = Some((squared, time_s, other));
        }
    }
}

impl<'a, M: Motions> Sweep<'a, M> {
    fn new(
        bodies: Bodies<'a, M>,
        shapes: Vec<&'a Shape>,
        obstacles: &'a Obstacles<'a>,
        search: &'a ContactSearch,
    ) -> Self {
        let legs: Vec<Leg> = (0..bodies.count()).map(|body| bodies.begin(body)).collect();
        let from: Vec<Pose> = legs.iter().map(|leg| leg.from).collect();
        let nowhere = Bounds {
            min: [0.0; 2],
            max: [0.0; 2],
        };
        let agents = bodies.motions.agents();
        let asked = search.approach_range_m.map_or(0, |_| agents);
        Self {
            agents,
            window: Window {
                begin_s: 0.0,
                end_s: 0.0,
                is_first: true,
            },
            next_legs: legs.clone(),
            to: from.clone(),
            boxes: vec![nowhere; legs.len()],
            path: vec![Path::Rest; legs.len()],
            near: Near::default(),
            scratch: Scratch::default(),
            account: Account {
                nearest: vec![None; asked],
                ..Account::default()
            },
            bodies,
            shapes,
            obstacles,
            search,
            legs,
            from,
        }
    }

    fn run(&mut self) {
        let movers = self.bodies.movers.iter();
        let last = movers.filter_map(|mover| mover.times_s().last().copied());
        let horizon_s = last.fold(self.bodies.motions.horizon_s(), f64::max);
        // Movers may take much longer than the plan.
        let step_s = self.bodies.motions.step_s();
        let step_s = step_s.filter(|step_s| horizon_s / step_s < MOST_STEPS);
        let base_s = step_s.unwrap_or(horizon_s / 1024.0);
        // Whole steps are whole multiples of their length, bit by bit.
        let tick_s = base_s / f64::from(1u32 << TICK_BITS);
        let (mut tick, mut bits) = (0u64, TICK_BITS);
        loop {
            // Windows begin at multiples of their length, or of half of it.
            let end = ((tick >> bits) + 1) << bits;
            let end_s = end as f64 * tick_s;
            let is_last = end_s >= horizon_s || end_s <= self.window.begin_s;
            self.window.end_s = if is_last { horizon_s } else { end_s };
            let crowding = self.advance();
            if crowding > CROWDED && bits > LEAST_BITS {
                bits -= 1;
                continue;
            }
            self.check();
            let begun = self.account.over.len() + self.account.open.len();
            if is_last || begun >= self.search.limit {
                return;
            }
            std::mem::swap(&mut self.legs, &mut self.next_legs);
            std::mem::swap(&mut self.from, &mut self.to);
            self.window.begin_s = self.window.end_s;
            self.window.is_first = false;
            tick = end;
            if crowding < SPARSE && bits < MOST_BITS {
                bits += 1;
            }
        }
    }

    /// Finds where all bodies go in the window, and how many times more their
    /// boxes cover than the bodies themselves.
    fn advance(&mut self) -> f64 {
        let end_s = self.window.end_s;
        let slack = 0.5 * self.search.approach_range_m.unwrap_or(0.0);
        let (mut covered, mut own) = (0.0, 0.0);
        for body in 0..self.legs.len() {
            let (start, mut leg) = (self.from[body], self.legs[body]);
            let (mut min, mut max) = ([start.x, start.y], [start.x, start.y]);
            let mut path = if leg.moves() {
                Path::Straight
            } else {
                Path::Rest
            };
            while leg.end_s <= end_s {
                if leg.end_s < end_s {
                    (min, max) = stretch(min, max, leg.to);
                }
                let next = self.bodies.after(body, &leg);
                if leg.end_s < end_s && (leg.moves() || next.moves()) {
                    path = Path::Bent;
                }
                leg = next;
            }
            let stop = leg.at(end_s);
            (min, max) = stretch(min, max, stop);
            // With some slack against rounding.
            let radius = self.shapes[body].effective_radius_m();
            let reach = radius * (1.0 + 1e-9) + slack;
            let (width, height) = (max[0] - min[0], max[1] - min[1]);
            let size = 2.0 * reach;
            covered += (width + size) * (height + size);
            own += size * size;
            self.boxes[body] = Bounds {
                min: [min[0] - reach, min[1] - reach],
                max: [max[0] + reach, max[1] + reach],
            };
            self.path[body] = path;
            self.to[body] = stop;
            self.next_legs[body] = leg;
        }
        covered / own
    }

    /// Looks at everything that may touch in the window.
    fn check(&mut self) {
        let mut near = std::mem::take(&mut self.near);
        let boxes = std::mem::take(&mut self.boxes);
        near.pairs(&boxes, |i, j| self.pair(i, j));
        (self.near, self.boxes) = (near, boxes);
        for agent in 0..self.agents {
            if self.path[agent] != Path::Rest || self.window.is_first {
                self.follow(agent);
            }
        }
    }

    /// Follows two bodies through the window.
    fn pair(&mut self, i: usize, j: usize) {
        let rest = self.path[i] == Path::Rest && self.path[j] == Path::Rest;
        // Two that rest are in contact as they were before.
        if i >= self.agents || (rest && !self.window.is_first) {
            return;
        }
        if j < self.agents && self.bodies.motions.are_joined(i, j) {
            return;
        }
        let ends = [self.from[i], self.to[i], self.from[j], self.to[j]];
        if self.path[i] != Path::Bent && self.path[j] != Path::Bent {
            self.touch(self.window, i, j, ends);
            return;
        }
        let (mut one, mut two) = (self.legs[i], self.legs[j]);
        let (mut from_i, mut from_j) = (self.from[i], self.from[j]);
        let mut span = self.window;
        loop {
            let end_s = one.end_s.min(two.end_s);
            if end_s >= self.window.end_s {
                break;
            }
            let (to_i, to_j) = (one.at(end_s), two.at(end_s));
            span.end_s = end_s;
            self.touch(span, i, j, [from_i, to_i, from_j, to_j]);
            span = Window {
                begin_s: end_s,
                end_s: self.window.end_s,
                is_first: false,
            };
            (from_i, from_j) = (to_i, to_j);
            if one.end_s <= end_s {
                one = self.bodies.after(i, &one);
            }
            if two.end_s <= end_s {
                two = self.bodies.after(j, &two);
            }
        }
        self.touch(span, i, j, [from_i, self.to[i], from_j, self.to[j]]);
    }

    /// Two bodies in a span in which both move uniformly.
    fn touch(&mut self, span: Window, i: usize, j: usize, [from_i, to_i, from_j, to_j]: [Pose; 4]) {
        let (a, b) = (self.shapes[i], self.shapes[j]);
        let way = Relative::between([from_i, to_i], [from_j, to_j]);
        let (squared, fraction) = way.closest();
        if let Some(range) = self.search.approach_range_m
            && j < self.agents
            && squared <= range * range
        {
            let time_s = span.at(fraction);
            self.account.approach(i, squared, time_s, j as u32);
            self.account.approach(j, squared, time_s, i as u32);
        }
        let reach = a.effective_radius_m() + b.effective_radius_m();
        if squared > reach * reach * (1.0 + 1e-9) {
            return;
        }
        let agent = i as u32;
        let other = match j.checked_sub(self.agents) {
            None => Touched::Agent(j as u32),
            Some(mover) => Touched::Mover(mover as u32),
        };
        let tolerance = self.search.tolerance_m;
        let mut found = std::mem::take(&mut self.scratch.found);
        found.clear();
        contacts_in_span(a, from_i, to_i, b, from_j, to_j, tolerance, &mut found);
        for inside in &found {
            self.account.note(span, agent, other, *inside);
        }
        self.scratch.found = found;
    }

    /// Follows an agent past what stands.
    fn follow(&mut self, agent: usize) {
        let mut leg = self.legs[agent];
        let mut from = self.from[agent];
        let mut span = self.window;
        while leg.end_s < self.window.end_s {
            span.end_s = leg.end_s;
            self.stand(span, agent, from, leg.to);
            from = leg.to;
            span.begin_s = leg.end_s;
            leg = self.bodies.after(agent, &leg);
        }
        span.end_s = self.window.end_s;
        self.stand(span, agent, from, self.to[agent]);
    }

    /// An agent in a span in which it moves uniformly.
    fn stand(&mut self, span: Window, agent: usize, from: Pose, to: Pose) {
        let tolerance = self.search.tolerance_m;
        self.scratch.hits.clear();
        let shape = self.shapes[agent];
        self.obstacles
            .meet(shape, from, to, tolerance, &mut self.scratch);
        let hits = &mut self.scratch.hits;
        // Parts of the same thing one after the other, in the order in which they
        // are met; the lowest cell in ties.
        hits.sort_unstable_by(|one, two| {
            let key = |hit: &Hit| hit.touched.key();
            key(one)
                .cmp(&key(two))
                .then(one.inside.enter.total_cmp(&two.inside.enter))
                .then(one.touched.cmp(&two.touched))
        });
        let mut hits = hits.drain(..);
        let Some(mut whole) = hits.next() else { return };
        for hit in hits {
            if hit.touched.key() == whole.touched.key() && hit.inside.enter <= whole.inside.leave {
                whole.inside.leave = whole.inside.leave.max(hit.inside.leave);
                whole.inside.at_start |= hit.inside.at_start;
                whole.inside.at_end |= hit.inside.at_end;
            } else {
                self.account
                    .note(span, agent as u32, whole.touched, whole.inside);
                whole = hit;
            }
        }
        self.account
            .note(span, agent as u32, whole.touched, whole.inside);
    }

    fn finish(self) -> Found {
        let mut contacts = self.account.over;
        contacts.extend(self.account.open.into_values());
        contacts.sort_unstable_by(|one, two| {
            one.begin_s
                .total_cmp(&two.begin_s)
                .then((one.agent, one.other).cmp(&(two.agent, two.other)))
        });
        let nearest = self.account.nearest.into_iter().map(|found| {
            found.map(|(squared, time_s, other)| NearestApproach {
                distance_m: squared.sqrt(),
                time_s,
                other,
            })
        });
        Found {
            contacts,
            nearest: nearest.collect(),
            until_s: self.window.end_s,
        }
    }
}

fn stretch(min: [f64; 2], max: [f64; 2], pose: Pose) -> ([f64; 2], [f64; 2]) {
    (
        [min[0].min(pose.x), min[1].min(pose.y)],
        [max[0].max(pose.x), max[1].max(pose.y)],
    )
}

#[cfg(test)]
mod tests {
    //! The oracle is dense sampling of all pairs.

    use fleetyard_core::{Grid, GridPlan, Knot, TrajectoryPlan, cell_center_m};
    use proptest::prelude::*;

    use super::*;
    use crate::sweep::tests::{any_shape, rectangle};
    use crate::{Footprint, Polygon, RESOLUTION_M, Workspace, separation_m};

    fn plan(paths: &[Vec<(f64, Pose)>]) -> TrajectoryPlan {
        let mut plan = TrajectoryPlan::default();
        for path in paths {
            let knots = path.iter().map(|(time_s, pose)| Knot {
                time_s: *time_s,
                x_m: pose.x,
                y_m: pose.y,
                heading_rad: Some(pose.heading),
            });
            plan.push_path(knots).unwrap();
        }
        plan
    }

    fn pose_at(path: &[(f64, Pose)], time_s: f64) -> Pose {
        let next = path.partition_point(|(knot, _)| *knot <= time_s);
        match path.get(next) {
            None => path[next - 1].1,
            Some((end, to)) => {
                let (begin, from) = path[next - 1];
                from.toward(*to, (time_s - begin) / (end - begin))
            }
        }
    }

    /// Clearance between an agent and the other party at a time.
    struct Oracle<'a> {
        paths: &'a [Vec<(f64, Pose)>],
        shapes: &'a [Shape],
        grid: &'a Grid,
        workspace: &'a Workspace,
    }

    impl Oracle<'_> {
        fn clearance(&self, agent: usize, other: Touched, time_s: f64) -> f64 {
            let shape = &self.shapes[agent];
            let pose = pose_at(&self.paths[agent], time_s);
            match other {
                Touched::Agent(other) => {
                    let other = other as usize;
                    let there = pose_at(&self.paths[other], time_s);
                    separation_m(shape, pose, &self.shapes[other], there)
                }
                Touched::Cell(_) => {
                    let square = rectangle(1.0, 1.0);
                    let solid =
                        (0..self.grid.cell_count()).filter(|at| !self.grid.is_passable(*at));
                    let clearance = solid.map(|cell| {
                        let (x, y) = cell_center_m(self.grid, 1.0, cell);
                        separation_m(shape, pose, &square, Pose::at(x, y))
                    });
                    clearance.fold(f64::INFINITY, f64::min)
                }
                Touched::Polygon(polygon) => {
                    let parts = self.workspace.obstacles[polygon as usize].parts().iter();
                    let clearance = parts.map(|(at, part)| separation_m(shape, pose, part, *at));
                    clearance.fold(f64::INFINITY, f64::min)
                }
                Touched::Outside => {
                    let bounds = self.workspace.bounds;
                    let corners: Vec<[f64; 2]> = if shape.is_disc() {
                        let reach = shape.effective_radius_m();
                        [[-reach, 0.0], [reach, 0.0], [0.0, -reach], [0.0, reach]]
                            .map(|[x, y]| [pose.x + x, pose.y + y])
                            .to_vec()
                    } else {
                        shape.corners(pose).collect()
                    };
                    let room = corners.iter().flat_map(|corner| {
                        (0..2).flat_map(move |axis| {
                            [
                                corner[axis] - bounds.min[axis],
                                bounds.max[axis] - corner[axis],
                            ]
                        })
                    });
                    room.fold(f64::INFINITY, f64::min)
                }
                Touched::Mover(mover) => {
                    let mover = &self.workspace.movers[mover as usize];
                    separation_m(shape, pose, mover.shape(), mover.pose_at(time_s))
                }
            }
        }

        fn check(&self, found: &Found, horizon_s: f64, tolerance_m: f64) {
            let agents = self.paths.len() as u32;
            let polygons = self.workspace.obstacles.len() as u32;
            let movers = self.workspace.movers.len() as u32;
            for agent in 0..agents {
                let others = (agent + 1..agents).map(Touched::Agent);
                let others = others
                    .chain([Touched::Cell(0), Touched::Outside])
                    .chain((0..polygons).map(Touched::Polygon))
                    .chain((0..movers).map(Touched::Mover));
                for other in others {
                    let contacts: Vec<&ContactInterval> = found
                        .contacts
                        .iter()
                        .filter(|one| one.agent == agent && one.other.key() == other)
                        .collect();
                    let over =
                        |time_s: f64| self.clearance(agent as usize, other, time_s) + tolerance_m;
                    for contact in &contacts {
                        assert!(contact.begin_s <= 0.0 || over(contact.begin_s).abs() < 1e-5);
                        assert!(contact.end_s.is_none_or(|end| over(end).abs() < 1e-5));
                        assert!(contact.end_s.is_none_or(|end| end >= contact.begin_s));
                    }
                    for sample in 0..=80 {
                        let time_s = horizon_s * f64::from(sample) / 80.0;
                        let over = over(time_s);
                        if over.abs() < 4.0 * RESOLUTION_M {
                            continue;
                        }
                        let inside = contacts.iter().any(|contact| {
                            contact.begin_s <= time_s
                                && contact.end_s.is_none_or(|end| time_s <= end)
                        });
                        assert_eq!(over < 0.0, inside, "{agent} {other:?} {time_s}: {over}");
                    }
                    // Contacts do not touch each other: they are merged.
                    for pair in contacts.windows(2) {
                        assert!(pair[0].end_s.is_some_and(|end| end < pair[1].begin_s));
                    }
                }
            }
        }
    }

    fn any_path() -> impl Strategy<Value = Vec<(f64, Pose)>> {
        let knot = (
            prop_oneof![Just(1.0), 0.01..3.0f64],
            prop_oneof![0.0..8.0f64, (0..8i32).prop_map(f64::from)],
            prop_oneof![0.0..8.0f64, (0..8i32).prop_map(f64::from)],
            prop_oneof![Just(0.0), -4.0..4.0f64],
            0..5u8,
        );
        proptest::collection::vec(knot, 1..7).prop_map(|knots| {
            let (mut time_s, mut pose) = (0.0, Pose::default());
            let mut path: Vec<(f64, Pose)> = Vec::new();
            for (wait_s, x, y, heading, kind) in knots {
                pose = match kind {
                    0 => pose,
                    1 => Pose { heading, ..pose },
                    2 => Pose { x, y, ..pose },
                    _ => Pose::new(x, y, heading),
                };
                path.push((time_s, pose));
                time_s += wait_s;
            }
            path
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(300))]

        #[test]
        fn random_worlds_agree_with_samples(
            paths in proptest::collection::vec((any_path(), any_shape()), 1..7),
            solid in proptest::collection::vec(proptest::bool::weighted(0.08), 64),
            radii in proptest::collection::vec(0.1..1.5f64, 7),
            movers in proptest::collection::vec(any_path(), 0..3),
            tolerance_m in prop_oneof![Just(1e-6), Just(0.05)],
        ) {
            let (paths, shapes): (Vec<_>, Vec<Shape>) = paths.into_iter().unzip();
            let terrain = solid.iter().map(|solid| if *solid { b'@' } else { b'.' });
            let grid = Grid::new("random", 8, 8, terrain.collect()).unwrap();
            let star: Vec<[f64; 2]> = radii
                .iter()
                .enumerate()
                .map(|(at, radius)| {
                    let angle = std::f64::consts::TAU * at as f64 / 7.0;
                    [4.0 + radius * libm::cos(angle), 4.0 + radius * libm::sin(angle)]
                })
                .collect();
            let footprint = || Footprint::Rectangle { length_m: 0.9, width_m: 0.4 };
            let workspace = Workspace {
                name: String::new(),
                bounds: Bounds { min: [0.25, 0.25], max: [7.5, 7.5] },
                boundary: None,
                obstacles: vec![
                    Polygon::new(&star).unwrap(),
                    Polygon::rectangle([1.0, 6.0], [1.0, 2.0], 0.3).unwrap(),
                ],
                movers: movers
                    .iter()
                    .map(|knots| {
                        let knots: Vec<_> = knots.iter().map(|(t, pose)| (t + 0.5, *pose)).collect();
                        crate::Mover::new(footprint(), &knots).unwrap()
                    })
                    .collect(),
            };
            let plan = plan(&paths);
            let refs: Vec<&Shape> = shapes.iter().collect();
            let obstacles = Obstacles::cells(&grid, 1.0).unwrap().with_workspace(&workspace);
            let search = ContactSearch { tolerance_m, ..ContactSearch::default() };
            let found = contacts(&plan, &refs, &obstacles, &search);
            let oracle = Oracle { paths: &paths, shapes: &shapes, grid: &grid, workspace: &workspace };
            // Past the end everything stays as it is.
            oracle.check(&found, found.until_s + 1.0, tolerance_m);

            // A limit gives the beginning of the same list.
            let limit = ContactSearch { limit: 2, ..search };
            let few = contacts(&plan, &refs, &obstacles, &limit);
            prop_assert!(few.contacts.len() >= 2.min(found.contacts.len()));
            for (one, two) in few.contacts.iter().zip(&found.contacts) {
                prop_assert_eq!((one.begin_s, one.agent, one.other), (two.begin_s, two.agent, two.other));
            }
        }

        /// A rectangle that is given by its corners is the same edge.
        #[test]
        fn a_rectangle_is_a_boundary(
            path in any_path(), shape in any_shape(), clockwise in proptest::bool::ANY,
        ) {
            let bounds = Bounds { min: [0.25, 0.5], max: [7.5, 7.0] };
            let mut corners = vec![[0.25, 0.5], [7.5, 0.5], [7.5, 7.0], [0.25, 7.0]];
            if clockwise {
                corners.reverse();
            }
            let world = |boundary: Option<crate::Boundary>| Workspace {
                name: String::new(),
                bounds,
                boundary,
                obstacles: Vec::new(),
                movers: Vec::new(),
            };
            let plan = plan(&[path]);
            let found = |workspace: &Workspace| {
                let obstacles = Obstacles::workspace(workspace);
                contacts(&plan, &[&shape], &obstacles, &ContactSearch::default()).contacts
            };
            let (one, two) = (
                found(&world(None)),
                found(&world(Some(crate::Boundary::new(&corners).unwrap()))),
            );
            prop_assert_eq!(one.len(), two.len());
            for (one, two) in one.iter().zip(&two) {
                prop_assert_eq!(one.other, two.other);
                prop_assert!((one.begin_s - two.begin_s).abs() < 1e-5);
                let ends = one.end_s.unwrap_or(0.0) - two.end_s.unwrap_or(0.0);
                prop_assert!(ends.abs() < 1e-5);
            }
        }

        /// The nearest approach is that of all times.
        #[test]
        fn approaches_agree_with_samples(
            paths in proptest::collection::vec(any_path(), 2..6), range in 0.5..6.0f64,
        ) {
            let plan = plan(&paths);
            let disc = Shape::disc(0.2);
            let refs = vec![&disc; paths.len()];
            let search = ContactSearch { approach_range_m: Some(range), ..ContactSearch::default() };
            let found = contacts(&plan, &refs, &Obstacles::none(), &search);
            let distance = |i: usize, j: usize, time_s: f64| {
                let (a, b) = (pose_at(&paths[i], time_s), pose_at(&paths[j], time_s));
                ((a.x - b.x) * (a.x - b.x) + (a.y - b.y) * (a.y - b.y)).sqrt()
            };
            for (agent, nearest) in found.nearest.iter().enumerate() {
                if let Some(nearest) = nearest {
                    let there = distance(agent, nearest.other as usize, nearest.time_s);
                    prop_assert!((there - nearest.distance_m).abs() < 1e-6);
                    prop_assert!(nearest.distance_m <= range);
                }
                let least = nearest.map_or(range, |nearest| nearest.distance_m);
                for other in (0..paths.len()).filter(|other| *other != agent) {
                    for sample in 0..=100 {
                        let time_s = found.until_s * f64::from(sample) / 100.0;
                        prop_assert!(distance(agent, other, time_s) >= least - 1e-9);
                    }
                }
            }
        }

        /// A grid plan and its trajectories are the same motion.
        #[test]
        fn grid_plans_are_motions(
            walks in proptest::collection::vec(proptest::collection::vec(0..5u8, 0..30), 1..10),
        ) {
            let grid = Grid::new("open", 5, 5, vec![b'.'; 25]).unwrap();
            let paths = walks.iter().enumerate().map(|(at, walk)| {
                let mut cell = at as u32;
                let mut path = vec![cell];
                for turn in walk {
                    let (row, col) = grid.row_col(cell);
                    let next = match turn {
                        0 => grid.cell(row + 1, col),
                        1 => grid.cell(row, col + 1),
                        2 => row.checked_sub(1).and_then(|row| grid.cell(row, col)),
                        3 => col.checked_sub(1).and_then(|col| grid.cell(row, col)),
                        _ => None,
                    };
                    cell = next.unwrap_or(cell);
                    path.push(cell);
                }
                path
            });
            let plan = GridPlan::from_paths(paths);
            let disc = Shape::disc(0.35);
            let refs = vec![&disc; plan.agents()];
            let search = ContactSearch { approach_range_m: Some(2.0), ..ContactSearch::default() };
            let grid_motions = GridMotions::new(&plan, &grid, 1.0, 0.5).unwrap();
            let one = contacts(&grid_motions, &refs, &Obstacles::none(), &search);
            let trajectories = TrajectoryPlan::from_grid(&plan, &grid, 1.0, 0.5).unwrap();
            let two = contacts(&trajectories, &refs, &Obstacles::none(), &search);
            prop_assert_eq!(one.contacts.len(), two.contacts.len());
            for (one, two) in one.contacts.iter().zip(&two.contacts) {
                prop_assert!((one.begin_s - two.begin_s).abs() < 1e-9);
                prop_assert_eq!(one.end_s.is_some(), two.end_s.is_some());
                let ends = one.end_s.unwrap_or(0.0) - two.end_s.unwrap_or(0.0);
                prop_assert!(ends.abs() < 1e-9);
                prop_assert_eq!((one.agent, one.other), (two.agent, two.other));
            }
            for (one, two) in one.nearest.iter().zip(&two.nearest) {
                let distance = |found: &Option<NearestApproach>| found.map_or(9.0, |found| found.distance_m);
                prop_assert!((distance(one) - distance(two)).abs() < 1e-9);
            }
        }
    }

    fn found(paths: &[Vec<(f64, Pose)>], shape: &Shape) -> Vec<(f64, Option<f64>)> {
        let plan = plan(paths);
        let refs = vec![shape; paths.len()];
        let search = ContactSearch::default();
        let found = contacts(&plan, &refs, &Obstacles::none(), &search);
        found
            .contacts
            .iter()
            .map(|one| (one.begin_s, one.end_s))
            .collect()
    }

    #[test]
    fn contacts_last_over_knots_and_windows() {
        let disc = Shape::disc(0.5);
        let rest = |x: f64| vec![(0.0, Pose::at(x, 0.0))];
        // One drives through the other with a stop inside, waits and many knots.
        let mut drive = vec![(0.0, Pose::at(-5.0, 0.0)), (5.0, Pose::at(0.0, 0.0))];
        for knot in 0..1000 {
            let wobble = if knot % 2 == 0 { 0.25 } else { 0.0 };
            drive.push((6.0 + f64::from(knot) * 0.01, Pose::at(wobble, 0.0)));
        }
        drive.push((30.0, Pose::at(0.0, 0.0)));
        drive.push((31.0, Pose::at(0.0, 2.0)));
        let times = found(&[drive, rest(0.0)], &disc);
        assert_eq!(times.len(), 1);
        assert!((times[0].0 - 4.0).abs() < 1e-5);
        assert!((times[0].1.unwrap() - 30.5).abs() < 1e-5);

        // In one place for good: there is no end. Alone, or touching: nothing.
        assert_eq!(found(&[rest(0.0), rest(0.0)], &disc), [(0.0, None)]);
        assert_eq!(found(&[rest(0.0), rest(1.0)], &disc), []);
        assert_eq!(found(&[rest(0.0)], &disc), []);
        let square = rectangle(1.0, 1.0);
        let along = |y: f64| vec![(0.0, Pose::at(0.0, y)), (7.0, Pose::at(7.0, y))];
        for shape in [&disc, &square] {
            assert_eq!(found(&[along(0.0), along(1.0), along(2.0)], shape), []);
        }
    }

    /// Spins and jumps as large as a plan can have.
    #[test]
    fn absurd_plans_end() {
        let spin = |x: f64| vec![(0.0, Pose::at(x, 0.0)), (1e-3, Pose::new(x, 0.0, 1e5))];
        let jump = vec![
            (0.0, Pose::at(-1e9, -1e9)),
            (1e-3, Pose::new(1e9, 1e9, -1e9)),
        ];
        let creep = vec![(0.0, Pose::at(0.0, 1.0)), (1e9, Pose::new(1e9, 1.0, 1e9))];
        let times = found(&[spin(0.0), spin(1.0), jump, creep], &rectangle(1.0, 0.9));
        assert!(!times.is_empty());
    }

    #[test]
    fn nobody_at_all() {
        let plan = TrajectoryPlan::default();
        let none = contacts(&plan, &[], &Obstacles::none(), &ContactSearch::default());
        assert_eq!((none.contacts.len(), none.until_s.to_bits()), (0, 0));
    }

    /// One agent far away and one very fast do not make others slow or wrong.
    #[test]
    fn outliers() {
        let mut paths: Vec<Vec<(f64, Pose)>> = (0..200)
            .map(|at| {
                let (x, y) = (f64::from(at % 20) * 3.0, f64::from(at / 20) * 3.0);
                vec![(0.0, Pose::at(x, y)), (10.0, Pose::at(x + 3.0, y))]
            })
            .collect();
        paths.push(vec![
            (0.0, Pose::at(1e9, -1e9)),
            (1e-3, Pose::at(-1e9, 1e9)),
        ]);
        paths.push(vec![
            (0.0, Pose::at(-5.0, 3.0)),
            (5.0, Pose::at(-5.0, 3.0)),
            (5.0 + 1e-6, Pose::at(500.0, 3.0)),
            (1e6, Pose::at(500.0, 3.0)),
        ]);
        let times = found(&paths, &Shape::disc(0.4));
        // One comes by the agent at the origin, the other drives through the
        // twenty of the second row.
        assert_eq!(times.len(), 21);
        assert!((times[0].0 - 5e-4).abs() < 1e-9);
        assert!(
            times[1..]
                .iter()
                .all(|(begin, _)| (begin - 5.0).abs() < 1e-5)
        );
    }
}
