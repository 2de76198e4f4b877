//! `fleetyard world`: derives grids and roadmaps of a task's world, and worlds of maps.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};
use fleetyard_core::{
    Connectivity, Digest, Scenario, Separation, cell_center_m, load_map, save_map, save_roadmap,
    save_scen, words, write_atomically,
};
use fleetyard_view::{Picture, World};
use fleetyard_views::{
    Builder, GridSpec, Problem, RoadmapSpec, Sampling, grid_to_world, load_problem, world_to_grid,
    world_to_roadmap,
};
use fleetyard_world::save_workspace;
use serde::Serialize;

use crate::args::{Format, connectivity, picture, word};
use crate::exit::{Exit, Failure, Result, internal};

use crate::files::{draw, file_name};
use crate::output;

#[derive(Debug, Subcommand)]
pub(crate) enum Worlds {
    /// Describe a task's world, its robots and its agents
    Info {
        /// Task file
        task: PathBuf,
        /// Format of the result
        #[arg(long, value_enum, default_value = "text")]
        format: Format,
    },
    /// Make a grid of a task's world: a map, a scenario, and how they came about
    Grid(GridArgs),
    /// Make a roadmap of a task's world, and how it came about
    Roadmap(RoadmapArgs),
    /// Make a world file of a map: blocked cells become polygons
    Convert {
        /// Map file: MovingAI, fleetyard.grid/1 or LSMART
        map: PathBuf,
        /// World file to write
        out: PathBuf,
        /// Side of a cell in metres
        #[arg(long, value_name = "METRES", default_value_t = 1.0)]
        cell_size: f64,
    },
}

/// Folder and name of a derived view.
#[derive(Debug, Args)]
pub(crate) struct ViewOut {
    /// Folder to write to
    #[arg(long, value_name = "FOLDER", default_value = ".")]
    out: PathBuf,
    /// Name of the files without their ends; that of the task file if it is not given
    #[arg(long, value_name = "NAME")]
    name: Option<String>,
    /// Draw the view over the world, as FILE.svg or FILE.png
    #[arg(long, value_name = "FILE", value_parser = picture)]
    picture: Option<PathBuf>,
    /// Format of the result
    #[arg(long, value_enum, default_value = "text")]
    format: Format,
}

#[derive(Debug, Args)]
pub(crate) struct GridArgs {
    /// Task file
    #[arg(group = "cells")]
    task: PathBuf,
    #[command(flatten)]
    spec: GridSpecArgs,
    #[command(flatten)]
    out: ViewOut,
}

/// Moves and distances on a grid. The argument that says whose cells these are is in the group `cells`.
#[derive(Debug, Args)]
#[group(requires = "cells")]
pub(super) struct GridSpecArgs {
    /// Neighbours of a cell: 4 or 8
    #[arg(long, value_name = "N", default_value = "4", value_parser = connectivity)]
    pub(super) connectivity: Connectivity,
    /// Distance of robots that keep the rules of the grid
    #[arg(long, value_parser = word::<Separation>(), default_value_t)]
    pub(super) separation: Separation,
}

impl GridSpecArgs {
    pub(super) fn spec(&self) -> GridSpec {
        GridSpec {
            connectivity: self.connectivity,
            separation: self.separation,
        }
    }
}

#[derive(Debug, Args)]
pub(crate) struct RoadmapArgs {
    /// Task file
    task: PathBuf,
    #[command(flatten)]
    spec: RoadmapSpecArgs,
    /// Seed of the drawing; the task's if it is not given
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    #[command(flatten)]
    out: ViewOut,
}

/// The parameters of a roadmap but for its seed, whose name other seeds may need.
#[derive(Debug, Args)]
#[group(requires = "task")]
pub(super) struct RoadmapSpecArgs {
    #[command(flatten)]
    builder: BuilderArgs,
    /// Least distance of drawn vertices in metres; twice the largest robot's radius if it is not given,
    /// and less where so many vertices find no room
    #[arg(long, value_name = "METRES")]
    spacing: Option<f64>,
    /// Common speed in m/s; if it is not given, the largest that every robot has in every direction
    #[arg(long, value_name = "M_PER_S")]
    speed: Option<f64>,
}

impl RoadmapSpecArgs {
    pub(super) fn spec(&self, seed: Option<u64>) -> RoadmapSpec {
        RoadmapSpec {
            builder: self.builder.builder(),
            spacing_m: self.spacing,
            seed,
            speed_m_per_s: self.speed,
        }
    }
}

