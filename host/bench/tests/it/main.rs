//! Suites, stores, statistics, exports and reports.

mod exports;
mod report;
mod statistics;
mod store;
mod suite;
mod support;
