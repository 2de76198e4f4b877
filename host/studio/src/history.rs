//! The history: the document as it was after each edit, back and forth.
//!
//! Snapshots share what edits between them left alone. The oldest are forgotten where there are too
//! many, or where what they do not share takes too much memory.

use std::collections::VecDeque;
use std::mem::{replace, size_of};
use std::sync::Arc;

use fleetyard_views::Agent;
use fleetyard_world::{Boundary, Polygon};

use crate::document::{Document, Ground};
use crate::edit::{Edit, Refusal};

/// Most steps that can be undone.
pub const MOST_STEPS: usize = 1000;

/// Most memory of what snapshots do not share, in bytes; but one step can be undone at least.
pub const MOST_BYTES: usize = 256 << 20;

/// A document with what it was and what it may become again.
#[derive(Debug, Clone)]
pub struct History {
    now: Document,
    version: u64,
    undo: VecDeque<Step>,
    redo: Vec<Step>,
    bytes: usize,
}

/// A document before or after an edit.
#[derive(Debug, Clone)]
struct Step {
    /// The name of the edit.
    name: String,
    document: Document,
    /// Bytes of its own, beside those of the document after it.
    bytes: usize,
}

impl History {
    /// A document without a past.
    pub fn new(document: Document) -> Self {
        Self {
            now: document,
            version: 0,
            undo: VecDeque::new(),
            redo: Vec::new(),
            bytes: 0,
        }
    }

    /// The document as it is. A copy is cheap, and stays as it is.
    pub fn document(&self) -> &Document {
        &self.now
    }

    /// Number of changes so far: of edits, steps back and steps forth.
    pub fn version(&self) -> u64 {
        self.version
    }

    /// The name of the edit that would be undone.
    pub fn undoable(&self) -> Option<&str> {
        self.undo.back().map(|step| step.name.as_str())
    }

    /// The name of the edit that would be made again.
    pub fn redoable(&self) -> Option<&str> {
        self.redo.last().map(|step| step.name.as_str())
    }

    /// Makes an edit, after which nothing can be made again. A refusal changes nothing.
    pub fn edit(&mut self, edit: &Edit) -> Result<(), Refusal> {
        let after = self.now.edited(edit)?;
        self.redo.clear();
        self.remember(edit.name().to_owned(), after);
        Ok(())
    }

    /// Goes back by one edit; false if there is none.
    pub fn undo(&mut self) -> bool {
        let Some(Step {
            name,
            document,
            bytes,
        }) = self.undo.pop_back()
        else {
            return false;
        };
        self.bytes -= bytes;
        let document = replace(&mut self.now, document);
        self.redo.push(Step {
            name,
            document,
            bytes: 0,
        });
        self.version += 1;
        true
    }

    /// Makes the edit again that was undone last; false if there is none.
    pub fn redo(&mut self) -> bool {
        let Some(step) = self.redo.pop() else {
            return false;
        };
        self.remember(step.name, step.document);
        true
    }

    /// Goes on to a document.
    fn remember(&mut self, name: String, after: Document) {
        let before = replace(&mut self.now, after);
        let bytes = unshared_bytes(&before, &self.now);
        self.bytes += bytes;
        self.undo.push_back(Step {
            name,
            document: before,
            bytes,
        });
        while self.undo.len() > MOST_STEPS || (self.bytes > MOST_BYTES && self.undo.len() > 1) {
            let oldest = self.undo.pop_front();
            self.bytes -= oldest.map_or(0, |step| step.bytes);
        }
        self.version += 1;
    }
}

