//! The deterministic 2D simulator of Fleetyard.
