//! The header of a trace: everything known before the first tick.

use fleetyard_core::{Digest, Grid, Hasher, Role};
use serde::{Deserialize, Serialize};

use super::{Fields, MAX_BODIES, NO_VALUE, put_number};

/// The header of a trace, sufficient to draw it without map, plan and fleet.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Header {
    /// The program that executed the plan, with its version.
    pub program: String,
    /// Number of agents.
    pub agents: u32,
    /// Number of obstacles that move.
    pub movers: u32,
    /// Ticks per simulated second.
    pub ticks_hz: u32,
    /// Substeps per tick.
    pub substeps: u32,
    /// Tier of the execution.
    pub tier: String,
    /// Policy of the execution.
    pub policy: String,
    /// Seed of everything random in the execution.
    pub seed: u64,
    /// Set if states have headings.
    pub headings: bool,
    /// Set if states have the progress along the route.
    pub progress: bool,
    /// Set if the trace says which agent waits for which: see [`Waiting`](super::Waiting).
    #[serde(default)]
    pub waits: bool,
    /// The car of each trailer; trailers are the last agents.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub cars: Vec<u32>,
    /// Ticks between recorded states, 0 if none are recorded. The writer of a file sets
    /// it.
    pub state_every: u32,
    /// Extent of a picture.
    pub bounds_m: Bounds,
    /// The kinds of bodies.
    pub profiles: Vec<Profile>,
    /// Digests of the inputs.
    pub digests: Digests,
    /// Static parts of the picture, and the bodies. Stored in frames of its own.
    #[serde(skip)]
    pub scene: Scene,
}

/// A rectangle along the axes, in metres.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs, reason = "the names say it")]
pub struct Bounds {
    pub min_x: f64,
    pub min_y: f64,
    pub max_x: f64,
    pub max_y: f64,
}

/// A kind of body.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Profile {
    /// Its name.
    pub name: String,
    /// Its motion model; empty for obstacles that move.
    pub model: String,
    /// Its outline, about the point that states give.
    pub outline: Outline,
}

/// The outline of a body whose heading is 0, about its own origin.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Outline {
    /// A disc around the origin.
    Disc {
        /// Its radius in metres.
        radius_m: f64,
    },
    /// A convex polygon, counter-clockwise.
    Polygon {
        /// Its vertices in metres.
        vertices_m: Vec<[f64; 2]>,
    },
}

/// Digests of the inputs; all zero for missing inputs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Digests {
    /// Of the map or the world.
    pub world: Digest,
    /// Of the plan.
    pub plan: Digest,
    /// Of the fleet: footprints, models, limits, controllers.
    pub fleet: Digest,
    /// Of every other parameter of the execution.
    pub config: Digest,
}

/// Static parts of the picture, and the bodies.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Scene {
    /// Solid cells of a map. The map's lower left corner is the origin.
    pub cells: Option<Cells>,
    /// Cells of the map that are endpoints, and those that are workstations.
    pub endpoints: Option<Cells>,
    /// See `endpoints`.
    pub workstations: Option<Cells>,
    /// Obstacles, vertices in metres.
    pub polygons_m: Vec<Vec<[f64; 2]>>,
    /// The edge of the world, vertices in metres; empty if it is the bounds.
    pub outline_m: Vec<[f64; 2]>,
    /// Edges of the roadmap of the plan, from point to point in metres.
    pub roadmap_m: Vec<[[f64; 2]; 2]>,
    /// For every body the index of its profile: first the agents, then the
    /// obstacles that move.
    pub profile_of_body: Vec<u32>,
    /// Goals of the agents, in metres; empty if unknown.
    pub goals_m: Vec<[f64; 2]>,
}

impl Header {
    /// Agents and moving obstacles.
    pub fn bodies(&self) -> usize {
        self.agents as usize + self.movers as usize
    }

    /// Simulated time at a tick, in seconds.
    pub fn time_s(&self, tick: u64) -> f64 {
        tick as f64 / f64::from(self.ticks_hz)
    }

