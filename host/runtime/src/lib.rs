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
//! The code is in three rooms, of which each knows those after it: `sessions` (attachments
//! and calls), `confinement` (processes, sandbox, limits), and [`measure`] (cores, load,
//! machine). Beside them stand the files of plugins: where they are, what their code is, and
//! which of it is pinned.
//!
//! This crate does not judge plans (`fleetyard-check` does), and it knows no
//! files but plugins.

// Loading libraries and supervising processes is what this crate is for.
#![allow(unsafe_code)]

mod able;
mod code;
mod companion;
mod confinement;
mod discover;
mod fault;
mod folders;
mod interrupt;
mod lock_file;
pub mod measure;
mod options;
mod plugin_file;
mod sessions;
mod usage;
mod user_folder;

pub use able::{Able, plural};
pub use code::{CodeFile, Identity};
pub use companion::as_companion;
pub use confinement::promises::BrokenPromise;
pub use confinement::sandbox;
pub use confinement::sandbox::{
    Filter, Keeper, Layer, LayerState, Level, LimitState, Policy, Profile, SandboxReport,
};
pub use discover::{Discovered, Found, by_name, by_path, first_with};
pub use fault::Fault;
pub use folders::{Discovery, Origin};
pub use interrupt::{interrupt_calls, interrupted_by, on_interrupt};
pub use lock_file::{LOCK_FILE, Lock, Pinned, PinnedPlugin, Standing, Trust};
pub use options::{OptionError, check_options, parse_option};
pub use plugin_file::{Attach, PluginFile, plugin_name};
pub use sessions::annotated::Annotated;
pub use sessions::attachment::{Closing, Generated};
pub use sessions::collector::{Follow, Incumbent};
pub use sessions::convert::{environment, environment_of, instance, plan_from_abi};
pub use sessions::library::Library;
pub use sessions::limits::Limits;
pub use sessions::log::LogLine;
pub use sessions::plan_run::{CallReport, HostTime, PlanRun, Termination};
pub use sessions::runtime::Runtime;
pub use sessions::session::{Contract, Introduction, Session};
pub use sessions::{adapter, bounds, message};
pub use usage::{CallUsage, Limit, Source, Usage, Work};

/// Supervisors: processes that own the process tree of a plugin each.
pub mod supervisor {
    pub use crate::confinement::control::{ARGUMENT, Report};
    pub use crate::confinement::target::Target;
    pub use crate::sessions::worker::intercept;
}

/// Lets this process have as many files open as it may, up to a number that serves all who look on:
/// the usual limit is that of programs that use `select`. Plugins have a limit of their own.
pub fn allow_open_files() {
    use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
    const MOST: u64 = 65_536;
    let Rlimit { current, maximum } = getrlimit(Resource::Nofile);
    let wanted = maximum.map_or(MOST, |maximum| maximum.min(MOST));
    if current.is_some_and(|current| current < wanted) {
        // Where it is refused, fewer can look on.
        let current = Some(wanted);
        let _ = setrlimit(Resource::Nofile, Rlimit { current, maximum });
    }
}

/// The user that this process runs as.
pub fn user() -> u32 {
    rustix::process::geteuid().as_raw()
}
