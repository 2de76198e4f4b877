//! The contact tier: agents as bodies of a rapier world.
//!
//! Agents are balls on kinematic position-based bodies, solid cells are merged
//! into fixed cuboids, and contacts are rapier's collision events. rapier looks
//! for contacts at the start of a step, so what an event says holds at the start
//! of the span in which it is delivered: a contact is known at the end of the
//! substep in which it began, and one that begins and ends within a substep is
//! not seen. The nearest approach is the common closed form.

use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

use rapier2d_f64::prelude::{
    ActiveCollisionTypes, ActiveEvents, ColliderBuilder, ColliderHandle, ColliderSet,
    CollisionEvent, ContactPair, EventHandler, PhysicsWorld, Real, RigidBodyBuilder,
    RigidBodyHandle, RigidBodySet, SoftBodySet, SoftBodyTearEvent,
};

use crate::bodies::Bodies;
use crate::convert::vector;
use crate::error::SimError;
use crate::event::{Change, EventKind, Other};
use crate::kinematic::{Engine, Nearest, Scene, sweep_pairs};
use crate::statics::Statics;

/// Marks the colliders of the static world; agents carry their index.
const STATIC: u128 = u128::MAX;

/// The engine of the contact tier.
pub(crate) struct Physics {
    world: PhysicsWorld,
    handles: Vec<RigidBodyHandle>,
    seconds_per_substep: f64,
    /// How many static colliders an agent touches, where any.
    static_contacts: BTreeMap<u32, u32>,
    inbox: Inbox,
}

/// Collects the events of a step.
#[derive(Default)]
struct Inbox(Mutex<Vec<(bool, ColliderHandle, ColliderHandle)>>);

impl EventHandler for Inbox {
    fn handle_collision_event(
        &self,
        _: &RigidBodySet,
        _: &ColliderSet,
        event: CollisionEvent,
        _: Option<&ContactPair>,
    ) {
        let item = match event {
            CollisionEvent::Started(one, two, _) => (true, one, two),
            CollisionEvent::Stopped(one, two, _) => (false, one, two),
        };
        self.0
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .push(item);
    }

    fn handle_contact_force_event(
        &self,
        _: Real,
        _: &RigidBodySet,
        _: &ColliderSet,
        _: &ContactPair,
        _: Real,
    ) {
    }

    fn handle_soft_body_tear_event(&self, _: &SoftBodySet, _: &SoftBodyTearEvent) {}
}

impl Physics {
    /// A world with everything in place. `radius_m` is the distance at which an
    /// agent is in contact with an obstacle, and half of that between agents.
    pub(crate) fn new(
        statics: &Statics,
        bodies: &Bodies,
        radius_m: f64,
        seconds_per_substep: f64,
    ) -> Self {
        let mut world = PhysicsWorld::new();
        world.gravity = vector(0.0, 0.0);
        // Contacts are overlaps, found anew in every step: no prediction and no
        // reuse of contacts while bodies have hardly moved.
        world.integration_parameters.normalized_prediction_distance = 0.0;
        world.integration_parameters.contact_recycling = false;
        for block in statics.blocks() {
            let (x, y, half_x, half_y) = statics.block_m(block);
            let cuboid = ColliderBuilder::cuboid(half_x, half_y)
                .translation(vector(x, y))
                .user_data(STATIC)
                .build();
            world.colliders.insert(cuboid);
        }
        let types = ActiveCollisionTypes::default()
            | ActiveCollisionTypes::KINEMATIC_KINEMATIC
            | ActiveCollisionTypes::KINEMATIC_FIXED;
        let handles = bodies
            .x0
            .iter()
            .zip(&bodies.y0)
            .enumerate()
            .map(|(agent, (x, y))| {
                let body = RigidBodyBuilder::kinematic_position_based()
                    .translation(vector(*x, *y))
                    .lock_rotations()
                    .can_sleep(false);
                let ball = ColliderBuilder::ball(radius_m)
                    .user_data(agent as u128)
                    .active_collision_types(types)
                    .active_events(ActiveEvents::COLLISION_EVENTS);
                world.insert(body, ball).0
            })
            .collect();
        Self {
            world,
            handles,
            seconds_per_substep,
            static_contacts: BTreeMap::new(),
            inbox: Inbox::default(),
        }
    }

    fn step(
        &mut self,
        when: f64,
        substeps: f64,
        statics: &Statics,
        bodies: &Bodies,
        changes: &mut Vec<Change>,
    ) {
        self.world.integration_parameters.dt = substeps * self.seconds_per_substep;
        self.world.step_with_events(&(), &self.inbox);
        let mut events =
            std::mem::take(&mut *self.inbox.0.lock().unwrap_or_else(PoisonError::into_inner));
        // Ends first, so that an agent that slides from one block to the next
        // is seen to stay in contact only if it is.
        events.sort_by_key(|(begins, ..)| !*begins);
        let who = |handle: ColliderHandle| self.world.colliders.get(handle).map(|c| c.user_data);
        let mut touched: BTreeMap<u32, bool> = BTreeMap::new();
        for (begins, one, two) in events {
            let (Some(one), Some(two)) = (who(one), who(two)) else {
                continue;
            };
            // STATIC is the largest, so the first of the two is an agent.
            let (agent, other) = (one.min(two) as u32, one.max(two));
            if other != STATIC {
                let kind = if begins {
                    EventKind::Begin
                } else {
                    EventKind::End
                };
                changes.push(Change::new(when, kind, agent, Other::Agent(other as u32)));
                continue;
            }
            let count = self.static_contacts.entry(agent).or_insert(0);
            touched.entry(agent).or_insert(*count > 0);
            *count = if begins {
                *count + 1
            } else {
                count.saturating_sub(1)
            };
        }
        for (agent, before) in touched {
            let now = self.static_contacts.get(&agent).is_some_and(|n| *n > 0);
            if !now {
                self.static_contacts.remove(&agent);
            }
            let kind = match (before, now) {
                (false, true) => EventKind::Begin,
                (true, false) => EventKind::End,
                _ => continue,
            };
            let (x, y) = (bodies.x0[agent as usize], bodies.y0[agent as usize]);
            let cell = statics.nearest_solid(x, y).unwrap_or(u32::MAX);
            changes.push(Change::new(when, kind, agent, Other::Obstacle { cell }));
        }
    }
}

impl Engine for Physics {
    fn takes_long_spans(&self) -> bool {
        false
    }

    fn advance(
        &mut self,
        scene: &Scene<'_>,
        bodies: &mut Bodies,
        nearest: &mut Nearest,
        changes: &mut Vec<Change>,
    ) -> Result<(), SimError> {
        if scene.span.length() > 0.0 {
            for (at, handle) in self.handles.iter().enumerate() {
                if let Some(body) = self.world.bodies.get_mut(*handle) {
                    let target = vector(bodies.x1[at], bodies.y1[at]);
                    body.set_next_kinematic_translation(target);
                }
            }
            self.step(
                scene.span.start,
                scene.span.length(),
                scene.statics,
                bodies,
                changes,
            );
            for (at, handle) in self.handles.iter().enumerate() {
                if let Some(body) = self.world.bodies.get(*handle) {
                    let position = body.translation();
                    bodies.x1[at] = position.x;
                    bodies.y1[at] = position.y;
                }
            }
        }
        sweep_pairs(scene, bodies, None, nearest, changes);
        Ok(())
    }

    fn finish(&mut self, now: f64, statics: &Statics, bodies: &Bodies, changes: &mut Vec<Change>) {
        // Everyone stays; the step only looks for contacts where they are.
        self.step(now, 1.0, statics, bodies, changes);
    }
}
