//! Task files: what is read is what is written, and what is wrong is refused at its place.

use std::path::PathBuf;

use fleetyard_check::Pace;
use fleetyard_core::{InputError, Separation};
use fleetyard_views::{Problem, View, load_problem, load_task, read_task, write_task};
use fleetyard_world::{load_workspace, write_workspace};

pub(crate) fn maps(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("../../maps")
        .join(name)
}

pub(crate) const TASKS: [&str; 3] = ["two-rooms.task.json", "window.task.json", "maze.task.json"];

/// Set `FLEETYARD_REGENERATE=1` to write the files as they would be written now.
#[test]
fn tasks_are_as_they_would_be_written() {
    let check = |name: &str, written: &[u8]| {
        if std::env::var_os("FLEETYARD_REGENERATE").is_some() {
            fleetyard_core::write_atomically(&maps(name), written).unwrap();
        }
        let found = std::fs::read(maps(name)).unwrap();
        assert!(found == written, "{name} is not what would be written");
    };
    for name in ["window.world.json", "floor.world.json"] {
        let world = load_workspace(maps(name)).unwrap();
        check(name, &write_workspace(&world));
    }
    for name in TASKS
        .into_iter()
        .chain(["floor.task.json", "rover.task.json"])
    {
        let file = maps(name);
        let task = load_task(&file).unwrap();
        let written = write_task(&task);
        check(name, &written);
        let again = read_task(&task.source, &written).unwrap();
        assert_eq!(again, task);
        let problem = load_problem(&file).unwrap();
        assert_eq!(problem.fleet.agents(), task.agents.len());
        assert!(problem.common_radius_m() > 0.0);
    }
}

fn refused(text: &str) -> InputError {
    read_task("a.task.json", text.as_bytes()).unwrap_err()
}

