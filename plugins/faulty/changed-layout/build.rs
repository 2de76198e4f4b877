//! Makes changed copies of the contract's structures from the present ones, so that
//! they are always one change away from what the host has.

use std::path::Path;
use std::{env, fs};

/// Name of the copy, what is replaced, and by what.
const CHANGES: [(&str, &str, &str); 4] = [
    (
        "added",
        "    /// Seed of every random choice.\n    pub seed: u64,\n",
        "    /// Seed of every random choice.\n    pub seed: u64,\n    /// New.\n    pub priority: u64,\n",
    ),
    (
        "retyped",
        "    pub wall_ns: u64,\n",
        "    pub wall_ns: f64,\n",
    ),
    (
        "renamed",
        "    pub window_steps: u32,\n    /// Zero",
        "    pub horizon: u32,\n    /// Zero",
    ),
    ("same", "", ""),
];

fn main() {
    let source = "../../../abi/src/c.rs";
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-changed={source}");
    // A layout carries the name of the crate that it was compiled in. These shall pass
    // for those of another state of the contract.
    println!("cargo::rustc-env=CARGO_PKG_NAME=fleetyard-abi");

    let text = fs::read_to_string(source).expect("the contract's source");
    // An included file may not begin with the documentation of a module.
    let body = text.lines().filter(|line| !line.starts_with("//!"));
    let body: String = body.flat_map(|line| [line, "\n"]).collect();
    let out = env::var_os("OUT_DIR").expect("cargo sets it");
    for (name, old, new) in CHANGES {
        assert!(body.contains(old), "`{old}` is gone from {source}");
        let changed = body.replacen(old, new, 1);
        fs::write(Path::new(&out).join(format!("{name}.rs")), changed).expect("write");
    }
}
