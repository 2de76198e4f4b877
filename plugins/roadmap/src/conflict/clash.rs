//! Conflicts of two paths, and the constraints that resolve them.
//!
//! - Two moves (Andreychuk et al., AIJ 305, 2022, section 4): edges conflict where the delay of the second start against the
//!   first is in an open interval (low, high). The first agent does not start in [s, t − low), or the second does not start in
//!   [t, s + high): each pair of starts that both forbid conflicts.
//! - A move past an agent at rest. The original rule forbids the vertex while the move is near, and the move until the agent
//!   is gone, though the agent may leave sooner: it loses solutions (J. Li et al., arXiv 2501.07744). Delta branching
//!   (Combrink, Roselli, Fabian, arXiv 2508.16410) forbids the start for a while only, and the vertex during the time in which
//!   all those starts are near.
//! - A move past an agent at its goal, which stays for good: it arrives after the move is gone, or before, and then nobody comes
//!   near from that time on. On grids this is target reasoning (J. Li et al., AIJ 301, 2021).

use fleetyard_plugin_plane::motion::Span;

use super::constraint::{Ban, Constraint, Place};
use super::path::{Segment, Track};
use super::{Branching, Team};
use crate::roadmap::{Edge, Vertex};

/// Two discs that are too close for no longer than this do not conflict: times are rounded, and the separation has a margin.
pub(super) const INSTANT: f64 = 1e-8;

/// The share of the time near a vertex for which delta branching forbids starts: most of it, since the agent at rest may as well
/// rest elsewhere.
const SHARE: f64 = 0.9;

/// Most conflicts of two paths that are told apart.
const MOST: usize = 4;

/// A conflict of two paths, the first and the second.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Clash {
    /// Both drive.
    Moves {
        edges: [Edge; 2],
        starts: [f64; 2],
        /// Delays of the second start against the first that conflict.
        delays: Span,
    },
    /// One rests.
    Rest {
        /// The number of the path that rests.
        resting: usize,
        vertex: Vertex,
        stay: Span,
        /// The move of the other one, the start, and the time of the move that is near the vertex.
        edge: Edge,
        start: f64,
        near: Span,
    },
}

impl Clash {
    /// True if one of both rests for good.
    pub(super) fn is_final(&self) -> bool {
        matches!(self, Self::Rest { stay, .. } if stay.high == f64::INFINITY)
    }

    /// The time at which it begins, nearly.
    pub(super) fn time(&self) -> f64 {
        match self {
            Self::Moves { starts, .. } => starts[0].max(starts[1]),
            Self::Rest {
                stay, start, near, ..
            } => stay.low.max(start + near.low),
        }
    }

    /// Constraints of which the first or the second agent has to keep its own, so that this does not happen again. But for the
    /// original branching, no two paths without a conflict are forbidden by both.
    pub(super) fn split(&self, agents: [u32; 2], branching: Branching) -> [Constraint; 2] {
        match *self {
            Self::Moves {
                edges,
                starts: [first, second],
                delays,
            } => [
                Constraint::Ban(Ban {
                    agent: agents[0],
                    place: Place::Edge(edges[0]),
                    from: first,
                    until: second - delays.low,
                }),
                Constraint::Ban(Ban {
                    agent: agents[1],
                    place: Place::Edge(edges[1]),
                    from: second,
                    until: first + delays.high,
                }),
            ],
            Self::Rest {
                resting,
                vertex,
                stay,
                edge,
                start,
                near,
            } => {
                let (rests, moves) = (agents[resting], agents[1 - resting]);
                let (from, until) = (start + near.low, start + near.high);
                let bans = |from: f64, end: f64| {
                    [
                        Constraint::Ban(Ban {
                            agent: rests,
                            place: Place::Vertex(vertex),
                            from,
                            until,
                        }),
                        Constraint::Ban(Ban {
                            agent: moves,
                            place: Place::Edge(edge),
                            from: start,
                            until: end,
                        }),
                    ]
                };
                if branching == Branching::Original {
                    return bans(from, stay.high - near.low);
                }
                if stay.high == f64::INFINITY {
                    // A little earlier than the move is gone, so that it is not the move's end that decides.
                    let time = until - INSTANT / 10.0;
                    return [
                        Constraint::ArriveFrom { agent: rests, time },
                        Constraint::ArriveBefore { agent: rests, time },
                    ];
                }
                let share = SHARE * (stay.high.min(until) - from);
                bans(from + share, start + share)
            }
        }
    }
}

