//! Values that several tables of a suite have: paths, labels, lists.

use std::path::{Path, PathBuf};

use fleetyard_core::document::{Fault, Place, Value, not_empty, text};
use fleetyard_core::{Connectivity, InputError, is_unseen, shown};
use serde::{Deserialize, Deserializer};
use serde_json::{Map, Value as Json};

/// Most instances of a suite.
pub const MOST_INSTANCES: u64 = 1_000_000;

/// A path of a suite file.
#[derive(Debug, Clone)]
pub(super) struct Named {
    pub(super) path: PathBuf,
    pub(super) place: Place,
}

/// The folder that paths in a suite are relative to, and the values of variables in them.
pub(super) struct Paths<'p> {
    pub(super) folder: &'p Path,
    pub(super) variable: &'p dyn Fn(&str) -> Option<String>,
}

impl Paths<'_> {
    /// The text of a value with its variables replaced.
    pub(super) fn expanded(&self, value: &Value<'_>) -> Result<String, InputError> {
        value.text(|text| {
            if not_empty(text)?.contains(char::is_control) {
                return Err(Fault::new("it has a control character"));
            }
            let mut expanded = String::new();
            let mut rest = text;
            while let Some((before, after)) = rest.split_once("${") {
                let Some((name, after)) = after.split_once('}') else {
                    let fault = Fault::new("it has a variable without an end");
                    return Err(fault.hint("write ${NAME}"));
                };
                let Some(set) = (self.variable)(name).filter(|set| !set.is_empty()) else {
                    let name = shown(name);
                    let reason = format!("the environment variable `{name}` is not set");
                    let hint = format!("set it, as in {name}=/path/to/it fleetyard …");
                    return Err(Fault::new(reason).hint(hint));
                };
                expanded.push_str(before);
                expanded.push_str(&set);
                rest = after;
            }
            expanded.push_str(rest);
            Ok(expanded)
        })
    }

    /// The name of a plugin: an identifier has no slash.
    pub(super) fn plugin(&self, named: String) -> String {
        if named.contains('/') {
            self.folder.join(named).display().to_string()
        } else {
            named
        }
    }

    pub(super) fn path(&self, value: &Value<'_>) -> Result<Named, InputError> {
        Ok(Named {
            path: self.folder.join(self.expanded(value)?),
            place: value.place(),
        })
    }

    pub(super) fn paths(&self, value: &Value<'_>) -> Result<Vec<Named>, InputError> {
        let items = some(value)?;
        items.iter().map(|item| self.path(item)).collect()
    }
}

/// One value or several; a list without any makes a suite without trials.
pub(super) fn some<'t>(value: &Value<'t>) -> Result<Vec<Value<'t>>, InputError> {
    let items = value.one_or_more();
    if items.is_empty() {
        let reason = format!(
            "`{}` is empty, so there is nothing to run",
            shown(value.key())
        );
        return Err(value.error(reason));
    }
    Ok(items)
}

/// Reads a label that may be left out.
pub(super) fn label<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<Option<String>, D::Error> {
    label_text(deserializer).map(Some)
}

fn label_text<'de, D: Deserializer<'de>>(deserializer: D) -> Result<String, D::Error> {
    text(deserializer, "", |label| {
        if not_empty(label)?.contains(is_unseen) || label.chars().count() > 100 {
            let fault = Fault::new(format!("\"{}\" cannot be a label", shown(label)));
            return Err(fault.hint("it is one line of at most 100 characters"));
        }
        Ok(label.trim().to_owned())
    })
}

/// The label of a table with several keys.
pub(super) fn label_of(table: &Value<'_>) -> Result<Option<String>, InputError> {
    table.optional("label", |label| label.read().map(|Label(text)| text))
}

#[derive(Deserialize)]
struct Label(#[serde(deserialize_with = "label_text")] String);

/// A name with the values that are given beside it.
pub(super) fn said(name: &str, values: &Map<String, Json>) -> String {
    let mut label = name.to_owned();
    for (key, value) in values {
        let value = match value {
            Json::String(text) => text.clone(),
            other => other.to_string(),
        };
        label.extend([" ", key, "=", &value]);
    }
    label
}

/// Neighbours of a cell by their number.
pub(super) fn connectivity(value: &Value<'_>) -> Result<Connectivity, InputError> {
    match value.read::<i64>()? {
        4 => Ok(Connectivity::Four),
        8 => Ok(Connectivity::Eight),
        _ => Err(value.error("grids have 4 or 8 neighbours")),
    }
}
