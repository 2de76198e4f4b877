//! `fleetyard maps`: makes and describes maps.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::{ArgMatches, Args, Subcommand};
use fleetyard_core::{Connectivity, Grid, InputError, Scenario, load_map, save_map, save_scen};
use fleetyard_world::{
    EmptySpec, MapSpec, MazeAlgorithm, MazeRandom, MazeSpec, RandomSpec, RoomSpec, ScenarioSpec,
    WarehouseSpec,
};
use serde::Serialize;

use super::guide::{Guide, guide};
use crate::args::{Format, word};
use crate::exit::{Exit, Failure, Result};
use crate::files::check_name;
use crate::output;

#[derive(Debug, Subcommand)]
pub(crate) enum Maps {
    /// Make a map, and a scenario for it
    #[command(subcommand)]
    Generate(Generate),
    /// Make a scenario for a map: random starts and goals
    Scenario {
        /// Map file: MovingAI, fleetyard.grid/1 or LSMART
        map: PathBuf,
        /// Number of agents
        #[arg(long, short = 'n', value_name = "N")]
        agents: u32,
        /// Seed of starts and goals
        #[arg(long, value_name = "N", default_value_t = 1)]
        seed: u64,
        /// Folder to write to
        #[arg(long, value_name = "FOLDER", default_value = ".")]
        out: PathBuf,
    },
    Guide(Box<Guide>),
    /// Describe a map
    Info {
        /// Map file: MovingAI, fleetyard.grid/1 or LSMART
        map: PathBuf,
        #[command(flatten)]
        format: Format,
    },
}

#[derive(Debug, Subcommand)]
pub(crate) enum Generate {
    /// No obstacles
    Empty {
        #[command(flatten)]
        size: SizeArgs,
        #[command(flatten)]
        out: OutArgs,
    },
    /// Obstacles strewn at random, the free cells connected
    Random {
        #[command(flatten)]
        size: SizeArgs,
        /// Share of blocked cells, from 0 to below 1
        #[arg(long, value_name = "SHARE")]
        obstacle_density: f64,
        /// Seed of the map
        #[arg(long, value_name = "N", default_value_t = 1)]
        seed: u64,
        #[command(flatten)]
        out: OutArgs,
    },
    /// Rooms with doors
    Room {
        #[command(flatten)]
        size: SizeArgs,
        /// Distance from wall to wall: a room has one row and column less
        #[arg(long, value_name = "N")]
        room_size: u32,
        /// Doors per wall between two rooms
        #[arg(long, value_name = "N", default_value_t = 1)]
        doors: u32,
        /// Seed of the map
        #[arg(long, value_name = "N", default_value_t = 1)]
        seed: u64,
        #[command(flatten)]
        out: OutArgs,
    },
    /// A maze
    Maze {
        #[command(flatten)]
        size: MazeSizeArgs,
        /// Width of corridors in cells
        #[arg(long, value_name = "N", default_value_t = 1)]
        corridor: u32,
        /// Algorithm that carves it
        #[arg(long, value_parser = word::<MazeAlgorithm>(), default_value_t = MazeAlgorithm::Backtracker)]
        algorithm: MazeAlgorithm,
        /// Source of the random numbers
        #[arg(long, value_parser = word::<MazeRandom>(), default_value_t)]
        random: MazeRandom,
        /// Walls that are opened besides: each closes a loop
        #[arg(long, value_name = "N", default_value_t = 0)]
        loops: u32,
        /// Seed of the map
        #[arg(long, value_name = "N", default_value_t = 1)]
        seed: u64,
        /// Also write a scenario with the maze's own task: from its north-west cell to
        /// the one in its middle
        #[arg(long)]
        scenario: bool,
        #[command(flatten)]
        out: OutArgs,
    },
    /// Shelves and aisles: warehouse-A-B-C-D-E of the MovingAI benchmarks
    Warehouse {
        /// Blocks of shelves beside each other (A)
        #[arg(long, value_name = "A")]
        blocks_across: u32,
        /// Blocks of shelves above each other (B)
        #[arg(long, value_name = "B")]
        blocks_down: u32,
        /// Width of a block in cells (C)
        #[arg(long, value_name = "C")]
        block_cols: u32,
        /// Height of a block in cells (D)
        #[arg(long, value_name = "D")]
        block_rows: u32,
        /// Width of aisles in cells (E)
        #[arg(long, value_name = "E")]
        aisle: u32,
        /// Free columns at the left and right [default: A * C / 4]
        #[arg(long, value_name = "N")]
        margin: Option<u32>,
        /// Height of the aisles between blocks above each other [default: E]
        #[arg(long, value_name = "N")]
        aisle_rows: Option<u32>,
        /// Free rows at the top and bottom [default: as between blocks]
        #[arg(long, value_name = "N")]
        edge_rows: Option<u32>,
        /// Without the wall all around
        #[arg(long)]
        open: bool,
        /// Make the free cells above and below shelves endpoints (letter e)
        #[arg(long)]
        endpoints: bool,
        /// Make every Nth cell of the outermost free columns a workstation (letter w)
        #[arg(long, value_name = "N")]
        workstations: Option<u32>,
        #[command(flatten)]
        out: OutArgs,
    },
}

