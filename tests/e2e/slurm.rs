//! `fleetyard bench … --executor slurm` and `fleetyard jobs` on a real Slurm: a cluster of
//! one node that `tests/slurm/cluster.sh` starts on this machine, and that ends with the test.
//!
//! Skipped, with the reason, where Slurm's daemons are not installed or the test is not root.

use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc;
use std::thread;
use std::time::{Duration, Instant};

use fleetyard_bench::{COLUMNS, Row, Store, Value};
use fleetyard_testkit::{INPUT, NO_PLAN, SUCCESS, USAGE, Yard, root};
use serde_json::Value as Json;

/// Nothing on a cluster of one node takes longer, on however busy a machine.
const PATIENCE: Duration = Duration::from_mins(2);

/// A cluster that lives as long as this.
struct Cluster {
    script: Child,
    conf: String,
}

impl Cluster {
    /// Starts one, or says why there is none.
    fn start(folder: &Path) -> Option<Self> {
        let mut script = Command::new(root().join("tests/slurm/cluster.sh"))
            .arg(folder)
            .arg("4")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let stdout = BufReader::new(script.stdout.take().unwrap());
        let (tell, told) = mpsc::channel();
        thread::spawn(move || {
            let _ = tell.send(stdout.lines().next());
        });
        // The script gives up by itself; this is for the case that it hangs.
        let first = told.recv_timeout(PATIENCE).ok().flatten();
        let mut cluster = Self {
            script,
            conf: String::new(),
        };
        if let Some(Ok(line)) = first {
            let conf = line.strip_prefix("export SLURM_CONF=").unwrap();
            conf.clone_into(&mut cluster.conf);
            return Some(cluster);
        }
        let code = cluster.end();
        let mut said = String::new();
        let stderr = cluster.script.stderr.take().unwrap();
        // Daemons that were left would hold it open.
        let _ = stderr.take(1 << 16).read_to_string(&mut said);
        assert_eq!(code, Some(77), "the cluster does not start: {said}");
        eprintln!("skipped: {}", said.trim());
        None
    }

    /// Lets the script end its daemons, which it does when its input ends.
    fn end(&mut self) -> Option<i32> {
        drop(self.script.stdin.take());
        let started = Instant::now();
        while started.elapsed() < Duration::from_secs(40) {
            if let Ok(Some(status)) = self.script.try_wait() {
                return status.code();
            }
            thread::sleep(Duration::from_millis(20));
        }
        // Its daemons get a signal with its death.
        let _ = self.script.kill();
        let _ = self.script.wait();
        None
    }
}

impl Drop for Cluster {
    fn drop(&mut self) {
        self.end();
    }
}

/// A planner that waits for as long as there is a file `hold` beside it.
const WAITING: &str = r#"#!/usr/bin/env python3
import os, sys, time
sys.path.insert(0, "PYTHON")
import fleetyard

class Waiting(fleetyard.Planner):
    id = "waiting"
    capabilities = ("grid", "pebble")

    def plan(self, instance, budget, context):
        while os.path.exists(os.path.join(os.path.dirname(os.path.abspath(__file__)), "hold")):
            time.sleep(0.05)
        return [[start] for start in instance.starts]

fleetyard.run(Waiting)
"#;

/// Folder of the Python package, which nobody has to install for the tests.
fn python() -> String {
    root().join("abi/python").display().to_string()
}

fn suite(yard: &Yard, name: &str, planners: &[&str], agents: &str) {
    let scen = root().join("maps/empty-16-16-random-1.scen");
    let planners: Vec<String> = planners
        .iter()
        .map(|plugin| format!("[[planner]]\nplugin = \"{plugin}\"\n"))
        .collect();
    let text = format!(
        "name = \"{name}\"\n[budget]\nwall = \"100s\"\nmemory = \"256MiB\"\n[sandbox]\nread = [\"{}\"]\n{}\
         [[instances]]\nscen = [\"{}\"]\nagents = {agents}\n",
        python(),
        planners.join(""),
        scen.display(),
    );
    yard.write(&format!("{name}.toml"), text);
}

