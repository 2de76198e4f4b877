//! Gated execution: robots keep the plan's order of passing, not its times.
//!
//! A plan says who passes a place first. Executed by time, a robot that is late
//! is run into; executed by order, the others wait for it. This module finds out
//! which actions have to wait for which ([`DependencyGraph`]: the temporal plan
//! graph of Hönig et al., ICAPS 2016, as the action dependency graph of Hönig et
//! al., RA-L 2019, uses it) and keeps robots to that while they drive
//! ([`Gates`], with messages that are late or lost). It moves nobody and reads no
//! clock.
//!
//! # What is guaranteed
//!
//! An action is released when all actions that it depends on are done. Let every
//! robot stay on the way of its released actions, up to the margin of
//! [`GateOptions::margin_m`] for any two robots together. Then, whatever the
//! delays,
//!
//! - **no two robots ever collide**: two actions whose swept footprints come
//!   nearer than the margin are never under way at the same time, because one of
//!   them depends on the other; and wherever a robot stops between two actions,
//!   whoever passes through that place does so before it comes or after it has
//!   left;
//! - **nobody waits for ever**, if every delay ends and messages arrive some day:
//!   the graph has no cycle, which is checked whenever one is built.
//!
//! If a plan has robots go round in a ring, or pass nearer than the margin,
//! actions are cut into pieces until an order exists, if need be without the
//! margin: see [`DependencyGraph::routes`].

mod build;
mod cells;
mod channel;
mod error;
mod frontier;
mod gates;
mod graph;
mod meet;
mod near;
mod rings;
mod routes;

pub(crate) use channel::Channel;
pub use error::GateError;
pub use gates::Gates;
pub use graph::{DependencyGraph, GateOptions, Wait};
pub use routes::{GridRoutes, Refined, Routes};
