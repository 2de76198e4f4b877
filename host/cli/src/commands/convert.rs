//! `fleetyard convert`: instances and plans from one format to another.

use std::fs;
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::{ArgGroup, Args};
use fleetyard_core::formats::{
    AgentList, Contents, Format, Known, Lengths, Parts, Scale, TRANSPOSED_HINT, UnreadPlan,
    Written, grid_size, looks_transposed,
};
use fleetyard_core::{
    Grid, GridInstance, InputError, MotionFile, PathEncoding, PlanFile, RoadmapPlanFile,
    Separation, TrajectoryFile, write_all_atomically,
};
use fleetyard_sim::SimConfig;
use fleetyard_views::{Problem, Representation, View, load_problem};

use super::task::{Chosen, ViewArgs, place};
use crate::args::{MapNameArgs, VIEW, file_format, word};
use crate::exit::{Exit, Failure, Result, internal};
use crate::files::file_name;
use crate::output;

/// Convert an instance or a plan from one format to another.
///
/// Formats are guessed from content and name. What FROM lacks and TO needs is given
/// with options: a file of paths has no map, a schedule has no goals. With --task a plan of a view of
/// the task becomes one in the task's world, or the other way round.
#[derive(Debug, Args)]
#[command(group = ArgGroup::new("cells").multiple(true))]
pub(crate) struct Convert {
    /// The file to read, - for standard input
    #[arg(
        value_name = "FROM",
        required_unless_present = "list",
        requires = "output",
        group = "cells"
    )]
    input: Option<PathBuf>,
    /// The file to write, - for standard output
    #[arg(value_name = "TO")]
    output: Option<PathBuf>,
    /// List the formats and what each carries
    #[arg(long, conflicts_with = "input")]
    list: bool,
    /// The format of FROM [default: what the file looks like]
    #[arg(long, value_name = "FORMAT", value_parser = file_format)]
    from: Option<Format>,
    /// The format of TO [default: what its name says]
    #[arg(long, value_name = "FORMAT", value_parser = file_format)]
    to: Option<Format>,
    /// The map, where FROM has none
    #[arg(long, short, value_name = "FILE")]
    map: Option<PathBuf>,
    /// Starts and goals, where FROM has none: a scenario, or another instance
    #[arg(long, short, value_name = "FILE")]
    scen: Option<PathBuf>,
    #[command(flatten)]
    map_name: MapNameArgs,
    /// Search for the lengths of shortest paths that a scenario has per agent, which takes a while for
    /// thousands on large maps [default: those of FROM, or 0]
    #[arg(long)]
    lengths: bool,
    /// Number of agents to use, from the first [default: those of the plan, or all]
    #[arg(long, short = 'n', value_name = "N")]
    agents: Option<usize>,
    /// Task file: FROM is a plan of a view of it and TO the same plan in its world, or FROM is a plan in
    /// its world and TO the same plan of a view
    #[arg(long, help_heading = VIEW, value_name = "FILE",
          conflicts_with_all = ["map", "scen", "agents", "cell_size"])]
    task: Option<PathBuf>,
    #[command(flatten)]
    view: ViewArgs,
    /// Encoding of paths in a plan file [default: pairs]
    #[arg(long, value_parser = word::<PathEncoding>())]
    plan_encoding: Option<PathEncoding>,
    /// Side of a cell in metres, where a plan on a grid becomes trajectories
    #[arg(long, value_name = "METRES", default_value_t = SimConfig::default().cell_size_m)]
    cell_size: f64,
    /// Duration of one step in seconds, between a plan on a grid and trajectories [default: 1; for the
    /// grid of a task the time that robots need for a cell]
    #[arg(long, value_name = "SECONDS")]
    step: Option<f64>,
}

