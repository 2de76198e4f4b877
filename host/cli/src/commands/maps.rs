//! `fleetyard maps`: makes and describes maps.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use fleetyard_core::{
    Connectivity, Grid, InputError, Scenario, load_map, save_map, save_scen, shown,
};
use fleetyard_world::{
    EmptySpec, MapSpec, MazeAlgorithm, MazeRandom, MazeSpec, RandomSpec, RoomSpec, ScenarioSpec,
    WarehouseSpec,
};
use serde::Serialize;

use crate::args::{Format, Generate, MazeArg, MazeRandomArg, MazeSizeArgs, OutArgs, SizeArgs};
use crate::exit::{Exit, Failure, Result};
use crate::output;

/// The generators name their parameters, which are flags here.
fn wrong_flag(error: InputError) -> Failure {
    let message = format!("--{}: {}", error.source.replace('_', "-"), error.reason);
    Failure {
        exit: Exit::Usage,
        message,
        hint: error.hint,
    }
}

pub(crate) fn generate(what: &Generate) -> Result<Exit> {
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
    if name.is_empty() || name.starts_with('.') || name.contains(['/', '\\', '\0']) {
        return Err(wrong_flag(
            InputError::new(
                "name",
                format!("{:?} cannot be the name of a map", shown(name)),
            )
            .hint("files are named after it: write one without folders"),
        ));
    }
    let (rows, cols) = (grid.rows(), grid.cols());
    Ok(Grid::new(
        name.as_str(),
        rows,
        cols,
        grid.terrain().to_vec(),
    )?)
}

pub(crate) fn scenario(map: &Path, agents: u32, seed: u64, out: &Path) -> Result<Exit> {
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
            seed,
            out,
            ..
        } => {
            let algorithm = match algorithm {
                MazeArg::Backtracker => MazeAlgorithm::Backtracker,
                MazeArg::Prim => MazeAlgorithm::Prim,
            };
            let random = match random {
                MazeRandomArg::ChaCha => MazeRandom::ChaCha,
                MazeRandomArg::Python => MazeRandom::Python,
            };
            let (rows, cols) = maze_size(size, *corridor);
            (
                MapSpec::Maze(MazeSpec {
                    rows,
                    cols,
                    corridor: *corridor,
                    algorithm,
                    random,
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

pub(crate) fn info(map: &Path, format: Format) -> Result<Exit> {
    let grid = load_map(map)?;
    let mut terrain: BTreeMap<char, u64> = BTreeMap::new();
    for letter in grid.terrain() {
        *terrain.entry(char::from(*letter)).or_default() += 1;
    }
    let labels = grid.components();
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
