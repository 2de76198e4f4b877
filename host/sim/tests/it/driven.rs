//! Robots with models and controllers: by time and by order, alone and disturbed,
//! on any number of threads.

use std::io;
use std::mem::discriminant;

use crate::common;
use fleetyard_core::{Grid, GridPlan, Knot, TrajectoryPlan};
use fleetyard_sim::motion::{Model, PRESETS};
use fleetyard_sim::trace::{Awaited, Header, States, Waiting};
use fleetyard_sim::{
    Fleet, NoTrace, Outcome, Policy, Profile, SimConfig, SimError, Simulator, Tier, TraceSink,
};
use fleetyard_world::{Boundary, Footprint, Workspace};

fn fleet(model: &str, agents: usize) -> Fleet {
    let profile = Profile {
        footprint: Footprint::Disc { radius_m: 0.3 },
        model: model.parse().expect("a model"),
    };
    Fleet::uniform(profile, agents).expect("a fleet")
}

fn run(grid: &Grid, plan: &GridPlan, model: &str, config: &SimConfig) -> Outcome {
    let fleet = fleet(model, plan.agents());
    Simulator::new(config)
        .on_grid(grid)
        .with_fleet(&fleet)
        .run(plan, &mut NoTrace)
        .unwrap_or_else(|error| panic!("{model}: {error}"))
}

fn world(seed: u64, agents: usize, steps: usize) -> (Grid, GridPlan) {
    let mut rng = common::rng(seed);
    let grid = common::random_grid(&mut rng, 14, 18, 15);
    let plan = common::valid_drives(&mut rng, &grid, agents, steps);
    (grid, plan)
}

fn disturbed(seed: u64) -> SimConfig {
    let mut config = SimConfig {
        policy: Policy::Adg,
        max_contacts_kept: usize::MAX,
        ..SimConfig::default()
    };
    config.disturbance.seed = seed;
    config.disturbance.delay = match seed % 4 {
        0 => "bernoulli:0.3,4s",
        1 => "uniform:0s,3s",
        2 => "gaussian:0.5s,1s",
        _ => "bursts:0.05,10s",
    }
    .parse()
    .expect("a delay");
    config.disturbance.velocity = "0.3,0.1".parse().expect("a noise");
    if seed.is_multiple_of(2) {
        config.disturbance.messages = "0s,0.7s,0.3".parse().expect("messages");
    }
    config
}

const MODELS: [&str; 9] = [
    "pebble",
    "rotation",
    "single-integrator",
    "agv",
    "unicycle-1",
    "unicycle-2",
    "double-integrator",
    "holonomic",
    "waypoint-law",
];

/// Gated execution: whatever is late or lost, nobody touches anybody and everybody
/// arrives.
#[test]
fn gated_robots_never_touch_and_always_arrive() {
    for seed in 0..8 {
        let (grid, plan) = world(seed, 40, 30);
        for model in MODELS {
            let outcome = run(&grid, &plan, model, &disturbed(seed));
            let contacts = outcome.contacts.first.first();
            assert_eq!(contacts, None, "{model}, seed {seed}");
            assert_eq!(outcome.arrived, 40, "{model}, seed {seed}");
            assert!(outcome.makespan_s.is_some_and(|makespan| makespan > 0.0));
        }
    }
}

/// Changes of waits in an execution, with the places of all at the ticks.
#[derive(Default)]
struct Watch {
    has_waits: bool,
    changes: Vec<Waiting>,
    places: Vec<Vec<[u64; 2]>>,
}

impl TraceSink for Watch {
    fn begin(&mut self, header: &Header) -> io::Result<()> {
        self.has_waits = header.waits;
        Ok(())
    }

    fn state(&mut self, _: u64, states: &States<'_>) -> io::Result<()> {
        let places = states.x_m.iter().zip(states.y_m);
        self.places
            .push(places.map(|(x, y)| [x, y].map(|v| v.to_bits())).collect());
        Ok(())
    }

