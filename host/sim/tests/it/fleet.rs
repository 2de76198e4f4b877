//! Fleets and their files.

use fleetyard_sim::motion::{
    Assignment, DifferentialDrive, Fleet, FleetError, Model, Profile, read_fleet,
};
use fleetyard_world::Footprint;

fn fleet_text(profiles: &str, agents: &str) -> String {
    format!(
        "{{\n  \"format\": \"fleetyard.fleet/1\",\n  \"profiles\": {profiles},\n  \"agents\": {agents}\n}}\n"
    )
}

const AGV: &str = r#"{"agv": {"footprint": {"disc": {"radius_m": 0.3}}, "model": {"differential-drive": {"max_speed_m_per_s": 1.5}}}, "dog": "go2"}"#;

#[test]
fn fleets_of_several_kinds() {
    let cases = [
        (r#"["agv", "dog", "agv"]"#, vec![0, 1, 0]),
        (r#"{"cycle": ["dog", "agv"]}"#, vec![1, 0, 1]),
        (r#"{"all": "dog"}"#, vec![1, 1, 1]),
    ];
    for (agents, expected) in cases {
        let file = read_fleet("fleet.json", fleet_text(AGV, agents).as_bytes()).unwrap();
        let fleet = file.fleet(3).unwrap();
        assert_eq!(fleet.profile_of(), expected);
        assert_eq!(fleet.agents(), 3);
        let drive = DifferentialDrive {
            max_speed_m_per_s: 1.5,
            ..DifferentialDrive::default()
        };
        assert_eq!(fleet.profiles()[0].model, Model::DifferentialDrive(drive));
        let dog = Footprint::Rectangle {
            length_m: 0.70,
            width_m: 0.31,
        };
        assert_eq!(fleet.profiles()[1].footprint, dog);
        let radius = fleet.shapes()[0].effective_radius_m();
        assert!((radius - 0.3).abs() < 1e-12);
        assert_eq!(
            fleet.model(1),
            &fleet.profiles()[expected[1] as usize].model
        );
    }
    // Keys in any order.
    let text = format!(
        r#"{{"agents": {{"all": "agv"}}, "profiles": {AGV}, "format": "fleetyard.fleet/1"}}"#
    );
    let file = read_fleet("fleet.json", text.as_bytes()).unwrap();
    assert_eq!(file.agents, Assignment::All(0));
}

#[test]
fn bad_files_are_refused_where_they_are_bad() {
    let all = r#"{"all": "agv"}"#;
    let cases = [
        (String::new(), "fleet.json: the file is empty", "fleet file"),
        (
            "[]".to_owned(),
            "fleet.json:1:1: this is not a JSON object",
            "fleet file",
        ),
        (
            fleet_text(AGV, r#"["agv", "cat"]"#),
            "fleet.json:4:25: \"cat\" is not one of the profiles",
            "name a profile",
        ),
        (
            fleet_text(AGV, r#"{"all": 3}"#),
            "fleet.json:4:21: invalid type: integer `3`, expected the name of a profile",
            "fleet file",
        ),
        (
            fleet_text(AGV, r#"{"some": "agv"}"#),
            "\"some\" is no way",
            "cycle",
        ),
        (
            fleet_text(AGV, r#"{"cycle": []}"#),
            "the cycle is empty",
            "fleet file",
        ),
        (
            fleet_text(AGV, r#"{"all": "agv", "cycle": []}"#),
            "more than one key",
            "cycle",
        ),
        (fleet_text(AGV, "{}"), "agents is empty", "cycle"),
        (
            fleet_text(AGV, "7"),
            "expected a list of names",
            "fleet file",
        ),
        (fleet_text("{}", all), "there are no profiles", "fleet file"),
        (
            fleet_text(r#"{"agv": "agv", "agv": "spot"}"#, all),
            "the profile \"agv\" is there twice",
            "own name",
        ),
        (
            fleet_text(r#"{"agv": "pebble"}"#, all),
            "\"pebble\" is a model without a body",
            "footprint and model",
        ),
        (fleet_text(r#"{"agv": "forklift"}"#, all), "forklift", "agv"),
        (
            fleet_text(
                r#"{"agv": {"footprint": {"disc": {"radius_m": 0.3}}}}"#,
                all,
            ),
            "missing field `model`",
            "fleet file",
        ),
        (
            fleet_text(
                r#"{"agv": {"footprint": {"disc": {"radius_m": -1}}, "model": "agv"}}"#,
                all,
            ),
            "radius_m is -1",
            "size in metres",
        ),
        (
            fleet_text(
                r#"{"agv": {"footprint": {"polygon": {"vertices_m": []}}, "model": "agv"}}"#,
                all,
            ),
            "vertices",
            "",
        ),
        (
            fleet_text(
                r#"{"agv": {"footprint": {"disc": {"radius_m": 0.3}}, "model": {"unicycle-1": {"max_speed_m_per_s": 0}}}}"#,
                all,
            ),
            "max_speed_m_per_s = 0 is out of range",
            "positive",
        ),
        (
            fleet_text(AGV, all).replace("fleet/1", "fleet/9"),
            "format is \"fleetyard.fleet/9\"",
            "fleet file",
        ),
        (
            fleet_text(AGV, all).replace("agents", "robots"),
            "unknown field `robots`",
            "fleet file",
        ),
        (
            format!(r#"{{"format": "fleetyard.fleet/1", "profiles": {AGV}}}"#),
            "missing field `agents`",
            "fleet file",
        ),
        (fleet_text(AGV, all)[..60].to_owned(), "EOF", "truncated"),
    ];
    for (text, expected, hint) in cases {
        let error = read_fleet("fleet.json", text.as_bytes()).expect_err(&text);
        assert!(error.to_string().contains(expected), "{text}: {error}");
        assert!(
            error
                .hint
                .as_deref()
                .is_some_and(|found| found.contains(hint)),
            "{error:?}"
        );
        if !text.is_empty() {
            assert!(error.line.is_some() && error.column.is_some(), "{error:?}");
        }
    }
}

#[test]
fn fleets_fit_their_agents() {
    let file = read_fleet(
        "fleet.json",
        fleet_text(AGV, r#"["agv", "dog"]"#).as_bytes(),
    )
    .unwrap();
    let error = file.fleet(3).unwrap_err();
    assert_eq!(
        error,
        FleetError::AgentCount {
            listed: 2,
            agents: 3
        }
    );
    assert!(error.hint().contains("cycle"));
    let spot = Profile::preset("spot").unwrap();
    assert_eq!(Fleet::uniform(spot.clone(), 4).unwrap().agents(), 4);
    assert!(matches!(
        Fleet::new(vec![spot], vec![0, 1]),
        Err(FleetError::NoProfile { agent: 1, .. })
    ));
    let footprint = Footprint::Disc { radius_m: f64::NAN };
    let ghost = Profile {
        footprint,
        model: "agv".parse().unwrap(),
    };
    assert!(matches!(
        Fleet::uniform(ghost, 1),
        Err(FleetError::Footprint(_))
    ));
}

#[test]
fn profiles_are_written_as_they_are_read() {
    for name in [
        "agv",
        "lsmart-effective",
        "go2",
        "spot",
        "anymal-c",
        "dynobench-unicycle-2",
    ] {
        let profile = Profile::preset(name).unwrap();
        let text = serde_json::to_string(&profile).unwrap();
        assert_eq!(serde_json::from_str::<Profile>(&text).unwrap(), profile);
    }
}

/// The file in docs/execution.md is a fleet, and the error there is that of a mistake in it.
#[test]
fn the_documented_file_is_a_fleet() {
    let page = include_str!("../../../../docs/execution.md");
    let (_, rest) = page.split_once("```json\n").unwrap();
    let (text, rest) = rest.split_once("```").unwrap();
    let fleet = read_fleet("fleet.json", text.as_bytes())
        .unwrap()
        .fleet(8)
        .unwrap();
    assert_eq!(fleet.profile_of(), [0, 0, 2, 1, 0, 0, 2, 1]);
    let (_, error) = rest.split_once("```text\n").unwrap();
    let wrong = text.replace("1.5", "-2");
    let found = read_fleet("fleet.json", wrong.as_bytes()).unwrap_err();
    let shown = format!("{found}\nhint: {}\n", found.hint.as_deref().unwrap());
    assert!(error.starts_with(&shown), "{shown}");
}
