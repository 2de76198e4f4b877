//! `fleetyard simulate`: plans executed with robots as they are, on the command line.

use fleetyard_testkit::{Ended, INPUT, INVALID_PLAN, SUCCESS, USAGE, Yard, each, root};

/// Two agents that meet in a crossing, the second a step later.
fn yard() -> Yard {
    let yard = Yard::new();
    yard.write(
        "a.map",
        "type octile\nheight 5\nwidth 5\nmap\n@@.@@\n@@.@@\n.....\n@@.@@\n@@.@@\n",
    );
    yard.write(
        "plan.json",
        r#"{"format": "fleetyard.plan/1", "rows": 5, "cols": 5, "paths": [
            [[2, 0], [2, 1], [2, 2], [2, 3], [2, 4]],
            [[0, 2], [0, 2], [1, 2], [2, 2], [3, 2], [4, 2]]]}"#,
    );
    yard
}

fn simulate(yard: &Yard, options: &str) -> Ended {
    yard.line(&format!("simulate --map a.map plan.json {options}"))
}

fn json(yard: &Yard, options: &str) -> serde_json::Value {
    simulate(yard, &format!("{options} --format json"))
        .expect(SUCCESS)
        .json()
}

#[test]
fn pebbles_keep_time_and_robots_do_not() {
    let yard = yard();
    let pebbles = json(&yard, "");
    assert_eq!(pebbles["contacts"], 0);
    assert_eq!(pebbles["makespan_s"], 5.0);
    assert_eq!(pebbles["tracking_error_max_m"], 0.0);
    // A robot that faces the wrong way has to turn first, and is not there in time.
    let robots = json(&yard, "--model agv --until-done");
    assert_eq!(robots["arrived"], 2);
    assert!(robots["makespan_s"].as_f64() > Some(5.0));
    assert!(robots["tracking_error_max_m"].as_f64() > Some(0.5));
    let cut = json(&yard, "--model agv");
    assert_eq!(cut["makespan_s"], serde_json::Value::Null);
}

/// The agent that turns first would be run over by the one that goes straight on.
#[test]
fn order_keeps_robots_apart() {
    let yard = yard();
    let by_time = json(&yard, "--model agv --start-heading -70 --until-done");
    assert!(by_time["contacts"].as_u64() > Some(0), "{by_time}");
    for model in ["agv", "rotation", "go2 --cell-size 2", "pebble"] {
        let options = format!(
            "--model {model} --start-heading -70 --policy adg --delay bernoulli:0.5,3s \
             --velocity-noise 0.3,0.1 --messages 0s,1s,0.3 --seed 7"
        );
        let by_order = json(&yard, &options);
        assert_eq!(by_order["contacts"], 0, "{model}: {by_order}");
        assert_eq!(by_order["arrived"], 2, "{model}: {by_order}");
        let again = json(&yard, &format!("{options} --threads 3"));
        assert_eq!(by_order["trace_digest"], again["trace_digest"], "{model}");
        let other = json(&yard, &options.replace("--seed 7", "--seed 8"));
        assert_ne!(by_order["trace_digest"], other["trace_digest"], "{model}");
    }
}

#[test]
fn a_script_can_fail_on_what_may_not_happen() {
    let yard = yard();
    // The plan without trouble.
    simulate(&yard, "--fail-on contacts,unfinished").expect(SUCCESS);
    let touch = "--model agv --start-heading -70 --until-done";
    // Asked for nothing, it only tells.
    simulate(&yard, touch).expect(SUCCESS);
    for what in ["contacts", "agent-contacts", "unfinished,agent-contacts"] {
        let ended = simulate(&yard, &format!("{touch} --fail-on {what}")).expect(INVALID_PLAN);
        assert!(ended.stdout.contains("contacts"), "{ended}");
        assert!(
            ended.stderr.contains("error: the execution had "),
            "{ended}"
        );
    }
    simulate(
        &yard,
        &format!("{touch} --fail-on obstacle-contacts,unfinished"),
    )
    .expect(SUCCESS);
    let late = simulate(&yard, "--model agv --fail-on unfinished").expect(INVALID_PLAN);
    let told = "that did not arrive";
    assert!(late.stderr.contains(told), "{late}");
    let wrong = simulate(&yard, "--fail-on collisions").expect(USAGE);
    let allowed = "[possible values: contacts, agent-contacts, obstacle-contacts, unfinished]";
    assert!(wrong.stderr.contains(allowed), "{wrong}");
}

#[test]
fn events_come_in_lines() {
    let yard = yard();
    simulate(&yard, "--policy adg --events events.jsonl --trace t.fyt").expect(SUCCESS);
    let text = String::from_utf8(yard.read("events.jsonl")).unwrap();
    let kinds: Vec<serde_json::Value> = text
        .lines()
        .map(|line| serde_json::from_str::<serde_json::Value>(line).unwrap()["kind"].clone())
        .collect();
    assert_eq!(kinds, ["arrive", "arrive"]);
    yard.line("trace info t.fyt").expect(SUCCESS);
}