    fn waits(&mut self, changes: &[Waiting]) -> io::Result<()> {
        assert!(!changes.is_empty());
        self.changes.extend_from_slice(changes);
        Ok(())
    }
}

fn watch(grid: &Grid, plan: &GridPlan, model: &str, config: &SimConfig) -> Watch {
    let mut watch = Watch::default();
    Simulator::new(config)
        .on_grid(grid)
        .with_fleet(&fleet(model, plan.agents()))
        .run(plan, &mut watch)
        .unwrap_or_else(|error| panic!("{model}: {error}"));
    watch
}

#[test]
fn who_waits_stands_and_waits_for_somebody_who_goes_on() {
    for seed in 0..8 {
        let (grid, plan) = world(seed, 40, 30);
        let watch = watch(&grid, &plan, "pebble", &disturbed(seed));
        assert!(watch.has_waits);
        assert!(
            watch
                .changes
                .is_sorted_by_key(|change| (change.tick, change.agent))
        );
        let mut waits: Vec<(u64, Awaited)> = vec![(0, Awaited::Nothing); plan.agents()];
        let (mut for_others, mut for_messages) = (0, 0);
        for same in watch.changes.chunk_by(|a, b| a.tick == b.tick) {
            for change in same {
                let agent = change.agent as usize;
                let (since, awaited) =
                    std::mem::replace(&mut waits[agent], (change.tick, change.awaited));
                assert_ne!(awaited, change.awaited, "nothing changes at {change:?}");
                let place = |tick: u64| watch.places[tick as usize][agent];
                if awaited != Awaited::Nothing {
                    assert_eq!(
                        place(since),
                        place(change.tick),
                        "seed {seed}, until {change:?}"
                    );
                }
                for_others += u32::from(matches!(change.awaited, Awaited::Agent(_)));
                for_messages += u32::from(change.awaited == Awaited::Message);
            }
            // Whoever waits waits in the end for somebody who goes on.
            for first in 0..plan.agents() {
                let next = |agent: &usize| match waits[*agent].1 {
                    Awaited::Agent(other) => Some(other as usize),
                    _ => None,
                };
                let chain = std::iter::successors(Some(first), next);
                assert!(chain.take(plan.agents() + 1).count() <= plan.agents());
            }
        }
        assert!(for_others > 10, "seed {seed}: {for_others}");
        assert_eq!(for_messages > 0, seed.is_multiple_of(2), "seed {seed}");
        assert!(
            waits
                .iter()
                .all(|(_, awaited)| *awaited == Awaited::Nothing)
        );
    }
    let (grid, plan) = world(0, 40, 30);
    let by_time = SimConfig {
        policy: Policy::Time,
        ..disturbed(0)
    };
    let watch = watch(&grid, &plan, "pebble", &by_time);
    assert!(!watch.has_waits && watch.changes.is_empty());
}

/// The plan's walks follow each other closely and turn in rings.
#[test]
fn gated_robots_follow_each_other() {
    for seed in 0..6 {
        let mut rng = common::rng(1000 + seed);
        let grid = common::random_grid(&mut rng, 10, 10, 10);
        let plan = common::valid_walks(&mut rng, &grid, 25, 20);
        for model in ["pebble", "agv"] {
            let outcome = run(&grid, &plan, model, &disturbed(seed));
            assert_eq!(outcome.contacts.total(), 0, "{model}, seed {seed}");
            assert_eq!(outcome.arrived, 25, "{model}, seed {seed}");
        }
    }
}

#[test]
fn threads_change_nothing() {
    let (grid, plan) = world(7, 150, 25);
    for model in ["agv", "pebble"] {
        for config in [
            SimConfig::default(),
            disturbed(1),
            disturbed(2),
            SimConfig {
                until_done: true,
                time_limit_s: Some(60.0),
                ..SimConfig::default()
            },
        ] {
            let one = run(&grid, &plan, model, &config);
            for threads in 2..=8 {
                let config = SimConfig {
                    threads,
                    ..config.clone()
                };
                assert_eq!(one, run(&grid, &plan, model, &config), "{model}, {threads}");
            }
        }
    }
}

