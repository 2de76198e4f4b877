//! Bundles: a finished suite in one archive, from which somebody else repeats it.
//!
//! A bundle is a gzipped tar of one folder: the suite with its paths pointing into the folder, maps,
//! scenarios, tasks and fleet files, a copy of the store, the plans that it has kept, the files of plugins
//! if they are wanted, and a manifest with the digests of all of it. Equal stores and files give
//! equal bytes.

mod archive;
mod make;
mod manifest;
mod open;
mod rewrite;
#[cfg(test)]
mod tests;

pub use archive::{Unpack, unpack, untar};
pub use make::{Bundled, Wanted, bundle};
pub use manifest::{BundledFile, BundledModule, BundledPlanner, BundledPlans, FORMAT, Manifest};
pub use open::{Bundle, recorded};

/// The suite in the bundle's folder.
const SUITE: &str = "suite.toml";

/// The plans in the bundle's folder.
const PLANS: &str = "plans";
