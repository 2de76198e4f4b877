//! Settings, batches, the action dependency graph, steps and tasks.

mod adg;
mod assign;
mod batch;
mod config;
mod steps;
mod walks;
