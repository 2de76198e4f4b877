//! `fleetyard bench`: every planner of a suite on every instance, into a store.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use clap::{Args, ValueEnum};
use fleetyard_bench::evaluate::{Evaluation, PlannerSummary, SOLVE_TIME, Trials};
use fleetyard_bench::suite::Suite;
use fleetyard_bench::{
    Asked, Counts, Estimate, Experiment, Manifest, Meta, Places, Planned, Progress, Ran, Row,
    Shard, SharedStore, Step, Store, Verified, changes, now_unix_ms, rough, run, verify,
};
use fleetyard_core::document::Setting;
use fleetyard_core::{InputError, quoted, shown, write_atomically};
use fleetyard_runtime::on_interrupt;
use indicatif::ProgressBar;
use serde::Serialize;

use super::jobs::{self, Ask, ClusterArgs};
use crate::args::{Format, TrustArgs};
use crate::exit::{Exit, Failure, Result, internal};
use crate::output;
use crate::setup::{BUILT_IN, trust};

/// Parts of a suite on a cluster, unless somebody says how many.
const PARTS: u32 = 32;

/// Time between two lines about the progress of a run, where there is no terminal.
const EVERY: Duration = Duration::from_secs(10);

/// Time between two records of the progress for programs.
const FILE_EVERY: Duration = Duration::from_secs(1);

/// Number of the first steps that a dry run shows.
const SHOWN: usize = 12;

/// Most differing trials that are listed for people.
const DIFFERENCES: usize = 20;

/// Run a suite: every planner on every instance.
#[derive(Debug, Args)]
#[allow(clippy::struct_excessive_bools, reason = "a flag each")]
pub(crate) struct Bench {
    /// The suite, a TOML file
    pub(crate) suite: PathBuf,
    /// Store of the trials [default: the suite's name with .sqlite, in the current folder]
    #[arg(long, value_name = "FILE")]
    store: Option<PathBuf>,
    /// Go on with a store that has trials: make those that are missing
    #[arg(long)]
    resume: bool,
    /// Run one of N parts of the suite, such as 2/8; `fleetyard store merge` joins their stores
    #[arg(long, value_name = "I/N", default_value_t = Shard::ALL, hide_default_value = true)]
    shard: Shard,
    /// Give a key of the suite another value, such as budget.wall=1s; may be given several times
    #[arg(long = "set", value_name = "KEY=VALUE", value_parser = setting)]
    settings: Vec<Setting>,
    /// Make a trial that others disturbed again, up to K times; the last attempt counts. Instead of
    /// protocol.retry_contended of the suite
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u32).range(0..=1000))]
    retry_contended: Option<u32>,
    /// Keep the plans that count in the store. Instead of protocol.keep_plans of the suite
    #[arg(long)]
    keep_plans: bool,
    /// Say what would be run and how long it may take, and run nothing
    #[arg(long)]
    dry_run: bool,
    /// Make recorded trials again and compare plans and executions; exit code 1 if any differs
    #[arg(long, conflicts_with_all = ["dry_run", "resume"])]
    verify: bool,
    /// Number of trials to make again, spread evenly over planners and instances [default: all]
    #[arg(long, value_name = "N", requires = "verify",
          value_parser = clap::value_parser!(u64).range(1..))]
    verify_sample: Option<u64>,
    /// A file for programs that watch the run: how many trials are done, as JSON
    #[arg(long, value_name = "FILE", hide = true)]
    progress_file: Option<PathBuf>,
    /// Executor of the trials
    #[arg(long, value_enum, default_value = "local")]
    executor: Executor,
    #[command(flatten)]
    cluster: ClusterArgs,
    #[command(flatten)]
    trust: TrustArgs,
    #[command(flatten)]
    format: Format,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Executor {
    /// This machine, one trial after the other
    Local,
    /// A Slurm cluster, all parts of the suite at once
    Slurm,
}

fn setting(text: &str) -> std::result::Result<Setting, String> {
    Setting::new("--set", text).map_err(|error| match error.hint {
        Some(hint) => format!("{}: {hint}", error.reason),
        None => error.reason,
    })
}