/// Folder of a generated map and its scenario.
#[derive(Debug, Args)]
pub(crate) struct OutArgs {
    /// Folder to write to
    #[arg(long, value_name = "FOLDER", default_value = ".")]
    out: PathBuf,
    /// Name of the map, and of its file without `.map` [default: after its parameters]
    #[arg(long, value_name = "NAME")]
    name: Option<String>,
    /// Also write a scenario for so many agents
    #[arg(long, value_name = "N")]
    scenario_agents: Option<u32>,
    /// Seed of the scenario
    #[arg(long, value_name = "N", default_value_t = 1)]
    scenario_seed: u64,
}

#[derive(Debug, Args)]
pub(crate) struct SizeArgs {
    /// Rows of the map
    #[arg(long, value_name = "N")]
    rows: u32,
    /// Columns of the map
    #[arg(long, value_name = "N")]
    cols: u32,
}

/// A maze's size: that of the map, or that of the maze.
#[derive(Debug, Args)]
pub(crate) struct MazeSizeArgs {
    /// Rows of the map
    #[arg(long, value_name = "N", required_unless_present_any = ["width", "height"])]
    rows: Option<u32>,
    /// Columns of the map
    #[arg(long, value_name = "N", required_unless_present_any = ["width", "height"])]
    cols: Option<u32>,
    /// Width in maze cells, instead of --cols: the map is closed on all sides
    #[arg(long, value_name = "N", requires = "height", conflicts_with_all = ["rows", "cols"],
        value_parser = clap::value_parser!(u32).range(1..))]
    width: Option<u32>,
    /// Height in maze cells, instead of --rows
    #[arg(long, value_name = "N", requires = "width", conflicts_with_all = ["rows", "cols"],
        value_parser = clap::value_parser!(u32).range(1..))]
    height: Option<u32>,
}

/// `given` are the arguments as they stand on the command line.
pub(crate) fn maps(what: &Maps, given: &ArgMatches) -> Result<Exit> {
    match what {
        Maps::Generate(what) => generate(what),
        Maps::Scenario {
            map,
            agents,
            seed,
            out,
        } => scenario(map, *agents, *seed, out),
        Maps::Guide(arguments) => {
            let own = given.subcommand().map_or(given, |(_, own)| own);
            guide(arguments, own)
        }
        Maps::Info { map, format } => info(map, *format),
    }
}

/// The generators name their parameters, which are flags here.
fn wrong_flag(error: InputError) -> Failure {
    let message = format!("--{}: {}", error.source.replace('_', "-"), error.reason);
    Failure {
        exit: Exit::Usage,
        message,
        hint: error.hint,
    }
}

