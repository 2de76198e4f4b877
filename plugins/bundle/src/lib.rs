//! The standard plugins behind one entry symbol, as a shared library and linked
//! into the `fleetyard` command.

use fleetyard_plugin_conflict::plugin::{BoundedSearch, ConflictBasedSearch};
use fleetyard_plugin_fleet::{generate, invocation, recover};
use fleetyard_plugin_kinodynamic::plugin::cbs_rrt::CbsRrt;
use fleetyard_plugin_kinodynamic::plugin::db_astar::DbAstar;
use fleetyard_plugin_kinodynamic::plugin::db_cbs::DbCbs;
use fleetyard_plugin_kinodynamic::plugin::db_lacam::DbLacam;
use fleetyard_plugin_kinodynamic::plugin::hybrid_astar::HybridAstar;
use fleetyard_plugin_kinodynamic::plugin::k_cbs::KCbs;
use fleetyard_plugin_kinodynamic::plugin::rrt_star::RrtStar;
use fleetyard_plugin_kinodynamic::plugin::sst::Sst;
use fleetyard_plugin_mapf::plugin::{Epibt, Lacam, Pibt, Wppl};
use fleetyard_plugin_neighborhood::plugin::{MapfLns, MapfLns2};
use fleetyard_plugin_plane::plugin::PlanePrioritised;
use fleetyard_plugin_plane::plugin::safe_intervals::SafeIntervalTangents;
use fleetyard_plugin_plane::plugin::shortest::ShortestTangents;
use fleetyard_plugin_plane::plugin::sssp::Sssp;
use fleetyard_plugin_priority::plugin::{Prioritized, PriorityBasedSearch};
use fleetyard_plugin_roadmap::plugin::{
    CbsMp, Ccbs, Ctc, Eccbs, RoadmapLacam, RoadmapLns, RoadmapPrioritised,
};
use fleetyard_plugin_search::plugin as search;

mod empty;

fleetyard_abi::export! {
    planners: [
        Lacam,
        Pibt,
        Epibt,
        Wppl,
        Prioritized,
        PriorityBasedSearch,
        MapfLns2,
        MapfLns,
        ConflictBasedSearch,
        BoundedSearch,
        RoadmapPrioritised,
        Ctc,
        Ccbs,
        Eccbs,
        RoadmapLns,
        RoadmapLacam,
        PlanePrioritised,
        ShortestTangents,
        SafeIntervalTangents,
        Sssp,
        CbsMp,
        CbsRrt,
        HybridAstar,
        RrtStar,
        Sst,
        DbAstar,
        DbCbs,
        DbLacam,
        KCbs,
        empty::Empty,
        search::Astar,
        search::Dijkstra,
        search::GreedyBestFirst,
        search::WeightedAstar,
        search::BidirectionalAstarPlanner,
        search::Theta,
        search::Ida,
        search::JumpPointSearch,
        search::LpaStar,
        search::BeamSearch,
        search::FringeSearch,
        search::BidirectionalBreadthFirst,
        search::BreadthFirst,
        search::DStarLite,
        search::LazyTheta,
    ],
    fail_policies: [
        recover::Pibt,
        recover::GuidedPibt,
        recover::Lrgw,
        recover::RuleBased,
        recover::AllWait,
    ],
    instance_generators: [
        generate::DistinctOneGoal,
        generate::OneGoal,
        generate::WindowedMultiGoals,
    ],
    invocation_policies: [invocation::Periodic, invocation::EventBased],
}
