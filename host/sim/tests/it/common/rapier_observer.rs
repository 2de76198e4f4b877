//! rapier as somebody else's opinion: bodies go where they are put, and its own
//! pipeline says who overlaps whom. Nothing is pushed.

use std::collections::BTreeMap;
use std::sync::Mutex;

use fleetyard_core::Grid;
use fleetyard_world::{Pose, Shape};
use rapier2d_f64::math::{Pose as Isometry, Rotation, Vector};
use rapier2d_f64::prelude::{
    ActiveCollisionTypes, ActiveEvents, ColliderBuilder, ColliderHandle, ColliderSet,
    CollisionEvent, ContactPair, EventHandler, PhysicsWorld, Real, RigidBodyBuilder,
    RigidBodyHandle, RigidBodySet, SoftBodySet, SoftBodyTearEvent,
};

/// Stands for the solid cells, beside the index of an agent.
pub(crate) const CELLS: u32 = u32::MAX;

/// Bodies on kinematic position-based bodies of a rapier world.
pub(crate) struct RapierObserver {
    world: PhysicsWorld,
    handles: Vec<RigidBodyHandle>,
    inbox: Inbox,
    /// Number of colliders that overlap, per pair of bodies with any; runs of cells are many
    /// colliders.
    overlaps: BTreeMap<(u32, u32), u32>,
}

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
        self.0.lock().expect("nobody panicked").push(item);
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

fn isometry(pose: Pose) -> Isometry {
    let (cos, sin) = pose.rotation();
    let rotation = Rotation::from_cos_sin_unchecked(cos, sin);
    Isometry::from_parts(Vector::new(pose.x, pose.y), rotation)
}

impl RapierObserver {
    pub(crate) fn new(shapes: &[&Shape], poses: &[Pose], grid: Option<(&Grid, f64)>) -> Self {
        let mut world = PhysicsWorld::new();
        world.gravity = Vector::new(0.0, 0.0);
        // Contacts are overlaps, found anew in every step.
        world.integration_parameters.normalized_prediction_distance = 0.0;
        world.integration_parameters.contact_recycling = false;
        if let Some((grid, cell)) = grid {
            add_cells(&mut world, grid, cell);
        }
        let types = ActiveCollisionTypes::default()
            | ActiveCollisionTypes::KINEMATIC_KINEMATIC
            | ActiveCollisionTypes::KINEMATIC_FIXED;
        let bodies = shapes.iter().zip(poses).enumerate();
        let handles = bodies.map(|(agent, (shape, pose))| {
            let body = RigidBodyBuilder::kinematic_position_based()
                .pose(isometry(*pose))
                .can_sleep(false);
            let collider = if shape.is_disc() {
                ColliderBuilder::ball(shape.effective_radius_m())
            } else {
                let corners = shape.vertices().iter().map(|at| Vector::new(at.x, at.y));
                ColliderBuilder::convex_polyline(corners.collect()).expect("a convex polygon")
            };
            let collider = collider
                .user_data(agent as u128)
                .active_collision_types(types)
                .active_events(ActiveEvents::COLLISION_EVENTS);
            world.insert(body, collider).0
        });
        let handles = handles.collect();
        Self {
            world,
            handles,
            inbox: Inbox::default(),
            overlaps: BTreeMap::new(),
        }
    }

    /// Says who begins (`true`) and ceases to overlap where the bodies are now,
    /// the lower index first and in order, and then puts them elsewhere.
    pub(crate) fn step(&mut self, poses: &[Pose], dt: f64) -> Vec<(bool, u32, u32)> {
        for (handle, pose) in self.handles.iter().zip(poses) {
            self.world.bodies[*handle].set_next_kinematic_position(isometry(*pose));
        }
        self.world.integration_parameters.dt = dt;
        self.world.step_with_events(&(), &self.inbox);
        let events = std::mem::take(&mut *self.inbox.0.lock().expect("nobody panicked"));
        let mut before: BTreeMap<(u32, u32), bool> = BTreeMap::new();
        for (begins, one, two) in events {
            let who = |handle: ColliderHandle| self.world.colliders[handle].user_data as u32;
            let (one, two) = (who(one), who(two));
            let pair = (one.min(two), one.max(two));
            let count = self.overlaps.entry(pair).or_insert(0);
            before.entry(pair).or_insert(*count > 0);
            *count = if begins { *count + 1 } else { *count - 1 };
        }
        let changes = before.into_iter().filter_map(|((one, two), before)| {
            let now = self
                .overlaps
                .get(&(one, two))
                .is_some_and(|count| *count > 0);
            (now != before).then_some((now, one, two))
        });
        changes.collect()
    }
}

/// Solid cells as one cuboid per run in a row.
fn add_cells(world: &mut PhysicsWorld, grid: &Grid, cell: f64) {
    for row in 0..grid.rows() {
        let solid = |col: u32| !grid.is_passable(row * grid.cols() + col);
        let mut col = 0;
        while col < grid.cols() {
            let left = col;
            while col < grid.cols() && solid(col) {
                col += 1;
            }
            if col > left {
                let half = Vector::new(f64::from(col - left) * 0.5 * cell, 0.5 * cell);
                let up = f64::from(grid.rows() - 1 - row) * cell;
                let center = Vector::new(f64::from(left) * cell, up) + half;
                let run = ColliderBuilder::cuboid(half.x, half.y)
                    .translation(center)
                    .user_data(u128::from(CELLS));
                world.colliders.insert(run);
            }
            col += 1;
        }
    }
}
