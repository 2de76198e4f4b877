//! Files of the repository, and what cargo built of it.

use std::fs;
use std::path::{Path, PathBuf};

/// The repository.
pub fn root() -> PathBuf {
    let manifest = Path::new(env!("CARGO_MANIFEST_DIR"));
    manifest.join("../..").canonicalize().unwrap()
}

/// The folder of what cargo builds with the profile of the tests, the command among them.
pub(crate) fn built() -> PathBuf {
    let test = std::env::current_exe().unwrap();
    let folder = test.parent().and_then(Path::parent);
    folder.unwrap().to_owned()
}

/// The command under test.
pub fn fleetyard() -> PathBuf {
    built().join("fleetyard")
}

/// A folder for what tests build, which stays.
pub(crate) fn kept(name: &str) -> PathBuf {
    let folder = built().join("../tmp").join(name);
    fs::create_dir_all(&folder).unwrap();
    folder.canonicalize().unwrap()
}

/// A file of `maps/`, as text for arguments.
pub fn map(name: &str) -> String {
    root().join("maps").join(name).display().to_string()
}

/// Arguments that name an instance of `maps/`.
pub fn instance(name: &str, agents: usize) -> Vec<String> {
    let (map, scen) = (
        map(&format!("{name}.map")),
        map(&format!("{name}-random-1.scen")),
    );
    [
        "--map",
        &map,
        "--scen",
        &scen,
        "--agents",
        &agents.to_string(),
    ]
    .map(str::to_owned)
    .to_vec()
}
