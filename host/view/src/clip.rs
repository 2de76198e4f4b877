//! Clips: the poses of all bodies at equal intervals, as a server sends them to the viewer.
//!
//! # Encoding
//!
//! All numbers are little-endian. The header has 48 bytes: the magic number `0x31435946` ("FYC1"), bodies,
//! samples and flags (1: there are headings) as `u32`; the time of the first sample and the time between samples
//! in seconds, and the units of lengths in metres and of headings in radians, as `f64`. Then come, for
//! each sample, x of all bodies, y of all bodies, and headings of all bodies if there are any, each as the
//! difference from the sample before (from 0 in the first one), mapped to 0, -1, 1, -2, … → 0, 1, 2, 3, … and written
//! as LEB128. Headings are not wrapped. A clip needs no other clip to be read.

use fleetyard_sim::trace::States;

use crate::ViewError;
use crate::recording::Recording;
use crate::track::{Quanta, difference};

const MAGIC: u32 = u32::from_le_bytes(*b"FYC1");
const HEADINGS: u32 = 1;

/// The most bytes of a clip.
pub const MAX_CLIP_BYTES: usize = 64 << 20;

/// A clip in the making.
#[derive(Debug, Clone)]
pub struct Clip {
    quanta: Quanta,
    first_s: f64,
    sample_s: f64,
    samples: u32,
    /// Of each body its last x, y and heading, in quanta.
    last: [Vec<i64>; 3],
    /// Two if there are no headings.
    channels: usize,
    /// The samples so far.
    bytes: Vec<u8>,
}

impl Clip {
    /// A clip without samples of all bodies of a recording: `first_s` is the time of the first one that will be
    /// given, in seconds, and `sample_s` the time between two.
    pub fn new(recording: &Recording, first_s: f64, sample_s: f64) -> Self {
        let bodies = recording.outline_of_body.len();
        Self {
            quanta: Quanta::of(&recording.outlines),
            first_s,
            sample_s,
            samples: 0,
            last: [(); 3].map(|()| vec![0; bodies]),
            channels: if recording.headings { 3 } else { 2 },
            bytes: Vec::new(),
        }
    }

    /// Adds a sample. A body of which there is no pose, or no finite one, is at 0. Headings may be wrapped or
    /// not.
    ///
    /// # Errors
    ///
    /// Fails if the clip would have more than [`MAX_CLIP_BYTES`]; no more can be added then.
    pub fn push(&mut self, states: &States<'_>) -> Result<(), ViewError> {
        let of = |values: Option<&[f64]>, id: usize| {
            values
                .and_then(|values| values.get(id).copied())
                .unwrap_or(0.0)
        };
        let bodies = self.last[0].len();
        let values = [Some(states.x_m), Some(states.y_m), states.heading_rad];
        let before = self.bytes.len();
        let channels = self.last.iter_mut().zip(values).take(self.channels);
        for (channel, (last, values)) in channels.enumerate() {
            for (id, last) in last.iter_mut().enumerate() {
                let value = of(values, id);
                let now = match channel {
                    2 if self.samples > 0 => self.quanta.heading_near(value, *last),
                    2 => self.quanta.heading(value),
                    _ => self.quanta.length(value),
                };
                difference(&mut self.bytes, now - *last);
                *last = now;
            }
        }
        if self.bytes.len() > MAX_CLIP_BYTES - HEADER_BYTES {
            self.bytes.truncate(before);
            return Err(ViewError::new(
                format!(
                    "a clip of {bodies} bodies and {} samples is too large",
                    self.samples + 1
                ),
                "ask for a shorter time, or for fewer samples per second",
            ));
        }
        self.samples += 1;
        Ok(())
    }

    /// The number of samples so far.
    pub fn samples(&self) -> u32 {
        self.samples
    }

    /// The bytes of the clip.
    pub fn finish(self) -> Vec<u8> {
        let mut out = Vec::with_capacity(HEADER_BYTES + self.bytes.len());
        let flags = if self.channels == 3 { HEADINGS } else { 0 };
        for number in [MAGIC, self.last[0].len() as u32, self.samples, flags] {
            out.extend(number.to_le_bytes());
        }
        let Quanta {
            length_m,
            angle_rad,
        } = self.quanta;
        for number in [self.first_s, self.sample_s, length_m, angle_rad] {
            out.extend(number.to_le_bytes());
        }
        out.extend(self.bytes);
        out
    }
}

const HEADER_BYTES: usize = 48;
