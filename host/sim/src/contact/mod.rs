//! The contact tier: agents as solved bodies of a rapier world.
//!
//! Here agents do not go where they are told. A controller asks for a velocity,
//! a bounded force tries to bring it about, and what is in the way pushes back:
//! robots jam in a doorway, a heavy one moves a light one, a moving obstacle
//! sweeps whoever stands before it. That is what the kinematic tier leaves out.
//!
//! A [`ContactWorld`] holds solid cells merged to rectangles, polygons, movers
//! on scripted paths and agents, and goes forward tick by tick. A tick is
//! [`Settings::substeps`] substeps of the solver (the soft-step scheme of Box2D
//! version 3, which rapier follows; GRACE, section IV-C, executes 60 Hz with
//! four). Contacts between two ticks are found once, ahead of the bodies, and
//! solved in every substep.
//!
//! It is not a controller: it keeps no route and no target. It is no validator
//! either: bodies under load overlap by fractions of a millimetre, and a mover
//! that presses a robot against a wall overlaps it. `docs/execution.md` says
//! what is modelled, what is not, and which tier to use for what.
//!
//! Equal worlds that are told equal things are in bitwise equal states, on every
//! machine and in every build: see [`ContactWorld::digest`].
//!
//! # Choices
//!
//! Instructions per tick with 1000 robots in a warehouse, where 100 is rapier as it comes:
//! boxes of the broad phase that are 0.12 m wider than bodies instead of 0.04 m, 84 (kept);
//! as wide as an eighth of a body, 90; across the 15 cm between robot and shelf, 145 in
//! time; no reordering of the tree, 87, but it gets worse with time; no sweeping of fast
//! bodies, 94, but small fast robots come through walls; contacts found anew instead of
//! reused while bodies hardly move, 101 (kept, since reused ones do not turn with bodies).

#![allow(clippy::float_cmp, reason = "whether anything changed at all")]

mod error;
mod touch;

use fleetyard_core::Grid;
use fleetyard_world::{Boundary, Bounds, Mover, Polygon, Pose, Shape, Vector as Point};
use rapier2d_f64::prelude::{
    ColliderBuilder, IntegrationParameters, MassProperties, PhysicsWorld, RigidBodyBuilder,
    RigidBodyHandle,
};
use xxhash_rust::xxh3::Xxh3Default;

use crate::convert::{isometry, vector};
use crate::statics::{Block, Statics};

pub use error::ContactError;
pub use touch::ContactEvent;
use touch::Touches;

/// Parameters of the solver.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Solver substeps per tick, at least 1. More make long chains of pushing
    /// robots stiffer.
    pub substeps: usize,
    /// Surface of everything but agents.
    pub walls: Material,
    /// Let rapier skip agents that are commanded to stand, and do stand, until they are
    /// touched.
    pub sleeping: bool,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            substeps: 4,
            walls: Material::default(),
            sleeping: true,
        }
    }
}

/// A surface. A contact uses the averages of both surfaces' coefficients.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Material {
    /// Coulomb friction coefficient, at least 0.
    pub friction: f64,
    /// Coefficient of restitution, 0 to 1.
    pub restitution: f64,
}

impl Default for Material {
    /// Hard plastic bumpers: 0.3, and no bounce.
    fn default() -> Self {
        Self {
            friction: 0.3,
            restitution: 0.0,
        }
    }
}

/// Mass of an agent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Mass {
    /// Kilograms per square metre of footprint.
    Density(f64),
    /// Kilograms, spread evenly over the footprint.
    Total(f64),
}

/// Bounds of an agent's drive, as accelerations of the agent alone: forces are these
/// times its mass, torques times its moment of inertia. The same bounds hold for braking,
/// and for keeping its place when it is pushed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drive {
    /// Metres per second squared: along the heading if there is a `lateral`
    /// bound, in any direction otherwise.
    pub acceleration: f64,
    /// Metres per second squared across the heading: the grip of wheels that do
    /// not steer, commonly the friction of tyres times 9.81. `None` for robots
    /// that move in all directions alike.
    pub lateral: Option<f64>,
    /// Radians per second squared.
    pub angular: f64,
}

