//! System calls of the host that fail: every call that it makes for a run, for the trials of a
//! suite and for a fleet can go wrong, one at a time. Nothing hangs, nothing is lost, no process
//! and no file stays, and who says that all went well is right.
//!
//! A point is a call: the n-th `openat` of the host, or of the first supervisor, and an error that it may
//! have. A first run without an error counts them. Here a sample of them is tried that is the same
//! every time; `FLEETYARD_FAULTS=all` tries every one and says how many that were and what came of
//! them, `FLEETYARD_FAULTS=1000` as many of each scenario, and
//! `FLEETYARD_FAULTS=run/host/openat/EMFILE/12` those whose names begin so.

#[path = "faults/inject.rs"]
mod inject;
mod rows;

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::os::unix::fs::{DirBuilderExt, MetadataExt};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use fleetyard_bench::{Row, Store};
use fleetyard_testkit::{Ended, SUCCESS, Yard, fleetyard, instance, map, root, words};
use inject::{Census, Point, Wrong};
use serde_json::Value;

/// `all`, how many, or the beginning of a point.
const ASKED: &str = "FLEETYARD_FAULTS";

/// A file for what came of every point.
const LOG: &str = "FLEETYARD_FAULTS_LOG";

/// Points of a scenario that are tried unless all are asked for.
const SAMPLE: usize = 40;

/// Points of a run that are tried every time: each of them once was the end of it, or left a
/// record that was not true.
const ONCE: &[&str] = &[
    // Nobody was told that it was the other's turn.
    "host/sendto/ENOMEM/",
    "host/recvfrom/EIO/",
    "supervisor-1/sendto/ENOMEM/",
    "supervisor-1/ppoll/ENOMEM/",
    "inside-1.1/sendmsg/",
    "plugin-1.1/sendmsg/",
    // The plugin was blamed.
    "inside-1.1/ppoll/ENOMEM/",
    "plugin-1.1/read/EIO/",
    // It was not alone in its session, or had what its supervisor has open.
    "plugin-1.1/setsid/",
    "plugin-1.1/close_range/",
    // It kept groups and capabilities.
    "inside-1.1/setgroups/",
    "plugin-1.1/prctl/EPERM/1",
];

/// Calls that make a layer of the sandbox, by who makes them. When one fails, the layer is none.
const LAYERS: &[(&str, &[&str])] = &[
    (
        "inside",
        &[
            "mount",
            "mount_setattr",
            "move_mount",
            "pivot_root",
            "setgroups",
            "setresgid",
            "setresuid",
        ],
    ),
    (
        "plugin",
        &[
            "capset",
            "landlock_add_rule",
            "landlock_restrict_self",
            "prlimit64",
            "seccomp",
        ],
    ),
];

/// Time by which processes may outlive the command that started them, when it ended before its
/// time.
const LEAVING: Duration = Duration::from_secs(10);

