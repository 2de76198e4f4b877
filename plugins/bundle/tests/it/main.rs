//! Plugins at their boundaries, in one binary: a module for each crate of standard plugins, and one
//! for the examples.

mod conflict;
mod example;
mod fleet;
mod kinodynamic;
mod mapf;
mod neighborhood;
mod plane;
mod priority;
mod roadmap;
mod search;
mod spacetime;
