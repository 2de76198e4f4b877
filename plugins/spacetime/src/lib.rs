//! Search in space and time on grids: what planners of many agents share.
#![forbid(unsafe_code)]
