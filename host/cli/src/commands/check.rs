//! `fleetyard plugins check`: the conformance kit on the command line.
//!
//! In the host's own process a plugin that crashes or hangs takes the host with it.
//! So each case of that attachment is a host of its own: this command again, for one
//! case.

use std::fmt::Write as _;
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use clap::Args;
use fleetyard_abi::{Descriptor, Kind};
use fleetyard_bench::{half_of_memory, milliseconds};
use fleetyard_conformance::{
    CASES, Case, CaseReport, Config, EXPECTED, Extent, FUZZED_FILE_LIMIT, Finding, Fuzz,
    FuzzReport, Fuzzed, GIVEN_UP, Kit, Outcome, Subject, find,
};
use fleetyard_core::{load_file, quoted};
use fleetyard_runtime::{
    Attach, Found, Limits, OptionError, PluginFile, Policy, check_options, parse_option,
};
use serde::Serialize;
use serde_json::Map;

use crate::args::{Format, GrantArgs, duration, duration_text, word};
use crate::commands::fuzz;
use crate::exit::{Exit, Failure, Result, internal};
use crate::output;
use crate::setup::{self, BUILT_IN, policy, runtime, trust};

/// Ask a plugin what the contract promises, and show where it does otherwise.
#[derive(Debug, Args)]
pub(crate) struct Check {
    /// A plugin's identifier, or the path of a library or program, of which all
    /// plugins are checked; PATH:ID picks one of several
    #[arg(required_unless_present = "list")]
    plugin: Option<String>,
    /// Run this case alone; may be given several times
    #[arg(long, value_name = "CASE")]
    only: Vec<String>,
    /// Leave this case out; may be given several times
    #[arg(long, value_name = "CASE", conflicts_with = "only")]
    skip: Vec<String>,
    /// Check plugins of this kind alone
    #[arg(long, value_parser = word::<Kind>())]
    kind: Option<Kind>,
    /// Check plugins with this identifier alone
    #[arg(long, value_name = "ID")]
    id: Option<String>,
    /// An option of the plugin in every case; may be given several times
    #[arg(long = "option", value_name = "NAME=VALUE")]
    options: Vec<String>,
    /// Attachment of the plugin [default: worker for libraries, stdio for programs]
    #[arg(long, value_parser = word::<Attach>())]
    attach: Option<Attach>,
    /// Seed of the whole run: of all instances, and of the plugin's random choices
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Ask one case again, or with --fuzz one instance, by the seed that it showed
    #[arg(long, value_name = "SEED", conflicts_with = "seed")]
    reproduce: Option<u64>,
    /// Ask random instances in place of the cases, so many or for so long, with hostile budgets and limits, and make
    /// those that fail as small as they can be
    #[arg(long, value_name = "N|DURATION", value_parser = extent, conflicts_with_all = ["only", "skip", "list", "all"])]
    fuzz: Option<Extent>,
    /// Folder in which --fuzz makes a folder for each of its findings [default: the current one]
    #[arg(long, value_name = "FOLDER", requires = "fuzz")]
    findings: Option<PathBuf>,
    /// Ask again what --fuzz has found, by the file that it wrote
    #[arg(long, value_name = "FILE",
          conflicts_with_all = ["fuzz", "reproduce", "seed", "only", "skip", "list", "all"])]
    fuzzed: Option<PathBuf>,
    /// Wall-clock budget of a call; a tenth for those who use all of it
    #[arg(long, value_name = "DURATION", value_parser = duration,
          default_value = duration_text(Config::default().budget))]
    budget: Duration,
    /// Time for which a plugin may go on after the deadline once it was told to stop
    #[arg(long, value_name = "DURATION", value_parser = duration,
          default_value = duration_text(Config::default().grace))]
    grace: Duration,
    /// Time in which a plugin has to start and be made
    #[arg(long, value_name = "DURATION", value_parser = duration,
          default_value = duration_text(Config::default().startup))]
    startup: Duration,
    #[command(flatten)]
    grants: GrantArgs,
    /// Show skipped cases and notes as well: what the plugin does not claim, and what it gave up
    #[arg(long)]
    all: bool,
    /// Show the cases and what they ask
    #[arg(long)]
    list: bool,
    #[command(flatten)]
    format: Format,
    /// Write the report of one case to a file: how the command asks a plugin in the
    /// process of a host that may be lost
    #[arg(long, value_name = "FILE", hide = true, requires = "reproduce")]
    report_to: Option<PathBuf>,
}

