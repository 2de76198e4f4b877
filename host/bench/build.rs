//! The commit that a release is built from, for manifests: `FLEETYARD_COMMIT` if it is
//! set, else what Git says of the checkout. Builds for development have none, so that a
//! commit does not make them stale.

use std::env;
use std::process::Command;

fn git(arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").args(arguments).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    output.status.success().then(|| text.trim().to_owned())
}

fn main() {
    println!("cargo:rerun-if-env-changed=FLEETYARD_COMMIT");
    println!("cargo:rerun-if-changed=build.rs");
    let given = env::var("FLEETYARD_COMMIT").ok();
    let release = env::var("PROFILE").as_deref() == Ok("release");
    // Sources that Git does not keep have no commit, whatever repository is around them.
    let ours = || git(&["ls-files", "--error-unmatch", "build.rs"]).is_some();
    let commit = given.or_else(|| {
        if !release || !ours() {
            return None;
        }
        if let Some(log) = git(&["rev-parse", "--git-path", "logs/HEAD"]) {
            println!("cargo:rerun-if-changed={log}");
        }
        git(&["rev-parse", "HEAD"])
    });
    if let Some(commit) = commit {
        println!("cargo:rustc-env=FLEETYARD_COMMIT={commit}");
    }
}
