//! Single-agent search on grids.

#![forbid(unsafe_code)]