#[derive(Serialize)]
struct Document {
    fleetyard: &'static str,
    plugin: String,
    attach: Attach,
    seed: u64,
    budget_ms: f64,
    grace_ms: f64,
    plugins: Vec<Checked>,
    summary: Summary,
}

/// One plugin of a file; kind and so on are absent when it could not be described.
#[derive(Serialize)]
struct Checked {
    kind: Option<Kind>,
    id: Option<String>,
    version: Option<String>,
    /// Instances with a plan that it was asked, and those of them on which it gave up.
    expected_plans: usize,
    given_up: usize,
    cases: Vec<Row>,
    /// In place of the cases, random instances.
    #[serde(skip_serializing_if = "Option::is_none")]
    fuzz: Option<Fuzzing>,
}

/// A run of the fuzzer.
#[derive(Serialize)]
struct Fuzzing {
    #[serde(flatten)]
    report: FuzzReport,
    findings: Vec<FoundRow>,
}

#[derive(Serialize)]
struct FoundRow {
    #[serde(flatten)]
    finding: Finding,
    /// The file that has it, unless it came of one.
    file: Option<PathBuf>,
    /// The command that asks the same again.
    replay: Option<String>,
    /// The command that draws and asks what failed first.
    reproduce: Option<String>,
    /// The command that asks the last call alone, where `run` can.
    run: Option<String>,
}

impl FoundRow {
    /// A finding of which nothing was written.
    fn without_files(finding: &Finding) -> Self {
        Self {
            finding: finding.clone(),
            file: None,
            replay: None,
            reproduce: None,
            run: None,
        }
    }
}

#[derive(Serialize)]
struct Row {
    #[serde(flatten)]
    report: CaseReport,
    /// The command that asks the same again, where something went wrong.
    replay: Option<String>,
}

#[derive(Default, Serialize)]
struct Summary {
    passed: usize,
    failed: usize,
    crashed: usize,
    skipped: usize,
    warnings: usize,
    notes: usize,
}

impl Summary {
    fn count(&mut self, report: &CaseReport) {
        *self.of(report.outcome) += 1;
        self.warnings += report.warnings.len();
        self.notes += report.notes.len();
    }

    fn of(&mut self, outcome: Outcome) -> &mut usize {
        match outcome {
            Outcome::Passed => &mut self.passed,
            Outcome::Failed => &mut self.failed,
            Outcome::Crashed => &mut self.crashed,
            Outcome::Skipped => &mut self.skipped,
        }
    }

    fn text(&self) -> String {
        let Self {
            passed,
            failed,
            crashed,
            skipped,
            warnings,
            notes,
        } = self;
        format!(
            "{passed} passed, {failed} failed, {crashed} crashed, {skipped} skipped, {warnings} \
             warnings, {notes} notes"
        )
    }
}

