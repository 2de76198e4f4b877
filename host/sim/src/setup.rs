//! Constants of an execution, and its trace header.

use fleetyard_core::{Digest, Grid, Hasher, Roadmap, Role};
use fleetyard_world::{Mover, Shape, Workspace, write_workspace};

use crate::chunk::Chunk;
use crate::clock::Clock;
use crate::config::{Policy, SimConfig};
use crate::control::Driver;
use crate::kinematic::Shapes;
use crate::motion::{Fleet, Model};
use crate::obstacles::Obstacles;
use crate::route::Reference;
use crate::trace::{Bounds, Cells, Digests, Header, Outline, Profile, Scene};
use crate::workers::Workers;

/// Constants of an execution.
pub(crate) struct Setup<'a> {
    pub(crate) config: &'a SimConfig,
    pub(crate) clock: Clock,
    pub(crate) workers: Workers,
    pub(crate) agents: usize,
    pub(crate) movers: &'a [Mover],
    /// Rule by which agents proceed.
    pub(crate) policy: Policy,
    /// Digest of the plan.
    pub(crate) plan: Digest,
    /// By kind of shape; a kind without a model follows its reference exactly.
    pub(crate) models: Vec<Option<&'a Model>>,
    pub(crate) obstacles: Obstacles,
    /// Set if states have headings.
    pub(crate) with_heading: bool,
    /// Set if the plan has headings.
    pub(crate) headings: bool,
    /// Set if all agents follow the plan exactly, by time.
    pub(crate) exact: bool,
    pub(crate) grid: Option<&'a Grid>,
    pub(crate) workspace: Option<&'a Workspace>,
    pub(crate) fleet: Option<&'a Fleet>,
    /// The car of each trailer; trailers are the last agents.
    pub(crate) cars: &'a [u32],
    /// Roadmap of the plan, for display only.
    pub(crate) roadmap: Option<&'a Roadmap>,
}

