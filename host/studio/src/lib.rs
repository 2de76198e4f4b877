//! The studio: one document of a world, its robots and their tasks, edited, planned for and watched in a
//! browser on this machine.
//!
//! The server owns the document and its version. Whatever takes long is the command itself, started as a
//! process of its own with the files of the document, so that a page sees what the command line would
//! have made. `docs/studio-protocol.md` says how a page or a script talks to it.

#![forbid(unsafe_code)]

mod access;
mod answer;
pub mod artefacts;
mod desk;
pub mod document;
pub mod edit;
mod feed;
pub mod files;
pub mod history;
mod jobs;
mod peer;
mod place;
mod planners;
mod recordings;
mod reservations;
mod routes;
mod scratch;
mod server;
mod suite;
mod visitors;
mod waits;
mod web;

pub use answer::Refused;
pub use artefacts::Artefacts;
pub use desk::Changing;
pub use document::Document;
pub use edit::{Edit, Refusal};
pub use feed::Message;
pub use history::History;
pub use jobs::ask::Asked;
pub use server::{Config, Server, Stopper};

/// The version of the protocol: it grows by keys and routes, and this number changes where anything is
/// taken away or means something else.
pub const PROTOCOL: u32 = 1;
