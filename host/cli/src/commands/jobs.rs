//! `fleetyard jobs`: suites that run on a cluster, and their submission by
//! `fleetyard bench … --executor slurm`.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use clap::{Args, Subcommand};
use fleetyard_bench::slurm::{Request, Resources, Run, Shard, ShardState, Slurm, Status};
use fleetyard_bench::{Estimate, rough};
use fleetyard_core::quoted;
use serde::Serialize;

use crate::args::{Format, duration, size};
use crate::exit::{Exit, Failure, Result};
use crate::output;

/// The heading of options for clusters.
const CLUSTER: &str = "Cluster";

/// Shards up to which all are listed.
const LISTED: usize = 40;

/// The subcommands for runs.
#[derive(Debug, Subcommand)]
pub(crate) enum Jobs {
    /// Say how the shards of a run are
    Status {
        /// The folder of the run
        run: PathBuf,
        #[command(flatten)]
        format: Format,
    },
    /// Wait until all shards of a run have ended; exit code 1 if one did not come to its end
    Wait {
        /// The folder of the run
        run: PathBuf,
    },
    /// Cancel what waits and runs
    Cancel {
        /// The folder of the run
        run: PathBuf,
    },
    /// Submit again the shards that have ended without coming to their end; they go on where
    /// they stopped
    Requeue {
        /// The folder of the run
        run: PathBuf,
        #[command(flatten)]
        resources: ResourceArgs,
    },
    /// Merge the stores of all shards into one
    Merge {
        /// The folder of the run
        run: PathBuf,
        /// The store to write [default: the one that was named at the submission]
        #[arg(long, value_name = "FILE")]
        store: Option<PathBuf>,
        /// Take what there is of shards that have ended, although others are missing
        #[arg(long)]
        partial: bool,
    },
}

/// Partition, account and resources of a run's tasks.
#[derive(Debug, Default, PartialEq, Args)]
pub(crate) struct ResourceArgs {
    /// The partition, or several with commas [default: the site's]
    #[arg(long, help_heading = CLUSTER, value_name = "NAME")]
    partition: Option<String>,
    /// The account that pays
    #[arg(long, help_heading = CLUSTER, value_name = "NAME")]
    account: Option<String>,
    /// The quality of service
    #[arg(long, help_heading = CLUSTER, value_name = "NAME")]
    qos: Option<String>,
    /// The time after which a shard is ended [default: the site's]
    #[arg(long, help_heading = CLUSTER, value_name = "DURATION", value_parser = duration)]
    time_limit: Option<Duration>,
    /// CPUs of a shard [default: the threads of the suite's budget, and one for the host]
    #[arg(long, help_heading = CLUSTER, value_name = "N",
          value_parser = clap::value_parser!(u32).range(1..=4096))]
    cpus_per_task: Option<u32>,
    /// Memory of a shard [default: memory and scratch folder of the suite's budget, and what the
    /// host needs; the site's when the budget names none]
    #[arg(long, help_heading = CLUSTER, value_name = "SIZE", value_parser = size)]
    mem: Option<u64>,
    /// The nodes to use
    #[arg(long, help_heading = CLUSTER, value_name = "NODES")]
    nodelist: Option<String>,
    /// Nobody else on the nodes, for times that can be compared
    #[arg(long, help_heading = CLUSTER)]
    exclusive: bool,
    /// Most shards that run at once
    #[arg(long, help_heading = CLUSTER, value_name = "N",
          value_parser = clap::value_parser!(u32).range(1..))]
    max_running: Option<u32>,
    /// Another option of sbatch, with its long name; may be given several times
    #[arg(long, help_heading = CLUSTER, value_name = "NAME[=VALUE]")]
    slurm_option: Vec<String>,
}

impl ResourceArgs {
    fn resources(&self) -> Resources {
        Resources {
            partition: self.partition.clone(),
            account: self.account.clone(),
            qos: self.qos.clone(),
            time: self.time_limit,
            cpus: self.cpus_per_task,
            memory: self.mem,
            nodelist: self.nodelist.clone(),
            exclusive: self.exclusive,
            max_running: self.max_running,
            options: self.slurm_option.clone(),
        }
    }
}

/// The distribution of a suite over a cluster.
#[derive(Debug, Default, PartialEq, Args)]
pub(crate) struct ClusterArgs {
    /// Parts that the suite is split into, a task each [default: one for each instance, at most 32]
    #[arg(long, help_heading = CLUSTER, value_name = "N",
          value_parser = clap::value_parser!(u32).range(1..=i64::from(fleetyard_bench::slurm::MAX_SHARDS)))]
    pub(crate) shards: Option<u32>,
    /// The folder of the run, on a file system that all nodes share [default: the store's name
    /// with .run]
    #[arg(long, help_heading = CLUSTER, value_name = "FOLDER")]
    run: Option<PathBuf>,
    /// Do not wait: say how to go on, and end
    #[arg(long, help_heading = CLUSTER)]
    detach: bool,
    #[command(flatten)]
    resources: ResourceArgs,
}

