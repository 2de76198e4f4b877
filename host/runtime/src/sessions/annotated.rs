//! Annotations of a call, within bounds.

use std::collections::BTreeSet;

use fleetyard_abi::Annotation;

use crate::sessions::bounds::{
    ANNOTATION_LAYERS, ANNOTATION_POINTS, ANNOTATION_TEXT_BYTES, ANNOTATIONS,
};

/// The annotations of a planner in its order, as many as are kept.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Annotated {
    kept: Vec<Annotation>,
    left_out: u64,
    layers: BTreeSet<String>,
    /// Points, places and shapes.
    points: usize,
    text_bytes: usize,
}

impl Annotated {
    /// Keeps an annotation that is in order, if there is room for it.
    pub(crate) fn keep(&mut self, annotation: &Annotation) -> bool {
        let points = self.points + annotation.size() + annotation.shapes();
        let text_bytes = self.text_bytes + annotation.text_bytes();
        let is_known = self.layers.contains(&annotation.layer);
        let fits = self.kept.len() < ANNOTATIONS
            && points <= ANNOTATION_POINTS
            && text_bytes <= ANNOTATION_TEXT_BYTES
            && (is_known || self.layers.len() < ANNOTATION_LAYERS);
        if !fits {
            self.leave_out();
            return false;
        }
        if !is_known {
            self.layers.insert(annotation.layer.clone());
        }
        (self.points, self.text_bytes) = (points, text_bytes);
        self.kept.push(annotation.clone());
        true
    }

    /// Counts an annotation that is not kept.
    pub(crate) fn leave_out(&mut self) {
        self.left_out += 1;
    }

    /// The annotations that are kept.
    pub fn kept(&self) -> &[Annotation] {
        &self.kept
    }

    /// Number of annotations for which there was no room, or that came after the deadline.
    pub fn left_out(&self) -> u64 {
        self.left_out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn places(layer: &str, count: u32) -> Annotation {
        Annotation::places(layer, (0..count).map(|place| [place]))
    }

    #[test]
    fn the_excess_is_counted() {
        let mut annotated = Annotated::default();
        for number in 0..ANNOTATIONS + 3 {
            assert_eq!(annotated.keep(&places("a", 1)), number < ANNOTATIONS);
        }
        assert_eq!(
            (annotated.kept().len(), annotated.left_out()),
            (ANNOTATIONS, 3)
        );
    }

    #[test]
    fn layers_points_and_text_are_bounded() {
        let mut annotated = Annotated::default();
        for number in 0..=ANNOTATION_LAYERS {
            let kept = annotated.keep(&places(&number.to_string(), 1));
            assert_eq!(kept, number < ANNOTATION_LAYERS);
        }
        // A layer that is there already may have more.
        assert!(annotated.keep(&places("0", 1)));
        let large = places("0", 1 << 15);
        let fit = ANNOTATION_POINTS / (large.size() + large.shapes());
        let kept = (0..2 * fit).filter(|_| annotated.keep(&large)).count();
        assert!(kept < fit && kept + 1 >= fit, "{kept} of {fit}");
        let mut annotated = Annotated::default();
        let told = Annotation {
            text: "x".repeat(1 << 10),
            ..places("a", 0)
        };
        let kept = (0..2048).filter(|_| annotated.keep(&told)).count();
        assert_eq!(kept, ANNOTATION_TEXT_BYTES / told.text_bytes());
    }
}