pub(crate) fn check(arguments: &Check) -> Result<Exit> {
    let cases = selected(arguments)?;
    if arguments.list {
        return list(&cases, arguments.format);
    }
    let fuzzed = arguments.fuzzed.as_ref();
    let fuzzed = fuzzed.map(|path| load_file(path, FUZZED_FILE_LIMIT, Fuzzed::parse));
    let fuzzed = fuzzed.transpose()?;
    let config = Config {
        budget: arguments.budget,
        grace: arguments.grace,
        startup: arguments.startup,
    };
    let limits = Limits {
        policy: policy(
            &arguments.grants,
            arguments.report_to.iter().cloned().collect(),
        )?,
        trust: trust(&arguments.grants.trust)?,
        output_bytes: arguments.grants.output_limit,
        memory_bytes: half_of_memory(),
        ..Limits::default()
    };
    let kit = Kit::new(BUILT_IN, config, limits).map_err(internal)?;
    let name = arguments.plugin.as_deref().unwrap_or_default();
    let trust = kit.limits().trust.clone();
    let Found { file, id, .. } = setup::find(&runtime(trust)?, arguments.kind, name)?;
    let attach = attachment(&file, arguments)?;
    let is_fuzz = arguments.fuzz.is_some() || fuzzed.is_some();
    if is_fuzz && attach == Attach::InProcess {
        let message = "random instances are asked of processes of their own";
        return Err(Failure::new(Exit::Usage, message)
            .hint("leave out `--attach`: what crashes in the host's process would end the host"));
    }
    let mut run = Run {
        arguments,
        name,
        kit,
        attach,
        document: Document {
            fleetyard: env!("CARGO_PKG_VERSION"),
            plugin: name.to_owned(),
            attach,
            seed: arguments.seed,
            budget_ms: milliseconds(arguments.budget),
            grace_ms: milliseconds(arguments.grace),
            plugins: Vec::new(),
            summary: Summary::default(),
        },
    };
    let started = Instant::now();
    match run.kit.describe(&file) {
        Ok(introduction) => {
            let all = introduction.descriptors;
            let chosen = chosen(all, id.as_deref(), name, arguments)?;
            let several = chosen.len() > 1;
            // Before anything is started.
            let subjects = chosen
                .into_iter()
                .map(|descriptor| subject(&file, attach, descriptor, arguments, several))
                .collect::<Result<Vec<Subject>>>()?;
            for subject in subjects {
                run.begin(&subject)?;
                match (arguments.fuzz, &fuzzed) {
                    (Some(extent), _) => run.fuzz(&subject, extent)?,
                    (None, Some(fuzzed)) => run.fuzzed(&subject, fuzzed)?,
                    (None, None) => run.plugin(&subject, &cases)?,
                }
            }
        }
        Err(fault) => run.refused(Kit::refused(fault, arguments.seed, started.elapsed())?)?,
    }
    run.finish()
}

/// The cases that are asked for, in the order of the table.
fn selected(arguments: &Check) -> Result<Vec<&'static Case>> {
    for name in arguments.only.iter().chain(&arguments.skip) {
        find(name).map_err(|unknown| {
            let failure = Failure::new(Exit::Usage, format!("there is no case `{name}`"));
            failure.hint(match unknown.nearest {
                Some(nearest) => format!("did you mean `{nearest}`?"),
                None => "`fleetyard plugins check --list` shows them all".to_owned(),
            })
        })?;
    }
    let named = |names: &[String], case: &Case| names.iter().any(|name| name == case.name);
    let wanted = |case: &&Case| {
        (arguments.only.is_empty() || named(&arguments.only, case)) && !named(&arguments.skip, case)
    };
    let cases: Vec<&Case> = CASES.iter().filter(wanted).collect();
    if arguments.reproduce.is_some() && arguments.fuzz.is_none() && cases.len() != 1 {
        return Err(
            Failure::new(Exit::Usage, "--reproduce is the seed of one case")
                .hint("name the case, as in --only random-instances"),
        );
    }
    Ok(cases)
}

fn list(cases: &[&Case], format: Format) -> Result<Exit> {
    #[derive(Serialize)]
    struct Listed {
        case: &'static str,
        kinds: &'static [Kind],
        needs: Vec<&'static str>,
        about: &'static str,
    }
    let needs = |case: &Case| case.needs.iter().map(|needed| needed.as_str()).collect();
    if format == Format::Json {
        let listed = cases.iter().map(|case| Listed {
            case: case.name,
            kinds: case.kinds,
            needs: needs(case),
            about: case.about,
        });
        output::print_json(&listed.collect::<Vec<_>>())?;
        return Ok(Exit::Success);
    }
    let width = widest(cases);
    let lines = cases
        .iter()
        .map(|case| format!("{:width$}  {}", case.name, case.about));
    output::print(&lines.collect::<Vec<_>>().join("\n"))?;
    Ok(Exit::Success)
}

fn widest(cases: &[&Case]) -> usize {
    cases.iter().map(|case| case.name.len()).max().unwrap_or(0)
}

