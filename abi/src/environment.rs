//! Environments: what a planner learns once and is then asked about, in one of three
//! representations.
//!
//! On the wire an environment is an object with `representation`, `name`, and one of `grid`,
//! `roadmap` and `workspace`, so that large lists are read straight into their arrays. The types for
//! that borrow what they write.

use std::borrow::Cow;
use std::f64::consts::FRAC_PI_2;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize, Serializer};

use crate::c;
use crate::lists::Lists;
use crate::memory::{byte_of, digits_of};
use crate::model::{Capabilities, Capability, Heading, Part};

/// The part of the input that stays the same between calls: the map.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(try_from = "EnvironmentWire<'_>")]
#[schemars(with = "EnvironmentWire<'_>")]
pub struct Environment {
    /// The map's name, for messages.
    pub name: String,
    /// A key for caches: equal digests, equal views. Empty when there is none.
    pub digest: String,
    /// The map itself.
    pub view: View,
    /// Further data by name.
    pub parts: Vec<Part>,
}

/// The map in one of its representations.
#[derive(Debug, Clone, PartialEq)]
pub enum View {
    /// Cells, unit time steps.
    Grid(GridEnvironment),
    /// A graph embedded in the plane, continuous time.
    Roadmap(RoadmapEnvironment),
    /// Free space itself, continuous time.
    Workspace(WorkspaceEnvironment),
}

impl From<View> for Environment {
    fn from(view: View) -> Self {
        Self {
            name: String::new(),
            digest: String::new(),
            view,
            parts: Vec::new(),
        }
    }
}

impl From<GridEnvironment> for Environment {
    fn from(grid: GridEnvironment) -> Self {
        View::Grid(grid).into()
    }
}

impl From<RoadmapEnvironment> for Environment {
    fn from(roadmap: RoadmapEnvironment) -> Self {
        View::Roadmap(roadmap).into()
    }
}

impl From<WorkspaceEnvironment> for Environment {
    fn from(workspace: WorkspaceEnvironment) -> Self {
        View::Workspace(workspace).into()
    }
}

impl Environment {
    /// The same map under a name, for messages.
    #[must_use]
    pub fn named(self, name: impl Into<String>) -> Self {
        let name = name.into();
        Self { name, ..self }
    }

    /// The representation's constant of the C ABI.
    pub fn representation(&self) -> i32 {
        match self.view {
            View::Grid(_) => c::REPRESENTATION_GRID,
            View::Roadmap(_) => c::REPRESENTATION_ROADMAP,
            View::Workspace(_) => c::REPRESENTATION_CONTINUOUS,
        }
    }

    /// The grid, if the environment is one.
    pub fn grid(&self) -> Option<&GridEnvironment> {
        match &self.view {
            View::Grid(grid) => Some(grid),
            View::Roadmap(_) | View::Workspace(_) => None,
        }
    }

    /// The roadmap, if the environment is one.
    pub fn roadmap(&self) -> Option<&RoadmapEnvironment> {
        match &self.view {
            View::Roadmap(roadmap) => Some(roadmap),
            View::Grid(_) | View::Workspace(_) => None,
        }
    }

    /// Free space, if the environment is a workspace.
    pub fn workspace(&self) -> Option<&WorkspaceEnvironment> {
        match &self.view {
            View::Workspace(workspace) => Some(workspace),
            View::Grid(_) | View::Roadmap(_) => None,
        }
    }

    /// Number of cells or vertices at which agents can be; `None` in the plane.
    pub fn places(&self) -> Option<usize> {
        match &self.view {
            View::Grid(grid) => Some(grid.passable.len()),
            View::Roadmap(roadmap) => Some(roadmap.vertices()),
            View::Workspace(_) => None,
        }
    }

