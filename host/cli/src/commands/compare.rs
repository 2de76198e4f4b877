//! `fleetyard compare`: several planners on the same instances.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use fleetyard_bench::claims::{self, Claim, signed};
use fleetyard_bench::statistics::{mean, median, sorted};
use fleetyard_bench::{
    Estimate, GivenOptions, Host, Plugin, Record, Robots, Trial, TrialError, in_turn, number,
};
use fleetyard_core::{Grid, GridInstance, find_map, load_map, load_scen};
use fleetyard_runtime::Fault;
use fleetyard_sim::{NoTrace, SimConfig};
use serde::Serialize;

use super::file_name;
use crate::args::{Compare, Format};
use crate::exit::{Exit, Failure, Result};
use crate::output;
use crate::setup::{find_planner, host, sim_config};

/// One line of the table. Means and medians are over the trials that succeeded; how
/// many did stands beside them.
#[derive(Debug, Serialize)]
struct Row {
    map: String,
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
    /// Limits that were only watched, not enforced.
    limits_watched: BTreeSet<String>,
    /// Why trials may not be compared with others.
    unranked: BTreeSet<String>,
    /// How the trials that failed ended.
    failures: Vec<String>,
}

/// A trial that was to be, and could not begin: the planner had started before the
/// first trial, and then it did not.
#[derive(Debug, Serialize)]
struct Missed {
    planner: String,
    map: String,
    scenario: String,
    agents: usize,
    reason: String,
}

/// A claim that is not what was found.
#[derive(Debug, Serialize)]
struct Disagreement {
    planner: String,
    map: String,
    scenario: String,
    agents: usize,
    #[serde(flatten)]
    claim: Claim,
    difference: Option<f64>,
}

/// What became of all claims.
#[derive(Debug, Default, Serialize)]
struct Claims {
    agree: usize,
    /// Nothing was found that they could be held against.
    unchecked: usize,
    disagree: Vec<Disagreement>,
}

#[derive(Serialize)]
struct Report {
    rows: Vec<Row>,
    claims: Claims,
    missed: Vec<Missed>,
    trials: Vec<Record>,
}

/// What all planners are asked.
struct Asked {
    agents: usize,
    scenario: String,
    instance: GridInstance,
}

impl Asked {
    fn map(&self) -> &str {
        self.instance.grid().name()
    }
}

pub(crate) fn compare(arguments: &Compare) -> Result<Exit> {
    let instances = instances(arguments)?;
    let maps = arguments.map.iter().filter(|map| map.is_file());
    let hidden = arguments.scen.iter().chain(maps).cloned().collect();
    let host = host(&arguments.budget, None, hidden)?;
    let config = sim_config(&arguments.world);
    let asked = &arguments.planners.0;
    let planners: Vec<Plugin> = asked
        .iter()
        .map(|asked| {
            let options = GivenOptions::Texts(asked.options.clone());
            Ok(find_planner(&host.runtime, &asked.plugin)?.with_options(options))
        })
        .collect::<Result<_>>()?;
    let labels: Vec<String> = planners
        .iter()
        .zip(asked)
        .map(|(planner, asked)| {
            let name = std::iter::once(planner.name.as_str());
            let words: Vec<&str> = name
                .chain(asked.options.iter().map(String::as_str))
                .collect();
            words.join(" ")
        })
        .collect();
    let ask = Ask {
        host: &host,
        planners: &planners,
        config: &config,
        arguments,
    };
    if let Some(first) = instances.first() {
        // Before budgets are spent, not after the first hour.
        for which in 0..planners.len() {
            ask.trial(which, first).check()?;
        }
    }
    let bar = output::trials((instances.len() * planners.len()) as u64);
    let mut estimate = Estimate::new(host.longest());
    for _ in &instances {
        (0..planners.len()).for_each(|which| estimate.expect(which));
    }
    let mut trials: Vec<(usize, Record)> = Vec::new();
    let mut missed: Vec<Missed> = Vec::new();
    for (number, asked) in instances.iter().enumerate() {
        let of_instance = trials.len();
        for which in in_turn(number, planners.len()) {
            let what = format!(
                "{} on {} with {} agents",
                labels[which], asked.scenario, asked.agents
            );
            bar.set_message(output::with_left(estimate.left(), &what));
            let started = Instant::now();
            let outcome = ask.trial(which, asked).run(&mut NoTrace);
            // A file of the planner that is gone meanwhile is its affair, and not the command's.
            let is_its_file = matches!(&outcome, Err(TrialError::Fault(Fault::File { .. })));
            let failed = match outcome.map_err(Failure::from) {
                Ok(outcome) => {
                    let fault = outcome.record.fault.clone();
                    trials.push((which, outcome.record));
                    fault
                }
                Err(failure) if failure.exit == Exit::Plugin || is_its_file => {
                    missed.push(Missed {
                        planner: labels[which].clone(),
                        map: asked.map().to_owned(),
                        scenario: asked.scenario.clone(),
                        agents: asked.agents,
                        reason: failure.message.clone(),
                    });
                    Some(failure.message)
                }
                Err(failure) => return Err(failure),
            };
            if let Some(fault) = failed {
                bar.suspend(|| output::warning(&format!("{what}: {fault}")));
            }
            estimate.ended(which, started.elapsed());
            bar.inc(1);
        }
        // Told in the order in which planners were named, whoever was asked first.
        trials[of_instance..].sort_by_key(|(which, _)| *which);
    }
    bar.finish_and_clear();
    let mut named: Vec<(&str, &mut Record)> = trials
        .iter_mut()
        .map(|(which, record)| (labels[*which].as_str(), record))
        .collect();
    claims::confront(&mut named);
    let claims = gather(&labels, &trials);
    let rows = rows(&instances, &labels, &trials, &missed);
    let solved_all = rows.iter().all(|row| row.solved == row.trials);
    let each = |of: fn(&Row) -> &BTreeSet<String>| -> Option<String> {
        let texts: BTreeSet<&String> = rows.iter().flat_map(of).collect();
        let texts: Vec<&str> = texts.into_iter().map(String::as_str).collect();
        (!texts.is_empty()).then(|| texts.join(", "))
    };
    let unranked = each(|row| &row.unranked);
    let watched = each(|row| &row.limits_watched);
    match arguments.format {
        Format::Text => {
            let text = format!("{}\n\n{}", table(&rows), claims.text());
            output::print(&output::plain(&text))?;
        }
        Format::Json => {
            let trials = trials.into_iter().map(|(_, record)| record).collect();
            output::print_json(&Report {
                rows,
                claims,
                missed,
                trials,
            })?;
        }
    }
    if let Some(reasons) = unranked {
        output::warning(&format!("trials may not be compared: {reasons}"));
    }
    if let Some(limits) = watched {
        output::note(&format!(
            "this machine only watches limits, and does not enforce them: {limits}; \
             `fleetyard doctor` says why"
        ));
    }
    Ok(if solved_all {
        Exit::Success
    } else {
        Exit::NoPlan
    })
}

