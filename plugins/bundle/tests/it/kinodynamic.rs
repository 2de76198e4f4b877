//! Planners of robots with dynamics.

mod cbs_rrt;
mod foundation;
mod optimise;
mod tasks;
