//! The way of every agent through time, small enough for a page.
//!
//! A track is a list of knots, each a moment and a quantised pose, between which
//! an agent moves and turns uniformly. Poses arrive sample by sample; one
//! becomes a knot only when a straight line from the last knot would pass a
//! sample since then by more than one quantum. Memory is what is kept, not what
//! arrives.
//!
//! # Encoding
//!
//! Per knot a number that holds, from its lowest bit: whether x, y and heading
//! differ from the last knot (3 bits), and the samples since the last knot. Then
//! the differences of those that differ. All numbers are LEB128, 7 bits a byte,
//! lowest first; differences are mapped to 0, -1, 1, -2, … → 0, 1, 2, 3, … first. A track
//! begins at sample 0 with all coordinates 0, so that its first knot holds the
//! start. Tracks follow each other, each behind the number of its knots.

use fleetyard_sim::trace::Outline;

use crate::svg::reach_m;
use crate::world::floor_exponent;

/// A quantised pose: x, y, heading.
type Pose = [i64; 3];

/// Quanta of length and angle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Quanta {
    pub(crate) length_m: f64,
    pub(crate) angle_rad: f64,
}

/// A tenth of a degree.
const ANGLE_RAD: f64 = std::f64::consts::PI / 1800.0;

impl Quanta {
    /// Those that suit bodies of some outlines.
    pub(crate) fn of(outlines: &[Outline]) -> Self {
        let least = (outlines.iter().map(reach_m)).fold(f64::INFINITY, f64::min);
        let exponent = floor_exponent(if least > 0.0 { least / 100.0 } else { 1e-3 });
        Self {
            length_m: 10f64.powi(exponent.min(1)),
            angle_rad: ANGLE_RAD,
        }
    }

    fn pose(self, x_m: f64, y_m: f64, heading_rad: f64) -> Pose {
        [
            self.length(x_m),
            self.length(y_m),
            self.heading(heading_rad),
        ]
    }

    /// A coordinate.
    pub(crate) fn length(self, value_m: f64) -> i64 {
        whole(value_m / self.length_m)
    }

    /// A heading.
    pub(crate) fn heading(self, value_rad: f64) -> i64 {
        whole(value_rad / self.angle_rad)
    }

    /// A heading up to whole turns: nobody turns by more than half of one from sample to sample.
    pub(crate) fn heading_near(self, value_rad: f64, last: i64) -> i64 {
        let turn = (std::f64::consts::TAU / self.angle_rad).round();
        let now = self.heading(value_rad);
        now + (((last - now) as f64 / turn).round() * turn) as i64
    }
}

/// A number of quanta. The page has 32 bits for it; nobody is 10^9 quanta away.
fn whole(value: f64) -> i64 {
    // Casts saturate, and what is not a number becomes 0.
    (value.round() as i64).clamp(-1 << 30, 1 << 30)
}

/// The track of one agent, as it grows.
#[derive(Debug, Clone)]
pub(crate) struct Track {
    bytes: Vec<u8>,
    knots: u64,
    /// The last knot that was written.
    anchor: (u32, Pose),
    /// The last sample, which may become a knot.
    last: (u32, Pose),
    /// For each coordinate the least and largest slope, in quanta per sample, of
    /// lines from the anchor that pass all samples since then.
    slopes: [(f64, f64); 3],
}

/// Any slope.
const FREE: [(f64, f64); 3] = [(f64::NEG_INFINITY, f64::INFINITY); 3];

impl Track {
    /// A track that begins with a pose at sample 0.
    pub(crate) fn new(quanta: Quanta, x_m: f64, y_m: f64, heading_rad: f64) -> Self {
        let start = quanta.pose(x_m, y_m, heading_rad);
        let mut track = Self {
            bytes: Vec::new(),
            knots: 0,
            anchor: (0, [0; 3]),
            last: (0, start),
            slopes: FREE,
        };
        track.knot();
        track
    }

    /// Adds the pose at a later sample.
    pub(crate) fn push(
        &mut self,
        sample: u32,
        quanta: Quanta,
        x_m: f64,
        y_m: f64,
        heading_rad: f64,
    ) {
        let pose = [
            quanta.length(x_m),
            quanta.length(y_m),
            quanta.heading_near(heading_rad, self.last.1[2]),
        ];
        if !self.is_seen_from_anchor(sample, pose) {
            self.knot();
        }
        let (since, from) = self.anchor;
        let time = f64::from(sample - since);
        for ((low, high), (to, from)) in self.slopes.iter_mut().zip(pose.into_iter().zip(from)) {
            let distance = (to - from) as f64;
            *low = low.max((distance - 1.0) / time);
            *high = high.min((distance + 1.0) / time);
        }
        self.last = (sample, pose);
    }

    fn is_seen_from_anchor(&self, sample: u32, pose: Pose) -> bool {
        let (since, from) = self.anchor;
        let time = f64::from(sample - since);
        let mut coordinates = self.slopes.iter().zip(pose.into_iter().zip(from));
        coordinates.all(|((low, high), (to, from))| {
            let slope = (to - from) as f64 / time;
            slope >= *low && slope <= *high
        })
    }

    /// Makes the last sample a knot.
    fn knot(&mut self) {
        let ((since, from), (sample, pose)) = (self.anchor, self.last);
        let changed = |at: usize| u64::from(pose[at] != from[at]) << at;
        let head = u64::from(sample - since) << 3 | changed(0) | changed(1) | changed(2);
        number(&mut self.bytes, head);
        for (to, from) in pose.into_iter().zip(from) {
            if to != from {
                difference(&mut self.bytes, to - from);
            }
        }
        self.knots += 1;
        self.anchor = self.last;
        self.slopes = FREE;
    }