/// A command to run, and the results that it has to have.
struct Scenario {
    name: &'static str,
    arguments: String,
    /// Files of the user.
    given: Vec<(&'static str, String)>,
    /// The calls that go wrong, and their faults.
    points: fn(&Census) -> Vec<Point>,
    /// Compares what a try left with what an undisturbed run did.
    judge: fn(&Try<'_>, &mut Vec<String>),
}

/// One run with a call that went wrong.
struct Try<'a> {
    point: &'a Point,
    arguments: &'a str,
    yard: &'a Yard,
    ended: &'a Ended,
    usual: &'a Usual,
}

/// Results of an undisturbed run.
struct Usual {
    stdout: Value,
    files: BTreeMap<String, Vec<u8>>,
    rows: Vec<String>,
}

/// A folder in which the command keeps its state, apart from that of other tests.
fn yard(scenario: &Scenario) -> Yard {
    let yard = Yard::new();
    let state = yard.path("state");
    fs::DirBuilder::new().mode(0o700).create(&state).unwrap();
    for (name, content) in &scenario.given {
        yard.write(name, content);
    }
    yard.set("XDG_RUNTIME_DIR", &state.display().to_string())
}

/// A command that has ended.
struct Run {
    /// The beginning of the names of its runs.
    host: String,
    /// State that others had left before.
    before: BTreeSet<String>,
    ended: Ended,
    census: Census,
    spoiled: bool,
}

/// Runs a scenario, and lets a call go wrong.
fn run(scenario: &Scenario, yard: &Yard, point: Option<&Point>) -> Run {
    let arguments = words(&scenario.arguments);
    let program = fleetyard();
    let before = state(yard, "");
    let started = yard.start_with(program, &arguments, inject::prepare);
    let host = started.child.id();
    let mut seen = None;
    let ended = started.wait_by(|started| {
        let followed = inject::follow(host, point, || started.stop()).unwrap();
        let since = Instant::now();
        while since.elapsed() < LEAVING && !started.processes().is_empty() {
            thread::sleep(Duration::from_millis(5));
        }
        seen = Some((followed.census, followed.spoiled));
        followed.status
    });
    let (census, spoiled) = seen.unwrap();
    Run {
        host: format!("{host}-"),
        before,
        ended,
        census,
        spoiled,
    }
}

// ---- What is left ------------------------------------------------------------------

/// The state that a host keeps of its runs: notes, scratch folders and control groups. Of those of
/// other commands, the ones that begin with the number of its process.
fn state(yard: &Yard, host: &str) -> BTreeSet<String> {
    let user = fs::metadata("/proc/self").unwrap().uid();
    let own = yard.path("state/fleetyard");
    let others = [
        format!("/run/user/{user}/fleetyard"),
        format!("/tmp/fleetyard-{user}"),
    ];
    let mut found = BTreeSet::new();
    let mut look = |folder: &Path, start: &str| {
        for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
            if entry.file_name().to_string_lossy().starts_with(start) {
                found.insert(entry.path().display().to_string());
            }
        }
    };
    for kind in ["runs", "scratch"] {
        look(&own.join(kind), "");
        for other in &others {
            look(&Path::new(other).join(kind), host);
        }
    }
    for group in own_groups() {
        look(&group, &format!("fleetyard-{host}"));
    }
    found
}

/// Places where control groups of these tests' commands may be: in every hierarchy, the group that
/// this process is in.
fn own_groups() -> BTreeSet<PathBuf> {
    let groups = fs::read_to_string("/proc/self/cgroup").unwrap_or_default();
    let mounts = fs::read_to_string("/proc/self/mountinfo").unwrap_or_default();
    let mounts = mounts.lines().filter(|line| line.contains(" - cgroup"));
    let mounts = mounts.filter_map(|line| line.split(' ').nth(4));
    let below = |mount| {
        let own = groups.lines().filter_map(|line| line.splitn(3, ':').nth(2));
        own.map(move |own| Path::new(mount).join(own.trim_start_matches('/')))
    };
    mounts.flat_map(below).collect()
}

/// The user's files by name and content, but for those of SQLite.
fn files(yard: &Yard) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    for name in yard.files() {
        if yard.path(&name).is_file() && !name.contains(".sqlite") {
            let content = yard.read(&name);
            found.insert(name, content);
        }
    }
    found
}

// ---- Judging -----------------------------------------------------------------------

/// Checks that hold for any fault at any point.
fn judge(scenario: &Scenario, yard: &Yard, point: &Point, run: &Run, usual: &Usual) -> Vec<String> {
    let ended = &run.ended;
    let mut wrong = Vec::new();
    if !ended.hanging.is_empty() {
        wrong.push(format!("it hangs: {}", ended.hanging.join("; ")));
        return wrong;
    }
    if !ended.left.is_empty() {
        wrong.push(format!("left running: {}", ended.left.join("; ")));
    }
    match ended.code {
        Some(0) => {}
        None if point.wrong == Wrong::Killed => {}
        // An input that cannot be read, a plugin that cannot be run, the host itself.
        Some(1 | 3 | 5 | 70) => {
            if !ended.stderr.contains("error: ") {
                wrong.push("it does not say why it failed".into());
            }
        }
        code => wrong.push(format!("exit code {code:?}")),
    }
    if ended.stderr.contains("panicked") {
        wrong.push("it panicked".into());
    }
    (scenario.judge)(
        &Try {
            point,
            arguments: &scenario.arguments,
            yard,
            ended,
            usual,
        },
        &mut wrong,
    );
    let unlinks = ["unlink", "unlinkat", "rename"].contains(&point.call);
    for name in yard.files() {
        // Who may not remove a file leaves it.
        if name.contains(".tmp") && !unlinks {
            wrong.push(format!("left behind: {name}"));
        }
    }
    let left = || &state(yard, &run.host) - &run.before;
    if !left().is_empty() {
        yard.line("plugins list").expect(SUCCESS);
        for path in left() {
            wrong.push(format!("still there after the next start: {path}"));
        }
    }
    wrong
}

