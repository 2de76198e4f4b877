//! Effects of a plugin stay in its sandbox, budgets end processes that go on for too long, and the
//! record says which layer or limit it was.
//!
//! `plugins/faulty` misbehaves on request; `scripts/isolation.py` tries everything that
//! it can do, ten times and as several users. Here is what must never break, once each,
//! as whoever runs the tests. Where the machine refuses namespaces, the tests that need
//! them say so and why.

use std::fs;
use std::io::Read;
use std::net::TcpListener;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::OnceLock;

use fleetyard_testkit::{
    Ended, INTERNAL, NO_PLAN, PLUGIN, SUCCESS, Started, Yard, c_library, each, faulty_library,
    faulty_program, faulty_rust_library, fleetyard, have, instance, map, root, until, words,
};
use serde_json::Value;

/// The arguments of a run of a faulty planner.
fn faulty(plugin: &Path, fault: &str, more: &str) -> Vec<String> {
    let mut line = vec!["run".to_owned()];
    line.extend(instance("empty-8-8", 3));
    line.extend(["--planner".into(), plugin.display().to_string()]);
    line.extend(words(&format!(
        "--option fault={fault} --format json {more}"
    )));
    line
}

/// The reason why this machine cannot keep a plugin apart as a whole; `None` where it can.
fn refused() -> Option<String> {
    static REFUSED: OnceLock<Option<String>> = OnceLock::new();
    let refused = REFUSED.get_or_init(|| {
        let findings = Yard::new()
            .line("doctor --format json")
            .expect(SUCCESS)
            .json();
        let layers = findings["sandbox"]["layers"].as_array().unwrap();
        let is_missing = |layer: &&Value| layer["required"] == true && layer["active"] == false;
        let missing = layers.iter().find(is_missing)?;
        Some(format!("{}: {}", missing["layer"], missing["errno"]))
    });
    if let Some(why) = refused {
        eprintln!("skipped: this machine refuses a layer of the sandbox, {why}");
    }
    refused.clone()
}

/// The libraries and programs that can have a fault.
fn plugins(by: &str) -> Vec<std::path::PathBuf> {
    let mut found = Vec::new();
    for letter in by.chars() {
        match letter {
            'c' => found.push(faulty_library()),
            'p' if have("python3") => found.push(faulty_program()),
            'r' => found.push(faulty_rust_library()),
            _ => {}
        }
    }
    found
}

fn active(record: &Value, layer: &str) -> bool {
    let layers = record["sandbox"]["layers"].as_array().unwrap();
    let state = layers.iter().find(|state| state["layer"] == layer).unwrap();
    state["active"].as_bool().unwrap()
}

/// True if the record says that a limit was only watched.
fn only_watched(record: &Value, limit: &str) -> bool {
    let limits = record["sandbox"]["limits"].as_array().unwrap();
    let state = limits.iter().find(|state| state["limit"] == limit).unwrap();
    assert_eq!(state["enforced"] == false, state["reason"].is_string());
    state["enforced"] == false
}

// ---- Limits ------------------------------------------------------------------------

#[test]
fn the_limit_that_is_exceeded_is_named() {
    // Fault, plugins, arguments, the limits that it may be.
    let cases: &[(&str, &str, &str, &[&str])] = &[
        ("never", "cpr", "--budget 300ms", &["wall"]),
        ("ignore-signals", "cp", "--budget 300ms", &["wall"]),
        ("spin", "cpr", "--budget 60s --cpu 200ms", &["cpu"]),
        ("spin-processes", "c", "--budget 60s --cpu 200ms", &["cpu"]),
        (
            "fork-bomb",
            "cp",
            "--budget 60s --processes 32",
            &["processes"],
        ),
        (
            "thread-bomb",
            "cpr",
            "--budget 60s --processes 32",
            &["processes"],
        ),
        ("hog", "cpr", "--budget 60s --memory 128MiB", &["memory"]),
        (
            "allocate-many",
            "cp",
            "--budget 60s --memory 128MiB --option size=2147483648",
            &["memory"],
        ),
        (
            "flood",
            "cpr",
            "--budget 60s --output-limit 1MiB --option size=134217728",
            &["output"],
        ),
        (
            "flood-stderr",
            "cpr",
            "--budget 60s --output-limit 1MiB --option size=134217728",
            &["output"],
        ),
        (
            "huge-file",
            "cpr",
            "--budget 60s --disk 8MiB --option size=134217728",
            &["disk"],
        ),
        (
            "many-files",
            "cpr",
            "--budget 60s --disk 64MiB --option count=50000",
            &["disk"],
        ),
    ];
    each(cases, |(fault, by, arguments, limits)| {
        for plugin in plugins(by) {
            let ended = Yard::new().run(&faulty(&plugin, fault, arguments));
            assert!(ended.left.is_empty(), "{fault}: {:?} {ended}", ended.left);
            let record = ended.json();
            let limit = record["limit"].as_str().unwrap_or("none");
            assert!(limits.contains(&limit), "{fault}: {limit} {ended}");
            assert_eq!(record["stopped"], true, "{fault}: {ended}");
            // The kernel stops a file that grows too large at once, and memory where it
            // limits it.
            let stopped_by_us =
                limit != "disk" && (limit != "memory" || only_watched(&record, "memory"));
            let latency = &record["kill_latency_ms"];
            assert!(latency.is_number() || !stopped_by_us, "{fault}: {ended}");
        }
    });
}

#[test]
fn memory_that_is_shared_counts_once() {
    if refused().is_some() {
        return;
    }
    let arguments = "--budget 60s --memory 300MiB --option size=67108864";
    for plugin in plugins("cp") {
        let ended = Yard::new()
            .run(&faulty(&plugin, "shared-memory", arguments))
            .expect(SUCCESS);
        assert_eq!(ended.json()["claimed_metrics"]["reached"], 1.0, "{ended}");
    }
}

/// Tries a fault in every setting: here, where namespaces are refused, and as root also as an
/// ordinary user.
fn everywhere(fault: &str, by: &str, arguments: &str, judge: impl Fn(&Value, &Ended)) {
    for plugin in plugins(by) {
        let line = faulty(&plugin, fault, arguments);
        let ended = Yard::new().run(&line);
        assert!(ended.left.is_empty(), "{fault}: {:?} {ended}", ended.left);
        judge(&ended.json(), &ended);
        for (refused, user) in [(true, effective_user()), (false, 1234), (true, 1234)] {
            if let Some(ended) = launched(&Yard::new().path(""), &fleetyard(), refused, user, &line)
            {
                judge(&ended.json(), &ended);
            }
        }
    }
}

#[test]
fn memory_that_no_resident_set_shows_is_contained() {
    let cases = [
        (
            "shared-anonymous",
            "cp",
            "--memory 128MiB --option size=536870912",
        ),
        (
            "page-tables",
            "c",
            "--memory 128MiB --option size=536870912",
        ),
        (
            "socket-buffers",
            "c",
            "--memory 128MiB --option size=536870912",
        ),
        (
            "pipe-buffers",
            "c",
            "--memory 64MiB --option size=134217728",
        ),
        ("headless", "c", "--memory 128MiB --option size=536870912"),
    ];
    for (fault, by, arguments) in cases {
        everywhere(
            fault,
            by,
            &format!("--budget 60s {arguments}"),
            |record, ended| {
                let refused = record["claimed_metrics"]["reached"] == 0.0;
                assert!(refused || record["limit"] == "memory", "{fault}: {ended}");
            },
        );
    }
}

