//! The solver of a manifest, where it is installed.

use std::env;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

use fleetyard_core::{InputError, read_file};

use super::manifest::{MANIFEST_LIMIT, Manifest};
use crate::Fault;

/// A manifest, and where it and the solver are.
#[derive(Debug)]
pub(super) struct Installed {
    pub(super) manifest: Manifest,
    pub(super) folder: PathBuf,
    pub(super) program: PathBuf,
    /// True if the variable or the search path of the host's user says where that is,
    /// rather than the manifest.
    pub(super) chosen_by_host: bool,
}

impl Installed {
    /// Reads the manifest at `path` and finds its program.
    pub(super) fn open(path: &Path) -> Result<Self, Fault> {
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
            manifest,
            folder,
            program,
            chosen_by_host,
        })
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
pub(super) fn install_hint(manifest: &Manifest) -> String {
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
