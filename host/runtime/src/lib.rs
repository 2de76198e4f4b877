//! Loads plugins, runs them under budgets, and says how each run ended.
//!
//! A [`Session`] is one plugin in one of four attachments: a shared library in
//! the host's process, a shared library in a worker process, a program that
//! speaks JSON over standard input and output, or a command-line solver that an
//! [`adapter`] describes and a worker process starts. Worker and program run under
//! a [`supervisor`] process each, which kills the whole process tree when
//! the budget ends or the host goes away. The same C ABI and the same
//! [`fleetyard_abi::sdk`] traits stand at every seam.
//!
//! This crate does not judge plans (`fleetyard-check` does), and it knows no
//! files but plugins.

// Loading libraries and supervising processes is what this crate is for.
#![allow(unsafe_code)]

pub mod adapter;
pub mod bounds;
mod cgroup;
mod client;
mod collector;
mod convert;
mod discover;
mod fault;
mod incoming;
mod interrupt;
mod library;
mod link;
mod lock;
mod log;
pub mod measure;
mod memory;
pub mod message;
mod monitor;
mod options;
mod plugin_file;
mod process;
mod promises;
mod python;
mod remove;
pub mod sandbox;
mod selftest;
mod session;
mod state;
pub mod supervisor;
mod tree;

pub use convert::{environment, environment_of, instance, plan_from_abi};
pub use discover::{Discovered, Discovery, Found, Origin, by_name, by_path, first_with};
pub use fault::Fault;
pub use interrupt::{interrupt_calls, interrupted_by, on_interrupt};
pub use library::Library;
pub use lock::{LOCK_FILE, Lock, Pinned, PinnedPlugin, Standing, Trust};
pub use log::LogLine;
pub use monitor::{CallUsage, Limit, Source, Usage};
pub use options::{OptionError, check_options, parse_option};
pub use plugin_file::{Attach, CodeFile, PluginFile};
pub use promises::BrokenPromise;
pub use sandbox::{
    Filter, Keeper, Layer, LayerState, Level, LimitState, Policy, Profile, SandboxReport,
};
pub use session::{
    CallReport, Closing, Contract, HostTime, Incumbent, Introduction, Limits, PlanRun, Runtime,
    Session, Termination,
};

/// The user that this process runs as.
pub fn user() -> u32 {
    rustix::process::geteuid().as_raw()
}
