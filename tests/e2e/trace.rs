//! `fleetyard trace`: traces described, compared and turned into other files.

use std::fs;
use std::process::Command;

use fleetyard_testkit::{Ended, INPUT, NO_PLAN, SUCCESS, USAGE, Yard, root};
use serde_json::Value;

/// Three agents, of which two swap places and one runs into a pillar.
fn yard() -> Yard {
    let yard = Yard::new();
    yard.write(
        "a.map",
        "type octile\nheight 3\nwidth 4\nmap\n....\n.@..\n....\n",
    );
    yard.write(
        "plan.json",
        r#"{"format": "fleetyard.plan/1", "rows": 3, "cols": 4, "paths": [
            [[0, 0], [0, 1], [0, 2]], [[0, 2], [0, 1], [0, 0]], [[2, 0], [1, 0], [1, 1]]]}"#,
    );
    simulate(&yard, "a.fyt", "");
    yard
}

fn simulate(yard: &Yard, trace: &str, options: &str) -> Ended {
    let line =
        format!("simulate --map a.map plan.json --ticks-hz 10 --trace-out {trace} {options}");
    yard.line(&line).expect(SUCCESS)
}

#[test]
fn a_trace_is_described() {
    let yard = yard();
    let text = yard.line("trace info a.fyt").expect(SUCCESS).stdout;
    for part in [
        "intact, states and events match",
        "3 × 4 cells",
        "21, every tick, to tick 20 (2.00 s)",
        "2 (1 between agents, 1 with obstacles, 0 with moving ones)",
        "agent 0 begins to touch agent 1",
        "agent 2 begins to touch cell 5",
    ] {
        assert!(text.contains(part), "{part}: {text}");
    }
    let json = yard
        .line("trace info a.fyt --format json")
        .expect(SUCCESS)
        .json();
    assert_eq!(json["header"]["agents"], 3);
    assert_eq!(json["scene"]["cells"]["solid"], 1);
    assert_eq!(json["counts"]["contacts_agent_agent"], 1);
    assert_eq!(json["summary"]["ticks"], 20);
    assert_eq!(json["damage"], Value::Null);
}

#[test]
fn a_damaged_trace_is_described_as_far_as_it_goes() {
    let yard = yard();
    let bytes = yard.read("a.fyt");
    yard.write("cut.fyt", &bytes[..bytes.len() - 60]);
    let ended = yard.line("trace info cut.fyt").expect(INPUT);
    assert!(ended.stdout.contains("damaged"), "{ended}");
    assert!(ended.stdout.contains("to tick 20"), "{ended}");
    assert!(
        ended.stderr.contains("ends within the piece at byte"),
        "{ended}"
    );
    assert!(ended.stderr.contains("hint: "), "{ended}");
    // What is intact can still be had.
    yard.line("trace export cut.fyt --csv cut.csv --json cut.json")
        .expect(INPUT);
    yard.line("trace export a.fyt --csv a.csv").expect(SUCCESS);
    assert_eq!(yard.read("cut.csv"), yard.read("a.csv"));
    let json: Value = serde_json::from_slice(&yard.read("cut.json")).unwrap();
    assert_eq!(json["summary"], Value::Null);
    let mut flipped = bytes;
    let at = flipped.len() / 2;
    flipped[at] ^= 4;
    yard.write("flipped.fyt", flipped);
    let ended = yard.line("trace info flipped.fyt").expect(INPUT);
    assert!(ended.stderr.contains("byte"), "{ended}");
    let ended = yard.line("trace diff a.fyt flipped.fyt").expect(INPUT);
    assert!(ended.stderr.contains("flipped.fyt: "), "{ended}");
}

#[test]
fn what_is_no_trace_is_refused() {
    let yard = yard();
    yard.write("empty.fyt", "");
    let mut newer = yard.read("a.fyt");
    newer[8] = 9;
    yard.write("newer.fyt", newer);
    for (file, reason) in [
        ("none.fyt", "none.fyt: no such file"),
        (".", "a folder"),
        ("empty.fyt", "empty.fyt: the file is empty"),
        ("a.map", "a.map: this is not a trace file"),
        ("newer.fyt", "newer.fyt: the trace has version 9"),
    ] {
        for command in ["info", "diff a.fyt", "export --csv out.csv"] {
            let ended = yard.line(&format!("trace {command} {file}")).expect(INPUT);
            assert!(ended.stderr.contains(reason), "{ended}");
            assert!(ended.stderr.contains("hint: "), "{ended}");
            assert!(!yard.path("out.csv").exists());
        }
    }
    for line in [
        "trace export a.fyt",
        "trace export a.fyt --csv out.csv --every 0",
        "trace diff a.fyt a.fyt --tolerance -1",
        "trace diff a.fyt a.fyt --tolerance nan",
    ] {
        yard.line(line).expect(USAGE);
    }
    let ended = yard.line("trace export a.fyt --json a.fyt").expect(INPUT);
    assert!(ended.stderr.contains("would be replaced"), "{ended}");
    let ended = yard
        .line("trace export a.fyt --csv no/out.csv")
        .expect(INPUT);
    assert!(
        ended.stderr.contains("no/out.csv: cannot be written"),
        "{ended}"
    );
}

