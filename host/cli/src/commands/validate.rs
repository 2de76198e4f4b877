//! `fleetyard validate`: is a plan valid, and what does it cost?

use std::fmt::Write as _;

use std::sync::Arc;

use fleetyard_bench::number;
use fleetyard_check::{PathRule, Verdict, metrics, validate_paths};
use fleetyard_core::formats::{
    AnyPlan, TRANSPOSED_HINT, grid_size, load_any_plan, looks_transposed,
};
use fleetyard_core::{Digest, InputError, load_map, load_scen};
use serde::Serialize;

use super::validate_plane as plane;
use crate::args::{Format, Validate};
use crate::exit::{Exit, Failure, Result};
use crate::output;

/// How many violations are listed: as many as people read, or programs may be after.
pub(super) fn listed(arguments: &Validate) -> usize {
    match (arguments.all, arguments.format) {
        (true, _) => 1_000_000,
        (false, Format::Text) => 20,
        (false, Format::Json) => 100,
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
    let grid = arguments.map.as_deref().map(load_map).transpose()?;
    let grid = grid.map(Arc::new);
    let size = grid.as_deref().map(grid_size);
    let plan = load_any_plan(&arguments.plan, arguments.from, size)?;
    let scenario = arguments.scen.as_deref().map(load_scen).transpose()?;
    let instance = |agents| match (&scenario, &grid) {
        (Some(scenario), Some(grid)) => {
            let agents = arguments.agents.unwrap_or(agents);
            let instance = scenario.instance(grid.clone(), agents, arguments.connectivity)?;
            Ok(Some(instance))
        }
        _ => Ok::<_, InputError>(None),
    };
    let file = match plan {
        plan if arguments.radius.is_some() || arguments.fleet.is_some() => {
            return plane::validate(arguments, grid.as_deref(), plan, instance);
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
    let instance = instance(file.plan.agents())?;
    // The command line asks for both where it asks for no robots.
    let Some(instance) = instance else {
        return Err(
            Failure::new(Exit::Usage, "a plan on a grid needs a map and a scenario")
                .hint("name them with --map FILE and --scen FILE"),
        );
    };
    let size = grid_size(instance.grid());
    let rule = PathRule::from(arguments.path_rule);
    if !rule.allows_agents(instance.agents()) {
        return Err(one_agent(rule, instance.agents()));
    }
    file.check_for(&instance)?;
    let figures = metrics(&instance, &file.plan, arguments.cell_size);
    let report = Report {
        verdict: validate_paths(&instance, &file.plan, rule, listed(arguments)),
        metrics: Figures {
            soc_steps: figures.sum_of_costs,
            makespan_steps: figures.makespan,
            lower_bound_steps: figures.lower_bound_steps,
            length_cells: figures.length_cells,
            length_m: figures.length_m,
            waits: figures.waits,
        },
        instance_digest: instance.digest(),
        plan_digest: file.plan.digest(),
    };
    match arguments.format {
        Format::Json => output::print_json(&report)?,
        Format::Text => output::print(&text(&report, rule))?,
    }
    if !report.verdict.valid && looks_transposed(size, instance.starts(), &file.plan) {
        output::hint(TRANSPOSED_HINT);
    }
    Ok(if report.verdict.valid {
        Exit::Success
    } else {
        Exit::InvalidPlan
    })
}

fn text(report: &Report, rule: PathRule) -> String {
    let Report {
        verdict, metrics, ..
    } = report;
    let mut out = String::new();
    // Writing to a string cannot fail.
    if verdict.valid {
        let _ = writeln!(out, "valid");
    } else {
        let _ = writeln!(out, "INVALID: {} violations", verdict.violation_count);
        for violation in &verdict.violations {
            let _ = writeln!(out, "  {}: {}", violation.rule.name(), violation.sentence);
        }
        let unlisted = verdict
            .violation_count
            .saturating_sub(verdict.violations.len() as u64);
        if unlisted > 0 {
            let _ = writeln!(out, "  … and {unlisted} more; --all lists them");
        }
    }
    let Figures {
        soc_steps,
        makespan_steps,
        lower_bound_steps,
        length_cells,
        length_m,
        ..
    } = metrics;
    // Paths in straight lines have no steps.
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

/// Why paths without times are refused.
pub(super) fn one_agent(rule: PathRule, agents: usize) -> Failure {
    let message = format!("--path-rule {rule} is for one agent, not for {agents}");
    Failure::new(Exit::Usage, message)
        .hint("such paths have no times, so that nobody can say who meets whom")
}
