//! Contact events from the solver's contact pairs.

use std::cmp::Ordering;

use rapier2d_f64::math::Vector;
use rapier2d_f64::prelude::{ContactPair, PhysicsWorld};

use crate::event::{EventKind, Other};
use crate::statics::{Block, Statics};

/// The begin or end of a contact.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ContactEvent {
    /// Tick of the event, counted from 0.
    pub tick: u64,
    /// Begin or end.
    pub kind: EventKind,
    /// The agent, the lower index of two.
    pub agent: u32,
    /// The other body. For solid cells: at a beginning, the cell with the firmest
    /// contact; at an end, the last of these.
    pub other: Other,
}

/// A contact ends at this gap, in metres, without force. Bodies that rest against each
/// other tremble by less.
const RELEASE_M: f64 = 1e-3;

// Collider tags: the kind in the bits from 64, in the order of `Other`, and an index
// below. Agents have kind 0, so that of two tags the lower one is an agent.
const KIND: u32 = 64;

/// The tag of a block of solid cells.
pub(super) fn cells(block: u32) -> u128 {
    1 << KIND | u128::from(block)
}

pub(super) fn obstacle(index: u32) -> u128 {
    2 << KIND | u128::from(index)
}

pub(super) fn mover(index: u32) -> u128 {
    3 << KIND | u128::from(index)
}

/// A contact: agent, kind and index of the other body (0 for the cells), and the cell if
/// there is one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Touch {
    agent: u32,
    kind: u8,
    other: u32,
    cell: u32,
}

impl Touch {
    /// Identity of the contact from tick to tick.
    fn key(self) -> (u32, u8, u32) {
        (self.agent, self.kind, self.other)
    }

    fn event(self, tick: u64, kind: EventKind) -> ContactEvent {
        let other = match self.kind {
            0 => Other::Agent(self.other),
            1 => Other::Obstacle { cell: self.cell },
            2 => Other::Polygon(self.other),
            _ => Other::Mover(self.other),
        };
        ContactEvent {
            tick,
            kind,
            agent: self.agent,
            other,
        }
    }
}

/// The contacts of the last tick, and the events not yet drained.
#[derive(Debug, Default)]
pub(super) struct Touches {
    now: Vec<Touch>,
    before: Vec<Touch>,
    found: Vec<Found>,
    pub(super) events: Vec<ContactEvent>,
}

/// Contact of two colliders as the solver reports it.
#[derive(Debug, Clone, Copy)]
struct Found {
    touch: Touch,
    /// In newton seconds.
    impulse: f64,
    gap_m: f64,
}

impl Touches {
    /// Compares the contacts after a tick with those of the tick before. `blocks` are the
    /// merged cells of `statics`, in the order of their tags.
    pub(super) fn update(
        &mut self,
        tick: u64,
        world: &PhysicsWorld,
        statics: Option<(&Statics, &[Block])>,
    ) {
        self.found.clear();
        for pair in world.narrow_phase.contact_pairs() {
            if let Some(found) = look_at(pair, world, statics) {
                self.found.push(found);
            }
        }
        // Of all colliders of one body, the firmest contact comes first.
        self.found.sort_unstable_by(|a, b| {
            let firmer = b.impulse.total_cmp(&a.impulse);
            let firmer = firmer.then(a.gap_m.total_cmp(&b.gap_m));
            a.touch
                .key()
                .cmp(&b.touch.key())
                .then(firmer)
                .then(a.touch.cell.cmp(&b.touch.cell))
        });
        std::mem::swap(&mut self.now, &mut self.before);
        self.now.clear();
        for found in &self.found {
            if self
                .now
                .last()
                .is_some_and(|last| last.key() == found.touch.key())
            {
                continue;
            }
            let pressed = found.impulse > 0.0 || found.gap_m < 0.0;
            let held = || {
                let key = found.touch.key();
                self.before
                    .binary_search_by_key(&key, |touch| touch.key())
                    .is_ok()
            };
            if pressed || (found.gap_m < RELEASE_M && held()) {
                self.now.push(found.touch);
            }
        }
        self.tell(tick);
    }

    /// Emits the difference of the two sorted lists as events.
    fn tell(&mut self, tick: u64) {
        let (mut before, mut now) = (self.before.iter().peekable(), self.now.iter().peekable());
        loop {
            let order = match (before.peek(), now.peek()) {
                (Some(old), Some(new)) => old.key().cmp(&new.key()),
                (Some(_), None) => Ordering::Less,
                (None, Some(_)) => Ordering::Greater,
                (None, None) => return,
            };
            let event = match order {
                Ordering::Less => before.next().map(|old| old.event(tick, EventKind::End)),
                Ordering::Greater => now.next().map(|new| new.event(tick, EventKind::Begin)),
                Ordering::Equal => {
                    before.next();
                    now.next();
                    None
                }
            };
            self.events.extend(event);
        }
    }
}

/// Gap and impulse of a pair of colliders, if the solver processed it.
fn look_at(
    pair: &ContactPair,
    world: &PhysicsWorld,
    statics: Option<(&Statics, &[Block])>,
) -> Option<Found> {
    let mut best: Option<(f64, f64, Vector)> = None;
    let tag = |handle| {
        world
            .colliders
            .get(handle)
            .map_or(u128::MAX, |collider| collider.user_data)
    };
    let mut tags = None;
    for manifold in pair.manifolds() {
        let data = &manifold.data;
        for contact in &data.solver_contacts {
            let [id] = contact.contact_id;
            let point = manifold.points.get((id & 0x7fff_ffff) as usize)?;
            let (one, two) =
                *tags.get_or_insert_with(|| (tag(pair.collider1), tag(pair.collider2)));
            let (at_one, at_two) = data.solver_contact_world_points(contact, &world.bodies);
            let gap_m = (at_two - at_one).dot(data.normal);
            let impulse = point.data.impulse;
            let firmer = best.is_none_or(|(most, least, _)| {
                impulse > most || (impulse >= most && gap_m < least)
            });
            if firmer {
                best = Some((impulse, gap_m, if one > two { at_one } else { at_two }));
            }
        }
    }
    let ((impulse, gap_m, at), (one, two)) = (best?, tags?);
    let (agent, other) = (one.min(two), one.max(two));
    if agent >> KIND != 0 {
        return None;
    }
    let (kind, index) = ((other >> KIND) as u8, other as u32);
    let touch = match (kind, statics) {
        (1, Some((statics, blocks))) => Touch {
            agent: agent as u32,
            kind,
            other: 0,
            cell: statics.cell_in_block(*blocks.get(index as usize)?, at.x, at.y),
        },
        _ => Touch {
            agent: agent as u32,
            kind,
            other: index,
            cell: 0,
        },
    };
    Some(Found {
        touch,
        impulse,
        gap_m,
    })
}
