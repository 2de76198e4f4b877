//! Where plugins are: by path, on the plugin path, or linked in.

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

use fleetyard_abi::{Descriptor, Kind};
use fleetyard_core::{Digest, Hasher};
use serde::Serialize;

use crate::adapter::Adapter;
use crate::options::nearest;
use crate::supervisor::Target;
use crate::{Fault, Runtime};

/// The name of a manifest, alone or after a name and a dot.
const MANIFEST: &str = "planner.toml";

/// Whether a file's name says that it is a manifest; a folder may hold other TOML
/// files.
fn is_manifest(path: &Path) -> bool {
    let name = path.file_name().and_then(|name| name.to_str());
    name.and_then(|name| name.strip_suffix(MANIFEST))
        .is_some_and(|before| before.is_empty() || before.ends_with('.'))
}

/// How a plugin is attached.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
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

/// Where a plugin comes from.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Origin {
    /// Linked into the host.
    BuiltIn,
    /// A file that the user named.
    Path,
    /// A file in a folder of the plugin path.
    Folder(PathBuf),
}

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
        let meta = fs::metadata(path).map_err(|error| {
            refused(
                format!("{shown}: {error}"),
                "a plugin is a shared library, a program or a planner.toml",
            )
        })?;
        if !meta.is_file() {
            let manifest = path.join(MANIFEST);
            if manifest.is_file() {
                return Self::at(&manifest);
            }
            return Err(refused(
                format!("{shown} is not a file"),
                "name the plugin's file itself, or a folder with a planner.toml",
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

    /// What the supervisor starts.
    pub(crate) fn target(&self) -> Target {
        match self {
            Self::BuiltIn => Target::BuiltIn,
            Self::Library(path) => Target::Library(path.clone()),
            Self::Program(_, argv) => Target::Program(argv.clone()),
            Self::Adapter(path) => Target::Adapter(path.clone()),
        }
    }

    /// How the plugin is attached unless the user says otherwise.
    pub fn default_attach(&self) -> Attach {
        match self {
            Self::BuiltIn | Self::Library(_) => Attach::Worker,
            Self::Program(..) => Attach::Stdio,
            Self::Adapter(_) => Attach::Command,
        }
    }

    /// Stands for the content of the file; of the built-ins, for this program; of a
    /// manifest, for its program as well.
    pub fn digest(&self) -> Option<Digest> {
        let path = self.path().unwrap_or(Path::new("/proc/self/exe"));
        let mut hasher = Hasher::new("fleetyard plugin");
        hasher.bytes(&fs::read(path).ok()?);
        if let Self::Adapter(manifest) = self {
            let adapter = Adapter::open(manifest).ok()?;
            hasher.bytes(&fs::read(adapter.program()).ok()?);
        }
        Some(hasher.finish())
    }

    /// The file, if it is one.
    pub fn path(&self) -> Option<&Path> {
        match self {
            Self::BuiltIn => None,
            Self::Library(path) | Self::Program(path, _) | Self::Adapter(path) => Some(path),
        }
    }
}

/// One file of the plugin path and what it has, or why it was refused.
#[derive(Debug, Clone)]
pub struct Discovered {
    /// The file.
    pub file: PluginFile,
    /// Where it was found.
    pub origin: Origin,
    /// Its plugins.
    pub plugins: Result<Vec<Descriptor>, Fault>,
}

/// The search for plugins.
#[derive(Debug, Clone)]
pub struct Discovery {
    /// Folders, first match first.
    pub folders: Vec<PathBuf>,
}

impl Discovery {
    /// `FLEETYARD_PLUGIN_PATH`, the user's and the system's data folders, and
    /// `plugins` next to the executable.
    pub fn from_environment() -> Self {
        let set = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty());
        let mut folders: Vec<PathBuf> = Vec::new();
        if let Some(path) = set("FLEETYARD_PLUGIN_PATH") {
            folders.extend(std::env::split_paths(&path));
        }
        let home = set("HOME").map(PathBuf::from);
        let data_home = set("XDG_DATA_HOME")
            .map(PathBuf::from)
            .or(home.map(|home| home.join(".local/share")));
        let data = set("XDG_DATA_DIRS").unwrap_or_else(|| "/usr/local/share:/usr/share".into());
        for folder in data_home.into_iter().chain(std::env::split_paths(&data)) {
            folders.push(folder.join("fleetyard/plugins"));
        }
        if let Ok(executable) = std::env::current_exe() {
            folders.extend(executable.parent().map(|folder| folder.join("plugins")));
        }
        folders.retain(|folder| !folder.as_os_str().is_empty());
        Self { folders }
    }

    /// Files in the folders that may be plugins, in order of precedence.
    fn candidates(&self) -> Vec<(PluginFile, Origin)> {
        let mut found = Vec::new();
        for folder in &self.folders {
            let mut paths: Vec<PathBuf> = fs::read_dir(folder)
                .into_iter()
                .flatten()
                .flatten()
                .map(|entry| entry.path())
                .collect();
            paths.sort();
            for path in paths {
                match PluginFile::at(&path) {
                    Ok(PluginFile::Adapter(manifest)) if !is_manifest(&manifest) => {}
                    Ok(file) => found.push((file, Origin::Folder(folder.clone()))),
                    Err(_) => {}
                }
            }
        }
        found
    }

    /// How many files in the folders may be plugins.
    pub fn count(&self) -> usize {
        self.candidates().len()
    }

    /// Every file and what it has, then the built-ins. Runs each in a process of
    /// its own, and nothing but its descriptors.
    pub fn scan(&self, runtime: &Runtime) -> Vec<Discovered> {
        let built_in = (PluginFile::BuiltIn, Origin::BuiltIn);
        self.candidates()
            .into_iter()
            .chain([built_in])
            .map(|(file, origin)| {
                let plugins = runtime.describe(&file);
                Discovered {
                    file,
                    origin,
                    plugins,
                }
            })
            .collect()
    }

    /// Finds a plugin by path, `PATH:ID` or identifier, of one kind or of any.
    pub fn find(
        &self,
        runtime: &Runtime,
        kind: Option<Kind>,
        name: &str,
    ) -> Result<(PluginFile, Origin, Option<String>), Fault> {
        // `path:id` picks one of several plugins of a file.
        let (path, id) = match name.rsplit_once(':') {
            Some((path, id)) if !id.contains('/') => (path, Some(id.to_owned())),
            _ => (name, None),
        };
        if name.contains('/') || Path::new(path).is_file() {
            return PluginFile::at(Path::new(path)).map(|file| (file, Origin::Path, id));
        }
        let mut known: Vec<String> = Vec::new();
        for (file, origin) in self
            .candidates()
            .into_iter()
            .chain([(PluginFile::BuiltIn, Origin::BuiltIn)])
        {
            // A file that is refused is no reason not to look further;
            // `plugins list` shows it.
            let Ok(plugins) = runtime.describe(&file) else {
                continue;
            };
            let wanted = |plugin: &Descriptor| kind.is_none_or(|kind| kind == plugin.kind);
            for plugin in plugins.into_iter().filter(wanted) {
                if plugin.id == name {
                    return Ok((file, origin, Some(plugin.id)));
                }
                known.push(plugin.id);
            }
        }
        let hint = match nearest(name, known.iter(), 2) {
            Some(candidate) => format!("did you mean `{candidate}`?"),
            None => format!(
                "known: {}; or name a file, as in ./{name}",
                known.join(", ")
            ),
        };
        Err(Fault::Refused {
            reason: format!(
                "there is no {} `{name}`",
                kind.map_or("plugin", Kind::as_str)
            ),
            hint: Some(hint),
        })
    }
}