    /// Hashes the fields that affect the execution, without those that only describe it
    /// (the program, the recording, the picture).
    pub(super) fn identify(&self, hasher: &mut Hasher) {
        for value in [self.agents, self.movers, self.ticks_hz, self.substeps] {
            hasher.u64(u64::from(value));
        }
        hasher.bytes(self.tier.as_bytes());
        hasher.bytes(self.policy.as_bytes());
        hasher.u64(self.seed);
        hasher.u64(u64::from(self.headings));
        let Digests {
            world,
            plan,
            fleet,
            config,
        } = self.digests;
        for digest in [world, plan, fleet, config] {
            hasher.bytes(&digest.0.to_le_bytes());
        }
    }

    /// The first inconsistency in the header, scene aside.
    pub(super) fn fault(&self) -> Option<&'static str> {
        let Bounds {
            min_x,
            min_y,
            max_x,
            max_y,
        } = self.bounds_m;
        let bounds = [min_x, min_y, max_x, max_y];
        let outline_is_finite = |profile: &Profile| match &profile.outline {
            Outline::Disc { radius_m } => radius_m.is_finite(),
            Outline::Polygon { vertices_m } => vertices_m.iter().flatten().all(|v| v.is_finite()),
        };
        if self.agents == 0 {
            Some("there are no agents")
        } else if self.bodies() > MAX_BODIES {
            Some("there are more bodies than a trace can have")
        } else if self.cars.len() >= self.agents as usize
            || (self.cars.iter()).any(|car| *car as usize >= self.agents as usize - self.cars.len())
        {
            Some("a trailer has no car")
        } else if self.ticks_hz == 0 || self.substeps == 0 {
            Some("the rate of ticks or substeps is 0")
        } else if !bounds.iter().all(|v| v.is_finite()) || min_x > max_x || min_y > max_y {
            Some("the bounds are no rectangle")
        } else if !self.profiles.iter().all(outline_is_finite) {
            Some("an outline has a number that is not finite")
        } else {
            None
        }
    }

    /// The first inconsistency between the scene and the header.
    pub(super) fn scene_fault(&self) -> Option<&'static str> {
        let profiles = self.profiles.len() as u64;
        let scene = &self.scene;
        let goals = scene.goals_m.len();
        let size = |cells: &Cells| (cells.rows, cells.cols, cells.cell_size);
        let map = scene.cells.as_ref().map(size);
        let stations = [&scene.endpoints, &scene.workstations];
        if scene.profile_of_body.len() != self.bodies() {
            Some("there is not one profile per body")
        } else if scene
            .profile_of_body
            .iter()
            .any(|at| u64::from(*at) >= profiles)
        {
            Some("a body has a profile that does not exist")
        } else if goals != 0 && goals != self.agents as usize {
            Some("there is not one goal per agent")
        } else if stations
            .into_iter()
            .flatten()
            .any(|cells| Some(size(cells)) != map)
        {
            Some("stations are of another map")
        } else {
            None
        }
    }
}

impl Scene {
    /// The bodies: for each its profile and its goal. 20 bytes for each, never
    /// compressed: a file thereby proves that the bodies which it claims are worth the
    /// reader's memory.
    pub(super) fn body_bytes(&self) -> Vec<u8> {
        let mut out = Vec::with_capacity(BODY_BYTES * self.profile_of_body.len());
        for (body, profile) in self.profile_of_body.iter().enumerate() {
            out.extend(profile.to_le_bytes());
            let goal = self.goals_m.get(body).map(|goal| goal.map(f64::to_bits));
            for bits in goal.unwrap_or([NO_VALUE; 2]) {
                out.extend(bits.to_le_bytes());
            }
        }
        out
    }