impl Bench {
    /// Values that take the place of the suite's: an option of a key's own is one of them, so that
    /// stores, manifests and parts on a cluster have it.
    fn settings(&self) -> Result<Vec<Setting>> {
        let mut settings = self.settings.clone();
        if let Some(retries) = self.retry_contended {
            let text = format!("protocol.retry_contended={retries}");
            settings.push(Setting::new("--retry-contended", &text)?);
        }
        if self.keep_plans {
            settings.push(Setting::new("--keep-plans", "protocol.keep_plans=true")?);
        }
        Ok(settings)
    }
}

pub(crate) fn bench(arguments: &Bench) -> Result<Exit> {
    let settings = arguments.settings()?;
    let mut suite = Suite::load_with(&arguments.suite, &settings)?;
    let place = arguments
        .store
        .clone()
        .unwrap_or_else(|| PathBuf::from(format!("{}.sqlite", suite.name)));
    let hidden = &mut suite.sandbox.policy.hidden;
    hidden.extend([
        arguments.suite.clone(),
        place.clone(),
        Manifest::path(&place),
    ]);
    hidden.extend(arguments.progress_file.clone());
    match arguments.executor {
        Executor::Slurm if !arguments.dry_run => return on_cluster(arguments, &suite, &place),
        Executor::Local if arguments.cluster != ClusterArgs::default() => {
            let reason = "there are options for a cluster, and no cluster";
            return Err(Failure::new(Exit::Usage, reason).hint("add --executor slurm"));
        }
        _ => {}
    }
    if arguments.verify {
        return verification(arguments, &suite, &place);
    }
    // What stands in the way is said before any planner is started, and the store is ours
    // from here on.
    let there = match place.symlink_metadata() {
        Ok(_) if !arguments.dry_run => Some(existing(arguments, &suite, &place)?),
        _ => None,
    };
    let mut experiment = experiment(arguments, &suite)?;
    if arguments.dry_run {
        return dry_run(arguments, &experiment, &place);
    }
    let meta = meta(&experiment, &arguments.suite, there.as_ref())?;
    let begun = begin(&experiment, &meta, there, &place)?;
    let outcome = go(arguments, &mut experiment, &meta, &begun.store, &place)?;
    report(arguments, &experiment, &place, &begun, outcome)
}

/// Submits the suite in parts, each of which is this command again with its part.
fn on_cluster(arguments: &Bench, suite: &Suite, place: &Path) -> Result<Exit> {
    if arguments.resume || arguments.verify || arguments.shard != Shard::ALL {
        let reason = "--resume, --verify and --shard are for a run on this machine";
        return Err(Failure::new(Exit::Usage, reason)
            .hint("`fleetyard jobs requeue RUN` goes on with a run on a cluster"));
    }
    let mut experiment = experiment(arguments, suite)?;
    let schedule = experiment.schedule().clone();
    let longest = experiment.longest();
    experiment.finish();
    let instances = experiment.instances().len() as u32;
    let shards = arguments.cluster.shards.unwrap_or(instances.min(PARTS));
    if shards > instances {
        return Err(Failure::new(
            Exit::Usage,
            format!("a suite of {instances} instances has no {shards} parts"),
        )
        .hint("a part has all trials of its instances; use as many --shards or fewer"));
    }
    let trials = |shard| -> std::result::Result<u64, String> {
        Ok(schedule.len_of(format!("{shard}/{shards}").parse()?))
    };
    let mut passed_on = Vec::new();
    for setting in &arguments.settings()? {
        passed_on.extend(["--set".to_owned(), setting.text().to_owned()]);
    }
    if let Some(lock) = &arguments.trust.lock {
        let lock = std::path::absolute(lock).map_err(internal)?;
        passed_on.extend(["--lock".to_owned(), lock.display().to_string()]);
    }
    if arguments.trust.locked {
        passed_on.push("--locked".to_owned());
    }
    let own = suite.budget.memory_bytes.map(|plan| {
        let prepare = suite.budget.prepare_memory_bytes.unwrap_or(plan);
        plan.max(prepare)
            .saturating_add(suite.sandbox.policy.disk_bytes)
    });
    jobs::submit(
        &arguments.cluster,
        Ask {
            name: &suite.name,
            suite: &arguments.suite,
            store: place,
            arguments: passed_on,
            trials: (1..=shards)
                .map(trials)
                .collect::<std::result::Result<_, _>>()
                .map_err(internal)?,
            longest,
            threads: suite.budget.threads,
            memory: own,
        },
    )
}

