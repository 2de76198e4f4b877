//! A file that has plugins, and the plugins of a folder.

use std::fs;
use std::io::{ErrorKind, Read};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

use fleetyard_core::{missing_hint, open_regular, words};

use crate::Fault;

/// The name of a manifest, alone or after a name and a dot.
const MANIFEST: &str = "planner.toml";

/// True if a file's name says that it is a manifest; a folder may hold other TOML
/// files.
fn is_manifest(path: &Path) -> bool {
    let name = path.file_name().and_then(|name| name.to_str());
    name.and_then(|name| name.strip_suffix(MANIFEST))
        .is_some_and(|before| before.is_empty() || before.ends_with('.'))
}

/// The name by which people know a plugin's file: its own without the end, and for a `planner.toml`
/// that of its folder. None for a path without a name.
pub fn plugin_name(path: &Path) -> Option<String> {
    let named = if path.file_name()? == MANIFEST {
        path.parent()?.file_name().unwrap_or(path.as_os_str())
    } else {
        path.file_stem()?
    };
    let name = named.to_string_lossy().into_owned();
    Some(match name.strip_suffix(".planner") {
        Some(name) if is_manifest(path) => name.to_owned(),
        _ => name,
    })
}

/// The way in which a plugin is attached.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Attach {
    /// A shared library in the host's own process: fastest, and nothing is kept
    /// from the host.
    InProcess,
    /// A shared library in a worker process.
    Worker,
    /// A program that speaks JSON over standard input and output.
    Stdio,
    /// A command-line solver that a `planner.toml` describes.
    Command,
}

words!(Attach {
    InProcess = "in-process", "A library in the host's own process: no isolation, results are unranked";
    Worker = "worker", "A library in a process of its own";
    Stdio = "stdio", "A program that speaks JSON over standard input and output";
    Command = "command", "A command-line solver that a planner.toml describes";
});

/// A file (or the host itself) that has plugins.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum PluginFile {
    /// Linked into the host.
    BuiltIn,
    /// A shared library.
    Library(PathBuf),
    /// A program, with the arguments that start it.
    Program(PathBuf, Vec<String>),
    /// The manifest of a command adapter.
    Adapter(PathBuf),
}

impl PluginFile {
    /// Looks at a path and says what it is, without running it.
    pub fn at(path: &Path) -> Result<Self, Fault> {
        let shown = path.display();
        let refused = |reason: String, hint: &str| Fault::Refused {
            reason,
            hint: Some(hint.into()),
        };
        let meta = fs::metadata(path).map_err(|error| Fault::File {
            reason: format!("{shown}: {error}"),
            hint: missing_hint(path)
                .filter(|_| error.kind() == ErrorKind::NotFound)
                .or_else(|| {
                    Some("a plugin is a shared library, a program or a planner.toml".into())
                }),
        })?;
        if meta.is_dir() {
            return Self::in_folder(path);
        }
        if !meta.is_file() {
            return Err(refused(
                format!("{shown} is not a file"),
                "name the plugin's file itself, or its folder",
            ));
        }
        // The loader searches its own path for a name without a slash.
        let absolute = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
        let program = absolute.to_string_lossy().into_owned();
        let extension = path.extension().and_then(|extension| extension.to_str());
        let executable = meta.permissions().mode() & 0o111 != 0;
        match extension {
            Some("so") => Ok(Self::Library(absolute)),
            Some("toml") => Ok(Self::Adapter(absolute)),
            Some("py") if !executable => {
                Ok(Self::Program(absolute, vec!["python3".into(), program]))
            }
            _ if executable => Ok(Self::Program(absolute, vec![program])),
            _ => Err(refused(
                format!("{shown} is neither a shared library (.so) nor executable"),
                "`chmod +x` a program; a library's name ends in .so",
            )),
        }
    }

    /// The plugin of a folder: its `planner.toml`, or the only library or program that it has,
    /// built by cargo or not.
    fn in_folder(folder: &Path) -> Result<Self, Fault> {
        let manifest = folder.join(MANIFEST);
        if manifest.is_file() {
            return Self::at(&manifest);
        }
        let mut found = candidates_in(folder);
        if found.is_empty() && folder.join("Cargo.toml").is_file() {
            found = candidates_in(&folder.join("target/release"));
            found.retain(|file| matches!(file, Self::Library(_)));
        }
        // A script that cannot be started by itself may be a plugin, or a module of one.
        let is_module = |file: &Self| matches!(file, Self::Program(_, argv) if argv.len() > 1);
        if found.len() > 1 {
            found.retain(|file| !is_module(file));
        }
        let shown = folder.display();
        let (reason, hint) = match &found[..] {
            [only] => return Ok(only.clone()),
            [] => (
                format!("{shown} has no plugin: no planner.toml, library or program"),
                "build it first, or name the plugin's file",
            ),
            several => {
                let paths = several.iter().filter_map(Self::path);
                let paths: Vec<String> = paths.map(|path| path.display().to_string()).collect();
                (
                    format!("{shown} has several plugins: {}", paths.join(", ")),
                    "name the file of one",
                )
            }
        };
        Err(Fault::Refused {
            reason,
            hint: Some(hint.into()),
        })
    }

    /// The plugin's attachment unless the user says otherwise.
    pub fn default_attach(&self) -> Attach {
        match self {
            Self::BuiltIn | Self::Library(_) => Attach::Worker,
            Self::Program(..) => Attach::Stdio,
            Self::Adapter(_) => Attach::Command,
        }
    }

    /// The file, if it is one.
    pub fn path(&self) -> Option<&Path> {
        match self {
            Self::BuiltIn => None,
            Self::Library(path) | Self::Program(path, _) | Self::Adapter(path) => Some(path),
        }
    }
}

/// The files of a folder that may be plugins, by name.
pub(crate) fn candidates_in(folder: &Path) -> Vec<PluginFile> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.path()).collect();
    paths.sort();
    paths.iter().filter_map(|path| candidate(path)).collect()
}

/// A file of a plugin folder that may be a plugin: what is no library, manifest or program is
/// there for people.
fn candidate(path: &Path) -> Option<PluginFile> {
    let hidden = path.file_name()?.as_encoded_bytes().starts_with(b".");
    // A folder within the folder has its own only where it says so.
    let manifest = path.is_dir().then(|| path.join(MANIFEST));
    let file = PluginFile::at(manifest.as_deref().unwrap_or(path)).ok();
    let file = file.filter(|_| !hidden)?;
    let may_be = match &file {
        PluginFile::Adapter(manifest) => is_manifest(manifest),
        PluginFile::Program(program, _) => is_program(program),
        PluginFile::Library(_) | PluginFile::BuiltIn => true,
    };
    may_be.then_some(file)
}

/// True if the kernel could start a file: on many file systems everything is marked
/// executable. Scripts in Python may also be started by name.
fn is_program(path: &Path) -> bool {
    let mut start = Vec::new();
    let read = open_regular(path).map(|file| file.take(4).read_to_end(&mut start));
    // One that cannot be read may be started all the same.
    !matches!(read, Ok(Ok(_)))
        || start.starts_with(b"\x7fELF")
        || start.starts_with(b"#!")
        || path.extension().is_some_and(|extension| extension == "py")
}