    pub(super) fn parse_bodies(&mut self, payload: &[u8], agents: u32) -> Option<()> {
        let (bodies, rest) = payload.as_chunks::<BODY_BYTES>();
        for (body, bytes) in bodies.iter().enumerate() {
            let mut fields = Fields(bytes);
            self.profile_of_body.push(fields.u32()?);
            let goal = [fields.f64()?, fields.f64()?];
            if !goal[0].is_nan() && !goal[1].is_nan() {
                if body != self.goals_m.len() || body >= agents as usize {
                    return None;
                }
                self.goals_m.push(goal);
            }
        }
        rest.is_empty().then_some(())
    }

    pub(super) fn polygon_bytes(&self) -> Vec<u8> {
        let mut out = Vec::new();
        for polygon in &self.polygons_m {
            out.extend((polygon.len() as u32).to_le_bytes());
            for value in polygon.iter().flatten() {
                out.extend(value.to_le_bytes());
            }
        }
        out
    }

    pub(super) fn parse_polygons(&mut self, payload: &[u8]) -> Option<()> {
        let mut fields = Fields(payload);
        while !fields.0.is_empty() {
            let count = fields.u32()? as usize;
            if count < 3 {
                return None;
            }
            let (vertices, rest) = fields.0.split_at_checked(count.checked_mul(16)?)?;
            fields.0 = rest;
            self.polygons_m.push(points(vertices)?);
        }
        Some(())
    }
}

impl Scene {
    pub(super) fn parse_outline(&mut self, payload: &[u8]) -> Option<()> {
        let outline = points(payload)?;
        let is_first = self.outline_m.is_empty();
        (is_first && outline.len() >= 3).then(|| self.outline_m = outline)
    }

    pub(super) fn parse_roadmap(&mut self, payload: &[u8]) -> Option<()> {
        let points = points(payload)?;
        let (lines, rest) = points.as_chunks::<2>();
        let is_first = self.roadmap_m.is_empty();
        (is_first && rest.is_empty()).then(|| self.roadmap_m = lines.to_vec())
    }
}

/// Points of a scene, x and y in metres of each.
fn points(payload: &[u8]) -> Option<Vec<[f64; 2]>> {
    let (points, rest) = payload.as_chunks::<16>();
    let point = |bytes: &[u8; 16]| {
        let mut fields = Fields(bytes);
        let point = [fields.f64()?, fields.f64()?];
        point.iter().all(|v| v.is_finite()).then_some(point)
    };
    let points = points.iter().map(point).collect::<Option<Vec<_>>>()?;
    rest.is_empty().then_some(points)
}

const BODY_BYTES: usize = 20;

/// A set of cells of a map, the solid ones or those of a role, as lengths of alternating
/// runs outside and inside of the set, in the order of rows from the top. Takes as much
/// memory as in a file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Cells {
    rows: u32,
    cols: u32,
    /// Bits of the float, so that sets of cells can be compared.
    cell_size: u64,
    /// LEB128 numbers; the first run is outside of the set.
    runs: Vec<u8>,
}

impl Cells {
    /// The impassable cells of a grid.
    pub fn new(grid: &Grid, cell_size_m: f64) -> Self {
        Self::of(grid, cell_size_m, |letter| {
            !Grid::letter_is_passable(letter)
        })
    }

    /// The cells of a grid with a role, if there are any.
    pub fn with_role(grid: &Grid, cell_size_m: f64, role: Role) -> Option<Self> {
        let has_role = |letter| letter == role.letter();
        let some = grid.terrain().iter().copied().any(has_role);
        some.then(|| Self::of(grid, cell_size_m, has_role))
    }

    fn of(grid: &Grid, cell_size_m: f64, is_meant: impl Fn(u8) -> bool) -> Self {
        let mut runs = Vec::new();
        let mut meant = false;
        let mut length = 0u32;
        for letter in grid.terrain() {
            if is_meant(*letter) != meant {
                put_number(&mut runs, length.into());
                length = 0;
                meant = !meant;
            }
            length += 1;
        }
        put_number(&mut runs, length.into());
        Self {
            rows: grid.rows(),
            cols: grid.cols(),
            cell_size: cell_size_m.to_bits(),
            runs,
        }
    }

