//! Pictures and pages of maps, plans and traces.
//!
//! Everything here turns what others found out into something to look at; it
//! decides nothing.

#![forbid(unsafe_code)]
