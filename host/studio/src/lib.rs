//! The studio: one document of a world, its robots and their tasks, edited, planned for and watched in a
//! browser on this machine.
//!
//! The server owns the document and its version. Whatever takes long is the command itself, started as a
//! process of its own with the files of the document, so that a page sees what the command line would
//! have made.

#![forbid(unsafe_code)]

pub mod artefacts;
pub mod document;
pub mod edit;
pub mod files;
pub mod history;
mod place;

pub use artefacts::Artefacts;
pub use document::Document;
pub use edit::{Edit, Refusal};
pub use history::History;
