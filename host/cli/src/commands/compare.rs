//! `fleetyard compare`: several planners on the same instances.

use std::sync::Arc;

use fleetyard_core::{GridInstance, load_map, load_scen};
use fleetyard_sim::NoTrace;
use serde::Serialize;

use super::file_name;
use crate::args::{Compare, Format};
use crate::exit::{Exit, Result};
use crate::output;
use crate::record::{Record, number};
use crate::trial::{Candidate, Host, Trial};

/// One line of the table. Means are over the trials that succeeded; how many did
/// stands beside them.
#[derive(Debug, Serialize)]
struct Row {
    agents: usize,
    planner: String,
    trials: usize,
    solved: usize,
    soc_steps_mean: Option<f64>,
    suboptimality_mean: Option<f64>,
    makespan_steps_mean: Option<f64>,
    first_solution_ms_median: Option<f64>,
    planning_time_ms_median: Option<f64>,
    rtf_median: Option<f64>,
    contacts: Option<u64>,
    /// Trials whose times cannot be compared, because others were busy.
    contended: usize,
    /// How the trials that failed ended.
    failures: Vec<String>,
}

#[derive(Serialize)]
struct Report {
    rows: Vec<Row>,
    trials: Vec<Record>,
}

pub(crate) fn compare(arguments: &Compare) -> Result<Exit> {
    let grid = Arc::new(load_map(&arguments.map.map)?);
    let mut instances: Vec<(usize, String, GridInstance)> = Vec::new();
    for scen in &arguments.scen {
        let scenario = load_scen(scen)?;
        for agents in &arguments.agents {
            let instance =
                scenario.instance(Arc::clone(&grid), *agents, arguments.map.connectivity)?;
            instances.push((*agents, file_name(scen), instance));
        }
    }
    let host = Host::new(&arguments.budget, None)?;
    let candidates: Vec<Candidate> = arguments
        .planner
        .iter()
        .map(|name| Candidate::find(&host.runtime, name))
        .collect::<Result<_>>()?;
    let bar = output::progress((instances.len() * candidates.len()) as u64);
    let mut trials: Vec<(usize, usize, Record)> = Vec::new();
    for (number, (agents, scenario, instance)) in instances.iter().enumerate() {
        for turn in 0..candidates.len() {
            // The order rotates, so that no planner is always first.
            let which = (number + turn) % candidates.len();
            let candidate = &candidates[which];
            bar.set_message(format!("{} with {agents} agents", candidate.name));
            let trial = Trial {
                host: &host,
                candidate,
                attach: None,
                options: &[],
                instance,
                scenario: scenario.clone(),
                budget: &arguments.budget,
                world: &arguments.world,
                execute: !arguments.no_execute,
            };
            let outcome = trial.run(&mut NoTrace)?;
            if let Some(fault) = &outcome.record.fault {
                bar.suspend(|| {
                    output::warning(&format!("{} with {agents} agents: {fault}", candidate.name));
                });
            }
            trials.push((*agents, which, outcome.record));
            bar.inc(1);
        }
    }
    bar.finish_and_clear();
    let mut rows = Vec::new();
    for agents in &arguments.agents {
        for (which, candidate) in candidates.iter().enumerate() {
            let mine = trials.iter().filter(|(n, c, _)| n == agents && *c == which);
            rows.push(row(
                *agents,
                &candidate.name,
                mine.map(|(.., record)| record),
            ));
        }
    }
    let solved_all = rows.iter().all(|row| row.solved == row.trials);
    match arguments.format {
        Format::Text => output::print(&text(&rows))?,
        Format::Json => {
            let trials = trials.into_iter().map(|(.., record)| record).collect();
            output::print_json(&Report { rows, trials })?;
        }
    }
    Ok(if solved_all {
        Exit::Success
    } else {
        Exit::NoPlan
    })
}

fn row<'a>(agents: usize, planner: &str, records: impl Iterator<Item = &'a Record>) -> Row {
    let records: Vec<&Record> = records.collect();
    let solved: Vec<&&Record> = records.iter().filter(|record| record.succeeded()).collect();
    let values = |value: &dyn Fn(&Record) -> Option<f64>| -> Vec<f64> {
        solved.iter().filter_map(|record| value(record)).collect()
    };
    let mut failures: Vec<String> = records
        .iter()
        .filter(|record| !record.succeeded())
        .map(|record| match record.plan_digest {
            Some(_) if !record.verdict.valid => "invalid-plan".into(),
            _ => record.termination.to_string(),
        })
        .collect();
    failures.sort();
    Row {
        agents,
        planner: planner.to_owned(),
        trials: records.len(),
        solved: solved.len(),
        soc_steps_mean: mean(&values(&|r| r.metrics.soc_steps.map(|soc| soc as f64))),
        suboptimality_mean: mean(&values(&|r| r.metrics.suboptimality)),
        makespan_steps_mean: mean(&values(&|r| r.metrics.makespan_steps.map(|m| m as f64))),
        first_solution_ms_median: median(values(&|r| r.metrics.first_solution_ms)),
        planning_time_ms_median: median(values(&|r| Some(r.metrics.planning_time_ms))),
        rtf_median: median(values(&|r| {
            r.execution.as_ref().map(|execution| execution.rtf)
        })),
        contacts: solved
            .iter()
            .filter_map(|record| record.execution.as_ref())
            .map(|execution| execution.contacts)
            .reduce(|a, b| a + b),
        contended: records
            .iter()
            .filter(|record| !record.measurement.contended.is_empty())
            .count(),
        failures,
    }
}

fn mean(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    match values.len() {
        0 => None,
        length if length % 2 == 1 => Some(values[middle]),
        _ => Some(f64::midpoint(values[middle - 1], values[middle])),
    }
}

fn text(rows: &[Row]) -> String {
    let header = [
        "agents",
        "planner",
        "solved",
        "SoC",
        "SoC/LB",
        "makespan",
        "first ms",
        "total ms",
        "RTF",
        "contacts",
        "contended",
        "failures",
    ];
    let cell = |value: Option<f64>| value.map_or("-".to_owned(), number);
    let lines = rows.iter().map(|row| {
        vec![
            row.agents.to_string(),
            row.planner.clone(),
            format!("{}/{}", row.solved, row.trials),
            cell(row.soc_steps_mean),
            row.suboptimality_mean
                .map_or("-".into(), |ratio| format!("{ratio:.3}")),
            cell(row.makespan_steps_mean),
            cell(row.first_solution_ms_median),
            cell(row.planning_time_ms_median),
            cell(row.rtf_median),
            row.contacts
                .map_or("-".into(), |contacts| contacts.to_string()),
            row.contended.to_string(),
            row.failures.join(" "),
        ]
    });
    output::table(&header, lines.collect(), &[0, 2, 3, 4, 5, 6, 7, 8, 9, 10])
}