/// An agent to add to a world.
#[derive(Debug, Clone)]
pub struct Agent<'a> {
    /// Its footprint. The centre of mass is the footprint's origin.
    pub shape: &'a Shape,
    /// Initial pose.
    pub pose: Pose,
    /// Initial velocity.
    pub velocity: Twist,
    /// Its mass; the moment of inertia follows from the footprint.
    pub mass: Mass,
    /// Bounds of its drive.
    pub drive: Drive,
    /// Its surface.
    pub material: Material,
}

/// A velocity in the world frame.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Twist {
    /// Metres per second.
    pub vx: f64,
    /// Metres per second.
    pub vy: f64,
    /// Radians per second, counter-clockwise.
    pub omega: f64,
}

impl Twist {
    fn is_finite(self) -> bool {
        self.vx.is_finite() && self.vy.is_finite() && self.omega.is_finite()
    }
}

fn positive(what: &'static str, value: f64, hint: &'static str) -> Result<f64, ContactError> {
    if value.is_finite() && value > 0.0 {
        return Ok(value);
    }
    Err(ContactError::Number {
        what,
        value,
        must: "a positive number",
        hint,
    })
}

/// State of an agent beside its rapier body.
#[derive(Debug)]
struct Driven {
    handle: RigidBodyHandle,
    mass: f64,
    inertia: f64,
    max_force: f64,
    max_lateral: Option<f64>,
    max_torque: f64,
    /// Current drive force.
    force: [f64; 2],
    torque: f64,
    /// Mean force of everything else on the agent in the last tick.
    load: [f64; 2],
    load_torque: f64,
    /// Set while the agent is commanded to stand.
    parked: bool,
    velocity: Twist,
    /// Heading for which `rotation` holds the cosine and sine.
    heading: f64,
    rotation: [f64; 2],
}

/// Velocities that differ by less than this, in metres or radians per second, count as
/// equal.
const SAME_VELOCITY: f64 = 1e-9;

/// The broad phase keeps boxes that are larger than the bodies by 0.04 of the
/// length unit or more, and has work only when a body leaves its box. Everything
/// else that scales with the unit is given in metres, by dividing.
const SLACK_UNIT: f64 = 3.0;

/// Half the thickness of the walls around a world, in metres.
const BORDER_M: f64 = 1.0;

/// Largest displacement of a standing robot, in metres or radians per second.
const STILL: f64 = 1e-4;

/// A world of bodies that push each other.
pub struct ContactWorld {
    world: PhysicsWorld,
    settings: Settings,
    agents: Vec<Driven>,
    movers: Vec<(Mover, RigidBodyHandle)>,
    obstacles: u32,
    statics: Option<(Statics, Vec<Block>)>,
    touches: Touches,
    time_s: f64,
    ticks: u64,
}

impl ContactWorld {
    /// An empty world.
    pub fn new(settings: Settings) -> Result<Self, ContactError> {
        if settings.substeps == 0 || settings.substeps > 64 {
            return Err(ContactError::Number {
                what: "the number of substeps",
                value: settings.substeps as f64,
                must: "from 1 to 64",
                hint: "4 is common",
            });
        }
        check_material(settings.walls)?;
        let mut world = PhysicsWorld::new();
        world.gravity = vector(0.0, 0.0);
        let usual = IntegrationParameters::default();
        world.integration_parameters = IntegrationParameters {
            num_solver_iterations: settings.substeps,
            length_unit: SLACK_UNIT,
            normalized_allowed_linear_error: usual.normalized_allowed_linear_error / SLACK_UNIT,
            normalized_max_corrective_velocity: usual.normalized_max_corrective_velocity
                / SLACK_UNIT,
            normalized_prediction_distance: usual.normalized_prediction_distance / SLACK_UNIT,
            normalized_max_linear_velocity: usual.normalized_max_linear_velocity / SLACK_UNIT,
            // Recycled contacts do not turn with the bodies; finding them anew is a small
            // part of the work.
            contact_recycling: false,
            ..usual
        };
        Ok(Self {
            world,
            settings,
            agents: Vec::new(),
            movers: Vec::new(),
            obstacles: 0,
            statics: None,
            touches: Touches::default(),
            time_s: 0.0,
            ticks: 0,
        })
    }