#[test]
fn processor_time_that_nobody_is_told_of_is_counted_or_the_result_is_unranked() {
    let arguments = "--budget 60s --cpu 200ms --option count=40";
    for (fault, by) in [("autoreaped-children", "cp"), ("no-child-wait", "c")] {
        everywhere(fault, by, arguments, |record, ended| {
            let watched = only_watched(record, "cpu");
            assert_eq!(record["planner"]["ranked"], !watched, "{fault}: {ended}");
            assert_eq!(
                record["planner"]["unranked"].is_string(),
                watched,
                "{ended}"
            );
            assert!(watched || record["limit"] == "cpu", "{fault}: {ended}");
            let exact = record["resources"]["cpu_source"] == "cgroup";
            assert!(exact || watched, "{fault}: {ended}");
        });
    }
}

/// Children that end between two looks, and that nobody waits for, were in no figure.
#[test]
fn processor_time_of_children_that_nobody_sees_is_counted() {
    if !have("python3") {
        return;
    }
    // Where an ordinary user may have no counter, nothing tells.
    let level = fs::read_to_string("/proc/sys/kernel/perf_event_paranoid").unwrap_or_default();
    let level = level.trim().parse::<i32>();
    let open = faulty(&faulty_library(), "perf-event", "--sandbox none");
    let open = Yard::new().run(&open).json()["claimed_metrics"]["reached"] == 1.0;
    let told = open && level.is_ok_and(|level| level <= 2);
    everywhere("short-children", "p", "--budget 60s", |record, ended| {
        let resources = &record["resources"];
        let us = |name: &str| resources[name].as_u64().unwrap_or(0);
        let used_us = us("user_us") + us("system_us");
        let exact = resources["cpu_source"] == "cgroup";
        if exact || told {
            assert!(used_us > 270_000, "{used_us} {ended}");
            assert_eq!(record["planner"]["ranked"], exact, "{ended}");
        }
    });
}

#[test]
fn a_bomb_of_children_that_end_is_too_many_processes() {
    let arguments = "--budget 20s --processes 48";
    everywhere("double-fork-bomb", "cp", arguments, |record, ended| {
        // Whoever only watches may get no turn among them on a busy machine.
        let late = record["limit"] == "wall" && only_watched(record, "processes");
        assert!(late || record["limit"] == "processes", "{ended}");
    });
}

/// A bomb that the kernel counts with the user's other processes grew to all that the user might have,
/// and took most of a minute to be ended.
#[test]
fn a_bomb_does_not_take_all_processes_of_the_user() {
    let line = faulty(
        &faulty_library(),
        "fork-bomb",
        "--budget 20s --processes 32 --option count=4000",
    );
    for user in [effective_user(), 1234] {
        let Some(ended) = launched(&Yard::new().path(""), &fleetyard(), true, user, &line) else {
            continue;
        };
        let record = ended.json();
        let most = record["resources"]["peak_tasks"].as_u64().unwrap();
        // Root without a user of its own for the plugin has no limit.
        let is_bounded = user != 0 || active(&record, "own-user");
        assert!(most < 400 || !is_bounded, "{most} {ended}");
    }
}

#[test]
fn strict_does_not_run_where_memory_is_only_watched() {
    let line = faulty(&faulty_library(), "none", "--budget 30s --sandbox strict");
    let Some(ended) = launched(&Yard::new().path(""), &fleetyard(), false, 1234, &line) else {
        return;
    };
    if ended.code == Some(SUCCESS) {
        let record = ended.json();
        assert!(!only_watched(&record, "memory"), "{ended}");
        return;
    }
    for text in ["only watches limits", "memory", "fleetyard doctor"] {
        assert!(ended.stderr.contains(text), "{ended}");
    }
}

#[test]
fn a_planner_that_stops_by_itself_was_not_stopped() {
    let arguments = "--budget 300ms --grace 20s";
    let ended = Yard::new()
        .run(&faulty(&faulty_library(), "late", arguments))
        .expect(NO_PLAN);
    let record = ended.json();
    assert_eq!(record["stopped"], false, "{ended}");
    assert_eq!(record["limit"], "wall", "{ended}");
    assert!(record["kill_latency_ms"].is_null(), "{ended}");
}

#[test]
fn learning_the_map_has_limits_of_its_own() {
    let base = "--option during=prepare --budget 60s";
    let cases = [
        ("never", "--prepare-budget 300ms", "wall"),
        ("spin", "--prepare-cpu 200ms", "cpu"),
        ("hog", "--prepare-memory 128MiB", "memory"),
    ];
    for (fault, arguments, limit) in cases {
        let line = faulty(&faulty_library(), fault, &format!("{base} {arguments}"));
        let ended = Yard::new().run(&line).expect(NO_PLAN);
        let record = ended.json();
        assert_eq!(record["limit"], limit, "{ended}");
        assert!(ended.stderr.contains("`prepare`"), "{ended}");
        let took = record["metrics"]["prepare_time_ms"].as_f64();
        assert!(took.is_some_and(|took| took > 1.0), "{ended}");
        assert_eq!(record["metrics"]["planning_time_ms"], 0.0, "{ended}");
    }
    // People are told that it was not asked for a plan.
    let line = faulty(
        &faulty_library(),
        "never",
        &format!("{base} --prepare-budget 300ms"),
    );
    let line = line.join(" ").replace(" --format json", "");
    let ended = Yard::new().run(&words(&line)).expect(NO_PLAN);
    let mut lines = ended.stdout.lines();
    let told = lines.find(|line| line.starts_with("learning the map  "));
    let told = told.unwrap_or_else(|| panic!("{ended}"));
    assert!(told.contains("was not asked for a plan"), "{ended}");
    // The same limits leave the plan alone when they are the plan's.
    let line = faulty(
        &faulty_library(),
        "none",
        "--prepare-memory 128MiB --cpu 30s",
    );
    Yard::new().run(&line).expect(SUCCESS);
}

// ---- The host's own memory ---------------------------------------------------------