/// A suite that is to run on a cluster.
pub(crate) struct Ask<'a> {
    pub(crate) name: &'a str,
    pub(crate) suite: &'a Path,
    pub(crate) store: &'a Path,
    /// More arguments for the command of each task.
    pub(crate) arguments: Vec<String>,
    /// Trials of each shard.
    pub(crate) trials: Vec<u64>,
    /// The longest that a trial may take.
    pub(crate) longest: Duration,
    /// Threads of the suite's budget.
    pub(crate) threads: u32,
    /// Memory limit of its planners in bytes, if the suite has one.
    pub(crate) memory: Option<u64>,
}

/// Memory of the host itself beside the planner, in bytes.
const HOST_MEMORY: u64 = 1 << 30;

/// Submits a suite, and unless it is to be left alone waits for it and merges its stores.
pub(crate) fn submit(cluster: &ClusterArgs, ask: Ask<'_>) -> Result<Exit> {
    let slurm = Slurm::from_environment();
    if ask.store.symlink_metadata().is_ok() {
        return Err(Failure::new(
            Exit::Input,
            format!("{}: there is a file of this name", ask.store.display()),
        )
        .hint("the shards' stores are merged into a new one; name it with --store"));
    }
    let own = Resources {
        cpus: Some(ask.threads.saturating_add(1)),
        memory: ask.memory.map(|memory| memory.saturating_add(HOST_MEMORY)),
        ..Resources::default()
    };
    let executable = std::env::current_exe().map_err(crate::exit::internal)?;
    let request = Request {
        run: cluster
            .run
            .clone()
            .unwrap_or_else(|| ask.store.with_extension("run")),
        name: ask.name.to_owned(),
        suite: ask.suite.to_owned(),
        executable,
        arguments: ask.arguments,
        store: ask.store.to_owned(),
        trials: ask.trials,
        resources: own.with(&cluster.resources.resources()),
    };
    let run = Run::submit(&request, &slurm)?;
    let shown = word(&request.run);
    let trials: u64 = request.trials.iter().sum();
    let most = request.trials.iter().max().copied().unwrap_or(0);
    output::note(&format!(
        "job {} has {} with {} in {shown}; a shard takes {} at most",
        run.jobs()[0],
        counted(request.trials.len() as u64, "shard"),
        counted(trials, "trial"),
        rough(
            ask.longest
                .saturating_mul(most.try_into().unwrap_or(u32::MAX))
        ),
    ));
    if cluster.detach {
        output::print(&format!(
            "fleetyard jobs status {shown}\nfleetyard jobs wait {shown}\nfleetyard jobs merge {shown}"
        ))?;
        return Ok(Exit::Success);
    }
    output::note(&format!(
        "the job does not need this command: after Ctrl-C, `fleetyard jobs wait {shown}` goes on"
    ));
    match wait_for(&run, &slurm)? {
        Exit::Success => merge(&run, &slurm, None, false),
        other => Ok(other),
    }
}

pub(crate) fn jobs(what: &Jobs) -> Result<Exit> {
    let slurm = Slurm::from_environment();
    match what {
        Jobs::Status { run, format } => status(&Run::open(run)?, &slurm, *format),
        Jobs::Wait { run } => wait_for(&Run::open(run)?, &slurm),
        Jobs::Cancel { run } => {
            let active = Run::open(run)?.cancel(&slurm)?;
            output::print(&format!("{} cancelled", counted(active as u64, "shard")))?;
            Ok(Exit::Success)
        }
        Jobs::Requeue { run, resources } => {
            let mut opened = Run::open(run)?;
            let shards = opened.requeue(&slurm, &resources.resources())?;
            let text = match (shards.len(), opened.jobs().last()) {
                (count, Some(job)) if count > 0 => {
                    format!("{} submitted as job {job}", counted(count as u64, "shard"))
                }
                _ => "no shard has ended without coming to its end".to_owned(),
            };
            output::print(&text)?;
            Ok(Exit::Success)
        }
        Jobs::Merge {
            run,
            store,
            partial,
        } => merge(&Run::open(run)?, &slurm, store.as_deref(), *partial),
    }
}

fn word(path: &Path) -> String {
    quoted(&path.display().to_string())
}

fn counted(count: u64, what: &str) -> String {
    let plural = if count == 1 { "" } else { "s" };
    format!("{count} {what}{plural}")
}

/// The status of a run as JSON.
#[derive(Serialize)]
struct Report<'a> {
    format: &'static str,
    run: &'a Path,
    store: &'a Path,
    jobs: Vec<u32>,
    ended: bool,
    complete: bool,
    done: u64,
    trials: u64,
    #[serde(flatten)]
    status: &'a Status,
}

