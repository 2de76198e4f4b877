//! `fleetyard validate`: is a plan valid, and what does it cost?

use std::fmt::Write as _;
use std::path::PathBuf;
use std::sync::Arc;

use clap::{ArgGroup, Args};
use fleetyard_bench::number;
use fleetyard_check::{PathRule, Terms, Verdict, metrics, validate_paths, validate_terms};
use fleetyard_core::formats::{
    AgentList, AnyPlan, Format as FileFormat, Known, TRANSPOSED_HINT, grid_size, load_any_plan,
    looks_transposed,
};
use fleetyard_core::{Digest, InputError, load_scen};
use serde::Serialize;

use super::task::TaskArgs;
use super::validate_plane::{PlaneArgs, judge};
use super::verdict::{Unlisted, write_verdict};
use crate::args::{Format, MapNameArgs, file_format, word};
use crate::exit::{Exit, Failure, Result};
use crate::output;
use crate::setup::{check_rule, map_of};

/// Say whether a plan is valid, and what it costs.
///
/// A plan on a grid is judged by the rules of its instance. With --radius or --fleet a plan
/// is judged in the plane, where footprints must not overlap at any time. With --task a plan of
/// any view is judged by the rules of its view and, in the task's world, by footprints.
#[derive(Debug, Args)]
#[command(group = ArgGroup::new("cells").multiple(true))]
pub(crate) struct Validate {
    /// Map file, in any format that `fleetyard convert --list` lists, or a folder with NAME.map; a plan on a
    /// grid needs it [default: the folder of the scenario]
    #[arg(long, short, value_name = "PATH", group = "cells")]
    map: Option<PathBuf>,
    /// MovingAI scenario file, with starts and goals; a plan on a grid needs it
    #[arg(long, short, value_name = "FILE", group = "cells")]
    scen: Option<PathBuf>,
    #[command(flatten)]
    map_name: MapNameArgs,
    /// Number of the scenario's entries to use, from the first
    #[arg(long, short = 'n', value_name = "N", requires = "scen")]
    agents: Option<usize>,
    /// Rule for the motion between two cells of a path
    #[arg(long, value_parser = word::<PathRule>(), default_value_t)]
    path_rule: PathRule,
    #[command(flatten)]
    plane: PlaneArgs,
    #[command(flatten)]
    task: TaskArgs,
    /// The plan, in any format that `fleetyard convert --list` lists
    plan: PathBuf,
    /// List all violations, not only the first of them
    #[arg(long)]
    all: bool,
    /// The format of the plan [default: what the file looks like]
    #[arg(long, value_name = "FORMAT", value_parser = file_format)]
    from: Option<FileFormat>,
    #[command(flatten)]
    format: Format,
}

impl Validate {
    /// Number of violations that are listed: as many as people read, or programs may be after.
    fn listed(&self) -> usize {
        match (self.all, self.format) {
            (true, _) => 1_000_000,
            (false, Format::Text) => 20,
            (false, Format::Json) => 100,
        }
    }
}

#[derive(Serialize)]
struct Report {
    verdict: Verdict,
    metrics: Figures,
    instance_digest: Digest,
    plan_digest: Digest,
}

#[derive(Serialize)]
struct Figures {
    soc_steps: u64,
    makespan_steps: u64,
    lower_bound_steps: u64,
    length_cells: u64,
    length_m: f64,
    waits: u64,
}