pub(crate) fn convert(arguments: &Convert) -> Result<Exit> {
    let (Some(from), Some(to)) = (&arguments.input, &arguments.output) else {
        output::print(&list())?;
        return Ok(Exit::Success);
    };
    if let Some(task) = &arguments.task {
        return of_task(arguments, task, from, to);
    }
    if arguments.view.grid.separation != Separation::default() {
        let reason = "--separation is about the grid of a task, and there is none";
        return Err(Failure::new(Exit::Usage, reason).hint("name the task with --task FILE"));
    }
    let map = arguments.map.as_deref();
    let named = map.map(|map| arguments.map_name.load(map)).transpose()?;
    let named = named.map(Arc::new);
    let scenario = arguments.scen.as_deref().map(load_agents).transpose()?;
    let known = Known {
        size: named.as_deref().map(grid_size),
        agents: scenario.as_ref(),
        team: arguments.agents,
    };
    let contents = Contents::load(from, arguments.from, known)?;
    for note in &contents.notes {
        output::note(note);
    }
    let format = target(arguments, to, &contents)?;
    let inputs: Vec<&Path> = [Some(from), arguments.map.as_ref(), arguments.scen.as_ref()]
        .into_iter()
        .flatten()
        .chain(&contents.files)
        .map(PathBuf::as_path)
        .collect();
    // A scenario of another tool's instance comes with the map that it is on.
    let with_map = contents.grid.is_some() && matches!(format, Format::Scen | Format::Pibt2);
    let name = stem(to);
    let map_file = if with_map {
        Some(format!("{name}.map"))
    } else {
        let named = arguments.map.as_deref().map(file_name);
        named.or_else(|| contents.map_file.clone())
    };
    let parts = parts(arguments, &contents, named, scenario.as_ref(), map_file)?;
    let mut written = parts.write(format, &name)?;
    if with_map {
        let map = parts.write(Format::Map, &name)?;
        written.others.push((format!("{name}.map"), map.bytes));
    }
    deliver(to, &written, &inputs)
}

/// Writes a file and those that belong to it, and says which there are.
fn deliver(to: &Path, written: &Written, inputs: &[&Path]) -> Result<Exit> {
    if to == Path::new("-") {
        if !written.others.is_empty() {
            let reason = "this is several files, which do not fit there";
            return Err(Failure::new(Exit::Usage, reason).hint("name a file instead of -"));
        }
        return to_stdout(&written.bytes);
    }
    let others = written.others.iter();
    let mut files: Vec<(PathBuf, &[u8])> = vec![(to.to_owned(), &written.bytes)];
    files.extend(others.map(|(name, bytes)| (to.with_file_name(name), bytes.as_slice())));
    for (path, _) in &files {
        refuse_input(path, inputs)?;
    }
    let files: Vec<(&Path, &[u8])> = files
        .iter()
        .map(|(path, bytes)| (&**path, *bytes))
        .collect();
    write_all_atomically(&files)?;
    for (path, _) in files {
        output::print(&path.display().to_string())?;
    }
    Ok(Exit::Success)
}