fn experiment<'s>(arguments: &Bench, suite: &'s Suite) -> Result<Experiment<'s>> {
    Ok(Experiment::new(suite, BUILT_IN, trust(&arguments.trust)?)?)
}

/// A store that is there, if it may be gone on with.
fn existing(arguments: &Bench, suite: &Suite, place: &Path) -> Result<Store> {
    let store = Store::open(place)?;
    let (current, superseded) = store.counts()?;
    if current + superseded == 0 {
        return Ok(store);
    }
    let before = store.meta()?.suite;
    let refused = |reason: String, hint: &str| {
        Err(InputError::new(place.display().to_string(), reason)
            .hint(hint)
            .into())
    };
    if before != suite.name {
        let reason = format!(
            "the store belongs to the suite `{}`, and this is `{}`",
            shown(&before),
            suite.name
        );
        return refused(reason, "name another store with --store");
    }
    if !arguments.resume {
        let reason = format!("the store has {} already", trials(current + superseded));
        return refused(
            reason,
            "go on with it by --resume, or name another store with --store",
        );
    }
    Ok(store)
}

fn meta(experiment: &Experiment<'_>, suite_file: &Path, there: Option<&Store>) -> Result<Meta> {
    let suite = experiment.suite();
    Ok(Meta {
        suite: suite.name.clone(),
        suite_text: suite.text.clone(),
        suite_values: suite.normal(),
        suite_digest: experiment.schedule().digest().to_string(),
        fleetyard: env!("CARGO_PKG_VERSION").into(),
        created_unix_ms: match there {
            Some(store) => store.meta()?.created_unix_ms,
            None => now_unix_ms(),
        },
        asked: Some(experiment.schedule().len()),
        places: Places::of(experiment, Some(suite_file)),
    })
}

/// A store that is ready to be written.
struct Begun {
    store: SharedStore,
    /// Changes since the store's trials were made.
    changes: Vec<String>,
    /// Trials that are kept apart for it.
    superseded: u64,
}

fn begin(
    experiment: &Experiment<'_>,
    meta: &Meta,
    there: Option<Store>,
    place: &Path,
) -> Result<Begun> {
    let mut changed = Vec::new();
    let mut store = match there {
        None => Store::create(place, meta)?,
        Some(mut store) => {
            changed = changes(experiment, &store, meta)?;
            adopt(experiment, &mut store, meta)?;
            store
        }
    };
    let superseded = store.counts()?.1;
    for line in &changed {
        output::note(&format!("changed since the store was written: {line}"));
    }
    if superseded > 0 {
        output::note(&format!(
            "{} of an earlier state {} kept apart and {} not counted",
            trials(superseded),
            if superseded == 1 { "is" } else { "are" },
            if superseded == 1 { "is" } else { "are" },
        ));
    }
    store.add_machine(
        fleetyard_runtime::measure::Machine::here().digest(),
        &serde_json::to_string(fleetyard_runtime::measure::Machine::here()).map_err(internal)?,
    )?;
    for planner in experiment.planners() {
        store.add_code(planner.plugin.digest(), planner.plugin.code())?;
    }
    Ok(Begun {
        store: SharedStore::new(store),
        changes: changed,
        superseded,
    })
}

fn adopt(experiment: &Experiment<'_>, store: &mut Store, meta: &Meta) -> Result<()> {
    let schedule = experiment.schedule();
    let asked: Vec<(Planned, String)> = schedule
        .trials()
        .map(|planned| (planned, schedule.key(&planned)))
        .collect();
    let asked = asked.iter().map(|(planned, key)| Asked {
        key,
        trial: planned.number,
        planner: &experiment.planners()[planned.planner].label,
        view: experiment.instances()[planned.instance]
            .view()
            .map(|view| view.label.as_str()),
    });
    Ok(store.adopt(meta, asked)?)
}

