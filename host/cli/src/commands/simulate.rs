//! `fleetyard simulate`: executes a plan file.

use std::fmt::Write as _;

use fleetyard_core::formats::{grid_size, load_any_plan};
use fleetyard_core::load_map;
use fleetyard_sim::NoTrace;
use fleetyard_view::{Picture, World};

use super::{TraceFile, draw};
use crate::args::{Format, Simulate};
use crate::exit::{Exit, Result};
use crate::output;
use crate::record::{ExecutionInfo, number};
use crate::trial::{execute, sim_config};

pub(crate) fn simulate(arguments: &Simulate) -> Result<Exit> {
    let grid = load_map(&arguments.map.map)?;
    let size = Some(grid_size(&grid));
    let file = load_any_plan(&arguments.plan, arguments.from, size)?.into_grid()?;
    file.check_map(&grid)?;
    let config = sim_config(&arguments.world);
    let execution = match &arguments.trace_out {
        Some(path) => {
            let mut trace = TraceFile::create(path)?;
            let execution = execute(&grid, &file.plan, &config, trace.sink())?;
            trace.finish()?;
            execution
        }
        None => execute(&grid, &file.plan, &config, &mut NoTrace)?,
    };
    if let Some(path) = &arguments.picture {
        let world = World::of_grid(&grid, config.cell_size_m);
        draw(path, &Picture::new(&world).plan(&grid, &file.plan))?;
    }
    match arguments.format {
        Format::Json => output::print_json(&execution)?,
        Format::Text => output::print(&text(&execution))?,
    }
    Ok(Exit::Success)
}

fn text(execution: &ExecutionInfo) -> String {
    let ExecutionInfo {
        simulated_s,
        wall_ms,
        rtf,
        contacts,
        ..
    } = execution;
    let mut out = String::new();
    let (simulated, wall, rtf) = (number(*simulated_s), number(*wall_ms), number(*rtf));
    // Writing to a string cannot fail.
    let _ = writeln!(
        out,
        "simulated         {simulated} s in {wall} ms (RTF {rtf})"
    );
    let _ = writeln!(
        out,
        "contacts          {contacts} ({} between agents, {} with obstacles)",
        execution.contacts_agent_agent, execution.contacts_agent_obstacle
    );
    if let Some(nearest) = execution.nearest_approach_m {
        let radius = execution.radius_m;
        let _ = writeln!(
            out,
            "nearest approach  {nearest:.3} m between centres (radius {radius} m)"
        );
    }
    let _ = writeln!(
        out,
        "tracking error    {:.4} m at most",
        execution.tracking_error_max_m
    );
    let _ = write!(out, "trace digest      {}", execution.trace_digest);
    out
}