fn generate(what: &Generate) -> Result<Exit> {
    let (spec, out) = spec(what);
    let grid = named(spec.generate().map_err(wrong_flag)?, out)?;
    let mut scenarios = Vec::new();
    if let (MapSpec::Maze(spec), Generate::Maze { scenario: true, .. }) = (&spec, what) {
        let task = spec.instance(Connectivity::Four).map_err(wrong_flag)?;
        let map = format!("{}.map", grid.name());
        let entry = (task.starts()[0], task.goals()[0]);
        let name = format!("{}.scen", grid.name());
        scenarios.push((name, Scenario::of(&grid, &map, [entry])));
    }
    if let Some(agents) = out.scenario_agents {
        let scenario = make_scenario(&grid, agents, out.scenario_seed, "scenario-agents")?;
        scenarios.push((scenario_name(&grid, out.scenario_seed), scenario));
    }
    let map = out.out.join(format!("{}.map", grid.name()));
    save_map(&grid, &map)?;
    output::print(&map.display().to_string())?;
    for (name, scenario) in scenarios {
        save(&scenario, &out.out.join(name))?;
    }
    Ok(Exit::Success)
}

/// The map under the name that it is to have.
fn named(grid: Grid, out: &OutArgs) -> Result<Grid> {
    let Some(name) = &out.name else {
        return Ok(grid);
    };
    check_name(name)?;
    let (rows, cols) = (grid.rows(), grid.cols());
    Ok(Grid::new(
        name.as_str(),
        rows,
        cols,
        grid.terrain().to_vec(),
    )?)
}

fn scenario(map: &Path, agents: u32, seed: u64, out: &Path) -> Result<Exit> {
    let grid = load_map(map)?;
    let scenario = make_scenario(&grid, agents, seed, "agents")?;
    save(&scenario, &out.join(scenario_name(&grid, seed)))?;
    Ok(Exit::Success)
}

/// `flag` is the one that asked for so many agents.
fn make_scenario(grid: &Grid, agents: u32, seed: u64, flag: &str) -> Result<Scenario> {
    ScenarioSpec { agents, seed }
        .generate(grid)
        .map_err(|error| {
            wrong_flag(InputError {
                source: flag.to_owned(),
                ..error
            })
        })
}

/// The name that the benchmarks would give a random scenario.
fn scenario_name(grid: &Grid, seed: u64) -> String {
    format!("{}-random-{seed}.scen", grid.name())
}

fn save(scenario: &Scenario, path: &Path) -> Result<()> {
    save_scen(scenario, path)?;
    output::print(&path.display().to_string())
}

fn spec(what: &Generate) -> (MapSpec, &OutArgs) {
    match what {
        Generate::Empty {
            size: SizeArgs { rows, cols },
            out,
        } => (
            MapSpec::Empty(EmptySpec {
                rows: *rows,
                cols: *cols,
            }),
            out,
        ),
        Generate::Random {
            size: SizeArgs { rows, cols },
            obstacle_density,
            seed,
            out,
        } => {
            let (rows, cols, seed) = (*rows, *cols, *seed);
            let obstacle_density = *obstacle_density;
            (
                MapSpec::Random(RandomSpec {
                    rows,
                    cols,
                    obstacle_density,
                    seed,
                }),
                out,
            )
        }
        Generate::Room {
            size: SizeArgs { rows, cols },
            room_size,
            doors,
            seed,
            out,
        } => {
            let (rows, cols, room_size, doors, seed) = (*rows, *cols, *room_size, *doors, *seed);
            (
                MapSpec::Room(RoomSpec {
                    rows,
                    cols,
                    room_size,
                    doors,
                    seed,
                }),
                out,
            )
        }
        Generate::Maze {
            size,
            corridor,
            algorithm,
            random,
            loops,
            seed,
            out,
            ..
        } => {
            let (rows, cols) = maze_size(size, *corridor);
            (
                MapSpec::Maze(MazeSpec {
                    rows,
                    cols,
                    corridor: *corridor,
                    algorithm: *algorithm,
                    random: *random,
                    loops: *loops,
                    seed: *seed,
                }),
                out,
            )
        }
        Generate::Warehouse {
            blocks_across,
            blocks_down,
            block_cols,
            block_rows,
            aisle,
            margin,
            aisle_rows,
            edge_rows,
            open,
            endpoints,
            workstations,
            out,
        } => {
            let spec = WarehouseSpec {
                blocks_across: *blocks_across,
                blocks_down: *blocks_down,
                block_cols: *block_cols,
                block_rows: *block_rows,
                aisle: *aisle,
                margin: *margin,
                aisle_rows: *aisle_rows,
                edge_rows: *edge_rows,
                open: *open,
                endpoints: *endpoints,
                workstations: *workstations,
            };
            (MapSpec::Warehouse(spec), out)
        }
    }
}

