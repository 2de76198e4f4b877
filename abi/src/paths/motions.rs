//! Plans in the plane in JSON: per agent a list of knots, or an object with `knots` and `controls`.

use std::fmt;

use serde::de::{self, DeserializeSeed, Error as _, IgnoredAny, MapAccess, SeqAccess, Visitor};
use serde::ser::{SerializeMap, SerializeSeq};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::lists::Lists;
use crate::plan::{ControlPlan, Knot, KnotPlan, MotionPlan, MotionRef, Segment};

/// Serialises the motions of all agents.
pub(super) struct Write<'a>(pub(super) MotionRef<'a>);

impl Serialize for Write<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let MotionRef { knots, controls } = self.0;
        let mut list = serializer.serialize_seq(Some(knots.len()))?;
        for (agent, knots) in knots.iter().enumerate() {
            let controls = controls.filter(|plan| agent < plan.agents());
            let own = controls.map(|plan| plan.of(agent));
            match own.filter(|own| own.len() > 0 || knots.is_empty()) {
                None => list.serialize_element(knots)?,
                Some(segments) => list.serialize_element(&Controlled { knots, segments })?,
            }
        }
        list.end()
    }
}

struct Controlled<'a, I> {
    knots: &'a [Knot],
    segments: I,
}

impl<'a, I: Iterator<Item = Segment<'a>> + Clone> Serialize for Controlled<'_, I> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut object = serializer.serialize_map(None)?;
        if !self.knots.is_empty() {
            object.serialize_entry("knots", self.knots)?;
        }
        object.serialize_entry("controls", &Rows(self.segments.clone()))?;
        object.end()
    }
}

struct Rows<I>(I);

impl<'a, I: Iterator<Item = Segment<'a>> + Clone> Serialize for Rows<I> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.0.clone().map(Row))
    }
}

struct Row<'a>(Segment<'a>);

impl Serialize for Row<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let Segment {
            duration_s,
            control,
        } = self.0;
        serializer.collect_seq([duration_s].iter().chain(control))
    }
}

impl Serialize for ControlPlan {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq((0..self.agents()).map(|agent| Rows(self.of(agent))))
    }
}

/// From a list per agent of segments `[duration_s, number, …]`.
impl<'de> Deserialize<'de> for ControlPlan {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct All;

        impl<'de> Visitor<'de> for All {
            type Value = ControlPlan;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a list with the segments of each agent")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<ControlPlan, A::Error> {
                let mut plan = ControlPlan::default();
                let mut left = Left(usize::MAX);
                while seq
                    .next_element_seed(Segments(&mut plan, &mut left))?
                    .is_some()
                {
                    plan.end_agent();
                }
                Ok(plan)
            }
        }

        deserializer.deserialize_seq(All)
    }
}

/// Reads motions of at most so many knots and segments together.
pub(super) fn read(text: &str, most: usize) -> Result<MotionPlan, String> {
    let mut motions = Motions {
        knots: Lists::default(),
        controls: ControlPlan::default(),
        left: Left(most),
    };
    let mut deserializer = serde_json::Deserializer::from_str(text);
    let read = deserializer.deserialize_seq(Agents(&mut motions));
    read.and_then(|()| deserializer.end())
        .map_err(|error| error.to_string())?;
    // Both have a list for every agent.
    Ok(MotionPlan::new(motions.knots, motions.controls).unwrap_or_default())
}

/// The motions read so far.
struct Motions {
    knots: KnotPlan,
    controls: ControlPlan,
    left: Left,
}

/// Number of knots and segments that may still come.
struct Left(usize);

impl Left {
    fn count<E: de::Error>(&mut self, agent: usize) -> Result<(), E> {
        let too_long = || {
            E::custom(format_args!(
                "the plan is too long in the motion of agent {agent}"
            ))
        };
        self.0 = self.0.checked_sub(1).ok_or_else(too_long)?;
        Ok(())
    }
}

struct Agents<'a>(&'a mut Motions);

