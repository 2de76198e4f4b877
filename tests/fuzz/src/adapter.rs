//! Manifests of command adapters, and answers of the solvers that they describe.

use fleetyard_abi::moves::OFF_MAP;
use fleetyard_core::formats::Format;
use fleetyard_runtime::adapter::Manifest;

use super::check_error;

const SOURCE: &str = "planner.toml";

/// Ends the manifest; what comes after it is an answer.
const ANSWER: &str = "\n=====\n";

/// Rows, columns and agents.
const INSTANCES: [(u32, u32, usize); 3] = [(3, 4, 2), (1, 1, 1), (1 << 15, 1 << 15, 0)];

/// Reads a `planner.toml`, and then an answer.
pub fn run(data: &[u8]) {
    let at = data
        .windows(ANSWER.len())
        .position(|window| window == ANSWER.as_bytes());
    let (manifest, answer) = match at {
        Some(at) => (&data[..at], &data[at + ANSWER.len()..]),
        None => (data, &b""[..]),
    };
    let Ok(text) = std::str::from_utf8(manifest) else {
        return;
    };
    let manifest = match Manifest::read(text, SOURCE) {
        Ok(manifest) => manifest,
        Err(error) => {
            check_error(&error, SOURCE, text.as_bytes());
            assert!(error.line.is_some(), "{error:?}");
            return;
        }
    };
    let fits =
        |byte: u8| byte.is_ascii_lowercase() || byte.is_ascii_digit() || b"._-".contains(&byte);
    assert!(!manifest.id().is_empty() && manifest.id().bytes().all(fits));
    for (rows, cols, agents) in INSTANCES {
        let plan = match manifest.read_answer(answer, (rows, cols), agents) {
            Ok(plan) => plan,
            Err(error) => {
                check_error(&error, &error.source, answer);
                continue;
            }
        };
        assert_eq!(plan.agents(), agents);
        // In lines a position is one byte or more, and nobody is nowhere.
        if !matches!(
            manifest.format(),
            Some(Format::Plan | Format::PlanViz | Format::LibmrpSchedule)
        ) {
            assert!(plan.cells().len() <= answer.len());
            assert!(plan.paths().all(|path| !path.is_empty()));
        }
        let on_map = |cell: &u32| *cell < rows * cols || *cell == OFF_MAP;
        assert!(plan.cells().iter().all(on_map));
        // Line ends are no part of an answer.
        let other = String::from_utf8_lossy(answer).replace('\n', "\r\n");
        if !answer.contains(&b'\r') && std::str::from_utf8(answer).is_ok() {
            let again = manifest.read_answer(other.as_bytes(), (rows, cols), agents);
            assert!(again.is_ok_and(|again| again.cells() == plan.cells()));
        }
    }
}
