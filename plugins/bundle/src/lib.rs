//! The standard plugins of Fleetyard behind one entry symbol.
