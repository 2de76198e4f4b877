//! The kinematic tier: bodies go where they are told, contacts come from
//! closed-form swept tests over candidate pairs and over the bitmap of solid
//! cells. Nothing is sampled.

use fleetyard_world::Relative;

use crate::bodies::{Bodies, Span};
use crate::error::SimError;
use crate::event::{Change, EventKind, Other};
use crate::statics::Statics;

/// What an engine sees of one span.
pub(crate) struct Scene<'a> {
    pub(crate) span: Span,
    pub(crate) statics: &'a Statics,
    /// Candidate pairs; all pairs that can come into contact are among them.
    pub(crate) pairs: &'a [(u32, u32)],
    /// Agents that may meet solid cells; all others provably do not.
    pub(crate) suspects: &'a [u32],
    /// This is the moment of the start: what overlaps now begins now.
    pub(crate) first: bool,
}

/// One way of moving bodies and finding contacts: the seam between the tiers.
///
/// An engine is told where bodies should be at the end of a span and may put
/// them elsewhere; everything else (reference, tracking, nearest approach,
/// order of events, digest, trace) is common to all engines.
pub(crate) trait Engine {
    /// Whether spans may be longer than a substep. If so, the engine puts every
    /// body exactly where it should be.
    fn takes_long_spans(&self) -> bool;

    /// Moves the bodies through a span: on entry `x1`, `y1` are where they
    /// should be at its end, on return where they are. Reports what begins and
    /// ends to touch, in any order.
    fn advance(
        &mut self,
        scene: &Scene<'_>,
        bodies: &mut Bodies,
        nearest: &mut Nearest,
        changes: &mut Vec<Change>,
    ) -> Result<(), SimError>;

    /// Reports what is still unsaid when the execution ends at `now`.
    fn finish(&mut self, now: f64, statics: &Statics, bodies: &Bodies, changes: &mut Vec<Change>);
}

/// The nearest approach of every agent to any other, between centres.
#[derive(Debug)]
pub(crate) struct Nearest {
    range_squared: f64,
    pub(crate) squared: Vec<f64>,
    pub(crate) when: Vec<f64>,
    pub(crate) other: Vec<u32>,
}

impl Nearest {
    pub(crate) fn new(agents: usize, range_m: f64) -> Self {
        // Distances on grids are whole numbers of cells more often than not: the
        // range includes its end, whatever the rounding.
        let range_m = range_m * (1.0 + 1e-9);
        Self {
            range_squared: range_m * range_m,
            squared: vec![f64::INFINITY; agents],
            when: vec![0.0; agents],
            other: vec![u32::MAX; agents],
        }
    }

    /// Takes note of an approach. The result does not depend on the order of
    /// calls: ties go to the earlier time, then to the lower index.
    fn note(&mut self, agent: u32, other: u32, squared: f64, when: f64) {
        let at = agent as usize;
        if squared > self.squared[at] {
            return;
        }
        let better = squared < self.squared[at]
            || when < self.when[at]
            || (when <= self.when[at] && other < self.other[at]);
        if better {
            self.squared[at] = squared;
            self.when[at] = when;
            self.other[at] = other;
        }
    }
}

/// Sweeps all candidate pairs through a span: nearest approaches, and contacts
/// below `contact_m` if one is given.
pub(crate) fn sweep_pairs(
    scene: &Scene<'_>,
    bodies: &Bodies,
    contact_m: Option<f64>,
    nearest: &mut Nearest,
    changes: &mut Vec<Change>,
) {
    let limit = contact_m.map_or(f64::NEG_INFINITY, |distance| distance * distance);
    for (i, j) in scene.pairs.iter().copied() {
        let (a, b) = (i as usize, j as usize);
        let way = Relative {
            x0: bodies.x0[b] - bodies.x0[a],
            y0: bodies.y0[b] - bodies.y0[a],
            x1: bodies.x1[b] - bodies.x1[a],
            y1: bodies.y1[b] - bodies.y1[a],
        };
        let (squared, fraction) = way.closest();
        if squared <= nearest.range_squared {
            let when = scene.span.at(fraction);
            nearest.note(i, j, squared, when);
            nearest.note(j, i, squared, when);
        }
        if squared >= limit {
            continue;
        }
        let Some(inside) = contact_m.and_then(|distance| way.inside_disc(distance, squared)) else {
            continue;
        };
        if scene.first || !inside.at_start {
            let when = scene.span.at(inside.enter);
            changes.push(Change::new(when, EventKind::Begin, i, Other::Agent(j)));
        }
        if !inside.at_end {
            let when = scene.span.at(inside.leave);
            changes.push(Change::new(when, EventKind::End, i, Other::Agent(j)));
        }
    }
}

/// The engine of the kinematic tier. It has no memory: whether a pair is in
/// contact at the start of a span follows from where it is.
#[derive(Debug)]
pub(crate) struct Kinematic {
    /// Agents are in contact below this distance between centres.
    pub(crate) agent_contact_m: f64,
    /// An agent is in contact with a solid cell below this distance.
    pub(crate) static_contact_m: f64,
}

impl Engine for Kinematic {
    fn takes_long_spans(&self) -> bool {
        true
    }

    fn advance(
        &mut self,
        scene: &Scene<'_>,
        bodies: &mut Bodies,
        nearest: &mut Nearest,
        changes: &mut Vec<Change>,
    ) -> Result<(), SimError> {
        sweep_pairs(scene, bodies, Some(self.agent_contact_m), nearest, changes);
        for agent in scene.suspects.iter().copied() {
            let radius = self.static_contact_m;
            scene
                .statics
                .sweep(agent, bodies, scene.span, scene.first, radius, changes);
        }
        Ok(())
    }

    fn finish(&mut self, _: f64, _: &Statics, _: &Bodies, _: &mut Vec<Change>) {}
}
