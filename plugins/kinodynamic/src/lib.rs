//! Planners for robots with dynamics in the plane.
//!
//! A planner here thinks in states and controls. Its plans are controls, which the host propagates by itself: nothing that a
//! planner says of where they lead is believed.
//!
//! - [`robot`]: robots, their states, and where controls lead;
//! - [`car`]: what steering and a trailer add to a robot;
//! - [`course`]: controls one after the other, and the motion that they make;
//! - [`steer`]: controls from rest to rest; [`curves`]: the quickest ones of wheels;
//! - [`primitives`]: short motions that join exactly; [`search`]: planners that put them together;
//! - [`optimise`]: courses of a team that end sooner;
//! - [`scene`]: bodies among obstacles, movers and each other;
//! - [`rrt`]: conflict-based search over trees of single robots;
//! - [`hybrid`]: one robot by Hybrid A\*;
//! - [`sampling`]: trees of random samples;
//! - [`plugin`]: the planners behind the contract.
#![forbid(unsafe_code)]

pub mod car;
pub mod course;
pub mod curves;
pub mod hybrid;
pub mod optimise;
pub mod plugin;
pub mod primitives;
pub mod robot;
pub mod rrt;
pub mod sampling;
pub mod scene;
pub mod search;
pub mod steer;