    /// Adds the solid cells of a grid, merged to rectangles. A world has at most one
    /// grid; a second one replaces the cells that contacts refer to.
    pub fn add_grid(&mut self, grid: &Grid, cell_size_m: f64) -> Result<(), ContactError> {
        positive("the cell size", cell_size_m, "give it in metres")?;
        let statics = Statics::new(grid, cell_size_m);
        let blocks = statics.blocks();
        for (index, block) in blocks.iter().enumerate() {
            let (x, y, half_x, half_y) = statics.block_m(*block);
            let cuboid = ColliderBuilder::cuboid(half_x, half_y).translation(vector(x, y));
            self.insert_fixed(cuboid, touch::cells(index as u32));
        }
        self.statics = Some((statics, blocks));
        Ok(())
    }

    /// Adds a polygon that never moves, and returns its index.
    pub fn add_obstacle(&mut self, polygon: &Polygon) -> Result<u32, ContactError> {
        let index = self.obstacles;
        for (pose, shape) in polygon.parts() {
            let collider = solid("obstacle", index, shape)?.position(isometry(*pose));
            self.insert_fixed(collider, touch::obstacle(index));
        }
        self.obstacles += 1;
        Ok(index)
    }

    fn insert_fixed(&mut self, collider: ColliderBuilder, tag: u128) {
        let walls = self.settings.walls;
        self.world.colliders.insert(
            collider
                .user_data(tag)
                .friction(walls.friction)
                .restitution(walls.restitution),
        );
    }

    /// Adds walls around a rectangle, and returns the polygon index of contacts with
    /// them.
    pub fn add_border(&mut self, bounds: Bounds) -> u32 {
        let index = self.obstacles;
        let Bounds { min, max } = bounds;
        let (center_x, center_y) = (0.5 * (min[0] + max[0]), 0.5 * (min[1] + max[1]));
        let (half_x, half_y) = (0.5 * (max[0] - min[0]), 0.5 * (max[1] - min[1]));
        for (x, y, along_x, along_y) in [
            (
                min[0] - BORDER_M,
                center_y,
                BORDER_M,
                half_y + 2.0 * BORDER_M,
            ),
            (
                max[0] + BORDER_M,
                center_y,
                BORDER_M,
                half_y + 2.0 * BORDER_M,
            ),
            (center_x, min[1] - BORDER_M, half_x, BORDER_M),
            (center_x, max[1] + BORDER_M, half_x, BORDER_M),
        ] {
            let wall = ColliderBuilder::cuboid(along_x, along_y).translation(vector(x, y));
            self.insert_fixed(wall, touch::obstacle(index));
        }
        self.obstacles += 1;
        index
    }

    /// Adds the outside of a boundary, and returns the polygon index of contacts with it.
    pub fn add_boundary(&mut self, boundary: &Boundary) -> Result<u32, ContactError> {
        let index = self.add_border(boundary.polygon().bounds());
        for (pose, shape) in boundary.outside() {
            let collider = solid("boundary", index, shape)?.position(isometry(*pose));
            self.insert_fixed(collider, touch::obstacle(index));
        }
        Ok(index)
    }

    /// Adds a scripted obstacle, which no body can stop, and returns its index.
    pub fn add_mover(&mut self, mover: &Mover) -> Result<u32, ContactError> {
        let index = self.movers.len() as u32;
        let walls = self.settings.walls;
        let body = RigidBodyBuilder::kinematic_position_based()
            .pose(isometry(mover.pose_at(self.time_s)))
            .can_sleep(false);
        let collider = solid("mover", index, mover.shape())?
            .user_data(touch::mover(index))
            .friction(walls.friction)
            .restitution(walls.restitution);
        let (handle, _) = self.world.insert(body, collider);
        self.movers.push((mover.clone(), handle));
        Ok(index)
    }

