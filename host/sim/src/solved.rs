//! The contact tier within a block: requested velocities, tick by tick, and the world's
//! results.

use fleetyard_core::Grid;
use fleetyard_world::{Pose, Workspace};

use crate::chunk::{CHUNK, Chunk};
use crate::config::SimConfig;
use crate::contact::{Agent, ContactWorld, Drive, Mass, Material, Settings, Twist};
use crate::control::{Driver, UNLIMITED};
use crate::error::SimError;
use crate::event::Change;
use crate::kinematic::Shapes;
use crate::motion::Model;

/// Mass of a robot per square metre, in kilograms: an AGV of 70 cm and 200 kg.
const DENSITY: f64 = 500.0;

/// The sideways grip of wheels in m/s²: rubber on a dry floor.
const GRIP: f64 = 6.0;

/// The bodies of an execution as a contact world.
pub(crate) struct Solved {
    world: ContactWorld,
    wishes: Vec<Twist>,
    /// Errors of the wishes, which controllers know nothing of.
    errors: Vec<Twist>,
    substeps_per_tick: f64,
    agents: usize,
}

impl Solved {
    pub(crate) fn new<'m>(
        config: &SimConfig,
        (grid, workspace): (Option<&Grid>, Option<&Workspace>),
        shapes: &Shapes,
        model: &dyn Fn(u32) -> Option<&'m Model>,
        chunks: &[Chunk],
        agents: usize,
    ) -> Result<Self, SimError> {
        let mut world = ContactWorld::new(Settings {
            substeps: config.substeps as usize,
            ..Settings::default()
        })?;
        if let Some(grid) = grid {
            world.add_grid(grid, config.cell_size_m)?;
        }
        if let Some(workspace) = workspace {
            for obstacle in &workspace.obstacles {
                world.add_obstacle(obstacle)?;
            }
            match &workspace.boundary {
                Some(boundary) => world.add_boundary(boundary)?,
                None => world.add_border(workspace.bounds),
            };
            for mover in &workspace.movers {
                world.add_mover(mover)?;
            }
        }
        // Errors of velocity come on top of what drives are asked for.
        let spare = if config.disturbance.twist.is_none() {
            1.0
        } else {
            2.0
        };
        for agent in 0..agents {
            let (chunk, lane) = (&chunks[agent / CHUNK], agent % CHUNK);
            let drive = drive_of(model(agent as u32));
            world.add_agent(&Agent {
                shape: shapes.of(agent as u32),
                pose: Pose::new(chunk.x[lane], chunk.y[lane], chunk.heading[lane]),
                velocity: Twist::default(),
                mass: Mass::Density(DENSITY),
                drive: Drive {
                    acceleration: spare * drive.acceleration,
                    angular: spare * drive.angular,
                    ..drive
                },
                material: Material::default(),
            })?;
        }
        Ok(Self {
            world,
            wishes: vec![Twist::default(); agents],
            errors: vec![Twist::default(); agents],
            substeps_per_tick: f64::from(config.substeps),
            agents,
        })
    }

    /// Moves all bodies through a block and reports the begins and ends of contacts.
    pub(crate) fn drive<'m>(
        &mut self,
        driver: &Driver<'_>,
        model: &dyn Fn(u32) -> Option<&'m Model>,
        chunks: &mut [Chunk],
        changes: &mut Vec<Change>,
    ) -> Result<(), SimError> {
        // The world goes tick by tick, but tracks are body by body.
        let ticks = driver.ticks.len();
        let mut poses: Vec<Pose> = Vec::with_capacity(ticks * self.agents);
        let starts: Vec<Pose> = (0..self.agents)
            .map(|agent| self.world.pose(agent))
            .collect();
        let mut now = driver.block.start;
        for end in driver.ticks {
            for chunk in chunks.iter_mut() {
                for lane in 0..chunk.pilots.len() {
                    let agent = chunk.first as usize + lane;
                    let (pilot, factor) = (&mut chunk.pilots[lane], chunk.factors[lane]);
                    let wish = driver.wish(model(agent as u32), agent, pilot, factor, [now, *end]);
                    let slip = chunk.slips.get(lane).copied().unwrap_or_default();
                    let [vx, vy, omega] = slip.of(wish.vx, wish.vy, wish.omega);
                    self.errors[agent] = Twist { vx, vy, omega };
                    self.wishes[agent] = Twist {
                        vx: wish.vx + vx,
                        vy: wish.vy + vy,
                        omega: wish.omega + omega,
                    };
                    pilot.state.remember(&wish);
                }
            }
            self.world.step(&self.wishes, driver.tick_s)?;
            for chunk in chunks.iter_mut() {
                for (lane, pilot) in chunk.pilots.iter_mut().enumerate() {
                    let agent = chunk.first as usize + lane;
                    let (pose, velocity) = (self.world.pose(agent), self.world.velocity(agent));
                    let error = self.errors[agent];
                    let state = &mut pilot.state;
                    (state.x, state.y, state.heading) = (pose.x, pose.y, pose.heading);
                    state.vx = velocity.vx - error.vx;
                    state.vy = velocity.vy - error.vy;
                    state.omega = velocity.omega - error.omega;
                    driver.notice(model(agent as u32), agent, pilot, *end);
                    poses.push(pose);
                }
            }
            now = *end;
        }
        for event in self.world.drain_events() {
            // A contact is known at the end of the tick in which it begins.
            let when = (event.tick + 1) as f64 * self.substeps_per_tick;
            changes.push(Change::new(when, event.kind, event.agent, event.other));
        }
        for chunk in chunks.iter_mut() {
            for lane in 0..chunk.pilots.len() {
                let agent = chunk.first as usize + lane;
                let start = starts[agent];
                chunk.tracks.open();
                chunk
                    .tracks
                    .push(driver.block.start, start.x, start.y, start.heading);
                for (tick, end) in driver.ticks.iter().enumerate() {
                    let pose = poses[tick * self.agents + agent];
                    chunk.tracks.push(*end, pose.x, pose.y, pose.heading);
                }
                if ticks == 0 {
                    chunk
                        .tracks
                        .push(driver.block.end, start.x, start.y, start.heading);
                }
                let mut pilot = chunk.pilots[lane];
                let off = driver.off(model(agent as u32), agent, &mut pilot);
                chunk.pilots[lane] = pilot;
                let length = driver.block.length();
                chunk.tracking.note(agent as u32, off, length);
            }
        }
        Ok(())
    }
}

