//! Command adapters: a planner that is an existing command-line solver, described
//! by a `planner.toml`.
//!
//! An [`Adapter`] is a [`Catalog`] with one planner, and the worker process serves
//! it as it serves a library; the solver is a child of the worker, under the same
//! supervisor and in the same sandbox. The adapter writes the problem as files of the
//! solver's own formats into a folder, fills in the solver's arguments, runs it,
//! and reads its answer. It believes nothing: the plan is judged like any other, and
//! an answer that is not in the declared format breaks the contract.
//!
//! [`Manifest`] is the file, `problem` has grids, roadmaps and the plane in solvers' terms,
//! [`fleetyard_core::formats`] reads answers, `process` runs programs.

mod input;
mod manifest;
mod problem;
mod process;
mod solver;
mod template;
#[cfg(test)]
mod tests;

use std::env;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{Arc, OnceLock};
use std::time::Instant;

use fleetyard_abi::object::Object;
use fleetyard_abi::sdk::{Catalog, Failure, Options, Sink};
use fleetyard_abi::{Descriptor, Kind, LogLevel, Status};
use fleetyard_core::{InputError, is_unseen, read_file};

pub(crate) use manifest::FORMAT;
pub use manifest::{MANIFEST_LIMIT, Manifest};

use crate::{Fault, check_options};
use manifest::{VersionArgument, VersionQuery};
use process::{Captured, End, Outputs};
use solver::Solver;
use template::Slot;

/// A solver that a manifest describes.
#[derive(Debug)]
pub struct Adapter {
    installed: Arc<Installed>,
    /// The solver's answer, asked once.
    version: OnceLock<Result<String, String>>,
}

/// A manifest, and where it and the solver are.
#[derive(Debug)]
struct Installed {
    manifest: Manifest,
    folder: PathBuf,
    program: PathBuf,
    /// True if the variable or the search path of the host's user says where that is,
    /// rather than the manifest.
    chosen_by_host: bool,
}

impl Adapter {
    /// Reads the manifest at `path` and finds its program. Starts nothing.
    pub fn open(path: &Path) -> Result<Self, Fault> {
        let refused = |error: InputError| Fault::File {
            reason: error.to_string(),
            hint: error.hint,
        };
        let source = path.display().to_string();
        let manifest = read_file(path, MANIFEST_LIMIT)
            .and_then(|bytes| {
                let text = String::from_utf8(bytes)
                    .map_err(|_| InputError::new(source.as_str(), "the file is not UTF-8 text"))?;
                Manifest::read(&text, &source)
            })
            .map_err(refused)?;
        let absolute = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
        let folder = absolute.parent().unwrap_or(Path::new("/")).to_owned();
        let (program, chosen_by_host) = find_program(&manifest, &folder).map_err(refused)?;
        Ok(Self {
            installed: Arc::new(Installed {
                manifest,
                folder,
                program,
                chosen_by_host,
            }),
            version: OnceLock::new(),
        })
    }

    /// The program that is started.
    pub fn program(&self) -> &Path {
        &self.installed.program
    }

    /// True if the host's user says where the program is, by a variable or the search path,
    /// rather than the manifest by a path.
    pub fn is_chosen_by_host(&self) -> bool {
        self.installed.chosen_by_host
    }

    /// Paths that the manifest says the solver must be able to read, besides itself
    /// and the manifest's folder.
    pub fn readable(&self) -> Vec<PathBuf> {
        let Installed {
            manifest, folder, ..
        } = &*self.installed;
        manifest
            .head
            .files
            .read
            .iter()
            .map(|path| folder.join(path))
            .collect()
    }

    /// Environment variables that [`open`](Self::open) looks at: a process that
    /// opens the adapter again must have them.
    pub fn variables(&self) -> Vec<&str> {
        let variable = self.installed.manifest.program.variable.as_deref();
        ["PATH"].into_iter().chain(variable).collect()
    }

    fn version(&self) -> &Result<String, String> {
        self.version.get_or_init(|| {
            let version = &self.installed.manifest.version;
            match &version.query {
                None => Ok(version.text.clone()),
                Some(query) => self.ask_version(query),
            }
        })
    }

    /// The solver is not the one that the manifest was written for.
    fn unsuitable(&self, what: &str) -> Failure {
        let Installed {
            manifest, program, ..
        } = &*self.installed;
        let (program, hint) = (program.display(), install_hint(manifest));
        Failure::new(
            Status::InternalError,
            format!("{program} {what}; hint: {hint}"),
        )
    }

    /// Starts the solver to ask for its version.
    fn ask_version(&self, query: &VersionQuery) -> Result<String, String> {
        const KEPT: usize = 1 << 16;
        const LONGEST: usize = 100;
        let Installed {
            folder, program, ..
        } = &*self.installed;
        let mut command = Command::new(program);
        for VersionArgument(template) in &query.args {
            command.arg(template.render(|slot| match slot {
                Slot::ManifestDir => folder.clone().into(),
                // The manifest's reader lets no other pass.
                _ => "".into(),
            }));
        }
        let begun = Instant::now();
        let outputs = Outputs {
            stdout: Captured::new(KEPT, 0),
            stderr: Captured::new(KEPT, 0),
            stdout_line: &mut |_| {},
            stderr_line: &mut |_| {},
        };
        let ended = process::run(command.current_dir(env::temp_dir()), outputs, &|| {
            begun.elapsed().as_secs() >= query.seconds
        })
        .map_err(|error| format!("{} cannot be started: {error}", program.display()))?;
        if ended.end == End::Stopped {
            return Err(format!("it took longer than {} s", query.seconds));
        }
        let texts = [ended.stdout.into_bytes(), ended.stderr.into_bytes()];
        let found = texts.iter().find_map(|text| query.pattern.captures(text));
        let version = found.and_then(|found| {
            let text = String::from_utf8_lossy(found.get(1)?.as_bytes());
            Some(text.trim().chars().take(LONGEST).collect::<String>())
        });
        version
            .filter(|text| !text.is_empty() && !text.contains(is_unseen))
            .ok_or_else(|| format!("it {}, and the pattern found nothing", ended.end))
    }
}

