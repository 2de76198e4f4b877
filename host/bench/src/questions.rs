//! The questions of a store's trials, made again as planners were asked them.
//!
//! A store has the suite's text and the places of files, and may come from anywhere: its word is not taken
//! for what is to be read. The suite has to be there as a file, word for word as the store has it; what
//! that file names is read, and nothing else.

use std::path::{Path, PathBuf};

use fleetyard_core::{Connectivity, InputError, read_file};
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
        let suite = Suite::load_with(place, &[])?;
        let instances = suite.instances()?;
        Ok(Self { suite, instances })
    }

    /// The question of a trial, which has the trial's digest, and the parameters of its view by the names of the
    /// command line; a map of cells has none.
    pub fn question(&self, row: &Row) -> Result<(Question, Map<String, Value>), InputError> {
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
                Ok(digest) if digest.to_string() == row.instance_digest => {
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
                    return Ok((question, parameters));
                }
                Ok(_) => {}
                Err(error) => last = Some(error),
            }
        }
        Err(last.unwrap_or_else(|| {
            let reason = format!(
                "the suite does not make the instance of trial {} now",
                row.trial
            );
            InputError::new(self.suite.name.as_str(), reason).hint(
                "a file that it names has changed, or values came from the command line (`--set`)",
            )
        }))
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
