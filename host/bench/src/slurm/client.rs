//! Slurm's commands: started with a bounded time and a bounded output, in an environment
//! in which nobody's settings change what they print.

use std::ffi::{OsStr, OsString};
use std::io::{ErrorKind, Read};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use super::Error;
use super::parse::{self, Line, Submitted};

/// Limit of a command. Slurm's own give up after a few tries of ten seconds when nobody answers.
const PATIENCE: Duration = Duration::from_secs(90);

/// Most output that is read of a command.
const OUTPUT_LIMIT: u64 = 1 << 26;

/// The commands and where they are.
#[derive(Debug, Clone)]
pub struct Slurm {
    sbatch: OsString,
    squeue: OsString,
    scontrol: OsString,
    sacct: OsString,
    scancel: OsString,
}

impl Slurm {
    /// The commands on the path, unless `FLEETYARD_SBATCH`, `FLEETYARD_SQUEUE`,
    /// `FLEETYARD_SCONTROL`, `FLEETYARD_SACCT` or `FLEETYARD_SCANCEL` names another
    /// program that takes the same arguments.
    pub fn from_environment() -> Self {
        let program = |name: &str| {
            let other = std::env::var_os(format!("FLEETYARD_{}", name.to_uppercase()));
            other
                .filter(|other| !other.is_empty())
                .unwrap_or_else(|| name.into())
        };
        Self {
            sbatch: program("sbatch"),
            squeue: program("squeue"),
            scontrol: program("scontrol"),
            sacct: program("sacct"),
            scancel: program("scancel"),
        }
    }

    /// All of them in one folder.
    #[cfg(test)]
    pub(super) fn in_folder(folder: &Path) -> Self {
        let program = |name: &str| folder.join(name).into_os_string();
        Self {
            sbatch: program("sbatch"),
            squeue: program("squeue"),
            scontrol: program("scontrol"),
            sacct: program("sacct"),
            scancel: program("scancel"),
        }
    }

    /// Submits a batch script with options.
    pub(super) fn submit(&self, options: &[String], script: &Path) -> Result<Submitted, Error> {
        let mut arguments: Vec<OsString> = options.iter().map(OsString::from).collect();
        arguments.push(script.into());
        let output = run(&self.sbatch, &arguments)?;
        if !output.status.success() {
            return Err(output.refused());
        }
        parse::submitted(&output.stdout)
    }

    /// Lines about the tasks of a job that have not ended; none when Slurm does not know
    /// the job, or does not know it any more.
    pub(super) fn active(&self, job: &Submitted) -> Result<Vec<Line>, Error> {
        let mut arguments = with_cluster(job);
        arguments.extend([
            "--noheader".into(),
            format!("--jobs={}", job.job),
            format!("--format={}", parse::SQUEUE_FORMAT),
        ]);
        run(&self.squeue, &arguments)?.about_job(parse::squeue)
    }

    /// Lines of the controller about a job, ended tasks included; it forgets them after some
    /// minutes (`MinJobAge`).
    pub(super) fn remembered(&self, job: &Submitted) -> Result<Vec<Line>, Error> {
        let mut arguments = with_cluster(job);
        arguments.extend([
            "--oneliner".into(),
            "show".into(),
            "job".into(),
            job.job.to_string(),
        ]);
        run(&self.scontrol, &arguments)?.about_job(parse::scontrol)
    }

    /// Lines of the accounting about a job. Not every site has one: then there are none.
    pub(super) fn accounted(&self, job: &Submitted) -> Result<Vec<Line>, Error> {
        let mut arguments = with_cluster(job);
        arguments.extend([
            "--noheader".into(),
            "--parsable2".into(),
            "--allocations".into(),
            format!("--jobs={}", job.job),
            format!("--format={}", parse::SACCT_FORMAT),
        ]);
        match run(&self.sacct, &arguments) {
            Ok(output) if output.status.success() => parse::sacct(&output.stdout),
            // Without accounting it fails, each version in its own words.
            Ok(_) | Err(Error::Missing { .. }) => Ok(Vec::new()),
            Err(error) => Err(error),
        }
    }

    /// Ends a job, what runs and what waits. One that has ended already is as good.
    pub(super) fn cancel(&self, job: &Submitted) -> Result<(), Error> {
        let mut arguments = with_cluster(job);
        arguments.push(job.job.to_string());
        let output = run(&self.scancel, &arguments)?;
        if output.status.success() || output.unknown_job() {
            Ok(())
        } else {
            Err(output.failed())
        }
    }
}

