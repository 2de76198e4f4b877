//! Suite files, and values that are set over theirs.

use std::collections::BTreeSet;
use std::path::Path;

use fleetyard_bench::suite::{MOST_INSTANCES, Suite};
use fleetyard_core::InputError;
use fleetyard_core::document::Setting;

use super::check_error;

const SOURCE: &str = "suite.toml";

/// The option that sets values.
const OPTION: &str = "--set";

/// Ends the suite; every line after it is a value that is set.
const SETTINGS: &str = "\n=====\n";

/// No file is read from here.
const FOLDER: &str = "/nonexistent/suite";

/// So many seeds are looked at.
const FEW: usize = 1000;

fn variable(name: &str) -> Option<String> {
    (name == "PLACE").then(|| "place".to_owned())
}

/// Reads a suite; the files that it names are not there.
pub fn run(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else {
        return;
    };
    let (text, given) = text.split_once(SETTINGS).unwrap_or((text, ""));
    let mut settings = Vec::new();
    for line in given.lines() {
        match Setting::new(OPTION, line) {
            Ok(setting) => settings.push(setting),
            Err(error) => check_set(&error),
        }
    }
    let read = |text, settings: &[Setting]| {
        Suite::read(SOURCE, text, settings, Path::new(FOLDER), &variable)
    };
    let suite = match read(text, &settings) {
        Ok(suite) => suite,
        Err(error) if error.source.starts_with(OPTION) => return check_set(&error),
        Err(error) => {
            check_error(&error, SOURCE, text.as_bytes());
            assert!(error.line.is_some(), "{error:?}");
            return;
        }
    };
    let fits = |byte: u8| byte.is_ascii_alphanumeric() || b"._-".contains(&byte);
    assert!(!suite.name.is_empty() && suite.name.bytes().all(fits));
    let protocol = &suite.protocol;
    assert!(protocol.repeats > 0);
    assert!((1..=MOST_INSTANCES).contains(&(protocol.seeds.len() as u64)));
    // Of many the memory is limited.
    let seeds: BTreeSet<&u64> = protocol.seeds.iter().take(FEW).collect();
    assert_eq!(seeds.len(), protocol.seeds.len().min(FEW));
    let labels: BTreeSet<&str> = suite
        .planners
        .iter()
        .map(|planner| planner.label.as_str())
        .collect();
    assert!(!labels.is_empty() && labels.len() == suite.planners.len());
    assert!(!suite.budget.wall.is_zero() && suite.budget.threads > 0);
    suite
        .config
        .validate()
        .expect("what was read can be executed");
    let normal: serde_json::Value = serde_json::from_str(&suite.normal()).expect("JSON");
    assert_eq!(normal["name"], suite.name);
    // Line ends and comments say nothing.
    if settings.is_empty() && !text.contains('\r') {
        // The mark of UTF-8 may only come first.
        let body = text.strip_prefix('\u{feff}').unwrap_or(text);
        let other = format!("# A suite.\n{}\n", body.replace('\n', "\r\n"));
        let again = read(&other, &[]);
        let same = |again: Suite| {
            again.digest() == suite.digest() || text.contains("\"\"\"") || text.contains("'''")
        };
        assert!(again.is_ok_and(same), "{text}");
    }
}

/// An error about a value that was set says which.
fn check_set(error: &InputError) {
    assert!(error.source.starts_with(OPTION), "{error:?}");
    assert!(!error.reason.trim().is_empty(), "{error:?}");
    assert_eq!((error.line, error.column), (None, None), "{error:?}");
}
