//! A file that has plugins: what it is, and what its code is.

use std::fmt::Write as _;
use std::fs;
use std::io::Read;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use fleetyard_core::{Digest, Hasher, open_regular};
use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};

use crate::Fault;
use crate::adapter::Adapter;
use crate::supervisor::Target;

/// The name of a manifest, alone or after a name and a dot.
const MANIFEST: &str = "planner.toml";

/// Whether a file's name says that it is a manifest; a folder may hold other TOML
/// files.
pub(crate) fn is_manifest(path: &Path) -> bool {
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

impl Attach {
    /// Its name in records and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::InProcess => "in-process",
            Self::Worker => "worker",
            Self::Stdio => "stdio",
            Self::Command => "command",
        }
    }
}

/// A file of a plugin's code.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CodeFile {
    /// Where it is.
    pub path: PathBuf,
    /// The SHA-256 of its content, in hexadecimal digits as `sha256sum` prints it.
    pub sha256: String,
}

impl CodeFile {
    /// Reads the file and takes its digest.
    pub fn read(path: PathBuf) -> Result<Self, Fault> {
        let hash = || -> std::io::Result<String> {
            let mut file =
                open_regular(&path).map_err(|error| std::io::Error::other(error.reason))?;
            let mut hasher = Sha256::new();
            let mut buffer = vec![0; 1 << 16];
            loop {
                match file.read(&mut buffer)? {
                    0 => break,
                    read => hasher.update(&buffer[..read]),
                }
            }
            let mut text = String::with_capacity(64);
            for byte in hasher.finalize() {
                // Writing to a string cannot fail.
                let _ = write!(text, "{byte:02x}");
            }
            Ok(text)
        };
        match hash() {
            Ok(sha256) => Ok(Self { path, sha256 }),
            Err(error) => Err(Fault::refused(format!("{}: {error}", path.display()))),
        }
    }
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

    /// Stands for the content of the code; of the built-ins, for this program. It
    /// identifies, and is no defence: [`code`](Self::code) is.
    pub fn digest(&self) -> Option<Digest> {
        // This program does not change while it runs, and is large.
        static BUILT_IN: OnceLock<Option<Digest>> = OnceLock::new();
        match self {
            Self::BuiltIn => *BUILT_IN.get_or_init(|| self.read_digest()),
            _ => self.read_digest(),
        }
    }

    fn read_digest(&self) -> Option<Digest> {
        let mut hasher = Hasher::new("fleetyard plugin");
        for path in self.code_paths().ok()? {
            let mut bytes = Vec::new();
            open_regular(&path).ok()?.read_to_end(&mut bytes).ok()?;
            hasher.bytes(&bytes);
        }
        Some(hasher.finish())
    }

    /// Every file that is the plugin's code, and what is in it. Starts nothing, and is
    /// empty for the built-ins.
    ///
    /// Covered are a library, a program or script, and of a command adapter the manifest
    /// and the program. Not covered is what these load: shared libraries, imported
    /// modules, interpreters, data.
    pub fn code(&self) -> Result<Vec<CodeFile>, Fault> {
        if *self == Self::BuiltIn {
            return Ok(Vec::new());
        }
        self.code_paths()?.into_iter().map(CodeFile::read).collect()
    }

    fn code_paths(&self) -> Result<Vec<PathBuf>, Fault> {
        let path = self.path().unwrap_or(Path::new("/proc/self/exe"));
        let mut paths = vec![path.to_owned()];
        if let Self::Adapter(manifest) = self {
            paths.push(Adapter::open(manifest)?.program().to_owned());
        }
        Ok(paths)
    }

    /// The file, if it is one.
    pub fn path(&self) -> Option<&Path> {
        match self {
            Self::BuiltIn => None,
            Self::Library(path) | Self::Program(path, _) | Self::Adapter(path) => Some(path),
        }
    }
}