/// Result of a run, and the time that it took.
struct Outcome {
    ran: Ran,
    elapsed: Duration,
}

/// Makes what is missing. An interrupt ends it here: the trial in flight is lost with its
/// planner, and everything else is kept.
fn go(
    arguments: &Bench,
    experiment: &mut Experiment<'_>,
    meta: &Meta,
    store: &SharedStore,
    place: &Path,
) -> Result<Outcome> {
    let schedule = experiment.schedule().clone();
    let shard = arguments.shard;
    let asked = schedule.len_of(shard);
    let part = (shard != Shard::ALL).then(|| shard.to_string());
    let manifest = Manifest::new(experiment, meta, place, part, now_unix_ms());
    let manifest = Arc::new(Mutex::new(manifest));
    let record = {
        let manifest = Arc::clone(&manifest);
        let place = place.to_owned();
        move |store: &Store| -> std::result::Result<u64, InputError> {
            let (stored, superseded) = store.counts()?;
            let mut manifest = manifest.lock().unwrap_or_else(PoisonError::into_inner);
            manifest.count(Counts {
                asked,
                stored,
                superseded,
            });
            manifest.write(&place)?;
            Ok(stored)
        }
    };
    store.with(|store| record(store).map(drop))?;
    interrupted(store.clone(), record.clone(), asked, resume_line(arguments));
    let started = Instant::now();
    let longest = experiment.longest();
    let mut watch = Watch::new(arguments, asked);
    let ran = run(
        &schedule,
        shard,
        &store.with(|store| store.keys())?,
        longest,
        experiment.suite().protocol.retry_contended,
        &mut |planned| experiment.trial(planned),
        &mut |row, progress| {
            store.with(|store| store.insert(&row))?;
            watch.ended(&row, progress);
            Ok(())
        },
    );
    watch.finish();
    let elapsed = started.elapsed();
    experiment.finish();
    manifest
        .lock()
        .unwrap_or_else(PoisonError::into_inner)
        .end(experiment, now_unix_ms());
    // What failed first is what matters, and a manifest that is not written then is not.
    let written = store.with(|store| record(store).map(drop));
    let ran = ran?;
    written?;
    Ok(Outcome { ran, elapsed })
}

/// Prepares for a signal that ends the process.
fn interrupted(
    store: SharedStore,
    record: impl Fn(&Store) -> std::result::Result<u64, InputError> + Send + 'static,
    asked: u64,
    resume: String,
) {
    let installed = on_interrupt(move |signal| {
        store.close(|store| {
            if let Some(store) = store {
                match record(&store) {
                    Ok(stored) => output::note(&format!(
                        "interrupted; {stored} of {} are stored",
                        trials(asked)
                    )),
                    Err(error) => output::warning(&error.to_string()),
                }
                drop(store);
                output::hint(&format!("go on with `{resume}`"));
            }
            // As a shell says it of a process that a signal has ended.
            std::process::exit(128 + signal);
        });
    });
    if let Err(error) = installed {
        output::warning(&format!("an interrupt will not be reported: {error}"));
    }
}

/// The command that goes on with a run.
fn resume_line(arguments: &Bench) -> String {
    let mut words: Vec<String> = std::env::args().collect();
    if let Some(program) = words.first_mut() {
        "fleetyard".clone_into(program);
    }
    if !arguments.resume {
        words.push("--resume".into());
    }
    let words: Vec<String> = words.iter().map(|word| quoted(word)).collect();
    words.join(" ")
}

/// Tells people and programs how far a run is.
struct Watch<'a> {
    bar: ProgressBar,
    file: Option<&'a Path>,
    said: Instant,
    told: Option<Instant>,
    /// Planners whose first fault was shown; the others are in the store.
    faulty: BTreeSet<String>,
}

/// Progress of a run, for programs.
#[derive(Serialize)]
struct Told {
    done: u64,
    trials: u64,
}

impl<'a> Watch<'a> {
    fn new(arguments: &'a Bench, total: u64) -> Self {
        Self {
            bar: output::trials(total),
            file: arguments.progress_file.as_deref(),
            said: Instant::now(),
            told: None,
            faulty: BTreeSet::new(),
        }
    }