/// A library can be in this process as well; there is no other choice.
fn attachment(file: &PluginFile, arguments: &Check) -> Result<Attach> {
    let default = file.default_attach();
    let attach = arguments.attach.unwrap_or(default);
    if attach == default || (attach, default) == (Attach::InProcess, Attach::Worker) {
        return Ok(attach);
    }
    let (failure, hint) = if default == Attach::Worker {
        (
            "a shared library does not speak JSON over stdio by itself",
            "use `--attach worker` or `--attach in-process`",
        )
    } else {
        (
            "a program cannot be loaded as a library",
            "leave out `--attach`",
        )
    };
    Err(Failure::new(Exit::Usage, failure).hint(hint))
}

/// The plugins of a file that are asked for.
fn chosen(
    all: Vec<Descriptor>,
    id: Option<&str>,
    name: &str,
    arguments: &Check,
) -> Result<Vec<Descriptor>> {
    let known: Vec<String> = all
        .iter()
        .map(|plugin| format!("{} ({})", plugin.id, plugin.kind))
        .collect();
    let id = arguments.id.as_deref().or(id);
    let wanted = |plugin: &Descriptor| {
        id.is_none_or(|id| id == plugin.id) && arguments.kind.is_none_or(|kind| kind == plugin.kind)
    };
    let chosen: Vec<Descriptor> = all.into_iter().filter(wanted).collect();
    if !chosen.is_empty() {
        return Ok(chosen);
    }
    if known.is_empty() {
        return Err(Failure::new(Exit::Plugin, format!("{name} has no plugins")));
    }
    Err(
        Failure::new(Exit::Usage, format!("{name} has no such plugin"))
            .hint(format!("it has {}", known.join(", "))),
    )
}

/// A plugin with the options that it gets in every case.
fn subject(
    file: &PluginFile,
    attach: Attach,
    descriptor: Descriptor,
    arguments: &Check,
    several: bool,
) -> Result<Subject> {
    let read = || -> std::result::Result<_, OptionError> {
        let schema = &descriptor.options_schema;
        let mut options = Map::new();
        for text in &arguments.options {
            options.extend([parse_option(text, schema)?]);
        }
        check_options(&options, schema)?;
        Ok(options)
    };
    let options = read().map_err(|error| {
        let Descriptor { kind, id, .. } = &descriptor;
        let failure = Failure::from(error);
        if several {
            let message = format!("{kind} `{id}`: {}", failure.message);
            Failure::new(Exit::Usage, message).hint("choose one plugin with --kind and --id")
        } else {
            failure
        }
    })?;
    Ok(Subject {
        file: file.clone(),
        attach,
        descriptor,
        options,
    })
}

/// A run of the command.
struct Run<'a> {
    arguments: &'a Check,
    name: &'a str,
    kit: Kit,
    attach: Attach,
    document: Document,
}