    /// Number of rows.
    pub fn rows(&self) -> u32 {
        self.rows
    }

    /// Number of columns.
    pub fn cols(&self) -> u32 {
        self.cols
    }

    /// Side of a cell in metres.
    pub fn cell_size_m(&self) -> f64 {
        f64::from_bits(self.cell_size)
    }

    /// The middle of a cell of the map, in metres.
    pub fn center_m(&self, cell: u32) -> [f64; 2] {
        let (row, col) = (cell / self.cols, cell % self.cols);
        let from_below = self.rows.saturating_sub(row + 1);
        [col, from_below].map(|cells| (f64::from(cells) + 0.5) * self.cell_size_m())
    }

    /// Runs of the set within rows, in order: row from the top, first column, and length.
    pub fn in_rows(&self) -> impl Iterator<Item = (u32, u32, u32)> {
        let cols = u64::from(self.cols);
        self.runs()
            .filter(|(meant, ..)| *meant)
            .flat_map(move |(_, start, end)| {
                (start / cols..end.div_ceil(cols)).map(move |row| {
                    let from = start.max(row * cols);
                    let to = end.min((row + 1) * cols);
                    (row as u32, (from - row * cols) as u32, (to - from) as u32)
                })
            })
    }

    /// All runs in order: true inside of the set, first cell, end.
    fn runs(&self) -> impl Iterator<Item = (bool, u64, u64)> {
        let mut rest = Fields(&self.runs);
        let (mut meant, mut at) = (true, 0);
        std::iter::from_fn(move || {
            let length = rest.number32()?;
            let start = at;
            at += u64::from(length);
            meant = !meant;
            Some((meant, start, at))
        })
    }

    pub(super) fn bytes(&self) -> Vec<u8> {
        let mut out = Vec::with_capacity(16 + self.runs.len());
        out.extend(self.rows.to_le_bytes());
        out.extend(self.cols.to_le_bytes());
        out.extend(self.cell_size.to_le_bytes());
        out.extend(&self.runs);
        out
    }

    pub(super) fn parse(payload: &[u8]) -> Option<Self> {
        let mut fields = Fields(payload);
        let cells = Self {
            rows: fields.u32()?,
            cols: fields.u32()?,
            cell_size: fields.u64()?,
            runs: fields.0.to_vec(),
        };
        let count = u64::from(cells.rows) * u64::from(cells.cols);
        let size = cells.cell_size_m();
        if count == 0 || count > Grid::MAX_CELLS || !size.is_finite() || size <= 0.0 {
            return None;
        }
        let (mut sum, mut first) = (0, true);
        while !fields.0.is_empty() {
            let length = fields.number32()?;
            // Only the first run, outside of the set, may be empty.
            if length == 0 && !first {
                return None;
            }
            first = false;
            sum += u64::from(length);
        }
        (sum == count).then_some(cells)
    }
}

#[cfg(test)]
mod tests {
    use super::Cells;
    use fleetyard_core::Grid;

    #[test]
    fn solid_cells_are_told_row_by_row() {
        for (map, runs) in [
            ("....", vec![]),
            ("@@@@", vec![(0, 0, 2), (1, 0, 2)]),
            (".@@.", vec![(0, 1, 1), (1, 0, 1)]),
            ("@..@", vec![(0, 0, 1), (1, 1, 1)]),
        ] {
            let grid = Grid::new("m", 2, 2, map.as_bytes().to_vec()).unwrap();
            let cells = Cells::new(&grid, 0.5);
            assert_eq!(cells.in_rows().collect::<Vec<_>>(), runs, "{map}");
            assert_eq!(Cells::parse(&cells.bytes()).unwrap(), cells);
            assert_eq!(
                Cells::parse(&cells.bytes()[..cells.bytes().len() - 1]),
                None
            );
        }
    }
}
