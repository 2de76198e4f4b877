//! End-to-end tests of Fleetyard.
