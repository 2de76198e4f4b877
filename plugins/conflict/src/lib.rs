//! Conflict-based search, optimal and bounded-suboptimal.
#![forbid(unsafe_code)]