/// Conflicts of two tracks in the order of time, at most so many.
pub(super) fn clashes(team: &Team<'_>, [one, other]: [&Track; 2], most: usize) -> Vec<Clash> {
    let mut found = Vec::new();
    let (mut first, mut second) = (one.0.iter(), other.0.iter());
    let (mut a, mut b) = (first.next(), second.next());
    while let (Some(x), Some(y)) = (a, b) {
        if team.are_close(x, y)
            && let Some(clash) = clash(team, x, y)
        {
            found.push(clash);
            if found.len() >= most {
                break;
            }
        }
        if x.to <= y.to {
            a = first.next();
        } else {
            b = second.next();
        }
    }
    found
}

/// Conflicts of two tracks that are worth to be weighed against each other.
pub(super) fn weighed(team: &Team<'_>, tracks: [&Track; 2], branching: Branching) -> Vec<Clash> {
    let mut found = clashes(team, tracks, MOST);
    // That nobody passes a goal any more decides the others.
    if branching == Branching::Sound
        && let Some(last) = found.iter().copied().find(Clash::is_final)
    {
        found = vec![last];
    }
    found
}

impl Team<'_> {
    /// True if two agents come too close in two segments, at least one of which is a drive.
    pub(super) fn are_close(&self, x: &Segment, y: &Segment) -> bool {
        let (from, to) = (x.from.max(y.from), x.to.min(y.to));
        if from >= to || x.is_rest() && y.is_rest() {
            return false;
        }
        let (apart, drift) = (x.at(from) - y.at(from), x.velocity - y.velocity);
        let square = drift.norm_squared();
        let nearest = if square > 0.0 {
            (-apart.dot(&drift) / square).clamp(0.0, to - from)
        } else {
            0.0
        };
        let distance = self.distance(x.vertex, y.vertex);
        (apart + drift * nearest).norm_squared() < distance * distance
    }

    /// The time at which a drive may begin that comes too close to a segment of another agent, so that this one is gone.
    pub(super) fn clear_of(&self, drive: &Segment, other: &Segment) -> f64 {
        let motion = self.closeness.roadmap().motion(drive.edge);
        let distance = self.distance(drive.vertex, other.vertex);
        let clear = if other.is_rest() {
            let near = motion.near(other.place, distance);
            near.map(|near| other.to - near.low)
        } else {
            let other_motion = self.closeness.roadmap().motion(other.edge);
            let overlap = motion.overlap(&other_motion, distance);
            overlap.map(|overlap| other.from - overlap.forward.low)
        };
        clear.unwrap_or(drive.from)
    }

    /// True if an agent comes too close to a vertex after a time.
    pub(super) fn comes_near(&self, track: &Track, vertex: Vertex, time: f64) -> bool {
        let mut there = Segment {
            from: time,
            to: f64::INFINITY,
            place: self.closeness.roadmap().place(vertex),
            velocity: fleetyard_plugin_plane::Vector::zeros(),
            edge: 0,
            vertex,
        };
        let first = track.0.partition_point(|segment| segment.to <= time);
        track.0[first..].iter().any(|segment| {
            there.from = there.from.max(segment.from);
            self.are_close(segment, &there)
        })
    }
}

fn clash(team: &Team<'_>, x: &Segment, y: &Segment) -> Option<Clash> {
    let (roadmap, distance) = (team.closeness.roadmap(), team.distance(x.vertex, y.vertex));
    if !x.is_rest() && !y.is_rest() {
        let (one, other) = (roadmap.motion(x.edge), roadmap.motion(y.edge));
        let delays = one.overlap(&other, distance)?.forward;
        let delay = y.from - x.from;
        let inside = delays.low + INSTANT < delay && delay < delays.high - INSTANT;
        return inside.then_some(Clash::Moves {
            edges: [x.edge, y.edge],
            starts: [x.from, y.from],
            delays,
        });
    }
    let (resting, rest, drive) = if x.is_rest() { (0, x, y) } else { (1, y, x) };
    let motion = roadmap.motion(drive.edge);
    let near = motion.near(rest.place, distance)?;
    let (from, until) = (drive.from + near.low, drive.from + near.high);
    let together = until.min(rest.to) - from.max(rest.from);
    (together > INSTANT).then_some(Clash::Rest {
        resting,
        vertex: rest.vertex,
        stay: Span {
            low: rest.from,
            high: rest.to,
        },
        edge: drive.edge,
        start: drive.from,
        near,
    })
}