/// A plan of a view of a task as one in the task's world, or the other way round.
fn of_task(arguments: &Convert, task: &Path, from: &Path, to: &Path) -> Result<Exit> {
    let problem = load_problem(task)?;
    let file = UnreadPlan::load(from, arguments.from)?;
    let of_plan = Representation::of_plans(file.format());
    let named = !arguments.view.is_open();
    let named = named.then(|| arguments.view.choose(of_plan)).transpose()?;
    let format = match (arguments.to, of_plan) {
        (Some(format), _) => format,
        (None, Representation::Continuous) => {
            format_of(to, named.as_ref().map(Chosen::representation))?
        }
        (None, _) => format_of(to, Some(Representation::Continuous))?,
    };
    if !(format.carries_plan() || format.carries_trajectories()) {
        let reason = format!("{format} has no plan, and with --task plans are converted");
        return Err(Failure::new(Exit::Usage, reason).hint(TASK_FORMATS));
    }
    let goal = Representation::of_plans(format);
    let kind = match (of_plan, goal) {
        (Representation::Continuous, kind) | (kind, Representation::Continuous)
            if of_plan != goal =>
        {
            kind
        }
        // Controls alone become the knots to which they lead.
        (Representation::Continuous, kind)
            if matches!(file.motions()?, MotionFile::Controls(_)) =>
        {
            kind
        }
        _ => {
            let reason = format!(
                "this is a plan {}, and {format} is one {}",
                place(of_plan),
                place(goal)
            );
            let hint = if of_plan == goal {
                "leave out --task, which is for plans that become those of another view"
            } else {
                "write --to trajectories first; they go into every view whose plan they are"
            };
            return Err(InputError::new(file.source(), reason).hint(hint).into());
        }
    };
    let chosen = match named {
        Some(chosen) => chosen,
        None => arguments.view.choose(kind)?,
    };
    if chosen.representation() != kind {
        let (is, wanted) = (place(kind), place(chosen.representation()));
        let by = chosen.argument();
        let reason = format!("one of the plans is {is}, and {by} asks for one {wanted}");
        let hint = format!("leave out {by}, or name a view {is}");
        return Err(InputError::new(file.source(), reason).hint(hint).into());
    }
    let view = chosen.derive(&problem)?;
    let step_s = arguments.step.unwrap_or_else(|| view.step_s(&problem));
    let parts = if goal == Representation::Continuous {
        Parts {
            trajectories: Some(lifted(&view, &file, &problem, step_s)?),
            ..Parts::default()
        }
    } else {
        let plan = problem.read(&file)?;
        check_agents(&plan, &problem)?;
        lowered(&view, plan, step_s, arguments.plan_encoding)?
    };
    let written = parts.write(format, &stem(to))?;
    let inputs: Vec<&Path> = [from, task]
        .into_iter()
        .chain(arguments.view.files().map(PathBuf::as_path))
        .collect();
    deliver(to, &written, &inputs)
}

/// The formats of this project for plans of a task.
const TASK_FORMATS: &str = "say it with --to FORMAT: trajectories, plan or roadmap-plan";

/// The format that a name means for plans of a kind of view, if one is named.
fn format_of(to: &Path, kind: Option<Representation>) -> Result<Format> {
    let refused = |reason: String, hint: &str| Err(Failure::new(Exit::Usage, reason).hint(hint));
    let is_json = to.extension().is_some_and(|end| end == "json");
    match kind {
        _ if !is_json => {
            let reason = format!("{} does not say which format to write", to.display());
            refused(reason, TASK_FORMATS)
        }
        None => refused(
            "nothing says which view's plan this is to become".to_owned(),
            "name it with --representation grid, --representation roadmap or --view FILE",
        ),
        Some(Representation::Grid) => Ok(Format::Plan),
        Some(Representation::Roadmap) => Ok(Format::RoadmapPlan),
        Some(Representation::Continuous) => Ok(Format::Trajectories),
    }
}

/// A plan of a view in the world of its task.
fn lifted(
    view: &View,
    file: &UnreadPlan,
    problem: &Problem,
    step_s: f64,
) -> Result<TrajectoryFile> {
    let source = file.source();
    let refused = |reason: String, hint: Option<&'static str>| {
        InputError::new(source.as_str(), reason).maybe_hint(hint)
    };
    let (planner, plan) = match view {
        View::Grid(view) => {
            let file = view.read(file)?;
            let plan = view.lift(&file.plan, step_s);
            let plan = plan.map_err(|error| refused(error.to_string(), error.hint()))?;
            (file.planner, plan)
        }
        View::Roadmap(view) => {
            let file = view.read(file)?;
            let plan = view.lift(&file.plan);
            let plan = plan.map_err(|error| refused(error.to_string(), error.hint()))?;
            (file.planner, plan)
        }
        View::Continuous => {
            let file = problem.read(file)?;
            (file.planner, file.plan)
        }
    };
    let file = TrajectoryFile {
        source,
        planner,
        ..TrajectoryFile::new(plan)
    };
    check_agents(&file, problem)?;
    Ok(file)
}

