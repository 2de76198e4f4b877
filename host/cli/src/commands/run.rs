//! `fleetyard run`: one planner on one instance.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::thread::{self, JoinHandle};

use clap::{ArgAction, Args};
use fleetyard_abi::{Plan, Status};
use fleetyard_bench::suite::{AskedView, Question};
use fleetyard_bench::{
    ClaimedIncumbent, Followed, GivenOptions, Host, Outcome, Plugin, Record, Robots, Trial,
};
use fleetyard_check::PathRule;
use fleetyard_core::formats::{TRANSPOSED_HINT, grid_size, looks_transposed};
use fleetyard_core::plan_file::{PlanFile, save_plan};
use fleetyard_core::{
    GridInstance, GridPlan, InputError, PathEncoding, RoadmapPlanFile, Scenario, TrajectoryFile,
    load_scen, save_annotations, save_roadmap_plan, save_trajectories,
};
use fleetyard_runtime::{Attach, Follow, LogLine, Termination, interrupt_calls, interrupted_by};
use fleetyard_view::{Layers, Picture, World};
use fleetyard_views::{Problem, Representation, View, load_problem, visits_of};
use serde::Serialize;

use super::simulate::Sinks;
use super::task::{ViewArgs, claimed};
use crate::args::{
    BudgetArgs, EXECUTION, Format, INSTANCE, MapNameArgs, PLANNER, PluginArg, RECORDS, WorldArgs,
    Written, picture, word,
};
use crate::exit::{Exit, Failure, Result, internal};
use crate::files::{draw, file_name};
use crate::output;
use crate::setup::{find_planner, host, map_of, sim_config, warn_of_cell_size};

/// Run a planner on an instance under a budget and judge its plan.
#[derive(Debug, Args)]
pub(crate) struct Run {
    #[command(flatten)]
    instance: InstanceArgs,
    /// A plugin's identifier, or the path of a library, a program or their folder; PATH:ID
    /// picks one of several. Its options may follow
    #[arg(long, short, help_heading = PLANNER, value_names = ["PLUGIN", "NAME=VALUE"], num_args = 1.., required = true,
          action = ArgAction::Set)]
    planner: Vec<String>,
    /// An option of the planner; may be given several times
    #[arg(long = "option", help_heading = PLANNER, value_name = "NAME=VALUE")]
    options: Vec<String>,
    /// Rule for the motion between two cells of a path
    #[arg(long, help_heading = INSTANCE, value_parser = word::<PathRule>(), default_value_t)]
    path_rule: PathRule,
    #[command(flatten)]
    view: ViewArgs,
    #[command(flatten)]
    budget: BudgetArgs,
    /// Attachment of the plugin [default: worker for libraries, stdio for programs, command for a
    /// planner.toml]
    #[arg(long, help_heading = PLANNER, value_parser = word::<Attach>())]
    attach: Option<Attach>,
    /// Execute the plan in the simulator
    #[arg(long, help_heading = EXECUTION)]
    execute: bool,
    #[command(flatten)]
    world: WorldArgs,
    /// Write the plan to a file
    #[arg(long, help_heading = RECORDS, value_name = "FILE", value_parser = |text: &str| Written::Json.path(text))]
    plan_out: Option<PathBuf>,
    /// Encoding of paths in the plan file
    #[arg(long, help_heading = RECORDS, value_parser = word::<PathEncoding>(), default_value_t)]
    plan_encoding: PathEncoding,
    /// Write the execution's trace to a file (implies --execute)
    #[arg(long, help_heading = RECORDS, value_name = "FILE", value_parser = |text: &str| Written::Trace.path(text))]
    trace_out: Option<PathBuf>,
    /// Ask the planner what it wants to show, such as constraints and conflicts, and write that to a
    /// file, fleetyard.annotations/1; --picture shows it
    #[arg(long, help_heading = RECORDS, value_name = "FILE", value_parser = |text: &str| Written::Json.path(text))]
    annotations: Option<PathBuf>,
    /// Draw map, paths, starts and goals to a file, SVG or PNG by its name
    #[arg(long, help_heading = RECORDS, value_name = "FILE", value_parser = picture)]
    picture: Option<PathBuf>,
    /// Print plans as they come, a line of JSON each, with what they cost as the planner has them: nobody
    /// has judged them yet. With --format json the record is such a line, too, and the last
    #[arg(long, help_heading = RECORDS)]
    follow: bool,
    /// Show what the planner wrote to its log and to standard error
    #[arg(long, short)]
    verbose: bool,
    #[command(flatten)]
    format: Format,
}

