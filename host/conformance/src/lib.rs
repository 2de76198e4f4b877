//! The conformance kit: asks a plugin, of whatever kind and attachment, what the
//! contract promises, and says where it does otherwise.
//!
//! Every [`Case`] of [`CASES`] is one check with a known answer. It runs in
//! sessions of its own, so that a plugin that crashes in one says nothing of the
//! others, and what it asks follows from a seed, so that a failure can be
//! replayed. Plans are judged by `fleetyard-check`, as everywhere.
//!
//! The kit asks nothing that the contract keeps the host from asking, and it is
//! no benchmark: an answer may be slow or expensive, and a planner may give up.
//! An answer that is odd but allowed is a warning, one that is as it may be, such as giving up, a note.
//!
//! Time matters to those cases alone that are about time. A planner that claims
//! `anytime` takes all the time that it is given, and so it is given a tenth.

#![forbid(unsafe_code)]

mod cases;
mod fuzz;
mod judge;
mod kit;
mod question;
mod report;
mod representation;
mod rules;
mod scene;
mod stop;
mod subject;
mod trial;

pub use cases::{CASES, Case, UnknownCase, find};
pub use fuzz::{
    Call, Extent, FUZZED_FILE_LIMIT, FUZZED_FORMAT, Finding, Fuzz, FuzzReport, Fuzzed, Member,
    Probe, Size, View,
};
pub use kit::Kit;
pub use report::{CaseReport, Outcome};
pub use subject::{Config, Subject};
pub use trial::{EXPECTED, GIVEN_UP};