/// Robots are slower than pebbles, and by time they do not wait for each other:
/// they fall behind the plan and meet.
#[test]
fn by_time_robots_fall_behind() {
    let (grid, plan) = world(3, 60, 40);
    let config = SimConfig {
        until_done: true,
        ..SimConfig::default()
    };
    let pebbles = run(&grid, &plan, "pebble", &SimConfig::default());
    let robots = run(&grid, &plan, "agv", &config);
    assert_eq!(pebbles.contacts.total(), 0);
    assert!(pebbles.tracking_error_max_m <= 0.0);
    assert!(robots.contacts.agent_agent > 0);
    assert_eq!(robots.contacts.agent_obstacle, 0);
    assert!(robots.tracking_error_max_m > 1.0);
    assert_eq!(robots.arrived, 60);
    assert!(robots.makespan_s > pebbles.makespan_s);
}

/// On a grid nobody says which way a rectangle lies: it may lie any way.
#[test]
fn gated_rectangles_on_a_grid_have_room_to_turn() {
    let (grid, plan) = world(11, 40, 25);
    for preset in ["go2", "anymal-c"] {
        let profile = Profile::preset(preset).expect("a preset with a body");
        let turning = Profile {
            model: "agv".parse().expect("a model"),
            ..profile.clone()
        };
        let profiles = vec![profile, turning];
        let fleet = Fleet::new(profiles, (0..40).map(|agent| agent % 2).collect()).unwrap();
        let config = SimConfig {
            cell_size_m: 1.5,
            ..disturbed(2)
        };
        let outcome = Simulator::new(&config)
            .on_grid(&grid)
            .with_fleet(&fleet)
            .run(&plan, &mut NoTrace)
            .unwrap_or_else(|error| panic!("{preset}: {error}"));
        assert_eq!(outcome.contacts.total(), 0, "{preset}");
        assert_eq!(outcome.arrived, 40, "{preset}");
    }
}

/// One robot, one straight way: the time is that of the speed profile.
#[test]
fn a_straight_drive_takes_as_long_as_it_must() {
    let grid = Grid::new("aisle", 1, 30, vec![b'.'; 30]).unwrap();
    let plan = GridPlan::from_paths([(0..=20).collect::<Vec<u32>>()]);
    let config = SimConfig {
        policy: Policy::Adg,
        start_heading_rad: 0.0,
        ..SimConfig::default()
    };
    let outcome = run(&grid, &plan, "agv", &config);
    // 20 m with 2 m/s and 2 m/s²: a second up, a second down, nine in between.
    let makespan = outcome.makespan_s.unwrap();
    assert!((10.9..12.0).contains(&makespan), "{makespan}");
}

fn circle(agents: usize, radius: f64) -> TrajectoryPlan {
    let mut plan = TrajectoryPlan::default();
    for agent in 0..agents {
        let phase = std::f64::consts::TAU * agent as f64 / agents as f64;
        let knots = (0..=40).map(|step| {
            let angle = phase + 0.05 * f64::from(step);
            Knot {
                time_s: f64::from(step),
                x_m: radius * libm::cos(angle),
                y_m: radius * libm::sin(angle),
                heading_rad: Some(angle + std::f64::consts::FRAC_PI_2),
            }
        });
        plan.push_path(knots).expect("a plan");
    }
    plan
}

