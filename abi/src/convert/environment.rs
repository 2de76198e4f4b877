//! Environments and what lies in them.

use std::ffi::c_void;
use std::ptr;

use super::{
    Kept, code, copied, flags, invalid, lists, parts, reserved, size_of, string, unsupported, whole,
};
use crate::c;
use crate::environment::{
    Environment, Footprint, GridEnvironment, Mover, RoadmapEnvironment, View, WorkspaceEnvironment,
};
use crate::lists::Lists;
use crate::model::SharedEnvironment;
use crate::sdk::Failure;

/// An environment in its C form, with everything it points to.
pub struct CEnvironment {
    raw: *const c::Environment,
    environment: SharedEnvironment,
    _kept: Kept,
}

// SAFETY: the raw pointers point into what is kept and into the environment, which is shared and
// immutable.
unsafe impl Send for CEnvironment {}

impl CEnvironment {
    /// The C form of an environment.
    pub fn new(environment: &SharedEnvironment) -> Self {
        let environment = SharedEnvironment::clone(environment);
        let mut kept = Kept::default();
        let view: *const c_void = match &environment.view {
            View::Grid(grid) => kept.one(grid_to_c(grid)).cast(),
            View::Roadmap(roadmap) => roadmap_to_c(roadmap, &mut kept).cast(),
            View::Workspace(workspace) => workspace_to_c(workspace, &mut kept).cast(),
        };
        let raw = c::Environment {
            struct_size: size_of::<c::Environment>(),
            representation: environment.representation(),
            view,
            name: c::Str::new(&environment.name),
            digest: c::Str::new(&environment.digest),
            parts: kept.parts(&environment.parts),
        };
        Self {
            raw: kept.one(raw),
            environment,
            _kept: kept,
        }
    }

    /// The structure; valid as long as `self`.
    pub fn raw(&self) -> *const c::Environment {
        self.raw
    }

    /// The environment itself.
    pub fn environment(&self) -> &SharedEnvironment {
        &self.environment
    }
}

fn grid_to_c(grid: &GridEnvironment) -> c::Grid {
    let [origin_x_m, origin_y_m] = grid.origin_m;
    c::Grid {
        struct_size: size_of::<c::Grid>(),
        rows: grid.rows,
        cols: grid.cols,
        connectivity: grid.connectivity,
        cell_size_m: grid.cell_size_m,
        step_s: grid.step_s,
        origin_x_m,
        origin_y_m,
        passable: grid.passable.as_ptr(),
        terrain: grid.terrain.as_ptr(),
        moves: grid.moves.as_ptr(),
    }
}

fn roadmap_to_c(roadmap: &RoadmapEnvironment, kept: &mut Kept) -> *const c::Roadmap {
    let workspace = match &roadmap.workspace {
        Some(workspace) => workspace_to_c(workspace, kept),
        None => ptr::null(),
    };
    let symmetric = roadmap.is_symmetric();
    kept.one(c::Roadmap {
        struct_size: size_of::<c::Roadmap>(),
        vertices: roadmap.vertices() as u32,
        edges: roadmap.edges.items().len() as u64,
        x_m: roadmap.x_m.as_ptr(),
        y_m: roadmap.y_m.as_ptr(),
        edge_offsets: roadmap.edges.offsets().as_ptr(),
        targets: roadmap.edges.items().as_ptr(),
        length_m: roadmap.length_m.as_ptr(),
        duration_s: roadmap.duration_s.as_ptr(),
        speed_m_per_s: roadmap.speed_m_per_s,
        separation_m: roadmap.separation_m,
        workspace,
        flags: if symmetric { c::ROADMAP_SYMMETRIC } else { 0 },
        reserved: 0,
    })
}

/// One number of each point, as a column.
fn column<const N: usize>(points: &[[f64; N]], number: usize, kept: &mut Kept) -> *const f64 {
    let column: Vec<f64> = points.iter().map(|point| point[number]).collect();
    kept.list(column)
}