/// Files are as an undisturbed run leaves them, or not there; where it ended well, all are.
fn files_are_whole(tried: &Try<'_>, wrong: &mut Vec<String>) {
    let found = files(tried.yard);
    for (name, content) in &tried.usual.files {
        match found.get(name) {
            Some(there) if there == content => {}
            Some(_) => wrong.push(format!("{name} is not what it should be")),
            None if tried.ended.code == Some(SUCCESS) => wrong.push(format!("{name} is not there")),
            None => {}
        }
    }
}

fn judge_run(tried: &Try<'_>, wrong: &mut Vec<String>) {
    files_are_whole(tried, wrong);
    if tried.ended.code != Some(SUCCESS) {
        return;
    }
    let Ok(record) = serde_json::from_str::<Value>(&tried.ended.stdout) else {
        wrong.push("its record is no JSON".into());
        return;
    };
    layers_are_true(tried, &record, wrong);
    if record["verdict"]["valid"] != true || record["fault"] != Value::Null {
        wrong.push("it ended well without a valid plan".into());
    }
    for key in [
        "plan_digest",
        "instance_digest",
        "metrics/soc_steps",
        "execution/trace_digest",
    ] {
        let of = |record: &Value| record.pointer(&format!("/{key}")).cloned();
        if of(&record) != of(&tried.usual.stdout) {
            wrong.push(format!("another {key}"));
        }
    }
}

/// A layer whose call failed is not said to be there.
fn layers_are_true(tried: &Try<'_>, record: &Value, wrong: &mut Vec<String>) {
    let Point { process, call, .. } = tried.point;
    let makes = |(who, calls): &(&str, &[&str])| process.starts_with(who) && calls.contains(call);
    // Who is not root keeps its groups, and another program may make the layers in its place.
    let excused = *call == "setgroups" && !is_root() || record["sandbox"]["backend"] == "bwrap";
    if LAYERS.iter().any(makes) && !excused && lost(record) == lost(&tried.usual.stdout) {
        wrong.push("a layer failed, and its record has all".into());
    }
}

fn is_root() -> bool {
    fs::metadata("/proc/self").unwrap().uid() == 0
}

/// The layers that a run did not have.
fn lost(record: &Value) -> Vec<&str> {
    let layers = record["sandbox"]["layers"].as_array();
    let lost = layers.into_iter().flatten();
    let lost = lost.filter(|layer| layer["active"] == false);
    lost.filter_map(|layer| layer["layer"].as_str()).collect()
}

/// The part of a row that does not depend on the clock.
fn lasting(row: &Row) -> String {
    format!("{} {:?}", rows::lasting(row), row.fault)
}

fn rows(yard: &Yard) -> Result<Vec<String>, String> {
    let path = yard.path("small.sqlite");
    if !path.exists() {
        return Ok(Vec::new());
    }
    let store = Store::open_read_only(&path).map_err(|error| error.to_string())?;
    let rows = store.rows().map_err(|error| error.to_string())?;
    Ok(rows.iter().map(lasting).collect())
}

/// A trial as an undisturbed run makes it, or one whose supervisor was lost: a plugin may be the
/// cause of that, so that it is a trial all the same, which failed.
fn is_true(row: &str, usual: &Usual) -> bool {
    usual.rows.iter().any(|known| known == row)
        || (row.contains(" false ") && row.contains("supervis"))
}