    /// The middle of a cell or the point of a vertex, if there is such a place.
    pub fn place_m(&self, place: u32) -> Option<[f64; 2]> {
        match &self.view {
            View::Grid(grid) => {
                let (row, col) = (place / grid.cols, place % grid.cols);
                let middle = |index: u32| (f64::from(index) + 0.5) * grid.cell_size_m;
                let [x, y] = grid.origin_m;
                (row < grid.rows).then(|| [x + middle(col), y + middle(grid.rows - row - 1)])
            }
            View::Roadmap(roadmap) => {
                let at = place as usize;
                Some([*roadmap.x_m.get(at)?, *roadmap.y_m.get(at)?])
            }
            View::Workspace(_) => None,
        }
    }

    /// The capabilities that a plugin must have to learn it.
    pub fn needs(&self) -> Capabilities {
        let needed = match &self.view {
            View::Grid(grid) => {
                let mut needed = vec![Capability::Grid];
                if grid.connectivity != 4 {
                    needed.push(Capability::EightConnected);
                }
                if !grid.is_plain() {
                    needed.push(Capability::MoveMask);
                }
                needed
            }
            View::Roadmap(_) => vec![Capability::Roadmap],
            View::Workspace(_) => vec![Capability::Continuous],
        };
        Capabilities::of(&needed)
    }

    /// Checks that all lists have the lengths that they must have, that numbers are finite and
    /// offsets in order. Gives the reason why not otherwise.
    pub fn check(&self) -> Result<(), String> {
        match &self.view {
            View::Grid(grid) => grid.check(),
            View::Roadmap(roadmap) => roadmap.check(),
            View::Workspace(workspace) => workspace.check(),
        }
    }
}

/// The wire form of an [`Environment`].
#[derive(Serialize, Deserialize, JsonSchema)]
#[schemars(rename = "Environment")]
struct EnvironmentWire<'a> {
    /// `grid`, `roadmap` or `continuous`.
    representation: Cow<'a, str>,
    /// The map's name, for messages.
    #[serde(default)]
    name: Cow<'a, str>,
    /// A key for caches: equal digests, equal views. Left out when there is none.
    #[serde(default, skip_serializing_if = "str::is_empty")]
    digest: Cow<'a, str>,
    /// The map, when the representation is a grid.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    grid: Option<Cow<'a, GridEnvironment>>,
    /// The map, when the representation is a roadmap.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    roadmap: Option<Cow<'a, RoadmapEnvironment>>,
    /// The map, when the representation is continuous.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    workspace: Option<Cow<'a, WorkspaceEnvironment>>,
    /// Further data by name.
    #[serde(default, skip_serializing_if = "<[_]>::is_empty")]
    parts: Cow<'a, [Part]>,
}

impl Serialize for Environment {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut wire = EnvironmentWire {
            representation: "".into(),
            name: (&self.name).into(),
            digest: (&self.digest).into(),
            grid: None,
            roadmap: None,
            workspace: None,
            parts: (&self.parts).into(),
        };
        let representation = match &self.view {
            View::Grid(grid) => {
                wire.grid = Some(Cow::Borrowed(grid));
                "grid"
            }
            View::Roadmap(roadmap) => {
                wire.roadmap = Some(Cow::Borrowed(roadmap));
                "roadmap"
            }
            View::Workspace(workspace) => {
                wire.workspace = Some(Cow::Borrowed(workspace));
                "continuous"
            }
        };
        wire.representation = representation.into();
        wire.serialize(serializer)
    }
}

impl TryFrom<EnvironmentWire<'_>> for Environment {
    type Error = String;

    fn try_from(wire: EnvironmentWire<'_>) -> Result<Self, String> {
        let lacks = |field: &str| format!("an environment without `{field}`");
        let view = match &*wire.representation {
            "grid" => View::Grid(wire.grid.ok_or_else(|| lacks("grid"))?.into_owned()),
            "roadmap" => View::Roadmap(wire.roadmap.ok_or_else(|| lacks("roadmap"))?.into_owned()),
            "continuous" => {
                let workspace = wire.workspace.ok_or_else(|| lacks("workspace"))?;
                View::Workspace(workspace.into_owned())
            }
            other => return Err(format!("the representation `{other}` is unknown")),
        };
        let environment = Self {
            name: wire.name.into_owned(),
            digest: wire.digest.into_owned(),
            view,
            parts: wire.parts.into_owned(),
        };
        environment.check()?;
        Ok(environment)
    }
}

