//! The standard plugins behind one entry symbol, as a shared library and linked
//! into the `fleetyard` command.

use fleetyard_plugin_mapf::plugin::{Lacam, Pibt};
use fleetyard_plugin_search::plugin::{
    Astar, BidirectionalBreadthFirst, BreadthFirst, Dijkstra, GreedyBestFirst, WeightedAstar,
};

mod empty;

fleetyard_abi::export! {
    planners: [
        Lacam,
        Pibt,
        empty::Empty,
        Astar,
        Dijkstra,
        GreedyBestFirst,
        WeightedAstar,
        BreadthFirst,
        BidirectionalBreadthFirst,
    ],
}
