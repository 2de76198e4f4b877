//! Single-agent search on grids.

#![forbid(unsafe_code)]

mod beam;
mod best_first;
mod bfs;
mod bidirectional;
mod cost;
mod fringe;
mod grid;
mod idastar;
mod incremental;
mod jump_point;
mod nodes;
pub mod plugin;
mod search;
mod sight;
mod slate;
mod theta;

pub use beam::Beam;
pub use best_first::{BestFirst, Order};
pub use bfs::{Bfs, BidirectionalBfs};
pub use bidirectional::{BidirectionalAstar, Done};
pub use cost::{Heuristic, TieBreaking};
pub use fringe::Fringe;
pub use grid::{Grid, Neighbors};
pub use idastar::{IdaStar, Memory};
pub use incremental::{Incremental, Method, Replanner};
pub use jump_point::JumpPoint;
pub use search::{Answer, Limit, Outcome, Search, Stop};
pub use sight::Corners;
pub use theta::{Looks, ThetaStar};
