//! Packages as cargo describes them.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde::Deserialize;

/// A package of a workspace.
#[derive(Debug, Deserialize)]
pub struct Package {
    /// Its name.
    pub name: String,
    /// Its version.
    pub version: String,
    /// The edition of its source.
    pub edition: String,
    /// Its `Cargo.toml`.
    pub manifest_path: PathBuf,
    /// Its features, each with what it asks for.
    pub features: BTreeMap<String, Vec<String>>,
    /// All that it depends on, tests and builds included.
    pub dependencies: Vec<Dependency>,
    /// Its libraries, programs, tests, benches and examples.
    pub targets: Vec<Target>,
}

/// A dependency of a package.
#[derive(Debug, Deserialize)]
pub struct Dependency {
    /// Its name.
    pub name: String,
    /// Versions that will do.
    pub req: String,
    /// `dev`, `build`, or nothing.
    pub kind: Option<String>,
    /// Features that are asked for.
    pub features: Vec<String>,
    /// True if a feature of the package has to ask for it.
    pub optional: bool,
    /// True if its default features are asked for.
    pub uses_default_features: bool,
}

impl Dependency {
    /// True if tests, benches and examples alone need it.
    pub fn is_for_tests(&self) -> bool {
        self.kind.as_deref() == Some("dev")
    }
}

/// A library, a program or a test of a package.
#[derive(Debug, Deserialize)]
pub struct Target {
    /// Kinds such as `lib`, `cdylib`, `bin`, `test`.
    pub kind: Vec<String>,
    /// Its root file.
    pub src_path: PathBuf,
    /// True if its unit tests are built.
    pub test: bool,
    /// True if the examples of its documentation are run.
    pub doctest: bool,
}

impl Package {
    /// The folder of the package.
    pub fn folder(&self) -> &Path {
        self.manifest_path.parent().unwrap()
    }
}

/// The packages of the workspace of a `Cargo.toml`.
pub fn packages(manifest: &Path) -> Vec<Package> {
    #[derive(Deserialize)]
    struct Metadata {
        packages: Vec<Package>,
    }
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let output = Command::new(cargo)
        .args(["metadata", "--no-deps", "--format-version", "1"])
        .arg("--manifest-path")
        .arg(manifest)
        .output()
        .unwrap();
    let messages = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{messages}");
    let metadata: Metadata = serde_json::from_slice(&output.stdout).unwrap();
    metadata.packages
}