    /// Adds an agent, and returns its index.
    pub fn add_agent(&mut self, agent: &Agent<'_>) -> Result<u32, ContactError> {
        let index = self.agents.len() as u32;
        check_material(agent.material)?;
        if !(agent.pose.is_finite() && agent.velocity.is_finite()) {
            return Err(ContactError::Number {
                what: "a coordinate of an agent's pose or velocity",
                value: f64::NAN,
                must: "a finite number",
                hint: "give metres, radians and seconds",
            });
        }
        let shape = solid("agent", index, agent.shape)?;
        let even = shape.shape.mass_properties(1.0);
        let area = even.mass();
        let mass = positive(
            "the mass of an agent",
            match agent.mass {
                Mass::Density(density) => density * area,
                Mass::Total(mass) => mass,
            },
            "give kilograms, or kilograms per square metre",
        )?;
        // Evenly spread, and turning about the origin of the footprint.
        let offset = even.local_com.length_squared();
        let inertia = mass * (even.principal_inertia() / area + offset);
        let drive = agent.drive;
        positive(
            "the acceleration of an agent",
            drive.acceleration,
            "give metres per second squared",
        )?;
        positive(
            "the angular acceleration of an agent",
            drive.angular,
            "give radians per second squared",
        )?;
        if let Some(lateral) = drive.lateral {
            positive(
                "the lateral grip of an agent",
                lateral,
                "give metres per second squared, or none if it moves in all directions alike",
            )?;
        }
        let velocity = agent.velocity;
        let body = RigidBodyBuilder::dynamic()
            .pose(isometry(agent.pose))
            .linvel(vector(velocity.vx, velocity.vy))
            .angvel(velocity.omega)
            .can_sleep(false);
        let collider = shape
            .mass_properties(MassProperties::new(vector(0.0, 0.0), mass, inertia))
            .user_data(u128::from(index))
            .friction(agent.material.friction)
            .restitution(agent.material.restitution);
        let (handle, _) = self.world.insert(body, collider);
        let (cos, sin) = agent.pose.rotation();
        self.agents.push(Driven {
            handle,
            mass,
            inertia,
            max_force: mass * drive.acceleration,
            max_lateral: drive.lateral.map(|lateral| mass * lateral),
            max_torque: inertia * drive.angular,
            force: [0.0; 2],
            torque: 0.0,
            load: [0.0; 2],
            load_torque: 0.0,
            velocity: agent.velocity,
            parked: false,
            heading: agent.pose.heading,
            rotation: [cos, sin],
        });
        Ok(index)
    }

    /// Number of agents.
    pub fn agents(&self) -> usize {
        self.agents.len()
    }

    /// Simulated time in seconds.
    pub fn time_s(&self) -> f64 {
        self.time_s
    }

    /// One tick of `dt` seconds. `commands` are the velocities that the controllers
    /// request for the end of the tick.
    ///
    /// The force is constant over the tick: the one that reaches the requested velocity
    /// against the load of the tick before, clamped to the agent's bounds. Without
    /// obstruction and within bounds, an agent has exactly the requested velocity at the
    /// end, and has moved as far as if its velocity had changed in equal steps, one per
    /// substep.
    pub fn step(&mut self, commands: &[Twist], dt: f64) -> Result<(), ContactError> {
        if commands.len() != self.agents.len() {
            return Err(ContactError::Commands {
                commands: commands.len(),
                agents: self.agents.len(),
            });
        }
        positive("a tick", dt, "give seconds, commonly 1/60")?;
        for command in commands {
            if !command.is_finite() {
                return Err(ContactError::Number {
                    what: "a velocity that an agent is told to have",
                    value: command.vx + command.vy + command.omega,
                    must: "a finite number",
                    hint: "look for a division by zero in the controller",
                });
            }
        }
        self.steer(commands, dt);
        let end = self.time_s + dt;
        for (mover, handle) in &self.movers {
            if let Some(body) = self.world.bodies.get_mut(*handle) {
                body.set_next_kinematic_position(isometry(mover.pose_at(end)));
            }
        }
        self.world.integration_parameters.dt = dt;
        self.world.step();
        self.time_s = end;
        self.read_back(dt)?;
        let statics = self.statics.as_ref();
        let statics = statics.map(|(statics, blocks)| (statics, &blocks[..]));
        self.touches.update(self.ticks, &self.world, statics);
        self.ticks += 1;
        Ok(())
    }

