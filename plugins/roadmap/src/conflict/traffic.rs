//! The tracks of others, by time: how many of them a drive or a rest meets.

use super::Team;
use super::path::{Segment, Track};

/// Parts of the time until the last arrival.
const PARTS: usize = 64;

/// Segments of others.
#[derive(Debug, Default)]
pub(super) struct Traffic {
    /// By the part of time that they are in; each is in all of its parts.
    parts: Vec<Vec<Segment>>,
    /// Seconds of a part.
    width: f64,
    /// The rests that never end.
    parked: Vec<Segment>,
}

impl Traffic {
    /// Makes it the traffic of some tracks.
    pub(super) fn fill<'t>(&mut self, tracks: impl Iterator<Item = &'t Track> + Clone) {
        self.parts.resize_with(PARTS, Vec::new);
        self.parts.iter_mut().for_each(Vec::clear);
        self.parked.clear();
        let ends = tracks.clone().filter_map(|track| track.0.last());
        let last = ends.map(|segment| segment.from).fold(0.0, f64::max);
        self.width = (last / PARTS as f64).max(f64::MIN_POSITIVE);
        for segment in tracks.flat_map(|track| &track.0) {
            if segment.to == f64::INFINITY {
                self.parked.push(*segment);
                continue;
            }
            for part in self.part(segment.from)..=self.part(segment.to) {
                self.parts[part].push(*segment);
            }
        }
    }

    fn part(&self, time: f64) -> usize {
        ((time / self.width) as usize).min(PARTS - 1)
    }

    /// The segments of others that come too close to a segment.
    pub(super) fn met<'a>(
        &'a self,
        team: &'a Team<'_>,
        segment: &'a Segment,
    ) -> impl Iterator<Item = &'a Segment> {
        let first = self.part(segment.from);
        let parts = first..=self.part(segment.to);
        let moving = parts.flat_map(move |part| {
            let here = self.parts[part].iter();
            // One that is in several parts counts in the first of them that both are in.
            here.filter(move |other| self.part(other.from).max(first) == part)
        });
        let all = moving.chain(&self.parked);
        all.filter(|other| team.are_close(segment, other))
    }
}