    fn ended(&mut self, row: &Row, progress: &Progress) {
        let Progress {
            done,
            total,
            failed,
            left,
        } = progress;
        if let Some(fault) = &row.fault
            && self.faulty.insert(row.entrant().into_owned())
        {
            let text = format!("{} on {}: {fault}", row.entrant(), place_of(row));
            self.bar.suspend(|| output::warning(&text));
        }
        let said = output::with_left(*left, &format!("{failed} failed"));
        if self.bar.is_hidden() && self.said.elapsed() >= EVERY {
            self.said = Instant::now();
            output::note(&format!("{done} of {total} trials, {said}"));
        }
        self.bar.set_message(said);
        self.bar.set_position(*done);
        let due = self.told.is_none_or(|told| told.elapsed() >= FILE_EVERY);
        if due || done == total {
            self.tell(*done, *total);
        }
    }

    fn tell(&mut self, done: u64, trials: u64) {
        let Some(file) = self.file else { return };
        self.told = Some(Instant::now());
        let written = serde_json::to_vec(&Told { done, trials })
            .map_err(|error| error.to_string())
            .and_then(|text| write_atomically(file, &text).map_err(|error| error.to_string()));
        if let Err(error) = written {
            // Said once: the trials themselves do not depend on it.
            self.file = None;
            output::warning(&error);
        }
    }

    fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

fn place_of(row: &Row) -> String {
    format!("{}, {}, {} agents", row.map, row.scenario, row.agents)
}

fn trials(count: u64) -> String {
    let plural = if count == 1 { "" } else { "s" };
    format!("{count} trial{plural}")
}

/// Result of a run, as JSON.
#[derive(Serialize)]
struct Report<'a> {
    format: &'static str,
    suite: &'a str,
    store: &'a Path,
    manifest: PathBuf,
    shard: Option<String>,
    /// Trials of this part of the suite.
    asked: u64,
    /// In the store before, of this part.
    before: u64,
    made: u64,
    /// Of those that were made.
    failed: u64,
    /// Attempts beyond the first of each trial.
    again: u64,
    superseded: u64,
    changes: &'a [String],
    elapsed_ms: f64,
    evaluation: &'a Evaluation,
}

fn report(
    arguments: &Bench,
    experiment: &Experiment<'_>,
    place: &Path,
    begun: &Begun,
    Outcome { ran, elapsed }: Outcome,
) -> Result<Exit> {
    let rows = begun.store.with(|store| store.rows())?;
    // From here on others may write.
    begun.store.close(drop);
    let suite = experiment.suite();
    let trials_of = Trials::speaking_for(suite.protocol.generalise_over, &rows);
    let order = suite.protocol.ranking;
    let evaluation = Evaluation::of(&trials_of, order);
    let asked = experiment.schedule().len_of(arguments.shard);
    let shard = (arguments.shard != Shard::ALL).then(|| arguments.shard.to_string());
    match arguments.format {
        Format::Json => output::print_json(&Report {
            format: "fleetyard.bench/1",
            suite: &suite.name,
            store: place,
            manifest: Manifest::path(place),
            shard,
            asked,
            before: ran.before,
            made: ran.made,
            failed: ran.failed,
            again: ran.again,
            superseded: begun.superseded,
            changes: &begun.changes,
            elapsed_ms: elapsed.as_secs_f64() * 1000.0,
            evaluation: &evaluation,
        })?,
        Format::Text => {
            let mut text = table(&evaluation);
            let _ = write!(
                text,
                "\n\n{} made in {:.1} s",
                trials(ran.made),
                elapsed.as_secs_f64()
            );
            if ran.before > 0 {
                let _ = write!(text, ", {} there before", ran.before);
            }
            if ran.again > 0 {
                let _ = write!(text, ", disturbed attempts made again: {}", ran.again);
            }
            let attempts = trials_of.attempts();
            if let Some(shard) = shard {
                let _ = write!(text, "; shard {shard}");
            }
            if let Some(attempts) = attempts {
                let _ = write!(text, "\nattempts  {attempts} trials");
            }
            let contended = evaluation.overview.contended;
            if contended > 0 {
                let _ = write!(
                    text,
                    "\n{} disturbed: the times of these cannot be compared; end what else computes here, and \
                     `--retry-contended 3` makes those again that others are known to have disturbed",
                    trials(contended as u64)
                );
            }
            let _ = write!(
                text,
                "\nstore     {}\nmanifest  {}",
                place.display(),
                Manifest::path(place).display()
            );
            output::print(&output::plain(&text))?;
        }
    }
    Ok(Exit::Success)
}

