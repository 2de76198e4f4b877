//! The questions of a store's trials, made again as planners were asked them.
//!
//! A store has the suite's text and the places of files, and may come from anywhere: its word is not taken
//! for what is to be read. The suite has to be there as a file, word for word as the store has it; what
//! that file names is read, and nothing else. Values may be others than in the file, since the command line
//! may have set them, but for those that can name something to be read.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use fleetyard_core::{Connectivity, Grid, InputError, read_file};
use fleetyard_sim::SimConfig;
use serde_json::{Map, Value};

use crate::options::Robots;
use crate::row::Row;
use crate::store::Meta;
use crate::suite::{Protocol, Question, SUITE_LIMIT, Suite, SuiteInstance};

/// The suite of a store with its instances.
#[derive(Debug)]
pub struct Questions {
    suite: Suite,
    instances: Vec<SuiteInstance>,
}

impl Questions {
    /// Finds the suite of a store: where it was when the store was written, or beside the store.
    pub fn of(meta: &Meta, store: &Path) -> Result<Self, InputError> {
        let folder = store.parent().unwrap_or(Path::new(""));
        let beside = ["suite.toml".to_owned(), format!("{}.toml", meta.suite)];
        let beside = beside.into_iter().filter(|name| !name.contains('/'));
        let beside = beside.map(|name| folder.join(name));
        let places: Vec<PathBuf> = meta.places.suite.iter().cloned().chain(beside).collect();
        let is_it = |place: &&PathBuf| {
            place.extension().is_some_and(|end| end == "toml")
                && read_file(place, SUITE_LIMIT)
                    .is_ok_and(|text| text == meta.suite_text.as_bytes())
        };
        let Some(place) = places.iter().find(is_it) else {
            let reason = "no file has the suite as this store has it";
            let hint = match &meta.places.suite {
                Some(place) => format!(
                    "it was {}, and has changed or is gone: have it there again, or as `suite.toml` beside the \
                     store",
                    place.display()
                ),
                None => "have it as `suite.toml` beside the store".to_owned(),
            };
            return Err(InputError::new(store.display().to_string(), reason).hint(hint));
        };
        let suite = with_values(Suite::load_with(place, &[])?, meta, place)?;
        let instances = suite.instances()?;
        Ok(Self { suite, instances })
    }

    /// The instance of a trial, which has the trial's digest.
    fn instance(&self, row: &Row) -> Result<&SuiteInstance, InputError> {
        let is_like = |instance: &&SuiteInstance| {
            let origin = instance.origin();
            origin.map == row.map
                && origin.scenario == row.scenario
                && instance.agents() as u64 == row.agents
                && instance.connectivity().map(Connectivity::degree) == row.connectivity
                && instance.view().map(|view| view.label.as_str()) == row.view.as_deref()
        };
        let mut last = None;
        for instance in self.instances.iter().filter(is_like) {
            match instance.digest() {
                Ok(digest) if digest.to_string() == row.instance_digest => return Ok(instance),
                Ok(_) => {}
                Err(error) => last = Some(error),
            }
        }
        Err(last.unwrap_or_else(|| {
            let reason = format!(
                "the suite does not make the instance of trial {} now",
                row.trial
            );
            InputError::new(self.suite.name.as_str(), reason)
                .hint("a file that it names has changed since")
        }))
    }

    /// The question of a trial, and the parameters of its view by the names of the command line; a map of
    /// cells has none.
    pub fn question(&self, row: &Row) -> Result<(Question, Map<String, Value>), InputError> {
        let instance = self.instance(row)?;
        let question = instance.question()?;
        let parameters = match (&question, instance.view()) {
            (Question::View(asked), Some(view)) => {
                let mut all = view.spec.parameters(&asked.problem, asked.terms);
                if view.step_s.is_none() {
                    // It follows from the view.
                    all.remove("step");
                }
                all
            }
            _ => Map::new(),
        };
        Ok((question, parameters))
    }

    /// The map of a fleet's trial, whose starts and goals are drawn while it drives.
    pub fn map(&self, row: &Row) -> Result<Arc<Grid>, InputError> {
        self.instance(row)?.grid()
    }

    /// The parameters of executions.
    pub fn config(&self) -> &SimConfig {
        &self.suite.config
    }

    /// The robots that execute plans; none where plans are not executed.
    pub fn robots(&self) -> Option<&Robots> {
        self.suite.robots.as_ref()
    }

    /// The order of trials, and the rules of their comparison.
    pub fn protocol(&self) -> &Protocol {
        &self.suite.protocol
    }
}

/// Values that may name a file, a plugin or a variable of the environment.
const NAMING: [&str; 8] = [
    "/instances",
    "/planner",
    "/sandbox/read",
    "/sandbox/env",
    "/execution/fleet",
    "/fleet/generator",
    "/fleet/invocation",
    "/fleet/fail_policy",
];

/// The suite with the values that the command line gave it, `--set`, as the store has them.
fn with_values(suite: Suite, meta: &Meta, place: &Path) -> Result<Suite, InputError> {
    if suite.normal() == meta.suite_values {
        return Ok(suite);
    }
    let source = format!("{}, with the values of the store", place.display());
    let wrong = |reason: String| InputError::new(source.as_str(), reason);
    let values: Value = serde_json::from_str(&meta.suite_values)
        .map_err(|error| wrong(format!("they cannot be read: {error}")))?;
    let own = Value::Object(suite.values().clone());
    let is_other = |pointer: &&&str| own.pointer(pointer) != values.pointer(pointer);
    if let Some(other) = NAMING.iter().find(is_other) {
        let name = other[1..].replace('/', ".");
        let reason =
            format!("`{name}` is another one in the store, whose word is not taken for it");
        return Err(wrong(reason).hint("write it into the suite's file, and run that"));
    }
    let folder = place.parent().unwrap_or(Path::new(""));
    let variable = |name: &str| std::env::var(name).ok();
    Suite::of_values(&source, &values, folder, &variable)
}
