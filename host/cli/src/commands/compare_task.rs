//! `fleetyard compare --task`: planners of every representation on the views of one task, all
//! executed in the same world.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::Args;
use fleetyard_bench::{
    GivenOptions, Host, Plugin, Record, Robots, Trial, TrialError, TrialInstance, number,
};
use fleetyard_check::Pace;
use fleetyard_core::{Words as _, words};
use fleetyard_sim::NoTrace;
use fleetyard_views::{Builder, GridSpec, Problem, RoadmapSpec, View, ViewSpec, load_problem};
use serde::Serialize;

use super::compare::Compare;
use super::run::terms;
use super::task::claimed;
use super::world::GridSpecArgs;
use crate::args::{Format, INSTANCE, VIEW, word};
use crate::exit::{Exit, Failure, Result};
use crate::files::file_name;
use crate::output;
use crate::setup::{find_planner, host, sim_config};

/// A view of a task, by the word of the command line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ViewName {
    Grid,
    Sparse,
    Dense,
    SuperDense,
    Continuous,
}

words!(ViewName {
    Grid = "grid", "The grid that the connectivity and the separation make";
    Sparse = "S", "A roadmap of 160 vertices with 5 neighbours";
    Dense = "D", "A roadmap of 900 vertices with 9 neighbours";
    SuperDense = "SD", "A roadmap of 4000 vertices with 14 neighbours";
    Continuous = "continuous", "The plane";
});

impl ViewName {
    fn spec(self, grid: GridSpec, seed: Option<u64>) -> ViewSpec {
        match (self, Builder::preset(self.name())) {
            (Self::Grid, _) => ViewSpec::Grid(grid),
            (_, Some(builder)) => ViewSpec::Roadmap(RoadmapSpec {
                seed,
                ..RoadmapSpec::new(builder)
            }),
            _ => ViewSpec::Continuous,
        }
    }
}

/// A task whose views are compared.
#[derive(Debug, Args)]
pub(super) struct TaskViews {
    /// Task file: planners of any representation are asked for plans on its views, and all plans are
    /// judged and executed in its world
    #[arg(long, help_heading = INSTANCE, value_name = "FILE", group = "cells",
          conflicts_with_all = ["map", "scen", "agents", "path_rule", "cell_size", "radius"])]
    pub(super) task: Option<PathBuf>,
    /// Views of the task; each planner is asked for those that it claims
    #[arg(long, help_heading = VIEW, value_name = "VIEW,…", value_delimiter = ',', value_parser = word::<ViewName>(),
          requires = "task", default_values_t = ViewName::ALL.iter().copied())]
    views: Vec<ViewName>,
    #[command(flatten)]
    pub(super) grid: GridSpecArgs,
    /// Seed of drawn roadmaps; the task's if it is not given
    #[arg(long, help_heading = VIEW, value_name = "N", requires = "task")]
    roadmap_seed: Option<u64>,
    /// Speeds of robots on a roadmap
    #[arg(long, help_heading = VIEW, value_parser = word::<Pace>(), default_value_t, requires = "task")]
    pace: Pace,
}

/// One planner on one view.
#[derive(Debug, Serialize)]
struct Line {
    view: ViewName,
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
    contacts: Option<u64>,
    nearest_approach_m: Option<f64>,
}

impl Line {
    fn new(view: ViewName, planner: String, record: &Record) -> Self {
        let judged = record.judged.as_ref();
        let figures = record
            .execution
            .as_ref()
            .map(|execution| &execution.figures);
        Self {
            view,
            planner,
            valid_in_view: judged.and_then(|judged| Some(judged.view.as_ref()?.is_valid())),
            valid_in_world: judged.and_then(|judged| Some(judged.world.as_ref()?.valid)),
            failure: record
                .failure()
                .map(|failure| match record.sentences().first() {
                    Some(first) => format!("{failure}, {first}"),
                    None => failure,
                }),
            length_m: record.metrics.length_m,
            soc_s: record.metrics.soc_s,
            makespan_s: record.metrics.makespan_s,
            planning_time_ms: Some(record.metrics.planning_time_ms),
            contacts: figures.map(|figures| figures.contacts),
            nearest_approach_m: figures.and_then(|figures| figures.nearest_approach_m),
        }
    }