/// What all trials have in common.
struct Ask<'a> {
    host: &'a Host,
    planners: &'a [Plugin],
    config: &'a SimConfig,
    arguments: &'a Compare,
}

impl<'a> Ask<'a> {
    fn trial(&self, which: usize, asked: &'a Asked) -> Trial<'a> {
        Trial {
            host: self.host,
            planner: &self.planners[which],
            instance: &asked.instance,
            scenario: &asked.scenario,
            path_rule: self.arguments.path_rule.into(),
            seed: self.arguments.budget.seed,
            config: self.config,
            robots: (!self.arguments.no_execute).then_some(&Robots::Pebbles),
        }
    }
}

/// Every instance, scenario by scenario.
fn instances(arguments: &Compare) -> Result<Vec<Asked>> {
    let mut grids: BTreeMap<PathBuf, Arc<Grid>> = BTreeMap::new();
    let mut instances = Vec::new();
    for file in &arguments.scen {
        let scenario = load_scen(file)?;
        let name = scenario.map_name().unwrap_or_default();
        let map = find_map(name, file, &arguments.map, "--map")?;
        let grid = if let Some(grid) = grids.get(&map) {
            Arc::clone(grid)
        } else {
            let grid = Arc::new(load_map(&map)?);
            grids.insert(map, Arc::clone(&grid));
            grid
        };
        for agents in &arguments.agents {
            let instance = scenario.instance(Arc::clone(&grid), *agents, arguments.connectivity)?;
            instances.push(Asked {
                agents: *agents,
                scenario: file_name(file),
                instance,
            });
        }
    }
    Ok(instances)
}

/// A line for every map, team size and planner, in the order in which they were given.
fn rows(
    instances: &[Asked],
    labels: &[String],
    trials: &[(usize, Record)],
    missed: &[Missed],
) -> Vec<Row> {
    let mut groups: Vec<(&str, usize)> = Vec::new();
    let mut maps: Vec<&str> = Vec::new();
    for asked in instances {
        if !maps.contains(&asked.map()) {
            maps.push(asked.map());
        }
    }
    for map in maps {
        for asked in instances.iter().filter(|asked| asked.map() == map) {
            if !groups.contains(&(map, asked.agents)) {
                groups.push((map, asked.agents));
            }
        }
    }
    let mut rows = Vec::new();
    for (map, agents) in groups {
        for (which, label) in labels.iter().enumerate() {
            let mine = trials.iter().filter(|(by, record)| {
                let instance = &record.instance;
                *by == which && instance.agents == agents && instance.map == map
            });
            let lost = missed
                .iter()
                .filter(|lost| lost.planner == *label && lost.agents == agents && lost.map == map);
            let records: Vec<&Record> = mine.map(|(_, record)| record).collect();
            rows.push(row(map, agents, label, &records, lost.count()));
        }
    }
    rows
}

fn row(map: &str, agents: usize, planner: &str, records: &[&Record], missed: usize) -> Row {
    let solved: Vec<&&Record> = records.iter().filter(|record| record.succeeded()).collect();
    let values = |value: &dyn Fn(&Record) -> Option<f64>| -> Vec<f64> {
        solved.iter().filter_map(|record| value(record)).collect()
    };
    let median_of = |value: &dyn Fn(&Record) -> Option<f64>| median(&sorted(values(value)));
    let mut failures: Vec<String> = records
        .iter()
        .filter_map(|record| record.failure())
        .chain(std::iter::repeat_n("not-started".to_owned(), missed))
        .collect();
    failures.sort();
    Row {
        map: map.to_owned(),
        agents,
        planner: planner.to_owned(),
        trials: records.len() + missed,
        solved: solved.len(),
        soc_steps_mean: mean(&values(&|r| r.metrics.soc_steps.map(|soc| soc as f64))),
        suboptimality_mean: mean(&values(&|r| r.metrics.suboptimality)),
        makespan_steps_mean: mean(&values(&|r| r.metrics.makespan_steps.map(|m| m as f64))),
        first_solution_ms_median: median_of(&|r| r.metrics.first_solution_ms),
        planning_time_ms_median: median_of(&|r| Some(r.metrics.planning_time_ms)),
        rtf_median: median_of(&|r| r.execution.as_ref().map(|execution| execution.figures.rtf)),
        contacts: solved
            .iter()
            .filter_map(|record| record.execution.as_ref())
            .map(|execution| execution.figures.contacts)
            .reduce(|a, b| a + b),
        contended: records
            .iter()
            .filter(|record| !record.measurement.contended.is_empty())
            .count(),
        limits_watched: records
            .iter()
            .filter_map(|record| record.sandbox.as_ref())
            .flat_map(fleetyard_runtime::SandboxReport::watched)
            .map(|state| state.limit.to_string())
            .collect(),
        unranked: records
            .iter()
            .filter_map(|record| record.planner.unranked.clone())
            .collect(),
        failures,
    }
}

fn gather(labels: &[String], trials: &[(usize, Record)]) -> Claims {
    let mut gathered = Claims::default();
    for (which, record) in trials {
        for claim in &record.claims {
            match claim.agrees {
                Some(true) => gathered.agree += 1,
                None => gathered.unchecked += 1,
                Some(false) => gathered.disagree.push(Disagreement {
                    planner: labels[*which].clone(),
                    map: record.instance.map.clone(),
                    scenario: record.instance.scenario.clone(),
                    agents: record.instance.agents,
                    difference: claim.difference(),
                    claim: claim.clone(),
                }),
            }
        }
    }
    gathered
}

impl Claims {
    fn text(&self) -> String {
        let checked = self.agree + self.disagree.len();
        if checked == 0 {
            return format!("claims: none of {} could be checked", self.unchecked);
        }
        let unchecked = match self.unchecked {
            0 => String::new(),
            unchecked => format!("; {unchecked} could not be checked"),
        };
        if self.disagree.is_empty() {
            return format!("claims: all {checked} agree with what was found{unchecked}");
        }
        let header = [
            "planner",
            "scenario",
            "agents",
            "claim",
            "claimed",
            "found",
            "difference",
        ];
        let lines = self.disagree.iter().map(|disagreement| {
            let claim = &disagreement.claim;
            let found = claim.found.as_ref();
            vec![
                disagreement.planner.clone(),
                disagreement.scenario.clone(),
                disagreement.agents.to_string(),
                claim.what.to_string(),
                claim.claimed.to_string(),
                found.map_or("-".into(), ToString::to_string),
                disagreement.difference.map_or(String::new(), signed),
            ]
        });
        format!(
            "claims: {} of {checked} disagree with what was found{unchecked}\n{}",
            self.disagree.len(),
            output::table(&header, lines.collect(), &[2, 6])
        )
    }
}

fn table(rows: &[Row]) -> String {
    let header = [
        "map",
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
            row.map.clone(),
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
            counted(&row.failures),
        ]
    });
    output::table(&header, lines.collect(), &[1, 3, 4, 5, 6, 7, 8, 9, 10, 11])
}

/// Each of the sorted words once, with how often it is there.
fn counted(words: &[String]) -> String {
    let groups = words.chunk_by(|a, b| a == b);
    let groups: Vec<String> = groups
        .map(|group| match group {
            [only] => only.clone(),
            _ => format!("{} ×{}", group[0], group.len()),
        })
        .collect();
    groups.join(", ")
}
