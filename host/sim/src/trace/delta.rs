//! Encoding of groups of states as numbers that are small where motion is smooth.
//!
//! Every coordinate is predicted from its last values, with constant velocity or with
//! constant acceleration, whichever predicted the last value better. The difference of
//! the bit patterns of value and prediction is stored, taken as integers in the order of
//! the floats: this is lossless, and smooth motion leaves a few bits. Then the first
//! bytes of all differences of a channel are stored together, then the second bytes, and
//! so on, body by body, so that zeros stand beside zeros.

use super::{Header, States};

/// Predictor state of a coordinate.
#[derive(Debug, Clone, Copy, Default)]
struct Track {
    /// The last values, the latest first.
    last: [f64; 3],
    /// Predict with constant acceleration instead of constant velocity.
    curved: bool,
}

/// The two predictions of the next value.
#[derive(Debug, Clone, Copy)]
struct Guesses {
    straight: f64,
    curve: f64,
}

impl Track {
    #[inline]
    fn guesses(&self) -> Guesses {
        let [a, b, c] = self.last;
        Guesses {
            straight: finite_or(a + (a - b), a),
            curve: finite_or(3.0 * (a - b) + c, a),
        }
    }

    /// Starts with a first value.
    #[inline]
    fn begin(&mut self, value: f64) {
        self.last = [value; 3];
        self.curved = false;
    }

    /// Updates the predictor with a value; returns its difference from the prediction.
    #[inline]
    fn learn(&mut self, value: f64, guesses: Guesses) -> u64 {
        let straight = difference(value, guesses.straight);
        let curve = difference(value, guesses.curve);
        let predicted = if self.curved { curve } else { straight };
        // If both are about as good, the simpler one: it adds less noise.
        self.curved = curve < straight >> 2;
        self.last = [value, self.last[0], self.last[1]];
        predicted
    }
}

/// Arithmetic on infinite values gives patterns that differ between machines.
fn finite_or(value: f64, otherwise: f64) -> f64 {
    if value.is_finite() { value } else { otherwise }
}

/// The bit pattern as an integer that grows with the float.
fn ordered(value: f64) -> i64 {
    let bits = value.to_bits() as i64;
    bits ^ ((bits >> 63) as u64 >> 1) as i64
}

fn from_ordered(number: i64) -> f64 {
    f64::from_bits((number ^ ((number >> 63) as u64 >> 1) as i64) as u64)
}

/// Difference of a value from its prediction, with the sign in the lowest bit.
fn difference(value: f64, prediction: f64) -> u64 {
    zigzag(ordered(value).wrapping_sub(ordered(prediction)))
}

fn zigzag(number: i64) -> u64 {
    ((number << 1) ^ (number >> 63)) as u64
}

fn from_zigzag(number: u64) -> i64 {
    (number >> 1) as i64 ^ -((number & 1) as i64)
}

/// Predictor state of all bodies, equal in encoder and decoder after every tick.
#[derive(Debug, Default)]
pub(super) struct Tracks {
    bodies: usize,
    /// x, y and headings (if there are any), each of all bodies.
    coordinates: Vec<Track>,
    /// One entry per body, or empty.
    progress: Vec<u32>,
    /// Set before the first state.
    fresh: bool,
}

/// Layout of states, as in the header.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Layout {
    pub(super) bodies: usize,
    /// x, y and optionally headings.
    channels: usize,
    progress: bool,
}

impl Layout {
    pub(super) fn new(header: &Header) -> Self {
        Self {
            bodies: header.bodies(),
            channels: 2 + usize::from(header.headings),
            progress: header.progress,
        }
    }

    /// Bytes per channel for a body at a tick: floats, then progress.
    fn widths(self) -> impl Iterator<Item = usize> {
        std::iter::repeat_n(8, self.channels).chain(self.progress.then_some(4))
    }

    /// Coordinates of a tick.
    pub(super) fn floats(self) -> usize {
        self.bodies * self.channels
    }