impl Run<'_> {
    fn is_text(&self) -> bool {
        self.arguments.format == Format::Text && self.arguments.report_to.is_none()
    }

    /// The title of one plugin, and room for what is found.
    fn begin(&mut self, subject: &Subject) -> Result<()> {
        let Descriptor {
            kind, id, version, ..
        } = &subject.descriptor;
        if self.is_text() {
            if !self.document.plugins.is_empty() {
                output::print("")?;
            }
            let attach = match self.attach {
                Attach::InProcess => "in the host's process",
                Attach::Worker => "worker process",
                Attach::Stdio => "JSON over stdio",
                Attach::Command => "command adapter",
            };
            let title = format!("{id} {version} ({kind}, {attach})");
            output::print(&output::plain(&title))?;
        }
        self.document.plugins.push(Checked {
            kind: Some(*kind),
            id: Some(id.clone()),
            version: Some(version.clone()),
            expected_plans: 0,
            given_up: 0,
            cases: Vec::new(),
            fuzz: None,
        });
        Ok(())
    }

    /// All cases of one plugin.
    fn plugin(&mut self, subject: &Subject, cases: &[&'static Case]) -> Result<()> {
        let descriptor = &subject.descriptor;
        let kind = &descriptor.kind;
        // What is for another kind is worth a line only if it was asked for.
        let cases: Vec<&Case> = cases
            .iter()
            .copied()
            .filter(|case| case.kinds.contains(kind) || !self.arguments.only.is_empty())
            .collect();
        let width = widest(&cases);
        for case in cases {
            let seed = self
                .arguments
                .reproduce
                .unwrap_or_else(|| Kit::seed_of(case, *kind, self.arguments.seed));
            let report = if self.attach == Attach::InProcess && self.arguments.report_to.is_none() {
                self.elsewhere(subject, case, seed)?
            } else {
                self.kit.check(subject, case, seed)?
            };
            if let Some(path) = &self.arguments.report_to {
                let text = serde_json::to_vec(&report).map_err(internal)?;
                std::fs::write(path, text).map_err(internal)?;
            }
            let replay = matches!(report.outcome, Outcome::Failed | Outcome::Crashed)
                .then(|| command(&self.words(self.name, descriptor, &again(case, seed))));
            self.row(Row { report, replay }, width)?;
        }
        self.tell_given_up()
    }

    /// Says how often the last plugin gave up, which is a warning where it always did: nobody has seen a
    /// plan of it.
    fn tell_given_up(&mut self) -> Result<()> {
        let Some(Checked {
            expected_plans,
            given_up,
            ..
        }) = self.document.plugins.last()
        else {
            return Ok(());
        };
        if *given_up == 0 || !self.arguments.only.is_empty() {
            return Ok(());
        }
        let never = given_up == expected_plans;
        let label = if never { "warning: " } else { "" };
        let line = format!(
            "  {label}gave up on {given_up} of {expected_plans} instances that have a plan"
        );
        self.document.summary.warnings += usize::from(never);
        if self.is_text() {
            output::print(&line)?;
        }
        Ok(())
    }

    /// Random instances for one plugin.
    fn fuzz(&mut self, subject: &Subject, extent: Extent) -> Result<()> {
        let fuzz = Fuzz {
            extent,
            seed: self.arguments.seed,
            reproduce: self.arguments.reproduce,
        };
        let folder = self.arguments.findings.clone();
        let folder = folder.unwrap_or_else(|| PathBuf::from("."));
        let mut rows = Vec::new();
        let mut told = Ok(());
        let report = self.kit.fuzz(subject, &fuzz, |finding| {
            let row = self.found(subject, finding, &folder);
            let told_now = row.and_then(|row| {
                self.tell_found(&row)?;
                rows.push(row);
                Ok(())
            });
            if told.is_ok() {
                told = told_now;
            }
        })?;
        told?;
        // Those that came before any instance was asked were not told.
        for finding in report.findings.iter().skip(rows.len()) {
            let row = FoundRow::without_files(finding);
            self.tell_found(&row)?;
            rows.push(row);
        }
        self.fuzzing(report, rows)
    }

    /// A finding of a file, asked again.
    fn fuzzed(&mut self, subject: &Subject, fuzzed: &Fuzzed) -> Result<()> {
        let id = &subject.descriptor.id;
        if *id != fuzzed.plugin && self.is_text() {
            output::note(&format!("the file is of the plugin `{}`", fuzzed.plugin));
        }
        let report = self.kit.fuzzed(subject, fuzzed)?;
        let mut rows = Vec::new();
        for finding in &report.findings {
            if finding.kind != fuzzed.kind && self.is_text() {
                output::note(&format!("the file is of a failure `{}`", fuzzed.kind));
            }
            let row = FoundRow::without_files(finding);
            self.tell_found(&row)?;
            rows.push(row);
        }
        self.fuzzing(report, rows)
    }

    /// Counts what the fuzzer found, and says what it did.
    fn fuzzing(&mut self, report: FuzzReport, findings: Vec<FoundRow>) -> Result<()> {
        let summary = &mut self.document.summary;
        for row in &findings {
            *summary.of(row.finding.outcome) += 1;
        }
        if findings.is_empty() {
            let outcome = if report.instances == 0 {
                Outcome::Skipped
            } else {
                Outcome::Passed
            };
            *summary.of(outcome) += 1;
        }
        if self.is_text() {
            output::print(&fuzz_text(&report))?;
        }
        if let Some(checked) = self.document.plugins.last_mut() {
            checked.expected_plans = report.expected_plans;
            checked.given_up = report.given_up;
            checked.fuzz = Some(Fuzzing { report, findings });
        }
        Ok(())
    }

    /// Writes a finding, and gives the commands that ask it again.
    fn found(&self, subject: &Subject, finding: &Finding, folder: &Path) -> Result<FoundRow> {
        let fuzz::Written { fuzzed, run } = fuzz::write(folder, finding, subject)?;
        let words =
            |tail: &[(&str, String)]| command(&self.words(self.name, &subject.descriptor, tail));
        let run = run.map(|instance| {
            let mut words = vec!["run".to_owned()];
            words.extend(instance);
            let id = &subject.descriptor.id;
            let planner = if self.name == id || self.name.ends_with(&format!(":{id}")) {
                self.name.to_owned()
            } else {
                format!("{}:{id}", self.name)
            };
            words.extend(["--planner".to_owned(), planner]);
            for option in &self.arguments.options {
                words.extend(["--option".to_owned(), option.clone()]);
            }
            words.extend(granted(&self.arguments.grants));
            command(&words)
        });
        Ok(FoundRow {
            finding: finding.clone(),
            replay: Some(words(&[("fuzzed", fuzzed.display().to_string())])),
            reproduce: Some(words(&[
                ("fuzz", "1".to_owned()),
                ("reproduce", finding.seed.to_string()),
            ])),
            file: Some(fuzzed),
            run,
        })
    }

    fn tell_found(&self, row: &FoundRow) -> Result<()> {
        if self.is_text() {
            output::print(&output::plain(&found_text(row)))?;
        }
        Ok(())
    }

    fn refused(&mut self, report: CaseReport) -> Result<()> {
        if self.is_text() {
            output::print(&output::plain(self.name))?;
        }
        self.document.plugins.push(Checked {
            kind: None,
            id: None,
            version: None,
            expected_plans: 0,
            given_up: 0,
            cases: Vec::new(),
            fuzz: None,
        });
        let width = report.case.len();
        let replay = None;
        self.row(Row { report, replay }, width)
    }

    /// True if skipped cases and notes are worth a line each, rather than a number.
    fn shows_all(&self) -> bool {
        self.arguments.all || !self.arguments.only.is_empty()
    }

    fn row(&mut self, row: Row, width: usize) -> Result<()> {
        let is_shown = row.report.outcome != Outcome::Skipped || self.shows_all();
        if self.is_text() && is_shown {
            output::print(&output::plain(&text(&row, width, self.shows_all())))?;
        }
        self.document.summary.count(&row.report);
        if let Some(checked) = self.document.plugins.last_mut() {
            let figure = |name| {
                row.report
                    .figures
                    .get(name)
                    .map_or(0, |count| *count as usize)
            };
            checked.expected_plans += figure(EXPECTED);
            checked.given_up += figure(GIVEN_UP);
            checked.cases.push(row);
        }
        Ok(())
    }

    fn finish(self) -> Result<Exit> {
        let summary = &self.document.summary;
        let bad = summary.failed + summary.crashed > 0;
        if self.is_text() {
            let hides = summary.skipped + summary.notes > 0 && !self.shows_all();
            let more = if hides {
                "; --all shows everything"
            } else {
                ""
            };
            output::print(&format!("\n{}{more}", summary.text()))?;
        } else if self.arguments.report_to.is_none() {
            output::print_json(&self.document)?;
        }
        Ok(if bad { Exit::Plugin } else { Exit::Success })
    }

    /// Arguments that ask the same plugin as here what the last of them say.
    fn words(&self, plugin: &str, of: &Descriptor, what: &[(&str, String)]) -> Vec<String> {
        let defaults = Config::default();
        let Check {
            budget,
            grace,
            startup,
            options,
            attach,
            ..
        } = self.arguments;
        let mut words: Vec<String> = ["plugins", "check", plugin].map(str::to_owned).into();
        let mut add = |name: &str, value: String| words.extend([format!("--{name}"), value]);
        add("kind", of.kind.to_string());
        add("id", of.id.clone());
        if attach.is_some() && self.attach == Attach::InProcess {
            add("attach", "in-process".into());
        }
        for option in options {
            add("option", option.clone());
        }
        for (name, value, default) in [
            ("budget", budget, defaults.budget),
            ("grace", grace, defaults.grace),
            ("startup", startup, defaults.startup),
        ] {
            if *value != default {
                add(name, humantime::format_duration(*value).to_string());
            }
        }
        for (name, value) in what {
            add(name, value.clone());
        }
        words.extend(granted(&self.arguments.grants));
        words
    }

    /// One case in a host of its own.
    fn elsewhere(&self, subject: &Subject, case: &Case, seed: u64) -> Result<CaseReport> {
        // The longest cases make so many calls that may take all of their time.
        const CALLS: u32 = 12;
        let Check {
            budget,
            grace,
            startup,
            ..
        } = self.arguments;
        let patience = (*budget + *grace) * CALLS + *startup;
        let report = tempfile::NamedTempFile::new().map_err(internal)?;
        // A file that was found by its identifier need not be the first next time.
        let plugin = match subject.file.path() {
            Some(path) => path.display().to_string(),
            None => self.name.to_owned(),
        };
        let started = Instant::now();
        let mut child = Command::new(std::env::current_exe().map_err(internal)?)
            .args(self.words(&plugin, &subject.descriptor, &again(case, seed)))
            .arg("--report-to")
            .arg(report.path())
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .map_err(internal)?;
        let ended = loop {
            match child.try_wait().map_err(internal)? {
                Some(status) => break Some(status),
                None if started.elapsed() > patience => break None,
                None => std::thread::sleep(Duration::from_millis(2)),
            }
        };
        if ended.is_none() {
            // Gone already is as good.
            let _ = child.kill();
            let _ = child.wait();
        }
        let written = std::fs::read(report.path()).unwrap_or_default();
        if let (Some(_), Ok(report)) = (ended, serde_json::from_slice(&written)) {
            return Ok(report);
        }
        let (outcome, reason) = match ended {
            Some(status) if status.code() == Some(Exit::Internal.code()) => {
                let message = format!("the host that ran the case `{}` failed", case.name);
                return Err(Failure::new(Exit::Internal, message)
                    .hint("run it again when the machine has what was missing"));
            }
            Some(status) => (Outcome::Crashed, ending(status)),
            None => (
                Outcome::Failed,
                format!("did not come to an end within {patience:?} and was killed"),
            ),
        };
        Ok(CaseReport {
            case: case.name.into(),
            outcome,
            reason: Some(reason),
            warnings: Vec::new(),
            notes: Vec::new(),
            figures: [].into(),
            seed,
            time_ms: milliseconds(started.elapsed()),
        })
    }
}

