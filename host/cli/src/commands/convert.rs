//! `fleetyard convert`: instances and plans from one format to another.

use std::fs;
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::Args;
use fleetyard_core::formats::{
    AgentList, Contents, Format, Parts, Scale, TRANSPOSED_HINT, grid_size, looks_transposed,
};
use fleetyard_core::{
    Connectivity, Grid, GridInstance, InputError, PathEncoding, PlanFile, load_map,
    write_all_atomically,
};
use fleetyard_sim::SimConfig;

use crate::args::{connectivity, file_format, word};
use crate::exit::{Exit, Failure, Result, internal};
use crate::files::file_name;
use crate::output;

/// Convert an instance or a plan from one format to another.
///
/// Formats are guessed from content and name. What FROM lacks and TO needs is given
/// with options: a file of paths has no map, a schedule has no goals.
#[derive(Debug, Args)]
pub(crate) struct Convert {
    /// The file to read, - for standard input
    #[arg(
        value_name = "FROM",
        required_unless_present = "list",
        requires = "output"
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
    #[arg(long, value_name = "FILE")]
    map: Option<PathBuf>,
    /// Starts and goals, where FROM has none: a scenario, or another instance
    #[arg(long, value_name = "FILE")]
    scen: Option<PathBuf>,
    /// Number of agents to use, from the first [default: those of the plan, or all]
    #[arg(long, value_name = "N")]
    agents: Option<usize>,
    /// Neighbours of a cell: 4 or 8
    #[arg(long, value_name = "N", default_value = "4", value_parser = connectivity)]
    connectivity: Connectivity,
    /// Encoding of paths in a plan file [default: pairs]
    #[arg(long, value_parser = word::<PathEncoding>())]
    plan_encoding: Option<PathEncoding>,
    /// Side of a cell in metres, where a plan on a grid becomes trajectories
    #[arg(long, value_name = "METRES", default_value_t = SimConfig::default().cell_size_m)]
    cell_size: f64,
    /// Duration of one step in seconds, where a plan on a grid becomes trajectories
    #[arg(long, value_name = "SECONDS", default_value_t = SimConfig::default().step_s)]
    step: f64,
}

pub(crate) fn convert(arguments: &Convert) -> Result<Exit> {
    let (Some(from), Some(to)) = (&arguments.input, &arguments.output) else {
        output::print(&list())?;
        return Ok(Exit::Success);
    };
    let named = arguments.map.as_deref().map(load_map).transpose()?;
    let named = named.map(Arc::new);
    let size = named.as_deref().map(grid_size);
    let contents = Contents::load(from, arguments.from, size)?;
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
    let parts = parts(arguments, &contents, named, map_file)?;
    let mut written = parts.write(format, &name)?;
    if with_map {
        let map = parts.write(Format::Map, &name)?;
        written.others.push((format!("{name}.map"), map.bytes));
    }
    if to == Path::new("-") {
        if !written.others.is_empty() {
            let reason = format!("the format {format} is several files, which do not fit there");
            return Err(Failure::new(Exit::Usage, reason).hint("name a file instead of -"));
        }
        return to_stdout(&written.bytes);
    }
    let others = written.others.iter();
    let mut files: Vec<(PathBuf, &[u8])> = vec![(to.clone(), &written.bytes)];
    files.extend(others.map(|(name, bytes)| (to.with_file_name(name), bytes.as_slice())));
    for (path, _) in &files {
        refuse_input(path, &inputs)?;
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
    let scenario = match (&arguments.scen, &contents.agents) {
        (Some(_), Some(_)) => return Err(two("starts and goals", "--scen")),
        (Some(path), None) => Some(load_agents(path)?),
        (None, _) => None,
    };
    let list = scenario.as_ref().or(contents.agents.as_ref());
    let agents = arguments
        .agents
        .or_else(|| contents.plan.as_ref().map(|file| file.plan.agents()));
    if let (None, Some(_)) = (list, arguments.agents) {
        let reason = format!("{} has no starts and goals to count", contents.format);
        return Err(Failure::new(Exit::Usage, reason).hint("name a scenario with --scen FILE"));
    }
    let instance = match (&grid, list) {
        (Some(grid), Some(list)) => {
            Some(list.instance(grid.clone(), agents, arguments.connectivity)?)
        }
        _ => None,
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
            step_s: arguments.step,
        },
    })
}

fn load_agents(path: &Path) -> Result<AgentList> {
    let contents = Contents::load(path, None, None)?;
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
            first(&[(format.needs_map_size(), "--map")]),
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