/// A plan in the world as the plan of a view, with what a file of it needs.
fn lowered(
    view: &View,
    file: TrajectoryFile,
    step_s: f64,
    encoding: Option<PathEncoding>,
) -> Result<Parts> {
    let none = |reason: String| {
        InputError::new(file.source.as_str(), reason).hint(
            "only what moves as plans of this view do is one; `fleetyard run --task` plans on the view itself",
        )
    };
    if file.plan.has_headings() {
        output::note("headings are left out: plans of this view have none");
    }
    Ok(match view {
        View::Grid(view) => Parts {
            grid: Some(Arc::clone(view.instance.grid())),
            plan: Some(PlanFile {
                planner: file.planner.clone(),
                encoding: encoding.unwrap_or_default(),
                ..PlanFile::new(
                    &view.instance,
                    view.lower(&file.plan, step_s).map_err(none)?,
                )
            }),
            instance: Some(view.instance.clone()),
            ..Parts::default()
        },
        View::Roadmap(view) => {
            let plan = view.lower(&file.plan);
            let plan = plan.map_err(|error| none(error.to_string()))?;
            let plan = RoadmapPlanFile {
                planner: file.planner.clone(),
                ..RoadmapPlanFile::new(&view.roadmap, None, plan)
            };
            Parts {
                roadmap: Some(Arc::new(view.roadmap.clone())),
                roadmap_plan: Some(plan),
                ..Parts::default()
            }
        }
        View::Continuous => Parts {
            trajectories: Some(file),
            ..Parts::default()
        },
    })
}

/// Refuses a plan of another team than the task's.
fn check_agents(file: &TrajectoryFile, problem: &Problem) -> Result<()> {
    let (agents, asked) = (file.plan.agents(), problem.task.agents.len());
    if agents == asked {
        return Ok(());
    }
    let reason = format!("the plan has {agents} paths, and the task {asked} agents");
    Err(InputError::new(file.source.as_str(), reason)
        .hint("name the task that the plan was made for")
        .into())
}

/// The format to write: the one that was asked for, or that the name says.
fn target(arguments: &Convert, to: &Path, contents: &Contents) -> Result<Format> {
    let agents = arguments.scen.is_some();
    let meant = arguments.to.or_else(|| contents.format_for(to, agents));
    meant.ok_or_else(|| {
        let names: Vec<&str> = contents.formats().map(Format::name).collect();
        let reason = format!("{} does not say which format to write", to.display());
        Failure::new(Exit::Usage, reason).hint(format!(
            "say it with --to FORMAT, one of {}",
            names.join(", ")
        ))
    })
}

/// The parts to write: those of the file, and those that options add.
fn parts(
    arguments: &Convert,
    contents: &Contents,
    named: Option<Arc<Grid>>,
    scenario: Option<&AgentList>,
    map_file: Option<String>,
) -> Result<Parts> {
    let two = |what: &str, option: &str| {
        let reason = format!(
            "{} has {what}, so {option} is one too many",
            contents.format
        );
        Failure::new(Exit::Usage, reason).hint(format!("leave out {option}"))
    };
    let grid = match (&contents.grid, named) {
        (Some(_), Some(_)) => return Err(two("a map", "--map")),
        (Some(grid), None) => Some(grid.clone()),
        (None, named) => named,
    };
    if scenario.is_some() && contents.agents.is_some() {
        return Err(two("starts and goals", "--scen"));
    }
    let list = scenario.or(contents.agents.as_ref());
    let agents = arguments
        .agents
        .or_else(|| contents.plan.as_ref().map(|file| file.plan.agents()));
    if let (None, Some(_)) = (list, arguments.agents) {
        let reason = format!("{} has no starts and goals to count", contents.format);
        return Err(Failure::new(Exit::Usage, reason).hint("name a scenario with --scen FILE"));
    }
    let instance = match (&grid, list) {
        (Some(grid), Some(list)) => {
            let instance = list.instance(grid.clone(), agents, arguments.view.grid.connectivity)?;
            if contents.grid.is_none() {
                MapNameArgs::warn(list.check_name(grid));
            }
            Some(instance)
        }
        _ => None,
    };
    // Lengths that a scenario has stay as they are.
    let entries = list.map_or(&[][..], |list| list.agents.as_slice());
    let known: Option<Vec<f64>> = entries.iter().map(|entry| entry.length).collect();
    let lengths = match known {
        _ if arguments.lengths => Lengths::Searched,
        Some(lengths) => Lengths::Known(lengths),
        None => Lengths::Unknown,
    };
    let mut plan = contents.plan.clone();
    if let (Some(file), Some(grid)) = (&plan, &grid) {
        file.check_map(grid)?;
    }
    if let (Some(file), Some(instance)) = (&plan, &instance) {
        warn_of_transposition(file, instance);
    }
    if let (Some(file), Some(encoding)) = (&mut plan, arguments.plan_encoding) {
        file.encoding = encoding;
    }
    Ok(Parts {
        grid,
        map_file,
        instance,
        plan,
        roadmap: contents.roadmap.clone(),
        roadmap_plan: contents.roadmap_plan.clone(),
        trajectories: contents.trajectories.clone(),
        scale: Scale {
            cell_size_m: arguments.cell_size,
            step_s: arguments.step.unwrap_or(SimConfig::default().step_s),
        },
        lengths,
    })
}

