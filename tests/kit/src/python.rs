//! Python with libraries: another implementation to compare with.

use std::io::Write as _;
use std::process::{Command, Stdio};

/// Output of a script that reads `input`, run by the Python that `FLEETYARD_PYTHON` names or else
/// the system's. `None`, and a word about it, where that lacks one of the modules.
pub fn run(modules: &str, script: &str, input: &[u8]) -> Option<Vec<u8>> {
    let python = std::env::var("FLEETYARD_PYTHON").unwrap_or_else(|_| "python3".into());
    let has_them = Command::new(&python)
        .args(["-c", &format!("import {modules}")])
        .stderr(Stdio::null())
        .status();
    if !has_them.is_ok_and(|status| status.success()) {
        println!("skipped: {python} lacks {modules}; FLEETYARD_PYTHON may name one that has them");
        return None;
    }
    let mut child = Command::new(&python)
        .args(["-c", script])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut stdin = child.stdin.take().unwrap();
    stdin.write_all(input).unwrap();
    drop(stdin);
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success());
    Some(output.stdout)
}
