//! Shared by the tests, benches and examples of several crates: grid cases with a judge of
//! plans, a host that takes notes, Python with libraries, pages in a browser.
//!
//! Of the workspace it knows the contract alone, so that it shares nothing with what is tested.

#![forbid(unsafe_code)]

pub mod browser;
pub mod grid;
mod notes;
pub mod python;

pub use grid::Case;
pub use notes::Notes;
