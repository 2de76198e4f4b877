//! The independent plan validator and the metrics of Fleetyard.
