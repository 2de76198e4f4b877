//! Settings, batches, the action dependency graph, steps and tasks.

mod adg;
mod assign;
mod batch;
mod config;
mod steps;
mod timed;
mod walks;
