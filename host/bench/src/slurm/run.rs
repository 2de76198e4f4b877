//! A run: submitted, looked at, waited for, cancelled, submitted again.

use std::fs::{self, File, TryLockError};
use std::path::{Path, PathBuf};
use std::thread;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use fleetyard_core::{InputError, quoted, read_file, write_atomically};
use fleetyard_runtime::CodeFile;

use super::job::{Format, Job, MAX_SHARDS, Submission};
use super::parse::ranges;
use super::script::{LOGS, SHARDS, SUITE, script};
use super::status::{ShardState, Status, look_again, status};
use super::{Error, Resources, Slurm};
use crate::store::{Merged, Store};

const FILE: &str = "job.json";
const SCRIPT: &str = "run.sh";
const LOCK: &str = "lock";
/// Largest suite file.
const SUITE_LIMIT: u64 = 1 << 24;

/// A run that is to be submitted.
#[derive(Debug, Clone)]
pub struct Request {
    /// The folder of the run, which must not exist or be empty.
    pub run: PathBuf,
    /// The suite's name.
    pub name: String,
    /// The suite file.
    pub suite: PathBuf,
    /// The executable that tasks start.
    pub executable: PathBuf,
    /// More arguments of `fleetyard bench`.
    pub arguments: Vec<String>,
    /// Path of the store into which those of the shards are merged.
    pub store: PathBuf,
    /// Trials of each shard; as many shards as there are.
    pub trials: Vec<u64>,
    /// Resources of a task.
    pub resources: Resources,
}

/// A run on a cluster.
#[derive(Debug, Clone)]
pub struct Run {
    folder: PathBuf,
    job: Job,
}

impl Run {
    /// Makes the folder and submits all shards. When Slurm refuses, nothing is left.
    pub fn submit(request: &Request, slurm: &Slurm) -> Result<Self, Error> {
        let folder = absolute(&request.run)?;
        let count = request.trials.len();
        if count == 0 || count > MAX_SHARDS as usize {
            return Err(Error::option(
                format!("a run cannot have {count} shards"),
                format!("1 to {MAX_SHARDS} are possible, and no more than there are trials"),
            ));
        }
        let here = std::env::current_dir()
            .map_err(|error| cannot(Path::new("."), "be used as the current folder", &error))?;
        let code = |path: &Path| {
            CodeFile::read(absolute(path)?).map_err(|fault| {
                let path = path.display().to_string();
                Error::from(InputError::new(path, fault.to_string()))
            })
        };
        let job = Job {
            format: Format::V1,
            name: job_name(&request.name),
            suite: code(&request.suite)?,
            executable: code(&request.executable)?,
            folder: here,
            arguments: request.arguments.clone(),
            store: absolute(&request.store)?,
            trials: request.trials.clone(),
            resources: request.resources.clone(),
            submissions: Vec::new(),
        };
        let paths = [
            &folder,
            &job.suite.path,
            &job.executable.path,
            &job.folder,
            &job.store,
        ];
        if let Some(path) = paths.into_iter().find(|path| path.to_str().is_none()) {
            let path = path.display().to_string();
            return Err(InputError::new(path, "this path is not UTF-8")
                .hint("a batch script cannot name it; use another")
                .into());
        }
        // Before anything is made.
        job.resources.arguments()?;
        let made = make_folder(&folder)?;
        let mut run = Self { folder, job };
        let submitted = run.prepare().and_then(|()| {
            let all: Vec<u32> = run.job.shards().collect();
            run.submit_shards(all, slurm)
        });
        if submitted.is_err() && made {
            // Everything in it is of the last few moments.
            let _ = fs::remove_dir_all(&run.folder);
        }
        submitted.map(|()| run)
    }

    /// The run in a folder.
    pub fn open(folder: &Path) -> Result<Self, Error> {
        let file = folder.join(FILE);
        if !file.exists() && folder.is_dir() {
            let folder = folder.display().to_string();
            return Err(InputError::new(folder, "this is not the folder of a run")
                .hint("`fleetyard bench … --executor slurm` says which it makes")
                .into());
        }
        Ok(Self {
            job: Job::load(&file)?,
            folder: absolute(folder)?,
        })
    }

    /// Its folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Path of the store into which those of the shards are to be merged.
    pub fn store(&self) -> &Path {
        &self.job.store
    }

    /// The suite file that was submitted.
    pub fn suite(&self) -> &Path {
        &self.job.suite.path
    }

    /// The store of a shard, which is there once its task has begun.
    pub fn shard_store(&self, shard: u32) -> PathBuf {
        self.folder.join(SHARDS).join(format!("{shard}.sqlite"))
    }

    /// The log of a shard's last task.
    pub fn log(&self, shard: u32) -> Option<PathBuf> {
        let job = self.job.latest(shard)?.job;
        Some(self.folder.join(LOGS).join(format!("{shard}-{job}.log")))
    }