/// Rectangles on a merry-go-round: exact by time, and safe by order.
#[test]
fn rectangles_that_turn() {
    let plan = circle(8, 4.0);
    for (model, policy) in [
        ("pebble", Policy::Time),
        ("pebble", Policy::Adg),
        ("holonomic", Policy::Time),
        ("holonomic", Policy::Adg),
    ] {
        let profile = Profile {
            footprint: Footprint::Rectangle {
                length_m: 1.1,
                width_m: 0.5,
            },
            model: model.parse().expect("a model"),
        };
        let fleet = Fleet::uniform(profile, 8).expect("a fleet");
        let config = SimConfig {
            policy,
            until_done: true,
            ..SimConfig::default()
        };
        let outcome = Simulator::new(&config)
            .with_fleet(&fleet)
            .run(&plan, &mut NoTrace)
            .unwrap_or_else(|error| panic!("{model}, {policy}: {error}"));
        assert_eq!(outcome.contacts.total(), 0, "{model}, {policy}");
        assert_eq!(outcome.arrived, 8, "{model}, {policy}");
    }
}

#[test]
fn what_cannot_be_is_refused() {
    let (grid, plan) = world(1, 5, 5);
    let config = SimConfig::default();
    let alone = fleet("agv", 4);
    let on_grid = Simulator::new(&config).on_grid(&grid);
    let error = on_grid.with_fleet(&alone).run(&plan, &mut NoTrace);
    assert!(
        matches!(error, Err(SimError::OtherFleet { .. })),
        "{error:?}"
    );
    let error = Simulator::new(&config).run(&plan, &mut NoTrace);
    assert!(matches!(error, Err(SimError::NoMap)), "{error:?}");
    // In each other, and in a wall.
    let error = on_grid.run(&GridPlan::from_paths([[0], [0]]), &mut NoTrace);
    assert!(
        matches!(error, Err(SimError::StartOverlap { .. })),
        "{error:?}"
    );
    let small = SimConfig {
        memory_limit_bytes: Some(1000),
        ..SimConfig::default()
    };
    let error = Simulator::new(&small)
        .on_grid(&grid)
        .run(&plan, &mut NoTrace);
    assert!(matches!(error, Err(SimError::TooLarge { .. })), "{error:?}");
    // Faster than the model.
    let fast = circle(2, 40.0);
    let slow = fleet("holonomic", 2);
    let error = Simulator::new(&config)
        .with_fleet(&slow)
        .run(&fast, &mut NoTrace);
    assert!(matches!(error, Err(SimError::TooFast { .. })), "{error:?}");
    // Two agents that change places can pass in no order.
    let swap = GridPlan::from_paths([[0, 1], [1, 0]]);
    let open = Grid::new("open", 1, 2, b"..".to_vec()).unwrap();
    let gated = SimConfig {
        policy: Policy::Adg,
        ..SimConfig::default()
    };
    let error = Simulator::new(&gated)
        .on_grid(&open)
        .run(&swap, &mut NoTrace);
    assert!(matches!(error, Err(SimError::Gate(_))), "{error:?}");
}

/// In the contact tier robots push each other; by order they have no reason to.
#[test]
fn the_contact_tier_drives_the_same_robots() {
    let (grid, plan) = world(5, 20, 15);
    let config = SimConfig {
        tier: Tier::Contact,
        policy: Policy::Adg,
        ..SimConfig::default()
    };
    let outcome = run(&grid, &plan, "agv", &config);
    assert_eq!(outcome.contacts.total(), 0);
    assert_eq!(outcome.arrived, 20);
    let again = run(&grid, &plan, "agv", &config);
    assert_eq!(outcome, again);
}

/// A new kind of model has to be in the table of those that are driven here.
#[test]
fn every_kind_of_model_is_driven() {
    let driven = MODELS.map(|name| discriminant(&name.parse::<Model>().expect(name)));
    for preset in PRESETS {
        let model = (preset.model)();
        // Cars follow plans in the plane alone.
        if matches!(model, Model::Car(_)) {
            continue;
        }
        let kind = discriminant(&model);
        assert!(driven.contains(&kind), "{}", preset.name);
    }
}

