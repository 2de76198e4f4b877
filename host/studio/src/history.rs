//! The history: the document as it was after each edit, back and forth.
//!
//! Snapshots share what edits between them left alone. The oldest are forgotten where there are too
//! many, or where what they do not share takes too much memory.

use std::collections::VecDeque;
use std::mem::{replace, size_of};
use std::sync::Arc;

use fleetyard_views::Agent;
use fleetyard_world::Polygon;

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
            let knots = world
                .movers
                .iter()
                .map(|mover| 256 + 32 * mover.times_s().len());
            world.obstacles.len() * size_of::<Polygon>() + own.sum::<usize>() + knots.sum::<usize>()
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
        1024 * one.robots.len()
    };
    size_of::<Step>() + ground + agents + robots
}
