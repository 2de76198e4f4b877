//! Options of plugins: from the command line to JSON, checked against the
//! plugin's schema before the plugin sees them.

use fleetyard_core::nearest;
use serde_json::{Map, Value};

/// An option that the plugin's schema does not allow.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{reason}")]
pub struct OptionError {
    /// The reason, with the option's name.
    pub reason: String,
    /// The nearest known name, or the known names.
    pub hint: Option<String>,
}

fn properties(schema: &Value) -> Option<&Map<String, Value>> {
    schema.get("properties").and_then(Value::as_object)
}

/// Reads `name=value`. The value is JSON where the schema expects something
/// other than text, and text otherwise.
pub fn parse_option(text: &str, schema: &Value) -> Result<(String, Value), OptionError> {
    let (name, value) = text.split_once('=').ok_or_else(|| OptionError {
        reason: format!("option `{text}` has no value"),
        hint: Some("write `--option name=value`".into()),
    })?;
    let expects_text = properties(schema)
        .and_then(|properties| properties.get(name))
        .and_then(|property| property.get("type"))
        .is_some_and(|kind| kind == "string");
    let value = match serde_json::from_str(value) {
        Ok(parsed) if !expects_text => parsed,
        _ => Value::String(value.to_owned()),
    };
    Ok((name.to_owned(), value))
}

/// Options with the defaults of the schema where nothing was given: a plugin in C reads all of
/// them from a table. A default of `null` stands for no value.
pub(crate) fn with_defaults(mut options: Map<String, Value>, schema: &Value) -> Map<String, Value> {
    for (name, property) in properties(schema).into_iter().flatten() {
        let default = property.get("default").filter(|default| !default.is_null());
        if let Some(default) = default.filter(|_| !options.contains_key(name)) {
            options.insert(name.clone(), default.clone());
        }
    }
    options
}

/// Checks options against a schema. A plugin without a schema takes none.
pub fn check_options(options: &Map<String, Value>, schema: &Value) -> Result<(), OptionError> {
    let empty = Map::new();
    let known = properties(schema).unwrap_or(&empty);
    let closed = schema.is_null() || schema.get("additionalProperties") == Some(&false.into());
    if let Some(name) = options
        .keys()
        .find(|name| closed && !known.contains_key(*name))
    {
        return Err(unknown(name, known));
    }
    if schema.is_null() {
        return Ok(());
    }
    let validator = jsonschema::validator_for(schema).map_err(|error| OptionError {
        reason: format!("the plugin's options schema is no JSON Schema: {error}"),
        hint: None,
    })?;
    let value = Value::Object(options.clone());
    match validator.iter_errors(&value).next() {
        None => Ok(()),
        Some(error) => {
            let path = error.instance_path().to_string();
            let name = path
                .trim_start_matches('/')
                .split('/')
                .next()
                .unwrap_or_default();
            let line = known
                .get(name)
                .map(|property| format!("the schema says {property}"));
            let what = if name.is_empty() {
                "options".into()
            } else {
                format!("option `{name}`")
            };
            Err(OptionError {
                reason: format!("{what}: {error}"),
                hint: line,
            })
        }
    }
}

fn unknown(name: &str, known: &Map<String, Value>) -> OptionError {
    let hint = match nearest(name, known.keys(), 3) {
        Some(candidate) => format!("did you mean `{candidate}`?"),
        None if known.is_empty() => "this plugin has no options".to_owned(),
        None => {
            let mut names: Vec<_> = known.keys().map(String::as_str).collect();
            names.sort_unstable();
            format!("known options: {}", names.join(", "))
        }
    };
    OptionError {
        reason: format!("unknown option `{name}`"),
        hint: Some(hint),
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn schema() -> Value {
        json!({
            "type": "object",
            "properties": {
                "restarts": { "type": "integer", "minimum": 0 },
                "mode": { "type": "string", "enum": ["fast", "7"] },
            },
            "additionalProperties": false,
        })
    }

    #[test]
    fn defaults_stand_in_for_what_is_not_given() {
        let schema = json!({ "properties": {
            "attempts": { "type": "integer", "default": 100 },
            "mode": { "type": "string", "default": "fast" },
            "limit": { "type": ["integer", "null"], "default": null },
            "name": { "type": "string" },
        } });
        let given = json!({ "mode": "7" });
        let options = with_defaults(given.as_object().cloned().unwrap_or_default(), &schema);
        assert_eq!(
            Value::Object(options),
            json!({ "attempts": 100, "mode": "7" })
        );
        assert!(with_defaults(Map::new(), &Value::Null).is_empty());
    }

    fn check(options: &[&str]) -> Result<Value, (String, String)> {
        let schema = schema();
        let told = |error: OptionError| (error.reason, error.hint.unwrap_or_default());
        let mut map = Map::new();
        for option in options {
            map.extend([parse_option(option, &schema).map_err(told)?]);
        }
        check_options(&map, &schema).map_err(told)?;
        Ok(map.into())
    }

    #[test]
    fn values_follow_the_schema() {
        assert_eq!(
            check(&["restarts=3", "mode=7"]),
            Ok(json!({ "restarts": 3, "mode": "7" }))
        );
    }

    #[test]
    fn faults_name_the_option_and_a_way_out() {
        let cases = [
            (
                vec!["restart=3"],
                "unknown option `restart`",
                "did you mean `restarts`?",
            ),
            (
                vec!["colour=red"],
                "unknown option `colour`",
                "known options: mode, restarts",
            ),
            (
                vec!["restarts=many"],
                "option `restarts`: \"many\" is not of type",
                "\"integer\"",
            ),
            (
                vec!["restarts=-1"],
                "option `restarts`: -1 is less than the minimum",
                "minimum",
            ),
            (
                vec!["mode=slow"],
                "option `mode`: \"slow\" is not one of",
                "enum",
            ),
            (
                vec!["restarts"],
                "option `restarts` has no value",
                "name=value",
            ),
        ];
        for (options, reason, hint) in cases {
            let (told, told_hint) = check(&options).expect_err("a fault");
            assert!(told.contains(reason), "{told}");
            assert!(told_hint.contains(hint), "{told_hint}");
        }
    }

    #[test]
    fn a_plugin_without_a_schema_takes_no_options() {
        let options = Map::from_iter([("speed".to_owned(), json!(1))]);
        let error = check_options(&options, &Value::Null).expect_err("a fault");
        assert_eq!(error.hint.as_deref(), Some("this plugin has no options"));
    }
}