/// The construction of a roadmap.
#[derive(Debug, Args)]
#[group(requires = "task")]
struct BuilderArgs {
    /// Construction of vertices and edges
    #[arg(long, value_parser = word::<BuilderKind>(), default_value_t)]
    builder: BuilderKind,
    /// A density: S, D or SD are 160, 900 or 4000 vertices with 5, 9 or 14 neighbours
    #[arg(long, value_name = "NAME", value_parser = ["S", "D", "SD"],
          conflicts_with_all = ["vertices", "neighbors", "builder"])]
    density: Option<String>,
    /// Drawn vertices, beside starts and goals
    #[arg(long, value_name = "N", default_value_t = 900)]
    vertices: usize,
    /// Neighbours with which a vertex is joined, if it sees them
    #[arg(long, value_name = "N", default_value_t = 9)]
    neighbors: usize,
    /// Origin of drawn vertices
    #[arg(long, value_parser = word::<Sampling>(), default_value_t)]
    sampling: Sampling,
    /// Distance of a lattice's neighbours in metres
    #[arg(long, value_name = "METRES", required_if_eq("builder", "lattice"))]
    side: Option<f64>,
    /// Directions of a lattice's edges: 4, 8, 16 or 32
    #[arg(long, value_name = "N", default_value_t = 8)]
    directions: u32,
    /// Sides of the polygons that stand for circles round corners, for tangent graphs
    #[arg(long, value_name = "N", default_value_t = 16)]
    sides: u32,
}

/// The builders by their words.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum BuilderKind {
    #[default]
    Prm,
    PrmStar,
    Lattice,
    Delaunay,
    Tangent,
}

words!(BuilderKind {
    Prm = "prm", "Drawn vertices, each joined with its nearest that it sees";
    PrmStar = "prm-star", "The same with as many neighbours as make shortest paths converge to the optimum";
    Lattice = "lattice", "A square lattice";
    Delaunay = "delaunay", "The Delaunay triangulation of drawn vertices";
    Tangent = "tangent", "Corners of obstacles and the lines that bend round them: misses no passage";
});

impl BuilderArgs {
    fn builder(&self) -> Builder {
        let (sampling, vertices) = (self.sampling, self.vertices);
        if let Some(known) = self.density.as_deref().and_then(Builder::preset) {
            return known;
        }
        match self.builder {
            BuilderKind::Prm => Builder::Prm {
                sampling,
                vertices,
                neighbors: self.neighbors,
            },
            BuilderKind::PrmStar => Builder::PrmStar { sampling, vertices },
            BuilderKind::Delaunay => Builder::Delaunay { sampling, vertices },
            // The parser asks for it.
            BuilderKind::Lattice => Builder::Lattice {
                side_m: self.side.unwrap_or(f64::NAN),
                directions: self.directions,
            },
            BuilderKind::Tangent => Builder::Tangent { sides: self.sides },
        }
    }
}

pub(crate) fn worlds(what: &Worlds) -> Result<Exit> {
    match what {
        Worlds::Info { task, format } => info(task, *format),
        Worlds::Grid(arguments) => grid(arguments),
        Worlds::Roadmap(arguments) => roadmap(arguments),
        Worlds::Convert {
            map,
            out,
            cell_size,
        } => {
            let grid = load_map(map)?;
            save_workspace(&grid_to_world(&grid, *cell_size, [0.0, 0.0])?, out)?;
            output::print(&out.display().to_string())?;
            Ok(Exit::Success)
        }
    }
}

/// A task as its user sees it.
#[derive(Serialize)]
struct Info {
    name: String,
    bounds_m: [f64; 4],
    obstacles: usize,
    corners: usize,
    movers: usize,
    agents: usize,
    robots: usize,
    r_com_m: f64,
    world_digest: Digest,
    problem_digest: Digest,
}

fn info(task: &Path, format: Format) -> Result<Exit> {
    let problem = load_problem(task)?;
    let world = &problem.world;
    let [min, max] = [world.bounds.min, world.bounds.max];
    let info = Info {
        name: name_of(&problem, task),
        bounds_m: [min[0], min[1], max[0], max[1]],
        obstacles: world.obstacles.len(),
        corners: world
            .obstacles
            .iter()
            .map(|polygon| polygon.vertices().len())
            .sum(),
        movers: world.movers.len(),
        agents: problem.task.agents.len(),
        robots: problem.fleet.profiles().len(),
        r_com_m: problem.common_radius_m(),
        world_digest: world.digest(),
        problem_digest: problem.digest(),
    };
    if format == Format::Json {
        output::print_json(&info)?;
        return Ok(Exit::Success);
    }
    let mut text = String::new();
    let mut line = |what: &str, value: String| {
        let _ = writeln!(text, "{what:<17} {value}");
    };
    line("name", info.name);
    line(
        "size",
        format!("{} × {} m", max[0] - min[0], max[1] - min[1]),
    );
    line(
        "obstacles",
        format!("{} with {} corners", info.obstacles, info.corners),
    );
    line("moving obstacles", info.movers.to_string());
    line(
        "agents",
        format!("{} of {} kinds of robots", info.agents, info.robots),
    );
    line(
        "largest robot",
        format!("{} m from its centre to its farthest point", info.r_com_m),
    );
    line("world digest", info.world_digest.to_string());
    line("problem digest", info.problem_digest.to_string());
    output::print(text.trim_end())?;
    Ok(Exit::Success)
}

fn name_of(problem: &Problem, task: &Path) -> String {
    if !problem.task.name.is_empty() {
        return problem.task.name.clone();
    }
    let name = file_name(task);
    name.trim_end_matches(".task.json").to_owned()
}