fn judge_bench(tried: &Try<'_>, wrong: &mut Vec<String>) {
    let there = match rows(tried.yard) {
        Ok(rows) => rows,
        Err(error) => return wrong.push(format!("the store cannot be read: {error}")),
    };
    for row in there.iter().filter(|row| !is_true(row, tried.usual)) {
        wrong.push(format!("a trial that is none: {row}"));
    }
    let asked = tried.usual.rows.len();
    if tried.ended.code == Some(SUCCESS) && there.len() != asked {
        wrong.push(format!("it ended well with {} trials", there.len()));
    }
    let again = tried.yard.line(&format!("{} --resume", tried.arguments));
    if again.code != Some(SUCCESS) {
        wrong.push(format!("it cannot be gone on with: {again}"));
    }
    match rows(tried.yard) {
        Ok(rows) => {
            let kept = there.iter().all(|row| rows.contains(row));
            let complete = rows.len() == asked && rows.iter().all(|row| is_true(row, tried.usual));
            if !(kept && complete) {
                wrong.push(format!("another run does not complete it: {rows:?}"));
            }
        }
        Err(error) => wrong.push(format!("the store cannot be read: {error}")),
    }
}

fn judge_fleet(tried: &Try<'_>, wrong: &mut Vec<String>) {
    if tried.ended.code != Some(SUCCESS) {
        return;
    }
    let Ok(outcome) = serde_json::from_str::<Value>(&tried.ended.stdout) else {
        wrong.push("its record is no JSON".into());
        return;
    };
    if outcome["ended"] != "duration" || outcome["execution"]["contacts"] != 0 {
        wrong.push(format!("it ended by {}", outcome["ended"]));
    }
    let events = outcome["events"].as_array().map_or(0, Vec::len);
    let digest = |outcome: &Value| outcome["execution"]["trace_digest"].clone();
    if events == 0 && digest(&outcome) != digest(&tried.usual.stdout) {
        wrong.push("another execution, and no event that says why".into());
    }
}

// ---- Trying ------------------------------------------------------------------------

/// An undisturbed run, and the calls that it makes.
fn usual(scenario: &Scenario) -> (Usual, Census) {
    let yard = yard(scenario);
    let Run { ended, census, .. } = run(scenario, &yard, None);
    let ended = ended.expect(SUCCESS);
    // None where there is no store.
    let rows = rows(&yard).unwrap();
    let mut files = files(&yard);
    files.retain(|name, _| !name.contains("manifest"));
    let usual = Usual {
        stdout: ended.json(),
        files,
        rows,
    };
    (usual, census)
}

/// The result of a point.
struct Found {
    point: Point,
    /// It did not come up: calls that wait are not always as many.
    missed: bool,
    wrong: Vec<String>,
    line: String,
}

fn try_point(scenario: &Scenario, usual: &Usual, point: Point) -> Found {
    let yard = yard(scenario);
    let run = run(scenario, &yard, Some(&point));
    let wrong = judge(scenario, &yard, &point, &run, usual);
    let Run { ended, spoiled, .. } = run;
    let said = ended
        .stderr
        .lines()
        .find(|line| line.starts_with("error: "));
    let record = serde_json::from_str(&ended.stdout).unwrap_or(Value::Null);
    let line = format!(
        "{}/{point}\t{}\t{:?}\t{}\t{}\t{}",
        scenario.name,
        if spoiled { "hit" } else { "missed" },
        ended.code,
        lost(&record).join(","),
        said.unwrap_or_default(),
        wrong.join(" | ").replace('\n', "\\n"),
    );
    Found {
        missed: !spoiled,
        point,
        wrong,
        line,
    }
}

/// Points that are spread over processes, calls, errors and their numbers.
fn sample(points: Vec<Point>, count: usize) -> Vec<Point> {
    let every = points.len().div_ceil(count).max(1);
    // In their order all numbers of one call and error are together.
    points.into_iter().skip(every / 2).step_by(every).collect()
}

