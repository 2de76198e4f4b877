//! The planners that are installed, as they describe themselves.

use std::sync::{Arc, Mutex, PoisonError};

use fleetyard_abi::{Capabilities, Kind};
use fleetyard_runtime::{Discovery, Runtime, check_options, first_with};
use fleetyard_views::Representation;
use serde::Serialize;
use serde_json::{Map, Value};

use crate::answer::{Refused, Result};

/// A planner's description of itself.
#[derive(Debug, Serialize)]
pub(crate) struct Planner {
    pub(crate) id: String,
    name: String,
    version: String,
    description: String,
    license: String,
    /// The file, or `built-in`.
    place: String,
    capabilities: Capabilities,
    pub(crate) representations: Vec<Representation>,
    features: Vec<String>,
    options_schema: Value,
}

impl Planner {
    /// Options as the command reads them, `NAME=VALUE` each; refused where the schema does not allow
    /// them.
    pub(crate) fn options(&self, options: &Map<String, Value>) -> Result<Vec<String>> {
        check_options(options, &self.options_schema).map_err(|error| {
            let refused = Refused::value(error.reason).at("/run/options");
            match error.hint {
                Some(hint) => refused.hint(hint),
                None => refused,
            }
        })?;
        let texts = options.iter().map(|(name, value)| match value {
            Value::String(text) => format!("{name}={text}"),
            value => format!("{name}={value}"),
        });
        Ok(texts.collect())
    }
}

/// The planners, as far as somebody has looked.
#[derive(Debug)]
pub(crate) struct Planners {
    runtime: Runtime,
    last: Mutex<Option<Arc<Vec<Planner>>>>,
}

impl Planners {
    pub(crate) fn new(runtime: Runtime) -> Self {
        Self {
            runtime,
            last: Mutex::default(),
        }
    }

    /// Those that were found when somebody last looked; none before.
    pub(crate) fn last(&self) -> Option<Arc<Vec<Planner>>> {
        let last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        last.clone()
    }

    /// Looks for planners: each is started in its sandbox to describe itself.
    pub(crate) fn look(&self) -> Arc<Vec<Planner>> {
        let all = Discovery::from_environment().scan(&self.runtime);
        let mut found = Vec::new();
        for file in &all {
            let introduction = file.plugins.as_ref();
            for plugin in introduction.map_or(&[][..], |found| &found.descriptors) {
                let is_used = first_with(&all, plugin).is_none_or(|first| first.file == file.file);
                if plugin.kind != Kind::Planner || !is_used {
                    continue;
                }
                found.push(Planner {
                    id: plugin.id.clone(),
                    name: plugin.name.clone(),
                    version: plugin.version.clone(),
                    description: plugin.description.clone(),
                    license: plugin.license.clone(),
                    place: file.place(),
                    capabilities: plugin.capabilities,
                    representations: Representation::claimed_in(plugin.capabilities).collect(),
                    features: plugin.features.clone(),
                    options_schema: plugin.options_schema.clone(),
                });
            }
        }
        found.sort_by(|a, b| a.id.cmp(&b.id));
        let found = Arc::new(found);
        *self.last.lock().unwrap_or_else(PoisonError::into_inner) = Some(Arc::clone(&found));
        found
    }

    /// All planners, after a look if nobody has looked yet.
    pub(crate) fn known(&self) -> Arc<Vec<Planner>> {
        self.last().unwrap_or_else(|| self.look())
    }
}

#[cfg(test)]
impl Planner {
    pub(crate) fn for_tests(id: &str, options_schema: &Value) -> Self {
        Self {
            id: id.to_owned(),
            name: String::new(),
            version: String::new(),
            description: String::new(),
            license: String::new(),
            place: "built-in".to_owned(),
            capabilities: Capabilities::default(),
            representations: vec![Representation::Grid],
            features: Vec::new(),
            options_schema: options_schema.clone(),
        }
    }
}
