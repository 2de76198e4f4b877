//! Pictures and pages.

mod page;
mod pictures;
mod viewer;