pub(crate) fn validate(arguments: &Validate) -> Result<Exit> {
    let plane = &arguments.plane;
    let others = [
        ("--map", arguments.map.is_some()),
        ("--world", plane.world.is_some()),
        ("--radius", plane.radius.is_some()),
        ("--fleet", plane.fleet.is_some()),
    ];
    if let Some(task) = arguments.task.task(&others)? {
        let (plan, step_s, listed) = (&arguments.plan, arguments.plane.step, arguments.listed());
        let judgement = arguments
            .task
            .judge(task, plan, arguments.from, step_s, listed)?;
        match arguments.format {
            Format::Json => output::print_json(&judgement.report)?,
            Format::Text => output::print(&judgement.report.text(listed))?,
        }
        judgement.hint();
        return Ok(exit(judgement.is_valid()));
    }
    let scenario = arguments.scen.as_deref().map(load_scen).transpose()?;
    let map = match (&arguments.scen, &scenario) {
        (Some(file), Some(scenario)) => Some(map_of(scenario, file, arguments.map.as_ref())?),
        _ => arguments.map.clone(),
    };
    let grid = map.map(|map| arguments.map_name.load(&map)).transpose()?;
    let grid = grid.map(Arc::new);
    let agents = scenario.as_ref().map(AgentList::from);
    let known = Known {
        size: grid.as_deref().map(grid_size),
        agents: agents.as_ref(),
        team: arguments.agents,
    };
    let plan = load_any_plan(&arguments.plan, arguments.from, known)?;
    let instance = |agents| match (&scenario, &grid) {
        (Some(scenario), Some(grid)) => {
            let agents = arguments.agents.unwrap_or(agents);
            let instance =
                scenario.instance(grid.clone(), agents, arguments.task.view.grid.connectivity)?;
            MapNameArgs::warn(scenario.check_name(grid));
            Ok(Some(instance))
        }
        _ => Ok::<_, InputError>(None),
    };
    let file = match plan {
        AnyPlan::Trajectories(file)
            if plane.has_robots() && grid.is_none() && plane.world.is_none() =>
        {
            let reason = "this is a plan in the plane, and nothing says what stands there";
            return Err(InputError::new(file.source, reason)
                .hint("name the world with --world FILE, or a map with --map FILE")
                .into());
        }
        plan if arguments.plane.has_robots() => {
            let (plane, rule, listed) = (&arguments.plane, arguments.path_rule, arguments.listed());
            let report = judge(plane, rule, listed, grid.as_deref(), plan, instance)?;
            match arguments.format {
                Format::Json => output::print_json(&report)?,
                Format::Text => output::print(&report.text(listed))?,
            }
            return Ok(exit(report.is_valid()));
        }
        AnyPlan::Grid(file) => file,
        AnyPlan::Trajectories(file) => {
            return Err(InputError::new(
                file.source,
                "this is a plan in the plane, and nothing says what the robots are",
            )
            .hint(
                "name their shape with --radius METRES or --fleet FILE, \
                 and what stands in their way with --world FILE or --map FILE",
            )
            .into());
        }
    };
    // With no number it would be valid whichever robots it leaves out.
    let (Some(_), Some(instance)) = (arguments.agents, instance(file.plan.agents())?) else {
        let reason = "a plan on a grid needs a map, a scenario and the number of agents";
        return Err(Failure::new(Exit::Usage, reason)
            .hint("name them with --map FILE, --scen FILE and --agents N"));
    };
    let size = grid_size(instance.grid());
    let rule = arguments.path_rule;
    check_rule(rule, instance.agents())?;
    file.check_for(&instance)?;
    let figures = metrics(&instance, &file.plan, arguments.plane.cell_size);
    let verdict = match rule {
        PathRule::Steps => {
            let terms = Terms {
                separation: arguments.task.view.grid.separation,
                ..(&instance).into()
            };
            validate_terms(&terms, &file.plan, arguments.listed())
        }
        PathRule::Bresenham | PathRule::Supercover => {
            validate_paths(&instance, &file.plan, rule, arguments.listed())
        }
    };
    let report = Report {
        verdict,
        metrics: Figures {
            soc_steps: figures.sum_of_costs,
            makespan_steps: figures.makespan,
            lower_bound_steps: figures.lower_bound_steps,
            length_cells: figures.length_cells,
            length_m: figures.length_m,
            waits: figures.waits,
        },
        instance_digest: instance.digest(),
        plan_digest: Digest::of_plan(&file.plan),
    };
    match arguments.format {
        Format::Json => output::print_json(&report)?,
        Format::Text => output::print(&text(&report, rule))?,
    }
    if !report.verdict.valid && looks_transposed(size, instance.starts(), &file.plan) {
        output::hint(TRANSPOSED_HINT);
    }
    Ok(exit(report.verdict.valid))
}

fn exit(valid: bool) -> Exit {
    if valid {
        Exit::Success
    } else {
        Exit::InvalidPlan
    }
}

fn text(report: &Report, rule: PathRule) -> String {
    let Report {
        verdict, metrics, ..
    } = report;
    let mut out = String::new();
    let found = verdict.violations.iter();
    let found = found.map(|found| (found.rule.name(), found.sentence.as_str()));
    let unlisted = Unlisted::of_all(verdict.violation_count, verdict.violations.len());
    write_verdict(&mut out, "", found, unlisted);
    let Figures {
        soc_steps,
        makespan_steps,
        lower_bound_steps,
        length_cells,
        length_m,
        ..
    } = metrics;
    // Writing to a string cannot fail. Paths in straight lines have no steps.
    if rule == PathRule::Steps {
        let _ = writeln!(
            out,
            "sum of costs {soc_steps} steps (lower bound {lower_bound_steps})"
        );
        let _ = writeln!(out, "makespan     {makespan_steps} steps");
        let _ = write!(out, "path length  {} m", number(*length_m));
    } else {
        let _ = writeln!(out, "path length  {length_cells} cells");
        let _ = write!(out, "in metres    {} m", number(*length_m));
    }
    out
}