/// Memory of a document that another one does not share, in bytes and roughly.
fn unshared_bytes(one: &Document, other: &Document) -> usize {
    let ground = match (&one.ground, &other.ground) {
        (Ground::World(a), Ground::World(b)) if Arc::ptr_eq(a, b) => 0,
        (Ground::Map { grid: a, .. }, Ground::Map { grid: b, .. }) if Arc::ptr_eq(a, b) => 0,
        (Ground::Map { grid, .. }, _) => grid.terrain().len(),
        (Ground::World(world), other) => {
            // Outlines are shared one by one, and are told apart by where they are kept.
            let kept = match other {
                Ground::World(other) => other.obstacles.as_slice(),
                Ground::Map { .. } => &[],
            };
            let key = |polygon: &Polygon| polygon.vertices().as_ptr();
            let kept: std::collections::BTreeSet<_> = kept.iter().map(key).collect();
            let own = world
                .obstacles
                .iter()
                .filter(|polygon| !kept.contains(&key(polygon)));
            // Corners, convex parts and their edges.
            let own = own.map(|polygon| 256 + 160 * polygon.vertices().len());
            // Moving obstacles and the edge have copies of their own, of which the shapes are most.
            let movers = world.movers.iter().map(|mover| {
                256 + 128 * mover.shape().vertices().len() + 32 * mover.times_s().len()
            });
            let edge = world.boundary.iter().flat_map(Boundary::outside);
            let edge = edge.map(|(_, shape)| 256 + 64 * shape.vertices().len());
            world.obstacles.len() * size_of::<Polygon>()
                + own.sum::<usize>()
                + movers.sum::<usize>()
                + edge.sum::<usize>()
        }
    };
    let agents = if Arc::ptr_eq(&one.agents, &other.agents) {
        0
    } else {
        one.agents.len() * size_of::<Agent>()
    };
    let robots = if Arc::ptr_eq(&one.robots, &other.robots) {
        0
    } else {
        2048 * one.robots.len()
    };
    size_of::<Step>() + ground + agents + robots
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use proptest::prelude::*;
    use serde_json::{Value, json};

    use super::*;

    /// The largest map of cells: each edit of it is a copy of 16 MiB, so that bytes and not steps are what bounds
    /// the history.
    fn largest() -> Document {
        let ground =
            json!({"map": {"rows": 4096, "cols": 4096, "cell_size_m": 1.0, "blocked": []}});
        let document = json!({"name": "large", "robots": {"robot": "agv"}, "ground": ground});
        let mut history = History::new(Document::default());
        let edit = Edit::read(json!({"op": "replace", "document": document})).unwrap();
        history.edit(&edit).unwrap();
        history.document().clone()
    }

    /// Bytes of all maps that a history holds, each counted once.
    fn held(history: &History) -> usize {
        let steps = history.undo.iter().chain(&history.redo);
        let all = steps.map(|step| &step.document).chain([&history.now]);
        let maps = all.filter_map(|document| match &document.ground {
            Ground::Map { grid, .. } => Some((Arc::as_ptr(grid), grid.terrain().len())),
            Ground::World(_) => None,
        });
        maps.collect::<BTreeMap<_, _>>().values().sum()
    }

    /// Steps back, forth, and edits that share much, little or nothing with what was before.
    fn operation() -> impl Strategy<Value = Value> {
        let paint = (0..1u32 << 24)
            .prop_map(|cell| json!({"op": "paint", "as": "blocked", "runs": [cell, 1]}));
        prop_oneof![
            6 => paint,
            1 => Just(json!({"op": "resize-map", "rows": 4096, "cols": 4095})),
            1 => Just(json!({"op": "resize-map", "rows": 4096, "cols": 4096})),
            1 => (0..100u64).prop_map(|seed| json!({"op": "set-seed", "seed": seed})),
            2 => Just(json!("undo")),
            1 => Just(json!("redo")),
        ]
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(6))]

        #[test]
        fn a_history_of_the_largest_maps_keeps_its_bound(
            operations in proptest::collection::vec(operation(), 40..60)
        ) {
            let mut history = History::new(largest());
            let one = 1 << 24;
            for operation in operations {
                match operation.as_str() {
                    Some("undo") => _ = history.undo(),
                    Some("redo") => _ = history.redo(),
                    _ => {
                        // A cell beyond a map that was cut is refused, and nothing is kept of it.
                        let _ = history.edit(&Edit::read(operation).unwrap());
                    }
                }
                let counted: usize = history.undo.iter().map(|step| step.bytes).sum();
                prop_assert_eq!(counted, history.bytes);
                prop_assert!(history.bytes <= MOST_BYTES || history.undo.len() == 1);
                // The document of now is beside the bound.
                prop_assert!(held(&history) <= MOST_BYTES + one, "{} bytes", held(&history));
            }
        }
    }

    /// Moving obstacles and the edge have copies of their own in each step.
    #[test]
    fn moving_obstacles_and_a_long_edge_are_counted() {
        let wheel = |count: u32, side: f64| {
            let at = |n: u32| f64::from(n) * std::f64::consts::TAU / f64::from(count);
            let corner = |n| [side + side * f64::cos(at(n)), side + side * f64::sin(at(n))];
            (0..count).map(corner).collect::<Vec<_>>()
        };
        let mover = json!({"footprint": {"polygon": {"vertices_m": wheel(64, 0.3)}}, "knots": [[0, 5, 5, 0]]});
        let movers = vec![mover; 100];
        let world = json!({"boundary_m": wheel(400, 5.0), "obstacles": [], "movers": movers});
        let document = json!({"name": "w", "robots": {"robot": {"footprint": {"disc": {"radius_m": 0.2}},
            "model": {"single-integrator": {"speed_m_per_s": 1.0}}}}, "ground": {"world": world}});
        let mut history = History::new(Document::default());
        let replace = Edit::read(json!({"op": "replace", "document": document})).unwrap();
        history.edit(&replace).unwrap();
        let before = history.bytes;
        let gone = Edit::read(json!({"op": "remove-movers", "indices": [0]})).unwrap();
        history.edit(&gone).unwrap();
        // Corners of the movers and their shapes, and triangles outside of the edge.
        assert!(
            history.bytes - before > 100 * 64 * 64 + 400 * 64,
            "{}",
            history.bytes - before
        );
    }
}