/// The planners, best first.
fn table(evaluation: &Evaluation) -> String {
    // On views of a task, steps are of grids alone.
    let (title, cost) = if evaluation.views.is_empty() {
        ("SoC", "soc_steps")
    } else {
        ("SoC s", "soc_s")
    };
    let header = [
        "planner",
        "cases",
        "solved",
        "median ms",
        "mean ms",
        title,
        "failures",
    ];
    let value = |planner: &PlannerSummary, column: &str, median: bool| {
        planner.column(column).map_or(String::new(), |of| {
            fleetyard_bench::number(if median { of.median } else { of.mean })
        })
    };
    let lines = evaluation.planners.iter().map(|planner| {
        let reasons = planner.reasons.iter();
        let reasons: Vec<String> = reasons
            .map(|reason| format!("{} {}", reason.trials, reason.reason))
            .collect();
        vec![
            planner.planner.clone(),
            planner.cases.to_string(),
            planner.successes.to_string(),
            value(planner, SOLVE_TIME.column, true),
            value(planner, SOLVE_TIME.column, false),
            value(planner, cost, false),
            reasons.join(", "),
        ]
    });
    output::table(&header, lines.collect(), &[1, 2, 3, 4, 5])
}

/// Trials that would be run, as JSON.
#[derive(Serialize)]
struct Plan<'a> {
    format: &'static str,
    suite: &'a str,
    store: &'a Path,
    shard: Option<String>,
    planners: Vec<&'a str>,
    instances: usize,
    seeds: &'a [u64],
    repeats: u32,
    /// Trials of this part, warm-ups aside.
    trials: u64,
    warm_ups: u64,
    /// Most times that a trial is made again because others disturb it.
    retry_contended: u32,
    /// In the store already, of this part.
    there: u64,
    /// The seconds that it takes by what trials in the store took, least and most; absent without them.
    about_s: Option<[f64; 2]>,
    /// If every plan took its whole budget.
    plans_s: f64,
    /// If everybody used up all that budgets allow.
    at_most_s: f64,
    first: Vec<Next<'a>>,
}

/// A step that would be made.
#[derive(Serialize)]
struct Next<'a> {
    warm_up: bool,
    trial: u64,
    planner: &'a str,
    instance: String,
    seed: u64,
    repeat: u32,
}

