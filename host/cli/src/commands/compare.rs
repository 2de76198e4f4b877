//! `fleetyard compare`: several planners on the same instances.

use std::cell::Cell;
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::sync::Arc;

use clap::error::ErrorKind;
use clap::{Arg, ArgAction, ArgMatches, Args, FromArgMatches};
use fleetyard_bench::claims::{self, Claim, signed};
use fleetyard_bench::evaluate::{Dimension, Planner, PlannerSummary, Trials, groups};
use fleetyard_bench::suite::{Suite, SuiteInstance};
use fleetyard_bench::{
    BenchError, Experiment, GivenOptions, Host, Plugin, Record, Robots, Row, Shard, number, run,
};
use fleetyard_check::PathRule;
use fleetyard_core::{Grid, find_map, load_scen};
use serde::Serialize;

use super::compare_task::{self, TaskViews};
use crate::args::{
    BudgetArgs, EXECUTION, Format, INSTANCE, MapNameArgs, PLANNER, PluginArg, WorldArgs, word,
};
use crate::exit::{Exit, Failure, Result};
use crate::output;
use crate::setup::{find_planner, host, sim_config};

/// Run several planners on the same instances and show who did better.
#[derive(Debug, Args)]
pub(crate) struct Compare {
    /// MovingAI scenario files, of one map or of several
    #[arg(long, short, help_heading = INSTANCE, value_name = "FILE", group = "cells", required_unless_present = "task", num_args = 1..)]
    scen: Vec<PathBuf>,
    /// Maps that the scenarios name: map files, or folders with NAME.map [default: the folder of
    /// each scenario]
    #[arg(long, short, help_heading = INSTANCE, value_name = "PATH", num_args = 1..)]
    map: Vec<PathBuf>,
    #[command(flatten)]
    map_name: MapNameArgs,
    /// Team sizes
    #[arg(long, short = 'n', help_heading = INSTANCE, value_name = "N,…", required_unless_present = "task", value_delimiter = ',')]
    agents: Vec<usize>,
    /// Rule for the motion between two cells of a path
    #[arg(long, help_heading = INSTANCE, value_parser = word::<PathRule>(), default_value_t)]
    path_rule: PathRule,
    #[command(flatten)]
    pub(super) views: TaskViews,
    #[command(flatten)]
    planners: PlannerArgs,
    #[command(flatten)]
    pub(super) budget: BudgetArgs,
    #[command(flatten)]
    pub(super) world: WorldArgs,
    /// Do not execute the plans: no real-time factor, no contacts
    #[arg(long, help_heading = EXECUTION)]
    pub(super) no_execute: bool,
    #[command(flatten)]
    pub(super) format: Format,
}

impl Compare {
    /// The planners with their options, and the suite of them without instances.
    pub(super) fn parts(&self, host: &Host) -> Result<(Vec<Plugin>, Suite)> {
        let asked = &self.planners.0;
        let planners: Vec<Plugin> = asked
            .iter()
            .map(|asked| {
                let options = GivenOptions::Texts(asked.options.clone());
                Ok(find_planner(&host.runtime, &asked.plugin)?.with_options(options))
            })
            .collect::<Result<_>>()?;
        let labels = planners.iter().zip(asked).map(|(planner, asked)| {
            let options = asked.options.iter().map(String::as_str);
            let words: Vec<&str> = std::iter::once(&*planner.name).chain(options).collect();
            words.join(" ")
        });
        let mut suite = Suite::in_memory("comparison", labels);
        suite.protocol.path_rule = self.path_rule;
        suite.protocol.seeds = vec![self.budget.seed];
        suite.config = sim_config(&self.world);
        suite.robots = (!self.no_execute).then_some(Robots::Pebbles);
        Ok((planners, suite))
    }
}

/// Every `--planner PLUGIN [NAME=VALUE]…`, in order. The parser's derive keeps no
/// occurrences apart.
#[derive(Debug)]
struct PlannerArgs(Vec<PluginArg>);

impl PlannerArgs {
    const ID: &str = "planner";
}