    /// The identifiers of the job arrays, in order.
    pub fn jobs(&self) -> Vec<u32> {
        self.job.submissions.iter().map(|of| of.job).collect()
    }

    /// The state of the shards.
    pub fn status(&self, slurm: &Slurm) -> Status {
        status(&self.job, &self.folder, slurm)
    }

    /// Waits until nothing more happens by itself, and tells `look` every status on the way.
    ///
    /// The folder is looked at every second; Slurm is asked at ever longer intervals, up to
    /// half a minute, since everybody's questions go to one controller.
    pub fn wait(&self, slurm: &Slurm, mut look: impl FnMut(&Status)) -> Result<Status, Error> {
        /// File systems that nodes share show a new file within a minute.
        const GRACE: Duration = Duration::from_mins(1);
        const LOOK: Duration = Duration::from_secs(1);
        /// A controller may be away for a restart.
        const SILENCE: Duration = Duration::from_mins(10);
        let mut pause = Duration::from_millis(250);
        let mut last_seen = Instant::now();
        let mut ended_since = None;
        loop {
            let mut status = self.status(slurm);
            look(&status);
            if status.unanswered.is_none() {
                last_seen = Instant::now();
            } else if last_seen.elapsed() > SILENCE {
                return Err(Error::Failed {
                    program: "squeue".into(),
                    message: status.unanswered.unwrap_or_default(),
                });
            }
            if status.has_ended() && status.unanswered.is_none() {
                let since = *ended_since.get_or_insert_with(Instant::now);
                let unseen = status.count(ShardState::Unseen) > 0;
                if !unseen || since.elapsed() > GRACE {
                    return Ok(status);
                }
            } else {
                ended_since = None;
            }
            let asked = Instant::now();
            while asked.elapsed() < pause && !status.is_complete() {
                thread::sleep(LOOK.min(pause.saturating_sub(asked.elapsed())));
                look_again(&mut status, &self.job, &self.folder);
                look(&status);
            }
            pause = (pause * 3 / 2).min(Duration::from_secs(30));
        }
    }

    /// Cancels what waits and what runs; how many shards that were.
    pub fn cancel(&self, slurm: &Slurm) -> Result<usize, Error> {
        let status = self.status(slurm);
        let mut active = 0;
        for submission in &self.job.submissions {
            let of = status.shards.iter().filter(|shard| {
                let latest = self.job.latest(shard.shard).map(|latest| latest.job);
                !shard.state.has_ended() && latest == Some(submission.job)
            });
            let count = of.count();
            if count > 0 {
                slurm.cancel(&submission.identity())?;
                active += count;
            }
        }
        Ok(active)
    }

    /// Submits again the shards that have ended and not completed, as a new array with the
    /// same indices; they go on where they stopped. Which these are.
    pub fn requeue(&mut self, slurm: &Slurm, resources: &Resources) -> Result<Vec<u32>, Error> {
        let _lock = self.lock()?;
        // Another process may have submitted since this one looked.
        self.job = Job::load(&self.folder.join(FILE))?;
        let status = self.status(slurm);
        if let Some(reason) = &status.unanswered {
            return Err(Error::Failed {
                program: "squeue".into(),
                message: reason.clone(),
            });
        }
        let shards: Vec<u32> = status
            .shards
            .iter()
            .filter(|shard| shard.state.has_ended() && shard.state != ShardState::Completed)
            .map(|shard| shard.shard)
            .collect();
        if shards.is_empty() {
            return Ok(shards);
        }
        for file in [&self.job.executable, &self.job.suite] {
            let found = CodeFile::read(file.path.clone()).ok();
            if found.as_ref() != Some(file) {
                let path = file.path.display();
                return Err(Error::state(
                    format!("{path} is not what was submitted"),
                    "the trials of one run are of one suite and one executable: put it back, or submit the suite again",
                ));
            }
        }
        self.job.resources = self.job.resources.with(resources);
        self.submit_shards(shards.clone(), slurm)?;
        Ok(shards)
    }

    /// Merges the shards' stores into a new one. All shards must have come to their end; if
    /// `partial`, what those have that ended otherwise counts as well, and others are left out.
    pub fn merge(&self, slurm: &Slurm, store: &Path, partial: bool) -> Result<Merged, Error> {
        let status = self.status(slurm);
        let missing = status.shards.len() - status.count(ShardState::Completed);
        let shown = quoted(&self.folder.display().to_string());
        if missing > 0 && !partial {
            return Err(Error::state(
                format!(
                    "{missing} of {} shards have not come to their end: {}",
                    status.shards.len(),
                    status.summary()
                ),
                format!(
                    "`fleetyard jobs wait {shown}`, or `requeue` if they have ended; or take what \
                     there is with --partial"
                ),
            ));
        }
        // A store that another machine writes must not be opened here.
        let stores: Vec<PathBuf> = status
            .shards
            .iter()
            .filter(|shard| shard.state.has_ended())
            .map(|shard| self.shard_store(shard.shard))
            .filter(|path| !partial || path.exists())
            .collect();
        if stores.is_empty() {
            return Err(Error::state(
                "no shard that has ended has a store",
                format!("`fleetyard jobs status {shown}` says how they are"),
            ));
        }
        Ok(Store::merge(store, &stores)?)
    }

