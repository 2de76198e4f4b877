//! The League of Robot Runners: `fleetyard fleet --instance … --rules synchronous`.
//!
//! `tests/league/corridor.json` is a robot in a corridor of five cells, with tasks whose steps can
//! be counted by hand.

use std::fs;

use fleetyard_testkit::{INPUT, NO_PLAN, SUCCESS, USAGE, Yard, root, words};
use serde_json::{Value, json};

fn corridor() -> String {
    let path = root().join("tests/league/corridor.json");
    path.display().to_string()
}

/// A run by synchronous rules.
fn line(instance: &str, more: &str) -> Vec<String> {
    let mut line = words("fleet --rules synchronous --format json --instance");
    line.push(instance.to_owned());
    line.extend(words(more));
    if !more.contains("--duration") {
        line.extend(words("--duration 20s"));
    }
    line
}

fn outcome(instance: &str, more: &str) -> Value {
    let ended = Yard::new().run(&line(instance, more)).expect(SUCCESS);
    let outcome = ended.json();
    assert_eq!(outcome["execution"]["contacts"], 0);
    outcome
}

/// Steps, tasks, errands, and steps without a plan of the planner.
fn counts(outcome: &Value) -> [u64; 4] {
    let metrics = &outcome["metrics"];
    let counts = [
        &metrics["synchronous"]["steps"],
        &metrics["tasks_done"],
        &metrics["goals_reached"],
        &metrics["synchronous"]["unplanned"],
    ];
    counts.map(|count| count.as_u64().unwrap())
}

/// The robot begins in cell 0, looks east, and has task 0 (cells 4, then 2) and task 1 (cell 3) in
/// turn. A robot that turns is in 4 after 4 steps, has turned after 6, is in 2 after 8; has turned
/// after 10, is in 3 after 11. From there each round takes 8: one step, 2 turns and 2 steps, 2
/// turns and one step. So errands are done after 4, 8, 11, 12, 16, 19 and 20 steps, tasks after 8,
/// 11, 16 and 19. A pebble does errands after 4, 6, 7, 8, 10, 11, 12, 14, 15, 16, 18, 19 and 20.
#[test]
fn steps_tasks_and_errands_are_those_that_are_counted_by_hand() {
    let turning = outcome(&corridor(), "--planner pp");
    assert_eq!(counts(&turning), [20, 4, 7, 0]);
    assert_eq!(turning["metrics"]["synchronous"]["tasks_per_step"], 0.2);
    assert_eq!(turning["metrics"]["planner_calls"], 20);
    assert_eq!(turning["config"]["rules"], "synchronous");
    assert_eq!(turning["config"]["motion"], "rotation");
    for planner in ["pp", "pibt"] {
        let more = format!("--model pebble --planner {planner}");
        assert_eq!(
            counts(&outcome(&corridor(), &more)),
            [20, 8, 13, 0],
            "{planner}"
        );
    }
    // After the last step nothing is asked any more.
    let short = outcome(&corridor(), "--planner pp --duration 8s");
    assert_eq!(counts(&short), [8, 1, 2, 0]);
}

/// Two robots at each other's heels, and four in a ring, move in the same step.
#[test]
fn a_cell_may_be_entered_in_the_step_in_which_it_is_left() {
    let yard = Yard::new();
    let write = |agents: &str, tasks: &str, map: &str| {
        yard.write("a.map", format!("type octile\n{map}"));
        yard.write("a.agents", agents);
        yard.write("a.tasks", tasks);
        let team = agents.lines().count() - 1;
        let problem = json!({
            "mapFile": "a.map", "agentFile": "a.agents", "taskFile": "a.tasks", "teamSize": team,
        });
        let path = yard.write("a.json", problem.to_string());
        path.display().to_string()
    };
    // The first robot is given the task that is nearer, the second one what is left.
    let train = write("2\n0\n1\n", "2\n4\n5\n", "height 1\nwidth 6\nmap\n......\n");
    for model in ["rotation", "pebble"] {
        let more = format!("--planner pp --model {model} --duration 4s");
        assert_eq!(counts(&outcome(&train, &more)), [4, 2, 2, 0], "{model}");
    }
    // Robot 0 takes the oldest of the tasks that are nearest, and so on: each goes to the next
    // corner, and all of them have to go at once.
    let ring = write(
        "4\n0\n1\n3\n2\n",
        "4\n1\n3\n2\n0\n",
        "height 2\nwidth 2\nmap\n..\n..\n",
    );
    let more = "--planner pp --model pebble --duration 1s --generator one-goal";
    assert_eq!(counts(&outcome(&ring, more)), [1, 4, 4, 0]);
}

