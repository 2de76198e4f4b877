//! State of a run's shards: the files that their tasks left in the run's folder, and for shards
//! without any the state that Slurm reports.

use std::io::Read;
use std::path::Path;

use fleetyard_core::{open_regular, words};
use serde::{Deserialize, Serialize, de::DeserializeOwned};

use super::job::{Job, Submission};
use super::parse::{Line, State};
use super::script::{CHANGED, NOT_VISIBLE, SHARDS};
use super::{Error, Slurm};

/// State of a shard.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum ShardState {
    /// Not submitted, because a submission was refused or interrupted.
    Unsubmitted,
    /// Slurm has not started it.
    Pending,
    /// It runs.
    Running,
    /// All of its trials are in its store.
    Completed,
    /// It ended with an error, or was killed.
    Failed,
    /// It reached its time limit.
    Timeout,
    /// It used more memory than it may.
    OutOfMemory,
    /// Its node failed.
    NodeFail,
    /// Somebody cancelled it.
    Cancelled,
    /// Another job took its place.
    Preempted,
    /// It ended, and what it should have left is not (yet) visible here.
    Unseen,
    /// Slurm knows nothing of it, and it left nothing.
    Vanished,
}

words!(ShardState {
    Unsubmitted = "unsubmitted";
    Pending = "pending";
    Running = "running";
    Completed = "completed";
    Failed = "failed";
    Timeout = "timeout";
    OutOfMemory = "out-of-memory";
    NodeFail = "node-fail";
    Cancelled = "cancelled";
    Preempted = "preempted";
    Unseen = "unseen";
    Vanished = "vanished";
});

impl ShardState {
    /// True if nothing more happens without a requeue.
    pub fn has_ended(self) -> bool {
        !matches!(self, Self::Pending | Self::Running)
    }
}

/// A shard and how it is.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Shard {
    /// Its number, from 1.
    pub shard: u32,
    /// Its state.
    pub state: ShardState,
    /// The task that it was last part of, as Slurm writes it: `123_4`.
    pub task: Option<String>,
    /// The node on which it runs or ran.
    pub node: Option<String>,
    /// The code with which its task ended.
    pub exit_code: Option<u32>,
    /// The signal that ended it.
    pub signal: Option<String>,
    /// The reason of the state, as far as it is known.
    pub reason: Option<String>,
    /// Trials that are in its store, when it last said so.
    pub done: u64,
    /// Its trials.
    pub trials: u64,
}

/// State of a run.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Status {
    /// Its shards, in order.
    pub shards: Vec<Shard>,
    /// The reason why Slurm did not answer: all that is not in the folder is unknown.
    pub unanswered: Option<String>,
}

impl Status {
    /// Trials that are in stores.
    pub fn done(&self) -> u64 {
        self.shards.iter().map(|shard| shard.done).sum()
    }

    /// Trials of the suite.
    pub fn trials(&self) -> u64 {
        self.shards.iter().map(|shard| shard.trials).sum()
    }

    /// Number of shards in a state.
    pub fn count(&self, state: ShardState) -> usize {
        let shards = self.shards.iter();
        shards.filter(|shard| shard.state == state).count()
    }

    /// True if nothing more happens by itself.
    pub fn has_ended(&self) -> bool {
        self.shards.iter().all(|shard| shard.state.has_ended())
    }

    /// True if every shard came to its end.
    pub fn is_complete(&self) -> bool {
        self.count(ShardState::Completed) == self.shards.len()
    }

    /// Counts of all states that occur: `3 running, 5 pending`.
    pub fn summary(&self) -> String {
        let mut states: Vec<ShardState> = self.shards.iter().map(|shard| shard.state).collect();
        states.sort_unstable();
        let counts = states.chunk_by(|a, b| a == b);
        let words: Vec<String> = counts
            .map(|chunk| format!("{} {}", chunk.len(), chunk[0]))
            .collect();
        words.join(", ")
    }
}

/// The record that a task writes when it ends.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Ended {
    job: u32,
    code: u32,
    /// The signal that the task was sent, or nothing.
    signal: String,
    node: String,
}

