//! `run --follow`: plans as they come, and then the record.

use fleetyard_testkit::{SUCCESS, Yard, root};
use serde_json::Value;

/// A run of a planner that goes on to better plans.
fn line(more: &str) -> String {
    let maps = root().join("maps").display().to_string();
    format!(
        "run --map {maps}/random-32-32-20.map --scen {maps}/random-32-32-20-random-1.scen \
         --agents 40 --budget 2s --seed 1 --follow {more}"
    )
}

#[test]
fn plans_come_as_lines_and_the_record_is_the_last() {
    for attach in ["worker", "in-process"] {
        let more = format!("--planner lacam --attach {attach} --format json");
        let ended = Yard::new().line(&line(&more)).expect(SUCCESS);
        let read = |line: &str| serde_json::from_str::<Value>(line).unwrap();
        let mut lines: Vec<Value> = ended.stdout.lines().map(read).collect();
        let record = lines.pop().unwrap()["record"].take();
        assert!(lines.len() > 1, "{ended}");
        let judged = record["metrics"]["incumbents"].as_array().unwrap();
        assert_eq!(lines.len(), judged.len());
        for (line, judged) in lines.iter().zip(judged) {
            let claimed = &line["incumbent"];
            assert_eq!(claimed["claimed"], true);
            assert_eq!(claimed["unit"], "steps");
            assert_eq!(claimed["at_ms"], judged["time_ms"]);
            assert_eq!(claimed["soc"].as_f64(), judged["soc_steps"].as_f64());
        }
        let last = &lines.last().unwrap()["incumbent"];
        assert_eq!(
            last["makespan"].as_f64(),
            record["metrics"]["makespan_steps"].as_f64()
        );
    }
}

#[test]
fn people_get_the_record_as_text() {
    let ended = Yard::new().line(&line("--planner pibt")).expect(SUCCESS);
    let (first, rest) = ended.stdout.split_once('\n').unwrap();
    assert!(first.starts_with("{\"incumbent\":{\"at_ms\":"), "{ended}");
    assert!(rest.contains("pibt") && !rest.contains('{'), "{ended}");
}
