//! Annotations: what a planner wants to show of its search, beside its plan.
//!
//! They are shown and never judged: a plan is the same with and without them. A host asks for them
//! only when somebody wants to see them ([`Sink::annotations`](crate::sdk::Sink::annotations)).
//!
//! ```
//! use fleetyard_abi::Annotation;
//!
//! let conflict = Annotation {
//!     agent: Some(3),
//!     from_s: 4.0,
//!     to_s: Some(5.0),
//!     text: "not here".into(),
//!     ..Annotation::places("constraints", [[17]])
//! };
//! assert_eq!(conflict.check(8, 64), Ok(()));
//! let outside = conflict.check(8, 16).unwrap_err();
//! assert_eq!(outside, "an annotation of the layer `constraints`: shape 0 has place 17, but there are 16");
//! ```

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::c;
use crate::lists::Lists;

/// Most shapes of an annotation, and most points or places of them together: larger ones would not
/// fit into a message.
pub const MOST_POINTS: usize = 1 << 15;
/// Most bytes of the name of a layer.
pub const MOST_LAYER_BYTES: usize = 64;
/// Most bytes of the text of an annotation.
pub const MOST_TEXT_BYTES: usize = 1 << 10;

/// Something to show: shapes of a layer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(rename = "Annotation")]
pub struct Annotation {
    /// Name of the layer, such as `constraints` or `tree`: what is shown or hidden together.
    pub layer: String,
    /// The kind of its shapes.
    pub shape: Shape,
    /// The agent that it is about; absent where it is about none or several.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub agent: Option<u32>,
    /// When it begins to hold, in seconds of the plan.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub from_s: f64,
    /// When it ends; absent where it does not.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub to_s: Option<f64>,
    /// For people.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub text: String,
    /// Points `[x, y]` of each shape; left out for places.
    #[serde(default, skip_serializing_if = "Lists::is_empty")]
    #[schemars(with = "Vec<Vec<[f64; 2]>>")]
    pub xy_m: Lists<[f64; 2]>,
    /// Cells or vertices of each shape; left out but for places.
    #[serde(default, skip_serializing_if = "Lists::is_empty")]
    #[schemars(with = "Vec<Vec<u32>>")]
    pub places: Lists<u32>,
    /// A number for each shape, for colours; may be left out.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub values: Vec<f64>,
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "as serde asks")]
fn is_zero(seconds: &f64) -> bool {
    *seconds == 0.0
}

/// The kind of an annotation's shapes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Shape {
    /// Points in the plane.
    Points,
    /// Lines from point to point.
    Lines,
    /// Lines from point to point, and back to the first.
    Rings,
    /// Places, and lines from place to place.
    Places,
}

impl Shape {
    /// The shape's constant of the C ABI.
    pub fn code(self) -> i32 {
        match self {
            Self::Points => c::SHAPE_POINTS,
            Self::Lines => c::SHAPE_LINES,
            Self::Rings => c::SHAPE_RINGS,
            Self::Places => c::SHAPE_PLACES,
        }
    }

    /// The shape with this constant of the C ABI.
    pub fn from_code(code: i32) -> Option<Self> {
        [Self::Points, Self::Lines, Self::Rings, Self::Places]
            .into_iter()
            .find(|shape| shape.code() == code)
    }
}

impl Annotation {
    fn new(layer: &str, shape: Shape) -> Self {
        Self {
            layer: layer.to_owned(),
            shape,
            agent: None,
            from_s: 0.0,
            to_s: None,
            text: String::new(),
            xy_m: Lists::default(),
            places: Lists::default(),
            values: Vec::new(),
        }
    }

    /// Points in the plane, each a shape.
    pub fn points(layer: &str, points: impl IntoIterator<Item = [f64; 2]>) -> Self {
        Self {
            xy_m: Lists::single(points.into_iter().collect()),
            ..Self::new(layer, Shape::Points)
        }
    }

    /// Lines from point to point.
    pub fn lines<L: IntoIterator<Item = [f64; 2]>>(
        layer: &str,
        lines: impl IntoIterator<Item = L>,
    ) -> Self {
        Self {
            xy_m: lines.into_iter().collect(),
            ..Self::new(layer, Shape::Lines)
        }
    }