/// Drive of a body with this model.
fn drive_of(model: Option<&Model>) -> Drive {
    let (acceleration, angular, on_wheels) = match model {
        Some(Model::DifferentialDrive(model)) => (
            model
                .max_acceleration_m_per_s2
                .max(model.max_deceleration_m_per_s2),
            model.max_turn_acceleration_rad_per_s2,
            true,
        ),
        Some(Model::Unicycle1(_)) => (UNLIMITED, UNLIMITED, true),
        Some(Model::Unicycle2(model)) => (
            model.max_acceleration_m_per_s2,
            model.max_turn_acceleration_rad_per_s2,
            true,
        ),
        Some(Model::WaypointLaw(model)) => (
            model.speed_up_m_per_s2.max(model.slow_down_m_per_s2),
            model.turn_up_rad_per_s2.max(model.turn_down_rad_per_s2),
            true,
        ),
        Some(Model::DoubleIntegrator(model)) => {
            // Both axes at once.
            (
                model.max_acceleration_m_per_s2 * std::f64::consts::SQRT_2,
                UNLIMITED,
                false,
            )
        }
        Some(Model::Holonomic(model)) => {
            let (ahead, aside) = (
                model.max_forward_acceleration_m_per_s2,
                model.max_lateral_acceleration_m_per_s2,
            );
            // Both axes at once.
            (
                (ahead * ahead + aside * aside).sqrt(),
                model.max_turn_acceleration_rad_per_s2,
                false,
            )
        }
        _ => (UNLIMITED, UNLIMITED, false),
    };
    Drive {
        acceleration,
        lateral: on_wheels.then_some(GRIP),
        angular,
    }
}
