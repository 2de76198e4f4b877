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
mod installed;
mod manifest;
mod problem;
mod process;
mod solver;
mod template;
#[cfg(test)]
mod tests;

use std::env;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{Arc, OnceLock};
use std::time::Instant;

use fleetyard_abi::object::Object;
use fleetyard_abi::sdk::{Catalog, Failure, Options, Sink};
use fleetyard_abi::{Descriptor, Kind, LogLevel, Status};
use fleetyard_core::is_unseen;

pub(crate) use manifest::FORMAT;
pub use manifest::{MANIFEST_LIMIT, Manifest};

use crate::confinement::sandbox::Declared;
use crate::{Fault, check_options};
use installed::{Installed, install_hint};
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

/// The needs of the solver that the manifest at `path` describes.
pub(crate) fn declared(path: &Path) -> Result<Declared, Fault> {
    let adapter = Adapter::open(path)?;
    Ok(Declared {
        program: adapter.program().to_owned(),
        chosen_by_host: adapter.is_chosen_by_host(),
        read: adapter.readable(),
        variables: adapter
            .variables()
            .iter()
            .map(ToString::to_string)
            .collect(),
    })
}

impl Adapter {
    /// Reads the manifest at `path` and finds its program. Starts nothing.
    pub fn open(path: &Path) -> Result<Self, Fault> {
        Ok(Self {
            installed: Arc::new(Installed::open(path)?),
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