impl Setup<'_> {
    /// Moves an agent through a block.
    pub(crate) fn drive(
        &self,
        driver: &Driver<'_>,
        shapes: &Shapes,
        chunk: &mut Chunk,
        lane: usize,
    ) {
        match self.models[shapes.kind_of(chunk.first + lane as u32)] {
            None | Some(Model::Pebble(_) | Model::Car(_)) => driver.follow(None, chunk, lane),
            Some(Model::Rotation(model)) => {
                let quarter_turn = model.turn_s * self.clock.substeps_per_s;
                driver.follow(Some(quarter_turn), chunk, lane);
            }
            Some(model) => driver.drive(model, chunk, lane),
        }
    }

    /// The trace header of the execution, and of its plan if there is one. The scene is
    /// made only for sinks that read it.
    pub(crate) fn header(
        &self,
        shapes: &Shapes,
        reference: Option<&Reference<'_>>,
        scene: bool,
    ) -> Header {
        let outline = |shape: &Shape| {
            if shape.is_disc() {
                Outline::Disc {
                    radius_m: shape.effective_radius_m(),
                }
            } else {
                Outline::Polygon {
                    vertices_m: shape.vertices().iter().map(|at| (*at).into()).collect(),
                }
            }
        };
        let trailers = (self.agents - self.cars.len()..self.agents)
            .map(|trailer| shapes.kind_of(trailer as u32));
        let is_towed = |kind: usize| trailers.clone().any(|towed| towed == kind);
        let profiles = shapes.kinds.iter().enumerate().map(|(kind, shape)| {
            let model = self.models.get(kind).copied();
            Profile {
                name: match model {
                    Some(_) if is_towed(kind) => format!("trailer {kind}"),
                    Some(_) => format!("robot {kind}"),
                    None => format!("mover {}", kind - self.models.len()),
                },
                model: match model {
                    Some(_) if is_towed(kind) => "towed".to_owned(),
                    Some(model) => model.map_or("pebble", Model::name).to_owned(),
                    None => String::new(),
                },
                outline: outline(shape),
            }
        });
        let scene = if scene {
            self.scene(shapes, reference)
        } else {
            Scene::default()
        };
        Header {
            program: concat!("fleetyard ", env!("CARGO_PKG_VERSION")).to_owned(),
            agents: self.agents as u32,
            movers: self.movers.len() as u32,
            ticks_hz: self.config.ticks_hz,
            substeps: self.config.substeps,
            tier: self.config.tier.name().to_owned(),
            policy: self.policy.name().to_owned(),
            seed: self.config.disturbance.seed,
            headings: self.with_heading,
            progress: false,
            waits: false,
            cars: self.cars.to_vec(),
            state_every: 0,
            bounds_m: self.bounds(reference),
            profiles: profiles.collect(),
            digests: self.digests(),
            scene,
        }
    }

    fn scene(&self, shapes: &Shapes, reference: Option<&Reference<'_>>) -> Scene {
        let bodies = 0..(self.agents + self.movers.len()) as u32;
        let polygons = self
            .workspace
            .map_or(&[][..], |workspace| &workspace.obstacles);
        let goals = reference.into_iter().flat_map(|reference| {
            (0..self.agents).map(|agent| {
                let goal = reference.place(agent, reference.last(agent));
                [goal.x, goal.y]
            })
        });
        let stations = |role| {
            let grid = self.grid?;
            Cells::with_role(grid, self.config.cell_size_m, role)
        };
        Scene {
            cells: self
                .grid
                .map(|grid| Cells::new(grid, self.config.cell_size_m)),
            endpoints: stations(Role::Endpoint),
            workstations: stations(Role::Workstation),
            polygons_m: polygons
                .iter()
                .map(|polygon| polygon.vertices().to_vec())
                .collect(),
            outline_m: self
                .workspace
                .and_then(|workspace| workspace.boundary.as_ref())
                .map_or_else(Vec::new, |edge| edge.polygon().vertices().to_vec()),
            roadmap_m: self
                .roadmap
                .into_iter()
                .flat_map(Roadmap::lines)
                // At most as many as a frame of a trace holds.
                .take(u32::MAX as usize / 32)
                .collect(),
            profile_of_body: bodies.map(|body| shapes.kind_of(body) as u32).collect(),
            goals_m: goals.collect(),
        }
    }

    /// Extent of a picture: the map and the workspace, or else the plan.
    fn bounds(&self, reference: Option<&Reference<'_>>) -> Bounds {
        let mut bounds: Option<Bounds> = None;
        let mut add = |min_x: f64, min_y: f64, max_x: f64, max_y: f64| {
            let known = bounds.unwrap_or(Bounds {
                min_x,
                min_y,
                max_x,
                max_y,
            });
            bounds = Some(Bounds {
                min_x: known.min_x.min(min_x),
                min_y: known.min_y.min(min_y),
                max_x: known.max_x.max(max_x),
                max_y: known.max_y.max(max_y),
            });
        };
        if let Some(grid) = self.grid {
            let side = self.config.cell_size_m;
            add(
                0.0,
                0.0,
                f64::from(grid.cols()) * side,
                f64::from(grid.rows()) * side,
            );
        }
        if let Some(workspace) = self.workspace {
            let of = workspace.bounds;
            add(of.min[0], of.min[1], of.max[0], of.max[1]);
        }
        if let Some(reference) = reference
            && self.grid.is_none()
            && self.workspace.is_none()
        {
            for agent in 0..self.agents {
                for knot in 0..=reference.last(agent) {
                    let place = reference.place(agent, knot);
                    add(place.x - 1.0, place.y - 1.0, place.x + 1.0, place.y + 1.0);
                }
            }
            for [x, y] in self.roadmap.into_iter().flat_map(Roadmap::lines).flatten() {
                add(x - 1.0, y - 1.0, x + 1.0, y + 1.0);
            }
        }
        bounds.unwrap_or(Bounds {
            min_x: 0.0,
            min_y: 0.0,
            max_x: 0.0,
            max_y: 0.0,
        })
    }

    fn digests(&self) -> Digests {
        let workspace = self.workspace.map(|workspace| {
            let mut hasher = Hasher::new("fleetyard.workspace/1");
            hasher.bytes(&write_workspace(workspace));
            hasher.finish()
        });
        let world = match (self.grid.map(Grid::digest), workspace) {
            (Some(grid), Some(workspace)) => {
                let mut both = Hasher::new("fleetyard.map-and-workspace/1");
                both.bytes(&grid.0.to_le_bytes());
                both.bytes(&workspace.0.to_le_bytes());
                both.finish()
            }
            (one, other) => one.or(other).unwrap_or(Digest(0)),
        };
        Digests {
            world,
            plan: self.plan,
            fleet: self.fleet.map_or(Digest(0), fleet_digest),
            config: self.config.digest(),
        }
    }
}

/// Digest of the profiles and of each agent's profile.
fn fleet_digest(fleet: &Fleet) -> Digest {
    let mut hasher = Hasher::new("fleetyard.fleet/2");
    for profile in fleet.profiles() {
        hasher.value(profile);
    }
    hasher.u32s(fleet.profile_of());
    hasher.finish()
}