/// Says why a number of a list is no number of the plane, if one is not.
fn finite(what: &str, values: &[f64]) -> Result<(), String> {
    match values.iter().find(|value| !value.is_finite()) {
        Some(value) => Err(format!("`{what}` has {value}, which is not finite")),
        None => Ok(()),
    }
}

fn same_length(what: &str, found: usize, expected: usize) -> Result<(), String> {
    if found == expected {
        return Ok(());
    }
    Err(format!("`{what}` has {found} entries, not {expected}"))
}

/// A grid. On the wire `passable` and `terrain` are lists of row strings.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(try_from = "GridWire")]
#[schemars(with = "GridWire")]
pub struct GridEnvironment {
    /// Number of rows.
    pub rows: u32,
    /// Number of columns.
    pub cols: u32,
    /// 4 or 8 neighbours.
    pub connectivity: u32,
    /// Side of a cell.
    pub cell_size_m: f64,
    /// Duration of one move or wait.
    pub step_s: f64,
    /// The lower left corner of the lower left cell: x to the right and y upwards.
    pub origin_m: [f64; 2],
    /// Row-major: 1 where a robot may stand, else 0.
    pub passable: Vec<u8>,
    /// Row-major terrain letters as in the map file.
    pub terrain: Vec<u8>,
    /// Row-major masks of the moves that are allowed, complete, bit i for letter i of `NESWnesw`
    /// ([`c::MOVE_NORTH`] and so on).
    pub moves: Vec<u8>,
}

impl GridEnvironment {
    /// A grid without a name, of cells of 1 m and steps of 1 s, on which every move to a free
    /// neighbour is allowed; `passable` has an entry for each cell, row by row.
    pub fn new(rows: u32, cols: u32, connectivity: u32, passable: Vec<u8>) -> Self {
        Self {
            rows,
            cols,
            connectivity,
            cell_size_m: 1.0,
            step_s: 1.0,
            origin_m: [0.0, 0.0],
            terrain: passable
                .iter()
                .map(|free| if *free == 0 { b'@' } else { b'.' })
                .collect(),
            moves: plain_moves(rows, cols, connectivity, &passable),
            passable,
        }
    }

    /// A four-connected grid as [`GridEnvironment::new`] makes it.
    pub fn four_connected(rows: u32, cols: u32, passable: Vec<u8>) -> Self {
        Self::new(rows, cols, 4, passable)
    }

    /// True if every move to a free neighbour is allowed, so that `passable` says it all.
    pub fn is_plain(&self) -> bool {
        self.moves == plain_moves(self.rows, self.cols, self.connectivity, &self.passable)
    }

    fn check(&self) -> Result<(), String> {
        let Self { rows, cols, .. } = self;
        let cells = (*rows as usize).checked_mul(*cols as usize);
        let Some(cells) = cells.filter(|cells| (1..=u32::MAX as usize).contains(cells)) else {
            return Err(format!(
                "a grid of {rows} rows and {cols} columns has no cell or too many"
            ));
        };
        if ![4, 8].contains(&self.connectivity) {
            return Err(format!(
                "a cell has 4 or 8 neighbours, not {}",
                self.connectivity
            ));
        }
        same_length("passable", self.passable.len(), cells)?;
        same_length("terrain", self.terrain.len(), cells)?;
        same_length("moves", self.moves.len(), cells)?;
        finite("cell_size_m, step_s", &[self.cell_size_m, self.step_s])?;
        finite("origin_m", &self.origin_m)?;
        let plain = plain_moves(*rows, *cols, self.connectivity, &self.passable);
        let mut masks = self.moves.iter().zip(&plain);
        match masks.position(|(mask, plain)| mask & !plain != 0) {
            Some(cell) => Err(format!(
                "`moves` allows a move from cell {cell} that leads off the free cells"
            )),
            None => Ok(()),
        }
    }
}