    fn steer(&mut self, commands: &[Twist], dt: f64) {
        let rate = 1.0 / dt;
        for (agent, command) in self.agents.iter_mut().zip(commands) {
            let rounded = |need: f64, inertia: f64| {
                // Anything smaller is rounding, and writing to a body costs time.
                if need.abs() < SAME_VELOCITY * inertia * rate {
                    0.0
                } else {
                    need
                }
            };
            let (now, mass) = (agent.velocity, agent.mass);
            let x = (command.vx - now.vx) * mass * rate - agent.load[0];
            let y = (command.vy - now.vy) * mass * rate - agent.load[1];
            let force = agent.bounded([rounded(x, mass), rounded(y, mass)]);
            let turn = (command.omega - now.omega) * agent.inertia * rate - agent.load_torque;
            let torque = rounded(turn, agent.inertia).clamp(-agent.max_torque, agent.max_torque);
            let parked = self.settings.sleeping && *command == Twist::default();
            if force == agent.force && torque == agent.torque && parked == agent.parked {
                continue;
            }
            let parking = parked != agent.parked;
            (agent.force, agent.torque, agent.parked) = (force, torque, parked);
            // Reading a body is free; writing to it makes rapier examine it again.
            let Some(body) = self.world.bodies.get_mut(agent.handle) else {
                continue;
            };
            if parking {
                let threshold = if parked { STILL / SLACK_UNIT } else { -1.0 };
                let activation = body.activation_mut();
                activation.normalized_linear_threshold = threshold;
                activation.angular_threshold = if parked { STILL } else { -1.0 };
            }
            let wake = !parked;
            body.reset_forces(false);
            body.add_force(vector(force[0], force[1]), wake);
            body.reset_torques(false);
            body.add_torque(torque, wake);
        }
    }

    /// Records the poses of all agents after a tick, and the load on each.
    fn read_back(&mut self, dt: f64) -> Result<(), ContactError> {
        let rate = 1.0 / dt;
        for (index, agent) in self.agents.iter_mut().enumerate() {
            let body = &self.world.bodies[agent.handle];
            let (at, linear) = (body.position(), body.linvel());
            let now = [at.rotation.re, at.rotation.im];
            if now != agent.rotation {
                // Angle from the old direction to the new one; it is small.
                let [cos, sin] = agent.rotation;
                let across = cos * now[1] - sin * now[0];
                let along = cos * now[0] + sin * now[1];
                agent.heading += libm::atan2(across, along);
                agent.rotation = now;
            }
            let before = agent.velocity;
            agent.velocity = Twist {
                vx: linear.x,
                vy: linear.y,
                omega: body.angvel(),
            };
            let (x, y) = (linear.x - before.vx, linear.y - before.vy);
            agent.load = [
                x * agent.mass * rate - agent.force[0],
                y * agent.mass * rate - agent.force[1],
            ];
            agent.load_torque =
                (agent.velocity.omega - before.omega) * agent.inertia * rate - agent.torque;
            if !(at.translation.x.is_finite()
                && at.translation.y.is_finite()
                && agent.heading.is_finite()
                && agent.velocity.is_finite())
            {
                return Err(ContactError::Diverged {
                    agent: index as u32,
                    time_s: self.time_s,
                });
            }
        }
        Ok(())
    }

