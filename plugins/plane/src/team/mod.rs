//! Teams of discs in the plane, planned in space and time together.

pub mod ground;
pub mod plan;
pub mod search;
pub mod traffic;
