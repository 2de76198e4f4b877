//! Large neighbourhood search: repair and improvement of plans.
#![forbid(unsafe_code)]
