//! The places of a suite's files, so that a trial can be made again by itself.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::experiment::Experiment;
use crate::suite::Origin;

/// Files that a suite and its planners were read from, with their whole paths.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Places {
    /// The suite.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub suite: Option<PathBuf>,
    /// Scenarios and their maps; none that shares both names with another one.
    pub scenarios: Vec<ScenarioPlace>,
    /// Tasks; none that shares its names with another one.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub tasks: Vec<TaskPlace>,
    /// Files of planners by their labels; none of built-in ones.
    pub planners: BTreeMap<String, PathBuf>,
}

/// A scenario and its map, by the names that trials have.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ScenarioPlace {
    /// Name of the map.
    pub map: String,
    /// Name of the scenario.
    pub scenario: String,
    /// The map's file.
    pub map_file: PathBuf,
    /// The scenario's file.
    pub scenario_file: PathBuf,
}

/// A task, by the names that trials have.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct TaskPlace {
    /// The task's own name.
    pub map: String,
    /// Name of its file.
    pub scenario: String,
    /// The file.
    pub file: PathBuf,
    /// Number of its agents.
    pub agents: usize,
}

impl Places {
    /// Of a suite that is ready to run, and its file.
    pub fn of(experiment: &Experiment<'_>, suite: Option<&Path>) -> Self {
        let mut scenarios: BTreeMap<(String, String), Vec<[PathBuf; 2]>> = BTreeMap::new();
        for instance in experiment.instances() {
            if let Some(files) = instance.files() {
                let origin = instance.origin();
                let known = scenarios.entry((origin.map, origin.scenario)).or_default();
                let files = files.map(whole);
                if !known.contains(&files) {
                    known.push(files);
                }
            }
        }
        let scenarios = scenarios
            .into_iter()
            .filter_map(|((map, scenario), files)| {
                let [[map_file, scenario_file]] = <[[PathBuf; 2]; 1]>::try_from(files).ok()?;
                Some(ScenarioPlace {
                    map,
                    scenario,
                    map_file,
                    scenario_file,
                })
            });
        let mut tasks: BTreeMap<(String, String), Vec<TaskPlace>> = BTreeMap::new();
        for instance in experiment.instances() {
            if let Some((file, agents)) = instance.task() {
                let Origin { map, scenario, .. } = instance.origin();
                let known = tasks.entry((map.clone(), scenario.clone())).or_default();
                let place = TaskPlace {
                    map,
                    scenario,
                    file: whole(file),
                    agents,
                };
                if !known.contains(&place) {
                    known.push(place);
                }
            }
        }
        let tasks = tasks.into_values();
        let tasks = tasks.filter_map(|places| <[TaskPlace; 1]>::try_from(places).ok());
        let planners = experiment.planners().iter().filter_map(|planner| {
            let file = planner.plugin.path()?;
            Some((planner.label.clone(), whole(&file)))
        });
        Self {
            suite: suite.map(whole),
            scenarios: scenarios.collect(),
            tasks: tasks.flatten().collect(),
            planners: planners.collect(),
        }
    }
}

fn whole(path: &Path) -> PathBuf {
    std::path::absolute(path).unwrap_or_else(|_| path.to_owned())
}
