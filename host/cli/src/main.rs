//! The `fleetyard` command.

fn main() {}