/// The instance that is asked.
#[derive(Debug, Args)]
struct InstanceArgs {
    /// Map file: MovingAI, fleetyard.grid/1 or LSMART, or a folder with NAME.map [default: the folder of
    /// the scenario]
    #[arg(long, short, help_heading = INSTANCE, value_name = "PATH")]
    map: Option<PathBuf>,
    /// MovingAI scenario file
    #[arg(long, short, help_heading = INSTANCE, value_name = "FILE", group = "cells",
          required_unless_present = "task")]
    scen: Option<PathBuf>,
    #[command(flatten)]
    map_name: MapNameArgs,
    /// Number of the scenario's entries or of the task's agents to use, from the first
    #[arg(long, short = 'n', help_heading = INSTANCE, value_name = "N", required_unless_present = "task")]
    agents: Option<usize>,
    /// Task file, of which the planner gets a view: its plan is judged by the rules of the view and
    /// by footprints in the task's world
    #[arg(long, help_heading = INSTANCE, value_name = "FILE", group = "cells",
          conflicts_with_all = ["map", "scen", "path_rule", "cell_size", "radius"])]
    task: Option<PathBuf>,
}

/// A scenario, and the file of its map.
struct Found {
    scenario: Scenario,
    map: PathBuf,
}

impl InstanceArgs {
    /// The instance; a step on the grid of a task takes `step_s` seconds, or what the view says.
    fn load(
        &self,
        found: Option<Found>,
        view: &ViewArgs,
        step_s: Option<f64>,
        host: &Host,
        planner: &Plugin,
    ) -> Result<Question> {
        if let Some(task) = &self.task {
            let problem = load_problem(task)?;
            let problem = match self.agents {
                Some(agents) => first(problem, agents)?,
                None => problem,
            };
            let otherwise = match view.is_open().then(|| claimed(host, planner)).transpose()? {
                Some(only) if only.len() == 1 => only[0],
                _ => Representation::Grid,
            };
            let derived = view.choose(otherwise)?.derive(&problem)?;
            return Ok(Question::View(Box::new(AskedView {
                terms: derived.terms(&problem, view.grid.separation, view.pace, step_s),
                view: derived,
                problem,
            })));
        }
        // The parser asks for them.
        let (Some(found), Some(agents)) = (found, self.agents) else {
            return Err(Failure::new(Exit::Usage, "neither a scenario nor a task"));
        };
        let grid = Arc::new(self.map_name.load(&found.map)?);
        let scenario = &found.scenario;
        let instance = scenario.instance(Arc::clone(&grid), agents, view.grid.connectivity)?;
        MapNameArgs::warn(scenario.check_name(&grid));
        Ok(Question::Grid(instance))
    }

    /// The scenario, and where its map is; nothing with a task.
    fn find(&self) -> Result<Option<Found>> {
        let Some(file) = &self.scen else {
            return Ok(None);
        };
        let scenario = load_scen(file)?;
        let map = map_of(&scenario, file, self.map.as_ref())?;
        Ok(Some(Found { scenario, map }))
    }

    /// The file that says where agents start.
    fn file(&self) -> &Path {
        let file = self.task.as_deref().or(self.scen.as_deref());
        file.unwrap_or(Path::new(""))
    }
}

/// The task with its first agents.
fn first(problem: Problem, agents: usize) -> Result<Problem> {
    let has = problem.task.agents.len();
    if (1..=has).contains(&agents) {
        return Ok(problem.first(agents));
    }
    let reason = format!("{agents} agents asked for, but the task has {has}");
    Err(InputError::new(problem.task.source.as_str(), reason)
        .hint(format!("ask for 1 to {has} agents"))
        .into())
}

