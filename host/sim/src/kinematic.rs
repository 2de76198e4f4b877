//! Contacts and approaches of bodies in known motion: closed-form swept tests over
//! candidate pairs, without sampling.

use rayon::prelude::*;

use fleetyard_world::{Inside, Pose, Relative, Shape, contacts_in_span};

use crate::chunk::{CHUNK, Chunk};
use crate::event::{Change, EventKind, Other};
use crate::track::{Span, Track};
use crate::workers::Workers;

/// Number of pairs per piece of work.
const PIECE: usize = 512;

/// The nearest approach of every agent to any other, between centres.
#[derive(Debug)]
pub(crate) struct Nearest {
    range: f64,
    pub(crate) distance: Vec<f64>,
    pub(crate) when: Vec<f64>,
    pub(crate) other: Vec<u32>,
}

impl Nearest {
    pub(crate) fn new(agents: usize, range_m: f64) -> Self {
        Self {
            // Distances on grids are often whole numbers of cells: the range includes its
            // end despite rounding.
            range: range_m * (1.0 + 1e-9),
            distance: vec![f64::INFINITY; agents],
            when: vec![0.0; agents],
            other: vec![u32::MAX; agents],
        }
    }

    /// Distance below which an approach is a new minimum.
    fn limit(&self, agent: u32) -> f64 {
        self.distance[agent as usize].min(self.range)
    }

    /// Records an approach. The result does not depend on the order of calls: ties go to
    /// the earlier time, then to the lower index.
    fn note(&mut self, agent: u32, other: u32, distance: f64, when: f64) {
        let at = agent as usize;
        if distance > self.distance[at] {
            return;
        }
        let better = distance < self.distance[at]
            || when < self.when[at]
            || (when <= self.when[at] && other < self.other[at]);
        if better {
            self.distance[at] = distance;
            self.when[at] = when;
            self.other[at] = other;
        }
    }
}

/// Nearest approach of two agents in a block.
#[derive(Debug, Clone, Copy)]
struct Near {
    i: u32,
    j: u32,
    distance: f64,
    when: f64,
}

/// Findings of one piece of the list of pairs.
#[derive(Debug, Default)]
struct Findings {
    near: Vec<Near>,
    changes: Vec<Change>,
}

/// The search for contacts between bodies.
#[derive(Debug, Default)]
pub(crate) struct Sweep {
    findings: Vec<Findings>,
}

/// The bodies of a search.
pub(crate) struct Bodies<'a> {
    pub(crate) chunks: &'a [Chunk],
    /// Position of each body at the start of the block and its largest distance from it,
    /// side by side: these alone rule most pairs out.
    pub(crate) places: &'a [[f64; 3]],
    /// Number of agents, which come first; the rest are moving obstacles.
    pub(crate) agents: u32,
    /// The car of each of the last agents, which are trailers.
    pub(crate) cars: &'a [u32],
    pub(crate) shapes: &'a Shapes,
    /// Set to search contacts; otherwise only approaches.
    pub(crate) contacts: bool,
    pub(crate) tolerance_m: f64,
}

/// The shapes of all bodies, by kind.
#[derive(Debug)]
pub(crate) struct Shapes {
    pub(crate) kinds: Vec<Shape>,
    /// Kind of every body; empty if there is one kind.
    pub(crate) of_body: Vec<u32>,
}

impl Shapes {
    pub(crate) fn kind_of(&self, body: u32) -> usize {
        self.of_body.get(body as usize).copied().unwrap_or(0) as usize
    }

    pub(crate) fn of(&self, body: u32) -> &Shape {
        &self.kinds[self.kind_of(body)]
    }

    /// The largest effective radius.
    pub(crate) fn largest_radius_m(&self) -> f64 {
        fleetyard_world::common_radius_m(&self.kinds)
    }
}

impl Bodies<'_> {
    /// True if a body is the trailer of another one.
    fn tows(&self, car: u32, trailer: u32) -> bool {
        let first = self.agents - self.cars.len() as u32;
        let own = trailer.checked_sub(first);
        own.and_then(|own| self.cars.get(own as usize)) == Some(&car)
    }

    fn track(&self, body: u32) -> Track<'_> {
        let (chunk, lane) = (body as usize / CHUNK, body as usize % CHUNK);
        self.chunks[chunk].tracks.get(lane)
    }
}