/// The edge of a world is no rectangle: by time a robot drives over it, and where contacts
/// are solved it stops it.
#[test]
fn the_edge_of_a_world_is_met() {
    let corners = [
        [0.0, 0.0],
        [6.0, 0.0],
        [6.0, 2.0],
        [2.0, 2.0],
        [2.0, 6.0],
        [0.0, 6.0],
    ];
    let boundary = Boundary::new(&corners).unwrap();
    let workspace = Workspace {
        name: String::new(),
        bounds: boundary.polygon().bounds(),
        boundary: Some(boundary),
        obstacles: Vec::new(),
        movers: Vec::new(),
    };
    let knot = |time_s: f64, x_m: f64, y_m: f64| Knot {
        time_s,
        x_m,
        y_m,
        heading_rad: None,
    };
    let mut plan = TrajectoryPlan::default();
    plan.push_path([knot(0.0, 5.0, 1.0), knot(4.0, 1.0, 5.0)])
        .unwrap();
    let disc = fleet("pebble", 1);
    let run = |tier: Tier| {
        let config = SimConfig {
            tier,
            max_contacts_kept: usize::MAX,
            ..SimConfig::default()
        };
        Simulator::new(&config)
            .in_workspace(&workspace)
            .with_fleet(&disc)
            .run(&plan, &mut NoTrace)
            .unwrap()
    };
    let kinematic = run(Tier::Kinematic);
    assert_eq!(kinematic.contacts.agent_obstacle, 1);
    let first = &kinematic.contacts.first[0];
    // Its upper side is at y = 2 when its middle is at 1.7: after 0.7 s.
    assert!((first.begin_s - 0.7).abs() < 1e-3, "{first:?}");
    assert_eq!(kinematic.arrived, 1);
    let solved = run(Tier::Contact);
    assert!(solved.contacts.agent_obstacle >= 1);
    assert_eq!(solved.arrived, 0, "it does not get through the notch");
}

/// Routes of one agent each, of poses that a robot is to pass at a metre a second.
fn routes(paths: &[Vec<[f64; 3]>]) -> TrajectoryPlan {
    let mut plan = TrajectoryPlan::default();
    for path in paths {
        let mut time_s = 0.0;
        let mut before = path[0];
        let knots = path.iter().map(|[x_m, y_m, heading]| {
            let (dx, dy) = (x_m - before[0], y_m - before[1]);
            time_s += (dx * dx + dy * dy).sqrt() + (heading - before[2]).abs();
            before = [*x_m, *y_m, *heading];
            Knot {
                time_s,
                x_m: *x_m,
                y_m: *y_m,
                heading_rad: Some(*heading),
            }
        });
        plan.push_path(knots).expect("a path");
    }
    plan
}

fn drive(plan: &TrajectoryPlan, models: &[&str], config: &SimConfig) -> Result<Outcome, SimError> {
    let profiles = models.iter().map(|model| {
        Profile::preset(model).unwrap_or_else(|_| Profile {
            footprint: Footprint::Disc { radius_m: 0.2 },
            model: model.parse().expect("a model"),
        })
    });
    let of_agent = (0..plan.agents() as u32).map(|agent| agent % models.len() as u32);
    let fleet = Fleet::new(profiles.collect(), of_agent.collect()).expect("a fleet");
    Simulator::new(config)
        .with_fleet(&fleet)
        .run(plan, &mut NoTrace)
}

fn by_order() -> SimConfig {
    SimConfig {
        policy: Policy::Adg,
        ..SimConfig::default()
    }
}