/// The file that `bench` writes beside its store while it runs.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Progress {
    /// Trials in the store.
    pub done: u64,
    /// Trials of the shard.
    pub trials: u64,
}

/// The state of a run's shards.
pub(super) fn status(job: &Job, run: &Path, slurm: &Slurm) -> Status {
    let mut shards: Vec<Shard> = job.shards().map(|shard| begin(job, run, shard)).collect();
    let mut unanswered = None;
    for submission in &job.submissions {
        let is_open = |shard: &Shard| {
            let latest = job.latest(shard.shard).map(|latest| latest.job);
            shard.state != ShardState::Completed && latest == Some(submission.job)
        };
        let open: Vec<usize> = (0..shards.len())
            .filter(|index| is_open(&shards[*index]))
            .collect();
        if open.is_empty() {
            continue;
        }
        if let Err(error) = ask(job, run, submission, slurm, &mut shards, open) {
            unanswered = Some(error.to_string());
        }
    }
    Status { shards, unanswered }
}

/// A shard by its files alone. One that was submitted and left nothing may be anything:
/// it counts as waiting until Slurm has been asked.
fn begin(job: &Job, run: &Path, number: u32) -> Shard {
    let trials = job.trials[number as usize - 1];
    let latest = job.latest(number);
    let mut shard = Shard {
        shard: number,
        state: match latest {
            Some(_) => ShardState::Pending,
            None => ShardState::Unsubmitted,
        },
        task: latest.map(|latest| format!("{}_{number}", latest.job)),
        node: None,
        exit_code: None,
        signal: None,
        reason: None,
        done: 0,
        trials,
    };
    if let Some(progress) = read::<Progress>(run, number, "progress") {
        shard.done = progress.done.min(trials);
        if progress.trials != trials {
            shard.reason = Some(format!(
                "the task counts {} trials and the submission {trials}",
                progress.trials
            ));
        }
    }
    if let Some(latest) = latest {
        take_ended(&mut shard, run, latest);
    }
    shard
}

/// Looks at the files alone again, after Slurm was asked: trials that were done since, and
/// shards that have completed. How others are is Slurm's to say.
pub(super) fn look_again(status: &mut Status, job: &Job, run: &Path) {
    for shard in &mut status.shards {
        if shard.state.has_ended() {
            continue;
        }
        let seen = begin(job, run, shard.shard);
        if seen.state == ShardState::Completed {
            *shard = seen;
        } else {
            shard.done = seen.done;
        }
    }
}

/// Takes over how the task says that it ended; whether it does.
fn take_ended(shard: &mut Shard, run: &Path, submission: &Submission) -> bool {
    let ended = read::<Ended>(run, shard.shard, "exit");
    let Some(ended) = ended.filter(|ended| ended.job == submission.job) else {
        return false;
    };
    shard.exit_code = Some(ended.code);
    shard.signal = Some(ended.signal).filter(|signal| !signal.is_empty());
    shard.node = Some(ended.node).filter(|node| !node.is_empty());
    shard.state = if ended.code == 0 {
        shard.done = shard.trials;
        ShardState::Completed
    } else {
        ShardState::Failed
    };
    shard.reason = match ended.code {
        NOT_VISIBLE => Some("the node does not see all that it needs; its log says what".into()),
        CHANGED => Some("the executable or the suite has changed since the submission".into()),
        _ => shard.reason.take(),
    };
    true
}