fn dry_run(arguments: &Bench, experiment: &Experiment<'_>, place: &Path) -> Result<Exit> {
    let (schedule, suite) = (experiment.schedule(), experiment.suite());
    let mut estimate = Estimate::new(experiment.longest());
    let mut keys = BTreeSet::new();
    if place.symlink_metadata().is_ok() {
        let store = Store::open_read_only(place)?;
        keys = store.keys()?;
        store.each(&mut |row| {
            let mut labels = suite.planners.iter().map(|planner| &planner.label);
            if let Some(planner) = labels.position(|label| *label == row.planner) {
                estimate.known(planner, row.took());
            }
            Ok(())
        })?;
    }
    let missing = |planned: &Planned| keys.is_empty() || !keys.contains(&schedule.key(planned));
    let mut warm_ups = 0;
    let mut wanted = 0;
    let mut first = Vec::new();
    for step in schedule.order(arguments.shard) {
        let (Step::WarmUp(planned) | Step::Trial(planned)) = step;
        let warm_up = matches!(step, Step::WarmUp(_));
        if warm_up {
            warm_ups += 1;
        } else if missing(&planned) {
            wanted += 1;
        } else {
            continue;
        }
        estimate.expect(planned.planner);
        if first.len() < SHOWN {
            first.push(Next {
                warm_up,
                trial: planned.number,
                planner: &experiment.planners()[planned.planner].label,
                instance: experiment.instances()[planned.instance].to_string(),
                seed: planned.seed,
                repeat: planned.repeat,
            });
        }
    }
    let trials_of = schedule.len_of(arguments.shard);
    let steps = u32::try_from(wanted + warm_ups).unwrap_or(u32::MAX);
    let (at_most, plans) = (
        experiment.longest().saturating_mul(steps),
        experiment.budgeted().saturating_mul(steps),
    );
    let about = estimate.left();
    let plan = Plan {
        format: "fleetyard.bench-plan/1",
        suite: &suite.name,
        store: place,
        shard: (arguments.shard != Shard::ALL).then(|| arguments.shard.to_string()),
        planners: suite
            .planners
            .iter()
            .map(|planner| planner.label.as_str())
            .collect(),
        instances: experiment.instances().len(),
        seeds: &suite.protocol.seeds,
        repeats: suite.protocol.repeats,
        trials: trials_of,
        warm_ups,
        retry_contended: suite.protocol.retry_contended,
        there: trials_of - wanted,
        about_s: about.map(|about| [about.low, about.high].map(|time| time.as_secs_f64())),
        plans_s: plans.as_secs_f64(),
        at_most_s: at_most.as_secs_f64(),
        first,
    };
    match arguments.format {
        Format::Json => output::print_json(&plan)?,
        Format::Text => {
            let mut text = format!(
                "suite      {}\nstore      {}\nplanners   {}\ninstances  {}\nseeds      {}\nrepeats    {}\ntrials     {}",
                plan.suite,
                plan.store.display(),
                plan.planners.join(", "),
                plan.instances,
                plan.seeds.len(),
                plan.repeats,
                plan.trials,
            );
            if let Some(shard) = &plan.shard {
                let _ = write!(text, " in shard {shard}");
            }
            if plan.there > 0 {
                let _ = write!(text, ", {} of them there already", plan.there);
            }
            if plan.warm_ups > 0 {
                let _ = write!(text, "\nwarm-ups   {}", plan.warm_ups);
            }
            if plan.retry_contended > 0 {
                let attempts = 1 + plan.retry_contended;
                let _ = write!(text, "\nattempts   up to {attempts} of what others disturb");
            }
            if let Some(about) = about {
                let range = about.range();
                let _ = write!(
                    text,
                    "\ntime       {range}, by what trials in the store took"
                );
            }
            let _ = write!(
                text,
                "\n{}  {} if every plan takes its whole budget, most end before; at most {}, with \
                 starts, learning and ends",
                if about.is_some() {
                    "         "
                } else {
                    "time     "
                },
                rough(plans),
                rough(at_most)
            );
            let lines = plan.first.iter().map(|next| {
                vec![
                    if next.warm_up {
                        "warm-up".to_owned()
                    } else {
                        next.trial.to_string()
                    },
                    next.planner.to_owned(),
                    next.instance.clone(),
                    next.seed.to_string(),
                    next.repeat.to_string(),
                ]
            });
            let header = ["trial", "planner", "instance", "seed", "repeat"];
            text += "\n\n";
            text += &output::table(&header, lines.collect(), &[0, 3, 4]);
            let rest = (wanted + warm_ups) - plan.first.len() as u64;
            if rest > 0 {
                let _ = write!(text, "\n… and {rest} more");
            }
            output::print(&output::plain(&text))?;
        }
    }
    Ok(Exit::Success)
}

/// Result of making trials again, as JSON.
#[derive(Serialize)]
struct Verification<'a> {
    format: &'static str,
    suite: &'a str,
    store: &'a Path,
    /// Trials that belong to an earlier state of the suite or of a planner's code.
    superseded: u64,
    changes: &'a [String],
    #[serde(flatten)]
    verified: &'a Verified,
}

