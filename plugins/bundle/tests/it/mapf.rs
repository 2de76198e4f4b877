//! PIBT, EPIBT and LaCAM*, for one plan and for fleets.

mod epibt;
mod floor;
mod lifelong;
mod planners;
mod support;
mod ways;
