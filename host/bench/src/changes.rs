//! Changes of a suite and its planners since the trials of a store were made.

use std::collections::{BTreeMap, BTreeSet};

use fleetyard_core::InputError;
use serde_json::Value;

use crate::experiment::Experiment;
use crate::store::{Meta, Store};

/// In words, a line each: values of the suite, and planners' code.
pub fn changes(
    experiment: &Experiment<'_>,
    store: &Store,
    meta: &Meta,
) -> Result<Vec<String>, InputError> {
    let before = store.meta()?;
    let mut lines = suite_changes(&before.suite_values, &meta.suite_values);
    let planners = store.planners()?;
    let code = store.code()?;
    for planner in experiment.planners() {
        let Some(known) = planners.get(&planner.label) else {
            continue;
        };
        let now = planner.plugin.digest().to_string();
        if known.contains(&now) || known.is_empty() {
            continue;
        }
        let files: Vec<String> = planner
            .plugin
            .code()
            .iter()
            .filter(|file| {
                let same = |digest: &String| code.get(digest).is_some_and(|old| old.contains(file));
                !known.iter().any(same)
            })
            .map(|file| file.path.display().to_string())
            .collect();
        let what = if files.is_empty() {
            "this program, which it is built into, is another one".to_owned()
        } else {
            format!("{} is another one", files.join(", "))
        };
        lines.push(format!("the code of `{}`: {what}", planner.label));
    }
    Ok(lines)
}

/// Differences of two suites, value by value; their names do not matter.
fn suite_changes(before: &str, now: &str) -> Vec<String> {
    let [before, now] = [before, now].map(|text| {
        let mut values = BTreeMap::new();
        flatten(
            "",
            &serde_json::from_str(text).unwrap_or_default(),
            &mut values,
        );
        values
    });
    let names: BTreeSet<&String> = before.keys().chain(now.keys()).collect();
    names
        .into_iter()
        .filter(|name| !matches!(name.as_str(), "name" | "description"))
        .filter_map(|name| match (before.get(name), now.get(name)) {
            (old, new) if old == new => None,
            (Some(old), Some(new)) => Some(format!("`{name}` was {old} and is {new}")),
            (Some(old), None) => Some(format!("`{name}` was {old} and is not given")),
            (None, Some(new)) => Some(format!("`{name}` was not given and is {new}")),
            (None, None) => None,
        })
        .collect()
}

/// Every value that is no table and no list of tables, by its path.
fn flatten(name: &str, value: &Value, values: &mut BTreeMap<String, String>) {
    match value {
        Value::Object(table) => {
            for (key, value) in table {
                let name = match name {
                    "" => key.clone(),
                    _ => format!("{name}.{key}"),
                };
                flatten(&name, value, values);
            }
        }
        Value::Array(items) if items.iter().any(Value::is_object) => {
            for (index, item) in items.iter().enumerate() {
                flatten(&format!("{name}[{}]", index + 1), item, values);
            }
        }
        other => {
            values.insert(name.to_owned(), other.to_string());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_changed_is_named_by_its_path() {
        let before = r#"{"name": "a", "budget": {"wall": "10s"}, "planner": [{"plugin": "pibt"}]}"#;
        let now = r#"{"name": "b", "budget": {"wall": "5s", "nodes": 7},
            "planner": [{"plugin": "pibt", "options": {"horizon": 3}}, {"plugin": "lacam"}]}"#;
        assert_eq!(
            suite_changes(before, now),
            [
                "`budget.nodes` was not given and is 7",
                r#"`budget.wall` was "10s" and is "5s""#,
                "`planner[1].options.horizon` was not given and is 3",
                r#"`planner[2].plugin` was not given and is "lacam""#,
            ]
        );
        assert_eq!(
            suite_changes(r#"{"seeds": [0]}"#, "{}"),
            ["`seeds` was [0] and is not given"]
        );
        assert!(suite_changes(now, now).is_empty());
    }
}