fn status(run: &Run, slurm: &Slurm, format: Format) -> Result<Exit> {
    let status = run.status(slurm);
    match format {
        Format::Json => output::print_json(&Report {
            format: "fleetyard.job-status/1",
            run: run.folder(),
            store: run.store(),
            jobs: run.jobs(),
            ended: status.has_ended(),
            complete: status.is_complete(),
            done: status.done(),
            trials: status.trials(),
            status: &status,
        })?,
        Format::Text => {
            output::print(&output::plain(&text(&status)))?;
            advise(run, &status);
        }
    }
    Ok(Exit::Success)
}

fn text(status: &Status) -> String {
    let all = status.shards.len() <= LISTED;
    let quiet = [ShardState::Completed, ShardState::Pending];
    let listed = status
        .shards
        .iter()
        .filter(|shard| all || !quiet.contains(&shard.state));
    let rows: Vec<Vec<String>> = listed.map(row).collect();
    let mut text = format!(
        "shards  {} ({})\ntrials  {} of {}",
        status.shards.len(),
        status.summary(),
        status.done(),
        status.trials()
    );
    if !rows.is_empty() {
        let header = [
            "shard", "state", "trials", "of", "task", "node", "exit", "reason",
        ];
        text += "\n\n";
        text += &output::table(&header, rows, &[0, 2, 3]);
    }
    text
}

fn row(shard: &Shard) -> Vec<String> {
    let exit = match (&shard.exit_code, &shard.signal) {
        (_, Some(signal)) => format!("SIG{signal}"),
        (Some(code), None) => code.to_string(),
        (None, None) => String::new(),
    };
    vec![
        shard.shard.to_string(),
        shard.state.to_string(),
        shard.done.to_string(),
        shard.trials.to_string(),
        shard.task.clone().unwrap_or_default(),
        shard.node.clone().unwrap_or_default(),
        exit,
        shard.reason.clone().unwrap_or_default(),
    ]
}

/// Prints the next steps, on standard error.
fn advise(run: &Run, status: &Status) {
    if let Some(reason) = &status.unanswered {
        output::warning(&format!("only the run's folder was asked: {reason}"));
        return;
    }
    if !status.has_ended() {
        return;
    }
    let shown = word(run.folder());
    if status.is_complete() {
        if run.store().symlink_metadata().is_err() {
            output::hint(&format!(
                "`fleetyard jobs merge {shown}` makes one store of them"
            ));
        }
        return;
    }
    let first = |state| status.shards.iter().find(|shard| shard.state == state);
    let failed = [ShardState::Failed, ShardState::Vanished, ShardState::Unseen]
        .into_iter()
        .find_map(first);
    if let Some(log) = failed.and_then(|shard| run.log(shard.shard)) {
        output::hint(&format!(
            "the log of the first that failed is {}",
            word(&log)
        ));
    }
    let more = if first(ShardState::Timeout).is_some() {
        " --time-limit DURATION"
    } else if first(ShardState::OutOfMemory).is_some() {
        " --mem SIZE"
    } else {
        ""
    };
    output::hint(&format!(
        "`fleetyard jobs requeue {shown}{more}` goes on with what is missing"
    ));
}

/// Waits and shows how far it is; success if all shards came to their end.
fn wait_for(run: &Run, slurm: &Slurm) -> Result<Exit> {
    let before = run.status(slurm);
    let bar = output::trials(before.trials());
    bar.set_position(before.done());
    // Nodes make trials side by side: what counts is how many of them end in a time.
    let mut estimate = Estimate::new(Duration::MAX);
    (before.done()..before.trials()).for_each(|_| estimate.expect(0));
    let (mut done, mut since) = (before.done(), Instant::now());
    let status = run.wait(slurm, |status| {
        let made = status.done().saturating_sub(done);
        if let Some(each) = since.elapsed().checked_div(made as u32) {
            (0..made).for_each(|_| estimate.ended(0, each));
            (done, since) = (status.done(), Instant::now());
        }
        bar.set_position(status.done());
        bar.set_message(output::with_left(estimate.left(), &status.summary()));
    })?;
    bar.finish_and_clear();
    if status.is_complete() {
        return Ok(Exit::Success);
    }
    output::error(&format!(
        "{} of {} did not come to their end",
        status.shards.len() - status.count(ShardState::Completed),
        counted(status.shards.len() as u64, "shard")
    ));
    output::print(&output::plain(&text(&status)))?;
    advise(run, &status);
    Ok(Exit::NoPlan)
}

fn merge(run: &Run, slurm: &Slurm, store: Option<&Path>, partial: bool) -> Result<Exit> {
    let store = store.unwrap_or(run.store());
    let merged = run.merge(slurm, store, partial)?;
    output::print(&format!(
        "{} in {}",
        counted(merged.trials, "trial"),
        store.display()
    ))?;
    Ok(Exit::Success)
}