/// Bodies that move in any direction do not stop where their way bends, and stay as near to it as their
/// tolerances say, headings included.
#[test]
fn bends_need_no_stop() {
    let arc = |knots: usize| -> Vec<[f64; 3]> {
        let angle = |knot: usize| 3.0 * knot as f64 / knots as f64;
        (0..=knots)
            .map(|knot| {
                [
                    2.0 * libm::sin(angle(knot)),
                    2.0 * (1.0 - libm::cos(angle(knot))),
                    0.3 * angle(knot),
                ]
            })
            .collect()
    };
    for (model, most_s) in [
        ("double-integrator", 15.0),
        ("holonomic", 17.0),
        ("go2", 12.0),
    ] {
        for knots in [12, 120, 1200] {
            let plan = routes(&[arc(knots)]);
            for tier in [Tier::Kinematic, Tier::Contact] {
                let config = SimConfig { tier, ..by_order() };
                let outcome = drive(&plan, &[model], &config).unwrap();
                keeps_to_its_way(&outcome, model, &format!("{knots} knots"));
                assert!(
                    outcome.makespan_s.unwrap() < most_s,
                    "{model}, {knots}: {outcome:?}"
                );
            }
        }
    }
}

/// A body that turns while it moves by a centimetre turns before it goes on, and its turning is no error.
#[test]
fn turns_on_short_ways_are_driven() {
    let way = [
        [0.0, 0.0, 0.0],
        [2.0, 0.0, 0.0],
        [2.01, 0.0, 2.3],
        [4.0, 0.2, 2.3],
        [4.0, 0.21, -0.4],
    ];
    let dense: Vec<[f64; 3]> = way
        .windows(2)
        .flat_map(|ends| (0..20).map(move |part| (ends, f64::from(part) / 20.0)))
        .map(|(ends, share)| {
            [0, 1, 2].map(|axis| ends[0][axis] + share * (ends[1][axis] - ends[0][axis]))
        })
        .chain(way.last().copied())
        .collect();
    for knots in [way.to_vec(), dense] {
        let plan = routes(&[knots]);
        for model in ["go2", "spot", "anymal-c"] {
            for tier in [Tier::Kinematic, Tier::Contact] {
                for smooth_m in [0.0, 0.05] {
                    let config = SimConfig {
                        tier,
                        smooth_m,
                        ..by_order()
                    };
                    let outcome = drive(&plan, &[model], &config).unwrap();
                    keeps_to_its_way(&outcome, model, &format!("smooth by {smooth_m} m"));
                }
            }
        }
    }
}

/// An execution in which all arrive within tolerances of their ways; drives are not instant in the contact tier.
fn keeps_to_its_way(outcome: &Outcome, model: &str, what: &str) {
    let of: Model = model.parse().unwrap();
    let slack = if outcome.tier == Tier::Contact {
        1.3
    } else {
        1.05
    };
    let (m, rad) = (
        outcome.tracking_error_max_m,
        outcome.tracking_error_max_rad.unwrap(),
    );
    let tier = outcome.tier;
    assert_eq!(outcome.arrived, outcome.agents, "{model}, {tier}, {what}");
    assert!(
        m <= slack * of.lateral_tolerance_m(),
        "{model}, {tier}, {what}: {m} m"
    );
    assert!(
        rad <= 1.2 * of.heading_tolerance_rad(),
        "{model}, {tier}, {what}: {rad} rad"
    );
}

/// Round corners are driven on the curve, by order in no other time than bends need, and by time nearer
/// to the plan.
#[test]
fn round_corners_are_driven_without_a_stop() {
    let zigzag: Vec<[f64; 3]> = (0..10)
        .map(|corner| [1.2 * f64::from(corner), 0.6 * f64::from(corner % 2), 0.0])
        .collect();
    let plan = routes(&[zigzag]);
    for model in ["go2", "spot", "anymal-c", "pebble"] {
        for tier in [Tier::Kinematic, Tier::Contact] {
            let config = SimConfig { tier, ..by_order() };
            let round = SimConfig {
                smooth_m: 0.15,
                ..config.clone()
            };
            let [sharp, round] =
                [&config, &round].map(|config| drive(&plan, &[model], config).unwrap());
            assert_ne!(sharp.trace_digest, round.trace_digest);
            if model != "pebble" {
                keeps_to_its_way(&round, model, "round corners");
            }
        }
    }
    let by_time = |model: &str, smooth_m: f64| {
        let config = SimConfig {
            smooth_m,
            until_done: true,
            ..SimConfig::default()
        };
        drive(&plan, &[model], &config)
            .unwrap()
            .tracking_error_max_m
    };
    assert!(by_time("pebble", 0.15) <= 0.0);
    assert!(by_time("go2", 0.15) < by_time("go2", 0.0));
}