impl Sweep {
    /// Memory of the search in bytes.
    pub(crate) fn memory_bytes(&self) -> usize {
        let each = |findings: &Findings| {
            findings.near.capacity() * size_of::<Near>()
                + findings.changes.capacity() * size_of::<Change>()
        };
        let own = self.findings.capacity() * size_of::<Findings>();
        own + self.findings.iter().map(each).sum::<usize>()
    }

    /// Sweeps all candidate pairs through a block. `first` is true in the first block:
    /// overlaps at its start begin then.
    pub(crate) fn run(
        &mut self,
        workers: Workers,
        bodies: &Bodies<'_>,
        pairs: &[(u32, u32)],
        first: bool,
        nearest: &mut Nearest,
        changes: &mut Vec<Change>,
    ) {
        let pieces = pairs.len().div_ceil(PIECE);
        if self.findings.len() < pieces {
            self.findings.resize_with(pieces, Findings::default);
        }
        let known = &*nearest;
        let sweep = |(pairs, findings): (&[(u32, u32)], &mut Findings)| {
            findings.near.clear();
            findings.changes.clear();
            for (i, j) in pairs.iter().copied() {
                sweep_pair(bodies, i, j, first, known, findings);
            }
        };
        let findings = &mut self.findings[..pieces];
        if workers.are_many() && pieces > 1 {
            pairs
                .par_chunks(PIECE)
                .zip(findings.par_iter_mut())
                .for_each(sweep);
        } else {
            pairs.chunks(PIECE).zip(findings.iter_mut()).for_each(sweep);
        }
        for findings in findings {
            for near in &findings.near {
                nearest.note(near.i, near.j, near.distance, near.when);
                nearest.note(near.j, near.i, near.distance, near.when);
            }
            changes.append(&mut findings.changes);
        }
    }
}

fn sweep_pair(
    bodies: &Bodies<'_>,
    i: u32,
    j: u32,
    first: bool,
    nearest: &Nearest,
    findings: &mut Findings,
) {
    // Pairs have the lower index first: here, at most one is an agent.
    if i >= bodies.agents || bodies.tows(i, j) {
        return;
    }
    let both_agents = j < bodies.agents;
    let (one, two) = (bodies.shapes.of(i), bodies.shapes.of(j));
    let discs = one.is_disc() && two.is_disc();
    let [ax, ay, a_travel] = bodies.places[i as usize];
    let [bx, by, b_travel] = bodies.places[j as usize];
    // Two discs without travel keep the relation of the block before.
    if discs && !first && a_travel + b_travel <= 0.0 {
        return;
    }
    let touch = if bodies.contacts {
        one.effective_radius_m() + two.effective_radius_m() - bodies.tolerance_m
    } else {
        f64::NEG_INFINITY
    };
    let near = if both_agents {
        nearest.limit(i).max(nearest.limit(j))
    } else {
        f64::NEG_INFINITY
    };
    // Lower bound of their distance in the block: most pairs that move side by side need
    // no sweep.
    let reach = (near.max(touch) + a_travel + b_travel) * (1.0 + 1e-12);
    let (dx, dy) = (bx - ax, by - ay);
    if reach < 0.0 || dx * dx + dy * dy > reach * reach {
        return;
    }
    let (a, b) = (bodies.track(i), bodies.track(j));
    let mut least = Near {
        i,
        j,
        distance: f64::INFINITY,
        when: 0.0,
    };
    let other = if both_agents {
        Other::Agent(j)
    } else {
        Other::Mover(j - bodies.agents)
    };
    let mut first = first;
    let mut inside: Vec<Inside> = Vec::new();
    each_common_span(a, b, |span, way, ends| {
        let (squared, share) = way.closest();
        if squared < least.distance {
            least.distance = squared;
            least.when = span.at(share);
        }
        if touch > 0.0 && squared < touch * touch {
            if discs {
                if let Some(inside) = way.inside_disc(touch, squared) {
                    report(inside, span, first, i, other, &mut findings.changes);
                }
            } else {
                inside.clear();
                let [from_a, to_a, from_b, to_b] = ends();
                contacts_in_span(
                    one,
                    from_a,
                    to_a,
                    two,
                    from_b,
                    to_b,
                    bodies.tolerance_m,
                    &mut inside,
                );
                for inside in &inside {
                    report(*inside, span, first, i, other, &mut findings.changes);
                }
            }
        }
        first = false;
    });
    least.distance = least.distance.sqrt();
    if least.distance <= near {
        findings.near.push(least);
    }
}

