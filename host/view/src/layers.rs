//! Annotations by layer: what a planner wants to show beside its plan.

use fleetyard_core::{Annotation, AnnotationFile};
use serde::Serialize;

use crate::palette::{HEAT, LAYERS};

/// The layers of a file in the order in which they appear there.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Layers {
    pub(crate) all: Vec<Layer>,
    /// Annotations that the host did not keep.
    left_out: u64,
}

/// A layer: its annotations are shown or hidden together.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Layer {
    pub(crate) name: String,
    pub(crate) color: &'static str,
    /// The least and the largest value, if shapes have values.
    pub(crate) range: Option<[f64; 2]>,
    pub(crate) annotations: Vec<Annotation>,
}

impl Layers {
    /// Those of a file.
    pub fn of(file: &AnnotationFile) -> Self {
        let mut all: Vec<Layer> = Vec::new();
        for annotation in &file.annotations {
            let at = all.iter().position(|layer| layer.name == annotation.layer);
            let at = at.unwrap_or_else(|| {
                all.push(Layer {
                    name: annotation.layer.clone(),
                    color: LAYERS[all.len() % LAYERS.len()],
                    range: None,
                    annotations: Vec::new(),
                });
                all.len() - 1
            });
            let layer = &mut all[at];
            for value in &annotation.values {
                let [least, most] = layer.range.unwrap_or([*value; 2]);
                layer.range = Some([least.min(*value), most.max(*value)]);
            }
            layer.annotations.push(annotation.clone());
        }
        Self {
            all,
            left_out: file.left_out,
        }
    }

    /// Those of annotations that hold at a time.
    #[must_use]
    pub fn at(mut self, time_s: f64) -> Self {
        let holds = |annotation: &Annotation| {
            annotation.from_s <= time_s && annotation.to_s.is_none_or(|to_s| time_s <= to_s)
        };
        for layer in &mut self.all {
            layer.annotations.retain(holds);
        }
        self
    }

    /// Those of annotations about some agents or about none.
    #[must_use]
    pub(crate) fn about(mut self, is_shown: impl Fn(u32) -> bool) -> Self {
        for layer in &mut self.all {
            layer
                .annotations
                .retain(|annotation| annotation.agent.is_none_or(&is_shown));
        }
        self
    }

    /// True if there is nothing to show.
    pub fn is_empty(&self) -> bool {
        self.all.is_empty()
    }

    /// A remark for readers about what is missing.
    pub(crate) fn note(&self) -> Option<String> {
        (self.left_out > 0).then(|| {
            format!(
                "{} annotations of the planner were more than are kept.",
                self.left_out
            )
        })
    }
}

impl Layer {
    /// The colour of a shape.
    pub(crate) fn color_of(&self, value: Option<f64>) -> &'static str {
        let (Some(value), Some([least, most])) = (value, self.range) else {
            return self.color;
        };
        let part = if most > least {
            (value / 2.0 - least / 2.0) / (most / 2.0 - least / 2.0)
        } else {
            1.0
        };
        // The lightest steps vanish on white.
        let steps = HEAT.len() - 3;
        HEAT[2 + ((part * steps as f64) as usize).min(steps)]
    }
}