/// A planner whose every third answer is invalid: everybody waits in these steps. Of 20 steps 14
/// move a pebble, which does errands after 4, 6, 7, 8, 10, 11, 12 and 14 of them.
#[test]
fn an_invalid_answer_makes_everybody_wait_for_a_step() {
    let plugin = root().join("plugins/faulty/fleet.py");
    let more = |fault: &str| {
        format!(
            "--model pebble --planner {}:faulty-fleet --option fault={fault} --option every=3",
            plugin.display()
        )
    };
    for (fault, event) in [
        ("nonsense", "invalid-batch"),
        ("gives-up", "planner-gave-up"),
    ] {
        let outcome = outcome(&corridor(), &more(fault));
        assert_eq!(counts(&outcome), [20, 5, 8, 6], "{fault}");
        assert_eq!(outcome["metrics"]["event_counts"][event], 6, "{fault}");
    }
    // One that is late, too.
    let late = format!("{} --duration 7s --limit 300ms --grace 0s", more("late"));
    assert_eq!(counts(&outcome(&corridor(), &late)), [7, 0, 1, 2]);
}

#[test]
fn a_run_is_replayed_resumed_and_drawn_like_any_other() {
    let yard = Yard::new();
    let more = "--planner pp --record run --trace run.fyt --picture run.svg";
    let recorded = yard.run(&line(&corridor(), more)).expect(SUCCESS).json();
    let info = yard.line("trace info run.fyt").expect(SUCCESS);
    assert!(info.stdout.contains("rotation"), "{info}");
    assert!(!yard.read("run.svg").is_empty());
    let same = |other: &Value| {
        assert_eq!(recorded["metrics"], other["metrics"]);
        assert_eq!(recorded["series"], other["series"]);
        let digest = |outcome: &Value| outcome["execution"]["trace_digest"].clone();
        assert_eq!(digest(&recorded), digest(other));
    };
    let replayed = yard
        .line("fleet --replay run --format json")
        .expect(SUCCESS);
    same(&replayed.json());
    let text = String::from_utf8(yard.read("run")).unwrap();
    let lines: Vec<&str> = text.split_inclusive('\n').collect();
    assert_eq!(lines.len(), 22);
    yard.write("part", lines[..9].concat());
    let resumed = yard
        .line("fleet --resume part --format json")
        .expect(SUCCESS);
    let resumed = resumed.json();
    assert_eq!(counts(&resumed), counts(&recorded));
    assert_eq!(
        resumed["execution"]["trace_digest"],
        recorded["execution"]["trace_digest"]
    );
    // The same from another place, and not from a map.
    let folder = yard.path("moved");
    fs::create_dir(&folder).unwrap();
    for name in ["json", "map", "agents", "tasks"] {
        let from = root().join(format!("tests/league/corridor.{name}"));
        fs::copy(from, folder.join(format!("corridor.{name}"))).unwrap();
    }
    let moved = yard.line("fleet --replay run --instance moved/corridor.json --format json");
    same(&moved.expect(SUCCESS).json());
    let map = yard
        .line("fleet --replay run --map moved/corridor.map")
        .expect(USAGE);
    assert!(map.stderr.contains("hint: name the new place"), "{map}");
    yard.write("moved/corridor.agents", "2\n1\n0\n");
    let other = yard
        .line("fleet --replay run --instance moved/corridor.json")
        .expect(INPUT);
    assert!(
        other.stderr.contains("robots, tasks, starts or guidance"),
        "{other}"
    );
}