/// Reports the begins and ends of a body's overlaps with another in a span.
pub(crate) fn report(
    inside: Inside,
    span: Span,
    first: bool,
    agent: u32,
    other: Other,
    changes: &mut Vec<Change>,
) {
    if first || !inside.at_start {
        let when = span.at(inside.enter);
        changes.push(Change::new(when, EventKind::Begin, agent, other));
    }
    if !inside.at_end {
        let when = span.at(inside.leave);
        changes.push(Change::new(when, EventKind::End, agent, other));
    }
}

/// Calls `visit` for every stretch in which both bodies move uniformly, with the motion
/// of the second relative to the first and the poses of both at its ends.
fn each_common_span(
    a: Track<'_>,
    b: Track<'_>,
    mut visit: impl FnMut(Span, Relative, &dyn Fn() -> [Pose; 4]),
) {
    if a.t.len() == b.t.len() && a.t == b.t {
        let seen = |at: usize| b.place(at) - a.place(at);
        let mut start = seen(0);
        for at in 1..a.t.len() {
            let end = seen(at);
            let span = Span {
                start: a.t[at - 1],
                end: a.t[at],
            };
            visit(span, Relative { start, end }, &|| {
                [a.pose(at - 1), a.pose(at), b.pose(at - 1), b.pose(at)]
            });
            start = end;
        }
        return;
    }
    let (mut ia, mut ib) = (1, 1);
    let (mut start, mut from_a, mut from_b) = (a.t[0], a.pose(0), b.pose(0));
    while ia < a.t.len() && ib < b.t.len() {
        let end = a.t[ia].min(b.t[ib]);
        let (to_a, to_b) = (a.within(ia, end), b.within(ib, end));
        let way = Relative::between([from_a, to_a], [from_b, to_b]);
        let ends = [from_a, to_a, from_b, to_b];
        visit(Span { start, end }, way, &|| ends);
        (start, from_a, from_b) = (end, to_a, to_b);
        ia += usize::from(a.t[ia] <= end);
        ib += usize::from(b.t[ib] <= end);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Digests on any number of threads hang on it.
    #[test]
    fn ties_of_the_nearest_approach_go_to_the_earlier_time_and_the_lower_index() {
        let all = [
            (7, 2.0, 1.0),
            (3, 2.0, 1.0),
            (5, 2.0, 1.0),
            (1, 2.0, 4.0),
            (9, 2.0, 0.5),
            (8, 2.0, 0.5),
            (0, 3.0, 0.0),
        ];
        // Of each part of them, in every order of two and as they are turned round.
        for count in 1..=all.len() {
            for turned in 0..count {
                for backwards in [false, true] {
                    let mut some = all[..count].to_vec();
                    some.rotate_left(turned);
                    if backwards {
                        some.reverse();
                    }
                    let mut nearest = Nearest::new(2, 10.0);
                    for (other, distance, when) in &some {
                        nearest.note(1, *other, *distance, *when);
                    }
                    let wanted = (some.iter())
                        .min_by(|a, b| {
                            let by_distance = a.1.total_cmp(&b.1);
                            by_distance.then(a.2.total_cmp(&b.2)).then(a.0.cmp(&b.0))
                        })
                        .unwrap();
                    let found = (nearest.other[1], nearest.distance[1], nearest.when[1]);
                    assert_eq!(found, *wanted, "{some:?}");
                    assert_eq!(nearest.other[0], u32::MAX);
                }
            }
        }
    }
}
