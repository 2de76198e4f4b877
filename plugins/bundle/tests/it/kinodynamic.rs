//! Planners of robots with dynamics.

mod cars;
mod cbs_rrt;
mod foundation;
mod hybrid;
mod optimise;
mod sampling;
mod search;
mod tasks;