/// The masks of a grid on which every move to a free neighbour is allowed, corners seen to.
pub fn plain_moves(rows: u32, cols: u32, connectivity: u32, passable: &[u8]) -> Vec<u8> {
    let (rows, cols) = (i64::from(rows), i64::from(cols));
    let free = |row: i64, col: i64| {
        (0..rows).contains(&row)
            && (0..cols).contains(&col)
            && passable
                .get((row * cols + col) as usize)
                .is_some_and(|free| *free != 0)
    };
    let mut masks = Vec::with_capacity(passable.len());
    for row in 0..rows {
        for col in 0..cols {
            if !free(row, col) {
                masks.push(0);
                continue;
            }
            let [north, east, south, west] = [
                free(row - 1, col),
                free(row, col + 1),
                free(row + 1, col),
                free(row, col - 1),
            ];
            let mut mask = 0;
            let mut allow = |allowed: bool, bit: u8| mask |= if allowed { bit } else { 0 };
            allow(north, c::MOVE_NORTH);
            allow(east, c::MOVE_EAST);
            allow(south, c::MOVE_SOUTH);
            allow(west, c::MOVE_WEST);
            if connectivity == 8 {
                allow(north && east && free(row - 1, col + 1), c::MOVE_NORTH_EAST);
                allow(south && east && free(row + 1, col + 1), c::MOVE_SOUTH_EAST);
                allow(south && west && free(row + 1, col - 1), c::MOVE_SOUTH_WEST);
                allow(north && west && free(row - 1, col - 1), c::MOVE_NORTH_WEST);
            }
            masks.push(mask);
        }
    }
    masks
}

#[derive(Serialize, Deserialize, JsonSchema)]
#[schemars(rename = "Grid")]
struct GridWire {
    /// Number of rows.
    rows: u32,
    /// Number of columns.
    cols: u32,
    /// 4 or 8 neighbours.
    connectivity: u32,
    /// Side of a cell.
    cell_size_m: f64,
    /// Duration of one move or wait.
    step_s: f64,
    /// The lower left corner of the lower left cell, `[x, y]`.
    #[serde(default)]
    origin_m: [f64; 2],
    /// One string a row, `.` where a robot may stand and `@` elsewhere.
    passable: Vec<String>,
    /// One string a row of terrain letters as in the map file; left out when it
    /// says no more than `passable`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    terrain: Vec<String>,
    /// One string a row with two hexadecimal digits a cell: the mask of its allowed moves, bit i
    /// for letter i of `NESWnesw`. Left out when every move to a free neighbour is allowed.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    moves: Vec<String>,
}

impl Serialize for GridEnvironment {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        GridWire::from(self).serialize(serializer)
    }
}

impl From<&GridEnvironment> for GridWire {
    fn from(grid: &GridEnvironment) -> Self {
        let cols = (grid.cols as usize).max(1);
        let free = |byte: &u8| if *byte == 0 { '@' } else { '.' };
        let passable: Vec<String> = grid
            .passable
            .chunks(cols)
            .map(|row| row.iter().map(free).collect())
            .collect();
        let terrain: Vec<String> = grid
            .terrain
            .chunks(cols)
            .map(|row| row.iter().copied().map(char::from).collect())
            .collect();
        let moves = if grid.is_plain() {
            Vec::new()
        } else {
            let hex = |row: &[u8]| {
                let digits = row.iter().copied().flat_map(digits_of);
                digits.map(char::from).collect()
            };
            grid.moves.chunks(cols).map(hex).collect()
        };
        Self {
            rows: grid.rows,
            cols: grid.cols,
            connectivity: grid.connectivity,
            cell_size_m: grid.cell_size_m,
            step_s: grid.step_s,
            origin_m: grid.origin_m,
            terrain: if terrain == passable {
                Vec::new()
            } else {
                terrain
            },
            passable,
            moves,
        }
    }
}

impl TryFrom<GridWire> for GridEnvironment {
    type Error = String;

