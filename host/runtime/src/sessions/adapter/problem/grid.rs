//! Maps on grids.

use std::path::Path;

use fleetyard_abi::sdk::Failure;
use fleetyard_abi::{
    Capability, Environment, GridEnvironment, Instance, Motion, Plan, SharedEnvironment,
};
use fleetyard_core::formats::{
    MapSize, Pibt2Settings, TRANSPOSED_HINT, looks_transposed, write_libmrp, write_pibt2,
};
use fleetyard_core::{Grid, InputError, Scenario, ScenarioEntry, write_map, write_scen};

use super::super::input::{Agents, GridInput, Letters, MAP_NAME, Order, SCEN_NAME};
use super::super::manifest::Manifest;
use super::terms::{
    File, Problem, check_places, elsewhere, invalid, seed31, told, twice, unsupported,
};

/// A map with unit steps.
pub(super) struct OnGrid {
    input: GridInput,
    environment: SharedEnvironment,
    /// The map, where instances have it in them.
    written: Option<Grid>,
    free_cells: u64,
}

impl OnGrid {
    pub(super) fn new(
        manifest: &Manifest,
        input: GridInput,
        environment: &SharedEnvironment,
    ) -> Result<(Self, Vec<File>), Failure> {
        let Some(grid) = environment.grid() else {
            return Err(elsewhere(manifest, "plans on grids", environment));
        };
        if !grid.is_plain() {
            let what = "plans on grids without one-way moves";
            return Err(unsupported(manifest, what));
        }
        if grid.connectivity != 4 && !manifest.capabilities.has(Capability::EightConnected) {
            return Err(unsupported(manifest, "plans on four-connected grids"));
        }
        let terrain = if input.letters == Letters::All {
            grid.terrain.clone()
        } else {
            let letter = |free: &u8| if *free == 0 { b'@' } else { b'.' };
            grid.passable.iter().map(letter).collect()
        };
        let written = Grid::new("map", grid.rows, grid.cols, terrain)
            .map_err(|error| invalid(told(&error)))?;
        let bytes = write_map(&written);
        let problem = Self {
            input,
            written: (input.scen == Agents::Libmrp).then_some(written),
            free_cells: grid.passable.iter().filter(|free| **free != 0).count() as u64,
            environment: environment.clone(),
        };
        Ok((problem, vec![(MAP_NAME, bytes)]))
    }

    fn grid(&self) -> Result<&GridEnvironment, Failure> {
        let grid = Environment::grid(&self.environment);
        grid.ok_or_else(|| invalid("the map is no grid"))
    }
}

impl Problem for OnGrid {
    fn check(&self, manifest: &Manifest, instance: &Instance) -> Result<(), Failure> {
        let grid = self.grid()?;
        if instance.motion != Motion::Pebble {
            return Err(unsupported(manifest, "does not plan rotations"));
        }
        check_places(manifest, &self.environment, instance)?;
        let mut cells = instance.starts.iter().chain(instance.goals.items());
        if let Some(cell) = cells.find(|cell| grid.passable[**cell as usize] == 0) {
            let reason = format!("cell {cell} is blocked, but a start or a goal");
            return Err(invalid(reason));
        }
        if let Some(cell) = twice(&instance.starts) {
            return Err(invalid(format!("two agents start in cell {cell}")));
        }
        if !manifest.capabilities.has(Capability::DuplicateGoals)
            && let Some(cell) = twice(instance.goals.items())
        {
            return Err(unsupported(
                manifest,
                &format!("takes no goal twice, as cell {cell}"),
            ));
        }
        Ok(())
    }

    fn files(
        &self,
        _: &Manifest,
        instance: &Instance,
        seed: u64,
        scratch: &Path,
    ) -> Result<Vec<File>, Failure> {
        let grid = self.grid()?;
        let goals = instance.goals.items();
        let bytes = match self.input.scen {
            Agents::Libmrp => {
                let map = self.written.as_ref();
                let map = map.ok_or_else(|| invalid("there is no map"))?;
                write_libmrp(map, &instance.starts, goals)
            }
            Agents::MovingAi => scenario(&instance.starts, goals, grid, self.input.order),
            Agents::Pibt2 => write_pibt2(
                &scratch.join(MAP_NAME).to_string_lossy(),
                size(grid),
                &instance.starts,
                goals,
                &Pibt2Settings {
                    seed: Some(seed31(seed)),
                    ..Pibt2Settings::default()
                },
            ),
        };
        Ok(vec![(SCEN_NAME, bytes)])
    }

    fn plan_in(
        &self,
        manifest: &Manifest,
        answer: &[u8],
        instance: &Instance,
    ) -> Result<Plan, InputError> {
        let source = manifest.output.source();
        let grid = self.grid();
        let grid = grid.map_err(|failure| InputError::new(source.as_str(), failure.message))?;
        let size = size(grid);
        let plan = manifest.read_paths(answer, size, instance.agents())?;
        if looks_transposed(size, &instance.starts, &plan) {
            let reason = "agents do not begin at their starts";
            return Err(InputError::new(source, reason).hint(TRANSPOSED_HINT));
        }
        Ok(plan.into())
    }

    fn places(&self) -> u64 {
        self.free_cells
    }
}

fn size(grid: &GridEnvironment) -> MapSize {
    MapSize {
        rows: grid.rows,
        cols: grid.cols,
    }
}

/// A scenario's text; with rows before columns for solvers that read it so.
fn scenario(starts: &[u32], goals: &[u32], grid: &GridEnvironment, order: Order) -> Vec<u8> {
    let cols = grid.cols.max(1);
    let place = |cell: &u32| {
        let (row, col) = (cell / cols, cell % cols);
        // A scenario's entry is (row, column) and is written column first.
        match order {
            Order::XY => (row, col),
            Order::RowCol => (col, row),
        }
    };
    let entries = starts.iter().zip(goals).map(|(start, goal)| ScenarioEntry {
        line: 0,
        bucket: 0,
        map: MAP_NAME.into(),
        map_cols: grid.cols,
        map_rows: grid.rows,
        start: place(start),
        goal: place(goal),
        optimal_length: 0.0,
    });
    write_scen(&Scenario {
        source: SCEN_NAME.into(),
        entries: entries.collect(),
    })
}
