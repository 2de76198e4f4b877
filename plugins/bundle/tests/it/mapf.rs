//! PIBT and LaCAM*, for one plan and for fleets.

mod lifelong;
mod planners;
mod support;
mod ways;