#[test]
fn the_first_difference_is_found() {
    let yard = yard();
    simulate(&yard, "again.fyt", "");
    let ended = yard.line("trace diff a.fyt again.fyt").expect(SUCCESS);
    assert!(
        ended.stdout.contains("the same execution, after 21 states"),
        "{ended}"
    );
    assert_eq!(yard.read("a.fyt"), yard.read("again.fyt"));

    simulate(&yard, "wide.fyt", "--radius 0.4");
    let ended = yard.line("trace diff a.fyt wide.fyt").expect(NO_PLAN);
    assert!(ended.stdout.contains("header    profiles is"), "{ended}");
    assert!(ended.stdout.contains("events    first number 0"), "{ended}");
    assert!(!ended.stdout.contains("states    first"), "{ended}");

    // The third agent goes elsewhere after its first step.
    let plan = String::from_utf8(yard.read("plan.json")).unwrap();
    yard.write(
        "plan.json",
        plan.replace("[1, 0], [1, 1]]", "[1, 0], [0, 0]]"),
    );
    simulate(&yard, "other.fyt", "");
    let ended = yard.line("trace diff a.fyt other.fyt").expect(NO_PLAN);
    let line = "states    first at tick 11 (1.10 s), body 2: x_m is 0.6 and 0.5";
    assert!(ended.stdout.contains(line), "{ended}");
    let json = yard
        .line("trace diff a.fyt other.fyt --format json")
        .expect(NO_PLAN)
        .json();
    assert_eq!(json["state"]["tick"], 11);
    assert_eq!(json["largest"], 1.0);
    assert_eq!(json["same"], false);
    // Nothing is farther apart than two metres or seconds, but events and digests differ.
    let ended = yard
        .line("trace diff a.fyt other.fyt --tolerance 2")
        .expect(NO_PLAN);
    assert!(!ended.stdout.contains("states    first"), "{ended}");
}

#[test]
fn states_and_events_are_exported() {
    let yard = yard();
    let line = "trace export a.fyt --csv s.csv --events e.csv --json all.json --every 5";
    yard.line(line).expect(SUCCESS);
    let csv = String::from_utf8(yard.read("s.csv")).unwrap();
    let lines: Vec<&str> = csv.lines().collect();
    assert_eq!(lines.len(), 1 + 5 * 3);
    assert_eq!(lines[0], "tick,time_s,body,x_m,y_m");
    assert_eq!(lines[1], "0,0.0,0,0.5,2.5");
    assert_eq!(lines[15], "20,2.0,2,1.5,1.5");
    let events = String::from_utf8(yard.read("e.csv")).unwrap();
    assert_eq!(
        events.lines().next(),
        Some("time_s,substep,kind,agent,other,index")
    );
    assert!(events.contains(",begin,0,agent,1\n"), "{events}");
    assert!(events.contains(",begin,2,cell,5\n"), "{events}");
    let all: Value = serde_json::from_slice(&yard.read("all.json")).unwrap();
    let records = all["records"].as_array().unwrap();
    let ticks: Vec<&Value> = records
        .iter()
        .filter(|record| record["tick"].is_u64())
        .collect();
    assert_eq!(ticks.len(), 5);
    assert_eq!(ticks[4]["x_m"][2], 1.5);
    assert_eq!(
        all["scene"]["cells"]["solid_runs"],
        serde_json::json!([[1, 1, 1]])
    );
    assert_eq!(all["summary"]["contacts_agent_agent"], 1);
    // A pipe is written to, not replaced.
    let ended = yard
        .line("trace export a.fyt --events /dev/stdout")
        .expect(SUCCESS);
    assert_eq!(ended.stdout, events);
    // Nothing but what was asked for.
    let files = yard.files();
    assert!(files.iter().all(|file| !file.contains("tmp")), "{files:?}");
}

#[test]
fn a_reader_in_another_language_gets_the_same_bits() {
    let can = Command::new("python3")
        .args(["-c", "import zstandard"])
        .output()
        .is_ok_and(|ended| ended.status.success());
    if !can {
        eprintln!("skipped: python3 has no package zstandard");
        return;
    }
    let yard = yard();
    // With headings, knots, moving obstacles and every kind of event.
    let everything = root().join("tests/fuzz/corpus/trace/everything.fyt");
    fs::copy(everything, yard.path("everything.fyt")).unwrap();
    for trace in ["a.fyt", "everything.fyt"] {
        let script = root().join("scripts/read_trace.py");
        let read = Command::new("python3")
            .arg(script)
            .arg(yard.path(trace))
            .output()
            .unwrap();
        yard.line(&format!("trace export {trace} --csv s.csv"))
            .expect(SUCCESS);
        let csv = String::from_utf8(yard.read("s.csv")).unwrap();
        let without_time = |line: &str| {
            let mut fields: Vec<&str> = line.split(',').collect();
            fields.remove(1);
            fields.join(",")
        };
        let expected: Vec<String> = csv.lines().map(without_time).collect();
        let read = String::from_utf8(read.stdout).unwrap();
        assert_eq!(read.lines().collect::<Vec<_>>(), expected);
    }
}