    /// Numbers of a tick.
    pub(super) fn numbers(self) -> usize {
        self.bodies * (self.channels + usize::from(self.progress))
    }

    /// Bytes of a tick before compression.
    pub(super) fn tick_bytes(self) -> usize {
        self.bodies * self.widths().sum::<usize>()
    }
}

impl Tracks {
    pub(super) fn new(layout: Layout) -> Self {
        Self {
            bodies: layout.bodies,
            coordinates: vec![Track::default(); layout.floats()],
            progress: vec![0; if layout.progress { layout.bodies } else { 0 }],
            fresh: true,
        }
    }

    /// Resets the predictors: the next states are encoded without earlier ones.
    pub(super) fn reset(&mut self) {
        self.coordinates.fill(Track::default());
        self.progress.fill(0);
        self.fresh = true;
    }

    /// Appends the numbers of the states at the next tick.
    pub(super) fn encode(&mut self, states: &States<'_>, out: &mut Vec<u64>) {
        let channels = [Some(states.x_m), Some(states.y_m), states.heading_rad];
        let values = channels.into_iter().flatten().flatten();
        for (track, value) in self.coordinates.iter_mut().zip(values) {
            if self.fresh {
                out.push(difference(*value, 0.0));
                track.begin(*value);
            } else {
                out.push(track.learn(*value, track.guesses()));
            }
        }
        let progress = states.progress.unwrap_or_default();
        for (last, value) in self.progress.iter_mut().zip(progress) {
            out.push(zigzag(i64::from(value.wrapping_sub(*last).cast_signed())));
            *last = *value;
        }
        self.fresh = false;
    }

    /// Decodes the numbers of the next tick; the states are then in `values` (all x, all
    /// y, all headings) and [`Tracks::progress`].
    pub(super) fn decode(&mut self, numbers: &[u64], values: &mut [f64]) {
        let (floats, progress) = numbers.split_at(self.coordinates.len());
        let coordinates = self.coordinates.iter_mut().zip(values);
        for ((track, value), number) in coordinates.zip(floats) {
            let guesses = track.guesses();
            let from = match (self.fresh, track.curved) {
                (true, _) => 0.0,
                (false, true) => guesses.curve,
                (false, false) => guesses.straight,
            };
            *value = from_ordered(ordered(from).wrapping_add(from_zigzag(*number)));
            if self.fresh {
                track.begin(*value);
            } else {
                track.learn(*value, guesses);
            }
        }
        for (last, number) in self.progress.iter_mut().zip(progress) {
            *last = last.wrapping_add(from_zigzag(*number) as u32);
        }
        self.fresh = false;
    }

    /// The states that were decoded last.
    pub(super) fn states<'a>(&'a self, values: &'a [f64]) -> States<'a> {
        let (x_m, rest) = values.split_at(self.bodies);
        let (y_m, headings) = rest.split_at(self.bodies);
        States {
            x_m,
            y_m,
            heading_rad: (!headings.is_empty()).then_some(headings),
            progress: (!self.progress.is_empty()).then_some(&self.progress),
        }
    }
}

/// Splits the numbers of a group of ticks into planes of bytes: for every channel the
/// lowest bytes of all its numbers, body by body and tick by tick within a body, then the
/// second bytes, up to the width of the channel.
pub(super) fn to_planes(layout: Layout, numbers: &[u64], planes: &mut Vec<u8>) {
    let tick = layout.numbers();
    let ticks = numbers.len() / tick;
    planes.clear();
    planes.resize(ticks * layout.tick_bytes(), 0);
    let plane = ticks * layout.bodies;
    let mut rest = &mut planes[..];
    for (channel, width) in layout.widths().enumerate() {
        let (planes, others) = rest.split_at_mut(width * plane);
        for body in 0..layout.bodies {
            let first = channel * layout.bodies + body;
            for at in 0..ticks {
                let number = numbers[at * tick + first].to_le_bytes();
                let place = body * ticks + at;
                for (at, byte) in number.iter().take(width).enumerate() {
                    planes[at * plane + place] = *byte;
                }
            }
        }
        rest = others;
    }
}