/// Arguments that ask one case again.
fn again(case: &Case, seed: u64) -> [(&'static str, String); 2] {
    [("only", case.name.into()), ("reproduce", seed.to_string())]
}

/// A command line of this command.
fn command(words: &[String]) -> String {
    let quoted: Vec<String> = words.iter().map(|word| quoted(word)).collect();
    format!("fleetyard {}", quoted.join(" "))
}

/// The extent of a run of the fuzzer: a number of instances, or a duration.
fn extent(text: &str) -> std::result::Result<Extent, String> {
    match text.parse() {
        Ok(0) => Err("ask at least one instance".into()),
        Ok(instances) => Ok(Extent::Instances(instances)),
        Err(_) => duration(text).map(Extent::Lasting).map_err(|_| {
            "write a number of instances, such as 200, or a duration, such as 10m".to_owned()
        }),
    }
}

/// Arguments that grant the same, where it is not what everybody gets.
fn granted(grants: &GrantArgs) -> Vec<String> {
    let usual = Policy::default();
    let mut words = Vec::new();
    let mut add = |name: &str, value: String| words.extend([format!("--{name}"), value]);
    if grants.sandbox != usual.level {
        add("sandbox", grants.sandbox.to_string());
    }
    if grants.processes != usual.processes {
        add("processes", grants.processes.to_string());
    }
    if grants.disk != usual.disk_bytes {
        add("disk", format!("{}B", grants.disk));
    }
    if grants.output_limit != Limits::default().output_bytes {
        add("output-limit", format!("{}B", grants.output_limit));
    }
    for path in &grants.allow_read {
        add("allow-read", path.display().to_string());
    }
    for (name, value) in &grants.env {
        add("env", format!("{name}={value}"));
    }
    for name in &grants.allow_device {
        add("allow-device", name.clone());
    }
    if grants.allow_network {
        words.push("--allow-network".into());
    }
    words
}

fn ending(status: ExitStatus) -> String {
    match (status.signal(), status.code()) {
        (Some(signal), _) => format!("the host that ran it crashed with signal {signal}"),
        (_, code) => format!(
            "the host that ran it exited with code {}",
            code.unwrap_or_default()
        ),
    }
}

/// A case for people: a line, and more where there is more to say.
fn text(row: &Row, width: usize, with_notes: bool) -> String {
    let CaseReport {
        case,
        outcome,
        reason,
        warnings,
        notes,
        time_ms,
        ..
    } = &row.report;
    let mut text = format!("  {outcome:8}  {case:width$}");
    // Writing to a string cannot fail.
    if *outcome == Outcome::Skipped {
        let reason = reason.as_deref().unwrap_or_default();
        let _ = write!(text, "             {reason}");
        return text;
    }
    let digits = usize::from(*time_ms < 10.0);
    let _ = write!(text, "  {time_ms:>8.digits$} ms");
    let mut more = |name: &str, words: &str| lines_below(&mut text, name, words);
    if let Some(reason) = reason {
        more("", reason);
    }
    for warning in warnings {
        more("warning: ", warning);
    }
    for note in notes.iter().filter(|_| with_notes) {
        more("note: ", note);
    }
    if let Some(replay) = &row.replay {
        more("replay: ", replay);
    }
    text
}

/// Adds lines below that of a case, the first with a name.
fn lines_below(text: &mut String, name: &str, words: &str) {
    const MARGIN: usize = 12;
    for (number, line) in words.lines().enumerate() {
        let name = if number == 0 { name } else { "" };
        // Writing to a string cannot fail.
        let _ = write!(text, "\n{:MARGIN$}{name}{line}", "");
    }
}

/// A finding of the fuzzer for people.
fn found_text(row: &FoundRow) -> String {
    let Finding {
        kind,
        outcome,
        reason,
        seed,
        number,
        view,
        asked_again,
        failed_again,
        is_hurried,
        before,
        after,
        candidates,
        is_smallest,
        ..
    } = &row.finding;
    let mut text = format!("  {outcome:8}  {kind}");
    let mut more = |name: &str, words: &str| lines_below(&mut text, name, words);
    more("", reason);
    if *asked_again > 0 {
        more("", &format!("instance {number}, {view}, seed {seed}"));
    }
    if *candidates > 0 {
        let end = if *is_smallest {
            ""
        } else {
            "; it was stopped before nothing more could be left out"
        };
        more("before: ", &before.to_string());
        more("after:  ", &format!("{after}, of {candidates} tried{end}"));
    }
    if failed_again < asked_again {
        more(
            "note: ",
            &format!(
                "it does not fail every time: {failed_again} of {asked_again} times in a fresh process"
            ),
        );
    }
    if *is_hurried {
        more(
            "note: ",
            "it has a short budget: the answer may depend on the speed of this machine",
        );
    }
    for (name, words) in [
        ("replay: ", &row.replay),
        ("first:  ", &row.reproduce),
        ("run:    ", &row.run),
    ] {
        if let Some(words) = words {
            more(name, words);
        }
    }
    text
}

/// The work of the fuzzer for people.
fn fuzz_text(report: &FuzzReport) -> String {
    let FuzzReport {
        instances,
        by_view,
        calls,
        processes,
        time_ms,
        calls_per_s,
        expected_plans,
        given_up,
        unknown,
        ..
    } = report;
    let views: Vec<String> = by_view
        .iter()
        .map(|(view, count)| format!("{count} {view}"))
        .collect();
    let views = views.join(", ");
    let mut text = format!(
        "  instances: {instances} ({views}); calls: {calls} in {:.1} s, {calls_per_s:.0} a second; \
         processes: {processes}",
        time_ms / 1e3
    );
    if *expected_plans > 0 {
        let _ = write!(
            text,
            "\n  gave up on {given_up} of {expected_plans} calls that have a plan"
        );
    }
    if *unknown > 0 {
        let _ = write!(
            text,
            "\n  instances with robots or obstacles that it does not know, as it may: {unknown}"
        );
    }
    text
}
