//! One file per command, with its arguments.

pub(crate) mod bench;
mod bundle;
pub(crate) mod check;
pub(crate) mod compare;
pub(crate) mod completions;
pub(crate) mod convert;
pub(crate) mod doctor;
mod export;
pub(crate) mod fleet;
pub(crate) mod jobs;
pub(crate) mod man;
pub(crate) mod maps;
pub(crate) mod new;
pub(crate) mod pin;
pub(crate) mod plugins;
pub(crate) mod report;
pub(crate) mod run;
pub(crate) mod security;
mod show;
pub(crate) mod simulate;
pub(crate) mod store;
mod task;
pub(crate) mod trace;
pub(crate) mod validate;
mod validate_plane;
mod verdict;
pub(crate) mod world;
