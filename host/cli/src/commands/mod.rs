//! One file per command.

use std::fs::Permissions;
use std::io::{self, BufWriter, Write};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::CommandFactory;
use clap_complete::Shell;
use fleetyard_core::{Grid, GridInstance, GridPlan, InputError, load_map, load_scen};
use fleetyard_sim::{TraceSink, TraceWriter};
use tempfile::NamedTempFile;

use crate::args::{Cli, InstanceArgs};
use crate::exit::{Exit, Result};
use crate::{output, picture};

pub(crate) mod check;
pub(crate) mod compare;
pub(crate) mod convert;
pub(crate) mod doctor;
pub(crate) mod maps;
pub(crate) mod new;
pub(crate) mod pin;
pub(crate) mod plugins;
pub(crate) mod run;
pub(crate) mod simulate;
pub(crate) mod validate;
mod validate_plane;

pub(crate) fn completions(shell: Shell) -> Result<Exit> {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut Cli::command(), "fleetyard", &mut script);
    output::print(String::from_utf8_lossy(&script).trim_end())?;
    Ok(Exit::Success)
}

fn load_instance(arguments: &InstanceArgs) -> Result<GridInstance> {
    let InstanceArgs { map, scen, agents } = arguments;
    let grid = Arc::new(load_map(&map.map)?);
    Ok(load_scen(scen)?.instance(grid, *agents, map.connectivity)?)
}

fn file_name(path: &Path) -> String {
    path.file_name()
        .unwrap_or(path.as_os_str())
        .to_string_lossy()
        .into_owned()
}

/// A word for a shell.
fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./=:,+@%".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}

fn draw(path: &Path, grid: &Grid, plan: Option<&GridPlan>, goals: Option<&[u32]>) -> Result<()> {
    let svg = picture::svg(grid, plan, goals);
    Ok(fleetyard_core::write_atomically(path, svg.as_bytes())?)
}

/// A trace file that appears under its name only when it is whole.
struct TraceFile<'a> {
    path: &'a Path,
    writer: TraceWriter<Unnamed>,
}

/// A temporary file in a folder, made when it is first written to: until then a host
/// that is interrupted, while a planner runs, leaves nothing behind.
struct Unnamed {
    folder: PathBuf,
    file: Option<BufWriter<NamedTempFile>>,
}

impl Unnamed {
    fn create(&self) -> io::Result<NamedTempFile> {
        // Others may read what the user lets them; temporary files are private else.
        tempfile::Builder::new()
            .permissions(Permissions::from_mode(0o666))
            .tempfile_in(&self.folder)
    }

    fn file(&mut self) -> io::Result<&mut BufWriter<NamedTempFile>> {
        let file = match self.file.take() {
            Some(file) => file,
            None => BufWriter::new(self.create()?),
        };
        Ok(self.file.insert(file))
    }
}

impl Write for Unnamed {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file()?.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file()?.flush()
    }
}

impl<'a> TraceFile<'a> {
    fn create(path: &'a Path) -> Result<Self> {
        let folder = path
            .parent()
            .filter(|folder| !folder.as_os_str().is_empty());
        let unnamed = Unnamed {
            folder: folder.unwrap_or(Path::new(".")).to_owned(),
            file: None,
        };
        // Tried now and not when the planner's budget has been spent.
        unnamed.create().map_err(|error| {
            InputError::new(
                path.display().to_string(),
                format!("cannot be written: {error}"),
            )
            .hint("does its folder exist, and may you write to it?")
        })?;
        // Every tick: the trace is what other tools replay.
        Ok(Self {
            path,
            writer: TraceWriter::new(unnamed, 1),
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
        let Some(file) = self.writer.into_inner().file else {
            return Ok(());
        };
        let file = file.into_inner().map_err(|error| failed(&error))?;
        file.persist(self.path).map_err(|error| failed(&error))?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::quoted;

    #[test]
    fn words_survive_a_shell() {
        assert_eq!(quoted("--only"), "--only");
        assert_eq!(quoted("fault=too-few-agents"), "fault=too-few-agents");
        assert_eq!(quoted("my plugin's.so"), r"'my plugin'\''s.so'");
        assert_eq!(quoted(""), "''");
    }
}