/// Robots that turn where they drive stop at each knot of a curve, and pebbles have no velocity.
#[test]
fn curves_and_errors_of_velocity_need_robots_for_them() {
    let corner = routes(&[vec![[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]]]);
    let smooth_m = 0.1;
    let error = drive(
        &corner,
        &["agv"],
        &SimConfig {
            smooth_m,
            ..by_order()
        },
    )
    .unwrap_err();
    assert!(
        matches!(error, SimError::Corners { agent: 0, .. }),
        "{error}"
    );
    assert!(error.hint().is_some());
    drive(
        &corner,
        &["agv"],
        &SimConfig {
            smooth_m,
            ..SimConfig::default()
        },
    )
    .unwrap();
    for wrong in [-0.1, f64::NAN, 1e7] {
        let error = drive(
            &corner,
            &["go2"],
            &SimConfig {
                smooth_m: wrong,
                ..by_order()
            },
        )
        .unwrap_err();
        assert!(
            matches!(
                error,
                SimError::Config {
                    field: "smooth_m",
                    ..
                }
            ),
            "{error}"
        );
    }
    let mut slips = by_order();
    slips.disturbance.twist = "0.05,0.02".parse().unwrap();
    for model in ["pebble", "single-integrator"] {
        let error = drive(&corner, &[model], &slips).unwrap_err();
        assert!(
            matches!(error, SimError::NoSlip { agent: 0, .. }),
            "{error}"
        );
    }
    drive(&corner, &["agv"], &slips).unwrap();
    // On a grid as in the plane.
    let (grid, plan) = world(2, 10, 20);
    let sharp = run(&grid, &plan, "holonomic", &by_order());
    let round = run(
        &grid,
        &plan,
        "holonomic",
        &SimConfig {
            smooth_m,
            ..by_order()
        },
    );
    assert_eq!(round.contacts.total(), 0);
    assert!(round.arrived == 10 && round.makespan_s != sharp.makespan_s);
}

/// Pieces of centimetres and of metres, gentle bends and sharp ones, turns on the way and in place.
#[test]
fn bends_of_any_kind_are_kept_to() {
    for seed in 0..32 {
        let mut rng = common::rng(7000 + seed);
        let mut unit = || common::below(&mut rng, 1 << 20) as f64 / f64::from(1 << 20);
        let step = [0.02, 0.1, 0.4, 1.5][seed as usize % 4];
        let sharp = [0.2, 0.7, 1.5, 3.1][seed as usize / 4 % 4];
        let mut here = [0.0; 3];
        let mut way = 0.0;
        let mut path = vec![here];
        for _ in 0..60 {
            way += sharp * (2.0 * unit() - 1.0);
            let length = step * (0.2 + unit());
            let turn = if unit() < 0.5 {
                0.0
            } else {
                0.5 * length * (2.0 * unit() - 1.0)
            };
            here = [
                here[0] + length * libm::cos(way),
                here[1] + length * libm::sin(way),
                here[2] + turn,
            ];
            if unit() < 0.1 {
                here[2] += 2.0 * unit() - 1.0;
                // In place.
                path.push([path[path.len() - 1][0], path[path.len() - 1][1], here[2]]);
            }
            path.push(here);
        }
        let plan = routes(&[path]);
        for model in ["double-integrator", "holonomic", "go2", "anymal-c"] {
            for tier in [Tier::Kinematic, Tier::Contact] {
                let config = SimConfig { tier, ..by_order() };
                let outcome = drive(&plan, &[model], &config).unwrap();
                keeps_to_its_way(&outcome, model, &format!("seed {seed}"));
            }
        }
    }
}
