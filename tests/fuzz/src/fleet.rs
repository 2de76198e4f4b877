//! Fleet files: bodies, models of motion, and who has which.

use fleetyard_sim::motion::{Assignment, FleetError, Profile, State, Target, read_fleet};

use super::check_error;

const SOURCE: &str = "a.fleet.json";

/// More kinds of robots are not driven: that would be most of the time.
const DRIVEN: usize = 8;

/// Reads a fleet file.
pub fn run(data: &[u8]) {
    let file = match read_fleet(SOURCE, data) {
        Ok(file) => file,
        Err(error) => return check_error(&error, SOURCE, data),
    };
    assert!(!file.profiles.is_empty());
    let (Assignment::Each(list) | Assignment::Cycle(list)) = &file.agents else {
        let fleet = file.fleet(3).expect("any number of agents");
        assert_eq!(fleet.agents(), 3);
        return file
            .profiles
            .iter()
            .take(DRIVEN)
            .for_each(|(_, profile)| drive(profile));
    };
    let fleet = file.fleet(list.len()).expect("as many as it lists");
    assert_eq!(fleet.profile_of(), list);
    match (&file.agents, file.fleet(list.len() + 1)) {
        (Assignment::Each(_), other) => {
            assert!(
                matches!(other, Err(FleetError::AgentCount { .. })),
                "{other:?}"
            );
        }
        (_, other) => assert_eq!(other.map(|fleet| fleet.agents()), Ok(list.len() + 1)),
    }
    for shape in fleet.shapes() {
        let (inner, outer) = (shape.inner_radius_m(), shape.effective_radius_m());
        assert!(inner >= 0.0 && inner <= outer * (1.0 + 1e-9) && outer.is_finite());
    }
    file.profiles
        .iter()
        .take(DRIVEN)
        .for_each(|(_, profile)| drive(profile));
}

/// A profile can be written and read, and a robot of that kind is always somewhere.
fn drive(profile: &Profile) {
    profile.validate().expect("what was read can be");
    let text = serde_json::to_string(profile).expect("a profile can be written");
    let again: Profile = serde_json::from_str(&text).expect("and read again");
    assert_eq!(again, *profile, "{text}");
    let model = profile.model;
    assert!(model.arrival_tolerance_m() > 0.0 && model.lateral_tolerance_m() > 0.0);
    let targets = [
        Target {
            x: 1.0,
            y: -0.5,
            heading: Some(2.0),
        },
        Target {
            x: 0.0,
            y: 0.0,
            heading: None,
        },
    ];
    let mut state = State::at_rest(0.0, 0.0, 0.0);
    for target in targets {
        for (ticks, factor) in [(30, 1.0), (10, 0.25), (5, 0.0)] {
            let mut seen = 0;
            model.run(
                &mut state,
                &target,
                ticks,
                1.0 / 60.0,
                factor,
                &mut |state| {
                    seen += 1;
                    let numbers = [
                        state.x,
                        state.y,
                        state.heading,
                        state.vx,
                        state.vy,
                        state.omega,
                    ];
                    assert!(
                        numbers.iter().all(|number| number.is_finite()),
                        "{text} {state:?}"
                    );
                },
            );
            assert_eq!(seen, ticks);
        }
        assert!(model.stop_distance_m(&state) >= 0.0);
        let _ = model.has_arrived(&state, &target);
    }
}
