//! Confinement: plugins run in processes of their own, see and do what they are granted,
//! and end at their limits.
//!
//! [`process`] is the host's end: it starts a [`supervisor`] for a [`target`], to which it speaks
//! over a [`control`] socket. The supervisor sets up the [`sandbox`] with a [`cgroup`] where the
//! machine lets it, starts a [`child`] in it, lets [`monitor`] watch what the plugin uses
//! ([`memory`], [`process_tree`], [`counter`]), and ends everybody. [`state`] says which runs there are,
//! so that the next host ends what a killed one left, and [`remove`] clears their scratch
//! folders. [`promises`] holds for libraries in the host's own process, where nothing
//! confines them. [`python`] finds what an interpreter needs to read, and [`selftest`]
//! finds whether the allow list of system calls does harm on this machine.

pub(crate) mod cgroup;
pub(crate) mod child;
pub(crate) mod control;
mod counter;
pub(crate) mod memory;
pub(crate) mod monitor;
pub(crate) mod process;
pub(crate) mod process_tree;
pub(crate) mod promises;
pub(crate) mod python;
pub(crate) mod remove;
pub mod sandbox;
pub(crate) mod selftest;
pub(crate) mod state;
pub(crate) mod supervisor;
pub(crate) mod target;
pub(crate) mod transport;
