//! Single-agent search on grids.

#![forbid(unsafe_code)]

mod best_first;
mod bfs;
mod cost;
mod grid;
mod nodes;
pub mod plugin;
mod search;

pub use best_first::{BestFirst, Order};
pub use bfs::{Bfs, BidirectionalBfs};
pub use cost::{Heuristic, TieBreaking};
pub use grid::{Grid, Neighbors};
pub use search::{Answer, Limit, Outcome, Search, Stop};
