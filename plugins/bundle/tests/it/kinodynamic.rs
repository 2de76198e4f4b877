//! Planners of robots with dynamics.

mod foundation;
mod optimise;
mod tasks;