fn verification(arguments: &Bench, suite: &Suite, place: &Path) -> Result<Exit> {
    let store = Store::open_read_only(place)?;
    let mut experiment = experiment(arguments, suite)?;
    let meta = meta(&experiment, &arguments.suite, Some(&store))?;
    let changed = changes(&experiment, &store, &meta)?;
    let rows = store.rows()?;
    let schedule = experiment.schedule().clone();
    let keys: BTreeSet<String> = schedule
        .trials()
        .map(|planned| schedule.key(&planned))
        .collect();
    let other = rows.iter().filter(|row| !keys.contains(&row.key)).count() as u64;
    let superseded = other + store.counts()?.1;
    for line in &changed {
        output::note(&format!("changed since the store was written: {line}"));
    }
    let sample = arguments.verify_sample;
    let verified = make_again(&mut experiment, arguments.shard, &rows, sample)?;
    if verified.equal + verified.not_comparable + verified.differ.len() as u64 == 0 {
        let reason = "the store has no trial of this state of the suite";
        return Err(Failure::from(
            InputError::new(place.display().to_string(), reason)
                .hint("`fleetyard bench SUITE --resume` makes them"),
        ));
    }
    match arguments.format {
        Format::Json => output::print_json(&Verification {
            format: "fleetyard.verification/1",
            suite: &suite.name,
            store: place,
            superseded,
            changes: &changed,
            verified: &verified,
        })?,
        Format::Text => {
            let text = verification_text(&verified, superseded);
            output::print(&output::plain(&text))?;
        }
    }
    Ok(verdict(&verified))
}

/// Makes recorded trials once more, all or a sample of them, and says how far it is.
pub(super) fn make_again(
    experiment: &mut Experiment<'_>,
    shard: Shard,
    rows: &[Row],
    sample: Option<u64>,
) -> Result<Verified> {
    let schedule = experiment.schedule().clone();
    let (bar, longest) = (output::trials(0), experiment.longest());
    let verified = verify(
        &schedule,
        shard,
        rows,
        sample,
        longest,
        &mut |planned| experiment.trial(planned),
        &mut |progress| {
            bar.set_length(progress.total);
            bar.set_position(progress.done);
            let differ = format!("{} differ", progress.failed);
            bar.set_message(output::with_left(progress.left, &differ));
        },
    );
    bar.finish_and_clear();
    experiment.finish();
    Ok(verified?)
}

/// The exit code of a command that made trials again.
pub(super) fn verdict(verified: &Verified) -> Exit {
    if verified.differ.is_empty() && verified.nondeterministic.is_empty() {
        Exit::Success
    } else {
        Exit::NoPlan
    }
}

pub(super) fn verification_text(verified: &Verified, superseded: u64) -> String {
    let mut text = format!(
        "{} made again: {} equal, {} different",
        trials(verified.equal + verified.differ.len() as u64),
        verified.equal,
        verified.differ.len()
    );
    for (count, what) in [
        (
            verified.not_comparable,
            "not comparable: ended by their time or another limit",
        ),
        (verified.left_out, "not in the sample"),
        (
            superseded,
            "of an earlier state of the suite or its planners",
        ),
    ] {
        if count > 0 {
            let _ = write!(text, "\n{} {what}", trials(count));
        }
    }
    for planner in &verified.nondeterministic {
        let _ = write!(
            text,
            "\n`{planner}` gives different results for the same seed"
        );
    }
    if verified.differ.is_empty() {
        return text;
    }
    let header = [
        "planner", "map", "scenario", "agents", "seed", "repeat", "differs", "recorded", "now",
    ];
    let lines = verified.differ.iter().take(DIFFERENCES).map(|found| {
        let text = |value: &Option<String>| value.clone().unwrap_or_else(|| "none".into());
        vec![
            found.planner.clone(),
            found.map.clone(),
            found.scenario.clone(),
            found.agents.to_string(),
            found.seed.to_string(),
            found.repeat.to_string(),
            found.what.name().to_owned(),
            text(&found.recorded),
            text(&found.now),
        ]
    });
    text += "\n\n";
    text += &output::table(&header, lines.collect(), &[3, 4, 5]);
    let rest = verified.differ.len().saturating_sub(DIFFERENCES);
    if rest > 0 {
        let _ = write!(text, "\n… and {rest} more; --format json has all");
    }
    text
}
