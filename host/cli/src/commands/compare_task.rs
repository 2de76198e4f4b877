//! `fleetyard compare --task`: planners of every representation on the views of one task, all
//! executed in the same world.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::Args;
use fleetyard_bench::suite::{SuiteInstance, SuiteView};
use fleetyard_bench::{Experiment, Record, Row, number};
use fleetyard_check::Pace;
use fleetyard_core::Words as _;
use fleetyard_core::document::Place;
use fleetyard_views::{Given, Problem, Representation, ViewName, ViewSpec, load_problem};
use serde::Serialize;

use super::compare::{Compare, named_by_the_user, trials};
use super::task::claimed;
use super::world::GridSpecArgs;
use crate::args::{Format, INSTANCE, VIEW, word};
use crate::exit::{Exit, Result};
use crate::files::file_name;
use crate::output;
use crate::setup::host;

/// A task whose views are compared.
#[derive(Debug, Args)]
pub(super) struct TaskViews {
    /// Task file: planners of any representation are asked for plans on its views, and all plans are
    /// judged and executed in its world
    #[arg(long, help_heading = INSTANCE, value_name = "FILE", group = "cells",
          conflicts_with_all = ["map", "scen", "agents", "path_rule", "cell_size", "radius"])]
    pub(super) task: Option<PathBuf>,
    /// Views of the task; each planner is asked for those that it claims [default: all; beside
    /// --roadmap grid and continuous]
    #[arg(long, help_heading = VIEW, value_name = "VIEW,…", value_delimiter = ',', value_parser = word::<ViewName>(),
          requires = "task")]
    views: Vec<ViewName>,
    /// Roadmap file that is a view, too: starts and goals are at its vertices
    #[arg(long, help_heading = VIEW, value_name = "FILE", requires = "task")]
    roadmap: Option<PathBuf>,
    #[command(flatten)]
    pub(super) grid: GridSpecArgs,
    /// Seed of drawn roadmaps; the task's if it is not given
    #[arg(long, help_heading = VIEW, value_name = "N", requires = "task")]
    roadmap_seed: Option<u64>,
    /// Speeds of robots on a roadmap
    #[arg(long, help_heading = VIEW, value_parser = word::<Pace>(), default_value_t, requires = "task")]
    pace: Pace,
}

impl TaskViews {
    /// All views that are asked for; `step_s` is the duration of a step on a grid, if one is given.
    fn all(&self, step_s: Option<f64>) -> Result<Vec<SuiteView>> {
        let view = |label: String, spec: ViewSpec, argument: &str| SuiteView {
            label,
            spec,
            separation: self.grid.separation,
            pace: self.pace,
            step_s,
            place: Place::outside(argument),
        };
        let otherwise: &[ViewName] = match self.roadmap {
            None => ViewName::ALL,
            Some(_) => &[ViewName::Grid, ViewName::Continuous],
        };
        let names = if self.views.is_empty() {
            otherwise
        } else {
            &self.views
        };
        let mut all: Vec<SuiteView> = names
            .iter()
            .map(|name| {
                let spec = name.spec(self.grid.spec(), self.roadmap_seed);
                view(name.to_string(), spec, "--views")
            })
            .collect();
        if let Some(path) = &self.roadmap {
            let given = Given::load(path.clone(), None)?;
            all.push(view(file_name(path), ViewSpec::Given(given), "--roadmap"));
        }
        Ok(all)
    }
}

/// One planner on one view.
#[derive(Debug, Serialize)]
struct Line {
    view: String,
    planner: String,
    /// Valid by the rules of the view; absent in the plane, which is the world, and without a plan.
    valid_in_view: Option<bool>,
    /// Valid by footprints in the world.
    valid_in_world: Option<bool>,
    /// The reason why there is no valid plan.
    failure: Option<String>,
    length_m: Option<f64>,
    soc_s: Option<f64>,
    makespan_s: Option<f64>,
    planning_time_ms: Option<f64>,
    /// Of learning the view; absent when it was known.
    prepare_time_ms: Option<f64>,
    contacts: Option<u64>,
    nearest_approach_m: Option<f64>,
}

