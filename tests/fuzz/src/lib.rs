//! Fuzz targets: everything that reads bytes from outside, each reader with the properties that it
//! must have for any input.
//!
//! A target is a function of some bytes that panics when a property does not hold. It
//! stands here once and is run twice: by libFuzzer, through the programs in
//! `fuzz_targets/`, and by `tests/e2e/fuzz_corpus.rs` on the committed corpus and seeded
//! mutations of it, as a test like any other. Neither measures time.
//!
//! Failures, whatever the bytes: a panic, an endless loop, a small input that
//! takes a lot of memory (the test counts it; libFuzzer is given a limit), an error that
//! points outside the text, a value that changes when it is written and read again.

pub mod abi;
pub mod adapter;
pub mod bundle;
pub mod fleet;
pub mod formats;
pub mod league;
pub mod lock;
pub mod map;
pub mod options;
pub mod plan;
pub mod plane;
pub mod recording;
pub mod rows;
pub mod scen;
pub mod studio;
pub mod suite;
pub mod task;
pub mod trace;
pub mod values;
pub mod view;
pub mod wire;
pub mod world;

use fleetyard_core::InputError;

/// Panics when a property does not hold for some bytes.
pub type Target = fn(&[u8]);

/// Every target with its name, which is also its folder in `corpus/`.
pub const TARGETS: &[(&str, Target)] = &[
    ("abi", abi::run),
    ("adapter", adapter::run),
    ("bundle", bundle::run),
    ("fleet", fleet::run),
    ("formats", formats::run),
    ("league", league::run),
    ("lock", lock::run),
    ("map", map::run),
    ("options", options::run),
    ("plan", plan::run),
    ("plane", plane::run),
    ("recording", recording::run),
    ("rows", rows::run),
    ("scen", scen::run),
    ("studio", studio::run),
    ("suite", suite::run),
    ("task", task::run),
    ("trace", trace::run),
    ("values", values::run),
    ("view", view::run),
    ("wire", wire::run),
    ("world", world::run),
];

/// An error about `text` names its source and, where it names a place, one that is there;
/// it says what is wrong.
fn check_error(error: &InputError, source: &str, text: &[u8]) {
    assert_eq!(error.source, source, "{error:?}");
    assert!(!error.reason.trim().is_empty(), "{error:?}");
    assert!(
        error.hint.as_ref().is_none_or(|hint| !hint.is_empty()),
        "{error:?}"
    );
    assert!(error.column.is_none() || error.line.is_some(), "{error:?}");
    let Some(line) = error.line else { return };
    // One past the end is where something is missing.
    let mut lines: Vec<&[u8]> = text.split(|byte| *byte == b'\n').collect();
    lines.push(b"");
    let at = (line as usize).checked_sub(1).and_then(|at| lines.get(at));
    let at = at.unwrap_or_else(|| panic!("no such line: {error:?}"));
    let columns = String::from_utf8_lossy(at).chars().count() as u64 + 1;
    let column = error.column.unwrap_or(1);
    assert!(
        (1..=columns).contains(&column),
        "no such column, there are {columns}: {error:?}"
    );
}