/// Rows and columns of the map; one of the two pairs is there.
fn maze_size(size: &MazeSizeArgs, corridor: u32) -> (u32, u32) {
    let of_cells = |cells: u32| {
        let pitch = corridor.saturating_add(1);
        cells.saturating_mul(pitch).saturating_add(1)
    };
    let lattice = |cells: Option<u32>| cells.map(of_cells).unwrap_or_default();
    (
        size.rows.unwrap_or_else(|| lattice(size.height)),
        size.cols.unwrap_or_else(|| lattice(size.width)),
    )
}

#[derive(Serialize)]
struct Info {
    name: String,
    rows: u32,
    cols: u32,
    cells: u32,
    passable: u32,
    obstacle_density: f64,
    /// Connected parts of the passable cells.
    components: usize,
    /// Cells of the largest part.
    largest_component: u32,
    terrain: BTreeMap<char, u64>,
    digest: fleetyard_core::Digest,
}

fn info(map: &Path, format: Format) -> Result<Exit> {
    let grid = load_map(map)?;
    let mut terrain: BTreeMap<char, u64> = BTreeMap::new();
    for letter in grid.terrain() {
        *terrain.entry(char::from(*letter)).or_default() += 1;
    }
    let labels = grid.components(Connectivity::Four);
    let count = labels.iter().copied().max().unwrap_or(0) as usize;
    let mut sizes = vec![0; count + 1];
    for label in &labels {
        sizes[*label as usize] += 1;
    }
    let (cells, passable) = (grid.cell_count(), grid.passable_count());
    let info = Info {
        name: grid.name().to_owned(),
        rows: grid.rows(),
        cols: grid.cols(),
        cells,
        passable,
        obstacle_density: f64::from(cells - passable) / f64::from(cells),
        components: count,
        // Label 0 is for blocked cells.
        largest_component: sizes[1..].iter().copied().max().unwrap_or(0),
        terrain,
        digest: grid.digest(),
    };
    match format {
        Format::Json => output::print_json(&info)?,
        Format::Text => output::print(&text(&info))?,
    }
    Ok(Exit::Success)
}

fn text(info: &Info) -> String {
    let Info {
        name,
        rows,
        cols,
        cells,
        passable,
        components,
        ..
    } = info;
    let terrain: Vec<String> = info
        .terrain
        .iter()
        .map(|(letter, count)| format!("{letter} {count}"))
        .collect();
    let percent = info.obstacle_density * 100.0;
    let mut out = String::new();
    // Writing to a string cannot fail.
    let _ = writeln!(out, "name        {name}");
    let _ = writeln!(out, "size        {rows} rows, {cols} columns");
    let _ = writeln!(
        out,
        "cells       {cells}, {passable} passable ({percent:.1} % obstacles)"
    );
    let _ = writeln!(
        out,
        "components  {components}, the largest has {}",
        info.largest_component
    );
    let _ = writeln!(out, "terrain     {}", terrain.join(", "));
    let _ = write!(out, "digest      {}", info.digest);
    out
}
