//! Single-agent search on grids: planners for one robot, as plugins and as a library.
//!
//! A [`Grid`] is made once; a [`Search`] is asked about it any number of times, and keeps
//! the arrays that it works in. [`Replanner`] keeps what it found as well, for maps that
//! change. [`plugin`] has the planners behind the plugin contract.
//!
//! | search | paths |
//! | --- | --- |
//! | [`BestFirst`] (A*, weighted A*, greedy), [`Dijkstra`] | shortest; bounded; any; shortest |
//! | [`Bfs`], [`BidirectionalBfs`] | fewest moves |
//! | [`BidirectionalAstar`], [`IdaStar`], [`Fringe`], [`JumpPoint`], [`Incremental`] | shortest |
//! | [`Beam`] | any, and may miss one |
//! | [`ThetaStar`] | any-angle |
//!
//! `docs/search.md` says what each search counts as an expansion, how it follows the paper, and how
//! long it takes.

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
pub use best_first::{BestFirst, Dijkstra, Order};
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