fn with_cluster(job: &Submitted) -> Vec<String> {
    let cluster = job.cluster.iter();
    cluster.map(|name| format!("--clusters={name}")).collect()
}

/// The result of a command.
struct Output {
    program: String,
    status: ExitStatus,
    stdout: String,
    stderr: String,
}

impl Output {
    /// Lines about a job; none when Slurm does not know it, or not any more.
    fn about_job(self, read: fn(&str) -> Result<Vec<Line>, Error>) -> Result<Vec<Line>, Error> {
        if self.status.success() {
            read(&self.stdout)
        } else if self.unknown_job() {
            Ok(Vec::new())
        } else {
            Err(self.failed())
        }
    }

    fn unknown_job(&self) -> bool {
        let said = self.stderr.to_lowercase();
        ["invalid job id", "invalid job_id"]
            .iter()
            .any(|phrase| said.contains(phrase))
    }

    fn refused(self) -> Error {
        Error::Refused {
            program: self.program,
            message: self.stderr.trim().to_owned(),
        }
    }

    fn failed(self) -> Error {
        let said = self.stderr.trim();
        let message = if said.is_empty() {
            self.status.to_string()
        } else {
            said.to_owned()
        };
        Error::Failed {
            program: self.program,
            message,
        }
    }
}

/// The variables with which people set options of the commands that are asked here. What
/// says where the cluster is (`SLURM_CONF`, …) and what a job needs (`SBATCH_PARTITION`, …)
/// stays.
fn is_in_the_way(variable: &OsStr) -> bool {
    const PREFIXES: [&str; 4] = ["SQUEUE_", "SACCT_", "SCONTROL_", "SCANCEL_"];
    const NAMES: [&str; 4] = [
        "SBATCH_ARRAY_INX",
        "SBATCH_WAIT",
        "SBATCH_OUTPUT",
        "SBATCH_ERROR",
    ];
    let name = variable.to_string_lossy();
    NAMES.contains(&&*name) || PREFIXES.iter().any(|prefix| name.starts_with(prefix))
}

fn run<S: AsRef<OsStr>>(program: &OsStr, arguments: &[S]) -> Result<Output, Error> {
    let name = PathBuf::from(program).display().to_string();
    let failed = |error: &std::io::Error| Error::Failed {
        program: name.clone(),
        message: error.to_string(),
    };
    let mut command = Command::new(program);
    for (variable, _) in std::env::vars_os() {
        if is_in_the_way(&variable) {
            command.env_remove(variable);
        }
    }
    command
        .args(arguments)
        .env("LC_ALL", "C")
        // Lists of tasks in full, whatever their length.
        .env("SLURM_BITSTR_LEN", "0")
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    let mut child = command.spawn().map_err(|error| match error.kind() {
        ErrorKind::NotFound => Error::Missing {
            program: name.clone(),
        },
        _ => failed(&error),
    })?;
    let (stdout, stderr) = (reader(child.stdout.take()), reader(child.stderr.take()));
    let started = Instant::now();
    let mut pause = Duration::from_millis(1);
    let status = loop {
        if let Some(status) = child.try_wait().map_err(|error| failed(&error))? {
            break status;
        }
        if started.elapsed() > PATIENCE {
            let _ = child.kill();
            let _ = child.wait();
            return Err(Error::Failed {
                program: name,
                message: format!("no answer within {} s", PATIENCE.as_secs()),
            });
        }
        thread::sleep(pause);
        pause = (pause * 2).min(Duration::from_millis(50));
    };
    let text = |reader: thread::JoinHandle<Vec<u8>>| {
        String::from_utf8_lossy(&reader.join().unwrap_or_default()).into_owned()
    };
    Ok(Output {
        program: name,
        status,
        stdout: text(stdout),
        stderr: text(stderr),
    })
}

/// Reads a pipe on a thread, so that the other one cannot fill up meanwhile.
fn reader<R: Read + Send + 'static>(pipe: Option<R>) -> thread::JoinHandle<Vec<u8>> {
    thread::spawn(move || {
        let mut bytes = Vec::new();
        if let Some(pipe) = pipe {
            let _ = pipe.take(OUTPUT_LIMIT).read_to_end(&mut bytes);
        }
        bytes
    })
}
