//! Settings, batches, the action dependency graph and tasks.

mod adg;
mod assign;
mod batch;
mod config;
mod walks;
