//! The sandbox: what a plugin may see and do, and which layers make it so.
//!
//! A plugin is taken to be buggy or competitive, not to carry an exploit of the
//! kernel. Each [`Layer`] takes something away from it; no layer is needed by
//! another to be of use, and what one machine refuses another one grants. So the
//! layers are tried as a whole chain, every time that a plugin is started, and a
//! refusal costs that layer alone and is written into the record with its error
//! number. [`Level`] says what to do about it.
//!
//! `jail` makes the namespaces, `init` is the first process in them, `packets` is what the
//! two say to each other, `root` builds the tree of files, `lockdown` takes rights away from
//! the plugin's own process before any code of the plugin runs (constructors of libraries
//! included), `syscalls` is the table of system calls, `grants` finds what a plugin needs to read,
//! `bwrap` is the way in where only that program may make namespaces.

mod attempts;
mod bwrap;
mod devices;
mod grants;
mod init;
pub(crate) mod jail;
pub(crate) mod launch;
mod lockdown;
mod packets;
mod policy;
mod refusal;
mod report;
mod root;
mod syscalls;

pub(crate) use attempts::Targets;
pub use attempts::{Attempt, Victims};
pub(crate) use bwrap::{INSIDE_ARGUMENT, enter as enter_from_bwrap};
pub use devices::devices;
pub use grants::out_of_reach;
pub(crate) use grants::{
    Declared, Grants, Hidden, Interpreter, Python, aside, find_program, own, python,
};
pub use policy::Policy;
use refusal::{Refusal, Remark};
pub use report::{
    Backend, Filter, Keeper, Layer, LayerState, Level, LimitState, Profile, SandboxReport,
};
