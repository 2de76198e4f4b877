//! Options of plugins against the schema that a plugin brings, both hostile.

use fleetyard_runtime::{check_options, parse_option};
use serde_json::{Map, Value};

/// A schema on the first line, and an option `name=value` on each other.
pub fn run(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else {
        return;
    };
    let mut lines = text.lines();
    let Ok(schema) = serde_json::from_str::<Value>(lines.next().unwrap_or_default()) else {
        return;
    };
    let mut options = Map::new();
    for line in lines {
        match parse_option(line, &schema) {
            Ok((name, value)) => {
                assert!(line.starts_with(&name));
                options.insert(name, value);
            }
            Err(error) => assert!(!line.contains('='), "{error:?}"),
        }
    }
    let told = check_options(&options, &schema);
    let again = check_options(&options, &schema);
    assert_eq!(again.is_ok(), told.is_ok());
    // Of several references that lead nowhere, the library names any.
    let about_schema = |reason: &str| reason.starts_with("the plugin's options schema is no");
    if !told
        .as_ref()
        .is_err_and(|error| about_schema(&error.reason))
    {
        assert_eq!(again, told);
    }
    if schema.is_null() {
        assert_eq!(told.is_ok(), options.is_empty());
    }
    if let Err(error) = told {
        assert!(!error.reason.is_empty());
        assert!(error.hint.is_none_or(|hint| !hint.is_empty()));
    }
}