impl ViewOut {
    /// The path of a file of the view, by its end.
    fn file(&self, task: &Path, end: &str) -> Result<PathBuf> {
        let of_task = file_name(task);
        let name = match &self.name {
            Some(name) => name.as_str(),
            None => of_task.trim_end_matches(".json").trim_end_matches(".task"),
        };
        if name.is_empty() || name.starts_with('.') || name.contains(['/', '\\', '\0']) {
            let message = format!("--name: {name:?} cannot be the name of a file");
            return Err(Failure::new(Exit::Usage, message)
                .hint("files are named after it: write one without folders"));
        }
        Ok(self.out.join(format!("{name}.{end}")))
    }

    /// Writes how a view came about, and says which files there are.
    fn finish<T: Serialize>(
        &self,
        task: &Path,
        end: &str,
        view: &T,
        mut files: Vec<PathBuf>,
        text: &str,
    ) -> Result<Exit> {
        let about = self.file(task, end)?;
        let mut json = serde_json::to_vec_pretty(view).map_err(internal)?;
        json.push(b'\n');
        write_atomically(&about, &json)?;
        files.push(about);
        match self.format {
            Format::Json => output::print_json(view)?,
            Format::Text => {
                let mut lines = text.to_owned();
                for file in files {
                    let _ = writeln!(lines, "{:<17} {}", "written", file.display());
                }
                output::print(lines.trim_end())?;
            }
        }
        Ok(Exit::Success)
    }
}

fn grid(arguments: &GridArgs) -> Result<Exit> {
    let (task, out) = (&arguments.task, &arguments.out);
    let problem = load_problem(task)?;
    let view = world_to_grid(&problem, arguments.spec.spec())?;
    let (instance, grid) = (&view.instance, view.instance.grid());
    let (map, scen) = (out.file(task, "map")?, out.file(task, "scen")?);
    let ends = instance
        .starts()
        .iter()
        .copied()
        .zip(instance.goals().iter().copied());
    save_map(grid, &map)?;
    save_scen(&Scenario::of(grid, &file_name(&map), ends), &scen)?;
    if let Some(path) = &out.picture {
        let world = World::of_grid(grid, view.cell_m);
        let at = |cell: &u32| cell_center_m(grid, view.cell_m, *cell).into();
        let starts = instance.starts().iter().map(at);
        let goals = instance.goals().iter().map(at);
        draw(path, &Picture::new(&world).ends(starts.zip(goals)))?;
    }
    let snapped = view
        .snapped_m
        .iter()
        .flatten()
        .fold(0.0_f64, |most, far| most.max(*far));
    let mut text = String::new();
    let mut line = |what: &str, value: String| {
        let _ = writeln!(text, "{what:<17} {value}");
    };
    line(
        "cells",
        format!("{} × {} of {} m", grid.rows(), grid.cols(), view.cell_m),
    );
    line(
        "free",
        format!("{} of {}", grid.passable_count(), grid.cell_count()),
    );
    line(
        "snapped",
        format!("starts and goals by {snapped:.3} m at most"),
    );
    line("instance digest", instance.digest().to_string());
    out.finish(task, "grid.json", &view.about(), vec![map, scen], &text)
}

fn roadmap(arguments: &RoadmapArgs) -> Result<Exit> {
    let (task, out) = (&arguments.task, &arguments.out);
    let problem = load_problem(task)?;
    let view = world_to_roadmap(&problem, arguments.spec.spec(arguments.seed))?;
    let file = out.file(task, "roadmap.json")?;
    save_roadmap(&view.roadmap, &file)?;
    if let Some(path) = &out.picture {
        let world = World::of_workspace(&problem.world).roadmap(&view.roadmap);
        let agents = &problem.task.agents;
        let ends = agents
            .iter()
            .map(|agent| (agent.start.at_m(), agent.goal.at_m()));
        draw(path, &Picture::new(&world).ends(ends))?;
    }
    let report = &view.report;
    let mut text = String::new();
    let mut line = |what: &str, value: String| {
        let _ = writeln!(text, "{what:<17} {value}");
    };
    line("vertices", report.vertices.to_string());
    line(
        "edges",
        format!("{}, {:.3} m on average", report.edges, report.mean_edge_m),
    );
    line(
        "parts",
        match report.parts {
            1 => "1: every vertex can be reached from every other".to_owned(),
            parts => format!(
                "{parts}, the largest with {} vertices; every agent reaches its goal",
                report.largest_part
            ),
        },
    );
    if let Some(spacing) = report.spacing_m {
        line(
            "spacing",
            format!("{spacing:.4} m between drawn vertices at least"),
        );
    }
    line(
        "close vertices",
        format!(
            "{} pairs nearer than {:.4} m, two robots' radii",
            report.close_pairs,
            2.0 * view.radius_m
        ),
    );
    if let Some(coverage) = report.coverage {
        line(
            "coverage",
            format!(
                "{:.1} % of the free space sees a vertex nearby",
                100.0 * coverage
            ),
        );
    }
    line("speed", format!("{} m/s", view.speed_m_per_s));
    line("view digest", view.digest().to_string());
    out.finish(task, "view.json", &view.about(), vec![file], &text)
}
