//! Worlds of Fleetyard: seeded generators of maps and scenarios.
