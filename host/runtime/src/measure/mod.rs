//! Fair measurement: what machine this is, which cores a trial has to itself, and
//! what else happened on them meanwhile.
//!
//! Three parts, which know nothing of plugins or trials: [`machine`] reads facts
//! that do not change, [`cores`] reserves physical cores and pins processes, and
//! [`load`] compares the kernel's counters before and after. None of it limits
//! anything, and none of it may be needed to run: a value that the machine does
//! not tell is absent, never zero, and cores that cannot be had are a reason to
//! record, not a failure.
//!
//! What must be controlled and what must be reported follows Beyer, Löwe and
//! Wendler, "Reliable benchmarking: requirements and solutions", STTT 21 (2019).
//! `docs/performance.md` lists every figure with its unit and source.

pub mod cores;
mod cpus;
pub mod load;
pub mod machine;
mod source;

pub use cores::{NoCores, Reservation, Topology, affinity, pin, pin_this_process};
pub use cpus::Cpus;
pub use load::{Call, Cause, Difference, Reason, Snapshot, Spent, contended};
pub use machine::Machine;

#[cfg(test)]
mod fixture;
