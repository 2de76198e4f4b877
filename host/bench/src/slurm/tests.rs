//! A run against commands that say what the test wants, and its script against a shell.

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{Mutex, MutexGuard, PoisonError};

use tempfile::TempDir;

use super::*;

/// Programs that print what is in a file beside them.
struct Cluster {
    folder: TempDir,
    /// A program that is being written cannot be started, and a child of another thread may
    /// have inherited the file.
    _alone: MutexGuard<'static, ()>,
}

impl Cluster {
    fn new() -> Self {
        static ALONE: Mutex<()> = Mutex::new(());
        let alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
        // Whatever a path may have, a script and its commands take it.
        let folder = tempfile::Builder::new()
            .prefix("run of 'a' \"b\" $c %d ")
            .tempdir()
            .unwrap();
        let cluster = Self {
            folder,
            _alone: alone,
        };
        cluster.program(
            "sbatch",
            "printf '%s\\n' \"$@\" >\"$here/sbatch.args\"\n\
             [ ! -e \"$here/refuse\" ] || { cat \"$here/refuse\" >&2; exit 1; }\n\
             cat \"$here/job\"",
        );
        let unknown = "slurm_load_jobs error: Invalid job id specified";
        for name in ["squeue", "scontrol"] {
            cluster.program(
                name,
                &format!(
                    "cat \"$here/{name}.out\" 2>/dev/null || {{ echo '{unknown}' >&2; exit 1; }}"
                ),
            );
        }
        cluster.program(
            "sacct",
            "cat \"$here/sacct.out\" 2>/dev/null || { echo 'Slurm accounting storage is disabled' >&2; exit 1; }",
        );
        cluster.program("scancel", "printf '%s\\n' \"$@\" >>\"$here/scancel.args\"");
        cluster.program(
            "fleetyard",
            "printf '%s\\n' \"$@\"; exit \"$(cat \"$here/code\")\"",
        );
        cluster.write("suite.toml", "name = \"s\"\n");
        cluster.write("job", "100\n");
        cluster
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn write(&self, name: &str, content: &str) {
        fs::write(self.path(name), content).unwrap();
    }

    fn program(&self, name: &str, body: &str) {
        self.write(name, &format!("#!/bin/sh\nhere=${{0%/*}}\n{body}\n"));
        fs::set_permissions(self.path(name), fs::Permissions::from_mode(0o755)).unwrap();
    }

    fn slurm(&self) -> Slurm {
        Slurm::in_folder(self.folder.path())
    }

    fn request(&self, shards: usize) -> Request {
        Request {
            run: self.path("run"),
            name: "a suite".into(),
            suite: self.path("suite.toml"),
            executable: self.path("fleetyard"),
            arguments: vec!["--lock".into(), "my lock".into()],
            store: self.path("s.sqlite"),
            trials: vec![10; shards],
            resources: Resources {
                max_running: Some(2),
                partition: Some("short".into()),
                ..Resources::default()
            },
        }
    }

    fn submit(&self, shards: usize) -> Run {
        Run::submit(&self.request(shards), &self.slurm()).unwrap()
    }

    fn lines(&self, name: &str) -> Vec<String> {
        let text = fs::read_to_string(self.path(name)).unwrap_or_default();
        text.lines().map(str::to_owned).collect()
    }

    /// Writes the file that a task leaves when it ends.
    fn ended(&self, job: u32, shard: u32, code: u32, signal: &str) {
        self.write(
            &format!("run/shards/{shard}.exit"),
            &format!(r#"{{"job": {job}, "code": {code}, "signal": "{signal}", "node": "n1"}}"#),
        );
    }

    /// Runs the batch script as Slurm would; the code and what it printed.
    fn task(&self, shard: u32) -> (i32, String) {
        let output = Command::new("sh")
            .arg(self.path("run/run.sh"))
            .env("SLURM_ARRAY_JOB_ID", "100")
            .env("SLURM_ARRAY_TASK_ID", shard.to_string())
            .env("SLURMD_NODENAME", "n1")
            .output()
            .unwrap();
        let text = [output.stdout, output.stderr].concat();
        let text = String::from_utf8(text).unwrap();
        (output.status.code().unwrap(), text)
    }
}

fn states(status: &Status) -> Vec<ShardState> {
    status.shards.iter().map(|shard| shard.state).collect()
}

#[test]
fn a_submission_is_an_array_of_all_shards() {
    let cluster = Cluster::new();
    let run = cluster.submit(3);
    let arguments = cluster.lines("sbatch.args");
    assert!(
        arguments.contains(&"--array=1-3%2".to_owned()),
        "{arguments:?}"
    );
    assert!(arguments.contains(&"--partition=short".to_owned()));
    assert!(arguments.contains(&"--job-name=fleetyard-a-suite".to_owned()));
    assert_eq!(run.jobs(), [100]);
    let again = Run::open(&cluster.path("run")).unwrap();
    assert_eq!(again.store(), run.store());
    // Slurm says nothing yet.
    cluster.write(
        "squeue.out",
        "100_[1-3%2]|PENDING|fleetyard-a-suite||Priority\n",
    );
    let status = again.status(&cluster.slurm());
    assert_eq!(states(&status), [ShardState::Pending; 3]);
    assert_eq!(status.shards[0].reason.as_deref(), Some("Priority"));
    assert_eq!(status.summary(), "3 pending");
    assert_eq!((status.done(), status.trials()), (0, 30));

    // The folder belongs to this run.
    let error = Run::submit(&cluster.request(3), &cluster.slurm()).unwrap_err();
    assert!(error.hint().unwrap().contains("jobs requeue"), "{error}");
}

#[test]
fn a_refusal_is_shown_and_leaves_nothing() {
    let cluster = Cluster::new();
    cluster.write(
        "refuse",
        "sbatch: error: invalid partition specified: short\n",
    );
    let error = Run::submit(&cluster.request(3), &cluster.slurm()).unwrap_err();
    assert!(error.to_string().contains("invalid partition"), "{error}");
    assert!(!cluster.path("run").exists());

    fs::remove_file(cluster.path("sbatch")).unwrap();
    let error = Run::submit(&cluster.request(3), &cluster.slurm()).unwrap_err();
    assert!(matches!(error, Error::Missing { .. }), "{error}");
    assert!(!cluster.path("run").exists());

    let mut request = cluster.request(0);
    assert!(Run::submit(&request, &cluster.slurm()).is_err());
    request.trials = vec![1];
    request.suite = cluster.path("no.toml");
    assert!(Run::submit(&request, &cluster.slurm()).is_err());
}

#[test]
fn tasks_say_how_they_ended() {
    let cluster = Cluster::new();
    let run = cluster.submit(3);
    cluster.write("code", "0");
    let (code, said) = cluster.task(1);
    assert_eq!(code, 0, "{said}");
    let folder = cluster.path("run/shards/1.sqlite").display().to_string();
    let words: Vec<&str> = said.lines().collect();
    let suite = cluster.path("suite.toml").display().to_string();
    let progress = cluster.path("run/shards/1.progress").display().to_string();
    assert_eq!(
        words,
        [
            "bench",
            suite.as_str(),
            "--shard",
            "1/3",
            "--store",
            &folder,
            "--resume",
            "--progress-file",
            &progress,
            "--lock",
            "my lock"
        ]
    );
    cluster.write("code", "3");
    assert_eq!(cluster.task(2).0, 3);
    // Killed: nothing is left. The accounting is none, the controller remembers.
    let line = |task: u32, state: &str, exit: &str| {
        format!(
            "JobId=10{task} ArrayJobId=100 ArrayTaskId={task} JobName=fleetyard-a-suite \
             JobState={state} Reason=None ExitCode={exit} NodeList=n2\n"
        )
    };
    cluster.write("squeue.out", "");
    cluster.write("scontrol.out", &line(3, "FAILED", "0:9"));
    let status = run.status(&cluster.slurm());
    assert_eq!(
        states(&status),
        [
            ShardState::Completed,
            ShardState::Failed,
            ShardState::Failed
        ]
    );
    assert_eq!(status.shards[1].exit_code, Some(3));
    assert_eq!(status.shards[1].node.as_deref(), Some("n1"));
    assert_eq!(status.shards[2].signal.as_deref(), Some("KILL"));
    assert_eq!(status.shards[2].node.as_deref(), Some("n2"));
    assert!(status.has_ended() && !status.is_complete());
    assert_eq!(status.unanswered, None);

    // What is started has to be what was submitted.
    cluster.write("suite.toml", "name = \"t\"\n");
    let (code, said) = cluster.task(1);
    assert_eq!(code, 82, "{said}");
    assert!(
        said.contains("suite.toml is not what was submitted"),
        "{said}"
    );
    cluster.program("fleetyard", "exit 0");
    let (code, said) = cluster.task(1);
    assert_eq!(code, 82, "{said}");
    assert!(said.contains("do not build or install over it"), "{said}");
    assert_eq!(
        run.status(&cluster.slurm()).shards[0].state,
        ShardState::Failed
    );
    fs::remove_file(cluster.path("fleetyard")).unwrap();
    let (code, said) = cluster.task(1);
    assert_eq!(code, 81, "{said}");
}

#[test]
fn slurm_is_asked_about_what_left_nothing() {
    let cluster = Cluster::new();
    let run = cluster.submit(8);
    // A signal says that somebody ended it, and not who.
    cluster.ended(100, 1, 143, "TERM");
    cluster.ended(100, 2, 0, "");
    cluster.write("run/shards/3.progress", r#"{"done": 4, "trials": 10}"#);
    // Of another array, and no JSON: both say nothing.
    cluster.ended(99, 4, 0, "");
    cluster.write("run/shards/5.exit", "{\"job\": 100, \"code\": 0");
    cluster.write(
        "squeue.out",
        "100_3|RUNNING|fleetyard-a-suite|n3|None\n\
         100_4|RUNNING|somebody-else|n3|None\n\
         100_6|NEW_STATE|fleetyard-a-suite|n3|None\n",
    );
    cluster.write(
        "sacct.out",
        "100_1|TIMEOUT|0:0|n1|fleetyard-a-suite\n\
         100_4|NODE_FAIL|1:0|n4|fleetyard-a-suite\n\
         100_5|OUT_OF_MEMORY|0:125|n5|fleetyard-a-suite\n\
         100_7|CANCELLED by 0|0:0|None assigned|fleetyard-a-suite\n\
         100_8|COMPLETED|0:0|n8|somebody-else\n",
    );
    let status = run.status(&cluster.slurm());
    assert_eq!(
        states(&status),
        [
            ShardState::Timeout,
            ShardState::Completed,
            ShardState::Running,
            ShardState::NodeFail,
            ShardState::OutOfMemory,
            ShardState::Running,
            ShardState::Cancelled,
            ShardState::Vanished,
        ]
    );
    assert_eq!(status.shards[2].done, 4);
    assert!(!status.has_ended());

    // The folder of the run is not on the node.
    cluster.write("sacct.out", "100_8|FAILED|0:53|n8|fleetyard-a-suite\n");
    let status = run.status(&cluster.slurm());
    let reason = status.shards[7].reason.clone().unwrap();
    assert!(reason.contains("is it visible there"), "{reason}");
    cluster.write("sacct.out", "100_8|COMPLETED|0:0|n8|fleetyard-a-suite\n");
    assert_eq!(
        run.status(&cluster.slurm()).shards[7].state,
        ShardState::Unseen
    );

    // A controller that does not answer: what the folder says, and nothing is concluded.
    cluster.program(
        "squeue",
        "echo 'Unable to contact slurm controller' >&2; exit 1",
    );
    let status = run.status(&cluster.slurm());
    assert!(status.unanswered.unwrap().contains("Unable to contact"));
    assert_eq!(status.shards[1].state, ShardState::Completed);
    assert_eq!(status.shards[7].state, ShardState::Pending);
}

#[test]
fn what_is_missing_is_submitted_again() {
    let cluster = Cluster::new();
    let mut run = cluster.submit(5);
    cluster.write("squeue.out", "100_4|RUNNING|fleetyard-a-suite|n3|None\n");
    cluster.write("scontrol.out", "");
    cluster.ended(100, 1, 0, "");
    cluster.ended(100, 2, 3, "");
    cluster.write("job", "200\n");
    let more = Resources {
        time: Some(std::time::Duration::from_hours(2)),
        ..Resources::default()
    };
    let shards = run.requeue(&cluster.slurm(), &more).unwrap();
    assert_eq!(shards, [2, 3, 5]);
    let arguments = cluster.lines("sbatch.args");
    assert!(
        arguments.contains(&"--array=2-3,5%2".to_owned()),
        "{arguments:?}"
    );
    assert!(arguments.contains(&"--time=0-02:00:00".to_owned()));
    assert!(arguments.contains(&"--partition=short".to_owned()));

    // How the first array ended does not matter to the second.
    cluster.program(
        "squeue",
        "case \"$*\" in *jobs=200*) echo '200_[2-3,5%2]|PENDING|fleetyard-a-suite||None' ;; esac",
    );
    cluster.ended(100, 4, 0, "");
    let status = run.status(&cluster.slurm());
    let pending = ShardState::Pending;
    let completed = ShardState::Completed;
    assert_eq!(
        states(&status),
        [completed, pending, pending, completed, pending]
    );
    assert_eq!(status.shards[1].task.as_deref(), Some("200_2"));
    assert_eq!(run.requeue(&cluster.slurm(), &more).unwrap(), [0u32; 0]);
    assert_eq!(run.log(2).unwrap(), cluster.path("run/logs/2-200.log"));

    assert_eq!(run.cancel(&cluster.slurm()).unwrap(), 3);
    assert_eq!(cluster.lines("scancel.args"), ["200"]);

    for shard in [2, 3, 5] {
        cluster.ended(200, shard, 0, "");
    }
    // Nobody needs to be asked any more.
    fs::remove_file(cluster.path("squeue")).unwrap();
    let status = run.wait(&cluster.slurm(), |_| {}).unwrap();
    assert!(status.is_complete());

    // Trials of two states of a suite are not mixed.
    cluster.ended(200, 5, 1, "");
    cluster.program("squeue", "true");
    cluster.write("suite.toml", "name = \"t\"\n");
    let error = run.requeue(&cluster.slurm(), &more).unwrap_err();
    assert!(
        error
            .to_string()
            .contains("suite.toml is not what was submitted"),
        "{error}"
    );
}

#[test]
fn a_run_of_another_hand_is_refused() {
    let cluster = Cluster::new();
    cluster.submit(2);
    let file = cluster.path("run/job.json");
    let good = fs::read_to_string(&file).unwrap();
    let wrong = |from: &str, to: &str| {
        assert!(good.contains(from), "{from} in {good}");
        fs::write(&file, good.replacen(from, to, 1)).unwrap();
        Run::open(Path::new(&cluster.path("run")))
            .unwrap_err()
            .to_string()
    };
    assert!(wrong("fleetyard.job/1", "fleetyard.job/2").contains("job.json:2:"));
    assert!(wrong("\"cluster\"", "\"clusters\"").contains("clusters"));
    let error = wrong("      1,", "      7,");
    assert!(error.contains("no shard 7 of 2"), "{error}");
    assert!(wrong("{", "").contains("not a JSON object"));
    fs::remove_file(&file).unwrap();
    let error = Run::open(&cluster.path("run")).unwrap_err();
    assert!(
        error.to_string().contains("not the folder of a run"),
        "{error}"
    );
}