pub(crate) fn run(arguments: &Run) -> Result<Exit> {
    let asked = PluginArg::new(&arguments.planner, &arguments.options)?;
    for path in [
        &arguments.plan_out,
        &arguments.annotations,
        &arguments.picture,
    ]
    .into_iter()
    .flatten()
    {
        check_folder(path)?;
    }
    let attach = arguments.attach;
    let outputs = [
        &arguments.plan_out,
        &arguments.trace_out,
        &arguments.annotations,
        &arguments.picture,
    ];
    let mut hidden: Vec<PathBuf> = outputs.into_iter().flatten().cloned().collect();
    let given = &arguments.instance;
    let found = given.find()?;
    hidden.extend(found.iter().map(|found| found.map.clone()));
    hidden.extend([&given.scen, &given.task].into_iter().flatten().cloned());
    hidden.extend(arguments.view.files().cloned());
    let host = host(&arguments.budget, attach, hidden)?;
    let planner = find_planner(&host.runtime, &asked.plugin)?
        .attached(attach)
        .with_options(GivenOptions::Texts(asked.options));
    let map = found.as_ref().map(|found| found.map.clone());
    let asked_instance = given.load(
        found,
        &arguments.view,
        arguments.world.step,
        &host,
        &planner,
    )?;
    let execute = arguments.execute || arguments.trace_out.is_some();
    if let (Some(map), Question::Grid(instance), true) = (&map, &asked_instance, execute) {
        warn_of_cell_size(map, instance.grid(), arguments.world.cell_size);
    }
    let bar = output::spinner(&format!(
        "{} on {}, {} agents",
        planner.name,
        file_name(given.file()),
        asked_instance.trial(arguments.path_rule).agents()
    ));
    // Every tick: the trace is what other tools replay.
    let mut sinks = Sinks::create(arguments.trace_out.as_deref(), 1, None, bar.clone())?;
    let printer = arguments.follow.then(Printer::start).transpose()?;
    let trial = Trial {
        host: &host,
        planner: &planner,
        instance: asked_instance.trial(arguments.path_rule),
        scenario: &file_name(given.file()),
        seed: arguments.budget.seed,
        config: &sim_config(&arguments.world),
        robots: execute.then_some(&Robots::Pebbles),
        annotations: arguments.annotations.is_some(),
        follower: printer.as_ref().map(|printer| &printer.follower),
    };
    if let Err(error) = interrupt_calls() {
        output::warning(&format!(
            "an interrupt will end the run without its plan: {error}"
        ));
    }
    let outcome = trial.run(&mut sinks);
    let refused = outcome.as_ref().ok().map(|outcome| &outcome.record);
    let refused = refused.filter(|record| record.termination == Termination::Unsupported);
    let others = refused.and_then(|record| trial.others(&record.planner.id).named());
    printer.map_or(Ok(()), Printer::finish)?;
    let outcome = outcome?;
    bar.finish_and_clear();
    let record = &outcome.record;
    let plan = outcome.plan.as_ref();
    if let (Some(path), Some(plan)) = (&arguments.plan_out, plan) {
        save(&asked_instance, plan, arguments, record, path)?;
        if let Some(reason) = not_a_solution(record) {
            output::note(&format!("the plan in {} is {reason}", path.display()));
        }
    }
    if let (Some(path), Some(annotations)) = (&arguments.annotations, &outcome.annotations) {
        save_annotations(annotations, path)?;
        if annotations.left_out > 0 {
            output::note(&format!(
                "{} annotations were left out: {} are all that is kept of a call",
                annotations.left_out,
                annotations.annotations.len()
            ));
        }
    }
    if record.execution.is_some() {
        sinks.finish()?;
    }
    if let Some(path) = &arguments.picture {
        paint(&asked_instance, &outcome, arguments, path)?;
    }
    tell(arguments.verbose, &outcome);
    match arguments.format {
        Format::Text => output::print(&output::plain(&record.text()))?,
        Format::Json if arguments.follow => output::print_json_line(&Line::Record(record))?,
        Format::Json => output::print_json(record)?,
    }
    // Also when the planner had just answered.
    let interrupted = interrupted_by().is_some();
    let exit = if interrupted {
        Exit::Interrupted
    } else {
        record.ending().into()
    };
    if interrupted {
        output::note(match &plan {
            Some(_) => "interrupted; this is the best plan until then",
            None => "interrupted; there was no plan until then",
        });
    }
    let ended = record.termination == Termination::Interrupted;
    if let Some(fault) = record.fault.as_ref().filter(|_| !ended) {
        output::error(&format!("planner `{}` {fault}", record.planner.id));
        if let Some(others) = others {
            output::hint(&format!("others that claim to: {others}"));
        }
    } else if exit == Exit::NoPlan {
        output::error(&no_plan(record, arguments));
    }
    let judged = interrupted || exit == Exit::InvalidPlan;
    if let (true, Some(first)) = (judged, record.sentences().first()) {
        let count = record.verdict.violation_count;
        output::error(&format!(
            "the plan is invalid ({count} violations): {first}"
        ));
        let cells = plan.and_then(Plan::cells);
        if let (Question::Grid(instance), Some(cells)) = (&asked_instance, cells)
            && looks_transposed(grid_size(instance.grid()), instance.starts(), cells)
        {
            output::hint(TRANSPOSED_HINT);
        }
    }
    if plan.is_none() {
        for path in [&arguments.plan_out, &arguments.trace_out]
            .into_iter()
            .flatten()
        {
            output::note(&format!(
                "{} was not written: there is no plan",
                path.display()
            ));
        }
    }
    Ok(exit)
}