/// Runs to the end and says how much memory the host itself took at most, in MiB.
fn with_peak(yard: &Yard, line: &[String]) -> (Ended, u64) {
    let started = yard.start(line);
    let status = format!("/proc/{}/status", started.child.id());
    let watch = std::thread::spawn(move || {
        let mut peak = 0;
        // A process that has ended has no memory, also before it is waited for.
        while let Some(kb) = fs::read_to_string(&status).ok().and_then(|status| {
            let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
            line.split_whitespace().nth(1)?.parse::<u64>().ok()
        }) {
            peak = peak.max(kb >> 10);
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
        peak
    });
    let ended = started.wait();
    (ended, watch.join().unwrap())
}

/// Far more than the host takes for three agents, and far less than what is sent.
const HOST_MIB: u64 = 256;

#[test]
fn a_huge_answer_takes_little_of_the_hosts_memory() {
    for plugin in plugins("p") {
        let line = faulty(
            &plugin,
            "huge-answer",
            "--budget 60s --option size=120000000",
        );
        let (ended, peak) = with_peak(&Yard::new(), &line);
        ended.expect(SUCCESS);
        assert!(peak < HOST_MIB, "{peak} MiB");
    }
}

#[test]
fn a_plan_that_is_still_arriving_at_the_deadline_is_late() {
    for plugin in plugins("p") {
        let arguments = "--budget 300ms --option size=1";
        let (ended, peak) = with_peak(
            &Yard::new(),
            &faulty(&plugin, "late-huge-answer", arguments),
        );
        let record = ended.expect(NO_PLAN).json();
        assert_eq!(record["termination"], "timed-out", "{record}");
        assert_eq!(record["limit"], "wall", "{record}");
        assert_eq!(record["stopped"], true, "{record}");
        assert!(peak < HOST_MIB, "{peak} MiB");

        let arguments = format!("{arguments} --grace 60s");
        let (ended, _) = with_peak(
            &Yard::new(),
            &faulty(&plugin, "late-huge-answer", &arguments),
        );
        let record = ended.expect(NO_PLAN).json();
        assert_eq!(record["termination"], "timed-out", "{record}");
        assert_eq!(record["metrics"]["late_plans"], 1, "{record}");
        assert_eq!(record["stopped"], false, "{record}");
    }
}

#[test]
fn a_flood_of_plans_takes_little_of_the_hosts_memory() {
    for plugin in plugins("p") {
        let arguments = "--budget 60s --option size=40000000";
        let (ended, peak) = with_peak(&Yard::new(), &faulty(&plugin, "incumbent-flood", arguments));
        let record = ended.expect(SUCCESS).json();
        let plans = record["metrics"]["incumbents"].as_array().unwrap();
        assert!(plans.len() > 200, "{}", plans.len());
        let forgotten = plans.iter().filter(|plan| plan["soc_steps"].is_null());
        assert!(forgotten.count() > 0, "all are kept");
        assert!(!plans[plans.len() - 1]["soc_steps"].is_null());
        assert!(peak < HOST_MIB, "{peak} MiB");
    }
}

// ---- Containment -------------------------------------------------------------------

/// Runs an attempt that the sandbox must not let succeed.
#[track_caller]
fn fails_to(fault: &str, by: &str, option: &str) -> Vec<Ended> {
    let mut ends = Vec::new();
    for plugin in plugins(by) {
        let yard = Yard::new();
        let line = faulty(&plugin, fault, &format!("--budget 60s {option}"));
        let ended = yard.run(&line);
        assert!(ended.left.is_empty(), "{fault}: {:?} {ended}", ended.left);
        let record = ended.json();
        let signalled = record["fault"]
            .as_str()
            .unwrap_or_default()
            .contains("SIGSYS");
        let reached = &record["claimed_metrics"]["reached"];
        assert!(
            signalled || *reached == 0.0,
            "{fault} by {}: {ended}",
            plugin.display()
        );
        ends.push(ended);
    }
    ends
}

/// A file that everybody could write, in a folder of its own.
fn precious() -> (tempfile::TempDir, PathBuf) {
    let outside = tempfile::tempdir().unwrap();
    // A plugin of another user must not be stopped by this folder alone.
    fs::set_permissions(outside.path(), fs::Permissions::from_mode(0o777)).unwrap();
    let file = outside.path().join("precious");
    fs::write(&file, "as it was").unwrap();
    fs::set_permissions(&file, fs::Permissions::from_mode(0o666)).unwrap();
    (outside, file)
}

#[test]
fn nothing_gets_out() {
    if refused().is_some() {
        return;
    }
    let (outside, file) = precious();
    let target = format!("--option target={}", file.display());
    let folder = format!("--option target={}", outside.path().display());
    fails_to("read-file", "cpr", &target);
    fails_to("read-file", "cpr", "--option target=/etc/shadow");
    fails_to("write-outside", "cpr", &target);
    fails_to("remove-outside", "cpr", &target);
    fails_to("list-folder", "cpr", &folder);
    assert_eq!(fs::read_to_string(&file).unwrap(), "as it was");

    let tcp = TcpListener::bind("127.0.0.1:0").unwrap();
    tcp.set_nonblocking(true).unwrap();
    let address = format!("--option target={}", tcp.local_addr().unwrap());
    fails_to("connect-tcp", "cpr", &address);
    assert!(tcp.accept().is_err(), "somebody came by");
    let udp = std::net::UdpSocket::bind("127.0.0.1:0").unwrap();
    udp.set_nonblocking(true).unwrap();
    let address = format!("--option target={}", udp.local_addr().unwrap());
    fails_to("connect-udp", "cpr", &address);
    assert!(udp.recv(&mut [0; 64]).is_err(), "something came by");
    let path = outside.path().join("socket");
    let unix = std::os::unix::net::UnixListener::bind(&path).unwrap();
    unix.set_nonblocking(true).unwrap();
    fails_to(
        "connect-unix",
        "cpr",
        &format!("--option target={}", path.display()),
    );
    assert!(unix.accept().is_err(), "somebody came by");

    for fault in [
        "kill-parent",
        "unshare",
        "mount",
        "io-uring",
        "inotify",
        "bpf",
        "perf-event",
    ] {
        fails_to(fault, "cp", "");
    }
    for fault in ["userfaultfd", "keyctl", "x32", "memfd", "sysv-shm", "repin"] {
        fails_to(fault, "c", "--memory 1GiB --option size=67108864");
    }
    for fault in UPWARDS {
        fails_to(fault, "c", "");
    }
}

/// Faults that reach for other processes of the same user, for the machine, or past the accounting.
/// None of them needs a namespace to be refused.
const UPWARDS: [&str; 14] = [
    "limit-supervisor",
    "limit-host",
    "priority-of-others",
    "signal-by-file",
    "lease",
    "kill-all",
    "socketpair-netlink",
    "aio",
    "personality",
    "memory-policy",
    "seccomp-listener",
    "new-calls",
    "undumpable",
    "proc-files",
];

#[test]
fn a_plugin_goes_first_when_memory_runs_out() {
    let ends = fails_to("oom-score", "c", "");
    let record = ends[0].json();
    if refused().is_none() {
        assert!(active(&record, "resource-limits"), "{}", ends[0]);
        let score = &record["claimed_metrics"]["oom-score"];
        assert_eq!(*score, 1000.0, "{}", ends[0]);
    }
}

/// The user that runs the tests, and another one where that is root.
fn users() -> Vec<u32> {
    let me = effective_user();
    [me].into_iter().chain((me == 0).then_some(1234)).collect()
}

#[test]
fn nobody_reaches_up_where_namespaces_are_refused() {
    if !have("python3") {
        return;
    }
    let public = Public::new();
    let letters = public.path("letters");
    let listener = std::os::unix::net::UnixDatagram::bind(&letters).unwrap();
    listener.set_nonblocking(true).unwrap();
    fs::set_permissions(&letters, fs::Permissions::from_mode(0o777)).unwrap();
    let target = format!("--option target={}", letters.display());
    // One shell for all of them, which is the process of the same user that is reached for.
    let attempts = UPWARDS.map(|fault| (fault, "--option pid=$$"));
    let more = [
        ("socketpair-datagram", target.as_str()),
        ("oom-score", ""),
        ("kill-pid", "--option pid=$$"),
    ];
    let attempts: Vec<(&str, &str)> = attempts.into_iter().chain(more).collect();
    let line = |(fault, option): &(&str, &str)| {
        let words = Public::faulty(fault, &format!("--budget 60s {option}"));
        format!("./fleetyard {}\n", words.join(" "))
    };
    let script: String = attempts.iter().map(line).collect();
    for user in users() {
        let line = ["-c".to_owned(), script.clone()];
        let ended = launched(&public.path(""), Path::new("sh"), true, user, &line);
        let ended = ended.unwrap();
        let records = serde_json::Deserializer::from_str(&ended.stdout).into_iter::<Value>();
        let records: Vec<Value> = records.map(Result::unwrap).collect();
        assert_eq!(records.len(), attempts.len(), "as {user}: {ended}");
        for ((fault, _), record) in attempts.iter().zip(records) {
            let what = format!("{fault} as {user}: {record:#}");
            assert_eq!(record["claimed_metrics"]["reached"], 0.0, "{what}");
            assert_eq!(record["planner"]["ranked"], true, "{what}");
        }
    }
    assert!(listener.recv(&mut [0; 64]).is_err(), "something came by");
}

/// Runs in which nobody keeps the plugin from its supervisor.
#[test]
fn a_supervisor_whose_limits_were_changed_makes_a_failure_of_the_trial() {
    for resource in ["cpu", "nofile", "fsize"] {
        let more = format!("--budget 60s --sandbox none --option target={resource}");
        let ended = Yard::new().run(&faulty(&faulty_library(), "limit-supervisor", &more));
        assert!(
            ended.left.is_empty(),
            "{resource}: {:?} {ended}",
            ended.left
        );
        let record = ended.json();
        assert_eq!(record["termination"], "failed", "{resource}: {ended}");
        assert_eq!(record["planner"]["ranked"], false, "{resource}: {ended}");
        let why = record["planner"]["unranked"].as_str().unwrap();
        assert!(why.contains("supervis"), "{resource}: {ended}");
        assert_eq!(ended.code, Some(PLUGIN), "{resource}: {ended}");
    }
}

/// An administrator who ends a supervisor that the plugin cannot reach makes no failure of the planner:
/// the host fails, and no trial is recorded.
#[test]
fn a_supervisor_that_was_lost_is_nobodys_failure_or_the_planners() {
    for level in ["auto", "none"] {
        let yard = Yard::new();
        let more = format!("--budget 60s --sandbox {level}");
        let started = yard.start(&faulty(&faulty_library(), "never", &more));
        let supervisor = || {
            let processes = started.processes();
            // The plugin is there once there are more than it and the host.
            let plugin = processes.len() > 3;
            let mut found = processes.into_iter();
            found.find(|process| plugin && process.command.contains("__supervise"))
        };
        assert!(until(|| supervisor().is_some()), "{level}");
        supervisor().unwrap().signal("KILL");
        let ended = started.wait();
        assert!(ended.left.is_empty(), "{level}: {:?} {ended}", ended.left);
        if level == "auto" && refused().is_none() {
            // The planner was there, for its processes were.
            assert_eq!(ended.code, Some(INTERNAL), "{ended}");
            assert!(ended.stdout.is_empty(), "{ended}");
            for text in ["the host failed", "supervisor", "SIGKILL"] {
                assert!(ended.stderr.contains(text), "{ended}");
            }
            continue;
        }
        if ended.stdout.is_empty() {
            // It was lost before the planner was there to be asked.
            assert_eq!(ended.code, Some(PLUGIN), "{level}: {ended}");
            continue;
        }
        let record = ended.json();
        assert_eq!(record["termination"], "failed", "{level}: {ended}");
        assert_eq!(record["planner"]["ranked"], false, "{level}: {ended}");
        let fault = record["fault"].as_str().unwrap();
        assert!(
            fault.contains("SIGKILL") && fault.contains("supervisor"),
            "{ended}"
        );
    }
}

#[test]
fn a_host_that_may_write_no_files_says_so_and_leaves_none() {
    let yard = Yard::new();
    let ended = yard.shell("ulimit -f 0; exec fleetyard maps generate empty --rows 64 --cols 64");
    assert!(ended.stderr.contains("cannot write"), "{ended}");
    assert!(ended.code.is_some(), "it was ended by a signal: {ended}");
    assert!(yard.files().is_empty(), "{:?}", yard.files());
}

#[test]
fn other_processes_are_out_of_reach() {
    if refused().is_some() {
        return;
    }
    let mut victim = Command::new("sleep").arg("600").spawn().unwrap();
    let target = format!("--option pid={}", victim.id());
    for fault in ["kill-pid", "see-process", "ptrace", "steal-descriptor"] {
        fails_to(fault, "cp", &target);
    }
    assert!(victim.try_wait().unwrap().is_none(), "it was killed");
    victim.kill().unwrap();
    victim.wait().unwrap();
}

#[test]
fn the_environment_is_the_same_for_everybody() {
    let yard = Yard::new().set("HOST_SECRET", "xyzzy");
    let getenv = |more: &str| {
        let option = "--option target=HOST_SECRET";
        let line = faulty(&faulty_library(), "getenv", &format!("{option} {more}"));
        yard.run(&line).expect(SUCCESS).json()
    };
    let without = getenv("");
    assert_eq!(without["claimed_metrics"]["reached"], 0.0);
    let with = getenv("--env HOST_SECRET");
    assert_eq!(with["claimed_metrics"]["reached"], 1.0);
    assert_ne!(with["environment_digest"], without["environment_digest"]);
}

#[test]
fn the_sandbox_is_locked_before_a_constructor_runs() {
    if refused().is_some() {
        return;
    }
    let (_outside, file) = precious();
    let library = c_library("plugins/faulty/faulty.c", Some("CONSTRUCTOR_FAULT"));
    let yard = Yard::new()
        .set("FLEETYARD_FAULT", "write-outside")
        .set("FLEETYARD_TARGET", &file.display().to_string());
    let ended = yard.run(&faulty(&library, "none", "--budget 30s"));
    assert!(ended.left.is_empty(), "{ended}");
    assert_eq!(fs::read_to_string(&file).unwrap(), "as it was", "{ended}");
}

#[test]
fn grants_are_grants() {
    if refused().is_some() {
        return;
    }
    let outside = tempfile::tempdir().unwrap();
    let file = outside.path().join("map data");
    fs::write(&file, "readable").unwrap();
    let yard = Yard::new();
    let mut line = faulty(&faulty_library(), "read-file", "--budget 30s");
    line.extend(["--option".into(), format!("target={}", file.display())]);
    let ended = yard.run(&line).expect(SUCCESS);
    assert_eq!(ended.json()["claimed_metrics"]["reached"], 0.0, "{ended}");
    line.extend(["--allow-read".into(), outside.path().display().to_string()]);
    let ended = yard.run(&line).expect(SUCCESS);
    assert_eq!(ended.json()["claimed_metrics"]["reached"], 1.0, "{ended}");

    let tcp = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("--option target={}", tcp.local_addr().unwrap());
    let line = faulty(
        &faulty_library(),
        "connect-tcp",
        &format!("--budget 30s --allow-network {address}"),
    );
    let ended = yard.run(&line).expect(SUCCESS);
    assert_eq!(ended.json()["claimed_metrics"]["reached"], 1.0, "{ended}");
}

// ---- What is started, and what is read ---------------------------------------------

/// The first lines of a plugin that speaks the protocol; what comes before them is tried
/// when it is started.
fn python_plugin(before: &str) -> String {
    let example = root().join("plugins/examples/python/raw_protocol.py");
    let example = fs::read_to_string(example).unwrap();
    let (first, rest) = example.split_once('\n').unwrap();
    format!("{first}\n{before}\n{rest}")
}

fn executable(path: &Path, content: &str) {
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    fs::write(path, content).unwrap();
    fs::set_permissions(path, fs::Permissions::from_mode(0o755)).unwrap();
}

/// The interpreter itself, its version and where it is installed.
fn real_python() -> Option<(String, String)> {
    if !have("python3") {
        return None;
    }
    let question = "import os, sys; v = sys.version_info; \
                    print(os.path.realpath(sys.executable)); print(f'{v[0]}.{v[1]}')";
    let output = Command::new("python3")
        .args(["-c", question])
        .output()
        .unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    let (program, version) = text.trim().split_once('\n')?;
    Some((program.to_owned(), version.to_owned()))
}

/// Every command that starts a plugin, or may be thought to.
const STARTING: [&str; 8] = [
    "plugins list",
    "plugins info {plugin}",
    "plugins pin {plugin}",
    "plugins check {plugin} --only handshake",
    "run --map {maps}/empty-8-8.map --scen {maps}/empty-8-8-random-1.scen --agents 2 \
     --budget 60s --planner {plugin}",
    "run --map {maps}/empty-8-8.map --scen {maps}/empty-8-8-random-1.scen --agents 2 \
     --budget 60s --locked --planner {plugin}",
    "compare --scen {maps}/empty-8-8-random-1.scen --map {maps} --agents 2 --budget 60s \
     --planner {plugin}",
    "bench suite.toml",
];

#[test]
fn nothing_of_a_plugin_is_started_outside() {
    let Some((program, version)) = real_python() else {
        return;
    };
    let yard = Yard::new();
    let outside = yard.path("outside");
    fs::create_dir(&outside).unwrap();
    fs::set_permissions(&outside, fs::Permissions::from_mode(0o777)).unwrap();
    let mark = |name: &str| outside.join(name).display().to_string();
    // An interpreter of the plugin's own, and a virtual environment with a file that is
    // executed whenever its interpreter starts. Both try to leave a mark.
    let own = yard.path("own");
    let usual = "/usr/bin/python3";
    let wrapper =
        |leaves: &str| format!("#!/bin/sh\n({leaves}) 2>/dev/null\nexec {usual} \"$@\"\n");
    let leaves = format!("echo >{}", mark("interpreter"));
    executable(&own.join("tools/python3"), &wrapper(&leaves));
    executable(
        &own.join("planner.py"),
        &python_plugin("").replace(
            "/usr/bin/env python3",
            &own.join("tools/python3").display().to_string(),
        ),
    );
    let environment = yard.path("environment");
    let (bin, site) = (
        environment.join(".venv/bin"),
        environment.join(format!(".venv/lib/python{version}/site-packages")),
    );
    fs::create_dir_all(&bin).unwrap();
    fs::create_dir_all(&site).unwrap();
    std::os::unix::fs::symlink(&program, bin.join("python3")).unwrap();
    let home = Path::new(&program).parent().unwrap().display();
    fs::write(
        environment.join(".venv/pyvenv.cfg"),
        format!("home = {home}\n"),
    )
    .unwrap();
    let leaves = format!(
        "import os; os.path.isdir({0:?}) and os.access({0:?}, os.W_OK) and open({1:?}, 'w')\n",
        outside.display().to_string(),
        mark("site"),
    );
    fs::write(site.join("leaves.pth"), leaves).unwrap();
    fs::write(site.join("only_there.py"), "").unwrap();
    executable(
        &environment.join("planner.py"),
        // What is installed there is found all the same.
        &python_plugin("import only_there").replace(
            "/usr/bin/env python3",
            &bin.join("python3").display().to_string(),
        ),
    );
    let mut folders = vec![environment];
    if Path::new(usual).exists() {
        folders.push(own);
    }
    for folder in &folders {
        let plugin = folder.join("planner.py").display().to_string();
        let suite = format!(
            "name = \"s\"\n[budget]\nwall = \"60s\"\n[[planner]]\nplugin = \"{plugin}\"\n\
             [[instances]]\nscen = [\"{}\"]\nagents = [2]\n",
            map("empty-8-8-random-1.scen")
        );
        yard.write("suite.toml", suite);
        let yard = &yard;
        for line in STARTING {
            let line = line.replace("{plugin}", &plugin);
            let ended = yard
                .line_with(&line, "FLEETYARD_PLUGIN_PATH", folder)
                .expect(SUCCESS);
            assert!(!ended.stdout.contains("refused"), "{line}: {ended}");
            let marks = fs::read_dir(&outside).unwrap().count();
            assert_eq!(marks, 0, "{line}: {ended}");
        }
        for name in ["fleetyard.lock", "s.sqlite"] {
            fs::rename(
                yard.path(name),
                folder.join("..").join(format!("{name}.old")),
            )
            .unwrap();
        }
        // Where nothing but Landlock keeps it in.
        let line = words(&format!("plugins info {plugin}"));
        if let Some(ended) = in_a_container(yard, &line) {
            ended.expect(SUCCESS);
            assert_eq!(fs::read_dir(&outside).unwrap().count(), 0, "{plugin}");
        }
    }
    // What is pinned is not started when its interpreter is another one.
    if folders.len() < 2 {
        return;
    }
    let plugin = yard.path("own/planner.py").display().to_string();
    yard.line(&format!("plugins pin {plugin}")).expect(SUCCESS);
    executable(
        &yard.path("own/tools/python3"),
        "#!/bin/sh\nkill -SEGV $$\n",
    );
    for line in ["plugins info {plugin}", STARTING[5]] {
        let ended = yard.line(&line.replace("{plugin}", &plugin)).expect(PLUGIN);
        assert!(
            ended.stderr.contains("own/tools/python3 has SHA-256"),
            "{ended}"
        );
    }
}

/// True if a planner of one team reads a file.
fn reads(yard: &Yard, plugin: &Path, target: &Path, more: &str, contained: bool) -> bool {
    let more = format!("--budget 60s --option target={} {more}", target.display());
    let line = faulty(plugin, "read-file", &more);
    let ended = if contained {
        in_a_container(yard, &line).unwrap()
    } else {
        yard.run(&line)
    };
    let record = ended.expect(SUCCESS).json();
    record["claimed_metrics"]["reached"] == 1.0
}

#[test]
fn a_team_reads_nothing_of_another_in_the_same_project() {
    let yard = Yard::new();
    let place = |name: &str, mode: u32| {
        let path = yard.path(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(&path, name).unwrap();
        fs::set_permissions(&path, fs::Permissions::from_mode(mode)).unwrap();
        path
    };
    place("project/pyproject.toml", 0o644);
    place("project/.git/HEAD", 0o644);
    let targets = [
        place("project/.env", 0o600),
        place("project/results.sqlite", 0o644),
        place("project/easy.scen", 0o644),
        place("project/b/planner.py", 0o600),
        place("project/b/weights", 0o644),
        // Beside the planner itself.
        place("project/a/closed", 0o600),
        place("project/a/.git/config", 0o644),
    ];
    let own = place("project/a/weights", 0o644);
    let plugin = yard.path("project/a/planner.so");
    fs::copy(faulty_library(), &plugin).unwrap();
    fs::set_permissions(&plugin, fs::Permissions::from_mode(0o755)).unwrap();
    for contained in [false, true] {
        if contained && !have("python3") {
            continue;
        }
        for target in &targets {
            let read = reads(&yard, &plugin, target, "", contained);
            assert!(!read, "{} in a container: {contained}", target.display());
        }
        assert!(reads(&yard, &plugin, &own, "", contained));
        // By option more, but for what is the run's own.
        let project = yard.path("project").display().to_string();
        let plan = yard.path("project/results.sqlite");
        let more = format!("--allow-read {project} --plan-out {}", plan.display());
        assert!(reads(&yard, &plugin, &targets[4], &more, contained));
        fs::write(&plan, "results").unwrap();
        assert!(!reads(&yard, &plugin, &plan, &more, contained));
    }
}

#[test]
fn a_planner_reads_neither_suite_nor_store_nor_scenario_that_lie_beside_it() {
    if !have("python3") {
        return;
    }
    let yard = Yard::new();
    let look = r"
import os
here = os.path.dirname(os.path.abspath(__file__))
names = os.listdir(here)
for name in names:
    if name.endswith(('.scen', '.toml', '.lock')) or '.sqlite' in name:
        try:
            content = open(os.path.join(here, name), 'rb').read()
        except OSError:
            continue
        raise SystemExit(f'it read {name}')
if 'mine' not in names or open(os.path.join(here, 'mine')).read() != 'mine':
    raise SystemExit('it did not find what is its own')
";
    executable(&yard.path("all/planner.py"), &python_plugin(look));
    yard.write("all/mine", "mine");
    for name in ["empty-8-8.map", "empty-8-8-random-1.scen"] {
        fs::copy(map(name), yard.path("all").join(name)).unwrap();
    }
    let suite = "name = \"s\"\n[budget]\nwall = \"60s\"\n[protocol]\nrepeats = 2\n\
                 [[planner]]\nplugin = \"./planner.py\"\n[[instances]]\n\
                 scen = [\"empty-8-8-random-1.scen\"]\nagents = [2]\n";
    yard.write("all/suite.toml", suite);
    yard.write("all/fleetyard.lock", "{\"lock\": 1, \"pinned\": []}");
    let lock = "--lock all/fleetyard.lock";
    yard.line(&format!("plugins pin {lock} ./all/planner.py"))
        .expect(PLUGIN);
    let bench = format!("bench all/suite.toml --store all/s.sqlite {lock}");
    let ended = yard.line(&bench).expect(SUCCESS);
    assert!(
        ended.stderr.is_empty() || !ended.stderr.contains("it read"),
        "{ended}"
    );
    let run = format!(
        "run --map all/empty-8-8.map --scen all/empty-8-8-random-1.scen --agents 2 --budget 60s \
         --planner ./all/planner.py {lock}"
    );
    // The store and the suite are not this command's, and known by their content.
    yard.line(&run).expect(SUCCESS);
    let line = words(&run);
    if let Some(ended) = in_a_container(&yard, &line) {
        ended.expect(SUCCESS);
    }
}

#[test]
fn a_pipe_in_the_place_of_a_plugin_does_not_hang_the_host() {
    let yard = Yard::new();
    fs::create_dir_all(yard.path("plugins/adapter")).unwrap();
    let pipe = yard.path("plugins/pipe").display().to_string();
    for name in ["pipe", "planner.py", "library.so", "adapter/planner.toml"] {
        let path = yard.path("plugins").join(name);
        let made = Command::new("mkfifo").arg(path).status();
        if !made.is_ok_and(|status| status.success()) {
            eprintln!("skipped: there is no mkfifo");
            return;
        }
    }
    executable(&yard.path("plugins/names-it"), &format!("#!{pipe}\n"));
    let manifest = "manifest = 1\nid = \"piped\"\n[program]\ncommand = \"../pipe\"\nargs = []\n\
                    [output]\nformat = \"lacam\"\n";
    yard.write("plugins/named.planner.toml", manifest);
    let folder = yard.path("plugins");
    let ended = yard
        .line_with("plugins list", "FLEETYARD_PLUGIN_PATH", &folder)
        .expect(SUCCESS);
    assert!(ended.stderr.contains("names-it"), "{ended}");
}

// ---- Levels and records ------------------------------------------------------------

#[test]
fn the_record_says_which_layers_were_active() {
    let record = |level: &str| {
        let more = format!("--budget 30s --sandbox {level}");
        let line = faulty(&faulty_library(), "none", &more);
        Yard::new().run(&line).expect(SUCCESS).json()
    };
    let none = record("none");
    assert_eq!(none["planner"]["ranked"], false);
    assert!(!active(&none, "seccomp"));
    let auto = record("auto");
    assert_eq!(auto["planner"]["ranked"], true);
    for state in auto["sandbox"]["layers"].as_array().unwrap() {
        // Either it is there, or somebody says why not.
        assert!(
            state["active"] == true || state["reason"].is_string(),
            "{state}"
        );
    }
    assert_eq!(auto["plan_digest"], none["plan_digest"]);
    let usage = &auto["resources"];
    assert!(usage["peak_memory_kb"].as_u64().unwrap() > 0);
    assert!(usage["cpu_source"].is_string() && usage["peak_memory_source"].is_string());
    assert!(auto["measurement"]["machine_digest"].is_string());
    assert_eq!(auto["sandbox"]["seccomp"]["profile"], "deny-list");
    if refused().is_none() && !only_watched(&auto, "memory") {
        let strict = record("strict");
        assert!(active(&strict, "mount-namespace") && active(&strict, "landlock"));
        let filter = &strict["sandbox"]["seccomp"];
        // Either nothing but what is listed passes, or somebody says why not.
        assert!(
            filter["profile"] == "allow-list" || filter["reason"].is_string(),
            "{filter}"
        );
    }
}

fn effective_user() -> u32 {
    let id = Command::new("id").arg("-u").output().unwrap().stdout;
    String::from_utf8_lossy(&id).trim().parse().unwrap()
}

/// Host, plugin and instance where every user can read them.
struct Public(tempfile::TempDir);

impl Public {
    fn new() -> Self {
        let public = Self(tempfile::tempdir().unwrap());
        let mode = |path: &Path| fs::set_permissions(path, fs::Permissions::from_mode(0o755));
        mode(public.0.path()).unwrap();
        fs::create_dir(public.path("plugins")).unwrap();
        mode(&public.path("plugins")).unwrap();
        for (from, to) in [
            (fleetyard(), "fleetyard"),
            (faulty_library(), "plugins/faulty.so"),
            (map("empty-8-8.map").into(), "empty-8-8.map"),
            (
                map("empty-8-8-random-1.scen").into(),
                "empty-8-8-random-1.scen",
            ),
        ] {
            fs::copy(from, public.path(to)).unwrap();
            mode(&public.path(to)).unwrap();
        }
        public
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// As [`faulty`], from here.
    fn faulty(fault: &str, more: &str) -> Vec<String> {
        words(&format!(
            "run --map empty-8-8.map --scen empty-8-8-random-1.scen --agents 3 --planner \
             ./plugins/faulty.so --option fault={fault} --format json {more}"
        ))
    }
}

/// Starts the command where a filter of system calls refuses namespaces and mounts, as
/// a container does.
fn in_a_container(yard: &Yard, line: &[String]) -> Option<Ended> {
    launched(&yard.path(""), &fleetyard(), true, effective_user(), line)
}

/// Starts a program as a user, with or without that filter; `None` where that user cannot be
/// had, or cannot start it.
fn launched(
    folder: &Path,
    program: &Path,
    refused: bool,
    user: u32,
    line: &[String],
) -> Option<Ended> {
    if !have("python3") {
        return None;
    }
    let me = effective_user();
    if user != me && me != 0 {
        return None;
    }
    let wanted = format!("{{\"refused\": {refused}, \"uid\": {user}, \"gid\": {user}}}");
    let script = root().join("scripts/isolation.py");
    if user != me && program.is_absolute() {
        fs::set_permissions(folder, fs::Permissions::from_mode(0o755)).unwrap();
        let tried = Command::new("python3")
            .arg(&script)
            .args(["--launch", &wanted, "test", "-x"])
            .arg(program)
            .current_dir(folder)
            .status()
            .unwrap();
        if !tried.success() {
            eprintln!("skipped: user {user} cannot start the command where it was built");
            return None;
        }
    }
    let mut child = Command::new("python3")
        .arg(script)
        .args(["--launch", &wanted])
        .arg(program)
        .args(line)
        .current_dir(folder)
        .env_remove("XDG_RUNTIME_DIR")
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let (mut stdout, mut stderr) = (String::new(), String::new());
    child
        .stdout
        .take()
        .unwrap()
        .read_to_string(&mut stdout)
        .unwrap();
    child
        .stderr
        .take()
        .unwrap()
        .read_to_string(&mut stderr)
        .unwrap();
    Some(Ended {
        code: child.wait().unwrap().code(),
        stdout,
        stderr,
        left: Vec::new(),
        hanging: Vec::new(),
    })
}

#[test]
fn the_doctor_tries_what_is_promised_and_says_what_does_not_hold() {
    let standing = |findings: &Value, name: &str| {
        let promises = findings["promises"].as_array().unwrap();
        let promise = promises.iter().find(|promise| promise["name"] == name);
        promise.unwrap()["standing"].as_str().unwrap().to_owned()
    };
    let line = words("doctor --security --format json");
    if refused().is_none() {
        let findings = Yard::new().run(&line).expect(SUCCESS).json();
        for name in ["files", "network", "other-processes", "rights", "kernel"] {
            assert_eq!(standing(&findings, name), "holds", "{findings:#}");
        }
    }
    // Without a namespace of processes the others can be seen, and that is said.
    let Some(ended) = in_a_container(&Yard::new(), &line) else {
        return;
    };
    let findings = ended.expect(NO_PLAN).json();
    assert_eq!(standing(&findings, "other-processes"), "broken");
    assert_eq!(standing(&findings, "files"), "weaker");
    assert!(
        findings["promises"]
            .to_string()
            .contains("see another process")
    );
}

#[test]
fn what_a_container_refuses_is_in_the_record_not_hidden() {
    let yard = Yard::new();
    let line = faulty(&faulty_library(), "none", "--budget 30s");
    let Some(ended) = in_a_container(&yard, &line) else {
        return;
    };
    let record = ended.expect(SUCCESS).json();
    let layers = record["sandbox"]["layers"].as_array().unwrap();
    for layer in ["user-namespace", "pid-namespace", "mount-namespace"] {
        let state = layers.iter().find(|state| state["layer"] == layer).unwrap();
        assert_eq!(state["active"], false, "{state}");
        assert_eq!(state["errno"], "EPERM", "{state}");
    }
    // What is left still holds.
    assert!(active(&record, "seccomp") && active(&record, "no-new-privileges"));

    // A plugin that only its owner can read cannot be run as another user there.
    let private = yard.path("private.so");
    fs::copy(faulty_library(), &private).unwrap();
    fs::set_permissions(&private, fs::Permissions::from_mode(0o700)).unwrap();
    let line = faulty(&private, "none", "--budget 30s");
    let record = in_a_container(&yard, &line).unwrap().expect(SUCCESS).json();
    assert!(!active(&record, "own-user") && active(&record, "seccomp"));

    let line = faulty(&faulty_library(), "none", "--sandbox strict");
    let ended = in_a_container(&yard, &line).unwrap();
    assert_eq!(ended.code, Some(PLUGIN), "{ended}");
    for text in ["refuses layers of the sandbox", "EPERM", "fleetyard doctor"] {
        assert!(ended.stderr.contains(text), "{ended}");
    }
    let ended = in_a_container(&yard, &words("doctor --sandbox strict")).unwrap();
    assert_eq!(ended.code, Some(NO_PLAN), "{ended}");
    assert!(ended.stdout.contains("What you can do"), "{ended}");
}

#[test]
fn strict_says_why_more_than_the_listed_calls_pass() {
    if refused().is_some() {
        return;
    }
    let auto = Yard::new().run(&faulty(&faulty_library(), "none", "--budget 30s"));
    if only_watched(&auto.json(), "memory") {
        eprintln!("skipped: memory is only watched here, so that strict does not run");
        return;
    }
    // An interpreter for which the listed calls are not enough, as far as anybody can see.
    let yard = Yard::new();
    let julia = yard.write("julia", "#!/bin/sh\nexit 3\n");
    fs::set_permissions(&julia, fs::Permissions::from_mode(0o755)).unwrap();
    let path = format!("{}:/usr/bin:/bin", yard.path("").display());
    let yard = yard.set("PATH", &path);
    let line = faulty(&faulty_library(), "none", "--budget 30s --sandbox strict");
    let record = yard.run(&line).expect(SUCCESS).json();
    let filter = &record["sandbox"]["seccomp"];
    assert_eq!(filter["profile"], "deny-list", "{filter}");
    let reason = filter["reason"].as_str().unwrap();
    assert!(reason.contains("julia ended with code 3"), "{reason}");
}

/// Becomes an ordinary user of a machine where nobody may make user namespaces, then a
/// command.
const WITHOUT_USER_NAMESPACES: &str = r#"
import ctypes, os, sys
inside, outside, ready, go = *os.pipe(), *os.pipe()
child = os.fork()
if child == 0:
    if ctypes.CDLL(None).unshare(0x10000000) != 0:
        sys.exit(77)
    os.write(outside, b"x")
    os.read(ready, 1)
    os.setgid(0), os.setuid(0)
    with open("/proc/sys/user/max_user_namespaces", "w") as most:
        most.write("0")
    os.setgroups([]), os.setgid(1234), os.setuid(1234)
    os.execvp(sys.argv[1], sys.argv[1:])
os.close(outside)
if os.read(inside, 1) == b"x":
    for kind in ("uid", "gid"):
        with open(f"/proc/{child}/{kind}_map", "w") as where:
            where.write("0 0 65536\n")
    os.write(go, b"x")
sys.exit(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"#;

#[test]
fn bwrap_makes_the_namespaces_where_only_it_may() {
    let root = Command::new("id").arg("-u").output().unwrap().stdout == b"0\n";
    if !root || !have("python3") || !have("bwrap") {
        eprintln!("skipped: this needs root, Python and bwrap");
        return;
    }
    // Where another user can read it; a set-user-identifier program, as on machines
    // that keep namespaces from everybody else.
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let mode = |path: &Path, mode| fs::set_permissions(path, fs::Permissions::from_mode(mode));
    mode(folder.path(), 0o755).unwrap();
    let bwrap = Command::new("sh")
        .args(["-c", "command -v bwrap"])
        .output()
        .unwrap();
    fs::copy(
        String::from_utf8(bwrap.stdout).unwrap().trim(),
        path("bwrap"),
    )
    .unwrap();
    mode(&path("bwrap"), 0o4755).unwrap();
    fs::copy(fleetyard(), path("fleetyard")).unwrap();
    for name in ["empty-8-8.map", "empty-8-8-random-1.scen"] {
        fs::copy(map(name), path(name)).unwrap();
        mode(&path(name), 0o644).unwrap();
    }
    let output = Command::new("python3")
        .args(["-c", WITHOUT_USER_NAMESPACES, "./fleetyard"])
        .args(words(
            "run --map empty-8-8.map --scen empty-8-8-random-1.scen --agents 3",
        ))
        .args(words("--planner lacam --budget 30s --format json"))
        .current_dir(folder.path())
        .env("PATH", format!("{}:/usr/bin:/bin", folder.path().display()))
        .env_remove("XDG_RUNTIME_DIR")
        .output()
        .unwrap();
    if output.status.code() == Some(77) {
        eprintln!("skipped: this machine refuses user namespaces to root");
        return;
    }
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(SUCCESS), "{stderr}");
    let record: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(record["sandbox"]["backend"], "bwrap", "{record}");
    assert!(active(&record, "pid-namespace") && active(&record, "mount-namespace"));
}

// ---- In the host's own process -----------------------------------------------------

/// Runs a faulty library in the host's process and has its plan executed: the record, and
/// the mode of the trace's file.
fn beside_the_simulator(yard: &Yard, library: &Path, fault: &str) -> (Value, u32) {
    let trace = yard.path("trace");
    let more = format!(
        "--attach in-process --budget 60s --trace-out {}",
        trace.display()
    );
    let record = yard
        .run(&faulty(library, fault, &more))
        .expect(SUCCESS)
        .json();
    (record, fs::metadata(trace).unwrap().permissions().mode())
}

fn broken_promises(record: &Value) -> Vec<(&str, &str)> {
    let broken = record["broken_promises"].as_array().unwrap();
    let parts = broken.iter().map(|broken| {
        assert_eq!(
            (&broken["undone"], &broken["certain"]),
            (&true.into(), &true.into())
        );
        (
            broken["during"].as_str().unwrap(),
            broken["what"].as_str().unwrap(),
        )
    });
    parts.collect()
}

#[test]
fn what_a_library_leaves_in_the_hosts_process_is_put_back_and_named() {
    // Fault, and what of the promise that it breaks is named.
    let cases = [
        ("leaves-ftz", "flush-to-zero"),
        ("leaves-rounding", "the rounding"),
        ("leaves-traps", "the traps"),
        ("leaves-umask", "the umask (0777"),
        ("leaves-cwd", "the working directory"),
        ("leaves-signals", "the handlers of SIGINT, SIGTERM"),
        ("leaves-signals", "the signal mask"),
        ("leaves-locale", "the thread's locale"),
        ("leaves-limits", "the limit of open files"),
        ("leaves-limits", "the limit of the size of files"),
        (
            "leaves-environment",
            "the environment variable PATH and 1 more",
        ),
        ("leaves-timer", "the timer of wall time"),
        ("leaves-streams", "standard output"),
        ("leaves-thread", "the thread's name"),
    ];
    let library = faulty_library();
    let (honest, mode) = beside_the_simulator(&Yard::new(), &library, "none");
    assert!(broken_promises(&honest).is_empty(), "{honest}");
    let digest = &honest["execution"]["trace_digest"];
    assert!(digest.is_string(), "{honest}");
    each(cases, |(fault, what)| {
        let arithmetic = what.starts_with("flush") || what == "the rounding" || what == "the traps";
        if arithmetic && !cfg!(any(target_arch = "x86_64", target_arch = "aarch64")) {
            return;
        }
        let (record, with) = beside_the_simulator(&Yard::new(), &library, fault);
        assert_eq!(&record["execution"]["trace_digest"], digest, "{fault}");
        assert_eq!(with, mode, "{fault}");
        let broken = broken_promises(&record);
        let named = |(during, found): &(&str, &str)| *during == "plan" && found.starts_with(what);
        assert!(broken.iter().any(named), "{fault}: {broken:?}");
        assert!(
            broken.iter().all(|(during, _)| *during == "plan"),
            "{broken:?}"
        );
    });
}

#[test]
fn a_library_that_flushes_to_zero_on_being_loaded_is_found_out() {
    if !cfg!(any(target_arch = "x86_64", target_arch = "aarch64")) {
        return;
    }
    // As one that was linked with -ffast-math.
    let library = c_library("plugins/faulty/faulty.c", Some("CONSTRUCTOR_FAULT"));
    let yard = Yard::new().set("FLEETYARD_FAULT", "leaves-ftz");
    let (record, _) = beside_the_simulator(&yard, &library, "none");
    let found = ("load", "flush-to-zero of denormal numbers");
    assert_eq!(broken_promises(&record), [found], "{record}");
}

// ---- The end of the host -----------------------------------------------------------

/// A planner that leaves a daemon behind when it is started, and then never answers.
const HANGS: &str = r"
import ctypes, os, time
if os.fork() == 0:
    os.setsid()
    if os.fork() != 0:
        os._exit(0)
    os.closerange(0, 64)
    ctypes.CDLL(None).prctl(15, b'fy-daemon', 0, 0, 0)
    while True:
        time.sleep(60)
while True:
    time.sleep(60)
";

/// Starts a comparison whose second planner is that one, and waits until the daemon is
/// there.
fn in_the_middle_of_a_comparison(yard: &Yard, level: &str) -> Started {
    yard.write("hangs.py", HANGS);
    let mut line = words("compare --budget 60s --planner lacam --planner ./hangs.py --format json");
    line.extend(["--sandbox".into(), level.into()]);
    line.extend(instance("empty-8-8", 3));
    let started = yard.start(&line);
    let has_daemon = || {
        let processes = started.processes();
        processes.iter().any(|process| process.name == "fy-daemon")
    };
    assert!(until(has_daemon), "{:?}", started.processes());
    started
}

#[test]
fn a_killed_host_leaves_nothing() {
    if !have("python3") {
        return;
    }
    for level in ["auto", "none"] {
        let yard = Yard::new();
        let mut started = in_the_middle_of_a_comparison(&yard, level);
        let before = yard.files();
        started.child.kill().unwrap();
        started.child.wait().unwrap();
        let gone = until(|| started.processes().is_empty());
        assert!(gone, "{level}: {:?}", started.processes());
        assert_eq!(yard.files(), before);
    }
}

#[test]
fn a_scratch_folder_that_lets_nobody_in_is_removed() {
    for level in ["none", "auto"] {
        let state = tempfile::tempdir().unwrap();
        let yard = Yard::new().set("XDG_RUNTIME_DIR", &state.path().display().to_string());
        let more = format!("--budget 60s --sandbox {level}");
        let record = yard
            .run(&faulty(&faulty_library(), "closed-folders", &more))
            .expect(SUCCESS)
            .json();
        assert_eq!(
            record["claimed_metrics"]["reached"], 1.0,
            "{level}: {record}"
        );
        let left: Vec<_> = fs::read_dir(state.path().join("fleetyard/scratch"))
            .unwrap()
            .collect();
        assert!(left.is_empty(), "{level}: {left:?}");
    }
}

/// A planner that leaves a daemon behind as the one above, with an empty environment; and
/// how it is found.
const HIDES: &str = r"
import os, sys, time
if os.fork() == 0:
    os.setsid()
    if os.fork() != 0:
        os._exit(0)
    os.closerange(0, 64)
    code = 'import time\nwhile True: time.sleep(60)'
    os.execve(sys.executable, [sys.executable, '-c', code, 'hidden:' + os.path.abspath(__file__)], {})
while True:
    time.sleep(60)
";

/// The processes that have a word on their command line.
fn with_word(word: &str) -> Vec<String> {
    let entries = fs::read_dir("/proc").unwrap().flatten();
    let lines = entries.filter_map(|entry| fs::read(entry.path().join("cmdline")).ok());
    let words = lines.map(|line| String::from_utf8_lossy(&line).replace('\0', " "));
    words.filter(|line| line.trim().ends_with(word)).collect()
}

#[test]
fn a_daemon_without_an_environment_is_ended_at_the_next_start() {
    if !have("python3") {
        return;
    }
    // Of its own, so that no other command finds the run first.
    let state = tempfile::tempdir().unwrap();
    let runtime = state.path().display().to_string();
    let yard = Yard::new().set("XDG_RUNTIME_DIR", &runtime);
    yard.write("hides.py", HIDES);
    let mut line = words("run --budget 60s --planner ./hides.py --format json --sandbox none");
    line.extend(instance("empty-8-8", 3));
    let mut started = yard.start(&line);
    let word = format!("hidden:{}", yard.path("hides.py").display());
    assert!(
        until(|| !with_word(&word).is_empty()),
        "{:?}",
        started.processes()
    );
    let processes = started.processes();
    for signal in ["STOP", "KILL"] {
        for process in &processes {
            process.signal(signal);
        }
    }
    started.child.wait().unwrap();
    assert!(until(|| started.processes().is_empty()));
    assert_eq!(with_word(&word).len(), 1, "it ended by itself");
    yard.line("plugins list").expect(SUCCESS);
    assert!(
        until(|| with_word(&word).is_empty()),
        "{:?}",
        with_word(&word)
    );
}

#[test]
fn orphans_of_a_host_that_died_with_its_supervisor_are_ended_at_the_next_start() {
    if !have("python3") {
        return;
    }
    // Without namespaces, so that nothing ends the daemon by itself.
    let yard = Yard::new();
    let mut started = in_the_middle_of_a_comparison(&yard, "none");
    let processes = started.processes();
    let (plugin, host): (Vec<_>, Vec<_>) = processes
        .into_iter()
        .partition(|process| process.command.starts_with("python3"));
    assert!(plugin.len() >= 2 && host.len() >= 2, "{plugin:?} {host:?}");
    for process in &host {
        process.signal("STOP");
    }
    for process in &host {
        process.signal("KILL");
    }
    started.child.wait().unwrap();
    let hosts_gone = || {
        let processes = started.processes();
        processes
            .iter()
            .all(|process| process.command.starts_with("python3"))
    };
    assert!(until(hosts_gone), "{:?}", started.processes());
    Yard::new().line("plugins list").expect(SUCCESS);
    let gone = until(|| started.processes().is_empty());
    assert!(gone, "{:?}", started.processes());
}