    fn try_from(wire: GridWire) -> Result<Self, String> {
        if wire.rows == 0 || wire.cols == 0 {
            return Err(format!(
                "a grid of {} rows and {} columns has no cell",
                wire.rows, wire.cols
            ));
        }
        let flatten = |what: &str, rows: &[String], letters: usize| {
            let whole = rows.len() == wire.rows as usize
                && rows
                    .iter()
                    .all(|row| row.is_ascii() && row.len() == wire.cols as usize * letters);
            if whole {
                Ok(rows.concat().into_bytes())
            } else {
                Err(format!(
                    "`{what}` is not {} rows of {} letters",
                    wire.rows,
                    wire.cols as usize * letters
                ))
            }
        };
        let letters = flatten("passable", &wire.passable, 1)?;
        let terrain = if wire.terrain.is_empty() {
            letters.clone()
        } else {
            flatten("terrain", &wire.terrain, 1)?
        };
        let passable: Vec<u8> = letters
            .iter()
            .map(|letter| u8::from(*letter == b'.'))
            .collect();
        let moves = if wire.moves.is_empty() {
            plain_moves(wire.rows, wire.cols, wire.connectivity, &passable)
        } else {
            let hex = flatten("moves", &wire.moves, 2)?;
            let (pairs, _) = hex.as_chunks::<2>();
            let masks: Option<Vec<u8>> = pairs.iter().map(|pair| byte_of(*pair)).collect();
            masks.ok_or("`moves` has other letters than hexadecimal digits")?
        };
        Ok(Self {
            rows: wire.rows,
            cols: wire.cols,
            connectivity: wire.connectivity,
            cell_size_m: wire.cell_size_m,
            step_s: wire.step_s,
            origin_m: wire.origin_m,
            passable,
            terrain,
            moves,
        })
    }
}

/// A roadmap: vertices in the plane, x to the right and y upwards, and directed edges that are
/// driven straight.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(try_from = "RoadmapWire<'_>")]
#[schemars(with = "RoadmapWire<'_>")]
pub struct RoadmapEnvironment {
    /// x of every vertex.
    pub x_m: Vec<f64>,
    /// y of every vertex.
    pub y_m: Vec<f64>,
    /// For each vertex the ends of its edges, ascending.
    pub edges: Lists<u32>,
    /// Length of each edge, in the order of [`Lists::items`].
    pub length_m: Vec<f64>,
    /// Time that each edge takes at full speed, in the same order.
    pub duration_s: Vec<f64>,
    /// Full speed.
    pub speed_m_per_s: f64,
    /// The least distance of two robots' centres at any time: the diameter of the largest
    /// robot's enclosing circle.
    pub separation_m: f64,
    /// The world in which the roadmap lies, for those who want to look.
    pub workspace: Option<WorkspaceEnvironment>,
}

impl RoadmapEnvironment {
    /// A roadmap whose edges take as long as their lengths say at full speed.
    pub fn straight(
        x_m: Vec<f64>,
        y_m: Vec<f64>,
        edges: Lists<u32>,
        speed_m_per_s: f64,
        separation_m: f64,
    ) -> Self {
        let mut length_m = Vec::with_capacity(edges.items().len());
        length_m.extend(straight_lengths(&x_m, &y_m, &edges));
        Self {
            duration_s: length_m
                .iter()
                .map(|length| length / speed_m_per_s)
                .collect(),
            length_m,
            x_m,
            y_m,
            edges,
            speed_m_per_s,
            separation_m,
            workspace: None,
        }
    }

    /// Number of vertices.
    pub fn vertices(&self) -> usize {
        self.x_m.len()
    }

    /// True if each edge can be driven both ways.
    pub fn is_symmetric(&self) -> bool {
        // Edges into a vertex come by here in the order of its own ends: both ascend.
        let mut met = vec![0; self.edges.len()];
        self.edges.iter().enumerate().all(|(from, targets)| {
            targets.iter().all(|to| {
                let Some(back) = self.edges.get(*to as usize) else {
                    return false;
                };
                let at = &mut met[*to as usize];
                *at += 1;
                back.get(*at - 1) == Some(&(from as u32))
            })
        })
    }

