//! Shared by the tests, benches and examples of several crates: the command in a folder of its
//! own, plugins that are built on the way, grid cases with a judge of plans, a host that takes
//! notes, Python with libraries, pages in a browser.
//!
//! Of the workspace it knows the contract alone, so that it shares nothing with what is tested.

#![forbid(unsafe_code)]

pub mod browser;
mod command;
pub mod devtools;
pub mod grid;
mod metadata;
mod notes;
mod places;
mod programs;
pub mod python;
pub mod studio;
mod table;

pub use command::{
    Ended, INPUT, INTERNAL, INVALID_PLAN, NO_PLAN, PLUGIN, Process, SUCCESS, Started, USAGE, Yard,
    have, is_ignored, until, words,
};
pub use grid::Case;
pub use metadata::{Dependency, Package, Target, packages};
pub use notes::Notes;
pub use places::{fleetyard, instance, map, root};
pub use programs::{
    Built, built_package, c_library, faulty_cpp_library, faulty_library, faulty_program,
    faulty_rust_library, library, prepare_package, turn_of_packages,
};
pub use table::each;
