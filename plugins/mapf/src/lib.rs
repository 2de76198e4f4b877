//! Grid planners: PIBT and LaCAM*.