    /// A planner that says that it cannot.
    fn refused(view: ViewName, planner: String, failure: String) -> Self {
        Self {
            view,
            planner,
            valid_in_view: None,
            valid_in_world: None,
            failure: Some(failure),
            length_m: None,
            soc_s: None,
            makespan_s: None,
            planning_time_ms: None,
            contacts: None,
            nearest_approach_m: None,
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

/// A planner with the name that the user gave it.
type Named = (String, Plugin);

pub(super) fn compare(arguments: &Compare, task: &Path) -> Result<Exit> {
    let views = &arguments.views;
    let problem = load_problem(task)?;
    let host = host(&arguments.budget, None, vec![task.to_owned()])?;
    let planners: Vec<Named> = arguments
        .planners()
        .iter()
        .map(|asked| {
            let options = GivenOptions::Texts(asked.options.clone());
            let planner = find_planner(&host.runtime, &asked.plugin)?.with_options(options);
            let words = asked.options.iter().map(String::as_str);
            let words: Vec<&str> = std::iter::once(&*planner.name).chain(words).collect();
            Ok((words.join(" "), planner))
        })
        .collect::<Result<_>>()?;
    let mut rows = Vec::new();
    let mut trials = Vec::new();
    let representations: Vec<_> = planners
        .iter()
        .map(|(_, planner)| claimed(&host, planner))
        .collect::<Result<_>>()?;
    let mut met = vec![false; planners.len()];
    for name in views.views.iter().copied() {
        let spec = name.spec(views.grid.spec(), views.roadmap_seed);
        let view = spec.derive(&problem)?;
        for (number, (label, planner)) in planners.iter().enumerate() {
            if !representations[number].contains(&view.representation()) {
                continue;
            }
            met[number] = true;
            match trial(arguments, (&host, planner), (&problem, &view), task) {
                Ok(record) => {
                    rows.push(Line::new(name, label.clone(), &record));
                    trials.push(record);
                }
                Err(error @ (TrialError::Lacks { .. } | TrialError::Incapable { .. })) => {
                    rows.push(Line::refused(name, label.clone(), error.to_string()));
                }
                Err(error) => return Err(error.into()),
            }
        }
    }
    if let Some(number) = met.iter().position(|met| !met) {
        let reason = format!(
            "planner `{}` plans on none of the views that are asked for",
            planners[number].0
        );
        return Err(Failure::new(Exit::NoPlan, reason)
            .hint("`fleetyard plugins info NAME` lists what it can do; --views names the views"));
    }
    let all = rows.iter().all(|row| row.failure.is_none());
    match arguments.format {
        Format::Text => output::print(&table(&problem, task, &rows))?,
        Format::Json => output::print_json(&Report {
            task: file_name(task),
            agents: problem.task.agents.len(),
            rows,
            trials,
        })?,
    }
    Ok(if all { Exit::Success } else { Exit::NoPlan })
}

fn trial(
    arguments: &Compare,
    (host, planner): (&Host, &Plugin),
    (problem, view): (&Problem, &View),
    task: &Path,
) -> std::result::Result<Record, TrialError> {
    let config = sim_config(&arguments.world);
    let trial = Trial {
        host,
        planner,
        instance: TrialInstance::View {
            problem,
            view,
            terms: terms(
                problem,
                view,
                arguments.views.grid.separation,
                arguments.views.pace,
                arguments.world.step,
            ),
        },
        scenario: &file_name(task),
        seed: arguments.budget.seed,
        config: &config,
        robots: (!arguments.no_execute).then_some(&Robots::Pebbles),
    };
    Ok(trial.run(&mut NoTrace)?.record)
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
        "contacts",
        "nearest m",
    ];
    let cells = rows.iter().map(|row| {
        vec![
            row.view.to_string(),
            row.planner.clone(),
            told(row.valid_in_view).into(),
            told(row.valid_in_world).into(),
            shown(row.length_m),
            shown(row.soc_s),
            shown(row.makespan_s),
            shown(row.planning_time_ms),
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
        &[4, 5, 6, 7, 8, 9],
    ));
    for row in rows {
        if let Some(failure) = &row.failure {
            // Writing to a string cannot fail.
            let _ = write!(out, "\n{} on {}: {failure}", row.planner, row.view);
        }
    }
    out
}