/// The reverse of [`to_planes`].
pub(super) fn from_planes(layout: Layout, planes: &[u8], numbers: &mut Vec<u64>) {
    let tick = layout.numbers();
    let ticks = planes.len() / layout.tick_bytes();
    numbers.clear();
    numbers.resize(ticks * tick, 0);
    let plane = ticks * layout.bodies;
    let mut rest = planes;
    for (channel, width) in layout.widths().enumerate() {
        let (planes, others) = rest.split_at(width * plane);
        for body in 0..layout.bodies {
            let first = channel * layout.bodies + body;
            for at in 0..ticks {
                let place = body * ticks + at;
                let mut number = [0; 8];
                for (at, byte) in number.iter_mut().take(width).enumerate() {
                    *byte = planes[at * plane + place];
                }
                numbers[at * tick + first] = u64::from_le_bytes(number);
            }
        }
        rest = others;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn round_trip(ticks: &[(Vec<f64>, Vec<u32>)]) -> Vec<u64> {
        let bodies = ticks[0].1.len();
        let layout = Layout {
            bodies,
            channels: 3,
            progress: true,
        };
        let (mut numbers, mut planes) = (Vec::new(), Vec::new());
        let mut tracks = Tracks::new(layout);
        for (values, progress) in ticks {
            let states = States {
                x_m: &values[..bodies],
                y_m: &values[bodies..2 * bodies],
                heading_rad: Some(&values[2 * bodies..]),
                progress: Some(progress),
            };
            tracks.encode(&states, &mut numbers);
        }
        to_planes(layout, &numbers, &mut planes);
        assert_eq!(planes.len(), ticks.len() * bodies * 28);
        let mut back = Vec::new();
        from_planes(layout, &planes, &mut back);
        let mut tracks = Tracks::new(layout);
        let mut decoded = vec![0.0; 3 * bodies];
        for (numbers, (values, progress)) in back.chunks_exact(layout.numbers()).zip(ticks) {
            tracks.decode(numbers, &mut decoded);
            let bits = |values: &[f64]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
            assert_eq!(bits(&decoded), bits(values));
            assert_eq!(tracks.states(&decoded).progress, Some(&progress[..]));
        }
        numbers
    }

    #[test]
    fn any_bits_come_back() {
        let odd = [
            0.0,
            -0.0,
            1.0,
            -1.5,
            f64::MIN_POSITIVE / 4.0,
            f64::MAX,
            -f64::MAX,
            f64::INFINITY,
            f64::NEG_INFINITY,
            f64::NAN,
            f64::from_bits(0xfff8_0000_dead_beef),
            1e-300,
        ];
        let at = |tick: usize| -> Vec<f64> {
            (0..6)
                .map(|i| odd[(tick * (i + 1) + 5 * i) % odd.len()])
                .collect()
        };
        let ticks: Vec<_> = (0..50)
            .map(|tick| (at(tick), vec![tick as u32, u32::MAX - (tick as u32) * 7]))
            .collect();
        round_trip(&ticks);
    }

    #[test]
    fn smooth_motion_leaves_small_numbers() {
        let tick = |t: usize| {
            let s = t as f64 / 60.0;
            let values = vec![10.0 + 1.3 * s, 4.0 + s * s, 7.5];
            (values, vec![3])
        };
        let ticks: Vec<_> = (0..60).map(tick).collect();
        let numbers = round_trip(&ticks);
        for tick in numbers.chunks_exact(4).skip(4) {
            // A few units in the last place, and 0 for constant values.
            assert!(tick[0] < 32 && tick[1] < 64, "{tick:?}");
            assert_eq!(tick[2..], [0, 0]);
        }
    }
}