    /// Pose of an agent, heading unwrapped. The agent must exist.
    pub fn pose(&self, agent: usize) -> Pose {
        let driven = &self.agents[agent];
        let at = self.world.bodies[driven.handle].translation();
        Pose::new(at.x, at.y, driven.heading)
    }

    /// Velocity of an agent. The agent must exist.
    pub fn velocity(&self, agent: usize) -> Twist {
        self.agents[agent].velocity
    }

    /// Effort of an agent in the last tick: its drive force in newtons, in the world
    /// frame, and its torque in newton metres. The agent must exist.
    pub fn effort(&self, agent: usize) -> ([f64; 2], f64) {
        let driven = &self.agents[agent];
        (driven.force, driven.torque)
    }

    /// Contact events since the last call, ordered by tick, agent and other body.
    pub fn drain_events(&mut self) -> std::vec::Drain<'_, ContactEvent> {
        self.touches.events.drain(..)
    }

    /// Digest of the poses and velocities of all bodies.
    pub fn digest(&self) -> u128 {
        let mut hash = Xxh3Default::new();
        for agent in 0..self.agents.len() {
            let (pose, velocity) = (self.pose(agent), self.velocity(agent));
            for number in [
                pose.x,
                pose.y,
                pose.heading,
                velocity.vx,
                velocity.vy,
                velocity.omega,
            ] {
                hash.update(&number.to_bits().to_le_bytes());
            }
        }
        hash.digest128()
    }
}

impl Driven {
    /// Clamps a force to the bounds of the drive.
    fn bounded(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        match self.max_lateral {
            None => {
                let squared = x * x + y * y;
                let scale = if squared > self.max_force * self.max_force {
                    self.max_force / squared.sqrt()
                } else {
                    1.0
                };
                [x * scale, y * scale]
            }
            Some(max_lateral) => {
                let [cos, sin] = self.rotation;
                let along = (x * cos + y * sin).clamp(-self.max_force, self.max_force);
                let across = (y * cos - x * sin).clamp(-max_lateral, max_lateral);
                [along * cos - across * sin, along * sin + across * cos]
            }
        }
    }
}

fn check_material(material: Material) -> Result<(), ContactError> {
    if !(material.friction.is_finite() && material.friction >= 0.0) {
        return Err(ContactError::Number {
            what: "a friction coefficient",
            value: material.friction,
            must: "a number from 0",
            hint: "rubber on concrete has about 0.8",
        });
    }
    if !(0.0..=1.0).contains(&material.restitution) {
        return Err(ContactError::Number {
            what: "a coefficient of restitution",
            value: material.restitution,
            must: "from 0 to 1",
            hint: "0 does not bounce",
        });
    }
    Ok(())
}

/// The rapier collider of a shape.
fn solid(what: &'static str, index: u32, shape: &Shape) -> Result<ColliderBuilder, ContactError> {
    let vertices = shape.vertices();
    let builder = if shape.is_disc() {
        Some(ColliderBuilder::ball(shape.effective_radius_m()))
    } else if let Some([half_x, half_y]) = half_extents(vertices) {
        Some(ColliderBuilder::cuboid(half_x, half_y))
    } else {
        ColliderBuilder::convex_polyline(vertices.iter().map(|at| vector(at.x, at.y)).collect())
    };
    builder
        .filter(|builder| builder.shape.mass_properties(1.0).mass() > 0.0)
        .ok_or(ContactError::Flat { what, index })
}

/// Half extents if the polygon is a rectangle around the origin, for which rapier has
/// faster tests than for other polygons.
fn half_extents(vertices: &[Point]) -> Option<[f64; 2]> {
    let corner = vertices.first()?.abs();
    let is_corner = |vertex: &Point| vertex.abs() == corner;
    (vertices.len() == 4 && vertices.iter().all(is_corner)).then_some(corner.into())
}