#[test]
fn what_is_wrong_with_an_instance_is_told_with_place_reason_and_hint() {
    let yard = Yard::new();
    for name in ["map", "agents", "tasks"] {
        let from = root().join(format!("tests/league/corridor.{name}"));
        yard.write(&format!("corridor.{name}"), fs::read(from).unwrap());
    }
    let whole = fs::read_to_string(corridor()).unwrap();
    let refused = |from: &str, to: &str, told: &[&str]| {
        assert!(whole.contains(from), "{from}");
        yard.write("a.json", whole.replace(from, to));
        let ended = yard.run(&line("a.json", "--planner pp")).expect(INPUT);
        for words in told {
            assert!(ended.stderr.contains(words), "{to}: {ended}");
        }
    };
    refused(
        "\"teamSize\": 1",
        "\"teamSize\": 3",
        &[
            "a.json: teamSize is 3, but ",
            "corridor.agents has 2 starts",
            "hint: write a teamSize of 1 to 2",
        ],
    );
    refused(
        "corridor.tasks",
        "none.tasks",
        &["none.tasks: no such file", "hint: "],
    );
    refused(
        "\"teamSize\": 1,",
        "\"teamSize\": 1",
        &["a.json:5:", "hint: "],
    );
    refused("teamSize", "team", &["a.json:4:", "unknown field `team`"]);
    refused("1.0", "0.5", &["a.json: numTasksReveal is 0.5", "hint: "]);
    let ended = yard
        .run(&line("nowhere.json", "--planner pp"))
        .expect(INPUT);
    assert!(
        ended.stderr.contains("nowhere.json: no such file"),
        "{ended}"
    );
    yard.write("corridor.tasks", "1\n9\n");
    refused(
        "1.0",
        "1.5",
        &["corridor.tasks:2:1: cell 9 is not on a map of 5 cells"],
    );
}

#[test]
fn what_synchronous_rules_do_not_know_is_refused() {
    let refused = |more: &str, code: i32, told: &str| {
        let ended = Yard::new().run(&line(&corridor(), more)).expect(code);
        assert!(ended.stderr.contains(told), "{more}: {ended}");
        assert!(ended.stderr.contains("hint: "), "{more}: {ended}");
    };
    let pp = "--planner pp";
    refused(
        &format!("{pp} --model agv"),
        INPUT,
        "rules: by synchronous rules robots are pebbles",
    );
    refused(
        &format!("{pp} --motion pebble"),
        INPUT,
        "rules: planners are told the motion `pebble`",
    );
    refused(
        &format!("{pp} --clock realtime"),
        INPUT,
        "rules: the clock is `realtime`",
    );
    refused(&format!("{pp} --dwell 1s"), INPUT, "rules: robots dwell");
    refused(
        &format!("{pp} --delay bernoulli:0.1,1s"),
        INPUT,
        "rules: robots or messages",
    );
    refused(
        &format!("{pp} --step 0.25"),
        INPUT,
        "rules: a step is no whole number of ticks",
    );
    refused(
        &format!("{pp} --agents 3"),
        INPUT,
        "agents: 3 robots, but 1 starts",
    );
    refused("--planner pibt", NO_PLAN, "does not support `rotation`");
}

/// The generator may give tasks, one at a time to each robot.
#[test]
fn tasks_may_be_given_by_the_generator() {
    let more = "--planner pp --model pebble --assign generator";
    assert_eq!(counts(&outcome(&corridor(), more)), [20, 8, 13, 0]);
}
