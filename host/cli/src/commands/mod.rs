//! One file per command.

use std::io::BufWriter;
use std::path::Path;
use std::sync::Arc;

use clap::CommandFactory;
use clap_complete::Shell;
use fleetyard_core::{Grid, GridInstance, GridPlan, InputError, load_map, load_scen};
use fleetyard_sim::{TraceSink, TraceWriter};
use tempfile::NamedTempFile;

use crate::args::{Cli, MapArgs};
use crate::exit::{Exit, Result};
use crate::{output, picture};

pub(crate) mod compare;
pub(crate) mod maps;
pub(crate) mod plugins;
pub(crate) mod run;
pub(crate) mod simulate;
pub(crate) mod validate;

pub(crate) fn completions(shell: Shell) -> Result<Exit> {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut Cli::command(), "fleetyard", &mut script);
    output::print(String::from_utf8_lossy(&script).trim_end())?;
    Ok(Exit::Success)
}

fn load_instance(map: &MapArgs, scen: &Path, agents: usize) -> Result<GridInstance> {
    let grid = Arc::new(load_map(&map.map)?);
    Ok(load_scen(scen)?.instance(grid, agents, map.connectivity)?)
}

fn file_name(path: &Path) -> String {
    path.file_name()
        .unwrap_or(path.as_os_str())
        .to_string_lossy()
        .into_owned()
}

fn draw(path: &Path, grid: &Grid, plan: Option<&GridPlan>, goals: Option<&[u32]>) -> Result<()> {
    let svg = picture::svg(grid, plan, goals);
    Ok(fleetyard_core::write_atomically(path, svg.as_bytes())?)
}

/// A trace file that appears under its name only when it is whole.
struct TraceFile<'a> {
    path: &'a Path,
    writer: TraceWriter<BufWriter<NamedTempFile>>,
}

impl<'a> TraceFile<'a> {
    fn create(path: &'a Path) -> Result<Self> {
        let folder = path
            .parent()
            .filter(|folder| !folder.as_os_str().is_empty());
        let file = NamedTempFile::new_in(folder.unwrap_or(Path::new("."))).map_err(|error| {
            InputError::new(
                path.display().to_string(),
                format!("cannot be written: {error}"),
            )
            .hint("does its folder exist, and may you write to it?")
        })?;
        // Every tick: the trace is what other tools replay.
        Ok(Self {
            path,
            writer: TraceWriter::new(BufWriter::new(file), 1),
        })
    }

    fn sink(&mut self) -> &mut dyn TraceSink {
        &mut self.writer
    }

    fn finish(self) -> Result<()> {
        let failed = |error: &dyn std::fmt::Display| {
            InputError::new(
                self.path.display().to_string(),
                format!("cannot be written: {error}"),
            )
        };
        let file = self
            .writer
            .into_inner()
            .into_inner()
            .map_err(|error| failed(&error))?;
        file.persist(self.path).map_err(|error| failed(&error))?;
        Ok(())
    }
}