fn load_agents(path: &Path) -> Result<AgentList> {
    let contents = Contents::load(path, None, Known::default())?;
    contents.agents.ok_or_else(|| {
        let reason = format!("this is {}, without starts and goals", contents.format);
        InputError::new(path.display().to_string(), reason)
            .hint("--scen names a scenario")
            .into()
    })
}

fn warn_of_transposition(file: &PlanFile, instance: &GridInstance) {
    let size = grid_size(instance.grid());
    if looks_transposed(size, instance.starts(), &file.plan) {
        output::warning(&format!("{}: {TRANSPOSED_HINT}", file.source));
    }
}

/// Refuses to replace what was read.
pub(super) fn refuse_input(path: &Path, inputs: &[&Path]) -> Result<()> {
    let Ok(target) = fs::canonicalize(path) else {
        return Ok(());
    };
    let read = inputs.iter().any(|input| {
        let same = fs::canonicalize(input).is_ok_and(|input| input == target);
        same && target.is_file()
    });
    if read {
        let reason = "this is one of the files that are read, and would be replaced";
        return Err(InputError::new(path.display().to_string(), reason)
            .hint("write to another name or folder")
            .into());
    }
    Ok(())
}

fn stem(path: &Path) -> String {
    let stem = path.file_stem().unwrap_or(path.as_os_str());
    stem.to_string_lossy().into_owned()
}

pub(super) fn to_stdout(bytes: &[u8]) -> Result<Exit> {
    let mut out = io::stdout().lock();
    match out.write_all(bytes).and_then(|()| out.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(internal(error)),
        _ => Ok(Exit::Success),
    }
}

/// The table of formats. Every one is read, and written if it does not say otherwise.
fn list() -> String {
    let rows = Format::ALL.iter().map(|format| {
        let first = |pairs: &[(bool, &str)]| {
            let found = pairs.iter().find(|(carries, _)| *carries);
            found.map_or("-", |(_, what)| what).to_owned()
        };
        vec![
            format.name().to_owned(),
            first(&[
                (format.carries_map(), "grid"),
                (format.carries_roadmap(), "roadmap"),
            ]),
            first(&[(format.carries_agents(), "yes")]),
            first(&[
                (format.carries_plan(), "grid"),
                (format.carries_trajectories(), "plane"),
            ]),
            first(&[
                (format.needs_starts(), "--map, --scen"),
                (format.needs_map_size(), "--map"),
            ]),
            format.about().to_owned(),
        ]
    });
    let header = [
        "format",
        "map",
        "starts, goals",
        "plan",
        "to read",
        "what it is",
    ];
    output::table(&header, rows.collect(), &[])
}