fn workspace_to_c(workspace: &WorkspaceEnvironment, kept: &mut Kept) -> *const c::Workspace {
    let movers: Vec<*const c::Mover> = workspace
        .movers
        .iter()
        .map(|mover| {
            let [time_s, x_m, y_m, heading_rad] =
                [0, 1, 2, 3].map(|number| column(&mover.knots, number, kept));
            let footprint = footprint_to_c(&mover.footprint, kept);
            kept.one(c::Mover {
                struct_size: size_of::<c::Mover>(),
                knots: mover.knots.len() as u32,
                footprint,
                time_s,
                x_m,
                y_m,
                heading_rad,
            })
        })
        .collect();
    let corners = workspace.obstacles.items();
    let [x_m, y_m] = [0, 1].map(|number| column(corners, number, kept));
    let raw = c::Workspace {
        struct_size: size_of::<c::Workspace>(),
        obstacles: workspace.obstacles.len() as u32,
        min_x_m: workspace.min_m[0],
        min_y_m: workspace.min_m[1],
        max_x_m: workspace.max_m[0],
        max_y_m: workspace.max_m[1],
        corner_offsets: workspace.obstacles.offsets().as_ptr(),
        x_m,
        y_m,
        mover_count: movers.len() as u64,
        movers: kept.list(movers),
    };
    kept.one(raw)
}

pub(super) fn footprint_to_c(footprint: &Footprint, kept: &mut Kept) -> *const c::Footprint {
    let [x_m, y_m] = [0, 1].map(|number| column(&footprint.corners_m, number, kept));
    kept.one(c::Footprint {
        struct_size: size_of::<c::Footprint>(),
        corners: footprint.corners_m.len() as u32,
        radius_m: footprint.radius_m,
        x_m,
        y_m,
    })
}

impl Environment {
    /// Copies from the C form.
    ///
    /// # Safety
    /// As [`checked`](super::checked), and the arrays are as long as the header says.
    pub unsafe fn from_c(pointer: *const c::Environment) -> Result<Self, Failure> {
        // SAFETY: by the caller's promise, here and below.
        let raw = unsafe { whole("environment", pointer)? };
        let known = |code: i32| (1..=3).contains(&code).then_some(code);
        // SAFETY: the code says to what the view points.
        let view = match code("representation", raw.representation, known)? {
            c::REPRESENTATION_GRID => View::Grid(unsafe { grid_from_c(raw.view.cast())? }),
            c::REPRESENTATION_ROADMAP => View::Roadmap(unsafe { roadmap_from_c(raw.view.cast())? }),
            _ => View::Workspace(unsafe { workspace_from_c(raw.view.cast())? }),
        };
        let environment = Self {
            // SAFETY: as promised.
            name: unsafe { string(raw.name) },
            // SAFETY: as promised.
            digest: unsafe { string(raw.digest) },
            view,
            // SAFETY: as promised.
            parts: unsafe { parts(raw.parts)? },
        };
        environment.check().map_err(invalid)?;
        Ok(environment)
    }
}

/// # Safety
/// As [`Environment::from_c`].
unsafe fn grid_from_c(pointer: *const c::Grid) -> Result<GridEnvironment, Failure> {
    // SAFETY: by the caller's promise, here and below.
    let grid = unsafe { whole("grid", pointer)? };
    let cells = (grid.rows as usize)
        .checked_mul(grid.cols as usize)
        .filter(|cells| *cells > 0)
        .ok_or_else(|| invalid("the grid has no cells or too many"))?;
    if ![4, 8].contains(&grid.connectivity) {
        return Err(unsupported(format!(
            "{} neighbours are unknown",
            grid.connectivity
        )));
    }
    // SAFETY: as promised.
    let bytes = |name, pointer| unsafe { copied(name, pointer, cells) };
    Ok(GridEnvironment {
        rows: grid.rows,
        cols: grid.cols,
        connectivity: grid.connectivity,
        cell_size_m: grid.cell_size_m,
        step_s: grid.step_s,
        origin_m: [grid.origin_x_m, grid.origin_y_m],
        passable: bytes("grid.passable", grid.passable)?,
        terrain: bytes("grid.terrain", grid.terrain)?,
        moves: bytes("grid.moves", grid.moves)?,
    })
}