/// The part of a trial that is the same wherever and whenever it is made. Slurm's daemons may be in
/// other control groups than this test: the limits that the kernel enforces depend on the place.
fn lasting(store: &Path) -> Vec<String> {
    const OF_THE_PLACE: [&str; 8] = [
        "rtf",
        "peak_memory_kb",
        "contended",
        "contended_by_others",
        "attempts",
        "machine",
        "limits_watched",
        "cpus",
    ];
    let of_the_moment = |name: &str| name.ends_with("_ms") || OF_THE_PLACE.contains(&name);
    let line = |row: Row| {
        let values = COLUMNS.iter().zip(row.values());
        let values =
            values.filter(|(column, _)| !of_the_moment(column.name) || column.name == "budget_ms");
        let words: Vec<String> = values
            .map(|(column, value)| match value {
                Value::Null => format!("{}=", column.name),
                other => format!("{}={other:?}", column.name),
            })
            .collect();
        words.join("\n")
    };
    let rows = Store::open_read_only(store).unwrap().rows().unwrap();
    let mut lines: Vec<String> = rows.into_iter().map(line).collect();
    lines.sort();
    lines
}

/// Two stores hold the same; where they do not, only the columns that differ are shown.
#[track_caller]
fn assert_same(found: &[String], expected: &[String]) {
    let mut differences = Vec::new();
    for (found, expected) in found.iter().zip(expected) {
        let columns = found.lines().zip(expected.lines());
        differences.extend(columns.filter(|(one, other)| one != other));
    }
    assert_eq!(found.len(), expected.len());
    assert!(differences.is_empty(), "{differences:#?}");
}

fn status(yard: &Yard, run: &str) -> Json {
    let line = format!("jobs status {run} --format json");
    yard.line(&line).expect(SUCCESS).json()
}

fn states(status: &Json) -> Vec<&str> {
    let shards = status["shards"].as_array().unwrap().iter();
    shards
        .map(|shard| shard["state"].as_str().unwrap())
        .collect()
}

/// Asks until the shards are as they should be.
#[track_caller]
fn until(yard: &Yard, run: &str, wanted: &[&str]) -> Json {
    let started = Instant::now();
    loop {
        let status = status(yard, run);
        if states(&status) == wanted {
            return status;
        }
        assert!(started.elapsed() < PATIENCE, "not {wanted:?}: {status:#}");
        thread::sleep(Duration::from_millis(100));
    }
}

#[test]
fn suites_on_a_cluster() {
    let yard = Yard::new();
    let Some(cluster) = Cluster::start(&yard.path("cluster")) else {
        return;
    };
    let yard = yard.set("SLURM_CONF", &cluster.conf);
    a_suite_comes_to_its_end(&yard);
    shards_that_were_killed_go_on(&yard);
    what_slurm_refuses_is_said(&yard);
}

fn a_suite_comes_to_its_end(yard: &Yard) {
    suite(yard, "whole", &["pibt", "astar"], "[1, 2, 3]");
    let submit = "bench whole.toml --executor slurm --cpus-per-task 1";
    let ended = yard
        .line(&format!("{submit} --detach --max-running 2"))
        .expect(SUCCESS);
    assert!(
        ended.stdout.contains("fleetyard jobs wait whole.run"),
        "{ended}"
    );
    let waited = yard.line("jobs wait whole.run").expect(SUCCESS);
    let found = status(yard, "whole.run");
    assert_eq!(states(&found), ["completed"; 3], "{waited}");
    assert_eq!((&found["done"], &found["trials"]), (&6.into(), &6.into()));
    assert_eq!(found["complete"], true);
    let merged = yard.line("jobs merge whole.run").expect(SUCCESS);
    assert!(merged.stdout.starts_with("6 trials in "), "{merged}");

    yard.line("bench whole.toml --store local.sqlite")
        .expect(SUCCESS);
    let local = lasting(&yard.path("local.sqlite"));
    assert_eq!(local.len(), 6);
    assert_same(&lasting(&yard.path("whole.sqlite")), &local);

    // The store is there now; another one, submitted and waited for and merged in one go.
    let ended = yard.line(submit).expect(INPUT);
    assert!(ended.stderr.contains("--store"), "{ended}");
    yard.line(&format!("{submit} --shards 2 --store again.sqlite"))
        .expect(SUCCESS);
    assert_same(&lasting(&yard.path("again.sqlite")), &local);
}

