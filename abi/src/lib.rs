//! The plugin contract of Fleetyard, and nothing else.
//!
//! - [`c`]: the C ABI, from which `include/fleetyard.h` is generated.
//! - The owned model ([`Environment`], [`Instance`], [`Plan`], [`Budget`], …): the same things as
//!   Rust values, whose serde form is the JSON wire ([`wire`], [`paths`]).
//! - [`sdk`]: what a plugin in Rust implements, and [`export!`], which makes a
//!   shared library of it; [`serve`] makes an executable that speaks JSON.
//!
//! The feature `layout` lets the host refuse a Rust plugin that was built against a changed copy
//! of this crate, and say where they differ; host and plugin both need it. A plugin without it is
//! loaded like one in C, on the word of the sizes and versions in its structures. It costs the
//! crate `abi_stable`, and is off by default.
//!
//! The version of the ABI is [`c::ABI_MAJOR`].[`c::ABI_MINOR`] and that of the
//! JSON protocol [`wire::PROTOCOL_VERSION`]; neither is the product's version.

// This crate is the boundary itself. Types are read from JSON and, apart from
// that, from C: neither bypasses a check of the other.
#![allow(
    unsafe_code,
    clippy::unsafe_derive_deserialize,
    clippy::elidable_lifetime_names
)]

pub mod annotation;
pub mod c;
mod clock;
pub mod convert;
mod environment;
pub mod export;
pub mod figures;
#[cfg(feature = "layout")]
pub mod layout;
pub mod leftovers;
mod lists;
pub mod memory;
mod model;
pub mod moves;
pub mod object;
pub mod paths;
mod plan;
pub mod sdk;
pub mod serve;
pub mod wire;

pub use annotation::{Annotation, Shape};
pub use clock::monotonic_ns;
pub use environment::*;
pub use lists::{Goals, Lists};
pub use memory::{GoalTasks, Guidance, Kept, RestOfPlan, Snapshot, Traffic};
pub use model::*;
pub use plan::{
    ControlPlan, GridPlan, Knot, KnotPlan, MotionPlan, MotionRef, Plan, PlanRef, Segment, Visit,
    VisitPlan,
};
