//! Cars follow their plans exactly, and their trailers follow them.

use std::f64::consts::FRAC_PI_2;

use fleetyard_core::{Grid, GridPlan, Knot, TrajectoryPlan};
use fleetyard_sim::{
    Fleet, NoTrace, Outcome, Policy, Profile, SimConfig, SimError, Simulator, Tier,
};
use fleetyard_world::{Bounds, Polygon, Workspace};

fn fleet(name: &str) -> Fleet {
    Fleet::uniform(Profile::preset(name).unwrap(), 1).unwrap()
}

/// A quarter of a circle of a metre about the origin, to the left, then half a metre ahead.
fn bend() -> TrajectoryPlan {
    let knot = |number: u32| {
        let angle = f64::from(number) * 0.01 * FRAC_PI_2;
        Knot {
            time_s: 2.0 * angle,
            x_m: libm::cos(angle),
            y_m: libm::sin(angle),
            heading_rad: Some(angle + FRAC_PI_2),
        }
    };
    let last = knot(100);
    let ahead = Knot {
        time_s: last.time_s + 1.0,
        x_m: last.x_m - 0.5,
        ..last
    };
    let mut plan = TrajectoryPlan::default();
    plan.push_path((0..=100).map(knot).chain([ahead])).unwrap();
    plan
}

/// A box that the car clears, and its trailer does not.
fn world() -> Workspace {
    let corners = [[0.4, 0.4], [0.56, 0.4], [0.56, 0.56], [0.4, 0.56]];
    Workspace {
        name: String::new(),
        bounds: Bounds {
            min: [-3.0; 2],
            max: [3.0; 2],
        },
        boundary: None,
        obstacles: vec![Polygon::new(&corners).unwrap()],
        movers: Vec::new(),
    }
}

fn run(name: &str, trailers: &[Option<f64>], config: &SimConfig) -> Result<Outcome, SimError> {
    let (fleet, world) = (fleet(name), world());
    Simulator::new(config)
        .in_workspace(&world)
        .with_fleet(&fleet)
        .towing(trailers)
        .run(&bend(), &mut NoTrace)
}

#[test]
fn a_trailer_is_a_body_of_its_own_that_does_not_touch_its_car() {
    let config = SimConfig::default();
    let alone = run("dynobench-car", &[], &config).unwrap();
    assert_eq!((alone.agents, alone.contacts.total()), (1, 0));
    let towing = run("dynobench-car-trailer", &[Some(1.05)], &config).unwrap();
    assert_eq!((towing.agents, towing.arrived), (1, 1));
    assert_eq!(towing.sum_of_costs_s, alone.sum_of_costs_s);
    let contacts = &towing.contacts.first;
    assert_eq!(contacts.len(), 1, "{contacts:?}");
    assert_eq!(contacts[0].agent, 1, "the trailer, not the car");
    assert!(
        towing.nearest_approach.is_none(),
        "a car and its trailer are one robot"
    );
    // It begins elsewhere, and is elsewhere.
    let other = run("dynobench-car-trailer", &[None], &config).unwrap();
    assert_ne!(other.trace_digest, towing.trace_digest);
    let threads = SimConfig {
        threads: 2,
        ..SimConfig::default()
    };
    let again = run("dynobench-car-trailer", &[Some(1.05)], &threads).unwrap();
    assert_eq!(again.trace_digest, towing.trace_digest);
}

#[test]
fn cars_go_by_time_and_undisturbed() {
    let refused = |config: &SimConfig, reason: &str| {
        let error = run("dynobench-car", &[], config).unwrap_err();
        assert!(error.to_string().contains(reason), "{error}");
        assert!(error.hint().is_some());
    };
    let usual = SimConfig::default;
    let config = SimConfig {
        policy: Policy::Adg,
        ..usual()
    };
    refused(&config, "an execution by order");
    let config = SimConfig {
        tier: Tier::Contact,
        ..usual()
    };
    refused(&config, "the contact tier");
    let mut config = usual();
    config.disturbance.delay = "bernoulli:0.3,4s".parse().unwrap();
    refused(&config, "disturbances");
    // On a grid it would turn where it stands.
    let grid = Grid::new("open", 2, 2, vec![b'.'; 4]).unwrap();
    let plan = GridPlan::from_paths([[0, 1]]);
    let (fleet, config) = (fleet("dynobench-car"), usual());
    let ended = Simulator::new(&config)
        .on_grid(&grid)
        .with_fleet(&fleet)
        .run(&plan, &mut NoTrace);
    assert!(matches!(ended, Err(SimError::Car { agent: 0, .. })));
}