/// Asks Slurm about shards of a submission that have not completed.
fn ask(
    job: &Job,
    run: &Path,
    submission: &Submission,
    slurm: &Slurm,
    shards: &mut [Shard],
    open: Vec<usize>,
) -> Result<(), Error> {
    let identity = submission.identity();
    // Identifiers are given again after years: a job of another name is not this one.
    let own = |lines: Vec<Line>| -> Vec<Line> {
        let own = |line: &Line| line.job == identity.job && line.name == job.name;
        lines.into_iter().filter(own).collect()
    };
    let active = own(slurm.active(&identity)?);
    let mut unknown = Vec::new();
    for index in open {
        let shard = &mut shards[index];
        match active.iter().find(|line| line.is_about(shard.shard)) {
            // Its processes are being cleared away; it has said how it ended, or it will not.
            Some(line) if line.state == State::Completing && shard.exit_code.is_some() => {}
            Some(line) => {
                shard.state = match line.state {
                    State::Pending => ShardState::Pending,
                    _ => ShardState::Running,
                };
                (shard.exit_code, shard.signal) = (None, None);
                shard.node.clone_from(&line.node);
                shard.reason.clone_from(&line.reason);
                continue;
            }
            None => {}
        }
        // It may have ended since its file was looked for.
        let said = take_ended(shard, run, submission);
        if !said || shard.signal.is_some() {
            shard.state = if said {
                shard.state
            } else {
                ShardState::Vanished
            };
            unknown.push(index);
        }
    }
    if unknown.is_empty() {
        return Ok(());
    }
    let mut lines = own(slurm.remembered(&identity)?);
    let known = |lines: &[Line], shards: &[Shard], index: &usize| {
        let shard = shards[*index].shard;
        lines.iter().any(|line| line.is_about(shard))
    };
    if !unknown.iter().all(|index| known(&lines, shards, index)) {
        lines.extend(own(slurm.accounted(&identity)?));
    }
    for index in unknown {
        let shard = &mut shards[index];
        if let Some(line) = lines.iter().find(|line| line.is_about(shard.shard)) {
            end_by(shard, line);
        } else if shard.state == ShardState::Vanished {
            shard.reason = Some("Slurm does not know the task, and it left nothing".into());
        }
    }
    Ok(())
}

/// Takes over how Slurm says that a task ended.
fn end_by(shard: &mut Shard, line: &Line) {
    let said = shard.exit_code.is_some();
    shard.state = match line.state {
        // Between two questions: what is true now is the later one.
        State::Pending => ShardState::Pending,
        State::Running | State::Completing => ShardState::Running,
        State::Completed if said => shard.state,
        State::Completed => ShardState::Unseen,
        State::Failed | State::Other(_) => ShardState::Failed,
        State::Timeout => ShardState::Timeout,
        State::NodeFail => ShardState::NodeFail,
        State::OutOfMemory => ShardState::OutOfMemory,
        State::Cancelled => ShardState::Cancelled,
        State::Preempted => ShardState::Preempted,
    };
    if shard.node.is_none() {
        shard.node.clone_from(&line.node);
    }
    if shard.reason.is_none() {
        shard.reason.clone_from(&line.reason);
    }
    if said {
        return;
    }
    if let Some((code, signal)) = line.exit {
        shard.exit_code = Some(code);
        // 53 is slurmstepd's own word for files that it cannot open.
        if (code, signal) == (0, 53) {
            shard.reason =
                Some("the node could not write into the run's folder; is it visible there?".into());
        } else if signal != 0 {
            shard.signal = Some(signal_name(signal));
        }
    }
    if shard.state == ShardState::Unseen {
        shard.reason = Some("it ended well, but what it left is not visible here".into());
    }
    if let State::Other(state) = &line.state {
        shard.reason = Some(state.clone());
    }
}

fn signal_name(signal: u32) -> String {
    match signal {
        2 => "INT".into(),
        6 => "ABRT".into(),
        9 => "KILL".into(),
        11 => "SEGV".into(),
        15 => "TERM".into(),
        other => other.to_string(),
    }
}

/// Reads a small file of a shard. Tasks replace them as a whole, so that one that is
/// missing, too long or no JSON says nothing.
fn read<T: DeserializeOwned>(run: &Path, shard: u32, what: &str) -> Option<T> {
    const LIMIT: u64 = 1 << 12;
    let path = run.join(SHARDS).join(format!("{shard}.{what}"));
    let mut bytes = Vec::new();
    open_regular(&path)
        .ok()?
        .take(LIMIT)
        .read_to_end(&mut bytes)
        .ok()?;
    serde_json::from_slice(&bytes).ok()
}
