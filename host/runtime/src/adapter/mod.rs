//! Command adapters: a planner that is an existing command-line solver, described
//! by a `planner.toml`.
//!
//! An [`Adapter`] is a [`Catalog`] with one planner, and the worker process serves
//! it as it serves a library; the solver is a child of the worker, under the same
//! supervisor and in the same sandbox.

#[expect(dead_code, reason = "the sections that need the rest follow")]
mod document;
mod manifest;

use std::path::Path;

use fleetyard_abi::sdk::{Catalog, Failure, Object, Options, Sink};
use fleetyard_abi::{Capabilities, Capability, Descriptor, Kind, Status};
use fleetyard_core::{InputError, read_file};

pub use manifest::{MANIFEST_LIMIT, Manifest, Program};

use crate::Fault;

/// A solver that a manifest describes.
#[derive(Debug)]
pub struct Adapter {
    manifest: Manifest,
}

impl Adapter {
    /// Reads the manifest at `path`. Starts nothing.
    pub fn open(path: &Path) -> Result<Self, Fault> {
        let source = path.display().to_string();
        let manifest = read_file(path, MANIFEST_LIMIT)
            .and_then(|bytes| {
                let text = String::from_utf8(bytes)
                    .map_err(|_| InputError::new(source.as_str(), "the file is not UTF-8 text"))?;
                Manifest::read(&text, &source)
            })
            .map_err(|error| Fault::Refused {
                reason: error.to_string(),
                hint: error.hint,
            })?;
        Ok(Self { manifest })
    }
}

impl Catalog for Adapter {
    fn descriptors(&self) -> Vec<Descriptor> {
        let manifest = &self.manifest;
        vec![Descriptor {
            name: manifest.name.clone(),
            version: manifest.version.clone(),
            license: manifest.license.clone(),
            capabilities: Capabilities::of(&[Capability::Grid, Capability::Pebble]),
            ..Descriptor::new(
                Kind::Planner,
                manifest.id.as_str(),
                manifest.description.as_str(),
            )
        }]
    }

    fn create(
        &self,
        kind: Kind,
        id: &str,
        _: Options<'_>,
        _: &dyn Sink,
    ) -> Result<Object, Failure> {
        let reason = format!("there is no {kind} `{id}`");
        Err(Failure::new(Status::Unsupported, reason))
    }
}
