//! Search over motion primitives: for one robot, and for teams.

pub mod astar;
pub mod cbs;
pub mod field;
pub mod lacam;
