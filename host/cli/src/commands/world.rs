//! `fleetyard world`: derives grids and roadmaps of a task's world, and one kind of view from another.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};
use fleetyard_core::{
    Connectivity, Digest, InputError, Roadmap, Scenario, Separation, cell_center_m, load_map,
    load_roadmap, map_bytes, words, write_all_atomically, write_roadmap, write_scen,
};
use fleetyard_view::{Picture, World};
use fleetyard_views::{
    Builder, BuilderKind, GridSpec, GridView, OverlayReport, OverlaySpec, Place, Problem,
    RoadmapParameters, RoadmapSpec, Sampling, grid_to_roadmap, grid_to_world, load_problem,
    roadmap_to_grid, roadmap_to_world, world_to_grid, world_to_roadmap,
};
use fleetyard_world::write_workspace;
use serde::Serialize;
use serde_json::Value;

use super::convert::refuse_input;
use crate::args::{Format, VIEW, connectivity, picture, word};
use crate::exit::{Exit, Result, internal};
use crate::files::{check_name, drawn, file_name};
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
    /// Make a grid of a task's world or of a roadmap: a map, a scenario, and how they came about
    Grid(GridArgs),
    /// Make a roadmap of a task's world, or check one in it, and how it came about
    Roadmap(RoadmapArgs),
    /// Make a world or a roadmap of a map, and how it came about
    Convert(ConvertArgs),
}

#[derive(Debug, Args)]
pub(crate) struct ConvertArgs {
    /// Map file: MovingAI, fleetyard.grid/1 or LSMART
    map: PathBuf,
    /// File to write; beside it, under its name with the end `.view.json`, how it came about
    out: PathBuf,
    /// World, in which blocked cells are polygons, or roadmap, in which free cells are vertices
    #[arg(long, value_parser = word::<Made>(), default_value_t)]
    to: Made,
    /// Side of a cell in metres
    #[arg(long, value_name = "METRES", default_value_t = 1.0)]
    cell_size: f64,
    /// Neighbours of a cell in a roadmap: 4 or 8
    #[arg(long, value_name = "N", default_value = "4", value_parser = connectivity)]
    connectivity: Connectivity,
}

/// The views of a map.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum Made {
    #[default]
    World,
    Roadmap,
}

words!(Made {
    World = "world", "Blocked cells, merged into rectangles, are the obstacles";
    Roadmap = "roadmap", "Free cells are vertices, allowed moves are edges";
});

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
    /// Roadmap file: the edges become moves, and nothing else is one
    #[arg(long, value_name = "FILE")]
    roadmap: Option<PathBuf>,
    /// Side of a cell in metres, for the grid of a roadmap; that of the separation if it is not given
    #[arg(long, value_name = "METRES", requires = "roadmap")]
    cell_size: Option<f64>,
    #[command(flatten)]
    out: ViewOut,
}

/// Moves and distances on a grid. The argument that says whose cells these are is in the group `cells`.
#[derive(Debug, Args)]
#[group(requires = "cells")]
pub(super) struct GridSpecArgs {
    /// Neighbours of a cell: 4 or 8
    #[arg(long, help_heading = VIEW, value_name = "N", default_value = "4", value_parser = connectivity)]
    pub(super) connectivity: Connectivity,
    /// Distance of robots that keep the rules of the grid
    #[arg(long, help_heading = VIEW, value_parser = word::<Separation>(), default_value_t)]
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
    /// Roadmap file: sweep every robot along its edges in place of making one
    #[arg(long, value_name = "FILE", conflicts_with_all = ["builder", "density", "vertices", "neighbors",
          "sampling", "side", "directions", "sides", "spacing", "seed", "speed"])]
    check: Option<PathBuf>,
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
    #[arg(long, help_heading = VIEW, value_name = "METRES")]
    spacing: Option<f64>,
    /// Common speed in m/s; if it is not given, the largest that every robot has in every direction
    #[arg(long, help_heading = VIEW, value_name = "M_PER_S")]
    speed: Option<f64>,
}