#[test]
fn what_is_wrong_has_its_place() {
    let with = |keys: &str, agents: &str| {
        format!("{{\n\"format\": \"fleetyard.task/1\",\n{keys},\n\"agents\": [{agents}]\n}}")
    };
    let kinds = r#""world": "w", "robots": {"go": "go2", "spot": "spot"}"#;
    let agent = r#"{"robot": "go", "start": [0, 0], "goal": [1, 1]}"#;
    assert!(read_task("a", with(kinds, agent).as_bytes()).is_ok());
    let cases = [
        (with(kinds, ""), "a.task.json:4:12: there are no agents"),
        (
            with(
                kinds,
                r#"{"robot": "dog", "start": [0, 0], "goal": [1, 1]}"#,
            ),
            "a.task.json:4:60: \"dog\" is not one of the robots",
        ),
        (
            with(kinds, r#"{"start": [0, 0], "goal": [1, 1]}"#),
            "a.task.json:4:44: the agent does not say which robot it is",
        ),
        (
            with(kinds, r#"{"robot": "go", "start": [0], "goal": [1, 1]}"#),
            "a.task.json:4:39: invalid length 1, expected a place [x, y] or [x, y, heading], with a \
             trailer [x, y, heading, trailer heading]",
        ),
        (
            with(
                r#""world": "w", "map": "m", "robots": {"go": "go2"}"#,
                agent,
            ),
            "a.task.json: there are both world and map",
        ),
        (
            with(r#""map": "m", "robots": {"go": "go2"}"#, agent),
            "a.task.json: a map has no size without cell_size_m",
        ),
        (
            with(r#""world": "w""#, agent),
            "a.task.json: there are neither robots nor fleet",
        ),
        (
            with(r#""world": "w", "fleet": "f""#, agent),
            "a.task.json:4:59: the agent names a robot, but the fleet file deals them",
        ),
    ];
    for (text, told) in cases {
        let error = refused(&text);
        assert_eq!(error.to_string(), told, "{text}");
        assert!(error.hint.is_some(), "{error:?}");
    }
}

/// A problem of a folder of its own: discs of 0.25 m on 4 by 4 m.
pub(crate) fn problem_in(obstacle: &str, agents: &str) -> Result<Problem, InputError> {
    let folder = tempfile::tempdir().unwrap();
    let world = format!(
        r#"{{"format": "fleetyard.world/1", "bounds_m": [0, 0, 4, 4], "obstacles": [{obstacle}]}}"#
    );
    std::fs::write(folder.path().join("w.json"), world).unwrap();
    let task = format!(
        r#"{{"format": "fleetyard.task/1", "world": "w.json", "robots": {{"disc":
        {{"footprint": {{"disc": {{"radius_m": 0.25}}}}, "model": {{"single-integrator": {{"speed_m_per_s": 1}}}}}}}},
        "agents": [{agents}]}}"#
    );
    let file = folder.path().join("t.task.json");
    std::fs::write(&file, task).unwrap();
    load_problem(&file)
}

/// A car with a trailer tells planners of it, and stands nowhere that it cannot.
#[test]
fn trailers_are_part_of_tasks() {
    let problem = load_problem(maps("yard.task.json")).unwrap();
    let again = read_task("a", &write_task(&problem.task)).unwrap();
    assert_eq!(again.agents, problem.task.agents);
    let instance = View::Continuous.instance(
        &problem,
        View::Continuous.terms(&problem, Separation::default(), Pace::StopGo, None),
    );
    let truck = &instance.robots[0];
    assert_eq!(truck.dynamics, "fleetyard.car-trailer/1");
    assert_eq!(truck.parameters[..2], [0.25, 0.5]);
    assert_eq!(instance.start_states[0].0, [0.9, 0.7, 0.0, 0.0]);
    let car = &instance.robots[1];
    assert_eq!(
        (car.dynamics.as_str(), car.parameters.len()),
        ("fleetyard.car/1", 1)
    );
    assert_eq!(
        instance.needs_features(),
        [
            "dynamics:fleetyard.car-trailer/1",
            "dynamics:fleetyard.car/1"
        ]
    );
    instance.check(None).unwrap();
    // r_com is that of the truck, with all that it tows.
    assert!((problem.common_radius_m() - 0.65f64.hypot(0.125)).abs() < 1e-12);

    let with = |agent: &str| {
        let folder = tempfile::tempdir().unwrap();
        let world = "yard.world.json";
        std::fs::copy(maps(world), folder.path().join(world)).unwrap();
        let task = format!(
            r#"{{"format": "fleetyard.task/1", "world": "yard.world.json", "agents": [{agent}],
            "robots": {{"truck": "dynobench-car-trailer", "car": "dynobench-car"}}}}"#
        );
        let file = folder.path().join("t.task.json");
        std::fs::write(&file, task).unwrap();
        load_problem(&file)
    };
    for (agent, reason) in [
        (
            r#"{"robot": "car", "start": [1, 1, 0, 0], "goal": [2, 2]}"#,
            "the start of agent 0 has four numbers, but its robot tows no trailer",
        ),
        (
            r#"{"robot": "truck", "start": [1, 1, 0, 0.9], "goal": [2, 2]}"#,
            "the start of agent 0 bends the joint to its trailer by 0.9000 rad",
        ),
        (
            r#"{"robot": "truck", "start": [0.5, 1], "goal": [2, 2]}"#,
            "the start of agent 0 has its trailer 0.1500 m inside an obstacle or the edge",
        ),
        (
            r#"{"robot": "truck", "start": [1, 1], "goal": [3.4, 1, 0, 0.5]}"#,
            "the goal of agent 0 has its trailer",
        ),
        (
            r#"{"robot": "truck", "start": [1, 1], "goal": [4, 2]},
               {"robot": "car", "start": [0.5, 1], "goal": [1, 3]}"#,
            "the starts of agents 0 and 1 overlap by",
        ),
    ] {
        let error = with(agent).unwrap_err();
        assert!(error.reason.starts_with(reason), "{error}");
        assert!(error.hint.is_some(), "{error}");
    }
    // Without its heading at the goal the trailer may be anyhow.
    let open = with(r#"{"robot": "truck", "start": [1, 1], "goal": [3.4, 1]}"#).unwrap();
    let terms = View::Continuous.terms(&open, Separation::default(), Pace::StopGo, None);
    let instance = View::Continuous.instance(&open, terms);
    assert!(
        instance.goal_states.items()[0].0[2..]
            .iter()
            .all(|number| number.is_nan())
    );
    assert_eq!(instance.start_states[0].0, [1.0, 1.0, 0.0, 0.0]);
}

#[test]
fn starts_and_goals_are_free() {
    let problem = |agents: &str| {
        problem_in(
            r#"{"rectangle": {"center": [2, 2], "size": [1, 1]}}"#,
            agents,
        )
    };
    let agent = |start: &str, goal: &str| format!(r#"{{"start": {start}, "goal": {goal}}}"#);
    // Touching is allowed.
    assert!(problem(&agent("[0.25, 0.25]", "[1.25, 2]")).is_ok());
    let two = agent("[1, 1]", "[3, 3]") + "," + &agent("[1.4, 1]", "[3, 1]");
    let cases = [
        (
            agent("[1.3, 2]", "[3, 3]"),
            "the start of agent 0 at (1.3, 2) is 0.0500 m inside",
        ),
        (
            agent("[1, 1]", "[2, 2]"),
            "the goal of agent 0 at (2, 2) is outside of the free space",
        ),
        (
            agent("[1, 1]", "[3.9, 3]"),
            "the goal of agent 0 at (3.9, 3) is 0.1500 m inside",
        ),
        (two, "the starts of agents 0 and 1 overlap by 0.1000 m"),
    ];
    for (agents, told) in cases {
        let error = problem(&agents).unwrap_err();
        assert!(error.reason.starts_with(told), "{error}");
        assert!(error.hint.is_some());
    }
}