#[test]
fn worlds_and_fleets_are_files() {
    let yard = yard();
    yard.write(
        "world.json",
        r#"{"format": "fleetyard.world/1", "bounds_m": [0, 0, 5, 5],
            "movers": [{"footprint": {"disc": {"radius_m": 0.3}}, "knots": [[0, 4.5, 2.5, 0], [4, 0.5, 2.5, 0]]}]}"#,
    );
    yard.write(
        "fleet.json",
        r#"{"format": "fleetyard.fleet/1",
            "profiles": {"small": {"footprint": {"disc": {"radius_m": 0.1}}, "model": "pebble"}, "agv": "agv"},
            "agents": ["small", "agv"]}"#,
    );
    let swept = json(&yard, "--world world.json");
    assert!(
        swept["contacts_agent_obstacle"].as_u64() > Some(0),
        "{swept}"
    );
    let fleet = json(&yard, "--fleet fleet.json --policy adg");
    assert_eq!(fleet["arrived"], 2);
    assert_eq!(fleet["radius_m"], 0.3);
}

/// A plan on a roadmap is shown on its roadmap, and a world by the edge that it has.
#[test]
fn pictures_and_replays_show_the_roadmap_and_the_edge_of_the_world() {
    const ROADMAP: &str = "stroke=\"#b9b4a8\"";
    let yard = yard();
    let plan = root().join("maps/two-rooms.roadmap-plan.json");
    let plan = plan.display();
    yard.write(
        "world.json",
        r#"{"format": "fleetyard.world/1",
            "boundary_m": [[0, 0], [10, 0], [10, 4], [9, 6], [0, 6]]}"#,
    );
    let simulate = format!("simulate {plan} --radius 0.3");
    yard.line(&format!("{simulate} --picture bare.svg"))
        .expect(SUCCESS);
    let options = "--world world.json --picture plan.svg --trace t.fyt";
    yard.line(&format!("{simulate} {options}")).expect(SUCCESS);
    yard.line("trace export t.fyt --svg trace.svg --html page.html --json t.json")
        .expect(SUCCESS);
    let text = |name: &str| String::from_utf8(yard.read(name)).unwrap();
    for name in ["bare.svg", "plan.svg", "trace.svg"] {
        assert_eq!(text(name).matches(ROADMAP).count(), 1, "{name}");
        assert_eq!(text(name).contains("evenodd"), name != "bare.svg", "{name}");
    }
    let document: serde_json::Value = serde_json::from_str(&text("t.json")).unwrap();
    let roadmap = document["scene"]["roadmap_m"].as_array().unwrap();
    assert!(!roadmap.is_empty());
    assert_eq!(
        document["scene"]["outline_m"][3],
        serde_json::json!([9.0, 6.0])
    );
    let page = text("page.html");
    assert!(
        page.contains("\"outline\":[0.0,0.0,10.0,0.0,"),
        "the page has no outline"
    );
    assert!(!page.contains("\"roadmap\":[]"), "the page has no roadmap");
    let info = yard.line("trace info t.fyt").expect(SUCCESS);
    assert!(info.stdout.contains("a polygon of 5 corners"), "{info}");
    // The same edge is judged.
    let validate = format!("validate {plan} --world world.json --radius");
    yard.line(&format!("{validate} 0.3")).expect(SUCCESS);
    let ended = yard.line(&format!("{validate} 1.2")).expect(INVALID_PLAN);
    assert!(ended.stdout.contains("out-of-bounds: agent"), "{ended}");
}

#[test]
fn what_is_wrong_is_said() {
    let yard = yard();
    yard.write(
        "fleet.json",
        r#"{"format": "fleetyard.fleet/1", "profiles": {"a": "agv"}, "agents": ["a"]}"#,
    );
    yard.write(
        "swap.json",
        r#"{"format": "fleetyard.plan/1", "rows": 5, "cols": 5, "paths": [
            [[2, 0], [2, 1]], [[2, 1], [2, 0]]]}"#,
    );
    yard.write(
        "wall.json",
        r#"{"format": "fleetyard.plan/1", "rows": 5, "cols": 5, "paths": [[[0, 0], [0, 1]]]}"#,
    );
    let rows = [
        ("simulate plan.json", INPUT, "needs the map"),
        (
            "simulate --map a.map plan.json --fleet fleet.json",
            INPUT,
            "lists 1 agents",
        ),
        (
            "simulate --map a.map plan.json --model cart",
            USAGE,
            "not a model",
        ),
        (
            "simulate --map a.map plan.json --delay often",
            USAGE,
            "--delay",
        ),
        (
            "simulate --map a.map plan.json --message-period 0",
            INPUT,
            "message_period_s",
        ),
        (
            "simulate --map a.map swap.json --policy adg",
            INPUT,
            "agents 0 and 1",
        ),
        (
            "simulate --map a.map wall.json",
            INPUT,
            "begins in the solid cell",
        ),
    ];
    each(rows, |(line, exit, part)| {
        let ended = yard.line(line).expect(exit);
        assert!(ended.stderr.contains(part), "{line}: {ended}");
        assert_eq!(ended.stdout, "", "{line}");
    });
    // Nothing is left of an execution that was refused.
    yard.line("simulate --map a.map swap.json --policy adg --trace t.fyt --events e.jsonl")
        .expect(INPUT);
    assert!(!yard.path("t.fyt").exists());
    assert!(!yard.path("e.jsonl").exists());
}