impl RoadmapSpecArgs {
    /// The common speed in m/s, if one is asked for.
    pub(super) fn speed(&self) -> Option<f64> {
        self.speed
    }

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
    #[arg(long, help_heading = VIEW, value_parser = word::<BuilderKind>(), default_value_t)]
    builder: BuilderKind,
    /// A density: S, D or SD are 160, 900 or 4000 vertices with 5, 9 or 14 neighbours
    #[arg(long, help_heading = VIEW, value_name = "NAME", value_parser = ["S", "D", "SD"],
          conflicts_with_all = ["vertices", "neighbors", "builder"])]
    density: Option<String>,
    /// Drawn vertices, beside starts and goals
    #[arg(long, help_heading = VIEW, value_name = "N", default_value_t = RoadmapParameters::default().vertices)]
    vertices: usize,
    /// Neighbours with which a vertex is joined, if it sees them
    #[arg(long, help_heading = VIEW, value_name = "N", default_value_t = RoadmapParameters::default().neighbors)]
    neighbors: usize,
    /// Origin of drawn vertices
    #[arg(long, help_heading = VIEW, value_parser = word::<Sampling>(), default_value_t)]
    sampling: Sampling,
    /// Distance of a lattice's neighbours in metres
    #[arg(long, help_heading = VIEW, value_name = "METRES", required_if_eq("builder", "lattice"))]
    side: Option<f64>,
    /// Directions of a lattice's edges: 4, 8, 16 or 32
    #[arg(long, help_heading = VIEW, value_name = "N", default_value_t = RoadmapParameters::default().directions)]
    directions: u32,
    /// Sides of the polygons that stand for circles round corners, for tangent graphs
    #[arg(long, help_heading = VIEW, value_name = "N", default_value_t = RoadmapParameters::default().sides)]
    sides: u32,
}

impl BuilderArgs {
    fn builder(&self) -> Builder {
        let known = self.density.as_deref().and_then(Builder::preset);
        let parameters = RoadmapParameters {
            kind: self.builder,
            vertices: self.vertices,
            neighbors: self.neighbors,
            sampling: self.sampling,
            side_m: self.side,
            directions: self.directions,
            sides: self.sides,
            ..RoadmapParameters::default()
        };
        known.unwrap_or_else(|| parameters.builder())
    }
}

