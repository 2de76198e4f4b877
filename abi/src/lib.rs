//! The plugin contract of Fleetyard: C ABI, wire model and Rust SDK.
