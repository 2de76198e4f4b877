//! Heading for places beyond the next bend.
//!
//! A body that moves in any direction need not stop where its way bends. Instead of its next knot
//! it heads for the farthest released place ahead to which the straight line from the place that it is
//! at passes all knots between within a tolerance (Multi-Quadruped MAPF, section 3: a proportional
//! controller goes for the next intermediate waypoint). It can always stop at that place, which is on
//! its way, and stays near to its way meanwhile.
//!
//! The knots between are seen from here under angles that narrow a cone, and their headings narrow
//! the turns per metre in the same way: a place is tested once, whatever lies before it.

use crate::route::Place;

/// Straight motions from a place that pass some others within a tolerance.
pub(crate) struct Cone {
    here: Place,
    near_m: f64,
    near_rad: f64,
    /// Direction that angles are counted from, once there is a place beyond the tolerance.
    axis: Option<[f64; 2]>,
    /// Least and largest angle.
    angles: [f64; 2],
    /// Least and largest turn in radians per metre.
    turns: [f64; 2],
    /// Distance of the last place.
    distance: f64,
}

impl Cone {
    /// All motions from a place, with tolerances in metres and radians.
    pub(crate) fn new(here: Place, [near_m, near_rad]: [f64; 2]) -> Self {
        const ANY: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];
        Self {
            here,
            near_m,
            near_rad,
            axis: None,
            angles: ANY,
            turns: ANY,
            distance: 0.0,
        }
    }

    /// The way to a place, and its length.
    fn way(&self, place: Place) -> ([f64; 2], f64) {
        let (x, y) = (place.x - self.here.x, place.y - self.here.y);
        ([x, y], (x * x + y * y).sqrt())
    }

    /// The turn on the way to a place, if headings matter.
    fn turn(&self, place: Place) -> Option<f64> {
        let headings = self.here.heading.zip(place.heading);
        headings.map(|(here, there)| there - here)
    }

    fn angle(axis: [f64; 2], [x, y]: [f64; 2]) -> f64 {
        libm::atan2(axis[0] * y - axis[1] * x, axis[0] * x + axis[1] * y)
    }

    /// True if the motion to a place passes all places before within the tolerances, and is longer
    /// than those to them.
    pub(crate) fn admits(&self, place: Place) -> bool {
        let (way, distance) = self.way(place);
        let within = |value: f64, [low, high]: [f64; 2]| value >= low && value <= high;
        distance > self.distance
            && self
                .axis
                .is_none_or(|axis| within(Self::angle(axis, way), self.angles))
            && self
                .turn(place)
                .is_none_or(|turn| within(turn / distance, self.turns))
    }

    /// Narrows the motions to those that pass a place. Returns its distance.
    pub(crate) fn pass(&mut self, place: Place) -> f64 {
        let (way, distance) = self.way(place);
        self.distance = self.distance.max(distance);
        if distance > self.near_m {
            let axis = *self.axis.get_or_insert(way);
            let (angle, half) = (Self::angle(axis, way), libm::asin(self.near_m / distance));
            self.angles[0] = self.angles[0].max(angle - half);
            self.angles[1] = self.angles[1].min(angle + half);
        }
        if let Some(turn) = self.turn(place).filter(|_| distance > 0.0) {
            self.turns[0] = self.turns[0].max((turn - self.near_rad) / distance);
            self.turns[1] = self.turns[1].min((turn + self.near_rad) / distance);
        }
        distance
    }
}