pub(crate) fn worlds(what: &Worlds) -> Result<Exit> {
    match what {
        Worlds::Info { task, format } => info(task, *format),
        Worlds::Grid(arguments) => grid(arguments),
        Worlds::Roadmap(arguments) => roadmap(arguments),
        Worlds::Convert(arguments) => convert(arguments),
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
        name: problem.task.title().to_owned(),
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
    let mut line = |label: &str, value: String| output::labelled(&mut text, label, value);
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

/// The name of files that are derived from one, without the ends that it may have.
fn stem(file: &Path, ends: &[&str]) -> String {
    let name = file_name(file);
    let short = ends
        .iter()
        .fold(name.as_str(), |name, end| name.trim_end_matches(end));
    short.to_owned()
}

fn of_task(task: &Path) -> String {
    stem(task, &[".json", ".task"])
}

/// Files that are written when the content of all is there.
#[derive(Default)]
struct Files(Vec<(PathBuf, Vec<u8>)>);

impl Files {
    fn add(&mut self, path: PathBuf, bytes: Vec<u8>) {
        self.0.push((path, bytes));
    }

    /// Adds how a view came about.
    fn add_about(&mut self, path: PathBuf, about: &Value) -> Result<()> {
        let mut json = serde_json::to_vec_pretty(about).map_err(internal)?;
        json.push(b'\n');
        self.add(path, json);
        Ok(())
    }

    fn write(&self) -> Result<()> {
        let files = self.0.iter();
        let files: Vec<(&Path, &[u8])> = files
            .map(|(path, bytes)| (path.as_path(), bytes.as_slice()))
            .collect();
        Ok(write_all_atomically(&files)?)
    }
}

impl ViewOut {
    /// The path of a file of the view, by its end.
    fn file(&self, task: &Path, end: &str) -> Result<PathBuf> {
        let name = self.name.clone().unwrap_or_else(|| of_task(task));
        check_name(&name)?;
        Ok(self.out.join(format!("{name}.{end}")))
    }

    /// Adds the picture, if one is asked for.
    fn add_picture(&self, files: &mut Files, picture: &Picture<'_>) -> Result<()> {
        if let Some(path) = &self.picture {
            files.add(path.clone(), drawn(path, &picture.svg())?);
        }
        Ok(())
    }

    /// Writes all files, the last of which says how the view came about, and says which there are.
    fn finish(&self, mut files: Files, about: (PathBuf, Value), mut text: String) -> Result<Exit> {
        let (path, about) = about;
        files.add_about(path, &about)?;
        files.write()?;
        match self.format {
            Format::Json => output::print_json(&about)?,
            Format::Text => {
                let written = files.0.iter().map(|(path, _)| path);
                for path in written.filter(|path| Some(*path) != self.picture.as_ref()) {
                    output::labelled(&mut text, "written", path.display());
                }
                output::print(text.trim_end())?;
            }
        }
        Ok(Exit::Success)
    }
}

fn grid(arguments: &GridArgs) -> Result<Exit> {
    let (task, out) = (&arguments.task, &arguments.out);
    let problem = load_problem(task)?;
    let spec = arguments.spec.spec();
    let (view, about, report) = match &arguments.roadmap {
        None => {
            let view = world_to_grid(&problem, spec)?;
            let about = view.about();
            (view, about, None)
        }
        Some(file) => {
            let spec = OverlaySpec {
                grid: spec,
                cell_m: arguments.cell_size,
            };
            let overlay = roadmap_to_grid(&problem, &load_roadmap(file)?, spec)?;
            let about = overlay.about();
            (overlay.view, about, Some(overlay.report))
        }
    };
    let (instance, grid) = (&view.instance, view.instance.grid());
    let (map, scen) = (out.file(task, "map")?, out.file(task, "scen")?);
    if let Place::Map { file, .. } = &problem.task.place {
        let own = task.parent().unwrap_or(Path::new("")).join(file);
        refuse_input(&map, &[&own])?;
    }
    let ends = instance.starts().iter().zip(instance.goals());
    let ends = ends.map(|(start, goal)| (*start, *goal));
    let scenario = Scenario::of(grid, &file_name(&map), ends);
    let mut files = Files::default();
    files.add(map, map_bytes(grid));
    files.add(scen, write_scen(&scenario));
    if out.picture.is_some() {
        let (world, corner_m) = grid_picture(&problem, &view, report.is_some())?;
        let at = |cell: &u32| {
            let (x, y) = cell_center_m(grid, view.cell_m, *cell);
            [corner_m[0] + x, corner_m[1] + y]
        };
        let (starts, goals) = (
            instance.starts().iter().map(at),
            instance.goals().iter().map(at),
        );
        out.add_picture(&mut files, &Picture::new(&world).ends(starts.zip(goals)))?;
    }
    let snapped = view
        .snapped_m
        .iter()
        .flatten()
        .fold(0.0_f64, |most, far| most.max(*far));
    let mut text = String::new();
    let mut line = |label: &str, value: String| output::labelled(&mut text, label, value);
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
    if let Some(report) = &report {
        overlay_lines(report, line);
    }
    output::labelled(&mut text, "instance digest", instance.digest());
    out.finish(files, (out.file(task, "grid.json")?, about), text)
}

/// A grid as it is drawn, and where its lower left corner is: its cells, or the moves that a roadmap
/// leaves over the world.
fn grid_picture(problem: &Problem, view: &GridView, has_moves: bool) -> Result<(World, [f64; 2])> {
    let grid = view.instance.grid();
    if !has_moves {
        return Ok((World::of_grid(grid, view.cell_m), [0.0, 0.0]));
    }
    let connectivity = view.instance.connectivity();
    let moves = grid_to_roadmap(grid, connectivity, view.cell_m, view.corner_m)?;
    let world = World::of_workspace(&problem.world).roadmap(&moves.roadmap);
    Ok((world, view.corner_m))
}

fn overlay_lines(report: &OverlayReport, mut line: impl FnMut(&str, String)) {
    let lost =
        |all: usize, merged: usize, lost: usize| format!("{all}, {merged} merged, {lost} lost");
    line(
        "vertices",
        lost(
            report.vertices,
            report.vertices_merged,
            report.vertices_lost,
        ),
    );
    line(
        "edges",
        lost(report.edges, report.edges_merged, report.edges_lost),
    );
    if let (Some(mean), Some(max)) = (report.stretch_mean, report.stretch_max) {
        let value = format!("{mean:.3} times the way on the roadmap on average, {max:.3} at most");
        line("stretch", value);
    }
}

fn roadmap(arguments: &RoadmapArgs) -> Result<Exit> {
    let (task, out) = (&arguments.task, &arguments.out);
    let problem = load_problem(task)?;
    let mut files = Files::default();
    let about = out.file(task, "view.json")?;
    let add_picture = |roadmap: &Roadmap, files: &mut Files| {
        let world = World::of_workspace(&problem.world).roadmap(roadmap);
        let ends = problem.task.agents.iter();
        let ends = ends.map(|agent| (agent.start.at_m(), agent.goal.at_m()));
        out.add_picture(files, &Picture::new(&world).ends(ends))
    };
    if let Some(file) = &arguments.check {
        let roadmap = load_roadmap(file)?;
        let (view, text) = check(&problem, &roadmap)?;
        add_picture(&roadmap, &mut files)?;
        return out.finish(files, (about, view), text);
    }
    let view = world_to_roadmap(&problem, arguments.spec.spec(arguments.seed))?;
    files.add(
        out.file(task, "roadmap.json")?,
        write_roadmap(&view.roadmap),
    );
    add_picture(&view.roadmap, &mut files)?;
    let report = &view.report;
    let mut text = String::new();
    let mut line = |label: &str, value: String| output::labelled(&mut text, label, value);
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
    out.finish(files, (about, view.about()), text)
}

/// A roadmap in a task's world, and what is free for whom in words. Agents that cannot reach their
/// goals are an error.
fn check(problem: &Problem, roadmap: &Roadmap) -> Result<(Value, String)> {
    let view = roadmap_to_world(problem, roadmap)?;
    let found = view.edges.iter().map(|edges| {
        let all = edges.free + edges.blocked.len();
        let agents = match edges.agents {
            1 => "1 agent".to_owned(),
            agents => format!("{agents} agents"),
        };
        let mut value = format!("{} of {all} edges are free for {agents}", edges.free);
        if let Some([from, to]) = edges.blocked.first() {
            let _ = write!(value, ", the first that is not is {from} to {to}");
        }
        (format!("radius {} m", edges.radius_m), value)
    });
    let found: Vec<(String, String)> = found.collect();
    if let Some(agent) = view.cut_off.first() {
        let found = found
            .iter()
            .map(|(label, value)| format!("{label}: {value}"));
        let found: Vec<String> = found.collect();
        let reason = format!(
            "agent {agent} cannot reach its goal along edges that are free for it ({})",
            found.join("; ")
        );
        let hint =
            "make a roadmap for this task with `fleetyard world roadmap`, or use smaller robots";
        return Err(InputError::new(problem.task.source.as_str(), reason)
            .hint(hint)
            .into());
    }
    let mut text = String::new();
    for (label, value) in found {
        output::labelled(&mut text, &label, value);
    }
    output::labelled(&mut text, "goals", "every agent reaches its goal");
    Ok((view.about(), text))
}

fn convert(arguments: &ConvertArgs) -> Result<Exit> {
    let ConvertArgs {
        map,
        out,
        to,
        cell_size,
        connectivity,
    } = arguments;
    let grid = load_map(map)?;
    let (bytes, about) = match to {
        Made::World => {
            let view = grid_to_world(&grid, *cell_size, [0.0, 0.0])?;
            (write_workspace(&view.world), view.about())
        }
        Made::Roadmap => {
            let view = grid_to_roadmap(&grid, *connectivity, *cell_size, [0.0, 0.0])?;
            (write_roadmap(&view.roadmap), view.about())
        }
    };
    let mut files = Files::default();
    files.add(out.clone(), bytes);
    files.add_about(
        out.with_file_name(format!("{}.view.json", stem(out, &[".json"]))),
        &about,
    )?;
    files.write()?;
    for (path, _) in &files.0 {
        output::print(&path.display().to_string())?;
    }
    Ok(Exit::Success)
}