impl FromArgMatches for PlannerArgs {
    fn from_arg_matches(matches: &ArgMatches) -> std::result::Result<Self, clap::Error> {
        let given = matches.get_occurrences::<String>(Self::ID);
        let mut planners = Vec::new();
        for words in given.into_iter().flatten() {
            let words: Vec<String> = words.cloned().collect();
            let planner = PluginArg::new(&words, &[]).map_err(|failure| {
                let hint = failure.hint.unwrap_or_default();
                let message = format!("{}\n\n  tip: {hint}\n", failure.message);
                clap::Error::raw(ErrorKind::ValueValidation, message)
            })?;
            planners.push(planner);
        }
        Ok(Self(planners))
    }

    fn update_from_arg_matches(
        &mut self,
        matches: &ArgMatches,
    ) -> std::result::Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

impl Args for PlannerArgs {
    fn augment_args(command: clap::Command) -> clap::Command {
        command.arg(
            Arg::new(Self::ID)
                .long(Self::ID)
                .short('p')
                .help_heading(PLANNER)
                .value_names(["PLUGIN", "NAME=VALUE"])
                .num_args(1..)
                .action(ArgAction::Append)
                .required(true)
                .help(
                    "A planner, by identifier or path, and its options; may be given several times",
                ),
        )
    }