fn is_executable(path: &Path) -> bool {
    path.metadata()
        .is_ok_and(|meta| meta.is_file() && meta.permissions().mode() & 0o111 != 0)
}

/// The program of a manifest: where its variable says, else where its command says. And
/// whether it was the host's user who said so.
fn find_program(manifest: &Manifest, folder: &Path) -> Result<(PathBuf, bool), InputError> {
    let program = &manifest.program;
    let command = program.command.as_str();
    let refused = |reason: String| {
        let error = program.place.error(reason);
        error.hint(install_hint(manifest))
    };
    let set = |name: &str| env::var_os(name).filter(|value| !value.is_empty());
    if let Some(name) = &program.variable
        && let Some(value) = set(name)
    {
        let path = std::path::absolute(&value).unwrap_or_else(|_| value.into());
        if is_executable(&path) {
            return Ok((path, true));
        }
        let shown = path.display();
        return Err(refused(format!("{name} is {shown}, which is no program")));
    }
    if command.contains('/') {
        let path = folder.join(command);
        let path = std::path::absolute(&path).unwrap_or(path);
        if is_executable(&path) {
            return Ok((path, false));
        }
        let wrong = if path.exists() {
            "is no program that may be executed"
        } else {
            "does not exist"
        };
        return Err(refused(format!("{} {wrong}", path.display())));
    }
    let folders = set("PATH").unwrap_or_else(|| "/usr/local/bin:/usr/bin:/bin".into());
    env::split_paths(&folders)
        .filter(|folder| folder.is_absolute())
        .map(|folder| folder.join(command))
        .find(|path| is_executable(path))
        .map(|path| (path, true))
        .ok_or_else(|| {
            let error = refused(format!("the program `{command}` is not on PATH"));
            if folder.join(command).exists() {
                return error.hint(format!("\"./{command}\" is the file beside the manifest"));
            }
            error
        })
}

/// The way to get a program that is missing.
fn install_hint(manifest: &Manifest) -> String {
    let program = &manifest.program;
    let get = match (&program.install, manifest.head.homepage.as_str()) {
        (Some(text), _) => text.clone(),
        (None, "") => "install it".to_owned(),
        (None, homepage) => format!("get it from {homepage}"),
    };
    match &program.variable {
        Some(name) => format!("{get}; {name} may name the program"),
        None => get,
    }
}

impl Catalog for Adapter {
    fn descriptors(&self) -> Vec<Descriptor> {
        let manifest = &self.installed.manifest;
        let version = self.version().as_ref();
        let mut description = manifest.head.description.trim().to_owned();
        if !manifest.head.homepage.is_empty() {
            let gap = if description.is_empty() { "" } else { " " };
            description = format!("{description}{gap}<{}>", manifest.head.homepage);
        }
        vec![Descriptor {
            version: version.unwrap_or(&manifest.version.text).clone(),
            license: manifest.head.license.clone(),
            capabilities: manifest.capabilities,
            options_schema: manifest.options.clone(),
            features: manifest.input.problem.features(),
            name: if manifest.head.name.is_empty() {
                manifest.head.id.clone()
            } else {
                manifest.head.name.clone()
            },
            ..Descriptor::new(Kind::Planner, manifest.head.id.as_str(), description)
        }]
    }

    fn create(
        &self,
        kind: Kind,
        id: &str,
        options: Options<'_>,
        sink: &dyn Sink,
    ) -> Result<Object, Failure> {
        let manifest = &self.installed.manifest;
        if kind != Kind::Planner || id != manifest.head.id {
            let reason = format!("there is no {kind} `{id}`");
            return Err(Failure::new(Status::Unsupported, reason));
        }
        match (self.version(), manifest.version.supported()) {
            (Ok(version), Some((text, whole))) if !whole.is_match(version.as_bytes()) => {
                return Err(self.unsuitable(&format!(
                    "is version {version}, and the manifest is for `{text}`"
                )));
            }
            (Err(reason), Some((text, _))) => {
                return Err(self.unsuitable(&format!(
                    "did not say its version, and the manifest is for `{text}`: {reason}"
                )));
            }
            (Err(reason), None) => {
                let text = format!("the solver did not say its version: {reason}");
                sink.log(LogLevel::Warning, &text);
            }
            (Ok(_), _) => {}
        }
        let options: serde_json::Map<_, _> = options.parse()?;
        check_options(&options, &manifest.options)
            .map_err(|error| Failure::new(Status::InvalidInput, error.reason))?;
        Solver::new(self.installed.clone(), options).map(|solver| Object::Planner(Box::new(solver)))
    }
}
