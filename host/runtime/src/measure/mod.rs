//! Fair measurement: facts about the machine, cores that a trial has to itself, and
//! the load on them meanwhile.
//!
//! Three parts, which know nothing of plugins or trials: [`machine`] reads facts
//! that do not change, [`cores`] reserves physical cores, to which [`pin`] confines
//! processes, and [`load`] compares the kernel's counters before and after, which
//! [`contention`] judges. None of it limits
//! anything, and none of it may be needed to run: a value that the machine does
//! not tell is absent, never zero, and cores that cannot be had are a reason to
//! record, not a failure.
//!
//! The rules of what must be controlled and what must be reported follow Beyer, Löwe and Wendler,
//! "Reliable benchmarking: requirements and solutions", STTT 21 (2019). `docs/performance.md` lists
//! every figure with its unit and source.

pub mod contention;
mod core_locks;
pub mod cores;
mod cpus;
mod layout;
pub mod load;
pub mod machine;
mod pinning;
mod source;

pub use contention::{Call, Cause, Reason, Spent, contended};
pub use core_locks::NoCores;
pub use cores::{Reservation, Topology};
pub use cpus::{Cpus, affinity};
pub use load::{Difference, Snapshot};
pub use machine::Machine;
pub use pinning::{pin, pin_this_process};

#[cfg(test)]
mod fixture;
