//! Files that commands write: pictures, and files that appear when they are whole.

use std::fs::{File, Permissions};
use std::io::{self, BufWriter, Write};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

use fleetyard_core::{InputError, create_output, shown, write_atomically};
use fleetyard_sim::TraceWriter;
use fleetyard_sim::trace::TraceOptions;
use fleetyard_view::{Picture, ViewError, png};
use tempfile::NamedTempFile;

use crate::exit::{Exit, Failure, Result};

pub(crate) fn file_name(path: &Path) -> String {
    path.file_name()
        .unwrap_or(path.as_os_str())
        .to_string_lossy()
        .into_owned()
}

/// Refuses the name of a flag `--name` after which no files can be named: one with folders, or of
/// a hidden file.
pub(crate) fn check_name(name: &str) -> Result<()> {
    if !name.is_empty() && !name.starts_with('.') && !name.contains(['/', '\\', '\0']) {
        return Ok(());
    }
    let message = format!("--name: {:?} cannot be the name of a file", shown(name));
    Err(Failure::new(Exit::Usage, message)
        .hint("files are named after it: write one without folders"))
}

/// Writes a picture to a file, as PNG if the name ends so and as SVG otherwise.
pub(crate) fn draw(path: &Path, picture: &Picture<'_>) -> Result<()> {
    draw_document(path, &picture.svg())
}

/// The same for a picture that is an SVG document already.
pub(crate) fn draw_document(path: &Path, svg: &str) -> Result<()> {
    Ok(write_atomically(path, &drawn(path, svg)?)?)
}

/// The content of a picture's file, as PNG if the name ends so and as SVG otherwise.
pub(crate) fn drawn(path: &Path, svg: &str) -> Result<Vec<u8>> {
    let end = path.extension();
    if end.is_some_and(|end| end.eq_ignore_ascii_case("png")) {
        png_bytes(path, svg, None)
    } else {
        Ok(svg.as_bytes().to_vec())
    }
}

pub(crate) fn draw_png(path: &Path, picture: &Picture<'_>, width: Option<u32>) -> Result<()> {
    let image = png_bytes(path, &picture.svg(), width)?;
    Ok(write_atomically(path, &image)?)
}

fn png_bytes(path: &Path, svg: &str, width: Option<u32>) -> Result<Vec<u8>> {
    Ok(png(svg, width).map_err(|error| not_drawn(path, &error))?)
}

pub(crate) fn draw_svg(path: &Path, picture: &Picture<'_>) -> Result<()> {
    Ok(write_atomically(path, picture.svg().as_bytes())?)
}

pub(crate) fn not_drawn(path: &Path, error: &ViewError) -> InputError {
    InputError::new(path.display().to_string(), error.reason.as_str()).hint(error.hint)
}

/// A file that gets its name once it is whole. It is made when it is first written to:
/// until then a host that is interrupted, while a planner runs, leaves nothing behind.
pub(crate) struct Unnamed {
    path: PathBuf,
    folder: PathBuf,
    file: Option<Content>,
}

enum Content {
    Temporary(NamedTempFile),
    /// A device or a pipe cannot be replaced.
    Direct(File),
}

impl Unnamed {
    pub(crate) fn beside(path: &Path) -> Result<BufWriter<Self>> {
        let failed = |error: io::Error| {
            cannot_write(path, &error).hint("does its folder exist, and may you write to it?")
        };
        let old = std::fs::metadata(path).ok();
        if old
            .as_ref()
            .is_some_and(|old| !old.is_file() && !old.is_dir())
        {
            let file = create_output(path).map_err(failed)?;
            return Ok(BufWriter::new(Self {
                path: path.to_owned(),
                folder: PathBuf::new(),
                file: Some(Content::Direct(file)),
            }));
        }
        if old.is_some_and(|old| old.is_dir()) {
            return Err(failed(io::ErrorKind::IsADirectory.into()).into());
        }
        let target = resolved(path);
        let folder = target
            .parent()
            .filter(|folder| !folder.as_os_str().is_empty());
        let unnamed = Self {
            path: path.to_owned(),
            folder: folder.unwrap_or(Path::new(".")).to_owned(),
            file: None,
        };
        // Tried now and not when the planner's budget has been spent.
        unnamed.create().map_err(failed)?;
        Ok(BufWriter::with_capacity(1 << 16, unnamed))
    }

    fn create(&self) -> io::Result<NamedTempFile> {
        // Others may read what the user lets them; temporary files are private else.
        tempfile::Builder::new()
            .permissions(Permissions::from_mode(0o666))
            .tempfile_in(&self.folder)
    }
}

/// Gives the file its name, if anything was written.
pub(crate) fn keep(file: BufWriter<Unnamed>) -> Result<()> {
    let Unnamed { path, file, .. } = file.into_inner().map_err(|failed| {
        let (error, file) = failed.into_parts();
        cannot_write(&file.get_ref().path, &error)
    })?;
    if let Some(Content::Temporary(file)) = file {
        let kept = file.persist(resolved(&path));
        kept.map_err(|error| cannot_write(&path, &error.error))?;
    }
    Ok(())
}

/// Through a symbolic link, the file that it points to.
fn resolved(path: &Path) -> PathBuf {
    std::fs::canonicalize(path).unwrap_or_else(|_| path.to_owned())
}

fn cannot_write(path: &Path, error: &io::Error) -> InputError {
    InputError::new(
        path.display().to_string(),
        format!("cannot be written: {error}"),
    )
}

impl Write for Unnamed {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.file.is_none() {
            self.file = Some(Content::Temporary(self.create()?));
        }
        match &mut self.file {
            Some(Content::Temporary(file)) => file.write(bytes),
            Some(Content::Direct(file)) => file.write(bytes),
            None => Ok(0),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match &mut self.file {
            Some(Content::Temporary(file)) => file.flush(),
            Some(Content::Direct(file)) => file.flush(),
            None => Ok(()),
        }
    }
}

/// A trace file with the states of every so many ticks.
pub(crate) fn trace_file(path: &Path, every: u32) -> Result<TraceWriter<BufWriter<Unnamed>>> {
    let options = TraceOptions {
        every,
        ..TraceOptions::default()
    };
    Ok(TraceWriter::with_options(Unnamed::beside(path)?, options))
}