/// A line of what is printed while a planner goes on, and at the end.
#[derive(Serialize)]
#[serde(rename_all = "kebab-case")]
enum Line<'a> {
    Incumbent(ClaimedIncumbent),
    Record(&'a Record),
}

/// Prints plans as they come, in a thread of its own: a slow reader does not hold up the planner.
struct Printer {
    follower: Arc<dyn Follow>,
    thread: JoinHandle<Result<()>>,
}

impl Printer {
    fn start() -> Result<Self> {
        let (followed, told) = Followed::new();
        let print = move || {
            let mut lines = told.iter().map(Line::Incumbent);
            lines.try_for_each(|line| output::print_json_line(&line))
        };
        let thread = thread::Builder::new().name("follow".into()).spawn(print);
        Ok(Self {
            follower: Arc::new(followed),
            thread: thread.map_err(internal)?,
        })
    }

    /// Waits until all that was told is printed.
    fn finish(self) -> Result<()> {
        drop(self.follower);
        self.thread.join().unwrap_or(Ok(()))
    }
}

/// Writes a plan in the file form of its representation.
fn save(
    asked: &Question,
    plan: &Plan,
    arguments: &Run,
    record: &Record,
    path: &Path,
) -> Result<()> {
    let author = format!("{} {}", record.planner.id, record.planner.version);
    let planner = Some(match not_a_solution(record) {
        Some(reason) => format!("{author}; {reason}"),
        None => author,
    });
    let grid = |instance: &GridInstance, cells: &GridPlan| {
        let mut file = PlanFile::new(instance, cells.trimmed());
        file.planner.clone_from(&planner);
        file.encoding = arguments.plan_encoding;
        save_plan(&file, path)
    };
    let source = path.display().to_string();
    match (asked, plan) {
        (Question::Grid(instance), Plan::Cells(cells)) => grid(instance, cells)?,
        (Question::View(asked), plan) => match (&asked.view, plan) {
            (View::Grid(view), Plan::Cells(cells)) => grid(&view.instance, cells)?,
            (View::Roadmap(view), Plan::Visits(visits)) => {
                if let Ok(plan) = visits_of(visits) {
                    let file = RoadmapPlanFile {
                        planner,
                        ..RoadmapPlanFile::new(&view.roadmap, None, plan)
                    };
                    save_roadmap_plan(&file, path)?;
                }
            }
            (View::Continuous, Plan::Trajectories(motions)) => {
                if let Ok(plan) = asked.problem.motions(motions) {
                    let file = TrajectoryFile {
                        source,
                        planner,
                        plan_digest: Some(plan.digest()),
                        plan,
                    };
                    save_trajectories(&file, path)?;
                }
            }
            _ => output::warning("the plan is none of this view, and was not written"),
        },
        (Question::Grid(_), _) => {
            output::warning("the plan is none on a grid, and was not written");
        }
    }
    Ok(())
}

