//! Planners of discs on roadmaps, in continuous time.
//!
//! Discs of one radius drive along straight edges and may wait at vertices for any time. Two centres must never be closer
//! than the separation, two radii: on crossing edges, in curves, and beside vertices at which somebody stands.
//!
//! - [`roadmap::Roadmap`]: vertices, directed edges, separation;
//! - [`drive::Limits`]: how long turns and drives take robots that turn in place and drive straight;
//! - [`closeness::Closeness`]: which edges and vertices are too close to each other, and when;
//! - [`plan`]: paths as visits;
//! - [`reservation::Reservations`]: the times that paths of others leave;
//! - [`rest::Rest`]: goals, and lower bounds of the time to them;
//! - [`sipp::Search`]: the earliest path of one disc among the paths of others;
//! - [`priority`]: prioritised planning with restarts;
//! - [`crowd`]: the paths of a team, and whom each of them meets;
//! - [`pbs`]: priorities only between discs that meet;
//! - [`ctc`]: orders first, then priorities between two;
//! - [`lacam`]: configurations one after the other, then the earliest times;
//! - [`anytime`]: a first plan, then shorter ones;
//! - [`lns`]: paths of a few discs planned anew at a time;
//! - [`conflict`]: conflict-based search, optimal or within a factor;
//! - [`growing`]: the same in the plane, on roadmaps that grow;
//! - [`plugin`]: the planners behind the contract.
#![forbid(unsafe_code)]

pub mod anytime;
pub mod closeness;
pub mod conflict;
pub mod crowd;
pub mod ctc;
pub mod drive;
pub mod growing;
pub mod lacam;
pub mod lns;
pub mod pbs;
pub mod plan;
pub mod plugin;
pub mod priority;
pub mod reservation;
pub mod rest;
pub mod roadmap;
pub mod sipp;