impl Line {
    /// Of a trial; `was_asked` says that the planner was, and did not say that it cannot.
    fn new(row: &Row, was_asked: bool) -> Self {
        let failure = row.failure().map(|failure| match &row.first_violation {
            Some(first) => {
                // The reason says it already.
                let first = first.strip_prefix("in the world: ").unwrap_or(first);
                format!("{failure}: {first}")
            }
            None => failure,
        });
        Self {
            view: row.view.clone().unwrap_or_default(),
            planner: row.planner.clone(),
            valid_in_view: row.valid_in_view,
            valid_in_world: row.valid_in_world,
            failure: match &row.fault {
                Some(fault) if !was_asked => Some(fault.clone()),
                _ => failure,
            },
            length_m: row.path_length_m,
            soc_s: row.soc_s,
            makespan_s: row.makespan_s,
            planning_time_ms: was_asked.then_some(row.planning_time_ms),
            prepare_time_ms: row.prepare_time_ms,
            contacts: row.contacts,
            nearest_approach_m: row.nearest_approach_m,
        }
    }
}

#[derive(Serialize)]
struct Report {
    task: String,
    agents: usize,
    rows: Vec<Line>,
    trials: Vec<Record>,
}

pub(super) fn compare(arguments: &Compare, task: &Path) -> Result<Exit> {
    let problem = load_problem(task)?;
    let host = host(&arguments.budget, None, vec![task.to_owned()])?;
    let (planners, suite) = arguments.parts(&host)?;
    let claims: Vec<Vec<Representation>> = planners
        .iter()
        .map(|planner| claimed(&host, planner))
        .collect::<Result<_>>()?;
    let named = arguments.views.all(arguments.world.step)?.into_iter();
    // Nobody has to claim all of them.
    let some = |view: &SuiteView| {
        let representation = view.spec.representation();
        claims.iter().any(|claims| claims.contains(&representation))
    };
    let named: Vec<SuiteView> = named.filter(some).collect();
    let instances = SuiteInstance::of_task(task, problem.clone(), named).collect();
    let mut experiment =
        Experiment::of_parts(&suite, host, planners, instances).map_err(named_by_the_user)?;
    let (rows, records) = trials(&mut experiment)?;
    let rows: Vec<Line> = rows
        .iter()
        .map(|(trial, row)| Line::new(row, records.contains_key(trial)))
        .collect();
    let all = rows.iter().all(|row| row.failure.is_none());
    match arguments.format {
        Format::Text => output::print(&output::plain(&table(&problem, task, &rows)))?,
        Format::Json => output::print_json(&Report {
            task: file_name(task),
            agents: problem.task.agents.len(),
            rows,
            trials: records.into_values().collect(),
        })?,
    }
    Ok(if all { Exit::Success } else { Exit::NoPlan })
}

fn table(problem: &Problem, task: &Path, rows: &[Line]) -> String {
    let shown = |value: Option<f64>| value.map_or("-".to_owned(), number);
    let told = |valid: Option<bool>| match valid {
        None => "-",
        Some(true) => "valid",
        Some(false) => "INVALID",
    };
    let header = [
        "view",
        "planner",
        "rules",
        "world",
        "SoC m",
        "SoC s",
        "makespan s",
        "planning ms",
        "map ms",
        "contacts",
        "nearest m",
    ];
    let cells = rows.iter().map(|row| {
        vec![
            row.view.clone(),
            row.planner.clone(),
            told(row.valid_in_view).into(),
            told(row.valid_in_world).into(),
            shown(row.length_m),
            shown(row.soc_s),
            shown(row.makespan_s),
            shown(row.planning_time_ms),
            shown(row.prepare_time_ms),
            row.contacts
                .map_or("-".into(), |contacts| contacts.to_string()),
            shown(row.nearest_approach_m),
        ]
    });
    let agents = problem.task.agents.len();
    let mut out = format!("{}: {agents} agents, one world\n\n", file_name(task));
    out.push_str(&output::table(
        &header,
        cells.collect(),
        &[4, 5, 6, 7, 8, 9, 10],
    ));
    for row in rows {
        if let Some(failure) = &row.failure {
            // Writing to a string cannot fail.
            let _ = write!(out, "\n{} on {}: {failure}", row.planner, row.view);
        }
    }
    out
}