/// # Safety
/// As [`Environment::from_c`].
unsafe fn roadmap_from_c(pointer: *const c::Roadmap) -> Result<RoadmapEnvironment, Failure> {
    // SAFETY: by the caller's promise, here and below.
    let roadmap = unsafe { whole("roadmap", pointer)? };
    reserved("roadmap", roadmap.reserved)?;
    flags("roadmap", roadmap.flags, c::ROADMAP_SYMMETRIC)?;
    let vertices = roadmap.vertices as usize;
    let names = ["roadmap.edge_offsets", "roadmap.targets"];
    // SAFETY: as promised.
    let edges = unsafe {
        lists(
            names,
            roadmap.edge_offsets,
            roadmap.targets,
            vertices,
            usize::MAX,
        )?
    };
    let count = edges.items().len();
    if count as u64 != roadmap.edges {
        return Err(invalid(format!(
            "roadmap.edge_offsets end at {count}, but there are {} edges",
            roadmap.edges
        )));
    }
    let workspace = if roadmap.workspace.is_null() {
        None
    } else {
        // SAFETY: as promised.
        Some(unsafe { workspace_from_c(roadmap.workspace)? })
    };
    // SAFETY: as promised.
    let numbers = |name, pointer, len| unsafe { copied(name, pointer, len) };
    Ok(RoadmapEnvironment {
        x_m: numbers("roadmap.x_m", roadmap.x_m, vertices)?,
        y_m: numbers("roadmap.y_m", roadmap.y_m, vertices)?,
        edges,
        length_m: numbers("roadmap.length_m", roadmap.length_m, count)?,
        duration_s: numbers("roadmap.duration_s", roadmap.duration_s, count)?,
        speed_m_per_s: roadmap.speed_m_per_s,
        separation_m: roadmap.separation_m,
        workspace,
    })
}

/// # Safety
/// As [`Environment::from_c`].
unsafe fn workspace_from_c(pointer: *const c::Workspace) -> Result<WorkspaceEnvironment, Failure> {
    // SAFETY: by the caller's promise, here and below.
    let raw = unsafe { whole("workspace", pointer)? };
    let obstacles = raw.obstacles as usize;
    let names = ["workspace.corner_offsets", "workspace.x_m"];
    // SAFETY: as promised.
    let x_m = unsafe { lists(names, raw.corner_offsets, raw.x_m, obstacles, usize::MAX)? };
    // SAFETY: as promised.
    let y_m = unsafe { copied("workspace.y_m", raw.y_m, x_m.items().len())? };
    let corners = x_m.items().iter().zip(y_m).map(|(x, y)| [*x, y]).collect();
    let obstacles = Lists::from_flat(x_m.offsets().to_vec(), corners);
    let count = raw.mover_count as usize;
    // SAFETY: as promised.
    let movers = unsafe { copied("workspace.movers", raw.movers, count)? };
    Ok(WorkspaceEnvironment {
        min_m: [raw.min_x_m, raw.min_y_m],
        max_m: [raw.max_x_m, raw.max_y_m],
        obstacles: obstacles.unwrap_or_default(),
        movers: movers
            .into_iter()
            // SAFETY: as promised.
            .map(|mover| unsafe { mover_from_c(mover) })
            .collect::<Result<_, _>>()?,
    })
}

/// # Safety
/// As [`Environment::from_c`].
unsafe fn mover_from_c(pointer: *const c::Mover) -> Result<Mover, Failure> {
    // SAFETY: by the caller's promise, here and below.
    let mover = unsafe { whole("mover", pointer)? };
    let len = mover.knots as usize;
    let columns = [
        ("mover.time_s", mover.time_s),
        ("mover.x_m", mover.x_m),
        ("mover.y_m", mover.y_m),
        ("mover.heading_rad", mover.heading_rad),
    ];
    let mut knots = vec![[0.0; 4]; len];
    for (number, (name, pointer)) in columns.into_iter().enumerate() {
        // SAFETY: as promised.
        let column = unsafe { copied(name, pointer, len)? };
        for (knot, value) in knots.iter_mut().zip(column) {
            knot[number] = value;
        }
    }
    Ok(Mover {
        // SAFETY: as promised.
        footprint: unsafe { footprint_from_c(mover.footprint)? },
        knots,
    })
}

/// # Safety
/// As [`Environment::from_c`].
pub(super) unsafe fn footprint_from_c(pointer: *const c::Footprint) -> Result<Footprint, Failure> {
    // SAFETY: by the caller's promise, here and below.
    let raw = unsafe { whole("footprint", pointer)? };
    let corners = raw.corners as usize;
    // SAFETY: as promised.
    let x_m = unsafe { copied("footprint.x_m", raw.x_m, corners)? };
    // SAFETY: as promised.
    let y_m = unsafe { copied("footprint.y_m", raw.y_m, corners)? };
    Ok(Footprint {
        radius_m: raw.radius_m,
        corners_m: x_m.into_iter().zip(y_m).map(|(x, y)| [x, y]).collect(),
    })
}