    /// Makes the last sample a knot, whatever comes.
    pub(crate) fn rest(&mut self) {
        if self.last.0 > self.anchor.0 {
            self.knot();
        }
    }

    /// Appends the encoded track and says how many knots it has.
    pub(crate) fn write(mut self, out: &mut Vec<u8>) -> u64 {
        if self.last.0 > self.anchor.0 && self.last.1 != self.anchor.1 {
            self.knot();
        }
        number(out, self.knots);
        out.extend(self.bytes);
        self.knots
    }
}

/// A difference as a number that is small where it is.
pub(crate) fn difference(out: &mut Vec<u8>, value: i64) {
    number(out, (value << 1 ^ value >> 63) as u64);
}

/// LEB128.
fn number(out: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}

/// Base64 with the standard alphabet.
pub fn base64(bytes: &[u8]) -> String {
    const ALPHABET: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut out = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for group in bytes.chunks(3) {
        let byte = |at: usize| u32::from(group.get(at).copied().unwrap_or(0));
        let bits = byte(0) << 16 | byte(1) << 8 | byte(2);
        for at in 0..4 {
            out.push(if at <= group.len() {
                char::from(ALPHABET[(bits >> (18 - 6 * at)) as usize & 63])
            } else {
                '='
            });
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    const QUANTA: Quanta = Quanta {
        length_m: 0.001,
        angle_rad: 0.001,
    };

    /// Reads a track back, as the page does.
    fn read(bytes: &[u8]) -> Vec<(f64, [f64; 3])> {
        let mut bytes = bytes.iter();
        let mut number = || {
            let (mut value, mut shift) = (0u64, 0);
            loop {
                let byte = *bytes.next().unwrap();
                value |= u64::from(byte & 0x7f) << shift;
                shift += 7;
                if byte < 0x80 {
                    return value;
                }
            }
        };
        let (mut sample, mut pose) = (0, [0i64; 3]);
        let knots = number();
        (0..knots)
            .map(|_| {
                let head = number();
                sample += head >> 3;
                for (at, value) in pose.iter_mut().enumerate() {
                    if head >> at & 1 == 1 {
                        let code = number();
                        *value += (code >> 1) as i64 ^ -((code & 1) as i64);
                    }
                }
                (sample as f64, pose.map(|value| value as f64 * 0.001))
            })
            .collect()
    }

    fn track(samples: u32, pose: impl Fn(f64) -> [f64; 3]) -> Vec<(f64, [f64; 3])> {
        let [x, y, heading] = pose(0.0);
        let mut track = Track::new(QUANTA, x, y, heading);
        for sample in 1..samples {
            let [x, y, heading] = pose(f64::from(sample));
            track.push(sample, QUANTA, x, y, heading);
        }
        let mut bytes = Vec::new();
        track.write(&mut bytes);
        let knots = read(&bytes);
        for sample in 0..samples {
            let time = f64::from(sample);
            let after = knots.partition_point(|knot| knot.0 <= time);
            let (from, from_pose) = knots[after - 1];
            let (to, to_pose) = *knots.get(after).unwrap_or(&(from + 1.0, from_pose));
            for (at, expected) in pose(time).into_iter().enumerate() {
                let part = (time - from) / (to - from);
                let shown = from_pose[at] + part * (to_pose[at] - from_pose[at]);
                let error = (shown - expected).abs();
                assert!(error <= 0.0015 + 1e-9, "{error} at sample {sample} of {at}");
            }
        }
        knots
    }

    #[test]
    fn tracks_pass_every_sample_within_one_and_a_half_quanta() {
        track(500, |t| {
            [(t * 0.05).sin() * 3.0, (t * 0.03).cos(), t * 0.02]
        });
        track(500, |t| [0.5 * t * t * 1e-4, -3.0 * t, -t * t * 1e-3]);
        track(300, |t| [(t * 7919.0) % 13.0, (t * 104_729.0) % 7.0, 0.0]);
    }

    #[test]
    fn uniform_motion_needs_no_knots_in_between() {
        assert_eq!(track(1000, |t| [t * 0.0123, 5.0, 0.0]).len(), 2);
        assert_eq!(track(1000, |_| [1.0, 2.0, 3.0]).len(), 1);
        let corner = |t: f64| [t.min(40.0) * 0.1, (t - 60.0).max(0.0) * 0.1, 0.0];
        let knots = track(100, corner);
        let times: Vec<f64> = knots.iter().map(|knot| knot.0).collect();
        assert_eq!(times, [0.0, 40.0, 60.0, 99.0]);
    }

    #[test]
    fn poses_that_are_no_numbers_do_no_harm() {
        let mut track = Track::new(QUANTA, f64::NAN, f64::INFINITY, -1e300);
        track.push(1, QUANTA, 1e300, f64::NEG_INFINITY, f64::NAN);
        track.push(2, QUANTA, 0.0, 0.0, 0.0);
        let mut bytes = Vec::new();
        track.write(&mut bytes);
        assert_eq!(read(&bytes).len(), 3);
    }

    #[test]
    fn base64_is_the_standard_one() {
        let cases = [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foobar", "Zm9vYmFy"),
        ];
        for (text, expected) in cases {
            assert_eq!(base64(text.as_bytes()), expected);
        }
    }
}
