//! Search in space and time on 4-connected grids: what planners of many agents share.
//!
//! Time goes in steps; in each an agent moves to a neighbouring cell or stays. All is
//! integer arithmetic over dense numbers of cells, so that everything here is
//! deterministic; the only source of chance is [`random::Random`].
//!
//! - [`graph::Graph`]: the passable cells, numbered;
//! - [`distance`]: exact distances to goals, as far as asked for or in tables that are kept
//!   between calls;
//! - [`problem::Problem`]: what an instance of the contract asks, with all that is lifelong:
//!   goals in sequence, windows, headings;
//! - [`gradient::Gradients`]: the ways to many goals, for fleets of thousands;
//! - [`labels::Labels`]: distances between any two places, with no search per goal;
//! - [`lanes::Lanes`]: which way agents had better go along rows and columns;
//! - [`digraph::Digraph`]: the parts of a map that allowed moves connect;
//! - [`reservation::Reservations`]: who is where when;
//! - [`sipp::Sipp`]: the best path of one agent among the paths of others;
//! - [`conflict::Conflicts`]: where paths of a team collide, kept up to date as they change;
//! - [`neighborhood::Chooser`], [`refine::Refiner`]: improvement of plans by replanning a few
//!   agents at a time;
//! - [`traffic::Traffic`]: the same with the number of agents per step and cell;
//! - [`pose::Poses`]: cells, or cells and headings, and the steps between them;
//! - [`constraints::Constraints`]: what an agent may not do;
//! - [`astar::Astar`]: the low level of constraint-tree searches;
//! - [`known::Known`]: the states that a search has met;
//! - [`order`]: partial orders of agents;
//! - [`plan`]: paths, configurations, plans;
//! - [`plugin`]: what planners say alike behind the plugin contract.
#![forbid(unsafe_code)]

pub mod astar;
pub mod conflict;
pub mod constraints;
pub mod digraph;
pub mod distance;
pub mod gradient;
pub mod graph;
pub mod known;
pub mod labels;
pub mod lanes;
pub mod neighborhood;
pub mod order;
pub mod plan;
pub mod plugin;
pub mod pose;
pub mod problem;
pub mod random;
pub mod refine;
pub mod reservation;
pub mod sipp;
pub mod traffic;