/// That what a failed run left is no solution, with the reason and how far it came.
fn not_a_solution(record: &Record) -> Option<String> {
    // A plan that keeps all rules is one, whatever became of the run.
    if record.verdict.valid && record.judged.is_none() {
        return None;
    }
    let reason = record.failure()?;
    let there = record
        .metrics
        .agents_at_goal
        .map_or(String::new(), |there| {
            format!(
                ", {there} of {} agents at their goals",
                record.instance.agents
            )
        });
    Some(format!("not a solution: {reason}{there}"))
}

/// Draws the instance, and the plan as it is or as it lies in the world.
fn paint(asked: &Question, outcome: &Outcome, arguments: &Run, path: &Path) -> Result<()> {
    let layers = outcome.annotations.as_ref().map(Layers::of);
    let layers = layers.unwrap_or_default();
    match asked {
        Question::Grid(instance) => {
            let grid = instance.grid();
            let world = World::of_grid(grid, sim_config(&arguments.world).cell_size_m);
            let mut picture = Picture::new(&world).layers(layers);
            if let Some(plan) = outcome.plan.as_ref().and_then(Plan::cells) {
                picture = picture.plan(grid, plan).goals(grid, instance.goals());
            }
            draw(path, &picture)
        }
        Question::View(asked) => {
            let world = World::of_workspace(&asked.problem.world);
            let mut picture = Picture::new(&world).layers(layers);
            let judged = outcome.record.judged.as_ref();
            if let Some(lifted) = judged.and_then(|judged| judged.lifted.as_ref()) {
                picture = picture.trajectories(lifted);
            }
            draw(path, &picture)
        }
    }
}

/// The reason why there is no plan although the planner is not at fault.
fn no_plan(record: &Record, arguments: &Run) -> String {
    let id = &record.planner.id;
    let mut reason = match record.claim {
        Some(Status::Infeasible) => format!("planner `{id}` claims that no plan exists"),
        Some(Status::GaveUp) => format!("planner `{id}` gave up"),
        _ => format!("no plan within the budget of {:?}", arguments.budget.budget),
    };
    if let Some(message) = &record.message {
        reason = format!("{reason}: {message}");
    }
    reason
}

/// Refuses what cannot be written before the budget is spent, not after.
pub(super) fn check_folder(path: &Path) -> Result<()> {
    let folder = path.parent().filter(|f| !f.as_os_str().is_empty());
    let reason = match folder {
        _ if path.is_dir() => "cannot write: this is a folder",
        Some(folder) if !folder.is_dir() => "cannot write: its folder does not exist",
        _ => return Ok(()),
    };
    Err(InputError::new(path.display().to_string(), reason)
        .hint("name a file in a folder that exists")
        .into())
}

/// Tells on standard error what is not part of the result.
fn tell(verbose: bool, outcome: &Outcome) {
    for warning in &outcome.warnings {
        output::warning(warning);
    }
    if verbose {
        for LogLine { level, text } in &outcome.log {
            eprintln!("[{level:?}] {}", output::plain(text));
        }
    }
    // What a planner that failed had to say is worth seeing unasked.
    let failed = outcome.record.fault.is_some();
    let shown = if verbose { usize::MAX } else { 10 };
    if (verbose || failed) && !outcome.stderr.trim().is_empty() {
        let lines: Vec<&str> = outcome.stderr.trim_end().lines().collect();
        for line in &lines[lines.len().saturating_sub(shown)..] {
            eprintln!("[stderr] {}", output::plain(line));
        }
    }
}