    fn check(&self) -> Result<(), String> {
        let vertices = self.vertices();
        if vertices == 0 || vertices > u32::MAX as usize {
            return Err("a roadmap has no vertex or too many".into());
        }
        same_length("y_m", self.y_m.len(), vertices)?;
        same_length("edges", self.edges.len(), vertices)?;
        let edges = self.edges.items().len();
        same_length("length_m", self.length_m.len(), edges)?;
        same_length("duration_s", self.duration_s.len(), edges)?;
        finite("x_m", &self.x_m)?;
        finite("y_m", &self.y_m)?;
        finite("length_m", &self.length_m)?;
        finite("duration_s", &self.duration_s)?;
        let sizes = [self.speed_m_per_s, self.separation_m];
        finite("speed_m_per_s, separation_m", &sizes)?;
        for (vertex, targets) in self.edges.iter().enumerate() {
            if let Some(target) = targets.iter().find(|target| **target as usize >= vertices) {
                return Err(format!(
                    "an edge goes from vertex {vertex} to {target}, but there are {vertices} vertices"
                ));
            }
            if !targets.is_sorted_by(|one, next| one < next) {
                return Err(format!("the edges of vertex {vertex} do not ascend"));
            }
        }
        self.workspace
            .as_ref()
            .map_or(Ok(()), WorkspaceEnvironment::check)
    }
}

/// Euclidean lengths of edges; NaN where an edge leads to no vertex.
fn straight_lengths<'a>(
    x_m: &'a [f64],
    y_m: &'a [f64],
    edges: &'a Lists<u32>,
) -> impl Iterator<Item = f64> + 'a {
    let at = |vertex: usize| match (x_m.get(vertex), y_m.get(vertex)) {
        (Some(x), Some(y)) => [*x, *y],
        _ => [f64::NAN; 2],
    };
    edges.iter().enumerate().flat_map(move |(vertex, targets)| {
        let [x, y] = at(vertex);
        targets.iter().map(move |target| {
            let [to_x, to_y] = at(*target as usize);
            ((to_x - x) * (to_x - x) + (to_y - y) * (to_y - y)).sqrt()
        })
    })
}

#[derive(Serialize, Deserialize, JsonSchema)]
#[schemars(rename = "Roadmap")]
struct RoadmapWire<'a> {
    /// x of every vertex.
    x_m: Cow<'a, [f64]>,
    /// y of every vertex.
    y_m: Cow<'a, [f64]>,
    /// For each vertex the ends of its edges, ascending.
    #[schemars(with = "Vec<Vec<u32>>")]
    edges: Cow<'a, Lists<u32>>,
    /// Full speed.
    speed_m_per_s: f64,
    /// The least distance of two robots' centres at any time.
    separation_m: f64,
    /// Length of each edge, in the order of `edges`. Left out when they are the straight ones.
    #[serde(default, skip_serializing_if = "<[_]>::is_empty")]
    length_m: Cow<'a, [f64]>,
    /// Time that each edge takes at full speed, in the order of `edges`. Left out when it is the
    /// length through the speed.
    #[serde(default, skip_serializing_if = "<[_]>::is_empty")]
    duration_s: Cow<'a, [f64]>,
    /// The world in which the roadmap lies.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    workspace: Option<Cow<'a, WorkspaceEnvironment>>,
}

impl Serialize for RoadmapEnvironment {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let straight = straight_lengths(&self.x_m, &self.y_m, &self.edges);
        let is_straight = straight.eq(self.length_m.iter().copied());
        let even = self
            .length_m
            .iter()
            .map(|length| length / self.speed_m_per_s);
        let is_even = even.eq(self.duration_s.iter().copied());
        let unless = |same, values| {
            if same {
                Cow::default()
            } else {
                Cow::from(values)
            }
        };
        let wire = RoadmapWire {
            x_m: (&self.x_m).into(),
            y_m: (&self.y_m).into(),
            edges: Cow::Borrowed(&self.edges),
            speed_m_per_s: self.speed_m_per_s,
            separation_m: self.separation_m,
            length_m: unless(is_straight, &self.length_m),
            duration_s: unless(is_even, &self.duration_s),
            workspace: self.workspace.as_ref().map(Cow::Borrowed),
        };
        wire.serialize(serializer)
    }
}