impl<'de> Visitor<'de> for Agents<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a list with a motion per agent")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<(), A::Error> {
        while seq.next_element_seed(Agent(&mut *self.0))?.is_some() {
            self.0.knots.end_list();
            self.0.controls.end_agent();
        }
        Ok(())
    }
}

/// Reads a list, whose items go elsewhere.
macro_rules! seed {
    ($name:ident, $how:ident) => {
        impl<'de> DeserializeSeed<'de> for $name<'_> {
            type Value = ();

            fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
                deserializer.$how(self)
            }
        }
    };
}

struct Agent<'a>(&'a mut Motions);

seed!(Agent, deserialize_any);

impl<'de> Visitor<'de> for Agent<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let agent = self.0.knots.len();
        write!(
            f,
            "the motion of agent {agent}: a list of knots, or an object with knots and controls"
        )
    }

    fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<(), A::Error> {
        Knots(&mut self.0.knots, &mut self.0.left).visit_seq(seq)
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<(), A::Error> {
        let Motions {
            knots,
            controls,
            left,
        } = self.0;
        let agent = knots.len();
        let wrong = |reason: fmt::Arguments<'_>| {
            A::Error::custom(format_args!("the motion of agent {agent} has {reason}"))
        };
        let (mut has_knots, mut has_controls) = (false, false);
        while let Some(key) = map.next_key::<String>()? {
            let twice = match key.as_str() {
                "knots" => {
                    if !has_knots {
                        map.next_value_seed(Knots(&mut *knots, &mut *left))?;
                    }
                    std::mem::replace(&mut has_knots, true)
                }
                "controls" => {
                    if !has_controls {
                        map.next_value_seed(Segments(&mut *controls, &mut *left))?;
                    }
                    std::mem::replace(&mut has_controls, true)
                }
                // A later version may have more to say.
                _ => {
                    map.next_value::<IgnoredAny>()?;
                    false
                }
            };
            if twice {
                return Err(wrong(format_args!("`{key}` twice")));
            }
        }
        if has_knots || has_controls {
            return Ok(());
        }
        Err(wrong(format_args!("neither knots nor controls")))
    }
}

struct Knots<'a>(&'a mut KnotPlan, &'a mut Left);

seed!(Knots, deserialize_seq);

impl<'de> Visitor<'de> for Knots<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the knots of agent {}", self.0.len())
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<(), A::Error> {
        while let Some(knot) = seq.next_element()? {
            self.1.count(self.0.len())?;
            self.0.push_item(knot);
        }
        Ok(())
    }
}

struct Segments<'a>(&'a mut ControlPlan, &'a mut Left);

seed!(Segments, deserialize_seq);

impl<'de> Visitor<'de> for Segments<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the segments of agent {}", self.0.agents())
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<(), A::Error> {
        let agent = self.0.agents();
        let mut numbers = Vec::new();
        while seq
            .next_element_seed(Numbers(&mut numbers, agent))?
            .is_some()
        {
            self.1.count(agent)?;
            if let Some((duration_s, control)) = numbers.split_first() {
                let pushed = self.0.push(*duration_s, control);
                pushed.map_err(A::Error::custom)?;
            }
        }
        Ok(())
    }
}

/// The numbers of a segment, and its agent.
struct Numbers<'a>(&'a mut Vec<f64>, usize);

seed!(Numbers, deserialize_seq);

impl<'de> Visitor<'de> for Numbers<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let agent = self.1;
        write!(f, "a segment [duration_s, number, …] of agent {agent}")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<(), A::Error> {
        self.0.clear();
        while let Some(number) = seq.next_element()? {
            self.0.push(number);
            if self.0.len() > ControlPlan::MOST_NUMBERS + 1 {
                return Err(A::Error::invalid_length(self.0.len(), &self));
            }
        }
        if self.0.is_empty() {
            return Err(A::Error::invalid_length(0, &self));
        }
        Ok(())
    }
}
