//! Content digests: 128-bit XXH3 over a canonical little-endian byte stream.
//!
//! Digests identify inputs and outputs across machines and releases; they are
//! not a defence against someone who wants a collision.

use std::fmt;
use std::io::{self, BufReader, Read};

use fleetyard_abi::GridPlan;
use serde::{Deserialize, Serialize};
use xxhash_rust::xxh3::Xxh3;

/// A 128-bit content digest, printed and serialised as 32 hexadecimal digits.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Digest(pub u128);

impl Digest {
    /// Digest of a plan's paths without the waits at their ends.
    pub fn of_plan(plan: &GridPlan) -> Self {
        let plan = plan.trimmed();
        let mut hasher = Hasher::new("fleetyard.grid-plan/1");
        hasher.u64(plan.agents() as u64);
        for path in plan.paths() {
            hasher.u32s(path);
        }
        hasher.finish()
    }
}

impl fmt::Display for Digest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:032x}", self.0)
    }
}

impl fmt::Debug for Digest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

impl Serialize for Digest {
    fn serialize<S: serde::Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
        s.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for Digest {
    fn deserialize<D: serde::Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        let text = std::borrow::Cow::<'de, str>::deserialize(d)?;
        if text.len() != 32 {
            return Err(serde::de::Error::custom(
                "a digest has 32 hexadecimal digits",
            ));
        }
        u128::from_str_radix(&text, 16)
            .map(Digest)
            .map_err(serde::de::Error::custom)
    }
}

/// Bytes that are read at a time.
const PART: usize = 1 << 17;

/// Feeds values into a [`Digest`] in a fixed, length-prefixed encoding.
#[derive(Default)]
pub struct Hasher(Xxh3);

impl Hasher {
    /// A hasher whose stream begins with `domain`, so that equal bytes of
    /// different kinds of object never share a digest.
    pub fn new(domain: &str) -> Self {
        let mut hasher = Self::default();
        hasher.bytes(domain.as_bytes());
        hasher
    }

    /// A byte string, length first.
    pub fn bytes(&mut self, bytes: &[u8]) {
        self.u64(bytes.len() as u64);
        self.0.update(bytes);
    }

    /// The same of a byte string of a known length that is read, part by part: it may be large.
    ///
    /// # Errors
    ///
    /// It cannot be read, or has another length.
    pub fn bytes_of(&mut self, source: impl Read, length: u64) -> io::Result<()> {
        self.u64(length);
        let source = source.take(length.saturating_add(1));
        let read = io::copy(&mut BufReader::with_capacity(PART, source), &mut self.0)?;
        if read == length {
            return Ok(());
        }
        Err(io::Error::new(
            io::ErrorKind::InvalidData,
            "it changes while it is read",
        ))
    }

    /// One unsigned integer.
    pub fn u64(&mut self, value: u64) {
        self.0.update(&value.to_le_bytes());
    }

    /// A list of unsigned integers, length first.
    pub fn u32s(&mut self, values: &[u32]) {
        self.u64(values.len() as u64);
        for chunk in values.chunks(256) {
            let mut buffer = [0u8; 1024];
            for (slot, value) in buffer.chunks_exact_mut(4).zip(chunk) {
                slot.copy_from_slice(&value.to_le_bytes());
            }
            self.0.update(&buffer[..chunk.len() * 4]);
        }
    }

    /// The bit pattern of a float.
    pub fn f64(&mut self, value: f64) {
        self.u64(value.to_bits());
    }

    /// A value as files have it: its JSON, numbers to the last bit. The names of the code are no
    /// part of that, and those of fields are what stored files hold.
    pub fn value(&mut self, value: &impl Serialize) {
        match serde_json::to_vec(value) {
            Ok(json) => self.bytes(&json),
            // Only maps fail, by keys that are no texts, and there are none.
            Err(error) => {
                debug_assert!(false, "{error}");
                self.bytes(error.to_string().as_bytes());
            }
        }
    }

    /// The digest of everything fed so far.
    pub fn finish(&self) -> Digest {
        Digest(self.0.digest128())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_that_are_read_count_as_they_do_at_once() {
        for length in [0, 1, PART - 1, PART, 3 * PART + 7] {
            let bytes: Vec<u8> = (0..length).map(|at| (at % 251) as u8).collect();
            let mut whole = Hasher::new("a file");
            whole.bytes(&bytes);
            let mut parts = Hasher::new("a file");
            // A reader that gives less than it is asked for.
            let (first, rest) = bytes.split_at(length / 3);
            parts.bytes_of(first.chain(rest), length as u64).unwrap();
            assert_eq!(parts.finish(), whole.finish(), "{length}");
            for other in [length.wrapping_sub(1), length + 1] {
                let known = Hasher::new("a file").bytes_of(&bytes[..], other as u64);
                assert!(known.is_err(), "{other} in place of {length}");
            }
        }
    }
}