fn shards_that_were_killed_go_on(yard: &Yard) {
    fs::create_dir(yard.path("plugin")).unwrap();
    let plugin = yard.write("plugin/waiting.py", WAITING.replace("PYTHON", &python()));
    fs::set_permissions(&plugin, std::os::unix::fs::PermissionsExt::from_mode(0o755)).unwrap();
    let hold = yard.write("plugin/hold", "");
    suite(yard, "killed", &["pibt", "./plugin/waiting.py"], "[2, 3]");
    yard.line("bench killed.toml --executor slurm --cpus-per-task 1 --detach")
        .expect(SUCCESS);
    let found = until(yard, "killed.run", &["running", "running"]);
    assert_eq!(found["shards"][0]["node"], "one");

    // As if its node's memory was full: nobody can say anything any more.
    let task = found["shards"][0]["task"].as_str().unwrap().to_owned();
    let kill = format!("scancel --signal=KILL --batch {task}");
    yard.shell(&kill).expect(SUCCESS);
    let found = until(yard, "killed.run", &["failed", "running"]);
    assert_eq!(found["shards"][0]["signal"], "KILL", "{found:#}");
    let ended = yard.line("jobs merge killed.run").expect(INPUT);
    assert!(ended.stderr.contains("1 running, 1 failed"), "{ended}");

    let ended = yard.line("jobs cancel killed.run").expect(SUCCESS);
    assert_eq!(ended.stdout, "1 shard cancelled\n");
    until(yard, "killed.run", &["failed", "cancelled"]);
    let ended = yard.line("jobs wait killed.run").expect(NO_PLAN);
    assert!(ended.stderr.contains("fleetyard jobs requeue"), "{ended}");

    // What does not wait was done before, and is not done again.
    fs::remove_file(hold).unwrap();
    let ended = yard
        .line("jobs requeue killed.run --max-running 2")
        .expect(SUCCESS);
    assert!(
        ended.stdout.starts_with("2 shards submitted as job"),
        "{ended}"
    );
    yard.line("jobs wait killed.run").expect(SUCCESS);
    let ended = yard.line("jobs requeue killed.run").expect(SUCCESS);
    assert!(ended.stdout.starts_with("no shard"), "{ended}");
    yard.line("jobs merge killed.run").expect(SUCCESS);
    assert_eq!(lasting(&yard.path("killed.sqlite")).len(), 4);
}

fn what_slurm_refuses_is_said(yard: &Yard) {
    let submit = "bench whole.toml --executor slurm --store refused.sqlite --detach";
    let ended = yard
        .line(&format!("{submit} --partition nowhere"))
        .expect(USAGE);
    assert!(ended.stderr.contains("invalid partition"), "{ended}");
    assert!(!yard.path("refused.run").exists());
    let ended = yard
        .line(&format!("{submit} --slurm-option array=1-9"))
        .expect(USAGE);
    assert!(
        ended.stderr.contains("`--array` is set by fleetyard"),
        "{ended}"
    );

    // A partition that is down takes jobs and starts none.
    yard.line(&format!("{submit} --partition closed"))
        .expect(SUCCESS);
    let found = until(yard, "refused.run", &["pending"; 3]);
    assert_eq!(found["shards"][2]["reason"], "PartitionDown");
    let ended = yard.line("jobs cancel refused.run").expect(SUCCESS);
    assert_eq!(ended.stdout, "3 shards cancelled\n");
    until(yard, "refused.run", &["cancelled"; 3]);
    let ended = yard.line("jobs merge refused.run --partial").expect(INPUT);
    assert!(ended.stderr.contains("has a store"), "{ended}");
}

#[test]
fn without_slurm_it_says_so() {
    let yard = Yard::new().set("FLEETYARD_SBATCH", "/nowhere/sbatch");
    suite(&yard, "none", &["pibt"], "[1]");
    let ended = yard.line("bench none.toml --executor slurm").expect(USAGE);
    assert!(
        ended.stderr.contains("/nowhere/sbatch is not there"),
        "{ended}"
    );
    assert!(ended.stderr.contains("hint: "), "{ended}");
    for command in ["status", "wait", "cancel", "requeue", "merge"] {
        let ended = yard.line(&format!("jobs {command} {{here}}")).expect(INPUT);
        assert!(ended.stderr.contains("not the folder of a run"), "{ended}");
    }
}
