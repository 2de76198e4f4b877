//! Words of enums: in files, in records and on the command line.
//!
//! An enum of which users name the values declares their words once, with [`words!`](crate::words!) in
//! the crate that owns it. Its name, its `Display` and its serde form follow, and so do the values and
//! the help that the command line shows.

use fleetyard_abi::{Kind, Motion, PathEncoding};
use serde::de::Error;
use serde::{Deserialize, Deserializer};

/// An enum whose values have words.
pub trait Words: Copy + Eq + 'static {
    /// Every value, in the order in which help lists them.
    const ALL: &'static [Self];

    /// The word of a value.
    fn name(self) -> &'static str;

    /// A line about a value, for help; empty if its word says enough.
    fn help(self) -> &'static str;

    /// The value of a word.
    fn from_name(name: &str) -> Option<Self> {
        let mut all = Self::ALL.iter().copied();
        all.find(|value| value.name() == name)
    }

    /// Reads a word; `names` are those of [`Words::ALL`].
    fn deserialize_word<'de, D: Deserializer<'de>>(
        deserializer: D,
        names: &'static [&'static str],
    ) -> Result<Self, D::Error> {
        let name = String::deserialize(deserializer)?;
        Self::from_name(&name).ok_or_else(|| Error::unknown_variant(&name, names))
    }
}

/// Declares the words of an enum's values, each with a line of help if users give it, and implements
/// [`Words`], `Display`, `Serialize` and `Deserialize` by them.
///
/// ```
/// # use fleetyard_core::words;
/// #[derive(Debug, Clone, Copy, PartialEq, Eq)]
/// enum Gait {
///     Walk,
///     Trot,
/// }
///
/// words!(Gait {
///     Walk = "walk", "Three feet on the ground";
///     Trot = "trot", "Diagonal pairs of feet";
/// });
///
/// assert_eq!(Gait::Trot.to_string(), "trot");
/// ```
#[macro_export]
macro_rules! words {
    ($type:ident { $($variant:ident = $name:literal $(, $help:literal)?;)+ }) => {
        impl $type {
            /// Its word in files, in records and on the command line.
            #[allow(unreachable_pub, reason = "it is as visible as its type")]
            pub const fn name(self) -> &'static str {
                match self { $(Self::$variant => $name),+ }
            }
        }

        impl $crate::Words for $type {
            const ALL: &'static [Self] = &[$(Self::$variant),+];

            fn name(self) -> &'static str {
                Self::name(self)
            }

            fn help(self) -> &'static str {
                match self { $(Self::$variant => concat!($($help)?)),+ }
            }
        }

        impl ::std::fmt::Display for $type {
            fn fmt(&self, f: &mut ::std::fmt::Formatter<'_>) -> ::std::fmt::Result {
                f.pad(self.name())
            }
        }

        impl ::serde::Serialize for $type {
            fn serialize<S: ::serde::Serializer>(&self, serializer: S) -> ::core::result::Result<S::Ok, S::Error> {
                serializer.serialize_str(self.name())
            }
        }

        impl<'de> ::serde::Deserialize<'de> for $type {
            fn deserialize<D: ::serde::Deserializer<'de>>(deserializer: D) -> ::core::result::Result<Self, D::Error> {
                <Self as $crate::Words>::deserialize_word(deserializer, &[$($name),+])
            }
        }
    };
}

// The contract owns these words; what they mean on a command line is the host's to say.

impl Words for Kind {
    const ALL: &'static [Self] = &Kind::ALL;

    fn name(self) -> &'static str {
        self.as_str()
    }

    fn help(self) -> &'static str {
        ""
    }
}

impl Words for PathEncoding {
    const ALL: &'static [Self] = &PathEncoding::ALL;

    fn name(self) -> &'static str {
        PathEncoding::name(self)
    }

    fn help(self) -> &'static str {
        match self {
            Self::Pairs => "`[[row, col], …]`",
            Self::Cells => "Cell indices, `row * cols + col`",
            Self::Moves => "A start and a letter per move",
        }
    }
}

impl Words for Motion {
    const ALL: &'static [Self] = Motion::ALL;

    fn name(self) -> &'static str {
        self.as_str()
    }

    fn help(self) -> &'static str {
        match self {
            Self::Pebble => "A step takes a robot to an adjacent cell, whatever its heading",
            Self::Rotation => "Turning by 90° takes a step too",
            Self::AnyAngle => "In straight lines between any two cells",
            Self::StopGo => "On a roadmap, at full speed along an edge or standing on a vertex",
            Self::Slower => "On a roadmap, at any even speed along an edge or standing on a vertex",
            Self::Dynamics => "In the plane, as the robot's model says",
        }
    }
}

#[cfg(test)]
mod tests {
    use std::fmt::Debug;

    use serde::Serialize;
    use serde::de::DeserializeOwned;
    use serde_json::json;

    use super::*;

    fn one_word_each<T: Words + Debug + Serialize + DeserializeOwned>() {
        for value in T::ALL {
            let name = value.name();
            assert_eq!(T::from_name(name), Some(*value));
            assert_eq!(json!(value), json!(name));
            assert_eq!(serde_json::from_value::<T>(json!(name)).unwrap(), *value);
        }
        assert_eq!(T::from_name(""), None);
        serde_json::from_value::<T>(json!("")).unwrap_err();
    }

    #[test]
    fn words_of_the_contract_are_those_of_the_wire() {
        one_word_each::<Kind>();
        one_word_each::<Motion>();
        one_word_each::<PathEncoding>();
    }

    #[test]
    fn an_unknown_word_is_answered_with_the_known_ones() {
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        enum Gait {
            Walk,
            Trot,
        }
        words!(Gait {
            Walk = "walk", "Three feet on the ground";
            Trot = "trot", "Diagonal pairs of feet";
        });
        one_word_each::<Gait>();
        let error = serde_json::from_value::<Gait>(json!("run")).unwrap_err();
        assert_eq!(
            error.to_string(),
            "unknown variant `run`, expected `walk` or `trot`"
        );
        assert_eq!(format!("{:>5}", Gait::Walk), " walk");
    }
}
