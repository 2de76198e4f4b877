//! Lifelong operation of a fleet: robots drive what planners plan meanwhile.
//!
//! It follows LSMART (Yan et al., Lifelong Scalable Multi-Agent Realistic Testbed, 2026).
#![forbid(unsafe_code)]
