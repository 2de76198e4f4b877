//! Prioritized planning and priority-based search.
#![forbid(unsafe_code)]