impl TryFrom<RoadmapWire<'_>> for RoadmapEnvironment {
    type Error = String;

    fn try_from(wire: RoadmapWire<'_>) -> Result<Self, String> {
        let mut roadmap = Self::straight(
            wire.x_m.into_owned(),
            wire.y_m.into_owned(),
            wire.edges.into_owned(),
            wire.speed_m_per_s,
            wire.separation_m,
        );
        if !wire.length_m.is_empty() {
            let lengths = wire.length_m.iter();
            roadmap.duration_s = lengths.map(|length| length / wire.speed_m_per_s).collect();
            roadmap.length_m = wire.length_m.into_owned();
        }
        if !wire.duration_s.is_empty() {
            roadmap.duration_s = wire.duration_s.into_owned();
        }
        roadmap.workspace = wire.workspace.map(Cow::into_owned);
        Ok(roadmap)
    }
}

/// Free space: bounds without obstacles. x goes right, y up.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(rename = "Workspace")]
pub struct WorkspaceEnvironment {
    /// Lower left corner, `[x, y]`.
    pub min_m: [f64; 2],
    /// Upper right corner, `[x, y]`.
    pub max_m: [f64; 2],
    /// Obstacles that stand: the corners `[x, y]` of simple polygons, counter-clockwise.
    #[serde(default)]
    #[schemars(with = "Vec<Vec<[f64; 2]>>")]
    pub obstacles: Lists<[f64; 2]>,
    /// Obstacles that move.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub movers: Vec<Mover>,
}

/// An obstacle that moves in a known way.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Mover {
    /// Its body.
    pub footprint: Footprint,
    /// `[time_s, x_m, y_m, heading_rad]`, times ascending. It moves linearly between knots and
    /// rests before the first and after the last.
    pub knots: Vec<[f64; 4]>,
}

/// The body of a robot or a mover about its origin: a disc, or a convex polygon.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Footprint {
    /// Radius of the disc; of a polygon, that of the smallest circle about the origin that
    /// encloses it.
    pub radius_m: f64,
    /// Corners `[x, y]` of a convex polygon, counter-clockwise; none for a disc.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub corners_m: Vec<[f64; 2]>,
}

impl Footprint {
    /// A disc.
    pub fn disc(radius_m: f64) -> Self {
        Self {
            radius_m,
            corners_m: Vec::new(),
        }
    }

    pub(crate) fn check(&self) -> Result<(), String> {
        finite("footprint.radius_m", &[self.radius_m])?;
        finite("footprint.corners_m", self.corners_m.as_flattened())?;
        match self.corners_m.len() {
            1 | 2 => Err("a footprint of one or two corners".into()),
            _ => Ok(()),
        }
    }
}

impl WorkspaceEnvironment {
    fn check(&self) -> Result<(), String> {
        finite("min_m", &self.min_m)?;
        finite("max_m", &self.max_m)?;
        finite("obstacles", self.obstacles.items().as_flattened())?;
        if let Some(number) = self.obstacles.iter().position(|corners| corners.len() < 3) {
            return Err(format!("obstacle {number} has fewer than three corners"));
        }
        for (number, mover) in self.movers.iter().enumerate() {
            mover.footprint.check()?;
            finite("movers", mover.knots.as_flattened())?;
            let ascend = mover.knots.is_sorted_by(|one, next| one[0] <= next[0]);
            if mover.knots.is_empty() || !ascend {
                return Err(format!(
                    "mover {number} has no knots, or its times do not ascend"
                ));
            }
        }
        Ok(())
    }
}

impl Heading {
    /// The heading in the plane, counter-clockwise from x: rows grow down, y grows up.
    pub fn radians(self) -> f64 {
        -FRAC_PI_2 * f64::from(self.code())
    }
}
