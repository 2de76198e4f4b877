//! Bodies that follow the plan's reference exactly, by time.
//!
//! The reference of a plan on a grid is uniform within a step and rests after
//! the end of its path; that of a trajectory plan is its own. The body is on
//! the reference, unless that moves faster than
//! [`SimConfig::max_speed_cells_per_step`] (a plan on a grid that jumps): then
//! it goes towards the reference at that speed, substep by substep.

use fleetyard_world::Mover;

use crate::chunk::{Chunk, Off};
use crate::config::SimConfig;
use crate::event::{Change, EventKind, Other};
use crate::route::{Place, Reference};
use crate::track::Span;

/// Makes tracks of bodies that follow their references through a block.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Follower<'a> {
    pub(crate) reference: &'a Reference<'a>,
    pub(crate) config: &'a SimConfig,
    pub(crate) substeps_per_step: f64,
    pub(crate) block: Span,
}

impl Follower<'_> {
    /// Makes the track of the next body of a chunk.
    pub(crate) fn follow(&self, chunk: &mut Chunk, lane: usize) {
        let agent = chunk.first as usize + lane;
        let (mut x, mut y, mut heading) = (chunk.x[lane], chunk.y[lane], chunk.heading[lane]);
        let mut now = self.block.start;
        let last = self.reference.last(agent);
        chunk.tracks.open();
        chunk.tracks.push(now, x, y, heading);
        if self.block.length() <= 0.0 {
            chunk.tracks.push(now, x, y, heading);
            if last == 0 {
                let arrival = Change::new(now, EventKind::Arrive, agent as u32, Other::Goal);
                chunk.changes.push(arrival);
            }
            return;
        }
        let mut knot = self.reference.due(agent, 0, now);
        while now < self.block.end {
            let (reached, end, target) = self.piece(agent, knot, last, now);
            if self.on_reference(agent, knot, now, (x, y)) && !self.config.every_substep {
                (x, y, heading) = (target.x, target.y, target.heading.unwrap_or(heading));
                chunk.tracks.push(end, x, y, heading);
            } else {
                while now < end {
                    let until = (now.floor() + 1.0).min(end);
                    let target = if until < end {
                        self.reference.between(agent, knot, until)
                    } else {
                        target
                    };
                    let most = self.most(until - now);
                    let (dx, dy) = (target.x - x, target.y - y);
                    let squared = dx * dx + dy * dy;
                    if squared > most * most {
                        let part = most / squared.sqrt();
                        x += dx * part;
                        y += dy * part;
                        let (dx, dy) = (target.x - x, target.y - y);
                        let off = Off {
                            m: (dx * dx + dy * dy).sqrt(),
                            rad: 0.0,
                        };
                        chunk.tracking.note(agent as u32, off, until - now);
                    } else {
                        (x, y) = (target.x, target.y);
                    }
                    heading = target.heading.unwrap_or(heading);
                    chunk.tracks.push(until, x, y, heading);
                    now = until;
                }
            }
            now = end;
            knot += usize::from(reached);
            if reached && knot == last {
                let arrival = Change::new(now, EventKind::Arrive, agent as u32, Other::Goal);
                chunk.changes.push(arrival);
            }
        }
    }

    /// Largest distance that a body covers in a number of substeps.
    fn most(&self, substeps: f64) -> f64 {
        match self.reference {
            Reference::Grid { cell_size_m, .. } => {
                let speed = self.config.max_speed_cells_per_step * cell_size_m;
                speed * substeps / self.substeps_per_step
            }
            Reference::Trajectories { .. } => f64::INFINITY,
        }
    }

    /// The uniform stretch of the reference from `now` on: true if it ends at the next
    /// knot, its end, and the place of the reference there.
    fn piece(&self, agent: usize, knot: usize, last: usize, now: f64) -> (bool, f64, Place) {
        if knot < last {
            let next = self.reference.time(agent, knot + 1);
            if next <= self.block.end {
                // Rounding must not stop time.
                return (true, next.max(now), self.reference.place(agent, knot + 1));
            }
        }
        let end = self.block.end;
        (false, end, self.reference.between(agent, knot, end))
    }

    /// True if a body is on its reference and can follow it.
    fn on_reference(&self, agent: usize, knot: usize, now: f64, (x, y): (f64, f64)) -> bool {
        if let Reference::Trajectories { .. } = self.reference {
            return true;
        }
        let here = self.reference.between(agent, knot, now);
        if x.to_bits() != here.x.to_bits() || y.to_bits() != here.y.to_bits() {
            return false;
        }
        if knot >= self.reference.last(agent) {
            return true;
        }
        let (from, to) = (
            self.reference.place(agent, knot),
            self.reference.place(agent, knot + 1),
        );
        let (dx, dy) = (to.x - from.x, to.y - from.y);
        let most = self.most(self.substeps_per_step);
        dx * dx + dy * dy <= most * most
    }
}

/// Appends the track of the next body of a chunk, which is a moving obstacle.
pub(crate) fn follow_mover(
    mover: &Mover,
    substeps_per_s: f64,
    block: Span,
    chunk: &mut Chunk,
    lane: usize,
) {
    chunk.tracks.open();
    let (x, y, heading) = (chunk.x[lane], chunk.y[lane], chunk.heading[lane]);
    chunk.tracks.push(block.start, x, y, heading);
    let times = mover.times_s();
    let next = times.partition_point(|time_s| time_s * substeps_per_s <= block.start);
    for (time_s, pose) in times.iter().zip(mover.poses()).skip(next) {
        let when = time_s * substeps_per_s;
        if when >= block.end {
            break;
        }
        chunk.tracks.push(when, pose.x, pose.y, pose.heading);
    }
    let end = mover.pose_at(block.end / substeps_per_s);
    chunk.tracks.push(block.end, end.x, end.y, end.heading);
}
