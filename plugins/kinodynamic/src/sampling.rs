//! Trees of random samples: ways from rest to rest, controls drawn at random, and teams of such robots.

pub mod drive;
pub mod joint;
pub mod k_cbs;
pub mod motions;
pub mod near;
pub mod rrt_star;
pub mod sst;
