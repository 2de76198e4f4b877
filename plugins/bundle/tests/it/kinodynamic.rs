//! Planners of robots with dynamics.

mod foundation;
