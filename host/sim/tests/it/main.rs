//! Executions: motion, gates, contacts, traces, and the digests that all builds share.

mod cars;
mod common;
mod contact_world;
mod driven;
mod fleet;
mod gates;
mod golden;
mod input;
mod live;
mod motion;
mod observed;
mod replay;
mod sweeps;
mod trace_file;