    fn augment_args_for_update(command: clap::Command) -> clap::Command {
        Self::augment_args(command)
    }
}

/// One line of the table. Means and medians are over the trials that succeeded; how
/// many did stands beside them.
#[derive(Debug, Serialize)]
struct Line {
    map: String,
    agents: u64,
    planner: String,
    trials: usize,
    solved: usize,
    soc_steps_mean: Option<f64>,
    suboptimality_mean: Option<f64>,
    makespan_steps_mean: Option<f64>,
    first_solution_ms_median: Option<f64>,
    planning_time_ms_median: Option<f64>,
    prepare_time_ms_median: Option<f64>,
    rtf_median: Option<f64>,
    contacts: Option<u64>,
    /// Trials whose times cannot be compared, because others were busy.
    contended: usize,
    /// Limits that were only watched, not enforced.
    limits_watched: BTreeSet<String>,
    /// Devices that it was granted.
    #[serde(skip_serializing_if = "BTreeSet::is_empty")]
    devices: BTreeSet<String>,
    /// Reasons why trials may not be compared with others.
    unranked: BTreeSet<String>,
    /// Reasons of the trials that failed.
    failures: Vec<String>,
}

/// A trial that was to be, and could not begin: the planner had started before the
/// first trial, and then it did not.
#[derive(Debug, Serialize)]
struct Missed {
    planner: String,
    map: String,
    scenario: String,
    agents: u64,
    reason: String,
}

/// A claim that is not what was found.
#[derive(Debug, Serialize)]
struct Disagreement {
    planner: String,
    map: String,
    scenario: String,
    agents: u64,
    #[serde(flatten)]
    claim: Claim,
    difference: Option<f64>,
}

/// Results of checking all claims.
#[derive(Debug, Default, Serialize)]
struct Claims {
    agree: usize,
    /// Nothing was found that they could be held against.
    unchecked: usize,
    disagree: Vec<Disagreement>,
}

#[derive(Serialize)]
struct Report {
    rows: Vec<Line>,
    claims: Claims,
    missed: Vec<Missed>,
    trials: Vec<Record>,
}

pub(crate) fn compare(arguments: &Compare) -> Result<Exit> {
    if let Some(task) = &arguments.views.task {
        return compare_task::compare(arguments, task);
    }
    let (instances, maps) = instances(arguments)?;
    let hidden = arguments.scen.iter().cloned().chain(maps).collect();
    let host = host(&arguments.budget, None, hidden)?;
    let (planners, suite) = arguments.parts(&host)?;
    let mut experiment =
        Experiment::of_parts(&suite, host, planners, instances).map_err(named_by_the_user)?;
    if let Some(first) = experiment.instances().first() {
        // Before budgets are spent, not after the first hour.
        experiment.check_capabilities(first)?;
    }
    let (rows, mut records) = trials(&mut experiment)?;
    let mut named: Vec<(&str, &mut Record)> = records
        .iter_mut()
        .map(|(trial, record)| (rows[trial].planner.as_str(), record))
        .collect();
    claims::confront(&mut named);
    let claims = gather(&rows, &records);
    let missed = rows
        .iter()
        .filter(|(trial, _)| !records.contains_key(trial));
    let missed = missed.map(|(_, row)| Missed {
        planner: row.planner.clone(),
        map: row.map.clone(),
        scenario: row.scenario.clone(),
        agents: row.agents,
        reason: row.fault.clone().unwrap_or_default(),
    });
    let missed = missed.collect();
    let lines = lines(rows.values());
    let solved_all = lines.iter().all(|line| line.solved == line.trials);
    let each = |of: fn(&Line) -> &BTreeSet<String>| -> Option<String> {
        let texts: BTreeSet<&String> = lines.iter().flat_map(of).collect();
        let texts: Vec<&str> = texts.into_iter().map(String::as_str).collect();
        (!texts.is_empty()).then(|| texts.join(", "))
    };
    let contended: usize = lines.iter().map(|line| line.contended).sum();
    let unranked = each(|line| &line.unranked);
    let watched = each(|line| &line.limits_watched);
    let devices = each(|line| &line.devices);
    match arguments.format {
        Format::Text => {
            let text = format!("{}\n\n{}", table(&lines), claims.text());
            output::print(&output::plain(&text))?;
        }
        Format::Json => output::print_json(&Report {
            rows: lines,
            claims,
            missed,
            trials: records.into_values().collect(),
        })?,
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
    if let Some(devices) = devices {
        output::note(&format!(
            "planners were granted devices, whose time and memory are not counted: {devices}"
        ));
    }
    if contended > 0 {
        output::note(&format!(
            "others used the machine in {contended} trials, whose times cannot be compared; end what \
             else computes here and compare again, or let `fleetyard bench --retry-contended 3` make \
             such trials again"
        ));
    }
    Ok(if solved_all {
        Exit::Success
    } else {
        Exit::NoPlan
    })
}

/// A fault of a planner as one of the command line, which named it, and of no suite.
pub(super) fn named_by_the_user(error: BenchError) -> Failure {
    match error {
        BenchError::Plugin { error, .. } => (*error).into(),
        error => error.into(),
    }
}

/// Makes all trials: their rows by number, and the records of those whose planners were asked.
pub(super) fn trials(
    experiment: &mut Experiment<'_>,
) -> Result<(BTreeMap<u64, Row>, BTreeMap<u64, Record>)> {
    let (schedule, longest) = (experiment.schedule().clone(), experiment.longest());
    let bar = output::trials(schedule.len());
    let left = Cell::new(None);
    let (mut rows, mut records) = (BTreeMap::new(), BTreeMap::new());
    run(
        &schedule,
        Shard::ALL,
        &BTreeSet::new(),
        longest,
        0,
        &mut |planned| {
            let label = &experiment.planners()[planned.planner].label;
            let what = format!("{label} on {}", experiment.instances()[planned.instance]);
            bar.set_message(output::with_left(left.get(), &what));
            let (row, record) = experiment.trial_in_full(planned)?;
            records.extend(record.map(|record| (planned.number, record)));
            Ok(row)
        },
        &mut |row, progress| {
            left.set(progress.left);
            bar.set_position(progress.done);
            if let Some(fault) = &row.fault {
                let (planner, scenario) = (&row.planner, &row.scenario);
                let what = format!("{planner} on {scenario} with {} agents", row.agents);
                bar.suspend(|| output::warning(&format!("{what}: {fault}")));
            }
            rows.insert(row.trial, row);
            Ok(())
        },
    )?;
    bar.finish_and_clear();
    Ok((rows, records))
}

/// Every instance, scenario by scenario, and the files of their maps.
fn instances(arguments: &Compare) -> Result<(Vec<SuiteInstance>, Vec<PathBuf>)> {
    let mut grids: BTreeMap<PathBuf, Arc<Grid>> = BTreeMap::new();
    let mut instances = Vec::new();
    for file in &arguments.scen {
        let scenario = load_scen(file)?;
        let name = scenario.map_name().unwrap_or_default();
        let map = find_map(name, file, &arguments.map, "--map")?;
        let grid = if let Some(grid) = grids.get(&map) {
            Arc::clone(grid)
        } else {
            let grid = Arc::new(arguments.map_name.load(&map)?);
            grids.insert(map, Arc::clone(&grid));
            grid
        };
        for agents in &arguments.agents {
            let instance = scenario.instance(
                Arc::clone(&grid),
                *agents,
                arguments.views.grid.connectivity,
            )?;
            instances.push(SuiteInstance::of_file(file, instance));
        }
        MapNameArgs::warn(scenario.check_name(&grid));
    }
    Ok((instances, grids.into_keys().collect()))
}

/// A line for every map, team size and planner, in the order in which they were given.
fn lines<'r>(rows: impl Iterator<Item = &'r Row>) -> Vec<Line> {
    let mut maps: BTreeMap<&str, u64> = BTreeMap::new();
    let rows = rows.inspect(|row| {
        maps.entry(&row.map).or_insert(row.trial);
    });
    let mut groups = groups(rows, &[Dimension::Map, Dimension::Agents]);
    groups.sort_by_key(|group| {
        let first = group.rows.first();
        first.map(|row| (maps[row.map.as_str()], row.trial))
    });
    let mut lines = Vec::new();
    for group in groups {
        let trials = Trials::new(group.rows);
        let shared = trials.shared();
        lines.extend(
            trials
                .planners()
                .iter()
                .map(|planner| line(planner, &shared)),
        );
    }
    lines
}

fn line(planner: &Planner<'_>, shared: &[usize]) -> Line {
    let summary = PlannerSummary::of(planner, shared);
    let mean = |column| summary.column(column).map(|values| values.mean);
    let median = |column| summary.column(column).map(|values| values.median);
    let solved = || planner.rows().filter(|row| row.success);
    let reasons = summary.reasons.iter();
    let reasons = reasons.flat_map(|found| std::iter::repeat_n(&found.reason, found.trials));
    let first = planner.rows().next();
    Line {
        map: first.map(|row| row.map.clone()).unwrap_or_default(),
        agents: first.map_or(0, |row| row.agents),
        planner: summary.planner.clone(),
        trials: summary.trials,
        solved: solved().count(),
        soc_steps_mean: mean("soc_steps"),
        suboptimality_mean: mean("suboptimality"),
        makespan_steps_mean: mean("makespan_steps"),
        first_solution_ms_median: median("first_solution_ms"),
        planning_time_ms_median: median("planning_time_ms"),
        prepare_time_ms_median: median("prepare_time_ms"),
        rtf_median: median("rtf"),
        contacts: solved()
            .filter_map(|row| row.contacts)
            .reduce(|one, other| one + other),
        contended: summary.contended,
        limits_watched: planner
            .rows()
            .filter_map(|row| row.limits_watched.as_deref())
            .flat_map(|limits| limits.split(", "))
            .map(str::to_owned)
            .collect(),
        devices: planner
            .rows()
            .filter_map(|row| row.devices.clone())
            .collect(),
        unranked: planner
            .rows()
            .filter_map(|row| row.unranked.clone())
            .collect(),
        failures: reasons.cloned().collect(),
    }
}

fn gather(rows: &BTreeMap<u64, Row>, records: &BTreeMap<u64, Record>) -> Claims {
    let mut gathered = Claims::default();
    for (trial, record) in records {
        let row = &rows[trial];
        for claim in &record.claims {
            match claim.agrees {
                Some(true) => gathered.agree += 1,
                None => gathered.unchecked += 1,
                Some(false) => gathered.disagree.push(Disagreement {
                    planner: row.planner.clone(),
                    map: row.map.clone(),
                    scenario: row.scenario.clone(),
                    agents: row.agents,
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

fn table(lines: &[Line]) -> String {
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
        "map ms",
        "RTF",
        "contacts",
        "contended",
        "failures",
    ];
    let cell = |value: Option<f64>| value.map_or("-".to_owned(), number);
    let cells = lines.iter().map(|line| {
        vec![
            line.map.clone(),
            line.agents.to_string(),
            line.planner.clone(),
            format!("{}/{}", line.solved, line.trials),
            cell(line.soc_steps_mean),
            line.suboptimality_mean
                .map_or("-".into(), |ratio| format!("{ratio:.3}")),
            cell(line.makespan_steps_mean),
            cell(line.first_solution_ms_median),
            cell(line.planning_time_ms_median),
            cell(line.prepare_time_ms_median),
            cell(line.rtf_median),
            line.contacts
                .map_or("-".into(), |contacts| contacts.to_string()),
            line.contended.to_string(),
            counted(&line.failures),
        ]
    });
    output::table(
        &header,
        cells.collect(),
        &[1, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12],
    )
}

/// Each of the words once, with how often it is there.
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
