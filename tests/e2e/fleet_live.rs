//! `fleet --live`: commands while a fleet drives, and that a recording has what was done to it.

use std::io::Write;
use std::process::Stdio;

use fleetyard_testkit::{Ended, SUCCESS, USAGE, Yard, root, words};
use serde_json::Value;

/// A fleet on a map of the repository.
fn line(more: &str) -> String {
    let maps = root().join("maps").display().to_string();
    format!(
        "fleet --map {maps}/warehouse-4-6-6-2-1.map --agents 12 --planner pibt --duration 40s --seed 3 \
         --threads 1 --format json {more}"
    )
}

/// Runs a command to its end with these lines on standard input, which is open until then.
fn hearing(yard: &Yard, line: &str, commands: &[&str]) -> Ended {
    let started = yard.start_with(fleetyard_testkit::fleetyard(), &words(line), |command| {
        command.stdin(Stdio::piped());
    });
    let mut text = commands.join("\n");
    text.push('\n');
    started.wait_by(|started| {
        let mut input = started.child.stdin.take().unwrap();
        input.write_all(text.as_bytes()).unwrap();
        let status = started.child.wait().ok();
        drop(input);
        status
    })
}

fn lines(ended: &Ended) -> Vec<Value> {
    let read = |line: &str| serde_json::from_str(line).unwrap();
    ended.stdout.lines().map(read).collect()
}

fn digest(outcome: &Value) -> &Value {
    &outcome["execution"]["trace_digest"]
}

#[test]
fn a_live_fleet_to_which_nothing_is_done_is_the_same() {
    let yard = Yard::new();
    let usual = yard.line(&line("")).expect(SUCCESS).json();
    let live = hearing(
        &yard,
        &line("--live --trace live.trace"),
        &["{\"pause\":true}", "{\"step\":3}", "{\"pause\":false}"],
    );
    let said = lines(&live.expect(SUCCESS));
    // What a viewer needs comes first.
    assert_eq!(said[0]["meta"]["agents"], 12);
    let outcome = &said.last().unwrap()["record"];
    assert!(digest(&usual).is_string(), "{usual}");
    assert_eq!(digest(outcome), digest(&usual));
    // It was shown meanwhile.
    assert!(said.iter().any(|line| line["clip"].is_string()));
    assert!(said.iter().any(|line| line["point"].is_object()));
}

#[test]
fn a_replay_has_what_was_done_to_the_fleet() {
    let yard = Yard::new();
    let usual = yard.line(&line("")).expect(SUCCESS).json();
    let map = std::fs::read_to_string(root().join("maps/warehouse-4-6-6-2-1.map")).unwrap();
    let rows: Vec<&str> = map.lines().skip(4).collect();
    let cell = rows
        .concat()
        .bytes()
        .position(|letter| letter == b'.')
        .unwrap();
    let close = format!("{{\"close\":{{\"cell\":{cell},\"for_s\":10}}}}");
    let send = format!("{{\"send\":{{\"agent\":7,\"cell\":{cell}}}}}");
    let commands = [
        &send,
        "{\"pause\":true}",
        "{\"hold\":{\"agent\":3,\"for_s\":15}}",
        &close,
        "{\"hold\":{\"agent\":99,\"for_s\":15}}",
        "{\"close\":{\"cell\":4000000,\"for_s\":1}}",
        "{\"send\":{\"agent\":7,\"cell\":0}}",
        "{\"shout\":1}",
        "{\"pause\":false}",
    ];
    let live = hearing(&yard, &line("--live --record fleet.jsonl"), &commands).expect(SUCCESS);
    let said = lines(&live);
    let count = |key: &str| said.iter().filter(|line| !line[key].is_null()).count();
    assert_eq!((count("intervened"), count("refused")), (3, 4), "{live}");
    let outcome = &said.last().unwrap()["record"];
    assert_ne!(digest(outcome), digest(&usual));
    let again = yard
        .line("fleet --replay fleet.jsonl --format json")
        .expect(SUCCESS)
        .json();
    assert_eq!(digest(&again), digest(outcome));
    // A run that is stopped has a recording, too.
    let stopped = hearing(
        &yard,
        &line("--live --record stopped.jsonl"),
        &["{\"hold\":{\"agent\":1,\"for_s\":5}}", "{\"stop\":true}"],
    );
    assert_eq!(
        lines(&stopped.expect(SUCCESS)).last().unwrap()["record"]["ended"],
        "interrupted"
    );
    yard.line("fleet --replay stopped.jsonl --format json")
        .expect(SUCCESS);
}

#[test]
fn a_fleet_that_follows_the_clock_cannot_be_paused() {
    let yard = Yard::new();
    let ended = yard.line(&line("--live --clock realtime")).expect(USAGE);
    assert!(ended.stderr.contains("--clock"), "{ended}");
}