fn sweep(scenario: &Scenario) {
    if let Some(why) = inject::refused() {
        eprintln!("skipped: processes cannot be traced here, {why}");
        return;
    }
    let asked = std::env::var(ASKED).unwrap_or_default();
    let (usual, census) = usual(scenario);
    let all = (scenario.points)(&census);
    assert!(all.len() > 500, "only {} points: {census:?}", all.len());
    let (count, calls) = (all.len(), census.values().sum::<u32>());
    let tried = if asked == "all" {
        all
    } else if let Some(point) = asked.strip_prefix(&format!("{}/", scenario.name)) {
        all.into_iter()
            .filter(|known| known.to_string().starts_with(point))
            .collect()
    } else if let Ok(count) = asked.parse() {
        sample(all, count)
    } else if asked.is_empty() {
        let named = all.iter().filter(|point| {
            let text = point.to_string();
            scenario.name == "run" && ONCE.iter().any(|once| text.starts_with(once))
        });
        let mut chosen: BTreeSet<Point> = named.cloned().collect();
        chosen.extend(sample(all, SAMPLE));
        chosen.into_iter().collect()
    } else {
        return;
    };
    let next = AtomicUsize::new(0);
    let found = Mutex::new(Vec::new());
    let threads = thread::available_parallelism()
        .map_or(1, usize::from)
        .min(4);
    thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                while let Some(point) = tried.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let one = try_point(scenario, &usual, point.clone());
                    if let Ok(log) = std::env::var(LOG) {
                        use std::io::Write;
                        let file = fs::OpenOptions::new().create(true).append(true).open(log);
                        // In one piece, so that lines of two threads stay apart.
                        let line = format!("{}\n", one.line);
                        file.unwrap().write_all(line.as_bytes()).unwrap();
                    }
                    found.lock().unwrap().push(one);
                }
            });
        }
    });
    let found = found.into_inner().unwrap();
    let missed = found.iter().filter(|one| one.missed).count();
    eprintln!(
        "{}: {calls} calls, {count} points, {} tried, {missed} of them did not come up",
        scenario.name,
        found.len(),
    );
    let wrong: BTreeSet<String> = found
        .iter()
        .filter(|one| !one.wrong.is_empty())
        .map(|one| format!("{}/{}: {}", scenario.name, one.point, one.wrong.join("; ")))
        .collect();
    let lines: Vec<String> = wrong.into_iter().collect();
    assert!(
        lines.is_empty(),
        "{} of {}:\n{}",
        lines.len(),
        found.len(),
        lines.join("\n")
    );
}

#[test]
fn a_run_survives_every_call_that_fails() {
    let instance = instance("empty-8-8", 3).join(" ");
    sweep(&Scenario {
        name: "run",
        arguments: format!(
            "run {instance} --planner pibt --format json --plan-out p.json --trace-out t.fytrace"
        ),
        given: Vec::new(),
        points: inject::points,
        judge: judge_run,
    });
}

/// A suite of two trials.
fn suite() -> (&'static str, String) {
    let maps = root().join("maps").display().to_string();
    let text = format!(
        r#"name = "small"

[[planner]]
plugin = "pibt"

[[planner]]
plugin = "lacam"
options = {{ anytime = false }}

[[instances]]
scen = ["{maps}/empty-8-8-random-1.scen"]
agents = [3]
"#
    );
    ("s.toml", text)
}

#[test]
fn a_suite_survives_every_call_that_fails() {
    sweep(&Scenario {
        name: "bench",
        arguments: "bench s.toml --format json".into(),
        given: vec![suite()],
        points: inject::points,
        judge: judge_bench,
    });
}

#[test]
fn a_suite_goes_on_wherever_its_host_and_supervisors_were_killed() {
    sweep(&Scenario {
        name: "killed",
        arguments: "bench s.toml --format json".into(),
        given: vec![suite()],
        points: inject::kills,
        judge: judge_bench,
    });
}

#[test]
fn a_fleet_survives_every_call_that_fails() {
    let map = map("empty-8-8.map");
    sweep(&Scenario {
        name: "fleet",
        arguments: format!(
            "fleet --map {map} --agents 4 --duration 3s --planner pibt --format json --threads 1"
        ),
        given: Vec::new(),
        points: inject::points,
        judge: judge_fleet,
    });
}