    /// Writes what tasks need.
    fn prepare(&self) -> Result<(), Error> {
        for name in [SHARDS, LOGS] {
            let folder = self.folder.join(name);
            fs::create_dir(&folder).map_err(|error| cannot(&folder, "be made", &error))?;
        }
        let suite = read_file(&self.job.suite.path, SUITE_LIMIT)?;
        write_atomically(&self.folder.join(SUITE), &suite)?;
        let script = script(&self.job, &self.folder);
        write_atomically(&self.folder.join(SCRIPT), script.as_bytes())?;
        self.job.save(&self.folder.join(FILE))?;
        Ok(())
    }

    fn submit_shards(&mut self, shards: Vec<u32>, slurm: &Slurm) -> Result<(), Error> {
        let resources = &self.job.resources;
        let limit = resources.max_running.map(|most| format!("%{most}"));
        let mut options = vec![
            "--parsable".to_owned(),
            format!("--job-name={}", self.job.name),
            format!("--chdir={}", self.folder.display()),
            // Relative to the folder: a pattern cannot quote whatever a path may have.
            format!("--output={LOGS}/%a-%A.log"),
            "--open-mode=append".to_owned(),
            "--requeue".to_owned(),
            format!("--array={}{}", ranges(&shards), limit.unwrap_or_default()),
        ];
        options.extend(resources.arguments()?);
        let submitted = slurm.submit(&options, &self.folder.join(SCRIPT))?;
        let now = SystemTime::now().duration_since(UNIX_EPOCH);
        self.job.submissions.push(Submission {
            job: submitted.job,
            cluster: submitted.cluster,
            shards,
            submitted_unix_ms: now.map_or(0, |since| since.as_millis() as u64),
            options,
        });
        Ok(self.job.save(&self.folder.join(FILE))?)
    }

    /// Nobody else submits while this is held.
    fn lock(&self) -> Result<File, Error> {
        let path = self.folder.join(LOCK);
        let file = File::options()
            .create(true)
            .truncate(false)
            .write(true)
            .open(&path)
            .map_err(|error| cannot(&path, "be written", &error))?;
        match file.try_lock() {
            Ok(()) => Ok(file),
            Err(TryLockError::WouldBlock) => Err(Error::state(
                format!(
                    "another process submits shards of {}",
                    self.folder.display()
                ),
                "wait until it has ended",
            )),
            Err(TryLockError::Error(error)) => Err(cannot(&path, "be locked", &error).into()),
        }
    }
}

/// A name for the job that is Slurm's own for nothing else and needs no quoting.
fn job_name(suite: &str) -> String {
    let plain: String = suite
        .chars()
        .map(|c| {
            if c.is_ascii_alphanumeric() || "-_.".contains(c) {
                c
            } else {
                '-'
            }
        })
        .take(60)
        .collect();
    format!("fleetyard-{plain}")
}

/// Makes the folder, unless it is there and empty; whether it was made.
fn make_folder(folder: &Path) -> Result<bool, Error> {
    let entries = match fs::read_dir(folder) {
        Ok(entries) => entries,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
            fs::create_dir_all(folder).map_err(|error| cannot(folder, "be made", &error))?;
            return Ok(true);
        }
        Err(error) => return Err(cannot(folder, "be the folder of a run", &error).into()),
    };
    if entries.count() == 0 {
        return Ok(false);
    }
    let shown = folder.display();
    let hint = if folder.join(FILE).exists() {
        format!("`fleetyard jobs requeue {shown}` goes on with it; or name another with --run")
    } else {
        "name another with --run".to_owned()
    };
    Err(
        InputError::new(shown.to_string(), "this folder is there already")
            .hint(hint)
            .into(),
    )
}

/// Absolute, and otherwise as the user named it: on other machines symbolic links may lead
/// elsewhere.
fn absolute(path: &Path) -> Result<PathBuf, InputError> {
    std::path::absolute(path).map_err(|error| cannot(path, "be named", &error))
}

fn cannot(path: &Path, what: &str, error: &std::io::Error) -> InputError {
    InputError::new(
        path.display().to_string(),
        format!("cannot {what}: {error}"),
    )
}