    /// Lines from point to point that end where they begin.
    pub fn rings<L: IntoIterator<Item = [f64; 2]>>(
        layer: &str,
        rings: impl IntoIterator<Item = L>,
    ) -> Self {
        Self {
            shape: Shape::Rings,
            ..Self::lines(layer, rings)
        }
    }

    /// Places, alone or from one to the next.
    pub fn places<L: IntoIterator<Item = u32>>(
        layer: &str,
        shapes: impl IntoIterator<Item = L>,
    ) -> Self {
        Self {
            places: shapes.into_iter().collect(),
            ..Self::new(layer, Shape::Places)
        }
    }

    /// Number of shapes.
    pub fn shapes(&self) -> usize {
        self.xy_m.len().max(self.places.len())
    }

    /// Number of points and places.
    pub fn size(&self) -> usize {
        self.xy_m.items().len() + self.places.items().len()
    }

    /// Bytes of its texts.
    pub fn text_bytes(&self) -> usize {
        self.layer.len() + self.text.len()
    }

    /// Checks it against a call for so many agents on a map of so many places, none in the plane.
    /// Gives the reason why it is malformed otherwise.
    pub fn check(&self, agents: usize, places: usize) -> Result<(), String> {
        self.fault(agents, places).map_or(Ok(()), |fault| {
            let layer: String = self.layer.chars().take(MOST_LAYER_BYTES).collect();
            let layer = layer.escape_debug();
            Err(format!("an annotation of the layer `{layer}`: {fault}"))
        })
    }

    fn fault(&self, agents: usize, places: usize) -> Option<String> {
        let bytes = self.layer.len();
        if bytes == 0 || bytes > MOST_LAYER_BYTES || self.layer.contains(char::is_control) {
            return Some(format!(
                "its name must be 1 to {MOST_LAYER_BYTES} bytes without control characters"
            ));
        }
        if self.text.len() > MOST_TEXT_BYTES {
            let bytes = self.text.len();
            return Some(format!(
                "its text has {bytes} bytes, at most {MOST_TEXT_BYTES} may be"
            ));
        }
        if let Some(agent) = self.agent.filter(|agent| *agent as usize >= agents) {
            return Some(format!("it is about agent {agent}, but there are {agents}"));
        }
        let ends_s = self.to_s.unwrap_or(self.from_s);
        if !(self.from_s >= 0.0 && ends_s >= self.from_s && ends_s.is_finite()) {
            let (from_s, to_s) = (self.from_s, self.to_s.unwrap_or(f64::INFINITY));
            return Some(format!(
                "it holds from {from_s} s to {to_s} s, which is no span of time from 0 on"
            ));
        }
        let is_places = self.shape == Shape::Places;
        if is_places && !self.xy_m.is_empty() || !is_places && !self.places.is_empty() {
            return Some(format!(
                "its shapes are {}",
                if is_places {
                    "places, but it has `xy_m`"
                } else {
                    "no places, but it has `places`"
                }
            ));
        }
        let most = self.shapes().max(self.size());
        if most > MOST_POINTS {
            return Some(format!(
                "it has {most} points, places or shapes, at most {MOST_POINTS} may be"
            ));
        }
        for (shape, points) in self.xy_m.iter().enumerate() {
            if let Some([x, y]) = points
                .iter()
                .find(|point| !point.iter().all(|value| value.is_finite()))
            {
                return Some(format!(
                    "shape {shape} has the point ({x}, {y}), which is not finite"
                ));
            }
        }
        for (shape, of) in self.places.iter().enumerate() {
            if let Some(place) = of.iter().find(|place| **place as usize >= places) {
                return Some(format!(
                    "shape {shape} has place {place}, but there are {places}"
                ));
            }
        }
        let (values, shapes) = (self.values.len(), self.shapes());
        if values != 0 && values != shapes {
            return Some(format!("it has {values} values for {shapes} shapes"));
        }
        let not_finite = |value: &f64| !value.is_finite();
        let at = self.values.iter().position(not_finite)?;
        Some(format!(
            "value {at} is {}, which is not finite",
            self.values[at]
        ))
    }
}
